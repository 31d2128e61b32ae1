"""Goal-oriented meshes against uniform ones: `python -m bench.goal [slab layered palm]`.

The steady state at the line of the load that is strongest below 300 Hz. The error is that of the
probes' displacement over the largest, against a mesh of some 160,000 dofs that is graded towards
the focus. The estimate and the lines of the goal-oriented meshes are those of the second uniform
mesh. Bodies have their default sizes, 100 mm and for the palm 85 by 100 mm.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

import fem
import skinwave
from meshes import Grading, corner_volumes, equidistributed, graded_axis
from meshes.shapes.equidistributed import ORDER, Lines
from meshes.shapes.structured import with_planes
from meshes.tetmesh import Floats
from simple_model.load_spectrum import pressure_lines
from skinwave.bodies import Body
from skinwave.bodies.build import Build, operators
from skinwave.bodies.build import build as build_body
from skinwave.bodies.grid import mirrored
from skinwave.models.goal import goal_estimate
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


def body_of(name: str) -> Body:
    """Body by its name here."""
    body = skinwave.read(SCENES / ("palm.toml" if name == "palm" else "skin-slab.toml")).body
    if name == "palm":
        return body
    body = replace(body, sides="clamped")
    return replace(body, material="muscle", layers=LAYERS) if name == "layered" else body


def uniform(body: Body, cells: int, layers: int) -> Lines:
    """Equal cells, but for those that the layers of a body ask for."""
    x, y = (np.linspace(-side / 2, side / 2, cells + 1) for side in (body.width, body.height))
    z = np.linspace(-body.depth, 0, layers + 1)
    return x, y, with_planes(z, [-start for start, _ in body.strata[1:]])


def reference(body: Body) -> Lines:
    """Cells that grow away from the focus."""
    halves = [graded_axis(side / 2, *NEAR[body.kind]) for side in (body.width, body.height)]
    x, y = (mirrored(half) for half in halves)
    return x, y, -1e-3 * np.array(DOWN_LAYERS if body.layers else DOWN)[::-1]


def on_lines(body: Body, lines: Lines) -> Build:
    """Body on grid lines."""
    assert body.of_kind.grid  # that of all bodies here
    return build_body(body, discretise=body.of_kind.grid.on(lines))


def probed(scene: Scene, lines: Lines) -> tuple[fem.Complex, int, float]:
    """Probes' displacement (p,) at one line, the dofs, and the line's frequency in Hz."""
    build = on_lines(scene.body, lines)
    made = operators(build)
    P, points = surface_load(build, scene.load)
    S, _ = probe_rows(scene.body, build, scene.probe_points, scene.reading)
    frequencies, pressures = pressure_lines(scene.pressure, points)
    low = np.flatnonzero((frequencies > 0) & (frequencies < HIGHEST))
    k = low[np.argmax(np.linalg.norm(pressures[low], axis=1))]
    u = fem.harmonic(made, P @ pressures[k], frequencies[k])[0]
    return S @ u, len(made.free), float(frequencies[k])


def compare(name: str) -> None:
    """Errors of uniform meshes, of the estimate, and of goal-oriented meshes."""
    body = body_of(name)
    scene = replace(skinwave.read(SCENES / "skin-slab.toml"), body=body)
    exact, dofs, frequency = probed(scene, reference(body))
    print(f"{name}: reference of {dofs:,} dofs", flush=True)
    largest = np.abs(exact).max()

    def measured(kind: str, lines: Lines) -> tuple[int, float]:
        found, dofs, _ = probed(scene, lines)
        off = float(np.abs(found - exact).max() / largest)
        print(f"  {kind:<14} {dofs:7,} dofs  error {100 * off:.2f} %", flush=True)
        return dofs, off

    equal = [uniform(body, *cells) for cells in UNIFORM]
    errors = [measured("uniform", lines) for lines in equal]
    one = np.full(len(exact), largest)
    known = goal_estimate(scene, body, equal[1], np.array([frequency]), one)
    off = np.abs(exact - probed(scene, equal[1])[0]) / largest
    estimate = np.sqrt(2) * known.error  # of the amplitude, not of its root mean square
    print(f"    estimate {100 * estimate.max():.2f} %; by probe over the true error ", end="")
    print(np.round(estimate / off, 2), flush=True)
    print("    along x, y, z", np.round(known.along.sum(axis=0) / known.along.sum(), 2))
    mesh = on_lines(body, equal[1]).mesh
    least = ideal(corner_volumes(mesh.points, mesh.tets), known.along.sum(axis=1))
    print(f"  ideal elements of any size: {least:.2f} of the uniform dofs", flush=True)
    goal = [
        measured("goal-oriented", equidistributed(known.lines, known.cells, known.along, dofs))
        for dofs in DOFS
    ]
    each = [enough(found) for found in (errors, goal)]
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
