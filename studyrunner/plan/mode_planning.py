"""Study of nonlinear modes -> tasks: one line over the amplitude for each joint, mode, direction and setting."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from solver.settings import SolverSettings
from studyrunner.plan.cases import joint_of, n_unknowns_of, settings_of_line
from studyrunner.plan.estimate import iterations_of_mode, seconds_an_iteration
from studyrunner.plan.sharing import EQUAL_POINTS, Index, ScaledHistory, describe_left_out
from studyrunner.plan.tasks import BranchTask, Joint, MarchTask, TaskPlan
from studyrunner.scene.drawn_contacts import ContactChange
from studyrunner.scene.scene_set import SceneSet
from studyrunner.study.sections import SOLVER_AXES
from studyrunner.study.study import Study

_FOR_THE_TABLE = ("natural_frequency", "damping_ratio")


@dataclass(frozen=True)
class _Line:
    """What the points of a mode have in common."""

    joint: Joint
    mode: int
    sweep: str
    settings: SolverSettings


def build_mode_tasks(
    study: Study,
    n_displacements: Sequence[int],
    contacts: Sequence[ContactChange],
    scenes: SceneSet,
) -> TaskPlan:
    """Tasks of a study of nonlinear modes. The points of a line share one sweep over the amplitude.

    n_displacements: of each scene. contacts: what is drawn for the pairs of each part. scenes: of the study.
    """
    amplitudes = study.axes.modal_amplitude or ()
    ascending = sorted(range(len(amplitudes)), key=lambda place: amplitudes[place])
    branches: list[BranchTask] = []
    marches: list[tuple[MarchTask, ...]] = []
    lines, names = _lines(study, contacts, scenes), tuple(study.dimensions)
    for line, starts in lines.items():
        n_unknowns = n_unknowns_of(n_displacements[line.joint.scene], line.settings.harmonics)
        branch = BranchTask(
            number=len(branches),
            joint=line.joint,
            excitation_amplitude=0.0,
            sweep=line.sweep,
            settings=line.settings,
            frequencies=tuple(amplitudes[place] for place in ascending),
            cost=seconds_an_iteration(n_unknowns) * iterations_of_mode(len(amplitudes)),
            mode=line.mode,
        )
        points = (tuple(_index({**start, "modal_amplitude": place}, names) for start in starts) for place in ascending)
        branches.append(branch)
        marches.append(
            tuple(
                _report(study, branch, len(amplitudes) * branch.number + position, position, of_one)
                for position, of_one in enumerate(points)
            )
        )
    n_lines = sum(len(starts) for starts in lines.values())
    return TaskPlan(
        branches=tuple(branches),
        marches=tuple(marches),
        left_out=describe_left_out({EQUAL_POINTS: len(amplitudes) * (n_lines - len(lines))}),
        n_points=len(amplitudes) * n_lines,
        n_scenes=len(scenes.studies),
        n_unknowns=max(n_unknowns_of(number, each) for number in n_displacements for each in study.harmonics),
    )


def mode_variables(study: Study) -> tuple[str, ...]:
    """Variables of a point of a mode: those asked for and those that the last lines of a run are made of."""
    return tuple(name for name in study.variables if name in study.outputs.variables or name in _FOR_THE_TABLE)


def _lines(study: Study, contacts: Sequence[ContactChange], scenes: SceneSet) -> dict[_Line, list[dict[str, int]]]:
    """Lines over the amplitude, each with the places along the other axes that have it."""
    axes, names = study.axes, tuple(study.axes_of_parts)
    sizes = [len(values) for values in (study.harmonics, study.samples, study.tolerance, study.rtol)]
    lines: dict[_Line, list[dict[str, int]]] = {}
    for part, scene, contact in zip(scenes.parts, scenes.numbers, contacts, strict=True):
        joint, of_part = joint_of(part, scene, contact), dict(zip(names, part.place, strict=True))
        for mode, sweep, *solver in itertools.product(
            range(len(axes.mode or ())), range(len(axes.sweep)), *map(range, sizes)
        ):
            settings = settings_of_line(study, tuple(solver))
            line = _Line(joint, (axes.mode or ())[mode], axes.sweep[sweep], settings)
            places = {"mode": mode, "sweep": sweep, **dict(zip(SOLVER_AXES, solver, strict=True)), **of_part}
            lines.setdefault(line, []).append(places)
    return lines


def _index(places: Mapping[str, int], names: Sequence[str]) -> Index:
    """Index of a point along the dimensions of the study; those of one value have no place."""
    return tuple(places.get(name, 0) for name in names)


def _report(study: Study, branch: BranchTask, number: int, position: int, points: tuple[Index, ...]) -> MarchTask:
    """A point of a mode in the form of the result; it is there with the state, no rank gets it as a task."""
    return MarchTask(
        number=number,
        joint=branch.joint,
        law=study.wear_law,
        branch=branch.number,
        position=position,
        settings=branch.settings,
        scheme="",
        largest_depth=None,
        histories=(ScaledHistory(0.0, 1.0, points),),
        held=True,
        cycles=(0.0,),
        variables=mode_variables(study),
        loops=(),
        cost=0.0,
        n_unknowns=1,
        moves=False,
    )
