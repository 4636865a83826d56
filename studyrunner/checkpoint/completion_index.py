"""Finished tasks of a plan, and results of earlier runs: the link between tasks and the file of a run."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from solver.outcome import Outcome
from solver.packing import Packed
from studyrunner.checkpoint.records import empty_record, pack_record, record_in, record_of
from studyrunner.checkpoint.store import PROGRESS, RESULTS, STARTS, Store
from studyrunner.plan.identity import Identities
from studyrunner.plan.results import MarchResult, StartResult, failed_result, unpack_start
from studyrunner.plan.tasks import BranchTask, MarchTask, TaskPlan

MOST_OF_OTHERS = 2.0**30
"""Largest size, bytes, of results of other studies that are kept under the same name."""

MOST_CRASHES = 3
"""A task is given up after so many runs in a row that were killed or crashed before the task had given anything. Such
tasks are tried one after the other, so that another task is seldom to blame."""


class CompletionIndex:
    """Finished wear histories and start states of a plan, in a file that may contain results of earlier runs.

    The results of a task do not depend on earlier results: a continued run ends with the same numbers.
    kind: data type of a record, as `record_type` gives it.
    """

    def __init__(self, plan: TaskPlan, identities: Identities, store: Store, kind: np.dtype[np.void]) -> None:
        self.plan = plan
        self.store = store
        self.kind = kind
        self._starts = [identities.of_starts(branch) for branch in plan.branches]
        self._branches = [identities.of_branch(branch) for branch in plan.branches]
        self._histories: dict[int, tuple[str, ...]] = {}
        self._marches: dict[int, str] = {}
        for branch, line in zip(plan.branches, plan.marches, strict=True):
            for march in line:
                self._histories[march.number] = identities.of_histories(branch, march)
                self._marches[march.number] = identities.of_march(self._histories[march.number])

    def histories(self, march: MarchTask) -> tuple[str, ...]:
        """Hashes of the histories of a task."""
        return self._histories[march.number]

    @property
    def keys(self) -> frozenset[str]:
        """Hashes of all tasks."""
        return frozenset((*self._branches, *self._marches.values()))

    def is_left(self, key: str) -> bool:
        """Whether a task of this plan has this hash and is not finished."""
        return any(
            not self.is_finished(march)
            for branch, line in zip(self.plan.branches, self.plan.marches, strict=True)
            for march in line
            if key in (self.key(branch), self.key(march))
        )

    def is_finished(self, march: MarchTask) -> bool:
        """Whether all histories of a task are there."""
        known = self.store.keys(RESULTS)
        return all(key in known for key in self._histories[march.number])

    def read_histories(self, keys: Sequence[str]) -> tuple[NDArray[np.void], NDArray[np.bool_]]:
        """Records (n,) of the histories with these hashes, and whether each exists; else the record is empty.

        Raises StorageError where the disk fails.
        """
        found = [record_in(self.store.read(RESULTS, key), self.kind) for key in keys]
        empty = empty_record(self.kind).tobytes()
        records = np.frombuffer(bytearray(b"".join(empty if each is None else each for each in found)), self.kind)
        return records, np.array([each is not None for each in found], np.bool_)

    @property
    def n_points_finished(self) -> int:
        """Number of points whose history is there."""
        return sum(len(march.points) for line in self.plan.marches for march in line if self.is_finished(march))

    def key(self, task: BranchTask | MarchTask) -> str:
        """Hash of a task and of its progress."""
        return self._branches[task.number] if isinstance(task, BranchTask) else self._marches[task.number]

    def branches_left(self) -> list[BranchTask]:
        """Branches with start states that are needed and not known."""
        left = []
        for branch, keys in zip(self.plan.branches, self._starts, strict=True):
            needed = self._needed(branch)
            known = frozenset(
                place for place, key in enumerate(keys) if place not in needed or self.store.has(STARTS, key)
            )
            if len(known) < len(keys):
                key = self.key(branch)
                left.append(replace(branch, known=known, resume=self.store.read(PROGRESS, key), key=key))
        return left

    def known_starts(self, branch: BranchTask) -> list[StartResult]:
        """Known start states of a branch from which a history is still to be computed."""
        keys, needed = self._starts[branch.number], self._needed(branch)
        found = ((place, self.store.read(STARTS, key)) for place, key in enumerate(keys) if place in needed)
        return [unpack_start(place, start) for place, start in found if start is not None]

    def marches_from(self, branch: int, position: int) -> tuple[MarchTask, ...]:
        """Unfinished tasks of wear histories from one start state, each with its progress."""
        keys = {march.number: self.key(march) for march in self.plan.marches_from(branch, position)}
        return tuple(
            replace(march, resume=self.store.read(PROGRESS, keys[march.number]), key=keys[march.number])
            for march in self.plan.marches_from(branch, position)
            if not self.is_finished(march)
        )

    def marches_without_start(self) -> tuple[MarchTask, ...]:
        """Unfinished tasks that begin from no start state, each with its progress: mission histories."""
        return tuple(
            march
            for branch, line in zip(self.plan.branches, self.plan.marches, strict=True)
            for place in ({task.position for task in line} if not branch.frequencies else ())
            for march in self.marches_from(branch.number, place)
        )

    def renew(self, task: BranchTask | MarchTask) -> BranchTask | MarchTask:
        """A task that has to be done again, with the results that it has given so far."""
        resume = self.store.read(PROGRESS, self.key(task))
        if isinstance(task, MarchTask):
            return replace(task, resume=resume)
        given = {place for place, key in enumerate(self._starts[task.number]) if self.store.has(STARTS, key)}
        return replace(task, resume=resume, known=task.known | given)

    def add_start(self, branch: BranchTask, result: StartResult) -> None:
        """Adds a start state."""
        self.store.put(STARTS, self._starts[branch.number][result.position], result.pack())
        self.store.note_life(self.key(branch))

    def add_history(self, march: MarchTask, result: MarchResult) -> None:
        """Adds a history."""
        key, record = self._histories[march.number][result.place], record_of(self.kind, result)
        self.store.put(RESULTS, key, pack_record(record))
        self.store.note_life(self.key(march))
        if result.progress is not None:
            self.keep(march, result.progress)
        elif result.place == march.n_results - 1:
            self.store.forget(PROGRESS, self.key(march))

    def keep(self, task: BranchTask | MarchTask, progress: object) -> None:
        """Adds the progress of a task."""
        if not isinstance(progress, Packed):
            raise TypeError(f"{progress!r} is no progress of {task}")
        self.store.put_if_small(PROGRESS, self.key(task), progress)
        self.store.note_life(self.key(task))

    def forget_failed(self, complete: Collection[int]) -> None:
        """Forgets failed points. complete: outcomes of points that did not fail."""
        for branch, line, keys in zip(self.plan.branches, self.plan.marches, self._starts, strict=True):
            starts = ((place, self.store.read(STARTS, key)) for place, key in enumerate(keys))
            without_state = {place for place, start in starts if start and unpack_start(place, start).failed}
            for place in without_state:
                self.store.forget(STARTS, keys[place])
            if without_state:
                self.store.forget(PROGRESS, self.key(branch))
            for march in line:
                keys_of_march = self._histories[march.number]
                records, there = self.read_histories(keys_of_march)
                for key, record, is_there in zip(keys_of_march, records, there, strict=True):
                    if is_there and (record["outcome"] not in complete or march.position in without_state):
                        self.store.forget(RESULTS, key)

    def is_suspect(self, key: str) -> bool:
        """Whether a run has crashed or was killed while this task was under way and had given nothing."""
        return key in self.store.crashes

    def give_up_crashed(self) -> None:
        """Marks tasks as failed with which too many runs have ended."""
        for key in [key for key, number in self.store.crashes.items() if number >= MOST_CRASHES]:
            message = f"{MOST_CRASHES} runs in a row have crashed or were killed while they were at it"
            if self.take_as_failed(key, Outcome.CRASHED, message):
                self.store.note_life(key)

    def take_as_failed(self, key: str, outcome: int, message: str) -> int:
        """Marks a task as failed that has ended too many runs: no other run tries this task.

        A branch ends before the first of its start states that is not there.

        Parameters
        ----------
        key
            Hash of the task.
        outcome, message
            Outcome and message of the lost points.

        Returns
        -------
        int
            Number of the lost points.
        """
        n_points = 0
        for branch, line, starts in zip(self.plan.branches, self.plan.marches, self._starts, strict=True):
            lost: set[int] = set()
            if self.key(branch) == key:
                lost = {place for place in branch.order if not self.store.has(STARTS, starts[place])}
            for march in line:
                if self.key(march) != key and march.position not in lost:
                    continue
                for place, history in enumerate(self._histories[march.number]):
                    if not self.store.has(RESULTS, history):
                        n_points += len(march.histories[place].points)
                        self.add_history(march, failed_result(march, place, outcome, message))
        self.store.flush()
        return n_points

    def forget_all(self) -> None:
        """Forgets all points of this study. Results of other studies stay."""
        for key in self._all_histories():
            self.store.forget(RESULTS, key)
        for key in itertools.chain.from_iterable(self._starts):
            self.store.forget(STARTS, key)
        for key in self.keys:
            self.store.forget(PROGRESS, key)
            self.store.note_life(key)
        self.store.flush()

    def prune(self, most: float = MOST_OF_OTHERS) -> None:
        """Removes what a finished study does not need, and results of others until they take at most so many bytes.

        With 0 bytes only results of this study stay.
        """
        for branch, keys in zip(self.plan.branches, self._starts, strict=True):
            # nothing is left to be followed; that of a march which was given up for its time is what it goes on from
            if all(self.store.has(STARTS, key) for key in keys):
                self.store.forget(PROGRESS, self.key(branch))
        starts = set(itertools.chain.from_iterable(self._starts))
        self.store.prune({RESULTS: self._all_histories(), STARTS: starts, PROGRESS: self.keys}, most)

    def _all_histories(self) -> set[str]:
        return set(itertools.chain.from_iterable(self._histories.values()))

    def _needed(self, branch: BranchTask) -> frozenset[int]:
        """Indices of the frequencies of a branch from which a history is still to be computed."""
        line = self.plan.marches[branch.number]
        return frozenset(march.position for march in line if not self.is_finished(march))
