"""Harmonics added by homotopy: its ends, and the states that it finds."""

from dataclasses import replace

import numpy as np
import pytest

from solver.accuracy.resolved_state import ResolvedState
from solver.continuation.homotopy import add_harmonics, harmonic_homotopy
from solver.loading_history.start_states import follow_branch
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import Resolution, SolverSettings, all_orders
from solver.structure.fourier import change_orders
from tests.random_scenes import random_scene
from tests.solver.models import OMEGA, random_model
from tests.solver.test_refinement import FRICTION, SLIDER_OMEGA, SLIPPING, response, slider, solved_at, started

RICH = Resolution(all_orders(9), 256)
THROWN_OFF = 53  # seed: a warm start with more harmonics fails


def states():
    """A marched mass, and an elastic joint with pairs of every kind."""
    fixed = SolverSettings(5, 256)
    case, point = slider(fixed)
    elastic, other = started(random_model(2), FRICTION, OMEGA, SLIPPING, fixed)
    return [(case, SLIDER_OMEGA, 10.0, point), (elastic, OMEGA, SLIPPING, other)]


@pytest.mark.parametrize("which", [0, 1])
def test_the_homotopy_begins_at_the_state_and_ends_at_the_balance(which):
    case, omega, amplitude, point = states()[which]
    joint = replace(case, resolution=RICH).joint(omega, amplitude)
    new = np.arange(5, 9)
    homotopy_at = harmonic_homotopy(joint, point.evaluation, new)
    start = change_orders(point.evaluation.predicted_h, case.resolution.orders, RICH.orders)
    assert homotopy_at(0.0, point.history).evaluate(start).scaled_residual() <= 2e-8
    assert homotopy_at(1.0, point.history).joint.structure is joint.structure
    nearly = homotopy_at(1.0 - 1e-9, point.history).evaluate(start).residual
    whole = homotopy_at(1.0, point.history).evaluate(start).residual
    assert nearly == pytest.approx(whole, rel=1e-5, abs=1e-6 * np.abs(whole).max())


@pytest.mark.parametrize("which", [0, 1])
def test_the_homotopy_ends_at_the_state_that_a_warm_start_finds(which):
    case, omega, amplitude, point = states()[which]
    case = replace(case, settings=SolverSettings())
    found = ResolvedState(case, case.joint(omega, amplitude), point).by_homotopy(RICH, Run(case.settings.tolerance))
    best = solved_at(case, omega, amplitude, point, RICH)
    ours = response(found.case, omega, amplitude, found.point)
    assert ours == pytest.approx(response(case.at(RICH), omega, amplitude, best), rel=1e-6)
    along = add_harmonics(case, case.joint(omega, amplitude), point.evaluation, RICH, Run(case.settings.tolerance))
    assert along.scaled_residual() <= case.settings.tolerance


@pytest.mark.slow
def test_a_scene_whose_warm_starts_fail_is_solved(monkeypatch):
    scene, attempts = random_scene(THROWN_OFF), []
    by_homotopy = ResolvedState.by_homotopy

    def noted(level, resolution, budget):
        found = by_homotopy(level, resolution, budget)
        attempts.append(found is not None)
        return found

    monkeypatch.setattr(ResolvedState, "by_homotopy", noted)
    frequencies = np.array([scene.frequency_hz])
    states = follow_branch(scene.model, scene.friction, scene.amplitude, frequencies, "up", SolverSettings())
    assert next(states)[1].outcome is Outcome.CONVERGED
    # during the sweep warm starts fail, and harmonics are added by homotopy
    assert any(attempts)
