"""Wear on the slow time scale, from a start state to the last cycle count, and how it ended."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from solver.adaptive import AdaptiveSteps
from solver.explicit_limit import wear_oscillates
from solver.history import StartState, WearHistory
from solver.joint import build_case
from solver.model import FloatArray, ReducedModel
from solver.outcome import Outcome
from solver.record import Recorder
from solver.settings import SolverSettings
from solver.trajectory import Scheme, Trajectory

MOST_ITERATIONS = 3000  # of Newton's method, and some more a step: a march that takes more leads nowhere
STEP_ITERATIONS = 10


def march_wear(
    model: ReducedModel,
    friction_coefficient: float,
    start: StartState,
    wear_coefficient: float,
    step: float,
    scheme: Scheme,
    cycles: FloatArray,
    settings: SolverSettings,
    largest_depth: float | None = None,
    loops: tuple[int, ...] = (),
) -> WearHistory:
    """Wear history of one point of a study.

    wear_coefficient: 1/Pa. step: h, cycles; the adaptive scheme chooses its own steps. cycles (n_output,): ascending
    counts to report, the first 0; between two steps they are interpolated, and the last step is shortened to end on the
    last of them. largest_depth: m; where given, the explicit scheme takes its step from Eq. (22) instead of `step`.
    loops: pairs whose fretting loops are kept at every count.
    """
    started = time.thread_time()
    recorder = Recorder(model, cycles, start.newton_iterations, start.run_time, scheme == "adaptive", len(loops))
    if start.state is None:
        failed = recorder.failed(start.outcome, 0.0)
        return replace(failed, branch=start.branch, fold_frequency=start.fold_frequency)
    case = build_case(model, friction_coefficient, start.penalty_omega, settings, start.resolution)
    march = Trajectory(case, start, wear_coefficient, scheme, loops)
    try:
        outcome = march.begin()
        recorder.add(0.0, march.report(), wear_coefficient)
        end, n_steps = float(cycles[-1]), 0
        steps: AdaptiveSteps | FixedSteps = (
            AdaptiveSteps(march, settings.rtol) if scheme == "adaptive" else FixedSteps(march, end, step, largest_depth)
        )
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
                    recorder.add(march.cycle, march.report(), wear_coefficient, steps.error)
                if outcome is Outcome.CONVERGED and not march.jump(length):
                    outcome = march.failure
                if outcome is not Outcome.CONVERGED:
                    break
                steps.restart()
            outcome = march.check()
            recorder.add(march.cycle, march.report(), wear_coefficient, steps.error)
        if outcome is Outcome.CONVERGED and not march.stays():
            outcome = Outcome.UNSTABLE
    except np.linalg.LinAlgError:
        outcome = Outcome.SINGULAR
    spent = time.thread_time() - started
    # adaptive steps go beyond the end
    jump_cycle = march.jump_cycle if march.jump_cycle <= cycles[-1] else float("nan")
    history = recorder.finish(outcome, jump_cycle, march.effort.iterations, spent)
    return replace(
        history,
        branch=start.branch,
        fold_frequency=start.fold_frequency,
        step_limit=march.step_limit if march.step_limit > 0.0 else float("inf"),
        # what alternates with the other schemes are small corners of the wear rate, not the steps
        oscillates=scheme == "explicit" and (wear_oscillates(march.rates) or march.pairs_oscillate()),
    )


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

    def restart(self) -> None:
        """Euler steps know nothing of those before."""
