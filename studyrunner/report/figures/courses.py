"""What figures are drawn over: an axis of the study, or slow time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from studyrunner.report.drawing import FloatArray, line_style, set_log
from studyrunner.result.units import Scale, scale_for, units_of
from studyrunner.result.view import Result

_DECADES = 30.0
_MANY = 60


@dataclass(frozen=True)
class Course:
    """Numbers of one axis of the study, in rising order.

    axis: its name. index (n,): where each of them stands in the file. values (n,): as shown. label: with the unit.
    name: of the axis in words. logarithmic: whether to draw it so, as what spans decades is.
    """

    axis: str
    index: NDArray[np.intp]
    values: FloatArray
    label: str
    name: str
    logarithmic: bool

    def read(self, result: Result, name: str, point: Mapping[str, int]) -> FloatArray:
        """A variable along the course, at a point whose index along it does not matter: (n, what follows the axes)."""
        where = {axis: place for axis, place in point.items() if axis != self.axis}
        values = result.read(name).isel(where).transpose(self.axis, ...).values
        return np.asarray(values, dtype=float)[self.index]

    def along(self, result: Result, flags: NDArray[np.bool_], point: Mapping[str, int]) -> NDArray[np.bool_]:
        """Flags (axes...) of points along the course (n,)."""
        index = tuple(slice(None) if name == self.axis else point[name] for name in result.axes)
        return np.asarray(flags[index][self.index])

    def at(self, result: Result, place: int) -> str:
        """A place of the course in words."""
        return result.describe({self.axis: int(self.index[place])}, [self.axis])

    @property
    def edges(self) -> FloatArray:
        """Edges (n + 1,) of cells around the values, as shown."""
        if self.logarithmic:
            found: FloatArray = np.exp(cell_edges(np.log(self.values)))
            return found
        return cell_edges(self.values)

    def line_style(self, number: int) -> dict[str, Any]:
        """Style of a line over the course: a marker at each point, small where there are many."""
        found = line_style(number)
        return found | {"markersize": 0.5 * found["markersize"]} if self.values.size > _MANY else found

    def set_axis(self, panel: Axes) -> None:
        """Label and scale of a horizontal axis."""
        panel.set_xlabel(self.label)
        if self.logarithmic:
            set_log(panel.xaxis, float(self.values[0]), float(self.values[-1]))


def find_course(result: Result, axis: str | None = None) -> Course | None:
    """The course along an axis, by default along `course_axis`; None where it has one value."""
    axis = axis or result.course_axis
    if axis is None or axis not in result.varying:
        return None
    values = np.asarray(result.dataset[axis].values, dtype=float)
    scale = scale_for(units_of(result.dataset[axis]), values)
    index = np.argsort(values, kind="stable")
    shown = scale(values[index])
    name = axis.replace("_", " ")
    text = "excitation frequency" if axis == "frequency" else name
    decades = axis != "frequency" and bool(shown[0] > 0.0) and shown[-1] / shown[0] > _DECADES
    return Course(axis, index, shown, scale.label(text), name, decades)


def cell_edges(positions: FloatArray) -> FloatArray:
    """Edges (n + 1,) of cells around rising positions (n,), n > 1: halfway between them."""
    middle = 0.5 * (positions[1:] + positions[:-1])
    first, last = 2.0 * positions[0] - middle[0], 2.0 * positions[-1] - middle[-1]
    return np.concatenate([[first], middle, [last]])


def slow_time(result: Result, scale: Scale) -> str:
    """Label of an axis of slow time."""
    return scale.label("vibration cycles") if result.blocks is None else "missions"
