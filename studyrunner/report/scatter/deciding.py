"""Worn volume of each sample over the input that decides most, the density beside it, two groups in two colours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from studyrunner.report.drawing import COLOURS, Drawing, add_legend, new_figure, set_from_zero
from studyrunner.report.reading.result import Point, Result, as_sentences
from studyrunner.report.reading.sample_statistics import SAMPLE
from studyrunner.report.reading.units import Scale, scale_for
from studyrunner.report.scatter.points import choose_points, drawn_values, last_of, panel_grid
from studyrunner.statistics.ranking import deciding_input, describe_ranking, leading_input
from studyrunner.system.progress import count

GROUPS = ("one group", "lower group", "upper group", "between")
"""What the numbers of `groups_of` mean."""
_MARKERS = ("o", "o", "s", "D")
_COLOURS = (COLOURS[0], COLOURS[0], COLOURS[1], "0.5")


def groups_of(point: xr.Dataset, worn: NDArray[np.float64]) -> NDArray[np.int_]:
    """Group of each sample (n,), a number of `GROUPS`; worn: m3, NaN without a state."""
    lower, upper = (float(end) for end in point["group_gap"].values)
    if np.isnan(lower):
        return np.zeros(worn.size, int)
    return np.select([worn <= lower, worn >= upper], [1, 2], 3)


def draw_deciding(result: Result, statistics: xr.Dataset) -> Drawing:
    """Worn volumes at the last cycle count over the deciding input, one panel a combination of the other axes."""
    shown = choose_points(result, last_of(statistics))
    scale = scale_for("m3", result.worn)
    density: Axes | None = None
    if len(shown.points) == 1:
        figure = new_figure(3.6)
        first, density = figure.subplots(1, 2, sharey=True, width_ratios=(4.0, 1.0))
        panels = np.array([[first]])
    else:
        figure, panels = panel_grid(len(shown.points), 3.0, sharey=True)
    names, highest = [], 0.0
    for panel, (point, label, found) in zip(panels.flat, shown, strict=True):
        names.append(str(found["input"].values[leading_input(found)]))
        highest = max(highest, _draw_samples(panel, result, point, found, names[-1], scale))
        panel.set_title(label)
    for row in panels:
        row[0].set_ylabel(scale.label(f"worn volume {result.when(-1)}"))
    set_from_zero(panels[0, 0], scale(highest).item())
    if density is not None:
        _draw_density(density, shown.statistics[0], scale)
    add_legend(figure)
    unknown = [
        f"{f'{label}: ' if label else ''}{describe_ranking(found)}"
        for _, label, found in shown
        if deciding_input(found) is None and describe_ranking(found)
    ]
    text = as_sentences(
        f"Worn volume of each sample {result.when(-1)}"
        + ("" if unknown else ", over the input that decides most of it alone"),
        *unknown,
        "Bars: numerical error of the sample" if np.isfinite(result.errors).any() else "",
        *_tell_groups(shown.labels, shown.statistics, scale),
        "Right: density of the samples" if density is not None else "",
        "Crosses: samples that ended early, at what was worn by then" if (result.held & ~result.computed).any() else "",
        shown.sentence,
    )
    words = " and ".join(dict.fromkeys(name.replace("_", " ") for name in names))
    return Drawing("deciding_input", f"Worn volume of the samples over {words}", text, figure)


def along_samples(result: Result, values: NDArray[np.generic], point: Point) -> NDArray[np.generic]:
    """Values (axes...) of all samples (n_samples,) at a point whose sample does not matter."""
    return np.asarray(values[tuple(slice(None) if name == SAMPLE else point[name] for name in result.axes)])


def _draw_samples(panel: Axes, result: Result, point: Point, found: xr.Dataset, name: str, scale: Scale) -> float:
    """The samples of one panel; the largest volume, m3, with some room for its error."""
    drawn, units, words = drawn_values(result, name, point)
    across = scale_for(units, drawn)
    worn = along_samples(result, result.worn, point).astype(float)
    wrong = worn * along_samples(result, result.errors, point).astype(float)
    computed = along_samples(result, result.computed, point).astype(bool)
    at, group = across(drawn), groups_of(found, worn)
    told = computed & np.isfinite(wrong) & (wrong > 0.0)
    sides = scale(np.stack([np.minimum(wrong, worn)[told], wrong[told]]))
    panel.errorbar(at[told], scale(worn[told]), yerr=sides, fmt="none", ecolor="0.7", elinewidth=0.9, zorder=1)
    size = 16.0 if worn.size > 300 else 26.0
    for number, label in enumerate(GROUPS):
        own = computed & (group == number)
        if own.any():
            style: dict[str, Any] = {
                "color": _COLOURS[number],
                "marker": _MARKERS[number],
                "edgecolors": "white",
                "linewidths": 0.4,
            }
            panel.scatter(at[own], scale(worn[own]), size, **style, label=label if number else "samples")
    early = ~computed & np.isfinite(worn)
    if early.any():
        panel.scatter(at[early], scale(worn[early]), size, color="black", marker="x", label="ended early")
    panel.set_xlabel(across.label(words))
    largest = float(np.nanmax(worn, initial=0.0))
    return min(largest + float(np.max(wrong[told], initial=0.0)), 1.5 * largest)


def _draw_density(panel: Axes, found: xr.Dataset, scale: Scale) -> None:
    """The density of the samples, lying, beside them."""
    grid, density = scale(found["worn_volume_grid"].values), found["worn_volume_density"].values / scale.factor
    panel.fill_betweenx(grid, 0.0, density, color="0.8", lw=0.0)
    panel.plot(density, grid, color="0.3", linewidth=1.0)
    panel.set_xlim(left=0.0)
    panel.set_xlabel(f"density\n(1/{scale.unit})")
    panel.tick_params(labelleft=False)
    panel.locator_params(axis="x", nbins=3)


def _tell_groups(labels: Sequence[str], statistics: Sequence[xr.Dataset], scale: Scale) -> list[str]:
    """Where samples fall into two groups: how many are in each, and the pair that tells them apart."""
    found = []
    for label, point in zip(labels, statistics, strict=True):
        n_lower, n_upper = (int(number) for number in point["group_size"].values)
        if not n_upper:
            continue
        lower, upper = (scale.show(float(end)) for end in point["group_gap"].values)
        where = f" at {label}" if label else ""
        text = f"Two groups{where}: {count(n_lower, 'sample')} up to {lower}, {n_upper} from {upper}"
        contact = int(point["deciding_contact"])
        found.append(text if contact < 0 else f"{text}; the wear depth of pair {contact} tells them apart")
    return found
