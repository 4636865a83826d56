"""Newton's method, its directions, signs of determinants, Krylov methods and factorisations against dense algebra."""

import time
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numba import njit

from solver import build_model
from solver.clock import computing_time
from solver.contact.coulomb import SLIP
from solver.harmonic_balance.dlft import Balance
from solver.newton.krylov import STAGNATION_PRODUCTS, build_correction, solve_gmres
from solver.newton.linear_solver import DENSE_UNKNOWNS, JacobianSolver
from solver.newton.period_preconditioner import build_period_factor, stiffness_of_most
from solver.newton.run import Bordered, BorderedProblem, Run, bordered_step, solve_newton
from solver.settings import Resolution, SolverSettings, all_orders
from solver.structure.harmonic_stiffness import DenseStiffness
from tests.solver.models import PRELOAD, case_of, random_balance, random_model, scene


@dataclass
class Problem:
    """A function with its (generalised) derivative, and where it was evaluated."""

    function: Any
    derivative: Any
    calls: list[np.ndarray] = field(default_factory=list)

    def evaluate(self, point):
        self.calls.append(point)
        norm = float(np.linalg.norm(self.function(point)))
        return SimpleNamespace(point=point, scale=(1.0, 1.0), scaled_residual=lambda _=None: norm)

    def direction(self, at):
        return np.linalg.solve(self.derivative(at.point), -self.function(at.point))

    def solve(self, start, tolerance=1e-10):
        return solve_newton(self.evaluate, self.direction, np.asarray(start, float), tolerance)


def test_convergence_is_quadratic_on_a_smooth_function():
    problem = Problem(lambda x: np.exp(x) - 2.0, lambda x: np.diag(np.exp(x)))
    found, iterations = problem.solve([1.5], 1e-14)
    assert found is not None
    assert iterations <= 6
    errors = [abs(float(point[0]) - np.log(2.0)) for point in problem.calls]
    assert errors[3] < errors[2] ** 2


def test_a_cycle_of_plain_newton_is_broken():
    # slopes 1, 5, 1 between kinks at -1 and 1, so that the tangent of either outer piece leads to the other one
    problem = Problem(
        lambda x: 5 * np.clip(x, -1, 1) + (x - np.clip(x, -1, 1)), lambda x: np.diag(np.where(np.abs(x) < 1, 5.0, 1.0))
    )
    found, _ = problem.solve(np.linspace(2.0, 3.0, 3))
    for point, expected in zip(problem.calls[1:4], (-4.0, 4.0, -4.0), strict=True):
        assert point == pytest.approx(expected * np.ones(3))
    assert found.point == pytest.approx(np.zeros(3), abs=1e-10)


def test_a_residual_that_is_not_finite_sends_the_iteration_back():
    # the full step leads to where the logarithm is undefined
    problem = Problem(lambda x: np.log(x) if x[0] > 0 else np.full(1, np.nan), lambda x: np.diag(1 / x))
    found, _ = problem.solve([10.0], 1e-12)
    assert problem.calls[1][0] < 0.0
    assert found.point[0] == pytest.approx(1.0, rel=1e-10, abs=0.0)


def test_compiling_takes_no_computing_time():
    @njit
    def inner(values):
        return values.sum()

    @njit
    def outer(values):
        return inner(values) + inner(values[::-1])

    cpu, computing = time.thread_time(), computing_time()
    outer(np.arange(3.0))
    cpu, computing = time.thread_time() - cpu, computing_time() - computing
    assert cpu > 0.05
    assert 0.0 <= computing < 0.2 * cpu


SMALL = SolverSettings(3, 24)
ACCURACY = 2e-3  # relative residual of a direction: Newton's method gains three digits with it
ALL_KINDS = ("3d", "constant_load", "normal_only", "3d", "one_tangent", "second_tangent", "3d", "3d")
LARGE = ("3d",) * 13  # 273 unknowns: above the size that is solved directly, and a small joint
SLIDING = ALL_KINDS * 3  # no small joint: marches through the period


def case(seed, kinds=LARGE, wear=True, pressed=None, highest=3, samples=24):
    """A balance and a predicted force; pairs from `pressed` on stay closed and stuck."""
    resolution = Resolution(all_orders(highest), samples)
    balance, predicted = random_balance(random_model(seed, kinds, 4), SMALL, seed, wear=wear, resolution=resolution)
    component = balance.joint.component_index
    if pressed is not None:
        predicted[(component // 3 >= pressed) & (component % 3 == 0), 0] += 1e4 * PRELOAD
    return balance, predicted


def tangent_of(balance, predicted):
    return balance.linearise(balance.evaluate(predicted))


def dense_of(tangent):
    return tangent.dense(np.arange(tangent.joint.contact.n_contact))


def residual(tangent, step, right):
    return np.linalg.norm(tangent.apply(step) - right) / np.linalg.norm(right)


@pytest.mark.parametrize(("kinds", "seed", "wear"), [(LARGE, 6, False), (LARGE, 6, True), (SLIDING, 2, True)])
def test_a_kept_factorisation_follows_jacobians_that_change(kinds, seed, wear):
    balance, predicted = case(seed, kinds, wear)
    assert predicted.size > DENSE_UNKNOWNS
    solver, random = JacobianSolver(), np.random.default_rng(seed)
    for _ in range(6):
        tangent, right = tangent_of(balance, predicted), random.normal(size=predicted.shape)
        # the promise is the residual: of the Jacobian of now, not of the one that was factorised
        assert residual(tangent, solver.solve(tangent, [right])[0], right) < ACCURACY
        # wear in the step is so large that signs of both kinds come up
        assert solver.determinant_sign(tangent) == np.linalg.slogdet(dense_of(tangent))[0]
        predicted = predicted + 0.05 * np.abs(predicted).mean() * random.normal(size=predicted.shape)


def test_a_march_that_is_negative_is_asked_of_dense_factors():
    # all pairs of a travelling wave slip: with the harmonics that are left out the march has the other sign
    omega, resolution = 2.0 * np.pi * 214.2, Resolution(all_orders(9), 128)
    model = scene("dovetail_sector", 9, mesh=1, nodal_diameter=3)
    joint = case_of(model, 0.5, omega, SolverSettings(), resolution).joint(omega, 1.5)
    balance = Balance(joint, np.zeros((joint.contact.n_contact, 2)))
    stuck = -balance.evaluate(np.zeros((joint.component_index.size, 19))).residual
    tangent = tangent_of(balance, stuck)
    assert build_period_factor(tangent).sign == -1.0
    assert JacobianSolver().determinant_sign(tangent) == np.linalg.slogdet(dense_of(tangent))[0] == 1.0


def test_a_kept_factorisation_is_of_no_use_for_other_harmonics():
    solver = JacobianSolver()
    for highest, samples in ((5, 48), (3, 24), (5, 48)):
        tangent = tangent_of(*case(6, highest=highest, samples=samples))
        for right in np.random.default_rng(6).normal(size=(3, *tangent.at.predicted_h.shape)):
            assert residual(tangent, solver.solve(tangent, [right])[0], right) < ACCURACY
        assert solver.determinant_sign(tangent) == np.linalg.slogdet(dense_of(tangent))[0]


def test_pairs_that_stay_stuck_are_left_out_and_found_again():
    solver, random = JacobianSolver(), np.random.default_rng(11)
    # in steps ever more pairs are pressed so that they neither slip nor open, then they are let go again
    for free in (13, 8, 3, 0, 3, 11, 13):
        balance, predicted = case(10, wear=False, pressed=free)
        tangent, right = tangent_of(balance, predicted), random.normal(size=predicted.shape)
        assert tangent.active.size <= free
        step = solver.solve(tangent, [right])[0]
        assert residual(tangent, step, right) < ACCURACY
        # everything is stuck: the unknown moves nothing and the Jacobian is the identity
        assert free or np.array_equal(step, right)


def gmres(matrix, right, accuracy, most):
    """Solution, whether it has converged, and number of products."""
    found, converged, _, hessenberg = solve_gmres(lambda vector: matrix @ vector, right, accuracy, most)
    return found, converged, hessenberg.shape[1]


def test_a_correction_is_exact_where_gmres_has_been_and_saves_the_next_solve():
    random = np.random.default_rng(3)
    matrix = np.eye(60) + 0.05 * random.normal(size=(60, 60)) - 0.9 * np.outer(*np.eye(60)[:2])
    first, second = random.normal(size=(2, 60))
    images, changes = build_correction(*solve_gmres(lambda x: matrix @ x, first, 1e-6, 30)[2:])
    correction = np.eye(60) + changes.T @ images
    np.testing.assert_allclose(matrix @ correction @ images.T, images.T, atol=1e-12)
    across = second - (images @ second) @ images
    np.testing.assert_allclose(correction @ across, across, atol=1e-12)
    count = gmres(matrix, first + 1e-3 * second, 1e-3, 30)[2]
    assert gmres(matrix @ correction, first + 1e-3 * second, 1e-3, 30)[2] < 0.5 * count


def test_a_singular_operator_gives_what_can_be_had_and_ends():
    # J with a null vector on either side, and a right-hand side that it does not reach
    random = np.random.default_rng(6)
    left, null = (part / np.linalg.norm(part) for part in random.normal(size=(2, 100)))
    matrix = np.eye(100) + 0.04 * np.random.default_rng(7).normal(size=(100, 100))
    matrix = matrix - np.outer(left, left @ matrix)
    matrix = matrix - np.outer(matrix @ null, null)
    reached = matrix @ random.normal(size=100)
    right = reached / np.linalg.norm(reached) + 0.3 * left
    found, converged, count = gmres(matrix, right, 1e-3, 80)
    assert not converged
    assert np.linalg.norm(found) < 100.0
    # next to nothing but what lies out of reach is left
    assert 0.3 <= np.linalg.norm(matrix @ found - right) < 0.6
    assert count < 3 * STAGNATION_PRODUCTS
    assert not gmres(np.full((5, 5), np.nan), np.ones(5), 1e-3, 5)[1]


def test_the_march_is_the_inverse_where_nothing_is_cut_off_and_all_harmonics_see_one_stiffness():
    # as many harmonics as samples; lines on which slip forgets all that was before it
    balance, predicted = case(5, ("constant_load_one_tangent",) * 9, wear=False, highest=12, samples=25)
    structure = balance.joint.structure
    stiffness = np.real(structure.dynamic_stiffness[2])
    same = np.broadcast_to(stiffness.astype(complex), structure.dynamic_stiffness.shape)
    structure = replace(structure, static_stiffness=stiffness, moving=DenseStiffness(np.array(same)))
    assert np.array_equal(stiffness_of_most(structure), stiffness[None])
    tangent = tangent_of(replace(balance, joint=replace(balance.joint, structure=structure)), 3.0 * predicted)
    assert np.count_nonzero((tangent.at.status_t == SLIP).any(axis=1)) > 4
    step = np.random.default_rng(6).normal(size=predicted.shape)
    factor = build_period_factor(tangent)
    assert factor is not None
    # but for its single precision, 6e-8
    assert np.linalg.norm(factor.solve(tangent.apply(step)) - step) < 1e-5 * np.linalg.norm(step)
    # and is none of the identity
    assert residual(tangent, step, step) > 0.1


@dataclass(frozen=True)
class Affine(BorderedProblem):
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


@pytest.mark.parametrize("kinds", [("3d", "normal_only"), ("3d",) * 14])
def test_a_bordered_step_is_that_of_the_whole_jacobian(kinds):
    balance, predicted = random_balance(random_model(3, kinds), SolverSettings(3, 24), 4, wear=False)
    random, shape = np.random.default_rng(5), predicted.shape
    pushes, rows = random.normal(size=(2, 2, *shape)) / predicted.size
    problem = Affine(balance, pushes, rows, random.normal(size=(2, 2)))
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


def test_a_direction_without_any_stiffness_is_left_alone():
    """A free mass on a slider without friction: the Jacobian is singular, and the mean position arbitrary."""
    model = build_model([[1.0]], None, [[0.0]], [[-1, 0, -1]], 1e-4, load_harmonic=[1.0], normal_load=10.0)
    joint = case_of(model, 0.0, 1.0, SMALL).joint(1.0, 3.0)
    end = Run(1e-10).state(Balance(joint, np.zeros((1, 2))), np.zeros((1, 7)))
    assert end.evaluation.displacement_h[0, 1, :3] == pytest.approx([0.0, -3.0, 0.0], abs=0.1)


def test_an_iteration_that_leaves_all_numbers_gives_no_state_and_no_warning():
    balance, predicted = random_balance(random_model(3, ("3d", "normal_only")), SolverSettings(3, 24), 4, wear=False)
    assert Run(1e-8).state(balance, 1e305 * predicted) is None
