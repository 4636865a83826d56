"""Stability of a periodic state: the sign of Hill's determinant, and the Floquet multipliers.

A small disturbance p' of a state that varies as exp(sigma t) obeys Hill's equation

    [Z_r(i n w + sigma) du/dp + dlambda/dp] p' = 0.

Its determinant is that of the Jacobian, Eq. (16), at sigma = 0, and positive for sigma towards infinity. So a negative
determinant of the Jacobian means an odd number of real multipliers beyond +1, as between two folds of a branch. The
sign is tested at each state of a branch (`Run.is_stable`).

The multipliers of reported states come from the linear structure, where no pair slips, opens or closes; from Hill's
equation for a small joint that opens and closes; else from integration in time (all of a small joint, the largest ones
of a large joint).

Disturbances of a travelling wave are those of m sectors (`disturbances`): all of a ring, where they are few or small,
otherwise those of the nodal diameters 0 and d. A sector whose model has all nodal diameters is tested in all sectors of
its ring at one time (`ring_state`), if these are not too many: other waves may grow beside the excited one.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import Literal

import numpy as np

from solver.compliant_contact import stiffened
from solver.contact.coulomb import SEPARATED
from solver.harmonic_balance.dlft import Evaluation
from solver.harmonic_balance.ring_state import in_ring, knows_ring, wave_of
from solver.harmonic_balance.state import Failure, State
from solver.model import ComplexArray, FloatArray, LinearModel
from solver.newton.krylov import ritz_values
from solver.newton.linear_solver import MOST_PRODUCTS, SMALL_JOINT
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import FEWEST_SAMPLES, ROUND_OFF, Resolution, all_orders, samples_for
from solver.stability.disturbances import (
    HILL_SAMPLES,
    ROUNDING,
    SMALL_SAMPLES,
    Monodromy,
    build_monodromy,
    hill_multipliers,
    integrated_pairs,
    linear_exponents,
    moving,
    passed,
    switching_pairs,
)
from solver.structure.joint import Case, Joint
from solver.structure.ring import RingModel

OPENING_HARMONICS = 19
"""Fewest harmonics for a small joint that opens and closes: with 9 the multiplier is 0.95 in place of 2.8.
With 13 and 27 vibro-impact and a bouncing block are equal."""

GROWTH = 1e-3
"""Growth of a disturbance in a period, and residual of a multiplier, that count as none. Half and twice: slider,
masses, blocks and impacts are equal, ring and damper within 2e-3."""

OTHER_BRANCH = 0.05
"""Relative difference of the vibration above which two states belong to different branches. At a wall more than 9
harmonics change means and first harmonics by up to 3 %. With 0.2 blocks, waves and impacts are equal."""

MOST_ROWS = 600
"""Largest number of displacements of switching pairs in all sectors: 200 pairs take 0.4 GB and 10 s. Half and twice:
ring and damper are equal."""

SCATTER = 0.035
"""Least error of growing multipliers of a large joint. Underplatform damper, nodal diameter 2, 274 Hz, where nearly all
pairs slip and open: 0.995 to 1.07 with 128 to 4096 samples, and three of them may agree by chance.
With 0.02 and 0.07 a ring that is unstable and a damper at 260 Hz are judged alike."""

Stability = Literal["stable", "fold", "period doubling", "Neimark-Sacker", "unknown"]
"""Stable, or the disturbance that grows: one that keeps its sign ("fold", as between two folds), one that changes sign
in each period, or one with a second frequency."""


@dataclass(frozen=True)
class Multipliers:
    """Multipliers of a state, largest modulus first; of a large joint the largest ones only.

    error: estimated error of the first value by the time steps. unknown: why its side of 1 may not be known.
    wave: nodal diameter of which the disturbance of the first value has most; None where it is not known.
    """

    values: ComplexArray
    error: float
    unknown: str = "the growth of a small disturbance is not known well enough"
    wave: int | None = None

    def stability(self, odd: bool) -> Stability:
        """Kind of stability; odd: whether Hill's determinant shows an odd number of real multipliers beyond +1."""
        if odd:
            return "fold"
        growth = abs(self.values[0]) - 1.0 if self.values.size else np.inf
        if growth <= GROWTH:
            return "stable"
        if not self.values.size or growth <= 2.0 * self.error:
            return "unknown"
        if self.values[0].imag != 0.0:
            return "Neimark-Sacker"
        return "fold" if self.values[0].real > 0.0 else "period doubling"


def find_instability(case: Case, state: State, run: Run, with_switching: bool = True) -> Failure | None:
    """Why a state is unstable at a fixed wear depth, or INACCURATE where that is not known; None where it is stable.

    with_switching: False, within a wear history, leaves out joints that switch, but for small ones that open and close.
    Raises OutOfTimeError.
    """
    joint, at = state.joint(case), state.evaluation
    switches = bool(switching_pairs(at)[0].any())
    left_out = switches and not with_switching and not _bounces(joint, at)
    if left_out or (not switches and all(map(_is_passive, _structures(joint, at)))):
        return None
    found = find_multipliers(case, state, run, growing_only=True)
    kind = found.stability(odd=False)
    if kind == "stable":
        return None
    if kind == "unknown":
        return Failure(Outcome.INACCURATE, f"whether the vibration is stable is not known: {found.unknown}")
    said = f"a small disturbance grows by the factor {abs(found.values[0]):.4g} in each period of the excitation"
    if not switches:
        said = f"{said}, in the linear structure alone"
    elif kind == "Neimark-Sacker":
        turn = abs(np.angle(found.values[0])) * joint.omega / (2.0 * np.pi) ** 2
        said = f"{said} and brings a second frequency, {turn:.4g} Hz beside that of the excitation"
    if found.wave is not None:
        said = f"{said}, most of it as a wave of nodal diameter {found.wave}"
    doubles = switches and kind == "period doubling"
    return Failure(Outcome.PERIOD_DOUBLED if doubles else Outcome.UNSTABLE, said)


def find_multipliers(case: Case, state: State, run: Run, *, growing_only: bool = False) -> Multipliers:
    """Multipliers of a state at a fixed wear depth; none where there are too many switching pairs, where a small joint
    that opens and closes has no state with `OPENING_HARMONICS` on this branch, or Arnoldi's method does not converge.

    growing_only: without the error of multipliers that do not grow. Raises OutOfTimeError.
    """
    joint, at = state.joint(case), state.evaluation
    (switching, stuck), nothing = switching_pairs(at), np.empty(0, np.complex128)
    if not switching.any():
        exponents = np.concatenate([linear_exponents(each, moving(joint, stuck)) for each in _structures(joint, at)])
        return Multipliers(_sorted(np.exp(exponents * 2.0 * np.pi / joint.omega)), 0.0)
    n_sectors = _sectors(joint, at)
    most = MOST_ROWS // (3 * n_sectors)
    if np.count_nonzero(integrated_pairs(joint, at)[0]) > most:
        return Multipliers(nothing, np.inf, f"more than {most} pairs slip or open in a part of the period")
    if not _bounces(joint, at):
        return _integrated(joint, at, case.settings.rtol, growing_only)
    sharp = _sharper(case, state, run)
    if sharp is None:
        return Multipliers(nothing, np.inf, f"no vibration with {OPENING_HARMONICS} harmonics is found near")
    if not joint.model.nodal_diameter and not joint.law.rate_dependent and (values := hill_multipliers(*sharp)).size:
        return Multipliers(_sorted(values), 0.0)
    return _integrated(*sharp, case.settings.rtol, growing_only)


def _moving(joint: Joint, at: Evaluation) -> int:
    """Number of displacements of a sector that move."""
    return int(np.count_nonzero(moving(joint, switching_pairs(at)[1])))


def _sectors(joint: Joint, at: Evaluation) -> int:
    """Sectors of a travelling wave in which disturbances are integrated; 1 for other structures, as that of a ring."""
    model = joint.model
    if not model.nodal_diameter or isinstance(model, RingModel):
        return 1
    apart = model.n_sectors // math.gcd(model.n_sectors, model.nodal_diameter)
    most = min(max(SMALL_JOINT // max(_moving(joint, at), 1), 3), 2 * joint.basis.orders[-1] + 1)
    # an odd number, as the harmonics of a disturbance come in pairs
    return min(apart, most - 1 + most % 2)


def _structures(joint: Joint, at: Evaluation) -> list[LinearModel]:
    """The structures in which disturbances move."""
    model = stiffened(joint.model, joint.contact)
    return [model.harmonic_structure(harmonic) for harmonic in range(_sectors(joint, at) // 2 + 1)]


def _bounces(joint: Joint, at: Evaluation) -> bool:
    """Whether a joint is small, and a pair is open in a part of the period."""
    opens = at.status_t == SEPARATED
    return bool((opens.any(axis=1) & ~opens.all(axis=1)).any()) and _moving(joint, at) <= SMALL_JOINT


def _sharper(case: Case, state: State, run: Run) -> tuple[Joint, Evaluation] | None:
    """The state with at least `OPENING_HARMONICS`; None where no such state is found on the same branch."""
    if state.resolution.highest >= OPENING_HARMONICS:
        return state.joint(case), state.evaluation
    if not case.model.has_harmonics(OPENING_HARMONICS):
        return None
    samples = max(state.resolution.samples, samples_for(OPENING_HARMONICS))
    moved = run.move(case, state, Resolution(all_orders(OPENING_HARMONICS), samples))
    if moved is None:
        return None
    # beside folds a solve may change the branch: means and first harmonics
    one, other = (each.evaluation.displacement_h[..., :3] for each in (moved, state))
    same = np.linalg.norm(one - other) <= OTHER_BRANCH * np.linalg.norm(other)
    return (moved.joint(case), moved.evaluation) if same else None


def _sorted(values: ComplexArray) -> ComplexArray:
    # of a conjugate pair the one that turns forward comes first
    return values[np.lexsort((-values.imag, -np.abs(values).round(12)))]


# --- by time integration ---


def _integrated(joint: Joint, at: Evaluation, rtol: float, growing_only: bool) -> Multipliers:
    """Multipliers by integration in time; samples are doubled until the first one is known, or its side of 1."""
    sizes, rows = list[float](), 3 * np.count_nonzero(switching_pairs(at)[0])
    if knows_ring(joint.model) and joint.model.n_sectors * rows <= MOST_ROWS:
        joint, at = in_ring(joint, at)
    n_sectors = _sectors(joint, at)
    every = n_sectors * _moving(joint, at) <= SMALL_JOINT
    n_samples = _samples(joint, at) // (1 if growing_only else 2)
    # fewer cannot tell the harmonics of the state apart
    while n_samples <= 2 * max(joint.basis.orders, default=0):
        n_samples *= 2
    most = 8 * (n_samples if every else min(n_samples, SMALL_SAMPLES))
    while True:
        monodromy = build_monodromy(joint, at, n_samples, n_sectors)
        values, largest_one = multipliers_of(monodromy, every)
        values = _sorted(values)
        if not values.size:
            return Multipliers(values, np.inf)
        # growth is a matter of the modulus: of multipliers of equal modulus another one may come first
        largest = float(abs(values[0]))
        sizes, grows = [*sizes[-2:], largest], largest > 1.0 + GROWTH
        error = float(np.ptp(sizes)) if len(sizes) > 1 else np.inf
        error = error if every or not grows else max(error, SCATTER)
        known = abs(largest - 1.0) > 2.0 * error or (error <= rtol and not grows)
        # where all pairs slip and open, values scatter, and two of them may agree by chance
        enough = known and len(sizes) > (2 if grows else 1)
        if enough or (growing_only and not grows and len(sizes) == 1) or 2 * n_samples > most:
            wave = None
            if grows and isinstance(joint.model, RingModel):
                n = (largest_one.size - monodromy.kept[0].size) // 4
                wave = wave_of(largest_one[:n], joint.model.n_sectors)
            return Multipliers(values, error, wave=wave)
        n_samples *= 2


def _samples(joint: Joint, at: Evaluation) -> int:
    """Samples of a period: up to eight times as many for vibrations that grow in the structure alone, with at least
    `FEWEST_SAMPLES` in a period of the fastest one, which BDF2 then damps by 0.15 %.
    """
    (switching, stuck), fastest, model = switching_pairs(at), 0.0, joint.model
    structures, of, held = _structures(joint, at), joint, (stuck, stuck | switching)
    if isinstance(model, RingModel):
        # rates of its sector in all waves, with the pairs that stick in all sectors
        of, structures = replace(joint, model=model.tuned, contact=model.tuned.contact), [*model.tuned.linear.values()]
        first, second = (np.asarray(each.reshape(model.n_sectors, -1).all(axis=0)) for each in held)
        held = (first, second)
    for linear, pairs in product([each for each in structures if not _is_passive(each)], held):
        found = linear_exponents(linear, moving(of, pairs))
        # round-off of a fast vibration is no growth
        grows = found.real > found.size * ROUNDING * np.abs(found).max(initial=0.0)
        fastest = max(fastest, float(np.abs(found.imag[grows]).max(initial=0.0)))
    wanted = 2 ** int(np.ceil(np.log2(max(FEWEST_SAMPLES * fastest / joint.omega, 1.0))))
    fewest = SMALL_SAMPLES if _moving(joint, at) <= SMALL_JOINT else SMALL_SAMPLES // 4
    return int(np.clip(wanted, fewest, HILL_SAMPLES))


def multipliers_of(monodromy: Monodromy, every: bool) -> tuple[ComplexArray, ComplexArray]:
    """All multipliers, or the largest ones; none where the largest one has not converged by Arnoldi's method. With the
    disturbance (4n + p q,) of the largest one.
    """
    size, m = monodromy.turn.size, monodromy.n_sectors
    if every:
        values, vectors = np.linalg.eig(passed(monodromy, np.eye(size)))
        return np.asarray(values, np.complex128) ** m, vectors[:, np.argmax(np.abs(values))]

    def product_of(vector: FloatArray) -> FloatArray:
        return passed(monodromy, vector[:, None])[:, 0]

    def settled(values: ComplexArray, residuals: FloatArray) -> bool:
        return bool(m * residuals[np.argmax(np.abs(values))] < GROWTH)

    # a fixed start: the result must not depend on earlier computations
    start = np.random.default_rng(0).normal(size=size)
    values, residuals, largest = ritz_values(product_of, start, monodromy.n_blades * MOST_PRODUCTS, settled)
    known = m * residuals < GROWTH
    return (values[known] if settled(values, residuals) else values[:0]) ** m, largest


@lru_cache(maxsize=16)
def _is_passive(linear: LinearModel) -> bool:
    """Whether mass, damping and stiffness are positive semidefinite: such a structure only loses energy."""
    parts = linear.mass, linear.damping, linear.stiffness
    least = (float(np.linalg.eigvalsh(part)[0]) / max(float(np.abs(np.diag(part)).max()), 1e-300) for part in parts)
    return all(value >= -ROUND_OFF for value in least)
