"""The schedule on one rank, and the ranks without MPI."""

import sys
import threading
import time

import pytest

from studyrunner.mpi.dispatch import Assignment
from studyrunner.mpi.launcher import LauncherError, launcher_rank, launcher_size
from studyrunner.mpi.ranks import Alone, start_ranks
from studyrunner.mpi.schedule import Handlers, _Delivery, serve_tasks
from studyrunner.plan.cost_model import CostModel
from tests.studyrunner.test_dispatch import Job


def take_nothing(job, result):
    return []


def serve(tasks, run, take=take_nothing):
    costs = CostModel()
    serve_tasks(Alone(), tasks, lambda job, _: run(job), Handlers(take), costs)
    return costs


def test_long_tasks_go_first_and_results_make_new_ones():
    done: list[tuple[str, object]] = []

    def run(job):
        yield job.kind.upper()

    def take(job, result):
        done.append((job.kind, result))
        return [Job("a1", 1e5), Job("a2", 1e6)] if job.kind == "a" else []

    serve([Job("b", 10.0), Job("a", 1.0, opens_others=True)], run, take)
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


class Losing:
    """Ranks of which the last is lost as soon as it has a task; another one does at once what it gets."""

    rank = 0
    size = 3
    lost: frozenset[int] = frozenset()

    def __init__(self):
        self._replies: list[tuple[int, object]] = []

    def send(self, message, rank):
        if rank == 2 and isinstance(message, Assignment):
            # its first result is on its way
            self._replies.append((2, _Delivery(message.number, "of a lost rank", 0.1)))
            self.lost = frozenset([2])
        elif isinstance(message, Assignment):
            self._replies += [(1, _Delivery(message.number, "done", 0.1))] * message.task.n_results

    def flush(self): ...

    def receive(self):
        return self._replies.pop(0) if self._replies else None

    def close(self): ...

    def abort(self, status): ...


def test_tasks_of_a_lost_rank_are_given_to_others():
    """What it has sent is not taken any more, as the task is done again; the rest is as if it had not been there."""
    taken: list[tuple[str, object]] = []
    backs: list[tuple[int, list[tuple[str, int]]]] = []

    def take(job, result):
        taken.append((job.kind, result))
        return []

    def take_back(rank, lost):
        backs.append((rank, [(job.kind, n_left) for job, n_left in lost]))
        return [Job(f"{job.kind} again", job.cost, n_left) for job, n_left in lost]

    def run(job, keep):
        for _ in range(job.n_results):
            time.sleep(0.01)
            yield "done"

    jobs = [Job(name, 1.0, 2) for name in "abcdef"]
    serve_tasks(Losing(), jobs, run, Handlers(take, take_back=take_back), CostModel())
    ((rank, [(name, n_left)]),) = backs
    assert (rank, n_left) == (2, 2)
    assert sorted(taken) == sorted(
        [(job.kind, "done") for job in jobs if job.kind != name for _ in range(2)] + [(f"{name} again", "done")] * 2
    )
