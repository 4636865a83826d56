"""All tasks of a study, and what of its points needs no task of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from studyrunner.kinds.task import Index, Task
from studyrunner.study.study import Study


@dataclass(frozen=True)
class LeftOut:
    """Number of points that are not computed alone, and the reason."""

    n_points: int
    reason: str


@dataclass(frozen=True)
class TaskPlan:
    """All tasks of a study.

    results: tasks that give the results of points; histories wait for a start state. sweeps: they give start states.
    left_out: points that share a result, by reason. n_points, n_scenes: of the study.
    """

    results: tuple[Task, ...]
    left_out: tuple[LeftOut, ...]
    n_points: int
    n_scenes: int
    sweeps: tuple[Task, ...] = ()

    @cached_property
    def waiting(self) -> Mapping[tuple[int, int], tuple[Task, ...]]:
        """Tasks that wait for a start state, by number of the sweep and place."""
        found: dict[tuple[int, int], list[Task]] = {}
        for task in self.results:
            if task.waits_for is not None:
                found.setdefault(task.waits_for, []).append(task)
        return {start: tuple(tasks) for start, tasks in found.items()}

    @property
    def n_unknowns(self) -> int:
        """Of the largest task."""
        return max(task.n_unknowns for task in self.results)

    @property
    def cost(self) -> float:
        """Estimated time on one rank, s, where every point wears."""
        return sum(task.cost for task in (*self.sweeps, *self.results))

    @property
    def longest(self) -> float:
        """Estimated time, s, of the longest task, with the sweep that it waits for."""
        return max(
            task.cost + (0.0 if task.waits_for is None else self.sweeps[task.waits_for[0]].cost)
            for task in self.results
        )


EQUAL_POINTS = "all values are those of another point"
"""Reason for a result that points share, whatever the kind of study."""


def number_points(tasks: Mapping[Any, Sequence[tuple[Index, ...]]], study: Study, n_scenes: int) -> TaskPlan:
    """The plan of a study without start states. tasks: each, without number and points, with its `indices`."""
    results = tuple(
        replace(task, number=number, indices=tuple(indices)) for number, (task, indices) in enumerate(tasks.items())
    )
    n_points = math.prod(len(values) for values in study.dimensions.values())
    shared = n_points - sum(len(task.order) for task in results)
    return TaskPlan(results, (LeftOut(shared, EQUAL_POINTS),) if shared else (), n_points, n_scenes)
