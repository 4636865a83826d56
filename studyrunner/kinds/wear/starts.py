"""The start states of a study of wear, and the points that begin from them, as arrays: there may be a million."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.contact.wear_law import WearLaw
from solver.settings import SolverSettings
from studyrunner.kinds.estimate import A_STATE, iterations_of_sweep, seconds_of
from studyrunner.kinds.joint import TaskJoint
from studyrunner.kinds.task import Work, n_unknowns_of
from studyrunner.kinds.wear.histories import Excitation, Sweep
from studyrunner.kinds.wear.sharing import Values
from studyrunner.points.table import Combinations, Points
from studyrunner.study.design import CODE, Codes, group_rows
from studyrunner.study.study import Study

_AT_ONCE = 4096  # groups of points: a million Python numbers take 30 MB

_MOST_KNOWN = 1000  # different values that are made once
_MANY = 10  # start states with as many points, from which on these are compared: that takes as long as so many ways


class Group(NamedTuple):
    """Points that begin from one start state with one wear law: their numbers, and what they differ in.

    sweep, position: of the start state, number of the sweep and place.
    """

    sweep: int
    position: int
    law: WearLaw
    numbers: Codes
    values: tuple[Values, ...]


class Starts(NamedTuple):
    """The start states of a study. There may be as many as points, so that sweeps and groups are made anew each time.

    n: number of sweeps. make: a sweep. costs (n,), s; an_iteration (n,): time of one of Newton's method, s; works: of
    the sweeps. groups: the points that begin from their states. alike: for groups that take as many tasks and
    iterations the numbers of their sweeps, and what the points of one of them differ in.
    """

    n: int
    make: Callable[[int], Sweep]
    costs: NDArray[np.float64]
    an_iteration: NDArray[np.float64]
    works: Sequence[Work]
    groups: Callable[[], Iterator[Group]]
    alike: Callable[[], Iterator[tuple[Codes, tuple[Values, ...]]]]


def _begins(*columns: NDArray[Any]) -> Codes:
    """Places at which one of the columns (n,) has another value than before."""
    changes = (np.append(True, each[1:] != each[:-1]) for each in columns)
    return np.flatnonzero(np.logical_or.reduce([*changes])).astype(CODE)


def _last_up_to(places: Codes, ascending: Codes) -> Codes:
    """For each of ascending places the last of others, ascending, that does not lie behind it."""
    return np.searchsorted(ascending, places, side="right").astype(CODE) - 1


def find_starts(study: Study, points: Points, n_displacements: Sequence[int]) -> Starts:
    """The start states of a study, and the points that begin from them."""
    columns = points.columns
    own = columns["joint"], points.axis("excitation_amplitude"), points.axis("sweep"), columns["settings"]
    (case, cases), (law, laws) = points.walked(*own), points.walked(columns["law"])
    kind, kinds = points.walked(*map(points.axis, ("wear_coefficient", "step", "scheme")))
    frequency = points.values_walked(columns["hertz"])
    order = np.lexsort((law, frequency, case)).astype(CODE)
    case, law, frequency = case[order], law[order], frequency[order]
    bounds, first = _begins(case, frequency, law), _begins(case, frequency)

    def unknowns_of(joints: Sequence[TaskJoint], settings: SolverSettings) -> int:
        return n_unknowns_of(n_displacements[joints[0].scene], settings.harmonics)

    is_ramp = cases.each("ramp".__eq__, 2)
    # a ramp gives a single state
    begins = np.flatnonzero((np.diff(case[first], prepend=-1) != 0) | is_ramp[case[first]]).astype(CODE)
    ends, of_case = np.append(begins[1:], CODE(len(first))), case[first[begins]]
    whole = cases.each(lambda direction: CODE(iterations_of_sweep(direction, 1)), 2)[of_case]
    whole += A_STATE * (ends - begins - 1)

    def time_of(joints: Sequence[TaskJoint], settings: SolverSettings) -> float:
        return seconds_of(unknowns_of(joints, settings), 1.0, joints[0].n_sectors)

    an_iteration = cases.each(time_of, 0, 3)[of_case]
    costs = whole * an_iteration

    def make(number: int) -> Sweep:
        (joint,), amplitude, direction, settings = cases[int(of_case[number])]
        return Sweep(
            number=number,
            scenes=(joint.scene,),
            settings=settings,
            cost=float(costs[number]),
            first_share=float(iterations_of_sweep(direction, 1) / whole[number]),
            n_unknowns=unknowns_of((joint,), settings),
            joint=joint,
            excitation=Excitation(amplitude, direction, study.follow),
            frequencies=tuple(frequency[first[begins[number] : ends[number]]].tolist()),
        )

    numbers, values, known = points.numbers[order], kind[order], lru_cache(_MOST_KNOWN)(kinds.__getitem__)
    start, sweep = (_last_up_to(bounds, each) for each in (first, first[begins]))

    def groups() -> Iterator[Group]:
        rows = sweep, start - begins[sweep], law[bounds], bounds, np.append(bounds[1:], CODE(len(numbers)))
        parts = (slice(first, first + _AT_ONCE) for first in range(0, len(bounds), _AT_ONCE))
        of_parts = (zip(*(each[part].tolist() for each in rows), strict=True) for part in parts)
        for number, position, of_law, begin, end in itertools.chain.from_iterable(of_parts):
            own_values = tuple([Values(*known(place)) for place in values[begin:end].tolist()])
            yield Group(number, position, laws[of_law][0], numbers[begin:end], own_values)

    works, unknowns = [], cases.each(lambda *given: CODE(unknowns_of(*given)), 0, 3)[of_case]
    for way, wanted in (("sweep", False), ("ramp", True)):
        if (these := is_ramp[of_case] == wanted).any():
            totals = int(these.sum()), int((ends - begins)[these].sum()), int(unknowns[these].max())
            works.append(Work(way, *totals, float(costs[these].sum()), float(costs[these].max())))
    alike = partial(_alike, sweep, bounds, values, kinds)
    return Starts(len(begins), make, costs, an_iteration, works, groups, alike)


def _alike(sweep: Codes, bounds: Codes, kind: Codes, kinds: Combinations) -> Iterator[tuple[Codes, tuple[Values, ...]]]:
    """Groups whose points differ in the same way, see `Starts`: as many, with as many equal wear coefficients, some of
    them 0, and the same steps and schemes.

    sweep, bounds (n_groups,): number of the sweep, and first place, of each. kind (n,): numbers of the points in kinds.
    """
    sizes = np.diff(bounds, append=CODE(len(kind)))
    group, wear = np.repeat(np.arange(len(bounds), dtype=CODE), sizes), np.array(kinds.values[0])[kinds.places[0]][kind]
    steps = kinds.codes(1, 2)[1][kind]
    order = np.lexsort((steps, wear, group)).astype(CODE)
    wear, steps = wear[order], steps[order]
    rank = np.zeros(len(kind), CODE)
    rank[_begins(group, wear)] = 1
    rank = np.cumsum(rank, dtype=CODE)
    codes = 2 * (rank - rank[bounds[group]]) + (wear == 0.0)
    codes = codes.astype(np.int64) * (steps.max() + 1) + steps
    n_codes = int(codes.max()) + 1
    del group, wear, steps, order, rank
    for size in np.unique(sizes).tolist():
        groups = np.flatnonzero(sizes == size)
        first = rows = np.arange(len(groups))
        if len(groups) > _MANY:
            first, rows = group_rows((codes[bounds[groups] + place], n_codes) for place in range(size))
        parts = np.split(np.argsort(rows, kind="stable"), np.cumsum(np.bincount(rows))[:-1])
        for begin, same in zip(bounds[groups[first]].tolist(), parts, strict=True):
            yield sweep[groups[same]], tuple([Values(*kinds[place]) for place in kind[begin : begin + size].tolist()])
