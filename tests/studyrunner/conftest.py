"""A process that reads files of unknown origin, for the tests that have many of them read."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from studies import vetting
from tests.studyrunner.reading_process import ReadingProcess, reading_process


@pytest.fixture(scope="module")
def reader() -> Iterator[ReadingProcess]:
    """Stands for the new process that reads each file otherwise."""
    with reading_process() as process, pytest.MonkeyPatch.context() as patch:
        patch.setattr(vetting, "run_reader", process.read)
        yield process
