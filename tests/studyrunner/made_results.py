"""The one factory of results: a dataset with everything in memory, of any study, made from the tables of variables.

It is also the plain twin of the writer, as xarray writes it.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from solver.outcome import Outcome
from studyrunner.checkpoint.records import variable_sizes
from studyrunner.kinds.kind import build_tasks
from studyrunner.kinds.task import Index, PointResult
from studyrunner.result.arrays import attributes, coordinates, scene_arrays
from studyrunner.result.provenance import POINTS_LEFT, describe_run
from studyrunner.scene.scene import SceneFacts
from studyrunner.scene.scene_set import pair_arrays
from studyrunner.scene.variables import SceneVariable
from studyrunner.study.study import Study
from studyrunner.variables import COUNTS, LOOPS
from tests.studyrunner.fakes import FACTS, changed, fake_histories

UNKNOWN = ("jump_cycle", "fold_frequency", "cycles_to_target", "cycles_to_target_error")


def made_result(study: Study, facts: SceneFacts = FACTS, **given: Callable[[Index], object]) -> xr.Dataset:
    """A result of a study whose points are all computed to the end, without wear, slip and errors.

    given: for variables by name, from the index of a point along the axes to its values.
    """
    axes = study.dimensions
    shape = tuple(len(values) for values in axes.values())
    dataset = _empty(study, facts)
    for name in (str(name) for name in dataset.data_vars):
        values = dataset[name].values
        if values.dtype.kind == "f":
            values[...] = np.nan if name in UNKNOWN else 0.0
        if name in ("last_cycle", "last_mission"):
            values[...] = study.cycles_kept[-1]
        if name in given:
            for point in np.ndindex(shape):
                values[point] = given[name](point)
    assert given.keys() <= set(dataset.data_vars)
    for name in ("outcome", "stable"):
        if name in dataset and name not in given:
            dataset[name].values[...] = int(name == "stable")
    return dataset


def march_results(study: Study, **given: Callable[[Index], object]) -> list[PointResult]:
    """A result for each history of a study; those named are what the functions say of its first point."""
    plan = build_tasks(study, FACTS.n_displacements)
    histories = (result for _, result in fake_histories(plan))
    return [changed(each, **{name: say(min(each.points)) for name, say in given.items()}) for each in histories]


def build_dataset(
    study: Study, facts: SceneFacts, results: Sequence[PointResult], of_scene: Sequence[SceneVariable] = ()
) -> xr.Dataset:
    """The result of a study: axes in the order of the study, then cycle, then contact or response."""
    dataset = _empty(study, facts, of_scene)
    dataset["outcome"].values[...] = Outcome.CONVERGED
    for result in results:
        for point in result.points:
            for name, values in result.values.items():
                if name in LOOPS:
                    dataset[name].values[point][:, list(study.outputs.loops)] = values
                elif name in dataset:
                    dataset[name].values[point] = values
    return dataset


def _empty(study: Study, facts: SceneFacts, of_scene: Sequence[SceneVariable] = ()) -> xr.Dataset:
    """The dataset of a study of which nothing is computed."""
    axes, sizes = study.dimensions, variable_sizes(study, facts)
    sizes = {name: len(values) for name, values in axes.items()} | sizes
    variables = {name: entry for name, entry in study.variables.items() if name in study.outputs.variables}
    variables |= (LOOPS if study.outputs.loops else {}) | study.kept | (COUNTS if study.to_the_end else {})
    found = {}
    for name, entry in variables.items():
        dimensions = (*axes, *entry.dimensions)
        values = np.zeros([sizes[each] for each in dimensions], object if entry.is_text else entry.dtype)
        values[...] = "" if entry.is_text else np.nan if entry.dtype.startswith("float") else 0
        found[name] = xr.Variable(dimensions, values, attributes(name, entry, study.has_modes))
    found["outcome"].values[...] = Outcome.NOT_COMPUTED
    arrays = [*coordinates(study, facts, pair_arrays(study, [facts])), *scene_arrays(study, of_scene)]
    named = {scene.name for scene in of_scene if not scene.coordinate}
    for array in arrays:
        lengths = [
            len(axes[dimension]) if dimension in axes else size
            for dimension, size in zip(array.dimensions, array.values.shape, strict=True)
        ]
        values = np.array(np.broadcast_to(array.values, lengths)) if array.over_axes else array.values
        found[array.name] = xr.Variable(array.dimensions, values, attributes(array.name, array.entry))
    coords = {array.name: found.pop(array.name) for array in arrays if array.name not in named}
    return xr.Dataset(found, coords, {**describe_run(study, facts), POINTS_LEFT: np.int32(0)})


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """The file as xarray writes it."""
    encoding: dict[str, dict[str, object]] = {}
    for name in dataset.data_vars:
        if dataset[name].dtype.kind in "OU":
            # texts of any length cannot be compressed
            continue
        encoding[str(name)] = {"zlib": True, "complevel": 1, "shuffle": True}
        if name in LOOPS:
            sizes = dataset[name].sizes
            encoding[str(name)]["chunksizes"] = tuple(1 if of == "contact" else sizes[of] for of in sizes)
    for key, coordinate in dataset.coords.items():
        # Every coordinate value is there: no mark for missing ones.
        encoding[str(key)] = {"_FillValue": None} if coordinate.dtype.kind == "f" else {}
    dataset.to_netcdf(path, engine="netcdf4", format="NETCDF4", encoding=encoding)
