"""The outcome of a wear history and its sentence, for the history itself and for those that share it."""

from dataclasses import replace

import numpy as np
import pytest

from solver.outcome import Outcome
from solver.results.verdict import judge
from tests.studyrunner.histories import history

COUNTS = [0.0, 4.0, 10.0]
ALL = np.arange(3)


def judged(rows=ALL, slower=1.0, **changed):
    """Of a history whose volume at the last count, 2 m3, is known to 6 %."""
    return judge(replace(history(COUNTS), **changed), np.asarray(rows), 1e-2, slower)


def test_a_history_that_is_known_says_nothing():
    assert judged() == (Outcome.CONVERGED, "")
    assert judged(np.zeros(0, int)) == (Outcome.CONVERGED, "")


@pytest.mark.parametrize(
    ("other", "error", "said"),
    [
        (1e-9, 0.6, "worn volume 2 mm3, but 1 mm3 with longer steps, fewer harmonics and a coarser sweep: known"),
        (1.8e-9, 3.0, "worn volume 2 mm3, not known: 1.8 mm3 with longer steps, fewer harmonics and a coarser"),
        (np.nan, 0.6, "worn volume 2 mm3, known to 60 % only: with longer steps, fewer harmonics and a coarser"),
        (np.nan, np.inf, "worn volume 2 mm3, not known: with longer steps"),
    ],
)
def test_a_sensitive_volume_is_told_with_that_of_the_reference_solution(other, error, said):
    volumes, errors = 1e-9 * np.arange(3.0), np.array([0.0, 0.1, error])
    changed = {"worn_volume": volumes, "worn_volume_error": errors, "reference_volume": np.array([0.0, 1e-9, other])}
    outcome, message = judged(**changed)
    assert outcome is Outcome.SENSITIVE
    assert message.startswith(said)
    # a history that shares it and ends before is known
    assert judged([0, 1], 0.4, **changed) == (Outcome.CONVERGED, "")


@pytest.mark.parametrize(
    ("first", "rows", "said"),
    [
        (0.0, ALL, "from cycle 0 on "),
        (4.0, ALL, "from cycle 8 on "),
        (4.0, [0, 1], "from cycle 8 on "),
        (5.0, [0, 1], ""),
        (np.inf, ALL, ""),
    ],
)
def test_harmonics_that_do_not_suffice_are_told_from_their_count_on(first, rows, said):
    outcome, message = judged(rows, 0.5, inaccurate_from=first, inaccurate_in="response", inaccurate_error=0.026)
    assert outcome is (Outcome.INACCURATE if said else Outcome.CONVERGED)
    assert message == (f"{said}the response is known to 2.6 % only" if said else "")
    _, unknown = judged(rows, 0.5, inaccurate_from=first, inaccurate_in="wear rate", inaccurate_error=np.inf)
    assert unknown == (f"{said}the wear rate is not known" if said else "")


def test_a_volume_that_is_not_known_goes_before_harmonics_and_a_contact_cut_off_before_both():
    wrong = {"worn_volume_error": np.array([0.0, 0.1, 0.6]), "inaccurate_from": 0.0, "inaccurate_error": 0.02}
    assert judged(**wrong)[0] is Outcome.SENSITIVE
    outcome, message = judged(slower=0.5, **wrong, cut_off_cycle=4.0)
    assert outcome is Outcome.CONTACT_CUT_OFF
    assert "8" in message
    assert judged(**wrong, cut_off_cycle=11.0)[0] is Outcome.SENSITIVE


def test_a_joint_that_is_held_says_so_beside_all_else():
    outcome, message = judged(held_from=4.0, slower=0.5)
    assert outcome is Outcome.CONVERGED
    assert message.startswith("from cycle 8 on every pair slips")
    _, both = judged(held_from=4.0, inaccurate_from=0.0, inaccurate_in="response", inaccurate_error=0.02)
    assert both.startswith("from cycle 0 on the response is known to 2 % only; from cycle 4 on every pair slips")
    assert judged([0], held_from=4.0) == (Outcome.CONVERGED, "")
