"""Motion of a whole body, with its expected error and all warnings."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshes import TetMesh
from meshes.tetmesh import Floats
from simple_model import Effort, Response
from simple_model.numbers import counted, significant, stated_error
from simple_model.quantities import DISPLACEMENT
from skinwave.effort import Progress, SkinwaveWarning
from skinwave.models.reduction import from_rest, oscillating
from skinwave.pictures import field_plot
from skinwave.pictures.motion import Waves, check_values, probe_lines, probe_response, waves
from skinwave.planning.assessment import told
from skinwave.progress_bar import reported
from skinwave.scene import Scene

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.animation import FuncAnimation
    from matplotlib.axes import Axes


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
        return field_plot.frame(self.times, self.strongest if time is None else time)

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
        return field_plot.draw(self, self.frame(time), ax)

    def animate(self, frames: int = 40, *, ax: Axes | None = None) -> FuncAnimation:
        """The same as a film of so many of its times, evenly spaced; `.save("film.gif")` writes it,
        or `.save("film.mp4")` with the extra [film]; `.to_jshtml()` shows it in a notebook.
        """
        return field_plot.animation(self, frames, ax)

    def save(self, path: str | Path, frames: int | None = None, *, overwrite: bool = False) -> Path:
        """Write a ParaView collection, `path` ending in .pvd, and a .vtu file beside it of each of
        so many times, evenly spaced, or of all; the path.

        Raises
        ------
        ValueError
            If it ends otherwise, or there is such a file, which is not to be overwritten.
        """
        return field_plot.save(self, Path(path), frames, overwrite=overwrite)


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
    displacement = (from_rest(moved.motion, times) @ moved.basis.T).reshape(len(times), -1, 3)
    surface = replace(scene, depth=0.0, quantity=DISPLACEMENT.name)  # what is assessed is motion
    at_probes = assessed_probes(surface, moved, h, tolerance, solver)
    for sentence in at_probes.effort.warnings:
        warnings.warn(sentence, SkinwaveWarning, stacklevel=2)
    return Field(
        mesh=moved.mesh, times=times, displacement=displacement, effort=at_probes.effort,
        expected_error=at_probes.expected_error,
    )  # fmt: skip


def assessed_probes(
    scene: Scene, moved: Waves, h: float | None, tolerance: float, solver: str
) -> Response:
    """Response of the probes with its expected error, from a coarser mesh, and all warnings.

    Parameters
    ----------
    scene : Scene
    moved : Waves, of the scene
    h, tolerance, solver : as for `simulate`

    Returns
    -------
    Response, (t, p) of the scene's quantity
    """
    found = probe_response(scene, moved)
    if scene.body.is_held:
        return told(scene, found, found.values, h, tolerance, solver)
    lines = oscillating(probe_lines(scene, moved)).lines
    return told(scene, found, lines, h, tolerance, solver)
