"""Numbers of a figure and of the file, picked by plain indexing."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from numpy.typing import NDArray

from studyrunner.report.contents import FIGURES
from studyrunner.report.drawing import Drawing
from studyrunner.result.view import Result


def draw_figure(result: Result, name: str) -> Drawing:
    found = next(entry for entry in FIGURES if entry.name == name).make(result)
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
