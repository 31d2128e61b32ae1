"""Goal-oriented meshes: elements as small as the error of the probes' motion asks for.

A coarse mesh and its dual solutions say where elements leave that error (`skinwave.models.goal`).
Sizes that spread it evenly, of as many elements as the tolerance needs, make the next mesh: those
along each axis of a structured mesh (`goal_lines`), or those of tetrahedra that fill a surface
(`goal_sizes`). The estimate itself is not trusted: as with uniform meshes the error is extrapolated
from the change of the waveforms from the coarse mesh, by the predicted ratio of their errors in the
place of that of their element sizes. A coarse mesh of few cells predicts ratios that are too good
by up to 2; there numbers of cells count, as of uniform meshes.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshes import MeshError
from meshes.tetmesh import Floats
from simple_model.path_cells import is_abrupt
from skinwave.bodies.sizes import check_mesh, default_size
from skinwave.effort import Progress, silent
from skinwave.models.prepared import Prepared, answer, components, prepare, reduction_tolerance
from skinwave.models.symmetry import modelled_axes
from skinwave.planning.goal_lines import family_of_lines, uniform_dofs
from skinwave.planning.goal_meshes import GoalMesh
from skinwave.planning.goal_sizes import family_of_sizes
from skinwave.planning.refinement import (
    CONTROLLER,
    Convergence,
    Refined,
    cell_count,
    element_sizes,
    finer_sizes,
    mean_ratio,
    quantity_of_interest,
    refined,
    relative_change,
)
from skinwave.scene import Body, Scene

LINES = 3  # that oscillate and move the probes most: the errors of one would not be those of all
UNDERESTIMATED = 2.4  # true errors of coarse meshes over their estimates, measured 1.2 to 2.1
AIM = 0.8  # of the tolerance, so that one goal-oriented mesh is enough
# Ratio of the predicted errors of a mesh and the one before: more alike they change too little to
# tell, and estimates of a coarse mesh are not followed further.
MOST_ALIKE, LEAST_ALIKE = 0.5, 0.05
FEW_CELLS = 200  # of a coarse mesh whose predictions are not trusted
STEEPER = 1.5  # power of its errors by numbers of cells that predicted ones fall by
NEARLY = 2.0  # times the tolerance: error of that mesh from where goal-oriented ones may save
SMALL = 4000  # degrees of freedom of a uniform structured mesh that is tried before
EASY = 0.04  # tolerance that the second of the coarsest uniform meshes of a hand may meet
MESHES, MOST_DOFS = 3, 250_000  # goal-oriented meshes that are tried, and the largest, about
FAINTEST = 1e-3  # of the largest motion: that of a probe which its error counts relative to


@dataclass(frozen=True, kw_only=True, eq=False)
class _Trial:
    """A mesh, its reduced body, and the quantity of interest (k, p) that was `found` with it."""

    mesh: GoalMesh
    prepared: Prepared
    found: NDArray[Any]

    @property
    def dofs(self) -> int:
        """Degrees of freedom, with those of any absorbing layer."""
        return self.prepared.effort.dofs


def has_goal_oriented(scene: Scene, body: Body) -> bool:
    """Whether elements of a body may be small anywhere, and the scene has a pressure of a few lines
    that moves what probes read at the surface.
    """
    grid, sized, path = body.of_kind.grid, body.of_kind.sized, scene.tacton.trajectory
    follows = bool(grid and grid.has(body)) or bool(sized and sized.has(body))
    few = not (scene.tacton.is_sampled or path.shape == "recorded" or is_abrupt(scene.pressure))
    reads = scene.reading.asked.is_normal and scene.reading.is_on_surface
    return follows and few and reads and scene.load.is_plain


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
    `refined` where no such mesh follows the body or nothing moves, and where a coarse one is
    accurate enough.

    Parameters
    ----------
    scene, body, tolerance, progress, symmetry, solver : as for `refined`, with its errors

    Returns
    -------
    Refined; the last mesh that is tried, with its error, if that is not accurate either
    """
    check_mesh(body, default_size(body))
    if size := _easy_size(scene, body, tolerance, symmetry):
        found = refined(scene, body, tolerance, progress, symmetry=symmetry, solver=solver, h=size)
        if found.convergence is Convergence.REACHED:
            return found
        if found.error < NEARLY * tolerance:  # one or two more are enough
            return refined(scene, body, tolerance, progress, symmetry=symmetry, solver=solver)
    try:
        goal = _goal_refined(scene, body, tolerance, progress or silent, symmetry, solver)
    except (MeshError, TimeoutError):
        goal = None
    return goal or refined(scene, body, tolerance, progress, symmetry=symmetry, solver=solver)


def _easy_size(scene: Scene, body: Body, tolerance: float, symmetry: str) -> float | None:
    """Element size in metre of a uniform mesh of one material that may be enough and costs less
    than an estimate and its mesh; None if there is none.
    """
    if len(body.strata) > 1:
        return None
    sizes = element_sizes(body)
    size = float(finer_sizes(sizes, sizes[0])[0])
    if not body.of_kind.grid:
        return size if tolerance >= EASY else None
    axes = modelled_axes(body, scene.probe_points, symmetry, scene.reading, scene.load)
    return size if uniform_dofs(body, size, axes) < SMALL else None


def _goal_refined(
    scene: Scene, body: Body, tolerance: float, report: Progress, symmetry: str, solver: str
) -> Refined | None:
    axes = modelled_axes(body, scene.probe_points, symmetry, scene.reading, scene.load)
    family_of = family_of_lines if body.of_kind.grid else family_of_sizes
    family = family_of(scene, body, axes, tolerance, solver)

    def as_uniform(mesh: GoalMesh) -> float:  # that small uniform elements would have to be
        return family.size * mesh.ratio ** (1 / CONTROLLER.order)

    def tried(mesh: GoalMesh) -> _Trial:
        prepared = prepare(
            body, scene.probe_points, report, h=as_uniform(mesh), discretise=mesh.discretise,
            solver=solver, symmetry=symmetry, tolerance=reduction_tolerance(tolerance),
            reading=scene.reading, load=scene.load,
        )  # fmt: skip
        found = quantity_of_interest(prepared, scene, answer(prepared, scene))
        return _Trial(mesh=mesh, prepared=prepared, found=found)

    coarse = before = tried(family.coarse)
    frequencies, sizes = strongest(scene, coarse.prepared)
    if not len(frequencies):
        return None
    report("goal-oriented estimate", 0.0)
    known = family.estimated(frequencies, sizes, coarse.dofs)
    most = max(MOST_DOFS, 4 * coarse.dofs)
    error, few = UNDERESTIMATED * known.error, _cells(coarse.mesh) < FEW_CELLS
    for _ in range(MESHES):
        wanted = (AIM * tolerance / max(error, 1e-300)) ** (STEEPER if few else 1)
        wanted = float(np.clip(wanted, LEAST_ALIKE, MOST_ALIKE))
        last = tried(known.finer(before.mesh.ratio * wanted, before.mesh, most))
        alike = _alike_by_cells(coarse.mesh, last.mesh) if few else last.mesh.ratio
        error = family.safety * _extrapolated(coarse, last, alike)
        if error <= tolerance or last.dofs >= most / 2:
            break
        before = last
    return Refined(
        h=as_uniform(last.mesh),
        convergence=Convergence.NOT_REACHED if error > tolerance else Convergence.REACHED,
        error=error, compared=family.size, prepared=last.prepared,
        goal=last.mesh, compared_dofs=coarse.dofs,
    )  # fmt: skip


def _extrapolated(before: _Trial, last: _Trial, alike: float) -> float:
    """Relative error of the second of two meshes: e2 = r e1 and e1 <= change + e2 of the worst
    probe, for the ratio r that they are `alike` by.
    """
    change = relative_change(before.found, last.found)
    return change * alike / (1 - alike) if alike < 1 else 1.0


def _alike_by_cells(before: GoalMesh, last: GoalMesh) -> float:
    """Ratio of the errors of uniform meshes of as many cells."""
    return mean_ratio(_cells(before), _cells(last)) ** -CONTROLLER.order


def _cells(mesh: GoalMesh) -> float:
    """Cells between the grid lines of a mesh; without lines many."""
    return cell_count(mesh.follows) if isinstance(mesh.follows, tuple) else np.inf


def strongest(scene: Scene, prepared: Prepared) -> tuple[Floats, Floats]:
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
