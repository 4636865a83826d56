"""Nonlinear modes of the virtual friction beam: a plain harmonic balance, linear limits and published values."""

import numpy as np
import pytest
import scipy.linalg

from solver import backbone
from solver.outcome import Outcome
from tests.friction_beam import SPRING, friction_beam, matrices, plain_mode


@pytest.mark.slow
def test_the_first_mode_is_that_of_a_plain_harmonic_balance():
    """Near log10 a = -5.15 the 15th harmonic meets the third mode: with 13 harmonics the frequency is 0.02 Hz off."""
    amplitudes = 10.0 ** np.linspace(-5.45, -4.1, 28)
    frequency, damping = plain_mode(amplitudes)
    chosen = [0, 3, 6, 9, 18, 27]
    mode = backbone(friction_beam(), amplitudes[chosen], 1.0)
    assert set(mode.outcome) == {Outcome.CONVERGED}
    assert mode.harmonics_used[2] > 13
    # the samples of the plain balance give both to 5e-5
    assert (abs(mode.frequency - frequency[chosen]) < mode.frequency_error + 5e-5 * frequency[chosen]).all()
    assert (abs(mode.damping_ratio - damping[chosen]) < mode.damping_error + 5e-5 * damping[chosen]).all()
    assert (mode.frequency_error < 1e-3 * mode.frequency).all()
    assert (mode.damping_error < 5e-3 * mode.damping_ratio).all()


@pytest.mark.slow
def test_stuck_and_slipping_beam_and_the_published_damping():
    """Published: damping up to 15 % where the frequency falls by 35 %; the place of the element is not known here."""
    mass, _, stiffness, place = matrices(28, 15)
    stuck = stiffness.copy()
    stuck[place, place] += SPRING
    ends = [np.sqrt(scipy.linalg.eigh(part, mass, eigvals_only=True)[0]) / (2.0 * np.pi) for part in (stuck, stiffness)]
    mode = backbone(friction_beam(n_elements=28, at=15), 10.0 ** np.array([-6.0, -5.0, -4.9, -3.0]), 1.0)
    assert mode.frequency[0] == pytest.approx(ends[0], rel=1e-9)
    assert mode.damping_ratio[0] == pytest.approx(0.008, rel=1e-9)
    assert mode.frequency[-1] == pytest.approx(ends[1], rel=1e-3)
    assert 1.0 - ends[1] / ends[0] == pytest.approx(0.35, abs=0.015)
    assert mode.damping_ratio.max() == pytest.approx(0.16, abs=0.01)
