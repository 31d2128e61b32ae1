"""Fits of a scene to measurements: closed forms of linear fits, recovery, and what is refused."""

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
from skinwave.measure import Measurement, observed
from skinwave.measure.findings import cautions, shown
from skinwave.measure.fit import fit
from skinwave.measure.fit_page import fitted_scene
from skinwave.measure.intervals import (
    correlations,
    estimates,
    profiles,
    whiteness,
    width,
)
from skinwave.measure.observed import Data, is_steady
from skinwave.measure.parameters import Parameter, check, parse
from skinwave.measure.predicted import predicted_lines, target
from skinwave.measure.search import Problem, solve
from skinwave.measure.writing import write
from skinwave.planning.simulate import compute
from skinwave.scene.file import loads
from skinwave.scene.spreads import OF_PRESETS, spreads_of
from skinwave.scene.variation import varied

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
    moved = varied(scene, TRUE)
    f, a = steady_lines(compliance(moved.body), moved.pressure, moved.probe_points)
    return f[1:], (a * (2j * np.pi * f)[:, None])[1:]


def vary(*keys):
    return [f"{key}={LIMITS[key]}" for key in keys]


def spectra(scene, lines, noise=0.0, *, gain=0.8, delay=0.7e-3, seed=0, repetitions=4):
    f, a = lines
    a = gain * a * np.exp(-2j * np.pi * f * delay)[:, None]
    rng = np.random.default_rng(seed)
    parts = rng.standard_normal((2, repetitions, *a.shape))
    each = noise * np.abs(a).max() * (parts[0] + 1j * parts[1]) / np.sqrt(2)
    return Measurement(
        quantity="velocity", places=scene.probe_points, frequencies=f, values=a + each
    )


def linear_problem(values, model, error, limits=("gain=0.5:4",), is_known=True):
    data = Data(
        kind="lines", words="", axis=np.arange(1.0, 1 + len(values)), unit="Hz", labels=("one",),
        values=values[:, None], error=np.full((len(values), 1), error), is_known=is_known,
        predict=lambda found: model(found)[:, None],
    )  # fmt: skip
    return Problem(parameters=parse(limits), data=data, linear=("gain",))


@pytest.fixture(scope="module")
def of_one_gain():
    """A fit of a gain alone to 12 values, its closed form, and its standard error."""
    rng = np.random.default_rng(3)
    shape = rng.standard_normal(12)
    values = 1.7 * shape + 0.05 * rng.standard_normal(12)
    found = solve(linear_problem(values, lambda v: v["gain"] * shape, 0.05), 2, 0, quiet)
    return found, values @ shape / (shape @ shape), 0.05 / np.linalg.norm(shape)


def quiet(phase, fraction):
    pass


def test_a_gain_is_that_of_linear_least_squares(of_one_gain):
    found, best, error = of_one_gain
    (estimate,) = estimates(found)
    assert found.converged
    assert estimate.value == pytest.approx(best, rel=1e-7)
    half = width(found) * error * np.sqrt(found.scale)
    assert np.log(estimate.high / estimate.low) / 2 == pytest.approx(half / best, rel=1e-4)


def test_a_profile_of_a_linear_fit_ends_at_the_closed_form(of_one_gain):
    found, best, error = of_one_gain
    (profile,) = profiles(found, quiet)
    half = width(found) * error * np.sqrt(found.scale)
    assert [profile.low, profile.high] == pytest.approx([best - half, best + half], rel=0.03 * half)
    assert not profile.is_open


def test_correlation_of_a_straight_line_is_the_closed_form():
    """Intercept and slope over x: -mean(x) / rms(x)."""
    x = np.linspace(1, 3, 30)
    rng = np.random.default_rng(0)
    values = 0.4 + 0.2 * x + 0.01 * rng.standard_normal(30)
    problem = linear_problem(
        values, lambda v: v["offset_x_mm"] + v["offset_y_mm"] * x, 1.0,
        ("offset_x_mm=-1:1", "offset_y_mm=-1:1"), is_known=False,
    )  # fmt: skip
    found = solve(problem, 3, 0, quiet)
    assert correlations(found)[0, 1] == pytest.approx(-x.mean() / np.sqrt((x**2).mean()), abs=1e-6)
    slope, intercept = np.polyfit(x, values, 1)
    values = problem.parameters.values(found.u)
    assert values == pytest.approx({"offset_x_mm": intercept, "offset_y_mm": slope}, abs=1e-6)


def test_intervals_hold_the_truth_as_often_as_they_say():
    """Of 300 linear fits whose noise is unknown; 95 % within three standard errors of 300 draws."""
    rng = np.random.default_rng(1)
    shape, inside = rng.standard_normal(8), 0
    for _ in range(300):
        values = shape + 0.1 * rng.standard_normal(8)
        problem = linear_problem(values, lambda v: v["gain"] * shape, 1.0, is_known=False)
        (estimate,) = estimates(solve(problem, 1, 0, quiet))
        inside += estimate.low <= 1.0 <= estimate.high
    assert 0.91 <= inside / 300 <= 0.99


@pytest.mark.parametrize(
    ("colour", "repetitions", "kind"),
    [("white", 1, "lines"), ("1/f2", 2, "lines"), ("1/f2", 3, "amplitudes")],
)
def test_gains_of_close_lines_hold_the_truth(monkeypatch, colour, repetitions, kind):
    """Intervals of least squares of 200 draws, one a place, by the data's own errors: of lines 1.2
    to 5 resolutions apart and of lines at all frequencies.
    """
    samples, draws, rate = 1000, 200, 2000.0
    f0 = 1 / (0.75 * samples / rate)
    times = np.arange(samples) / rate
    rng = np.random.default_rng(repetitions)
    inside = []
    for f in (*(150 + x * f0 * np.arange(5) for x in (1.2, 2.0, 5.0)), f0 * np.r_[4, 9, 80, 250]):
        model = rng.standard_normal((len(f), 1)) + 1j * rng.standard_normal((len(f), 1))
        model = np.repeat(30 * model, draws, axis=1)
        noise = rng.standard_normal((repetitions, samples, draws))
        noise = noise.cumsum(axis=1) if colour == "1/f2" else noise
        clean = (np.exp(2j * np.pi * np.multiply.outer(times, f)) @ model).real
        measured = Measurement(quantity="velocity", places=np.zeros((draws, 2)), times=times,
                               values=clean + noise)  # fmt: skip
        lines = {f"line {k}": each for k, each in enumerate(f)}
        monkeypatch.setattr(observed, "resolved_lines", lambda *_, lines=lines: (lines, {}))
        monkeypatch.setattr(observed, "predicted_lines", lambda *_, a=model: lambda values: a)
        aim = SimpleNamespace(scene=loads(TEXT), predicts=lambda f: np.full(len(f), True))
        data = observed.data_of(kind, measured, aim)
        assert data.is_known
        slope, y = (data.weighted(x).reshape(len(f), -1, draws)
                    for x in (data.predict({}), data.values))  # fmt: skip
        power = (slope**2).sum(axis=(0, 1))
        gain = (slope * y).sum(axis=(0, 1)) / power
        dof = slope[..., 0].size - 1
        scale = np.maximum(((y - gain * slope) ** 2).sum(axis=(0, 1)) / dof, 1)
        half = 1.96 * np.sqrt(scale / power)
        inside.append((np.abs(gain - 1) < half).mean())
    assert 0.92 < np.mean(inside) < 0.98


def test_a_material_is_recovered_from_every_start(scene, lines):
    found = fit(scene, spectra(scene, lines, 0.01), vary(*LIMITS)[:4], starts=4)
    ended = [found.solution.problem.parameters.values(x.ended) for x in found.solution.starts]
    assert all(values[MODULUS] == pytest.approx(30e3, rel=0.01) for values in ended)
    truth = TRUE | {"gain": 0.8, "delay_ms": 0.7}
    error = {each.key: np.log(each.high / each.low) / 4 for each in found.estimates[:3]}
    for key, one in error.items():
        assert abs(np.log(found.values[key] / truth[key])) < 3 * one < 0.15
    assert found.values["delay_ms"] == pytest.approx(0.7, abs=0.02)
    assert cautions(found) == []
    assert found.scene.body.material.shear_modulus == found.values[MODULUS]


def test_gain_and_pressure_have_no_interval_but_their_product(scene, lines):
    measured = spectra(scene, lines, 0.01, delay=0)
    found = fit(scene, measured, vary(MODULUS, "gain", PRESSURE, VISCOSITY), starts=1)
    of = {each.key: each for each in found.estimates}
    assert not of["gain"].is_resolved
    assert not of[PRESSURE].is_resolved
    assert of[MODULUS].low < of[MODULUS].value < of[MODULUS].high
    (direction,) = found.unresolved
    assert set(direction.keys) == {"gain", PRESSURE}
    (said,) = (text for text in cautions(found) if "resolve" in text)
    assert f"only gain times {PRESSURE} is determined" in said
    assert {profile.key for profile in found.profiles} == {MODULUS, VISCOSITY}
    assert found.values["gain"] * found.values[PRESSURE] == pytest.approx(0.8 * 50, rel=0.05)
    text = fitted_scene(found)
    given = {each.key: each for each in spreads_of(loads(text))}
    assert given[PRESSURE].distribution.width == (10, 200)
    assert f"{PRESSURE} is not resolved by the measurement" in text


def test_noise_determines_no_combination(scene, lines):
    """As many directions that are not resolved as keys: no interval, of width zero or any other."""
    measured = spectra(scene, lines, 0.05)
    noise = np.random.default_rng(5).standard_normal((2, *measured.values.shape)) * 1e-3
    measured = replace(measured, values=noise[0] + 1j * noise[1])
    found = fit(scene, measured, ["gain=0.0001:0.1", f"{PRESSURE}=0.001:1"], starts=1)
    assert not any(each.is_resolved for each in found.estimates)
    assert not any("is determined" in text for text in cautions(found))


def test_the_fitted_scene_has_the_spreads_of_the_estimates(scene, lines):
    """Quantiles 2.5 and 97.5 % are the interval, and the loss keeps the spread of the preset."""
    measured = spectra(scene, lines, 0.03)
    found = fit(scene, measured, [*vary("gain", MODULUS, "delay_ms"), "body.thickness_mm=10:20"],
                starts=1)  # fmt: skip
    text = fitted_scene(found)
    assert "correlations of the estimates are dropped, as 0." in text
    given = {each.key: each for each in spreads_of(loads(text))}
    assert given.keys() == {MODULUS, VISCOSITY, "body.thickness_mm", PRESSURE}
    for each in (one for one in found.estimates if "." in one.key):
        ends = given[each.key].distribution.quantile(each.value, [0.025, 0.975])
        assert ends == pytest.approx([each.low, each.high], rel=0.01)
    losses = OF_PRESETS["palm"].losses
    assert given[VISCOSITY].value == 5
    assert given[VISCOSITY].distribution == losses


def test_an_estimate_at_a_limit_is_named(scene, lines):
    found = fit(
        scene, spectra(scene, lines, 0.01, delay=0), [f"{MODULUS}=10000:20000", *vary("gain")],
        starts=1,
    )  # fmt: skip
    said = cautions(found)
    assert any(text.startswith(f"{MODULUS} = ") and "at a limit" in text for text in said)
    assert any("errors of the measurement explain" in text for text in said)


def test_amplitudes_need_no_delay(scene, lines):
    measured = spectra(scene, lines, 0.01, delay=3.3e-3)
    found = fit(scene, measured, vary(MODULUS, VISCOSITY, "gain"), kind="amplitudes", starts=2)
    assert found.values[MODULUS] == pytest.approx(30e3, rel=0.05)


def test_ties_follow_what_is_varied(scene, lines):
    tie = [f"{VISCOSITY}={MODULUS} / 5000", "gain = 4 / 5"]
    found = fit(scene, spectra(scene, lines, 0.01), vary(MODULUS, "delay_ms"), tie=tie, starts=2)
    assert found.values[MODULUS] == pytest.approx(30e3, rel=0.02)
    assert found.values[VISCOSITY] == pytest.approx(found.values[MODULUS] / 5000)
    with pytest.raises(ValueError, match="cannot be evaluated"):
        parse(vary(MODULUS), ["gain = no_such_key"]).values(np.array([0.5]))


def test_offsets_move_the_places(scene, lines):
    aim = target(scene, "flat-body", Measurement(
        quantity="velocity", places=scene.probe_points, times=[0, 1e-3], values=np.zeros((1, 2, 3))
    ).record, scene.probe_points)  # fmt: skip
    f, a = lines
    moved = replace(aim, places=aim.places + [1e-3, -2e-3])
    by_offset = predicted_lines(aim, f)(TRUE | {"offset_x_mm": 1.0, "offset_y_mm": -2.0})
    assert by_offset == pytest.approx(predicted_lines(moved, f)(TRUE), rel=1e-9)
    assert predicted_lines(aim, f)(TRUE) == pytest.approx(a, rel=1e-4)


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
    assert found.whiteness.is_white


def test_waveforms_from_rest_are_fitted_with_their_transient(scene, lines):
    moved = varied(scene, TRUE)
    t = np.arange(0, 0.06, 1 / 4000)
    x = flat_body(compliance(moved.body), moved.pressure, moved.probe_points, t).values
    measured = waveforms(scene, 1.5 * x, t, repetitions=1)
    assert not is_steady(measured, lines[0])
    found = fit(scene, measured, vary(MODULUS, VISCOSITY, "gain"), starts=1)
    assert "from rest" in found.solution.problem.data.words
    assert found.values[MODULUS] == pytest.approx(30e3, rel=0.01)
    assert found.values["gain"] == pytest.approx(1.5, rel=0.02)
    with pytest.raises(ValueError, match="transient, and flat-body-harmonic has"):
        fit(scene, measured, vary(MODULUS), model="flat-body-harmonic")


def test_a_record_too_short_for_its_lines_is_not_fitted_to_them():
    """Lines 13 Hz apart, in 50 ms: what is left of them looked steady, and leaked into others."""
    moving = 'shape = "circle"\nsize_mm = 20\nspeed_m_per_s = 8'
    scene = loads(TEXT.replace('shape = "point"', moving))
    moved = compute(varied(scene, TRUE), "flat-body-harmonic")
    early = moved.times < 0.05
    short = Measurement(
        quantity="displacement", places=moved.probes, times=moved.times[early],
        values=moved.values[None, early],
    )  # fmt: skip
    for kind in ("lines", "amplitudes"):
        with pytest.raises(ValueError, match="too short to resolve"):
            fit(scene, short, vary("gain"), kind=kind)
    with pytest.raises(ValueError, match="too short to resolve .* or a longer record"):
        fit(scene, short, vary("gain"), model="flat-body-harmonic")


def test_whiteness_refuses_coloured_residuals_only():
    rng = np.random.default_rng(0)
    p = np.array([whiteness(rng.standard_normal((200, 3))).p for _ in range(200)])
    assert 0.04 < (p < 0.1).mean() < 0.17
    noise = rng.standard_normal((201, 3))
    assert whiteness(noise[1:] + 0.5 * noise[:-1]).p < 1e-6
    assert np.isnan(whiteness(noise[:6]).p)


@pytest.mark.slow
def test_elements_are_factorised_once_for_many_predictions():
    small = loads(
        TEXT.replace("thickness_mm = 15", 'size_x_mm = 30\nsize_y_mm = 30\nthickness_mm = 10\n'
                     'sides = "clamped"').replace(", [18, 0]", "")
    )  # fmt: skip
    found = compute(varied(small, TRUE), "fem", h=5e-3)
    measured = waveforms(small, found.values, found.times)
    fitted = fit(small, measured, vary(MODULUS, VISCOSITY, "gain"), kind="lines", model="fem",
                 starts=1)  # fmt: skip
    assert fitted.target.reduced.effort.factorisations * 20 <= fitted.solution.runs
    assert fitted.values[MODULUS] == pytest.approx(30e3, rel=0.05)


def test_limits_that_are_none_are_refused():
    for given in (
        ["gain"], ["gain=1:2:3"], ["gain=2:1"], ["gain=1:inf"], ["gain=1:2", "gain=1:3"], [],
        ["body.materal=1:2"],
    ):  # fmt: skip
        with pytest.raises(ValueError, match="vary|gain|no key"):
            parse(given)


def test_what_cannot_be_fitted_is_refused(scene, lines):
    measured = spectra(scene, lines, 0.01)
    with pytest.raises(ValueError, match="body.material.poisson at 0.6"):
        check(scene, parse(["body.material.poisson=0.3:0.6"]))
    with pytest.raises(ValueError, match="load has no line at"):
        fit(scene, measured, ["tacton.am_frequency_hz=100:180"])
    with pytest.raises(ValueError, match="spectra; fit lines"):
        fit(scene, measured, vary("gain"), kind="waveforms")
    with pytest.raises(ValueError, match="has no body"):
        fit(scene, measured, vary("gain"), model="point-kernel")
    unknown = replace(measured, places=np.full((3, 2), np.nan))
    with pytest.raises(ValueError, match="places of the measurement are not known"):
        fit(scene, unknown, vary("gain"))
    other = replace(measured, frequencies=measured.frequencies + 17)
    with pytest.raises(ValueError, match="resolves no line"):
        fit(scene, other, vary("gain"))
    one = replace(measured, places=measured.places[:1], values=measured.values[:, :1, :1],
                  frequencies=measured.frequencies[:1])  # fmt: skip
    with pytest.raises(ValueError, match="cannot determine"):
        fit(scene, one, vary(MODULUS, VISCOSITY, "gain"))


def test_parameters_are_placed_by_their_logarithm_where_both_limits_are_positive():
    by_log = Parameter(key="a", low=1e3, high=1e5)
    assert by_log.value(0.5) == pytest.approx(1e4)
    linear = Parameter(key="b", low=-1, high=3)
    assert linear.value(0.5) == pytest.approx(1)
    for each in (by_log, linear):
        assert each.place(each.value(0.3)) == pytest.approx(0.3)
        assert each.place(1e9) == 1


def test_values_are_shown_to_two_digits_of_their_interval():
    assert shown(30504.56, 30495.2, 30513.9) == ("30,504.6", "30,495.2", "30,513.9")
    assert shown(25.2, 10.0, 60.0) == ("25.2", "10.0", "60.0")


def test_the_command_writes_a_scene_and_a_page(scene, lines, tmp_path, capsys):
    (tmp_path / "scene.toml").write_text(TEXT)
    write(spectra(scene, lines, 0.01), tmp_path / "measured.npz")
    words = ["fit", str(tmp_path / "scene.toml"), "--measured", str(tmp_path / "measured.npz"),
             "--vary", *vary("gain", PRESSURE, "delay_ms"), "--tie", f"{MODULUS}=600 * 50",
             f"{VISCOSITY}=6", "--starts", "2", "-o", str(tmp_path / "out"),
             "--json"]  # fmt: skip
    assert cli.main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["unresolved"] == [["gain", PRESSURE]]
    text = (tmp_path / "out/scene.toml").read_text()
    assert "not resolved by the measurement" in text
    assert loads(text).body.material.shear_modulus == pytest.approx(30e3, rel=0.02)
    page = (tmp_path / "out/index.html").read_text()
    assert "Take care: the data do not resolve gain" in page
    names = {"estimates.csv", "fit.json", "fit.npz", "fitted.png", "residuals.png", "record.json"}
    assert names <= {path.name for path in (tmp_path / "out").iterdir()}
