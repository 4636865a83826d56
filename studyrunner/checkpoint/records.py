"""The record of a wear history: one element of an array of numpy with all values of a result."""

from __future__ import annotations

import functools
import json
import math

import numpy as np
from numpy.typing import NDArray

from solver.packing import Packed
from studyrunner.plan.results import MarchResult
from studyrunner.plan.tasks import march_variables
from studyrunner.scene.scene import SceneFacts
from studyrunner.study.study import Study
from studyrunner.variables import ASKED, COUNTS, KEPT, LOOP_COMPONENTS, LOOP_PHASES, LOOPS


def variable_sizes(study: Study, facts: SceneFacts) -> dict[str, int]:
    """Lengths of the dimensions after the axes."""
    return {
        "cycle": len(study.cycles_kept),
        "contact": len(facts.area),
        "response": len(facts.response_names),
        **({"phase": LOOP_PHASES, "component": len(LOOP_COMPONENTS)} if study.outputs.loops else {}),
    }


def record_type(study: Study, facts: SceneFacts) -> np.dtype[np.void]:
    """Data type of the record of a history: all values of a result."""
    sizes = variable_sizes(study, facts)
    fields: list[tuple[str, str, tuple[int, ...]]] = [(name, entry.dtype, ()) for name, entry in KEPT.items()]
    for name in march_variables(study):
        # of all pairs, only those asked for have a loop
        lengths = {**sizes, "contact": len(study.outputs.loops)} if name in LOOPS else sizes
        entry = {**ASKED, **LOOPS, **COUNTS}[name]
        fields.append((name, entry.dtype, tuple(lengths[dimension] for dimension in entry.dimensions)))
    return np.dtype(fields)


def record_of(kind: np.dtype[np.void], result: MarchResult) -> NDArray[np.void]:
    """Record (1,) of a history."""
    records = empty_record(kind)
    for name, values in result.values.items():
        records[name] = values
    return records


def pack_record(record: NDArray[np.void]) -> Packed:
    """Names and values of a record (1,), for a file."""
    names = record.dtype.names or ()
    return Packed(json.dumps(names), tuple(np.array(record[name][0]) for name in names))


def unpack_record(packed: Packed, kind: np.dtype[np.void]) -> NDArray[np.void]:
    """Record (1,) from the output of `pack_record`. Raises ValueError where it has other values than `kind`."""
    names = kind.names or ()
    records = empty_record(kind)
    if packed.text != json.dumps(names) or len(packed.arrays) != len(names):
        raise ValueError("a record with other values")
    for name, array in zip(names, packed.arrays, strict=True):
        if array.shape != kind[name].shape or array.dtype.kind != kind[name].base.kind:
            raise ValueError("a record with other values")
        records[name] = array
    return records


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
