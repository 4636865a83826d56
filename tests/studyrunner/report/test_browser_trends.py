"""Trends in a headless browser: the lists change what is drawn, numbers against the file, a click picks the point."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

from tests.studyrunner.report.page_cases import AXES, SENTENCES, build_file
from tests.studyrunner.report.test_browser import (  # noqa: F401 - the fixture is used by its name
    CHROMIUM,
    DRIVER,
    PATIENCE,
    browser,
    choose,
    load,
    messages,
    press,
    selected,
    wait_for_frame,
    write,
)

pytestmark = [
    pytest.mark.browser,
    pytest.mark.slow,
    pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="there is no chromium with its chromedriver"),
]

FOUR = {**AXES, "wear_coefficient": (5e-12, 1e-12, 5e-11), "excitation_amplitude": (0.5, 1.5)}
SHAPE = (4, 3, 2, 1, 2, 1)
N_POINTS, OTHERS = 48, 15
FAILED = 30
ERROR, PEAK, SHIFT = 1, 2, 3  # places in the lists; the worn volume stands first


@pytest.fixture(scope="module")
def dataset() -> xr.Dataset:
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
def address(dataset: xr.Dataset, tmp_path_factory: pytest.TempPathFactory) -> str:
    return write(dataset, tmp_path_factory.mktemp("trends"))


@pytest.fixture
def page(browser: Any, address: str) -> Any:  # noqa: F811
    """The page with the first point picked and the lists as at first."""
    if browser.current_url != address:
        load(browser, address)
    pick(browser, (1, 2, 1, 0, 0, 0))
    for name, index in (("quantity", 0), ("axis", 1), ("map", 0), ("across", 1), ("up", 2)):
        choose(browser, f"trend {name}", index)
    yield browser
    assert messages(browser) == []


def pick(page: Any, place: Sequence[int]) -> None:
    for name, index, size in zip(FOUR, place, SHAPE, strict=True):
        if size > 1:
            choose(page, f"axis {name.replace('_', ' ')}", index)


def drawn(page: Any, plot: str, meta: str) -> dict[str, Any]:
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


def shown(values: Any) -> NDArray[np.float64]:
    return np.array(values, dtype=float)


def worn_of(dataset: xr.Dataset) -> NDArray[np.float64]:
    """Final worn volumes, mm3."""
    values: NDArray[np.float64] = dataset["worn_volume"].values[..., -1] * 1e9
    return values


def test_the_line_is_that_of_the_file_with_its_errors(page: Any, dataset: xr.Dataset) -> None:
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


def test_all_other_combinations_stand_behind_it(page: Any, dataset: xr.Dataset) -> None:
    others = drawn(page, "trend-plot", "others")
    lines = shown(others["y"]).reshape(OTHERS, 4)
    assert np.isnan(lines[:, 3]).all()
    points = shown(others["customdata"]).reshape(OTHERS, 4)[:, :3].astype(int)
    own = np.arange(N_POINTS).reshape(SHAPE)[1, [1, 0, 2], 1, 0, 0, 0]
    assert sorted([*points.ravel(), *own]) == list(range(N_POINTS))
    np.testing.assert_allclose(lines[:, :3], worn_of(dataset).ravel()[points], rtol=1e-6)


@pytest.mark.parametrize(("index", "axis"), [(0, 0), (2, 2), (3, 4)])
def test_the_list_of_axes_turns_the_line(page: Any, dataset: xr.Dataset, index: int, axis: int) -> None:
    choose(page, "trend axis", index)
    line = drawn(page, "trend-plot", "trend")
    place: list[Any] = [1, 2, 1, 0, 0, 0]
    place[axis] = slice(None)
    np.testing.assert_allclose(line["y"], worn_of(dataset)[tuple(place)], rtol=1e-6)
    values = list(FOUR.values())[axis]
    assert line["x"] == ([0, 1] if axis == 4 else list(values))


def test_peaks_and_shifts_are_those_of_the_parabolas(page: Any, dataset: xr.Dataset) -> None:
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


def test_a_peak_at_the_end_of_the_frequencies_is_told_as_not_known(page: Any) -> None:
    choose(page, "trend quantity", PEAK)
    pick(page, (1, 0, 0, 0, 0, 0))
    (text,) = drawn(page, "trend-plot", "failed")["text"]
    words = text.replace("<br>", " ")
    assert words.startswith("not known: no peak inside the frequencies computed")
    assert "frequency 19" not in words


def test_frequency_is_no_axis_of_what_was_searched_through_it(page: Any, dataset: xr.Dataset) -> None:
    choose(page, "trend axis", 0)
    choose(page, "trend quantity", PEAK)
    script = "return [...document.querySelector(\"select[name='trend axis']\").options].map((each) => each.disabled)"
    assert page.execute_script(script) == [True, False, False, False]
    assert drawn(page, "trend-plot", "trend")["x"] == [1e-12, 5e-12, 5e-11]


def test_hover_tells_what_varies_with_units(page: Any, dataset: xr.Dataset) -> None:
    worn = worn_of(dataset)[1, 2, 1, 0, 0, 0]
    error = worn * dataset["error_estimate"].values[1, 2, 1, 0, 0, 0]
    told, *named = drawn(page, "trend-plot", "trend")["text"][2].replace("\u00a0", " ").split("<br>")
    assert named == ["frequency 191 Hz", "wear coefficient 5e-11 1/Pa", "excitation amplitude 1.5 N", "scheme implicit"]
    number, _, wrong, unit = told.split()
    assert float(number) == pytest.approx(worn, rel=5.1e-4)
    assert float(wrong) == pytest.approx(error, rel=5.1e-2)
    assert unit == "mm³"


def test_the_map_is_that_of_any_two_axes(page: Any, dataset: xr.Dataset) -> None:
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


def test_a_failed_point_is_a_cross_that_says_why(page: Any, dataset: xr.Dataset) -> None:
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


def click(page: Any, plot: str, meta: str, point: int) -> None:
    """A press of the mouse where a plot shows a point."""
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.by import By
    from selenium.webdriver.support.wait import WebDriverWait

    script = """
    const [plot, meta, point] = arguments;
    plot.scrollIntoView({block: "center", behavior: "instant"});
    const trace = plot.data.find((each) => each.meta === meta);
    const { xaxis, yaxis } = plot._fullLayout;
    const box = plot.getBoundingClientRect();
    let [x, y] = [null, null];
    if (trace.z) {
      trace.customdata.forEach((line, row) => { if (line.includes(point)) [x, y] = [line.indexOf(point), row]; });
    } else {
      const at = trace.customdata.indexOf(point);
      [x, y] = [trace.x[at], trace.y[at]];
    }
    return [xaxis._offset + xaxis.d2p(x) - box.width / 2, yaxis._offset + yaxis.d2p(y) - box.height / 2];
    """
    element = page.find_element(By.ID, plot)

    def hover(_: Any) -> bool:
        x, y = page.execute_script(script, element, meta, point)
        actions = ActionChains(page).move_to_element_with_offset(element, round(x) - 3, round(y) + 2)
        actions.move_by_offset(3, -2).perform()
        wait_for_frame(page)
        found = page.execute_script("return (arguments[0]._hoverdata || []).map((each) => each.customdata)", element)
        return point in found

    WebDriverWait(page, PATIENCE, poll_frequency=0.1).until(hover)
    ActionChains(page).click().perform()


@pytest.mark.parametrize(
    ("plot", "meta", "place"),
    [
        ("trend-plot", "trend", (1, 1, 1, 0, 0, 0)),
        ("trend-plot", "others", (3, 0, 0, 0, 1, 0)),
        ("trend-map-plot", "map", (1, 0, 0, 0, 0, 0)),
    ],
)
def test_a_click_picks_the_point_for_the_whole_page(page: Any, plot: str, meta: str, place: tuple[int, ...]) -> None:
    from selenium.webdriver.support.wait import WebDriverWait

    click(page, plot, meta, int(np.ravel_multi_index(place, SHAPE)))
    scheme, frequency = FOUR["scheme"][place[4]], FOUR["frequency"][place[0]]
    WebDriverWait(page, PATIENCE).until(lambda _: f"scheme {scheme}: {SENTENCES[0]}" in selected(page))
    assert selected(page).startswith(f"frequency {frequency:g}\u00a0Hz, ")
    lists = "return [...document.querySelectorAll('#choices select')].map((each) => Number(each.value))"
    expected = [index for index, size in zip(place, SHAPE, strict=True) if size > 1]
    assert page.execute_script(lists)[:4] == expected
    line = drawn(page, "trend-plot", "trend")
    assert int(np.ravel_multi_index(place, SHAPE)) in line["customdata"]


def test_the_slider_draws_the_trends_no_second_time(page: Any) -> None:
    from selenium.webdriver.common.keys import Keys

    page.execute_script("document.getElementById('trend-plot').data[0].seen = true")
    press(page, Keys.ARROW_LEFT)
    assert page.execute_script("return document.getElementById('trend-plot').data[0].seen === true")
    press(page, Keys.END)


SINGLE = {name: values[:1] for name, values in AXES.items()}
FREQUENCY = {"frequency": AXES["frequency"]}
COEFFICIENT = {"wear_coefficient": AXES["wear_coefficient"]}


@pytest.mark.parametrize(
    ("axes", "failed", "panel", "map_too"),
    [
        ({**SINGLE, **FREQUENCY}, (), False, False),
        ({**SINGLE, **COEFFICIENT}, (), True, False),
        ({**SINGLE, **FREQUENCY, **COEFFICIENT}, (), True, True),
        ({**SINGLE, **FREQUENCY, "harmonics": ("auto", "5")}, range(3, 8), True, True),
        ({**SINGLE, **FREQUENCY, **COEFFICIENT}, range(8), False, False),
    ],
    ids=["frequency", "one other", "two", "solver key, partial", "failed"],
)
def test_when_there_are_trends(
    browser: Any,  # noqa: F811
    tmp_path: Path,
    axes: dict[str, Sequence[object]],
    failed: Sequence[int],
    panel: bool,
    map_too: bool,
) -> None:
    dataset = build_file(axes, failed=failed)
    load(browser, write(dataset, tmp_path))
    script = "return document.getElementById('{}').offsetParent !== null"
    assert browser.execute_script(script.format("trend-part")) == panel
    assert browser.execute_script(script.format("trend-map-part")) == map_too
    if map_too:
        worn = dataset["worn_volume"].values[..., -1].reshape(4, 2)
        field = shown(drawn(browser, "trend-map-plot", "map")["z"])
        known = np.isfinite(worn)
        np.testing.assert_array_equal(np.isfinite(field), known)
        np.testing.assert_allclose(field[known], worn[known] * 1e9, rtol=1e-6)
        assert len(drawn(browser, "trend-map-plot", "failed").get("x", [])) == (~known).sum()
    assert messages(browser) == []
