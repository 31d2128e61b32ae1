"""Views: the surface of one response through a period of its steady state, for pictures.

Motion is about its mean, because the mean pressure bends a sheet much more than the vibration.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.load_and_probe import node_operator
from meshes import reading
from meshes.tetmesh import boundary_facets
from simple_model.load.spectrum import pressure_lines, synthesise
from simple_model.quantities import DISPLACEMENT, PRESSURE, Quantity, quantity
from skinwave.models.limits import takes
from skinwave.models.plate_modes import FROM_REST, STRETCHED
from skinwave.models.point_kernel import SAME_LOAD
from skinwave.models.reduced import oscillating, read_at
from skinwave.results.motion import BodyMotion, Shade, Tensors, shade, tensors, vibration
from skinwave.results.playback import played_part
from skinwave.results.run import Run
from skinwave.results.surface import LinesAt, stretching_lines, surface_lines
from skinwave.scene.file import dumps, loads
from skinwave.scene.scene import Scene
from skinwave.system.json_kinds import fitting
from skinwave.typing import Array, Floats, Ints

ARRAYS = ("points", "tets", "surface", "triangles", "times", "motion")
# Shapes of the arrays in a file: numbers, names of lengths, or None for any length.
SHAPES: dict[str, tuple[int | str | None, ...]] = {
    "points": ("n", 3), "times": ("f",), "motion": ("f", "n", 3), "surface": ("s",),
    "triangles": (None, 3), "tets": (None, 10), "tensor_frames": ("g",), "tensor_nodes": ("m",),
    "tensor_tets": (None, 10), "tensor_strain": ("g", "m", 6), "tensor_stress": ("g", "m", 6),
}  # fmt: skip

Singles = NDArray[np.float32]
MotionAt = Callable[[Floats, Floats], Floats]  # places (q, 2), times (t,) -> (t, q)


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """One model's response to a scene, with the data for pictures.

    Parameters
    ----------
    body : name of the body; model, scene
    quantity : displacement, or the pressure of the point kernel
    points : (n, 3) float, m; tets : (m, 10) int, empty for a surface without elements
    surface : (s,) int, points of the upper surface; triangles : (k, 3) int, indices into `surface`
    times : (f,) float, s, through the `period` that is played
    motion : (f, n, 3) float32, m; pressure in Pa along z for the point kernel
    tone : Hz, line that moves the surface most; speed : m/s, of a surface wave there, or None
    tensors : strain and stress at some of the times, of a solid body read from a file
    shade : quantity that colours the surface instead of its motion
    moved : motion of the whole body; not stored in files
    from_rest : bool, whether `motion` is from rest instead of about its mean
    """

    body: str
    model: str
    scene: Scene
    quantity: Quantity
    points: Floats
    tets: Ints
    surface: Ints
    triangles: Ints
    period: float
    times: Floats
    motion: Singles
    tone: float
    speed: float | None
    tensors: Tensors | None = None
    shade: Shade | None = None
    moved: BodyMotion | None = None
    from_rest: bool = False

    @property
    def column(self) -> str:
        """Name in tables and figures, as `Run.column`."""
        return self.model if self.body == "none" else self.body

    @property
    def places(self) -> Floats:
        """Places (s, 2) of the upper surface in m."""
        return self.points[self.surface, :2]

    @cached_property
    def inward(self) -> Singles:
        """Motion (f, s) of the upper surface into the body, in SI units."""
        return -self.motion[:, self.surface, 2]

    @cached_property
    def peak(self) -> float:
        """Largest motion into or out of the body, in SI units."""
        return float(np.abs(self.inward).max()) or 1.0

    @property
    def peak_frame(self) -> int:
        """Frame at which the body moves most."""
        return int(np.abs(self.inward).max(axis=1).argmax())


def fastest_line(moved: BodyMotion, strong_line_ratio: float = 0.1) -> float:
    """Return the highest frequency in Hz that moves a body by a tenth of its largest or more."""
    lines, basis = oscillating(moved.motion), moved.own_basis
    power = np.einsum("fm,mn,fn->f", lines.lines.conj(), basis.T @ basis, lines.lines).real
    strong = (power > 0) & (power >= strong_line_ratio**2 * power.max(initial=0.0))
    return float(lines.frequencies[strong].max(initial=0.0))


def body_view(
    scene: Scene, body: str, moved: BodyMotion, part: tuple[float, int] | None = None
) -> View:
    """Return the view of a meshed body; `part` is the played duration in s and the number of
    frames, by default those of `playback.played_part`.
    """
    period, frames = part or played_part(scene.pressure, fastest_line(moved))
    times = np.arange(frames) * period / frames
    view = motion_view(scene, body, moved, times, vibration(moved, times))
    return replace(view, period=period, from_rest=False)


def motion_view(scene: Scene, body: str, moved: BodyMotion, times: Floats, motion: Floats) -> View:
    """Return the view of a meshed body with its displacement (t, m, 3) in m from rest."""
    mesh = moved.mesh
    surface, local = np.unique(mesh.facets["top"], return_inverse=True)
    _, inwards = node_operator(mesh, patch=scene.body.of_kind.normal_patch)
    lines = read_at(oscillating(moved.motion), inwards @ moved.own_basis)
    tone = _strongest_tone(lines.frequencies, np.abs(lines.lines))
    return View(
        body=body, model="fem", quantity=DISPLACEMENT, scene=scene, points=mesh.points,
        tets=mesh.tets, surface=surface, triangles=split(local.reshape(-1, 6)),
        period=float(np.ptp(times)), times=times, motion=motion.astype(np.float32), tone=tone,
        speed=_speed(scene, tone), moved=moved, from_rest=True,
    )  # fmt: skip


def with_shade(view: View, scene: Scene) -> View:
    """Return a view coloured by the quantity of a scene's probes; raises the errors of `shade`."""
    assert view.moved
    nodes = np.unique(boundary_facets(view.tets))
    return replace(view, shade=shade(scene, view.moved, view.times, nodes))


def with_tensors(view: View) -> View:
    """Return a view with strain and stress at its `field_frames` if the body is solid."""
    if view.moved is None or view.scene.body.of_kind.is_plate:
        return view
    return replace(view, tensors=tensors(view.moved, view.times, field_frames(len(view.times))))


def field_frames(count: int, most: int = 8) -> Ints:
    """Return the indices (k,) of the frames that are exported to other programs."""
    return np.unique(np.arange(most) * count // most)


def kernel_view(scene: Scene, reach: Floats, part: tuple[float, int], side: int = 121) -> View:
    """Return the point kernel's view on a flat rectangle of half sides `reach` (2,) in m, with
    points along a `side`.
    """
    pressure = scene.pressure

    def motion_at(places: Floats, t: Floats) -> Floats:
        f, lines = pressure_lines(pressure, places)
        return pressure(places, t) - lines[f == 0].real.sum(axis=0)

    lines_at, shape = partial(pressure_lines, pressure), _grid(reach, side)
    view = _flat_view(scene, "none", SAME_LOAD.name, part, shape, lines_at, motion_at)
    return replace(view, quantity=PRESSURE)


def flat_view(
    run: Run, reach: Floats, part: tuple[float, int], side: int = 81, tolerance: float = 0.05
) -> View:
    """Return the view of a thin plate, or of a laterally infinite body on a flat rectangle.

    `reach`, `part` and `side` are those of `kernel_view`. A sheet at large deflection moves within
    the `tolerance`.
    """
    scene, body = run.scene, run.scene.body
    if scene.reading.is_plain and takes(FROM_REST, scene):
        points, triangles = _grid(np.array([body.width, body.height]) / 2, side)
        points[:, :2] += body.placement.offset
    else:
        points, triangles = _grid(reach, side)
    is_large = run.model == STRETCHED.name
    lines_at = stretching_lines(scene, tolerance)[0] if is_large else surface_lines(scene)
    return _flat_view(scene, run.body, run.model, part, (points, triangles), lines_at)


def _speed(scene: Scene, tone: float) -> float | None:
    body = scene.body
    if not body.of_kind.discretise:
        return None
    return body.of_kind.wave_speed(body, tone or 140.0)  # a typical frequency if nothing vibrates


def _strongest_tone(frequencies: Floats, amplitudes: Floats) -> float:
    """Return the frequency in Hz of the line (f,) with the largest motion (f, p), or 0."""
    if not len(frequencies):
        return 0.0
    return float(frequencies[np.argmax((amplitudes**2).sum(axis=1))])


def _flat_view(
    scene: Scene, body: str, model: str, part: tuple[float, int], shape: tuple[Floats, Ints],
    lines_at: LinesAt, motion_at: MotionAt | None = None,
) -> View:  # fmt: skip
    """Return the view of a flat surface from lines, or from `motion_at` if not their sum."""
    (points, triangles), (period, frames) = shape, part
    times, places = np.arange(frames) * period / frames, points[:, :2]
    f, lines = lines_at(places)
    moving, lines = f[f > 0], lines[f > 0]
    tone = _strongest_tone(moving, np.abs(lines))
    motion = np.zeros((frames, len(points), 3), np.float32)
    motion[:, :, 2] = -(motion_at(places, times) if motion_at else synthesise(moving, lines, times))
    return View(
        body=body, model=model, quantity=DISPLACEMENT, scene=scene, points=points,
        tets=np.zeros((0, 10), np.int64), surface=np.arange(len(points)), triangles=triangles,
        period=period, times=times, motion=motion, tone=tone, speed=_speed(scene, tone),
    )  # fmt: skip


def path_points(scene: Scene, count: int = 241) -> Floats:
    """Return the closed path (count, 2) in m, or one point if the focus rests."""
    path = scene.tacton.trajectory
    return path.at_phase(np.zeros(1) if path.is_static else np.linspace(0, 1, count))


def save(path: Path, view: View) -> None:
    """Write a view to an npz file."""
    arrays: dict[str, Any] = {name: getattr(view, name) for name in ARRAYS}
    if (stored := with_tensors(view).tensors) is not None:
        arrays |= {f"tensor_{key}": value for key, value in vars(stored).items()}
    meta = {name: getattr(view, name) for name in ("body", "model", "period", "tone", "speed")}
    meta |= {"quantity": view.quantity.name, "scene": dumps(view.scene)}
    np.savez_compressed(path, meta=np.array(json.dumps(meta)), **arrays)


def load(path: Path) -> View:
    """Read a view from an npz file; raises a ValueError if the file holds something else."""
    types = {
        "body": str, "model": str, "quantity": str, "period": float, "tone": float, "scene": str,
    }  # fmt: skip
    try:
        arrays = reading.load_arrays(path)
        meta: dict[str, Any] = fitting(json.loads(str(arrays["meta"])), types, "meta")
        stored = {name: arrays[name] for name in SHAPES if name in arrays}
        _check_arrays(stored)
        if not (len(stored["points"]) and len(stored["surface"]) and meta["period"] > 0):
            raise ValueError("it is empty or has no period")
        names = [one.name for one in fields(Tensors)] if "tensor_frames" in stored else []
        tensor_arrays = {name: stored[f"tensor_{name}"] for name in names}
        known: dict[str, Any] = {name: stored[name] for name in ARRAYS}
        known |= {name: meta[name] for name in ("body", "model", "period", "tone", "speed")}
        return View(
            quantity=quantity(meta["quantity"]), scene=loads(meta["scene"]),
            tensors=Tensors(**tensor_arrays) if tensor_arrays else None, **known,
        )  # fmt: skip
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise ValueError(
            f"{path} is not a view written by skinwave ({error}). Compute it again from its scene"
        ) from None


def _check_arrays(arrays: dict[str, Array]) -> None:
    """Raise a ValueError for a wrong shape, type or index, or a number that is not finite."""
    lengths = {"n": "points", "s": "surface", "f": "times", "g": "tensor_frames",
               "m": "tensor_nodes"}  # fmt: skip
    sizes = {key: len(arrays[name]) for key, name in lengths.items() if name in arrays}
    # Lengths that indices must be below.
    bounds = {
        "surface": "n", "triangles": "s", "tets": "n", "tensor_frames": "f", "tensor_nodes": "n",
        "tensor_tets": "m",
    }  # fmt: skip
    for name, array in arrays.items():
        shape = [sizes[each] if isinstance(each, str) else each for each in SHAPES[name]]
        fits = array.ndim == len(shape) and all(
            expected in (actual, None) for actual, expected in zip(array.shape, shape, strict=True)
        )
        if not fits or array.dtype.kind not in ("iu" if name in bounds else "fiu"):
            raise ValueError(f"'{name}' has shape {array.shape} and type {array.dtype}")
        is_index = name in bounds and array.size
        if is_index and not 0 <= array.min() <= array.max() < sizes[bounds[name]]:
            raise ValueError(f"'{name}' has an index out of range")
        if not np.isfinite(array).all():
            raise ValueError(f"'{name}' has values that are not finite")


def split(facets: Ints) -> Ints:
    """Return six-node facets (k, 6) as flat triangles (4 k, 3)."""
    return facets[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]].reshape(-1, 3)


def _grid(reach: Floats, side: int) -> tuple[Floats, Ints]:
    """Return points (side^2, 3) and triangles (k, 3) of a flat rectangle."""
    x, y = (np.linspace(-r, r, side) for r in reach)
    X, Y = np.meshgrid(x, y, indexing="ij")
    a = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    b = a + side
    triangles = np.vstack([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])
    return np.column_stack([X.ravel(), Y.ravel(), np.zeros(X.size)]), triangles
