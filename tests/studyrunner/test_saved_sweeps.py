"""A study whose runs all end before any state is found comes to its end, with the same numbers."""

import pytest
import xarray as xr

from studyrunner.checkpoint.store import Store
from studyrunner.cli import main
from studyrunner.mpi import schedule
from tests.mpi.launching import results

STUDY = [
    *("two_masses", "--set", "axes.frequency=[0.08, 0.1]", "--set", "axes.wear_coefficient=1e-6"),
    *("--set", "axes.sweep=['up']", "--set", "axes.scheme=['adaptive']", "--set", "slow_time.cycles=0"),
]


@pytest.mark.slow
@pytest.mark.usefixtures("folder")
def test_runs_that_end_at_their_second_save_come_to_the_end(monkeypatch):
    assert main([*STUDY, "-o", "whole.nc"]) == 0
    monkeypatch.setattr(schedule, "SECONDS_TO_PROGRESS", -1.0)
    keep_progress, n_saves = Store.keep_progress, 0

    def keep_and_end(*given, **named):
        nonlocal n_saves
        keep_progress(*given, **named)  # type: ignore[arg-type]
        n_saves += 1
        if n_saves % 4 == 0:
            raise KeyboardInterrupt

    monkeypatch.setattr(Store, "keep_progress", keep_and_end)
    statuses = [main([*STUDY, "-o", "out.nc"])]
    while statuses[-1] == 130 and len(statuses) < 100:
        statuses.append(main([*STUDY, "-o", "out.nc"]))
    assert statuses[-1] == 0
    assert len(statuses) > 3
    xr.testing.assert_identical(results(), results("whole.nc"))
