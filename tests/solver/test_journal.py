"""A search that is interrupted again and again on its way to one state ends with the same numbers."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from solver.loading_history import frequency_sweep, start_states, sweep
from solver.loading_history.frequency_sweep import FrequencySweep
from solver.loading_history.start_states import follow_branch
from solver.model import ReducedModel
from solver.newton import journal as journal_module
from solver.newton.journal import Journal
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Budget, solve_balance
from solver.outcome import Outcome
from solver.packing import Packed
from solver.results.history import PeriodicState, StartState
from solver.settings import SolverSettings
from tests.solver.models import dovetail, scene

AUTO = SolverSettings()


class KilledError(BaseException):
    """The end of a run, in the middle of its work."""


@pytest.fixture
def many_saves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Save points after a few results, each written at once."""
    monkeypatch.setattr(journal_module, "RESULTS_PER_SAVE", 5)
    options = replace(start_states.LOADING, seconds_per_save=0.0, results_per_save=7)
    for module in (start_states, sweep, frequency_sweep):
        monkeypatch.setattr(module, "LOADING", options)


def states_of(start: StartState) -> list[PeriodicState | None]:
    return [start.state, start.coarse]


def assert_same(found: StartState, expected: StartState) -> None:
    """Equal to the last bit, but for the time that it took."""
    pairs = [(replace(one, state=None, coarse=None, run_time=0.0)) for one in (found, expected)]
    assert repr(pairs[0]) == repr(pairs[1])
    for one, other in zip(states_of(found), states_of(expected), strict=True):
        assert (one is None) == (other is None)
        if one is not None:
            for entry in fields(one):
                np.testing.assert_array_equal(getattr(one, entry.name), getattr(other, entry.name), entry.name)


def restarted(
    model: ReducedModel, friction: float, amplitude: float, frequencies: np.ndarray, way: str, saves_a_run: int
) -> tuple[dict[int, StartState], int]:
    """The start states from runs that all end at an early save point, and the number of runs."""
    found: dict[int, StartState] = {}
    saved: list[Packed] = []
    for n_runs in range(1, 2000):
        n_saves = 0

        def keep(progress: Packed) -> None:
            nonlocal n_saves
            saved[:], n_saves = [progress], n_saves + 1
            if n_saves == saves_a_run:
                raise KilledError

        left = [index for index in range(frequencies.size) if index not in found]
        resume = saved[0] if saved else None
        try:
            for place, start in follow_branch(
                model, friction, amplitude, frequencies[left], way, AUTO, keep=keep, resume=resume
            ):
                found[left[place]] = start
        except KilledError:
            continue
        return found, n_runs
    raise AssertionError("the runs never end")


CASES = {
    "first state, nodes and resolutions": (dovetail, 13, 0.5, 0.5, [211.5, 212.7], "up"),
    "ramp": (dovetail, 13, 0.5, 0.5, [211.5, 212.7], "ramp"),
    "folds, settling in time": (scene, "vibro_impact", 0.0, 0.02, [0.2, 0.25], "up"),
    "masses": (scene, "two_masses", 0.5, 20.0, [0.07, 0.1], "down"),
}


@pytest.mark.slow
@pytest.mark.usefixtures("many_saves")
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("saves_a_run", [1, 3])
def test_runs_that_end_before_each_state_arrive_at_the_same_numbers(case: str, saves_a_run: int) -> None:
    build, name, friction, amplitude, frequencies, way = CASES[case]
    model, at = build(name), np.array(frequencies)
    whole = dict(follow_branch(model, friction, amplitude, at, way, AUTO))
    assert any(start.outcome is Outcome.CONVERGED for start in whole.values())
    found, n_runs = restarted(model, friction, amplitude, at, way, saves_a_run)
    assert n_runs > 3 * len(whole) / saves_a_run
    assert found.keys() == whole.keys()
    for index, start in found.items():
        assert_same(start, whole[index])
