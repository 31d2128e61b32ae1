"""Loads faster than their samples: lines above half the rate, jumps, and ends of records."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from circling import circling
from scipy.interpolate import CubicSpline

import simple_model
from simple_model import MovingPressure, Tacton, Trajectory, flat_body, lines, steady_state
from simple_model.layers.compliance import slab
from simple_model.layers.flat_body import field_history, steady_history, steady_lines
from simple_model.layers.flat_quantities import surface_field
from simple_model.layers.material import PRESETS
from simple_model.layers.wavenumber_integral import point_integrals, point_response
from simple_model.load.focus import spot_width
from simple_model.load.path_cells import path_fourier, path_samples
from simple_model.load.sampling import resolving_step
from simple_model.load.spectrum import load_lines, synthesise
from simple_model.quantities import ACCELERATION, DISPLACEMENT, VELOCITY
from skinwave import Body, Scene
from skinwave.models.options import SolveOptions
from skinwave.planning.plan import plan
from skinwave.planning.simulate import compute, solve_as_planned

PALM = slab(PRESETS["palm"], 0.015)
PROBES = np.array([[0.01, 0.0], [0.02, 0.0]])
TIMES = np.arange(4000) / 1e4
SKIN = Body(width=0.06, height=0.06, sides="clamped")
THIN = slab(PRESETS["palm"], 0.004)
BESIDE = np.array([[0.009, 0.0], [0.013, 0.002]])
ONE_WAY = Trajectory(shape="line", size=0.02, speed=0.05, sweep="one_way")  # 0.4 s


def solved(scene, **options):
    return solve_as_planned(scene, plan(scene, SolveOptions(**options)))


def misfit(found, expected, alternating, late):
    return np.sqrt(((found - expected)[late] ** 2).mean(axis=0)) / alternating


def alternating(load):
    f, a = steady_lines(PALM, load, PROBES)
    return np.sqrt((np.abs(a[f > 0]) ** 2).sum(axis=0) / 2)


@pytest.mark.slow
def test_flat_body_settles_into_the_steady_state_on_fast_circles():
    load, times = circling(5e-3, 100.0, 140.0), TIMES[:3000]
    found, expected = (m(PALM, load, PROBES, times).displacement for m in (flat_body, steady_state))
    assert misfit(found, expected, alternating(load), slice(2500, 2850)).max() < 0.01


@pytest.mark.parametrize(
    ("model", "size", "speed", "folded"),
    [(flat_body, 0.02, 100.0, 450.7), (steady_state, 0.005, 60.0, 2360.6)],
)
def test_lines_of_a_fast_circle_do_not_alias(model, size, speed, folded):
    load = circling(size, speed)
    false = lines(model(PALM, load, PROBES, TIMES), [folded], settle=0.5)
    assert (false < 1e-3 * alternating(load)).all()


@pytest.mark.parametrize("load", [circling(0.02, 100.0, 140.0), circling(0.0, 0.0, 6200.0)])
def test_the_kernel_has_the_lines_of_its_load_below_half_the_rate(load):
    found = simple_model.point_kernel(load, PROBES, TIMES).displacement
    parts = load_lines(load)
    spots = path_fourier(load, load.spot(PROBES, path_samples(load)).T)
    f, a = parts.gather(spots.T)
    expected = synthesise(f[f < 4800], a[f < 4800], TIMES)
    misfit = np.abs(lines_of(found) - lines_of(expected))[:4600] / np.ptp(expected)
    assert misfit.max() < 1e-4


def test_the_load_at_few_positions_is_transformed_instead_of_the_values():
    """A chirp at a resting focus: both orders of a linear transform and a product agree."""
    chirp = simple_model.Signal(rate=500.0, samples=tuple(np.sin(np.arange(50.0) ** 2 / 60)))
    load = MovingPressure(tacton=Tacton(duration=0.1, signal=chirp))
    values = np.random.default_rng(0).normal(size=(7, 3, len(path_samples(load))))
    orders = np.array([-3, 0, 1, 40])
    by_load, by_values = (path_fourier(load, values, orders, few=few) for few in (16, 0))
    scale = np.abs(by_values).max()
    assert by_load.shape == (7, 3, 4)
    np.testing.assert_allclose(by_load, by_values, rtol=0, atol=1e-14 * scale)


def lines_of(x):
    window = np.hanning(len(x))[:, None]
    return 2 * np.abs(np.fft.rfft(window * x, n=10_000, axis=0)) / window.sum()


def test_time_steps_resolve_a_fast_focus():
    assert resolving_step(circling(0.03, 18.0, 200.0), 5e-5) == 5e-5
    load = circling(0.005, 100.0)
    assert 1 / resolving_step(load, 5e-5) > 6 * load.tacton.drawing_frequency
    brief = replace(load, tacton=replace(load.tacton, duration=0.01))
    found = compute(Scene(pressure=brief, body=SKIN), "fem-transient", h=10e-3)
    assert found.effort.steps > 0.0099 * 6 * load.tacton.drawing_frequency


def at_rest(load, times):
    """Static deflection (t, p) under the focus where it is at each time."""
    away = np.linalg.norm(BESIDE[:, None] - load.tacton.trajectory.position(times), axis=-1)
    r = np.linspace(0, 0.03, 200)
    g = point_response(THIN, r, [0.0], spot_width(0.2))[0].real
    return load.gain(0.0) * CubicSpline(r, g)(away).T


@pytest.mark.parametrize("model", [flat_body, steady_state])
def test_a_slow_line_jumps_back_at_once(model):
    load = MovingPressure(tacton=Tacton(trajectory=ONE_WAY, duration=0.44))
    times = np.arange(4400) / 1e4
    found, expected = model(THIN, load, BESIDE, times).displacement, at_rest(load, times)
    settled = (np.abs(times - 0.410) > 0.010) & (np.abs(times - 0.005) > 0.005)
    assert np.abs(found - expected)[settled].max() < 5e-3 * np.abs(expected).max()
    late = (times > 0.38) & (times < 0.399)  # just before it, where the motion is largest
    assert np.abs(found - expected)[late].max() < 5e-3 * np.abs(expected).max()


def test_jumps_of_a_recording_are_exact_in_time():
    path = Trajectory(
        shape="recorded", points=((0.006, 0.006), (0.006, -0.006), (-0.006, -0.006)) * 2,
        times=(0.0, 0.01055, 0.01055, 0.01705, 0.02203, 0.02203),
    )  # fmt: skip
    held = Tacton(trajectory=replace(path, hold=True), duration=0.06)
    load = MovingPressure(tacton=held, peak_pressure=1.0)
    found, fine = (
        flat_body(THIN, load, BESIDE, np.arange(600 * n) / (1e4 * n)).displacement[::n]
        for n in (1, 8)
    )
    error = np.linalg.norm(found - fine, axis=0) / np.linalg.norm(fine, axis=0)
    assert error.max() < 4e-3
    steady = steady_state(THIN, load, BESIDE, np.arange(600) / 1e4).displacement
    error = np.linalg.norm((found - steady)[300:], axis=0) / np.linalg.norm(steady, axis=0)
    assert error.max() < 2e-3


@pytest.mark.parametrize("order", [0, 2])
def test_rates_are_right_to_the_last_sample(order):
    tacton = Tacton(am_frequency=49.46, duration=0.2)
    load = MovingPressure(tacton=tacton, depth_of_modulation=0.1)  # the start is strong beside it
    asked = (DISPLACEMENT, VELOCITY, ACCELERATION)[order]
    field, times = surface_field(asked, THIN), np.arange(2000) / 1e4
    found, expected = (
        model(field, load, BESIDE, times)[..., 0] for model in (field_history, steady_history)
    )
    differs = (found - expected)[1500:]
    assert np.abs(differs).max() < 1e-3 * np.ptp(expected, axis=0).min()


def test_a_warning_names_lines_that_are_left_out():
    load = MovingPressure(tacton=Tacton(am_frequency=310.0, duration=0.4))
    scene = Scene(pressure=load, body=replace(SKIN, sides="absorbing"))
    found = solved(scene, model="flat-body-harmonic", times=np.arange(200) / 500)
    assert np.ptp(found.values, axis=0).max() < 1e-3 * np.abs(found.values).max()
    assert any("above 250 Hz" in each for each in found.effort.warnings)
    cured = solved(scene, model="flat-body-harmonic", times=np.arange(400) / 1300)
    assert not any("sampling rate" in each for each in cured.effort.warnings)


def test_every_model_returns_the_given_times():
    load = circling(0.005, 6.0)
    load = replace(load, tacton=replace(load.tacton, duration=0.02))
    times = 0.005 + np.arange(30) / 2e3
    for model in ("point-kernel", "flat-body", "flat-body-harmonic", "fem", "fem-transient"):
        body = replace(SKIN, sides="absorbing") if "flat" in model else SKIN
        found = compute(Scene(pressure=load, body=body), model, times=times, h=10e-3)
        np.testing.assert_allclose(found.times, times, atol=1e-12)


def test_tactons_on_a_body_share_its_integrals(monkeypatch):
    module, calls = sys.modules["simple_model.layers.flat_body"], []
    monkeypatch.setattr(module, "point_integrals", lambda *a, **k: calls.append(a[3])
                        or point_integrals(*a, **k))  # fmt: skip
    # Longest first: a shorter path has fewer distances, of the same step.
    found = [
        flat_body(PALM, circling(0.02, speed, am), PROBES, TIMES[:400]).values
        for speed, am in ((12.0, 137.0), (7.0, 80.0), (3.3, 45.5))
    ]
    assert calls == [spot_width(0.2)]
    module._transient.cache_clear()
    alone = flat_body(PALM, circling(0.02, 3.3, 45.5), PROBES, TIMES[:400]).values
    np.testing.assert_array_equal(found[2], alone)
