"""Bands of the worn volume of samples, over the cycles and over the frequency."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from studyrunner.report.drawing import COLOURS, Drawing, add_legend, set_from_zero
from studyrunner.report.figures.frequency_course import Course
from studyrunner.report.figures.volume import slow_time
from studyrunner.report.reading.result import Result, as_sentences
from studyrunner.report.reading.units import Scale, scale_for
from studyrunner.report.scatter.points import HIGHEST, LOWEST, Shown, choose_points, ends, largest, last_of, panel_grid
from studyrunner.system.progress import count

_NAME = "worn_volume_quantile"
_MIDDLE = 2
_PAIRS: tuple[tuple[int, int, float, str], ...] = ((0, 4, 0.18, "5 to 95 %"), (1, 3, 0.32, "25 to 75 %"))
"""Quantiles between which a band lies, how dark it is, and what it is called."""
_NOT_NEGLIGIBLE = 1e-3


def draw_over_cycles(result: Result, statistics: xr.Dataset) -> Drawing:
    """5, 25, 50, 75 and 95 % of the samples over the cycles, one panel a combination of the other axes."""
    shown = choose_points(result, statistics)
    counts = statistics["cycle"].values.astype(float)
    cycles = scale_for(result.counted, counts)
    volumes = [ends(point, _NAME, "cycle", "quantile") for point in shown.statistics]
    scale = scale_for("m3", *(each[..., LOWEST] for each in volumes))
    figure, panels = panel_grid(len(volumes), 3.0, sharex=True, sharey=True)
    for panel, (_, label, point) in zip(panels.flat, shown, strict=True):
        _draw_bands(panel, cycles(counts), point, "cycle", scale)
        panel.set_title(label)
    for panel in panels[-1]:
        panel.set_xlabel(cycles.label(slow_time(result)))
    _set_axes(panels, cycles(counts), scale, _highest(volumes, shown, "cycle"))
    add_legend(figure)
    text = as_sentences(
        f"Worn volume of {count(int(statistics['n_samples']), 'sample')} over {result.counted}: so much is worn at most"
        " in 5, 25, 50, 75 and 95 % of them",
        *_tell_last(shown, scale),
        *_tell_marks(shown, "cycle"),
        shown.sentence,
    )
    return Drawing("worn_volume_bands", f"Worn volume of the samples over {result.counted}", text, figure)


def draw_over_course(result: Result, statistics: xr.Dataset, course: Course) -> Drawing:
    """As `draw_over_cycles`, at the last cycle count over the frequency."""
    last = last_of(statistics).isel({course.axis: course.index})
    shown = choose_points(result, last, [course.axis])
    volumes = [ends(point, _NAME, course.axis, "quantile") for point in shown.statistics]
    scale = scale_for("m3", *(each[..., LOWEST] for each in volumes))
    figure, panels = panel_grid(len(volumes), 3.0, sharex=True, sharey=True)
    for panel, (_, label, point) in zip(panels.flat, shown, strict=True):
        _draw_bands(panel, course.values, point, course.axis, scale)
        panel.set_title(label)
    for panel in panels[-1]:
        course.set_axis(panel)
    _set_axes(panels, course.values, scale, _highest(volumes, shown, course.axis))
    add_legend(figure)
    text = as_sentences(
        f"Worn volume {result.when(-1)} of {count(int(statistics['n_samples']), 'sample')} over {course.name}: so much"
        " is worn at most in 5, 25, 50, 75 and 95 % of them",
        *_tell_marks(shown, course.axis),
        shown.sentence,
    )
    title = f"Worn volume of the samples over {course.name}"
    return Drawing("worn_volume_bands_course", title, text, figure)


def _draw_bands(panel: Axes, at: NDArray[np.float64], point: xr.Dataset, axis: str, scale: Scale) -> None:
    """Bands and median along an axis; dashed the outer ends with the numerical error, hatched what is open."""
    volume, wrong = ends(point, _NAME, axis, "quantile"), ends(point, f"{_NAME}_error", axis, "quantile")
    roof = 10.0 * max(largest(volume), 1e-30)
    drawn = scale(np.minimum(volume, roof))
    for low, high, alpha, label in _PAIRS:
        panel.fill_between(
            at, drawn[:, low, LOWEST], drawn[:, high, HIGHEST], color=COLOURS[0], alpha=alpha, lw=0.0, label=label
        )
    marker = "o" if at.size <= 12 else ""
    panel.plot(at, drawn[:, _MIDDLE, LOWEST], color=COLOURS[0], marker=marker, label="median")
    open_ended = volume[..., HIGHEST] > volume[..., LOWEST]
    for number in np.flatnonzero(open_ended.any(axis=0)).tolist():
        panel.fill_between(
            at,
            drawn[:, number, LOWEST],
            drawn[:, number, HIGHEST],
            facecolor="none",
            edgecolor="0.45",
            hatch="////",
            lw=0.0,
            label="left open",
        )
    if _has_error(volume, wrong):
        style: dict[str, Any] = {"color": COLOURS[1], "linestyle": (0, (4, 2)), "linewidth": 1.0}
        panel.plot(at, scale(wrong[:, 0, LOWEST]), **style, label="with numerical error")
        panel.plot(at, scale(np.where(np.isfinite(wrong), wrong, np.nan)[:, -1, HIGHEST]), **style)


def _has_error(volume: NDArray[np.float64], wrong: NDArray[np.float64]) -> bool:
    """Whether a numerical error is seen beside what samples without a value leave open."""
    known = np.isfinite(wrong) & np.isfinite(volume)
    moved = np.abs(wrong[known] - volume[known])
    return bool((moved > _NOT_NEGLIGIBLE * largest(volume)).any())


def _highest(volumes: list[NDArray[np.float64]], shown: Shown, axis: str) -> float:
    """How high panels reach: errors and what is open count to twice what is known."""
    known = largest(*(each[..., LOWEST] for each in volumes))
    wrong = largest(*(ends(point, f"{_NAME}_error", axis, "quantile") for point in shown.statistics))
    return min(max(known, wrong, largest(*volumes)), 2.0 * known)


def _set_axes(panels: NDArray[Any], at: NDArray[np.float64], scale: Scale, highest: float) -> None:
    for row in panels:
        row[0].set_ylabel(scale.label("worn volume"))
    panels[0, 0].set_xlim(at.min(), at.max())
    set_from_zero(panels[0, 0], scale(highest).item())


def _tell_last(shown: Shown, scale: Scale) -> list[str]:
    """Quantiles at the last cycle count of each panel, with their confidence intervals."""
    found = []
    for _, label, point in shown:
        last = last_of(point)
        value, interval = ends(last, _NAME, "quantile"), ends(last, f"{_NAME}_interval", "quantile")
        told = [
            f"{100.0 * probability:g} % {_range(scale, *value[number])} ({_range(scale, *interval[number])})"
            for number, probability in enumerate(last["quantile"].values)
            if number in (0, _MIDDLE, len(value) - 1)
        ]
        found.append(f"{f'At {label}' if label else 'In the end'}: {', '.join(told)}")
    confidence = float(shown.statistics[0].attrs.get("confidence", 0.0))
    return [*found, f"In brackets: {100.0 * confidence:g} % confidence interval"]


def _range(scale: Scale, low: float, high: float) -> str:
    if np.isinf(high):
        return f"above {scale.show(low)}"
    return scale.show(low) if low == high else f"{scale.show(low)} to {scale.show(high)}"


def _tell_marks(shown: Shown, axis: str) -> list[str]:
    """What dashed lines and hatched areas are; that errors are not known where they are not."""
    found = []
    volumes = [ends(point, _NAME, axis, "quantile") for point in shown.statistics]
    wrong = [ends(point, f"{_NAME}_error", axis, "quantile") for point in shown.statistics]
    if any(map(_has_error, volumes, wrong)):
        found.append("Dashed: 5 and 95 %, with every sample less or more its numerical error")
    if any(np.isinf(each)[np.isfinite(volume)].any() for each, volume in zip(wrong, volumes, strict=True)):
        found.append("The numerical error of some samples was never estimated")
    if any((each[..., HIGHEST] > each[..., LOWEST]).any() for each in volumes):
        n_without = max(int(point["n_without_value"].max()) for point in shown.statistics)
        found.append(
            f"Hatched: what up to {count(n_without, 'sample')} without a value to be trusted leave open, each of them"
            " taken as low and as high as it may be"
        )
    return found
