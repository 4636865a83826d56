"""The integration of a joint over its missions, and of its reference solution, step by step; what is kept of each."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.clock import computing_time
from solver.continuation.natural import Lengths, take_step
from solver.harmonic_balance.state import Failure
from solver.missions.block_run import Begun, BlockCase, BlockRun, run_block
from solver.missions.mission import Mission, Passage
from solver.missions.passage import run_passage
from solver.missions.step import MissionNode, Step, attempt_step
from solver.model import FloatArray
from solver.outcome import Outcome
from solver.packing import Packed, pack, packable
from solver.wear.course import DenseOutput
from solver.wear.integrate import RTOL_RATIO, guarded

STEP_ERROR = 0.5
"""Allowed error of a step over its wear, or over its wear at the mean rate so far if larger, as a fraction of rtol.
Missions of a slider: estimated over true error at least 1.7. With 0.25 two cases of the tests compute 21.5 and 33 of
2000 missions, with 0.5 fewer than 20 and 30."""


@packable
@dataclass(frozen=True)
class MissionCourse:
    """Steps over the missions so far.

    area (n_contact,): m2. nodes: ends of the steps, the start first.
    failure: reason of the end; None before the end. iterations: Newton iterations of all blocks that were computed.
    """

    area: FloatArray
    nodes: tuple[MissionNode, ...]
    failure: Failure | None = None
    iterations: int = 0

    @classmethod
    def unworn(cls, mission: Mission) -> MissionCourse:
        """The course before the first step."""
        n_block, nothing = len(mission.blocks), np.zeros((len(mission.blocks), mission.area.size))
        unknown = np.full((2, len(mission.blocks[0].model.response_names)), np.nan)
        runs = (BlockRun(nothing[0], unknown.astype(complex), unknown),) * n_block
        return cls(mission.area, (MissionNode(0, nothing, nothing, nothing[0], runs),))

    def longer(self, node: MissionNode, iterations: int) -> MissionCourse:
        """The course with another step. Only its last node keeps what the next mission takes over."""
        before = self.nodes[-1]
        # the reference solution begins as the first mission
        runs = [replace(run, last=None, begun=run.begun if before.mission == 1 else None) for run in before.runs]
        before = replace(before, rate=node.rate if before.mission == 0 else before.rate, runs=tuple(runs))
        return replace(self, nodes=(*self.nodes[:-1], before, node), iterations=self.iterations + iterations)

    @cached_property
    def dense(self) -> DenseOutput:
        """The depths worn by the blocks, all in one row, between the nodes."""
        growth, rate = (np.array([getattr(node, name).ravel() for node in self.nodes]) for name in ("growth", "rate"))
        ends = np.array([node.mission for node in self.nodes], np.float64)
        return DenseOutput(ends, growth, rate, np.tile(self.area, len(self.nodes[0].growth)))

    @property
    def ends(self) -> FloatArray:
        """Missions (n_node,) at the ends of the steps, the start first."""
        return self.dense.counts

    def first_with(self, name: str) -> float:
        """Number of missions from which on a block has `BlockRun.held` or `BlockRun.cut_off`; inf if never."""
        steps = pairwise(self.nodes)
        return next((one.mission for one, end in steps if any(getattr(run, name) for run in end.runs)), math.inf)

    def largest(self, name: str) -> FloatArray:
        """Largest `BlockRun.inaccurate` or `BlockRun.sweep_rate` (n_block,) of each block; 0 without missions."""
        return np.asarray(np.max([[getattr(run, name) for run in node.runs] for node in self.nodes], axis=0))

    def growth_at(self, missions: FloatArray) -> FloatArray:
        """Depth worn by each block (n, n_block, n_contact), m, at numbers of missions; NaN beyond the last step."""
        growth = self.dense.at(missions)
        growth[missions > self.ends[-1]] = np.nan
        return growth.reshape(missions.size, -1, self.area.size)

    def values_at(self, missions: FloatArray) -> dict[str, NDArray[Any]]:
        """Values (n, n_block, ...) of the blocks in the missions that end at some numbers, by their names in `BlockRun`
        and `MissionNode`; at 0 those of the first mission, NaN beyond the last step and before any mission.
        """
        nodes = (*self.nodes[1:2], *self.nodes[1:]) or self.nodes
        between = self.dense.interpolation(missions)
        found = {name: between([getattr(node, name) for node in nodes]) for name in ("rate", "local")}
        for name in ("response", "peak", "response_error", "growth_error"):
            found[name] = between([[getattr(run, name) for run in node.runs] for node in nodes])
        for values in found.values():
            values[missions > self.ends[-1]] = np.nan
        return found

    def missions_to_target(self, mission: Mission) -> float:
        """Number of missions at which the target is reached, inf if never."""
        worn = partial(worn_by, mission)
        if mission.until is None or worn(self.nodes[-1].growth) < mission.until.value:
            return math.inf
        end = next(place for place, node in enumerate(self.nodes) if worn(node.growth) >= mission.until.value)
        return self.dense.count_of(mission.until.value, worn, end)


def worn_by(mission: Mission, growth: FloatArray) -> float:
    """Wear to compare with the target, from the depths worn by the blocks: volume, m3, or largest depth, m."""
    depth = growth.reshape(-1, mission.area.size).sum(axis=0)
    by_depth = mission.until is not None and mission.until.quantity == "wear_depth"
    return float(depth.max(initial=0.0) if by_depth else depth @ mission.area)


@packable
@dataclass(frozen=True)
class MissionProgress:
    """The progress over missions, from which it goes on.

    course: the present integration so far. length: missions of its next step.
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
        guides = () if fine is None else fine.nodes[int(np.searchsorted(fine.ends, number))].runs
        # as in a wear history: stability is tested at the begin and the end
        every = fine is None and number in (1, mission.missions[-1])
        runs: list[BlockRun] = []
        deadline = self._began + mission.settings.time_limit
        for place, block in enumerate(mission.blocks):
            guide, begun = guides[place].guide if guides else None, self._begun[place]
            case = BlockCase(mission, place, depth, deadline, carried, begun, guide, with_slopes, every)
            through = run_passage if isinstance(block.frequency, Passage) else run_block
            found = guarded(partial(through, case))
            if isinstance(found, Failure):
                said = f"in mission {number}, {mission.called(place)}"
                return Failure(found.outcome, ": ".join(filter(None, (said, found.message))))
            runs.append(found)
            self._begun[place], self._iterations = found.begun or begun, self._iterations + found.iterations
            depth, carried = depth + found.growth, found.last
        return tuple(runs)
