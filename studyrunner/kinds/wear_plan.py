"""Study of wear -> sweeps, and histories from their start states."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from solver.settings import SolverSettings, ToTheEnd
from studyrunner.kinds.estimate import iterations_of_history, iterations_of_sweep, seconds_an_iteration
from studyrunner.kinds.sharing import (
    EQUAL,
    IDLE_RTOL,
    ScaledHistory,
    Sharing,
    describe_left_out,
    rtol_is_idle,
    share_histories,
)
from studyrunner.kinds.task import Index, Joint, Task, TaskPlan, joint_of, n_unknowns_of, settings_at
from studyrunner.kinds.wear import History, Sweep
from studyrunner.scene.drawn_contacts import ContactChange
from studyrunner.scene.scene_set import SceneSet
from studyrunner.study.realisation import Realisation
from studyrunner.study.sections import SOLVER_AXES
from studyrunner.study.study import Study
from studyrunner.system.progress import count
from studyrunner.variables import ASKED, CERTIFICATE, COUNTS, LOOPS

_OF_SWEEP = ("excitation_amplitude", "sweep")
"""Axes of which each sweep has one value, beside those of the solver."""

_OF_HISTORY = ("wear_coefficient", "step", "scheme")

_FOR_THE_TABLE = (*CERTIFICATE, "stable")  # at the end of a run, whatever the result file holds


@dataclass(frozen=True)
class _Case:
    """What the states of a sweep have in common. values: of `_OF_SWEEP`."""

    joint: Joint
    values: tuple[float | str, ...]
    settings: SolverSettings


@dataclass(frozen=True)
class _Start:
    """Points of one part of a study that start from one state. lines: indices of the points along `_LINE`."""

    part: Realisation
    lines: tuple[Mapping[str, int], ...]
    frequency: int


def variables(study: Study) -> tuple[str, ...]:
    """Variables of a history: those asked for and those that the table at the end is made of."""
    asked = (name for name in ASKED if name in study.outputs.variables or name in _FOR_THE_TABLE)
    return (*asked, *(LOOPS if study.outputs.loops else ()), *(COUNTS if study.to_the_end else ()))


def build_tasks(
    study: Study, n_displacements: Sequence[int], contacts: Sequence[ContactChange], scenes: SceneSet
) -> TaskPlan:
    """Tasks of a study of wear.

    Points whose history is the same for a reason that the study itself shows share a task, see `sharing`. Points with a
    solution of their own never do. The order and the numbers of the tasks depend on the study alone.
    """
    return _Planner(study, n_displacements, contacts, scenes).plan()


class _Planner:
    """Builds the tasks of a study one after the other."""

    def __init__(
        self, study: Study, n_displacements: Sequence[int], contacts: Sequence[ContactChange], scenes: SceneSet
    ) -> None:
        self._study = study
        self._n_displacements = n_displacements
        self._contacts = contacts
        self._scenes = scenes
        self._variables = variables(study)
        self._shared: dict[tuple[object, ...], Sharing] = {}
        self._causes: Counter[str] = Counter()
        self._sweeps: list[Sweep] = []
        self._histories: list[History] = []

    def plan(self) -> TaskPlan:
        """All tasks."""
        for case, at in self._cases().items():
            ascending = sorted(at)
            for frequencies in [[one] for one in ascending] if "ramp" in case.values else [ascending]:
                self._add_sweep(case, {frequency: at[frequency] for frequency in frequencies})
        return TaskPlan(
            results=tuple(self._histories),
            left_out=describe_left_out(self._causes),
            n_points=math.prod(len(values) for values in self._study.dimensions.values()),
            n_scenes=len(self._n_displacements),
            sweeps=tuple(self._sweeps),
        )

    def _cases(self) -> dict[_Case, dict[float, list[_Start]]]:
        """Points that one sweep reaches, by frequency, in the order of the study."""
        cases: dict[_Case, dict[float, list[_Start]]] = {}
        of_all = [(lines, settings_at(self._study, lines[0])) for lines in _lines(self._study)]
        for part, scene, contact in zip(self._scenes.parts, self._scenes.numbers, self._contacts, strict=True):
            axes, joint = part.study.axes, joint_of(part, scene, contact)
            for lines, settings in of_all:
                case = _Case(joint, tuple(getattr(axes, name)[lines[0][name]] for name in _OF_SWEEP), settings)
                for place, frequency in enumerate(axes.frequency):
                    start = _Start(part, lines, place)
                    cases.setdefault(case, {}).setdefault(frequency, []).append(start)
        return cases

    def _add_sweep(self, case: _Case, at: Mapping[float, Sequence[_Start]]) -> None:
        n_unknowns = n_unknowns_of(self._n_displacements[case.joint.scene], case.settings.harmonics)
        amplitude, direction = case.values
        sweep = Sweep(
            number=len(self._sweeps),
            joint=case.joint,
            excitation_amplitude=float(amplitude),
            direction=str(direction),
            settings=case.settings,
            frequencies=tuple(at),
            cost=seconds_an_iteration(n_unknowns) * iterations_of_sweep(str(direction), len(at)),
            n_unknowns=n_unknowns,
            follow=self._study.follow,
        )
        self._sweeps.append(sweep)
        for position, starts in enumerate(at.values()):
            by_law: dict[object, list[_Start]] = {}
            for start in starts:
                by_law.setdefault(start.part.study.wear_law, []).append(start)
            for same in by_law.values():
                self._add_histories(sweep, position, same, n_unknowns)

    def _add_histories(self, sweep: Sweep, position: int, starts: Sequence[_Start], n_unknowns: int) -> None:
        """Tasks of all points that start from one state and wear by one law."""
        owners: dict[float, list[tuple[_Start, int]]] = {}
        for start in starts:
            for place, value in enumerate(start.part.study.axes.wear_coefficient):
                owners.setdefault(value, []).append((start, place))
        study = _with_wear_coefficients(starts[0].part.study, tuple(owners))
        sharing = self._share(study, tuple(owners))
        of_value = list(owners.values())
        n_others = len(study.axes.step) * len(study.axes.scheme)
        lines = [len(start.lines) for each in of_value for start, _ in each]
        self._causes += sharing.causes
        self._causes[IDLE_RTOL] += n_others * (sum(lines) - len(lines))
        self._causes[EQUAL] += n_others * (len(lines) - len(of_value))
        for alike in sharing.tasks:
            histories = []
            for choices in alike.histories:
                points = tuple(
                    self._point(start, line, (wear, *choice[1:]))
                    for choice in choices
                    for start, wear in of_value[choice[0]]
                    for line in start.lines
                )
                wear, step, _ = choices[0]
                histories.append(ScaledHistory(study.axes.wear_coefficient[wear], study.axes.step[step], points))
            scheme = study.axes.scheme[alike.histories[0][0][2]]
            cycles = 0.0 if alike.unworn else math.inf if study.to_the_end else study.cycles_kept[-1]
            self._histories.append(
                History(
                    number=len(self._histories),
                    joint=sweep.joint,
                    law=study.wear_law,
                    sweep=sweep.number,
                    position=position,
                    frequency=sweep.frequencies[position],
                    excitation_amplitude=sweep.excitation_amplitude,
                    direction=sweep.direction,
                    settings=sweep.settings,
                    scheme=scheme,
                    largest_depth=study.slow_time.largest_depth if scheme == "explicit" else None,
                    histories=tuple(histories),
                    unworn=alike.unworn,
                    cycles=study.cycles_kept,
                    variables=self._variables,
                    loops=study.outputs.loops,
                    cost=seconds_an_iteration(n_unknowns) * iterations_of_history(scheme, cycles, histories[0].step),
                    n_unknowns=n_unknowns,
                    until=study.until,
                    follow=study.follow,
                    to_the_end=ToTheEnd(len(study.cycles_kept), study.slow_time.final_share)
                    if study.to_the_end
                    else None,
                )
            )

    def _point(self, start: _Start, line: Mapping[str, int], choice: Sequence[int]) -> Index:
        """Index of a point along the dimensions of the study. choice: places along `_OF_HISTORY`."""
        places = {**line, **dict(zip(_OF_HISTORY, choice, strict=True)), "frequency": start.frequency}
        return (*(places[name] for name in self._study.own_axes), *start.part.place)

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


def _lines(study: Study) -> Iterator[tuple[Mapping[str, int], ...]]:
    """Indices along the axes of which a sweep has one value. Those of one sweep differ in `rtol` only, where nothing
    uses that.
    """
    names = (*_OF_SWEEP, *SOLVER_AXES)
    own = [getattr(study.axes if name in _OF_SWEEP else study, name) for name in names]
    shared: dict[tuple[int, ...], list[Mapping[str, int]]] = {}
    for places in itertools.product(*(range(len(values)) for values in own)):
        at = dict(zip(names, places, strict=True))
        idle = rtol_is_idle(study, study.harmonics[at["harmonics"]], study.samples[at["samples"]])
        shared.setdefault(tuple(place for name, place in at.items() if name != "rtol" or not idle), []).append(at)
    yield from map(tuple, shared.values())


TIME = "to a factor of two, if every point wears; a point whose vibration jumps takes up to five times as long"


def describe_tasks(tasks: Sequence[Task]) -> str:
    """Tasks in words."""
    sweeps = [task for task in tasks if isinstance(task, Sweep)]
    n_histories = count(len(tasks) - len(sweeps), "wear history", "wear histories")
    if not sweeps:
        return n_histories
    n_ramps = sum(sweep.direction == "ramp" for sweep in sweeps)
    ways = [(len(sweeps) - n_ramps, "sweep"), (n_ramps, "ramp")]
    named = " and ".join(count(number, way) for number, way in ways if number)
    n_starts = count(sum(sweep.n_results for sweep in sweeps), "start state")
    return f"{n_starts} by {named}, and {n_histories}"


def slow_time(study: Study) -> list[tuple[str, str]]:
    """Cycles."""
    n_kept = len(study.cycles_kept)
    if study.to_the_end:
        until = f"until the wear rate of every pair is below {study.slow_time.final_share:g} of its largest"
        return [("cycles", f"{until}; {n_kept} states are kept, spaced evenly in worn volume and cycles")]
    return [("cycles", f"{study.cycles_kept[-1]:g}, of which {count(n_kept, 'count is', 'counts are')} kept")]
