"""Error against run time, on files whose errors are known, against plain loops."""

import math
from pathlib import Path

import numpy as np
import pytest

from studyrunner.report.figures.precision import Setting, compare_settings, draw_precision
from studyrunner.result.view import Result
from tests.studyrunner.results import build_file

AXES = {
    "frequency": (100.0, 200.0),
    "step": (10.0, 20.0, 50.0, 100.0),
    "scheme": ("explicit", "implicit", "adaptive"),
    "harmonics": (1, 3, 5, 9),
}
SIGN = {"explicit": 1.0, "implicit": -1.0, "adaptive": 0.0}
WORN, MOVED = 1e-9 * np.array([0.0, 0.5, 1.0]), 2e-3


def error_of(frequency, step, scheme, harmonics):
    """First order in the step, second in the harmonics; larger at the second frequency."""
    return (1.0 if frequency == 100.0 else 2.0) * (SIGN[scheme] * 1e-4 * step + 0.03 / harmonics**2)


def error_at(frequency, setting):
    return error_of(frequency, setting.step or 0.0, setting.scheme, setting.harmonics)


def time_of(frequency, step, scheme, harmonics):
    steps = 30.0 if scheme == "adaptive" else 1000.0 / step
    return 0.1 + 0.01 * steps * harmonics**1.5 * (1.0 + 0.001 * frequency)


def finest_file(estimate, exact=False):
    """A file of these errors; estimate: of the error of each worn volume and response."""
    dataset = build_file(AXES, cycles=(0.0, 500.0, 1000.0))
    for place in np.ndindex(dataset["outcome"].shape):
        at = [values[index] for values, index in zip(AXES.values(), place, strict=True)]
        dataset["worn_volume"].values[place] = WORN * (1.0 + error_of(*at))
        dataset["response_amplitude"].values[place] = MOVED * (1.0 + error_of(*at))
        dataset["run_time"].values[place] = time_of(*at)
    dataset["error_estimate"][:] = estimate
    dataset["response_error"][:] = estimate
    if exact:
        for name, value in (("worn_volume", WORN), ("response_amplitude", [MOVED])):
            dataset[f"exact_{name}"] = 0.0 * dataset[name] + value
    return Result(Path("settings.nc"), dataset)


def test_errors_against_the_exact_answer_are_those_of_the_formula():
    points = compare_settings(finest_file(math.nan, exact=True))
    assert [point.label for point in points] == ["100 Hz", "200 Hz"]
    for point, frequency in zip(points, AXES["frequency"], strict=True):
        assert point.reference is None
        assert len(point.settings) == (2 * 4 + 1) * 4  # the adaptive scheme uses no step
        for row, setting in enumerate(point.settings):
            expected = abs(error_at(frequency, setting))
            assert point.errors["volume"][row] == pytest.approx(expected, rel=1e-9, abs=1e-14)
            assert point.errors["response"][row] == pytest.approx(expected, rel=1e-9, abs=1e-14)


def test_the_finest_setting_is_the_reference_and_what_it_does_not_resolve_is_not_clear():
    for point, size in zip(compare_settings(finest_file(2e-4)), (1.0, 2.0), strict=True):
        assert point.settings[point.reference] == Setting("adaptive", None, 9.0)
        assert np.isnan(point.errors["volume"][point.reference])
        own = 1.0 + size * 0.03 / 81
        for row, setting in enumerate(point.settings):
            if row != point.reference:
                expected = abs(1.0 + error_at(100.0 * size, setting) - own) / own
                assert point.errors["volume"][row] == pytest.approx(expected, rel=1e-9, abs=1e-14)
                assert point.is_clear("volume")[row] == (expected >= 3.0 * 2e-4)


def test_the_front_is_that_of_all_pairs_compared():
    (point, _) = compare_settings(finest_file(math.nan, exact=True))
    time, error = point.time, point.errors["volume"]
    both = list(zip(time, error, strict=True))
    undominated = {(t, e) for t, e in both if not any(quicker <= t and better < e for quicker, better in both)}
    assert {(time[row], error[row]) for row in point.front("volume")} == undominated


def test_what_failed_is_never_compared():
    result = finest_file(1e-4)
    result.dataset["outcome"][{"harmonics": 3}] = 4
    for point in compare_settings(Result(result.path, result.dataset)):
        failed = np.array([setting.harmonics == 9.0 for setting in point.settings])
        assert failed.sum() == 2 * 4 + 1
        assert np.isnan(point.errors["volume"][failed]).all()
        assert np.isfinite(point.errors["volume"][~failed]).sum() == (~failed).sum() - 1


def test_an_uncertain_reference_tells_no_setting_from_another():
    assert isinstance(draw_precision(finest_file(0.5)), str)
    # schemes alone are compared with the exact answer only
    alone = {**AXES, "step": (10.0,), "harmonics": (5,)}
    assert compare_settings(Result(Path("alone.nc"), build_file(alone))) == ()
