"""What the tests of the page do in a browser, and what they see."""

import re
import shutil

import numpy as np
import pytest
from selenium import webdriver
from selenium.webdriver import ActionChains
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select
from selenium.webdriver.support.wait import WebDriverWait

from studyrunner.report.page.page import write_page
from tests.studyrunner.report.page_cases import as_result

CHROMIUM, DRIVER = (shutil.which(name) for name in ("chromium", "chromedriver"))
MARKS = [
    pytest.mark.browser,
    pytest.mark.slow,
    pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="there is no chromium with its chromedriver"),
]
FACTORS = {"mm": 1e3, "µm": 1e6, "nm": 1e9, "mm³": 1e9, "µm³": 1e18, "mm³ per kcycle": 1e12, "kPa": 1e-3, "Pa": 1.0}
FACTORS |= {"%": 100.0, "mPa": 1e3, "mN": 1e3, "m": 1.0, "N": 1.0, "mm³ per cycle": 1e9, "µm³ per cycle": 1e18, "": 1.0}
DESKTOP, PHONE = (1400, 1000), (400, 800)
PATIENCE = 120.0  # s


def start_browser():
    """A headless browser without a network, which is ended at last."""
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    size = f"--window-size={DESKTOP[0]},{DESKTOP[1]}"
    # draws in three dimensions without a graphics card, and finds nothing on any network
    drawn, apart = "--enable-unsafe-swiftshader", "--host-resolver-rules=MAP * ~NOTFOUND"
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", apart, drawn, size):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    driver.set_script_timeout(PATIENCE)
    driver.set_page_load_timeout(PATIENCE)
    yield driver
    driver.quit()


def messages(browser):
    """What the browser has to say of the page, but for hints on the speed of drawing."""
    return [each for each in browser.get_log("browser") if each["source"] != "rendering"]


def write(dataset, folder):
    write_page(as_result(dataset, folder / "some.nc"), [], folder / "index.html")
    return (folder / "index.html").as_uri()


def load(browser, address):
    browser.get(address)
    assert messages(browser) == []
    assert browser.execute_script("return document.getElementById('explore-failed').hidden")
    assert not browser.execute_script("return document.getElementById('explore').hidden")


def map_values(page):
    script = "return document.getElementById('map-plot').data.map(trace => trace.z)"
    found: list[list[list[float]]] = page.execute_script(script)
    return found


def map_pairs(page):
    script = "return document.getElementById('map-plot').data.map(trace => trace.customdata)"
    found: list[list[list[int]]] = page.execute_script(script)
    return found


def numbers(page):
    """The list beside the plots, back in the units of the file."""
    rows = "[...document.querySelectorAll('#readout div')]"
    found = {}
    for name, text in page.execute_script(f"return {rows}.map(row => [row.dataset.name, row.children[1].title])"):
        number, unit = re.fullmatch(r"(\S+?)(?:\s(.*))?", re.sub(r"(?<=\d)\s(?=\d{3}\b)", "", text)).groups()  # type: ignore[union-attr]
        try:
            found[name] = float(number) / FACTORS.get(unit or "", 1.0)
        except ValueError:
            found[name] = np.nan
    return found


def choose(page, name, index):
    Select(page.find_element(By.CSS_SELECTOR, f"select[name='{name}']")).select_by_index(index)


def press(page, *keys):
    page.find_element(By.ID, "cycle").send_keys(*keys)
    wait_for_frame(page)


def wait_for_frame(page):
    page.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(() => arguments[0]()))")


def click_at(page, point, name="response-plot", meta=None):
    """A press of the mouse on the pixel at which a plot, or its trace `meta`, shows a point; picked afterwards."""
    script = """
    const [plot, meta, point] = arguments;
    plot.scrollIntoView({block: "center", behavior: "instant"});
    const box = plot.getBoundingClientRect(), { xaxis, yaxis } = plot._fullLayout;
    for (const trace of plot.data) {
      if (!trace.customdata || (meta && trace.meta !== meta)) continue;
      const rows = trace.z ? trace.customdata : [trace.customdata];
      const row = rows.findIndex((each) => each.includes(point));
      if (row < 0) continue;
      const at = rows[row].indexOf(point);
      const [x, y] = trace.z ? [at, row] : [trace.x[at], trace.y[at]];
      if (!Number.isFinite(yaxis.d2p(y))) continue;
      return [xaxis._offset + xaxis.d2p(x) - box.width / 2, yaxis._offset + yaxis.d2p(y) - box.height / 2];
    }"""
    plot = page.find_element(By.ID, name)
    # behind the listener of the page
    listen = 'plot.on("plotly_click", (event) => { plot.clicked = event.points[0].customdata; })'
    page.execute_script(f"const plot = arguments[0]; plot.clicked = null; plot.listens ??= {listen};", plot)

    def hover(_):
        # a click is one on what the plot has found under the mouse before, which it does in its own time
        x, y = page.execute_script(script, plot, meta, point)
        actions = ActionChains(page).move_to_element_with_offset(plot, round(x) - 3, round(y) + 2)
        actions.move_by_offset(3, -2).perform()
        wait_for_frame(page)
        found = page.execute_script("return (arguments[0]._hoverdata || []).map((each) => each.customdata)", plot)
        return point in found

    wait = WebDriverWait(page, PATIENCE, poll_frequency=0.1)
    wait.until(hover)
    ActionChains(page).click().perform()
    wait.until(lambda _: page.execute_script("return arguments[0].clicked", plot) == point)


def selected(page):
    text: str = page.execute_script("return document.getElementById('selected').textContent")
    return text
