"""Motion of a whole body, with its expected error and all warnings."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshes import TetMesh
from meshes.tetmesh import Floats, Ints, facet_set
from simple_model import Effort, Response
from simple_model.drawing import new_axes
from simple_model.numbers import counted, significant, stated_error
from simple_model.quantities import DISPLACEMENT
from skinwave.models.options import SolveOptions
from skinwave.models.reduction import from_rest, oscillating
from skinwave.planning.assessment import told
from skinwave.report.palette import SIGNED
from skinwave.results.exports import collection
from skinwave.results.files import folder_name
from skinwave.results.motion import BodyMotion, check_values, probe_lines, probe_response, waves
from skinwave.results.outputs import output_file
from skinwave.results.views import split
from skinwave.scene.scene import Scene
from skinwave.system.effort import Progress, SkinwaveWarning
from skinwave.system.progress_bar import reported

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.axes import Axes


NEAR = 0.5  # of a sampling interval: how far outside a time may be


@dataclass(frozen=True, kw_only=True, eq=False)
class Field:
    """Displacement (t, n, 3) in metre of the nodes of `mesh` at `times` (t,) in s, and the relative
    error that is expected of the probes' waveforms, nan if unknown.
    """

    mesh: TetMesh
    times: Floats
    displacement: Floats
    effort: Effort
    expected_error: float = np.nan

    def __repr__(self) -> str:
        size = 1e6 * float(np.sqrt((self.displacement**2).sum(axis=2).max(initial=0.0)))
        said = [
            f"{counted(len(self.times), 'time')} from {1e3 * self.times[0]:g} to "
            f"{1e3 * self.times[-1]:.5g} ms, displacement at most {significant(size)} µm",
            f"{self.mesh!r}"[1:-1],
            f"expected error {stated_error(self.expected_error)}",
            counted(len(self.effort.warnings), "warning"),
        ]
        return f"<Field: {'; '.join(said)}>"

    @property
    def strongest(self) -> float:
        """The one of its times, s, when a node is displaced most."""
        return float(self.times[np.argmax((self.displacement**2).sum(axis=2).max(axis=1))])

    def frame(self, time: float | None = None) -> int:
        """Number of the time that is nearest to one in s, the `strongest` if none is given.

        Raises
        ------
        ValueError
            If it is before the first or after the last.
        """
        return nearest_frame(self.times, self.strongest if time is None else time)

    def to_pyvista(self, time: float | None = None) -> pv.UnstructuredGrid:
        """The mesh at rest as a grid of pyvista, in metre, with its `displacement` (n, 3) in metre
        at the time nearest to one in s, or when it is largest; `time_s` in its field data.
        """
        grid, k = self.mesh.to_pyvista(), self.frame(time)
        grid.point_data["displacement"] = self.displacement[k]
        grid.field_data["time_s"] = self.times[k : k + 1]
        return grid

    def plot(self, time: float | None = None, *, ax: Axes | None = None) -> Axes:
        """Draw the displacement into the body of the upper surface, seen from above, at the time
        nearest to one in s, or when it is largest; colours are those of all times.
        """
        return _draw(self, self.frame(time), ax)

    def save(self, path: str | Path, frames: int | None = None, *, overwrite: bool = False) -> Path:
        """Write a ParaView collection, `path` ending in .pvd, and a .vtu file beside it of each of
        so many times, evenly spaced, or of all; the path.

        Raises
        ------
        ValueError
            If it ends otherwise, or there is such a file, which is not to be overwritten.
        """
        return _save(self, Path(path), frames, overwrite=overwrite)


def field(
    scene: Scene,
    times: Floats,
    tolerance: float = 0.02,
    progress: Progress | bool | None = None,
    *,
    h: float | None = None,
    solver: str = "auto",
) -> Field:
    """Motion of a scene's whole body from rest.

    The body is reduced to the subspace of the load along the path: what it takes grows with the
    length of the path, and another path needs another reduction. The error
    against a coarser mesh and all else that falls short of the request is in `effort.warnings`,
    each sentence issued once as a `SkinwaveWarning`.

    Parameters
    ----------
    scene : Scene
    times : (t,) float, s, equally spaced from 0
    tolerance, progress, h, solver : as for `simulate`

    Returns
    -------
    Field, displacement (t, n, 3) in metre

    Raises
    ------
    ValueError
        If the scene has no body, a number is out of range or the tolerance is out of reach.
    """
    with reported(progress) as report:
        moved = waves(scene, tolerance, report, h=h, solver=solver)
    check_values(len(times), len(moved.mesh.points))
    displacement = (from_rest(moved.motion, times) @ moved.own_basis.T).reshape(len(times), -1, 3)
    surface = replace(scene, depth=0.0, quantity=DISPLACEMENT.name)  # what is assessed is motion
    at_probes = assessed_probes(surface, moved, h, tolerance, solver)
    for sentence in at_probes.effort.warnings:
        warnings.warn(sentence, SkinwaveWarning, stacklevel=2)
    return Field(
        mesh=moved.mesh, times=times, displacement=displacement, effort=at_probes.effort,
        expected_error=at_probes.expected_error,
    )  # fmt: skip


def assessed_probes(
    scene: Scene, moved: BodyMotion, h: float | None, tolerance: float, solver: str
) -> Response:
    """Response of the probes with its expected error, from a coarser mesh, and all warnings.

    Parameters
    ----------
    scene : Scene
    moved : BodyMotion, of the scene
    h, tolerance, solver : as for `simulate`

    Returns
    -------
    Response, (t, p) of the scene's quantity
    """
    found = probe_response(scene, moved)
    options = SolveOptions(h=h, tolerance=tolerance, solver=solver)
    if scene.body.is_held:
        return told(scene, found, found.values, options)
    lines = oscillating(probe_lines(scene, moved)).lines
    return told(scene, found, lines, options)


def nearest_frame(times: Floats, time: float) -> int:
    """Number of the nearest of some times (t,) in s.

    Raises
    ------
    ValueError
        If the time is outside them.
    """
    slack = NEAR * float(times[1] - times[0]) if len(times) > 1 else 0.0
    if not times[0] - slack <= time <= times[-1] + slack:
        raise ValueError(
            f"time = {time:g} s is outside the field's, {times[0]:g} to {times[-1]:g} s; give one "
            "of these"
        )
    return int(np.argmin(np.abs(times - time)))


def _upper(field: Field) -> tuple[Ints, Ints]:
    """Nodes (s,) of the upper surface, and the flat triangles (k, 3) of these."""
    surface, local = np.unique(facet_set(field.mesh, "top"), return_inverse=True)
    local = local.reshape(-1, field.mesh.facets["top"].shape[1])
    return surface, split(local) if local.shape[1] == 6 else local


def _draw(field: Field, k: int, ax: Axes | None) -> Axes:
    """A map of one frame, with its colour bar."""
    from matplotlib.tri import Triangulation

    ax, (surface, triangles) = new_axes(ax), _upper(field)
    x, y = 1e3 * field.mesh.points[surface, :2].T
    pushed = -DISPLACEMENT.per_unit * field.displacement[:, surface, 2]
    limit = float(np.abs(pushed).max()) or 1.0
    image = ax.tripcolor(
        Triangulation(x, y, triangles), pushed[k], shading="gouraud", cmap=SIGNED, vmin=-limit,
        vmax=limit,
    )  # fmt: skip
    ax.set_aspect("equal")
    ax.set(xlabel="x, mm", ylabel="y, mm")
    ax.set_title(f"t = {1e3 * field.times[k]:.2f} ms", fontsize="medium")
    ax.figure.colorbar(image, ax=ax, label=f"{DISPLACEMENT.words}, {DISPLACEMENT.shown}")
    return ax


def _save(field: Field, path: Path, frames: int | None, *, overwrite: bool) -> Path:
    """A collection and the files that it names, which are written first."""
    if path.suffix != ".pvd":
        raise ValueError(f"'{path.name}' ends in {path.suffix or 'nothing'}; name it .pvd")
    stem, chosen = folder_name(path.stem), _spread(len(field.times), frames or len(field.times))
    names = [f"{stem}_{k:04d}.vtu" for k in range(len(chosen))]
    taken = [name for name in (path.name, *names) if (path.parent / name).exists()]
    if taken and not overwrite:
        raise ValueError(f"{path.parent / taken[0]} exists; choose another, or overwrite=True")
    for name, k in zip(names, chosen, strict=True):
        field.to_pyvista(float(field.times[k])).save(path.parent / name)
    with output_file(path, overwrite=overwrite) as file:
        file.write(collection(names, field.times[chosen].tolist()).encode())
    return path


def _spread(count: int, frames: int) -> Ints:
    """Numbers of so many frames of all, evenly spaced."""
    if frames < 1:
        raise ValueError(f"frames = {frames} is below 1; give one at least")
    return np.unique(np.linspace(0, count - 1, min(frames, count)).round().astype(int))
