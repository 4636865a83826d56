"""The one factory of results: datasets in memory, of any axes and pairs, made from the tables of variables.

`build_file` has numbers that all differ, `make_result` smooth ones, `sample_file` samples whose volumes follow from
what they draw, `mesh_file` scenes that differ in their pairs. `made_result` is of a study; `build_dataset` with
`write_dataset` is the plain twin of the writer.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.stats import norm, qmc

from solver.outcome import Outcome
from studyrunner.coordinates import COORDINATES, SCENE
from studyrunner.kinds.task import Index, PointResult
from studyrunner.result.arrays import attributes, coordinates, scene_arrays
from studyrunner.result.provenance import POINTS_LEFT, describe_run
from studyrunner.result.view import Result, open_for_report
from studyrunner.scene.answers import SceneVariable
from studyrunner.scene.scene import SceneFacts, variable_sizes
from studyrunner.scene.scene_set import pair_arrays
from studyrunner.study.study import Study
from studyrunner.variables import ASKED, KEPT, LOOP_COMPONENTS, LOOPS, OF_SAMPLES, USUAL, Variable
from tests.studyrunner.fakes import FACTS

FAILED = int(Outcome.MARCH_FAILED)
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
    failing: int = FAILED,
    **of_file: str,
) -> xr.Dataset:
    """A result of random numbers up to 1e-6.

    failed: numbers of the points that end with `failing`, the last axis fastest.
    positions, surfaces: of the pairs, two flanks if not given. of_file: attributes of the file.
    """
    random = np.random.default_rng(1)
    positions = flank_positions() if positions is None else positions
    half = len(positions) // 2
    found: dict[str, Any] = dict(axes)
    found |= {"cycle": np.array(cycles, dtype=float), "contact": np.arange(len(positions)), "response": list(responses)}
    if loops:
        found |= {"phase": 2.0 * np.pi * np.arange(16) / 16, "component": list(LOOP_COMPONENTS)}
    asked = {name: ASKED[name] for name in variables} | (LOOPS if loops else {}) | KEPT
    dataset = _empty(axes, {name: len(values) for name, values in found.items()}, asked)
    for name, variable in dataset.variables.items():
        if name not in ("outcome", "message"):
            numbers = variable.values.dtype.kind == "f"
            variable.values[...] = random.uniform(1e-7, 1e-6, variable.shape) if numbers else 1
    dataset["last_cycle"].values[...] = cycles[-1]
    dataset["outcome"].values[...] = Outcome.CONVERGED
    for name in LOOPS if loops else ():
        dataset[name].values[..., ~np.isin(np.arange(len(positions)), loops), :, :] = np.nan
    for flat in failed:
        fail(dataset, flat, failing)
    pairs = {f"contact_{axis}": positions[:, i] for i, axis in enumerate("xyz")}
    pairs |= {"contact_area": np.full(len(positions), 1e-5)}
    pairs |= {"contact_surface": np.array(surfaces or ["intrados"] * half + ["extrados"] * (len(positions) - half))}
    coords = {name: (name, np.array(values), _about(name)) for name, values in found.items()}
    coords |= {name: ("contact", values, _about(name)) for name, values in pairs.items()}
    return dataset.assign_coords(coords).assign_attrs({"title": "A study", "study": STUDY, **of_file})


def fail(dataset: xr.Dataset, flat: int, outcome: int, last: float = -math.inf) -> None:
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


def as_result(dataset: xr.Dataset, path: Path) -> Result:
    """The dataset, written to a file and opened as the report does it."""
    dataset.to_netcdf(path)
    return open_for_report(path)


def flank_positions(n_along: int = 4, n_across: int = 3) -> NDArray[np.float64]:
    """Two flanks as of a dovetail, (pairs, 3), m."""
    along, across = np.meshgrid(np.linspace(-0.02, 0.02, n_along), np.linspace(0.0, 0.005, n_across), indexing="ij")
    sides = [np.stack([0.245 - across, side * (0.0055 + across), along], axis=-1) for side in (1.0, -1.0)]
    return np.concatenate([side.reshape(-1, 3) for side in sides])


def _empty(
    axes: Mapping[str, Sequence[object]], sizes: Mapping[str, int], variables: Mapping[str, Variable]
) -> xr.Dataset:
    """Nothing is computed. sizes: lengths of axes and other dimensions."""
    found = {}
    for name, entry in variables.items():
        dimensions = (*axes, *entry.dimensions)
        values = np.zeros([sizes[each] for each in dimensions], object if entry.is_text else entry.dtype)
        values[...] = "" if entry.is_text else np.nan if entry.dtype.startswith("float") else 0
        found[name] = xr.Variable(dimensions, values, attributes(name, entry, "modal_amplitude" in axes))
    found["outcome"].values[...] = Outcome.NOT_COMPUTED
    return xr.Dataset(found)


def _about(name: str) -> dict[str, object]:
    return attributes(name, COORDINATES[name]) if name in COORDINATES else {}


# --- smooth ones, for figures ---


def make_result(
    *,
    frequency: Sequence[float] = (200.0, 201.0, 202.0, 204.0),
    wear_coefficient: Sequence[float] = (1.1e-11,),
    scheme: Sequence[str] = ("implicit", "explicit"),
    sweep: Sequence[str] = ("up",),
    cycles: Sequence[float] = (0.0, 1000.0, 5000.0, 20000.0),
    pairs: str = "grid",
    failed: Sequence[int] = (),
    failing: int = int(Outcome.BRANCH_LOST),
    wears: bool = True,
    without: Sequence[str] = (),
) -> Result:
    """A result of two surfaces, left and right, with 3 x 2 pairs each; 0 is the first cycle count.

    It wears most at the third frequency, and a little more with the explicit scheme. pairs: "grid", "scattered", or
    "nowhere" (no positions). failed: numbers of points with the outcome `failing`.
    """
    axes = {"frequency": frequency, "wear_coefficient": wear_coefficient, "excitation_amplitude": (0.5,)}
    axes |= {"step": (1000.0,), "scheme": scheme, "sweep": sweep}
    names = ("worn_volume", "wear_rate", "wear_depth", "mean_pressure", "response_amplitude", "response_phase")
    names += ("response_error", "wear_rate_error", "energy_error", "worn_volume_error")
    dataset = build_file(
        axes, cycles, positions=_positions(pairs), surfaces=["left"] * 6 + ["right"] * 6, variables=names
    )
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
        "response_amplitude": amplitude[..., None],
        "response_phase": np.full((*amplitude.shape, 1), -0.5),
        "response_error": 1e-3 * level,
        "wear_rate_error": 2e-3 * level,
        "energy_error": 3e-4 * level,
        "error_estimate": 0.02 * peak,
        "worn_volume_error": 0.02 * peak[..., None] * share,
        "step_limit": np.full(peak.shape, 5000.0),
        "branch": np.zeros(peak.shape),
        "run_time": 1.0 + peak,
        **{name: np.full(peak.shape, np.nan) for name in UNKNOWN},
    }
    for name, values in data.items():
        dataset[name].values[...] = values
    dataset["contact_area"].values[...] = 2e-6
    for flat in failed:
        fail(dataset, flat, failing)
    kept = dataset[[*data, "outcome", "last_cycle"]].drop_vars(without)
    study = '[study]\nname = "s"\n[scene]\nnodal_diameter = 0\n[solver]\nrtol = 0.01\n[slow_time]\ncycles = 1\n'
    return Result(Path("made.nc"), kept.assign_attrs(title="Made up", study=study))


def with_variables(result: Result, **variables: xr.DataArray) -> Result:
    """The same file with further variables, or others in their place."""
    return Result(result.path, result.dataset.assign(variables))


def with_endings(result: Result, endings: Mapping[int, tuple[int, float]], messages: Mapping[int, str]) -> Result:
    """The same file with other endings of points, by number: outcome, and the cycle count that they came to."""
    dataset = result.dataset.copy(deep=True)
    texts = np.full(dataset["outcome"].shape, "", dtype=object)
    for flat, text in messages.items():
        texts.flat[flat] = text
    dataset["message"] = (dataset["outcome"].dims, texts)
    for flat, (outcome, last) in endings.items():
        fail(dataset, flat, outcome, last)
    return Result(result.path, dataset)


def with_two_responses(result: Result) -> Result:
    """The same file with a second response, half as large."""
    names = ["response_amplitude", "response_phase"]
    half = result.dataset[names].assign_coords(response=["root"]) * 0.5
    both = xr.concat([result.dataset[names], half], dim="response", join="outer")
    kept = result.dataset.drop_vars([*names, "response"])
    return Result(result.path, kept.assign_coords(response=["tip", "root"]).assign(both.data_vars))


def with_loops(result: Result, contacts: Sequence[int] = (0, 11), n_phases: int = 16) -> Result:
    """The same file with loops of these pairs: ellipses in both tangents, the normal force open for a part."""
    dataset, phase = result.dataset, 2.0 * np.pi * np.arange(n_phases) / n_phases
    dims = (*dataset["wear_depth"].dims, "phase", "component")
    shape = (*dataset["wear_depth"].shape, n_phases, 3)
    moved, pushed = np.full(shape, math.nan), np.full(shape, math.nan)
    for contact, cycle in ((each, cycle) for each in contacts for cycle in range(dataset.sizes["cycle"])):
        motion = 1e-6 * (1 + contact) * np.stack([np.sin(phase), np.cos(phase), 0.5 * np.sin(phase)], axis=-1)
        force = 10.0 * np.stack([np.maximum(np.cos(phase), 0.0), np.sin(phase), np.cos(phase)], axis=-1)
        moved[..., cycle, contact, :, :] = motion * (1 + cycle)
        pushed[..., cycle, contact, :, :] = force / (1 + cycle)
    for values in (moved, pushed):
        values[dataset["outcome"].values != 0] = math.nan
    loops = dataset.assign(loop_displacement=(dims, moved, {"units": "m"}), loop_force=(dims, pushed, {"units": "N"}))
    return Result(result.path, loops.assign_coords(phase=phase, component=list(LOOP_COMPONENTS)))


def with_sector(result: Result, *, mesh: bool = True, frequencies: bool = True) -> Result:
    """The same file with a mesh of a cube of two parts and natural frequencies of three modes."""
    dataset = result.dataset
    if mesh:
        nodes = np.array([[x, y, z] for x in (0.2, 0.3) for y in (-0.05, 0.05) for z in (-0.02, 0.02)])
        quads = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
        values = (*nodes.T, np.array(quads, dtype=np.int32), np.array(["disk"] * 3 + ["blade"] * 3))
        entries = SCENE["mesh"].items()
        of_mesh = {name: (entry.dimensions, each) for (name, entry), each in zip(entries, values, strict=True)}
        dataset = dataset.assign(of_mesh)
    if frequencies:
        modes = np.array([[200.0, 400.0, 900.0], [201.0, 500.0, 950.0], [202.0, 520.0, 980.0]])
        dataset = dataset.assign(natural_frequency=(("nodal_diameter", "mode"), modes))
        dataset = dataset.assign_coords(nodal_diameter=np.arange(3))
    return Result(result.path, dataset)


def _positions(pairs: str) -> NDArray[np.float64]:
    """Two flanks of 3 (along z) x 2 pairs; the second mirrored."""
    if pairs == "nowhere":
        return np.full((12, 3), math.nan)
    flank = np.array([[0.24 + 0.003 * i, 0.01 - 0.003 * i, 0.01 * along] for along in range(3) for i in (0, 1)])
    both = np.concatenate([flank, flank * [1.0, -1.0, 1.0]])
    return both + 2e-3 * np.random.default_rng(1).uniform(-1.0, 1.0, both.shape) * (pairs == "scattered")


# --- samples, and scenes that differ ---

N_SAMPLES = 64
SAMPLE_CYCLES = (0.0, 100.0, 200.0)
SCATTER = """[study]
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
    axes = {"frequency": (190.0, 191.0), "scheme": ("adaptive",), "sample": range(n_samples)}
    dataset = build_file(axes, SAMPLE_CYCLES, variables=OF_SAMPLES)
    friction, wear = (norm.ppf(column) for column in qmc.Sobol(2, seed=1).random(n_samples).T)
    volume = 1e-9 * factor**wear * np.where(friction < np.median(friction), 1.0 + jump, 1.0)
    dataset["worn_volume"].values[...] = volume[:, None] * np.array(SAMPLE_CYCLES) / SAMPLE_CYCLES[-1]
    dataset["worn_volume_error"].values[...] = 0.01
    dataset["error_estimate"].values[...] = 0.01
    gap = np.random.default_rng(1).normal(size=(n_samples, dataset.sizes["contact"])) * 1e-7
    return dataset.assign_coords(
        sample_friction_coefficient=("sample", 0.5 + 0.03 * friction, {"units": "1", "long_name": "friction"}),
        sample_wear_coefficient=("sample", 1e-11 * factor**wear, {"units": "1/Pa"}),
        sample_gap=(("sample", "contact"), gap, {"units": "m"}),
    ).assign_attrs(study=SCATTER.format(samples=n_samples))


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
    surfaces = np.full(exists.shape, "", dtype="U8")
    for row, n_pairs in zip(surfaces, exists.sum(axis=1), strict=True):
        row[:n_pairs] = np.repeat(["intrados", "extrados"], n_pairs // 2)
    pairs = ("mesh", "contact")
    return dataset.assign_coords(
        **{f"contact_{axis}": (pairs, position[..., i], {"units": "m"}) for i, axis in enumerate("xyz")},
        contact_area=(pairs, np.where(exists, 1e-5, np.nan), {"units": "m2"}),
        contact_surface=(pairs, surfaces),
        contact_exists=(pairs, exists.astype(np.int8)),
    )


# --- of a study ---


def made_result(study: Study, facts: SceneFacts = FACTS, **given: Callable[[Index], object]) -> xr.Dataset:
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
            values[...] = study.cycles_kept[-1]
        for point in np.ndindex(dataset["outcome"].shape) if name in given else ():
            values[point] = given[name](point)
    return dataset


def build_dataset(
    study: Study, facts: SceneFacts, results: Sequence[PointResult], of_scene: Sequence[SceneVariable] = ()
) -> xr.Dataset:
    """The result of a study: axes in the order of the study, then cycle, then contact or response."""
    axes, sizes = study.dimensions, variable_sizes(study, facts)
    sizes = {name: len(values) for name, values in axes.items()} | sizes
    variables = {**study.recorded, **study.kind.kept}
    dataset = _empty(axes, sizes, variables)
    dataset["outcome"].values[...] = Outcome.CONVERGED
    for result, point in [(each, point) for each in results for point in each.points]:
        for name, values in result.values.items():
            if name in LOOPS:
                dataset[name].values[point][:, list(study.outputs.loops)] = values
            elif name in dataset:
                dataset[name].values[point] = values
    arrays = [*coordinates(study, facts, pair_arrays(study, [facts])), *scene_arrays(study, of_scene)]
    named = {scene.name for scene in of_scene if not scene.coordinate}
    found = {}
    for array in arrays:
        lengths = [sizes.get(each, size) for each, size in zip(array.dimensions, array.values.shape, strict=True)]
        values = np.array(np.broadcast_to(array.values, lengths)) if array.over_axes else array.values
        found[array.name] = xr.Variable(array.dimensions, values, attributes(array.name, array.entry))
    coords = {name: variable for name, variable in found.items() if name not in named}
    dataset = dataset.assign({name: found[name] for name in named}).assign_coords(coords)
    return dataset.assign_attrs({**describe_run(study, facts), POINTS_LEFT: np.int32(0)})


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
