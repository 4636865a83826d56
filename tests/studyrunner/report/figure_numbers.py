"""Numbers of a figure and of the file, picked by plain indexing."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from numpy.typing import NDArray

from studyrunner.report.drawing import Drawing, style
from studyrunner.report.figures.loops import draw_loops
from studyrunner.report.figures.outcome import draw_outcomes
from studyrunner.report.figures.pairs import draw_pairs
from studyrunner.report.figures.response import draw_responses
from studyrunner.report.figures.scatter import draw_scatter
from studyrunner.report.figures.sector import draw_sector
from studyrunner.report.figures.trends import draw_trends
from studyrunner.report.figures.volume import draw_volumes
from studyrunner.report.root.figures import draw_root
from studyrunner.result.view import Result

OWNERS = {
    draw_outcomes: ("outcome_map",),
    draw_sector: ("natural_frequencies",),
    draw_trends: ("trends",),
    draw_scatter: ("worn_volume_bands", "deciding_inputs", "deciding_input"),
    draw_responses: ("frequency_response",),
    draw_volumes: ("worn_volume", "worn_volume_map", "wear_rate_map", "final_worn_volume"),
    draw_root: ("worn_root",),
    draw_pairs: ("wear_depth", "mean_pressure", "worn_profile"),
    draw_loops: ("fretting_loops", "normal_load", "pair_motion"),
}
"""What draws which figure; the whole report takes a second."""


def draw_figure(result: Result, name: str) -> Drawing:
    (draw,) = [draw for draw, names in OWNERS.items() if name in names]
    with style():
        found = next(item for item in draw(result) if item.name == name)
    assert isinstance(found, Drawing)
    return found


def lines_of(panel: Axes) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    return {str(line.get_label()): tuple(np.asarray(line.get_data(), dtype=float)) for line in panel.get_lines()}


def cells_of(panel: Axes) -> NDArray[np.float64]:
    mesh = next(collection for collection in panel.collections if isinstance(collection, QuadMesh))
    return np.ma.filled(np.ma.asarray(mesh.get_array()).astype(float), np.nan)


def values_of(result: Result, name: str, **where: int) -> NDArray[np.float64]:
    values = result.dataset[name].isel(where).squeeze(drop=True)
    return np.asarray(values.values, dtype=float)
