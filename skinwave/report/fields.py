"""Motion of a whole body, with its expected error and all warnings."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshes import TetMesh
from meshes.tetmesh import facet_set
from simple_model import Effort
from simple_model.drawing import new_axes
from simple_model.numbers import plural, significant, stated_error
from simple_model.quantities import DISPLACEMENT
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import from_rest, oscillating
from skinwave.planning.assessment import assessed
from skinwave.report.palette import SIGNED
from skinwave.results.exports import collection
from skinwave.results.files import folder_name
from skinwave.results.motion import check_values, probe_lines, probe_response, waves
from skinwave.results.outputs import output_file
from skinwave.results.views import split
from skinwave.scene.scene import Scene
from skinwave.system.effort import Progress, SkinwaveWarning
from skinwave.system.progress_bar import reported
from skinwave.typing import Floats

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
            f"{plural(len(self.times), 'time')} from {1e3 * self.times[0]:g} to "
            f"{1e3 * self.times[-1]:.5g} ms, displacement at most {significant(size)} µm",
            f"{self.mesh!r}"[1:-1],
            f"expected error {stated_error(self.expected_error)}",
            plural(len(self.effort.warnings), "warning"),
        ]
        return f"<Field: {'; '.join(said)}>"

    def frame(self, time: float | None = None) -> int:
        """Number of the time that is nearest to one in s or, without one, when a node is displaced
        most; a ValueError of a time outside those of the field.
        """
        times = self.times
        if time is None:
            return int(np.argmax((self.displacement**2).sum(axis=2).max(axis=1)))
        slack = NEAR * float(times[1] - times[0]) if len(times) > 1 else 0.0
        if not times[0] - slack <= time <= times[-1] + slack:
            raise ValueError(
                f"time = {time:g} s is outside the field's, {times[0]:g} to {times[-1]:g} s; give "
                "one of these"
            )
        return int(np.argmin(np.abs(times - time)))

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
        from matplotlib.tri import Triangulation

        k, ax = self.frame(time), new_axes(ax)
        facets = facet_set(self.mesh, "top")
        surface, local = np.unique(facets, return_inverse=True)
        local = local.reshape(facets.shape)
        triangles = split(local) if facets.shape[1] == 6 else local
        pushed = -DISPLACEMENT.per_unit * self.displacement[:, surface, 2]
        limit = float(np.abs(pushed).max()) or 1.0
        x, y = 1e3 * self.mesh.points[surface, :2].T
        image = ax.tripcolor(
            Triangulation(x, y, triangles), pushed[k],
            shading="gouraud", cmap=SIGNED, vmin=-limit, vmax=limit,
        )  # fmt: skip
        ax.set(aspect="equal", xlabel="x, mm", ylabel="y, mm")
        ax.set_title(f"t = {1e3 * self.times[k]:.2f} ms", fontsize="medium")
        ax.figure.colorbar(image, ax=ax, label=f"{DISPLACEMENT.words}, {DISPLACEMENT.shown}")
        return ax

    def save(self, path: str | Path, frames: int | None = None, *, overwrite: bool = False) -> Path:
        """Write a ParaView collection, `path` ending in .pvd, and a .vtu file beside it of each of
        so many times, evenly spaced, or of all; the path.

        Raises
        ------
        ValueError
            If it ends otherwise, or there is such a file, which is not to be overwritten.
        """
        path, count = Path(path), len(self.times)
        if path.suffix != ".pvd":
            raise ValueError(f"'{path.name}' ends in {path.suffix or 'nothing'}; name it .pvd")
        if frames is not None and frames < 1:
            raise ValueError(f"frames = {frames} is below 1; give one at least")
        chosen = np.unique(np.linspace(0, count - 1, min(frames or count, count)).round())
        times = self.times[chosen.astype(int)].tolist()
        names = [f"{folder_name(path.stem)}_{k:04d}.vtu" for k in range(len(times))]
        taken = [name for name in (path.name, *names) if (path.parent / name).exists()]
        if taken and not overwrite:
            raise ValueError(f"{path.parent / taken[0]} exists; choose another, or overwrite=True")
        for name, time in zip(names, times, strict=True):
            self.to_pyvista(time).save(path.parent / name)
        with output_file(path, overwrite=overwrite) as file:
            file.write(collection(names, times).encode())
        return path


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
    response = probe_response(surface, moved)
    options = SolveOptions(h=h, tolerance=tolerance, solver=solver)
    held = scene.body.is_held  # of a free body, whose mean has no bound, the lines are compared
    compared = response.values if held else oscillating(probe_lines(surface, moved)).lines
    stated = assessed(surface, response, compared, options)
    for sentence in stated.effort.warnings:
        warnings.warn(sentence, SkinwaveWarning, stacklevel=2)
    return Field(
        mesh=moved.mesh, times=times, displacement=displacement, effort=stated.effort,
        expected_error=stated.expected_error,
    )  # fmt: skip
