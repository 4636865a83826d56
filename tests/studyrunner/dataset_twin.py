"""The plain twin of the result file: a dataset with everything in memory, written by xarray."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from solver.outcome import Outcome
from studyrunner.coordinates import COORDINATES
from studyrunner.netcdf.attributes import coordinates
from studyrunner.netcdf.provenance import POINTS_LEFT, describe_run
from studyrunner.plan.results import MarchResult
from studyrunner.scene.scene import SceneFacts
from studyrunner.scene.scene_set import pair_arrays
from studyrunner.scene.variables import SceneVariable
from studyrunner.study.study import Study
from studyrunner.variables import ASKED, KEPT, LOOP_COMPONENTS, LOOP_PHASES, LOOPS


def build_dataset(
    study: Study,
    facts: SceneFacts,
    results: Sequence[MarchResult],
    certificates: str,
    of_scene: Sequence[SceneVariable] = (),
) -> xr.Dataset:
    """The result of a study: axes in the order of the study, then cycle, then contact or response."""
    axes = study.dimensions
    shape = tuple(len(values) for values in axes.values())
    sizes = {"cycle": len(study.cycles_kept), "contact": len(facts.area), "response": len(facts.response_names)}
    sizes |= {"phase": LOOP_PHASES, "component": len(LOOP_COMPONENTS)}
    asked = [name for name in ASKED if name in study.outputs.variables]
    loops = list(LOOPS) if study.outputs.loops else []
    variables = {**{name: ASKED[name] for name in asked}, **{name: LOOPS[name] for name in loops}, **KEPT}
    arrays = {
        name: np.zeros(shape + tuple(sizes[dimension] for dimension in entry.dimensions), dtype=entry.dtype)
        for name, entry in variables.items()
    }
    for name in loops:
        arrays[name][:] = np.nan
    arrays["message"] = arrays["message"].astype(object)
    for result in results:
        for point in result.points:
            for name in asked:
                arrays[name][point] = result.values[name]
            for name in loops:
                arrays[name][point][:, list(study.outputs.loops)] = result.values[name]
            for name in KEPT:
                arrays[name][point] = result.values[name]
    dataset = xr.Dataset(
        {name: ((*axes, *variables[name].dimensions), array) for name, array in arrays.items()},
        coords={
            **coordinates(study, facts, pair_arrays(study, [facts])),
            **{scene.name: (scene.name, scene.values) for scene in of_scene if scene.coordinate},
        },
        attrs={**describe_run(study, facts), "certificate_summary": certificates, POINTS_LEFT: np.int32(0)},
    )
    for scene in of_scene:
        if not scene.coordinate:
            dimensions = (*(axes if scene.axes else ()), *scene.entry.dimensions)
            lengths = (*(shape if scene.axes else ()), *scene.values.shape[-len(scene.entry.dimensions) :])
            dataset[scene.name] = (dimensions, np.array(np.broadcast_to(scene.values, lengths)))
            variables[scene.name] = scene.entry
    for name in map(str, dataset.variables):
        entry = COORDINATES.get(name) or variables[name]
        content = "coordinate" if name in COORDINATES else entry.content
        dataset[name].attrs = {"units": entry.units, "long_name": entry.long_name, "coverage_content_type": content}
        if entry.comment:
            dataset[name].attrs["comment"] = entry.comment
        if entry.flags:
            dataset[name].attrs["flag_values"] = np.arange(len(entry.flags), dtype=entry.dtype)
            dataset[name].attrs["flag_meanings"] = " ".join(entry.flags)
        if name in asked and not entry.dtype.startswith("float"):
            failed = "0 where there is no result, see last_cycle."
            dataset[name].attrs["comment"] = f"{entry.comment} {failed}" if entry.comment else failed
    dataset["outcome"].attrs["flag_values"] = np.array(list(Outcome), dtype=np.int8)
    dataset["outcome"].attrs["flag_meanings"] = " ".join(flag.meaning for flag in Outcome)
    dataset["outcome"].attrs["sentences"] = "\n".join(flag.sentence for flag in Outcome)
    return dataset


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
