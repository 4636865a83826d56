"""Automatic harmonics and samples against exact motions, and the convergence of the marched mass with harmonics."""

from __future__ import annotations

import numpy as np
import pytest

from solver.settings import SolverSettings
from tests.references import den_hartog_amplitude
from tests.solver.exact import NATURAL, errors_of, slider, states, two_masses

STATES = states()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "rtol"), [*((name, 1e-3) for name in STATES), *((name, 1e-2) for name in list(STATES)[::4])]
)
def test_an_automatic_state_is_as_accurate_as_was_asked_for(name: str, rtol: float) -> None:
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


def test_a_smaller_tolerance_takes_more_harmonics_or_samples() -> None:
    for exact in (slider(10.0, 0.6), two_masses(0.4)):
        coarse, fine = (errors_of(exact, SolverSettings(rtol=rtol)) for rtol in (1e-2, 1e-3))
        assert fine.orders[-1] > coarse.orders[-1]
        assert fine.samples >= coarse.samples
        assert fine.response < coarse.response


def test_a_slider_needs_odd_harmonics_alone_and_an_impact_needs_all() -> None:
    assert all(order % 2 for order in errors_of(slider(10.0, 0.6), SolverSettings()).orders)
    assert errors_of(STATES["vibro-impact 0.95 upper"](), SolverSettings()).orders[:3] == (1, 2, 3)


def test_den_hartogs_slider_is_the_exact_one() -> None:
    # his form is that of the largest displacement; without stops the first harmonic follows from the energy
    exact = slider(10.0, 0.9)
    amplitude = den_hartog_amplitude(0.1, 1.6e5, 10.0, 5.0, exact.omega)
    assert exact.slip_work == pytest.approx(10.0 * 4.0 * amplitude, rel=1e-8)


@pytest.mark.slow
def test_the_slider_converges_with_the_square_of_the_harmonics_at_least() -> None:
    harmonics = np.array([1, 3, 5, 9, 15])
    exact = slider(10.0, 0.9)
    assert exact.omega == pytest.approx(0.9 * NATURAL)
    found = [errors_of(exact, SolverSettings(harmonics=int(n), samples=8192)) for n in harmonics]
    for errors in ([each.response for each in found], [each.wear for each in found]):
        assert np.polyfit(np.log(harmonics), np.log(errors), 1)[0] < -2.0
        assert errors == sorted(errors, reverse=True)
    assert found[0].response < 0.1


@pytest.mark.slow
@pytest.mark.parametrize(("force", "ratio"), [(10.0, 0.9), (10.0, 0.6)])
def test_the_slider_converges_with_the_square_of_the_samples(force: float, ratio: float) -> None:
    # what is left at 69 harmonics is of the order 1e-6
    exact = slider(force, ratio)
    samples = np.array([256, 512, 1024, 2048])
    found = [errors_of(exact, SolverSettings(harmonics=69, samples=int(n))) for n in samples]
    for errors in ([each.response for each in found], [each.wear for each in found]):
        # events fall anywhere in their steps, so the errors scatter about their order
        assert (np.array(errors) < 12.0 / samples**2 + 2e-6).all()
