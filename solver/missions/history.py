"""One mission history: integration over the missions, comparison with the reference solution, outcome."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from solver.accuracy.history_error import Both, HistoryError, error_of_target, history_error
from solver.harmonic_balance.state import Failure
from solver.missions.integrate import MissionProblem, unworn_course
from solver.missions.mission import Mission, MissionHistory
from solver.missions.passage import LARGEST_SWEEP_RATE
from solver.model import FloatArray
from solver.outcome import SENSITIVE_ERROR, Outcome, known_to
from solver.packing import Packed
from solver.results.verdict import describe_cut_off, describe_uncertain
from solver.wear.course import Course
from solver.wear.slow_time import ENDS_ALL, Integrator, Solutions


def integrate_missions(
    mission: Mission, keep: Callable[[Packed], None] | None = None, resume: Packed | None = None
) -> MissionHistory:
    """Mission history of one point of a study, as far as computed, with its outcome.

    keep: called after each step with the progress. resume: such progress of an equal mission, which goes on from there
    with a result that is equal to the last bit, except `run_time`.
    """
    unworn, integrator = unworn_course(mission), Integrator(mission.settings.time_limit, keep, resume)
    fine = integrator.integrate("history", MissionProblem(mission), unworn)
    solutions = Solutions(fine, fine)
    if fine.state is not None and fine.failure.outcome not in ENDS_ALL:
        reference = integrator.integrate("reference", MissionProblem(mission, fine), unworn, fine.seconds)
        solutions = Solutions(fine, fine, reference)
    history = _assembled(mission, solutions, unworn if solutions.reference is None else solutions.reference.course)
    if history.outcome is not Outcome.CONVERGED:
        return history
    failure = _judged(mission, solutions, history)
    return replace(history, outcome=failure.outcome, message=failure.message)


def _assembled(mission: Mission, solutions: Solutions, reference: Course) -> MissionHistory:
    """The result, from both solutions."""
    course, state, failure = solutions.own.course, solutions.own.state, solutions.failure
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
        outcome=failure.outcome,
        message=failure.message,
        missions=counts,
        worn_volume=depth @ area,
        worn_volume_error=whole.worn_volume,
        wear_depth=depth,
        wear_depth_error=whole.wear_depth,
        block_volume=growth @ area,
        block_volume_error=np.array([each.worn_volume for each in blocks]).T,
        reference_volume=other @ area,
        sweep_rate=np.zeros(n_block) if state is None else state.sweep_rate,
        error_estimate=float(whole.worn_volume[reached[-1]]) if reached.size else math.nan,
        last_mission=course.ends[-1],
        steps=np.diff(course.ends),
        missions_to_target=target,
        missions_to_target_error=_target_error(mission, target, course, reference),
        newton_iterations=sum(each.iterations for each in solutions.all),
        run_time=sum(each.seconds for each in solutions.all),
    )


def _errors(mission: Mission, counts: FloatArray, fine: Course, reference: Course) -> list[HistoryError]:
    """Errors of the whole wear, and of wear and responses of each block, at the counts (n_output,), the first 0."""
    read = [(at, fine.read(at), reference.read(at)) for at in (counts, fine.counts)]
    blocks = list(range(len(mission.blocks)))
    found = []
    for chosen in (blocks, *([place] for place in blocks)):
        outputs, steps = (
            Both(at, _of_blocks(chosen, mission.area, own), _of_blocks(chosen, mission.area, other))
            for at, own, other in read
        )
        found.append(history_error(outputs, steps, mission.area))
    # where blocks adapt the pressures of the pairs against each other, two solutions may agree in a pair by chance
    local = np.where(counts[:, None] > 0.0, read[0][1]["local"], 0.0)
    return [replace(found[0], wear_depth=np.fmax(found[0].wear_depth, local)), *found[1:]]


def _of_blocks(chosen: list[int], area: FloatArray, values: dict[str, Any]) -> dict[str, Any]:
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


def _target_error(mission: Mission, at: float, fine: Course, reference: Course) -> float:
    """Estimated error of the number of missions to the target, NaN where it was never reached."""
    if mission.until is None or math.isnan(at):
        return math.nan
    counts, ahead = np.array([0.0, at]), reference.reach_ahead(mission.until)
    whole, *_ = _errors(mission, counts, fine, reference)
    values = _of_blocks(list(range(len(mission.blocks))), mission.area, fine.read(counts))
    last_rate = fine.nodes[-1].rate.reshape(-1, mission.area.size).sum(axis=0)
    return error_of_target(mission.until, at, ahead, values, last_rate, whole, mission.area)


def _judged(mission: Mission, solutions: Solutions, history: MissionHistory) -> Failure:
    """The outcome of a complete history, and its sentence."""
    rtol, state = mission.settings.rtol, solutions.own.state
    if state.cut_off_from < math.inf:
        return Failure(Outcome.CONTACT_CUT_OFF, describe_cut_off(state.cut_off_from).replace("cycle", "mission"))
    outcome, said, worst = Outcome.CONVERGED, [], int(np.argmax(state.inaccurate))
    if history.error_estimate > SENSITIVE_ERROR:
        outcome, last = Outcome.SENSITIVE, np.flatnonzero(np.isfinite(history.worn_volume))[-1]
        volumes = history.worn_volume[last], history.reference_volume[last]
        said.append(describe_uncertain(*volumes, history.error_estimate, rtol, "in coarser steps"))
    elif state.inaccurate[worst] > 0.0:
        outcome = Outcome.INACCURATE
        said.append(f"in {mission.called(worst)} the vibration {known_to(float(state.inaccurate[worst]), rtol)}")
    if state.held_from < math.inf:
        said.append(
            f"from mission {state.held_from:.0f} on only friction holds the joint in one direction: it is held there"
        )
    for place in np.flatnonzero(history.sweep_rate > LARGEST_SWEEP_RATE):
        name, rate = mission.called(int(place)), history.sweep_rate[place]
        passes = f"passes at {rate:.2g} (zeta f)^2" if np.isfinite(rate) else "has no damping where the joint sticks"
        said.append(f"{name} {passes}: it may wear otherwise than its steady states (see the error)")
    return Failure(outcome, "; ".join(said))
