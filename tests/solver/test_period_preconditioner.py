"""The march through the period that preconditions, against the contact law, plain solves and the exact Jacobian."""

from dataclasses import replace

import numpy as np

from solver.contact.coulomb import SEPARATED, SLIP
from solver.harmonic_balance.dlft import Balance, Linearisation
from solver.newton import linear_solver
from solver.newton.linear_solver import JacobianSolver, build_factor
from solver.newton.period_preconditioner import PeriodFactor, build_period_factor, stiffness_of_most
from solver.newton.slip_preconditioner import SlipFactor
from solver.settings import Resolution, SolverSettings, all_orders
from solver.structure.harmonic_stiffness import DenseStiffness
from solver.structure.joint import build_case
from tests.solver.models import OMEGA, dovetail, random_balance, random_model, with_free_masses

SETTINGS = SolverSettings(3, 24)
KINDS = ("3d", "constant_load", "normal_only", "3d", "one_tangent", "second_tangent", "3d", "3d")


def tangent_of(balance, predicted):
    return balance.linearise(balance.evaluate(predicted))


def case(seed, highest=3, samples=24, kinds=KINDS):
    resolution = Resolution(all_orders(highest), samples)
    return random_balance(random_model(seed, kinds, 4), SETTINGS, seed, wear=False, resolution=resolution)


def factor_of(tangent):
    found = build_period_factor(tangent)
    assert found is not None
    return found


def test_it_is_the_inverse_where_nothing_is_cut_off_and_all_harmonics_see_one_stiffness():
    # as many harmonics as samples; lines on which slip forgets all that was before it
    balance, predicted = case(5, highest=12, samples=25, kinds=("constant_load_one_tangent",) * 9)
    structure = balance.joint.structure
    stiffness = np.real(structure.dynamic_stiffness[2])
    same = np.broadcast_to(stiffness.astype(complex), structure.dynamic_stiffness.shape)
    joint = replace(
        balance.joint, structure=replace(structure, static_stiffness=stiffness, moving=DenseStiffness(np.array(same)))
    )
    balance = replace(balance, joint=joint)
    assert np.array_equal(stiffness_of_most(joint), stiffness)
    tangent = tangent_of(balance, 3.0 * predicted)
    assert np.count_nonzero((tangent.at.status_t == SLIP).any(axis=1)) > 4
    step = np.random.default_rng(6).normal(size=predicted.shape)
    found = factor_of(tangent).solve(tangent.apply(step))
    # but for its single precision, 6e-8
    assert np.linalg.norm(found - step) < 1e-5 * np.linalg.norm(step)
    # and is none of the identity
    assert np.linalg.norm(tangent.apply(step) - step) > 0.1 * np.linalg.norm(step)


def products(monkeypatch, tangent, right, accuracy):
    """Products with the Jacobian that a direction takes; its residual is checked."""
    counted = [0]
    plain = Linearisation.apply_roughly

    def apply(self, step):
        counted[0] += 1
        return plain(self, step)

    with monkeypatch.context() as patch:
        patch.setattr(Linearisation, "apply_roughly", apply)
        step = JacobianSolver().solve(tangent, right)
    assert np.linalg.norm(tangent.apply(step) - right) < accuracy * np.linalg.norm(right)
    return counted[0]


def test_a_dovetail_that_slips_and_opens_takes_few_products(monkeypatch):
    model = dovetail()
    omega = 2.0 * np.pi * 213.0
    joint = build_case(model, 0.5, omega, SETTINGS, Resolution(all_orders(13), 128)).joint(omega, 5.0)
    idle = np.zeros(model.contact.n_contact)
    balance = Balance(joint, np.zeros((model.contact.n_contact, 2)), idle)
    predicted = joint.structure.force_h()
    predicted[:, 1:3] = predicted[:, :1] * np.random.default_rng(1).normal(size=(joint.component_index.size, 2))
    tangent = tangent_of(balance, predicted)
    status = tangent.at.status_t
    assert all((status == one).any(axis=1).sum() >= 10 for one in (SEPARATED, SLIP))
    assert isinstance(build_factor(tangent), PeriodFactor)
    # free to slide as a whole: a right-hand side that can be reached
    right = tangent.apply(np.random.default_rng(2).normal(size=predicted.shape))
    found = products(monkeypatch, tangent, right, 2e-3)
    # 25 with the resonances of the structure taken into account
    assert found <= 30
    monkeypatch.setattr(linear_solver, "MOST_DIRECTIONS", 300)
    monkeypatch.setattr(linear_solver, "build_period_factor", lambda _: None)
    assert isinstance(build_factor(tangent), SlipFactor)
    assert found < 0.75 * products(monkeypatch, tangent, right, 0.1)


def test_a_kept_one_serves_states_nearby_and_the_sign_of_the_determinant(monkeypatch):
    monkeypatch.setattr(linear_solver, "DENSE_UNKNOWNS", 0)
    monkeypatch.setattr(linear_solver, "SMALL_JOINT", 0)
    balance, predicted = case(8, highest=5, samples=64)
    solver = JacobianSolver()
    random = np.random.default_rng(9)
    for _ in range(4):
        tangent = tangent_of(balance, predicted)
        right = random.normal(size=predicted.shape)
        step = solver.solve(tangent, right)
        assert np.linalg.norm(tangent.apply(step) - right) < 2e-3 * np.linalg.norm(right)
        dense = tangent.dense(np.arange(balance.joint.contact.n_contact))
        assert solver.determinant_sign(tangent) == np.linalg.slogdet(dense)[0]
        predicted = predicted * 1.05


def test_masses_on_sliders_are_left_to_the_slip_space():
    model = with_free_masses(random_model(10, ("3d", "3d"), 4), [0])
    balance, predicted = random_balance(model, SETTINGS, 10, wear=False)
    assert balance.joint.penalty.inertial.any()
    assert balance.joint.omega == OMEGA
    assert build_period_factor(tangent_of(balance, predicted)) is None
    assert isinstance(build_factor(tangent_of(balance, predicted)), SlipFactor)
