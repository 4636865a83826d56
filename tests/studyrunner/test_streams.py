"""Terminals that are gone, pipes that nobody reads, full logs: a run goes on, with its result and its own status."""

import shlex
import sys

import pytest

from tests.mpi.launching import FAKED, launcher, results, run_command

pytestmark = pytest.mark.processes

STUDY = "two_masses --set axes.wear_coefficient=1e-11 --set slow_time.cycles=20000 --set slow_time.outputs=3 -o out.nc"
CLOSED = "<&- >&- 2>&-"


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


def test_what_cannot_end_well_is_refused_at_the_beginning(tmp_path):
    status, _, line = shell(f"{sys.executable} -m studyrunner.cli two_masses -o /dev/stdout", tmp_path)
    assert (status, line.count("\n")) == (2, 1)
    assert line.startswith("run-study: ")
    assert "-o" in line


def test_nothing_else_gets_the_number_of_a_stream(tmp_path):
    """A library that complains on stderr must not write into a file of the run."""
    code = (
        "import os\nfrom studyrunner.system.process import keep_talking\nkeep_talking()\n"
        "file = open('file', 'wb')\nassert file.fileno() > 2\nos.write(2, b'complaint')\nprint('x', flush=True)\n"
    )
    assert shell(f"{sys.executable} -c {shlex.quote(code)} {CLOSED}", tmp_path)[0] == 0
    assert (tmp_path / "file").read_bytes() == b""
