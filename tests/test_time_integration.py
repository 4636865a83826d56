"""The plain time integration of the benchmarks: closed forms, free decay against nonlinear modes, travelling waves."""

import numpy as np
import pytest

from solver import SolverSettings, backbone, build_model, frequency_response
from tests.benchmarks import time_integration as in_time
from tests.benchmarks.free_decay import decay_of, free_decay
from tests.references import den_hartog_amplitude, slider_amplitude, slider_orbit, slider_wear_depth
from tests.rings import ring_of_sectors
from tests.solver.models import cyclic_model, glued_frequency, scene
from tests.solver.reconstruction import harmonic_structure

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
    path = 4.0 * den_hartog_amplitude(MASS, STIFFNESS, FORCE, 5.0, OMEGA)
    first = abs(slider_orbit(MASS, 0.0, STIFFNESS, FORCE, 5.0, OMEGA).harmonic(0))
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
    *_, (cycle, depth, _) = in_time.wear(model, structure, motion, 1.1e-11, 600.0, 1e5)
    exact = slider_wear_depth([0.0, 1e5], lambda limit: slider_amplitude(MASS, 8.0, STIFFNESS, FORCE, limit, OMEGA))
    assert cycle == pytest.approx(1e5)
    assert depth[0] == pytest.approx(exact[-1], rel=1e-2)


def decaying(model, place, pull, frequency, periods):
    """Free decay of a displacement that is let go at `pull`, m: amplitude, frequency, Hz, damping ratio by cycle."""
    structure = in_time.build(model, 0.5, frequency, 0.0, 200)
    rest = in_time.at_rest(model, structure, model.contact.gap)
    begun = rest.x.copy()
    begun[:, place] += pull
    signal = free_decay(structure, rest._replace(x=begun), model.contact.gap, periods)[:, place]
    return structure, decay_of(signal, structure.step)


def test_a_mass_on_rigid_ground_loses_four_limits_in_each_cycle():
    model, limit = scene("sdof_slider", normal_stiffness=0.0), 5.0 / STIFFNESS
    natural = np.sqrt(STIFFNESS / MASS) / (2.0 * np.pi)
    _, (amplitude, frequency, damping) = decaying(model, 0, 30.0 * limit, natural, 6)
    np.testing.assert_allclose(np.diff(amplitude), -2.0 * limit, rtol=0.03)
    np.testing.assert_allclose(frequency, natural, rtol=2e-3)
    exact = np.log((amplitude + 2.0 * limit) / (amplitude - 2.0 * limit))
    np.testing.assert_allclose(damping, exact / np.hypot(exact, 2.0 * np.pi), rtol=0.03)


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
    _, (amplitude, frequency, damping) = decaying(model, 2, 1.5 * float(tips[-1]), float(mode.frequency[0]), 90)
    for place, tip in enumerate(tips.tolist()):
        seen, damped = (np.interp(tip, amplitude[::-1], of[::-1]) for of in (frequency, damping))
        assert seen == pytest.approx(mode.frequency[place], rel=2e-3)
        assert damped == pytest.approx(mode.damping_ratio[place], rel=0.05)


@pytest.mark.parametrize(("n_sectors", "nodal_diameter", "n_sectors_apart"), [(6, 2, 3), (7, 3, 7), (5, 2, 5)])
def test_a_ring_moves_in_each_wave_as_the_sector_of_this_harmonic(n_sectors, nodal_diameter, n_sectors_apart):
    model = cyclic_model(3, ("3d", "one_tangent"), n_sectors, nodal_diameter, n_sectors_apart)
    ring = ring_of_sectors(model)
    assert ring.contact.n_contact == n_sectors_apart * model.contact.n_contact
    for harmonic in range(n_sectors_apart):
        one = harmonic_structure(model, harmonic)
        shape = np.array([1.0, 1j]) @ np.random.default_rng(harmonic).standard_normal((2, len(one.mass)))
        wave = np.exp(2j * np.pi * harmonic * nodal_diameter / n_sectors * np.arange(n_sectors_apart))
        for name in ("mass", "damping", "stiffness"):
            moved = getattr(ring.linear[0], name) @ np.kron(wave, shape)
            np.testing.assert_allclose(moved, np.kron(wave, getattr(one, name) @ shape), rtol=1e-9, atol=1e-6)


@pytest.mark.slow
def test_a_travelling_wave_in_time_is_the_periodic_state_of_its_sector():
    model = cyclic_model(5, ("3d", "3d"), 6, 2, 21)
    frequency, force = 0.93 * glued_frequency(model), 20.0
    found = frequency_response(model, np.array([frequency]), force, 0.4)
    ring = ring_of_sectors(model)
    structure, motion = in_time.loaded(ring, 0.4, in_time.ramp(frequency, force, 60), 240)
    work = motion.work.reshape(3, 2)
    np.testing.assert_allclose(work, work[[0]].repeat(3, axis=0), rtol=1e-3)
    tip = in_time.first_harmonic(structure, motion, ring.linear[0].response)
    assert np.linalg.norm(tip - found.response[0]) <= (found.response_error[0] + 5e-3) * np.linalg.norm(tip)
    assert (motion.work > 0.0).all()
