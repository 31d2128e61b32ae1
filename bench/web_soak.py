"""Soak test of the page: `python -m bench.web_soak [seconds] [seed] [bodies]`.

Two browsers at random: whatever can be turned, clicked, opened or saved, in any order. Every body
is built first, as often as is cached, which a busy machine takes minutes for: "none,skin-slab" does
without. Counted: errors on either page's console or of the server, and by how much memory has grown
between the end of the first fifth and the end.
"""

import os
import random
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from bench.web import ARGUMENTS, CHROMIUM, DRAWN
from bench.web_moves import MOVES, body
from skinwave.web.controls import CHOICES, OWN_BODY
from skinwave.web.front import LATER
from skinwave.web.waves import KEPT

WARM = 0.2  # of the time
OFTEN = 5  # in about a hundred moves another body
PATIENCE = 60_000  # ms; a page that is not ready by then has failed
BUILT = 600_000  # ms in which a body is built, whatever else the machine does
MOST = 50.0  # MB of growth
COMMAND = [sys.executable, "-m", "skinwave", "web", "--port", "0"]
Page = Any


def family(pid: int) -> list[int]:
    """A process and all that it has started."""
    children: dict[int, list[int]] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        children.setdefault(parent, []).append(int(folder.name))
    found = [pid]
    for each in found:
        found += children.get(each, [])
    return found


def read(path: str) -> bytes:
    """Contents of a file of /proc; none if its process has ended."""
    try:
        return Path(path).read_bytes()
    except OSError:
        return b""


def held(pid: int) -> float:
    """MB that a process holds of its own; shared pages count once."""
    found = re.search(rb"^Pss:\s+(\d+)", read(f"/proc/{pid}/smaps_rollup"), re.M)
    return int(found[1]) / 1024 if found else 0.0


def heap(page: Page) -> float:
    """Memory in MB of a page's scripts, after garbage collection."""
    client = page.context.new_cdp_session(page)
    client.send("HeapProfiler.collectGarbage")
    used = client.send("Runtime.getHeapUsage")["usedSize"]
    client.detach()
    return float(used) / 2**20


def settled(page: Page) -> None:
    """Wait until nothing is computed, and go where it can be compared."""
    page.keyboard.press("Escape")
    page.evaluate("() => window.trame.trigger('restart', ['body=skin-slab'])")
    page.wait_for_function("() => !window.trame.state.get('waves_stale')", timeout=BUILT)


def warm(pages: list[Page], bodies: Sequence[str]) -> None:
    """Have the processes behind pages build each body as often as they cache it."""
    for name in (name for name in bodies if name != "none"):
        for k in range(KEPT):
            query = f"body={name}&size={10 + 2 * k}&height={200 + 5 * k}"
            for page in pages:
                page.evaluate("q => window.trame.trigger('restart', [q])", query)
            for page in pages:  # the body that it opens with is not in its query
                page.wait_for_function(
                    "([body, size]) => window.trame.state.get('body') === body"
                    " && window.trame.state.get('size') === size"
                    " && !window.trame.state.get('waves_stale')",
                    arg=[name, 10 + 2 * k], timeout=BUILT,
                )  # fmt: skip


def soak(seconds: float, seed: int, bodies: Sequence[str]) -> bool:
    """Whether nothing went wrong."""
    errors = list[str]()
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, "log")
        with open(log, "w") as said:
            server = subprocess.Popen(COMMAND, stderr=said)
        try:
            sizes = turned(server.pid, _address(log), seconds, random.Random(seed), errors, bodies)
        finally:
            server.terminate()
            server.wait(20)
        lines = log.read_text().splitlines()[1:]
    grown = [after - before for before, after in zip(*sizes, strict=True)]
    counted = f"{len(errors)} errors on pages, {len(lines)} lines of the server"
    pages = " and ".join(f"{each:+.1f}" for each in grown[1:])
    print(f"grown by {grown[0]:+.0f} MB in the server, {pages} MB in the pages; {counted}")
    for line in [*errors[:20], *lines[:40]]:
        print(f"    {line}")
    return not errors and not lines and sum(grown) < MOST


def turned(
    server: int,
    address: str,
    seconds: float,
    rng: random.Random,
    errors: list[str],
    bodies: Sequence[str],
) -> list[list[float]]:
    """Memory in MB of server and pages after a part of the time, and after all of it."""
    from playwright.sync_api import sync_playwright

    made, sizes = Counter[str](), list[list[float]]()
    with sync_playwright() as p:
        browser = p.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        pages = [_opened(browser, address, errors) for _ in range(2)]
        warm(pages, bodies)
        start = time.monotonic()
        print(f"bodies built; load {os.getloadavg()[0]:.1f}", flush=True)
        for end in (WARM * seconds, seconds):
            while time.monotonic() - start < end:
                made[_moved(rng.choice(pages), rng, errors, bodies)] += 1
            for page in pages:
                settled(page)
            time.sleep(LATER + 3)  # the process that waits for the next page is ready
            sizes.append([sum(map(held, family(server))), *map(heap, pages)])
            print(f"{time.monotonic() - start:5.0f} s, {sum(made.values())} moves: server "
                  f"{sizes[-1][0]:.0f} MB, pages {sizes[-1][1]:.1f} and {sizes[-1][2]:.1f} MB",
                  flush=True)  # fmt: skip
        browser.close()
    print(f"moves: {dict(made)}")
    return sizes


def _moved(page: Page, rng: random.Random, errors: list[str], bodies: Sequence[str]) -> str:
    moves = {each.__name__: each for each in MOVES} | {"body": partial(body, bodies=bodies)}
    name = rng.choices(list(moves), [*MOVES.values(), OFTEN])[0]
    try:
        moves[name](page, rng)
    except Exception as error:  # a browser's, of any kind
        errors.append(f"{name}: {str(error)[:300]}")
        page.keyboard.press("Escape")
    page.wait_for_timeout(rng.uniform(0, 400))
    return name


def _address(log: Path) -> str:
    for _ in range(300):
        if found := re.search(r"http://\S+", log.read_text()):
            return str(found[0])
        time.sleep(0.1)
    raise SystemExit("the server does not start")


def _opened(browser: Any, address: str, errors: list[str]) -> Page:
    page = browser.new_page(viewport={"width": 1280, "height": 720}, accept_downloads=True)
    page.set_default_timeout(PATIENCE)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda m: errors.append(m.text) if m.type == "error" else None)
    page.goto(address)
    page.wait_for_function(DRAWN)
    return page


if __name__ == "__main__":
    lasts = float(sys.argv[1]) if len(sys.argv) > 1 else 600.0
    started = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    known = [name for name in CHOICES["body"] if name != OWN_BODY]
    chosen = sys.argv[3].split(",") if len(sys.argv) > 3 else known
    sys.argv = sys.argv[:1]  # trame reads it
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; {lasts:g} s, seed {started}")
    sys.exit(0 if soak(lasts, started, chosen) else 1)
