"""What becomes of the tasks of a rank that is lost: nothing is counted twice, and none takes all ranks with it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from studyrunner.checkpoint.completion_index import Ledger
from studyrunner.course import Course
from studyrunner.evaluate import CRASHED
from studyrunner.mpi.crashes import Crash
from studyrunner.plan.results import Kept
from studyrunner.plan.tasks import BranchTask, MarchTask, build_tasks
from studyrunner.study.study_file import read_study
from tests.studyrunner.fakes import fake_branch, fake_march, open_ledger

OVERRIDES = ("axes.frequency={start=1, stop=2, num=5}", "axes.step=[100, 200]", "axes.wear_coefficient=[1e-11, 5e-12]")


@pytest.fixture
def ledger(tmp_path: Path) -> Iterator[Ledger]:
    study = read_study("sdof_slider", OVERRIDES)
    ledger = open_ledger(study, build_tasks(study, 2), tmp_path / "parts")
    yield ledger
    ledger.store.close()


def begin(ledger: Ledger, n_starts: int) -> tuple[Course, BranchTask, list[MarchTask]]:
    """A course whose branch has given its first start states, and the marches from them."""
    course = Course(ledger)
    (branch,) = course.begin()
    assert isinstance(branch, BranchTask)
    marches = []
    for started in list(fake_branch(branch))[:n_starts]:
        course.costs.learn(branch.kin, branch.cost / branch.n_results, 1.0)
        marches.extend(course.take(branch, started))
    return course, branch, marches


def finish(course: Course, tasks: list[BranchTask | MarchTask]) -> None:
    while tasks:
        task = tasks.pop(0)
        if isinstance(task, BranchTask):
            for started in fake_branch(task):
                tasks.extend(course.take(task, started))
        else:
            for place in range(task.n_results):
                course.take(task, fake_march(task, place=place))


def assert_finished(course: Course, ledger: Ledger) -> None:
    ledger.store.flush()
    assert course.n_points == ledger.n_points_finished == ledger.plan.n_points
    assert course.n_starts_left == 0
    assert all(seconds == pytest.approx(0.0, abs=1e-9) for seconds in course._left.values())


def test_a_branch_goes_on_behind_what_it_has_given(ledger: Ledger) -> None:
    course, branch, marches = begin(ledger, 2)
    ledger.keep(branch, Kept("progress", (np.ones(3),)))
    (again,) = course.take_back([(branch, 3)], {})
    assert isinstance(again, BranchTask)
    assert again.order_left == branch.order[2:]
    assert again.resume is not None
    assert again.resume.text == "progress"
    assert again.cost == pytest.approx(0.6 * branch.cost)
    finish(course, [again, *marches])
    assert_finished(course, ledger)


def test_a_march_gives_all_its_histories_again(ledger: Ledger) -> None:
    course, _, marches = begin(ledger, 5)
    march = next(task for task in marches if task.n_results > 1)
    course.take(march, fake_march(march))
    ledger.keep(march, Kept("progress", (np.ones(3),)))
    (again,) = course.take_back([(march, march.n_results - 1)], {})
    assert (again, again.resume is not None) == (march, True)
    finish(course, [again, *(task for task in marches if task != march)])
    assert_finished(course, ledger)


@pytest.mark.parametrize("earlier", [0, 1])
def test_a_march_that_crashed_twice_is_not_given_again(earlier: int, ledger: Ledger) -> None:
    course, _, (first, crashed, *others) = begin(ledger, 5)
    lost = [(first, first.n_results), (crashed, crashed.n_results)]
    if earlier:
        # in a run before this one
        course._n_lost.update(Course(ledger, {crashed.key: 1})._n_lost)
    else:
        assert course.take_back(lost, {crashed.key: Crash(crashed.key, None, "Aborted")}) == [first, crashed]
    (again,) = course.take_back(lost, {crashed.key: Crash(crashed.key, None, "Aborted")})
    assert again == first
    finish(course, [again, *others])
    assert_finished(course, ledger)
    assert len(ledger.store.select(lambda records: records["outcome"] == CRASHED)) == crashed.n_results


def test_a_branch_that_crashed_twice_ends_there(ledger: Ledger) -> None:
    """What it has computed before and not yet sent is computed again."""
    course, branch, marches = begin(ledger, 2)
    (again,) = course.take_back([(branch, 3)], {branch.key: Crash(branch.key, branch.order[3], "Aborted")})
    assert isinstance(again, BranchTask)
    assert again.order_left == branch.order[2:]
    (again,) = course.take_back([(branch, 3)], {branch.key: Crash(branch.key, branch.order[3], "Aborted")})
    assert isinstance(again, BranchTask)
    assert again.order_left == (branch.order[2],)
    finish(course, [again, *marches])
    ledger.store.flush()
    assert course.n_points == ledger.n_points_finished == ledger.plan.n_points
    assert course.n_starts_left == 0


@pytest.mark.parametrize("kind", [BranchTask, MarchTask])
def test_a_task_takes_two_ranks_with_it_and_no_more(kind: type, ledger: Ledger) -> None:
    """It may need more memory than there is; a task that only waits on a rank is none the worse for its loss."""
    course, branch, marches = begin(ledger, 2 if kind is BranchTask else 5)
    task, n_left = (branch, 3) if kind is BranchTask else (marches[0], marches[0].n_results)
    waiting = marches[-1]
    assert len(course.take_back([(task, n_left), (waiting, waiting.n_results)], {})) == 2
    assert course.take_back([(task, n_left), (waiting, waiting.n_results)], {}) == [waiting]
    finish(course, list(marches[kind is MarchTask :]))
    ledger.store.flush()
    assert course.n_points == ledger.n_points_finished == ledger.plan.n_points
