"""Debian's browser without a display, and the live page that skinwave web serves."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partialmethod
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = "/usr/bin/chromium"
ARGUMENTS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
]  # fmt: skip
needs_browser = pytest.mark.skipif(
    not Path(CHROMIUM).exists(), reason="Debian's chromium is not installed"
)


@contextmanager
def chromium() -> Iterator[Any]:
    """A browser, as Playwright has it."""
    playwright = pytest.importorskip("playwright.sync_api")
    wait = playwright.Page.wait_for_function
    # By itself it looks with every frame, for which the browser draws sixty of them a second.
    playwright.Page.wait_for_function = partialmethod(wait, polling=50)
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()
    playwright.Page.wait_for_function = wait


def frames(page: Any, count: int) -> None:
    """Wait until a page has drawn so many frames."""
    page.evaluate(
        "count => new Promise(done => { const next = () => count-- ? requestAnimationFrame(next)"
        " : done(); next() })",
        count,
    )


def settled(page: Any) -> None:
    """Wait until a page has drawn what was changed, has its pictures and changes no style."""
    frames(page, 2)
    page.wait_for_function(
        "() => document.readyState === 'complete' && [...document.images].every(i => i.complete)"
        " && document.getAnimations().every(a => a.playState !== 'running'"
        " || a.effect.getComputedTiming().iterations === Infinity)"
    )


def served(*arguments: str) -> tuple[Any, str]:
    """A server in a process of its own, and its address."""
    command = [sys.executable, "-m", "skinwave", "web", "--no-browser", *arguments]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=dict(os.environ))
    assert process.stderr is not None
    said = []
    for line in process.stderr:
        said.append(line)
        if found := re.search(r"http://\S+", line):
            return process, found.group()
    raise AssertionError("".join(said))


def ended(process: Any) -> None:
    """End a server, which must say nothing of a fault."""
    process.terminate()
    said = process.communicate(timeout=600)[1]
    assert "Traceback" not in said, said
