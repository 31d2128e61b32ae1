"""Wavenumber solution of layers: against other codes, closed forms, and limits of itself."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest
from circling import circling
from numpy.polynomial.legendre import Legendre
from scipy.integrate import quad_vec
from scipy.special import exp1, j0

from simple_model import Material, Stack, Trajectory, flat_body
from simple_model.layers.compliance import Compliance, half_space, layered, slab, thin_sheet
from simple_model.layers.flat_body import field_history, field_lines, steady_lines
from simple_model.layers.flat_quantities import motion_field
from simple_model.layers.layered import transfer
from simple_model.layers.material import PRESETS
from simple_model.layers.wavenumber_integral import point_integrals, point_response

WIDTH = 4.35e-3
RADII = np.arange(5) * 5e-3
K = np.geomspace(0.3, 1400, 11)
HERTZ = np.array([1.0, 20, 140, 500, 2000])
PALM = PRESETS["palm"]
SOFT = Material(density=1000, shear_modulus=8e3, viscosity=3.0, poisson=0.49)
STIFF = Material(density=1000, shear_modulus=60e3, viscosity=6.0, poisson=0.49)
ON_STIFF = Stack(materials=(SOFT, STIFF), thicknesses=(3e-3, 12e-3))
IS_EXTENDED = np.finfo(np.longdouble).eps < 1e-18
FOREARM = {"density": 1000, "shear_modulus": 7.86e3, "viscosity": 5.03}
# The published lines are those of one complex modulus at all frequencies, which is not causal.
PAPER = PRESETS["paper"]
HYSTERETIC = replace(
    PAPER, loss_factor=0.0, law=lambda w: PAPER.shear_modulus * (1 + 0.03j * np.sign(np.real(w)))
)


def tissue(shear):
    return Material(density=1000, shear_modulus=shear, viscosity=2e-4 * shear, poisson=0.4999)


SKIN = Stack(
    materials=(tissue(300e3), tissue(30e3), tissue(11e3), tissue(5e3)),
    thicknesses=(0.3e-3, 1e-3, 4e-3, 9.5e-3),
)


def equal(material, *thicknesses, **base):
    return Stack(materials=(material,) * len(thicknesses), thicknesses=thicknesses, **base)


def angular(hertz):
    return 2 * np.pi * np.atleast_1d(hertz)[:, None] + 0j


def by_elements(stack, k, w, order=16):
    """U and W at each interface but a rigid base, by spectral elements in extended precision."""
    roots = Legendre.basis(order).deriv().roots()
    x = np.concatenate([[-1], roots, [1]])
    weights = 2 / (order * (order + 1) * Legendre.basis(order)(x) ** 2)
    values = np.array([Legendre.basis(n)(x) for n in range(order + 1)]).T
    slopes = np.array([Legendre.basis(n).deriv()(x) for n in range(order + 1)]).T
    derivative = (slopes @ np.linalg.inv(values)).astype(np.longdouble)
    derivative -= np.diag(derivative.sum(axis=1))  # of a constant it is 0
    n = order * len(stack.materials) + 1
    matrix = np.zeros((2 * n, 2 * n), np.clongdouble)
    for i, (m, h) in enumerate(zip(stack.materials, stack.thicknesses, strict=True)):
        mu = m.complex_modulus(w)
        lam = mu * 2 * m.poisson / (1 - 2 * m.poisson)
        one, d, zero = np.eye(order + 1), derivative * 2 / h, np.zeros((order + 1, order + 1))
        volume, along = np.hstack([k * one, d]), np.hstack([k * one, zero])
        across, shear = np.hstack([zero, d]), np.hstack([d, -k * one])
        q = np.diag(weights * h / 2)
        stiff = lam * volume.T @ q @ volume + mu * shear.T @ q @ shear
        stiff += 2 * mu * (along.T @ q @ along + across.T @ q @ across)
        stiff -= m.density * w**2 * np.kron(np.eye(2), q)
        nodes = i * order + np.arange(order + 1)
        at = np.concatenate([nodes, n + nodes])
        matrix[np.ix_(at, at)] += stiff
    free = np.arange(2 * n)
    matrix[[n - 1, 2 * n - 1], [n - 1, 2 * n - 1]] += stack.base_stiffness
    if stack.base == "clamped":
        free = free[(free != n - 1) & (free != 2 * n - 1)]
    load = np.zeros(2 * n)
    load[n] = 1
    u = np.zeros(2 * n, np.clongdouble)
    held = matrix[np.ix_(free, free)]
    inverse = np.linalg.inv(held.astype(complex))
    for _ in range(6):
        u[free] += inverse @ (load[free] - held @ u[free])
    return u.reshape(2, n)[:, ::order].astype(complex)


@pytest.mark.parametrize(("poisson", "depth"), [(0.3, 60e-3), (0.4999, 0.3e-3)])
def test_equal_layers_make_a_slab(poisson, depth):
    solid = replace(PALM, poisson=poisson)
    k, w = K + 2j, angular(HERTZ[1:])
    one = slab(solid, depth)(k, w)
    parts = np.array([0.01, 0.29, 0.5, 0.2]) * depth
    np.testing.assert_allclose(layered(equal(solid, *parts))(k, w), one, rtol=1e-9)


def test_waves_of_a_layer_converge_to_statics():
    for depth in (0.1e-3, 15e-3, 1.0):
        w = np.array([0, 1e-9, 1e-6, 1e-3])[:, None] + 0j
        found = slab(replace(PALM, viscosity=0.0), depth)(K + 2j, w)
        np.testing.assert_allclose(found, np.broadcast_to(found[0], found.shape), rtol=1e-6)
    rest = layered(equal(PALM, 1e-3, inf))(K + 0j, np.zeros((1, 1), complex))
    np.testing.assert_allclose(rest[0], (1 - PALM.poisson) / (PALM.shear_modulus * K), rtol=1e-8)


@pytest.mark.parametrize(
    ("stack", "most"),
    [
        (SKIN, 3e-5),
        (replace(SKIN, base="free"), 3e-5 if IS_EXTENDED else 3e-3),  # at 1 Hz
        (replace(SKIN, base="elastic", base_stiffness=2e6), 3e-5),
        (ON_STIFF, 1e-6),
    ],
    ids=["skin", "free", "elastic", "soft-on-stiff"],
)
def test_layers_match_spectral_elements_in_depth(stack, most):
    depths = np.concatenate([[0.0], np.cumsum(stack.thicknesses)])
    if stack.base == "clamped":
        depths = depths[:-1]
    found = transfer(stack, depths)(K + 0j, angular(HERTZ))
    expected = np.empty((2, len(depths), len(HERTZ), len(K)), complex)
    for i, hertz in enumerate(HERTZ):
        for j, k in enumerate(K):
            expected[:, :, i, j] = by_elements(stack, k, 2 * np.pi * hertz)[:, : len(depths)]
    largest = np.abs(expected).max(axis=(0, 1))
    assert (np.abs(found[:2] - expected).max(axis=(0, 1)) / largest).max() < most
    np.testing.assert_allclose(found[2:, 0, ..., :], [-np.ones(found.shape[2:]), 0 * found[0, 0]])
    if stack.base == "free":
        assert np.abs(found[2:, -1]).max() < 1e-12


def test_stresses_at_depth_follow_from_the_motion():
    z, h, w = 2.1e-3, 1e-6, angular([30.0, 300.0])
    U, W, N, T = np.moveaxis(transfer(SKIN, [z - h, z, z + h])(K, w), 1, 1)
    mu = SKIN.materials[2].complex_modulus(w)
    lam = mu * 2 * 0.4999 / (1 - 2 * 0.4999)
    wider = K * U[1] + (W[2] - W[0]) / (2 * h)
    sheared = (U[2] - U[0]) / (2 * h) - K * W[1]
    normal = lam * wider + 2 * mu * (W[2] - W[0]) / (2 * h)
    np.testing.assert_allclose(mu * sheared, T[1], rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(normal, N[1], rtol=0.01, atol=1e-3)


def test_frequencies_of_a_transient_are_interpolated_where_they_are_smooth():
    integrated, whole = [], layered(SKIN)

    def answer(k, w):
        integrated.append(w.ravel())
        return whole(k, w)

    body = Compliance(answer, whole.clearance)
    w = 2 * np.pi * np.arange(80.0, 208.0, 0.5) - 6j
    found = point_response(body, RADII, w, WIDTH)
    # Without its neighbours a frequency is integrated by itself.
    one_by_one = point_response(whole, RADII, w[::5], WIDTH)
    assert np.abs(found[::5] - one_by_one).max() < 1e-8 * np.abs(found).max()
    assert np.isin(w, np.concatenate(integrated)).mean() < 0.25


@pytest.mark.parametrize(
    ("stack", "hertz"),
    [
        (SKIN, 400.0),
        (Stack(materials=(SOFT, STIFF), thicknesses=(5e-3, inf)), 300.0),
        (equal(replace(PALM, viscosity=0.5, poisson=0.35), 5e-3, 10e-3), 165.0),  # runs backwards
    ],
)
def test_the_path_of_integration_avoids_all_poles(stack, hertz):
    body, r = layered(stack), 0.02

    def integrand(k):
        spot = 2 * np.pi * WIDTH**2 * np.exp(-((k * WIDTH) ** 2) / 2)
        return spot * body(np.array([k + 0j]), angular(hertz))[0, 0] * j0(k * r) * k / 2 / np.pi

    expected, _ = quad_vec(integrand, 0, 6.5 / WIDTH, epsrel=1e-6, limit=500)
    found = point_response(body, [0.0, r], [2 * np.pi * hertz], WIDTH)
    assert found[0, 1] == pytest.approx(expected, rel=1e-4)


def point_motion(stack, distances, frequencies, *, depth=0.0):
    """Displacement (2, f, r) in m/Pa outwards and downwards about a focal spot of 1 Pa."""
    found = point_integrals(motion_field(stack, depth), distances, frequencies, WIDTH)
    found[0] *= np.atleast_1d(distances)
    return found


def test_components_at_depth_match_an_integral_over_the_path():
    probe, depth = np.array([0.013, 0.004]), 1.5e-3
    load = circling(0.02, 6, am=140, peak_pressure=50.0, drive="linear")
    f, a = field_lines(motion_field(SKIN, depth), load, [probe])
    line = np.argmin(np.abs(f - 140))
    knots = load.tacton.trajectory.at_phase((np.arange(240) + 0.5) / 240)
    away = probe - knots
    r = np.linalg.norm(away, axis=1)
    outwards, down = point_motion(SKIN, r, [2 * np.pi * f[line]], depth=depth)[:, 0]
    mean = np.mean([outwards * away[:, 0] / r, outwards * away[:, 1] / r, down], axis=1)
    gain = load.gain(np.arange(400) / 400 / 140)
    strength = 2 * np.mean(gain * np.exp(-2j * np.pi * np.arange(400) / 400))
    np.testing.assert_allclose(a[line, 0], strength * mean, rtol=1e-3, atol=1e-3 * abs(mean[2]))


def test_motion_from_rest_settles_and_a_recorded_circle_matches():
    load, times = circling(0.02, 6, am=140, peak_pressure=50.0), np.arange(600) / 4000
    probes = [[0.005, 0.0], [0.013, 0.004]]
    found = field_history(motion_field(SKIN, 1.5e-3), load, probes, times)
    f, a = field_lines(motion_field(SKIN, 1.5e-3), load, probes)
    steady = np.einsum("fpm,tf->tpm", a, np.exp(2j * np.pi * f * times[:, None])).real
    assert np.abs(found - steady)[400:].max() < 5e-3 * np.abs(steady).max()
    assert np.abs(found[..., 1]).max() > 0.05 * np.abs(found[..., 2]).max()
    path = load.tacton.trajectory
    period = 1 / path.drawing_frequency
    t = np.linspace(0, period, 513)
    points = tuple(map(tuple, path.at_phase(t / period % 1).tolist()))
    recorded = Trajectory(shape="recorded", points=points, times=tuple(t.tolist()))
    again = replace(load, tacton=replace(load.tacton, trajectory=recorded))
    other = field_history(motion_field(SKIN, 1.5e-3), again, probes, times)
    assert np.abs(found - other).max() < 5e-3 * np.abs(found).max()
    surface = field_history(motion_field(SKIN), load, probes, times)[..., 2]
    waves = flat_body(layered(SKIN), load, probes, times).displacement
    assert np.abs(surface - waves).max() < 1e-6 * np.abs(waves).max()


def test_a_depth_outside_the_stack_is_refused():
    for depth in (-1e-3, 0.02, inf):
        with pytest.raises(ValueError, match="is outside a stack of 14.8 mm"):
            transfer(SKIN, [depth])


def test_a_free_stack_follows_slow_lines_as_a_thin_plate():
    """q / 4 pi D b [e^-x E1(-x) - e^x E1(x)] / 2, b^2 = m w^2 / D, x = b width^2 / 2."""
    solid, depth, w = replace(PALM, viscosity=0.0, loss_factor=1e-3), 1e-3, 2 * np.pi * 0.49
    free = Stack(materials=(solid,), thicknesses=(depth,), base="free")
    bending = solid.complex_modulus(w) * depth**3 / (6 * (1 - solid.poisson))
    b = np.sqrt(solid.density * depth * w**2 / bending)
    x = b * WIDTH**2 / 2
    plate = WIDTH**2 / (4 * bending * b) * (np.exp(-x) * exp1(-x) - np.exp(x) * exp1(x))
    assert point_response(layered(free), [0.0], [w], WIDTH)[0, 0] == pytest.approx(plate, rel=2e-3)
    assert point_motion(free, [0.0], [w])[1, 0, 0] == pytest.approx(plate, rel=2e-3)


def test_a_free_stack_has_no_static_deflection():
    free = Stack(materials=(PALM,), thicknesses=(0.015,), base="free")
    assert not point_motion(free, [0.005], [0.0]).any()
    with pytest.raises(ArithmeticError, match="give a free slab a base"):
        point_motion(free, [0.005], [2e-4 * np.pi])


def test_deflection_is_greatest_when_the_focus_keeps_up_with_the_surface_wave():
    speeds, table = [1, 3, 5, 8, 18], [0.362, 0.409, 0.309, 0.194, 0.120]
    body, radius = half_space(Material(**FOREARM, poisson=0.49), poisson=0.5), 0.1 / 2 / np.pi
    peaks = []
    for speed in speeds:
        f, a = steady_lines(body, circling(2 * radius, speed), [[radius, 0.0]])
        t = np.linspace(0, 0.1 / speed, 400)[:, None]
        peaks.append(1e6 * np.real(a[:, 0] * np.exp(2j * np.pi * f * t)).sum(axis=1).max())
    np.testing.assert_allclose(peaks, table, rtol=0.01)


def test_f_am_is_not_the_highest_line_of_a_paper_sheet():
    """d = 30 mm on the path: f_d and the difference line beat f_AM, as published."""
    f, a = steady_lines(thin_sheet(HYSTERETIC, 1e-4), circling(0.03, 18, am=140), [[0.015, 0.0]])
    line = {hz: abs(a[np.argmin(abs(f - hz)), 0]) for hz in (140, 190.986, 50.986, 330.986, 280)}
    ratios = np.array(list(line.values())) / line[140]
    np.testing.assert_allclose(ratios, [1, 1.07, 2.05, 0.33, 0.04], atol=0.01)
