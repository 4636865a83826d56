"""The loop over the slow time: step, check, store, save, until the history ends.

A history ends at a last count, at a target, where nothing wears any more, or where wear goes on without end. In a
steady state every pair that slips carries no force. The slowest pair determines how fast a history approaches this
state. So the history ends where the wear rate of every pair is below a fraction of the largest rate of this pair. A
joint that slips everywhere under a load that nothing else carries has no steady state: its wear rate is constant.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from solver.continuation.natural import NEAR_ITERATIONS
from solver.harmonic_balance.state import Failure
from solver.newton.run import OutOfTimeError
from solver.outcome import Outcome, describe_error, in_digits
from solver.packing import in_rows, packable
from solver.settings import ROUND_OFF
from solver.wear.check import Checked
from solver.wear.control import WearLine
from solver.wear.course import Course
from solver.wear.state import WearState
from solver.wear.wearing_joint import Following, WearingJoint

T = TypeVar("T")

HISTORY_ITERATIONS = 3000
"""Most Newton iterations of a history, in addition to `near_iterations` for each step, and of its reference solution,
in addition to those of the history. A travelling wave at its resonance: 1400 in a corner within 500 cycles."""

ITERATIONS_PER_SAVE = 100
"""Newton iterations after which a history is saved and its factorisation dropped, so that a resumed history is equal to
the last bit: 1 s of 48 pairs, 17 s of 336. The cost of one more factorisation is negligible."""

STEPS_TO_THE_END, LONGEST_HISTORY = 20_000, 1e25
"""Most steps and most cycles of a history without a steady state; a joint takes 2 to 10 steps a pair."""

ACTED_BACK = 100.0
"""Change of the normal force by the depth of one pair alone, all other pairs held, over the normal force of this pair.
A wear rate counts as steady above only: less wear may not have acted back on the joint yet. Long waves of n pairs are
about n times as soft."""

AS_ASKED = Failure(Outcome.CONVERGED)
"""The regular end of a history."""


@packable
@dataclass(frozen=True)
class Ended:
    """A finished integration.

    state: last state; None where there is no first state.
    failure: reason of the end; the outcome CONVERGED for a regular end.
    course: all steps.
    iterations: Newton iterations spent.
    """

    state: WearState | None
    failure: Failure
    course: Course
    iterations: int


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


@dataclass(frozen=True)
class Integration:
    """An integration over the slow time.

    line: the joint and its steps.
    check: gives a state with its report, or the reason of its rejection.
    save: called from time to time with the state and the course, from which the integration goes on.
    most_iterations: most Newton iterations, in addition to `near_iterations` for each step.
    share: `settings.ToTheEnd.final_share` of a history to the end of wear.
    """

    line: WearLine
    check: Callable[[WearingJoint, WearState], Checked | Failure]
    save: Callable[[WearState, Course], None]
    most_iterations: float
    share: float = 0.0

    def begin(self, first: Callable[[], WearState], course: Course) -> Ended:
        """Integrate from the first state to the end; course: without steps."""
        begun = guarded(lambda: self._first(first(), course))
        if isinstance(begun, Failure):
            return Ended(None, begun, course, self.line.work.run.budget.iterations)
        return self.go_on(*begun)

    def go_on(self, state: WearState, course: Course) -> Ended:
        """Integrate from a state behind the steps of a course to the end."""
        work, budget = self.line.work, self.line.work.run.budget
        saved = budget.iterations
        while (ended := self._ended(state, course)) is None:
            if budget.iterations > self.most_iterations + NEAR_ITERATIONS * len(course.ends):
                ended = Failure(Outcome.MARCH_FAILED)
                break
            after = guarded(partial(self._step, state, course))
            if isinstance(after, Failure):
                ended = after
                break
            state, course = after
            if budget.iterations >= saved + ITERATIONS_PER_SAVE:
                # done in every history, so that an interrupted one gives equal numbers
                state, saved = in_rows(state), budget.iterations
                work.drop_factor()
                self.save(state, course)
        if ended.outcome is Outcome.CONVERGED and state.cycle < course.end < math.inf and not state.wears:
            # nothing wears any more: the state holds for all later counts
            course = course.after(course.end, course.nodes[-1].report, course.nodes[-1].rate, 0.0)
        return Ended(state, ended, course, budget.iterations)

    def _first(self, state: WearState, course: Course) -> tuple[WearState, Course] | Failure:
        found = self.line.work.at_followed(state)
        stored = found if isinstance(found, Failure) else self._stored(found, course, 0.0)
        return stored if isinstance(stored, Failure) else (self.line.begin(stored[0]), stored[1])

    def _step(self, state: WearState, course: Course) -> tuple[WearState, Course] | Failure:
        step, where = self.line.step(state), self.line.work.where
        if isinstance(step, Failure):
            return step
        failure = where.out_of_range(step.state) if isinstance(where, Following) else None
        return failure or self._stored(step.state, course, step.error)

    def _stored(self, state: WearState, course: Course, error: float) -> tuple[WearState, Course] | Failure:
        """Check a state and store it; error: local error of its step, m3."""
        work, checked = self.line.work, self.check(self.line.work, state)
        if isinstance(checked, Failure):
            return checked
        state, report = checked
        return state, course.after(state.cycle, report, work.rate(state.point.evaluation), error)

    def _ended(self, state: WearState, course: Course) -> Failure | None:
        """Why the history ends at a state: AS_ASKED, or NO_FINAL_STATE where wear has no end; None to go on."""
        if course.reached_target or not state.wears or state.cycle >= course.end * (1.0 - 1e-12):
            return AS_ASKED
        if course.end < math.inf:
            return None
        if is_over(state, self.share):
            return AS_ASKED
        rate, n_steps = float(state.rates[-1]), len(course.ends) - 1
        if is_steady(self.line.work, state, course):
            steady = f"from cycle {in_digits(state.cycle, 4)} on they wear at a steady rate of {rate:.6g} m3 a cycle"
            return Failure(Outcome.NO_FINAL_STATE, f"all pairs slip, and {steady}")
        if n_steps >= STEPS_TO_THE_END or state.cycle > LONGEST_HISTORY:
            still = f"the joint still wears at {rate:.6g} m3 a cycle"
            return Failure(
                Outcome.NO_FINAL_STATE, f"after {n_steps} steps, at cycle {in_digits(state.cycle, 4)}, {still}"
            )
        return None


def is_over(state: WearState, share: float) -> bool:
    """Whether the rate of every pair is below the fraction `share` of its largest rate."""
    rates, largest = state.rates[:-1], state.largest_rates[:-1]
    floor = share * float(largest.max(initial=0.0))
    return bool((rates <= share * np.maximum(largest, floor)).all())


def is_steady(work: WearingJoint, state: WearState, course: Course) -> bool:
    """Whether wear goes on without end.

    Every pair that carries load slips, and the wear rate is constant although the wear is deep enough to act back.
    """
    joint, at = work.at(state), state.point.evaluation
    normal = at.force_h[:, 0, 0]
    pressed = normal > ROUND_OFF * float(normal.max(initial=0.0))
    if not pressed.any() or not (at.slip_work[pressed] > 0.0).all():
        return False
    volumes, rates = course.volumes, np.array([node.rate @ work.area for node in course.nodes])
    # over the last nine tenths of the worn volume, to the accuracy of a rate
    first = max(int(np.searchsorted(volumes, 0.1 * volumes[-1], "right")) - 1, 0)
    varies = np.abs(rates[first:] - rates[-1]) > work.case.settings.rtol * rates[-1]
    if volumes[first] > 0.1 * volumes[-1] or varies.any():
        return False
    rows = np.flatnonzero(joint.component_index % 3 == 0)
    rows = rows[pressed[joint.component_index[rows] // 3]]
    pair = joint.component_index[rows] // 3
    moved = joint.structure.static_stiffness[rows, rows] * at.wear_depth[pair]
    return bool((moved >= ACTED_BACK * normal[pair]).all())
