"""Goal-oriented meshes against uniform ones: `python -m bench.goal [slab layered palm]`.

The steady state at the line of the load that is strongest below 300 Hz. The error is that of the
probes' displacement over the largest, against a mesh of some 160,000 dofs that is graded towards
the focus. The estimate and the lines of the goal-oriented meshes are those of the second uniform
mesh. Bodies have their default sizes, 100 mm and for the palm 85 by 100 mm.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import fem
import skinwave
from meshes import (
    Grading,
    TetMesh,
    corner_volumes,
    equidistributed,
    extrude,
    graded_axis,
    mapped_palm,
)
from meshes.shapes.equidistributed import ORDER
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
HIGHEST = 300.0  # Hz
UNIFORM = ((12, 2), (16, 3), (20, 4), (24, 5))  # cells along a side, and through the depth
NEAR = {  # by kind of body, cells of the reference in metre under the focus, and beyond
    "palm": (2.4e-3, Grading(radius=24e-3, growth=1.2, coarsest=4.2e-3)),
    "slab": (2.5e-3, Grading(radius=22.5e-3, growth=1.25, coarsest=4.6e-3)),
}
DOWN = (0, 1.8, 3.7, 6, 8.6, 11.8, 15)  # mm, its grid line downwards
DOWN_LAYERS = (0, 0.65, 1.3, 2.6, 4, 5.3, 8.2, 11.4, 15)
DOFS = (7e3, 11e3, 16e3, 22e3, 30e3)
AIM = 0.02
LAYERS = (Layer(thickness=1.3e-3, material="dermis"), Layer(thickness=4e-3, material="fat"))
Lines = Sequence[Floats]


def body_of(name: str) -> Body:
    """Body by its name here."""
    body = skinwave.read(SCENES / ("palm.toml" if name == "palm" else "skin-slab.toml")).body
    if name == "palm":
        return body
    body = replace(body, sides="clamped")
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


def reference(body: Body) -> Lines:
    """Cells that grow away from the focus."""
    halves = [graded_axis(side / 2, *NEAR[body.kind]) for side in (body.width, body.height)]
    along = [np.concatenate([-half[:0:-1], half]) for half in halves]
    return *along, -1e-3 * np.array(DOWN_LAYERS if body.layers else DOWN)[::-1]


def in_strata(body: Body, line: Floats) -> Floats:
    """Grid line downwards that meets the layers of a body."""
    return with_planes(line, [-start for start, _ in body.strata[1:]])


def probed(
    scene: Scene, lines: Lines, *, goal: bool = False
) -> tuple[fem.Complex, int, fem.GoalError | None]:
    """Probes' displacement (p,) at one line, the dofs, and with `goal` the estimate."""
    build = build_body(scene.body, discretise=partial(discretised, lines))
    made = operators(build)
    P, points = surface_load(build, scene.load)
    S, _ = probe_rows(scene.body, build, scene.probe_points, scene.reading)
    frequencies, pressures = pressure_lines(scene.pressure, points)
    low = np.flatnonzero((frequencies > 0) & (frequencies < HIGHEST))
    k = low[np.argmax(np.linalg.norm(pressures[low], axis=1))]
    right = np.column_stack([P @ pressures[k], *(S.toarray() if goal else ())])
    u = fem.harmonic(made, right, frequencies[k])[0]
    error = None
    if goal:
        error = fem.goal_error(
            build.mesh, build.material, (u[:, 0], u[:, 1:]), float(frequencies[k])
        )
    return S @ u[:, 0], len(made.free), error


def compare(name: str) -> None:
    """Errors of uniform meshes, of the estimate, and of goal-oriented meshes."""
    body = body_of(name)
    scene = replace(skinwave.read(SCENES / "skin-slab.toml"), body=body)
    exact, dofs, _ = probed(scene, reference(body))
    print(f"{name}: reference of {dofs:,} dofs", flush=True)

    def off(found: fem.Complex) -> float:
        return float(np.abs(found - exact).max() / np.abs(exact).max())

    errors: dict[str, list[tuple[int, float]]] = {"uniform": [], "goal-oriented": []}

    def measured(kind: str, lines: Lines, *, goal: bool = False) -> tuple[fem.Complex, Any]:
        found, dofs, error = probed(scene, lines, goal=goal)
        errors[kind].append((dofs, off(found)))
        print(f"  {kind:<14} {dofs:7,} dofs  error {100 * off(found):.2f} %", flush=True)
        return found, error

    for k, cells in enumerate(UNIFORM):
        lines = uniform(body, *cells)
        found, error = measured("uniform", lines, goal=k == 1)
        if error is not None:
            estimate, start = error.shares.sum(axis=0), (lines, error.along)
            size = 100 * np.abs(estimate).max() / np.abs(exact).max()
            print(f"    estimate {size:.2f} %; by probe over the true error ", end="")
            print(np.round(np.abs(estimate) / np.abs(exact - found), 2), flush=True)
            print("    along x, y, z", np.round(start[1].sum(axis=0) / start[1].sum(), 2))
    lines, along_axes = start
    mesh = build_body(body, discretise=partial(discretised, lines)).mesh
    least = ideal(corner_volumes(mesh.points, mesh.tets), along_axes.sum(axis=1))
    print(f"  ideal elements of any size: {least:.2f} of the uniform dofs", flush=True)
    cells = cells_of(lines, body, mesh)
    for dofs in DOFS:
        *along, down = equidistributed(lines, cells, along_axes, dofs)
        measured("goal-oriented", (*along, in_strata(body, down)))
    each = [enough(found) for found in errors.values()]
    print(f"  dofs at 2 %: {each[0]:,.0f} and {each[1]:,.0f}, {each[1] / each[0]:.2f}", flush=True)


def ideal(volume: Floats, error: Floats) -> float:
    """Dofs at equal error, over those of uniform elements, of elements as large as the errors (e,)
    of elements of a volume (e,) ask for: of a density e(x) h^r, h ~ e^(-1 / (r + 3)).
    """
    density = error / volume
    graded = (density ** (3 / (ORDER + 3)) * volume).sum() ** ((ORDER + 3) / 3)
    even = error.sum() * volume.sum() ** (ORDER / 3)
    return float((graded / even) ** (3 / ORDER))


def enough(errors: list[tuple[int, float]]) -> float:
    """Dofs at the error that is aimed at, along straight lines of the logarithms."""
    error, dofs = np.log(np.array(sorted({(error, dofs) for dofs, error in errors}))).T
    k = np.clip(np.searchsorted(error, np.log(AIM)), 1, len(error) - 1)
    slope = (dofs[k] - dofs[k - 1]) / (error[k] - error[k - 1])
    return float(np.exp(dofs[k] + slope * (np.log(AIM) - error[k])))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bodies", nargs="*", default=("slab", "layered", "palm"))
    for chosen in parser.parse_args().bodies:
        compare(chosen)
