"""Uncertain numbers of a scene: bands by closed forms, error budgets, pages and tables."""

from argparse import Namespace
from dataclasses import replace
from math import isnan, log, sinh, sqrt
from pathlib import Path

import numpy as np
import pytest
import read_results
from scipy import stats

from simple_model import Trajectory
from simple_model.layers.compliance import slab
from simple_model.layers.flat_body import path_operator, steady_lines
from skinwave.commands.cli import main
from skinwave.commands.common import note_scenes
from skinwave.models.options import SolveOptions
from skinwave.planning.budget import error_budget, mesh_row
from skinwave.planning.simulate import compute
from skinwave.scene.distributions import Distribution, within_factor
from skinwave.scene.file import dumps, loads
from skinwave.scene.spreads import PRESSURE, spreads_of
from skinwave.scene.variation import combinations, parse, with_values
from skinwave.sweeps.ensemble import ensemble, method_of, propagate, shared_family, solve_sample
from skinwave.sweeps.sampling import percentiles, samples

KNOWN = "{ value = 50, spread = 0 }"
NORMAL = '{ value = 50, spread = 0.2, distribution = "normal" }'
SLAB = f"""
[tacton]
am_frequency_hz = 140
duration_s = 0.05
[focus]
peak_pressure_pa = {NORMAL}
[body]
kind = "slab"
[body.material]
density_kg_m3 = 1000
shear_modulus_pa = 25e3
poisson = 0.4999
viscosity_pa_s = 5
[probes]
points_mm = [[0, 0], [10, 0]]
"""
SMALL = """
[tacton]
am_frequency_hz = 140
duration_s = 0.25
shape = "circle"
size_mm = 10
speed_m_per_s = 4.2
[body]
kind = "slab"
size_x_mm = 30
size_y_mm = 30
thickness_mm = { value = 12, low = 10, high = 14 }
sides = "clamped"
material = "palm"
[probes]
points_mm = [[0, 0], [6, 0]]
"""
SHEET = """
[tacton]
am_frequency_hz = 140
[body]
kind = "sheet"
[body.material]
density_kg_m3 = 800
shear_modulus_pa = { value = 1.5e9, spread = 0.002 }
poisson = 0.3
loss_factor = 0.05
[focus]
peak_pressure_pa = { value = 50, spread = 0 }
[probes]
points_mm = [[0, 0], [10, 0]]
"""


def test_a_scene_with_spreads_has_the_central_values():
    layer = "layers = [{ thickness_mm = { value = 2, low = 1, high = 3 }, material = 'fat' }]"
    scene = loads(SLAB.replace('kind = "slab"', f'kind = "slab"\n{layer}'))
    assert scene.pressure.peak_pressure == 50
    assert scene.body.layers[0].thickness == pytest.approx(2e-3)
    given = dict(scene.spreads)["body.layers.0.thickness_mm"]
    assert given == Distribution(shape="uniform", measure="bounds", width=(1, 3))
    assert loads(dumps(scene)) == scene
    assert loads(SLAB.replace(NORMAL, "50")).pressure == scene.pressure


def test_wrong_spreads_are_refused():
    for table in (
        "{ value = 50, spred = 0.2 }", "{ value = 50 }", "{ value = 50, low = 1, high = 3 }",
        "{ value = 50, factor = 0.5 }", "{ value = 50, factor = 2, distribution = 'normal' }",
        "{ value = 0, spread = 0.2 }", "{ value = 50, spread = nan }",
    ):  # fmt: skip
        with pytest.raises(ValueError, match="peak_pressure_pa"):
            loads(f"[focus]\npeak_pressure_pa = {table}")
    with pytest.raises(ValueError, match="thickness_mm"):
        loads('[body]\nkind = "none"\nthickness_mm = { value = 15, spread = 0.2 }')


def test_presets_and_the_device_have_spreads():
    found = {s.key: s for s in spreads_of(loads('[body]\nmaterial = "palm"'))}
    assert {s.part for s in found.values()} == {"material", "device"}
    assert found[PRESSURE].distribution == within_factor(2.0)
    assert found["body.material.modulus_scale"].implied
    assert found["body.material.loss_scale"].distribution == within_factor(3.0)
    measured = loads(f'[body]\nmaterial = "ecoflex"\n[focus]\npeak_pressure_pa = {KNOWN}')
    assert spreads_of(measured) == ()
    with pytest.raises(ValueError, match="uncertain"):
        propagate(measured, 8)


def test_with_values_changes_numbers_by_key():
    scene = loads('[body]\nmaterial = "palm"\n[[body.layers]]\nthickness_mm = 1\nmaterial = "fat"')
    scales = {"body.layers.0.material.loss_scale": 3.0, "body.material.modulus_scale": 2.0}
    found = with_values(scene, {"body.thickness_mm": 12.0, PRESSURE: 70.0} | scales)
    assert (found.body.depth, found.pressure.peak_pressure) == (pytest.approx(0.012), 70)
    palm = scene.body.solid.complex_modulus(900.0)
    assert found.body.solid.complex_modulus(900.0) == pytest.approx(2 * palm)
    (_, before), (_, after) = scene.body.strata[0], found.body.strata[0]
    assert after.viscosity == pytest.approx(3 * before.viscosity)
    with pytest.raises(ValueError, match="depth"):
        with_values(scene, {"body.depth": 1.0})


def test_bands_of_a_linear_case_are_the_closed_form():
    """Motion is in proportion to the pressure, so that its percentiles are those of a normal."""
    scene, n = loads(SLAB), 400
    found = propagate(scene, n)
    one = solve_sample(scene, found.method)
    factors = 1 + 0.2 * stats.norm.ppf([0.05, 0.25, 0.5, 0.75, 0.95])
    # A stratified sample's quantile is within two strata, 2 / n, of the share asked for.
    slack = 0.2 * (stats.norm.ppf(0.95 + 2 / n) - stats.norm.ppf(0.95))
    both = np.repeat(factors[:, None], 2, axis=1)
    assert percentiles(found.rms) / one.rms == pytest.approx(both, abs=slack)
    high = np.full(one.map_rms.shape, factors[4])
    assert percentiles(found.map_rms)[4] / one.map_rms == pytest.approx(high, abs=slack)
    raised = 20 * np.log10(factors)
    assert percentiles(found.level)[:, 0] - one.level[0] == pytest.approx(raised, abs=0.1)
    largest = np.argmax(one.waveform[:, 0])
    expected = factors * one.waveform[largest, 0]
    assert percentiles(found.waveform)[:, largest, 0] == pytest.approx(expected, rel=0.01)


def test_bands_of_a_stiff_half_space_fall_as_its_modulus():
    """Far below its waves u goes as 1 / mu: a lognormal again, of the inverse median."""
    text = SLAB.replace("140", "5").replace("25e3", "{ value = 1e9, spread = 0.3 }")
    text = text.replace("viscosity_pa_s = 5", "loss_factor = 0.1").replace("0.05", "0.2")
    text = text.replace('kind = "slab"', 'kind = "slab"\nthickness_mm = inf')
    scene = loads(text.replace(NORMAL, KNOWN))
    spreads = spreads_of(scene)
    method = replace(method_of(scene, SolveOptions(model="flat-body-harmonic")), mapped=False)
    found = ensemble(scene, spreads, samples(spreads, 32), method)
    s = sqrt(log(1.09))
    bands = percentiles(found.rms)[1:4, 0] / solve_sample(scene, method).rms[0]
    assert bands == pytest.approx(stats.lognorm(s).ppf([0.25, 0.5, 0.75]), rel=0.05)
    assert error_budget(scene).material == pytest.approx(sinh(s), rel=1e-3)
    assert error_budget(scene).device == 0


def test_the_operator_of_a_path_gives_the_lines_of_the_wavenumber_integral():
    scene = loads(SLAB)
    path = Trajectory(shape="square", size=0.02, speed=4.0)
    pressure = replace(scene.pressure, tacton=replace(scene.tacton, trajectory=path))
    places = np.random.default_rng(1).uniform(-0.03, 0.03, (60, 2))
    body = slab(scene.body.solid, 0.015)
    f, expected = steady_lines(body, pressure, places, threshold=1e-3)
    g, found = path_operator(pressure, places, threshold=1e-3)(body)
    assert g == pytest.approx(f)
    assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()


def test_a_model_without_an_exact_map_gives_probes_alone():
    scene = loads(SLAB.replace('kind = "slab"', 'kind = "none"').split("[body.material]")[0])
    method = method_of(scene, SolveOptions(model="point-kernel"))
    found = ensemble(scene, spreads_of(scene), np.array([[50.0], [100.0]]), method)
    assert not found.has_map
    assert found.rms[1] == pytest.approx(2 * found.rms[0])
    assert found.lines[0, :, 0].max() == pytest.approx(25, rel=1e-3)  # half of 50 Pa, at f_AM


def test_samples_of_bodies_reduced_together_agree_with_separate_bodies():
    scene = loads(SMALL)
    found = propagate(scene, 72, model="fem", h=0.01)
    keys = [s.key for s in found.spreads]
    assert keys == ["body.thickness_mm", PRESSURE, *(f"body.material.{x}_scale" for x in (
        "modulus", "loss"))]  # fmt: skip
    family = found.method.family
    assert family
    beyond = np.array([14.0, *found.values[0, 1:]])  # of a uniform distribution from 10 to 14
    assert not family.has(dict(zip(keys, beyond, strict=True)))
    for k, row in enumerate([*found.values[[0, 7]], beyond]):
        one = with_values(scene, dict(zip(keys, row.tolist(), strict=True)))
        own = solve_sample(one, found.method, together=False)
        mine = ensemble(scene, found.spreads, row[None], found.method).lines[0]
        assert np.abs(mine - own.lines).max() < 1e-3 * own.lines.max()
        if k == 0:
            np.testing.assert_allclose(mine, found.lines[0], rtol=1e-9)
            from_rest = solve_sample(one, replace(found.method, family=None))
            assert from_rest.rms == pytest.approx(own.rms, rel=0.05)
    few = loads(SMALL.replace("clamped", "absorbing"))
    method, spreads = method_of(few, SolveOptions(model="fem", h=0.01)), spreads_of(few)
    assert shared_family(few, spreads, samples(spreads, 4), method) is None


def test_an_impossible_sample_is_named():
    scene = loads(SLAB.replace("0.4999", "{ value = 0.4999, spread = 0.2 }"))
    with pytest.raises(ValueError, match=r"poisson = 0\."):
        propagate(scene, 8)


def test_the_budget_of_the_pressure_is_its_closed_form():
    found = error_budget(replace(loads(SLAB), spreads=()), 0.02)
    assert found.device == pytest.approx(sinh(log(2) / stats.norm.ppf(0.95)), rel=1e-6)
    assert found.numerical == 0.02


def test_the_budget_of_the_material_agrees_with_samples():
    text = SLAB.replace("25e3", "{ value = 25e3, spread = 0.03 }").replace(NORMAL, KNOWN)
    found = propagate(loads(text), 64)
    centre = solve_sample(found.scene, found.method).waveform
    away = np.sqrt(((found.waveform - centre) ** 2).mean(axis=0).sum(axis=0))
    expected = (away / np.linalg.norm(centre, axis=0)).max()
    assert error_budget(found.scene).material == pytest.approx(expected, rel=0.1)


def test_the_budget_of_a_sheet_agrees_with_samples():
    scene = loads(SHEET)
    (spread,) = (each for each in spreads_of(scene) if each.part == "material")

    def moving(values):
        found = compute(with_values(scene, values), "plate-modes").values
        return found - found.mean(axis=0)

    centre = moving({})
    each = [moving({spread.key: float(x)}) for (x,) in samples((spread,), 16)]
    away = np.sqrt(np.mean([np.square(x - centre).sum(axis=0) for x in each], axis=0))
    expected = (away / np.linalg.norm(centre, axis=0)).max()
    assert error_budget(scene).material == pytest.approx(expected, rel=0.1)
    curled = loads('[body]\nkind = "sheet"\n[body.mounting]\ncurl_x_mm = 1')
    assert isnan(error_budget(curled).material)
    assert "not computed (the sheet" in mesh_row(curled, None, 0.1).value


def test_a_finer_mesh_than_a_tenth_of_the_material_gains_nothing():
    palm = loads(SLAB.split("[body]")[0] + '[body]\nmaterial = "palm"')
    row = mesh_row(palm, 3e-3, 0.02)
    assert 0.3 < error_budget(palm).material < 3
    assert 3 < float(row.reason.rpartition("elements of ")[2].split()[0]) <= 15


def test_a_sweep_by_distributions_has_percentiles_and_indices(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("kernel.toml").write_text(SLAB.split("[focus]")[0] + '[body]\nkind = "none"\n')
    vary = ["focus.peak_pressure_pa=uniform(30,70)", "focus.height_mm=uniform(195,205)"]
    words = ["sweep", "kernel.toml", "--design", "sobol", "--samples", "8", "--quiet"]
    words += ["--vary", *vary, "--scheduler", "threads", "--out", "swept"]
    assert main(words) == 0
    found = read_results.rows("swept/indices.csv")
    rows = {row["key"]: float(row["total"]) for row in found if row["column"] == "kernel_rms_pa"}
    met = combinations([parse(text) for text in vary], "sobol", 8)
    pressures = np.array([run["focus.peak_pressure_pa"] for run in met])
    a, b, mixed, _ = np.split(pressures, 4)
    total = ((a - mixed) ** 2).mean() / 2 / np.concatenate([a, b]).var()  # Saltelli, eq. f
    assert rows["focus.peak_pressure_pa"] == pytest.approx(total, rel=0.05)
    assert rows["focus.height_mm"] < 0.02
    Path("swept/indices.csv").write_text("mine")
    assert main(words) == 2


def test_a_run_with_samples_writes_bands(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("slab.toml").write_text(SLAB)
    words = ["run", "slab.toml", "--model", "flat-body-harmonic", "--out", "out", "--quiet"]
    assert main([*words, "--samples", "16"]) == 0
    rms = [row for row in read_results.rows("out/percentiles.csv") if row["column"] == "rms_um"]
    assert len(rms) == 2
    assert float(rms[0]["p5"]) < float(rms[0]["p50"]) < float(rms[0]["p95"])
    found = read_results.rows("out/samples.csv")
    ratios = [float(r["rms_um[0]"]) / float(r[PRESSURE]) for r in found]
    assert len(found) == 16
    assert max(ratios) == pytest.approx(min(ratios), rel=1e-6)
    drawn = {path.name for path in Path("out/pictures").iterdir()}
    assert {"bands.png", "bands-map.png", "tornado.png"} <= drawn
    assert main(["run", "slab.toml", "--samples", "1", "--out", "other"]) == 2
    assert "from 2 to 100,000" in capsys.readouterr().err
    assert not Path("other").exists()


def test_commands_without_samples_note_the_central_values_once(tmp_path, capsys):
    path = tmp_path / "slab.toml"
    path.write_text(SLAB)
    asked = Namespace(scene=path, command_name="compare", samples=None)
    note_scenes(asked)
    assert capsys.readouterr().err.count("focus.peak_pressure_pa") == 1
    note_scenes(Namespace(scene=path, command_name="run", samples=8))
    path.write_text(SLAB.replace(NORMAL, "50"))
    note_scenes(asked)
    assert capsys.readouterr().err == ""
