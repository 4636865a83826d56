"""The variables and coordinates of a result file: names, dimensions after the axes, units, meaning."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Variable:
    """One variable of the result: its dimensions after the axes, its unit and what it means."""

    dimensions: tuple[str, ...]
    units: str
    long_name: str


ASKED = {
    "worn_volume": Variable(("cycle",), "m3", "worn volume, sum over contact pairs of depth times area"),
    "wear_rate": Variable(("cycle",), "m3 per cycle", "volume worn in a cycle"),
    "wear_depth": Variable(("cycle", "contact"), "m", "wear depth"),
    "mean_pressure": Variable(("cycle", "contact"), "Pa", "contact pressure, mean over a period"),
    "response_amplitude": Variable(("cycle", "response"), "m", "amplitude of the first harmonic of the response"),
    "response_phase": Variable(("cycle", "response"), "rad", "phase of the first harmonic of the response"),
    "response_peak": Variable(("cycle", "response"), "m", "largest magnitude of the response over a period"),
    "slip_range": Variable(("cycle", "contact"), "m", "range of the slip over a period"),
    "open_fraction": Variable(("cycle", "contact"), "1", "fraction of the period in which the pair is open"),
}
"""Those that `outputs.variables` asks for, in the order of the file."""

KEPT = {
    "outcome": Variable((), "1", "how the computation of the point ended"),
    "jump_cycle": Variable((), "1", "first cycle count at which the branch was lost"),
    "newton_iterations": Variable((), "1", "Newton iterations of the point, start state included"),
    "run_time": Variable((), "s", "CPU time of the computing thread, start state included"),
    "error_estimate": Variable((), "1", "estimated relative error of the last worn volume"),
}
"""Those that every result holds."""

COORDINATES = {
    "frequency": Variable((), "Hz", "excitation frequency"),
    "wear_coefficient": Variable((), "1/Pa", "wear coefficient"),
    "excitation_amplitude": Variable((), "N", "excitation amplitude, factor of the unit harmonic load"),
    "step": Variable((), "1", "step of the slow time scale, cycles"),
    "scheme": Variable((), "1", "integration scheme of the wear"),
    "sweep": Variable((), "1", "direction of the sweep whose branch is followed at cycle 0"),
    "harmonics": Variable((), "1", "harmonics above the static one"),
    "samples": Variable((), "1", "time samples in a period"),
    "tolerance": Variable((), "1", "largest accepted scaled residual"),
    "cycle": Variable((), "1", "number of vibration cycles"),
    "contact": Variable((), "1", "index of the contact pair"),
    "response": Variable((), "1", "name of the response"),
    "contact_x": Variable(("contact",), "m", "position of the contact pair, x"),
    "contact_y": Variable(("contact",), "m", "position of the contact pair, y"),
    "contact_z": Variable(("contact",), "m", "position of the contact pair, z"),
    "contact_area": Variable(("contact",), "m2", "area of the contact pair"),
    "contact_surface": Variable(("contact",), "1", "label of the surface of the contact pair"),
}
"""Coordinates, the axes first."""
