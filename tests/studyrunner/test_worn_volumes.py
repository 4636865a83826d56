"""The first line of the table at the end: how many worn volumes are known to `rtol`, the worst, and what to do."""

import pytest

from studyrunner.study.study_file import read_study
from studyrunner.summary.worn_volumes import WornVolumes
from tests.studyrunner.results_of import batches, results_of

GRID = ("axes.frequency=[210, 211.25, 212.5]", "axes.scheme=['implicit', 'explicit', 'adaptive']")


def line_of(*overrides, error=lambda _: 0.005, outcome=lambda _: 0, **values):
    study = read_study("sdof_slider", overrides)
    results = results_of(study, error_estimate=error, outcome=outcome, **values)
    lines = set()
    for given in (results, results[::-1]):
        table = WornVolumes(study)
        for points, records in batches(study, given):
            table.add(points, records)
        lines.add(table.format())
    (line,) = lines
    return line


def at(point):
    """Places on the axes frequency and scheme."""
    return point[0], point[4]


def test_an_error_just_above_rtol_is_not_shown_as_rtol():
    one = ("axes.frequency=1", "axes.scheme=adaptive")
    assert line_of(*one, error=lambda _: 0.010003) == (
        "0 of 1 point known to rtol = 1 %, 1 less well; worst 1.0003 %: rtol = 0.0099"
    )
    # nor one just below a finer one as above it
    assert line_of(*one, "solver.rtol=0.01165", error=lambda _: 0.01163).endswith("rtol = 1.165 %; worst 1.16 %")


@pytest.mark.parametrize(("place", "remedy"), [((1, 1), "a smaller step"), ((1, 0), None), ((1, 2), "a smaller rtol")])
def test_the_worst_with_its_place_and_what_to_do(place, remedy):
    def error(point):
        return 0.15 if at(point) == place else 0.02 if point[0] == 2 else 0.001

    scheme = ("implicit", "explicit", "adaptive")[place[1]]
    expected = remedy or "a smaller step"
    assert line_of(*GRID, error=error) == (
        f"5 of 9 points known to rtol = 1 %, 4 less well; worst 15 % at 211.25 Hz, {scheme}: {expected}"
    )


def test_points_that_failed_or_were_never_estimated_are_not_within():
    def outcome(point):
        return {(0, 0): 4, (0, 1): 6, (0, 2): 15}.get(at(point), 0)

    def error(point):
        return {(0, 0): 9.0, (0, 1): 0.03, (0, 2): 1.2, (1, 0): float("nan")}.get(at(point), 0.0)

    assert line_of(*GRID, error=error, outcome=outcome) == (
        "5 of 9 points known to rtol = 1 %, 2 less well, 1 not computed to the end, 1 never estimated;"
        " worst 120 % at 210 Hz, adaptive: a smaller rtol"
    )


def test_every_point_is_held_against_its_own_rtol():
    study = ("axes.frequency=1", "axes.rtol=[1e-2, 1e-3]", "axes.scheme=adaptive")
    assert line_of(*study, error=lambda _: 5e-3) == (
        "1 of 2 points known to their rtol, 1 less well; worst 0.5 % at rtol 0.001: rtol = 0.0002"
    )
    assert "2 of 2" in line_of(*study, error=lambda _: 5e-4)


def test_without_cycles_there_is_nothing_to_be_known():
    assert line_of("axes.frequency=1", "slow_time.cycles=0") == "not asked for: slow_time.cycles = 0"
