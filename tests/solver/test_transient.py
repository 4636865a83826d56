"""Relaxation in time: steps against the exact motion, states behind a fold against exact branches."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from solver.continuation import transient
from solver.continuation.arc_length import Arc
from solver.continuation.natural import NEAR_ITERATIONS
from solver.continuation.transient import Motion, Transient, relax_to_periodic
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State
from solver.newton.run import Budget, Run
from solver.outcome import Outcome
from solver.results.state_report import periodic_state
from solver.settings import SolverSettings
from solver.structure.joint import build_case
from tests.references import coulomb_orbit
from tests.solver.models import converged_state, crossings, first_point, scene
from tests.solver.reconstruction import full_motion
from tests.solver.test_natural import WALL_OMEGA, wall

FORCE = 0.02
NATURAL = np.sqrt(1.6e6)


@pytest.mark.parametrize("omega", [0.3, 0.6, 1.3])
def test_two_masses_relax_from_rest_to_their_exact_motion(omega):
    orbit = coulomb_orbit([[1, 0], [0, 1]], [[0.04, -0.02], [-0.02, 0.02]], [[2, -1], [-1, 1]], [20, 0], 1, 7.2, omega)
    case, idle = build_case(scene("two_masses"), 0.5, omega, SolverSettings(21, 256)), np.zeros(1)
    rest = first_point(case, omega, 0.0, idle)
    quiet, joint = case.joint(omega, 0.0), case.joint(omega, 20.0)
    found = relax_to_periodic(case, joint, idle, rest, quiet, Run(1e-8))
    moved = np.abs(full_motion(case.model, periodic_state(joint, found)).displacement[1])
    assert moved == pytest.approx([abs(orbit.harmonic(dof)) for dof in (0, 1)], rel=0.02, abs=0.0)


def upper_state(case, omega):
    """Vibro-impact on the branch with impacts."""
    state = converged_state(case.model, 0.0, FORCE, omega, case.settings)
    idle = np.zeros(1)
    balance = Balance(case.joint(omega, FORCE), state.start_history, idle)
    at = balance.evaluate(balance.predict(state.displacement_h, state.contact_force_h))
    assert np.abs(state.contact_force_h).max() > 1e-2
    return State(at, state.start_history, omega)


@pytest.mark.slow
@pytest.mark.parametrize("omega", [1.56, 1.60])
def test_behind_the_fold_the_mass_falls_on_the_branch_without_impacts(omega):
    # the branch with impacts ends at 1.5576 rad/s
    settings = SolverSettings(21, 256)
    case = build_case(scene("vibro_impact"), 0.0, omega, settings)
    before, joint = case.joint(1.55, FORCE), case.joint(omega, FORCE)
    start = upper_state(case, 1.55)
    budget = Budget()
    found = relax_to_periodic(case, joint, np.zeros(1), start, before, Run(case.settings.tolerance, budget))
    assert found is not None
    moved = full_motion(case.model, periodic_state(joint, found)).displacement[1][1]
    assert abs(moved) == pytest.approx(FORCE / abs(1 - omega**2 + 0.05j * omega), rel=1e-6, abs=0.0)
    assert budget.iterations < 500


@pytest.mark.parametrize("change", [1e-4, -1e-4])
def test_a_motion_leaves_an_unstable_state_whose_growth_long_steps_would_damp(change):
    balance_at, first, size = wall(WALL_OMEGA)

    def grows(point):
        return not Run(1e-8).is_stable(balance_at(point.parameter, point.history), point.evaluation)

    # through the fold at grazing, back to the excitation of the start: the branch between the two stable ones
    start = first(0.03)
    middle = next(filter(grows, crossings(Arc(balance_at, start, 0.03, Run(1e-9)), 0.03, 1.0)))
    case = build_case(scene("vibro_impact"), 0.0, WALL_OMEGA, SolverSettings(5, 64))
    before, joint = case.joint(WALL_OMEGA, 0.03), case.joint(WALL_OMEGA, 0.03 * (1.0 + change))
    found = relax_to_periodic(case, joint, np.zeros(1), middle, before, Run(case.settings.tolerance))
    assert isinstance(found, State)
    assert found is not None
    landed = replace(found, parameter=0.03 * (1.0 + change))
    assert not grows(landed)
    # the two sides of the unstable state end at different stable states
    assert (size(landed) > size(middle)) == (change < 0.0)


@pytest.mark.slow
def test_steps_in_time_converge_to_the_motion_of_the_structure():
    # the open joint is linear: Re(sum Y_n(t) exp(i n w t)) against the matrix exponential, of first order in the step
    model = scene("vibro_impact", gap=1e3)
    omega, end = 1.3, 2.0
    case = build_case(model, 0.0, omega, SolverSettings(2, 32))
    joint = case.joint(omega, FORCE)
    flow = np.array([[0.0, 1.0, 0, 0], [-1.0, -0.05, FORCE, 0], [0, 0, 0, -omega], [0, 0, omega, 0]])
    exact = (expm(flow * end) @ np.array([0.01, 0.0, 1.0, 0.0]))[0]
    idle, history = np.zeros(1), np.zeros((1, 2))
    errors = []
    for steps in (250, 500):
        transient = Transient(case, joint)
        displacement = np.zeros((3, 2), complex)
        displacement[0, 1] = 0.01
        motion = Motion(displacement, np.zeros_like(displacement))
        inverse = steps / end
        predicted = np.zeros((1, 5))
        for _ in range(steps):
            balance = Balance(transient.step(motion, inverse), history, idle)
            result = Run(1e-10).solve(balance, predicted)
            assert result.converged
            predicted = result.evaluation.predicted_h
            motion = transient.after(result.evaluation, motion, inverse)
        phases = np.exp(1j * omega * end * np.arange(3))
        errors.append(abs(np.real(motion.displacement[:, 1] @ phases) - exact))
    assert errors[1] < 0.02 * abs(exact)
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.15, abs=0.0)


def test_a_motion_that_has_not_settled_within_its_effort_is_told_so(monkeypatch):
    model, settings = scene("sdof_slider", normal_stiffness=0.0), SolverSettings(5, 64)
    case = build_case(model, 0.3, 0.8 * NATURAL, settings)
    quiet, joint = case.joint(0.8 * NATURAL, 0.0), case.joint(0.8 * NATURAL, 10.0)
    idle = np.zeros(1)
    rest = first_point(case, 0.8 * NATURAL, 0.0, idle)
    outcomes = []
    for most in (transient.SEARCH_ITERATIONS, 10):
        monkeypatch.setattr(transient, "SEARCH_ITERATIONS", most)
        budget = Budget()
        outcome = relax_to_periodic(case, joint, idle, rest, quiet, Run(case.settings.tolerance, budget))
        outcomes.append(Outcome.CONVERGED if isinstance(outcome, State) else outcome)
        # one step and one search for the periodic state may be under way
        assert budget.iterations <= most + 2 * NEAR_ITERATIONS
    assert outcomes == [Outcome.CONVERGED, Outcome.UNSETTLED]
