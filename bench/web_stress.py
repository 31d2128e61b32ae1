"""Stress test of the server, `python -m bench.web_stress [seconds] [seed] [pages] [end]`.

As many pages as are asked for, without a browser, do what a page can at random while one of their
processes is killed now and then. Every page must get a response or a reason why not, the server
itself may not grow, and `end` seconds after Ctrl-C, 3 unless told, nothing of it may be left.
"""

import asyncio
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import aiohttp

from bench.page_client import Client, Refused, browser, opened
from bench.web_soak import COMMAND, family, held, read
from skinwave.web.controls import CHOICES, NUMBERS, presets

WARM = 0.3  # of the time, after which the server may not grow
MOST = 50.0  # MB that it grows by at most
ENDS = 3.0  # s after Ctrl-C
LATE = 60.0  # s more that a busy machine has until a page has responded and a process is killed
KILLED = (4.0, 9.0)  # s between processes that are killed
BODIES = ("none", "none", "none", "skin-slab")
Made = Counter[str]


async def moved(page: Client, rng: random.Random, made: Made) -> None:
    """Something that a page does; now and then with a value that is none."""
    way = rng.choice(["number"] * 8 + ["choice", "trigger", "trigger", "preset", "wrong", "save"])
    key = rng.choice(list(NUMBERS))
    if way == "number":
        value = rng.uniform(NUMBERS[key].low, NUMBERS[key].high)
        answer = await page.set(**{key: round(value) if key == "foci" else value})
    elif way == "choice":
        name = rng.choice(["ratio", "drive", "profile", "sharing"])
        answer = await page.set(**{name: rng.choice(CHOICES[name])})
    elif way == "preset":
        answer = await page.set(**presets()[rng.choice(list(presets()))])
    elif way == "wrong":
        value = rng.choice([float("nan"), 1e300, "x" * 20_000, [1], {"a": 1}, None, "../../etc"])
        answer = await page.set(**{rng.choice([key, "phase", "errors", "span"]): value})
    elif way == "save":
        answer = await page.trigger(
            *rng.choice([("scene_toml",), ("waveform_csv",), ("figure", "pgf"), ("figure", "png")])
        )
    else:
        answer = await page.trigger(*rng.choice([
            ("select", rng.uniform(-60, 60), rng.uniform(-60, 60)), ("zoom", 1.0, 30.0),
            ("zoom",), ("restart", f"body={rng.choice(BODIES)}"),
        ]))  # fmt: skip
    made["answered" if "result" in answer else "told why not"] += 1


async def turned(address: str, rng: random.Random, over: asyncio.Event, made: Made) -> None:
    """One page, opened anew whenever it is lost."""
    name = f"{rng.random()}"
    async with browser() as session:
        while not over.is_set():
            try:
                async with opened(session, address, name, body=rng.choice(BODIES)) as page:
                    made["opened"] += 1
                    while not over.is_set():
                        await moved(page, rng, made)
                        await asyncio.sleep(rng.uniform(0.05, 0.6))
            except Refused as said:
                made[f"waits or refused: {re.sub(r' .[0-9]+ before it.', '', str(said))}"] += 1
                await asyncio.sleep(1)
            except (ConnectionError, aiohttp.ClientConnectionError) as error:
                made[f"lost: {type(error).__name__}"] += 1
            except Exception as error:  # whatever else is a fault
                made[f"FAULT: {type(error).__name__}: {error}"] += 1


def page_processes(server: int) -> list[int]:
    """Processes of pages, of which one may be the one that waits for the next."""
    return [
        pid for pid in family(server)
        if b"skinwave.web.serve" in read(f"/proc/{pid}/cmdline")
    ]  # fmt: skip


async def killing(server: int, rng: random.Random, made: Made) -> None:
    while True:
        await asyncio.sleep(rng.uniform(*KILLED))
        if there := page_processes(server):
            os.kill(rng.choice(there), signal.SIGKILL)
            made["killed"] += 1


async def used(server: int, address: str, seconds: float, rng: random.Random, pages: int) -> Any:
    """Counts of moves, and the server's memory in MB after a part of the time and in the end."""
    made, end, over = Made(), time.monotonic() + seconds, asyncio.Event()
    each = [asyncio.create_task(turned(address, random.Random(rng.random()), over, made))
            for _ in range(pages)]  # fmt: skip
    killer = asyncio.create_task(killing(server, rng, made))
    await asyncio.sleep(WARM * seconds)
    before = held(server)
    while (left := end - time.monotonic()) > 0 or (
        left > -LATE and not (made["answered"] and made["killed"])
    ):
        await asyncio.sleep(0.1)
    after, there = held(server), family(server)
    start = time.monotonic()
    os.kill(server, signal.SIGINT)  # with all pages open
    counted = Made(made)  # what comes then is that it ends
    over.set()
    while time.monotonic() - start < 60 and any(_alive(pid) for pid in there):
        await asyncio.sleep(0.02)
    lasted = time.monotonic() - start
    for task in [killer, *each]:
        task.cancel()
    await asyncio.gather(killer, *each, return_exceptions=True)
    return counted, (before, after), lasted, len(there)


def _alive(pid: int) -> bool:
    """Whether a process is there, and not only its exit code."""
    return b") Z " not in read(f"/proc/{pid}/stat") and Path(f"/proc/{pid}").exists()


def stress(seconds: float, seed: int, pages: int, ends: float) -> bool:
    """Whether nothing went wrong."""
    with tempfile.TemporaryDirectory() as folder:
        server = subprocess.Popen(COMMAND, stderr=subprocess.PIPE, text=True,
                                  env={**os.environ, "TMPDIR": folder})  # fmt: skip
        assert server.stderr is not None
        address = server.stderr.readline().split()[1]
        try:
            made, (before, after), lasted, there = asyncio.run(
                used(server.pid, address, seconds, random.Random(seed), pages)
            )
        finally:
            server.kill()
        lines = server.stderr.read().splitlines()
        left = sorted(path.name for path in Path(folder).iterdir())
    for what, times in sorted(made.items()):
        print(f"{times:7d} {what}")
    print(f"server {before:.0f} MB, then {after:.0f} MB; its {there} processes ended in "
          f"{lasted:.1f} s after Ctrl-C with code {server.returncode}; "
          f"left of temporary files: {left}; {len(lines)} lines")  # fmt: skip
    print("\n".join(f"    {line}" for line in lines[:40]))
    faults = [what for what in made if what.startswith("FAULT")]
    good = made["answered"] > 0 and after - before <= MOST and lasted <= ends
    return good and not faults and not left and not any("Traceback" in line for line in lines)


if __name__ == "__main__":
    lasts = float(sys.argv[1]) if len(sys.argv) > 1 else 300.0
    started = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    many = int(sys.argv[3]) if len(sys.argv) > 3 else 12
    within = float(sys.argv[4]) if len(sys.argv) > 4 else ENDS
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; {lasts:g} s, seed {started}")
    sys.exit(0 if stress(lasts, started, many, within) else 1)
