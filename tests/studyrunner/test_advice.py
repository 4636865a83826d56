"""Advice on points that failed, or that are known less well than was asked for: nothing in use, nothing ignored."""

import itertools

import pytest

from solver.outcome import Outcome
from studyrunner.advice import Used, advise, advise_error, advise_steps
from studyrunner.percent import known_to, show_percent, show_rtol
from studyrunner.plan.point_text import settings_of
from studyrunner.study.study_file import read_study

SCHEMES, SWEEPS = ("adaptive", "implicit", "explicit", "final"), ("up", "down", "ramp")
ALL = [
    Used(scheme, sweep, harmonics, samples, schemes=(scheme, *more), sweeps=(sweep,), by_depth=by_depth)
    for scheme, sweep, harmonics, samples, more, by_depth in itertools.product(
        SCHEMES, SWEEPS, ("auto", 3), ("auto", 64), ((), ("adaptive", "implicit")), (False, True)
    )
]
"""Everything that a point may be computed with."""


def texts_on(used):
    """All that may be advised on a point."""
    errors = [advise_error(error, rates, used) for error in (0.013, 0.5) for rates in ([], [0.01, 0.3], [0.0, 0.0])]
    return [*(advise(outcome.meaning, used) for outcome in Outcome), *errors, advise_steps(used)]


@pytest.mark.parametrize("used", ALL, ids=str)
def test_nothing_is_advised_that_is_in_use_or_not_used(used):
    for text in texts_on(used):
        for scheme in {used.scheme, *used.schemes}:
            assert f'scheme = "{scheme}"' not in text
        for sweep in {used.sweep, *used.sweeps}:
            assert f'sweep = "{sweep}"' not in text
        for key in ("harmonics", "samples"):
            assert getattr(used, key) != "auto" or f'{key} = "auto"' not in text
        if used.scheme in ("adaptive", "final"):
            assert "a smaller step" not in text
            assert "largest_depth" not in text
        if used.by_depth and used.scheme == "explicit":
            assert "smaller step" not in text


def test_settings_of_a_point_are_its_own():
    changes = ("axes.scheme=['implicit', 'explicit']", "axes.harmonics=['auto', 5]", "axes.rtol=[1e-2, 1e-3]")
    study = read_study("sdof_slider", (*changes, "slow_time.largest_depth=1e-6"))
    names = list(study.dimensions)
    point = [0] * len(names)
    for name in ("scheme", "harmonics", "rtol"):
        point[names.index(name)] = 1
    assert settings_of(study, point) == Used(
        "explicit", "up", 5, "auto", 1e-3, ("implicit", "explicit"), ("up",), by_depth=True
    )


# --- errors in percent ---


@pytest.mark.parametrize(
    ("error", "rtol", "text"),
    [
        (0.026, 0.01, "2.6 %"),
        (0.01, 0.01, "1 %"),
        (0.0099999, 0.01, "1 %"),
        (0.0100001, 0.01, "1.00001 %"),
        (0.01049, 0.01, "1.05 %"),
        (0.01163, 0.01165, "1.16 %"),
        (0.07, 0.07, "7 %"),
        (0.29, 0.29, "29 %"),
        (0.999, 0.01, "100 %"),
        (1.234, 0.01, "123 %"),
        (12.3, 0.01, "1e+03 %"),
        (0.0, 0.01, "0 %"),
    ],
)
def test_an_error_is_shown_on_its_side_of_rtol(error, rtol, text):
    assert show_percent(error, rtol) == text
    if error < 1.0:
        shown, limit = float(text.removesuffix(" %")), float(show_rtol(rtol).removesuffix(" %"))
        assert (shown <= limit) == (error <= rtol)


def test_what_is_not_finite_is_not_known():
    assert known_to(0.010003, 0.01) == "is known to 1.0003 % only"
    assert known_to(float("inf"), 0.01) == "is not known"
