"""The allowable amplitude against the exact slider, and against histories made on purpose."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from solver import allowable, march_wear
from solver.allowable import BEYOND, Tried, allowable_amplitude, find_allowable
from solver.outcome import Outcome
from solver.settings import SolverSettings, WearTarget
from tests.references import slider_amplitude, slider_wear_depth
from tests.solver.models import scene
from tests.solver.worn_slider import END, FRICTION, OMEGA, WEAR

DEPTH = WearTarget("wear_depth", 1e-6)
RTOL = 1e-2


def exact_depth(force):
    def amplitude(limit):
        return slider_amplitude(0.1, 0.0, 1.6e5, force, limit, OMEGA)

    return float(slider_wear_depth(np.array([0.0, END]), amplitude, wear=WEAR)[-1])


def of(wear):
    """Histories (1 cycle) whose depth over the target is a function of the amplitude; NaN fails."""

    def history_at(amplitude):
        depth = wear(amplitude) * DEPTH.value
        failed = math.isnan(depth)
        return SimpleNamespace(
            cycles=np.array([0.0, 1.0]),
            cycles_to_target=BEYOND / wear(amplitude) if wear(amplitude) >= BEYOND else math.nan,
            cycles_to_target_error=1e-3,
            wear_depth=np.array([[0.0], [depth]]),
            wear_depth_error=np.array([[0.0], [1e-3 * depth]]),
            outcome=Outcome.MARCH_FAILED if failed else Outcome.CONVERGED,
            message="it failed" if failed else "",
        )

    return history_at


@pytest.mark.slow
def test_the_allowable_of_the_slider_is_exact():
    model, asked = scene("sdof_slider"), (FRICTION, WEAR, END, WearTarget("wear_depth", 5e-5))
    found = allowable_amplitude(model, OMEGA / (2.0 * np.pi), *asked, settings=SolverSettings(rtol=RTOL))
    exact = brentq(lambda force: exact_depth(force) - 5e-5, 8.0, 40.0)
    assert found.outcome is Outcome.CONVERGED
    assert abs(found.amplitude - exact) < found.error < RTOL * exact
    again = march_wear(model, OMEGA / (2.0 * np.pi), found.amplitude, *asked[:3])
    assert again.wear_depth[-1, 0] == pytest.approx(5e-5, rel=2.0 * RTOL)


@pytest.mark.parametrize("power", [0.7, 2.0, 6.0])
@pytest.mark.parametrize("onset", [3e-5, 0.3, 2.0, 5e4])
def test_a_power_of_the_amplitude(onset, power):
    """Nothing wears below an onset, as with friction."""
    wear = of(lambda amplitude: 3.0 * max(amplitude / onset - 1.0, 0.0) ** power)
    found, exact = find_allowable(wear, DEPTH, RTOL), onset * (1.0 + 3.0 ** (-1.0 / power))
    assert found.outcome is Outcome.CONVERGED
    assert abs(found.amplitude - exact) < found.error < RTOL * exact
    assert len(found.tried) < 25


def test_a_jump_gives_the_amplitude_before_it():
    found = find_allowable(of(lambda amplitude: 0.5 * amplitude if amplitude < 1.7 else 3.0), DEPTH, RTOL)
    assert found.outcome is Outcome.CONVERGED
    assert 1.7 - found.error <= found.amplitude < 1.7
    assert found.error < RTOL
    assert "from 0.8" in found.message
    assert "to 3 times" in found.message
    assert found.history.wear_depth[-1, 0] < DEPTH.value


def test_where_the_wear_falls_again_the_first_amplitude_counts():
    """A history below the others wears more, by round-off for one: the error is no negative width."""
    found = find_allowable(of(lambda amplitude: amplitude / 1.7), DEPTH, RTOL, known=(Tried(1.5, 1.02, 0.01),))
    assert found.amplitude < 1.5
    assert found.amplitude + found.error >= 1.5
    assert found.outcome is Outcome.INACCURATE


def test_an_error_of_the_wear_is_one_of_the_amplitude(monkeypatch):
    """Where the wear grows slowly, the amplitude is known less than the wear."""
    monkeypatch.setattr(allowable, "SHARE_OF_RTOL", 1e-3)
    found = find_allowable(of(lambda amplitude: (amplitude / 3.0) ** 0.05), DEPTH, RTOL)
    assert found.error == pytest.approx(3.0 * 1e-3 / 0.05, rel=0.1)
    assert found.outcome is Outcome.INACCURATE


@pytest.mark.parametrize(
    ("wear", "outcome", "amplitude"),
    [
        (lambda _: 0.5, Outcome.INACCURATE, math.inf),
        (lambda _: math.nan, Outcome.MARCH_FAILED, math.nan),
        (lambda amplitude: 0.1 if amplitude < 5.0 else math.nan, Outcome.MARCH_FAILED, math.nan),
        (lambda amplitude: math.nan if 1.5 < amplitude < 2.5 else amplitude / 2.0, Outcome.MARCH_FAILED, math.nan),
        (lambda amplitude: math.nan if amplitude > 5.0 else amplitude / 4.5, Outcome.CONVERGED, 4.5),
    ],
)
def test_what_cannot_be_found(wear, outcome, amplitude):
    found = find_allowable(of(wear), DEPTH, RTOL)
    assert found.outcome is outcome
    assert bool(found.message) == (outcome is not Outcome.CONVERGED)
    np.testing.assert_allclose(found.amplitude, amplitude, rtol=RTOL)


def test_an_interrupted_search_goes_on_to_the_last_bit():
    wear, kept = of(lambda amplitude: max(amplitude - 0.3, 0.0) ** 2), list[tuple[Tried, ...]]()
    whole = find_allowable(wear, DEPTH, RTOL, keep=kept.append)
    calls = list[float]()

    def counted(amplitude):
        calls.append(amplitude)
        return wear(amplitude)

    again = find_allowable(counted, DEPTH, RTOL, known=kept[3])
    assert (again.amplitude, again.error, again.tried) == (whole.amplitude, whole.error, whole.tried)
    assert len(calls) <= len(kept) - 3


@pytest.mark.parametrize(
    ("name", "asked"),
    [
        ("until", {"until": WearTarget("frequency_shift", 0.01)}),
        ("wear_coefficient", {"wear_coefficient": 0.0}),
        ("cycles", {"cycles": 0.0}),
        ("cycles", {"cycles": np.inf}),
    ],
)
def test_what_is_not_asked_for(name, asked):
    given = {"friction_coefficient": 0.5, "wear_coefficient": WEAR, "cycles": END, "until": DEPTH}
    with pytest.raises(ValueError, match=f"^{name}: "):
        allowable_amplitude(scene("sdof_slider"), 160.0, **(given | asked))
