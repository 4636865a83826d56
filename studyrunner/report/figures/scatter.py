"""Figures of studies with samples: bands of the worn volume, its exceedance, and what decides it."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import wraps
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from studyrunner.report import panels as plot
from studyrunner.report.drawing import Drawn, as_sentences
from studyrunner.report.panels import COLOURS, FloatArray
from studyrunner.report.selection import Course, choose, find_course, slow_time
from studyrunner.result.view import NO_VOLUME, Point, Result
from studyrunner.statistics.samples import SAMPLE
from studyrunner.statistics.sentence import describe_ranking, measure_of
from studyrunner.system.progress import count
from studyrunner.units import Scale, scale_for

_Shown = list[tuple[Point, str, xr.Dataset]]
"""Combinations of the axes beside the samples with their labels and statistics."""
_Draw = Callable[[Result, xr.Dataset], Drawn]

_MOST_PANELS, _MOST_LINES = 4, 3
_LOWEST, _HIGHEST = 0, 1  # places along the dimension `bound`
# quantiles between which a band lies, how dark it is, and what it is called
_BANDS: tuple[tuple[int, int, float, str], ...] = ((0, 4, 0.18, "5 to 95 %"), (1, 3, 0.32, "25 to 75 %"))
_MIDDLE = 2
_NOT_NEGLIGIBLE = 1e-3
_EXCEEDED = (
    ("worn_volume_exceedance", "exceeded_volume", "m3", "worn volume"),
    ("wear_depth_exceedance", "exceeded_depth", "m", "largest wear depth"),
)


def _of_samples(draw: _Draw) -> Callable[[Result], Drawn]:
    """A figure of the statistics of a result; nothing where it has no samples, or nothing is worn."""

    @wraps(draw)
    def drawn(result: Result) -> Drawn:
        if SAMPLE not in result.varying or not result.has("worn_volume"):
            return None
        worn = float(result.dataset["worn_volume"].max()) > NO_VOLUME
        return draw(result, result.statistics) if worn and result.statistics is not None else None

    return drawn


def _choose(
    result: Result, statistics: xr.Dataset, free: Collection[str] = (), limit: int = _MOST_PANELS
) -> tuple[_Shown, list[str], str]:
    """Combinations of the axes beside samples and `free`, at most `limit`, their labels, a sentence on the others."""
    choice = choose(result, [SAMPLE, *free], limit)
    shown: _Shown = [(point, label, statistics.isel(point, missing_dims="ignore")) for point, label in choice]
    return shown, list(choice.labels), choice.sentence


def _ends(statistics: xr.Dataset, name: str, *dims: str) -> FloatArray:
    """A statistic (dims..., 2): its lowest and its highest value."""
    return np.asarray(statistics[name].transpose(*dims, "bound").values, dtype=float)


def _largest(*values: FloatArray) -> float:
    return max((float(each[np.isfinite(each)].max(initial=0.0)) for each in values), default=0.0)


@_of_samples
def draw_bands(result: Result, statistics: xr.Dataset) -> Drawn:
    """5, 25, 50, 75 and 95 % of the samples over the cycles."""
    return _draw_bands(result, statistics, None) if statistics.sizes["cycle"] > 1 else None


@_of_samples
def draw_bands_over_course(result: Result, statistics: xr.Dataset) -> Drawn:
    """5, 25, 50, 75 and 95 % of the samples at the last count over the course."""
    course = find_course(result)
    return _draw_bands(result, statistics.isel({"cycle": -1, course.axis: course.index}), course) if course else None


def _draw_bands(result: Result, statistics: xr.Dataset, course: Course | None) -> Drawn:
    name, axis = "worn_volume_quantile", course.axis if course else "cycle"
    shown, labels, left_out = _choose(result, statistics, [course.axis] if course else [])
    cycles = scale_for(result.counted, statistics["cycle"].values.astype(float))
    at = course.values if course else cycles(statistics["cycle"].values)
    volumes = [_ends(point, name, axis, "quantile") for _, _, point in shown]
    wrong = [_ends(point, f"{name}_error", axis, "quantile") for _, _, point in shown]
    known = _largest(*(each[..., _LOWEST] for each in volumes))
    scale = scale_for("m3", known)
    figure, panels = plot.panel_grid(labels, 3.0, sharex=True)
    for panel, volume, error in zip(panels.flat, volumes, wrong, strict=True):
        _draw_band(panel, at, volume, error, scale)
        panel.set(xlabel=slow_time(result, cycles), ylabel=scale.label("worn volume"))
        if course:
            course.set_axis(panel)
    plot.label_outer(panels)
    panels[0, 0].set_xlim(at.min(), at.max())
    # errors and what is open count to twice what is known
    plot.set_from_zero(panels[0, 0], scale(min(max(known, _largest(*wrong, *volumes)), 2.0 * known)).item())
    n_without = max(int(point["n_without_value"].max()) for _, _, point in shown)
    hatched = f"Hatched: what {count(n_without, 'sample')} without a value to be trusted leave open"
    return figure, _n_samples(statistics), hatched if n_without else "", left_out


def _n_samples(statistics: xr.Dataset) -> str:
    confidence = 100.0 * float(statistics.attrs["confidence"])
    return f"{count(int(statistics['n_samples']), 'sample')}, intervals of {confidence:g} % confidence"


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


@_of_samples
def draw_exceedance(result: Result, statistics: xr.Dataset) -> Drawn:
    """Probability of more than a volume, and of deeper than a depth, with its confidence band."""
    last = statistics.isel(cycle=-1)
    shown, _, left_out = _choose(result, last, limit=_MOST_LINES)
    exceeded = [one for one in _EXCEEDED if one[0] in last]
    figure, panels = plot.new_panels(1, len(exceeded), 3.2, sharey=True)
    for panel, (name, dimension, units, words) in zip(panels[0], exceeded, strict=True):
        scale = scale_for(units, last[dimension].values)
        for number, (_, label, point) in enumerate(shown):
            at, style = scale(point[dimension].values), plot.line_style(number)
            value, interval = (_ends(point, f"{name}{each}", dimension) for each in ("", "_interval"))
            panel.fill_between(at, *interval.T, color=style["color"], alpha=0.18, lw=0.0)
            for bound in (_LOWEST, _HIGHEST) if (np.ptp(value, axis=1) > 0.0).any() else (_LOWEST,):
                own = {"color": style["color"], "linestyle": style["linestyle"]}
                panel.plot(at, value[:, bound], **own, label="_" if bound else label or "samples")
        panel.set(xlabel=scale.label(words), ylabel="probability of more", ylim=(0.0, 1.02))
        panel.set_xlim(0.0, scale(last[dimension].values[-1]).item())
    plot.label_outer(panels)
    return figure, _n_samples(last), left_out


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
    shown, labels, left_out = _choose(result, last)
    figure, panels = plot.panel_grid(labels, 2.9, sharex=True)
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
    plot.label_outer(panels)
    return figure, _describe_rankings(shown), _n_samples(last), left_out


def _describe_rankings(shown: _Shown) -> str:
    """Which input decides most, or that this is not known, of each combination."""
    said = [(label, describe_ranking(point)) for _, label, point in shown]
    return as_sentences(*(f"{label}: {says}" if label else says[0].upper() + says[1:] for label, says in said if says))
