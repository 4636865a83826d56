"""What samples say: estimates against closed forms, then of a result, labelled, with bands, and in sentences."""

import re

import numpy as np
import pytest
from scipy.special import ndtri
from scipy.stats import binomtest, norm, spearmanr
from scipy.stats import t as student

from solver.outcome import Outcome
from studyrunner.scatter import ScatterSection, unit_design
from studyrunner.statistics.samples import (
    FEWEST,
    SampleValues,
    deciding_pair,
    exceedance,
    quantiles,
    rank_correlations,
    saltelli_indices,
    two_groups,
    within,
)
from studyrunner.statistics.sentences import describe_limit, describe_ranking, describe_volumes, what_samples_tell
from studyrunner.statistics.study_statistics import worn_volume_statistics
from tests.studyrunner.results import SCATTER, fail, sample_file

# Archard: V = k_w P s N, with lognormal k_w, P, s
LOGARITHMS = np.log([1.5, 1.2, 1.1])
MEDIAN = 2e-9
FACTORS = np.exp(LOGARITHMS**2)
FIRST = (FACTORS - 1.0) / (FACTORS.prod() - 1.0)
TOTAL = FIRST * FACTORS.prod() / FACTORS
PROBABILITIES = (0.05, 0.5, 0.95)


def archard(unit):
    return np.asarray(MEDIAN * np.exp(ndtri(unit) @ LOGARITHMS))


def ishigami(unit):
    x = np.pi * (2.0 * unit.T - 1.0)
    return np.asarray(np.sin(x[0]) + 7.0 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0]))


def ishigami_indices():
    alone = np.array([0.5 * (1 + 0.1 * np.pi**4 / 5) ** 2, 49 / 8, 0.0])
    together = 0.01 * np.pi**8 * (1 / 18 - 1 / 50)
    return alone / (alone.sum() + together), (alone + [together, 0.0, together]) / (alone.sum() + together)


def known(values, error=0.0):
    return SampleValues(values, values, np.abs(values) * error)


def without(values, missing, low):
    """Samples of which some have a lower bound alone."""
    lost = np.isin(np.arange(values.shape[-1]), missing)
    return SampleValues(np.where(lost, low, values), np.where(lost, np.inf, values), np.zeros(values.shape))


def contains(outer, inner):
    """Of ends (..., 2)."""
    return bool((outer[..., 0] <= inner[..., 0] + 1e-12).all() and (outer[..., 1] >= inner[..., 1] - 1e-12).all())


def inside(exact, interval):
    return (interval[..., 0] <= exact) & (exact <= interval[..., 1])


# --- quantiles and probabilities ---


def test_quantiles_of_a_lognormal_product():
    values = known(archard(unit_design("sobol", 1, 4096, 3)))
    spread = np.sqrt((LOGARITHMS**2).sum())
    (ends, interval), exact = quantiles(values, PROBABILITIES, 0.95), MEDIAN * np.exp(spread * ndtri(PROBABILITIES))
    np.testing.assert_allclose(ends, np.stack([exact] * 2, axis=-1), rtol=0.01)
    assert inside(exact, interval).all()
    above, _ = exceedance(values, np.array([MEDIAN, 2.0 * MEDIAN]), 0.95)
    np.testing.assert_allclose(above[:, 0], norm.sf(np.log([1.0, 2.0]) / spread), atol=0.003)


def test_intervals_hold_the_truth_as_often_as_they_say():
    """Quantiles of 2000 draws of 128 from a distribution with heavy tails, probabilities of 2000 draws of 20."""
    values, probabilities = known(np.random.default_rng(1).standard_t(2, (2000, 128))), (0.05, 0.5, 0.9)
    _, interval = quantiles(values, probabilities, 0.95)
    covered = inside(student.ppf(probabilities, 2), interval).mean(axis=0)
    assert ((covered >= 0.94) & (covered <= 0.985)).all()
    values = known(np.random.default_rng(1).normal(size=(2000, 20)))
    assert inside(norm.sf(1.0), exceedance(values, np.array([1.0]), 0.9)[1]).mean() >= 0.9
    _, extremes = exceedance(values, np.array([-9.0, 9.0]), 0.9)
    tail = 0.05 ** (1 / 20)
    np.testing.assert_allclose([extremes[0, 0, 0], extremes[0, 1, 1]], [tail, 1.0 - tail])
    # with too few samples an end is open
    ends, interval = quantiles(known(np.arange(10.0)), [0.99], 0.95)
    assert (ends[0, 0], interval[0, 1]) == (9.0, np.inf)


def test_the_probability_of_a_limit_has_the_samples_on_no_known_side_on_both():
    value = np.arange(1.0, 11.0)
    # 5 and 6 lie within their errors of the limit, one ended below it, one above
    values = SampleValues(value, np.where(np.isin(value, [2.0, 9.0]), np.inf, value), np.where(value < 7, 0.6, 0.1))
    band, interval, n_unknown = within(values, 5.5, 0.95)
    np.testing.assert_allclose(band, [0.3, 0.6])
    ends = [binomtest(k, 10).proportion_ci(0.95, "exact") for k in (3, 6)]
    np.testing.assert_allclose(interval, [ends[0].low, ends[1].high])
    assert n_unknown == 3
    _, interval, n_unknown = within(known(value, np.inf), 5.5, 0.95)
    assert (interval.tolist(), n_unknown) == ([0.0, 1.0], 10), "without a known error nothing is known"


@pytest.mark.parametrize(
    ("method", "n", "says"),
    [
        (
            "sobol",
            8,
            "no ranking of inputs (from 10 on), no quantiles of 5 and 95 % (from 72 on); .* 34 %, with 64 to ± 13 %",
        ),
        ("random", 128, "128 by random: ranking of inputs, quantiles of 5 and 95 %; .* 9 %, with 1024"),
        ("saltelli", 32, "32 by saltelli: ranking of inputs, no quantiles of 5 and 95 % (from 36 on); .* 13 %"),
    ],
)
def test_what_samples_can_answer_is_known_before_they_are_computed(method, n, says):
    section = ScatterSection.model_validate({"samples": n, "method": method, "mass": {"normal": {"std": 1.0}}})
    assert re.search(says.replace("(", r"\(").replace(")", r"\)"), what_samples_tell(section))


def test_bands_hold_what_the_missing_samples_would_have_said():
    design = unit_design("sobol", 1, 128, 3)
    full = archard(design)
    rng, grid = np.random.default_rng(1), np.quantile(full, [0.1, 0.5, 0.99])
    for _ in range(20):
        part, whole = without(full, rng.choice(128, 9, replace=False), full * rng.random(128)), known(full)
        for function, at in ((quantiles, PROBABILITIES), (exceedance, grid)):
            for outer, inner in zip(function(part, at, 0.95), function(whole, at, 0.95), strict=True):
                assert contains(outer, inner)
    whole, _ = rank_correlations(design, known(full), 0.95)
    part, _ = rank_correlations(design, without(full, np.arange(3, 128, 20), 0.5 * full), 0.95)
    assert contains(part, whole)
    assert (np.diff(part) > 0.0).any()


# --- what decides ---


@pytest.mark.parametrize(
    ("model", "first", "total"), [(archard, FIRST, TOTAL), (ishigami, *ishigami_indices())], ids=["archard", "ishigami"]
)
def test_indices_of_a_saltelli_design(model, first, total):
    design = unit_design("saltelli", 2, 1024, 3)
    (ends, interval), exact = saltelli_indices(design, known(model(design)), 0.95), np.append(first, total)
    np.testing.assert_allclose(ends, np.stack([exact] * 2, axis=-1), atol=0.06)
    assert inside(exact, interval + [-0.01, 0.01]).all()


def test_correlations_are_those_of_scipy():
    design = unit_design("random", 2, 40, 3)
    values = archard(design)
    ends, _ = rank_correlations(design, known(np.stack([values, np.ones(40)])), 0.95)
    np.testing.assert_allclose(ends[0, :, 0], [spearmanr(column, values).statistic for column in design.T])
    assert np.isnan(ends[1]).all()
    design[:, 1] = 0.5
    ends, _ = rank_correlations(design, known(archard(design)), 0.95)
    assert ends[1, 0] == 0.0, "an input without width decides nothing"


@pytest.mark.parametrize("n", [FEWEST, 40])
@pytest.mark.parametrize("noise", [0.3, 3.0])
def test_the_interval_of_a_correlation_covers_it_as_often_as_it_says(n, noise):
    """Of normal numbers, whose rank correlation is 6 / pi asin(r / 2)."""
    rng = np.random.default_rng(1)
    x = rng.normal(size=(500, n))
    y = x + noise * rng.normal(size=x.shape)
    exact = 6.0 / np.pi * np.arcsin(0.5 / np.sqrt(1.0 + noise**2))
    found = [rank_correlations(one[:, None], known(other), 0.95)[1] for one, other in zip(x, y, strict=True)]
    assert inside(exact, np.array(found)).mean() > 0.93


# --- two groups ---


@pytest.mark.parametrize("name", ["normal", "lognormal", "uniform"])
def test_one_hill_is_not_taken_for_two(name):
    rng = np.random.default_rng(1)
    drawn = {"normal": rng.normal, "lognormal": rng.lognormal, "uniform": rng.uniform}[name](size=(1000, 128))
    assert sum(two_groups(known(each)) is not None for each in drawn) < 10


def test_the_jump_of_the_dovetail_is_found():
    """211.5 Hz, excitation 0.5 N +- 1 %: volumes of the study, mm3, with a jump between 0.495 and 0.4975 N."""
    force = 0.5 + 0.005 * ndtri(unit_design("sobol", 1, 128, 1)[:, 0])
    below = np.interp(force, [0.49, 0.495], [1.542, 1.621])
    volume = np.where(force < 0.496, below, np.interp(force, [0.4975, 0.51], [2.251, 2.257]))
    groups = two_groups(known(volume, error=0.007))
    assert groups.sizes == (np.count_nonzero(force < 0.496), np.count_nonzero(force >= 0.496))
    assert groups.lower_end < 1.65
    assert groups.upper_end == 2.251
    assert two_groups(known(volume, error=0.2)) is None  # the gap is not longer than the errors beside it


def test_samples_without_a_value_are_placed_where_their_bounds_say():
    values = np.r_[np.linspace(1.5, 1.6, 60), np.linspace(2.2, 2.3, 60)]
    assert two_groups(without(values, [3, 100], np.where(np.arange(120) == 100, 2.0, 1.0))).sizes == (59, 60)
    # one that may lie on either side is in no group; one that is known better closes the gap
    values = np.r_[np.linspace(1.5, 1.6, 20), 1.9, np.linspace(2.2, 2.3, 20)]
    for error, sizes in ((0.41, (20, 20)), (0.39, None)):  # of a range of 0.8
        errors = np.where(np.arange(41) == 20, error, 0.01)
        groups = two_groups(SampleValues(values, values, errors))
        assert (groups and groups.sizes) == sizes


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_pair_whose_depth_separates_both_groups_decides(sign):
    rng = np.random.default_rng(1)
    groups = two_groups(known(np.r_[rng.normal(1.55, 0.03, 40), rng.normal(2.25, 0.01, 40)]))
    depths = rng.normal(5e-6, 1e-7, (80, 4))
    depths[:, 1] += 3e-7 * groups.is_upper  # overlaps
    depths[:, 2] += sign * 2e-6 * groups.is_upper
    assert deciding_pair(depths, groups) == 2
    assert deciding_pair(depths[:, :2], groups) is None


# --- of a result ---


def said(found):
    """What the samples say of the first frequency at the last count."""
    point = found.isel(cycle=-1, frequency=0, missing_dims="ignore")
    return f"{describe_volumes(point)}; {describe_ranking(point)}"


def test_every_statistic_is_labelled_and_stands_over_the_other_dimensions():
    dataset = sample_file()
    found = worn_volume_statistics(dataset, exceed=[1e-10, 2e-10], depth=1e-6)
    assert found["worn_volume_quantile"].dims == ("frequency", "cycle", "quantile", "bound")
    assert found["wear_depth_exceedance"].dims == ("frequency", "cycle", "exceeded_depth", "bound")
    assert found["rank_correlation"].dims == ("frequency", "cycle", "input", "bound")
    assert all({"units", "long_name"} <= array.attrs.keys() for array in found.data_vars.values())
    assert list(found["input"].values) == ["friction_coefficient", "wear_coefficient", "gap"]
    np.testing.assert_array_equal(found["frequency"], dataset["frequency"])
    last = dataset["worn_volume"].isel(cycle=-1)
    median = found["worn_volume_quantile"].sel(quantile=0.5).isel(cycle=-1)
    for bound in ("lowest", "highest"):
        np.testing.assert_array_equal(median.sel(bound=bound), np.sort(last, axis=1)[:, 63])
    above = [[(last[point] > volume).mean() for volume in (1e-10, 2e-10)] for point in (0, 1)]
    np.testing.assert_allclose(found["worn_volume_exceedance"].isel(cycle=-1, bound=0), above)
    deeper = (dataset["wear_depth_max"] > 1e-6).mean("sample")
    np.testing.assert_allclose(found["wear_depth_exceedance"].isel(bound=0)[..., 0], deeper)
    error = found["worn_volume_quantile_error"].sel(quantile=0.5).isel(cycle=-1)
    np.testing.assert_allclose(error / median, [[0.99, 1.01]] * 2)
    correlation = found["rank_correlation"].isel(cycle=-1, bound=0)
    assert (correlation.sel(input="wear_coefficient") > 0.95).all()
    # the mean over the pairs would say nothing of what their own draws decide
    assert correlation.sel(input="gap").isnull().all()
    low, middle, high = 1e9 * np.quantile(last[0], [0.05, 0.5, 0.95], method="inverted_cdf")
    words = (f"128 samples wear {low:.3g} to {high:.3g} mm3, median {middle:.3g} mm3", "error 1 %", "ranked: gap")
    assert all(word in said(found) for word in (*words, "wear coefficient decides most"))
    assert "error not known" in said(worn_volume_statistics(dataset.drop_vars("worn_volume_error")))
    lost = dataset["worn_volume_error"].where(dataset["sample"] != 3, np.inf)
    assert "1 have no volume" in said(worn_volume_statistics(dataset.assign(worn_volume_error=lost)))


@pytest.mark.parametrize(
    ("noise", "n", "says"),
    [
        # correlations -0.60 and 0.995 of six samples, as they may come by chance
        (0.0, 6, "too few"),
        (0.1, 12, r"wear coefficient decides most \(rank correlation 0\.\d\d, interval 0\.\d\d to (0\.9\d|1\.00)\)"),
        (30.0, 12, r"not known: \w+ coefficient has the largest .*\(rank .*, interval .*\)"),
    ],
)
def test_a_ranking_says_its_uncertainty_and_none_is_made_of_too_few_samples(noise, n, says):
    rng = np.random.default_rng(3)
    friction, wear = rng.normal(0.5, 0.03, n), rng.lognormal(-25.0, 0.5, n)
    dataset = sample_file().isel(sample=slice(n)).drop_vars("sample_gap").assign_attrs(study="")
    dataset["worn_volume"][:] = (wear * np.exp(noise * rng.normal(size=n)))[:, None] * dataset["cycle"].values
    dataset["worn_volume_error"][:] = 0.0
    drawn = {"sample_friction_coefficient": ("sample", friction), "sample_wear_coefficient": ("sample", wear)}
    found = worn_volume_statistics(dataset.assign_coords(drawn)).isel(frequency=0, cycle=-1)
    assert re.search(says, describe_ranking(found))


def test_a_saltelli_design_is_read_as_one():
    scatter = SCATTER.replace('"sobol"', '"saltelli"').replace("128", "256")
    found = worn_volume_statistics(sample_file(scatter))
    assert found["n_samples"] == 512
    np.testing.assert_allclose(found["total_index"].isel(cycle=-1, bound=0), [[0.02, 0.98, 0.0]] * 2, atol=0.06)


def test_samples_without_a_value_and_sensitive_ones_are_bands():
    whole, part = sample_file(), sample_file()
    part["worn_volume"][0, 5, 2] = np.nan  # ended after the second count
    part["worn_volume"][0, 6, :] = np.nan  # has no state at all
    part["outcome"][1, 7] = Outcome.SENSITIVE
    part["worn_volume_error"][1, 7, :] = 0.8
    full, found = worn_volume_statistics(whole), worn_volume_statistics(part)
    np.testing.assert_array_equal(found["n_without_value"], [[1, 1, 2], [0, 1, 1]])
    for name in ("worn_volume_quantile", "worn_volume_exceedance"):
        assert (found[name].sel(bound="lowest") <= full[name].sel(bound="lowest") * (1 + 1e-12)).all()
        assert (found[name].sel(bound="highest") >= full[name].sel(bound="highest") * (1 - 1e-12)).all()
    # the sample that has ended has worn at least what it had
    low = whole["worn_volume"][0, :, 2].values.copy()
    low[5], low[6] = whole["worn_volume"][0, 5, 1], 0.0
    lowest = found["worn_volume_quantile"].isel(frequency=0, cycle=-1, quantile=0, bound=0)
    assert lowest == pytest.approx(np.sort(low)[6])
    # what the missing samples may have is no part of the numerical error
    assert re.search(r"error 1 %\); 2 have no volume", said(found))
    # with more than 5 % of them there is no upper end
    part["worn_volume"][0, 8:20, 2], low[8:20] = np.nan, whole["worn_volume"][0, 8:20, 1]
    assert f"128 samples wear above {1e9 * np.sort(low)[6]:.3g} mm3" in said(worn_volume_statistics(part))


@pytest.mark.parametrize(("method", "n_left"), [("sobol", 2), ("saltelli", 4)])
def test_samples_that_a_run_has_not_come_to_are_left_out_and_counted(method, n_left):
    """One at both points and one at the second; of a design of Saltelli with the other rows of their base."""
    scatter = SCATTER.replace('"sobol"', f'"{method}"').replace("128", "16") + "limits = {worn_volume = 1e-6}\n"
    dataset = sample_file(scatter)
    n = dataset.sizes["sample"]
    for flat in (3, n + 3, n + 9):
        fail(dataset, flat, int(Outcome.NOT_COMPUTED))
    found = worn_volume_statistics(dataset)
    assert (found["n_not_computed"], found["worn_volume_not_placed"].max()) == (n_left, 0)
    assert found["n_samples"] + n_left == (32 if method == "saltelli" else 16)
    words = f"{int(found['n_samples'])} computed samples ({n_left} not computed)"
    point = found.isel(frequency=0, cycle=-1)
    assert words in said(found)
    assert words in describe_limit(point, "worn_volume")
    assert "above" not in said(found)
    with pytest.raises(ValueError, match="No sample of the result is computed yet"):
        worn_volume_statistics(dataset.assign(outcome=dataset["outcome"] * 0 + int(Outcome.NOT_COMPUTED)))


def test_limits_are_those_of_the_study_or_given_and_samples_that_failed_are_not_known():
    dataset = sample_file(SCATTER + "limits = {wear_depth = 4e-6}\n")
    dataset["wear_depth_max"][0, 6, :] = np.nan
    n_below = int((dataset["wear_depth_max"][0, :, -1] + dataset["wear_depth_max_error"][0, :, -1] <= 4e-6).sum())
    found = worn_volume_statistics(dataset).isel(frequency=0, cycle=-1)
    n_unknown = int(found["wear_depth_not_placed"])
    assert f"{n_below} of 128 samples, {n_unknown} not known" in describe_limit(found, "wear_depth")
    np.testing.assert_allclose(found["wear_depth_within_limit"], np.array([n_below, n_below + n_unknown]) / 128)
    assert "deepest pair" in describe_volumes(found)
    assert "worn_volume_limit" not in found
    given = worn_volume_statistics(dataset, limits={"worn_volume": 1.0})
    assert (given["worn_volume_within_limit"] == 1.0).all()
    with pytest.raises(ValueError, match="not wear_depth = -1"):
        worn_volume_statistics(dataset, limits={"wear_depth": -1.0})


def test_a_limit_of_the_response_is_of_the_largest_so_far_and_that_of_the_life_is_the_least():
    text = SCATTER + "limits = {response_amplitude = 3e-5, cycles_to_target = 4e4}\n"
    dataset = sample_file(text).drop_dims("response")
    n, n_counts = dataset.sizes["sample"], dataset.sizes["cycle"]
    place = np.arange(n) / n
    falls = np.linspace(1.0, 0.5, n_counts) * 4e-5 * place[:, None] * np.ones((2, 1, 1))
    # stress is no response that this limit is of
    both = np.stack([falls, 1e9 + falls], axis=-1)
    lives, ended = np.where(place < 0.9, 1e5 * place, np.nan), np.where(place < 0.9, 1e5 * place, 1e5)
    dims = ("frequency", "sample")
    found = worn_volume_statistics(
        dataset.assign(
            response_amplitude=((*dims, "cycle", "response"), both),
            response_error=((*dims, "cycle"), np.full((2, n, n_counts), 1e-6)),
            cycles_to_target=(dims, [lives, lives]),
            cycles_to_target_error=(dims, np.full((2, n), 1.0)),
            last_cycle=(dims, [ended, ended]),
        ).assign_coords(response=["tip", "stress [MPa]"])
    )
    quiet, old = (4e-5 * place <= 3e-5).mean(), (place >= 0.4).mean()
    np.testing.assert_allclose(found["response_amplitude_within_limit"], quiet, atol=1.5 / n)
    np.testing.assert_allclose(found["cycles_to_target_within_limit"], old, atol=1e-12)
    # those that live on when all cycles are over have no upper end
    assert found["cycles_to_target_quantile"].sel(quantile=0.95, bound="highest").isin(np.inf).all()
    point = found.isel(frequency=0, cycle=-1)
    assert describe_volumes(point).startswith("90 % of 128 samples last")
    assert re.match(r"life at least 40.000 cycles: 59.4 % probable", describe_limit(point, "cycles_to_target"))
    assert "amplitude at most 0.03 mm" in describe_limit(point, "response_amplitude")


def test_two_hills_are_reported_with_the_pair_that_decides():
    dataset = sample_file(jump=5e-11)
    found = worn_volume_statistics(dataset)
    n_above = int((dataset["sample_friction_coefficient"] > 0.51).sum())
    np.testing.assert_array_equal(found["group_size"], [[128 - n_above, n_above]] * 2)
    np.testing.assert_array_equal(found["deciding_contact"] >= 0, [True, True])
    assert f"two groups, {128 - n_above} samples" in said(found)
    weight = np.trapezoid(found["worn_volume_density"][0], found["worn_volume_grid"][0])
    assert weight == pytest.approx(1.0, abs=0.05)


def test_what_has_no_samples_is_refused():
    with pytest.raises(ValueError, match="no worn_volume of samples"):
        worn_volume_statistics(sample_file().isel(sample=0))
    with pytest.raises(ValueError, match="between 0 and 1"):
        worn_volume_statistics(sample_file(), quantiles=(5, 50, 95))
