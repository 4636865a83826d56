"""Error against run time, on files whose errors are known, against plain loops."""

from __future__ import annotations

import itertools
import math
from collections import Counter

import numpy as np
import pandas as pd
import pytest

from studyrunner.report.drawing import Table
from studyrunner.report.precision.comparison import Precision, study_precision
from studyrunner.report.precision.errors import pareto_front
from studyrunner.report.precision.figures import draw_precision
from studyrunner.report.precision.findings import (
    TARGETS,
    find_orders,
    find_stable_step,
    log_slope,
    recommend,
)
from studyrunner.report.precision.settings import Setting
from studyrunner.report.reading.result import Result
from tests.studyrunner.report.synthetic import WORN, Point, synthetic

STEPS = (10.0, 20.0, 50.0, 100.0)
HARMONICS = (1, 3, 5, 9)
SIGN = {"explicit": 1.0, "implicit": -1.0, "adaptive": 0.0}


def error_of(point: Point) -> float:
    """First order in the step, second in the harmonics; larger at the second frequency."""
    size = 1.0 if point["frequency"] == 100.0 else 2.0
    step, harmonics = float(point.get("step", 0.0)), float(point.get("harmonics", np.inf))
    return size * (SIGN[str(point["scheme"])] * 1e-4 * step + 0.03 / harmonics**2)


def time_of(point: Point) -> float:
    steps = 30.0 if point["scheme"] == "adaptive" else 1000.0 / float(point["step"])
    return 0.1 + 0.01 * steps * float(point.get("harmonics", 1)) ** 1.5 * (1.0 + 0.001 * float(point["frequency"]))


def precision_of(result: Result) -> Precision:
    found = study_precision(result)
    assert found is not None
    return found


def exact_file(**options: object) -> Result:
    axes = {"frequency": [100.0, 200.0], "step": STEPS, "scheme": ["implicit", "explicit"], "harmonics": HARMONICS}
    return synthetic(axes, error_of, time_of, exact=True, **options)  # type: ignore[arg-type]


def finest_file(**options: object) -> Result:
    axes = {"frequency": [100.0, 200.0], "step": STEPS, "scheme": list(SIGN), "harmonics": HARMONICS}
    return synthetic(axes, error_of, time_of, **options)  # type: ignore[arg-type]


def test_errors_against_the_exact_answer_are_those_of_the_formula() -> None:
    precision = precision_of(exact_file())
    assert precision.keys == ("scheme", "step", "harmonics")
    assert [point.label for point in precision.points] == ["100 Hz", "200 Hz"]
    for point, frequency in zip(precision.points, (100.0, 200.0), strict=True):
        assert point.reference is not None
        assert point.reference.setting is None
        assert len(point.measured) == 2 * len(STEPS) * len(HARMONICS)
        for item in point.measured.itertuples():
            at = {"frequency": frequency, **vars(item.Index)}
            assert item.volume == pytest.approx(abs(error_of(at)), rel=1e-9, abs=1e-15)
            assert item.response == pytest.approx(abs(error_of(at)), rel=1e-9, abs=1e-15)
            assert item.course == pytest.approx(item.volume, rel=1e-9, abs=1e-15)
            assert item.run_time == pytest.approx(time_of(at))
            assert item.volume_resolved
            assert item.response_resolved
        times = point.measured["run_time"].to_list()
        assert times == sorted(times)


def test_largest_error_over_the_cycles_is_that_of_any_count() -> None:
    result = exact_file()
    worn = result.dataset["worn_volume"].values.copy()
    worn[..., 1] += 0.25 * WORN
    result.dataset["worn_volume"] = (result.dataset["worn_volume"].dims, worn)
    for item in precision_of(result).points[0].measured.itertuples():
        middle = 0.5 * 0.4 * error_of({"frequency": 100.0, **vars(item.Index)})
        assert item.course == pytest.approx(0.25 + middle, rel=1e-9)
        assert item.volume < 0.1


def test_the_finest_setting_is_the_reference_and_no_setting_of_the_lines() -> None:
    precision = precision_of(finest_file(estimate=lambda point: 2e-4 if point["scheme"] == "adaptive" else 9e-4))
    reference_error = 0.03 / 81
    for point, size in zip(precision.points, (1.0, 2.0), strict=True):
        assert point.reference is not None
        assert point.reference.setting == Setting("adaptive", None, 9)
        assert point.reference.uncertainty["volume"] == 2e-4
        assert point.reference.setting not in point.measured.index
        assert len(point.measured) == (2 * len(STEPS) + 1) * len(HARMONICS) - 1
        # the next coarser: 5 harmonics, or the smallest implicit step
        coarser = [abs(size * (0.03 / 25 - reference_error)), size * 1e-4 * STEPS[0]]
        assert point.reference.difference["volume"] == pytest.approx(max(coarser) / (1.0 + size * reference_error))
        for item in point.measured.itertuples():
            own = error_of({"frequency": 100.0 * size, **vars(item.Index) | {"step": item.Index.step or 0.0}})
            known = abs(own - size * reference_error) / (1.0 + size * reference_error)
            assert item.volume == pytest.approx(known, rel=1e-9, abs=1e-14)
            assert item.volume_resolved == (known >= 3.0 * 2e-4)


@pytest.mark.parametrize(("implicit", "expected"), [(1e-5, "implicit"), (9e-4, "adaptive")])
def test_of_the_finest_in_time_the_one_of_smaller_estimate_is_the_reference(implicit: float, expected: str) -> None:
    result = finest_file(estimate=lambda point: 2e-4 if point["scheme"] == "adaptive" else implicit)
    reference = precision_of(result).points[0].reference
    assert reference is not None
    assert reference.setting == Setting(expected, None if expected == "adaptive" else STEPS[0], 9)


def test_smallest_rtol_of_the_adaptive_scheme_is_the_reference() -> None:
    axes = {
        "scheme": ["adaptive", "implicit"],
        "step": STEPS,
        "harmonics": [1, 3],
        "samples": [32, 64],
        "rtol": [0.1, 0.01],
    }
    result = synthetic(axes, error_of, time_of)
    (point,) = precision_of(result).points
    assert point.reference is not None
    assert point.reference.setting == Setting("adaptive", None, 3, 64, None, 0.01)
    # rtol changes nothing for the implicit scheme with given harmonics and samples, nor the step for the adaptive one
    by_scheme = [setting.scheme for setting in point.measured.index]
    assert by_scheme.count("adaptive") == 2 * 2 * 2 - 1
    assert by_scheme.count("implicit") == len(STEPS) * 2 * 2


def test_automatic_harmonics_use_rtol_and_rank_by_what_they_took() -> None:
    axes = {"harmonics": ["1", "auto"], "rtol": [0.1, 0.01], "step": STEPS}
    result = synthetic(axes, lambda point: 0.0 if point["harmonics"] == "auto" else 0.1, lambda _: 1.0)
    used = np.full((*result.computed.shape, 3), 1)
    used[:, :, :, :, 1] = 7
    result.dataset["harmonics_used"] = ((*result.axes, "cycle"), used)
    result.dataset.attrs["study"] = "[solver]\nsamples = 64\n"
    (point,) = precision_of(result).points
    assert point.reference is not None
    assert point.reference.setting == Setting("implicit", STEPS[0], "auto", None, None, 0.01)
    assert len(point.measured) == 3 * len(STEPS) - 1


def test_failed_settings_are_counted_and_never_compared() -> None:
    def fails(point: Point) -> int:
        return 4 * (point["harmonics"] == 9 or (point["scheme"] == "explicit" and point["step"] == 100.0))

    precision = precision_of(finest_file(outcome=fails))
    for point in precision.points:
        assert point.reference is not None
        assert point.reference.setting == Setting("adaptive", None, 5)
        assert Counter(point.failures.values()) == {"march_failed": 2 * len(STEPS) + 1 + 3}
        failed = set(point.failures)
        assert not failed & set(point.measured.index)
        assert len(failed) + len(point.measured) + 1 == (2 * len(STEPS) + 1) * len(HARMONICS)
    assert precision.outcomes["march_failed"] == 2 * (2 * len(STEPS) + 4)


def test_nothing_is_compared_where_all_failed() -> None:
    assert study_precision(finest_file(outcome=lambda _: 4)) is None
    half = precision_of(finest_file(outcome=lambda point: 4 * (point["frequency"] == 200.0)))
    assert half.points[1].reference is None
    assert not len(half.points[1].measured)
    (table,) = [item for item in draw_precision(half) if item.name == "precision_recommended"]
    assert isinstance(table, Table)
    assert {row[0] for row in table.rows} == {"100 Hz"}


def test_files_without_settings_to_compare() -> None:
    assert study_precision(synthetic({"frequency": [1.0, 2.0]}, error_of, time_of)) is None
    assert study_precision(synthetic({"scheme": ["implicit", "explicit"]}, error_of, time_of)) is None
    assert study_precision(synthetic({"scheme": ["implicit", "explicit"]}, error_of, time_of, exact=True)) is not None
    assert study_precision(synthetic({"scheme": ["adaptive", "implicit", "explicit"]}, error_of, time_of)) is None


@pytest.mark.parametrize(("wears", "shortcuts", "shared"), [(1, "true", False), (2, "true", True), (2, "false", False)])
def test_times_of_shared_marches_are_told(wears: int, shortcuts: str, shared: bool) -> None:
    axes = {"step": STEPS, "wear_coefficient": [1e-11, 1e-10][:wears]}
    assert precision_of(synthetic(axes, error_of, time_of, shortcuts=shortcuts)).shared == shared


def test_front_is_that_of_all_pairs_compared() -> None:
    rng = np.random.default_rng(1)
    numbers = rng.integers(1, 12, (60, 2)).astype(float)
    index = pd.Index([Setting(step=float(n)) for n in range(len(numbers))], dtype=object)
    runs = pd.DataFrame({"run_time": numbers[:, 0]}, index=index)
    front = {setting.step for setting in pareto_front(runs, pd.Series(numbers[:, 1], index)).index}
    best = {tuple(numbers[int(step)]) for step in front}
    undominated = {
        (time, error)
        for time, error in numbers
        if not any((t <= time and e < error) or (t < time and e <= error) for t, e in numbers)
    }
    assert best == undominated
    assert len(front) == len(undominated)


def test_errors_that_are_not_resolved_end_the_front() -> None:
    precision = precision_of(finest_file(estimate=lambda _: 2e-3))
    for point in precision.points:
        front = point.front("volume")
        assert sum(~front["volume_resolved"]) == 1
        assert not front["volume_resolved"].iloc[-1]


@pytest.mark.parametrize("power", [1.0, 2.0])
def test_slope_of_a_power_is_its_exponent(power: float) -> None:
    steps = np.array([1.0, 3.0, 7.0, 50.0])
    assert log_slope(steps.tolist(), (0.2 * steps**power).tolist()) == pytest.approx(power, abs=1e-12)


@pytest.mark.parametrize("power", [1.0, 2.0])
@pytest.mark.parametrize("against", ["adaptive", "exact"])
def test_order_in_the_step_is_that_of_the_formula(power: float, against: str) -> None:
    schemes = ["implicit", "explicit"] + (["adaptive"] if against == "adaptive" else [])

    def error(point: Point) -> float:
        return SIGN[str(point["scheme"])] * 1e-4 * float(point["step"]) ** power

    result = synthetic({"step": STEPS, "scheme": schemes}, error, time_of, exact=against == "exact", rtol=1e-4)
    (point,) = precision_of(result).points
    orders = [order for order in find_orders(point) if order.key == "step"]
    assert len(orders) == 4
    for order in orders:
        assert order.order == pytest.approx(power, abs=1e-9)
        assert order.used == STEPS
        assert list(order.errors.values()) == pytest.approx([1e-4 * step**power for step in STEPS], rel=1e-9)


def test_order_of_the_step_without_a_finer_reference_uses_clear_errors_only() -> None:
    steps = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0]
    result = synthetic({"step": steps}, lambda point: -1e-3 * float(point["step"]), time_of)
    (point,) = precision_of(result).points
    order = next(order for order in find_orders(point) if order.quantity == "volume")
    # against a step of 1 the errors are those of step - 1: less than 5 at step 4
    assert tuple(order.errors) == tuple(steps[1:])
    assert order.used == (8.0, 16.0, 32.0)
    assert order.order == pytest.approx(np.polyfit(np.log([8, 16, 32]), np.log([7, 15, 31]), 1)[0], rel=1e-9)


def test_order_that_cannot_be_measured_says_why() -> None:
    result = synthetic({"step": STEPS, "scheme": ["implicit", "adaptive"]}, error_of, time_of, rtol=0.5)
    (point,) = precision_of(result).points
    for order in find_orders(point):
        assert math.isnan(order.order)
        assert "no value with a clear error, of 50 % at least" in order.reason


def test_explicit_steps_beyond_the_limit_are_left_out_of_the_order() -> None:
    def error(point: Point) -> float:
        wild = 5.0 if point["scheme"] == "explicit" and float(point["step"]) > 60.0 else 1.0
        return SIGN[str(point["scheme"])] * 1e-4 * float(point["step"]) * wild

    result = synthetic({"step": STEPS, "scheme": list(SIGN)}, error, time_of, limit=60.0, rtol=1e-4)
    (point,) = precision_of(result).points
    for order in find_orders(point):
        assert order.used == (STEPS[:3] if order.setting.scheme == "explicit" else STEPS)
        assert order.order == pytest.approx(1.0, abs=1e-9)


def test_convergence_in_the_harmonics() -> None:
    axes = {"harmonics": [1, 3, 5, 9], "step": STEPS}
    result = synthetic(axes, lambda point: 0.1 / float(point["harmonics"]) ** 2, time_of, exact=True)
    (point,) = precision_of(result).points
    orders = [order for order in find_orders(point) if order.key == "harmonics"]
    assert [order.quantity for order in orders] == ["volume", "response"]
    for order in orders:
        assert order.order == pytest.approx(2.0, abs=1e-9)
        assert tuple(order.errors) == (1.0, 3.0, 5.0, 9.0)
        assert order.setting == Setting("implicit", STEPS[0])
        # against the exact answer, what the finest setting leaves may have other causes: 5 times that counts
        assert order.used == (1.0, 3.0)


@pytest.mark.parametrize("how", ["oscillates", "outcome"])
def test_largest_stable_step_is_the_last_before_the_first_unstable_one(how: str) -> None:
    def unstable(point: Point) -> int:
        return int(point["scheme"] == "explicit" and point["step"] in (50.0, 250.0)) * (4 if how == "outcome" else 1)

    steps = [10.0, 20.0, 50.0, 100.0, 250.0, 300.0]
    axes = {"step": steps, "scheme": list(SIGN)}
    result = synthetic(axes, error_of, time_of, limit=40.0, **{how: unstable})
    (point,) = precision_of(result).points
    found = find_stable_step(point)
    assert found is not None
    assert (found.largest, found.smallest_unstable, found.predicted) == (20.0, 50.0, 40.0)
    # three steps of 300 cycles show nothing in 1000
    assert found.unjudged == (300.0,)


def test_recommended_is_the_cheapest_of_all_that_are_exact_enough() -> None:
    def oscillates(point: Point) -> int:
        return int(point["scheme"] == "explicit" and point["step"] == 20.0)

    precision = precision_of(exact_file(oscillates=oscillates))
    for target, points in itertools.product(TARGETS, ([0], [1], [0, 1])):
        frequencies = [(100.0, 200.0)[place] for place in points]
        best = (math.inf, None)
        for scheme, step, harmonics in itertools.product(("implicit", "explicit"), STEPS, HARMONICS):
            places = [{"frequency": f, "scheme": scheme, "step": step, "harmonics": harmonics} for f in frequencies]
            if any(abs(error_of(place)) > target or oscillates(place) for place in places):
                continue
            best = min(best, (sum(map(time_of, places)), Setting(scheme, step, harmonics)), key=lambda entry: entry[0])
        found = recommend([precision.points[place] for place in points], target)
        assert found.setting == best[1]
        if best[1] is not None:
            assert found.run_time == pytest.approx(best[0])
            assert found.certain
            assert found.volume <= target


def test_recommendation_within_the_uncertainty_of_the_reference_is_not_certain() -> None:
    precision = precision_of(finest_file(estimate=lambda _: 5e-3))
    coarse, fine, finest = (recommend(precision.points, target) for target in TARGETS)
    assert coarse.certain
    assert fine.reference >= 5e-3
    assert finest.setting is None or not finest.certain
    assert max(fine.volume, fine.response) <= 0.01


def test_worse_response_decides_too() -> None:
    result = exact_file(response_error=lambda point: 0.2 if point["scheme"] == "explicit" else 0.0)
    found = recommend(precision_of(result).points, 0.05)
    assert found.setting is not None
    assert found.setting.scheme == "implicit"


def test_wear_where_there_is_none_is_infinitely_wrong() -> None:
    result = exact_file(worn=0.0)
    worn = result.dataset["worn_volume"].values.copy()
    worn[0, 0, 0, 0, 0, -1] = WORN
    result.dataset["worn_volume"] = (result.dataset["worn_volume"].dims, worn)
    point = precision_of(result).points[0]
    assert point.quantities == ("response",)
    assert point.measured.at[Setting("implicit", STEPS[0], 1), "volume"] == math.inf
    assert sum(np.isinf(point.measured["volume"])) == 1
    assert point.measured["course"].isna().all()
