"""Figures of samples show the quantiles, probabilities, shares and groups that the drawn values lead to."""

from pathlib import Path

import numpy as np
import pytest

from studyrunner.report.drawing import Missing, style
from studyrunner.report.figures.frequency_course import find_course
from studyrunner.report.page.study import describe_study
from studyrunner.report.reading.result import Result
from studyrunner.report.scatter.figures import draw_scatter
from tests.studyrunner.report.scatter_cases import N_SAMPLES, sample_file

N_FREQUENCIES = 2


def result_of(dataset):
    return Result(Path("samples.nc"), dataset)


def drawn(dataset):
    with style():
        return {item.name: item for item in draw_scatter(result_of(dataset))}


@pytest.fixture(scope="module")
def dataset():
    return sample_file()


@pytest.fixture(scope="module")
def items(dataset):
    return drawn(dataset)


def test_the_median_over_cycles_is_that_of_the_samples(dataset, items):
    panels = items["worn_volume_bands"].figure.axes
    assert len(panels) == N_FREQUENCIES
    expected = np.quantile(dataset["worn_volume"].values[0, 0], 0.5, axis=0, method="inverted_cdf") * 1e9
    (median,) = [line for line in panels[0].get_lines() if line.get_label() == "median"]
    np.testing.assert_allclose(median.get_ydata(), expected)
    assert f"{N_SAMPLES} samples" in items["worn_volume_bands"].caption


def test_bands_over_the_frequency_ascend(dataset):
    turned = dataset.isel(frequency=[1, 0])
    turned["worn_volume"][0] *= 3.0
    panel = drawn(turned)["worn_volume_bands_course"].figure.axes[0]
    (median,) = [line for line in panel.get_lines() if line.get_label() == "median"]
    course = find_course(result_of(turned))
    np.testing.assert_array_equal(median.get_xdata(), course.values)
    assert median.get_ydata()[1] == pytest.approx(3.0 * median.get_ydata()[0])


def test_samples_without_a_value_leave_the_band_open(dataset, items):
    lost = dataset.copy(deep=True)
    lost["worn_volume"][:, :, :10, -1] = np.nan
    item = drawn(lost)["worn_volume_bands"]
    assert "10 samples without a value" in item.caption
    assert "without a value" not in items["worn_volume_bands"].caption


def test_the_wear_coefficient_decides(items):
    item = items["deciding_inputs"]
    bars = {bar.get_label(): bar for bar in item.figure.axes[0].containers if hasattr(bar, "patches")}
    shares = [patch.get_height() for patch in bars["rank correlation"].patches]
    names = [text.get_text().replace("\n", " ") for text in item.figure.axes[0].get_xticklabels()]
    assert names[int(np.argmax(shares))] == "wear coefficient"
    assert max(shares) > 0.9
    assert items["deciding_input"].title.endswith("wear coefficient")


def test_the_scatter_plot_holds_every_sample(dataset, items):
    for place, panel in enumerate(items["deciding_input"].figure.axes):
        (points,) = [found for found in panel.collections if found.get_label() == "samples"]
        at = np.asarray(points.get_offsets())
        np.testing.assert_allclose(at[:, 0], dataset["sample_wear_coefficient"].values)
        np.testing.assert_allclose(at[:, 1], dataset["worn_volume"].values[place, 0, :, -1] * 1e9)


def test_two_groups_have_two_colours():
    item = drawn(sample_file(factor=1.05, jump=1.0))["deciding_input"]
    found = {each.get_label(): each for each in item.figure.axes[0].collections}
    groups = [found["lower group"], found["upper group"]]
    assert [len(group.get_offsets()) for group in groups] == [N_SAMPLES // 2] * 2
    assert not np.array_equal(groups[0].get_facecolor(), groups[1].get_facecolor())
    assert f"{N_SAMPLES // 2} samples up to" in item.caption


def test_few_samples_have_no_indices():
    item = drawn(sample_file(4))["deciding_inputs"]
    assert isinstance(item, Missing)
    assert "raise samples" in item.sentence


def test_a_single_sample_has_no_statistics():
    assert drawn(sample_file(1)) == {}


@pytest.mark.parametrize("study", ["", "no TOML", "[scatter]\nsamples = 64\nother = {normal = {std = 1}}\n"])
def test_drawn_values_are_enough(dataset, study):
    result = result_of(dataset.assign_attrs(study=study))
    assert set(result.statistics["input"].values) == {"friction_coefficient", "wear_coefficient", "gap"}


def test_counts_are_thinned_out_where_there_are_many(dataset, monkeypatch):
    from studyrunner.report.reading import sample_statistics

    monkeypatch.setattr(sample_statistics, "_MOST_VALUES", 1)
    statistics = result_of(dataset).statistics
    np.testing.assert_array_equal(statistics["cycle"], [0.0, 200.0])
    monkeypatch.setattr(sample_statistics, "_MOST_OF_ALL", 1)
    (item,) = drawn(dataset).values()
    assert isinstance(item, Missing)


def test_the_page_says_what_the_samples_say(dataset):
    facts = describe_study(result_of(dataset))
    assert "90 % of 64 samples" in facts.summary
    assert "wear coefficient decides" in facts.summary
    low, high = dataset["sample_friction_coefficient"].min(), dataset["sample_friction_coefficient"].max()
    assert ("drawn: friction coefficient", f"{float(low):.4g} to {float(high):.4g}") in facts.facts
