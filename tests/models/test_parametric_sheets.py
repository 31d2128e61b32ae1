"""One reduced sheet for every material and thickness of a range, against each sheet's own body."""

from dataclasses import replace

import numpy as np
import pytest

import skinwave
from fem.affine_model import line_errors
from simple_model import MovingPressure, Tacton, Trajectory
from skinwave.measure import predicted
from skinwave.measure.parameters import parse
from skinwave.models import parametric
from skinwave.models.free_keys import free_keys, values_at, with_values
from skinwave.models.reduced import answer as own_answer
from skinwave.models.reduced import components
from skinwave.models.reduced import prepare as own_body
from skinwave.scene.scene import BODIES, Scene
from skinwave.system.effort import silent

MODULUS, LOSS = "body.material.shear_modulus_pa", "body.material.loss_factor"
DENSITY, THICKNESS = "body.material.density_kg_m3", "body.thickness_mm"
RANGES = {
    MODULUS: (0.7e9, 1.4e9), LOSS: (0.02, 0.08), DENSITY: (600, 1000), THICKNESS: (0.08, 0.14),
}  # fmt: skip
H = 6e-3
SHEET = replace(BODIES["paper-sheet-loose"], width=0.06, height=0.06, air=True)
PATH = Trajectory(shape="circle", size=0.012, speed=5.0)
LOAD = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.1, trajectory=PATH))
SCENE = Scene(pressure=LOAD, body=SHEET, probes=((0.0, 0.0), (0.01, 0.004)))


@pytest.fixture(scope="module")
def prepared():
    return skinwave.prepare(SCENE, RANGES, h=H)


def random_values(keys, count, seed=1):
    shares = np.random.default_rng(seed).random((count, len(keys)))
    return [values_at(keys, each) for each in shares]


def own_lines(scene, body, frequencies):
    own = components(own_body(body, scene.probe_points, h=H), scene.pressure)
    return own.lines[[np.argmin(np.abs(own.frequencies - f)) for f in frequencies]]


def test_lines_in_air_are_those_of_each_sheets_own_reduction(prepared):
    for values in random_values(prepared.keys, 2):
        frequencies, found = parametric.lines(prepared, values)
        body = with_values(SHEET, prepared.keys, values)
        assert line_errors(found, own_lines(SCENE, body, frequencies)).max() < 0.003
        still = own_lines(SCENE, replace(body, air=False), frequencies)
        assert line_errors(found, still).max() > 0.1


def test_the_waveform_from_rest_is_that_of_the_sheets_own_body_and_balances_energy(prepared):
    (values,) = random_values(prepared.keys, 1, seed=2)
    own = own_body(with_values(SHEET, prepared.keys, values), SCENE.probe_points, h=H)
    found, expected = parametric.answer(prepared, values), own_answer(own, SCENE)
    moving = np.linalg.norm(expected.values - expected.values.mean(axis=0))
    assert np.linalg.norm(found.values - expected.values) < 1e-3 * moving
    assert found.effort.energy_imbalance < 1e-6
    free = [np.abs(each.poles.values).min() for each in (parametric.at(prepared, values), own)]
    assert free[0] == pytest.approx(free[1], rel=1e-4)


def test_a_fit_reduces_a_sheet_in_air_once(monkeypatch):
    whole = parametric.prepare
    coarse = lambda *given, **how: whole(*given, **how | {"h": 0.015})  # noqa: E731
    monkeypatch.setattr(parametric, "prepare", coarse)
    aim = predicted.target(SCENE, "fem", SCENE.reading.record, SCENE.probe_points)
    parameters = parse([f"{MODULUS}=0.9e9:1.1e9", f"{THICKNESS}=0.09:0.11"], [])
    found = predicted.with_reduction(aim, parameters, silent).reduced
    assert {key.key for key in found.keys} == {MODULUS, THICKNESS}


def test_sheets_that_one_reduction_does_not_serve_are_refused():
    narrow = replace(SHEET, width=0.03)
    with pytest.raises(ValueError, match=r"0\.3 mm"):
        free_keys(narrow, {THICKNESS: (0.2, 0.7)})
    assert free_keys(narrow, {THICKNESS: (0.2, 0.3)})
    with pytest.raises(ValueError, match="free thickness"):
        skinwave.prepare(replace(SCENE, quantity="displacement_x"), {THICKNESS: (0.1, 0.2)})
    open_edged = replace(SHEET, sides="absorbing", base="clamped")
    with pytest.raises(ValueError, match="absorbing sides"):
        skinwave.prepare(replace(SCENE, body=open_edged), {DENSITY: (700, 900)})
