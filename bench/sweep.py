"""Sweep against single runs, `python -m bench.sweep`: 200 runs on one body.

4 speeds x 5 sizes x 10 AM frequencies, the reduced model of the skin slab on one mesh. Both begin
with a cold cache, and cache the bodies that they reduce.
"""

import itertools
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SPEEDS, SIZES, TONES = (4, 6, 9, 12), (5, 10, 15, 20, 25), range(50, 300, 25)
MESH = ["--model", "fem", "--h", "4", "--quiet"]
COUNTED = 10  # calls that stand for all
SCENE = """name = "skin slab"
[tacton]
am_frequency_hz = {tone}
duration_s = 0.5
shape = "circle"
size_mm = {size}
speed_m_per_s = {speed}
[body]
kind = "slab"
material = "palm"
"""


def called(folder: Path, *arguments: str, cache: str) -> float:
    environment = {**os.environ, "SKINWAVE_CACHE": cache}
    started = time.perf_counter()
    command = [sys.executable, "-m", "skinwave", *arguments, *MESH]
    subprocess.run(command, cwd=folder, env=environment, check=True)
    return time.perf_counter() - started


def main() -> None:
    every = list(itertools.product(SPEEDS, SIZES, TONES))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scene.toml").write_text(SCENE.format(tone=140, size=20, speed=6))
        vary = {"tacton.speed_m_per_s": SPEEDS, "tacton.size_mm": SIZES,
                "tacton.am_frequency_hz": TONES}  # fmt: skip
        lists = [f"{key}={','.join(map(str, values))}" for key, values in vary.items()]
        cold = called(folder, "sweep", "scene.toml", "--vary", *lists, "--out", "cold",
                      cache=name + "/a")  # fmt: skip
        warm = called(folder, "sweep", "scene.toml", "--vary", *lists, "--out", "warm",
                      cache=name + "/a")  # fmt: skip
        print(f"sweep of {len(every)} runs: {cold:.1f} s, {warm:.1f} s with the body cached",
              f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores", flush=True)  # fmt: skip
        seconds = []
        for k, (speed, size, tone) in enumerate(every[:: len(every) // COUNTED][:COUNTED]):
            (folder / "one.toml").write_text(SCENE.format(tone=tone, size=size, speed=speed))
            seconds.append(
                called(folder, "run", "one.toml", "--out", f"one-{k}", cache=name + "/b")
            )
        rest = sum(seconds[1:]) / (COUNTED - 1)
        total = seconds[0] + (len(every) - 1) * rest
        print(f"skinwave run: first {seconds[0]:.1f} s, then {rest:.1f} s each; {len(every)}: "
              f"{total:.0f} s, {total / cold:.0f} times the sweep")  # fmt: skip


if __name__ == "__main__":
    main()
