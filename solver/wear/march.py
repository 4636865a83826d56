"""Wear on the slow time scale, from a start state to the last cycle count, and how it ended."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from solver.clock import computing_time
from solver.contact.wear_law import ARCHARD, WearLaw
from solver.model import FloatArray, ReducedModel
from solver.newton.solve_balance import OutOfTimeError
from solver.outcome import SENSITIVE_ERROR, Outcome, describe_error, known_to
from solver.packing import Packed, pack, unpack
from solver.results.cut_off import judge_cut_off
from solver.results.history import StartState, WearHistory
from solver.results.recorder import Recorder
from solver.results.trail import TrailRecorder
from solver.settings import Scheme, SolverSettings, ToTheEnd, WearTarget
from solver.structure.joint import build_case
from solver.wear.bdf2 import AdaptiveSteps
from solver.wear.companion import Companion
from solver.wear.final_state.end import EndWatch
from solver.wear.free_slide import describe_hold
from solver.wear.options import WEAR
from solver.wear.step_limit import StepTooLongError
from solver.wear.trajectory import Trajectory


def march_wear(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    start: StartState,
    wear_coefficient: float,
    step: float,
    scheme: Scheme,
    cycles: FloatArray | ToTheEnd,
    settings: SolverSettings,
    largest_depth: float | None = None,
    loops: tuple[int, ...] = (),
    keep: Callable[[Packed], None] | None = None,
    resume: Packed | None = None,
    law: WearLaw = ARCHARD,
    until: WearTarget | None = None,
) -> WearHistory:
    """Wear history of one point of a study, Eqs. (20) to (26).

    Parameters
    ----------
    model, friction_coefficient, start
        The case, and the unworn state that it starts from.
    wear_coefficient
        k_w, 1/Pa.
    step
        h, cycles; the adaptive scheme chooses its own steps.
    scheme
        "explicit" (Eq. (20)), "implicit" (Eq. (24)) or "adaptive" (`solver.wear.bdf2`).
    cycles
        (n_output,), ascending counts to report, the first 0. Between two steps they are interpolated, and the last step
        is shortened to end on the last of them. Or a march to the end, whose counts are found on the way: then steps
        grow without bound, those of the implicit scheme so that each wears as much as the first one did. The explicit
        scheme, whose steps must not grow, takes no such march.
    settings
        Harmonics, samples, tolerances, limit of time.
    largest_depth
        m; where given, the explicit scheme takes its step from Eq. (22) instead of `step`.
    loops
        Pairs whose fretting loops are kept at every count.
    keep
        Called now and then with the progress of the march.
    resume
        Such progress of a march with the same arguments, from which this one goes on: its history is the same to the
        last bit, but for `run_time`.
    law
        Of the wear.
    until
        Wear at which the march ends before its last count, with the step that reaches it.

    Returns
    -------
    WearHistory
        As far as it was computed; its outcome says how it ended. No error is raised for a march that fails.
    """
    started = computing_time()
    endless = isinstance(cycles, ToTheEnd)
    counts = np.zeros(cycles.n_outputs) if isinstance(cycles, ToTheEnd) else cycles
    end = float("inf") if endless else float(counts[-1])
    kind = TrailRecorder if endless else Recorder
    recorder = kind(model, counts, start.newton_iterations, start.run_time, scheme, len(loops), until)
    if start.state is None:
        failed = recorder.failed(start.outcome, 0.0)
        return replace(failed, branch=start.branch, fold_frequency=start.fold_frequency, message=start.message)
    case = build_case(model, friction_coefficient, start.penalty_omega, settings, start.resolution)
    shifts = until is not None and until.quantity == "frequency_shift"
    march = Trajectory(case, start, wear_coefficient, scheme, loops, law, with_resonance=shifts)
    companion = Companion(march, start, counts)
    watch = EndWatch(march, cycles.final_share if isinstance(cycles, ToTheEnd) else None)
    spent_before, message = 0.0, ""
    march.effort.deadline = started + settings.time_limit
    try:
        outcome, n_steps = Outcome.CONVERGED, 0
        if resume is None:
            outcome = march.begin()
            if outcome is Outcome.CONVERGED:
                companion.begin()
                recorder.add(0.0, march.report(), wear_coefficient)
        else:
            n_steps, spent_before, *states = unpack(resume)
            march.load_state(states[0])
            recorder.load_state(states[1])
            companion.load_state(states[3])
            watch.load_state(states[4])
            march.effort.deadline -= spent_before
        steps: AdaptiveSteps | FixedSteps = (
            AdaptiveSteps(march, settings.rtol) if scheme == "adaptive" else FixedSteps(march, end, step, largest_depth)
        )
        if resume is not None:
            steps.load_state(states[2])
        refreshed = march.effort.iterations
        while outcome is Outcome.CONVERGED and march.cycle < end and np.isnan(recorder.reached) and not watch.ended():
            if not march.wears():
                if not endless:
                    recorder.add(end, march.report(), wear_coefficient)
                break
            if message := watch.goes_on(n_steps):
                outcome = Outcome.NO_FINAL_STATE
                break
            n_steps += 1
            if march.effort.iterations > WEAR.march_iterations + WEAR.step_iterations * n_steps:
                outcome = Outcome.MARCH_FAILED
                break
            before = march.cycle
            arrived, length = steps.advance()
            if not arrived:
                # what was reached of the step is a state, too
                if march.cycle > before:
                    outcome = march.check()
                    if outcome is Outcome.CONVERGED:
                        recorder.add(march.cycle, march.report(), wear_coefficient, steps.error)
                if outcome is Outcome.CONVERGED and not march.jump(length):
                    outcome = march.failure
                if outcome is not Outcome.CONVERGED:
                    break
                steps.restart()
            outcome = march.check()
            if outcome is not Outcome.CONVERGED:
                break
            recorder.add(march.cycle, march.report(), wear_coefficient, steps.error)
            watch.note()
            at_once = march.cycle >= end or not np.isnan(recorder.reached) or watch.ended()
            recorder.compare(companion.follow(at_once))
            if march.effort.iterations >= refreshed + WEAR.iterations_per_save:
                spent = spent_before + computing_time() - started
                parts = (march, recorder, steps, companion, watch)
                progress = pack([n_steps, spent, *(part.state_dict() for part in parts)])
                # with or without anybody who keeps it, so that all marches go on from the same numbers
                for part, state in zip(parts, unpack(progress)[2:], strict=True):
                    part.load_state(state)
                refreshed = march.effort.iterations
                if keep is not None:
                    keep(progress)
        if outcome is Outcome.CONVERGED:
            outcome = march.stability()
    except np.linalg.LinAlgError:
        outcome = Outcome.SINGULAR
    except OutOfTimeError:
        outcome = Outcome.TIME_LIMIT
    except StepTooLongError as error:
        outcome, message = Outcome.STEP_TOO_LONG, str(error)
    except Exception as error:
        # one bad point is one bad point: the study goes on
        outcome, message = Outcome.EXCEPTION, describe_error(error)
    spent = spent_before + computing_time() - started
    # adaptive steps go beyond the end
    jump_cycle = march.jump_cycle if march.jump_cycle <= end else float("nan")
    n_iterations = march.effort.iterations + companion.effort.iterations
    history = recorder.finish(
        outcome, jump_cycle, n_iterations, spent, companion.kept, companion.met, companion.start_error
    )
    if outcome is Outcome.CONVERGED:
        outcome, message = _judge(march, history, recorder.compared)
    elif outcome in (Outcome.UNSTABLE, Outcome.PERIOD_DOUBLED):
        message = march.reason
    if outcome.complete and not np.isnan(march.held_from):
        message = "; ".join(filter(None, (message, describe_hold(march.held_from))))
    ended = replace(
        history,
        outcome=outcome,
        branch=start.branch,
        fold_frequency=start.fold_frequency,
        message=message,
        step_limit=march.step_limit if march.step_limit > 0.0 else float("inf"),
        # what alternates with the other schemes are small corners of the wear rate, not the steps
        oscillates=scheme == "explicit" and march.oscillates(),
    )
    return judge_cut_off(ended)


def _judge(march: Trajectory, history: WearHistory, compared: FloatArray) -> tuple[Outcome, str]:
    """Outcome of a history that has come to its end, and what it does not say by itself; compared: its companion."""
    if np.isinf(march.worst.largest) and not march.case.settings.automatic:
        return Outcome.INACCURATE, (
            f"from cycle {march.inaccurate_from:,.0f} on the error of the wear rate is not known: no state with more"
            ' harmonics was found that would show it; harmonics = "auto" may'.replace(",", " ")
        )
    if history.error_estimate > SENSITIVE_ERROR:
        # one that has reached its target has no last count
        area, last = march.joint.contact.area, int(np.flatnonzero(np.isfinite(history.wear_depth).all(axis=1))[-1])
        volume, other = (1e9 * float(depth[last] @ area) for depth in (history.wear_depth, compared))
        known = "not known" if history.error_estimate >= 1.0 else f"known to {100 * history.error_estimate:.2g} % only"
        coarser = "steps twice as long from the start state of a coarser sweep"
        if not np.isfinite(other):
            return Outcome.SENSITIVE, f"worn volume {volume:.3g} mm3, {known}: {coarser} do not lead so far"
        agree = abs(volume - other) < 0.5 * history.error_estimate * volume
        if agree and march.worst.wear_rate > SENSITIVE_ERROR:
            return Outcome.INACCURATE, (
                f"worn volume {volume:.3g} mm3, {known}: more harmonics and samples change the wear rate by "
                f"{100.0 * march.worst.wear_rate:.2g} % (pairs slip only for moments, as they open and close); steps"
                f" twice as long change little, {other:.3g} mm3"
            )
        if agree:
            elsewhere = "where other pairs wear, or by other values on the way"
            return (
                Outcome.SENSITIVE,
                f"worn volume {volume:.3g} mm3, {known}: {other:.3g} mm3 with {coarser}, {elsewhere}",
            )
        return Outcome.SENSITIVE, f"worn volume {volume:.3g} mm3, but {other:.3g} mm3 with {coarser}: {known}"
    if march.inaccurate_from < float("inf"):
        what = "wear rate" if march.worst.wear_rate >= march.worst.response else "response"
        return Outcome.INACCURATE, (
            f"from cycle {march.inaccurate_from:,.0f} on the {what} ".replace(",", " ")
            + known_to(march.worst.largest, march.case.settings.rtol)
        )
    return Outcome.CONVERGED, ""


@dataclass
class FixedSteps:
    """Explicit or implicit Euler steps of a given length, or explicit ones by the largest-depth rule, Eq. (22).

    end: last cycle count; inf: implicit steps grow so that each wears as much as the first one, at most to twice the
    last one. step: h, cycles. largest_depth: m, None where the step is given.
    error: None; that of an Euler step shows in the wear rates at its ends.
    """

    trajectory: Trajectory
    end: float
    step: float
    largest_depth: float | None
    error: None = None
    length: float = field(init=False)

    def __post_init__(self) -> None:
        self.length = self.step

    def advance(self) -> tuple[bool, float]:
        """One step: whether the branch goes on, and the length of the step in cycles."""
        before = self.trajectory.cycle
        planned = self.step
        if self.end == np.inf:
            rates = self.trajectory.rates
            slower = float(rates.largest[-1] / rates.value[-1])
            planned = self.length = min(WEAR.largest_step_ratio * self.length, self.step * slower)
        if self.largest_depth is not None and self.trajectory.scheme == "explicit":
            planned = self.largest_depth / float(self.trajectory.rate().max())
        # a remainder below round-off of the count is no step of its own
        reach = self.end if before + planned >= self.end * (1.0 - 1e-12) else before + planned
        return self.trajectory.advance(reach), reach - before

    def state_dict(self) -> dict[str, float]:
        """What goes on from step to step, to be packed."""
        return {"length": self.length}

    def load_state(self, state: dict[str, float]) -> None:
        """Go on from the state of another one."""
        self.length = state["length"]

    def restart(self) -> None:
        """Euler steps know nothing of those before."""
