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

MISSIONS, ROOT_OF_A_DECK, LAP_JOINT = (
    Path(__file__).with_name(f"{name}.toml").read_text(encoding="utf-8")
    for name in ("missions", "root_of_a_deck", "lap_joint")
)
"""Of the slider, of `SECTOR`, a deck of a few elements, and of `Plates`."""

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
