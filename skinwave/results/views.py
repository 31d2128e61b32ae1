"""View of one model's response in pictures: its surface through a period of the steady state.

Motion is about its mean: a steady push bends a sheet far more than its vibration does.
"""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.load_and_probe import node_operator
from meshes import reading
from meshes.tetmesh import boundary_facets
from simple_model import Effort
from simple_model.layers.flat_body import steady_lines
from simple_model.load.spectrum import pressure_lines, synthesise
from simple_model.quantities import DISPLACEMENT, PRESSURE, Quantity, quantity
from skinwave.bodies.analytic import compliance
from skinwave.models.limits import takes
from skinwave.models.plate_modes import FROM_REST, STRETCHED, settled
from skinwave.models.plate_modes import steady_lines as plate_lines
from skinwave.models.point_kernel import SAME_LOAD
from skinwave.models.reduced import oscillating, read_at
from skinwave.results.motion import BodyMotion, Shade, Tensors, shade, tensors, vibration
from skinwave.results.run import Run
from skinwave.results.speeds import shown_part, strongest_tone
from skinwave.results.surface import FAINT, Lines
from skinwave.scene.file import dumps, loads
from skinwave.scene.scene import Scene
from skinwave.system.json_kinds import effort_of, fitting
from skinwave.typing import Array, Floats, Ints

STRONG = 0.1  # of the strongest line: weaker ones need no frames of their own
GRID, LAYER_GRID = 121, 81  # points along a side of the surface of the point kernel, of a layer
TYPICAL = 140.0  # Hz, where nothing vibrates
FIELD_FRAMES = 8  # of those that are shown, written for other programs
PLATE_TOLERANCE = 0.05  # of the motion of a sheet at large deflection
ARRAYS = ("points", "tets", "surface", "triangles", "times", "motion")
META = {"body": str, "model": str, "quantity": str, "period": float, "tone": float, "scene": str}

Singles = NDArray[np.float32]
LinesAt = Callable[[Floats], Lines]  # places (q, 2) -> frequencies (f,) in Hz, lines (f, q)
MotionAt = Callable[[Floats, Floats], Floats]  # places (q, 2), times (t,) -> (t, q)


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """One model's response in a scene, as pictures need it.

    Parameters
    ----------
    body : name of the body, by which it has its colour; model, scene
    quantity : of its motion: a displacement, or the pressure of the point kernel
    points : (n, 3) float, metre; tets : (m, 10) int, none of a surface without elements
    surface : (s,) int, the points of the upper surface; triangles : (k, 3) int, of these
    times : (f,) float, s, through the part of the steady state that is played, `period`
    motion : (f, n, 3) float32, metre; of the point kernel the pressure in Pa, along the push
    tone : Hz, the line that moves the surface most; speed : m/s, of a surface wave there, or None
    tensors : strain and stress at some of its times, of a solid body that was saved; shade : the
        quantity that colours it, instead of its motion; moved : the motion that it was made of,
        which no file keeps
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
    effort: Effort = field(default_factory=Effort)
    tensors: Tensors | None = None
    shade: Shade | None = None
    moved: BodyMotion | None = None

    @property
    def column(self) -> str:
        """Name in tables and figures, as `Run.column`."""
        return self.model if self.body == "none" else self.body

    @property
    def places(self) -> Floats:
        """Where the upper surface is, (s, 2) in metre."""
        return self.points[self.surface, :2]

    @property
    def pushed(self) -> Singles:
        """Motion (f, s) of the upper surface into the body, in SI."""
        return -self.motion[:, self.surface, 2]

    @cached_property
    def finder(self) -> Any:
        """Function of x and y (...) in metre: which triangle is there, -1 for none."""
        from matplotlib.tri import Triangulation

        x, y = self.places.T
        corners = np.stack([x, y], axis=1)[self.triangles]
        along, across = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
        kept = area > 1e-6 * area.max()  # of a steep rim some are seen edge-on, or from below
        return Triangulation(x, y, self.triangles[kept]).get_trifinder()

    @property
    def peak(self) -> float:
        """The largest motion into or out of the body anywhere at any time, in SI."""
        return float(np.abs(self.pushed).max()) or 1.0


def fastest_line(moved: BodyMotion) -> float:
    """The highest line in Hz that moves a body by `STRONG` of what its strongest one does."""
    lines, basis = oscillating(moved.motion), moved.own_basis
    power = np.einsum("fm,mn,fn->f", lines.lines.conj(), basis.T @ basis, lines.lines).real
    return _fastest(lines.frequencies, power)


def _fastest(frequencies: Floats, power: Floats) -> float:
    counts = (power > 0) & (power >= STRONG**2 * power.max(initial=0.0))
    return float(frequencies[counts].max(initial=0.0))


def body_view(
    scene: Scene, body: str, moved: BodyMotion, part: tuple[float, int] | None = None
) -> View:
    """A body's view, from all of its motion; `part` is how long it is played, s, and in how many
    frames, `speeds.shown_part` of its own motion if not given.
    """
    mesh = moved.mesh
    period, frames = part or shown_part(scene.pressure, fastest_line(moved))
    surface, triangles = _upper(mesh.facets["top"])
    times = np.arange(frames) * period / frames
    _, inwards = node_operator(mesh, patch=scene.body.of_kind.normal_patch)
    seen = read_at(oscillating(moved.motion), inwards @ moved.own_basis)
    tone = strongest_tone(seen.frequencies, np.abs(seen.lines))
    return View(
        body=body, model="fem", quantity=DISPLACEMENT, scene=scene, points=mesh.points,
        tets=mesh.tets, surface=surface, triangles=triangles, period=period, times=times,
        motion=vibration(moved, times).astype(np.float32), tone=tone, speed=_speed(scene, tone),
        effort=moved.effort, moved=moved,
    )  # fmt: skip


def shaded(view: View, scene: Scene) -> View:
    """A body's view, coloured by the quantity that a scene's probes read; raises what
    `motion.shade` does.
    """
    assert view.moved
    nodes = np.unique(boundary_facets(view.tets))
    return replace(view, shade=shade(scene, view.moved, view.times, nodes))


def with_tensors(view: View) -> View:
    """A view with strain and stress at `FIELD_FRAMES` of its times, if it is of a solid body."""
    if view.moved is None or view.scene.body.of_kind.is_plate:
        return view
    return replace(view, tensors=tensors(view.moved, view.times, field_frames(len(view.times))))


def field_frames(count: int) -> Ints:
    """Numbers (k,) of the frames, of so many, that are written for other programs."""
    return np.unique(np.arange(FIELD_FRAMES) * count // FIELD_FRAMES)


def kernel_view(scene: Scene, reach: Floats, part: tuple[float, int] | None = None) -> View:
    """The point kernel's view, on a flat square as far as `reach` (2,) in metre either way; `part`
    as `body_view` takes it.
    """
    pressure, shape = scene.pressure, _grid(reach, GRID)

    def motion_at(places: Floats, t: Floats) -> Floats:
        f, lines = pressure_lines(pressure, places)
        return pressure(places, t) - lines[f == 0].real.sum(axis=0)

    if part is None:
        f, lines = pressure_lines(pressure, shape[0])
        part = shown_part(pressure, _fastest(f[f > 0], (np.abs(lines[f > 0]) ** 2).sum(axis=1)))
    lines_at = partial(pressure_lines, pressure)
    found = _flat_view(scene, "none", SAME_LOAD.name, part, shape, lines_at, motion_at)
    return replace(found, quantity=PRESSURE)


def flat_view(run: Run, reach: Floats, part: tuple[float, int]) -> View:
    """The view of a sheet by the modes of a thin plate, in the later half of the scene if its
    deflection is large, or of an infinite layer or a half-space by its wavenumber integral, on a
    flat square; `reach` and `part` as `kernel_view` takes them.
    """
    scene, body, motion_at = run.scene, run.scene.body, None
    lines_at: LinesAt
    if scene.reading.is_plain and takes(FROM_REST, scene):
        points, triangles = _grid(np.array([body.width, body.height]) / 2, LAYER_GRID)
        points[:, :2] += body.placement.offset
        lines_at = partial(plate_lines, scene)
        if run.model == STRETCHED.name:
            lines_at, motion_at = _stretched(scene, np.array(body.placement.offset))
    else:
        points, triangles = _grid(reach, LAYER_GRID)
        lines_at = partial(steady_lines, compliance(body), scene.pressure, threshold=FAINT)
    shape = points, triangles
    found = _flat_view(scene, run.body, run.model, part, shape, lines_at, motion_at)
    return replace(found, speed=_speed(scene, found.tone), effort=run.response.effort)


def _speed(scene: Scene, tone: float) -> float | None:
    return scene.body.of_kind.wave_speed(scene.body, tone or TYPICAL)


def _stretched(scene: Scene, middle: Floats) -> tuple[LinesAt, MotionAt]:
    """Lines and motion of a sheet at large deflection, in the later half of the scene."""
    from scipy.interpolate import CubicSpline  # which takes long to import

    at, z, modes = settled(scene, PLATE_TOLERANCE)
    steady = CubicSpline(at - at[0], z)
    f = plate_lines(scene, middle[None])[0]
    window = np.hanning(len(at))
    coordinates = 2 / window.sum() * (np.exp(-2j * np.pi * np.multiply.outer(f, at)) * window) @ z

    def lines_at(places: Floats) -> Lines:
        return f, (coordinates @ modes.at(places - middle).T)

    def motion_at(places: Floats, t: Floats) -> Floats:
        return np.asarray(steady(np.mod(t, at[-1] - at[0])) @ modes.at(places - middle).T)

    return lines_at, motion_at


def _flat_view(
    scene: Scene, body: str, model: str, part: tuple[float, int], shape: tuple[Floats, Ints],
    lines_at: LinesAt, motion_at: MotionAt | None = None,
) -> View:  # fmt: skip
    """The view of a flat surface of points (p, 3) and triangles, from its lines at any places;
    `motion_at` its motion, if it is not the sum of these lines.
    """
    (points, triangles), (period, frames) = shape, part
    times, places = np.arange(frames) * period / frames, points[:, :2]
    f, lines = lines_at(places)
    moving, lines = f[f > 0], lines[f > 0]
    motion = np.zeros((frames, len(points), 3), np.float32)
    motion[:, :, 2] = -(motion_at(places, times) if motion_at else synthesise(moving, lines, times))
    return View(
        body=body, model=model, quantity=DISPLACEMENT, scene=scene, points=points,
        tets=np.zeros((0, 10), np.int64), surface=np.arange(len(points)), triangles=triangles,
        period=period, times=times, motion=motion, tone=strongest_tone(moving, np.abs(lines)),
        speed=None,
    )  # fmt: skip


def path_points(scene: Scene, count: int = 241) -> Floats:
    """The path (count, 2) in metre, closed; one point if the focus rests."""
    path = scene.tacton.trajectory
    return path.at_phase(np.zeros(1) if path.is_static else np.linspace(0, 1, count))


def save(path: Path, view: View) -> None:
    """A view as one npz file."""
    arrays: dict[str, Any] = {n: getattr(view, n) for n in ARRAYS}
    if (kept := with_tensors(view).tensors) is not None:
        arrays |= {f"tensor_{key}": value for key, value in vars(kept).items()}
    meta = {n: getattr(view, n) for n in ("body", "model", "period", "tone", "speed")} | {
        "quantity": view.quantity.name, "scene": dumps(view.scene), "effort": asdict(view.effort)
    }  # fmt: skip
    np.savez_compressed(path, meta=np.array(json.dumps(meta)), **arrays)


def load(path: Path) -> View:
    """A view from its file.

    Raises
    ------
    ValueError
        If the file is none of these.
    """
    try:
        arrays = reading.load_arrays(path)
        meta: dict[str, Any] = fitting(json.loads(str(arrays["meta"])), META, "meta")
        meta |= {"scene": loads(meta["scene"]), "effort": effort_of(meta["effort"], "effort")}
        meta |= {"quantity": quantity(meta["quantity"]), "tensors": _tensors(arrays)}
        n, s, f = (len(arrays[name]) for name in ("points", "surface", "times"))
        for name, *shape in (("points", n, 3), ("times", f), ("motion", f, n, 3)):
            _check(arrays, name, shape)
        for name, most, *shape in (("surface", n, s), ("triangles", s, -1, 3), ("tets", n, -1, 10)):
            _check(arrays, name, shape, most)
        if not (n and s and f and meta["period"] > 0):
            raise ValueError("it is empty, or has no period")
        meta |= {name: arrays[name] for name in ARRAYS}
        return View(**meta)
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise ValueError(f"{path} is no view ({error}); make it anew from its scene") from None


def _tensors(arrays: dict[str, Array]) -> Tensors | None:
    """Tensors among the arrays of a view, if there are any."""
    if "tensor_frames" not in arrays:
        return None
    found = {one.name: arrays[f"tensor_{one.name}"] for one in fields(Tensors)}
    frames, nodes = len(found["frames"]), len(found["nodes"])
    for name, most, *shape in (
        ("frames", len(arrays["times"]), frames), ("nodes", len(arrays["points"]), nodes),
        ("tets", nodes, -1, 10),
    ):  # fmt: skip
        _check(found, name, shape, most)
    for name in ("strain", "stress"):
        _check(found, name, [frames, nodes, 6])
    return Tensors(**found)


def _check(arrays: dict[str, Any], name: str, shape: list[int], most: int = 0) -> None:
    """Refuse an array of another shape (-1 for any length) or type, or with numbers that are not
    finite or, of indices, not below `most`.
    """
    array = arrays[name]
    fits = len(array.shape) == len(shape) and all(
        b in (a, -1) for a, b in zip(array.shape, shape, strict=True)
    )
    if not fits or array.dtype.kind not in ("iu" if most else "fiu"):
        raise ValueError(f"'{name}' is of shape {array.shape} and type {array.dtype}")
    if most and array.size and not 0 <= array.min() <= array.max() < most:
        raise ValueError(f"'{name}' has numbers beyond {most}")
    if not np.isfinite(array).all():
        raise ValueError(f"'{name}' is not finite")


def _upper(facets: Ints) -> tuple[Ints, Ints]:
    """Points (s,) of six-node facets and the flat triangles (k, 3), four a facet, of these."""
    surface, local = np.unique(facets, return_inverse=True)
    return surface, split(local.reshape(facets.shape))


def split(facets: Ints) -> Ints:
    """Six-node facets (k, 6) as flat triangles (4 k, 3)."""
    return facets[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]].reshape(-1, 3)


def _grid(reach: Floats, side: int) -> tuple[Floats, Ints]:
    """A flat rectangle of points (side^2, 3) and triangles (k, 3)."""
    x, y = (np.linspace(-r, r, side) for r in reach)
    X, Y = np.meshgrid(x, y, indexing="ij")
    a = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    b = a + side
    triangles = np.vstack([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])
    return np.column_stack([X.ravel(), Y.ravel(), np.zeros(X.size)]), triangles
