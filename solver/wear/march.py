"""Wear on the slow time scale, from a start state to the last cycle count, and how it ended."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from solver.clock import computing_time
from solver.model import FloatArray, ReducedModel
from solver.newton.solve_balance import OutOfTimeError
from solver.outcome import SENSITIVE_ERROR, Outcome, describe_error
from solver.packing import Packed, pack, unpack
from solver.results.history import StartState, WearHistory
from solver.results.recorder import Recorder
from solver.settings import Scheme, SolverSettings
from solver.structure.joint import build_case
from solver.wear.bdf2 import AdaptiveSteps
from solver.wear.companion import Companion
from solver.wear.step_limit import StepTooLongError
from solver.wear.trajectory import Trajectory

MOST_ITERATIONS = 3000  # of Newton's method, and some more a step: a march that takes more leads nowhere
STEP_ITERATIONS = 10
REFRESH = 100  # iterations after which the factorisation kept from step to step is given up, so that a march can be
# kept on disk and go on to the same numbers; one factorisation in so many iterations costs next to nothing


def march_wear(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    start: StartState,
    wear_coefficient: float,
    step: float,
    scheme: Scheme,
    cycles: FloatArray,
    settings: SolverSettings,
    largest_depth: float | None = None,
    loops: tuple[int, ...] = (),
    keep: Callable[[Packed], None] | None = None,
    resume: Packed | None = None,
) -> WearHistory:
    """Wear history of one point of a study.

    wear_coefficient: 1/Pa. step: h, cycles; the adaptive scheme chooses its own steps. cycles (n_output,): ascending
    counts to report, the first 0; between two steps they are interpolated, and the last step is shortened to end on the
    last of them. largest_depth: m; where given, the explicit scheme takes its step from Eq. (22) instead of `step`.
    loops: pairs whose fretting loops are kept at every count.
    keep: called now and then with the progress of the march. resume: such progress of a march with the same arguments,
        from which this one goes on: its history is the same to the last bit, but for `run_time`.
    """
    started = computing_time()
    recorder = Recorder(model, cycles, start.newton_iterations, start.run_time, scheme, len(loops))
    if start.state is None:
        failed = recorder.failed(start.outcome, 0.0)
        return replace(failed, branch=start.branch, fold_frequency=start.fold_frequency, message=start.message)
    case = build_case(model, friction_coefficient, start.penalty_omega, settings, start.resolution)
    march = Trajectory(case, start, wear_coefficient, scheme, loops)
    companion = Companion(march, start, cycles)
    spent_before, message = 0.0, ""
    march.effort.deadline = started + settings.time_limit
    try:
        outcome, n_steps, end = Outcome.CONVERGED, 0, float(cycles[-1])
        if resume is None:
            outcome = march.begin()
            if outcome is Outcome.CONVERGED:
                companion.begin()
                recorder.add(0.0, march.report(), wear_coefficient)
        else:
            n_steps, spent_before, *carried = unpack(resume)
            march.take_up(carried[0])
            recorder.take_up(carried[1])
            companion.take_up(carried[3])
            march.effort.deadline -= spent_before
        steps: AdaptiveSteps | FixedSteps = (
            AdaptiveSteps(march, settings.rtol) if scheme == "adaptive" else FixedSteps(march, end, step, largest_depth)
        )
        if resume is not None:
            steps.take_up(carried[2])
        refreshed = march.effort.iterations
        while outcome is Outcome.CONVERGED and march.cycle < end:
            if not march.wears():
                recorder.add(end, march.report(), wear_coefficient)
                break
            n_steps += 1
            if march.effort.iterations > MOST_ITERATIONS + STEP_ITERATIONS * n_steps:
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
            companion.follow(at_once=march.cycle >= end)
            recorder.add(march.cycle, march.report(), wear_coefficient, steps.error)
            if march.effort.iterations >= refreshed + REFRESH:
                spent = spent_before + computing_time() - started
                parts = (march, recorder, steps, companion)
                progress = pack([n_steps, spent, *(part.carried() for part in parts)])
                # with or without anybody who keeps it, so that all marches take the same way
                for part, carried in zip(parts, unpack(progress)[2:], strict=True):
                    part.take_up(carried)
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
    jump_cycle = march.jump_cycle if march.jump_cycle <= cycles[-1] else float("nan")
    n_iterations = march.effort.iterations + companion.effort.iterations
    history = recorder.finish(
        outcome, jump_cycle, n_iterations, spent, companion.kept, companion.met, companion.start_share
    )
    if outcome is Outcome.CONVERGED:
        outcome, message = _judge(march, history, companion)
    return replace(
        history,
        outcome=outcome,
        branch=start.branch,
        fold_frequency=start.fold_frequency,
        message=message,
        step_limit=march.step_limit if march.step_limit > 0.0 else float("inf"),
        # what alternates with the other schemes are small corners of the wear rate, not the steps
        oscillates=scheme == "explicit" and march.oscillates(),
    )


def _judge(march: Trajectory, history: WearHistory, companion: Companion) -> tuple[Outcome, str]:
    """Outcome of a history that has come to its end, and what it does not say by itself."""
    if history.error_estimate > SENSITIVE_ERROR:
        area = march.joint.contact.area
        volume, other = (1e9 * float(depth @ area) for depth in (history.wear_depth[-1], companion.kept[-1]))
        return Outcome.SENSITIVE, (
            f"worn volume {volume:.3g} mm3, but {other:.3g} mm3 with steps twice as long from the start state of a "
            f"coarser sweep: known to {100.0 * history.error_estimate:.2g} % only"
        )
    if march.inaccurate_from < float("inf"):
        what = "wear rate" if march.worst.wear_rate >= march.worst.response else "response"
        return Outcome.INACCURATE, (
            f"from cycle {march.inaccurate_from:,.0f} on the {what} is known to "
            f"{100.0 * march.worst.largest:.2g} % only".replace(",", " ")
        )
    return Outcome.CONVERGED, ""


@dataclass
class FixedSteps:
    """Explicit or implicit Euler steps of a given length, or of one by the largest-depth rule.

    error: None; that of an Euler step shows in the wear rates at its ends.
    """

    trajectory: Trajectory
    end: float
    step: float
    largest_depth: float | None
    error: None = None

    def advance(self) -> tuple[bool, float]:
        """One step: whether the branch goes on, and the length of the step in cycles."""
        before = self.trajectory.cycle
        planned = self.trajectory.planned_step(self.step, self.largest_depth)
        # a remainder below round-off of the count is no step of its own
        reach = self.end if before + planned >= self.end * (1.0 - 1e-12) else before + planned
        return self.trajectory.advance(reach), reach - before

    def carried(self) -> dict[str, Any]:
        """Nothing."""
        return {}

    def take_up(self, carried: dict[str, Any]) -> None:
        """Nothing to go on from."""

    def restart(self) -> None:
        """Euler steps know nothing of those before."""
