"""Exact waves of endless bodies, against closed forms, published tables and each other."""

import numpy as np
import pytest

from simple_model import MovingPressure, Tacton, Trajectory, flat_body, point_kernel
from simple_model.flat_body import (
    half_space,
    point_response,
    slab,
    steady_lines,
    thin_sheet,
)

FOREARM = {"density": 1000, "shear_modulus": 7.86e3, "viscosity": 5.03}
PALM = {"density": 1000, "shear_modulus": 25e3, "viscosity": 5.0}
PAPER = thin_sheet(bending_stiffness=4e9 * 1e-12 / 12 / 0.91, mass_per_area=0.08, loss_factor=0.03)
WIDTH = 4.35e-3
RADII = np.array([0, 5, 10, 15, 20, 30]) * 1e-3


def static(compliance, radii, hz=0.0):
    return 1e6 * np.abs(point_response(compliance, radii, [2 * np.pi * hz], WIDTH)[0])


def circling(size, speed, am=0.0, **load):
    path = Trajectory(shape="circle", size=size, speed=speed)
    return MovingPressure(
        tacton=Tacton(am_frequency=am, trajectory=path), **{"peak_pressure": 1.0} | load
    )


def test_a_focus_at_rest_is_the_closed_form():
    for poisson in (0.0, 0.3, 0.49, 0.5):
        found = static(half_space(**FOREARM, poisson=poisson), [0.0])[0]
        assert found == pytest.approx(
            1e6 * (1 - poisson) * WIDTH * np.sqrt(np.pi / 2) / 7.86e3, rel=1e-5
        )


@pytest.mark.parametrize(
    ("hz", "expected"),
    [
        (20, [0.3403, 0.2494, 0.1326, 0.0828, 0.0619, 0.0431]),
        (80, [0.2636, 0.1755, 0.0812, 0.0550, 0.0407, 0.0187]),
        (140, [0.1729, 0.1000, 0.0368, 0.0238, 0.0120, 0.0030]),
        (191, [0.1188, 0.0622, 0.0193, 0.0120, 0.0054, 0.0021]),
        (210, [0.1040, 0.0528, 0.0157, 0.0097, 0.0045, 0.0015]),
    ],
)
def test_a_focus_on_the_forearm_is_the_published_table(hz, expected):
    found = static(half_space(**FOREARM, poisson=0.5), RADII, hz)
    np.testing.assert_allclose(found, expected, rtol=0.01, atol=6e-5)


def test_phase_lags_as_published():
    g = point_response(
        half_space(**FOREARM, poisson=0.5),
        [0.0],
        2 * np.pi * np.array([20, 80, 140, 191, 210]),
        WIDTH,
    )
    np.testing.assert_allclose(
        np.degrees(np.angle(g[:, 0])), [-16.2, -60.0, -91.5, -109.1, -114.1], atol=0.1
    )


@pytest.mark.parametrize(
    ("hz", "expected"),
    [
        (80, [4.12, 3.92, 3.46, 2.93, 2.46]),
        (140, [2.33, 2.17, 1.81, 1.44, 1.17]),
        (210, [1.52, 1.38, 1.08, 0.82, 0.66]),
    ],
)
def test_a_focus_on_paper_with_air_is_the_published_row(hz, expected):
    np.testing.assert_allclose(static(PAPER, RADII[:5], hz), expected, rtol=0.01)


def test_deflection_is_greatest_when_the_focus_keeps_up_with_the_surface_wave():
    speeds = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 15, 18]
    table = [
        0.362,
        0.402,
        0.409,
        0.366,
        0.309,
        0.260,
        0.222,
        0.194,
        0.175,
        0.162,
        0.146,
        0.130,
        0.120,
    ]
    body, radius = half_space(**FOREARM, poisson=0.5), 0.1 / 2 / np.pi
    peaks = []
    for speed in speeds:
        f, a = steady_lines(body, circling(2 * radius, speed), [[radius, 0.0]])
        t = np.linspace(0, 0.1 / speed, 400)[:, None]
        peaks.append(1e6 * np.real(a[:, 0] * np.exp(2j * np.pi * f * t)).sum(axis=1).max())
    np.testing.assert_allclose(peaks, table, rtol=0.01)


@pytest.mark.parametrize(
    ("size", "speed", "expected"),
    [
        (0.01, 6, [0.422, 0.07, 0.01]),
        (0.02, 12, [0.970, 0.19, 0.05]),
        (0.03, 18, [1.136, 0.30, 0.11]),
    ],
)
def test_a_circling_focus_on_paper_has_the_published_harmonics(size, speed, expected):
    f, a = steady_lines(PAPER, circling(size, speed), [[size / 2, 0.0]])
    found = [1e6 * abs(a[np.argmin(abs(f - n * 190.98593)), 0]) for n in (1, 2, 3)]
    assert found[0] == pytest.approx(expected[0], rel=0.01)
    np.testing.assert_allclose(np.array(found[1:]) / found[0], expected[1:], atol=0.006)


def test_the_paper_sheet_contradicts_that_f_am_is_always_highest():
    """d = 30 mm on the path: f_d and the difference line beat f_AM, as published."""
    f, a = steady_lines(PAPER, circling(0.03, 18, am=140), [[0.015, 0.0]])
    line = {hz: abs(a[np.argmin(abs(f - hz)), 0]) for hz in (140, 190.986, 50.986, 330.986, 280)}
    ratios = np.array(list(line.values())) / line[140]
    np.testing.assert_allclose(ratios, [1, 1.07, 2.05, 0.33, 0.04], atol=0.01)


def test_a_deep_slab_is_a_half_space_and_a_shallow_one_is_stiffer():
    w = 2 * np.pi * np.array([60.0, 140.0, 300.0])
    space = point_response(half_space(**FOREARM, poisson=0.49), RADII, w, WIDTH)
    deep = point_response(slab(**FOREARM, poisson=0.49, depth=1.0), RADII, w, WIDTH)
    np.testing.assert_allclose(deep, space, rtol=1e-3, atol=1e-5 * abs(space).max())
    rest = static(slab(**FOREARM, poisson=0.4999, depth=0.005), RADII)
    assert rest[0] < 0.6 * static(half_space(**FOREARM, poisson=0.4999), [0.0])[0]


def test_a_slabs_resonance_is_its_quarter_wave():
    """Uniform pressure on a column, nu = 0: thickness resonance at c_p / 4 H."""
    body = slab(density=1000, shear_modulus=25e3, poisson=0.0, depth=0.02, loss_factor=0.02)
    hz = np.linspace(40, 140, 2001)
    g = body(np.array([1e-3 + 0j]), 2 * np.pi * hz[:, None].astype(complex))
    c_p = np.sqrt(2 * 25e3 / 1000)
    assert hz[np.argmax(np.abs(g[:, 0]))] == pytest.approx(c_p / 4 / 0.02, rel=2e-3)


@pytest.mark.parametrize(
    "body",
    [half_space(**PALM, poisson=0.4999), slab(**PALM, poisson=0.4999, depth=0.015)],
    ids=["half-space", "slab"],
)
def test_a_transient_settles_into_the_steady_state(body):
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
    """A push that starts at once is felt at 40 mm only after the Rayleigh wave's travel time."""
    body = half_space(density=1000, shear_modulus=25e3, poisson=0.4999, viscosity=0.5)
    times = np.arange(600) / 2e4
    load = MovingPressure(tacton=Tacton(duration=0.03))
    x = flat_body(body, load, [[0.04, 0.0]], times).displacement[:, 0]
    arrival = times[np.argmax(np.gradient(x))]
    assert arrival == pytest.approx(0.04 / 4.776, abs=0.0015)


def test_flat_bodies_take_a_gaussian_focus_only():
    load = MovingPressure(tacton=Tacton(), focus="array")
    with pytest.raises(ValueError, match="use 'gaussian'"):
        flat_body(PAPER, load, [[0.0, 0.0]], np.arange(100) / 1e4)


def test_load_lines_add_up_to_the_load():
    from simple_model.steady import along_path, load_lines, path_knots

    load = circling(0.02, 12, am=140, drive="pressure_squared")
    points, times = np.array([[0.01, 0.0], [0.0, 0.004]]), np.arange(300) / 1e4
    lines = load_lines(load, 1e-8)
    spots = along_path(load.spot(points, path_knots(load)).T)  # (point, n)
    waves = lines.coefficients * np.exp(2j * np.pi * lines.frequencies * times[:, None])
    summed = (waves @ spots[:, lines.harmonics].T).real
    np.testing.assert_allclose(summed, point_kernel(load, points, times).displacement, atol=1e-6)
