"""Runs of the command with a stand-in for the solver, which may do something else at one of its results."""

from collections.abc import Callable, Iterator

import pytest

from studyrunner import task_runs
from studyrunner.kinds.task import Keep, PointResult, Result, Task
from studyrunner.scene.scene import describe_scene
from tests.studyrunner.fakes import fake_evaluate

SMALL = [
    "sdof_slider",
    *("--set", "axes.frequency=[100, 110]"),
    *("--set", "axes.wear_coefficient=[5e-12, 1e-11]"),
    *("--set", "axes.scheme=implicit"),
    *("-o", "out.nc"),
]
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

        monkeypatch.setattr(
            task_runs, "compute_task", lambda task, models, keep: self.evaluate(models[task.scenes[0]], task, keep)
        )

    def evaluate(self, model: object, task: Task, keep: Keep) -> Iterator[Result]:
        self.tasks.append(task)
        for result in fake_evaluate(task, keep, describe_scene(model)):
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
