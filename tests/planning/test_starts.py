"""Starts from rest: models of the steady state leave them out, and state them."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from skinwave import SkinwaveWarning, plan, simulate
from skinwave.models import named
from skinwave.models.options import SolveOptions
from skinwave.planning.simulate import compute
from skinwave.results.comparison import compare
from skinwave.scene.file import loads

LAYER = """
[tacton]
am_frequency_hz = 140
duration_s = 0.03
[body]
thickness_mm = 10
size_x_mm = 24
size_y_mm = 24
[probes]
points_mm = [[0, 0], [5, 0]]
"""
BLOCK = LAYER.replace("= 24", "= 12").replace("= 10\n", "= 6\n").replace("5, 0", "3, 0")
CANTILEVER = """
[tacton]
am_frequency_hz = 60
duration_s = 0.05
[focus]
peak_pressure_pa = 0.1
[body]
kind = "sheet"
size_x_mm = 30
size_y_mm = 30
thickness_mm = 0.2
[body.mounting]
edges = ["front"]
[probes]
points_mm = [[0, 0], [5, 5]]
"""


def stated(scene, steady, rest, **given):
    """Stated error, relative difference from rest at the worst probe, and warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SkinwaveWarning)
        found = simulate(scene, steady, **given)
    whole = compute(scene, rest, **given).values
    left = np.linalg.norm(found.values - whole, axis=0) / np.linalg.norm(whole, axis=0)
    return found.expected_error, left.max(), found.effort.warnings


@pytest.mark.parametrize("quantity", ["displacement", "acceleration"])
def test_modes_of_a_plate_state_the_start(quantity):
    scene = loads(f'{CANTILEVER}quantity = "{quantity}"')
    error, left, said = stated(scene, "plate-modes", "plate-modes-transient")
    assert left > 0.2
    assert left <= error < 1.05 * left + 0.02
    assert any("use --model plate-modes-transient" in sentence for sentence in said)
    assert plan(scene, SolveOptions(model="plate-modes-transient")).warnings == ()


@pytest.mark.parametrize("quantity", ["acceleration", "strain_zz"])
def test_wavenumber_integrals_state_the_start_of_the_quantity(quantity):
    depth = "depth_mm = 2" if quantity == "strain_zz" else ""
    scene = loads(f'{LAYER}quantity = "{quantity}"\n{depth}')
    error, left, said = stated(scene, "flat-body-harmonic", "flat-body")
    assert left > 0.05
    assert error == pytest.approx(left, rel=0.02)
    assert any("use --model flat-body" in sentence for sentence in said)


@pytest.mark.parametrize("quantity", ["velocity", "acceleration"])
def test_wavenumber_integrals_state_a_jump_above_their_band(quantity):
    scene = loads(f'{LAYER}quantity = "{quantity}"')
    found = compute(scene, "flat-body")
    times = found.times[1] / 16 * np.arange(16 * len(found.times))
    fine = named("flat-body").solve(scene, times, SolveOptions(tolerance=1e-3))
    true = compare(replace(found, values=fine.values[::16]), found).relative_l2.max()
    assert true > (5e-3 if quantity == "acceleration" else 1e-3)
    assert true < 1.1 * plan(scene, SolveOptions(model="flat-body")).error < 5 * true


def test_elements_state_the_start_of_the_quantity():
    scene = loads(f'{BLOCK}quantity = "acceleration"')
    error, left, _ = stated(scene, "fem-harmonic", "fem", h=6e-3)
    assert left > 0.1
    of_mesh = plan(scene, SolveOptions(model="fem", h=6e-3)).error
    assert error - of_mesh == pytest.approx(left, rel=0.05)


def test_the_error_of_the_start_is_that_of_the_requested_times():
    scene = loads(LAYER.replace("0.03", "0.5"))
    whole, *parts = (
        stated(scene, "flat-body-harmonic", "flat-body", times=np.arange(*span) / 1e4)
        for span in ((5000,), (100,), (4000, 5000))
    )
    for error, left, _ in (whole, *parts):
        assert error == pytest.approx(left, rel=0.02, abs=2.1e-3)  # beside that of the integral
    assert parts[0][1] > 2 * whole[1] > 50 * parts[1][1]


def test_the_drift_of_an_unconstrained_body_is_in_its_error():
    free = "base = 'free'\nsides = {left='absorbing', right='free', front='free', back='free'}"
    scene = loads(BLOCK.replace("[probes]", f"{free}\n[probes]"))
    error, left, _ = stated(scene, "fem-harmonic", "fem", h=6e-3)
    assert 0.9 < left < 1.2
    assert left < error + 0.01 < 2.0
