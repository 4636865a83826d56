"""The plan of a study as a table: each point with its values, its scene, its task and the estimated time of this."""

import csv
from typing import TextIO

import numpy as np

from studies.scene import Progress
from studyrunner.plan import build_tasks
from studyrunner.result.arrays import coordinates, sample_coordinates
from studyrunner.scene.scene_set import plan_scenes
from studyrunner.study.design import TASK
from studyrunner.study.sections import SOLVER_AXES
from studyrunner.study.study import Study

HEADER = (TASK, "scene", "seconds", "points_of_task", "sweep_task", "seconds_of_sweep")
"""Columns behind the axes. seconds: of the whole task, on one core, where every point wears."""


def print_table(study: Study, say: Progress, file: TextIO) -> None:
    """Writes the points of a study as CSV, in the order of the result: axes that a design may give, `HEADER`, others.

    say: as of `plan_lines`. Raises UserError.
    """
    scenes, facts, _ = plan_scenes(study, say)
    points, plan = scenes.points, build_tasks(study, scenes, facts)
    arrays = [*coordinates(study, facts, scenes), *sample_coordinates(study, facts, scenes)]
    arrays = [each for each in arrays if each.dimensions and {*each.dimensions} <= points.dims.keys()]
    of_task: list[tuple[object, ...]] = [()] * points.n
    for task in plan.make():
        sweep = () if task.waits_for is None else (task.waits_for[0], f"{plan.sweeps[task.waits_for[0]].cost:.3g}")
        numbers = [number for place in task.order for number in task.points(place)]
        about = task.number, " ".join(map(str, task.scenes)), f"{task.cost:.3g}", len(numbers), *sweep
        for number in numbers:
            of_task[number] = about
    keys, columns = _keys_of_design(study), dict[str, list[object]]()
    for each in arrays:
        # flags are small whole numbers in a result
        values = each.values.astype(bool) if each.values.dtype == np.int8 else each.values
        shape = [size if name in each.dimensions else 1 for name, size in points.dims.items()]
        columns[each.name] = np.broadcast_to(values.reshape(shape), tuple(points.dims.values())).ravel().tolist()
    names, others = ([name for name in columns if (name in keys) == wanted] for wanted in (True, False))
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow([*(keys[name] for name in names), *HEADER[: 6 if plan.sweeps else 4], *others])
    rows = zip(*(columns[name] for name in (*names, *others)), of_task, strict=True)
    n = len(names)
    writer.writerows((*values[:n], *about, *values[n:]) for *values, about in rows)
    file.flush()


def _keys_of_design(study: Study) -> dict[str, str]:
    """Of each axis that may be a column of a design the name of this column."""
    designed = {} if study.design is None else study.design.columns
    axes = [name for name in (*designed, *study.dimensions) if study.kind.is_read("axes", name) or name in SOLVER_AXES]
    keys = {name: name for name in axes if name not in study.kind.no_columns}
    return keys | {axis.name: axis.dotted for axis in study.scene_axes if not axis.is_worn}
