"""The page in a real headless browser without a network: slider, clicks and lists show the numbers of the file."""

from typing import Any

import numpy as np
import pytest
from selenium.webdriver.common.keys import Keys

from tests.studyrunner.report.browsing import (
    DESKTOP,
    FACTORS,
    MARKS,
    PHONE,
    choose,
    click_at,
    load,
    map_pairs,
    map_values,
    messages,
    numbers,
    press,
    selected,
    write,
)
from tests.studyrunner.report.page_cases import SENTENCES, build_file

pytestmark = MARKS
EVIL = "</script><img src=x onerror='window.hurt=1'><script>window.hurt=2</script>"
FAILED = 5


@pytest.fixture(scope="module")
def dataset():
    """16 points, one of them failed; loops of two pairs; two responses; a hostile title and a hostile surface."""
    surfaces = [EVIL] * 12 + ["extrados"] * 12
    found = build_file(failed=[FAILED], loops=[2, 5], responses=("tip", EVIL), surfaces=surfaces)
    found.attrs["title"] = EVIL
    return found


@pytest.fixture(scope="module")
def address(dataset, tmp_path_factory):
    return write(dataset, tmp_path_factory.mktemp("page"))


@pytest.fixture
def page(browser, address, dataset):
    """The page as it looks at first, without errors to the end; loaded only where another one was: that takes time."""

    if browser.current_url != address:
        load(browser, address)
    index = np.unravel_index(shown_point(dataset), dataset["outcome"].shape)
    for name, place in zip(dataset["outcome"].dims, index, strict=True):
        if dataset.sizes[name] > 1:
            choose(browser, f"axis {str(name).replace('_', ' ')}", int(place))
    for name in ("map", "response"):
        choose(browser, name, 0)
    press(browser, Keys.END)
    yield browser
    assert messages(browser) == []


def assert_maps_are(page, dataset, name, point, cycle):
    """The maps show a variable of the file at a point and a cycle, in whatever unit fits."""
    values = dataset[name].values.reshape(-1, 5, 24)[point, cycle].astype("f4")
    shown = np.concatenate([np.ravel(panel) for panel in map_values(page)])
    pairs = np.concatenate([np.ravel(panel) for panel in map_pairs(page)]).astype(int)
    assert sorted(pairs) == list(range(24))
    unit = page.execute_script("return document.getElementById('map-plot').layout.coloraxis.colorbar.title.text")
    np.testing.assert_allclose(shown, values[pairs] * FACTORS[unit], rtol=1e-6)


def shown_point(dataset):
    return int(np.nanargmax(dataset["worn_volume"].values.reshape(16, 5)[:, -1]))


def test_the_page_begins_with_the_shown_point_and_the_last_cycle(browser, address, dataset):
    load(browser, address)
    assert_maps_are(browser, dataset, "mean_pressure", shown_point(dataset), 4)
    expected = dataset["worn_volume"].values.reshape(16, 5)[shown_point(dataset), 4]
    assert numbers(browser)["worn_volume"] == pytest.approx(expected, rel=2e-6)


def test_numbers_have_as_many_digits_as_their_errors_allow(page, dataset):
    script = "return document.querySelector(`#readout div[data-name='${arguments[0]}'] dd`).textContent"
    point = shown_point(dataset)
    volume, error = (
        float(dataset[name].values.reshape(16, 5)[point, 4]) for name in ("worn_volume", "worn_volume_error")
    )
    number = page.execute_script(script, "worn_volume").split()[0].replace("\u00a0", "")
    shown = float(number) / float(f"{1e9 * volume:.9g}")
    assert abs(shown - 1.0) <= max(0.5 * error, 0.05)
    assert len(number.replace(".", "").lstrip("0")) <= max(2, 2 - np.floor(np.log10(error)))
    assert page.execute_script(script, "error_estimate").endswith("\u00a0%")


def test_a_narrow_window_cuts_off_nothing(browser, address):
    browser.set_window_size(*PHONE)
    load(browser, address)
    chosen = "[...document.querySelectorAll('figure svg, figure img, .main-svg, #explore')]"
    right = browser.execute_script(f"return {chosen}.map(each => each.getBoundingClientRect().right)")
    width = browser.execute_script("return document.documentElement.clientWidth")
    browser.set_window_size(*DESKTOP)
    assert right
    assert max(right) <= width + 1


def test_texts_of_the_file_do_nothing(page, dataset):
    assert page.title == " ".join(EVIL.split())
    assert page.execute_script("return window.hurt === undefined")
    assert page.execute_script("return document.querySelectorAll('img').length") == 0
    shown = page.execute_script("return document.getElementById('map-plot').textContent")
    assert "<img" in shown


def test_the_slider_turns_the_maps_to_another_cycle(page, dataset):

    point = shown_point(dataset)
    assert_maps_are(page, dataset, "mean_pressure", point, 4)
    before = map_values(page)
    press(page, Keys.ARROW_LEFT)
    assert map_values(page) != before
    assert_maps_are(page, dataset, "mean_pressure", point, 3)
    press(page, Keys.HOME)
    assert_maps_are(page, dataset, "mean_pressure", point, 0)
    assert "cycle 0" in page.execute_script("return document.getElementById('map-title').textContent")
    assert page.execute_script("return document.getElementById('cycle-count').textContent") == "0 of 400"


def test_the_response_is_that_of_the_cycle_with_the_first_as_ghost(page, dataset):

    press(page, Keys.HOME, Keys.ARROW_RIGHT)
    data = "document.getElementById('response-plot').data"
    traces = page.execute_script(f"return {data}.map(({{meta, x, y, customdata}}) => [meta, x, [...y], customdata])")
    amplitude = dataset["response_amplitude"].values.reshape(16, 5, 2)[..., 0]
    lines = [each for each in traces if each[0] == "response"]
    assert len(lines) == 2
    assert shown_point(dataset) in lines[1][3]
    for cycle, kind in ((1, "response"), (0, "first")):
        for (_, x, y, _), (*_, points) in zip([each for each in traces if each[0] == kind], lines, strict=True):
            assert x == dataset["frequency"].values.tolist()
            expected = np.where(np.isnan(amplitude[points, cycle]), np.nan, amplitude[points, cycle])
            np.testing.assert_allclose(np.array(y, dtype=float), expected * 1e6, rtol=1e-6)


def test_a_click_on_the_response_picks_the_point(page, dataset):
    coefficient = np.unravel_index(shown_point(dataset), (4, 2, 1, 1, 2, 1))[1]
    points = np.arange(16).reshape(4, 2, 1, 1, 2, 1)[:, coefficient].ravel()
    point = int([each for each in points if each not in (FAILED, shown_point(dataset))][3])
    click_at(page, point)
    found = numbers(page)
    index = np.unravel_index(point, (4, 2, 1, 1, 2, 1))
    assert found["axis frequency"] == dataset["frequency"].values[index[0]]
    for name in ("response_amplitude", "response_peak", "worn_volume", "wear_rate"):
        values = dataset[name].values.reshape(16, 5, -1)[point, 4, 0]
        assert found[name] == pytest.approx(values, rel=2e-6)
    for name in ("run_time", "error_estimate", "newton_iterations"):
        assert found[name] == pytest.approx(dataset[name].values.ravel()[point], rel=2e-6)
    assert found["energy_error"] == pytest.approx(dataset["energy_error"].values.reshape(16, 5)[point].max(), rel=2e-6)
    assert_maps_are(page, dataset, "mean_pressure", point, 4)
    scheme = dataset["scheme"].values[index[4]]
    assert f"frequency {dataset['frequency'].values[index[0]]:g}\u00a0Hz" in selected(page)
    assert f"scheme {scheme}: {SENTENCES[0]}" in selected(page)
    assert page.execute_script("return document.querySelector(\"select[name='axis scheme']\").value") == str(index[4])


def test_a_point_that_ended_early_is_shown_as_far_as_it_went(browser, tmp_path):
    """With the band of its error, and with a cross on the response where it has no value."""
    dataset = build_file(cycles=(0.0, 100.0, 200.0, 300.0, 400.0))
    early = int(shown_point(dataset))
    place = np.unravel_index(early, dataset["outcome"].shape)
    dataset["outcome"].values[place], dataset["last_cycle"].values[place] = 4, 250.0
    dataset["message"].values[place] = "it ended at cycle 250"
    dataset["worn_volume_error"].values[place] = 0.25
    for values in dataset.data_vars.values():
        if "cycle" in values.dims and values.dtype.kind == "f":
            values.values[place][3:] = np.nan
    load(browser, write(dataset, tmp_path))
    for name, index in zip(dataset["outcome"].dims, place, strict=True):
        if dataset.sizes[name] > 1:
            choose(browser, f"axis {str(name).replace('_', ' ')}", int(index))
    advice = 'Try scheme = "adaptive" or a smaller step.'
    assert selected(browser).endswith(f"{SENTENCES[4]} it ended at cycle 250. {advice}")
    script = "return document.getElementById('{}').data.map(({{meta, x, y}}) => [meta, x, y])"
    course = {meta: (x, y) for meta, x, y in browser.execute_script(script.format("course-plot"))}
    x, y = course["worn_volume_error"]
    assert x == [0.0, 100.0, 200.0, 200.0, 100.0, 0.0]
    worn = np.array(course["worn_volume"][1][:3])
    np.testing.assert_allclose(y, [*(1.25 * worn), *(0.75 * worn)[::-1]], rtol=1e-6)
    (crosses,) = [x for meta, x, _ in browser.execute_script(script.format("response-plot")) if meta == "failed"]
    assert crosses == [dataset["frequency"].values[place[0]]]
    assert map_values(browser) == []

    press(browser, Keys.HOME)
    assert map_values(browser) != []
    assert not [meta for meta, *_ in browser.execute_script(script.format("response-plot")) if meta == "failed"]
    assert messages(browser) == []


def test_the_lists_pick_points_variables_and_responses(page, dataset):
    index = (2, 1, 0, 0, 1, 0)
    for name, place in zip(("frequency", "wear coefficient", "scheme"), (2, 1, 1), strict=True):
        choose(page, f"axis {name}", place)
    point = int(np.ravel_multi_index(index, (4, 2, 1, 1, 2, 1)))
    for place, name in enumerate(("mean_pressure", "wear_depth", "open_fraction")):
        choose(page, "map", place)
        assert_maps_are(page, dataset, name, point, 4)
    choose(page, "response", 1)
    expected = dataset["response_amplitude"].values.reshape(16, 5, 2)[point, 4, 1]
    assert numbers(page)["response_amplitude"] == pytest.approx(expected, rel=2e-6)


def test_histories_and_loops_are_those_of_the_point(page, dataset):
    choose(page, "axis frequency", 0)
    choose(page, "axis wear coefficient", 0)
    choose(page, "axis scheme", 1)
    course = page.execute_script(
        "return document.getElementById('course-plot').data.map(({meta, x, y}) => [meta, x, y])"
    )
    for name, factor in (("worn_volume", 1e9), ("wear_rate", 1e12)):
        (line,) = [each for each in course if each[0] == name]
        assert line[1] == dataset["cycle"].values.tolist()
        values = np.array(line[2]) / dataset[name].values.reshape(16, 5)[1]
        np.testing.assert_allclose(values, values[0], rtol=1e-6)
        assert np.log10(values[0] / factor) == pytest.approx(round(np.log10(values[0] / factor)), abs=1e-6)
    choose(page, "pair", 1)
    choose(page, "component", 2)
    (loop,) = page.execute_script(
        "return document.getElementById('loop-plot').data.filter(({meta}) => meta === 'loop').map(({x, y}) => [x, y])"
    )
    title = page.execute_script("return document.getElementById('loop-plot').layout.xaxis.title.text")
    assert title.startswith(("displacement along tangent 2", "displacement along the flank"))
    for name, shown in zip(("loop_displacement", "loop_force"), loop, strict=True):
        values = dataset[name].values.reshape(16, 5, 24, 16, 3)[1, 4, 5, :, 2]
        about = values - values.mean()
        np.testing.assert_allclose(shown, np.append(about, about[0]), rtol=1e-5, atol=1e-5 * np.ptp(values))


ONE = {"frequency": (190.0,), "wear_coefficient": (1e-11,), "scheme": ("implicit",), "sweep": ("up",)}
SCATTERED = np.random.default_rng(0).normal(size=(7, 3))

UNUSUAL: dict[str, dict[str, Any]] = {
    "one cycle, scattered pairs": {"cycles": (0.0,), "positions": SCATTERED, "surfaces": ["one"] * 7},
    "words only, most failed": {
        "axes": {**ONE, "harmonics": ("auto", "5"), "scheme": ("implicit", "explicit")},
        "failed": (1, 2, 3),
    },
    "nothing asked for": {"variables": ()},
}


@pytest.mark.parametrize("case", UNUSUAL)
def test_unusual_files_load_without_errors(browser, tmp_path, case):
    dataset = build_file(**UNUSUAL[case])
    load(browser, write(dataset, tmp_path))
    assert "frequency" in selected(browser) or "harmonics" in selected(browser)
    good = bool((dataset["outcome"] == 0).any())
    shown = browser.execute_script("return document.getElementById('map-plot').offsetParent !== null")
    assert shown == (good and "mean_pressure" in dataset)
    assert messages(browser) == []
