"""Marks of the tests of this folder, and signals."""

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
def default_signals():
    """Whoever runs the tests may ignore signals, as in the background or under nohup: what they start would, too."""
    handlers = {signal.SIGINT: signal.default_int_handler}
    handlers |= dict.fromkeys((signal.SIGHUP, signal.SIGUSR1), signal.SIG_DFL)
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)
