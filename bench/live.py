"""Response times of the live page in chromium: from a key to pixels, and to a changed body.

A key moves a slider by one step. The time ends one frame after the spectrum has changed.
"""

import argparse
import re
import tempfile
import threading
import time
from pathlib import Path
from statistics import median, quantiles
from typing import Any

from playwright.sync_api import sync_playwright

from bench import table, timed
from skinwave.live.html_file import data_of, page
from skinwave.live.serve import Server

CHROMIUM = "/usr/bin/chromium"
SLIDERS = ("AM frequency", "Drawing speed", "Size")
# Milliseconds from a key until the spectrum has changed and is on the screen.
KEY = """async ({ label, down }) => {
  const slider = [...document.querySelectorAll("input[type=range]")].find((each) =>
    (each.getAttribute("aria-label") ?? each.labels?.[0]?.textContent ?? "").includes(label));
  const shown = () => document.querySelector("#spectrum").innerHTML;
  const drawn = shown(), began = performance.now();
  const frame = () => new Promise(requestAnimationFrame);
  if (down) slider.stepDown(); else slider.stepUp();
  slider.dispatchEvent(new Event("input", { bubbles: true }));
  slider.dispatchEvent(new Event("change", { bubbles: true }));
  while (shown() === drawn && performance.now() - began < 5000) await frame();
  await frame();
  return performance.now() - began;
}"""


def statistics(times: list[float]) -> tuple[str, str, str]:
    """Return median, 95th percentile and number of times in ms."""
    high = quantiles(times, n=20)[-1] if len(times) > 1 else times[0]
    return f"{median(times):.0f} ms", f"{high:.0f} ms", f"{len(times)}"


def opened(tab: Any, address: str) -> None:
    """Open a live page, and wait until it shows numbers."""
    tab.goto(address)
    tab.locator(".tile").first.wait_for()


def keys(tab: Any, count: int) -> dict[str, tuple[list[float], float]]:
    """Return the times of keys on each slider, and the CPU time in ms of the page per key."""
    session = tab.context.new_cdp_session(tab)
    session.send("Performance.enable", {"timeDomain": "threadTicks"})

    def spent() -> float:
        metrics = session.send("Performance.getMetrics")["metrics"]
        return 1e3 * next(each["value"] for each in metrics if each["name"] == "TaskDuration")

    found = {}
    for label in SLIDERS:
        before = spent()
        times = [tab.evaluate(KEY, {"label": label, "down": k % 2 == 1}) for k in range(count)]
        found[label] = times, (spent() - before) / count
    return found


def body_changes(tab: Any, count: int) -> list[float]:
    """Return times in ms from a change of the first modulus until the page is up to date."""
    tab.locator("summary", has_text="Layers").click()
    slider = tab.get_by_role("slider", name=re.compile("modulus", re.IGNORECASE)).first
    found = []
    for k in range(count):
        slider.focus()
        began = time.perf_counter()
        slider.press("ArrowLeft" if k % 2 else "ArrowRight")
        tab.locator("#page.stale").wait_for()
        tab.locator("#page:not(.stale)").wait_for()
        found.append(1e3 * (time.perf_counter() - began))
    return found


def main(count: int, bodies: list[str]) -> None:
    """Measure and print the times."""
    row = table("", "median", "95 %", "of", "CPU")
    with sync_playwright() as driver, tempfile.TemporaryDirectory() as folder:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        for body in bodies:
            data = data_of(bodies=[body], tests=1)
            file = Path(folder, f"{body}.html")
            file.write_text(page(data), encoding="utf-8")
            tab = browser.new_page(viewport={"width": 1280, "height": 800})
            row(
                f"{body}: page ready", *statistics([1e3 * timed(opened, tab, file.as_uri())[1]]), ""
            )
            for label, (times, cpu) in keys(tab, count).items():
                row(f"{body}: {label}, key to pixels", *statistics(times), f"{cpu:.0f} ms")
            with Server() as server:
                server.show(data)
                threading.Thread(target=server.serve_forever, daemon=True).start()
                opened(tab, server.address)
                times = body_changes(tab, count // 2)
                row(f"{body}: change of modulus", *statistics(times), "")
                server.shutdown()
            tab.close()
        browser.close()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, prog="python -m bench.live")
    parser.add_argument("count", type=int, nargs="?", default=20, help="number of keys")
    parser.add_argument("bodies", nargs="*", default=["skin-slab", "paper-sheet"])
    main(**vars(parser.parse_args()))
