"""What came out of nonlinear modes."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studyrunner.coordinates import POINT
from studyrunner.result.view import Result
from studyrunner.summary.findings import Finding
from studyrunner.system.progress import count
from studyrunner.units import show_number

_MOST_MODES, _MOST_STATES = 4, 6
_SHOWN = {"natural_frequency": (1.0, 6, " Hz"), "damping_ratio": (100.0, 3, " %")}
"""Factor, digits and unit of what is said of a mode."""


def what_came_out(result: Result, stuck: float) -> Iterator[Finding]:
    """Of each mode the ends of natural frequency and damping ratio over the points where it was found."""
    del stuck
    varying = [name for name in result.varying if name not in ("mode", POINT)]
    numbers = [name for name in varying if result.dataset[name].dtype.kind in "iuf"]
    ends = {name: [show_number(float(result.dataset[name].values[place])) for place in (0, -1)] for name in numbers}
    over = ", ".join(f"{name.replace('_', ' ')} {' to '.join(each)}" for name, each in ends.items())
    axis = result.axes.index("mode")
    for index, number in enumerate(result.dataset["mode"].values.tolist()[:_MOST_MODES]):
        computed = result.computed.take(index, axis=axis)
        values: dict[str, Any] = {"n_found": int(computed.sum())}
        ranges = []
        for name, (factor, digits, unit) in _SHOWN.items():
            if result.has(name) and computed.any():
                of_mode = result.dataset[name].values.take(index, axis=axis)[computed]
                values[name] = [float(of_mode.min()), float(of_mode.max())]
                texts = dict.fromkeys(f"{factor * each:.{digits}g}" for each in values[name])
                ranges.append(f"{name.replace('_', ' ')} {' to '.join(texts)}{unit}")
        text = ", ".join(ranges) + (f" over {over}" if ranges and over else "")
        text += _over_the_life(result, index) if computed.all() else ""
        if not ranges or not computed.all():
            text += f"{', ' if text else ''}found at {values['n_found']} of {count(computed.size, 'point')}"
        yield Finding(f"mode {number}", f"mode {number}", text, values)


def _over_the_life(result: Result, mode: int) -> str:
    """Frequency and damping of a mode in the order of the wear before, at the last values of the other axes; "" of one
    state, or of many. mode: its place.
    """
    if not 1 < result.dataset.sizes["cycle"] <= _MOST_STATES or not result.has(*_SHOWN):
        return ""
    point = {name: result.dataset.sizes[name] - 1 for name in result.axes if name != "cycle"} | {"mode": mode}
    rows = (result.at(name, point).values * factor for name, (factor, *_) in _SHOWN.items())
    looks = ((digits, unit) for _, digits, unit in _SHOWN.values())
    values = (", ".join(f"{each:.{n}g}" for each in row) + unit for row, (n, unit) in zip(rows, looks, strict=True))
    cycles = ", ".join(show_number(each) for each in result.dataset["cycle"].values.tolist())
    at = result.describe(point, [name for name in result.varying if name not in ("mode", "cycle")])
    return f"; after {cycles} cycles {' and '.join(values)}" + (f" at {at}" if at else "")


def errors_of(result: Result, *, wore: bool) -> tuple[str, NDArray[np.float64]]:
    """What is known with which relative errors: the larger one of natural frequency and damping ratio."""
    del wore
    errors = np.zeros(result.computed.shape)
    for name in ("natural_frequency", "damping_ratio"):
        if result.has(name, f"{name}_error"):
            value, error = np.abs(result.dataset[name].values), result.dataset[f"{name}_error"].values
            errors = np.maximum(errors, np.where(value > 0.0, error / np.where(value > 0.0, value, 1.0), 0.0))
    return "point", errors
