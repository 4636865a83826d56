"""What results of the solver are in Python: a Dataset, a picture, five lines. xarray and matplotlib load when used."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from solver.model import FloatArray
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

    OVER: attribute with the values of this dimension, and name of the dimension in a Dataset.
    """

    OVER: ClassVar[tuple[str, str]]

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
        """Draws the main value over the dimension, into new axes of matplotlib if none are given. Returns the axes."""
        if axes is None:
            from matplotlib import pyplot

            axes = pyplot.subplots()[1]
        self._draw(axes)
        axes.grid(alpha=0.3)
        return axes

    def __repr__(self) -> str:
        """Five lines."""
        (_, first), *rows = self._rows()
        return "\n".join((f"{type(self).__name__}: {first}", *(f"  {label:<12} {text}" for label, text in rows)))

    def _rows(self) -> Sequence[tuple[str, str]]:
        raise NotImplementedError

    def _draw(self, axes: Axes) -> None:
        raise NotImplementedError


class PresentedHistory(Presented):
    """A wear history or a mission history."""

    def _rows(self) -> Sequence[tuple[str, str]]:
        own: Any = self
        name, over = self.OVER
        missions = over == "mission"
        known = np.flatnonzero(np.isfinite(own.worn_volume))
        reached = own.last_mission if missions else own.last_cycle
        n_pairs = own.wear_depth.shape[1]
        pairs = f"{n_pairs} contact pair" + "s" * (n_pairs != 1)
        first = f"{own.outcome}, {reached:g} of {getattr(self, name)[-1]:g} {name}, {pairs}"
        computed = ("computed", f"{own.newton_iterations} Newton iterations, {own.run_time:.3g} CPU s")
        last = ("message", own.message) if own.message else computed
        if not known.size:
            return [("", first), ("worn volume", "none"), ("deepest", "none"), ("response", "none"), last]
        end = known[-1]
        depth = own.wear_depth[end]
        response = own.response_end[:, -1] if missions else own.response
        largest = np.abs(response[[known[0], end]]).max(axis=1)
        within = f"within {100.0 * own.worn_volume_error[end]:.2g} %"
        return [
            ("", first),
            ("worn volume", f"{1e9 * own.worn_volume[end]:.4g} mm3, {within}"),
            ("deepest", f"{1e6 * depth.max():.4g} um, contact pair {depth.argmax()}"),
            ("response", f"{largest[0]:.4g} m at first, {largest[1]:.4g} m at last (first harmonic)"),
            last,
        ]

    def _draw(self, axes: Axes) -> None:
        own: Any = self
        name, _ = self.OVER
        counts, volume = getattr(self, name), 1e9 * own.worn_volume
        error = own.worn_volume_error * volume
        (line,) = axes.plot(counts, volume)
        axes.fill_between(counts, volume - error, volume + error, color=line.get_color(), alpha=0.2, label="error")
        axes.set(xlabel=name, ylabel="worn volume in mm3", title=str(own.outcome))


class PresentedPoints(Presented):
    """Independent points, each with an outcome of its own: a frequency response or a nonlinear mode."""

    def _outcomes(self) -> str:
        own: Any = self
        counts = Counter(own.outcome)
        return ", ".join(f"{number} {outcome}" for outcome, number in counts.items())

    def _message(self) -> tuple[str, str]:
        own: Any = self
        return ("message", next((text for text in own.message if text), "none"))


class PresentedResponse(PresentedPoints):
    """A frequency response."""

    OVER = ("frequency", "frequency")

    def _rows(self) -> Sequence[tuple[str, str]]:
        own: Any = self
        size = np.abs(own.response)
        known = np.isfinite(size).any()
        point, place = np.unravel_index(np.nanargmax(size), size.shape) if known else (0, 0)
        largest = f"{size[point, place]:.4g} m at {own.frequency[point]:.6g} Hz, response {place} (first harmonic)"
        return [
            ("", f"{size.shape[0]} points, {_span(own.frequency)} Hz, {size.shape[1]} responses"),
            ("outcome", self._outcomes()),
            ("largest", largest if known else "none"),
            ("error", f"within {100.0 * np.nanmax(own.response_error):.2g} %" if known else "unknown"),
            self._message(),
        ]

    def _draw(self, axes: Axes) -> None:
        own: Any = self
        order = np.argsort(own.frequency)
        lines = axes.plot(own.frequency[order], np.abs(own.response[order]), marker=".")
        if len(lines) > 1:
            axes.legend(lines, [f"response {place}" for place in range(len(lines))])
        axes.set(xlabel="frequency in Hz", ylabel="response in m (first harmonic)")


class PresentedCurve(Presented):
    """A response curve through folds, over its points."""

    OVER = ("point", "point")

    def _rows(self) -> Sequence[tuple[str, str]]:
        own: Any = self
        size, unit = np.abs(own.response), "Hz" if own.parameter == "frequency" else "N"
        values = getattr(own, own.parameter)
        span = f"{values[0]:.6g} to {values[-1]:.6g} {unit}" if values.size else f"no state: {own.outcome}"
        largest, stability = "none", Counter(own.stability)
        if values.size:
            point, place = np.unravel_index(np.argmax(size), size.shape)
            largest = f"{size[point, place]:.4g} m at {values[point]:.6g} {unit}, response {place} (first harmonic)"
        return [
            ("", f"{values.size} points, {span}, {np.count_nonzero(own.is_fold)} folds, {size.shape[1]} responses"),
            ("outcome", str(own.outcome)),
            ("largest", largest),
            ("stability", ", ".join(f"{number} {kind}" for kind, number in stability.items()) or "unknown"),
            ("message", own.message or "none"),
        ]

    def _draw(self, axes: Axes) -> None:
        own: Any = self
        values, size = getattr(own, own.parameter), np.abs(own.response)
        stable = np.array(own.stability) == "stable"
        for place in range(size.shape[1]):
            (line,) = axes.plot(values, size[:, place], ":", label=f"response {place}")
            axes.plot(values, np.where(stable, size[:, place], np.nan), color=line.get_color())
        axes.set(
            xlabel="frequency in Hz" if own.parameter == "frequency" else "excitation amplitude in N",
            ylabel="response in m (first harmonic)",
            title="solid where stable",
        )


class PresentedMode(PresentedPoints):
    """A nonlinear mode over its amplitude."""

    OVER = ("amplitude", "modal_amplitude")

    def _rows(self) -> Sequence[tuple[str, str]]:
        own: Any = self
        known = np.isfinite(own.frequency)
        errors = (np.max(own.frequency_error[known], initial=0.0), np.max(own.damping_error[known], initial=0.0))
        return [
            ("", f"{known.size} points, {_span(own.amplitude)} m sqrt(kg), {self._outcomes()}"),
            ("frequency", f"{_span(own.frequency[known])} Hz" if known.any() else "none"),
            ("damping", f"{_span(100.0 * own.damping_ratio[known])} %" if known.any() else "none"),
            ("error", f"within {errors[0]:.2g} Hz, {100.0 * errors[1]:.2g} % of critical damping"),
            self._message(),
        ]

    def _draw(self, axes: Axes) -> None:
        own: Any = self
        order = np.argsort(own.amplitude)
        amplitude, other = own.amplitude[order], axes.twinx()
        axes.plot(amplitude, own.frequency[order], "C0", marker=".")
        other.plot(amplitude, 100.0 * own.damping_ratio[order], "C1", marker=".")
        axes.set_xlabel("modal amplitude in m sqrt(kg)")
        axes.set_ylabel("natural frequency in Hz", color="C0")
        other.set_ylabel("damping ratio in %", color="C1")


def _span(values: FloatArray) -> str:
    lowest, highest = float(values.min()), float(values.max())
    return f"{lowest:.6g}" if lowest == highest else f"{lowest:.6g} to {highest:.6g}"
