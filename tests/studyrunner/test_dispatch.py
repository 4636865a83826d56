"""Which rank gets which task, and what is learnt of costs: without clock and messages."""

from dataclasses import dataclass

from studyrunner.mpi import dispatch
from studyrunner.mpi.dispatch import Dispatcher
from studyrunner.plan.cost_model import CostModel


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
