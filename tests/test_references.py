"""The references against each other, against closed forms and against a general integrator."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.references import (
    coulomb_orbit,
    slider_orbit,
    vibro_impact_orbit,
)

TWO_MASSES = ([[1, 0], [0, 1]], [[0.04, -0.02], [-0.02, 0.02]], [[2, -1], [-1, 1]], [20, 0], 1, 7.2)
VIBRO_IMPACT = (1.0, 0.05, 1.0, 0.02, 100.0, 0.1)


def phases(orbit):
    return {segment.phase for segment in orbit.segments}


@pytest.mark.parametrize("case", [(0.7, 0.1, 0.6), (0.4, 0.02, 0.5), (1.2, 0.3, 0.3)])
def test_slider_with_damping_balances_its_energy(case):
    omega, damping, friction = case
    orbit = slider_orbit(1.0, damping, 1.0, 1.0, friction, omega)
    # Work of cos(omega t) on Re(X exp(i omega t)) in a period is -pi Im X.
    work = -np.pi * orbit.harmonic(0).imag
    speed = orbit.sample(4096)[1]
    viscous = damping * np.mean(speed**2) * orbit.system.period
    assert work == pytest.approx(viscous + friction * orbit.path(0, ("forward", "backward")), rel=1e-6)


@pytest.mark.parametrize(("omega", "first", "second"), [(0.4, 25.21813, 31.60782), (0.6, 139.0437, 217.1278)])
def test_two_masses_have_the_known_first_harmonics(omega, first, second):
    orbit = coulomb_orbit(*TWO_MASSES, omega)
    assert abs(orbit.harmonic(0)) == pytest.approx(first, rel=3e-7)
    assert abs(orbit.harmonic(1)) == pytest.approx(second, rel=3e-7)
    assert abs(orbit.harmonic(1, 0)) < 1e-9 * second


def test_friction_on_any_mass_of_a_chain_with_a_load_out_of_phase():
    mass = np.diag([1.0, 2.0, 1.5])
    stiffness = np.array([[3.0, -1, 0], [-1, 2, -1], [0, -1, 2]])
    damping = 0.02 * stiffness + 0.01 * mass
    load = np.array([1.0, 0.5j, 0])
    for dof in range(3):
        orbit = coulomb_orbit(mass, damping, stiffness, load, dof, 0.3, 1.1)
        motion = np.array([orbit.harmonic(index) for index in range(3)])
        taken_up = load - (stiffness - 1.1**2 * mass + 1.1j * damping) @ motion
        assert np.delete(taken_up, dof) == pytest.approx(0, abs=1e-10)
        # The first harmonic of a force that slip switches between +-0.3 N is at most 4/pi of that.
        assert 0.3 < abs(taken_up[dof]) <= 0.3 * 4 / np.pi * (1 + 1e-12)


@pytest.mark.parametrize(("omega", "known"), [(1.2, 0.1146716), (1.5, 0.1889205)])
def test_vibro_impact_has_the_known_first_harmonic_on_the_upper_branch(omega, known):
    orbit = vibro_impact_orbit(*VIBRO_IMPACT, omega, begin=0.85)
    assert phases(orbit) == {"open", "closed"}
    assert abs(orbit.harmonic(0)) == pytest.approx(known, rel=3e-7)

    def rate(time, y):
        return [y[1], 0.02 * np.cos(omega * time) - 0.05 * y[1] - y[0] - 100 * max(y[0] - 0.1, 0.0)]

    start = orbit.sample(1)[:, 0]
    period = orbit.system.period
    end = solve_ivp(rate, (0, period), start, method="DOP853", rtol=1e-11, atol=1e-13, max_step=period / 400).y[:, -1]
    assert end == pytest.approx(start, rel=1e-7)
