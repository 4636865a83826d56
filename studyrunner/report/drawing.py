"""Figures of the report: their one style, panels and what stands in them, their files; and tables."""

import csv
import math
import textwrap
import warnings
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis, XAxis
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.style import context
from matplotlib.ticker import AutoLocator, FuncFormatter, LogLocator, MaxNLocator, NullLocator
from numpy.typing import ArrayLike, NDArray

from studyrunner.units import show_power

FloatArray = NDArray[np.float64]

WIDTH, COLUMN_WIDTH = 7.5, 3.55
"""Inches of a figure across a printed page, 190 mm, and in one column of a journal or on a phone, 90 mm."""

# Okabe & Ito (2008), "Color universal design", without its yellow, which vanishes on white. Lightness differs as well.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#000000", "#CC79A7", "#E69F00", "#56B4E9")
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)), (0, (3, 1, 1, 1, 1, 1)))
_MARKERS = ("o", "s", "^", "D", "v", "P", "X")
_CHARACTERS, _MARK, _LEGEND_ROW = 14.0, 6, 0.18  # of a legend: letters in an inch, a mark in letters, inches of a row
_TITLE = 80  # characters of titles over panels side by side
_MOST_TICKS = 7
_WIDE, _LEAST, _LOW, _HIGH = 5.0, 1.5, 2.6, 3.2  # inches: least width of a wide figure; heights in a narrow one
_COLUMN_LABEL, _COLUMN_TITLE = 28, 48  # characters of a vertical label, and of a title, that fit into a column

_ERROR = "fretwear_error"  # attribute of a line: the errors of its values, for the table beside the figure
_MANY = 600  # points of a line from which on it is pixels in the SVG files, as maps are
_PRINT_DPI = 300  # of the PNG files, as journals ask for
_STYLE = Path(__file__).with_name("report.mplstyle")


def style(width: float = WIDTH) -> AbstractContextManager[None]:
    """Inside, figures are built, this wide, and saved in the style of the report, whatever matplotlibrc says."""
    return context([_STYLE, {"figure.figsize": (width, 1.0)}], after_reset=True)


# --- panels, and what stands in them ---


def is_narrow() -> bool:
    """Whether figures are now built as wide as a column."""
    return bool(mpl.rcParams["figure.figsize"][0] < _WIDE)


def new_panels(
    n_rows: int, n_columns: int, height: float, sharex: Any = False, sharey: Any = False, **ratios: Any
) -> tuple[Figure, NDArray[Any]]:
    """A figure, inches high, that lays itself out, and its axes (n_rows, n_columns). Nothing has to close it.

    In a narrow figure the columns stand below each other. sharex, sharey, ratios: as for `subplots`.
    """
    width, shape, narrow = mpl.rcParams["figure.figsize"][0], (n_rows, n_columns), is_narrow()
    if narrow:
        usual = np.array(ratios.get("height_ratios", np.ones(n_rows)), dtype=float)
        usual *= height / np.sum(usual)
        narrow_rows = 0.45 * n_columns * usual
        narrow_rows = np.minimum(np.maximum(narrow_rows, np.minimum(usual, _LOW)), np.maximum(usual, _HIGH))
        heights = np.tile(np.maximum(narrow_rows, _LEAST), n_columns)
        height, shape, ratios = float(heights.sum()), (len(heights), 1), {"height_ratios": heights.tolist()}
        sharex, sharey = sharex is True, sharey is True
    figure = Figure(figsize=(width, height), layout="constrained")
    panels: NDArray[Any] = figure.subplots(*shape, sharex=sharex, sharey=sharey, squeeze=False, **ratios)
    if narrow:
        panels = panels.reshape(n_columns, n_rows).T
        for panel in panels[-1]:
            panel.tick_params(labelbottom=True)
    return figure, panels


def new_panel(height: float) -> tuple[Figure, Axes]:
    """A figure of one panel."""
    figure, panels = new_panels(1, 1, height)
    return figure, panels[0, 0]


def panel_grid(labels: Sequence[str], height: float, **shared: Any) -> tuple[Figure, NDArray[Any]]:
    """A figure and its panels with these titles, two by two if four, else side by side. height: of a row, inches."""
    n_columns = 2 if len(labels) == 4 else len(labels)
    n_rows = len(labels) // n_columns
    figure, panels = new_panels(n_rows, n_columns, 0.5 + height * n_rows, sharey=True, **shared)
    for panel, label in zip(panels.flat, labels, strict=True):
        panel.set_title(textwrap.fill(label, _TITLE // n_columns))
    return figure, panels


def line_style(number: int, n_points: int = 0) -> dict[str, Any]:
    """Colour, dashes and marker of the line of this number; of many points only some have a marker."""
    return {
        "color": COLOURS[number % len(COLOURS)],
        "linestyle": _DASHES[number % len(_DASHES)],
        "marker": _MARKERS[number % len(_MARKERS)],
        "markevery": max(1, n_points // 12),
        # lines are drawn over those before them, which stay visible around the smaller markers
        "markersize": 5.4 - 0.6 * min(number, 4),
    }


def add_line(
    panel: Axes, x: FloatArray, y: FloatArray, error: FloatArray | None = None, *, band: bool = False, **look: Any
) -> float:
    """A line with its errors as bars, or as a band; how high both reach, errors up to twice the largest value.

    x, y, error (n,): as shown, error NaN, infinite or 0 where there is none to draw.
    """
    (line,) = panel.plot(x, y, **look)
    highest = float(np.nanmax(y, initial=0.0))
    if error is None:
        return highest
    setattr(line, _ERROR, error)
    drawn = np.isfinite(error) & np.isfinite(y) & (error > 0.0)
    if not drawn.any():
        return highest
    x, y, error = x[drawn], y[drawn], error[drawn]
    # what is worn is not less than nothing
    low = np.where(y >= 0.0, np.maximum(y - error, 0.0), y - error)
    if band:
        panel.fill_between(x, low, y + error, color=line.get_color(), alpha=0.18, linewidth=0.0, gid="error")
    else:
        bars: dict[str, Any] = {"fmt": "none", "ecolor": line.get_color(), "elinewidth": 1.0, "capsize": 2.5}
        panel.errorbar(x, y, yerr=np.stack([y - low, error]), zorder=2.5, **bars)
    return max(highest, min(float((y + error).max()), 2.0 * highest))


def add_map(panel: Axes, x: ArrayLike, y: ArrayLike, values: NDArray[Any], norm: Normalize, **look: Any) -> None:
    """Cells (n_y, n_x) between their edges; cells without a value are hatched, so that they are not taken for one."""
    panel.grid(visible=False)
    panel.pcolormesh(x, y, np.ma.masked_invalid(values), norm=norm, **look)
    if np.isnan(values).any():
        panel.set_facecolor("white")
        panel.patch.set(hatch="xxx", edgecolor="0.55", linewidth=0.0)


def add_colour_bar(figure: Figure, panels: Any, norm: Normalize, label: str, **options: Any) -> None:
    """The colour bar of maps, dots or faces, below them in a narrow figure. panels, options: as for `colorbar`."""
    if is_narrow():
        options = {"location": "bottom", "aspect": 30, "pad": 0.01}
    figure.colorbar(ScalarMappable(norm), ax=panels, label=label, **options)


def add_legend(figure: Figure, handles: Sequence[Artist] | None = None) -> None:
    """A legend below all panels of these handles, by default of each label, if there are two; the figure grows."""
    if handles is None:
        handles = [handle for panel in figure.axes for handle in panel.get_legend_handles_labels()[0]]
    by_label = dict[str, Artist]()
    for handle in handles:
        by_label.setdefault(str(handle.get_label()), handle)
    if len(by_label) < 2:
        return
    room = int(_CHARACTERS * figure.get_figwidth())
    labels = [textwrap.fill(label, room - _MARK) for label in by_label]
    longest = max(len(line) for text in labels for line in text.split("\n")) + _MARK
    n_rows = math.ceil(len(labels) / max(1, room // longest))
    n_lines = n_rows + sum(text.count("\n") for text in labels)
    figure.set_figheight(figure.get_figheight() + _LEGEND_ROW * n_lines)
    figure.legend(list(by_label.values()), labels, loc="outside lower center", ncols=math.ceil(len(labels) / n_rows))


def set_from_zero(panel: Axes, largest: float | None = None) -> None:
    """Let the vertical axis begin at zero and end above the largest value, by default of what is drawn."""
    largest = float(panel.dataLim.ymax) if largest is None else largest
    panel.set_ylim(0.0, 1.06 * largest if largest > 0.0 else 1.0)


def label_outer(panels: NDArray[Any]) -> None:
    """Labels of axes at the left and below only; at the left of all panels of a narrow figure."""
    # not seen, but in the file of the numbers
    for panel in [] if is_narrow() else panels[:, 1:].flat:
        panel.yaxis.label.set_visible(False)
    for panel in panels[:-1].flat:
        panel.xaxis.label.set_visible(False)


def set_log(axis: Axis, low: float, high: float, percent: bool = False) -> None:
    """A logarithmic axis that shows values between these, above zero, with few ticks in few digits."""
    (axis.axes.set_xscale if isinstance(axis, XAxis) else axis.axes.set_yscale)("log")

    def show(value: float, _position: object) -> str:
        number = 100.0 * value if percent else value
        text = f"{number:.4g}" if 1e-3 <= number < 1e4 else show_power(number)
        return f"{text} %" if percent else text

    axis.set_minor_locator(NullLocator())
    steps = (1.0, 2.0, 5.0) if high < 20.0 * low else (1.0, 3.0) if high < 100.0 * low else (1.0,)
    axis.set_major_locator(LogLocator(subs=steps, numticks=_MOST_TICKS))
    axis.set_major_formatter(FuncFormatter(show))


def mark_failed(panel: Axes, positions: FloatArray, failed: NDArray[np.bool_]) -> str:
    """Crosses at those of positions (n,) where a line has failed (n_lines, n), and a sentence about them."""
    if not failed.any():
        return ""
    at = positions[failed.any(axis=0)]
    look: dict[str, Any] = {"linestyle": "none", "marker": "x", "color": "black", "markersize": 5, "zorder": 5}
    where = panel.get_xaxis_transform()
    panel.plot(at, np.zeros(at.size), clip_on=False, label="no result", transform=where, **look)
    return f"Crosses: at these, {int(failed.sum())} in all, no point has a result"


# --- items of the report, and their files ---


@dataclass(frozen=True)
class Drawing:
    """One figure. name: of its files."""

    name: str
    title: str
    caption: str
    figure: Figure

    def save(self, folder: Path) -> Path:
        """Write SVG, PNG and, of lines and maps, CSV files into a folder; the SVG file."""
        values = folder / f"{self.name}.csv"
        values.unlink(missing_ok=True)
        if rows := plotted_values(self.figure):
            with values.open("w", newline="", encoding="utf-8") as file:
                csv.writer(file).writerows([("panel", "series", "x", "x value", "y", "y value", "value"), *rows])
        # names of any length may leave the panels of a column no room
        with style(), warnings.catch_warnings(action="ignore", category=UserWarning):
            if self.figure.get_figwidth() < _WIDE:
                fit_into_column(self.figure)
            return _save(self.figure, folder / self.name)


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
        (x, y), label = line.get_data(), str(line.get_label())
        # the ends of error bars have this label
        if label != "_nolegend_" and (not label.startswith("_") or np.size(x) > 2):
            yield label, x, y, getattr(line, _ERROR, np.full(np.shape(y), np.nan))
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
