"""Newton directions, GMRES and both factorisations against dense solves."""

from dataclasses import replace

import numpy as np
import pytest

from solver.contact.coulomb import SEPARATED, SLIP
from solver.harmonic_balance.dlft import Balance, Linearisation
from solver.newton import linear_solver
from solver.newton.krylov import STAGNATION_PRODUCTS, solve_gmres
from solver.newton.linear_solver import DENSE_UNKNOWNS, DenseFactor, JacobianSolver, build_dense_factor, build_factor
from solver.newton.period_preconditioner import PeriodFactor, build_period_factor, stiffness_of_most
from solver.settings import Resolution, SolverSettings, all_orders
from solver.structure.harmonic_stiffness import DenseStiffness
from solver.structure.joint import build_case
from tests.solver.models import PRELOAD, dovetail, random_balance, random_model

SETTINGS = SolverSettings(3, 24)
ACCURACY = 2e-3  # relative residual of a direction: Newton's method gains three digits with it
ALL_KINDS = ("3d", "constant_load", "normal_only", "3d", "one_tangent", "second_tangent", "3d", "3d")
THREE_STUCK = ("3d", "constant_load", "normal_only", *("3d",) * 9)
LARGE = ("3d",) * 13  # 273 unknowns: above the size that is solved directly, and a small joint


def case(seed, kinds=LARGE, wear=True, pressed=None, highest=3, samples=24):
    """A balance and a predicted force; pairs from `pressed` on stay closed and stuck."""
    resolution = Resolution(all_orders(highest), samples)
    balance, predicted = random_balance(random_model(seed, kinds, 4), SETTINGS, seed, wear=wear, resolution=resolution)
    joint = balance.joint
    if pressed is not None:
        predicted[(joint.component_index // 3 >= pressed) & (joint.component_index % 3 == 0), 0] += 1e4 * PRELOAD
    return balance, predicted


def tangent_of(balance, predicted):
    return balance.linearise(balance.evaluate(predicted))


def dense_of(tangent):
    return tangent.dense(np.arange(tangent.joint.contact.n_contact))


def exact_of(tangent, right):
    return np.linalg.solve(dense_of(tangent), right.ravel()).reshape(right.shape)


def residual(tangent, step, right):
    return np.linalg.norm(tangent.apply(step) - right) / np.linalg.norm(right)


# --- the direction ---


@pytest.mark.slow
@pytest.mark.parametrize("wear", [False, True])
def test_a_kept_factorisation_follows_jacobians_that_change(wear):
    balance, predicted = case(6, wear=wear)
    assert predicted.size > DENSE_UNKNOWNS
    solver, random, conditions = JacobianSolver(), np.random.default_rng(7), []
    for _ in range(8):
        tangent, right = tangent_of(balance, predicted), random.normal(size=predicted.shape)
        step, exact = solver.solve(tangent, right), exact_of(tangent, right)
        # the promise is the residual: of the Jacobian of now, not of the one that was factorised
        assert residual(tangent, step, right) < ACCURACY
        conditions.append(np.linalg.cond(dense_of(tangent)))
        assert np.linalg.norm(step - exact) < ACCURACY * conditions[-1] * np.linalg.norm(exact)
        predicted = predicted + 0.02 * PRELOAD * random.normal(size=predicted.shape) / np.arange(1, 8)
    # the bound on the error would be empty if the Jacobian were nearly singular
    assert min(conditions) < 1e3


def test_pairs_that_stay_stuck_are_left_out_and_found_again():
    solver, random = JacobianSolver(), np.random.default_rng(11)
    # in steps ever more pairs are pressed so that they neither slip nor open, then they are let go again
    for free in (13, 8, 3, 0, 3, 11, 13):
        balance, predicted = case(10, wear=False, pressed=free)
        tangent, right = tangent_of(balance, predicted), random.normal(size=predicted.shape)
        assert tangent.active.size <= free
        step = solver.solve(tangent, right)
        assert residual(tangent, step, right) < ACCURACY
        # everything is stuck: the unknown moves nothing and the Jacobian is the identity
        assert free or np.array_equal(step, right)


# --- GMRES ---


def well_conditioned(size, seed):
    return np.eye(size) + 0.4 * np.random.default_rng(seed).normal(size=(size, size)) / np.sqrt(size)


def gmres(matrix, right, rtol, restart, cycles, rounded=None):
    """Solution, whether it has converged, and number of products."""
    count = [0]

    def product(vector):
        count[0] += 1
        return (matrix if rounded is None else rounded) @ vector

    return *solve_gmres(product, lambda vector: matrix @ vector, right, rtol, restart, cycles), count[0]


@pytest.mark.parametrize(("restart", "cycles"), [(60, 1), (6, 20)])
def test_gmres_finds_the_solution_with_and_without_beginning_again(restart, cycles):
    matrix, right = well_conditioned(60, 1), np.random.default_rng(2).normal(size=60)
    found, converged, _ = gmres(matrix, right, 1e-10, restart, cycles)
    assert converged
    assert np.linalg.norm(matrix @ found - right) <= 1e-10 * np.linalg.norm(right)


def test_a_singular_operator_gives_what_can_be_had_and_ends():
    # J with a null vector on either side, and a right-hand side that it does not reach
    random = np.random.default_rng(6)
    left, null = (part / np.linalg.norm(part) for part in random.normal(size=(2, 100)))
    matrix = well_conditioned(100, 7)
    matrix = matrix - np.outer(left, left @ matrix)
    matrix = matrix - np.outer(matrix @ null, null)
    reached = matrix @ random.normal(size=100)
    right = reached / np.linalg.norm(reached) + 0.3 * left
    found, converged, count = gmres(matrix, right, 1e-3, 80, 6)
    assert not converged
    assert np.linalg.norm(found) < 100.0
    # next to nothing but what lies out of reach is left
    assert 0.3 <= np.linalg.norm(matrix @ found - right) < 0.6
    assert count < 3 * STAGNATION_PRODUCTS
    # the part that it reaches is no harder than with any other operator
    assert gmres(matrix, reached, 1e-6, 60, 1)[1]
    assert not gmres(np.full((5, 5), np.nan), np.ones(5), 1e-3, 5, 2)[1]


def test_products_that_are_rounded_are_refined_by_exact_ones():
    random = np.random.default_rng(3)
    # a direction that moves far under a small force
    left, right = (np.linalg.qr(random.normal(size=(30, 30)))[0] for _ in range(2))
    matrix = (left * np.geomspace(1.0, 1e-7, 30)) @ right
    wanted, rounded = matrix @ random.normal(size=30), matrix.astype(np.float32)
    for exact, good in ((rounded, False), (matrix, True)):
        found, _, _ = gmres(exact, wanted, 1e-9, 30, 1, rounded)
        assert bool(np.linalg.norm(matrix @ found - wanted) < 1e-9 * np.linalg.norm(wanted)) is good


# --- dense factors ---


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("wear", [False, True])
def test_dense_factors_give_the_solution_and_the_determinant(seed, wear):
    balance, predicted = case(seed, THREE_STUCK, wear, pressed=9)
    tangent = tangent_of(balance, predicted)
    found = build_dense_factor(tangent)
    assert found.exact
    right = np.random.default_rng(seed).normal(size=predicted.shape)
    right[tangent.passive_rows] = 0.0
    exact = exact_of(tangent, right)[tangent.active_rows]
    # the shift of neutral directions moves the eigenvalues by 1e-8
    assert np.linalg.norm(found.solve(right)[tangent.active_rows] - exact) < 1e-6 * np.linalg.norm(exact)
    assert found.sign == np.linalg.slogdet(dense_of(tangent))[0]


def test_the_lowest_harmonics_steer_the_iteration(monkeypatch):
    balance, predicted = case(5, THREE_STUCK, pressed=9)
    tangent = tangent_of(balance, predicted)
    monkeypatch.setattr(linear_solver, "LARGEST_DENSE", 5 * tangent.active_rows.size)
    found = build_factor(tangent)
    assert isinstance(found, DenseFactor)
    assert not found.exact
    right = np.random.default_rng(6).normal(size=predicted.shape)
    assert residual(tangent, JacobianSolver().solve(tangent, right), right) < ACCURACY
    assert JacobianSolver().determinant_sign(tangent) == np.linalg.slogdet(dense_of(tangent))[0]


# --- the march through the period ---


def test_the_march_is_the_inverse_where_nothing_is_cut_off_and_all_harmonics_see_one_stiffness():
    # as many harmonics as samples; lines on which slip forgets all that was before it
    balance, predicted = case(5, ("constant_load_one_tangent",) * 9, wear=False, highest=12, samples=25)
    structure = balance.joint.structure
    stiffness = np.real(structure.dynamic_stiffness[2])
    same = np.broadcast_to(stiffness.astype(complex), structure.dynamic_stiffness.shape)
    structure = replace(structure, static_stiffness=stiffness, moving=DenseStiffness(np.array(same)))
    assert np.array_equal(stiffness_of_most(structure), stiffness)
    tangent = tangent_of(replace(balance, joint=replace(balance.joint, structure=structure)), 3.0 * predicted)
    assert np.count_nonzero((tangent.at.status_t == SLIP).any(axis=1)) > 4
    step = np.random.default_rng(6).normal(size=predicted.shape)
    factor = build_period_factor(tangent)
    assert factor is not None
    # but for its single precision, 6e-8
    assert np.linalg.norm(factor.solve(tangent.apply(step)) - step) < 1e-5 * np.linalg.norm(step)
    # and is none of the identity
    assert residual(tangent, step, step) > 0.1


def products(monkeypatch, tangent, right, accuracy):
    """Products with the Jacobian that a direction takes; its residual is checked."""
    counted, plain = [0], Linearisation.apply_roughly

    def apply(self, step):
        counted[0] += 1
        return plain(self, step)

    with monkeypatch.context() as patch:
        patch.setattr(Linearisation, "apply_roughly", apply)
        step = JacobianSolver().solve(tangent, right)
    assert residual(tangent, step, right) < accuracy
    return counted[0]


def test_a_dovetail_that_slips_and_opens_takes_few_products(monkeypatch):
    model = dovetail()
    omega = 2.0 * np.pi * 213.0
    joint = build_case(model, 0.5, omega, SETTINGS, Resolution(all_orders(13), 128)).joint(omega, 5.0)
    balance = Balance(joint, np.zeros((model.contact.n_contact, 2)), np.zeros(model.contact.n_contact))
    predicted = joint.structure.force_h()
    predicted[:, 1:3] = predicted[:, :1] * np.random.default_rng(1).normal(size=(joint.component_index.size, 2))
    tangent = tangent_of(balance, predicted)
    status = tangent.at.status_t
    assert all((status == one).any(axis=1).sum() >= 10 for one in (SEPARATED, SLIP))
    assert isinstance(build_factor(tangent), PeriodFactor)
    # free to slide as a whole: a right-hand side that can be reached
    right = tangent.apply(np.random.default_rng(2).normal(size=predicted.shape))
    # 25 with the resonances of the structure taken into account
    assert products(monkeypatch, tangent, right, ACCURACY) <= 30


def test_a_kept_march_serves_states_nearby_and_the_sign_of_the_determinant(monkeypatch):
    monkeypatch.setattr(linear_solver, "DENSE_UNKNOWNS", 0)
    monkeypatch.setattr(linear_solver, "SMALL_JOINT", 0)
    balance, predicted = case(8, ALL_KINDS, wear=False, highest=5, samples=64)
    solver, random = JacobianSolver(), np.random.default_rng(9)
    for _ in range(4):
        tangent, right = tangent_of(balance, predicted), random.normal(size=predicted.shape)
        assert residual(tangent, solver.solve(tangent, right), right) < ACCURACY
        assert solver.determinant_sign(tangent) == np.linalg.slogdet(dense_of(tangent))[0]
        predicted = predicted * 1.05
