"""Stability of states on all three branches of a mass at a wall; signs of determinants against dense ones."""

from functools import lru_cache

import numpy as np
import pytest

from solver.continuation.arc_length import Arc, follow_arc
from solver.harmonic_balance.converged import PathPoint
from solver.harmonic_balance.dlft import Balance
from solver.newton.krylov import ritz_values
from solver.newton.linear_solver import JacobianSolver
from solver.newton.options import NEWTON
from solver.newton.solve_balance import Budget
from solver.settings import SolverSettings
from solver.stability.hill import is_stable
from solver.structure.joint import build_case
from tests.solver.models import converged_state, random_balance, random_model, scene

FORCE = 0.02
SETTINGS = SolverSettings(21, 256)
CASE = build_case(scene("vibro_impact"), 0.0, 1.55, SETTINGS)


def balance_at(omega, history):
    return Balance.frozen(CASE.joint(omega, FORCE), history, np.zeros(1))


@lru_cache
def crossings():
    """States of the branch from 1.55 rad/s through both folds back to 1.55 rad/s, that lie at 1.3 and 1.55 rad/s."""
    state = converged_state(CASE.model, 0.0, FORCE, 1.55, SETTINGS)
    start = balance_at(1.55, state.start_history)
    at = start.evaluate(start.predict(state.displacement_h, state.contact_force_h))
    found: dict[float, list[PathPoint]] = {1.3: [], 1.55: []}
    for target, seen in found.items():

        def collect(point, seen=seen):
            seen.append(point)
            return len(seen) == 2

        begin = PathPoint(1.55, at, state.start_history)
        follow_arc(Arc(balance_at, begin, 0.08, JacobianSolver(), 1e-8, Budget()), target, collect, toward=1.0)
    found[1.55].insert(0, PathPoint(1.55, at, state.start_history))
    return found


@pytest.mark.slow
def test_the_branches_have_alternating_stability():
    upper, middle, lower = crossings()[1.55]
    tangents = [balance_at(1.55, point.history).linearise(point.evaluation) for point in (upper, middle, lower)]
    assert [is_stable(tangent, JacobianSolver()) for tangent in tangents] == [True, False, True]
    sizes = [np.abs(point.evaluation.displacement_h).max() for point in (upper, middle, lower)]
    assert sizes[0] > sizes[1] > 0
    assert not lower.evaluation.force_h.any()


def test_a_joint_that_is_open_or_stuck_all_over_is_stable():
    for seed, level in ((1, -1e6), (2, 1e6)):
        balance, predicted = random_balance(random_model(seed), SolverSettings(3, 24), seed, wear=False)
        predicted[balance.joint.component_index % 3 == 0, 0] = level
        at = balance.evaluate(predicted)
        assert (at.status_t == (0 if level < 0 else 1)).all()
        assert is_stable(balance.linearise(at), JacobianSolver())


@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5, 6])
def test_the_sign_with_a_kept_factorisation_is_that_of_the_dense_matrix(seed):
    settings = SolverSettings(3, 24)
    # wear in the step so large that signs of both kinds come up
    balance, predicted = random_balance(random_model(seed, ("3d",) * 14, 4), settings, seed, wear=True)
    assert predicted.size > NEWTON.dense_unknowns
    random = np.random.default_rng(seed)
    solver = JacobianSolver()
    for _ in range(6):
        tangent = balance.linearise(balance.evaluate(predicted))
        exact = np.linalg.slogdet(tangent.dense(np.arange(balance.joint.contact.n_contact)))[0]
        assert solver.determinant_sign(tangent) == exact
        predicted = predicted + 0.05 * np.abs(predicted).mean() * random.normal(size=predicted.shape)


def test_two_right_sides_are_solved_as_one_by_one():
    for kinds in (("3d", "normal_only"), ("3d",) * 14):
        balance, predicted = random_balance(random_model(3, kinds), SolverSettings(3, 24), 4, wear=False)
        tangent = balance.linearise(balance.evaluate(predicted))
        first, second, noise = np.random.default_rng(5).normal(size=(3, *predicted.shape))
        solver = JacobianSolver()
        row = noise / np.linalg.norm(noise)

        def change_of(step, by_parameter, row=row):
            return (0.3 - float(np.vdot(row, step))) / float(np.vdot(row, by_parameter))

        # a second side near the one before, equal to it, and far from it
        for other in (second, second + 1e-2 * noise, second + 1e-2 * noise, noise):
            step, change = solver.solve_with_parameter(tangent, first, other, change_of)
            assert np.linalg.norm(tangent.apply(step) - first - change * other) < 4e-3 * np.linalg.norm(first)
            assert np.vdot(row, step) == pytest.approx(0.3, rel=1e-9)
            near = solver.solve_by_parameter(tangent, other, 1e-2)
            assert np.linalg.norm(tangent.apply(near) - other) < 2e-2 * np.linalg.norm(other)
        for right, step in zip((first, second), solver.solve_all(tangent, (first, second)), strict=True):
            assert np.linalg.norm(tangent.apply(step) - right) < 2e-3 * np.linalg.norm(right)


def test_ritz_values_of_a_whole_space_are_the_eigenvalues():
    matrix = np.random.default_rng(1).normal(size=(12, 12))
    found = ritz_values(lambda x: matrix @ x, np.ones(12), 30)[0]
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(np.linalg.eigvals(matrix)), abs=1e-8)
