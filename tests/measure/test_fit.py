"""Fits of a scene to measurements: recovery, what is not determined, and what is refused."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from simple_model import flat_body
from simple_model.layers.flat_body import steady_lines
from simple_model.load.spectrum import synthesise
from skinwave.bodies.analytic import compliance
from skinwave.commands import cli
from skinwave.measure import Measurement, search
from skinwave.measure.findings import cautions
from skinwave.measure.fit import fit
from skinwave.measure.fit_page import fitted_scene, summary
from skinwave.measure.misfit import NOT_DESCRIBED
from skinwave.measure.observed import is_steady, load_lines
from skinwave.measure.parameters import check_limits, parse
from skinwave.measure.predicted import line_predictor, target_of
from skinwave.measure.writing import write
from skinwave.planning.simulate import compute
from skinwave.scene.file import loads
from skinwave.scene.spreads import OF_PRESETS, spreads_of
from skinwave.scene.variation import with_values

MODULUS, VISCOSITY = "body.material.shear_modulus_pa", "body.material.viscosity_pa_s"
PRESSURE = "focus.peak_pressure_pa"
TRUE = {MODULUS: 30e3, VISCOSITY: 6.0}
LIMITS = {
    MODULUS: "10000:70000", VISCOSITY: "1:20", "gain": "0.2:5", "delay_ms": "-2:2",
    PRESSURE: "10:200",
}  # fmt: skip
TEXT = """
[tacton]
am_frequency_hz = 140
duration_s = 0.2
shape = "point"
[body]
kind = "slab"
thickness_mm = 15
[probes]
points_mm = [[4, 0], [10, 0], [18, 0]]
"""


@pytest.fixture(scope="module")
def scene():
    return loads(TEXT)


@pytest.fixture(scope="module")
def lines(scene):
    """Frequencies (f,) in Hz > 0 and velocities (f, p) in m/s of the true material."""
    moved = with_values(scene, TRUE)
    f, a = steady_lines(compliance(moved.body), moved.pressure, moved.probe_points)
    return f[1:], (a * (2j * np.pi * f)[:, None])[1:]


def vary(*keys):
    return [f"{key}={LIMITS[key]}" for key in keys]


def spectra(scene, lines, noise=0.01, *, gain=0.8, delay=0.7e-3):
    f, a = lines
    a = gain * a * np.exp(-2j * np.pi * f * delay)[:, None]
    parts = np.random.default_rng(0).standard_normal((2, 4, *a.shape))
    each = noise * np.abs(a).max() * (parts[0] + 1j * parts[1]) / np.sqrt(2)
    places = scene.probe_points
    return Measurement(quantity="velocity", places=places, frequencies=f, values=a + each)


def test_a_material_is_recovered_from_every_start(scene, lines):
    found = fit(scene, spectra(scene, lines), vary(*LIMITS)[:4], starts=3)
    ended = [found.solution.problem.parameters.values(x.ended) for x in found.solution.starts]
    assert all(values[MODULUS] == pytest.approx(30e3, rel=0.01) for values in ended)
    truth = TRUE | {"gain": 0.8, "delay_ms": 0.7}
    error = {each.key: np.log(each.high / each.low) / 4 for each in found.estimates[:3]}
    for key, one in error.items():
        assert abs(np.log(found.values[key] / truth[key])) < 3 * one < 0.15
    assert found.values["delay_ms"] == pytest.approx(0.7, abs=0.02)
    assert cautions(found) == []
    assert found.scene.body.material.shear_modulus == found.values[MODULUS]


def test_gain_and_pressure_have_no_interval(scene, lines):
    measured = spectra(scene, lines, delay=0)
    found = fit(scene, measured, vary(MODULUS, "gain", PRESSURE, VISCOSITY), starts=1)
    of = {each.key: each for each in found.estimates}
    assert [key for key, each in of.items() if each.is_resolved] == [MODULUS, VISCOSITY]
    assert of[MODULUS].low < of[MODULUS].value < of[MODULUS].high
    (keys,) = found.intervals.unresolved
    assert set(keys) == {"gain", PRESSURE}
    assert len([text for text in cautions(found) if PRESSURE in text]) == 1
    assert found.values["gain"] * found.values[PRESSURE] == pytest.approx(0.8 * 50, rel=0.05)
    text = fitted_scene(found)
    given = {each.key: each for each in spreads_of(loads(text))}
    assert given[PRESSURE].distribution.width == (10, 200)


def test_noise_determines_nothing(scene, lines):
    measured = spectra(scene, lines)
    noise = np.random.default_rng(5).standard_normal((2, *measured.values.shape)) * 1e-3
    measured = replace(measured, values=noise[0] + 1j * noise[1])
    found = fit(scene, measured, ["gain=0.0001:0.1", f"{PRESSURE}=0.001:1"], starts=1)
    assert not any(each.is_resolved for each in found.estimates)


def test_the_fitted_scene_has_the_spreads_of_the_estimates(scene, lines):
    measured = spectra(scene, lines, 0.03)
    found = fit(scene, measured, [*vary("gain", MODULUS, "delay_ms"), "body.thickness_mm=10:20"],
                starts=1)  # fmt: skip
    text = fitted_scene(found)
    given = {each.key: each for each in spreads_of(loads(text))}
    assert given.keys() == {MODULUS, VISCOSITY, "body.thickness_mm", PRESSURE}
    for each in (one for one in found.estimates if "." in one.key):
        ends = given[each.key].distribution.quantile(each.value, [0.025, 0.975])
        assert ends == pytest.approx([each.low, each.high], rel=0.01)
    assert given[VISCOSITY].value == 5
    assert given[VISCOSITY].distribution == OF_PRESETS["palm"][1]


def test_an_estimate_at_a_limit_and_a_misfit_give_warnings(scene, lines):
    vary_low = [f"{MODULUS}=10000:20000", *vary("gain")]
    warnings = cautions(fit(scene, spectra(scene, lines, delay=0), vary_low, starts=1))
    assert any(text.startswith(f"{MODULUS} = ") and "limit" in text for text in warnings)
    assert any(text.startswith("poor fit") for text in warnings)
    turned = fit(scene, spectra(scene, lines, gain=-0.8), vary(MODULUS, "gain"), starts=1)
    assert any("sign" in text for text in cautions(turned))


def test_a_fit_of_a_wrong_law_has_wide_intervals_or_none(scene, lines):
    law = loads(TEXT.replace("[probes]", """[body.material]
density_kg_m3 = 1000
poisson = 0.4999
shear_modulus_pa = 20e3
loss_factor = 0.2
[probes]"""))  # fmt: skip
    varied = [*vary(MODULUS, "gain", "delay_ms"), "body.material.loss_factor=0.02:2"]
    measured = spectra(scene, lines, 1e-4)
    wide, none = (fit(law, measured, each, starts=1) for each in (varied, vary(MODULUS, "gain")))
    of = {each.key: each for each in wide.estimates}
    assert of["gain"].low < 0.8 < of["gain"].high
    assert of["delay_ms"].low < 0.7 < of["delay_ms"].high
    assert any(text.startswith("the misfit beyond the noise") for text in cautions(wide))
    assert none.intervals.misfit > 0.2
    found = summary(none)
    assert not any(each["resolved"] or each["low"] for each in found["estimates"])
    assert NOT_DESCRIBED[1:] in found["sentences"][2]
    assert NOT_DESCRIBED in found["warnings"][0]
    assert "95 %" not in " ".join(found["sentences"])
    assert {each.distribution.shape for each in spreads_of(none.scene) if each.key == MODULUS} == {
        "uniform"
    }


def test_amplitudes_need_no_delay(scene, lines):
    measured = spectra(scene, lines, delay=3.3e-3)
    found = fit(scene, measured, vary(MODULUS, VISCOSITY, "gain"), kind="amplitudes", starts=1)
    assert found.values[MODULUS] == pytest.approx(30e3, rel=0.05)


def test_ties_follow_what_is_varied(scene, lines):
    tie = [f"{VISCOSITY}={MODULUS} / 5000", "gain = 4 / 5"]
    found = fit(scene, spectra(scene, lines), vary(MODULUS, "delay_ms"), tie=tie, starts=1)
    assert found.values[MODULUS] == pytest.approx(30e3, rel=0.02)
    assert found.values[VISCOSITY] == pytest.approx(found.values[MODULUS] / 5000)
    with pytest.raises(ValueError, match="cannot be evaluated"):
        parse(vary(MODULUS), ["gain = no_such_key"]).values(np.array([0.5]))


def test_offsets_move_the_places(scene, lines):
    f, a = lines
    target = target_of(scene, "flat-body", spectra(scene, lines).record, scene.probe_points)
    moved = replace(target, places=target.places + [1e-3, -2e-3])
    by_offset = line_predictor(target, f)(TRUE | {"offset_x_mm": 1.0, "offset_y_mm": -2.0})
    assert by_offset == pytest.approx(line_predictor(moved, f)(TRUE), rel=1e-9)
    assert line_predictor(target, f)(TRUE) == pytest.approx(a, rel=1e-4)


def waveforms(scene, x, t, noise=0.01, repetitions=2):
    rng = np.random.default_rng(0)
    each = noise * x.std() * rng.standard_normal((repetitions, *x.shape))
    return Measurement(quantity="displacement", places=scene.probe_points, times=t, values=x + each)


def test_steady_waveforms_are_fitted_as_lines(scene, lines):
    f, a = lines
    t = np.arange(800) / 4000
    x = synthesise(f, a / (2j * np.pi * f)[:, None], t + 0.3e-3)
    measured = waveforms(scene, x, t)
    assert is_steady(measured, f)
    found = fit(scene, measured, vary(MODULUS, VISCOSITY, "delay_ms"), starts=1)
    assert "steady waveforms" in found.solution.problem.data.words
    assert found.values[MODULUS] == pytest.approx(30e3, rel=0.01)
    assert found.values["delay_ms"] == pytest.approx(-0.3, abs=0.02)
    assert found.intervals.whiteness.is_white


def test_waveforms_from_rest_are_fitted_with_their_transient(scene, lines):
    moved = with_values(scene, TRUE)
    t = np.arange(0, 0.06, 1 / 4000)
    x = flat_body(compliance(moved.body), moved.pressure, moved.probe_points, t).values
    measured = waveforms(scene, 1.5 * x, t, repetitions=1)
    assert not is_steady(measured, lines[0])
    found = fit(scene, measured, vary(MODULUS, VISCOSITY, "gain"), starts=1)
    assert "from rest" in found.solution.problem.data.words
    assert found.values[MODULUS] == pytest.approx(30e3, rel=0.01)
    assert found.values["gain"] == pytest.approx(1.5, rel=0.02)
    with pytest.raises(ValueError, match="transient.*flat-body-harmonic"):
        fit(scene, measured, vary(MODULUS), model="flat-body-harmonic")
    brief = loads(TEXT.replace("duration_s = 0.2", "duration_s = 0.05"))
    with pytest.raises(ValueError, match="Tacton of 50 ms"):
        fit(brief, measured, vary(MODULUS))


def test_a_record_too_short_for_its_lines_is_not_fitted_to_them():
    moving = 'shape = "circle"\nsize_mm = 20\nspeed_m_per_s = 8'
    scene = loads(TEXT.replace('shape = "point"', moving))
    moved = compute(with_values(scene, TRUE), "flat-body-harmonic")
    early = moved.times < 0.05
    given = {"times": moved.times[early], "values": moved.values[None, early]}
    short = Measurement(quantity="displacement", places=moved.probes, **given)
    for asked in ({"kind": "lines"}, {"model": "flat-body-harmonic"}):
        with pytest.raises(ValueError, match="too short to resolve"):
            fit(scene, short, vary("gain"), **asked)


@pytest.mark.slow
def test_elements_are_factorised_once_for_many_predictions():
    body = 'size_x_mm = 30\nsize_y_mm = 30\nthickness_mm = 10\nsides = "clamped"'
    small = loads(TEXT.replace("thickness_mm = 15", body).replace(", [18, 0]", ""))
    found = compute(with_values(small, TRUE), "fem", h=5e-3)
    measured = waveforms(small, found.values, found.times)
    fitted = fit(small, measured, vary(MODULUS, VISCOSITY, "gain"), kind="lines", model="fem",
                 starts=1)  # fmt: skip
    assert fitted.target.reduced.effort.factorisations < 100
    assert fitted.values[MODULUS] == pytest.approx(30e3, rel=0.05)


def test_what_cannot_be_fitted_is_refused(scene, lines):
    measured = spectra(scene, lines)
    with pytest.raises(ValueError, match="body.material.poisson at 0.6"):
        check_limits(scene, parse(["body.material.poisson=0.3:0.6"]))
    unknown = replace(measured, places=np.full((3, 2), np.nan))
    other = replace(measured, frequencies=measured.frequencies + 17)
    one = replace(measured, places=measured.places[:1], values=measured.values[:, :1, :1],
                  frequencies=measured.frequencies[:1])  # fmt: skip
    for given, varied, options, said in (
        (measured, ["tacton.am_frequency_hz=100:180"], {}, "load has no line at"),
        (measured, vary("gain"), {"kind": "waveforms"}, "fit lines"),
        (measured, vary("gain"), {"model": "point-kernel"}, "has no body"),
        (unknown, vary("gain"), {}, "places are unknown"),
        (other, vary("gain"), {}, "resolves no line"),
        (one, vary(MODULUS, VISCOSITY, "gain"), {}, "cannot determine"),
    ):
        with pytest.raises(ValueError, match=said):
            fit(scene, given, varied, **options)


def test_lines_that_a_reduced_body_leaves_out_are_reported(scene, lines):
    measured = spectra(scene, lines)
    target = target_of(scene, "flat-body", measured.record, scene.probe_points)
    every = load_lines(measured, target)
    assert every.left_out == ()
    small = replace(target, reduced=SimpleNamespace(frequencies=every.measured.frequencies[:1]))
    left = load_lines(measured, small).left_out[0]
    power = (np.abs(every.measured.mean) ** 2 - 2 * every.error**2).sum(axis=1)
    assert left.frequency == 280.0
    assert left.share == pytest.approx(power[1] / power.sum(), rel=0.01)
    found = fit(scene, measured, vary("gain"), starts=1)
    data = replace(found.solution.problem.data, left_out=(left, replace(left, share=np.nan)))
    solution = replace(found.solution, problem=replace(found.solution.problem, data=data))
    assert any(left.name in text for text in cautions(replace(found, solution=solution)))
    rng = np.random.default_rng(1)
    values = 1e-6 * (rng.standard_normal(measured.values.shape) + 1j)
    values[:, 0] = measured.values[:, 0]
    values[:, 1:] -= 1e-6j
    assert load_lines(replace(measured, values=values), small).left_out[0].share == 0.0


def test_the_command_writes_a_scene_and_a_page(scene, lines, tmp_path, capsys):
    (tmp_path / "scene.toml").write_text(TEXT)
    write(spectra(scene, lines), tmp_path / "measured.npz")
    words = f"fit {tmp_path}/scene.toml --measured {tmp_path}/measured.npz --starts 1 --json"
    tie = ["--tie", f"{MODULUS}=600 * 50", f"{VISCOSITY}=6", "-o", str(tmp_path / "out")]
    varied = ["--vary", *vary("gain", PRESSURE, "delay_ms")]
    assert cli.main([*words.split(), *varied, *tie]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["unresolved"] == [["gain", PRESSURE]]
    text = (tmp_path / "out/scene.toml").read_text()
    assert loads(text).body.material.shear_modulus == pytest.approx(30e3, rel=0.02)
    names = {"estimates.csv", "fit.json", "fit.npz", "fitted.png", "residuals.png", "record.json"}
    assert names <= {path.name for path in (tmp_path / "out").iterdir()}


def test_a_start_that_fails_leaves_the_others(monkeypatch):
    def refined(problem, start):
        if start:
            raise ArithmeticError("not finite")
        return search.LocalMinimum(ended=np.zeros(1), cost=0.0, converged=True)

    monkeypatch.setattr(search, "best_candidate", lambda problem, candidates: candidates)
    monkeypatch.setattr(search, "refine", refined)
    monkeypatch.setattr(search, "descend", lambda problem, local: local)
    failures = {}
    assert len(search.search(None, [False, True, False], lambda *phase: None, failures)) == 2
    assert failures == {"start 2": "not finite"}
