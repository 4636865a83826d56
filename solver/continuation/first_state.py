"""The first periodic state of a joint, from its static state."""

from __future__ import annotations

import numpy as np

from solver.continuation.arc_length import Arc, follow_arc
from solver.continuation.natural import follow_naturally
from solver.continuation.options import CONTINUATION
from solver.continuation.static_state import predicted_at_rest, solve_static_state
from solver.continuation.transient import relax_to_periodic
from solver.harmonic_balance.converged import PathPoint, final_history
from solver.harmonic_balance.dlft import Balance
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Budget, solve_balance
from solver.outcome import Outcome
from solver.stability.hill import is_stable_at
from solver.structure.fourier import from_complex
from solver.structure.joint import Case, Joint


def solve_first_state(
    case: Case,
    omega: float,
    excitation_amplitude: float,
    wear_depth: FloatArray,
    solver: JacobianSolver,
    budget: Budget,
) -> tuple[Outcome, PathPoint | None]:
    """First periodic state. These ways are tried in turn until one leads to a stable state:

    1. The static state is solved, and the excitation is raised from zero.
    2. Newton's method starts from the vibration without the joint: a mass on a rigid slider has no state that is near
       both sticking and sliding.
    3. The excitation is raised from states with smaller static friction forces. Pairs that the static load leaves at
       their friction limit slip under the smallest vibration, in states far from the static one, and shake down.
    4. The vibration builds up in time under the whole excitation (`transient`).
    5. Where the first way did not reach the whole excitation, arc length continues from its last state.

    Parameters
    ----------
    case : Case
        Model, friction and settings.
    omega, excitation_amplitude : float
        Angular frequency, rad/s, and excitation amplitude, N.
    wear_depth : array (n_contact,)
        Wear depth, m, held.
    solver, budget
        As in `solve_balance`.

    Returns
    -------
    outcome : Outcome
        CONVERGED, START_FAILED, UNSTABLE, UNSETTLED, ADRIFT, or an outcome of `solve_static_state`.
    point : PathPoint or None
        The state; its parameter is the load factor of the excitation, 1.
    """
    tolerance = case.settings.tolerance
    quiet = case.joint(omega, 0.0)
    static = solve_static_state(quiet, wear_depth, tolerance, budget)
    if isinstance(static, Outcome):
        return static, None

    def balance_at(load_factor: float, history: FloatArray) -> Balance:
        return Balance.frozen(case.joint(omega, load_factor * excitation_amplitude), history, wear_depth)

    unstable = False

    def accepted(point: PathPoint) -> bool:
        nonlocal unstable
        at = point.evaluation
        stable = is_stable_at(balance_at(1.0, at.history), at, solver, budget)
        unstable = unstable or not stable
        return stable

    start = predicted_at_rest(case, quiet, static, wear_depth)
    rest = _solved(balance_at(0.0, static.history), start, 0.0, solver, tolerance, budget)
    if rest is None:
        return Outcome.START_FAILED, None
    point, arrived = follow_naturally(balance_at, rest, 1.0, solver, tolerance, budget)
    if arrived and accepted(point):
        return Outcome.CONVERGED, point
    whole = balance_at(1.0, static.history)
    slid = _solved(whole, start + _free_motion(whole), 1.0, solver, tolerance, budget)
    if slid is not None and accepted(slid):
        return Outcome.CONVERGED, slid
    for fraction in CONTINUATION.relief:
        relieved = Balance.frozen(quiet, relieved_history(quiet, static, fraction), wear_depth)
        held = _solved(relieved, start, 0.0, solver, tolerance, budget)
        if held is not None:
            loaded, reached_load = follow_naturally(balance_at, held, 1.0, solver, tolerance, budget)
            if reached_load and accepted(loaded):
                return Outcome.CONVERGED, loaded
    joint = case.joint(omega, excitation_amplitude)
    why, relaxed = relax_to_periodic(case, joint, wear_depth, rest.evaluation, quiet, rest.history, solver, budget)
    if relaxed is not None:
        return Outcome.CONVERGED, PathPoint(1.0, relaxed.evaluation, relaxed.history)
    if not arrived:
        # the last way, within a budget of its own: where the joint has no grip arc length does not come to an end
        limit, budget.limit = budget.limit, min(budget.limit, budget.iterations + CONTINUATION.search_iterations)
        arc = Arc(balance_at, point, CONTINUATION.arc_span, solver, tolerance, budget)
        reached = follow_arc(arc, 1.0, accepted).point
        budget.limit = limit
        if reached is not None:
            return Outcome.CONVERGED, reached
    return Outcome.UNSTABLE if unstable else why, None


def _solved(
    balance: Balance, start: FloatArray, load_factor: float, solver: JacobianSolver, tolerance: float, budget: Budget
) -> PathPoint | None:
    """State of a balance at a load factor by Newton's method; None where not converged."""
    result = solve_balance(balance, start, solver, tolerance, budget)
    if not result.converged:
        return None
    return PathPoint(load_factor, result.evaluation, final_history(balance, result.evaluation))


def relieved_history(joint: Joint, static: PathPoint, fraction: float) -> FloatArray:
    """Tangential history (n_contact, 2), m, that reduces the static friction forces by a fraction."""
    return static.history + fraction * static.evaluation.force_h[:, 1:, 0] / joint.penalty.tangential[:, None]


def _free_motion(balance: Balance) -> FloatArray:
    """Predicted force (n_rel, 2H+1), N, of the vibration that the excitation would cause without the joint."""
    joint = balance.joint
    amplitudes = np.zeros((joint.component_index.size, joint.basis.n_harmonics), complex)
    amplitudes[:, 0] = np.linalg.lstsq(joint.structure.dynamic_stiffness[0], joint.structure.harmonic_force)[0]
    motion = joint.to_pairs(from_complex(np.zeros(joint.component_index.size), amplitudes))
    return joint.to_relative(joint.law.force(motion))
