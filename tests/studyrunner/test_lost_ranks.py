"""What becomes of the tasks of a rank that is lost: nothing is counted twice, and none takes all ranks with it.

Its notes on crashes are counted once each, and are never the way to another file.
"""

import os

import numpy as np
import pytest

from solver.outcome import Outcome
from solver.packing import Packed
from studyrunner.mpi.crashes import Crash, count_crashes, forget_crashes, read_tally
from studyrunner.plan.planning import build_tasks
from studyrunner.plan.tasks import BranchTask, MarchTask
from studyrunner.study.study_file import read_study
from studyrunner.task_progress import TaskProgress
from tests.studyrunner.fakes import fake_branch, fake_march, open_completion

OVERRIDES = ("axes.frequency={start=1, stop=2, num=5}", "axes.step=[100, 200]", "axes.wear_coefficient=[1e-11, 5e-12]")


@pytest.fixture
def completion(tmp_path):
    study = read_study("sdof_slider", OVERRIDES)
    completion = open_completion(study, build_tasks(study, 2), tmp_path / "out.nc.progress")
    yield completion
    completion.store.close()


def begin(completion, n_starts):
    """The progress of a run whose branch has given its first start states, and the marches from them."""
    progress = TaskProgress(completion)
    (branch,) = progress.begin()
    assert isinstance(branch, BranchTask)
    marches = []
    for started in list(fake_branch(branch))[:n_starts]:
        progress.costs.learn(branch.cost_keys, branch.cost_of(first=False), 1.0)
        marches.extend(progress.take(branch, started))
    return progress, branch, marches


def finish(progress, tasks):
    while tasks:
        task = tasks.pop(0)
        if isinstance(task, BranchTask):
            for started in fake_branch(task):
                tasks.extend(progress.take(task, started))
        else:
            for place in range(task.n_results):
                progress.take(task, fake_march(task, place=place))


def assert_finished(progress, completion):
    completion.store.flush()
    assert progress.n_points == completion.n_points_finished == completion.plan.n_points
    assert progress.n_starts_left == 0
    assert all(seconds == pytest.approx(0.0, abs=1e-9) for seconds in progress._left.values())


def test_a_branch_goes_on_behind_what_it_has_given(completion):
    progress, branch, marches = begin(completion, 2)
    completion.keep(branch, Packed("progress", (np.ones(3),)))
    (again,) = progress.take_back([(branch, 3)], {})
    assert isinstance(again, BranchTask)
    assert again.order_left == branch.order[2:]
    assert again.resume.text == "progress"
    assert again.cost == pytest.approx(3 * branch.cost_of(first=False))
    finish(progress, [again, *marches])
    assert_finished(progress, completion)


@pytest.mark.parametrize("earlier", [0, 1])
def test_a_march_that_crashed_twice_is_not_given_again(earlier, completion):
    progress, _, (first, crashed, *others) = begin(completion, 5)
    lost = [(first, first.n_results), (crashed, crashed.n_results)]
    if earlier:
        # in a run before this one
        progress._n_lost.update(TaskProgress(completion, {crashed.key: 1})._n_lost)
    else:
        assert progress.take_back(lost, {crashed.key: Crash(crashed.key, None, "Aborted")}) == [first, crashed]
    (again,) = progress.take_back(lost, {crashed.key: Crash(crashed.key, None, "Aborted")})
    assert again == first
    finish(progress, [again, *others])
    assert_finished(progress, completion)
    assert len(completion.store.with_outcome({Outcome.CRASHED.meaning})) == crashed.n_results


def crash_text(key):
    return f'{key}\nFatal Python error: Aborted\n  File "x.py", line 1 in f\n  File "crashes.py", line 2 in noted\n'


@pytest.mark.parametrize("key", ["../precious", "f" * 32 + "/..", "F" * 32, "0" * 31])
def test_what_a_crash_says_of_its_task_leads_nowhere_else(key, tmp_path):
    folder = tmp_path / "out.nc.crashes"
    folder.mkdir()
    (folder / "rank-3.crash").write_text(crash_text(key))
    assert count_crashes(folder) == ()
    assert sorted(tmp_path.rglob("*")) == [folder]


def test_crashes_are_counted_once_each(tmp_path):
    for number in (1, 2):
        (tmp_path / "rank-3.crash").write_text(crash_text("a" * 32))
        assert [crash.key for crash in count_crashes(tmp_path, rank=3)] == ["a" * 32]
        assert count_crashes(tmp_path) == count_crashes(tmp_path, rank=3) == ()
        assert {key: len(crashes) for key, crashes in read_tally(tmp_path).items()} == {"a" * 32: number}
    forget_crashes(tmp_path, {"b" * 32})
    assert len(read_tally(tmp_path)) == 1
    forget_crashes(tmp_path, None)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("what", ["fifo", "folder", "endless", "link to nowhere"])
@pytest.mark.parametrize("name", ["rank-0.crash", f"{'0' * 32}.1.died"])
def test_notes_are_plain_files(what, name, tmp_path):
    odd = tmp_path / name
    if what in ("fifo", "folder"):
        {"fifo": os.mkfifo, "folder": os.mkdir}[what](odd)
    else:
        odd.symlink_to("/dev/zero" if what == "endless" else tmp_path / "none")
    assert (count_crashes(tmp_path), read_tally(tmp_path)) == ((), {})
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("kind", [BranchTask, MarchTask])
def test_a_task_takes_two_ranks_with_it_and_no_more(kind, completion):
    """It may need more memory than there is; a task that only waits on a rank is none the worse for its loss."""
    progress, branch, marches = begin(completion, 2 if kind is BranchTask else 5)
    task, n_left = (branch, 3) if kind is BranchTask else (marches[0], marches[0].n_results)
    waiting = marches[-1]
    assert len(progress.take_back([(task, n_left), (waiting, waiting.n_results)], {})) == 2
    assert progress.take_back([(task, n_left), (waiting, waiting.n_results)], {}) == [waiting]
    finish(progress, list(marches[kind is MarchTask :]))
    completion.store.flush()
    assert progress.n_points == completion.n_points_finished == completion.plan.n_points
