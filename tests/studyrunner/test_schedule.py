"""The schedule on one rank, the ranks without MPI, files that ranks map, and what a user sees while a study runs."""

import io
import itertools
import sys
import threading
import time
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from studyrunner import task_runs
from studyrunner.cli import main
from studyrunner.mpi import dispatch
from studyrunner.mpi.dispatch import CostModel, Dispatcher
from studyrunner.mpi.ranks import LauncherError, Ranks, launcher_rank, launcher_size, start_ranks
from studyrunner.mpi.schedule import TaskHandler, serve_tasks
from studyrunner.study.study_file import read_study
from studyrunner.system.machine import open_mapped, write_mapped
from studyrunner.system.progress import ProgressDisplay, Standing
from studyrunner.task_runs import StudyRun
from tests.benchmarks.scheduling import MemoryIndex
from tests.studyrunner.fakes import fake_history, fake_sweep, plan_of


@dataclass(frozen=True)
class Job:
    kind: str
    cost: float
    n_results: int = 1
    gives_starts: bool = False

    @property
    def cost_keys(self):
        return (("all", self.kind),)


def serve(tasks, run, take=lambda *_: []):
    handler = TaskHandler()
    handler.begin, handler.take = lambda: tasks, take
    serve_tasks(Ranks(), handler, lambda job, _: run(job))


def test_long_tasks_go_first_and_results_make_new_ones():
    done: list[tuple[str, object]] = []

    def take(job, result):
        done.append((job.kind, result))
        return [Job("a1", 1e5), Job("a2", 1e6)] if job.kind == "a" else []

    serve([Job("b", 10.0), Job("a", 1.0, gives_starts=True)], lambda job: iter([job.kind.upper()]), take)
    assert done == [("a", "A"), ("a2", "A2"), ("a1", "A1"), ("b", "B")]


def test_results_arrive_while_their_task_goes_on():
    taken, results = threading.Event(), []

    def run(_):
        yield 1
        assert taken.wait(120.0)
        yield 2

    def take(_, result):
        results.append(result)
        taken.set()
        return []

    serve([Job("a", 1.0, n_results=2)], run, take)
    assert results == [1, 2]


@pytest.mark.parametrize(
    ("environment", "size", "rank"),
    [
        ({}, 0, 0),
        ({"PMI_SIZE": "4", "PMI_RANK": "3"}, 4, 3),
        ({"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "1"}, 2, 1),
        ({"SLURM_NTASKS": "8", "SLURM_PROCID": "0"}, 0, 0),
        ({"SLURM_STEP_NUM_TASKS": "8", "SLURM_PROCID": "5"}, 8, 5),
        ({"PMI_SIZE": "two"}, 0, 0),
    ],
)
def test_what_the_launcher_says(environment, size, rank):
    assert (launcher_size(environment), launcher_rank(environment)) == (size, rank)


def test_several_processes_without_mpi_are_refused(monkeypatch):
    monkeypatch.setenv("PMI_SIZE", "2")
    monkeypatch.setitem(sys.modules, "mpi4py", None)
    with pytest.raises(LauncherError, match="2 processes"):
        start_ranks()


# --- arrays in a file that several processes map, and which ranks see it ---


def test_what_one_writes_is_not_seen_by_others_and_all_layouts_are_kept(tmp_path):
    given = {"c": np.arange(6.0).reshape(2, 3), "f": np.asfortranarray(np.eye(3)), "none": np.zeros((0, 2)), "n": None}
    given["part"] = np.arange(10.0)[::2]
    written = write_mapped(given, tmp_path / "things")
    one, other = open_mapped(written), open_mapped(written)
    one["c"][0, 0] = 7.0
    assert other["c"][0, 0] == 0.0
    written.remove()
    for name in ("f", "none", "part"):
        np.testing.assert_array_equal(other[name], given[name])
    assert other["c"].flags.aligned
    assert other["f"].flags.f_contiguous
    assert other["n"] is None


# --- what a user sees ---


def test_a_line_every_half_minute_at_least(monkeypatch, capsys):
    clock, looks = SimpleNamespace(now=1000.0), []
    monkeypatch.setattr("studyrunner.system.progress.time.monotonic", lambda: clock.now)

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


def test_a_bar_on_a_terminal(monkeypatch):
    screen = io.StringIO()
    screen.isatty = lambda: True
    monkeypatch.setattr(sys, "stderr", screen)
    for name, value in (("TERM", "xterm"), ("COLUMNS", "160")):
        monkeypatch.setenv(name, value)
    with ProgressDisplay() as shown:
        shown.say("computing")
        shown.tick(lambda: Standing(5, 20, 0.25, 30.0, ("210 Hz implicit",)))
        shown._bar.refresh()
    assert "5 of 20 points, 25 %, about 30 s left, running: 210 Hz implicit" in screen.getvalue()


@pytest.mark.parametrize("compiles", [True, False])
def test_a_run_that_has_to_compile_says_so_once(compiles, solver, tmp_path, monkeypatch, capsys):
    solver.disturb = lambda *_: time.sleep(0.05)
    numbers = itertools.count(3) if compiles else itertools.repeat(3)
    monkeypatch.setattr(task_runs, "n_compiled", lambda: next(numbers))
    assert main(["sdof_slider", "--set", "axes.frequency=100", "-o", str(tmp_path / "out.nc")]) == 0
    said = capsys.readouterr().err
    assert said.count("the solver is compiled for this machine") == int(compiles)


def tasks_of():
    axes = ("frequency={start=1, stop=2, num=8}", "wear_coefficient=[1e-12, 7e-12]", "step=1000", "scheme=implicit")
    return plan_of(read_study("sdof_slider", [f"axes.{each}" for each in (*axes, "sweep=['up', 'down']")]), 2)


def test_the_seconds_left_fall_to_none_and_follow_what_was_measured():
    plan = tasks_of()
    progress = StudyRun(MemoryIndex(plan), None, None)
    assert progress.look(()).seconds_left == pytest.approx(sum(task.cost for task in progress.tasks))
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


def test_what_waits_is_bounded(monkeypatch):
    """A sweep does not go first where more waits than all ranks have use for."""
    monkeypatch.setattr(dispatch, "_WAITING", 10)
    monkeypatch.setattr(dispatch, "_WAITING_A_RANK", 0)
    dispatcher = Dispatcher(1, CostModel(), time.monotonic)
    dispatcher.add([Job("sweep", 1.0, 4, True)] * 50)
    most, n_done, waiting = 0, 0, 0
    while not dispatcher.done:
        ((rank, number, task),) = dispatcher.assign()
        for _ in range(task.n_results):
            dispatcher.deliver(rank, number, 1.0)
            if task.gives_starts:
                dispatcher.add([Job("history", 1.0)])
                waiting += 1
        if not task.gives_starts:
            n_done, waiting = n_done + 1, waiting - 1
        most = max(most, waiting)
    assert (n_done, waiting) == (200, 0)
    assert most < 10 + 4
