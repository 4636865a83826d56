"""Writes the result of a study to one NetCDF file, under a temporary name that is changed at the end.

The records of histories are read from the file of the run and written in slabs: only one slab is in memory, whatever
the number of points.

By hand: `to_netcdf` of xarray has the whole result in memory, or needs dask.
"""

import contextlib
import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
from numpy.typing import NDArray

from solver.outcome import Outcome
from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.checkpoint.store import RESULTS
from studyrunner.kinds.wear.kind import LOOPS
from studyrunner.result.arrays import attributes
from studyrunner.result.target import Target
from studyrunner.scene.answers import SmallArray, StoredScene
from studyrunner.scene.scene import SceneFacts, dimensions_behind
from studyrunner.study.study import Study
from studyrunner.study.text import POINTS_LEFT, SCENE_GROUP
from studyrunner.system.machine import find_fault, replacing
from studyrunner.user_error import StorageError
from studyrunner.variables import Variable

_BYTES_A_SLAB = 16e6
_BYTES_OF_CACHE = 2**16
_KEY_TYPE = "S32"
_COMPLEX = np.dtype([("r", "f8"), ("i", "f8")])
_PACKED: Any = {"compression": "zlib", "complevel": 1, "shuffle": True}

Region = tuple[slice, ...]


def write_result(
    study: Study,
    facts: SceneFacts,
    completion: CompletionIndex,
    target: Target,
    arrays: Sequence[SmallArray],
    origin: Mapping[str, object],
    scene: StoredScene | None = None,
) -> Counter[int]:
    """Writes the result of a study: axes in the order of the study, then cycle or mission, then others.

    Points that are not computed yet have the outcome `not_computed`; with such points a finished result stays.
    completion: the finished histories. target: is replaced as a whole or not at all. origin: attributes of the file.
    scene: contents of its group. Returns the number of points of each outcome. Raises StorageError.
    """
    shape = tuple(len(values) for values in study.dimensions.values())
    slab = _slab_shape(shape, completion.kind.itemsize)
    keys, outcomes = _keys(completion), Counter[int]()
    if target.finished and not keys.all():
        for _, records in _slabs(shape, slab, completion, keys):
            outcomes.update(records["outcome"].tolist())
        return outcomes
    try:
        with replacing(target.path, target.old) as temporary, _writing(temporary) as file:
            file.setncatts(origin)
            variables = _create_all(file, study, facts, slab, arrays)
            for region, records in _slabs(shape, slab, completion, keys):
                for name, entry in variables.items():
                    values = records[name].reshape(*(at.stop - at.start for at in region), *records[name].shape[1:])
                    if name not in LOOPS:
                        file[name][(*region, ...)] = values.astype(object) if entry.is_text else values
                    for place, pair in enumerate(study.outputs.loops if name in LOOPS else ()):
                        file[name][(*region, slice(None), pair)] = values[..., place, :, :]
                outcomes.update(records["outcome"].tolist())
            file.setncattr(POINTS_LEFT, np.int32(outcomes[Outcome.NOT_COMPUTED]))
            for array in arrays:
                _write_array(file, shape, slab, array)
            if scene is not None:
                _write_scene(file.createGroup(SCENE_GROUP), scene)
    except OSError as error:
        raise StorageError(target.path, error) from error
    return outcomes


@contextlib.contextmanager
def _writing(path: Path) -> Iterator[netCDF4.Dataset]:
    """A new NetCDF file. Raises OSError with the reason of the system, which the library does not report."""
    try:
        with netCDF4.Dataset(path, "w", format="NETCDF4") as file:
            yield file
    except (OSError, RuntimeError) as error:
        raise find_fault(path) or OSError(None, f"the NetCDF library cannot write it ({error})") from error


def _keys(completion: CompletionIndex) -> NDArray[np.bytes_]:
    """Hashes of the results of points, in the order of the result file; empty for points that are not computed."""
    keys = np.zeros(completion.plan.n_points, _KEY_TYPE)
    there = completion.store.keys(RESULTS)
    for task in completion.plan.results:
        for place, key in enumerate(task.names):
            if key in there:
                keys[list(task.points(place))] = key.encode()
    return keys


def _slab_shape(shape: Sequence[int], bytes_a_point: int) -> tuple[int, ...]:
    """Points along each axis that are written at once and make a compressed chunk."""
    left = max(1, int(_BYTES_A_SLAB // bytes_a_point))
    lengths = []
    for size in reversed(shape):
        lengths.append(min(size, left))
        # Points that are next to each other in the file: an axis that does not fit ends the slab.
        left = left // size if left >= size else 1
    return tuple(reversed(lengths))


def _slabs(
    shape: Sequence[int], slab: Sequence[int], completion: CompletionIndex, keys: NDArray[np.bytes_]
) -> Iterator[tuple[Region, NDArray[np.void]]]:
    """Regions of the axes, each with the records of its points. Raises StorageError."""
    first, starts = 0, (range(0, size, length) for size, length in zip(shape, slab, strict=True))
    for corner in itertools.product(*starts):
        ends = (min(start + length, size) for start, length, size in zip(corner, slab, shape, strict=True))
        region = tuple(itertools.starmap(slice, zip(corner, ends, strict=True)))
        last = first + math.prod(at.stop - at.start for at in region)
        names = keys[first:last]
        records, there = completion.read_results([name.decode() for name in names.tolist()])
        if not (there | (names == b"")).all():
            raise StorageError(completion.store.path, ValueError("a result is damaged"), "give the command again")
        records["outcome"][~there] = Outcome.NOT_COMPUTED
        yield region, records
        del records
        first = last


def _create_all(
    file: netCDF4.Dataset, study: Study, facts: SceneFacts, slab: Sequence[int], arrays: Sequence[SmallArray]
) -> dict[str, Variable]:
    both = {**study.dimensions, **dimensions_behind(study, facts)}
    sizes = {name: len(values) for name, values in both.items()}
    variables = {**study.recorded, **study.kind.always}
    for name, size in sizes.items():
        file.createDimension(name, size)
    of_pairs = sorted((each for each in arrays if each.name.startswith("contact_")), key=lambda each: each.name)
    auxiliary = of_pairs + [each for each in arrays if each.name.startswith(("sample_", "sector_", "worn_depth"))]
    designed = {"frequency", *(() if study.design is None else study.design.columns)}
    auxiliary += [each for each in arrays if each.name in designed and each.dimensions != (each.name,)]
    for name, entry in variables.items():
        dimensions = (*study.dimensions, *entry.dimensions)
        # a chunk of loops holds a single pair: then pairs without loops take no room
        lengths = (1 if name in LOOPS and each == "contact" else sizes[each] for each in entry.dimensions)
        variable = _create(file, name, entry, dimensions, (*slab, *lengths))
        named = [each.name for each in auxiliary if set(each.dimensions) <= set(dimensions)]
        if named and not entry.is_text:
            variable.setncattr("coordinates", " ".join(named))
    if not any("contact" in entry.dimensions for entry in variables.values()):
        file.setncattr("coordinates", " ".join(each.name for each in of_pairs))
    return variables


def _create(
    file: netCDF4.Dataset, name: str, entry: Variable, dimensions: Sequence[str], chunks: Sequence[int]
) -> "netCDF4.Variable[Any]":
    """A compressed variable with its attributes; texts of any length cannot be compressed."""
    if entry.is_text:
        variable = file.createVariable(name, str, dimensions)
    else:
        fill = math.nan if entry.dtype.startswith("float") else None
        variable = file.createVariable(name, entry.dtype, dimensions, fill_value=fill, chunksizes=chunks, **_PACKED)
        # a chunk is written once and not looked at again, where the library would keep megabytes of each variable
        variable.set_var_chunk_cache(size=_BYTES_OF_CACHE, nelems=1)
    variable.setncatts(attributes(name, entry))
    return variable


def _write_array(file: netCDF4.Dataset, shape: Sequence[int], slab: Sequence[int], array: SmallArray) -> None:
    """Writes a coordinate or another small array; one with the axes of the study in slabs."""
    values = array.values
    for dimension, size in zip(array.dimensions, values.shape, strict=True):
        if dimension not in file.dimensions:
            file.createDimension(dimension, size)
    if array.over_axes:
        lengths = values.shape[len(shape) :]
        variable = _create(file, array.name, array.entry, array.dimensions, (*slab, *lengths))
        variable[...] = np.broadcast_to(values, (*shape, *lengths))
        return
    is_text = values.dtype.kind == "U"
    variable = file.createVariable(array.name, str if is_text else values.dtype, array.dimensions)
    variable.setncatts(attributes(array.name, array.entry))
    variable[:] = values.astype(object) if is_text else values


def _write_scene(root: netCDF4.Group, scene: StoredScene) -> None:
    """Writes the group with the contents of a scene file, under the same names; complex numbers are pairs {r, i}."""
    root.setncattr("comment", "The reduced model that the study was computed with, in the layout of scene files.")
    root.setncatts({name: np.int64(value) for name, value in scene.attributes.items()})
    pair: Any = None
    for key, values in scene.datasets:
        *groups, name = key.split("/")
        group = root.createGroup("/".join(groups)) if groups else root
        dimensions = tuple(f"length_{length}" for length in values.shape)  # a scene file has no names
        for dimension, length in zip(dimensions, values.shape, strict=True):
            if dimension not in root.dimensions:
                root.createDimension(dimension, length)
        kind: Any = values.dtype
        if kind.kind == "U":
            kind, values = str, values.astype(object)
        elif kind.kind == "c":
            pair = pair or root.createCompoundType(_COMPLEX, "complex")
            kind, values = pair, np.ascontiguousarray(values, np.complex128).view(_COMPLEX)
        variable = group.createVariable(name, kind, dimensions, fill_value=False, **({} if kind is str else _PACKED))
        variable[:] = values
