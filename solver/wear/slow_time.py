"""The integration over the slow time, of cycles or of missions, step by step; saved from time to time, and resumed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

from solver.clock import computing_time
from solver.harmonic_balance.state import Failure
from solver.newton.run import Budget, guarded
from solver.outcome import Outcome
from solver.packing import Packed, pack, packable, unpack
from solver.settings import Resolution
from solver.wear.course import Course

AS_ASKED, UNFINISHED = Failure(Outcome.CONVERGED), Failure(Outcome.NOT_COMPUTED)
"""The regular end of a history, and that of one that goes on."""

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
class Solution:
    """What an integration has found at its end, or when it is saved, with Newton iterations and CPU seconds.

    state: the last one; None where there is no first state. failure: reason of the end.
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

    own: Solution
    adaptive: Solution
    reference: Solution | None = None

    @property
    def all(self) -> tuple[Solution, ...]:
        """Each of them once."""
        adaptive = () if self.adaptive is self.own else (self.adaptive,)
        return (self.own, *adaptive, *(() if self.reference is None else (self.reference,)))

    @property
    def failure(self) -> Failure:
        """The end of the history."""
        return next((each.failure for each in self.all if each.failure.outcome in ENDS_ALL), self.own.failure)


class Integrator:
    """Integrates histories that belong together, each once.

    time_limit: CPU seconds of each. keep: called from time to time with the packed progress. resume: such progress.
    """

    def __init__(
        self, time_limit: float, keep: Callable[[Packed], None] | None = None, resume: Packed | None = None
    ) -> None:
        self._time_limit, self._keep = time_limit, keep
        self._known: dict[str, Solution] = {} if resume is None else unpack(resume)

    def integrate(self, name: str, problem: SlowProblem, course: Course, spent: float = 0.0) -> Solution:
        """Integrate from the first or the saved state to the end. name: tells the histories apart.

        course: before the first step. spent: CPU seconds of the time limit so far.
        """
        budget, state, began, known = problem.budget, None, computing_time(), self._known.get(name)
        if known is not None and known.failure != UNFINISHED:
            return known
        if known is not None:
            state, course, budget.iterations, began = known.state, known.course, known.iterations, began - known.seconds
        budget.deadline, saved_at = began + self._time_limit - spent, budget.iterations
        while True:
            after = guarded(partial(problem.advance, state, course))
            if isinstance(after, Failure):
                self._known[name] = Solution(state, after, course, budget.iterations, computing_time() - began)
                return self._known[name]
            state, course = after
            if budget.iterations >= saved_at + problem.iterations_per_save:
                # done in every history, so that an interrupted one gives equal numbers
                state, saved_at = problem.saved(state), budget.iterations
                self._known[name] = Solution(state, UNFINISHED, course, saved_at, computing_time() - began)
                if self._keep is not None:
                    # what its time limit has ended is not complete
                    kept = {key: each for key, each in self._known.items() if each.failure.outcome not in ENDS_ALL}
                    self._keep(pack(kept))
