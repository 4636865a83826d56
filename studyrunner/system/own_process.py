"""Work in a process of its own, which a crash of a library ends without ending this one.

By hand: `multiprocessing` does not pass the signals that end this process on to its processes.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable
from types import FrameType

from studyrunner.system.endings import ENDING, take_endings

CRASHES = (signal.SIGSEGV, signal.SIGBUS, signal.SIGABRT, signal.SIGILL, signal.SIGFPE)

_LONGEST_WAIT = 0.02  # s


def run_in_own_process(work: Callable[[], int]) -> int:
    """Exit status of some work in a copy of this process; where a signal has ended it, minus the number of that.

    To be called before there are threads. What would end this process ends the work, by KeyboardInterrupt.
    """
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    # one that comes before it is known what to do with it waits
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    process = os.fork()
    if process == 0:
        status = 1
        try:
            take_endings()
            signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
            status = work()
            sys.stdout.flush()
        finally:
            os._exit(status)

    def hand_on(number: int, _frame: FrameType | None) -> None:
        os.kill(process, number)

    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, hand_on)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
    ended = os.waitpid(process, os.WNOHANG)
    while ended[0] == 0:
        # not for ever: a signal that comes just before a wait is handed on behind it
        time.sleep(_LONGEST_WAIT)
        ended = os.waitpid(process, os.WNOHANG)
    return os.waitstatus_to_exitcode(ended[1])
