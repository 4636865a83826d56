"""Results on their way into the result file: small files in a folder beside it, written while the run goes on.

A file holds the records of the histories that came in the last moment, as a plain array of numpy (no pickle), one
element a history. It is written under a temporary name, flushed to the disk and renamed: it is whole or not there. Rank
0 writes all of them, as no other rank need see the folder.
"""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studyrunner.results import MarchResult
from studyrunner.scene import SceneFacts
from studyrunner.study import Study
from studyrunner.tasks import MarchTask, march_variables
from studyrunner.variables import ASKED, KEPT, LOOP_COMPONENTS, LOOP_PHASES, LOOPS

SECONDS_A_FILE = 0.25
"""Results wait at most so long for others that go into the same file: 10 000 short tasks do not make as many files."""

_BYTES_A_FILE = 8e6
_MARCH, _SHARE = "march", "share"


def variable_sizes(study: Study, facts: SceneFacts) -> dict[str, int]:
    """Lengths of the dimensions after the axes."""
    return {
        "cycle": len(study.cycles_kept),
        "contact": len(facts.area),
        "response": len(facts.response_names),
        **({"phase": LOOP_PHASES, "component": len(LOOP_COMPONENTS)} if study.outputs.loops else {}),
    }


def record_type(study: Study, facts: SceneFacts) -> np.dtype[np.void]:
    """Type of the record of a history: number of its march, its share of that, then all that its result says."""
    sizes = variable_sizes(study, facts)
    fields: list[tuple[str, str, tuple[int, ...]]] = [(_MARCH, "int64", ()), (_SHARE, "int64", ())]
    fields.extend((name, entry.dtype, ()) for name, entry in KEPT.items())
    for name in march_variables(study):
        # of all pairs, only those asked for have a loop
        lengths = {**sizes, "contact": len(study.outputs.loops)} if name in LOOPS else sizes
        entry = LOOPS.get(name) or ASKED[name]
        fields.append((name, entry.dtype, tuple(lengths[dimension] for dimension in entry.dimensions)))
    return np.dtype(fields)


def pack(kind: np.dtype[np.void], results: Iterable[tuple[MarchTask, MarchResult]]) -> NDArray[np.void]:
    """Records of marches and their results, (n_results,)."""
    pairs = list(results)
    records = np.zeros(len(pairs), dtype=kind)
    for record, (task, result) in zip(records, pairs, strict=True):
        record[_MARCH], record[_SHARE] = task.number, result.share
        for name in KEPT:
            record[name] = getattr(result, name)
        for name in task.variables:
            record[name] = result.values[name]
    return records


def histories_of(records: NDArray[np.void]) -> list[tuple[int, int]]:
    """Which histories the records are of: number of the march, place among its shares."""
    return list(zip(records[_MARCH].tolist(), records[_SHARE].tolist(), strict=True))


class Parts:
    """The folder of a run. It is made here, emptied of what an earlier run left."""

    def __init__(self, folder: Path, kind: np.dtype[np.void]) -> None:
        self.folder = folder
        self.kind = kind
        self.files: list[Path] = []
        self._pending: list[tuple[MarchTask, MarchResult]] = []
        self._written = -math.inf
        folder.mkdir(exist_ok=True)
        self._empty()

    def add(self, task: MarchTask, result: MarchResult) -> None:
        """A result to be written."""
        self._pending.append((task, result))
        if len(self._pending) * self.kind.itemsize > _BYTES_A_FILE:
            self.flush()

    def tick(self) -> None:
        """Called many times a second: writes what waits, at once where nothing was written a moment ago."""
        if self._pending and time.monotonic() > self._written + SECONDS_A_FILE:
            self.flush()

    def flush(self) -> None:
        """Writes what waits. Raises OSError."""
        if not self._pending:
            return
        path = self.folder / f"{len(self.files):08d}.npy"
        partial = path.with_suffix(".partial")
        with partial.open("wb") as file:
            np.save(file, pack(self.kind, self._pending), allow_pickle=False)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, path)
        self.files.append(path)
        self._pending = []
        self._written = time.monotonic()

    def read(self, number: int) -> NDArray[np.void]:
        """Records of a file; they stay on the disk until they are used."""
        records: NDArray[np.void] = np.load(self.files[number], mmap_mode="r", allow_pickle=False)
        return records

    def remove(self) -> None:
        """Removes the folder, unless something else is in it."""
        self._empty()
        with contextlib.suppress(OSError):
            self.folder.rmdir()

    def _empty(self) -> None:
        for pattern in ("[0-9]*.npy", "[0-9]*.partial"):
            for path in self.folder.glob(pattern):
                path.unlink(missing_ok=True)
