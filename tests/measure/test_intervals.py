"""Searches and intervals of fits: closed forms of linear fits, plane waves, and coloured noise."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from skinwave.measure import Measurement, observed
from skinwave.measure.intervals import intervals, whiteness, widening
from skinwave.measure.observed import Data
from skinwave.measure.parameters import Parameter, parse
from skinwave.measure.search import Problem, descend, minimise, refine
from skinwave.scene.file import loads
from skinwave.system.effort import silent

MODULUS = "body.material.shear_modulus_pa"
N = 400
SHAPE = 1 + np.sin(2 * np.pi * np.arange(N) / 150)
VARY = (f"{MODULUS}=8000:80000", "gain=0.2:5", "delay_ms=-5:5")
TRUE = {MODULUS: 26e3, "gain": 1.3, "delay_ms": -1.6}
LINES = np.array([51.0, 140.0, 191.0, 331.0, 471.0])
PLACES = np.array([5.0, 20.0, 35.0]) / 1e3


def problem_of(values, model, error, vary, is_known=True, kind="lines"):
    data = Data(
        kind=kind, words="", axis=np.arange(1.0, 1 + len(values)), values=values[:, None],
        error=np.full((len(values), 1), error), is_known=is_known,
        predict=lambda found: model(found)[:, None],
    )  # fmt: skip
    return Problem(parameters=parse(vary), data=data, linear=("gain",))


def test_a_gain_and_its_interval_are_those_of_linear_least_squares():
    rng = np.random.default_rng(3)
    shape = rng.standard_normal(12)
    values = 1.7 * shape + 0.05 * rng.standard_normal(12)
    asked = problem_of(values, lambda v: v["gain"] * shape, 0.05, ["gain=0.5:4"])
    found = minimise(asked, 2, 0, silent)
    (estimate,) = intervals(found).estimates
    best = values @ shape / (shape @ shape)
    assert found.converged
    assert estimate.value == pytest.approx(best, rel=1e-7)
    half = 1.95996 * 0.05 / np.linalg.norm(shape) * np.sqrt(found.scale)
    assert np.log(estimate.high / estimate.low) / 2 == pytest.approx(half / best, rel=1e-4)
    assert not estimate.is_curved


def test_correlation_of_a_straight_line_is_the_closed_form():
    """Intercept and slope over x: -mean(x) / rms(x)."""
    x = np.linspace(1, 3, 30)
    values = 0.4 + 0.2 * x + 0.01 * np.random.default_rng(0).standard_normal(30)
    asked = problem_of(
        values, lambda v: v["offset_x_mm"] + v["offset_y_mm"] * x, 1.0,
        ("offset_x_mm=-1:1", "offset_y_mm=-1:1"), is_known=False,
    )  # fmt: skip
    found = minimise(asked, 3, 0, silent)
    expected = -x.mean() / np.sqrt((x**2).mean())
    assert intervals(found).correlations[0, 1] == pytest.approx(expected, abs=1e-6)
    slope, intercept = np.polyfit(x, values, 1)
    values = asked.parameters.values(found.u)
    assert values == pytest.approx({"offset_x_mm": intercept, "offset_y_mm": slope}, abs=1e-6)


def test_an_interval_over_which_the_model_bends_is_approximate():
    values = 0.01 + 0.0447 * np.tile([1.0, -1.0], 15)
    asked = problem_of(values, lambda v: v["offset_x_mm"] ** 2 + 0 * values, 0.0447,
                       ["offset_x_mm=-0.01:1.2"])  # fmt: skip
    (estimate,) = intervals(minimise(asked, 2, 0, silent)).estimates
    assert [estimate.low, estimate.high] == pytest.approx([0.02, 0.18], abs=0.005)
    assert estimate.is_curved


@pytest.mark.parametrize(("given", "freedom"), [(1e-4, np.inf), (1.0, 0.0)])
def test_a_misfit_counts_as_one_complex_error(given, freedom):
    """Of a share m of the motion: half an interval of m t / sqrt(2), t with 2 degrees of freedom,
    however many values it has, and none if m is above a fifth.
    """
    for n, m in ((50, 0.1), (2000, 0.1), (50, 0.3)):
        shape, wrong = np.linalg.qr(np.random.default_rng(n).standard_normal((n, 2)))[0].T
        asked = problem_of(
            shape + m * wrong, lambda v, of=shape: v["gain"] * of, given, ["gain=0.1:10"],
            is_known=given < 1,
        )  # fmt: skip
        asked = replace(asked, data=replace(asked.data, freedom=freedom))
        found = intervals(minimise(asked, 1, 0, silent))
        (estimate,) = found.estimates
        assert found.unexplained == pytest.approx(m / np.hypot(1, m), rel=0.01)
        assert found.is_described == estimate.is_resolved == (m < 0.2)
        if m < 0.2:
            half = m * 4.3027 / np.sqrt(2)
            assert np.log(estimate.high / estimate.low) / 2 == pytest.approx(half, rel=0.02)


def test_intervals_hold_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(1)
    shape, inside = rng.standard_normal(8), 0
    for _ in range(200):
        values = shape + 0.1 * rng.standard_normal(8)
        asked = problem_of(values, lambda v: v["gain"] * shape, 1.0, ["gain=0.5:4"], False)
        (estimate,) = intervals(minimise(asked, 1, 0, silent)).estimates
        inside += estimate.low <= 1.0 <= estimate.high
    assert 0.9 <= inside / 200 <= 0.99


@pytest.mark.parametrize(("colour", "repetitions", "kind"), [
    ("white", 1, "lines"), ("1/f2", 3, "amplitudes"),
])  # fmt: skip
def test_gains_of_close_lines_hold_the_truth(monkeypatch, colour, repetitions, kind):
    """Least squares of 200 draws by their own errors, of lines 1.2 to 5 resolutions apart."""
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
        monkeypatch.setattr(observed, "line_predictor", lambda *_, a=model: lambda values: a)
        target = SimpleNamespace(scene=loads("[tacton]\nam_frequency_hz = 140\n"),
                              predicts=lambda f: np.full(len(f), True))  # fmt: skip
        data = observed.data_of(kind, measured, target)
        assert data.is_known
        slope, y = (data.whiten(x).reshape(len(f), -1, draws)
                    for x in (data.predict({}), data.values))  # fmt: skip
        power = (slope**2).sum(axis=(0, 1))
        gain = (slope * y).sum(axis=(0, 1)) / power
        dof = slope[..., 0].size - 1
        scale = np.maximum(((y - gain * slope) ** 2).sum(axis=(0, 1)) / dof, 1)
        half = 1.96 * np.sqrt(scale / power)
        inside.append((np.abs(gain - 1) < half).mean())
    assert 0.92 < np.mean(inside) < 0.98


def test_whiteness_refuses_coloured_residuals_only():
    rng = np.random.default_rng(0)
    p = np.array([whiteness(rng.standard_normal((200, 3))).p for _ in range(200)])
    assert 0.04 < (p < 0.1).mean() < 0.17
    noise = rng.standard_normal((201, 3))
    assert whiteness(noise[1:] + 0.5 * noise[:-1]).p < 1e-6
    assert np.isnan(whiteness(noise[:6]).p)


def coloured(rng, rho, shape=(N, 1)):
    """AR(1) noise (n, s) of variance 1, in its steady state."""
    white = rng.standard_normal((shape[0] + 200, *shape[1:]))
    return np.sqrt(1 - rho**2) * lfilter([1], [1, -rho], white, axis=0)[200:]


def of_slow_wave(noise):
    """Intervals of gain and offset of a slow wave, by least squares."""
    shape = np.column_stack([SHAPE, np.ones(N)])
    asked = problem_of(
        1.3 * SHAPE + 0.1 * noise[:, 0], lambda v: shape @ [v["gain"], v["offset_x_mm"]], 0.1,
        ["gain=0.2:5", "offset_x_mm=-1:1"], kind="waveforms",
    )  # fmt: skip
    return intervals(minimise(asked, 1, 0, silent))


def test_widening_of_a_mean_is_that_of_effective_samples():
    """Of long AR(1) noise (1 + rho) / (1 - rho) in variance (Bayley and Hammersley)."""
    rng = np.random.default_rng(0)
    for rho in (0.3, 0.6):
        (factor,) = widening(coloured(rng, rho, (20_000, 2)), np.ones((1, 20_000, 2)))
        assert factor == pytest.approx(np.sqrt((1 + rho) / (1 - rho)), rel=0.08)


def test_intervals_hold_the_truth_under_coloured_noise_and_stay_under_white():
    rng, inside = np.random.default_rng(3), []
    for _ in range(100):
        found = of_slow_wave(coloured(rng, 0.8))
        truth = {"gain": 1.3, "offset_x_mm": 0.0}
        inside += [each.low <= truth[each.key] <= each.high for each in found.estimates]
    assert 0.86 <= np.mean(inside) <= 0.99
    white = np.random.default_rng(2).standard_normal((N, 1))
    assert of_slow_wave(white).widenings.tolist() == [1.0, 1.0]


def plane_waves(values):
    """Shear waves (f, 2 p) from the origin that lose a factor of e in 20 mm, as two real parts."""
    speed = np.sqrt(values[MODULUS] / 1000)
    away = PLACES / speed + values["delay_ms"] / 1e3
    a = np.exp(-2j * np.pi * LINES[:, None] * away - PLACES / 20e-3)
    return values["gain"] * np.hstack([a.real, a.imag])


def of_waves(true=TRUE, sign=1.0, vary=VARY):
    noise = 0.02 * np.random.default_rng(0).standard_normal((len(LINES), 2 * len(PLACES)))
    data = Data(
        kind="lines", words="", axis=LINES, values=sign * (plane_waves(true) + noise),
        error=np.full(noise.shape, 0.02), is_known=True,
        predict=lambda values: plane_waves(TRUE | values),
    )  # fmt: skip
    return Problem(parameters=parse(vary), data=data, linear=("gain",))


@pytest.mark.parametrize("modulus", [8.5e3, 70e3])
def test_a_search_leaves_the_minimum_of_a_delay_a_period_off(modulus):
    asked = of_waves()
    u = np.array([each.position(x) for each, x in zip(
        asked.parameters.free, (modulus, 1.0, 3.6), strict=True)])  # fmt: skip
    wrong = refine(asked, u)
    assert wrong.converged
    assert wrong.cost > 100 * asked.data.values.size
    found = asked.parameters.values(descend(asked, wrong).ended)
    assert found[MODULUS] == pytest.approx(TRUE[MODULUS], rel=0.02)
    assert found["delay_ms"] == pytest.approx(TRUE["delay_ms"], abs=0.05)


def test_a_turned_sign_is_noticed():
    for sign in (1, -1):
        assert minimise(of_waves(TRUE, sign), 2, 0, silent).may_be_flipped == (sign < 0)
        vary = (VARY[0], "gain=-5:5", VARY[2])
        found = minimise(of_waves(TRUE | {"delay_ms": 0.1}, sign, vary), 2, 0, silent)
        assert found.may_be_flipped == (sign < 0)


def test_parameters_are_placed_by_their_logarithm_where_both_limits_are_positive():
    by_log = Parameter(key="a", low=1e3, high=1e5)
    assert by_log.value(0.5) == pytest.approx(1e4)
    linear = Parameter(key="b", low=-1, high=3)
    assert linear.value(0.5) == pytest.approx(1)
    for each in (by_log, linear):
        assert each.position(each.value(0.3)) == pytest.approx(0.3)
        assert each.position(1e9) == 1
    for given in (
        ["gain"], ["gain=1:2:3"], ["gain=2:1"], ["gain=1:inf"], ["gain=1:2", "gain=1:3"], [],
        ["body.materal=1:2"],
    ):  # fmt: skip
        with pytest.raises(ValueError, match="vary|gain|not a key"):
            parse(given)
