"""One scene gives the same numbers by every door, and models agree within their stated errors."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

import skinwave
from bench.agreement import Outcome, Pair, outcome, random_scene
from simple_model import MovingPressure, Tacton, Trajectory
from skinwave.commands.cli import main
from skinwave.models import named
from skinwave.models.options import SolveOptions
from skinwave.models.parametric import answer
from skinwave.planning.plan import cheapest_model, model_from_rest
from skinwave.planning.simulate import compute
from skinwave.scene.file import dumps, loads
from skinwave.scene.scene import Body, Scene
from skinwave.sweeps.reductions import model_of
from skinwave.system.templates import typeset

PATH = Trajectory(shape="circle", size=0.008, speed=5.0)
SCENE = Scene(
    pressure=MovingPressure(tacton=Tacton(am_frequency=140, duration=0.05, trajectory=PATH)),
    body=Body(width=0.016, height=0.016, depth=0.005, sides="clamped"),
    probes=((0.0, 0.0), (0.004, 0.0)),
)
SIZE = 2e-3  # metre
AM = "tacton.am_frequency_hz"
MODULUS = "body.material.shear_modulus_pa"
SEED = 4711
# Of the first hundred: slabs and sheets of each kind of support and quantity that take seconds.
NUMBERS = 2, 9, 14, 17, 25, 30, 46, 65, 76, 92, 97
# The slow checks, every line or step a solution of its own, are left to `bench.agreement`.
MODELS = (
    "flat-body", "flat-body-harmonic", "fem", "plate-modes", "plate-modes-transient",
    "plate-modes-nonlinear", "fem-nonlinear",
)  # fmt: skip


@pytest.fixture(scope="module")
def simulated():
    return skinwave.simulate(SCENE, "fem", h=SIZE)


def test_a_sweep_of_one_scene_is_its_simulation(simulated):
    table = skinwave.sweep(SCENE, {AM: [140.0]}, model="fem", h=SIZE, workers=1)
    (row,) = table.rows
    peaks = 1e6 * np.abs(simulated.values).max(axis=0)
    np.testing.assert_allclose(row["peak_um"], peaks, rtol=1e-6)
    assert row["expected_error"] == pytest.approx(simulated.expected_error, rel=1e-6)
    errors = simulated.effort.errors
    assert (row["error_parts"], row["error_cure"]) == (errors.words, errors.cure)


@pytest.mark.parametrize("body", ["kind = 'sheet'", "sides = 'clamped'", "kind = 'palm'", ""])
def test_plan_sweep_and_fit_choose_one_model(body):
    """A fit and a sweep start from rest; a plan may leave out the start."""
    scene = loads(f"[tacton]\nam_frequency_hz = 140\nduration_s = 0.05\n[body]\n{body}")
    planned = named(cheapest_model(scene))
    assert model_of(scene, SolveOptions()) == (planned.from_rest or planned.name)
    assert model_from_rest(scene)[0].name == (planned.from_rest or planned.name)


def test_a_sheet_that_stretches_stretches_in_a_sweep():
    """A linear sheet would deflect six times as much."""
    scene = loads("[tacton]\nam_frequency_hz = 140\nduration_s = 0.03\n[body]\nkind = 'sheet'")
    (row,) = skinwave.sweep(scene, {AM: [140.0]}, workers=1).rows
    stretched = compute(scene, "plate-modes-nonlinear").values
    settled = stretched[len(stretched) // 4 :]
    np.testing.assert_allclose(row["peak_um"], 1e6 * np.abs(settled).max(axis=0), rtol=0.05)
    assert row["expected_error"] < 0.05


def test_a_body_with_a_free_modulus_is_that_of_its_own_value():
    own = compute(SCENE, "fem", tolerance=1e-4, h=SIZE)
    body = skinwave.prepare(SCENE, {MODULUS: (1e4, 5e4)}, tolerance=1e-6, h=SIZE)
    found = answer(body, {MODULUS: SCENE.body.solid.shear_modulus})
    np.testing.assert_allclose(found.values, own.values, atol=2e-6 * np.abs(own.values).max())


def test_commands_write_what_python_returns(simulated, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("scene.toml").write_text(dumps(SCENE))
    size = ["--element-size", "2", "--quiet"]
    assert main(["run", "scene.toml", "--model", "fem", *size, "--out", "run"]) == 0
    with np.load("run/responses.npz") as arrays:
        largest = np.abs(simulated.values).max()
        np.testing.assert_allclose(arrays["fem"], simulated.values, atol=1e-6 * largest)
    record = json.loads(Path("run/record.json").read_text())
    assert record["expected_error"] == pytest.approx(simulated.expected_error, rel=1e-6)
    capsys.readouterr()
    assert main(["plan", "scene.toml", "--model", "fem", *size, "--json"]) == 0
    statement = simulated.effort.errors
    for written in (record, json.loads(capsys.readouterr().out)):
        parts = {part["name"]: part["error"] for part in written["errors"]}
        known = {part.name: part.error for part in statement.parts}
        assert parts == pytest.approx(known, rel=1e-6)
        assert math.hypot(*parts.values()) == pytest.approx(written["expected_error"], rel=1e-12)
    page = Path("run/index.html").read_text()
    assert all(words in page for words in (typeset(statement.words), typeset(statement.cure)))


@pytest.mark.parametrize("number", NUMBERS)
def test_models_agree_within_their_stated_errors(number):
    found = outcome(number, random_scene(number, SEED), MODELS, slowest=math.inf)
    assert not found.faults
    assert not found.disagreements, found.scene


def test_a_difference_above_the_stated_errors_is_reported():
    """A difference of 3 % between responses with a stated error of 1 % each."""
    found = Outcome(0, {})
    found.pairs = [Pair(("a", "b"), 0.03, (0.01, 0.01)), Pair(("a", "c"), 0.02, (0.01, 0.01))]
    assert [pair.models for pair in found.disagreements] == [("a", "b")]
