"""Automatic harmonics and samples against exact motions, and the convergence of the marched mass with harmonics."""

import numpy as np
import pytest

from solver.settings import SolverSettings
from tests.solver.exact import errors_of, slider, states, two_masses

STATES = states()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "rtol"), [*((name, 1e-3) for name in STATES), *((name, 1e-2) for name in list(STATES)[::4])]
)
def test_an_automatic_state_is_as_accurate_as_was_asked_for(name, rtol):
    exact = STATES[name]()
    errors = errors_of(exact, SolverSettings(rtol=rtol))
    assert errors.accurate
    assert errors.amplitude < rtol
    assert errors.response < rtol
    assert errors.wear < rtol
    assert errors.estimate.largest <= rtol
    assert errors.safe, errors
    if "open" not in name:
        # a test of a state that is trivial would say nothing
        assert errors.response > 1e-7


def test_a_smaller_tolerance_takes_more_harmonics_or_samples():
    for exact in (slider(10.0, 0.6), two_masses(0.4)):
        coarse, fine = (errors_of(exact, SolverSettings(rtol=rtol)) for rtol in (1e-2, 1e-3))
        assert fine.orders[-1] > coarse.orders[-1]
        assert fine.samples >= coarse.samples
        assert fine.response < coarse.response


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "harmonics"), [("slider 10.0 N 0.9", [1, 3, 5, 9, 15]), ("two masses 0.5", [3, 5, 9, 15])]
)
def test_states_converge_with_the_square_of_the_harmonics_at_least(name, harmonics):
    exact = STATES[name]()
    found = [errors_of(exact, SolverSettings(harmonics=n, samples=8192)) for n in harmonics]
    for errors in ([each.response for each in found], [each.wear for each in found]):
        assert np.polyfit(np.log(harmonics), np.log(errors), 1)[0] < -2.0
        assert errors == sorted(errors, reverse=True)
    assert found[0].response < 0.1
