"""What results of the solver are in Python: a Dataset, a picture, five lines. xarray and matplotlib load when used."""

from collections import Counter
from dataclasses import fields
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from solver.outcome import Outcome

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

_UNITS = {
    "m3": "worn_volume reference_volume block_volume",
    "m3 per cycle": "wear_rate",
    "m": "wear_depth wear_depth_error slip_range response response_mean response_peak shape loop_displacement"
    " response_begin response_end response_peak_begin response_peak_end",
    "Pa": "mean_pressure",
    "J/m2": "dissipated_energy dissipated_energy_error",
    "N/m3": "pair_stiffness",
    "W/m2": "friction_power",
    "N": "loop_force excitation_amplitude",
    "Hz": "frequency frequency_error fold_frequency excitation_frequency excitation_frequency_error",
    "s": "run_time",
    "m kg^0.5": "amplitude",
}
_DIMENSIONS = {
    "contact": "wear_depth wear_depth_error mean_pressure slip_range open_fraction friction_power slip_fraction"
    " dissipated_energy dissipated_energy_error pair_friction pair_stiffness",
    "response": "response response_mean response_peak",
    "displacement": "shape",
    "loop phase component": "loop_displacement loop_force",
    "block": "block_volume block_volume_error",
    "block response": "response_begin response_end response_peak_begin response_peak_end",
}
"""Dimensions after the first one."""

_OF_MISSIONS = {
    "response_error": ("mission", "block"),
    "excitation_frequency": ("block", "end"),
    "sweep_rate": ("block",),
    "steps": ("step",),
}
"""All dimensions of values that belong to blocks or steps of missions."""

NOT_IN_DATASETS = {"dataset": False}
"""Metadata of a field that is no array of numbers or words."""


def _row_of(table: dict[str, str], name: str, otherwise: str) -> str:
    return next((key for key, names in table.items() if name in names.split()), otherwise)


def unit_of(name: str) -> str:
    """Unit of an attribute of a result."""
    return _row_of(_UNITS, name, "1")


class Presented:
    """A result over one dimension; the defaults are those of histories.

    OVER: name of the attribute with the values of this dimension, and name of the dimension in a Dataset.
    SHOWN: three attributes that the text shows. DRAWN: attributes that the picture shows, each on an axis of its own.
    """

    OVER: ClassVar[tuple[str, str]]
    SHOWN: ClassVar[tuple[str, str, str]] = ("worn_volume", "worn_volume_error", "wear_depth")
    DRAWN: ClassVar[tuple[str, ...]] = ("worn_volume",)

    def to_xarray(self) -> "xr.Dataset":
        """All values, named as here, in SI units; `outcome` as words.

        A complex `response` stands as `response_amplitude` and `response_phase`, rad, as in a result file.
        """
        import xarray as xr

        name, over = self.OVER
        points = getattr(self, name)
        data: dict[str, Any] = {}
        for field in fields(self):  # type: ignore[arg-type]
            if field.name != name and field.metadata.get("dataset", True):
                data |= _variables(field.name, getattr(self, field.name), over)
        return xr.Dataset(data, {over: (over, points, {"units": unit_of(name)})})

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draws the main values over the dimension, into new axes of matplotlib if none are given. Returns the axes."""
        from matplotlib import pyplot

        axes = axes or pyplot.subplots()[1]
        at = getattr(self, self.OVER[0])
        order = np.argsort(at)
        for number, name in enumerate(self.DRAWN):
            panel, values = axes.twinx() if number else axes, np.abs(getattr(self, name))[order]
            panel.plot(at[order], values, f"C{number}" if number else "", marker=".")
            if name == "worn_volume":
                error = getattr(self, f"{name}_error")[order] * values
                panel.fill_between(at[order], values - error, values + error, alpha=0.2)
            panel.set_ylabel(f"{name.replace('_', ' ')} in {unit_of(name)}")
        axes.set_xlabel(self.OVER[1].replace("_", " "))
        axes.grid(alpha=0.3)
        return axes

    def __repr__(self) -> str:
        """Five lines: points and outcomes, the ranges of three values, a message."""
        own: Any = self
        points, outcomes = getattr(self, self.OVER[0]), own.outcome
        ends, messages = (each if isinstance(each, tuple) else (each,) for each in (outcomes, own.message))
        words = ", ".join(f"{n} {outcome}" if len(ends) > 1 else str(outcome) for outcome, n in Counter(ends).items())
        rows = [(name, _span(getattr(self, name), unit_of(name))) for name in self.SHOWN]
        rows.append(("message", next((text for text in messages if text), "none")))
        first = f"{type(self).__name__}: {self.OVER[1]} {_span(points, '')}: {words}"
        return "\n".join((first, *(f"  {name.replace('_', ' '):<18} {text}" for name, text in rows)))


def _variables(name: str, value: Any, over: str) -> dict[str, tuple[Any, Any, dict[str, str]]]:
    """The variables of one value: dimensions, values, units; two of complex values, none of empty ones."""
    units = {"units": unit_of(name)}
    if isinstance(value, tuple):
        return {name: (over, [str(each) for each in value], units)}
    if not isinstance(value, np.ndarray):
        return {name: ((), str(value) if isinstance(value, Outcome) else value, units)}
    dims = _OF_MISSIONS.get(name) if over == "mission" else None
    if dims is None:
        dims = (over, *_row_of(_DIMENSIONS, name, "").split())
    if not value.size:
        return {}
    if np.iscomplexobj(value):
        first, *rest = name.split("_")
        amplitude, phase = ("_".join((first, part, *rest)) for part in ("amplitude", "phase"))
        return {amplitude: (dims, np.abs(value), units), phase: (dims, np.angle(value), {"units": "rad"})}
    return {name: (dims, value, units)}


def _span(values: Any, unit: str) -> str:
    """Smallest and largest magnitude."""
    known = np.abs(values)[~np.isnan(values)]
    if not known.size:
        return "none"
    lowest, highest = float(known.min()), float(known.max())
    words = f"{lowest:.6g}" if lowest == highest else f"{lowest:.6g} to {highest:.6g}"
    return words if unit in ("", "1") else f"{words} {unit}"
