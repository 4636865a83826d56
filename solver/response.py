"""One state of the joint: the static one, the periodic one above it, and what is reported of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from solver.arc import follow_arc
from solver.balance import Balance, Evaluation
from solver.certificate import Certificate
from solver.friction_path import solve_from_less_friction
from solver.harmonics import change_orders, from_complex, to_complex
from solver.history import PeriodicState
from solver.joint import Case, Joint, static_joint
from solver.kernels import SEPARATED
from solver.linear import JacobianSolver
from solver.loops import contact_loops
from solver.model import ComplexArray, FloatArray
from solver.outcome import Outcome
from solver.path import Effort, PathPoint, final_history, follow_naturally, solve_balance
from solver.peak import largest_responses
from solver.settings import Resolution
from solver.settling import settle
from solver.stability import is_stable

LOAD_STEPS = 20
FEW_ITERATIONS = 5  # of a load step from the state before, grown with its load
RELIEF = (0.1, 0.4)  # of the static friction forces, where vibration cannot be raised from the static state


def solve_static_state(joint: Joint, wear_depth: FloatArray, tolerance: float, effort: Effort) -> PathPoint | None:
    """Frictional unilateral state under the static load, raised gradually from nothing; None where there is none.

    The state depends on the path of the load, so it is raised in equal steps and each starts from the tangential state
    of the one before. The first evaluation lets the pairs stick. Steps that Newton's method does not find are found by
    way of less friction (`friction_path`).
    """
    solver = JacobianSolver()

    def balance_at(load_factor: float, history: FloatArray) -> Balance:
        return Balance.frozen(static_joint(joint, load_factor), history, wear_depth)

    history = np.zeros((joint.contact.n_contact, 2))
    first = balance_at(1.0 / LOAD_STEPS, history)
    start = first.joint.structure.force_h()
    found = solve_from_less_friction(first, start, solver, tolerance, effort)
    if found is None:
        return None
    point = PathPoint(1.0 / LOAD_STEPS, found.evaluation, final_history(first, found.evaluation))
    for step in range(2, LOAD_STEPS + 1):
        share = step / LOAD_STEPS
        whole = balance_at(share, point.history)
        # without gaps and wear the state grows with its load; much friction allows others that do not
        grown = point.evaluation.predicted_h * (step / (step - 1.0))
        result = solve_balance(whole, grown, solver, tolerance, effort, FEW_ITERATIONS)
        if result.converged:
            point = PathPoint(share, result.evaluation, final_history(whole, result.evaluation))
            continue
        point, arrived = follow_naturally(balance_at, point, share, solver, tolerance, effort)
        if not arrived:
            whole = balance_at(share, point.history)
            found = solve_from_less_friction(whole, point.evaluation.predicted_h, solver, tolerance, effort)
            if found is None:
                return None
            point = PathPoint(share, found.evaluation, final_history(whole, found.evaluation))
    return point


def solve_first_state(
    case: Case,
    omega: float,
    excitation_amplitude: float,
    wear_depth: FloatArray,
    solver: JacobianSolver,
    effort: Effort,
) -> tuple[Outcome, PathPoint | None]:
    """Periodic state found from nothing: the static state first, then the excitation raised; or why there is none.

    A mass on a rigid slider has no state that is near both sticking and sliding: where raising the excitation fails or
    ends in an unstable state, the vibration without the joint is tried as the start. Pairs that the static load has
    left at their friction limit slip under the smallest vibration, in states that do not lie near the static one:
    vibration shakes such pairs down, so it is raised from states that carry less friction, too. Then the vibration is
    left to build up in time under the whole excitation (`settling`), and arc length in the excitation comes last.

    omega: rad/s. wear_depth (n_contact,): m, held fixed. The parameter of the point is the share of the excitation, 1.
    """
    tolerance = case.settings.tolerance
    quiet = case.joint(omega, 0.0)
    static = solve_static_state(quiet, wear_depth, tolerance, effort)
    if static is None:
        return Outcome.STATIC_FAILED, None

    def balance_at(share: float, history: FloatArray) -> Balance:
        return Balance.frozen(case.joint(omega, share * excitation_amplitude), history, wear_depth)

    unstable = False

    def stays(point: PathPoint) -> bool:
        nonlocal unstable
        at = point.evaluation
        stable = is_stable(balance_at(1.0, at.history).linearise(at), solver)
        unstable = unstable or not stable
        return stable

    still = balance_at(0.0, static.history)
    displacement_h, force_h = (
        change_orders(part, (), case.resolution.orders)
        for part in (static.evaluation.displacement_h, static.evaluation.force_h)
    )
    start = still.predict(displacement_h, force_h)
    result = solve_balance(still, start, solver, tolerance, effort)
    if not result.converged:
        return Outcome.START_FAILED, None
    rest = PathPoint(0.0, result.evaluation, final_history(still, result.evaluation))
    point, arrived = follow_naturally(balance_at, rest, 1.0, solver, tolerance, effort)
    if arrived and stays(point):
        return Outcome.CONVERGED, point
    whole = balance_at(1.0, static.history)
    sliding = start + _free_motion(whole)
    result = solve_balance(whole, sliding, solver, tolerance, effort)
    if result.converged:
        slid = PathPoint(1.0, result.evaluation, final_history(whole, result.evaluation))
        if stays(slid):
            return Outcome.CONVERGED, slid
    for share in RELIEF:
        relieved = Balance.frozen(quiet, _relieved(quiet, static, share), wear_depth)
        result = solve_balance(relieved, start, solver, tolerance, effort)
        if result.converged:
            held = PathPoint(0.0, result.evaluation, final_history(relieved, result.evaluation))
            risen, climbed = follow_naturally(balance_at, held, 1.0, solver, tolerance, effort)
            if climbed and stays(risen):
                return Outcome.CONVERGED, risen
    joint = case.joint(omega, excitation_amplitude)
    why, settled = settle(case, joint, wear_depth, rest.evaluation, quiet, rest.history, solver, effort)
    if settled is not None:
        return Outcome.CONVERGED, PathPoint(1.0, settled.evaluation, settled.history)
    if not arrived:
        reached = follow_arc(balance_at, point, 1.0, 0.2, solver, tolerance, effort, stays).point
        if reached is not None:
            return Outcome.CONVERGED, reached
    return Outcome.UNSTABLE if unstable else why, None


def _relieved(joint: Joint, static: PathPoint, share: float) -> FloatArray:
    """Tangential history (n_contact, 2), m, with which pairs carry a share less of their static friction force."""
    return static.history + share * static.evaluation.force_h[:, 1:, 0] / joint.penalty.tangential[:, None]


def _free_motion(balance: Balance) -> FloatArray:
    """Predicted force (n_rel, 2H+1), N, of the vibration that the excitation would cause without the joint."""
    joint = balance.joint
    amplitudes = np.zeros((joint.slots.size, joint.basis.n_harmonics), complex)
    amplitudes[:, 0] = np.linalg.lstsq(joint.structure.dynamic_stiffness[0], joint.structure.harmonic_force)[0]
    motion = joint.to_pairs(from_complex(np.zeros(joint.slots.size), amplitudes))
    return joint.to_relative(joint.surplus(motion))


def periodic_state(joint: Joint, point: PathPoint) -> PeriodicState:
    """The frozen state that is handed on, in physical units; its arrays lie in rows, as when read from a file."""
    at = point.evaluation
    return PeriodicState(
        omega=joint.omega,
        excitation_amplitude=joint.excitation_amplitude,
        displacement_h=np.array(at.displacement_h, order="C"),
        contact_force_h=np.array(at.force_h, order="C"),
        start_history=np.array(at.history, order="C"),
        wear_depth=np.array(at.wear_depth, order="C"),
    )


@dataclass(frozen=True)
class StateReport:
    """What is reported of a state; units and shapes as in `solver.history.WearHistory`, without the cycle dimension.

    slip_work (n_contact,): N m, and what it is wrong by for want of harmonics.
    """

    wear_depth: FloatArray
    slip_work: FloatArray
    slip_work_error: FloatArray
    mean_pressure: FloatArray
    slip_range: FloatArray
    open_fraction: FloatArray
    response: ComplexArray
    response_peak: FloatArray
    loop_displacement: FloatArray
    loop_force: FloatArray
    certificate: Certificate
    resolution: Resolution


def report_state(
    joint: Joint,
    evaluation: Evaluation,
    certificate: Certificate,
    slip_work_error: FloatArray,
    loops: tuple[int, ...] = (),
) -> StateReport:
    """Pressures, slip and responses of a converged state. loops: pairs whose fretting loops are reported, too."""
    loop_displacement, loop_force = contact_loops(joint, evaluation, loops)
    response_h = joint.structure.response_h(joint.to_relative(evaluation.displacement_h))
    return StateReport(
        wear_depth=evaluation.wear_depth,
        slip_work=evaluation.slip_work,
        slip_work_error=slip_work_error,
        mean_pressure=evaluation.force_h[:, 0, 0] / joint.contact.area,
        slip_range=largest_distance(evaluation.state_t) / joint.state_stiffness,
        open_fraction=(evaluation.status_t == SEPARATED).mean(axis=1),
        response=to_complex(response_h)[:, 0],
        response_peak=largest_responses(joint, evaluation),
        loop_displacement=loop_displacement,
        loop_force=loop_force,
        certificate=certificate,
        resolution=Resolution(joint.basis.orders, joint.basis.n_samples),
    )


@njit(cache=True)
def largest_distance(state_t: FloatArray) -> FloatArray:
    """Largest distance (n_contact,) between any two tangential states (n_contact, 2, N+1) of a period."""
    n_contact, _, n_points = state_t.shape
    largest = np.zeros(n_contact)
    for pair in range(n_contact):
        for i in range(n_points):
            for j in range(i):
                first = state_t[pair, 0, i] - state_t[pair, 0, j]
                second = state_t[pair, 1, i] - state_t[pair, 1, j]
                largest[pair] = max(largest[pair], first * first + second * second)
    return np.sqrt(largest)
