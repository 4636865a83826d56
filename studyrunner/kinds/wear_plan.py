"""Study of wear -> sweeps, and histories from their start states; which points share a history, and why.

The rates of all wear laws are proportional to the wear coefficient: dW/dt = k_w f(W), Eq. (7). With s k_w in place of
k_w the same states follow each other, each at the cycle count t / s. Where the scheme chooses its steps, a task
integrates the history of the largest k_w; the others are read from this one at the counts s t.
"""

import itertools
import math
from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.contact.wear_law import WearLaw
from solver.settings import ToTheEnd
from studyrunner.kinds.estimate import iterations_of_histories, iterations_of_sweep, seconds_of
from studyrunner.kinds.task import EQUAL_POINTS, Table, TaskPlan, Work, n_unknowns_of
from studyrunner.kinds.wear import Excitation, History, Integrated, Sweep
from studyrunner.study.study import Study
from studyrunner.variables import OWN_STEPS

MOST_TOGETHER = 4
"""Histories of one task, which share the adaptive history that given steps are compared with. It takes about as long as
one of them: with 4 a fifth more than with all, and another rank may take the rest."""

_MOST_KNOWN = (
    1000  # ways to share histories: with equal values most start states have the same, others one of their own
)

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


class _Histories(Sequence[History]):
    """The histories of a study, each made when it is asked for: `--plan` of 10^6 points takes a fifth of the memory."""

    def __init__(self, make: Callable[[], Iterator[History]], length: int, works: Callable[[], Iterator[Work]]) -> None:
        """works: what all of them take, by start state."""
        self._make, self._length, self.works = make, length, works

    def __len__(self) -> int:
        return self._length

    def __iter__(self) -> Iterator[History]:
        return self._make()

    def __getitem__(self, place: Any) -> Any:
        return tuple(self)[place]


@dataclass(frozen=True)
class _Starts:
    """Points in the order of their start states: by sweep, frequency and wear law.

    numbers, kinds (n,): of the points, and of what they differ in, places in `values`. bounds (n_groups + 1,): between
    points of one start state and wear law. sweep_of, position, laws: of these, by group.
    """

    numbers: NDArray[np.intp]
    kinds: NDArray[np.intp]
    values: Sequence[_Values]
    bounds: NDArray[np.intp]
    sweep_of: NDArray[np.intp]
    position: NDArray[np.intp]
    laws: Sequence[WearLaw]

    def __iter__(self) -> Iterator[tuple[int, int, WearLaw, NDArray[np.intp], tuple[int, ...]]]:
        """Sweep, position, law, numbers and kinds of each group."""
        groups = zip(self.sweep_of.tolist(), self.position.tolist(), self.laws, strict=True)
        for each, (begin, end) in zip(groups, itertools.pairwise(self.bounds.tolist()), strict=True):
            yield *each, self.numbers[begin:end], tuple(self.kinds[begin:end].tolist())


def _begins(*columns: NDArray[Any]) -> NDArray[np.intp]:
    """Places at which one of the columns (n,) has another value than before."""
    return np.flatnonzero(np.any([np.append(True, each[1:] != each[:-1]) for each in columns], axis=0))


def build_tasks(study: Study, table: Table) -> TaskPlan:
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
    sweeps, starts = _find_starts(study, table)

    @lru_cache(_MOST_KNOWN)
    def sharing(kinds: tuple[int, ...]) -> tuple[tuple[_Together, ...], Counter[str]]:
        return _share_histories(study, [starts.values[kind] for kind in kinds])

    causes, n_histories = Counter[str](), 0
    for *_, kinds in starts:
        tasks, shared = sharing(kinds)
        n_histories += len(tasks)
        causes.update(shared)
    left_out = {reason: causes[cause] for cause, reason in _REASONS.items() if causes[cause]}

    @lru_cache(_MOST_KNOWN)
    def effort(kinds: tuple[int, ...]) -> tuple[int, int, float, float]:
        tasks = sharing(kinds)[0]
        iterations = [each.iterations for each in tasks]
        return len(tasks), sum(len(each.integrated) for each in tasks), sum(iterations), max(iterations)

    def works() -> Iterator[Work]:
        for place, *_, kinds in starts:
            n_tasks, n_results, *iterations = effort(kinds)
            n_unknowns = sweeps[place].n_unknowns
            seconds, longest = (seconds_of(n_unknowns, number) for number in iterations)
            yield Work("history", n_tasks, n_results, n_unknowns, seconds, longest, place)

    histories = _Histories(lambda: _make_histories(sweeps, starts, sharing, outputs), n_histories, works)
    return TaskPlan(histories, left_out, table.points.n, tuple(sweeps))


def _find_starts(study: Study, table: Table) -> tuple[list[Sweep], _Starts]:
    """The sweeps of a study, and the points that begin from their states."""
    points, columns = table.points, table.columns
    own = columns["joint"], points.axis("excitation_amplitude"), points.axis("sweep"), columns["settings"]
    (case, cases), (line, lines) = points.walked(*own), points.walked(*own, columns["law"])
    kinds, values = points.walked(*map(points.axis, ("wear_coefficient", "step", "scheme")))
    places, frequencies = points.walked(columns["frequency"])
    frequency = np.array(frequencies)[places, 0]
    order = np.lexsort((line, frequency, case))
    case, line, frequency = case[order], line[order], frequency[order]
    groups, first = _begins(case, frequency, line), _begins(case, frequency)
    sweeps, sweep_of, position = list[Sweep](), np.empty(len(first), np.intp), np.zeros(len(first), np.intp)
    for begin, end in itertools.pairwise([*_begins(case[first]).tolist(), len(first)]):
        (joint,), amplitude, direction, settings = cases[case[first[begin]]]
        n_unknowns = n_unknowns_of(table.n_displacements[joint.scene], settings.harmonics)
        length = 1 if direction == "ramp" else end - begin
        one, whole = (iterations_of_sweep(direction, number) for number in (1, length))
        for place in range(begin, end, length):
            sweep_of[place : place + length], position[place : place + length] = len(sweeps), np.arange(length)
            sweep = Sweep(
                number=len(sweeps),
                scenes=(joint.scene,),
                settings=settings,
                cost=seconds_of(n_unknowns, whole),
                first_share=one / whole,
                n_unknowns=n_unknowns,
                joint=joint,
                excitation=Excitation(amplitude, direction, study.follow),
                frequencies=tuple(frequency[first[place : place + length]].tolist()),
            )
            sweeps.append(sweep)
    start = np.searchsorted(first, groups, side="right") - 1
    laws = [lines[place][-1] for place in line[groups].tolist()]
    of_points = points.numbers[order], kinds[order], [_Values(*each) for each in values], np.append(groups, len(order))
    return sweeps, _Starts(*of_points, sweep_of[start], position[start], laws)


def _make_histories(
    sweeps: Sequence[Sweep],
    starts: _Starts,
    sharing: Callable[[tuple[int, ...]], tuple[tuple[_Together, ...], Counter[str]]],
    outputs: Mapping[str, Any],
) -> Iterator[History]:
    """The histories from the start states of all sweeps, in their order. sharing: `_share_histories` of kinds."""
    number = itertools.count()
    for place, position, law, numbers, kinds in starts:
        sweep = sweeps[place]
        for together in sharing(kinds)[0]:
            yield History(
                number=next(number),
                scenes=sweep.scenes,
                settings=sweep.settings,
                cost=seconds_of(sweep.n_unknowns, together.iterations),
                n_unknowns=sweep.n_unknowns,
                indices=tuple(tuple(numbers[list(same)].tolist()) for same in together.points),
                joint=sweep.joint,
                excitation=sweep.excitation,
                law=law,
                sweep=place,
                position=position,
                frequency=sweep.frequencies[position],
                integrated=together.integrated,
                **outputs,
            )


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
