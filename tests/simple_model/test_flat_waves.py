"""Wavenumber integrals of infinite layers: response to a moving focus, and limits of each other."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.special import j0

from simple_model import Material, MovingPressure, Tacton, Trajectory, flat_body, point_kernel
from simple_model.layers.compliance import half_space, slab, thin_sheet
from simple_model.layers.flat_body import steady_lines
from simple_model.layers.material import PRESETS
from simple_model.layers.wavenumber_integral import point_response

FOREARM = {"density": 1000, "shear_modulus": 7.86e3, "viscosity": 5.03}
PAPER = thin_sheet(PRESETS["paper"], 1e-4)
# The published lines are those of one complex modulus at all frequencies, which is not causal.
HYSTERETIC = thin_sheet(
    replace(
        PRESETS["paper"], loss_factor=0.0,
        law=lambda w: PRESETS["paper"].shear_modulus * (1 + 0.03j * np.sign(np.real(w))),
    ),
    1e-4,
)  # fmt: skip
WIDTH = 4.35e-3
RADII = np.array([0, 5, 10, 15, 20, 30]) * 1e-3


def static(compliance, radii, hz=0.0):
    return 1e6 * np.abs(point_response(compliance, radii, [2 * np.pi * hz], WIDTH)[0])


def circling(size, speed, am=0.0, **load):
    path = Trajectory(shape="circle", size=size, speed=speed)
    return MovingPressure(
        tacton=Tacton(am_frequency=am, trajectory=path), **{"peak_pressure": 1.0} | load
    )


def test_deflection_is_greatest_when_the_focus_keeps_up_with_the_surface_wave():
    speeds, table = [1, 3, 5, 8, 18], [0.362, 0.409, 0.309, 0.194, 0.120]
    body, radius = half_space(Material(**FOREARM, poisson=0.49), poisson=0.5), 0.1 / 2 / np.pi
    peaks = []
    for speed in speeds:
        f, a = steady_lines(body, circling(2 * radius, speed), [[radius, 0.0]])
        t = np.linspace(0, 0.1 / speed, 400)[:, None]
        peaks.append(1e6 * np.real(a[:, 0] * np.exp(2j * np.pi * f * t)).sum(axis=1).max())
    np.testing.assert_allclose(peaks, table, rtol=0.01)


def test_the_paper_sheet_contradicts_that_f_am_is_always_highest():
    """d = 30 mm on the path: f_d and the difference line beat f_AM, as published."""
    f, a = steady_lines(HYSTERETIC, circling(0.03, 18, am=140), [[0.015, 0.0]])
    line = {hz: abs(a[np.argmin(abs(f - hz)), 0]) for hz in (140, 190.986, 50.986, 330.986, 280)}
    ratios = np.array(list(line.values())) / line[140]
    np.testing.assert_allclose(ratios, [1, 1.07, 2.05, 0.33, 0.04], atol=0.01)


def test_a_deep_slab_is_a_half_space_and_a_shallow_one_is_stiffer():
    w = 2 * np.pi * np.array([60.0, 140.0, 300.0])
    space = point_response(half_space(Material(**FOREARM, poisson=0.49)), RADII, w, WIDTH)
    deep = point_response(slab(Material(**FOREARM, poisson=0.49), 1.0), RADII, w, WIDTH)
    np.testing.assert_allclose(deep, space, rtol=1e-3, atol=1e-5 * abs(space).max())
    rest = static(slab(Material(**FOREARM, poisson=0.4999), 0.005), RADII)
    assert rest[0] < 0.6 * static(half_space(Material(**FOREARM, poisson=0.4999)), [0.0])[0]


def test_a_transient_settles_into_the_steady_state():
    body = slab(PRESETS["palm"], 0.015)
    load = circling(0.02, 12, am=140, drive="pressure_squared")
    probes, times = [[0.0, 0.0], [0.01, 0.0], [0.02, 0.0]], np.arange(4000) / 1e4
    found = flat_body(body, load, probes, times).displacement
    f, a = steady_lines(body, load, probes)
    steady = np.einsum("fp,tf->tp", a, np.exp(2j * np.pi * f * times[:, None])).real
    late = slice(3000, None)
    misfit = np.linalg.norm((found - steady)[late], axis=0) / np.linalg.norm(steady[late], axis=0)
    assert misfit.max() < 2e-3
    assert np.abs(found[0]).max() < 2e-3 * np.abs(found).max()  # from rest


def test_waves_arrive_when_they_can():
    """A step load moves a point at 40 mm only after the Rayleigh wave's travel time."""
    body = half_space(Material(density=1000, shear_modulus=25e3, poisson=0.4999, viscosity=0.5))
    times = np.arange(600) / 2e4
    load = MovingPressure(tacton=Tacton(duration=0.03))
    x = flat_body(body, load, [[0.04, 0.0]], times).displacement[:, 0]
    arrival = times[np.argmax(np.gradient(x))]
    assert arrival == pytest.approx(0.04 / 4.776, abs=0.0015)


def test_flat_bodies_take_a_gaussian_focus_only():
    load = MovingPressure(tacton=Tacton(), profile="array")
    with pytest.raises(ValueError, match="use 'gaussian'"):
        flat_body(PAPER, load, [[0.0, 0.0]], np.arange(100) / 1e4)


def test_load_lines_add_up_to_the_load():
    from simple_model.load.path_cells import path_fourier, path_samples
    from simple_model.load.spectrum import load_lines

    load = circling(0.02, 12, am=140, drive="pressure_squared")
    points, times = np.array([[0.01, 0.0], [0.0, 0.004]]), np.arange(300) / 1e4
    lines = load_lines(load, 1e-8)
    spots = path_fourier(load, load.spot(points, path_samples(load)).T)  # (point, n)
    waves = lines.coefficients * np.exp(2j * np.pi * lines.frequencies * times[:, None])
    summed = (waves @ spots[:, lines.harmonics].T).real
    np.testing.assert_allclose(summed, point_kernel(load, points, times).displacement, atol=1e-6)


@pytest.mark.parametrize(
    ("poisson", "depth", "viscosity", "frequency"),
    [
        (0.35, 0.015, 0.5, 165.0),  # runs backwards
        (0.4999, 0.030, 5.0, 85.0),  # is about to
        (0.30, 0.100, 1.0, 14.0),
    ],
)
def test_every_wave_of_a_layer_is_on_its_side_of_the_path(poisson, depth, viscosity, frequency):
    """Compared with the integral along the real axis itself."""
    solid = Material(density=1000, shear_modulus=25e3, poisson=poisson, viscosity=viscosity)
    layer = slab(solid, depth)
    w, width, r = np.array([2 * np.pi * frequency + 0j]), 4.35e-3, 0.02

    def integrand(k):
        spot = 2 * np.pi * width**2 * np.exp(-((k * width) ** 2) / 2)
        return spot * layer(np.array([k + 0j]), w[:, None])[0, 0] * j0(k * r) * k / 2 / np.pi

    expected, _ = quad_vec(integrand, 0, 6.5 / width, epsrel=1e-7, limit=2000)
    found = point_response(layer, [0.0, r], w, width)
    assert found[0, 1] == pytest.approx(expected, rel=1e-4)
