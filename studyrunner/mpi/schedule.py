"""Sends tasks to ranks and receives results. This module does not know what a task computes.

A task has one result or several; each result is handed on at once. A long task reports its progress from time to time,
so that another run can continue from there. Rank 0 computes as well: the main thread sends tasks and receives results,
a second thread computes. `dispatch` decides which rank gets which task.

By hand: in the pools of mpi4py and schwimmbad a task has one result and no progress.
"""

from __future__ import annotations

import itertools
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from studyrunner.mpi.dispatch import CostModel, Dispatcher, Task
from studyrunner.mpi.mapped_file import UnseenFileError
from studyrunner.mpi.ranks import POLL_SECONDS, RankInterrupted, Ranks, wait_for_message
from studyrunner.system.machine import MachineFaultError
from studyrunner.system.process import begin_ending, raise_ending, uninterrupted

SECONDS_TO_PROGRESS = 3.0
"""Shortest time between two reports of progress of a task, s; longer with many ranks. Together with the second that a
report waits for others (`checkpoint.store`) a kill loses no step that was finished more than 5 s before, where steps
are short and the disk is fast enough."""

_MANY_RANKS = 100  # with more, each reports less often, as rank 0 writes all reports to the disk
_LOOKS_A_TICK = 100
_AT_ONCE = 64

Result = Any

Run = Callable[[Task, Callable[[object], None]], Iterable[Result]]
"""Does a task: gives the results one by one and may hand the progress to the given function."""


@dataclass(frozen=True)
class _Assignment:
    """A task on its way to a rank."""

    number: int
    task: Task


@dataclass(frozen=True)
class _Delivery:
    """A result that is sent to rank 0, and the time that it took, s."""

    number: int
    result: Result
    seconds: float


@dataclass(frozen=True)
class _Progress:
    """Progress of a task: data to continue from, or words."""

    number: int
    progress: object


@dataclass(frozen=True)
class _Unseen:
    """A rank does not see a file that a task brings."""

    number: int


class TaskHandler:
    """What rank 0 does with tasks, results and messages. All of it is called in the main thread.

    costs: learns the run times of the tasks.
    """

    def __init__(self) -> None:
        self.costs = CostModel()

    def begin(self) -> Iterable[Task]:
        """Tasks that are possible at the beginning; taken one by one, when ranks can use more."""
        raise NotImplementedError

    def take(self, task: Task, result: Result) -> Iterable[Task]:
        """Takes a result, in the order in which results arrive; returns the tasks that the result makes possible."""
        raise NotImplementedError

    def prepare(self, rank: int, task: Task, *, unseen: bool = False) -> Task:  # noqa: ARG002
        """The task as a rank gets it; called once for each task that is sent, in the order of sending.

        unseen: whether the task is sent again, to a rank that does not see the files that the task brings.
        """
        return task

    def keep(self, task: Task, progress: object) -> None:
        """Takes the progress of a task; never after the last result of the task."""

    def tick(self, running: Callable[[], Sequence[tuple[Task, int, float]]]) -> None:
        """Called many times a second. running: returns the running tasks, as `Dispatcher.running`."""


def serve_tasks(ranks: Ranks, handler: TaskHandler, run: Run) -> None:
    """Rank 0: has all tasks done and computes some of them.

    An exception on another rank ends the process of that rank. An exception of a task on rank 0 is raised here, and
    MachineFaultError or KeyboardInterrupt where another rank has said so.
    """
    server = _Server(ranks, handler, run)
    try:
        with uninterrupted():
            server.hand_out()
        while not server.dispatcher.done:
            with uninterrupted():
                server.look()
    except BaseException:
        server.local.given_up = True
        raise
    server.local.stop()


def follow_rank_0(ranks: Ranks, run: Run) -> None:
    """Any other rank: does the tasks that rank 0 sends, until rank 0 sends None."""

    def send(reply: object) -> None:
        ranks.send(reply, 0)
        ranks.flush()

    while (message := wait_for_message(ranks)[1]) is not None:
        if not isinstance(message, _Assignment):
            raise TypeError(f"rank 0 sent {message!r} instead of a task")
        _work(message, run, send, ranks.size, raise_ending)


def _work(
    assignment: _Assignment, run: Run, send: Callable[[object], None], n_ranks: int, check: Callable[[], None]
) -> None:
    """Sends the results of a task, each as soon as it is there. check: raises KeyboardInterrupt where the run ends."""
    task, n_given, began = assignment.task, 0, time.perf_counter()
    pause = SECONDS_TO_PROGRESS * max(1.0, n_ranks / _MANY_RANKS)
    sent, begin = dict[type, float](), began  # data and words have times of their own

    def keep(progress: object) -> None:
        check()
        # a task that has given all its results has no progress
        if n_given < task.n_results and time.perf_counter() > sent.get(type(progress), begin) + pause:
            send(_Progress(assignment.number, progress))
            sent[type(progress)] = time.perf_counter()

    try:
        for result in run(task, keep):
            n_given += 1
            if n_given > task.n_results:
                break
            send(_Delivery(assignment.number, result, time.perf_counter() - began))
            began = time.perf_counter()
    except UnseenFileError:
        send(_Unseen(assignment.number))
        return
    if n_given != task.n_results:
        raise ValueError(f"not {task.n_results} results from {task}")


class _LocalWorker:
    """The computing thread of rank 0. assign: takes tasks. given_up: the thread ends at the next step of its task."""

    def __init__(self, run: Run, n_ranks: int) -> None:
        self._tasks: queue.SimpleQueue[_Assignment | None] = queue.SimpleQueue()
        self._sent: deque[object] = deque()
        self.given_up = False
        self.assign = self._tasks.put
        # A daemon: an exception in the main thread ends the process although a task still runs.
        name = "tasks of rank 0"
        self._thread = threading.Thread(target=self._compute, args=(run, n_ranks), name=name, daemon=True)
        self._thread.start()

    def receive(self) -> object:
        """The next message, None where there is none. Raises the exception of a task."""
        message = self._sent.popleft() if self._sent else None
        if isinstance(message, BaseException):
            raise message
        return message

    def stop(self) -> None:
        """Ends the thread after its last task. Raises an exception that the last task raised after its last result."""
        self._tasks.put(None)
        with uninterrupted():
            self._thread.join()
        self.receive()

    def _compute(self, run: Run, n_ranks: int) -> None:
        try:
            while (assignment := self._tasks.get()) is not None:
                _work(assignment, run, self._send, n_ranks, self._check)
        except BaseException as error:  # handed to the main thread, which raises it
            self._sent.append(error)

    def _check(self) -> None:
        if self.given_up:
            raise KeyboardInterrupt

    def _send(self, message: object) -> None:
        self._check()
        self._sent.append(message)


class _Server:
    def __init__(self, ranks: Ranks, handler: TaskHandler, run: Run) -> None:
        self._ranks, self._handler = ranks, handler
        self._waiting = iter(handler.begin())
        self.dispatcher = Dispatcher(ranks.size, handler.costs, time.monotonic)
        self.local = _LocalWorker(run, ranks.size)

    def look(self) -> None:
        """Receives what there is; waits a moment where there is nothing."""
        for _ in range(_LOOKS_A_TICK):
            received, message = self._ranks.receive(), self.local.receive()
            for sender, content in (received or (0, None), (0, message)):
                if content is not None:
                    self._accept(sender, content)
            if quiet := received is None and message is None:
                break
        self.dispatcher.watch()
        self._handler.tick(self.dispatcher.running)
        if quiet:
            # no wait for a message: a signal may make that of `queue.SimpleQueue` endless in Python 3.11
            time.sleep(POLL_SECONDS)

    def hand_out(self) -> None:
        """Sends tasks to the ranks that have none."""
        while self.dispatcher.wants_more and (more := list(itertools.islice(self._waiting, _AT_ONCE))):
            self.dispatcher.add(more)
        for rank, number, task in self.dispatcher.assign():
            self._send(rank, _Assignment(number, self._handler.prepare(rank, task)))

    def _send(self, rank: int, assignment: _Assignment) -> None:
        if rank == 0:
            self.local.assign(assignment)
        else:
            self._ranks.send(assignment, rank)

    def _accept(self, rank: int, message: object) -> None:
        if isinstance(message, _Progress):
            self._handler.keep(self.dispatcher.task(message.number), message.progress)
        elif isinstance(message, _Delivery):
            task = self.dispatcher.deliver(rank, message.number, message.seconds)
            self.dispatcher.add(self._handler.take(task, message.result))
            self.hand_out()
        elif isinstance(message, _Unseen):
            task = self._handler.prepare(rank, self.dispatcher.task(message.number), unseen=True)
            self._send(rank, _Assignment(message.number, task))
        elif isinstance(message, RankInterrupted):
            begin_ending()
            raise KeyboardInterrupt
        elif isinstance(message, MachineFaultError):
            raise message
        else:
            raise TypeError(f"rank {rank} sent {message!r} instead of a result")
