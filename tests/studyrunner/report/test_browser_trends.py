"""Trends in a headless browser: the lists change what is drawn, numbers against the file, a click picks the point."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from selenium.webdriver.support.wait import WebDriverWait

from tests.studyrunner.report.browsing import (
    MARKS,
    PATIENCE,
    choose,
    click_at,
    load,
    messages,
    selected,
    write,
)
from tests.studyrunner.report.page_cases import AXES, SENTENCES, build_file

pytestmark = MARKS

FOUR = {**AXES, "wear_coefficient": (5e-12, 1e-12, 5e-11), "excitation_amplitude": (0.5, 1.5)}
SHAPE = (4, 3, 2, 1, 2, 1)
FAILED = 30
ERROR, PEAK, SHIFT = 1, 2, 3  # places in the lists; the worn volume stands first


@pytest.fixture(scope="module")
def dataset():
    """Four axes, one point failed; the peaks lie inside the frequencies, but for one combination."""
    found = build_file(FOUR, failed=[FAILED], cycles=(0.0, 100.0, 400.0))
    found["error_estimate"].values[...] = np.random.default_rng(3).uniform(0.01, 0.2, SHAPE)
    frequency = found["frequency"].values.reshape(4, 1, 1, 1, 1, 1, 1)
    centre = np.array([191.1, 191.4, 192.3])
    for step in range(SHAPE[1]):
        here = {"wear_coefficient": step}
        like = found["response_amplitude"][here].values
        like[...] = 2e-6 - 1e-7 * (frequency[..., 0] - centre - 0.05 * step)[..., None] ** 2
    found["response_amplitude"].values[:, 0, 0, 0, 0, 0] = np.array([4, 3, 2, 1])[:, None, None] * 1e-7
    found["response_amplitude"].values.reshape(-1, 3)[FAILED] = np.nan
    return found


@pytest.fixture(scope="module")
def address(dataset, tmp_path_factory):
    return write(dataset, tmp_path_factory.mktemp("trends"))


@pytest.fixture
def page(browser, address):
    """The page with the first point picked and the lists as at first."""
    if browser.current_url != address:
        load(browser, address)
    pick(browser, (1, 2, 1, 0, 0, 0))
    for name, index in (("quantity", 0), ("axis", 1), ("map", 0), ("across", 1), ("up", 2)):
        choose(browser, f"trend {name}", index)
    yield browser
    assert messages(browser) == []


def pick(page, place):
    for name, index, size in zip(FOUR, place, SHAPE, strict=True):
        if size > 1:
            choose(page, f"axis {name.replace('_', ' ')}", index)


def drawn(page, plot, meta):
    """A trace of a plot as plain lists; empty where there is none."""
    script = """
    const trace = document.getElementById(arguments[0]).data.find((each) => each.meta === arguments[1]);
    if (!trace) return {};
    const own = ["x", "y", "z", "text", "customdata"].filter((name) => trace[name]);
    const lists = Object.fromEntries(own.map((name) => [name, Array.from(trace[name])]));
    return { ...lists, bars: trace.error_y && trace.error_y.visible ? Array.from(trace.error_y.array) : null };
    """
    found: dict[str, Any] = page.execute_script(script, plot, meta)
    return found


def shown(values):
    return np.array(values, dtype=float)


def worn_of(dataset):
    """Final worn volumes, mm3."""
    values: NDArray[np.float64] = dataset["worn_volume"].values[..., -1] * 1e9
    return values


def test_the_line_is_that_of_the_file_with_its_errors(page, dataset):
    worn = worn_of(dataset)
    line = drawn(page, "trend-plot", "trend")
    assert line["x"] == [1e-12, 5e-12, 5e-11]
    order = [1, 0, 2]
    np.testing.assert_allclose(line["y"], worn[1, order, 1, 0, 0, 0], rtol=1e-6)
    expected = (worn * dataset["error_estimate"].values)[1, order, 1, 0, 0, 0]
    np.testing.assert_allclose(line["bars"], expected, rtol=1e-6)
    assert page.execute_script("return document.getElementById('trend-plot').layout.xaxis.type") == "log"
    pick(page, (2, 2, 0, 0, 1, 0))
    np.testing.assert_allclose(drawn(page, "trend-plot", "trend")["y"], worn[2, order, 0, 0, 1, 0], rtol=1e-6)


def test_peaks_and_shifts_are_those_of_the_parabolas(page, dataset):
    pick(page, (1, 2, 1, 0, 1, 0))
    choose(page, "trend quantity", PEAK)
    line = drawn(page, "trend-plot", "trend")
    np.testing.assert_allclose(line["y"], [2.0] * 3, rtol=1e-5)
    choose(page, "trend quantity", SHIFT)
    np.testing.assert_allclose(drawn(page, "trend-plot", "trend")["y"], [1.2] * 3, rtol=1e-4)
    # 192.3 and 191.1 Hz, and as many times 0.05 Hz more as there are values before: the nearest are 192.5 and 191
    offsets = 0.05 * np.array([1, 0, 2])
    expected = np.abs(192.3 + offsets - 192.5) + np.abs(191.1 + offsets - 191.0)
    np.testing.assert_allclose(drawn(page, "trend-plot", "trend")["bars"], expected, rtol=1e-3)


def test_the_map_is_that_of_any_two_axes(page, dataset):
    worn = worn_of(dataset)
    np.testing.assert_allclose(drawn(page, "trend-map-plot", "map")["z"], worn[1, [1, 0, 2], :, 0, 0, 0].T, rtol=1e-6)
    choose(page, "trend across", 0)
    field = worn[:, 2, :, 0, 0, 0].T
    np.testing.assert_allclose(drawn(page, "trend-map-plot", "map")["z"], field, rtol=1e-6)
    choose(page, "trend across", 2)  # which is up already: they change places
    np.testing.assert_allclose(drawn(page, "trend-map-plot", "map")["z"], field.T, rtol=1e-6)
    choose(page, "trend map", ERROR)
    errors = 100.0 * dataset["error_estimate"].values[:, 2, :, 0, 0, 0]
    np.testing.assert_allclose(drawn(page, "trend-map-plot", "map")["z"], errors, rtol=1e-6)


def test_a_failed_point_is_a_cross_that_says_why(page, dataset):
    place = np.unravel_index(FAILED, SHAPE)
    pick(page, [int(each) for each in place])
    for plot in ("trend-plot", "trend-map-plot"):
        crosses = drawn(page, plot, "failed")
        assert crosses["customdata"] == [FAILED]
        why = SENTENCES[4].replace("<", "&lt;").replace(">", "&gt;")
        assert (
            crosses["text"][0]
            .replace("<br>", " ")
            .startswith(f'not known: {why} Try scheme = "adaptive" or a smaller step. frequency 192.5')
        )
    missing = np.isnan(shown(drawn(page, "trend-map-plot", "map")["z"]))
    assert missing.sum() == 1


@pytest.mark.parametrize(
    ("plot", "meta", "place"),
    [("trend-plot", "trend", (1, 1, 1, 0, 0, 0)), ("trend-map-plot", "map", (1, 0, 0, 0, 0, 0))],
)
def test_a_click_picks_the_point_for_the_whole_page(page, plot, meta, place):

    click_at(page, int(np.ravel_multi_index(place, SHAPE)), plot, meta)
    scheme, frequency = FOUR["scheme"][place[4]], FOUR["frequency"][place[0]]
    WebDriverWait(page, PATIENCE).until(lambda _: f"scheme {scheme}: {SENTENCES[0]}" in selected(page))
    assert selected(page).startswith(f"frequency {frequency:g}\u00a0Hz, ")
    lists = "return [...document.querySelectorAll('#choices select')].map((each) => Number(each.value))"
    expected = [index for index, size in zip(place, SHAPE, strict=True) if size > 1]
    assert page.execute_script(lists)[:4] == expected
    line = drawn(page, "trend-plot", "trend")
    assert int(np.ravel_multi_index(place, SHAPE)) in line["customdata"]
