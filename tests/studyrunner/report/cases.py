"""Figures of results and their numbers, and results with a mesh, for the tests of the report."""

from functools import lru_cache
from itertools import combinations
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from studies.finite_element.pairing import ContactPairs
from studies.scene import SurfaceMesh
from studies.scenes.dovetail_sector import Parameters
from studyrunner.report.contents import all_figures
from studyrunner.report.drawing import COLUMN_WIDTH, WIDTH, Drawing, fit_into_column, plotted_values, style
from studyrunner.result.view import Result
from tests.studyrunner.results import build_file

STUDY = '[study]\nname = "s"\n[scene]\nmodel = "dovetail_sector"\nn_sectors = 47\n'


def draw_figure(result: Result, name: str, width: float = WIDTH) -> Drawing:
    found = next(entry for entry in all_figures() if entry.name == name).make(result, width)
    assert isinstance(found, Drawing)
    return found


def numbers_of(drawing: Drawing) -> dict[str, NDArray[np.float64]]:
    """Rows of x, y, and error or value of a cell, in the table of a figure, by "title of the panel|series"."""
    found: dict[str, list[list[float]]] = {}
    for title, series, _, x, _, y, value in plotted_values(drawing.figure):
        name = f"{title}|{series}".replace("\N{NO-BREAK SPACE}", " ")
        found.setdefault(name, []).append([float(str(each)) if each else np.nan for each in (x, y, value)])
    return {name: np.array(rows) for name, rows in found.items()}


def values_of(result: Result, name: str, **where: int) -> NDArray[np.float64]:
    return np.asarray(result.dataset[name].isel(where).squeeze(drop=True).values, dtype=float)


def check_print(figure: Figure, width_in_print: float, name: str) -> None:
    """Legends cover no panel, nothing is cut off or runs into its neighbour, on a page and in a column."""
    thin = 2.0  # pixels by which boxes of text may touch
    if width_in_print == COLUMN_WIDTH:
        fit_into_column(figure)
    with style():
        canvas = FigureCanvasAgg(figure)
        figure.draw_without_rendering()
    renderer = canvas.get_renderer()
    inside = figure.get_tightbbox(renderer)
    width, height = figure.get_size_inches()
    assert width == width_in_print
    assert min(inside.x0, inside.y0, width - inside.x1, height - inside.y1) > -thin / figure.dpi, name
    whole = [panel.get_tightbbox(renderer) for panel in figure.axes]
    whole += [legend.get_window_extent(renderer) for legend in figure.legends]
    for one, other in combinations([box for box in whole if box is not None], 2):
        common = Bbox.intersection(one, other)
        assert common is None or np.min(common.size) <= thin, name
    assert all(text.get_fontsize() >= 7.0 for text in figure.findobj(Text) if text.get_text()), name


@lru_cache
def dovetail(density: int = 1) -> tuple[ContactPairs, SurfaceMesh]:
    """Pairs and mesh of the dovetail sector. density: of its mesh."""
    parameters = Parameters(friction_coefficient=0.5, mesh=density)
    pairs = parameters.define_sector()[1].pairs
    assert pairs is not None
    return pairs, parameters.describe_mesh()


def dovetail_file(density: int = 1, **options: Any) -> xr.Dataset:
    """A file of the dovetail sector with random numbers."""
    pairs, mesh = dovetail(density)
    dataset = build_file(positions=pairs.position.copy(), study=STUDY, **options)
    dataset = dataset.assign_coords(contact_area=("contact", pairs.area.copy(), dataset["contact_area"].attrs))
    return with_mesh(dataset, mesh)


def with_mesh(dataset: xr.Dataset, mesh: SurfaceMesh) -> xr.Dataset:
    """The file with the variables of a mesh."""
    nodes = {f"mesh_{axis}": ("mesh_node", mesh.nodes[:, i].copy(), {"units": "m"}) for i, axis in enumerate("xyz")}
    quads = (("mesh_quad_index", "mesh_corner"), mesh.quads.astype(np.int32))
    return dataset.assign(**nodes, mesh_quad=quads, mesh_part=("mesh_quad_index", np.array(mesh.parts)))
