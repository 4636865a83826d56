"""What a run says of its points in the end: worn volumes, findings, outcomes, small wear; the same in any order."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from solver.outcome import Outcome
from studyrunner.advice import Used, advise, advise_error, advise_steps
from studyrunner.percent import known_to, show_percent, show_rtol
from studyrunner.plan.point_text import describe_reach, settings_of
from studyrunner.study.study_file import read_study
from studyrunner.summary.findings import MOST_NAMED, Findings
from studyrunner.summary.outcome_table import OutcomeTable
from studyrunner.summary.small_wear import SMALL, SmallWear, contact_width
from studyrunner.summary.worn_volumes import WornVolumes
from tests.studyrunner.fakes import FACTS
from tests.studyrunner.results_of import results_of, told


def at(point):
    """Places on the axes frequency and scheme."""
    return point[0], point[4]


# --- worn volumes: how many are known to `rtol`, the worst, and what to do ---

GRID = ("axes.frequency=[210, 211.25, 212.5]", "axes.scheme=['implicit', 'explicit', 'adaptive']")


def volumes_of(*overrides, error=lambda _: 0.005, outcome=lambda _: 0):
    study = read_study("sdof_slider", overrides)
    results = results_of(study, error_estimate=error, outcome=outcome)
    return told(WornVolumes.format, lambda: WornVolumes(study), study, results)


def test_an_error_just_above_rtol_is_not_shown_as_rtol():
    one = ("axes.frequency=1", "axes.scheme=adaptive")
    assert volumes_of(*one, error=lambda _: 0.010003) == (
        "0 of 1 point known to rtol = 1 %, 1 less well; worst 1.0003 %: rtol = 0.0099"
    )
    # nor one just below a finer one as above it
    assert volumes_of(*one, "solver.rtol=0.01165", error=lambda _: 0.01163).endswith("rtol = 1.165 %; worst 1.16 %")


@pytest.mark.parametrize(
    ("place", "remedy"), [((1, 1), "a smaller step"), ((1, 0), "a smaller step"), ((1, 2), "a smaller rtol")]
)
def test_the_worst_with_its_place_and_what_to_do(place, remedy):
    scheme = ("implicit", "explicit", "adaptive")[place[1]]
    found = volumes_of(*GRID, error=lambda p: 0.15 if at(p) == place else 0.02 if p[0] == 2 else 0.001)
    assert found == f"5 of 9 points known to rtol = 1 %, 4 less well; worst 15 % at 211.25 Hz, {scheme}: {remedy}"


def test_points_that_failed_or_were_never_estimated_are_not_within():
    outcomes = {(0, 0): 4, (0, 1): 6, (0, 2): 15}
    errors = {(0, 0): 9.0, (0, 1): 0.03, (0, 2): 1.2, (1, 0): float("nan")}
    found = volumes_of(*GRID, error=lambda p: errors.get(at(p), 0.0), outcome=lambda p: outcomes.get(at(p), 0))
    assert found == (
        "5 of 9 points known to rtol = 1 %, 2 less well, 1 not computed to the end, 1 never estimated;"
        " worst 120 % at 210 Hz, adaptive: a smaller rtol"
    )


def test_every_point_is_held_against_its_own_rtol():
    study = ("axes.frequency=1", "axes.rtol=[1e-2, 1e-3]", "axes.scheme=adaptive")
    assert volumes_of(*study, error=lambda _: 5e-3) == (
        "1 of 2 points known to their rtol, 1 less well; worst 0.5 % at rtol 0.001: rtol = 0.0002"
    )
    assert "2 of 2" in volumes_of(*study, error=lambda _: 5e-4)
    assert volumes_of("axes.frequency=1", "slow_time.cycles=0") == "not asked for: slow_time.cycles = 0"


# --- findings: points that failed or are less exact than asked for, and not too many of them ---

TWO = ("axes.frequency=[210, 211.25, 212.5]", "axes.scheme=['implicit', 'explicit']")
INACCURATE, MARCH_FAILED = int(Outcome.INACCURATE), int(Outcome.MARCH_FAILED)


def findings_of(outcomes, messages=None, *overrides, last_cycle=20_000.0):
    """Of a study whose points end as is said by frequency and scheme; all others converge."""
    study, said = read_study("sdof_slider", overrides or TWO), messages or {}
    results = results_of(
        study,
        outcome=lambda point: outcomes.get(at(point), 0),
        message=lambda point: said.get(at(point), ""),
        error_estimate=lambda _: 0.026,
        last_cycle=lambda point: last_cycle if outcomes.get(at(point), 0) == MARCH_FAILED else 20_000.0,
    )
    numbers = {}
    for result in results:
        numbers[result.outcome] = numbers.get(result.outcome, 0) + len(result.points)
    return told(lambda found: found.format(numbers), lambda: Findings(study, FACTS), study, results)


def test_point_cycle_and_error_are_named():
    message = "from cycle 31 000 on the wear rate is known to 2.6 % only"
    assert findings_of({(1, 1): INACCURATE}, {(1, 1): message}) == (
        f"1 x inaccurate: {Outcome.INACCURATE.sentence}",
        f"  211.25 Hz, explicit: {message}",
    )


def test_how_far_a_point_came_that_ended_early():
    head, line = findings_of({(2, 0): MARCH_FAILED}, last_cycle=12_500.0)
    assert head == f'1 x march_failed: {Outcome.MARCH_FAILED.sentence} Try scheme = "adaptive" or a smaller step.'
    assert line == "  212.5 Hz, implicit: computed up to cycle 12 500 of 20 000, the worn volume there to 2.6 %"
    for message, last, expected in (
        ("lost it", 0.0, "computed up to cycle 0 of 20 000; lost it"),
        ("ended at cycle 12", 12.0, "ended at cycle 12"),
        ("", float("nan"), "no state was found"),
    ):
        (_, line) = findings_of({(2, 0): MARCH_FAILED}, {(2, 0): message}, last_cycle=last)
        assert line == f"  212.5 Hz, implicit: {expected}"
    for error in (0.0, float("inf")):
        assert describe_reach(2000.0, 1e5, error) == "computed up to cycle 2000 of 100 000"


def test_points_that_were_computed_otherwise_have_advice_of_their_own():
    """What was used decides: nothing that the study has, and no step for a scheme that has none."""
    grid = ("axes.frequency=[210, 211]", "axes.scheme=['adaptive', 'explicit']")
    found = findings_of({(0, 0): MARCH_FAILED, (0, 1): MARCH_FAILED, (1, 1): MARCH_FAILED}, None, *grid)
    sentence = f"x march_failed: {Outcome.MARCH_FAILED.sentence}"
    assert [line for line in found if not line.startswith(" ")] == [
        f'1 {sentence} Try a smaller rtol, which makes the steps shorter, or scheme = "implicit" with a small step.',
        f"2 {sentence} Try a smaller step.",
    ]


def test_no_more_than_some_are_named():
    many = ("axes.frequency=" + str(list(range(100, 125))), "axes.scheme=implicit")
    outcomes = {(place, 0): INACCURATE for place in range(20)}
    found = findings_of(outcomes, None, *many)
    assert len(found) == 1 + MOST_NAMED + 1
    assert (found[1], found[-1]) == ("  100 Hz", f"  and {20 - MOST_NAMED} more")
    both = findings_of(outcomes | {(22, 0): MARCH_FAILED}, None, *many)
    assert len(both) == 1 + 1 + 1 + MOST_NAMED // 2 + 1
    assert both[-1] == f"  and {20 - MOST_NAMED // 2} more"


# --- outcomes over wear and excitation ---

WEAR_AND_LOAD = ("axes.frequency=[100, 110]", "axes.wear_coefficient=[1e-14, 1e-11]", "axes.scheme=implicit")


def outcomes_of(outcome, *overrides):
    """By frequency, wear coefficient and excitation."""
    study = read_study("sdof_slider", (*WEAR_AND_LOAD, "axes.excitation_amplitude=[0.5, 25]", *overrides))
    results = results_of(
        study,
        outcome=lambda point: outcome.get(point[:3], 0),
        error_estimate=lambda point: 0.02 if point[:2] == (0, 0) else 0.01,
    )
    return told(OutcomeTable.rows, lambda: OutcomeTable(study), study, results)


def test_a_row_for_each_wear_coefficient_and_a_column_for_each_excitation():
    assert outcomes_of({(0, 1, 1): 10, (1, 1, 1): 4, (1, 0, 1): 9}) == [
        ("outcomes (known to rtol)", "excitation_amplitude 0.5 N | excitation_amplitude 25 N"),
        ("  wear_coefficient 1e-14 1/Pa", "2 converged (1)            | 1 converged, 1 adrift (0)"),
        ("  wear_coefficient 1e-11 1/Pa", "2 converged (2)            | 1 march_failed, 1 time_limit (0)"),
    ]
    outcome = {point: sum(point) % 5 for point in itertools.product(range(2), repeat=3)}
    rows = outcomes_of(outcome, "axes.step=[100, 1000]", "axes.scheme=['implicit', 'explicit']")
    numbers = [int(part.split()[0]) for _, text in rows[1:] for cell in text.split(" | ") for part in cell.split(", ")]
    assert sum(numbers) == 2**5, "every point is counted once"


@pytest.mark.parametrize(
    ("overrides", "heads"),
    [
        (("axes.wear_coefficient=1e-11",), []),
        (("axes.excitation_amplitude=1",), []),
        (("axes.wear_coefficient=1e-11", "axes.step=[1, 10]"), ["step 1", "step 10"]),
        (("axes.excitation_amplitude=1", "axes.step=[1, 10]"), [f"wear_coefficient {k} 1/Pa" for k in (1e-14, 1e-11)]),
    ],
)
def test_axes_are_those_that_vary(overrides, heads):
    rows = outcomes_of({}, *overrides)
    assert [label.strip() for label, _ in rows[1:]] == heads
    assert bool(rows) is bool(heads)


# --- wear is small against the width of the contact ---

COEFFICIENTS = ("axes.frequency=[210, 211.25, 212.5]", "axes.wear_coefficient=[1e-11, 1e-5]", "axes.scheme=adaptive")


def small_wear(depths):
    """Largest depths by frequency and wear coefficient; 1 um everywhere else."""
    study = read_study("sdof_slider", COEFFICIENTS)
    results = results_of(study, largest_wear_depth=lambda point: depths.get((point[0], point[1]), 1e-6))
    return told(SmallWear.format, lambda: SmallWear(study, FACTS), study, results)


def test_small_wear_is_one_number():
    # one pair on each surface: the side of the smaller one is 0.01 m
    assert small_wear({(1, 0): 2e-4}) == "depth over contact width at most 0.02"
    assert small_wear({(1, 0): SMALL * 0.01}) == "depth over contact width at most 0.1"
    nowhere = {(place, wear): float("nan") for place in range(3) for wear in range(2)}
    assert small_wear(nowhere) == "nothing was computed"
    assert small_wear(nowhere | {(1, 0): 2e-4}) == "depth over contact width at most 0.02"


def test_large_wear_says_where_and_asks_for_the_unit():
    assert small_wear({(1, 1): 0.014, (2, 1): 0.002}) == (
        "NOT MET: depth over contact width (0.01 m) is 1.4 at 211.25 Hz, wear_coefficient 1e-05 1/Pa, above 0.1 at"
        " 2 points: is wear_coefficient in 1/Pa?"
    )
    assert "points" not in small_wear({(1, 1): 0.014})


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
