"""Single nonlinear mode theory against the linear oscillator and the full forced response."""

from dataclasses import replace

import numpy as np
import pytest

from solver import backbone, frequency_response, modal_response
from tests.solver.test_modes import MASS, SIZE, STIFFNESS, foot, slider


def test_without_slip_the_curve_is_that_of_a_linear_oscillator():
    model = foot()
    mode = backbone(model, np.geomspace(1e-9, 1e-6, 4), 0.5)
    force = 0.02  # N
    curve = modal_response(model, mode, force)
    omega, zeta = 2.0 * np.pi * mode.frequency[0], mode.damping_ratio[0]
    shape = mode.shape[0] / mode.amplitude[0]
    excited = 2.0 * np.pi * curve.frequency
    participation = np.vdot(shape, model.linear[0].load_harmonic)
    expected = shape[2] * participation * force / (omega**2 - excited**2 + 2j * zeta * omega * excited)
    np.testing.assert_allclose(curve.response[:, 0], expected, rtol=1e-6)
    # other modes of the full response are far away
    near = np.argmax(np.abs(curve.response[:, 0]))
    full = frequency_response(model, curve.frequency[[near]], force, 0.5)
    np.testing.assert_allclose(curve.response[near], full.response[0], rtol=1e-3)


@pytest.mark.slow
def test_with_slip_the_curve_is_near_the_full_response():
    """A mass on a rigid slider: both sides of the resonance, where friction damps more than the damper."""
    model = slider(damping=2.0)
    mode = backbone(model, np.geomspace(8.0, 25.0, 6) * SIZE * np.sqrt(MASS), 0.5, sweep="down")
    curve = modal_response(model, mode, 8.0)
    assert np.isfinite(curve.frequency).all()
    top = int(np.argmax(curve.amplitude))
    assert curve.damping_ratio[top] > 3.0 * 2.0 / (2.0 * np.sqrt(STIFFNESS * MASS))
    size = np.abs(curve.response[:, 0])
    below, above = (int(np.argmin(np.abs(part - 0.9 * size[top]))) for part in (size[:top], size[top:]))
    rows = [below, top, top + above]
    full = frequency_response(model, curve.frequency[rows], 8.0, 0.5)
    np.testing.assert_allclose(size[rows], np.abs(full.response[:, 0]), rtol=0.04)


def test_a_resonance_beyond_the_mode_leaves_a_gap():
    model = foot()
    mode = backbone(model, [1e-9, 1e-8], 0.5)
    curve = modal_response(model, mode, 1.0)
    assert np.count_nonzero(np.isnan(curve.frequency)) == 1


def test_wrong_arguments_are_named():
    model = foot()
    mode = backbone(model, [1e-9, 1e-8], 0.5)
    for wrong in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="excitation_amplitude: give a finite number above 0"):
            modal_response(model, mode, wrong)
    with pytest.raises(ValueError, match="a state at two amplitudes"):
        modal_response(model, replace(mode, frequency=np.full(2, np.nan)), 1.0)
    with pytest.raises(ValueError, match="a mode of this model"):
        modal_response(model, replace(mode, shape=mode.shape[:, :2]), 1.0)
