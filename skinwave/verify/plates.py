"""Sheets, plates and beams: free vibration, thin limits, moving forces, and air."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np
from scipy import sparse

import fem
import meshes
from fem.air import near_field
from meshes import TetMesh
from simple_model.layers.compliance import AIR_DENSITY, thin_sheet
from simple_model.layers.wavenumber_integral import point_response
from simple_model.load.focus import SPEED_OF_SOUND
from simple_model.plates.air import AirLoss, air_of
from simple_model.plates.polynomials import line_basis
from skinwave.typing import Floats
from skinwave.verify import references
from skinwave.verify.case import Checks, below, case, misfit, order, relative
from skinwave.verify.setups import (
    SOURCES,
    THICKNESS,
    WIDTH,
    frequencies,
    gaussian,
    lossy_paper,
    nearest,
    push,
    read,
    unit_solid,
)

# Lengths in m and material of a plate with known natural frequencies.
STEEL = ((10.0, 10.0, 1.0), fem.from_young(density=8000, young=200e9, poisson=0.3))


@case(
    "Kirchhoff's plate by Ritz: Young, J Appl Mech 17:448 (1950); Timoshenko and "
    "Woinowsky-Krieger (1959), table 35",
    mesh="a quarter, 22 by 22 by 1 cells",
)
def clamped_sheet() -> Checks:
    """Clamped square sheet, thickness / side = 0.01."""
    a, thickness = 0.1, 1e-3
    material = fem.from_young(density=80, young=4e6, poisson=0.3)
    half = np.linspace(0, a / 2, 23)
    mesh = meshes.extrude(half, half, [-thickness, 0])
    fixed = {"right": "xyz", "back": "xyz", "front": "y"}
    even, odd = (fem.assemble(mesh, material, fixed={**fixed, "left": x}) for x in ("x", "yz"))
    D = material.young * thickness**3 / 12 / (1 - 0.3**2)
    parameters, centre = references.clamped_plate()
    hz = parameters / a**2 * np.sqrt(D / (material.density * thickness)) / (2 * np.pi)
    deflection = read(mesh, fem.static(even, push(mesh)), 0.0)
    yield relative("first natural frequency", fem.modes(even, 1)[0], hz[0], 0.01, "Hz")
    yield relative("second natural frequency", fem.modes(odd, 1)[0], hz[1], 0.01, "Hz")
    yield relative("central deflection, 1 Pa", deflection, centre * a**4 / D, 0.01, "mm")


@case(
    "Filon (1903): strip under a sine of pressure, exact; Kirchhoff's plate for scale",
    mesh="strips of one element across and through, 4 to 100 along the half wave",
    note="Values are deflections over Kirchhoff's; the reference exceeds 1 because of shear. "
    "Round-off of the stiffness causes an error of about 1e-17 (half wave / thickness)^4. For a "
    "sheet of thickness / width 0.0001, one half wave is wrong and five half waves are right.",
)
def thin_sheets() -> Checks:
    """Sheets of thickness / width 0.0001 to 0.2, elements of aspect 1 to 50."""
    # Thickness over width, half waves along the width, and length over thickness of an element.
    sheets = (
        (0.2, 1, 1), (0.05, 1, 1), (0.05, 1, 5), (0.01, 1, 1), (0.01, 1, 5), (0.01, 1, 20),
        (1e-3, 1, 5), (1e-3, 1, 20), (1e-3, 1, 50), (1e-4, 5, 10), (1e-4, 5, 20), (1e-4, 5, 50),
    )  # fmt: skip
    for thin, waves, aspect in sheets:
        deflection, exact, kirchhoff = _strip_bending(thin * waves, aspect)
        what = f"thickness / width {thin:g}, half waves {waves}, aspect {aspect}"
        bar = 0.01 if thin * waves * aspect < 0.1 else 0.02
        yield relative(what, deflection / kirchhoff, exact / kirchhoff, bar)


@case(f"Shear wave SH0, w = c_s k: {SOURCES['Achenbach']}, chapter 6", mesh="4 by 4 by 1 cells")
def in_plane_shear() -> Checks:
    """In-plane shear of a plate with four cells per half wave."""
    lengths, material = STEEL
    exact = material.shear_speed * np.hypot(1 / lengths[0], 1 / lengths[1]) / 2
    supported = {"left": "yz", "right": "yz", "front": "xz", "back": "xz"}  # Navier's supports
    hz = frequencies(_plate(lengths, (4, 4, 1)), material, supported, 40)
    yield relative("half waves 1, 1", nearest(hz, exact), exact, 3e-3, "Hz")


@case(
    f"Rayleigh-Lamb roots at k = pi hypot(m / a, n / b): {SOURCES['Achenbach']}, chapter 6; Strang "
    "and Fix, An Analysis of the Finite Element Method (1973), chapter 6: order 2 p = 4, from "
    "above",
    mesh="the upper half of a quarter plate; 8, 12 and 16 cells, or 14 per half wave",
)
def navier() -> Checks:
    """Plates on Navier's supports, thickness / side 0.1 and 0.17, nu 0.3 and 0.45."""
    cells = (8, 12, 16)
    soft = ((0.06, 0.06, 0.01), fem.Material(density=1000, shear_modulus=25e3, poisson=0.45))
    for lengths, material in (STEEL, soft):
        what, first = f"nu = {material.poisson:g}", _navier_exact(lengths, material, 1, 1)
        hz = np.array(
            [_navier_modes(lengths, material, (1, 1), (n, n, n // 4), 1)[0] for n in cells]
        )
        errors = hz / first - 1
        yield order(f"{what}: order", 1 / np.array(cells), errors, 4, 0.2)
        yield relative(f"{what}: first frequency, finest mesh", hz[-1], first, 5e-5, "Hz")
        shortfall = max(0.0, -errors.min())
        yield below(f"{what}: largest shortfall below the exact frequency", shortfall, 0.0)
        for m, n in ((1, 1), (1, 2), (2, 2), (1, 3)):
            exact = _navier_exact(lengths, material, m, n)
            found = _navier_modes(lengths, material, (m, n), (7 * m, 7 * n, 2), 6)
            yield relative(f"{what}: half waves {m}, {n}", nearest(found, exact), exact, 1e-3, "Hz")


@case(
    "Fryba, Vibration of Solids and Structures under Moving Loads (1972), 1.3.2",
    mesh="50 by 1 by 1 cells, thickness / length = 0.02",
)
def moving_force() -> Checks:
    """Force crossing a simply supported beam at a quarter and a half of the critical speed."""
    length, thickness, n, spot = 1.0, 0.02, 50, 0.02
    material = fem.from_young(density=1000, young=1e6, poisson=0.0)
    mesh = meshes.extrude(np.linspace(0, length, n + 1), [0, 0.02], np.linspace(-thickness, 0, 2))
    ops = fem.assemble(mesh, material, fixed={"left": "z", "right": "z", "front": "y", "back": "y"})
    first = np.pi / 2 / length**2 * np.sqrt(material.young * thickness**2 / 12 / material.density)
    P, x = fem.pressure_operator(mesh), fem.facet_points(mesh)[:, 0]
    total = np.asarray(-P.sum(axis=0)).sum() / length * spot * np.sqrt(2 * np.pi)
    S = fem.probe_operator(mesh, [[length / 2, 0.01]])
    stiffness = 48 * material.young * 0.02 * thickness**3 / 12 / length**3
    for ratio in (0.25, 0.5):
        critical = 2 * length * first
        speed = ratio * critical
        times = np.linspace(0, length / speed, 401)

        def force(t: float, speed: float = speed) -> Floats:
            return P @ np.exp(-((x - speed * t) ** 2) / 2 / spot**2) / total

        states = islice(fem.transient(ops, force, times[1]), len(times))
        course = stiffness * np.array([(S @ s.displacement)[0] for s in states])
        exact = references.moving_force_on_beam(
            times, speed=speed, critical=critical, period=1 / first
        )
        what = f"{ratio:g} of the critical speed"
        largest = f"{what}: largest deflection / (F L^3 / 48 E I)"
        yield relative(largest, course.max(), exact.max(), 0.01)
        yield misfit(f"{what}: deflection over time, L2", course, exact, 0.02)


@case(
    "Lamb, Proc R Soc A 98:205 (1920): 0.669 of (1 - r^2/a^2)^2; a Gaussian by Parseval's theorem "
    "and the transform 2 pi / k of 1/r: iint w w / r = 2 pi^(5/2) s^3",
    mesh="grids of 49 to 385 nodes per side over 12 standard deviations; 161 over the disc",
)
def air_operator() -> Checks:
    """Air around a sheet: added mass of shapes with known energy."""
    sizes = np.array([0.25, 0.125, 0.0625, 0.03125])  # of the Gaussian's standard deviation
    energies = [_energy(6.0, s, lambda r: np.exp(-(r**2) / 2)) for s in sizes]
    errors = np.abs(np.array(energies) / (2 * np.pi**2.5) - 1)
    lamb = _energy(1.0, 1 / 80, lambda r: np.where(r < 1, (1 - r**2) ** 2, 0.0))
    factor = lamb / (2 * np.pi) / (np.pi / 5)  # int (1 - r^2)^4 dA = pi/5
    yield order("order in the spacing, Gaussian", sizes, errors, 2, 0.1)
    yield relative("Gaussian, 32 nodes per standard deviation", 1 - errors[-1], 1.0, 5e-5)
    yield relative("Lamb's factor of the added mass, one side", factor, 0.669, 1e-3)


@case(
    "mass: DNV-RP-H103 (2011), table A-2; sound: Wallace, J Acoust Soc Am 51:946 (1972), eq. 3, at "
    "k0 = 1/m",
)
def sheet_sound() -> Checks:
    """Rectangle in open air and simply supported plate in a baffle, by Ritz's method."""
    for ratio, coefficient in ((1, 0.579), (2, 0.757), (4, 0.872)):
        x, y = (line_basis(side, ("free", "free"), 12, True)[0] for side in (0.1 * ratio, 0.1))
        mass = air_of(x, y, 1.0, 0.0)[0][0, 0] * 0.01 * ratio
        cylinder = np.pi / 4 * 0.1**3 * ratio
        yield relative(f"mass of {ratio} by 1, open air", mass / cylinder, coefficient, 2e-3)
    sides = 0.15, 0.1
    (x, _), (y, _) = (line_basis(side, ("simply", "simply"), 24, True) for side in sides)
    _, patterns, orders = air_of(x, y, AIR_DENSITY)
    of_x, of_y = (np.linalg.eigh(line.slope)[1] for line in (x, y))  # sines of unit norm
    a, b = sides
    for m, n in ((1, 1), (3, 1), (1, 3)):
        wave = np.kron(of_x[:, m // 2], of_y[:, n // 2])
        loss = AirLoss(
            patterns=patterns @ wave[:, None], orders=orders, areas=np.zeros(1),
            density=AIR_DENSITY, reach=np.hypot(a, b) / 2,
        )  # fmt: skip
        found = loss.of_each(np.array([SPEED_OF_SOUND]))[0, 0] / 2 / AIR_DENSITY / SPEED_OF_SOUND
        first = [(1 - 8 / (k * np.pi) ** 2) * q for k, q in ((m, a / b), (n, b / a))]
        exact = 32 * a * b / (m**2 * n**2 * np.pi**5) * (1 - a * b / 12 * sum(first))
        yield relative(f"radiation efficiency of mode {m}, {n}", found, exact, 1e-3)


@case(
    "2 rho / k of each wavenumber: Junger and Feit, Sound, Structures, and Their Interaction "
    "(1986), section 5.11; wavenumber integral, verified by the cases on flat-body",
    mesh="a quarter in cells of 4 mm; edges clamped at 168 mm; loss factor 0.6 at 80 Hz, so that "
    "they reflect little", slow=True,
)  # fmt: skip
def focus_in_air() -> Checks:
    """Focus on a large, lossy sheet in air: finite elements against the infinite sheet."""
    thickness = 1e-3
    lag = 1.2e-3  # s: a wave of 80 Hz falls to 0.003 on its way across the sheet and back
    solid = lossy_paper(thickness, lag)
    mesh = meshes.sheet(2 * 0.168, 2 * 0.168, thickness, 4e-3)
    mesh = meshes.half(meshes.half(mesh, "x"), "y")
    ops = fem.assemble(mesh, solid, fixed={"clamped": "xyz", "mirror_x": "x", "mirror_y": "y"})
    radii, hz = np.array([0.0, 5, 10, 15, 20, 30]) * 1e-3, np.array([80.0, 140, 210, 300])
    S = fem.probe_operator(mesh, np.column_stack([radii, np.zeros(6)]))
    force = push(mesh, gaussian())[:, None]
    model = fem.reduce(
        ops, sparse.csr_array(force.T), hz.max(), 2e-3,
        air=fem.air_around(mesh, ops.free, AIR_DENSITY, mirrored="xy"),
    )  # fmt: skip
    model = replace(model, outputs=S @ model.basis)
    amplitudes = fem.transfer(model, model.basis.T @ force, hz)[..., 0]
    paper = replace(fem.PRESETS["paper"], loss_factor=0.0)
    paper = replace(paper, viscosity=lag * paper.shear_modulus)
    sheet = thin_sheet(paper, THICKNESS, air_density=AIR_DENSITY)
    exact = point_response(sheet, radii, 2 * np.pi * hz, WIDTH)
    for f, ours, theirs in zip(hz, amplitudes, exact, strict=True):
        yield misfit(f"{f:g} Hz, 0 to 30 mm, complex, relative L2", ours, theirs, 0.03, "um")


def _energy(half: float, spacing: float, shape: Callable[[Floats], Floats]) -> float:
    """Return iint w(x) w(y) / |x - y| dA dA of w, a function of the distance from the centre."""
    x = spacing * np.arange(-round(half / spacing), round(half / spacing) + 1)
    w = shape(np.hypot(x, x[:, None]))
    field = near_field((len(w), len(w)), (spacing, spacing))
    return float((w * field(w[None])[0]).sum() * spacing**2)


def _plate(lengths: Sequence[float], cells: Sequence[int]) -> TetMesh:
    """Return a plate with its top at z = 0."""
    x, y, depth = (np.linspace(0, a, k + 1) for a, k in zip(lengths, cells, strict=True))
    return meshes.extrude(x, y, depth - lengths[2])


def _navier_modes(
    lengths: Sequence[float], material: fem.Material, waves: tuple[int, int], cells: Sequence[int],
    count: int,
) -> Floats:  # fmt: skip
    """Return natural frequencies in Hz of an eighth of a plate with this parity of half waves."""
    middle = {"right": "x" if waves[0] % 2 else "yz", "back": "y" if waves[1] % 2 else "xz"}
    fixed = {"left": "yz", "front": "xz", "bottom": "xy", **middle}
    return frequencies(_plate([a / 2 for a in lengths], cells), material, fixed, count)


def _navier_exact(lengths: Sequence[float], material: fem.Material, m: int, n: int) -> float:
    k = np.pi * np.hypot(m / lengths[0], n / lengths[1])
    w = references.rayleigh_lamb(k, thickness=lengths[2], poisson=material.poisson)
    return w * material.shear_speed / 2 / np.pi


def _strip_bending(thin: float, aspect: float) -> tuple[float, float, float]:
    """Return mid-span deflections in m under a sine of 1 Pa: of elements, Filon and Kirchhoff."""
    n = max(4, round(1 / thin / aspect / 2))
    cell = 0.5 / n
    mesh = meshes.extrude(np.linspace(0, 0.5, n + 1), [0, cell], [-thin, 0])
    fixed = {"left": "z", "right": "x", "front": "y", "back": "y"}
    force = push(mesh, lambda x: np.sin(np.pi * x[:, 0]))
    u = fem.static(fem.assemble(mesh, unit_solid(0.3), fixed=fixed), force)
    exact = references.strip_under_sine(np.pi, thickness=thin, shear_modulus=1, poisson=0.3)
    return float(read(mesh, u, 0.5, cell / 2)[0]), exact, 6 * (1 - 0.3) / np.pi**4 / thin**3
