"""One mission history: integration over the missions, comparison with the reference solution, outcome."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.accuracy.history_error import Both, HistoryError, history_error
from solver.accuracy.target_error import error_of_wear, target_error
from solver.harmonic_balance.state import Failure
from solver.missions.blocks import Mission
from solver.missions.course import RESPONSES, MissionCourse
from solver.missions.one_block import integrate_one_block, is_one_history
from solver.missions.options import MISSIONS
from solver.missions.result import MissionHistory
from solver.missions.solutions import MissionSolutions
from solver.model import FloatArray
from solver.outcome import SENSITIVE_ERROR, Outcome, known_to
from solver.packing import Packed, unpack
from solver.results.cut_off import describe_cut_off

ENDS_ALL = (Outcome.TIME_LIMIT, Outcome.EXCEPTION)
"""Outcomes of a reference solution that are those of the history."""


def integrate_missions(
    mission: Mission, keep: Callable[[Packed], None] | None = None, resume: Packed | None = None
) -> MissionHistory:
    """Mission history of one point of a study.

    Parameters
    ----------
    mission
        Blocks, counts, settings and wear law.
    keep
        Called after each block with the progress.
    resume
        Progress, as given to `keep`, of an equal mission, which goes on from there. The result is equal to the last
        bit, except `run_time`.

    Returns
    -------
    MissionHistory
        The history as far as computed, with its outcome. A history that fails raises no error.
    """
    if is_one_history(mission):
        return integrate_one_block(mission, keep, resume)
    solutions = MissionSolutions(mission, keep, None if resume is None else unpack(resume))
    fine = solutions.history()
    reference = None
    if len(fine.nodes) > 1 and (fine.failure is None or fine.failure.outcome not in ENDS_ALL):
        reference = solutions.reference(fine)
        if reference.failure is not None and reference.failure.outcome in ENDS_ALL:
            fine = replace(fine, failure=reference.failure)
    history = _assembled(solutions, fine, reference)
    if history.outcome is not Outcome.CONVERGED:
        return history
    failure = _judged(mission, fine, history)
    return replace(history, outcome=failure.outcome, message=failure.message)


def _assembled(solutions: MissionSolutions, fine: MissionCourse, reference: MissionCourse | None) -> MissionHistory:
    """The result, from both solutions."""
    mission, counts = solutions.mission, np.array(solutions.mission.missions, np.float64)
    area, growth = mission.area, fine.growth_at(counts)
    depth, values = growth.sum(axis=1), _values(mission, fine, counts)
    whole, *blocks = _errors(mission, counts, fine, reference)
    other = np.full_like(depth, np.nan) if reference is None else reference.growth_at(counts).sum(axis=1)
    reached = np.flatnonzero(np.isfinite(whole.worn_volume))
    failure = fine.failure or Failure(Outcome.CONVERGED)
    target = solutions.missions_to_target(fine)
    return MissionHistory(
        **{name: values[name] for name in RESPONSES},
        response_error=np.array([each.response for each in blocks]).T,
        excitation_frequency=mission.frequencies,
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
        sweep_rate=fine.sweep_rate,
        error_estimate=float(whole.worn_volume[reached[-1]]) if reached.size else math.nan,
        last_mission=float(fine.ends[-1]),
        steps=np.diff(fine.ends),
        missions_to_target=math.nan if math.isinf(target) else target,
        missions_to_target_error=math.nan if math.isinf(target) else _target_error(solutions, fine, reference),
        newton_iterations=fine.iterations + (0 if reference is None else reference.iterations),
        run_time=solutions.spent,
    )


def _errors(
    mission: Mission, counts: FloatArray, fine: MissionCourse, reference: MissionCourse | None
) -> list[HistoryError]:
    """Errors of the whole wear, and of wear and responses of each block, at the counts (n_output,), the first 0."""
    area, blocks = mission.area, range(len(mission.blocks))
    at = {"outputs": counts, "steps": fine.ends}
    read = {name: (_read(mission, fine, rows), _read(mission, reference, rows)) for name, rows in at.items()}
    found = []
    for chosen in (list(blocks), *([place] for place in blocks)):
        outputs, steps = (
            Both(at[name], *(_of_blocks(growth, values, chosen, area) for growth, values in read[name])) for name in at
        )
        found.append(history_error(outputs, steps, area, "adaptive"))
    # where blocks adapt the pressures of the pairs against each other, two solutions may agree in a pair by chance
    by_steps = np.fmax(found[0].wear_depth, read["outputs"][0][1]["local"])
    return [replace(found[0], wear_depth=by_steps), *found[1:]]


def _read(
    mission: Mission, course: MissionCourse | None, missions: FloatArray
) -> tuple[FloatArray, dict[str, NDArray[Any]]]:
    """Depths worn by each block (n, n_block, n_contact), m, and other values of a course; NaN where there is none."""
    shape = len(mission.blocks), mission.area.size
    if course is None:
        return np.full((missions.size, *shape), np.nan), _values(mission, MissionCourse.begun(*shape), missions)
    return course.growth_at(missions), _values(mission, course, missions)


def _values(mission: Mission, course: MissionCourse, counts: FloatArray) -> dict[str, NDArray[Any]]:
    """Values of a course at the counts; NaN where no mission was computed."""
    responses = len(mission.blocks), len(mission.blocks[0].model.response_names)
    shapes = dict.fromkeys(RESPONSES, responses) | {"rate": course.nodes[0].growth.shape, "local": (mission.area.size,)}
    shapes |= dict.fromkeys(("response_error", "growth_error"), (len(mission.blocks),))
    unknown = {name: np.full((counts.size, *shape), np.nan) for name, shape in shapes.items()}
    return unknown | course.values_at(counts)


def _of_blocks(
    growth: FloatArray, values: dict[str, NDArray[Any]], chosen: list[int], area: FloatArray
) -> dict[str, NDArray[Any]]:
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
        "response": np.concatenate([values[name][:, chosen].reshape(n, -1) for name in RESPONSES[:2]], axis=1),
        "response_peak": np.concatenate([values[name][:, chosen].reshape(n, -1) for name in RESPONSES[2:]], axis=1),
        "response_error": np.fmax.reduce(values["response_error"][:, chosen], axis=1),
    }


def _target_error(solutions: MissionSolutions, fine: MissionCourse, reference: MissionCourse | None) -> float:
    """Estimated error of the number of missions to the target; the rate of the wear is that of the last step."""
    until, area = solutions.mission.until, solutions.mission.area
    if reference is None or until is None:
        return math.inf
    at, other = solutions.missions_to_target(fine), solutions.missions_to_target(reference)
    whole, *_ = _errors(solutions.mission, np.array([0.0, at]), fine, reference)
    depth = fine.growth_at(np.array([at])).sum(axis=1)[0]
    known_to = error_of_wear(until.quantity, depth, whole.wear_depth[1], float(whole.worn_volume[1] * (depth @ area)))
    before, end = fine.nodes[-2:]
    per_mission = (solutions.worn(end.growth) - solutions.worn(before.growth)) / (end.mission - before.mission)
    return target_error(at, other, known_to, per_mission)


def _judged(mission: Mission, fine: MissionCourse, history: MissionHistory) -> Failure:
    """The outcome of a complete history, and its sentence."""
    rtol, error = mission.settings.rtol, history.error_estimate
    remarks = []
    if fine.held < math.inf:
        remarks.append(
            f"from mission {fine.held:.0f} on only friction holds the joint in one direction: it is held there"
        )
    for place in np.flatnonzero(fine.sweep_rate > MISSIONS.largest_sweep_rate):
        rate = f"passes at {fine.sweep_rate[place]:.2g} (zeta f)^2"
        remarks.append(
            f"{mission.called(int(place))} {rate}: it may wear otherwise than its steady states (see the error)"
        )
    if fine.cut_off < math.inf:
        return Failure(Outcome.CONTACT_CUT_OFF, describe_cut_off(fine.cut_off).replace("cycle", "mission"))
    if error > SENSITIVE_ERROR:
        volumes = [
            1e9 * float(values[np.isfinite(history.worn_volume)][-1])
            for values in (history.worn_volume, history.reference_volume)
        ]
        said = f"worn volume {volumes[0]:.3g} mm3, but {volumes[1]:.3g} mm3 in coarser steps"
        return Failure(Outcome.SENSITIVE, "; ".join((said, *remarks)))
    worst = int(np.argmax(fine.inaccurate))
    if fine.inaccurate[worst] > 0.0:
        said = f"in {mission.called(worst)} the vibration {known_to(float(fine.inaccurate[worst]), rtol)}"
        return Failure(Outcome.INACCURATE, "; ".join((said, *remarks)))
    return Failure(Outcome.CONVERGED, "; ".join(remarks))
