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
from numba.core.event import trigger_event

from studyrunner.kinds.task import Part
from studyrunner.mpi import dispatch
from studyrunner.mpi.dispatch import CostModel, Dispatcher
from studyrunner.mpi.ranks import Ranks, launcher_rank, launcher_size
from studyrunner.mpi.schedule import COMPILING, TaskHandler, serve_tasks
from studyrunner.study.study_file import read_study
from studyrunner.system.machine import open_mapped, write_mapped
from studyrunner.system.progress import ProgressDisplay, Standing
from studyrunner.task_runs import StudyRun
from tests.benchmarks.scheduling import MemoryIndex
from tests.studyrunner.fakes import fake_history, fake_sweep, plan_of


@dataclass(frozen=True)
class Job:
    kind: str
    costs: tuple[float, ...] = (1.0,)
    gives_starts: bool = False

    @property
    def cost_keys(self):
        return (("all", self.kind),)


def serve(tasks, run, take=lambda *_: []):
    """What was learnt of the costs, and the progress that was said."""
    handler, said = TaskHandler(), []
    handler.begin, handler.take, handler.keep = lambda: tasks, take, lambda _, progress: said.append(progress)
    serve_tasks(Ranks(), handler, lambda job, _: run(job))
    return handler.costs.sums, said


def test_long_tasks_go_first_and_results_make_new_ones():
    done: list[tuple[str, object]] = []

    def take(job, result):
        done.append((job.kind, result))
        return [Job("a1", (1e5,)), Job("a2", (1e6,))] if job.kind == "a" else []

    serve([Job("b", (10.0,)), Job("a", gives_starts=True)], lambda job: iter([job.kind.upper()]), take)
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

    serve([Job("a", (1.0, 1.0))], run, take)
    assert results == [1, 2]


def test_compiling_is_said_and_is_no_part_of_what_a_task_takes():
    def run(_):
        with trigger_event("numba:compile"), trigger_event("numba:compile"):
            time.sleep(0.5)
        yield "first"

    sums, said = serve([Job("a")], run)
    assert said == [COMPILING, ""]
    assert sums["all"][0] < 0.5


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


# --- arrays in a file that several processes map, and which ranks see it ---


def test_what_one_writes_is_not_seen_by_others_and_all_layouts_are_kept(tmp_path):
    given = {"c": np.arange(6.0).reshape(2, 3), "f": np.asfortranarray(np.eye(3)), "none": np.zeros((0, 2)), "n": None}
    given["part"] = np.arange(10.0)[::2]
    written = write_mapped(given, tmp_path / "things")
    one, other = open_mapped(written), open_mapped(written)
    one["c"][0, 0] = 7.0
    assert other["c"][0, 0] == 0.0
    written.path.unlink()
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


def tasks_of(*overrides):
    axes = ("frequency={start=1, stop=2, num=8}", "wear_coefficient=[1e-12, 7e-12]", "step=1000", "scheme=implicit")
    given = [*(f"axes.{each}" for each in (*axes, "sweep=['up', 'down']")), *overrides]
    return plan_of(read_study("sdof_slider", given), 2)


def swept(progress, plan):
    """The histories that begin once all start states are there, which took as long as was planned."""
    for sweep in plan.sweeps:
        for start, seconds in zip(fake_sweep(sweep), sweep.costs, strict=True):
            progress.costs.learn(sweep.cost_keys, seconds, seconds)
            yield from progress.take(sweep, start)


def test_the_seconds_left_fall_to_none_and_follow_what_was_measured():
    plan = tasks_of()
    progress = StudyRun(MemoryIndex(plan), None, None, 2)
    planned = sum(task.cost for task in progress.tasks)
    # one rank waits for a start state
    running = [(progress.tasks[0], plan.sweeps[0].n_results, 0.0)]
    assert progress.look(running).seconds_left == pytest.approx(planned / 2)
    for sweep in plan.sweeps:
        # the first one is dearer, as was planned, and says nothing of the others
        assert sum(sweep.costs) == pytest.approx(sweep.cost)
        assert sweep.costs[0] > 5.0 * sweep.costs[1]
    histories = []
    for history in swept(progress, plan):
        histories.append(history)
        assert progress.look(()).seconds_left <= planned / 2
    for number, task in enumerate(histories, start=1):
        progress.costs.learn(task.cost_keys, task.cost, 2.0 * task.cost)
        progress.take(task, fake_history(task))
        left = sum(history.cost for history in histories[number:])
        if 8 < number < len(histories) - 1:
            assert progress.look(()).seconds_left == pytest.approx(left, rel=0.3, abs=1e-9)
    assert progress.look(()).seconds_left == pytest.approx(0.0, abs=1e-9)
    assert progress.look(()).n_done == progress.look(()).n_points == plan.n_points


def test_before_a_history_has_ended_it_is_as_late_as_the_sweeps_were():
    plan = tasks_of()
    progress = StudyRun(MemoryIndex(plan), None, None, 1)
    for sweep in plan.sweeps:
        for start, seconds in zip(fake_sweep(sweep), sweep.costs, strict=True):
            progress.costs.learn(sweep.cost_keys, seconds, 5.0 * seconds)
            progress.take(sweep, start)
    planned = sum(seconds for group, seconds in progress._left.items() if "sweep" not in group)
    assert progress.look(()).seconds_left == pytest.approx(5.0 * planned, rel=0.1)


def test_a_task_that_says_how_far_it_is_tells_the_time_left(monkeypatch):
    plan = tasks_of("axes.wear_coefficient=1e-12")
    progress, now = StudyRun(MemoryIndex(plan), None, None, 1), 100.0
    monkeypatch.setattr("studyrunner.task_runs.time.monotonic", lambda: now)
    history, *waiting = swept(progress, plan)
    alike = sum(task.cost for task in waiting if task.group == history.group)
    rest = sum(task.cost for task in waiting) - alike
    progress.keep(history, Part(0.25, "1 of 4"))
    now = 110.0
    # a quarter was done in 50 s, 10 s ago; similar tasks take as many times their estimate
    left = 140.0 + alike * 200.0 / history.cost + rest
    found = progress.look([(history, 1, 60.0)])
    assert found.seconds_left == pytest.approx(left, rel=1e-6)
    assert "1 of 4" in found.running[0]


def test_a_few_cheap_results_do_not_shorten_the_time_left():
    """Far from the resonance nothing slips: of the bundled study 20 s were said to be left at 9 s of 66 s."""
    plan = tasks_of()
    progress = StudyRun(MemoryIndex(plan), None, None, 2)
    histories = [*swept(progress, plan)]
    for task in histories[:2]:
        progress.costs.learn(task.cost_keys, task.cost, 0.05 * task.cost)
        progress.take(task, fake_history(task))
    left = sum(task.cost for task in histories[2:]) / 2
    assert 0.7 * left < progress.look(()).seconds_left < left


def test_what_waits_is_bounded(monkeypatch):
    """A sweep does not go first where more waits than all ranks have use for."""
    monkeypatch.setattr(dispatch, "_WAITING", 10)
    monkeypatch.setattr(dispatch, "_WAITING_A_RANK", 0)
    dispatcher = Dispatcher(1, CostModel(), time.monotonic)
    dispatcher.add([Job("sweep", (1.0,) * 4, True)] * 50)
    most, n_done, waiting = 0, 0, 0
    while not dispatcher.done:
        ((rank, number, task),) = dispatcher.assign()
        for _ in task.costs:
            dispatcher.deliver(rank, number, 1.0)
            if task.gives_starts:
                dispatcher.add([Job("history")])
                waiting += 1
        if not task.gives_starts:
            n_done, waiting = n_done + 1, waiting - 1
        most = max(most, waiting)
    assert (n_done, waiting) == (200, 0)
    assert most < 10 + 4
