"""Maps of any quantity at any depth."""

from dataclasses import replace

import numpy as np
import pytest
import read_results

from simple_model import MovingPressure, Tacton, Trajectory, phasors
from simple_model.load.spectrum import load_lines
from skinwave import Body, Scene
from skinwave.commands.cli import main
from skinwave.models.options import SolveOptions
from skinwave.planning.simulate import compute
from skinwave.results.surface import body_map, grid, quantity_map
from skinwave.scene.file import dumps

CIRCLE = Trajectory(shape="circle", size=0.012, speed=7.0)
AM = Tacton(am_frequency=140.0, trajectory=CIRCLE, duration=0.2)
LAYER = Scene(
    pressure=MovingPressure(tacton=AM, drive="pressure_squared"),
    body=Body(width=0.06, height=0.06, depth=0.008),
    probes=((0.0, 0.0), (0.006, 0.002)),
)
PLACES = {"reach": 0.012, "step": 0.003}


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


def test_the_command_writes_a_page_and_tables(tmp_path, monkeypatch, capsys):
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

    for words in ("--step 0.01", "--depth 9"):  # too many places, and below the body
        assert main(["report", "layer.toml", "--map", "-o", "out", *words.split()]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "out").exists()
