"""The statistics of a result with samples: labelled, as bands where samples have no value, and in sentences."""

import re
import tomllib
from functools import cache

import numpy as np
import pytest
import xarray as xr

from studyrunner.scatter import ScatteredPairs, ScatterSection, drawn
from studyrunner.statistics.study_statistics import describe_ranking, describe_volumes, worn_volume_statistics

SCATTER = """\
[scatter]
samples = 128
method = "sobol"
seed = 1
friction_coefficient = {normal = {mean = 0.5, std = 0.03}}
wear_coefficient = {lognormal = {factor = 1.5}}
gap = {normal = {std = 1e-7}, of = "each pair"}
"""
SENSITIVE = 15
PAIRS = ScatteredPairs(("left",) * 3, np.full((3, 3), np.nan))
CYCLES = np.array([0.0, 5e4, 1e5])


def result(scatter=SCATTER, jump=0.0):
    """A made-up result: volume (2 frequencies, sample, 3 counts) = k_w mu (1 + gap) N, with a jump where mu > 0.51.

    The volume is worn off pair 1 alone, which the other two follow by a tenth.
    """
    section = ScatterSection.model_validate(tomllib.loads(scatter)["scatter"])
    draws = drawn(section, {"wear_coefficient": 1e-11, "gap": np.zeros(3)}, PAIRS)
    friction = draws["friction_coefficient"].apply(0.5)
    gap, wear = draws["gap"].apply(np.zeros(3)), draws["wear_coefficient"].apply(1e-11)
    rate = wear * friction * (1.0 + 1e5 * gap.mean(axis=1)) + jump * (friction > 0.51)
    volume = np.array([1.0, 2.0])[:, None, None] * rate[:, None] * CYCLES * 1e-3
    depth = volume[..., None] * [0.1, 1.0, 0.1] / 1e-4
    axes = ("frequency", "sample", "cycle")
    outcome = xr.DataArray(np.zeros(volume.shape[:2], dtype=np.int8), dims=axes[:2])
    outcome.attrs = {
        "flag_values": np.array([0, 6, 15], dtype=np.int8),
        "flag_meanings": "converged inaccurate sensitive",
    }
    return xr.Dataset(
        {
            "worn_volume": (axes, volume),
            "worn_volume_error": (axes, np.full(volume.shape, 0.01)),
            "wear_depth": ((*axes, "contact"), depth),
            "wear_depth_error": ((*axes, "contact"), 0.01 * depth),
            "outcome": outcome,
        },
        {
            "frequency": ("frequency", [211.5, 212.0], {"units": "Hz"}),
            "cycle": ("cycle", CYCLES),
            "contact": ("contact", np.arange(3)),
            "sample_friction_coefficient": ("sample", friction),
            "sample_wear_coefficient": ("sample", wear),
            "sample_gap": (("sample", "contact"), gap),
        },
        {"study": scatter},
    )


def said(found, frequency=0):
    """What the samples say at the last count."""
    point = found.isel(cycle=-1, frequency=frequency, missing_dims="ignore")
    return f"{describe_volumes(point)}; {describe_ranking(point)}"


@cache
def plain_statistics():
    return worn_volume_statistics(result())


def test_every_statistic_is_labelled_and_stands_over_the_other_dimensions():
    dataset = result()
    found = worn_volume_statistics(dataset, exceed=[1e-10, 2e-10], depth=1e-6)
    assert found["worn_volume_quantile"].dims == ("frequency", "cycle", "quantile", "bound")
    assert found["wear_depth_exceedance"].dims == ("frequency", "cycle", "exceeded_depth", "bound")
    assert found["rank_correlation"].dims == ("frequency", "cycle", "input", "bound")
    assert all({"units", "long_name"} <= array.attrs.keys() for array in found.data_vars.values())
    assert list(found["input"].values) == ["friction_coefficient", "wear_coefficient", "gap"]
    np.testing.assert_array_equal(found["frequency"], dataset["frequency"])
    last = dataset["worn_volume"].isel(cycle=-1)
    median = found["worn_volume_quantile"].sel(quantile=0.5).isel(cycle=-1)
    np.testing.assert_array_equal(median.sel(bound="lowest"), np.sort(last, axis=1)[:, 63])
    np.testing.assert_array_equal(median.sel(bound="highest"), median.sel(bound="lowest"))
    above = [[(last[point] > volume).mean() for volume in (1e-10, 2e-10)] for point in (0, 1)]
    np.testing.assert_allclose(found["worn_volume_exceedance"].isel(cycle=-1, bound=0), above)
    deepest = dataset["wear_depth"].isel(contact=1)
    np.testing.assert_allclose(found["wear_depth_exceedance"].isel(bound=0)[..., 0], (deepest > 1e-6).mean("sample"))
    error = found["worn_volume_quantile_error"].sel(quantile=0.5).isel(cycle=-1)
    np.testing.assert_allclose(error / median, [[0.99, 1.01]] * 2)
    correlation = found["rank_correlation"].isel(cycle=-1, bound=0)
    assert (correlation.sel(input="wear_coefficient") > 0.95).all()
    # the mean over the pairs would say nothing of what their own draws decide
    assert correlation.sel(input="gap").isnull().all()
    text = r"90 % of 128 samples wear 0.256 to 0.969 mm3, median 0.506 mm3 \(numerical error 1 %\); wear coefficient .*"
    assert re.fullmatch(f"{text}decides most .*; input not ranked: gap", said(found))
    assert "numerical error not known" in said(worn_volume_statistics(dataset.drop_vars("worn_volume_error")))


@pytest.mark.parametrize(
    ("noise", "n", "says"),
    [
        # correlations -0.60 and 0.995 of six samples, as they may come by chance
        (0.0, 6, "6 samples are too few to say which input decides"),
        (0.1, 12, r"wear coefficient decides most \(rank correlation 0\.\d\d, interval 0\.\d\d to (0\.9\d|1\.00)\)"),
        (30.0, 12, r"which input decides is not known: \w+ coefficient has the largest .*\(rank .*, interval .*\)"),
    ],
)
def test_a_ranking_says_its_uncertainty_and_none_is_made_of_too_few_samples(noise, n, says):
    rng = np.random.default_rng(3)
    friction, wear = rng.normal(0.5, 0.03, n), rng.lognormal(-25.0, 0.5, n)
    volume = wear * np.exp(noise * rng.normal(size=n))
    dataset = result().isel(sample=slice(n)).drop_vars("sample_gap")
    dataset["worn_volume"][:] = volume[:, None] * dataset["cycle"].values
    dataset["worn_volume_error"][:] = 0.0
    dataset = dataset.assign_coords(
        sample_friction_coefficient=("sample", friction), sample_wear_coefficient=("sample", wear)
    ).assign_attrs(study="")
    found = worn_volume_statistics(dataset).isel(frequency=0, cycle=-1)
    assert re.fullmatch(says, describe_ranking(found))


def test_a_saltelli_design_is_read_as_one():
    found = worn_volume_statistics(result(SCATTER.replace('"sobol"', '"saltelli"').replace("128", "256")))
    assert found.attrs["title"] == "Statistics of 512 samples"
    np.testing.assert_allclose(found["total_index"].isel(cycle=-1, bound=0), [[0.02, 0.98, 0.0]] * 2, atol=0.06)


def test_samples_without_a_value_and_sensitive_ones_are_bands():
    whole, part = result(), result()
    part["worn_volume"][0, 5, 2] = np.nan  # ended after the second count
    part["worn_volume"][0, 6, :] = np.nan  # has no state at all
    part["outcome"][1, 7] = SENSITIVE
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
    text = r"\(numerical error 1 %\); 2 have no volume that can be trusted; wear coefficient decides most \(rank corr"
    assert re.search(text, said(found))
    # with more than 5 % of them there is no upper end
    part["worn_volume"][0, 8:20, 2], low[8:20] = np.nan, whole["worn_volume"][0, 8:20, 1]
    text = f"90 % of 128 samples wear above {1e9 * np.sort(low)[6]:.3g} mm3"
    assert text in said(worn_volume_statistics(part))


def test_two_hills_are_reported_with_the_pair_that_decides():
    dataset = result(jump=5e-11)
    found = worn_volume_statistics(dataset)
    n_above = int((dataset["sample_friction_coefficient"] > 0.51).sum())
    np.testing.assert_array_equal(found["group_size"], [[128 - n_above, n_above]] * 2)
    np.testing.assert_array_equal(found["deciding_contact"] >= 0, [True, True])
    assert f"two groups, {128 - n_above} samples up to" in said(found)
    weight = np.trapezoid(found["worn_volume_density"][0], found["worn_volume_grid"][0])
    assert weight == pytest.approx(1.0, abs=0.05)


def test_samples_of_zero_width_say_one_value():
    zero = SCATTER.replace("0.03", "0").replace("1.5", "1").replace("1e-7", "0")
    found = worn_volume_statistics(result(zero))
    last = found["worn_volume_quantile"].isel(cycle=-1)
    np.testing.assert_array_equal(last, last.isel(quantile=0).broadcast_like(last))
    assert found["rank_correlation"].isnull().all()
    assert (found["group_size"].isel(group=1) == 0).all()
    assert "decides" not in said(found)


def test_what_has_no_samples_is_refused():
    with pytest.raises(ValueError, match=r"no worn_volume of samples: run a study with \[scatter\]"):
        worn_volume_statistics(result().isel(sample=0))
    with pytest.raises(ValueError, match="between 0 and 1"):
        worn_volume_statistics(result(), quantiles=(5, 50, 95))
