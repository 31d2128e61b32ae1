"""Bodies of the live page in a browser, against models that do not use their packs."""

from dataclasses import replace

import numpy as np
import pytest
from in_browser import needs_browser

from simple_model import MovingPressure, Rhythm, Tacton, Trajectory, from_young, sensation_level
from simple_model.load.line_names import during_pulses
from skinwave.bodies.supports import Mounting
from skinwave.live.elements import Training, element_pack
from skinwave.live.packs import pack_of
from skinwave.live.records import record_of
from skinwave.live.selftest import OF_ELEMENTS, Compared, exact_lines, random_scene
from skinwave.live.values import control_values
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import answer as reduced_answer
from skinwave.models.reduced import reduce_scene
from skinwave.planning.simulate import compute
from skinwave.scene.scene import BODIES, STILL, Scene

pytestmark = needs_browser

OPEN = "(record) => { (window.bodies ??= {})[record.name] = openBody(record); }"
ANSWER = """({ name, values }) => {
  const motion = bodies[name].motion(loadOf(values)), x = values.x / 1e3, y = values.y / 1e3;
  const count = Math.round(1e4 * values.duration), { re, im } = motion.at(x, y);
  const times = Float64Array.from({ length: count }, (_, k) => k * 1e-4);
  return { f: [...motion.f], re: [...re], im: [...im], u: [...motion.waveform(x, y, times)] };
}"""
PLACES = """({ name, values, k }) => {
  const motion = bodies[name].motion(loadOf(values)), n = MAP_LINE.length;
  const map = motion.onGrid(MAP_LINE, MAP_LINE);
  const at = motion.at(MAP_LINE[k % n], MAP_LINE[Math.floor(k / n)]);
  return ["re", "im"].flatMap((own) => [...motion.f].map((_, l) => (
    [map[own][l * n * n + k], at[own][l]])));
}"""
LEVEL = """({ name, values }) => {
  const motion = bodies[name].motion(loadOf(values));
  return levelOf(motion.f, motion.at(values.x / 1e3, values.y / 1e3)).dB;
}"""
STRETCHING = """(values) => {
  const body = bodies["paper-sheet"];
  return body.stretchingOf(body.motion(loadOf(values)));
}"""
H = 0.012  # m: size of the palm's elements in this test


def open_body(page, name, pack):
    page.evaluate(OPEN, record_of(BODIES[name], pack, name, waves=False))


def scenes(name, count, places=(), **tacton):
    rng = np.random.default_rng(11)
    made = [random_scene(BODIES[name], rng, 0.15, places) for _ in range(count)]
    given = {"duration": 0.3} | tacton
    loads = [replace(s.pressure, tacton=replace(s.tacton, **given)) for s in made]
    return [replace(s, pressure=load) for s, load in zip(made, loads, strict=True)]


def answer(page, name, scene):
    return page.evaluate(ANSWER, {"name": name, "values": control_values(scene, name)})


def line_errors(page, name, made, lines_of, limits):
    errors = []
    for scene in made:
        own = answer(page, name, scene)
        lines = np.array(own["re"]) + 1j * np.array(own["im"])
        at = dict(zip(np.round(own["f"], 3), lines, strict=True))
        f, exactly = lines_of(scene)
        strong = limits.strong(f, np.abs(exactly))
        pairs = zip(np.round(f[strong], 3), exactly[strong], strict=True)
        errors += [abs(at[x] - a) / abs(a) for x, a in pairs]
    return np.array(errors)


def wave_errors(page, name, made, waveform_of):
    pairs = [(np.array(answer(page, name, scene)["u"]), waveform_of(scene)) for scene in made]
    return np.array([np.linalg.norm(own - u) / np.linalg.norm(u) for own, u in pairs])


@pytest.mark.parametrize(
    ("name", "model"),
    [("palm-layers", "flat-body"), ("paper-sheet", "plate-modes-transient")],
)
def test_lines_waveforms_and_maps_of_layers_and_sheets(page, name, model):
    open_body(page, name, pack_of(BODIES[name]))
    lines_of, _ = exact_lines(BODIES[name])

    def waveform_of(scene):
        return compute(scene, model).values[:, 0]

    made = scenes(name, 4)
    assert line_errors(page, name, made, lines_of, Compared()).max() < 0.005
    assert wave_errors(page, name, made[:2], waveform_of).max() < 0.01
    rhythm = Rhythm(pulses=((0.03, 0.02), (0.02, 0.01)), ramp=0.01)
    pulsed = scenes(name, 1, rhythm=rhythm, duration=0.1)
    assert wave_errors(page, name, pulsed, waveform_of).max() < 0.02
    level = page.evaluate(LEVEL, {"name": name, "values": control_values(pulsed[0], name)})
    steady = [replace(each, pressure=during_pulses(each.pressure)) for each in pulsed]
    f, exactly = lines_of(steady[0])
    levels = sensation_level(np.abs(exactly[f > 0]), f[f > 0])
    assert level == pytest.approx(levels.max(), abs=0.1)
    given = {"name": name, "values": control_values(made[0], name), "k": 45 * 19 + 28}
    pairs = np.array(page.evaluate(PLACES, given))
    assert np.abs(pairs[:, 0] - pairs[:, 1]).max() < 5e-3 * np.abs(pairs).max()


def test_a_stretched_sheet_under_ramps_starts_from_rest(page):
    stretched = Mounting(tension_x=30.0, tension_y=10.0)
    lossy = from_young(density=800, young=2e9, poisson=0.3, loss_factor=0.3)
    body = replace(BODIES["paper-sheet"], width=0.05, height=0.05, material=lossy, air=False,
                   mounting=stretched)  # fmt: skip
    page.evaluate(OPEN, record_of(body, pack_of(body), "stretched", waves=False))
    rhythm = Rhythm(pulses=((0.03, 0.02),), ramp=0.01)
    for given in ({}, {"rhythm": rhythm}):
        load = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.1, **given))
        scene = Scene(pressure=load, body=body, probes=((0.005, 0.0),))
        u = np.array(answer(page, "stretched", scene)["u"])
        exactly = compute(scene, "plate-modes-transient").values[:, 0]
        assert abs(u[0]) < 1e-3 * np.abs(u).max()
        assert np.linalg.norm(u - exactly) < 0.02 * np.linalg.norm(exactly)


def test_a_body_of_elements(page):
    few = Training(most=250, spacing=0.0087)
    open_body(page, "palm", element_pack(BODIES["palm"], H, training=few))
    lines_of, places = exact_lines(BODIES["palm"], H)
    still = Scene(pressure=STILL, body=BODIES["palm"], probes=places)
    prepared = reduce_scene(still, SolveOptions(h=H))

    def waveform_of(scene):
        return reduced_answer(prepared, scene).values[:, places.index(scene.probes[0])]

    made = scenes("palm", 8, places)
    errors = line_errors(page, "palm", made, lines_of, OF_ELEMENTS)
    assert np.median(errors) < 0.05
    assert np.quantile(errors, 0.9) < 0.2  # elements are much larger than the focal spot
    assert np.median(wave_errors(page, "palm", made[:5], waveform_of)) < 0.12
    for scene in made[:2]:
        u = np.abs(answer(page, "palm", scene)["u"])
        assert u[0] < 1e-5 * u.max()


@pytest.mark.parametrize(("speed", "peak"), [(12.0, 50.0), (12.0, 25.0), (0.0, 50.0)])
def test_a_sheet_states_what_stretching_changes(page, speed, peak):
    """At the lines of the load, which the free vibration after the start does not change."""
    body = BODIES["paper-sheet"]
    circle = Trajectory(shape="circle", size=0.02, speed=speed) if speed else Trajectory()
    tacton = Tacton(am_frequency=140, trajectory=circle, duration=0.5)
    places = ((0.0, 0.0), (0.01, 0.0), (0.02, 0.01), (0.03, -0.02), (-0.015, 0.03))
    pressure = MovingPressure(tacton=tacton, peak_pressure=peak)
    scene = Scene(pressure=pressure, body=body, probes=places)
    linear, stretched = (
        compute(scene, m) for m in ("plate-modes-transient", "plate-modes-nonlinear")
    )
    t, drawn = linear.times, speed / (np.pi * 0.02)
    f = np.unique([abs(140 * i + drawn * j) for i in range(-2, 3) for j in range(-3, 4)])
    f = f[(f > 20) & (f < 600)]
    window = np.hanning(len(t)) ** 2 * 2 / (np.hanning(len(t)) ** 2).sum()
    turn = np.exp(-2j * np.pi * np.outer(f, t)) * window
    a, b = (turn @ (r.displacement - r.displacement.mean(axis=0)) for r in (linear, stretched))
    strong, largest = np.abs(b) > 10 ** (-30 / 20) * np.abs(b).max(), np.abs(b).max(axis=0)
    true = np.where(strong, np.abs(a - b) / largest, 0).max()
    open_body(page, "paper-sheet", pack_of(body))
    stated = page.evaluate(
        STRETCHING, control_values(replace(scene, probes=places[:1]), "paper-sheet")
    )
    assert true < 1.1 * np.hypot(stated, 0.01)
    assert stated < 6 * true
