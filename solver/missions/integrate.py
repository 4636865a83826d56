"""Missions as a problem over the slow time: its steps, its state, and the missions of which the steps are made."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from solver.continuation.natural import Lengths, take_step
from solver.harmonic_balance.state import Failure
from solver.missions.block_run import Begun, BlockCase, BlockRun, run_block
from solver.missions.mission import Mission, Passage
from solver.missions.passage import run_passage
from solver.missions.step import Nodes, Step, attempt_step, values_of
from solver.model import FloatArray
from solver.newton.run import Budget
from solver.outcome import Outcome
from solver.packing import packable
from solver.wear.course import Course, Node
from solver.wear.slow_time import AS_ASKED, RTOL_RATIO, Ended, Guide, guarded

STEP_ERROR = 0.5
"""Allowed error of a step over its wear, or over its wear at the mean rate so far if larger, as a fraction of rtol.
Missions of a slider: estimated over true error at least 1.7. With 0.25 two cases of the tests compute 21.5 and 33 of
2000 missions, with 0.5 fewer than 20 and 30."""


@packable
@dataclass(frozen=True)
class MissionState:
    """A joint after some missions; the next step depends on it alone.

    nodes: ends of the last three steps. inaccurate, sweep_rate (n_block,): largest values of the blocks so far.
    length: missions of the next step. runs, first: blocks of the last and of the first mission.
    guides: for each step those of the blocks of its mission.
    held_from, cut_off_from: missions before the first step with such a block, inf if never.
    """

    nodes: Nodes
    inaccurate: FloatArray
    sweep_rate: FloatArray
    length: float = 1.0
    runs: tuple[BlockRun, ...] = ()
    first: tuple[BlockRun, ...] = ()
    guides: tuple[tuple[Guide | None, ...], ...] = ()
    held_from: float = math.inf
    cut_off_from: float = math.inf


class MissionProblem:
    """A mission history, or its reference solution, as a problem over the slow time; the line of `take_step`.

    fine: the history of which it is the reference solution; None for a history.
    """

    # each step computes at least one mission
    iterations_per_save = 0

    def __init__(self, mission: Mission, fine: Ended | None = None) -> None:
        self.mission, self.fine, self.budget = mission, fine, Budget()
        self.last = mission.missions[-1] if fine is None else int(fine.course.ends[-1])
        # how each block began last, and why a step was not found
        self._begun: list[Begun | None] = []
        self._failure = Failure(Outcome.MARCH_FAILED)

    def forget(self) -> None:
        """As in SlowProblem: nothing."""

    def ended(self, _: MissionState, course: Course) -> Failure | None:
        """As in SlowProblem."""
        done = course.ends[-1] >= self.last or not math.isnan(course.reached)
        return AS_ASKED if done else None

    def advance(self, state: MissionState | None, course: Course) -> tuple[MissionState, Course] | Failure:
        """As in SlowProblem."""
        if state is None:
            nothing = np.zeros(len(self.mission.blocks))
            state = MissionState(course.nodes, nothing, nothing)
        done = int(course.ends[-1])
        longest = min(self.last - done, self.mission.largest_step or self.last)
        longest = min(longest, self.last if len(course.ends) > 2 else 1)
        begins = state.runs if done or self.fine is None else self.fine.state.first
        self._begun = [run.begun for run in begins] or [None] * len(self.mission.blocks)
        taken = take_step(self, state, min(state.length, longest), Lengths(2, shortest=1, rescue=1))
        if isinstance(taken, Failure):
            return taken
        step, length = taken
        runs = tuple(replace(run, slope=None) for run in step.runs)
        after = replace(
            state,
            nodes=(*state.nodes, step.node)[-3:],
            length=length,
            runs=runs,
            first=state.first or tuple(replace(run, last=None) for run in runs),
            guides=(*state.guides, tuple(run.guide for run in runs)),
            inaccurate=np.maximum([run.inaccurate for run in runs], state.inaccurate),
            sweep_rate=np.maximum([run.sweep_rate for run in runs], state.sweep_rate),
            held_from=min(state.held_from, done if any(run.held for run in runs) else math.inf),
            cut_off_from=min(state.cut_off_from, done if any(run.cut_off for run in runs) else math.inf),
        )
        if not done:
            # the rate and the values of the unworn joint are those of the first mission
            course = replace(course, nodes=(replace(step.node, count=0.0, depth=course.nodes[0].depth),))
        return after, course.after(step.node)

    def attempt(self, state: MissionState, length: float) -> Step | None:
        """As in Line. The last mission of the step is computed."""
        rtol = self.mission.settings.rtol * (1.0 if self.fine is None else RTOL_RATIO)
        run = partial(self._mission, state, int(state.nodes[-1].count + length))
        found = attempt_step(state.nodes, int(length), self.mission.area, run, STEP_ERROR * rtol)
        if isinstance(found, Step):
            return found
        self._failure = found
        return None

    def judge(self, _: MissionState, end: Step, __: float) -> float:
        """As in Line."""
        return end.ratio

    def rescue(self, _: MissionState, __: float) -> Failure:
        """As in Line: a mission that fails by itself ends the history."""
        return self._failure

    def _mission(
        self, state: MissionState, number: int, depth: FloatArray, with_slopes: bool
    ) -> tuple[BlockRun, ...] | Failure:
        """Compute the blocks of the mission of a number behind a state. depth (n_contact,): m, before the mission."""
        mission, carried = self.mission, state.runs[-1].last if state.runs else None
        guides: tuple[Guide | None, ...] = (None,) * len(mission.blocks)
        if self.fine is not None:
            guides = self.fine.state.guides[int(np.searchsorted(self.fine.course.ends, number)) - 1]
        # as in a wear history: stability is tested at the begin and the end
        every = self.fine is None and number in (1, mission.missions[-1])
        runs: list[BlockRun] = []
        for place, (block, guide, begun) in enumerate(zip(mission.blocks, guides, self._begun, strict=True)):
            case = BlockCase(mission, place, depth, self.budget.deadline, carried, begun, guide, with_slopes, every)
            through = run_passage if isinstance(block.frequency, Passage) else run_block
            found = guarded(partial(through, case))
            if isinstance(found, Failure):
                said = f"in mission {number}, {mission.called(place)}"
                return Failure(found.outcome, ": ".join(filter(None, (said, found.message))))
            runs.append(found)
            self._begun[place] = found.begun or begun
            self.budget.iterations += found.iterations
            depth, carried = depth + found.growth, found.last
        return tuple(runs)


def unworn_course(mission: Mission) -> Course:
    """The course before the first mission, whose blocks have no values yet."""
    nothing = np.zeros(mission.area.size)
    unknown = np.full((2, len(mission.blocks[0].model.response_names)), np.nan)
    runs = (BlockRun(nothing, unknown.astype(complex), unknown),) * len(mission.blocks)
    course = Course(mission.area, smooth=True, outputs=np.array(mission.missions, np.float64), target=mission.until)
    row = np.tile(nothing, len(runs))
    return course.after(Node(0.0, row, row, values_of(runs) | {"local": nothing}))
