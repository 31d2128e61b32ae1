"""The motion of a whole body as a map from above, as a film of it, and as files of ParaView."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from meshes.tetmesh import Floats, Ints, facet_set
from simple_model.drawing import new_axes
from simple_model.quantities import DISPLACEMENT
from skinwave.exports import collection
from skinwave.files import folder_name
from skinwave.outputs import output_file
from skinwave.pictures.films import encoder

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation
    from matplotlib.axes import Axes
    from matplotlib.collections import TriMesh
    from matplotlib.figure import Figure

    from skinwave.fields import Field

SIGNED = "RdBu_r"  # distinguishable with every kind of colour vision
INTERVAL = 50  # ms between frames of a film
NEAR = 0.5  # of a sampling interval: how far outside a time may be


def frame(times: Floats, time: float) -> int:
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


def upper(field: "Field") -> tuple[Ints, Ints]:
    """Nodes (s,) of the upper surface, and the flat triangles (k, 3) of these."""
    from skinwave.pictures.views import split

    surface, local = np.unique(facet_set(field.mesh, "top"), return_inverse=True)
    local = local.reshape(-1, field.mesh.facets["top"].shape[1])
    return surface, split(local) if local.shape[1] == 6 else local


def draw(field: "Field", k: int, ax: "Axes | None") -> "Axes":
    """A map of one frame, with its colour bar."""
    ax = new_axes(ax)
    image, pushed = _map(field, ax)
    image.set_array(pushed[k])
    ax.set_title(_stamp(field, k), fontsize="medium")
    return ax


def animation(field: "Field", frames: int, ax: "Axes | None") -> "FuncAnimation":
    """A film of some frames."""
    from matplotlib import rc_context
    from matplotlib.animation import FuncAnimation

    class Film(FuncAnimation):
        """An animation that is saved as GIF or, by the encoder of the extra [film], as MP4."""

        def save(self, filename: Any, writer: Any = None, *rest: Any, **options: Any) -> None:
            suffix = Path(filename).suffix
            if writer is None and suffix == ".gif":
                writer = "pillow"
            with rc_context(encoder() if suffix == ".mp4" else {}):
                super().save(filename, writer, *rest, **options)

    ax = new_axes(ax)
    image, pushed = _map(field, ax)

    def show(k: int) -> tuple[Any, ...]:
        image.set_array(pushed[k])
        return image, ax.set_title(_stamp(field, k), fontsize="medium")

    shown, figure = _spread(len(field.times), frames), cast("Figure", ax.figure)
    return Film(figure, show, shown.tolist(), interval=INTERVAL)


def save(field: "Field", path: Path, frames: int | None, *, overwrite: bool) -> Path:
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


def _map(field: "Field", ax: "Axes") -> "tuple[TriMesh, Floats]":
    """Colours of a surface that are still to be set, and its displacement (t, s) as shown."""
    from matplotlib.tri import Triangulation

    surface, triangles = upper(field)
    x, y = 1e3 * field.mesh.points[surface, :2].T
    pushed = -DISPLACEMENT.per_unit * field.displacement[:, surface, 2]
    limit = float(np.abs(pushed).max()) or 1.0
    image = ax.tripcolor(
        Triangulation(x, y, triangles),
        pushed[0],
        shading="gouraud",
        cmap=SIGNED,
        vmin=-limit,
        vmax=limit,
    )
    ax.set_aspect("equal")
    ax.set_xlabel("x, mm")
    ax.set_ylabel("y, mm")
    ax.figure.colorbar(image, ax=ax, label=f"{DISPLACEMENT.words}, {DISPLACEMENT.shown}")
    return image, pushed


def _stamp(field: "Field", k: int) -> str:
    return f"t = {1e3 * field.times[k]:.2f} ms"


def _spread(count: int, frames: int) -> Ints:
    """Numbers of so many frames of all, evenly spaced."""
    if frames < 1:
        raise ValueError(f"frames = {frames} is below 1; give one at least")
    return np.unique(np.linspace(0, count - 1, min(frames, count)).round().astype(int))
