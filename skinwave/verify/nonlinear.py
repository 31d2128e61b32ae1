"""Large deflection: elastica, disc, rotation, tangent, energy, the linear limit, and its limits."""

from dataclasses import replace
from functools import cache
from itertools import islice

import numpy as np

import fem
import meshes
from fem import nonlinear
from fem.load_and_probe import facet_geometry
from meshes import TetMesh
from meshes.tetmesh import Floats
from simple_model import MovingPressure, Response, Tacton, lines
from skinwave.models.stretching import meshed_sheet, stretching_body
from skinwave.planning.simulate import compute
from skinwave.scene.scene import BODIES, Body, Scene
from skinwave.verify.case import Case, Check, Plot, below, described, misfit, relative
from skinwave.verify.deflected import elastica as bent
from skinwave.verify.deflected import karman_disc

PAPER = BODIES["paper-sheet-loose"]
SMALL = replace(PAPER, width=0.06, height=0.06)
BONET = "Bonet and Wood, Nonlinear Continuum Mechanics for Finite Element Analysis (1997)"
AM = 140.0  # Hz


def elastica() -> Case:
    """A thin strip bent by a dead load at its tip."""
    length, width, thickness = 1.0, 0.05, 0.02
    material = fem.from_young(density=1, young=1e9, poisson=0.0)
    mesh = meshes.extrude(np.linspace(0, length, 21), [0, width], [-thickness, 0])
    body = fem.finite_strain(mesh, material, fixed={"left": "xyz"})
    N, normals = facet_geometry(mesh, mesh.facets["right"])
    share = np.zeros(len(mesh.points))
    np.add.at(share, mesh.facets["right"], np.einsum("qa,eqi->ea", N, normals))
    share /= share.sum()
    checks = []
    for load in (0.5, 1.0):
        force = np.zeros((len(mesh.points), 3))
        force[:, 2] = -share * load * material.young * width * thickness**3 / 12 / length**2
        tip = share @ nonlinear.static(body, force.ravel()).reshape(-1, 3)
        deflection, shortening = bent(load)
        what = f"over length, P L^2 / E I = {load:g}"
        checks.append(relative(f"tip deflection {what}", -tip[2], deflection, 0.01))
        checks.append(relative(f"shortening {what}", -tip[0], shortening, 0.01))
    return Case(
        title="Elastica: a clamped strip under a force at its tip",
        source="Bisshopp and Drucker, Q Appl Math 3:272 (1945); Mattiasson, Int J Numer Methods "
        "Eng 17:145 (1981)",
        mesh=described(mesh, "20 by 1 by 1 cells, thickness / length = 0.02, nu = 0"),
        checks=tuple(checks),
    )


def clamped_disc() -> Case:
    """A thin disc as a solid, and as a thick one with a membrane in it."""
    radius, paper = 0.05, replace(PAPER.solid, loss_factor=0.0)
    checks = []
    for name, thickness, meshed in (("solid", 2e-3, 2e-3), ("equivalent of 0.1 mm", 1e-4, 2e-3)):
        mesh = quarter_disc(radius, meshed, 16)
        ratio = thickness / meshed
        solid = replace(paper, shear_modulus=paper.shear_modulus * ratio**3)
        missing = thickness * (1 - ratio**2)
        layer = fem.Membrane(triangles=meshes.middle_plane(mesh), thickness=missing, material=paper)
        body = fem.finite_strain(
            mesh, solid, fixed={"rim": "xyz", "left": "x", "front": "y"},
            membrane=layer if missing else None,
        )  # fmt: skip
        P, S = fem.load_operator(mesh), fem.probe_operator(mesh, [[0, 0]])
        stiffness = paper.young * thickness**3 / 12 / (1 - paper.poisson**2)
        for load in (1.0, 5.0):
            pressure = np.full(P.shape[1], 64 * load * stiffness * thickness / radius**4)
            found = float((S @ nonlinear.static(body, P @ pressure))[0]) / thickness
            what = f"{name}: w / h at q a^4 / 64 D h = {load:g}"
            checks.append(relative(what, found, karman_disc(load, paper.poisson), 0.05))
    return Case(
        title="Clamped disc, its edge immovable, deflected by up to 1.8 thicknesses",
        source="von Karman's equations: Timoshenko and Woinowsky-Krieger, Theory of Plates and "
        "Shells (1959), chapter 13; Way, Trans ASME 56:627 (1934)",
        mesh=described(mesh, "a quarter, 16 rings, one cell thick, thickness / radius = 0.04"),
        checks=tuple(checks),
        note="The formula w + 0.488 w^3 / h^2 = q a^4 / 64 D (Timoshenko, chapter 13) has 0.774 "
        "and 1.86, 2.1 and 5.2 % above the solution of the equations that it approximates.",
    )


def quarter_disc(radius: float, thickness: float, rings: int) -> TetMesh:
    """A quarter of a disc, its facet sets `top`, `rim`, `left` (x = 0) and `front` (y = 0)."""
    ring = np.repeat(np.arange(rings + 1), np.arange(1, rings + 2))
    first = np.arange(rings + 1) * np.arange(1, rings + 2) // 2
    place = np.arange(len(ring)) - first[ring]
    angle = np.pi / 2 * place / np.maximum(ring, 1)
    flat = radius / rings * ring[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    inner = np.flatnonzero(ring < rings)
    below_it = first[ring[inner] + 1] + place[inner]
    outward = np.column_stack([inner, below_it, below_it + 1])
    inward = np.column_stack([inner, below_it + 1, inner + 1])[place[inner] < ring[inner]]
    mesh = meshes.extruded(flat, np.vstack([outward, inward]), [-thickness, 0])
    facets = meshes.boundary_facets(mesh.tets)
    x, y, z = np.moveaxis(mesh.points[facets[:, :3]], 2, 0)
    near = 1e-9 * radius
    on = {
        "top": z > -near, "left": x < near, "front": y < near,
        "rim": np.hypot(x, y) > radius - near,
    }  # fmt: skip
    sets = {name: facets[where.all(axis=1)] for name, where in on.items()}
    return replace(mesh, facets=sets)


def rigid_rotation() -> Case:
    """A body turned round without being deformed."""
    checks = []
    turn, _ = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))
    turn *= np.linalg.det(turn)
    for order, mesh in _blocks():
        body = _elastic(mesh, order)
        x = mesh.points
        turned = (x @ turn.T - x).ravel()
        stretched = (0.3 * x).ravel()
        forces = [np.abs(body.internal(u)).max() for u in (turned, stretched)]
        what = f"{4 if order == 1 else 10} nodes: largest force, over that of 30 % stretch"
        checks.append(below(what, forces[0] / forces[1], 1e-10))
    return Case(
        title="A rigid rotation makes no stress",
        source=f"{BONET}, chapter 3: E = (F^T F - 1) / 2 = 0",
        mesh="block of 2 by 2 by 1 cells; with 10 nodes also a membrane within",
        checks=tuple(checks),
    )


def tangent() -> Case:
    """The tangent against differences of the force, and the force against those of the energy."""
    checks = []
    random, step = np.random.default_rng(4), 1e-5
    for order, mesh in _blocks():
        body = _elastic(mesh, order)
        u, du = (1e-3 * random.standard_normal(mesh.n_dofs) for _ in range(2))
        ahead, behind = (u + sign * step * du for sign in (1, -1))
        difference = (body.internal(ahead) - body.internal(behind)) / 2 / step
        nodes = f"{4 if order == 1 else 10} nodes"
        checks.append(misfit(f"{nodes}: K du, N", body.tangent(u) @ du, difference, 1e-7))
        work = (body.energy(ahead) - body.energy(behind)) / 2 / step
        checks.append(relative(f"{nodes}: f du, J", body.internal(u) @ du, work, 1e-7))
    return Case(
        title="Tangent and force are derivatives of force and energy",
        source=f"{BONET}, chapter 7: consistent linearisation; central differences",
        mesh="block of 2 by 2 by 1 cells, displaced at random; 10 nodes: also a membrane within",
        checks=tuple(checks),
    )


def _blocks() -> list[tuple[int, TetMesh]]:
    return [(order, meshes.block((0.02, 0.02, 0.01), 0.01, order=order)) for order in (1, 2)]


def _elastic(mesh: TetMesh, order: int) -> fem.Elastic:
    """A free body, of 10-node tetrahedra with a membrane."""
    material = fem.from_young(density=1000, young=1e6, poisson=0.3)
    layer = None
    if order == 2:
        triangles = meshes.middle_plane(mesh)
        layer = fem.Membrane(triangles=triangles, thickness=1e-3, material=material)
    return fem.finite_strain(mesh, material, fixed=np.zeros((len(mesh.points), 3)), membrane=layer)


@cache
def _sheet(body: Body, cells: int) -> tuple[TetMesh, fem.Elastic]:
    made = meshed_sheet(body, min(body.width, body.height) / cells)
    return made.mesh, stretching_body(body, made)


def linear_limit() -> Case:
    """A push so small that nothing stretches, stepped by both codes."""
    mesh, body = _sheet(PAPER, 8)
    P, points = fem.load_operator(mesh), fem.facet_points(mesh)[:, :2]
    push = P @ (50e-4 * np.exp(-((points - [0.01, 0]) ** 2).sum(axis=1) / 2 / 4.35e-3**2))
    S, dt, steps = fem.probe_operator(mesh, [[0.0, 0.0], [0.02, 0.01]]), 1e-4, 100

    def force(t: float) -> Floats:
        return push * np.sin(2 * np.pi * AM * t) ** 2

    with_it = nonlinear.dynamic(body, lambda t, u: force(t), dt, tolerance=1e-8)
    without = fem.transient(body.operators, force, dt)
    found, linear = (
        np.array([S @ s.displacement for s in islice(states, steps)])
        for states in (with_it, without)
    )
    return Case(
        title="At 1e-4 of the load the nonlinear sheet moves like the linear one",
        source="von Karman's plate becomes Kirchhoff's as w / h vanishes: Timoshenko and "
        "Woinowsky-Krieger (1959), chapter 13",
        mesh=described(mesh, f"8 by 8 by 1 cells; {steps} steps of {1e3 * dt:g} ms"),
        checks=(misfit("two probes, relative L2", found, linear, 1e-6, "m"),),
    )


def free_energy() -> Case:
    """Free oscillation of three thicknesses, by average acceleration."""
    mesh, body = _sheet(replace(PAPER, material=replace(PAPER.solid, loss_factor=0.0)), 4)
    P, S = fem.load_operator(mesh), fem.probe_operator(mesh, [[0, 0]])
    # 6 Pa deflect the coarse sheet by three thicknesses.
    u = nonlinear.static(body, P @ np.full(P.shape[1], 6.2))
    start, steps, dt = replace(fem.at_rest(mesh.n_dofs), displacement=u), 800, 1e-4
    moved = nonlinear.dynamic(body, lambda t, u: 0 * u, dt, initial=start, tolerance=1e-3)
    states = list(islice(moved, steps + 1))
    energy = np.array([nonlinear.total_energy(body, s) for s in states])
    centre = np.array([(S @ s.displacement)[0] for s in states])
    drift = energy / energy[0] - 1
    late = np.abs(drift[-steps // 4 :].mean() - drift[: steps // 4].mean())
    return Case(
        title="Free oscillation of a sheet from three thicknesses, 800 steps",
        source="Hughes, The Finite Element Method (1987), chapter 9: average acceleration "
        "conserves the energy of a linear body; of a nonlinear one to second order in the step",
        mesh=described(mesh, f"4 by 4 by 1 cells, no loss; steps of {1e3 * dt:g} ms"),
        checks=(
            relative("released from, w / h", (S @ u)[0] / PAPER.depth, 3.0, 0.05),
            below("largest change of energy, relative", np.abs(drift).max(), 0.01),
            below("drift from the first to the last quarter", late, 0.01),
        ),
        plot=Plot(
            x="time, ms", y="energy / energy at the start - 1", drawn=("energy",),
            lines={"energy": (1e3 * dt * np.arange(steps + 1), drift)},
        ),
        note=f"The centre moves between {centre.min() / PAPER.depth:.1f} and "
        f"{centre.max() / PAPER.depth:.1f} thicknesses.",
    )  # fmt: skip


def too_much() -> Case:
    """A thousand times the load at rest, a hundred thousand times in time."""
    mesh, body = _sheet(PAPER, 6)
    P, points = fem.load_operator(mesh), fem.facet_points(mesh)[:, :2]
    push = P @ (50e3 * np.exp(-(points**2).sum(axis=1) / 2 / 4.35e-3**2))
    said = []
    for attempt in (
        lambda: nonlinear.static(body, push),
        lambda: list(islice(nonlinear.dynamic(body, lambda t, u: 100 * push, 5e-4), 3)),
    ):
        try:
            attempt()
        except fem.Diverged as error:
            said.append(str(error))
    told = sum(all(word in text for word in ("residual", "lower the load")) for text in said)
    refused = Check(what="refusals that name residual and cure", value=told, reference=2.0,
                    error=abs(told - 2), bar=0.0)  # fmt: skip
    return Case(
        title="Fifty kilopascals on a sheet of paper, five megapascals at once",
        source=f"{BONET}, chapter 7: Newton's method converges near a solution only",
        mesh=described(mesh, "6 by 6 by 1 cells"),
        checks=(refused,),
        said=" ".join(said),
    )


def reduced_against_full() -> Case:
    """The bending modes against all dofs on the same mesh, through 0.02 s of a Tacton."""
    scene, h = _scene(SMALL, 1.0, 0.02), SMALL.width / 8
    modes, full = (compute(scene, m, h=h) for m in ("fem-nonlinear", "fem-nonlinear-transient"))
    swing = full.displacement - full.displacement.mean(axis=0)
    error = (modes.displacement - full.displacement) / np.linalg.norm(swing, axis=0)
    checks = [
        below(f"probe {k + 1}, over its motion about the mean", np.linalg.norm(e), 0.03)
        for k, e in enumerate(error.T)
    ]
    every, few = ((1e3 * u.times, 1e6 * u.displacement[:, 0]) for u in (full, modes))
    return Case(
        title="A sheet in its bending modes against all of its dofs",
        source="the same equations without reduction; Hollkamp and Gordon, J Sound Vib 318:1139 "
        "(2008): implicit condensation",
        mesh=f"a sheet of 60 mm in 8 by 8 by 1 cells, {full.effort.dofs:,} dofs, "
        f"{modes.effort.reduced_dofs} modes; {full.effort.steps} steps",
        checks=tuple(checks),
        plot=Plot(
            x="time, ms", y="displacement of the centre, um", drawn=("all dofs",),
            lines={"all dofs": every, "modes": (few[0][::10], few[1][::10])},
        ),
    )  # fmt: skip


def _scene(body: Body, amplitude: float, duration: float) -> Scene:
    tacton = Tacton(amplitude=amplitude, am_frequency=AM, duration=duration)
    pressure = MovingPressure(tacton=tacton, drive="pressure_squared")
    return Scene(pressure=pressure, body=body, probes=((0.0, 0.0), (0.01, 0.005)))


def _second_over_first(response: Response) -> float:
    first, second = lines(response, [AM, 2 * AM], settle=0.4)[:, 0]
    return float(second / first)


def amplitude_test() -> Case:
    """The line at 2 f over that at f, at a quarter, half and all of the amplitude."""
    amplitudes, h = (0.25, 0.5, 1.0), SMALL.width / 6
    found = {
        model: [_second_over_first(compute(_scene(SMALL, a, 0.1), model, h=h)) for a in amplitudes]
        for model in ("fem", "fem-nonlinear")
    }
    linear, stretching = found["fem"], found["fem-nonlinear"]
    percent = [100 * a for a in amplitudes]
    change = max(stretching) / min(stretching) - 1
    changes = Check(what="nonlinear sheet: it changes by at least 5 %", value=change,
                    reference=0.05, error=max(0.0, 0.05 - change), bar=0.0)  # fmt: skip
    return Case(
        title="Amplitude test: a line from the squared drive keeps its share, one from the sheet "
        "does not",
        source="one mode with a cubic spring: Nayfeh and Mook, Nonlinear Oscillations (1979), "
        "chapter 4; superposition for the linear sheet",
        mesh="a sheet of 60 mm in 6 by 6 by 1 cells, focus at rest, AM at 140 Hz",
        checks=(
            below("linear sheet: spread of the ratio", max(linear) / min(linear) - 1, 1e-3),
            changes,
        ),
        plot=Plot(
            x="amplitude, %", y="line at 2 f / line at f",
            lines={"linear sheet": (percent, linear), "nonlinear sheet": (percent, stretching)},
        ),
    )  # fmt: skip
