"""The models of scenes on their way to the ranks: while they are in use, once in memory on each machine.

A task brings the model to a rank that does not have it: as a file that the ranks map (`mapped_file`), or the model
itself where the rank does not see that file.
"""

from __future__ import annotations

import contextlib
from collections import OrderedDict
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from studyrunner.kinds.task import Task
from studyrunner.mpi.mapped_file import MappedFile, write_mapped
from studyrunner.system.files import new_partial

if TYPE_CHECKING:
    from solver.model import ReducedModel

MODELS_A_RANK = 2
"""Models, or sets of models of the blocks of a mission, that a rank holds where a study has several scenes."""

Models = TypeVar("Models")


class ModelCache(OrderedDict[tuple[int, ...], Models]):
    """The models that a rank has computed with last, by the numbers of the scenes that a task needs.

    Rank 0 keeps such a list for each rank, without models, and so knows which models the rank has.
    """

    def use(self, scenes: tuple[int, ...]) -> bool:
        """Whether the models are there; they are then the last to be removed."""
        if scenes in self:
            self.move_to_end(scenes)
        return scenes in self

    def add(self, scenes: tuple[int, ...], models: Models) -> None:
        """Adds models; removes those that were not used for longest where there are too many."""
        self[scenes] = models
        if len(self) > MODELS_A_RANK:
            self.popitem(last=False)


class SceneModels:
    """Rank 0: which rank has which models, and the files of models in use.

    A rank holds the models of two tasks at most (`ModelCache`) and two tasks at most (`Dispatcher`). So a rank that
    loses models here, by two later tasks with other models, has done the task that brought these.
    """

    def __init__(self, read: Callable[[int], ReducedModel], seeing: Collection[int], beside: Path) -> None:
        """read: the model of a scene. seeing: ranks that see the files. beside: the file that they stand beside."""
        self._read = read
        self._seeing = seeing
        self._beside = beside
        self._of_ranks: dict[int, ModelCache[None]] = {}
        self._files: dict[int, MappedFile] = {}

    def with_model(self, rank: int, task: Task) -> Task:
        """The task as a rank gets it: with the models that the rank does not have."""
        own = self._of_ranks.setdefault(rank, ModelCache())
        if own.use(task.scenes):
            return task
        own.add(task.scenes, None)
        used = {number for each in self._of_ranks.values() for scenes in each for number in scenes}
        for number in self._files.keys() - used:
            self._files.pop(number).remove()
        return replace(task, models=tuple(self._hand(rank, number) for number in task.scenes))

    def _hand(self, rank: int, number: int) -> ReducedModel | MappedFile:
        """The model of a scene as a rank gets it."""
        if rank not in self._seeing:
            return self._read(number)
        if number not in self._files:
            # a full disk costs memory: each rank gets the model itself
            with contextlib.suppress(OSError):
                self._files[number] = write_mapped(self._read(number), new_partial(self._beside))
        return self._files[number] if number in self._files else self._read(number)
