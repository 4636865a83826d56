"""One mission history: the problem over the slow time, comparison with the reference solution, outcome."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from solver.continuation.natural import Lengths, take_step
from solver.harmonic_balance.state import Failure
from solver.missions.block_run import BlockInput, BlockResult, Earlier, run_block
from solver.missions.mission import MissionHistory, MissionRequest
from solver.missions.passage import LARGEST_SWEEP_RATE, run_passage
from solver.missions.step import MissionStep, attempt_step, values_of
from solver.model import FloatArray
from solver.newton.run import Run, guarded
from solver.outcome import Outcome, absolute, is_known_to
from solver.packing import Packed, packable
from solver.results.history import StartState, describe_cut_off, describe_uncertain, last_error, verdict
from solver.settings import SHARE_OF_CAUSE, Passage
from solver.wear.errors import Compared, HistoryError, compare, reach_target
from solver.wear.slow_time import RTOL_RATIO, Course, Guide, Integrator, Node, Report, Solution


@packable
@dataclass(frozen=True)
class MissionState:
    """A joint after some missions; the next step depends on it and the last nodes of the course.

    sweeps, first_sweeps: with which the blocks of the last and of the first mission began, none before.
    end: vibration at the end of the last mission, for a first block that continues. length: missions of the next step.
    inaccurate, sweep_rate (n_block,): largest values of the blocks so far.
    held_from, cut_off_from: missions before the first step with such a block, inf if never.
    """

    sweeps: tuple[Earlier, ...] = ()
    first_sweeps: tuple[Earlier, ...] = ()
    end: StartState | None = None
    length: float = 1.0
    inaccurate: FloatArray | float = 0.0
    sweep_rate: FloatArray | float = 0.0
    held_from: float = math.inf
    cut_off_from: float = math.inf


@dataclass
class _Here:
    """Where a step begins, and what its attempts leave: the last sweep of each block, and the last failure."""

    state: MissionState
    course: Course
    sweeps: list[Earlier]
    failure: Failure | None = None


class MissionProblem:
    """A mission history, or its reference solution, as `SlowProblem`; stepped by `take_step` over its missions.

    history: of which it is the reference solution; None for a history.
    """

    # each step computes at least one mission
    iterations_per_save = 0
    unit = "mission"

    def __init__(self, mission: MissionRequest, history: Solution | None = None) -> None:
        self.mission, self.history, self.run = mission, history, Run(mission.settings.tolerance)
        self.name, self.course = "history" if history is None else "reference", unworn_course(mission)
        self.last = mission.missions[-1] if history is None else int(history.course.ends[-1])
        # as in a wear history, stability is tested at the start and the end
        self._tested = (1, self.last) if history is None else ()

    def advance(self, state: MissionState | None, course: Course) -> tuple[MissionState, Course] | Failure | None:  # noqa: D102
        state = state or MissionState()
        done = int(course.ends[-1])
        if self.history is None and not math.isnan(course.reached):
            return self._unstable_behind(state, course)
        if done >= self.last:
            return None
        longest = min(self.last - done, self.mission.largest_step or self.last)
        # a step over more than one extrapolates from three nodes
        longest = min(longest, self.last if len(course.ends) > 2 else 1)
        earlier = state.sweeps if done or self.history is None else self.history.state.first_sweeps
        here = _Here(state, course, list(earlier) or [None] * len(self.mission.blocks))
        taken = take_step(self, here, min(state.length, longest), Lengths(2, shortest=1, rescue=1))
        if isinstance(taken, Failure):
            return taken
        step, length = taken
        results, sweeps = step.results, tuple(each.sweep for each in step.results)
        after = MissionState(
            sweeps,
            state.first_sweeps or sweeps,
            results[-1].last,
            length,
            np.maximum([each.inaccurate for each in results], state.inaccurate),
            np.maximum([each.sweep_rate for each in results], state.sweep_rate),
            min(state.held_from, done if any(each.held for each in results) else math.inf),
            min(state.cut_off_from, done if any(each.cut_off for each in results) else math.inf),
        )
        if not done:
            # the rate and the values of the unworn joint are those of the first mission
            nothing = course.nodes[0].depth
            course = replace(course, nodes=(replace(step.node, count=0.0, depth=nothing, energy=nothing),))
        return after, course.after(step.node)

    def attempt(self, here: _Here, length: float) -> MissionStep | None:
        """As in SteppedProblem. The last mission of the step is computed."""
        nodes, rtol = here.course.nodes, self.mission.settings.rtol * (1.0 if self.history is None else RTOL_RATIO)
        number = int(nodes[-1].count + length)
        run_mission = partial(self._mission, here, number, number in self._tested)
        contacts = [block.model.contact for block in self.mission.blocks]
        # what they have in common, and the steepest change with the energy
        contact = max(contacts, key=lambda each: each.relative_change(np.ones(each.n_contact)))
        step = attempt_step(nodes, int(length), contact, run_mission, SHARE_OF_CAUSE * rtol)
        if isinstance(step, MissionStep):
            return step
        here.failure = step
        return None

    def ratio(self, _: object, end: MissionStep, __: float) -> float:  # noqa: D102
        return end.ratio

    def rescue(self, here: _Here, _: float) -> Failure:
        """As in SteppedProblem: a mission that fails by itself ends the history."""
        too_large = "the error of a step over one mission is too large"
        return here.failure or Failure(Outcome.MARCH_FAILED, too_large)

    def _unstable_behind(self, state: MissionState, course: Course) -> Failure | None:
        """Instability behind the mission with which a history has reached its target, None if stable."""
        done = int(course.ends[-1])
        if done in self._tested:
            return None
        worn = course.nodes[-1].slow.reshape(2, -1, self.mission.area.size).sum(axis=1)
        behind = self._mission(_Here(state, course, list(state.sweeps)), done + 1, True, worn, False)
        if isinstance(behind, Failure):
            return behind
        if all(math.isfinite(each.inaccurate) for each in behind):
            return None
        return Failure(Outcome.INACCURATE, f"whether the joint vibrates stably behind mission {done} is not known")

    def _mission(
        self, here: _Here, number: int, tested: bool, worn: FloatArray, with_slopes: bool
    ) -> tuple[BlockResult, ...] | Failure:
        """Compute the blocks of a mission. number: from 1 on. worn (2, n_contact): depth, m, and dissipated energy,
        J/m2, before the mission.
        """
        mission, before, budget = self.mission, here.state.end, self.run.budget
        guides: tuple[Guide | None, ...] = (None,) * len(mission.blocks)
        if self.history is not None:
            course = self.history.course
            guides = course.nodes[int(np.searchsorted(course.counts, number))].guides
        results: list[BlockResult] = []
        for place, (block, guide, earlier) in enumerate(zip(mission.blocks, guides, here.sweeps, strict=True)):
            run = run_passage if isinstance(block.frequency, Passage) else run_block
            last = before if block.way == "continue" else None
            given = BlockInput(mission, block, worn, budget.deadline, last, earlier, guide, with_slopes, tested)
            result = guarded(partial(run, given))
            if isinstance(result, Failure):
                where = f"in mission {number}, {mission.called(place)}"
                return Failure(result.outcome, ": ".join(filter(None, (where, result.message))))
            results.append(result)
            here.sweeps[place] = result.sweep
            budget.iterations += result.iterations
            worn, before = worn + np.array([result.growth, result.dissipated]), result.last
        return tuple(results)


def unworn_course(mission: MissionRequest) -> Course:
    """The course before the first mission, whose blocks have no values yet."""
    nothing = np.zeros(mission.area.size)
    unknown = np.full((2, len(mission.blocks[0].model.response_names)), np.nan)
    results = (BlockResult(nothing, nothing, unknown.astype(complex), unknown),) * len(mission.blocks)
    course = Course(mission.area, np.array(mission.missions, np.float64), mission.until)
    row = np.tile(nothing, len(results))
    return course.after(Node(0.0, row, row, row, row, values_of(results) | {"local": nothing}))


def integrate_missions(
    mission: MissionRequest,
    keep: Callable[[Packed], None] | None = None,
    resume: Packed | None = None,
    report: Report = lambda *_: None,
) -> MissionHistory:
    """Mission history of one point of a study, as far as computed, with its outcome.

    keep, report: called after each step, with the progress and with words. resume: as for
    `wear.history.integrate_together`.
    """
    integrator = Integrator(mission.settings.time_limit, keep, resume, report)
    solution = integrator.integrate(MissionProblem(mission))
    if solution.state is not None and not solution.breaks_off:
        reference = MissionProblem(mission, solution)
        solution = replace(solution, compared=integrator.integrate(reference, solution.seconds))
    history = _assembled(mission, solution)
    if history.outcome is not Outcome.CONVERGED:
        return history
    outcome, message = _judged(mission, solution.state, history)
    return replace(history, outcome=outcome, message=message)


def _assembled(mission: MissionRequest, solution: Solution) -> MissionHistory:
    course, state, counts, area = solution.course, solution.state, np.array(mission.missions, float), mission.area
    compare_at = partial(_compare, solution, slice(None))
    both, whole = compare_at(counts)
    blocks = [_compare(solution, slice(n, n + 1), counts)[1] for n in range(len(mission.blocks))]
    values, depth = course.read(counts), both.values["wear_depth"]
    target, target_error = reach_target(solution, math.inf, compare_at)
    return MissionHistory(
        **solution.totals,
        response_begin=values["response"][:, :, 0],
        response_end=values["response"][:, :, 1],
        response_peak_begin=values["response_peak"][:, :, 0],
        response_peak_end=values["response_peak"][:, :, 1],
        response_error=np.array([each.response for each in blocks]).T,
        excitation_frequency=np.array([block.ends for block in mission.blocks]),
        missions=counts,
        worn_volume=depth @ area,
        worn_volume_error=whole.worn_volume,
        wear_depth=depth,
        wear_depth_error=whole.wear_depth,
        dissipated_energy=both.values["dissipated_energy"],
        dissipated_energy_error=whole.dissipated_energy,
        block_volume=values["wear_depth"].reshape(counts.size, len(blocks), -1) @ area,
        block_volume_error=np.array([each.worn_volume for each in blocks]).T,
        reference_volume=both.other("wear_depth") @ area,
        sweep_rate=np.zeros(len(blocks)) if state is None else state.sweep_rate,
        error_estimate=last_error(counts, whole.worn_volume, values["wear_rate"], course.ends[-1]),
        last_mission=course.ends[-1],
        steps=np.diff(course.ends),
        missions_to_target=target,
        missions_to_target_error=target_error,
    )


def _compare(solution: Solution, chosen: slice, counts: FloatArray) -> tuple[Compared, HistoryError]:
    """Wear and responses of some blocks beside those of the reference solution, and their errors, at the counts
    (n_output,), the first 0.
    """
    course = solution.course
    both, error = compare(solution, counts, part=partial(_of_blocks, chosen, course.area))
    # where blocks adapt the pressures of the pairs against each other, two solutions may agree in a pair by chance
    local = np.where(counts[:, None] > 0.0, course.read(counts)["local"], 0.0)
    return both, replace(error, wear_depth=np.maximum(error.wear_depth, local))


def _of_blocks(chosen: slice, area: FloatArray, values: dict[str, Any]) -> dict[str, Any]:
    """Wear of some blocks together, and their responses, in the terms of a wear history."""
    n = len(values["local"])
    of_pairs = ("wear_depth", "depth_rate", "dissipated_energy")
    growth, rates, energy = (values[name].reshape(n, -1, area.size) for name in of_pairs)
    rates = rates[:, chosen]
    volumes = rates @ area
    weighted = absolute(values["growth_error"][:, chosen], volumes).sum(axis=1)
    whole, worn = volumes.sum(axis=1), growth.sum(axis=2)
    share = np.divide(worn[:, chosen].sum(axis=1), worn.sum(axis=1), out=np.ones(n), where=worn.sum(axis=1) > 0.0)
    rate_error = np.divide(weighted, whole, out=np.zeros_like(whole), where=whole > 0.0)
    depth = growth[:, chosen].sum(axis=1)
    # the local errors hold those of all blocks; `history_error` adds that of the first mission to them
    first = rate_error[0] if np.isfinite(rate_error[0]) else 0.0
    return {
        "wear_depth": depth,
        "dissipated_energy": energy[:, chosen].sum(axis=1),
        "depth_rate": rates.sum(axis=1),
        "wear_rate": rates.sum(axis=1) @ area,
        "wear_rate_error": rate_error,
        "resolution_error": rate_error,
        "local": np.maximum(absolute(values["local"] @ area, share) - first * (depth @ area), 0.0),
        "response": values["response"][:, chosen].reshape(n, -1),
        "response_peak": values["response_peak"][:, chosen].reshape(n, -1),
        "response_error": values["response_error"][:, chosen].max(axis=1),
    }


def _judged(mission: MissionRequest, state: MissionState, history: MissionHistory) -> tuple[Outcome, str]:
    """The outcome of a complete history, and its sentence."""
    rtol, inaccurate, about_state, held = mission.settings.rtol, np.asarray(state.inaccurate), "", ""
    last = np.flatnonzero(np.isfinite(history.worn_volume))[-1]
    volumes = history.worn_volume[last], history.reference_volume[last]
    uncertain = describe_uncertain(*volumes, history.error_estimate, rtol, "in coarser steps", history.reference_end)
    cut_off = describe_cut_off(state.cut_off_from, "mission") if state.cut_off_from < math.inf else ""
    if inaccurate.any():
        name = mission.called(int(inaccurate.argmax()))
        about_state = f"in {name} the vibration {is_known_to(float(inaccurate.max()), rtol)}"
        # an unknown stability is an infinite error, too
        about_state += ", or whether it is stable" * bool(np.isinf(inaccurate.max()))
    if state.held_from < math.inf:
        held = f"from mission {state.held_from:.0f} on only friction holds the joint in one direction: it is held there"
    passages = []
    for place in np.flatnonzero(history.sweep_rate > LARGEST_SWEEP_RATE):
        name, rate = mission.called(int(place)), history.sweep_rate[place]
        passes = f"passes at {rate:.2g} (zeta f)^2" if np.isfinite(rate) else "has no damping where the joint sticks"
        passages.append(f"{name} {passes}: it may wear otherwise than its steady states (see the error)")
    return verdict(history.error_estimate, rtol, uncertain, about_state, cut_off, held, *passages)
