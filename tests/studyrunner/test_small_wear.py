"""The assumption that wear is small against the distance between pairs: where it is not, a run says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from studyrunner.study.study_file import read_study
from studyrunner.summary.small_wear import SMALL, SmallWear, pair_spacing
from tests.studyrunner.fakes import FACTS
from tests.studyrunner.results_of import batches, results_of

GRID = ("axes.frequency=[210, 211.25, 212.5]", "axes.wear_coefficient=[1e-11, 1e-5]", "axes.scheme=adaptive")


def line_of(depths: dict[tuple[int, int], float], facts: object = FACTS) -> str:
    """Largest depths by frequency and wear coefficient; 1 um everywhere else."""
    study = read_study("sdof_slider", GRID)
    results = results_of(study, largest_wear_depth=lambda point: depths.get((point[0], point[1]), 1e-6))
    found = set()
    for given in (results, results[::-1]):
        small = SmallWear(study, facts)
        for points, records in batches(study, given):
            small.add(points, records)
        found.add(small.format())
    (line,) = found
    return line


def test_small_wear_is_one_number() -> None:
    # one pair on each surface: the side of the smaller one is 0.01 m
    assert line_of({(1, 0): 2e-4}) == "depth over pair spacing at most 0.02"
    assert line_of({(1, 0): SMALL * 0.01}) == "depth over pair spacing at most 0.1"


def test_large_wear_says_where_and_asks_for_the_unit() -> None:
    assert line_of({(1, 1): 0.014, (2, 1): 0.002}) == (
        "NOT MET: depth over pair spacing (0.01 m) is 1.4 at 211.25 Hz, wear_coefficient 1e-05 1/Pa, above 0.1 at"
        " 2 points: is wear_coefficient in 1/Pa? If it is, take fewer cycles"
    )
    assert "points" not in line_of({(1, 1): 0.014})


def test_points_without_a_state_say_nothing() -> None:
    nowhere = {(place, wear): float("nan") for place in range(3) for wear in range(2)}
    assert line_of(nowhere) == "nothing was computed"
    assert line_of(nowhere | {(1, 0): 2e-4}) == "depth over pair spacing at most 0.02"


@pytest.mark.parametrize(
    ("surface", "expected"),
    [("aaaa", 0.5), ("aabb", 1.0), ("abab", 2.0), ("abcd", 0.1)],
)
def test_neighbours_are_those_of_one_surface(surface: str, expected: float) -> None:
    """A surface with one pair has the side of that."""
    places = {"aaaa": (0.0, 1.0, 3.0, 3.5), "aabb": (0.0, 1.0, 1.5, 4.0), "abab": (0.0, 0.5, 2.0, 9.5)}
    position = np.full((4, 3), 10.0)
    position[:, 1] += places.get(surface, (0.0, 0.01, 0.02, 0.03))
    facts = replace(FACTS, position=position, area=np.full(4, 0.01), surface=tuple(surface))
    assert pair_spacing(facts) == pytest.approx(expected)


def test_without_positions_it_is_the_side_of_a_pair() -> None:
    facts = replace(FACTS, position=np.full((2, 3), np.nan), surface=("a", "a"))
    assert pair_spacing(facts) == pytest.approx(0.01)
    at_one_place = replace(FACTS, position=np.ones((2, 3)), surface=("a", "a"))
    assert pair_spacing(at_one_place) == pytest.approx(0.01)


def test_pairs_at_one_place_are_no_neighbours() -> None:
    position = np.array([[0.0, 0, 0], [1e-12, 0, 0], [1.0, 0, 0]])
    facts = replace(FACTS, position=position, area=np.full(3, 1e-4), surface=("a",) * 3)
    assert pair_spacing(facts) == pytest.approx(1.0)
