"""The assumption that wear is small against the width of the contact: where it is not, a run says so."""

from dataclasses import replace

import numpy as np
import pytest

from studyrunner.study.study_file import read_study
from studyrunner.summary.small_wear import SMALL, SmallWear, contact_width
from tests.studyrunner.fakes import FACTS
from tests.studyrunner.results_of import batches, results_of

GRID = ("axes.frequency=[210, 211.25, 212.5]", "axes.wear_coefficient=[1e-11, 1e-5]", "axes.scheme=adaptive")


def line_of(depths, facts=FACTS, grid=GRID):
    """Largest depths by frequency and wear coefficient; 1 um everywhere else."""
    study = read_study("sdof_slider", grid)
    results = results_of(study, largest_wear_depth=lambda point: depths.get((point[0], point[1]), 1e-6))
    found = set()
    for given in (results, results[::-1]):
        small = SmallWear(study, facts)
        for points, records in batches(study, given):
            small.add(points, records)
        found.add(small.format())
    (line,) = found
    return line


def test_small_wear_is_one_number():
    # one pair on each surface: the side of the smaller one is 0.01 m
    assert line_of({(1, 0): 2e-4}) == "depth over contact width at most 0.02"
    assert line_of({(1, 0): SMALL * 0.01}) == "depth over contact width at most 0.1"


def test_large_wear_says_where_and_asks_for_the_unit():
    assert line_of({(1, 1): 0.014, (2, 1): 0.002}) == (
        "NOT MET: depth over contact width (0.01 m) is 1.4 at 211.25 Hz, wear_coefficient 1e-05 1/Pa, above 0.1 at"
        " 2 points: is wear_coefficient in 1/Pa?"
    )
    assert "points" not in line_of({(1, 1): 0.014})


def test_points_without_a_state_say_nothing():
    nowhere = {(place, wear): float("nan") for place in range(3) for wear in range(2)}
    assert line_of(nowhere) == "nothing was computed"
    assert line_of(nowhere | {(1, 0): 2e-4}) == "depth over contact width at most 0.02"


@pytest.mark.parametrize(("n_along", "n_across"), [(1, 1), (2, 3), (8, 3), (40, 1), (1, 12), (40, 21)])
def test_the_width_is_that_of_the_surface_however_finely_it_is_divided(n_along, n_across):
    """A flank of 40 by 7 mm, turned in space."""
    along, across = ((np.arange(n) + 0.5) / n * size for n, size in ((n_along, 0.04), (n_across, 0.007)))
    flat = np.stack([*np.meshgrid(along, across), np.full((n_across, n_along), 0.3)], axis=-1).reshape(-1, 3)
    turned = flat @ np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    area = np.full(len(flat), 0.04 * 0.007 / len(flat))
    facts = replace(FACTS, position=turned, area=area, surface=("a",) * len(flat))
    # a single pair, or a row of pairs across, does not say how long it is
    expected = 0.007 if n_along > 1 else 0.007 if n_across > 1 else np.sqrt(0.04 * 0.007)
    assert contact_width(facts) == pytest.approx(expected, rel=0.2 if min(n_along, n_across) == 2 else 0.02)
