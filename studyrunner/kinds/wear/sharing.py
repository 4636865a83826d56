"""Which points that begin from one start state share a wear history, and why.

The rates of all wear laws but "power" are proportional to the wear coefficient, where the contact does not change with
the energy that friction dissipates: dW/dt = k_w f(W), Eq. (7). With s k_w in place of k_w the same states follow each
other, each at the cycle count t / s. Where the scheme chooses its steps, a task integrates the history of the largest
k_w; the others are read from this one at the counts s t.
"""

import itertools
import math
from collections import Counter
from collections.abc import Hashable, Iterator, Sequence
from typing import NamedTuple

from studyrunner.kinds.task import EQUAL_POINTS
from studyrunner.kinds.wear.effort import iterations_of
from studyrunner.kinds.wear.histories import Integrated
from studyrunner.kinds.wear.kind import OWN_STEPS
from studyrunner.study.study import Study

MOST_TOGETHER = 4
"""Histories of one task, which share the adaptive history that given steps are compared with. It takes about as long as
one of them: with 4 a fifth more than with all, and another rank may take the rest."""

REASONS = {
    "cycles": "only the unworn states are asked for, the same for every step and scheme",
    "unworn": "wear_coefficient = 0 wears nothing, whatever the step and the scheme",
    "largest_depth": "slow_time.largest_depth sets the steps of the explicit scheme, whatever the step axis says",
    "adaptive": "the adaptive scheme chooses its steps, for another wear_coefficient the same ones at other counts",
    "final": 'the scheme "final" takes no step of a given length: the same state for every wear_coefficient',
    "equal": EQUAL_POINTS,
}
"""Why points share a history."""


class Values(NamedTuple):
    """What the points that begin from one start state may differ in."""

    wear_coefficient: float
    step: float
    scheme: str


Shared = tuple[Integrated, tuple[tuple[int, ...], ...]]
"""A history that is integrated, and which points, by their numbers, have each history that is read from it."""


class Together(NamedTuple):
    """The histories of a task, by place which points have them, and how many Newton iterations they take."""

    integrated: tuple[Integrated, ...]
    points: tuple[tuple[int, ...], ...]
    iterations: float


def share_histories(study: Study, points: Sequence[Values]) -> tuple[tuple[Together, ...], Counter[str]]:
    """The tasks from a start state, and how many points are not computed alone, by reason; with `shortcuts = false`
    only equal points share a history.
    """
    groups: dict[tuple[str, Hashable], list[int]] = {}
    for number, point in enumerate(points):
        groups.setdefault(_group(study, point), []).append(number)
    shared, causes = list[Shared](), Counter[str]()
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


def _group(study: Study, point: Values) -> tuple[str, Hashable]:
    """Reason for which a point may share a history, and what points that do have in common."""
    if study.solver.shortcuts:
        if study.output_counts[-1] == 0.0:
            return "cycles", point.wear_coefficient
        if point.wear_coefficient == 0.0 and not study.evolving:
            return "unworn", 0.0
        if point.scheme in OWN_STEPS:
            # the rate of the law "power" is not proportional to the wear coefficient, nor is that of an evolution
            own = study.wear.law == "power" or study.evolving
            return point.scheme, point.wear_coefficient if own else None
        if point.scheme == "explicit" and study.slow_time.largest_depth is not None:
            # the last of the steps by Eq. (22) is shortened, so that other wear coefficients have other histories
            return "largest_depth", point.wear_coefficient
    return "alone", point


def _together(study: Study, shared: Sequence[Shared]) -> Iterator[Together]:
    groups: dict[object, list[Shared]] = {}
    for each in shared:
        alone = each[0].unworn or not study.solver.shortcuts
        groups.setdefault(each if alone else each[0].wear_coefficients[0], []).append(each)
    for group in groups.values():
        for first in range(0, len(group), MOST_TOGETHER):
            integrated, points = zip(*group[first : first + MOST_TOGETHER], strict=True)
            cycles = 0.0 if integrated[0].unworn else math.inf if study.to_the_end else study.output_counts[-1]
            iterations = iterations_of([(each.scheme, each.step) for each in integrated], cycles, n_energies(study))
            yield Together(integrated, tuple(itertools.chain.from_iterable(points)), iterations)


def n_energies(study: Study) -> int:
    """Energies of [wear.evolution]; 0 without it."""
    return len(study.wear.evolution.energy) if study.wear.evolution else 0
