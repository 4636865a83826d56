"""Study of wear -> sweeps, and histories from their start states; which points share a history, and why.

The rates of all wear laws are proportional to the wear coefficient: dW/dt = k_w f(W), Eq. (7). With s k_w in place of
k_w the same states follow each other, each at the cycle count t / s. Where the scheme chooses its steps, a task
integrates the history of the largest k_w; the others are read from this one at the counts s t.
"""

import itertools
import math
from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from functools import cache, partial
from operator import itemgetter
from typing import Any, NamedTuple

from solver.contact.wear_law import WearLaw
from solver.settings import SolverSettings, ToTheEnd
from studyrunner.kinds.estimate import iterations_of_histories, iterations_of_sweep, seconds_of
from studyrunner.kinds.task import EQUAL_POINTS, Index, TaskJoint, TaskPlan, grid, joint_of, n_unknowns_of
from studyrunner.kinds.wear import Excitation, History, Integrated, Sweep
from studyrunner.scene.scene_set import ContactChange, SceneSet
from studyrunner.study.study import Study
from studyrunner.variables import OWN_STEPS

MOST_TOGETHER = 4
"""Histories of one task, which share the adaptive history that given steps are compared with. It takes about as long as
one of them: with 4 a fifth more than with all, and another rank may take the rest."""

_REASONS = {
    "cycles": "only the unworn states are asked for, the same for every step and scheme",
    "unworn": "wear_coefficient = 0 wears nothing, whatever the step and the scheme",
    "largest_depth": "slow_time.largest_depth sets the steps of the explicit scheme, whatever the step axis says",
    "adaptive": "the adaptive scheme chooses its steps, for another wear_coefficient the same ones at other counts",
    "final": 'the scheme "final" takes no step of a given length: the same state for every wear_coefficient',
    "equal": EQUAL_POINTS,
}
"""Why points share a history."""


class _Values(NamedTuple):
    """What the points that begin from one start state may differ in."""

    wear_coefficient: float
    step: float
    scheme: str


class _Points(NamedTuple):
    """Points that begin from one start state: of each its values, and its index along the dimensions of the study."""

    values: list[_Values]
    at: list[Index]


_Case = tuple[TaskJoint, Excitation, SolverSettings]
"""What the states of a sweep have in common."""

_Starts = dict[WearLaw, dict[float, _Points]]
"""Points by wear law and frequency, in the order of the study."""

_Shared = tuple[Integrated, tuple[tuple[int, ...], ...]]
"""A history that is integrated, and which points, by their numbers, have each history that is read from it."""


class _Together(NamedTuple):
    """The histories of a task, by place which points have them, and how many Newton iterations they take."""

    integrated: tuple[Integrated, ...]
    points: tuple[tuple[int, ...], ...]
    iterations: float


_Sharing = Callable[[tuple[_Values, ...]], tuple[tuple[_Together, ...], Counter[str]]]
"""`_share_histories` of a study: most start states have points with the same values."""


class _Histories(Sequence[History]):
    """The histories of a study, each made when it is asked for: `--plan` of 10^6 points takes a fifth of the memory."""

    def __init__(self, make: Callable[[], Iterator[History]], length: int) -> None:
        self._make, self._length = make, length

    def __len__(self) -> int:
        return self._length

    def __iter__(self) -> Iterator[History]:
        return self._make()

    def __getitem__(self, place: Any) -> Any:
        return tuple(self)[place]


def build_tasks(
    study: Study, scenes: SceneSet, n_displacements: Sequence[int], contacts: Sequence[Sequence[ContactChange]]
) -> TaskPlan:
    """Tasks of a study of wear.

    Points whose history is the same for a reason that the study itself shows share a task. Points with a solution of
    their own never do. The order and the numbers of the tasks depend on the study alone.
    """
    outputs: dict[str, Any] = {
        "cycles": study.output_counts,
        "variables": tuple(study.recorded),
        "loops": study.outputs.loops,
        "until": study.until,
        "to_the_end": ToTheEnd(len(study.output_counts), study.slow_time.final_share) if study.to_the_end else None,
    }
    sharing = cache(partial(_share_histories, study))
    sweeps, of_sweeps, causes, n_histories = list[Sweep](), list[_Starts](), Counter[str](), 0
    for (joint, excitation, settings), starts in _cases(study, contacts, scenes).items():
        ascending, direction = sorted(set[float]().union(*starts.values())), excitation.direction
        n_unknowns = n_unknowns_of(n_displacements[joint.scene], settings.harmonics)
        case: dict[str, Any] = {"joint": joint, "excitation": excitation, "settings": settings}
        case |= {"scenes": (joint.scene,), "n_unknowns": n_unknowns}
        for frequencies in [[one] for one in ascending] if direction == "ramp" else [ascending]:
            first, whole = (iterations_of_sweep(direction, number) for number in (1, len(frequencies)))
            case |= {"cost": seconds_of(n_unknowns, whole), "first_share": first / whole}
            sweeps.append(Sweep(number=len(sweeps), frequencies=tuple(frequencies), **case))
            of_sweeps.append(starts)
        for points in itertools.chain.from_iterable(of_law.values() for of_law in starts.values()):
            tasks, shared = sharing(tuple(points.values))
            n_histories += len(tasks)
            causes.update(shared)

    make = partial(_make_histories, tuple(zip(sweeps, of_sweeps, strict=True)), sharing, outputs)
    left_out = {reason: causes[cause] for cause, reason in _REASONS.items() if causes[cause]}
    return TaskPlan(_Histories(make, n_histories), left_out, study.n_points, tuple(sweeps))


def _make_histories(
    sweeps: Sequence[tuple[Sweep, _Starts]], sharing: _Sharing, outputs: Mapping[str, Any]
) -> Iterator[History]:
    """The histories from the start states of all sweeps, in the order of the study."""
    number = itertools.count()
    for sweep, starts in sweeps:
        case = {name: getattr(sweep, name) for name in ("joint", "excitation", "settings", "scenes", "n_unknowns")}
        for position, frequency in enumerate(sweep.frequencies):
            for law, of_law in starts.items():
                values, at = of_law.get(frequency, ((), ()))
                for together in sharing(tuple(values))[0]:
                    yield History(
                        number=next(number),
                        law=law,
                        sweep=sweep.number,
                        position=position,
                        frequency=frequency,
                        integrated=together.integrated,
                        indices=tuple(tuple(at[point] for point in same) for same in together.points),
                        cost=seconds_of(sweep.n_unknowns, together.iterations),
                        **case,
                        **outputs,
                    )


def _cases(study: Study, contacts: Sequence[Sequence[ContactChange]], scenes: SceneSet) -> dict[_Case, _Starts]:
    """Points that one sweep reaches."""
    cases, index = dict[_Case, _Starts](), itemgetter(*study.own_axes)
    for part, (scene,), (contact,) in zip(scenes.parts, scenes.of_blocks, contacts, strict=True):
        axes, joint, law = part.study.axes, joint_of(part.study, scene, contact), part.study.wear.as_law
        # by the places on the axes, of which there are few, and not by what stands there
        of_cases, all_values = dict[tuple[int, ...], dict[float, _Points]](), dict[tuple[int, ...], _Values]()
        for at, settings in grid(part.study):
            case = at["excitation_amplitude"], at["sweep"], id(settings)
            if case not in of_cases:
                amplitude, direction = axes.excitation_amplitude[case[0]], axes.sweep[case[1]]
                excitation = Excitation(amplitude, direction, part.study.follow)
                starts = cases.setdefault((joint, excitation, settings), {})
                of_cases[case] = starts.setdefault(law, {})
            frequency, of_law = axes.frequency[at["frequency"]], of_cases[case]
            if frequency not in of_law:
                of_law[frequency] = _Points([], [])
            place = at["wear_coefficient"], at["step"], at["scheme"]
            if place not in all_values:
                wear, step, scheme = place
                all_values[place] = _Values(axes.wear_coefficient[wear], axes.step[step], axes.scheme[scheme])
            values, indices = of_law[frequency]
            values.append(all_values[place])
            indices.append((*index(at), *part.place))
    return cases


def _share_histories(study: Study, points: Sequence[_Values]) -> tuple[tuple[_Together, ...], Counter[str]]:
    """The tasks from a start state, and how many points are not computed alone, by reason; with `shortcuts = false`
    only equal points share a history.
    """
    groups: dict[tuple[str, Hashable], list[int]] = {}
    for number, point in enumerate(points):
        groups.setdefault(_group(study, point), []).append(number)
    shared, causes = list[_Shared](), Counter[str]()
    for (cause, _), alike in groups.items():
        by_wear: dict[float, list[int]] = {}
        for number in sorted(alike, key=lambda number: -points[number].wear_coefficient):
            by_wear.setdefault(points[number].wear_coefficient, []).append(number)
        first = points[next(iter(by_wear.values()))[0]]
        depth = study.slow_time.largest_depth if first.scheme == "explicit" else None
        unworn = cause in ("cycles", "unworn")
        integrated = Integrated(first.scheme, first.step, depth, tuple(by_wear), unworn)
        shared.append((integrated, tuple(map(tuple, by_wear.values()))))
        n_different = len({points[number] for number in alike})
        causes.update({cause: n_different - 1, "equal": len(alike) - n_different})
    return tuple(_together(study, shared)), +causes


def _group(study: Study, point: _Values) -> tuple[str, Hashable]:
    """Reason for which a point may share a history, and what points that do have in common."""
    if study.solver.shortcuts:
        if study.output_counts[-1] == 0.0:
            return "cycles", point.wear_coefficient
        if point.wear_coefficient == 0.0:
            return "unworn", 0.0
        if point.scheme in OWN_STEPS:
            return point.scheme, None
        if point.scheme == "explicit" and study.slow_time.largest_depth is not None:
            # the last of the steps by Eq. (22) is shortened, so that other wear coefficients have other histories
            return "largest_depth", point.wear_coefficient
    return "alone", point


def _together(study: Study, shared: Sequence[_Shared]) -> Iterator[_Together]:
    groups: dict[object, list[_Shared]] = {}
    for each in shared:
        alone = each[0].unworn or not study.solver.shortcuts
        groups.setdefault(each if alone else each[0].wear_coefficients[0], []).append(each)
    for group in groups.values():
        for first in range(0, len(group), MOST_TOGETHER):
            integrated, points = zip(*group[first : first + MOST_TOGETHER], strict=True)
            cycles = 0.0 if integrated[0].unworn else math.inf if study.to_the_end else study.output_counts[-1]
            iterations = iterations_of_histories([(each.scheme, each.step) for each in integrated], cycles)
            yield _Together(integrated, tuple(itertools.chain.from_iterable(points)), iterations)
