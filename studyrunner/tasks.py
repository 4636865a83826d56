"""Study -> tasks: the branches to follow and the points to march from them, and what is left out and why."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field

from studyrunner.costs import Kin
from studyrunner.estimate import (
    AUTOMATIC_HARMONICS,
    ITERATIONS_A_STATE,
    ITERATIONS_A_STEP,
    ITERATIONS_AT_FIRST,
    seconds_an_iteration,
)
from studyrunner.study import AUTO, SOLVER_AXES, Automatic, Study
from studyrunner.variables import ASKED, CERTIFICATE

Index = tuple[int, ...]

BRANCHES, MARCHES, RESTING = "branch", "march", "march without motion"
"""First keys of the kin of tasks, see LearnedCosts."""

_NEIGHBOURS = 4  # frequencies whose marches take about as long
_FOR_THE_TABLE = (*CERTIFICATE, "stable")  # at the end of a run, whatever the result file holds


@dataclass(frozen=True)
class Settings:
    """Solver keys of a task."""

    harmonics: int | Automatic
    samples: int | Automatic
    tolerance: float
    rtol: float


@dataclass(frozen=True)
class BranchTask:
    """One branch along all frequencies (Hz, ascending), at one excitation amplitude (N); a result at each of them.

    number: of the branch in the study. cost: estimated seconds.
    """

    number: int
    excitation_amplitude: float
    sweep: str
    settings: Settings
    frequencies: tuple[float, ...]
    cost: float

    @property
    def n_results(self) -> int:
        """Start states that it gives."""
        return len(self.frequencies)

    @property
    def opens_others(self) -> bool:
        """Marches."""
        return True

    @property
    def kind(self) -> str:
        """First key of its kin."""
        return BRANCHES

    @property
    def kin(self) -> Kin:
        """What its states cost, in general and on this branch."""
        return ((self.kind, (self.kind, self.number)),)


@dataclass(frozen=True)
class MarchTask:
    """One wear history from a start state on a branch.

    branch, position: number of the branch and place of the frequency in it. held: nothing wears, so the state at
    cycle 0 holds for all cycles; step and scheme are then those of the first point.
    cycles: output counts. points: indices, along the dimensions of the study, of all points that have this history.
    variables: what is handed back. cost: estimated seconds. n_unknowns, moves: of the start state, see StartResult.
        Until it is there, n_unknowns are those planned for and something moves.
    start: start state, None until its branch has reached it.
    number: of the march in the study.
    """

    number: int
    branch: int
    position: int
    settings: Settings
    wear_coefficient: float
    step: float
    scheme: str
    largest_depth: float | None
    held: bool
    cycles: tuple[float, ...]
    points: tuple[Index, ...]
    variables: tuple[str, ...]
    cost: float
    n_unknowns: int
    moves: bool = True
    start: object = field(default=None, compare=False)

    @property
    def n_results(self) -> int:
        """One history."""
        return 1

    @property
    def opens_others(self) -> bool:
        """Nothing."""
        return False

    @property
    def kind(self) -> str:
        """First key of its kin."""
        return MARCHES if self.moves else RESTING

    @property
    def kin(self) -> Kin:
        """Marches from states that move or rest, with as many unknowns, near this state and from it; with such wear."""
        kind = self.kind
        near, here = (kind, self.branch, "near", self.position // _NEIGHBOURS), (kind, self.branch, self.position)
        wear = (kind, self.wear_coefficient, self.step, self.scheme)
        return ((kind, (kind, self.n_unknowns), near, here), (wear, (wear, near)))


@dataclass(frozen=True)
class LeftOut:
    """Points that are not computed on their own, and why."""

    n_points: int
    reason: str


@dataclass(frozen=True)
class TaskPlan:
    """All tasks of a study.

    marches: for each branch, the tasks that start from it. n_unknowns: in the largest task; an estimate where the
    number of harmonics is automatic.
    """

    branches: tuple[BranchTask, ...]
    marches: tuple[tuple[MarchTask, ...], ...]
    left_out: tuple[LeftOut, ...]
    n_points: int
    n_unknowns: int

    @property
    def cost(self) -> float:
        """Estimated seconds on one rank."""
        marches = itertools.chain.from_iterable(self.marches)
        return sum(task.cost for task in self.branches) + sum(task.cost for task in marches)

    def marches_from(self, branch: int, position: int) -> tuple[MarchTask, ...]:
        """The marches from one start state."""
        line = self.marches[branch]
        first, last = (side(line, position, key=lambda march: march.position) for side in (bisect_left, bisect_right))
        return line[first:last]


_HELD_FOR = {
    "cycles": "slow_time.cycles = 0 asks for the unworn states, the same for every step and scheme",
    "wear_coefficient": "wear_coefficient = 0 wears nothing, whatever the step and the scheme",
    "largest_depth": "slow_time.largest_depth sets the steps of the explicit scheme, whatever the step axis says",
}


def build_tasks(study: Study, n_displacements: int) -> TaskPlan:
    """Tasks of a study whose scene has `n_displacements` relative displacements.

    Points whose history is the same for a reason that the study itself shows share a task. Points with a solution of
    their own never do. The order and the numbers of the tasks depend on the study alone.
    """
    sizes = [len(values) for values in study.dimensions.values()]
    ascending = sorted(range(sizes[0]), key=lambda place: study.axes.frequency[place])
    branches: list[BranchTask] = []
    marches: list[tuple[MarchTask, ...]] = []
    counts = dict.fromkeys(_HELD_FOR, 0)
    numbers = itertools.count()
    for line in _lines(study):
        settings = _settings(study, line)
        n_unknowns = _unknowns(n_displacements, settings.harmonics)
        seconds = seconds_an_iteration(n_unknowns)
        branches.append(
            BranchTask(
                number=len(branches),
                excitation_amplitude=study.axes.excitation_amplitude[line[0]],
                sweep=study.axes.sweep[line[1]],
                settings=settings,
                frequencies=tuple(study.axes.frequency[place] for place in ascending),
                cost=seconds * (ITERATIONS_AT_FIRST + ITERATIONS_A_STATE * len(ascending)),
            )
        )
        marches.append(
            tuple(
                task
                for position, place in enumerate(ascending)
                for task in _marches(study, (len(marches), position), place, line, n_unknowns, counts, numbers)
            )
        )
    return TaskPlan(
        branches=tuple(branches),
        marches=tuple(marches),
        left_out=tuple(LeftOut(count, _HELD_FOR[cause]) for cause, count in counts.items() if count),
        n_points=math.prod(sizes),
        n_unknowns=max(_unknowns(n_displacements, harmonics) for harmonics in study.harmonics),
    )


def march_variables(study: Study) -> tuple[str, ...]:
    """Variables that a march hands back: those asked for and those that the table at the end is made of."""
    return tuple(name for name in ASKED if name in study.outputs.variables or name in _FOR_THE_TABLE)


def _lines(study: Study) -> Iterator[Index]:
    """Indices of excitation amplitude, sweep and solver keys: what a branch along the frequency is followed for."""
    solver = [len(values) for values in (study.harmonics, study.samples, study.tolerance, study.rtol)]
    sizes = (len(study.axes.excitation_amplitude), len(study.axes.sweep), *solver)
    return itertools.product(*(range(size) for size in sizes))


def _settings(study: Study, line: Index) -> Settings:
    harmonics, samples, tolerance, rtol = line[2:]
    return Settings(study.harmonics[harmonics], study.samples[samples], study.tolerance[tolerance], study.rtol[rtol])


def _unknowns(n_displacements: int, harmonics: int | Automatic) -> int:
    """Unknowns of a state with this number of harmonics, or with that which automatic ones take on average."""
    return n_displacements * (2 * (AUTOMATIC_HARMONICS if harmonics == AUTO else harmonics) + 1)


def _marches(
    study: Study,
    branch: tuple[int, int],
    frequency: int,
    line: Index,
    n_unknowns: int,
    counts: dict[str, int],
    numbers: Iterator[int],
) -> list[MarchTask]:
    """Tasks of all points at one frequency of one branch; adds the points that share one to `counts`, by cause."""
    axes, slow_time = study.axes, study.slow_time
    shared: dict[tuple[object, ...], list[Index]] = {}
    for wear, step, scheme in itertools.product(
        range(len(axes.wear_coefficient)), range(len(axes.step)), range(len(axes.scheme))
    ):
        cause: str | None = None
        key: tuple[object, ...] = (wear, step, scheme)
        if slow_time.cycles == 0.0:
            cause, key = "cycles", ("held", wear)
        elif axes.wear_coefficient[wear] == 0.0:
            cause, key = "wear_coefficient", ("held", wear)
        elif slow_time.largest_depth is not None and axes.scheme[scheme] == "explicit":
            cause, key = "largest_depth", (wear, "explicit")
        if key in shared and cause is not None:
            counts[cause] += 1
        shared.setdefault(key, []).append((wear, step, scheme))
    variables = march_variables(study)
    tasks = []
    for key, members in shared.items():
        wear, step, scheme = members[0]
        held = key[0] == "held"
        n_steps = 1 if held else math.ceil(study.cycles_kept[-1] / axes.step[step])
        tasks.append(
            MarchTask(
                number=next(numbers),
                branch=branch[0],
                position=branch[1],
                settings=_settings(study, line),
                wear_coefficient=axes.wear_coefficient[wear],
                step=axes.step[step],
                scheme=axes.scheme[scheme],
                largest_depth=slow_time.largest_depth if axes.scheme[scheme] == "explicit" else None,
                held=held,
                cycles=study.cycles_kept,
                points=tuple(_point(study, frequency, line, member) for member in members),
                variables=variables,
                cost=seconds_an_iteration(n_unknowns) * ITERATIONS_A_STEP * n_steps,
                n_unknowns=n_unknowns,
            )
        )
    return tasks


def _point(study: Study, frequency: int, line: Index, member: Index) -> Index:
    """Index of a point along the dimensions of the study."""
    places = dict(zip(("excitation_amplitude", "sweep", *SOLVER_AXES), line, strict=True))
    places.update(zip(("wear_coefficient", "step", "scheme"), member, strict=True))
    places["frequency"] = frequency
    return tuple(places[name] for name in study.dimensions)
