"""Bodies of the live page in a browser, against models that do not use their packs."""

import shutil
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest
from in_browser import needs_browser

from simple_model import Rhythm
from skinwave.live.page import bundle
from skinwave.live.radial import radial_pack
from skinwave.live.records import record_of
from skinwave.live.selftest import HIGHEST, SHOWN, exact, random_scene
from skinwave.live.sheets import sheet_pack
from skinwave.live.values import values_of
from skinwave.scene import BODIES, Body

pytestmark = needs_browser

ENTRY = """
import { MAP_LINE, openBody } from "./bodies.js";
import { loadOf } from "./values.js";
const bodies = new Map();
window.open_ = (record) => { bodies.set(record.name, openBody(record)); };
window.answer = ({ name, values }) => {
  const motion = bodies.get(name).respond(loadOf(values)), x = values.x / 1e3, y = values.y / 1e3;
  const count = Math.round(1e4 * values.duration);
  const times = Float64Array.from({ length: count }, (_, k) => k * 1e-4);
  const { re, im } = motion.at(x, y);
  return { f: [...motion.f], re: [...re], im: [...im], u: [...motion.waveform(x, y, times)] };
};
window.map_ = ({ name, values, k }) => {
  const motion = bodies.get(name).respond(loadOf(values));
  const { re } = motion.onGrid(MAP_LINE, MAP_LINE);
  const x = MAP_LINE[k % MAP_LINE.length], y = MAP_LINE[Math.floor(k / MAP_LINE.length)];
  const at = motion.at(x, y).re, size = MAP_LINE.length ** 2;
  return [...motion.f].map((_, l) => [re[l * size + k], at[l]]);
};
"""
TETS = 9e-3  # m: element size of the body of elements
DISC = Body(kind="palm")


@pytest.fixture(scope="module")
def page(browser, tmp_path_factory):
    """A page with the modules that answer, and three bodies."""
    folder = tmp_path_factory.mktemp("live") / "static"
    shutil.copytree(str(resources.files("skinwave.live") / "static"), folder)
    (folder / "entry.js").write_text(ENTRY)
    file = folder / "page.html"
    script = bundle(folder, "entry.js")
    file.write_text(f"<!doctype html><meta charset=utf-8><script type=module>{script}</script>")
    found = browser.new_page()
    found.goto(file.as_uri())
    found.wait_for_function("() => window.answer")
    packs = {
        "palm-layers": radial_pack(BODIES["palm-layers"]),
        "paper-sheet": sheet_pack(BODIES["paper-sheet"]),
    }
    for name, pack in packs.items():
        record = record_of(BODIES[name], pack, name, waves=False)
        found.evaluate("record => window.open_(record)", record)
    yield found
    found.close()


def scenes(name, count, places=(), lowest=0.15, **tacton):
    """Random scenes on a body, as their steady and waveforms."""
    rng = np.random.default_rng(11)
    found = [random_scene(BODIES[name], rng, lowest, places) for _ in range(count)]
    given = {"duration": 0.3} | tacton
    return [
        replace(s, pressure=replace(s.pressure, tacton=replace(s.tacton, **given))) for s in found
    ]


def line_errors(page, name, made, lines_of):
    """Errors of the page's lines above -40 dB, relative to each."""
    found = []
    for scene in made:
        own = page.evaluate("given => window.answer(given)",
                            {"name": name, "values": values_of(scene, name)})  # fmt: skip
        lines = np.array(own["re"]) + 1j * np.array(own["im"])
        at = dict(zip(np.round(own["f"], 3), lines, strict=True))
        f, exactly = lines_of(scene)
        heard = (f > 0) & (f <= HIGHEST)
        heard &= np.abs(exactly) > SHOWN * np.abs(exactly[heard]).max(initial=0.0)
        found += [abs(at[x] - a) / abs(a) for x, a in zip(np.round(f[heard], 3), exactly[heard],
                                                          strict=True)]  # fmt: skip
    return np.array(found)


def wave_errors(page, name, made, waveform_of):
    """Errors of the page's waveforms from rest in the L2 norm."""
    found = []
    for scene in made:
        own = page.evaluate("given => window.answer(given)",
                            {"name": name, "values": values_of(scene, name)})  # fmt: skip
        exactly = waveform_of(scene)
        found.append(np.linalg.norm(np.array(own["u"]) - exactly) / np.linalg.norm(exactly))
    return np.array(found)


@pytest.mark.parametrize("name", ["palm-layers", "paper-sheet"])
def test_lines_and_waveforms_of_layers_and_sheets(page, name):
    lines_of, waveform_of, _ = exact(BODIES[name])
    made = scenes(name, 12)
    assert line_errors(page, name, made, lines_of).max() < 0.005
    assert wave_errors(page, name, made[:4], waveform_of).max() < 0.01


@pytest.mark.parametrize("name", ["palm-layers", "paper-sheet"])
@pytest.mark.parametrize("ramp", [0.0, 0.01])
def test_pulses_of_a_rhythm(page, name, ramp):
    waveform_of = exact(BODIES[name])[1]
    made = scenes(name, 2, rhythm=Rhythm(pulses=((0.06, 0.04), (0.03, 0.05)), ramp=ramp))
    assert wave_errors(page, name, made, waveform_of).max() < 0.02
