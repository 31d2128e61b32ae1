"""Modules of the live page in a browser, and random values of its controls."""

import random
import shutil
from importlib import resources

from skinwave.live.html_file import bundle
from skinwave.live.records import toml_of
from skinwave.scene.file import loads
from skinwave.scene.scene import BODIES

USED = {
    "bodies": "openBody", "maps": "contours drawMap mapControls",
    "files": "linesCsv readMeasurement sceneToml waveformCsv waveformWav", "kernel": "kernelMotion",
    "load": "loadLines spot", "evaluate": "MAP_LINE amplitudesOf delayOf levelOf levelOver mapOf "
    "namesOf phaseDelay pressureThresholdAt reach shareOutside spectrum thresholdAt",
    "address": "fromAddress toAddress", "radial": "besselJ0", "values": "STARTS check loadOf",
    "view3d": "openView",
}  # fmt: skip
MODULE = (
    "".join(
        f'import {{ {", ".join(names.split())} }} from "./{module}.js";\n'
        for module, names in USED.items()
    )
    + """const attempt = (make) => {
  try { return { made: make() }; } catch (error) { return { refused: error.message }; }
};
"""
    + f"Object.assign(window, {{ attempt, {', '.join(' '.join(USED.values()).split())} }});\n"
)
PAGE = """<!doctype html><meta charset=utf-8><body style="color: #000; margin: 0">
<style>.stage { position: relative; height: 380px } .stage > * { position: absolute; width: 500px;
  height: 380px }</style>
<svg id=map style="width: 400px; height: 420px"></svg><div id=view></div><script type=module>"""
BARE = toml_of(BODIES["none"])
SHAPES = ("point", "line", "circle", "triangle", "square")


def modules(browser, folder):
    """A page with a map and a view, whose window has the functions of modules."""
    shutil.copytree(str(resources.files("skinwave") / "static"), folder)
    (folder / "entry.js").write_text(MODULE, encoding="utf-8")
    text = f"{PAGE}{bundle(folder, 'entry.js')}</script>"
    (folder / "page.html").write_text(text, encoding="utf-8")
    page = browser.new_page(viewport={"width": 900, "height": 900}, reduced_motion="reduce")
    page.goto((folder / "page.html").as_uri())
    page.wait_for_function("() => window.STARTS")
    return page


def some_values(starts, count, *, rhythm):
    rng = random.Random(3)
    return [starts | _values(rng, rhythm) for _ in range(count)]


def scenes_of(page, many):
    """Scenes of values of the controls, from the files that the page saves."""
    made = "([many, toml]) => many.map((own) => sceneToml(own, { toml }))"
    return [loads(text) for text in page.evaluate(made, [many, BARE])]


def _values(rng, rhythm):
    foci = rng.choice([1, 1, 2, 3])
    found = {
        "shape": rng.choice([*SHAPES, "circle", "polyline"]), "foci": foci, "y": -3,
        "amplitude": rng.choice([100, 60]), "am": rng.choice([0, rng.randint(5, 300), 140]),
        "am2": rng.choice([0, 0, rng.randint(5, 300)]), "envelope": rng.choice([0, 0, 2, 7.5]),
        "ratio": rng.choice(["1:0", "0.75:0.25", "0.5:0.5", "0:1"]), "body": "none",
        "duration": rng.choice([0.1, 0.3, 1]), "size": rng.choice([5, 20, 33.5, 60]),
        "speed": rng.choice([0, 1, 6, 12, 18]), "drawn": rng.choice([20, 70, 100, 185]),
        "height": rng.choice([100, 150, 200, 285, 600]), "peak": rng.choice([50, 80]),
        "modulation": rng.choice([100, 50]), "profile": rng.choice(["gaussian", "main_lobe"]),
        "polyline": rng.choice(["0/0, 10/0, 12/9, -5/7", "0/0, 10/0, 5/8, 0/0"]),
        "sweep": rng.choice(["there_and_back", "one_way", "sinusoidal"]),
        "drive": rng.choice(["linear", "pressure_squared", "force_corrected"]),
        "sharing": rng.choice(["simultaneous", "time_multiplexed"]),
    }  # fmt: skip
    if foci > 1 and rng.random() < 0.4:
        found["phases"] = ", ".join(map(str, sorted(rng.sample(range(100), foci))))
    elif rng.random() < 0.3:
        paths = ("/".join(map(str, (rng.choice(SHAPES), rng.choice([8, 15, 25]),
                                    rng.randint(-30, 30), rng.randint(-30, 30))))
                 for _ in range(foci))  # fmt: skip
        found["paths"] = ", ".join(paths)
    if rhythm and rng.random() < 0.5:
        found |= {"pulses": rng.choice(["100/50", "30/20, 60/10"]), "ramp": rng.choice([0, 10])}
    return found
