"""Contact kernels against the law, a plain twin, differences, and themselves without compilation."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.contact.coulomb import SEPARATED, SLIP, STICK, contact_sample, mean_normal_force
from solver.structure.fourier import build_basis
from tests.solver import contact_twin
from tests.solver.kernel_cases import BASIS, FRICTION, kernel_case, kernel_results, run_pairs

number = st.integers(-(10**8), 10**8).map(lambda count: 1e-6 * count)  # N; no squares that underflow
friction_coefficients = st.one_of(st.just(0.0), st.floats(0.01, 2.0))


@given(
    normal=number, tangents=st.tuples(number, number), states=st.tuples(number, number), friction=friction_coefficients
)
def test_every_sample_obeys_signorini_and_coulomb(normal, tangents, states, friction):
    pressure, *rest, status = contact_sample(normal, *tangents, friction, *states)
    force, state = np.array(rest[:2]), np.array(rest[2:])
    moved = state - np.array(states)
    assert pressure == max(normal, 0.0)
    assert np.linalg.norm(force) <= friction * pressure * (1 + 1e-15)
    # the spring between predicted force and slider carries the force
    assert force + state == pytest.approx(np.array(tangents), abs=1e-13)
    if status == SEPARATED:
        assert normal <= 0
        assert not force.any()
    elif status == STICK:
        assert np.linalg.norm(force) < friction * pressure
        assert not moved.any()
    else:
        assert status == SLIP
        assert np.linalg.norm(force) == pytest.approx(friction * pressure, rel=1e-14, abs=1e-300)
        # slip along the force
        assert moved @ force == pytest.approx(np.linalg.norm(moved) * np.linalg.norm(force), rel=1e-9, abs=1e-9)


def assert_that_of_the_twin(case, found, pair, start, periods, tolerance):
    force, slip = contact_twin.pair_period(case.predicted_t[pair], FRICTION, start, periods)
    assert found.force_t[pair] == pytest.approx(force, abs=tolerance)
    assert found.state_t[pair] == pytest.approx(slip, abs=tolerance)
    assert np.array_equal(found.status_t[pair], contact_twin.status(case.predicted_t[pair], FRICTION, slip[:, :-1]))
    return slip


@pytest.mark.parametrize("most_periods", [1, 2, 5])
def test_displacement_level_is_that_of_the_plain_twin(most_periods):
    case = kernel_case(4, 24, seed=1)
    found = run_pairs(case.predicted_t, case.start, 0.0, most_periods)
    for pair in range(4):
        slip = assert_that_of_the_twin(case, found, pair, case.start[pair], found.periods[pair], 1e-11)
        assert found.change[pair] == pytest.approx(np.linalg.norm(slip[:, -1] - slip[:, 0]), abs=1e-11)
    assert found.periods.max() <= most_periods
    assert {SEPARATED, STICK, SLIP} <= set(found.status_t.ravel())


def test_wear_of_a_rectangular_loop_is_its_area_over_the_friction_coefficient():
    # Constant pressure P, p_T = A cos: once periodic, the slider moves to and fro over 2 (A - mu P), so the integral of
    # P |dX| is 4 P (A - mu P); the samples contain both turns of p_T, so it holds to round-off.
    pressure, amplitude, n = 10.0, 12.0, 64
    predicted = np.zeros((1, 3, n))
    predicted[0, 0] = pressure
    predicted[0, 1] = amplitude * np.cos(2 * np.pi * np.arange(n) / n)
    found = run_pairs(predicted, np.full((1, 2), 3.0), 1e-12, 8)
    assert found.change[0] == pytest.approx(0, abs=1e-12)
    expected = 4 * pressure * (amplitude - FRICTION * pressure)
    assert found.slip_work[0] == pytest.approx(expected, rel=1e-12, abs=0.0)
    # the loop of lambda_T over X_T is a rectangle: mu times the wear integral is the work
    work = 0.5 * (found.force_t[0, 1] + np.roll(found.force_t[0, 1], 1)) @ np.diff(found.state_t[0, 0])
    assert work <= FRICTION * expected * (1 + 1e-12)


def test_harmonics_of_a_force_that_opens_converge_with_the_square_of_the_samples():
    # max(cos(t - 1) - 0.3, 0): closed for |t - 1| < a, cos a = 0.3
    a = np.arccos(0.3)
    exact = np.array([(np.sin(a) - 0.3 * a) / np.pi, (a - 0.3 * np.sin(a)) / np.pi])
    errors = []
    for samples in (32, 64, 128, 256):
        predicted_t = np.zeros((1, 3, samples))
        predicted_t[0, 0] = np.cos(2 * np.pi * np.arange(samples) / samples - 1.0) - 0.3
        force_h = mean_normal_force(predicted_t)[0] @ build_basis((1,), samples).analysis
        errors.append(max(abs(force_h[0] - exact[0]), abs(force_h[1] - exact[1] * np.cos(1.0))))
    # kinks of slope sin a: at most (2 pi / N)^2 sin a, two of them, over the period
    assert all(
        error < 2 * (2 * np.pi / n) ** 2 * np.sin(a) / np.pi
        for error, n in zip(errors, (32, 64, 128, 256), strict=True)
    )


def slowly_closing(seed, n_contact=6):
    """Pairs that slip along one direction and are pulled across it: what lies across closes by a little a period."""
    case = kernel_case(n_contact, BASIS.n_samples, seed=seed)
    predicted_h = case.predicted_h.copy()
    predicted_h[:, 0] *= 0.3
    predicted_h[:, 0, 0] = 20.0
    predicted_h[:, 1:] *= 0.1
    predicted_h[:, 1, 1] = np.linspace(8.4, 10.0, n_contact)
    return replace(case, predicted_h=predicted_h, predicted_t=predicted_h @ BASIS.synthesis)


@pytest.mark.parametrize("seed", [31, 33])
def test_a_closure_found_by_newtons_method_is_where_plain_passes_lead(seed):
    case = slowly_closing(seed)
    found = run_pairs(case.predicted_t, case.start, 1e-9, 400)
    assert (found.change <= 1e-9).all()
    slowest = 0
    for pair in range(len(case.start)):
        start, plain, left = case.start[pair], 1, 1.0
        while left >= 1e-12:
            _, slip = contact_twin.pair_period(case.predicted_t[pair], FRICTION, start, 1)
            left, start, plain = np.linalg.norm(slip[:, -1] - start), slip[:, -1], plain + 1
        slowest = max(slowest, plain)
        assert_that_of_the_twin(case, found, pair, start, 1, 1e-6)
    assert slowest > 40
    assert found.periods.max() < 20


@pytest.mark.slow
def test_kernels_give_the_same_numbers_without_compilation(tmp_path):
    path = tmp_path / "plain.npz"
    root = Path(__file__).parents[2]
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(root)}
    code = "import sys; from tests.solver.kernel_cases import save_results; save_results(sys.argv[1])"
    subprocess.run([sys.executable, "-c", code, str(path)], check=True, env=environment, cwd=root, timeout=1200)
    with np.load(path) as plain:
        assert bool(plain["disabled"])
        compiled = kernel_results()
        assert set(plain.files) == {*compiled, "disabled"}
        for name, values in compiled.items():
            assert values == pytest.approx(plain[name], rel=1e-12, abs=1e-12 * max(np.abs(values).max(), 1e-300)), name
