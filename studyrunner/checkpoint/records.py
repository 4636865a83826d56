"""The record of a wear history: one element of an array of numpy with all values of a result."""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from studyrunner.checkpoint.part_files import KEY, KEY_TYPE
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
    """Data type of the record of a history: the hash, then all values of a result."""
    sizes = variable_sizes(study, facts)
    fields: list[tuple[str, str, tuple[int, ...]]] = [(KEY, KEY_TYPE, ())]
    fields.extend((name, entry.dtype, ()) for name, entry in KEPT.items())
    for name in march_variables(study):
        # of all pairs, only those asked for have a loop
        lengths = {**sizes, "contact": len(study.outputs.loops)} if name in LOOPS else sizes
        entry = {**ASKED, **LOOPS, **COUNTS}[name]
        fields.append((name, entry.dtype, tuple(lengths[dimension] for dimension in entry.dimensions)))
    return np.dtype(fields)


def pack(kind: np.dtype[np.void], key: str, result: MarchResult) -> NDArray[np.void]:
    """Record (1,) of a history with the hash `key`."""
    records = empty_record(kind)
    records[KEY] = key.encode("ascii")
    for name, values in result.values.items():
        records[name] = values
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
