"""Task -> result: the only importer of the solver."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

from solver.history import StartState, WearHistory
from solver.model import ReducedModel
from solver.outcome import Outcome, describe_error
from solver.packed import Packed
from solver.settings import Resolution, SolverSettings
from studyrunner.records import failed_result
from studyrunner.results import Kept, MarchResult, StartResult
from studyrunner.tasks import BranchTask, MarchTask, Settings


@dataclass(frozen=True)
class Ending:
    """One way for a computation to end: its number and word in the result file and the sentence for the user."""

    number: int
    meaning: str
    sentence: str


CONVERGED, CRASHED, NOT_COMPUTED = int(Outcome.CONVERGED), int(Outcome.CRASHED), int(Outcome.NOT_COMPUTED)

Keep = Callable[[Kept], None]
"""Takes note of how far a task is."""

_ROUND_OFF = 1e-10


def endings() -> tuple[Ending, ...]:
    """All ways for a computation to end, by number."""
    return tuple(Ending(int(outcome), outcome.meaning, outcome.sentence) for outcome in sorted(Outcome))


def build_evaluator(
    model: ReducedModel, friction_coefficient: float
) -> Callable[[BranchTask | MarchTask, Keep], Iterator[StartResult | MarchResult]]:
    """The function that does the tasks of a study on this model and gives their results one by one."""

    def evaluate(task: BranchTask | MarchTask, keep: Keep) -> Iterator[StartResult | MarchResult]:
        if isinstance(task, BranchTask):
            yield from follow(model, friction_coefficient, task, keep)
        else:
            yield from march(model, friction_coefficient, task, keep)

    return evaluate


def follow(model: ReducedModel, friction_coefficient: float, task: BranchTask, keep: Keep) -> Iterator[StartResult]:
    """Start states of one branch as the sweep reaches them, but those that are known; the last of them ends it."""
    # numba is loaded where a task runs, so that --plan and --help do without it.
    from solver.continuation import follow_branch
    from solver.packing import pack

    branch = follow_branch(
        model,
        friction_coefficient,
        task.excitation_amplitude,
        np.array(task.frequencies),
        cast("Literal['up', 'down']", task.sweep),
        _solver_settings(task.settings),
        keep=lambda progress: keep(Kept(progress.text, progress.arrays)),
        resume=_packed(task.resume),
    )
    n_displacements = int(np.count_nonzero(np.asarray(model.contact.dofs) >= 0))
    n_left = task.n_results
    for position, start in branch:
        if position in task.known:
            continue
        n_coefficients = 2 * len(start.resolution.orders) + 1
        n_unknowns = 0 if start.state is None else n_displacements * n_coefficients
        packed = pack(start)
        yield StartResult(position, Kept(packed.text, packed.arrays), _moves(start), n_unknowns)
        n_left -= 1
        if n_left == 0:
            return


def failed_results(task: BranchTask | MarchTask, n_given: int, error: Exception) -> Iterator[StartResult | MarchResult]:
    """What a task still owes after its first results, where it broke off with an error that it should not have."""
    from solver.packing import pack

    message = describe_error(error)
    if isinstance(task, MarchTask):
        for place in range(n_given, task.n_results):
            yield failed_result(task, place, int(Outcome.EXCEPTION), message)
        return
    nan = math.nan
    start = StartState(Outcome.EXCEPTION, None, nan, Resolution((1,), 4), nan, nan, 0, 0.0, message=message)
    packed = pack(start)
    for position in [place for place in task.order if place not in task.known][n_given:]:
        yield StartResult(position, Kept(packed.text, packed.arrays), moves=False, n_unknowns=0)


def march(model: ReducedModel, friction_coefficient: float, task: MarchTask, keep: Keep) -> Iterator[MarchResult]:
    """The histories of a task, one for each of its shares.

    One march gives all of them. Where it fails, or its wear rate oscillates, that may have been after the end of
    another history, which then takes a march of its own.
    """
    history = _solve(model, friction_coefficient, task, keep)
    yield build_result(task, history)
    tells_all = history.outcome is Outcome.CONVERGED and not history.oscillates
    for place, share in enumerate(task.shares[1:], start=1):
        if tells_all:
            yield build_result(task, history, place)
        else:
            alone = replace(task, shares=(share,), resume=None)
            yield replace(build_result(alone, _solve(model, friction_coefficient, alone)), share=place)


def _solve(model: ReducedModel, friction_coefficient: float, task: MarchTask, keep: Keep | None = None) -> WearHistory:
    """The march of a task from its start state, at all counts at which one of its shares is read."""
    from solver.march import march_wear
    from solver.packing import unpack

    start = None if task.start is None else unpack(Packed(task.start.text, task.start.arrays))
    if not isinstance(start, StartState):
        raise TypeError(f"task without a start state: {task}")
    # The march begins at cycle 0, whether that count is kept or not.
    counts = np.unique(np.concatenate([[0.0], *(task.counts(share) for share in task.shares)]))
    return march_wear(
        model,
        friction_coefficient,
        start,
        task.wear_coefficient,
        task.step,
        cast("Literal['explicit', 'implicit', 'adaptive']", task.scheme),
        counts,
        _solver_settings(task.settings),
        largest_depth=task.largest_depth,
        loops=task.loops,
        keep=None if keep is None else lambda progress: keep(Kept(progress.text, progress.arrays)),
        resume=_packed(task.resume),
    )


def build_result(task: MarchTask, history: WearHistory, place: int = 0) -> MarchResult:
    """What the result file holds of one share of a march: the output counts and variables that the task asks for.

    What is per cycle is per cycle of the share. A share that ends before the march knows nothing of later jumps and
    errors. Effort is that of the march.
    """
    share, own = task.shares[place], task.shares[0]
    slower = share.wear_coefficient / own.wear_coefficient if place else 1.0
    counts = np.array(task.counts(share))
    rows = np.searchsorted(history.cycles, counts)
    failed = history.outcome is not Outcome.CONVERGED
    values = {name: _variable(history, name, slower, failed)[rows] for name in task.variables}
    jump, error = history.jump_cycle, history.error_estimate
    if place:
        jump = jump / slower if jump < (1.0 - _ROUND_OFF) * counts[-1] else math.nan
        error = float(history.worn_volume_error[rows[-1]])
    return MarchResult(
        points=share.points,
        outcome=int(history.outcome),
        values=values,
        jump_cycle=jump,
        error_estimate=error,
        newton_iterations=history.newton_iterations,
        run_time=history.run_time,
        branch=history.branch,
        fold_frequency=history.fold_frequency,
        step_limit=history.step_limit / slower,
        oscillates=history.oscillates,
        message=history.message,
        share=place,
    )


def _variable(history: WearHistory, name: str, slower: float, failed: bool) -> NDArray[np.generic]:
    """A variable of the result, its first dimension the output counts of the history; empty of all where it failed.

    slower: wear coefficient over that of the history.
    """
    values: NDArray[np.generic]
    if name == "response_amplitude":
        values = np.abs(history.response)
    elif name == "response_phase":
        values = np.angle(history.response)
    elif name == "wear_rate":
        values = slower * history.wear_rate
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
    limit = settings.time_limit
    return SolverSettings(settings.harmonics, settings.samples, settings.tolerance, settings.rtol, limit)


def _packed(kept: Kept | None) -> Packed | None:
    return None if kept is None else Packed(kept.text, kept.arrays)


def describe_failures(outcomes: Mapping[int, int]) -> tuple[str, ...]:
    """One line for each way in which points failed: how many of them, and the sentence. outcomes: points by number."""
    counts = {ending: outcomes.get(ending.number, 0) for ending in endings() if ending.number != CONVERGED}
    return tuple(f"{count} x {ending.meaning}: {ending.sentence}" for ending, count in counts.items() if count)
