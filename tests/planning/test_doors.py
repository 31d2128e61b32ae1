"""Command line, pages, Python, sweep and comparison give the same warnings of a response."""

import csv
import json
import re
import warnings
from dataclasses import replace

import numpy as np
import pytest

import skinwave
from simple_model import ErrorPart, MovingPressure, Response, Statement, Tacton
from skinwave.commands.cli import main
from skinwave.models.options import SolveOptions
from skinwave.planning.plan import plan
from skinwave.planning.plan_warnings import implausible, large_deflection
from skinwave.planning.simulate import compute, solve_as_planned
from skinwave.scene.file import loads
from skinwave.scene.scene import Body, Scene
from skinwave.system.templates import typeset

POINT = '[tacton]\nshape = "circle"\nsize_mm = 6\nspeed_m_per_s = 3\nduration_s = 0.05\n'
AM = POINT + "am_frequency_hz = 140\n"
SMALL = "size_x_mm = 30\nsize_y_mm = 30\nthickness_mm = 6\n"
PROBES = "[probes]\npoints_mm = [[0, 0], [5, 0]]\n"
SLAB = f'{AM}[body]\n{SMALL}sides = "clamped"\n{PROBES}'
PAPER = f'{AM}[focus]\npeak_pressure_pa = PRESSURE\n[body]\nkind = "sheet"\nmaterial = "paper"\n'
PAPER += "size_x_mm = 40\nsize_y_mm = 40\nthickness_mm = 0.1\n"
PAPER += f'base = "free"\nsides = "clamped"\n{PROBES}'
PLATE = "preset = 'paper-sheet'\nsides = 'clamped'"
SMALL_BODY = f"{SMALL.replace('30', '50')}sides = 'clamped'"
LOUD_PAPER, QUIET_PAPER = PAPER.replace("PRESSURE", "2000"), PAPER.replace("PRESSURE", "2")

# Scene, arguments, and part of one of the warnings.
WARNED = {
    "coarse elements": (SLAB, {"model": "fem", "h": 0.008}, "8 mm"),
    "sides that reflect": (SLAB.replace("clamped", "free"), {"model": "flat-body"}, "sides"),
    "no waves": (SLAB, {"model": "point-kernel"}, "100 %"),
    "sheet beyond linear bending": (LOUD_PAPER, {"model": "fem", "h": 0.005}, "thickness"),
    "no start": (QUIET_PAPER, {"model": "fem-harmonic", "h": 0.005}, "initial transient"),
}


def options_of(arguments):
    words = ["--model", arguments["model"]]
    return words + (["--element-size", f"{1e3 * arguments['h']:g}"] if "h" in arguments else [])


def page_warnings(path):
    banner = path.read_text().split('<div class="warning"')[1].split("</div>")[0]
    return [p.split(".</p>")[0] for p in banner.split("<p>Take care: ")[1:]]


@pytest.mark.parametrize("name", sorted(WARNED.keys() - {"no waves"}))
def test_run_and_simulate_give_the_same_warnings(name, tmp_path, monkeypatch, capsys):
    text, arguments, part = WARNED[name]
    with pytest.warns(skinwave.SkinwaveWarning) as caught:
        response = skinwave.simulate(loads(text), **arguments)
    sentences = [str(w.message) for w in caught]
    assert any(part in sentence for sentence in sentences)
    assert sentences == list(response.effort.warnings)  # once each
    assert {w.filename for w in caught} == {__file__}  # the line of the user
    assert response.expected_error >= 0
    assert response.effort.versions["numpy"] == np.__version__

    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(text)
    assert main(["run", "scene.toml", *options_of(arguments), "--json"]) == 0
    printed = capsys.readouterr()
    prefix = "skinwave: warning: "
    assert [x.removeprefix(prefix) for x in printed.err.splitlines() if prefix in x] == sentences
    summary = json.loads(printed.out)
    assert summary["warnings"] == sentences
    assert summary["expected_error"] == pytest.approx(response.expected_error)
    assert page_warnings(tmp_path / "scene-out/index.html") == [*map(typeset, sentences)]


def test_every_error_above_the_tolerance_is_a_warning():
    """Also a total whose parts are all below it."""
    parts = tuple(ErrorPart(name=x, source=x, error=0.04, cure=f"change {x}") for x in "ab")
    (said,) = Statement(parts=parts, tolerance=0.05).warnings
    assert said.endswith("expected error 5.7 %, tolerance 5 %; change a")
    assert not Statement(parts=parts, tolerance=0.06).warnings
    for tolerance in (0.02, 0.05, 0.4):
        planned = plan(loads(SLAB), SolveOptions(model="fem", h=3e-3, tolerance=tolerance))
        assert (planned.error > tolerance) == bool(planned.warnings)
        squares = sum(part.error**2 for part in planned.statement.parts)
        assert planned.error == pytest.approx(np.sqrt(squares), rel=1e-12)


@pytest.mark.parametrize("name", ["no waves", "sheet beyond linear bending"])
def test_a_row_of_a_sweep_has_the_same_warnings(name, tmp_path, monkeypatch):
    text, arguments, part = WARNED[name]
    sentences = solve_as_planned(
        loads(text), plan(loads(text), SolveOptions(**arguments))
    ).effort.warnings
    assert any(part in sentence for sentence in sentences)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(text)
    vary = ["--vary", "tacton.am_frequency_hz=140", "--scheduler", "threads", "--workers", "1"]
    words = [*vary, *options_of(arguments), "--csv", "--quiet"]
    assert main(["sweep", "scene.toml", *words]) == 0
    (row,) = csv.DictReader((tmp_path / "scene-sweep/rows.csv").read_text().splitlines())
    assert row["warnings"] == "; ".join(sentences)
    assert float(row["expected_error"]) >= 0


def with_probe_twice(text):
    return text.replace("[5, 0]]", "[5, 0], [5, 0]]")


def test_pages_of_several_models_have_the_same_warnings(tmp_path, monkeypatch, capsys):
    scene = loads(with_probe_twice(LOUD_PAPER))
    sentences = solve_as_planned(
        scene, plan(scene, SolveOptions(model="fem", h=0.005))
    ).effort.warnings
    assert len(sentences) >= 3
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(with_probe_twice(LOUD_PAPER))
    assert main(["compare", "scene.toml", "--element-size", "5", "--quiet"]) == 0
    banner = page_warnings(tmp_path / "scene-compared/index.html")
    assert [x.removesuffix(" (sheet)") for x in banner] == [*map(typeset, sentences)]
    assert capsys.readouterr().err.count("skinwave: warning: ") == len(sentences)
    effort = next((tmp_path / "scene-compared").glob("*/sheet/effort.json"))
    assert json.loads(effort.read_text())["warnings"] == list(sentences)


def test_a_field_has_the_same_warnings():
    times = np.arange(4) * 2.5e-3
    scene = loads(with_probe_twice(SLAB))
    sentences = solve_as_planned(
        scene, plan(scene, SolveOptions(model="fem", h=0.008))
    ).effort.warnings
    with pytest.warns(skinwave.SkinwaveWarning) as caught:
        field = skinwave.field(scene, times, 0.05, h=0.008)
    assert [str(w.message) for w in caught] == list(field.effort.warnings) == list(sentences)
    assert {w.filename for w in caught} == {__file__}
    assert 0.05 < field.expected_error < 1


def test_a_met_request_and_a_model_alone_give_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        response = skinwave.simulate(loads(SLAB), "auto", 0.3)
        kernel = skinwave.simulate(loads(f"{AM}[body]\nkind = 'none'"), "point-kernel")
        alone = compute(loads(SLAB), "fem", h=0.01)
    assert response.effort.warnings == kernel.effort.warnings == alone.effort.warnings == ()
    assert response.expected_error <= 0.3
    assert np.isinf(alone.expected_error)


def test_implausible_densities_and_repeated_probes_are_warned_of():
    probes = ((0.0, 0.0), (0.005, 0.0), (0.0, 0.0))
    light = replace(Body().solid, density=1.0)
    scene = Scene(pressure=MovingPressure(tacton=Tacton()), body=Body(), probes=probes)
    assert len(implausible(scene)) == 1
    assert implausible(replace(scene, depth=(0.0, 0.0, 0.001))) == ()
    warned = implausible(replace(scene, body=Body(material=light)))
    assert [sentence.partition(" ")[0] for sentence in warned] == ["density_kg_m3", "points_mm"]


@pytest.mark.parametrize(
    ("section", "number"),
    [
        ("body", "thickness_mm = 0.015"), ("probes", "points_mm = 0.02"),
        ("tacton", "size_mm = 0.02"),
        ("body.material", "density_kg_m3 = 1"), ("body.material", "shear_modulus_pa = 25"),
        ("body.material", "loss_factor = 5"),
    ],
)  # fmt: skip
def test_numbers_of_another_unit_are_warned_of(section, number):
    solid = {"density_kg_m3": 1000, "shear_modulus_pa": 25e3, "poisson": 0.45}
    key, _, value = number.partition(" = ")
    table = {section: (solid if section == "body.material" else {}) | {key: float(value)}}
    if section == "probes":
        table = {"probes": {key: f"[[0, 0], [{value}, 0]]"}}
    if section == "tacton":
        table["tacton"] |= {"shape": "'circle'", "speed_m_per_s": 0.01}
    lines = (f"[{s}]\n" + "\n".join(f"{k} = {v}" for k, v in t.items()) for s, t in table.items())
    (sentence,) = implausible(loads("\n".join(lines)))
    assert sentence.startswith(f"{number} is implausible")


def test_implausible_numbers_are_warned_of_at_every_door(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = f"{AM}[body]\nkind = 'slab'\nthickness_mm = 0.015\n"
    (tmp_path / "thin.toml").write_text(text)
    for words in (
        "plan thin.toml",
        "run thin.toml",
        "live thin.toml --no-selftest",
        "sweep thin.toml --vary tacton.duration_s=0.05 --model flat-body-harmonic",
    ):
        assert main([*words.split(), "--quiet"]) == 0
        assert capsys.readouterr().err.count("thickness_mm = 0.015 is implausible") == 1, words
    assert any("0.015" in sentence for sentence in plan(loads(text)).warnings)
    with pytest.warns(skinwave.SkinwaveWarning, match="0.015 is implausible"):
        skinwave.simulate(loads(text))


def test_a_response_too_short_for_its_lines_names_a_duration_that_works():
    scene = "[tacton]\nam_frequency_hz = 140\nduration_s = {}\n[body]\nkind = 'none'"
    with pytest.warns(skinwave.SkinwaveWarning, match="too short") as caught:
        short = skinwave.simulate(loads(scene.format(0.003)))
    assert not short.lines
    (duration,) = re.findall(r"duration_s = ([\d.]+)", str(caught[0].message))
    assert skinwave.simulate(loads(scene.format(duration))).lines


def response_with(deflection, scene, model="fem"):
    times = np.arange(3) / 1e4
    motion = np.outer([0.0, -1.0, 0.5], np.ones(len(scene.probes))) * deflection
    return Response(model=model, times=times, probes=scene.probe_points, values=motion)


def test_a_sheet_is_linear_up_to_half_its_thickness():
    quiet, loud = loads(QUIET_PAPER), loads(LOUD_PAPER)
    assert large_deflection(quiet, response_with(0.049e-3, quiet)) == ()
    (sentence,) = large_deflection(quiet, response_with(1.2e-3, quiet))
    assert "12 times its thickness" in sentence
    assert "--model plate-modes-nonlinear" in sentence
    assert large_deflection(quiet, response_with(1.2e-3, quiet, "fem-nonlinear")) == ()
    assert large_deflection(loud, response_with(0.0, loud))  # its middle, without a probe, sags
    free = loads(LOUD_PAPER.replace('"clamped"', '"absorbing"'))
    assert large_deflection(free, response_with(1.2e-3, free)) == ()  # all of it moves alike
    slab = loads(SLAB)
    assert large_deflection(slab, response_with(1.0, slab)) == ()


@pytest.mark.parametrize(
    ("model", "body"),
    [
        ("point-kernel", ""), ("flat-body", ""), ("flat-body-harmonic", "thickness_mm = inf"),
        ("plate-modes", PLATE), ("plate-modes-transient", PLATE), ("plate-modes-nonlinear", PLATE),
        ("fem", SMALL_BODY), ("fem-harmonic", SMALL_BODY), ("auto", ""),
    ],
)  # fmt: skip
def test_callers_that_let_numpy_raise_get_the_same_response(model, body):
    scene = loads(f"[tacton]\nam_frequency_hz = 140\nduration_s = 0.05\n[body]\n{body}")
    with warnings.catch_warnings(), np.errstate(all="raise"):
        warnings.simplefilter("ignore", skinwave.SkinwaveWarning)
        assert skinwave.simulate(scene, model, 0.3).values.any()
