"""Results -> one labelled dataset -> one NetCDF file, written under a temporary name and renamed."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from studyrunner.certificates import summarise_certificates
from studyrunner.evaluate import endings
from studyrunner.output import partial_path
from studyrunner.results import MarchResult
from studyrunner.scene import SceneFacts
from studyrunner.study import Study
from studyrunner.study_file import format_study
from studyrunner.variables import ASKED, COORDINATES, KEPT

_PACKAGES = ("fretwear", "numpy", "scipy", "numba", "xarray", "netCDF4")


def build_dataset(study: Study, facts: SceneFacts, results: Sequence[MarchResult]) -> xr.Dataset:
    """The result of a study: axes in the order of the study, then cycle, then contact or response.

    Every point of the study is in exactly one of the results; anything else is a bug and raises ValueError.
    """
    axes = study.dimensions
    shape = tuple(len(values) for values in axes.values())
    sizes = {"cycle": len(study.cycles_kept), "contact": len(facts.area), "response": len(facts.response_names)}
    asked = [name for name in ASKED if name in study.outputs.variables]
    variables = {**{name: ASKED[name] for name in asked}, **KEPT}
    arrays = {
        name: np.zeros(shape + tuple(sizes[dimension] for dimension in entry.dimensions), dtype=entry.dtype)
        for name, entry in variables.items()
    }
    filled = np.zeros(shape, dtype=np.int64)
    for result in results:
        for point in result.points:
            filled[point] += 1
            for name in asked:
                arrays[name][point] = result.values[name]
            for name in KEPT:
                arrays[name][point] = getattr(result, name)
    if not np.all(filled == 1):
        raise ValueError(f"{np.count_nonzero(filled != 1)} points were not computed exactly once")
    dataset = xr.Dataset(
        {name: ((*axes, *variables[name].dimensions), array) for name, array in arrays.items()},
        coords=_coordinates(study, facts),
        attrs={**_attributes(study, facts), "certificate_summary": summarise_certificates(study, results)},
    )
    for name in map(str, dataset.variables):
        entry = COORDINATES.get(name) or variables[name]
        content = "coordinate" if name in COORDINATES else "modelResult"
        dataset[name].attrs = {
            "units": entry.units,
            "long_name": entry.long_name,
            "coverage_content_type": content,
        }
        if entry.flags:
            dataset[name].attrs["flag_values"] = np.arange(len(entry.flags), dtype=entry.dtype)
            dataset[name].attrs["flag_meanings"] = " ".join(entry.flags)
        if name in asked and not entry.dtype.startswith("float"):
            dataset[name].attrs["comment"] = "0 where the point failed, see outcome"
    flags = endings()
    dataset["outcome"].attrs["flag_values"] = np.array([flag.number for flag in flags], dtype=np.int8)
    dataset["outcome"].attrs["flag_meanings"] = " ".join(flag.meaning for flag in flags)
    return dataset


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Writes the file under a temporary name in the same folder, then renames it: whole or not at all."""
    temporary = partial_path(path)
    encoding: dict[str, dict[str, object]] = {}
    for name in dataset.data_vars:
        encoding[str(name)] = {"zlib": True, "complevel": 1, "shuffle": True}
    for key, coordinate in dataset.coords.items():
        # Every coordinate value is there: no mark for missing ones.
        encoding[str(key)] = {"_FillValue": None} if coordinate.dtype.kind == "f" else {}
    try:
        dataset.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _coordinates(study: Study, facts: SceneFacts) -> dict[str, tuple[str, NDArray[np.generic]]]:
    coordinates: dict[str, tuple[str, NDArray[np.generic]]] = {
        name: (name, _labels(values)) for name, values in study.dimensions.items()
    }
    coordinates["cycle"] = ("cycle", np.array(study.cycles_kept))
    coordinates["contact"] = ("contact", np.arange(len(facts.area), dtype=np.int32))
    coordinates["response"] = ("response", _labels(facts.response_names))
    for column, name in enumerate(("contact_x", "contact_y", "contact_z")):
        coordinates[name] = ("contact", np.array(facts.position[:, column]))
    coordinates["contact_area"] = ("contact", np.array(facts.area))
    coordinates["contact_surface"] = ("contact", _labels(facts.surface))
    return coordinates


def _labels(values: Sequence[object]) -> NDArray[np.generic]:
    """Values of an axis: whole numbers in 32 bits, which every reader of NetCDF knows; all text where one is."""
    texts = any(isinstance(value, str) for value in values)
    array = np.array([str(value) for value in values] if texts else values)
    return array.astype(np.int32) if array.dtype.kind == "i" else array


def _attributes(study: Study, facts: SceneFacts) -> dict[str, str]:
    """Attributes of the file. None of them depends on when, where or on how many ranks the study ran."""
    versions = {name: metadata.version(name) for name in _PACKAGES}
    own = f"{_PACKAGES[0]} {versions[_PACKAGES[0]]}"
    return {
        "Conventions": "CF-1.11, ACDD-1.3",
        "title": study.study.title or study.study.name,
        "summary": "Fretting wear of a joint under vibration: wear histories over the axes of a parameter study.",
        "keywords": "fretting wear, contact, dry friction, vibration, harmonic balance",
        "source": f"{own}: multiscale harmonic balance with wear on a slow time scale",
        "history": f"computed by run-study of {own} from the study in the attribute study",
        "study": format_study(study),
        "versions": ", ".join([f"Python {platform.python_version()}", *(f"{k} {v}" for k, v in versions.items())]),
        "scene_sha256": facts.digest,
    }
