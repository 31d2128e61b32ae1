"""Steady vibration over a surface: RMS of a quantity on a grid, of the point kernel or of a body.

A body's map is by its wavenumber integral where it has one, by the modes of a thin plate, or by its
reduced-order model of finite elements.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import fem
from fem.load_and_probe import on_surface, surface_frame
from meshes import reading
from simple_model import MovingPressure, sensation_level
from simple_model.layers.flat_body import field_lines, steady_lines
from simple_model.load.spectrum import load_lines, pressure_lines, synthesise
from simple_model.quantities import DISPLACEMENT, PRESSURE, Quantity
from skinwave.bodies.analytic import compliance, has_exact_waves, is_laterally_infinite
from skinwave.bodies.sizes import default_size
from skinwave.models.flat_body import field_read
from skinwave.models.limits import takes
from skinwave.models.meshed import line_factor, probe_rows
from skinwave.models.plate_modes import ERROR as PLATE_ERROR
from skinwave.models.plate_modes import FROM_REST, settled
from skinwave.models.plate_modes import steady_lines as plate_lines
from skinwave.models.reduced import read_at
from skinwave.planning.left_out import beyond_linear
from skinwave.results.motion import TOLERANCE, BodyMotion, driven
from skinwave.scene.scene import Reading, Scene
from skinwave.system.effort import Progress
from skinwave.typing import Floats

REACH, STEP = 0.044, 0.001  # m of a map either way from the middle, and between its places
FAINT = 1e-4  # of the load's strongest line: lines that no map shows
SILENT = -200.0  # dB, finite so that it can be interpolated
RADIAL = 0.5e-3  # m between the radii that stand for a map where it is a figure of revolution
# Than the default element size, of solids and sheets: a map is not looked at as closely as a probe.
COARSER = (1.5, 2.0)
REDUCED = 0.1  # relative error of the reduced-order model of a map
SECOND, ORDER = 1.5, 2  # element size of a second map, and its order: Richardson extrapolation
# Times at which an invariant is looked at, in steps of s that are no multiple of any period. Its
# mean over all phases of a load of several frequencies is that of a smooth window over them: Das,
# Saiki, Sander and Yorke, Nonlinearity 30:4111 (2017).
MANY, BETWEEN = 1024, 0.01 * (1 + 5**0.5) / 2
STILL = 1e-9  # Hz: a line below it is the mean
AT_ONCE = 2_000_000  # values in time of places that are looked at together
MOST_PLACES = 40_000

Lines = tuple[Floats, fem.Complex]  # frequencies (f,) in Hz, complex amplitudes (f, p)


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceField:
    """Steady vibration of a quantity about its mean, on a grid of places.

    Parameters
    ----------
    x, y : (nx,), (ny,) float, metre, equally spaced
    rms : (ny, nx) float, in the SI unit of the quantity; nan off the body
    quantity : Quantity; of the point kernel the pressure
    level : (ny, nx) float, dB, sensation level of the component where it is highest; nan off the
        body; None of anything but the displacement of the surface of skin
    depth : metre, below the surface
    note : str, how it was computed
    error : expected error relative to the largest, nan where it is not estimated
    """

    x: Floats
    y: Floats
    rms: Floats
    quantity: Quantity = DISPLACEMENT
    level: Floats | None = None
    depth: float = 0.0
    note: str = ""
    error: float = np.nan

    @property
    def places(self) -> Floats:
        """Positions (ny, nx, 2) in metre."""
        return np.stack(np.meshgrid(self.x, self.y), axis=-1)

    @property
    def shown(self) -> Floats:
        """RMS (ny, nx) in the unit of figures."""
        return self.quantity.per_unit * self.rms


def grid(scene: Scene, reach: float = REACH, step: float = STEP) -> tuple[Floats, Floats]:
    """Coordinates (nx,) and (ny,) in metre of a map about the origin, within the scene's body."""
    flat = scene.body.of_kind.is_bounded
    sides = (scene.body.width, scene.body.height) if flat else (np.inf, np.inf)
    counts = [int(min(reach, side / 2) / step * (1 + 1e-9)) for side in sides]
    x, y = (np.asarray(step * np.arange(-n, n + 1), np.float64) for n in counts)
    return x, y


def has_wavenumber_integral(scene: Scene) -> bool:
    """Whether a wavenumber integral stands for the scene, whose sides then reflect nothing."""
    plain = scene.pressure.profile == "gaussian" and scene.tacton.trajectory.shape != "recorded"
    plain = plain and scene.load.is_plain
    return plain and is_laterally_infinite(scene.body) and has_exact_waves(scene.body)


def kernel_map(pressure: MovingPressure, x: Floats, y: Floats) -> SurfaceField:
    """The point kernel's pressure at places x (nx,) and y (ny,) in metre."""
    lines = _round_lines(pressure, partial(pressure_lines, pressure, threshold=FAINT), x, y)
    rms = _rms(PRESSURE, lines, len(x) * len(y)).reshape(len(y), len(x))
    return SurfaceField(x=x, y=y, rms=rms, quantity=PRESSURE)


def body_map(
    scene: Scene, x: Floats, y: Floats, progress: Progress | None = None, *,
    h: float | None = None, solver: str = "auto",
) -> SurfaceField:  # fmt: skip
    """Displacement of a body's surface at places x (nx,) and y (ny,) in metre, with sensation
    levels.

    Elements are coarser than those of `simulate`, unless their size h in metre is given and larger;
    a ValueError if there is no body, or none that can be meshed.
    """
    if h is None and takes(FROM_REST, scene):
        return _plate_map(scene, x, y)
    if not has_wavenumber_integral(scene):
        size = max(h or 0.0, COARSER[scene.body.of_kind.is_plate] * default_size(scene.body))
        moved = driven(scene, REDUCED, progress, h=size, solver=solver)
        return replace(element_map(scene, moved, x, y), note=f"elements of {1e3 * size:.2g} mm")
    lines_at = partial(steady_lines, compliance(scene.body), scene.pressure, threshold=FAINT)
    lines = _round_lines(scene.pressure, lines_at, x, y)
    return _of_lines(scene, x, y, lines, "laterally infinite layer")


def _plate_map(scene: Scene, x: Floats, y: Floats) -> SurfaceField:
    """Map of a thin plate in its modes."""
    places = _places(x, y)
    if not beyond_linear(scene, REDUCED):
        return _of_lines(scene, x, y, plate_lines(scene, places), "thin plate")
    _, z, modes = settled(scene, REDUCED)
    shapes, spread = modes.at(places - scene.body.placement.offset), np.cov(z, rowvar=False)
    rms = np.sqrt(np.einsum("pi,ij,pj->p", shapes, spread, shapes, optimize=True))
    return SurfaceField(x=x, y=y, rms=rms.reshape(len(y), len(x)), note="stretching plate")


def quantity_map(
    scene: Scene, progress: Progress | None = None, *, reach: float, step: float,
    h: float | None = None, solver: str = "auto",
) -> SurfaceField:  # fmt: skip
    """Map of the quantity that a scene's probes read, at the depth of the first of them.

    Parameters
    ----------
    scene : Scene
    progress, h, solver : as for `simulate`
    reach, step : metre either way from the middle, at most to the edges, and between places

    Raises
    ------
    ValueError
        If there is no body or too many places, or the quantity cannot be read there.
    """
    if not scene.body.of_kind.discretise:
        raise ValueError("a map is of a body, and the scene has none; give it one under [body]")
    if not (0 < step <= reach and (2 * reach / step + 1) ** 2 <= MOST_PLACES):
        raise ValueError(
            f"a map of {1e3 * reach:g} mm either way in steps of {1e3 * step:g} mm has no places "
            f"or more than {MOST_PLACES:,}; choose another step"
        )
    x, y = grid(scene, reach, step)
    if has_wavenumber_integral(scene):
        field = field_read(scene, scene.depths[0])
        lines = field_lines(field, scene.pressure, _places(x, y), threshold=FAINT)
        note = "wavenumber integral of the laterally infinite body"
        return _of_lines(scene, x, y, lines, note)
    if h is None and scene.reading.is_plain and takes(FROM_REST, scene):
        return replace(_plate_map(scene, x, y), error=PLATE_ERROR)
    if scene.load.support_motion or (scene.load.gravity and scene.reading.record.invariant):
        raise ValueError(
            "a map is of motion about the rest without gravity, on a support at rest; leave "
            "gravity and support_motion out"
        )
    size = h or default_size(scene.body)
    fine, coarse = (
        element_map(scene, driven(scene, TOLERANCE, progress, h=each, solver=solver), x, y)
        for each in (size, SECOND * size)
    )
    away = np.nanmax(np.abs(coarse.rms - fine.rms)) / (SECOND**ORDER - 1)
    note = f"finite elements of {1e3 * size:.2g} mm"
    return replace(fine, note=note, error=float(away / np.nanmax(fine.rms)))


def element_map(scene: Scene, moved: BodyMotion, x: Floats, y: Floats) -> SurfaceField:
    """Map of the quantity that probes read, of a meshed body whose motion is known."""
    asked, depth, mesh = scene.reading.record, scene.depths[0], moved.build.mesh
    places = _places(x, y)
    seen = on_surface(mesh, places)
    if depth:  # where the body is as deep along its normal
        patch = scene.body.of_kind.normal_patch
        points, normals = surface_frame(mesh, places[seen], patch=patch)
        seen[seen] = fem.is_inside(mesh, points - depth * normals)
    there = Reading(quantity=asked.name, depths=(depth,) * int(seen.sum()) if depth else ())
    rows, solids = probe_rows(scene.body, moved.build, places[seen], there)
    motion = read_at(moved.motion, rows @ moved.basis)
    factor = line_factor(asked, 2j * np.pi * motion.frequencies, solids, rows.shape[0])
    lines = motion.frequencies, motion.lines * factor
    return _of_lines(scene, x, y, lines, "finite elements", seen)


def save(path: Path, found: SurfaceField) -> None:
    """A map as one npz file."""
    arrays = {"x": found.x, "y": found.y, "rms": found.rms, "depth": np.array(found.depth),
              "note": np.array(found.note)}  # fmt: skip
    if found.level is not None:
        arrays["level"] = found.level
    np.savez(path, **arrays)  # type: ignore[arg-type]


def load(path: Path, scene: Scene) -> SurfaceField:
    """A map of the quantity that a scene's probes read, from its file.

    Raises
    ------
    ValueError
        If the file is none of these.
    """
    try:
        arrays = reading.load_arrays(path)
        names = [name for name in ("x", "y", "rms", "level") if name in arrays]
        values: dict[str, Any] = {n: np.asarray(arrays[n], np.float64) for n in names}
        x, y, rms = (values[name] for name in ("x", "y", "rms"))
        shapes = {values.get("level", rms).shape, rms.shape}
        if x.ndim != 1 or shapes != {(*y.shape, *x.shape)} or not np.isfinite(rms).any():
            raise ValueError(f"'rms' is of shape {rms.shape}, or nowhere a number")
        depth, note = float(arrays["depth"]), str(arrays["note"])
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is no map ({error}); make it anew from its scene") from None
    return SurfaceField(**values, depth=depth, note=note, quantity=scene.reading.record)


def _places(x: Floats, y: Floats) -> Floats:
    """Places (ny nx, 2) of a grid."""
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _of_lines(
    scene: Scene, x: Floats, y: Floats, lines: Lines, note: str,
    seen: np.ndarray | None = None,
) -> SurfaceField:  # fmt: skip
    """Map from lines (f,), (f, p c) of the components of the quantity that probes read, at all
    places or at those `seen` (ny nx,).
    """
    asked, where = scene.reading.record, np.ones(len(x) * len(y), bool) if seen is None else seen
    found = np.full((2, len(where)), np.nan)
    found[0, where] = _rms(asked, lines, int(where.sum()))
    felt = scene.reading.is_plain and scene.body.is_skin
    if felt:
        moving = lines[0] > STILL
        amplitudes = np.abs(lines[1][moving]).reshape(int(moving.sum()), int(where.sum()))
        levels = sensation_level(amplitudes, lines[0][moving, None])
        found[1, where] = np.maximum(levels.max(axis=0, initial=-np.inf), SILENT)
    rms, level = found.reshape(2, len(y), len(x))
    return SurfaceField(
        x=x, y=y, rms=rms, level=level if felt else None, quantity=asked, depth=scene.depths[0],
        note=note,
    )  # fmt: skip


def _round_lines(
    pressure: MovingPressure, lines_at: Callable[[Floats], Lines], x: Floats, y: Floats
) -> Lines:
    """Lines on a grid, from a function of places (p, 2); of a load that is round those of a radius,
    of which only the amplitudes are right.
    """
    places = _places(x, y)
    if not _is_round(pressure):
        return lines_at(places)
    from scipy.interpolate import CubicSpline  # which takes long to import

    radius = np.hypot(*places.T)
    radii = np.arange(0, radius.max() + 2 * RADIAL, RADIAL)
    frequencies, along = lines_at(np.column_stack([radii, 0 * radii]))
    return frequencies, CubicSpline(radii, np.abs(along), axis=1)(radius)


def _is_round(pressure: MovingPressure) -> bool:
    """Whether each line is as strong all around the origin: one harmonic of a circle, or a focus at
    rest there.
    """
    path = pressure.tacton.trajectory
    if path.shape not in ("point", "circle") or any(path.centre):
        return False
    lines = load_lines(pressure, FAINT)
    pairs = {(round(f, 6), n) for f, n in zip(lines.frequencies, lines.harmonics, strict=True)}
    return len(pairs) == len({f for f, _ in pairs})


def _rms(asked: Quantity, lines: Lines, places: int) -> Floats:
    """RMS (p,) about the mean of lines (f,), (f, p c) of the components of a quantity."""
    f, components = lines[0], int(np.prod(lines[1].shape[1:])) // max(places, 1)
    a = lines[1].reshape(len(f), places, components)
    if asked.invariant is None:
        return np.asarray(np.sqrt((np.abs(a[f > STILL, :, 0]) ** 2).sum(axis=0) / 2))
    return np.concatenate([*_parts(asked, f, a)])  # of the whole tensor, its mean included


def _parts(asked: Quantity, f: Floats, a: fem.Complex) -> Iterator[Floats]:
    """RMS (q,) of some places after the other, of an invariant of components (f, p, c) in time."""
    times = BETWEEN * np.arange(1.0, MANY)
    window = np.sin(np.pi * np.arange(1, MANY) / MANY) ** 4
    window /= window.sum()
    many = max(1, AT_ONCE // (len(times) * a.shape[2]))
    for start in range(0, a.shape[1], many):
        part = a[:, start : start + many]
        here = asked.waveforms(synthesise(f, part.reshape(len(f), -1), times), part.shape[1])
        yield np.sqrt(window @ (here - window @ here) ** 2)
