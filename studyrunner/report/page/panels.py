"""Where the contact pairs lie on the maps of the page: a grid, scattered positions or bars, one panel a surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from studyrunner.report.reading.flanks import Flank, find_flanks
from studyrunner.report.reading.result import Point, Result
from studyrunner.report.reading.scene_pairs import of_scene, pairs_of_scene

MOST_PANELS = 6
"""More surfaces than this share one panel of bars."""

_FLAT = 1e-6


def build_panels(result: Result, point: Point | None = None) -> list[dict[str, object]]:
    """One panel a surface, of the scene of a point or of the shown one: `title`, `kind`, and
    `pairs`, places of its pairs in the file.

    kind "grid": `x` and `y`, m, of the columns and rows, and `pairs` as rows; "scatter": `x` and `y`, m, of each pair
    in the plane of the surface; "bars": one bar a pair.
    """
    # places in the file, where other scenes may have more pairs
    point = result.shown_point() if point is None else point
    places = pairs_of_scene(result, point)
    flanks = [replace(flank, pairs=places[flank.pairs]) for flank in find_flanks(of_scene(result, point))]
    if len(flanks) > MOST_PANELS:
        return [{"title": "all contact pairs", "kind": "bars", "pairs": places.tolist()}]
    return [{"title": flank.surface, **_place(flank)} for flank in flanks]


def _place(flank: Flank) -> dict[str, object]:
    """Where the pairs of a surface are drawn; a single one or a single row gets bars."""
    grid = flank.grid
    if grid is not None and min(grid.pair.shape) > 1:
        pairs = flank.pairs[grid.pair].tolist()
        return {"kind": "grid", "x": grid.along.tolist(), "y": grid.across.tolist(), "pairs": pairs}
    pairs = flank.pairs.tolist()
    if flank.seen is not None and np.ptp(flank.seen[:, 1]) > _FLAT * np.ptp(flank.seen[:, 0]):
        x, y = flank.seen.T.tolist()
        return {"kind": "scatter", "x": x, "y": y, "pairs": pairs}
    return {"kind": "bars", "pairs": pairs}
