"""Stability of a periodic state by its Floquet multipliers.

A small disturbance of a state is multiplied by the monodromy (`monodromy`) in each period. A disturbance whose
multiplier lies outside the unit circle grows:

- a real multiplier beyond +1 leads to another state;
- a real multiplier beyond -1 leads to a vibration that repeats after two periods (period doubling);
- a complex pair leads to a vibration with a second frequency (Neimark-Sacker bifurcation).

For a small joint all multipliers are computed, for a large joint the largest ones, by Arnoldi's method. In a state in
which no pair slips, opens or closes, disturbances follow the linear structure, whose exponents are eigenvalues of a
matrix.

The time integration of disturbances limits the size of joints that are tested: see `StabilityOptions`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import eigvals

from solver.contact.coulomb import SEPARATED
from solver.harmonic_balance.dlft import Evaluation
from solver.harmonic_balance.state import State
from solver.model import BoolArray, ComplexArray, LinearModel, Matrix
from solver.newton.krylov import MOST_PRODUCTS, ritz_values
from solver.newton.linear_solver import SMALL_JOINT
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import ROUND_OFF, Resolution, all_orders, samples_for
from solver.stability.monodromy import Monodromy, build_monodromy, switching_pairs
from solver.stability.options import STABILITY
from solver.structure.joint import Case, Joint

_EPS = float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class Instability:
    """Reason why a state is unstable.

    - multiplier: the multiplier of largest modulus, outside the unit circle.
    - frequency: frequency of the excitation, Hz.
    - by_structure: whether no pair slips, opens or closes, so that the linear structure alone is unstable.
    - driven: whether the structure itself gains energy.
    """

    multiplier: complex
    frequency: float
    by_structure: bool
    driven: bool

    @property
    def outcome(self) -> Outcome:
        """PERIOD_DOUBLED where a disturbance of a switching joint changes sign in each period, else UNSTABLE."""
        doubles = not self.by_structure and self.multiplier.imag == 0.0 and self.multiplier.real < 0.0
        return Outcome.PERIOD_DOUBLED if doubles else Outcome.UNSTABLE

    @property
    def sentence(self) -> str:
        """Sentence for the user: growth of a disturbance in a period, and its kind."""
        said = f"a small disturbance grows by the factor {abs(self.multiplier):.3g} in each period of the excitation"
        if self.by_structure:
            said = f"{said}, in the linear structure alone"
        elif self.multiplier.imag != 0.0:
            turn = abs(np.angle(self.multiplier)) / (2.0 * np.pi)
            said = f"{said} and brings a second frequency, {turn * self.frequency:.4g} Hz beside that of the excitation"
        return f"{said}: look for negative damping or stiffness of the structure" if self.driven else said


def find_instability(case: Case, joint: Joint, at: Evaluation, run: Run, every: bool = True) -> Instability | None:
    """Instability of a state at a fixed wear depth; None where the state is stable, or where stability is not known.

    Stability is not tested in these cases:

    - a travelling wave in which a pair slips or opens: disturbances move in other nodal diameters;
    - a joint with more than `STABILITY.most_rows` displacements of switching pairs;
    - a small joint that opens and closes, where no state with `STABILITY.opening_harmonics` is found: with fewer
      harmonics the impacts differ.

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
    frequency = joint.omega / (2.0 * np.pi)
    if not switching.any():
        exponents = growing_exponents(joint.model.harmonic_structure(1), moving(joint, stuck))
        return _judge(np.exp(exponents / frequency), 0.0, joint, by_structure=True)
    travels = joint.model.n_sectors > 0 and joint.model.nodal_diameter > 0
    if travels or 3 * np.count_nonzero(switching) > STABILITY.most_rows:
        return None
    linear = joint.model.linear[0]
    small = int(moving(joint, stuck).sum()) <= SMALL_JOINT
    if not (every or (small and opens_and_closes(at))):
        return None
    if small:
        finer = sharper(case, joint, at, run)
        if finer is None and not _is_driven(joint):
            return None
        joint, at = finer or (joint, at)
    n_samples = march_samples(joint, linear, (stuck, stuck | switching), small)
    first = multipliers_of(build_monodromy(joint, linear, at, n_samples), small)
    if _judge(first, 0.0, joint) is None:
        return None
    second = multipliers_of(build_monodromy(joint, linear, at, 2 * n_samples), small)
    # the change with the number of samples is the error of the multiplier
    error = abs(float(np.abs(second).max()) - float(np.abs(first).max()))
    return _judge(second, 2.0 * error, joint)


def sharper(case: Case, joint: Joint, at: Evaluation, run: Run) -> tuple[Joint, Evaluation] | None:
    """The state with enough harmonics for a joint that opens and closes; None where no such state is found."""
    if case.resolution.highest >= STABILITY.opening_harmonics or not opens_and_closes(at):
        return joint, at
    samples = max(case.resolution.samples, samples_for(STABILITY.opening_harmonics))
    sharp = case.at(Resolution(all_orders(STABILITY.opening_harmonics), samples))
    finer = sharp.joint(joint.omega, joint.excitation_amplitude)
    moved = run.move(case, finer, State(at, at.history))
    return None if moved is None else (finer, moved.evaluation)


def opens_and_closes(at: Evaluation) -> bool:
    """Whether a pair is open in a part of the period."""
    opens = at.status_t == SEPARATED
    return bool((opens.any(axis=1) & ~opens.all(axis=1)).any())


def _judge(multipliers: ComplexArray, error: float, joint: Joint, by_structure: bool = False) -> Instability | None:
    """Instability where the largest multiplier lies outside the unit circle by more than its error, else None."""
    if not multipliers.size:
        return None
    largest = complex(multipliers[np.argmax(np.abs(multipliers))])
    if abs(largest) - 1.0 <= max(error, STABILITY.smallest_growth):
        return None
    return Instability(largest, joint.omega / (2.0 * np.pi), by_structure, _is_driven(joint))


def _is_driven(joint: Joint) -> bool:
    """Whether the structure itself gains energy.

    True where a motion grows with all pairs held, or where a vibration grows with no pair held. A motion without
    vibration that grows with no pair held does not count: a free blade leaves its spinning disk.
    """
    linear = joint.model.harmonic_structure(1)
    held = moving(joint, np.ones(joint.contact.n_contact, bool))
    free = growing_exponents(linear, np.ones(len(linear.mass), bool))
    return growing_exponents(linear, held).size > 0 or bool((np.abs(free.imag) > free.real).any())


def multipliers_of(monodromy: Monodromy, every: bool) -> ComplexArray:
    """All multipliers, or the largest ones, as far as Arnoldi's method has converged."""
    if every:
        return np.asarray(np.linalg.eigvals(monodromy.apply(np.eye(monodromy.size))), np.complex128)
    # a fixed start: the result must not depend on earlier computations
    start = np.random.default_rng(0).normal(size=monodromy.size)

    def product(vector: np.ndarray) -> np.ndarray:
        return monodromy.apply(vector[:, None])[:, 0]

    def settled(values: ComplexArray, residuals: np.ndarray) -> bool:
        return bool(residuals[np.argmax(np.abs(values))] < STABILITY.smallest_growth)

    values, residuals = ritz_values(product, start, MOST_PRODUCTS, settled)
    return values[residuals < STABILITY.smallest_growth]


def moving(joint: Joint, held: BoolArray) -> BoolArray:
    """True for the displacements (n,) of the structure that move while the pairs `held` (n_contact,) are held."""
    dofs = joint.contact.dofs[held]
    moves = np.ones(len(joint.model.linear[0].mass), bool)
    moves[dofs[dofs >= 0]] = False
    return moves


def march_samples(joint: Joint, linear: LinearModel, held: tuple[BoolArray, ...], small: bool) -> int:
    """Samples of a period for the time integration: enough for vibrations that grow in the structure alone."""
    rates = [np.abs(growing_exponents(linear, moving(joint, pairs)).imag) for pairs in held]
    fastest = max((float(of.max(initial=0.0)) for of in rates), default=0.0) / joint.omega
    least = STABILITY.small_samples if small else STABILITY.small_samples // 4
    wanted = 2 ** int(np.ceil(np.log2(max(STABILITY.samples_a_vibration * fastest, 1.0))))
    return int(np.clip(wanted, least, 8 * STABILITY.small_samples))


def growing_exponents(linear: LinearModel, moves: BoolArray) -> ComplexArray:
    """Exponents sigma, 1/s, of the growing motions exp(sigma t) of a linear structure.

    moves (n,): False for displacements that are held. The result is empty where mass, damping and stiffness are all
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
    found = exponents(linear, np.frombuffer(moves, bool))
    # round-off of a fast vibration is no growth
    growing: ComplexArray = found[found.real > found.size * _EPS * np.abs(found).max(initial=0.0)]
    return growing


def exponents(linear: LinearModel, moves: BoolArray) -> ComplexArray:
    """Exponents sigma, 1/s, of all motions exp(sigma t) of a linear structure; moves: as in `growing_exponents`."""
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
