"""Tables of what to beware of: folds and jumps of the branches, steps too long, oscillating wear, unstable states."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from studyrunner.report.drawing import Table
from studyrunner.report.figures.response import folds
from studyrunner.report.reading.result import Result, as_sentences
from studyrunner.report.reading.units import show_cycles, show_number
from studyrunner.system.progress import count

_MOST_ROWS = 20


def list_branches(result: Result) -> Iterator[Table]:
    """Folds that the sweeps jumped over and jumps while wearing; nothing where there are none."""
    rows = [
        ("fold", f"{frequency:.6g} Hz", f"sweep {sweep} jumps to another branch" if sweep else "the sweep jumps")
        for sweep, frequency in folds(result)
    ]
    number = len(rows)
    if result.has("jump_cycle"):
        jumps = result.read("jump_cycle").values
        places = np.argwhere(np.isfinite(jumps))
        number += len(places)
        for place in places[:_MOST_ROWS]:
            at = result.describe(dict(zip(result.axes, map(int, place), strict=True)))
            rows.append(("jump while wearing", show_cycles(float(jumps[tuple(place)])), f"branch lost at {at}"))
    if rows:
        columns = ("what", "where", "meaning")
        yield Table("folds_and_jumps", "Folds and jumps", columns, tuple(rows[:_MOST_ROWS]), _tell_rest(number))


def list_stability(result: Result) -> Iterator[Table]:
    """Points with an explicit step longer than predicted to be stable, an oscillating wear rate, or unstable states."""
    if not result.has("step_limit", "oscillates"):
        return
    limit = result.read("step_limit").values
    # Points that failed count as in the certificates of the run: a step too long may be why they failed.
    oscillates = result.read("oscillates").values != 0
    unstable = np.zeros_like(oscillates)
    if result.has("stable"):
        unstable = (result.read("stable") == 0).any("cycle").transpose(*result.axes).values & result.computed
    step, explicit = _steps(result)
    too_long = explicit & np.isfinite(limit) & (step > limit)
    rows = []
    places = np.argwhere(too_long | oscillates | unstable)
    for place in places[:_MOST_ROWS]:
        at = tuple(place)
        point = dict(zip(result.axes, map(int, place), strict=True))
        rows.append(
            (
                result.describe(point),
                show_number(float(step[at])) if np.isfinite(step[at]) else "",
                show_number(float(limit[at]), 3) if explicit[at] and np.isfinite(limit[at]) else "",
                "yes" if too_long[at] else "",
                "yes" if oscillates[at] else "",
                "yes" if unstable[at] else "",
            )
        )
    if rows:
        counts = [int(np.count_nonzero(what)) for what in (too_long, oscillates, unstable)]
        note = as_sentences(
            f"{count(counts[0], 'point')} with an explicit step longer than step_limit, {counts[1]} with a wear rate"
            f" that oscillates from step to step, {counts[2]} with unstable states",
            "Against the first two, use a smaller step or the implicit scheme",
            _tell_rest(len(places)),
        )
        columns = ("point", "step (cycles)", "step_limit (cycles)", "step too long", "oscillates", "unstable states")
        yield Table("stability", "Stability in slow time", columns, tuple(rows), note)


def _steps(result: Result) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Longest step in cycles and whether the scheme is explicit with this fixed step; both in the shape of the axes."""
    outcome = result.read("outcome")
    shape = outcome.shape
    steps = np.full(shape, np.nan)
    if "step" in outcome.dims:
        # No step is longer than the whole history.
        longest = np.minimum(result.dataset["step"], result.cycles[-1])
        steps = longest.broadcast_like(outcome).transpose(*result.axes).values
    explicit = np.zeros(shape, dtype=bool)
    free = "largest_depth" in result.study.get("slow_time", {})
    if "scheme" in outcome.dims and not free:
        explicit = (result.dataset["scheme"] == "explicit").broadcast_like(outcome).transpose(*result.axes).values
    return steps, explicit


def _tell_rest(number: int) -> str:
    return f"The first {_MOST_ROWS} of {number}; the others are in the file." if number > _MOST_ROWS else ""
