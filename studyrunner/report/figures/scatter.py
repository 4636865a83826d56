"""Figures of studies with samples: bands of the worn volume, its exceedance, and what decides it."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Collection
from functools import wraps
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from studyrunner.report.drawing import Drawn
from studyrunner.report.panels import (
    COLOURS,
    FloatArray,
    add_legend,
    label_outer,
    line_style,
    new_panels,
    set_from_zero,
)
from studyrunner.report.selection import choose, find_course, slow_time
from studyrunner.result.units import Scale, scale_for
from studyrunner.result.view import NO_VOLUME, Point, Result, as_sentences
from studyrunner.statistics.samples import DRAWN, SAMPLE
from studyrunner.statistics.sentence import deciding_input, describe_ranking, leading_input, measure_of
from studyrunner.system.progress import count

_Shown = list[tuple[Point, str, xr.Dataset]]
"""Combinations of the axes beside the samples with their labels and statistics."""
_Draw = Callable[[Result, xr.Dataset], Drawn]

_MOST_PANELS, _MOST_LINES = 4, 3
_LOWEST, _HIGHEST = 0, 1  # places along the dimension `bound`
# quantiles between which a band lies, how dark it is, and what it is called
_BANDS: tuple[tuple[int, int, float, str], ...] = ((0, 4, 0.18, "5 to 95 %"), (1, 3, 0.32, "25 to 75 %"))
_MIDDLE = 2
_NOT_NEGLIGIBLE = 1e-3
_CHARACTERS = 80  # of titles over panels side by side
_EXCEEDED = (
    ("worn_volume_exceedance", "exceeded_volume", "m3", "worn volume"),
    ("wear_depth_exceedance", "exceeded_depth", "m", "largest wear depth"),
)
# name, marker and number of the colour of samples, by what `groups_of` says
_GROUPS = (("samples", "o", 0), ("lower group", "o", 0), ("upper group", "s", 1), ("between", "D", 3))


def _of_samples(draw: _Draw) -> Callable[[Result], Drawn]:
    """A figure of the statistics of a result; nothing where it has no samples, or nothing is worn."""

    @wraps(draw)
    def drawn(result: Result) -> Drawn:
        if SAMPLE not in result.varying or not result.has("worn_volume"):
            return None
        worn = float(result.read("worn_volume").max()) > NO_VOLUME
        return draw(result, result.statistics) if worn and result.statistics is not None else None

    return drawn


def _choose(
    result: Result, statistics: xr.Dataset, free: Collection[str] = (), limit: int = _MOST_PANELS
) -> tuple[_Shown, str]:
    """Combinations of the axes beside samples and `free`, at most `limit`, and a sentence on those left out."""
    choice = choose(result, [SAMPLE, *free], limit)
    return [(point, label, statistics.isel(point, missing_dims="ignore")) for point, label in choice], choice.sentence


def _ends(statistics: xr.Dataset, name: str, *dims: str) -> FloatArray:
    """A statistic (dims..., 2): its lowest and its highest value."""
    return np.asarray(statistics[name].transpose(*dims, "bound").values, dtype=float)


def _largest(*values: FloatArray) -> float:
    return max((float(each[np.isfinite(each)].max(initial=0.0)) for each in values), default=0.0)


def _panel_grid(shown: _Shown, height: float, sharex: bool = False) -> tuple[Figure, NDArray[Any]]:
    """A figure and its panels (rows, columns) with the labels, two by two where there are four, else side by side."""
    n_columns = 2 if len(shown) == _MOST_PANELS else len(shown)
    n_rows = -(-len(shown) // n_columns)
    figure, panels = new_panels(n_rows, n_columns, 0.5 + height * n_rows, sharex=sharex, sharey=True)
    for panel, (_, label, _) in zip(panels.flat, shown, strict=True):
        panel.set_title(textwrap.fill(label, _CHARACTERS // n_columns))
    return figure, panels


@_of_samples
def draw_bands(result: Result, statistics: xr.Dataset) -> Drawn:
    """5, 25, 50, 75 and 95 % of the samples over the cycles."""
    return _draw_bands(result, statistics, "") if statistics.sizes["cycle"] > 1 else None


@_of_samples
def draw_bands_over_course(result: Result, statistics: xr.Dataset) -> Drawn:
    """5, 25, 50, 75 and 95 % of the samples at the last count over the course."""
    course = find_course(result)
    if course is None:
        return None
    return _draw_bands(result, statistics.isel(cycle=-1).isel({course.axis: course.index}), course.axis)


def _draw_bands(result: Result, statistics: xr.Dataset, over: str) -> Drawn:
    """over: axis of the study, empty for slow time."""
    name, course = "worn_volume_quantile", find_course(result, over) if over else None
    shown, left_out = _choose(result, statistics, [over] if over else [])
    counts = statistics["cycle"].values.astype(float)
    cycles, axis = scale_for(result.counted, counts), over or "cycle"
    at = course.values if course else cycles(counts)
    volumes = [_ends(point, name, axis, "quantile") for _, _, point in shown]
    wrong = [_ends(point, f"{name}_error", axis, "quantile") for _, _, point in shown]
    known = _largest(*(each[..., _LOWEST] for each in volumes))
    scale = scale_for("m3", known)
    figure, panels = _panel_grid(shown, 3.0, sharex=True)
    for panel, volume, error in zip(panels.flat, volumes, wrong, strict=True):
        _draw_band(panel, at, volume, error, scale)
        panel.set_xlabel(slow_time(result, cycles))
        if course:
            course.set_axis(panel)
        panel.set_ylabel(scale.label("worn volume"))
    label_outer(panels)
    panels[0, 0].set_xlim(at.min(), at.max())
    # errors and what is open count to twice what is known
    set_from_zero(panels[0, 0], scale(min(max(known, _largest(*wrong, *volumes)), 2.0 * known)).item())
    add_legend(figure)
    n_without = max(int(point["n_without_value"].max()) for _, _, point in shown)
    return figure, as_sentences(
        f"{count(int(statistics['n_samples']), 'sample')}: so much is worn at most in 5, 25, 50, 75 and 95 % of them",
        *(_tell_last(shown, scale) if course is None else []),
        "Dashed: 5 and 95 %, with every sample less or more its numerical error",
        f"Hatched: what {count(n_without, 'sample')} without a value to be trusted leave open" if n_without else "",
        left_out,
    )


def _draw_band(panel: Axes, at: FloatArray, volume: FloatArray, wrong: FloatArray, scale: Scale) -> None:
    """Bands and median along an axis; dashed the outer ends with the numerical error, hatched what is open."""
    drawn = scale(np.minimum(volume, 10.0 * max(_largest(volume), 1e-30)))
    for low, high, alpha, label in _BANDS:
        style: dict[str, Any] = {"color": COLOURS[0], "alpha": alpha, "lw": 0.0, "label": label}
        panel.fill_between(at, drawn[:, low, _LOWEST], drawn[:, high, _HIGHEST], **style)
        for place, bound in ((low, _LOWEST), (high, _HIGHEST)):
            panel.plot(at, drawn[:, place, bound], color=COLOURS[0], lw=0.5, alpha=0.5, label=f"_{label}")
    panel.plot(at, drawn[:, _MIDDLE, _LOWEST], color=COLOURS[0], marker="o" if at.size <= 12 else "", label="median")
    for number in np.flatnonzero((volume[..., _HIGHEST] > volume[..., _LOWEST]).any(axis=0)).tolist():
        style = {"facecolor": "none", "edgecolor": "0.45", "hatch": "////", "lw": 0.0, "label": "left open"}
        panel.fill_between(at, drawn[:, number, _LOWEST], drawn[:, number, _HIGHEST], **style)
    moved = np.abs(wrong - volume)[np.isfinite(wrong) & np.isfinite(volume)]
    if (moved > _NOT_NEGLIGIBLE * _largest(volume)).any():
        style = {"color": COLOURS[1], "linestyle": (0, (4, 2)), "linewidth": 1.0}
        panel.plot(at, scale(wrong[:, 0, _LOWEST]), **style, label="with numerical error")
        panel.plot(at, scale(np.where(np.isfinite(wrong), wrong, np.nan)[:, -1, _HIGHEST]), **style)


def _tell_last(shown: _Shown, scale: Scale) -> list[str]:
    """Quantiles at the last cycle count of each panel, with their confidence intervals."""
    found = []
    for _, label, point in shown:
        last = point.isel(cycle=-1)
        value, interval = (_ends(last, f"worn_volume_quantile{each}", "quantile") for each in ("", "_interval"))
        told = [
            f"{100.0 * probability:g} % {_range(scale, *value[number])} ({_range(scale, *interval[number])})"
            for number, probability in enumerate(last["quantile"].values)
            if number in (0, _MIDDLE, len(value) - 1)
        ]
        found.append(f"{f'At {label}' if label else 'In the end'}: {', '.join(told)}")
    return [*found, f"In brackets: {100.0 * float(shown[0][2].attrs['confidence']):g} % confidence interval"]


def _range(scale: Scale, low: float, high: float) -> str:
    if np.isinf(high):
        return f"above {scale.show(low)}"
    return scale.show(low) if low == high else f"{scale.show(low)} to {scale.show(high)}"


@_of_samples
def draw_exceedance(result: Result, statistics: xr.Dataset) -> Drawn:
    """Probability of more than a volume, and of deeper than a depth, with its confidence band."""
    last = statistics.isel(cycle=-1)
    shown, left_out = _choose(result, last, limit=_MOST_LINES)
    held = [one for one in _EXCEEDED if one[0] in last]
    figure, panels = new_panels(1, len(held), 3.2, sharey=True)
    for panel, (name, dimension, units, words) in zip(panels[0], held, strict=True):
        scale = scale_for(units, last[dimension].values)
        for number, (_, label, point) in enumerate(shown):
            at, style = scale(point[dimension].values), line_style(number)
            value, interval = (_ends(point, f"{name}{each}", dimension) for each in ("", "_interval"))
            panel.fill_between(at, *interval.T, color=style["color"], alpha=0.18, lw=0.0)
            for bound in (_LOWEST, _HIGHEST) if (np.ptp(value, axis=1) > 0.0).any() else (_LOWEST,):
                own = {"color": style["color"], "linestyle": style["linestyle"]}
                panel.plot(at, value[:, bound], **own, label="_" if bound else label or "samples")
        panel.set(xlabel=scale.label(words), ylabel="probability of more", ylim=(0.0, 1.02))
        panel.set_xlim(0.0, scale(last[dimension].values[-1]).item())
    label_outer(panels)
    add_legend(figure)
    return figure, as_sentences(
        f"Probability that more is worn than a volume {result.when(-1)}"
        + (", and that a pair is worn deeper than a depth until then" if len(held) > 1 else "")
        + f", from {count(int(last['n_samples']), 'sample')}",
        f"Bands: {100.0 * float(last.attrs['confidence']):g} % confidence",
        "Where two lines are alike, samples without a value leave open what is between them",
        left_out,
    )


@_of_samples
def draw_deciding_inputs(result: Result, statistics: xr.Dataset) -> Drawn:
    """What each input decides at the last cycle count: Sobol' indices, or rank correlations, with their intervals."""
    last = statistics.isel(cycle=-1)
    measure = measure_of(last)
    if "input" not in last.dims:
        return None
    if measure is None or not last[measure].notnull().any():
        return "The file holds too few samples to say what decides, or samples that do not differ: raise samples."
    shares = measure == "first_index"
    bars = {"first_index": "alone", "total_index": "with the others"} if shares else {measure: "rank correlation"}
    shown, left_out = _choose(result, last)
    figure, panels = _panel_grid(shown, 2.9, sharex=True)
    for panel, (_, _, point) in zip(panels.flat, shown, strict=True):
        for place, (name, words) in enumerate(bars.items()):
            value, interval = (_ends(point, f"{name}{each}", "input") for each in ("", "_interval"))
            width = 0.72 / len(bars)
            at, middle = np.arange(len(value)) + (place - 0.5 * (len(bars) - 1)) * 1.1 * width, value.mean(axis=1)
            panel.bar(at, np.nan_to_num(middle), width, color=COLOURS[place])
            panel.plot(at, middle, color=COLOURS[place], marker="s", linestyle="none", label=words)
            sides = np.maximum(np.stack([middle - interval[:, _LOWEST], interval[:, _HIGHEST] - middle]), 0.0)
            panel.errorbar(at, middle, yerr=np.nan_to_num(sides), fmt="none", ecolor="0.2", elinewidth=1.0, capsize=3.0)
        panel.set_xticks(range(len(value)), [str(name).replace("_", "\n") for name in point["input"].values])
        panel.set_ylim(0.0 if shares else -1.02, 1.02)
        panel.set_ylabel("share of the variance" if shares else "rank correlation")
        panel.grid(visible=False, axis="x")
    label_outer(panels)
    add_legend(figure)
    what = (
        "Share of the variance that each input decides, alone and with the others: first and total Sobol' index"
        if shares
        else "1 or -1 where the volume rises or falls with this input alone; an effect that rises and falls is not seen"
    )
    intervals = f"Lines: {100.0 * float(last.attrs['confidence']):g} % confidence intervals"
    return figure, as_sentences(*_tell_rankings(shown), what, intervals, left_out)


def _tell_rankings(shown: _Shown) -> list[str]:
    """Which input decides most, or that this is not known, of each combination."""
    told = [(label, describe_ranking(point)) for _, label, point in shown]
    return [f"{label}: {says}" if label else says[0].upper() + says[1:] for label, says in told if says]


@_of_samples
def draw_deciding_input(result: Result, statistics: xr.Dataset) -> Drawn:
    """Worn volumes at the last count over the input with the largest index."""
    last = statistics.isel(cycle=-1)
    if "input" not in last.dims:
        return None
    shown, left_out = _choose(result, last)
    scale = scale_for("m3", result.worn)
    figure, panels = _panel_grid(shown, 3.0)
    highest = 0.0
    for panel, (point, _, found) in zip(panels.flat, shown, strict=True):
        highest = max(highest, _draw_dots(panel, result, point, found, scale))
        panel.set_ylabel(scale.label(f"worn volume {result.when(-1)}"))
    for row in range(len(panels)):
        label_outer(panels[row : row + 1])
    set_from_zero(panels[0, 0], scale(highest).item())
    add_legend(figure)
    unknown = _tell_rankings([each for each in shown if deciding_input(each[2]) is None])
    return figure, as_sentences(
        *(unknown or ["Over the input that decides most of it alone"]),
        "Bars: numerical error of the sample" if np.isfinite(result.errors).any() else "",
        "Crosses: samples that ended early, at what was worn by then" if (result.held & ~result.computed).any() else "",
        left_out,
    )


def _drawn_values(result: Result, name: str, point: Point) -> tuple[FloatArray, str, str]:
    """What the samples draw of an input (n_samples,) at a point, its unit and its name in words.

    Of an input with a draw for each pair it is the mean over the pairs.
    """
    drawn = result.dataset[f"{DRAWN}{name}"]
    drawn = drawn.isel({axis: index for axis, index in point.items() if axis in drawn.dims and axis != SAMPLE})
    words = name.replace("_", " ")
    if "contact" in drawn.dims:
        drawn, words = drawn.mean("contact", keep_attrs=True), f"mean {words} of the pairs"
    units = str(drawn.attrs.get("units", ""))
    return np.asarray(drawn.values, dtype=float), "" if units == "1" else units, words


def _draw_dots(panel: Axes, result: Result, point: Point, found: xr.Dataset, scale: Scale) -> float:
    """The samples of one panel; the largest volume, m3, with some room for its error."""
    place = tuple(slice(None) if axis == SAMPLE else point[axis] for axis in result.axes)
    worn, computed = result.worn[place], result.computed[place]
    drawn, units, words = _drawn_values(result, str(found["input"].values[leading_input(found)]), point)
    across = scale_for(units, drawn)
    at, wrong = across(drawn), worn * result.errors[place]
    told = computed & np.isfinite(wrong) & (wrong > 0.0)
    sides = scale(np.stack([np.minimum(wrong, worn)[told], wrong[told]]))
    panel.errorbar(at[told], scale(worn[told]), yerr=sides, fmt="none", ecolor="0.7", elinewidth=0.9, zorder=1)
    # 0 where all samples are one group, 1 the lower, 2 the upper, 3 between
    lower, upper = (float(end) for end in found["group_gap"].values)
    group = np.zeros(worn.size) if np.isnan(lower) else np.select([worn <= lower, worn >= upper], [1, 2], 3)
    size = 16.0 if worn.size > 300 else 26.0
    kinds = [(computed & (group == number), *look) for number, look in enumerate(_GROUPS)]
    kinds.append((~computed & np.isfinite(worn), "ended early", "X", 3))
    for own, label, marker, colour in kinds:
        if own.any():
            style: dict[str, Any] = {"color": COLOURS[colour], "marker": marker, "edgecolors": "white", "label": label}
            panel.scatter(at[own], scale(worn[own]), size, linewidths=0.4, **style)
    panel.set_xlabel(across.label(words))
    largest = float(np.nanmax(worn, initial=0.0))
    return min(largest + float(np.max(wrong[told], initial=0.0)), 1.5 * largest)
