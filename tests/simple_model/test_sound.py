"""Sound and friction of the air around a plate, against closed forms and published values."""

from dataclasses import replace

import numpy as np
import pytest

from simple_model import Material
from simple_model.layers.compliance import AIR_DENSITY, AIR_VISCOSITY
from simple_model.layers.prony import constant_loss
from simple_model.load.focus import SPEED_OF_SOUND
from simple_model.plates.air import air_of
from simple_model.plates.free_modes import free_modes
from simple_model.plates.modes import Plate, modal_motion, plate_modes
from simple_model.plates.polynomials import line_basis

RHO, C = AIR_DENSITY, SPEED_OF_SOUND
SHEET = Plate(
    size_x=0.15, size_y=0.1, d11=1e-3, d22=6e-4, d12=2e-4, d66=3e-4, mass_per_area=0.1,
    tension_x=30.0, tension_y=12.0,
)  # fmt: skip
LOSS = constant_loss(0.03)


def directions(count=24):
    """Unit vectors (n, 2) along the plate of a hemisphere, and weights (n,) of sum 1."""
    cosine, weights = np.polynomial.legendre.leggauss(count)
    cosine, weights = (cosine + 1) / 2, weights / 2
    angle = 2 * np.pi * np.arange(count) / count
    sine = np.sqrt(1 - cosine**2)
    each = np.stack([np.outer(sine, np.cos(angle)), np.outer(sine, np.sin(angle))], axis=-1)
    return each.reshape(-1, 2), np.repeat(weights / count, count)


def grid(plate, count=60):
    """Gauss points (n, 2) of a plate and their areas (n,)."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    x, y = nodes * plate.size_x / 2, nodes * plate.size_y / 2
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return points, np.outer(weights, weights).ravel() * plate.size_x * plate.size_y / 4


def power_of_sound(plate, k0, velocity):
    """Power in W that a field (n,) on the `grid` radiates on both sides, by Rayleigh's integral."""
    (points, areas), (toward, share) = grid(plate), directions()
    far = np.exp(-1j * k0 * toward @ points.T) @ (areas * velocity)
    return RHO * C * k0**2 / (2 * np.pi) * share @ np.abs(far) ** 2


@pytest.mark.parametrize(
    ("ratio", "coefficient"), [(1, 0.579), (1.5, 0.690), (2, 0.757), (4, 0.872)]
)
def test_a_rigid_rectangle_in_open_air_has_its_published_mass(ratio, coefficient):
    # DNV-RP-H103 (2011), table A-2: times rho pi / 4 a^2 b, a < b.
    a, b = 0.1, 0.1 * ratio
    x, y = (line_basis(side, ("free", "free"), 12, True)[0] for side in (b, a))
    mass, (force,), _ = air_of(x, y, RHO, 0.0)
    unit = np.sqrt(a * b)  # the first functions are constant
    assert mass[0, 0] * unit**2 == pytest.approx(RHO * np.pi / 4 * a**2 * b * coefficient, rel=2e-3)
    assert force[0] * unit == pytest.approx(mass[0, 0] * unit**2, rel=1e-9)


def test_waves_of_a_long_strip_in_open_air_have_their_closed_form():
    # Across a strip of width a, sqrt(1 - s^2) U_n(s) accelerates it by (n + 1) U_n(s) / (rho a).
    a, length = 0.02, 2.0
    x, y = (line_basis(side, ("free", "free"), n, True)[0] for side, n in ((length, 4), (a, 8)))
    mass, _, _ = air_of(x, y, RHO, 0.0)
    s, weights = np.polynomial.legendre.leggauss(12)
    for n in (0, 2):
        chebyshev = np.sin((n + 1) * np.arccos(s)) / np.sin(np.arccos(s))
        across = (weights * a / 2 * chebyshev) @ y(s * a / 2)
        along = np.eye(x.size)[0]
        found = np.kron(along, across) @ mass @ np.kron(along, across)
        exact = RHO * a / (n + 1) * a / 2 * np.pi / 2
        assert found == pytest.approx(exact, rel=0.02)


def simply_supported(orders):
    """Loss of the mode (m, n) of a simply supported plate of 150 x 100 mm in a baffle."""
    edges = dict.fromkeys(("left", "right", "front", "back"), "simply")
    still = replace(SHEET, tension_x=0.0, tension_y=0.0, d22=1e-3, d12=3e-4, d66=3.5e-4, **edges)
    modes = plate_modes(replace(still, air_density=1e-9))  # whose mass changes no mode
    k2 = sum((n * np.pi / side) ** 2 for n, side in zip(orders, (0.15, 0.1), strict=True))
    exact = k2**2 * still.d11 / still.mass_per_area
    family, k = next(
        (each, int(k))
        for each in modes.families
        for k in np.flatnonzero(np.isclose(each.squared, exact, rtol=1e-6))
    )
    return replace(
        family.air, density=RHO, patterns=family.air.patterns[:, [k]], areas=family.air.areas[[k]]
    )


@pytest.mark.parametrize("orders", [(1, 1), (1, 3), (2, 1), (2, 2), (3, 2)])
def test_simply_supported_plates_radiate_as_wallace_found(orders):
    """Radiation efficiency of panels, Wallace, J Acoust Soc Am 51:946 (1972), eqs. 1 and 3."""
    loss, (a, b), (m, n) = simply_supported(orders), (0.15, 0.1), orders
    toward, share = directions()

    def efficiency(k0):
        alpha, beta = k0 * a * toward[:, 0], k0 * b * toward[:, 1]
        of = (np.sin, np.cos)  # of even and of odd orders
        pattern = of[m % 2](alpha / 2) * of[n % 2](beta / 2)
        pattern /= ((alpha / m / np.pi) ** 2 - 1) * ((beta / n / np.pi) ** 2 - 1)
        return 32 * k0**2 * a * b / (np.pi**5 * m**2 * n**2) * share @ pattern**2

    k0 = np.array([0.5, 6.0, 18.0])  # 27 to 983 Hz
    sound = loss.of_each(k0 * C) - loss.friction(k0[:, None] * C)
    found = sound[:, 0] / (2 * RHO * C * loss.areas)  # of one side
    np.testing.assert_allclose(found, [efficiency(k) for k in k0], rtol=0.02)
    if m % 2 and n % 2:  # the published series
        first = 32 * k0**2 * a * b / (m**2 * n**2 * np.pi**5)
        first *= 1 - k0**2 * a * b / 12 * (
            (1 - 8 / (m * np.pi) ** 2) * a / b + (1 - 8 / (n * np.pi) ** 2) * b / a
        )
        np.testing.assert_allclose(found[:2], first[:2], rtol=0.02)


def test_a_rigid_force_in_open_air_radiates_as_a_dipole():
    # Half of w^2 F^2 / (12 pi rho c^3) (Pierce, Acoustics (1981), section 4.3).
    modes = plate_modes(replace(SHEET, frame_width=0.0))
    loss, w = modes.families[0].air, np.array([2 * np.pi * 140.0])
    velocity = 1e-3
    force = w[0] * velocity * loss.patterns[0, 0]
    power = (loss.of_each(w) - loss.friction(w[:, None]))[0, 0] * velocity**2 / 2
    assert power == pytest.approx(w[0] ** 2 * force**2 / (24 * np.pi * RHO * C**3), rel=1e-12)


@pytest.mark.parametrize("frame_width", [np.inf, 0.02])
def test_power_of_a_load_is_lost_to_material_friction_and_sound(frame_width):
    modes = plate_modes(replace(SHEET, frame_width=frame_width, edge_loss=2e-3))
    points, areas = grid(SHEET)
    shapes = modes.on_grid(np.unique(points[:, 0].round(12)), np.unique(points[:, 1].round(12)))
    spot = np.exp(-((points - [0.02, 0.01]) ** 2).sum(axis=1) / 2 / 0.004**2)
    forces = np.tile((areas * spot) @ shapes, (3, 1))
    f = np.array([60.0, 97.0, 210.0])
    q = modal_motion(modes, f, forces, LOSS)
    for k, w in enumerate(2 * np.pi * f):
        v = 1j * w * q[k]
        given = (forces[k].conj() @ v).real / 2
        spent = 0.0
        for family, part in modes.parts:
            own = v[part]
            bent = (own.conj() @ family.bending @ own).real
            spent += LOSS(w).imag / w * bent / 2
            spent += (
                (family.air.friction(w) + 2e-3 * np.sqrt(family.squared)) @ np.abs(own) ** 2 / 2
            )
            if frame_width < np.inf:
                force = w * family.air.patterns @ own
                spent += w**2 * np.abs(force).sum() ** 2 / (24 * np.pi * RHO * C**3)
        if frame_width == np.inf:
            spent += power_of_sound(SHEET, w / C, shapes @ v)
        assert spent == pytest.approx(given, rel=1e-9)


def test_the_lowest_mode_decays_by_its_resistance():
    """Friction, and in a baffle w^2 rho V^2 / (pi c) for the volume V that the mode displaces."""
    solid = Material(density=800.0, shear_modulus=1e9, poisson=0.3)
    for frame_width in (np.inf, 0.0):
        modes = plate_modes(replace(SHEET, frame_width=frame_width))
        lowest = int(np.argmin(modes.squared))
        w, loss = np.sqrt(modes.squared[lowest]), modes.families[0].air
        poles = free_modes(modes, solid).poles[lowest]
        points, areas = grid(SHEET)
        volume = areas @ modes.at(points)[:, lowest]
        area = areas @ modes.at(points)[:, lowest] ** 2
        friction = np.sqrt(2 * w * RHO * AIR_VISCOSITY) * area
        sound = w**2 * RHO * volume**2 / (np.pi * C) if frame_width == np.inf else 0.0
        decay = -poles[poles.imag > 0].real.item()
        assert decay == pytest.approx((friction + sound) / 2, rel=0.03)
        assert loss.at_own(np.sqrt(modes.families[0].squared))[lowest] == pytest.approx(2 * decay)


def test_of_two_equal_frequencies_one_mode_radiates():
    """Modes 1, 3 and 3, 1 of a square plate: their sum radiates, their difference does not."""
    square = replace(SHEET, size_x=0.1, size_y=0.1, d11=1e-3, d22=1e-3, d12=3e-4, d66=3.5e-4,
                     tension_x=0.0, tension_y=0.0)  # fmt: skip
    for frame_width in (np.inf, 0.0):
        family = plate_modes(replace(square, frame_width=frame_width)).families[0]
        omega = np.sqrt(family.squared)
        assert omega[2] == pytest.approx(omega[1], rel=0.1)
        silent = np.abs(family.air.patterns[0, 1:3])
        assert silent.min() < 1e-6 * silent.max()


def test_a_frame_in_open_air_acts_on_the_mass_between_none_and_a_baffle():
    found = [
        plate_modes(replace(SHEET, frame_width=width), 150.0).frequencies[0]
        for width in (0.0, 0.025, 0.1, np.inf)
    ]
    assert np.all(np.diff(found) < 0)
    assert found[1] - found[3] < 0.7 * (found[0] - found[3])


@pytest.mark.parametrize("frame_width", [np.inf, 0.02])
def test_all_modes_of_a_large_plate_vibrate(frame_width):
    """Resistance is bounded where wavelengths are too short for the moments of sound."""
    modes = plate_modes(replace(SHEET, size_x=0.4, size_y=0.05, frame_width=frame_width))
    assert np.all(modes.damping < 0.1 * np.sqrt(modes.squared))
    solid = Material(density=800.0, shear_modulus=1e9, poisson=0.3, viscosity=0.1)
    assert np.isfinite(free_modes(modes, solid).residues).all()
