"""Study -> tasks: the branches to follow and the points to march from them, and what is left out and why."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field

from solver.packing import Packed
from solver.settings import Automatic, SolverSettings, ToTheEnd, WearTarget
from studyrunner.plan.cost_model import CostKeys
from studyrunner.plan.estimate import (
    AUTOMATIC_HARMONICS,
    ITERATIONS_A_STATE,
    iterations_of_branch,
    iterations_of_march,
    seconds_an_iteration,
)
from studyrunner.plan.sharing import (
    Alike,
    Choice,
    Index,
    LeftOut,
    ScaledHistory,
    Sharing,
    march_counts,
    rtol_is_idle,
    share_histories,
)
from studyrunner.study.sections import AUTO, SOLVER_AXES
from studyrunner.study.study import Study
from studyrunner.variables import ASKED, CERTIFICATE, COUNTS, LOOPS

BRANCHES, MARCHES, RESTING = "branch", "march", "march without motion"
"""Most general keys of tasks in the cost model."""

_NEIGHBOURS = 4  # frequencies whose marches take about as long
_FOR_THE_TABLE = (*CERTIFICATE, "stable")  # at the end of a run, whatever the result file holds


@dataclass(frozen=True)
class BranchTask:
    """Start states along one branch; a result at each frequency.

    A sweep "up" or "down" passes all frequencies of a line. A "ramp" has a single frequency.

    number: number of the branch in the study.
    excitation_amplitude: N.
    frequencies: Hz, ascending.
    cost: estimated time, s.
    known: indices of the frequencies whose results are not needed, as an earlier run has left them or all histories
        that start from them.
    resume: progress of an earlier run; None to begin with the first frequency.
    key: hash of the branch in the file of the run.
    """

    number: int
    excitation_amplitude: float
    sweep: str
    settings: SolverSettings
    frequencies: tuple[float, ...]
    cost: float
    known: frozenset[int] = frozenset()
    resume: Packed | None = field(default=None, compare=False, repr=False)
    key: str = field(default="", compare=False, repr=False)

    @property
    def order(self) -> tuple[int, ...]:
        """Indices of the frequencies in the order of the sweep."""
        places = range(len(self.frequencies))
        return tuple(reversed(places) if self.sweep == "down" else places)

    @property
    def order_left(self) -> tuple[int, ...]:
        """Indices of the frequencies whose results are needed."""
        return tuple(place for place in self.order if place not in self.known)

    @property
    def n_results(self) -> int:
        """Number of start states that the task gives."""
        return len(self.frequencies) - len(self.known)

    def cost_of(self, *, first: bool) -> float:
        """Estimated time, s, of the first state with the sweep to it, or of one of the other states."""
        share = iterations_of_branch(self.sweep, 1) if first else ITERATIONS_A_STATE
        return self.cost * share / iterations_of_branch(self.sweep, self.n_results)

    @property
    def opens_others(self) -> bool:
        """Wear histories start from the states of a branch."""
        return True

    @property
    def kind(self) -> str:
        """Most general key in the cost model."""
        return BRANCHES

    @property
    def cost_keys(self) -> CostKeys:
        """Groups of similar tasks: all branches, this branch."""
        return ((self.kind, (self.kind, self.number)),)


@dataclass(frozen=True)
class MarchTask:
    """One wear history from a start state on a branch, and the histories of other points that are read from this one.

    number: number of the task in the study.
    branch, position: number of the branch, and index of the frequency in the branch.
    histories: one result each. The first history is integrated; it needs the most cycles.
    held: whether nothing wears, so that the state at cycle 0 holds for all cycles. Step and scheme are then those of
        the first point.
    cycles: cycle counts of the output of every history.
    until: wear at which the history ends before the last count.
    to_the_end: integration until nothing wears any more. Then `cycles` numbers the outputs.
    variables: names of the variables in a result. loops: pairs whose fretting loops are among them.
    cost: estimated time, s.
    n_unknowns, moves: of the start state, see StartResult; planned values until the start state is there.
    start: start state; None until the branch has reached it.
    resume: progress of an earlier run; None to begin with the start state.
    key: hash of the task in the file of the run.
    """

    number: int
    branch: int
    position: int
    settings: SolverSettings
    scheme: str
    largest_depth: float | None
    histories: tuple[ScaledHistory, ...]
    held: bool
    cycles: tuple[float, ...]
    variables: tuple[str, ...]
    loops: tuple[int, ...]
    cost: float
    n_unknowns: int
    moves: bool = True
    until: WearTarget | None = None
    to_the_end: ToTheEnd | None = None
    start: Packed | None = field(default=None, compare=False, repr=False)
    resume: Packed | None = field(default=None, compare=False, repr=False)
    key: str = field(default="", compare=False, repr=False)

    @property
    def wear_coefficient(self) -> float:
        """Wear coefficient of the integrated history, 1/Pa."""
        return self.histories[0].wear_coefficient

    @property
    def step(self) -> float:
        """Step of the integrated history, cycles."""
        return self.histories[0].step

    @property
    def points(self) -> tuple[Index, ...]:
        """All points that get a history from the task."""
        return tuple(itertools.chain.from_iterable(scaled.points for scaled in self.histories))

    @property
    def n_results(self) -> int:
        """Number of histories that the task gives."""
        return len(self.histories)

    def counts(self, scaled: ScaledHistory) -> tuple[float, ...]:
        """Cycle counts of the integrated history at which a history is read, one for each of `cycles`."""
        if self.held:
            return (0.0,) * len(self.cycles)
        return march_counts(self.cycles, scaled, self.histories[0], self.scheme not in ("adaptive", "final"))

    def cost_of(self, *, first: bool) -> float:
        """Estimated time of a history, s; all histories of a task arrive with the first one."""
        del first
        return self.cost / self.n_results

    @property
    def opens_others(self) -> bool:
        """No task starts from a wear history."""
        return False

    @property
    def kind(self) -> str:
        """Most general key in the cost model."""
        return MARCHES if self.moves else RESTING

    @property
    def cost_keys(self) -> CostKeys:
        """Groups of similar tasks: by motion, unknowns and start state, and by wear coefficient, step and scheme."""
        kind = self.kind
        near, here = (kind, self.branch, "near", self.position // _NEIGHBOURS), (kind, self.branch, self.position)
        wear = (kind, self.wear_coefficient, self.step, self.scheme)
        return ((kind, (kind, self.n_unknowns), near, here), (wear, (wear, near)))


@dataclass(frozen=True)
class TaskPlan:
    """All tasks of a study.

    branches: tasks of the start states.
    marches: for each branch the tasks of the wear histories, by frequency.
    left_out: points that share a history, by reason.
    n_points: number of points of the study.
    n_unknowns: number of unknowns of the largest task; an estimate where the number of harmonics is automatic.
    """

    branches: tuple[BranchTask, ...]
    marches: tuple[tuple[MarchTask, ...], ...]
    left_out: tuple[LeftOut, ...]
    n_points: int
    n_unknowns: int

    @property
    def cost(self) -> float:
        """Estimated time on one rank, s, where every point wears."""
        marches = itertools.chain.from_iterable(self.marches)
        return sum(task.cost for task in self.branches) + sum(task.cost for task in marches)

    def marches_from(self, branch: int, position: int) -> tuple[MarchTask, ...]:
        """Tasks of the wear histories from one start state."""
        line = self.marches[branch]
        first, last = (side(line, position, key=lambda march: march.position) for side in (bisect_left, bisect_right))
        return line[first:last]


def build_tasks(study: Study, n_displacements: int) -> TaskPlan:
    """Tasks of a study whose scene has `n_displacements` relative displacements.

    Points whose history is the same for a reason that the study itself shows share a task, see `sharing`. Points with a
    solution of their own never do. The order and the numbers of the tasks depend on the study alone.
    """
    sizes = [len(values) for values in study.dimensions.values()]
    ascending = sorted(range(sizes[0]), key=lambda place: study.axes.frequency[place])
    branches: list[BranchTask] = []
    marches: list[tuple[MarchTask, ...]] = []
    sharing = share_histories(study)
    numbers = itertools.count()
    for lines in _lines(study):
        line = lines[0]
        settings = _settings(study, line)
        n_unknowns = _unknowns(n_displacements, settings.harmonics)
        seconds = seconds_an_iteration(n_unknowns)
        sweep = study.axes.sweep[line[1]]
        for places in _stretches(sweep, ascending):
            number = len(branches)
            branches.append(
                BranchTask(
                    number=number,
                    excitation_amplitude=study.axes.excitation_amplitude[line[0]],
                    sweep=sweep,
                    settings=settings,
                    frequencies=tuple(study.axes.frequency[place] for place in places),
                    cost=seconds * iterations_of_branch(sweep, len(places)),
                )
            )
            marches.append(
                tuple(
                    task
                    for position, place in enumerate(places)
                    for task in _marches(study, sharing, (number, position), place, lines, n_unknowns, numbers)
                )
            )
    return TaskPlan(
        branches=tuple(branches),
        marches=tuple(marches),
        left_out=sharing.left_out(sum(len(branch.frequencies) for branch in branches), math.prod(sizes)),
        n_points=math.prod(sizes),
        n_unknowns=max(_unknowns(n_displacements, harmonics) for harmonics in study.harmonics),
    )


def _stretches(sweep: str, ascending: list[int]) -> Iterator[list[int]]:
    """Places of the frequencies that one task reaches: each for itself where the excitation is raised at it."""
    if sweep == "ramp":
        yield from ([place] for place in ascending)
    else:
        yield ascending


def march_variables(study: Study) -> tuple[str, ...]:
    """Variables that a march hands back: those asked for and those that the table at the end is made of."""
    asked = (name for name in ASKED if name in study.outputs.variables or name in _FOR_THE_TABLE)
    return (*asked, *(LOOPS if study.outputs.loops else ()), *(COUNTS if study.to_the_end else ()))


def _lines(study: Study) -> Iterator[tuple[Index, ...]]:
    """Indices of excitation amplitude, sweep and solver keys: what a branch along the frequency is followed for.

    The indices of one branch differ in `rtol` only, where nothing uses that.
    """
    solver = [len(values) for values in (study.harmonics, study.samples, study.tolerance)]
    sizes = (len(study.axes.excitation_amplitude), len(study.axes.sweep), *solver)
    for line in itertools.product(*(range(size) for size in sizes)):
        lines = [(*line, rtol) for rtol in range(len(study.rtol))]
        if rtol_is_idle(study, study.harmonics[line[2]], study.samples[line[3]]):
            yield tuple(lines)
        else:
            yield from ((one,) for one in lines)


def _settings(study: Study, line: Index) -> SolverSettings:
    harmonics, samples, tolerance, rtol = line[2:]
    return SolverSettings(
        harmonics=study.harmonics[harmonics],
        samples=study.samples[samples],
        tolerance=study.tolerance[tolerance],
        rtol=study.rtol[rtol],
        time_limit=math.inf if study.solver.time_limit is None else study.solver.time_limit,
    )


def _unknowns(n_displacements: int, harmonics: int | Automatic) -> int:
    """Unknowns of a state with this number of harmonics, or with that which automatic ones take on average."""
    return n_displacements * (2 * (AUTOMATIC_HARMONICS if harmonics == AUTO else harmonics) + 1)


def _marches(
    study: Study,
    sharing: Sharing,
    branch: tuple[int, int],
    frequency: int,
    lines: tuple[Index, ...],
    n_unknowns: int,
    numbers: Iterator[int],
) -> Iterator[MarchTask]:
    """Tasks of all points at one frequency of one branch."""
    axes = study.axes
    for alike in sharing.marches:
        histories = _histories(study, alike, frequency, lines)
        scheme = axes.scheme[alike.histories[0][0][2]]
        cycles = 0.0 if alike.held else math.inf if study.to_the_end else study.cycles_kept[-1]
        end = ToTheEnd(len(study.cycles_kept), study.slow_time.final_share) if study.to_the_end else None
        yield MarchTask(
            number=next(numbers),
            branch=branch[0],
            position=branch[1],
            settings=_settings(study, lines[0]),
            scheme=scheme,
            largest_depth=study.slow_time.largest_depth if scheme == "explicit" else None,
            histories=histories,
            held=alike.held,
            cycles=study.cycles_kept,
            variables=march_variables(study),
            loops=study.outputs.loops,
            cost=seconds_an_iteration(n_unknowns) * iterations_of_march(scheme, cycles, histories[0].step),
            n_unknowns=n_unknowns,
            until=study.until,
            to_the_end=end,
        )


def _histories(study: Study, alike: Alike, frequency: int, lines: tuple[Index, ...]) -> tuple[ScaledHistory, ...]:
    """The histories of a march with their points."""
    return tuple(
        ScaledHistory(
            study.axes.wear_coefficient[choices[0][0]],
            study.axes.step[choices[0][1]],
            tuple(_point(study, frequency, line, choice) for line in lines for choice in choices),
        )
        for choices in alike.histories
    )


def _point(study: Study, frequency: int, line: Index, choice: Choice) -> Index:
    """Index of a point along the dimensions of the study."""
    places = dict(zip(("excitation_amplitude", "sweep", *SOLVER_AXES), line, strict=True))
    places.update(zip(("wear_coefficient", "step", "scheme"), choice, strict=True))
    places["frequency"] = frequency
    return tuple(places[name] for name in study.dimensions)
