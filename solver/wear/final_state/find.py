"""The final state by an active set for a cooperative joint, by a wear history to the steady state for any other.

CPU s of the active set and of the history (3 harmonics, both from the start state):

| joint | active set | history | accepted |
|---|---|---|---|
| slider | 0.03 | 0.43 | yes |
| cylinder, 24 strips / 60 (automatic harmonics) | 0.10 / 0.35 | 0.89 / 3.2 | yes |
| sphere, 8 x 8 patches / 16 x 16 | 0.19 / 2.2 | 1.7 / 14 | yes / no |
| dovetail, 16 pairs, 209 Hz and 4 N / 212.6 / 212.8 Hz | 0.31 / 1.5 / 1.5 | 1.4 / 1.6 / 1.1 | no |
| dovetail, 48 pairs, 211.5 Hz | 0.36 | 9.0 | no |
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from solver.accuracy.error_estimate import Estimate
from solver.accuracy.reference import coarser
from solver.clock import computing_time
from solver.continuation.natural import ATTEMPTS
from solver.harmonic_balance.state import Failure
from solver.model import FloatArray, ReducedModel
from solver.newton.run import OutOfTimeError
from solver.outcome import Outcome, describe_error
from solver.packing import Packed
from solver.results.cut_off import first_cut_off
from solver.results.history import StartState, WearHistory
from solver.results.verdict import judge
from solver.settings import SolverSettings, ToTheEnd
from solver.structure.joint import Case, build_case
from solver.wear.check import FullCheck, unstable_at_end, with_harmonics
from solver.wear.final_state.active_set import NoActiveSetError, WornOff, not_cooperative, wear_off
from solver.wear.history import integrate_wear, of_state, reported
from solver.wear.output import DenseOutput
from solver.wear.solutions import SlowTime, begin_reference
from solver.wear.state import WearState
from solver.wear.wearing_joint import WearingJoint


def find_final_state(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    settings: SolverSettings,
    start: StartState,
    asked: SlowTime,
    keep: Callable[[Packed], None] | None = None,
    resume: Packed | None = None,
) -> WearHistory:
    """The state in which nothing wears any more; arguments as for `integrate_wear`.

    asked: `cycles` is a `ToTheEnd`; the scheme is used where the active set does not apply.

    `final_method` of the history is the method. "active_set": the first output is the unworn state, the last output is
    the final state with the count inf, and the outputs between are NaN. "march": the history of the scheme; the message
    gives the reason and the result of the active set.
    """
    direct: WearHistory | None = None
    reason, began = "", computing_time()
    if start.state is not None:
        try:
            case = build_case(model, friction_coefficient, start.penalty_omega, settings, start.resolution)
            direct, reason = _directly(case, start, asked)
        except NoActiveSetError as error:
            reason = str(error)
        except OutOfTimeError:
            reason = "it was not found in solver.time_limit"
        except Exception as error:
            # the history is integrated instead
            reason = describe_error(error)
    if direct is not None and not reason:
        return direct
    spent = computing_time() - began
    integrated = integrate_wear(model, friction_coefficient, settings, start, asked, keep, resume)
    remark = f"no active set: {reason}" if reason else ""
    if direct is not None and direct.worn_volume[-1] > 0.0 and np.isfinite(integrated.worn_volume[-1]):
        volumes = 1e9 * direct.worn_volume[-1], 1e9 * integrated.worn_volume[-1]
        apart = float(np.abs(direct.wear_depth[-1] - integrated.wear_depth[-1]).max())
        remark += f"; it has {volumes[0]:.4g} mm3, the march {volumes[1]:.4g} mm3, depths differ by {apart:.2g} m"
    message = "; ".join(filter(None, (integrated.message, remark)))
    return replace(integrated, final_method="march", run_time=integrated.run_time + spent, message=message)


@dataclass(frozen=True)
class _Found:
    """Final and unworn state of an active set, the output of both, and the reason of a rejection, empty if none."""

    unworn: WearState
    final: WornOff
    output: DenseOutput
    reason: str


def _directly(case: Case, start: StartState, asked: SlowTime) -> tuple[WearHistory, str]:
    """The history by the active set, and the reason of a rejection. Raises NoActiveSetError where there is none."""
    assert start.state is not None
    assert isinstance(asked.cycles, ToTheEnd)
    began, share = computing_time(), asked.cycles.final_share
    work = WearingJoint.of(case, start.state, asked.wear_coefficient, asked.law)
    work.run.budget.deadline = began + case.settings.time_limit
    estimate = Estimate(start.response_error, start.wear_rate_error)
    state = work.begin(start.state, start.resolution, estimate, accurate=start.outcome is Outcome.CONVERGED)
    found = _solved(work, state, FullCheck(asked.loops), share)
    depth = found.final.state.depth
    # no depth is more accurate than the solution of the states
    error = np.abs(_reference_depth(work, start, found, share) - depth) + case.settings.tolerance * depth
    history = _assembled(work, start, asked.cycles.n_outputs, found, error)
    iterations = start.newton_iterations + work.run.budget.iterations
    run_time = start.run_time + computing_time() - began
    return replace(history, newton_iterations=iterations, run_time=run_time), found.reason


def _solved(work: WearingJoint, state: WearState, check: FullCheck, share: float) -> _Found:
    """The unworn and the final state, both checked, and the reason of a rejection."""
    first = check(work, state)
    if isinstance(first, Failure):
        raise NoActiveSetError(f"{first.outcome.meaning} at the unworn state")
    (unworn, report), output = first, DenseOutput(work.area, smooth=False)
    output.add(0.0, report, work.rate(unworn.point.evaluation), 0.0)
    # the wear rate of the final state is round-off: its error is relative to the unworn state
    work.usual_work = float(unworn.point.evaluation.slip_work.sum())
    final = wear_off(work, unworn, unworn.depth, np.zeros(unworn.depth.size, bool), share)
    reason = not_cooperative(work, unworn, final, share)
    last = check(work, final.state)
    for _ in range(ATTEMPTS):
        if isinstance(last, Failure) or last[0].resolution == final.state.resolution:
            break
        # with other harmonics the pairs graze at other depths
        final = wear_off(work, last[0], unworn.depth, final.off, share)
        last = check(work, final.state)
    if isinstance(last, Failure):
        raise NoActiveSetError(f"its final state is {last.outcome.meaning}")
    state, report = last
    if (unstable := unstable_at_end(work, state)) is not None:
        reason = reason or f"its final state is {unstable.outcome.meaning}"
    output.add(1.0, report, work.rate(state.point.evaluation), 0.0)
    return _Found(unworn, replace(final, state=state), output, reason)


def _reference_depth(work: WearingJoint, start: StartState, found: _Found, share: float) -> FloatArray:
    """Final depths (n_contact,), m, of the reference solution; NaN if not found.

    The reference solution starts from the state of the reference sweep, with fewer harmonics.
    """
    first = begin_reference(work, start, found.unworn.step_limit)
    state = with_harmonics(work, first, coarser(found.final.state.resolution, work.case.model))
    if state is None:
        return np.full(first.depth.size, np.nan)
    state = work.noted(state)
    try:
        return wear_off(work, state, state.depth, np.zeros(state.depth.size, bool), share).state.depth
    except NoActiveSetError:
        return np.full(first.depth.size, np.nan)


def _assembled(
    work: WearingJoint, start: StartState, n_outputs: int, found: _Found, depth_error: FloatArray
) -> WearHistory:
    """The history of the unworn and the final state. depth_error (n_contact,): error of the final depths, m."""
    counts = np.full(n_outputs, np.nan)
    # count 1 of the output is the final state
    counts[0], counts[-1] = 0.0, 1.0
    own, state, area = found.output.read(counts), found.final.state, work.area
    cut_off = first_cut_off(work.case.model.contact, counts, own["mean_pressure"], own["wear_depth"])
    counts[-1] = math.inf
    volume = own["wear_depth"] @ area
    error = float(depth_error @ area) / float(volume[-1]) if volume[-1] > 0.0 else 0.0
    error = math.inf if math.isnan(error) else error
    errors, depth_errors = np.full(counts.size, np.nan), np.full(own["wear_depth"].shape, np.nan)
    errors[0], errors[-1], depth_errors[0], depth_errors[-1] = 0.0, error, 0.0, depth_error
    history = WearHistory(
        **reported(own),
        # the error of a wear rate that is round-off counts for nothing
        **of_state(state) | {"inaccurate_in": "response", "inaccurate_error": state.worst.response},
        outcome=Outcome.CONVERGED,
        cycles=counts,
        worn_volume=volume,
        worn_volume_error=errors,
        wear_depth_error=depth_errors,
        reference_volume=np.where(np.isfinite(errors), volume + errors * volume, np.nan),
        error_estimate=error,
        newton_iterations=0,
        run_time=0.0,
        last_cycle=math.inf,
        jump_cycle=math.nan,
        branch=start.branch,
        fold_frequency=start.fold_frequency,
        final_method="active_set",
        cut_off_cycle=math.inf if cut_off == 1.0 else cut_off,
    )
    outcome, message = judge(history, np.flatnonzero(np.isfinite(volume)), work.case.settings.rtol)
    return replace(history, outcome=outcome, message=message)
