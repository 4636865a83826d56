"""Samples in a headless browser: a click picks a sample, whose depths, drawn values and history are then shown."""

import numpy as np
import pytest

from tests.studyrunner.report.browsing import MARKS, choose, click_at, load, map_values, messages, selected, write
from tests.studyrunner.report.scatter_cases import N_SAMPLES, sample_file

pytestmark = MARKS

SAMPLE = 7


@pytest.fixture(scope="module")
def dataset():
    return sample_file(factor=1.05, jump=1.0)


@pytest.fixture(scope="module")
def page(browser, dataset, tmp_path_factory):
    load(browser, write(dataset, tmp_path_factory.mktemp("samples")))
    yield browser
    assert messages(browser) == []


def traces(page, plot):
    script = "return document.getElementById(arguments[0]).data.map((each) => [each.meta, [...each.x], [...each.y]])"
    return {meta: (x, y) for meta, x, y in page.execute_script(script, plot)}


def test_a_click_picks_a_sample(page, dataset):
    click_at(page, SAMPLE, "scatter-plot")
    assert selected(page).startswith(f"frequency 190\u00a0Hz, sample {SAMPLE}:")
    depth = dataset["wear_depth_last"].values[0, 0, SAMPLE]
    shown = np.sort(np.ravel([np.ravel(panel) for panel in map_values(page)]))
    np.testing.assert_allclose(shown, np.sort(depth) * 1e6, rtol=1e-6)
    script = "return document.querySelector('[data-name=\"drawn wear coefficient\"] dd').textContent"
    drawn = page.execute_script(script).replace("\u00a0", " ")
    assert float(drawn.split()[0]) == pytest.approx(float(dataset["sample_wear_coefficient"][SAMPLE]), rel=1e-4)


def test_two_groups_stand_apart(page, dataset):
    found = traces(page, "scatter-plot")
    lower, upper = found["group 1"][1], found["group 2"][1]
    assert [len(lower), len(upper)] == [N_SAMPLES // 2] * 2
    worn = np.sort(dataset["worn_volume"].values[0, 0, :, -1]) * 1e9
    np.testing.assert_allclose(np.sort(lower + upper), worn, rtol=1e-6)


def test_bands_run_over_cycles_and_frequency(page, dataset):
    worn = dataset["worn_volume"].values * 1e9
    x, y = traces(page, "band-plot")["median"]
    assert x == dataset["cycle"].values.tolist()
    np.testing.assert_allclose(y, np.quantile(worn[0, 0], 0.5, axis=0, method="inverted_cdf"), rtol=1e-6)
    choose(page, "band along", 1)
    assert traces(page, "band-plot")["median"][0] == dataset["frequency"].values.tolist()
