"""The integration over the slow time, of cycles or of missions, step by step; saved from time to time, and resumed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol, TypeVar

import numpy as np

from solver.clock import computing_time
from solver.harmonic_balance.state import Failure
from solver.newton.run import Budget, OutOfTimeError
from solver.outcome import Outcome, describe_error
from solver.packing import Packed, pack, packable, unpack
from solver.settings import Resolution
from solver.wear.course import Course

T = TypeVar("T")

AS_ASKED = Failure(Outcome.CONVERGED)
"""The regular end of a history."""

ENDS_ALL = (Outcome.TIME_LIMIT, Outcome.EXCEPTION)
"""Ends of an integration that end the whole history, and after which no other solution is integrated."""

RTOL_RATIO = 2.0
"""Ratio of the step tolerances of reference solution and adaptive history: BDF2 steps are then a quarter longer. With 4
the steps of a reference solution are too long for pairs that stick again: dovetail, 16 pairs, 13 harmonics, 212.75 Hz:
1.208 mm3 for 1.540, an error of 32 % where 0.4 % is true."""


class SlowProblem(Protocol):
    """What is integrated. The next step depends on the state alone; a state is frozen and packable."""

    @property
    def budget(self) -> Budget:
        """Newton iterations so far, and the deadline."""

    @property
    def iterations_per_save(self) -> int:
        """Newton iterations after which the progress is saved."""

    def advance(self, state: Any, course: Course, /) -> tuple[Any, Course] | Failure:
        """State and course after the next step, or the first ones where the state is None; or why the history ends."""

    def saved(self, state: Any, /) -> Any:
        """The state as it is read from a saved progress; what is kept from step to step beside the state is dropped."""


@packable
@dataclass(frozen=True)
class Guide:
    """What a reference solution takes from its history.

    resolutions: cycle count from which on a resolution holds, and this resolution; of a passage the frequency, Hz.
    first_length: of its first adaptive step, cycles.
    """

    resolutions: tuple[tuple[float, Resolution], ...]
    first_length: float


@packable
@dataclass(frozen=True)
class Ended:
    """A finished integration, with Newton iterations and CPU seconds.

    state: the last one; None where there is no first state. failure: reason of the end; CONVERGED for a regular end.
    """

    state: Any
    failure: Failure
    course: Course
    iterations: int = 0
    seconds: float = 0.0


@dataclass(frozen=True)
class Solutions:
    """A history, the adaptive history with which one with given steps is compared, and its reference solution.

    adaptive: the history itself where its steps are adaptive. reference: None where there is none.
    """

    own: Ended
    adaptive: Ended
    reference: Ended | None = None

    @property
    def all(self) -> tuple[Ended, ...]:
        """Each of them once."""
        adaptive = () if self.adaptive is self.own else (self.adaptive,)
        return (self.own, *adaptive, *(() if self.reference is None else (self.reference,)))

    @property
    def failure(self) -> Failure:
        """The end of the history."""
        return next((each.failure for each in self.all if each.failure.outcome in ENDS_ALL), self.own.failure)


@packable
@dataclass(frozen=True)
class Progress:
    """How far integrations are: the complete ones by name, and name, state, course and effort of the present one."""

    done: dict[str, Ended] = field(default_factory=dict)
    name: str = ""
    state: Any = None
    course: Course | None = None
    iterations: int = 0
    seconds: float = 0.0


class Integrator:
    """Integrates histories that belong together, each once.

    time_limit: CPU seconds of each. keep: called from time to time with the packed progress. resume: such progress.
    """

    def __init__(
        self, time_limit: float, keep: Callable[[Packed], None] | None = None, resume: Packed | None = None
    ) -> None:
        self._time_limit, self._keep = time_limit, keep
        self._resumed: Progress = Progress() if resume is None else unpack(resume)
        self._done: dict[str, Ended] = dict(self._resumed.done)

    def integrate(self, name: str, problem: SlowProblem, course: Course, spent: float = 0.0) -> Ended:
        """Integrate from the first or the saved state to the end. name: tells the histories apart.

        course: before the first step. spent: CPU seconds of the time limit so far.
        """
        if name in self._done:
            return self._done[name]
        budget, saved, state, began = problem.budget, self._resumed, None, computing_time()
        if saved.name == name and saved.course is not None:
            state, course, budget.iterations = saved.state, saved.course, saved.iterations
            began -= saved.seconds
        budget.deadline, saved_at = began + self._time_limit - spent, budget.iterations
        while True:
            after = guarded(partial(problem.advance, state, course))
            if isinstance(after, Failure):
                ended = Ended(state, after, course, budget.iterations, computing_time() - began)
                self._done[name] = ended
                return ended
            state, course = after
            if budget.iterations >= saved_at + problem.iterations_per_save:
                # done in every history, so that an interrupted one gives equal numbers
                state, saved_at = problem.saved(state), budget.iterations
                if self._keep is not None:
                    # what its time limit has ended is not complete
                    done = {key: each for key, each in self._done.items() if each.failure.outcome not in ENDS_ALL}
                    self._keep(pack(Progress(done, name, state, course, saved_at, computing_time() - began)))


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
