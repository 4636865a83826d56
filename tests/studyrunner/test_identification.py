"""Inputs that are identified by measurements: closed forms, synthetic twins, and what is refused."""

import tomllib

import numpy as np
import pytest
import xarray as xr
from scipy.stats import norm, qmc

from studyrunner import read_study
from studyrunner.measured import MeasuredSection, read_columns
from studyrunner.report.contents import draw_report
from studyrunner.report.drawing import Drawing
from studyrunner.result.opening import as_history
from studyrunner.result.view import Result
from studyrunner.statistics.identification import TooFewSamplesError, identify, weigh_samples, weighted_quantiles
from studyrunner.summary.answer import summary
from studyrunner.user_error import UserError
from tests.studyrunner.fakes import FACTS
from tests.studyrunner.results import result_of_study

COUNTS = np.linspace(0.0, 1e5, 51)
MEAN, STD = 2e-14, 4e-15  # prior of the wear coefficient, 1/Pa


def measure(**given):
    return MeasuredSection.model_validate(given, strict=False)


def result(volume, drawn, study=""):
    """A result of samples (n,) with worn volumes (n, n_counts), m3."""
    n = len(volume)
    coords = {f"sample_{name}": ("sample", values, {"units": "1"}) for name, values in drawn.items()}
    dims = ("scheme", "sample", "cycle")
    return xr.Dataset(
        {
            "worn_volume": (dims, volume[None]),
            "worn_volume_error": (dims, np.zeros((1, *volume.shape))),
            "outcome": (dims[:2], np.zeros((1, n), dtype=np.int8)),
        },
        {"cycle": COUNTS, "sample": np.arange(n), "scheme": ["adaptive"], **coords},
        {"study": study},
    )


def draws(n, dimensions):
    return norm.ppf(qmc.Sobol(dimensions, rng=1).random(n))


def test_a_linear_gaussian_problem_has_its_closed_form():
    """Worn volume x N of a normal x: the posterior of x is normal, with the sum of the precisions."""
    x = 3e-18 * (1.0 + 0.2 * draws(4096, 1)[:, 0])
    at, deviation = np.array([2e4, 5e4, 9e4]), 4e-14
    value = 3.4e-18 * at + np.array([1e-14, -2e-14, 0.5e-14])
    found = identify(
        result(x[:, None] * COUNTS, {"slope": x}),
        measure(worn_volume={"at": at, "value": value, "standard_deviation": deviation}),
    )
    precision = 1.0 / (0.2 * 3e-18) ** 2 + (at**2).sum() / deviation**2
    mean = (3e-18 / (0.2 * 3e-18) ** 2 + at @ value / deviation**2) / precision
    expected = norm.ppf([0.05, 0.5, 0.95], mean, precision**-0.5)
    assert found.posterior_quantile.values[0] == pytest.approx(expected, rel=3e-3)
    assert found.prior_quantile.values[0] == pytest.approx(norm.ppf([0.05, 0.5, 0.95], 3e-18, 0.6e-18), rel=3e-3)
    assert found.posterior_volume.values[-1] == pytest.approx(1e5 * expected, rel=3e-3)
    section = measure(worn_volume={"at": at, "value": value, "standard_deviation": deviation})
    (band,) = weigh_samples(result(x[:, None] * COUNTS, {"slope": x}), section).bands(np.array([0.05, 0.5, 0.95]))
    assert band == pytest.approx(found.posterior_volume.values)
    least = np.sqrt(np.min(((x[:, None] * at - value) ** 2).sum(axis=1)) / 3.0) / deviation
    assert float(found.misfit) == pytest.approx(least)


def curved(coefficient, friction, counts):
    """Worn volume of a joint, m3, which depends on coefficient times cycles alone."""
    way = coefficient[:, None] * counts
    return 1e-3 * way * friction[:, None] / (1.0 + 4e8 * way * friction[:, None] ** 3)


def twin():
    drawn = draws(128, 2)
    own = {"wear_coefficient": MEAN + STD * drawn[:, 0], "friction_coefficient": 0.5 + 0.05 * drawn[:, 1]}
    return result(curved(*own.values(), COUNTS), own), own


def test_each_history_stands_for_every_wear_coefficient():
    """The posterior of 128 histories is that of 10^5 own ones: the slow twin, without the scaling of the counts."""
    found_in, _ = twin()
    at, deviation = np.array([1e4, 3e4, 6e4]), 3e-14
    value = curved(np.array([2.2e-14]), np.array([0.52]), at)[0]
    measured = measure(worn_volume={"at": at, "value": value, "standard_deviation": deviation})
    drawn = draws(2**17, 2)
    coefficient, friction = MEAN + STD * drawn[:, 0], 0.5 + 0.05 * drawn[:, 1]
    square = ((curved(coefficient, friction, at) - value) ** 2).sum(axis=1) / deviation**2
    quantile, weight = np.array([0.05, 0.5, 0.95]), np.exp(-0.5 * square)
    found = identify(found_in, measured)
    for name, values in (("wear_coefficient", coefficient), ("friction_coefficient", friction)):
        expected = weighted_quantiles(values, weight, quantile)
        width = expected[2] - expected[0]
        assert found.posterior_quantile.sel(input=name).values == pytest.approx(expected, abs=0.05 * width)
    volumes = curved(coefficient, friction, np.array([8e4]))[:, 0]
    expected = weighted_quantiles(volumes, weight, quantile)
    assert found.posterior_volume.sel(cycle=8e4).values == pytest.approx(expected, rel=3e-3)
    assert float(found.n_effective) > 20.0


@pytest.mark.slow
def test_true_inputs_lie_within_their_intervals_as_often_as_said():
    found_in, own = twin()
    rng, at, inside = np.random.default_rng(3), np.array([1e4, 3e4, 6e4, 9e4]), []
    for _ in range(100):
        truth = {"wear_coefficient": rng.normal(MEAN, STD), "friction_coefficient": rng.normal(0.5, 0.05)}
        exact = curved(*(np.array([each]) for each in truth.values()), at)[0]
        value = exact + rng.normal(0.0, 6e-14, len(at))
        try:
            found = identify(found_in, measure(worn_volume={"at": at, "value": value, "standard_deviation": 6e-14}))
        except TooFewSamplesError:
            continue
        ends = found.posterior_quantile.sel(input=[*own]).values[:, [0, 2]]
        inside.append([low <= each <= high for (low, high), each in zip(ends, truth.values(), strict=True)])
    assert len(inside) > 60
    assert (np.mean(inside, axis=0) > 0.82).all()
    # intervals that are no wider than they have to be
    assert (np.mean(inside, axis=0) < 0.98).all()


def test_too_few_samples_are_refused_with_the_range_of_the_next_round():
    found_in, _ = twin()
    found_in = found_in.assign_attrs(study='[wear]\nlaw = "power"')
    value = curved(np.array([2.2e-14]), np.array([0.52]), np.array([5e4]))[0]
    measured = measure(worn_volume={"at": [5e4], "value": value, "standard_deviation": 1e-15})
    with pytest.raises(TooFewSamplesError, match=r"effective samples.*friction_coefficient = \{uniform = \{low = 0\."):
        identify(found_in, measured)


def test_of_a_saltelli_design_the_independent_rows_count():
    found_in, _ = twin()
    text = (
        '[scatter]\nsamples = 32\nmethod = "saltelli"\nwear_coefficient = {normal = {std = 1e-15}}\n'
        "friction_coefficient = {normal = {std = 0.05}}"
    )
    at = np.array([5e4])
    value = curved(np.array([MEAN]), np.array([0.5]), at)[0]
    measured = measure(worn_volume={"at": at, "value": value, "standard_deviation": 1e-13})
    found = identify(found_in.assign_attrs(study=text), measured)
    kept = np.arange(128)[np.arange(128) % 4 < 2]
    np.testing.assert_array_equal(found.sample, kept)
    alone = identify(found_in.isel(sample=kept), measured)
    assert found.posterior_quantile.values == pytest.approx(alone.posterior_quantile.values)


def test_what_the_result_does_not_hold_is_said():
    found_in, _ = twin()
    for given, words in (
        ({"worn_volume": {"at": [2e5], "value": [1e-12], "standard_deviation": 1e-14}}, "raise slow_time.cycles"),
        ({"damping_ratio": {"at": [2e4], "value": [1e-3], "standard_deviation": 1e-4}}, "holds no damping_ratio"),
        ({}, "Nothing was measured"),
    ):
        with pytest.raises(ValueError, match=words):
            identify(found_in, measure(**given))
    with pytest.raises(ValueError, match="no samples"):
        identify(found_in.isel(sample=0), measure())


def test_an_error_of_the_computation_widens_the_interval():
    found_in, _ = twin()
    at = np.array([5e4])
    measured = measure(
        worn_volume={"at": at, "value": curved(np.array([MEAN]), np.array([0.5]), at)[0], "standard_deviation": 1e-14}
    )
    widths = []
    for error in (0.0, 0.2):
        known = found_in.assign(worn_volume_error=xr.full_like(found_in["worn_volume"], error))
        ends = identify(known, measured).posterior_quantile.sel(input="wear_coefficient").values
        widths.append(ends[2] - ends[0])
    assert widths[1] > 1.3 * widths[0]


def test_an_error_that_is_not_known_is_not_none():
    """Of a response, whose error has a name of its own; without any error nothing is compared."""
    found_in, own = twin()
    tip = xr.DataArray(1e-3 * (1.0 + own["friction_coefficient"]), dims="sample") + 0.0 * found_in["worn_volume"]
    found_in = found_in.assign(response_amplitude=tip)
    value = {"over": "cycle", "at": [5e4], "value": [1.5e-3], "standard_deviation": 2e-5}
    measured = measure(response_amplitude=value)
    with pytest.raises(ValueError, match="holds no response_error"):
        identify(found_in, measured)
    widths = []
    for error in (0.0, 0.05):
        known = found_in.assign(response_error=xr.full_like(tip, error))
        ends = identify(known, measured).posterior_quantile.sel(input="friction_coefficient").values
        widths.append(ends[2] - ends[0])
    assert widths[1] > 1.5 * widths[0]
    with pytest.raises(TooFewSamplesError, match="No sample holds"):
        identify(found_in.assign(response_error=xr.full_like(tip, np.nan)), measured)


def test_a_profile_is_compared_along_x():
    """Pairs on one side of a symmetric scar; two rows of pairs count as one."""
    x, n = np.array([1.0, 1.0, 2.0, 2.0, 3.0, 3.0]) * 1e-4, 256
    scale = 1e-5 * (1.0 + 0.2 * draws(n, 1)[:, 0])
    depth = scale[:, None, None] * (COUNTS[:, None] / 1e5) * (1.0 - (x / 4e-4) ** 2)
    found_in = xr.Dataset(
        {
            "wear_depth": (("sample", "cycle", "contact"), depth),
            "wear_depth_error": (("sample", "cycle", "contact"), 0.0 * depth),
        },
        {"cycle": COUNTS, "contact_x": ("contact", x), "sample_depth": ("sample", scale, {"units": "m"})},
        {"contact_mirrored": "x"},
    )
    at = np.array([-3e-4, -2e-4, -1e-4, 1e-4, 3e-4])
    value = 1.1e-5 * (1.0 - (at / 4e-4) ** 2)
    measured = measure(profile={"over": "x", "at": at, "value": value, "standard_deviation": 1e-6})
    found = identify(found_in, measured)
    assert found.posterior_quantile.values[0, 1] == pytest.approx(1.1e-5, rel=0.03)
    assert "posterior_volume" not in found
    # samples whose pairs stand elsewhere, as where the size of a contact scatters
    own = found_in["contact_x"].values * np.linspace(0.9, 1.1, n)[:, None]
    moved = scale[:, None, None] * (COUNTS[:, None] / 1e5) * (1.0 - (own[:, None] / 4e-4) ** 2)
    moved = found_in.assign(wear_depth=(("sample", "cycle", "contact"), moved))
    elsewhere = identify(moved.assign_coords(contact_x=(("sample", "contact"), own)), measured)
    assert elsewhere.posterior_quantile.values == pytest.approx(found.posterior_quantile.values, rel=0.03)
    # the band of the figure
    (band,) = weigh_samples(found_in, measured).bands(found["quantile"].values)
    assert band == pytest.approx(np.outer(value / 1.1e-5, found.posterior_quantile.values[0]))


# --- the end of a run, and the page ---


def made(**given):
    """A result of a slider that wears in proportion to the cycles, 1 mm3 in the end; samples scatter by a tenth."""
    value = {"at": [1e4, 2e4], "value": [0.5e-9, 1.1e-9], "standard_deviation": 5e-11}
    study = read_study("sdof_slider", {"axes.scheme": "adaptive", "measured.worn_volume": value, **given})
    share = 1e-9 * np.linspace(0.0, 1.0, len(study.output_counts))
    if study.scatter is None:
        return result_of_study(study, FACTS, worn_volume=lambda _: share)
    size, place = 1.0 + 0.1 * norm.ppf((np.arange(64) + 0.5) / 64), list(study.dimensions).index("sample")
    found = result_of_study(study, FACTS, worn_volume=lambda p: size[p[place]] * share)
    return found.assign_coords(sample_friction_coefficient=("sample", 0.5 * size, {"units": "1"}))


def test_the_end_of_a_run_says_how_far_computed_values_are_off():
    found = summary(made()).values["measured"]
    np.testing.assert_allclose(found["computed"], [0.5e-9, 1e-9])
    (text,) = [text for label, text in summary(made()).rows if label == "measured"]
    assert "E = -9.09 % at cycle 20000, 2 times its standard uncertainty" in text
    assert "the largest of 2" in text


def test_the_end_of_a_run_says_what_was_identified_or_why_nothing_was():
    scatter = {"samples": 64, "friction_coefficient": {"normal": {"std": 0.05}}}
    text = dict(summary(made(scatter=scatter)).rows)["identified"]
    assert "friction coefficient 0." in text
    assert "effective samples" in text
    precise = {"at": [2e4], "value": [1.1e-9], "standard_deviation": 1e-13}
    text = dict(summary(made(scatter=scatter, **{"measured.worn_volume": precise})).rows)["identified"]
    assert "draw more, or next from friction_coefficient = {uniform" in text


@pytest.mark.parametrize("scatter", [None, {"samples": 64, "friction_coefficient": {"normal": {"std": 0.05}}}])
def test_the_page_shows_both(scatter):
    shown = Result("made.nc", as_history(made(**({"scatter": scatter} if scatter else {})))[0])
    drawn = {item.name: item for item in draw_report(shown) if isinstance(item, Drawing)}
    assert ("identified" in drawn) == (scatter is not None)
    _, labels = drawn["measured"].figure.axes[0].get_legend_handles_labels()
    bands = ["drawn", "with what was measured"] if scatter else ["computed"]
    assert labels == [*bands, "measured"]


# --- files ---


def test_columns_have_names_and_units(tmp_path):
    path = tmp_path / "worn.csv"
    path.write_text("worn volume (mm3),cycles,standard deviation (mm3)\n2.0,1e4,0.1\n1.0,5e3,0.1\n", encoding="utf-8")
    found = read_columns(path, "worn_volume")
    assert found == {
        "over": "cycle",
        "at": [5e3, 1e4],
        "value": pytest.approx([1e-9, 2e-9]),
        "standard_deviation": pytest.approx([1e-10, 1e-10]),
    }
    path.write_text("modal_amplitude_m_sqrtkg,damping_ratio_percent\n1e-4,0.2\n", encoding="utf-8")
    assert read_columns(path, "damping_ratio")["value"] == pytest.approx([2e-3])


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ("x_mm,depth_um\n0,1\n1,2\n", "", "at least 5"),
        ("x_mm,depth_um\n0,-1\n1,-2\n2,-3\n3,-1\n4,-1\n", "", "turn the sign"),
        ("x_inch,depth_um\n0,1\n", "", "line 1"),
        ("x_mm,depth_um\n0,1\n1,nan\n", "", "row 3"),
        ("x_mm,depth_um\n0,1\n1,2\n2,3\n3,1\n4,1\n", "no deviation", "standard_deviation"),
        (None, "", "is not there"),
    ],
)
def test_a_wrong_file_gets_one_line(tmp_path, text, key, words):
    study = tmp_path / "study.toml"
    if text is not None:
        (tmp_path / "scar.csv").write_text(text, encoding="utf-8")
    deviation = "" if key else ", standard_deviation = 1e-6"
    study.write_text(
        f'[study]\nname = "a"\n[scene]\nmodel = "sdof_slider"\n[axes]\nfrequency = 160\nexcitation_amplitude = 10\n'
        f'wear_coefficient = 1e-11\n[measured]\nprofile = {{file = "scar.csv"{deviation}}}\n'
    )
    with pytest.raises(UserError, match=words) as error:
        read_study(study)
    assert str(error.value).count("\n") == 0


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"worn_volume": {"at": [1e9], "value": [1e-9], "standard_deviation": 1e-10}}, "raise slow_time.cycles"),
        ({"damping_ratio": {"at": [0.0], "value": [1e-3], "standard_deviation": 1e-4}}, "do not compute it"),
        ({"worn_volume": {"over": "x", "at": [1e-3], "value": [1e-9], "standard_deviation": 1e-10}}, "give cycle"),
        ({"worn_volumes": {}}, "give worn_volume"),
    ],
)
def test_what_the_study_does_not_compute_is_refused_before_it_runs(given, words):
    with pytest.raises(UserError, match=words):
        read_study("sdof_slider", {f"measured.{name}": each for name, each in given.items()})


def test_what_was_measured_is_among_the_variables():
    at = np.linspace(-1e-4, 1e-4, 5).tolist()
    profile = {"over": "x", "at": at, "value": [1e-6] * 5, "standard_deviation": 1e-7}
    scatter = {"samples": 8, "friction_coefficient": {"normal": {"std": 0.03}}}
    study = read_study("sdof_slider", {"measured.profile": profile, "scatter": scatter})
    assert {"wear_depth", "wear_depth_error"} <= {*study.outputs.variables}


def test_the_result_keeps_what_was_measured(tmp_path):
    (tmp_path / "worn.csv").write_text("cycle,worn_volume_mm3\n1e4,1.0\n", encoding="utf-8")
    given = {"measured.worn_volume": {"file": str(tmp_path / "worn.csv"), "standard_deviation": 1e-10}}
    study = read_study("sdof_slider", given)
    assert study.measured.worn_volume[0].value == pytest.approx((1e-9,))
    from studyrunner.study.study_file import format_study

    again = tomllib.loads(format_study(study))["measured"]
    assert measure(**again) == study.measured
