"""One mission history: integration over the missions, comparison with the reference solution, outcome."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from solver.accuracy.history_error import Both, HistoryError, error_of_target, history_error
from solver.harmonic_balance.state import Failure
from solver.missions.integrate import MissionCourse, Missions, worn_by
from solver.missions.mission import Mission, MissionHistory
from solver.missions.passage import LARGEST_SWEEP_RATE
from solver.model import FloatArray
from solver.outcome import SENSITIVE_ERROR, Outcome, known_to
from solver.packing import Packed, unpack
from solver.results.verdict import describe_cut_off, describe_uncertain
from solver.wear.integrate import ENDS_ALL


def integrate_missions(
    mission: Mission, keep: Callable[[Packed], None] | None = None, resume: Packed | None = None
) -> MissionHistory:
    """Mission history of one point of a study, as far as computed, with its outcome.

    keep: called after each step with the progress. resume: such progress of an equal mission, which goes on from there
    with a result that is equal to the last bit, except `run_time`.
    """
    missions = Missions(mission, keep, None if resume is None else unpack(resume))
    fine, reference = missions.history(), MissionCourse.unworn(mission)
    if len(fine.nodes) > 1 and (fine.failure is None or fine.failure.outcome not in ENDS_ALL):
        reference = missions.reference(fine)
        if reference.failure is not None and reference.failure.outcome in ENDS_ALL:
            fine = replace(fine, failure=reference.failure)
    history = replace(_assembled(mission, fine, reference), run_time=missions.spent)
    if history.outcome is not Outcome.CONVERGED:
        return history
    failure = _judged(mission, fine, history)
    return replace(history, outcome=failure.outcome, message=failure.message)


def _assembled(mission: Mission, fine: MissionCourse, reference: MissionCourse) -> MissionHistory:
    """The result, from both solutions."""
    counts, area = np.array(mission.missions, np.float64), mission.area
    growth, values = fine.growth_at(counts), fine.values_at(counts)
    depth = growth.sum(axis=1)
    whole, *blocks = _errors(mission, counts, fine, reference)
    reached = np.flatnonzero(np.isfinite(whole.worn_volume))
    failure, target = fine.failure or Failure(Outcome.CONVERGED), fine.missions_to_target(mission)
    if math.isinf(target):
        target = math.nan
    return MissionHistory(
        response_begin=values["response"][:, :, 0],
        response_end=values["response"][:, :, 1],
        response_peak_begin=values["peak"][:, :, 0],
        response_peak_end=values["peak"][:, :, 1],
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
        reference_volume=reference.growth_at(counts).sum(axis=1) @ area,
        sweep_rate=fine.largest("sweep_rate"),
        error_estimate=float(whole.worn_volume[reached[-1]]) if reached.size else math.nan,
        last_mission=float(fine.ends[-1]),
        steps=np.diff(fine.ends),
        missions_to_target=target,
        missions_to_target_error=_target_error(mission, target, fine, reference),
        newton_iterations=fine.iterations + reference.iterations,
        run_time=math.nan,
    )


def _errors(mission: Mission, counts: FloatArray, fine: MissionCourse, reference: MissionCourse) -> list[HistoryError]:
    """Errors of the whole wear, and of wear and responses of each block, at the counts (n_output,), the first 0."""
    blocks = list(range(len(mission.blocks)))
    found = []
    for chosen in (blocks, *([place] for place in blocks)):
        outputs, steps = (
            Both(rows, _values_of(chosen, mission.area, fine, rows), _values_of(chosen, mission.area, reference, rows))
            for rows in (counts, fine.ends)
        )
        found.append(history_error(outputs, steps, mission.area))
    # where blocks adapt the pressures of the pairs against each other, two solutions may agree in a pair by chance
    local = np.where(counts[:, None] > 0.0, fine.values_at(counts)["local"], 0.0)
    return [replace(found[0], wear_depth=np.fmax(found[0].wear_depth, local)), *found[1:]]


def _values_of(chosen: list[int], area: FloatArray, course: MissionCourse, missions: FloatArray) -> dict[str, Any]:
    """Wear of some blocks together, and their responses, at numbers of missions, in the terms of a wear history."""
    n, growth, values = missions.size, course.growth_at(missions), course.values_at(missions)
    rates = values["rate"][:, chosen]
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
        "response_peak": values["peak"][:, chosen].reshape(n, -1),
        "response_error": np.fmax.reduce(values["response_error"][:, chosen], axis=1),
    }


def _target_error(mission: Mission, at: float, fine: MissionCourse, reference: MissionCourse) -> float:
    """Estimated error of the number of missions to the target, NaN where it was never reached.

    The rate of the wear is that of the last step.
    """
    if mission.until is None or math.isnan(at):
        return math.nan
    whole, *_ = _errors(mission, np.array([0.0, at]), fine, reference)
    depth = fine.growth_at(np.array([at])).sum(axis=1)[0]
    before, end = fine.nodes[-2:]
    per_mission = (worn_by(mission, end.growth) - worn_by(mission, before.growth)) / (end.mission - before.mission)
    other = reference.missions_to_target(mission)
    return error_of_target(mission.until, at, other, depth, whole, per_mission, mission.area)


def _judged(mission: Mission, fine: MissionCourse, history: MissionHistory) -> Failure:
    """The outcome of a complete history, and its sentence."""
    rtol, held, cut_off = mission.settings.rtol, fine.first_with("held"), fine.first_with("cut_off")
    if cut_off < math.inf:
        return Failure(Outcome.CONTACT_CUT_OFF, describe_cut_off(cut_off).replace("cycle", "mission"))
    inaccurate, outcome, said = fine.largest("inaccurate"), Outcome.CONVERGED, []
    worst = int(np.argmax(inaccurate))
    if history.error_estimate > SENSITIVE_ERROR:
        outcome, last = Outcome.SENSITIVE, np.flatnonzero(np.isfinite(history.worn_volume))[-1]
        volumes = history.worn_volume[last], history.reference_volume[last]
        said.append(describe_uncertain(*volumes, history.error_estimate, rtol, "in coarser steps"))
    elif inaccurate[worst] > 0.0:
        outcome = Outcome.INACCURATE
        said.append(f"in {mission.called(worst)} the vibration {known_to(float(inaccurate[worst]), rtol)}")
    if held < math.inf:
        said.append(f"from mission {held:.0f} on only friction holds the joint in one direction: it is held there")
    for place in np.flatnonzero(history.sweep_rate > LARGEST_SWEEP_RATE):
        name, rate = mission.called(int(place)), history.sweep_rate[place]
        passes = f"passes at {rate:.2g} (zeta f)^2" if np.isfinite(rate) else "has no damping where the joint sticks"
        said.append(f"{name} {passes}: it may wear otherwise than its steady states (see the error)")
    return Failure(outcome, "; ".join(said))
