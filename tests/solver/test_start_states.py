"""Sweeps against exact motions, and their convergence with samples and harmonics."""

import numpy as np
import pytest

from solver.loading_history import frequency_sweep
from solver.loading_history.start_states import follow_branch
from solver.outcome import Outcome
from solver.packing import Packed
from solver.settings import SolverSettings
from tests.references import vibro_impact_orbit
from tests.solver.models import branch_states, scene
from tests.solver.reconstruction import full_motion

FINE = SolverSettings(harmonics=21, samples=256)
TWO_MASSES = ([[1, 0], [0, 1]], [[0.04, -0.02], [-0.02, 0.02]], [[2, -1], [-1, 1]], [20, 0], 1, 7.2)
VIBRO_IMPACT = (1.0, 0.05, 1.0, 0.02, 100.0, 0.1)


def first_harmonic(model, state, **values):
    return np.abs(full_motion(scene(model, **values), state).displacement[1])


@pytest.mark.slow
def test_a_sweep_up_stays_on_the_branch_with_impacts():
    omegas = np.round(np.arange(0.85, 1.501, 0.05), 10)
    starts = branch_states(scene("vibro_impact"), 0.0, 0.02, omegas, FINE, "up")
    for omega, start in zip(omegas, starts, strict=True):
        if omega in (1.05, 1.2, 1.3, 1.4, 1.5):
            assert start.state is not None
            expected = abs(vibro_impact_orbit(*VIBRO_IMPACT, omega, sweep_start=0.85).harmonic(0))
            assert first_harmonic("vibro_impact", start.state)[1] == pytest.approx(expected, rel=0.005, abs=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("omega", [1.5])
def test_a_single_frequency_deep_in_the_bistable_range_knows_its_branch(omega):
    # both branches exist from 1.0919 to 1.5576 rad/s
    model = scene("vibro_impact")
    (rising,), (falling,) = (branch_states(model, 0.0, 0.02, [omega], FINE, sweep) for sweep in ("up", "down"))
    assert rising.state is not None
    expected = abs(vibro_impact_orbit(*VIBRO_IMPACT, omega, sweep_start=0.85).harmonic(0))
    assert first_harmonic("vibro_impact", rising.state)[1] == pytest.approx(expected, rel=0.005, abs=0.0)
    assert not falling.state.contact_force_h.any()
    assert rising.branch == falling.branch == 0


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
