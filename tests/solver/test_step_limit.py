"""Steps that wear off too much: seen by the share of the preload that they move, and never reported as results."""

from functools import lru_cache

import numpy as np
import pytest

from solver.continuation.static_state import solve_static_state
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.structure.joint import build_case
from solver.wear.rate_slope import LARGEST_MOVED_LOAD, moved_fraction, too_long
from tests.solver.models import branch_states, dovetail, march_wear

SETTINGS = SolverSettings(harmonics=3, samples=64)
FREQUENCY = 212.5  # Hz
FRICTION = 0.5
CYCLES = np.array([0.0, 1000.0, 5000.0])


@lru_cache
def start():
    omegas = 2.0 * np.pi * np.array([FREQUENCY])
    (state,) = branch_states(dovetail(), FRICTION, 0.5, omegas, SETTINGS)
    assert state.outcome is Outcome.CONVERGED
    return state


def test_the_share_is_that_by_which_the_normal_forces_change():
    # without friction the pairs stay closed and slide freely: the static state is linear in the depth
    case = build_case(dovetail(), 0.0, 2.0 * np.pi * FREQUENCY, SETTINGS)
    joint = case.joint(2.0 * np.pi * FREQUENCY, 0.0)
    depth = 2e-7 * np.random.default_rng(1).uniform(size=16)
    states = []
    for worn in (np.zeros(16), depth):
        point = solve_static_state(joint, worn, Run(1e-10))
        states.append(point.evaluation)
    before, after = (state.force_h[:, 0, 0] for state in states)
    change = np.linalg.norm(after - before) / np.linalg.norm(before)
    assert change > 0.01
    assert moved_fraction(joint, states[0], depth) == pytest.approx(change, rel=1e-6, abs=0.0)


def test_the_reason_names_the_step_and_one_that_would_do():
    case = build_case(dovetail(), FRICTION, 2.0 * np.pi * FREQUENCY, SETTINGS)
    joint = case.joint(2.0 * np.pi * FREQUENCY, 0.0)
    point = solve_static_state(joint, np.zeros(16), Run(1e-10))
    one = np.zeros(16)
    one[0] = 1e-9
    unit = moved_fraction(joint, point.evaluation, one)
    short = 0.9 * LARGEST_MOVED_LOAD / unit * one
    assert too_long(joint, point.evaluation, short, 3000.0, 1000.0) is None
    said = too_long(joint, point.evaluation, 20.0 / unit * one, 3000.0, 1000.0)
    assert said is not None
    assert "1e+03 cycles at once from cycle 3000 on moves 20 times" in said
    assert "at most 5 cycles" in said


def last_volume(wear_coefficient, scheme, step, cycles):
    history = march_wear(dovetail(), FRICTION, start(), wear_coefficient, step, scheme, cycles, SETTINGS)
    return history.outcome, float(history.worn_volume[-1]), history.message


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["explicit", "implicit"])
def test_a_wear_coefficient_in_the_wrong_unit_is_a_step_too_long(scheme):
    outcome, _, message = last_volume(1.1e-5, scheme, 1000.0, CYCLES)
    assert outcome is Outcome.STEP_TOO_LONG
    assert "from cycle 0 on" in message


@pytest.mark.slow
def test_the_step_that_is_advised_is_none_too_long():
    _, _, message = last_volume(1.1e-5, "explicit", 1000.0, CYCLES)
    advised = float(message.split("at most ")[1].split()[0])
    assert 1e-4 < advised < 1e-2
    outcome, _, message = last_volume(1.1e-5, "explicit", advised, 20.0 * advised * np.array([0.0, 1.0]))
    assert outcome is Outcome.CONVERGED, message
