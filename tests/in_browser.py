"""Chromium without a display, and the server skinwave web."""

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
    playwright = pytest.importorskip("playwright.sync_api")
    wait = playwright.Page.wait_for_function
    # By default it checks in every frame, which makes the browser draw 60 frames a second.
    playwright.Page.wait_for_function = partialmethod(wait, polling=50)
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()
    playwright.Page.wait_for_function = wait


def frames(page: Any, count: int) -> None:
    page.evaluate(
        "count => new Promise(done => { const next = () => count-- ? requestAnimationFrame(next)"
        " : done(); next() })",
        count,
    )


def settled(page: Any) -> None:
    """Wait until a page has drawn its changes and pictures, and no animation runs."""
    frames(page, 2)
    page.wait_for_function(
        "() => document.readyState === 'complete' && [...document.images].every(i => i.complete)"
        " && document.getAnimations().every(a => a.playState !== 'running'"
        " || a.effect.getComputedTiming().iterations === Infinity)"
    )


def start_server(*arguments: str) -> tuple[Any, str]:
    """Start a server in its own process; return the process and the address."""
    command = [sys.executable, "-m", "skinwave", "web", "--no-browser", *arguments]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=dict(os.environ))
    assert process.stderr is not None
    lines = []
    for line in process.stderr:
        lines.append(line)
        if found := re.search(r"http://\S+", line):
            return process, found.group()
    raise AssertionError("".join(lines))


def end_server(process: Any) -> None:
    process.terminate()
    printed = process.communicate(timeout=600)[1]
    assert "Traceback" not in printed, printed
