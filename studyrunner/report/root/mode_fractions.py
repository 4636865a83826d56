"""Where the joint of a nonlinear mode slips and where it opens: fractions of the period on the root."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from studyrunner.report.drawing import Drawing, Missing
from studyrunner.report.reading.result import Result, as_sentences
from studyrunner.report.reading.units import scale_for
from studyrunner.report.root.figures import State, draw_numbers, find_root, paint_state

_TITLES = {"slip_fraction": "Where the joint slips", "open_fraction": "Where the joint opens"}


def draw_mode_fractions(result: Result) -> Iterator[Drawing | Missing]:
    """Fractions of the period in which pairs slip and are open, at the shown point: a large amplitude.

    Nothing where `find_root` finds none.
    """
    surface, views = find_root(result)
    if surface is None:
        return
    point = result.shown_point()
    for name, title in _TITLES.items():
        if not result.has(name):
            yield Missing(name, title, result.lacks(name))
            continue
        values = np.asarray(result.at(name, point).values, dtype=float)
        if not np.isfinite(values).all():
            yield Missing(name, title, "No point has a state.")
            continue
        label = f"fraction of the period {'in slip' if name == 'slip_fraction' else 'open'}"
        state = State(name, 0, np.zeros(len(values)), values)
        figure = paint_state(surface, views, state, 1.0, scale_for("1", values), label)
        pair = result.dataset["contact"].values[int(np.argmax(values))]
        caption = as_sentences(
            f"{label.capitalize()}, at {result.describe(point)}",
            f"Largest: {values.max():.3g} at pair {pair}" if values.max() > 0.0 else "No pair does",
            "" if surface.is_mesh else "The file has no mesh: each pair is a patch",
        )
        yield Drawing(name, title, caption, figure)
    yield draw_numbers(result, surface, views)
