"""Signals that end a run come between any two instructions of the main thread, leave nothing half done and no wait."""

import contextlib
import os
import signal
import time

import pytest

from studyrunner.system.process import begin_ending, is_ending, raise_ending, take_endings, uninterrupted

pytestmark = pytest.mark.processes


@pytest.fixture
def end():
    """Sends this process what ends a run."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)
    handlers = [signal.getsignal(number) for number in numbers]
    signal.signal(signal.SIGUSR1, signal.SIG_DFL)
    take_endings()

    def send():
        os.kill(os.getpid(), signal.SIGUSR1)
        time.sleep(0.0)

    yield send
    begin_ending()
    for number, handler in zip(numbers, handlers, strict=True):
        signal.signal(number, handler)


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
