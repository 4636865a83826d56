"""Steps along a parameter, relaxation in time, and states at a phase lag: closed forms, exact motions, differences."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from solver.continuation import transient
from solver.continuation.arc_length import Arc
from solver.continuation.natural import NEAR_ITERATIONS, follow_naturally
from solver.continuation.phase_lag import phase_lag, rise_of_response, solve_at_lag
from solver.continuation.transient import Motion, Transient, relax_to_periodic
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State, first_response
from solver.loading_history.path import LoadingPath
from solver.newton.run import Bordered, Budget, Run
from solver.outcome import Outcome
from solver.results.state_report import periodic_motion
from solver.settings import SolverSettings
from tests.references import coulomb_orbit
from tests.solver.models import case_of, first_point, scene

WALL_OMEGA = 1.2  # rad/s; without the wall the mass reaches it at 0.1 |1 - 1.2^2 + 0.06i| = 0.0444 N
GRAZING = 0.1 * abs(1 - WALL_OMEGA**2 + 0.05j * WALL_OMEGA)


def test_natural_steps_end_before_a_fold_and_say_so():
    path = LoadingPath(case_of(scene("vibro_impact"), 0.0, WALL_OMEGA, SolverSettings(5, 64)), 1.0, WALL_OMEGA)
    start = replace(first_point(path.case, WALL_OMEGA, 0.03), parameter=0.03)
    point, arrived = follow_naturally(path.balance_from, start, 0.06, Run(1e-9))
    assert not arrived
    # the branch without impacts ends where the mass reaches the wall; 1/64 of the range is the shortest step
    assert point.parameter == pytest.approx(GRAZING, abs=2 * 0.03 / 64)
    assert abs(first_response(path.joint_at(point.parameter), point.evaluation)[0]) == pytest.approx(0.1, rel=0.02)


@pytest.mark.parametrize("over", ["frequency", "load"])
@pytest.mark.parametrize("name", ["two_masses", "sdof_slider"])
def test_the_slope_along_a_path_is_that_of_differences(name, over):
    case, omega = case_of(scene(name), 0.5, 1.3, SolverSettings(5, 64)), 1.3
    path, place = (LoadingPath(case, 20.0), omega) if over == "frequency" else (LoadingPath(case, 1.0, omega), 20.0)
    state = first_point(case, omega, 20.0)
    balance, length = Balance(path.joint_at(place), state.evaluation.start_history), 1e-5 * place
    at = balance.evaluate(state.evaluation.predicted_h)
    one, other = (
        replace(balance, joint=path.joint_at(place + step)).evaluate(at.predicted_h).residual
        for step in (-length, length)
    )
    difference = (other - one) / (2.0 * length)
    # masses on rigid ground: a one-sided difference of the samples
    assert np.abs(path.slope(balance, at) - difference).max() < 1e-5 * np.abs(difference).max()


# --- relaxation in time ---

FORCE = 0.02
NATURAL = np.sqrt(1.6e6)


@pytest.mark.parametrize("omega", [0.3, 1.3])
def test_two_masses_relax_from_rest_to_their_exact_motion(omega):
    orbit = coulomb_orbit([[1, 0], [0, 1]], [[0.04, -0.02], [-0.02, 0.02]], [[2, -1], [-1, 1]], [20, 0], 1, 7.2, omega)
    case, idle = case_of(scene("two_masses"), 0.5, omega, SolverSettings(21, 256)), np.zeros((2, 1))
    rest = first_point(case, omega, 0.0)
    quiet, joint = case.joint(omega, 0.0), case.joint(omega, 20.0)
    found = relax_to_periodic(joint, idle, rest, quiet, Run(1e-8))
    moved = np.abs(periodic_motion(joint, found.evaluation).displacement[:, 1])
    assert moved == pytest.approx([abs(orbit.harmonic(dof)) for dof in (0, 1)], rel=0.02, abs=0.0)


@pytest.mark.parametrize("change", [1e-4, -1e-4])
def test_a_motion_leaves_an_unstable_state_whose_growth_long_steps_would_damp(change):
    path = LoadingPath(case_of(scene("vibro_impact"), 0.0, WALL_OMEGA, SolverSettings(5, 64)), 1.0, WALL_OMEGA)

    def grows(point):
        return not Run(1e-8).is_stable(path.joint_at(point.parameter), point.evaluation)

    # through the fold at grazing, back to the excitation of the start: the branch between the two stable ones
    start = replace(first_point(path.case, WALL_OMEGA, 0.03), parameter=0.03)
    arc = Arc(lambda load: Balance(path.joint_at(load), start.next_history), path.slope, start, 0.03, Run(1e-9))
    passed = ((a, b) for a, b, _ in arc.steps(1.0) if (a.parameter - 0.03) * (b.parameter - 0.03) < 0.0)
    middle = next(filter(grows, (arc.state_at(a, b, 0.03) for a, b in passed)))
    before, joint = (path.joint_at(0.03 * (1.0 + part)) for part in (0.0, change))
    found = relax_to_periodic(joint, np.zeros((2, 1)), middle, before, Run(1e-8))
    assert isinstance(found, State)
    assert not grows(replace(found, parameter=joint.excitation_amplitude))
    # the two sides of the unstable state end at different stable states
    settled, unstable = (abs(first_response(joint, each.evaluation)[0]) for each in (found, middle))
    assert (settled > unstable) == (change < 0.0)


@pytest.mark.slow
def test_steps_in_time_converge_to_the_motion_of_the_structure():
    # the open joint is linear: Re(sum Y_n(t) exp(i n w t)) against the matrix exponential, of first order in the step
    model = scene("vibro_impact", gap=1e3)
    omega, end = 1.3, 2.0
    case = case_of(model, 0.0, omega, SolverSettings(2, 32))
    joint = case.joint(omega, FORCE)
    flow = np.array([[0.0, 1.0, 0, 0], [-1.0, -0.05, FORCE, 0], [0, 0, 0, -omega], [0, 0, omega, 0]])
    exact = (expm(flow * end) @ np.array([0.01, 0.0, 1.0, 0.0]))[0]
    history = np.zeros((1, 2))
    errors = []
    for steps in (250, 500):
        transient = Transient(joint)
        displacement = np.zeros((3, 2), complex)
        displacement[0, 1] = 0.01
        motion = Motion(displacement, np.zeros_like(displacement))
        inverse = steps / end
        predicted = np.zeros((1, 5))
        for _ in range(steps):
            balance = Balance(transient.step(motion, inverse), history)
            at = Run(1e-10).state(balance, predicted).evaluation
            predicted, motion = at.predicted_h, transient.after(at, motion, inverse)
        phases = np.exp(1j * omega * end * np.arange(3))
        errors.append(abs(np.real(motion.displacement[:, 1] @ phases) - exact))
    assert errors[1] < 0.02 * abs(exact)
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.15, abs=0.0)


def test_a_motion_that_has_not_settled_within_its_effort_is_unsettled(monkeypatch):
    model, settings = scene("sdof_slider", normal_stiffness=0.0), SolverSettings(5, 64)
    case = case_of(model, 0.3, 0.8 * NATURAL, settings)
    quiet, joint = case.joint(0.8 * NATURAL, 0.0), case.joint(0.8 * NATURAL, 10.0)
    idle = np.zeros((2, 1))
    rest = first_point(case, 0.8 * NATURAL, 0.0)
    outcomes = []
    for most in (transient.SEARCH_ITERATIONS, 10):
        monkeypatch.setattr(transient, "SEARCH_ITERATIONS", most)
        budget = Budget()
        outcome = relax_to_periodic(joint, idle, rest, quiet, Run(case.settings.tolerance, budget))
        outcomes.append(Outcome.CONVERGED if isinstance(outcome, State) else outcome.outcome)
        # one step and one search for the periodic state may be under way
        assert budget.iterations <= most + 2 * NEAR_ITERATIONS
    assert outcomes == [Outcome.CONVERGED, Outcome.UNSETTLED]


# --- states at a phase lag ---

TIGHT = SolverSettings(harmonics=3, samples=64, tolerance=1e-11)
LAG_OMEGA = 2.0 * math.pi * 190.0


def slider_state(gain=0.0, damping=20.0, friction=0.5):
    """The slider at 190 Hz. gain: m/J, growth of the depth."""
    model = scene("sdof_slider", damping=damping)
    case = case_of(model, friction, LAG_OMEGA, TIGHT)
    joint = case.joint(LAG_OMEGA, 10.0)
    balance = Balance(joint, np.zeros((1, 2)), np.zeros(1), np.full(1, gain))
    start = balance.predict(np.zeros((1, 3, 7)), np.zeros((1, 3, 7)))
    found = Run(1e-11).state(balance, start, most=100)
    return case, Bordered(balance, found.evaluation, np.array([LAG_OMEGA]), np.zeros(1))


@pytest.mark.parametrize("gain", [0.0, 2e-3], ids=["fixed depth", "growing depth"])
def test_a_state_at_its_own_lag_has_its_own_frequency_and_the_lag_changes_as_by_finite_differences(gain):
    """With growing depths the latter holds only where the elimination of the depth sees the frequency."""
    case, state = slider_state(gain)
    assert (state.at.wear_depth > 0.0) == (gain > 0.0)
    lag = phase_lag(state.balance.joint, state.at)
    other = replace(state.balance, joint=case.joint(0.99 * LAG_OMEGA, 10.0))
    found = solve_at_lag(case, other, state.at.predicted_h, lag, Run(case.settings.tolerance))
    assert found.values[0] == pytest.approx(LAG_OMEGA, rel=1e-9)
    np.testing.assert_allclose(found.at.wear_depth, state.at.wear_depth, rtol=1e-8)

    lags, length = [], 1e-5 * LAG_OMEGA
    for omega in (LAG_OMEGA - length, LAG_OMEGA + length):
        balance = replace(state.balance, joint=case.joint(omega, 10.0))
        end = Run(1e-12).state(balance, state.at.predicted_h)
        lags.append(phase_lag(balance.joint, end.evaluation))
    expected = (lags[1] - lags[0]) / (2.0 * length)
    # a single step of Newton's method, whose derivative is that of the start
    loose = replace(case, settings=replace(TIGHT, tolerance=1e-9))
    near = solve_at_lag(loose, state.balance, state.at.predicted_h, lag + 1e-6, Run(loose.settings.tolerance), most=1)
    assert float(near.reduced[0, 0]) == pytest.approx(expected, rel=1e-4)


def test_a_linear_oscillator_has_its_natural_frequency_and_its_peak_below():
    damping = 100.0  # N s/m: 40 % of the critical damping
    natural, ratio = math.sqrt(1.6e5 / 0.1), damping / (2.0 * math.sqrt(1.6e5 * 0.1))
    case, state = slider_state(damping=damping, friction=0.0)

    found = solve_at_lag(case, state.balance, state.at.predicted_h, 0.5 * math.pi, Run(case.settings.tolerance))
    assert found.values[0] == pytest.approx(natural, rel=1e-10)
    rise, turn = rise_of_response(found, Run(1e-12), 1e-2)
    # at the natural frequency the amplitude falls as 1 / omega, and the lag rises by 1 / (zeta omega)
    assert rise * natural == pytest.approx(-1.0, rel=1e-5)
    assert turn * natural == pytest.approx(1.0 / ratio, rel=1e-5)
    peak = replace(found.balance, joint=case.joint(natural * math.sqrt(1.0 - 2.0 * ratio**2), 10.0))
    end = Run(1e-12).state(peak, found.at.predicted_h)
    at_peak, turn = rise_of_response(Bordered(peak, end.evaluation, np.zeros(1), np.zeros(1)), Run(1e-12), 1e-2)
    assert abs(at_peak) < 1e-5 * turn
