"""What the report is made of: drawings, tables, and sentences about what is missing; how drawings look."""

from __future__ import annotations

import csv
import math
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
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
from matplotlib.ticker import AutoLocator, FixedLocator, FuncFormatter, MaxNLocator, NullLocator
from numpy.typing import NDArray

from studyrunner.result.units import show_power
from studyrunner.result.view import Result

FloatArray = NDArray[np.float64]

WIDTH, COLUMN_WIDTH = 7.5, 3.55
"""Inches of a figure across a printed page, 190 mm, and in one column of a journal, 90 mm."""

_COLUMN_HEIGHT, _COLUMN_LABEL = 2.6, 28  # inches; characters of a vertical label that fit beside such a panel
DPI, PRINT_DPI = 200, 300
"""Of what is drawn as pixels in the SVG files; of the PNG files, as journals ask for."""

_MANY = 600  # points of a line from which on it is pixels in the SVG files, as maps are

MAP = "cividis"
"""Colour map of values from low to high: its lightness grows evenly, and it looks the same to the colour blind."""

# Okabe & Ito (2008), "Color universal design", without its yellow, which vanishes on white. Lightness differs as well.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#000000", "#CC79A7", "#E69F00", "#56B4E9")
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)), (0, (3, 1, 1, 1, 1, 1)))
_MARKERS = ("o", "s", "^", "D", "v", "P", "X")
_CHARACTERS, _MARK, _LEGEND_ROW = 14.0, 6, 0.18  # of a legend: letters in an inch, a mark in letters, inches of a row
_FEWEST_TICKS, _MOST_TICKS = 3, 6
_ERROR = "fretwear_error"  # attribute of a line: the error of its values

_STYLE: Any = {
    "font.size": 9.5,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9.5,
    "legend.fontsize": 8.5,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 5),
    # formulas as tick labels take most of the time of a figure
    "axes.formatter.use_mathtext": False,
    # names of a file are text, whatever signs they have
    "text.parse_math": False,
    "grid.color": "#d9d9d9",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.6,
    "lines.markersize": 4.0,
    "legend.frameon": False,
    "legend.borderpad": 0.0,
    "legend.columnspacing": 1.4,
    "image.cmap": MAP,
    "figure.dpi": DPI,
    "savefig.dpi": DPI,
    "svg.fonttype": "none",
    "svg.hashsalt": "fretwear",
}


@dataclass(frozen=True)
class Drawing:
    """One figure. name: of its files, without suffix. caption: plain sentences that say what is seen."""

    name: str
    title: str
    caption: str
    figure: Figure

    def save(self, folder: Path) -> tuple[Path, ...]:
        """Write `<name>.svg`, `<name>.png` and `<name>.csv` into a folder that exists; the SVG files.

        A figure of one panel also becomes `<name>_column.svg` and `<name>_column.png`, as wide as a column. A figure
        without lines and maps has no CSV file.
        """
        values = folder / f"{self.name}.csv"
        values.unlink(missing_ok=True)
        if rows := plotted_values(self.figure):
            with values.open("w", newline="", encoding="utf-8") as file:
                csv.writer(file).writerows([("panel", "series", "x", "x value", "y", "y value", "value"), *rows])
        with style():
            paths = [_save(self.figure, folder / self.name)]
            if self.fits_column:
                set_in_column(self.figure)
                paths.append(_save(self.figure, folder / f"{self.name}_column"))
        return tuple(paths)

    @property
    def fits_column(self) -> bool:
        """Whether it has one plane panel, no map, and its legend names what is drawn in it."""
        panels, legends = self.figure.axes, self.figure.legends
        if len(panels) != 1 or panels[0].findobj(QuadMesh):
            return False
        labels = set(panels[0].get_legend_handles_labels()[1])
        return all({text.get_text() for text in legend.get_texts()} <= labels for legend in legends)


@dataclass(frozen=True)
class Missing:
    """A figure that is left out. sentence: what the file does not hold, and what to ask for."""

    name: str
    title: str
    sentence: str


@dataclass(frozen=True)
class Table:
    """Rows of text, each as long as `columns`. note: what is seen; may be empty."""

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


Item = Drawing | Missing | Table


@contextmanager
def style() -> Iterator[None]:
    """Inside, figures are built and saved in the one style of the report, whatever a file matplotlibrc says."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def plotted_values(figure: Figure) -> list[tuple[object, ...]]:
    """The numbers of all lines, dots and maps of a figure, as shown: rows of panel, series, x, its value, y, its value.

    The last column is the error of a value of a line, or the value of a cell or dot of a map.
    """
    rows: list[tuple[object, ...]] = []
    for panel in figure.axes:
        texts = [" ".join(text.split()) for text in (panel.get_title(), panel.get_xlabel(), panel.get_ylabel())]
        found: list[tuple[str, Any, Any, Any]] = []
        for line in panel.get_lines():
            x, y = line.get_data()
            if not str(line.get_label()).startswith("_") or np.size(x) > 2:
                found.append((str(line.get_label()), x, y, getattr(line, _ERROR, np.full(np.shape(y), np.nan))))
        for each in panel.collections:
            if isinstance(each, QuadMesh) and panel.get_label() != "<colorbar>":
                corners = np.asarray(each.get_coordinates())
                x, y = np.moveaxis(0.5 * (corners[1:, 1:] + corners[:-1, :-1]), 2, 0)
                values: Any = np.ma.filled(np.ma.asarray(each.get_array(), float), np.nan)
                found.append(("map", x, y, values))
            elif isinstance(each, PathCollection):
                x, y = np.asarray(each.get_offsets()).T
                values = each.get_array()
                found.append((str(each.get_label()), x, y, np.full(x.size, np.nan) if values is None else values))
        for series, *columns in found:
            for x, y, value in zip(*(np.ravel(column) for column in columns), strict=True):
                numbers = ["" if not np.isfinite(number) else f"{number:.9g}" for number in (x, y, value)]
                rows.append((texts[0], series, texts[1], numbers[0], texts[2], *numbers[1:]))
    return rows


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
    figure.savefig(png, format="png", dpi=PRINT_DPI)
    return svg


def set_in_column(figure: Figure) -> None:
    """Lay a figure of one panel out anew, as wide as a column of a journal; its text keeps its size."""
    figure.set_size_inches(COLUMN_WIDTH, _COLUMN_HEIGHT)
    figure.set_layout_engine("constrained")
    handles = [handle for legend in figure.legends for handle in legend.legend_handles]
    for legend in list(figure.legends):
        legend.remove()
    (panel,) = figure.axes
    panel.set_ylabel(textwrap.fill(panel.get_ylabel(), _COLUMN_LABEL, break_on_hyphens=False))
    if isinstance(panel.yaxis.get_major_locator(), AutoLocator):
        # steps of 2.5 have one digit more: with them the layout goes to and fro
        panel.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    if handles:
        add_legend(figure)


def new_panels(n_rows: int, n_columns: int, height: float, **options: Any) -> tuple[Figure, NDArray[Any]]:
    """A figure, inches high, that lays itself out, and its axes (n_rows, n_columns). Nothing has to close it."""
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    panels: NDArray[Any] = figure.subplots(n_rows, n_columns, squeeze=False, **options)
    return figure, panels


def new_panel(height: float) -> tuple[Figure, Axes]:
    """A figure of one panel."""
    figure, panels = new_panels(1, 1, height)
    return figure, panels[0, 0]


def line_style(number: int, n_points: int = 0) -> dict[str, Any]:
    """Colour, dashes and marker of the line of this number.

    n_points: on the line; where there are many, markers stand on some of them only.
    """
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
    """A line with the errors of its values as bars, or as a band; how high it and its errors reach.

    x, y, error (n,): as shown, error NaN, infinite or 0 where there is none to draw. Errors count to the height as far
    as twice the largest value: those that leave the values too little room are cut.
    """
    (line,) = panel.plot(x, y, **look)
    highest = float(np.nanmax(y, initial=0.0))
    if error is None:
        return highest
    setattr(line, _ERROR, error)
    drawn = np.isfinite(error) & np.isfinite(y) & (error > 0.0)
    if not drawn.any():
        return highest
    # what is worn is not less than nothing
    at, high = x[drawn], (y + error)[drawn]
    low = np.where(y[drawn] >= 0.0, np.maximum(y[drawn] - error[drawn], 0.0), y[drawn] - error[drawn])
    if band:
        panel.fill_between(at, low, high, color=line.get_color(), alpha=0.18, linewidth=0.0, gid="error")
    else:
        sides = np.stack([y[drawn] - low, error[drawn]])
        bars: dict[str, Any] = {"fmt": "none", "ecolor": line.get_color(), "elinewidth": 1.0, "capsize": 2.5}
        panel.errorbar(at, y[drawn], yerr=sides, zorder=2.5, **bars)
    return max(highest, min(float(high.max()), 2.0 * highest))


def add_legend(figure: Figure, handles: Sequence[Artist] | None = None) -> None:
    """A legend below all panels, where it covers no curve, in as many columns as fit; the figure grows by its height.

    handles: what is named; by default whatever has a label in any panel, each label once, if there are at least two.
    """
    found: dict[str, Any] = {str(handle.get_label()): handle for handle in handles or ()}
    if handles is None:
        for panel in figure.axes:
            for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
                found.setdefault(str(label), handle)
    if len(found) < 2:
        return
    room = int(_CHARACTERS * figure.get_figwidth())
    labels = [textwrap.fill(label, room - _MARK) for label in found]
    longest = max(len(line) for text in labels for line in text.split("\n")) + _MARK
    n_rows = math.ceil(len(labels) / max(1, room // longest))
    n_lines = n_rows + sum(text.count("\n") for text in labels)
    figure.set_figheight(figure.get_figheight() + _LEGEND_ROW * n_lines)
    figure.legend(list(found.values()), labels, loc="outside lower center", ncols=math.ceil(len(labels) / n_rows))


def set_from_zero(panel: Axes, largest: float) -> None:
    """Let the vertical axis begin at zero, and end at something where all values are zero."""
    panel.set_ylim(0.0, 1.06 * largest if largest > 0.0 else 1.0)


def add_colour_bar(figure: Figure, panels: Any, norm: Normalize, label: str, **options: Any) -> None:
    """The colour bar of maps, dots or faces. panels, options: as for `colorbar`."""
    figure.colorbar(ScalarMappable(norm), ax=panels, label=label, **options)


def label_outer(panels: NDArray[Any]) -> None:
    """Labels of axes at the left and below only."""
    for panel in panels[:, 1:].flat:
        panel.set_ylabel("")
    for panel in panels[:-1].flat:
        panel.set_xlabel("")


def set_log(axis: Axis, low: float, high: float, percent: bool = False) -> None:
    """A logarithmic axis that shows values between these, above zero, with three to six ticks in few digits."""
    (axis.axes.set_xscale if isinstance(axis, XAxis) else axis.axes.set_yscale)("log")
    decades = [10.0**power for power in range(math.floor(math.log10(low)) - 1, math.ceil(math.log10(high)) + 2)]
    if high < 20.0 * low:
        low, high = 0.9 * low, 1.1 * high
    for steps in ((1.0,), (1.0, 3.0), (1.0, 2.0, 5.0), (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)):
        ticks = [factor * decade for decade in decades for factor in steps if low <= factor * decade <= high]
        if len(ticks) >= _FEWEST_TICKS:
            break
    axis.set_minor_locator(NullLocator())
    axis.set_major_locator(FixedLocator(ticks[:: -(-len(ticks) // _MOST_TICKS) or 1]))
    axis.set_major_formatter(FuncFormatter(lambda value, _: _show_tick(value, percent)))


def _show_tick(value: float, percent: bool) -> str:
    number = 100.0 * value if percent else value
    text = f"{number:.4g}" if 1e-3 <= number < 1e4 else show_power(number)
    return f"{text} %" if percent else text


def hatch_empty(panel: Axes, anything_empty: bool) -> None:
    """Hatch what a map leaves empty, so that it is not taken for a value."""
    if anything_empty:
        panel.set_facecolor("white")
        panel.patch.set(hatch="xxx", edgecolor="0.55", linewidth=0.0)


def mark_failed(panel: Axes, positions: FloatArray, failed: NDArray[np.bool_]) -> str:
    """Crosses on the horizontal axis where points have no result; a sentence about them, empty where there are none.

    positions (n,): along the axis. failed (n_lines, n).
    """
    if not failed.any():
        return ""
    at = positions[failed.any(axis=0)]
    look: dict[str, Any] = {"linestyle": "none", "marker": "x", "color": "black", "markersize": 5, "zorder": 5}
    where = panel.get_xaxis_transform()
    panel.plot(at, np.zeros(at.size), clip_on=False, label="no result", transform=where, **look)
    return f"Crosses: at these, {int(failed.sum())} in all, no point has a result"


def title_at(result: Result, title: str, over: str = "") -> str:
    """The title of a figure of the shown point: with its frequency, its scheme, and what else varies.

    over: an axis that the figure is drawn over.
    """
    named = ("frequency", "scheme", *result.varying, *result.fixed)
    where = result.describe(result.shown_point(), [name for name in result.axes if name in named and name != over])
    return f"{title}: {where}" if where else title
