"""Which choices of wear coefficient, step and scheme share one wear history, and why.

The rates of all present wear laws are proportional to the wear coefficient (`WearLaw.proportional`). The wear equation
is then dW/dt = k_w f(W), Eq. (7). With s k_w in place of k_w and h / s in place of the step h the same states follow
each other, each at the cycle count t / s. A task integrates the history of the largest k_w; the other histories are
read from this one at the counts s t. With a law that is not proportional no two k_w share a history.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

from studyrunner.kinds.task import Index
from studyrunner.kinds.task_plan import EQUAL_POINTS, LeftOut
from studyrunner.study.study import Study

Choice = tuple[int, int, int]
"""Indices on the axes wear_coefficient, step and scheme."""

_SAME = 1e-12  # relative: numbers of steps that differ by round-off

IDLE_RTOL, EQUAL = "rtol", "equal points"
"""Reasons that are no choice of wear coefficient, step and scheme."""

_REASONS = {
    "cycles": "only the unworn states are asked for, the same for every step and scheme",
    "unworn": "wear_coefficient = 0 wears nothing, whatever the step and the scheme",
    "largest_depth": "slow_time.largest_depth sets the steps of the explicit scheme, whatever the step axis says",
    "adaptive": "the adaptive scheme chooses its steps, for another wear_coefficient the same ones at other counts",
    "final": 'the scheme "final" takes no step of a given length: the same state for every wear_coefficient',
    "steps": "wear_coefficient times step is that of another point: the same history at other cycle counts",
    IDLE_RTOL: "rtol is used by nothing: harmonics and samples are given, and the scheme is not adaptive",
    EQUAL: EQUAL_POINTS,
}


@dataclass(frozen=True)
class ScaledHistory:
    """A history that is read from a computed history with scaled slow time, and the points that have this history.

    wear_coefficient: 1/Pa. The ratio to the wear coefficient of the computed history scales the slow time.
    step: cycles; the step of the first point where the step does not matter.
    points: indices along the dimensions of the study.
    """

    wear_coefficient: float
    step: float
    points: tuple[Index, ...]


@dataclass(frozen=True)
class Alike:
    """Choices whose histories one task computes.

    histories: for each history the choices that have this history. The first history is the computed one; it needs the
        most cycles.
    unworn: whether nothing wears, so that the state at cycle 0 is that of all cycles.
    """

    histories: tuple[tuple[Choice, ...], ...]
    unworn: bool = False


def describe_left_out(causes: Mapping[str, int]) -> tuple[LeftOut, ...]:
    """Numbers of points that are not computed alone, by reason. causes: these numbers by the name of the reason."""
    return tuple(LeftOut(causes[cause], reason) for cause, reason in _REASONS.items() if causes.get(cause))


def share_histories(study: Study) -> tuple[tuple[Alike, ...], Counter[str]]:
    """The histories that have to be computed from each start state, and the number of choices by reason for sharing.

    With `shortcuts = false` no history is shared.
    """
    axes = study.axes
    groups: dict[tuple[str, Hashable], list[Choice]] = {}
    for choice in itertools.product(range(len(axes.wear_coefficient)), range(len(axes.step)), range(len(axes.scheme))):
        groups.setdefault(_group(study, choice), []).append(choice)
    tasks, causes = [], Counter[str]()
    for (cause, _), choices in groups.items():
        by_wear: dict[int, list[Choice]] = {}
        for choice in sorted(choices, key=lambda choice: -axes.wear_coefficient[choice[0]]):
            by_wear.setdefault(choice[0], []).append(choice)
        farthest, *others = (tuple(same) for same in by_wear.values())
        shared = [same for same in others if cause != "steps" or _ends_with_a_step(study, same[0])]
        tasks.append(Alike((farthest, *shared), unworn=cause in ("cycles", "unworn")))
        alone = [same for same in others if same not in shared]
        tasks += [Alike((same,)) for same in alone]
        causes[cause] += len(choices) - 1 - len(alone)
    tasks.sort(key=lambda alike: min(itertools.chain.from_iterable(alike.histories)))
    return tuple(tasks), causes


def _group(study: Study, choice: Choice) -> tuple[str, Hashable]:
    """Reason for which a choice may share a history, and what choices that do have in common."""
    wear, step, scheme = choice
    value, word, proportional = (
        study.axes.wear_coefficient[wear],
        study.axes.scheme[scheme],
        study.wear_law.proportional,
    )
    if not study.solver.shortcuts:
        return "alone", choice
    if study.cycles_kept[-1] == 0.0:
        return "cycles", wear
    if proportional and value == 0.0:
        return "unworn", wear
    if word in ("adaptive", "final"):
        return word, None if proportional else wear
    if word == "explicit" and study.slow_time.largest_depth is not None:
        # the last of the steps by Eq. (22) is shortened, so that other wear coefficients have other histories
        return "largest_depth", wear
    # to a few digits: the same products may differ by round-off
    return "steps", (scheme, f"{value * study.axes.step[step]:.11e}" if proportional else choice)


def _ends_with_a_step(study: Study, choice: Choice) -> bool:
    """Whether the last step of a history ends at the last count; else it is shortened, and is no step of another one.

    Integration to the steady state has no shortened last step.
    """
    return study.to_the_end or _whole_number(study.cycles_kept[-1] / study.axes.step[choice[1]]) is not None


def counts_of(
    cycles: Sequence[float], scaled: ScaledHistory, computed: ScaledHistory, steps_of_given_length: bool
) -> tuple[float, ...]:
    """Cycle counts, ascending, at which a scaled history at `cycles` is read from the computed history.

    A count at the end of a step is moved slightly before the end, so that round-off does not move the count to the next
    step.
    """
    if scaled == computed:
        return tuple(cycles)
    if not steps_of_given_length:
        ratio = scaled.wear_coefficient / computed.wear_coefficient
        return tuple(ratio * cycle for cycle in cycles)
    counts = []
    for cycle in cycles:
        n_steps = cycle / scaled.step
        whole = _whole_number(n_steps)
        counts.append(computed.step * (n_steps if whole is None else (1.0 - _SAME) * whole))
    return tuple(counts)


def _whole_number(value: float) -> int | None:
    """The whole number, at least 1, that a value equals up to round-off; None where there is none."""
    near = round(value)
    return near if near >= 1 and abs(value - near) <= _SAME * near else None
