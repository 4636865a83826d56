"""The references, and the time integration of the benchmarks, against closed forms and a general integrator."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from solver import SolverSettings, backbone, build_model
from tests import references
from tests.benchmarks import time_integration as in_time
from tests.solver.models import scene

TWO_MASSES = ([[1, 0], [0, 1]], [[0.04, -0.02], [-0.02, 0.02]], [[2, -1], [-1, 1]], [20, 0], 1, 7.2)
VIBRO_IMPACT = (1.0, 0.05, 1.0, 0.02, 100.0, 0.1)


@pytest.mark.parametrize("case", [(0.7, 0.1, 0.6), (0.4, 0.02, 0.5), (1.2, 0.3, 0.3)])
def test_slider_with_damping_balances_its_energy(case):
    omega, damping, friction = case
    orbit = references.slider_orbit(1.0, damping, 1.0, 1.0, friction, omega)
    # Work of cos(omega t) on Re(X exp(i omega t)) in a period is -pi Im X.
    work = -np.pi * orbit.harmonic(0).imag
    speed = orbit.sample(4096)[1]
    viscous = damping * np.mean(speed**2) * orbit.system.period
    assert work == pytest.approx(viscous + friction * orbit.path(0, ("forward", "backward")), rel=1e-6)


@pytest.mark.parametrize(("omega", "first", "second"), [(0.4, 25.21813, 31.60782), (0.6, 139.0437, 217.1278)])
def test_two_masses_have_the_known_first_harmonics(omega, first, second):
    orbit = references.coulomb_orbit(*TWO_MASSES, omega)
    assert abs(orbit.harmonic(0)) == pytest.approx(first, rel=3e-7)
    assert abs(orbit.harmonic(1)) == pytest.approx(second, rel=3e-7)
    assert abs(orbit.harmonic(1, 0)) < 1e-9 * second


def test_friction_on_any_mass_of_a_chain_with_a_load_out_of_phase():
    mass = np.diag([1.0, 2.0, 1.5])
    stiffness = np.array([[3.0, -1, 0], [-1, 2, -1], [0, -1, 2]])
    damping = 0.02 * stiffness + 0.01 * mass
    load = np.array([1.0, 0.5j, 0])
    for dof in range(3):
        orbit = references.coulomb_orbit(mass, damping, stiffness, load, dof, 0.3, 1.1)
        motion = np.array([orbit.harmonic(index) for index in range(3)])
        taken_up = load - (stiffness - 1.1**2 * mass + 1.1j * damping) @ motion
        assert np.delete(taken_up, dof) == pytest.approx(0, abs=1e-10)
        # The first harmonic of a force that slip switches between +-0.3 N is at most 4/pi of that.
        assert 0.3 < abs(taken_up[dof]) <= 0.3 * 4 / np.pi * (1 + 1e-12)


@pytest.mark.parametrize(("omega", "known"), [(1.2, 0.1146716), (1.5, 0.1889205)])
def test_vibro_impact_has_the_known_first_harmonic_on_the_upper_branch(omega, known):
    orbit = references.vibro_impact_orbit(*VIBRO_IMPACT, omega, begin=0.85)
    assert {segment.phase for segment in orbit.segments} == {"open", "closed"}
    assert abs(orbit.harmonic(0)) == pytest.approx(known, rel=3e-7)

    def rate(time, y):
        return [y[1], 0.02 * np.cos(omega * time) - 0.05 * y[1] - y[0] - 100 * max(y[0] - 0.1, 0.0)]

    start = orbit.sample(1)[:, 0]
    period = orbit.system.period
    end = solve_ivp(rate, (0, period), start, method="DOP853", rtol=1e-11, atol=1e-13, max_step=period / 400).y[:, -1]
    assert end == pytest.approx(start, rel=1e-7)


# --- the time integration of the benchmarks ---

MASS, STIFFNESS, FREQUENCY, FORCE = 0.1, 1.6e5, 160.0, 10.0
OMEGA = 2.0 * np.pi * FREQUENCY


def test_the_differences_are_exact_for_the_excitation():
    weights = in_time.fitted_weights(3.0, 0.02)
    times = 0.7 - 0.02 * np.arange(3)
    assert weights @ np.cos(3.0 * times) == pytest.approx(-3.0 * np.sin(2.1), rel=1e-9)
    assert weights.sum() == pytest.approx(0.0, abs=1e-9)
    # those of a short step are the usual ones
    np.testing.assert_allclose(0.02 * in_time.fitted_weights(1e-2, 0.02), [1.5, -2.0, 0.5], rtol=1e-5)


@pytest.mark.slow
def test_a_mass_on_rigid_ground_moves_as_in_den_hartogs_closed_form():
    """Of first order, with some noise: the mass turns on whole steps."""
    model = scene("sdof_slider", normal_stiffness=0.0)
    path = 4.0 * references.den_hartog_amplitude(MASS, STIFFNESS, FORCE, 5.0, OMEGA)
    first = abs(references.slider_orbit(MASS, 0.0, STIFFNESS, FORCE, 5.0, OMEGA).harmonic(0))
    errors = []
    for n_steps in (200, 3200):
        structure = in_time.build(model, 0.5, FREQUENCY, FORCE, n_steps)
        motions = [in_time.at_rest(model, structure, model.contact.gap)]
        for _ in range(40):
            motions.append(in_time.one_period(structure, motions[-1], model.contact.gap))
        found = np.mean([abs(in_time.first_harmonic(structure, motion, np.eye(1))[0]) for motion in motions[-8:]])
        work = np.mean([motion.work[0] for motion in motions[-8:]])
        errors.append(max(abs(found / first - 1.0), abs(work / (10.0 * path) - 1.0)))
    assert errors[0] < 1e-2
    assert errors[1] < min(0.4 * errors[0], 2e-3)


@pytest.mark.slow
def test_wear_of_a_slider_follows_its_differential_equation():
    model = scene("sdof_slider", damping=8.0)
    structure = in_time.build(model, 0.5, FREQUENCY, FORCE, 400)
    gap = model.contact.gap
    motion = in_time.settle(structure, in_time.at_rest(model, structure, gap), gap, work_change=5e-3)
    # the mount of the closing displacement is massless
    for part in (np.full(1, 0.0), np.full(1, 1e-9)):
        assert in_time.at_rest(model, structure, part).force[0] == pytest.approx(10.0 - 1e5 * part[0], rel=1e-6)
    *_, (cycle, depth, _, _) = in_time.wear(model, structure, motion, 1.1e-11, 600.0, 1e5)
    exact = references.slider_wear_depth(
        [0.0, 1e5], lambda limit: references.slider_amplitude(MASS, 8.0, STIFFNESS, FORCE, limit, OMEGA)
    )
    assert cycle == pytest.approx(1e5)
    assert depth[0] == pytest.approx(exact[-1], rel=1e-2)


def decay_of(signal, step):
    """Amplitude, frequency, Hz, and damping ratio of each cycle of a decaying signal (n_times,).

    From its peaks up and down, each by a parabola through three samples: amplitude over half a cycle to both sides.
    """
    middle = signal[1:-1]
    turns = 1 + np.flatnonzero((middle - signal[:-2]) * (signal[2:] - middle) < 0.0)
    left, here, right = signal[turns - 1], signal[turns], signal[turns + 1]
    offset = 0.5 * (left - right) / (left - 2.0 * here + right)
    times, peaks = step * (turns + offset), here - 0.25 * (left - right) * offset
    heights = 0.5 * np.abs(np.diff(peaks))
    middles = 0.5 * (times[1:] + times[:-1])
    rate = np.log(heights[:-2] / heights[2:])
    return heights[1:-1], 1.0 / (middles[2:] - middles[:-2]), rate / np.hypot(2.0 * np.pi, rate)


@pytest.mark.slow
def test_a_nonlinear_mode_is_what_its_free_decay_shows_at_two_amplitudes():
    """As far as a mode of periodic motion describes a decay: the amplitude changes within a cycle."""
    # of the stiffness of the tip a twelfth goes over the foot, which sticks up to 25 N
    stiffness = np.array([[1e7, 0.0, 0.0], [0.0, 4e5, -2e5], [0.0, -2e5, 2.2e6]])
    load = {"load_static": [50.0, 0.0, 0.0], "load_harmonic": [0.0, 0.0, 1.0], "response": [2]}
    model = build_model(np.diag([1e-3, 1e-3, 0.2]), 1e-6 * stiffness, stiffness, [[0, 1, -1]], 1e-4, **load)
    modal = np.array([2e-4, 8e-4])
    mode = backbone(model, modal, 0.5, settings=SolverSettings(harmonics=7, samples=128))
    tips = abs(mode.response[:, 0])
    structure = in_time.build(model, 0.5, float(mode.frequency[0]), 0.0, 200)
    rest, seen = in_time.at_rest(model, structure, model.contact.gap), []
    motion = rest._replace(x=rest.x + 1.5 * tips[-1] * np.eye(3)[2])
    for _ in range(90):
        motion = in_time.one_period(structure, motion, model.contact.gap)
        seen.append(motion.responses[:, 2])
    amplitude, frequency, damping = decay_of(np.concatenate(seen), structure.step)
    for place, tip in enumerate(tips.tolist()):
        swung, damped = (np.interp(tip, amplitude[::-1], of[::-1]) for of in (frequency, damping))
        assert swung == pytest.approx(mode.frequency[place], rel=2e-3)
        assert damped == pytest.approx(mode.damping_ratio[place], rel=0.05)
