"""The resonance of a vibration, and histories whose frequency follows it."""

import math
from functools import lru_cache

import numpy as np
import pytest
from scipy.optimize import brentq

from solver import build_model, march_wear
from solver.outcome import Outcome
from solver.packing import Packed
from solver.results.state_report import periodic_motion, resonance_frequency
from solver.settings import FollowedFrequency, Resolution, Scheme, SolverSettings, all_orders
from tests.references import slider_orbit
from tests.solver.models import assert_same, dovetail, random_balance, random_model, scene, sweep_of
from tests.solver.models import march_wear as march_from
from tests.solver.reconstruction import harmonic_structure

WEAR = 1.1e-11  # 1/Pa


@pytest.mark.parametrize("nodal_diameter", [None, 0, 3])
def test_it_is_that_of_the_equation_of_motion(nodal_diameter):
    if nodal_diameter is None:
        balance, predicted = random_balance(random_model(3, ("3d",) * 4, 4), SolverSettings(3, 24), 3, wear=False)
    else:
        settings, resolution = SolverSettings(3, 24), Resolution(all_orders(3), 24)
        model = dovetail(3, nodal_diameter)
        balance, predicted = random_balance(model, settings, 3, wear=False, resolution=resolution)
    joint, at = balance.joint, balance.evaluate(predicted)
    linear, x = harmonic_structure(joint.model, 1), periodic_motion(joint, at).displacement[:, 1]
    load = joint.excitation_amplitude * linear.load_harmonic
    # what holds the pairs is the rest of the equation of motion, K x + held + i w C x = F + w^2 M x
    square = joint.omega**2 + np.real(np.vdot(x, load)) / np.real(np.vdot(x, linear.mass @ x))
    expected = np.sqrt(square) if square > 0.0 else np.nan
    assert resonance_frequency(joint, at)[0] == pytest.approx(expected, rel=1e-9, nan_ok=True)


DAMPING = 20.0  # N s/m: 8 % of the critical damping of the slider
CYCLES = np.linspace(0.0, 4e4, 6)
BETWEEN = (180.0, 230.0)
SCHEMES: tuple[Scheme, ...] = ("explicit", "implicit", "adaptive")


@lru_cache
def worn(word="resonance", scheme="adaptive", rtol=1e-2):
    """History of the slider; steps of the other schemes are an eighth of the cycles."""
    asked = {"scheme": scheme, "step": 5e3, "between": BETWEEN, "settings": SolverSettings(rtol=rtol)}
    return march_wear(scene("sdof_slider", damping=DAMPING), word, 10.0, 0.5, WEAR, CYCLES, **asked)


def exact_response(frequency, depth):
    """First harmonic of the slider at a wear depth, from event to event."""
    friction = 0.5 * (10.0 - 1e5 * depth)
    return complex(slider_orbit(0.1, DAMPING, 1.6e5, 10.0, friction, 2.0 * np.pi * frequency).harmonic(0))


@pytest.mark.slow
@pytest.mark.parametrize("scheme", SCHEMES)
def test_phase_resonance_is_that_of_the_exact_motion(scheme):
    history = worn(scheme=scheme)
    assert history.outcome is Outcome.CONVERGED
    assert history.excitation_frequency[-1] - history.excitation_frequency[0] > 1.0
    for depth, found, error in zip(
        history.wear_depth[:, 0], history.excitation_frequency, history.excitation_frequency_error, strict=True
    ):
        expected = brentq(lambda at, depth=depth: exact_response(at, depth).real, 195.0, 205.0, xtol=1e-6)
        assert abs(found - expected) < error < 0.3


@pytest.mark.slow
def test_the_largest_amplitude_is_that_of_the_exact_motion():
    history = worn("peak", rtol=1e-3)
    assert history.outcome.complete
    # below phase resonance, which is above 199 Hz
    assert (history.excitation_frequency < 198.5).all()
    for row in (0, 5):
        depth, response = history.wear_depth[row, 0], history.response[row, 0]
        found, error = history.excitation_frequency[row], history.excitation_frequency_error[row]
        around = np.linspace(192.0, 202.0, 9)
        sizes = [abs(exact_response(float(at), depth)) for at in around]
        curve = np.polynomial.Polynomial.fit(around, sizes, 6)
        expected = brentq(curve.deriv(), 193.0, 201.0)
        assert abs(found - expected) < error < 2.0
        assert abs(response) == pytest.approx(curve(expected), rel=2e-3)


@pytest.mark.slow
def test_where_the_spring_no_longer_presses_the_resonance_is_the_natural_frequency():
    """Wear relaxes the spring of the slider: friction comes to its end with the wear."""
    model, settings = scene("sdof_slider", damping=DAMPING), SolverSettings(harmonics=3, samples=64)
    history = march_wear(model, "resonance", 10.0, 0.5, WEAR, math.inf, between=BETWEEN, settings=settings, outputs=3)
    assert history.outcome is Outcome.CONVERGED
    assert history.wear_depth[-1, 0] == pytest.approx(1e-4, rel=1e-3)
    assert history.excitation_frequency[-1] == pytest.approx(math.sqrt(1.6e5 / 0.1) / (2.0 * math.pi), rel=1e-6)
    assert history.excitation_frequency[0] < 199.5


@pytest.mark.slow
@pytest.mark.parametrize("word", ["resonance", "peak"])
def test_an_interrupted_search_and_history_are_equal_to_the_last_bit(word, monkeypatch):
    monkeypatch.setattr("solver.wear.problem.WearProblem.iterations_per_save", 8)
    model, follow, settings = scene("sdof_slider", damping=DAMPING), FollowedFrequency(word, *BETWEEN), SolverSettings()
    given, kept = list[Packed | str](), list[Packed]()
    ((_, start),) = sweep_of(model, 0.5, 10.0, "up", settings, given.append).states(follow)
    saved = [progress for progress in given if not isinstance(progress, str)]
    assert len(saved) > 2
    for progress in (saved[0], saved[len(saved) // 2], saved[-1]):
        sweeps = sweep_of(model, 0.5, 10.0, "up", settings)
        sweeps.load(progress)
        ((_, again),) = sweeps.states(follow)
        assert_same(again, start)
    asked = model, 0.5, start, WEAR, 1e3, "implicit", CYCLES, settings
    whole = march_from(*asked, keep=kept.append, follow=follow)
    assert len(kept) > 1
    for progress in (kept[0], kept[-1]):
        assert_same(march_from(*asked, resume=progress, follow=follow), whole)


@pytest.mark.slow
def test_a_sweep_down_over_three_quarter_octaves_finds_the_same_resonance():
    """Each quarter octave has a sweep of its own."""
    model = scene("sdof_slider", damping=DAMPING)
    found = march_wear(model, "resonance", 10.0, 0.5, 0.0, 0.0, sweep="down", between=(175.0, 260.0))
    assert found.outcome is Outcome.CONVERGED
    # each sweep leads to harmonics of its own
    apart = abs(found.excitation_frequency[0] - worn().excitation_frequency[0])
    assert apart < 0.5 * found.excitation_frequency_error[0] < 0.5


@pytest.mark.parametrize(
    ("between", "n_known", "said"),
    [((180.0, 200.3), 3, " 180 to 200.3 Hz"), ((100.0, 150.0), 0, "give another range")],
)
def test_outside_its_range_a_resonance_ends_the_history(between, n_known, said):
    history = march_wear(scene("sdof_slider", damping=DAMPING), "resonance", 10.0, 0.5, WEAR, CYCLES, between=between)
    assert history.outcome is Outcome.RESONANCE_LOST
    assert said in history.message
    # the values of the states within the range are kept
    known = np.isfinite(history.worn_volume)
    assert known.sum() <= n_known
    assert known[0] == (n_known > 0)
    np.testing.assert_allclose(history.excitation_frequency[known], worn().excitation_frequency[known], atol=0.05)


def test_a_resonance_that_the_sweep_jumps_over_is_none_of_its_states():
    """The mass that bounces stiffens: a sweep down jumps from the lower branch to the upper one below its resonance."""
    settings, between = SolverSettings(harmonics=1, samples=64), (1.07 / (2.0 * np.pi), 1.3 / (2.0 * np.pi))
    history = march_wear(
        scene("vibro_impact"), "resonance", 0.02, 0.0, 0.0, 0.0, sweep="down", between=between, settings=settings
    )
    assert history.outcome is Outcome.RESONANCE_LOST
    assert "resonance at 0.17" in history.message


@lru_cache
def two_resonances(word, sweep, high):
    """Unworn state of two masses on a weak spring, one of them on a slider."""
    spring, tie = 0.1 * (2.0 * math.pi * 215.0) ** 2, 2e3
    stiffness = [[1.6e5 + tie, -tie], [-tie, spring + tie]]
    parts = np.diag([0.1, 0.1]), np.diag([4.0, 4.0]), stiffness, [[-1, 0, -1]], 1e-4
    model = build_model(*parts, load_harmonic=[1.0, 1.0], normal_load=10.0, response=[[1.0, 1.0]])
    settings = SolverSettings(harmonics=3, samples=64)
    return march_wear(model, word, 20.0, 0.5, 0.0, 0.0, sweep=sweep, between=(180.0, high), settings=settings)


@pytest.mark.slow
@pytest.mark.parametrize("word", ["resonance", "peak"])
def test_of_two_in_the_range_the_first_that_the_sweep_meets_is_followed(word):
    up, down, alone = (two_resonances(word, *asked) for asked in (("up", 230.0), ("down", 230.0), ("up", 210.0)))
    first, second = (float(history.excitation_frequency[0]) for history in (up, down))
    assert first < 204.0
    assert second > 214.0
    assert up.outcome is Outcome.CONVERGED
    assert float(alone.excitation_frequency[0]) == first
