"""Wear histories of the slider under a spring against its differential equation; a joint that is worn before."""

from functools import lru_cache

import numpy as np
import pytest

from solver import frequency_response
from solver import march_wear as march_model
from solver.contact.wear_law import WearLaw, WearTable
from solver.outcome import Outcome
from solver.results.history import StartState
from solver.results.state_report import LOOP_PHASES
from solver.settings import Scheme, SolverSettings, ToTheEnd, first_resolution
from tests.solver.models import branch_states, march_wear, random_model, scene
from tests.solver.worn_slider import (
    AREA,
    COARSE,
    CYCLES,
    END,
    FRICTION,
    OMEGA,
    WEAR,
    exact_depths,
    march,
    slider_start,
)

STEPS = (8000.0, 4000.0, 2000.0, 1000.0)
GIVEN: tuple[Scheme, ...] = ("explicit", "implicit")
SCHEMES: tuple[Scheme, ...] = (*GIVEN, "adaptive")
FEW = SolverSettings(harmonics=3, samples=128)
FINE_OUTPUT = np.linspace(0.0, END, 101)


def adaptive(rtol, wear=WEAR, cycles=FINE_OUTPUT):
    model, start = slider_start(COARSE)
    settings = SolverSettings(COARSE.harmonics, COARSE.samples, COARSE.tolerance, rtol)
    return march_wear(model, FRICTION, start, wear, 1.0, "adaptive", cycles, settings)


@lru_cache
def final_depth(step, scheme):
    history = march(step, scheme, np.array([0.0, END]))
    assert history.outcome is Outcome.CONVERGED
    return float(history.wear_depth[-1, 0])


@pytest.mark.slow
def test_the_error_of_the_depth_is_of_first_order_and_its_sign_that_of_the_scheme():
    exact = exact_depths(CYCLES)[-1]
    explicit, implicit = (np.array([final_depth(step, scheme) for step in STEPS]) - exact for scheme in GIVEN)
    for errors in (explicit, -implicit, explicit - implicit):
        assert (errors > 0).all()
        assert np.polyfit(np.log(STEPS), np.log(errors), 1)[0] == pytest.approx(1.0, abs=0.1)
        assert errors[-2] / errors[-1] == pytest.approx(2.0, rel=0.1, abs=0.0)
    # both have the same limit
    for errors in (explicit, implicit):
        assert abs(2 * errors[-1] - errors[-2]) < 1e-4 * exact


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-2, 1e-4])
def test_the_worn_volume_is_as_exact_as_asked_for(rtol):
    history = adaptive(rtol)
    assert history.outcome is Outcome.CONVERGED
    exact = exact_depths(FINE_OUTPUT)
    error = abs(history.wear_depth[-1, 0] - exact[-1]) / exact[-1]
    assert error < 0.5 * rtol
    # the estimate holds the error of the harmonics as well, which is not in `exact`
    assert history.error_estimate > error
    # and so is everything between the steps
    assert np.abs(history.wear_depth[:, 0] - exact).max() < rtol * exact[-1]
    rates = np.gradient(exact, FINE_OUTPUT, edge_order=2)
    assert np.abs(history.wear_rate / AREA - rates).max() < max(2.0 * rtol, 2e-3) * rates.max()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_state_without_slip_wears_exactly_nothing(scheme):
    model = random_model(1, ("3d", "constant_load"))
    settings = SolverSettings(3, 64)
    (start,) = branch_states(model, 100.0, 1.0, [300.0], settings)
    history = march_wear(model, 100.0, start, 1e-6, 1e6, scheme, np.array([0.0, 1e8, 1e9]), settings)
    assert history.outcome is Outcome.CONVERGED
    assert not history.slip_range.any()
    for name in ("wear_depth", "wear_rate", "worn_volume"):
        assert not getattr(history, name).any(), name
    assert np.array_equal(history.response, np.repeat(history.response[:1], 3, axis=0))


def test_a_start_that_failed_is_a_history_of_nan_with_its_outcome():
    failed = StartState(
        Outcome.SINGULAR, None, OMEGA, first_resolution(COARSE), np.inf, np.inf, newton_iterations=17, run_time=0.25
    )
    for cycles in (CYCLES, ToTheEnd(3)):
        model = scene("sdof_slider", 5)
        history = march_wear(model, FRICTION, failed, WEAR, 1000.0, "implicit", cycles, COARSE, loops=(0,))
        n = history.cycles.size
        shapes = {"wear_depth": (n, 1), "slip_range": (n, 1), "response": (n, 1), "loop_force": (n, 1, LOOP_PHASES, 3)}
        for name, shape in (shapes | dict.fromkeys(("wear_rate", "worn_volume", "worn_volume_error"), (n,))).items():
            assert getattr(history, name).shape == shape
            assert np.isnan(getattr(history, name)).all(), name
        assert not history.harmonics_used.any()
        assert np.isnan([history.error_estimate, history.jump_cycle, history.last_cycle]).all()
        known = history.outcome, history.newton_iterations, history.run_time
        assert known == (Outcome.SINGULAR, 17, 0.25)


def test_only_the_product_of_wear_coefficient_and_cycles_matters():
    """To adaptive steps; `test_properties` has it of steps of a given length."""
    slow = march(8000.0, "adaptive")
    fast = march(800.0, "adaptive", CYCLES / 10, wear=10 * WEAR)
    for name in ("wear_depth", "worn_volume", "mean_pressure", "slip_range", "response", "response_peak"):
        one, other = getattr(slow, name), getattr(fast, name)
        assert np.abs(one - other).max() <= 1e-9 * np.abs(one).max(), name
    assert fast.wear_rate == pytest.approx(10 * slow.wear_rate, rel=1e-9, abs=0.0)


def test_a_response_at_a_depth_is_that_of_less_normal_force():
    """The spring of the slider presses by 10 N less 1e5 N/m times the depth."""
    worn = frequency_response(scene("sdof_slider"), 150.0, 10.0, 0.5, settings=FEW, wear_depth=[4e-5])
    less = frequency_response(scene("sdof_slider", normal_load=6.0), 150.0, 10.0, 0.5, settings=FEW)
    np.testing.assert_allclose(worn.response, less.response, rtol=1e-7)
    assert set(worn.outcome) == {Outcome.CONVERGED}


def test_a_march_goes_on_from_a_depth():
    model = scene("sdof_slider")
    whole = march_model(model, 160.0, 10.0, 0.5, WEAR, [0.0, 2e4, 4e4], settings=FEW)
    rest = march_model(model, 160.0, 10.0, 0.5, WEAR, [2e4], settings=FEW, wear_depth=whole.wear_depth[1])
    assert rest.outcome is Outcome.CONVERGED
    depth = whole.wear_depth[1, 0] + rest.wear_depth[-1, 0]
    error = whole.wear_depth_error[-1, 0] + rest.wear_depth_error[-1, 0]
    assert depth == pytest.approx(whole.wear_depth[-1, 0], abs=error)
    assert error < 1e-2 * depth


def test_a_law_that_depends_on_the_depth_is_refused():
    law = WearLaw("table", table=WearTable((0.0, 1e6), (0.0, 1e-5), ((1.0, 1.0), (1.0, 1.0))))
    with pytest.raises(ValueError, match="wear_depth: give another law"):
        march_model(scene("sdof_slider"), 160.0, 10.0, 0.5, WEAR, [4e4], law=law, wear_depth=0.0)
    with pytest.raises(ValueError, match="wear_depth: give a depth, m, for each of 1 pairs, not 2"):
        march_model(scene("sdof_slider"), 160.0, 10.0, 0.5, WEAR, [4e4], wear_depth=[0.0, 0.0])
