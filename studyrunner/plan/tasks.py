"""Tasks of a study: start states along a branch, wear histories that start from these states."""

from __future__ import annotations

import itertools
from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from solver.contact.wear_law import WearLaw
from solver.packing import Packed
from solver.settings import FollowedFrequency, SolverSettings, ToTheEnd, WearTarget
from studyrunner.plan.cost_model import CostKeys
from studyrunner.plan.estimate import (
    ITERATIONS_A_MODE_POINT,
    ITERATIONS_A_STATE,
    iterations_of_branch,
    iterations_of_mode,
)
from studyrunner.plan.sharing import Index, LeftOut, ScaledHistory, march_counts
from studyrunner.scene.drawn_contacts import ContactChange

if TYPE_CHECKING:
    from solver.model import ReducedModel
    from studyrunner.mpi.mapped_file import MappedFile

BRANCHES, MARCHES, RESTING = "branch", "march", "march without motion"
"""Most general keys of tasks in the cost model."""

_NEIGHBOURS = 4  # frequencies whose marches take about as long


@dataclass(frozen=True)
class Joint:
    """The joint that a task computes.

    scene: number of the scene (`studyrunner.scene.scene_set`).
    friction_coefficient: of all pairs; None where each pair has its own.
    contact: arrays of the contact interface that a sample draws, in place of those of the scene.
    """

    scene: int
    friction_coefficient: float | None
    contact: ContactChange = ()


@dataclass(frozen=True)
class BranchTask:
    """Start states along one branch; a result at each frequency. Or the points of a nonlinear mode over its amplitude.

    A sweep "up" or "down" passes all frequencies of a line. A "ramp" has a single frequency.

    number: number of the branch in the study.
    joint: scene and friction.
    excitation_amplitude: N.
    frequencies: Hz, ascending; along a nonlinear mode its amplitudes, m sqrt(kg).
    mode: number of the nonlinear mode whose points these are; None for forced vibration.
    cost: estimated time, s.
    follow: what the frequency follows in place of `frequencies`, whose only value is then the middle of the range.
    known: indices of the frequencies whose results are not needed, as an earlier run has left them or all histories
        that start from them.
    resume: progress of an earlier run; None to begin with the first frequency.
    key: hash of the branch in the file of the run.
    models: reduced models of `scenes`, or files with them, for a rank that does not have them.
    """

    number: int
    joint: Joint
    excitation_amplitude: float
    sweep: str
    settings: SolverSettings
    frequencies: tuple[float, ...]
    cost: float
    follow: FollowedFrequency | None = None
    mode: int | None = None
    known: frozenset[int] = frozenset()
    resume: Packed | None = field(default=None, compare=False, repr=False)
    key: str = field(default="", compare=False, repr=False)
    models: tuple[ReducedModel | MappedFile, ...] = field(default=(), compare=False, repr=False)

    @property
    def scenes(self) -> tuple[int, ...]:
        """Numbers of the scenes whose models the task needs."""
        return (self.joint.scene,)

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
        if self.mode is not None:
            share = iterations_of_mode(1) if first else ITERATIONS_A_MODE_POINT
            return self.cost * share / iterations_of_mode(self.n_results)
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
class PlannedBlock:
    """A block of a mission.

    joint: scene and friction. frequency: Hz; where it starts for a passage.
    passage: where the frequency stops, Hz, and its rate, Hz/s; None for steady vibration.
    cycles: in one mission. begin: "ramp", "up", "down" or "continue".
    """

    name: str
    joint: Joint
    frequency: float
    passage: tuple[float, float] | None
    excitation_amplitude: float
    cycles: float
    begin: str


@dataclass(frozen=True)
class MarchTask:
    """One wear history from a start state on a branch, and the histories of other points that are read from this one.

    Or one mission history, which finds the start states of its blocks itself.

    number: number of the task in the study.
    joint: scene and friction. law: wear law.
    branch, position: number of the branch, and index of the frequency in the branch.
    histories: one result each. The first history is integrated; it needs the most cycles.
    held: whether nothing wears, so that the state at cycle 0 holds for all cycles. Step and scheme are then those of
        the first point.
    cycles: cycle counts of the output of every history, or numbers of missions.
    blocks: of a mission; none for one vibration. sweep: how the first mission begins where its first block continues.
    until: wear at which the history ends before the last count.
    follow: what the frequency follows; None for the frequency of the start state.
    to_the_end: integration until nothing wears any more. Then `cycles` numbers the outputs.
    variables: names of the variables in a result. loops: pairs whose fretting loops are among them.
    cost: estimated time, s.
    n_unknowns, moves: of the start state, see StartResult; planned values until the start state is there.
    start: start state; None until the branch has reached it.
    resume: progress of an earlier run; None to begin with the start state.
    key: hash of the task in the file of the run.
    models: reduced models of `scenes`, or files with them, for a rank that does not have them.
    """

    number: int
    joint: Joint
    law: WearLaw
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
    follow: FollowedFrequency | None = None
    until: WearTarget | None = None
    to_the_end: ToTheEnd | None = None
    blocks: tuple[PlannedBlock, ...] = ()
    sweep: str = ""
    start: Packed | None = field(default=None, compare=False, repr=False)
    resume: Packed | None = field(default=None, compare=False, repr=False)
    key: str = field(default="", compare=False, repr=False)
    models: tuple[ReducedModel | MappedFile, ...] = field(default=(), compare=False, repr=False)

    @property
    def scenes(self) -> tuple[int, ...]:
        """Numbers of the scenes whose models the task needs."""
        return tuple(sorted({joint.scene for joint in (self.joint, *(block.joint for block in self.blocks))}))

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

    branches: tasks of the start states; a study of missions has a single one without states.
    marches: for each branch the tasks of the wear histories, by frequency.
    left_out: points that share a history, by reason.
    n_points: number of points of the study.
    n_scenes: number of scenes.
    n_unknowns: number of unknowns of the largest task; an estimate where the number of harmonics is automatic.
    """

    branches: tuple[BranchTask, ...]
    marches: tuple[tuple[MarchTask, ...], ...]
    left_out: tuple[LeftOut, ...]
    n_points: int
    n_scenes: int
    n_unknowns: int

    @property
    def cost(self) -> float:
        """Estimated time on one rank, s, where every point wears."""
        marches = itertools.chain.from_iterable(self.marches)
        return sum(task.cost for task in self.branches) + sum(task.cost for task in marches)

    @property
    def longest(self) -> float:
        """Estimated time, s, of the longest branch with a history from it, which cannot be computed side by side."""
        return max(
            branch.cost + max((task.cost for task in line), default=0.0)
            for branch, line in zip(self.branches, self.marches, strict=True)
        )

    @property
    def n_missions(self) -> int:
        """Number of mission histories."""
        return sum(bool(march.blocks) for line in self.marches for march in line)

    def frequency_of(self, march: MarchTask) -> float:
        """Frequency at which a wear history begins, Hz."""
        if march.blocks:
            return march.blocks[0].frequency
        return self.branches[march.branch].frequencies[march.position]

    def marches_from(self, branch: int, position: int) -> tuple[MarchTask, ...]:
        """Tasks of the wear histories from one start state."""
        line = self.marches[branch]
        first, last = (side(line, position, key=lambda march: march.position) for side in (bisect_left, bisect_right))
        return line[first:last]
