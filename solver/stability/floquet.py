"""Stability of a periodic state: the sign of Hill's determinant, and the Floquet multipliers.

A small disturbance p' of a state that varies as exp(sigma t) obeys Hill's equation

    [Z_r(i n w + sigma) du/dp + dlambda/dp] p' = 0.

Its determinant is that of the Jacobian, Eq. (16), at sigma = 0, and positive for sigma towards infinity. So a negative
determinant of the Jacobian means an odd number of real multipliers beyond +1, as between two folds of a branch. The
sign is tested at each state of a branch (`Run.is_stable`).

The multipliers of reported states come from the first method that serves:

1. the exponents of the linear structure, where no pair slips, opens or closes;
2. the exponents of Hill's equation, for a small joint that opens and closes;
3. time integration, with all multipliers of a small joint and the largest ones of a large joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from solver.contact.coulomb import SEPARATED
from solver.harmonic_balance.dlft import Evaluation
from solver.harmonic_balance.state import Failure, State
from solver.model import ComplexArray, FloatArray, LinearModel
from solver.newton.krylov import ritz_values
from solver.newton.linear_solver import MOST_PRODUCTS, SMALL_JOINT
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import ROUND_OFF, Resolution, all_orders, samples_for
from solver.stability.disturbances import (
    Monodromy,
    build_monodromy,
    hill_multipliers,
    linear_exponents,
    moving,
    pass_period,
    switching_pairs,
)
from solver.structure.joint import Case, Joint

SMALL_SAMPLES = 512
"""Samples of the law in a period of a small joint: 72 scenes with one pair lie on the right side of 1, most within
0.01. A quarter for larger joints: within 0.003 with 48 pairs."""

SAMPLES_A_VIBRATION = 40
"""Samples in a period of the fastest growing vibration of the structure alone, which BDF2 damps by 0.6 %."""

OPENING_HARMONICS = 19
"""Fewest harmonics for a small joint that opens and closes: with 9 the multiplier is 0.95 in place of 2.8."""

OTHER_BRANCH = 0.05
"""Relative difference of the vibration above which two states belong to different branches. At a wall more than 9
harmonics change means and first harmonics by up to 3 %."""

MOST_ROWS = 600
"""Largest number of displacements of switching pairs: 200 such pairs take 0.4 GB and 10 s."""

SMALLEST_GROWTH = 1e-3
"""Growth in a period, beyond 1, that counts, and residual below which a multiplier has converged."""

_EPS = float(np.finfo(np.float64).eps)

Stability = Literal["stable", "fold", "period doubling", "Neimark-Sacker", "unknown"]
"""Stable, or the disturbance that grows: one that keeps its sign ("fold", as between two folds), one that changes sign
in each period, or one with a second frequency."""


@dataclass(frozen=True)
class Multipliers:
    """Multipliers of a state, largest modulus first; of a large joint the largest ones only; none where not computed.

    error: estimated error of the first value by the time steps.
    """

    values: ComplexArray
    error: float

    def stability(self, odd: bool) -> Stability:
        """Kind of stability; odd: whether Hill's determinant shows an odd number of real multipliers beyond +1."""
        if odd:
            return "fold"
        if not self.values.size:
            return "unknown"
        if abs(self.values[0]) - 1.0 <= max(self.error, SMALLEST_GROWTH):
            return "stable"
        if self.values[0].imag != 0.0:
            return "Neimark-Sacker"
        return "fold" if self.values[0].real > 0.0 else "period doubling"


def find_instability(case: Case, joint: Joint, at: Evaluation, run: Run, with_switching: bool = True) -> Failure | None:
    """Why a state is unstable at a fixed wear depth; None where it is stable, or where stability is not known.

    with_switching: False, within a wear history, leaves out joints that switch, but for small ones that open and close.
    Raises OutOfTimeError.
    """
    switches = bool(switching_pairs(at)[0].any())
    left_out = switches and not with_switching and not _bounces(joint, at)
    if left_out or (not switches and _is_passive(joint.model.harmonic_structure(1))):
        return None
    found = find_multipliers(case, joint, at, run, growing_only=True)
    kind = found.stability(odd=False)
    if kind in ("stable", "unknown"):
        return None
    said = f"a small disturbance grows by the factor {abs(found.values[0]):.3g} in each period of the excitation"
    if not switches:
        said = f"{said}, in the linear structure alone"
    elif kind == "Neimark-Sacker":
        turn = abs(np.angle(found.values[0])) * joint.omega / (2.0 * np.pi) ** 2
        said = f"{said} and brings a second frequency, {turn:.4g} Hz beside that of the excitation"
    doubles = switches and kind == "period doubling"
    return Failure(Outcome.PERIOD_DOUBLED if doubles else Outcome.UNSTABLE, said)


def find_multipliers(case: Case, joint: Joint, at: Evaluation, run: Run, *, growing_only: bool = False) -> Multipliers:
    """Multipliers of a state at a fixed wear depth; none where they are not known:

    - in a travelling wave in which a pair slips or opens: disturbances move in other nodal diameters;
    - for a joint with more than `MOST_ROWS` displacements of switching pairs;
    - for a small joint that opens and closes, where no state with `OPENING_HARMONICS` is found on the same branch.

    growing_only: without the error of multipliers that do not grow. Raises OutOfTimeError.
    """
    switching, stuck = switching_pairs(at)
    if not switching.any():
        exponents = linear_exponents(joint.model.harmonic_structure(1), moving(joint, stuck))
        return Multipliers(_sorted(np.exp(exponents * 2.0 * np.pi / joint.omega)), 0.0)
    travels = joint.model.n_sectors > 0 and joint.model.nodal_diameter > 0
    bounces = _bounces(joint, at)
    if not travels and 3 * np.count_nonzero(switching) <= MOST_ROWS:
        sharp = _sharper(case, joint, at, run) if bounces else (joint, at)
        if sharp is not None and bounces and not joint.law.rate_dependent and (values := hill_multipliers(*sharp)).size:
            return Multipliers(_sorted(values), 0.0)
        if sharp is not None:
            return _integrated(*sharp, case.settings.rtol, growing_only)
    return Multipliers(np.empty(0, np.complex128), np.inf)


def _is_small(joint: Joint, at: Evaluation) -> bool:
    return int(moving(joint, switching_pairs(at)[1]).sum()) <= SMALL_JOINT


def _bounces(joint: Joint, at: Evaluation) -> bool:
    """Whether a joint is small, and a pair is open in a part of the period."""
    opens = at.status_t == SEPARATED
    return bool((opens.any(axis=1) & ~opens.all(axis=1)).any()) and _is_small(joint, at)


def _sharper(case: Case, joint: Joint, at: Evaluation, run: Run) -> tuple[Joint, Evaluation] | None:
    """The state with at least `OPENING_HARMONICS`; None where no such state is found on the same branch."""
    if case.resolution.highest >= OPENING_HARMONICS:
        return joint, at
    samples = max(case.resolution.samples, samples_for(OPENING_HARMONICS))
    sharp = case.at(Resolution(all_orders(OPENING_HARMONICS), samples))
    finer = sharp.joint(joint.omega, joint.excitation_amplitude)
    moved = run.move(case, finer, State(at, at.history))
    if moved is None:
        return None
    # beside folds a solve may change the branch: means and first harmonics
    one, other = (state.displacement_h[..., :3] for state in (moved.evaluation, at))
    same = np.linalg.norm(one - other) <= OTHER_BRANCH * np.linalg.norm(other)
    return (finer, moved.evaluation) if same else None


def _sorted(values: ComplexArray) -> ComplexArray:
    # of a conjugate pair the one that turns forward comes first
    return values[np.lexsort((-values.imag, -np.abs(values).round(12)))]


# --- by time integration ---


def _integrated(joint: Joint, at: Evaluation, rtol: float, growing_only: bool) -> Multipliers:
    """Multipliers by integration in time; samples are doubled until the first one is known, or its side of 1."""
    small, error = _is_small(joint, at), np.inf
    n_samples, values = _samples(joint, at, small) // (1 if growing_only else 2), np.empty(0, np.complex128)
    while n_samples <= 8 * SMALL_SAMPLES:
        coarse, values = values[:1], _sorted(multipliers_of(build_monodromy(joint, at, n_samples), small))
        if not values.size:
            return Multipliers(values, np.inf)
        # growth is a matter of the modulus: of multipliers of equal modulus another one may come first
        largest = float(abs(values[0]))
        error = abs(largest - float(abs(coarse[0]))) if coarse.size else np.inf
        if error <= rtol or abs(largest - 1.0) > 2.0 * error or (growing_only and largest <= 1.0 + SMALLEST_GROWTH):
            break
        n_samples *= 2
    return Multipliers(values, error)


def _samples(joint: Joint, at: Evaluation, small: bool) -> int:
    """Samples of a period: up to eight times as many for vibrations that grow in the structure alone."""
    (switching, stuck), linear, fastest = switching_pairs(at), joint.model.linear[0], 0.0
    for pairs in () if _is_passive(linear) else (stuck, stuck | switching):
        found = linear_exponents(linear, moving(joint, pairs))
        # round-off of a fast vibration is no growth
        grows = found.real > found.size * _EPS * np.abs(found).max(initial=0.0)
        fastest = max(fastest, float(np.abs(found.imag[grows]).max(initial=0.0)))
    wanted = 2 ** int(np.ceil(np.log2(max(SAMPLES_A_VIBRATION * fastest / joint.omega, 1.0))))
    return int(np.clip(wanted, SMALL_SAMPLES if small else SMALL_SAMPLES // 4, 8 * SMALL_SAMPLES))


def multipliers_of(monodromy: Monodromy, every: bool) -> ComplexArray:
    """All multipliers, or the largest ones, as far as Arnoldi's method has converged."""
    size = 4 * len(monodromy.response)
    if every:
        return np.asarray(np.linalg.eigvals(pass_period(monodromy, np.eye(size))), np.complex128)

    def product(vector: FloatArray) -> FloatArray:
        return pass_period(monodromy, vector[:, None])[:, 0]

    def settled(values: ComplexArray, residuals: FloatArray) -> bool:
        return bool(residuals[np.argmax(np.abs(values))] < SMALLEST_GROWTH)

    # a fixed start: the result must not depend on earlier computations
    start = np.random.default_rng(0).normal(size=size)
    values, residuals = ritz_values(product, start, MOST_PRODUCTS, settled)
    return values[residuals < SMALLEST_GROWTH]


@lru_cache(maxsize=4)
def _is_passive(linear: LinearModel) -> bool:
    """Whether mass, damping and stiffness are positive semidefinite: such a structure only loses energy."""
    parts = linear.mass, linear.damping, linear.stiffness
    least = (float(np.linalg.eigvalsh(part)[0]) / max(float(np.abs(np.diag(part)).max()), 1e-300) for part in parts)
    return all(value >= -ROUND_OFF for value in least)
