"""One truth through every door: what is less than was asked for is said in the same sentences by
the command line, its page and its summary, by Python, in a sweep's table and on other pages.
"""

import csv
import html
import json
import warnings
from dataclasses import replace

import numpy as np
import pytest

import skinwave
from simple_model import MovingPressure, Response, Tacton
from skinwave.commands.cli import main
from skinwave.models.options import SolveOptions
from skinwave.planning.plan import plan
from skinwave.planning.rows import implausible, of_stretching
from skinwave.planning.simulate import compute, solve
from skinwave.scene.file import loads
from skinwave.scene.scene import Body, Scene

POINT = '[tacton]\nshape = "circle"\nsize_mm = 6\nspeed_m_per_s = 3\nduration_s = 0.05\n'
AM = POINT + "am_frequency_hz = 140\n"
SMALL = "size_x_mm = 30\nsize_y_mm = 30\nthickness_mm = 6\n"
PROBES = "[probes]\npoints_mm = [[0, 0], [5, 0]]\n"
SLAB = f'{AM}[body]\n{SMALL}sides = "clamped"\n{PROBES}'
PAPER = f'{AM}[focus]\npeak_pressure_pa = PRESSURE\n[body]\nkind = "sheet"\nmaterial = "paper"\n'
PAPER += "size_x_mm = 40\nsize_y_mm = 40\nthickness_mm = 0.1\n"
PAPER += f'base = "free"\nsides = "clamped"\n{PROBES}'
SOFT_PAPER, STIFF_PAPER = PAPER.replace("PRESSURE", "2000"), PAPER.replace("PRESSURE", "2")

# What is warned of, the scene, the arguments, and part of the sentence.
KNOWN = {
    "coarse elements": (
        SLAB, {"model": "fem", "h": 0.008}, "elements of 8 mm will have a relative error of"
    ),
    "sides that reflect": (
        SLAB.replace("clamped", "free"),
        {"model": "flat-body"},
        "flat-body, which leaves out reflections from the sides",
    ),
    "no waves": (
        SLAB,
        {"model": "point-kernel"},
        "the point kernel will have a relative error of about 100 %",
    ),
    "sheet beyond linear bending": (
        SOFT_PAPER,
        {"model": "fem", "h": 0.005},
        "times its thickness, and its stretching changes its motion",
    ),
    "no start": (
        STIFF_PAPER, {"model": "fem-harmonic", "h": 0.005}, "leaves out the initial transient"
    ),
}  # fmt: skip


def typed(known):
    """The options of the command line for arguments of Python."""
    found = ["--model", known["model"]]
    found += ["--element-size", f"{1e3 * known['h']:g}"] if "h" in known else []
    return found + (["--dt", f"{known['dt']:g}"] if "dt" in known else [])


def on_the_page(path):
    """The sentences that a page's banner shows."""
    banner = path.read_text().split('<div class="warning"')[1].split("</div>")[0]
    return [html.unescape(p.split(".</p>")[0]) for p in banner.split("<p>Take care: ")[1:]]


@pytest.mark.parametrize("name", sorted(KNOWN.keys() - {"no waves"}))
def test_run_and_simulate_say_the_same(name, tmp_path, monkeypatch, capsys):
    text, arguments, part = KNOWN[name]
    scene = loads(text)
    with pytest.warns(skinwave.SkinwaveWarning) as caught:
        response = skinwave.simulate(scene, **arguments)
    said = [str(w.message) for w in caught]
    assert any(part in sentence for sentence in said)
    assert said == list(response.effort.warnings)  # once each
    assert {w.filename for w in caught} == {__file__}  # the line of the user
    assert response.expected_error >= 0
    assert response.effort.versions["numpy"] == np.__version__

    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(text)
    assert main(["run", "scene.toml", *typed(arguments), "--json"]) == 0
    printed = capsys.readouterr()
    prefix = "skinwave: warning: "
    assert [x.removeprefix(prefix) for x in printed.err.splitlines() if prefix in x] == said
    summary = json.loads(printed.out)
    assert summary["warnings"] == said
    assert summary["expected_error"] == pytest.approx(response.expected_error)
    assert on_the_page(tmp_path / "scene-out/index.html") == said


@pytest.mark.parametrize(
    "name", ["no waves", "sheet beyond linear bending"]
)  # fmt: skip
def test_a_row_of_a_sweep_says_the_same(name, tmp_path, monkeypatch):
    text, arguments, part = KNOWN[name]
    said = solve(loads(text), plan(loads(text), SolveOptions(**arguments))).effort.warnings
    assert any(part in sentence for sentence in said)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(text)
    vary = ["--vary", "tacton.am_frequency_hz=140", "--scheduler", "threads", "--workers", "1"]
    asked = [*vary, *typed(arguments), "--csv", "--quiet"]
    assert main(["sweep", "scene.toml", *asked]) == 0
    (row,) = csv.DictReader((tmp_path / "scene-sweep/rows.csv").read_text().splitlines())
    assert row["warnings"] == "; ".join(said)
    assert float(row["expected_error"]) >= 0


def twice(text):
    """The scene with one probe given twice, which no plan warns of."""
    return text.replace("[5, 0]]", "[5, 0], [5, 0]]")


def test_pages_of_several_models_say_the_same(tmp_path, monkeypatch, capsys):
    scene = loads(twice(SOFT_PAPER))
    said = solve(scene, plan(scene, SolveOptions(model="fem", h=0.005))).effort.warnings
    assert len(said) >= 3
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(twice(SOFT_PAPER))
    assert main(["compare", "scene.toml", "--element-size", "5", "--quiet"]) == 0
    shown = on_the_page(tmp_path / "scene-compared/index.html")
    assert [x.removesuffix(" (sheet)") for x in shown] == list(said)
    assert capsys.readouterr().err.count("skinwave: warning: ") == len(said)
    effort = next((tmp_path / "scene-compared").glob("*/sheet/effort.json"))
    assert json.loads(effort.read_text())["warnings"] == list(said)


def test_a_field_says_the_same_of_its_mesh():
    times = np.arange(4) * 2.5e-3
    scene = loads(twice(SLAB))
    said = solve(scene, plan(scene, SolveOptions(model="fem", h=0.008))).effort.warnings
    with pytest.warns(skinwave.SkinwaveWarning) as caught:
        field = skinwave.field(scene, times, 0.05, h=0.008)
    assert [str(w.message) for w in caught] == list(field.effort.warnings) == list(said)
    assert {w.filename for w in caught} == {__file__}
    assert 0.05 < field.expected_error < 1


def test_what_is_as_asked_warns_of_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        response = skinwave.simulate(loads(SLAB), "auto", 0.3)
        kernel = skinwave.simulate(loads(f"{AM}[body]\nkind = 'none'"), "point-kernel")
    assert response.effort.warnings == kernel.effort.warnings == ()
    assert response.expected_error <= 0.3


def test_a_model_alone_neither_plans_nor_warns():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = compute(loads(SLAB), "fem", h=0.01)
    assert np.isnan(found.expected_error)
    assert found.effort.warnings == ()


def deflected(by, scene, model="fem"):
    """A response of a scene that moves by so much."""
    times = np.arange(3) / 1e4
    motion = np.outer([0.0, -1.0, 0.5], np.ones(len(scene.probes))) * by
    return Response(model=model, times=times, probes=scene.probe_points, values=motion)


def test_what_a_scene_hardly_means_is_said():
    """A density that no solid has, and a probe twice; not one at two depths."""
    probes = ((0.0, 0.0), (0.005, 0.0), (0.0, 0.0))
    light = replace(Body().solid, density=1.0)
    scene = Scene(pressure=MovingPressure(tacton=Tacton()), body=Body(), probes=probes)
    assert len(implausible(scene)) == 1
    assert implausible(replace(scene, depth=(0.0, 0.0, 0.001))) == ()
    found = implausible(replace(scene, body=Body(material=light)))
    assert [said.partition(" ")[0] for said in found] == ["density_kg_m3", "points_mm"]


def test_a_sheet_is_linear_up_to_half_its_thickness():
    quiet, loud = loads(STIFF_PAPER), loads(SOFT_PAPER)
    assert of_stretching(quiet, deflected(0.049e-3, quiet), 0.05) == ()
    (said,) = of_stretching(quiet, deflected(1.2e-3, quiet), 0.05)
    assert "deflects 12 times its thickness" in said
    assert "use --model plate-modes-nonlinear" in said
    assert of_stretching(quiet, deflected(1.2e-3, quiet, "fem-nonlinear"), 0.05) == ()
    assert of_stretching(loud, deflected(0.0, loud), 0.05)  # its middle sags, not its probes alone
    free = loads(SOFT_PAPER.replace('"clamped"', '"absorbing"'))
    assert of_stretching(free, deflected(1.2e-3, free), 0.05) == ()  # all of it moves alike
    slab = loads(SLAB)
    assert of_stretching(slab, deflected(1.0, slab), 0.05) == ()
