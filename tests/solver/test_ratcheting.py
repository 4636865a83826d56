"""Ratcheting of marched masses ends in shakedown, and what a state without it is worth."""

import numpy as np
import pytest

from solver.accuracy.certificate import certify
from solver.accuracy.resolved_state import ResolvedState
from solver.continuation.natural import ratchets, shake_down
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.structure.joint import Joint, build_case
from tests.random_scenes import random_scene
from tests.solver.models import branch_states

SHAKEN_DOWN = 160  # seed: the vibration lets the mass slip until it sticks
SLIDING_ON = 178  # seed: it goes on slipping to and fro
TOLERANCE = SolverSettings().tolerance


def started(seed, **settings):
    scene = random_scene(seed)
    omegas = [2.0 * np.pi * scene.frequency_hz]
    return branch_states(scene.model, scene.friction, scene.amplitude, omegas, SolverSettings(**settings))[0]


def ratcheting(seed, monkeypatch):
    """The first state that is refined at the frequency of the scene, before its masses shake down."""
    seen: list[tuple[Joint, State]] = []

    def note(level, _):
        seen.append((level.joint, level.point))
        return level

    with monkeypatch.context() as patched:
        patched.setattr(ResolvedState, "at_rest", note)
        # few samples: with many the last work falls slowly from one shakedown to the next
        started(seed, harmonics=3, samples=64)
    omega = 2 * np.pi * random_scene(seed).frequency_hz
    return next((joint, point) for joint, point in seen if np.isclose(joint.omega, omega, rtol=1e-12))


@pytest.mark.slow
def test_a_mass_that_vibration_shakes_down_does_not_wear(monkeypatch):
    joint, point = ratcheting(SHAKEN_DOWN, monkeypatch)
    assert ratchets(joint, point.evaluation, 0.5)
    assert "energy_error" in certify(joint, point.evaluation).failures(TOLERANCE)
    shaken = shake_down(joint, point, 1e-3, Run(TOLERANCE))
    assert shaken.evaluation.slip_work.sum() < 1e-6 * point.evaluation.slip_work.sum()
    assert shaken.evaluation.scaled_residual() <= TOLERANCE
    assert certify(joint, shaken.evaluation).holds(TOLERANCE)


@pytest.mark.slow
def test_a_mass_that_slides_on_wears_by_its_vibration_alone(monkeypatch):
    joint, point = ratcheting(SLIDING_ON, monkeypatch)
    shaken = shake_down(joint, point, 1e-3, Run(TOLERANCE))
    assert not ratchets(joint, shaken.evaluation, 1e-3)
    assert shaken.evaluation.slip_work.sum() > 0.1 * point.evaluation.slip_work.sum()
    # the next state starts from where this one stays
    again = shake_down(joint, shaken, 1e-3, Run(TOLERANCE))
    assert again is shaken
    middle = shaken.evaluation.displacement_h[:, 1:, 0] - shaken.evaluation.history
    moved = np.abs(shaken.evaluation.displacement_h[:, 1:, 1:]).max()
    assert np.abs(middle[joint.penalty.inertial]).max() < 0.1 * moved


@pytest.mark.slow
@pytest.mark.parametrize("seed", [SHAKEN_DOWN, 371])
def test_states_whose_slip_was_ratcheting_are_found(seed, monkeypatch):
    assert started(seed).outcome is Outcome.CONVERGED
    if seed != SHAKEN_DOWN:
        # without shakedown it tries all harmonics in vain, for minutes
        return
    monkeypatch.setattr(ResolvedState, "at_rest", lambda level, _: level)
    assert started(seed).outcome is Outcome.CERTIFICATE_FAILED


@pytest.mark.slow
def test_wear_of_other_harmonics_is_not_that_of_ratcheting_to_their_mean_position():
    # shaken down with 3 harmonics it slips 1e-12 N m on to where 9 have it, a thousand times what is left there
    start = started(710)
    assert start.outcome is Outcome.CONVERGED
    scene = random_scene(710)
    case = build_case(scene.model, scene.friction, start.penalty_omega, SolverSettings(), start.resolution)
    joint = case.joint(start.state.omega, scene.amplitude)
    state = start.state
    balance = Balance(joint, state.start_history, state.wear_depth)
    evaluation = balance.evaluate(balance.predict(state.displacement_h, state.contact_force_h))
    assert evaluation.slip_work.sum() < 1e-13
