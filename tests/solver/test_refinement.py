"""Certificates: good states hold, broken ones are caught; how states choose harmonics and samples; their estimates."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from solver.accuracy import refinement
from solver.accuracy.certificate import certify
from solver.accuracy.refinement import refine
from solver.accuracy.resolved_state import Estimate, ResolvedState
from solver.contact.coulomb import SLIP, STICK
from solver.harmonic_balance.dlft import Balance
from solver.newton.run import Run
from solver.settings import Resolution, SolverSettings, all_orders
from solver.structure.fourier import from_complex, to_complex
from tests.solver.models import ALL_KINDS, OMEGA, case_of, first_point, random_model, scene, state_at, worn_state

TOLERANCE = SolverSettings().tolerance
SLIDER = ("sdof_slider", 0.5, 10.0, 2 * np.pi * 160.0)


@lru_cache
def on_branch(name, friction, amplitude, omega, n_harmonics):
    """The state of a sweep up, evaluated from what is stored of it: joint and evaluation."""
    settings = SolverSettings(n_harmonics, 256)
    _, case, state = state_at(scene(name, n_harmonics), friction, amplitude, omega, settings)
    return state.joint(case), state.evaluation


@lru_cache
def random_state():
    joint, state = worn_state(ALL_KINDS, SolverSettings(5, 128))
    return joint, state.evaluation


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


@pytest.mark.parametrize("name", ["slider", "joint"])
def test_an_unconverged_force_and_friction_that_drives_are_caught(name):
    joint, evaluation = on_branch(*SLIDER, 5) if name == "slider" else random_state()
    balance = Balance(joint, evaluation.start_history, evaluation.wear_depth)
    predicted = evaluation.predicted_h
    noise = 1e-5 * np.abs(predicted).max() * np.random.default_rng(0).normal(size=predicted.shape)
    certificate = certify(joint, balance.evaluate(predicted + noise))
    assert certificate.sentence(TOLERANCE).startswith("residual ")
    # the motion is made to fit the force, so that equilibrium alone would not tell
    turned = evaluation.force_h.copy()
    turned[:, 1:] *= -1.0
    moved = joint.to_relative(evaluation.displacement_h)
    left = joint.structure.force_h - joint.to_relative(turned) - joint.structure.apply(moved)
    steps = np.linalg.solve(joint.structure.dynamic_stiffness, to_complex(left).T[:, :, None])[:, :, 0].T
    moved += from_complex(np.linalg.solve(joint.structure.static_stiffness, left[:, 0]), steps)
    other = replace(evaluation, force_h=turned, displacement_h=joint.to_pairs(moved))
    failures = certify(joint, other).failures(TOLERANCE)
    assert "residual" not in failures
    assert failures["energy_error"][0] > 0.5


def test_a_slip_that_does_not_repeat_is_caught():
    joint, evaluation = random_state()
    slipping = int(np.argmax(evaluation.slip_work))
    state_t = evaluation.state_t.copy()
    limit = float(joint.contact.friction[0]) * evaluation.force_t[:, 0].max()
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


def started(model, friction, omega, amplitude, settings, resolution=None):
    """A state found from nothing."""
    case = case_of(model, friction, omega, settings, resolution)
    return ResolvedState(case, first_point(case, omega, amplitude))


def slider(settings, resolution=None):
    return started(scene("sdof_slider", normal_stiffness=0.0), 0.5, SLIDER_OMEGA, 10.0, settings, resolution)


def refined_of(level):
    """What the refinement of a state comes to."""
    return refine(level, Run(level.case.settings.tolerance))


def test_a_state_that_is_the_same_both_ways_goes_on_without_even_harmonics():
    level = slider(SolverSettings())
    assert level.case.resolution.orders == (1, 2, 3)
    found = refined_of(level)
    orders = found.case.resolution.orders
    assert len(orders) > 1
    assert orders == tuple(range(1, orders[-1] + 1, 2))
    # nothing is lost: with all harmonics it is the same state
    whole = found.solve_at(Resolution(all_orders(orders[-1]), found.case.resolution.samples), Run(TOLERANCE))
    assert whole.response() == pytest.approx(found.response(), rel=1e-6)


def test_an_error_that_is_no_number_is_not_known():
    assert Estimate(0.1, float("nan")).largest == float("inf")
    assert Estimate(0.1, 0.1).larger(Estimate(float("nan"), 0.2)) == Estimate(float("inf"), 0.2)


def test_a_stuck_state_keeps_the_first_harmonic_alone():
    level = started(random_model(1), 0.4, OMEGA, 1e-2, SolverSettings())
    # the second solve starts from where the first one slipped to: everything sticks
    again = level.solve_at(level.case.resolution, Run(TOLERANCE))
    assert (again.point.evaluation.status_t == STICK).all()
    found = refined_of(again)
    assert found.case.resolution == Resolution((1,), level.case.resolution.samples)
    assert found.estimate == Estimate(0.0, 0.0)
    assert found.accurate
    assert not found.point.evaluation.slip_work.any()
    assert found.response() == pytest.approx(again.response(), rel=1e-7)


@pytest.mark.parametrize(("name", "most"), [("MOST_SAMPLES", 64), ("NODE_UNKNOWNS", 5)])
def test_a_state_that_is_not_allowed_what_it_needs_says_so(name, most, monkeypatch):
    monkeypatch.setattr(refinement, name, most)
    found = refined_of(slider(SolverSettings(rtol=1e-4)))
    assert not found.accurate
    assert found.estimate.largest > 1e-4
    assert found.point.evaluation.scaled_residual() <= 1e-8
    # no more than it began with
    unknowns = found.point.evaluation.predicted_h.size
    assert found.case.resolution.samples <= 64 if name == "MOST_SAMPLES" else unknowns <= 7


def test_more_samples_than_are_allowed_do_not_keep_the_harmonics_from_a_state(monkeypatch):
    """Both are wanted at once: nodes of the dovetail had 13 harmonics and an error of 4 % with `rtol` 1e-3."""
    monkeypatch.setattr(refinement, "MOST_SAMPLES", 64)
    assert refined_of(slider(SolverSettings(rtol=1e-4))).case.resolution.highest == 5


def test_given_samples_limit_the_harmonics():
    found = refined_of(slider(SolverSettings(samples=32, rtol=1e-4)))
    assert found.case.resolution.samples == 32 > 2 * found.case.resolution.highest
    assert not found.accurate


def test_a_state_far_better_than_needed_goes_down_to_fewer():
    rich = slider(SolverSettings(rtol=0.05), Resolution((1, 3, 5, 7, 9), 256))
    found = refined_of(rich)
    assert found.accurate
    assert found.case.resolution == Resolution((1, 3), 64)
    error = abs(found.response() / rich.response() - 1.0).max()
    assert 0.5 * error <= found.estimate.response <= 0.025


@pytest.mark.slow
@pytest.mark.parametrize(("amplitude", "rtol", "highest"), [(100.0, 1e-2, 25), (200.0, 1e-3, 115)])
def test_estimates_of_elastic_joints_are_at_least_half_the_error(amplitude, rtol, highest):
    """Against the same state with far more harmonics and samples."""
    # constant normal loads: with impacts as well, states have too many neighbours
    kinds = ("constant_load", "constant_load_one_tangent", "constant_load")
    level = started(random_model(4, kinds), 0.4, OMEGA, amplitude, SolverSettings(rtol=rtol))
    assert SLIP in level.point.evaluation.status_t
    assert not level.case.penalty.inertial.any()
    found = refined_of(level)
    assert found.accurate
    assert highest > found.case.resolution.highest
    best = found
    for each in (25, highest):
        best = best.solve_at(Resolution(all_orders(each), 4096), Run(TOLERANCE))
    apart = np.linalg.norm(found.response() - best.response()) / np.linalg.norm(best.response())
    response = max(float(apart), float(np.abs(found.peaks / best.peaks - 1.0).max()))
    works = [float(each.point.evaluation.slip_work.sum()) for each in (found, best)]
    assert 1e-6 < response <= min(rtol, 2.0 * found.estimate.response)
    assert abs(works[0] / works[1] - 1.0) <= min(rtol, 2.0 * found.estimate.wear_rate)


def test_a_state_of_odd_harmonics_takes_even_ones_again_where_its_forces_have_them():
    # as after a state so faint that it looked symmetric: with odd harmonics alone friction exceeds its limit
    model, resolution = random_model(1, ("3d", "one_tangent")), Resolution(all_orders(9), 128)
    whole = started(model, 0.4, OMEGA, SLIPPING, SolverSettings(), resolution)
    odd = whole.solve_at(Resolution((1, 3, 5, 7, 9), 128), Run(TOLERANCE))
    assert certify(odd.joint, odd.point.evaluation).cone_violation > 0.01
    found = refined_of(odd)
    assert 2 in found.case.resolution.orders
    assert found.holds()
