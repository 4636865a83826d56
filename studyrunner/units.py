"""Numbers as a reader wants them: a prefix that fits the largest value, few digits, errors in percent.

By hand: `EngFormatter` of matplotlib and `to_compact` of pint choose a prefix for each number.
"""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from studyrunner.coordinates import COORDINATES

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

_LARGE = 1e7  # from here on, numbers that were rounded are shown with an exponent
_ROUND_OFF = 1e-12  # of the largest value that is shown
_SPACE = "\N{NO-BREAK SPACE}"
_DIGITS = range(2, 13)

# Of each unit in SI: smallest value that is shown so, factor, unit; from large to small, the last for all below.
_SCALES: dict[str, tuple[tuple[float, float, str], ...]] = {
    "m": ((1.0, 1.0, "m"), (0.5e-3, 1e3, "mm"), (0.1e-6, 1e6, "µm"), (0.0, 1e9, "nm")),
    "m2": ((0.1, 1.0, "m²"), (0.0, 1e6, "mm²")),
    "m3": ((0.1, 1.0, "m³"), (1e-13, 1e9, "mm³"), (0.0, 1e18, "µm³")),
    "m3 per cycle": (
        *((1e-4, 1.0, "m³ per cycle"), (1e-10, 1e9, "mm³ per cycle")),
        *((1e-17, 1e12, "mm³ per kcycle"), (0.0, 1e18, "µm³ per cycle")),
    ),
    "m3 per mission": ((1e-4, 1.0, "m³ per mission"), (1e-13, 1e9, "mm³ per mission"), (0.0, 1e18, "µm³ per mission")),
    "Pa": ((2e9, 1e-9, "GPa"), (0.1e6, 1e-6, "MPa"), (100.0, 1e-3, "kPa"), (0.0, 1.0, "Pa")),
    "J/m2": ((2e5, 1e-6, "MJ/m²"), (200.0, 1e-3, "kJ/m²"), (0.0, 1.0, "J/m²")),
    "N/m3": ((0.0, 1e-12, "MPa/µm"),),
    "N": ((5e3, 1e-3, "kN"), (0.1, 1.0, "N"), (0.0, 1e3, "mN")),
    "cycles": ((5e6, 1e-6, "Mcycles"), (5e3, 1e-3, "kcycles"), (0.0, 1.0, "cycles")),
    "m kg^0.5": ((0.0, 1.0, "m√kg"),),
    "rad": ((0.0, 180.0 / np.pi, "°"),),
}
_OF_ZERO = ("mm", "mm³", "mm³ per kcycle", "MPa", "N")
"""Units of an engineer, for values that are all zero."""

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Scale:
    """How values in SI are shown: times `factor`, in `unit`, which is empty for plain numbers.

    least: in SI; smaller magnitudes are round-off, and shown as zero.
    """

    factor: float
    unit: str
    least: float = field(default=0.0, compare=False)

    def __call__(self, values: "ArrayLike") -> "NDArray[np.float64]":
        """Values as shown."""
        return np.asarray(values, dtype=float) * self.factor

    def label(self, text: str) -> str:
        """Label of an axis."""
        return f"{text} ({self.unit})" if self.unit else text

    def show(self, value: float, digits: int = 3) -> str:
        """One value in SI, as text with its unit."""
        text = show_number(value * self.factor if abs(value) >= self.least else 0.0, digits)
        return f"{text} {self.unit}" if self.unit else text


def scale_for(units: str, *values: "ArrayLike") -> Scale:
    """Scale for values in these units of SI, by the largest magnitude among them; NaN and infinities do not count."""
    arrays = [np.abs(np.asarray(each, dtype=float)) for each in values]
    largest = max((float(each.max(initial=0.0, where=np.isfinite(each))) for each in arrays), default=0.0)
    steps = _SCALES.get(units, ((0.0, 1.0, "" if units == "1" else units),))
    if largest == 0.0:
        return next((Scale(factor, unit) for _, factor, unit in steps if unit in _OF_ZERO), Scale(*steps[-1][1:]))
    least = _ROUND_OFF * largest
    return next(Scale(factor, unit, least) for smallest, factor, unit in steps if largest >= smallest)


def show_number(value: float, digits: int = 6) -> str:
    """A number in few digits; thousands set apart. Whole numbers keep all of theirs."""
    text = f"{value:.{digits}g}"
    if float(value).is_integer() and 1e4 <= abs(value) < 1e15:
        return f"{value:,.0f}".replace(",", _SPACE)
    if "e+" in text and abs(value) < _LARGE:
        return f"{float(text):.0f}" if abs(value) < 1e4 else show_number(float(text))
    return text


def show_count(cycle: float) -> str:
    """A cycle count in messages: "31 000"."""
    return show_number(cycle).replace(_SPACE, " ")


def show_cycles(value: float, counted: str = "cycles") -> str:
    """A count of cycles, or of missions, in words; infinite, the final state."""
    if value == np.inf:
        return "the final state"
    return f"{show_number(value, 4)} {counted.removesuffix('s') if value == 1 else counted}"


def show_percent(fraction: float, rtol: float | None = None) -> str:
    """A relative error in percent: "2.6 %"; more than ten times the whole in short.

    With `rtol`, the error that was asked for, it has as many digits as show on which side of `rtol` it is: an error
    just above 1 % is not shown as 1 %.
    """
    if fraction >= 1.0:
        return f"{100.0 * fraction:.0f} %" if fraction < 10.0 else f"{100.0 * fraction:.0e} %"
    shown = 100.0 * fraction
    limit = math.inf if rtol is None else float(f"{100.0 * rtol:.12g}")
    for digits in _DIGITS:
        shown = float(f"{100.0 * fraction:.{digits}g}")
        if rtol is None or (shown <= limit) == (fraction <= rtol):
            break
    return f"{shown:.12g} %"


def show_known(error: float) -> str:
    """A relative error behind a number: " ± 2.6 %"; nothing where there is none, as of what has not worn."""
    if not math.isfinite(error):
        return " (error not known)"
    return f" ± {show_percent(error)}" if error > 0.0 else ""


def describe_reach(last: float, end: float, error: float) -> str:
    """How far a history was computed that ends early, and the relative error of its last worn volume.

    end: count that was asked for, inf where there is none.
    """
    reached = f"computed up to cycle {show_count(last)}" + (f" of {show_count(end)}" if end < math.inf else "")
    # before the first count that was asked for nothing has worn, and that is known exactly
    known = last > 0.0 and 0.0 < error < math.inf
    return f"{reached}, the worn volume there to {show_percent(error)}" if known else reached


def units_of(axis: "xr.DataArray") -> str:
    """Unit of an axis: `cycles` where it counts them, empty where there is none."""
    name = str(axis.name)
    if name == "step":
        return "cycles"
    units = COORDINATES[name].units if name in COORDINATES else str(axis.attrs.get("units", ""))
    return "" if units == "1" else units


def show_value(axis: "xr.DataArray", index: int) -> str:
    """A value of an axis in words."""
    name, value = str(axis.name).replace("_", " "), axis.values[index]
    if isinstance(value, str):
        return f"{value} scheme" if name == "scheme" else f"{name} {value}"
    text = f"{show_number(float(value))} {units_of(axis)}".rstrip()
    return text if name == "frequency" else f"{name} {text}"


def show_power(value: float) -> str:
    """A tick of a logarithmic axis: powers of ten as such. Plain text, which is drawn much faster than a formula."""
    if value <= 0.0:
        return ""
    exponent = round(float(np.log10(value)))
    if not math.isclose(value, 10.0**exponent, rel_tol=1e-6):
        return show_number(value, 2)
    return "1" if exponent == 0 else "10" + str(exponent).translate(_RAISED)
