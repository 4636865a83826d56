"""Task -> result: the only place from which the solver computes."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, Generic, Literal, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from solver.missions.result import MissionHistory
from solver.model import ReducedModel
from solver.outcome import Outcome, describe_error
from solver.packing import Packed, pack, unpack
from solver.results.history import StartState, WearHistory
from solver.results.mode_values import ModeValues, without_state
from solver.settings import Resolution, ToTheEnd
from studyrunner.history_result import build_result
from studyrunner.mission_result import build_mission_result, missions_read
from studyrunner.mpi.mapped_file import MappedFile, open_mapped
from studyrunner.plan.results import Evaluate, Keep, MarchResult, StartResult, failed_result
from studyrunner.plan.tasks import BranchTask, Joint, MarchTask
from studyrunner.system.machine_faults import (
    MachineFaultError,
    is_fault_of_machine,
    tells_of_machine,
)
from studyrunner.system.progress import count

_ROUND_OFF = 1e-10


MODELS_A_RANK = 2
"""Models, or sets of models of the blocks of a mission, that a rank holds where a study has several scenes."""

Models = TypeVar("Models")


class ModelCache(Generic[Models]):
    """The models that a rank has computed with last, by the numbers of the scenes that a task needs.

    Rank 0 keeps such a list for each rank, without models, and so knows which models the rank has.
    """

    def __init__(self) -> None:
        self._models: OrderedDict[tuple[int, ...], Models] = OrderedDict()

    def use(self, scenes: tuple[int, ...]) -> bool:
        """Whether the models are there; they are then the last to be removed."""
        if scenes in self._models:
            self._models.move_to_end(scenes)
        return scenes in self._models

    def add(self, scenes: tuple[int, ...], models: Models) -> None:
        """Adds models; removes those that were not used for longest where there are too many."""
        self._models[scenes] = models
        if len(self._models) > MODELS_A_RANK:
            self._models.popitem(last=False)

    def __iter__(self) -> Iterator[tuple[int, ...]]:
        return iter(self._models)

    def __getitem__(self, scenes: tuple[int, ...]) -> Models:
        return self._models[scenes]


def build_evaluator(model: ReducedModel | None) -> Evaluate:
    """The function that does the tasks of a study and gives their results one by one.

    model: of the only scene; None where there are several scenes, whose models come with tasks.
    """
    models: ModelCache[tuple[ReducedModel, ...]] = ModelCache()
    if model is not None:
        models.add((0,), (model,))

    def evaluate(task: BranchTask | MarchTask, keep: Keep) -> Iterator[StartResult | MarchResult]:
        # first of all: rank 0 sends the models once, also where the task breaks off
        if task.models:
            models.add(task.scenes, tuple(map(_open_model, task.models)))
        elif not models.use(task.scenes):
            raise RuntimeError(f"no model of scene {task.scenes} for {task}")
        of_task, own = replace(task, models=()), dict(zip(task.scenes, models[task.scenes], strict=True))
        if isinstance(of_task, MarchTask) and of_task.blocks:
            yield fly(own, of_task, keep)
            return
        joint = _with_contact(own[task.joint.scene], task.joint)
        if isinstance(of_task, BranchTask):
            yield from (follow if of_task.mode is None else follow_amplitudes)(joint, of_task, keep)
        else:
            yield from integrate(joint, of_task, keep)

    return evaluate


def _with_contact(model: ReducedModel, joint: Joint) -> ReducedModel:
    """The model of a scene with what is drawn for its pairs."""
    if not joint.contact:
        return model
    drawn: dict[str, Any] = {name: np.array(values) for name, values in joint.contact}
    return replace(model, contact=replace(model.contact, **drawn))


def _open_model(given: ReducedModel | MappedFile) -> ReducedModel:
    """The model that a task brings. Raises OSError where it is in a file that has gone."""
    model = open_mapped(given) if isinstance(given, MappedFile) else given
    if not isinstance(model, ReducedModel):
        raise TypeError(f"{model!r} instead of a model")
    return model


def follow(model: ReducedModel, task: BranchTask, keep: Keep) -> Iterator[StartResult]:
    """Start states of one branch as the sweep reaches them, but those that are known; the last of them ends it."""
    # numba is loaded where a task runs, so that --plan and --help do without it.
    from solver.loading_history.start_states import follow_branch

    wanted = sorted(task.order_left)
    branch = follow_branch(
        model,
        task.joint.friction_coefficient,
        task.excitation_amplitude,
        # no state depends on those that are known
        task.follow or np.array([task.frequencies[position] for position in wanted]),
        cast("Literal['up', 'down', 'ramp']", task.sweep),
        task.settings,
        keep=keep,
        resume=task.resume,
    )
    n_displacements = int(np.count_nonzero(np.asarray(model.contact.dofs) >= 0))
    for place, start in branch:
        n_coefficients = 2 * len(start.resolution.orders) + 1
        n_unknowns = 0 if start.state is None else n_displacements * n_coefficients
        _raise_fault(start)
        yield StartResult(wanted[place], pack(start), _moves(start), n_unknowns)


def follow_amplitudes(model: ReducedModel, task: BranchTask, keep: Keep) -> Iterator[StartResult]:
    """Points of a nonlinear mode, but those that are known, in the order of the sweep."""
    del keep
    from solver.modes.points import follow_mode, values_of

    # no point depends on those that are known
    wanted = sorted(task.order_left)
    amplitudes = np.array([task.frequencies[position] for position in wanted])
    direction = cast("Literal['up', 'down']", task.sweep)
    for place, point in follow_mode(
        model, task.joint.friction_coefficient, amplitudes, task.mode or 1, direction, task.settings
    ):
        values = values_of(model, point)
        _raise_fault(values)
        n_unknowns = 0 if point.state is None else point.state.state.evaluation.predicted_h.size
        yield StartResult(wanted[place], pack(values), moves=False, n_unknowns=n_unknowns)


def failed_results(task: BranchTask | MarchTask, n_given: int, error: Exception) -> Iterator[StartResult | MarchResult]:
    """What a task still owes after its first results, where it broke off with an error that it should not have.

    A fault of the machine is no result of the task: what it owes is not computed, and may be tried again.
    """
    lost = is_fault_of_machine(error)
    message = str(error) if isinstance(error, MachineFaultError) else describe_error(error)
    if isinstance(task, MarchTask):
        for place in range(n_given, task.n_results):
            yield failed_result(task, place, Outcome.NOT_COMPUTED if lost else Outcome.EXCEPTION, message)
        return
    nan = math.nan
    broken: StartState | ModeValues
    if task.mode is None:
        broken = StartState(Outcome.EXCEPTION, None, nan, Resolution((1,), 4), nan, nan, 0, 0.0, message=message)
    else:
        broken = without_state(Outcome.EXCEPTION, message)
    for position in task.order_left[n_given:]:
        yield StartResult(position, pack(broken), moves=False, n_unknowns=0, lost=message if lost else "")


def integrate(model: ReducedModel, task: MarchTask, keep: Keep) -> Iterator[MarchResult]:
    """The histories of a task, the one of the march itself first.

    One march gives all of them, as far as it went.
    """
    reached = task.resume

    def note(progress: Packed | str) -> None:
        nonlocal reached
        reached = reached if isinstance(progress, str) else progress
        keep(progress)

    history = _solve(model, task, note)
    # with more time it goes on from there
    left = reached if history.outcome is Outcome.TIME_LIMIT else None
    yield replace(build_result(task, history), progress=left)
    for place in range(1, len(task.histories)):
        yield replace(build_result(task, history, place), progress=left)


def fly(models: Mapping[int, ReducedModel], task: MarchTask, keep: Keep) -> MarchResult:
    """The mission history of a task. models: by number of the scene."""
    from solver.missions.blocks import Block, Mission, Passage
    from solver.missions.history import integrate_missions

    of_joints = {block.joint: _with_contact(models[block.joint.scene], block.joint) for block in task.blocks}
    blocks = tuple(
        Block(
            model=of_joints[block.joint],
            frequency=block.frequency if block.passage is None else Passage(block.frequency, *block.passage),
            excitation_amplitude=block.excitation_amplitude,
            friction_coefficient=block.joint.friction_coefficient,
            cycles=block.cycles if block.passage is None else None,
            begin=cast("Literal['ramp', 'up', 'down', 'continue']", block.begin),
            name=block.name,
        )
        for block in task.blocks
    )
    reached, n_flown = task.resume, 0

    def note(progress: Packed | str) -> None:
        nonlocal reached, n_flown
        keep(progress)
        if not isinstance(progress, str):
            reached, n_flown = progress, n_flown + 1
            if len(blocks) > 1:
                keep(f"{count(n_flown, 'block')} flown")

    mission = Mission(
        blocks,
        task.wear_coefficient,
        missions_read(task.cycles),
        task.settings,
        task.law,
        task.until,
        cast("Literal['up', 'down', 'ramp']", task.sweep),
    )
    history = integrate_missions(mission, note, task.resume)
    _raise_fault(history)
    # with more time it goes on from there
    left = reached if history.outcome is Outcome.TIME_LIMIT else None
    return replace(build_mission_result(task, history), progress=left)


def _solve(model: ReducedModel, task: MarchTask, keep: Keep | None = None) -> WearHistory:
    """The march of a task from its start state, at all counts at which one of its histories is read."""
    from solver.wear.final_state.find import find_final_state
    from solver.wear.history import integrate_wear
    from solver.wear.solutions import SlowTime

    start = None if task.start is None else unpack(task.start)
    if not isinstance(start, StartState):
        raise TypeError(f"task without a start state: {task}")
    counts: NDArray[np.float64] | ToTheEnd
    if task.to_the_end is not None and not task.held:
        counts = task.to_the_end
    else:
        # A history begins at cycle 0, whether that count is kept or not.
        counts = np.unique(np.concatenate([[0.0], *(task.counts(scaled) for scaled in task.histories)]))
    final = task.scheme == "final"
    asked = SlowTime(
        task.wear_coefficient,
        cast("Literal['explicit', 'implicit', 'adaptive']", "adaptive" if final else task.scheme),
        counts,
        task.step,
        largest_depth=task.largest_depth,
        law=task.law,
        until=task.until,
        loops=task.loops,
        follow=task.follow,
    )
    solve = find_final_state if final and isinstance(counts, ToTheEnd) else integrate_wear
    history = solve(model, task.joint.friction_coefficient, task.settings, start, asked, keep, task.resume)
    _raise_fault(history)
    return history


def _raise_fault(ended: StartState | ModeValues | WearHistory | MissionHistory) -> None:
    """The solver takes whatever breaks it off for an end: raises MachineFaultError where that was not its own."""
    if ended.outcome is Outcome.EXCEPTION and tells_of_machine(ended.message):
        raise MachineFaultError(ended.message)


def _moves(start: StartState) -> bool:
    """Whether the relative motion in the joint is more than the round-off of its mean; no where there is no state."""
    if start.state is None:
        return False
    motion_h = start.state.displacement_h
    return bool(np.linalg.norm(motion_h[:, :, 1:]) > _ROUND_OFF * np.linalg.norm(motion_h))
