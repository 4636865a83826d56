"""The outcome of a wear history and its sentence, for the history itself and for those that share it."""

from dataclasses import replace

import numpy as np
import pytest

from solver.outcome import Outcome, in_digits
from solver.results.verdict import judge
from tests.studyrunner.histories import history

COUNTS = [0.0, 4.0, 10.0]
ALL = np.arange(3)
INACCURATE = {"inaccurate_in": "response", "inaccurate_error": 0.026}
UNKNOWN = {"worn_volume": 1e-9 * np.arange(3.0), "worn_volume_error": np.array([0.0, 0.1, 0.6])}


def judged(rows=ALL, slower=1.0, **changed):
    """Of a history whose volume at the last count, 2 m3, is known to 6 %."""
    return judge(replace(history(COUNTS), **changed), np.asarray(rows, int), 1e-2, slower)


@pytest.mark.parametrize(
    ("rows", "changed", "outcome", "said"),
    [
        (ALL, {}, Outcome.CONVERGED, ""),
        ([], {}, Outcome.CONVERGED, ""),
        (ALL, {"inaccurate_from": 0.0}, Outcome.INACCURATE, "from cycle 0 on the response is known to 2.6 % only"),
        (ALL, {"inaccurate_from": 4.0}, Outcome.INACCURATE, "from cycle 8 on the response is known to 2.6 % only"),
        ([0, 1], {"inaccurate_from": 4.0}, Outcome.INACCURATE, "from cycle 8 on "),
        ([0, 1], {"inaccurate_from": 5.0}, Outcome.CONVERGED, ""),
        (
            ALL,
            {"inaccurate_from": 0.0, "inaccurate_error": np.inf},
            Outcome.INACCURATE,
            "from cycle 0 on the response is not",
        ),
        # what is not known goes before harmonics, a contact that is cut off before both
        (ALL, {**UNKNOWN, "inaccurate_from": 0.0}, Outcome.SENSITIVE, "worn volume 2 mm3"),
        (ALL, {**UNKNOWN, "cut_off_cycle": 4.0}, Outcome.CONTACT_CUT_OFF, "pairs at the edge"),
        (ALL, {**UNKNOWN, "cut_off_cycle": 11.0}, Outcome.SENSITIVE, "worn volume 2 mm3"),
        # a history that shares it and ends before is known
        ([0, 1], UNKNOWN, Outcome.CONVERGED, ""),
        # a joint that is held says so beside all else
        (ALL, {"held_from": 4.0}, Outcome.CONVERGED, "from cycle 8 on every pair slips"),
        (ALL, {"held_from": 4.0, "inaccurate_from": 0.0}, Outcome.INACCURATE, "from cycle 0 on the response"),
        ([0], {"held_from": 4.0}, Outcome.CONVERGED, ""),
    ],
)
def test_the_outcome_is_that_of_the_counts_that_are_judged(rows, changed, outcome, said):
    found = judged(rows, 0.5, **{**INACCURATE, **changed})
    assert found[0] is outcome
    assert found[1].startswith(said)
    assert bool(found[1]) is bool(said)
    if {"held_from", "inaccurate_from"} <= set(changed):
        assert "; from cycle 8 on every pair slips" in found[1]


@pytest.mark.parametrize(
    ("other", "error", "said"),
    [
        (1e-9, 0.6, "worn volume 2 mm3, but 1 mm3 with longer steps, fewer harmonics and a coarser sweep: known"),
        (1.8e-9, 3.0, "worn volume 2 mm3, not known: 1.8 mm3 with longer steps, fewer harmonics and a coarser"),
        (np.nan, 0.6, "worn volume 2 mm3, known to 60 % only: with longer steps, fewer harmonics and a coarser"),
        (np.nan, np.inf, "worn volume 2 mm3, not known: with longer steps"),
    ],
)
def test_an_unknown_volume_stands_beside_that_of_the_reference_solution(other, error, said):
    errors = {"worn_volume_error": np.array([0.0, 0.1, error]), "reference_volume": np.array([0.0, 1e-9, other])}
    assert judged(**{**UNKNOWN, **errors})[1].startswith(said)


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [(2000.0, 2, "2000"), (123456.0, 3, "123000"), (0.35, 3, "0.35"), (np.inf, 3, "inf"), (0.0, 6, "0")],
)
def test_counts_have_no_exponent(value, digits, text):
    assert in_digits(value, digits) == text
