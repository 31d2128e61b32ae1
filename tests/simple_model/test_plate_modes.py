"""Ritz's method for plates against closed forms, published values and Rayleigh's integral."""

import numpy as np
import pytest
from scipy import sparse
from scipy.integrate import solve_ivp
from scipy.sparse.linalg import eigsh

from simple_model import Material, MovingPressure, PronyTerm, Tacton, Trajectory
from simple_model.load.spectrum import load_lines, reduced_lines
from simple_model.plates.air import air_of
from simple_model.plates.free_modes import free_modes
from simple_model.plates.modes import Plate, modal_motion, plate_modes
from simple_model.plates.path_forces import modal_path_forces
from simple_model.plates.polynomials import line_basis

D, MASS, SIDE = 3.66e-4, 0.08, 0.1  # N m, kg/m2, m


def edges(*supports):
    return dict(zip(("left", "right", "front", "back"), supports, strict=True))


def isotropic(size_x=SIDE, size_y=SIDE, nu=0.3, air_density=0.0, **more):
    return Plate(
        size_x=size_x, size_y=size_y, d11=D, d22=D, d12=nu * D, d66=(1 - nu) / 2 * D,
        mass_per_area=MASS, air_density=air_density, **more,
    )  # fmt: skip


def parameters(plate, finest=350.0):
    """Frequency parameters w a^2 sqrt(m/D), a the length along x."""
    frequencies = plate_modes(plate, finest).frequencies
    return 2 * np.pi * frequencies * plate.size_x**2 * np.sqrt(MASS / D)


def navier(plate, orders=40):
    """Wavenumbers (p, 1) and (1, q) and stiffness (p, q) of a simply supported plate."""
    a = np.arange(1, orders)[:, None] * np.pi / plate.size_x
    b = np.arange(1, orders) * np.pi / plate.size_y
    bending = plate.d11 * a**4 + 2 * (plate.d12 + 2 * plate.d66) * a**2 * b**2 + plate.d22 * b**4
    return a, b, bending + plate.tension_x * a**2 + plate.tension_y * b**2


SIMPLY = Plate(
    size_x=0.12, size_y=0.09, d11=5e-4, d22=2e-4, d12=0.5e-4, d66=1e-4, mass_per_area=MASS,
    tension_x=20.0, tension_y=5.0, air_density=0.0, **edges(*["simply"] * 4),
)  # fmt: skip


def test_simply_supported_orthotropic_stretched_plates_have_their_closed_form():
    _, _, stiffness = navier(SIMPLY)
    exact = np.sort(np.sqrt(stiffness / MASS).ravel()) / (2 * np.pi)
    found = plate_modes(SIMPLY).frequencies
    np.testing.assert_allclose(found[:20], exact[:20], rtol=1e-8)


def hermite_line(length, n):
    """Matrices of cubic Hermite elements of a clamped line: mass, slope, curvature, int N'' N."""
    h, (x, w) = length / n, np.polynomial.legendre.leggauss(4)
    s, w = (x + 1) / 2, w * length / n / 2
    N = np.array([1 - 3 * s**2 + 2 * s**3, h * (s - 2 * s**2 + s**3),
                  3 * s**2 - 2 * s**3, h * (s**3 - s**2)])  # fmt: skip
    slope = np.array([6 * s**2 - 6 * s, h * (1 - 4 * s + 3 * s**2),
                      6 * s - 6 * s**2, h * (3 * s**2 - 2 * s)]) / h  # fmt: skip
    curvature = np.array([12 * s - 6, h * (6 * s - 4), 6 - 12 * s, h * (6 * s - 2)]) / h**2
    found = np.zeros((4, 2 * n + 2, 2 * n + 2))
    for k in range(0, 2 * n, 2):
        for G, (a, b) in zip(found, ((N, N), (slope, slope), (curvature, curvature),
                                     (curvature, N)), strict=True):  # fmt: skip
            G[k : k + 4, k : k + 4] += (a * w) @ b.T
    return [sparse.csr_array(G[2:-2, 2:-2]) for G in found]


def test_clamped_orthotropic_stretched_plates_are_those_of_conforming_elements():
    plate = Plate(
        size_x=0.096, size_y=0.08, d11=8e-4, d22=3e-4, d12=0.9e-4, d66=1.9e-4, mass_per_area=MASS,
        tension_x=12.0, tension_y=45.0, air_density=0.0,
    )  # fmt: skip
    found, errors = plate_modes(plate).frequencies[:8], []
    for n in (12, 24):
        (M, S, C, X), (m, s, c, x) = hermite_line(plate.size_x, n), hermite_line(plate.size_y, n)
        cross = sparse.kron(X, x.T)
        K = plate.d11 * sparse.kron(C, m) + plate.d22 * sparse.kron(M, c)
        K = K + plate.d12 * (cross + cross.T) + 4 * plate.d66 * sparse.kron(S, s)
        K = K + plate.tension_x * sparse.kron(S, m) + plate.tension_y * sparse.kron(M, s)
        squared = eigsh(K.tocsc(), 8, MASS * sparse.kron(M, m).tocsc(), sigma=0.0,
                        return_eigenvectors=False)  # fmt: skip
        errors.append(np.sqrt(np.sort(squared)) / (2 * np.pi) / found - 1)
    assert np.abs(errors[1]).max() < 4e-4
    order = np.log2(errors[0] / errors[1])
    assert (order > 3.4).all()
    assert (order < 4.3).all()


# Leissa, J Sound Vib 31:257 (1973), tables C: nu = 0.3; upper bounds, the free ones of 36 terms.
@pytest.mark.parametrize(
    ("supports", "published", "least", "most"),
    [
        (["clamped"] * 4, [35.992, 73.413, 73.413, 108.27, 131.64], -1e-3, 1e-4),
        (["clamped", "free", "free", "free"], [3.4917, 8.5246, 21.429, 27.331, 31.111], -8e-3, 0),
        (["free"] * 4, [0, 0, 0, 13.489, 19.789, 24.432, 35.024], -1.1e-2, 1e-9),
    ],
)  # fmt: skip
def test_frequencies_of_square_plates_are_those_published(supports, published, least, most):
    found = parameters(isotropic(**edges(*supports)))[: len(published)]
    rigid = np.array(published) == 0
    assert (found[rigid] < 0.05).all()
    error = found[~rigid] / np.array(published)[~rigid] - 1
    assert (error > least).all()
    assert (error < most).all()


def clamped_beam(tension, loss, frequency):
    """Deflection of the middle under 1 Pa by the roots of D (1 + i eta) k^4 - T k^2 = m w^2."""
    stiff, inertia = D * (1 + 1j * loss), MASS * (2 * np.pi * frequency) ** 2
    k = np.sqrt(np.roots([stiff, -tension, -inertia]))
    end = np.cosh(k * SIDE / 2), k * np.sinh(k * SIDE / 2)
    return -1 / inertia + np.linalg.solve(end, [1 / inertia, 0]).sum()


def test_the_loss_of_bending_couples_modes_of_a_stretched_strip():
    tension, loss, width = 20.0, 0.1, 0.02
    strip = isotropic(SIDE, width, nu=0.0, tension_x=tension,
                      **edges("clamped", "clamped", "free", "free"))  # fmt: skip
    modes = plate_modes(strip)
    x, weights = np.polynomial.legendre.leggauss(60)
    shapes = modes.on_grid(x * SIDE / 2, x * width / 2)
    f = np.array([60.0, 150.0, 240.0, 300.0, 380.0, 430.0])
    of_pressure = SIDE * width / 4 * np.outer(weights, weights).ravel() @ shapes
    forces, at = np.tile(of_pressure, (len(f), 1)), modes.at([[0.0, 0.0]])
    exact = [clamped_beam(tension, loss, hz) for hz in f]
    found = (modal_motion(modes, f, forces, lambda w: 1 + 1j * loss) @ at.T)[:, 0]
    np.testing.assert_allclose(found, exact, rtol=4e-3)
    apart = modes.squared * (1 + 1j * loss * modes.elastic) - (2 * np.pi * f[:, None]) ** 2
    assert np.abs((forces / apart @ at.T)[:, 0] / exact - 1).max() > 0.05


def test_air_is_rayleighs_integral():
    # A square piston: iint iint 1/r = 4 a^3 [ln(1 + sqrt 2) + (1 - sqrt 2)/3].
    (even, _) = line_basis(SIDE, ("free", "free"), 20, True)
    piston = 4 * (np.log(1 + np.sqrt(2)) + (1 - np.sqrt(2)) / 3) * SIDE * 1.2 / np.pi
    assert air_of(even, even, 1.2)[0][0, 0] == pytest.approx(piston, rel=3e-3)
    # Many half waves: 2 rho / k, and 2 % more of it at the edges of 31 by 31.
    (line, _) = line_basis(SIDE, ("simply", "simply"), 80, True)
    k2, waves = np.linalg.eigh(line.slope)
    mode = np.kron(waves[:, 15], waves[:, 15])
    found = mode @ air_of(line, line, 1.2)[0] @ mode
    assert 1 < found / (2 * 1.2 / np.sqrt(2 * k2[15])) < 1.02


def test_clips_hold_the_plate_where_they_are():
    corner = 0.045
    clips = tuple((x, y) for x in (-corner, corner) for y in (-corner, corner))
    free = edges(*["free"] * 4)
    modes = plate_modes(isotropic(clips=clips, clip_radius=0.004, **free))
    largest = np.abs(modes.at([[0.0, 0.0], [0.02, 0.0], [0.0, 0.03]])).max()
    assert np.abs(modes.at(clips)).max() < 1e-9 * largest
    assert len(modes.families) == 4
    # Point supports at the four corners: w a^2 sqrt(m/D) = 7.111 (Leissa, Vibration of Plates).
    at_corners = tuple((x, y) for x in (-0.05, 0.05) for y in (-0.05, 0.05))
    assert parameters(isotropic(clips=at_corners, **free))[0] == pytest.approx(7.111, rel=2e-3)


@pytest.mark.parametrize("air_density", [0.0, 1.2])
def test_clips_across_a_strip_clamp_what_is_between_them(air_density):
    free, clamped = edges(*["free"] * 4), edges("clamped", "clamped", "free", "free")
    ends = {"clips": ((-0.045, 0.0), (0.045, 0.0)), "clip_radius": 0.005}
    whole = isotropic(0.1, 0.01, air_density=air_density, **ends, **free)
    between = isotropic(0.08, 0.01, air_density=air_density, **clamped)
    found, exact = (plate_modes(plate).frequencies[:8] for plate in (whole, between))
    np.testing.assert_allclose(found, exact, rtol=2e-4)


def test_the_moving_load_is_that_of_a_fine_grid():
    path = Trajectory(shape="circle", size=0.02, speed=12.0)
    pressure = MovingPressure(tacton=Tacton(am_frequency=140.0, trajectory=path))
    modes = plate_modes(isotropic(0.06, 0.05, air_density=1.2), 150.0)
    middle = np.array([0.004, -0.006])  # the load reaches beyond the plate
    x, y = (middle[k] + (np.arange(n) + 0.5) * 5e-4 - n * 2.5e-4 for k, n in ((0, 120), (1, 100)))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    frequencies, expected = reduced_lines(pressure, grid, modes.at(grid - middle) * 5e-4**2)
    path_forces = modal_path_forces(modes, pressure, middle)
    found_at, found = load_lines(pressure).gather(path_forces)
    np.testing.assert_array_equal(found_at, frequencies)
    strong = np.abs(expected) > 1e-2 * np.abs(expected).max()
    np.testing.assert_allclose(found[strong], expected[strong], rtol=2e-3)


def test_invalid_plates_are_refused():
    given = {"size_x": SIDE, "size_y": SIDE, "d11": D, "d22": D, "d12": 0.0, "d66": D / 2,
             "mass_per_area": MASS}  # fmt: skip
    for change in ({"size_x": 0.0}, {"left": "glued"}, {"clips": ((0.06, 0.0),)}, {"d12": 4e-4}):
        with pytest.raises(ValueError, match="of a plate|glued|off the plate"):
            Plate(**given | change)


@pytest.mark.parametrize(
    "losses",
    [{"viscosity": 20.0}, {"viscosity": 2.0, "prony": (PronyTerm(modulus=5e3, time=1e-3),)}],
)
def test_modes_from_rest_match_ordinary_differential_equations(losses):
    solid = Material(density=1000, shear_modulus=25e3, poisson=0.3, **losses)
    plate = isotropic(nu=0.3, tension_x=20.0)
    one = plate_modes(plate, 60.0)
    free, hertz = free_modes(one, solid), np.array([0.0, 130.0])
    forces = np.ones((2, len(one.squared)), np.complex128) * [[1.0], [0.5 - 0.3j]]
    start, t = free.start(hertz, forces), np.linspace(0, 0.03, 301)
    s = 2j * np.pi * hertz
    bent = solid.complex_modulus(s.imag) / solid.shear_modulus * one.elastic[0]
    steady = forces[:, 0] / (s**2 + one.squared[0] * (1 - one.elastic[0] + bent))
    shown = [(np.exp(np.outer(t, s)) @ (steady * s**k)).real
             + (np.exp(np.outer(t, free.poles[0])) @ (start[0] * free.poles[0]**k)).real
             for k in (0, 1, 2)]  # fmt: skip
    inner = solid.without_loss_factor()
    mu, W, e = solid.shear_modulus, one.squared[0], one.elastic[0]
    tau = np.array([term.time for term in inner.prony])
    g = np.array([term.modulus for term in inner.prony]) / mu

    def rate(t, x):
        u, v, d = x[0], x[1], x[2:]
        pull = W * ((1 - e + e * inner.shear_modulus / mu) * u + e * inner.viscosity / mu * v)
        force = (np.exp(s * t) @ forces[:, 0]).real
        return np.concatenate([[v, force - pull - W * e * (g @ d)], v - d / tau])

    exact = solve_ivp(rate, (0, t[-1]), np.zeros(2 + len(tau)), "LSODA", t_eval=t, rtol=1e-9,
                      atol=1e-13).y  # fmt: skip
    np.testing.assert_allclose(shown[0], exact[0], atol=1e-6 * np.abs(exact[0]).max())
    np.testing.assert_allclose(shown[1], exact[1], atol=1e-6 * np.abs(exact[1]).max())
    assert shown[2][0] == pytest.approx(1.5, rel=1e-9)
