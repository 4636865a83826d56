"""Stand-ins for the solver: results of the right shapes whose numbers tell which task made them."""

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from solver.packing import Packed
from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.checkpoint.records import record_type
from studyrunner.checkpoint.store import Store
from studyrunner.plan.identity import Identities, hash_of_kind
from studyrunner.plan.results import Keep, MarchResult, StartResult
from studyrunner.plan.sharing import Index
from studyrunner.plan.tasks import BranchTask, MarchTask, TaskPlan
from studyrunner.scene.scene import SceneFacts
from studyrunner.study.study import Study
from studyrunner.task_progress import start_marches
from studyrunner.variables import ASKED, KEPT, LOOP_COMPONENTS, LOOP_PHASES, LOOPS

FACTS = SceneFacts(
    n_displacements=6,
    position=np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]),
    area=np.array([1e-4, 2e-4]),
    surface=("intrados", "extrados"),
    response_names=("tip",),
    digest="0" * 64,
)


def no_keep(progress: Packed) -> None:
    """Progress that nobody keeps."""


def fake_evaluate(
    task: BranchTask | MarchTask, keep: Keep = no_keep, facts: SceneFacts = FACTS, seconds: float = 0.0
) -> Iterator[StartResult | MarchResult]:
    """Results that depend on everything in the task but its cost; a march takes up to `seconds`, unevenly."""
    if isinstance(task, BranchTask):
        yield from fake_branch(task)
    else:
        for place in range(task.n_results):
            yield fake_march(task, facts, 0.0 if place else seconds, place)


def fake_branch(task: BranchTask) -> Iterator[StartResult]:
    """Start states in the order of the sweep, those that are known left out."""
    given = (task.settings.harmonics, task.settings.samples, task.settings.tolerance, task.settings.rtol)
    settings = tuple(0.5 if value == "auto" else value for value in given)
    for position in task.order:
        if position not in task.known:
            start = (task.frequencies[position], task.excitation_amplitude, task.sweep == "up", *settings)
            yield StartResult(position, Packed("fake", (np.array(start),)), moves=position % 2 == 0, n_unknowns=18)


def fake_march(task: MarchTask, facts: SceneFacts = FACTS, seconds: float = 0.0, place: int = 0) -> MarchResult:
    """A history whose values tell which of the task it is."""
    scaled = task.histories[place]
    fingerprint = float(np.dot(task.start.arrays[0], [1.0, 0.1, 0.01, 1e-3, 1e-5, 1.0, 1.0]))
    fingerprint += scaled.wear_coefficient * 1e9 + scaled.step * 1e-4 + 0.5 * (task.scheme == "implicit")
    pause = seconds * (fingerprint * 7.7 % 1.0) ** 2
    time.sleep(pause)
    sizes = {"contact": len(facts.area), "response": len(facts.response_names)}
    values: dict[str, np.ndarray] = {}
    for name in task.variables:
        if name in LOOPS:
            shape = (len(task.cycles), len(task.loops), LOOP_PHASES, len(LOOP_COMPONENTS))
            pairs = 1e3 * np.array(task.loops, dtype=float)[:, None, None] + (name == "loop_force")
            values[name] = fingerprint + pairs + 1e-3 * np.arange(float(np.prod(shape))).reshape(shape)
            continue
        shape = tuple({"cycle": len(task.cycles), **sizes}[dimension] for dimension in ASKED[name].dimensions)
        values[name] = fingerprint + np.arange(float(np.prod(shape))).reshape(shape)
        if ASKED[name].flags:
            values[name] = values[name] >= 0.0
        values[name] = values[name].astype(ASKED[name].dtype)
    totals = dict.fromkeys(("outcome", "final_method", "branch"), 0)
    totals |= dict.fromkeys(("jump_cycle", "cycles_to_target", "cycles_to_target_error", "fold_frequency"), np.nan)
    totals |= {"step_limit": np.inf, "last_cycle": task.cycles[-1], "newton_iterations": round(fingerprint)}
    totals |= {"run_time": pause, "error_estimate": 0.01, "largest_wear_depth": 1e-6, "message": ""}
    return MarchResult(scaled.points, {**values, **totals}, place)


def changed(result: MarchResult, **values: object) -> MarchResult:
    """The result with other values of some variables."""
    assert values.keys() <= result.values.keys()
    return replace(result, values={**result.values, **values})


def fake_histories(plan: TaskPlan) -> Iterator[tuple[MarchTask, MarchResult]]:
    """The results of all marches of a study."""
    for branch in plan.branches:
        for task in fake_starts(plan, branch.number):
            for place in range(task.n_results):
                yield task, fake_march(task, place=place)


def totals_of(result: MarchResult, *names: str) -> list[float]:
    """Values of some variables without further dimensions."""
    return [result.values[name] for name in names]


def without_values(result: MarchResult, outcome: int) -> MarchResult:
    """The result as it is where there is no state: NaN, or 0 where the variable is a whole number."""
    values = {
        name: np.full_like(array, np.nan if array.dtype.kind == "f" else 0)
        for name, array in result.values.items()
        if name not in KEPT
    }
    nothing = dict.fromkeys(("last_cycle", "error_estimate", "largest_wear_depth"), np.nan)
    return changed(result, outcome=outcome, **values, **nothing)


def open_completion(
    study: Study, plan: TaskPlan, path: Path, facts: SceneFacts = FACTS, *, fresh: bool = False
) -> CompletionIndex:
    """What is in the file of a study; its store is to be closed."""
    kind = record_type(study, facts)
    identities = Identities(facts.digest, hash_of_kind(kind.descr))
    completion = CompletionIndex(plan, identities, Store(path), kind)
    if fresh:
        completion.forget_all()
    return completion


def fake_completion(
    study: Study, plan: TaskPlan, results: Iterable[MarchResult], path: Path, facts: SceneFacts = FACTS
) -> CompletionIndex:
    """The file of a run that had these results and no others, some in a transaction."""
    marches = march_of_points(plan)
    completion = open_completion(study, plan, path, facts, fresh=True)
    for place, result in enumerate(results):
        completion.add_history(marches[result.points], result)
        if place % 3 == 0:
            completion.store.flush()
    completion.store.flush()
    return completion


def march_of_points(plan: TaskPlan) -> dict[tuple[Index, ...], MarchTask]:
    """The march of each history, which is known by its points."""
    return {scaled.points: task for line in plan.marches for task in line for scaled in task.histories}


def fake_starts(plan: TaskPlan, branch: int) -> list[MarchTask]:
    """All marches of a branch with their start states."""
    return [
        march
        for started in fake_branch(plan.branches[branch])
        for march in start_marches(plan.marches_from(branch, started.position), started)
    ]
