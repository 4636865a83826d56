"""Runs of the command with a stand-in for the solver, which may do something else at one of its results."""

from collections.abc import Callable, Iterator, Mapping

import pytest

from studyrunner import task_runs
from studyrunner.kinds.task import Keep, PointResult, Result, Task
from studyrunner.scene.scene import describe_scene
from tests.mpi.launching import options
from tests.studyrunner.fakes import fake_evaluate

AXES = ("axes.frequency=[100, 110]", "axes.wear_coefficient=[5e-12, 1e-11]", "axes.scheme=implicit")
SMALL = ["sdof_slider", *options(*AXES), "-o", "out.nc"]
"""A study of two start states and four histories."""


class Solver:
    """A stand-in that counts what it does.

    disturb: called with each task and the number of its result. change: makes another result of a history.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.tasks: list[Task] = []
        self.n_results = 0
        self.disturb: Callable[[Task, int], None] = lambda *_: None
        self.change: Callable[[Task, PointResult], PointResult] = lambda _, result: result
        monkeypatch.setattr(task_runs, "compute_task", self.evaluate)

    def evaluate(self, task: Task, models: Mapping[int, object], _: Keep) -> Iterator[Result]:
        self.tasks.append(task)
        for result in fake_evaluate(task, describe_scene(models[task.scenes[0]])):
            self.n_results += 1
            self.disturb(task, self.n_results)
            yield self.change(task, result) if isinstance(result, PointResult) else result

    def end_at(self, number: int) -> None:
        """The run is interrupted at its result of this number, counted from the last beginning on."""

        def interrupt(_: Task, n_results: int) -> None:
            if n_results >= number:
                raise KeyboardInterrupt

        self.disturb = interrupt

    def begin_again(self) -> None:
        self.__dict__.update(tasks=[], n_results=0, disturb=lambda *_: None)
