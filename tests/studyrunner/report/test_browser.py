"""The page in a real headless browser without a network: the panel draws, a click picks, the root turns, no error."""

import numpy as np
import pytest
from selenium.webdriver import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.support.wait import WebDriverWait

from solver.outcome import Outcome
from tests.studyrunner.report.browsing import (
    DESKTOP,
    MARKS,
    PATIENCE,
    PHONE,
    choose,
    click_at,
    drawn,
    load,
    messages,
    slide,
    text_of,
    write,
)
from tests.studyrunner.report.root_cases import dovetail_file, dovetail_pairs
from tests.studyrunner.results import build_file, sample_file

pytestmark = MARKS
EVIL = "</script><img src=x onerror='window.hurt=1'><script>window.hurt=2</script>"
FAILED = 5  # frequency 191 Hz, the first wear coefficient, explicit
ROOT = "document.getElementById('root')"


@pytest.fixture(scope="module")
def dataset():
    """16 points of a dovetail, one of them failed; loops of two pairs; two responses; a hostile title and surface."""
    found = dovetail_file(failed=[FAILED], loops=[2, 5], responses=("tip", EVIL))
    found = found.assign_coords(contact_surface=("contact", [EVIL] * 8 + ["extrados"] * 8))
    found["worn_volume_error"][:] = 0.1
    found.attrs["title"] = EVIL
    return found


@pytest.fixture(scope="module")
def address(dataset, tmp_path_factory):
    return write(dataset, tmp_path_factory.mktemp("page"), ["wear_depth"])


@pytest.fixture
def page(browser, address):
    """The page as it looks at first, without errors to the end."""
    load(browser, address)
    yield browser
    assert messages(browser) == []
    assert not browser.execute_script("return window.hurt")


def lines(page):
    return {trace["name"]: trace for trace in drawn(page) if trace.get("meta") == "line"}


def at(page, name):
    return int(page.execute_script(f"return document.querySelector(\"input[name='{name}']\").value"))


def test_the_panel_draws_the_numbers_of_the_file_with_their_errors(page, dataset):
    place = {name: at(page, name) for name in ("wear_coefficient", "cycle")}
    found = lines(page)
    for scheme in ("implicit", "explicit"):
        worn = dataset["worn_volume"].sel(scheme=scheme).isel(place).squeeze().values
        known = np.isfinite(worn)
        np.testing.assert_array_equal(found[scheme]["x"], dataset["frequency"])
        values = np.array(found[scheme]["y"], dtype=float)
        factor = values[known][0] / worn[known][0]
        np.testing.assert_allclose(values[known], factor * worn[known], rtol=1e-6)
        np.testing.assert_allclose(np.array(found[scheme]["bars"])[known], 0.1 * values[known], rtol=1e-6)
    # of many colours there is a map; its own dimension is no colour
    choose(page, "variable", "wear_depth")
    choose(page, "x", "contact")
    choose(page, "colour", "frequency")
    assert len(lines(page)) == 4
    choose(page, "x", "cycle")
    choose(page, "colour", "contact")
    (heat,) = [trace for trace in drawn(page) if trace.get("meta") == "map"]
    own = {name: at(page, name) for name in ("frequency", "wear_coefficient", "scheme")}
    expected = dataset["wear_depth"].isel(own).squeeze().transpose("contact", "cycle").values
    values = np.array(heat["z"], dtype=float)
    np.testing.assert_allclose(values / values.max(), expected / expected.max(), rtol=1e-6)


def test_a_click_and_a_slider_pick_the_point(page, dataset):
    slide(page, "wear_coefficient", 0)
    click_at(page, 2, 1)
    WebDriverWait(page, PATIENCE).until(lambda _: "scheme explicit" in text_of(page, "picked"))
    assert (at(page, "frequency"), at(page, "scheme")) == (2, 1)
    picked = text_of(page, "picked").replace("\u00a0", " ")
    assert picked.startswith("frequency 192.5 Hz, wear coefficient 1e-11 1/Pa, scheme explicit: ")
    script = "return document.querySelector(\"[data-name='run_time'] dd\").textContent"
    shown = float(page.execute_script(script).split("\u00a0")[0])
    assert shown == pytest.approx(dataset["run_time"].values[2, 0, 0, 0, 1, 0], rel=1e-3)
    slide(page, "frequency", 1)
    assert Outcome.MARCH_FAILED.sentence in text_of(page, "picked")


def test_every_variable_is_drawn_and_over_every_dimension(page):
    options = "return [...document.querySelector('select[name=x]').options].map((each) => each.value)"
    for variable in page.execute_script("return data.variables.map(({ name }) => name)"):
        choose(page, "variable", variable)
        for name in page.execute_script(options) if variable in ("outcome", "wear_depth", "loop_force") else ():
            choose(page, "x", name)
        assert drawn(page)
    assert messages(page) == []


def test_the_root_is_coloured_and_worn_as_the_file_says_and_turns(page, dataset):
    choose(page, "root colour", "mean_pressure")
    pairs = dovetail_pairs()
    nodes = np.stack([dataset[f"mesh_{axis}"].values for axis in "xyz"], axis=1)
    for cycle in (4, 0):
        slide(page, "cycle", cycle)
        point = {name: at(page, name) for name in ("frequency", "wear_coefficient", "scheme", "cycle")}
        (contact,) = [trace for trace in drawn(page, "root") if trace.get("meta") == "contact"]
        used = np.unique(contact["i"]).astype(int)
        way = np.linalg.norm(nodes[used][:, None] - pairs.position, axis=2)
        assert way.min(axis=1).max() < 1e-9
        pair = way.argmin(axis=1)
        expected = dataset["mean_pressure"].isel(point).squeeze().values[pair]
        values = np.array(contact["intensity"])[used]
        np.testing.assert_allclose(values / values.max(), expected / expected.max(), rtol=1e-5)
        factor = float(text_of(page, "root-title").split("wear drawn ")[1].split(" times")[0])
        depth = dataset["wear_depth"].isel(point).squeeze().values[pair]
        places = np.stack(
            [np.array(page.execute_script(f"return Array.from({ROOT}.data[0].{a})"))[used] for a in "xyz"]
        )
        way_in = np.einsum("ij,ij->i", nodes[used] - 1e-3 * places.T, pairs.frames[pair, 0])
        np.testing.assert_allclose(np.abs(way_in), factor * depth, rtol=1e-2, atol=2e-8)
    camera = f"return {ROOT}._fullLayout.scene._scene.getCamera().eye"
    before = page.execute_script(camera)
    plot = page.find_element(By.ID, "root")
    page.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", plot)
    ActionChains(page).move_to_element(plot).click_and_hold().move_by_offset(120, 40).release().perform()
    WebDriverWait(page, PATIENCE).until(lambda _: page.execute_script(camera) != before)
    choose(page, "root view", "1")
    choose(page, "root shape", "")
    assert "times" not in text_of(page, "root-title")


def test_samples_stand_over_what_they_draw(browser, tmp_path):
    dataset = sample_file()
    load(browser, write(dataset, tmp_path))
    choose(browser, "x", "sample")
    choose(browser, "x", "sample_wear_coefficient")
    trace = drawn(browser)[0]
    np.testing.assert_allclose(trace["x"], np.sort(dataset["sample_wear_coefficient"].values), rtol=1e-6)
    assert messages(browser) == []


def test_the_page_fits_a_phone_and_follows_the_dark_mode(browser, address):
    try:
        browser.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": PHONE[0], "height": PHONE[1], "deviceScaleFactor": 1, "mobile": True},
        )
        dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
        load(browser, address)
        assert browser.execute_script("return document.documentElement.scrollWidth") <= PHONE[0]
        shown = "return [...document.querySelectorAll('figure > div')].map((each) => each.getClientRects().length)"
        assert browser.execute_script(shown) == [0, 1]
        assert browser.execute_script("return getComputedStyle(document.body).backgroundColor") == "rgb(24, 24, 24)"
        assert browser.execute_script("return document.getElementById('panel').layout.paper_bgcolor") == "#181818"
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
        browser.set_window_size(*DESKTOP)


ONE = {"frequency": (190.0,), "wear_coefficient": (1e-11,), "scheme": ("implicit",), "sweep": ("up",)}
UNUSUAL = {
    "words only, most failed, one count, scattered pairs": {
        "axes": {**ONE, "harmonics": ("auto", "5"), "scheme": ("implicit", "explicit")},
        "failed": (1, 2, 3),
        "cycles": (0.0,),
        "positions": np.random.default_rng(0).normal(size=(7, 3)),
        "surfaces": ["one"] * 7,
    },
    "one point, nothing asked for": {"axes": ONE, "variables": ()},
}


@pytest.mark.parametrize("case", UNUSUAL)
def test_unusual_files_load_without_errors(browser, tmp_path, case):
    load(browser, write(build_file(**UNUSUAL[case]), tmp_path))
    assert messages(browser) == []
