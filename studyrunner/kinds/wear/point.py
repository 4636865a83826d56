"""The result of a point, read from the history that was integrated for it and for points that share it."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from solver.outcome import Outcome
from studyrunner.kinds.results import (
    deepest,
    describe_target,
    first_harmonic,
    motion_of_sectors,
    named,
    wear_of_sectors,
)
from studyrunner.kinds.task import PointResult
from studyrunner.kinds.wear.kind import OF_A_HISTORY
from studyrunner.units import describe_reach

if TYPE_CHECKING:
    from solver.results.history import WearHistory
    from studyrunner.kinds.wear.histories import History, Integrated

_ROUND_OFF = 1e-10
_NO_SLIP = 1e-12  # m, less than the size of an atom


def build_result(
    task: "History",
    integrated: "Integrated",
    history: "WearHistory",
    place: int = 0,
    slips: float = math.nan,
    area: NDArray[np.float64] | None = None,
) -> PointResult:
    """One history of a task at the output counts, with the variables that the task asks for.

    integrated: the history that was integrated. place: number among those that are read from it. slips: amplitude of
    the excitation at which the joint begins to slip, N. area: of all pairs of a ring, m2.

    What is per cycle is per cycle of that history. What came after its last count has no part in it: jumps, errors, the
    end of the integrated history. Effort is that of the integrated history.
    """
    from solver.results.history import judge, last_error  # a run alone needs it, and numba with it

    slower = integrated.wear_coefficients[place] / integrated.wear_coefficients[0] if place else 1.0
    endless = task.to_the_end is not None and not integrated.unworn
    counts = history.cycles if endless else np.array(integrated.counts(task.cycles, place))
    rows = np.arange(counts.size) if endless else np.searchsorted(history.cycles, counts)
    reached = counts <= (1.0 + _ROUND_OFF) * history.last_cycle
    known = rows[reached]
    # another history of the task may go farther
    farthest, whole = (1.0 + _ROUND_OFF) * counts[-1], bool(reached.all())
    jump = history.jump_cycle / slower if endless or history.jump_cycle <= farthest else math.nan
    target, life_error = math.nan, math.nan
    if history.cycles_to_target <= farthest:
        target, life_error = history.cycles_to_target / slower, history.cycles_to_target_error / slower
    # of the integrated history, and of all without a start state
    own_message = place == 0 or not known.size or history.outcome is Outcome.EXCEPTION
    outcome, message = history.outcome, history.message if own_message else ""
    if place > 0 and whole and (not endless or history.outcome.complete):
        # one that was not reached to its end has ended as the integrated history has
        outcome, message = judge(history, known, task.settings.rtol, slower)
    last, end = history.last_cycle / slower, math.inf if task.to_the_end is not None else task.cycles[-1]
    if not endless:
        asked = 0.0 if task.to_the_end is not None else end
        last = asked if whole else min(last, asked)
    if known.size and not outcome.complete:
        reach = describe_reach(last, end, float(history.worn_volume_error[known[-1]]))
        message = "; ".join(filter(None, (message, reach)))
    own: dict[str, Any] = {
        "outcome": int(outcome),
        "jump_cycle": jump,
        "cycles_to_target": target,
        "cycles_to_target_error": life_error,
        "error_estimate": last_error(
            history.cycles[known], history.worn_volume_error[known], history.wear_rate[known], last
        ),
        "slip_amplitude": math.nan if not known.size or history.slip_range[0].max(initial=0.0) > _NO_SLIP else slips,
        "step_limit": history.step_limit / slower,
        "last_cycle": last,
        "largest_wear_depth": float(history.wear_depth[known].max(initial=0.0)) if known.size else math.nan,
        "message": message or (describe_target(task.until, target, "cycle", whole=whole) if known.size else ""),
    }
    of_ring = {}
    if area is not None and task.joint.n_sectors > 1:
        n = task.joint.n_sectors
        of_ring = motion_of_sectors(n, history.response) | wear_of_sectors(n, history.wear_depth, area)
    values = _at_counts(history, of_ring, task.variables, slower, rows, reached) | named(
        tuple(OF_A_HISTORY), own, history
    )
    if integrated.unworn and "dissipated_energy" in values:
        # its state at cycle 0 is that of all cycles
        in_cycle = history.friction_power[0] / history.excitation_frequency[0]
        values["dissipated_energy"] = np.outer(task.cycles, in_cycle)
        values["dissipated_energy_error"] = values["dissipated_energy"] * history.wear_rate_error[0]
    return PointResult(values, place)


def _at_counts(
    history: "WearHistory",
    of_ring: Mapping[str, NDArray[np.float64]],
    names: Sequence[str],
    slower: float,
    rows: NDArray[np.intp],
    reached: NDArray[np.bool_],
) -> dict[str, NDArray[np.generic]]:
    """Variables of the result at rows of the history; NaN, or 0 in whole numbers, where not reached.

    slower: wear coefficient over that of the history.
    """
    with np.errstate(divide="ignore", invalid="ignore"):  # of an unworn joint: `build_result`
        energies = {name: getattr(history, name) / slower for name in ("dissipated_energy", "dissipated_energy_error")}
    own = {
        **of_ring,
        **first_harmonic(history.response),
        **deepest(history.wear_depth, history.wear_depth_error),
        **energies,
        "wear_rate": slower * history.wear_rate,
        "cycle_count": history.cycles / slower,
    }
    known, found = rows[reached], dict[str, NDArray[np.generic]]()
    for name in names:
        if name == "wear_depth_last":
            found[name] = history.wear_depth[known[-1]] if known.size else np.full_like(history.wear_depth[0], np.nan)
            continue
        values = own[name] if name in own else getattr(history, name)
        found[name] = values[np.minimum(rows, len(values) - 1)]
        found[name][~reached] = np.nan if values.dtype.kind == "f" else 0
    return found
