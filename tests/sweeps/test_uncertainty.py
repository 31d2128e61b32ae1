"""Uncertain numbers: distributions, their bands and indices by closed forms, and error budgets."""

import csv
from argparse import Namespace
from dataclasses import replace
from math import isnan, log, pi, sinh, sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from simple_model import Trajectory
from simple_model.layers.compliance import slab
from simple_model.layers.flat_body import path_operator, steady_lines
from skinwave.commands.cli import main
from skinwave.commands.common import note_central_values
from skinwave.planning.budget import error_budget, mesh_row
from skinwave.planning.simulate import compute
from skinwave.scene.distributions import Distribution, called, known_to
from skinwave.scene.file import dumps, loads
from skinwave.scene.spreads import PRESSURE, Spread, spreads_of, with_values
from skinwave.scene.variation import combinations, parse
from skinwave.sweeps import of_sweep
from skinwave.sweeps.indices import indices_of, tornado
from skinwave.sweeps.propagate import (
    Ensemble,
    ensemble,
    method_of,
    outputs,
    percentiles,
    propagate,
)
from skinwave.sweeps.sampling import samples
from skinwave.sweeps.shared_body import has, shared_body
from skinwave.sweeps.solutions import solve

SHARES = np.array([1e-6, 0.05, 0.3, 0.5, 0.77, 0.95, 1 - 1e-6])
SLAB = """
[tacton]
am_frequency_hz = 140
duration_s = 0.05
[focus]
peak_pressure_pa = { value = 50, spread = 0.2, distribution = "normal" }
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


def bounds(shape, low, high):
    return Distribution(shape=shape, measure="bounds", width=(low, high))


@pytest.mark.parametrize(
    ("given", "value", "frozen"),
    [
        (Distribution(width=(0.3,)), 7.0, stats.lognorm(sqrt(log(1.09)), scale=7)),
        (known_to(2.0), 50.0, stats.lognorm(log(2) / stats.norm.ppf(0.95), scale=50)),
        (Distribution(shape="normal", width=(0.3,)), -4.0, stats.norm(-4, 1.2)),
        (Distribution(shape="normal", measure="standard_error", width=(2.0,)), 0.0,
         stats.norm(0, 2)),
        (Distribution(measure="standard_error", width=(2.1,)), 7.0,
         stats.lognorm(sqrt(log(1.09)), scale=7)),
        (bounds("uniform", 1, 5), 2.0, stats.uniform(1, 4)),
        (bounds("triangular", 1, 5), 2.0, stats.triang(0.25, 1, 4)),
    ],
)  # fmt: skip
def test_quantiles_are_those_of_scipy(given, value, frozen):
    assert given.quantile(value, SHARES) == pytest.approx(frozen.ppf(SHARES), rel=1e-9)


def test_spread_is_the_coefficient_of_variation_and_a_factor_is_of_nine_in_ten():
    lognormal = stats.lognorm(sqrt(log(1.09)), scale=7)
    assert lognormal.std() / lognormal.mean() == pytest.approx(0.3)
    assert known_to(2.0).quantile(50.0, [0.05, 0.95]) == pytest.approx([25, 100])


def test_a_scene_with_spreads_is_complete_and_takes_the_central_values():
    text = SLAB.replace('kind = "slab"', 'kind = "slab"\nlayers = [{ thickness_mm = '
                        '{ value = 2, low = 1, high = 3 }, material = "fat" }]')  # fmt: skip
    scene = loads(text)
    assert scene.pressure.peak_pressure == 50
    assert scene.body.layers[0].thickness == pytest.approx(2e-3)
    assert dict(scene.spreads)["body.layers.0.thickness_mm"] == bounds("uniform", 1, 3)
    assert loads(dumps(scene)) == scene
    assert hash(scene) != hash(replace(scene, spreads=()))
    plain = loads(text.replace('{ value = 50, spread = 0.2, distribution = "normal" }', "50"))
    assert plain.pressure == scene.pressure


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("{ value = 50, spred = 0.2 }", "unknown key 'spred'; did you mean 'spread'"),
        ("{ value = 50 }", "needs one of spread, factor, standard_error, or low and high"),
        ("{ value = 50, spread = 0.2, factor = 2 }", "needs one of"),
        ("{ value = 50, low = 1, high = 3 }", "outside low = 1 .. high = 3"),
        ("{ value = 50, spread = -1 }", "below 0"),
        ("{ value = 50, factor = 0.5 }", "below 1"),
        (
            "{ value = 50, factor = 2, distribution = 'normal' }",
            "normal distribution has no factor",
        ),
        ("{ value = 0, spread = 0.2 }", "give standard_error"),
        ("{ value = 'a', spread = 0.2 }", "must be a number"),
        ("{ value = 50, spread = nan }", "must be finite"),
    ],
)
def test_a_wrong_spread_is_refused_with_its_cure(table, said):
    with pytest.raises(ValueError, match=said):
        loads(f"[focus]\npeak_pressure_pa = {table}")


def test_a_spread_of_what_is_no_number_of_the_scene_is_refused():
    with pytest.raises(ValueError, match="has a spread, but this scene has no such number"):
        loads('[body]\nkind = "none"\nthickness_mm = { value = 15, spread = 0.2 }')


def test_presets_and_the_device_carry_the_spread_of_their_sources():
    scene = loads('[body]\nmaterial = "palm"')
    found = {s.key: s for s in spreads_of(scene)}
    assert {s.part for s in found.values()} == {"material", "device"}
    assert found[PRESSURE].distribution == known_to(2.0)
    assert found["body.material.modulus_scale"].implied
    assert found["body.material.loss_scale"].distribution == known_to(3.0)
    measured = loads('[body]\nmaterial = "ecoflex"\n[focus]\n'
                     "peak_pressure_pa = { value = 40, spread = 0 }")  # fmt: skip
    assert spreads_of(measured) == ()
    with pytest.raises(ValueError, match="nothing in this scene is uncertain"):
        propagate(measured, 8)


def test_numbers_of_a_scene_are_changed_by_key():
    scene = loads('[body]\nmaterial = "palm"\n[[body.layers]]\nthickness_mm = 1\nmaterial = "fat"')
    found = with_values(
        scene,
        {"body.thickness_mm": 12.0, PRESSURE: 70.0, "body.layers.0.material.loss_scale": 3.0,
         "body.material.modulus_scale": 2.0},
    )  # fmt: skip
    assert (found.body.depth, found.pressure.peak_pressure) == (pytest.approx(0.012), 70)
    palm = scene.body.solid.complex_modulus(900.0)
    assert found.body.solid.complex_modulus(900.0) == pytest.approx(2 * palm)
    (_, before), (_, after) = scene.body.strata[0], found.body.strata[0]
    assert after.viscosity == pytest.approx(3 * before.viscosity)
    assert after.shear_modulus == before.shear_modulus
    with pytest.raises(ValueError, match="no number body.depth"):
        with_values(scene, {"body.depth": 1.0})


def test_bands_of_a_linear_case_are_the_closed_form():
    """Motion is in proportion to the pressure, so that its percentiles are those of a normal."""
    scene, n = loads(SLAB), 400
    found = propagate(scene, n)
    one = solve(scene, found.method)
    factors = 1 + 0.2 * stats.norm.ppf([0.05, 0.25, 0.5, 0.75, 0.95])
    # A stratified sample's quantile is within two strata, 2 / n, of the share asked for.
    slack = 0.2 * (stats.norm.ppf(0.95 + 2 / n) - stats.norm.ppf(0.95))
    assert percentiles(found.rms) / one.rms == pytest.approx(
        np.repeat(factors[:, None], 2, axis=1), abs=slack
    )
    assert percentiles(found.map_rms)[4] / one.map_rms == pytest.approx(
        np.full(one.map_rms.shape, factors[4]), abs=slack
    )
    raised = 20 * np.log10(factors)
    assert percentiles(found.level)[:, 0] - one.level[0] == pytest.approx(raised, abs=0.1)
    largest = np.argmax(one.waveform[:, 0])
    assert percentiles(found.waveform)[:, largest, 0] == pytest.approx(
        factors * one.waveform[largest, 0], rel=0.01
    )
    assert "RMS at (0, 0) mm, µm" in outputs(found)


def test_bands_of_a_stiff_half_space_fall_as_its_modulus():
    """Far below its waves u goes as 1 / mu: a lognormal again, of the inverse median."""
    scene = loads(
        SLAB.replace("140", "5").replace("25e3", "{ value = 1e9, spread = 0.3 }")
        .replace("viscosity_pa_s = 5", "loss_factor = 0.1").replace("0.05", "0.2")
        .replace('kind = "slab"', 'kind = "slab"\nthickness_mm = inf')
        .replace('{ value = 50, spread = 0.2, distribution = "normal" }',
                 "{ value = 50, spread = 0 }")
    )  # fmt: skip
    spreads = spreads_of(scene)
    method = replace(method_of(scene, "flat-body-harmonic"), mapped=False)
    found = ensemble(scene, spreads, samples(spreads, 64), method)
    expected = stats.lognorm(sqrt(log(1.09))).ppf([0.25, 0.5, 0.75])
    bands = percentiles(found.rms)[1:4, 0] / solve(scene, method).rms[0]
    assert bands == pytest.approx(expected, rel=0.03)
    s = sqrt(log(1.09))
    assert error_budget(scene).material == pytest.approx(sinh(s), rel=1e-3)
    assert error_budget(scene).device == 0


def test_the_operator_of_a_path_gives_the_lines_of_the_wavenumber_integral():
    scene = loads(SLAB)
    path = Trajectory(shape="square", size=0.02, speed=4.0)
    pressure = replace(scene.pressure, tacton=replace(scene.tacton, trajectory=path))
    places = np.random.default_rng(1).uniform(-0.03, 0.03, (60, 2))
    body = slab(scene.body.solid, 0.015)
    f, expected = steady_lines(body, pressure, places, threshold=1e-3)
    g, found = path_operator(pressure, places, threshold=1e-3).steady_lines(body)
    assert g == pytest.approx(f)
    assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()
    with pytest.raises(ValueError, match="need a Gaussian focus"):
        path_operator(replace(pressure, profile="main_lobe"), places)


def test_a_model_without_an_exact_map_gives_probes_alone():
    scene = loads(SLAB.replace('kind = "slab"', 'kind = "none"').split("[body.material]")[0])
    method = method_of(scene, "point-kernel")
    spreads = spreads_of(scene)
    found = ensemble(scene, spreads, np.array([[50.0], [100.0]]), method)
    assert isinstance(found, Ensemble)
    assert not found.has_map
    assert found.rms[1] == pytest.approx(2 * found.rms[0])
    assert found.lines[0, :, 0].max() == pytest.approx(25, rel=1e-3)  # half of 50 Pa, at f_AM


def test_samples_of_a_body_that_is_reduced_once_are_those_of_bodies_of_their_own():
    scene = loads(SMALL)
    found = propagate(scene, 80, model="fem", h=0.01)
    assert [s.key for s in found.spreads] == [
        "body.thickness_mm", PRESSURE, "body.material.modulus_scale", "body.material.loss_scale",
    ]  # fmt: skip
    assert found.method.family
    alone = replace(found.method, family=None, steady=False)
    keys = [s.key for s in found.spreads]
    for k in (0, 7, 13):
        own = solve(
            with_values(scene, dict(zip(keys, found.values[k].tolist(), strict=True))), alone
        )
        assert np.abs(found.lines[k] - own.lines).max() < 1e-3 * own.lines.max()
        apart = np.abs(found.waveform[k] - own.waveform).max() / np.abs(own.waveform).max()
        assert apart < 0.02  # of which the end of the free vibration
    outermost = np.array([[14.0, *found.values[0, 1:]]])  # of a uniform distribution from 10 to 14
    assert not has(found.method.family, dict(zip(keys, outermost[0].tolist(), strict=True)))
    beyond, own = (ensemble(scene, found.spreads, outermost, m) for m in (found.method, alone))
    assert np.abs(beyond.lines - own.lines).max() < 1e-3 * own.lines.max()


def test_samples_beyond_a_shared_range_are_in_the_steady_state_too():
    path = 'duration_s = 0.05\nshape = "circle"\nsize_mm = 10\nspeed_m_per_s = 4.2'
    scene = loads(SMALL.replace("duration_s = 0.25", path))
    found = propagate(scene, 80, model="fem", h=0.01)
    inside = found.values[:1]
    together, alone, from_rest = (
        ensemble(scene, found.spreads, inside, method).rms
        for method in (
            found.method,
            replace(found.method, family=None),
            replace(found.method, family=None, steady=False),
        )
    )
    assert together == pytest.approx(alone, rel=1e-3)
    assert np.abs(from_rest / alone - 1).max() > 0.01


def test_few_samples_and_other_numbers_than_materials_have_bodies_of_their_own():
    scene = loads(SMALL.replace("clamped", "absorbing"))
    values = samples(spreads_of(scene), 4)
    assert shared_body(scene, spreads_of(scene), values, method_of(scene, "fem", h=0.01)) is None


def test_a_sample_that_makes_no_scene_is_named():
    scene = loads(SLAB.replace("0.4999", "{ value = 0.4999, spread = 0.2 }"))
    with pytest.raises(ValueError, match=r"a sample with .*poisson = 0\..*narrow its distribution"):
        propagate(scene, 8)


def numbers(count, low, high):
    given = bounds("uniform", low, high)
    return [Spread(key=f"x{k}", value=(low + high) / 2, distribution=given) for k in range(count)]


def test_indices_of_the_ishigami_function():
    """Ishigami and Homma (1990); closed form in Saltelli et al., Global Sensitivity Analysis."""
    a, b = 7.0, 0.1

    def ishigami(x):
        return {"y": np.sin(x[:, 0]) * (1 + b * x[:, 2] ** 4) + a * np.sin(x[:, 1]) ** 2}

    found = indices_of(ishigami, numbers(3, -pi, pi), 4096)["y"]
    first, second = (1 + b * pi**4 / 5) ** 2 / 2, a**2 / 8
    both = b**2 * pi**8 * (1 / 18 - 1 / 50)
    variance = first + second + both
    assert found.first * variance == pytest.approx([first, second, 0], abs=0.02 * variance)
    expected = [first + both, second, both]
    assert found.total * variance == pytest.approx(expected, abs=0.02 * variance)
    assert (np.abs(found.first - np.array([first, second, 0]) / variance)
            < 2 * found.first_error).all()  # fmt: skip
    assert (found.first_error < 0.05).all()


def test_indices_and_tornado_of_a_sum():
    weights = np.array([1.0, 2.0, 0.0])
    spreads = numbers(3, 0, 1)
    found = indices_of(lambda x: {"y": 1e3 + x @ weights, "none": 0 * x[:, 0]}, spreads, 256)
    assert found["y"].first == pytest.approx([0.2, 0.8, 0], abs=0.03)
    assert found["none"].total == pytest.approx([0, 0, 0])
    chart = tornado(lambda x: {"y": x @ weights}, spreads)["y"]
    assert chart.high - chart.low == pytest.approx(0.9 * weights)
    assert chart.order == [1, 0, 2]


def test_samples_meet_every_stratum_and_are_the_same_again():
    spreads = numbers(2, 0, 1)
    found = samples(spreads, 50, seed=3)
    assert (np.sort((50 * found).astype(int), axis=0) == np.arange(50)[:, None]).all()
    assert (found == samples(spreads, 50, seed=3)).all()
    with pytest.raises(ValueError, match=r"outside 2\.\.100,000"):
        samples(spreads, 1)


def test_the_budget_of_the_pressure_is_its_closed_form():
    scene = replace(loads(SLAB), spreads=())
    found = error_budget(scene, 0.02)
    assert found.device == pytest.approx(sinh(log(2) / stats.norm.ppf(0.95)), rel=1e-6)
    assert (
        "numerical 2.0 %; one standard deviation of the material of no known spread" in found.words
    )


def test_the_budget_of_the_material_is_what_samples_of_it_show():
    """First order: the share of one standard deviation, here of 3 %, in the waveform's change."""
    text = SLAB.replace("25e3", "{ value = 25e3, spread = 0.03 }")
    scene = loads(text.replace('{ value = 50, spread = 0.2, distribution = "normal" }',
                               "{ value = 50, spread = 0 }"))  # fmt: skip
    found = propagate(scene, 64)
    centre = solve(scene, found.method).waveform
    away = np.sqrt(((found.waveform - centre) ** 2).mean(axis=0).sum(axis=0))
    expected = (away / np.linalg.norm(centre, axis=0)).max()
    assert error_budget(scene).material == pytest.approx(expected, rel=0.1)


def test_a_finer_mesh_than_a_tenth_of_the_material_gains_nothing():
    palm = loads(SLAB.split("[body]")[0] + '[body]\nmaterial = "palm"')
    row = mesh_row(palm, 3e-3, 0.02)
    material = error_budget(palm).material
    assert 0.3 < material < 3
    size = float(row.reason.rpartition("finer than ")[2].split()[0])
    assert 3 < size <= 15
    assert "below a tenth of the material's" in row.reason


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


def test_the_budget_of_a_sheet_is_what_samples_of_its_modes_show():
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
    assert 0.001 < expected < 0.2
    plain = loads('[tacton]\nam_frequency_hz = 140\n[body]\nkind = "sheet"')
    assert "not computed" not in mesh_row(plain, None, 0.1).value


def test_a_curled_sheet_has_no_budget_of_its_material():
    curled = loads('[body]\nkind = "sheet"\n[body.mounting]\ncurl_x_mm = 1')
    assert isnan(error_budget(curled).material)
    assert "material not computed" in mesh_row(curled, None, 0.1).value


def test_distributions_of_a_sweep():
    assert called("normal(25e3, 0.3)") == (25e3, Distribution(shape="normal", width=(0.3,)))
    assert called("factor(50,2)") == (50, known_to(2))
    assert called("triangular(10,12,20)") == (12, bounds("triangular", 10, 20))
    assert called("palm") is None
    with pytest.raises(ValueError, match="needs 2 numbers; write uniform"):
        called("uniform(1)")
    varied = [parse("focus.peak_pressure_pa=factor(50,2)"), parse("tacton.size_mm=10:20")]
    met = combinations(varied, "sobol", 4)
    assert len(met) == 4 * (2 + 2)
    assert [run["tacton.size_mm"] for run in met[:4]] == [
        run["tacton.size_mm"] for run in met[8:12]
    ]
    assert all(10 <= run["tacton.size_mm"] <= 20 for run in met)
    with pytest.raises(ValueError, match="no power of two; take 4"):
        combinations(varied, "sobol", 5)
    with pytest.raises(ValueError, match="has a distribution, of which a factorial design"):
        combinations(varied)


def table(path):
    with Path(path).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_a_sweep_by_distributions_has_percentiles_and_indices(tmp_path, monkeypatch):
    """The kernel's RMS is in proportion to the pressure, and the same at all whole frequencies."""
    monkeypatch.chdir(tmp_path)
    Path("kernel.toml").write_text(SLAB.split("[focus]")[0] + '[body]\nkind = "none"\n')
    vary = ["focus.peak_pressure_pa=uniform(30,70)", "focus.height_mm=uniform(195,205)"]
    words = ["sweep", "kernel.toml", "--design", "sobol", "--samples", "4", "--quiet"]
    words += ["--vary", *vary, "--scheduler", "threads", "--out", "swept"]
    assert main(words) == 0
    rows = {row["key"]: row for row in table("swept/indices.csv") if row["column"] == RMS}
    a, b, mixed, _ = np.split(np.array([x["focus.peak_pressure_pa"] for x in design(vary, 4)]), 4)
    total = ((a - mixed) ** 2).mean() / 2 / np.concatenate([a, b]).var()  # Saltelli, eq. f
    assert float(rows["focus.peak_pressure_pa"]["total"]) == pytest.approx(total, rel=0.05)
    assert float(rows["focus.height_mm"]["total"]) < 0.02
    assert "Sobol" in Path("swept/uncertainty.html").read_text("utf-8")
    Path("swept/indices.csv").write_text("mine")
    assert main(words) == 2


RMS = "kernel_rms_pa"


def design(vary, n):
    return combinations([parse(text) for text in vary], "sobol", n)


def test_rows_are_in_the_order_of_their_design():
    rows = [{"key": "b"}, {"key": "a"}]
    cases = {n: Namespace(varied={"x": k}, text=n) for k, n in enumerate("ab")}
    found = of_sweep.in_order(rows, cases, [{"x": 1}, {"x": 0}, {"x": 1}])
    assert [row["key"] for row in found] == ["b", "a", "b"]


def test_run_with_samples_writes_bands(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("slab.toml").write_text(SLAB)
    words = ["run", "slab.toml", "--model", "flat-body-harmonic", "--out", "out", "--quiet"]
    assert main([*words, "--samples", "16"]) == 0
    rms = [row for row in table("out/percentiles.csv") if row["what"] == "rms"]
    assert len(rms) == 2
    assert float(rms[0]["p5"]) < float(rms[0]["p50"]) < float(rms[0]["p95"])
    found = table("out/samples.csv")
    ratio = {float(r["RMS at (0, 0) mm, µm"]) / float(r[PRESSURE]) for r in found}
    assert len(found) == 16
    assert max(ratio) == pytest.approx(min(ratio), rel=1e-6)
    page = Path("out/index.html").read_text("utf-8")
    assert "16 samples of 1 uncertain number, by the wavenumber integral" in page
    assert "one standard deviation of the material of no known spread, device 20 %" in page
    assert main(["run", "slab.toml", "--samples", "1", "--out", "other"]) == 2
    assert "outside 2..100,000" in capsys.readouterr().err
    assert not Path("other").exists()


def test_what_ignores_a_spread_says_so_once(tmp_path, capsys):
    path = tmp_path / "slab.toml"
    path.write_text(SLAB)
    asked = Namespace(scene=path, command_name="compare", samples=None)
    note_central_values(asked)
    said = capsys.readouterr().err
    assert said.count("central values are taken of focus.peak_pressure_pa") == 1
    note_central_values(Namespace(scene=path, command_name="run", samples=8))
    path.write_text(SLAB.replace('{ value = 50, spread = 0.2, distribution = "normal" }', "50"))
    note_central_values(asked)
    assert capsys.readouterr().err == ""
