"""A headless browser for all tests of the page."""

import pytest


@pytest.fixture(scope="package")
def browser():
    from tests.studyrunner.report.browsing import start_browser

    yield from start_browser()
