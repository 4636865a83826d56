"""What a figure shows of a result: some combinations of the axes, and an axis, or slow time, to draw over."""

import itertools
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from studyrunner.coordinates import POINT, SAMPLE
from studyrunner.report.drawing import FloatArray, line_style, set_log
from studyrunner.result.view import Result
from studyrunner.units import Scale, scale_for, units_of

_DECADES = 30.0  # largest over smallest value from which an axis is logarithmic
_MANY = 60  # points from which markers are small


@dataclass(frozen=True)
class Choice:
    """Points that a figure shows, with labels, and a sentence where there are others. It iterates over both."""

    points: tuple[dict[str, int], ...]
    labels: tuple[str, ...]
    sentence: str

    def __iter__(self) -> Iterator[tuple[dict[str, int], str]]:
        return iter(zip(self.points, self.labels, strict=True))


def choose(result: Result, free: Collection[str], limit: int, first: tuple[str, ...] = ("scheme", "sweep")) -> Choice:
    """At most `limit` combinations of the axes that are not `free`, along which each is the shown point.

    The combination of the shown point is among them. The axes `first` are split first, then the others, each whole or
    not at all; the rest stays at the shown point.
    """
    order = [name for name in dict.fromkeys((*first, *result.axes)) if name in result.varying and name not in free]
    shown = result.shown
    sizes, split, number = result.dataset.sizes, list[str](), 1
    for name in order:
        if number * sizes[name] <= limit:
            split.append(name)
            number *= sizes[name]
    split.sort(key=result.axes.index)
    places = itertools.product(*(range(sizes[name]) for name in split))
    points = tuple({**shown, **dict(zip(split, place, strict=True))} for place in places)
    fixed = [name for name in result.axes if name in {*order, *result.fixed} - {*split, *free}]
    sentence = f"Shown for {result.describe(shown, fixed)} alone" if fixed else ""
    return Choice(points, tuple(result.describe(point, split) for point in points), sentence)


@dataclass(frozen=True)
class Course:
    """Numbers of one axis of the study, in rising order.

    axis: its name. index (n,): where each of them stands in the file. values (n,): as shown. label: with the unit.
    logarithmic: whether to draw it so, as what spans decades is.
    """

    result: Result
    axis: str
    index: NDArray[np.intp]
    values: FloatArray
    label: str
    logarithmic: bool

    def choose(self, limit: int, **options: Any) -> Choice:
        """`choose` with a line over the course for each combination of the other axes."""
        return choose(self.result, [self.axis], limit, **options)

    def read(self, values: str | NDArray[Any], *points: Mapping[str, int]) -> FloatArray:
        """A variable, or values (axes...), along the course: (n_points, n, what follows the axes).

        points: of which the index along the course does not matter.
        """
        array = self.result.dataset[values] if isinstance(values, str) else xr.DataArray(values, dims=self.result.axes)
        others = [{name: index for name, index in point.items() if name != self.axis} for point in points]
        lines = [array.isel(each).transpose(self.axis, ...).values[self.index] for each in others]
        return np.array(lines, dtype=float)

    def at(self, place: int) -> str:
        """A place of the course in words."""
        return self.result.describe({self.axis: int(self.index[place])}, [self.axis])

    @property
    def edges(self) -> FloatArray:
        """Edges (n + 1,) of cells around the values, as shown."""
        if self.logarithmic:
            return np.asarray(np.exp(cell_edges(np.log(self.values))))
        return cell_edges(self.values)

    def line_style(self, number: int) -> dict[str, Any]:
        """Style of a line over the course: a marker at each point, small where there are many."""
        style = line_style(number)
        return style | {"markersize": 0.5 * style["markersize"]} if self.values.size > _MANY else style

    def set_axis(self, panel: Axes) -> None:
        """Label and scale of a horizontal axis."""
        panel.set_xlabel(self.label)
        if self.logarithmic:
            set_log(panel.xaxis, float(self.values[0]), float(self.values[-1]))


def course_axis(result: Result) -> str | None:
    """The axis that figures are drawn over: the frequency, or where it does not vary the first other axis of several
    numbers; None where nothing but words, samples and points of a design varies.
    """
    varying = [name for name in result.varying if name not in (POINT, SAMPLE)]
    numbers = [name for name in varying if result.dataset[name].dtype.kind in "iuf"]
    of_first_rank = [name for name in ("frequency", *result.kind.last_axes) if name in numbers]
    return next(iter(of_first_rank + numbers), None)


def find_course(result: Result, axis: str | None = None) -> Course | None:
    """The course along an axis, by default along `course_axis`; None where it has one value."""
    axis = axis or course_axis(result)
    if axis is None or axis not in result.varying:
        return None
    values = np.asarray(result.dataset[axis].values, dtype=float)
    scale, index = scale_for(units_of(result.dataset[axis]), values), np.argsort(values, kind="stable")
    shown = scale(values[index])
    text = "excitation frequency" if axis == "frequency" else axis.replace("_", " ")
    return Course(result, axis, index, shown, scale.label(text), axis != "frequency" and spans_decades(shown))


def spans_decades(rising: FloatArray) -> bool:
    """Whether rising values are drawn on a logarithmic axis."""
    return bool(rising[0] > 0.0 and rising[-1] / rising[0] > _DECADES)


def cell_edges(positions: FloatArray) -> FloatArray:
    """Edges (n + 1,) of cells around rising positions (n,), n > 1: halfway between them."""
    middle = 0.5 * (positions[1:] + positions[:-1])
    first, last = 2.0 * positions[0] - middle[0], 2.0 * positions[-1] - middle[-1]
    return np.concatenate([[first], middle, [last]])


def slow_time(result: Result, scale: Scale) -> str:
    """Label of an axis of slow time."""
    return scale.label("vibration cycles") if result.kind.counted == "cycle" else result.counted


def labelled(text: str, label: str) -> str:
    """A number in words with the combination that it belongs to, if there are several."""
    return f"{text} ({label})" if label else text
