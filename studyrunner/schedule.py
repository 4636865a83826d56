"""Hands tasks to ranks while they run, and receives the results; knows nothing of what a task is.

Rank 0 computes as well: its main thread hands out tasks and receives results, a second thread computes. A rank gets
its next task while it still computes one, as long as more tasks wait than there are ranks; expensive tasks go first.
"""

from __future__ import annotations

import heapq
import queue
import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from studyrunner.ranks import POLL_SECONDS, Ranks, wait_for_message


class Costed(Protocol):
    """A task: anything with an estimated cost."""

    @property
    def cost(self) -> float:
        """Estimated cost, in any unit."""


Task = TypeVar("Task", bound=Costed)
Result = TypeVar("Result")


@dataclass(frozen=True)
class _Assignment(Generic[Task]):
    """A task on its way to a rank."""

    number: int
    task: Task


@dataclass(frozen=True)
class _Done(Generic[Result]):
    """A result on its way back."""

    number: int
    result: Result


class _LocalWorker(Generic[Task, Result]):
    """The computing thread of rank 0."""

    def __init__(self, run: Callable[[Task], Result]) -> None:
        self._run = run
        self._waiting: queue.SimpleQueue[_Assignment[Task] | None] = queue.SimpleQueue()
        self._finished: queue.SimpleQueue[_Done[Result] | BaseException] = queue.SimpleQueue()
        # A daemon: an exception in the main thread ends the process although a task still runs.
        self._thread = threading.Thread(target=self._work, name="tasks of rank 0", daemon=True)
        self._thread.start()

    def assign(self, assignment: _Assignment[Task]) -> None:
        """Puts a task behind those that it already has."""
        self._waiting.put(assignment)

    def poll(self, seconds: float) -> _Done[Result] | None:
        """A result, waiting for one at most `seconds`. Raises what the task raised."""
        try:
            done = self._finished.get(timeout=seconds)
        except queue.Empty:
            return None
        if isinstance(done, BaseException):
            raise done
        return done

    def stop(self) -> None:
        """Ends the thread; it has nothing left to do."""
        self._waiting.put(None)
        self._thread.join()

    def _work(self) -> None:
        while (assignment := self._waiting.get()) is not None:
            try:
                self._finished.put(_Done(assignment.number, self._run(assignment.task)))
            except BaseException as error:  # handed to the main thread, which raises it
                self._finished.put(error)


def serve_tasks(
    ranks: Ranks,
    tasks: Iterable[Task],
    run: Callable[[Task], Result],
    take: Callable[[Task, Result], Iterable[Task]],
    tick: Callable[[], None] = lambda: None,
) -> None:
    """Rank 0: has all tasks done, its own share by `run`, and hands every result to `take`.

    take: called in the main thread, in the order in which results arrive; returns the tasks that the result makes
        possible. tick: called many times a second.
    Raises what a task on this rank raised; an exception on another rank ends that rank's process.
    """
    known: list[Task] = []
    waiting: list[tuple[float, int]] = []
    held: list[set[int]] = [set() for _ in range(ranks.size)]
    local = _LocalWorker(run)

    def add(new: Iterable[Task]) -> None:
        for task in new:
            heapq.heappush(waiting, (-task.cost, len(known)))
            known.append(task)

    def hand_out() -> None:
        for depth in (0, 1):
            for rank in range(ranks.size):
                if len(held[rank]) == depth and waiting and (depth == 0 or len(waiting) > ranks.size):
                    number = heapq.heappop(waiting)[1]
                    held[rank].add(number)
                    assignment = _Assignment(number, known[number])
                    if rank == 0:
                        local.assign(assignment)
                    else:
                        ranks.send(assignment, rank)

    def finish(rank: int, done: _Done[Result]) -> None:
        held[rank].remove(done.number)
        add(take(known[done.number], done.result))

    add(tasks)
    while True:
        hand_out()
        if not any(held):
            break
        done = local.poll(POLL_SECONDS if ranks.size > 1 else 50 * POLL_SECONDS)
        if done is not None:
            finish(0, done)
        while (received := ranks.receive()) is not None:
            source, message = received
            if not isinstance(message, _Done):
                raise TypeError(f"rank {source} sent {message!r} instead of a result")
            finish(source, message)
        tick()
    local.stop()
    for rank in range(1, ranks.size):
        ranks.send(None, rank)


def work_on_tasks(ranks: Ranks, run: Callable[[Task], Result]) -> None:
    """Any other rank: computes what rank 0 sends, until it sends None."""
    while (message := wait_for_message(ranks)) is not None:
        if not isinstance(message, _Assignment):
            raise TypeError(f"rank 0 sent {message!r} instead of a task")
        ranks.send(_Done(message.number, run(message.task)), 0)
