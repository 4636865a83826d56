"""The wear law: rate, growth and its gain, and the slip work that it takes."""

from __future__ import annotations

import numpy as np
import pytest

from solver.contact.archard import (
    ARCHARD,
    slip_work_rate,
    slip_work_slopes,
    volume_rate,
    wear_gain,
    wear_growth,
    wear_growth_tangent,
    wear_rate,
)
from solver.settings import SolverSettings
from tests.solver.models import random_balance, random_model

WEAR, AREA, WORK = 1.1e-11, np.array([1e-6, 2e-6, 4e-6]), np.array([0.1, 0.0, 0.3])


def test_the_rate_is_the_wear_coefficient_times_slip_work_over_the_area() -> None:
    assert wear_rate(WEAR, AREA, WORK) == pytest.approx(WEAR * WORK / AREA, rel=1e-15)
    assert volume_rate(WEAR, WORK.sum()) == pytest.approx(wear_rate(WEAR, AREA, WORK) @ AREA, rel=1e-15)


def test_a_step_grows_by_its_cycles_times_the_rate() -> None:
    gain = wear_gain(WEAR, AREA, 250.0)
    assert wear_growth(gain, WORK) == pytest.approx(250.0 * wear_rate(WEAR, AREA, WORK), rel=1e-15)


def test_the_gain_is_the_derivative_of_the_growth() -> None:
    gain = wear_gain(WEAR, AREA, 250.0)
    tangent = np.random.default_rng(0).normal(size=(3, 5))
    step = np.random.default_rng(1).normal(size=5)
    ahead, behind = (wear_growth(gain, WORK + sign * 1e-3 * tangent @ step) for sign in (1.0, -1.0))
    assert wear_growth_tangent(gain, tangent) @ step == pytest.approx((ahead - behind) / 2e-3, rel=1e-9)


def test_the_slopes_are_the_derivatives_of_the_slip_work() -> None:
    normal, speed, step = 12.0, 0.3, 1e-4
    by_normal = (slip_work_rate(normal + step, speed) - slip_work_rate(normal - step, speed)) / (2 * step)
    by_speed = (slip_work_rate(normal, speed + step) - slip_work_rate(normal, speed - step)) / (2 * step)
    assert slip_work_slopes(normal, speed) == pytest.approx((by_normal, by_speed), rel=1e-9)


def test_the_rate_is_proportional_to_the_wear_coefficient_as_the_law_says() -> None:
    assert ARCHARD.proportional
    for times in (0.0, 3.0):
        assert wear_rate(times * WEAR, AREA, WORK) == pytest.approx(times * wear_rate(WEAR, AREA, WORK), rel=1e-15)


def test_slip_work_times_friction_is_what_friction_dissipates() -> None:
    # the trapezoidal rule takes the normal force of both ends of an increment, the return map that of its end
    balance, predicted = random_balance(random_model(1), SolverSettings(3, 2048), 1, wear=False)
    at = balance.evaluate(predicted)
    slip = np.diff(at.state_t, axis=2) / balance.joint.penalty.tangential[:, None, None]
    dissipated = (at.force_t[:, 1:] * slip).sum(axis=(1, 2))
    assert dissipated.max() > 0.0
    assert dissipated == pytest.approx(balance.joint.friction_coefficient * at.slip_work, rel=5e-3)
