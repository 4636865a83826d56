"""The outcome of a wear history and its sentence, for the history itself and for those that share it."""

from dataclasses import replace

import numpy as np
import pytest

from solver.outcome import Outcome
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
