"""A search that is interrupted again and again on its way to one state ends with the same numbers."""

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest

from solver.loading_history.start_states import follow_branch
from solver.loading_history.sweep_start import Sweep
from solver.model import ReducedModel
from solver.newton import journal as journal_module
from solver.newton.journal import Journal
from solver.newton.linear_solver import JacobianSolver
from solver.outcome import Outcome
from solver.packing import Packed
from solver.results.history import StartState
from solver.settings import SolverSettings
from tests.solver.models import dovetail, scene

AUTO = SolverSettings()


class KilledError(BaseException):
    """The end of a run, in the middle of its work."""


@pytest.fixture
def frequent_saves(monkeypatch):
    """Save points after a few results."""
    monkeypatch.setattr(journal_module, "RESULTS_PER_SAVE", 5)


def assert_same(found, expected):
    """Equal to the last bit, but for the time that it took."""
    one, other = (repr(replace(start, state=None, reference=None, run_time=0.0)) for start in (found, expected))
    assert one == other
    for state, wanted in ((found.state, expected.state), (found.reference, expected.reference)):
        assert (state is None) == (wanted is None)
        for entry in fields(wanted) if wanted is not None else ():
            np.testing.assert_array_equal(getattr(state, entry.name), getattr(wanted, entry.name), entry.name)


def in_short_runs(model, friction, amplitude, frequencies, way):
    """The start states from runs that all end at their second save point, and the number of runs."""
    found: dict[int, StartState] = {}
    saved: list[Packed] = []
    for n_runs in range(1, 1000):
        n_saves = 0

        def keep(progress):
            nonlocal n_saves
            if isinstance(progress, str):
                return
            saved[:], n_saves = [progress], n_saves + 1
            if n_saves == 2:
                raise KilledError

        left = [index for index in range(frequencies.size) if index not in found]
        resume = saved[0] if saved else None
        asked = model, friction, amplitude, frequencies[left], way, AUTO
        try:
            for place, start in follow_branch(*asked, keep=keep, resume=resume):
                found[left[place]] = start
        except KilledError:
            continue
        return found, n_runs
    raise AssertionError("the runs never end")


Case = tuple[Callable[[], ReducedModel], float, float, list[float], Sweep]
CASES: dict[str, Case] = {
    "first state, nodes and resolutions": (lambda: dovetail(13), 0.5, 0.5, [212.0], "up"),
    "folds and settling in time": (lambda: scene("vibro_impact"), 0.0, 0.02, [0.2, 0.255], "up"),
    "masses on sliders": (lambda: scene("two_masses"), 0.5, 20.0, [0.1], "down"),
}


@pytest.mark.slow
@pytest.mark.usefixtures("frequent_saves")
@pytest.mark.parametrize("case", CASES)
def test_runs_that_end_before_each_state_arrive_at_the_same_numbers(case):
    build, friction, amplitude, frequencies, way = CASES[case]
    model, at = build(), np.array(frequencies)
    whole = dict(follow_branch(model, friction, amplitude, at, way, AUTO))
    assert any(start.outcome is Outcome.CONVERGED for start in whole.values())
    assert max(start.branch for start in whole.values()) == (1 if "folds" in case else 0)
    found, n_runs = in_short_runs(model, friction, amplitude, at, way)
    assert n_runs > 3 * len(whole)
    assert found.keys() == whole.keys()
    for index, start in found.items():
        assert_same(start, whole[index])


@pytest.mark.slow
def test_the_iterations_of_a_frequency_are_its_own_whatever_is_known():
    frequencies = np.array([205.0, 211.0, 212.0])
    together = dict(follow_branch(dovetail(13), 0.5, 0.5, frequencies, "up", AUTO))
    ((_, alone),) = follow_branch(dovetail(13), 0.5, 0.5, frequencies[2:], "up", AUTO)
    assert alone.newton_iterations == together[2].newton_iterations
    assert together[0].newton_iterations < together[1].newton_iterations


def test_a_journal_gives_its_results_in_their_order_until_one_does_not_fit():
    solver, computed = JacobianSolver(), list(range(100, 110))
    journal = Journal()
    journal.begin(((1.0,), (2.0,), (), (True,), (5.0,)))

    def is_number(known):
        return isinstance(known, float)

    def following():
        return float(computed.pop(0))

    assert [journal.once(solver, following, is_number) for _ in range(2)] == [1.0, 2.0]
    with pytest.raises(np.linalg.LinAlgError):
        journal.once(solver, following, is_number)
    # the fourth is no number: this one and the fifth are of another search
    assert [journal.once(solver, following, is_number) for _ in range(2)] == [100.0, 101.0]


def test_save_points_come_after_a_number_of_results_and_drop_the_factorisation():
    saved: list[int] = []
    journal = Journal(lambda: saved.append(len(journal.saved)))
    dropped: list[int] = []

    class Solver:
        def renew(self, epoch):
            dropped.append(epoch)

    n = 2 * journal_module.RESULTS_PER_SAVE + 1
    for _ in range(n):
        journal.once(Solver(), lambda: 0.0, lambda _: True)
    assert saved == [journal_module.RESULTS_PER_SAVE, 2 * journal_module.RESULTS_PER_SAVE]
    again = Journal(lambda: saved.append(0))
    again.begin(journal.saved)
    epochs, dropped[:] = [*dropped], []
    for _ in range(n):
        again.once(Solver(), lambda: 0.0, lambda _: True)
    assert np.diff(dropped).tolist() == np.diff(epochs).tolist()
    assert 0 not in saved
