"""Error-controlled steps on the slow time scale against the differential equation and against fixed steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from solver.outcome import Outcome
from solver.results.history import WearHistory
from solver.wear import control
from tests.solver.models import branch_states, march_wear, scene
from tests.solver.test_march import AREA, COARSE, CYCLES, END, FRICTION, OMEGA, WEAR, march, slider_start

FINE_OUTPUT = np.linspace(0.0, END, 101)


def adaptive_march(rtol: float, wear: float = WEAR, cycles: np.ndarray = FINE_OUTPUT) -> WearHistory:
    settings = replace(COARSE, rtol=rtol)
    model, start = slider_start(COARSE)
    return march_wear(model, FRICTION, start, wear, 1.0, "adaptive", cycles, settings)


def exact_depths(cycles: np.ndarray) -> np.ndarray:
    """Depths (n,), m: the wear rate as a function of the depth, integrated to round-off."""
    fine = march(250.0, "implicit", np.linspace(0.0, 1.25 * END, 401))
    rate = CubicSpline(fine.wear_depth[:, 0], fine.wear_rate / AREA)
    found = solve_ivp(lambda _, w: rate(w), (0.0, END), [0.0], "DOP853", cycles, rtol=1e-11, atol=1e-20)
    return np.asarray(found.y[0])


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-1, 1e-2, 1e-3, 1e-4])
def test_the_worn_volume_is_as_exact_as_asked_for(rtol: float) -> None:
    history = adaptive_march(rtol)
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


@pytest.mark.slow
def test_steps_are_of_second_order() -> None:
    rtols = np.array([1e-3, 1e-4, 1e-5])
    begin = slider_start(COARSE)[1].newton_iterations
    iterations = [adaptive_march(rtol, cycles=CYCLES).newton_iterations - begin for rtol in rtols]
    # as many steps as rtol^(-1/2), with fewer iterations the shorter they are; a method of first order takes rtol^-1
    slope = np.polyfit(np.log(rtols), np.log(iterations), 1)[0]
    assert -0.5 < slope < -0.3


def test_a_step_solves_its_own_equation(monkeypatch: pytest.MonkeyPatch) -> None:
    # no error is refused, so that the steps are known: the first one Euler's, the second one by the formula with w
    options = replace(control.WEAR, step_error_fraction=1e9, first_step=1e-2, first_depth=1e9)
    monkeypatch.setattr(control, "WEAR", options)
    first = 1e-2 * adaptive_march(1.0).step_limit
    w = options.largest_step_ratio
    history = adaptive_march(1.0, cycles=np.array([0.0, first, (1 + w) * first, END]))
    depth, rate = history.wear_depth[:, 0], history.wear_rate / AREA
    assert depth[1] == pytest.approx(first * rate[1], rel=1e-9)
    expected = depth[1] + w**2 / (1 + 2 * w) * depth[1] + (1 + w) / (1 + 2 * w) * w * first * rate[2]
    assert depth[2] == pytest.approx(expected, rel=1e-9)


def test_the_end_is_not_seen_by_the_steps() -> None:
    whole = adaptive_march(1e-2)
    part = adaptive_march(1e-2, cycles=FINE_OUTPUT[:31])
    assert part.newton_iterations < whole.newton_iterations
    assert part.wear_depth == pytest.approx(whole.wear_depth[:31], rel=1e-12)
    assert part.wear_rate == pytest.approx(whole.wear_rate[:31], rel=1e-12)


def test_wear_never_falls_between_the_steps() -> None:
    for rtol in (1.0, 1e-2):
        assert (np.diff(adaptive_march(rtol).wear_depth, axis=0) > 0.0).all()


def test_only_the_product_of_wear_coefficient_and_cycles_matters() -> None:
    once = adaptive_march(1e-2)
    other = adaptive_march(1e-2, 3.0 * WEAR, FINE_OUTPUT / 3.0)
    assert other.wear_depth == pytest.approx(once.wear_depth, rel=1e-9, abs=1e-20)
    assert other.wear_rate == pytest.approx(3.0 * once.wear_rate, rel=1e-9)


def test_nothing_is_marched_where_nothing_slips() -> None:
    model = scene("sdof_slider", 5)
    (start,) = branch_states(model, FRICTION, 1e-3, [OMEGA], COARSE)
    history = march_wear(model, FRICTION, start, WEAR, 1.0, "adaptive", CYCLES, COARSE)
    assert history.outcome is Outcome.CONVERGED
    assert history.newton_iterations == start.newton_iterations
    assert not history.wear_depth.any()
