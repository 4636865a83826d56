"""Which points share an integrated history, and what each of them is given of it."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.outcome import Outcome
from solver.packing import pack
from solver.results.history import StartState
from solver.settings import Resolution
from studyrunner.kinds.wear_result import build_result
from studyrunner.study.study_file import read_study
from tests.studyrunner.faked_runs import history
from tests.studyrunner.fakes import plan_of, totals_of

WEARS = ["0", "1e-12", "2e-12", "3e-12", "1e-11", "1.5e-11"]
STEPS = ["100", "150", "200", "300", "700", "1000", "2e4", "3e4"]
SCHEMES = ["implicit", "explicit", "adaptive"]


def study_of(*overrides):
    return read_study("sdof_slider", ["axes.frequency=150", "slow_time.cycles=20000", *overrides])


def some(values):
    return st.lists(st.sampled_from(values), min_size=1, unique=True)


def alike(study, one, other):
    """Whether two points have the same history by one integration."""
    (wear, _, scheme), (wear2, _, scheme2) = one, other
    if wear == 0.0 or wear2 == 0.0:
        return wear == wear2
    if scheme != scheme2:
        return False
    if scheme == "adaptive":
        return True
    if scheme == "explicit" and study.slow_time.largest_depth is not None:
        return wear == wear2
    return False


@given(some(WEARS), some(STEPS), some(SCHEMES), st.booleans())
def test_histories_are_shared_where_they_are_the_same(wears, steps, schemes, by_depth):
    axes = [f"axes.{name}=[{', '.join(values)}]" for name, values in (("wear_coefficient", wears), ("step", steps))]
    study = study_of(*axes, f"axes.scheme={schemes}", *["slow_time.largest_depth=1e-6"] * by_depth)
    plan = plan_of(study)
    of_axes = (study.axes.wear_coefficient, study.axes.step, study.axes.scheme)
    found = {}
    for task in plan.results:
        for integrated in task.integrated:
            descending = list(integrated.wear_coefficients)
            assert descending == sorted(descending, reverse=True)
            assert integrated.unworn == (descending[0] == 0.0)
        for place, (integrated, number) in enumerate(task.results):
            for index in task.points(place):
                at = dict(zip(study.dimensions, index, strict=True))
                places = (at["wear_coefficient"], at["step"], at["scheme"])
                point = tuple(values[each] for values, each in zip(of_axes, places, strict=True))
                assert integrated.wear_coefficients[number] == point[0]
                found[point] = (task.number, integrated)
    assert found.keys() == set(itertools.product(*of_axes))
    for one, other in itertools.combinations(found, 2):
        assert (found[one] == found[other]) == alike(study, one, other)
    assert sum(plan.left_out.values()) == len(found) - len(set(found.values()))


ADAPTIVE = ("axes.wear_coefficient=[2e-12, 1e-11, 4e-12]", "axes.scheme=adaptive", "axes.step=[1, 2]")
COUNTS = [0.0, 2.0, 4.0, 5.0, 10.0]


def shared_task(*overrides):
    """A task of three histories at cycles 0 and 10, which are read at 0, 10; 0, 4; 0, 2 cycles of the first."""
    study = study_of(*ADAPTIVE, "slow_time.cycles=10", "slow_time.outputs=2", *overrides)
    (task,) = plan_of(study, 2).results
    start = StartState(Outcome.CONVERGED, None, 1.0, Resolution((1,), 64), 0.0, 0.0, 0, 0.0)
    return replace(task, start=pack(start))


def results_of(integrated):
    """Those of the three histories, of the integrated one."""
    task = shared_task()
    return [build_result(task, task.integrated[0], integrated, place) for place in range(3)]


def test_each_history_has_its_own_counts_and_rates_back():
    task, found = shared_task(), results_of(history(COUNTS))
    assert [result.place for result in found] == [0, 1, 2]
    assert [{point[1] for point in points} for points in task.indices] == [{1}, {2}, {0}]
    assert all(len(points) == 2 for points in task.indices)
    assert [result.values["worn_volume"].tolist() for result in found] == [[0.0, 4.0], [0.0, 2.0], [0.0, 1.0]]
    assert [result.values["harmonics_used"].tolist() for result in found] == [[3, 7], [3, 5], [3, 4]]
    np.testing.assert_allclose([result.values["wear_rate"][-1] for result in found], [4.0, 0.4 * 2.0, 0.2 * 1.0])
    np.testing.assert_allclose([result.values["step_limit"] for result in found], [250.0, 250.0 / 0.4, 250.0 / 0.2])
    assert all(totals_of(result, "newton_iterations", "run_time", "branch") == [7, 0.5, 2] for result in found)


@pytest.mark.parametrize(
    ("last", "outcomes", "lasts"),
    [
        (10.0, [4, 0, 0], [10.0, 10.0, 10.0]),
        (9.0, [4, 0, 0], [9.0, 10.0, 10.0]),
        (4.0, [4, 0, 0], [4.0, 10.0, 10.0]),
        (3.0, [4, 4, 0], [3.0, 7.5, 10.0]),
        (1.5, [4, 4, 4], [1.5, 3.75, 7.5]),
    ],
)
def test_histories_of_one_that_ended_early_are_results_all_the_same(last, outcomes, lasts):
    """Cycles 0 and 10 of the histories are 0, 10; 0, 4; 0, 2 cycles of the integrated one."""
    found = results_of(replace(history(COUNTS, Outcome.MARCH_FAILED), last_cycle=last, message="at cycle 9"))
    assert [result.values["outcome"] for result in found] == outcomes
    np.testing.assert_allclose([result.values["last_cycle"] for result in found], lasts)
    for result, end in zip(found, (10.0, 4.0, 2.0), strict=True):
        there = np.isfinite(result.values["worn_volume"]).tolist()
        assert there == [True, last >= end]
        assert result.values["error_estimate"] == pytest.approx(0.03 * result.values["worn_volume"][there][-1])
    # the message of the integrated one counts its own cycles
    assert [result.values["message"] == "at cycle 9" for result in found] == [True, False, False]
    assert all(result.values["message"] == "" for result in found if result.values["outcome"] == 0)


@pytest.mark.parametrize(
    ("first", "ended", "expected"),
    [
        (10.0, Outcome.INACCURATE, [6, 0, 0]),
        (5.0, Outcome.INACCURATE, [6, 0, 0]),
        (4.0, Outcome.INACCURATE, [6, 6, 0]),
        (0.0, Outcome.INACCURATE, [6, 6, 6]),
        (3.0, Outcome.MARCH_FAILED, [4, 6, 0]),
        (np.inf, Outcome.MARCH_FAILED, [4, 0, 0]),
    ],
)
def test_a_scaled_history_is_inaccurate_by_its_own_counts(first, ended, expected):
    inaccurate = {"inaccurate_from": first, "inaccurate_in": "wear rate", "inaccurate_error": 0.04}
    found = results_of(replace(history(COUNTS, ended), message="of it", **inaccurate))
    assert [result.values["outcome"] for result in found] == expected
    # 4 cycles of the integrated history are 10 of the second, 2 of them 10 of the third
    for result, slower in zip(found[1:], (0.4, 0.2), strict=True):
        assert (f"from cycle {first / slower:.0f} on" in result.values["message"]) is bool(result.values["outcome"])
