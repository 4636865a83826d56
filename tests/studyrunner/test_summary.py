"""The summary of a result as data: what wears most, why nothing wore, what failed; and that its text is short."""

import math
from dataclasses import replace

import numpy as np
import pytest

from solver.outcome import Outcome
from studyrunner.kinds.wear.meshes import compare_meshes, converge
from studyrunner.report.page import _facts as page_facts
from studyrunner.result.opening import as_history
from studyrunner.result.view import Result
from studyrunner.study.study_file import read_study
from studyrunner.summary.answer import MOST_COLUMNS, MOST_ROWS, SMALL, summary
from studyrunner.summary.findings import Finding
from studyrunner.units import show_percent
from tests.studyrunner.fakes import FACTS, plan_of
from tests.studyrunner.results import result_of_study

GRID = ("axes.frequency=[210, 211.25, 212.5]", "axes.scheme=['implicit', 'explicit', 'adaptive']")
SENSITIVE, FAILED, INACCURATE = int(Outcome.SENSITIVE), int(Outcome.MARCH_FAILED), int(Outcome.INACCURATE)


def at(point):
    """Places on the axes frequency and scheme."""
    return point[0], point[4]


def wearing(*overrides, volume=lambda _: 1e-9, name="sdof_slider", facts=FACTS, **given):
    """A result whose points wear these volumes, m3, in equal parts up to the last count."""
    study = read_study(name, overrides)
    share = np.linspace(0.0, 1.0, len(study.output_counts))
    return result_of_study(study, facts, worn_volume=lambda point: volume(point) * share, **given)


def result_of(dataset):
    return Result("made.nc", as_history(dataset)[0])


# --- where it wears most ---


def test_of_numerical_settings_the_best_known_is_shown():
    """Explicit steps wear most, and are known least: they are no other case."""
    volumes = {(0, 0): 1.0, (1, 0): 2.0, (1, 1): 9.0, (1, 2): 2.1, (2, 2): 2.05}
    errors = {(1, 0): 0.04, (1, 1): 0.4, (1, 2): 0.01}
    known = {"error_estimate": lambda p: errors.get(at(p), 0.02)}
    wear = summary(wearing(*GRID, volume=lambda p: 1e-9 * volumes.get(at(p), 0.0), **known)).values["wear"]
    assert (wear["point"]["frequency"], wear["point"]["scheme"]) == (1, 2)
    assert (wear["n_compared"], wear["n_left_out"], wear["count"]) == (3, 0, 20_000.0)
    assert wear["worn_volume"] == pytest.approx(2.1e-9)
    assert wear["error"] == pytest.approx(2.1e-11)


@pytest.mark.parametrize(
    ("name", "value", "known"),
    [
        ("outcome", SENSITIVE, 0),
        ("outcome", FAILED, 0),
        ("error_estimate", 0.7, 0.01),
        ("error_estimate", math.nan, 0.01),
        ("error_estimate", math.inf, 0.01),
    ],
)
def test_what_is_not_known_is_no_result(name, value, known):
    """The last frequency would wear most."""
    given = {name: lambda p: value if p[0] == 2 else known}
    dataset = wearing(*GRID, volume=lambda p: 1e-9 * (1.0 + p[0]), **given)
    found = summary(dataset)
    assert found.values["wear"]["worn_volume"] == pytest.approx(2e-9)
    assert found.values["wear"]["n_left_out"] == 1
    unknown = dataset.assign({each: dataset[each] * 0.0 + math.inf for each in ("wear_depth_error", "response_error")})
    assert "(error not known)" in dict(summary(unknown).rows)["deepest"]
    nothing = summary(dataset.assign(outcome=dataset["outcome"] * 0 + FAILED))
    assert ("wear" in nothing.values, nothing.n_complete) == (False, 0)
    assert not any("mm3" in line for line in nothing.lines)


DEPTHS = np.array([3e-6, 1e-6, 2e-6, 0.0, 5e-6, 0.0])
SIX = {
    "position": np.arange(18.0).reshape(6, 3),
    "area": np.array([1.0, 2.0, 1.0, 1.0, 2.0, 1.0]) * 1e-4,
    "surface": ("left",) * 3 + ("right",) * 3,
}
BY_SIX = replace(FACTS, contact=replace(FACTS.contact, **SIX), edge=np.array([True, False, True] * 2))


@pytest.mark.parametrize("name", ["wear_depth", "wear_depth_last"])
def test_the_deepest_pair_with_its_place_and_the_wear_at_the_edge(name):
    study = read_study("sdof_slider", ("axes.frequency=100", f"outputs.variables=['worn_volume', '{name}']"))
    share = np.linspace(0.0, 1.0, 21)
    for depths, pair, edge in ((DEPTHS, 4, 0.0), (DEPTHS[[4, 1, 2, 3, 0, 5]], 0, 7.0 / 9.0)):
        depth = np.outer(share, depths) if name == "wear_depth" else depths
        made = result_of_study(
            study, BY_SIX, worn_volume=lambda _: 1e-9 * share, **{name: lambda _, depth=depth: depth}
        )
        deepest = summary(made).values["deepest"]
        assert deepest["wear_depth"] == 5e-6
        assert (deepest["contact"], deepest["surface"]) == (pair, "right" if pair else "left")
        np.testing.assert_allclose(deepest["position"], SIX["position"][pair])
        assert deepest["edge_share"] == pytest.approx(edge)
        text = "\n".join(summary(made).lines)
        assert ("edge pairs" in text) is (edge > 0.5)
        assert deepest["also"] == []
    # mirror pairs are as deep
    depth = np.array([1.0, 5.0, 2.0, 0.0, 5.0, 0.0])
    depth = np.outer(share, depth) if name == "wear_depth" else depth
    found = summary(result_of_study(study, BY_SIX, worn_volume=lambda _: share, **{name: lambda _: depth}))
    assert (found.values["deepest"]["contact"], found.values["deepest"]["also"]) == (1, [4])


def test_selected_and_squeezed_results_have_the_same_summary():
    one = wearing("axes.frequency=160", "axes.wear_coefficient=1e-13", "axes.scheme=adaptive", "axes.step=1")
    whole = str(one.fretwear.summary())
    assert "squeezed" not in whole
    assert str(one.squeeze().fretwear.summary()) == whole
    several = wearing(*GRID)
    last = several.isel(cycle=-1, frequency=1)
    assert last.fretwear.summary().values["wear"]["worn_volume"] == pytest.approx(1e-9)
    assert "cycle" not in last.dims


# --- nothing wore ---


def test_nothing_wore_says_why():
    still = summary(wearing("axes.frequency=[1, 2, 3]", "axes.scheme=adaptive", volume=lambda _: 0.0))
    expected = {"worn_volume": 0.0, "largest_slip": 0.0, "friction_use": 0.0}
    assert {name: still.values["wear"][name] for name in expected} == expected
    near = wearing("axes.frequency=[1, 2]", volume=lambda _: 0.0, friction_use=lambda p: np.full(21, 0.4 + 0.1 * p[0]))
    assert summary(near).values["wear"]["friction_use"] == 0.5
    amplitudes = ("axes.frequency=[1, 2]", "axes.excitation_amplitude=[2, 3]")
    ends = {(0, 0): 8.0, (0, 1): math.nan, (1, 0): 6.5, (1, 1): 7.0}
    begins = wearing(*amplitudes, volume=lambda _: 0.0, slip_amplitude=lambda p: ends[p[0], p[2]], name="sdof_slider")
    # of the point that is nearest to it
    assert summary(begins).values["wear"]["slip_amplitude"] == 7.0
    assert "7 N at 2 Hz, extrapolated from 3 N" in " ".join(str(summary(begins)).split())
    slips = wearing("axes.frequency=[1, 2]", volume=lambda _: 0.0, slip_range=lambda p: np.full((21, 2), 1e-6 * p[0]))
    assert summary(slips).values["wear"]["largest_slip"] == 1e-6
    some = wearing(*GRID, volume=lambda _: 0.0, outcome=lambda p: FAILED if p[0] else 0)
    assert "at 3 of 9 points" in summary(some).lines[0]
    early = wearing("axes.frequency=1", volume=lambda _: np.where(np.arange(21.0) > 5, np.nan, 1e-9))
    assert "worn_volume" not in summary(early.isel(cycle=[-1])).values.get("wear", {})
    two = ("axes.frequency=[1, 2]", "axes.scheme=adaptive")
    unknown = wearing(*two, volume=lambda p: 1e-9 * p[0], error_estimate=lambda p: 0.01 + p[0])
    assert "at 1 of 2 points" in summary(unknown).lines[0]
    dovetail = read_study("dovetail", ("axes.frequency=[1, 2, 3]", "axes.scheme=adaptive"))
    stuck = summary(result_of_study(dovetail).assign(stuck_frequency=212.6))
    assert "nothing wore: all pairs stick at all 3 points (first resonance 212.6 Hz" in dict(stuck.rows)["wear"]
    assert stuck.values["certainty"]["of"] == "response"


# --- the resonance and the life ---


def test_a_followed_resonance_that_turns_says_how_far_it_went():
    """Above both ends by more than its error, below them by less."""
    study = ("axes.frequency='resonance'", "loading.between=[180, 230]")
    hertz = np.full(21, 200.0)
    hertz[[5, 9, 20]] = 203.0, 199.9, 201.0
    made = wearing(*study, excitation_frequency=lambda _: hertz, excitation_frequency_error=lambda _: np.full(21, 0.25))
    row = dict(summary(made).rows)["resonance"]
    assert "moved from 200 to 201 ± 0.25 Hz, highest 203 Hz after 5000 cycles; response" in row
    assert "scene.worn" in row
    assert summary(made).values["response"]["between"] == [(203.0, 5000.0)]
    assert "highest" not in str(summary(made.drop_vars("excitation_frequency_error")))


def test_the_peak_of_the_new_joint_lies_between_others():
    for peak, expected in ((1, 211.25), (0, math.nan), (2, math.nan)):

        def response(point, peak=peak):
            return np.linspace([1.0], [2.0], 21) * 1e-3 / (1.0 + (point[0] - peak) ** 2)

        made = wearing(*GRID, volume=lambda p: 1e-9 * (p[0] == 2), response_amplitude=response)
        found = summary(made).values["response"]
        np.testing.assert_equal(found["peak"], expected)
        assert found["amplitude"][1] == pytest.approx(2.0 * found["amplitude"][0])


def test_where_a_followed_resonance_went():
    study = ("axes.frequency='resonance'", "loading.between=[180, 230]", "axes.wear_coefficient=[1e-12, 1e-11]")
    made = wearing(
        *study,
        "axes.scheme=adaptive",
        volume=lambda p: 1e-9 * p[1],
        excitation_frequency=lambda p: 200.0 - p[1] * np.arange(21.0),
        excitation_frequency_error=lambda _: np.full(21, 0.25),
    )
    followed = summary(made)
    assert followed.values["response"]["frequency"] == [200.0, 180.0]
    assert followed.values["response"]["frequency_error"] == 0.25
    assert any(label == "resonance" for label, _ in followed.rows)
    # the middle of its range is the frequency of nothing, and the scheme takes no step of `axes.step`
    facts = dict(page_facts(result_of(made)))
    assert (facts["frequency"], "step" in facts) == ("the resonance, followed", False)
    plan = plan_of(read_study("sdof_slider", (*study, "axes.scheme=adaptive")))
    assert all("Hz" not in task.describe(0) for task in (*plan.sweeps, *plan.results))
    told = 'axes.frequency = "resonance"'
    given = wearing("axes.frequency=150", response_amplitude=lambda _: np.ones((21, 1))).assign(stuck_frequency=25.0)
    assert [told in " ".join(str(summary(each)).split()) for each in (made, given)] == [False, True]


@pytest.mark.parametrize(("power", "word"), [(1e3, "below"), (8e3, "within"), (5e5, "beyond")])
def test_the_power_of_friction_stands_beside_that_of_the_tests(power, word):
    law = ("wear.law=power", "wear.adhesive=1e-13", "wear.decay=1e-5")
    made = wearing("axes.frequency=1", *law, friction_power=lambda _: np.full((21, 1), power))
    assert f" kW/m2, {word} the 2 to 430 " in " ".join(str(summary(made)).split())
    assert "power" not in summary(wearing("axes.frequency=1")).values


@pytest.mark.parametrize(("given", "is_said"), [((), False), (("solver.harmonics=5", "solver.samples=64"), True)])
def test_automatic_harmonics_are_advised_where_numbers_are_given(given, is_said):
    made = wearing("axes.frequency=1", *given, outcome=lambda _: Outcome.INACCURATE)
    assert ('"auto"' in str(summary(made))) is is_said


@pytest.mark.parametrize(("coefficient", "is_said"), [(1.1e-11, True), (4e-13, False)])
def test_a_coefficient_that_metals_do_not_have_is_said(coefficient, is_said):
    found = summary(wearing("axes.frequency=1", f"axes.wear_coefficient={coefficient}")).values
    assert ("coefficient" in found) is is_said


def test_the_shortest_life():
    lives = (400.0, 300.0, math.nan)
    made = wearing(
        "axes.frequency=[1, 2, 3]",
        "axes.scheme=adaptive",
        "slow_time.until={wear_depth=1e-5}",
        cycles_to_target=lambda p: lives[p[0]],
        cycles_to_target_error=lambda _: 3.0,
    )
    life = summary(made).values["life"]
    assert (life["target"], life["n_beyond"], life["point"]["frequency"]) == (1e-5, 1, 1)
    assert (life["count"], life["error"]) == (300.0, 3.0)
    assert "life" not in summary(wearing("axes.frequency=1")).values
    never = summary(made.assign(cycles_to_target=made["cycles_to_target"] * math.nan)).values["life"]
    assert math.isnan(never["count"])
    assert never["n_beyond"] == 3
    unsure = made.assign(cycles_to_target_error=1e9 + made["cycles_to_target"]).isel(frequency=[0])
    assert dict(summary(unsure).rows)["life"] == "the life of 1 point is not known"
    zero = 0.0 * made["cycles_to_target"]
    at_once = summary(made.assign(cycles_to_target=zero, cycles_to_target_error=zero))
    assert at_once.values["life"]["count"] == 0.0


# --- certainty and failures ---


def test_every_point_is_compared_with_its_own_rtol():
    study = ("axes.frequency=1", "axes.rtol=[1e-2, 1e-3]", "axes.scheme=adaptive")
    known = summary(wearing(*study, error_estimate=lambda _: 5e-3)).values["certainty"]
    assert (known["n_known"], known["n_less"], known["worst"]) == (1, 1, 5e-3)
    assert math.isnan(known["rtol"])
    assert known["where"] == "rtol 0.001"
    # no smaller rtol was tried
    assert known["advice"] == ""
    assert summary(wearing(*study, error_estimate=lambda _: 5e-4)).values["certainty"]["n_known"] == 2


@pytest.mark.parametrize(
    ("scheme", "error", "advice"),
    [("explicit", 0.1, 'scheme = "adaptive"'), ("explicit", math.inf, ""), ("adaptive", 0.1, "")],
)
def test_what_was_not_tried_is_not_advised(scheme, error, advice):
    """Given steps are compared with the adaptive history, whose error is part of theirs."""
    found = summary(wearing("axes.frequency=1", f"axes.scheme={scheme}", error_estimate=lambda _: error))
    assert found.values["certainty"]["advice"] == advice


@pytest.mark.parametrize(("error", "is_said"), [(math.inf, True), (0.6, False)])
def test_of_an_error_that_is_not_known_the_reason_is_said(error, is_said):
    """The volumes in the message of a point whose error is known are no results."""
    made = wearing(
        "axes.frequency=1", "axes.scheme=adaptive", outcome=lambda _: SENSITIVE, error_estimate=lambda _: error
    )
    made["message"][...] = "the reference solution ends"
    (uncertain,) = (text for label, text in summary(made).rows if label == "uncertain")
    assert ("reference solution ends" in uncertain) is is_said
    assert "inf" not in str(summary(made))


def test_points_that_failed_or_were_never_estimated_are_not_known():
    outcomes, errors = {(0, 0): FAILED, (0, 1): INACCURATE, (0, 2): SENSITIVE}, {(0, 0): 9.0, (0, 1): 0.03, (0, 2): 1.2}
    made = wearing(
        *GRID,
        outcome=lambda p: outcomes.get(at(p), 0),
        error_estimate=lambda p: errors.get(at(p), (math.nan, math.inf, 0.001)[p[4]] if p[0] == 1 else 0.001),
    )
    found = summary(made)
    known = found.values["certainty"]
    assert [known[name] for name in ("n_known", "n_less", "n_unknown", "worst")] == [4, 2, 2, math.inf]
    # no setting is known to make an error known
    assert known["advice"] == ""
    failures = [each for each in found.findings if each.label in ("failed", "uncertain")]
    assert [each.name for each in failures] == ["march_failed", "inaccurate", "others"]


def test_points_that_a_run_has_not_come_to_have_not_failed():
    outcomes = {(1, 0): int(Outcome.NOT_COMPUTED), (2, 0): int(Outcome.NOT_COMPUTED), (2, 1): FAILED}
    rows = summary(wearing(*GRID, outcome=lambda p: outcomes.get(at(p), 0))).rows
    (left,) = (text for label, text in rows if label == "to do")
    assert left == "2 of 9 points: The run ended before this point was computed. The same command continues"
    assert [text[:11] for label, text in rows if label == "failed"] == ["1 of 9 poin"]


def test_the_summary_is_short_whatever_came_out():
    outcomes = [int(each) for each in Outcome]
    made = wearing(
        *GRID,
        "slow_time.until={wear_depth=1e-5}",
        outcome=lambda p: outcomes[(3 * p[0] + p[4]) * 2],
        largest_wear_depth=lambda _: 1.0,
        error_estimate=lambda _: 0.3,
        facts=BY_SIX,
    )
    found = summary(made)
    more = (*(Finding("mode", "mode", "more") for _ in range(9)), *found.findings)
    for each in (found, replace(found, findings=more)):
        assert len(each.rows) <= MOST_ROWS
        assert MOST_COLUMNS / 2 < max(map(len, each.lines)) <= MOST_COLUMNS
        assert all(line.isprintable() and line.isascii() for line in each.lines)
        assert each.rows[-1][0] == "certainty"


def test_a_summary_read_some_points_at_a_time_is_the_same(monkeypatch):
    made = wearing(*GRID, volume=lambda p: 1e-9 * (3 * p[0] + p[4]), slip_range=lambda p: np.full((21, 2), 1e-6 * p[0]))
    whole = summary(made)
    for n_values in (1, 7, 50, 100):
        monkeypatch.setattr("studyrunner.result.view._AT_ONCE", n_values)
        assert str(summary(made)) == str(whole)


# --- meshes ---

MESHES = ("axes.frequency='resonance'", "loading.between=[205, 216]", "axes.scheme=adaptive")


def meshed(volumes, *overrides):
    """The comparison of meshes; volumes: by mesh and wear coefficient, mm3."""
    given = (*(overrides or MESHES), f"axes.mesh={list(volumes)}", "axes.wear_coefficient=[1e-12, 1e-11]")
    study = read_study("dovetail", given)
    mesh, wear = (list(study.dimensions).index(name) for name in ("mesh", "wear_coefficient"))
    share = np.linspace(0.0, 1.0, len(study.output_counts))
    worn = list(volumes.values())
    return compare_meshes(
        result_of(result_of_study(study, worn_volume=lambda p: 1e-9 * worn[p[mesh]][p[wear]] * share))
    )


def test_meshes_are_compared_at_the_resonance_alone():
    found = meshed({2: [2.0, 1.0], 3: [1.0, 1.1]})
    assert found.values["meshes"] == [2.0, 3.0]
    assert found.values["median"] == pytest.approx((0.5 + 0.1 / 1.1) / 2.0)
    assert found.values["largest"] == pytest.approx(0.5)
    assert meshed({2: [0.0, 0.0], 3: [0.0, 0.0]}) is None
    # at one frequency they would be at two distances to the resonance
    assert meshed({2: [2.0, 1.0], 3: [1.0, 1.1]}, "axes.frequency=211.5", "axes.scheme=adaptive") is None
    assert compare_meshes(result_of(wearing("axes.frequency=1"))) is None


def test_the_observed_order_is_that_of_the_values():
    """Richardson's extrapolation of v + c h^p is exact, with any ratios; what oscillates has no order."""
    sizes = np.array([1.0, 0.6, 0.25])
    for order in (0.7, 1.0, 2.0, 3.1):
        found = converge(sizes, 2.0 - 0.3 * sizes**order)
        assert found.order == pytest.approx(order, rel=1e-9)
        assert found.limit == pytest.approx(2.0, rel=1e-9)
        true = 0.3 * sizes[2] ** order / (2.0 - 0.3 * sizes[2] ** order)
        assert found.u_mesh == pytest.approx(1.25 / 1.15 * true, rel=1e-8)
    for values in ([1.0, 1.2, 1.1], [1.0, 1.1, 1.3], [1.0, 1.0, 1.0], [1.0, np.nan, 1.2], [1.0, 2.0, 2.0 + 1e-9]):
        assert converge(sizes, np.array(values)).u_mesh == float("inf")


def test_of_three_meshes_the_uncertainty_is_told():
    found = meshed({2: [1.0, 1.0], 4: [1.3, 1.2], 8: [1.4, 1.1]})
    assert found.values["order"] == pytest.approx(np.log2(3.0))
    assert found.values["u_mesh"] == float("inf")
    assert "u_mesh 3.9 % by the observed order 1.6, 1 point without an order" in found.text
    assert "no order of convergence" in meshed({2: [1.0, 1.0], 3: [1.2, 1.2], 4: [1.1, 1.1]}).text


# --- values that are hardly what was meant ---


@pytest.mark.parametrize(
    ("depth", "motion", "outcome", "n_doubts"),
    [(SMALL * 0.01, 10.0, 0, 0), (0.014, 10.0, 0, 1), (4e13, 1e8, 0, 2), (4e13, 1e8, FAILED, 2)],
)
def test_depths_and_motions_that_no_model_has_are_asked_about(depth, motion, outcome, n_doubts):
    """One pair on each surface: the side of the smaller one is 0.01 m."""
    made = wearing(
        *GRID,
        largest_wear_depth=lambda p: depth if p[0] == 1 else 1e-6,
        response_amplitude=lambda p: np.full((21, 1), motion if p[0] == 1 else 1e-3),
        outcome=lambda _: outcome,
    )
    doubts = [text for label, text in summary(made).rows if label == "beware"]
    assert len(doubts) == n_doubts
    assert all("211.25 Hz" in doubt for doubt in doubts)


# --- errors in percent ---


@pytest.mark.parametrize(
    ("error", "rtol", "text"),
    [
        (0.026, 0.01, "2.6 %"),
        (0.0099999, 0.01, "1 %"),
        (0.0100001, 0.01, "1.00001 %"),
        (0.01163, 0.01165, "1.16 %"),
        (0.29, 0.29, "29 %"),
        (12.3, 0.01, "1e+03 %"),
    ],
)
def test_an_error_is_shown_on_its_side_of_rtol(error, rtol, text):
    assert show_percent(error, rtol) == text
    if error < 1.0:
        assert (float(text.removesuffix(" %")) <= float(f"{100.0 * rtol:.6g}")) == (error <= rtol)
