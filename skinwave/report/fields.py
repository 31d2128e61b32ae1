"""Fields: the motion of a whole body, with its expected error and all warnings."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from meshes import TetMesh
from simple_model import Effort, Response, Statement
from simple_model.choices import choose
from simple_model.drawing import new_axes
from simple_model.numbers import plural, significant
from simple_model.quantities import DISPLACEMENT, VELOCITY
from simple_model.response import UNEVEN
from skinwave.models import named
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import oscillating
from skinwave.planning.assessment import assess
from skinwave.planning.errors import element_warnings, reduction_part, with_statement
from skinwave.report.films import Film, check_format, film
from skinwave.report.palette import SIGNED
from skinwave.report.render import CAMERAS
from skinwave.report.styles import style
from skinwave.results.exports import PARAVIEW_ORDER, check_new, write_collection
from skinwave.results.motion import (
    BodyMotion,
    check_values,
    motion_from_rest,
    probe_lines,
    probe_response,
    strain_from_rest,
    whole_motion,
)
from skinwave.results.outputs import output_path
from skinwave.results.views import motion_view, split
from skinwave.scene.scene import Scene
from skinwave.system.effort import Progress, SkinwaveWarning, silent
from skinwave.system.progress_bar import progress_callback
from skinwave.typing import Floats

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.axes import Axes


@dataclass(frozen=True, kw_only=True, eq=False)
class Field:
    """Motion of a whole body from rest at some times, and the load on its surface.

    Displacement is computed when it is first read, velocity and strain when they are converted or
    saved. Raises a ValueError if the times do not ascend within the duration.

    Parameters
    ----------
    scene : Scene
    moved : BodyMotion, the body's motion at any time
    times : (t,) float, s; with `dataclasses.replace`, other times need no new solution
    effort : Effort; its expected error is that of the displacement at the scene's probes, or of
        the response that was given. Velocity and strain may have larger errors
    """

    scene: Scene
    moved: BodyMotion
    times: Floats
    effort: Effort

    def __post_init__(self) -> None:
        times = _checked_times(self.times, self.scene.tacton.duration)
        times.setflags(write=False)
        object.__setattr__(self, "times", times)

    @property
    def mesh(self) -> TetMesh:
        """Mesh of the body."""
        return self.moved.mesh

    @cached_property
    def displacement(self) -> Floats:
        """Displacement (t, n, 3) in m of the nodes of `mesh`."""
        return motion_from_rest(self.moved, self.times)

    @property
    def expected_error(self) -> float:
        """Expected relative error of the waveforms at the probes; inf if unknown."""
        return self.effort.errors.error

    def __repr__(self) -> str:
        size = 1e6 * float(np.sqrt((self.displacement**2).sum(axis=2).max(initial=0.0)))
        return (
            f"<Field: {plural(len(self.times), 'time')} from {1e3 * self.times[0]:g} to "
            f"{1e3 * self.times[-1]:.5g} ms, displacement at most {significant(size)} µm; "
            f"{f'{self.mesh!r}'[1:-1]}; expected error {self.effort.errors.words}; "
            f"{plural(len(self.effort.warnings), 'warning')}>"
        )

    def frame(self, time: float | None = None) -> int:
        """Return the index of the frame nearest to a time in s, or of the largest displacement.

        Raises a ValueError if the time is outside those of the field.
        """
        times = self.times
        if time is None:
            return int(np.argmax((self.displacement**2).sum(axis=2).max(axis=1)))
        slack = 0.5 * float(times[1] - times[0]) if len(times) > 1 else 0.0
        if not times[0] - slack <= time <= times[-1] + slack:
            raise ValueError(
                f"time = {time:g} s is outside the times of the field, {times[0]:g} to "
                f"{times[-1]:g} s"
            )
        return int(np.argmin(np.abs(times - time)))

    def to_pyvista(self, time: float | None = None) -> pv.UnstructuredGrid:
        """Return the mesh at rest in m, with the data of `grids`, at a time chosen by `frame`."""
        return next(self.grids([self.times[self.frame(time)]]))

    def grids(self, times: Sequence[float] | None = None) -> Iterator[pv.UnstructuredGrid]:
        """Yield the mesh at rest in m at each of some times in s, or at all.

        The times are chosen as in `frame`. Data of the nodes are `displacement` (n, 3) in m,
        `velocity` (n, 3) in m/s, `pressure` (n,) in Pa, 0 below the surface, and for a solid
        `strain` (n, 6), tension positive, in the order XX, YY, ZZ, XY, YZ, XZ. At an interface of
        materials strain is the mean of both sides. A sheet has none, because its mesh is thicker
        than the sheet. Field data are `time_s` and `units`.
        """
        frames = [self.frame(time) for time in (self.times if times is None else times)]
        top = np.unique(self.mesh.facets["top"])
        units = {"displacement": "m", "velocity": "m/s", "strain": "1", "pressure": "Pa"}
        for start in range(0, len(frames), 32):
            some = frames[start : start + 32]
            now = self.times[some]
            pressure = np.zeros((len(some), len(self.mesh.points)))
            pressure[:, top] = self.scene.pressure(self.mesh.points[top], now)
            data = {
                "displacement": self.displacement[some],
                "velocity": motion_from_rest(self.moved, now, VELOCITY),
                "pressure": pressure,
            }
            if not self.scene.body.of_kind.is_plate:
                data["strain"] = strain_from_rest(self.moved, now)[..., PARAVIEW_ORDER]
            for k, time in enumerate(now):
                grid = self.mesh.to_pyvista()
                for name, values in data.items():
                    grid.point_data[name] = values[k]
                grid.field_data["time_s"] = [time]
                grid.field_data["units"] = [f"{name}: {units[name]}" for name in data]
                yield grid

    def plot(self, time: float | None = None, *, ax: Axes | None = None) -> Axes:
        """Draw the displacement of the upper surface into the body, seen from above.

        The frame is chosen as in `frame`; the colour scale covers all times.
        """
        from matplotlib.tri import Triangulation

        k, ax = self.frame(time), new_axes(ax)
        surface, local = np.unique(self.mesh.facets["top"], return_inverse=True)
        triangles = split(local.reshape(-1, 6))
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
        """Write a ParaView collection, and a .vtu file of `grids` for each time.

        Parameters
        ----------
        path : str or Path, ending in .pvd
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
        path, times = Path(path), self._evenly_spaced(frames).tolist()
        if path.suffix != ".pvd":
            raise ValueError(f"'{path.name}' must end in .pvd")
        write_collection(path, self.grids(times), times, overwrite=overwrite)
        return path

    def animate(
        self, path: str | Path | None = None, frames: int | None = None, *,
        camera: str = "tilted", overwrite: bool = False, progress: Progress | bool | None = None,
    ) -> Film:  # fmt: skip
        """Return a film of the motion, which a notebook plays, and write it if there is a path.

        Parameters
        ----------
        path : str or Path, ending in .gif or .mp4; if not given, the film is a GIF
        frames : int, number of evenly spaced times; all if not given
        camera : str, "tilted", "front" or "top"
        overwrite : bool
        progress : see `simulate`

        Raises
        ------
        ValueError
            If the film cannot be drawn or written, or the file exists and `overwrite` is False.
        """
        choose("camera", camera, CAMERAS)
        shown = replace(self, times=self._evenly_spaced(frames))
        kind = self.scene.body.kind
        with TemporaryDirectory() as folder, progress_callback(progress) as report:
            target = Path(path or Path(folder, "film.gif"))
            check_format(target)
            check_new([target], overwrite)
            view = motion_view(self.scene, kind, self.moved, shown.times, shown.displacement)
            with output_path(target, overwrite=overwrite) as aside:
                film(aside, [view], style("report"), report, camera=camera)
            return Film(frames=len(view.times), suffix=target.suffix, data=target.read_bytes())

    def _evenly_spaced(self, frames: int | None) -> Floats:
        """Return a number of evenly spaced times, or all."""
        if frames is not None and frames < 1:
            raise ValueError(f"frames = {frames} must be 1 or more")
        count = len(self.times)
        chosen = np.unique(np.linspace(0, count - 1, min(frames or count, count)).round())
        return self.times[chosen.astype(int)]


def field(
    scene: Scene,
    times: Floats,
    tolerance: float = 0.02,
    progress: Progress | bool | None = None,
    *,
    h: float | None = None,
    solver: str = "auto",
    response: Response | None = None,
) -> Field:
    """Compute the motion of a scene's whole body from rest.

    The body is reduced to the subspace of the load along its path. The cost grows with the length
    of the path, and another path needs another reduction. Warnings are in `effort.warnings`, and
    are issued as `SkinwaveWarning`.

    Parameters
    ----------
    scene : Scene
    times : (t,) float, s, ascending, within the duration of the Tacton
    tolerance, progress, h, solver : see `simulate`
    response : Response of a model of linear elements to the scene, such as of
        `simulate(scene, "fem")`; the field then has the size of its elements and its expected
        error, and no other mesh is solved

    Returns
    -------
    Field

    Raises
    ------
    ValueError
        If the scene has no body, if a number is out of range, if the tolerance cannot be reached,
        or if the response is not of linear elements under the load of the scene.

    Examples
    --------
    >>> import numpy as np
    >>> import skinwave
    >>> scene = skinwave.loads("[body]\\nsides = 'clamped'\\nsize_x_mm = 40\\nsize_y_mm = 40")
    >>> field = skinwave.field(scene, np.arange(50) / 5000, tolerance=0.5)
    >>> float((1e6 * abs(field.displacement).max()).round(1))  # um
    4.2
    """
    times = _checked_times(times, scene.tacton.duration)
    if response is not None:
        h = _element_size(scene, response, h)
    with progress_callback(progress) as report:
        options = SolveOptions(h=h, tolerance=tolerance, solver=solver, progress=report)
        moved = whole_motion(scene, options)
    check_values(len(times), len(moved.mesh.points))
    surface = replace(scene, depth=0.0, quantity=DISPLACEMENT.name)  # the error is that of motion
    own = probe_response(surface, moved)
    if response is None:
        held = scene.body.is_held  # the mean of an unconstrained body grows; its lines are compared
        compared = own.values if held else oscillating(probe_lines(surface, moved)).lines
        own = assess(surface, own, compared, replace(options, progress=silent))
    else:
        parts = response.effort.errors.with_parts([reduction_part(own.effort.estimate)]).parts
        statement = Statement(parts=parts, tolerance=tolerance)
        cautions = element_warnings(surface, response.effort.h)
        own = with_statement(surface, own, statement, cautions)
    for sentence in own.effort.warnings:
        warnings.warn(sentence, SkinwaveWarning, stacklevel=2)
    return Field(scene=scene, moved=moved, times=times, effort=own.effort)


def _checked_times(times: ArrayLike, duration: float) -> Floats:
    given = np.array(times, np.float64)
    if given.ndim != 1 or not len(given) or not np.isfinite(given).all():
        raise ValueError(f"times have shape {given.shape}; give (t,) finite numbers in s")
    if not (given[0] >= 0 and given[-1] <= duration * (1 + UNEVEN) and (np.diff(given) > 0).all()):
        raise ValueError(
            f"times from {given[0]:g} to {given[-1]:g} s do not ascend within 0..{duration:g} s, "
            "the duration of the Tacton; give ascending times within it"
        )
    return given


def _element_size(scene: Scene, response: Response, h: float | None) -> float:
    """Return the element size in m of a response; raise a ValueError if it is of no use."""
    size, load = response.effort.h, response.load
    if not (size and named(response.model).is_refined):
        raise ValueError(
            f"the response is of {response.model}, not of linear elements; give that of "
            "simulate(scene, 'fem')"
        )
    if load != scene.pressure:
        raise ValueError("the response is to another load; give one to the load of the scene")
    if h not in (None, size):
        raise ValueError(
            f"h = {1e3 * h:g} mm, but the response has elements of {1e3 * size:g} mm; leave out h"
        )
    return size
