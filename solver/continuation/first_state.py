"""One state of the joint: the static one, the periodic one above it, and what is reported of it."""

from __future__ import annotations

import numpy as np

from solver.continuation.arc_length import follow_arc
from solver.continuation.friction_homotopy import solve_from_less_friction
from solver.continuation.natural import follow_naturally
from solver.continuation.transient import settle
from solver.harmonic_balance.converged import PathPoint, final_history
from solver.harmonic_balance.dlft import Balance
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Effort, solve_balance
from solver.outcome import Outcome
from solver.stability.hill import is_stable
from solver.structure.fourier import change_orders, from_complex
from solver.structure.joint import Case, Joint, static_joint

LOAD_STEPS = 20
FEW_ITERATIONS = 5  # of a load step from the state before, grown with its load
RELIEF = (0.1, 0.4)  # of the static friction forces, where vibration cannot be raised from the static state


def solve_static_state(joint: Joint, wear_depth: FloatArray, tolerance: float, effort: Effort) -> PathPoint | None:
    """Frictional unilateral state under the static load, raised gradually from nothing; None where there is none.

    The state depends on the path of the load, so it is raised in equal steps and each starts from the tangential state
    of the one before. The first evaluation lets the pairs stick. Steps that Newton's method does not find are found by
    way of less friction (`friction_homotopy`).
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
    left to build up in time under the whole excitation (`transient`), and arc length in the excitation comes last.

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
