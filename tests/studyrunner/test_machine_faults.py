"""Faults of the machine cost no point: the task is done again, elsewhere where there is a choice, or by a later run."""

import time

import pytest
import xarray as xr

from solver.outcome import Outcome
from studyrunner.cli import main
from studyrunner.kinds.wear import History, Sweep
from studyrunner.mpi.dispatch import CostModel, Dispatcher
from tests.mpi.launching import results
from tests.studyrunner.faked_runs import SMALL
from tests.studyrunner.test_schedule import Job

pytestmark = [pytest.mark.usefixtures("folder"), pytest.mark.processes]

NO_ROOM = OSError(122, "Disk quota exceeded")


def failing(error, n_times, kind):
    """The first task of a kind breaks off so often."""
    left = [n_times]
    first: list[int] = []

    def disturb(task, _):
        if isinstance(task, kind):
            first.append(task.number)
            if task.number == first[0] and left[0]:
                left[0] -= 1
                raise error

    return disturb


@pytest.mark.parametrize(("error", "kind", "n_times"), [(MemoryError(), Sweep, 1), (NO_ROOM, History, 2)])
def test_a_task_that_a_fault_of_the_machine_has_ended_is_done_again(error, kind, n_times, solver, capsys):
    assert main([*SMALL[:-1], "whole.nc"]) == 0
    solver.begin_again()
    solver.disturb = failing(error, n_times, kind)
    # a second fault leaves it to the next run: it is never a result
    assert main(SMALL) == (3 if n_times > 1 else 0)
    assert set(results().outcome.values.flat) == {0, *[Outcome.NOT_COMPUTED] * (n_times > 1)}
    assert capsys.readouterr().err.count(f"rank 0: {type(error).__name__}") == 1
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
            raise MemoryError("no room for an array")
        return own(self, *given)

    monkeypatch.setattr(WearingJoint, "with_rates", with_rates)
    assert main([*SMALL, "--set", "solver.harmonics=3", "--set", "solver.samples=32"]) == 0
    assert n_calls > 30
    assert (results().outcome == 0).all()


def test_a_sick_rank_gets_no_more_tasks_unless_all_are():
    dispatcher = Dispatcher(3, CostModel(), time.monotonic)
    dispatcher.add([Job("chore", 1.0) for _ in range(20)])
    given = [(rank, each.number) for rank, each in dispatcher.assign()]
    ranks: list[int] = []
    while given:
        rank, number = given.pop(0)
        if rank in (0, 2):
            dispatcher.shun(rank)
        dispatcher.deliver(rank, number, 0.01)
        new = [(rank, each.number) for rank, each in dispatcher.assign()]
        ranks += [rank for rank, _ in new]
        given += new
    assert dispatcher.done
    assert set(ranks) == {1}
    dispatcher.shun(1)
    dispatcher.add([Job("chore", 1.0)])
    assert [rank for rank, _ in dispatcher.assign()] == [1]
