"""Steady vibration over a surface: RMS of a quantity on a grid, of the point kernel or of a body.

A body's map is by its wavenumber integral where it has one, by the modes of a thin plate, or by its
reduced-order model of finite elements.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import fem
from fem.load_and_probe import surface_frame
from meshes import reading
from meshes.tetmesh import Floats
from simple_model import MovingPressure, sensation_level
from simple_model.layers.flat_body import field_lines, steady_lines
from simple_model.load.spectrum import load_lines, pressure_lines, synthesise
from simple_model.quantities import DISPLACEMENT, PRESSURE, Quantity
from skinwave.bodies.analytic import compliance, has_exact_waves, is_laterally_infinite
from skinwave.bodies.sizes import default_size
from skinwave.models.advice import takes
from skinwave.models.flat_body import field_read
from skinwave.models.meshed import line_factor, probe_rows, surface_motion
from skinwave.models.plate_modes import ERROR as PLATE_ERROR
from skinwave.models.plate_modes import FROM_REST
from skinwave.models.plate_modes import steady_lines as plate_lines
from skinwave.models.reduction import read_at
from skinwave.models.stretched_plate import settled
from skinwave.planning.left_out import beyond_linear
from skinwave.results.motion import TOLERANCE, BodyMotion, driven, line_amplitudes
from skinwave.scene.scene import Reading, Scene
from skinwave.system.effort import Progress

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


def kernel_map(pressure: MovingPressure, x: Floats, y: Floats) -> SurfaceField:
    """The point kernel's pressure at places x (nx,) and y (ny,) in metre."""
    amplitudes = _amplitudes(pressure, lambda at: pressure_lines(pressure, at, FAINT), x, y)
    return _field(x, y, _rms_and_level(amplitudes)[0], quantity=PRESSURE)


def body_map(
    scene: Scene,
    x: Floats,
    y: Floats,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    solver: str = "auto",
) -> SurfaceField:
    """Displacement of a body's surface, with sensation levels.

    Parameters
    ----------
    scene : Scene
    x, y : (nx,), (ny,) float, metre
    progress, solver : as for `simulate`
    h : metre, of finite elements; they are coarser than by default

    Returns
    -------
    SurfaceField

    Raises
    ------
    ValueError
        If there is no body, or none that can be meshed.
    """
    if h is None and takes(FROM_REST, scene):
        return _plate_map(scene, x, y)
    if not has_wavenumber_integral(scene):
        size = max(h or 0.0, COARSER[scene.body.of_kind.is_plate] * default_size(scene.body))
        moved = driven(scene, REDUCED, progress, h=size, solver=solver)
        return replace(element_map(scene, moved, x, y), note=f"elements of {1e3 * size:.2g} mm")
    waves_of = compliance(scene.body)

    def lines_at(places: Floats) -> Lines:
        return steady_lines(waves_of, scene.pressure, places, threshold=FAINT)

    rms, level = _rms_and_level(_amplitudes(scene.pressure, lines_at, x, y))
    return _field(x, y, rms, level if scene.body.is_skin else None, note="laterally infinite layer")


def element_map(scene: Scene, moved: BodyMotion, x: Floats, y: Floats) -> SurfaceField:
    """Displacement of a meshed body's surface, which is read as probes read it."""
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    seen = fem.on_surface(moved.build.mesh, places)
    lines = line_amplitudes(moved, surface_motion(scene.body, moved.build, places[seen]))
    found = np.full((2, len(places)), np.nan)
    found[:, seen] = _rms_and_level(lines)
    return _field(x, y, found[0], found[1] if scene.body.is_skin else None)


def _plate_map(scene: Scene, x: Floats, y: Floats) -> SurfaceField:
    """Map of a thin plate in its modes."""
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    if beyond_linear(scene, REDUCED):
        _, z, modes = settled(scene, REDUCED)
        shapes, spread = modes.at(places - scene.body.placement.offset), np.cov(z, rowvar=False)
        rms = np.sqrt(np.einsum("pi,ij,pj->p", shapes, spread, shapes, optimize=True))
        return _field(x, y, rms, note="stretching plate")
    lines, amplitudes = plate_lines(scene, places)
    return _field(x, y, _rms_and_level((lines, np.abs(amplitudes)))[0], note="thin plate")


def has_wavenumber_integral(scene: Scene) -> bool:
    """Whether a wavenumber integral stands for the scene, whose sides then reflect nothing."""
    plain = scene.pressure.profile == "gaussian" and scene.tacton.trajectory.shape != "recorded"
    plain = plain and scene.load.is_plain
    return plain and is_laterally_infinite(scene.body) and has_exact_waves(scene.body)


def quantity_map(
    scene: Scene,
    progress: Progress | None = None,
    *,
    reach: float,
    step: float,
    h: float | None = None,
    solver: str = "auto",
) -> SurfaceField:
    """Map of the quantity that a scene's probes read, at the depth of the first of them.

    Parameters
    ----------
    scene : Scene
    progress, h, solver : as for `simulate`
    reach : metre either way from the middle, at most to the edges of the body
    step : metre between places

    Returns
    -------
    SurfaceField

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
    asked, (x, y) = scene.reading.asked, grid(scene, reach, step)
    if has_wavenumber_integral(scene):
        places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        lines = field_lines(field_read(scene, scene.depths[0]), scene.pressure, places,
                            threshold=FAINT)  # fmt: skip
        note = "wavenumber integral of the laterally infinite body"
        return _of_probes(scene, x, y, _rms(asked, lines, len(places)), note)
    if h is None and scene.reading.is_plain and takes(FROM_REST, scene):
        return replace(body_map(scene, x, y), error=PLATE_ERROR)
    if scene.load.support_motion or (scene.load.gravity and asked.invariant):
        raise ValueError(
            "a map is of motion about the rest without gravity, on a support at rest; leave "
            "gravity and support_motion out"
        )
    size = h or default_size(scene.body)
    fine, coarse = (
        map_of_motion(scene, driven(scene, TOLERANCE, progress, h=each, solver=solver), x, y)
        for each in (size, SECOND * size)
    )
    away = np.nanmax(np.abs(coarse.rms - fine.rms)) / (SECOND**ORDER - 1)
    note = f"finite elements of {1e3 * size:.2g} mm"
    return replace(fine, note=note, error=float(away / np.nanmax(fine.rms)))


def map_of_motion(scene: Scene, moved: BodyMotion, x: Floats, y: Floats) -> SurfaceField:
    """Map of the quantity that probes read, of a meshed body whose motion is known."""
    asked, depth = scene.reading.asked, scene.depths[0]
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    seen = fem.on_surface(moved.build.mesh, places)
    seen[seen] = _is_above(scene, moved, places[seen], depth)
    count = int(seen.sum())
    there = Reading(quantity=asked.name, depths=(depth,) * count if depth else ())
    rows, solids = probe_rows(scene.body, moved.build, places[seen], there)
    motion = read_at(moved.motion, rows @ moved.basis)
    factor = line_factor(asked, 2j * np.pi * motion.frequencies, solids, rows.shape[0])
    rms = np.full(len(places), np.nan)
    rms[seen] = _rms(asked, (motion.frequencies, motion.lines * factor), count)
    return _of_probes(scene, x, y, rms, "finite elements")


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
        arrays = reading.arrays(path)
        x, y, rms = (np.asarray(arrays[name], np.float64) for name in ("x", "y", "rms"))
        level = np.asarray(arrays["level"], np.float64) if "level" in arrays else None
        depth, note = float(arrays["depth"]), str(arrays["note"])
        if x.ndim != 1 or rms.shape != (*y.shape, *x.shape) or not np.isfinite(rms).any():
            raise ValueError(f"'rms' is of shape {rms.shape}, or nowhere a number")
        if level is not None and level.shape != rms.shape:
            raise ValueError(f"'level' is of shape {level.shape}")
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is no map ({error}); make it anew from its scene") from None
    found = SurfaceField(x=x, y=y, rms=rms, level=level, depth=depth, note=note)
    return found if scene.reading.is_plain else replace(found, quantity=scene.reading.asked)


def _field(
    x: Floats, y: Floats, rms: Floats, level: Floats | None = None, *, note: str = "",
    quantity: Quantity = DISPLACEMENT,
) -> SurfaceField:  # fmt: skip
    """A map of values (ny nx,)."""
    shape = len(y), len(x)
    return SurfaceField(
        x=x, y=y, rms=rms.reshape(shape), quantity=quantity, note=note,
        level=None if level is None else level.reshape(shape),
    )  # fmt: skip


def _of_probes(scene: Scene, x: Floats, y: Floats, rms: Floats, note: str) -> SurfaceField:
    found = _field(x, y, rms, note=note, quantity=scene.reading.asked)
    return replace(found, depth=scene.depths[0])


def _amplitudes(
    pressure: MovingPressure, lines_at: Callable[[Floats], Lines], x: Floats, y: Floats
) -> tuple[Floats, Floats]:
    """Frequencies (f,) and amplitudes (f, ny nx) on a grid, from a function of places (p, 2)."""
    X, Y = np.meshgrid(x, y)
    if not _is_round(pressure):
        frequencies, found = lines_at(np.column_stack([X.ravel(), Y.ravel()]))
        return frequencies, np.abs(found)
    from scipy.interpolate import CubicSpline  # which takes long to import

    radius = np.hypot(X, Y).ravel()
    radii = np.arange(0, radius.max() + 2 * RADIAL, RADIAL)
    frequencies, along = lines_at(np.column_stack([radii, 0 * radii]))
    return frequencies, np.abs(CubicSpline(radii, np.abs(along), axis=1)(radius))


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


def _rms_and_level(lines: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """RMS (p,) about the mean and the highest sensation level (p,) in dB of lines of amplitudes
    (f, p).
    """
    moving = lines[0] > STILL
    frequencies, amplitudes = (each[moving] for each in lines)
    rms = np.sqrt((amplitudes**2).sum(axis=0) / 2)
    levels = sensation_level(amplitudes, frequencies[:, None])
    return rms, np.maximum(levels.max(axis=0, initial=-np.inf), SILENT)


def _is_above(scene: Scene, moved: BodyMotion, places: Floats, depth: float) -> NDArray[np.bool_]:
    """Mask of places (p, 2) below which the body has a depth in metre along its normal."""
    if not depth:
        return np.ones(len(places), bool)
    patch = scene.body.of_kind.normal_patch
    points, normals = surface_frame(moved.build.mesh, places, patch=patch)
    return fem.is_inside(moved.build.mesh, points - depth * normals)


def _rms(asked: Quantity, lines: Lines, places: int) -> Floats:
    """RMS (p,) about the mean of lines (f,), (f, p c) of the components of a quantity."""
    f, a = lines[0], lines[1].reshape(len(lines[0]), places, -1)
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
