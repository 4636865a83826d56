"""Result files of samples whose worn volumes follow from what they draw, and of scenes that differ in their pairs."""

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.stats import norm, qmc

from studyrunner.variables import OF_SAMPLES
from tests.studyrunner.report.page_cases import build_file, flank_positions

N_SAMPLES = 64
AXES: dict[str, Any] = {"frequency": (190.0, 191.0), "scheme": ("adaptive",)}
CYCLES = (0.0, 100.0, 200.0)
STUDY = """[study]
name = "s"
[scatter]
samples = {samples}
friction_coefficient = {{normal = {{std = 0.03}}}}
wear_coefficient = {{lognormal = {{factor = 1.5}}}}
gap = {{normal = {{std = 1e-7}}, of = "each pair"}}
"""


def sample_file(n_samples: int = N_SAMPLES, factor: float = 1.5, jump: float = 0.0) -> xr.Dataset:
    """Samples whose volume is proportional to the wear coefficient and the cycles, 1 mm3 at its median in the end.

    factor: by which one standard deviation multiplies the wear coefficient. jump: relative height of a step of the
    volume where the friction coefficient is below its median.
    """
    dataset = build_file({**AXES, "sample": range(n_samples)}, CYCLES, variables=OF_SAMPLES)
    friction, wear = (norm.ppf(column) for column in qmc.Sobol(2, seed=1).random(n_samples).T)
    volume = 1e-9 * factor**wear * np.where(friction < np.median(friction), 1.0 + jump, 1.0)
    shape = dataset["worn_volume"].shape
    dataset["worn_volume"][:] = np.broadcast_to(volume[:, None] * np.array(CYCLES) / CYCLES[-1], shape)
    dataset["worn_volume_error"][:] = 0.01
    dataset["error_estimate"][:] = 0.01
    units = {"units": "1", "long_name": "friction"}
    gap = np.random.default_rng(1).normal(size=(n_samples, dataset.sizes["contact"])) * 1e-7
    return dataset.assign_coords(
        sample_friction_coefficient=("sample", 0.5 + 0.03 * friction, units),
        sample_wear_coefficient=("sample", 1e-11 * factor**wear, {"units": "1/Pa"}),
        sample_gap=(("sample", "contact"), gap, {"units": "m"}),
    ).assign_attrs(study=STUDY.format(samples=n_samples))


def mesh_file() -> xr.Dataset:
    """Two speeds and two meshes, the first of 12 and the second of 24 pairs; most is worn on the first."""
    dataset = build_file({"frequency": (190.0,), "rotation_speed": (2900.0, 3000.0), "mesh": (1, 2)}, CYCLES)
    dataset["rotation_speed"].attrs = {"units": "rpm", "long_name": "speed of rotation"}
    dataset["worn_volume"][:, :, 0] *= 10.0
    coarse, fine = flank_positions(3, 2), flank_positions(4, 3)
    both = np.stack([pad(coarse, len(fine)), fine])
    exists = np.isfinite(both[..., 0])
    for name in ("wear_depth", "mean_pressure", "open_fraction", "slip_range"):
        known = dataset[name].where(xr.DataArray(exists, dims=("mesh", "contact")))
        dataset[name] = known.transpose(*dataset[name].dims)
    surfaces = [["intrados"] * (n // 2) + ["extrados"] * (n - n // 2) for n in (len(coarse), len(fine))]
    surfaces[0] += [""] * (len(fine) - len(coarse))
    pairs = ("mesh", "contact")
    return dataset.assign_coords(
        **{f"contact_{axis}": (pairs, both[..., i], {"units": "m"}) for i, axis in enumerate("xyz")},
        contact_area=(pairs, np.where(exists, 1e-5, np.nan), {"units": "m2"}),
        contact_surface=(pairs, np.array(surfaces)),
        contact_exists=(pairs, exists.astype(np.int8)),
    )


def pad(values: NDArray[np.float64], length: int) -> NDArray[np.float64]:
    """Rows of NaN behind the others."""
    return np.concatenate([values, np.full((length - len(values), values.shape[1]), np.nan)])
