"""Study -> its tasks, whatever its kind."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from studyrunner.kinds import missions, modes, wear_plan
from studyrunner.kinds.missions import Mission
from studyrunner.kinds.modes import Mode
from studyrunner.kinds.task import Task, TaskPlan
from studyrunner.kinds.wear import History, Sweep
from studyrunner.scene.pairs import contact_changes
from studyrunner.scene.scene import SceneFacts
from studyrunner.scene.scene_set import SceneSet
from studyrunner.study.study import MISSIONS, MODES, Study
from studyrunner.system.progress import count


def build_tasks(study: Study, scenes: SceneSet, facts: Sequence[SceneFacts]) -> TaskPlan:
    """Tasks of a study. Their order and numbers depend on the study alone.

    scenes: of the study (`find_scenes`). facts: of each scene. Raises UserError where a sample draws a value that is
    none, or blocks of a mission differ in their pairs.
    """
    n_displacements = [each.n_displacements for each in facts]
    contacts: Any = contact_changes(study, scenes, facts)
    if study.kind is MISSIONS:
        return missions.build_tasks(study, scenes, n_displacements, contacts)
    if study.kind is MODES:
        return modes.build_tasks(study, scenes, n_displacements, contacts)
    return wear_plan.build_tasks(study, scenes, n_displacements, contacts)


def describe_tasks(tasks: Sequence[Task]) -> str:
    """Tasks in words."""
    sweeps = Counter(task.direction == "ramp" for task in tasks if isinstance(task, Sweep))
    n_results = Counter[type]()
    for task in tasks:
        # of a history those that are integrated
        n_results[type(task)] += len(task.integrated) if isinstance(task, History) else task.n_results
    ways = " and ".join(count(sweeps[ramp], word) for ramp, word in ((False, "sweep"), (True, "ramp")) if sweeps[ramp])
    n_modes = sum(isinstance(task, Mode) for task in tasks)
    parts = {
        Sweep: f"{count(n_results[Sweep], 'start state')} by {ways}",
        History: count(n_results[History], "wear history", "wear histories"),
        Mode: f"{count(n_modes, 'nonlinear mode')} over the amplitude, {count(n_results[Mode], 'point')}",
        Mission: f"{count(n_results[Mission], 'mission history', 'mission histories')}, each computed by one rank",
    }
    return ", and ".join(text for kind, text in parts.items() if n_results[kind])
