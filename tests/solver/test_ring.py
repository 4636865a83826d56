"""A ring of sectors: equal sectors move as one, the linear ring has its full matrices, and blades deviate."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from solver.arguments import check_case
from solver.contact.coulomb import SLIP
from solver.continuation.first_state import state_at_rest
from solver.forced_response import balance_at_start, frequency_response
from solver.harmonic_balance.dlft import Linearisation
from solver.harmonic_balance.ring_state import at_rest
from solver.histories import march_wear
from solver.model import ContactInterface, FloatArray, LinearModel, ReducedModel
from solver.newton import ring_factor
from solver.newton.run import Run
from solver.nonlinear_modes import backbone
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.stability import floquet
from solver.stability.disturbances import build_monodromy
from solver.stability.floquet import multipliers_of
from solver.structure.condensation import build_structure, condensed_at, frequency_slope, whole_motion
from solver.structure.ring import build_ring
from tests.rings import N, one_sector, whole_ring
from tests.solver.models import case_of

PATTERN = np.array([0.02, -0.013, 0.0, 0.007, -0.018, 0.011])
NAMES = ("mass", "damping", "stiffness", "load_static", "load_harmonic", "response")
RATE, ORDERS = 2.0 * np.pi * 280.0, (1, 2, 3)


def at_one_time(values_h: FloatArray, diameter: int, orders: tuple[int, ...] = ORDERS) -> np.ndarray:
    """Complex amplitudes (N, k, H) of all sectors at one time, from those (N k, 2H+1) at the own time of each."""
    amplitudes = (values_h[:, 1::2] - 1j * values_h[:, 2::2]).reshape(N, -1, len(orders))
    turn = np.exp(2j * np.pi * diameter / N * np.multiply.outer(np.arange(N), np.array(orders)))
    return amplitudes * turn[:, None]


@pytest.mark.parametrize("diameter", [0, 1, 3, 5])
def test_equal_sectors_have_the_condensed_sector(diameter):
    sector = one_sector(diameter)
    one, ring = (build_structure(model, RATE, 3.0, ORDERS) for model in (sector, build_ring(sector)))
    motion = np.random.default_rng(0).normal(size=(2, 7))
    everywhere = np.tile(motion, (N, 1))
    for alone, together in (
        (one.apply(motion), ring.apply(everywhere)),
        (one.force_h, ring.force_h),
        (one.response_h(motion), ring.response_h(everywhere)),
    ):
        # at nodal diameter 0 the force of the pairs is zero
        assert np.abs(np.tile(alone, (N, 1)) - together).max() <= 1e-12 * np.abs(alone).max() + 1e-14
    assert ring.input_work(everywhere) == pytest.approx(N * one.input_work(motion), rel=1e-12)


@pytest.mark.parametrize("diameter", [0, 1, 3, 4])
@pytest.mark.parametrize("deviation", [np.eye(N)[2] * 0.01, PATTERN])
def test_a_ring_with_deviating_blades_is_that_of_its_full_matrices(diameter, deviation):
    ring = build_structure(build_ring(one_sector(diameter), deviation), RATE, 3.0, ORDERS)
    full = build_structure(whole_ring(diameter, deviation), RATE, 3.0, ORDERS)
    motion_h = np.random.default_rng(1).normal(size=(2 * N, 7))
    moved = at_one_time(motion_h, diameter)
    together = motion_h.copy()
    together[:, 1::2], together[:, 2::2] = (part.reshape(2 * N, -1) for part in (moved.real, -moved.imag))
    for own, at_once in (
        (ring.apply(motion_h), full.apply(together)),
        (ring.force_h, full.force_h),
        (ring.response_h(motion_h), full.response_h(together)),
    ):
        right = (at_once[:, 1::2] - 1j * at_once[:, 2::2]).reshape(N, -1, len(ORDERS))
        assert np.abs(at_one_time(own, diameter) - right).max() <= 1e-9 * np.abs(right).max()
        assert np.abs(own[:, 0] - at_once[:, 0]).max() <= 1e-9 * max(np.abs(at_once[:, 0]).max(), 1e-300)
    assert ring.input_work(motion_h) == pytest.approx(full.input_work(together), rel=1e-9)


def test_products_are_those_of_the_matrices():
    structure = build_structure(build_ring(one_sector(1), PATTERN), RATE, 3.0, ORDERS)
    random = np.random.default_rng(2)
    motion_h, weight = random.normal(size=(2, 2 * N, 7))
    amplitudes = motion_h[:, 1::2] - 1j * motion_h[:, 2::2]
    wanted = np.einsum("hij,jh->ih", structure.dynamic_stiffness, amplitudes)
    assert np.abs(structure.moving.apply(motion_h) - wanted).max() <= 1e-12 * np.abs(wanted).max()
    assert np.abs(structure.moving.single.apply(motion_h) - wanted).max() <= 1e-5 * np.abs(wanted).max()
    places = np.array([0, 2])
    found = structure.moving.solve(places, wanted[:, places])
    assert np.abs(found - amplitudes[:, places]).max() <= 1e-9 * np.abs(amplitudes).max()
    forward, backward = structure.apply(motion_h), structure.apply_transposed(weight)
    assert (forward * weight).sum() == pytest.approx((motion_h * backward).sum(), rel=1e-12)


@pytest.mark.parametrize("deviation", [np.zeros(N), PATTERN])
def test_all_displacements_and_the_slope_over_the_frequency_are_those_of_the_full_matrices(deviation):
    ring, orders, random = build_ring(one_sector(1), deviation), (1, 2), np.random.default_rng(5)
    motion_h, dofs = random.normal(size=(2 * N, 5)), ring.contact.relative
    linear, moved = ring.harmonic_structure(1), random.normal(size=2 * N) + 0.0j
    by_waves = whole_motion(linear, 1j * RATE, dofs, linear.load_harmonic, moved)
    assembled = LinearModel(*(getattr(linear, name) for name in NAMES))
    by_matrix = whole_motion(assembled, 1j * RATE, dofs, linear.load_harmonic, moved)
    assert np.abs(by_waves - by_matrix).max() <= 1e-9 * np.abs(by_matrix).max()
    slope, step = frequency_slope(ring, RATE, 3.0, orders, motion_h), 1e-5 * RATE
    before, after = (build_structure(ring, RATE + way * step, 3.0, orders) for way in (-1.0, 1.0))
    force = (after.apply(motion_h) - after.force_h - before.apply(motion_h) + before.force_h) / (2.0 * step)
    assert np.abs(slope.force - force).max() <= 1e-5 * np.abs(force).max()
    response = (after.response_h(motion_h) - before.response_h(motion_h))[:, 1:3] / (2.0 * step)
    assert np.abs(slope.response - response @ [1.0, -1.0j]).max() <= 1e-5 * np.abs(response).max()


def test_a_step_in_time_is_that_of_the_assembled_matrices():
    ring, random = build_ring(one_sector(1), PATTERN), np.random.default_rng(6)
    linear, exponents = [ring.harmonic_structure(n) for n in range(3)], 40.0 + 1j * RATE * np.arange(3)
    loads = random.normal(size=(3, 7 * N)) + 1j * random.normal(size=(3, 7 * N))
    loads[0] = loads[0].real
    whole = [LinearModel(*(getattr(one, name) for name in NAMES)) for one in linear]
    (still, moving, force), (by_still, by_moving, by_force) = (
        condensed_at(each, exponents, ring.contact.relative, loads) for each in (linear, whole)
    )
    for one, other in ((still, by_still), (moving.dense, by_moving.dense), (force, by_force)):
        assert np.abs(one - other).max() <= 1e-9 * np.abs(other).max()


def tangent_of_equal_sectors() -> Linearisation:
    """Of a ring all of whose sectors slip."""
    settings = SolverSettings(harmonics=5, samples=64)
    checked = check_case(build_ring(one_sector(1)), 3.3, 0.3, "up", settings)
    _, _, balance, state = balance_at_start(checked[0], checked[1], 280.0, "up", settings)
    assert (state.evaluation.status_t == SLIP).any(axis=1).all()
    return balance.linearise(state.evaluation)


@pytest.mark.parametrize("largest", [1000, 14])
def test_equal_sectors_in_one_state_are_inverted_exactly_by_waves(largest, monkeypatch):
    monkeypatch.setattr(ring_factor, "LARGEST_WAVE", largest)
    tangent = tangent_of_equal_sectors()
    factor = ring_factor.build_ring_factor(tangent, 0.0)
    right = np.random.default_rng(7).normal(size=tangent.at.predicted_h.shape)
    # single precision; with the highest harmonics left out it is the inverse of all others alone
    width = factor.width
    assert width == (11 if largest == 1000 else 7)
    dense = np.linalg.inv(tangent.dense(np.arange(N), width)) @ right[:, :width].ravel()
    assert np.abs(factor.solve(right)[:, :width].ravel() - dense).max() <= 1e-3 * np.abs(dense).max()
    assert np.array_equal(factor.solve(right)[:, width:], right[:, width:])
    assert factor.sign == np.linalg.slogdet(tangent.dense(np.arange(N), width))[0]


def test_blades_that_deviate_are_inverted_in_the_first_harmonic():
    tangent, orders = tangent_of_equal_sectors(), (1, 2, 3, 4, 5)
    structure = build_structure(build_ring(one_sector(1), PATTERN), tangent.joint.omega, 3.3, orders)
    tangent = replace(tangent, joint=replace(tangent.joint, structure=structure))
    right, missing = np.random.default_rng(7).normal(size=tangent.at.predicted_h.shape), list[float]()
    factor = ring_factor.build_ring_factor(tangent, 0.0)
    whole = tangent.dense(np.arange(N), factor.width)
    for each in (factor, replace(factor, back=np.zeros((0, 0)))):
        left = right - (whole @ each.solve(right).ravel()).reshape(right.shape)
        missing.append(float(np.abs(left[:, 1:3]).max()))
    assert missing[0] <= 2e-3 <= 0.1 * missing[1]
    assert factor.sign == np.linalg.slogdet(whole)[0]


def test_a_force_on_one_blade_is_that_of_the_full_matrices():
    ring = build_structure(build_ring(one_sector(0), PATTERN, forced_sector=2), RATE, 3.0, (1,))
    full = whole_ring(0, PATTERN)
    # the displacements of all pairs come first, then the others sector by sector
    driven = full.linear[0].load_harmonic * np.concatenate([np.zeros(2 * N), np.repeat(np.arange(N) == 2, 5)])
    assert np.count_nonzero(driven) == 2
    whole = replace(full, linear={0: replace(full.linear[0], load_harmonic=driven)})
    wanted = build_structure(whole, RATE, 3.0, (1,))
    assert np.abs(ring.force_h - wanted.force_h).max() <= 1e-9 * np.abs(wanted.force_h).max()
    motion_h = np.random.default_rng(3).normal(size=(2 * N, 3))
    assert np.allclose(ring.response_h(motion_h), wanted.response_h(motion_h), rtol=1e-9, atol=1e-12)


def blades_on_a_stiff_disk(coupling: float, loss: float) -> ReducedModel:
    """A sector of one mass, 1 kg on 1 N/m, coupled to its neighbours, and of one pair that stays as it is."""
    structures = {}
    for k in range(N // 2 + 1):
        stiffness = np.diag([1.0, 1.0 + 2.0 * coupling * (1.0 - np.cos(2.0 * np.pi * k / N))])
        mass, load = np.diag([1e-3, 1.0]), np.array([0.0, 1.0])
        one = LinearModel(mass, loss * stiffness, stiffness, 0.0 * load, load.astype(complex), load[None])
        structures[k] = replace(one, blade=load[None])
    pair = np.array([[0, -1, -1]]), *np.ones((3, 1)), np.zeros((1, 3)), ("root",)
    return ReducedModel(structures, ContactInterface(*pair), ("tip",), N, 1)


def largest(sector: ReducedModel, deviation: FloatArray, rates: FloatArray) -> float:
    """Largest amplitude of any blade of a linear ring whose pairs stick, m."""
    model = build_ring(sector, deviation)
    return max(float(np.abs(build_structure(model, rate, 1.0, (1,)).harmonic_offset).max()) for rate in rates)


@pytest.mark.slow
def test_amplification_by_deviations_keeps_to_whiteheads_bound_and_comes_near_it():
    sector, random, bound = blades_on_a_stiff_disk(2e-3, 1e-3), np.random.default_rng(4), 0.5 * (1.0 + np.sqrt(N))
    tuned = largest(sector, np.zeros(N), 1.0 + np.linspace(0.0, 4e-3, 401))
    drawn = 4e-3 * random.standard_normal((1000, N))
    found = np.array([largest(sector, each, 1.0 + np.linspace(-6e-3, 1e-2, 9)) for each in drawn]) / tuned
    assert 1.0 < found.max() <= bound

    def opposite(x: FloatArray) -> float:
        return -largest(sector, 1e-3 * x[:N], 1.0 + 1e-3 * x[N:])

    start = [*1e3 * drawn[found.argmax()], 1.0]
    worst = minimize(opposite, start, method="Nelder-Mead", options={"maxfev": 3000})
    assert 0.9 * bound <= -worst.fun / tuned <= bound


def test_a_mode_of_equal_sectors_is_that_of_one():
    one = backbone(one_sector(0), [6e-5], 0.3)
    assert one.outcome[0].complete
    # the same motion in N sectors has N times the modal mass
    of_ring = backbone(build_ring(one_sector(0)), [6e-5 * np.sqrt(N)], 0.3)
    assert of_ring.frequency[0] == pytest.approx(one.frequency[0], rel=1e-9)
    assert of_ring.damping_ratio[0] == pytest.approx(one.damping_ratio[0], rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("diameter", "frequency", "load"), [(1, 280.0, 3.3), (3, 320.0, 12.0)])
def test_equal_sectors_rub_and_wear_as_one(diameter, frequency, load):
    sector = one_sector(diameter)
    one, ring = (march_wear(model, frequency, load, 0.3, 1e-10, 100.0) for model in (sector, build_ring(sector)))
    assert ring.outcome.complete
    assert ring.worn_volume[-1] == pytest.approx(N * one.worn_volume[-1], rel=2e-4)
    assert np.ptp(ring.wear_depth[-1]) <= 2e-3 * ring.wear_depth[-1].max()
    assert 0.5 <= ring.worn_volume_error[-1] / one.worn_volume_error[-1] <= 2.0
    assert np.abs(ring.response[0] - one.response[0]).max() <= 1e-4 * np.abs(one.response[0, 0])


def test_a_wave_beside_which_others_grow_is_unstable():
    # by time integration of the ring (`tests.benchmarks.ring`) the other waves grow by 1.09 in a period
    worn, settings = np.array([3.127e-6]), SolverSettings(harmonics=13, samples=360)
    fresh, later = (
        frequency_response(one_sector(2), [300.0], 10.0, 0.3, settings=settings, wear_depth=depth)
        for depth in (np.zeros(1), worn)
    )
    assert fresh.outcome[0].complete
    assert later.outcome[0] is Outcome.UNSTABLE
    assert "nodal diameter 1" in later.message[0]


def test_a_ring_with_deviating_blades_vibrates_and_grows_as_its_full_matrices():
    # the full matrices see all sectors at one time
    settings, states = SolverSettings(harmonics=9, samples=360), []
    for model in (build_ring(one_sector(1), PATTERN), whole_ring(1, PATTERN)):
        checked = check_case(model, 3.3, 0.3, "up", settings)
        _, case, _, state = balance_at_start(checked[0], checked[1], 280.0, "up", settings)
        joint = state.joint(case)
        response_h = joint.structure.response_h(joint.motion(state.evaluation))
        multipliers, _ = multipliers_of(build_monodromy(joint, state.evaluation, 360), every=True)
        states.append((np.hypot(*response_h[:, 1:3].T), np.sort(np.abs(multipliers))[-6:]))
    (one, growth), (other, its) = states
    assert np.ptp(one) > 0.01 * one.max()
    assert np.abs(one - other).max() <= 1e-3 * other.max()
    assert np.abs(growth - its).max() <= 1e-3


@pytest.mark.slow
def test_a_wave_that_grows_is_named_where_other_pairs_stick_in_each_sector(monkeypatch):
    monkeypatch.setattr(floquet, "GROWTH", -0.01)  # which every state does then
    ring = build_ring(one_sector(1), [0.004, -0.007, 0.002, 0.0, -0.003, 0.009])
    friction, gap = np.array([0.3, 0.25, 0.3, 0.35, 0.3, 0.3]), np.array([0.0, 2.5e-6, 0.0, 1e-6, 0.0, 4e-6])
    ring = replace(ring, contact=replace(ring.contact, friction_coefficient=friction, gap=ring.contact.gap + gap))
    settings = SolverSettings(harmonics=5, samples=90)
    checked = check_case(ring, 3.3, None, "up", settings)
    _, case, _, state = balance_at_start(checked[0], checked[1], 280.0, "up", settings)
    n_stuck = np.count_nonzero(floquet.switching_pairs(state.evaluation)[1])
    assert 0 < n_stuck < N
    assert floquet.find_multipliers(case, state, Run(1e-8), growing_only=True).wave in range(N // 2 + 1)


def test_a_ring_at_rest_begins_from_its_sector():
    settings, states = SolverSettings(harmonics=3, samples=64), []
    for model in (one_sector(1), build_ring(one_sector(1))):
        states.append(state_at_rest(case_of(model, 0.3, RATE, settings), RATE, Run(1e-10)))
    one, ring = (each.evaluation.predicted_h[:, 0] for each in states)
    assert np.abs(ring - np.tile(one, N)).max() <= 1e-12 * np.abs(one).max()


def test_sectors_with_other_friction_come_to_rest_by_themselves():
    settings = SolverSettings(harmonics=3, samples=64)
    case = case_of(build_ring(one_sector(1)), np.linspace(0.1, 0.5, N), RATE, settings)
    assert at_rest(case.joint(RATE, 0.0)) is None
    assert state_at_rest(case, RATE, Run(1e-10)).evaluation.scaled_residual() <= 1e-10
