"""What of a study is left to do after an earlier run: by the tasks that are asked for."""

import contextlib
import importlib.metadata
import itertools
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import solver
from solver.outcome import COMPLETE
from solver.packing import Packed
from studyrunner.checkpoint.completion_index import MOST_CRASHES, MOST_OF_OTHERS
from studyrunner.checkpoint.records import empty_record, pack_record, record_in, record_type
from studyrunner.checkpoint.store import RESULTS, STARTS
from studyrunner.plan import identity
from studyrunner.plan.identity import Identities
from studyrunner.plan.planning import build_tasks
from studyrunner.plan.tasks import BranchTask, MarchTask
from studyrunner.study.study_file import read_study
from studyrunner.task_progress import TaskProgress
from tests.studyrunner.fakes import FACTS, changed, fake_branch, fake_march, open_completion, without_values

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
    completion = open_completion(study, build_tasks(study, FACTS.n_displacements), folder)
    with contextlib.closing(completion.store):
        yield completion


def compute(completion, n_tasks=1000, failing=frozenset()):
    """Does what is left as a run does, up to a number of tasks; how many start states and marches it computed.

    failing: numbers of marches that fail.
    """
    progress = TaskProgress(completion)
    waiting: list[BranchTask | MarchTask] = list(progress.begin())
    n_starts = n_marches = 0
    while waiting and n_starts + n_marches < n_tasks:
        task = waiting.pop(0)
        if isinstance(task, BranchTask):
            for start in fake_branch(task):
                waiting.extend(progress.take(task, start))
                n_starts += 1
        else:
            n_marches += 1
            for place in range(task.n_results):
                result = fake_march(task, place=place)
                if task.number in failing:
                    result = changed(without_values(result, 4), message="why")
                waiting.extend(progress.take(task, result))
    completion.store.flush()
    return n_starts, n_marches


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "out.nc.progress"


@pytest.fixture
def finished(folder):
    """The folder of a study that is finished: 2 branches of 3 start states, 2 marches from each."""
    with completion_of(folder) as completion:
        assert compute(completion) == (6, 12)
    return folder


@pytest.mark.parametrize("n_tasks", [1, 4, 7, 17])
def test_a_run_that_stopped_anywhere_goes_on_there(n_tasks, folder):
    with completion_of(folder) as completion:
        first = compute(completion, n_tasks)
    with completion_of(folder) as completion:
        assert completion.n_points_finished == first[1]
        second = compute(completion)
    assert first[1] + second[1] == 12
    # a branch gives all its states in one task here
    assert first[0] + second[0] == 6


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("axes.wear_coefficient=[5e-12, 1e-11, 2e-11]", (0, 6)),
        ("axes.wear_coefficient=[1e-11]", (0, 0)),
        ("axes.step=[2000]", (0, 12)),
        ("slow_time.outputs=4", (0, 12)),
        ("outputs.variables=['worn_volume']", (0, 12)),
        ("axes.sweep=['up']", (0, 0)),
        ("axes.excitation_amplitude=[11]", (6, 12)),
        # a state knows nothing of the other frequencies
        ("axes.frequency=[90, 100, 110, 120]", (2, 4)),
        ("axes.frequency=[100, 110, 115, 120]", (2, 4)),
        ("axes.frequency=[100, 110, 120, 130]", (2, 4)),
        ("axes.frequency=[110, 120]", (0, 0)),
        ("axes.sweep=['up', 'ramp']", (3, 6)),
        ("solver.time_limit=100", (0, 0)),
        *((f"solver.{key}", (6, 12)) for key in ("tolerance=1e-9", "harmonics=5", "samples=128", "rtol=1e-3")),
        ("scene.friction_coefficient=0.4", (6, 12)),
        ("axes.scheme=['explicit']", (0, 12)),
        ("axes.scheme=['adaptive']", (0, 6)),
        ("outputs.loops=[0]", (0, 12)),
        ("slow_time.cycles=2000", (0, 12)),
        ("slow_time.outputs=[0, 400, 1000]", (0, 12)),
        *((change, (0, 0)) for change in ("study.title='another'", "axes.frequency=[120, 100, 110]")),
        *((f"axes.{change}", (0, 0)) for change in ("wear_coefficient=[1e-11, 5e-12]", "sweep=['down', 'up']")),
        ("axes.excitation_amplitude=[9, 10]", (6, 12)),
        ("axes.harmonics=['auto', 3]", (6, 12)),
    ],
)
def test_a_changed_study_computes_only_what_changed(change, expected, finished):
    with completion_of(finished, change) as completion:
        assert compute(completion) == expected
    with completion_of(finished, change) as completion:
        assert compute(completion) == (0, 0)
    # and what it was before is still there, until a run of the changed one is finished
    with completion_of(finished) as completion:
        assert compute(completion) == (0, 0)


def test_all_tasks_have_names_of_their_own(folder):
    axes = ("axes.excitation_amplitude=[9, 10]", "axes.wear_coefficient=[0, 1e-12, 1e-11]", "axes.step=[10, 100]")
    words = (
        "axes.scheme=['implicit', 'explicit', 'adaptive']",
        "axes.sweep=['up', 'down', 'ramp']",
        "axes.harmonics=[3, 5]",
    )
    with completion_of(folder, *axes, *words) as completion:
        n_marches = sum(len(line) for line in completion.plan.marches)
        assert compute(completion) == (3 * 2 * 3 * 2, n_marches)
        assert completion.n_points_finished == completion.plan.n_points == 648


def test_points_that_failed_are_tried_again_where_asked_for_only(folder):
    with completion_of(folder) as completion:
        compute(completion, failing=frozenset({2, 7}))
    with completion_of(folder) as completion:
        assert compute(completion) == (0, 0)
        completion.forget_failed(COMPLETE)
        assert completion.n_points_finished == 10
        assert compute(completion) == (0, 2)
    with completion_of(folder) as completion:
        completion.forget_failed(COMPLETE)
        assert compute(completion) == (0, 0)


def test_a_march_that_ended_its_process_has_failed(folder):
    with completion_of(folder) as completion:
        compute(completion, 5)
        (march, *_) = [m for line in completion.plan.marches for m in line if not completion.is_finished(m)]
        n_before = completion.n_points_finished
        assert completion.take_as_failed(completion.key(march), 12, "Segmentation fault") == 1
        assert completion.take_as_failed(completion.key(march), 12, "Segmentation fault") == 0
        assert completion.take_as_failed("0" * 32, 12, "of another study") == 0
        assert completion.n_points_finished == n_before + 1
        (record,), _ = completion.read_histories(completion.histories(march))
        assert (record["outcome"], record["message"]) == (12, "Segmentation fault")
        assert np.isnan(record["worn_volume"]).all()
    with completion_of(folder) as completion:
        n_marches = compute(completion)[1]
        assert n_marches == 12 - n_before - 1
        completion.forget_failed(COMPLETE)
        assert compute(completion) == (0, 1)


@pytest.mark.parametrize(("number", "there", "lost"), [(0, 1, {1, 2}), (1, 1, {0, 1}), (0, 0, {0, 1, 2})])
def test_a_branch_that_ended_its_process_ends_there(number, there, lost, folder):
    """there: number of its states that an earlier run has left."""
    with completion_of(folder) as completion:
        branch = completion.plan.branches[number]
        for start in list(fake_branch(branch))[:there]:
            completion.add_start(branch, start)
        assert completion.take_as_failed(completion.key(branch), 12, "why") == 2 * len(lost)
        marches = [march for line in completion.plan.marches for march in line]
        lost_marches = {(m.branch, m.position) for m in marches if completion.is_finished(m)}
        assert lost_marches == {(number, place) for place in lost}
        n_starts, n_marches = compute(completion)
        assert (n_starts, n_marches) == (6 - len(lost) - there, 12 - 2 * len(lost))


def test_tasks_with_which_runs_have_crashed_are_tried_one_after_the_other_and_given_up_in_the_end(folder):
    with completion_of(folder) as completion:
        first, *others = completion.plan.branches
        for branch in completion.plan.branches:
            completion.store.crashes[completion.key(branch)] = 1
        progress = TaskProgress(completion)
        (tried,) = progress.begin()
        assert tried.number == first.number
        new = [progress.take(tried, start) for start in fake_branch(tried)]
        assert [sum(isinstance(task, BranchTask) for task in tasks) for tasks in new] == [0, 0, 1]
        marches = [task for tasks in new for task in tasks if isinstance(task, MarchTask)]
        assert len(marches) == 6
        assert list(completion.store.crashes) == [completion.key(each) for each in others]
        completion.store.crashes[completion.key(marches[0])] = MOST_CRASHES
        completion.give_up_crashed()
        assert completion.is_finished(marches[0])
        assert not completion.is_finished(marches[1])


def test_only_states_that_something_is_to_be_marched_from_are_asked_for(finished):
    with completion_of(finished) as completion:
        branch = completion.plan.branches[0]
        for place in range(3):
            completion.store.forget(STARTS, completion._starts[0][place])
        (march,) = [m for m in completion.plan.marches_from(0, 1) if m.wear_coefficient == 1e-11]
        completion.store.forget(RESULTS, completion._histories[march.number][0])
        (left,) = completion.branches_left()
        assert left == replace(branch, known=frozenset({0, 2}))
        assert left.n_results == 1
        assert compute(completion) == (1, 1)


@pytest.mark.parametrize(("most", "expected"), [(MOST_OF_OTHERS, (0, 0)), (0.0, (6, 12)), (1.0, (6, 12))])
def test_what_another_study_has_left_stays_up_to_a_size(most, expected, finished):
    other = "axes.excitation_amplitude=11"
    with completion_of(finished, other) as completion:
        assert compute(completion) == (6, 12)
        completion.prune(most)
        assert completion.n_points_finished == 12
    with completion_of(finished, other) as completion:
        assert compute(completion) == (0, 0)
    with completion_of(finished) as completion:
        assert compute(completion) == expected


def test_a_record_of_another_study_is_none_of_this():
    study, other = (read_study("sdof_slider", (*BASE[:-1], f"slow_time.outputs={n}")) for n in (3, 4))
    kind = record_type(study, FACTS)
    packed = pack_record(empty_record(kind))
    wrong = [replace(packed, arrays=arrays) for arrays in ((), (np.zeros(3),), (*packed.arrays, *packed.arrays))]
    for odd in (pack_record(empty_record(record_type(other, FACTS))), *wrong, None):
        assert record_in(odd, kind) is None
    assert record_in(packed, kind) == empty_record(kind).tobytes()


def test_a_start_state_that_failed_is_tried_again_and_no_other_one(folder):
    """What comes behind it on its branch does not depend on it."""
    with completion_of(folder) as completion:
        down = completion.plan.branches[1]
        for branch in completion.plan.branches:
            for start in fake_branch(branch):
                failed = branch is down and start.position == 1
                completion.add_start(branch, replace(start, n_unknowns=0) if failed else start)
        completion.keep(down, Packed("progress", (np.zeros(1),)))
        compute(completion)
        assert completion.n_points_finished == 12
        completion.forget_failed(COMPLETE)
        assert completion.n_points_finished == 10
        (left,) = completion.branches_left()
        assert (left.number, left.known, left.resume) == (1, frozenset({0, 2}), None)
        assert compute(completion) == (1, 2)


def names_of(scene=FACTS.digest):
    """All names of the tasks of a study and of their results; which keys change them tells `test_completion_index`."""
    study = read_study("sdof_slider", ["axes.frequency=[150, 155]", "axes.scheme=implicit", "axes.step=[100, 150]"])
    plan, own = build_tasks(study, FACTS.n_displacements), Identities(scene, "kind")
    (branch,), (line,) = plan.branches, plan.marches
    histories = [own.of_histories(branch, march) for march in line]
    return [own.of_branch(branch), *map(own.of_march, histories), *own.of_starts(branch), *itertools.chain(*histories)]


def test_all_that_a_task_gives_has_a_name_of_its_own():
    names = names_of()
    assert len(set(names)) == len(names)
    assert all(len(name) == 32 and set(name) <= set("0123456789abcdef") for name in names)


def test_another_solver_or_scene_is_another_one(monkeypatch):
    before = set(names_of())
    assert before.isdisjoint(names_of("1" * 64))
    identity.solver_digest.cache_clear()
    assert set(names_of()) == before
    monkeypatch.setattr(importlib.metadata, "version", lambda _: "0.0.0")
    identity.solver_digest.cache_clear()
    try:
        assert before.isdisjoint(names_of())
    finally:
        identity.solver_digest.cache_clear()


@pytest.mark.slow
def test_an_edit_anywhere_in_the_solver_makes_all_results_others(tmp_path, monkeypatch):
    """Every source file of a copy is changed in turn, and one is moved."""
    copy = tmp_path / "solver"
    shutil.copytree(Path(solver.__path__[0]), copy, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(solver, "__path__", [str(copy)])
    monkeypatch.setattr(solver.__spec__, "submodule_search_locations", [str(copy)])

    def digest():
        identity.solver_digest.cache_clear()
        return identity.solver_digest()

    before, seen = digest(), set()
    paths = sorted(copy.rglob("*.py"))
    assert any(path.parent != copy for path in paths)
    for path in paths:
        text = path.read_bytes()
        path.write_bytes(text + b"# changed\n")
        seen.add(digest())
        path.write_bytes(text)
    assert digest() == before
    room = next(path for path in paths if path.parent != copy and path.name != "__init__.py")
    room.rename(copy / room.name)
    seen.add(digest())
    identity.solver_digest.cache_clear()
    assert len(seen - {before}) == len(paths) + 1
