"""Error against run time, on files whose errors are known, against plain loops."""

import itertools
import math
from collections import Counter

import numpy as np
import pandas as pd
import pytest

from studyrunner.report.drawing import Table
from studyrunner.report.precision.comparison import study_precision
from studyrunner.report.precision.errors import pareto_front
from studyrunner.report.precision.figures import draw_precision
from studyrunner.report.precision.findings import TARGETS, find_orders, recommend
from studyrunner.report.precision.settings import Setting
from tests.studyrunner.report.synthetic import WORN, synthetic

STEPS = (10.0, 20.0, 50.0, 100.0)
HARMONICS = (1, 3, 5, 9)
SIGN = {"explicit": 1.0, "implicit": -1.0, "adaptive": 0.0}


def error_of(point):
    """First order in the step, second in the harmonics; larger at the second frequency."""
    size = 1.0 if point["frequency"] == 100.0 else 2.0
    step, harmonics = float(point.get("step", 0.0)), float(point.get("harmonics", np.inf))
    return size * (SIGN[str(point["scheme"])] * 1e-4 * step + 0.03 / harmonics**2)


def time_of(point):
    steps = 30.0 if point["scheme"] == "adaptive" else 1000.0 / float(point["step"])
    return 0.1 + 0.01 * steps * float(point.get("harmonics", 1)) ** 1.5 * (1.0 + 0.001 * float(point["frequency"]))


def precision_of(result):
    found = study_precision(result)
    assert found is not None
    return found


def exact_file(**options):
    axes = {"frequency": [100.0, 200.0], "step": STEPS, "scheme": ["implicit", "explicit"], "harmonics": HARMONICS}
    return synthetic(axes, error_of, time_of, exact=True, **options)  # type: ignore[arg-type]


def finest_file(**options):
    axes = {"frequency": [100.0, 200.0], "step": STEPS, "scheme": list(SIGN), "harmonics": HARMONICS}
    return synthetic(axes, error_of, time_of, **options)  # type: ignore[arg-type]


def test_errors_against_the_exact_answer_are_those_of_the_formula():
    precision = precision_of(exact_file())
    assert precision.keys == ("scheme", "step", "harmonics")
    assert [point.label for point in precision.points] == ["100 Hz", "200 Hz"]
    for point, frequency in zip(precision.points, (100.0, 200.0), strict=True):
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


def test_the_finest_setting_is_the_reference_and_no_setting_of_the_lines():
    precision = precision_of(finest_file(estimate=lambda point: 2e-4 if point["scheme"] == "adaptive" else 9e-4))
    reference_error = 0.03 / 81
    for point, size in zip(precision.points, (1.0, 2.0), strict=True):
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


def test_automatic_harmonics_use_rtol_and_rank_by_what_they_took():
    axes = {"harmonics": ["1", "auto"], "rtol": [0.1, 0.01], "step": STEPS}
    result = synthetic(axes, lambda point: 0.0 if point["harmonics"] == "auto" else 0.1, lambda _: 1.0)
    used = np.full((*result.computed.shape, 3), 1)
    used[:, :, :, :, 1] = 7
    result.dataset["harmonics_used"] = ((*result.axes, "cycle"), used)
    result.dataset.attrs["study"] = "[solver]\nsamples = 64\n"
    (point,) = precision_of(result).points
    assert point.reference.setting == Setting("implicit", STEPS[0], "auto", None, None, 0.01)
    assert len(point.measured) == 3 * len(STEPS) - 1


def test_failed_settings_are_counted_and_never_compared():
    def fails(point):
        return 4 * (point["harmonics"] == 9 or (point["scheme"] == "explicit" and point["step"] == 100.0))

    precision = precision_of(finest_file(outcome=fails))
    for point in precision.points:
        assert point.reference.setting == Setting("adaptive", None, 5)
        assert Counter(point.failures.values()) == {"march_failed": 2 * len(STEPS) + 1 + 3}
        failed = set(point.failures)
        assert not failed & set(point.measured.index)
        assert len(failed) + len(point.measured) + 1 == (2 * len(STEPS) + 1) * len(HARMONICS)
    assert precision.outcomes["march_failed"] == 2 * (2 * len(STEPS) + 4)


def test_nothing_is_compared_where_all_failed():
    assert study_precision(finest_file(outcome=lambda _: 4)) is None
    half = precision_of(finest_file(outcome=lambda point: 4 * (point["frequency"] == 200.0)))
    assert half.points[1].reference is None
    assert not len(half.points[1].measured)
    (table,) = [item for item in draw_precision(half) if item.name == "precision_recommended"]
    assert isinstance(table, Table)
    assert {row[0] for row in table.rows} == {"100 Hz"}


def test_front_is_that_of_all_pairs_compared():
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


@pytest.mark.parametrize("power", [1.0, 2.0])
@pytest.mark.parametrize("against", ["adaptive", "exact"])
def test_order_in_the_step_is_that_of_the_formula(power, against):
    schemes = ["implicit", "explicit"] + (["adaptive"] if against == "adaptive" else [])

    def error(point):
        return SIGN[str(point["scheme"])] * 1e-4 * float(point["step"]) ** power

    result = synthetic({"step": STEPS, "scheme": schemes}, error, time_of, exact=against == "exact", rtol=1e-4)
    (point,) = precision_of(result).points
    orders = [order for order in find_orders(point) if order.key == "step"]
    assert len(orders) == 4
    for order in orders:
        assert order.order == pytest.approx(power, abs=1e-9)
        assert order.used == STEPS
        assert list(order.errors.values()) == pytest.approx([1e-4 * step**power for step in STEPS], rel=1e-9)


def test_recommended_is_the_cheapest_of_all_that_are_exact_enough():
    precision = precision_of(exact_file())
    for target, points in itertools.product(TARGETS, ([0], [1], [0, 1])):
        frequencies = [(100.0, 200.0)[place] for place in points]
        best = (math.inf, None)
        for scheme, step, harmonics in itertools.product(("implicit", "explicit"), STEPS, HARMONICS):
            places = [{"frequency": f, "scheme": scheme, "step": step, "harmonics": harmonics} for f in frequencies]
            if any(abs(error_of(place)) > target for place in places):
                continue
            best = min(best, (sum(map(time_of, places)), Setting(scheme, step, harmonics)), key=lambda entry: entry[0])
        found = recommend([precision.points[place] for place in points], target)
        assert found.setting == best[1]
        if best[1] is not None:
            assert found.run_time == pytest.approx(best[0])
            assert found.certain
            assert found.volume <= target


def test_wear_where_there_is_none_is_infinitely_wrong():
    result = exact_file(worn=0.0)
    worn = result.dataset["worn_volume"].values.copy()
    worn[0, 0, 0, 0, 0, -1] = WORN
    result.dataset["worn_volume"] = (result.dataset["worn_volume"].dims, worn)
    point = precision_of(result).points[0]
    assert point.quantities == ("response",)
    assert point.measured.at[Setting("implicit", STEPS[0], 1), "volume"] == math.inf
    assert sum(np.isinf(point.measured["volume"])) == 1
    assert point.measured["course"].isna().all()
