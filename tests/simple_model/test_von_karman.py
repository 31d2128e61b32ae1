"""Von Karman's plate in modes, against published tables, closed forms and least energies."""

from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import pytest
from circling import circling
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize

from simple_model import from_young
from simple_model.load.spectrum import load_lines, synthesise
from simple_model.plates.karman_motion import linear_motion, stretched_motion
from simple_model.plates.modes import Plate, modal_motion, plate_modes
from simple_model.plates.path_forces import modal_path_forces
from simple_model.plates.polynomials import gauss_points
from simple_model.plates.von_karman import karman_plate
from skinwave.bodies.supports import Mounting
from skinwave.planning.simulate import compute
from skinwave.results.comparison import compare
from skinwave.scene.scene import BODIES, Scene

YOUNG, THICKNESS, SIDE, MASS = 4e9, 1e-4, 0.1, 0.08  # Pa, m, m, kg/m2
FRAME = ("left", "right", "front", "back")
ORTHOTROPIC = Plate(
    size_x=0.12, size_y=0.09, d11=5e-4, d22=2e-4, d12=0.5e-4, d66=1e-4, mass_per_area=MASS,
    air_density=0.0, tension_x=3.0, tension_y=1.0, **dict.fromkeys(FRAME, "simply"),
)  # fmt: skip
# q a^4 / E h^4 and w / h of a clamped square plate, immovable in its plane, nu = 0.316: S. Levy,
# Square Plate with Clamped Edges under Normal Pressure Producing Large Deflections, NACA TN 847
# (1942). His few terms are too soft at large deflection: by 1.1 % at 0.9 h and 2.5 % at 1.9 h
# compared with the least energy in cosines below.
LEVY = ((38.3, 0.471), (134.9, 1.121), (402.0, 1.902))
PLASTIC = from_young(young=YOUNG, poisson=0.3, density=800, loss_factor=0.1, viscosity=1e5)
DULL = from_young(young=YOUNG, poisson=0.3, density=800, loss_factor=0.6, viscosity=1e5)
LOSSLESS = from_young(young=YOUNG, poisson=0.3, density=800)


def framed(support, nu=0.3, **more):
    D = YOUNG * THICKNESS**3 / 12 / (1 - nu**2)
    return Plate(
        size_x=SIDE, size_y=SIDE, d11=D, d22=D, d12=nu * D, d66=(1 - nu) / 2 * D,
        mass_per_area=MASS, air_density=0.0, **dict.fromkeys(FRAME, support), **more,
    )  # fmt: skip


@lru_cache
def reduced(plate, count, in_plane="held"):
    return karman_plate(plate_modes(plate), THICKNESS, count, in_plane=in_plane)


def resting(karman, forces):
    """Coordinates (m,) under constant forces: of modes that stretch, where the energy is least."""
    scale, own = np.sqrt(karman.squared), forces[karman.chosen]

    def energy(x):
        z, G = x / scale, karman.gradients(x / scale)
        y = G @ z / 2
        value = z @ (karman.squared * z) / 2 + y @ y / 2 - own @ z
        slope = (karman.squared * z + y @ G - own) / scale
        curvature = np.diag(karman.squared) + np.tensordot(y, karman.H, axes=1) + G.T @ G
        return value, slope, curvature / np.outer(scale, scale)

    unit = float(np.linalg.norm(own / scale))
    found = minimize(
        lambda x: energy(unit * x)[0] / unit**2, np.zeros(len(own)), method="trust-exact",
        jac=lambda x: energy(unit * x)[1] / unit, hess=lambda x: energy(unit * x)[2],
        options={"gtol": 1e-9},
    )  # fmt: skip
    q = forces / karman.modes.squared
    q[karman.chosen] = unit * found.x / scale
    return q


def middle_deflection(karman, pressure):
    plate = karman.modes.plate
    (x, of_x), (y, of_y) = (
        gauss_points(np.array([-size / 2, size / 2]), [80]) for size in (plate.size_x, plate.size_y)
    )
    forces = np.outer(of_x, of_y).ravel() @ karman.modes.on_grid(x, y)
    q = resting(karman, pressure * forces)
    return float(karman.modes.at([[0.0, 0.0]])[0] @ q) / THICKNESS


def strip_deflection(pressure, D, stretching, length, tension, clamped):
    """D w'''' - T w'' = q; Timoshenko and Woinowsky-Krieger (1959), articles 2 and 3."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    a = length / 2

    def bent(T):
        k = np.sqrt(T / D)
        if clamped:
            slope = -nodes * a + a * np.sinh(k * nodes * a) / np.sinh(k * a)
            middle = a**2 / 2 - a / k * (np.cosh(k * a) - 1) / np.sinh(k * a)
        else:
            slope = -nodes * a + np.sinh(k * nodes * a) / k / np.cosh(k * a)
            middle = a**2 / 2 - (1 - 1 / np.cosh(k * a)) / k**2
        return pressure / T * middle, stretching / 4 * (pressure / T) ** 2 * slope**2 @ weights

    T = brentq(lambda T: tension + bent(T)[1] - T, 1e-3 * D / a**2, 1e5 * D / a**2, rtol=1e-13)
    return bent(T)[0]


@pytest.mark.parametrize(("support", "tension"), [("clamped", 0.0), ("simply", 2.0)])
def test_a_strip_between_two_edges_stretches_as_in_its_closed_form(support, tension):
    D = YOUNG * THICKNESS**3 / 12
    plate = Plate(
        size_x=SIDE, size_y=0.02, d11=D, d22=D, d12=0.0, d66=D / 2, mass_per_area=MASS,
        air_density=0.0, left=support, right=support, front="free", back="free", tension_x=tension,
    )  # fmt: skip
    karman = reduced(plate, 30)
    for pressure, tolerance in ((0.05, 1e-4), (1.0, 5e-4), (10.0, 3e-3)):
        given = D, YOUNG * THICKNESS, SIDE, tension, support == "clamped"
        exact = strip_deflection(pressure, *given)
        found = middle_deflection(karman, pressure) * THICKNESS
        assert found == pytest.approx(exact, rel=tolerance)


def least_energy_deflection(plate, pressure, terms, guess):
    """Middle in a frame, over the thickness: w, u, v by Newton's method in sines or 1 - cos."""
    a, b = plate.size_x, plate.size_y
    nodes, weights = np.polynomial.legendre.leggauss(4 * terms + 4)
    s, weights = (nodes + 1) / 2, weights / 2
    odd, even = 2 * np.arange(terms) + 1, 2 * np.arange(terms) + 2

    def sines(orders):
        k = np.pi * orders
        return np.sin(np.outer(s, k)), np.cos(np.outer(s, k)) * k, -np.sin(np.outer(s, k)) * k**2

    def on_grid(x, y, dx, dy):
        found = np.einsum("pi,qj->pqij", x[dx] / a**dx, y[dy] / b**dy)
        return found.reshape(len(s) ** 2, -1)

    def raised(orders):
        k = np.pi * orders
        return (1 - np.cos(np.outer(s, k)), np.sin(np.outer(s, k)) * k,
                np.cos(np.outer(s, k)) * k**2)  # fmt: skip

    o, e = sines(odd), sines(even)
    deflected = raised(even) if plate.left == "clamped" else o
    w, wx, wy, wxx, wyy, wxy = (on_grid(deflected, deflected, *d) for d in
                                ((0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1)))  # fmt: skip
    n = w.shape[1]
    B = np.zeros((3, len(w), 3 * n))  # of u and v
    B[0, :, n : 2 * n], B[2, :, n : 2 * n] = on_grid(e, o, 1, 0), on_grid(e, o, 0, 1)
    B[1, :, 2 * n :], B[2, :, 2 * n :] = on_grid(o, e, 0, 1), on_grid(o, e, 1, 0)
    area = np.outer(weights, weights).ravel() * a * b
    bending = np.array([[plate.d11, plate.d12, 0], [plate.d12, plate.d22, 0], [0, 0, plate.d66]])
    A, kappa = 12 / THICKNESS**2 * bending, np.stack([wxx, wyy, 2 * wxy])
    K = np.einsum("cd,cpi,p,dpj->ij", bending, kappa, area, kappa, optimize=True)
    K += wx.T * area @ wx * plate.tension_x + wy.T * area @ wy * plate.tension_y
    force = pressure * area @ w
    q = np.zeros(3 * n)
    q[0] = guess * THICKNESS
    for _ in range(40):
        sx, sy = wx @ q[:n], wy @ q[:n]
        E = B @ q + np.stack([sx**2 / 2, sy**2 / 2, sx * sy])
        N = np.einsum("cd,dp,p->cp", A, E, area)
        G = B.copy()
        G[0, :, :n], G[1, :, :n] = sx[:, None] * wx, sy[:, None] * wy
        G[2, :, :n] = sx[:, None] * wy + sy[:, None] * wx
        residual = -np.einsum("cpi,cp->i", G, N)
        residual[:n] += force - K @ q[:n]
        AG = np.tensordot(A, G * area[:, None], axes=1)
        tangent = np.tensordot(G, AG, axes=([0, 1], [0, 1]))
        cross = (wx.T * N[2]) @ wy
        tangent[:n, :n] += K + (wx.T * N[0]) @ wx + (wy.T * N[1]) @ wy + cross + cross.T
        step = np.linalg.solve(tangent, residual)
        q += step
        if np.linalg.norm(step[:n]) < 1e-9 * np.linalg.norm(q[:n]):
            clamped = plate.left == "clamped"
            line = 1 - np.cos(np.pi * even / 2) if clamped else np.sin(np.pi * odd / 2)
            peak = np.outer(line, line).ravel()
            return float(peak @ q[:n]) / THICKNESS
    raise AssertionError("no minimum was found")


STRETCHED = framed("clamped", tension_x=4.0, tension_y=2.0)


@pytest.mark.parametrize(("plate", "pressure"), [(ORTHOTROPIC, 1.0), (STRETCHED, 4.0)])
def test_the_static_deflection_has_the_least_energy(plate, pressure):
    found = middle_deflection(reduced(plate, 60), pressure)
    exact = least_energy_deflection(plate, pressure, 9, found)
    assert found == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize(("load", "deflection"), LEVY)
def test_a_clamped_square_plate_deflects_as_in_levys_table(load, deflection):
    plate = reduced(framed("clamped", 0.316), 30)
    found = middle_deflection(plate, load * YOUNG * THICKNESS**4 / SIDE**4)
    assert found == pytest.approx(deflection, rel=0.01 if deflection < 0.9 else 0.025)


def test_stretching_of_the_first_mode_has_the_closed_form_of_chu_and_herrmann():
    """J Appl Mech 23:532 (1956): with the edges held across, w'' + w_1^2 (w + e w^3 / h^2) = 0."""
    nu, plate = 0.3, reduced(framed("simply"), 1, "sliding")
    exact = 3 * (1 - nu**2) * (1 / 8 + 1 / (4 * (1 - nu)))
    shape = plate.shapes([[0.0, 0.0]])[0, 0]
    cubic = (plate.H[:, 0, 0] ** 2).sum() / 2
    assert cubic / plate.squared[0] * (THICKNESS / shape) ** 2 == pytest.approx(exact, rel=1e-6)


def test_the_first_mode_vibrates_faster_with_amplitude_as_in_chu_and_herrmann():
    """To leading order w^2 = w_1^2 (1 + 3/4 e (A / h)^2), whatever other modes do."""
    nu, plate = 0.3, reduced(framed("simply"), 8, "sliding")
    first, shape = np.sqrt(plate.squared[0]), plate.shapes([[0.0, 0.0]])[0, 0]
    dt = 2 * np.pi / first / 300
    linear = np.zeros((4000, 8))
    linear[:, 0] = 0.15 * THICKNESS / shape * np.sin(first * dt * np.arange(4000))
    z = stretched_motion(plate, linear, dt, LOSSLESS)[:, 0]
    falls = np.flatnonzero((z[:-1] > 0) & (z[1:] <= 0))
    zeros = falls + z[falls] / (z[falls] - z[falls + 1])
    omega = 2 * np.pi * (len(zeros) - 1) / np.ptp(zeros) / dt
    exact = 0.75 * 3 * (1 - nu**2) * (1 / 8 + 1 / (4 * (1 - nu)))
    amplitude = np.abs(z).max() * shape / THICKNESS
    assert ((omega / first) ** 2 - 1) / amplitude**2 == pytest.approx(exact, rel=0.01)


def test_energy_is_conserved_at_any_step():
    plate, dt, rng = reduced(framed("clamped"), 12), 1e-3, np.random.default_rng(1)
    omega, shapes = np.sqrt(plate.squared), plate.shapes([[0.0, 0.0]])[0]
    linear = rng.standard_normal(12) / omega * np.sin(np.outer(dt * np.arange(2000), omega))
    linear *= 3 * THICKNESS / np.abs(linear @ shapes).max()
    z = stretched_motion(plate, linear, dt, LOSSLESS)
    v, y = np.diff(z, axis=0) / dt, [plate.gradients(a) @ b / 2 for a, b in pairwise(z)]
    mass = (omega * dt / 2 / np.sin(omega * dt / 2)) ** 2  # of the steps, with exact frequencies
    stretching = (np.array(y) ** 2).sum(axis=1) / 2
    energy = (mass * v**2 + plate.squared * z[1:] * z[:-1]).sum(axis=1) / 2 + stretching
    assert np.ptp(energy) < 1e-10 * energy[0]
    assert stretching.max() > 0.1 * energy[0]


def test_stretching_has_the_loss_of_the_material():
    """The equation of one mode with Maxwell branches, by the Runge-Kutta method."""
    plate, solid = reduced(framed("clamped"), 1), PLASTIC.relaxing()
    squared, H, shape = plate.squared[0], plate.H[:, 0, 0], plate.shapes([[0.0, 0.0]])[0, 0]
    mu = PLASTIC.shear_modulus
    shares, times = np.array([(term.modulus / mu, term.time) for term in solid.prony]).T

    def rates(t, state, stretching):
        z, v, bent, stretched = state[0], state[1], *np.split(state[2:], 2)
        y, y_rate = z**2 / 2, z * v

        def stress(strain, rate, branches):
            lasting = (solid.shear_modulus * strain + solid.viscosity * rate) / mu
            return lasting + shares @ branches

        force = squared * stress(z, v, bent) + plate.damping[0] * v
        force += stretching * (H @ H) * stress(y, y_rate, stretched) * z
        return [v, -force, *(v - bent / times), *(y_rate - stretched / times)]

    at = np.linspace(0, 6 * np.pi / np.sqrt(squared), 3001)
    start = np.zeros(2 + 2 * len(times))
    start[1] = 2 * THICKNESS / shape * np.sqrt(squared)
    linear, exact = (
        solve_ivp(rates, at[[0, -1]], start, t_eval=at, args=(k,), rtol=1e-9, atol=1e-14).y[0]
        for k in (0.0, 1.0)
    )
    found = stretched_motion(plate, linear[:, None], at[1], PLASTIC)[:, 0]
    assert np.abs(found - exact).max() < 1e-3 * np.abs(exact).max()
    assert np.abs(linear - exact).max() > 0.5 * np.abs(exact).max()


def test_at_small_amplitude_it_is_the_linear_plate():
    tension = 5.0
    plate = reduced(framed("clamped", tension_x=tension, tension_y=tension / 2), 20)
    load, probe = circling(0.02, 12, 140, 0.5, peak_pressure=1e-3), [[0.01, 0.005]]
    times = np.arange(5001) * 1e-4
    linear = linear_motion(plate.modes, load, DULL, times)
    found = stretched_motion(plate, linear[:, plate.chosen], 1e-4, DULL)
    linear[:, plate.chosen] = found
    modulus = lambda w: DULL.complex_modulus(w) / DULL.shear_modulus  # noqa: E731
    f, forces = load_lines(load).gather(modal_path_forces(plate.modes, load))
    late = times > 0.45
    steady = synthesise(f, modal_motion(plate.modes, f, forces, modulus), times[late])
    steady, moved = (x @ plate.modes.at(probe)[0] for x in (steady, linear[late]))
    assert np.abs(moved - steady).max() < 1e-4 * np.abs(steady).max()


def test_steps_converge_with_the_square_of_their_length():
    plate, load = reduced(framed("clamped"), 12), circling(0.02, 12, 140, 0.04, peak_pressure=20.0)
    found = []
    for n in (1, 2, 4):
        dt = 1e-4 / n
        linear = linear_motion(plate.modes, load, PLASTIC, np.arange(300 * n + 1) * dt)
        moved = stretched_motion(plate, linear[:, plate.chosen], dt, PLASTIC)
        found.append(moved[::n, 0])
    coarse, fine = (np.abs(b - a).max() for a, b in pairwise(found))
    assert fine < 0.01 * np.abs(found[-1]).max()
    assert 3.0 < coarse / fine < 6.0


def test_values_of_plates_out_of_range_are_refused():
    modes = plate_modes(framed("clamped"), finest=100.0)
    for thickness, more, message in (
        (0.0, {}, "thickness"), (1e-4, {"count": 0}, "count"), (1e-4, {"in_plane": "so"}, "held"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=message):
            karman_plate(modes, thickness, **more)


def sheet(pressure, **more):
    mounting = Mounting(edges=("left", "right"))
    paper = replace(BODIES["paper-sheet-loose"], width=0.03, height=0.03, mounting=mounting)
    load = circling(0.008, 5.0, 140.0, 0.02, peak_pressure=pressure)
    return Scene(pressure=load, body=paper, probes=((0.0, 0.0), (0.004, 0.0)), **more)


def test_small_deflection_of_a_sheet_is_linear():
    weak = sheet(0.01, quantity="acceleration")
    found, linear = (
        compute(weak, name).values for name in ("plate-modes-nonlinear", "plate-modes-transient")
    )
    assert np.abs(found - linear).max() < 1e-5 * np.abs(linear).max()


def test_large_deflection_of_a_sheet_agrees_with_elements():
    response, elements, linear = (
        compute(sheet(20), name)
        for name in ("plate-modes-nonlinear", "fem-nonlinear", "plate-modes-transient")
    )
    stated = response.expected_error + elements.expected_error
    assert compare(elements, response).relative_l2.max() < stated < 0.08
    assert compare(elements, linear).relative_l2.max() > 10 * stated
