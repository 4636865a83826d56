"""What becomes of the tasks of a rank that is lost: nothing is counted twice, and none takes all ranks with it."""

import numpy as np
import pytest

from solver.outcome import Outcome
from solver.packing import Packed
from studyrunner.mpi.crashes import Crash
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
