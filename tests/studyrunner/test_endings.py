"""Signals that end a run come between any two instructions of the main thread, and leave nothing half done."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from studyrunner.system.endings import begin_ending, is_ending, raise_ending, take_endings, uninterrupted

pytestmark = pytest.mark.processes

ROOT = Path(__file__).parents[2]

WRITER = """
import signal
from studyrunner.checkpoint.writer import Writer

class Disturbed(Exception): pass
def disturb(*_): raise Disturbed

writer = Writer(lambda job: job)
signal.signal(signal.SIGALRM, disturb)
for number in range(20_000):
    try:
        signal.setitimer(signal.ITIMER_REAL, 1e-5 + 1e-7 * (number % 1000))
        # the loop of rank 0 looks without waiting, which is most of what it does
        while True:
            writer.take(lambda *_: None, lambda _: None)
            if not writer.busy:
                writer.begin(number)
    except Disturbed:
        pass
writer.take(lambda *_: None, lambda _: None, wait=True)
writer.close()
print("closed")
"""


@pytest.fixture(autouse=True)
def _as_before():
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)
    handlers = [signal.getsignal(number) for number in numbers]
    yield
    begin_ending()
    for number, handler in zip(numbers, handlers, strict=True):
        signal.signal(number, handler)


@pytest.fixture
def end():
    """Sends this process what ends a run."""
    signal.signal(signal.SIGUSR1, signal.SIG_DFL)
    take_endings()

    def send():
        os.kill(os.getpid(), signal.SIGUSR1)
        time.sleep(0.0)

    return send


def test_an_ending_is_raised_once(end):
    with pytest.raises(KeyboardInterrupt):
        end()
    end()
    begin_ending()
    end()
    raise_ending()


def test_an_ending_that_a_library_has_lost_is_raised_again(end):
    raise_ending()
    # as in a callback of C
    with contextlib.suppress(KeyboardInterrupt):
        end()
    assert is_ending(AssertionError())
    with pytest.raises(KeyboardInterrupt):
        raise_ending()
    with pytest.raises(KeyboardInterrupt), uninterrupted():
        pass
    begin_ending()
    assert not is_ending(AssertionError())
    with uninterrupted():
        raise_ending()


def test_an_ending_waits_for_the_last_of_what_is_done_as_a_whole(end):
    done = []

    def work():
        with uninterrupted():
            with uninterrupted():
                end()
                done.append("inner")
            end()
            done.append("outer")
        done.append("never")

    with pytest.raises(KeyboardInterrupt):
        work()
    begin_ending()
    assert done == ["inner", "outer"]
    with uninterrupted():
        # it was raised: what comes now is not disturbed by it
        end()


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_an_ending_is_not_lost_where_something_else_is_raised(end, error):
    def work():
        with uninterrupted():
            end()
            raise error

    with pytest.raises(KeyboardInterrupt):
        work()
    begin_ending()
    with uninterrupted():
        pass


@pytest.mark.slow
def test_a_writer_whose_owner_is_interrupted_anywhere_does_not_hang():
    ended = subprocess.run(
        [sys.executable, "-c", WRITER], cwd=ROOT, capture_output=True, text=True, timeout=200.0, check=False
    )
    assert ended.stdout == "closed\n", ended.stderr


EARLY = """
import os, signal, time
from studyrunner.system.own_process import run_in_own_process

fork = os.fork
def interrupted_fork():
    os.kill(os.getpid(), signal.SIGTERM)
    return fork()

os.fork = interrupted_fork
print(run_in_own_process(lambda: time.sleep(600) or 0))
"""


def test_a_signal_that_comes_before_the_other_process_is_there_is_handed_on():
    ended = subprocess.run([sys.executable, "-c", EARLY], capture_output=True, text=True, timeout=200, check=True)
    assert ended.stdout == "1\n"
