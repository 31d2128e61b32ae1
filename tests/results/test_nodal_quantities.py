"""Quantities of whole bodies: tensors of files for other programs, colours of films, and maps."""

from dataclasses import replace

import numpy as np
import pytest
import read_results

from fem.load_and_probe import node_operator
from simple_model import MovingPressure, Response, Tacton, Trajectory, phasors
from simple_model.layers.tensors import hooke
from simple_model.load.spectrum import load_lines, pressure_lines, synthesise
from skinwave.commands.cli import main
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import oscillating, read_at
from skinwave.planning.simulate import compute
from skinwave.report import render
from skinwave.report.renderer import renderer  # noqa: F401, in the condition below
from skinwave.report.styles import style
from skinwave.results import motion, surface, views
from skinwave.results.motion import shade
from skinwave.results.run import Run
from skinwave.results.surface import body_map, grid, quantity_map
from skinwave.scene.file import dumps
from skinwave.scene.scene import Body, Layer, Scene
from skinwave.studies import album, report
from skinwave.studies.pages import Gallery

draws = pytest.mark.skipif("not renderer().is_available", reason="nothing draws solids here")
PATH = Trajectory(shape="circle", size=0.008, speed=5.0)
SCENE = Scene(
    pressure=MovingPressure(tacton=Tacton(trajectory=PATH, duration=0.05, am_frequency=100)),
    body=Body(width=0.036, height=0.036, depth=0.009, sides="clamped"),
    probes=((0.0, 0.0), (0.006, 0.003), (-0.009, 0.0)),
)
COARSE = SolveOptions(h=3e-3, tolerance=0.01)
WIDE = Trajectory(shape="circle", size=0.012, speed=7.0)
AM = Tacton(am_frequency=140.0, trajectory=WIDE, duration=0.2)
LAYER = Scene(
    pressure=MovingPressure(tacton=AM, drive="pressure_squared"),
    body=Body(width=0.06, height=0.06, depth=0.008),
    probes=((0.0, 0.0), (0.006, 0.002)),
)
PLACES = {"reach": 0.012, "step": 0.003}


@pytest.fixture(scope="module")
def moved():
    return motion.whole_motion(SCENE, COARSE)


@pytest.fixture(scope="module")
def view(moved):
    return views.body_view(SCENE, "slab", moved, (0.01, 4))


def test_stress_at_the_surface_meets_the_load(view, moved):
    kept, mesh = views.with_tensors(view).tensors, moved.mesh
    np.testing.assert_array_equal(kept.nodes, np.arange(len(mesh.points)))
    top = np.unique(mesh.facets["top"])
    top = top[np.abs(mesh.points[top, :2]).max(axis=1) < 0.014]  # at clamped edges it is singular
    x = mesh.points[top, :2]
    f, patterns = pressure_lines(SCENE.pressure, x)
    p = SCENE.pressure(x, view.times[kept.frames]) - patterns[f == 0].real.sum(axis=0)
    stress = kept.stress[:, top] / np.abs(p).max()
    assert np.abs(stress[..., 2] + p / np.abs(p).max()).max() < 0.05
    assert np.abs(stress[..., 4:]).max() < 0.06
    elastic = kept.strain[:, top] @ hooke(SCENE.body.solid)[:, 2] / np.abs(p).max()
    assert np.abs(elastic + p / np.abs(p).max()).max() > 0.12  # without the viscous part


def test_a_saved_view_is_read_again_and_damaged_files_are_refused(view, tmp_path):
    views.save(tmp_path / "view.npz", view)
    again, own = views.load(tmp_path / "view.npz"), views.with_tensors(view).tensors
    assert again.scene == view.scene
    np.testing.assert_array_equal(again.motion, view.motion)
    np.testing.assert_array_equal(again.tensors.stress, own.stress)
    arrays = read_results.arrays(tmp_path / "view.npz")
    for name, values in (
        ("tensor_nodes", arrays["tensor_nodes"] + len(again.points)), ("times", np.zeros(0)),
        ("motion", np.nan * arrays["motion"]), ("tets", arrays["tets"][:, :4]),
    ):  # fmt: skip
        np.savez(tmp_path / "spoilt.npz", **arrays | {name: values})
        with pytest.raises(ValueError, match=f"{name.removeprefix('tensor_')}|empty|shape"):
            views.load(tmp_path / "spoilt.npz")


def test_between_two_materials_strain_jumps_and_traction_does_not():
    layers = (Layer(thickness=3e-3, material="palm-stiff"),)
    scene = replace(SCENE, body=replace(SCENE.body, layers=layers))
    seen = views.body_view(scene, "slab", motion.whole_motion(scene, COARSE), (0.01, 2))
    kept = views.with_tensors(seen).tensors
    assert len(kept.nodes) > len(seen.points)
    twice = np.flatnonzero(np.bincount(kept.nodes) == 2)
    places = seen.points[twice]
    np.testing.assert_allclose(places[:, 2], -3e-3, atol=1e-12)
    order = np.argsort(kept.nodes, kind="stable")
    pairs = order[np.isin(kept.nodes[order], twice)].reshape(-1, 2)
    inner = np.abs(places[:, :2]).max(axis=1) < 7e-3
    one, other = (kept.stress[1, pairs[inner, k]] for k in (0, 1))
    size = np.abs(kept.stress[1, pairs[inner]][..., 2]).max()
    assert np.abs(one[:, 2] - other[:, 2]).max() < 0.15 * size  # on elements as coarse as these
    assert np.abs(one[:, 0] - other[:, 0]).max() > 0.3 * size


@pytest.mark.parametrize("quantity", ["stress_xx", "largest_shear_strain", "acceleration"])
def test_the_colour_at_a_node_is_what_a_probe_reads_there(quantity, moved):
    corners = np.unique(moved.mesh.tets[:, :4])
    x = moved.mesh.points[corners]
    away = np.linalg.norm(x - np.array([6e-3, 3e-3, 0.0]), axis=1)
    node = corners[[np.argmin(away)]]
    place = tuple(moved.mesh.points[node[0], :2].tolist())
    scene = replace(SCENE, quantity=quantity, probes=(place,))
    times = np.arange(5) * 2e-3
    asked, lines = scene.reading.record, motion.probe_lines(scene, moved)
    lines = lines if asked.invariant else oscillating(lines)
    expected = asked.waveforms(synthesise(lines.frequencies, lines.lines, times), 1)
    found = shade(scene, moved, times, node).values
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4 * np.abs(expected).max())


@draws
def test_pictures_are_coloured_by_the_quantity(view):
    pictures = [
        render.picture([views.with_shade(view, replace(SCENE, quantity=name))], style("report"))
        for name in ("strain_zz", "displacement_x")
    ]
    assert np.abs(pictures[0].astype(float) - pictures[1]).mean() > 1


def test_a_report_maps_the_quantity_at_the_depth_of_the_probes(view, moved, tmp_path):
    quantity = "strain_zz"
    scene = replace(SCENE, quantity=quantity, depth=0.7e-3)
    album.write_view(replace(view, scene=scene), tmp_path, {})
    found = surface.load(tmp_path / "map.npz", scene)
    assert found.depth == 0.7e-3
    seen = motion.probe_lines(scene, moved)
    rms = np.sqrt((np.abs(seen.lines[seen.frequencies > 0]) ** 2).sum(axis=0) / 2)
    at = np.searchsorted(found.x, -1e-9), np.searchsorted(found.y, -1e-9)
    assert found.rms[at[1], at[0]] == pytest.approx(rms[0], rel=1e-6)
    run = Run(
        tacton="", body="slab", scene=scene,
        response=Response(
            model="fem", times=np.arange(2.0), probes=scene.probe_points, quantity=quantity,
            values=np.zeros((2, 3)),
        ),
    )  # fmt: skip
    kept = album.Album(title="", scene=scene, runs=[run], views={}, maps={"slab": found})
    (section,) = report.map_parts(kept, Gallery())
    (picture,) = section.parts
    assert f"The RMS of the {scene.reading.words} is largest at" in picture.caption
    assert len(picture.files["png"]) > 10_000


def test_a_report_of_motion_maps_the_surface(view, moved, tmp_path):
    album.write_view(view, tmp_path, {})
    found = surface.load(tmp_path / "map.npz", SCENE)
    at = np.unravel_index(np.nanargmax(found.rms), found.rms.shape)
    _, inwards = node_operator(moved.mesh, patch=SCENE.body.of_kind.normal_patch)
    lines = np.abs(read_at(oscillating(moved.motion), inwards @ moved.basis).lines)
    rms = np.sqrt((lines**2).sum(axis=0) / 2).max()
    assert found.rms[at] == pytest.approx(rms, rel=0.05)  # at places, and at nodes
    (tmp_path / "map.npz").write_bytes(b"none")
    with pytest.raises(ValueError, match="not a map"):
        surface.load(tmp_path / "map.npz", SCENE)


def test_maps_of_displacement_agree_with_those_of_reports():
    found = quantity_map(LAYER, **PLACES)
    known = body_map(LAYER, *grid(LAYER, **PLACES))
    np.testing.assert_allclose(found.rms, known.rms, rtol=1e-4)  # which has a spline
    assert np.isnan(found.error)


def test_the_rms_of_an_invariant_has_the_symmetry_of_the_load():
    rms = quantity_map(replace(LAYER, quantity="energy_density", depth=0.7e-3), **PLACES).rms
    np.testing.assert_allclose(np.rot90(rms), rms, rtol=5e-3)


def test_the_rms_of_an_invariant_of_one_frequency():
    """u(t) = |a cos| has the RMS about its mean of a rectified sine: a sqrt(1/2 - 4/pi^2)."""
    still = replace(AM, trajectory=Trajectory(shape="point"))
    linear = replace(LAYER.pressure, tacton=still, drive="linear")
    scene = replace(LAYER, pressure=linear, quantity="strain_zz", depth=0.001)
    one = quantity_map(scene, **PLACES)
    rms = quantity_map(replace(scene, quantity="energy_density"), **PLACES).rms
    # On the axis the strain is (-e/2, -e/2, e) nearly, so that W = 3/2 mu e^2: about its mean
    # mu e0^2 3/4 cos(2 w t), of RMS 3/2 mu e_rms^2 / sqrt(2).
    middle = rms.shape[0] // 2, rms.shape[1] // 2
    mu = LAYER.body.solid.shear_modulus
    expected = 1.5 * mu * one.rms[middle] ** 2 / np.sqrt(2)
    assert rms[middle] == pytest.approx(expected, rel=2e-3)


def test_an_invariant_includes_the_mean_of_the_tensor():
    scene = replace(LAYER, quantity="largest_shear_strain", depth=0.001)
    rms = quantity_map(scene, **PLACES).rms
    long = replace(scene.pressure, tacton=replace(AM, duration=1.0))
    probes = replace(scene, probes=((0.0, 0.0), (0.006, 0.003)), pressure=long)
    seen = compute(probes, "flat-body-harmonic").values.std(axis=0)
    np.testing.assert_allclose(rms[[4, 5], [4, 6]], seen, rtol=0.01)


def test_maps_of_elements_agree_with_probes():
    still = replace(AM, trajectory=Trajectory(shape="point"), duration=0.5)
    scene = replace(
        LAYER, quantity="strain_zz", depth=0.002,
        body=replace(LAYER.body, width=0.04, height=0.04, sides="clamped"),
        pressure=replace(LAYER.pressure, tacton=still),
    )  # fmt: skip
    found = quantity_map(scene, SolveOptions(h=8e-3), reach=0.006, step=0.002)
    probes = replace(scene, probes=((0.0, 0.0), (0.006, 0.002), (-0.004, 0.006)))
    response = compute(probes, "fem", h=8e-3)
    frequencies = np.unique(np.round(load_lines(scene.pressure, 1e-4).frequencies, 6))
    lines = np.abs(phasors(response, frequencies[(frequencies > 0) & (frequencies < 2000)]))
    expected = np.sqrt((lines**2).sum(axis=0) / 2)
    read = found.rms[[3, 4, 6], [3, 6, 1]]
    np.testing.assert_allclose(read, expected, rtol=0.02)
    assert 0 < found.error < 0.5


def test_the_command_writes_a_page_and_tables(tmp_path, monkeypatch, capsys, refused):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "layer.toml").write_text(dumps(LAYER))
    asked = "report layer.toml --map --quantity velocity --reach 6 --step 3 --depth meissner"
    assert main(asked.split()) == 0
    table = np.genfromtxt("layer-map/map.csv", delimiter=",", names=True)
    kept = read_results.arrays("layer-map/map.npz")
    np.testing.assert_allclose(table["rms_velocity_mm_s"], 1e3 * kept["rms"].ravel(), rtol=1e-6)
    assert {"index.html", "map.png", "record.json", "scene.toml"} <= {
        path.name for path in (tmp_path / "layer-map").iterdir()
    }
    capsys.readouterr()
    for words in ("--step 0.01", "--depth 9"):  # too many places, and below the body
        refused("report", "layer.toml", "--map", "-o", "out", *words.split())
