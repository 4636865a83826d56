"""Sweeps against exact motions, and their convergence with samples and harmonics."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from solver.loading_history import frequency_sweep
from solver.loading_history.start_states import follow_branch
from solver.outcome import Outcome
from solver.packing import Packed
from solver.results.history import PeriodicState
from solver.settings import SolverSettings
from solver.structure.penalty import build_penalty
from tests.references import coulomb_orbit, vibro_impact_orbit
from tests.solver import mass_twin
from tests.solver.models import branch_states, converged_state, random_model, scene
from tests.solver.reconstruction import full_motion, series

FINE = SolverSettings(harmonics=21, samples=256)
SLIDER = (0.1, 0.0, 1.6e5, 10.0, 3.0)  # mass, damping, stiffness, force, friction force
NATURAL = np.sqrt(1.6e6)
TWO_MASSES = ([[1, 0], [0, 1]], [[0.04, -0.02], [-0.02, 0.02]], [[2, -1], [-1, 1]], [20, 0], 1, 7.2)
VIBRO_IMPACT = (1.0, 0.05, 1.0, 0.02, 100.0, 0.1)


@lru_cache
def slider_state(ratio: float, harmonics: int, samples: int) -> PeriodicState:
    model = scene("sdof_slider", normal_stiffness=0.0)
    return converged_state(model, 0.3, 10.0, ratio * NATURAL, SolverSettings(harmonics, samples))


def first_harmonic(model: str, state: PeriodicState, **values: float) -> np.ndarray:
    return np.abs(full_motion(scene(model, **values), state).displacement[1])


@pytest.mark.slow
def test_two_masses_converge_with_the_square_of_the_harmonics_at_least() -> None:
    orbit = coulomb_orbit(*TWO_MASSES, 0.5)
    expected = abs(orbit.harmonic(1))
    harmonics = np.array([3, 5, 9, 15])
    errors = []
    for n in harmonics:
        state = converged_state(scene("two_masses"), 0.5, 20.0, 0.5, SolverSettings(int(n), 2048))
        errors.append(abs(first_harmonic("two_masses", state)[1] / expected - 1))
    assert np.polyfit(np.log(harmonics), np.log(errors), 1)[0] < -2.0


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.6, 1.3])
def test_the_slider_balances_its_energy(ratio: float) -> None:
    state = slider_state(ratio, 21, 256)
    model = scene("sdof_slider", normal_stiffness=0.0)
    motion = full_motion(model, state)
    assert max(motion.imbalance) < 1e-7 * motion.force
    # the friction force once more from a plain twin, under the force that the state stores: lambda + m u'' + c u'
    penalty = build_penalty(model, state.omega, 21)
    assert penalty.inertial.all()
    mass, drag = float(penalty.mass[0]), float(penalty.drag[0])
    moved_h, force_h = state.displacement_h[0, 1], state.contact_force_h[0, 1]
    rates = 1j * state.omega * np.arange(22)
    force, moved = (np.concatenate([[row[0]], row[1::2] - 1j * row[2::2]]) for row in (force_h, moved_h))
    predicted = mass_twin.Series(force + (mass * rates**2 + drag * rates) * moved, state.omega)
    n_steps, period = 4096, 2 * np.pi / state.omega
    pushed = np.zeros((2, n_steps))
    pushed[0] = predicted(period * np.arange(n_steps) / n_steps)
    law_t, velocity_t = mass_twin.step_in_the_plane(pushed, np.full(n_steps, 3.0), mass, drag, period, periods=20)
    law = np.fft.rfft(law_t[0])[:22] / n_steps * np.where(np.arange(22) == 0, 1, 2)
    # the twin is of first order: a force that jumps by 6 N is late by up to a step of it, twice a period
    assert law == pytest.approx(force, abs=4 * 6.0 / n_steps)
    assert motion.viscous_work() == 0.0
    friction_work = 3.0 * np.abs(velocity_t[0]).mean() * period
    assert motion.excitation_work() == pytest.approx(friction_work, rel=3e-3)
    loop = 4 * 3.0 * np.abs(series(state.displacement_h[0, 1], 4096)).max()
    assert motion.excitation_work() == pytest.approx(loop, rel=0.02, abs=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("sweep", ["up", "down"])
def test_a_sweep_gives_one_state_a_frequency_in_its_own_order(sweep: str) -> None:
    frequencies = np.array([0.4, 0.55, 0.7]) / (2 * np.pi)
    found = list(follow_branch(scene("two_masses"), 0.5, 20.0, frequencies, sweep, SolverSettings(5, 64)))
    assert [index for index, _ in found] == ([0, 1, 2] if sweep == "up" else [2, 1, 0])
    for index, start in found:
        assert start.outcome is Outcome.CONVERGED
        assert start.state is not None
        assert start.state.omega == pytest.approx(2 * np.pi * frequencies[index], rel=1e-15, abs=0.0)
        assert start.state.excitation_amplitude == 20.0
        assert not start.state.wear_depth.any()
        assert start.newton_iterations > 0
        assert start.run_time >= 0.0
    # the penalty is that of no frequency of the list
    assert all(start.penalty_omega > 2 * np.pi * frequencies[index] for index, start in found)


@pytest.mark.slow
def test_a_sweep_up_stays_on_the_branch_with_impacts() -> None:
    omegas = np.round(np.arange(0.85, 1.501, 0.05), 10)
    starts = branch_states(scene("vibro_impact"), 0.0, 0.02, omegas, FINE, "up")
    for omega, start in zip(omegas, starts, strict=True):
        if omega in (1.05, 1.2, 1.3, 1.4, 1.5):
            assert start.state is not None
            expected = abs(vibro_impact_orbit(*VIBRO_IMPACT, omega, sweep_start=0.85).harmonic(0))
            assert first_harmonic("vibro_impact", start.state)[1] == pytest.approx(expected, rel=0.005, abs=0.0)


def test_a_sweep_down_stays_on_the_branch_without_impacts() -> None:
    omegas = [1.1, 1.2, 1.3, 1.4, 1.5]
    for omega, start in zip(omegas, branch_states(scene("vibro_impact"), 0.0, 0.02, omegas, FINE, "down"), strict=True):
        assert start.state is not None
        expected = 0.02 / abs(1 - omega**2 + 0.05j * omega)
        assert first_harmonic("vibro_impact", start.state)[1] == pytest.approx(expected, rel=1e-8, abs=0.0)


@pytest.mark.slow
def test_a_sweep_down_falls_on_the_branch_with_impacts_where_the_other_one_ends() -> None:
    # without the wall the mass reaches it at 1.0935 rad/s
    starts = branch_states(scene("vibro_impact"), 0.0, 0.02, [1.05, 1.15], SolverSettings(9, 128), "down")
    assert starts[0].state is not None
    rising, _ = branch_states(scene("vibro_impact"), 0.0, 0.02, [1.05, 1.15], SolverSettings(9, 128), "up")
    assert rising.state is not None
    assert np.abs(rising.state.contact_force_h).max() > 1e-3
    expected = first_harmonic("vibro_impact", rising.state)[1]
    assert first_harmonic("vibro_impact", starts[0].state)[1] == pytest.approx(expected, rel=1e-6, abs=0.0)


@pytest.mark.slow
def test_a_single_frequency_knows_its_branch() -> None:
    # both branches exist at 1.12 rad/s; below 1.0935 there is only the one with impacts
    model = scene("vibro_impact")
    settings = SolverSettings(5, 64)
    from_below = converged_state(model, 0.0, 0.02, 1.12, settings, "up")
    from_above = converged_state(model, 0.0, 0.02, 1.12, settings, "down")
    assert np.abs(from_below.contact_force_h).max() > 1e-3
    assert not from_above.contact_force_h.any()


@pytest.mark.slow
@pytest.mark.parametrize("omega", [1.5])
def test_a_single_frequency_deep_in_the_bistable_range_knows_its_branch(omega: float) -> None:
    # both branches exist from 1.0919 to 1.5576 rad/s
    model = scene("vibro_impact")
    (rising,), (falling,) = (branch_states(model, 0.0, 0.02, [omega], FINE, sweep) for sweep in ("up", "down"))
    assert rising.state is not None
    assert falling.state is not None
    expected = abs(vibro_impact_orbit(*VIBRO_IMPACT, omega, sweep_start=0.85).harmonic(0))
    assert first_harmonic("vibro_impact", rising.state)[1] == pytest.approx(expected, rel=0.005, abs=0.0)
    assert not falling.state.contact_force_h.any()
    assert rising.branch == falling.branch == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sweep", "omegas", "fold"), [("up", [1.5, 1.54, 1.58, 1.65], 1.5576), ("down", [1.0, 1.05, 1.12, 1.2], 1.09195)]
)
def test_a_fold_is_found_and_the_branch_behind_it_counted(sweep: str, omegas: list[float], fold: float) -> None:
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


@pytest.mark.slow
def test_a_refined_fold_does_not_depend_on_where_the_sweep_comes_from() -> None:
    folds = []
    for before in (1.50, 1.53, 1.55):
        starts = branch_states(scene("vibro_impact"), 0.0, 0.02, [before, 1.6], FINE, "up")
        folds.append(starts[1].fold_frequency)
    assert folds == pytest.approx([folds[0]] * 3, rel=1e-4, abs=0.0)


def test_a_structure_that_is_singular_with_its_joint_held_is_said_to_be() -> None:
    # Mass 1 between two springs, mass 2 held: K + i w C - w^2 M is exactly zero at 2 rad/s.
    model = scene("two_masses", stiffness_1=3.0, stiffness_2=1.0, damping_1=0.0, damping_2=0.0)
    frequency = 2.0 / (2 * np.pi)
    assert 2 * np.pi * frequency == 2.0
    starts = dict(follow_branch(model, 0.5, 20.0, np.array([frequency]), "up", SolverSettings(3, 64)))
    assert starts[0].outcome is Outcome.SINGULAR
    assert starts[0].state is None


@pytest.mark.slow
def test_a_sweep_says_where_it_is() -> None:
    said: list[str] = []
    list(follow_branch(scene("two_masses"), 0.5, 20.0, np.array([0.1]), "up", SolverSettings(3, 64), tell=said.append))
    assert said[0].startswith("first state at ")
    nodes = [float(text.split()[1]) for text in said if text.endswith(" of 1 pairs slip or open")]
    assert len(nodes) > 3
    assert nodes == sorted(nodes)
    assert nodes[-1] < 0.1


@pytest.mark.slow
def test_a_sweep_is_the_same_twice() -> None:
    model = random_model(3, ("3d", "one_tangent"))
    settings = SolverSettings(3, 64)
    first, second = (branch_states(model, 0.4, 60.0, [550.0, 600.0], settings) for _ in range(2))
    for one, other in zip(first, second, strict=True):
        assert one.state is not None
        assert other.state is not None
        assert np.array_equal(one.state.displacement_h, other.state.displacement_h)
        assert np.array_equal(one.state.contact_force_h, other.state.contact_force_h)
        assert one.newton_iterations == other.newton_iterations


def test_a_sweep_that_finds_no_state_has_nothing_to_keep(monkeypatch: pytest.MonkeyPatch) -> None:
    def in_vain(*given: Any) -> tuple[Outcome, None]:
        given[-1].iterations += 1000
        return Outcome.STATIC_FAILED, None

    monkeypatch.setattr(frequency_sweep, "solve_first_state", in_vain)
    kept: list[Packed] = []
    frequencies = np.array([150.0, 160.0, 170.0])
    found = dict(
        follow_branch(scene("sdof_slider"), 0.3, 10.0, frequencies, "up", SolverSettings(3, 64), keep=kept.append)
    )
    assert [found[place].outcome for place in range(3)] == [Outcome.STATIC_FAILED] * 3
    assert not kept
