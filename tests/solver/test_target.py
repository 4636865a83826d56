"""Histories that end at a wear: the count at which it is reached."""

from functools import lru_cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from solver.outcome import Outcome
from solver.settings import Scheme, WearTarget
from tests.solver.worn_slider import AREA, CYCLES, END, march, rate_of_depth

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


@pytest.mark.slow
def test_the_count_is_that_of_the_differential_equation():
    rate = rate_of_depth()
    fine_depths = np.linspace(0.0, rate.x[-1], 4001)
    # cycles over depth: the integral of 1 / rate
    spent = CubicSpline(fine_depths, 1.0 / rate(fine_depths)).antiderivative()
    target = 3.1e-5
    assert march_until(WearTarget("wear_depth", target)).cycles_to_target == pytest.approx(spent(target), rel=1e-2)
    by_depth = brentq(lambda w: spent(w) - 0.5 * END, 0.0, rate.x[-1])
    assert march_until(WearTarget("wear_depth", by_depth)).cycles_to_target == pytest.approx(0.5 * END, rel=1e-2)


def test_a_wear_that_is_not_reached_changes_nothing():
    far, none = march_until(WearTarget("wear_depth", 1.0)), march_until(WearTarget("worn_volume", 1e3))
    whole = whole_history()
    for found in (far, none):
        assert np.isnan(found.cycles_to_target)
        assert np.array_equal(found.wear_depth, whole.wear_depth)
        assert np.array_equal(found.worn_volume_error, whole.worn_volume_error)
