"""Signals that end a run come between any two instructions of the main thread, leave nothing half done and no wait."""

import contextlib
import os
import signal
import sys
import time

import pytest

from studyrunner.system.endings import begin_ending, is_ending, raise_ending, take_endings, uninterrupted
from studyrunner.system.mailbox import Mailbox
from tests.mpi.launching import run_command

pytestmark = pytest.mark.processes


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


BUSY = """
import ctypes, os, signal, subprocess, sys, threading, time
from studyrunner.system.mailbox import Mailbox

def hold():
    # lets others in between, long enough for the main thread to wait, and keeps them out past its deadline
    while True:
        ctypes.PyDLL(None).usleep(200_000)
        time.sleep(0.1)

came = []
signal.signal(signal.SIGUSR1, lambda *_: came.append(1))
signal.signal(signal.SIGALRM, signal.SIG_DFL)
signal.alarm(90)
threading.Thread(target=hold, daemon=True).start()
send = f"import os, time\\nfor _ in range(200): os.kill({os.getpid()}, 10); time.sleep(0.0137)"
sender = subprocess.Popen([sys.executable, "-c", send])
box = Mailbox()
while sender.poll() is None:
    # queue.SimpleQueue().get(timeout=0.05) never comes back from here in most runs
    box.wait(0.05)
print("waited", len(came) > 5, flush=True)
os._exit(0)
"""


@pytest.mark.slow
def test_a_wait_that_signals_disturb_past_its_deadline_does_not_hang(tmp_path):
    ended = run_command([sys.executable, "-c", BUSY], tmp_path)
    assert ended.stdout == "waited True\n", ended.stderr


def test_messages_come_in_their_order_and_stay_until_they_are_taken():
    box: Mailbox[int] = Mailbox()
    box.wait(0.0)
    assert box.first() is None
    assert box.take() is None
    for number in (1, 2, 3):
        box.put(number)
    box.wait(100.0)
    assert [box.first(), box.take(), box.take(), box.first(), box.take(), box.take()] == [1, 1, 2, 3, 3, None]
