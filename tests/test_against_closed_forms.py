"""Bodies whose answer is known: half-space, plates, blocks, oscillators."""

from itertools import islice

import numpy as np
import pytest
from conftest import order
from scipy import sparse

import fem
import meshes

# A Gaussian focus of 4.35 mm and 1 Pa on a viscoelastic half-space, rho 1000, mu 7.86 kPa,
# 5.03 Pa s: |u_z| in um at r = 0, 5, 10, 15, 20 mm from the Hankel integral of the half-space's
# Green's function, nu = 0.5 (the first rows) and 0.49 (at r = 0).
RADII = np.array([0, 5, 10, 15, 20]) * 1e-3
HALF_SPACE = {
    0: [0.3468, 0.2561, 0.1375, 0.0847, 0.0618],
    80: [0.2636, 0.1755, 0.0812, 0.0550, 0.0407],
    140: [0.1729, 0.1000, 0.0368, 0.0238, 0.0120],
    210: [0.1040, 0.0528, 0.0157, 0.0097, 0.0045],
}
CENTRE_049 = {0: 0.3538, 140: 0.1753, 210: 0.1052}


def quarter_space(length, growth, radius):
    """A quarter of a block, its inner sides sliding, fine where the focus is."""
    across = meshes.graded_axis(length, 0.0025, meshes.Grading(radius=radius, growth=growth))
    down = meshes.graded_axis(length, 0.0025, meshes.Grading(radius=0.0, growth=growth))
    return meshes.extrude(across, across, -down[::-1])


def focus_on(mesh, poisson):
    material = fem.Material(density=1000, shear_modulus=7.86e3, poisson=poisson, viscosity=5.03)
    fixed = {"bottom": "xyz", "right": "xyz", "back": "xyz", "left": "x", "front": "y"}
    points = fem.facet_points(mesh)
    spot = np.exp(-(points[:, :2] ** 2).sum(axis=1) / 2 / 4.35e-3**2)
    probes = fem.probe_operator(mesh, np.column_stack([RADII, 0 * RADII]))
    return fem.assemble(mesh, material, fixed=fixed), fem.load_operator(mesh) @ spot, probes


@pytest.mark.slow
@pytest.mark.parametrize("poisson", [0.49, 0.4999])
def test_static_focus_on_a_half_space(poisson):
    ops, force, probes = focus_on(quarter_space(4.0, 1.5, 0.01), poisson)
    found = 1e6 * (probes @ fem.static(ops, force))
    # At rest the surface displacement is proportional to 1 - nu.
    expected = np.array(HALF_SPACE[0]) * (1 - poisson) / 0.5
    np.testing.assert_allclose(found, expected, rtol=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("frequency", [80, 140, 210])
def test_steady_focus_on_a_half_space(frequency):
    mesh = quarter_space(0.10, 1.35, 0.02)
    ops, force, probes = focus_on(mesh, 0.4999)
    found = 1e6 * np.abs(probes @ fem.harmonic(ops, force, frequency)[0])
    np.testing.assert_allclose(found, HALF_SPACE[frequency], rtol=0.05)
    if frequency in CENTRE_049:
        ops, force, probes = focus_on(mesh, 0.49)
        found = 1e6 * np.abs(probes @ fem.harmonic(ops, force, frequency)[0])
        assert found[0] == pytest.approx(CENTRE_049[frequency], rel=0.03)


def test_clamped_square_sheet_is_kirchhoffs():
    a, thickness = 0.1, 1e-3
    material = fem.from_young(density=80, young=4e6, poisson=0.3)
    mesh = meshes.sheet(a, a, thickness, a / 44)
    ops = fem.assemble(mesh, material)
    D = material.young * thickness**3 / 12 / (1 - 0.3**2)
    frequencies, _ = fem.modes(ops, 3)
    first = 35.985 / a**2 * np.sqrt(D / (material.density * thickness)) / (2 * np.pi)
    assert frequencies[0] == pytest.approx(first, rel=0.01)
    assert frequencies[2] == pytest.approx(first * 73.394 / 35.985, rel=0.01)
    P = fem.load_operator(mesh)
    deflection = fem.probe_operator(mesh, [[0, 0]]) @ fem.static(ops, P @ np.ones(P.shape[1]))
    assert deflection[0] == pytest.approx(0.00126532 * a**4 / D, rel=0.01)


SLIDING = {"left": "yz", "right": "yz", "front": "xz", "back": "xz"}


PLATES = [
    # Rayleigh-Lamb roots of plates with hard simple supports: half waves (m, n) -> Hz.
    (
        (10.0, 10.0, 1.0),
        fem.from_young(density=8000, young=200e9, poisson=0.3),
        {(1, 1): 45.9712, (1, 2): 109.857, (2, 2): 168.819, (1, 3): 205.865},
    ),
    (
        (0.06, 0.06, 0.01),
        fem.Material(density=1000, shear_modulus=25e3, poisson=0.45),
        {(1, 1): 21.720, (1, 2): 48.397, (2, 2): 70.753},
    ),
]


def navier_supported(lengths, cells, material, modes=12):
    x, y, depth = (np.linspace(0, length, n + 1) for length, n in zip(lengths, cells, strict=True))
    mesh = meshes.extrude(x, y, depth - lengths[2])
    return fem.modes(fem.assemble(mesh, material, fixed=SLIDING), modes)[0]


@pytest.mark.slow
@pytest.mark.parametrize(("lengths", "material", "modes"), PLATES)
def test_navier_supported_blocks_at_twelve_cells_a_half_wave(lengths, material, modes):
    for (m, n), expected in modes.items():
        found = navier_supported(lengths, (12 * m, 12 * n, 4), material)
        assert np.abs(found / expected - 1).min() < 1e-3, (m, n)


def test_in_plane_shear_is_right_to_three_thousandths_at_four_cells_a_half_wave():
    lengths, material, _ = PLATES[0]
    found = navier_supported(lengths, (4, 4, 1), material, 40)
    assert np.abs(found / 219.265 - 1).min() < 3e-3


@pytest.mark.parametrize(("lengths", "material", "modes"), PLATES)
def test_natural_frequencies_converge_from_above_with_nearly_order_four(lengths, material, modes):
    cells = (4, 8, 16)
    found = [navier_supported(lengths, (n, n, n // 4), material, 1)[0] for n in cells]
    errors = np.array(found) / modes[1, 1] - 1
    assert (errors > 0).all()
    # 3.4 to 3.6 on these meshes, rising with refinement.
    assert order([1 / n for n in cells], errors) == pytest.approx(3.6, abs=0.2)
    assert errors[-1] < 6e-4


def single(stiffness=1.0, damping=0.0, mass=1.0):
    """An oscillator of one unknown."""
    one = [sparse.csr_array([[value]]) for value in (stiffness, damping, mass)]
    return fem.Operators(K=one[0], C=one[1], M=one[2], free=np.array([0]), n_dofs=1)


def released(velocity=0.0):
    return fem.State(
        time=0.0,
        displacement=np.array([1.0]),
        velocity=np.array([velocity]),
        acceleration=np.array([-1.0]),
    )


@pytest.mark.parametrize("radius", [0.0, 0.5, 0.8, 1.0])
def test_time_stepping_has_order_two(radius):
    errors, steps = [], [100, 200, 400, 800]
    for n in steps:
        states = fem.transient(
            single(damping=0.2), lambda t: np.array([np.sin(3 * t)]), 2.0 / n,
            spectral_radius=radius,
        )  # fmt: skip
        last = next(islice(states, n, None))
        s = np.roots([1, 0.2, 1])
        # Particular solution of the driven oscillator, and the free one that starts it from rest.
        G = 1 / (1 - 9 + 0.6j)
        u0, v0 = -np.imag(G), -np.imag(3j * G)
        free = np.linalg.solve([[1, 1], s], [u0, v0]) @ np.exp(2.0 * s)
        errors.append(abs(last.displacement[0] - (np.imag(G * np.exp(6j)) + free.real)))
    assert order([1 / n for n in steps], errors) == pytest.approx(2, abs=0.1)
    assert errors[-1] < 2e-4


@pytest.mark.parametrize(
    ("radius", "loss"),
    [
        (0.9, [7.3e-9, 5.8e-7, 5.8e-5]),
        (0.8, [6.8e-8, 5.4e-6, 5.3e-4]),
        (0.5, [1.8e-6, 1.4e-4, 1.1e-2]),
    ],
)
def test_numerical_damping_is_that_of_chung_and_hulbert(radius, loss):
    for wdt, expected in zip((0.1, 0.3, 1.0), loss, strict=True):
        # The map from one step to the next, of (u, dt v, dt^2 a).
        columns = []
        for unit in np.eye(3):
            start = fem.State(
                time=0.0, displacement=unit[:1], velocity=unit[1:2] / wdt, acceleration=unit[2:]
            )
            columns.append(_one_step(start, wdt, radius, unit[2] / wdt**2))
        spectral_radius = np.abs(np.linalg.eigvals(np.array(columns).T)).max()
        assert 1 - spectral_radius == pytest.approx(expected, rel=0.06)


def _one_step(start, dt, radius, acceleration):
    """(u, dt v, dt^2 a) after a step from a state that need not be in balance."""
    a_m, a_f = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
    # An unbalanced start is the balanced one under a force that acts at time 0 only.
    push = acceleration + start.displacement[0]
    states = fem.transient(
        single(), lambda t: np.array([push if t == 0 else 0.0]), dt,
        spectral_radius=radius, initial=start,
    )  # fmt: skip
    after = next(islice(states, 1, None))
    # Take the push back out: it enters the step's balance with the weight a_f.
    gamma = 0.5 - a_m + a_f
    beta = (1 - a_m + a_f) ** 2 / 4
    extra = a_f * push / ((1 - a_m) + (1 - a_f) * beta * dt**2)
    u = after.displacement[0] - dt**2 * beta * extra
    v = after.velocity[0] - dt * gamma * extra
    return [u, dt * v, dt**2 * (after.acceleration[0] - extra)]


def test_free_vibration_keeps_its_energy():
    mesh = meshes.block((0.02, 0.02, 0.01), 0.01)
    ops = fem.assemble(mesh, fem.Material(density=1000, shear_modulus=25e3, poisson=0.4999))
    _, shapes = fem.modes(ops, 3)
    zero = np.zeros(mesh.n_dofs)
    u = shapes.sum(axis=1)
    f, n = ops.free, 10_000
    factor = fem.factorise(ops.M)
    a = ops.expand(factor.solve(-(ops.K @ u[f])))
    start = fem.State(time=0.0, displacement=u, velocity=zero, acceleration=a)

    def energy(state):
        v, x = state.velocity[f], state.displacement[f]
        return (v @ ops.M @ v + x @ ops.K @ x) / 2

    states = islice(fem.transient(ops, lambda t: zero, 1e-4, initial=start), n + 1)
    energies = np.array([energy(state) for state in states])
    assert np.abs(energies / energies[0] - 1).max() < 1e-10


def test_a_plane_wave_leaves_through_a_dashpot_side():
    """Shear wave down a column, absorbed at its base: less than 1 % comes back."""
    material = fem.Material(density=1000, shear_modulus=25e3, poisson=0.45)
    mesh = meshes.extrude([0, 0.002], [0, 0.002], np.linspace(-0.1, 0, 51))
    ops = fem.assemble(mesh, material, fixed={"sides": "yz"}, absorbing="bottom")
    top = np.unique(mesh.facets["top"])
    push = np.zeros(mesh.n_dofs)
    push[3 * top] = 1e-6 / len(top)

    def force(t):
        return push * np.exp(-(((t - 0.004) / 0.001) ** 2))

    surface = [
        state.displacement[3 * top].mean()
        for state in islice(fem.transient(ops, force, 2e-5), 3000)
    ]
    # After the pulse the surface has moved once and for all: F t / (rho c A); then it must rest.
    moved = np.array(surface[600:])
    assert np.ptp(moved) < 0.01 * moved.mean()
    expected = 1e-6 * 0.001 * np.sqrt(np.pi) / (1000 * 5.0 * 4e-6)
    assert moved.mean() == pytest.approx(expected, rel=0.01)


def test_time_stepping_refuses_nonsense():
    with pytest.raises(ValueError, match="dt = 0"):
        next(fem.transient(single(), lambda t: np.zeros(1), 0.0))
    with pytest.raises(ValueError, match="outside 0..1"):
        next(fem.transient(single(), lambda t: np.zeros(1), 0.1, spectral_radius=1.2))
    with pytest.raises(fem.Diverged, match="not finite at t = 0.1 s, step 1"):
        list(islice(fem.transient(single(), lambda t: np.array([np.nan if t else 0.0]), 0.1), 3))
