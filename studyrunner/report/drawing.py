"""Items of the report: drawings, tables, sentences in place of what is missing; their one style, and their files."""

from __future__ import annotations

import csv
import textwrap
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.style import context
from matplotlib.ticker import AutoLocator, MaxNLocator

from studyrunner.report.panels import ERROR

WIDTH, COLUMN_WIDTH = 7.5, 3.55
"""Inches of a figure across a printed page, 190 mm, and in one column of a journal or on a phone, 90 mm."""

_PRINT_DPI = 300
"""Of the PNG files, as journals ask for."""

_MANY = 600  # points of a line from which on it is pixels in the SVG files, as maps are
_COLUMN_LABEL, _COLUMN_TITLE = 28, 48  # characters of a vertical label, and of a title, that fit into a column

_STYLE = Path(__file__).with_name("report.mplstyle")


@dataclass(frozen=True)
class Drawing:
    """One figure. name: of its files. narrow: draws the same, `COLUMN_WIDTH` wide, with its panels below each other."""

    name: str
    title: str
    caption: str
    figure: Figure
    narrow: Callable[[], Figure]

    def save(self, folder: Path) -> tuple[Path, Path]:
        """Write SVG, PNG and, of lines and maps, CSV files into a folder; the SVG files of both widths."""
        values = folder / f"{self.name}.csv"
        values.unlink(missing_ok=True)
        if rows := plotted_values(self.figure):
            with values.open("w", newline="", encoding="utf-8") as file:
                csv.writer(file).writerows([("panel", "series", "x", "x value", "y", "y value", "value"), *rows])
        with style():
            wide, narrow = _save(self.figure, folder / self.name), self.narrow()
            fit_into_column(narrow)
            # names of any length may leave its panels no room
            with warnings.catch_warnings(action="ignore", category=UserWarning):
                return wide, _save(narrow, folder / f"{self.name}_column")


@dataclass(frozen=True)
class Missing:
    """A figure that is left out. sentence: what the file does not hold, and what to ask for."""

    name: str
    title: str
    sentence: str


@dataclass(frozen=True)
class Table:
    """Rows of text, each as long as `columns`. note: what is seen; may be empty."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    name: str = ""
    title: str = ""


Item = Drawing | Missing | Table

Drawn = tuple[Figure, *tuple[str, ...]] | Table | str | None
"""What draws an item gives: a figure and the sentences of its caption, of which empty ones are left out; a table; a
sentence in their place; None for nothing to see.
"""


def as_sentences(*parts: str) -> str:
    """Text of those parts that are not empty, each ended with a full stop."""
    return " ".join(part if part.endswith(".") else f"{part}." for part in parts if part)


def style(width: float = WIDTH) -> AbstractContextManager[None]:
    """Inside, figures are built, this wide, and saved in the style of the report, whatever matplotlibrc says."""
    return context([_STYLE, {"figure.figsize": (width, 1.0)}], after_reset=True)


def plotted_values(figure: Figure) -> list[tuple[object, ...]]:
    """The numbers of all lines, dots and maps of a figure, as shown: rows of panel, series, x, its value, y, its value,
    and the error of a value of a line, or the value of a cell or dot of a map.
    """
    rows: list[tuple[object, ...]] = []
    for panel in figure.axes:
        texts = [" ".join(text.split()) for text in (panel.get_title(), _label(panel, "x"), _label(panel, "y"))]
        for series, *columns in _series(panel):
            for x, y, value in zip(*(np.ravel(column) for column in columns), strict=True):
                numbers = ["" if not np.isfinite(number) else f"{number:.9g}" for number in (x, y, value)]
                rows.append((texts[0], series, texts[1], numbers[0], texts[2], *numbers[1:]))
    return rows


def _label(panel: Axes, axis: str) -> str:
    """Label of the axis "x" or "y", which may stand at another panel that shares this axis."""
    sharing = getattr(panel, f"get_shared_{axis}_axes")().get_siblings(panel)
    return next(filter(None, (getattr(each, f"get_{axis}label")() for each in (panel, *sharing))), "")


def _series(panel: Axes) -> Iterator[tuple[str, Any, Any, Any]]:
    """Label, x, y, and error or value of what is drawn."""
    for line in panel.get_lines():
        x, y = line.get_data()
        if not str(line.get_label()).startswith("_") or np.size(x) > 2:
            yield str(line.get_label()), x, y, getattr(line, ERROR, np.full(np.shape(y), np.nan))
    for each in panel.collections:
        values: Any = each.get_array()
        if isinstance(each, QuadMesh) and panel.get_label() != "<colorbar>":
            corners = np.asarray(each.get_coordinates())
            x, y = np.moveaxis(0.5 * (corners[1:, 1:] + corners[:-1, :-1]), 2, 0)
            yield "map", x, y, np.ma.filled(np.ma.asarray(values, float), np.nan)
        elif isinstance(each, PathCollection):
            x, y = np.asarray(each.get_offsets()).T
            yield str(each.get_label()), x, y, np.full(x.size, np.nan) if values is None else values


def fit_into_column(figure: Figure) -> None:
    """Break long texts of a narrow figure, and keep its ticks few."""
    for panel in figure.axes:
        for text, longest in ((panel.yaxis.label, _COLUMN_LABEL), (panel.title, _COLUMN_TITLE)):
            lines = (textwrap.fill(line, longest, break_on_hyphens=False) for line in text.get_text().split("\n"))
            text.set_text("\n".join(lines))
        for axis in (panel.xaxis, panel.yaxis):
            if isinstance(axis.get_major_locator(), AutoLocator):
                # steps of 2.5 have one digit more: with them the layout goes to and fro
                axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))


def _save(figure: Figure, path: Path) -> Path:
    """The figure as SVG, whose path is returned, and PNG; `path` is without a suffix. It is laid out for good."""
    for artist in figure.findobj(Line2D) + figure.findobj(PathCollection):
        points = artist.get_xdata() if isinstance(artist, Line2D) else artist.get_offsets()
        artist.set_rasterized(np.size(points) > _MANY)
    for mesh in figure.findobj(QuadMesh):
        # cells as shapes of their own have seams between them
        mesh.set_rasterized(True)
    svg, png = path.with_name(f"{path.name}.svg"), path.with_name(f"{path.name}.png")
    figure.savefig(svg, format="svg", metadata={"Date": None})
    # what stands where is the same for both: it is found once
    figure.set_layout_engine("none")
    figure.savefig(png, format="png", dpi=_PRINT_DPI)
    return svg
