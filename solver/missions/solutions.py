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
from solver.march.steps import SMALLEST_STEP_RATIO
from solver.missions.block_run import BlockCase, BlockRun, not_computed, run_block
from solver.missions.blocks import Mission, Passage
from solver.missions.course import MissionCourse, MissionNode, growth_within
from solver.missions.options import MISSIONS
from solver.missions.passage import run_passage
from solver.missions.step import RunBlock, Step, take_step
from solver.model import FloatArray
from solver.outcome import Outcome
from solver.packing import Packed, pack, packable
from solver.results.history import StartState
from solver.wear.control import SECOND_ORDER, allowed_error
from solver.wear.integrate import guarded
from solver.wear.interpolation import fraction_where


@packable
@dataclass(frozen=True)
class MissionProgress:
    """The progress over missions, from which it goes on.

    course: the present integration so far.
    length: missions of its next step.
    fine: the finished history, while its reference solution is integrated; else None.
    runs: blocks computed since the last step, in order.
    spent: CPU seconds so far.
    """

    course: MissionCourse
    length: int
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
        if self.progress.fine is not None:
            return self.progress.fine
        return self._integrate(self.mission.settings.rtol, self.mission.missions[-1], None)

    def reference(self, fine: MissionCourse) -> MissionCourse:
        """Integrate the reference solution of a history, with steps of its own."""
        if self.progress.fine is None:
            self.progress = self._begun(fine)
        return self._integrate(RTOL_RATIO * self.mission.settings.rtol, fine.nodes[-1].mission, fine)

    def _begun(self, fine: MissionCourse | None) -> MissionProgress:
        course = MissionCourse.begun(len(self.mission.blocks), self.mission.area.size)
        if fine is not None:
            (unworn,) = course.nodes
            course = replace(course, nodes=(replace(unworn, begun=fine.nodes[-1].begun),))
        return MissionProgress(course, 1, fine, (), self.spent)

    def _integrate(self, rtol: float, last: int, fine: MissionCourse | None) -> MissionCourse:
        """Take steps up to a number of missions."""
        while (course := self.progress.course).failure is None:
            computed = course.nodes[-1].mission
            if computed >= last or (fine is None and self.missions_to_target(course) <= computed):
                self.progress = replace(self.progress, course=replace(course, failure=Failure(Outcome.CONVERGED)))
                break
            longest = min(last - computed, self.mission.largest_step or last, last if len(course.nodes) > 2 else 1)
            length = min(self.progress.length, longest)
            allowed = partial(allowed_error, MISSIONS.step_error_fraction * rtol)
            step = take_step(self.mission, course.nodes, length, self._run_block(fine, computed + length), allowed)
            self.progress = self._after(step, length, allowed)
        return self.progress.course

    def _after(self, step: Step | Failure, length: int, allowed: Callable[..., float]) -> MissionProgress:
        """The progress after a step, or after one that was refused."""
        course, progress = self.progress.course, replace(self.progress, runs=())
        node = course.nodes[-1]
        if isinstance(step, Failure):
            if length == 1 or step.outcome is Outcome.TIME_LIMIT:
                return replace(progress, course=replace(course, failure=step))
            return replace(progress, length=max(int(SMALLEST_STEP_RATIO * length), 1))
        volumes = [float(of.depth @ self.mission.area) for of in (node, step.node)]
        error = step.error / allowed(*volumes, node.mission, length)
        if error > 1.0 and length > 1:
            return replace(progress, length=max(int(SECOND_ORDER.factor(error, accepted=False) * length), 1))
        ahead = max(int(SECOND_ORDER.factor(error, accepted=True) * length), 1)
        return replace(progress, course=course.longer(step.node, step.runs), length=ahead)

    def missions_to_target(self, course: MissionCourse) -> float:
        """Number of missions at which the target is reached, inf if never."""
        target = self.mission.until
        if target is None:
            return math.inf
        for before, end in zip(course.nodes, course.nodes[1:], strict=False):
            if self.worn(end.growth) >= target.value:
                worn_at = partial(self._worn_within, before, end)
                return before.mission + (end.mission - before.mission) * fraction_where(target.value, worn_at)
        return math.inf

    def _worn_within(self, before: MissionNode, end: MissionNode, fraction: float) -> float:
        """Wear to compare with the target at a fraction of a step."""
        return self.worn(growth_within(before, end, before.mission + fraction * (end.mission - before.mission)))

    def worn(self, growth: FloatArray) -> float:
        """Wear to compare with the target, from the depths worn by each block: volume, m3, or largest depth, m."""
        depth = growth.sum(axis=0)
        assert self.mission.until is not None
        if self.mission.until.quantity == "wear_depth":
            return float(depth.max(initial=0.0))
        return float(depth @ self.mission.area)

    def _run_block(self, fine: MissionCourse | None, mission: int) -> RunBlock:
        """Function that computes a block, from the progress where it was computed before an interruption.

        fine: the history, for a block of the reference solution; mission: number of the mission that is computed.
        """
        known = iter(self.progress.runs)
        node = self.progress.course.nodes[-1]
        # as in a wear history: stability is tested at the begin and the end
        every = fine is None and mission in (1, self.mission.missions[-1])
        likes = () if fine is None else fine.nodes[int(np.searchsorted(fine.ends, mission))].likes

        def run(place: int, depth: FloatArray, carried: StartState | None, with_slope: bool) -> BlockRun:
            found = next(known, None)
            if found is not None:
                return found
            settings = self.mission.settings
            left = replace(settings, time_limit=settings.time_limit - self.spent)
            frequencies = node.frequencies[place] if node.frequencies else ()
            begun = node.begun[place] if node.begun else None
            case = BlockCase(self.mission, place, depth, carried, with_slope, left, frequencies, begun, every)
            through = run_passage if isinstance(case.block.frequency, Passage) else run_block
            computed = guarded(lambda: through(case, likes[place] if likes else None))
            found = not_computed(case, computed, 0) if isinstance(computed, Failure) else computed
            if found.failure.outcome is not Outcome.TIME_LIMIT:
                # with more time it goes on from the block before
                self.progress = replace(self.progress, runs=(*self.progress.runs, found), spent=self.spent)
                if self.keep is not None:
                    self.keep(pack(self.progress))
            return found

        return run
