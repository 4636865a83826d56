"""The plan of a study as a table: each point with its values, its scene, its task and the estimated time of this."""

import csv
from typing import TextIO

import numpy as np

from studies.scene import Progress
from studyrunner.plan import build_tasks
from studyrunner.result.arrays import coordinates, sample_coordinates
from studyrunner.scene.scene_set import plan_scenes
from studyrunner.study.study import Study

HEADER = ("scene", "task", "seconds", "points_of_task", "sweep_task", "seconds_of_sweep")
"""Columns after the values of a point. seconds: of the whole task, on one core, where every point wears."""


def print_table(study: Study, say: Progress, file: TextIO) -> None:
    """Writes the points of a study as CSV, in the order of the result. say: as of `plan_lines`. Raises UserError."""
    scenes, facts, _ = plan_scenes(study, say)
    points, plan = scenes.points, build_tasks(study, scenes, facts)
    arrays = [*coordinates(study, facts, scenes), *sample_coordinates(study, facts, scenes)]
    arrays = [each for each in arrays if each.dimensions and {*each.dimensions} <= points.dims.keys()]
    of_task: list[tuple[object, ...]] = [()] * points.n
    for task in plan.make():
        sweep = () if task.waits_for is None else (task.waits_for[0], f"{plan.sweeps[task.waits_for[0]].cost:.3g}")
        numbers = [number for place in task.order for number in task.points(place)]
        about = " ".join(map(str, task.scenes)), task.number, f"{task.cost:.3g}", len(numbers), *sweep
        for number in numbers:
            of_task[number] = about
    columns = []
    for each in arrays:
        shape = [size if name in each.dimensions else 1 for name, size in points.dims.items()]
        columns.append(np.broadcast_to(each.values.reshape(shape), tuple(points.dims.values())).ravel().tolist())
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow([*(each.name for each in arrays), *HEADER[: 6 if plan.sweeps else 4]])
    writer.writerows((*values, *about) for *values, about in zip(*columns, of_task, strict=True))
    file.flush()
