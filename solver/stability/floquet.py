"""Floquet multipliers of a periodic state, and the kind of its stability.

A small disturbance of a state is multiplied by the monodromy (`monodromy`) in each period. A disturbance whose
multiplier lies outside the unit circle grows:

- a real multiplier beyond +1 leads to another state;
- a real multiplier beyond -1 leads to a vibration that repeats after two periods (period doubling);
- a complex pair leads to a vibration with a second frequency (Neimark-Sacker bifurcation).

For a small joint all multipliers are computed, for a large joint the largest ones, by Arnoldi's method. In a state in
which no pair slips, opens or closes, disturbances follow the linear structure, whose exponents are eigenvalues of a
matrix. A small joint that opens and closes is solved with `OPENING_HARMONICS` before: with fewer harmonics the impacts
differ.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from scipy.linalg import eigvals

from solver.contact.coulomb import SEPARATED
from solver.harmonic_balance.dlft import Evaluation
from solver.harmonic_balance.state import State
from solver.model import BoolArray, ComplexArray, LinearModel, Matrix
from solver.newton.krylov import MOST_PRODUCTS, ritz_values
from solver.newton.linear_solver import EXPENSIVE_UNKNOWNS, SMALL_JOINT
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import ROUND_OFF, Resolution, all_orders, samples_for
from solver.stability.hill import hill_multipliers, hill_size
from solver.stability.monodromy import Monodromy, build_monodromy, switching_pairs
from solver.structure.joint import Case, Joint

SMALL_SAMPLES = 512
"""Samples of the law in a period, for joints of which all multipliers are computed. In 72 scenes with one pair all
multipliers of states that are the exact motion lie on the right side of 1. Most errors are below 0.01; for sliders
that turn or stop up to 0.16, where the multiplier is far below 1. A quarter for larger joints, whose
largest multipliers belong to few modes: within 0.003 of the multipliers with all (48 pairs). At most eight times as
many where the structure alone vibrates fast."""

SAMPLES_A_VIBRATION = 40
"""Samples in a period of the fastest growing vibration of the structure alone, which BDF2 damps by 0.6 %."""

OPENING_HARMONICS = 19
"""Smallest number of harmonics for a small joint that opens and closes: with fewer the impacts are too soft (9
harmonics: multiplier 0.95 in place of 2.8)."""

OTHER_BRANCH = 0.05
"""Relative difference of the vibration above which two states belong to different branches: a state with
`OPENING_HARMONICS` (on the branches of a mass at a wall more than 9 harmonics change means and first harmonics by
up to 3 %), or a state behind the end of a branch. Corners at which a branch folds back a little are no jumps, and
there may be many of them."""

MOST_ROWS = 600
"""Largest number of displacements of switching pairs: 200 such pairs take 0.4 GB and 10 s."""

SMALLEST_GROWTH = 1e-3
"""Growth in a period, beyond 1, that counts, and the residual of Arnoldi's method below which a multiplier has
converged. Sliding pairs that stick have multipliers of 1. The largest multiplier of 48 pairs converges in 20
products."""

_EPS = float(np.finfo(np.float64).eps)

Stability = Literal["stable", "fold", "period doubling", "Neimark-Sacker", "unknown"]
"""Stability of a state: stable, or by which kind of disturbance unstable: a growing one ("fold", as between two folds),
one that changes sign in each period, or one with a second frequency."""


@dataclass(frozen=True)
class Multipliers:
    """Multipliers of a state.

    - values: the multipliers, largest modulus first; of a large joint the largest ones only; none where not computed.
    - error: estimated error of the first value by the time steps.
    """

    values: ComplexArray
    error: float

    def stability(self, odd: bool) -> Stability:
        """Kind of stability. odd: whether Hill's determinant shows an odd number of real multipliers beyond +1."""
        if odd:
            return "fold"
        if not self.values.size:
            return "unknown"
        if not _grows(self.values, self.error):
            return "stable"
        if self.values[0].imag != 0.0:
            return "Neimark-Sacker"
        return "fold" if self.values[0].real > 0.0 else "period doubling"


@dataclass(frozen=True)
class Instability:
    """Why a state is unstable.

    - outcome: PERIOD_DOUBLED where a disturbance of a switching joint changes sign in each period, else UNSTABLE.
    - sentence: growth of a disturbance in a period, and its kind.
    """

    outcome: Outcome
    sentence: str


def find_multipliers(case: Case, joint: Joint, at: Evaluation, run: Run) -> Multipliers:
    """Multipliers of a state at a fixed wear depth; none where they are not known, see `find_instability`.

    Those of a small joint that opens and closes by Hill's method. Of all other joints the number of time steps is
    doubled until the first multiplier has settled, or lies on one side of 1 by more than its error.
    """
    unknown = Multipliers(np.empty(0, np.complex128), np.inf)
    switching, stuck = switching_pairs(at)
    if not switching.any():
        linear = joint.model.harmonic_structure(1)
        return Multipliers(_sorted(np.exp(_exponents(linear, _moving(joint, stuck)) * 2.0 * np.pi / joint.omega)), 0.0)
    sharp = None if _off_limits(joint, switching) else _sharper(case, joint, at, run)
    if sharp is None or _first(sharp[1], at) > OTHER_BRANCH:
        return unknown
    joint, at = sharp
    bounces = _is_small(joint, at) and _opens_and_closes(at)
    if bounces and hill_size(joint) <= EXPENSIVE_UNKNOWNS and not joint.law.rate_dependent:
        return Multipliers(_sorted(hill_multipliers(joint, at)), 0.0)
    n_samples = _samples(joint, at) // 2
    values, error = _integrated(joint, at, n_samples), np.inf
    while values.size and error > case.settings.rtol and n_samples < 8 * SMALL_SAMPLES:
        if abs(abs(values[0]) - 1.0) > 2.0 * error:
            break
        n_samples, coarse = 2 * n_samples, values
        values = _integrated(joint, at, n_samples)
        error = float(abs(values[0] - coarse[0])) if values.size else np.inf
    return Multipliers(values, error)


def find_instability(case: Case, joint: Joint, at: Evaluation, run: Run, every: bool = True) -> Instability | None:
    """Instability of a state at a fixed wear depth; None where the state is stable, or where stability is not known.

    Stability is not tested in these cases:

    - a travelling wave in which a pair slips or opens: disturbances move in other nodal diameters;
    - a joint with more than `MOST_ROWS` displacements of switching pairs;
    - a small joint that opens and closes, where no state with `OPENING_HARMONICS` is found.

    Parameters
    ----------
    case, joint, at
        Case, joint and evaluation of the state.
    run
        Tolerance and limits.
    every
        False leaves out large joints and joints that do not open and close, where a pair slips. This is for states
        between the first and the last of a wear history, where only impacts change the motion of a joint suddenly.

    Raises
    ------
    OutOfTimeError
        The time is over.
    """
    switching, stuck = switching_pairs(at)
    if not switching.any():
        exponents = _growing_exponents(joint.model.harmonic_structure(1), _moving(joint, stuck))
        values = _sorted(np.exp(exponents * 2.0 * np.pi / joint.omega))
        return _described(values[0], joint, by_structure=True) if _grows(values, 0.0) else None
    bounces = _is_small(joint, at) and _opens_and_closes(at)
    if _off_limits(joint, switching) or not (every or bounces):
        return None
    sharp = _sharper(case, joint, at, run)
    if sharp is None and not _is_driven(joint):
        return None
    joint, at = sharp or (joint, at)
    n_samples = _samples(joint, at)
    coarse = _integrated(joint, at, n_samples)
    if not _grows(coarse, 0.0):
        return None
    values = _integrated(joint, at, 2 * n_samples)
    # the change with the number of samples is the error of the multiplier
    error = abs(abs(values[0]) - abs(coarse[0])) if values.size else 0.0
    return _described(values[0], joint) if _grows(values, 2.0 * error) else None


def _grows(values: ComplexArray, error: float) -> bool:
    """Whether the largest of sorted multipliers lies outside the unit circle by more than its error."""
    return bool(values.size) and bool(abs(values[0]) - 1.0 > max(error, SMALLEST_GROWTH))


def _described(largest: complex, joint: Joint, by_structure: bool = False) -> Instability:
    """An instability with its largest multiplier. by_structure: whether the linear structure alone is unstable."""
    doubles = not by_structure and largest.imag == 0.0 and largest.real < 0.0
    said = f"a small disturbance grows by the factor {abs(largest):.3g} in each period of the excitation"
    if by_structure:
        said = f"{said}, in the linear structure alone"
    elif largest.imag != 0.0:
        turn = abs(np.angle(largest)) * joint.omega / (2.0 * np.pi) ** 2
        said = f"{said} and brings a second frequency, {turn:.4g} Hz beside that of the excitation"
    if _is_driven(joint):
        said = f"{said}: look for negative damping or stiffness of the structure"
    return Instability(Outcome.PERIOD_DOUBLED if doubles else Outcome.UNSTABLE, said)


def _off_limits(joint: Joint, switching: BoolArray) -> bool:
    """Whether the disturbances of a joint with these switching pairs (n_contact,) are not integrated."""
    travels = joint.model.n_sectors > 0 and joint.model.nodal_diameter > 0
    return travels or 3 * int(np.count_nonzero(switching)) > MOST_ROWS


def _is_small(joint: Joint, at: Evaluation) -> bool:
    """Whether all multipliers are computed."""
    return int(_moving(joint, switching_pairs(at)[1]).sum()) <= SMALL_JOINT


def _sharper(case: Case, joint: Joint, at: Evaluation, run: Run) -> tuple[Joint, Evaluation] | None:
    """The state with enough harmonics for a small joint that opens and closes; None where no such state is found."""
    bounces = _is_small(joint, at) and _opens_and_closes(at)
    if not bounces or case.resolution.highest >= OPENING_HARMONICS:
        return joint, at
    samples = max(case.resolution.samples, samples_for(OPENING_HARMONICS))
    sharp = case.at(Resolution(all_orders(OPENING_HARMONICS), samples))
    finer = sharp.joint(joint.omega, joint.excitation_amplitude)
    moved = run.move(case, finer, State(at, at.history))
    return None if moved is None else (finer, moved.evaluation)


def _opens_and_closes(at: Evaluation) -> bool:
    """Whether a pair is open in a part of the period."""
    opens = at.status_t == SEPARATED
    return bool((opens.any(axis=1) & ~opens.all(axis=1)).any())


def _first(finer: Evaluation, at: Evaluation) -> float:
    """Relative difference of means and first harmonics of two states: beside folds a solve may change the branch."""
    one, other = (state.displacement_h[..., :3] for state in (finer, at))
    return float(np.linalg.norm(one - other)) / max(float(np.linalg.norm(other)), 1e-300)


def _sorted(values: ComplexArray) -> ComplexArray:
    # of a conjugate pair the one that turns forward comes first
    return values[np.lexsort((-values.imag, -np.abs(values).round(12)))]


def _samples(joint: Joint, at: Evaluation) -> int:
    """Samples of a period for the time integration: enough for vibrations that grow in the structure alone."""
    switching, stuck = switching_pairs(at)
    linear, limits = joint.model.linear[0], (stuck, stuck | switching)
    rates = [np.abs(_growing_exponents(linear, _moving(joint, pairs)).imag) for pairs in limits]
    fastest = max(float(of.max(initial=0.0)) for of in rates) / joint.omega
    least = SMALL_SAMPLES if _is_small(joint, at) else SMALL_SAMPLES // 4
    wanted = 2 ** int(np.ceil(np.log2(max(SAMPLES_A_VIBRATION * fastest, 1.0))))
    return int(np.clip(wanted, least, 8 * SMALL_SAMPLES))


def _integrated(joint: Joint, at: Evaluation, n_samples: int) -> ComplexArray:
    """Sorted multipliers of a state by time integration with a number of samples."""
    monodromy = build_monodromy(joint, joint.model.linear[0], at, n_samples)
    return _sorted(multipliers_of(monodromy, _is_small(joint, at)))


def multipliers_of(monodromy: Monodromy, every: bool) -> ComplexArray:
    """All multipliers, or the largest ones, as far as Arnoldi's method has converged."""
    if every:
        return np.asarray(np.linalg.eigvals(monodromy.matrix()), np.complex128)
    # a fixed start: the result must not depend on earlier computations
    start = np.random.default_rng(0).normal(size=monodromy.size)

    def product(vector: np.ndarray) -> np.ndarray:
        return monodromy.apply(vector[:, None])[:, 0]

    def settled(values: ComplexArray, residuals: np.ndarray) -> bool:
        return bool(residuals[np.argmax(np.abs(values))] < SMALLEST_GROWTH)

    values, residuals = ritz_values(product, start, MOST_PRODUCTS, settled)
    return values[residuals < SMALLEST_GROWTH]


def _moving(joint: Joint, fixed: BoolArray) -> BoolArray:
    """True for the displacements (n,) of the structure that move while the pairs `fixed` (n_contact,) stick."""
    dofs = joint.contact.dofs[fixed]
    moves = np.ones(len(joint.model.linear[0].mass), bool)
    moves[dofs[dofs >= 0]] = False
    return moves


def _is_driven(joint: Joint) -> bool:
    """Whether the structure itself gains energy.

    True where a motion grows while all pairs stick, or where a vibration grows while no pair does. A motion without
    vibration that grows without the pairs does not count: a free blade leaves its spinning disk.
    """
    linear = joint.model.harmonic_structure(1)
    stuck = _growing_exponents(linear, _moving(joint, np.ones(joint.contact.n_contact, bool)))
    free = _growing_exponents(linear, np.ones(len(linear.mass), bool))
    return stuck.size > 0 or bool((np.abs(free.imag) > free.real).any())


def _growing_exponents(linear: LinearModel, moves: BoolArray) -> ComplexArray:
    """Exponents sigma, 1/s, of the growing motions exp(sigma t) of a linear structure.

    moves (n,): False for displacements that do not move. The result is empty where mass, damping and stiffness are all
    positive semidefinite: such a structure only loses energy.
    """
    if _is_passive(linear):
        return np.empty(0, complex)
    return _growing(linear, moves.tobytes())


@lru_cache(maxsize=4)
def _is_passive(linear: LinearModel) -> bool:
    return all(_is_semidefinite(part) for part in (linear.mass, linear.damping, linear.stiffness))


def _is_semidefinite(matrix: Matrix) -> bool:
    size = float(np.abs(np.diag(matrix)).max(initial=0.0))
    try:
        np.linalg.cholesky(matrix + ROUND_OFF * size * np.eye(len(matrix)))
    except np.linalg.LinAlgError:
        return size == 0.0 and not matrix.any()
    return True


@lru_cache(maxsize=4)
def _growing(linear: LinearModel, moves: bytes) -> ComplexArray:
    found = _exponents(linear, np.frombuffer(moves, bool))
    # round-off of a fast vibration is no growth
    growing: ComplexArray = found[found.real > found.size * _EPS * np.abs(found).max(initial=0.0)]
    return growing


def _exponents(linear: LinearModel, moves: BoolArray) -> ComplexArray:
    """Exponents sigma, 1/s, of all motions exp(sigma t) of a linear structure; moves: as in `_growing_exponents`."""
    parts = [part[np.ix_(moves, moves)] for part in (linear.mass, linear.damping, linear.stiffness)]
    sizes, motions = np.linalg.eigh(parts[0])
    n = len(sizes)
    mass, damping, stiffness = (motions.conj().T @ part @ motions for part in parts)
    # motions without mass come first, as the mass has no negative eigenvalues but round-off
    light = int(np.count_nonzero(sizes <= n * _EPS * sizes.max(initial=0.0)))
    damping[:light][np.abs(damping[:light]) <= n * _EPS * np.abs(damping).max(initial=0.0)] = 0.0
    # y: all motions, v: velocities of those with mass; -K y - C v = sigma (C_light y_light + M v), sigma y_heavy = v.
    # A motion without mass and damping has an infinite exponent.
    heavy = n - light
    left = np.block([[-stiffness, -damping[:, light:]], [np.zeros((heavy, n)), np.eye(heavy)]])
    right = np.zeros_like(left)
    right[:n, :light], right[light:n, n:], right[n:, light:n] = damping[:, :light], mass[light:, light:], np.eye(heavy)
    found = eigvals(left, right)
    return np.asarray(found[np.isfinite(found)], np.complex128)
