"""The record of a wear history: one element of an array of numpy with all values of a result."""

from __future__ import annotations

import functools
import hashlib
import math

import numpy as np
from numpy.typing import NDArray

from solver.packing import Packed
from studyrunner.checkpoint.contents import join_bytes, sort_bytes
from studyrunner.plan.planning import march_variables
from studyrunner.plan.results import MarchResult
from studyrunner.scene.scene import SceneFacts
from studyrunner.study.study import Study
from studyrunner.variables import COUNTS, LOOP_COMPONENTS, LOOP_PHASES, LOOPS


def variable_sizes(study: Study, facts: SceneFacts) -> dict[str, int]:
    """Lengths of the dimensions after the axes."""
    return {
        **study.sizes,
        "contact": len(facts.area),
        "response": len(facts.response_names),
        **({"phase": LOOP_PHASES, "component": len(LOOP_COMPONENTS)} if study.outputs.loops else {}),
    }


def record_type(study: Study, facts: SceneFacts) -> np.dtype[np.void]:
    """Data type of the record of a history: all values of a result."""
    sizes = variable_sizes(study, facts)
    fields: list[tuple[str, str, tuple[int, ...]]] = [(name, entry.dtype, ()) for name, entry in study.kept.items()]
    for name in march_variables(study):
        # of all pairs, only those asked for have a loop
        lengths = {**sizes, "contact": len(study.outputs.loops)} if name in LOOPS else sizes
        entry = {**study.variables, **LOOPS, **COUNTS}[name]
        fields.append((name, entry.dtype, tuple(lengths[dimension] for dimension in entry.dimensions)))
    # single values come first, see `_arrays_of`
    return np.dtype(sorted(fields, key=lambda each: bool(each[2])))


def record_of(kind: np.dtype[np.void], result: MarchResult) -> NDArray[np.void]:
    """Record (1,) of a history. Pairs that its scene does not have are NaN, or 0 in whole numbers."""
    records = empty_record(kind)
    for name, values in result.values.items():
        own = tuple(slice(size) for size in np.shape(values))
        records[name][0:1][(slice(None), *own)] = values
    return records


def pack_record(record: NDArray[np.void]) -> Packed:
    """A record (1,) for a file: the hash of its data type, and its values, those of each array with sorted bytes."""
    first, arrays = _arrays_of(record.dtype)
    pieces = [record.tobytes()[:first], *(sort_bytes(record[name][0]) for name in arrays)]
    return Packed(layout_of(record.dtype)[0], (np.frombuffer(b"".join(pieces), np.uint8),))


def values_in(packed: Packed | None, kind: np.dtype[np.void]) -> NDArray[np.uint8] | None:
    """Values of a record, for `unpack_records`; None where there are none, or others than those of `kind`."""
    if packed is None or packed.text != layout_of(kind)[0] or len(packed.arrays) != 1:
        return None
    (values,) = packed.arrays
    is_right = values.dtype == np.uint8 and values.shape == (kind.itemsize,)
    return values.astype(np.uint8) if is_right else None


def unpack_records(values: NDArray[np.uint8], kind: np.dtype[np.void]) -> NDArray[np.void]:
    """Records (n,) from their values (n, n_bytes)."""
    first, arrays = _arrays_of(kind)
    records = np.zeros(len(values), kind)
    records.view(np.uint8).reshape(values.shape)[:, :first] = values[:, :first]
    for name in arrays:
        last = first + kind[name].itemsize
        records[name] = join_bytes(values[:, first:last], kind[name].base, kind[name].shape)
        first = last
    return records


@functools.lru_cache(maxsize=4)
def layout_of(kind: np.dtype[np.void]) -> tuple[str, str]:
    """Hash of the data type of a record, and the type in words: names, types and shapes of its values."""
    text = repr(kind.descr)
    return hashlib.sha256(text.encode()).hexdigest()[:16], text


@functools.lru_cache(maxsize=4)
def _arrays_of(kind: np.dtype[np.void]) -> tuple[int, tuple[str, ...]]:
    """Size of the single values of a record, which come first, bytes, and names of the arrays behind these."""
    arrays = tuple(name for name in kind.names or () if kind[name].shape)
    return kind.itemsize - sum(kind[name].itemsize for name in arrays), arrays


def empty_record(kind: np.dtype[np.void]) -> NDArray[np.void]:
    """Record (1,) of a point without result: NaN, or 0 in whole numbers."""
    # from bytes: numpy copies a record field by field, which takes ten times as long
    return np.frombuffer(bytearray(_empty_bytes(kind)), kind)


@functools.lru_cache(maxsize=1)
def _empty_bytes(kind: np.dtype[np.void]) -> bytes:
    records = np.zeros(1, dtype=kind)
    for name in kind.names or ():
        if kind[name].base.kind == "f":
            records[name] = math.nan
    return records.tobytes()
