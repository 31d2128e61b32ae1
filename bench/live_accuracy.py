"""The live page beside Python: lines, waveforms and levels of random Tactons, in Chromium.

    python -m bench.live_accuracy [--count 200] [--body palm ...] [--waveforms 20]

Of each body the errors of lines above -40 dB, relative to the line, of waveforms from rest in the
L2 norm, and of the level of the strongest line in dB.
"""

import argparse
import tempfile
from dataclasses import replace
from importlib import resources
from pathlib import Path
from shutil import copytree

import numpy as np
from playwright.sync_api import sync_playwright

from skinwave.live.packs import pack_of
from skinwave.live.page import bundle
from skinwave.live.records import record_of
from skinwave.live.selftest import exact, random_scene
from skinwave.live.values import values_of
from skinwave.scene.scene import BODIES

CHROMIUM = "/usr/bin/chromium"
BODY = ("skin-slab", "palm-layers", "paper-sheet", "palm")
SHOWN, HIGHEST = 0.01, 1000.0  # of the strongest line; Hz
ENTRY = """
import { openBody } from "./bodies.js";
import { loadOf } from "./values.js";
window.answer = ({ record, cases }) => {
  const body = openBody(record);
  return cases.map(({ values, samples }) => {
    const motion = body.respond(loadOf(values)), x = values.x / 1e3, y = values.y / 1e3;
    const { re, im } = motion.at(x, y);
    const times = Float64Array.from({ length: samples }, (_, k) => k * 1e-4);
    return { f: [...motion.f], re: [...re], im: [...im],
      u: samples ? [...motion.waveform(x, y, times)] : [] };
  });
};
"""


def answers(record: dict, cases: list[dict]) -> list[dict]:
    """What the page's modules answer in Chromium."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        static = Path(folder, "static")
        copytree(str(resources.files("skinwave") / "static"), static)
        (static / "entry.js").write_text(ENTRY)
        file = Path(folder, "page.html")
        script = bundle(static, "entry.js")
        file.write_text(f"<!doctype html><meta charset=utf-8><script type=module>{script}</script>")
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page()
        page.goto(file.as_uri())
        return page.evaluate("given => window.answer(given)", {"record": record, "cases": cases})


def of_body(name: str, count: int, waveforms: int) -> None:
    """Print the errors of a body."""
    body, rng = BODIES[name], np.random.default_rng(7)
    pack = pack_of(body)
    lines_of, waveform_of, places = exact(body)
    scenes = [random_scene(body, rng, pack["lowest_height_mm"] / 1e3, places) for _ in range(count)]
    scenes = [
        replace(s, pressure=replace(s.pressure, tacton=replace(s.tacton, duration=0.5)))
        for s in scenes
    ]
    cases = [
        {"values": values_of(scene, name), "samples": 5000 * (k < waveforms)}
        for k, scene in enumerate(scenes)
    ]
    found = answers(record_of(body, pack, name, waves=False), cases)
    errors, of_waves, levels = [], [], []
    for k, (scene, own) in enumerate(zip(scenes, found, strict=True)):
        f, exactly = lines_of(scene)
        amplitudes = np.array(own["re"]) + 1j * np.array(own["im"])
        at = {round(x, 3): a for x, a in zip(own["f"], amplitudes, strict=True)}
        heard = (f > 1e-6) & (f <= HIGHEST)
        size = np.abs(exactly[heard])
        if not len(size):
            continue
        ours = np.array([at.get(round(x, 3), 0.0) for x in f[heard]])
        strong = size > SHOWN * size.max()
        errors += (np.abs(ours - exactly[heard]) / size)[strong].tolist()
        best = int(size.argmax())
        levels.append(abs(20 * np.log10(abs(ours[best]) / size[best])))
        if k < waveforms:
            u = waveform_of(scene)
            of_waves.append(np.linalg.norm(np.array(own["u"]) - u) / np.linalg.norm(u))
    print(f"{name:<16}{len(errors):6d}{np.median(errors):10.1e}{np.quantile(errors, 0.9):10.1e}"
          f"{max(errors):10.1e}{max(levels):8.2f} dB{max(of_waves, default=np.nan):10.1e}",
          flush=True)  # fmt: skip


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--waveforms", type=int, default=20)
    parser.add_argument("--body", nargs="*", default=BODY)
    given = parser.parse_args()
    print(f"{'body':<16}{'lines':>6}{'median':>10}{'90 %':>10}{'largest':>10}{'level':>11}"
          f"{'waveform':>10}")  # fmt: skip
    for name in given.body:
        of_body(name, given.count, given.waveforms)


if __name__ == "__main__":
    main()
