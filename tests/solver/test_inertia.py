"""Masses on sliders against an exact and a plain twin, and at rest; `test_balance` has their derivatives."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.contact.coulomb import STICK
from solver.contact.sliding_masses import step_line
from solver.structure.fourier import build_basis, to_complex
from tests.solver import mass_twin
from tests.solver.kernel_cases import FRICTION, mass_case, run_masses

FloatArray = np.ndarray
GAIN, LOSS = 10.5, 9.5  # kg/s
values = st.integers(-(10**6), 10**6).map(lambda count: 1e-3 * count)


# ----------------------------------------------------------------------------------------------------------- one step


@given(force=values, velocity=values, limit=values.map(abs))
def test_a_step_along_a_line_obeys_newton_and_coulomb(force, velocity, limit):
    friction, after, mean, speed = step_line(force, velocity, limit, GAIN, LOSS, np.empty((3, 3)))
    size = abs(force) + LOSS * abs(velocity) + limit
    assert abs(friction) <= limit + 1e-14 * size
    assert GAIN * after == pytest.approx(force - friction + LOSS * velocity, abs=1e-13 * size)
    assert speed >= abs(mean) - 1e-14 * size
    # friction takes the momentum along the velocity, never more than there is
    if velocity * after > 0:
        assert friction == np.sign(velocity) * limit
        assert speed == pytest.approx(abs(mean), rel=1e-15)
    if velocity == 0 and abs(force) <= limit:
        assert (after, mean, speed) == (0.0, 0.0, 0.0)
        assert friction == force


# --------------------------------------------------------------------------------------------- the period and its twin


def line_case(predicted_h, n_samples, mass=1.3, line=0):
    """One pair with one tangent; predicted_h (3, 7), N."""
    basis = build_basis((1, 2, 3), n_samples)
    template = mass_case(1, 0, basis)
    moved = predicted_h.copy()
    if line == 1:
        moved[[1, 2]] = moved[[2, 1]]
    drag = np.array([0.1 * mass * template.omega])
    only = np.array([line])
    return replace(template, predicted_h=moved[None], mass=np.array([mass]), drag=drag, line=only)


def force_on_a_line(seed):
    """Harmonics (3, 7), N, of a normal force that stays positive and of a force along the first tangent."""
    random = np.random.default_rng(seed)
    predicted_h = random.normal(size=(3, 7)) * 4.0
    predicted_h[0, 1:] *= 0.6
    predicted_h[0, 0] = 15.0
    predicted_h[1, 0] *= 0.1
    predicted_h[2] = 0.0
    return predicted_h


def series(row, omega):
    return mass_twin.Series(np.concatenate([[row[0]], to_complex(row)]), omega)


def marched(case):
    """Complex harmonics 0, 1, 2, 3 of the friction force of the one pair, and its slip work."""
    found, line = run_masses(case, case.predicted_h), int(case.line[0])
    force_h = (found.force_t @ case.basis.analysis)[0, 1 + line] / case.basis.step_mean
    return np.concatenate([[force_h[0]], to_complex(force_h)]), float(found.slip_work[0])


@pytest.mark.parametrize(("seed", "signs"), [(0, 3), (2, 2), (3, 3), (4, 3), (8, 3), (14, 3), (15, 3)])
def test_a_line_is_that_of_the_exact_twin_to_second_order(seed, signs):
    predicted_h = force_on_a_line(seed)
    case = line_case(predicted_h, 64)
    normal = series(predicted_h[0], case.omega)
    mass, drag = float(case.mass[0]), float(case.drag[0])
    slides = mass_twin.slide_exactly(
        series(predicted_h[1], case.omega), normal.scaled(FRICTION), mass, drag, periods=20
    )
    assert len({slide.sign for slide in slides}) == signs
    exact = np.array([mass_twin.harmonic(slides, n, case.omega) for n in range(4)])
    work = mass_twin.slip_work(slides, normal)
    samples = np.array([32, 64, 128, 256, 512, 1024, 2048])
    force_errors, work_errors = [], []
    for n_samples in samples:
        force, found = marched(line_case(predicted_h, int(n_samples)))
        force_errors.append(np.abs(force - exact).max() / np.abs(exact).max())
        work_errors.append(abs(found / work - 1.0))
    for errors in (force_errors, work_errors):
        # events fall anywhere in their steps, so the errors scatter about their order
        assert np.polyfit(np.log(samples), np.log(errors), 1)[0] < -1.6
        assert (np.array(errors) < 80.0 / samples**2).all()


def plane_case(seed, n_samples):
    basis = build_basis((1, 2, 3), n_samples)
    case = mass_case(1, seed, basis)
    random = np.random.default_rng(seed)
    predicted_h = random.normal(size=(1, 3, 7)) * 4.0
    predicted_h[:, 0, 0] = 15.0
    predicted_h[:, 1:, 0] *= 0.1
    return replace(case, predicted_h=predicted_h, line=np.array([-1]))


def plane_result(seed, n_samples):
    case = plane_case(seed, n_samples)
    found = run_masses(case, case.predicted_h)
    return (found.force_t @ case.basis.analysis)[0, 1:] / case.basis.step_mean, float(found.slip_work[0])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_plane_is_that_of_a_plain_twin_with_tiny_steps(seed):
    n_steps = 8192
    fine = plane_case(seed, n_steps)
    predicted = fine.predicted_h[0] @ fine.basis.synthesis
    limit = FRICTION * np.maximum(predicted[0], 0.0)
    force, moved = mass_twin.step_in_the_plane(
        predicted[1:], limit, float(fine.mass[0]), float(fine.drag[0]), n_steps * fine.step
    )
    expected = force @ fine.basis.analysis
    work = float((predicted[0].clip(0.0) * np.hypot(*moved)).sum() * fine.step)
    assert 0.0 < (np.hypot(*moved) == 0.0).mean() < 0.9, "sticks and slips"
    found, found_work = plane_result(seed, n_steps // 8)
    # the twin is of first order: 2 pi / N of the period, several times over
    assert found == pytest.approx(expected, abs=3e-3 * np.abs(expected).max())
    assert found_work == pytest.approx(work, rel=3e-3)


# -------------------------------------------------------------------------------------------------------------- limits


def test_a_stuck_mass_is_exactly_at_rest_and_wears_exactly_zero():
    case = mass_case(6, 5)
    held = case.predicted_h.copy()
    held[:, 0] = 0.0
    held[:, 0, 0] = 1e3
    found = run_masses(case, held)
    assert (found.status_t == STICK).all()
    for exactly_zero in (found.start, found.state_t, found.slip_work, found.change):
        assert not exactly_zero.any()
    assert found.force_t == pytest.approx(case.predicted_t(held), rel=1e-14)
