"""Histories that end at a wear: the count at which it is reached."""

from functools import lru_cache
from itertools import product

import numpy as np
import pytest
from scipy.optimize import brentq

from solver import march_wear
from solver.contact.wear_law import ARCHARDS_WORK
from solver.outcome import Outcome
from solver.settings import Scheme, SolverSettings, WearTarget
from studies import build_scene
from studies.scenes.den_hartog import DenHartogSlider, WearingSlider
from tests.solver.worn_slider import AREA, CYCLES, END, march

STEP = 4000.0
SCHEMES: tuple[Scheme, ...] = ("explicit", "implicit", "adaptive")


def march_until(target, scheme="adaptive"):
    return march(STEP, scheme, until=target)


@lru_cache
def whole_history(scheme="adaptive"):
    return march(STEP, scheme)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("quantity", ["wear_depth", "worn_volume"])
def test_the_count_is_that_at_which_the_history_has_the_wear(quantity, scheme):
    depth = 2.3e-5
    target = WearTarget("wear_depth", depth) if quantity == "wear_depth" else WearTarget("worn_volume", depth * AREA)
    found = march_until(target, scheme)
    assert found.outcome is Outcome.CONVERGED
    assert found.message == ""
    # the same history, read at that very count
    read = march(STEP, scheme, np.array([0.0, found.cycles_to_target, END]))
    assert read.wear_depth[1, 0] == pytest.approx(depth, rel=1e-9)
    # it ends there, and what there is of it is that of the whole one
    whole = whole_history(scheme)
    reached = np.isfinite(found.worn_volume)
    assert 0 < reached.sum() < CYCLES.size
    assert reached[found.cycles_to_target >= CYCLES].all()
    assert found.last_cycle >= found.cycles_to_target
    assert np.array_equal(found.wear_depth[reached], whole.wear_depth[reached])
    assert found.newton_iterations < whole.newton_iterations


def test_a_wear_that_is_not_reached_changes_nothing():
    found, whole = march_until(WearTarget("wear_depth", 1.0)), whole_history()
    assert np.isnan([found.cycles_to_target, found.cycles_to_target_error]).all()
    assert np.array_equal(found.wear_depth, whole.wear_depth)
    assert np.array_equal(found.worn_volume_error, whole.worn_volume_error)


def slider_at(frequency):
    return DenHartogSlider(0.1, 1.6e5, 10.0, 2 * np.pi * frequency)


def exact_count(frequency, depth):
    """Cycles until the slider is worn so deep."""
    pair = WearingSlider(slider_at(frequency), 0.5, 10.0, 1e5, AREA, ARCHARDS_WORK)
    return brentq(lambda n: pair.worn(1.1e-11 * np.array([0.0, n]))[0][1] - depth, 1.0, 1e6)


def exact_shift(frequency, depth):
    """Relative change of w_r, w_r^2 = w^2 + Re(x^H F) / (m |x|^2), from the first harmonics of motion and force."""
    slider, resonances = slider_at(frequency), []
    v, g = slider._factors
    for friction in (5.0, 0.5 * (10.0 - 1e5 * depth)):
        largest = float(slider.amplitude(np.array(friction)))
        motion = largest - 1j * friction / 1.6e5 * (g + 4.0 / np.pi * v)
        force = largest * 1.6e5 / v - 1j * friction * g / v
        work = float((np.conj(motion) * force).real)
        resonances.append(np.sqrt(slider.omega**2 + work / (0.1 * abs(motion) ** 2)))
    return abs(resonances[1] / resonances[0] - 1.0)


TARGETS = {
    "wear_depth": lambda _, depth: depth,
    "worn_volume": lambda _, depth: depth * AREA,
    "frequency_shift": exact_shift,
}


@pytest.mark.slow
@pytest.mark.parametrize("quantity", TARGETS)
@pytest.mark.parametrize(("frequency", "depth"), [(160.0, 3e-5), (190.0, 1.5e-5)])
def test_the_error_of_a_life_is_at_least_the_true_one_whatever_is_read(frequency, depth, quantity):
    model, exact = build_scene("sdof_slider"), exact_count(frequency, depth)
    target = WearTarget(quantity, TARGETS[quantity](frequency, depth))
    found = [
        march_wear(model, frequency, 10.0, 0.5, 1.1e-11, np.linspace(0.0, 4e5, n), until=target) for n in (2, 11, 101)
    ]
    for each in found:
        assert abs(each.cycles_to_target - exact) <= each.cycles_to_target_error < np.inf
        assert each.cycles_to_target == found[0].cycles_to_target
        assert each.cycles_to_target_error == pytest.approx(found[0].cycles_to_target_error, rel=1e-9)
    # all that is held of the first one is the unworn joint, which tells nothing of what has worn
    assert np.isnan(found[0].error_estimate)


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "quantity"), [*product(("explicit", "implicit"), TARGETS)])
def test_the_error_of_a_life_holds_that_of_euler_steps(scheme, quantity):
    target = WearTarget(quantity, TARGETS[quantity](160.0, 3e-5))
    asked = {"cycles": np.linspace(0.0, 4e5, 11), "scheme": scheme, "step": 4000.0, "until": target}
    found = march_wear(build_scene("sdof_slider"), 160.0, 10.0, 0.5, 1.1e-11, **asked)
    assert abs(found.cycles_to_target - exact_count(160.0, 3e-5)) <= found.cycles_to_target_error


@pytest.mark.slow
def test_a_life_is_known_better_with_a_smaller_rtol():
    settings = SolverSettings(harmonics=19, samples=256, rtol=1e-3)
    for quantity in ("wear_depth", "frequency_shift"):
        target = WearTarget(quantity, TARGETS[quantity](160.0, 3e-5))
        found = march_wear(
            build_scene("sdof_slider"), 160.0, 10.0, 0.5, 1.1e-11, [4e5], until=target, settings=settings
        )
        off = abs(found.cycles_to_target - exact_count(160.0, 3e-5))
        assert off <= found.cycles_to_target_error < 2e-2 * found.cycles_to_target
