"""A converged state: the history that it leaves, other harmonics, its responses; or a failure."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.model import ComplexArray, FloatArray
from solver.outcome import Ended, Outcome
from solver.packing import packable
from solver.settings import FINE_SAMPLES, SAMPLES_PER_HARMONIC, Resolution
from solver.structure.condensation import CACHED_STRUCTURES, build_structure
from solver.structure.fourier import build_basis, change_orders, from_complex, synthesis, to_complex
from solver.structure.joint import Case, Hold, Joint
from solver.structure.schur import SingularStructureError


@packable
@dataclass(frozen=True)
class State:
    """A converged periodic state; the next one depends on it alone.

    next_history (n_contact, n_history): tangential history for the next state, m. parameter: of the path; NaN if none.
    omega, excitation_amplitude, resolution, hold: of its joint: rad/s, N, harmonics and samples, as in `Case`.
    """

    evaluation: Evaluation
    next_history: FloatArray
    omega: float
    excitation_amplitude: float
    resolution: Resolution
    hold: Hold | None = None
    parameter: float = math.nan

    def case(self, of: Case) -> Case:
        """A case with the harmonics, samples and hold of the state."""
        return replace(of.at(self.resolution), hold=self.hold)

    def joint(self, of: Case) -> Joint:
        """The joint of the state in a case; the last ones are cached."""
        joint = _joint(of, self.resolution, self.hold, self.omega, self.excitation_amplitude)
        return joint.after(self.evaluation.energy)


@lru_cache(maxsize=CACHED_STRUCTURES)
def _joint(case: Case, resolution: Resolution, hold: Hold | None, omega: float, excitation_amplitude: float) -> Joint:
    return replace(case.at(resolution), hold=hold).joint(omega, excitation_amplitude)


@packable
@dataclass(frozen=True)
class Failure(Ended):
    """Why there is no state, or why a history ends early. message: what has failed, and where."""

    outcome: Outcome
    message: str


def balance_after(joint: Joint, state: State) -> Balance:
    """Balance of a joint whose forces have slowly come from those of a state."""
    return Balance(joint, state.next_history, before_t=state.evaluation.predicted_t)


def state_of(joint: Joint, at: Evaluation, parameter: float = math.nan) -> State:
    """The state of a joint from its evaluation, with the tangential history that it leaves."""
    history = joint.law.final_history(at, at.displacement_h)
    return State(at, history, joint.omega, joint.excitation_amplitude, joint.resolution, joint.hold, parameter)


def vibration_change(before: Evaluation, after: Evaluation) -> float:
    """Norm of the change of the vibrating part of the predicted force, over its norm in the state `before`."""
    return float(np.linalg.norm(after.predicted_h[:, 1:] - before.predicted_h[:, 1:])) / vibration_size(before)


def vibration_size(evaluation: Evaluation) -> float:
    """Norm of the vibrating part of the predicted force, N, above zero."""
    return max(float(np.linalg.norm(evaluation.predicted_h[:, 1:])), 1e-300)


def transfer(case: Case, state: State, joint: Joint, *, with_tail: bool = False) -> tuple[Balance, FloatArray]:
    """Balance of `joint`, and a predicted force (n_rel, m), N, to start from, for a state of a case with other
    harmonics: they have another penalty, with which a pair may be inertial instead of elastic.

    with_tail: new harmonics of the force are those of its samples, as many as those of `joint`, instead of zeros; they
        contain impacts. New harmonics of the motion are those that this force causes.
    """
    orders, known, n_samples = joint.basis.orders, state.resolution.orders, joint.basis.n_samples
    if with_tail and state.resolution.samples != n_samples:
        sampled, start = transfer(case, state, replace(state, resolution=Resolution(known, n_samples)).joint(case))
        state = state_of(sampled.joint, sampled.evaluate(start))
    evaluation = state.evaluation
    tangential, end = evaluation.displacement_h[:, 1:], np.array([-2.0 * np.pi / evaluation.force_t.shape[2]])
    begun = joint.law.begun_at(tangential[:, :, 0], (tangential @ synthesis(known, end))[:, :, 0])
    same = state.case(case).penalty.inertial == joint.penalty.inertial
    history = np.where(same[:, None], evaluation.start_history, begun)
    balance = Balance(joint.after(evaluation.energy), history, evaluation.wear_depth, energy=evaluation.energy)
    motion_h, force_h = (
        change_orders(joint.to_relative(part), known, orders)
        for part in (evaluation.displacement_h, evaluation.force_h)
    )
    if with_tail:
        new = np.flatnonzero(~np.isin(orders, known))
        tail = build_basis(tuple(np.array(orders)[new].tolist()), evaluation.force_t.shape[2]).analysis[:, 1:]
        force = joint.to_relative(evaluation.force_t @ tail)
        amplitudes = force[:, ::2] - 1j * force[:, 1::2]
        moved = -joint.structure.moving.solve(new, amplitudes)
        for part, found in ((force_h, amplitudes), (motion_h, moved)):
            part[:, 2 * new + 1], part[:, 2 * new + 2] = found.real, -found.imag
    return balance, balance.predict(joint.to_pairs(motion_h), joint.to_pairs(force_h))


def first_response(joint: Joint, at: Evaluation) -> ComplexArray:
    """First harmonic of the responses (n_response,), m, of a state."""
    return to_complex(joint.structure.response_h(joint.motion(at)))[:, 0]


def largest_responses(joint: Joint, evaluation: Evaluation) -> FloatArray:
    """Largest magnitudes over a period of the responses (n_response,), m, the static ones included.

    With the tail of friction on rigid ground: else the error of the peak falls as the square of the highest harmonic.
    """
    response_h = joint.structure.response_h(joint.motion(evaluation))
    response_t = response_h @ build_basis(joint.basis.orders, FINE_SAMPLES).synthesis
    orders = tail_orders(joint)
    if orders:
        response_t = response_t + _tail_h(joint, evaluation, orders) @ build_basis(orders, FINE_SAMPLES).synthesis
    return np.asarray(np.abs(response_t).max(axis=1))


def tail_orders(joint: Joint) -> tuple[int, ...]:
    """Harmonics of the tail, odd ones where the balance has only odd ones; none where no mass sits on rigid ground."""
    orders = joint.basis.orders
    if not orders or not joint.law.rate_dependent:
        return ()
    stride = 2 if orders[-1] > 1 and all(order % 2 for order in orders) else 1
    # three times the highest harmonic: what the usual samples of a harmonic still resolve
    resolved = (SAMPLES_PER_HARMONIC // 2 - 1) * orders[-1]
    last = min(resolved, joint.basis.n_samples // 2 - orders[-1], FINE_SAMPLES // 4)
    return tuple(order for order in range(orders[-1] + stride, last + 1, stride) if joint.model.has_harmonics(order))


def _tail_h(joint: Joint, evaluation: Evaluation, orders: tuple[int, ...]) -> FloatArray:
    """Responses (n_response, 2k+1), m, to the friction on masses in k harmonics: `u_n = -lambda_n / Z_n`."""
    still = np.zeros(len(joint.structure.static_response))
    try:
        # the load acts in the first harmonic alone
        structure = build_structure(joint.model, joint.omega, 0.0, orders)
    except SingularStructureError:
        return np.zeros((still.size, 2 * len(orders) + 1))
    force_h = joint.law.tail(evaluation, build_basis(orders, joint.basis.n_samples))
    moved = -structure.moving.solve(slice(None), to_complex(joint.to_relative(force_h)))
    return from_complex(still, np.matmul(structure.dynamic_response, moved.T[:, :, None])[:, :, 0].T)
