"""Study of wear -> sweeps, and histories from their start states."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from solver.settings import SolverSettings, ToTheEnd
from studyrunner.kinds.estimate import iterations_of_histories, iterations_of_sweep, seconds_of
from studyrunner.kinds.sharing import EQUAL, Integrated, describe_left_out, share_histories
from studyrunner.kinds.task import Index, Joint, TaskPlan, grid, joint_of, n_unknowns_of, settings_at
from studyrunner.kinds.wear import History, Sweep
from studyrunner.scene.pairs import ContactChange
from studyrunner.scene.scene_set import SceneSet
from studyrunner.study.parts import Part
from studyrunner.study.study import Study

_OF_HISTORY = ("wear_coefficient", "step", "scheme")

MOST_TOGETHER = 4
"""Histories of one task, which share the adaptive history that given steps are compared with. It takes about as long as
one of them: with 4 a fifth more than with all, and another rank may take the rest."""


class _Case(NamedTuple):
    """What the states of a sweep have in common."""

    joint: Joint
    excitation_amplitude: float
    direction: str
    settings: SolverSettings


class _Start(NamedTuple):
    """Points of one part of a study that start from one state. at: their indices along the axes but `_OF_HISTORY`."""

    part: Part
    at: Mapping[str, int]


def build_tasks(
    study: Study, n_displacements: Sequence[int], contacts: Sequence[ContactChange], scenes: SceneSet
) -> TaskPlan:
    """Tasks of a study of wear.

    Points whose history is the same for a reason that the study itself shows share a task, see `sharing`. Points with a
    solution of their own never do. The order and the numbers of the tasks depend on the study alone.
    """
    planner = _Planner(study, n_displacements)
    for case, at in _cases(study, contacts, scenes).items():
        ascending = sorted(at)
        for frequencies in [[one] for one in ascending] if case.direction == "ramp" else [ascending]:
            planner.add_sweep(case, {frequency: at[frequency] for frequency in frequencies})
    left_out = describe_left_out(planner.causes)
    return TaskPlan(tuple(planner.histories), left_out, study.n_points, tuple(planner.sweeps))


def _cases(study: Study, contacts: Sequence[ContactChange], scenes: SceneSet) -> dict[_Case, dict[float, list[_Start]]]:
    """Points that one sweep reaches, by frequency, in the order of the study."""
    cases: dict[_Case, dict[float, list[_Start]]] = {}
    lines = [(at, settings_at(study, at)) for at in grid(study, "excitation_amplitude", "sweep")]
    for part, scene, contact in zip(scenes.parts, scenes.numbers, contacts, strict=True):
        axes, joint = part.study.axes, joint_of(part.study, scene, contact)
        for at, settings in lines:
            amplitude = axes.excitation_amplitude[at["excitation_amplitude"]]
            case = _Case(joint, amplitude, axes.sweep[at["sweep"]], settings)
            for place, frequency in enumerate(axes.frequency):
                start = _Start(part, {**at, "frequency": place})
                cases.setdefault(case, {}).setdefault(frequency, []).append(start)
    return cases


class _Planner:
    """Builds the tasks of a study one after the other. causes: numbers of points that share a history, by reason."""

    def __init__(self, study: Study, n_displacements: Sequence[int]) -> None:
        self._study = study
        self._n_displacements = n_displacements
        self._shared: dict[object, tuple[tuple[Integrated, ...], Counter[str]]] = {}
        self.causes: Counter[str] = Counter()
        self.sweeps: list[Sweep] = []
        self.histories: list[History] = []

    def add_sweep(self, case: _Case, at: Mapping[float, Sequence[_Start]]) -> None:
        """A sweep and its histories. at: by frequency."""
        n_unknowns = n_unknowns_of(self._n_displacements[case.joint.scene], case.settings.harmonics)
        sweep = Sweep(
            number=len(self.sweeps),
            frequencies=tuple(at),
            cost=seconds_of(n_unknowns, iterations_of_sweep(case.direction, len(at))),
            n_unknowns=n_unknowns,
            follow=self._study.follow,
            **case._asdict(),
        )
        self.sweeps.append(sweep)
        for position, starts in enumerate(at.values()):
            by_law: dict[object, list[_Start]] = {}
            for start in starts:
                by_law.setdefault(start.part.study.wear.as_law, []).append(start)
            for same in by_law.values():
                self._add_histories(sweep, position, same)

    def _add_histories(self, sweep: Sweep, position: int, starts: Sequence[_Start]) -> None:
        owners: dict[float, list[tuple[_Start, int]]] = {}
        for start in starts:
            for place, value in enumerate(start.part.study.axes.wear_coefficient):
                owners.setdefault(value, []).append((start, place))
        study = starts[0].part.study
        axes = study.axes.model_copy(update={"wear_coefficient": tuple(owners)})
        study = study.model_copy(update={"axes": axes})
        key = (study.wear.as_law, tuple(owners))
        if key not in self._shared:
            # the same from each start state
            self._shared[key] = share_histories(study)
        found, causes = self._shared[key]
        of_value = list(owners.values())
        self.causes += causes
        n_equal = sum(len(each) - 1 for each in of_value)
        self.causes[EQUAL] += n_equal * len(study.axes.step) * len(study.axes.scheme)
        together: dict[object, list[Integrated]] = {}
        for each in found:
            alone = each.unworn or not study.solver.shortcuts
            together.setdefault(each if alone else each.wear_coefficient, []).append(self._placed(each, of_value))
        for integrated in together.values():
            for begin in range(0, len(integrated), MOST_TOGETHER):
                self._add_history(study, sweep, position, tuple(integrated[begin : begin + MOST_TOGETHER]))

    def _placed(self, integrated: Integrated, of_value: Sequence[Sequence[tuple[_Start, int]]]) -> Integrated:
        """With the points of the study in place of choices. of_value: starts and places by wear coefficient."""

        def point(start: _Start, *choice: int) -> Index:
            places = {**start.at, **dict(zip(_OF_HISTORY, choice, strict=True))}
            return (*(places[name] for name in self._study.own_axes), *start.part.place)

        histories = []
        for each in integrated.histories:
            owners = ((start, (wear, *rest)) for first, *rest in each.points for start, wear in of_value[first])
            histories.append(replace(each, points=tuple(point(start, *choice) for start, choice in owners)))
        return replace(integrated, histories=tuple(histories))

    def _add_history(self, study: Study, sweep: Sweep, position: int, integrated: tuple[Integrated, ...]) -> None:
        cycles = 0.0 if integrated[0].unworn else math.inf if study.to_the_end else study.output_counts[-1]
        end = ToTheEnd(len(study.output_counts), study.slow_time.final_share) if study.to_the_end else None
        steps = [(each.scheme, each.step) for each in integrated]
        self.histories.append(
            History(
                number=len(self.histories),
                joint=sweep.joint,
                law=study.wear.as_law,
                sweep=sweep.number,
                position=position,
                frequency=sweep.frequencies[position],
                excitation_amplitude=sweep.excitation_amplitude,
                direction=sweep.direction,
                settings=sweep.settings,
                integrated=integrated,
                cycles=study.output_counts,
                variables=tuple(self._study.recorded),
                loops=study.outputs.loops,
                cost=seconds_of(sweep.n_unknowns, iterations_of_histories(steps, cycles)),
                n_unknowns=sweep.n_unknowns,
                until=study.until,
                follow=study.follow,
                to_the_end=end,
            )
        )
