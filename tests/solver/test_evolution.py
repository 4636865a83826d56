"""Friction, contact stiffness and wear coefficient that change with the dissipated energy, against exact answers."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from solver import Block, build_model, integrate_mission, with_contact_stiffness, with_evolution
from solver.accuracy.certificate import certify
from solver.contact.wear_law import WearLaw, WearTable
from solver.harmonic_balance.state import first_response
from solver.model import with_friction
from solver.modes.modal_model import linear_mode
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.results.state_report import evaluated
from solver.settings import SolverSettings
from solver.stability.floquet import find_multipliers
from solver.structure.joint import build_case
from solver.wear.problem import WearProblem
from solver.wear.step import rate_slope
from solver.wear.wearing_joint import WearingJoint, WearRequest
from tests.references import slider_amplitude
from tests.solver.models import (
    OMEGA,
    branch_states,
    case_of,
    cyclic_model,
    dovetail,
    march_wear,
    random_balance,
    random_model,
    scene,
    with_free_masses,
)
from tests.solver.test_elements import MODELS, jacobian_by_differences
from tests.solver.test_kernels import FREE, MIXED, forces_and_history

AREA, LOAD, STROKE = 1e-4, 10.0, 1e-4
PER_CYCLE = LOAD * 4.0 * STROKE / AREA  # dissipated energy over friction, J/m2
GIVEN = SolverSettings(harmonics=3, samples=1024, rtol=1e-3)
COUNTS = np.linspace(0.0, 1e5, 11)


def driven(energy, **evolution):
    """A heavy mass under so large a force that friction does not change its motion: gross slip."""
    mass, omega = 1e7, 100.0
    force = mass * omega**2 * STROKE
    model = build_model(
        [[mass]], [[1.0]], [[1.0]], [[-1, 0, -1]], AREA, normal_load=LOAD, load_harmonic=[force]
    )  # fmt: skip
    return with_evolution(model, energy, **evolution), omega


def history(model, omega, friction=None, *, wear=1e-12, counts=COUNTS, load=1.0, steps=("adaptive", 0.0), **asked):
    settings = asked.pop("settings", GIVEN)
    (start,) = branch_states(model, friction, load, [omega], settings)
    scheme, step = steps
    return march_wear(model, friction, start, wear, step, scheme, counts, settings, **asked)


def test_friction_that_rises_with_the_energy_is_exponential_in_the_cycles():
    first, last, counts = 0.1, 2.0, 10.0 * COUNTS
    model, omega = driven([0.0, 1e8], friction_coefficient=[first, last])
    found, slope = history(model, omega, counts=counts), (last - first) / 1e8
    exact = first * np.expm1(slope * PER_CYCLE * counts) / slope
    assert found.dissipated_energy[:, 0] == pytest.approx(exact, rel=1e-4)
    assert (np.abs(found.dissipated_energy[:, 0] - exact) <= found.dissipated_energy_error[:, 0]).all()
    of_loops = found.friction_power[:, 0] * 2.0 * np.pi / omega
    assert of_loops == pytest.approx(PER_CYCLE * (first + slope * exact), rel=1e-3)
    assert found.outcome is Outcome.CONVERGED


def saturating(energy, first=0.1, last=0.33, scale=5e5):
    return last + (first - last) * np.exp(-energy / scale)


def counts_of(energy, first=0.1, last=0.33, scale=5e5):
    """Cycles until so much energy is dissipated by `saturating` friction."""
    return (energy + scale * np.log(saturating(energy) / first)) / (last * PER_CYCLE)


def saturates():
    energy = np.linspace(0.0, 5e6, 5001)
    return driven(energy, friction_coefficient=saturating(energy))


EXACT = np.array([brentq(lambda e, n=n: counts_of(e) - n, 0.0, 1e8) for n in COUNTS[1:]])


def test_friction_that_saturates_follows_its_closed_form_with_steps_of_second_order(monkeypatch):
    off, steps, step = [], [], WearProblem.step
    monkeypatch.setattr(WearProblem, "step", lambda of, state: (seen.append(of.guide), step(of, state))[1])
    for rtol in (1e-2, 1e-3):
        seen: list[object] = []
        found = history(*saturates(), settings=replace(GIVEN, rtol=rtol))
        off.append(np.abs(found.dissipated_energy[1:, 0] / EXACT - 1.0).max())
        # without those of the reference solution, which has a guide
        steps.append(seen.count(None))
    assert off[1] < 1e-4
    assert (np.abs(found.dissipated_energy[1:, 0] - EXACT) <= found.dissipated_energy_error[1:, 0]).all()
    assert np.log(off[0] / off[1]) / np.log(steps[1] / steps[0]) > 1.7


@pytest.mark.parametrize("scheme", ["implicit", "explicit"])
def test_given_steps_are_of_first_order_and_know_their_error(scheme):
    found = [history(*saturates(), steps=(scheme, step)) for step in (10_000.0, 5000.0)]
    off, other = (np.abs(each.dissipated_energy[1:, 0] - EXACT) for each in found)
    assert off / other == pytest.approx(2.0, rel=0.1)
    assert (off <= found[0].dissipated_energy_error[1:, 0]).all()


@pytest.mark.parametrize(("energy", "lags"), [(2e6, False), (2e4, True)])
def test_a_contact_that_changes_faster_than_the_vibration_follows_is_said(energy, lags):
    asked = {
        "wear": 1.1e-11,
        "counts": np.array([0.0, 2000.0]),
        "load": 0.5,
        "settings": SolverSettings(harmonics=5, samples=64),
    }
    model = with_evolution(dovetail(5), [0.0, energy], friction_coefficient=[0.3, 0.5])
    found = history(model, 2.0 * np.pi * 212.42, **asked)
    assert ("periods to follow a change of the contact" in found.message) == lags


@pytest.mark.parametrize("name", ["sdof_slider", "dovetail"])
def test_constant_tables_give_the_same_bits_as_the_constants(name):
    model, frequency, load, counts = (
        (dovetail(5), 212.5, 0.5, COUNTS[:3]) if name == "dovetail" else (scene(name, 5), 160.0, 10.0, COUNTS)
    )
    asked = {"wear": 1.1e-11, "counts": counts, "load": load, "settings": SolverSettings(harmonics=5, samples=64)}
    tables = {"friction_coefficient": 3 * [0.5], "wear_factor": 3 * [1.0], "contact_stiffness": 3 * [2e13]}
    plain = history(with_contact_stiffness(model, 2e13), 2.0 * np.pi * frequency, 0.5, **asked)
    ruled = history(with_evolution(model, [0.0, 1e6, 3e6], **tables), 2.0 * np.pi * frequency, **asked)
    assert plain.worn_volume[-1] > 0.0
    for name in ("wear_depth", "dissipated_energy", "wear_depth_error", "response", "newton_iterations"):
        np.testing.assert_array_equal(getattr(ruled, name), getattr(plain, name))


def test_a_wear_coefficient_over_energy_is_one_over_depth():
    """f = exp(c k e) over the energy e is f = 1 + c W over the depth W: dW/de = k f."""
    omega, coefficient, per_depth = 2.0 * np.pi * 160.0, 1.1e-11, 2e5
    energy = np.linspace(0.0, 2e6, 401)
    rising = np.exp(per_depth * coefficient * energy)
    deepest = (rising[-1] - 1.0) / per_depth
    over_depth = WearLaw("table", table=WearTable((0.0,), (0.0, deepest), ((0.5, 0.5 * rising[-1]),)))
    asked = {"wear": coefficient, "load": 10.0, "settings": SolverSettings(harmonics=5, samples=64)}
    one = history(scene("sdof_slider", 5), omega, 0.5, law=over_depth, **asked)
    model = with_evolution(scene("sdof_slider", 5), energy, wear_factor=rising)
    other = history(model, omega, 0.5, law=WearLaw("energy"), **asked)
    assert one.wear_depth[-1, 0] * per_depth > 0.05
    assert other.wear_depth == pytest.approx(one.wear_depth, rel=2e-3)


def test_a_slider_wears_as_cycle_by_cycle_with_its_exact_motion():
    """Its normal force is constant, and nothing but friction changes: de/dn = mu N 4 X(mu N) / alpha."""
    energy, omega, load = np.array([0.0, 2e5, 1e6, 1e9]), 2.0 * np.pi * 160.0, 10.0
    table = np.array([0.2, 0.4, 0.6, 0.6])
    model = with_evolution(scene("sdof_slider", 9), energy, friction_coefficient=table)

    def rate(_, e):
        limit = float(np.interp(e[0], energy, table)) * load
        return [limit * 4.0 * slider_amplitude(0.1, 0.0, 1.6e5, 10.0, limit, omega) / AREA]

    exact = solve_ivp(rate, (0.0, COUNTS[-1]), [0.0], t_eval=COUNTS, rtol=1e-8, max_step=500.0).y[0]
    settings = SolverSettings(harmonics=9, samples=256)
    found = history(model, omega, wear=1e-30, load=10.0, settings=settings)
    off = np.abs(found.dissipated_energy[:, 0] - exact)
    assert exact[-1] > 1e6
    assert (off <= found.dissipated_energy_error[:, 0]).all()
    assert off[-1] < 2e-3 * exact[-1]


@pytest.mark.parametrize("before", [False, True])
def test_derivatives_by_friction_are_those_of_differences(before):
    model = with_free_masses(random_model(1, MIXED), FREE)
    joint = case_of(model, 0.4, OMEGA, SolverSettings(3, 48)).joint(OMEGA, 60.0)
    predicted, history = forces_and_history(joint)
    before_t = 0.9 * predicted @ joint.basis.synthesis if before else None

    def found(friction):
        # the discs before have the size that they had
        begun = None if before_t is None else before_t * np.array([0.4 / friction, 1.0, 1.0])[:, None]
        law = joint.law.rubbing(np.full(6, friction))
        at = law.march(predicted, history, begun)
        return law, at, begun, np.concatenate([at.force_h.reshape(6, -1), at.slip_work[:, None]], axis=1)

    law, at, begun, _ = found(0.4)
    exact = law.tangent(at, history, begun)[2]
    ahead, behind = (found(0.4 + side)[3] for side in (1e-6, -1e-6))
    differences = (ahead - behind) / 2e-6
    assert np.abs(differences).max(axis=0)[-1] > 0.0
    for column in (slice(0, -1), slice(-1, None)):
        size = np.abs(differences[:, column]).max()
        assert exact[:, column] == pytest.approx(differences[:, column], abs=1e-6 * size)


@pytest.mark.parametrize("kinds", ["3d", "mixed", "wave"])
@pytest.mark.parametrize("evolution", [{"friction_coefficient": [0.4, 0.7]}, {"contact_stiffness": [1e13, 4e13]}, {}])
def test_the_jacobian_of_a_step_is_that_of_differences(kinds, evolution):
    model = cyclic_model(3, MODELS["mixed"], 6, 2) if kinds == "wave" else random_model(2, MODELS[kinds])
    tables = evolution or {
        "friction_coefficient": [0.4, 0.7],
        "contact_stiffness": [1e13, 2e13],
        "wear_factor": [1.0, 3.0],
    }
    rough = with_evolution(model, [0.0, 1.0], **tables)
    friction = None if "friction_coefficient" in tables else 0.4
    balance, predicted = random_balance(rough, SolverSettings(3, 24), 102, wear=True, friction=friction)
    work = balance.evaluate(predicted).slip_work.max()
    balance = replace(balance, energy=np.full(model.contact.n_contact, 0.1), energy_gain=0.6 / work)
    at = balance.evaluate(predicted)
    assert 0.1 < at.energy.max() < 1.0
    differences = jacobian_by_differences(balance, predicted, 1e-4)
    tangent = balance.linearise(at)
    dense = tangent.dense(np.arange(model.contact.n_contact))
    assert (np.abs(dense - differences).max(axis=1) < 1e-6 * np.abs(differences).max(axis=1)).all()
    step = np.random.default_rng(3).normal(size=predicted.shape)
    expected = dense @ step.ravel()
    assert tangent.apply(step).ravel() == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())


def test_a_stiffer_contact_is_that_of_a_stiffer_structure():
    """A state, its response and its multipliers after energy, against those of a model with this stiffness."""
    model, omega, settings = dovetail(5), 2.0 * np.pi * 212.6, SolverSettings(harmonics=5, samples=64)
    stiff = with_friction(with_contact_stiffness(model, 5e13), 0.5)
    evolving = with_evolution(model, [0.0, 1e6], friction_coefficient=[0.5, 0.5], contact_stiffness=[2e13, 8e13])
    worn = replace(evolving, contact=evolving.contact.after(np.full(16, 0.5e6)))
    found = []
    for each in (worn, stiff):
        (start,) = branch_states(each, None, 0.5, [omega], settings)
        case = build_case(each, start.penalty_omega, settings, start.resolution)
        state = evaluated(case, start.state)
        assert certify(state.joint(case), state.evaluation).failures(1e-8) == {}
        multipliers = find_multipliers(case, state, Run(1e-8)).values
        found.append((first_response(state.joint(case), state.evaluation), state.evaluation.slip_work, multipliers[:2]))
    for one, other in zip(*found, strict=True):
        # the penalty is that of the unworn joint, and with it the harmonics that are left out
        assert one == pytest.approx(other, rel=3e-3, abs=3e-3 * np.abs(other).max())


def test_missions_dissipate_as_the_cycles_of_their_blocks():
    """A thousand missions of 100 cycles, few of which are computed."""
    first, last = 0.1, 0.5
    model, omega = driven([0.0, 4e6], friction_coefficient=[first, last])
    block = Block(model, omega / (2.0 * np.pi), 1.0, None, cycles=100.0)
    settings = replace(GIVEN, samples=512)
    found = integrate_mission([block], 1e-12, (0, 1, 10, 100, 1000), settings=settings)
    slope = (last - first) / 4e6
    exact = first * np.expm1(slope * PER_CYCLE * 100.0 * found.missions) / slope
    assert found.steps.size < 200
    assert found.dissipated_energy[:, 0] == pytest.approx(exact, rel=2e-4)
    assert (np.abs(found.dissipated_energy[:, 0] - exact) <= found.dissipated_energy_error[:, 0] + 1e-4 * exact).all()


def test_a_linear_mode_of_a_worn_joint_has_its_springs():
    model, closed = dovetail(5), np.ones(16, bool)
    evolving = with_evolution(model, [0.0, 1e6], friction_coefficient=[0.5, 0.5], contact_stiffness=[2e13, 8e13])
    worn = replace(evolving, contact=evolving.contact.after(np.full(16, 0.5e6)))
    stiff = with_friction(with_contact_stiffness(model, 5e13), 0.5)
    modes = [linear_mode(each, closed) for each in (worn, stiff, evolving)]
    assert modes[0].omega == pytest.approx(modes[1].omega, rel=1e-9)
    assert modes[0].omega > 1.0001 * modes[2].omega


def test_friction_that_wears_nothing_dissipates_all_the_same():
    """Without wear the state holds, and its energy grows evenly."""
    model, omega = driven([0.0, 1e3], friction_coefficient=[0.3, 0.3])
    found = history(model, omega, wear=0.0)
    assert found.dissipated_energy[:, 0] == pytest.approx(0.3 * PER_CYCLE * COUNTS, rel=1e-4)
    assert not found.wear_depth.any()


def test_the_slope_of_a_wear_rate_has_its_factor():
    omega, energy = 2.0 * np.pi * 160.0, [0.0, 1e6]
    settings = SolverSettings(harmonics=5, samples=64)
    slopes = []
    for model, friction in (
        (with_evolution(scene("sdof_slider", 5), energy, wear_factor=[3.0, 3.0]), 0.5),
        (scene("sdof_slider", 5), 0.5),
    ):
        (start,) = branch_states(model, friction, 10.0, [omega], settings)
        model = with_friction(model, friction)
        case = build_case(model, start.penalty_omega, settings, start.resolution)
        wearing = WearingJoint(case, start, WearRequest(1e-11, None, COUNTS))
        slopes.append(float(rate_slope(wearing, wearing.unworn_state(), np.ones(1, bool))[0, 0]))
    assert slopes[0] == pytest.approx(3.0 * slopes[1], rel=1e-9)
