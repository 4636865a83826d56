"""Whole response curves, balances as functions and travelling waves: against differences and exact motions."""

from functools import lru_cache

import numpy as np
import pytest

from solver import Outcome, SolverSettings, balance_of, build_model, frequency_response, march_wear, response_curve
from solver.stability.floquet import Multipliers
from tests.benchmarks.ring import FRICTION, WEAR, ring_in_time
from tests.contact_pair import ContactPair
from tests.rings import one_sector
from tests.solver.models import OMEGA, cyclic_model, random_model, scene
from tests.solver.reconstruction import harmonic_structure
from tests.solver.test_continuation import GRAZING, WALL_OMEGA

SETTINGS = SolverSettings(harmonics=19, samples=256)


@lru_cache
def wall_curve():
    """From the branch with impacts at 0.2 Hz through both folds to the one without impacts at 0.26 Hz."""
    return response_curve(scene("vibro_impact"), (0.2, 0.26), 0.02, 0.0, settings=SETTINGS, errors=False)


@lru_cache
def slipping(kind):
    """A random structure whose pairs stick, slip and open."""
    force, model = 150.0, random_model(3, ("3d", "one_tangent", "constant_load"))
    if kind == "travelling wave":
        force, model = 40.0, cyclic_model(3, ("3d", "3d"), 7, 5)
    settings = SolverSettings(harmonics=3, samples=64)
    return balance_of(model, OMEGA / (2.0 * np.pi), force, 0.4, settings=settings), model


@pytest.mark.parametrize("kind", ["random", "travelling wave"])
def test_all_coefficients_obey_the_equation_of_motion(kind):
    balance, model = slipping(kind)
    motion, dofs = balance.motion(), model.contact.dofs
    for place, order in enumerate(motion.orders.tolist()):
        linear = harmonic_structure(model, order)
        mass, damping, stiffness, harmonic = linear.mass, linear.damping, linear.stiffness, linear.load_harmonic
        rate = 2j * np.pi * order * motion.frequency
        load = {0: linear.load_static, 1: motion.excitation_amplitude * harmonic}.get(order, 0.0 * linear.load_static)
        force = np.zeros(len(mass), complex)
        force[dofs[dofs >= 0]] = motion.contact_force[:, :, place][dofs >= 0]
        moved = (rate**2 * mass + rate * damping + stiffness) @ motion.displacement[:, place]
        assert np.linalg.norm(moved + force - load) < 1e-6 * np.linalg.norm(moved - load + abs(force)), order
        np.testing.assert_allclose(
            motion.relative_displacement[:, :, place][dofs >= 0], motion.displacement[dofs[dofs >= 0], place]
        )
    phase = 2.0 * np.pi * motion.frequency * np.multiply.outer(motion.orders, motion.time)
    np.testing.assert_allclose(
        motion.displacement_t,
        (motion.displacement @ np.exp(1j * phase)).real,
        atol=1e-12 * abs(motion.displacement).max(),
    )
    assert abs(motion.contact_force_t[:, 1:]).max() > 0.0
    assert (motion.contact_force_t[:, 0] >= 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("unstable", [False, True])
def test_motions_and_multipliers_are_the_exact_ones_also_of_an_unstable_branch(unstable):
    curve = wall_curve()
    upper, lower = np.flatnonzero(curve.is_fold)
    index = (upper + lower) // 2 if unstable else 0
    motion, linear = curve.balance(index).motion(), scene("vibro_impact").linear[0]
    given = linear.mass, linear.damping, linear.stiffness, np.zeros(2), 0.02 * linear.load_harmonic
    pair = ContactPair(*given, 0, None, 0.0, 0.1, 0.0, 2.0 * np.pi * motion.frequency)
    orbit = pair.orbit_near(motion.displacement_t[:, 0], motion.velocity_t[:, 0])
    assert abs(curve.response[index, 0]) == pytest.approx(abs(orbit.harmonic(0)), rel=5e-3)
    np.testing.assert_allclose(curve.multipliers[index], orbit.multipliers(), atol=0.03)
    assert curve.stability[index] == ("fold" if unstable else "stable")


@pytest.mark.slow
def test_a_multiplier_passes_one_at_the_fold():
    curve = wall_curve()
    assert curve.outcome is Outcome.CONVERGED
    assert curve.frequency[-1] == pytest.approx(0.26, rel=1e-12)
    upper, lower = np.flatnonzero(curve.is_fold)
    assert curve.frequency[upper] == pytest.approx(0.2479, rel=2e-3)
    assert curve.multipliers[upper][0].real == pytest.approx(1.0, abs=0.02)
    assert set(curve.stability[: upper - 1]) == {"stable"}
    assert set(curve.stability[upper + 2 : lower]) == {"fold"}
    assert set(curve.stability[lower + 1 :]) == {"stable"}
    # the mass without wall moves by the gap: |1 - w^2 + 0.05 i w| = 0.2
    exact = np.sqrt(max(np.roots([1.0, 0.0025 - 2.0, 1.0 - 0.04]).real)) / (2.0 * np.pi)
    assert curve.frequency[lower] == pytest.approx(exact, rel=1e-3)


@pytest.mark.slow
def test_over_the_amplitude_the_curve_folds_where_the_mass_grazes_the_wall():
    at, settings = WALL_OMEGA / (2.0 * np.pi), SolverSettings(harmonics=5, samples=64)
    found = response_curve(scene("vibro_impact"), at, (0.03, 0.06), 0.0, settings=settings, errors=False)
    assert found.outcome is Outcome.CONVERGED
    assert found.excitation_amplitude[-1] == 0.06
    first, second = np.flatnonzero(found.is_fold)
    assert found.excitation_amplitude[first] == pytest.approx(GRAZING, rel=2e-3)
    # back behind the start on the unstable branch between, then to the branch of a sweep in frequency
    assert found.excitation_amplitude[second] < 0.02
    swept = frequency_response(scene("vibro_impact"), at, 0.06, 0.0, settings=settings)
    assert found.response[-1] == pytest.approx(swept.response[0], rel=1e-6)
    # beside the fold five harmonics may be too few to tell
    assert set(found.stability[: first - 3]) == {"stable"}
    assert set(found.stability[first + 1 : second]) == {"fold"}


@pytest.mark.slow
def test_a_curve_ends_at_the_state_of_a_sweep_and_knows_its_errors():
    slider, settings = scene("sdof_slider", damping=2.0), SolverSettings(harmonics=5, samples=64)
    curve = response_curve(slider, (149.5, 150.0), 10.0, 0.5, settings=settings)
    swept = frequency_response(slider, 150.0, 10.0, 0.5, settings=settings)
    assert curve.outcome is Outcome.CONVERGED
    assert curve.response[-1] == pytest.approx(swept.response[0], rel=1e-6)
    assert set(curve.stability) == {"stable"}
    assert (curve.response_error < 0.02).all()


@pytest.mark.slow
def test_a_joint_that_bounces_doubles_its_period():
    curve = response_curve(scene("vibro_impact"), (0.146, 0.148), 0.02, 0.0, settings=SETTINGS, errors=False)
    assert curve.stability == ()
    assert curve.outcome is Outcome.PERIOD_DOUBLED
    curve = response_curve(scene("vibro_impact"), (0.156, 0.146), 0.02, 0.0, settings=SETTINGS, errors=False)
    assert curve.stability[0] == "stable"
    assert curve.stability[-1] == "period doubling"
    assert curve.multipliers[-1][0].real < -1.0


def test_multipliers_name_the_kind_of_stability():
    for values, odd, kind in (
        ([0.9], True, "fold"),
        ([1.2], False, "fold"),
        ([1j, 0.2], False, "stable"),
        ([1.1j, -1.1j], False, "Neimark-Sacker"),
        ([], False, "unknown"),
    ):
        assert Multipliers(np.array(values, complex), 0.0).stability(odd) == kind
    assert Multipliers(np.array([1.2 + 0j]), 0.3).stability(False) == "unknown"


def test_curves_and_balances_without_a_state_say_why():
    model = scene("vibro_impact")
    curve = response_curve(model, (0.2, 0.26), 0.02, 0.0, settings=SETTINGS, errors=False, most_points=4)
    assert curve.outcome is Outcome.BRANCH_LOST
    assert "most_points = 4" in curve.message
    unloaded = response_curve(model, 0.1, (0.0, 0.005), 0.0, settings=SolverSettings(harmonics=3), errors=False)
    assert unloaded.outcome is Outcome.CONVERGED
    assert unloaded.response[0] == 0.0
    doubled = balance_of(model, 0.146, 0.02, 0.0, settings=SETTINGS)
    assert doubled.outcome is Outcome.PERIOD_DOUBLED
    assert np.isnan(doubled.state).all()
    assert np.isfinite(doubled.residual(np.zeros(doubled.size))).all()


def test_unknowns_that_cannot_be_are_refused():
    balance = balance_of(scene("vibro_impact"), 0.15, 0.001, 0.0, settings=SolverSettings(harmonics=3))
    for wrong in (balance.state[:-1], np.full(balance.size, np.nan), balance.state.reshape(1, -1)):
        with pytest.raises(ValueError, match=r"^z: "):
            balance.residual(wrong)


@pytest.mark.slow
@pytest.mark.parametrize(("diameter", "frequency", "amplitude"), [(3, 320.0, 12.0), (5, 280.0, 3.3)])
def test_a_wave_of_the_sector_is_that_of_the_ring_in_time(diameter, frequency, amplitude):
    cycles = 300.0
    tips, volumes = ring_in_time(diameter, frequency, amplitude, (360,), cycles)
    waves = np.fft.fft(tips[0]) / tips[0].size
    assert np.abs(np.delete(waves, diameter)).max() < 1e-3 * abs(waves[diameter])
    sector = one_sector(diameter)
    tip = frequency_response(sector, [frequency], amplitude, FRICTION).response[0, 0]
    assert tip == pytest.approx(waves[diameter], rel=1e-2)
    worn = march_wear(sector, frequency, amplitude, FRICTION, WEAR, cycles)
    volume = worn.worn_volume[-1]
    # the steps in time are known to 1 %
    assert abs(volume - volumes.mean()) < (worn.worn_volume_error[-1] + 1e-2) * volume
    assert volume > 0.0


def damped_blade(limit, spring, ratio):
    """A blade, and the slip of a damper of a friction limit, N, behind a spring, N/m, against the next blade.

    ratio: relative amplitude of neighbours over that of a blade, at nodal diameter 3 of 24.
    """
    stiffness = {}
    for k in range(13):
        apart = 1.0 - np.exp(2j * np.pi * k / 24)
        stiffness[k] = np.array([[spring, -spring * apart], [-spring * np.conj(apart), 1e5 + spring * abs(apart) ** 2]])
    assert abs(1.0 - np.exp(2j * np.pi * 3 / 24)) == pytest.approx(ratio)
    loads = {"load_harmonic": [0.0, 1.0], "response": dict.fromkeys(stiffness, np.array([[0.0, 1.0]]))}
    loads |= {"normal_load": limit / 0.5, "n_sectors": 24, "nodal_diameter": 3}
    return build_model(dict.fromkeys(stiffness, np.diag([0.0, 0.1])), None, stiffness, [[-1, 0, -1]], 1e-4, **loads)


@pytest.mark.slow
@pytest.mark.parametrize(("harmonics", "within"), [(1, 2e-3), (9, 1e-2)])
@pytest.mark.parametrize("over_optimum", [0.8, 1.0, 2.0])
def test_the_resonance_of_a_blade_with_friction_dampers_is_griffins(harmonics, within, over_optimum):
    """In phase resonance the excitation feeds in pi F A a period; a slider behind a spring k takes 4 S (r A - S / k),
    with its friction limit S and the relative amplitude r A. So A = 4 S^2 / (k (4 r S - pi F)), and smallest, pi F /
    (r^2 k), with S = pi F / (2 r). It holds where the blade has one harmonic; here the slider has one, too. (J. H.
    Griffin, J. Eng. Power 102 (1980) 329, for a blade with a damper to the ground, r = 1.)
    """
    force, spring, ratio = 1.0, 2e4, 2.0 * np.sin(np.pi * 3 / 24)
    limit = over_optimum * np.pi * force / (2.0 * ratio)
    amplitude = 4.0 * limit**2 / (spring * (4.0 * ratio * limit - np.pi * force))
    assert amplitude >= np.pi * force / (ratio**2 * spring) * (1.0 - 1e-12)
    model, settings = damped_blade(limit, spring, ratio), SolverSettings(harmonics=harmonics, samples=1024)
    found = march_wear(model, "resonance", force, 0.5, 0.0, 1.0, between=(150.0, 200.0), settings=settings)
    assert abs(found.response[0, 0]) == pytest.approx(amplitude, rel=within)
