"""The schedule on one rank, and the ranks without MPI."""

import sys
import threading
import time
from dataclasses import dataclass

import pytest

from studyrunner.mpi import dispatch
from studyrunner.mpi.dispatch import Assignment, Dispatcher
from studyrunner.mpi.launcher import LauncherError, launcher_rank, launcher_size
from studyrunner.mpi.ranks import Alone, start_ranks
from studyrunner.mpi.schedule import Handlers, _Delivery, serve_tasks
from studyrunner.plan.cost_model import CostModel


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


@dataclass(frozen=True)
class Job:
    kind: str
    cost: float
    n_results: int = 1
    opens_others: bool = False

    def cost_of(self, *, first):
        del first
        return self.cost / self.n_results

    @property
    def cost_keys(self):
        return (("all", self.kind),)


class Clock:
    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def make(n_ranks, *jobs):
    clock = Clock()
    dispatcher: Dispatcher[Job] = Dispatcher(n_ranks, CostModel(), clock)
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
    most, n_done, held = 0, 0, 0
    while not dispatcher.done:
        ((rank, assignment),) = dispatcher.assign()
        for _ in range(assignment.task.n_results):
            dispatcher.deliver(rank, assignment.number, 1.0)
            if assignment.task.opens_others:
                dispatcher.add([Job("march", 1.0)])
                held += 1
        if not assignment.task.opens_others:
            n_done, held = n_done + 1, held - 1
        most = max(most, held)
    assert (n_done, held) == (200, 0)
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


def test_tasks_of_a_lost_rank_go_to_rank_0_only_where_there_is_no_other():
    dispatcher, _ = make(3, Job("a", 1.0), Job("a", 1.0), Job("a", 1.0, n_results=2))
    assert dict(handed_out(dispatcher)) == {0: 0, 1: 1, 2: 2}
    dispatcher.deliver(2, 2, 0.5)
    ((task, n_left),) = dispatcher.lose(2)
    assert n_left == 1
    dispatcher.add_lost([task])
    dispatcher.deliver(0, 0, 1.0)
    assert handed_out(dispatcher) == []
    assert not dispatcher.done
    dispatcher.deliver(1, 1, 1.0)
    assert handed_out(dispatcher) == [(1, 3)]
    dispatcher.add_lost([task for task, _ in dispatcher.lose(1)])
    assert handed_out(dispatcher) == [(0, 4)]
