"""The record of a result: one element of an array of numpy with all values of a result."""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from studyrunner.kinds.kind import kind_of
from studyrunner.kinds.task import PointResult
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
    """Data type of the record of a point: all values of a result."""
    sizes = variable_sizes(study, facts)
    fields: list[tuple[str, str, tuple[int, ...]]] = [(name, entry.dtype, ()) for name, entry in study.kept.items()]
    for name in kind_of(study).variables(study):
        # of all pairs, only those asked for have a loop
        lengths = {**sizes, "contact": len(study.outputs.loops)} if name in LOOPS else sizes
        entry = {**study.variables, **LOOPS, **COUNTS}[name]
        fields.append((name, entry.dtype, tuple(lengths[dimension] for dimension in entry.dimensions)))
    return np.dtype(fields)


def record_of(kind: np.dtype[np.void], result: PointResult) -> NDArray[np.void]:
    """Record (1,) of a point. Pairs that its scene does not have are NaN, or 0 in whole numbers."""
    records = empty_record(kind)
    for name, values in result.values.items():
        own = tuple(slice(size) for size in np.shape(values))
        records[name][0:1][(slice(None), *own)] = values
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
