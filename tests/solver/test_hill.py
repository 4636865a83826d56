"""Stability of states on all three branches of a mass at a wall; signs of determinants against dense ones."""

from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
import pytest

from solver.continuation.arc_length import Arc
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State
from solver.newton.bordering import Bordered, bordered_step
from solver.newton.krylov import ritz_values
from solver.newton.linear_solver import DENSE_UNKNOWNS, JacobianSolver
from solver.newton.run import Run
from solver.settings import SolverSettings
from solver.stability.hill import is_stable
from solver.structure.joint import build_case
from tests.solver.models import converged_state, crossings, random_balance, random_model, scene

FORCE = 0.02
SETTINGS = SolverSettings(21, 256)
CASE = build_case(scene("vibro_impact"), 0.0, 1.55, SETTINGS)


def balance_at(omega, history):
    return Balance(CASE.joint(omega, FORCE), history, np.zeros(1))


def three_states():
    """States at 1.55 rad/s of the branch from there through both folds."""
    state = converged_state(CASE.model, 0.0, FORCE, 1.55, SETTINGS)
    start = balance_at(1.55, state.start_history)
    at = start.evaluate(start.predict(state.displacement_h, state.contact_force_h))
    begin = State(at, state.start_history, 1.55)
    return [begin, *islice(crossings(Arc(balance_at, begin, 0.08, Run(1e-8)), 1.55, 1.0), 2)]


@pytest.mark.slow
def test_the_branches_have_alternating_stability():
    upper, middle, lower = three_states()
    stable = [is_stable(balance_at(1.55, at.history), at.evaluation, Run(1e-8)) for at in (upper, middle, lower)]
    assert stable == [True, False, True]
    sizes = [np.abs(point.evaluation.displacement_h).max() for point in (upper, middle, lower)]
    assert sizes[0] > sizes[1] > 0
    assert not lower.evaluation.force_h.any()


def test_a_joint_that_is_open_or_stuck_all_over_is_stable():
    for seed, level in ((1, -1e6), (2, 1e6)):
        balance, predicted = random_balance(random_model(seed), SolverSettings(3, 24), seed, wear=False)
        predicted[balance.joint.component_index % 3 == 0, 0] = level
        at = balance.evaluate(predicted)
        assert (at.status_t == (0 if level < 0 else 1)).all()
        assert is_stable(balance, at, Run(1e-8))


@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5, 6])
def test_the_sign_with_a_kept_factorisation_is_that_of_the_dense_matrix(seed):
    settings = SolverSettings(3, 24)
    # wear in the step so large that signs of both kinds come up
    balance, predicted = random_balance(random_model(seed, ("3d",) * 14, 4), settings, seed, wear=True)
    assert predicted.size > DENSE_UNKNOWNS
    random = np.random.default_rng(seed)
    solver = JacobianSolver()
    for _ in range(6):
        tangent = balance.linearise(balance.evaluate(predicted))
        exact = np.linalg.slogdet(tangent.dense(np.arange(balance.joint.contact.n_contact)))[0]
        assert solver.determinant_sign(tangent) == exact
        predicted = predicted + 0.05 * np.abs(predicted).mean() * random.normal(size=predicted.shape)


@dataclass(frozen=True)
class _Affine:
    """A balance with two further unknowns q that push it, R(p) + B q = 0, and two linear equations of p and q."""

    balance: Balance
    pushes: np.ndarray  # (2, n_rel, m)
    rows: np.ndarray  # (2, n_rel, m)
    own: np.ndarray  # (2, 2)

    def evaluate(self, predicted_h, values):
        at = self.balance.evaluate(predicted_h)
        at = replace(at, residual=at.residual + np.tensordot(values, self.pushes, 1))
        errors = np.tensordot(self.rows, predicted_h, 2) + self.own @ values - 0.3
        return Bordered(self.balance, at, values, errors)

    def by_values(self, _):
        return list(self.pushes), self.own

    def by_step(self, _, __, step):
        return np.tensordot(self.rows, step, 2)

    def fraction(self, *_):
        return 1.0


@pytest.mark.parametrize("kinds", [("3d", "normal_only"), ("3d",) * 14])
def test_a_bordered_step_is_that_of_the_whole_jacobian(kinds):
    balance, predicted = random_balance(random_model(3, kinds), SolverSettings(3, 24), 4, wear=False)
    random, shape = np.random.default_rng(5), predicted.shape
    pushes, rows = random.normal(size=(2, 2, *shape)) / predicted.size
    problem = _Affine(balance, pushes, rows, random.normal(size=(2, 2)))
    here = problem.evaluate(predicted, np.array([0.7, -0.2]))
    tangent = balance.linearise(here.at)
    step, found = bordered_step(problem, here, JacobianSolver(), 1e-9)
    jacobian = tangent.dense(np.arange(balance.joint.contact.n_contact))
    by_values = pushes.reshape(2, -1).T
    whole = np.block([[jacobian, by_values], [rows.reshape(2, -1), problem.own]])
    wanted = np.linalg.solve(whole, -np.concatenate([here.at.residual.ravel(), here.errors]))
    assert step == pytest.approx(wanted, rel=1e-6, abs=1e-6 * np.abs(wanted).max())
    reduced = problem.own - rows.reshape(2, -1) @ np.linalg.solve(jacobian, by_values)
    assert found == pytest.approx(reduced, rel=1e-6, abs=1e-6)


def test_ritz_values_of_a_whole_space_are_the_eigenvalues():
    matrix = np.random.default_rng(1).normal(size=(12, 12))
    found = ritz_values(lambda x: matrix @ x, np.ones(12), 30)[0]
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(np.linalg.eigvals(matrix)), abs=1e-8)
