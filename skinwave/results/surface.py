"""Steady vibration of a whole surface, line by line: the point kernel's pressure and a body's
motion under the same load, on one grid.

A body's motion is its wavenumber integral where it has one, else that of its reduced-order model.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import fem
from meshes import reading
from meshes.tetmesh import Floats
from simple_model import MovingPressure, sensation_level
from simple_model.layers.flat_body import steady_lines
from simple_model.load.spectrum import load_lines, pressure_lines
from skinwave.bodies.analytic import compliance, has_exact_waves, is_laterally_infinite
from skinwave.bodies.sizes import default_size
from skinwave.models.advice import takes
from skinwave.models.loads import surface_motion
from skinwave.models.plate_modes import FROM_REST
from skinwave.models.plate_modes import steady_lines as plate_lines
from skinwave.models.stretched_plate import settled
from skinwave.planning.stretching import beyond_linear
from skinwave.results.motion import DrivenBody, driven, line_amplitudes
from skinwave.scene.scene import Scene
from skinwave.system.effort import Progress

REACH, STEP = 0.044, 0.001  # m of a map either way from the middle, and between its places
FAINT = 1e-4  # of the load's strongest line: lines that no map shows
SILENT = -200.0  # dB, finite so that it can be interpolated
RADIAL = 0.5e-3  # m between the radii that stand for a map where it is a figure of revolution
# Than the default element size, of solids and sheets: a map is not looked at as closely as a probe.
COARSER = (1.5, 2.0)
REDUCED = 0.1  # relative error of the reduced-order model of a map

Lines = tuple[Floats, fem.Complex]  # frequencies (f,) in Hz, complex amplitudes (f, p)


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceMap:
    """Steady vibration of a surface about its mean, on a grid.

    Parameters
    ----------
    x, y : (nx,), (ny,) float, metre, equally spaced
    rms : (ny, nx) float, in `unit`, "m" or "Pa"; nan off the body
    level : (ny, nx) float, dB, the sensation level of the component where it is highest,
        were the body skin; nan off the body, minus infinity of a pressure, and of a
        sheet that stretches
    note : str, how it was computed, if another way than the probes
    """

    x: Floats
    y: Floats
    rms: Floats
    level: Floats
    unit: str
    note: str = ""

    @property
    def places(self) -> Floats:
        """Positions (ny, nx, 2) in metre."""
        return np.stack(np.meshgrid(self.x, self.y), axis=-1)


def grid(scene: Scene, reach: float = REACH, step: float = STEP) -> tuple[Floats, Floats]:
    """Coordinates (nx,) and (ny,) in metre of a map about the origin, within the scene's body."""
    flat = scene.body.of_kind.is_bounded
    sides = (scene.body.width, scene.body.height) if flat else (np.inf, np.inf)
    counts = [int(min(reach, side / 2) / step * (1 + 1e-9)) for side in sides]
    x, y = (np.asarray(step * np.arange(-n, n + 1), np.float64) for n in counts)
    return x, y


def kernel_map(pressure: MovingPressure, x: Floats, y: Floats) -> SurfaceMap:
    """The pressure itself, in Pa, at places x (nx,) and y (ny,) in metre."""

    def answer(places: Floats) -> Lines:
        return pressure_lines(pressure, places, FAINT)

    return _mapped(pressure, answer, x, y, "Pa")


def body_map(
    scene: Scene,
    x: Floats,
    y: Floats,
    progress: Progress | None = None,
    *,
    h: float | None = None,
    solver: str = "auto",
) -> SurfaceMap:
    """The body's motion, in m; x (nx,) and y (ny,) in metre: by a wavenumber integral, by the modes
    of a thin plate, stretched where it deflects that far, or by finite elements. These are coarser
    than by default, and at least `h` large.

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

    def answer(places: Floats) -> Lines:
        return steady_lines(waves_of, scene.pressure, places, threshold=FAINT)

    found = _mapped(scene.pressure, answer, x, y, "m")
    return replace(found, note="laterally infinite layer")


def _plate_map(scene: Scene, x: Floats, y: Floats) -> SurfaceMap:
    """Map of a thin plate in its modes."""
    places = np.stack(np.meshgrid(x, y), axis=-1)
    flat, shape = places.reshape(-1, 2), places.shape[:2]
    if beyond_linear(scene, REDUCED):
        _, z, modes = settled(scene, REDUCED)
        shapes, spread = modes.at(flat - scene.body.placement.offset), np.cov(z, rowvar=False)
        rms = np.sqrt(np.einsum("pi,ij,pj->p", shapes, spread, shapes, optimize=True))
        level, note = np.full(len(flat), -np.inf), "stretching plate"
    else:
        lines, amplitudes = plate_lines(scene, flat)
        rms, level = _rms_and_level((lines, np.abs(amplitudes)), "m")
        note = "thin plate"
    return SurfaceMap(
        x=x, y=y, rms=rms.reshape(shape), level=level.reshape(shape), unit="m", note=note
    )


def has_wavenumber_integral(scene: Scene) -> bool:
    """Whether a wavenumber integral stands for the scene, whose sides then reflect nothing."""
    plain = scene.pressure.profile == "gaussian" and scene.tacton.trajectory.shape != "recorded"
    plain = plain and scene.load.is_plain
    return plain and is_laterally_infinite(scene.body) and has_exact_waves(scene.body)


def element_map(scene: Scene, moved: DrivenBody, x: Floats, y: Floats) -> SurfaceMap:
    """Map of a meshed body's motion, which is read as probes read it."""
    places = np.stack(np.meshgrid(x, y), axis=-1)
    seen = fem.on_surface(moved.build.mesh, places.reshape(-1, 2)).reshape(places.shape[:2])
    lines = line_amplitudes(moved, surface_motion(scene.body, moved.build, places[seen]))
    found = np.full((2, *seen.shape), np.nan)
    found[:, seen] = _rms_and_level(lines, "m")
    return SurfaceMap(x=x, y=y, rms=found[0], level=found[1], unit="m")


def save(path: Path, found: SurfaceMap) -> None:
    """A map as one npz file."""
    np.savez(path, x=found.x, y=found.y, rms=found.rms, level=found.level)


def load(path: Path) -> SurfaceMap:
    """A map of a body's motion from its file.

    Raises
    ------
    ValueError
        If the file is none of these.
    """
    try:
        arrays = reading.arrays(path)
        x, y, rms, level = (np.asarray(arrays[n], np.float64) for n in ("x", "y", "rms", "level"))
        if x.ndim != 1 or not rms.shape == level.shape == (*y.shape, *x.shape):
            raise ValueError(f"'rms' is of shape {rms.shape}, and 'level' of {level.shape}")
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is no map ({error}); make it anew from its scene") from None
    return SurfaceMap(x=x, y=y, rms=rms, level=level, unit="m")


def _mapped(
    pressure: MovingPressure, answer: Callable[[Floats], Lines], x: Floats, y: Floats, unit: str
) -> SurfaceMap:
    """Map on a grid from a function that returns the lines (f,), (f, p) at places (p, 2)."""
    X, Y = np.meshgrid(x, y)
    radius = np.hypot(X, Y)
    if _is_round(pressure):
        from scipy.interpolate import CubicSpline  # which takes long to import

        radii = np.arange(0, radius.max() + 2 * RADIAL, RADIAL)
        frequencies, along = answer(np.column_stack([radii, 0 * radii]))
        amplitudes = np.abs(CubicSpline(radii, np.abs(along), axis=1)(radius.ravel()))
    else:
        frequencies, found = answer(np.column_stack([X.ravel(), Y.ravel()]))
        amplitudes = np.abs(found)
    rms, level = (
        values.reshape(X.shape) for values in _rms_and_level((frequencies, amplitudes), unit)
    )
    return SurfaceMap(x=x, y=y, rms=rms, level=level, unit=unit)


def _rms_and_level(lines: tuple[Floats, Floats], unit: str) -> tuple[Floats, Floats]:
    """RMS (p,) about the mean and the highest sensation level (p,) in dB of lines of amplitudes
    (f, p).
    """
    moving = lines[0] > 1e-9
    frequencies, amplitudes = (each[moving] for each in lines)
    rms = np.sqrt((amplitudes**2).sum(axis=0) / 2)
    if unit == "Pa":
        return rms, np.full_like(rms, -np.inf)
    levels = sensation_level(amplitudes, frequencies[:, None])
    return rms, np.maximum(levels.max(axis=0, initial=-np.inf), SILENT)


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
