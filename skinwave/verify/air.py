"""Air around a sheet: Lamb's disc, an integral in closed form, and the infinite sheet."""

from dataclasses import replace

import numpy as np
from scipy import sparse

import fem
import meshes
from fem.added_mass import near_field
from simple_model.layers.compliance import AIR_DENSITY, thin_sheet
from simple_model.layers.wavenumber_integral import point_response
from skinwave.verify.case import Case, Plot, described, misfit, order, relative
from skinwave.verify.exact import PAPER, THICKNESS
from skinwave.verify.references import Complex, Floats
from skinwave.verify.statics import WIDTH

LAMB = "Lamb, Proc R Soc A 98:205 (1920)"
JUNGER = "Junger and Feit, Sound, Structures, and Their Interaction (1986), section 5.11"
LAMBS_FACTOR = 0.669  # of rho_f a / (rho_p h): the lowest mode, fluid on one side
LAG = 1.2e-3  # s: a wave of 80 Hz that has crossed the sheet and back is down to three thousandths


def gaussian_and_lambs_shape() -> Case:
    """Kinetic energy of the fluid around two mode shapes on a grid."""
    sizes = np.array([0.25, 0.125, 0.0625, 0.03125])  # of the Gaussian's standard deviation
    errors = [abs(_energy(np.exp(-(r**2) / 2), s) / (2 * np.pi**2.5) - 1)
              for r, s in (_radius(6.0, s) for s in sizes)]  # fmt: skip
    r, s = _radius(1.0, 1 / 80)
    lamb = np.where(r < 1, (1 - r**2) ** 2, 0.0)
    factor = _energy(lamb, s) / (2 * np.pi) / (np.pi / 5)  # int lamb^2 dA = pi/5
    return Case(
        title="Air around a sheet: the operator on shapes of known energy",
        source=f"{LAMB}: 0.669 of (1 - r^2/a^2)^2; a Gaussian by Parseval's theorem and the "
        "transform 2 pi / k of 1/r: iint w w / r = 2 pi^(5/2) s^3",
        mesh="grids of 49 to 385 nodes a side across 12 standard deviations; 161 across the disc",
        checks=(
            order("order in the spacing, Gaussian", sizes, errors, 2, 0.1),
            relative("Gaussian, 32 nodes a standard deviation", 1 - errors[-1], 1.0, 5e-5),
            relative("Lamb's factor of the added mass, one side", factor, LAMBS_FACTOR, 1e-3),
        ),
        plot=Plot(
            x="spacing / standard deviation", y="relative error", log=True,
            lines={"Gaussian": (sizes, errors)},
        ),
    )  # fmt: skip


def lambs_disc() -> Case:
    """Clamped disc of paper's weight with air on both sides, cut from a meshed sheet."""
    a, thickness, cells = 0.05, 1e-3, 24
    material = fem.from_young(density=PAPER["mass_per_area"] / thickness, young=4e6, poisson=0.3)
    mesh = _quarter(1.1 * a, thickness, 1.1 * a / cells)
    fixed = np.zeros(mesh.points.shape, bool)
    fixed[np.hypot(*mesh.points[:, :2].T) > a * (1 - 1e-9)] = True
    for axis in (0, 1):
        fixed[np.abs(mesh.points[:, axis]) < 1e-9, axis] = True
    ops = fem.assemble(mesh, material, fixed=fixed)
    centre = fem.probe_operator(mesh, [[1e-9, 1e-9]])
    models = (
        fem.reduce(ops, centre, 300.0, added=added)
        for added in (None, fem.added_mass(mesh, ops.free, AIR_DENSITY, mirrored="xy"))
    )
    vacuum, air = (
        np.sqrt(np.linalg.eigvalsh(model.operators.K)[0]) / (2 * np.pi) for model in models
    )
    beta = 2 * LAMBS_FACTOR * AIR_DENSITY * a / PAPER["mass_per_area"]
    return Case(
        title="Clamped disc with air on both sides: its lowest mode",
        source=f"{LAMB}: f / f_vacuum = 1 / sqrt(1 + beta), beta = 0.669 rho_f a / rho_p h on each "
        "side, by an assumed shape of the mode",
        mesh=described(mesh, "a quarter of a square, fixed outside the disc"),
        checks=(
            relative("frequency in air / in vacuum", air / vacuum, 1 / np.sqrt(1 + beta), 0.01),
        ),
    )


def focus_on_a_sheet_in_air() -> Case:
    """Vibrating focus on a large and lossy sheet against the infinite sheet."""
    half, thickness = 0.168, 1e-3
    young = 12 * PAPER["bending_stiffness"] * (1 - 0.3**2) / thickness**3
    solid = fem.Material(
        density=PAPER["mass_per_area"] / thickness, shear_modulus=young / 2.6, poisson=0.3,
        viscosity=LAG * young / 2.6,
    )  # fmt: skip
    mesh = _quarter(half, thickness, 4e-3)
    ops = fem.assemble(mesh, solid, fixed={"clamped": "xyz", "mirror_x": "x", "mirror_y": "y"})
    radii, hz = np.array([0.0, 5, 10, 15, 20, 30]) * 1e-3, np.array([80.0, 140, 210, 300])
    read = fem.probe_operator(mesh, np.column_stack([radii, np.zeros(6)]))
    squared = (fem.facet_points(mesh)[:, :2] ** 2).sum(axis=1)
    force = fem.load_operator(mesh) @ np.exp(-squared / (2 * WIDTH**2))[:, None]

    model = fem.reduce(
        ops, sparse.csr_array(force.T), hz.max(), 2e-3,
        added=fem.added_mass(mesh, ops.free, AIR_DENSITY, mirrored="xy"),
    )  # fmt: skip
    model = replace(model, outputs=read @ model.basis)
    found = fem.transfer(model, model.basis.T @ force, hz)[..., 0]
    air, vacuum = (_infinite(radii, hz, density) for density in (AIR_DENSITY, 0.0))
    checks = [
        misfit(f"{f:g} Hz, 0 to 30 mm, complex, relative L2", ours, theirs, 0.03, "um")
        for f, ours, theirs in zip(hz, found, air, strict=True)
    ]
    return Case(
        title="Focus on a large and lossy sheet in air: finite elements against the infinite sheet",
        source=f"2 rho / k of each wavenumber: {JUNGER}; by the wavenumber integral that the "
        "case on flat-body verifies",
        mesh=described(mesh, "a quarter; edges clamped at 168 mm; loss factor 0.6 at 80 Hz, so "
                       "that they reflect little"),
        checks=tuple(checks),
        plot=Plot(
            x="frequency, Hz", y="amplitude at the focus, um at 1 Pa",
            lines={"finite elements": (hz, 1e6 * np.abs(found[:, 0])),
                   "infinite, in air": (hz, 1e6 * np.abs(air[:, 0])),
                   "infinite, in vacuum": (hz, 1e6 * np.abs(vacuum[:, 0]))},
            drawn=("infinite, in air", "infinite, in vacuum"),
        ),
    )  # fmt: skip


def _infinite(radii: Floats, hz: Floats, density: float) -> Complex:
    paper = replace(fem.PRESETS["paper"], loss_factor=0.0)
    sheet = thin_sheet(
        replace(paper, viscosity=LAG * paper.shear_modulus), THICKNESS, air_density=density
    )
    return point_response(sheet, radii, 2 * np.pi * hz, WIDTH)


def _quarter(half: float, thickness: float, h: float) -> meshes.TetMesh:
    """The part of a square sheet with positive x and y."""
    whole = meshes.sheet(2 * half, 2 * half, thickness, h)
    return meshes.half(meshes.half(whole, "x"), "y")


def _radius(half: float, spacing: float) -> tuple[Floats, float]:
    """Distances (n, n) from the middle of a square grid."""
    x = spacing * np.arange(-round(half / spacing), round(half / spacing) + 1)
    return np.hypot(x, x[:, None]), spacing


def _energy(w: Floats, spacing: float) -> float:
    """iint w(x) w(y) / |x - y| dA dA."""
    field = near_field((len(w), len(w)), (spacing, spacing))
    return float((w * field(w[None])[0]).sum() * spacing**2)
