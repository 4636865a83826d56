"""Certificates: good states hold, broken ones are caught; how states choose harmonics and samples; their estimates."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from solver.accuracy import refinement
from solver.accuracy.certificate import certify
from solver.accuracy.error_estimate import Estimate
from solver.accuracy.refinement import refine
from solver.contact.coulomb import SLIP, STICK
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State, final_history, largest_responses, transfer
from solver.newton.run import Run
from solver.results.state_report import evaluated
from solver.settings import Resolution, SolverSettings, all_orders
from solver.structure.fourier import to_complex
from solver.structure.joint import build_case
from tests.solver.models import OMEGA, branch_states, first_point, random_model, scene

# --- certificates ---


TOLERANCE = SolverSettings().tolerance
SLIDER = ("sdof_slider", 0.5, 10.0, 2 * np.pi * 160.0)
ALL_KINDS = ("3d", "constant_load", "one_tangent", "second_tangent", "normal_only", "constant_load_one_tangent")


@lru_cache
def on_branch(name, friction, amplitude, omega, n_harmonics):
    """The state of a sweep up, evaluated from what is stored of it: joint and evaluation."""
    model, settings = scene(name, n_harmonics), SolverSettings(n_harmonics, 256)
    (start,) = branch_states(model, friction, amplitude, [omega], settings)
    joint = build_case(model, friction, start.penalty_omega, settings).joint(omega, amplitude)
    return joint, evaluated(joint, start.state)[1]


@lru_cache
def random_state():
    """Elastic joint with pairs that stick, slip and open."""
    case = build_case(random_model(1, ALL_KINDS), 0.4, OMEGA, SolverSettings(5, 128))
    worn = np.random.default_rng(1).uniform(0.0, 2e-6, len(ALL_KINDS))
    return case.joint(OMEGA, 60.0), first_point(case, OMEGA, 60.0, worn).evaluation


def failing(joint, evaluation):
    return set(certify(joint, evaluation).failures(TOLERANCE))


@pytest.mark.slow
def test_states_of_the_textbook_scenes_hold_and_penetration_falls_as_harmonics_are_added():
    assert not failing(*on_branch("two_masses", 0.5, 20.0, 0.4, 3))
    wall = [on_branch("vibro_impact", 0.0, 0.02, 1.2, n) for n in (3, 11, 21)]
    assert not any(failing(*state) for state in wall)
    values = [certify(*state).penetration for state in wall]
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


@pytest.mark.parametrize("state", [on_branch(*SLIDER, 5), random_state()], ids=["slider", "joint"])
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
    joint, evaluation = random_state()
    slipping = int(np.argmax(evaluation.slip_work))
    state_t = evaluation.state_t.copy()
    limit = float(joint.friction_coefficient[0]) * evaluation.force_t[:, 0].max()
    state_t[slipping, 0] += 0.02 * limit * np.linspace(0.0, 1.0, state_t.shape[2])
    assert failing(joint, replace(evaluation, state_t=state_t)) == {"periodicity_error"}
    assert failing(joint, replace(evaluation, periodicity_error=0.02 * limit)) == {"periodicity_error"}


def test_a_pull_and_surfaces_in_each_other_are_caught():
    joint, evaluation = random_state()
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


# --- refinement ---


SLIDER_OMEGA = 0.6 * float(np.sqrt(1.6e6))
SLIPPING = 400.0  # N: excitation at which the pairs of the random models slip
FRICTION = 0.4


def started(model, friction, omega, amplitude, settings, resolution=None):
    case = build_case(model, friction, omega, settings, resolution)
    return case, first_point(case, omega, amplitude, np.zeros(model.contact.n_contact))


def slider(settings, force=10.0):
    return started(scene("sdof_slider", normal_stiffness=0.0), 0.5, SLIDER_OMEGA, force, settings)


def solved_at(case, omega, amplitude, point, resolution):
    """The same state with other harmonics and samples, which must be found."""
    other = case.at(resolution)
    balance, start = transfer(case, other.joint(omega, amplitude), point.evaluation)
    result = Run(case.settings.tolerance).solve(balance, start, 60)
    assert result.converged
    return State(result.evaluation, final_history(balance, result.evaluation), point.parameter)


def response(case, omega, amplitude, point):
    joint = case.joint(omega, amplitude)
    return to_complex(joint.structure.response_h(joint.to_relative(point.evaluation.displacement_h)))[:, 0]


def refined_of(case, omega, amplitude, point):
    return refine(case, omega, amplitude, point, Run(case.settings.tolerance))


def test_a_state_that_is_the_same_both_ways_goes_on_without_even_harmonics():
    case, point = slider(SolverSettings())
    assert case.resolution.orders == (1, 2, 3)
    refined = refined_of(case, SLIDER_OMEGA, 10.0, point)
    orders, samples = refined.case.resolution.orders, refined.case.resolution.samples
    assert len(orders) > 1
    assert orders == tuple(range(1, orders[-1] + 1, 2))
    # nothing is lost: with all harmonics it is the same state
    whole = Resolution(all_orders(orders[-1]), samples)
    every = solved_at(refined.case, SLIDER_OMEGA, 10.0, refined.point, whole)
    ours = response(refined.case, SLIDER_OMEGA, 10.0, refined.point)
    assert response(refined.case.at(whole), SLIDER_OMEGA, 10.0, every) == pytest.approx(ours, rel=1e-6)


def test_a_state_with_even_harmonics_keeps_them():
    case, point = started(random_model(2), FRICTION, OMEGA, SLIPPING, SolverSettings())
    orders = refined_of(case, OMEGA, SLIPPING, point).case.resolution.orders
    assert orders == all_orders(orders[-1])
    assert 2 in orders


def test_a_stuck_state_keeps_the_first_harmonic_alone():
    amplitude = 1e-2
    case, point = started(random_model(1), FRICTION, OMEGA, amplitude, SolverSettings())
    # the second solve starts from where the first one slipped to: everything sticks
    again = solved_at(case, OMEGA, amplitude, State(point.evaluation, point.history, 1.0), case.resolution)
    assert (again.evaluation.status_t == STICK).all()
    refined = refined_of(case, OMEGA, amplitude, again)
    assert refined.case.resolution == Resolution((1,), case.resolution.samples)
    assert refined.estimate == Estimate(0.0, 0.0)
    assert refined.accurate
    assert not refined.point.evaluation.slip_work.any()
    assert response(refined.case, OMEGA, amplitude, refined.point) == pytest.approx(
        response(case, OMEGA, amplitude, again), rel=1e-7
    )


@pytest.mark.parametrize(("name", "most"), [("MOST_SAMPLES", 64), ("NODE_UNKNOWNS", 5)])
def test_a_state_that_is_not_allowed_what_it_needs_says_so(name, most, monkeypatch):
    case, point = slider(SolverSettings(rtol=1e-4))
    monkeypatch.setattr(refinement, name, most)
    refined = refined_of(case, SLIDER_OMEGA, 10.0, point)
    assert not refined.accurate
    assert refined.estimate.largest > 1e-4
    assert refined.point.evaluation.scaled_residual() <= 1e-8
    resolution = refined.case.resolution
    # no more than it began with
    assert resolution.samples <= 64 if name == "MOST_SAMPLES" else refined.point.evaluation.predicted_h.size <= 7


def test_a_state_far_better_than_needed_goes_down_to_fewer():
    model = scene("sdof_slider", normal_stiffness=0.0)
    settings, rich = SolverSettings(rtol=0.05), Resolution((1, 3, 5, 7, 9), 256)
    case, point = started(model, 0.5, SLIDER_OMEGA, 10.0, settings, rich)
    refined = refined_of(case, SLIDER_OMEGA, 10.0, point)
    assert refined.accurate
    assert refined.case.resolution == Resolution((1, 3), 64)
    exact = response(case, SLIDER_OMEGA, 10.0, point)
    error = abs(response(refined.case, SLIDER_OMEGA, 10.0, refined.point) / exact - 1.0).max()
    assert 0.5 * error <= refined.estimate.response <= 0.5 * settings.rtol


# constant normal loads: with impacts as well, states of a random model have too many neighbours to be told apart
KINDS: Sequence[str] = ("constant_load", "constant_load_one_tangent", "constant_load")


def true_error(refined, amplitude, fine):
    """Error against the same state with far more harmonics and samples."""
    best, at = refined.point, refined.case
    for step in (Resolution(all_orders(25), 4096), fine):
        if step.highest > at.resolution.highest:
            best, at = solved_at(at, OMEGA, amplitude, best, step), at.at(step)
    both = ((refined.case, refined.point), (at, best))
    own, exact = (response(case, OMEGA, amplitude, point) for case, point in both)
    peak, its_peak = (largest_responses(case.joint(OMEGA, amplitude), point.evaluation) for case, point in both)
    error = max(float(np.linalg.norm(own - exact) / np.linalg.norm(exact)), float(np.abs(peak / its_peak - 1.0).max()))
    work, its_work = (float(point.evaluation.slip_work.sum()) for _, point in both)
    return Estimate(error, abs(work / its_work - 1.0) if its_work else 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(("amplitude", "rtol", "fine"), [(100.0, 1e-2, 25), (200.0, 1e-3, 115)])
def test_estimates_of_elastic_joints_are_at_least_half_the_error(amplitude, rtol, fine):
    case, point = started(random_model(4, KINDS), FRICTION, OMEGA, amplitude, SolverSettings(rtol=rtol))
    assert SLIP in point.evaluation.status_t
    assert not case.penalty.inertial.any()
    refined = refined_of(case, OMEGA, amplitude, point)
    assert refined.accurate
    assert fine > refined.case.resolution.highest
    error = true_error(refined, amplitude, Resolution(all_orders(fine), 4096))
    assert 1e-6 < error.response <= min(rtol, 2.0 * refined.estimate.response)
    assert error.wear_rate <= min(rtol, 2.0 * refined.estimate.wear_rate)


def test_a_state_of_odd_harmonics_takes_even_ones_again_where_its_forces_have_them():
    # as after a state so faint that it looked symmetric: with odd harmonics alone friction exceeds its limit
    model, settings = random_model(1, ("3d", "one_tangent")), SolverSettings()
    case, whole = started(model, FRICTION, OMEGA, SLIPPING, settings, Resolution(all_orders(9), 128))
    odd = case.at(Resolution((1, 3, 5, 7, 9), 128))
    point = solved_at(case, OMEGA, SLIPPING, whole, odd.resolution)
    assert certify(odd.joint(OMEGA, SLIPPING), point.evaluation).cone_violation > 0.01
    refined = refined_of(odd, OMEGA, SLIPPING, point)
    assert 2 in refined.case.resolution.orders
    assert certify(refined.case.joint(OMEGA, SLIPPING), refined.point.evaluation).holds(settings.tolerance)
