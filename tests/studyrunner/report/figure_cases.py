"""Result files made up in memory, small and smooth, with everything that a figure may need."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from studyrunner.coordinates import COORDINATES
from studyrunner.result.view import Result
from studyrunner.variables import ASKED, KEPT

AXES = ("frequency", "wear_coefficient", "excitation_amplitude", "step", "scheme", "sweep")
WORDS = ("not_computed", "converged", "static_failed", "branch_lost", "inaccurate", "sensitive")
SENTENCES = (
    "It was not reached.",
    "It was computed.",
    "The static state failed.",
    "The branch was lost.",
    "Above.",
    "Two.",
)


def make_result(
    *,
    frequency: Sequence[float] = (200.0, 201.0, 202.0, 204.0),
    wear_coefficient: Sequence[float] = (1.1e-11,),
    scheme: Sequence[str] = ("implicit", "explicit"),
    sweep: Sequence[str] = ("up",),
    cycles: Sequence[float] = (0.0, 1000.0, 5000.0, 20000.0),
    pairs: str = "grid",
    failed: Sequence[int] = (),
    failing: int = 3,
    wears: bool = True,
    without: Sequence[str] = (),
) -> Result:
    """A result of two surfaces with 3 x 2 pairs each, one response, and 0 as the first cycle count.

    pairs: "grid", "scattered", or "nowhere" (no positions). failed: flat indices of points with the outcome `failing`.
    """
    values = (frequency, wear_coefficient, (0.5,), (1000.0,), scheme, sweep)
    shape = tuple(len(axis) for axis in values)
    coordinates = {name: (name, np.array(axis), _about(name)) for name, axis in zip(AXES, values, strict=True)}
    coordinates["cycle"] = ("cycle", np.array(cycles), _about("cycle"))
    coordinates["contact"] = ("contact", np.arange(12, dtype=np.int32), _about("contact"))
    coordinates["response"] = ("response", np.array(["tip"]), _about("response"))
    coordinates["contact_surface"] = ("contact", np.array(["left"] * 6 + ["right"] * 6))
    coordinates["contact_area"] = ("contact", np.full(12, 2e-6))
    for name, place in zip("xyz", _positions(pairs).T, strict=True):
        coordinates[f"contact_{name}"] = ("contact", place)
    grid = np.meshgrid(*(np.arange(size) for size in shape), indexing="ij")
    # Different at each point, largest at the third frequency of the implicit scheme; explicit wears a little more.
    peak = 1.0 / (1.0 + 0.5 * (grid[0] - 2) ** 2)
    size = peak * (1.0 + 0.1 * grid[4] + 0.01 * grid[5]) * (1.0 + grid[1])
    if len(cycles) == 1 or not wears:
        size = 0.0 * size
    share = (np.array(cycles) / max(cycles[-1], 1.0)) ** 0.5
    weights = (np.arange(12.0) + 1.0) / 12.0
    depth = 1e-5 * size[..., None, None] * share[:, None] * weights
    amplitude = (
        2e-3 * (peak * (1 + 0.02 * grid[5]))[..., None, None] * (1.0 - 0.5 * size[..., None] * share / 4)[..., None]
    )
    data: dict[str, np.ndarray] = {
        "worn_volume": 2e-6 * depth.sum(axis=-1),
        "wear_rate": 1e-15 * size[..., None] * (1.0 - 0.5 * share),
        "wear_depth": depth,
        "mean_pressure": 1e7 * (1.0 + depth / 1e-5) * weights[::-1],
        "response_amplitude": amplitude,
        "response_phase": np.full(amplitude.shape, -0.5),
        "response_error": 1e-3 * (1.0 + peak[..., None] * np.ones(len(cycles))),
        "wear_rate_error": 2e-3 * (1.0 + peak[..., None] * np.ones(len(cycles))),
        "energy_error": 3e-4 * (1.0 + peak[..., None] * np.ones(len(cycles))),
        "stable": np.ones((*shape, len(cycles)), dtype=np.int8),
        "error_estimate": 0.02 * peak,
        "worn_volume_error": 0.02 * peak[..., None] * share,
        "last_cycle": np.full(shape, float(cycles[-1])),
        "jump_cycle": np.full(shape, math.nan),
        "fold_frequency": np.full(shape, math.nan),
        "step_limit": np.full(shape, 5000.0),
        "branch": np.zeros(shape, dtype=np.int32),
        "run_time": 1.0 + peak,
    }
    outcome = np.zeros(shape, dtype=np.int8)
    for flat in failed:
        place = np.unravel_index(flat, shape)
        outcome[place] = failing
        for array in data.values():
            array[place] = math.nan if array.dtype.kind == "f" else 0
    variables = {
        name: ((*AXES, *{**ASKED, **KEPT}[name].dimensions), array, _about(name))
        for name, array in data.items()
        if name not in without
    }
    flags = {
        "flag_values": np.array([-1, 0, 1, 3, 6, 15], dtype=np.int8),
        "flag_meanings": " ".join(WORDS),
        "sentences": "\n".join(SENTENCES),
    }
    variables["outcome"] = (AXES, outcome, flags)
    attributes = {
        "title": "Made up",
        "study": "[scene]\nnodal_diameter = 0\n[solver]\nrtol = 0.01\n[slow_time]\ncycles = 1\n",
    }
    return Result(Path("made.nc"), xr.Dataset(variables, coordinates, attributes))


def with_variables(result: Result, **variables: xr.DataArray) -> Result:
    """The same file with further variables, or others in their place."""
    return Result(result.path, result.dataset.assign(variables))


def with_endings(result: Result, endings: Mapping[int, tuple[int, float]], messages: Mapping[int, str]) -> Result:
    """The same file with other endings of points, by flat index: outcome, and the cycle count that they came to."""
    dataset = result.dataset.copy(deep=True)
    texts = np.full(dataset["outcome"].shape, "", dtype=object)
    for flat, text in messages.items():
        texts.flat[flat] = text
    dataset["message"] = (AXES, texts)
    for flat, (outcome, last) in endings.items():
        place = np.unravel_index(flat, dataset["outcome"].shape)
        dataset["outcome"].values[place] = outcome
        dataset["last_cycle"].values[place] = last
        for values in dataset.data_vars.values():
            if "cycle" in values.dims:
                behind = dataset["cycle"].values > last
                cut = values.values[place]
                cut[behind] = math.nan if values.dtype.kind == "f" else 0
    return Result(result.path, dataset)


def with_two_responses(result: Result) -> Result:
    """The same file with a second response, half as large."""
    dataset = result.dataset
    half = dataset[["response_amplitude", "response_phase"]].assign_coords(response=["root"]) * 0.5
    both = xr.concat([dataset[["response_amplitude", "response_phase"]], half], dim="response", join="outer")
    kept = dataset.drop_vars(["response_amplitude", "response_phase", "response"])
    return Result(result.path, kept.assign_coords(response=["tip", "root"]).assign(both.data_vars))


def with_loops(result: Result, contacts: Sequence[int] = (0, 11), n_phases: int = 16) -> Result:
    """The same file with loops of these pairs: ellipses in both tangents, the normal force open for a part."""
    sizes = result.dataset.sizes
    phase = 2.0 * np.pi * np.arange(n_phases) / n_phases
    shape = (*(sizes[axis] for axis in AXES), sizes["cycle"], sizes["contact"], n_phases, 3)
    displacement, force = np.full(shape, math.nan), np.full(shape, math.nan)
    for contact in contacts:
        for cycle in range(sizes["cycle"]):
            moved = 1e-6 * (1 + contact) * np.stack([np.sin(phase), np.cos(phase), 0.5 * np.sin(phase)], axis=-1)
            pushed = 10.0 * np.stack([np.maximum(np.cos(phase), 0.0), np.sin(phase), np.cos(phase)], axis=-1)
            displacement[..., cycle, contact, :, :] = moved * (1 + cycle)
            force[..., cycle, contact, :, :] = pushed / (1 + cycle)
    displacement[result.dataset["outcome"].values != 0] = math.nan
    force[result.dataset["outcome"].values != 0] = math.nan
    dims = (*AXES, "cycle", "contact", "phase", "component")
    names = ["normal", "tangent_1", "tangent_2"]
    loops = result.dataset.assign(
        loop_displacement=(dims, displacement, {"units": "m"}), loop_force=(dims, force, {"units": "N"})
    )
    return Result(result.path, loops.assign_coords(phase=("phase", phase), component=("component", names)))


def with_sector(result: Result, *, mesh: bool = True, frequencies: bool = True) -> Result:
    """The same file with a mesh of a cube of two parts and natural frequencies of three modes."""
    dataset = result.dataset
    if mesh:
        nodes = np.array([[x, y, z] for x in (0.2, 0.3) for y in (-0.05, 0.05) for z in (-0.02, 0.02)])
        quads = np.array(
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]], dtype=np.int32
        )
        parts = np.array(["disk"] * 3 + ["blade"] * 3)
        dataset = dataset.assign(
            mesh_x=("mesh_node", nodes[:, 0]),
            mesh_y=("mesh_node", nodes[:, 1]),
            mesh_z=("mesh_node", nodes[:, 2]),
            mesh_quad=(("mesh_quad_index", "mesh_corner"), quads),
            mesh_part=("mesh_quad_index", parts),
        )
    if frequencies:
        modes = np.array([[200.0, 400.0, 900.0], [201.0, 500.0, 950.0], [202.0, 520.0, 980.0]])
        dataset = dataset.assign(natural_frequency=(("nodal_diameter", "mode"), modes)).assign_coords(
            nodal_diameter=("nodal_diameter", np.arange(3))
        )
    return Result(result.path, dataset)


def _about(name: str) -> dict[str, str]:
    return {"units": {**ASKED, **KEPT, **COORDINATES}[name].units}


def _positions(pairs: str) -> np.ndarray:
    """Two flanks of 3 (along z) x 2 pairs; the second mirrored."""
    if pairs == "nowhere":
        return np.full((12, 3), math.nan)
    flank = np.array(
        [[0.24 + 0.003 * across, 0.01 - 0.003 * across, 0.01 * along] for along in range(3) for across in (0, 1)]
    )
    both = np.concatenate([flank, flank * [1.0, -1.0, 1.0]])
    if pairs == "scattered":
        both += 2e-3 * np.random.default_rng(1).uniform(-1.0, 1.0, both.shape)
    return both
