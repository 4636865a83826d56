"""The coarse dovetail sector: states near resonance against the laws, and first-order wear."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from scipy.linalg import eigh

from solver.outcome import Outcome
from solver.results.history import PeriodicState, StartState, WearHistory
from solver.settings import Scheme, SolverSettings
from solver.structure.penalty import build_penalty
from tests.solver.contact_twin import pair_period
from tests.solver.models import branch_states, dovetail, march_wear
from tests.solver.reconstruction import contact_work, full_motion, series

# the states that all tests share take seconds
pytestmark = pytest.mark.slow

SETTINGS = SolverSettings(harmonics=3, samples=64)
FRICTION = 0.5
WEAR = 1.1e-11  # 1/Pa
STEPS = (2000.0, 1000.0, 500.0)
CYCLES = np.array([0.0, 1000.0, 2000.0, 4000.0])
APPROACH = (-2.0, -1.0, -0.5, 0.0)  # Hz, of the sweep that leads to a frequency


@lru_cache
def glued_frequency(nodal_diameter: int) -> float:
    """First natural frequency with the joint held, Hz."""
    model = dovetail(3, nodal_diameter)
    linear = model.linear[nodal_diameter]
    inner = np.setdiff1d(np.arange(linear.mass.shape[0]), model.contact.dofs.ravel())
    first = eigh(linear.stiffness[np.ix_(inner, inner)], linear.mass[np.ix_(inner, inner)], eigvals_only=True)[0]
    return float(np.sqrt(first) / (2 * np.pi))


@lru_cache
def sweep_to(nodal_diameter: int, offset: float, amplitude: float) -> StartState:
    """State at `offset`, Hz, from the glued frequency, at the end of a sweep up."""
    omegas = 2 * np.pi * (glued_frequency(nodal_diameter) + offset + np.array(APPROACH))
    return branch_states(dovetail(3, nodal_diameter), FRICTION, amplitude, omegas, SETTINGS)[-1]


def state_at(nodal_diameter: int, offset: float, amplitude: float) -> tuple[StartState, PeriodicState]:
    start = sweep_to(nodal_diameter, offset, amplitude)
    assert start.outcome is Outcome.CONVERGED
    assert start.state is not None
    return start, start.state


def law(nodal_diameter: int, start: StartState, state: PeriodicState, passes: int) -> tuple[np.ndarray, np.ndarray]:
    """Contact forces (n_contact, 3, N) of the plain law for what a state stores, and its predicted forces."""
    penalty = build_penalty(dovetail(3, nodal_diameter), start.penalty_omega, 3)
    assert not penalty.inertial.any()
    moved = state.displacement_h.copy()
    moved[:, 0, 0] -= state.wear_depth
    eps = np.column_stack([penalty.normal, penalty.tangential, penalty.tangential])
    predicted_t = series(state.contact_force_h + eps[:, :, None] * moved, SETTINGS.samples)
    slip = state.start_history * penalty.tangential[:, None]
    forces = [pair_period(predicted_t[pair], FRICTION, slip[pair], passes)[0] for pair in range(16)]
    return np.array(forces), predicted_t


SLIPPING = [(0, -0.45, 2.0), (20, -0.5, 2.0)]


@pytest.mark.parametrize(("nodal_diameter", "offset", "amplitude"), SLIPPING)
def test_a_state_balances_forces_and_energy(nodal_diameter: int, offset: float, amplitude: float) -> None:
    _, state = state_at(nodal_diameter, offset, amplitude)
    motion = full_motion(dovetail(3, nodal_diameter), state)
    assert max(motion.imbalance) < 1e-7 * motion.force
    taken = contact_work(state, series(state.contact_force_h, SETTINGS.samples))
    work = motion.excitation_work()
    assert taken > 0.01 * work, "nothing slips: the test means nothing"
    assert work == pytest.approx(motion.viscous_work() + taken, rel=1e-6, abs=0.0)


@pytest.mark.parametrize(("nodal_diameter", "offset", "amplitude"), SLIPPING)
def test_a_state_repeats_from_one_period_to_the_next(nodal_diameter: int, offset: float, amplitude: float) -> None:
    start, state = state_at(nodal_diameter, offset, amplitude)
    # slip whose direction turns closes by a factor a period that may be near 1
    forces, _ = law(nodal_diameter, start, state, passes=600)
    phase = 2 * np.pi * np.arange(SETTINGS.samples) / SETTINGS.samples
    size = np.abs(state.contact_force_h).max()
    for n in range(4):
        amplitudes = (forces[:, 1:] * np.exp(-1j * n * phase)).mean(axis=-1) * (2 if n else 1)
        stored = (
            state.contact_force_h[:, 1:, 0]
            if n == 0
            else (state.contact_force_h[:, 1:, 2 * n - 1] - 1j * state.contact_force_h[:, 1:, 2 * n])
        )
        assert np.abs(amplitudes - stored).max() < 1e-6 * size, f"harmonic {n} changes when the period goes on"


@pytest.mark.parametrize(("nodal_diameter", "amplitude"), [(3, 0.5)])
def test_the_resonance_is_passed_on_a_sweep(nodal_diameter: int, amplitude: float) -> None:
    frequencies = glued_frequency(nodal_diameter) + np.array([-2.0, -1.0, -0.5, -0.1, 0.3, 1.0])
    model = dovetail(3, nodal_diameter)
    starts = branch_states(model, FRICTION, amplitude, 2 * np.pi * frequencies, SETTINGS)
    assert [start.outcome for start in starts] == [Outcome.CONVERGED] * 6
    sizes = [abs(full_motion(model, start.state).response()[0]) for start in starts if start.state is not None]
    assert 0 < np.argmax(sizes) < 5


@lru_cache
def worn(step: float, scheme: Scheme) -> WearHistory:
    start, _ = state_at(0, -0.45, 2.0)
    history = march_wear(dovetail(), FRICTION, start, WEAR, step, scheme, CYCLES, SETTINGS)
    assert history.outcome is Outcome.CONVERGED
    assert (np.diff(history.wear_depth, axis=0) >= 0).all()
    assert history.worn_volume == pytest.approx(history.wear_depth @ dovetail().contact.area, rel=1e-14, abs=0.0)
    assert 0 < history.error_estimate < 0.2
    return history


def test_both_schemes_are_of_first_order_and_have_one_limit() -> None:
    volumes = {scheme: [worn(step, scheme).worn_volume[-1] for step in STEPS] for scheme in ("explicit", "implicit")}
    gap = np.abs(np.subtract(volumes["explicit"], volumes["implicit"]))
    assert np.polyfit(np.log(STEPS), np.log(gap), 1)[0] == pytest.approx(1.0, abs=0.1)
    limits = {scheme: 2 * values[-1] - values[-2] for scheme, values in volumes.items()}
    assert limits["explicit"] == pytest.approx(limits["implicit"], rel=1e-3, abs=0.0)
    for scheme, values in volumes.items():
        errors = np.abs(np.array(values) - np.mean(list(limits.values())))
        assert np.polyfit(np.log(STEPS), np.log(errors), 1)[0] == pytest.approx(1.0, abs=0.1), scheme
