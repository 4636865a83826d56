"""Folds of a sweep against exact motions, and sweeps without a state. States of both branches: `test_accuracy.py`."""

import numpy as np
import pytest

from solver.loading_history import frequency_sweep
from solver.loading_history.start_states import follow_branch
from solver.outcome import Outcome
from solver.packing import Packed
from solver.settings import SolverSettings
from tests.solver.models import branch_states, scene

FINE = SolverSettings(harmonics=21, samples=256)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sweep", "omegas", "fold"), [("up", [1.5, 1.54, 1.58, 1.65], 1.5576), ("down", [1.0, 1.05, 1.12, 1.2], 1.09195)]
)
def test_a_fold_is_found_and_the_branch_behind_it_counted(sweep, omegas, fold):
    starts = branch_states(scene("vibro_impact"), 0.0, 0.02, omegas, FINE, sweep)
    in_order = starts if sweep == "up" else starts[::-1]
    assert [start.outcome for start in starts] == [Outcome.CONVERGED] * 4
    assert [start.branch for start in in_order] == [0, 0, 1, 1]
    folds = [2 * np.pi * start.fold_frequency for start in in_order]
    # the last fold before a point is that of all points behind it
    assert np.isnan(folds).tolist() == [True, True, False, False]
    assert folds[3] == folds[2]
    # the exact motions end between 1.5575 and 1.558, and between 1.092 and 1.0915 rad/s
    assert folds[2] == pytest.approx(fold, rel=1e-4, abs=0.0)
    with_impacts = [start.state is not None and bool(start.state.contact_force_h.any()) for start in in_order]
    assert with_impacts == ([True, True, False, False] if sweep == "up" else [False, False, True, True])


def test_a_structure_that_is_singular_with_its_joint_held_is_said_to_be():
    # Mass 1 between two springs, mass 2 held: K + i w C - w^2 M is exactly zero at 2 rad/s.
    model = scene("two_masses", stiffness_1=3.0, stiffness_2=1.0, damping_1=0.0, damping_2=0.0)
    frequency = 2.0 / (2 * np.pi)
    assert 2 * np.pi * frequency == 2.0
    starts = dict(follow_branch(model, 0.5, 20.0, np.array([frequency]), "up", SolverSettings(3, 64)))
    assert starts[0].outcome is Outcome.SINGULAR
    assert starts[0].state is None


def test_a_sweep_that_finds_no_state_has_nothing_to_keep(monkeypatch):
    def in_vain(*given):
        given[-1].budget.iterations += 1000
        return Outcome.STATIC_FAILED

    monkeypatch.setattr(frequency_sweep, "solve_first_state", in_vain)
    kept: list[Packed | str] = []
    frequencies = np.array([150.0, 160.0, 170.0])
    found = dict(
        follow_branch(scene("sdof_slider"), 0.3, 10.0, frequencies, "up", SolverSettings(3, 64), keep=kept.append)
    )
    assert [found[place].outcome for place in range(3)] == [Outcome.STATIC_FAILED] * 3
    assert all(isinstance(progress, str) for progress in kept)
