"""What is reported of a converged state: pressures, slip, responses, loops, certificate; or its whole motion."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from solver.accuracy.certificate import Certificate
from solver.contact.coulomb import SEPARATED, friction_limit
from solver.continuation.transient import Transient
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.state import State, largest_responses, state_of
from solver.model import ComplexArray, FloatArray, IntArray
from solver.results.history import PeriodicState
from solver.structure.condensation import whole_motion
from solver.structure.fourier import derivative, from_complex, synthesis, to_complex, with_static
from solver.structure.joint import Case, Joint
from solver.structure.ring_motion import motion_of

LOOP_PHASES = 128
"""Number of phases of a loop, equally spaced over a period from 0 on, whatever the number of samples of a state is."""


def periodic_state(state: State) -> PeriodicState:
    """The state as a result in physical units; its arrays lie in rows, as when read from a file."""
    at = state.evaluation
    arrays = (at.displacement_h, at.force_h, at.start_history)
    return PeriodicState(state.omega, state.excitation_amplitude, *(np.array(each, order="C") for each in arrays))


def evaluated(case: Case, state: PeriodicState) -> State:
    """The state of a case, which has its harmonics and samples."""
    joint = case.joint(state.omega, state.excitation_amplitude)
    balance = Balance(joint, state.start_history)
    return state_of(joint, balance.evaluate(balance.predict(state.displacement_h, state.contact_force_h)))


def report_state(
    joint: Joint,
    evaluation: Evaluation,
    certificate: Certificate,
    loops: tuple[int, ...] = (),
    *,
    with_resonance: bool = False,
) -> dict[str, Any]:
    """Values of a converged state by their names in `WearHistory`, without the dimension n_output.

    loops: pairs with fretting loops. with_resonance: whether also with `resonance`, see `resonance_frequency`, and its
    estimated relative error `resonance_error`. Errors are those by the harmonics and samples of the state.
    """
    loop_displacement, loop_force = contact_loops(joint, evaluation, loops)
    response_h = joint.structure.response_h(joint.motion(evaluation))
    found = {
        "mean_pressure": evaluation.force_h[:, 0, 0] / joint.contact.area,
        "slip_range": largest_distance(evaluation.state_t) / joint.law.state_stiffness,
        "open_fraction": (evaluation.status_t == SEPARATED).mean(axis=1),
        "friction_use": friction_use(joint, evaluation),
        "friction_power": joint.law.friction_work(evaluation) * joint.omega / (2.0 * np.pi) / joint.contact.area,
        "response": to_complex(response_h)[:, 0],
        "response_mean": response_h[:, 0],
        "response_peak": largest_responses(joint, evaluation),
        "loop_displacement": loop_displacement,
        "loop_force": loop_force,
        "excitation_frequency": joint.omega / (2.0 * np.pi),
        "excitation_frequency_error": 0.0,
        "harmonics_used": max(joint.basis.orders, default=0),
        "samples_used": joint.basis.n_samples,
        **{name: value for name, value in vars(certificate).items() if name != "periodicity_error"},
    }
    if with_resonance:
        resonance, slope = resonance_frequency(joint, evaluation)
        found |= {"resonance": resonance, "resonance_error": slope * certificate.response_error}
    return found


def friction_use(joint: Joint, evaluation: Evaluation) -> float:
    """Largest friction force of any pair over its limit, at any sample; 1 where a pair slips, 0 without friction."""
    force_t = evaluation.force_t
    limit = friction_limit(joint.contact.friction[:, None], force_t[:, 0])
    size = np.hypot(force_t[:, 1], force_t[:, 2])
    return float(np.divide(size, limit, out=np.zeros_like(size), where=limit > 0.0).max(initial=0.0))


def resonance_frequency(joint: Joint, evaluation: Evaluation) -> tuple[float, float]:
    """Resonance w_r of the vibration, rad/s, and its relative change per relative change of the motion at most.

    With x and F, the first harmonics of all displacements and of the excitation, `x^H` times Eq. (1) is
    `w^2 x^H M x = Re x^H (K x + lambda) - Re x^H F`. At the resonance x needs no part of F in phase with x:
    `w_r^2 = w^2 + Re (x^H F) / (x^H M x)`, a Rayleigh quotient with the contact forces of the state. The change is
    `|x^H F| / (2 w_r^2 x^H M x)`. Both are NaN where no mass moves, or where w_r^2 is not positive.
    """
    linear = joint.model.harmonic_structure(1)
    force = joint.excitation_amplitude * linear.load_harmonic
    moved = first_motion(joint, joint.motion(evaluation), joint.excitation_amplitude)
    pushed = motion_of(linear, 1j * joint.omega, joint.contact.relative).times("mass", moved)
    inertia, work = float(np.real(np.vdot(moved, pushed))), complex(np.vdot(moved, force))
    square = joint.omega**2 + work.real / inertia if inertia > 0.0 else -1.0
    return (float(np.sqrt(square)), 0.5 * abs(work) / (square * inertia)) if square > 0.0 else (float("nan"),) * 2


@njit(cache=True)
def largest_distance(state_t: FloatArray) -> FloatArray:
    """Largest distance (n_contact,) between any two tangential states (n_contact, 2, N+1) of a period; `pdist` of scipy
    takes four to seven times as long.
    """
    n_contact, _, n_points = state_t.shape
    largest = np.zeros(n_contact)
    for pair in range(n_contact):
        for i in range(n_points):
            for j in range(i):
                first = state_t[pair, 0, i] - state_t[pair, 0, j]
                second = state_t[pair, 1, i] - state_t[pair, 1, j]
                largest[pair] = max(largest[pair], first * first + second * second)
        largest[pair] = np.sqrt(largest[pair])
    return largest


def first_motion(joint: Joint, motion_h: FloatArray, excitation_amplitude: float) -> ComplexArray:
    """First harmonic (n,), m, of all displacements, from the relative ones of the pairs (n_rel, m), m."""
    linear, first = joint.model.harmonic_structure(1), to_complex(motion_h)[:, 0]
    force = excitation_amplitude * linear.load_harmonic
    return whole_motion(linear, 1j * joint.omega, joint.contact.relative, force, first)


def contact_loops(joint: Joint, evaluation: Evaluation, pairs: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """Relative displacement, m, and contact force, N, of chosen pairs of a state, both (n_pairs, LOOP_PHASES, 3).

    Force: linear between the samples of the contact law: a Fourier series would overshoot at corners and jumps.
    Displacement: the series of the state, and for a sliding mass the harmonics beyond it. Components: normal, first and
    second tangent; closing and compression are positive. Along a direction that a pair does not have both are 0, but
    for a constant normal load.
    """
    if not pairs:
        return np.zeros((0, LOOP_PHASES, 3)), np.zeros((0, LOOP_PHASES, 3))
    chosen, n_samples, orders = list(pairs), joint.basis.n_samples, joint.basis.orders
    motion_h, phases = evaluation.displacement_h[chosen], np.arange(LOOP_PHASES) / LOOP_PHASES
    # half a step before the samples
    ends = (np.arange(n_samples) - 0.5) / n_samples

    def at_phases(values_t: FloatArray, at: FloatArray) -> FloatArray:
        rows = [np.interp(phases, at, row, period=1.0) for row in values_t.reshape(-1, n_samples)]
        return np.array(rows).reshape(*values_t.shape[:-1], LOOP_PHASES)

    displacement = motion_h @ synthesis(orders, 2.0 * np.pi * phases)
    series = evaluation.displacement_h[:, 1:] @ synthesis(orders, 2.0 * np.pi * ends)
    beyond = joint.law.beyond_series(evaluation, series)
    displacement[:, 1:] += at_phases(beyond[chosen], ends)
    displacement *= (joint.contact.dofs[chosen] >= 0)[:, :, None]
    force = at_phases(evaluation.force_t[chosen], np.arange(n_samples) / n_samples)
    return displacement.transpose(0, 2, 1), force.transpose(0, 2, 1)


@dataclass(frozen=True)
class PeriodicMotion:
    """A periodic motion of a joint: Fourier coefficients, complex, and signals at N times of a period.

    Harmonic k is Re(value exp(i k omega t)); the first coefficient is the mean, which is real.

    - frequency, excitation_amplitude: Hz, N.
    - orders (H+1,): harmonics, 0 first.
    - displacement (n, H+1): all displacements of the model, m.
    - response (n_response, H+1): reported responses, m.
    - relative_displacement (n_contact, 3, H+1): of the pairs, m: closing, first and second tangent.
    - contact_force (n_contact, 3, H+1): N, compression positive.
    - time (N,): s, from 0 on: the samples at which the contact law is applied.
    - displacement_t, velocity_t (n, N), response_t (n_response, N): m and m/s, sums of the Fourier series.
    - contact_force_t (n_contact, 3, N): N, by the contact law; means over a time step for masses on rigid ground.
    - status_t (n_contact, N): 0 open, 1 sticking, 2 slipping, 3 another law.
    - residual: scaled residual of the balance, dimensionless: above the tolerance the motion is no solution.
    """

    frequency: float
    excitation_amplitude: float
    orders: IntArray
    displacement: ComplexArray
    response: ComplexArray
    relative_displacement: ComplexArray
    contact_force: ComplexArray
    time: FloatArray
    displacement_t: FloatArray
    velocity_t: FloatArray
    response_t: FloatArray
    contact_force_t: FloatArray
    status_t: IntArray
    residual: float


def periodic_motion(joint: Joint, at: Evaluation) -> PeriodicMotion:
    """The motion of a state. A joint's displacements behind its pairs follow from the condensation of each harmonic."""
    basis = joint.basis
    moved = joint.motion(at)
    whole = Transient(joint).periodic(at).displacement
    displacement_h = from_complex(np.real(whole[0]), whole[1:].T)
    response_h = joint.structure.response_h(moved)
    rates = joint.omega * np.array(basis.orders, np.float64)
    return PeriodicMotion(
        frequency=joint.omega / (2.0 * np.pi),
        excitation_amplitude=joint.excitation_amplitude,
        orders=np.array((0, *basis.orders), np.int64),
        displacement=with_static(displacement_h),
        response=with_static(response_h),
        relative_displacement=with_static(joint.to_pairs(moved)),
        contact_force=with_static(at.force_h),
        time=np.asarray(joint.law.sample_step * np.arange(basis.n_samples)),
        displacement_t=displacement_h @ basis.synthesis,
        velocity_t=derivative(displacement_h, rates) @ basis.synthesis,
        response_t=response_h @ basis.synthesis,
        contact_force_t=at.force_t.copy(),
        status_t=at.status_t.copy(),
        residual=at.scaled_residual(),
    )
