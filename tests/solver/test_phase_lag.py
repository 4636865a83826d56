"""States at a given phase lag and at the largest amplitude: derivatives, linear limits, exact motions."""

import math
from dataclasses import replace

import numpy as np
import pytest

from solver.continuation.phase_lag import (
    excitation_product,
    frequency_derivative,
    phase_lag,
    rise_of_response,
    solve_at_lag,
)
from solver.harmonic_balance.dlft import Balance
from solver.newton.run import Bordered, Run
from solver.settings import SolverSettings
from solver.structure.fourier import to_complex
from solver.structure.joint import build_case
from tests.solver.models import dovetail, scene

TIGHT = SolverSettings(harmonics=3, samples=64, tolerance=1e-11)
OMEGA = 2.0 * math.pi * 190.0


def slider_state(gain=0.0, damping=20.0, friction=0.5):
    """The slider at 190 Hz. gain: m/J, growth of the depth."""
    model = scene("sdof_slider", damping=damping)
    case = build_case(model, friction, OMEGA, TIGHT)
    joint = case.joint(OMEGA, 10.0)
    balance = Balance(joint, np.zeros((1, 2)), np.zeros(1), np.full(1, gain))
    start = balance.predict(np.zeros((1, 3, 7)), np.zeros((1, 3, 7)))
    found = Run(1e-11).solve(balance, start, 100)
    assert found.converged
    return case, Bordered(balance, found.evaluation, np.array([OMEGA]), np.zeros(1))


@pytest.mark.parametrize("gain", [0.0, 2e-3], ids=["fixed depth", "growing depth"])
def test_a_state_at_its_own_lag_has_its_own_frequency(gain):
    case, state = slider_state(gain)
    assert (state.at.wear_depth > 0.0) == (gain > 0.0)
    lag = phase_lag(state.balance.joint, state.at)
    other = replace(state.balance, joint=case.joint(0.99 * OMEGA, 10.0))
    found = solve_at_lag(case, other, state.at.predicted_h, lag, Run(case.settings.tolerance))
    assert found.values[0] == pytest.approx(OMEGA, rel=1e-9)
    np.testing.assert_allclose(found.at.wear_depth, state.at.wear_depth, rtol=1e-8)


@pytest.mark.parametrize("gain", [0.0, 2e-3], ids=["fixed depth", "growing depth"])
def test_the_change_of_the_lag_with_the_frequency_is_that_of_finite_differences(gain):
    """With growing depths this is exact only where the elimination of the depth sees the frequency."""
    case, state = slider_state(gain)
    lags, length = [], 1e-5 * OMEGA
    for omega in (OMEGA - length, OMEGA + length):
        balance = replace(state.balance, joint=case.joint(omega, 10.0))
        end = Run(1e-12).solve(balance, state.at.predicted_h)
        lags.append(phase_lag(balance.joint, end.evaluation))
    expected = (lags[1] - lags[0]) / (2.0 * length)
    lag = phase_lag(state.balance.joint, state.at)
    # a single step of Newton's method, whose derivative is that of the start
    loose = replace(case, settings=replace(TIGHT, tolerance=1e-9))
    near = solve_at_lag(loose, state.balance, state.at.predicted_h, lag + 1e-6, Run(loose.settings.tolerance), most=1)
    assert float(near.reduced[0, 0]) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("word", ["slider", "dovetail"])
def test_derivatives_with_the_frequency_are_those_of_finite_differences(word):
    if word == "slider":
        case, state = slider_state()
    else:
        case = build_case(dovetail(3), 0.5, OMEGA, TIGHT)
        joint = case.joint(OMEGA, 0.5)
        predicted = np.random.default_rng(0).normal(size=(joint.component_index.size, 7)) * 10.0
        predicted[joint.component_index % 3 == 0, 0] += 100.0
        balance = Balance(joint, np.zeros((16, 2)), np.zeros(16))
        state = Bordered(balance, balance.evaluate(predicted), np.array([OMEGA]), np.zeros(1))
    found, length = frequency_derivative(state.balance, state.at), 1e-5 * OMEGA
    ends = []
    for omega in (OMEGA - length, OMEGA + length):
        balance = replace(state.balance, joint=case.joint(omega, state.balance.joint.excitation_amplitude))
        at = balance.evaluate(state.at.predicted_h)
        ends.append((at.residual, excitation_product(balance.joint, at.displacement_h)))
    residual, product = ((ends[1][place] - ends[0][place]) / (2.0 * length) for place in (0, 1))
    assert np.linalg.norm(found.force - residual) < 1e-5 * np.linalg.norm(residual)
    assert abs(found.product - product) < 1e-5 * abs(product)


def test_a_linear_oscillator_has_its_natural_frequency_and_its_peak_below():
    damping = 100.0  # N s/m: 40 % of the critical damping
    natural, ratio = math.sqrt(1.6e5 / 0.1), damping / (2.0 * math.sqrt(1.6e5 * 0.1))
    case, state = slider_state(damping=damping, friction=0.0)

    found = solve_at_lag(case, state.balance, state.at.predicted_h, 0.5 * math.pi, Run(case.settings.tolerance))
    assert found.values[0] == pytest.approx(natural, rel=1e-10)
    rise, turn = rise_of_response(found, Run(1e-12), 1e-2)
    # at the natural frequency the amplitude falls as 1 / omega, and the lag rises by 1 / (zeta omega)
    assert rise * natural == pytest.approx(-1.0, rel=1e-5)
    assert turn * natural == pytest.approx(1.0 / ratio, rel=1e-5)
    peak = replace(found.balance, joint=case.joint(natural * math.sqrt(1.0 - 2.0 * ratio**2), 10.0))
    end = Run(1e-12).solve(peak, found.at.predicted_h)
    at_peak, turn = rise_of_response(Bordered(peak, end.evaluation, np.zeros(1), np.zeros(1)), Run(1e-12), 1e-2)
    assert abs(at_peak) < 1e-5 * turn


def test_the_rise_of_the_response_is_that_of_finite_differences():
    case, state = slider_state()
    rise, _ = rise_of_response(state, Run(1e-12), 1e-2)
    length, sizes = 1e-5 * OMEGA, []
    for omega in (OMEGA - length, OMEGA + length):
        balance = replace(state.balance, joint=case.joint(omega, 10.0))
        at = Run(1e-12).solve(balance, state.at.predicted_h).evaluation
        response = balance.joint.structure.response_h(balance.joint.to_relative(at.displacement_h))
        sizes.append(abs(to_complex(response)[0, 0]))
    assert rise == pytest.approx(math.log(sizes[1] / sizes[0]) / (2.0 * length), rel=1e-4)
