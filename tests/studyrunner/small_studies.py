"""Studies in a few lines, and runs of them by the command in this process."""

from pathlib import Path

import numpy as np
import xarray as xr

from studyrunner.cli import main
from tests.mpi.launching import options, results

SLIDER = """
[study]
name = "s"
[scene]
model = "sdof_slider"
[axes]
frequency = [150.0]
[slow_time]
cycles = 0
[solver]
harmonics = 5
"""
MODES = '[study]\nname = "m"\n[scene]\nmodel = "sdof_slider"\n[axes]\nmodal_amplitude = [1e-3, 1e-4]\n'
FOLLOWED = SLIDER.replace("[150.0]", '"peak"\n[loading]\nbetween = [180.0, 230.0]')
SAMPLES = SLIDER + "[scatter]\nsamples = 8\nfriction_coefficient = {normal = {std = 0.03}}\n"
TO_THE_END = SLIDER.replace("cycles = 0", "cycles = inf")

MISSIONS = """
[study]
name = "slider_missions"
[scene]
model = "sdof_slider"
[axes]
frequency = [160, 161]
wear_coefficient = [1e-11, 2e-11]
sweep = ["up", "down"]
[slow_time]
missions = 300
outputs = 4
[[mission]]
name = "run-up"
frequency = {start = 150, stop = 170, rate = 1.0}
excitation_amplitude = 10.0
[[mission]]
name = "cruise"
begin = "sweep"
seconds = 10
[[mission]]
name = "heavy"
normal_load = 12.0
frequency = 155.0
excitation_amplitude = 14.0
cycles = 1000
"""

ROOT_OF_A_DECK = """
[study]
name = "wear"
[scene]
model = "sector.inp"
units = "SI"
load = {set = "TIP", direction = [0, 1, 0]}
response = {tip = {set = "tip", direction = [0, 2, 0]}}
preload = [{set = "TIP", direction = [-1, 0, 0], force = 1.1e5}]
friction_coefficient = 0.1
nodal_diameter = 3
[axes]
frequency = 300.0
excitation_amplitude = 1000.0
[slow_time]
cycles = 1e4
outputs = 3
[solver]
harmonics = 1
samples = 64
"""
"""Of `SECTOR`, a deck of a few elements."""

LAP_JOINT = """
[study]
name = "lap"
[scene]
model = "lap.inp"
units = "SI"
contact = [["UNDER", "OVER"]]
clamp = ["GROUND"]
load = {set = "TIP", direction = [0, 0, 1]}
preload = [{set = "OVER", direction = [0, 0, -1], force = 500.0}]
friction_coefficient = 0.3
material = {young_modulus = 210e9, poisson_ratio = 0.3, density = 7800.0}
retention_stiffness = 1e6
retention_direction = [1, 0, 0]
[axes]
frequency = 300.0
wear_coefficient = 1e-11
excitation_amplitude = 20.0
[slow_time]
cycles = 1000
outputs = 2
[solver]
harmonics = 1
samples = 32
"""
"""Of `Plates`."""

CHEAP = (
    *("axes.frequency=160", "axes.scheme=implicit", "axes.step=1000", "solver.harmonics=3", "solver.samples=32"),
    *("slow_time.cycles=2000", "slow_time.outputs=3"),
)
"""Overrides with which a history of the slider takes milliseconds."""

UNWORN = ("slow_time.cycles=0", "slow_time.outputs=1")


AXES = ("axes.frequency=[100, 110]", "axes.wear_coefficient=[5e-12, 1e-11]", "axes.scheme=implicit")
SMALL = ["sdof_slider", *options(*AXES), "-o", "out.nc"]
"""A study of two start states and four histories."""


def compute(study: str, output: str, *overrides: str) -> xr.Dataset:
    """A result in which no point has failed, without what depends on the machine."""
    assert main([study, "-o", output, *options(*overrides)]) == 0
    return results(output)


def same_values(one: xr.Dataset, other: xr.Dataset) -> None:
    """All variables, to the last bit."""
    assert set(one.data_vars) == set(other.data_vars)
    for name in one.data_vars:
        np.testing.assert_array_equal(one[name].values, other[name].values, err_msg=str(name), strict=True)


def write_depths(
    path: Path | str, frequency: float, cycles: list[float], n_contact: int, counts: list[float] | None = None
) -> None:
    """A file that holds as much of a result as a study needs that begins with a worn joint.

    counts: cycle counts of a result to the end, whose coordinate numbers its outputs.
    """
    depth = np.outer(cycles, np.ones(n_contact))[None, None] * 1e-9
    dims = ("frequency", "scheme", "cycle", "contact")
    coordinates = {"frequency": [frequency], "scheme": ["adaptive"], "cycle": cycles}
    variables = {"wear_depth": (dims, depth)}
    if counts is not None:
        variables["cycle_count"] = (dims[:3], np.reshape(counts, (1, 1, -1)))
        coordinates["cycle"] = range(len(cycles))
    xr.Dataset(variables, coordinates).to_netcdf(path)
