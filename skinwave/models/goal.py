"""Error that each element leaves in the probes' motion at some lines, by their dual solutions."""

from dataclasses import dataclass

import numpy as np

import fem
from meshes import TetMesh, cache
from meshes.shapes.equidistributed import Lines
from meshes.tetmesh import Floats, Ints
from simple_model.load_spectrum import Complex
from skinwave.bodies.build import Build, build, operators
from skinwave.bodies.discretised import Discretise
from skinwave.bodies.grid import halves
from skinwave.effort import one_thread, versions
from skinwave.models.laws import relaxing, series_tolerance
from skinwave.models.loads import load_lines_at, probe_rows, surface_load
from skinwave.models.symmetry import even_part, images
from skinwave.scene import Body, Scene

FAINT = 1e-3  # of the strongest line of the load: others are left out
MOST_GOALS = 12  # probes whose dual solutions are computed, spread over all


@dataclass(frozen=True, kw_only=True, eq=False)
class ElementErrors:
    """Goal-oriented estimate of the error of a mesh.

    `mesh` of the part of the body that is modelled, before it is placed; `along` (e, 3): the
    magnitude of what each element leaves by its length along each axis, in the motion of all
    probes; `error` (p,): of each probe's motion, or of `MOST_GOALS` of them at most.
    """

    mesh: TetMesh
    along: Floats
    error: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class GoalEstimate:
    """Goal-oriented estimate of the error of a structured mesh.

    `lines` through the part of the body that is modelled, three (n,) in metre, and the cell (e, 3)
    that each element is in; `along` and `error` as of `ElementErrors`, along the lines.
    """

    lines: Lines
    cells: Ints
    along: Floats
    error: Floats


def goal_estimate(
    scene: Scene,
    body: Body,
    lines: Lines,
    frequencies: Floats,
    sizes: Floats,
    *,
    axes: str = "",
    tolerance: float = 0.05,
    solver: str = "auto",
) -> GoalEstimate:
    """Goal-oriented estimate of a mesh on grid lines.

    Parameters
    ----------
    scene, body, frequencies, sizes, axes, tolerance, solver : as for `element_errors`, of a kind of
        body with a grid
    lines : three (n,) float, metre, grid lines through all of it

    Returns
    -------
    GoalEstimate
    """
    grid = body.of_kind.grid
    assert grid  # else not asked for
    found = element_errors(
        scene, body, frequencies, sizes,
        discretise=grid.on(lines), axes=axes, tolerance=tolerance, solver=solver,
    )  # fmt: skip
    own = halves(lines, axes)
    return GoalEstimate(
        lines=own, cells=grid.cells(own, found.mesh), along=found.along, error=found.error
    )


def element_errors(
    scene: Scene,
    body: Body,
    frequencies: Floats,
    sizes: Floats,
    *,
    h: float | None = None,
    discretise: Discretise | None = None,
    axes: str = "",
    tolerance: float = 0.05,
    solver: str = "auto",
) -> ElementErrors:
    """Goal-oriented estimate at some lines of the load, cached.

    Parameters
    ----------
    scene : Scene, with load and probes
    body : Body that is meshed
    frequencies : (f,) float, Hz, of lines of the load
    sizes : (p,) float, of each probe's motion, that its error counts relative to
    h, discretise : as for `prepare`
    axes : of "xy", across whose middle planes one side is modelled: `symmetry.modelled_axes`
    tolerance, solver : as for `prepare`

    Returns
    -------
    ElementErrors
    """
    body = relaxing(body, series_tolerance(tolerance))
    made = build(body, h, axes, discretise)
    P, points = even_part(*surface_load(made, scene.load), axes)
    S, _ = probe_rows(body, made, images(scene.probe_points, axes), scene.reading)
    known, pressures = load_lines_at(scene.loads, points, FAINT)
    chosen = [int(np.argmin(np.abs(known - f))) for f in frequencies]
    forces = np.array([P @ pressures[k] for k in chosen])
    some = slice(None, None, -(-len(sizes) // MOST_GOALS))
    duals = S[some].toarray() / sizes[some, None]
    mesh = made.mesh
    name = cache.key(
        "goal", mesh.points, mesh.tets, mesh.region, made.material, body, axes, frequencies,
        forces, duals, solver, versions(),
    )  # fmt: skip
    entry = cache.load(name)
    if entry is None:
        with one_thread():
            entry = _solved(made, known[chosen], forces, duals, solver)
        cache.store(name, {}, **entry)
    unplaced = TetMesh(points=body.placement.undone(mesh.points), tets=mesh.tets)
    return ElementErrors(mesh=unplaced, along=entry["along"], error=entry["error"])


def _solved(
    made: Build, frequencies: Floats, forces: Complex, duals: Floats, solver: str
) -> dict[str, Floats]:
    """Magnitudes (e, 3) of all lines' errors along the axes, and errors (p,) by their powers."""
    whole = operators(made)
    along, power = np.zeros((len(made.mesh.tets), 3)), np.zeros(len(duals))
    for f, force in zip(frequencies.tolist(), forces, strict=True):
        u = fem.harmonic(whole, np.column_stack([force, *duals]), f, solver=solver)[0]
        found = fem.goal_error(made.mesh, made.material, (u[:, 0], u[:, 1:]), f)
        along += found.along
        power += np.abs(found.shares.sum(axis=0)) ** 2 / (2 if f else 1)
    return {"along": along, "error": np.sqrt(power)}
