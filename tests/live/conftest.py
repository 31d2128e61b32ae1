"""Fixtures of the live page: its modules in a browser."""

import pytest
from in_live_page import modules


@pytest.fixture(scope="session")
def page(browser, tmp_path_factory):
    page, errors = modules(browser, tmp_path_factory.mktemp("live") / "static"), []
    page.on("pageerror", lambda error: errors.append(str(error)))
    yield page
    page.close()
    assert errors == []


@pytest.fixture(scope="session")
def starts(page):
    return page.evaluate("() => STARTS")
