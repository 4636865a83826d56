"""Writes the records of wear histories to one NetCDF file, under a temporary name that is changed at the end.

The file is written in slabs from the file of a run. Only one slab is in memory, whatever the number of points.

By hand: `to_netcdf` of xarray has the whole result in memory, or needs dask.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
from numpy.typing import NDArray

from solver.outcome import Outcome
from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.checkpoint.records import variable_sizes
from studyrunner.coordinates import COORDINATES
from studyrunner.netcdf.attributes import attributes, coordinate_entry, coordinates
from studyrunner.netcdf.provenance import POINTS_LEFT, describe_run
from studyrunner.netcdf.sample_coordinates import InputCoordinate
from studyrunner.netcdf.scene_group import write_scene_group
from studyrunner.scene.scene import KeptScene, SceneFacts
from studyrunner.scene.scene_set import PairArrays, pair_arrays
from studyrunner.scene.variables import SceneVariable
from studyrunner.study.study import Study
from studyrunner.summary.findings import Findings
from studyrunner.summary.table import table_of
from studyrunner.system.files import find_fault, replacing
from studyrunner.user_error import StorageError
from studyrunner.variables import COUNTS, LOOPS, Variable

_BYTES_A_SLAB = 16e6
_BYTES_AT_ONCE = 2e6  # of records that are read: several copies of them are in memory for a moment
_BYTES_OF_CACHE = 2**16
_ON_CONTACT = sorted(name for name, entry in COORDINATES.items() if entry.dimensions == ("contact",))

_KEY_TYPE = "S32"

Region = tuple[int | slice, ...]

Keys = NDArray[np.bytes_]
"""Hashes of the histories of points, in the order of the result file; empty for points that are not computed."""


@dataclass(frozen=True)
class Gathered:
    """Summary of a result.

    outcomes: number of points for each outcome.
    certificates: the table of the largest errors.
    findings: lines on points that failed or are less exact than requested.
    doubts: lines on values that are probably not intended.
    """

    outcomes: Mapping[int, int]
    certificates: str
    findings: tuple[str, ...]
    doubts: tuple[str, ...]


def gather(
    study: Study,
    facts: SceneFacts,
    completion: CompletionIndex,
    path: Path,
    of_scene: Sequence[SceneVariable] = (),
    scene: KeptScene | None = None,
    keep_finished: bool = False,
    origin: Mapping[str, str] | None = None,
    pairs: PairArrays | None = None,
    samples: Sequence[InputCoordinate] = (),
) -> Gathered:
    """Writes the result of a study: axes in the order of the study, then cycle or mission, then others.

    Points that are not computed yet have the outcome `not_computed`.

    Parameters
    ----------
    study, facts
        The study, and facts of its scene.
    completion
        The finished histories.
    path
        The result file, which is replaced as a whole or not at all.
    of_scene
        Variables of the scene, which no task computes.
    scene
        Contents of the group of the scene; None for none.
    keep_finished
        Whether `path` holds a finished result, which is kept where points of the new result are missing.
    origin
        Attributes on place and time of the computation.
    pairs
        Where the pairs are, if not as in `facts`.
    samples
        What the samples have drawn.

    Raises
    ------
    StorageError
        Where the file cannot be written, or the file of the run cannot be read.
    """
    pairs = pair_arrays(study, [facts]) if pairs is None else pairs
    keys, gathered = _read_through(study, facts, completion)
    left = gathered.outcomes[Outcome.NOT_COMPUTED]
    if left and keep_finished:
        return gathered
    try:
        with replacing(path) as temporary, _writing(temporary) as file:
            of_model = {} if scene is None else scene.origin
            file.setncatts({**describe_run(study, facts), **of_model, "certificate_summary": gathered.certificates})
            file.setncattr(POINTS_LEFT, np.int32(left))
            file.setncatts(origin or {})
            if gathered.doubts:
                file.setncattr("plausibility", "\n".join(gathered.doubts))
            _write_values(file, study, facts, completion, keys, pairs, samples)
            _write_scene(file, study, completion.kind.itemsize, of_scene)
            _write_coordinates(file, study, facts, pairs)
            for each in samples:
                _write_whole(file, each.name, each.entry.dimensions, each.values, each.entry)
            if scene is not None:
                write_scene_group(file, scene)
    except OSError as error:
        raise StorageError(path, error) from error
    return gathered


@contextlib.contextmanager
def _writing(path: Path) -> Iterator[netCDF4.Dataset]:
    """A new NetCDF file. Raises OSError with the reason of the system.

    The library itself reports missing permission or an error of HDF, whatever the reason.
    """
    try:
        with netCDF4.Dataset(path, "w", format="NETCDF4") as file:
            yield file
    except (OSError, RuntimeError) as error:
        raise find_fault(path) or OSError(None, f"the NetCDF library cannot write it ({error})") from error


def _read_through(study: Study, facts: SceneFacts, completion: CompletionIndex) -> tuple[Keys, Gathered]:
    """Reads every record once, some at a time: hashes and outcomes of all points, and the table."""
    shape = tuple(len(values) for values in study.dimensions.values())
    keys = np.zeros(math.prod(shape), _KEY_TYPE)
    histories = [
        (key, scaled.points)
        for march in itertools.chain.from_iterable(completion.plan.marches)
        for key, scaled in zip(completion.histories(march), march.histories, strict=True)
    ]
    table = table_of(study, facts)
    findings = Findings(study, facts)
    outcomes: Counter[int] = Counter()
    at_once = _records_at_once(completion.kind.itemsize)
    for first in range(0, len(histories), at_once):
        some = histories[first : first + at_once]
        records, there = completion.read_histories([key for key, _ in some])
        records, found = records[there], list(itertools.compress(some, there.tolist()))
        for outcome, (key, points) in zip(records["outcome"].tolist(), found, strict=True):
            outcomes[outcome] += len(points)
            keys[np.ravel_multi_index(np.transpose(points), shape)] = key.encode()
        for collected in (table, findings):
            collected.add([points for _, points in found], records)
    outcomes[Outcome.NOT_COMPUTED] += int(np.count_nonzero(keys == b""))
    return keys, Gathered(outcomes, table.format(), tuple(findings.format(outcomes)), table.doubts())


def _records_at_once(bytes_a_record: int) -> int:
    return max(1, int(_BYTES_AT_ONCE // bytes_a_record))


def _write_values(
    file: netCDF4.Dataset,
    study: Study,
    facts: SceneFacts,
    completion: CompletionIndex,
    keys: Keys,
    pairs: PairArrays,
    samples: Sequence[InputCoordinate],
) -> None:
    on_contact = [name for name in _ON_CONTACT if pairs.exists is not None or name != "contact_exists"]
    shape = tuple(len(values) for values in study.dimensions.values())
    sizes = variable_sizes(study, facts)
    asked = {name: entry for name, entry in study.variables.items() if name in study.outputs.variables}
    variables = {**asked, **(LOOPS if study.outputs.loops else {}), **study.kept}
    variables |= COUNTS if study.to_the_end else {}
    for name, size in itertools.chain(zip(study.dimensions, shape, strict=True), sizes.items()):
        file.createDimension(name, size)
    slab = _slab_shape(shape, completion.kind.itemsize)
    for name, entry in variables.items():
        dimensions = (*study.dimensions, *entry.dimensions)
        if entry.is_text:
            # of any length, which cannot be compressed
            file.createVariable(name, str, dimensions).setncatts(attributes(name, entry))
            continue
        own = (1 if _one_pair(name, dimension) else sizes[dimension] for dimension in entry.dimensions)
        variable = _create(file, name, entry, dimensions, (*slab, *own))
        variable.setncatts(attributes(name, entry, study.has_modes))
        if "contact" in entry.dimensions or samples:
            drawn = [each.name for each in samples if set(each.entry.dimensions) <= set(dimensions)]
            variable.setncattr("coordinates", " ".join(on_contact * ("contact" in entry.dimensions) + drawn))
    if not any("contact" in entry.dimensions for entry in variables.values()):
        file.setncattr("coordinates", " ".join(on_contact))
    for region, first, last in _slabs(shape, slab):
        _write_slab(file, region, variables, study.outputs.loops, _read_slab(completion, keys[first:last]))


def _write_slab(
    file: netCDF4.Dataset,
    region: Region,
    variables: Mapping[str, Variable],
    loops: Sequence[int],
    records: NDArray[np.void],
) -> None:
    """Writes the records of all points of a region."""
    lengths = [at.stop - at.start for at in region if isinstance(at, slice)]
    for name, entry in variables.items():
        values = records[name].reshape(*lengths, *records[name].shape[1:])
        if entry.is_text:
            values = values.astype(object)
        if name not in LOOPS:
            file[name][(*region, *(slice(None) for _ in entry.dimensions))] = values
            continue
        for place, pair in enumerate(loops):
            file[name][(*region, slice(None), pair)] = values[..., place, :, :]


def _create(
    file: netCDF4.Dataset, name: str, entry: Variable, dimensions: Sequence[str], chunks: Sequence[int]
) -> netCDF4.Variable[Any]:
    """A compressed variable with its attributes."""
    fill = math.nan if entry.dtype.startswith("float") else None
    options: Any = {"compression": "zlib", "complevel": 1, "shuffle": True, "chunksizes": chunks, "fill_value": fill}
    variable = file.createVariable(name, entry.dtype, dimensions, **options)
    # a chunk is written once and not looked at again, where the library would keep megabytes of each variable
    variable.set_var_chunk_cache(size=_BYTES_OF_CACHE, nelems=1)
    variable.setncatts(attributes(name, entry))
    return variable


def _one_pair(name: str, dimension: str) -> bool:
    """Whether a chunk holds a single pair: then pairs without loops take no room."""
    return name in LOOPS and dimension == "contact"


def _slab_shape(shape: Sequence[int], bytes_a_point: int) -> tuple[int, ...]:
    """Points along each axis that are written at once and make a compressed chunk."""
    left = max(1, int(_BYTES_A_SLAB // bytes_a_point))
    lengths = []
    for size in reversed(shape):
        lengths.append(min(size, left))
        # Points that are next to each other in the file: an axis that does not fit ends the slab.
        left = left // size if left >= size else 1
    return tuple(reversed(lengths))


def _slabs(shape: Sequence[int], slab: Sequence[int]) -> Iterator[tuple[Region, int, int]]:
    """Regions of the axes; the first point of each and the point after the last, in the order of the file."""
    first = 0
    starts = (range(0, size, length) for size, length in zip(shape, slab, strict=True))
    for corner in itertools.product(*starts):
        region = tuple(
            slice(start, min(start + length, size)) for start, length, size in zip(corner, slab, shape, strict=True)
        )
        last = first + math.prod(at.stop - at.start for at in region)
        yield region, first, last
        first = last


def _read_slab(completion: CompletionIndex, keys: Keys) -> NDArray[np.void]:
    """Records of consecutive points of the file, by their hashes. Raises StorageError where one has gone meanwhile."""
    different, places = np.unique(keys, return_inverse=True)
    records, there = completion.read_histories([key.decode() for key in different.tolist()])
    if not (there | (different == b"")).all():
        raise StorageError(completion.store.path, ValueError("a result is damaged"), "give the command again")
    records["outcome"][~there] = Outcome.NOT_COMPUTED
    return records[places]


def _write_scene(file: netCDF4.Dataset, study: Study, bytes_a_point: int, of_scene: Sequence[SceneVariable]) -> None:
    shape = tuple(len(values) for values in study.dimensions.values())
    slab = _slab_shape(shape, bytes_a_point)
    for scene in of_scene:
        dimensions = (scene.name,) if scene.coordinate else scene.entry.dimensions
        for dimension, size in zip(dimensions, scene.values.shape[-len(dimensions) :], strict=True):
            if dimension not in file.dimensions:
                file.createDimension(dimension, size)
        if not scene.axes:
            _write_whole(file, scene.name, dimensions, scene.values, scene.entry)
            continue
        own = scene.values.shape[len(shape) :]
        variable = _create(file, scene.name, scene.entry, (*study.dimensions, *dimensions), (*slab, *own))
        values = np.broadcast_to(scene.values, (*shape, *own))
        for region, _, _ in _slabs(shape, slab):
            variable[region] = values[region]


def _write_coordinates(file: netCDF4.Dataset, study: Study, facts: SceneFacts, pairs: PairArrays) -> None:
    for name, (dimensions, values) in coordinates(study, facts, pairs).items():
        _write_whole(file, name, dimensions, values, coordinate_entry(study, name))


def _write_whole(
    file: netCDF4.Dataset, name: str, dimensions: tuple[str, ...], values: NDArray[np.generic], entry: Variable
) -> None:
    """Writes a coordinate or another small array."""
    texts = values.dtype.kind == "U"
    kind: Any = str if texts else values.dtype
    variable = file.createVariable(name, kind, dimensions)
    variable.setncatts(attributes(name, entry))
    variable[:] = values.astype(object) if texts else values
