"""What the tests of the page do in a browser, and what they see."""

import shutil
from typing import Any

import pytest
from selenium import webdriver
from selenium.webdriver import ActionChains
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select
from selenium.webdriver.support.wait import WebDriverWait

from studyrunner.report.page.page import write_page
from tests.studyrunner.report.figure_numbers import draw_figure
from tests.studyrunner.results import as_result

CHROMIUM, DRIVER = (shutil.which(name) for name in ("chromium", "chromedriver"))
MARKS = [
    pytest.mark.browser,
    pytest.mark.slow,
    pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="there is no chromium with its chromedriver"),
]
DESKTOP, PHONE = (1400, 1000), (420, 800)
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
    """Move a slider to a place."""
    script = """
    const slider = document.querySelector(`input[name='${arguments[0]}']`);
    slider.value = String(arguments[1]);
    slider.dispatchEvent(new Event("input"));
    requestAnimationFrame(() => requestAnimationFrame(() => arguments[2]()));"""
    page.execute_async_script(script, name, index)


def drawn(page, plot="panel"):
    """The traces of a plot as plain lists."""
    script = """
    const held = ["meta", "name", "x", "y", "z", "i", "intensity", "customdata"];
    const plain = (values) => (typeof values === "string" ? values : Array.from(values));
    return document.getElementById(arguments[0]).data.map((trace) => Object.fromEntries([
      ...held.filter((name) => trace[name]).map((name) => [name, plain(trace[name])]),
      ["bars", trace.error_y && Array.from(trace.error_y.array)],
    ]));"""
    found: list[dict[str, Any]] = page.execute_script(script, plot)
    return found


def click_at(page, index, colour):
    """A press of the mouse on the pixel at which the panel shows a value; picked afterwards."""
    script = """
    const [plot, index, colour] = arguments;
    plot.scrollIntoView({block: "center", behavior: "instant"});
    const box = plot.getBoundingClientRect(), { xaxis, yaxis } = plot._fullLayout;
    const trace = plot.data.find((each) => each.customdata && each.customdata[0][1] === colour);
    const at = trace.customdata.findIndex((each) => each[0] === index);
    const [x, y] = [xaxis._offset + xaxis.d2p(trace.x[at]), yaxis._offset + yaxis.d2p(trace.y[at])];
    return [x - box.width / 2, y - box.height / 2];"""
    plot = page.find_element(By.ID, "panel")

    def hover(_):
        # a click is one on what the plot has found under the mouse before, which it does in its own time
        x, y = page.execute_script(script, plot, index, colour)
        ActionChains(page).move_to_element_with_offset(plot, round(x) - 3, round(y) + 2).move_by_offset(3, -2).perform()
        found = page.execute_script("return (arguments[0]._hoverdata || []).map((each) => each.customdata)", plot)
        return [index, colour] in found

    WebDriverWait(page, PATIENCE, poll_frequency=0.1).until(hover)
    ActionChains(page).click().perform()


def text_of(page, element):
    text: str = page.execute_script("return document.getElementById(arguments[0]).textContent", element)
    return text
