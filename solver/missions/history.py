"""One mission history: integration over the missions, comparison with the reference solution, outcome."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from solver.accuracy.history_error import Met
from solver.accuracy.options import ACCURACY
from solver.missions.blocks import Mission
from solver.missions.course import MissionCourse
from solver.missions.one_block import integrate_one_block, is_one_history
from solver.missions.options import MISSIONS
from solver.missions.result import MissionHistory
from solver.missions.solutions import ENDS_ALL, MissionSolutions
from solver.model import FloatArray
from solver.outcome import SENSITIVE_ERROR, Outcome, known_to
from solver.packing import Packed, unpack
from solver.results.cut_off import describe_cut_off
from solver.wear.state import Failure


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
        reference = solutions.reference()
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
    depth, volumes = growth.sum(axis=1), growth @ area
    other = np.full_like(depth, np.nan) if reference is None else reference.growth_at(counts).sum(axis=1)
    relative, of_pairs = _errors(counts, fine, reference, (depth, other), area)
    reached = np.flatnonzero(np.isfinite(relative))
    failure = fine.failure or Failure(Outcome.CONVERGED)
    history = MissionHistory(
        **_responses(mission, counts, fine, reference),
        outcome=failure.outcome,
        message=failure.message,
        missions=counts,
        worn_volume=depth @ area,
        worn_volume_error=relative,
        wear_depth=depth,
        wear_depth_error=of_pairs,
        block_volume=volumes,
        block_volume_error=_block_errors(counts, fine, reference, area),
        excitation_frequency=mission.frequencies,
        reference_volume=other @ area,
        sweep_rate=fine.sweep_rate,
        error_estimate=float(relative[reached[-1]]) if reached.size else math.nan,
        last_mission=float(fine.ends[-1]),
        steps=np.diff(fine.ends),
        missions_to_target=math.nan,
        missions_to_target_error=math.nan,
        newton_iterations=fine.iterations + (0 if reference is None else reference.iterations),
        run_time=solutions.spent,
    )
    target = solutions.missions_to_target(fine)
    if math.isinf(target):
        return history
    return replace(
        history, missions_to_target=target, missions_to_target_error=_target_error(solutions, fine, reference)
    )


def _errors(
    counts: FloatArray,
    fine: MissionCourse,
    reference: MissionCourse | None,
    depths: tuple[FloatArray, FloatArray],
    area: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Estimated errors of the volume (n_output,), relative, and of the depths (n_output, n_contact), m.

    counts (n_output,): missions.
    depths: of history and reference solution at the counts, (n_output, n_contact) each, m.
    """
    depth, other = depths
    volume = depth @ area
    difference = np.fmax(ACCURACY.history_safety * np.abs(depth - other), _order_errors(counts, fine))
    ends = fine.ends
    own = fine.growth_at(ends).sum(axis=1)
    at_ends = np.full_like(own, np.nan) if reference is None else reference.growth_at(ends).sum(axis=1)
    met = Met(ends, np.abs(own - at_ends) @ area)
    error = np.fmax(difference @ area, ACCURACY.history_safety * met.largest_before(counts))
    # the error of the start states remains, even where later states agree by chance
    of_blocks, at_start = fine.growth_at(counts) @ area, _start_errors(fine, reference, area)
    # the error of a block that wears nothing may be unknown
    error = np.fmax(error, np.where(of_blocks > 0.0, np.fmax(of_blocks, 1e-300) * at_start, 0.0).sum(axis=1))
    relative = np.divide(error, volume, out=np.zeros_like(volume), where=volume > 0.0)
    unknown = np.isfinite(volume) & ~np.isfinite(other).all(axis=1) & (volume > 0.0)
    relative[unknown] = np.inf
    relative[~np.isfinite(volume)] = np.nan
    # the rest of the error of the volume is shared by the pairs in proportion to their depth
    rest = relative - np.divide(difference @ area, volume, out=np.zeros_like(volume), where=volume > 0.0)
    with np.errstate(invalid="ignore"):
        of_pairs = difference + np.where(depth > 0.0, rest[:, None] * depth, 0.0)
    of_pairs[unknown] = np.where(depth[unknown] > 0.0, np.inf, 0.0)
    return relative, of_pairs


def _block_errors(
    counts: FloatArray, fine: MissionCourse, reference: MissionCourse | None, area: FloatArray
) -> FloatArray:
    """Estimated relative errors (n_output, n_block) of the worn volumes of the blocks; see `_errors`."""
    growth = fine.growth_at(counts)
    volume = growth @ area
    other = np.full_like(growth, np.nan) if reference is None else reference.growth_at(counts)
    apart = ACCURACY.history_safety * np.abs(growth - other) @ area
    error = np.divide(apart, volume, out=np.zeros_like(volume), where=volume > 0.0)
    error = np.where(volume > 0.0, np.fmax(error, _start_errors(fine, reference, area)), 0.0)
    error[(volume > 0.0) & np.isnan(apart)] = np.inf
    return np.where(np.isfinite(volume), error, np.nan)


def _responses(
    mission: Mission, counts: FloatArray, fine: MissionCourse, reference: MissionCourse | None
) -> dict[str, Any]:
    """Responses of the result, with the errors of their states and their difference to the reference solution."""
    if len(fine.nodes) < 2:
        nothing = np.full((counts.size, len(mission.blocks), len(mission.blocks[0].model.response_names)), np.nan)
        names = ("response_begin", "response_end", "response_peak_begin", "response_peak_end")
        return dict.fromkeys(names, nothing) | {"response_error": nothing[:, :, 0]}
    found = fine.responses_at(counts)
    if reference is None or len(reference.nodes) < 2:
        unknown = np.where(np.isnan(found["response_error"]), np.nan, np.inf)
        return found | {"response_error": unknown}
    other, error = reference.responses_at(counts), found["response_error"]
    for name in found:
        if name == "response_error":
            continue
        size = np.linalg.norm(found[name], axis=2)
        apart = ACCURACY.history_safety * np.linalg.norm(found[name] - other[name], axis=2)
        apart[np.isfinite(size) & np.isnan(apart)] = np.inf
        error = np.fmax(error, np.divide(apart, size, out=np.zeros_like(size), where=size > 0.0))
    return found | {"response_error": error}


def _order_errors(counts: FloatArray, fine: MissionCourse) -> FloatArray:
    """Error of the depths (n_output, n_contact), m, by the order of the blocks in the step that contains each count.

    The next steps wear such a difference away where it is large: it does not add up. Its square, relative to the wear
    of a step, does; the reference solution shows that.
    """
    place = np.clip(np.searchsorted(fine.ends, counts, "left"), 0, len(fine.nodes) - 1)
    none = np.zeros(fine.nodes[0].growth.shape[1])
    return np.array([none if (error := fine.nodes[at].error) is None else error for at in place])


def _start_errors(fine: MissionCourse, reference: MissionCourse | None, area: FloatArray) -> FloatArray:
    """Relative errors (n_block,) of the wear rates at the starts of the blocks in the first mission."""
    errors = np.nan_to_num(fine.start_errors, nan=0.0, posinf=np.inf)
    if reference is None:
        return errors
    rates = fine.start_rates @ area
    apart = np.abs(fine.start_rates - reference.start_rates) @ area
    difference = np.divide(apart, rates, out=np.zeros_like(rates), where=rates > 0.0)
    return np.asarray(np.fmax(errors, difference))


def _target_error(solutions: MissionSolutions, fine: MissionCourse, reference: MissionCourse | None) -> float:
    """Estimated error of the number of missions to the target: the difference to that of the reference solution.

    At least the error of the volume there, taken at the mean rate of the last step.
    """
    at = np.array([solutions.missions_to_target(fine)])
    if reference is None:
        return math.inf
    other = solutions.missions_to_target(reference)
    depths = fine.growth_at(at).sum(axis=1), reference.growth_at(at).sum(axis=1)
    relative, _ = _errors(at, fine, reference, depths, solutions.mission.area)
    before, end = fine.nodes[-2:]
    worn = [solutions.worn(node.growth) for node in (before, end)]
    per_mission = (worn[1] - worn[0]) / (end.mission - before.mission)
    assert solutions.mission.until is not None
    by_volume = float(relative[0]) * solutions.mission.until.value / per_mission
    return max(by_volume, ACCURACY.history_safety * abs(other - float(at[0])) if math.isfinite(other) else 0.0)


def _judged(mission: Mission, fine: MissionCourse, history: MissionHistory) -> Failure:
    """The outcome of a complete history, and its sentence."""
    rtol, error = mission.settings.rtol, history.error_estimate
    remarks = []
    if not math.isnan(fine.held):
        remarks.append(
            f"from mission {fine.held:.0f} on only friction holds the joint in one direction: it is held there"
        )
    for place in np.flatnonzero(fine.sweep_rate > MISSIONS.largest_sweep_rate):
        too_fast = "too fast for the steady states that it is computed from: its sweep rate over (zeta f)^2 is"
        remarks.append(f"{_called(mission, int(place))} is {too_fast} {fine.sweep_rate[place]:.2g}")
    if not math.isnan(fine.cut_off):
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
        said = f"in {_called(mission, worst)} the vibration {known_to(float(fine.inaccurate[worst]), rtol)}"
        return Failure(Outcome.INACCURATE, "; ".join((said, *remarks)))
    return Failure(Outcome.CONVERGED, "; ".join(remarks))


def _called(mission: Mission, place: int) -> str:
    """Name of a block in messages."""
    return mission.blocks[place].name or f"block {place + 1}"
