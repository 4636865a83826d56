"""Results of tasks: plain arrays that can be sent between ranks and written to the result file."""

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
    """Start state at one frequency of a branch.

    position: index of the frequency in the branch.
    start: state from which a wear history starts.
    moves: whether any pair slips or lifts; otherwise nothing wears.
    n_unknowns: number of unknowns of the state; 0 where there is no state.
    lost: fault of the machine that ended the computation; then this is no result. Empty without a fault.
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
        """Everything except the position, for a file."""
        return Packed(json.dumps([self.moves, self.n_unknowns, self.start.text]), self.start.arrays)


def unpack_start(position: int, packed: Packed) -> StartResult:
    """The start state from the output of `StartResult.pack`."""
    moves, n_unknowns, text = json.loads(packed.text)
    return StartResult(position, Packed(text, packed.arrays), moves, n_unknowns)


@dataclass(frozen=True)
class MarchResult:
    """One history of a task, and the points that have this history.

    points: indices along the dimensions of the study.
    values: variables of the result by name. Variables of `studyrunner.variables.KEPT` are single values, others are
        arrays with the dimensions of the variable after the axes. Values after `last_cycle` are NaN, or 0 in whole
        numbers. Missing variables are NaN, 0 or an empty text in the file.
    place: index of the history in the task.
    progress: progress of a history that was ended by its time limit.
    """

    points: tuple[Index, ...]
    values: Mapping[str, Any]
    place: int = 0
    progress: Packed | None = None

    @property
    def outcome(self) -> int:
        """Outcome of the computation, as a number of the result file."""
        return int(self.values["outcome"])

    @property
    def message(self) -> str:
        """Further facts on the outcome."""
        return str(self.values.get("message", ""))


Keep = Callable[[Packed | str], None]
"""Takes the progress of a task: data to continue from, or words."""

Evaluate = Callable[[BranchTask | MarchTask, Keep], Iterator[StartResult | MarchResult]]
"""Does a task: gives the results one by one and hands over the progress from time to time."""


def failed_result(task: MarchTask, place: int, outcome: int, message: str) -> MarchResult:
    """Result of a history that failed. place: index of the history in the task."""
    return MarchResult(task.histories[place].points, {"outcome": outcome, "message": message}, place)
