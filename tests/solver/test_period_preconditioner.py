"""The march through the period that preconditions, against the contact law, plain solves and the exact Jacobian."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.contact.coulomb import SEPARATED, SLIP, STICK, contact_sample, sample_tangents
from solver.harmonic_balance.dlft import Balance, Linearisation
from solver.model import FloatArray
from solver.newton import linear_solver, period_preconditioner, preconditioner
from solver.newton.linear_solver import JacobianSolver
from solver.newton.options import NEWTON
from solver.newton.period_preconditioner import (
    PeriodFactor,
    build_march,
    build_period_factor,
    resonances,
    stiffness_of_most,
)
from solver.newton.preconditioner import SlipFactor, build_factor
from solver.settings import Resolution, SolverSettings, all_orders
from solver.structure.fourier import build_basis
from solver.structure.harmonic_stiffness import DenseStiffness
from solver.structure.joint import Joint, build_case
from tests.solver.models import OMEGA, dovetail, random_balance, random_model, with_free_masses

SETTINGS = SolverSettings(3, 24)
KINDS = ("3d", "constant_load", "normal_only", "3d", "one_tangent", "second_tangent", "3d", "3d")


def tangent_of(balance: Balance, predicted: FloatArray) -> Linearisation:
    return balance.linearise(balance.evaluate(predicted))


def case(seed: int, highest: int = 3, samples: int = 24, kinds: tuple[str, ...] = KINDS) -> tuple[Balance, FloatArray]:
    resolution = Resolution(all_orders(highest), samples)
    return random_balance(random_model(seed, kinds, 4), SETTINGS, seed, wear=False, resolution=resolution)


def factor_of(tangent: Linearisation) -> PeriodFactor:
    found = build_period_factor(tangent)
    assert found is not None
    return found


def states_at(joint: Joint, predicted: FloatArray, before: FloatArray) -> FloatArray:
    """State (n_contact, 3), N, behind one sample: predicted forces (n_contact, 3), tangential states (n_contact, 2)."""
    state = np.zeros_like(predicted)
    for pair in range(len(predicted)):
        normal, _, _, *tangents, _ = contact_sample(*predicted[pair], joint.friction_coefficient[pair], *before[pair])
        state[pair] = predicted[pair, 0] - normal, *tangents
    return state


@pytest.mark.slow
@pytest.mark.parametrize("stride", [1, 2])
def test_derivatives_at_a_sample_are_those_of_the_law(stride: int) -> None:
    balance, predicted = case(11)
    joint, at = balance.joint, balance.evaluate(predicted)
    own, carried = sample_tangents(
        at.predicted_t, joint.friction_coefficient, at.state_t, at.status_t, joint.has_normal, stride
    )
    assert own.shape[0] == at.status_t[:, ::stride].shape[1]
    assert set(at.status_t[:, ::stride].ravel()) == {SEPARATED, STICK, SLIP}
    random, checked = np.random.default_rng(2), 0
    for place, sample in enumerate(range(0, at.status_t.shape[1], stride)):
        now, before = at.predicted_t[:, :, sample], at.state_t[:, :, sample]
        step = random.normal(size=now.shape) * (joint.to_pairs(np.ones((joint.component_index.size, 1)))[:, :, 0])
        moved = random.normal(size=before.shape)
        ahead, behind = (states_at(joint, now + h * step, before + h * moved) for h in (1e-5, -1e-5))
        expected = np.einsum("pij,pj->pi", own[place], step)
        expected[:, 1:] += np.einsum("pij,pj->pi", carried[place], moved)
        # slip that begins again where it has ended lies at the corner itself
        margin = np.hypot(*(now[:, 1:] - before).T) - joint.friction_coefficient * now[:, 0]
        smooth = np.abs(margin) > 1e-3
        checked += smooth.sum()
        constant = ~joint.has_normal
        assert np.array_equal(expected[constant, 0], np.zeros(constant.sum()))
        assert np.allclose(((ahead - behind) / 2e-5)[smooth], expected[smooth], rtol=1e-6, atol=1e-6)
    assert checked > 0.9 * own.shape[0] * own.shape[1]


@pytest.mark.slow
def test_the_march_solves_what_it_says_sample_by_sample() -> None:
    balance, predicted = case(3)
    tangent = tangent_of(balance, predicted)
    found, joint = build_march(tangent), balance.joint
    n_samples, size = len(found.own), 3 * joint.contact.n_contact
    own, carried = sample_tangents(
        tangent.at.predicted_t,
        joint.friction_coefficient,
        tangent.at.state_t,
        tangent.at.status_t,
        joint.has_normal,
        joint.basis.n_samples // n_samples,
    )
    coupling = np.zeros((size, size))
    coupling[np.ix_(joint.component_index, joint.component_index)] = stiffness_of_most(joint) / joint.relative_penalty
    coupling[joint.component_index, joint.component_index] -= 1.0
    right = np.random.default_rng(4).normal(size=(joint.component_index.size, joint.basis.synthesis.shape[0]))
    right_t = (joint.to_pairs(right).reshape(size, -1) @ found.basis.synthesis).T
    state = np.zeros((size // 3, 3))
    slow = np.empty((2, n_samples, size))
    for _ in range(NEWTON.march_periods):
        for n in range(n_samples):
            # step and state as two unknowns, nothing eliminated, no pair left out
            whole = np.eye(2 * size)
            whole[:size, size:] = coupling
            held = np.zeros((size // 3, 3))
            for pair in range(size // 3):
                here = slice(3 * pair, 3 * pair + 3)
                whole[size:, :size][here, here] = -own[n, pair]
                held[pair, 1:] = carried[n, pair] @ state[pair, 1:]
            slow[:, n] = np.linalg.solve(whole, np.concatenate([right_t[n], held.ravel()])).reshape(2, size)
            state = slow[1, n].reshape(size // 3, 3)
    expected = [(part.T @ found.basis.analysis)[joint.component_index] for part in slow]
    for ours, theirs in zip(found.solve(right), expected, strict=True):
        # small systems are solved in single precision
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-5 * np.abs(theirs).max())


@pytest.mark.parametrize("seed", range(6))
def test_its_sign_is_that_of_its_matrix(seed: int) -> None:
    balance, predicted = case(seed, highest=3, samples=14)
    # a stiffness that is not positive definite, so that both signs come up
    random = np.random.default_rng(seed)
    predicted = predicted * random.uniform(0.5, 2.0, size=(len(predicted), 1))
    factor = factor_of(tangent_of(balance, predicted))
    matrix = [factor.solve(unit.reshape(predicted.shape)).ravel() for unit in np.eye(predicted.size)]
    assert factor.sign == np.linalg.slogdet(np.array(matrix))[0]


def differing(joint: Joint) -> FloatArray:
    """What the stiffnesses of the harmonics differ by, over the penalty: matrix over (displacement, harmonic)."""
    n_rel, m = joint.component_index.size, joint.basis.synthesis.shape[0]
    penalty = joint.penalty
    size = np.stack([penalty.normal, penalty.tangential, penalty.tangential], axis=1).ravel()[joint.component_index]
    matrix = np.zeros((n_rel * m, n_rel * m))
    for column, unit in enumerate(np.eye(n_rel * m).reshape(-1, n_rel, m)):
        motion = unit / size[:, None]
        matrix[:, column] = (joint.structure.apply(motion) - stiffness_of_most(joint) @ motion).ravel()
    return matrix


@pytest.mark.parametrize("nodal_diameter", [0, 3])
def test_resonances_are_the_large_singular_values_of_what_differs(nodal_diameter: int) -> None:
    model, omega = dovetail(5, nodal_diameter), 2.0 * np.pi * 213.0
    joint = build_case(model, 0.5, omega, SETTINGS, Resolution(all_orders(5), 64)).joint(omega, 5.0)
    whole = differing(joint)
    added, seen = resonances(joint)
    sizes = np.linalg.svd(whole, compute_uv=False)
    left = np.linalg.svd(whole - added.T @ seen, compute_uv=False)
    assert sizes[0] > 3.0 * NEWTON.resonant_difference
    # where more directions differ than are looked for some are left
    most = NEWTON.resonant_difference * (1.0 if nodal_diameter == 0 else 1.3)
    assert left[0] < 1.01 * most
    assert 0 < len(seen) <= np.count_nonzero(sizes > NEWTON.resonant_difference)


def test_the_harmonics_that_differ_are_taken_in_exactly(monkeypatch: pytest.MonkeyPatch) -> None:
    # with every direction and nothing cut off it is the inverse, whatever the harmonics see
    everything = replace(NEWTON, resonant_difference=1e-9, resonances=100)
    monkeypatch.setattr(period_preconditioner, "NEWTON", everything)
    balance, predicted = case(5, highest=12, samples=25, kinds=("constant_load_one_tangent",) * 9)
    tangent = tangent_of(balance, 3.0 * predicted)
    step = np.random.default_rng(6).normal(size=predicted.shape)
    factor_found = factor_of(tangent)
    found = factor_found.solve(tangent.apply(step))
    assert np.linalg.norm(found - step) < 1e-6 * np.linalg.norm(step)
    without = factor_found.march.solve(tangent.apply(step))[0]
    assert np.linalg.norm(without - step) > 1e-2 * np.linalg.norm(step)


def test_it_is_the_inverse_where_nothing_is_cut_off_and_all_harmonics_see_one_stiffness() -> None:
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


def test_no_more_samples_are_marched_than_tell_the_harmonics_apart() -> None:
    for highest, samples, marched in ((3, 24, 12), (5, 64, 16), (12, 25, 25), (7, 30, 15)):
        balance, predicted = case(7, highest, samples)
        found = build_march(tangent_of(balance, predicted))
        assert len(found.own) == marched
        assert found.basis is build_basis(all_orders(highest), marched)


def products(monkeypatch: pytest.MonkeyPatch, tangent: Linearisation, right: FloatArray, accuracy: float) -> int:
    """Products with the Jacobian that a direction takes; its residual is checked."""
    counted = [0]
    plain = Linearisation.apply_roughly

    def apply(self: Linearisation, step: FloatArray) -> FloatArray:
        counted[0] += 1
        return plain(self, step)

    with monkeypatch.context() as patch:
        patch.setattr(Linearisation, "apply_roughly", apply)
        step = JacobianSolver().solve(tangent, right)
    assert np.linalg.norm(tangent.apply(step) - right) < accuracy * np.linalg.norm(right)
    return counted[0]


@pytest.fixture
def large_slip_space(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every slip space is too large to be factorised."""
    monkeypatch.setattr(preconditioner, "worthwhile_directions", lambda _: 0)


@pytest.mark.usefixtures("large_slip_space")
def test_a_dovetail_that_slips_and_opens_takes_few_products(monkeypatch: pytest.MonkeyPatch) -> None:
    model = dovetail()
    omega = 2.0 * np.pi * 213.0
    joint = build_case(model, 0.5, omega, SETTINGS, Resolution(all_orders(13), 128)).joint(omega, 5.0)
    idle = np.zeros(model.contact.n_contact)
    balance = Balance.frozen(joint, np.zeros((model.contact.n_contact, 2)), idle)
    predicted = joint.structure.force_h()
    predicted[:, 1:3] = predicted[:, :1] * np.random.default_rng(1).normal(size=(joint.component_index.size, 2))
    tangent = tangent_of(balance, predicted)
    status = tangent.at.status_t
    assert all((status == one).any(axis=1).sum() >= 10 for one in (SEPARATED, SLIP))
    assert isinstance(build_factor(tangent), PeriodFactor)
    # free to slide as a whole: a right-hand side that can be reached
    right = tangent.apply(np.random.default_rng(2).normal(size=predicted.shape))
    found = products(monkeypatch, tangent, right, 2e-3)
    assert found <= 25
    monkeypatch.setattr(preconditioner, "NEWTON", replace(NEWTON, most_directions=300))
    monkeypatch.setattr(preconditioner, "build_period_factor", lambda _: None)
    assert isinstance(build_factor(tangent), SlipFactor)
    assert found < 0.75 * products(monkeypatch, tangent, right, 0.1)


@pytest.mark.usefixtures("large_slip_space")
def test_a_kept_one_serves_states_nearby_and_the_sign_of_the_determinant(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(linear_solver, "is_dense_cheapest", lambda *_: False)
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


def test_masses_on_sliders_are_left_to_the_slip_space() -> None:
    model = with_free_masses(random_model(10, ("3d", "3d"), 4), [0])
    balance, predicted = random_balance(model, SETTINGS, 10, wear=False)
    assert balance.joint.penalty.inertial.any()
    assert balance.joint.omega == OMEGA
    assert build_period_factor(tangent_of(balance, predicted)) is None
    assert isinstance(build_factor(tangent_of(balance, predicted)), SlipFactor)
