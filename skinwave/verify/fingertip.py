"""Fingertip with a bone inside: two materials of one mesh, beside another finite-element code."""

import numpy as np

import fem
import meshes
from meshes import TetMesh
from skinwave.verify.case import Case, described, largest
from skinwave.verify.references import Complex, Floats

SHAPE = meshes.Fingertip(
    breadth=0.016, length=0.025, thickness=0.013, bone_breadth=0.007, bone_thickness=0.004,
    cover=0.006, tip=0.004,
)  # fmt: skip
SIZE, FREQUENCY = 4e-3, 140.0  # m, Hz
# At most 0.45, up to which no stiffness is projected: both codes have the same elements.
TISSUE = fem.Material(density=1000, shear_modulus=25e3, poisson=0.45, viscosity=5.0)
BONE = fem.PRESETS["bone"]
CASES = {"with bone": {0: TISSUE, 1: BONE}, "without": {0: TISSUE, 1: TISSUE}}
READ = ("work", "motion", "tip", "end of the bone")
THEIRS = {  # `summary` of scikit-fem's motion
    ("with bone", "at rest"): (
        0.6418072421356115, 0.2466061863954612, -0.007529687876997654, -0.0002901458322150343,
    ),
    ("with bone", "140 Hz"): (
        0.8508287974499185 - 0.2190162904349815j, 0.3712460537507848,
        -0.017453927090571798 + 0.008148737831427976j,
        -0.00048347458229874884 + 6.596109094444294e-05j,
    ),
    ("without", "at rest"): (
        11.987988648899172, 9.834520952415195, -0.6431852902491929, -0.5354230496036667,
    ),
    ("without", "140 Hz"): (
        -0.795102341766092 - 0.21451826572482777j, 0.9398216117609057,
        -0.020991473820314372 - 0.010003558544689699j,
        0.0027056627747315894 - 0.0056167850245336624j,
    ),
}  # fmt: skip
WIDTH = 4.35e-3  # m, standard deviation of the push


def straight_fingertip() -> TetMesh:
    """Ten-node tetrahedra with straight sides."""
    mesh = meshes.fingertip_mesh(SHAPE, SIZE)
    corners, tets = np.unique(mesh.tets[:, :4], return_inverse=True)
    facets = {name: np.searchsorted(corners, f[:, :3]) for name, f in mesh.facets.items()}
    flat = TetMesh(
        points=mesh.points[corners], tets=tets.reshape(-1, 4), region=mesh.region, facets=facets
    )
    return meshes.quadratic(flat)


def push(mesh: TetMesh) -> Floats:
    """Nodal forces (3 n,) in N, downwards on the nodes of the top about the origin."""
    top = np.unique(mesh.facets["top"])
    force = np.zeros(mesh.points.shape)
    force[top, 2] = -np.exp(-(mesh.points[top, :2] ** 2).sum(axis=1) / 2 / WIDTH**2)
    return force.ravel()


def motion(mesh: TetMesh, materials: dict[int, fem.Material]) -> tuple[Floats, Complex]:
    """Motion (3 n,) in metre at rest and at `FREQUENCY`, of a fingertip held at its cut."""
    ops, force = fem.assemble(mesh, materials, fixed="sides"), push(mesh)
    return fem.static(ops, force), fem.harmonic(ops, force, FREQUENCY)[0]


def summary(mesh: TetMesh, u: Complex) -> Complex:
    """Work of the push in J, the root of the summed squares of u (3 n,), and the height of the tip
    and of the end of the bone, in metre.
    """
    inside = np.unique(mesh.tets[mesh.region == 1])
    ends = [nodes[np.argmax(mesh.points[nodes, 1])] for nodes in (np.unique(mesh.tets), inside)]
    return np.array([push(mesh) @ u, np.linalg.norm(u), *u.reshape(-1, 3)[ends, 2]])


def beside_another_code() -> Case:
    """The same mesh by scikit-fem, at rest and at one line, with the bone and without."""
    mesh = straight_fingertip()
    checks, work = [], {}
    for name, materials in CASES.items():
        for when, u in zip(("at rest", f"{FREQUENCY:g} Hz"), motion(mesh, materials), strict=True):
            found = summary(mesh, u)
            work[name, when] = abs(found[0])
            checks += [
                largest(f"{what}, {name}, {when}", one, other, 1e-9)
                for what, one, other in zip(READ, found, THEIRS[name, when], strict=True)
            ]
    ratio = {when: work["without", when] / work["with bone", when] for _, when in work}
    return Case(
        title="A fingertip with a bone inside, two materials of one mesh, beside another code",
        source="scikit-fem 12.0.2 on the same nodes, elements and forces (Gustafsson and McBain, J "
        "Open Source Softw 5:2369 (2020)): python -m bench.fingertip, where all nodes are compared",
        mesh=described(mesh, f"straight sides; held at its cut; nu = {TISSUE.poisson:g} in tissue"),
        checks=tuple(checks),
        note="Without the bone the push does "
        + " and ".join(f"{x:.2g} times the work {when}" for when, x in ratio.items())
        + ": it holds the tissue, and is the beam that carries it.",
    )
