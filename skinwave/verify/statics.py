"""Bodies at rest: half-space, layers, columns, and a fingertip by another code."""

import numpy as np

import fem
import meshes
from meshes import TetMesh
from skinwave.typing import Array
from skinwave.verify import references
from skinwave.verify.case import Checks, case, relative
from skinwave.verify.setups import (
    QUARTER,
    RADII,
    SOURCES,
    WIDTH,
    column,
    gaussian,
    push,
    quarter_space,
    read,
)


@case(
    f"{SOURCES['Boussinesq']}; Johnson (1985), section 3.2",
    mesh="a quarter; 2.5 mm at the focus, sides at 4 m", slow=True,
)  # fmt: skip
def focus_at_rest() -> Checks:
    """Gaussian focus at rest on a half-space, nu = 0.4999."""
    material = fem.Material(density=1000, shear_modulus=7.86e3, poisson=0.4999)
    mesh = quarter_space(4.0, 1.7, 0.01)
    u = fem.static(fem.assemble(mesh, material, fixed=QUARTER), push(mesh, gaussian()))
    exact = references.gaussian_at_rest(RADII, width=WIDTH, shear_modulus=7.86e3, poisson=0.4999)
    deflection = read(mesh, u, RADII)
    yield relative("deflection at the focus, 1 Pa", deflection[0], exact[0], 0.01, "um")
    yield relative("deflection at 0 to 20 mm, worst", deflection, exact, 0.03, "um")


@case(
    "Vorovich, Aleksandrov and Babeshko (1974): kernel of a bonded layer",
    mesh="a quarter; cells of 3 mm, sides fixed at 60 mm",
)
def poisson_ratios() -> Checks:
    """Gaussian focus on a bonded layer of 15 mm, Poisson's ratio 0 to 0.49999."""
    depth, radii = 0.015, np.array([0.0, 0.01])
    axis = meshes.graded_axis(0.06, 0.003, meshes.Grading(radius=0.015, growth=1.5))
    mesh = meshes.extrude(axis, axis, np.linspace(-depth, 0, 6))
    for nu in (0.0, 0.45, 0.49, 0.499, 0.4999, 0.49999):
        material = fem.Material(density=1000, shear_modulus=25e3, poisson=nu)
        u = fem.static(fem.assemble(mesh, material, fixed=QUARTER), push(mesh, gaussian()))
        exact = references.gaussian_on_bonded_layer(
            radii, width=WIDTH, shear_modulus=25e3, poisson=nu, depth=depth
        )
        at_focus, beside = zip(read(mesh, u, radii), exact, strict=True)
        yield relative(f"deflection at the focus, nu = {nu:g}", *at_focus, 0.02, "um")
        yield relative(f"deflection at 10 mm, nu = {nu:g}", *beside, 0.03, "um")


@case(
    f"{SOURCES['Meirovitch']}, chapter 7",
    mesh="40 cells high, one across",
)
def stiffness_contrast() -> Checks:
    """Column of two layers, stiffness ratio 1e6."""
    lengths, mus, rho, lag = [0.01, 0.02], [1e9, 1e3], 1000.0, 1e-4
    solids = {
        r: fem.Material(density=rho, shear_modulus=mu, poisson=0.45, viscosity=lag * mu)
        for r, mu in enumerate(mus)
    }
    ops, force, top = column(lengths, 20, solids)
    moduli = [m.first_lame + 2 * m.shear_modulus for m in solids.values()]
    rest = sum(length / m for length, m in zip(lengths, moduli, strict=True))
    hz = np.array([5.0, 20.0, 50.0, 100.0])
    dynamic = [m * (1 + 2j * np.pi * hz * lag) for m in moduli]
    exact = references.layered_column(2 * np.pi * hz, lengths, [rho, rho], dynamic)
    yield relative("deflection at rest, 1 Pa", top @ fem.static(ops, force), rest, 1e-6, "um")
    amplitudes = fem.harmonic(ops, force, hz) @ top
    yield relative("amplitude, 5 to 100 Hz, worst", amplitudes, exact, 0.005, "um")


TISSUE = fem.Material(density=1000, shear_modulus=25e3, poisson=0.45, viscosity=5.0)
FINGERTIPS = {"with bone": {0: TISSUE, 1: fem.PRESETS["bone"]}, "without": {0: TISSUE, 1: TISSUE}}
FREQUENCY = 140.0  # Hz
SCIKIT_FEM = {  # `fingertip_summary` of scikit-fem's motion, at rest and at the frequency
    "with bone": (
        (0.6418072421356115, 0.2466061863954612, -0.007529687876997654, -0.0002901458322150343),
        (0.8508287974499185 - 0.2190162904349815j, 0.3712460537507848,
         -0.017453927090571798 + 0.008148737831427976j,
         -0.00048347458229874884 + 6.596109094444294e-05j),
    ),
    "without": (
        (11.987988648899172, 9.834520952415195, -0.6431852902491929, -0.5354230496036667),
        (-0.795102341766092 - 0.21451826572482777j, 0.9398216117609057,
         -0.020991473820314372 - 0.010003558544689699j,
         0.0027056627747315894 - 0.0056167850245336624j),
    ),
}  # fmt: skip


@case(
    "scikit-fem 12.0.2 on the same nodes, elements and forces (Gustafsson and McBain, J Open "
    "Source Softw 5:2369 (2020)): python -m bench.beside fingertip, where all nodes are compared",
    mesh="ten-node tetrahedra with straight sides, 4 mm, fixed at the cut",
)
def fingertip_with_bone() -> Checks:
    """Fingertip with a bone, two materials in one mesh, compared with another code."""
    mesh = fingertip()
    for name, materials in FINGERTIPS.items():
        times = "at rest", f"{FREQUENCY:g} Hz"
        motions = zip(times, fingertip_motion(mesh, materials), SCIKIT_FEM[name], strict=True)
        for when, u, theirs in motions:
            names = ("work", "motion", "tip", "end of the bone")
            for what, one, other in zip(names, fingertip_summary(mesh, u), theirs, strict=True):
                yield relative(f"{what}, {name}, {when}", one, other, 1e-9)


def fingertip() -> TetMesh:
    """Return a fingertip of ten-node tetrahedra with straight sides."""
    # Fingertip with nu = 0.45 at most, up to which no stiffness is projected, as in the other code.
    shape = meshes.Fingertip(
        breadth=0.016, length=0.025, thickness=0.013, bone_breadth=0.007, bone_thickness=0.004,
        cover=0.006, tip=0.004,
    )  # fmt: skip
    mesh = meshes.fingertip_mesh(shape, 4e-3)
    used, tets = np.unique(mesh.tets[:, :4], return_inverse=True)
    facets = {name: np.searchsorted(used, f[:, :3]) for name, f in mesh.facets.items()}
    return meshes.quadratic(TetMesh(
        points=mesh.points[used], tets=tets.reshape(-1, 4), region=mesh.region, facets=facets
    ))  # fmt: skip


def fingertip_push(mesh: TetMesh) -> Array:
    """Return nodal forces (3 n,) in N, downwards on the nodes of the top around the origin."""
    top = np.unique(mesh.facets["top"])
    force = np.zeros(mesh.points.shape)
    force[top, 2] = -gaussian()(mesh.points[top])
    return force.ravel()


def fingertip_motion(mesh: TetMesh, materials: dict[int, fem.Material]) -> tuple[Array, Array]:
    """Return the motion (3 n,) in m of a fingertip fixed at its cut, at rest and at 140 Hz."""
    ops, force = fem.assemble(mesh, materials, fixed="sides"), fingertip_push(mesh)
    return fem.static(ops, force), fem.harmonic(ops, force, FREQUENCY)[0]


def fingertip_summary(mesh: TetMesh, u: Array) -> Array:
    """Return work in J, the norm of u, and heights in m of the tip and the end of the bone."""
    inside = np.unique(mesh.tets[mesh.region == 1])
    ends = [nodes[np.argmax(mesh.points[nodes, 1])] for nodes in (np.unique(mesh.tets), inside)]
    return np.array([fingertip_push(mesh) @ u, np.linalg.norm(u), *u.reshape(-1, 3)[ends, 2]])
