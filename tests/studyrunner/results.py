"""The one factory of results: datasets in memory, of any axes and pairs, made from the tables of variables.

`build_file` has numbers that all differ, `smooth_result` smooth ones, `sample_file` samples, `mesh_file` scenes that
differ in their pairs, `result_of_study` the axes of a study; `build_dataset`, `write_dataset` are the plain twin of the
writer.
"""

import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from solver.outcome import Outcome
from studyrunner.coordinates import COORDINATES
from studyrunner.kinds.task import PointResult
from studyrunner.kinds.wear.kind import ASKED, LOOP_COMPONENTS, LOOPS, OF_A_HISTORY, OF_SAMPLES, USUAL
from studyrunner.result.arrays import attributes, coordinates
from studyrunner.result.provenance import describe_run
from studyrunner.result.view import Result, open_for_report
from studyrunner.scatter import ScatterSection, draw
from studyrunner.scene.scene import SceneFacts, dimensions_behind
from studyrunner.scene.scene_set import find_scenes
from studyrunner.study.study import Study
from studyrunner.study.text import POINTS_LEFT
from studyrunner.variables import Variable
from tests.studyrunner.fakes import FACTS

AXES: Mapping[str, Sequence[object]] = {
    "frequency": (190.0, 191.0, 192.5, 193.0),
    "wear_coefficient": (1e-11, 2e-11),
    "excitation_amplitude": (0.5,),
    "step": (1000.0,),
    "scheme": ("implicit", "explicit"),
    "sweep": ("up",),
}
STUDY = '[study]\nname = "s"\n[scene]\nmodel = "sdof_slider"\nnodal_diameter = 0\n[solver]\nrtol = 0.01\n'
UNKNOWN = ("jump_cycle", "fold_frequency", "cycles_to_target", "cycles_to_target_error")
N_PHASES = 16


# --- of any axes ---


def build_file(
    axes: Mapping[str, Sequence[object]] = AXES,
    cycles: Sequence[float] = (0.0, 100.0, 200.0, 300.0, 400.0),
    failed: Sequence[int] = (),
    positions: NDArray[np.float64] | None = None,
    surfaces: Sequence[str] = (),
    responses: Sequence[str] = ("tip",),
    variables: Sequence[str] = USUAL,
    loops: Sequence[int] = (),
    **of_file: str,
) -> xr.Dataset:
    """A result of random numbers up to 1e-6.

    failed: numbers of the points without a history, the last axis fastest. positions, surfaces: of the pairs, two
    flanks if not given. of_file: attributes of the file.
    """
    random = np.random.default_rng(1)
    positions = flank_positions() if positions is None else positions
    half = len(positions) // 2
    found: dict[str, Any] = dict(axes)
    found |= {"cycle": np.array(cycles, dtype=float), "contact": np.arange(len(positions)), "response": list(responses)}
    if loops:
        found |= {"phase": 2.0 * np.pi * np.arange(N_PHASES) / N_PHASES, "component": list(LOOP_COMPONENTS)}
    asked = {name: ASKED[name] for name in variables} | (LOOPS if loops else {}) | OF_A_HISTORY
    dataset = _empty(axes, {name: len(values) for name, values in found.items()}, asked)
    for name, variable in dataset.variables.items():
        if name not in ("outcome", "message"):
            is_real = variable.values.dtype.kind == "f"
            variable.values[...] = random.uniform(1e-7, 1e-6, variable.shape) if is_real else 1
    dataset["last_cycle"].values[...] = cycles[-1]
    dataset["outcome"].values[...] = Outcome.CONVERGED
    for name in LOOPS if loops else ():
        dataset[name].values[..., ~np.isin(np.arange(len(positions)), loops), :, :] = np.nan
    for flat in failed:
        fail(dataset, flat, int(Outcome.MARCH_FAILED))
    pairs = {f"contact_{axis}": positions[:, i] for i, axis in enumerate("xyz")}
    pairs |= {"contact_area": np.full(len(positions), 1e-5)}
    pairs |= {"contact_surface": np.array(surfaces or ["intrados"] * half + ["extrados"] * (len(positions) - half))}
    coords = {name: (name, np.array(values), _about(name)) for name, values in found.items()}
    coords |= {name: ("contact", values, _about(name)) for name, values in pairs.items()}
    return dataset.assign_coords(coords).assign_attrs({"title": "A study", "study": STUDY, **of_file})


def fail(dataset: xr.Dataset, flat: int, outcome: int, last: float = -math.inf, message: str = "") -> None:
    """Ends a point with an outcome, in place. flat: its number, the last axis fastest. last: count that it came to."""
    place = np.unravel_index(flat, dataset["outcome"].shape)
    for name, variable in dataset.data_vars.items():
        gap = math.nan if variable.dtype.kind == "f" else "" if variable.dtype.kind in "OU" else 0
        if variable.dims[: len(place)] != dataset["outcome"].dims:
            continue
        if "cycle" in variable.dims:
            variable.values[place][dataset["cycle"].values > last] = gap
        elif math.isinf(last) or name == "last_cycle":
            variable.values[place] = gap if math.isinf(last) else last
    dataset["outcome"].values[place] = outcome
    if message:
        dataset["message"].values[place] = message


def as_result(dataset: xr.Dataset, path: Path) -> Result:
    """The dataset, written to a file and opened as the report does it."""
    dataset.to_netcdf(path)
    return open_for_report(path)


def flank_positions(n_along: int = 4, n_across: int = 3) -> NDArray[np.float64]:
    """Two flanks as of a dovetail, (pairs, 3), m."""
    along, across = np.meshgrid(np.linspace(-0.02, 0.02, n_along), np.linspace(0.0, 0.006, n_across), indexing="ij")
    sides = [np.stack([0.245 - across, side * (0.0055 + across), along], axis=-1) for side in (1.0, -1.0)]
    return np.concatenate([side.reshape(-1, 3) for side in sides])


def _empty(
    axes: Mapping[str, Sequence[object]], sizes: Mapping[str, int], variables: Mapping[str, Variable]
) -> xr.Dataset:
    """Nothing is computed. sizes: lengths of axes and other dimensions."""
    found = {}
    for name, entry in variables.items():
        dimensions = (*axes, *entry.dimensions)
        gap = "" if entry.is_text else np.nan if entry.dtype.startswith("float") else 0
        values = np.full([sizes[each] for each in dimensions], gap, object if entry.is_text else entry.dtype)
        found[name] = xr.Variable(dimensions, values, attributes(name, entry))
    found["outcome"].values[...] = Outcome.NOT_COMPUTED
    return xr.Dataset(found)


def _about(name: str) -> dict[str, object]:
    return attributes(name, COORDINATES[name]) if name in COORDINATES else {}


# --- smooth ones, for figures ---


def smooth_result(
    *,
    frequency: Sequence[float] = (200.0, 201.0, 202.0, 204.0),
    wear_coefficient: Sequence[float] = (1.1e-11,),
    scheme: Sequence[str] = ("implicit", "explicit"),
    sweep: Sequence[str] = ("up",),
    cycles: Sequence[float] = (0.0, 1000.0, 5000.0, 20000.0),
    responses: Sequence[str] = ("tip",),
    loops: Sequence[int] = (),
    pairs: str = "grid",
    failed: Sequence[int] = (),
    wears: bool = True,
    without: Sequence[str] = (),
) -> Result:
    """A result of two surfaces, left and right, with 3 x 2 pairs each; 0 is the first cycle count.

    It wears most at the third frequency, and a little more with the explicit scheme. responses: each half of the one
    before. loops: pairs with ellipses in both tangents, whose normal force is open for a part. pairs: "grid",
    "scattered", or "nowhere" (no positions). failed: numbers of points that have lost their branch.
    """
    axes = {"frequency": frequency, "wear_coefficient": wear_coefficient, "excitation_amplitude": (0.5,)}
    axes |= {"step": (1000.0,), "scheme": scheme, "sweep": sweep}
    names = ("worn_volume", "wear_rate", "wear_depth", "mean_pressure", "response_amplitude", "response_phase")
    names += ("response_error", "wear_rate_error", "energy_error", "worn_volume_error")
    scattered = 2e-3 * np.random.default_rng(1).uniform(-1.0, 1.0, (12, 3))
    positions = flank_positions(3, 2) + {"grid": 0.0, "scattered": scattered, "nowhere": math.nan}[pairs]
    of_pairs = {"positions": positions, "surfaces": ["left"] * 6 + ["right"] * 6, "loops": loops}
    dataset = build_file(axes, cycles, responses=responses, variables=names, **of_pairs)
    grid = np.meshgrid(*(np.arange(len(values)) for values in axes.values()), indexing="ij")
    peak = 1.0 / (1.0 + 0.5 * (grid[0] - 2) ** 2)
    size = peak * (1.0 + 0.1 * grid[4] + 0.01 * grid[5]) * (1.0 + grid[1]) * (wears and len(cycles) > 1)
    share = (np.array(cycles) / max(cycles[-1], 1.0)) ** 0.5
    weights = (np.arange(12.0) + 1.0) / 12.0
    depth = 1e-5 * size[..., None, None] * share[:, None] * weights
    amplitude = 2e-3 * (peak * (1.0 + 0.02 * grid[5]))[..., None] * (1.0 - 0.125 * size[..., None] * share)
    level = 1.0 + peak[..., None] * np.ones(len(cycles))
    data = {
        "worn_volume": 2e-6 * depth.sum(axis=-1),
        "wear_rate": 1e-15 * size[..., None] * (1.0 - 0.5 * share),
        "wear_depth": depth,
        "mean_pressure": 1e7 * (1.0 + depth / 1e-5) * weights[::-1],
        "response_amplitude": amplitude[..., None] * 0.5 ** np.arange(len(responses)),
        "response_phase": -0.5,
        "response_error": 1e-3 * level,
        "wear_rate_error": 2e-3 * level,
        "energy_error": 3e-4 * level,
        "error_estimate": 0.02 * peak,
        "worn_volume_error": 0.02 * peak[..., None] * share,
        "step_limit": 5000.0,
        "branch": 0,
        "run_time": 1.0 + peak,
        **dict.fromkeys(UNKNOWN, np.nan),
    }
    for name, values in data.items():
        dataset[name].values[...] = values
    if loops:
        phase, count = dataset["phase"].values, 1.0 + np.arange(float(len(cycles)))[:, None, None, None]
        motion = np.stack([np.sin(phase), np.cos(phase), 0.5 * np.sin(phase)], axis=-1)
        force = np.stack([np.maximum(np.cos(phase), 0.0), np.sin(phase), np.cos(phase)], axis=-1)
        larger = 1.0 + np.array(loops, dtype=float)[:, None, None]
        dataset["loop_displacement"].values[..., list(loops), :, :] = 1e-6 * count * larger * motion
        dataset["loop_force"].values[..., list(loops), :, :] = 10.0 * force / count
    dataset["contact_area"].values[...] = 2e-6
    for flat in failed:
        fail(dataset, flat, int(Outcome.BRANCH_LOST))
    there = [*data, "outcome", "message", "last_cycle", *(LOOPS if loops else ())]
    study = '[study]\nname = "s"\n[scene]\nnodal_diameter = 0\n[solver]\nrtol = 0.01\n[slow_time]\ncycles = 1\n'
    kept = dataset[there].drop_vars(without).assign_attrs(title="Made up", study=study)
    return Result(Path("made.nc"), kept)


# --- samples, and scenes that differ ---

SAMPLE_CYCLES = (0.0, 5e4, 1e5)
SCATTER = """[study]
name = "s"
[scatter]
samples = 128
method = "sobol"
seed = 1
friction_coefficient = {normal = {mean = 0.5, std = 0.03}}
wear_coefficient = {lognormal = {factor = 1.5}}
gap = {normal = {std = 1e-7}, of = "each pair"}
"""


def sample_file(scatter: str = SCATTER, jump: float = 0.0) -> xr.Dataset:
    """Samples with worn volumes k_w mu (1 + mean gap / 10 um) N / 1000, m3, twice that at the second frequency.

    Pair 1 is worn ten times as deep as the others. jump: of k_w mu where mu > 0.51, 1/Pa.
    """
    pairs = flank_positions()
    section = ScatterSection.model_validate(tomllib.loads(scatter)["scatter"])
    own = {"friction_coefficient": 0.5, "wear_coefficient": 1e-11, "gap": np.zeros(len(pairs))}
    values = draw(section, own) | draw(section, own, SimpleNamespace(surface=("flank",) * len(pairs), position=pairs))
    friction, wear, gap = (values[name] for name in own)
    dataset = build_file({"frequency": (211.5, 212.0), "sample": range(len(wear))}, SAMPLE_CYCLES, variables=OF_SAMPLES)
    rate = 1e-3 * (wear * friction * (1.0 + 1e5 * gap.mean(axis=1)) + jump * (friction > 0.51))
    volume = np.array([1.0, 2.0])[:, None, None] * rate[:, None] * np.array(SAMPLE_CYCLES)
    share = np.where(np.arange(len(pairs)) == 1, 1.0, 0.1)
    data = {"worn_volume": volume, "wear_depth_max": 1e4 * volume, "wear_depth_last": 1e4 * volume[..., -1:] * share}
    data |= {"worn_volume_error": 0.01, "error_estimate": 0.01, "wear_depth_max_error": 1e2 * volume}
    for name, values in data.items():
        dataset[name].values[...] = values
    return dataset.assign_coords(
        sample_friction_coefficient=("sample", friction, {"units": "1", "long_name": "friction"}),
        sample_wear_coefficient=("sample", wear, {"units": "1/Pa"}),
        sample_gap=(("sample", "contact"), gap, {"units": "m"}),
    ).assign_attrs(study=scatter)


def mesh_file() -> xr.Dataset:
    """Two speeds and two meshes, the first of 12 and the second of 24 pairs; most is worn on the first."""
    dataset = build_file({"frequency": (190.0,), "rotation_speed": (2900.0, 3000.0), "mesh": (1, 2)}, SAMPLE_CYCLES)
    dataset["rotation_speed"].attrs = {"units": "rpm", "long_name": "speed of rotation"}
    dataset["worn_volume"].values[:, :, 0] *= 10.0
    coarse, fine = flank_positions(3, 2), flank_positions(4, 3)
    position = np.full((2, len(fine), 3), np.nan)
    position[0, : len(coarse)], position[1] = coarse, fine
    exists = np.isfinite(position[..., 0])
    there = xr.DataArray(exists, dims=("mesh", "contact"))
    for name in ("wear_depth", "mean_pressure", "open_fraction", "slip_range"):
        dataset[name] = dataset[name].where(there).transpose(*dataset[name].dims)
    surfaces = [["intrados"] * n + ["extrados"] * n + [""] * (24 - 2 * n) for n in (6, 12)]
    pairs = ("mesh", "contact")
    return dataset.assign_coords(
        **{f"contact_{axis}": (pairs, position[..., i], {"units": "m"}) for i, axis in enumerate("xyz")},
        contact_area=(pairs, np.where(exists, 1e-5, np.nan), {"units": "m2"}),
        contact_surface=(pairs, surfaces),
        contact_exists=(pairs, exists.astype(np.int8)),
    )


# --- of a study ---


def result_of_study(
    study: Study, facts: SceneFacts = FACTS, **given: Callable[[tuple[int, ...]], object]
) -> xr.Dataset:
    """A result of a study whose points are all computed to the end, without wear, slip and errors.

    given: for variables by name, from the index of a point along the axes to its values.
    """
    dataset = build_dataset(study, facts, ())
    assert given.keys() <= set(dataset.data_vars)
    for name, variable in ((str(name), variable) for name, variable in dataset.data_vars.items()):
        values = variable.values
        if values.dtype.kind == "f":
            values[...] = np.nan if name in UNKNOWN else 0.0
        if name in ("last_cycle", "last_mission"):
            values[...] = study.output_counts[-1]
        for point in np.ndindex(dataset["outcome"].shape) if name in given else ():
            values[point] = given[name](point)
    return dataset


def build_dataset(study: Study, facts: SceneFacts, results: Sequence[PointResult]) -> xr.Dataset:
    """The result of a study: axes in the order of the study, then cycle, then contact or response."""
    axes, behind = study.dimensions, dimensions_behind(study, facts)
    sizes = {name: len(values) for name, values in {**axes, **behind}.items()}
    variables = {**study.recorded, **study.kind.always}
    dataset = _empty(axes, sizes, variables)
    dataset["outcome"].values[...] = Outcome.CONVERGED
    shape = dataset["outcome"].shape
    for result, point in [(each, np.unravel_index(number, shape)) for numbers, each in results for number in numbers]:
        for name, values in result.values.items():
            if name in LOOPS:
                dataset[name].values[point][:, list(study.outputs.loops)] = values
            elif name in dataset:
                dataset[name].values[point] = values
    scenes = find_scenes(study)
    coords = {
        array.name: xr.Variable(array.dimensions, array.values, attributes(array.name, array.entry))
        for array in coordinates(study, [facts] * len(scenes.studies), scenes)
    }
    return dataset.assign_coords(coords).assign_attrs({**describe_run(study, facts), POINTS_LEFT: np.int32(0)})


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """The file as xarray writes it. Texts of any length cannot be compressed."""
    encoding: dict[str, dict[str, object]] = {}
    for name, variable in ((str(name), variable) for name, variable in dataset.data_vars.items()):
        if variable.dtype.kind not in "OU":
            encoding[name] = {"zlib": True, "complevel": 1, "shuffle": True}
        if name in LOOPS:
            encoding[name]["chunksizes"] = tuple(1 if of == "contact" else size for of, size in variable.sizes.items())
    for key, coordinate in dataset.coords.items():
        # Every coordinate value is there: no mark for missing ones.
        encoding[str(key)] = {"_FillValue": None} if coordinate.dtype.kind == "f" else {}
    dataset.to_netcdf(path, engine="netcdf4", format="NETCDF4", encoding=encoding)
