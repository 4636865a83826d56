"""Finished tasks of a plan, and results of earlier runs: the link between tasks and the file of a run."""

import itertools
import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from solver.outcome import COMPLETE, Outcome
from solver.packing import Packed
from studyrunner.checkpoint.store import PROGRESS, RESULTS, Store
from studyrunner.kinds.task import Identity, PointResult, Result, StartResult, Task, TaskPlan, digest
from studyrunner.scene.scene import SceneFacts, record_fields
from studyrunner.study.study import Study

MOST_CRASHES = 3
"""A task is given up after so many runs in a row that were killed or crashed before the task had given anything. Such
tasks are tried one after the other, so that another task is seldom to blame."""


class CompletionIndex:
    """Results and start states of a plan, in a file that may contain those of earlier runs and of other studies.

    facts: of all scenes, see `merge_facts`. scenes: hash of the model of each. plan: its tasks have names.
    kind: data type of the record of a point, an element of an array of numpy with all values of its result.
    """

    def __init__(self, study: Study, plan: TaskPlan, facts: SceneFacts, scenes: Sequence[str], store: Store) -> None:
        self.store = store
        self.kind = np.dtype(record_fields(study, facts))
        empty = np.zeros(1, dtype=self.kind)
        for name in self.kind.names or ():
            if self.kind[name].base.kind == "f":
                empty[name] = math.nan
        # numpy copies a record field by field, and bytes at once
        self._empty = empty.tobytes()
        self.plan = plan.named(Identity(tuple(scenes), digest(repr(self.kind.descr))), store.keys(RESULTS))

    def _missing(self, task: Task) -> list[int]:
        """Places of a task whose result is not there."""
        there = self.store.keys(RESULTS)
        return [place for place, name in enumerate(task.names) if name not in there]

    def is_finished(self, task: Task) -> bool:
        """Whether all results of a task are there."""
        return not self._missing(task)

    def read_results(self, names: Sequence[str]) -> tuple[NDArray[np.void], NDArray[np.bool_]]:
        """Records (n,) of the results with these hashes, whether each exists; else NaN, or 0. Raises StorageError."""
        contents = np.frombuffer(bytearray(self._empty) * len(names), np.uint8).reshape(len(names), -1)
        there, first = np.zeros(len(names), np.bool_), dict[str, int]()
        for place, name in enumerate(names):
            before = first.setdefault(name, place)
            # the data type of a record is part of its name
            if before < place:
                contents[place], there[place] = contents[before], there[before]
            elif (found := self.store.read(RESULTS, name, self._bytes)) is not None:
                contents[place], there[place] = found, True
        return contents.reshape(-1).view(self.kind), there

    def _bytes(self, packed: Packed) -> NDArray[np.generic]:
        """Bytes of a record. Raises ValueError or TypeError where it is none: no such length, outcome or text."""
        (found,) = packed.arrays
        (record,) = found.view(self.kind)
        Outcome(record["outcome"]), str(record["message"])
        if found.dtype != np.uint8:
            raise TypeError(found.dtype)
        return found

    def forget_damaged(self) -> None:
        """Forgets results and start states that were damaged or altered since they were added."""
        for sweep in self.plan.sweeps:
            for place, name in enumerate(sweep.names):
                self._read_start(place, name)
        for name in itertools.chain.from_iterable(task.names for task in self.plan.results):
            self.store.read(RESULTS, name, self._bytes)

    def _read_start(self, place: int, name: str) -> StartResult | None:
        start: StartResult | None = self.store.read(RESULTS, name, partial(StartResult.unpack, place))
        return start

    @property
    def n_points_finished(self) -> int:
        """Number of points whose result is there."""
        left = sum(len(task.points(place)) for task in self.plan.results for place in self._missing(task))
        return self.plan.n_points - left

    def _left(self, task: Task, needed: Collection[int]) -> Iterator[Task]:
        """What is left of a task, with its progress; none where nothing is. needed: places."""
        left = {place for place in self._missing(task) if place in needed}
        if left:
            yield replace(task, skipped=frozenset(task.order) - left, resume=self.store.read(PROGRESS, task.key))

    def sweeps_left(self) -> list[Task]:
        """Sweeps with start states that are needed and not known."""
        return [left for sweep in self.plan.sweeps for left in self._left(sweep, self._needed(sweep))]

    def waiting_for(self, start: tuple[int, int] | None) -> list[Task]:
        """Unfinished tasks that begin from a start state; None: from none. start: number of the sweep and place."""
        return [left for task in self.plan.waiting.get(start, ()) for left in self._left(task, task.order)]

    def known_starts(self) -> Iterator[tuple[Task, StartResult]]:
        """Known start states that are needed, with their sweeps."""
        for sweep in self.plan.sweeps:
            for place in self._needed(sweep):
                if (start := self._read_start(place, sweep.names[place])) is not None:
                    yield sweep, start

    def _needed(self, sweep: Task) -> list[int]:
        """Places of a sweep from which a task is still to begin."""
        waiting = self.plan.waiting
        return [
            place
            for place in range(len(sweep.names))
            if not all(map(self.is_finished, waiting.get((sweep.number, place), ())))
        ]

    def add(self, task: Task, result: Result) -> None:
        """Adds a result. What progress there was is forgotten with the last one, but for a history without time."""
        packed = result.pack() if isinstance(result, StartResult) else Packed("", (self._record(result),))
        self.store.put(RESULTS, task.names[result.place], packed)
        if isinstance(result, PointResult) and result.progress is not None:
            self.keep(task, result.progress)
        elif self.is_finished(task):
            self.store.forget(PROGRESS, task.key)
        self.store.note_life(task.key)

    def _record(self, result: PointResult) -> NDArray[np.uint8]:
        """Bytes of the record of a point. Pairs that its scene does not have are NaN, or 0 in whole numbers."""
        records = np.frombuffer(bytearray(self._empty), self.kind)
        for name, values in result.values.items():
            own = tuple(slice(size) for size in np.shape(values))
            records[name][0:1][(slice(None), *own)] = values
        return records.view(np.uint8)

    def keep(self, task: Task, progress: Packed) -> None:
        """Adds the progress of a task."""
        self.store.put(PROGRESS, task.key, progress)
        self.store.note_life(task.key)

    def forget_failed(self) -> None:
        """Forgets points that were not computed to the end, and start states without a state."""
        without_state: set[tuple[int, int] | None] = set()
        for sweep in self.plan.sweeps:
            for place, name in enumerate(sweep.names):
                start = self._read_start(place, name)
                if start is not None and start.n_unknowns == 0:
                    without_state.add((sweep.number, place))
                    self.store.forget(RESULTS, name)
                    self.store.forget(PROGRESS, sweep.key)
        for task in self.plan.results:
            for name, record, is_there in zip(task.names, *self.read_results(task.names), strict=True):
                if is_there and (record["outcome"] not in COMPLETE or task.waits_for in without_state):
                    self.store.forget(RESULTS, name)

    def forget_all(self) -> None:
        """Forgets all points of this study. Results of other studies stay."""
        for task in (*self.plan.sweeps, *self.plan.results):
            for name in task.names:
                self.store.forget(RESULTS, name)
            self.store.forget(PROGRESS, task.key)
            self.store.note_life(task.key)

    def give_up_crashed(self) -> None:
        """Marks tasks as failed with which too many runs have ended, of a sweep those that wait for it: no other run
        tries them.
        """
        message = f"{MOST_CRASHES} runs in a row have crashed or were killed while they were at it"
        given_up = {key for key, number in self.store.crashes.items() if number >= MOST_CRASHES}
        if not given_up:
            return
        swept = [sweep for sweep in self.plan.sweeps if sweep.key in given_up]
        lost = {(sweep.number, place) for sweep in swept for place in self._missing(sweep)}
        for task in self.plan.results:
            if task.key in given_up or task.waits_for in lost:
                for place in self._missing(task):
                    self.add(task, task.failed(place, Outcome.CRASHED, message))
        for sweep in swept:
            self.store.note_life(sweep.key)
