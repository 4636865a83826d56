"""What a task hands back: plain arrays, ready to be sent between ranks and put into the result."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from solver.packing import Packed
from studyrunner.plan.sharing import Index
from studyrunner.plan.tasks import BranchTask, MarchTask


@dataclass(frozen=True)
class StartResult:
    """Start state at one frequency of a branch; a branch gives one after the other.

    position: place of the frequency in the branch. start: what a march starts from. moves: whether anything slips or
    lifts in the joint; where nothing does nothing wears. n_unknowns: of the state, with the harmonics that it took; 0
    where there is no state. lost: the fault of the machine that it broke off with: then this is no result.
    """

    position: int
    start: Packed
    moves: bool
    n_unknowns: int
    lost: str = ""

    @property
    def failed(self) -> bool:
        """Whether there is no state."""
        return self.n_unknowns == 0

    def pack(self) -> Packed:
        """All but the position, for a file."""
        return Packed(json.dumps([self.moves, self.n_unknowns, self.start.text]), self.start.arrays)


def unpack_start(position: int, packed: Packed) -> StartResult:
    """What `StartResult.pack` gave."""
    moves, n_unknowns, text = json.loads(packed.text)
    return StartResult(position, Packed(text, packed.arrays), moves, n_unknowns)


@dataclass(frozen=True)
class MarchResult:
    """One history of a task, and the points that have it.

    values: variables of the result by name: those of `studyrunner.variables.KEPT`, which have no further dimensions,
        and arrays with the dimensions of the variable after the axes; after `last_cycle` these are NaN, or 0 where the
        variable is a whole number. What is not there is not known: NaN, 0 or an empty text in the file.
    place: its own among the histories of the task. progress: how far a march was that was given up for its time.
    """

    points: tuple[Index, ...]
    values: Mapping[str, Any]
    place: int = 0
    progress: Packed | None = None

    @property
    def outcome(self) -> int:
        """How the computation ended, a number of the result file."""
        return int(self.values["outcome"])

    @property
    def message(self) -> str:
        """What the outcome does not say by itself."""
        return str(self.values.get("message", ""))


Keep = Callable[[Packed | str], None]
"""Takes note of how far a task is."""

Evaluate = Callable[[BranchTask | MarchTask, Keep], Iterator[StartResult | MarchResult]]
"""Does a task: gives its results one by one, and hands over now and then how far it is."""


def failed_result(task: MarchTask, place: int, outcome: int, message: str) -> MarchResult:
    """Result of a history that nobody computed to its end. place: its own among the histories of the task."""
    return MarchResult(task.histories[place].points, {"outcome": outcome, "message": message}, place)
