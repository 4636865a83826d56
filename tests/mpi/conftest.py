"""Marks of the tests of this folder, and the interrupt."""

import signal
from pathlib import Path

import pytest


def pytest_collection_modifyitems(items):
    """All tests of this folder start runs of several processes, which takes its time."""
    for item in items:
        if item.path.parent == Path(__file__).parent:
            item.add_marker(pytest.mark.mpi)
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="package", autouse=True)
def interrupt():
    """Tests that run in the background ignore the interrupt, and what they start would, too."""
    before = signal.getsignal(signal.SIGINT)
    if before is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
