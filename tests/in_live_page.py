"""Modules of the live page in a browser, and random values of its controls."""

import random
import shutil
from importlib import resources

from skinwave.live.page import bundle
from skinwave.live.records import toml_of
from skinwave.scene.file import loads
from skinwave.scene.scene import BODIES

USED = {
    "files": "adaptics linesCsv pyautd3 readMeasurement sceneToml waveformCsv waveformWav",
    "kernel": "respond", "load": "loadLines spot", "numbers": "amplitudesOf delayOf levelOf "
    "levelOver lineNames mapOf meanLevel phaseDelay pressureThresholdAt reach shareOutside "
    "spectrum thresholdAt unresolvedNames",
    "values": "STARTS check fromAddress loadOf toAddress",
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
    + "window.kernel = { respond };\n"
)
BARE = toml_of(BODIES["none"])
SHAPES = ("point", "line", "circle", "triangle", "square")


def modules(browser, folder):
    """A page whose window has the functions of modules, and `attempt` for what they refuse."""
    shutil.copytree(str(resources.files("skinwave") / "static"), folder)
    (folder / "entry.js").write_text(MODULE, encoding="utf-8")
    text = f"<!doctype html><meta charset=utf-8><script type=module>{bundle(folder, 'entry.js')}"
    (folder / "page.html").write_text(f"{text}</script>", encoding="utf-8")
    page = browser.new_page()
    page.goto((folder / "page.html").as_uri())
    page.wait_for_function("() => window.STARTS")
    return page


def some_values(starts, count, *, rhythm):
    """Random values of the controls, the same every time."""
    rng = random.Random(3)
    return [starts | _values(rng, rhythm) for _ in range(count)]


def scenes_of(page, many):
    """Scenes of values of the controls, by the files that the page saves."""
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
