"""Wear of the slider under a spring against its differential equation, and the rules of the march."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from solver.model import ReducedModel
from solver.outcome import Outcome
from solver.results.history import StartState, WearHistory
from solver.settings import Scheme, SolverSettings, first_resolution
from solver.structure.joint import build_case
from tests.references import slider_amplitude, slider_orbit, slider_wear_depth
from tests.solver.models import branch_states, march_wear, random_model, scene

OMEGA = 2 * np.pi * 160.0
FRICTION = 0.5
FORCE = 10.0
WEAR = 1.1e-11  # 1/Pa
AREA = 1e-4
END = 8e4
STEPS = (8000.0, 4000.0, 2000.0, 1000.0)
COARSE = SolverSettings(harmonics=5, samples=64, tolerance=1e-11)
FINE = SolverSettings(harmonics=21, samples=256)
SCHEMES: tuple[Scheme, ...] = ("explicit", "implicit")
CYCLES = np.linspace(0.0, END, 9)


@lru_cache
def slider_start(settings: SolverSettings) -> tuple[ReducedModel, StartState]:
    model = scene("sdof_slider", settings.harmonics)
    (start,) = branch_states(model, FRICTION, FORCE, [OMEGA], settings)
    assert start.outcome is Outcome.CONVERGED
    return model, start


def march(
    step: float,
    scheme: Scheme,
    cycles: np.ndarray = CYCLES,
    settings: SolverSettings = COARSE,
    wear: float = WEAR,
    largest_depth: float | None = None,
) -> WearHistory:
    model, start = slider_start(settings)
    return march_wear(model, FRICTION, start, wear, step, scheme, cycles, settings, largest_depth=largest_depth)


@lru_cache
def final_depth(step: float, scheme: Scheme, settings: SolverSettings = COARSE) -> float:
    history = march(step, scheme, settings=settings)
    assert history.outcome is Outcome.CONVERGED
    return float(history.wear_depth[-1, 0])


@lru_cache
def exact_depth(settings: SolverSettings = COARSE) -> float:
    """Depth at the end for the motion of this many harmonics and samples: all else is an error of the time integration.

    The wear rate is a function of the depth alone: it is tabulated from the states of a march, each of which is a state
    at its own depth whatever the step, and the differential equation is integrated with its interpolation.
    """
    fine = march(250.0, "implicit", np.linspace(0.0, 1.25 * END, 401), settings)
    rate = CubicSpline(fine.wear_depth[:, 0], fine.wear_rate / AREA)
    solution = solve_ivp(lambda _, w: rate(w), (0.0, END), [0.0], method="DOP853", rtol=1e-11, atol=1e-20)
    return float(solution.y[0, -1])


@pytest.mark.slow
@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_error_of_the_depth_is_of_first_order_in_the_step(scheme: Scheme) -> None:
    errors = np.array([final_depth(step, scheme) - exact_depth() for step in STEPS])
    assert (errors > 0).all() if scheme == "explicit" else (errors < 0).all()
    slope = np.polyfit(np.log(STEPS), np.log(np.abs(errors)), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.1)
    assert errors[-2] / errors[-1] == pytest.approx(2.0, rel=0.1, abs=0.0)


def test_both_schemes_have_the_same_limit() -> None:
    # their leading errors are opposite: the mean of both is of second order
    gap = [final_depth(step, "explicit") - final_depth(step, "implicit") for step in STEPS]
    assert (np.array(gap) > 0).all()
    slope = np.polyfit(np.log(STEPS), np.log(gap), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.1)
    limits = [2 * final_depth(1000.0, scheme) - final_depth(2000.0, scheme) for scheme in SCHEMES]
    assert limits[0] == pytest.approx(limits[1], rel=1e-4, abs=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", SCHEMES)
def test_with_21_harmonics_the_depth_is_that_of_the_exact_motion(scheme: Scheme) -> None:
    exact = slider_wear_depth(
        CYCLES,
        wear_coefficient=WEAR,
        area=AREA,
        friction_coefficient=FRICTION,
        normal_load=10.0,
        normal_stiffness=1e5,
        amplitude=lambda friction_force: slider_amplitude(0.1, 0.0, 1.6e5, FORCE, friction_force, OMEGA),
    )
    history = march(1000.0, scheme, settings=FINE)
    # first order: half of h times the change of the rate, and the error of the motion itself, below 1 %
    time_error = 0.5 * 1000.0 * (history.wear_rate[0] - history.wear_rate[-1]) / AREA
    assert time_error < 0.005 * exact[-1]
    assert np.abs(history.wear_depth[:, 0] - exact).max() < time_error + 0.01 * exact[-1]


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("step", [8000.0, 2000.0])
def test_the_error_estimate_is_that_of_the_time_integration(scheme: Scheme, step: float) -> None:
    history = march(step, scheme)
    true = abs(final_depth(step, scheme) - exact_depth()) / exact_depth()
    assert true / 3 < history.error_estimate < 3 * true


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_step_follows_its_own_equation(scheme: Scheme) -> None:
    # one step: W = h g(W_0) or W = h g(W); wear_rate is that of the states at both ends
    history = march(8000.0, scheme, np.array([0.0, 8000.0]))
    rate = history.wear_rate[0 if scheme == "explicit" else 1] / AREA
    assert history.wear_depth[1, 0] == pytest.approx(8000.0 * rate, rel=1e-7, abs=0.0)
    assert history.worn_volume == pytest.approx(history.wear_depth[:, 0] * AREA, rel=1e-14, abs=0.0)


def test_the_wear_rate_is_that_of_the_sliding_path() -> None:
    # the slider moves to and fro between two turns: its path is twice the range of its slip
    history = march(8000.0, "explicit", np.array([0.0, 8000.0]))
    path = 2.0 * history.slip_range[0, 0]
    # the range is that of the ends of the steps, the turn lies in between
    assert history.wear_rate[0] == pytest.approx(WEAR * 10.0 * path, rel=(2 * np.pi / COARSE.samples) ** 2, abs=0.0)


def test_the_normal_force_falls_with_the_depth() -> None:
    history = march(4000.0, "implicit")
    assert history.mean_pressure[:, 0] * AREA == pytest.approx(10.0 - 1e5 * history.wear_depth[:, 0], rel=1e-9, abs=0.0)
    assert not history.open_fraction.any()


@pytest.mark.slow
@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_worn_slider_moves_as_its_friction_force_lets_it(scheme: Scheme) -> None:
    history = march(4000.0, scheme, CYCLES[::2], FINE)
    for depth, response in zip(history.wear_depth[:, 0], history.response[:, 0], strict=True):
        friction_force = FRICTION * (10.0 - 1e5 * depth)
        exact = slider_orbit(0.1, 0.0, 1.6e5, FORCE, friction_force, OMEGA).harmonic(0)
        assert abs(response) == pytest.approx(abs(exact), rel=0.02, abs=0.0)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_wear_never_falls(scheme: Scheme) -> None:
    history = march(8000.0, scheme)
    assert (np.diff(history.wear_depth, axis=0) > 0).all()
    assert (np.diff(history.worn_volume) > 0).all()
    assert history.worn_volume[0] == 0.0
    assert np.array_equal(history.cycles, CYCLES)
    assert np.isnan(history.jump_cycle)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_outputs_between_steps_are_interpolated(scheme: Scheme) -> None:
    at_steps = march(8000.0, scheme, np.array([0.0, 8000.0, 16000.0]))
    between = march(8000.0, scheme, np.array([0.0, 2000.0, 8000.0, 14000.0, 16000.0]))
    for name in ("wear_depth", "wear_rate", "worn_volume", "mean_pressure", "slip_range", "response", "response_peak"):
        ends, inner = (getattr(history, name) for history in (at_steps, between))
        assert inner[[0, 2, 4]] == pytest.approx(ends, rel=1e-14, abs=0.0), name
        assert inner[1] == pytest.approx(0.75 * ends[0] + 0.25 * ends[1], rel=1e-12, abs=0.0), name
        assert inner[3] == pytest.approx(0.25 * ends[1] + 0.75 * ends[2], rel=1e-12, abs=0.0), name


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_last_count_is_reached_where_the_step_does_not_divide_it(scheme: Scheme) -> None:
    # 3000 + 3000 + 1000: the last, short step is a step of its own
    history = march(3000.0, scheme, np.array([0.0, 6000.0, 7000.0]))
    assert history.outcome is Outcome.CONVERGED
    assert np.isfinite(history.wear_depth).all()
    grown = history.wear_depth[2, 0] - history.wear_depth[1, 0]
    rate = history.wear_rate[1 if scheme == "explicit" else 2] / AREA
    assert grown == pytest.approx(1000.0 * rate, rel=1e-6, abs=0.0)


def test_a_step_longer_than_the_march_is_the_march() -> None:
    long, whole = (march(step, "implicit", np.array([0.0, 5000.0])) for step in (1e9, 5000.0))
    assert np.array_equal(long.wear_depth, whole.wear_depth)


def test_the_largest_depth_rule_gives_every_step_that_depth() -> None:
    # Eq. (22): h = depth / g, from the state at the start of the step; one pair, so each step wears just that depth
    largest = 2e-6
    counts = [0.0]
    for _ in range(5):
        rate = march(1.0, "explicit", np.array([*counts, counts[-1] + 1.0]), largest_depth=largest).wear_rate[-2] / AREA
        counts.append(counts[-1] + largest / rate)
    history = march(1.0, "explicit", np.array(counts), largest_depth=largest)
    assert np.diff(history.wear_depth[:, 0]) == pytest.approx(np.full(5, largest), rel=1e-9, abs=0.0)
    middle = np.array([0.0, *(0.5 * (one + other) for one, other in pairwise(counts)), counts[-1]])
    between = march(1.0, "explicit", middle, largest_depth=largest)
    assert between.wear_depth[1:-1, 0] == pytest.approx((np.arange(5) + 0.5) * largest, rel=1e-9, abs=0.0)


@pytest.mark.slow
def test_the_largest_depth_rule_is_of_first_order() -> None:
    errors = [
        march(1.0, "explicit", np.array([0.0, END]), largest_depth=largest).wear_depth[-1, 0] - exact_depth()
        for largest in (4e-6, 2e-6, 1e-6)
    ]
    assert np.polyfit(np.log([4.0, 2.0, 1.0]), np.log(errors), 1)[0] == pytest.approx(1.0, abs=0.1)


def test_an_implicit_step_has_no_such_rule() -> None:
    # the bound of Eq. (22) is one of stability of the explicit scheme
    ruled, free = (march(8000.0, "implicit", CYCLES[:3], largest_depth=depth) for depth in (1e-8, None))
    assert np.array_equal(ruled.wear_depth, free.wear_depth)


def test_the_largest_depth_rule_gives_the_first_step_exactly() -> None:
    rate = march(1.0, "explicit", np.array([0.0, 1.0])).wear_rate[0] / AREA
    length = 2e-6 / rate
    # two counts inside the first step and one at its end: a straight line up to the depth
    history = march(1.0, "explicit", np.array([0.0, 0.25, 0.5, 1.0]) * length, largest_depth=2e-6)
    assert history.wear_depth[:, 0] == pytest.approx(np.array([0.0, 0.25, 0.5, 1.0]) * 2e-6, rel=1e-9, abs=0.0)
    beyond = march(1.0, "explicit", np.array([0.0, 1.0, 1.5]) * length, largest_depth=2e-6)
    assert beyond.wear_depth[1, 0] == pytest.approx(2e-6, rel=1e-9, abs=0.0)
    assert beyond.wear_depth[2, 0] < 3e-6


@pytest.mark.parametrize("scheme", SCHEMES)
def test_without_a_wear_coefficient_nothing_changes(scheme: Scheme) -> None:
    history = march(1000.0, scheme, wear=0.0)
    assert history.outcome is Outcome.CONVERGED
    for name in ("wear_depth", "wear_rate", "worn_volume"):
        assert not getattr(history, name).any(), name
    for name in ("mean_pressure", "slip_range", "response", "response_peak", "open_fraction"):
        values = getattr(history, name)
        assert np.array_equal(values, np.repeat(values[:1], CYCLES.size, axis=0)), name
    assert history.error_estimate == 0.0


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_state_without_slip_wears_exactly_nothing(scheme: Scheme) -> None:
    model = random_model(1, ("3d", "constant_load"))
    settings = SolverSettings(3, 64)
    (start,) = branch_states(model, 100.0, 1.0, [300.0], settings)
    history = march_wear(model, 100.0, start, 1e-6, 1e6, scheme, np.array([0.0, 1e8, 1e9]), settings)
    assert history.outcome is Outcome.CONVERGED
    assert not history.slip_range.any()
    for name in ("wear_depth", "wear_rate", "worn_volume"):
        assert not getattr(history, name).any(), name
    assert np.array_equal(history.response, np.repeat(history.response[:1], 3, axis=0))
    # no step is needed where nothing wears
    assert history.newton_iterations == start.newton_iterations


@pytest.mark.parametrize(
    "outcome", [Outcome.SINGULAR, Outcome.START_FAILED, Outcome.STATIC_FAILED, Outcome.BRANCH_LOST]
)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_start_that_failed_is_a_history_of_nan_with_its_outcome(scheme: Scheme, outcome: Outcome) -> None:
    model = scene("sdof_slider", 5)
    failed = StartState(
        outcome, None, OMEGA, first_resolution(COARSE), np.inf, np.inf, newton_iterations=17, run_time=0.25
    )
    history = march_wear(model, FRICTION, failed, WEAR, 1000.0, scheme, CYCLES, COARSE)
    assert history.outcome is outcome
    for name, width in (("wear_depth", 1), ("mean_pressure", 1), ("slip_range", 1), ("open_fraction", 1)):
        values = getattr(history, name)
        assert values.shape == (CYCLES.size, width)
        assert np.isnan(values).all(), name
    for name in ("wear_rate", "worn_volume", "response", "response_peak"):
        assert np.isnan(getattr(history, name)).all(), name
    assert np.isnan(history.error_estimate)
    assert np.isnan(history.jump_cycle)
    assert np.array_equal(history.cycles, CYCLES)
    assert history.newton_iterations == 17
    assert history.run_time == 0.25


@pytest.mark.parametrize("scheme", SCHEMES)
def test_only_the_product_of_wear_coefficient_and_cycles_matters(scheme: Scheme) -> None:
    slow = march(4000.0, scheme)
    fast = march(400.0, scheme, CYCLES / 10, wear=10 * WEAR)
    for name in ("wear_depth", "worn_volume", "mean_pressure", "slip_range", "response", "response_peak"):
        one, other = getattr(slow, name), getattr(fast, name)
        assert np.abs(one - other).max() <= 1e-9 * np.abs(one).max(), name
    assert fast.wear_rate == pytest.approx(10 * slow.wear_rate, rel=1e-9, abs=0.0)


def test_a_march_starts_from_the_state_it_is_given() -> None:
    model, start = slider_start(COARSE)
    state = start.state
    assert state is not None
    history = march(1000.0, "implicit", np.array([0.0, 1.0]))
    response_h = (
        build_case(model, FRICTION, start.penalty_omega, COARSE)
        .joint(OMEGA, FORCE)
        .structure.response_h(state.displacement_h[0, :2])
    )
    assert history.response[0] == pytest.approx(response_h[:, 1] - 1j * response_h[:, 2], rel=1e-12, abs=0.0)
    assert history.newton_iterations >= start.newton_iterations
    assert history.run_time >= start.run_time
