"""Study of wear -> sweeps, and histories from their start states; which points share a history, and why.

The rates of all wear laws are proportional to the wear coefficient: dW/dt = k_w f(W), Eq. (7). With s k_w in place of
k_w the same states follow each other, each at the cycle count t / s. Where the scheme chooses its steps, a task
integrates the history of the largest k_w; the others are read from this one at the counts s t.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Hashable, Iterator, Sequence
from typing import Any, NamedTuple

from solver.contact.wear_law import WearLaw
from solver.settings import SolverSettings, ToTheEnd
from studyrunner.kinds.estimate import iterations_of_histories, iterations_of_sweep, seconds_of
from studyrunner.kinds.task import EQUAL_POINTS, Index, TaskJoint, TaskPlan, grid, joint_of, n_unknowns_of
from studyrunner.kinds.wear import OWN_STEPS, Excitation, History, Integrated, Sweep
from studyrunner.scene.scene_set import ContactChange, SceneSet
from studyrunner.study.study import Study

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


class _Point(NamedTuple):
    """A point of the study. at: its index along the dimensions of the study."""

    wear_coefficient: float
    step: float
    scheme: str
    at: Index


_Case = tuple[TaskJoint, Excitation, SolverSettings]
"""What the states of a sweep have in common."""

_Starts = dict[float, dict[WearLaw, list[_Point]]]
"""Points by frequency and wear law, in the order of the study."""

_Shared = tuple[Integrated, tuple[tuple[Index, ...], ...]]
"""A history that is integrated, and the points of each history that is read from it."""


def build_tasks(
    study: Study, scenes: SceneSet, n_displacements: Sequence[int], contacts: Sequence[Sequence[ContactChange]]
) -> TaskPlan:
    """Tasks of a study of wear.

    Points whose history is the same for a reason that the study itself shows share a task. Points with a solution of
    their own never do. The order and the numbers of the tasks depend on the study alone.
    """
    sweeps, histories, causes = list[Sweep](), list[History](), Counter[str]()
    outputs: dict[str, Any] = {
        "cycles": study.output_counts,
        "variables": tuple(study.recorded),
        "loops": study.outputs.loops,
        "until": study.until,
        "to_the_end": ToTheEnd(len(study.output_counts), study.slow_time.final_share) if study.to_the_end else None,
    }
    for (joint, excitation, settings), starts in _cases(study, contacts, scenes).items():
        ascending, direction = sorted(starts), excitation.direction
        n_unknowns = n_unknowns_of(n_displacements[joint.scene], settings.harmonics)
        case: dict[str, Any] = {"joint": joint, "excitation": excitation, "settings": settings}
        case |= {"scenes": (joint.scene,), "n_unknowns": n_unknowns}
        for frequencies in [[one] for one in ascending] if direction == "ramp" else [ascending]:
            cost = seconds_of(n_unknowns, iterations_of_sweep(direction, len(frequencies)))
            sweep = Sweep(number=len(sweeps), frequencies=tuple(frequencies), cost=cost, **case)
            sweeps.append(sweep)
            for position, frequency in enumerate(frequencies):
                start: dict[str, Any] = {"sweep": sweep.number, "position": position, "frequency": frequency}
                for law, points in starts[frequency].items():
                    for together in _together(study, _share_histories(study, points, causes)):
                        integrated, indices = zip(*together, strict=True)
                        histories.append(
                            History(
                                number=len(histories),
                                law=law,
                                integrated=integrated,
                                indices=tuple(itertools.chain.from_iterable(indices)),
                                cost=seconds_of(n_unknowns, _iterations(study, integrated)),
                                **start,
                                **case,
                                **outputs,
                            )
                        )
    left_out = {reason: causes[cause] for cause, reason in _REASONS.items() if causes[cause]}
    return TaskPlan(tuple(histories), left_out, study.n_points, tuple(sweeps))


def _cases(study: Study, contacts: Sequence[Sequence[ContactChange]], scenes: SceneSet) -> dict[_Case, _Starts]:
    """Points that one sweep reaches."""
    cases, own_axes = dict[_Case, _Starts](), study.own_axes
    for part, (scene,), (contact,) in zip(scenes.parts, scenes.of_blocks, contacts, strict=True):
        axes, joint, law = part.study.axes, joint_of(part.study, scene, contact), part.study.wear.as_law
        for at, settings in grid(part.study):
            starts = cases.setdefault((joint, Excitation.at(part.study, at), settings), {})
            points = starts.setdefault(axes.frequency[at["frequency"]], {}).setdefault(law, [])
            wear, step, scheme = (getattr(axes, name)[at[name]] for name in ("wear_coefficient", "step", "scheme"))
            points.append(_Point(wear, step, scheme, (*(at[name] for name in own_axes), *part.place)))
    return cases


def _share_histories(study: Study, points: Sequence[_Point], causes: Counter[str]) -> Iterator[_Shared]:
    """The histories to integrate from a start state; with `shortcuts = false` only equal points share one.

    causes: numbers of points that are not computed alone, by reason; those of these points are added.
    """
    groups: dict[tuple[str, Hashable], list[_Point]] = {}
    for point in points:
        groups.setdefault(_group(study, point), []).append(point)
    for (cause, _), alike in groups.items():
        by_wear: dict[float, list[_Point]] = {}
        for point in sorted(alike, key=lambda point: -point.wear_coefficient):
            by_wear.setdefault(point.wear_coefficient, []).append(point)
        first = next(iter(by_wear.values()))[0]
        depth = study.slow_time.largest_depth if first.scheme == "explicit" else None
        unworn = cause in ("cycles", "unworn")
        integrated = Integrated(first.scheme, first.step, depth, tuple(by_wear), unworn)
        yield integrated, tuple(tuple(point.at for point in same) for same in by_wear.values())
        n_different = len({point[:3] for point in alike})
        causes.update({cause: n_different - 1, "equal": len(alike) - n_different})


def _group(study: Study, point: _Point) -> tuple[str, Hashable]:
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
    return "alone", point[:3]


def _together(study: Study, shared: Iterator[_Shared]) -> Iterator[tuple[_Shared, ...]]:
    """The histories by task."""
    groups: dict[object, list[_Shared]] = {}
    for each in shared:
        alone = each[0].unworn or not study.solver.shortcuts
        groups.setdefault(each if alone else each[0].wear_coefficients[0], []).append(each)
    for group in groups.values():
        for first in range(0, len(group), MOST_TOGETHER):
            yield tuple(group[first : first + MOST_TOGETHER])


def _iterations(study: Study, integrated: Sequence[Integrated]) -> float:
    """Newton iterations of the histories of a task."""
    cycles = 0.0 if integrated[0].unworn else math.inf if study.to_the_end else study.output_counts[-1]
    return iterations_of_histories([(each.scheme, each.step) for each in integrated], cycles)
