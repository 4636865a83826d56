"""How far the worn volumes of a file are to be trusted, in sentences: within rtol, above it, sensitive, ended early."""

from __future__ import annotations

import numpy as np

from studyrunner.report.reading.result import Result
from studyrunner.report.reading.units import show_cycles
from studyrunner.system.progress import count

_MOST_NAMED = 10


def show_error(error: float) -> str:
    """A relative error: "2.6 %"."""
    return f"{100.0 * error:.2g} %" if error < 1.0 else f"{100.0 * error:.0f} %"


def tell_volumes(result: Result) -> str:
    """How many worn volumes are within rtol, and the worst with its place; empty where the file says nothing of it."""
    known = result.computed & np.isfinite(result.errors)
    if not known.any() or not np.isfinite(result.rtol).any():
        return ""
    n_within = int(np.count_nonzero(known & (result.errors <= result.rtol)))
    several = np.unique(result.rtol[np.isfinite(result.rtol)])
    aim = f"rtol = {show_error(float(several[0]))}" if several.size == 1 else "their rtol"
    text = f"The worn volume of {n_within} of {count(known.size, 'point')} is known within {aim}"
    n_above = int(np.count_nonzero(known)) - n_within
    text += f", of {n_above} less well" if n_above else ""
    n_unknown = int(np.count_nonzero(result.computed & ~known))
    text += f", of {n_unknown} it was never estimated" if n_unknown else ""
    worst = np.where(known, result.errors, -1.0)
    place = np.unravel_index(int(np.argmax(worst)), worst.shape)
    where = result.describe(dict(zip(result.axes, map(int, place), strict=True)))
    return f"{text}; the worst is known to {show_error(float(worst[place]))}, at {where}."


def tell_ends(result: Result) -> str:
    """How many points were computed to the last cycle, how many ended early and how many have no state."""
    n_points, n_computed = result.computed.size, int(np.count_nonzero(result.computed))
    n_early = int(np.count_nonzero(result.held & ~result.computed))
    text = f"{count(n_points, 'point')}, {n_computed} computed to the last cycle"
    text += f", {n_early} ended early and hold what was computed until then" if n_early else ""
    n_without = n_points - n_computed - n_early
    return f"{text}, {n_without} without a result." if n_without else f"{text}."


def describe_ended(result: Result, number: int) -> list[str]:
    """The first points that ended in this way, each with its cycle, its error and its message."""
    found = np.argwhere(result.dataset["outcome"].values == number)
    messages = result.dataset["message"].values if result.has("message") else None
    lines = []
    for index in found[:_MOST_NAMED]:
        place = tuple(index.tolist())
        said = "" if messages is None else str(messages[place])
        if result.held[place] and "cycle" not in said:
            error = float(result.errors[place])
            end = "" if result.computed[place] else f"computed up to {show_cycles(float(result.last_cycle[place]))}"
            known = f"worn volume known to {show_error(error)}" if np.isfinite(error) and error > 0.0 else ""
            said = ", ".join(filter(None, (end, known, said)))
        where = result.describe(dict(zip(result.axes, place, strict=True)))
        lines += [f"{where}: {said}"] if said else []
    if len(found) > _MOST_NAMED and lines:
        lines.append(f"and {len(found) - _MOST_NAMED} more")
    return lines
