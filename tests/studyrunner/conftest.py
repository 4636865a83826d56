"""A folder of its own, a stand-in for the solver, and a process that reads files of unknown origin."""

import pytest

from studies import sandboxed_read
from tests.studyrunner.faked_runs import Solver
from tests.studyrunner.reading_process import reading_process


@pytest.fixture(scope="module")
def reader():
    """Stands for the new process that reads each file otherwise."""
    with reading_process() as process, pytest.MonkeyPatch.context() as patch:
        patch.setattr(sandboxed_read, "run_sandbox", process.read)
        yield process


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder, with nothing in it."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def solver(monkeypatch):
    """Stands for the solver in all runs of a test."""
    return Solver(monkeypatch)
