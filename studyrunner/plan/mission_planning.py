"""Study of missions -> tasks: one mission history for each point, whose blocks are flown one after the other."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from studyrunner.plan.cases import joint_of, n_unknowns_of, settings_of_line
from studyrunner.plan.estimate import iterations_of_missions, seconds_an_iteration
from studyrunner.plan.sharing import EQUAL_POINTS, Index, ScaledHistory, describe_left_out
from studyrunner.plan.tasks import BranchTask, MarchTask, PlannedBlock, TaskPlan
from studyrunner.scene.drawn_contacts import ContactChange
from studyrunner.scene.scene_set import SceneSet
from studyrunner.study.realisation import Realisation
from studyrunner.study.sections import SOLVER_AXES
from studyrunner.study.study import Study

_OF_ONE_PAIR = 3
"""Relative displacements of one contact pair, at most."""

_POINT = ("frequency", "wear_coefficient", "excitation_amplitude", "sweep")


def build_mission_tasks(
    study: Study,
    n_displacements: Sequence[int],
    contacts: Sequence[Sequence[ContactChange]],
    scenes: SceneSet,
) -> TaskPlan:
    """Tasks of a study of missions: no task waits for another one. Points with equal blocks share a task.

    n_displacements: of each scene. contacts: what is drawn for the pairs of each part, by block. scenes: of the study.
    """
    sizes = [len(values) for values in (study.harmonics, study.samples, study.tolerance, study.rtol)]
    points: dict[MarchTask, list[Index]] = {}
    for number, part in enumerate(scenes.parts):
        of_axes = (range(len(getattr(part.study.axes, name))) for name in _POINT)
        for *own, harmonics, samples, tolerance, rtol in itertools.product(*of_axes, *map(range, sizes)):
            solver = (harmonics, samples, tolerance, rtol)
            at = dict(zip(_POINT, own, strict=True))
            blocks = _blocks(part, at, scenes.of_blocks[number], contacts[number])
            task = _task(study, part, at, solver, blocks, n_displacements)
            place = {**at, **dict(zip(SOLVER_AXES, solver, strict=True))}
            points.setdefault(task, []).append((*(place[name] for name in study.own_axes), *part.place))
    n_points = math.prod(len(values) for values in study.dimensions.values())
    tasks = tuple(_numbered(task, number, of_task) for number, (task, of_task) in enumerate(points.items()))
    return TaskPlan(
        branches=(_no_branch(tasks[0]),),
        marches=(tasks,),
        left_out=describe_left_out({EQUAL_POINTS: n_points - len(tasks)}),
        n_points=n_points,
        n_scenes=len(scenes.studies),
        n_unknowns=max(task.n_unknowns for task in tasks),
    )


def _blocks(
    part: Realisation, at: Mapping[str, int], scenes: Sequence[int], contacts: Sequence[ContactChange]
) -> tuple[PlannedBlock, ...]:
    """The blocks of a point. at: index of the point along the axes of `_POINT`."""
    found = []
    sweep = part.study.axes.sweep[at["sweep"]]
    for given, study, scene, contact in zip(
        part.study.mission, part.study.block_studies, scenes, contacts, strict=True
    ):
        amplitude, frequency = (
            getattr(study.axes, name)[0 if given.gives(name) else at[name]]
            for name in ("excitation_amplitude", "frequency")
        )
        passage, begin = None, str(given.begin)
        if isinstance(given.frequency, dict):
            frequency, stop = given.frequency["start"], given.frequency["stop"]
            passage, begin = (stop, given.frequency["rate"]), "up" if stop > frequency else "down"
        elif begin == "sweep":
            begin = sweep
        joint = joint_of(Realisation(study, part.place), scene, contact)
        found.append(PlannedBlock(given.name, joint, frequency, passage, amplitude, given.cycles_at(frequency), begin))
    return tuple(found)


def _task(
    study: Study,
    part: Realisation,
    at: Mapping[str, int],
    solver: Index,
    blocks: tuple[PlannedBlock, ...],
    n_displacements: Sequence[int],
) -> MarchTask:
    """The task of a point, without its number and its points."""
    settings = settings_of_line(study, solver)
    n_unknowns = max(n_unknowns_of(n_displacements[block.joint.scene], settings.harmonics) for block in blocks)
    coefficient = part.study.axes.wear_coefficient[at["wear_coefficient"]]
    one_pair = n_displacements[blocks[0].joint.scene] <= _OF_ONE_PAIR
    ways = [
        (block.begin, abs(math.log2(block.passage[0] / block.frequency)) if block.passage else 0.0) for block in blocks
    ]
    iterations = iterations_of_missions(ways, study.cycles_kept[-1], one_pair=one_pair)
    return MarchTask(
        number=0,
        joint=blocks[0].joint,
        law=part.study.wear_law,
        branch=0,
        position=0,
        settings=settings,
        scheme="adaptive",
        largest_depth=None,
        histories=(ScaledHistory(coefficient, 1.0, ()),),
        held=False,
        cycles=study.cycles_kept,
        variables=mission_variables(study),
        loops=(),
        cost=seconds_an_iteration(n_unknowns) * iterations,
        n_unknowns=n_unknowns,
        until=study.until,
        blocks=blocks,
        # only a first block that continues begins by it
        sweep=part.study.axes.sweep[at["sweep"]] if blocks[0].begin == "continue" else "",
    )


def _numbered(task: MarchTask, number: int, points: Sequence[Index]) -> MarchTask:
    (history,) = task.histories
    return replace(task, number=number, position=number, histories=(replace(history, points=tuple(points)),))


def _no_branch(task: MarchTask) -> BranchTask:
    """The branch of a study of missions, without start states: a mission history finds them."""
    return BranchTask(0, task.joint, 0.0, "", task.settings, (), 0.0)


def mission_variables(study: Study) -> tuple[str, ...]:
    """Variables of a mission history: those asked for and those that the last lines of a run are made of."""
    of_table = ("worn_volume", "block_worn_volume")
    return tuple(name for name in study.variables if name in study.outputs.variables or name in of_table)
