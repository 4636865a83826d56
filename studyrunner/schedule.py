"""Hands tasks to ranks while they run, and receives the results; knows nothing of what a task is.

A task has one result or several, one by one; each is handed on at once, while its rank goes on with the task. Rank 0
computes as well: its main thread hands out tasks and receives results, a second thread computes. A rank gets its next
task while it still computes one, as long as more tasks wait than there are ranks and the one it computes has not begun
to give results: nothing waits behind a long row of them. Urgent tasks go first.
"""

from __future__ import annotations

import heapq
import queue
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from studyrunner.ranks import POLL_SECONDS, Ranks, wait_for_message


class Urgent(Protocol):
    """A task: anything that says how urgent it is."""

    @property
    def urgency(self) -> float:
        """Tasks with a larger one go first; equal ones in the order in which they became available."""


Task = TypeVar("Task", bound=Urgent)
Result = TypeVar("Result")


@dataclass(frozen=True)
class _Assignment(Generic[Task]):
    """A task on its way to a rank."""

    number: int
    task: Task


@dataclass(frozen=True)
class _Delivery(Generic[Result]):
    """A result on its way back."""

    number: int
    result: Result


@dataclass(frozen=True)
class _End:
    """Says that a task has given its last result."""

    number: int


def _work(assignment: _Assignment[Task], run: Callable[[Task], Iterable[Result]]) -> Iterator[_Delivery[Result] | _End]:
    """What a rank sends back for a task, as soon as it is there."""
    for result in run(assignment.task):
        yield _Delivery(assignment.number, result)
    yield _End(assignment.number)


class _LocalWorker(Generic[Task, Result]):
    """The computing thread of rank 0."""

    def __init__(self, run: Callable[[Task], Iterable[Result]]) -> None:
        self._run = run
        self._waiting: queue.SimpleQueue[_Assignment[Task] | None] = queue.SimpleQueue()
        self._sent: queue.SimpleQueue[_Delivery[Result] | _End | BaseException] = queue.SimpleQueue()
        # A daemon: an exception in the main thread ends the process although a task still runs.
        self._thread = threading.Thread(target=self._compute, name="tasks of rank 0", daemon=True)
        self._thread.start()

    def assign(self, assignment: _Assignment[Task]) -> None:
        """Puts a task behind those that it already has."""
        self._waiting.put(assignment)

    def poll(self, seconds: float) -> _Delivery[Result] | _End | None:
        """What it sends next, waiting for it at most `seconds`. Raises what the task raised."""
        try:
            message = self._sent.get(timeout=seconds)
        except queue.Empty:
            return None
        if isinstance(message, BaseException):
            raise message
        return message

    def stop(self) -> None:
        """Ends the thread; it has nothing left to do."""
        self._waiting.put(None)
        self._thread.join()

    def _compute(self) -> None:
        while (assignment := self._waiting.get()) is not None:
            try:
                for message in _work(assignment, self._run):
                    self._sent.put(message)
            except BaseException as error:  # handed to the main thread, which raises it
                self._sent.put(error)


def serve_tasks(
    ranks: Ranks,
    tasks: Iterable[Task],
    run: Callable[[Task], Iterable[Result]],
    take: Callable[[Task, Result], Iterable[Task]],
    tick: Callable[[], None] = lambda: None,
) -> None:
    """Rank 0: has all tasks done, its own share by `run`, and hands every result to `take`.

    run: gives the results of a task one by one. take: called in the main thread, in the order in which results arrive;
        returns the tasks that the result makes possible. tick: called many times a second.
    Raises what a task on this rank raised; an exception on another rank ends that rank's process.
    """
    known: list[Task] = []
    waiting: list[tuple[float, int]] = []
    held: list[set[int]] = [set() for _ in range(ranks.size)]
    giving: set[int] = set()
    local = _LocalWorker(run)

    def add(new: Iterable[Task]) -> None:
        for task in new:
            heapq.heappush(waiting, (-task.urgency, len(known)))
            known.append(task)

    def may_get(rank: int, depth: int) -> bool:
        if not waiting or len(held[rank]) != depth:
            return False
        return depth == 0 or (len(waiting) > ranks.size and rank not in giving)

    def hand_out() -> None:
        for depth in (0, 1):
            for rank in range(ranks.size):
                if may_get(rank, depth):
                    number = heapq.heappop(waiting)[1]
                    held[rank].add(number)
                    assignment = _Assignment(number, known[number])
                    if rank == 0:
                        local.assign(assignment)
                    else:
                        ranks.send(assignment, rank)

    def accept(rank: int, message: object) -> None:
        if isinstance(message, _Delivery):
            giving.add(rank)
            add(take(known[message.number], message.result))
        elif isinstance(message, _End):
            giving.discard(rank)
            held[rank].remove(message.number)
        else:
            raise TypeError(f"rank {rank} sent {message!r} instead of a result")

    add(tasks)
    while True:
        hand_out()
        if not any(held):
            break
        message = local.poll(POLL_SECONDS if ranks.size > 1 else 50 * POLL_SECONDS)
        if message is not None:
            accept(0, message)
        while (received := ranks.receive()) is not None:
            accept(*received)
        tick()
    local.stop()
    for rank in range(1, ranks.size):
        ranks.send(None, rank)


def work_on_tasks(ranks: Ranks, run: Callable[[Task], Iterable[Result]]) -> None:
    """Any other rank: computes what rank 0 sends, until it sends None."""
    while (message := wait_for_message(ranks)) is not None:
        if not isinstance(message, _Assignment):
            raise TypeError(f"rank 0 sent {message!r} instead of a task")
        for reply in _work(message, run):
            ranks.send(reply, 0)
            ranks.flush()
