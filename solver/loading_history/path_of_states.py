"""What a sweep goes along: states at the values of a parameter, and the steps from one to the next."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, TypeVar

from solver.accuracy.error_estimate import Estimate
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.packing import packable
from solver.settings import Resolution
from solver.structure.joint import Case

KEPT_NODES = 3
"""Last nodes that a sweep keeps: the next one is predicted on the parabola through them. With two, and a straight line,
the nodes of the slider take 7 % more iterations."""


class OnPath(Protocol):
    """A state at a value of the parameter of its path."""

    @property
    def parameter(self) -> float:
        """Value of the parameter."""


S = TypeVar("S", bound=OnPath)


@dataclass(frozen=True)
class Step(Generic[S]):
    """End of a step: the state reached, and values of the parameter at the folds that the step has jumped over."""

    state: S
    folds: tuple[float, ...] = ()


class Path(Protocol[S]):
    """The joint along a parameter, with the harmonics and samples of its case."""

    @property
    def case(self) -> Case:
        """Model and settings."""

    @property
    def steps(self) -> tuple[float, float, float]:
        """Shortest and longest step, and the one at which a state that is not found is left to `rescue`."""

    @property
    def node_tolerance(self) -> float:
        """Tolerance of the scaled residual of a node; reported states are solved to that of the settings."""

    def ahead(self, parameter: float, length: float) -> float:
        """The parameter a step farther; length: below 0 for a step down."""

    def solve(self, states: tuple[S, ...], target: float, run: Run) -> S | None:
        """Stable state at a target near the last of some states, which leaves its history to it; None if not found."""

    def rescue(self, start: S, target: float, run: Run) -> Step[S] | Outcome:
        """State at a target that `solve` does not find, or why there is none."""

    def change(self, before: S, after: S, wider: float) -> float:
        """Change over a step, over the largest change allowed times `wider`."""

    def rests(self, state: S) -> bool:
        """Whether no pair slips or opens within the period."""

    def forgets(self, state: S) -> bool:
        """Whether each pair slips or opens within the period, so that the state follows from its parameter alone."""

    def differs(self, before: S, after: S) -> float:
        """Relative change of the vibration between two states."""

    def at(self, resolution: Resolution) -> Path[S]:
        """The path with other harmonics and samples."""

    def move(self, state: S, other: Any, run: Run) -> S | None:
        """The state with the harmonics and samples of another path; None where not found."""

    def choose(self, state: S, run: Run) -> tuple[Path[S], S, Estimate]:
        """Path and state with the harmonics that the state needs, or the most allowed, and its estimated error."""

    def suffices(self, checked: S, error: float, state: S) -> bool:
        """Whether the harmonics chosen for an earlier state, with an estimated error, are about those of a state."""

    def describe(self, state: S) -> str:
        """Where the path is, in words."""


@packable
@dataclass(frozen=True)
class Nodes:
    """The last nodes of a sweep, with equal harmonics, the current one last; none where there is no state."""

    resolution: Resolution
    states: tuple[Any, ...] = ()

    def then(self, state: Any) -> Nodes:
        """With one node more."""
        return replace(self, states=(*self.states, state)[-KEPT_NODES:])
