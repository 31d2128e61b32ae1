"""Fixtures of the live page: its modules in a browser."""

import pytest
from in_live_page import modules


@pytest.fixture(scope="session")
def page(browser, tmp_path_factory):
    """A page with the functions of the modules, without errors in its scripts."""
    page, errors = modules(browser, tmp_path_factory.mktemp("live") / "static"), []
    page.on("pageerror", lambda error: errors.append(str(error)))
    yield page
    page.close()
    assert errors == []


@pytest.fixture(scope="session")
def starts(page):
    """Initial values of the controls."""
    return page.evaluate("() => STARTS")
