"""The two integrations over missions: the history itself and its reference solution, step by step."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from solver.clock import computing_time
from solver.missions.block_run import BlockCase, BlockRun, not_flown, run_block
from solver.missions.blocks import Mission, Passage
from solver.missions.course import MissionCourse, MissionNode, growth_within
from solver.missions.options import MISSIONS
from solver.missions.passage import run_passage
from solver.missions.step import Fly, Step, take_step
from solver.model import FloatArray
from solver.options import COMMON
from solver.outcome import Outcome
from solver.packing import Packed, pack, packable
from solver.results.history import StartState
from solver.wear.integrate import guarded
from solver.wear.interpolation import fraction_where
from solver.wear.state import Failure

ENDS_ALL = (Outcome.TIME_LIMIT, Outcome.EXCEPTION)
"""Outcomes of a reference solution that are those of the history."""


@packable
@dataclass(frozen=True)
class MissionProgress:
    """The progress over missions, from which it goes on.

    fine: the history so far.
    length: missions of its next step.
    reference: the reference solution so far; None while the history is integrated.
    runs: blocks flown since the last step, in order.
    spent: CPU seconds so far.
    """

    fine: MissionCourse
    length: int
    reference: MissionCourse | None
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
        n_block, n_contact = len(self.mission.blocks), self.mission.area.size
        self.progress = self.saved or MissionProgress(
            _begun(n_block, n_contact), min(MISSIONS.first_step, self._longest), None, (), 0.0
        )
        self.began -= self.progress.spent

    @property
    def spent(self) -> float:
        """CPU seconds so far, those before an interruption included."""
        return computing_time() - self.began

    @property
    def _longest(self) -> int:
        return self.mission.largest_step or self.mission.missions[-1]

    def history(self) -> MissionCourse:
        """Integrate the history."""
        last = self.mission.missions[-1]
        while self.progress.fine.failure is None:
            course, length = self.progress.fine, self.progress.length
            node = course.nodes[-1]
            if node.mission >= last or self.missions_to_target(course) <= node.mission:
                self.progress = replace(self.progress, fine=replace(course, failure=Failure(Outcome.CONVERGED)))
                break
            length = min(length, last - node.mission, self._longest)
            self._advance(course, take_step(self.mission, node, halves(length), self._fly(None)), length)
        return self.progress.fine

    def reference(self) -> MissionCourse:
        """Integrate the reference solution, in steps twice as long where the history has steps of several missions."""
        fine = self.progress.fine
        course = self.progress.reference or _begun(*fine.nodes[0].growth.shape)
        self.progress = replace(self.progress, reference=course)
        for parts, like, end in _reference_steps(fine):
            if course.nodes[-1].mission >= end or course.failure is not None:
                continue
            step = take_step(self.mission, course.nodes[-1], parts, self._fly(like))
            course = replace(course, failure=step) if isinstance(step, Failure) else _longer(course, step)
            # a later resumption begins with the next step
            self.progress = replace(self.progress, reference=course, runs=())
        return course

    def missions_to_target(self, course: MissionCourse) -> float:
        """Number of missions at which the target is reached, inf if never."""
        target = self.mission.until
        if target is None:
            return math.inf
        for before, end in zip(course.nodes, course.nodes[1:], strict=False):
            if self.worn(end.growth) >= target.value:
                length = end.mission - before.mission
                worn_at = partial(self._worn_within, before, end)
                return before.mission + length * fraction_where(target.value, worn_at)
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

    def _fly(self, like: MissionNode | None) -> Fly:
        """Function that flies a block, from the progress where it was flown before an interruption."""
        known = iter(self.progress.runs)

        def run(place: int, depth: FloatArray, carried: StartState | None, missions: tuple[int, ...]) -> BlockRun:
            found = next(known, None)
            if found is not None:
                return found
            settings = self.mission.settings
            left = replace(settings, time_limit=settings.time_limit - self.spent)
            case = BlockCase(self.mission, place, depth, carried, missions, left)
            through = run_passage if isinstance(case.block.frequency, Passage) else run_block
            flown = guarded(lambda: through(case, None if like is None else like.likes[place]))
            found = not_flown(case, flown, 0) if isinstance(flown, Failure) else flown
            if found.failure.outcome is not Outcome.TIME_LIMIT:
                # with more time it goes on from the block before
                self.progress = replace(self.progress, runs=(*self.progress.runs, found), spent=self.spent)
                if self.keep is not None:
                    self.keep(pack(self.progress))
            return found

        return run

    def _advance(self, course: MissionCourse, step: Step | Failure, length: int) -> None:
        """The progress after a step of the history, or after one that was refused."""
        if isinstance(step, Failure):
            if length == 1 or step.outcome is Outcome.TIME_LIMIT:
                self.progress = replace(self.progress, fine=replace(course, failure=step))
            else:
                self._shorten(length, COMMON.smallest_step_ratio * length)
            return
        wanted = self._wanted(course.nodes[-1], step, length)
        if length > MISSIONS.first_step and wanted < COMMON.step_safety * length:
            self._shorten(length, wanted)
            return
        longest = MISSIONS.first_step if length == 1 else length / COMMON.smallest_step_ratio
        ahead = int(np.clip(wanted, MISSIONS.first_step, longest))
        self.progress = replace(self.progress, fine=_longer(course, step), length=ahead, runs=())

    def _shorten(self, length: int, wanted: float) -> None:
        """Try a step again with fewer missions."""
        # steps of two missions are missions one by one, whatever their error says
        least = MISSIONS.first_step if length > MISSIONS.first_step else 1
        shorter = int(np.clip(wanted, COMMON.smallest_step_ratio * length, length - 1))
        self.progress = replace(self.progress, length=max(shorter, least), runs=())

    def _wanted(self, node: MissionNode, step: Step, length: int) -> float:
        """Length of a step with the allowed error, missions.

        The square of the error by the order of the blocks adds up. This error itself may be seen at the end of a step,
        over all wear so far.
        """
        area, aim = self.mission.area, COMMON.step_error_fraction * self.mission.settings.rtol
        if step.order_error == 0.0:
            return math.inf
        grown = float((step.node.growth - node.growth).sum(axis=0) @ area)
        whole = float(step.node.growth.sum(axis=0) @ area)
        squared = math.sqrt(aim * max(1.0, whole * length / (step.node.mission * grown))) / step.order_error
        # the wear of a step grows with its length, too
        itself = math.sqrt(aim * whole / (step.order_error * grown))
        return COMMON.step_safety * length * min(squared, itself)


def halves(length: int) -> tuple[int, ...]:
    """Missions of the parts of a step, (1,) of a single mission."""
    return (1,) if length == 1 else ((length + 1) // 2, length // 2)


def _begun(n_block: int, n_contact: int) -> MissionCourse:
    """The course before the first step."""
    start = MissionNode(0, np.zeros((n_block, n_contact)))
    unknown, nothing = np.full((n_block, n_contact), np.nan), np.zeros(n_block)
    return MissionCourse((start,), None, unknown, nothing, nothing, nothing)


def _longer(course: MissionCourse, step: Step) -> MissionCourse:
    """The course with another step."""
    before, n_block = course.nodes[-1], len(course.inaccurate)
    nodes = (*course.nodes[:-1], replace(before, carried=None), step.node)
    inaccurate, sweep_rate = course.inaccurate.copy(), course.sweep_rate.copy()
    for place, run in enumerate(step.runs):
        # runs of one block lie n_block apart
        inaccurate[place % n_block] = max(inaccurate[place % n_block], run.inaccurate)
        sweep_rate[place % n_block] = max(sweep_rate[place % n_block], run.sweep_rate)
    found = replace(
        course,
        nodes=nodes,
        inaccurate=inaccurate,
        sweep_rate=sweep_rate,
        held=_first(course.held, before.mission, any(run.held for run in step.runs)),
        cut_off=_first(course.cut_off, before.mission, any(run.cut_off for run in step.runs)),
        iterations=course.iterations + sum(run.iterations for run in step.runs),
    )
    if before.mission:
        return found
    # all ways to fly the first step begin with the same state of the first block
    first = step.runs[-n_block:] if len(step.runs) == n_block else step.runs[n_block : 2 * n_block]
    return replace(
        found,
        start_rates=np.array([run.start_rate for run in first]),
        start_errors=np.array([run.start_error for run in first]),
    )


def _first(known: float, mission: int, now: bool) -> float:
    """Number of missions at which something is seen first; NaN if never."""
    return float(mission) if math.isnan(known) and now else known


def _reference_steps(fine: MissionCourse) -> Iterator[tuple[tuple[int, ...], MissionNode, int]]:
    """Steps of the reference solution: missions of their parts, the step of the history at their start, and their end.

    Two steps of the history are the two parts of one. Missions that were flown one by one stay so.
    """
    lengths, place = np.diff(fine.ends).astype(int).tolist(), 0
    while place < len(lengths):
        length, node = lengths[place], fine.nodes[place + 1]
        if length <= MISSIONS.first_step:
            yield from (((1,), node, node.mission - length + one) for one in range(1, length + 1))
        elif place + 1 < len(lengths) and lengths[place + 1] > MISSIONS.first_step:
            place += 1
            yield (length, lengths[place]), node, fine.nodes[place + 1].mission
        else:
            yield halves(length), node, node.mission
        place += 1
