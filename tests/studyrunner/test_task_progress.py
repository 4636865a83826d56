"""How far a study is, and a replay of many ranks: every march is done once, and the ranks are busy."""

import pytest

from studyrunner.plan.planning import build_tasks
from studyrunner.plan.results import StartResult
from studyrunner.study.study_file import read_study
from studyrunner.task_progress import TaskProgress
from tests.benchmarks.simulation import MemoryIndex, Overheads, replay
from tests.studyrunner.fakes import fake_branch, fake_march


def plan_of():
    overrides = ("axes.frequency={start=1, stop=2, num=8}", "axes.step=[100, 1000]", "axes.sweep=['up', 'down']")
    return build_tasks(read_study("sdof_slider", overrides), 2)


def test_the_seconds_left_fall_to_none_and_follow_what_was_measured():
    plan = plan_of()
    progress = TaskProgress(MemoryIndex(plan))
    assert progress.look(()).seconds_left == pytest.approx(plan.cost)
    marches = []
    for branch in plan.branches:
        for started in fake_branch(branch):
            progress.costs.learn(branch.cost_keys, branch.cost_of(first=False), 1.0)
            marches.extend(progress.take(branch, started))
    assert progress.n_starts_left == 0
    for number, task in enumerate(marches, start=1):
        progress.costs.learn(task.cost_keys, task.cost, 2.0 * task.cost)
        progress.take(task, fake_march(task))
        left = 2.0 * sum(march.cost for march in marches[number:])
        if number > 8:
            assert progress.look(()).seconds_left == pytest.approx(left, rel=0.3, abs=1e-9)
    assert progress.look(()).seconds_left == pytest.approx(0.0, abs=1e-9)
    assert progress.look(()).n_done == progress.look(()).n_points == plan.n_points


def test_tasks_that_run_count_for_the_time_left_and_are_named():
    plan = plan_of()
    progress = TaskProgress(MemoryIndex(plan))
    up, down = plan.branches
    (march, *_) = progress.take(up, next(iter(fake_branch(up))))
    all_of_it = progress.look(()).seconds_left
    expected = march.cost
    half = progress.look([(march, 1, 0.5 * expected)])
    assert half.seconds_left == pytest.approx(all_of_it - 0.5 * expected)
    both = progress.look([(march, 1, 0.5 * expected), (down, down.n_results - 2, 0.0)])
    assert both.seconds_left == pytest.approx(0.5 * half.seconds_left)
    assert half.running == ("1 Hz implicit",)
    # a sweep down that has given two states is on the way to the third
    assert both.running[1] == f"sweep down to {down.frequencies[-3]:.6g} Hz"
    # what is late is not over at once, and takes less than once more what it has taken
    alone = TaskProgress(MemoryIndex(plan))
    assert 0.2e6 <= alone.look([(march, 1, 1e6)]).seconds_left <= 0.5e6


@pytest.mark.parametrize("n_ranks", [1, 3, 1000])
def test_a_replay_takes_as_long_as_its_tasks_allow(n_ranks):
    """Equal costs and no overheads: the time is that of the work, or of a branch and a march."""
    plan = plan_of()

    def started(branch, position):
        return StartResult(position, None, moves=True, n_unknowns=6), 1.0

    found = replay(plan, started, lambda _: 10.0, n_ranks, Overheads(0.0, 0.0, 0.0))
    n_starts, n_marches = 16, sum(len(line) for line in plan.marches)
    assert found.n_unfinished == 0
    assert found.work == pytest.approx(n_starts + 10.0 * n_marches)
    assert found.longest_way == pytest.approx(8.0 + 10.0)
    shortest = max(found.longest_way, found.work / n_ranks)
    assert shortest - 1e-9 <= found.makespan <= shortest + 10.0
    if n_ranks in (1, 1000):
        assert found.makespan == pytest.approx(shortest)
