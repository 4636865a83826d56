"""Study of wear -> sweeps, and histories from their start states."""

import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from typing import Any

from solver.settings import ToTheEnd
from studyrunner.kinds.estimate import seconds_of
from studyrunner.kinds.task import TaskPlan, Work
from studyrunner.kinds.wear.allowable import COST_OF_A_HISTORY, HISTORIES_OF_SEARCH, AllowableAmplitude
from studyrunner.kinds.wear.effort import iterations_of
from studyrunner.kinds.wear.histories import History, Integrated, Sweep
from studyrunner.kinds.wear.kind import ALLOWED
from studyrunner.kinds.wear.sharing import REASONS, Together, Values, n_energies, share_histories
from studyrunner.kinds.wear.starts import Group, Starts, find_starts
from studyrunner.points.table import Points
from studyrunner.study.study import Study
from studyrunner.system.progress import count

# with equal values most start states have the same way to share histories, others one of their own
_MOST_KNOWN = 1000

_Sharing = Callable[[tuple[Values, ...]], tuple[tuple[Together, ...], Counter[str]]]
"""`share_histories` of a study: most start states have points with the same values."""


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
    sharing: _Sharing = lru_cache(_MOST_KNOWN)(partial(share_histories, study))
    find = partial(find_starts, study, points, n_displacements)
    starts = find()
    if study.allowable:
        searches = list(_searches(study, starts, outputs))
        return TaskPlan(partial(iter, searches), [search.work for search in searches], {}, points.n)
    costs, times, works, alike = starts.costs, starts.an_iteration, starts.works, starts.alike()
    # what makes sweeps and groups takes memory that is wanted below
    del starts
    causes, n_tasks, n_integrated, seconds, longest = Counter[str](), 0, 0, 0.0, 0.0
    for sweeps, values in alike:
        tasks, shared = sharing(values)
        causes.update({cause: len(sweeps) * number for cause, number in shared.items()})
        n_tasks += len(sweeps) * len(tasks)
        n_integrated += len(sweeps) * sum(len(each.integrated) for each in tasks)
        iterations, an_iteration = [each.iterations for each in tasks], times[sweeps]
        seconds += sum(iterations) * float(an_iteration.sum())
        longest = max(longest, float((costs[sweeps] + max(iterations) * an_iteration).max()))
    left_out = {reason: causes[cause] for cause, reason in REASONS.items() if causes[cause]}
    n_unknowns = max(each.n_unknowns for each in works)
    work = Work("history", n_tasks, n_integrated, n_unknowns, seconds, longest)
    # found again where they are made: a plan alone takes no memory for them
    return TaskPlan(
        lambda: _make_histories(find(), sharing, outputs),
        [*works, work],
        left_out,
        points.n,
        lambda: map((starts := find()).make, range(starts.n)),
    )


def _make_histories(starts: Starts, sharing: _Sharing, outputs: Mapping[str, Any]) -> Iterator[History]:
    """The histories of a study, in the order of their start states."""
    number, sweep_of = itertools.count(), lru_cache(1)(starts.make)
    for group in starts.groups():
        sweep = sweep_of(group.sweep)
        for together in sharing(group.values)[0]:
            own = {
                "cost": seconds_of(sweep.n_unknowns, together.iterations, sweep.joint.n_sectors),
                "indices": tuple(tuple(group.numbers[list(same)].tolist()) for same in together.points),
                "integrated": together.integrated,
            }
            yield _history(sweep, group, number=next(number), **own, **outputs)


def _history(sweep: Sweep, group: Group, **own: Any) -> History:
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


def _searches(study: Study, starts: Starts, outputs: Mapping[str, Any]) -> Iterator[AllowableAmplitude]:
    """The searches for allowable amplitudes, one for equal points, each with all histories that it takes."""
    number, depth = itertools.count(), study.slow_time.largest_depth
    outputs = {**outputs, "variables": tuple(name for name in study.recorded if name not in ALLOWED)}
    for group in starts.groups():
        sweep, values = starts.make(group.sweep), group.values
        for value in dict.fromkeys(values):
            same = [place for place, each in zip(group.numbers.tolist(), values, strict=True) if each == value]
            largest = depth if value.scheme == "explicit" else None
            integrated = Integrated(value.scheme, value.step, largest, (value.wear_coefficient,), unworn=False)
            iterations = iterations_of([(value.scheme, value.step)], study.output_counts[-1], n_energies(study))
            cost = sweep.cost * sweep.first_share + seconds_of(sweep.n_unknowns, iterations, sweep.joint.n_sectors)
            cost *= HISTORIES_OF_SEARCH * COST_OF_A_HISTORY
            own = {"cost": cost, "indices": (tuple(same),), "integrated": (integrated,)}
            yield AllowableAmplitude.of(_history(sweep, group, number=next(number), **own, **outputs))


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
