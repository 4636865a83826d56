"""The loop over the slow time: step, jump where the branch ends, check, output, save."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol, TypeVar

import numpy as np

from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.state import Failure
from solver.newton.run import OutOfTimeError
from solver.outcome import Outcome, describe_error
from solver.packing import in_rows, packable
from solver.wear.check import Checked
from solver.wear.control import Control
from solver.wear.followed import lost_resonance, out_of_range
from solver.wear.jump import jump
from solver.wear.options import WEAR
from solver.wear.output import DenseOutput
from solver.wear.state import WearState
from solver.wear.wearing_joint import WearingJoint

T = TypeVar("T")

Check = Callable[[WearingJoint, WearState], Checked | Failure]
"""Function that checks a state and reports it, or gives the reason of a rejection."""


def guarded(compute: Callable[[], T]) -> T | Failure:
    """Result of a computation, or its error as a failure."""
    try:
        return compute()
    except np.linalg.LinAlgError:
        return Failure(Outcome.SINGULAR)
    except OutOfTimeError:
        return Failure(Outcome.TIME_LIMIT)
    except Exception as error:
        # an error spoils one point only: the study goes on
        return Failure(Outcome.EXCEPTION, describe_error(error))


class Stop(Protocol):
    """Decides after each state whether the integration ends."""

    def __call__(self, work: WearingJoint, state: WearState, output: DenseOutput) -> Failure | None:
        """None to go on, else the end; a regular end has the outcome CONVERGED."""


@packable
@dataclass(frozen=True)
class Progress:
    """Progress of an integration, from which the integration goes on. n_steps: steps so far."""

    state: WearState
    n_steps: int


@dataclass(frozen=True)
class Integration:
    """An integration over the slow time, and its parts.

    control: plans the steps.
    check: checks each state.
    stop: ends the integration.
    output: stores the states.
    save: called from time to time with the progress.
    most_iterations: most Newton iterations, in addition to `near_iterations` for each step.
    bounded: whether a jump that moves many times the normal forces is refused.
    """

    control: Control
    check: Check
    stop: Stop
    output: DenseOutput
    save: Callable[[Progress], None]
    most_iterations: float
    bounded: bool = True

    def begin(self, work: WearingJoint, state: WearState) -> Progress | Failure:
        """Check and store the first state."""
        state_there = work.at_followed(state)
        checked = state_there if isinstance(state_there, Failure) else self.check(work, state_there)
        if isinstance(checked, Failure):
            return checked
        self.output.add(state.cycle, checked.report, work.rate(checked.state.point.evaluation), 0.0)
        return Progress(self.control.begin(work, checked.state), 0)

    def run(self, work: WearingJoint, progress: Progress) -> tuple[WearState, Failure]:
        """Integrate to the end: last state and reason of the end."""
        state, n_steps, saved = progress.state, progress.n_steps, work.run.budget.iterations
        while (ended := self.stop(work, state, self.output)) is None:
            n_steps += 1
            if work.run.budget.iterations > self.most_iterations + CONTINUATION.near_iterations * n_steps:
                return state, Failure(Outcome.MARCH_FAILED)
            after = guarded(partial(self._one, work, state))
            if isinstance(after, Failure):
                return state, after
            state = after
            if work.run.budget.iterations >= saved + WEAR.iterations_per_save:
                # done in every history, so that an interrupted one gives equal numbers
                state, saved = in_rows(state), work.run.budget.iterations
                work.drop_factor()
                self.save(Progress(state, n_steps))
        return state, ended

    def _one(self, work: WearingJoint, state: WearState) -> WearState | Failure:
        """One step, and the jump where the branch ends within the step."""
        step = self.control.step(work, state)
        if isinstance(step, Failure):
            return step
        if step.arrived:
            return self._stored(work, step.state, step.volume_error(work.area))
        if step.state.cycle > state.cycle:
            # the last state before the end of the branch counts, too
            reached = self._stored(work, step.state, step.volume_error(work.area))
            if isinstance(reached, Failure):
                return reached
            step = replace(step, state=reached)
        behind = jump(work, step, bounded=self.bounded)
        if isinstance(behind, Failure):
            return behind if work.follow is None else lost_resonance(work.follow, step.state)
        behind = work.at_followed(behind)
        return behind if isinstance(behind, Failure) else self._stored(work, behind, 0.0)

    def _stored(self, work: WearingJoint, state: WearState, error: float) -> WearState | Failure:
        """Check a state and store it in the output."""
        if (left := out_of_range(work.follow, state)) is not None:
            return left
        checked = self.check(work, state)
        if isinstance(checked, Failure):
            return checked
        state = checked.state
        self.output.add(state.cycle, checked.report, work.rate(state.point.evaluation), error)
        return state
