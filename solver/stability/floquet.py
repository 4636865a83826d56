"""Whether the vibration stays at a periodic state: its Floquet multipliers.

A small disturbance of a state is multiplied by the monodromy (`monodromy`) in each period. A multiplier beyond the unit
circle is a disturbance that grows: a real one beyond +1 leads to another state, one beyond -1 to a vibration that
repeats after two periods, a complex pair to one of a second frequency (Neimark and Sacker). Of a small joint all
multipliers are computed, of a large one the largest, by Arnoldi's method. A state in which no pair slips, opens or
closes moves as its linear structure does, whose exponents are those of a matrix.

Which multipliers are looked at is limited by the march: see `StabilityOptions`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import cast

import numpy as np
from scipy.linalg import eigvals

from solver.contact.coulomb import SEPARATED
from solver.harmonic_balance.converged import PathPoint
from solver.harmonic_balance.dlft import Evaluation
from solver.model import BoolArray, ComplexArray, LinearModel, Matrix
from solver.newton.krylov import ritz_values
from solver.newton.solve_balance import Budget, move_point
from solver.outcome import Outcome
from solver.settings import Resolution, all_orders
from solver.stability.monodromy import Monodromy, build_monodromy, switching_pairs
from solver.stability.options import STABILITY
from solver.structure.identity import Identity
from solver.structure.joint import Case, Joint


@dataclass(frozen=True)
class Instability:
    """Why no vibration stays at a state.

    multiplier: the largest one, beyond the unit circle. frequency: Hz, of the excitation. by_structure: whether no pair
    slips, opens or closes, so that the linear structure alone is unstable. driven: whether the structure itself gains
    energy.
    """

    multiplier: complex
    frequency: float
    by_structure: bool
    driven: bool

    @property
    def outcome(self) -> Outcome:
        """PERIOD_DOUBLED where a bouncing joint changes the sign of a disturbance each period, else UNSTABLE."""
        doubles = not self.by_structure and self.multiplier.imag == 0.0 and self.multiplier.real < 0.0
        return Outcome.PERIOD_DOUBLED if doubles else Outcome.UNSTABLE

    @property
    def sentence(self) -> str:
        """How fast a disturbance grows, and what it does."""
        said = f"a small disturbance grows by the factor {abs(self.multiplier):.3g} in each period of the excitation"
        if self.by_structure:
            said = f"{said}, in the linear structure alone"
        elif self.multiplier.imag != 0.0:
            turn = abs(np.angle(self.multiplier)) / (2.0 * np.pi)
            said = f"{said} and brings a second frequency, {turn * self.frequency:.4g} Hz beside that of the excitation"
        return f"{said}: look for negative damping or stiffness of the structure" if self.driven else said


def find_instability(
    case: Case, joint: Joint, at: Evaluation, budget: Budget, every: bool = True
) -> Instability | None:
    """Why the vibration does not stay at a state whose wear is held; None where it stays, or where that is not known.

    Not looked for: in a travelling wave, where a pair slips or opens, as a disturbance moves in other nodal diameters;
    in joints of more than `STABILITY.most_rows` displacements of pairs that switch; in a small joint that opens and
    closes where no state with `STABILITY.opening_harmonics` is found: with few harmonics its impacts are others.

    Parameters
    ----------
    case, joint, at
        Of the state.
    budget
        Where Newton iterations are counted.
    every
        False leaves out joints that are not small, or that stay closed: for states between the first and the last of a
        march, where impacts alone change suddenly how a joint moves.

    Raises
    ------
    OutOfTimeError
        Behind the deadline of the budget.
    """
    switching, stuck = switching_pairs(at)
    frequency = joint.omega / (2.0 * np.pi)
    if not switching.any():
        exponents = growing_exponents(joint.model.harmonic_structure(1)[0], moving(joint, stuck))
        return _judge(np.exp(exponents / frequency), 0.0, joint, by_structure=True)
    travels = joint.model.n_sectors > 0 and joint.model.nodal_diameter > 0
    if travels or 3 * np.count_nonzero(switching) > STABILITY.most_rows:
        return None
    linear = joint.model.linear[0]
    small = 4 * int(moving(joint, stuck).sum()) <= STABILITY.all_multipliers
    if not (every or (small and _opens_and_closes(at))):
        return None
    if small:
        sharper = _sharper(case, joint, at, budget)
        if sharper is None and not _is_driven(joint):
            return None
        joint, at = sharper or (joint, at)
    n_samples = _samples(joint, linear, (stuck, stuck | switching), small)
    first = multipliers_of(build_monodromy(joint, linear, at, n_samples), small)
    if _judge(first, 0.0, joint) is None:
        return None
    second = multipliers_of(build_monodromy(joint, linear, at, 2 * n_samples), small)
    # what the samples change of it is its error
    error = abs(float(np.abs(second).max()) - float(np.abs(first).max()))
    return _judge(second, 2.0 * error, joint)


def _sharper(case: Case, joint: Joint, at: Evaluation, budget: Budget) -> tuple[Joint, Evaluation] | None:
    """The state with the harmonics that a joint that opens and closes is judged with; None where it is not found."""
    least = Resolution(all_orders(STABILITY.opening_harmonics), case.resolution.samples)
    if case.resolution.highest >= least.highest or not _opens_and_closes(at):
        return joint, at
    sharp = case.at(replace(least, samples=max(least.samples, STABILITY.opening_samples)))
    finer = sharp.joint(joint.omega, joint.excitation_amplitude)
    moved = move_point(case, sharp, finer, PathPoint(0.0, at, at.history), budget)
    return None if moved is None else (finer, moved.evaluation)


def _opens_and_closes(at: Evaluation) -> bool:
    opens = at.status_t == SEPARATED
    return bool((opens.any(axis=1) & ~opens.all(axis=1)).any())


def _judge(multipliers: ComplexArray, error: float, joint: Joint, by_structure: bool = False) -> Instability | None:
    """What the largest multiplier says where it lies beyond the unit circle by more than its error."""
    if not multipliers.size:
        return None
    largest = complex(multipliers[np.argmax(np.abs(multipliers))])
    if abs(largest) - 1.0 <= max(error, STABILITY.smallest_growth):
        return None
    return Instability(largest, joint.omega / (2.0 * np.pi), by_structure, _is_driven(joint))


def _is_driven(joint: Joint) -> bool:
    """Whether the structure itself gains energy: something grows while all pairs are held, or vibrates and grows while
    none is. That a blade which nothing holds is thrown out of its spinning disk is no fault of its structure.
    """
    linear = joint.model.harmonic_structure(1)[0]
    held = moving(joint, np.ones(joint.contact.n_contact, bool))
    free = growing_exponents(linear, np.ones(len(linear.mass), bool))
    return growing_exponents(linear, held).size > 0 or bool((np.abs(free.imag) > free.real).any())


def multipliers_of(monodromy: Monodromy, every: bool) -> ComplexArray:
    """All multipliers, or those of the largest ones that Arnoldi's method has settled."""
    if every:
        return np.asarray(np.linalg.eigvals(monodromy.apply(np.eye(monodromy.size))), np.complex128)
    # a fixed start: the answer must not depend on what was computed before
    start = np.random.default_rng(0).normal(size=monodromy.size)

    def product(vector: np.ndarray) -> np.ndarray:
        return monodromy.apply(vector[:, None])[:, 0]

    def settled(values: ComplexArray, residuals: np.ndarray) -> bool:
        return bool(residuals[np.argmax(np.abs(values))] < STABILITY.settled_multiplier)

    values, residuals = ritz_values(product, start, STABILITY.arnoldi_multipliers, settled)
    return values[residuals < STABILITY.settled_multiplier]


def moving(joint: Joint, held: BoolArray) -> BoolArray:
    """Displacements (n,) of the structure that move while some pairs (n_contact,) are held."""
    dofs = joint.contact.dofs[held]
    moves = np.ones(len(joint.model.linear[0].mass), bool)
    moves[dofs[dofs >= 0]] = False
    return moves


def _samples(joint: Joint, linear: LinearModel, held: tuple[BoolArray, ...], small: bool) -> int:
    """Samples of a period that the march takes: enough for vibrations that grow in the structure alone."""
    rates = [np.abs(growing_exponents(linear, moving(joint, pairs)).imag) for pairs in held]
    fastest = max((float(of.max(initial=0.0)) for of in rates), default=0.0) / joint.omega
    least = STABILITY.small_samples if small else STABILITY.large_samples
    wanted = 2 ** int(np.ceil(np.log2(max(STABILITY.samples_a_vibration * fastest, 1.0))))
    return int(np.clip(wanted, least, STABILITY.most_marched_samples))


def growing_exponents(linear: LinearModel, moves: BoolArray) -> ComplexArray:
    """Exponents sigma, 1/s, of the motions exp(sigma t) of a linear structure that grow.

    moves (n,): False of displacements that are held. Empty where mass, damping and stiffness are all positive
    semidefinite: such a structure only loses energy.
    """
    if _is_passive(Identity(linear)):
        return np.empty(0, complex)
    return _growing(Identity(linear), moves.tobytes())


@lru_cache(maxsize=4)
def _is_passive(of: Identity) -> bool:
    linear = cast("LinearModel", of.objects[0])
    return all(_is_semidefinite(part) for part in (linear.mass, linear.damping, linear.stiffness))


def _is_semidefinite(matrix: Matrix) -> bool:
    size = float(np.abs(np.diag(matrix)).max(initial=0.0))
    try:
        np.linalg.cholesky(matrix + STABILITY.indefinite * size * np.eye(len(matrix)))
    except np.linalg.LinAlgError:
        return size == 0.0 and not matrix.any()
    return True


@lru_cache(maxsize=4)
def _growing(of: Identity, moves: bytes) -> ComplexArray:
    linear, chosen = cast("LinearModel", of.objects[0]), np.frombuffer(moves, bool)
    mass, damping, stiffness = (
        part[np.ix_(chosen, chosen)] for part in (linear.mass, linear.damping, linear.stiffness)
    )
    eye, none = np.eye(len(mass)), np.zeros_like(stiffness)
    # (0 1; -K -C) (y; v) = sigma (1 0; 0 M) (y; v): a displacement without mass has an infinite exponent
    left = np.block([[none, eye], [-stiffness, -damping]])
    right = np.block([[eye, none], [none, mass]])
    found = eigvals(left, right)
    return np.asarray(found[np.isfinite(found) & (found.real > 0.0)], np.complex128)
