"""The reference solution, and the error of a worn volume against what the volume is wrong by."""

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

import solver
from solver.accuracy.refinement import DIFFERENCE_SAFETY
from solver.accuracy.resolved_state import UNKNOWN
from solver.harmonic_balance.state import Failure
from solver.model import with_friction
from solver.outcome import Outcome, in_whole
from solver.packing import Packed
from solver.settings import SolverSettings
from solver.structure.ring import build_ring
from solver.wear import problem
from solver.wear.errors import PAIR_OVER_VOLUME, Compared, HistoryError, error_of_given_steps, history_error
from solver.wear.history import integrate_together
from solver.wear.problem import WearProblem
from solver.wear.slow_time import Course, Node
from solver.wear.undecided import BESIDE, undecided_from
from solver.wear.wearing_joint import Given, WearRequest
from tests.rings import one_sector
from tests.solver.models import assert_same, branch_states, dovetail, march_wear, scene
from tests.solver.worn_slider import depths_of_motion

WEAR = 1.1e-11  # 1/Pa
GIVEN = SolverSettings(harmonics=5, samples=64)
CYCLES = np.linspace(0.0, 2e4, 9)


@lru_cache
def start():
    """At 213 Hz the coarse sector wears, and stops."""
    model = dovetail(9)
    (found,) = branch_states(model, 0.5, 0.5, [2 * np.pi * 213.0], GIVEN)
    return model, found


def worn():
    model, found = start()
    return march_wear(model, 0.5, found, WEAR, 1000.0, "implicit", CYCLES, GIVEN)


usual = lru_cache(worn)


@pytest.mark.slow
def test_the_error_holds_where_pairs_slide_for_long_in_one_direction():
    """80.05 mm3 with many short steps of one slide each: the history of such a step was 0.8 to 2.4 % off."""
    mu, pressure, frequency = 0.33563914916888354, 1.523108745024015e-11, 212.365293782595
    model, cycles, settings = dovetail(21), np.linspace(0.0, 464919.9621570562, 41), SolverSettings()
    (found,) = branch_states(model, mu, 0.7689399931298951, [2.0 * np.pi * frequency], settings, "ramp")
    history = march_wear(model, mu, found, pressure, 1000.0, "adaptive", cycles, settings)
    true = abs(float(history.worn_volume[-1]) - 80.05e-9)
    assert true < 0.002 * 80.05e-9
    assert 0.5 * true < history.error_estimate * history.worn_volume[-1] < settings.rtol * 80.05e-9


@pytest.mark.slow
def test_the_error_of_given_harmonics_is_that_to_many_more():
    """21.33 mm3 with 39 harmonics: 5, 9 and 13 are 4 % off and within 2 % of each other; 1.3 % was told for 5."""
    model, settings, cycles = dovetail(39), SolverSettings(harmonics=5, samples=64), np.linspace(0.0, 110544.436, 41)
    (found,) = branch_states(model, 0.49649125954, 1.0432086579, [2.0 * np.pi * 211.99756074784662], settings, "up")
    history = march_wear(model, 0.49649125954, found, 9.0354845e-12, 1000.0, "adaptive", cycles, settings)
    true = abs(float(history.worn_volume[-1]) - 21.33e-9)
    assert true > 0.03 * 21.33e-9
    assert true < history.error_estimate * history.worn_volume[-1] < 3.0 * true


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "step"), [("implicit", 4000.0), ("explicit", 1000.0), ("adaptive", 1e-2)])
def test_the_error_of_the_slider_holds_the_exact_answer(scheme, step):
    model = scene("sdof_slider", 21)
    settings = SolverSettings(21, 256, rtol=step) if scheme == "adaptive" else SolverSettings(21, 256)
    (found,) = branch_states(model, 0.5, 10.0, [2 * np.pi * 160.0], settings)
    cycles = np.linspace(0.0, 8e4, 5)
    history = march_wear(model, 0.5, found, WEAR, step, scheme, cycles, settings)
    assert history.outcome is Outcome.CONVERGED
    true = np.abs(history.wear_depth[:, 0] - depths_of_motion(cycles, WEAR))[1:]
    assert (history.wear_depth_error[1:, 0] > 0.5 * true).all()
    apart = np.abs(history.worn_volume - history.reference_volume)[1:]
    assert (apart > 0.0).all()
    # given steps differ from the adaptive ones, whose error is added
    least = (DIFFERENCE_SAFETY if scheme == "adaptive" else 1.0) * apart / history.worn_volume[1:]
    assert (history.worn_volume_error[1:] >= least * (1.0 - 1e-12)).all()
    assert history.error_estimate < 0.3


@pytest.mark.slow
def test_what_was_computed_of_a_history_that_ends_is_kept(monkeypatch):
    whole, own = usual(), problem.full_check

    def give_up(work, state, *more, **named):
        lost = state.cycle > 12_000.0
        return Failure(Outcome.CERTIFICATE_FAILED, "lost") if lost else own(work, state, *more, **named)

    monkeypatch.setattr(problem, "full_check", give_up)
    ended = worn()
    assert ended.outcome is Outcome.CERTIFICATE_FAILED
    assert ended.last_cycle == 12_000.0
    known = CYCLES <= 12_000.0
    assert np.array_equal(ended.worn_volume[known], whole.worn_volume[known])
    assert np.isnan(ended.worn_volume[~known]).all()
    assert np.isnan(ended.worn_volume_error[~known]).all()
    assert (ended.harmonics_used[~known] == 0).all()
    assert ended.error_estimate == ended.worn_volume_error[known][-1] > 0.0


@pytest.mark.slow
def test_where_euler_steps_let_a_pair_stick_again_the_error_says_so():
    """2.026 mm3 by time integration; implicit steps, as adaptive ones with fewer harmonics, lead to 1.8 to 1.9 mm3."""
    model, settings = scene("dovetail_sector", 13, mesh=1), SolverSettings()
    (found,) = branch_states(model, 0.5, 0.5, [2.0 * np.pi * 212.5], settings)
    history = march_wear(model, 0.5, found, WEAR, 2000.0, "implicit", np.array([0.0, 1e5]), settings)
    true = abs(2.026e-9 / history.worn_volume[-1] - 1.0)
    assert true > 0.05
    assert true < history.error_estimate < 0.5


@pytest.mark.slow
def test_a_reference_solution_that_fails_leaves_the_error_unknown(monkeypatch):
    """Of the volume at all counts beyond its end; the history itself and its errors before are the same."""
    whole, own = usual(), WearProblem.step

    def go_astray(of, state):
        lost = of.request.steps is None and state.cycle >= 12_000.0
        return Failure(Outcome.MARCH_FAILED, "lost") if lost else own(of, state)

    monkeypatch.setattr(WearProblem, "step", go_astray)
    history = worn()
    assert np.array_equal(history.worn_volume, whole.worn_volume)
    known = np.isfinite(history.worn_volume_error)
    assert known.tolist() == (CYCLES <= 12_000.0).tolist()
    assert np.array_equal(history.worn_volume_error[known], whole.worn_volume_error[known])
    assert np.isinf(history.worn_volume_error[~known]).all()
    assert np.isinf(history.wear_depth_error[-1][history.wear_depth[-1] > 0.0]).all()
    assert history.outcome is Outcome.INACCURATE


@pytest.mark.parametrize("scheme", ["implicit", "adaptive"])
@pytest.mark.parametrize("lost", [{"by_resolution": UNKNOWN}, {"reference": None, "outcome": Outcome.INACCURATE}])
def test_a_history_whose_state_has_no_other_to_compare_with_says_so(scheme, lost):
    """Neither with more harmonics, nor that of a reference sweep."""
    found = replace(start()[1], response_error=np.inf, wear_rate_error=np.inf, message="lost", **lost)
    history = march_wear(start()[0], 0.5, found, WEAR, 4000.0, scheme, CYCLES[::4], GIVEN)
    assert history.outcome is Outcome.INACCURATE
    assert history.worn_volume_error.tolist() == [0.0, np.inf, np.inf]
    assert np.isinf([*history.response_error, *history.wear_rate_error]).all()
    np.testing.assert_array_equal(history.wear_depth_error, np.where(history.wear_depth > 0.0, np.inf, 0.0))


AREA = np.array([1.0, 2.0])
COUNTS = np.array([0.0, 1.0, 2.0])


def read(depth, rate=((1.0, 1.0), (1.0, 1.0), (1.0, 1.0)), **other):
    """What a dense output gives at `COUNTS`, as far as errors are made of."""
    rates = np.array(rate, float)
    values: dict[str, Any] = {
        "wear_depth": depth,
        "dissipated_energy": depth,
        "depth_rate": rates,
        "wear_rate": rates @ AREA,
        "local": np.zeros(3),
        "response": np.ones((3, 1), complex),
        "response_peak": np.ones((3, 1)),
        "response_error": np.full(3, 1e-3),
        "wear_rate_error": np.zeros(3),
        "resolution_error": np.zeros(3),
    }
    return {name: np.array(value) for name, value in (values | other).items()}


DEPTH = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]
LESS_KNOWN = 3.0 / 5.0**0.5  # root of the number of equal pairs that share a volume as these two, of areas 1 and 2, do


def at_step(value, n_pairs=2):
    """Values at one step, all alike."""
    shapes = {
        "wear_depth": (1, n_pairs),
        "dissipated_energy": (1, n_pairs),
        "response": (1, 1),
        "response_peak": (1, 1),
        "wear_rate": (1,),
    }
    return {name: np.full(shape, value) for name, shape in shapes.items()}


def error_of(fine, reference, steps=None, area=AREA):
    """The errors at `COUNTS`; steps: both solutions at the ends of steps, none by default."""
    nowhere = {name: value[:0] for name, value in at_step(0.0, area.size).items()}
    return history_error(Compared(COUNTS, fine, reference), steps or Compared(np.zeros(0), nowhere, nowhere), area)


def test_an_error_adds_up_what_differs_at_each_pair():
    # volumes agree by chance: what the first pair wears less the second one wears more
    other = [[0.0, 0.0], [1.2, 0.9], [2.4, 1.8]]
    found, safety = error_of(read(DEPTH), read(other)), DIFFERENCE_SAFETY
    assert found.worn_volume == pytest.approx([0.0, safety * 0.4 / 3.0, safety * 0.8 / 6.0])
    # of pairs of volumes 1 and 2 none is known better than the volume times the root of 9 / 5
    apart = safety * np.abs(np.subtract(DEPTH, other))
    least = LESS_KNOWN * np.outer(found.worn_volume * [0.0, 1.0, 2.0], [1.0, 1.0])
    assert found.wear_depth == pytest.approx(np.maximum(apart, least))
    assert (found.wear_depth[1:, 1] > apart[1:, 1]).all()
    assert found.response == pytest.approx(np.full(3, 1e-3))
    assert found.wear_rate == pytest.approx(np.zeros(3))


@pytest.mark.parametrize(
    ("parts", "error"),
    [
        ([1.0] * 8, 8.0),
        ([1.0, -1.0] * 4, 4.0),
        ([1.0, -1.0], 2.0),
        ([3.0, 1.0, -1.0], np.sqrt(22.0)),
        ([1.0, np.inf, -np.inf], np.inf),
        ([1.0, np.nan], np.nan),
    ],
)
def test_pairs_that_err_in_both_directions_are_independent(parts, error):
    assert in_whole(np.array([parts])) == pytest.approx([error], nan_ok=True)


def test_an_error_is_at_least_that_of_the_steps_and_of_the_crossing():
    fine = read(DEPTH, local=[0.0, 0.3, 0.6])
    found = error_of(fine, read(DEPTH))
    assert found.worn_volume == pytest.approx([0.0, 0.1, 0.1])
    assert found.wear_depth == pytest.approx(LESS_KNOWN * 0.1 * np.array(DEPTH))
    # between the outputs, at a step, all values of the reference solution differ; at the outputs they agree
    steps = Compared(np.array([1.5]), at_step(2.0), at_step(2.5) | {"wear_depth": np.array([[2.5, 2.0]])})
    crossing, safety = error_of(fine, read(DEPTH), steps), DIFFERENCE_SAFETY
    assert crossing.worn_volume == pytest.approx([0.0, 0.1, safety * 0.5 / 6.0])
    assert crossing.wear_depth[2] == pytest.approx([safety * 0.5, LESS_KNOWN * safety * 0.5 / 6.0 * 2.0])
    assert crossing.response == pytest.approx([1e-3, 1e-3, safety * 0.25])
    assert crossing.wear_rate == pytest.approx([0.0, 0.0, safety * 0.25])


@pytest.mark.slow
def test_histories_that_are_integrated_together_are_those_alone(monkeypatch):
    """To the last bit, interrupted or not; the adaptive history, which all of them need, is integrated once."""
    monkeypatch.setattr("solver.wear.problem.WearProblem.iterations_per_save", 20)
    (model, found), saved = start(), list[Packed]()
    model = with_friction(model, 0.5)
    asked = [WearRequest(WEAR, rule, CYCLES) for rule in (Given(4000.0), None, Given(2000.0, "explicit"))]
    together = list(integrate_together(model, GIVEN, found, asked, saved.append))
    alone = [next(integrate_together(model, GIVEN, found, (each,))) for each in asked]
    assert len(saved) > 5
    places = saved[1], saved[len(saved) // 2], saved[-1]
    resumed = [list(integrate_together(model, GIVEN, found, asked, resume=each)) for each in places]
    for other in (alone, *resumed):
        for one, same in zip(together, other, strict=True):
            assert_same(one, same)


def test_what_nothing_confirms_is_not_known():
    nothing = {name: [1e-3, 1e-3, np.nan] for name in ("response_error", "wear_rate_error", "local")}
    nothing |= {name: [[1.0], [1.0], [np.nan]] for name in ("response", "response_peak")}
    lost = read([[0.0, 0.0], [1.0, 1.0], [np.nan, np.nan]], ((1.0, 1.0), (1.0, 1.0), (np.nan, np.nan)), **nothing)
    found = error_of(read(DEPTH), lost)
    assert np.isinf([found.worn_volume[2], *found.wear_depth[2], found.response[2], found.wear_rate[2]]).all()
    # and what was not reached has no error
    ended = error_of(lost, lost)
    for errors in (ended.worn_volume, ended.response, ended.wear_rate, ended.wear_depth[:, 0]):
        assert np.isnan(errors).tolist() == [False, False, True]
    # a joint that has worn nothing is known to have worn nothing, with or without
    still = error_of(read(np.zeros((3, 2))), read(np.full((3, 2), np.nan)))
    assert not still.worn_volume.any()
    assert not still.wear_depth.any()


@pytest.mark.parametrize(("worn", "less"), [([1.0, 0.0, 0.0, 0.0, 0.0], 1.0), ([1.0] * 5, PAIR_OVER_VOLUME)])
def test_one_pair_is_known_as_the_volume_and_one_of_many_half_as_well(worn, less):
    depth = np.outer([0.0, 1.0, 2.0], worn)
    fine = read(depth, local=[0.0, 0.1, 0.2], depth_rate=np.ones((3, 5)))
    found = error_of(fine, fine, area=np.ones(5))
    assert found.wear_depth == pytest.approx(less * found.worn_volume[:, None] * depth)


def test_given_steps_are_wrong_by_what_they_differ_and_by_what_the_adaptive_history_is_wrong():
    other = [[0.0, 0.0], [1.2, 0.9], [2.4, np.nan]]
    known = HistoryError(np.array([0.0, 0.1, 0.1]), *[0.1 * np.array(other)] * 2, *np.full((2, 3), 1e-2), np.zeros(3))
    found = error_of_given_steps(Compared(COUNTS, read(DEPTH), read(other)), known, AREA)
    assert found.worn_volume == pytest.approx([0.0, (0.4 + 0.1 * 3.0) / 3.0, np.inf])
    assert found.wear_depth[1] == pytest.approx([0.2 + 0.12, 0.1 + 0.09])
    assert np.isinf(found.wear_depth[2]).all()
    assert found.response == pytest.approx([1e-3, 1e-2, np.inf])
    assert found.wear_rate == pytest.approx([0.0, 1e-2, np.inf])


def test_a_response_is_not_known_better_than_the_worn_volume():
    # both solutions vibrate alike at each count, with other volumes; the response rises by 0.5 from 3 to 6 m3
    along = [[1.0], [1.0], [1.5]]
    fine, other = read(DEPTH, response=along), read([[0.0, 0.0], [0.8, 0.9], [1.6, 1.8]], response=along)
    found = error_of(fine, other, Compared(COUNTS, fine, other))
    wrong = found.worn_volume[1:] * [3.0, 6.0]
    assert wrong[0] > 0.0
    assert found.response[1:] == pytest.approx(wrong * 0.5 / 3.0 / [1.0, 1.5])


def test_equal_pairs_may_have_the_depths_of_each_other():
    """Two pairs that begin alike, as in a symmetric joint, and later differ; history and reference agree by chance."""
    depth = [[0.0, 0.0], [1.0, 1.0], [2.0, 1.5]]
    alike = {"mean_pressure": np.ones((3, 2))}
    plain, equal = read(depth), read(depth, **alike)
    one, other = error_of(plain, plain), error_of(equal, equal)
    assert other.wear_depth - one.wear_depth == pytest.approx(np.repeat([[0.0], [0.0], [0.5]], 2, axis=1))
    assert other.dissipated_energy - one.dissipated_energy == pytest.approx(other.wear_depth - one.wear_depth)
    assert other.worn_volume == pytest.approx(one.worn_volume)
    # not so pairs under another pressure, or of which one wears faster from the beginning, or that do not slip
    for values in (
        {"mean_pressure": np.array([[1.0, 1.1]] * 3)},
        alike | {"depth_rate": np.array([[1.0, 1.1]] * 3)},
        alike | {"depth_rate": np.zeros((3, 2))},
    ):
        apart, same = read(depth, **values), {name: value for name, value in values.items() if name == "depth_rate"}
        assert error_of(apart, apart).wear_depth == pytest.approx(error_of(*[read(depth, **same)] * 2).wear_depth)


GROWTH, LIMIT = 1e-2, 1.0  # of the rate of a pair, 1 per cycle, and the rate from which on it does not fall


def course_of(begins, *, goes_on=False):
    """A pair, beside a steady one, whose rate obeys dr/dn = g (r - limit) until it ceases to wear; when it does so."""
    nodes, counts = list[Node](), np.arange(0.0, 400.0, 10.0)
    rates = np.maximum(LIMIT + (begins - LIMIT) * np.exp(GROWTH * counts), 0.0)
    for place, (count, rate) in enumerate(zip(counts, rates, strict=True)):
        ceases = place > 0 and rate == 0.0 < rates[place - 1]
        last = 1.0 if goes_on and place == counts.size - 1 else rate
        row = np.array([5.0, last])
        nodes.append(Node(count, row, row, row, row, {"own_growth": np.array([0.0, GROWTH * ceases])}))
    return Course(AREA, nodes=tuple(nodes)), counts[np.flatnonzero(rates > 0.0)[-1]]


def test_it_is_not_known_whether_a_pair_ceases_to_wear_if_its_rate_may_be_above_the_limit():
    # both cease to wear: the truth may be above the limit where the other one is a third as far below
    begins, margin = LIMIT - 0.1, 0.1 / BESIDE
    course, ceased = course_of(begins)
    assert undecided_from(course, course_of(begins - 0.5 * margin)[0]) == math.inf
    assert undecided_from(course, course_of(begins - 1.2 * margin)[0]) == ceased
    # a reference solution in which it goes on shows what this does
    assert undecided_from(course, course_of(begins - 1.2 * margin, goes_on=True)[0]) == math.inf
    known = error_of(read(DEPTH), read(DEPTH))
    nowhere = Compared(np.zeros(0), *[{name: value[:0] for name, value in at_step(0.0, 2).items()}] * 2)
    unknown = history_error(Compared(COUNTS, read(DEPTH), read(DEPTH), undecided=1.0), nowhere, AREA)
    assert np.isinf(unknown.worn_volume).tolist() == [False, False, True]
    assert np.isinf(unknown.wear_depth[2]).all()
    assert unknown.worn_volume[:2] == pytest.approx(known.worn_volume[:2])


@pytest.mark.slow
def test_a_history_beside_which_another_one_goes_on_is_not_known():
    """Mesh 1, `rtol` 0.1: 147 mm3 with few harmonics, 45 mm3 in truth; the reference solution has few as well."""
    model, cycles, settings = scene("dovetail_sector", 39, mesh=1), np.array([0.0, 4.031e5]), SolverSettings(rtol=0.1)
    (found,) = branch_states(model, 0.57288, 1.163522, [2.0 * np.pi * 212.280674], settings, "down")
    history = march_wear(model, 0.57288, found, 2.216172e-11, 1.0, "adaptive", cycles, settings)
    assert history.outcome is Outcome.INACCURATE
    assert history.worn_volume_error[-1] == math.inf or abs(history.worn_volume[-1] - 45e-9) < 0.5 * 45e-9


def test_a_reference_solution_in_tiny_steps_is_given_up():
    # with coarser harmonics a pair slips by a hair: thousands of steps for some tens of the history
    ring = build_ring(one_sector(1), 0.2 * np.array([0.02, -0.013, 0.0, 0.007, -0.018, 0.011]))
    history = solver.march_wear(ring, 278.0, 3.3, 0.3, 1e-10, 100.0, settings=SolverSettings(rtol=0.05))
    assert history.outcome is Outcome.INACCURATE
    assert "times as many steps as the history" in history.message
    assert math.isinf(history.error_estimate)
