"""What the report is made of: drawings, tables, and sentences about what is missing; how drawings look, and titles."""

from __future__ import annotations

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
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.textpath import TextPath
from matplotlib.ticker import AutoLocator, FixedLocator, FuncFormatter, MaxNLocator, NullLocator
from numpy.typing import NDArray

from studyrunner.result.units import show_power
from studyrunner.result.view import Result

WIDTH = 7.5
"""Inches of a figure across a printed page: 190 mm, both columns of a journal."""

COLUMN_WIDTH = 3.55
"""Inches of a figure in one column of a journal: 90 mm."""

_COLUMN_HEIGHT = 2.6
_COLUMN_LABEL = 28
"""Characters of a vertical label that fit beside such a panel."""

DPI = 200
"""Of what is drawn as pixels in the SVG files."""

PRINT_DPI = 300
"""Of the PNG files, as journals ask for."""

_MANY = 600
"""Points of a line from which on it is pixels in the SVG files, as maps are."""

MAP = "cividis"
"""Colour map of values from low to high: its lightness grows evenly, and it looks the same to the colour blind."""

# Okabe & Ito (2008), "Color universal design", without its yellow, which vanishes on white. Lightness differs as well.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#000000", "#CC79A7", "#E69F00", "#56B4E9")
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)), (0, (3, 1, 1, 1, 1, 1)))
_CHARACTERS = 13.0
"""Of a label of a legend, in an inch."""
_LEGEND_ROW = 0.18
"""Inches of one row of a legend."""
_MARKERS = ("o", "s", "^", "D", "v", "P", "X")
_FEWEST_TICKS, _MOST_TICKS = 3, 6
_NAMED = ("frequency", "scheme")
"""Axes that titles of figures of a single point name."""

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
    # Formulas as tick labels take most of the time of a figure.
    "axes.formatter.use_mathtext": False,
    # Names of a file are text, whatever signs they have.
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
    """One figure. name: of its file, without suffix. caption: plain sentences that say what is seen."""

    name: str
    title: str
    caption: str
    figure: Figure

    def save(self, folder: Path) -> tuple[Path, ...]:
        """Write `<name>.svg` and `<name>.png` into a folder that exists; the SVG files.

        A figure of one panel also becomes `<name>_column.svg` and `<name>_column.png`, as wide as a column.
        """
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
        if len(panels) != 1 or panels[0].name != "rectilinear" or panels[0].findobj(QuadMesh):
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


@contextmanager
def style() -> Iterator[None]:
    """Inside, figures are built and saved in the one style of the report, whatever a file matplotlibrc says."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


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
    # What stands where is the same for both: it is found once.
    figure.set_layout_engine("none")
    figure.savefig(png, format="png", dpi=PRINT_DPI)
    return svg


def set_in_column(figure: Figure) -> None:
    """Lay a figure of one panel out anew, as wide as a column of a journal; its text keeps its size."""
    figure.set_size_inches(COLUMN_WIDTH, _COLUMN_HEIGHT)
    figure.set_layout_engine("constrained")
    legends = list(figure.legends)
    for legend in legends:
        legend.remove()
    (panel,) = figure.axes
    panel.set_ylabel(textwrap.fill(panel.get_ylabel(), _COLUMN_LABEL, break_on_hyphens=False))
    if isinstance(panel.yaxis.get_major_locator(), AutoLocator):
        # steps of 2.5 have one digit more: with them the layout goes to and fro
        panel.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    if legends:
        add_legend(figure)


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure, of a size in inches, that lays itself out. It is none of pyplot: nothing has to close it."""
    return Figure(figsize=(width, height), layout="constrained")


def new_panels(n_rows: int, n_columns: int, height: float, **options: Any) -> tuple[Figure, NDArray[Any]]:
    """A figure and its axes (n_rows, n_columns)."""
    figure = new_figure(height)
    panels: NDArray[Any] = figure.subplots(n_rows, n_columns, squeeze=False, **options)
    return figure, panels


def line_style(number: int, n_points: int = 0) -> dict[str, Any]:
    """Colour, dashes and marker of the line of this number: each tells it from the others.

    n_points: on the line; where there are many, markers stand on some of them only.
    """
    return {
        "color": COLOURS[number % len(COLOURS)],
        "linestyle": _DASHES[number % len(_DASHES)],
        "marker": _MARKERS[number % len(_MARKERS)],
        "markevery": max(1, n_points // 12),
        # Lines are drawn over those before them, which stay visible around the smaller markers.
        "markersize": 5.4 - 0.6 * min(number, 4),
    }


def add_legend(figure: Figure, handles: Sequence[Artist] | None = None) -> None:
    """A legend below all panels, where it covers no curve, in as many columns as fit; the figure grows by its height.

    handles: what is named; by default whatever has a label in any panel, each label once.
    """
    if handles is None:
        found: dict[str, Artist] = {}
        for panel in figure.axes:
            for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
                found.setdefault(str(label), handle)
    else:
        found = {str(handle.get_label()): handle for handle in handles}
    if not found:
        return
    labels = [textwrap.fill(label, int(_CHARACTERS * figure.get_figwidth())) for label in found]
    size = FontProperties(size=mpl.rcParams["legend.fontsize"]).get_size_in_points()
    gap = size * mpl.rcParams["legend.columnspacing"]
    mark = size * (mpl.rcParams["legend.handlelength"] + mpl.rcParams["legend.handletextpad"])
    widest = max(TextPath((0, 0), line, size=size).get_extents().width for text in labels for line in text.split("\n"))
    room = 72.0 * figure.get_figwidth() - size
    n_columns = max(1, min(len(labels), int((room + gap) // (widest + mark + gap))))
    n_rows = math.ceil(len(labels) / n_columns)
    # as even as that number of rows allows
    n_columns = math.ceil(len(labels) / n_rows)
    more = sum(text.count("\n") for text in labels)
    figure.set_figheight(figure.get_figheight() + _LEGEND_ROW * (n_rows + more))
    figure.legend(list(found.values()), labels, loc="outside lower center", ncols=n_columns)


def set_from_zero(panel: Axes, largest: float) -> None:
    """Let the vertical axis begin at zero, and end at something where all values are zero."""
    panel.set_ylim(0.0, 1.06 * largest if largest > 0.0 else 1.0)


def add_colour_bar(figure: Figure, panels: Any, norm: Normalize, label: str, **options: Any) -> None:
    """The colour bar of maps, dots or faces. panels, options: as for `colorbar`; cmap: another than `MAP`."""
    figure.colorbar(ScalarMappable(norm, options.pop("cmap", None)), ax=panels, label=label, **options)


def set_log(axis: Axis, low: float, high: float, percent: bool = False) -> None:
    """A logarithmic axis that shows values between these, above zero, with three to six ticks in few digits."""
    if isinstance(axis, XAxis):
        axis.axes.set_xscale("log")
    else:
        axis.axes.set_yscale("log")
    decades = [10.0**power for power in range(math.floor(math.log10(low)) - 1, math.ceil(math.log10(high)) + 2)]
    if high < 20.0 * low:
        low, high = 0.9 * low, 1.1 * high
    for steps in ((1.0,), (1.0, 3.0), (1.0, 2.0, 5.0), (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)):
        ticks = [factor * decade for decade in decades for factor in steps if low <= factor * decade <= high]
        if len(ticks) >= _FEWEST_TICKS:
            break
    ticks = ticks[:: -(-len(ticks) // _MOST_TICKS)] if ticks else []
    axis.set_minor_locator(NullLocator())
    axis.set_major_locator(FixedLocator(ticks))
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


def mark_failed(panel: Axes, positions: NDArray[np.float64], failed: NDArray[np.bool_]) -> int:
    """Crosses on the horizontal axis where points have no result; how many these are.

    positions (n,): along the axis. failed (n_lines, n).
    """
    n_failed = int(np.count_nonzero(failed))
    if n_failed:
        at = positions[failed.any(axis=0)]
        panel.plot(
            at,
            np.zeros(at.size),
            linestyle="none",
            marker="x",
            color="black",
            markersize=5,
            clip_on=False,
            label="no result",
            transform=panel.get_xaxis_transform(),
            zorder=5,
        )
    return n_failed


def title_at(result: Result, title: str, over: str = "") -> str:
    """The title of a figure of the shown point: with its frequency, its scheme, and what else varies.

    over: an axis that the figure is drawn over.
    """
    names = [name for name in result.axes if name in _NAMED or name in (*result.varying, *result.fixed)]
    names = [name for name in names if name != over]
    where = result.describe(result.shown_point(), names)
    return f"{title}: {where}" if where else title
