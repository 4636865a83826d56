"""The page in a real headless browser without a network: the panel draws, a click picks, the root turns, no error."""

import shutil

import numpy as np
import pytest
from selenium import webdriver
from selenium.webdriver import ActionChains
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select
from selenium.webdriver.support.wait import WebDriverWait

from solver.outcome import Outcome
from studyrunner.report.page import write_page
from tests.studyrunner.report.cases import dovetail, dovetail_file, draw_figure
from tests.studyrunner.results import as_result, build_file, sample_file

CHROMIUM, DRIVER = (shutil.which(name) for name in ("chromium", "chromedriver"))
pytestmark = [
    pytest.mark.browser,
    pytest.mark.slow,
    pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="there is no chromium with its chromedriver"),
]
PATIENCE = 120.0  # s
EVIL = "</script><img src=x onerror='window.hurt=1'><script>window.hurt=2</script>"
FAILED = 5  # frequency 191 Hz, the first wear coefficient, explicit
ROOT = "document.getElementById('root')"
TRACES = """
const named = ["meta", "name", "x", "y", "z", "i", "intensity", "customdata"];
const plain = (values) => (typeof values === "string" ? values : Array.from(values));
return document.getElementById(arguments[0]).data.map((trace) => Object.fromEntries([
  ...named.filter((name) => trace[name]).map((name) => [name, plain(trace[name])]),
  ["bars", trace.error_y && Array.from(trace.error_y.array)],
]));"""
SLIDE = """
const slider = document.querySelector(`input[name='${arguments[0]}']`);
slider.value = String(arguments[1]);
slider.dispatchEvent(new Event("input"));
requestAnimationFrame(() => requestAnimationFrame(() => arguments[2]()));"""


@pytest.fixture(scope="module")
def browser():
    """A headless browser without a network, which is ended at last."""
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    # draws in three dimensions without a graphics card, and finds nothing on any network
    words = "headless=new no-sandbox disable-dev-shm-usage window-size=1400,1000 enable-unsafe-swiftshader"
    for argument in (*words.split(), "host-resolver-rules=MAP * ~NOTFOUND"):
        options.add_argument(f"--{argument}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    driver.set_script_timeout(PATIENCE)
    driver.set_page_load_timeout(PATIENCE)
    yield driver
    driver.quit()


def messages(browser):
    """What the browser has to say of the page, but for hints on the speed of drawing."""
    return [each for each in browser.get_log("browser") if each["source"] != "rendering"]


def write(dataset, folder, figures=()):
    """The address of a page with the figures of these names."""
    result = as_result(dataset, folder / "some.nc")
    write_page(result, [draw_figure(result, name) for name in figures], folder / "index.html")
    return (folder / "index.html").as_uri()


def load(browser, address):
    browser.get(address)
    assert messages(browser) == []
    assert drawn(browser)


def choose(page, name, value):
    Select(page.find_element(By.CSS_SELECTOR, f"select[name='{name}']")).select_by_value(value)


def slide(page, name, index):
    page.execute_async_script(SLIDE, name, index)


def drawn(page, plot="panel"):
    """The traces of a plot as plain lists."""
    return page.execute_script(TRACES, plot)


def text_of(page, element):
    return page.execute_script("return document.getElementById(arguments[0]).textContent", element)


def at(page, *names):
    """Places of sliders."""
    script = "return arguments[0].map((name) => Number(document.querySelector(`input[name='${name}']`).value))"
    return dict(zip(names, page.execute_script(script, names), strict=True))


@pytest.fixture(scope="module")
def dataset():
    """16 points of a dovetail, one of them failed; loops of two pairs; two responses; a hostile title and surface."""
    found = dovetail_file(failed=[FAILED], loops=[2, 5], responses=("tip", EVIL))
    found = found.assign_coords(contact_surface=("contact", [EVIL] * 8 + ["extrados"] * 8))
    found["worn_volume_error"][:] = 0.1
    return found.assign_attrs(title=EVIL)


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


def test_the_panel_draws_the_numbers_of_the_file_with_their_errors(page, dataset):
    place, found = at(page, "wear_coefficient", "cycle"), lines(page)
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
    own = at(page, "frequency", "wear_coefficient", "scheme")
    expected = dataset["wear_depth"].isel(own).squeeze().transpose("contact", "cycle").values
    values = np.array(heat["z"], dtype=float)
    np.testing.assert_allclose(values / values.max(), expected / expected.max(), rtol=1e-6)


def test_sliders_pick_the_point(page, dataset):
    for name, place in (("wear_coefficient", 0), ("frequency", 2), ("scheme", 1)):
        slide(page, name, place)
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


def test_the_root_is_coloured_and_worn_as_the_file_says_and_turns(page, dataset):
    choose(page, "root colour", "mean_pressure")
    pairs, _ = dovetail()
    nodes = np.stack([dataset[f"mesh_{axis}"].values for axis in "xyz"], axis=1)
    for cycle in (4, 0):
        slide(page, "cycle", cycle)
        point = at(page, "frequency", "wear_coefficient", "scheme", "cycle")
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
        shape = page.execute_script(f"return ['x', 'y', 'z'].map((axis) => Array.from({ROOT}.data[0][axis]))")
        way_in = np.einsum("ij,ij->i", nodes[used] - 1e-3 * np.array(shape).T[used], pairs.frames[pair, 0])
        np.testing.assert_allclose(np.abs(way_in), factor * depth, rtol=1e-2, atol=2e-8)
    camera = f"return {ROOT}._fullLayout.scene._scene.getCamera().eye"
    before, plot = page.execute_script(camera), page.find_element(By.ID, "root")
    page.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", plot)
    ActionChains(page).move_to_element(plot).click_and_hold().move_by_offset(120, 40).release().perform()
    WebDriverWait(page, PATIENCE).until(lambda _: page.execute_script(camera) != before)
    choose(page, "root view", "1")
    choose(page, "root shape", "")
    assert "times" not in text_of(page, "root-title")


def test_other_files_load_without_errors(browser, tmp_path):
    """Samples over what they draw; words only, most failed, one count, scattered pairs; one point without variables."""
    dataset = sample_file()
    load(browser, write(dataset, tmp_path))
    choose(browser, "x", "sample")
    choose(browser, "x", "sample_wear_coefficient")
    drawn_at = np.sort(dataset["sample_wear_coefficient"].values)
    np.testing.assert_allclose(drawn(browser)[0]["x"], drawn_at, rtol=1e-6)
    one = {"frequency": (190.0,), "wear_coefficient": (1e-11,), "scheme": ("implicit",), "sweep": ("up",)}
    words = {**one, "harmonics": ("auto", "5"), "scheme": ("implicit", "explicit")}
    scattered = {"positions": np.random.default_rng(0).normal(size=(7, 3)), "surfaces": ["one"] * 7}
    load(browser, write(build_file(words, (0.0,), (1, 2, 3), **scattered), tmp_path))
    load(browser, write(build_file(one, variables=()), tmp_path))
    assert messages(browser) == []
