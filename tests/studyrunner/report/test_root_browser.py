"""The root in three dimensions in a headless browser: colours, worn shape, view, rotation, slider, points, play."""

from typing import Any

import numpy as np
import pytest
from selenium.webdriver import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.wait import WebDriverWait

from tests.studyrunner.report.browsing import FACTORS, MARKS, PATIENCE, choose, load, messages, press, write
from tests.studyrunner.report.page_cases import build_file
from tests.studyrunner.report.root_cases import dovetail_file, dovetail_pairs
from tests.studyrunner.report.test_browser import shown_point

pytestmark = MARKS

PLOT = "document.getElementById('root-plot')"
CAMERA = f"return {PLOT}._fullLayout.scene._scene.getCamera()"


@pytest.fixture(scope="module")
def dataset():
    return dovetail_file(failed=[5])


@pytest.fixture(scope="module")
def page(browser, dataset, tmp_path_factory):
    load(browser, write(dataset, tmp_path_factory.mktemp("root")))
    return browser


@pytest.fixture(autouse=True)
def clean(page):

    for name in ("root colour", "root view", "root shape"):
        choose(page, name, 1 if name == "root colour" else 0)
    press(page, Keys.END)
    yield
    assert messages(page) == []


def trace(page, meta):
    script = f"""
    const found = {PLOT}.data.find((each) => each.meta === arguments[0]);
    const lists = ["x", "y", "z", "i", "j", "k", "intensity"].map((name) => [name, Array.from(found[name] || [])]);
    return {{ ...Object.fromEntries(lists), opacity: found.opacity, visible: found.visible }};
    """
    found: dict[str, Any] = page.execute_script(script, meta)
    return found


def assert_root_is(page, dataset, name, point, cycle):
    """Colours and worn shape are those of the file at a point and a cycle; the factor is the one that is told."""
    contact, pairs = trace(page, "contact"), dovetail_pairs()
    unit = page.execute_script(f"return {PLOT}.layout.coloraxis.colorbar.title.text")
    nodes = np.stack([dataset[f"mesh_{axis}"].values for axis in "xyz"], axis=1)
    at = [int(each) for each in np.unique([contact["i"], contact["j"], contact["k"]])]
    way = np.linalg.norm(nodes[at][:, None] - pairs.position, axis=2)
    assert way.min(axis=1).max() < 1e-9
    pair = way.argmin(axis=1)
    values = dataset[name].values.reshape(16, 5, -1)[point, cycle, pair]
    np.testing.assert_allclose(np.array(contact["intensity"])[at], values * FACTORS[unit], rtol=1e-5)
    factor = float(page.execute_script(f"return {PLOT}.dataset.factor"))
    depth = dataset["wear_depth"].values.reshape(16, 5, -1)[point, cycle, pair]
    places = np.stack([np.array(contact[axis])[at] for axis in "xyz"], axis=1) * 1e-3
    way_in = np.einsum("ij,ij->i", nodes[at] - places, pairs.frames[pair, 0])
    np.testing.assert_allclose(np.abs(way_in), factor * depth, rtol=1e-2, atol=2e-8)  # of 32 bit places
    title = page.execute_script("return document.getElementById('root-title').textContent")
    assert f"exaggerated {factor:g} times" in title.replace("\u00a0", "")


def pixels(page):

    picture: bytes = page.find_element(By.ID, "root-plot").screenshot_as_png
    return picture


def test_the_root_begins_as_the_shown_point_after_wear(page, dataset):
    assert_root_is(page, dataset, "wear_depth", shown_point(dataset), 4)
    # beside the pairs at z < 0
    assert 1.2 < trace(page, "leading")["z"][0] / (1e3 * dataset["contact_z"].values.min()) < 1.4


def test_the_menu_changes_what_colours_the_root(page, dataset):
    for place, name in enumerate(["mean_pressure", "wear_depth", "open_fraction", "slip_range"]):
        choose(page, "root colour", place)
        assert_root_is(page, dataset, name, shown_point(dataset), 4)


def test_a_drag_of_the_mouse_rotates_and_the_slider_keeps_it(page):

    plot = page.find_element(By.ID, "root-plot")
    page.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", plot)
    page.execute_async_script("setTimeout(arguments[0], 300)")
    before, picture = page.execute_script(CAMERA), pixels(page)
    mouse = ActionChains(page).move_to_element(plot).click_and_hold()
    for _ in range(6):
        mouse = mouse.move_by_offset(30, 8).pause(0.05)
    mouse.release().perform()
    page.execute_async_script("setTimeout(arguments[0], 500)")
    after = page.execute_script(CAMERA)
    eyes = [np.array([camera["eye"][axis] for axis in "xyz"]) for camera in (before, after)]
    assert np.linalg.norm(eyes[1] - eyes[0]) > 0.3
    # turned, not zoomed
    assert np.linalg.norm(eyes[1]) == pytest.approx(np.linalg.norm(eyes[0]), rel=0.02)
    assert pixels(page) != picture
    press(page, Keys.ARROW_LEFT)
    kept = page.execute_script(CAMERA)
    assert [kept["eye"][axis] for axis in "xyz"] == pytest.approx(eyes[1].tolist(), abs=1e-3)


def test_play_runs_through_the_cycles_and_stops_at_the_last(page):

    page.execute_script(
        """
        window.turned = [];
        const count = document.getElementById("cycle-count");
        new MutationObserver(() => window.turned.push(state.cycle)).observe(count, { childList: true });
        window.labels = [];
        const play = document.getElementById("play");
        new MutationObserver(() => window.labels.push(play.textContent)).observe(play, { childList: true });
        """
    )
    button = page.find_element(By.ID, "play")
    assert button.text == "Play"
    button.click()
    # a slow machine may see the end only
    said = WebDriverWait(page, PATIENCE, poll_frequency=0.1).until(
        lambda _: page.execute_script("return window.labels.length > 1 && window.labels")
    )
    assert said == ["Pause", "Play"]
    assert page.execute_script("return window.turned") == [0, 1, 2, 3, 4]
    # both clicks at once: a slow machine would show all cycles between them
    page.execute_script("arguments[0].click(); arguments[0].click()", button)
    assert button.text == "Play"
    stopped = page.execute_script("return state.cycle")
    page.execute_async_script("setTimeout(arguments[0], 600)")
    assert page.execute_script("return state.cycle") == stopped


def test_a_browser_without_webgl_says_so(browser, tmp_path):
    address = browser.current_url
    patch = """
    const getContext = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
      return kind.includes("webgl") ? null : getContext.call(this, kind, ...more);
    };
    """
    done = browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": patch})
    try:
        load(browser, write(build_file(), tmp_path))
        assert "no WebGL" in browser.execute_script("return document.getElementById('root-hint').textContent")
        assert browser.execute_script(f"return {PLOT}.hidden")
        assert browser.execute_script("return document.getElementById('map-plot').data.length") > 0
    finally:
        browser.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", done)
        load(browser, address)
