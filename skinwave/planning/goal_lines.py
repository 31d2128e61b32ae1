"""Goal-oriented grid lines: cell sizes along each axis as the error of the probes' motion asks for.

A coarse uniform mesh and its dual solutions say where, and along which axis, elements leave that
error (`skinwave.models.goal`). Grid lines that spread it evenly, of as many cells as a tolerance
needs, make the next mesh.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from meshes.shapes.equidistributed import EVEN, PER_CELL, Lines, equidistributed, error_ratio
from meshes.tetmesh import Floats
from skinwave.bodies.grid import halves, wholes
from skinwave.bodies.sizes import default_size
from skinwave.models.goal import GoalEstimate, goal_estimate
from skinwave.planning.estimates import path_places, spot_scale
from skinwave.planning.goal_meshes import PER_WAVELENGTH, SPOT, Estimated, Family, GoalMesh
from skinwave.planning.refinement import FIRST
from skinwave.scene import Body, Scene

# Waveforms converged at an order of 2.3 to 3.4, not of 3. It is that of a grid convergence index,
# 1.25 to 3 (Roache, Annu Rev Fluid Mech 29:123, 1997).
SAFETY = 1.5
GROWTH, FINER = 1.05, 0.95  # between two choices, of degrees of freedom and of element sizes


def family_of_lines(scene: Scene, body: Body, axes: str, tolerance: float, solver: str) -> Family:
    """Goal-oriented meshes on grid lines.

    Parameters
    ----------
    scene : Scene
    body : Body that is meshed, of a kind with a grid
    axes : of "xy", of which a half is modelled
    tolerance, solver : as for `goal_estimate`

    Returns
    -------
    Family
    """
    grid = body.of_kind.grid
    assert grid  # else not asked for
    coarse, size = _coarse_lines(scene, body)

    def on(lines: Lines, ratio: float = 1.0) -> GoalMesh:
        return GoalMesh(
            discretise=grid.on(lines), follows=lines, ratio=ratio, words=_words(lines),
            widest=widest_on_path(scene, body, lines),
        )  # fmt: skip

    def estimated(frequencies: Floats, sizes: Floats, dofs: int) -> Estimated:
        known = goal_estimate(
            scene, body, coarse, frequencies, sizes, axes=axes, tolerance=tolerance, solver=solver
        )
        limits = _coarsest(scene, body, known.lines, float(frequencies.max()))

        def finer(ratio: float, before: GoalMesh, most: float) -> GoalMesh:
            assert isinstance(before.follows, tuple)  # of this family
            lines, left = _fewest(known, ratio, before.follows, most, limits, axes)
            return on(wholes(lines, axes), left)

        return Estimated(error=float(known.error.max()), finer=finer)

    return Family(coarse=on(coarse), size=size, safety=SAFETY, estimated=estimated)


def _words(lines: Lines) -> str:
    """Range of sizes along each axis."""
    sizes = [1e3 * np.diff(line) for line in lines]
    x, y, z = (f"{size.min():.1f} to {size.max():.1f}" for size in sizes)
    return f"{x}, {y} and {z} mm along x, y and z"


def uniform_dofs(body: Body, size: float, axes: str) -> float:
    """Degrees of freedom of a large uniform mesh, without any absorbing layer.

    Parameters
    ----------
    body : Body, of a kind with a grid
    size : metre, of its elements
    axes : of "xy", of which a half is modelled

    Returns
    -------
    float
    """
    grid = body.of_kind.grid
    assert grid  # else not asked for
    return _dofs(halves(grid.lines(body, size), axes))


def _dofs(lines: Lines) -> float:
    """Degrees of freedom of a large grid between lines, without any absorbing layer."""
    return PER_CELL * float(np.prod([len(line) - 1 for line in lines]))


def _coarse_lines(scene: Scene, body: Body) -> tuple[Lines, float]:
    """Grid lines of a coarse uniform mesh that still has the force of the focal spot, of two cells
    or more through the depth; and its element size in metre.
    """
    grid, size = body.of_kind.grid, FIRST * default_size(body)
    assert grid  # else not asked for
    while size > default_size(body):
        if widest_on_path(scene, body, grid.lines(body, size)) <= 2 * spot_scale(scene.pressure):
            break
        size *= FINER
    x, y, z = grid.lines(body, size)
    return (x, y, z if len(z) > 2 else np.linspace(z[0], z[-1], 3)), size


def widest_on_path(scene: Scene, body: Body, lines: Lines) -> float:
    """Largest cell in metre along x or y that the focus passes.

    Parameters
    ----------
    scene : Scene
    body : Body
    lines : three (n,) float, metre, grid lines through all of it

    Returns
    -------
    float
    """
    each = zip(lines[:2], _passed(scene, body, lines[:2]), strict=True)
    return float(max(np.diff(line)[on_path].max(initial=0.0) for line, on_path in each))


def _passed(scene: Scene, body: Body, lines: Sequence[Floats]) -> tuple[NDArray[np.bool_], ...]:
    """Whether the focus passes each cell (n_a,) between lines along x and y, two (n_a + 1,) in
    metre, of a body or of a half of it.
    """
    path = path_places(scene.tacton.trajectory)
    places = body.placement.undone(np.column_stack([path, np.zeros(len(path))]))
    found = []
    for line, at in zip(lines, places.T, strict=False):
        at = np.abs(at) if line[0] == 0 else at
        found.append((line[:-1] <= at.max()) & (line[1:] >= at.min()))
    return tuple(found)


def _coarsest(scene: Scene, body: Body, lines: Lines, frequency: float) -> tuple[Floats, ...]:
    """Largest cells (n_a,) in metre in the place of each that there is along an axis: those that
    resolve the body's shape, shear waves at a frequency in Hz, and the focal spot on its path.
    """
    grid = body.of_kind.grid
    assert grid  # else not asked for
    slowest = min(solid.shear_speed for solid in body.solids)
    largest = min(grid.coarsest(body), slowest / frequency / PER_WAVELENGTH)
    found = [np.full(len(line) - 1, largest) for line in lines]
    spot = max(SPOT * spot_scale(scene.pressure), default_size(body) / 2)
    for limit, on_path in zip(found, _passed(scene, body, lines[:2]), strict=False):
        limit[on_path] = np.minimum(limit[on_path], spot)
    return tuple(found)


def _fewest(
    known: GoalEstimate,
    ratio: float,
    before: Lines,
    most: float,
    limits: tuple[Floats, ...],
    axes: str,
) -> tuple[Lines, float]:
    """Lines of the fewest degrees of freedom that are predicted to be accurate enough.

    Parameters
    ----------
    known : GoalEstimate, on the coarse mesh
    ratio : error that is asked for over that of the coarse mesh
    before : lines of too few cells, three (n,) in metre through all of the body
    most : degrees of freedom that are too many
    limits : largest cells (n_a,) in metre in the place of each of the coarse mesh
    axes : of "xy", of which a half is modelled

    Returns
    -------
    three (m_a,) in metre through the part that is modelled, and the ratio that is predicted
    """
    multiples = [1 if a in axes else n for a, n in zip("xyz", EVEN, strict=True)]
    dofs = _dofs(halves(before, axes))
    while True:
        dofs *= GROWTH
        lines = equidistributed(
            known.lines, known.cells, known.along, dofs, multiples=multiples, coarsest=limits
        )
        left = error_ratio(known.lines, known.cells, known.along, lines)
        if left <= ratio or dofs > most:
            return lines, left
