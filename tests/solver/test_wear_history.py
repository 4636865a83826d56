"""Wear histories against differential equations and time integrations; what is stored and read between their steps."""

import numpy as np
import pytest

from solver import frequency_response
from solver import march_wear as march_model
from solver.outcome import Outcome
from solver.results.history import StartState
from solver.results.state_report import LOOP_PHASES
from solver.settings import Scheme, SolverSettings, ToTheEnd, first_resolution
from solver.wear import slow_time
from solver.wear.slow_time import CERTIFIED, Course, Integrator, Node
from tests.solver.models import branch_states, march_wear, random_model, scene
from tests.solver.worn_slider import (
    AREA,
    COARSE,
    CYCLES,
    FRICTION,
    OMEGA,
    WEAR,
    depths_of_motion,
    exact_depths,
    march,
    problem,
)

STEPS = (8000.0, 4000.0, 2000.0, 1000.0)
GIVEN: tuple[Scheme, ...] = ("explicit", "implicit")
SCHEMES: tuple[Scheme, ...] = (*GIVEN, "adaptive")
FEW = SolverSettings(harmonics=3, samples=128)
FINE_OUTPUT = np.linspace(0.0, CYCLES[-1], 101)


def final_depth(step, scheme):
    history = march(step, scheme, np.array([0.0, CYCLES[-1]]))
    assert history.outcome is Outcome.CONVERGED
    return float(history.wear_depth[-1, 0])


@pytest.mark.slow
def test_the_error_of_the_depth_is_of_first_order_and_its_sign_that_of_the_scheme():
    exact = exact_depths(CYCLES)[-1]
    explicit, implicit = (np.array([final_depth(step, scheme) for step in STEPS]) - exact for scheme in GIVEN)
    for errors in (explicit, -implicit, explicit - implicit):
        assert (errors > 0).all()
        assert np.polyfit(np.log(STEPS), np.log(errors), 1)[0] == pytest.approx(1.0, abs=0.1)
        assert errors[-2] / errors[-1] == pytest.approx(2.0, rel=0.1, abs=0.0)
    # both have the same limit
    for errors in (explicit, implicit):
        assert abs(2 * errors[-1] - errors[-2]) < 1e-4 * exact


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-2, 1e-4])
def test_the_worn_volume_is_as_exact_as_asked_for(rtol):
    history = march(1.0, "adaptive", FINE_OUTPUT, rtol=rtol)
    # the harmonics are given: they are not enough for the smaller one
    assert history.outcome is (Outcome.CONVERGED if rtol == 1e-2 else Outcome.INACCURATE)
    exact = exact_depths(FINE_OUTPUT)
    error = abs(history.wear_depth[-1, 0] - exact[-1]) / exact[-1]
    assert error < 0.5 * rtol
    # the estimate holds the error of the harmonics as well, which is not in `exact`
    assert history.error_estimate > error
    # and so is everything between the steps
    assert np.abs(history.wear_depth[:, 0] - exact).max() < rtol * exact[-1]
    rates = np.gradient(exact, FINE_OUTPUT, edge_order=2)
    assert np.abs(history.wear_rate / AREA - rates).max() < max(2.0 * rtol, 2e-3) * rates.max()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_state_without_slip_wears_exactly_nothing(scheme):
    model = random_model(1, ("3d", "constant_load"))
    settings = SolverSettings(3, 64)
    (start,) = branch_states(model, 100.0, 1.0, [300.0], settings)
    history = march_wear(model, 100.0, start, 1e-6, 1e6, scheme, np.array([0.0, 1e8, 1e9]), settings)
    assert history.outcome is Outcome.CONVERGED
    assert not history.slip_range.any()
    for name in ("wear_depth", "wear_rate", "worn_volume"):
        assert not getattr(history, name).any(), name
    assert np.array_equal(history.response, np.repeat(history.response[:1], 3, axis=0))


def test_a_start_that_failed_is_a_history_of_nan_with_its_outcome():
    totals = {"newton_iterations": 17, "run_time": 0.25, "message": "lost"}
    failed = StartState(Outcome.SINGULAR, None, OMEGA, first_resolution(COARSE), np.inf, np.inf, **totals)
    for cycles in (CYCLES, ToTheEnd(3)):
        model = scene("sdof_slider", 5)
        history = march_wear(model, FRICTION, failed, WEAR, 1000.0, "implicit", cycles, COARSE, loops=(0,))
        n = history.cycles.size
        shapes = {"wear_depth": (n, 1), "slip_range": (n, 1), "response": (n, 1), "loop_force": (n, 1, LOOP_PHASES, 3)}
        for name, shape in (shapes | dict.fromkeys(("wear_rate", "worn_volume", "worn_volume_error"), (n,))).items():
            assert getattr(history, name).shape == shape
            assert np.isnan(getattr(history, name)).all(), name
        assert not history.harmonics_used.any()
        assert np.isnan([history.error_estimate, history.jump_cycle, history.last_cycle]).all()
        assert history.outcome is Outcome.SINGULAR
        assert totals == {name: getattr(history, name) for name in totals}


def test_a_response_at_a_depth_is_that_of_less_normal_force():
    """The spring of the slider presses by 10 N less 1e5 N/m times the depth."""
    worn = frequency_response(scene("sdof_slider"), 150.0, 10.0, 0.5, settings=FEW, wear_depth=[4e-5])
    less = frequency_response(scene("sdof_slider", normal_load=6.0), 150.0, 10.0, 0.5, settings=FEW)
    np.testing.assert_allclose(worn.response, less.response, rtol=1e-7)
    assert set(worn.outcome) == {Outcome.CONVERGED}


@pytest.mark.slow
def test_the_slow_time_of_the_slider_is_of_second_order():
    courses = [Integrator(np.inf).integrate(problem(rtol=rtol)).course for rtol in (1e-2, 1e-3, 1e-6)]
    few, many, _ = (len(course.ends) for course in courses)
    coarse, fine, finest = (course.read(CYCLES[-1:])["wear_depth"][0, 0] for course in courses)
    assert np.log(abs(coarse - finest) / abs(fine - finest)) / np.log(many / few) > 1.7


@pytest.mark.parametrize(
    ("wear", "cycles", "outputs", "rtol"), [(1e-13, 1e3, 2, 0.1), (WEAR, 5e3, 101, 1e-2), (WEAR, 1e5, 11, 5e-2)]
)
def test_the_error_of_a_history_covers_and_does_not_alarm(wear, cycles, outputs, rtol):
    """Also for a count at the beginning of a long step, and where start state and steps have similar errors."""
    counts = np.linspace(0.0, cycles, outputs)
    history = march_model(scene("sdof_slider", 21), 160.0, 10.0, 0.5, wear, counts, settings=SolverSettings(rtol=rtol))
    true = abs(float(history.wear_depth[-1, 0] / depths_of_motion(np.array([0.0, cycles]), wear)[-1]) - 1.0)
    assert history.outcome is Outcome.CONVERGED
    assert true <= history.error_estimate <= 2.0 * rtol


# --- between the ends of steps ---

AREAS = np.array([1.0, 3.0])
RESOLUTIONS = ((3, 64), (5, 128))


def node(count, depth, rate, value, resolution=RESOLUTIONS[0], **more):
    """All numbers of a state but its depths are `value`."""
    numbers = dict.fromkeys(("mean_pressure", "slip_range", "open_fraction", "friction_power"), np.full(2, value))
    numbers |= dict.fromkeys(("friction_use", "excitation_frequency", "excitation_frequency_error"), value)
    numbers |= dict.fromkeys(("loop_displacement", "loop_force"), np.full((1, 128, 3), value))
    numbers |= dict.fromkeys(("response_mean", "response_peak"), np.full(1, value))
    numbers["response"] = np.full(1, value * 1j)
    numbers |= dict.fromkeys(CERTIFIED, value) | dict(zip(("harmonics_used", "samples_used"), resolution, strict=True))
    return Node(count, np.array(depth, float), np.array(rate, float), np.zeros(2), np.zeros(2), numbers | more)


def taken(counts, n_steps=3, **more):
    """Steps of 10 cycles; the first pair wears as t^2, the second one nothing."""
    course = Course(AREAS, np.array(counts or (), float), **more)
    for n in range(n_steps + 1):
        at = 10.0 * n
        end = node(at, [at**2, 0.0], [2.0 * at, 0.0], float(n), RESOLUTIONS[n // 2 % 2], local=0.5 * (n + 1))
        course = course.after(end)
    return course


def test_what_is_no_length_or_force_holds_through_a_step():
    found = taken([0.0, 4.0, 10.0, 25.0]).read(np.array([0.0, 4.0, 10.0, 25.0]))
    # what holds at both ends of a step holds between
    for name in CERTIFIED:
        assert found[name].tolist() == [0.0, 1.0, 1.0, 3.0], name
    # and what has no value between those of both ends is that of the later one
    assert found["harmonics_used"].tolist() == [3, 3, 3, 5]
    assert found["samples_used"].tolist() == [64, 64, 64, 128]
    # local errors add up from step to step, and with the wear of a step
    assert found["local"] == pytest.approx([0.5, 0.58, 1.0, 1.725])


def test_an_unknown_error_at_an_end_is_unknown_within_the_step():
    unknown, course = {"response_error": np.inf, "local": np.inf}, Course(AREAS)
    for count, errors in ((0.0, {"local": 0.5}), (10.0, unknown), (20.0, unknown), (30.0, {"local": 0.5})):
        course = course.after(node(count, [count, count], [1.0, 1.0], 1.0, **errors))
    found = course.read(np.array([0.0, 5.0, 15.0, 20.0, 25.0, 30.0, 35.0]))
    for name, first, last in (("local", 0.5, 0.5), ("response_error", 1.0, np.inf)):
        np.testing.assert_array_equal(found[name], [first, np.inf, np.inf, np.inf, np.inf, last, np.nan])


def test_within_a_step_the_depth_is_a_cubic_and_all_else_linear_in_the_volume():
    found = taken([5.0, 14.0]).read(np.array([5.0, 14.0]))
    # t^2 is a cubic
    assert found["wear_depth"] == pytest.approx(np.array([[25.0, 0.0], [196.0, 0.0]]))
    shares = np.array([0.25, 1.0 + 96.0 / 300.0])
    assert found["wear_rate"] == pytest.approx(20.0 * shares)
    for name in ("mean_pressure", "response", "response_peak", "loop_force", "excitation_frequency"):
        values = np.abs(found[name].reshape(2, -1))
        assert values == pytest.approx(np.repeat(shares[:, None], values.shape[1], axis=1), nan_ok=True), name


def test_a_cubic_never_falls_however_steep_its_ends_are():
    course = Course(AREAS).after(node(0.0, [0.0, 0.0], [100.0, 0.0], 0.0))
    course = course.after(node(10.0, [1.0, 1.0], [0.0, 100.0], 1.0))
    depth = course.read(np.linspace(0.0, 10.0, 101))["wear_depth"]
    assert (np.diff(depth, axis=0) >= 0.0).all()
    assert depth[-1].tolist() == [1.0, 1.0]


def test_of_many_steps_those_that_go_far_and_those_that_are_read_are_kept(monkeypatch):
    asked = [5.0, 15.0, 1005.0]
    whole = taken(None, n_steps=200)
    monkeypatch.setattr(slow_time, "MOST_NODES", 20)
    course = taken(asked, n_steps=200)
    assert len(course.nodes) <= 26
    assert course.counts[[0, -1]].tolist() == [0.0, 2000.0]
    assert course.ends == tuple(np.arange(201) * 10.0)
    counts = np.linspace(0.0, 2000.0, 11)
    one, other = (each.read(counts)["wear_depth"] for each in (course, whole))
    assert np.abs(one - other).max() < 0.02 * other.max()
    one, other = (each.read(np.array(asked)) for each in (course, whole))
    for name, values in one.items():
        assert np.array_equal(values, other[name], equal_nan=True), name
