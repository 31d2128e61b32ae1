"""The interactive tool: its model, its state without a browser, and the page itself."""

import asyncio
import json
import re
import subprocess
import sys
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from simple_model import (
    MovingPressure,
    Tacton,
    Trajectory,
    commanded,
    line_table,
    point_kernel,
    sensation_level,
    spectrum,
)
from simple_model.flat_body import steady_lines
from simple_model.focus import focal_spot, lobe_width, relative_intensity, spot_width
from simple_model.wavenumber_integral import point_response
from skinwave.bodies.analytic import compliance
from skinwave.cli import main
from skinwave.models import speeds
from skinwave.planning.plan import plan
from skinwave.planning.warnings import NONLINEAR
from skinwave.propagation import share_outside
from skinwave.scene import BODIES, KINDS, Body
from skinwave.scene_file import dumps, loads
from skinwave.simulation import compute
from skinwave.steps import PREPARING, Step, follower
from skinwave.studies.driven_modes import driven_modes
from skinwave.studies.paper15 import tactons
from skinwave.surface import body_map, grid, kernel_map
from skinwave.web import (
    check_extra,
    controls,
    downloads,
    drawings,
    guided,
    insets,
    model,
    moves,
    moving,
    plots,
    saved_figure,
    scenes,
    shown,
    slabs,
    waves,
    worker,
)
from skinwave.web.controls import STARTS
from skinwave.web.examples import EXAMPLES
from skinwave.web.history import History
from skinwave.web.memory import REST
from skinwave.web.session import told
from skinwave.web.shown import unresolved
from skinwave.web.worker import Worker


def nothing(phase, fraction):
    pass


@pytest.fixture(scope="module")
def scene():
    """A short Tacton of AM and STM on the slab."""
    return scenes.scene_of(STARTS | {"body": "skin-slab", "duration": 0.15, "x": 7.3, "y": -2.1})


def test_without_the_extra_one_sentence_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"which are not installed; pip install 'skinwave\[web\]'"):
        check_extra()
    assert main(["web"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_help_and_import_load_no_page():
    code = "import sys, skinwave, skinwave.cli as c\ntry: c.main(['web', '--help'])\n"
    code += "except SystemExit: pass\nassert not {'trame', 'numpy', 'aiohttp'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


def test_a_scene_that_no_control_says_is_refused_by_the_command(tmp_path, capsys):
    pytest.importorskip("trame")
    path = tmp_path / "own.toml"
    path.write_text('[tacton]\nshape = "polyline"\npoints_mm = [[0, 0], [5, 5]]\n')
    assert main(["web", str(path)]) == 2
    assert "a path of its own points cannot be set here" in capsys.readouterr().err


# Controls


def test_an_address_carries_every_control():
    changed = STARTS | {
        "amplitude": 55.0, "am": 33.5, "am2": 210.0, "ratio": "0.25:0.75", "envelope": 2.5,
        "duration": 0.7, "shape": "triangle", "size": 31.5, "speed": 4.2, "height": 150.0,
        "drive": "force_corrected", "profile": "main_lobe", "body": "palm",
        "foci": 3, "sharing": "time_multiplexed",
        "pulses": "100/50, 40/110", "phases": "0, 20, 70", "ramp": 5.0, "x": -3.21, "y": 4.0,
        "drawn": 42.5, "paths": "circle/20/-15/0, line/10/15/0.5, point/0/0/-20",
        "layers": "0.3/45, inf/5", "depth": 0.7, "quantity": "stress_xz",
    }  # fmt: skip
    assert set(changed) == set(STARTS)
    assert all(changed[key] != STARTS[key] for key in STARTS)
    assert controls.from_query(controls.to_query(changed)) == (changed, ())
    assert controls.to_query(STARTS) == ""


@pytest.mark.parametrize(
    ("key", "given", "said"),
    [
        ("size", "61", "61 mm is outside 0 to 60 mm"),
        ("size", "wide", "'wide' is no number"),
        ("am", "nan", "outside 0 to 500 Hz"),
        ("duration", "0", "0 s is outside 0.01 to 10 s"),
        ("foci", "2.5", "give a whole number"),
        ("shape", "circel", "did you mean 'circle'"),
        ("pulses", "100", "give on/off in ms, such as 100/50"),
        ("pulses", "0/10", "lasts longer than 0 ms"),
        ("phases", "0, half", "'half' is no phase"),
        ("phases", "0, 100", "100 % is outside"),
        ("paths", "circle/20/0", "path 1: 'circle/20/0' is none; give shape/size/x/y in mm"),
        ("paths", "line/10/0/0, circel/20/0/0", "did you mean 'circle'"),
        ("paths", "square/61/0/0", "path 1: 61 mm is outside 0 to 60 mm"),
        ("paths", "point/0/0/nan", "its centre must be finite"),
        ("paths", "circle/20/45/0", "path 1 reaches to 55 mm, beyond the 50 mm of the area"),
        ("paths", ", ".join(["point/0/0/0"] * 9), "9 paths exceed 8"),
    ],
)
def test_what_is_wrong_is_said(key, given, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        controls.checked(key, given)
    values, refused = controls.from_query(f"{key}={given}&am2=7")
    assert values[key] == STARTS[key]
    assert values["am2"] == 7
    assert said in refused[0]


def test_presets_are_the_papers_tactons():
    found = controls.presets()
    assert len(found) == 15
    for name, tacton in tactons():
        made = scenes.scene_of(STARTS | found[name]).tacton
        assert made.trajectory.drawing_frequency == pytest.approx(
            tacton.trajectory.drawing_frequency
        )
        assert (made.am_frequency, made.duration) == (tacton.am_frequency, tacton.duration)


def test_a_scene_goes_through_its_file_and_back_to_the_controls():
    values = STARTS | {"body": "palm", "pulses": "100/50", "ramp": 5.0, "foci": 2, "am": 90.0}
    assert scenes.values_of(loads(dumps(scenes.scene_of(values)))) == values
    values |= {"phases": "0, 12.5"}
    assert scenes.scene_of(values).tacton.foci == (0, 0.125)
    assert scenes.values_of(loads(dumps(scenes.scene_of(values)))) == values
    with pytest.raises(ValueError, match="2 phases of 3 foci"):
        scenes.scene_of(values | {"foci": 3})


PUBLISHED = {"drive": "linear", "profile": "main_lobe"}
OWN = {"foci": 3, "drawn": 90.0, "paths": "circle/20/-20/0, square/15/20/0.5, line/20/0/20"}


def test_paths_of_their_own_go_through_a_file_and_back_to_the_controls():
    every = "triangle/12.5/0/0, point/0/-20/10, circle/60/10/0, square/15/20/0.5, line/20/0/20"
    for paths in (OWN["paths"], every, "circle/20/3/4"):
        values = STARTS | OWN | {"paths": paths, "foci": len(paths.split(",")), "pulses": "30/20"}
        scene = scenes.scene_of(values)
        assert scene.tacton.drawing_frequency == pytest.approx(90)
        assert scenes.values_of(loads(dumps(scene))) == values
        assert controls.from_query(controls.to_query(values)) == (values, ())
    with pytest.raises(ValueError, match="3 paths of 2 foci"):
        scenes.scene_of(STARTS | OWN | {"foci": 2})
    t = np.linspace(0, 0.1, 500)
    places = np.column_stack([0.02 * np.sin(80 * t), 0.02 * np.cos(70 * t)])
    for count in (2, 3, 4, 5, 133, 500):
        path = Trajectory(shape="recorded", points=tuple(map(tuple, places[:count].tolist())),
                          times=tuple(t[:count].tolist()))  # fmt: skip
        other = replace(scene, pressure=replace(
            scene.pressure, tacton=Tacton(trajectory=path))
        )  # fmt: skip
        with pytest.raises(ValueError, match="a path of its own points"):
            scenes.values_of(other)


def test_what_is_shown_of_paths_of_their_own_is_their_pressure():
    scene = scenes.scene_of(STARTS | OWN)
    t = np.random.default_rng(1).random(4000)
    sampled = scene.pressure(model.places(), t).std(axis=0).reshape(model.SIDE, model.SIDE)
    found = model.kernel(scene)
    assert np.abs(found.map.rms - sampled).max() < 0.05 * sampled.max()
    names = {line.name: line.frequency for line in found.lines}
    assert names["f_d-f_AM"] == pytest.approx(50)
    assert names["f_d+f_AM"] == pytest.approx(230)
    assert len(model.drawn_paths(scene.tacton)) == 3


def test_a_body_of_ones_own_stays():
    own = Body(depth=0.008)
    values = scenes.values_of(scenes.scene_of(STARTS | {"body": controls.OWN_BODY}, own))
    assert values["body"] == controls.OWN_BODY
    assert scenes.scene_of(values, own).body == own


def test_a_held_drawing_frequency_moves_the_other():
    before = scenes.scene_of(STARTS).tacton.trajectory.drawing_frequency
    for moved, given in (("size", 30.0), ("speed", 6.0), ("shape", "square")):
        values = STARTS | {moved: given}
        values |= scenes.held(values, moved, before)
        assert scenes.scene_of(values).tacton.trajectory.drawing_frequency == pytest.approx(before)
        assert values[moved] == given
    with pytest.raises(ValueError, match="outside 0 to 40 m/s"):
        scenes.held(STARTS | {"size": 60.0, "shape": "square"}, "size", before)


def test_undo_takes_a_drawn_slider_as_one_move():
    history = History(STARTS)
    for am in (141, 142, 143):
        history.push(STARTS | {"am": am})
    history.push(STARTS | {"am": 143, "size": 10})
    assert history.undo()["size"] == STARTS["size"]
    assert history.undo() == STARTS
    assert history.undo() is None
    assert history.redo()["am"] == 143
    assert history.redo()["size"] == 10
    assert history.redo() is None


# The load


def test_a_page_opens_with_a_body_under_the_load_of_command_line_and_python():
    scene = scenes.scene_of(STARTS)
    assert scene.body == BODIES["skin-slab"]
    load = MovingPressure(tacton=scene.tacton)
    assert scene.pressure == load
    assert loads(dumps(scene)).pressure == load


def test_a_body_changes_nothing_of_the_kernel_beside_it():
    for load in ({}, {"drive": "linear"}, {"profile": "main_lobe"}):
        small = STARTS | load | {"x": 5, "size": 10}  # on a fingertip, too
        given = [small | {"body": body} for body in controls.CHOICES["body"]]
        kernels = [model.kernel(scenes.scene_of(values)).response for values in given]
        for other in kernels[1:]:
            assert np.array_equal(other.displacement, kernels[0].displacement)


def test_the_published_kernel_is_shown_beside_the_one_under_the_same_load(session):
    def named():
        return [d["name"] for d in session.state.spectrum_plot["data"]]

    assert named()[:1] == ["kernel, same load, Pa"]
    with session.state:
        session.state.published = True
    assert named()[:2] == ["kernel, as published, Pa", "kernel, same load, Pa"]
    for given in ({}, {"am": 90}):
        with session.state:
            session.state.update(given)
        shown = session.state.waveform_plot["data"][0]["y"]
        own = compute(session.scene, "point-kernel-published").displacement[:, 0]
        assert max(shown) == pytest.approx(own[:600].max(), abs=0.01)
        assert min(shown) == pytest.approx(own[:600].min(), abs=0.01)
        assert min(session.state.waveform_plot["data"][1]["y"]) >= 0, "a squared drive only pushes"
    with session.state:
        session.state.published = False
    assert named()[:1] == ["kernel, same load, Pa"]


def test_scenes_and_addresses_of_earlier_versions_load(request):
    text = '[focus]\ndrive = "linear"\nprofile = "main_lobe"\n[body]\nkind = "none"\n'
    values = scenes.values_of(loads(text))
    assert (values["drive"], values["profile"], values["body"]) == ("linear", "main_lobe", "none")
    assert controls.from_query("body=paper-sheet&drive=linear&am=80")[1] == ()


def test_a_main_lobe_on_a_slab_is_refused_rather_than_answered_as_a_gaussian():
    scene = scenes.scene_of(STARTS | {"profile": "main_lobe", "duration": 0.1})
    with pytest.raises(ValueError, match="'main_lobe' has no wavenumber integral on a slab"):
        waves.BodyResponses()(scene, nothing)


# What is shown


@pytest.mark.parametrize("body", ["skin-slab", "paper-sheet-loose"])
def test_dispersion_curves_follow_the_load_and_are_computed_once_a_body(body):
    here = STARTS | {"body": body, "shape": "circle", "size": 20, "speed": 12}
    scene = scenes.scene_of(here)
    plot = guided.dispersion_plot(scene, 600)
    assert json.loads(json.dumps(plot, allow_nan=False)) == plot
    speed = next(curve for curve in plot["data"] if curve.get("name") == "speed of the focus")
    assert speed["y"] == [12, 12]
    f_d = next(name for name in plot["names"] if name["said"][0] == "f<sub>d</sub>")
    exact = next(line for line in driven_modes(scene).lines if line.name == "f_d")
    assert f_d["x"] == pytest.approx(exact.frequency, abs=0.01)
    assert f_d["y"] == pytest.approx(exact.phase_speed, rel=5e-3)
    assert float(f_d["said"][1].split()[0].replace(",", "")) == pytest.approx(
        1e3 * exact.decay_length, rel=0.01
    )
    known = guided.curves_of.cache_info().misses
    slower = guided.dispersion_plot(scenes.scene_of(here | {"speed": 6, "am": 80}), 600)
    assert guided.curves_of.cache_info().misses == known
    assert slower["names"] != plot["names"]


def test_the_third_plot_shows_what_is_chosen_of_what_the_body_has():
    def third(body):
        scene = scenes.scene_of(STARTS | {"body": body})
        state = Mock(third="dispersion", highest=600)
        return shown.third_plot(state, scene, plots.Curves(kernel=model.kernel(scene)))["title"]

    assert third("palm").startswith("Dispersion")
    assert third("none").startswith("Spectrum")


def test_paper_has_no_threshold_not_even_while_its_waves_are_computed():
    def names(body):
        scene = scenes.scene_of(STARTS | {"body": body})
        state = Mock(third="spectrum", highest=600, decibel=False)
        plot = shown.third_plot(state, scene, plots.Curves(kernel=model.kernel(scene)))
        return [curve["name"] for curve in plot["data"]]

    assert not any("threshold" in name for name in names("a4-sheet"))
    assert any("threshold" in name for name in names("none"))
    assert any("threshold" in name for name in names("palm"))


def test_what_is_shown_is_what_simulate_answers():
    scene = scenes.scene_of(STARTS)
    shown, alone = model.kernel(scene), compute(scene, "point-kernel")
    f, amplitude = spectrum(alone)
    plot = plots.spectrum_plot(plots.Curves(kernel=shown), highest=600)["data"][0]
    assert plot["x"] == pytest.approx(f[f <= 600])
    assert plot["y"] == pytest.approx(amplitude[f <= 600, 0], abs=1e-4 * amplitude.max())
    named = {line.name: line for line in shown.lines}
    assert named["f_AM"].amplitude == pytest.approx(amplitude[140, 0], rel=1e-3)
    assert [line.amplitude for line in shown.lines] == sorted(
        (line.amplitude for line in shown.lines), reverse=True
    )


def test_lines_too_near_to_each_other_are_left_out_and_counted():
    scene = scenes.scene_of(STARTS | {"am": 3, "duration": 0.5, "shape": "point"})
    answer = model.kernel(scene)
    assert answer.lines == ()
    count = len(model.unresolved_lines(scene, answer.response))
    assert count == 5
    assert unresolved(count, 0.5) == (
        "5 lines cannot be resolved in 0.5 s; make the Tacton longer."
    )
    assert unresolved(0, 0.5) == ""


def test_the_map_is_the_rms_of_the_pressure_about_its_mean():
    pressure = scenes.scene_of(STARTS).pressure
    t = np.random.default_rng(1).random(4000)
    sampled = pressure(model.places(), t).std(axis=0).reshape(model.SIDE, model.SIDE)
    found = model.kernel_map(pressure)
    assert np.abs(found.rms - sampled).max() < 0.05 * sampled.max()
    # On the borderline the strongest component is at its own threshold.
    outermost = max(found.threshold, key=lambda line: np.abs(line).max())
    times = np.arange(10_000) / 10_000
    table = line_table(pressure, point_kernel(pressure, outermost[::7], times))
    level = [sensation_level(table.amplitudes[name], f, unit="Pa")
             for name, f in table.frequencies.items()]  # fmt: skip
    assert np.max(level, axis=0) == pytest.approx(0, abs=1.0)


def test_nothing_is_felt_of_what_does_not_vibrate_nor_on_paper():
    still = scenes.scene_of(STARTS | {"shape": "point", "am": 0})
    assert model.kernel_map(still.pressure).threshold == ()
    assert model.kernel_map(scenes.scene_of(STARTS | {"shape": "point"}).pressure).threshold
    scene = scenes.scene_of(STARTS | {"body": "skin-slab", "duration": 0.2})
    f, motion = (
        np.array([140.0]),
        np.full((1, model.SIDE**2), 1e-6) * np.linspace(0, 1, model.SIDE**2),
    )
    assert waves.motion_map(scene, f, motion).threshold
    paper = replace(scene, body=BODIES["paper-sheet-loose"])
    assert waves.motion_map(paper, f, motion).threshold == ()


def test_map_and_table_agree_under_a_rhythm():
    """The level of the strongest line where the borderline runs is 0 dB in the table."""
    scene = scenes.scene_of(STARTS | PUBLISHED | {"shape": "point", "am": 150, "pulses": "50/50"})
    outermost = max(model.kernel_map(scene.pressure).threshold, key=lambda line: np.abs(line).max())
    response = point_kernel(scene.pressure, outermost[:1], np.arange(10_000) / 10_000)
    table = line_table(scene.pressure, response)
    level = sensation_level(table.amplitudes["f_AM"][0], 150.0, unit="Pa")
    assert level == pytest.approx(0, abs=0.3)


def test_the_influenced_area_ends_a_main_lobe_from_the_path():
    tacton = scenes.scene_of(STARTS).tacton
    outer, inner = (
        sorted(model.influenced(tacton, 0.2), key=lambda x: -np.linalg.norm(x, axis=1).max())[:1]
        * 2
    )
    assert outer is inner  # D0 exceeds the radius: no hole
    assert np.linalg.norm(outer, axis=1) == pytest.approx(0.01 + lobe_width(0.2), rel=0.01)


def test_the_carrier_is_shown_where_it_can_be_resolved():
    pressure = scenes.scene_of(STARTS | {"drive": "linear"}).pressure
    found = model.commanded_curve(pressure, 0.001, 0.002)
    assert found.carrier
    assert found.largest == pytest.approx(commanded(pressure.tacton, found.times))
    found = model.commanded_curve(pressure, 0, 0.06)
    assert not found.carrier
    assert len(found.times) <= model.MOST_SHOWN
    assert found.largest.max() == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("drive", controls.CHOICES["drive"])
def test_the_square_of_the_commanded_sound_is_what_pushes(drive):
    values = STARTS | {"drive": drive, "am2": 90, "ratio": "0.5:0.5", "amplitude": 60}
    pressure = scenes.scene_of(values | {"pulses": "20/10"}).pressure
    t = np.linspace(0, 0.1, 999)
    pushed = pressure.gain(t) / pressure.peak_pressure
    sound = model.sound_amplitude(pressure, t)
    assert (sound if drive == "linear" else sound**2) == pytest.approx(pushed)


@pytest.mark.parametrize(("am", "envelope", "duration"), [(500, 0, 10), (499, 3, 1), (140, 0, 2)])
def test_the_commanded_signal_has_its_true_envelope_however_long(am, envelope, duration):
    values = STARTS | {"am": am, "envelope": envelope, "duration": duration}
    pressure = scenes.scene_of(values).pressure
    found = model.commanded_curve(pressure, 0, duration)
    width = found.times[1] - found.times[0]
    within = np.linspace(-0.5, 0.5, 2000) * width
    for k in range(0, len(found.times), 37):
        true = np.abs(model.sound_amplitude(pressure, found.times[k] + within))
        assert found.largest[k] == pytest.approx(true.max(), abs=0.02)
        assert found.least[k] == pytest.approx(true.min(), abs=0.02)
    plot = plots.commanded_plot(pressure, 0, duration)
    assert "largest and least" in plot["title"]
    assert "pressure squared" in plot["title"]


def test_a_thinned_curve_keeps_its_peaks():
    y = np.zeros(100_003)
    y[[5, 777, 100_002]] = 3, -2, 9
    x, thin = model.thinned(np.arange(100_003.0), y)
    assert len(x) <= 1.05 * model.MOST_SHOWN
    assert set(thin) == {0, 3, -2, 9}
    assert (np.diff(x) > 0).all()


# Waves


def test_tabulated_waves_are_the_exact_ones(scene):
    shown = waves.BodyResponses()(scene, nothing)
    exact = compute(scene, "flat-body").displacement[:, 0]
    error = shown.response.displacement[:, 0] - exact
    assert np.linalg.norm(error) < 2e-3 * np.linalg.norm(exact)
    # RMS over the area against exact lines at some places.
    some = np.random.default_rng(0).choice(model.SIDE**2, 12, replace=False)
    f, a = steady_lines(compliance(scene.body), scene.pressure, model.places()[some])
    rms = np.sqrt((np.abs(a[f > 0]) ** 2).sum(axis=0) / 2)
    assert shown.map.rms.ravel()[some] == pytest.approx(rms, rel=0.02)


def test_tabulated_waves_follow_pulses_and_foci(scene):
    tacton = scenes.scene_of(STARTS | {"pulses": "30/20", "foci": 3, "duration": 0.15}).tacton
    scene = replace(scene, pressure=replace(scene.pressure, tacton=tacton))
    shown = waves.BodyResponses()(scene, nothing).response.displacement[:, 0]
    exact = compute(scene, "flat-body").displacement[:, 0]
    assert np.linalg.norm(shown - exact) < 5e-3 * np.linalg.norm(exact)


@pytest.mark.parametrize("height", [0.02, 0.09, 0.2, 0.6])
@pytest.mark.parametrize("body", [BODIES["skin-slab"], Body(depth=np.inf), Body(depth=0.004)])
def test_one_grid_of_wavenumbers_serves_every_height(body, height):
    table = slabs.tabulate(slabs.wavenumbers(body, slabs.lowest(height), nothing), height)
    some = slice(None, None, 37)
    w, distances = 2 * np.pi * table.frequencies[some], table.distances
    exact = point_response(compliance(body), distances, w, spot_width(height))
    assert np.abs(table.g[some] - exact).max() < 3e-5 * np.abs(exact).max()


def test_another_height_evaluates_no_compliance_anew(scene, monkeypatch):
    answered = waves.BodyResponses()
    answered(scene, nothing)
    monkeypatch.setattr(slabs, "compliance", None)
    higher = replace(scene, pressure=replace(scene.pressure, height=0.23))
    shown = answered(higher, nothing).response.displacement[:, 0]
    exact = compute(higher, "flat-body").displacement[:, 0]
    assert np.linalg.norm(shown - exact) < 2e-3 * np.linalg.norm(exact)


@pytest.mark.parametrize("more", [{}, {"pulses": "30/20"}, {"shape": "point", "am": 0}])
@pytest.mark.parametrize("moving", [False, True])
def test_silence_moves_nothing_and_is_drawn_as_zero(more, moving):
    given = STARTS | {"body": "skin-slab", "amplitude": 0, "duration": 0.1} | more
    scene = scenes.scene_of(given)
    kernel, shown = model.kernel(scene), waves.BodyResponses()(scene, nothing, moving)
    assert not shown.response.displacement.any()
    assert (shown.lines, shown.map.threshold) == ((), ())
    assert not shown.map.rms.any()
    assert (shown.moving is not None) == moving
    curves = plots.Curves(kernel=kernel, waves=shown)
    for plot in (plots.spectrum_plot(curves), plots.waveform_plot(curves, (0.0, 0.06))):
        ranges = [plot[axis]["range"] for axis in ("y", "y2")]
        assert np.isfinite(ranges).all()
        assert all(low < high for low, high in ranges)


@pytest.mark.parametrize("more", [{}, {"pulses": "30/20"}])
def test_tabulated_waves_follow_paths_of_their_own(scene, more):
    values = STARTS | OWN | {"body": "skin-slab", "duration": 0.1} | more
    scene = scenes.scene_of(values)
    shown = waves.BodyResponses()(scene, nothing)
    exact = compute(scene, "flat-body").displacement[:, 0]
    error = shown.response.displacement[:, 0] - exact
    assert np.linalg.norm(error) < 1e-2 * np.linalg.norm(exact)


def meshed_with(monkeypatch, kind, h):
    monkeypatch.setitem(KINDS, kind, replace(KINDS[kind], interactive_size=h))


@pytest.mark.slow
def test_a_reduced_body_follows_paths_of_their_own(monkeypatch):
    meshed_with(monkeypatch, "sheet", 5e-3)
    own = replace(BODIES["paper-sheet-loose"], width=0.06, height=0.06)
    paths = "circle/10/-10/0, square/8/10/0, line/12/0/12"
    values = STARTS | OWN | {"body": controls.OWN_BODY, "duration": 0.1, "paths": paths}
    answered, scene = waves.BodyResponses(), scenes.scene_of(values, own)
    shown = answered(scene, nothing, moving=True)
    alone = compute(scene, "fem", h=5e-3).displacement[:, 0]
    assert np.linalg.norm(shown.response.displacement[:, 0] - alone) < 0.02 * np.linalg.norm(alone)
    said = []
    again = answered(
        scenes.scene_of(values | {"drawn": 71.0}, own), lambda *told: said.append(told)
    )
    assert not said, "nothing was reduced anew"
    assert again.lines
    sent = moving.sent_motion(shown.moving, scene.pressure)
    sides = np.frombuffer(sent["path"], "<f4").reshape(-1, 2, 3)
    assert np.linalg.norm(np.diff(sides[..., :2], axis=1), axis=2).max() < 1, "no line joins them"
    foci = np.frombuffer(sent["foci"], "<f4").reshape(sent["count"], 3, 3)
    assert np.ptp(foci[:, 0, 0]) == pytest.approx(10, abs=0.5)


@pytest.mark.parametrize("air", [False, True])
def test_a_reduced_body_answers_as_simulate_does(air, monkeypatch):
    meshed_with(monkeypatch, "sheet", 5e-3)
    own = replace(BODIES["paper-sheet-loose"], width=0.06, height=0.06, air=air)
    values = STARTS | {"body": controls.OWN_BODY, "duration": 0.1, "x": 12.0, "size": 12.0}
    answered, scene = waves.BodyResponses(), scenes.scene_of(values, own)
    shown = answered(scene, nothing)
    alone = compute(scene, "fem", h=5e-3).displacement[:, 0]
    assert np.linalg.norm(shown.response.displacement[:, 0] - alone) < 0.02 * np.linalg.norm(alone)
    said = []
    faster = answered(
        scenes.scene_of(values | {"speed": 9.0}, own), lambda *told: said.append(told)
    )
    assert not said  # nothing was reduced anew
    assert faster.lines[0].sensation is None  # paper feels nothing
    # Beside the body there is no map, on it everywhere.
    edge, on = 1e3 * np.abs(model.places()).max(axis=1), np.isfinite(shown.map.rms).ravel()
    assert on[edge < 29.9].all()
    assert not on[edge > 30.1].any()
    assert drawings.picture(shown.map).startswith("data:image/png;base64,")


@pytest.mark.slow
def test_a_palm_answers(monkeypatch):
    meshed_with(monkeypatch, "palm", 12e-3)
    values = STARTS | {"body": "palm", "duration": 0.1, "size": 8.0}
    answered, said = waves.BodyResponses(), []
    shown = answered(scenes.scene_of(values), lambda *told: said.append(told), moving=True)
    assert list(dict.fromkeys(phase for phase, _ in said)) == [
        "mesh", "assemble", "factorise", "reduce", "read the surface",
    ]  # fmt: skip
    assert np.isnan(shown.map.rms[0, 0])
    assert np.isfinite(shown.map.rms[model.SIDE // 2, model.SIDE // 2])
    # Its back is seen, too, and hardly moves; the motion is where the focus is.
    z, moved = shown.moving.shape.points[:, 2], np.abs(shown.moving.frames).max(axis=0)
    assert moved[z < np.quantile(z, 0.1)].max() < 0.5 * moved.max()
    said.clear()
    with pytest.raises(ValueError, match="not on the surface"):
        answered(scenes.scene_of(values | {"x": 42.0, "y": 49.0}), lambda *told: said.append(told))
    assert not said, "what was reduced is kept"


def test_the_moving_body_is_what_its_probe_sees(scene):
    """Steady motion about its mean, through the period that the load has."""
    tacton = scenes.scene_of(STARTS | {"am": 100.0, "speed": 2 * np.pi, "duration": 0.3}).tacton
    steady = replace(scene, pressure=replace(scene.pressure, tacton=tacton), probes=((0.0, 0.0),))
    shown = waves.BodyResponses()(steady, nothing, moving=True)
    seen, response = shown.moving, shown.response
    assert seen.repeats
    assert seen.period == pytest.approx(0.01)
    middle = model.SIDE**2 // 2
    assert seen.shape.points[middle] == pytest.approx([0, 0, 0])
    late = np.interp(0.2 + np.arange(len(seen.frames)) * 0.01 / len(seen.frames), response.times,
                     response.displacement[:, 0])  # fmt: skip
    late -= late.mean()
    upwards = seen.frames[:, middle]
    assert np.linalg.norm(upwards + late) < 0.02 * np.linalg.norm(late)
    low = seen.shape.points[:, 2] < 0
    assert seen.shape.points[low, 2] == pytest.approx(-0.015)
    assert not seen.frames[:, low].any()
    sent = moving.sent_motion(seen, steady.pressure)
    frames = np.frombuffer(sent["frames"], np.int8).reshape(seen.frames.shape)
    assert np.abs(frames).max() == 127
    assert np.corrcoef(frames[:, middle], upwards)[0, 1] > 0.999


@pytest.mark.parametrize(("am", "envelope", "whole"), [(20.0, 0.0, 0.05), (141.0, 20.0, 1.0)])
def test_frames_resolve_the_fastest_motion_however_long_the_pattern(am, envelope, whole):
    shape = moving.Shape(points=np.zeros((1, 3)), triangles=np.zeros((0, 3), int))
    values = STARTS | {"shape": "point", "am": am, "envelope": envelope, "duration": 1.0}
    lines, pressure = np.array([20.0, 400.0]), scenes.scene_of(values).pressure
    seen = moving.moving_of(shape, pressure, lines, np.ones((2, 1), complex))
    assert len(seen.frames) <= speeds.MOST
    assert len(seen.frames) / seen.period >= 0.99 * speeds.EACH * 400
    assert seen.repeats == (whole < 0.1)
    assert (seen.period == pytest.approx(whole)) == (whole < 0.1)


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(28, "No space left on device"), "No space left on device"),
        (TimeoutError(), "TimeoutError"),
        (MemoryError(), "not enough memory"),
    ],
)
def test_a_full_disk_fails_one_question_and_the_next_is_answered(monkeypatch, error, said):
    questions, sent = iter([1, 2]), []

    class Pipe:
        def poll(self, seconds):
            return True

        def recv(self):
            if (number := next(questions, None)) is None:
                raise EOFError
            return number, None, False, (), None

        def send(self, content):
            sent.append(content)

    answers = iter([error, "found"])

    def answer(self, scene, tell, moving, base):
        if isinstance(found := next(answers), Exception):
            raise found
        return found

    monkeypatch.setattr(waves.BodyResponses, "__call__", answer)
    monkeypatch.setattr(worker, "end_with_parent", lambda: None)
    monkeypatch.setattr(worker.os, "nice", lambda _: None)
    worker.answer_forever(Pipe())
    assert sent[0][:2] == ("failed", 1)
    assert said in sent[0][2]
    assert sent[1:] == [("answer", 2, "found")]


def test_curves_are_drawn_before_what_is_beside_them(session):
    state, asked = session.state, []

    def call_later(seconds, call):
        asked.append((seconds, call, handle := Mock()))
        return handle

    session._loop = Mock(call_later=call_later)
    rows, plot = state.rows, state.spectrum_plot
    with state:
        state.am = 90
    assert state.spectrum_plot != plot
    assert state.rows == rows
    with state:
        state.am = 80  # before the page has what is beside the curves
    (seconds, _, cancelled), (_, beside, _) = (each for each in asked if each[0] < REST)
    assert seconds > 0
    assert cancelled.cancel.called
    beside()
    assert "80.0" in {row["frequency"] for row in state.rows}
    assert sum(each[0] == REST for each in asked) == 2, "and memory is given back after both"


def test_each_step_has_its_number_and_the_time_that_is_left():
    now = iter(range(0, 1000, 3))
    follow = follower(clock=lambda: next(now))
    said = [follow("mesh", 0.0), follow("assemble", 0.0), follow("factorise", 0.0)]
    said += [follow("reduce", part) for part in (0.0, 0.5, 1.0)]
    assert [step.name for step in said[:3]] == [
        "mesh (step 1 of 4)", "assemble (step 2 of 4)", "factorise (step 3 of 4)",
    ]  # fmt: skip
    assert [step.done for step in said] == sorted(step.done for step in said)
    assert [step.left for step in said[:3]] == [None] * 3, "nothing is known yet"
    # 12 s for all but half of the last step: as long as what is left of it takes in proportion.
    share = PREPARING["reduce"] / 2
    assert said[4].left == pytest.approx(12 * share / (1 - share))
    assert said[5].left == pytest.approx(0)
    assert follow("reduce", 0.1).left is None, "another mesh, from here"
    # One that begins later is not taken for quick because of what it has not done.
    assert follow("skin-slab: factorise", 0.0).left is None
    later = follow("skin-slab: reduce", 0.5)
    assert later.name == "skin-slab: reduce (step 4 of 4)"
    assert later.left == pytest.approx(3 * share / (PREPARING["factorise"] + share))
    assert follow("write tables", 0.0) == Step(phase="write tables")


def test_the_process_tells_the_step_it_is_at(monkeypatch):
    sent = []
    tell = worker._teller(Mock(send=sent.append), 7)
    for phase in waves.STEPS:
        tell(phase, 0.0)
    assert [content.number for _, _, content in sent] == [1, 2, 3, 4, 5]
    assert {(what, number, content.of) for what, number, content in sent} == {("progress", 7, 5)}


@pytest.mark.parametrize("waits", [False, True])
def test_a_process_that_dies_fails_the_question_that_is_awaited(waits):
    told = []
    asked = Worker(lambda *content: told.append(content))

    class Ended:
        def recv(self):
            raise EOFError

        def send(self, _):
            raise BrokenPipeError

    asked._start = lambda: None
    asked._pipe = pipe = Ended()
    asked.ask(1, None)
    if waits:
        asked.ask(2, None)
    asked._listen(pipe)
    assert [content[:2] for content in told] == [("failed", 2 if waits else 1)]
    assert (asked._at, asked._waiting) == (None, None)


# The state of a page, without a browser


@pytest.fixture
def session(request):
    pytest.importorskip("trame")
    from trame.app import get_server

    from skinwave.web.serve import session_of

    made = session_of(get_server(request.node.name, client_type="vue3"))
    made.state.ready()
    yield made
    made.worker.close()


def test_levels_of_waves_stay_with_another_look_and_are_asked_for_with_another_control(
    session, monkeypatch
):
    asked = []
    monkeypatch.setattr(session, "ask", lambda: asked.append(session.levels.view))
    with session.state:
        session.state.third = "level by speed"
    with session.state:
        told(session, "levels", session.number, [1.0] * len(session.levels.at))
    with session.state:
        session.state.highest = 1000
    assert session.levels.waves is not None
    with session.state:
        session.state.third = "level by size"
    assert asked == ["level by speed", "level by size"]
    with session.state:
        session.state.third = "spectrum"
    assert (session.levels, session.variants) == (None, ())


def test_the_state_of_a_page_is_numbers_texts_and_what_they_make_up(session):
    def plain(value):
        if isinstance(value, dict):
            return all(isinstance(key, str) and plain(each) for key, each in value.items())
        if isinstance(value, list | tuple):
            return all(map(plain, value))
        return value is None or isinstance(value, str | bytes | int | float)

    assert session.state.waves_stale is True
    assert [key for key, value in session.state.to_dict().items() if not plain(value)] == []


def test_a_move_changes_what_is_shown(session):
    before = session.state.spectrum_plot
    with session.state:
        session.state.am = 200
    assert session.state.spectrum_plot != before
    assert session.state.query == "am=200"
    assert session.scene.tacton.am_frequency == 200
    assert session.state.undoable
    with session.state:
        moves.undo(session)
    assert session.state.am == 140
    assert session.state.spectrum_plot == before


def test_a_wrong_value_is_marked_and_what_is_shown_stays(session):
    before = session.state.spectrum_plot
    with session.state:
        moves.turn(session, {"size": "70"})
    assert "outside 0 to 60 mm" in session.state.errors["size"]
    assert session.state.size == STARTS["size"]
    assert session.state.typed == {"size": "70"}
    assert session.state.spectrum_plot == before
    with session.state:
        moves.turn(session, {"size": "30"})
    assert (session.state.errors, session.state.typed) == ({}, {})
    with session.state:
        moves.turn(session, {"pulses": "5/5", "ramp": 100})
    assert "ramp" in session.state.problem
    assert session.state.stale


def test_waves_are_stale_until_they_are_answered(session):
    assert session.state.waves_stale
    assert [d["name"] for d in session.state.waveform_plot["data"]] == ["kernel, same load, Pa"]
    answer = waves.BodyResponses()(session.scene, nothing)
    with session.state:
        told(session, "answer", session.number - 1, answer)
    assert session.state.waves_stale, "an older response is not shown"
    with session.state:
        step = Step(phase="reduce", number=4, of=5, done=0.5, left=21.0)
        told(session, "progress", session.number, step)
    assert (session.state.busy, session.state.done) == ("reduce (step 4 of 5)", 50)
    assert session.state.left == "about 20 s left"
    with session.state:
        told(session, "answer", session.number, answer)
    assert not session.state.waves_stale
    drawn = {d["name"]: d for d in session.state.spectrum_plot["data"]}
    assert drawn["waves (flat-body), µm"]["opacity"] == 1
    assert any("threshold" in name for name in drawn)
    with session.state:
        session.state.am = 150
    drawn = {d["name"]: d for d in session.state.waveform_plot["data"]}
    assert drawn["waves (flat-body), µm — being computed"]["opacity"] == plots.STALE
    with session.state:
        told(session, "failed", session.number, "it cannot be")
    assert session.state.problem == "it cannot be"
    with session.state:
        moves.cancel(session)
    assert session.state.body == "none"
    assert not session.state.busy


def test_warnings_of_the_answer_that_is_shown_are_said_once(session):
    answer = waves.BodyResponses()(session.scene, nothing)
    effort = replace(
        answer.response.effort,
        warnings=("relative error of about 18 %", "relative error of about 18 %"),
    )
    answer = replace(answer, response=replace(answer.response, effort=effort))
    assert session.state.warnings == []
    with session.state:
        told(session, "answer", session.number, answer)
    assert session.state.warnings == ["relative error of about 18 %"]
    with session.state:
        session.state.am = 150
    assert session.state.warnings == [], "they are of another response"


def test_the_first_sentences_say_what_each_difference_changes(session):
    answer = waves.BodyResponses()(session.scene, nothing)
    with session.state:
        told(session, "answer", session.number, answer)
    above, propagation, drive = session.state.summary
    share = float(re.search(r"carry (\d+) %", propagation)[1])
    x, y = grid(session.scene)
    of_kernel = kernel_map(session.scene.pressure, x, y).rms
    exact = share_outside(of_kernel, body_map(session.scene, x, y).rms)
    assert share == pytest.approx(100 * exact, abs=1), "that of a report"
    assert 5 < share < 60
    assert "not propagation, adds f_" in drive
    assert re.match(r"Above threshold at the point: yes, \+\d+ dB SL at \d+ Hz", above)
    with session.state:
        session.state.body = "none"
    assert session.state.summary[1:] == [drive]
    assert "kernel:" not in session.state.summary[0]


def test_answers_carry_the_warnings_of_the_command_line(scene):
    """Sides that reflect are left out by the wavenumber integral, and that is said."""
    assert waves.BodyResponses()(scene, nothing).response.effort.warnings == ()
    small = replace(scene.body, width=0.04, height=0.04, sides="clamped")
    reflecting = replace(scene, body=small)
    said = waves.BodyResponses()(reflecting, nothing).response.effort.warnings
    assert said == plan(reflecting, model="flat-body").warnings
    assert "which leaves out reflections from the sides" in said[0]


def test_a_warning_names_no_option_of_the_command_line(session):
    stiff = Body(kind="sheet", depth=1e-4, width=0.1, height=0.1, sides="clamped")
    paper = replace(session.scene, body=stiff)
    moved = waves.BodyResponses()(session.scene, nothing)
    response = replace(moved.response, values=1e3 * moved.response.values, model="fem")
    said = waves.warned_of(paper, replace(moved, response=response)).response.effort.warnings
    assert any(NONLINEAR[0] in each for each in said)
    assert not any("--" in each for each in said)


def test_an_example_can_be_undone_and_keeps_what_is_pinned(session):
    with session.state:
        moves.pin(session)
    kept = session.pinned
    for name, one in EXAMPLES.items():
        with session.state:
            moves.example(session, name)
        assert (session.state.solid, session.state.layers_open) == (one.solid, one.layers)
        assert session.state.query == controls.to_query(controls.from_query(one.query)[0])
        assert session.pinned is kept
        assert session.state.pinned
        assert session.state.undoable
    for _ in EXAMPLES:
        with session.state:
            moves.undo(session)
    assert session.values == STARTS
    assert EXAMPLES["wake"].solid
    assert EXAMPLES["layers"].layers


def test_a_page_opens_with_the_moving_body(session):
    assert session.state.solid
    asked = []
    session.worker.ask = lambda *given: asked.append(given)
    session._loop = Mock()
    session.ask()
    assert asked[0][2], "its motion is computed, too"


def test_bodies_that_differ_much_are_drawn_each_over_its_largest(session):
    """A soft and a stiff body: what moves is 200 times as much."""
    answer = waves.BodyResponses()(session.scene, nothing)
    with session.state:
        told(session, "answer", session.number, answer)
        moves.pin(session)
    one, record = answer.response, answer.response.record
    for times, apart in ((200.0, True), (5.0, False)):
        more = replace(
            answer, response=replace(one, values=times * one.values),
            spectrum=times * answer.spectrum,
            lines=tuple(replace(line, amplitude=times * line.amplitude) for line in answer.lines),
        )  # fmt: skip
        with session.state:
            told(session, "answer", session.number, more)
        for key, largest in (
            ("waveform_plot", one.values[:601]),
            ("spectrum_plot", one_line(answer)),
        ):
            plot = session.state[key]
            shown = {c["role"]: c for c in plot["data"] if c["axis"] == "y2"}
            most = {role: max(map(abs, shown[role]["y"])) for role in ("waves", "pinned")}
            own = record.per_unit * float(np.abs(largest).max())
            if apart:
                assert most == pytest.approx({"waves": 1.0, "pinned": 1.0}, rel=1e-3)
                assert plot["y2"]["said"] == "waves, each over its largest"
                assert (
                    shown["waves"]["name"] == f"B: skin slab (flat-body), 1 = {times * own:.3g} µm"
                )
                assert shown["pinned"]["name"] == f"A: skin slab (flat-body), 1 = {own:.3g} µm"
                top = plot["y2"]["range"][1]
                assert 1 < top < 3
            else:
                assert most["waves"] == pytest.approx(times * most["pinned"], rel=1e-3)
                assert shown["pinned"]["name"] == "A: skin slab (flat-body), µm"
        decibel = plots.in_decibel(session.state.spectrum_plot)["y2"]["said"]
        assert decibel.endswith("each over its largest, dB" if apart else "dB re 1 µm")
        names = [x for x in session.state.spectrum_plot["names"] if x["axis"] == "y2"]
        assert names[0]["y"] <= session.state.spectrum_plot["y2"]["range"][1]
        said = session.state.summary[-1]
        line = max(answer.lines, key=lambda each: each.amplitude)
        size = record.per_unit * line.amplitude
        assert f"{size:.3g} µm at {line.frequency:.0f} Hz ({line.name}) of A, skin slab" in said
        assert f"{times * size:.3g} µm" in said
        row = next(row for row in session.state.rows if row["name"] == drawings.written(line.name))
        assert row["pinned"] == f"{size:.3g}"
    assert session.state.pinned_map["title"] == "A: skin slab"
    assert session.state.wave_map["title"] == "B: skin slab"
    assert not session.state.solid, "both maps are to be compared"


def one_line(answer):
    return answer.spectrum[answer.frequencies <= 600]


def test_lines_that_a_pinned_body_has_at_other_frequencies_have_rows_of_their_own(session):
    first = waves.BodyResponses()
    before = first(scenes.scene_of(STARTS | {"am": 80.0}), nothing)
    after = first(scenes.scene_of(STARTS), nothing)
    found = drawings.rows(model.kernel(session.scene), after, pinned=before)
    row = next(row for row in found if row["name"].startswith("A: f<sub>AM</sub>"))
    assert (row["frequency"], row["displacement"]) == ("80.0", "")
    assert float(row["pinned"]) > 0
    shared = next(row for row in found if row["name"] == "f<sub>d</sub>")
    assert shared["pinned"] != ""


def test_small_curves_mark_the_present_height_and_the_distance_of_the_point():
    there = insets.beside(scenes.scene_of(STARTS | {"height": 310.0, "x": 16.0}))
    height, spot = there["height"], there["profile"]
    assert height["at"][0] == pytest.approx((insets.LEFT + insets.RIGHT) / 2)
    assert height["said"] == f"310 mm: {relative_intensity(0.31):.2f}"
    value = float(focal_spot([6e-3, 0], 0.31, "gaussian"))
    assert spot["said"] == f"point at 6.0 mm: {value:.2f}"
    assert spot["at"][1] == pytest.approx(
        insets.BOTTOM - value * (insets.BOTTOM - insets.TOP), abs=0.1
    )
    assert spot["words"].endswith(", mm")
    curve = np.array([pair.split(",") for pair in spot["path"][1:].split("L")], float)
    assert curve[0] == pytest.approx([insets.LEFT, insets.TOP])
    assert (np.diff(curve[:, 1]) >= 0).all()
    far = insets.beside(scenes.scene_of(STARTS | {"x": 50.0, "y": 50.0}))["profile"]
    assert far["at"] == []
    lobe = insets.beside(scenes.scene_of(STARTS | {"profile": "main_lobe"}))["profile"]
    assert lobe["path"] != spot["path"]


def test_small_curves_follow_the_sliders(session):
    before = session.state.insets
    with session.state:
        session.state.height = 300
    assert session.state.insets["height"]["at"] != before["height"]["at"]
    assert session.state.insets["profile"]["path"] != before["profile"]["path"]


def test_a_held_frequency_and_a_preset(session):
    with session.state:
        session.state.hold = True
    with session.state:
        session.state.size = 30
    assert session.state.speed == pytest.approx(18)
    assert session.state.drawing_frequency == pytest.approx(190.986, abs=1e-3)
    with session.state:
        session.state.shape, session.state.size = "square", 60
    assert "cannot be kept constant" in session.state.errors["hold"]
    with session.state:
        session.state.hold = False
    with session.state:
        moves.preset(session, "am210-stm10")
    assert (session.state.am, session.state.size, session.state.errors) == (210, 10, {})


def test_pinning_keeps_and_exchanges(session):
    with session.state:
        moves.pin(session)
        session.state.update({"am": 90, "body": "none"})
    shown, pinned, _ = session.state.spectrum_plot["data"]
    assert [shown["name"], pinned["name"]] == [
        "B: kernel, same load, Pa",
        "A: kernel, same load, Pa",
    ]
    assert shown["role"] != pinned["role"]
    assert session.state.differs == [
        {"name": "AM frequency", "a": "140 Hz", "b": "90 Hz"},
        {"name": "Body", "a": "skin-slab", "b": "none"},
    ]
    with session.state:
        moves.exchange(session)
    assert session.state.am == 140
    assert session.state.differs[0] == {"name": "AM frequency", "a": "90 Hz", "b": "140 Hz"}
    with session.state:
        moves.exchange(session)
    assert session.state.am == 90
    with session.state:
        moves.pin(session)
    assert len(session.state.waveform_plot["data"]) == 1
    assert session.state.differs == []


def test_waves_of_what_is_pinned_may_come_after_it_was(session):
    answer = waves.BodyResponses()(session.scene, nothing)
    with session.state:
        moves.pin(session)
    assert session.pinned == (session.kernel,)
    with session.state:
        told(session, "answer", session.number, answer)
    assert session.pinned == (session.kernel, answer)
    assert session.state.pinned_map["picture"]
    with session.state:
        moves.pin(session)
        moves.turn(session, {"am": "90"})
        moves.pin(session)
        moves.turn(session, {"am": "95"})
        told(session, "answer", session.number, answer)
    assert len(session.pinned) == 1, "these waves are not of what is pinned"


def test_foci_follow_paths_of_their_own(session):
    with session.state:
        moves.turn(session, {"foci": 2})
    with session.state:
        moves.follow(session, "own")
    assert session.state.paths == "circle/20/-20/0, circle/20/20/0"
    assert session.state.drawing_frequency == pytest.approx(STARTS["drawn"])
    assert session.state.path.count("M") == 2
    assert session.state.own_speeds == "6.28, 6.28 m/s"
    with session.state:
        session.state.foci = 3
    assert session.state.paths.endswith(", circle/20/0/20")
    with session.state:
        moves.own_path(session, 2, 0, "square")
    with session.state:
        moves.own_path(session, 2, 2, "4,5")
    assert session.state.paths.endswith(", square/20/4.5/20")
    assert session.state.foci_track[0][2] == [14.5, -30]
    before = session.state.kernel_map
    with session.state:
        moves.own_path(session, 0, 1, "far")
    assert "path 1: 'circle/far/-20/0' is none" in session.state.errors["paths"]
    assert session.state.typed["paths"].startswith("circle/far")
    assert session.state.kernel_map == before
    with session.state:
        session.state.foci = 4
    assert (session.state.errors, session.state.typed) == ({}, {}), "as what was typed is gone"
    with session.state:
        moves.undo(session)
    with session.state:
        moves.own_path(session, 0, 1, "15")
    assert (session.state.errors, session.state.typed) == ({}, {})
    assert session.state.kernel_map != before
    kept, values = dumps(session.scene), session.values
    with session.state:
        session.state.foci = 1
    assert session.state.paths == "circle/15/-20/0"
    with session.state:
        moves.undo(session)
    assert session.values == values
    with session.state:
        moves.follow(session, "one")
    assert (session.state.paths, session.state.foci) == ("", 3)
    with session.state:
        moves.open_scene(session, kept)
    assert session.state.paths == values["paths"]
    with session.state:
        moves.preset(session, "am80")
    assert (session.state.paths, session.state.foci) == ("", 1)
    with session.state:
        moves.own_path(session, 2, 2, "5")  # typed before the page learned that the path is gone
    assert (session.state.paths, session.state.errors) == ("", {})


def test_foci_run_once_along_their_own_path(session):
    with session.state:
        moves.turn(session, {"paths": "line/20/-20/0, line/10/20/0"})
    assert session.state.foci_track[50] == [[-10, 0], [25, 0]]
    assert len(session.state.foci_track) == 100


def test_what_is_saved_can_be_opened(session, monkeypatch):
    """Made in this process; by one of its own, as from a page, in tests of pages."""
    from PIL import Image
    from scipy.io import wavfile

    async def here(make, *given):
        return make(*given)

    monkeypatch.setattr(downloads, "elsewhere", here)
    with session.state:
        moves.turn(session, {"pulses": "100/50", "am": 90, "size": 12, "duration": 0.3})
    files = downloads.offered(session)
    kept, values = files["scene_toml"]().decode(), session.values
    with session.state:
        moves.preset(session, "am80")
        moves.open_scene(session, kept)
    assert session.values == values
    rate, samples = wavfile.read(BytesIO(files["waveform_wav"]()))
    assert (rate, len(samples)) == (10_000, 3_000)
    lines = files["waveform_csv"]().decode().splitlines()
    assert lines[0] == '"time, s","pressure at (10, 0) mm, Pa (point-kernel)"'
    assert len(lines) == 3_001
    assert b"<svg" in asyncio.run(files["figure"]("svg"))
    report = asyncio.run(files["report"]()).decode()
    assert "How far to trust it" in report
    assert "am_frequency_hz = 90" in report
    assert not re.search("https?:", report.split("<style>")[0])
    assert Image.open(BytesIO(asyncio.run(files["figure"]("png")))).width > 1000
    with session.state:
        moves.open_scene(session, "[tacton]\nam = 5")
    assert "the scene cannot be opened" in session.state.problem
    with session.state:
        session.state.opened = {"content": kept.encode()}
    assert session.state.problem == ""


def test_a_figure_is_as_wide_as_asked_and_shows_what_the_plots_show(session, monkeypatch):
    async def here(make, *given):
        return make(*given)

    monkeypatch.setattr(downloads, "elsewhere", here)
    answer = waves.BodyResponses()(session.scene, nothing, moving=True)
    with session.state:
        told(session, "answer", session.number, answer)
        session.state.solid = False
        session.state.decibel = True
        moves.pin(session)
        session.state.against = True
        moves.look(session)
    figure = downloads.offered(session)["figure"]
    said = asyncio.run(figure("svg", 3.5, "spectrum_plot:50:260")).decode()
    width = float(re.search(r'<svg[^>]*width="([\d.]+)pt"', said)[1])
    assert width == pytest.approx(72 * 3.5, abs=0.1)
    for words in (
        "A: skin slab (flat-body), µm", "threshold (±5 dB)", "less the", "dB re 1 Pa", "+30 dB",
        "Commanded signal", "250",
    ):  # fmt: skip
        assert re.search(f">[^<]*{re.escape(words)}", said), words
    assert ">300<" not in said, "beyond what is zoomed to"
    sizes = {float(size) for size in re.findall(r"font(?:-size)?: ?(?:\w+ )?([\d.]+)px", said)}
    assert 8 in sizes
    assert max(sizes) == 8
    pdf = asyncio.run(figure("pdf", 7))
    assert b"/Type3" not in pdf
    with session.state:
        session.state.solid = True
    seen = saved_figure.seen(session, saved_figure.view_of("body:2.5:-0.5:0.95:0.5:1 foci:25"))
    assert seen["foci"] == session.state.foci_track[25]
    again = saved_figure.figure_of(seen, "svg", 7.0).decode()
    assert "2.5 ms into the" in again


def test_a_figure_has_the_colours_of_the_page(session):
    here = saved_figure._colours("paper-sheet")
    assert here["waves"] == "#d55e00"
    assert saved_figure._colours("skin-slab")["waves"] == "#0072b2"
    roles = {curve["role"] for curve in session.state.spectrum_plot["data"]}
    assert roles | {f"mode{n}" for n in range(1, 7)} <= set(here)


def test_a_report_says_how_often_paths_of_their_own_are_drawn():
    scene = scenes.scene_of(STARTS | OWN | {"duration": 0.1})
    said = downloads.report_of(scene, [model.kernel(scene)]).decode()
    assert "3 paths, drawn 90.000 times a second" in said


def test_what_is_made_elsewhere_and_fails_is_said():
    with pytest.raises(RuntimeError, match="has ended without it"):
        asyncio.run(downloads.elsewhere(downloads.wav_of, None))


def test_zooming_in_shows_the_carrier(session):
    assert "envelope" in session.state.commanded_plot["title"]
    with session.state:
        moves.zoom(session, 10.0, 11.0)
    assert "with its 40 kHz carrier" in session.state.commanded_plot["title"]
    for beyond in ((-500.0, -400.0), (2000.0, 3000.0), (7.0, 7.0)):
        with session.state:
            moves.zoom(session, *beyond)
        low, high = session.state.commanded_plot["x"]["range"]
        assert 0 <= low < high <= 1000
    with session.state:
        moves.zoom(session, 990.0, 1015.0)  # moved beyond the end
    assert session.state.commanded_plot["x"]["range"] == pytest.approx([975, 1000])
    with session.state:
        moves.zoom(session)
    assert "envelope" in session.state.commanded_plot["title"]


def test_an_address_begins_a_page_and_what_is_wrong_in_it_is_said(request):
    pytest.importorskip("trame")
    from trame.app import get_server

    from skinwave.web.serve import session_of

    server = get_server(request.node.name, client_type="vue3")
    session = session_of(server, "", {"am": "77", "size": "900", "application": "trame"})
    assert (session.state.am, session.state.size) == (77, STARTS["size"])
    assert "size: 900 mm is outside" in session.state.problem
    assert "application" not in session.state.problem


def test_undo_after_a_new_beginning_goes_back_to_the_address(session):
    with session.state:
        moves.restart(session, "am=77&size=900")
    assert "size: 900 mm is outside" in session.state.problem
    assert not session.state.undoable
    with session.state:
        moves.turn(session, {"speed": 5})
    with session.state:
        moves.undo(session)
    assert (session.state.am, session.state.speed) == (77, STARTS["speed"])


def test_progress_that_comes_after_cancel_is_not_shown(session):
    with session.state:
        session.state.body = "skin-slab"
    number = session.number
    with session.state:
        moves.cancel(session)
    for late in (number, session.number):
        with session.state:
            told(session, "progress", late, Step(phase="reduce", done=0.5))
    assert not session.state.busy


def test_a_preset_or_a_scene_keeps_its_size_while_a_frequency_is_held(session):
    with session.state:
        session.state.hold = True
    with session.state:
        moves.preset(session, "am210-stm10")
    preset = controls.presets()["am210-stm10"]
    assert {key: session.state[key] for key in preset} == preset
    frequency = session.state.drawing_frequency
    with session.state:
        session.state.size = 12
    assert session.state.drawing_frequency == pytest.approx(frequency), "held from then"
    values = STARTS | {"size": 33.0, "speed": 4.0}
    with session.state:
        moves.open_scene(session, dumps(scenes.scene_of(values)))
    assert session.values == values
    assert not session.state.errors


def test_a_scene_file_that_is_too_large_is_refused_whole(session):
    text = dumps(scenes.scene_of(STARTS | {"am": 90.0})).encode()
    with session.state:
        session.state.opened = {"content": text + b"#" * 2_500_000}
    assert "2.5 MB exceeds 1 MB" in session.state.problem
    assert session.state.am == STARTS["am"]


def test_what_of_a_scene_is_beyond_its_control_is_left_out_and_said(request):
    pytest.importorskip("trame")
    from trame.app import get_server

    from skinwave.web.serve import session_of

    server = get_server(request.node.name, client_type="vue3")
    given = STARTS | {"body": "none"}
    text = dumps(scenes.scene_of(given | {"x": 150.0, "speed": 45.0, "am": 90.0}))
    session = session_of(server, text)
    assert session.values == given | {"am": 90.0}
    assert "x: 150 mm is outside -50 to 50 mm" in session.state.problem
    assert "speed: 45 m/s is outside 0 to 40 m/s" in session.state.problem


def test_a_body_of_ones_own_comes_back_with_its_address_or_is_missed(request):
    pytest.importorskip("trame")
    from trame.app import get_server

    from skinwave.web.serve import session_of

    values = STARTS | {"body": controls.OWN_BODY}
    text = dumps(scenes.scene_of(values, Body(depth=0.008)))
    server = get_server(request.node.name, client_type="vue3")
    first = session_of(server, text)
    query = dict([part.split("=") for part in first.state.query.replace("+", " ").split("&")])
    assert query == {"body": controls.OWN_BODY}
    again = session_of(server, text, query)
    assert again.scene.body == Body(depth=0.008)
    assert again.state.problem == ""
    with again.state:
        moves.restart(again, first.state.query)
    assert again.scene.body == Body(depth=0.008)
    lost = session_of(server, "", query)
    assert lost.state.body == STARTS["body"]
    assert "the scene that it came from is not open" in lost.state.problem


@pytest.mark.parametrize(
    ("focus", "said"),
    [
        ("peak_pressure_pa = 80", "a peak_pressure_pa of 80 cannot be set here"),
        ('drive = "pressure_squared"\ndepth_of_modulation = 0.5', "a depth_of_modulation of 0.5"),
        ('profile = "array"', "profile = array of the focus"),
    ],
)
def test_a_focus_that_no_control_says_is_refused(focus, said):
    with pytest.raises(ValueError, match=said):
        scenes.values_of(loads(f"[focus]\n{focus}\n"))


@pytest.mark.parametrize(
    "path",
    sorted(Path(__file__).parents[1].joinpath("examples").glob("*.toml")),
    ids=lambda p: p.stem,
)
def test_every_example_can_be_turned(path):
    assert controls.in_range(scenes.values_of(loads(path.read_text())))[1] == ()
