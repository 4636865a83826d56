"""Numbers of a figure and of the file, picked by plain indexing."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from numpy.typing import NDArray

from studyrunner.report.drawing import Drawing, Table
from studyrunner.report.page_contents import draw_report
from studyrunner.report.reading.result import Result


def draw_figure(result: Result, name: str) -> Drawing:
    found = next(item for item in draw_report(result) if item.name == name)
    assert isinstance(found, Drawing)
    return found


def find_table(result: Result, name: str) -> Table | None:
    found = next((item for item in draw_report(result) if item.name == name), None)
    assert found is None or isinstance(found, Table)
    return found


def lines_of(panel: Axes) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    return {str(line.get_label()): tuple(np.asarray(line.get_data(), dtype=float)) for line in panel.get_lines()}


def cells_of(panel: Axes) -> NDArray[np.float64]:
    mesh = next(collection for collection in panel.collections if isinstance(collection, QuadMesh))
    return np.ma.filled(np.ma.asarray(mesh.get_array()).astype(float), np.nan)


def values_of(result: Result, name: str, **where: int) -> NDArray[np.float64]:
    values = result.dataset[name].isel(where).squeeze(drop=True)
    return np.asarray(values.values, dtype=float)
