"""What a user sees while a study runs: a bar on a terminal, a line every half minute elsewhere."""

import io
import itertools
import re
import sys
import time
from types import SimpleNamespace

import pytest

from studyrunner import task_runs
from studyrunner.cli import main
from studyrunner.kinds.kind import build_tasks
from studyrunner.kinds.task import StartResult
from studyrunner.study.study_file import read_study
from studyrunner.system.progress import ProgressDisplay, Standing
from studyrunner.task_runs import TaskProgress
from tests.benchmarks.simulation import MemoryIndex, Overheads, replay
from tests.studyrunner.fakes import fake_history, fake_sweep

LINE = re.compile(
    r"\[ *[\d.]+ (?:s|min|h)\] (?P<done>\d+) of (?P<all>\d+) points?, (?P<percent>\d+) %"
    r"(?:, about (?P<left>[\d.]+ (?:s|min|h)) left)?(?:, running: (?P<running>.*))?"
)


@pytest.fixture
def clock(monkeypatch):
    """Stands for `time.monotonic`."""
    found = SimpleNamespace(now=1000.0)
    monkeypatch.setattr("studyrunner.system.progress.time.monotonic", lambda: found.now)
    return found


def test_a_line_every_half_minute_at_least(clock, capsys):
    looks = []

    def look():
        looks.append(clock.now)
        return Standing(5, 20, 0.25, 3.0 * (clock.now - 1000.0), ("sweep up to 211 Hz", "210 Hz implicit"))

    with ProgressDisplay() as shown:
        shown.say("computing")
        for tenth in range(36_000):
            clock.now = 1000.0 + 0.1 * tenth
            shown.tick(look)
    first, *lines = capsys.readouterr().err.splitlines()
    assert first == "[    0 s] computing"
    assert lines[0] == ("[    2 s] 5 of 20 points, 25 %, about 6 s left, running: sweep up to 211 Hz, 210 Hz implicit")
    gaps = [later - before for before, later in itertools.pairwise(looks)]
    assert len(lines) == len(looks)
    assert 2.0 - 1e-6 <= min(gaps) <= max(gaps) <= 30.2
    # not more often than that either
    assert len(lines) < 3600 / 30 + 12


def test_a_bar_on_a_terminal(clock, monkeypatch):
    screen = io.StringIO()
    screen.isatty = lambda: True
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "160")
    looks = []

    def look():
        looks.append(clock.now)
        return Standing(5, 20, 0.25, 30.0, ("210 Hz implicit",))

    with ProgressDisplay() as shown:
        shown.say("computing")
        for _ in range(1000):
            clock.now += 0.01
            shown.tick(look)
        shown._bar.refresh()
    seen = screen.getvalue()
    assert "0%" in seen
    assert "25%" in seen
    assert "5 of 20 points, 25 %, about 30 s left, running: 210 Hz implicit" in seen
    # a look costs something, a tick does not
    assert 90 <= len(looks) <= 101


@pytest.mark.parametrize("compiles", [True, False])
def test_a_run_that_has_to_compile_says_so_once(compiles, solver, tmp_path, monkeypatch, capsys):
    solver.disturb = lambda *_: time.sleep(0.05)
    numbers = itertools.count(3) if compiles else itertools.repeat(3)
    monkeypatch.setattr(task_runs, "n_compiled", lambda: next(numbers))
    assert main(["sdof_slider", "--set", "axes.frequency=100", "-o", str(tmp_path / "out.nc")]) == 0
    said = capsys.readouterr().err
    assert said.count("the solver is compiled for this machine, once after an installation") == int(compiles)


def plan_of():
    wear = "axes.wear_coefficient=[1e-12, 7e-12]"
    steps = ("axes.step=1000", "axes.scheme=implicit")
    overrides = ("axes.frequency={start=1, stop=2, num=8}", wear, *steps, "axes.sweep=['up', 'down']")
    return build_tasks(read_study("sdof_slider", overrides), 2)


def test_the_seconds_left_fall_to_none_and_follow_what_was_measured():
    plan = plan_of()
    progress = TaskProgress(MemoryIndex(plan))
    assert progress.look(()).seconds_left == pytest.approx(plan.cost)
    histories = []
    for sweep in plan.sweeps:
        for start in fake_sweep(sweep):
            progress.costs.learn(sweep.cost_keys, sweep.cost / sweep.n_results, 1.0)
            histories.extend(progress.take(sweep, start))
    for number, task in enumerate(histories, start=1):
        progress.costs.learn(task.cost_keys, task.cost, 2.0 * task.cost)
        progress.take(task, fake_history(task))
        left = 2.0 * sum(history.cost for history in histories[number:])
        if number > 8:
            assert progress.look(()).seconds_left == pytest.approx(left, rel=0.3, abs=1e-9)
    assert progress.look(()).seconds_left == pytest.approx(0.0, abs=1e-9)
    assert progress.look(()).n_done == progress.look(()).n_points == plan.n_points


def test_tasks_that_run_count_for_the_time_left_and_are_named():
    plan = plan_of()
    progress = TaskProgress(MemoryIndex(plan))
    up, down = plan.sweeps
    (history, *_) = progress.take(up, next(iter(fake_sweep(up))))
    all_of_it = progress.look(()).seconds_left
    expected = history.cost
    half = progress.look([(history, 1, 0.5 * expected)])
    assert half.seconds_left == pytest.approx(all_of_it - 0.5 * expected)
    both = progress.look([(history, 1, 0.5 * expected), (down, down.n_results - 2, 0.0)])
    assert both.seconds_left == pytest.approx(0.5 * half.seconds_left)
    assert half.running == ("1 Hz implicit",)
    # a sweep down that has given two states is on the way to the third
    assert both.running[1] == f"sweep down to {down.frequencies[-3]:.6g} Hz"
    # what is late is not over at once; what is far behind may take as long again
    alone = TaskProgress(MemoryIndex(plan))
    for late, least, most in ((1.1, 0.2, 0.5), (1e6, 0.9, 1.0)):
        assert least <= alone._still(history, expected, late * expected) / (late * expected) <= most


def test_the_time_left_of_a_task_follows_the_share_of_it_that_is_done():
    """The task takes more than three times as long as it was expected to."""
    progress = TaskProgress(MemoryIndex(plan_of()))
    (task, *_) = progress.tasks
    expected, true = 57.0, 190.0
    left = []
    for percent in range(0, 100, 5):
        progress.keep(task, 0.01 * percent)
        left.append(progress._still(task, expected, 0.01 * percent * true))
    assert left[0] == expected
    assert max(left) < 2.0 * expected
    assert left[10:] == pytest.approx([0.01 * (100 - percent) * true for percent in range(50, 100, 5)])


@pytest.mark.parametrize("n_ranks", [1, 1000])
def test_a_replay_takes_as_long_as_its_tasks_allow(n_ranks):
    """Equal costs and no overheads: the time is that of the work, or of a sweep and a history."""
    plan = plan_of()

    def started(_, place):
        return StartResult(place, None, moves=True, n_unknowns=6), 1.0

    found = replay(plan, started, lambda _: 10.0, n_ranks, Overheads(0.0, 0.0, 0.0))
    n_starts, n_histories = 16, len(plan.results)
    assert found.n_unfinished == 0
    assert found.work == pytest.approx(n_starts + 10.0 * n_histories)
    assert found.longest_way == pytest.approx(8.0 + 10.0)
    shortest = max(found.longest_way, found.work / n_ranks)
    assert found.makespan == pytest.approx(shortest)


def test_a_sweep_says_where_it_is():
    """What a sweep sends on its way, by `Keep`, stands behind its name."""
    progress = TaskProgress(MemoryIndex(plan_of()))
    (sweep, *_) = progress.begin()
    progress.keep(sweep, "at 211.5 Hz, 3 of 48 pairs slip or open")
    assert (
        progress.look([(sweep, sweep.n_results, 1.0)]).running[0].endswith("(at 211.5 Hz, 3 of 48 pairs slip or open)")
    )
