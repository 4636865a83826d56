"""Task -> result: the only importer of the solver."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

from solver.history import StartState, WearHistory
from solver.model import ReducedModel
from solver.outcome import Outcome
from solver.settings import SolverSettings
from studyrunner.results import MarchResult, StartResult
from studyrunner.tasks import BranchTask, MarchTask, Settings


@dataclass(frozen=True)
class Ending:
    """One way for a computation to end: its number and word in the result file and the sentence for the user."""

    number: int
    meaning: str
    sentence: str


CONVERGED = int(Outcome.CONVERGED)

_ROUND_OFF = 1e-10


def endings() -> tuple[Ending, ...]:
    """All ways for a computation to end, by number."""
    return tuple(Ending(int(outcome), outcome.meaning, outcome.sentence) for outcome in sorted(Outcome))


def build_evaluator(
    model: ReducedModel, friction_coefficient: float
) -> Callable[[BranchTask | MarchTask], Iterator[StartResult | MarchResult]]:
    """The function that does the tasks of a study on this model and gives their results one by one."""

    def evaluate(task: BranchTask | MarchTask) -> Iterator[StartResult | MarchResult]:
        if isinstance(task, BranchTask):
            yield from follow(model, friction_coefficient, task)
        else:
            yield march(model, friction_coefficient, task)

    return evaluate


def follow(model: ReducedModel, friction_coefficient: float, task: BranchTask) -> Iterator[StartResult]:
    """Start states of one branch, as the sweep reaches them."""
    # numba is loaded where a task runs, so that --plan and --help do without it.
    from solver.continuation import follow_branch

    branch = follow_branch(
        model,
        friction_coefficient,
        task.excitation_amplitude,
        np.array(task.frequencies),
        cast("Literal['up', 'down']", task.sweep),
        _solver_settings(task.settings),
    )
    n_displacements = int(np.count_nonzero(np.asarray(model.contact.dofs) >= 0))
    for position, start in branch:
        n_coefficients = 2 * len(start.resolution.orders) + 1
        n_unknowns = 0 if start.state is None else n_displacements * n_coefficients
        yield StartResult(position, start, _moves(start), n_unknowns)


def march(model: ReducedModel, friction_coefficient: float, task: MarchTask) -> MarchResult:
    """Wear history from the start state of the task."""
    from solver.march import march_wear

    if not isinstance(task.start, StartState):
        raise TypeError(f"task without a start state: {task}")
    wanted = (0.0,) if task.held else task.cycles
    # The march begins at cycle 0, whether that count is kept or not.
    counts = wanted if wanted[0] == 0.0 else (0.0, *wanted)
    history = march_wear(
        model,
        friction_coefficient,
        task.start,
        task.wear_coefficient,
        task.step,
        cast("Literal['explicit', 'implicit']", task.scheme),
        np.array(counts),
        _solver_settings(task.settings),
        largest_depth=task.largest_depth,
    )
    return build_result(task, history)


def build_result(task: MarchTask, history: WearHistory) -> MarchResult:
    """What the result file holds of a history: the output counts and variables that the task asks for."""
    if task.held:
        rows = np.zeros(len(task.cycles), dtype=np.int64)
    else:
        rows = np.arange(len(history.cycles) - len(task.cycles), len(history.cycles))
    failed = history.outcome is not Outcome.CONVERGED
    return MarchResult(
        points=task.points,
        outcome=int(history.outcome),
        values={name: _variable(history, name, failed)[rows] for name in task.variables},
        jump_cycle=history.jump_cycle,
        error_estimate=history.error_estimate,
        newton_iterations=history.newton_iterations,
        run_time=history.run_time,
        branch=history.branch,
        fold_frequency=history.fold_frequency,
        step_limit=history.step_limit,
        oscillates=history.oscillates,
    )


def _variable(history: WearHistory, name: str, failed: bool) -> NDArray[np.generic]:
    """A variable of the result, its first dimension the output counts of the history; empty of all where it failed."""
    values: NDArray[np.generic]
    if name == "response_amplitude":
        values = np.abs(history.response)
    elif name == "response_phase":
        values = np.angle(history.response)
    else:
        values = getattr(history, name)
    if failed:
        return np.full_like(values, np.nan if values.dtype.kind == "f" else 0)
    return values


def _moves(start: StartState) -> bool:
    """Whether the relative motion in the joint is more than the round-off of its mean; no where there is no state."""
    if start.state is None:
        return False
    motion_h = start.state.displacement_h
    return bool(np.linalg.norm(motion_h[:, :, 1:]) > _ROUND_OFF * np.linalg.norm(motion_h))


def _solver_settings(settings: Settings) -> SolverSettings:
    # "auto" goes through as it is: the solver has to know it.
    return SolverSettings(settings.harmonics, settings.samples, settings.tolerance, settings.rtol)


def describe_failures(outcomes: Mapping[int, int]) -> tuple[str, ...]:
    """One line for each way in which points failed: how many of them, and the sentence. outcomes: points by number."""
    counts = {ending: outcomes.get(ending.number, 0) for ending in endings() if ending.number != CONVERGED}
    return tuple(f"{count} x {ending.meaning}: {ending.sentence}" for ending, count in counts.items() if count)
