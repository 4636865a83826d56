"""Newton directions against a dense solve of the whole Jacobian."""

import numpy as np
import pytest

from solver.newton.linear_solver import DENSE_UNKNOWNS, JacobianSolver
from solver.settings import SolverSettings
from tests.solver.models import PRELOAD, random_balance, random_model

SETTINGS = SolverSettings(3, 24)
ACCURACY = 2e-3  # relative residual of a direction: Newton's method gains three digits with it


def large(seed, wear=True):
    """13 pairs, 39 displacements, 273 unknowns: above the size that is solved directly, and a small joint."""
    balance, predicted = random_balance(random_model(seed, ("3d",) * 13, 4), SETTINGS, seed, wear=wear)
    assert predicted.size > DENSE_UNKNOWNS
    return balance, predicted


def oracle(balance, predicted, right):
    tangent = balance.linearise(balance.evaluate(predicted))
    dense = tangent.dense(np.arange(balance.joint.contact.n_contact))
    return np.linalg.solve(dense, right.ravel()).reshape(right.shape)


def error(found, exact):
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


def test_a_large_system_is_solved_to_round_off_by_a_fresh_factorisation():
    balance, predicted = large(4)
    right = np.random.default_rng(5).normal(size=predicted.shape)
    step = JacobianSolver().solve(balance.linearise(balance.evaluate(predicted)), right)
    assert error(step, oracle(balance, predicted, right)) < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("wear", [False, True])
def test_a_kept_factorisation_follows_jacobians_that_change(wear):
    balance, predicted = large(6, wear)
    solver = JacobianSolver()
    random = np.random.default_rng(7)
    conditions = []
    for _ in range(8):
        tangent = balance.linearise(balance.evaluate(predicted))
        right = random.normal(size=predicted.shape)
        step = solver.solve(tangent, right)
        # the promise is the residual: of the Jacobian of now, not of the one that was factorised
        residual = np.linalg.norm(tangent.apply(step) - right) / np.linalg.norm(right)
        condition = np.linalg.cond(tangent.dense(np.arange(balance.joint.contact.n_contact)))
        conditions.append(condition)
        assert residual < ACCURACY
        assert error(step, oracle(balance, predicted, right)) < ACCURACY * condition
        predicted = predicted + 0.02 * PRELOAD * random.normal(size=predicted.shape) / np.arange(1, 8)
    # the bound on the error would be empty if the Jacobian were nearly singular
    assert min(conditions) < 1e3


def test_pairs_that_stay_stuck_are_left_out_and_found_again():
    balance, predicted = large(10, wear=False)
    solver = JacobianSolver()
    random = np.random.default_rng(11)
    joint = balance.joint
    # in steps ever more pairs are pressed so that they neither slip nor open, then they are let go again
    for held in (0, 5, 10, 14, 10, 2, 0):
        changed = predicted.copy()
        closing = (joint.component_index // 3 < held) & (joint.component_index % 3 == 0)
        changed[closing, 0] += 100.0 * PRELOAD
        tangent = balance.linearise(balance.evaluate(changed))
        assert tangent.active().size <= 14 - held
        right = random.normal(size=predicted.shape)
        step = solver.solve(tangent, right)
        assert np.linalg.norm(tangent.apply(step) - right) < ACCURACY * np.linalg.norm(right)
        if held == 14:
            # everything is stuck: the unknown moves nothing and the Jacobian is the identity
            assert error(step, right) < 1e-12
