"""Goal-oriented meshes: element sizes along each axis as the error of the probes' motion asks for.

A coarse uniform mesh and its dual solutions say where, and along which axis, elements leave that
error (`skinwave.models.goal`). Grid lines that spread it evenly, of as many cells as the tolerance
needs, make the next mesh. The estimate itself is not trusted: as with uniform meshes the error is
extrapolated from the change of the waveforms between two meshes, by the predicted ratio of their
errors in the place of that of their element sizes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshes import MeshError
from meshes.shapes.equidistributed import EVEN, PER_CELL, Lines, equidistributed, error_ratio
from meshes.tetmesh import Floats
from skinwave.bodies.grid import halves, wholes
from skinwave.bodies.sizes import check_mesh, default_size
from skinwave.effort import Progress, silent
from skinwave.models.goal import GoalEstimate, goal_estimate
from skinwave.models.prepared import Prepared, answer, components, prepare, reduction_tolerance
from skinwave.models.symmetry import modelled_axes
from skinwave.planning.estimates import path_places, spot_scale
from skinwave.planning.refinement import (
    CONTROLLER,
    FIRST,
    Convergence,
    Refined,
    quantity_of_interest,
    refined,
    relative_change,
)
from skinwave.scene import Body, Scene

LINES = 3  # that oscillate and move the probes most: the errors of one would not be those of all
UNDERESTIMATED = 1.6  # true errors of coarse meshes over their estimates, measured 1.2 to 1.7
# Of safety, on extrapolated errors: waveforms converged at an order of 2.3 to 3.4, not of 3. It is
# that of a grid convergence index, 1.25 to 3 (Roache, Annu Rev Fluid Mech 29:123, 1997).
FACTOR = 1.5
AIM = 0.8  # of the tolerance, so that one goal-oriented mesh is enough
# Ratio of the errors of two meshes: more alike they change too little to tell, and estimates of a
# coarse mesh are not followed further.
MOST_ALIKE, LEAST_ALIKE = 0.5, 0.05
MESHES, MOST_DOFS = 3, 250_000  # goal-oriented meshes that are tried, and the largest, about
GROWTH, FINER = 1.05, 0.95  # between two choices, of degrees of freedom and of element sizes
PER_WAVELENGTH = 2  # cells at least
SPOT = 1.8  # standard deviations of the focal spot that a cell which it passes is at most wide
FAINTEST = 1e-3  # of the largest motion: that of a probe which its error counts relative to


@dataclass(frozen=True, kw_only=True, eq=False)
class _Trial:
    """Mesh on `lines`, its reduced body, the quantity of interest (k, p) that was `found` with it,
    and its error over that of the coarse mesh as predicted, a `ratio`.
    """

    lines: Lines
    prepared: Prepared
    found: NDArray[Any]
    ratio: float = 1.0

    @property
    def dofs(self) -> int:
        """Degrees of freedom, with those of any absorbing layer."""
        return self.prepared.effort.dofs


def has_goal_oriented(scene: Scene, body: Body) -> bool:
    """Whether a body has grid lines that may be anywhere, and the scene a pressure of a few lines
    that moves what probes read at the surface.
    """
    grid, path = body.of_kind.grid, scene.tacton.trajectory
    few = not (scene.tacton.is_sampled or path.shape == "recorded")
    reads = scene.reading.asked.is_normal and scene.reading.is_on_surface
    return bool(grid and grid.has(body)) and few and reads and scene.load.is_plain


def goal_refined(
    scene: Scene,
    body: Body,
    tolerance: float,
    progress: Progress | None = None,
    *,
    symmetry: str = "",
    solver: str = "auto",
) -> Refined:
    """Goal-oriented mesh that is accurate to a tolerance, with its expected error; that of
    `refined` where no structured mesh follows the body, or nothing moves.

    Parameters
    ----------
    scene, body, tolerance, progress, symmetry, solver : as for `refined`, with its errors

    Returns
    -------
    Refined; the last mesh that is tried, with its error, if that is not accurate either
    """
    check_mesh(body, default_size(body))
    try:
        found = _goal_refined(scene, body, tolerance, progress or silent, symmetry, solver)
    except MeshError:
        found = None
    return found or refined(scene, body, tolerance, progress, symmetry=symmetry, solver=solver)


def _goal_refined(
    scene: Scene, body: Body, tolerance: float, report: Progress, symmetry: str, solver: str
) -> Refined | None:
    def tried(lines: Lines, ratio: float = 1.0) -> _Trial:
        prepared = prepare(
            body, scene.probe_points, report, lines=lines, solver=solver, symmetry=symmetry,
            tolerance=reduction_tolerance(tolerance), reading=scene.reading, load=scene.load,
        )  # fmt: skip
        found = quantity_of_interest(prepared, scene, answer(prepared, scene))
        return _Trial(lines=lines, prepared=prepared, found=found, ratio=ratio)

    lines, size = _coarse_lines(scene, body)
    coarse = before = tried(lines)
    frequencies, sizes = _strongest(scene, coarse.prepared)
    if not len(frequencies):
        return None
    report("goal-oriented estimate", 0.0)
    axes = modelled_axes(body, scene.probe_points, symmetry, scene.reading, scene.load)
    known = goal_estimate(
        scene, body, coarse.lines, frequencies, sizes, axes=axes, tolerance=tolerance, solver=solver
    )
    limits = _coarsest(scene, body, known.lines, float(frequencies.max()))
    most = max(MOST_DOFS, 4 * coarse.dofs)
    error = FACTOR * UNDERESTIMATED * float(known.error.max())
    for _ in range(MESHES):
        wanted = np.clip(AIM * tolerance / max(error, 1e-300), LEAST_ALIKE, MOST_ALIKE)
        lines, ratio = _fewest(
            known, before.ratio * float(wanted), before.lines, most, limits, axes
        )
        last = tried(wholes(lines, axes), ratio)
        error, compared = _extrapolated(before, last), before
        if error <= tolerance or last.dofs >= most / 2:
            break
        before = last
    return Refined(
        # Uniform elements would have to be that small.
        h=size * last.ratio ** (1 / CONTROLLER.order),
        convergence=Convergence.NOT_REACHED if error > tolerance else Convergence.REACHED,
        error=error, compared=size, prepared=last.prepared,
        goal_lines=last.lines, compared_dofs=compared.dofs,
    )  # fmt: skip


def _extrapolated(before: _Trial, last: _Trial) -> float:
    """Relative error of the second of two meshes, with a factor of safety: e2 = r e1 and
    e1 <= change + e2 of the worst probe, for the predicted ratio r.
    """
    alike = last.ratio / before.ratio
    change = relative_change(before.found, last.found)
    return FACTOR * change * alike / (1 - alike) if alike < 1 else 1.0


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


def _strongest(scene: Scene, prepared: Prepared) -> tuple[Floats, Floats]:
    """Frequencies (f,) in Hz of the lines that move the probes most, each relative to its motion,
    and root mean square (p,) of that; the mean counts where the body is held.
    """
    motion = components(prepared, *scene.loads)
    moves = motion.frequencies > 0
    counted = moves | scene.body.is_held
    power = np.abs(motion.lines) ** 2 * np.where(moves, 0.5, counted)[:, None]
    sizes = np.sqrt(power.sum(axis=0))
    sizes = np.maximum(sizes, FAINTEST * sizes.max(initial=0.0))
    if not sizes.all() or not moves.any():
        return np.zeros(0), sizes
    order = np.argsort(-(power / sizes**2).sum(axis=1), kind="stable")
    last = np.flatnonzero(moves[order])[:LINES][-1]
    chosen = order[: last + 1]
    return np.sort(motion.frequencies[chosen[counted[chosen]]]), sizes


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
    # An absorbing layer has its own.
    dofs = PER_CELL * float(np.prod([len(line) - 1 for line in halves(before, axes)]))
    while True:
        dofs *= GROWTH
        lines = equidistributed(
            known.lines, known.cells, known.along, dofs, multiples=multiples, coarsest=limits
        )
        left = error_ratio(known.lines, known.cells, known.along, lines)
        if left <= ratio or dofs > most:
            return lines, left
