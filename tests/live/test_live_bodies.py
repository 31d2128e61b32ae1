"""Bodies of the live page in a browser, against models that do not use their packs."""

import shutil
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest
from in_browser import needs_browser

from simple_model import Rhythm
from skinwave.live.elements import BAND, element_pack
from skinwave.live.page import bundle
from skinwave.live.radial import radial_pack
from skinwave.live.records import record_of
from skinwave.live.selftest import HIGHEST, SHOWN, exact, random_scene
from skinwave.live.sheets import sheet_pack
from skinwave.live.values import values_of
from skinwave.scene.scene import BODIES

pytestmark = needs_browser

ENTRY = """
import { openBody } from "./bodies.js";
import { MAP_LINE } from "./numbers.js";
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
window.places = ({ name, values, k }) => {
  const motion = bodies.get(name).respond(loadOf(values));
  const { re } = motion.onGrid(MAP_LINE, MAP_LINE);
  const x = MAP_LINE[k % MAP_LINE.length], y = MAP_LINE[Math.floor(k / MAP_LINE.length)];
  const at = motion.at(x, y).re, size = MAP_LINE.length ** 2;
  return [...motion.f].map((_, l) => [re[l * size + k], at[l]]);
};
"""
H = 0.012  # m: elements of the palm, few for the test


@pytest.fixture(scope="module")
def page(browser, tmp_path_factory):
    """A page with the modules that answer, and bodies."""
    folder = tmp_path_factory.mktemp("live") / "static"
    shutil.copytree(str(resources.files("skinwave") / "static"), folder)
    (folder / "entry.js").write_text(ENTRY)
    file = folder / "page.html"
    script = bundle(folder, "entry.js")
    file.write_text(f"<!doctype html><meta charset=utf-8><script type=module>{script}</script>")
    found = browser.new_page()
    found.goto(file.as_uri())
    found.wait_for_function("() => window.answer")
    for name, pack_of in (("palm-layers", radial_pack), ("paper-sheet", sheet_pack)):
        add(found, name, pack_of(BODIES[name]))
    yield found
    found.close()


def add(page, name, pack):
    """Open a body on the page."""
    page.evaluate("own => window.open_(own)", record_of(BODIES[name], pack, name, waves=False))


def scenes(name, count, places=(), **tacton):
    """Random scenes on a body, the same every time."""
    rng = np.random.default_rng(11)
    found = [random_scene(BODIES[name], rng, 0.15, places) for _ in range(count)]
    given = {"duration": 0.3} | tacton
    return [
        replace(s, pressure=replace(s.pressure, tacton=replace(s.tacton, **given))) for s in found
    ]


def answer(page, name, scene):
    """What the page answers."""
    values = values_of(scene, name)
    return page.evaluate("given => window.answer(given)", {"name": name, "values": values})


def line_errors(page, name, made, lines_of, shown=SHOWN, highest=HIGHEST):
    """Errors of the page's lines above a share of the strongest, relative to each."""
    found = []
    for scene in made:
        own = answer(page, name, scene)
        lines = np.array(own["re"]) + 1j * np.array(own["im"])
        at = dict(zip(np.round(own["f"], 3), lines, strict=True))
        f, exactly = lines_of(scene)
        heard = (f > 0) & (f <= highest)
        heard &= np.abs(exactly) > shown * np.abs(exactly[f > 0]).max(initial=0.0)
        pairs = zip(np.round(f[heard], 3), exactly[heard], strict=True)
        found += [abs(at[x] - a) / abs(a) for x, a in pairs]
    return np.array(found)


def wave_errors(page, name, made, waveform_of):
    """Errors of the page's waveforms from rest in the L2 norm."""
    found = []
    for scene in made:
        own, exactly = np.array(answer(page, name, scene)["u"]), waveform_of(scene)
        found.append(np.linalg.norm(own - exactly) / np.linalg.norm(exactly))
    return np.array(found)


@pytest.mark.parametrize("name", ["palm-layers", "paper-sheet"])
def test_lines_and_waveforms_of_layers_and_sheets(page, name):
    lines_of, waveform_of, _ = exact(BODIES[name])
    made = scenes(name, 8)
    assert line_errors(page, name, made, lines_of).max() < 0.005
    assert wave_errors(page, name, made[:3], waveform_of).max() < 0.01


@pytest.mark.parametrize(("name", "ramp"), [("palm-layers", 0.01), ("paper-sheet", 0.01)])
def test_pulses_of_a_rhythm(page, name, ramp):
    waveform_of = exact(BODIES[name])[1]
    rhythm = Rhythm(pulses=((0.06, 0.04), (0.03, 0.05)), ramp=ramp)
    made = scenes(name, 1, rhythm=rhythm, duration=0.2)
    assert wave_errors(page, name, made, waveform_of).max() < 0.02


def test_a_body_of_elements(page):
    add(page, "palm", element_pack(BODIES["palm"], H))
    lines_of, waveform_of, places = exact(BODIES["palm"], H)
    made = scenes("palm", 12, places)
    errors = line_errors(page, "palm", made, lines_of, shown=0.1, highest=BAND)
    assert np.median(errors) < 0.05
    assert np.quantile(errors, 0.9) < 0.2  # of elements that are much larger than the focal spot
    assert np.median(wave_errors(page, "palm", made[:5], waveform_of)) < 0.12
    for scene in made[:3]:
        u = np.abs(answer(page, "palm", scene)["u"])
        assert u[0] < 1e-5 * u.max()


@pytest.mark.parametrize("name", ["palm-layers", "paper-sheet"])
def test_maps_are_what_is_read_at_their_places(page, name):
    (scene,) = scenes(name, 1)
    given = {"name": name, "values": values_of(scene, name), "k": 45 * 19 + 28}
    pairs = np.array(page.evaluate("given => window.places(given)", given))
    assert np.abs(pairs[:, 0] - pairs[:, 1]).max() < 5e-3 * np.abs(pairs).max()
