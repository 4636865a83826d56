"""Static and periodic states under much friction: all are found, and their limit is the glued structure."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from solver.continuation.first_state import solve_first_state, solve_static_state
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Budget
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.structure.condensation import condense
from solver.structure.joint import build_case
from tests.solver.models import dovetail

SETTINGS = SolverSettings(harmonics=3, samples=64)
OMEGA = 2.0 * np.pi * 211.5
PAIRS = 16
PRESS = 200.0  # N on each pair: with it the glued dovetail pulls nowhere


@lru_cache
def pressed_dovetail():
    """The coarse dovetail with so much more load on its flanks that all pairs of the glued structure are pressed."""
    model = dovetail()
    linear = model.linear[0]
    load = linear.load_static.copy()
    load[model.contact.dofs[:, 0]] += PRESS
    return replace(model, linear={0: replace(linear, load_static=load)})


def glued_force(model):
    """Contact force (n_contact, 3), N, of the static load with all relative displacements held."""
    linear = model.linear[0]
    condensed = condense(np.real(linear.stiffness), model.contact.dofs.ravel(), linear.load_static)
    return np.real(condensed.force).reshape(-1, 3)


def static_point(model, friction):
    case = build_case(model, friction, OMEGA, SETTINGS)
    point = solve_static_state(case.joint(OMEGA, 0.0), np.zeros(model.contact.n_contact), 1e-9, Budget())
    assert point is not None, f"no static state at a friction coefficient of {friction}"
    return point


def needed_friction(model):
    """Friction coefficient from which the glued structure slips nowhere."""
    force = glued_force(model)
    assert force[:, 0].min() > 0.0
    return float((np.hypot(force[:, 1], force[:, 2]) / force[:, 0]).max())


def test_beyond_the_friction_that_holds_all_pairs_the_static_state_is_the_glued_one():
    model = pressed_dovetail()
    needed, force = needed_friction(model), glued_force(model)
    assert 1.5 < needed < 100.0, "the test means nothing"
    for friction in (1.01 * needed, 5.0 * needed, 1000.0):
        evaluation = static_point(model, friction).evaluation
        assert np.abs(evaluation.force_h[:, :, 0] - force).max() < 1e-7 * force.max()
    assert np.abs(static_point(model, 0.7 * needed).evaluation.force_h[:, :, 0] - force).max() > 1e-3 * force.max()


@pytest.mark.slow
def test_with_more_friction_the_vibration_comes_to_that_of_the_glued_structure():
    model = pressed_dovetail()
    glued = None
    away = []
    for friction in (0.06, 0.08, 0.1, 5.0, 1000.0):
        case = build_case(model, friction, OMEGA, SETTINGS)
        outcome, point = solve_first_state(case, OMEGA, 0.5, np.zeros(PAIRS), JacobianSolver(), Budget())
        assert outcome is Outcome.CONVERGED, f"friction {friction}"
        joint = case.joint(OMEGA, 0.5)
        glued = complex(joint.structure.harmonic_offset[0])
        cosine, sine = joint.structure.response_h(joint.to_relative(point.evaluation.displacement_h))[0, 1:3]
        away.append(abs(complex(cosine, -sine) - glued))
    assert glued is not None
    assert away[0] > away[1] > away[2] > 0.01 * abs(glued)
    assert max(away[3:]) < 1e-6 * abs(glued)


@pytest.mark.parametrize("friction", [0.3, 0.5, 1.0, 2.0, 5.0, 30.0, 1000.0])
def test_the_dovetail_has_a_static_state_under_any_friction(friction):
    model = dovetail()
    evaluation = static_point(model, friction).evaluation
    normal, tangential = evaluation.force_h[:, 0, 0], evaluation.force_h[:, 1:, 0]
    assert normal.min() >= 0.0
    assert (np.hypot(*tangential.T) <= friction * normal * (1.0 + 1e-12)).all()
    linear = model.linear[0]
    condensed = condense(np.real(linear.stiffness), model.contact.dofs.ravel(), linear.load_static)
    # without gaps: what the pairs moved by, the force that they take, and the load
    moved = evaluation.displacement_h[:, :, 0]
    left = np.real(condensed.stiffness) @ moved.ravel() + evaluation.force_h[:, :, 0].ravel() - np.real(condensed.force)
    assert np.abs(left).max() < 1e-6 * np.abs(condensed.force).max()
    # a closed pair does not penetrate, an open one carries nothing
    assert moved[:, 0].max() < 1e-9 * np.abs(moved).max()
