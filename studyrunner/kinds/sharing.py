"""Which choices of wear coefficient, step and scheme share one wear history, and why.

The rates of all wear laws are proportional to the wear coefficient: dW/dt = k_w f(W), Eq. (7). With s k_w in place of
k_w the same states follow each other, each at the cycle count t / s. Where the scheme chooses its steps, a task
integrates the history of the largest k_w; the others are read from this one at the counts s t.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

from studyrunner.kinds.task import EQUAL_POINTS, Index
from studyrunner.study.study import Study

_OWN_STEPS = ("adaptive", "final")

EQUAL = "equal points"
"""Reason that is no choice of wear coefficient, step and scheme."""

_REASONS = {
    "cycles": "only the unworn states are asked for, the same for every step and scheme",
    "unworn": "wear_coefficient = 0 wears nothing, whatever the step and the scheme",
    "largest_depth": "slow_time.largest_depth sets the steps of the explicit scheme, whatever the step axis says",
    "adaptive": "the adaptive scheme chooses its steps, for another wear_coefficient the same ones at other counts",
    "final": 'the scheme "final" takes no step of a given length: the same state for every wear_coefficient',
    EQUAL: EQUAL_POINTS,
}


@dataclass(frozen=True)
class ScaledHistory:
    """A history that is read from an integrated history with scaled slow time, and the points that have this history.

    wear_coefficient: 1/Pa; its ratio to that of the integrated history scales the slow time.
    step: cycles; the step of the first point where the step does not matter.
    points: indices along the dimensions of the study, or choices: along wear_coefficient, step and scheme alone.
    """

    wear_coefficient: float
    step: float
    points: tuple[Index, ...]


@dataclass(frozen=True)
class Integrated:
    """A history that is integrated, and the histories of other points that are read from it.

    scheme, largest_depth: as for `steps_of` of the solver. histories: one result each. The first is integrated; it
    needs the most cycles. unworn: whether nothing wears, so that the state at cycle 0 is that of all cycles.
    """

    scheme: str
    largest_depth: float | None
    histories: tuple[ScaledHistory, ...]
    unworn: bool

    @property
    def wear_coefficient(self) -> float:
        """Of the integrated history, 1/Pa."""
        return self.histories[0].wear_coefficient

    @property
    def step(self) -> float:
        """Of the integrated history, cycles."""
        return self.histories[0].step

    def counts(self, cycles: Sequence[float], scaled: ScaledHistory) -> tuple[float, ...]:
        """Cycle counts of the integrated history at which a history is read, one for each of `cycles`."""
        if scaled == self.histories[0] and not self.unworn:
            # also where both wear coefficients are 0
            return tuple(cycles)
        ratio = 0.0 if self.unworn else scaled.wear_coefficient / self.wear_coefficient
        return tuple(ratio * cycle for cycle in cycles)

    def wear(self, scaled: ScaledHistory) -> tuple[float, float | None]:
        """Wear coefficient of a history, and its step where the step matters."""
        own_steps = self.unworn or self.scheme in _OWN_STEPS or self.largest_depth is not None
        return scaled.wear_coefficient, None if own_steps else scaled.step


def describe_left_out(causes: Mapping[str, int]) -> dict[str, int]:
    """Numbers of points that are not computed alone, by reason in words. causes: by the name of the reason."""
    return {reason: causes[cause] for cause, reason in _REASONS.items() if causes.get(cause)}


def share_histories(study: Study) -> tuple[tuple[Integrated, ...], Counter[str]]:
    """The histories to integrate from each start state, whose points are choices; numbers of choices by reason for
    sharing. With `shortcuts = false` no history is shared.
    """
    axes = study.axes
    groups: dict[tuple[str, Hashable], list[Index]] = {}
    for places in itertools.product(*map(range, (len(axes.wear_coefficient), len(axes.step), len(axes.scheme)))):
        groups.setdefault(_group(study, places), []).append(places)
    found, causes = list[Integrated](), Counter[str]()
    for (cause, _), choices in groups.items():
        by_wear: dict[int, list[Index]] = {}
        for choice in sorted(choices, key=lambda choice: -axes.wear_coefficient[choice[0]]):
            by_wear.setdefault(choice[0], []).append(choice)
        histories = tuple(
            ScaledHistory(axes.wear_coefficient[wear], axes.step[same[0][1]], tuple(same))
            for wear, same in by_wear.items()
        )
        scheme, unworn = axes.scheme[histories[0].points[0][2]], cause in ("cycles", "unworn")
        depth = study.slow_time.largest_depth if scheme == "explicit" else None
        found.append(Integrated(scheme, depth, histories, unworn))
        causes[cause] += len(choices) - 1
    return tuple(sorted(found, key=lambda each: min(point for one in each.histories for point in one.points))), causes


def _group(study: Study, choice: Index) -> tuple[str, Hashable]:
    """Reason for which a choice may share a history, and what choices that do have in common."""
    wear, _, scheme = choice
    value, word = study.axes.wear_coefficient[wear], study.axes.scheme[scheme]
    if study.solver.shortcuts:
        if study.output_counts[-1] == 0.0:
            return "cycles", wear
        if value == 0.0:
            return "unworn", wear
        if word in _OWN_STEPS:
            return word, None
        if word == "explicit" and study.slow_time.largest_depth is not None:
            # the last of the steps by Eq. (22) is shortened, so that other wear coefficients have other histories
            return "largest_depth", wear
    return "alone", choice
