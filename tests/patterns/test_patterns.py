"""Pattern files: import, export and round trip; what is malformed is refused in one line."""

import asyncio
import io
import json
import re
import runpy
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pattern_files import STEP, adaptics, brush, f64, jump, keyframe, stop
from scipy.io import wavfile

from simple_model import MovingPressure, Rhythm, Tacton, Trajectory
from skinwave import Body, Scene, dumps, loads, read, simulate
from skinwave.commands.cli import main
from skinwave.patterns import Options, read_pattern, write_pattern
from skinwave.patterns.adaptics_file import REVISIONS
from skinwave.system.effort import SkinwaveWarning

LEFT, RIGHT = (-10.0, 0.0), (10.0, 0.0)
NEAR = {"near": {"default": 0.0, "min": 0.0, "max": 2.0, "step": 0.1}}
CIRCLE = Trajectory(shape="circle", size=0.02, speed=12.0)
PROBES = [[0.010, 0.0], [0.015, 0.0], [0.0, 0.005]]
WRONG_COMMANDS = (
    "missing.csv out.toml", "good.csv out.mp3", "good.csv out.toml --height 900",
    "good.csv out.csv --rate 1e6", "good.csv out.wav", "good.csv out.toml --scene missing.toml",
    "good.wav out.toml --role sound", "good.wav out.toml --scale loud",
    "good.wav out.toml --role envelope", "good.csv out.py --package autd",
)  # fmt: skip
POINT = brush(radius=0.0)
FADING = Trajectory(
    shape="recorded", points=((0, 0), (0.01, 0), (0, 0.01)), times=(0.0, 0.05, 0.1),
    levels=(1.0, 0.4, 0.7),
)  # fmt: skip
BACK = jump("near", "lt", 1.0, 0.0)
CIRCUIT = [
    keyframe(0, LEFT, POINT),
    keyframe(500, RIGHT, POINT) | {"cjumps": [BACK]},
    keyframe(800, (10.0, 30.0), POINT) | {"cjumps": [jump("near", "gt_eq", 2.0, 600.0)]},
    stop(1000),
]


def imported(folder, content, suffix=".adaptics", **options):
    path = folder / f"pattern{suffix}"
    if isinstance(content, dict):
        content = json.dumps(content)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_pattern(path, Options(**options))


def exported(scene, suffix, **options):
    return write_pattern(scene, suffix, Options(**options))[0]


def flat(tacton, **pressure):
    return Scene(pressure=MovingPressure(tacton=tacton, **pressure), body=Body())


@pytest.mark.parametrize(("name", "revision"), [("circle", REVISIONS[0]), ("line", REVISIONS[-1])])
def test_a_brush_comes_back_on_the_same_path_at_the_same_frequency(tmp_path, name, revision):
    drawn = brush(name, am_freq=140.0, stm_freq=190.98593171027443)
    source = adaptics(keyframe(0, (3.0, -4.0), drawn), stop(500), revision=revision)
    scene, _ = imported(tmp_path, source)
    path = scene.tacton.trajectory
    assert path.drawing_frequency == pytest.approx(190.98593171027443, rel=1e-14)
    assert (scene.tacton.am_frequency, scene.tacton.duration) == (140.0, 0.5)
    assert (scene.pressure.drive, scene.pressure.height) == ("pressure_squared", 0.18)
    u = np.linspace(0, 2 * np.pi, 50, endpoint=False)
    offset = {
        "circle": np.stack([np.cos(u), np.sin(u)], -1),
        "line": np.cos(u)[:, None] * [np.cos(np.pi / 6), np.sin(np.pi / 6)],
    }[name]
    places = [0.003, -0.004] + 0.01 * offset
    np.testing.assert_allclose(path.at_phase(u / 2 / np.pi), places, atol=1e-15)
    back, _ = imported(tmp_path, exported(loads(dumps(scene)), ".adaptics"))
    t = np.linspace(0, 0.5, 5001)
    again = back.tacton.trajectory
    np.testing.assert_allclose(again.position(t), path.position(t), rtol=0, atol=1e-9)
    assert again.drawing_frequency == pytest.approx(path.drawing_frequency, rel=1e-12)
    assert back.tacton.am_frequency == 140.0
    assert back.pressure.height == pytest.approx(0.18, rel=1e-12)


def test_parameters_and_formulas_take_their_bounded_defaults(tmp_path):
    half = {"type": "divide", "value": [{"type": "parameter", "value": "size"},
                                        {"type": "constant", "value": 2.0}]}  # fmt: skip
    drawn = brush(radius={"type": "param", "value": "size"},
                  am_freq={"type": "formula", "value": half})  # fmt: skip
    scene, notes = imported(tmp_path, adaptics(keyframe(0, drawn=drawn)))
    assert scene.tacton.trajectory.size == pytest.approx(0.012)  # 7 mm are cut to 6
    assert scene.tacton.am_frequency == 3.0
    assert "parameter 'size' at its default, 6" in notes


def test_keyframes_move_pause_fade_and_jump(tmp_path):
    point = brush(radius=0.0)
    source = adaptics(
        keyframe(0, (-10.0, 0.0), point),
        keyframe(100, (10.0, 0.0), point),
        keyframe(200, None, point),
        keyframe(300, (10.0, 20.0), point, 0.0, STEP),
        keyframe(400, (0.0, 0.0), point, 0.5),
        stop(450),
    )
    scene, _ = imported(tmp_path, source)
    path = scene.tacton.trajectory
    assert scene.tacton.duration == pytest.approx(0.45)
    t = np.array([0.05, 0.15, 0.25, 0.35, 0.42])
    expected = [[0, 0], [10, 0], [10, 10], [10, 20], [0, 0]]
    np.testing.assert_allclose(1e3 * path.position(t), expected, atol=1e-6)
    np.testing.assert_allclose(path.level_at_phase(path.phase(t)), [1, 1, 0.5, 0, 0.5], atol=1e-6)


def test_a_lissajous_is_recorded_as_the_engine_draws_it(tmp_path):
    drawn = brush("lissajous", x_scale=10.0, y_scale=6.0, a=2.0, b=3.0, d=0.5, rotation=0.0)
    scene, notes = imported(tmp_path, adaptics(keyframe(0, drawn=drawn), stop(100)))
    t = np.arange(2000) / 20_000
    u = 2 * np.pi * 80 * t
    expected = np.stack([0.010 * np.sin(2 * u + 0.5), 0.006 * np.sin(3 * u)], -1)
    np.testing.assert_allclose(scene.tacton.trajectory.position(t), expected, atol=2e-5)
    assert any("20000 Hz" in note for note in notes)


def test_places_are_scaled_then_turned_then_moved(tmp_path):
    placed = {
        "translate": {"x": f64(1.0), "y": f64(2.0), "z": f64(180.0)}, "rotation": f64(90.0),
        "scale": {"x": f64(1.0), "y": f64(2.0), "z": f64(1.0)},
    }  # fmt: skip
    table = adaptics(keyframe(0, (3.0, 4.0), POINT), geometric_transforms=placed)
    (centre,) = {imported(tmp_path, table)[0].tacton.trajectory.centre}
    assert centre == pytest.approx((-7e-3, 5e-3))


@pytest.mark.parametrize(
    ("near", "note", "period", "expected"),
    [
        ({}, "parameter 'near' at its default, 0", 0.5, {0.125: (-5, 0), 0.4: (6, 0)}),
        ({"near": 2.0}, "the first 800 ms are left out", 0.2, {0.1: (10, 20), 0.15: (10, 25)}),
        ({"near": 9.0}, "'near' = 2", 0.2, {0.05: (10, 15)}),
    ],
)
def test_jumps_are_taken_at_the_values_of_parameters(tmp_path, near, note, period, expected):
    source = adaptics(*CIRCUIT) | {"user_parameter_definitions": NEAR}
    scene, notes = imported(tmp_path, source, parameters=near)
    assert any(note in each for each in notes)
    assert scene.tacton.duration == pytest.approx(period)
    assert 1 / scene.tacton.trajectory.drawing_frequency == pytest.approx(period)
    places = 1e3 * scene.tacton.trajectory.position(list(expected))
    np.testing.assert_allclose(places, list(expected.values()), atol=0.01)


def test_a_loop_is_as_many_rounds_as_bring_its_brush_back(tmp_path):
    for f_d, period, jumps in ((90.0, 0.5, False), (90.001, 0.5, True)):
        drawn = brush(radius=5.0, stm_freq=f_d)
        frames = [keyframe(0, LEFT, drawn), keyframe(125, RIGHT, drawn) | {"cjumps": [BACK]}]
        source = adaptics(*frames) | {"user_parameter_definitions": NEAR}
        scene, notes = imported(tmp_path, source)
        assert scene.tacton.duration == pytest.approx(period)
        assert any("brush jumps" in note for note in notes) == jumps
        t = np.arange(1000) / 2000
        u = 2 * np.pi * f_d * t
        centre = np.stack([-10 + 20 * np.mod(t, 0.125) / 0.125, 0 * t], -1)
        expected = centre + 5 * np.stack([np.cos(u), np.sin(u)], -1)
        away = np.linalg.norm(1e3 * scene.tacton.trajectory.position(t) - expected, axis=1)
        assert (away < 0.02).mean() > 0.99  # but where it jumps back


def test_a_wide_pattern_needs_no_body_but_in_a_scene(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    drawn = brush(radius=20.0, stm_freq=100.0)
    wide = adaptics(keyframe(0, (-100.0, 0.0), drawn), keyframe(500, (100.0, 0.0), drawn))
    Path("wide.adaptics").write_text(json.dumps(wide))
    Path("base.toml").write_text("[body]\nkind = 'slab'\n")
    assert main(["convert", "wide.adaptics", "wide.csv", "--scene", "base.toml"]) == 0
    x = np.loadtxt("wide.csv", delimiter=",", skiprows=1)[:, 2]
    assert (x.min(), x.max()) == (pytest.approx(-0.118, abs=5e-5), pytest.approx(0.12, abs=5e-5))
    assert main(["convert", "wide.adaptics", "wide.toml"]) == 0
    assert read("wide.toml").body.width == pytest.approx(0.26, abs=1e-3)
    assert main(["convert", "wide.adaptics", "on.toml", "--scene", "base.toml"]) == 2
    assert "--resize" in capsys.readouterr().err
    smaller = ["--scene", "base.toml", "--resize", "0.4"]
    assert main(["convert", "wide.adaptics", "on.toml", *smaller]) == 0
    path = read("on.toml").tacton.trajectory
    assert np.abs(path.outline[:, 0]).max() == pytest.approx(0.048, abs=2e-4)
    assert path.drawing_frequency == pytest.approx(2.0)


@pytest.mark.parametrize(
    "header", ["t_ms,x_mm,y_mm,z_mm,intensity", "Time [s],X (cm),Y (mm),z,Amplitude"]
)
def test_columns_of_other_tools_are_read_in_their_units(tmp_path, header):
    scale = [{"ms": 1e3, "mm": 1e3, "cm": 1e2}.get(word.strip(" )]")[-2:], 1.0)
             for word in header.split(",")]  # fmt: skip
    rows = np.array([[0, 0.01, 0, 0.2, 1], [0.01, 0, 0.01, 0.2, 0.5], [0.02, -0.01, 0, 0.2, 1]])
    text = header + "\n" + "\n".join(",".join(f"{v:.9g}" for v in row * scale) for row in rows)
    scene, _ = imported(tmp_path, text, ".csv")
    path = scene.tacton.trajectory
    np.testing.assert_allclose(path.position([0, 0.01, 0.02]), rows[:, 1:3], atol=1e-12)
    assert path.levels[:3] == (1.0, 0.5, 1.0)
    assert (scene.pressure.height, scene.tacton.duration) == (0.2, pytest.approx(0.03))


@pytest.mark.parametrize(
    "path",
    [
        Trajectory(shape="polyline", points=((0, 0), (0.01, 0.004), (0, 0.01)), speed=2.0,
                   sweep="sinusoidal"),
        Trajectory(shape="recorded", points=((0, 0), (0.01, 0), (0, 0.01)), times=(0, 0.01, 0.02),
                   hold=True),
    ],
    ids=lambda path: f"{path.shape} {path.sweep} {path.hold}",
)  # fmt: skip
def test_paths_that_no_brush_draws_become_keyframes(tmp_path, path):
    scene = flat(Tacton(trajectory=path, duration=0.1, foci=(0.2,)))
    back, _ = imported(tmp_path, exported(scene, ".adaptics"))
    t = np.arange(2000) / 20_000
    asked = path.at_phase(np.mod(path.phase(t) + 0.2, 1.0))
    away = np.linalg.norm(back.tacton.trajectory.position(t) - asked, axis=1)
    assert (away < 4e-5).mean() > 0.99  # 0.02 mm out and in, but where it jumps


def test_what_adaptics_has_no_words_for_is_said():
    for tacton, said in (
        (Tacton(foci=(0.0, 0.5)), "several foci"),
        (Tacton(trajectory=Trajectory(shape="line", size=2e-4, speed=4)), "keyframes"),
    ):
        with pytest.raises(ValueError, match=said):
            exported(flat(tacton), ".adaptics")
    with pytest.raises(ValueError, match="pressure_squared"):
        exported(flat(Tacton(am_frequency=80.0), drive="linear"), ".adaptics")


@pytest.mark.parametrize(
    ("tacton", "drive"),
    [
        (Tacton(amplitude=0.6, trajectory=CIRCLE, duration=0.1), "linear"),
        (Tacton(rhythm=Rhythm(pulses=((0.02, 0.01),)), duration=0.1), "force_corrected"),
        (Tacton(foci=(0.0, 0.25, 0.5), trajectory=CIRCLE, duration=0.1), "pressure_squared"),
        (Tacton(trajectory=FADING, duration=0.1), "pressure_squared"),
    ],
)
def test_csv_carries_the_load_of_any_tacton(tmp_path, tacton, drive):
    scene = flat(tacton, drive=drive)
    back, _ = imported(tmp_path, exported(scene, ".csv", rate=20_000), ".csv")
    t = np.arange(1999) / 20_000
    before, after = (s.pressure(np.array(PROBES), t) for s in (scene, back))
    assert np.abs(after - before).max() < 1e-9 * before.max()
    assert len(back.tacton.foci) == len(tacton.foci)


def test_tidy_csv_takes_its_columns_in_any_order_and_different_paths(tmp_path):
    text = "# made by hand\nx_m,y_m,t_s,point\n" + "".join(
        f"{0.001 * k},{0.002 * point},{0.01 * k},{point}\n" for k in range(5) for point in range(3)
    )
    scene, notes = imported(tmp_path, text, ".csv")
    load = scene.pressure
    t = np.array([0.0, 0.015, 0.03])
    foci = [[0.0015, 0.002 * point] for point in range(3)]
    alone = [load.spot(np.array(PROBES), np.array(focus)) for focus in foci]
    np.testing.assert_allclose(load(np.array(PROBES), t)[1], 50 / 3 * sum(alone), rtol=1e-9)
    assert any("1/3" in note for note in notes)


def test_a_focus_that_rises_needs_a_height(tmp_path):
    text = "t_s,x_m,y_m,z_m\n0,0,0,0.2\n0.1,0.01,0,0.21\n"
    with pytest.raises(ValueError, match="from 200 to 210 mm above the array"):
        imported(tmp_path, text, ".csv")
    assert imported(tmp_path, text, ".csv", height=0.2)[0].pressure.height == 0.2


def test_wav_is_a_modulation_at_any_rate(tmp_path):
    t = np.arange(4410) / 44_100
    wave = 0.5 * np.sin(2 * np.pi * 140 * t)
    for samples in ((2**15 * wave).astype(np.int16), (2**7 * wave + 128).astype(np.uint8)):
        for scale, peak in (("full", 0.5), ("peak", 1.0), ("rms", 1.0)):
            scene, _ = imported(tmp_path, wav(samples, 44_100), ".wav", scale=scale)
            signal = scene.tacton.signal
            assert max(signal.samples) == pytest.approx(peak, abs=0.02)
            assert scene.tacton.duration == pytest.approx(0.1)
        assert np.abs(signal.at(t) - np.sin(2 * np.pi * 140 * t)).max() < 0.02


def test_wav_is_an_envelope_of_the_scene_it_is_put_on(tmp_path):
    wavfile.write(tmp_path / "a.wav", 8000, np.linspace(0, 1, 800).astype(np.float32))
    base = flat(Tacton(am_frequency=140, trajectory=CIRCLE))
    scene, _ = read_pattern(tmp_path / "a.wav", Options(role="envelope"), base)
    assert scene.tacton.trajectory == CIRCLE
    t = np.array([0.01, 0.05])
    gain = base.pressure.gain(t) * (t / (799 / 8000)) ** 2
    np.testing.assert_allclose(scene.pressure.gain(t), gain, rtol=1e-6)


def test_the_script_states_its_frequency_and_holds_its_foci():
    for sharing, drawn, foci in (("simultaneous", 191.388, 2), ("time_multiplexed", 190.476, 1)):
        tacton = Tacton(trajectory=CIRCLE, foci=(0.0, 0.5), am_frequency=80, sharing=sharing)
        script, notes = write_pattern(flat(tacton), ".py", Options())
        assert any(f"{drawn:g} Hz" in note and "190.986 Hz" in note for note in notes)
        step = 20 * np.sin(np.pi * drawn / 40e3 * (2 if foci == 1 else 1))  # mm, a chord
        assert any(f"up to {step:.3g} mm from its last place" in note for note in notes)
        assert "FociSTM" in compile(script, "script", "exec").co_names
        radii = np.linalg.norm(eval_list(script, "PLACES"), axis=2)
        np.testing.assert_allclose(radii, 10.0, atol=1e-3)
        assert radii.shape[1] == foci
        sound = eval_list(
            script, "MODULATION"
        )  # 255 (1 + sin) / 2, of which the load is the square
        assert max(sound) == 255
        assert np.mean(sound) == pytest.approx(127.5, abs=1)


def played(script, tmp_path):
    path = tmp_path / "play.py"
    path.write_bytes(script)
    return runpy.run_path(str(path))


def test_autd3_plays_the_script_of_its_package(tmp_path):
    """The link is the emulator of the device."""
    pytest.importorskip("autd3")
    pytest.importorskip("autd3_modulation")
    for tacton in (
        Tacton(duration=0.02), Tacton(trajectory=CIRCLE, am_frequency=80, duration=0.02),
        Tacton(trajectory=CIRCLE, foci=tuple(np.arange(8) / 8), duration=0.02),
        Tacton(trajectory=FADING, duration=0.1),
    ):  # fmt: skip
        script, _ = write_pattern(flat(tacton), ".py", Options(package="autd3"))
        asyncio.run(played(script, tmp_path)["play"]())


def test_what_autd3_emits_arrives_in_phase_at_the_focus_as_strong_as_commanded(tmp_path):
    emulator = pytest.importorskip("autd3_emulator")
    from autd3 import Duration
    from autd3.commands import SetSilencer
    from autd3.geometry import Autd3, Geometry

    tacton = Tacton(trajectory=CIRCLE, am_frequency=80, duration=0.1)
    script, _ = write_pattern(flat(tacton), ".py", Options(package="autd3"))
    own, geometry = played(script, tmp_path), Geometry([Autd3()])
    ticks = 400

    def send(recorder):
        for command in (SetSilencer.disable(), *own["commands"](geometry)):
            recorder.send(command)
        recorder.tick(Duration.from_micros(25 * ticks))

    record = emulator.Emulator(geometry).record(send)
    phases = 2 * np.pi / 256 * record.phase().to_numpy()  # transducers, ticks
    sources = geometry.device(0).positions() - geometry.center()

    def coherence(tick, place):
        distances = np.linalg.norm(sources - [*place, 200.0], axis=1)
        return abs(np.exp(1j * (phases[:, tick] + 2 * np.pi * distances / 8.5)).mean())  # 340 m/s

    angles = 2 * np.pi * 191.388 * np.arange(ticks) / 40e3
    for tick in (0, 57, 150, 333):
        place = 10 * np.array([np.cos(angles[tick]), np.sin(angles[tick])])
        assert coherence(tick, place) > 0.9  # some transducers lag where their phase passes 0
        assert coherence(tick, -place) < 0.3
    sound = np.sin(np.pi * record.pulse_width().to_numpy()[0] / 512)
    wanted = np.repeat(own["MODULATION"], own["MODULATION_TICKS"])[:ticks] / 255
    np.testing.assert_allclose(sound, wanted, atol=0.01)


def eval_list(script, name):
    text = script.decode().split(f"{name} = ", 1)[1].split("\n\n")[0]
    text = text.split("\nMODULATION")[0]
    lines_ = [line.split("#")[0] for line in text.splitlines()]
    return json.loads("".join(lines_).replace(",]", "]").replace(" ", "").replace(",]", "]"))


def test_convert_writes_a_scene_that_runs_and_keeps_what_is_there(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("in.adaptics").write_text(json.dumps(adaptics(keyframe(0), stop(20))))
    assert main(["convert", "in.adaptics", "out.toml"]) == 0
    assert read("out.toml").tacton.trajectory.shape == "circle"
    assert main(["convert", "in.adaptics", "out.toml"]) == 2
    capsys.readouterr()
    assert main(["convert", "in.adaptics", "out.toml", "--overwrite", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["out"] == "out.toml"
    assert main(["convert", "out.toml", "again.csv", "--rate", "20000", "--quiet"]) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["again.csv", "in.adaptics", "out.toml"]
    assert len(Path("again.csv").read_text().splitlines()) == 401
    model = ["--model", "point-kernel", "--quiet"]
    assert main(["run", "out.toml", "--out", "run", *model]) == 0


def malformed():
    good = adaptics(keyframe(0), stop(100))

    def with_(*keyframes, **changes):
        own = {"keyframes": list(keyframes)} if keyframes else {}
        return json.dumps(good | own | changes).encode()

    rising, random = keyframe(100, (0.0, 0.0)), keyframe(0)
    rising["coords"]["coords"]["z"] = 30.0
    random["intensity"]["intensity"] = {"name": "random", "params": {}}
    power = {"type": "formula", "value": {"type": "power", "value": [1, 2]}}
    header = b"t_s,point,x_m,y_m,z_m,intensity\n"
    return {
        "empty.adaptics": b"",
        "other.adaptics": b'{"a": 1}',
        "revision.adaptics": with_(**{"$REVISION": "2.0"}),
        "number.adaptics": with_(**{"keyframes": 3}),
        "kind.adaptics": with_({"time": 0, "type": "hop"}),
        "brush.adaptics": with_(keyframe(0, drawn=brush("star"))),
        "param.adaptics": with_(keyframe(0, drawn=brush(radius={"type": "param", "value": "q"}))),
        "formula.adaptics": with_(keyframe(0, drawn=brush(radius=power))),
        "jump.adaptics": with_(keyframe(0) | {"cjumps": [jump("size", "near", 1, 0)]}, stop(9)),
        "random.adaptics": with_(random),
        "rising.adaptics": with_(keyframe(0), rising),
        "long.adaptics": with_(keyframe(0), stop(40_000)),
        "empty.csv": b"",
        "binary.csv": b"\xff\xfe\x00\x01",
        "column.csv": b"t_s,xx_m,y_m\n0,0,0\n",
        "short.csv": header + b"0,0,0,0\n",
        "word.csv": header + b"0,0,a,0,0.2,1\n",
        "loud.csv": header + b"0,0,0,0,0.2,1.5\n",
        "points.csv": header + b"0,3,0,0,0.2,1\n",
        "falls.csv": header + b"0,0,0,0,0,1\n1,0,0,0,0,1\n0.5,0,0,0,0,1\n",
        "bare.csv": b"0,0\n0.01,0\n",
        "text.wav": b"RIFFxxxxWAVE" * 5,
        "silent.wav": wav(np.zeros(100, np.int16)),
        "stereo.wav": wav(np.ones((100, 2), np.int16)),
        "huge.wav": wav(np.array([0, 1e308])),
        "faint.wav": wav(np.array([0, 5e-324])),
        "huge.csv": header + b"0,0,0,0,0.2,1\n0.1,0,1e308,0,1e308,1\n",
        "loud.wav": wav(np.array([1, 1.5], np.float32)),
        "what.txt": b"",
    }  # fmt: skip


def wav(samples, rate=8000):
    file = io.BytesIO()
    wavfile.write(file, rate, samples)
    return file.getvalue()


def test_what_is_no_pattern_is_refused_in_one_line(tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    for name, content in malformed().items():
        Path(name).write_bytes(content)
        assert f"{name}: " in refused("convert", name, "out.toml")


def test_conversions_that_cannot_be_are_refused_in_one_line(tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    Path("good.csv").write_text("t_s,x_m,y_m\n0,0,0\n0.01,0.004,0\n")
    Path("good.wav").write_bytes(wav(np.array([0.5, -0.5, 0.2], np.float32)))
    for arguments in WRONG_COMMANDS:
        refused("convert", *arguments.split())


def test_the_change_of_the_load_by_a_conversion_is_said():
    jumps = loads("[tacton]\nshape = 'line'\nsize_mm = 20\nspeed_m_per_s = 2\nsweep = 'one_way'\n")
    (csv,) = (note for note in write_pattern(jumps, ".csv", Options())[1] if "read back" in note)
    straight, held = (float(x) for x in re.findall(r"([\d.]+) %", csv))
    assert straight > 3 > 1 > held  # a jump is a straight line over one sample
    (said,) = (n for n in write_pattern(jumps, ".adaptics", Options())[1] if "read back" in n)
    assert float(re.search(r"([\d.]+) %", said)[1]) > 3


def test_a_rate_too_low_for_the_modulation_makes_a_note():
    scene = loads("[tacton]\nam_frequency_hz = 200\nduration_s = 0.5\n")
    (said,) = (n for n in write_pattern(scene, ".csv", Options(rate=250))[1] if "AM of" in n)
    assert "50 Hz" in said
    assert not any("AM of" in note for note in write_pattern(scene, ".py", Options())[1])


def test_a_recorded_path_that_repeats_has_a_steady_state(tmp_path):
    points = [(0.01, 0), (0, 0.01), (-0.01, 0), (0, -0.01)] * 2
    rows = [f"{0.01 * k:.2f},0,{x},{y},0.2,1" for k, (x, y) in enumerate(points)]
    text = "\n".join(["t_s,point,x_m,y_m,z_m,intensity", *rows])
    scene, _ = imported(tmp_path, text, ".csv", hold=True)
    assert scene.tacton.trajectory.drawing_frequency == pytest.approx(12.5)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkinwaveWarning)
        rest, steady = (simulate(scene, m) for m in ("flat-body", "flat-body-harmonic"))
        tacton = replace(scene.tacton, duration=0.8)
        long = replace(scene, pressure=replace(scene.pressure, tacton=tacton))
        later = simulate(long, "flat-body")
    assert np.abs(steady.values - later.values[-800:]).max() < 1e-3 * np.abs(later.values).max()
    off = [np.sqrt((x**2).sum(axis=0)) for x in (steady.values - rest.values, rest.values)]
    assert steady.expected_error == pytest.approx((off[0] / off[1]).max(), rel=0.01)
    assert "use --model flat-body" in steady.effort.warnings[0]
    assert rest.expected_error < 0.05
