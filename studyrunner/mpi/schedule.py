"""Sends jobs to ranks and receives results. Rank 0 computes as well: its main thread serves, a second thread computes.

A job has one result or several, each handed on at once, and reports its progress from time to time, so that another run
can continue from there. By hand: in the pools of mpi4py and schwimmbad a job has one result and no progress.
"""

import itertools
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, NamedTuple

from numba.core.event import Event, Listener, register

from studyrunner.mpi.dispatch import CostModel, Dispatcher, Job
from studyrunner.mpi.ranks import POLL_SECONDS, Ranks
from studyrunner.system.machine import UnseenFileError
from studyrunner.system.process import begin_ending, raise_ending, uninterrupted

SECONDS_TO_PROGRESS = 3.0
"""Shortest time between two reports of progress of a job, s; longer with many ranks. With the time that a report waits
for others (`checkpoint.store`) a kill loses no step that was finished more than 5 s before, where steps are short."""

COMPILING = "compiling the solver, once after an installation"
"""What a user waits for at first; it is no part of what a job takes."""

_MANY_RANKS = 100  # with more, each reports less often, as rank 0 writes all reports to the disk
_LOOKS_A_TICK = 100
_AT_ONCE = 64

Run = Callable[[Job, Callable[[object], None]], Iterable[Any]]
"""Does a job: gives the results one by one and may hand the progress to the given function."""


class _Assignment(NamedTuple):
    """A job on its way to a rank."""

    number: int
    job: Job


class _Reply(NamedTuple):
    """What a rank sends of a job: a result with the time that it took, s; without a time progress, or
    UnseenFileError where the rank does not see a file that the job brings.
    """

    number: int
    content: Any
    seconds: float | None = None


class _Compiler(Listener):
    """seconds: in which this process has compiled functions. say: takes `COMPILING` at the begin, "" at the end."""

    def __init__(self) -> None:
        self.seconds, self._began, self._depth = 0.0, 0.0, 0
        self.say: Callable[[str], object] = str

    def working_seconds(self) -> float:
        """A clock, s, that stands still while a function is compiled."""
        return time.perf_counter() - self.seconds

    def on_start(self, event: Event) -> None:  # noqa: ARG002
        if self._depth == 0:
            self._began = time.perf_counter()
            self.say(COMPILING)
        self._depth += 1

    def on_end(self, event: Event) -> None:  # noqa: ARG002
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._began
            self.say("")


_compiler = _Compiler()
register("numba:compile", _compiler)  # type: ignore[no-untyped-call]


class TaskHandler:
    """What rank 0 does with jobs and results, in the main thread. costs: learns the run times of the jobs."""

    def __init__(self) -> None:
        self.costs = CostModel()

    def begin(self) -> Iterable[Job]:
        """Jobs that are possible at the beginning; taken one by one, when ranks can use more."""
        raise NotImplementedError

    def take(self, job: Job, result: Any) -> Iterable[Job]:
        """Takes a result, in the order in which results arrive; returns the jobs that the result makes possible."""
        raise NotImplementedError

    def prepare(self, rank: int, job: Job, *, unseen: bool = False) -> Job:  # noqa: ARG002
        """The job as it is sent to a rank. unseen: once more, as the rank does not see the files that it brings."""
        return job

    def keep(self, job: Job, progress: object) -> None:
        """Takes the progress of a job; never after the last result of the job."""

    def tick(self, running: Callable[[], Sequence[tuple[Job, int, float]]]) -> None:
        """Called many times a second. running: returns the running jobs, as `Dispatcher.running`."""


def serve_tasks(ranks: Ranks, handler: TaskHandler, run: Run) -> None:
    """Rank 0: has all jobs done and does some of them. Raises the exception of a job of its own, or of another rank
    that has sent one: a fault of the machine, or KeyboardInterrupt.
    """
    server = _Server(ranks, handler, run)
    try:
        with uninterrupted():
            server.hand_out()
        while not server.dispatcher.done:
            with uninterrupted():
                server.look()
    except BaseException:
        server.own.given_up = True
        raise
    server.own.stop()


def follow_rank_0(ranks: Ranks, run: Run, check: Callable[[], None] = raise_ending) -> None:
    """Any other rank: does the jobs that rank 0 sends, until rank 0 sends None.

    check: raises KeyboardInterrupt where the run ends.
    """
    while True:
        while (received := ranks.receive()) is None:
            time.sleep(POLL_SECONDS)
        _, assignment = received
        if assignment is None:
            return
        if not isinstance(assignment, _Assignment):
            raise TypeError(f"rank 0 sent {assignment!r} instead of a job")
        _work(assignment, ranks, run, check)


def _work(assignment: _Assignment, ranks: Ranks, run: Run, check: Callable[[], None]) -> None:
    """Sends the results of a job, each as soon as it is there."""
    job, n_given, clock = assignment.job, 0, _compiler.working_seconds
    n_results, began = len(job.costs), clock()
    pause = SECONDS_TO_PROGRESS * max(1.0, ranks.size / _MANY_RANKS)
    sent, first = dict[type, float](), began  # data and words have times of their own

    def send(content: object, seconds: float | None = None) -> None:
        ranks.send(_Reply(assignment.number, content, seconds), 0)
        ranks.flush()

    def keep(progress: object, *, at_once: bool = False) -> None:
        check()
        # a job that has given all its results has no progress
        if n_given < n_results and (at_once or clock() > sent.get(type(progress), first) + pause):
            send(progress)
            sent[type(progress)] = clock()

    _compiler.say = partial(keep, at_once=True)
    try:
        for result in run(job, keep):
            n_given += 1
            if n_given > n_results:
                break
            send(result, clock() - began)
            began = clock()
    except UnseenFileError as error:
        send(error)
        return
    finally:
        _compiler.say = str
    if n_given != n_results:
        raise ValueError(f"not {n_results} results from {job}")


class _OwnThread(Ranks):
    """The computing thread of rank 0, which is given jobs, and replies, as another rank.

    replies: also the exception that has ended the thread. given_up: the thread ends at the next step of its job.
    """

    def __init__(self, run: Run, size: int) -> None:
        self.size = size
        self._jobs: queue.SimpleQueue[_Assignment | None] = queue.SimpleQueue()
        self.assign = self._jobs.put
        self.replies: deque[object] = deque()
        self.given_up = False
        # A daemon: an exception in the main thread ends the process although a job still runs.
        self._thread = threading.Thread(target=self._follow, args=(run,), daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Ends the thread after its last job. Raises an exception that the last job raised after its last result."""
        self._jobs.put(None)
        with uninterrupted():
            self._thread.join()
        for error in self.replies:
            assert isinstance(error, BaseException)
            raise error

    def _follow(self, run: Run) -> None:
        try:
            follow_rank_0(self, run, self._check)
        except BaseException as error:  # handed to the main thread, which raises it
            self.replies.append(error)

    def _check(self) -> None:
        if self.given_up:
            raise KeyboardInterrupt

    def send(self, message: object, rank: int) -> None:  # noqa: ARG002
        self._check()
        self.replies.append(message)

    def receive(self) -> tuple[int, object]:
        return 0, self._jobs.get()


class _Server:
    """The main thread of rank 0."""

    def __init__(self, ranks: Ranks, handler: TaskHandler, run: Run) -> None:
        self._ranks, self._handler = ranks, handler
        self._waiting = iter(handler.begin())
        self.dispatcher = Dispatcher(ranks.size, handler.costs, time.monotonic)
        self.own = _OwnThread(run, ranks.size)

    def look(self) -> None:
        """Receives what there is; waits a moment where there is nothing."""
        for _ in range(_LOOKS_A_TICK):
            received = [self._ranks.receive(), (0, self.own.replies.popleft()) if self.own.replies else None]
            for each in filter(None, received):
                self._accept(*each)
            if quiet := not any(received):
                break
        self.dispatcher.watch()
        self._handler.tick(self.dispatcher.running)
        if quiet:
            # no wait for a message: a signal may make that of `queue.SimpleQueue` endless in Python 3.11
            time.sleep(POLL_SECONDS)

    def hand_out(self) -> None:
        """Sends jobs to the ranks that have none."""
        while self.dispatcher.wants_more and (more := list(itertools.islice(self._waiting, _AT_ONCE))):
            self.dispatcher.add(more)
        for rank, number, job in self.dispatcher.assign():
            self._send(rank, _Assignment(number, self._handler.prepare(rank, job)))

    def _send(self, rank: int, assignment: _Assignment) -> None:
        if rank == 0:
            self.own.assign(assignment)
        else:
            self._ranks.send(assignment, rank)

    def _accept(self, rank: int, message: object) -> None:
        if isinstance(message, BaseException):
            if isinstance(message, KeyboardInterrupt):
                begin_ending()
            raise message
        if not isinstance(message, _Reply):
            raise TypeError(f"rank {rank} sent {message!r} instead of a result")
        number, content = message.number, message.content
        if message.seconds is not None:
            self.dispatcher.add(self._handler.take(self.dispatcher.deliver(rank, number, message.seconds), content))
            self.hand_out()
        elif isinstance(content, UnseenFileError):
            again = self._handler.prepare(rank, self.dispatcher.job(number), unseen=True)
            self._send(rank, _Assignment(number, again))
        else:
            self._handler.keep(self.dispatcher.job(number), content)
