"""Controls, loads, kernel, numbers and files of the live page in a browser, beside Python."""

import csv
import re
from dataclasses import replace
from functools import partial
from io import BytesIO

import numpy as np
import pytest
from in_browser import needs_browser
from in_live_page import scenes_of, some_values
from scipy.io import wavfile
from scipy.special import jv

import simple_model.load.path_cells
from simple_model import Response, published_load, sensation_level, spectrum, threshold
from simple_model.load.line_names import line_names
from simple_model.load.path_cells import is_abrupt
from simple_model.load.spectrum import pressure_lines
from simple_model.threshold import pressure_threshold
from skinwave.live import html_file
from skinwave.live.packs import pack_of
from skinwave.live.values import control_values, presets
from skinwave.measure.reading import read
from skinwave.results.comparison import phase_delays
from skinwave.results.propagation import distance_from_path, reach_of, share_outside

pytestmark = needs_browser

PLACES = [[0.0, 0.0], [0.01, -0.003], [-0.02, 0.015]]
TIMES = np.arange(301) * 1e-4
JUMPS = 5e-5  # relative error of lines of joined paths and of paths that jump
WRONG = {"am": "high", "height": "90", "foci": "2.5", "pulses": "100", "paths": "circle/20/45/0"}
ANSWER = """(own) => { const load = loadOf(own), x = own.x / 1e3, y = own.y / 1e3;
  const motion = kernelMotion(load), at = motion.at(x, y);
  return { values: own, load, x, y, body: { is_skin: true }, kernel: motion, kernelAt: at,
    waves: motion, wavesAt: at }; }"""
REFUSED = (
    "time [s],signal [V]\n0,1\n1,2\n2,3", "0,1\n1,2\n2,3", "time [s],u [m]\n0,1\n1,x\n2,3",
    "time [s],u [m]\n0,1\n1,2\n5,3\n6,2", "f [Hz],re v [m/s],im v [m/s]\n1,1,1\n2,2,1\n3,1,1",
)  # fmt: skip


def steady(pressure):
    return replace(pressure, tacton=replace(pressure.tacton, rhythm=None))


def test_scene_files_and_addresses_preserve_values(page, starts):
    many = some_values(starts, 50, rhythm=True)
    addressed = "(many) => many.map((own) => fromAddress(`#${toAddress(own)}`))"
    assert page.evaluate(addressed, many) == [{"values": own, "refused": ""} for own in many]
    for scene, own in zip(scenes_of(page, many), many, strict=True):
        back = control_values(scene, "none")
        same = {"amplitude", "am", "am2", "ratio", "envelope", "duration", "height", "drive", "x",
                "y", "peak", "modulation", "profile", "foci", "sharing", "quantity"}  # fmt: skip
        assert {key: back[key] for key in same} == pytest.approx({key: own[key] for key in same})
        texts = [re.sub(r"(?<=point)/\d+", "/0", own["paths"]), own["pulses"]]
        assert [back["paths"], back["pulses"]] == texts


def test_invalid_input_is_refused(page):
    checked = "(wrong) => wrong.map(([key, text]) => attempt(() => check(key, text)))"
    assert all(found["refused"] for found in page.evaluate(checked, list(WRONG.items())))
    assert page.evaluate('() => check("am", "12,5")') == 12.5


def test_long_ramps_and_paths_off_the_body_are_refused(page, starts):
    own = starts | {"pulses": "10/10", "ramp": 8}
    loaded = "([own, body]) => attempt(() => loadOf(own, body))"
    assert page.evaluate(loaded, [own, None])["refused"]
    body = {"extent_mm": [9, 50], "lowest_height_mm": 100, "title": "strip"}
    assert page.evaluate(loaded, [starts, body])["refused"]


def test_lines_of_the_load(page, starts, monkeypatch):
    # Interpolation along the path is exact to 1e-5 of a circle only.
    exact = partial(simple_model.load.path_cells.along_path, nodes_per_detail=1e7)
    monkeypatch.setattr(simple_model.load.path_cells, "along_path", exact)
    simple_model.load.path_cells.path_cells.cache_clear()
    many = some_values(starts, 50, rhythm=False)
    found = page.evaluate(
        """([many, places]) => many.map((own) => {
          const known = loadOf(own), all = { threshold: -1, lowest: 0, highest: 1e4, most: 1e9 };
          const { f, w, samples } = loadLines(known, all);
          return { f: [...f], lines: w.map(({ re, im }) => places.map(([x, y]) => {
            let a = 0, b = 0;
            for (let q = 0; q < re.length; q++) {
              const away = (x - samples.x[q]) ** 2 + (y - samples.y[q]) ** 2;
              const s = spot(away, known.height, known.profile);
              a += re[q] * s;
              b += im[q] * s;
            }
            return [a, b];
          })) };
        })""",
        [many, PLACES],
    )
    for scene, own in zip(scenes_of(page, many), found, strict=True):
        pressure = scene.pressure
        on_path = pressure.tacton.trajectory.at_phase(np.linspace(0, 1, 24))
        f, lines = pressure_lines(pressure, np.vstack([PLACES, on_path]), 1e-13)
        kept = f <= 1e4
        f, lines, largest = f[kept], lines[kept], np.abs(lines).max()
        given = np.reshape(own["lines"], (-1, len(PLACES), 2)) @ [1, 1j]
        at = np.abs(np.subtract.outer(f, own["f"])).argmin(axis=1)
        known = np.abs(np.array(own["f"])[at] - f) < 1e-6
        missed = np.where(known[:, None], given[at], 0) - lines[:, : len(PLACES)]
        rough = pressure.tacton.n_paths > 1 or pressure.tacton.trajectory.shape == "recorded"
        bound = JUMPS if rough or is_abrupt(pressure) else 1e-6
        assert np.abs(missed).max() < bound * largest


def test_the_kernel_in_time_and_on_a_map(page, starts):
    many = some_values(starts, 20, rhythm=True)
    found = page.evaluate(
        """([many, times]) => many.map((own) => {
          const known = loadOf(own), motion = kernelMotion(known);
          const paper = kernelMotion({ ...known, drive: "linear", profile: "main_lobe" });
          const [map, other] = [motion, paper].map((each) => mapOf(each));
          return { f: [...motion.f], map: [...map.rms], other: [...other.rms],
            levels: [...map.level],
            waveforms: [motion, paper].map((each) => [...each.waveform(0.008, -0.003, times)]),
            at: [...amplitudesOf(motion.f, motion.at(0.008, -0.003))],
            level: levelOf(motion.f, motion.at(0.008, -0.003), "Pa"),
            share: shareOutside(map.rms, other.rms), reach: reach(known, map) };
        })""",
        [many, TIMES.tolist()],
    )
    for scene, own in zip(scenes_of(page, many), found, strict=True):
        pressure = scene.pressure
        top = pressure.peak_pressure
        for load, given in zip((pressure, published_load(pressure)), own["waveforms"], strict=True):
            wanted = load([[0.008, -0.003]], TIMES)[:, 0]
            np.testing.assert_allclose(given, wanted, rtol=0, atol=1e-9 * top)
        f, lines = pressure_lines(steady(pressure), np.array([[0.008, -0.003]]), 1e-9)
        at = [np.abs(f - each).argmin() for each in own["f"]]
        amplitudes = own["at"]
        np.testing.assert_allclose(amplitudes, np.abs(lines[at, 0]), rtol=0, atol=2e-5 * top)
        _check_map(scene, own, amplitudes)


def _check_map(scene, own, amplitudes):
    levels = sensation_level(amplitudes, own["f"], unit="Pa")
    if own["level"] is not None:
        assert own["level"]["dB"] == pytest.approx(levels.max(), abs=1e-6)
    rms, other, level = (np.reshape(own[k], (45, 45)) for k in ("map", "other", "levels"))
    if rms.any() and other.any():
        assert own["share"] == pytest.approx(share_outside(rms, other), abs=1e-6)
    places = np.stack(np.meshgrid(*2 * [np.linspace(-0.044, 0.044, 45)]), axis=-1)
    away, step = distance_from_path(scene, places), 0.002
    if scene.tacton.trajectory.is_static:
        return  # each focus at rest has its own distance
    found, inside = own["reach"], level >= 0
    if found is None or not inside.any():
        assert found is None or not rms.any()
        return
    wanted = reach_of(inside, away)
    assert wanted.metre - 1e-4 <= found["metre"] <= wanted.metre + step
    assert found["beyond"] == wanted.beyond


def test_thresholds_spectra_and_delays(page):
    f = np.array([5.0, 10, 20, 100, 137, 250, 400, 1000, 1001])
    given = page.evaluate("(f) => [f.map(thresholdAt), f.map(pressureThresholdAt)]", f.tolist())
    for found, wanted in zip(given, (threshold(f), pressure_threshold(f)), strict=True):
        np.testing.assert_allclose(np.array(found, float), wanted, rtol=1e-12)
    rng = np.random.default_rng(5)
    x = rng.normal(size=777)
    response = Response(model="x", times=np.arange(777) / 1e4, probes=np.zeros((1, 2)),
                        values=x[:, None], quantity="displacement")  # fmt: skip
    shown = page.evaluate("(x) => [...spectrum(x, 1e-4).amplitudes]", x.tolist())
    np.testing.assert_allclose(shown, spectrum(response)[1][:, 0], rtol=0, atol=1e-12)
    z, f = rng.normal(size=(40, 2, 2)), rng.uniform(10, 500, 40)
    delay = """([z, f]) => z.map(([a, b], k) => phaseDelay(
      { re: a[0], im: a[1] }, { re: b[0], im: b[1] }, f[k]))"""
    lines = (z @ [1, 1j]).T[:, :, None]
    wanted = [phase_delays(*lines[:, k : k + 1], f[k : k + 1], np.zeros((1, 2)))[0, 0]
              for k in range(40)]  # fmt: skip
    np.testing.assert_allclose(page.evaluate(delay, [z.tolist(), f.tolist()]), wanted, atol=1e-12)


def test_the_delay_is_that_of_the_strongest_line_where_its_pressure_is_largest(page, starts):
    own = starts | {"shape": "circle", "size": 20, "speed": 6}
    found = page.evaluate(
        """(own) => {
          const f = [50, 80], wave = (size, delay) => ({ re: f.map((at, l) => size[l]
            * Math.cos(2 * Math.PI * at * delay)), im: f.map((at, l) => -size[l]
            * Math.sin(2 * Math.PI * at * delay)) });
          const kernel = { f, at: (x) => wave([2, 1 + 50 * x], 0) };
          const waves = { f, at: (x) => wave([1, 2 - 50 * x], 1e-3 + 0.1 * x) };
          return delayOf(kernel, waves, loadOf(own));
        }""",
        own,
    )
    assert found == {"delay": pytest.approx(2e-3), "f": 80}


def test_the_bessel_function_of_layers(page):
    z = np.array([0.3, 7, 17.9, 18.1, 60])[:, None] + 1j * np.array([0, -2, 0.7])
    given = [[a.real, a.imag] for a in z.ravel()]
    found = page.evaluate("(z) => z.map(([a, b]) => besselJ0(a, b))", given)
    np.testing.assert_allclose(np.array(found) @ [1, 1j], jv(0, z.ravel()), rtol=0, atol=3e-7)


def test_the_highest_level_over_a_control_is_refined(page, starts):
    own = starts | {"am": 0, "shape": "circle", "size": 20, "x": 10, "y": 0, "body": "none"}
    found = page.evaluate(
        """(own) => {
          const levelsAt = (size) => {
            if (size > 50) throw new Error("off the body");
            const known = loadOf({ ...own, size });
            const motion = kernelMotion(known);
            const level = levelOf(motion.f, motion.at(0.01, 0), "Pa");
            return { kernel: level?.dB ?? NaN, waves: NaN };
          };
          const steps = [...levelOver(levelsAt, [2, 60], { lead: "kernel", count: 24 })];
          const dense = Array.from({ length: 400 }, (_, k) => levelsAt(10 + k / 20));
          return { ...steps.pop(), dense };
        }""",
        own,
    )
    assert max(found["x"]) <= 50
    assert len(found["x"]) == len(found["kernel"]) == 20
    highest = max(each["kernel"] for each in found["dense"])
    assert found["best"]["level"] == pytest.approx(highest, abs=0.01)
    scene = scenes_of(page, [own | {"size": round(found["best"]["at"], 3)}])[0]
    f, lines = pressure_lines(scene.pressure, np.array([[0.01, 0.0]]))
    levels = sensation_level(np.abs(lines[1:, 0]), f[1:], unit="Pa")
    assert found["best"]["level"] == pytest.approx(levels.max(), abs=0.01)


def test_names_of_lines(page, starts):
    paper = [starts | preset["values"] for preset in presets()]
    many = [*paper, *some_values(starts, 40, rhythm=False)]
    named = """(many) => many.map((own) => {
      const load = loadOf(own), name = namesOf(load);
      return [...loadLines(load, { most: 1000 }).f].map((f) => [name(f), f]);
    })"""
    found = page.evaluate(named, many)
    for scene, own in zip(scenes_of(page, many), found, strict=True):
        lines = line_names(scene.pressure, most=2000)
        theirs = dict(zip(lines.names, lines.frequencies.tolist(), strict=True))
        ours = {name: f for name, f in own if name}
        assert all(ours[name] == pytest.approx(theirs[name]) for name in ours.keys() & theirs)
        strong = lines.strengths > 1e-2 * lines.strengths.max(initial=0)
        strong &= lines.frequencies < 1e3
        assert {*np.array(lines.names)[strong].tolist()} <= ours.keys()


def test_tables_and_sound(page, starts, tmp_path):
    table, lines, sound = page.evaluate(
        f"""(own) => {{ const answer = ({ANSWER})(own);
          return [waveformCsv(answer), linesCsv(answer), [...waveformWav(answer)]]; }}""",
        starts | {"duration": 0.2},
    )
    (tmp_path / "waveform.csv").write_text(table)
    measured = read(tmp_path / "waveform.csv")
    assert measured.quantity == "displacement"
    np.testing.assert_allclose(measured.places, [[0.01, 0]])
    rate, samples = wavfile.read(BytesIO(bytes(sound)))
    values = measured.values[0, :, 0] - measured.values.mean()
    assert rate == 10_000
    np.testing.assert_allclose(samples, 32767 * values / np.abs(values).max(), atol=1)
    header, *rows = lines.splitlines()
    assert header.startswith('line,"frequency, Hz","displacement, µm"')
    assert {"f_AM", "f_d", "f_d-f_AM"} <= {row.split(",")[0] for row in rows}


def test_levels_of_lines_are_those_of_displacement_in_any_quantity(page, starts):
    tables = page.evaluate(
        f"(many) => many.map((own) => linesCsv(({ANSWER})(own)))",
        [
            starts | {"drive": "pressure_squared"} | each
            for each in ({}, {"quantity": "velocity"}, {"pulses": "100/50", "ramp": 10})
        ],
    )
    still, moving, pulsed = (
        {row[1]: row for row in csv.reader(each.splitlines()[1:])} for each in tables
    )
    pairs = [(still[f], moving[f]) for f in still.keys() & moving.keys() if still[f][4]]
    assert len(pairs) > 3
    for (_, f, metre, pressure, level), (_, _, speed, *others) in pairs:
        assert others == [pressure, level]
        assert float(speed) == pytest.approx(2e-3 * np.pi * float(f) * float(metre), rel=1e-7)
        expected = sensation_level(1e-6 * float(metre), float(f))
        assert float(level) == pytest.approx(expected, abs=1e-6)
    mean = (80 + 2 * 10 / 3) / 150  # of the squared level of a pulse with two ramps
    assert pulsed.keys() == still.keys()
    for f, (_, _, metre, pressure, level) in pulsed.items():
        given = [mean * float(x) for x in still[f][2:4]]
        assert [float(metre), float(pressure)] == pytest.approx(given, rel=1e-5)
        assert level == still[f][4]


@pytest.mark.parametrize(
    ("header", "mark", "quantity"),
    [
        ("t [s],displacement(0,0) [m],displacement(10,-5) [m]", ",", "displacement"),
        ("Time (ms);Velocity (mm/s);Velocity 2 (mm/s)", ";", "velocity"),
        ("t [ms],u(0,1) [µm],u(1,0) [µm]", ",", "displacement"),
        ("# from a vibrometer\ntime [s]\ta [m/s²]\tb [m/s²]", "\t", "acceleration"),
    ],
)
def test_reading_of_measurements(page, tmp_path, header, mark, quantity):
    t = np.arange(40) * 1e-3
    rows = (mark.join(f"{x:.9f}" for x in (a, np.sin(a), np.cos(a))) for a in t)
    text = "\n".join([header, *((row.replace(".", ",") if mark == ";" else row) for row in rows)])
    file = tmp_path / "measured.csv"
    file.write_text(text, encoding="utf-8")
    found = page.evaluate("(text) => readMeasurement(text, 'a.csv')", text)
    wanted = read(file)
    assert found["quantity"] == wanted.quantity == quantity
    np.testing.assert_allclose(found["values"], wanted.values[0].T, rtol=1e-12)
    np.testing.assert_allclose(found["times"], wanted.times - wanted.times[0], atol=1e-12)
    if "(0,0)" in header:
        np.testing.assert_allclose(found["places"], wanted.places)


def test_other_files_are_refused(page):
    read_all = "(texts) => texts.map((text) => attempt(() => readMeasurement(text, 'a.csv')))"
    for found in page.evaluate(read_all, REFUSED):
        assert "skinwave web" in found["refused"]


def test_a_body_without_a_pack_is_named_on_the_page(monkeypatch):
    def packed(body, progress):
        if body.of_kind.is_plate:
            raise ArithmeticError("no modes")
        return pack_of(body, progress)

    monkeypatch.setattr(html_file, "pack_of", packed)
    found = html_file.data_of(bodies=["paper-sheet", "skin-slab"], tests=0)
    assert [record["name"] for record in found["bodies"]] == ["skin-slab"]
    assert found["start"] == {"body": "skin-slab"}
    assert "1 part of this result failed" in html_file.page(found)
    with pytest.raises(ValueError, match="no modes"):
        html_file.data_of(bodies=["paper-sheet"], tests=0)
