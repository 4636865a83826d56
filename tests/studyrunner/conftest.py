"""A folder of its own, and a stand-in for the solver."""

import pytest

from tests.studyrunner.faked_runs import Solver


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder, with nothing in it."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def solver(monkeypatch):
    """Stands for the solver in all runs of a test."""
    return Solver(monkeypatch)
