"""Pictures: that they show what their captions say."""

import gc
import json
import os
import re
import wave
from dataclasses import replace
from hashlib import sha256
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
import read_results
from in_browser import needs_browser, settled
from legible import illegible, sizes
from matplotlib.figure import Figure
from PIL import Image

from simple_model import (
    MovingPressure,
    Response,
    Tacton,
    Trajectory,
    pattern_period,
    published_load,
)
from simple_model.quantities import DISPLACEMENT
from skinwave.commands.cli import main
from skinwave.models.options import SolveOptions
from skinwave.report import body_picture, films, maps, render
from skinwave.report.renderer import Renderer, begin, renderer
from skinwave.report.spectra import levels_figure, tacton_figure
from skinwave.report.styles import style
from skinwave.results import motion, playback, views
from skinwave.results.run import Run
from skinwave.results.surface import SurfaceField
from skinwave.scene.file import dumps, loads
from skinwave.scene.scene import BODIES, Body, Layer, Mounting, Placement, Scene, Sides
from skinwave.studies import album, pages, report

ONLY = "point-kernel-published,point-kernel,skin-slab"
ARTEFACTS = Path(__file__).parents[2] / ".ci" / "artefacts"
draws = pytest.mark.skipif("not renderer().is_available", reason="nothing draws solids here")
NO_GL = Renderer(is_available=False, detail="missing; apt install libegl1 libgl1-mesa-dri")


def circling(frequency=200.0, **tacton):
    path = Trajectory(shape="circle", size=12 / np.pi / frequency, speed=12.0)
    return MovingPressure(tacton=Tacton(trajectory=path, duration=0.05, **tacton))


@pytest.fixture(scope="module")
def scene():
    probes = ((0.0, 0.0), (0.005, 0.0), (0.01, 0.0))
    return Scene(name="small", pressure=circling(am_frequency=100), body=Body(), probes=probes)


@pytest.fixture(scope="module")
def moved(scene):
    return motion.whole_motion(scene, SolveOptions(h=0.012, tolerance=0.01))


@pytest.fixture(scope="module")
def folder(scene, tmp_path_factory):
    out = tmp_path_factory.mktemp("album")
    asked = {"frames": 12, "beside": ["paper-sheet-loose"]}
    album.write_album(out, scene, SolveOptions(h=0.015), **asked)
    return out


@pytest.fixture(scope="module")
def seen(folder):
    return album.open_album(folder).views


@pytest.fixture(scope="module")
def page(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("page") / "report"
    kinds = ["--format", "svg", "--format", "pdf", "--only", ONLY]
    assert main(["report", str(folder), "--out", str(out), *kinds, "--quiet"]) == 0
    return out


def test_all_but_the_published_kernel_receive_the_same_load(scene, folder, seen):
    assert list(seen) == ["point-kernel", "paper-sheet-loose", "skin-slab"]
    assert seen["skin-slab"].scene == scene
    assert {view.quantity.unit for view in seen.values()} == {"Pa", "m"}
    loads = {run.column: run.scene.pressure for run in album.open_album(folder).runs}
    assert list(loads) == ["point-kernel-published", *seen]
    assert loads.pop("point-kernel-published") == published_load(scene.pressure) != scene.pressure
    assert set(loads.values()) == {scene.pressure}


def test_a_scene_is_shown_on_its_own_body_under_its_load(scene):
    own = replace(scene.pressure, drive="linear", profile="array")
    shown = album.scene_columns(replace(scene, pressure=own, body=Body(depth=0.02)))
    assert list(shown) == ["point-kernel-published", "point-kernel", "slab"]
    assert shown["point-kernel"].pressure == shown["slab"].pressure == own
    bare = album.scene_columns(replace(scene, pressure=own, body=Body(kind="none")))
    assert list(bare)[2:] == ["paper-sheet", "palm"]
    assert {its.pressure for its in list(bare.values())[1:]} == {own}
    asked = album.scene_columns(scene, ["paper-sheet-loose", "skin-slab"])
    assert list(asked)[2:] == ["skin-slab", "paper-sheet-loose"]
    with pytest.raises(ValueError, match="body 'paper' is unknown"):
        album.scene_columns(scene, ["paper"])


def test_views_agree_with_probes(scene, moved):
    view = views.body_view(scene, "skin-slab", moved, (0.01, 10))
    response = motion.probe_response(scene, moved)
    at_probe = maps.interpolation(view, scene.probe_points[2:3])
    drawn = np.array([at_probe(np.asarray(frame, float))[0] for frame in view.inward])
    sampled = response.displacement[-100:, 2].reshape(10, 10)[:, 0]
    assert view.period == pytest.approx(0.01)
    assert np.ptp(drawn) > 1e-7
    np.testing.assert_allclose(drawn, sampled - response.displacement[-100:, 2].mean(), atol=3e-8)


def test_interpolation_leaves_out_triangles_seen_edge_on():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, -1]], float)
    view = views.View(
        body="b", model="m", scene=None, quantity=DISPLACEMENT, points=points,
        tets=np.zeros((0, 10), int), surface=np.arange(4), period=1.0,
        triangles=np.array([[0, 3, 1], [0, 1, 2]]),
        times=np.zeros(1), motion=np.zeros((1, 4, 3)), tone=0.0, speed=None,
    )  # fmt: skip
    found = maps.interpolation(view, np.array([[0.25, 0.25]]))(np.array([0.0, 1.0, 2.0, 9.0]))
    assert found == pytest.approx([0.75])


def test_the_kernel_is_strongest_on_the_path(seen):
    view = seen["point-kernel"]
    radius = view.scene.tacton.trajectory.size / 2
    step = np.ptp(view.places[:, 0]) / (121 - 1)
    brightest = view.places[view.inward.std(axis=0).argmax()]
    assert abs(np.hypot(*brightest) - radius) < 1.5 * step
    for t, frame in zip(view.times, np.abs(view.inward), strict=True):
        if frame.max() > 0.2 * view.peak:  # where the modulation is not at its zero
            focus = view.scene.tacton.trajectory.position(float(t))
            assert np.linalg.norm(view.places[frame.argmax()] - focus) < 1.5 * step


def test_the_played_part_is_a_period_of_the_pattern():
    beating = circling(190.986, am_frequency=140)
    span = pattern_period(beating.tacton)
    assert span >= 1 / 50.986
    assert playback.phase_jump(beating.tacton, 1 / 140) == pytest.approx(190.986 / 140 - 1)
    whole = circling(200.0, am_frequency=140)
    assert playback.played_part(whole, 340.0) == pytest.approx((0.05, 8 * 0.05 * 340))
    shortest = playback.played_part(circling(200.0), 200.0)
    assert shortest == pytest.approx((0.005, playback.FRAMES.fewest))


def test_a_long_pattern_is_played_in_part():
    long = replace(circling(200.0, am_frequency=100.5).tacton, duration=2.0)
    load = MovingPressure(tacton=long)
    assert playback.whole_period(load) == pytest.approx(2.0)
    span, frames = playback.played_part(load, 300.0)
    assert frames == playback.FRAMES.most
    assert frames / (span * 300.0) >= playback.FRAMES.per_period


def test_the_number_of_frames_follows_from_the_fastest_line(scene, moved):
    fastest = views.fastest_line(moved)
    view = views.body_view(scene, "skin-slab", moved)
    assert view.period == pytest.approx(0.01)
    needed = round(playback.FRAMES.per_period * fastest * view.period)
    assert len(view.times) == max(playback.FRAMES.fewest, needed)
    amplitude = np.abs(np.fft.rfft(view.inward, axis=0)).max(axis=1)
    strong = np.flatnonzero(amplitude > 0.1 * amplitude.max()) / view.period
    assert strong.max() <= 1.5 * fastest <= 1.5 * 800


@draws
def test_motion_is_exaggerated_as_stated(seen):
    view = seen["paper-sheet-loose"]
    panel = render.make_panel(view)
    render.set_frame([panel], 5, 1.0)
    drawn = np.asarray(panel.skin.points) - 1e3 * view.points[panel.nodes]
    moved = 1e3 * view.motion[5, panel.nodes]
    factor = float((drawn * moved).sum() / (moved**2).sum())
    said = re.search(r"exaggerated ([\d,]+) times", render.scale_text(view))
    assert said
    assert factor == pytest.approx(float(said[1].replace(",", "")), rel=1e-3)
    assert 0.015 < factor * view.peak / 0.1 <= 0.06
    assert render.scale_text(seen["point-kernel"]) == "pressure, no motion"


def test_a_flat_view_is_as_large_as_the_largest_body(seen):
    sizes = {name: np.ptp(view.places, axis=0) for name, view in seen.items()}
    kernel = sizes.pop("point-kernel")
    np.testing.assert_allclose(kernel, np.max(list(sizes.values()), axis=0), rtol=1e-9)


def test_axes_end_where_data_end(folder, seen):
    view = seen["skin-slab"]
    reach = 1e3 * np.abs(view.places).max(axis=0) + 1e-6
    for ax in maps.snapshots_figure([view], style("report")).axes[:4]:
        assert len(ax.lines) == 4  # path, focus and both sides of the cone
        assert all((np.abs(line.get_xydata()) <= reach).all() for line in ax.lines)
    runs = album.open_album(folder).groups["small"]
    levels = levels_figure(runs, 0, style("report")).axes[0]
    drawn = [line.get_ydata() for line in levels.lines if len(line.get_ydata()) > 2]
    assert levels.get_ylim()[1] <= 10 * np.concatenate(drawn).max()


def test_a_map_of_small_values_has_short_numbers(scene):
    line = np.linspace(-0.01, 0.01, 9)
    rms = 3e-7 * np.add.outer(line**2, line**2) / line[-1] ** 2
    rms[:3, :3] = np.nan
    field = SurfaceField(x=line, y=line, rms=rms)
    field_figure = maps.surfaces_figure(scene, {"small": replace(field, rms=1e-4 * rms)})
    plot, bar = field_figure.axes
    field_figure.draw_without_rendering()
    assert "10\u207b\u2075 \u00b5m" in bar.get_ylabel()
    assert not bar.yaxis.get_offset_text().get_text()
    shown = plot.images[0].get_array()
    assert min(shown.shape) > 100
    assert shown.max() == pytest.approx(6, rel=1e-6)
    assert np.ma.masked_invalid(shown).mask[0, 0]


LAYERED = Body(
    width=0.03, height=0.03, depth=0.01, sides=Sides(left="clamped"), material="muscle",
    layers=(Layer(thickness=0.002, material="fat"),),
)  # fmt: skip


@pytest.mark.parametrize(
    ("body", "named", "materials"),
    [
        (LAYERED, {"free", "clamped", "absorbing"}, {"fat", "muscle"}),
        (BODIES["fingertip"], {"free", "clamped"}, {"palm", "bone"}),
        (Body(kind="palm"), {"free", "clamped", "absorbing"}, {"palm"}),
        (
            replace(BODIES["paper-sheet"], mounting=Mounting(edges=("left",), support="clamped")),
            {"free", "clamped"}, {"paper-grain"},
        ),
    ],
)  # fmt: skip
def test_a_body_is_drawn_with_its_conditions_and_materials(body, named, materials):
    drawn = body_picture.meshed_body(body)
    assert set(drawn.conditions) == named
    middles = drawn.points[drawn.facets[:, :3]].mean(axis=1)
    half = 1e3 * np.array([body.width, body.height]) / 2
    assert (np.abs(drawn.points[drawn.facets][..., :2]) <= half + 1).all()  # mounds bulge
    clamped, size = middles[drawn.conditions == "clamped"], body_picture.drawn_size(body)
    if body.kind == "slab":
        at_left = np.isclose(clamped[:, 0], -half[0])
        assert at_left.any()
        assert (at_left | np.isclose(clamped[:, 2], -1e3 * body.depth)).all()
    elif body.kind == "palm":  # on bone below
        held = middles[(drawn.conditions == "clamped") & (drawn.shares > 0.5)]  # not faded
        assert len(held)
        assert (held[:, 2] < -1e3 * body.depth / 3).all()
    else:
        axis = 0 if body.kind == "sheet" else 1
        assert (clamped[:, axis] < -half[axis] + 1e3 * size).all()
    shown = {drawn.names[k] for k in np.unique(drawn.region).tolist()}
    assert shown == materials
    assert drawn.is_cut == (len(materials) > 1)


def test_a_body_beside_the_origin_is_cut_open_at_its_middle():
    assert not body_picture.meshed_body(LAYERED).corner.any()
    beside = replace(LAYERED, placement=Placement(offset=(0.02, -0.03)))
    np.testing.assert_allclose(body_picture.meshed_body(beside).corner, [20, -30], atol=1e-9)


@draws
def test_the_section_of_a_body_has_the_colours_of_its_legend(scene):
    small = replace(scene, body=LAYERED, probes=((0.0, 0.0), (0.01, 0.0)))
    pixels = body_picture.body_picture(small)
    assert pixels.shape[1] == style("report").screen
    printed = body_picture.body_picture(small, style("print"))
    assert printed.shape[1] == 7 * 300
    for colour in body_picture.REGIONS[:2]:
        shade = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)])
        assert (np.abs(pixels.astype(int) - shade).max(axis=2) < 4).sum() > 5000


def test_a_page_says_why_it_has_no_picture_of_the_body(monkeypatch):
    response = Response(model="fem", times=np.arange(3.0), probes=np.zeros((1, 2)),
                        values=np.zeros((3, 1)))  # fmt: skip
    run = Run(tacton="", body="palm", scene=loads(""), response=response)
    monkeypatch.setattr(pages, "renderer", lambda: NO_GL)
    gallery = pages.Gallery()
    (part,) = pages._body_parts({run: Mock()}, gallery)
    assert "apt install libegl1" in str(part)
    flat = replace(run, response=replace(response, model="flat-body"))
    assert pages._begin_pictures([flat], gallery) == {}


@draws
def test_a_film_has_distinct_frames_and_repeats_without_a_jump(seen, tmp_path):
    films.film(tmp_path / "film.gif", [seen["skin-slab"]], style("report"), panel=(160, 144))
    with Image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == 12
        frames = []
        for k in range(film.n_frames):
            film.seek(k)
            whole = np.asarray(film.convert("RGB"), int)
            frames.append(whole[20:-15])  # without titles and the time stamp
    assert len({sha256(frame.tobytes()).hexdigest() for frame in frames}) == 12
    steps = [np.abs(a - b).mean() for a, b in zip(frames, frames[1:] + frames[:1], strict=True)]
    assert steps[-1] < 1.5 * max(steps[:-1])


@draws
@pytest.mark.skipif(not all(map(find_spec, films.ENCODER)), reason="the extra [film] is missing")
@pytest.mark.filterwarnings(  # imageio-ffmpeg leaves its encoder's pipe to the collector
    "ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"
)
def test_a_film_may_be_an_mp4(seen, tmp_path):
    import imageio.v2 as imageio

    path = tmp_path / "film.mp4"
    films.film(path, [seen["skin-slab"]], style("report"), panel=(160, 144))
    with imageio.get_reader(path) as film:
        assert sum(1 for _ in film) == 12
        assert film.get_meta_data()["fps"] == pytest.approx(12 / 4.0)  # in 4 s at least
    gc.collect()


def test_a_sound_has_the_scale_in_its_name(seen, page):
    (path,) = (page / "data").glob("*.wav")
    scale = float(re.search(r"full_scale_([\d.e-]+)_um", path.name)[1])
    with wave.open(str(path)) as sound:
        assert sound.getframerate() == 10_000
        samples = np.frombuffer(sound.readframes(sound.getnframes()), np.int16)
    motion = read_results.arrays(page / "data/skin-slab_probes.npz")["displacement"]
    probe = np.abs(motion - motion.mean(axis=0)).max(axis=0).argmax()
    expected = 1e6 * (motion[:, probe] - motion[:, probe].mean())
    np.testing.assert_allclose(samples / 32767 * scale, expected, atol=1e-3 * scale)


def test_fields_are_opened_again_with_their_times(seen, page):
    pv = pytest.importorskip("pyvista")
    reader = pv.get_reader(str(page / "data/skin-slab.pvd"))
    assert len(reader.time_values) == 8
    reader.set_active_time_point(3)
    (grid,) = reader.read()
    view = seen["skin-slab"]
    frame = int(np.argmin(np.abs(view.times - reader.time_values[3])))
    np.testing.assert_array_equal(grid["displacement_m"], view.motion[frame])
    np.testing.assert_allclose(grid.points, view.points)
    for name, values in (("strain", view.tensors.strain), ("stress_pa", view.tensors.stress)):
        own = grid[name][:, [0, 1, 2, 3, 5, 4]]  # in ParaView's order
        np.testing.assert_array_equal(own, values[3])
    assert list(grid.field_data["units"]) == ["displacement_m: m", "strain: 1", "stress_pa: Pa"]


def test_vector_figures_keep_text_as_text(page):
    for name in ("propagation", "snapshots"):
        assert (page / f"pictures/{name}.png").stat().st_size > 10_000
        svg = (page / f"pictures/{name}.svg").read_text()
        assert svg.count("<text") > 10
        assert 'id="DejaVu' not in svg  # no glyph as a path
        pdf = (page / f"pictures/{name}.pdf").read_bytes()
        assert b"/Type3" not in pdf
        assert b"/FontFile2" in pdf  # TrueType


@pytest.mark.slow
def test_no_text_of_a_figure_is_cut(folder):
    kept = album.open_album(folder)
    shown, runs = list(kept.views.values()), kept.groups["small"]
    drawn = [
        (chosen, figure)
        for chosen in (style("talk"), style("report", 3.5))
        for figure in (
            maps.snapshots_figure(shown, chosen),
            maps.surfaces_figure(kept.scene, kept.maps, chosen),
            tacton_figure("small", runs, chosen), levels_figure(runs, 0, chosen),
        )
    ]  # fmt: skip
    for chosen, figure in drawn:
        assert illegible(figure) == []
        if chosen.columns:
            assert figure.get_figwidth() in chosen.columns
            assert sizes(figure) <= {8.0, 10.0}  # names of lines, with subscripts of 7 points


@needs_browser
def test_the_page_opens_in_a_browser_without_a_network(page, browser):
    said, asked = [], []
    tab = browser.new_page(viewport={"width": 1200, "height": 900})
    tab.on("console", lambda m: said.append(m.text) if m.type == "error" else None)
    tab.on("pageerror", lambda error: said.append(str(error)))
    tab.route(re.compile("^(https?|wss?)://"), lambda r: (asked.append(r.request.url), r.abort()))
    tab.set_default_timeout(120_000)
    tab.goto(f"file://{page / 'index.html'}")
    settled(tab)
    for frame in tab.frames[1:]:
        frame.wait_for_function("() => document.querySelector('canvas')")
    broken = tab.evaluate("[...document.images].filter(i => !i.naturalWidth).length")
    ARTEFACTS.mkdir(parents=True, exist_ok=True)
    tab.screenshot(path=ARTEFACTS / "report.png", full_page=True)
    tab.close()
    assert broken == 0
    assert [text for text in said if "favicon" not in text and "ERR_FAILED" not in text] == []
    assert all("favicon" in url for url in asked), asked


def test_a_report_is_drawn_again_without_a_model_or_gl(folder, tmp_path, monkeypatch):
    def run(*arguments, **options):
        raise AssertionError("a model was run")

    for name in ("whole_motion", "plan", "compute", "solve_as_planned"):
        monkeypatch.setattr(album, name, run)
    monkeypatch.setattr(views, "kernel_view", run)
    monkeypatch.setattr(report, "renderer", lambda: NO_GL)
    blank = BytesIO()  # what is on the figures is looked at in those of `page`
    Image.new("RGB", (8, 8)).save(blank, "PNG")
    monkeypatch.setattr(pages, "figure_file", lambda *figure: blank.getvalue())
    assert main(["report", str(folder), "--out", str(tmp_path / "flat"), "--quiet"]) == 0
    text = (tmp_path / "flat/index.html").read_text()
    assert "apt install libegl1 libgl1-mesa-dri" in text
    assert (tmp_path / "flat/pictures/snapshots.png").exists()
    assert not (tmp_path / "flat/pictures/film.gif").exists()


def test_a_film_that_fails_is_left_out_by_name(monkeypatch):
    view = SimpleNamespace(column="palm", quantity=DISPLACEMENT, peak=1.0, tets=(), peak_frame=0,
                           scene=loads(""))  # fmt: skip
    monkeypatch.setattr(render, "scale_text", lambda view: "to scale")
    monkeypatch.setattr(render, "picture", lambda *given: np.zeros((8, 8, 3), np.uint8))
    monkeypatch.setattr(report.maps, "snapshots_figure", lambda *given: Figure())
    monkeypatch.setattr(report, "turntable", lambda *given: "")
    monkeypatch.setattr(report, "renderer", lambda: SimpleNamespace(is_available=True))
    monkeypatch.setattr(report, "_film", Mock(side_effect=ArithmeticError("no frames")))
    album, gallery = SimpleNamespace(views={"palm": view}, scene=view.scene), pages.Gallery()
    (section,) = report.picture_parts(album, gallery)
    assert list(section.parts[0].options) == ["side by side", "snapshots"]
    assert gallery.failures == {"film": "no frames"}


def test_a_crash_of_the_renderer_is_detected(monkeypatch):
    monkeypatch.setattr("skinwave.report.renderer.draw_sphere", os.abort)
    found = begin.__wrapped__().result()
    assert not found.is_available
    assert "libegl1 libgl1-mesa-dri" in found.detail


def test_a_run_of_one_model_has_a_report(tmp_path, monkeypatch, capsys, refused):
    monkeypatch.chdir(tmp_path)
    kernel = Scene(name="kernel", pressure=circling(am_frequency=100), body=Body(kind="none"))
    Path("kernel.toml").write_text(dumps(kernel))
    assert main(["run", "kernel.toml", "--out", "one", "--quiet"]) == 0
    assert main(["report", "one"]) == 0
    assert Path("one/report/index.html").exists()
    assert main(["report", "one", "--quiet"]) == 0  # its own folder is made anew
    capsys.readouterr()
    for words in (["one/report/pictures"], ["one", "--film"], ["one", "--only", "skin_slab"]):
        refused("report", *words)


def test_the_installation_lists_packages_and_cures(capsys):
    assert main(["verify", "--installation", "--json"]) == 0
    found = {row["what"]: row for row in json.loads(capsys.readouterr().out)["findings"]}
    assert {"python", "pyvista", "solver", "renderer", "threads"} <= set(found)
    assert bool(found["renderer"]["cure"]) != renderer().is_available
