"""What the samples of a study say: bands of quantiles, probabilities of more, what decides."""

from collections.abc import Collection

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from studyrunner.coordinates import SAMPLE
from studyrunner.report import drawing as plot
from studyrunner.report.drawing import COLOURS, Drawn, FloatArray, as_sentences
from studyrunner.report.selection import choose, find_course, slow_time
from studyrunner.result.view import NO_VOLUME, Result
from studyrunner.statistics.read_samples import LIFE, RESPONSE
from studyrunner.statistics.sentences import count_samples, describe_ranking, measure_of
from studyrunner.statistics.study_statistics import QUANTITIES
from studyrunner.system.progress import count
from studyrunner.units import Scale, scale_for, units_of

_MOST_PANELS, _MOST_LINES = 4, 3  # of samples
_FAR = 3.0  # times what is worn: a limit above it is not drawn
_LOWEST, _HIGHEST = 0, 1  # places along the dimension `bound`
# quantiles between which a band lies, how dark it is, and what it is called
_BANDS: tuple[tuple[int, int, float, str], ...] = ((0, 4, 0.18, "5 to 95 %"), (1, 3, 0.32, "25 to 75 %"))
_MIDDLE = 2
_EXCEEDED = {
    "worn_volume": "worn volume",
    "wear_depth": "largest wear depth",
    RESPONSE: "largest response",
    LIFE: "life",
}


def _ends(statistics: xr.Dataset, name: str, *dims: str) -> FloatArray:
    """A statistic (dims..., 2): its lowest and its highest value."""
    return np.asarray(statistics[name].transpose(*dims, "bound").values, dtype=float)


def _largest(*values: FloatArray) -> float:
    return max((float(each[np.isfinite(each)].max(initial=0.0)) for each in values), default=0.0)


def _statistics(result: Result) -> xr.Dataset | None:
    """What the samples say; None where a result has none, or nothing is worn."""
    if SAMPLE not in result.varying or not result.has("worn_volume"):
        return None
    of_lives = result.statistics is not None and f"{LIFE}_quantile" in result.statistics
    return result.statistics if of_lives or float(result.dataset["worn_volume"].max()) > NO_VOLUME else None


def _choose(
    result: Result, statistics: xr.Dataset, free: Collection[str] = (), limit: int = _MOST_PANELS
) -> tuple[list[xr.Dataset], list[str], str]:
    """Statistics of combinations of the axes beside samples and `free`, their labels, a sentence on the others."""
    choice = choose(result, [SAMPLE, *free], limit)
    others = [name for name in result.axes if name not in free]
    points = [statistics.isel({name: point[name] for name in others}, missing_dims="ignore") for point in choice.points]
    return points, list(choice.labels), choice.sentence


def draw_bands(result: Result, of: tuple[str, str]) -> Drawn:
    """5, 25, 50, 75 and 95 % of the samples, and the limit. of: worn_volume or wear_depth, and over what: the "cycle",
    or the "course" at the last count.
    """
    (quantity, over), statistics = of, _statistics(result)
    name, course = f"{quantity}_quantile", find_course(result) if over == "course" else None
    if (
        statistics is None
        or name not in statistics
        or f"{LIFE}_quantile" in statistics  # points end at a target
        or (statistics.sizes["cycle"] < 2 if over == "cycle" else course is None)
    ):
        return None
    if course:
        statistics = statistics.isel({"cycle": -1, course.axis: course.index})
    axis = course.axis if course else "cycle"
    shown, labels, left_out = _choose(result, statistics, [course.axis] if course else [])
    cycles = scale_for(result.counted, statistics["cycle"].values.astype(float))
    at = course.values if course else cycles(statistics["cycle"].values)
    volumes = [_ends(point, name, axis, "quantile") for point in shown]
    wrong = [_ends(point, f"{name}_error", axis, "quantile") for point in shown]
    known = _largest(*(each[..., _LOWEST] for each in volumes))
    scale = scale_for(units_of(statistics[name]), known)
    limit = float(statistics.get(f"{quantity}_limit", np.nan))
    limit = limit if limit < _FAR * known else np.nan
    figure, panels = plot.panel_grid(labels, 3.0, sharex=True)
    for panel, volume, error in zip(panels.flat, volumes, wrong, strict=True):
        _draw_band(panel, at, volume, error, scale)
        if np.isfinite(limit):
            panel.plot(at, np.full(len(at), scale(limit)), color=COLOURS[1], label="limit")
        panel.set(xlabel=slow_time(result, cycles), ylabel=scale.label(quantity.replace("_", " ")))
        if course:
            course.set_axis(panel)
    plot.label_outer(panels)
    panels[0, 0].set_xlim(at.min(), at.max())
    # errors and what is open count to twice what is known
    top = np.fmax(min(max(known, _largest(*wrong, *volumes)), 2.0 * known), limit)
    plot.set_from_zero(panels[0, 0], scale(top).item())
    n_without = max(int(point["n_without_value"].max()) for point in shown)
    without = f"{count(n_without, 'sample')} without a value to be trusted leave open what they may be"
    return figure, _n_samples(statistics), without if n_without else "", left_out


def _n_samples(statistics: xr.Dataset) -> str:
    confidence = 100.0 * float(statistics.attrs["confidence"])
    return f"{count_samples(statistics)}, intervals of {confidence:g} % confidence"


def _draw_band(panel: Axes, at: FloatArray, volume: FloatArray, wrong: FloatArray, scale: Scale) -> None:
    """Bands and median along an axis: volume, and wrong with the numerical errors, (n, quantile, bound)."""
    edges = np.where(np.isnan(wrong), volume, wrong)
    edges = scale(np.minimum(edges, 10.0 * max(_largest(volume), 1e-30)))
    for low, high, alpha, label in _BANDS:
        lowest, highest = edges[:, low, _LOWEST], edges[:, high, _HIGHEST]
        panel.fill_between(at, lowest, highest, color=COLOURS[0], alpha=alpha, lw=0.0, label=label)
        for edge in (lowest, highest):
            panel.plot(at, edge, color=COLOURS[0], lw=0.5, alpha=0.5, label=f"_{label}")
    median, marker = scale(volume[:, _MIDDLE, _LOWEST]), "o" if at.size <= 12 else ""
    panel.plot(at, median, color=COLOURS[0], marker=marker, label="median")


def draw_exceedance(result: Result) -> Drawn:
    """Probability of more than a volume, a depth and what else has a limit, with confidence band and limit."""
    statistics = _statistics(result)
    if statistics is None:
        return None
    last = statistics.isel(cycle=-1)
    shown, labels, left_out = _choose(result, last, limit=_MOST_LINES)
    # where points end at a target, what they wear is that
    asked = [LIFE] if f"{LIFE}_exceedance" in last else list(_EXCEEDED)
    exceeded = [(f"{name}_exceedance", _EXCEEDED[name]) for name in asked if f"{name}_exceedance" in last]
    figure, panels = plot.new_panels(1, len(exceeded), 3.2, sharey=True)
    for panel, (name, words) in zip(panels[0], exceeded, strict=True):
        quantity = name.removesuffix("_exceedance")
        dimension, limit = QUANTITIES[quantity].exceeded, float(last.get(f"{quantity}_limit", np.nan))
        units = result.counted if quantity == LIFE else QUANTITIES[quantity].units
        scale = scale_for(units, last[dimension].values)
        for number, (label, point) in enumerate(zip(labels, shown, strict=True)):
            at, style = scale(point[dimension].values), plot.line_style(number)
            value, interval = (_ends(point, f"{name}{each}", dimension) for each in ("", "_interval"))
            if len(shown) == 1:
                panel.fill_between(at, *interval.T, color=style["color"], alpha=0.18, lw=0.0)
            else:
                # bands on top of each other would be mud
                panel.plot(at, interval, color=style["color"], linestyle=":", lw=0.8, label="_interval")
            for bound in (_LOWEST, _HIGHEST) if (np.ptp(value, axis=1) > 0.0).any() else (_LOWEST,):
                look = {name: style[name] for name in ("color", "linestyle")}
                panel.plot(at, value[:, bound], **look, label="_" if bound else label or "samples")
        panel.set(xlabel=scale.label(words), ylabel="probability of more", ylim=(0.0, 1.02))
        largest = float(last[dimension].values[-1])
        if limit < _FAR * largest:
            panel.axvline(scale(limit).item(), color=COLOURS[1], label="_" if panel is not panels[0, -1] else "limit")
            largest = max(largest, 1.05 * limit)
        panel.set_xlim(0.0, scale(largest).item())
    plot.label_outer(panels)
    ends = "Thin dotted: ends of the intervals" if len(shown) > 1 else "Band: interval"
    return figure, f"{ends}; {_n_samples(last)}", left_out


def draw_deciding_inputs(result: Result) -> Drawn:
    """What each input decides at the last cycle count: Sobol' indices, or rank correlations, with their intervals."""
    statistics = _statistics(result)
    if statistics is None or "input" not in statistics.dims:
        return None
    last = statistics.isel(cycle=-1)
    measure = measure_of(last)
    if measure is None or not last[measure].notnull().any():
        return "The file holds too few samples to say what decides, or samples that do not differ: raise samples."
    shares = measure == "first_index"
    bars = {"first_index": "alone", "total_index": "with the others"} if shares else {measure: "rank correlation"}
    shown, labels, left_out = _choose(result, last)
    figure, panels = plot.panel_grid(labels, 2.9, sharex=True)
    for panel, point in zip(panels.flat, shown, strict=True):
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
    rankings = [(label, describe_ranking(point)) for label, point in zip(labels, shown, strict=True)]
    decides = (f"{label}: {text}" if label else text[0].upper() + text[1:] for label, text in rankings if text)
    return figure, as_sentences(*decides), _n_samples(last), left_out
