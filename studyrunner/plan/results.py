"""What a task hands back: plain arrays, ready to be sent between ranks and put into the result."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studyrunner.plan.sharing import Index


@dataclass(frozen=True)
class Kept:
    """Something of the solver in a form that goes into a file: a text that refers to arrays by their place."""

    text: str
    arrays: tuple[NDArray[np.generic], ...]

    @property
    def n_bytes(self) -> int:
        """Size in a file."""
        return len(self.text) + sum(array.nbytes for array in self.arrays)


@dataclass(frozen=True)
class StartResult:
    """Start state at one frequency of a branch; a branch gives one after the other.

    position: place of the frequency in the branch. start: what a march starts from. moves: whether anything slips or
    lifts in the joint; where nothing does nothing wears. n_unknowns: of the state, with the harmonics that it took; 0
    where there is no state. lost: the fault of the machine that it broke off with: then this is no result.
    """

    position: int
    start: Kept
    moves: bool
    n_unknowns: int
    lost: str = ""

    @property
    def failed(self) -> bool:
        """Whether there is no state."""
        return self.n_unknowns == 0

    def keep(self) -> Kept:
        """All but the position, for a file."""
        return Kept(json.dumps([self.moves, self.n_unknowns, self.start.text]), self.start.arrays)


def read_start(position: int, kept: Kept) -> StartResult:
    """What `StartResult.keep` gave."""
    moves, n_unknowns, text = json.loads(kept.text)
    return StartResult(position, Kept(text, kept.arrays), moves, n_unknowns)


@dataclass(frozen=True)
class MarchResult:
    """One history of a task, and the points that have it.

    values: variable -> array with the dimensions of that variable after the axes; after `last_cycle` NaN, or 0 where
        the variable is a whole number.
    share: its place among the shares of the task. progress: how far a march was that was given up for its time.
    The others are variables of the result without further dimensions, see `studyrunner.variables.KEPT`.
    """

    points: tuple[Index, ...]
    outcome: int
    values: Mapping[str, NDArray[np.generic]]
    jump_cycle: float
    error_estimate: float
    newton_iterations: int
    run_time: float
    branch: int
    fold_frequency: float
    step_limit: float
    oscillates: bool
    last_cycle: float
    largest_wear_depth: float
    message: str = ""
    share: int = 0
    progress: Kept | None = None
