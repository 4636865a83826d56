"""The two integrations over missions: the history itself and its reference solution, step by step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from solver.accuracy.reference import RTOL_RATIO
from solver.clock import computing_time
from solver.harmonic_balance.state import Failure
from solver.march.steps import Lengths, take_step
from solver.missions.block_run import Begun, BlockCase, BlockRun, run_block
from solver.missions.blocks import Mission, Passage
from solver.missions.course import MissionCourse, MissionNode
from solver.missions.passage import run_passage
from solver.missions.step import Step, attempt_step
from solver.model import FloatArray
from solver.outcome import Outcome
from solver.packing import Packed, pack, packable
from solver.wear.integrate import guarded

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
    spent: CPU seconds so far.
    """

    course: MissionCourse
    length: float = 1.0
    fine: MissionCourse | None = None
    spent: float = 0.0


class Missions:
    """Integrates a mission history and then its reference solution; the line of `take_step` over its nodes.

    keep: called after each step with the packed progress. saved: progress to go on from; None to begin.
    """

    def __init__(
        self, mission: Mission, keep: Callable[[Packed], None] | None = None, saved: MissionProgress | None = None
    ) -> None:
        self.mission, self.keep = mission, keep
        self.progress = saved or MissionProgress(MissionCourse.unworn(mission))
        self._began = computing_time() - self.progress.spent
        # of the present step: how each block began last, Newton iterations, why it was not found
        self._begun: list[Begun | None] = []
        self._iterations, self._failure = 0, Failure(Outcome.MARCH_FAILED)

    @property
    def spent(self) -> float:
        """CPU seconds so far, those before an interruption included."""
        return computing_time() - self._began

    def history(self) -> MissionCourse:
        """Integrate the history."""
        return self.progress.fine or self._integrate(self.mission.missions[-1])

    def reference(self, fine: MissionCourse) -> MissionCourse:
        """Integrate the reference solution of a history, with steps of its own."""
        if self.progress.fine is None:
            self.progress = MissionProgress(MissionCourse.unworn(self.mission), fine=fine)
        return self._integrate(fine.nodes[-1].mission)

    def _integrate(self, last: int) -> MissionCourse:
        """Take steps up to a number of missions."""
        mission, fine, lengths = self.mission, self.progress.fine, Lengths(2, shortest=1, rescue=1)
        while True:
            course, now = self.progress.course, self.progress.course.nodes[-1]
            if now.mission >= last or (fine is None and course.missions_to_target(mission) <= now.mission):
                return replace(course, failure=Failure(Outcome.CONVERGED))
            longest = min(last - now.mission, mission.largest_step or last, last if len(course.nodes) > 2 else 1)
            begins = now if now.mission or fine is None else fine.nodes[1]
            self._begun, self._iterations = [run.begun for run in begins.runs], 0
            taken = take_step(self, course.nodes, min(self.progress.length, longest), lengths)
            if isinstance(taken, Failure):
                return replace(course, failure=taken, iterations=course.iterations + self._iterations)
            course = course.longer(taken[0].node, self._iterations)
            self.progress = replace(self.progress, course=course, length=taken[1], spent=self.spent)
            if self.keep is not None:
                self.keep(pack(self.progress))

    def attempt(self, nodes: tuple[MissionNode, ...], length: float) -> Step | None:
        """As in Line. The last mission of the step is computed."""
        missions, rtol = int(length), self.mission.settings.rtol * (1.0 if self.progress.fine is None else RTOL_RATIO)
        run = partial(self._mission, nodes[-1], nodes[-1].mission + missions)
        found = attempt_step(nodes, missions, self.mission.area, run, STEP_ERROR * rtol)
        if isinstance(found, Step):
            return found
        self._failure = found
        return None

    def judge(self, _: tuple[MissionNode, ...], end: Step, __: float) -> float:
        """As in Line."""
        return end.ratio

    def rescue(self, _: tuple[MissionNode, ...], __: float) -> Failure:
        """As in Line: a mission that fails by itself ends the history."""
        return self._failure

    def _mission(
        self, now: MissionNode, number: int, depth: FloatArray, with_slopes: bool
    ) -> tuple[BlockRun, ...] | Failure:
        """Compute the blocks of the mission of a number behind a node. depth (n_contact,): m, before the mission."""
        mission, fine, carried = self.mission, self.progress.fine, now.runs[-1].last
        likes = () if fine is None else fine.nodes[int(np.searchsorted(fine.ends, number))].runs
        # as in a wear history: stability is tested at the begin and the end
        every = fine is None and number in (1, mission.missions[-1])
        runs: list[BlockRun] = []
        deadline = self._began + mission.settings.time_limit
        for place, block in enumerate(mission.blocks):
            like, begun = likes[place].like if likes else None, self._begun[place]
            case = BlockCase(mission, place, depth, deadline, carried, begun, like, with_slopes, every)
            through = run_passage if isinstance(block.frequency, Passage) else run_block
            found = guarded(partial(through, case))
            if isinstance(found, Failure):
                said = f"in mission {number}, {mission.called(place)}"
                return Failure(found.outcome, ": ".join(filter(None, (said, found.message))))
            runs.append(found)
            self._begun[place], self._iterations = found.begun or begun, self._iterations + found.iterations
            depth, carried = depth + found.growth, found.last
        return tuple(runs)
