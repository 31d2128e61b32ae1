"""Goal-oriented meshes against uniform ones: `python -m bench.goal [slab layered palm]`.

The steady state at the line of the load that is strongest below 300 Hz, of bodies of 80 mm. The
error is that of the probes' displacement over the largest, against a mesh of some 150,000 dofs. The
estimate and the lines of the goal-oriented meshes are those of the second uniform mesh.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

import fem
import skinwave
from meshes import TetMesh, equidistributed, extrude, mapped_palm
from meshes.shapes.structured import with_planes
from meshes.tetmesh import Floats, Ints
from simple_model.load_spectrum import pressure_lines
from skinwave.bodies import Body
from skinwave.bodies.build import build as build_body
from skinwave.bodies.build import operators
from skinwave.bodies.discretised import Discretised, in_layers
from skinwave.bodies.hands import in_its_layers
from skinwave.bodies.palm import _support
from skinwave.models.loads import probe_rows, surface_load
from skinwave.scene import Layer, Scene

SCENES = Path(__file__).parent.parent / "examples"
SIDE = 80e-3
HIGHEST = 300.0  # Hz
UNIFORM = ((12, 2), (16, 3), (20, 4))  # cells along a side, and through the depth
REFERENCE = (30, 7)
DOFS = (9e3, 13e3, 17e3)
LAYERS = (Layer(thickness=1.3e-3, material="dermis"), Layer(thickness=4e-3, material="fat"))
Lines = Sequence[Floats]


def body_of(name: str) -> Body:
    """Body by its name here."""
    body = skinwave.read(SCENES / ("palm.toml" if name == "palm" else "skin-slab.toml")).body
    if name == "palm":
        return replace(body, width=SIDE, height=SIDE)
    body = replace(body, width=SIDE, height=SIDE, sides="clamped", base="clamped")
    return replace(body, material="muscle", layers=LAYERS) if name == "layered" else body


def discretised(lines: Lines, body: Body, h: float) -> Discretised:
    """Structured mesh of a body on grid lines of the box around it."""
    if body.kind == "palm":
        mesh = mapped_palm(body.palm, *lines)
        mesh = TetMesh(points=mesh.points, tets=mesh.tets, facets={"top": mesh.facets["top"]})
        return in_its_layers(body, h, mesh, partial(_support, body))
    mesh = extrude(*lines)
    depths = -mesh.points[mesh.tets[:, :4], 2].mean(axis=1)
    mesh, materials = in_layers(mesh, body.strata, depths)
    return Discretised(mesh=mesh, materials=materials)


def cells_of(lines: Lines, body: Body, mesh: TetMesh) -> Ints:
    """Cell (e, 3) along each axis that every element is in."""
    counts = tuple(len(line) - 1 for line in lines)
    if body.kind == "palm":  # numbered by `kuhn_tets`
        places = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)
        return np.tile(places.reshape(-1, 3), (6, 1))
    middles = mesh.points[mesh.tets[:, :4]].mean(axis=1)
    each = zip(lines, middles.T, strict=True)
    return np.column_stack([np.searchsorted(line, x) - 1 for line, x in each])


def uniform(body: Body, cells: int, layers: int) -> Lines:
    """Equal cells, but for those that the layers of a body ask for."""
    along = [np.linspace(-side / 2, side / 2, cells + 1) for side in (body.width, body.height)]
    return *along, in_strata(body, np.linspace(-body.depth, 0, layers + 1))


def in_strata(body: Body, line: Floats) -> Floats:
    """Grid line downwards that meets the layers of a body."""
    return with_planes(line, [-start for start, _ in body.strata[1:]])


def probed(
    scene: Scene, lines: Lines, *, goal: bool = False
) -> tuple[fem.Complex, int, Floats | None]:
    """Probes' displacement (p,) at one line, the dofs, and with `goal` the estimate (e, p)."""
    build = build_body(scene.body, discretise=partial(discretised, lines))
    made = operators(build)
    P, points = surface_load(build, scene.load)
    S, _ = probe_rows(scene.body, build, scene.probe_points, scene.reading)
    frequencies, pressures = pressure_lines(scene.pressure, points)
    low = np.flatnonzero((frequencies > 0) & (frequencies < HIGHEST))
    k = low[np.argmax(np.linalg.norm(pressures[low], axis=1))]
    right = np.column_stack([P @ pressures[k], *(S.toarray() if goal else ())])
    u = fem.harmonic(made, right, frequencies[k])[0]
    shares = None
    if goal:
        shares = fem.goal_error(
            build.mesh, build.material, (u[:, 0], u[:, 1:]), float(frequencies[k])
        )
    return S @ u[:, 0], len(made.free), shares


def compare(name: str) -> None:
    """Errors of uniform meshes, of the estimate, and of goal-oriented meshes."""
    body = body_of(name)
    scene = replace(skinwave.read(SCENES / "skin-slab.toml"), body=body)
    exact, dofs, _ = probed(scene, uniform(body, *REFERENCE))
    print(f"{name}: reference of {dofs:,} dofs", flush=True)

    def off(found: fem.Complex) -> float:
        return float(np.abs(found - exact).max() / np.abs(exact).max())

    for k, cells in enumerate(UNIFORM):
        lines = uniform(body, *cells)
        found, dofs, shares = probed(scene, lines, goal=k == 1)
        print(f"  uniform        {dofs:7,} dofs  error {100 * off(found):.2f} %", flush=True)
        if shares is not None:
            estimate, start = shares.sum(axis=0), (lines, shares)
            size = 100 * np.abs(estimate).max() / np.abs(exact).max()
            print(f"    estimate {size:.2f} %; by probe over the true error ", end="")
            print(np.round(np.abs(estimate) / np.abs(exact - found), 2), flush=True)
    lines, shares = start
    mesh = build_body(body, discretise=partial(discretised, lines)).mesh
    cells, error = cells_of(lines, body, mesh), np.abs(shares).sum(axis=1)
    for dofs in DOFS:
        *along, down = equidistributed(lines, cells, error, dofs)
        found, dofs, _ = probed(scene, (*along, in_strata(body, down)))
        print(f"  goal-oriented  {dofs:7,} dofs  error {100 * off(found):.2f} %", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bodies", nargs="*", default=("slab", "layered", "palm"))
    for chosen in parser.parse_args().bodies:
        compare(chosen)
