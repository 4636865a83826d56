"""The statistics of a result with samples: labelled, as bands where samples have no value, and in sentences."""

import re
from functools import cache

import numpy as np
import pytest

from solver.outcome import Outcome
from studyrunner.statistics.study_statistics import (
    describe_ranking,
    describe_volumes,
    worn_volume_statistics,
)
from tests.studyrunner.results import SCATTER, sample_file


def said(found):
    """What the samples say of the first frequency at the last count."""
    point = found.isel(cycle=-1, frequency=0, missing_dims="ignore")
    return f"{describe_volumes(point)}; {describe_ranking(point)}"


@cache
def plain_statistics():
    return worn_volume_statistics(sample_file())


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
    full, found = plain_statistics(), worn_volume_statistics(part)
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


def test_two_hills_are_reported_with_the_pair_that_decides():
    dataset = sample_file(jump=5e-11)
    found = worn_volume_statistics(dataset)
    n_above = int((dataset["sample_friction_coefficient"] > 0.51).sum())
    np.testing.assert_array_equal(found["group_size"], [[128 - n_above, n_above]] * 2)
    np.testing.assert_array_equal(found["deciding_contact"] >= 0, [True, True])
    assert f"two groups, {128 - n_above} samples" in said(found)
    weight = np.trapezoid(found["worn_volume_density"][0], found["worn_volume_grid"][0])
    assert weight == pytest.approx(1.0, abs=0.05)


def test_samples_of_zero_width_say_one_value():
    found = worn_volume_statistics(sample_file(SCATTER.replace("0.03", "0").replace("1.5", "1").replace("1e-7", "0")))
    last = found["worn_volume_quantile"].isel(cycle=-1)
    np.testing.assert_array_equal(last, last.isel(quantile=0).broadcast_like(last))
    assert found["rank_correlation"].isnull().all()
    assert (found["group_size"].isel(group=1) == 0).all()
    assert "decides" not in said(found)


def test_what_has_no_samples_is_refused():
    with pytest.raises(ValueError, match="no worn_volume of samples"):
        worn_volume_statistics(sample_file().isel(sample=0))
    with pytest.raises(ValueError, match="between 0 and 1"):
        worn_volume_statistics(sample_file(), quantiles=(5, 50, 95))
