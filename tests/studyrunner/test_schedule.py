"""The schedule on one rank, and the ranks without MPI."""

import sys
import threading
from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from studyrunner.mpi import dispatch
from studyrunner.mpi.dispatch import CostModel, Dispatcher
from studyrunner.mpi.ranks import LauncherError, Ranks, launcher_rank, launcher_size, start_ranks
from studyrunner.mpi.schedule import Office, serve_tasks


def serve(tasks, run, take=lambda *_: []):
    office = Office()
    office.begin, office.take = lambda: tasks, take
    serve_tasks(Ranks(), office, lambda job, _: run(job))


def test_long_tasks_go_first_and_results_make_new_ones():
    done: list[tuple[str, object]] = []

    def run(job):
        yield job.kind.upper()

    def take(job, result):
        done.append((job.kind, result))
        return [Job("a1", 1e5), Job("a2", 1e6)] if job.kind == "a" else []

    serve([Job("b", 10.0), Job("a", 1.0, gives_starts=True)], run, take)
    assert done == [("a", "A"), ("a2", "A2"), ("a1", "A1"), ("b", "B")]


def test_results_arrive_while_their_task_goes_on():
    taken = threading.Event()

    def run(job):
        yield 1
        assert taken.wait(120.0)
        yield 2

    def take(job, result):
        taken.set()
        results.append(result)
        return []

    results: list[object] = []
    serve([Job("a", 1.0, n_results=2)], run, take)
    assert results == [1, 2]


@pytest.mark.parametrize(("given", "said"), [(0, 1), (1, 2), (2, 1)])
def test_another_number_of_results_than_said_is_a_bug(given, said):
    with pytest.raises(ValueError, match=f"not {said} results"):
        serve([Job("a", 1.0, n_results=said)], lambda _: range(given))


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
    with pytest.raises(LauncherError, match="2 processes were started that cannot talk"):
        start_ranks()


@dataclass(frozen=True)
class Job:
    kind: str
    cost: float
    n_results: int = 1
    gives_starts: bool = False

    @property
    def cost_keys(self):
        return (("all", self.kind),)


def make(n_ranks, *jobs):
    clock = SimpleNamespace(now=0.0)
    dispatcher = Dispatcher(n_ranks, CostModel(), lambda: clock.now)
    dispatcher.add(jobs)
    return dispatcher, clock


def handed_out(dispatcher):
    return [(rank, assignment.number) for rank, assignment in dispatcher.assign()]


def test_what_waits_is_bounded(monkeypatch):
    """A branch does not go first where more waits than all ranks have use for."""
    monkeypatch.setattr(dispatch, "_WAITING", 10)
    monkeypatch.setattr(dispatch, "_WAITING_A_RANK", 0)
    branches = [Job("branch", 1.0, 4, True)] * 50
    dispatcher, _ = make(1, *branches)
    most, n_done, waiting = 0, 0, 0
    while not dispatcher.done:
        ((rank, assignment),) = dispatcher.assign()
        for _ in range(assignment.task.n_results):
            dispatcher.deliver(rank, assignment.number, 1.0)
            if assignment.task.gives_starts:
                dispatcher.add([Job("march", 1.0)])
                waiting += 1
        if not assignment.task.gives_starts:
            n_done, waiting = n_done + 1, waiting - 1
        most = max(most, waiting)
    assert (n_done, waiting) == (200, 0)
    assert most < 10 + 4


def test_a_task_that_does_not_end_teaches_and_is_forgotten_when_it_does():
    jobs = [Job("a", 2.0), *[Job("b", 2.0)] * 20, *[Job("a", 1.5)] * 20]
    dispatcher, clock = make(2, *jobs)
    first, (rank, number) = handed_out(dispatcher)
    assert (jobs[first[1]].kind, jobs[number].kind) == ("a", "b")
    clock.now = 99.0
    dispatcher.deliver(rank, number, 2.0)
    ((rank, number),) = handed_out(dispatcher)
    assert jobs[number].kind == "b"
    clock.now = 100.0
    dispatcher.watch()
    dispatcher.deliver(rank, number, 2.0)
    ((_, number),) = handed_out(dispatcher)
    assert jobs[number].kind == "a"
    costs = dispatcher._costs
    late = costs.correction((("all", "a"),))
    dispatcher.deliver(first[0], first[1], 2.0)
    assert costs.measured("a") == 2.0
    assert costs.correction((("all", "a"),)) < 2.0 < late
