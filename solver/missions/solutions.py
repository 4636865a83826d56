"""The two integrations over missions: the history itself and its reference solution, step by step."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from solver.accuracy.reference import RTOL_RATIO
from solver.clock import computing_time
from solver.harmonic_balance.state import Failure
from solver.march.steps import Lengths, take_step
from solver.missions.block_run import BlockCase, BlockRun, run_block
from solver.missions.blocks import Mission, Passage
from solver.missions.course import MissionCourse, MissionNode, growth_within
from solver.missions.passage import run_passage
from solver.missions.step import Step, attempt_step
from solver.model import FloatArray
from solver.outcome import Outcome
from solver.packing import Packed, pack, packable
from solver.results.history import StartState
from solver.wear.control import allowed_error
from solver.wear.integrate import guarded
from solver.wear.interpolation import fraction_where

STEP_ERROR = 0.5
"""Allowed error of a step over its wear, or over its wear at the mean rate so far if larger, as a fraction of rtol.
Missions of a slider: estimated over true error at least 1.7. With 0.25 two cases of the tests compute 21.5 and 33 of
2000 missions, with 0.5 fewer than 20 and 30."""


@packable
@dataclass(frozen=True)
class MissionProgress:
    """The progress over missions, from which it goes on.

    course: the present integration so far.
    length: missions of its next step.
    fine: the finished history, while its reference solution is integrated; else None.
    runs: blocks computed for the next step, in order.
    spent: CPU seconds so far.
    """

    course: MissionCourse
    length: float
    fine: MissionCourse | None
    runs: tuple[BlockRun, ...]
    spent: float


@dataclass
class MissionSolutions:
    """Integrates a mission history and its reference solution, one after the other.

    mission: blocks and settings.
    keep: called after each block with the packed progress; None for no calls.
    saved: progress to go on from; None to begin.
    """

    mission: Mission
    keep: Callable[[Packed], None] | None = None
    saved: MissionProgress | None = None
    began: float = field(init=False, default_factory=computing_time)
    progress: MissionProgress = field(init=False)

    def __post_init__(self) -> None:
        self.progress = self.saved or self._begun(None)
        self.began -= self.progress.spent

    @property
    def spent(self) -> float:
        """CPU seconds so far, those before an interruption included."""
        return computing_time() - self.began

    def history(self) -> MissionCourse:
        """Integrate the history."""
        return self.progress.fine or self._integrate(self.mission.missions[-1])

    def reference(self, fine: MissionCourse) -> MissionCourse:
        """Integrate the reference solution of a history, with steps of its own."""
        if self.progress.fine is None:
            self.progress = self._begun(fine)
        return self._integrate(fine.nodes[-1].mission)

    def _begun(self, fine: MissionCourse | None) -> MissionProgress:
        return MissionProgress(MissionCourse.unworn(len(self.mission.blocks), self.mission.area.size), 1, fine, (), 0.0)

    def _integrate(self, last: int) -> MissionCourse:
        """Take steps up to a number of missions."""
        mission = self.mission
        while (course := self.progress.course).failure is None:
            computed, fine = course.nodes[-1].mission, self.progress.fine
            if computed >= last or (fine is None and missions_to_target(mission, course) <= computed):
                self.progress = replace(self.progress, course=replace(course, failure=Failure(Outcome.CONVERGED)))
                break
            longest = min(last - computed, mission.largest_step or last, last if len(course.nodes) > 2 else 1)
            line = _Step(self)
            taken = take_step(line, course.nodes, min(self.progress.length, longest), Lengths(2, shortest=1, rescue=1))
            if isinstance(taken, Failure):
                course, length = replace(course, failure=taken, iterations=course.iterations + line.iterations), 1.0
            else:
                course, length = course.longer(taken[0].node, line.iterations), taken[1]
            self.progress = replace(self.progress, course=course, length=length, runs=())
        return self.progress.course

    def add(self, run: BlockRun) -> None:
        """Add a block that was computed to the progress."""
        self.progress = replace(self.progress, runs=(*self.progress.runs, run), spent=self.spent)
        if self.keep is not None:
            self.keep(pack(self.progress))


class _Step:
    """One step over missions: the line of `take_step`, from the nodes so far.

    iterations: Newton iterations of all blocks. begun: for each block what it takes over from the last one computed.
    """

    def __init__(self, solutions: MissionSolutions) -> None:
        self.solutions, self.mission, self.iterations = solutions, solutions.mission, 0
        progress = solutions.progress
        self.fine, self.known = progress.fine, iter(progress.runs)
        runs = progress.course.nodes[-1].runs or (self.fine.nodes[1].runs if self.fine else ())
        self.begun = [run.begun for run in runs] or [None] * len(self.mission.blocks)
        self.failure = Failure(Outcome.MARCH_FAILED)

    def attempt(self, nodes: tuple[MissionNode, ...], length: float) -> Step | None:
        """As in Line. The last mission of the step is computed."""
        missions, rtol = int(length), self.mission.settings.rtol * (1.0 if self.fine is None else RTOL_RATIO)
        run = partial(self._run, nodes[-1].mission + missions)
        found = attempt_step(self.mission, nodes, missions, run, partial(allowed_error, STEP_ERROR * rtol))
        if isinstance(found, Failure):
            self.failure = found
            return None
        return found

    def judge(self, _: tuple[MissionNode, ...], end: Step, __: float) -> float:
        """As in Line."""
        return end.ratio

    def rescue(self, _: tuple[MissionNode, ...], __: float) -> Failure:
        """As in Line: a mission that fails by itself ends the history."""
        return self.failure

    def _run(
        self, number: int, place: int, depth: FloatArray, carried: StartState | None, with_slope: bool
    ) -> BlockRun:
        """A block of the mission of a number, from the progress if it was computed before an interruption."""
        found = next(self.known, None)
        if found is None:
            found = self._compute(number, place, depth, carried, with_slope)
            # with more time the history goes on from the block before
            if found.failure.outcome is not Outcome.TIME_LIMIT:
                self.solutions.add(found)
        self.iterations += found.iterations
        self.begun[place] = found.begun or self.begun[place]
        return found

    def _compute(
        self, number: int, place: int, depth: FloatArray, carried: StartState | None, with_slope: bool
    ) -> BlockRun:
        settings, fine = self.mission.settings, self.fine
        left = replace(settings, time_limit=settings.time_limit - self.solutions.spent)
        # as in a wear history: stability is tested at the begin and the end
        every = fine is None and number in (1, self.mission.missions[-1])
        case = BlockCase(self.mission, place, depth, carried, left, with_slope, self.begun[place], every)
        like = None if fine is None else fine.nodes[int(np.searchsorted(fine.ends, number))].runs[place].like
        through = run_passage if isinstance(case.block.frequency, Passage) else run_block
        computed = guarded(lambda: through(case, like))
        return case.not_computed(computed) if isinstance(computed, Failure) else computed


def missions_to_target(mission: Mission, course: MissionCourse) -> float:
    """Number of missions at which the target is reached, inf if never."""
    target = mission.until
    if target is None:
        return math.inf
    for before, end in zip(course.nodes, course.nodes[1:], strict=False):
        if worn_by(mission, end.growth) >= target.value:
            length = end.mission - before.mission

            def worn_at(fraction: float, before: MissionNode = before, end: MissionNode = end) -> float:
                at = before.mission + fraction * (end.mission - before.mission)
                return worn_by(mission, growth_within(before, end, at))

            return before.mission + length * fraction_where(target.value, worn_at)
    return math.inf


def worn_by(mission: Mission, growth: FloatArray) -> float:
    """Wear to compare with the target, from the depths worn by each block: volume, m3, or largest depth, m."""
    depth = growth.sum(axis=0)
    assert mission.until is not None
    if mission.until.quantity == "wear_depth":
        return float(depth.max(initial=0.0))
    return float(depth @ mission.area)
