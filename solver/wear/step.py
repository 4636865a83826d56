"""One Euler step on the slow time scale: to the next state, or to the end of the branch of the vibration."""

from __future__ import annotations

from dataclasses import dataclass, replace

from solver.accuracy.error_estimate import euler_error
from solver.continuation.natural import follow_naturally
from solver.harmonic_balance.converged import BalanceAt, PathPoint, final_history
from solver.newton.options import NEWTON
from solver.outcome import Outcome
from solver.settings import Scheme
from solver.wear.branch_loss import is_stable_when_held
from solver.wear.euler import euler_balance
from solver.wear.options import WEAR
from solver.wear.state import Failure, Reached, WearState
from solver.wear.step_limit import too_long
from solver.wear.wearing_joint import WearingJoint


@dataclass(frozen=True)
class Step:
    """Result of a step.

    state: state at the end of the step, or the last one before the end of the branch of the vibration.
    error: estimated local error, as worn volume, m3.
    length: length of the attempted step, cycles.
    arrived: False where the branch ends within the step.
    end_known_to: accuracy of the end of the branch, cycles.
    """

    state: WearState
    error: float
    length: float
    arrived: bool = True
    end_known_to: float = 0.0


def euler_step(work: WearingJoint, state: WearState, length: float, scheme: Scheme) -> Step:
    """One Euler step, Eq. (20) for the explicit scheme, else Eq. (24).

    Where the branch of the vibration ends within the step, the result has the last stable state, located with the
    accuracy `fold_resolution`.
    """
    joint, tolerance = work.at(state), work.case.settings.tolerance
    base = PathPoint(0.0, state.point.evaluation, state.point.history)
    balance_at = euler_balance(joint, scheme, base.evaluation, length, work.wear_coefficient, work.wearing)
    whole = balance_at(1.0, base.history)
    start, whole = work.predicted(state, whole, length)
    if work.follow is not None or start is not base.evaluation.predicted_h:
        end = work.solved(state, start, whole)
        if end is not None:
            return _euler(work, state, end, length)
    # accuracy of the end of a branch: a fraction of the count, or of the step in the first step
    resolution = WEAR.fold_resolution * (state.cycle if state.cycle > 0.0 else length) / length
    shortest = min(resolution, NEWTON.shortest_step)
    if work.follow is not None:
        return _shortened(work, state, length, balance_at, shortest)
    last, arrived = follow_naturally(
        balance_at, base, 1.0, work.solver, tolerance, work.budget, keep_history=True, shortest=shortest
    )
    if not is_stable_when_held(joint, last.evaluation, work.solver):
        # the place of the loss of stability is not known: the jump begins at the start of the step
        last, arrived = base, False
    if not arrived and last.parameter <= 0.0:
        return Step(state, 0.0, length, arrived=False, end_known_to=shortest * length)
    ahead = last.parameter * length
    point = PathPoint(0.0, last.evaluation, final_history(balance_at(last.parameter, base.history), last.evaluation))
    taken = _euler(work, state, Reached(point, state.omega, state.lag, state.half_width), ahead)
    return replace(taken, length=length, arrived=arrived, end_known_to=shortest * length)


def _shortened(work: WearingJoint, state: WearState, length: float, balance_at: BalanceAt, shortest: float) -> Step:
    """A step at the frequency that is followed, halved until its end is found; shortest: as a fraction of the step."""
    fraction = 0.5
    while fraction >= shortest and not work.budget.exhausted:
        balance = balance_at(fraction, state.point.history)
        end = work.solved(state, *work.predicted(state, balance, fraction * length))
        if end is not None:
            return _euler(work, state, end, fraction * length)
        fraction *= 0.5
    return Step(state, 0.0, length, arrived=False, end_known_to=shortest * length)


def _euler(work: WearingJoint, state: WearState, end: Reached, length: float) -> Step:
    """The result of an Euler step."""
    after = work.accepted(state, end, length)
    change = abs(float(after.rates[-1] - state.rates[-1]))
    return Step(after, euler_error(length, change), length)


def bounded_euler_step(work: WearingJoint, state: WearState, length: float, scheme: Scheme) -> Step | Failure:
    """One Euler step, rejected where its wear would move many times the normal forces."""
    step = euler_step(work, state, length, scheme)
    ahead = step.state.cycle - state.cycle
    said = too_long(work.at(state), state.point.evaluation, step.state.depth, state.cycle, ahead)
    return step if said is None else Failure(Outcome.STEP_TOO_LONG, said)
