"""Which outcomes came, over wear and excitation."""

import itertools

import pytest

from studyrunner.study.study_file import read_study
from studyrunner.summary.outcome_table import OutcomeTable
from tests.studyrunner.results_of import batches, results_of

GRID = (
    "axes.frequency=[100, 110]",
    "axes.wear_coefficient=[1e-14, 1e-11]",
    "axes.excitation_amplitude=[0.5, 25]",
    "axes.scheme=implicit",
)


def rows_of(outcome, *overrides, n_left_out=0):
    """By frequency, wear coefficient and excitation; the last histories may be missing."""
    study = read_study("sdof_slider", (*GRID, *overrides))
    results = results_of(
        study,
        outcome=lambda point: outcome.get(point[:3], 0),
        error_estimate=lambda point: 0.02 if point[:2] == (0, 0) else 0.01,
    )
    table = OutcomeTable(study)
    for points, records in batches(study, results[: len(results) - n_left_out]):
        table.add(points, records)
    return table.rows()


def test_a_row_for_each_wear_coefficient_and_a_column_for_each_excitation():
    assert rows_of({(0, 1, 1): 10, (1, 1, 1): 4, (1, 0, 1): 9}) == [
        ("outcomes (known to rtol)", "excitation_amplitude 0.5 N | excitation_amplitude 25 N"),
        ("  wear_coefficient 1e-14 1/Pa", "2 converged (1)            | 1 converged, 1 adrift (0)"),
        ("  wear_coefficient 1e-11 1/Pa", "2 converged (2)            | 1 march_failed, 1 time_limit (0)"),
    ]


def test_every_point_is_counted_once():
    def pick(point):
        return sum(point) % 5

    outcome = {point: pick(point) for point in itertools.product(range(2), repeat=3)}
    rows = rows_of(outcome, "axes.step=[100, 1000]", "axes.scheme=['implicit', 'explicit']")
    numbers = [int(part.split()[0]) for _, text in rows[1:] for cell in text.split(" | ") for part in cell.split(", ")]
    assert sum(numbers) == 2**5


@pytest.mark.parametrize(
    ("overrides", "heads"),
    [
        (("axes.wear_coefficient=1e-11",), []),
        (("axes.excitation_amplitude=1",), []),
        (("axes.wear_coefficient=1e-11", "axes.step=[1, 10]"), ["step 1", "step 10"]),
        (
            ("axes.excitation_amplitude=1", "axes.step=[1, 10]"),
            ["wear_coefficient 1e-14 1/Pa", "wear_coefficient 1e-11 1/Pa"],
        ),
    ],
)
def test_axes_are_those_that_vary(overrides, heads):
    rows = rows_of({}, *overrides)
    assert [label.strip() for label, _ in rows[1:]] == heads
    assert bool(rows) is bool(heads)
