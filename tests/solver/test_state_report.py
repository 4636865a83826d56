"""Static and periodic states against equilibrium, the contact law and the energy; reports against time signals."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from solver.accuracy.certificate import certify
from solver.continuation.first_state import solve_static_state
from solver.newton.run import Run
from solver.results.state_report import periodic_state, report_state
from solver.settings import FINE_SAMPLES, SolverSettings, all_orders
from solver.structure.fourier import build_basis
from solver.structure.joint import build_case
from tests.solver.contact_twin import pair_period
from tests.solver.models import OMEGA, first_point, random_model
from tests.solver.reconstruction import contact_work, full_motion, series

FRICTION = 0.4
AMPLITUDE = 60.0
SETTINGS = SolverSettings(harmonics=3, samples=64, tolerance=1e-10)
KINDS = {
    "3d": ("3d", "3d", "3d"),
    "mixed": ("3d", "constant_load", "one_tangent", "second_tangent", "normal_only", "constant_load_one_tangent"),
}


def case_of(kinds, seed):
    return build_case(random_model(seed, KINDS[kinds]), FRICTION, OMEGA, SETTINGS)


@lru_cache
def periodic(kinds, seed):
    case = case_of(kinds, seed)
    worn = np.random.default_rng(seed).uniform(0.0, 2e-6, case.model.contact.n_contact)
    point = first_point(case, OMEGA, AMPLITUDE, worn)
    joint = case.joint(OMEGA, AMPLITUDE)
    return joint, point, periodic_state(joint, point)


def static_point(case, wear_depth, tolerance=1e-10):
    point = solve_static_state(case.joint(OMEGA, 0.0), wear_depth, Run(tolerance))
    assert point is not None
    return point


def check_static(model, evaluation, friction):
    """Equilibrium of the full structure, Signorini and Coulomb, in displacements and forces."""
    contact, linear = model.contact, model.linear[0]
    force, moved = evaluation.force_h[:, :, 0], evaluation.displacement_h[:, :, 0]
    exists = contact.dofs >= 0
    relative = contact.dofs[exists]
    inner = np.setdiff1d(np.arange(linear.stiffness.shape[0]), relative)
    solved = np.zeros(linear.stiffness.shape[0])
    solved[relative] = moved[exists]
    load = linear.load_static.copy()
    load[relative] -= force[exists]
    # the relative displacements are given: a free blade may slide along its root without resistance
    solved[inner] = np.linalg.solve(linear.stiffness[np.ix_(inner, inner)], (load - linear.stiffness @ solved)[inner])
    assert np.abs(linear.stiffness @ solved - load).max() < 1e-8 * np.abs(force).max()
    length = np.abs(solved).max()
    closing = exists[:, 0]
    opening = contact.gap + evaluation.wear_depth - moved[:, 0]
    assert (force[:, 0] >= 0).all()
    assert (opening[closing] >= -1e-12 * length).all()
    assert np.abs((force[:, 0] * opening)[closing]).max(initial=0.0) <= 1e-10 * length * force.max()
    assert force[~closing, 0] == pytest.approx(contact.normal_load[~closing], rel=1e-15, abs=0.0)
    assert (np.hypot(force[:, 1], force[:, 2]) <= friction * force[:, 0] * (1 + 1e-14)).all()


@pytest.mark.parametrize("kinds", KINDS)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_static_state_is_in_equilibrium_and_obeys_the_contact_law(kinds, seed):
    case = case_of(kinds, seed)
    n_contact = case.model.contact.n_contact
    worn = np.random.default_rng(seed).uniform(0.0, 4e-5, n_contact)
    for depth in (np.zeros(n_contact), worn):
        check_static(case.model, static_point(case, depth).evaluation, FRICTION)


@pytest.mark.parametrize("kinds", KINDS)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_periodic_state_is_in_equilibrium_in_every_harmonic(kinds, seed):
    _, point, state = periodic(kinds, seed)
    assert point.parameter == 1.0
    motion = full_motion(case_of(kinds, seed).model, state)
    # the static harmonic is among them: mean forces balance
    assert max(motion.imbalance) < 1e-8 * motion.force
    assert state.omega == OMEGA
    assert state.excitation_amplitude == AMPLITUDE
    assert np.array_equal(state.start_history, point.evaluation.history)


@pytest.mark.parametrize("kinds", KINDS)
@pytest.mark.parametrize("seed", [1, 2])
def test_the_excitation_works_as_much_as_damping_and_friction_take(kinds, seed):
    joint, _, state = periodic(kinds, seed)
    model = case_of(kinds, seed).model
    motion = full_motion(model, state)
    penalty = joint.penalty
    assert not penalty.inertial.any()
    # the contact force from the plain law alone, from what the state stores
    moved = state.displacement_h.copy()
    moved[:, 0, 0] -= model.contact.gap + state.wear_depth
    eps = np.column_stack([penalty.normal, penalty.tangential, penalty.tangential])
    predicted_h = state.contact_force_h + eps[:, :, None] * moved
    predicted_h[model.contact.dofs[:, 0] < 0, 0, 1:] = 0.0
    predicted_t = series(predicted_h, SETTINGS.samples)
    forces = np.array(
        [
            pair_period(predicted_t[pair], FRICTION, penalty.tangential[pair] * state.start_history[pair], 8)[0]
            for pair in range(model.contact.n_contact)
        ]
    )
    size = np.abs(state.contact_force_h).max()
    assert forces[:, 1:] @ joint.basis.analysis == pytest.approx(state.contact_force_h[:, 1:], abs=1e-9 * size)
    # normal forces are averaged up to the instant of opening: near those of 64 times the samples, Eq. (11)
    many = np.maximum(series(predicted_h[:, 0], 64 * SETTINGS.samples), 0.0)
    exact = many @ build_basis(all_orders(SETTINGS.harmonics), many.shape[1]).analysis
    kink = np.abs(np.diff(predicted_t[:, 0])).max()
    assert np.abs(state.contact_force_h[:, 0] - exact).max() < 4 * kink / SETTINGS.samples
    forces[:, 0] = series(state.contact_force_h[:, 0], SETTINGS.samples)
    work, viscous, friction = motion.excitation_work(), motion.viscous_work(), contact_work(state, forces)
    assert friction > 0.01 * work
    assert work == pytest.approx(viscous + friction, rel=1e-6, abs=0.0)


@pytest.mark.parametrize("kinds", KINDS)
def test_the_report_is_that_of_the_time_signals(kinds):
    joint, point, state = periodic(kinds, 1)
    report = report_state(joint, point.evaluation, certify(joint, point.evaluation))
    model = case_of(kinds, 1).model
    at = point.evaluation
    motion = full_motion(model, state)
    assert report["response"] == pytest.approx(motion.response(), rel=1e-8, abs=0.0)
    static = np.real(model.linear[0].response @ motion.displacement[0])
    phase = 2 * np.pi * np.arange(FINE_SAMPLES) / FINE_SAMPLES
    waves = sum(np.real(motion.response(n)[:, None] * np.exp(1j * n * phase)) for n in (1, 2, 3))
    assert report["response_peak"] == pytest.approx(np.abs(static[:, None] + waves).max(axis=1), rel=1e-8, abs=0.0)
    assert report["mean_pressure"] == pytest.approx(
        state.contact_force_h[:, 0, 0] / model.contact.area, rel=1e-12, abs=0.0
    )
    assert report["open_fraction"] == pytest.approx((at.force_t[:, 0] == 0).mean(axis=1))
    slip = at.state_t / joint.penalty.tangential[:, None, None]
    for pair in range(model.contact.n_contact):
        distances = np.linalg.norm(slip[pair, :, :, None] - slip[pair, :, None, :], axis=0)
        assert report["slip_range"][pair] == pytest.approx(distances.max(), rel=1e-12, abs=1e-20)
        steps = np.linalg.norm(np.diff(slip[pair]), axis=0)
        pressure = 0.5 * (at.force_t[pair, 0] + np.roll(at.force_t[pair, 0], 1))
        assert at.slip_work[pair] == pytest.approx(steps @ pressure, rel=1e-12, abs=1e-20)


def test_a_structure_that_only_friction_holds_slides_until_its_weak_springs_carry_the_rest():
    model = random_model(7, ("constant_load", "constant_load"), n_inner=0)
    linear = model.linear[0]
    loose = replace(linear, stiffness=1e-6 * linear.stiffness, load_static=np.full(4, 1e4))
    case = build_case(replace(model, linear={0: loose}), FRICTION, OMEGA, SETTINGS)
    evaluation = static_point(case, np.zeros(2)).evaluation
    check_static(case.model, evaluation, FRICTION)
    force = evaluation.force_h[:, :, 0]
    assert np.hypot(force[:, 1], force[:, 2]) == pytest.approx(
        FRICTION * case.model.contact.normal_load, rel=1e-9, abs=0.0
    )
