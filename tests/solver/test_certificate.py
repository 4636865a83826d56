"""Certificates: good states hold, their numbers fall as harmonics are added, and every broken state is caught."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from solver.accuracy.certificate import VIOLATION_LIMITS, Certificate, certify
from solver.harmonic_balance.dlft import Balance
from solver.results.state_report import evaluated
from solver.settings import SolverSettings
from solver.structure.joint import build_case
from tests.solver.models import OMEGA, branch_states, first_point, random_model, scene

TOLERANCE = SolverSettings().tolerance
GOOD = Certificate(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
SLIDER, TWO_MASSES = ("sdof_slider", 0.5, 10.0, 2 * np.pi * 160.0), ("two_masses", 0.5, 20.0, 0.4)
KINDS = ("3d", "constant_load", "one_tangent", "second_tangent", "normal_only", "constant_load_one_tangent")


@lru_cache
def on_branch(name, friction, amplitude, omega, n_harmonics, sweep="up"):
    """The state of a sweep, evaluated from what is stored of it: joint and evaluation."""
    model, settings = scene(name, n_harmonics), SolverSettings(n_harmonics, 256)
    (start,) = branch_states(model, friction, amplitude, [omega], settings, sweep)
    joint, state = build_case(model, friction, start.penalty_omega, settings).joint(omega, amplitude), start.state
    return joint, evaluated(joint, state)[1]


def vibro_impact(omega, n_harmonics, sweep="up"):
    """The upper branch is reached by a sweep up from below the bistable range."""
    return on_branch("vibro_impact", 0.0, 0.02, omega, n_harmonics, sweep)


@lru_cache
def random_state(seed, kinds=KINDS):
    """Elastic joint with pairs that stick, slip and open."""
    case = build_case(random_model(seed, kinds), 0.4, OMEGA, SolverSettings(5, 128))
    worn = np.random.default_rng(seed).uniform(0.0, 2e-6, len(kinds))
    return case.joint(OMEGA, 60.0), first_point(case, OMEGA, 60.0, worn).evaluation


def failing(joint, evaluation):
    return set(certify(joint, evaluation).failures(TOLERANCE))


@pytest.mark.slow
@pytest.mark.parametrize("n_harmonics", [3, 21])
def test_states_of_the_textbook_scenes_hold(n_harmonics):
    states = [on_branch(*SLIDER, n_harmonics), on_branch(*TWO_MASSES, n_harmonics)]
    states += [vibro_impact(1.2, n_harmonics), vibro_impact(1.5, n_harmonics), vibro_impact(1.2, n_harmonics, "down")]
    for state in states:
        assert not failing(*state)


@pytest.mark.slow
def test_penetration_falls_as_harmonics_are_added():
    values = [certify(*vibro_impact(1.2, n)).penetration for n in (3, 11, 21)]
    assert (np.diff(values) < 0.0).all()
    assert values[-1] < values[0] / 8.0


def test_a_force_that_jumps_does_not_violate_the_cone_however_its_series_overshoots():
    joint, evaluation = on_branch(*SLIDER, 21)
    limit = 0.5 * evaluation.force_t[0, 0].max()
    overshoot = np.abs(evaluation.force_h[0, 1] @ joint.basis.synthesis).max() / limit - 1.0
    assert overshoot > 0.1, "Gibbs"
    certificate = certify(joint, evaluation)
    assert certificate.cone_violation < 1e-12
    assert certificate.tension == 0.0


@pytest.mark.parametrize("state", [on_branch(*SLIDER, 5), random_state(1)], ids=["slider", "joint"])
def test_an_unconverged_force_and_friction_that_drives_are_caught(state):
    joint, evaluation = state
    balance = Balance(joint, evaluation.history, evaluation.wear_depth)
    noise = (
        1e-5 * np.abs(evaluation.predicted_h).max() * np.random.default_rng(0).normal(size=evaluation.predicted_h.shape)
    )
    assert "residual" in failing(joint, balance.evaluate(evaluation.predicted_h + noise))
    # the motion is made to fit the force, so that equilibrium alone would not tell
    turned = evaluation.force_h.copy()
    turned[:, 1:] *= -1.0
    moved = joint.to_relative(evaluation.displacement_h)
    left = joint.structure.force_h() - joint.to_relative(turned) - joint.structure.apply(moved)
    for i, stiffness in enumerate(joint.structure.dynamic_stiffness, 1):
        step = np.linalg.solve(stiffness, left[:, 2 * i - 1] - 1j * left[:, 2 * i])
        moved[:, 2 * i - 1] += step.real
        moved[:, 2 * i] -= step.imag
    moved[:, 0] += np.linalg.solve(joint.structure.static_stiffness, left[:, 0])
    failures = certify(joint, replace(evaluation, force_h=turned, displacement_h=joint.to_pairs(moved))).failures(
        TOLERANCE
    )
    assert "residual" not in failures
    assert failures["energy_error"][0] > 0.5


def test_a_slip_that_does_not_repeat_is_caught():
    joint, evaluation = random_state(1)
    slipping = int(np.argmax(evaluation.slip_work))
    state_t = evaluation.state_t.copy()
    limit = float(joint.friction_coefficient[0]) * evaluation.force_t[:, 0].max()
    state_t[slipping, 0] += 0.02 * limit * np.linspace(0.0, 1.0, state_t.shape[2])
    assert failing(joint, replace(evaluation, state_t=state_t)) == {"periodicity_error"}
    assert failing(joint, replace(evaluation, periodicity_error=0.02 * limit)) == {"periodicity_error"}


def test_a_pull_and_surfaces_in_each_other_are_caught():
    joint, evaluation = random_state(1)
    pulled = evaluation.force_t.copy()
    pulled[0, 0, 3] = -0.05 * pulled[:, 0].max()
    assert "tension" in failing(joint, replace(evaluation, force_t=pulled))
    force_h = evaluation.force_h.copy()
    force_h[0, 0] = 0.0
    force_h[0, 0, 1] = evaluation.force_t[:, 0].max()
    assert {"tension", "residual"} <= failing(joint, replace(evaluation, force_h=force_h))
    moved = np.linalg.norm(evaluation.displacement_h[:, :, 1:] @ joint.basis.synthesis[1:], axis=1).max()
    closer = evaluation.displacement_h.copy()
    closer[0, 0, 0] += 0.2 * moved
    assert "penetration" in failing(joint, replace(evaluation, displacement_h=closer))
    # worn depth and gap open the pair
    assert certify(joint, replace(evaluation, wear_depth=evaluation.wear_depth + moved)).penetration == 0.0


@pytest.mark.parametrize("name", ["residual", *VIOLATION_LIMITS])
def test_each_number_is_judged_and_named(name):
    limit = VIOLATION_LIMITS.get(name, 2.0 * TOLERANCE)
    assert replace(GOOD, **{name: limit}).holds(TOLERANCE)
    for wrong in (1.01 * limit, float("inf"), float("nan")):
        broken = replace(GOOD, **{name: wrong})
        assert not broken.holds(TOLERANCE)
        assert set(broken.failures(TOLERANCE)) == {name}
        assert broken.sentence(TOLERANCE).startswith(f"{name.replace('_', ' ')} {wrong:.2g}")
