"""Terminals that are gone, pipes that nobody reads, full logs: a run goes on, with its result and its own status."""

import shlex
import sys
from pathlib import Path

import pytest

from tests.mpi.launching import FAKED, fake_here, launcher, results, run_command

pytestmark = pytest.mark.processes

ROOT = Path(__file__).parents[2]
STUDY = "two_masses --set axes.wear_coefficient=1e-11 --set slow_time.cycles=20000 --set slow_time.outputs=3 -o out.nc"
DEAF = {"full log": ">/dev/full 2>&1", "closed": "<&- >&- 2>&-", "a reader of one line": "2>&1 | head -1"}


def shell(command, folder):
    """Exit status of the command before the pipe; what was said behind it."""
    done = run_command(["bash", "-c", f"{command}; exit ${{PIPESTATUS[0]}}"], folder)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(("n_ranks", "case"), [(0, "full log"), (0, "a reader of one line"), (2, "closed")])
def test_a_run_that_nobody_hears(n_ranks, case, tmp_path):
    command = f"{sys.executable} {FAKED} {STUDY} {DEAF[case]}"
    status, _, _ = shell(shlex.join([*launcher(2), "bash", "-c", command]) if n_ranks else command, tmp_path)
    assert status == 0
    assert (results(tmp_path / "out.nc")["outcome"] == 0).all()


@pytest.mark.slow
def test_a_plan_that_does_not_arrive(tmp_path):
    command = f"{sys.executable} -m studyrunner.cli two_masses --plan"
    status, _, said = shell(f"{command} >/dev/full", tmp_path)
    assert status == 2
    assert said == "run-study: command line: --plan: cannot be written to stdout: No space left on device\n"
    status, printed, said = shell(f"{command} | head -1", tmp_path)
    assert (status, said) == (0, "")
    assert len(printed.splitlines()) == 1


@pytest.mark.slow
def test_a_report_that_nobody_hears_of(tmp_path):
    assert fake_here([FAKED, *STUDY.split()], tmp_path) == 0
    status, _, _ = shell(f"{sys.executable} -m studyrunner.report.cli out.nc {DEAF['closed']}", tmp_path)
    assert status == 0
    assert (tmp_path / "out-report" / "index.html").exists()


def test_what_cannot_end_well_is_refused_at_the_beginning(tmp_path):
    status, _, line = shell(f"{sys.executable} -m studyrunner.cli two_masses -o /dev/stdout", tmp_path)
    assert (status, line.count("\n")) == (2, 1)
    assert line.startswith("run-study: ")
    assert "give the name of an ordinary file" in line


def test_nothing_else_gets_the_number_of_a_stream(tmp_path):
    """A library that complains on stderr must not write into a file of the run."""
    code = (
        "import os\nfrom studyrunner.system.process import keep_talking\nkeep_talking()\n"
        "file = open('file', 'wb')\nassert file.fileno() > 2\nos.write(2, b'complaint')\nprint('x', flush=True)\n"
    )
    assert shell(f"{sys.executable} -c {shlex.quote(code)} <&- >&- 2>&-", tmp_path)[0] == 0
    assert (tmp_path / "file").read_bytes() == b""
