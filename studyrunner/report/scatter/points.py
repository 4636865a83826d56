"""Statistics of the combinations of axes that a figure of samples shows, and how its panels stand."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from studyrunner.report.drawing import new_panels
from studyrunner.report.reading.choice import choose
from studyrunner.report.reading.result import Point, Result
from studyrunner.report.reading.sample_statistics import DRAWN, SAMPLE

MOST_PANELS = 4
LOWEST, HIGHEST = 0, 1
"""Places along the dimension `bound`."""


@dataclass(frozen=True)
class Shown:
    """Combinations of the axes with their statistics. sentence: on those that are left out; may be empty."""

    points: tuple[Point, ...]
    labels: tuple[str, ...]
    statistics: tuple[xr.Dataset, ...]
    sentence: str

    def __iter__(self) -> Iterator[tuple[Point, str, xr.Dataset]]:
        """Combinations, their labels and statistics."""
        return iter(zip(self.points, self.labels, self.statistics, strict=True))


def choose_points(
    result: Result, statistics: xr.Dataset, free: Collection[str] = (), limit: int = MOST_PANELS
) -> Shown:
    """Combinations of the axes beside samples and `free`, at most `limit`; that of the shown point is among them."""
    choice = choose(result, [SAMPLE, *free], limit)
    found = tuple(statistics_at(statistics, point) for point in choice.points)
    return Shown(choice.points, choice.labels, found, choice.sentence)


def statistics_at(statistics: xr.Dataset, point: Point) -> xr.Dataset:
    """Statistics of one combination of the axes."""
    return statistics.isel({name: index for name, index in point.items() if name in statistics.dims})


def last_of(statistics: xr.Dataset) -> xr.Dataset:
    """Statistics at the last cycle count."""
    return statistics.isel(cycle=-1, missing_dims="ignore")


def ends(statistics: xr.Dataset, name: str, *dims: str) -> NDArray[np.float64]:
    """A statistic (dims..., 2): its lowest and its highest value."""
    return np.asarray(statistics[name].transpose(*dims, "bound").values, dtype=float)


def largest(*values: NDArray[np.float64]) -> float:
    """Largest finite value, 0 where there is none."""
    return max((float(each[np.isfinite(each)].max(initial=0.0)) for each in values), default=0.0)


def drawn_values(result: Result, name: str, point: Point) -> tuple[NDArray[np.float64], str, str]:
    """What the samples draw of an input (n_samples,) at a point, its unit and its name in words.

    Of an input with a draw for each pair it is the mean over the pairs.
    """
    drawn = result.dataset[f"{DRAWN}{name}"]
    drawn = drawn.isel({axis: index for axis, index in point.items() if axis in drawn.dims and axis != SAMPLE})
    words = name.replace("_", " ")
    if "contact" in drawn.dims:
        drawn, words = drawn.mean("contact", keep_attrs=True), f"mean {words} of the pairs"
    units = str(drawn.attrs.get("units", ""))
    return np.asarray(drawn.values, dtype=float), "" if units == "1" else units, words


def panel_grid(number: int, height: float, **options: Any) -> tuple[Figure, NDArray[Any]]:
    """A figure and its panels (rows, columns), two by two where there are four, else side by side."""
    n_columns = 2 if number == MOST_PANELS else number
    n_rows = -(-number // n_columns)
    return new_panels(n_rows, n_columns, 0.5 + height * n_rows, **options)
