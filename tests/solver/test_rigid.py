"""Rigid friction at the tip of a cantilever, and the peak of a slider, against exact motions."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from solver.history import StartState
from solver.march import march_wear
from solver.model import ReducedModel
from solver.outcome import Outcome
from solver.penalty import build_penalty
from solver.reach import reach, reaches
from solver.settings import SolverSettings
from tests.cantilever import FRICTION, Cantilever
from tests.references import den_hartog_amplitude
from tests.solver.exact import NATURAL
from tests.solver.models import branch_states, scene

SPRINGS = {"rigid": np.inf, "soft spring": 20.0, "stiff spring": 200.0}  # N/m
CASES = [  # spring, force, N, frequency, rad/s
    ("rigid", 3.0, 0.7),
    ("rigid", 6.0, 0.7),
    ("rigid", 3.0, 0.96),
    ("rigid", 6.0, 1.6),
    ("soft spring", 6.0, 0.7),
    ("soft spring", 3.0, 1.0),
    ("stiff spring", 6.0, 0.85),
    ("stiff spring", 3.0, 0.96),
    ("stiff spring", 6.0, 1.2),
]


@lru_cache
def exact(name: str, force: float, omega: float) -> tuple[complex, float]:
    """First harmonic and largest displacement of the tip, m."""
    beam = Cantilever(spring=SPRINGS[name])
    orbit, tip = beam.orbit(force, omega), beam.tip_of_orbit()
    first = sum(share * orbit.harmonic(dof) for dof, share in enumerate(tip))
    return complex(first), float(np.abs(tip @ orbit.sample(4096)[: tip.size]).max())


def reported(
    model: ReducedModel, friction: float, start: StartState, settings: SolverSettings
) -> tuple[complex, float]:
    """First harmonic and largest value, m, that are reported of the response of an unworn state."""
    history = march_wear(model, friction, start, 0.0, 1.0, "explicit", np.zeros(1), settings)
    return complex(history.response[0, 0]), float(history.response_peak[0, 0])


@pytest.mark.parametrize("rtol", [1e-2, 1e-3])
@pytest.mark.parametrize(("name", "force", "omega"), CASES)
def test_a_cantilever_with_rigid_friction_is_as_accurate_as_was_asked_for(
    name: str, force: float, omega: float, rtol: float
) -> None:
    model, settings = Cantilever(spring=SPRINGS[name]).model(), SolverSettings(rtol=rtol)
    (start,) = branch_states(model, FRICTION, force, [omega], settings)
    assert start.outcome is Outcome.CONVERGED
    first, peak = exact(name, force, omega)
    found, largest = reported(model, FRICTION, start, settings)
    error, peak_error = abs(found / first - 1.0), abs(largest / peak - 1.0)
    assert 1e-8 < error < rtol
    assert peak_error < rtol
    assert 0.5 * max(error, peak_error) < start.response_error <= rtol


@pytest.mark.parametrize("rtol", [1e-2, 1e-3])
@pytest.mark.parametrize("ratio", [0.62, 0.9])
def test_the_peak_of_den_hartogs_slider(ratio: float, rtol: float) -> None:
    model, settings = scene("sdof_slider", normal_stiffness=0.0), SolverSettings(rtol=rtol)
    (start,) = branch_states(model, 0.5, 10.0, [ratio * NATURAL], settings)
    largest = den_hartog_amplitude(0.1, 1.6e5, 10.0, 5.0, ratio * NATURAL)
    error = abs(reported(model, 0.5, start, settings)[1] / largest - 1.0)
    assert error < rtol
    assert 0.5 * error < start.response_error <= rtol


def test_a_mass_behind_a_spring_is_marched_as_long_as_it_is_seen() -> None:
    # the spring of 200 N/m and the tip's 0.05 kg are in resonance at 63 rad/s
    sprung, rigid = Cantilever(spring=200.0).model(), Cantilever().model()
    assert [bool(build_penalty(sprung, 1.0, highest).inertial[0]) for highest in (3, 27, 79, 165)] == [1, 1, 0, 0]
    assert all(build_penalty(rigid, 1.0, highest).inertial[0] for highest in (3, 27, 79, 165))
    # from there on the penalty is the spring
    assert build_penalty(sprung, 1.0, 1000).tangential[0] == pytest.approx(200.0, rel=1e-2)


def test_how_many_harmonics_reach_beyond_the_structure() -> None:
    slider = scene("sdof_slider", normal_stiffness=0.0)
    # k / (k + m s^2) of a mass on a spring is a quarter at sqrt(3) times its natural frequency
    assert not reaches(slider, NATURAL / 10.0, 15)
    assert reaches(slider, NATURAL / 10.0, 17)
    assert reach(slider, NATURAL, 1) == 1
    # the modes of the beam end at 57 rad/s
    assert 27 <= reach(Cantilever().model(), 1.0, 3) <= 79
    assert reach(Cantilever().model(), 1.0, 115) == 115
