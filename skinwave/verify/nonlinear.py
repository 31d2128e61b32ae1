"""Large deflection: elastica, disc, rotation, tangent, energy, and reduction."""

from dataclasses import replace
from itertools import islice

import numpy as np

import fem
import meshes
from fem import nonlinear
from meshes import TetMesh
from simple_model import MovingPressure, Tacton
from skinwave.models.stretching import meshed_sheet, stretching_body
from skinwave.planning.simulate import compute
from skinwave.scene.scene import BODIES, Scene
from skinwave.verify.case import Checks, below, case, misfit, relative
from skinwave.verify.references import elastica as elastica_tip
from skinwave.verify.references import karman_disc
from skinwave.verify.setups import SOURCES

SHEET = BODIES["paper-sheet-loose"]


@case(
    "Bisshopp and Drucker, Q Appl Math 3:272 (1945); Mattiasson, Int J Numer Methods Eng 17:145 "
    "(1981)",
    mesh="20 by 1 by 1 cells, thickness / length = 0.02, nu = 0",
)
def elastica() -> Checks:
    """Elastica: clamped strip under a force at its tip."""
    width, thickness = 0.05, 0.02
    material = fem.from_young(density=1, young=1e9, poisson=0.0)
    mesh = meshes.extrude(np.linspace(0, 1, 21), [0, width], [-thickness, 0])
    body = fem.finite_strain(mesh, material, fixed={"left": "xyz"})
    share = np.asarray(fem.pressure_operator(mesh, "right").sum(axis=1))[::3]
    share /= share.sum()
    for load in (0.5, 1.0):
        force = np.zeros((len(mesh.points), 3))
        force[:, 2] = -share * load * material.young * width * thickness**3 / 12
        tip = share @ nonlinear.static(body, force.ravel()).reshape(-1, 3)
        deflection, shortening = elastica_tip(load)
        what = f"over length, P L^2 / E I = {load:g}"
        yield relative(f"tip deflection {what}", -tip[2], deflection, 0.01)
        yield relative(f"shortening {what}", -tip[0], shortening, 0.01)


@case(
    "von Karman's equations: Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells (1959), "
    "chapter 13; Way, Trans ASME 56:627 (1934)",
    mesh="a quarter, 16 rings, one cell thick, thickness / radius = 0.04",
    note="The approximate formula w + 0.488 w^3 / h^2 = q a^4 / 64 D (Timoshenko, chapter 13) "
    "gives 0.774 and 1.86, which is 2.1 % and 5.2 % above the solution of the equations.",
)
def clamped_disc() -> Checks:
    """Clamped disc with an immovable edge, deflected by up to 1.8 thicknesses."""
    radius, paper, meshed = 0.05, replace(SHEET.solid, loss_factor=0.0), 2e-3
    mesh = quarter_disc(radius, meshed, 16)
    P, S = fem.pressure_operator(mesh), fem.probe_operator(mesh, [[0, 0]])
    for name, thickness in (("solid", meshed), ("equivalent of 0.1 mm", 1e-4)):
        # A thin disc is meshed as a thick one of the same bending stiffness, with a membrane.
        ratio = thickness / meshed
        solid = replace(paper, shear_modulus=paper.shear_modulus * ratio**3)
        missing = thickness * (1 - ratio**2)
        layer = fem.Membrane(triangles=meshes.middle_plane(mesh), thickness=missing, material=paper)
        body = fem.finite_strain(
            mesh, solid, fixed={"rim": "xyz", "left": "x", "front": "y"},
            membrane=layer if missing else None,
        )  # fmt: skip
        stiffness = paper.young * thickness**3 / 12 / (1 - paper.poisson**2)
        for load in (1.0, 5.0):
            pressure = np.full(P.shape[1], 64 * load * stiffness * thickness / radius**4)
            deflection = (S @ nonlinear.static(body, P @ pressure))[0] / thickness
            what = f"{name}: w / h at q a^4 / 64 D h = {load:g}"
            yield relative(what, deflection, karman_disc(load, paper.poisson), 0.05)


@case(
    "Bonet and Wood, Nonlinear Continuum Mechanics for Finite Element Analysis (1997), chapters 3 "
    "and 7: E = (F^T F - 1) / 2 = 0 under rotation, consistent linearisation; central differences",
    mesh="block of 2 by 2 by 1 cells, displaced at random; with 10 nodes also a membrane inside",
)
def tangent() -> Checks:
    """Rigid rotation without stress; tangent and force as derivatives of force and energy."""
    turn, _ = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))
    turn *= np.linalg.det(turn)
    random, step = np.random.default_rng(4), 1e-5
    material = fem.from_young(density=1000, young=1e6, poisson=0.3)
    for order, nodes in ((1, 4), (2, 10)):
        mesh, layer = meshes.block((0.02, 0.02, 0.01), 0.01, order=order), None
        if order == 2:
            triangles = meshes.middle_plane(mesh)
            layer = fem.Membrane(triangles=triangles, thickness=1e-3, material=material)
        x = mesh.points
        body = fem.finite_strain(mesh, material, fixed=0 * x, membrane=layer)
        forces = [np.abs(body.internal(u.ravel())).max() for u in (x @ turn.T - x, 0.3 * x)]
        what = f"{nodes} nodes: largest force in a rotation, over that in 30 % stretch"
        yield below(what, forces[0] / forces[1], 1e-10)
        u, du = (1e-3 * random.standard_normal(x.size) for _ in range(2))
        ahead, behind = (u + sign * step * du for sign in (1, -1))
        difference = (body.internal(ahead) - body.internal(behind)) / 2 / step
        yield misfit(f"{nodes} nodes: K du, N", body.tangent(u) @ du, difference, 1e-7)
        work = (body.energy(ahead) - body.energy(behind)) / 2 / step
        yield relative(f"{nodes} nodes: f du, J", body.internal(u) @ du, work, 1e-7)


@case(
    f"{SOURCES['Hughes']}: average acceleration conserves the energy of a linear body, and of a "
    "nonlinear one to second order in the step",
    mesh="4 by 4 by 1 cells, no loss; steps of 0.1 ms",
)
def free_energy() -> Checks:
    """Free oscillation of a sheet released from three thicknesses, 800 steps."""
    lossless = replace(SHEET, material=replace(SHEET.solid, loss_factor=0.0))
    made = meshed_sheet(lossless, min(SHEET.width, SHEET.height) / 4)
    mesh, body = made.mesh, stretching_body(lossless, made)
    P, S = fem.pressure_operator(mesh), fem.probe_operator(mesh, [[0, 0]])
    # 6 Pa deflect the coarse sheet by three thicknesses.
    u = nonlinear.static(body, P @ np.full(P.shape[1], 6.2))
    start, steps = replace(fem.at_rest(mesh.n_dofs), displacement=u), 800
    states = nonlinear.dynamic(body, lambda t: 0 * u, 1e-4, initial=start, tolerance=1e-3)
    energies = [fem.mechanical_energy(body, s) for s in islice(states, steps + 1)]
    drift = np.array(energies) / energies[0] - 1
    late = np.abs(drift[-steps // 4 :].mean() - drift[: steps // 4].mean())
    yield relative("released from, w / h", (S @ u)[0] / SHEET.depth, 3.0, 0.05)
    yield below("largest change of energy, relative", np.abs(drift).max(), 0.01)
    yield below("drift from the first to the last quarter", late, 0.01)


@case(
    "the same equations without reduction; Hollkamp and Gordon, J Sound Vib 318:1139 (2008): "
    "implicit condensation",
    mesh="a sheet of 60 mm in 8 by 8 by 1 cells, 0.02 s of a Tacton", slow=True,
)  # fmt: skip
def modes_or_all() -> Checks:
    """Sheet in its bending modes against all of its degrees of freedom."""
    tacton = Tacton(am_frequency=140.0, duration=0.02)
    pressure = MovingPressure(tacton=tacton, drive="pressure_squared")
    small = replace(SHEET, width=0.06, height=0.06)
    scene = Scene(pressure=pressure, body=small, probes=((0.0, 0.0), (0.01, 0.005)))
    modes, full = (
        compute(scene, model, h=small.width / 8)
        for model in ("fem-nonlinear", "fem-nonlinear-transient")
    )
    swing = full.displacement - full.displacement.mean(axis=0)
    error = (modes.displacement - full.displacement) / np.linalg.norm(swing, axis=0)
    for k, e in enumerate(error.T):
        yield below(f"probe {k + 1}, over its motion about the mean", np.linalg.norm(e), 0.03)


def quarter_disc(radius: float, thickness: float, rings: int) -> TetMesh:
    """Return a quarter of a disc with facet sets `top`, `rim`, `left` (x = 0), `front` (y = 0)."""
    ring = np.repeat(np.arange(rings + 1), np.arange(1, rings + 2))
    first = np.arange(rings + 1) * np.arange(1, rings + 2) // 2
    place = np.arange(len(ring)) - first[ring]
    angle = np.pi / 2 * place / np.maximum(ring, 1)
    flat = radius / rings * ring[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    inner = np.flatnonzero(ring < rings)
    below_it = first[ring[inner] + 1] + place[inner]
    outward = np.column_stack([inner, below_it, below_it + 1])
    inward = np.column_stack([inner, below_it + 1, inner + 1])[place[inner] < ring[inner]]
    mesh = meshes.extrude_plane(flat, np.vstack([outward, inward]), [-thickness, 0])
    facets = meshes.boundary_facets(mesh.tets)
    x, y, z = np.moveaxis(mesh.points[facets[:, :3]], 2, 0)
    near = 1e-9 * radius
    on = {
        "top": z > -near, "left": x < near, "front": y < near,
        "rim": np.hypot(x, y) > radius - near,
    }  # fmt: skip
    return replace(mesh, facets={name: facets[where.all(axis=1)] for name, where in on.items()})
