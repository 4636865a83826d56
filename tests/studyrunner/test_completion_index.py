"""What of a study is left to do after an earlier run: by the tasks that are asked for."""

import contextlib
import importlib.metadata
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import solver
from solver.outcome import Outcome
from solver.packing import Packed
from studyrunner.checkpoint.completion_index import MOST_CRASHES
from studyrunner.checkpoint.store import RESULTS
from studyrunner.kinds.task import Identity
from studyrunner.kinds.wear.histories import Sweep
from studyrunner.study.study_file import read_study
from studyrunner.system.machine import package_digest
from studyrunner.task_runs import StudyRun
from tests.studyrunner.fakes import FACTS, fake_evaluate, fake_sweep, open_completion, plan_of

BASE = (
    "axes.frequency=[100, 110, 120]",
    "axes.sweep=['up', 'down']",
    "axes.scheme=['implicit']",
    "axes.wear_coefficient=[5e-12, 1e-11]",
    "slow_time.outputs=3",
)


@contextlib.contextmanager
def completion_of(folder, *overrides):
    study = read_study("sdof_slider", (*BASE, *overrides))
    completion = open_completion(study, plan_of(study, FACTS.n_displacements), folder)
    with contextlib.closing(completion.store):
        yield completion


def compute(completion, n_tasks=1000):
    """Does what is left as a run does, up to a number of tasks; how many start states and histories it computed."""
    progress = StudyRun(completion, None, None, 1)
    waiting = list(progress.begin())
    n_starts = n_histories = 0
    while waiting and n_starts + n_histories < n_tasks:
        task = waiting.pop(0)
        n_histories += not task.gives_starts
        for result in fake_evaluate(task):
            n_starts += task.gives_starts
            waiting.extend(progress.take(task, result))
    completion.store.flush()
    return n_starts, n_histories


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "out.nc.progress"


@pytest.fixture
def finished(folder):
    """The file of a study that is finished: 2 sweeps of 3 start states, 2 histories from each."""
    with completion_of(folder) as completion:
        assert compute(completion) == (6, 12)
    return folder


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("axes.wear_coefficient=[5e-12, 1e-11, 2e-11]", (0, 6)),
        # a state knows nothing of the other frequencies
        ("axes.frequency=[90, 100, 110, 120]", (2, 4)),
        ("axes.frequency=[100, 110, 115, 120]", (2, 4)),
        ("axes.sweep=['up', 'ramp']", (3, 6)),
        *((f"axes.{less}", (0, 0)) for less in ("wear_coefficient=[1e-11]", "sweep=['up']", "frequency=[110, 120]")),
        # the order and the title do not matter, and neither does the time that a task may take
        *((f"axes.{change}", (0, 0)) for change in ("wear_coefficient=[1e-11, 5e-12]", "sweep=['down', 'up']")),
        ("axes.frequency=[120, 100, 110]", (0, 0)),
        ("study.title='another'", (0, 0)),
        ("solver.time_limit=100", (0, 0)),
        # histories alone are others
        *((f"axes.{change}", (0, 12)) for change in ("step=[2000]", "scheme=['explicit']")),
        *((f"slow_time.{change}", (0, 12)) for change in ("cycles=2000", "outputs=4", "outputs=[0, 400, 1000]")),
        *((f"outputs.{change}", (0, 12)) for change in ("variables=['worn_volume']", "loops=[0]")),
        *((change, (0, 12)) for change in ("wear.law=energy", "slow_time.until={wear_depth=1}")),
        ("axes.scheme=['adaptive']", (0, 6)),
        # start states, too
        *((f"axes.excitation_amplitude={values}", (6, 12)) for values in ("[11]", "[9, 10]")),
        ("axes.harmonics=['auto', 3]", (6, 12)),
        ("scene.friction_coefficient=0.4", (6, 12)),
        *((f"solver.{key}", (6, 12)) for key in ("tolerance=1e-9", "harmonics=5", "samples=128", "rtol=1e-3")),
    ],
)
def test_a_changed_study_computes_only_what_changed(change, expected, finished):
    with completion_of(finished, change) as completion:
        assert compute(completion) == expected
    # what it was before is still there, until a run of the changed one is finished
    for overrides in ((change,), ()):
        with completion_of(finished, *overrides) as completion:
            assert compute(completion) == (0, 0)


def test_all_results_and_tasks_have_names_of_their_own(folder):
    axes = ("excitation_amplitude=[9, 10]", "wear_coefficient=[0, 1e-12, 1e-11]", "step=[10, 100]", "harmonics=[3, 5]")
    axes += ("scheme=['implicit', 'explicit', 'adaptive']", "sweep=['up', 'down', 'ramp']")
    with completion_of(folder, *(f"axes.{each}" for each in axes)) as completion:
        plan = completion.plan
        assert compute(completion) == (3 * 2 * 3 * 2, len(plan.results))
        assert completion.n_points_finished == plan.n_points == 648
        tasks = (*plan.sweeps, *plan.results)
        names = [name for task in tasks for name in (task.key, *task.names)]
        assert len(set(names)) == len(names)


def give_up(completion, task):
    """The task has ended too many runs."""
    completion.store.crashes[task.key] = MOST_CRASHES
    completion.give_up_crashed()


def test_a_history_that_ended_its_process_has_failed(folder):
    with completion_of(folder) as completion:
        compute(completion, 5)
        (task, *_) = [task for task in completion.plan.results if not completion.is_finished(task)]
        n_before = completion.n_points_finished
        completion.store.crashes["0" * 32] = MOST_CRASHES  # of another study
        give_up(completion, task)
        assert completion.n_points_finished == n_before + 1
        assert list(completion.store.crashes) == ["0" * 32]
        (record,), _ = completion.read_results(task.names)
        assert record["outcome"] == Outcome.CRASHED
        assert np.isnan(record["worn_volume"]).all()
    with completion_of(folder) as completion:
        assert compute(completion)[1] == 12 - n_before - 1
        completion.forget_failed()
        assert compute(completion) == (0, 1)


@pytest.mark.parametrize(("number", "there", "lost"), [(0, 1, {1, 2}), (1, 1, {0, 1}), (0, 0, {0, 1, 2})])
def test_a_sweep_that_ended_its_process_ends_there(number, there, lost, folder):
    """there: number of its states that an earlier run has left."""
    with completion_of(folder) as completion:
        sweep = completion.plan.sweeps[number]
        for start in list(fake_sweep(sweep))[:there]:
            completion.add(sweep, start)
        give_up(completion, sweep)
        given_up = {task.waits_for for task in completion.plan.results if completion.is_finished(task)}
        assert given_up == {(number, place) for place in lost}
        assert compute(completion) == (6 - len(lost) - there, 12 - 2 * len(lost))


def test_tasks_with_which_runs_have_crashed_are_tried_one_after_the_other(folder):
    with completion_of(folder) as completion:
        first, *others = completion.plan.sweeps
        completion.store.crashes |= {sweep.key: 1 for sweep in completion.plan.sweeps}
        progress = StudyRun(completion, None, None, 1)
        (tried,) = progress.begin()
        assert tried.number == first.number
        new = [progress.take(tried, start) for start in fake_sweep(tried)]
        assert [sum(isinstance(task, Sweep) for task in tasks) for tasks in new] == [0, 0, 1]
        assert sum(map(len, new)) == 6 + 1
        assert list(completion.store.crashes) == [each.key for each in others]


def test_only_states_from_which_something_begins_are_asked_for(finished):
    with completion_of(finished) as completion:
        sweep = completion.plan.sweeps[0]
        for name in sweep.names:
            completion.store.forget(RESULTS, name)
        (task,) = [each for each in completion.plan.waiting[0, 1] if each.wear_coefficient == 1e-11]
        completion.store.forget(RESULTS, task.names[0])
        (left,) = completion.sweeps_left()
        assert left == replace(sweep, skipped=frozenset({0, 2}))
        assert left.n_results == 1
        assert compute(completion) == (1, 1)


def test_a_start_state_that_failed_is_tried_again_and_no_other_one(folder):
    """What comes behind it on its sweep does not depend on it."""
    with completion_of(folder) as completion:
        down = completion.plan.sweeps[1]
        for sweep in completion.plan.sweeps:
            for start in fake_sweep(sweep):
                failed = sweep is down and start.place == 1
                completion.add(sweep, replace(start, n_unknowns=0) if failed else start)
        completion.keep(down, Packed("progress", (np.zeros(1),)))
        compute(completion)
        completion.forget_failed()
        assert completion.n_points_finished == 10
        (left,) = completion.sweeps_left()
        assert (left.number, left.skipped, left.resume) == (1, frozenset({0, 2}), None)
        assert compute(completion) == (1, 2)


def names_of(scene=FACTS.digest):
    """All names of the results of a study; which keys change them is in the table above."""
    study = read_study("sdof_slider", ["axes.frequency=[150, 155]", "axes.scheme=implicit", "axes.step=[100, 150]"])
    plan, identity = plan_of(study, FACTS.n_displacements), Identity((scene,), "kind")
    package_digest.cache_clear()
    return {name for task in (*plan.sweeps, *plan.results) for name in task.hashes(identity)}


def test_another_scene_version_or_source_of_the_solver_makes_all_results_others(tmp_path, monkeypatch):
    before = names_of()
    assert before.isdisjoint(names_of("1" * 64))
    assert names_of() == before
    with monkeypatch.context() as other:
        other.setattr(importlib.metadata, "version", lambda _: "0.0.0")
        assert before.isdisjoint(names_of())
    # a source file of a copy is changed, then moved
    copy = tmp_path / "solver"
    shutil.copytree(Path(solver.__path__[0]), copy, ignore=shutil.ignore_patterns("__pycache__"))
    source = copy / "contact" / "law.py"
    with monkeypatch.context() as other:
        other.setattr(solver.__spec__, "submodule_search_locations", [str(copy)])
        seen = [before]
        for change in (lambda: source.write_text("# changed\n"), lambda: source.rename(copy / "law.py")):
            change()
            seen.append(names_of())
            assert all(seen[-1].isdisjoint(each) for each in seen[:-1])
    package_digest.cache_clear()
