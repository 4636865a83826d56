"""What results of the solver are in Python: a Dataset, a picture, five lines. xarray and matplotlib load when used."""

from __future__ import annotations

from collections import Counter
from dataclasses import fields
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from solver.outcome import Outcome

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

_OF_VALUES = {
    "worn_volume": ("", "m3"),
    "reference_volume": ("", "m3"),
    "wear_rate": ("", "m3 per cycle"),
    "wear_depth": ("contact", "m"),
    "wear_depth_error": ("contact", "m"),
    "mean_pressure": ("contact", "Pa"),
    "slip_range": ("contact", "m"),
    "open_fraction": ("contact", "1"),
    "slip_fraction": ("contact", "1"),
    "response": ("response", "m"),
    "response_mean": ("response", "m"),
    "response_peak": ("response", "m"),
    "shape": ("displacement", "m"),
    "loop_displacement": ("loop phase component", "m"),
    "loop_force": ("loop phase component", "N"),
    "frequency": ("", "Hz"),
    "frequency_error": ("", "Hz"),
    "fold_frequency": ("", "Hz"),
    "excitation_frequency": ("", "Hz"),
    "excitation_frequency_error": ("", "Hz"),
    "run_time": ("", "s"),
    "block_volume": ("block", "m3"),
    "block_volume_error": ("block", "1"),
    "response_begin": ("block response", "m"),
    "response_end": ("block response", "m"),
    "response_peak_begin": ("block response", "m"),
    "response_peak_end": ("block response", "m"),
    "amplitude": ("", "m kg^0.5"),
    "excitation_amplitude": ("", "N"),
}
"""Dimensions after the first one, and unit; of all others no dimension and "1"."""

_OF_MISSIONS = {
    "response_error": ("mission", "block"),
    "excitation_frequency": ("block", "end"),
    "sweep_rate": ("block",),
    "steps": ("step",),
}
"""All dimensions of values that belong to blocks or steps of missions."""


NOT_IN_DATASETS = {"dataset": False}
"""Metadata of a field that is no array of numbers or words."""


class Presented:
    """A result over one dimension.

    OVER: name of the attribute with the values of this dimension, and name of the dimension in a Dataset.
    SHOWN: three attributes that the text shows. DRAWN: attributes that the picture shows, each on an axis of its own.
    """

    OVER: ClassVar[tuple[str, str]]
    SHOWN: ClassVar[tuple[str, str, str]]
    DRAWN: ClassVar[tuple[str, ...]]

    def to_xarray(self) -> xr.Dataset:
        """All values, named as here, in SI units; `outcome` as words. Responses stay complex."""
        import xarray as xr

        name, over = self.OVER
        points = getattr(self, name)
        data: dict[str, Any] = {}
        for field in fields(self):  # type: ignore[arg-type]
            if field.name == name or not field.metadata.get("dataset", True):
                continue
            value = getattr(self, field.name)
            others, units = _OF_VALUES.get(field.name, ("", "1"))
            dims = _OF_MISSIONS.get(field.name, ()) if over == "mission" else ()
            if isinstance(value, tuple):
                data[field.name] = (over, [str(each) for each in value], {"units": units})
            elif not isinstance(value, np.ndarray):
                data[field.name] = ((), str(value) if isinstance(value, Outcome) else value, {"units": units})
            elif value.size:
                if not dims and len(value) == 1:
                    # the same at all points
                    value = np.broadcast_to(value, (len(points), *value.shape[1:]))
                data[field.name] = (dims or (over, *others.split()), value, {"units": units})
        return xr.Dataset(data, {over: (over, points, {"units": _OF_VALUES.get(name, ("", "1"))[1]})})

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draws the main values over the dimension, into new axes of matplotlib if none are given. Returns the axes."""
        axes = axes or _new_axes()
        at = getattr(self, self.OVER[0])
        order = np.argsort(at)
        for number, name in enumerate(self.DRAWN):
            panel, values = axes.twinx() if number else axes, np.abs(getattr(self, name))[order]
            panel.plot(at[order], values, f"C{number}" if number else "", marker=".")
            if name == "worn_volume":
                error = getattr(self, f"{name}_error")[order] * values
                panel.fill_between(at[order], values - error, values + error, alpha=0.2)
            panel.set_ylabel(f"{name.replace('_', ' ')} in {_OF_VALUES.get(name, ('', '1'))[1]}")
        axes.set_xlabel(self.OVER[1].replace("_", " "))
        axes.grid(alpha=0.3)
        return axes

    def __repr__(self) -> str:
        """Five lines: points and outcomes, the ranges of three values, a message."""
        own: Any = self
        points, outcomes = getattr(self, self.OVER[0]), own.outcome
        ends, messages = (each if isinstance(each, tuple) else (each,) for each in (outcomes, own.message))
        counts = Counter(ends)
        words = ", ".join(
            f"{number} {outcome}" if len(ends) > 1 else str(outcome) for outcome, number in counts.items()
        )
        rows = [(name, _span(getattr(self, name), _OF_VALUES.get(name, ("", "1"))[1])) for name in self.SHOWN]
        rows.append(("message", next((text for text in messages if text), "none")))
        first = f"{type(self).__name__}: {self.OVER[1]} {_span(points, '')}: {words}"
        return "\n".join((first, *(f"  {name.replace('_', ' '):<18} {text}" for name, text in rows)))


def _new_axes() -> Axes:
    from matplotlib import pyplot

    axes: Axes = pyplot.subplots()[1]
    return axes


def _span(values: Any, unit: str) -> str:
    """Smallest and largest magnitude."""
    known = np.abs(values)[~np.isnan(values)]
    if not known.size:
        return "none"
    lowest, highest = float(known.min()), float(known.max())
    words = f"{lowest:.6g}" if lowest == highest else f"{lowest:.6g} to {highest:.6g}"
    return words if unit in ("", "1") else f"{words} {unit}"


class PresentedHistory(Presented):
    """A wear history or a mission history."""

    SHOWN = ("worn_volume", "worn_volume_error", "wear_depth")
    DRAWN = ("worn_volume",)


class PresentedResponse(Presented):
    """A frequency response; each point has an outcome of its own."""

    OVER = ("frequency", "frequency")
    SHOWN = ("response", "response_error", "fold_frequency")
    DRAWN = ("response",)


class PresentedCurve(Presented):
    """A response curve through folds, over its points; solid where it is stable."""

    OVER = ("point", "point")
    SHOWN = ("frequency", "excitation_amplitude", "response")

    def plot(self, axes: Axes | None = None) -> Axes:
        """As for other results, over the parameter that changes along the curve."""
        own: Any = self
        axes = axes or _new_axes()
        at, stable = getattr(self, own.parameter), np.array(own.stability) == "stable"
        for size in np.abs(own.response).T:
            (line,) = axes.plot(at, size, ":")
            axes.plot(at, np.where(stable, size, np.nan), color=line.get_color())
        label = f"{own.parameter.replace('_', ' ')} in {_OF_VALUES[own.parameter][1]}"
        axes.set(xlabel=label, ylabel="response in m", title="solid where stable")
        return axes


class PresentedMode(Presented):
    """A nonlinear mode over its amplitude; each point has an outcome of its own."""

    OVER = ("amplitude", "modal_amplitude")
    SHOWN = ("frequency", "damping_ratio", "damping_error")
    DRAWN = ("frequency", "damping_ratio")
