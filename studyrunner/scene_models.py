"""The models of several scenes on their way to the ranks: once to the machine of rank 0, and only while in use there.

Rank 0 keeps the models in the file of the run, and a task brings the model to a rank that does not have it. The ranks
that share the memory of rank 0 (`Broadcast.sharing`) get the address of one copy; any other rank gets the model itself.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import TYPE_CHECKING

from studyrunner.evaluate import ModelCache
from studyrunner.mpi.broadcast import share
from studyrunner.mpi.shared_memory import Address, SharedObject
from studyrunner.plan.tasks import BranchTask, MarchTask

if TYPE_CHECKING:
    from solver.model import ReducedModel


class SceneModels:
    """Rank 0: which rank has which models, and the models in shared memory.

    A rank holds the models of two tasks at most (`ModelCache`) and two tasks at most (`Dispatcher`). So a rank that
    loses models here, by two later tasks with other models, has done the task that brought these.
    """

    def __init__(self, read: Callable[[int], ReducedModel], sharing: Collection[int]) -> None:
        """read: the model of a scene. sharing: ranks that share the memory of rank 0."""
        self._read = read
        self._sharing = sharing
        self._held: dict[int, ModelCache[None]] = {}
        self._shared: dict[int, SharedObject[ReducedModel]] = {}

    def with_model(self, rank: int, task: BranchTask | MarchTask) -> BranchTask | MarchTask:
        """The task as a rank gets it: with the models that the rank does not have."""
        held = self._held.setdefault(rank, ModelCache())
        if held.use(task.scenes):
            return task
        held.add(task.scenes, None)
        self._close_unused()
        return replace(task, models=tuple(self._hand(rank, number) for number in task.scenes))

    def _hand(self, rank: int, number: int) -> ReducedModel | Address:
        """The model of a scene as a rank gets it."""
        if rank not in self._sharing:
            return self._read(number)
        if number not in self._shared:
            model = self._read(number)
            shared = share(model)
            if shared is None:
                return model
            self._shared[number] = shared
        return self._shared[number].address

    def _close_unused(self) -> None:
        held_here = (held for rank, held in self._held.items() if rank in self._sharing)
        used = {number for held in held_here for scenes in held for number in scenes}
        for number in self._shared.keys() - used:
            self._shared.pop(number).close()
