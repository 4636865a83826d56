"""A thread that writes files, so that the thread that hands out tasks never waits for a disk.

By hand: after a signal the pools of `concurrent.futures` may lose a result, or wait for ever.
"""

from __future__ import annotations

import itertools
import queue
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from studyrunner.system.endings import uninterrupted
from studyrunner.system.mailbox import Mailbox

Job = TypeVar("Job")
Done = TypeVar("Done")


class Writer(Generic[Job, Done]):
    """Does jobs one after the other on its own thread. All methods are for one other thread.

    An interrupt between any two steps of `take` loses neither a job nor its result.
    """

    def __init__(self, do: Callable[[Job], Done]) -> None:
        self._do = do
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        # each with its number: counting is one step, which an interrupt leaves undone or done
        self._ended: Mailbox[tuple[int, Job, Done | BaseException]] = Mailbox()
        self._n_begun = self._n_taken = 0
        # A daemon: a process that ends in disorder does not wait for a disk that hangs.
        self._thread = threading.Thread(target=self._work, name="writer", daemon=True)
        self._thread.start()

    @property
    def busy(self) -> bool:
        """Whether the end of a job was not taken yet."""
        return self._n_begun > self._n_taken

    def begin(self, job: Job) -> None:
        """Hands over a job."""
        with uninterrupted():
            self._jobs.put(job)
            self._n_begun += 1

    def take(self, accept: Callable[[Job, Done], None], refuse: Callable[[Job], None], *, wait: bool = False) -> None:
        """Takes the jobs that have ended. Raises what a job raised.

        Parameters
        ----------
        accept
            Called with a job and its result.
        refuse
            Called with a job that failed.
        wait
            Whether to wait for all jobs.
        """
        while True:
            while (ended := self._ended.first()) is not None:
                number, job, done = ended
                if isinstance(done, BaseException):
                    refuse(job)
                else:
                    accept(job, done)
                self._n_taken = number
                self._ended.take()
                if isinstance(done, BaseException):
                    raise done
            if not wait or not self.busy:
                return
            self._ended.wait()

    def close(self) -> None:
        """Ends the thread after its jobs."""
        self._jobs.put(None)
        with uninterrupted():
            self._thread.join()

    def _work(self) -> None:
        for number in itertools.count(1):
            if (job := self._jobs.get()) is None:
                return
            try:
                done: Done | BaseException = self._do(job)
            except BaseException as error:  # handed to the other thread, which raises it
                done = error
            self._ended.put((number, job, done))
