"""Signals that end a run come between any two instructions of the main thread, leave nothing half done and no wait.

Terminals that are gone, pipes that nobody reads, full logs: a run goes on, with its result and its own status.
"""

import contextlib
import os
import shlex
import signal
import sys
import time

import pytest

from studyrunner.system.process import begin_ending, is_ending, raise_ending, take_endings, uninterrupted
from tests.mpi.launching import FAKED, launcher, results, run_command

pytestmark = pytest.mark.processes

STUDY = "two_masses --set axes.wear_coefficient=1e-11 --set slow_time.cycles=20000 --set slow_time.outputs=3 -o out.nc"
CLOSED = "<&- >&- 2>&-"


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


LOADING = """
import os, signal, sys
# a background job of a shell ignores it
signal.signal(signal.SIGINT, signal.default_int_handler)
class Finder:
    @staticmethod
    def find_spec(name, *_):
        if name == "argparse":
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder)
sys.argv = ["", "--help"]
from studyrunner.commands import {command}
sys.exit({command}())
"""


@pytest.mark.parametrize("command", ["run_study", "study_report"])
def test_an_interrupt_while_a_command_is_loaded_is_no_traceback(command, tmp_path):
    ended = run_command([sys.executable, "-c", LOADING.format(command=command)], tmp_path)
    assert (ended.status, ended.out, ended.said) == (-signal.SIGINT, "", "")


def shell(command, folder):
    """Exit status of the command before the pipe; what was said behind it."""
    ended = run_command(["bash", "-c", f"{command}; exit ${{PIPESTATUS[0]}}"], folder)
    return ended.status, ended.out, ended.said


@pytest.mark.slow
@pytest.mark.parametrize(("n_ranks", "deaf"), [(0, ">/dev/full 2>&1"), (0, "2>&1 | head -1"), (2, CLOSED)])
def test_a_run_that_nobody_hears(n_ranks, deaf, tmp_path):
    command = f"{sys.executable} {FAKED} {STUDY} {deaf}"
    status, _, _ = shell(shlex.join([*launcher(2), "bash", "-c", command]) if n_ranks else command, tmp_path)
    assert status == 0
    assert (results(tmp_path / "out.nc")["outcome"] == 0).all()


@pytest.mark.slow
def test_a_plan_that_does_not_arrive(tmp_path):
    command = f"{sys.executable} -m studyrunner.cli two_masses --plan"
    status, _, said = shell(f"{command} >/dev/full", tmp_path)
    assert (status, said.count("\n")) == (2, 1)
    assert "No space left on device" in said
    status, printed, said = shell(f"{command} | head -1", tmp_path)
    assert (status, said, len(printed.splitlines())) == (0, "", 1)


def test_nothing_else_gets_the_number_of_a_stream(tmp_path):
    """A library that complains on stderr must not write into a file of the run."""
    code = (
        "import os\nfrom studyrunner.system.process import keep_talking\nkeep_talking()\n"
        "file = open('file', 'wb')\nassert file.fileno() > 2\nos.write(2, b'complaint')\nprint('x', flush=True)\n"
    )
    assert shell(f"{sys.executable} -c {shlex.quote(code)} {CLOSED}", tmp_path)[0] == 0
    assert (tmp_path / "file").read_bytes() == b""
