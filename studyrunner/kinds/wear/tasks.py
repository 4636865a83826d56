"""Study of wear -> sweeps, and histories from their start states; which points share a history, and why.

The rates of all wear laws but "power" are proportional to the wear coefficient, where the contact does not change with
the energy that friction dissipates: dW/dt = k_w f(W), Eq. (7). With s k_w
in place of k_w the same states follow each other, each at the cycle count t / s. Where the scheme chooses its steps, a
task integrates the history of the largest k_w; the others are read from this one at the counts s t.
"""

import itertools
import math
from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.contact.wear_law import WearLaw
from solver.settings import ToTheEnd
from studyrunner.kinds.estimate import A_STATE, iterations_of_sweep, seconds_of
from studyrunner.kinds.task import EQUAL_POINTS, TaskPlan, Work, n_unknowns_of
from studyrunner.kinds.wear.allowable import COST_OF_A_HISTORY, HISTORIES_OF_SEARCH, AllowableAmplitude
from studyrunner.kinds.wear.effort import iterations_of
from studyrunner.kinds.wear.histories import Excitation, History, Integrated, Sweep
from studyrunner.kinds.wear.kind import ALLOWED, OWN_STEPS
from studyrunner.points.table import Points
from studyrunner.study.study import Study
from studyrunner.system.progress import count

MOST_TOGETHER = 4
"""Histories of one task, which share the adaptive history that given steps are compared with. It takes about as long as
one of them: with 4 a fifth more than with all, and another rank may take the rest."""

_AT_ONCE = 4096  # groups of points: a million Python numbers take 30 MB

# ways to share histories: with equal values most start states have the same, others one of their own
_MOST_KNOWN = 1000

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


_Shared = tuple[Integrated, tuple[tuple[int, ...], ...]]
"""A history that is integrated, and which points, by their numbers, have each history that is read from it."""


class _Together(NamedTuple):
    """The histories of a task, by place which points have them, and how many Newton iterations they take."""

    integrated: tuple[Integrated, ...]
    points: tuple[tuple[int, ...], ...]
    iterations: float


class _Group(NamedTuple):
    """Points that begin from one start state with one wear law: their numbers, and what they differ in.

    sweep, position: of the start state, number of the sweep and place.
    """

    sweep: int
    position: int
    law: WearLaw
    numbers: NDArray[np.intp]
    values: tuple[_Values, ...]


class _Starts(NamedTuple):
    """The start states of a study. There may be as many as points, so that sweeps and groups are made anew each time.

    n: number of sweeps. make: a sweep. costs (n,), s; n_unknowns (n,); works: of the sweeps. groups: the points that
    begin from their states.
    """

    n: int
    make: Callable[[int], Sweep]
    costs: NDArray[np.float64]
    n_unknowns: NDArray[np.intp]
    works: Sequence[Work]
    groups: Callable[[], Iterator[_Group]]


_Sharing = Callable[[tuple[_Values, ...]], tuple[tuple[_Together, ...], Counter[str]]]
"""`_share_histories` of a study: most start states have points with the same values."""


def _begins(*columns: NDArray[Any]) -> NDArray[np.intp]:
    """Places at which one of the columns (n,) has another value than before."""
    return np.flatnonzero(np.any([np.append(True, each[1:] != each[:-1]) for each in columns], axis=0))


def build_tasks(study: Study, points: Points, n_displacements: Sequence[int]) -> TaskPlan:
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
    sharing: _Sharing = lru_cache(_MOST_KNOWN)(partial(_share_histories, study))
    starts = _find_starts(study, points, n_displacements)
    if study.allowable:
        searches = list(_searches(study, starts, outputs))
        works = [search.work for search in searches]
        return TaskPlan(partial(iter, searches), works, {}, points.n)
    causes, n_tasks, n_integrated, n_unknowns, seconds, longest = Counter[str](), 0, 0, 0, 0.0, 0.0
    of_sweeps, unknowns = starts.costs.tolist(), starts.n_unknowns.tolist()
    for sweep, *_, values in starts.groups():
        tasks, shared = sharing(values)
        if shared:
            causes.update(shared)
        costs = [seconds_of(unknowns[sweep], each.iterations) for each in tasks]
        n_tasks, n_integrated = n_tasks + len(tasks), n_integrated + sum([len(each.integrated) for each in tasks])
        n_unknowns, seconds = max(n_unknowns, unknowns[sweep]), seconds + sum(costs)
        longest = max(longest, of_sweeps[sweep] + max(costs))
    left_out = {reason: causes[cause] for cause, reason in _REASONS.items() if causes[cause]}
    work = Work("history", n_tasks, n_integrated, n_unknowns, seconds, longest)
    make = partial(_make_histories, starts, sharing, outputs)
    return TaskPlan(make, [*starts.works, work], left_out, points.n, lambda: map(starts.make, range(starts.n)))


def _find_starts(study: Study, points: Points, n_displacements: Sequence[int]) -> _Starts:
    """The start states of a study, and the points that begin from them."""
    columns = points.columns
    own = columns["joint"], points.axis("excitation_amplitude"), points.axis("sweep"), columns["settings"]
    (case, cases), (law, laws) = points.walked(*own), points.walked(columns["law"])
    kind, kinds = points.walked(*map(points.axis, ("wear_coefficient", "step", "scheme")))
    places, frequencies = points.walked(columns["hertz"])
    frequency = np.array(frequencies)[places, 0]
    order = np.lexsort((law, frequency, case))
    case, law, frequency = case[order], law[order], frequency[order]
    bounds, first = _begins(case, frequency, law), _begins(case, frequency)
    unknowns = np.array([n_unknowns_of(n_displacements[each[0][0].scene], each[-1].harmonics) for each in cases])
    is_ramp = np.array([direction == "ramp" for *_, direction, _ in cases])
    # a ramp gives a single state
    begins = np.flatnonzero((np.diff(case[first], prepend=-1) != 0) | is_ramp[case[first]])
    ends, of_case = np.append(begins[1:], len(first)), case[first[begins]]
    iterations = np.array([iterations_of_sweep(direction, 1) for *_, direction, _ in cases])
    whole = iterations[of_case] + A_STATE * (ends - begins - 1)
    costs = whole * np.array([seconds_of(number, 1.0) for number in unknowns.tolist()])[of_case]

    def make(number: int) -> Sweep:
        own = int(of_case[number])
        (joint,), amplitude, direction, settings = cases[own]
        return Sweep(
            number=number,
            scenes=(joint.scene,),
            settings=settings,
            cost=float(costs[number]),
            first_share=float(iterations[own] / whole[number]),
            n_unknowns=int(unknowns[own]),
            joint=joint,
            excitation=Excitation(amplitude, direction, study.follow),
            frequencies=tuple(frequency[first[begins[number] : ends[number]]].tolist()),
        )

    start, numbers, values = np.searchsorted(first, bounds, side="right") - 1, points.numbers[order], kind[order]
    sweep, known = np.searchsorted(begins, start, side="right") - 1, [_Values(*each) for each in kinds]

    def groups() -> Iterator[_Group]:
        rows = sweep, start - begins[sweep], law[bounds], bounds, np.append(bounds[1:], len(order))
        parts = (slice(first, first + _AT_ONCE) for first in range(0, len(bounds), _AT_ONCE))
        of_parts = (zip(*(each[part].tolist() for each in rows), strict=True) for part in parts)
        for number, position, of_law, begin, end in itertools.chain.from_iterable(of_parts):
            own_values = tuple([known[place] for place in values[begin:end].tolist()])
            yield _Group(number, position, laws[of_law][0], numbers[begin:end], own_values)

    works, lengths = [], ends - begins
    for way, wanted in (("sweep", False), ("ramp", True)):
        if (these := is_ramp[of_case] == wanted).any():
            most, of_these = unknowns[of_case[these]].max(), costs[these]
            totals = int(these.sum()), int(lengths[these].sum()), int(most)
            works.append(Work(way, *totals, float(of_these.sum()), float(of_these.max())))
    return _Starts(len(begins), make, costs, unknowns[of_case], works, groups)


def _make_histories(starts: _Starts, sharing: _Sharing, outputs: Mapping[str, Any]) -> Iterator[History]:
    """The histories of a study, in the order of their start states."""
    number, sweep_of = itertools.count(), lru_cache(1)(starts.make)
    for group in starts.groups():
        sweep = sweep_of(group.sweep)
        for together in sharing(group.values)[0]:
            own = {
                "cost": seconds_of(sweep.n_unknowns, together.iterations),
                "indices": tuple(tuple(group.numbers[list(same)].tolist()) for same in together.points),
                "integrated": together.integrated,
            }
            yield _history(sweep, group, number=next(number), **own, **outputs)


def _history(sweep: Sweep, group: _Group, **own: Any) -> History:
    """A history from the start state of a group."""
    return History(
        scenes=sweep.scenes,
        settings=sweep.settings,
        n_unknowns=sweep.n_unknowns,
        joint=sweep.joint,
        excitation=sweep.excitation,
        law=group.law,
        sweep=sweep.number,
        position=group.position,
        frequency=sweep.frequencies[group.position],
        **own,
    )


def _searches(study: Study, starts: _Starts, outputs: Mapping[str, Any]) -> Iterator[AllowableAmplitude]:
    """The searches for allowable amplitudes, one for equal points, each with all histories that it takes."""
    number, depth = itertools.count(), study.slow_time.largest_depth
    outputs = {**outputs, "variables": tuple(name for name in study.recorded if name not in ALLOWED)}
    for group in starts.groups():
        sweep, values = starts.make(group.sweep), group.values
        for value in dict.fromkeys(values):
            same = [place for place, each in zip(group.numbers.tolist(), values, strict=True) if each == value]
            largest = depth if value.scheme == "explicit" else None
            integrated = Integrated(value.scheme, value.step, largest, (value.wear_coefficient,), unworn=False)
            iterations = iterations_of([(value.scheme, value.step)], study.output_counts[-1], _n_energies(study))
            cost = sweep.cost * sweep.first_share + seconds_of(sweep.n_unknowns, iterations)
            cost *= HISTORIES_OF_SEARCH * COST_OF_A_HISTORY
            own = {"cost": cost, "indices": (tuple(same),), "integrated": (integrated,)}
            yield AllowableAmplitude.of(_history(sweep, group, number=next(number), **own, **outputs))


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


def _together(study: Study, shared: Sequence[_Shared]) -> Iterator[_Together]:
    groups: dict[object, list[_Shared]] = {}
    for each in shared:
        alone = each[0].unworn or not study.solver.shortcuts
        groups.setdefault(each if alone else each[0].wear_coefficients[0], []).append(each)
    for group in groups.values():
        for first in range(0, len(group), MOST_TOGETHER):
            integrated, points = zip(*group[first : first + MOST_TOGETHER], strict=True)
            cycles = 0.0 if integrated[0].unworn else math.inf if study.to_the_end else study.output_counts[-1]
            iterations = iterations_of([(each.scheme, each.step) for each in integrated], cycles, _n_energies(study))
            yield _Together(integrated, tuple(itertools.chain.from_iterable(points)), iterations)


def _n_energies(study: Study) -> int:
    return len(study.wear.evolution.energy) if study.wear.evolution else 0


WAYS = {
    "sweep": lambda n_tasks, n_results: f"{count(n_results, 'start state')} by {count(n_tasks, 'sweep')}",
    "ramp": lambda n_tasks, n_results: f"{count(n_results, 'start state')} by {count(n_tasks, 'ramp')}",
    "history": lambda _, n_results: count(n_results, "wear history", "wear histories"),
    "search": lambda _, n_results: count(n_results, "search for an amplitude", "searches for an amplitude"),
}


def plan_rows(study: Study) -> Iterator[tuple[str, str]]:
    """Rows of a plan on the frequency that is followed, and on the cycles."""
    n_stored, end = len(study.output_counts), study.output_counts[-1]
    if study.follow is not None:
        what = f"{study.follow.of}, found between {study.follow.low:g} and {study.follow.high:g} Hz by the sweep"
        yield "frequency", what if end == 0.0 else f"{what} and followed while the joint wears"
    if study.allowable:
        (quantity, value), *_ = (study.slow_time.until or {}).items()
        unit = {"wear_depth": "m", "worn_volume": "m3"}[quantity]
        met = f"the one with which {quantity} is {value:g} {unit} after {end:g} cycles"
        yield "amplitude", f"{met}, found by about {HISTORIES_OF_SEARCH} histories"
    if study.to_the_end:
        until = f"until the wear rate of every pair is below {study.slow_time.final_share:g} of its largest"
        yield "cycles", f"{until}; {n_stored} states are stored, spaced evenly in worn volume and cycles"
    else:
        yield "cycles", f"{end:g}, of which {count(n_stored, 'count is', 'counts are')} stored"
