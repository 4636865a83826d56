"""Faults of the machine cost no point: the run ends with one line, and the same command goes on."""

import pytest
import xarray as xr

from studyrunner.cli import main
from studyrunner.kinds.wear import History, Sweep
from tests.mpi.launching import results
from tests.studyrunner.faked_runs import SMALL

pytestmark = [pytest.mark.usefixtures("folder"), pytest.mark.processes]

NO_ROOM = OSError(122, "Disk quota exceeded")


@pytest.mark.parametrize("kind", [Sweep, History])
def test_a_run_that_a_fault_of_the_machine_has_ended_goes_on(kind, solver, capsys):
    assert main([*SMALL[:-1], "whole.nc"]) == 0
    solver.begin_again()

    def disturb(task, _):
        if isinstance(task, kind):
            raise NO_ROOM

    solver.disturb = disturb
    assert main(SMALL) == 1
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("run-study: ")]
    assert line.startswith("run-study: OSError: [Errno 122] Disk quota exceeded")
    solver.begin_again()
    assert main(SMALL) == 0
    xr.testing.assert_identical(results(), results("whole.nc"))


@pytest.mark.slow
def test_an_error_that_the_solver_takes_for_an_end_is_none(monkeypatch):
    """With the solver itself, whose histories break off in their midst."""
    from solver.wear.wearing_joint import WearingJoint

    own, n_calls = WearingJoint.with_rates, 0

    def with_rates(self, *given):
        nonlocal n_calls
        n_calls += 1
        if n_calls in (3, 30):
            raise NO_ROOM
        return own(self, *given)

    monkeypatch.setattr(WearingJoint, "with_rates", with_rates)
    command = [*SMALL, "--set", "solver.harmonics=3", "--set", "solver.samples=32"]
    assert [main(command) for _ in range(3)] == [1, 1, 0]
    assert n_calls > 30
    assert (results().outcome == 0).all()
