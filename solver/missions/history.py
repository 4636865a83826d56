"""One mission history: the problem over the slow time, comparison with the reference solution, outcome."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from solver.accuracy.history_error import HistoryError, error_of_target
from solver.continuation.natural import Lengths, take_step
from solver.harmonic_balance.state import Failure
from solver.missions.block_run import Begun, BlockInput, BlockResult, run_block
from solver.missions.mission import MissionHistory, MissionRequest
from solver.missions.passage import LARGEST_SWEEP_RATE, run_passage
from solver.missions.step import MissionStep, attempt_step, values_of
from solver.model import FloatArray
from solver.newton.run import Budget, guarded
from solver.outcome import SENSITIVE_ERROR, Outcome, known_to
from solver.packing import Packed, packable
from solver.results.history import describe_cut_off, describe_uncertain, last_error
from solver.settings import Passage
from solver.wear.history import compare
from solver.wear.slow_time import (
    ENDS_ALL,
    REGULAR_END,
    RTOL_RATIO,
    Course,
    Guide,
    Integrator,
    Node,
    Solution,
)

STEP_ERROR_FRACTION = 0.5
"""Allowed error of a step over its wear, or over its wear at the mean rate so far if larger, as a fraction of rtol.
Missions of a slider: estimated over true error at least 1.7. With 0.25 two cases of the tests compute 21.5 and 33 of
2000 missions, with 0.5 fewer than 20 and 30."""


@packable
@dataclass(frozen=True)
class MissionState:
    """A joint after some missions; the next step depends on it and the last nodes of the course.

    results, first: blocks of the last and of the first mission, none before. length: missions of the next step.
    inaccurate, sweep_rate (n_block,): largest values of the blocks so far.
    held_from, cut_off_from: missions before the first step with such a block, inf if never.
    """

    results: tuple[BlockResult, ...] = ()
    first: tuple[BlockResult, ...] = ()
    length: float = 1.0
    inaccurate: FloatArray | float = 0.0
    sweep_rate: FloatArray | float = 0.0
    held_from: float = math.inf
    cut_off_from: float = math.inf


Here = tuple[MissionState, Course]
"""Where a step begins."""


class MissionProblem:
    """A mission history, or its reference solution, as `SlowProblem`; stepped by `take_step` over its missions.

    fine: the history of which it is the reference solution; None for a history.
    """

    # each step computes at least one mission
    iterations_per_save = 0

    def __init__(self, mission: MissionRequest, fine: Solution | None = None) -> None:
        self.mission, self.fine, self.budget = mission, fine, Budget()
        self.name, self.course = "history" if fine is None else "reference", unworn_course(mission)
        self.last = mission.missions[-1] if fine is None else int(fine.course.ends[-1])
        # how each block began last, and why a step was not found
        self._begun: list[Begun | None] = []
        self._failure = Failure(Outcome.MARCH_FAILED)

    def drop_factor(self) -> None:
        """As in SlowProblem: nothing."""

    def advance(self, state: MissionState | None, course: Course) -> Here | Failure:
        """As in SlowProblem."""
        state = state or MissionState()
        done = int(course.ends[-1])
        if done >= self.last or (self.fine is None and not math.isnan(course.reached)):
            return REGULAR_END
        longest = min(self.last - done, self.mission.largest_step or self.last)
        # a step over more than one extrapolates from three nodes
        longest = min(longest, self.last if len(course.ends) > 2 else 1)
        earlier = state.results if done or self.fine is None else self.fine.state.first
        self._begun = [each.begun for each in earlier] or [None] * len(self.mission.blocks)
        taken = take_step(self, (state, course), min(state.length, longest), Lengths(2, shortest=1, rescue=1))
        if isinstance(taken, Failure):
            return taken
        step, length = taken
        results = tuple(replace(each, slope=None) for each in step.results)
        after = MissionState(
            results,
            state.first or tuple(replace(each, last=None) for each in results),
            length,
            np.maximum([each.inaccurate for each in results], state.inaccurate),
            np.maximum([each.sweep_rate for each in results], state.sweep_rate),
            min(state.held_from, done if any(each.held for each in results) else math.inf),
            min(state.cut_off_from, done if any(each.cut_off for each in results) else math.inf),
        )
        if not done:
            # the rate and the values of the unworn joint are those of the first mission
            course = replace(course, nodes=(replace(step.node, count=0.0, depth=course.nodes[0].depth),))
        return after, course.after(step.node)

    def attempt(self, here: Here, length: float) -> MissionStep | None:
        """As in SteppedProblem. The last mission of the step is computed."""
        nodes, rtol = here[1].nodes, self.mission.settings.rtol * (1.0 if self.fine is None else RTOL_RATIO)
        run_mission = partial(self._mission, here[0], int(nodes[-1].count + length))
        found = attempt_step(nodes, int(length), self.mission.area, run_mission, STEP_ERROR_FRACTION * rtol)
        if isinstance(found, MissionStep):
            return found
        self._failure = found
        return None

    def ratio(self, _: Here, end: MissionStep, __: float) -> float:
        """As in SteppedProblem."""
        return end.ratio

    def rescue(self, _: Here, __: float) -> Failure:
        """As in SteppedProblem: a mission that fails by itself ends the history."""
        return self._failure

    def _mission(
        self, state: MissionState, number: int, depth: FloatArray, with_slopes: bool
    ) -> tuple[BlockResult, ...] | Failure:
        """Compute the blocks of a mission. number: from 1 on. depth (n_contact,): before the mission, m."""
        mission, carried = self.mission, state.results[-1].last if state.results else None
        guides: tuple[Guide | None, ...] = (None,) * len(mission.blocks)
        if self.fine is not None:
            guides = self.fine.course.nodes[int(np.searchsorted(self.fine.course.counts, number))].guides
        # as in a wear history: stability is tested at the start and the end
        with_switching = self.fine is None and number in (1, mission.missions[-1])
        results: list[BlockResult] = []
        for place, (block, guide, begun) in enumerate(zip(mission.blocks, guides, self._begun, strict=True)):
            limit, run = self.budget.deadline, run_passage if isinstance(block.frequency, Passage) else run_block
            given = BlockInput(mission, place, depth, limit, carried, begun, guide, with_slopes, with_switching)
            found = guarded(partial(run, given))
            if isinstance(found, Failure):
                said = f"in mission {number}, {mission.called(place)}"
                return Failure(found.outcome, ": ".join(filter(None, (said, found.message))))
            results.append(found)
            self._begun[place] = found.begun or begun
            self.budget.iterations += found.iterations
            depth, carried = depth + found.growth, found.last
        return tuple(results)


def unworn_course(mission: MissionRequest) -> Course:
    """The course before the first mission, whose blocks have no values yet."""
    nothing = np.zeros(mission.area.size)
    unknown = np.full((2, len(mission.blocks[0].model.response_names)), np.nan)
    results = (BlockResult(nothing, unknown.astype(complex), unknown),) * len(mission.blocks)
    course = Course(mission.area, np.array(mission.missions, np.float64), mission.until)
    row = np.tile(nothing, len(results))
    return course.after(Node(0.0, row, row, values_of(results) | {"local": nothing}))


def integrate_missions(
    mission: MissionRequest, keep: Callable[[Packed], None] | None = None, resume: Packed | None = None
) -> MissionHistory:
    """Mission history of one point of a study, as far as computed, with its outcome.

    keep: called after each step with the progress. resume: as for `wear.history.integrate_together`.
    """
    integrator = Integrator(mission.settings.time_limit, keep, resume)
    fine = integrator.integrate(MissionProblem(mission))
    if fine.state is not None and fine.end.outcome not in ENDS_ALL:
        fine = replace(fine, compared=integrator.integrate(MissionProblem(mission, fine), fine.seconds))
    history = _assembled(mission, fine)
    if history.outcome is not Outcome.CONVERGED:
        return history
    outcome, message = _judged(mission, fine.state, history)
    return replace(history, outcome=outcome, message=message)


def _assembled(mission: MissionRequest, fine: Solution) -> MissionHistory:
    """The result, from both solutions."""
    course, state = fine.course, fine.state
    reference = unworn_course(mission) if fine.compared is None else fine.compared.course
    counts, area, n_block = np.array(mission.missions, np.float64), mission.area, len(mission.blocks)
    values, target = course.read(counts), course.reached
    growth = values["wear_depth"].reshape(counts.size, n_block, -1)
    depth = growth.sum(axis=1)
    whole, *blocks = _errors(mission, counts, course, reference)
    reached = np.flatnonzero(np.isfinite(whole.worn_volume))
    other = reference.read(counts)["wear_depth"].reshape(growth.shape).sum(axis=1)
    return MissionHistory(
        response_begin=values["response"][:, :, 0],
        response_end=values["response"][:, :, 1],
        response_peak_begin=values["response_peak"][:, :, 0],
        response_peak_end=values["response_peak"][:, :, 1],
        response_error=np.array([each.response for each in blocks]).T,
        excitation_frequency=np.array([block.ends for block in mission.blocks]),
        outcome=fine.end_of_all.outcome,
        message=fine.end_of_all.message,
        missions=counts,
        worn_volume=depth @ area,
        worn_volume_error=whole.worn_volume,
        wear_depth=depth,
        wear_depth_error=whole.wear_depth,
        block_volume=growth @ area,
        block_volume_error=np.array([each.worn_volume for each in blocks]).T,
        reference_volume=other @ area,
        sweep_rate=np.zeros(n_block) if state is None else state.sweep_rate,
        error_estimate=last_error(
            counts[reached], whole.worn_volume[reached], values["wear_rate"][reached], course.ends[-1]
        ),
        last_mission=course.ends[-1],
        steps=np.diff(course.ends),
        missions_to_target=target,
        missions_to_target_error=_target_error(mission, target, course, reference),
        newton_iterations=sum(each.iterations for each in fine.all),
        run_time=sum(each.seconds for each in fine.all),
    )


def _errors(mission: MissionRequest, counts: FloatArray, fine: Course, reference: Course) -> list[HistoryError]:
    """Errors of the whole wear, and of wear and responses of each block, at the counts (n_output,), the first 0."""
    n_block, area = len(mission.blocks), mission.area
    parts = (slice(None), *(slice(place, place + 1) for place in range(n_block)))
    whole, *blocks = (compare(counts, fine, reference, area, partial(_of_blocks, part, area))[1] for part in parts)
    # where blocks adapt the pressures of the pairs against each other, two solutions may agree in a pair by chance
    local = np.where(counts[:, None] > 0.0, fine.read(counts)["local"], 0.0)
    return [replace(whole, wear_depth=np.fmax(whole.wear_depth, local)), *blocks]


def _of_blocks(chosen: slice, area: FloatArray, values: dict[str, Any]) -> dict[str, Any]:
    """Wear of some blocks together, and their responses, in the terms of a wear history."""
    n = len(values["local"])
    growth, rates = (values[name].reshape(n, -1, area.size) for name in ("wear_depth", "depth_rate"))
    rates = rates[:, chosen]
    volumes = np.nan_to_num(rates @ area)
    errors = np.nan_to_num(values["growth_error"][:, chosen], posinf=np.inf)
    # the error of a block that wears nothing may be unknown
    weighted = np.where(volumes > 0.0, errors * np.fmax(volumes, 1e-300), 0.0).sum(axis=1)
    whole, worn = volumes.sum(axis=1), growth.sum(axis=2)
    share = np.divide(worn[:, chosen].sum(axis=1), worn.sum(axis=1), out=np.ones(n), where=worn.sum(axis=1) > 0.0)
    rate_error = np.divide(weighted, whole, out=np.zeros_like(whole), where=whole > 0.0)
    depth = growth[:, chosen].sum(axis=1)
    # the local errors hold those of all blocks; `history_error` adds that of the first mission to them
    first = rate_error[0] if np.isfinite(rate_error[0]) else 0.0
    return {
        "wear_depth": depth,
        "depth_rate": rates.sum(axis=1),
        "wear_rate": rates.sum(axis=1) @ area,
        "wear_rate_error": rate_error,
        "local": np.fmax(share * (values["local"] @ area) - first * (depth @ area), 0.0),
        "response": values["response"][:, chosen].reshape(n, -1),
        "response_peak": values["response_peak"][:, chosen].reshape(n, -1),
        "response_error": np.fmax.reduce(values["response_error"][:, chosen], axis=1),
    }


def _target_error(mission: MissionRequest, at: float, fine: Course, reference: Course) -> float:
    """Estimated error of the number of missions to the target, NaN where it was never reached."""
    if mission.until is None or math.isnan(at):
        return math.nan
    counts, of_other = np.array([0.0, at]), reference.reach(mission.until)[0]
    whole, *_ = _errors(mission, counts, fine, reference)
    values = _of_blocks(slice(None), mission.area, fine.read(counts))
    last_rate = fine.nodes[-1].rate.reshape(-1, mission.area.size).sum(axis=0)
    return error_of_target(mission.until, at, of_other, values, last_rate, whole, mission.area)


def _judged(mission: MissionRequest, state: MissionState, history: MissionHistory) -> tuple[Outcome, str]:
    """The outcome of a complete history, and its sentence."""
    rtol = mission.settings.rtol
    if state.cut_off_from < math.inf:
        return Outcome.CONTACT_CUT_OFF, describe_cut_off(state.cut_off_from, "mission")
    outcome, said, inaccurate = Outcome.CONVERGED, [], np.asarray(state.inaccurate)
    if history.error_estimate > SENSITIVE_ERROR:
        outcome, last = Outcome.SENSITIVE, np.flatnonzero(np.isfinite(history.worn_volume))[-1]
        volumes = history.worn_volume[last], history.reference_volume[last]
        said.append(describe_uncertain(*volumes, history.error_estimate, rtol, "in coarser steps"))
    elif inaccurate.any():
        outcome, name = Outcome.INACCURATE, mission.called(int(inaccurate.argmax()))
        said.append(f"in {name} the vibration {known_to(float(inaccurate.max()), rtol)}")
    if state.held_from < math.inf:
        said.append(
            f"from mission {state.held_from:.0f} on only friction holds the joint in one direction: it is held there"
        )
    for place in np.flatnonzero(history.sweep_rate > LARGEST_SWEEP_RATE):
        name, rate = mission.called(int(place)), history.sweep_rate[place]
        passes = f"passes at {rate:.2g} (zeta f)^2" if np.isfinite(rate) else "has no damping where the joint sticks"
        said.append(f"{name} {passes}: it may wear otherwise than its steady states (see the error)")
    return outcome, "; ".join(said)
