"""Kinds of body and models are records in registries: a file from outside adds one."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import read_results

import skinwave
from skinwave import models
from skinwave.bodies import BODIES, KINDS, BodyKind, register
from skinwave.commands.cli import main
from skinwave.models import Model, named, names
from skinwave.models import register as register_model
from skinwave.scene.file import dumps, loads
from skinwave.sweeps import dataset
from skinwave.system import extensions

ROOT = Path(__file__).parents[2]
SCENE = """
name = "disc"
[tacton]
am_frequency_hz = 100
duration_s = 0.05
shape = "circle"
size_mm = 20
speed_m_per_s = 4
[body]
kind = "cylinder"
[probes]
points_mm = [[0, 0], [10, 0], [25, 0]]
"""
MESH = ["--element-size", "8", "--quiet"]


@pytest.fixture(scope="module", autouse=True)
def static_deflection():
    """The modules from outside; what they register is gone afterwards, for all other tests."""
    import_module("cylinder")
    yield import_module("static_deflection")
    del KINDS["cylinder"], BODIES["silicone-cylinder"], models.MODELS.records["static-deflection"]
    os.environ.pop(extensions.VARIABLE)
    for name in ("cylinder", "static_deflection"):
        del sys.modules[name]


@pytest.fixture
def disc(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("disc.toml").write_text(SCENE)
    return loads(SCENE)


def test_a_scene_of_a_new_kind_is_read_and_written(disc):
    assert disc.body == BODIES["silicone-cylinder"]
    assert (disc.body.width, disc.body.depth) == (0.08, 0.02)
    assert loads(dumps(disc)) == disc
    with pytest.raises(ValueError, match="one diameter"):
        loads(SCENE.replace('kind = "cylinder"', 'kind = "cylinder"\nsize_x_mm = 60'))
    with pytest.raises(ValueError, match='relief is for kind = "palm", not "cylinder"'):
        loads(SCENE.replace('kind = "cylinder"', 'kind = "cylinder"\nrelief = {}'))


def test_a_soft_cylinder_deflects_as_its_slab_in_the_middle(disc):
    still = replace(disc.tacton, am_frequency=30.0, trajectory=type(disc.tacton.trajectory)())
    scene = replace(disc, pressure=replace(disc.pressure, tacton=still), probes=((0.0, 0.0),))
    own = skinwave.simulate(scene, "fem", 0.5, h=5e-3).displacement
    slab = replace(scene, body=replace(scene.body, kind="slab", sides="free"))
    other = skinwave.simulate(slab, "fem", 0.5, h=5e-3).displacement
    assert np.abs(own - other).max() < 0.05 * np.abs(other).max()


def test_a_new_kind_runs(disc):
    assert main(["run", "disc.toml", "--model", "fem", *MESH, "--out", "out"]) == 0
    rows = read_results.rows("out/lines.csv")
    assert {row["body"] for row in rows} == {"silicone-cylinder"}
    assert main(["plan", "disc.toml", "--tolerance", "0.5", "--element-size", "8"]) == 0


@pytest.mark.slow
def test_a_new_kind_is_compared_and_swept_in_other_processes(disc):
    assert main(["compare", "disc.toml", *MESH, "--out", "compared"]) == 0
    rows = read_results.rows("compared/lines.csv")
    assert {row["body"] for row in rows} == {"none", "silicone-cylinder"}
    vary = ["--vary", "tacton.am_frequency_hz=80,120", "--model", "fem", "--out", "swept"]
    assert main(["sweep", "disc.toml", *vary, "--workers", "2", *MESH, "--json"]) == 0


def test_a_new_model_runs(disc, capsys, static_deflection):
    said = "static-deflection, which does not estimate its error: not known"
    with pytest.warns(skinwave.SkinwaveWarning, match=said):
        found = skinwave.simulate(disc, "static-deflection")
    assert found.model == "static-deflection"
    pressure = disc.pressure(disc.probe_points, found.times[7])
    expected = static_deflection.per_pressure(disc.body) * pressure
    assert found.displacement[7] == pytest.approx(expected)
    assert np.isinf(found.expected_error)
    words = ["run", "disc.toml", "--model", "static-deflection", "--out", "out", "--quiet"]
    assert main(words) == 0
    assert {row["model"] for row in read_results.rows("out/lines.csv")} == {"static-deflection"}
    assert said in capsys.readouterr().err
    assert main(["plan", "disc.toml", "--model", "static-deflection"]) == 0
    assert said in capsys.readouterr().err
    assert main(["sweep", "disc.toml", "--vary", "tacton.am_frequency_hz=80,120", *words[2:4],
                 "--out", "swept", "--quiet", "--scheduler", "threads"]) == 0  # fmt: skip
    assert all(said in row["warnings"] for row in dataset.read(Path("swept")))


def test_a_new_model_refuses_a_body(disc):
    floating = replace(disc, body=replace(disc.body, base="free", sides="clamped"))
    with pytest.raises(ValueError, match="with a clamped base, not a free one; set base"):
        skinwave.simulate(floating, "static-deflection")


def test_duplicate_names_are_refused(static_deflection):
    with pytest.raises(ValueError, match="'slab' is registered already"):
        register(BodyKind(name="slab"))
    with pytest.raises(ValueError, match="'fem' is registered already"):
        register_model(Model(name="fem", method="", words="", solve=static_deflection.solve))
    assert list(KINDS)[:5] == ["none", "sheet", "slab", "palm", "mesh"]
    assert set(names()) > {"fem", "static-deflection"}
    with pytest.raises(ValueError, match="model"):
        named("nothing")


def test_a_module_of_the_environment_is_loaded_by_the_command_line(tmp_path):
    (tmp_path / "disc.toml").write_text(SCENE)
    env = os.environ | {
        "SKINWAVE_EXTENSIONS": "cylinder,static_deflection",
        "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests")]),
    }
    command = [sys.executable, "-m", "skinwave", "plan", str(tmp_path / "disc.toml"), "--json"]
    said = subprocess.run([*command, "--model", "static-deflection"], env=env, check=True,
                          capture_output=True, text=True).stdout  # fmt: skip
    assert json.loads(said)["model"] == "static-deflection"
    env["SKINWAVE_EXTENSIONS"] = "no_such_module"
    found = subprocess.run(command, env=env, check=False, capture_output=True, text=True)
    assert found.returncode == 2
    assert "'no_such_module' in SKINWAVE_EXTENSIONS" in found.stderr
