"""Result files of random numbers for the tests of the page: any axes, some points failed, loops of some pairs."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from studyrunner.coordinates import COORDINATES
from studyrunner.result.view import Result, open_for_report
from studyrunner.variables import ASKED, KEPT, USUAL

FAILED = 4
SENTENCES = ("The point was computed to the end.", "one", "two", "three", "A step did not converge: <b>use</b> less.")
STUDY = '[study]\nname = "s"\n[scene]\nmodel = "sdof_slider"\n'

AXES: Mapping[str, Sequence[object]] = {
    "frequency": (190.0, 191.0, 192.5, 193.0),
    "wear_coefficient": (1e-11, 2e-11),
    "excitation_amplitude": (0.5,),
    "step": (1000.0,),
    "scheme": ("implicit", "explicit"),
    "sweep": ("up",),
}


def flank_positions(n_along: int = 4, n_across: int = 3) -> NDArray[np.float64]:
    """Two flanks as of a dovetail, (pairs, 3), m."""
    along, across = np.meshgrid(np.linspace(-0.02, 0.02, n_along), np.linspace(0.0, 0.005, n_across), indexing="ij")
    sides = [np.stack([0.245 - across, side * (0.0055 + across), along], axis=-1) for side in (1.0, -1.0)]
    return np.concatenate([side.reshape(-1, 3) for side in sides])


def build_file(
    axes: Mapping[str, Sequence[object]] = AXES,
    cycles: Sequence[float] = (0.0, 100.0, 200.0, 300.0, 400.0),
    failed: Sequence[int] = (),
    positions: NDArray[np.float64] | None = None,
    surfaces: Sequence[str] = (),
    responses: Sequence[str] = ("tip",),
    variables: Sequence[str] = USUAL,
    loops: Sequence[int] = (),
    seed: int = 1,
    **attributes: str,
) -> xr.Dataset:
    """A result in memory. failed: numbers of points, the last axis fastest. positions, surfaces: of the pairs."""
    random = np.random.default_rng(seed)
    positions = flank_positions() if positions is None else positions
    n_pairs = len(positions)
    surfaces = surfaces or ["intrados"] * (n_pairs // 2) + ["extrados"] * (n_pairs - n_pairs // 2)
    sizes = {"cycle": len(cycles), "contact": n_pairs, "response": len(responses)}
    shape = tuple(len(values) for values in axes.values())
    bad = np.zeros(shape, dtype=bool)
    bad.ravel()[list(failed)] = True
    data = {}
    for name, entry in {**{name: ASKED[name] for name in variables}, **KEPT}.items():
        size = shape + tuple(sizes[dimension] for dimension in entry.dimensions)
        values = random.uniform(0.1, 1.0, size) * 1e-6 if entry.dtype == "float64" else random.integers(1, 2, size)
        values = np.full(size, "") if entry.is_text else values
        values = np.full(size, float(cycles[-1])) if name == "last_cycle" else values
        values[bad] = np.nan if entry.dtype == "float64" else "" if entry.is_text else 0
        data[name] = ((*axes, *entry.dimensions), values.astype(entry.dtype), {"units": entry.units, "long_name": name})
    outcome = np.where(bad, FAILED, 0).astype(np.int8)
    flags = {"flag_values": np.arange(5, dtype=np.int8), "flag_meanings": "converged one two three march_failed"}
    data["outcome"] = (tuple(axes), outcome, {"units": "1", **flags, "sentences": "\n".join(SENTENCES)})
    coordinates = {name: (name, np.array(values)) for name, values in axes.items()}
    coordinates |= {"cycle": ("cycle", np.array(cycles, dtype=float)), "contact": ("contact", np.arange(n_pairs))}
    coordinates |= {"response": ("response", np.array(responses)), "contact_area": ("contact", np.full(n_pairs, 1e-5))}
    coordinates |= {f"contact_{axis}": ("contact", positions[:, i]) for i, axis in enumerate("xyz")}
    coordinates["contact_surface"] = ("contact", np.array(surfaces))
    dataset = xr.Dataset(data, coords=coordinates, attrs={"title": "A study", "study": STUDY, **attributes})
    for name in dataset.coords.keys() & COORDINATES.keys():
        dataset[name].attrs = {"units": COORDINATES[name].units, "long_name": COORDINATES[name].long_name}
    return _with_loops(dataset, tuple(axes), loops, random) if loops else dataset


def _with_loops(
    dataset: xr.Dataset, axes: tuple[str, ...], loops: Sequence[int], random: np.random.Generator
) -> xr.Dataset:
    n_phases = 16
    shape = (*dataset["mean_pressure"].shape, n_phases, 3)
    held = np.isin(np.arange(dataset.sizes["contact"]), loops)
    known = (dataset["outcome"].values == 0)[..., None, None, None, None] & held[:, None, None]
    for name, units in (("loop_displacement", "m"), ("loop_force", "N")):
        values = np.where(known, random.normal(size=shape), np.nan)
        dataset[name] = ((*axes, "cycle", "contact", "phase", "component"), values, {"units": units, "long_name": name})
    phases = 2.0 * np.pi * np.arange(n_phases) / n_phases
    return dataset.assign_coords(phase=phases, component=["normal", "tangent_1", "tangent_2"])


def as_result(dataset: xr.Dataset, path: Path) -> Result:
    """The dataset, written to a file and opened as the report does it."""
    dataset.to_netcdf(path)
    return open_for_report(path)
