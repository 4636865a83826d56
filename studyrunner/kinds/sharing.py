"""Which choices of wear coefficient, step and scheme share one wear history, and why.

The rates of all present wear laws are proportional to the wear coefficient (`WearLaw.proportional`). The wear equation
is then dW/dt = k_w f(W), Eq. (7). With s k_w in place of k_w and h / s in place of the step h the same states follow
each other, each at the cycle count t / s. A task integrates the history of the largest k_w; the other histories are
read from this one at the counts s t. With a law that is not proportional no two k_w share a history.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from solver.settings import Automatic
from studyrunner.kinds.task import EQUAL_POINTS, Index, LeftOut
from studyrunner.study.sections import AUTO
from studyrunner.study.study import Study

Choice = tuple[int, int, int]
"""Indices on the axes wear_coefficient, step and scheme."""

_SAME = 1e-12  # relative: products of wear coefficient and step that differ by round-off, and numbers of steps

IDLE_RTOL, EQUAL = "rtol", "equal points"
"""Reasons that are no choice of wear coefficient, step and scheme."""

_REASONS = {
    "cycles": "only the unworn states are asked for, the same for every step and scheme",
    "wear_coefficient": "wear_coefficient = 0 wears nothing, whatever the step and the scheme",
    "largest_depth": "slow_time.largest_depth sets the steps of the explicit scheme, whatever the step axis says",
    "adaptive steps": "the adaptive scheme chooses its steps, whatever the step axis says",
    "adaptive wear": "the adaptive scheme takes the same steps for every wear_coefficient, at other cycle counts",
    "final steps": 'the scheme "final" takes no step of a given length, whatever the step axis says',
    "final wear": 'the scheme "final" comes to the same state for every wear_coefficient',
    "equal products": "wear_coefficient times step is that of another point: the same history at other cycle counts",
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
    unworn: whether nothing wears, so that the state at cycle 0 holds for all cycles.
    """

    histories: tuple[tuple[Choice, ...], ...]
    unworn: bool = False


@dataclass(frozen=True)
class Sharing:
    """What is computed from each start state of a study.

    tasks: groups of choices; every choice is in one history of one group. causes: number of choices by reason for
    sharing.
    """

    tasks: tuple[Alike, ...]
    causes: Counter[str]


def describe_left_out(causes: Mapping[str, int]) -> tuple[LeftOut, ...]:
    """Numbers of points that are not computed alone, by reason. causes: these numbers by the name of the reason."""
    return tuple(LeftOut(causes[cause], reason) for cause, reason in _REASONS.items() if causes.get(cause))


def share_histories(study: Study) -> Sharing:
    """The histories of a study that have to be computed; with `shortcuts = false` no history is shared."""
    axes, slow_time, proportional = study.axes, study.slow_time, study.wear_law.proportional
    choices = itertools.product(range(len(axes.wear_coefficient)), range(len(axes.step)), range(len(axes.scheme)))
    if not study.solver.shortcuts:
        return Sharing(tuple(Alike(((choice,),)) for choice in choices), Counter())
    tasks: list[Alike] = []
    causes: Counter[str] = Counter()
    idle: dict[tuple[str, int], list[Choice]] = {}
    fixed: dict[int, list[Choice]] = {}
    for choice in choices:
        wear, _, place = choice
        scheme = axes.scheme[place]
        if study.cycles_kept[-1] == 0.0:
            idle.setdefault(("cycles", wear), []).append(choice)
        elif proportional and axes.wear_coefficient[wear] == 0.0:
            idle.setdefault(("wear_coefficient", wear), []).append(choice)
        elif scheme in ("adaptive", "final"):
            idle.setdefault((f"{scheme} steps", wear), []).append(choice)
        elif scheme == "explicit" and slow_time.largest_depth is not None:
            # The last of the steps by Eq. (22) is shortened, so that other wear coefficients have other histories.
            idle.setdefault(("largest_depth", wear), []).append(choice)
        else:
            fixed.setdefault(place, []).append(choice)
    free: dict[str, list[tuple[Choice, ...]]] = {"adaptive steps": [], "final steps": []}
    for (cause, _), members in idle.items():
        causes[cause] += len(members) - 1
        if cause in free:
            free[cause].append(tuple(members))
        else:
            tasks.append(Alike((tuple(members),), unworn=cause != "largest_depth"))
    if not proportional:
        tasks += [Alike((same,)) for same in itertools.chain.from_iterable(free.values())]
        tasks += [Alike(((choice,),)) for choice in itertools.chain.from_iterable(fixed.values())]
        free, fixed = {}, {}
    for cause, lines in free.items():
        if lines:
            farthest_first = sorted(lines, key=lambda members: -axes.wear_coefficient[members[0][0]])
            tasks.append(Alike(tuple(farthest_first)))
            causes[cause.replace("steps", "wear")] += len(lines) - 1
    for of_scheme in fixed.values():
        for same in _same_products(study, of_scheme):
            tasks.append(Alike(tuple((choice,) for choice in same)))
            causes["equal products"] += len(same) - 1
    tasks.sort(key=lambda alike: min(itertools.chain.from_iterable(alike.histories)))
    return Sharing(tuple(tasks), causes)


def rtol_is_idle(study: Study, harmonics: int | Automatic, samples: int | Automatic) -> bool:
    """Whether `rtol` has no effect with these harmonics and samples, so that its values share their histories."""
    return (
        study.solver.shortcuts
        and AUTO not in (harmonics, samples)
        and not {"adaptive", "final"} & set(study.axes.scheme)
    )


def _same_products(study: Study, choices: Iterable[Choice]) -> Iterator[tuple[Choice, ...]]:
    """Groups of choices with the same history, for one scheme with steps of given length; longest history first.

    The last step of a history is shortened to end at the last cycle count. A history whose shortened last step is no
    whole step of the longer history is not part of the longer history.
    """
    wears, steps = study.axes.wear_coefficient, study.axes.step

    def product(choice: Choice) -> float:
        return wears[choice[0]] * steps[choice[1]]

    groups: list[list[Choice]] = []
    for choice in sorted(choices, key=lambda choice: (product(choice), choice)):
        if groups and math.isclose(product(choice), product(groups[-1][0]), rel_tol=_SAME):
            groups[-1].append(choice)
        else:
            groups.append([choice])
    for group in groups:
        farthest, *others = sorted(group, key=lambda choice: -wears[choice[0]])
        # integration to the steady state has no shortened last step
        whole = [
            choice
            for choice in others
            if study.to_the_end or _whole_number(study.cycles_kept[-1] / steps[choice[1]]) is not None
        ]
        yield (farthest, *whole)
        yield from ((choice,) for choice in others if choice not in whole)


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
