"""Bodies at rest: half-space, layers, columns."""

from functools import partial
from itertools import pairwise

import numpy as np
from scipy import sparse

import fem
import meshes
from fem.assembly import direct_part
from fem.elements import shape_derivatives
from fem.pressure_projection import linear_functions, macroelements, projected_divergence
from meshes import TetMesh
from meshes.tetmesh import Ints
from skinwave.verify import references
from skinwave.verify.case import Case, Plot, below, described, largest, relative
from skinwave.verify.references import Floats

WIDTH = 4.35e-3  # m, standard deviation of the Gaussian focus
RADII = np.array([0, 5, 10, 15, 20]) * 1e-3
QUARTER = {"bottom": "xyz", "right": "xyz", "back": "xyz", "left": "x", "front": "y"}
RATIOS = (0.0, 0.45, 0.49, 0.499, 0.4999, 0.49999)


def quarter_space(length: float, growth: float, radius: float, h: float = 0.0025) -> TetMesh:
    """A quarter of a block, its inner sides sliding, fine where the focus is."""
    across = meshes.graded_axis(length, h, meshes.Grading(radius=radius, growth=growth))
    down = meshes.graded_axis(length, h, meshes.Grading(radius=0.0, growth=growth))
    return meshes.extrude(across, across, -down[::-1])


def focus_force(mesh: TetMesh) -> Floats:
    """Nodal forces (3 n,) in N of a Gaussian focus of 1 Pa at the origin."""
    points = fem.facet_points(mesh)
    return fem.load_operator(mesh) @ np.exp(-(points[:, :2] ** 2).sum(axis=1) / 2 / WIDTH**2)


def on_axis(mesh: TetMesh, radii: Floats) -> sparse.csr_array:
    """Probes (p, 3 n) along the x axis."""
    return fem.probe_operator(mesh, np.column_stack([radii, 0 * radii]))


def disc_on_half_space() -> Case:
    """Uniform pressure on a disc, whose rim is a line of the mesh."""
    a, material = 0.01, fem.from_young(density=1000, young=20e3, poisson=0.3)
    square = quarter_space(4.0, 2.0, a, a / 8)
    x = square.points.copy()
    radius = np.hypot(x[:, 0], x[:, 1])
    x[:, :2] *= (np.abs(x[:, :2]).max(axis=1) / np.where(radius > 0, radius, 1))[:, None]
    # Squares become circles; straight-sided again through the corners of the round mesh.
    mesh = _round(x, square)
    top = mesh.facets["top"]
    centres = mesh.points[top[:, :3]].mean(axis=1)
    P = fem.load_operator(mesh, top[np.hypot(centres[:, 0], centres[:, 1]) < a])
    force = P @ np.ones(P.shape[1])
    ops = fem.assemble(mesh, material, fixed=QUARTER)
    places = {"the centre": 0.0, "half the radius": a / 2, "the rim": a}
    found = on_axis(mesh, np.array(list(places.values()))) @ fem.static(ops, force)
    expected = [
        references.boussinesq_disc(r, radius=a, young=20e3, poisson=0.3) for r in places.values()
    ]
    return Case(
        title="Boussinesq: uniform pressure on a disc, nu = 0.3",
        source="Boussinesq (1885); Johnson, Contact Mechanics (1985), section 3.4",
        mesh=described(mesh, "a quarter; 8 cells a radius, sides at 400 radii"),
        checks=tuple(
            relative(f"deflection at {name}, 1 Pa", u, w, 0.02, "um")
            for name, u, w in zip(places, found, expected, strict=True)
        ),
    )


def focus_at_rest_on_half_space(poisson: float) -> Case:
    """Deflection under a Gaussian focus, and the mean pressure below it."""
    material = fem.Material(density=1000, shear_modulus=7.86e3, poisson=poisson)
    mesh = quarter_space(4.0, 1.7, 0.01)
    u = fem.static(fem.assemble(mesh, material, fixed=QUARTER), focus_force(mesh))
    found = on_axis(mesh, RADII) @ u
    expected_at = partial(
        references.gaussian_at_rest, width=WIDTH, shear_modulus=7.86e3, poisson=poisson
    )
    expected, r = expected_at(RADII), np.linspace(0, 0.02, 100)
    pressure, checkerboard = _pressure_errors(mesh, u, material)
    return Case(
        title=f"Gaussian focus at rest on a half-space, nu = {poisson:g}",
        source="Boussinesq's kernel; Gradshteyn and Ryzhik, 6.618.1; Johnson (1985), section 3.2",
        mesh=described(mesh, "a quarter; 2.5 mm at the focus, sides at 4 m"),
        checks=(
            relative("deflection at the focus, 1 Pa", found[0], expected[0], 0.01, "um"),
            largest("deflection at 0 to 20 mm, worst", found, expected, 0.03, "um"),
            below("mean pressure of elements within 12 mm, relative L2 error", pressure, 0.10),
            below("its part that alternates within a cell", checkerboard, 0.10),
        ),
        plot=Plot(
            x="distance, mm", y="deflection, um", drawn=("closed form",),
            lines={"finite elements": (1e3 * RADII, 1e6 * found),
                   "closed form": (1e3 * r, 1e6 * expected_at(r))},
        ),
    )  # fmt: skip


def focus_at_rest_on_a_layer() -> Case:
    """Elements of 3 mm on a bonded layer, up to incompressibility."""
    depth, radii = 0.015, np.array([0.0, 0.01])
    axis = meshes.graded_axis(0.06, 0.003, meshes.Grading(radius=0.015, growth=1.5))
    mesh = meshes.extrude(axis, axis, np.linspace(-depth, 0, 6))
    answers, closed = [], []
    for poisson in RATIOS:
        material = fem.Material(density=1000, shear_modulus=25e3, poisson=poisson)
        u = fem.static(fem.assemble(mesh, material, fixed=QUARTER), focus_force(mesh))
        answers.append(on_axis(mesh, radii) @ u)
        layer = {"width": WIDTH, "shear_modulus": 25e3, "poisson": poisson, "depth": depth}
        closed.append(references.gaussian_on_bonded_layer(radii, **layer))
    found, expected = np.array(answers), np.array(closed)
    checks = []
    for k, (place, bar) in enumerate((("the focus", 0.02), ("10 mm", 0.03))):
        for nu, f, e in zip(RATIOS, found[:, k], expected[:, k], strict=True):
            checks.append(relative(f"deflection at {place}, nu = {nu:g}", f, e, bar, "um"))
    errors = 100 * np.abs(found / expected - 1)
    far = [1 / (1 - 2 * nu) for nu in RATIOS]
    return Case(
        title="Gaussian focus on a bonded layer of 15 mm, Poisson's ratio 0 to 0.49999",
        source="Vorovich, Aleksandrov and Babeshko (1974): kernel of a bonded layer",
        mesh=described(mesh, "a quarter; 3 mm, sides fixed at 60 mm"),
        checks=tuple(checks),
        plot=Plot(
            x="1 / (1 - 2 nu)", y="error, %", log=True,
            lines={"at the focus": (far, errors[:, 0]), "at 10 mm": (far, errors[:, 1])},
        ),
    )  # fmt: skip


def column_of_two_layers() -> Case:
    """A layer a million times softer than the one below it, at rest and in motion."""
    lengths, mus, rho, lag = [0.01, 0.02], [1e9, 1e3], 1000.0, 1e-4
    mesh = layered_column_mesh(lengths, 20)
    solids = {
        r: fem.Material(density=rho, shear_modulus=mu, poisson=0.45, viscosity=lag * mu)
        for r, mu in enumerate(mus)
    }
    ops, force, read = column(mesh, solids)
    moduli = [m.first_lame + 2 * m.shear_modulus for m in solids.values()]
    rest = sum(length / m for length, m in zip(lengths, moduli, strict=True))
    hz = np.array([5.0, 20.0, 50.0, 100.0])
    dynamic = [m * (1 + 2j * np.pi * hz * lag) for m in moduli]
    expected = references.layered_column(2 * np.pi * hz, lengths, [rho, rho], dynamic)
    found = fem.harmonic(ops, force, hz) @ read
    return Case(
        title="Column of two layers, stiffness ratio 1e6",
        source="Meirovitch, Principles and Techniques of Vibrations (1997), chapter 7",
        mesh=described(mesh, "40 cells high, one across"),
        checks=(
            relative("deflection at rest, 1 Pa", read @ fem.static(ops, force), rest, 1e-6, "um"),
            largest("amplitude, 5 to 100 Hz, worst", found, expected, 0.005, "um"),
        ),
    )


def layered_column_mesh(lengths: list[float], cells: int) -> TetMesh:
    """A column of one cell across, regions numbered from the base upwards."""
    ends = np.concatenate([[0], np.cumsum(lengths)]) - sum(lengths)
    z = np.concatenate([[ends[0]], *(np.linspace(a, b, cells + 1)[1:] for a, b in pairwise(ends))])
    side = [0.0, min(lengths) / cells * 2]
    mesh = meshes.extrude(side, side, z)
    middle = mesh.points[mesh.tets[:, :4]].mean(axis=1)[:, 2]
    region = np.searchsorted(ends[1:-1], middle)
    return TetMesh(points=mesh.points, tets=mesh.tets, region=region, facets=mesh.facets)


def column(mesh: TetMesh, solids: dict[int, fem.Material]) -> tuple[fem.Operators, Floats, Floats]:
    """Operators of a column whose sides slide, the force of 1 Pa, and its mean top as (3 n,)."""
    ops = fem.assemble(
        mesh, solids,
        fixed={"bottom": "xyz", "left": "x", "right": "x", "front": "y", "back": "y"},
    )  # fmt: skip
    P = fem.load_operator(mesh)
    force = P @ np.ones(P.shape[1])
    return ops, force, force / np.abs(force).sum()


def _pressure_errors(mesh: TetMesh, u: Floats, material: fem.Material) -> tuple[float, float]:
    """Element means of pressure near the focus: error in L2, and its share within cells."""
    corners = mesh.points[mesh.tets[:, :4]]
    middle = corners.mean(axis=1)
    near = np.flatnonzero(np.linalg.norm(middle, axis=1) < 0.012)
    found, volume = _element_pressures(mesh, u, material, near)
    r, depth, nu = np.hypot(*middle[near, :2].T), -middle[near, 2], material.poisson
    closed = references.gaussian_mean_pressure(r, depth, width=WIDTH, poisson=nu)
    error = found - closed
    cell = _cells(mesh, near)
    average = np.bincount(cell, volume * error) / np.bincount(cell, volume)

    def size(values: Floats) -> float:
        return float(np.sqrt(volume @ values**2))

    return size(error) / size(closed), size(error - average[cell]) / size(closed)


def _element_pressures(
    mesh: TetMesh, u: Floats, material: fem.Material, chosen: Ints
) -> tuple[Floats, Floats]:
    """Mean pressures of elements, most of it from the projected divergence, and their volumes."""
    corners = mesh.points[mesh.tets[:, :4]]
    edges = corners[:, 1:] - corners[:, :1]
    # The gradient of a quadratic field is linear: its mean is its value in the middle.
    D = shape_derivatives(np.full((1, 4), 0.25), 10)[0]
    moved = u.reshape(-1, 3)[mesh.tets]
    dilatation = np.einsum("eai,al,eil->e", moved, D, np.linalg.inv(edges), optimize=True)
    cluster, sloping = macroelements(mesh)
    at_points = linear_functions(mesh, cluster, sloping)
    coefficients = (projected_divergence(mesh) @ u).reshape(-1, 4)[cluster]
    projected = np.einsum("eqv,ev->eq", at_points, coefficients).mean(axis=1)
    lam, mu = np.array([material.first_lame]), np.array([material.shear_modulus])
    direct = direct_part(lam, mu)
    pressure = -(direct + 2 / 3 * mu) * dilatation - (lam - direct) * projected
    return pressure[chosen], np.linalg.det(edges)[chosen] / 6


def _cells(mesh: TetMesh, chosen: Ints) -> Ints:
    """Number, from 0, of the grid cell that each tetrahedron lies in."""
    corners = mesh.points[mesh.tets[chosen, :4]]
    _, cell = np.unique(corners.min(axis=1).round(9), axis=0, return_inverse=True)
    return cell.ravel()


def _round(points: Floats, square: TetMesh) -> TetMesh:
    """Ten-node tetrahedra between the corners of a mesh, which are moved to other points."""
    used, tets = np.unique(square.tets[:, :4], return_inverse=True)
    facets = {name: np.searchsorted(used, f[:, :3]) for name, f in square.facets.items()}
    return meshes.quadratic(TetMesh(points=points[used], tets=tets.reshape(-1, 4), facets=facets))
