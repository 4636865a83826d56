"""Study -> tasks: the branches to follow, the wear histories that start from them, what is left out and why."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from solver.settings import SolverSettings, ToTheEnd
from studyrunner.plan.cases import joint_of, n_unknowns_of, settings_of_line
from studyrunner.plan.estimate import iterations_of_branch, iterations_of_march, seconds_an_iteration
from studyrunner.plan.mission_planning import build_mission_tasks, mission_variables
from studyrunner.plan.mode_planning import build_mode_tasks, mode_variables
from studyrunner.plan.sharing import (
    EQUAL_POINTS,
    IDLE_RTOL,
    Choice,
    Index,
    ScaledHistory,
    Sharing,
    describe_left_out,
    rtol_is_idle,
    share_histories,
)
from studyrunner.plan.tasks import BranchTask, Joint, MarchTask, TaskPlan
from studyrunner.scene.drawn_contacts import ContactChange
from studyrunner.scene.scene_set import SceneSet, find_scenes
from studyrunner.study.realisation import Realisation
from studyrunner.study.sections import SOLVER_AXES
from studyrunner.study.study import Study
from studyrunner.variables import ASKED, CERTIFICATE, COUNTS, LOOPS

_FOR_THE_TABLE = (*CERTIFICATE, "stable")  # at the end of a run, whatever the result file holds


@dataclass(frozen=True)
class _Start:
    """Points of one part of a study that start from one state.

    part: number of the part. lines: indices of the points, see `_lines`. frequency: index of the frequency.
    """

    part: int
    lines: tuple[Index, ...]
    frequency: int


@dataclass(frozen=True)
class _Case:
    """What the states of a branch have in common."""

    joint: Joint
    excitation_amplitude: float
    sweep: str
    settings: SolverSettings


def build_tasks(
    study: Study,
    n_displacements: int | Sequence[int],
    contacts: Sequence[Any] | None = None,
    scenes: SceneSet | None = None,
) -> TaskPlan:
    """Tasks of a study.

    Points whose history is the same for a reason that the study itself shows share a task, see `sharing`. Points with a
    solution of their own never do. The order and the numbers of the tasks depend on the study alone.

    n_displacements: number of relative displacements of each scene of the study (`find_scenes`), or of all scenes.
    contacts: what is drawn for the pairs of each part of the study, as `contact_changes` gives it; None for nothing.
    scenes: of the study, where they are known already.
    """
    scenes = find_scenes(study) if scenes is None else scenes
    drawn: Sequence[Any] = (((),) * len(study.mission),) * len(scenes.parts) if contacts is None else contacts
    n_scenes = len(scenes.studies)
    sizes = (n_displacements,) * n_scenes if isinstance(n_displacements, int) else tuple(n_displacements)
    if study.has_missions:
        return build_mission_tasks(study, sizes, drawn, scenes)
    return (build_mode_tasks if study.has_modes else _plan)(study, sizes, drawn, scenes)


def _plan(
    study: Study, n_displacements: Sequence[int], contacts: Sequence[ContactChange], scenes: SceneSet
) -> TaskPlan:
    """Tasks of a study of wear. n_displacements: of each scene. contacts: of each part."""
    return _Planner(study, n_displacements, contacts, scenes).plan()


def march_variables(study: Study) -> tuple[str, ...]:
    """Variables that a march hands back: those asked for and those that the table at the end is made of."""
    if study.has_modes:
        return mode_variables(study)
    if study.has_missions:
        return mission_variables(study)
    asked = (name for name in ASKED if name in study.outputs.variables or name in _FOR_THE_TABLE)
    return (*asked, *(LOOPS if study.outputs.loops else ()), *(COUNTS if study.to_the_end else ()))


class _Planner:
    """Builds the tasks of a study one after the other."""

    def __init__(
        self,
        study: Study,
        n_displacements: Sequence[int],
        contacts: Sequence[ContactChange],
        scenes: SceneSet,
    ) -> None:
        self._study = study
        self._parts = scenes.parts
        self._contacts = contacts
        self._scenes = scenes
        # what all parts have in common
        self._lines = [(lines, settings_of_line(study, lines[0][2:])) for lines in _lines(study)]
        self._variables = march_variables(study)
        self._n_displacements = n_displacements
        self._numbers = itertools.count()
        self._shared: dict[tuple[object, ...], Sharing] = {}
        self._causes: Counter[str] = Counter()
        self._branches: list[BranchTask] = []
        self._marches: list[tuple[MarchTask, ...]] = []

    def plan(self) -> TaskPlan:
        """All tasks."""
        for case, starts in self._cases().items():
            at: dict[float, list[_Start]] = {}
            for start in starts:
                at.setdefault(self._parts[start.part].study.axes.frequency[start.frequency], []).append(start)
            ascending = sorted(at)
            for frequencies in [[one] for one in ascending] if case.sweep == "ramp" else [ascending]:
                self._add_branch(case, {frequency: at[frequency] for frequency in frequencies})
        n_points = math.prod(len(values) for values in self._study.dimensions.values())
        return TaskPlan(
            branches=tuple(self._branches),
            marches=tuple(self._marches),
            left_out=describe_left_out(self._causes),
            n_points=n_points,
            n_scenes=len(self._n_displacements),
            n_unknowns=max(
                n_unknowns_of(number, each) for number in set(self._n_displacements) for each in self._study.harmonics
            ),
        )

    def _cases(self) -> dict[_Case, list[_Start]]:
        """Points that one branch reaches, in the order of the study."""
        cases: dict[_Case, list[_Start]] = {}
        for number, (part, scene) in enumerate(zip(self._parts, self._scenes.numbers, strict=True)):
            study = part.study
            joint = joint_of(part, scene, self._contacts[number])
            for lines, settings in self._lines:
                amplitude, sweep = study.axes.excitation_amplitude[lines[0][0]], study.axes.sweep[lines[0][1]]
                case = _Case(joint, amplitude, sweep, settings)
                frequencies = range(len(study.axes.frequency))
                cases.setdefault(case, []).extend(_Start(number, lines, place) for place in frequencies)
        return cases

    def _add_branch(self, case: _Case, at: dict[float, list[_Start]]) -> None:
        number = len(self._branches)
        n_unknowns = n_unknowns_of(self._n_displacements[case.joint.scene], case.settings.harmonics)
        self._branches.append(
            BranchTask(
                number=number,
                joint=case.joint,
                excitation_amplitude=case.excitation_amplitude,
                sweep=case.sweep,
                settings=case.settings,
                frequencies=tuple(at),
                cost=seconds_an_iteration(n_unknowns) * iterations_of_branch(case.sweep, len(at)),
                follow=self._study.follow,
            )
        )
        self._marches.append(
            tuple(
                task
                for position, starts in enumerate(at.values())
                for same in self._by_wear_law(starts)
                for task in self._tasks(case, (number, position), same, n_unknowns)
            )
        )

    def _by_wear_law(self, starts: Sequence[_Start]) -> Iterator[list[_Start]]:
        """Starts whose parts differ in wear coefficients at most."""
        groups: dict[object, list[_Start]] = {}
        for start in starts:
            groups.setdefault(self._parts[start.part].study.wear_law, []).append(start)
        yield from groups.values()

    def _tasks(
        self, case: _Case, branch: tuple[int, int], starts: Sequence[_Start], n_unknowns: int
    ) -> Iterator[MarchTask]:
        """Tasks of all points that start from one state and wear by one law."""
        owners: dict[float, list[tuple[_Start, int]]] = {}
        for start in starts:
            for place, value in enumerate(self._parts[start.part].study.axes.wear_coefficient):
                owners.setdefault(value, []).append((start, place))
        study = _with_wear_coefficients(self._parts[starts[0].part].study, tuple(owners))
        sharing = self._share(study, tuple(owners))
        of_value = list(owners.values())
        n_others = len(study.axes.step) * len(study.axes.scheme)
        lines = [len(start.lines) for each in of_value for start, _ in each]
        self._causes += sharing.causes
        self._causes[IDLE_RTOL] += n_others * (sum(lines) - len(lines))
        self._causes[EQUAL_POINTS] += n_others * (len(lines) - len(of_value))
        axes, own_axes = study.axes, study.own_axes
        for alike in sharing.marches:
            histories = tuple(
                ScaledHistory(
                    axes.wear_coefficient[choices[0][0]],
                    axes.step[choices[0][1]],
                    tuple(
                        _point(own_axes, self._parts[start.part], start.frequency, line, (wear, *choice[1:]))
                        for choice in choices
                        for start, wear in of_value[choice[0]]
                        for line in start.lines
                    ),
                )
                for choices in alike.histories
            )
            scheme = axes.scheme[alike.histories[0][0][2]]
            cycles = 0.0 if alike.held else math.inf if study.to_the_end else study.cycles_kept[-1]
            end = ToTheEnd(len(study.cycles_kept), study.slow_time.final_share) if study.to_the_end else None
            yield MarchTask(
                number=next(self._numbers),
                joint=case.joint,
                law=study.wear_law,
                branch=branch[0],
                position=branch[1],
                settings=case.settings,
                scheme=scheme,
                largest_depth=study.slow_time.largest_depth if scheme == "explicit" else None,
                histories=histories,
                held=alike.held,
                cycles=study.cycles_kept,
                variables=self._variables,
                loops=study.outputs.loops,
                cost=seconds_an_iteration(n_unknowns) * iterations_of_march(scheme, cycles, histories[0].step),
                n_unknowns=n_unknowns,
                until=study.until,
                follow=study.follow,
                to_the_end=end,
            )

    def _share(self, study: Study, wear_coefficients: tuple[float, ...]) -> Sharing:
        """What points share; the same from each start state."""
        key = (study.wear_law, wear_coefficients)
        if key not in self._shared:
            self._shared[key] = share_histories(study)
        return self._shared[key]


def _with_wear_coefficients(study: Study, values: tuple[float, ...]) -> Study:
    if values == study.axes.wear_coefficient:
        return study
    return study.model_copy(update={"axes": study.axes.model_copy(update={"wear_coefficient": values})})


def _lines(study: Study) -> Iterator[tuple[Index, ...]]:
    """Indices of excitation amplitude, sweep and solver keys: what a branch along the frequency is followed for.

    The indices of one branch differ in `rtol` only, where nothing uses that.
    """
    solver = [len(values) for values in (study.harmonics, study.samples, study.tolerance)]
    sizes = (len(study.axes.excitation_amplitude), len(study.axes.sweep), *solver)
    for line in itertools.product(*(range(size) for size in sizes)):
        lines = [(*line, rtol) for rtol in range(len(study.rtol))]
        if rtol_is_idle(study, study.harmonics[line[2]], study.samples[line[3]]):
            yield tuple(lines)
        else:
            yield from ((one,) for one in lines)


def _point(own_axes: Sequence[str], part: Realisation, frequency: int, line: Index, choice: Choice) -> Index:
    """Index of a point along the dimensions of the study. own_axes: of the study. line: see `_lines`."""
    places = dict(zip(("excitation_amplitude", "sweep", *SOLVER_AXES), line, strict=True))
    places.update(zip(("wear_coefficient", "step", "scheme"), choice, strict=True))
    places["frequency"] = frequency
    return (*(places[name] for name in own_axes), *part.place)
