"""One mission history: integration over the missions, comparison with the reference solution, outcome."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from solver.accuracy.history_error import Both, HistoryError, history_error
from solver.accuracy.target_error import error_of_wear, target_error
from solver.harmonic_balance.state import Failure
from solver.missions.blocks import Mission
from solver.missions.course import MissionCourse, Values
from solver.missions.passage import LARGEST_SWEEP_RATE
from solver.missions.result import MissionHistory
from solver.missions.solutions import MissionSolutions, missions_to_target, worn_by
from solver.model import FloatArray
from solver.outcome import SENSITIVE_ERROR, Outcome, known_to
from solver.packing import Packed, unpack
from solver.results.cut_off import describe_cut_off

ENDS_ALL = (Outcome.TIME_LIMIT, Outcome.EXCEPTION)
"""Outcomes of a reference solution that are those of the history."""


def integrate_missions(
    mission: Mission, keep: Callable[[Packed], None] | None = None, resume: Packed | None = None
) -> MissionHistory:
    """Mission history of one point of a study, as far as computed, with its outcome.

    keep: called after each block with the progress. resume: such progress of an equal mission, which goes on from there
    with a result that is equal to the last bit, except `run_time`.
    """
    solutions = MissionSolutions(mission, keep, None if resume is None else unpack(resume))
    fine = solutions.history()
    reference = MissionCourse.unworn(*fine.nodes[0].growth.shape)
    if len(fine.nodes) > 1 and (fine.failure is None or fine.failure.outcome not in ENDS_ALL):
        reference = solutions.reference(fine)
        if reference.failure is not None and reference.failure.outcome in ENDS_ALL:
            fine = replace(fine, failure=reference.failure)
    history = _assembled(solutions, fine, reference)
    if history.outcome is not Outcome.CONVERGED:
        return history
    failure = _judged(mission, fine, history)
    return replace(history, outcome=failure.outcome, message=failure.message)


def _assembled(solutions: MissionSolutions, fine: MissionCourse, reference: MissionCourse) -> MissionHistory:
    """The result, from both solutions."""
    mission, counts = solutions.mission, np.array(solutions.mission.missions, np.float64)
    area, (growth, values) = mission.area, _read(mission, fine, counts)
    depth, other = growth.sum(axis=1), reference.growth_at(counts).sum(axis=1)
    whole, *blocks = _errors(mission, counts, fine, reference)
    reached = np.flatnonzero(np.isfinite(whole.worn_volume))
    failure, target = fine.failure or Failure(Outcome.CONVERGED), missions_to_target(mission, fine)
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
        reference_volume=other @ area,
        sweep_rate=fine.largest("sweep_rate"),
        error_estimate=float(whole.worn_volume[reached[-1]]) if reached.size else math.nan,
        last_mission=float(fine.ends[-1]),
        steps=np.diff(fine.ends),
        missions_to_target=math.nan if math.isinf(target) else target,
        missions_to_target_error=math.nan if math.isinf(target) else _target_error(mission, fine, reference),
        newton_iterations=fine.iterations + reference.iterations,
        run_time=solutions.spent,
    )


def _read(mission: Mission, course: MissionCourse, missions: FloatArray) -> tuple[FloatArray, Values]:
    """Depths worn by each block (n, n_block, n_contact), m, and other values of a course; NaN beyond its end."""
    n_response = len(mission.blocks[0].model.response_names)
    return course.growth_at(missions), course.values_at(missions, n_response)


def _errors(mission: Mission, counts: FloatArray, fine: MissionCourse, reference: MissionCourse) -> list[HistoryError]:
    """Errors of the whole wear, and of wear and responses of each block, at the counts (n_output,), the first 0."""
    blocks = range(len(mission.blocks))
    read = [(rows, _read(mission, fine, rows), _read(mission, reference, rows)) for rows in (counts, fine.ends)]
    found = []
    for chosen in (list(blocks), *([place] for place in blocks)):
        outputs, steps = (
            Both(rows, _of_blocks(*one, chosen, mission.area), _of_blocks(*other, chosen, mission.area))
            for rows, one, other in read
        )
        found.append(history_error(outputs, steps, mission.area))
    # where blocks adapt the pressures of the pairs against each other, two solutions may agree in a pair by chance
    by_steps = np.fmax(found[0].wear_depth, np.where(counts[:, None] > 0.0, read[0][1][1]["local"], 0.0))
    return [replace(found[0], wear_depth=by_steps), *found[1:]]


def _of_blocks(growth: FloatArray, values: Mapping[str, Any], chosen: list[int], area: FloatArray) -> dict[str, Any]:
    """Wear of some blocks together, and their responses, in the terms of a wear history."""
    n, rates = len(growth), values["rate"][:, chosen]
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


def _target_error(mission: Mission, fine: MissionCourse, reference: MissionCourse) -> float:
    """Estimated error of the number of missions to the target; the rate of the wear is that of the last step."""
    assert mission.until is not None
    at, other = missions_to_target(mission, fine), missions_to_target(mission, reference)
    whole, *_ = _errors(mission, np.array([0.0, at]), fine, reference)
    depth = fine.growth_at(np.array([at])).sum(axis=1)[0]
    volume_error = float(whole.worn_volume[1] * (depth @ mission.area))
    known = error_of_wear(mission.until.quantity, depth, whole.wear_depth[1], volume_error)
    before, end = fine.nodes[-2:]
    per_mission = (worn_by(mission, end.growth) - worn_by(mission, before.growth)) / (end.mission - before.mission)
    return target_error(at, other, known, per_mission)


def _judged(mission: Mission, fine: MissionCourse, history: MissionHistory) -> Failure:
    """The outcome of a complete history, and its sentence."""
    rtol, held, cut_off = mission.settings.rtol, fine.first_with("held"), fine.first_with("cut_off")
    inaccurate, said, remarks = fine.largest("inaccurate"), "", []
    if held < math.inf:
        remarks.append(f"from mission {held:.0f} on only friction holds the joint in one direction: it is held there")
    for place in np.flatnonzero(history.sweep_rate > LARGEST_SWEEP_RATE):
        rate = f"passes at {history.sweep_rate[place]:.2g} (zeta f)^2"
        remarks.append(
            f"{mission.called(int(place))} {rate}: it may wear otherwise than its steady states (see the error)"
        )
    worst, outcome = int(np.argmax(inaccurate)), Outcome.CONVERGED
    if cut_off < math.inf:
        return Failure(Outcome.CONTACT_CUT_OFF, describe_cut_off(cut_off).replace("cycle", "mission"))
    if history.error_estimate > SENSITIVE_ERROR:
        last = np.flatnonzero(np.isfinite(history.worn_volume))[-1]
        volumes = 1e9 * history.worn_volume[last], 1e9 * history.reference_volume[last]
        outcome = Outcome.SENSITIVE
        said = f"worn volume {volumes[0]:.3g} mm3, but {volumes[1]:.3g} mm3 in coarser steps"
    elif inaccurate[worst] > 0.0:
        outcome = Outcome.INACCURATE
        said = f"in {mission.called(worst)} the vibration {known_to(float(inaccurate[worst]), rtol)}"
    return Failure(outcome, "; ".join(filter(None, (said, *remarks))))
