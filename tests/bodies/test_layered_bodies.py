"""Slabs in layers and on any base, as wavenumber integrals: their stack, their plan, a response."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest

from bench.layered_skin import RANGES, values_of
from simple_model import MovingPressure, Tacton, flat_body
from simple_model.layers.compliance import layered
from skinwave.bodies import BODIES
from skinwave.bodies.analytic import stack
from skinwave.planning.plan import plan
from skinwave.planning.simulate import compute
from skinwave.scene.scene import Body, Layer, Scene, solid_of
from skinwave.verify.predictions import leading_wave

LAYERS = (Layer(thickness=0.3e-3, material="epidermis"), Layer(thickness=4e-3, material="fat"))
SKIN = Scene(
    pressure=MovingPressure(tacton=Tacton(am_frequency=140, duration=0.05)),
    body=Body(material="muscle", layers=LAYERS), probes=((0.0, 0.0), (0.01, 0.0)),
)  # fmt: skip
TIMES = np.arange(500) / 1e4


def changed(**body):
    return replace(SKIN, body=replace(SKIN.body, **body))


@pytest.mark.parametrize(
    ("body", "base", "last"),
    [
        ({}, "clamped", 10.7e-3),
        ({"base": "free"}, "free", 10.7e-3),
        ({"base": "absorbing"}, "clamped", inf),
        ({"depth": inf}, "clamped", inf),
    ],
)
def test_a_slab_is_the_stack_of_its_layers(body, base, last):
    found = stack(changed(**body).body)
    assert found.materials == tuple(map(solid_of, ("epidermis", "fat", "muscle")))
    assert found.thicknesses == pytest.approx((0.3e-3, 4e-3, last))
    assert found.base == base or last == inf


@pytest.mark.parametrize("body", [{}, {"base": "absorbing"}])
def test_a_plan_takes_the_wavenumber_integral_of_layers(body):
    scene = changed(**body)
    required = plan(scene)
    assert required.model in ("flat-body", "flat-body-harmonic")
    found = compute(scene, "flat-body").displacement
    own = flat_body(layered(stack(scene.body)), scene.pressure, scene.probe_points, TIMES)
    np.testing.assert_array_equal(found, own.displacement)


@pytest.mark.parametrize(
    ("preset", "speeds", "lengths"),
    [("palm-layers", (8.5, 5.1), (40, 30)), ("forearm-layers", (3.5, 3.2), (21, 7.8))],
)
def test_wave_speeds_of_layers_agree_with_the_manual(preset, speeds, lengths):
    wave = leading_wave(BODIES[preset], [100.0, 200.0])
    assert wave.speed == pytest.approx(speeds, rel=0.03)
    assert 1e3 * wave.length == pytest.approx(lengths, rel=0.03)


@pytest.mark.parametrize("preset", RANGES)
def test_each_fitted_number_is_within_its_range(preset):
    found = values_of(BODIES[preset], RANGES[preset])
    for name, each in RANGES[preset].items():
        assert each.low <= found[name] <= each.high or found[name] == pytest.approx(each.low)
        assert each.source
