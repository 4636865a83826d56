"""Histories until nothing wears any more: where they end, what they keep, and joints that wear without end."""

from functools import cache

import numpy as np
import pytest

from solver import march_wear as march_from_model
from solver.loading_history.start_states import follow_branch
from solver.outcome import Outcome
from solver.packing import Packed
from solver.settings import SolverSettings, ToTheEnd, WearTarget
from studies import build_scene
from tests.solver.models import march_wear
from tests.studies.half_space_twin import limit_depth

COARSE = SolverSettings(harmonics=3, samples=64)
STRIPS, PER_PRESSURE = 12, 1e-13


@cache
def unworn(scene="cylinder_on_flat", **size):
    """A body in partial slip."""
    model = build_scene(scene, **(size or {"strips": STRIPS}))
    ((_, start),) = follow_branch(model, 0.6, 1.0, np.array([20.0]), "ramp", COARSE)
    return model, start


def worn(cycles, scheme="adaptive", **more):
    model, start = unworn()
    return march_wear(model, 0.6, start, PER_PRESSURE, 1000.0, scheme, cycles, COARSE, **more)


def check_limit(model, found):
    """Which pairs slip decides the final depths; those between which pressure moves are at least 2e-4 exact."""
    limit = limit_depth(model, found.slip_range[-1] == 0.0)
    assert limit.max() > 0.0
    assert np.abs(found.wear_depth[-1] - limit).max() < 2e-4 * limit.max()


@pytest.mark.parametrize("scheme", ["adaptive", "implicit"])
def test_partial_slip_ends_in_the_limit_state_of_the_strips(scheme):
    found = worn(ToTheEnd(9), scheme)
    assert found.outcome is Outcome.CONVERGED
    check_limit(unworn()[0], found)
    assert found.wear_rate[-1] < 1e-4 * found.wear_rate.max()
    assert found.last_cycle == found.cycles[-1]
    # as far from one output to the next in volume and cycles together, each over the whole
    way = found.worn_volume / found.worn_volume[-1] + found.cycles / found.cycles[-1]
    assert np.diff(way) == pytest.approx(np.full(8, 0.25), rel=1e-6)
    assert found.cycles[0] == 0.0
    assert (np.diff(found.cycles) > 0.0).all()


@pytest.mark.slow
def test_a_sphere_ends_in_the_limit_state_of_its_patches():
    model, start = unworn("sphere_on_flat", patches=8)
    found = march_wear(model, 0.6, start, PER_PRESSURE, 1.0, "adaptive", ToTheEnd(2), COARSE)
    assert found.outcome is Outcome.CONVERGED
    check_limit(model, found)


@pytest.mark.parametrize("scheme", ["adaptive", "implicit"])
def test_a_march_that_goes_on_is_the_same_to_the_last_bit(scheme, monkeypatch):
    monkeypatch.setattr("solver.wear.integrate.ITERATIONS_PER_SAVE", 30)
    kept: list[Packed] = []
    whole = worn(ToTheEnd(9), scheme, keep=kept.append)
    assert kept
    again = worn(ToTheEnd(9), scheme, resume=kept[-1])
    for name in ("cycles", "wear_depth", "worn_volume_error", "response", "newton_iterations"):
        assert np.array_equal(getattr(again, name), getattr(whole, name)), name


def test_a_target_ends_it_at_its_count():
    half = WearTarget("worn_volume", 0.5 * float(worn(ToTheEnd(2)).worn_volume[-1]))
    found = worn(ToTheEnd(5), until=half)
    assert found.outcome is Outcome.CONVERGED
    assert found.cycles[-1] == found.cycles_to_target
    assert found.worn_volume[-1] == pytest.approx(half.value, rel=1e-6)


def slider(**parameters):
    model = build_scene("sdof_slider", **parameters)
    settings = SolverSettings(harmonics=3, samples=64)
    return march_from_model(model, 160.0, 10.0, 0.5, 1.1e-11, np.inf, settings=settings, outputs=4)


def test_a_spring_that_presses_wears_until_it_is_relaxed():
    found = slider()
    assert found.outcome is Outcome.CONVERGED
    assert found.wear_depth[-1, 0] == pytest.approx(10.0 / 1e5, rel=1e-3)


def test_a_constant_load_wears_without_end_at_the_rate_of_its_path():
    found = slider(normal_stiffness=0.0)
    assert found.outcome is Outcome.NO_FINAL_STATE
    assert not found.outcome.complete
    path = 2.0 * found.slip_range[-1, 0]
    assert found.wear_rate[-1] == pytest.approx(1.1e-11 * 10.0 * path, rel=1e-2)
    assert f"{found.wear_rate[-1]:.6g} m3 a cycle" in found.message
    assert np.isfinite(found.worn_volume).all()


@pytest.mark.slow
def test_gross_slip_of_a_pressed_body_has_no_end():
    # shallow enough to be worn flat: every strip bears, and all wear alike
    model = build_scene("cylinder_on_flat", strips=8, P=18.5e3, stroke=25e-6, half_width=0.15e-3)
    found = march_from_model(
        model, 20.0, 1.0, 0.9, 2.9e-14, np.inf, sweep="ramp", settings=SolverSettings(harmonics=5, samples=64)
    )
    assert found.outcome is Outcome.NO_FINAL_STATE
    steady = found.wear_rate[-1]
    assert found.wear_rate[found.worn_volume > 0.2 * found.worn_volume[-1]] == pytest.approx(steady, rel=0.02)
    # k_w times force times path, but for what the bodies bend
    assert steady == pytest.approx(2.9e-14 * 185.0 * 4.0 * 25e-6, rel=0.05)


@pytest.mark.parametrize(
    ("cycles", "more", "key"),
    [
        (np.inf, {"scheme": "explicit", "step": 10.0}, "scheme"),
        (1e5, {"scheme": "final"}, "scheme"),
        (np.inf, {"outputs": 1}, "outputs"),
    ],
)
def test_what_cannot_be_integrated_to_the_end_is_named(cycles, more, key):
    with pytest.raises(ValueError, match=f"^{key}"):
        march_from_model(build_scene("sdof_slider"), 160.0, 10.0, 0.5, 1e-11, cycles, **more)
