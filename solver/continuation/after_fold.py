"""Where a branch ends while the joint wears: the states that the vibration can land on."""

from __future__ import annotations

from collections.abc import Iterator

from solver.continuation.arc_length import follow_arc
from solver.continuation.first_state import solve_first_state
from solver.continuation.transient import settle
from solver.harmonic_balance.converged import PathPoint
from solver.harmonic_balance.dlft import Balance
from solver.model import FloatArray
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Effort
from solver.outcome import Outcome
from solver.stability.hill import is_stable
from solver.structure.joint import Case, Joint

SPAN = 0.01  # of the frequency: natural length of arc-length steps


def landings(
    case: Case, joint: Joint, last: PathPoint, worn: FloatArray, solver: JacobianSolver, effort: Effort
) -> Iterator[PathPoint | Outcome]:
    """Stable states beyond the end of a branch, the most physical one first; none is sought before it is asked for.

    last: the last state of the branch. worn (n_contact,): m, a wear depth just beyond its end. First the state that the
    structure settles to in time at that depth; then the branch at the depth of the last state, followed along the
    frequency through its folds and back to the same frequency; then a state from nothing. Last of all, why there is no
    (other) state: where the structure drifts away at the first attempt no other one is made.
    """
    outcome, settled = settle(case, joint, worn, last.evaluation, joint, last.history, solver, effort)
    if settled is not None:
        yield settled
    if outcome is Outcome.ADRIFT:
        yield outcome
        return
    before = last.evaluation.wear_depth

    def balance_at(omega: float, history: FloatArray) -> Balance:
        return Balance.frozen(case.joint(omega, joint.excitation_amplitude), history, before)

    def stays(point: PathPoint) -> bool:
        return is_stable(balance_at(point.parameter, point.history).linearise(point.evaluation), solver)

    tolerance = case.settings.tolerance
    # the frequency of the state is the target, so the walk begins at it
    start = PathPoint(joint.omega, last.evaluation, last.evaluation.history)
    for toward in (-1.0, 1.0):
        arc = follow_arc(balance_at, start, joint.omega, SPAN * joint.omega, solver, tolerance, effort, stays, toward)
        if arc.point is not None and arc.folds:
            yield arc.point
    outcome, other = solve_first_state(case, joint.omega, joint.excitation_amplitude, worn, solver, effort)
    yield outcome if other is None else other
