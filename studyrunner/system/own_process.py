"""Work in a process of its own, which a crash of a library ends without ending this one."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from types import FrameType

from studyrunner.system.endings import ENDING, take_endings

CRASHES = (signal.SIGSEGV, signal.SIGBUS, signal.SIGABRT, signal.SIGILL, signal.SIGFPE)


def run_in_own_process(work: Callable[[], int]) -> int:
    """Exit status of some work in a copy of this process; where a signal has ended it, minus the number of that.

    To be called before there are threads. What would end this process ends the work, by KeyboardInterrupt.
    """
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    process = os.fork()
    if process == 0:
        status = 1
        try:
            take_endings()
            status = work()
            sys.stdout.flush()
        finally:
            os._exit(status)

    def hand_on(number: int, _frame: FrameType | None) -> None:
        os.kill(process, number)

    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, hand_on)
    _, ended = os.waitpid(process, 0)
    return os.waitstatus_to_exitcode(ended)
