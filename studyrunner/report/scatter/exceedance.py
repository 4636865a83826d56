"""Probability that more is worn than a volume, or deeper than a depth, over this volume or depth."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from studyrunner.report.drawing import Drawing, add_legend, line_style, new_panels
from studyrunner.report.reading.result import Result, as_sentences
from studyrunner.report.reading.units import scale_for
from studyrunner.report.scatter.points import HIGHEST, LOWEST, Shown, choose_points, ends, last_of
from studyrunner.system.progress import count

_MOST_LINES = 3
_QUANTITIES = (
    ("worn_volume_exceedance", "exceeded_volume", "m3", "worn volume"),
    ("wear_depth_exceedance", "exceeded_depth", "m", "largest wear depth"),
)


def draw_exceedance(result: Result, statistics: xr.Dataset) -> Drawing:
    """Exceedance at the last cycle count with its confidence band, one line a combination of the other axes."""
    shown = choose_points(result, last_of(statistics), limit=_MOST_LINES)
    held = [one for one in _QUANTITIES if one[0] in statistics]
    figure, panels = new_panels(1, len(held), 3.2, sharey=True)
    errors = False
    for panel, (name, dimension, units, words) in zip(panels[0], held, strict=True):
        scale = scale_for(units, statistics[dimension].values)
        errors |= _draw_lines(panel, shown, name, dimension, scale.factor)
        panel.set_xlabel(scale.label(words))
        panel.set_xlim(0.0, scale.factor * float(statistics[dimension].values[-1]))
        panel.set_ylim(0.0, 1.02)
    panels[0, 0].set_ylabel("probability of more")
    if len(panels[0, 0].get_legend_handles_labels()[1]) > 1:
        add_legend(figure)
    open_ended = any(
        (ends(point, held[0][0], held[0][1])[:, 1] > ends(point, held[0][0], held[0][1])[:, 0]).any()
        for point in shown.statistics
    )
    text = as_sentences(
        f"Probability that more is worn than a volume {result.when(-1)}"
        + (", and that a pair is worn deeper than a depth until then" if len(held) > 1 else "")
        + f", from {count(int(statistics['n_samples']), 'sample')}",
        f"Bands: {100.0 * float(statistics.attrs['confidence']):g} % confidence",
        "Dotted: with every sample less or more its numerical error" if errors else "",
        "A pair of lines lies around what samples without a value leave open" if open_ended else "",
        shown.sentence,
    )
    return Drawing("exceedance", "Probability of more wear", text, figure)


def _draw_lines(panel: Axes, shown: Shown, name: str, dimension: str, factor: float) -> bool:
    """Lines and bands of the combinations; whether numerical errors are seen."""
    errors = False
    for number, (_, label, point) in enumerate(shown):
        at = factor * point[dimension].values
        value, interval = ends(point, name, dimension), ends(point, f"{name}_interval", dimension)
        wrong = ends(point, f"{name}_error", dimension)
        colour, dashes = (line_style(number)[key] for key in ("color", "linestyle"))
        style = {"color": colour, "linestyle": dashes}
        panel.fill_between(at, interval[:, LOWEST], interval[:, HIGHEST], color=colour, alpha=0.18, lw=0.0)
        panel.plot(at, value[:, LOWEST], **style, label=label or "samples")
        if (value[:, HIGHEST] > value[:, LOWEST]).any():
            panel.plot(at, value[:, HIGHEST], **style)
        # an error that was never estimated says nothing
        if np.abs(wrong - value).max() > 0.0 and name == "worn_volume_exceedance":
            errors = True
            panel.plot(at, wrong, color=colour, linestyle=":", linewidth=1.0)
    return errors
