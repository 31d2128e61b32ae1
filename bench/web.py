"""Latency of the page: `python -m bench.web [moves] [palm | own]`, in Debian's chromium without a
window; with `palm` that of its stiffness slider alone, by finite elements; with `own` CPU times
alone, without a browser.

From a key press on a slider to plots on the screen with the new response; the process's own share
of that, in CPU time, which other work on the machine disturbs little; and from opening a page to
its plots.
"""

import os
import re
import subprocess
import sys
import time
from typing import Any

import numpy as np
from trame.app import get_server

from skinwave.effort import THREADS
from skinwave.scene import BODIES
from skinwave.web import waves
from skinwave.web.controls import STARTS
from skinwave.web.layer_values import with_own_materials
from skinwave.web.memory import KEEPING
from skinwave.web.scenes import scene_of
from skinwave.web.serve import session_of
from skinwave.web.worker import limits

CHROMIUM = "/usr/bin/chromium"
ARGUMENTS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
PAGES = 5
LONGEST = 1800.0  # s that the palm's first waves may take on a busy machine
DRAWN = "() => window.trame?.utils?.plots?.shown?.spectrum_plot?.figure"
PRESSED = """async ([key, count, name]) => {
  const slider = document.querySelector(`.sw-row:has(#${key}-field) [role=slider]`);
  const plot = window.trame.utils.plots.shown.spectrum_plot, times = [];
  const shown = () => JSON.stringify((plot.figure.data.find(d => d.name === name) || {}).y);
  slider.focus();
  for (let k = 0; k < count; k++) {
    const before = shown(), start = performance.now();
    const done = new Promise(resolve => {
      const look = () => {
        const now = shown();
        if (now && now !== before) {
          plot.canvas.removeEventListener('drawn', look);
          requestAnimationFrame(() => setTimeout(() => resolve(performance.now() - start)));
        }
      };
      plot.canvas.addEventListener('drawn', look);
    });
    slider.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight', bubbles: true}));
    times.push(await done);
    await new Promise(resolve => setTimeout(resolve, 150));
  }
  return times }"""


def row(what: str, seconds: list[float]) -> None:
    median, high = 1e3 * np.percentile(seconds, [50, 95])
    print(f"{what:<52}{median:7.0f} ms {high:7.0f} ms {len(seconds):5d}", flush=True)


def own_share(moves: int) -> None:
    """CPU time of a move in the process behind a page, and of its waves in the other one."""
    server = get_server("bench", client_type="vue3")
    session = session_of(server)
    server.state.ready()
    for key, first in (("am", 100), ("height", 180)):
        spent = []
        for value in first + np.arange(moves):
            before = time.process_time()
            with server.state:
                server.state[key] = int(value)
            spent.append(time.process_time() - before)
        row(f"{key}: the process behind the page, CPU", spent)
    session.worker.close()
    answered = waves.BodyResponses()
    for key, first in (("am", 100), ("height", 180)):
        spent = []
        for value in first + np.arange(moves + 1):
            scene = scene_of(STARTS | {"body": "skin-slab", key: float(value)})
            before = time.process_time()
            answered(scene, lambda phase, done: None)
            spent.append(time.process_time() - before)
        row(f"{key}: waves of the slab, CPU", spent[1:])
        print(f"{'':<4}the first: {spent[0]:.2f} s")


def palms_share(moves: int) -> None:
    """CPU time of a move of the palm's modulus in the process that computes waves."""
    answered, own = waves.BodyResponses(), BODIES["palm"]
    spent = []
    for modulus in 26.0 + np.arange(moves + 1):
        layers = f"15/{modulus:g}"
        scene = scene_of(STARTS | {"body": "palm", "layers": layers})
        before = time.process_time()
        base = with_own_materials(own, layers)
        found = answered(scene, lambda phase, done: None, False, base)
        spent.append(time.process_time() - before)
    row("modulus: waves of the palm, CPU", spent[1:])
    effort = found.response.effort
    print(
        f"{'':<4}the first: {spent[0]:.1f} s, {effort.factorisations} factorisations, "
        f"{effort.dofs:,} dofs, {effort.reduced_dofs} left, estimate {effort.estimate:.1e}"
    )


def palm_in_a_browser(page: Any, address: str, moves: int) -> None:
    """Waiting times of a user of the palm's stiffness slider."""
    before = time.perf_counter()
    page.goto(address + "&body=palm")
    page.wait_for_function(
        "() => window.trame?.state?.get('wave_map')?.picture", timeout=LONGEST * 1e3
    )
    print(f"{'':<4}the palm's first waves: {time.perf_counter() - before:.1f} s", flush=True)
    page.evaluate("document.getElementById('layers').open = true")
    (first,) = page.evaluate(PRESSED, ["modulus-0", 1, "waves (fem), µm"])
    print(f"{'':<4}the first move of its modulus: {first / 1e3:.1f} s", flush=True)
    times = page.evaluate(PRESSED, ["modulus-0", moves, "waves (fem), µm"])
    row("modulus to waves of the palm", [t / 1e3 for t in times])


def in_a_browser(moves: int, palm: bool) -> None:
    """Waiting times of a user."""
    from playwright.sync_api import sync_playwright

    command = [sys.executable, "-m", "skinwave", "web", "--port", "0"]
    server = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert server.stderr is not None
    address = re.search(r"http://\S+", server.stderr.readline()).group()  # type: ignore[union-attr]
    try:
        with sync_playwright() as p:
            browser = p.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
            if palm:
                page = browser.new_page(viewport={"width": 1280, "height": 720})
                palm_in_a_browser(page, address, moves)
                return
            ready = []
            for _ in range(PAGES):
                time.sleep(9)  # the next session is made ready
                page = browser.new_page(viewport={"width": 1280, "height": 720})
                page.set_default_timeout(120_000)
                before = time.perf_counter()
                page.goto(address)
                page.wait_for_function(DRAWN)
                ready.append(time.perf_counter() - before)
                page.close()  # else its bands are computed beside what is measured
            row("page ready", ready)
            page = browser.new_page(viewport={"width": 1280, "height": 720})
            page.set_default_timeout(120_000)
            page.goto(address + "&body=none")
            page.wait_for_function(DRAWN)
            said = "kernel, same load, Pa"
            times = page.evaluate(PRESSED, ["am", moves, said])
            row("slider to plots, kernel alone", [t / 1e3 for t in times])
            page.goto(address + "&body=skin-slab")
            page.wait_for_function(
                "() => window.trame?.state?.get('wave_map')?.picture"
                " && window.trame.utils.plots.shown.spectrum_plot.figure"
            )
            times = page.evaluate(PRESSED, ["am", moves, "waves (flat-body), µm"])
            row("slider to waves of the slab", [t / 1e3 for t in times])
            times = page.evaluate(PRESSED, ["height", moves, "waves (flat-body), µm"])
            row("height to waves of the slab", [t / 1e3 for t in times])
            page.evaluate("document.getElementById('layers').open = true")
            times = page.evaluate(PRESSED, ["modulus-0", moves, "waves (flat-body), µm"])
            row("modulus of a layer to waves of the slab", [t / 1e3 for t in times])
            browser.close()
    finally:
        server.terminate()


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    of_palm, alone = sys.argv[2:] == ["palm"], sys.argv[2:] == ["own"]
    if os.environ.keys().isdisjoint(KEEPING):  # as the processes behind a page begin
        command = [sys.executable, "-m", "bench.web", *sys.argv[1:]]
        sys.exit(subprocess.run(command, env={**KEEPING, **limits(1), **os.environ}).returncode)
    sys.argv = sys.argv[:1]  # trame reads it
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} before")
    print(f"{'':<52}{'median':>10} {'95 %':>10} {'of':>5}")
    (palms_share if of_palm else own_share)(count)
    if not alone:
        for name in (*KEEPING, *THREADS):
            os.environ.pop(name, None)  # the server says its own
        in_a_browser(count, of_palm)
    print(f"load {os.getloadavg()[0]:.1f} after")
