"""Newton directions: solves with the exact Jacobian, Eqs. (16) and (17), and the sign of its determinant.

A small Jacobian is factorised, a large one is solved by GMRES with an earlier factorisation, corrected where GMRES was.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from solver.harmonic_balance.dlft import Linearisation
from solver.model import ComplexArray, FloatArray, IntArray
from solver.newton.krylov import build_correction, ritz_values, solve_gmres
from solver.newton.period_preconditioner import PeriodFactor, build_period_factor
from solver.newton.ring_factor import RingFactor, build_ring_factor
from solver.settings import Resolution, SolverSettings

FORCING = 1e-3
"""Relative residual of a Newton direction. With half and twice this value the dovetail is equal to 1e-6, the damper to
5e-8."""

REUSE_PRODUCTS = 25
"""Most products of a solve with an earlier factorisation, before a new one is built, which takes as long as 20 products
with 48 pairs. Histories of 16 and 48 pairs take equal times, within 10 %, with 12 to 80. With 12 and 50 the damper is
equal to 5e-8."""

MOST_CORRECTED = 60
"""Most directions in which a factorisation is corrected. With 0, 60, 120: 17.4, 12.0, 11.4 products of a solve and 52,
42, 42 CPU s with 160 pairs; 6.3, 6.0, 6.0 s with 48. With 80 dovetail and underplatform damper are equal to 1e-6."""

FEWEST_CORRECTED = 3
"""Fewest products of a solve that a correction is made of. With 1, two histories of 44 under random loads (16 pairs, 1
N) lose their branch early, 21 and 46 mm3 worn for 107 and 239; with 1, 3, 6 usual ones are equally fast; with 2 and 6
the damper is equal to 5e-8."""

MOST_PRODUCTS = 80
"""Most products of a solve, and of Arnoldi's method: at 160 pairs, eigenvalues at 0.01 converge with 32. With 40 and
160 the dovetail is equal to 5e-7, waves within 2e-3."""

SETTLED = 0.1
"""Residual over modulus of an eigenvalue below which its sign is known, and real part above which an eigenvalue is
certainly positive (all are 1 for an exact factorisation). With 0.05 and 0.15 dovetail, waves and blocks are judged
alike."""

DENSE_UNKNOWNS = 200
"""Unknowns up to which a Jacobian is factorised at each solve. With 100 and 400, 16 and 48 pairs take equal times;
spheres and blocks are equal to 2e-7."""

LARGEST_DENSE = 3000
"""Largest number of unknowns of a factorisation: 72 MB and 0.6 s. Above, the highest harmonics are left out."""

SMALL_JOINT = 40
"""Relative displacements up to which a joint is small and its Jacobian is factorised: impacts couple most harmonics,
and products with any other factorisation are in vain (three pairs with 115 harmonics in the tests). With 80 the
stability of a ring is not known."""

NEUTRAL_SHIFT = SolverSettings.tolerance
"""Shift of the eigenvalues, which are 1 for a pair that sticks, where the sign of the determinant counts. The position
of a joint that slips as a whole is arbitrary: round-off in a zero eigenvalue would give the determinant any sign. With
a tenth a shroud wears as much within 1e-5, and the error of a block that comes loose is told six times as large."""


@dataclass(frozen=True)
class DenseFactor:
    """LU factors and pivots of a Jacobian in the rows (n,) of active pairs and their first coefficients; the identity
    elsewhere. exact: whether these are all coefficients.
    """

    rows: IntArray
    factor: tuple[FloatArray, IntArray]
    exact: bool

    @property
    def sign(self) -> float:
        """Sign of the determinant; 0 where it is singular."""
        triangle, pivots = self.factor
        swaps = np.count_nonzero(pivots != np.arange(pivots.size))
        return float(np.prod(np.sign(np.diag(triangle))) * (-1.0) ** swaps)

    def solve(self, right: FloatArray, *, transposed: bool = False) -> FloatArray:
        """Solution (n_rel, m), approximate unless `exact`, for a right-hand side (n_rel, m); transposed: with the
        transposed Jacobian.
        """
        found = right.copy()
        if self.rows.size:
            width = len(self.factor[1]) // self.rows.size
            inside = right[self.rows, :width].ravel()
            solved = scipy.linalg.lapack.dgetrs(*self.factor, inside, trans=int(transposed))[0]
            found[self.rows, :width] = solved.reshape(-1, width)
        return found


Factor = DenseFactor | PeriodFactor | RingFactor


def build_dense_factor(tangent: Linearisation, shift: float) -> DenseFactor:
    """Factorisation of a Jacobian. Singular ones give infinities: Newton's method judges by the residual."""
    rows, m = tangent.active_rows, tangent.joint.basis.synthesis.shape[0]
    width = min(m, 2 * (LARGEST_DENSE // max(rows.size, 1) // 2) + 1)
    matrix = tangent.dense(tangent.active, width)
    matrix[np.diag_indices_from(matrix)] += shift
    factor = matrix, np.zeros(0, np.int64)
    if rows.size:
        factor = scipy.linalg.lapack.dgetrf(matrix, overwrite_a=True)[:2]
    return DenseFactor(rows, factor, width == m)


@dataclass
class JacobianSolver:
    """Solver of systems with a `Linearisation` that keeps one factorisation, corrected, between its calls."""

    _factor: Factor | None = None
    _corrections: tuple[tuple[FloatArray, FloatArray], ...] = ()
    _resolution: Resolution | None = None

    def _known(self, tangent: Linearisation) -> Factor | None:
        """The earlier factorisation; None where it is of other harmonics, and maybe of another size, or samples."""
        return self._factor if self._resolution == tangent.joint.resolution else None

    def _renewed(self, tangent: Linearisation, *, dense: bool = False) -> Factor:
        """A factorisation of this Jacobian, kept from now on: of the waves of a ring, a march through the period, or
        dense factors, if wanted, for small joints, masses, and where a sample is singular.
        """
        self._resolution, self._corrections = tangent.joint.resolution, ()
        n_rel = tangent.joint.component_index.size
        # at rest marches do not suffice: of 47 shrouded sectors 1033 of 1293 solves do not end in 80 products
        dense = dense or n_rel <= SMALL_JOINT or (n_rel <= LARGEST_DENSE and not tangent.joint.basis.orders)
        rough = None if dense else build_ring_factor(tangent, NEUTRAL_SHIFT) or build_period_factor(tangent)
        self._factor = rough or build_dense_factor(tangent, NEUTRAL_SHIFT)
        return self._factor

    def solve(
        self, tangent: Linearisation, rights: Sequence[FloatArray] | FloatArray, residual: float = FORCING
    ) -> FloatArray:
        """Steps (k, n_rel, m) with Jacobian times step = right (n_rel, m), N, to a relative residual."""
        rows, rest = tangent.active_rows, tangent.passive_rows
        steps = np.zeros((len(rights), *rights[0].shape))
        direct = None
        if rows.size * steps.shape[2] <= DENSE_UNKNOWNS:
            # without the shift: a joint that hardly resists slip has eigenvalues as small
            direct = build_dense_factor(tangent, 0.0)
            direct = direct if direct.sign else build_dense_factor(tangent, NEUTRAL_SHIFT)
        for step, right in zip(steps, rights, strict=True):
            if rows.size:
                step[rows] = (direct.solve(right) if direct else self._solve_large(tangent, right, residual))[rows]
            if rest.size:
                # the columns of all other unknowns are those of the identity
                step[rest] = (right - tangent.apply(step, roughly=True))[rest]
        return steps

    def solve_transposed(self, tangent: Linearisation, right: FloatArray, residual: float = FORCING) -> FloatArray:
        """Solution y (n_rel, m) of `J^T y = right`, to a relative residual; the kept factorisation is not used.

        Exact by dense factors of all coefficients; else by GMRES with dense factors of the lowest ones.
        Raises numpy.linalg.LinAlgError where GMRES does not converge, or the Jacobian is singular.
        """
        rest = tangent.passive_rows
        factor, found = build_dense_factor(tangent, 0.0), np.zeros_like(right)
        # the rows of passive unknowns, transposed, are those of the identity
        found[rest] = right[rest]
        missing, solved = right - tangent.apply_transposed(found), abs(factor.sign) == 1.0

        def product(vector: FloatArray) -> FloatArray:
            return tangent.apply_transposed(factor.solve(vector.reshape(right.shape), transposed=True)).ravel()

        if solved and not factor.exact:
            solution, solved, *_ = solve_gmres(product, missing.ravel(), residual, MOST_PRODUCTS)
            missing = solution.reshape(right.shape)
        if not solved:
            raise np.linalg.LinAlgError("the transposed Jacobian cannot be inverted")
        return found + factor.solve(missing, transposed=True)

    def _solve_large(self, tangent: Linearisation, right: FloatArray, residual: float) -> FloatArray:
        """Solution in the rows of the active pairs, with an earlier factorisation while products are few."""
        known = self._known(tangent)
        if known is not None:
            # inverting the waves of a ring takes as long as 200 products
            most = MOST_PRODUCTS if isinstance(known, RingFactor) else REUSE_PRODUCTS
            solution, found = self._iterate(known, tangent, right, residual, most)
            if found:
                return solution
        # convergence is not required: Newton's method judges by the true residual
        return self._iterate(self._renewed(tangent), tangent, right, residual, MOST_PRODUCTS)[0]

    def _iterate(
        self, factor: Factor, tangent: Linearisation, right: FloatArray, residual: float, most: int
    ) -> tuple[FloatArray, bool]:
        """Solution by GMRES, and whether it has converged; corrects the factorisation by the space of the solve."""
        corrections, passive = self._corrections, tangent.passive_rows

        def solved(vector: FloatArray) -> FloatArray:
            for images, changes in reversed(corrections):
                vector = vector + (images @ vector) @ changes
            return factor.solve(vector.reshape(right.shape))

        def active(values: FloatArray) -> FloatArray:
            # the steps of passive rows do not act on the rows of the active pairs
            values[passive] = 0.0
            return values.ravel()

        def product(vector: FloatArray) -> FloatArray:
            # preconditioned from the right: the residual of GMRES is the true one
            return active(tangent.apply(solved(vector), roughly=True))

        solution, found, basis, hessenberg = solve_gmres(product, active(right.copy()), residual, most)
        n_new = hessenberg.shape[1]
        if n_new >= FEWEST_CORRECTED:
            n_corrected = n_new + sum(len(images) for images, _ in corrections)
            own = build_correction(basis, hessenberg) if n_corrected <= MOST_CORRECTED else None
            # where the directions become too many all are dropped
            self._corrections = () if own is None else (*corrections, own)
        return solved(solution), found

    def determinant_sign(self, tangent: Linearisation) -> float:
        """Sign of the determinant of the Jacobian: 1, -1, or 0 where it is singular.

        For a large joint, that of an earlier factorisation P times (-1)^k, with k real negative eigenvalues of J P^-1.
        Where these outliers do not converge, this Jacobian is factorised instead. A march through the period has the
        sign of all samples, and the harmonics that are left out may have another (dovetail, 16 pairs, nodal diameter 3,
        39 harmonics: -1 where all multipliers are below 0.984). So what is negative by a march is asked of dense
        factors.
        """
        sign = 0.0
        for factor in self._factors(tangent):
            sign, settled = (factor.sign, True) if factor.exact else _sign_by_eigenvalues(factor, tangent)
            if settled and (sign > 0.0 or isinstance(factor, DenseFactor)):
                break
        return sign

    def _factors(self, tangent: Linearisation) -> Iterator[Factor]:
        """Factorisations from the cheapest one on; an earlier exact one has the sign of another Jacobian."""
        known = self._known(tangent)
        if known is not None and not known.exact:
            yield known
        yield self._renewed(tangent)
        if not isinstance(self._factor, DenseFactor):
            yield self._renewed(tangent, dense=True)


def _sign_by_eigenvalues(factor: Factor, tangent: Linearisation) -> tuple[float, bool]:
    """Sign of the determinant from outlying eigenvalues of J P^-1, and whether these eigenvalues have converged."""
    shape = tangent.joint.component_index.size, tangent.joint.basis.synthesis.shape[0]

    def product(vector: FloatArray) -> FloatArray:
        return tangent.apply(factor.solve(vector.reshape(shape)), roughly=True).ravel()

    def settled(values: ComplexArray, residuals: FloatArray) -> bool:
        doubtful = ~(values.real >= SETTLED)
        return bool(np.all((residuals < SETTLED * np.abs(values))[doubtful]))

    # a fixed start: the result must not depend on earlier computations
    start = np.random.default_rng(0).normal(size=shape[0] * shape[1])
    values, residuals, _ = ritz_values(product, start, MOST_PRODUCTS, settled)
    # complex eigenvalues come in conjugate pairs and do not change the sign
    negative = np.count_nonzero((values.real < 0.0) & (values.imag == 0.0))
    return factor.sign * float((-1) ** negative), settled(values, residuals)
