"""Springs that stiffen and Iwan's element: exact motions, loops by Masing's rule, integrations in time."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipk

from solver import CubicSprings, IwanJoints, SolverSettings, backbone, build_model, frequency_response
from solver.compliant_contact import with_contact_stiffness
from solver.contact.iwan import SLIDERS
from solver.harmonic_balance.state import state_of
from solver.newton.run import Run
from solver.settings import Resolution
from solver.stability.floquet import find_multipliers
from tests.solver.models import assert_same, branch_states, case_of, march_wear, random_balance, random_model, state_at
from tests.solver.test_elements import jacobian_by_differences

MASS, STIFFNESS, DAMPING = 1.0, 1e4, 4.0  # kg, N/m, N s/m
LINEAR, CUBIC = 2e3, 5e9  # N/m, N/m3
JOINT, LIMIT = 2e4, 8.0  # N/m, N
LIMITS = (2.0 * np.arange(SLIDERS) + 1.0) * LIMIT / SLIDERS**2
SLIDER = JOINT / SLIDERS


def oscillator(law, damping, component=0):
    """A mass on a spring, with a pair between it and the ground."""
    dofs = np.where(np.arange(3) == component, 0, -1)
    parts = [[MASS]], [[damping]], [[STIFFNESS]]
    return build_model(*parts, [dofs], 1e-4, load_harmonic=[1.0], laws=[law])


def duffing(damping=DAMPING):
    return oscillator(CubicSprings((0,), LINEAR, CUBIC), damping)


def iwan(damping=1.0):
    return oscillator(IwanJoints((0,), JOINT, LIMIT, 0.0), damping, component=2)


def with_all_laws(limit=30.0):
    """Pairs on springs, with friction, and with Iwan's element."""
    model = random_model(4, ("3d", "one_tangent", "3d", "3d"))
    springs = CubicSprings((0,), [1e6, 2e6, 0.0], [1e16, 0.0, 1e17])
    return replace(model, contact=replace(model.contact, laws=(springs, IwanJoints((2,), 3e6, limit, 1e6))))


@pytest.mark.parametrize("comes_from", ["nothing", "another state", "itself"])
def test_derivatives_of_a_joint_with_all_laws_are_differences(comes_from):
    balance, predicted = random_balance(with_all_laws(), SolverSettings(5, 64), 104, wear=True)
    history = np.pad(balance.history, ((0, 0), (0, balance.joint.law.n_history - 2)))
    balance = replace(balance, history=history)
    if comes_from == "another state":
        balance = replace(balance, before_t=0.7 * balance.evaluate(predicted).predicted_t)
    if comes_from == "itself":
        # evenly to both sides: else some sliders come to rest at their limit, where a derivative has two sides
        predicted[balance.joint.contact.pair_rows[2], 0::4] = predicted[balance.joint.contact.pair_rows[2], 3::4] = 0.0
        balance = replace(balance, history=balance.evaluate(predicted).start_history)
    at = balance.evaluate(predicted)
    assert balance.joint.law.friction_work(at)[2] > 0.0
    tangent = balance.linearise(at).dense(np.arange(4))
    differences = jacobian_by_differences(balance, predicted, 1e-4)
    assert (np.abs(tangent - differences).max(axis=1) < 1e-7 * np.abs(differences).max(axis=1)).all()


def test_a_law_that_remembers_more_leaves_what_friction_remembers():
    model = with_all_laws()
    balance, predicted = random_balance(model, SolverSettings(5, 64), 104, wear=False)
    both = replace(balance, history=np.pad(balance.history, ((0, 0), (0, balance.joint.law.n_history - 2))))
    contact = replace(model.contact, laws=(model.contact.laws[0], CubicSprings((2,), 1e6, 0.0)))
    short, _ = random_balance(replace(model, contact=contact), SolverSettings(5, 64), 104, wear=False)
    left, expected = (state_of(each.joint, each.evaluate(predicted)).next_history for each in (both, short))
    assert left.shape[1] == 2 * SLIDERS
    assert left[2, 2:].any()
    assert np.array_equal(left[[1, 3], :2], expected[[1, 3]])
    assert not left[[1, 3], 2:].any()


@pytest.mark.parametrize("pairs", [(1, 0), (0, 0), (0, 4), (-1,)])
def test_pairs_of_a_law_have_to_be_there_in_order(pairs):
    contact = with_all_laws().contact
    with pytest.raises(ValueError, match="laws"):
        replace(contact, laws=(CubicSprings(pairs, 1e6, 0.0),))


def test_a_joint_at_rest_needs_one_harmonic():
    # it would be refined for ever
    response = frequency_response(duffing(), [16.0], 0.0, 0.4, settings=SolverSettings(time_limit=2.0))
    assert response.outcome[0].meaning == "converged"
    assert np.abs(response.response).max() < 1e-15


# --- springs ---


@lru_cache(maxsize=1)
def shot(omega, load, amplitude):
    """First harmonic of a periodic motion of the oscillator near an amplitude, m, and its multipliers: by shooting."""

    def motion(t, y):
        x, v, change = y[0], y[1], y[2:].reshape(2, 2)
        spring, slope = (STIFFNESS + LINEAR) * x + CUBIC * x**3, STIFFNESS + LINEAR + 3.0 * CUBIC * x**2
        a = (load * np.cos(omega * t) - DAMPING * v - spring) / MASS
        passed = np.array([[0.0, 1.0], [-slope / MASS, -DAMPING / MASS]]) @ change
        return np.concatenate([[v, a], passed.ravel()])

    start, period = np.array([amplitude.real, -omega * amplitude.imag]), 2.0 * np.pi / omega
    times = period * np.arange(256) / 256
    for _ in range(8):
        whole = np.concatenate([start, np.eye(2).ravel()])
        found = solve_ivp(motion, (0.0, period), whole, rtol=1e-11, atol=1e-14, t_eval=[*times, period])
        end, monodromy = found.y[:2, -1], found.y[2:, -1].reshape(2, 2)
        start = start - np.linalg.solve(monodromy - np.eye(2), end - start)
    assert np.abs(end - start).max() < 1e-9 * np.abs(start).max()
    return 2.0 * np.mean(found.y[0, :-1] * np.exp(-1j * omega * times)), np.linalg.eigvals(monodromy)


@pytest.mark.slow
@pytest.mark.parametrize("frequency", [16.0, 22.0])
def test_a_forced_motion_on_stiffening_springs_and_its_multipliers_are_those_of_shooting(frequency):
    omega, settings = 2.0 * np.pi * frequency, SolverSettings(9, 128)
    found = frequency_response(duffing(), frequency, 3.0, 0.0, settings=settings)
    response, multipliers = shot(omega, 3.0, complex(found.response[0, 0]))
    assert found.response[0, 0] == pytest.approx(response, rel=1e-7)
    _, case, state = state_at(duffing(), 0.0, 3.0, omega, settings)
    values = find_multipliers(case, state, Run(1e-8)).values
    # by BDF2
    assert np.sort_complex(values[:2]) == pytest.approx(np.sort_complex(multipliers), abs=1e-3)
    assert np.abs(values[2:]).max() < 1e-6


def test_the_backbone_of_stiffening_springs_is_exact():
    def free(amplitude):
        """Frequency, Hz, and first harmonic, m, of the free motion `amplitude cn(...)`."""
        rate = np.sqrt((STIFFNESS + LINEAR + CUBIC * amplitude**2) / MASS)
        m = CUBIC * amplitude**2 / (2.0 * MASS * rate**2)
        quarter, nome = ellipk(m), np.exp(-np.pi * ellipk(1.0 - m) / ellipk(m))
        first = amplitude * 2.0 * np.pi / (np.sqrt(m) * quarter) * np.sqrt(nome) / (1.0 + nome)
        return rate / (4.0 * quarter), first

    amplitudes = [1e-5, 1e-3, 3e-3]
    found = backbone(duffing(damping=0.0), amplitudes, 0.0, settings=SolverSettings(9, 128))
    peaks = [brentq(lambda peak, a=a: free(peak)[1] - a, 0.5 * a, 2.0 * a, xtol=1e-18) for a in amplitudes]
    assert found.frequency == pytest.approx([free(peak)[0] for peak in peaks], rel=1e-8)
    assert np.abs(found.damping_ratio).max() < 1e-12


# --- Iwan's element ---


def backbone_force(u):
    """Force, N, of sliders from rest that have come to u, m."""
    return np.minimum(SLIDER * u, LIMITS).sum()


@pytest.mark.parametrize("size", [0.3, 1.2])  # over the displacement from which all sliders slip
def test_a_loop_follows_masings_rule_and_dissipates_its_area(size):
    peak = size * 2.0 * LIMIT / JOINT
    down, up = (peak * np.cos(np.linspace(*ends)) for ends in ((0.0, np.pi, 16), (np.pi, 2.0 * np.pi, 17)))
    masing = [backbone_force(peak) - 2.0 * backbone_force((peak - u) / 2.0) for u in down]
    masing += [2.0 * backbone_force((peak + u) / 2.0) - backbone_force(peak) for u in up[1:-1]]
    # as many harmonics as samples: their force goes through all of them
    resolution = Resolution(tuple(range(1, 16)), 31)
    law = case_of(iwan(), 0.0, 100.0, SolverSettings(), resolution).joint(100.0, 0.0).law
    predicted_t = np.zeros((1, 3, 31))
    predicted_t[0, 2] = masing + law.penalty.tangential * np.concatenate([down, up[1:-1]])
    found = law.march(predicted_t @ law.basis.analysis, np.zeros((1, law.n_history)), None)
    assert found.force_t[0, 2] == pytest.approx(masing, abs=1e-11 * LIMIT)
    slip = np.maximum(peak - LIMITS / SLIDER, 0.0)
    assert law.friction_work(found) == pytest.approx([4.0 * LIMITS @ slip], rel=1e-10)


LOAD, STEPS, PERIODS = 2.0, 800, 40


class Integration:
    """Oscillator with Iwan's element in time, by the trapezoidal rule, from rest or from another one."""

    def __init__(self, omega, begin=None, pushed=0.0):
        self.omega, self.step = omega, 2.0 * np.pi / omega / STEPS
        self.u, self.v, self.sliders = begin.end if begin else (0.0, 0.0, np.zeros(SLIDERS))
        self.u += pushed
        self.history = []
        self.a = (LOAD - self.v - STIFFNESS * self.u - self.joint(self.u)[0]) / MASS
        self.ends = [(self.u, self.v)]

    def joint(self, u):
        force = SLIDER * (u - self.sliders)
        sticks = np.abs(force) < LIMITS
        return np.where(sticks, force, np.sign(force) * LIMITS).sum(), SLIDER * sticks.sum()

    def run(self, periods):
        h = self.step
        for step in range(1, periods * STEPS + 1):
            load, known_u = LOAD * np.cos(self.omega * step * h), self.u + h * self.v + h * h / 4.0 * self.a
            known_v, a = self.v + h / 2.0 * self.a, self.a
            for _ in range(50):
                force, slope = self.joint(u := known_u + h * h / 4.0 * a)
                missing = MASS * a + known_v + h / 2.0 * a + STIFFNESS * u + force - load
                if abs(missing) < 1e-12 * LOAD:
                    break
                a -= missing / (MASS + h / 2.0 + h * h / 4.0 * (STIFFNESS + slope))
            self.u, self.v, self.a = u, known_v + h / 2.0 * a, a
            way = self.u - self.sliders
            slips = np.abs(SLIDER * way) >= LIMITS
            self.sliders = np.where(slips, self.u - np.sign(way) * LIMITS / SLIDER, self.sliders)
            self.history.append(self.u)
            if step % STEPS == 0:
                self.ends.append((self.u, self.v))
        self.end = self.u, self.v, self.sliders
        return self


@pytest.mark.slow
def test_a_forced_motion_with_iwans_element_and_its_multipliers_are_those_of_an_integration_in_time():
    omega, settings = 2.0 * np.pi * 22.0, SolverSettings(11, 256)
    settled = Integration(omega).run(PERIODS)
    turned = np.exp(-2j * np.pi * np.arange(1, STEPS + 1) / STEPS)
    _, case, state = state_at(iwan(), 0.0, LOAD, omega, settings)
    response = frequency_response(iwan(), 22.0, LOAD, 0.0, settings=settings).response[0, 0]
    assert response == pytest.approx(2.0 * np.mean(settled.history[-STEPS:] * turned), rel=2e-4)
    plain, pushed = (np.array(Integration(omega, settled, push).run(10).ends) for push in (0.0, 1e-9))
    change = (pushed - plain) * [omega, 1.0]
    passed = np.linalg.lstsq(change[2:-1], change[3:], rcond=None)[0]
    multipliers = find_multipliers(case, state, Run(1e-8)).values
    assert np.sort_complex(multipliers[:2]) == pytest.approx(np.sort_complex(np.linalg.eigvals(passed)), abs=2e-3)
    assert np.abs(multipliers[2:]).max() < 1e-3


def test_the_mode_of_iwans_element_loses_the_work_of_its_loop():
    amplitudes = np.array([1e-6, 1e-4, 3e-4, 5e-3])
    found = backbone(iwan(damping=0.0), amplitudes, 0.0, settings=SolverSettings(9, 128))
    work = [4.0 * LIMITS @ np.maximum(a - LIMITS / SLIDER, 0.0) for a in amplitudes]
    # the peak is the first harmonic but for a part of the third one
    expected = work / (2.0 * np.pi * (2.0 * np.pi * found.frequency * amplitudes) ** 2)
    assert found.damping_ratio == pytest.approx(expected, rel=0.01, abs=1e-9)
    assert found.frequency[0] == pytest.approx(np.sqrt(STIFFNESS + JOINT) / (2.0 * np.pi), rel=1e-9)


def test_a_falling_vibration_leaves_the_sliders_where_a_slow_way_does():
    # without the way, each frequency beyond the resonance is 1.5 to 2 % off
    found = frequency_response(iwan(), [28.0, 30.0], LOAD, 0.0)
    assert found.response_error.max() < 0.006


# --- in a joint with friction ---


@pytest.mark.slow
def test_a_joint_with_all_laws_wears_where_it_rubs_and_goes_on_to_the_last_bit(monkeypatch):
    monkeypatch.setattr("solver.wear.problem.WearProblem.iterations_per_save", 8)
    settings, kept = SolverSettings(7, 96, rtol=0.1), []
    (start,) = branch_states(with_all_laws(), 0.4, 60.0, [600.0], settings)
    asked = with_all_laws(), 0.4, start, 1e-11, 1.0, "adaptive", np.array([0.0, 1e4, 1e5]), settings
    whole = march_wear(*asked, keep=kept.append)
    assert whole.outcome.meaning == "converged"
    assert whole.error_estimate < settings.rtol
    assert (whole.wear_depth[-1] > 0.0).tolist() == [False, True, False, True]
    assert len(kept) > 1
    assert_same(march_wear(*asked, resume=kept[len(kept) // 2]), whole)


def test_rough_surfaces_are_those_of_pairs_that_rub():
    rough = with_contact_stiffness(with_all_laws(), 1e13)
    n_rubbing = np.count_nonzero(with_all_laws().contact.dofs[[1, 3]] >= 0)
    assert len(rough.linear[0].mass) == len(with_all_laws().linear[0].mass) + n_rubbing
