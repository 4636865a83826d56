"""Points that failed or are less exact than asked for are named, with cycle and error, and not too many of them."""

from dataclasses import replace

from solver.outcome import Outcome
from studyrunner.study.study_file import read_study
from studyrunner.summary.findings import MOST_NAMED, Findings
from tests.studyrunner.fakes import FACTS
from tests.studyrunner.results_of import batches, results_of

GRID = ("axes.frequency=[210, 211.25, 212.5]", "axes.scheme=['implicit', 'explicit']")
INACCURATE, MARCH_FAILED, EXCEPTION = int(Outcome.INACCURATE), int(Outcome.MARCH_FAILED), int(Outcome.EXCEPTION)


def lines_of(outcomes, messages=None, *overrides, largest_harmonics=None, last_cycle=20_000.0):
    """Findings of a study whose points end as is said by frequency and scheme; all others converge."""
    study = read_study("sdof_slider", overrides or GRID)
    said = messages or {}

    def at(point):
        return point[0], point[4]

    results = results_of(
        study,
        outcome=lambda point: outcomes.get(at(point), 0),
        message=lambda point: said.get(at(point), ""),
        error_estimate=lambda _: 0.026,
        last_cycle=lambda point: last_cycle if outcomes.get(at(point), 0) == MARCH_FAILED else 20_000.0,
    )
    numbers: dict[int, int] = {}
    for result in results:
        numbers[result.outcome] = numbers.get(result.outcome, 0) + len(result.points)
    found = set()
    for given in (results, results[::-1]):
        findings = Findings(study, replace(FACTS, largest_harmonics=largest_harmonics))
        for points, records in batches(study, given):
            findings.add(points, records)
        found.add(findings.format(numbers))
    (lines,) = found
    return lines


def test_point_cycle_and_error_are_named():
    message = "from cycle 31 000 on the wear rate is known to 2.6 % only"
    assert lines_of({(1, 1): INACCURATE}, {(1, 1): message}) == (
        f"1 x inaccurate: {Outcome.INACCURATE.sentence}",
        f"  211.25 Hz, explicit: {message}",
    )


def test_how_far_a_point_came_that_ended_early():
    assert lines_of({(2, 0): MARCH_FAILED}, last_cycle=12_500.0) == (
        f'1 x march_failed: {Outcome.MARCH_FAILED.sentence} Try scheme = "adaptive" or a smaller step.',
        "  212.5 Hz, implicit: computed up to cycle 12 500 of 20 000, the worn volume there to 2.6 %",
    )
    (_, line) = lines_of({(2, 0): MARCH_FAILED}, {(2, 0): "lost it"}, last_cycle=0.0)
    assert line == "  212.5 Hz, implicit: computed up to cycle 0 of 20 000; lost it"
    (_, line) = lines_of({(2, 0): MARCH_FAILED}, {(2, 0): "ended at cycle 12"}, last_cycle=12.0)
    assert line == "  212.5 Hz, implicit: ended at cycle 12"
    (_, line) = lines_of({(2, 0): MARCH_FAILED}, last_cycle=float("nan"))
    assert line == "  212.5 Hz, implicit: no state was found"


def test_points_that_were_computed_otherwise_have_advice_of_their_own():
    """What was used decides: nothing that the study has, and no step for a scheme that has none."""
    grid = ("axes.frequency=[210, 211]", "axes.scheme=['adaptive', 'explicit']")
    found = lines_of({(0, 0): MARCH_FAILED, (0, 1): MARCH_FAILED, (1, 1): MARCH_FAILED}, None, *grid)
    sentence = f"x march_failed: {Outcome.MARCH_FAILED.sentence}"
    assert [line for line in found if not line.startswith(" ")] == [
        f'1 {sentence} Try a smaller rtol, which makes the steps shorter, or scheme = "implicit" with a small step.',
        f"2 {sentence} Try a smaller step.",
    ]


def test_no_more_than_some_are_named():
    many = "axes.frequency=" + str(list(range(100, 125)))
    outcomes = {(place, 0): INACCURATE for place in range(20)}
    found = lines_of(outcomes, None, many, "axes.scheme=implicit")
    assert len(found) == 1 + MOST_NAMED + 1
    assert found[1] == "  100 Hz"
    assert found[-1] == f"  and {20 - MOST_NAMED} more"
    both = lines_of(outcomes | {(22, 0): MARCH_FAILED}, None, many, "axes.scheme=implicit")
    assert len(both) == 1 + 1 + 1 + MOST_NAMED // 2 + 1
    assert both[-1] == f"  and {20 - MOST_NAMED // 2} more"
