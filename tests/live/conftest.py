"""Fixtures of the live page: its modules in a browser."""

import pytest
from in_live_page import modules


@pytest.fixture(scope="session")
def page(browser, tmp_path_factory):
    """A page with the functions of the modules, shared by all tests; nothing may fail in it."""
    found, said = modules(browser, tmp_path_factory.mktemp("live") / "static"), []
    found.on("pageerror", lambda error: said.append(str(error)))
    yield found
    found.close()
    assert said == []


@pytest.fixture(scope="session")
def starts(page):
    """Values of the controls at the start."""
    return page.evaluate("() => STARTS")
