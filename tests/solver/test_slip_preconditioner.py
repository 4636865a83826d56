"""Factorisation in the slip space against a dense one of the whole Jacobian."""

import numpy as np
import pytest

from solver.newton import linear_solver
from solver.newton.linear_solver import JacobianSolver, build_factor
from solver.newton.slip_preconditioner import SlipFactor, build_slip_factor, largest_directions
from solver.settings import SolverSettings
from tests.solver.models import PRELOAD, random_balance, random_model

SETTINGS = SolverSettings(3, 24)
KINDS = ("3d", "constant_load", "normal_only", "3d", "3d", "3d", "3d", "3d", "3d", "3d", "3d", "3d")
MANY = 10**6


def case(seed, wear=True):
    """12 pairs of all kinds, of which the last three stay pressed and stuck."""
    balance, predicted = random_balance(random_model(seed, KINDS, 4), SETTINGS, seed, wear=wear)
    pressed = (balance.joint.component_index // 3 >= 9) & (balance.joint.component_index % 3 == 0)
    predicted = predicted.copy()
    predicted[pressed, 0] += 100.0 * PRELOAD
    return balance, predicted


def tangent_of(balance, predicted):
    return balance.linearise(balance.evaluate(predicted))


def dense_of(tangent):
    return tangent.dense(np.arange(tangent.joint.contact.n_contact))


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("wear", [False, True])
def test_the_whole_slip_space_gives_the_solution_and_the_determinant(seed, wear):
    balance, predicted = case(seed, wear)
    tangent = tangent_of(balance, predicted)
    space = largest_directions(tangent, MANY)
    assert space.exact
    assert set(space.pairs) == set(tangent.active())
    assert space.size < 0.8 * predicted.size
    found = build_slip_factor(tangent, space)
    right = np.random.default_rng(seed).normal(size=predicted.shape)
    dense = dense_of(tangent)
    exact = np.linalg.solve(dense, right.ravel()).reshape(right.shape)
    # neutral_shift moves the eigenvalues by 1e-8
    assert np.linalg.norm(found.solve(right) - exact) < 1e-6 * np.linalg.norm(exact)
    assert found.sign == np.linalg.slogdet(dense)[0]


def test_the_largest_directions_steer_the_iteration(monkeypatch):
    balance, predicted = case(5)
    tangent = tangent_of(balance, predicted)
    whole = largest_directions(tangent, MANY)
    most = whole.size * 3 // 4
    part = largest_directions(tangent, most)
    assert part.size == most
    assert not part.exact
    assert whole.exact
    monkeypatch.setattr(linear_solver, "MOST_DIRECTIONS", most)
    monkeypatch.setattr(linear_solver, "build_period_factor", lambda _: None)
    found = build_factor(tangent)
    assert isinstance(found, SlipFactor)
    assert not found.exact
    right = np.random.default_rng(6).normal(size=predicted.shape)
    step = JacobianSolver().solve(tangent, right)
    assert np.linalg.norm(tangent.apply(step) - right) < 2e-3 * np.linalg.norm(right)
    assert JacobianSolver().determinant_sign(tangent) == np.linalg.slogdet(dense_of(tangent))[0]


def test_where_everything_sticks_there_is_no_slip_space():
    balance, predicted = case(9, wear=False)
    pressed = predicted.copy()
    pressed[balance.joint.component_index % 3 == 0, 0] += 1e4 * PRELOAD
    constant = ~balance.joint.contact.has_normal[balance.joint.component_index // 3]
    pressed[constant] = 0.0
    tangent = tangent_of(balance, pressed)
    space = largest_directions(tangent, MANY)
    assert space.size == 0
    right = np.random.default_rng(1).normal(size=predicted.shape)
    assert np.array_equal(build_slip_factor(tangent, space).solve(right), right)
