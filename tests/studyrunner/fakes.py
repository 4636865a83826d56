"""Stand-ins for the solver: results of the right shapes whose numbers tell which task made them."""

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from solver.model import ContactInterface
from solver.outcome import Outcome
from solver.packing import Packed, pack
from solver.results.history import StartState
from solver.settings import Resolution
from studyrunner.checkpoint.completion_index import CompletionIndex
from studyrunner.checkpoint.store import Store
from studyrunner.kinds.task import PointResult, Result, StartResult, Task, TaskPlan
from studyrunner.kinds.wear.histories import History, Sweep
from studyrunner.kinds.wear.kind import ASKED, LOOP_COMPONENTS, LOOP_PHASES, LOOPS, OF_A_HISTORY
from studyrunner.plan import build_tasks
from studyrunner.scene.scene import SceneFacts
from studyrunner.scene.scene_set import find_scenes
from studyrunner.study.study import Study

PAIRS = ContactInterface(
    dofs=np.arange(6).reshape(2, 3),
    area=np.array([1e-4, 2e-4]),
    gap=np.zeros(2),
    normal_load=np.zeros(2),
    position=np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]),
    surface=("intrados", "extrados"),
)
FACTS = SceneFacts(n_displacements=6, contact=PAIRS, response_names=("tip",), digest="0" * 64)

NO_STATE = pack(StartState(Outcome.CONVERGED, None, 1.0, Resolution((1,), 64), 0.0, 0.0)).text


def plan_of(study: Study, n_displacements: int = 2) -> TaskPlan:
    """The tasks of a study, all of whose scenes have one pair and so many displacements."""
    scenes = find_scenes(study)
    contact = replace(PAIRS, position=np.zeros((1, 3)), area=np.ones(1), gap=np.zeros(1), surface=("",))
    facts = replace(FACTS, n_displacements=n_displacements, contact=contact)
    return build_tasks(study, scenes, [facts] * len(scenes.studies))


def fake_evaluate(task: Task, facts: SceneFacts = FACTS, seconds: float = 0.0) -> Iterator[Result]:
    """Results that depend on everything in the task but its cost; a history takes up to `seconds`, unevenly."""
    if isinstance(task, Sweep):
        yield from fake_sweep(task)
    else:
        assert isinstance(task, History)
        for place in task.places:
            yield fake_history(task, facts, 0.0 if place else seconds, place)


def fake_sweep(task: Sweep) -> Iterator[StartResult]:
    """Start states in the order of the sweep, without those that are skipped."""
    given = (task.settings.harmonics, task.settings.samples, task.settings.tolerance, task.settings.rtol)
    settings = tuple(0.5 if value == "auto" else value for value in given)
    for place in task.places:
        excitation = task.excitation
        start = (task.frequencies[place], excitation.amplitude, excitation.direction == "up", *settings)
        yield StartResult(place, Packed(NO_STATE, (np.array(start),)), moves=place % 2 == 0, n_unknowns=18)


def fake_history(task: History, facts: SceneFacts = FACTS, seconds: float = 0.0, place: int = 0) -> PointResult:
    """A history whose values tell which of the task it is."""
    integrated, number = task.results[place]
    fingerprint = float(np.dot(task.start.arrays[0], [1.0, 0.1, 0.01, 1e-3, 1e-5, 1.0, 1.0]))
    fingerprint += integrated.wear_coefficients[number] * 1e9 + integrated.step * 1e-4
    fingerprint += 0.5 * (integrated.scheme == "implicit")
    pause = seconds * (fingerprint * 7.7 % 1.0) ** 2
    time.sleep(pause)
    sizes = {"contact": facts.contact.n_contact, "response": len(facts.response_names)}
    values: dict[str, np.ndarray] = {}
    for name in task.variables:
        if name in LOOPS:
            shape = (len(task.cycles), len(task.loops), LOOP_PHASES, len(LOOP_COMPONENTS))
            pairs = 1e3 * np.array(task.loops, dtype=float)[:, None, None] + (name == "loop_force")
            values[name] = fingerprint + pairs + 1e-3 * np.arange(float(np.prod(shape))).reshape(shape)
            continue
        shape = tuple({"cycle": len(task.cycles), **sizes}[dimension] for dimension in ASKED[name].dimensions)
        values[name] = fingerprint + np.arange(float(np.prod(shape))).reshape(shape)
        values[name] = values[name].astype(ASKED[name].dtype)
    totals = dict.fromkeys(("outcome", "branch"), 0)
    totals |= dict.fromkeys(("jump_cycle", "cycles_to_target", "cycles_to_target_error", "fold_frequency"), np.nan)
    totals |= {"step_limit": np.inf, "last_cycle": task.cycles[-1], "newton_iterations": round(fingerprint)}
    totals |= {"run_time": pause, "error_estimate": 0.01, "largest_wear_depth": 1e-6, "message": ""}
    return PointResult({**values, **totals}, place)


def changed(result: PointResult, **values: object) -> PointResult:
    """The result with other values of some variables."""
    assert values.keys() <= result.values.keys()
    return replace(result, values={**result.values, **values})


def started(plan: TaskPlan) -> list[History]:
    """All histories of a plan with their start states."""
    return [
        task.from_start(start)
        for sweep in plan.sweeps
        for start in fake_sweep(sweep)
        for task in plan.waiting[sweep.number, start.place]
    ]


def points_of(task: Task) -> list[int]:
    """Numbers of all points that get a result from a task."""
    return [point for place in task.order for point in task.points(place)]


def totals_of(result: PointResult, *names: str) -> list[float]:
    """Values of some variables without further dimensions."""
    return [result.values[name] for name in names]


def without_values(result: PointResult, outcome: int) -> PointResult:
    """The result as it is where there is no state: NaN, or 0 where the variable is a whole number."""
    values = {
        name: np.full_like(array, np.nan if array.dtype.kind == "f" else 0)
        for name, array in result.values.items()
        if name not in OF_A_HISTORY
    }
    nothing = dict.fromkeys(("last_cycle", "error_estimate", "largest_wear_depth"), np.nan)
    return changed(result, outcome=outcome, **values, **nothing)


def open_completion(study: Study, plan: TaskPlan, path: Path) -> CompletionIndex:
    """What is in the file of a study; its store is to be closed."""
    return CompletionIndex(study, plan, FACTS, [FACTS.digest], Store(path))


def fake_completion(
    study: Study, plan: TaskPlan, results: Iterable[tuple[tuple[int, ...], PointResult]], path: Path
) -> CompletionIndex:
    """The file of a run that had these results, each with its points, and no others, some in a transaction."""
    completion = open_completion(study, plan, path)
    completion.forget_all()
    tasks = {task.points(place): task for task in completion.plan.results for place in task.order}
    for number, (points, result) in enumerate(results):
        completion.add(tasks[points], result)
        if number % 3 == 0:
            completion.store.flush()
    completion.store.flush()
    return completion
