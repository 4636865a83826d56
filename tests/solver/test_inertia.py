"""Masses on sliders against an exact and a plain twin, their limits, and their derivative against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from solver.contact.coulomb import SEPARATED, SLIP, STICK
from solver.contact.rigid_slider import step_line, step_mass, step_plane
from solver.structure.fourier import build_basis, to_complex
from tests.solver import mass_twin
from tests.solver.kernel_cases import FRICTION, MASS_BASIS, MassCase, mass_case, masses_tangent, run_masses

FloatArray = np.ndarray
GAIN, LOSS = 10.5, 9.5  # kg/s
values = st.integers(-(10**6), 10**6).map(lambda count: 1e-3 * count)


def one_step(force: float, velocity: float, limit: float) -> tuple[FloatArray, FloatArray]:
    """Friction, velocity after, mean velocity and mean speed of a step along a line, and its derivative."""
    tangent = np.full((3, 3), np.nan)
    return np.array(step_line(force, velocity, limit, GAIN, LOSS, tangent)), tangent


# ----------------------------------------------------------------------------------------------------------- one step


@given(force=values, velocity=values, limit=values.map(abs))
def test_a_step_along_a_line_obeys_newton_and_coulomb(force: float, velocity: float, limit: float) -> None:
    (friction, after, mean, speed), _ = one_step(force, velocity, limit)
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


@given(force=values, velocity=values, limit=values.map(abs))
def test_a_step_is_the_same_in_either_direction(force: float, velocity: float, limit: float) -> None:
    (friction, after, mean, speed), tangent = one_step(force, velocity, limit)
    mirrored, its_tangent = one_step(-force, -velocity, limit)
    assert mirrored.tolist() == [-friction, -after, -mean, speed]
    assert its_tangent == pytest.approx(tangent * np.array([[1, 1, -1], [1, 1, -1], [-1, -1, 1]]), rel=1e-15)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("force", "velocity", "limit"),
    [
        (3.0, (5.0 - 3.0) / LOSS, 5.0),  # comes to rest just at the end of the step: slides on, or stops
        (-4.0, (5.0 + 4.0) / LOSS, 5.0),  # the same under a force against the motion
        (-9.0, (5.0 + 9.0) / LOSS, 5.0),  # stops at the end, or turns
        (-5.0, 0.3, 5.0),  # stays behind its turn, or goes back
        (5.0, 0.0, 5.0),  # stays at rest, or starts
        (2.0, 0.0, 5.0),  # moves and stops at once, or is at rest
        (9.0, 0.0, 5.0),  # starts from rest, or moves already
        (-9.0, 0.0, 5.0),  # turns at once, or starts from rest
    ],
)
def test_the_branches_of_a_step_meet(force: float, velocity: float, limit: float, sign: float) -> None:
    base = np.array([sign * force, sign * velocity, limit])
    here, _ = one_step(*base)
    random = np.random.default_rng(1)
    for size in (1e-3, 1e-6, 1e-9):
        for _ in range(40):
            there, _ = one_step(*(base + size * random.uniform(-1.0, 1.0, 3)))
            # no jump: the slopes are at most those of loss / retarding force
            assert np.abs(there - here).max() < 30.0 * size


@settings(max_examples=300)
@given(
    force=st.floats(-20.0, 20.0), velocity=st.floats(-2.0, 2.0).filter(lambda v: abs(v) > 1e-2), limit=st.floats(0.1, 8)
)
def test_the_derivative_of_a_step_is_that_of_differences(force: float, velocity: float, limit: float) -> None:
    at = np.array([force, velocity, limit])
    # away from the borders of the branches, and from a stop that takes no force at all
    forward = np.sign(velocity)
    assume(abs(forward * force - limit + LOSS * abs(velocity)) > 1e-2)
    assume(abs(forward * force + limit) > 1e-2)
    _, tangent = one_step(*at)
    for column, step in enumerate((1e-5, 1e-6, 1e-5)):
        ends = []
        for side in (1.0, -1.0):
            moved = at.copy()
            moved[column] += side * step
            ends.append(one_step(*moved)[0][[0, 1, 3]])
        difference = (ends[0] - ends[1]) / (2.0 * step)
        assert tangent[:, column] == pytest.approx(difference, rel=1e-6, abs=1e-6 * max(np.abs(tangent).max(), 1.0))


def test_a_step_from_rest_has_its_derivative_in_force_and_limit() -> None:
    for force in (7.0, -7.0):
        at = np.array([force, 0.0, 5.0])
        _, tangent = one_step(*at)
        for column in (0, 2):
            moved = np.eye(3)[column] * 1e-6
            difference = (one_step(*(at + moved))[0] - one_step(*(at - moved))[0])[[0, 1, 3]] / 2e-6
            assert tangent[:, column] == pytest.approx(difference, abs=1e-8)
        # a velocity before in the direction of the motion is carried on, one against it is lost on the way back
        there = np.array([0.0, np.sign(force) * 1e-7, 0.0])
        assert tangent[:, 1] == pytest.approx(
            (one_step(*(at + there))[0] - one_step(*at)[0])[[0, 1, 3]] / there[1], abs=1e-6
        )


@pytest.mark.slow
@pytest.mark.parametrize("line", [0, 1])
def test_a_pair_with_one_tangent_moves_along_it_alone(line: int) -> None:
    force, velocity = np.array([7.0, -11.0]), np.array([0.3, 0.4])
    out, tangent = np.full(7, np.nan), np.full((5, 5), np.nan)
    step_mass(force, velocity, 5.0, GAIN, LOSS, line, out, tangent)
    small = np.empty((3, 3))
    friction, after, mean, speed = step_line(force[line], velocity[line], 5.0, GAIN, LOSS, small)
    expected = np.zeros(7)
    expected[[line, 2 + line, 4 + line, 6]] = friction, after, mean, speed
    assert np.array_equal(out, expected)
    rows = [line, 2 + line, 4]
    assert np.array_equal(tangent[np.ix_(rows, rows)], small)
    tangent[np.ix_(rows, rows)] = 0.0
    assert not tangent.any()


@pytest.mark.slow
@settings(max_examples=200)
@given(seed=st.integers(0, 2**31), limit=st.floats(0.1, 20.0))
def test_the_derivative_of_a_step_in_the_plane_is_that_of_differences(seed: int, limit: float) -> None:
    random = np.random.default_rng(seed)
    at = np.concatenate([random.normal(size=2) * 8.0, random.normal(size=2), [limit]])

    def run(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        out, tangent = np.empty(7), np.empty((5, 5))
        step_plane(x[:2].copy(), x[2:4].copy(), x[4], GAIN, LOSS, out, tangent)
        return out, tangent

    out, tangent = run(at)
    mass, drag = 0.5 * (GAIN + LOSS), GAIN - LOSS
    momentum = at[:2] - out[:2] - drag * out[4:6]
    assert mass * (out[2:4] - at[2:4]) == pytest.approx(momentum, abs=1e-12 * np.abs(at).max() * GAIN)
    assert np.hypot(out[0], out[1]) <= limit * (1 + 1e-14)
    differences, kinks = np.empty((5, 5)), 0.0
    for column in range(5):
        moved = np.eye(5)[column] * 1e-6
        ahead, behind = ((run(at + side * moved)[0] - out)[[0, 1, 2, 3, 6]] * side / 1e-6 for side in (1.0, -1.0))
        differences[:, column] = 0.5 * (ahead + behind)
        kinks = max(kinks, float(np.abs(ahead - behind).max()))
    assume(kinks < 1e-3)  # a part of the step that just comes to rest
    assert tangent == pytest.approx(differences, abs=1e-6 * max(np.abs(differences).max(), 1.0))


# --------------------------------------------------------------------------------------------- the period and its twin


def line_case(predicted_h: FloatArray, n_samples: int, mass: float = 1.3, line: int = 0) -> MassCase:
    """One pair with one tangent; predicted_h (3, 7), N."""
    basis = build_basis((1, 2, 3), n_samples)
    template = mass_case(1, 0, basis)
    moved = predicted_h.copy()
    if line == 1:
        moved[[1, 2]] = moved[[2, 1]]
    drag = np.array([0.1 * mass * template.omega])
    only = np.array([line])
    return replace(template, predicted_h=moved[None], mass=np.array([mass]), drag=drag, line=only)


def force_on_a_line(seed: int) -> FloatArray:
    """Harmonics (3, 7), N, of a normal force that stays positive and of a force along the first tangent."""
    random = np.random.default_rng(seed)
    predicted_h = random.normal(size=(3, 7)) * 4.0
    predicted_h[0, 1:] *= 0.6
    predicted_h[0, 0] = 15.0
    predicted_h[1, 0] *= 0.1
    predicted_h[2] = 0.0
    return predicted_h


def series(row: FloatArray, omega: float) -> mass_twin.Series:
    return mass_twin.Series(np.concatenate([[row[0]], to_complex(row)]), omega)


def marched(case: MassCase) -> tuple[FloatArray, float]:
    """Complex harmonics 0, 1, 2, 3 of the friction force of the one pair, and its slip work."""
    force_t, _, _, _, slip_work, _ = run_masses(case, case.predicted_h)
    line = int(case.line[0])
    force_h = (force_t @ case.basis.analysis)[0, 1 + line] / case.step_share
    return np.concatenate([[force_h[0]], to_complex(force_h)]), float(slip_work[0])


@pytest.mark.parametrize(("seed", "signs"), [(0, 3), (2, 2), (3, 3), (4, 3), (8, 3), (14, 3), (15, 3)])
def test_a_line_is_that_of_the_exact_twin_to_second_order(seed: int, signs: int) -> None:
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


@pytest.mark.parametrize("seed", [0, 3])
def test_both_tangents_are_alike(seed: int) -> None:
    predicted_h = force_on_a_line(seed)
    first, second = (marched(line_case(predicted_h, 64, line=line)) for line in (0, 1))
    assert np.array_equal(first[0], second[0])
    assert first[1] == second[1]


def test_a_mass_that_turns_without_a_stop_is_that_of_the_exact_twin() -> None:
    predicted_h = force_on_a_line(5)
    predicted_h[1, 1:] *= 0.1
    predicted_h[1, 1:3] = [40.0, -10.0]
    normal = series(predicted_h[0], 3.0)
    case = line_case(predicted_h, 512)
    slides = mass_twin.slide_exactly(
        series(predicted_h[1], case.omega), normal.scaled(FRICTION), case.mass[0], case.drag[0], periods=40
    )
    assert {slide.sign for slide in slides} == {-1, 1}
    force, work = marched(case)
    exact = np.array([mass_twin.harmonic(slides, n, case.omega) for n in range(4)])
    assert np.abs(force - exact).max() < 1e-4 * np.abs(exact).max()
    assert work == pytest.approx(mass_twin.slip_work(slides, normal), rel=1e-4)


def plane_case(seed: int, n_samples: int) -> MassCase:
    basis = build_basis((1, 2, 3), n_samples)
    case = mass_case(1, seed, basis)
    random = np.random.default_rng(seed)
    predicted_h = random.normal(size=(1, 3, 7)) * 4.0
    predicted_h[:, 0, 0] = 15.0
    predicted_h[:, 1:, 0] *= 0.1
    return replace(case, predicted_h=predicted_h, line=np.array([-1]), has_normal=np.ones(1, bool))


def plane_result(seed: int, n_samples: int) -> tuple[FloatArray, float]:
    case = plane_case(seed, n_samples)
    force_t, _, _, _, slip_work, _ = run_masses(case, case.predicted_h)
    return (force_t @ case.basis.analysis)[0, 1:] / case.step_share, float(slip_work[0])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_plane_is_that_of_a_plain_twin_with_tiny_steps(seed: int) -> None:
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


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_plane_converges_with_samples_at_first_order(seed: int) -> None:
    limit, limit_work = plane_result(seed, 32768)
    samples = np.array([64, 128, 256, 512, 1024, 2048])
    force_errors, work_errors = [], []
    for n_samples in samples:
        force, work = plane_result(seed, int(n_samples))
        force_errors.append(np.abs(force - limit).max() / np.abs(limit).max())
        work_errors.append(abs(work / limit_work - 1.0))
    for errors in (force_errors, work_errors):
        assert np.polyfit(np.log(samples), np.log(errors), 1)[0] == pytest.approx(-1.0, abs=0.3)
        assert (np.array(errors) < 2.0 / samples).all()


def test_a_straight_motion_in_the_plane_is_that_along_the_line() -> None:
    predicted_h = force_on_a_line(2)
    along = np.array([0.6, -0.8])
    errors = []
    for n_samples in (128, 512, 2048):
        line = line_case(predicted_h, n_samples)
        turned = predicted_h.copy()
        turned[1:] = along[:, None] * predicted_h[1]
        plane = replace(line, predicted_h=turned[None], line=np.array([-1]))
        force_t, velocity_t, *_ = run_masses(plane, plane.predicted_h)
        across = np.array([0.8, 0.6])
        assert np.abs(across @ force_t[0, 1:]).max() < 1e-12 * np.abs(force_t).max()
        assert np.abs(across @ velocity_t[0]).max() < 1e-12 * np.abs(velocity_t).max()
        force_h = along @ (force_t @ plane.basis.analysis)[0, 1:] / plane.step_share
        expected, _ = marched(line)
        errors.append(np.abs(np.concatenate([[force_h[0]], to_complex(force_h)]) - expected).max())
    assert errors[0] < 0.1
    assert errors[2] < errors[0] / 8.0


# -------------------------------------------------------------------------------------------------------------- limits


def test_a_period_is_marched_until_its_velocity_repeats() -> None:
    case = mass_case(12, 3)
    _, velocity_t, place_t, status_t, _, error = run_masses(case, case.predicted_h)
    assert {SEPARATED, STICK, SLIP} <= set(status_t.ravel())
    largest = np.abs(velocity_t).max(axis=(1, 2))
    assert (np.abs(velocity_t[:, :, -1] - velocity_t[:, :, 0]).max(axis=1) <= 1e-11 * largest).all()
    assert (error <= 1e-9 * np.abs(case.predicted_h).max()).all()
    assert not place_t[:, :, 0].any()


def test_a_velocity_that_only_the_drag_forgets_repeats_too() -> None:
    # almost no friction: the start decays by exp(-2 pi 0.1) a period
    case = mass_case(3, 4, opens=False)
    weak = case.predicted_h.copy()
    weak[:, 0] *= 1e-9
    _, velocity_t, _, _, _, error = run_masses(case, weak)
    largest = np.abs(velocity_t).max(axis=(1, 2))
    assert (np.abs(velocity_t[:, :, -1] - velocity_t[:, :, 0]).max(axis=1) <= 1e-11 * largest).all()
    assert (error < 1e-9).all()


def test_a_stuck_mass_is_exactly_at_rest_and_wears_exactly_zero() -> None:
    case = mass_case(6, 5)
    held = case.predicted_h.copy()
    held[:, 0] = 0.0
    held[:, 0, 0] = 1e3
    force_t, velocity_t, place_t, status_t, slip_work, error = run_masses(case, held)
    assert (status_t == STICK).all()
    for exactly_zero in (velocity_t, place_t, slip_work, error):
        assert not exactly_zero.any()
    assert force_t == pytest.approx(case.predicted_t(held), rel=1e-14)


def test_a_mass_that_sticks_for_part_of_the_period_rests_exactly_meanwhile() -> None:
    case = mass_case(12, 3)
    force_t, velocity_t, place_t, status_t, *_ = run_masses(case, case.predicted_h)
    stuck = status_t == STICK
    assert 0.05 < stuck.mean() < 0.9
    for values_t in (velocity_t[:, :, 1:], velocity_t[:, :, :-1], np.diff(place_t)):
        assert not np.moveaxis(values_t, 1, -1)[stuck].any()
    predicted_t = case.predicted_t(case.predicted_h)
    assert np.moveaxis(force_t, 1, -1)[stuck] == pytest.approx(np.moveaxis(predicted_t, 1, -1)[stuck], rel=1e-14)


@pytest.mark.parametrize("how", ["open", "frictionless"])
def test_without_a_friction_force_the_motion_is_linear(how: str) -> None:
    case = mass_case(6, 6)
    free_h = case.predicted_h.copy()
    if how == "open":
        free_h[:, 0] = 0.0
        free_h[:, 0, 0] = -5.0
    else:
        free_h[:, 0] = 0.0
    force_t, velocity_t, _, status_t, slip_work, _ = run_masses(case, free_h)
    assert (status_t == SEPARATED).all()
    assert not slip_work.any()
    assert not force_t.any()
    # the trapezoidal rule harmonic by harmonic, in the plane in parts of the step under a force constant over it
    amplitude = to_complex(free_h[:, 1:] * case.step_share)
    angle = np.pi * np.array(case.basis.orders) / case.basis.n_samples
    mass, drag = case.mass[:, None, None], case.drag[:, None, None]
    velocity = amplitude / (2j * mass * np.sin(angle) / case.step + drag * np.cos(angle))
    # the velocity after step n is half a step behind its sample
    phase = 2.0 * np.pi * (np.arange(case.basis.n_samples) + 0.5) / case.basis.n_samples
    turning = np.exp(1j * np.array(case.basis.orders)[:, None] * phase)
    expected = free_h[:, 1:, 0, None] / drag + np.real(velocity @ turning)
    straight = case.line >= 0
    assert velocity_t[straight][:, :, 1:] == pytest.approx(expected[straight], abs=1e-11 * np.abs(expected).max())
    # (drag dt / m)^2 / 12 over the parts is all that sets the two apart
    assert velocity_t[:, :, 1:] == pytest.approx(expected, abs=1e-3 * np.abs(expected).max())


def test_friction_takes_mu_times_the_normal_force_along_the_path() -> None:
    # work of the predicted force = viscous + mu N path, which is what wears
    defects = []
    samples = (64, 128, 256, 512, 1024)
    for n_samples in samples:
        predicted_h = force_on_a_line(3)
        case = line_case(predicted_h, n_samples)
        _, velocity_t, place_t, _, slip_work, _ = run_masses(case, case.predicted_h)
        work = float(case.predicted_t(case.predicted_h)[0, 1] @ np.diff(place_t[0, 0]))
        ends = velocity_t[0, 0]
        viscous = float(case.drag[0] * case.step * (ends[1:] ** 2 + ends[:-1] ** 2).sum() / 2.0)
        defects.append(abs(work - viscous - FRICTION * slip_work[0]) / work)
    assert np.polyfit(np.log(samples), np.log(defects), 1)[0] < -1.6
    assert defects[0] < 1e-2


# ---------------------------------------------------------------------------------------------------------- derivative


def assert_derivative(case: MassCase, slack: float = 1e-6) -> int:
    """Compare with central differences of the whole periodic march; the number of pairs away from a switch."""
    n_contact, m = case.predicted_h.shape[0], case.basis.synthesis.shape[0]
    step = 1e-5

    def run(predicted_h: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        force_t, velocity_t, _, _, slip_work, _ = run_masses(case, predicted_h)
        return (force_t @ case.basis.analysis / case.step_share)[:, 1:], slip_work, velocity_t[:, :, 0]

    force, work, start = run(case.predicted_h)
    force_tangent, wear_tangent = masses_tangent(case, start)
    assert not force_tangent[:, :m].any()
    force_differences = np.zeros((n_contact, 2 * m, 3 * m))
    work_differences = np.zeros((n_contact, 3 * m))
    kinks = np.zeros(n_contact)
    for component in range(3):
        exists = case.has_normal if component == 0 else (case.line < 0) | (case.line == component - 1)
        for k in range(m):
            sides = []
            for sign in (1.0, -1.0):
                moved = case.predicted_h.copy()
                moved[exists, component, k] += sign * step
                moved_force, moved_work, _ = run(moved)
                sides.append(((moved_force - force) * sign / step, (moved_work - work) * sign / step))
            column = component * m + k
            force_differences[:, :, column] = (0.5 * (sides[0][0] + sides[1][0])).reshape(n_contact, 2 * m)
            work_differences[:, column] = 0.5 * (sides[0][1] + sides[1][1])
            kinks = np.maximum(kinks, np.abs(sides[0][0] - sides[1][0]).max(axis=(1, 2)))
    away = 0
    for pair in range(n_contact):
        if kinks[pair] > 1e-3:
            continue  # an event on the end of a step
        away += 1
        exists = np.repeat([case.has_normal[pair], *((case.line[pair] < 0) | (case.line[pair] == np.arange(2)))], m)
        for found, expected in (
            (force_tangent[pair, m:][:, exists], force_differences[pair][:, exists]),
            (wear_tangent[pair][exists], work_differences[pair][exists]),
        ):
            assert np.abs(found - expected).max() < slack * np.abs(expected).max(), pair
            assert np.abs(expected).max() > 1e-2
    return away


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_derivative_of_the_periodic_march_is_that_of_differences(seed: int) -> None:
    case = mass_case(12, seed)
    *_, status_t, _, _ = run_masses(case, case.predicted_h)
    assert {SEPARATED, STICK, SLIP} <= set(status_t.ravel())
    assert not case.has_normal.all()
    assert assert_derivative(case) >= 9


@pytest.mark.slow
def test_the_derivative_holds_for_odd_harmonics_alone() -> None:
    assert assert_derivative(mass_case(9, 4, build_basis((1, 3, 7), 48))) >= 6


def test_the_derivative_goes_through_the_closure_of_the_period() -> None:
    # masses that turn without ever stopping remember their start for many periods: of the derivative of the velocity at
    # the start nothing may be left out
    case = mass_case(9, 7, opens=False)
    strong = case.predicted_h.copy()
    strong[:, 1:] *= 6.0
    case = replace(case, predicted_h=strong)
    _, velocity_t, _, status_t, _, _ = run_masses(case, strong)
    assert (status_t == SLIP).all(axis=1).sum() >= 6
    assert np.abs(velocity_t[:, :, 0]).max(axis=1).min() > 1e-3
    assert assert_derivative(case) >= 7


def test_the_derivative_of_a_stuck_pair_is_the_identity() -> None:
    case = mass_case(6, 8)
    held = case.predicted_h.copy()
    held[:, 0] = 0.0
    held[:, 0, 0] = 1e3
    case = replace(case, predicted_h=held)
    force_tangent, wear_tangent = masses_tangent(case, np.zeros((6, 2)))
    m = MASS_BASIS.synthesis.shape[0]
    for pair in range(6):
        for component in (1, 2):
            if case.line[pair] in (-1, component - 1):
                block = force_tangent[pair, component * m : (component + 1) * m]
                expected = np.zeros((m, 3 * m))
                expected[:, component * m : (component + 1) * m] = np.eye(m)
                assert block == pytest.approx(expected, abs=1e-13)
    assert not wear_tangent.any()
