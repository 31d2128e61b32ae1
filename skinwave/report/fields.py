"""Fields: the motion of a whole body, with its expected error and all warnings."""

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
from simple_model.numbers import plural, significant
from simple_model.quantities import DISPLACEMENT
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import from_rest, oscillating
from skinwave.planning.assessment import assess
from skinwave.report.palette import SIGNED
from skinwave.results.exports import collection
from skinwave.results.files import folder_name
from skinwave.results.motion import check_values, probe_lines, probe_response, whole_motion
from skinwave.results.outputs import output_file
from skinwave.results.views import split
from skinwave.scene.scene import Scene
from skinwave.system.effort import Progress, SkinwaveWarning, silent
from skinwave.system.progress_bar import progress_callback
from skinwave.typing import Floats

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.axes import Axes

SLACK = 0.5  # sampling intervals by which a time may lie outside those of a field


@dataclass(frozen=True, kw_only=True, eq=False)
class Field:
    """Motion of a whole body.

    Parameters
    ----------
    mesh : TetMesh
    times : (t,) float, s
    displacement : (t, n, 3) float, m, of the nodes of `mesh`
    effort : Effort

    Examples
    --------
    >>> import meshes, numpy as np
    >>> from simple_model import Effort
    >>> block = meshes.tag_boundary(meshes.block((4e-3, 4e-3, 2e-3), 2e-3))
    >>> times = np.array([0.0, 1e-3])
    >>> moved = 1e-6 * times[:, None, None] / 1e-3 * np.ones((2, len(block.points), 3))
    >>> field = Field(mesh=block, times=times, displacement=moved, effort=Effort())
    >>> field.frame(), field.frame(0.0)
    (1, 0)
    """

    mesh: TetMesh
    times: Floats
    displacement: Floats
    effort: Effort

    @property
    def expected_error(self) -> float:
        """Expected relative error of the waveforms at the probes; inf if unknown."""
        return self.effort.errors.error

    def __repr__(self) -> str:
        size = 1e6 * float(np.sqrt((self.displacement**2).sum(axis=2).max(initial=0.0)))
        parts = [
            f"{plural(len(self.times), 'time')} from {1e3 * self.times[0]:g} to "
            f"{1e3 * self.times[-1]:.5g} ms, displacement at most {significant(size)} µm",
            f"{self.mesh!r}"[1:-1],
            f"expected error {self.effort.errors.words}",
            plural(len(self.effort.warnings), "warning"),
        ]
        return f"<Field: {'; '.join(parts)}>"

    def frame(self, time: float | None = None) -> int:
        """Return the index of the frame nearest to a time in s, or of the largest displacement.

        Raises a ValueError if the time is outside those of the field.
        """
        times = self.times
        if time is None:
            return int(np.argmax((self.displacement**2).sum(axis=2).max(axis=1)))
        slack = SLACK * float(times[1] - times[0]) if len(times) > 1 else 0.0
        if not times[0] - slack <= time <= times[-1] + slack:
            raise ValueError(
                f"time = {time:g} s is outside the times of the field, {times[0]:g} to "
                f"{times[-1]:g} s"
            )
        return int(np.argmin(np.abs(times - time)))

    def to_pyvista(self, time: float | None = None) -> pv.UnstructuredGrid:
        """Return the mesh at rest in m with its `displacement` (n, 3) in m.

        The frame is chosen as in `frame`; the field data `time_s` is its time.
        """
        grid, k = self.mesh.to_pyvista(), self.frame(time)
        grid.point_data["displacement"] = self.displacement[k]
        grid.field_data["time_s"] = self.times[k : k + 1]
        return grid

    def plot(self, time: float | None = None, *, ax: Axes | None = None) -> Axes:
        """Draw the displacement of the upper surface into the body, seen from above.

        The frame is chosen as in `frame`; the colour scale covers all times.
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
        """Write a ParaView collection, `path` ending in .pvd, and a .vtu file for each time.

        Parameters
        ----------
        path : str or Path
        frames : int, number of evenly spaced times; all if not given
        overwrite : bool

        Returns
        -------
        Path

        Raises
        ------
        ValueError
            If the path has another suffix, or a file exists and `overwrite` is False.
        """
        path, count = Path(path), len(self.times)
        if path.suffix != ".pvd":
            raise ValueError(f"'{path.name}' must end in .pvd")
        if frames is not None and frames < 1:
            raise ValueError(f"frames = {frames} must be 1 or more")
        chosen = np.unique(np.linspace(0, count - 1, min(frames or count, count)).round())
        times = self.times[chosen.astype(int)].tolist()
        names = [f"{folder_name(path.stem)}_{k:04d}.vtu" for k in range(len(times))]
        existing = [name for name in (path.name, *names) if (path.parent / name).exists()]
        if existing and not overwrite:
            raise ValueError(
                f"{path.parent / existing[0]} exists. Give another name or overwrite=True"
            )
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
    """Compute the motion of a scene's whole body from rest.

    The body is reduced to the subspace of the load along its path, so that the cost grows with the
    length of the path, and another path needs another reduction. Warnings are in `effort.warnings`;
    each is also issued as a `SkinwaveWarning`.

    Parameters
    ----------
    scene : Scene
    times : (t,) float, s, equally spaced from 0
    tolerance, progress, h, solver : see `simulate`

    Returns
    -------
    Field

    Raises
    ------
    ValueError
        If the scene has no body, if a number is out of range, or if the tolerance cannot be
        reached.

    Examples
    --------
    >>> import numpy as np
    >>> import skinwave
    >>> scene = skinwave.loads("[body]\\nsides = 'clamped'\\nsize_x_mm = 40\\nsize_y_mm = 40")
    >>> field = skinwave.field(scene, np.arange(50) / 5000, tolerance=0.5)
    >>> float((1e6 * abs(field.displacement).max()).round(1))  # um
    4.2
    """
    with progress_callback(progress) as report:
        options = SolveOptions(h=h, tolerance=tolerance, solver=solver, progress=report)
        moved = whole_motion(scene, options)
    check_values(len(times), len(moved.mesh.points))
    displacement = (from_rest(moved.motion, times) @ moved.own_basis.T).reshape(len(times), -1, 3)
    surface = replace(scene, depth=0.0, quantity=DISPLACEMENT.name)  # the error is that of motion
    response = probe_response(surface, moved)
    held = scene.body.is_held  # the mean of an unconstrained body grows; its lines are compared
    compared = response.values if held else oscillating(probe_lines(surface, moved)).lines
    response = assess(surface, response, compared, replace(options, progress=silent))
    for sentence in response.effort.warnings:
        warnings.warn(sentence, SkinwaveWarning, stacklevel=2)
    return Field(mesh=moved.mesh, times=times, displacement=displacement, effort=response.effort)
