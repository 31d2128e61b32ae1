"""Maps: RMS of the steady vibration over a surface, of the point kernel or of a body.

A body's map is computed by its wavenumber integral, by the modes of a thin plate, or by its
reduced-order finite-element model.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import fem
from fem.load_and_probe import on_surface, surface_frame
from meshes import reading
from simple_model import MovingPressure, Response, Statement, sensation_level
from simple_model.layers.flat_body import field_lines, steady_lines
from simple_model.load.spectrum import load_lines, pressure_lines, synthesise
from simple_model.quantities import DISPLACEMENT, PRESSURE, Quantity
from skinwave.bodies.analytic import compliance, has_exact_waves, is_laterally_infinite
from skinwave.bodies.sizes import default_size, map_size
from skinwave.models import named
from skinwave.models.flat_body import field_read
from skinwave.models.limits import takes
from skinwave.models.meshed import line_factor, probe_rows
from skinwave.models.options import DEFAULT, SolveOptions
from skinwave.models.plate_modes import FROM_REST, sheet_motion
from skinwave.models.plate_modes import steady_lines as plate_lines
from skinwave.models.reduced import read_at
from skinwave.planning.deflection import stretches
from skinwave.planning.errors import own_parts
from skinwave.results.comparison import steady_lines as fitted_lines
from skinwave.results.motion import REDUCTION_TOLERANCE, BodyMotion, reduced_motion, reduced_motions
from skinwave.scene.scene import Reading, Scene
from skinwave.typing import Floats

OPTIONAL = ("level", "height")  # arrays that some maps have

Lines = tuple[Floats, fem.Complex]  # frequencies (f,) in Hz, complex amplitudes (f, p)
LinesAt = Callable[[Floats], Lines]  # places (p, 2) in m -> their lines


@dataclass(frozen=True, kw_only=True)
class MapSettings:
    """Extent and accuracy of maps."""

    reach: float = 0.044  # m, half side of a map
    step: float = 0.001  # m, spacing of its places
    tolerance: float = 0.1  # relative error of the reduced-order model
    weakest_line: float = 1e-4  # over the load's strongest: weaker lines do not show
    lowest_level: float = -200.0  # dB, finite so that levels can be interpolated


MAP = MapSettings()


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceField:
    """RMS of a quantity about its mean in the steady state, on a grid of places.

    Parameters
    ----------
    x, y : (nx,), (ny,) float, m, equally spaced
    rms : (ny, nx) float, in the SI unit of the quantity; nan off the body
    quantity : Quantity; the pressure for the point kernel
    level : (ny, nx) float, dB, highest sensation level of a component while a pulse is on, nan off
        the body; None unless the map shows the displacement of skin
    depth : float, m, below the surface
    note : str, method of computation
    error : float, expected error relative to the largest RMS, or nan
    height : (ny, nx) float, m, of the surface above the plane of the focus, nan off the body; None
        if it is flat
    """

    x: Floats
    y: Floats
    rms: Floats
    quantity: Quantity = DISPLACEMENT
    level: Floats | None = None
    depth: float = 0.0
    note: str = ""
    error: float = np.nan
    height: Floats | None = None

    @property
    def places(self) -> Floats:
        """Places (ny, nx, 2) in m."""
        return np.stack(np.meshgrid(self.x, self.y), axis=-1)

    @property
    def unit_rms(self) -> Floats:
        """RMS (ny, nx) in the unit of figures."""
        return self.quantity.per_unit * self.rms


def grid(scene: Scene, reach: float = MAP.reach, step: float = MAP.step) -> tuple[Floats, Floats]:
    """Return coordinates (nx,) and (ny,) in m of a map about the origin, within the body."""
    body = scene.body
    sides = (body.width, body.height) if body.of_kind.is_bounded else (np.inf, np.inf)
    counts = [int(min(reach, side / 2) / step * (1 + 1e-9)) for side in sides]
    x, y = (np.asarray(step * np.arange(-n, n + 1), np.float64) for n in counts)
    return x, y


def has_wavenumber_integral(scene: Scene) -> bool:
    """Whether a map is computed by a wavenumber integral, without reflections from the sides."""
    plain = scene.pressure.profile == "gaussian" and scene.tacton.trajectory.shape != "recorded"
    plain = plain and scene.load.is_plain
    return plain and is_laterally_infinite(scene.body) and has_exact_waves(scene.body)


def surface_lines(scene: Scene) -> LinesAt:
    """Return the function that computes lines of a thin plate, or of a laterally infinite body."""
    if scene.reading.is_plain and takes(FROM_REST, scene):
        return partial(plate_lines, scene)
    body = compliance(scene.body)
    return partial(steady_lines, body, scene.pressure, threshold=MAP.weakest_line)


def kernel_map(pressure: MovingPressure, x: Floats, y: Floats) -> SurfaceField:
    """Return the map of the point kernel's pressure at x (nx,) and y (ny,) in m."""
    lines_at = partial(pressure_lines, pressure, threshold=MAP.weakest_line)
    rms = _rms(PRESSURE, _interpolate(pressure, lines_at, x, y), len(x) * len(y))
    return SurfaceField(x=x, y=y, rms=rms.reshape(len(y), len(x)), quantity=PRESSURE)


def body_map(scene: Scene, x: Floats, y: Floats, options: SolveOptions = DEFAULT) -> SurfaceField:
    """Return the map of a body's displacement at x (nx,) and y (ny,) in m, with sensation levels.

    Elements are larger than those of `simulate`, or have the size in the options if that is larger.
    A sheet is linear if the model in the options is. Raises a ValueError if the body is missing or
    cannot be meshed.
    """
    if options.h is None and takes(FROM_REST, scene):
        return _plate_map(scene, x, y, options)
    if has_wavenumber_integral(scene):
        return _field(
            scene, x, y, lambda each: _interpolate(each.pressure, surface_lines(each), x, y),
            "laterally infinite layer",
        )  # fmt: skip
    return element_map(scene, next(map_motions([scene], options))[1], x, y)


def map_motions(
    scenes: Sequence[Scene], options: SolveOptions
) -> Iterator[tuple[Scene, BodyMotion]]:
    """Yield scenes that differ in their pressure only, each with the motion of its body for a map.

    Elements are larger than those of `simulate`, or have the size in the options if that is larger.
    """
    body = scenes[0].body
    size = max(options.h or 0.0, map_size(body))
    return reduced_motions(
        scenes, replace(options, tolerance=MAP.tolerance, h=size), is_steady=True
    )


def _plate_map(scene: Scene, x: Floats, y: Floats, options: SolveOptions) -> SurfaceField:
    """Return the map of a thin plate from its modes, linear if the model is or if that suffices."""
    places, model = _places(x, y), options.model
    is_given = model != "auto"
    is_large = named(model).is_nonlinear if is_given else bool(stretches(scene, MAP.tolerance))
    if not is_large:
        return _field(scene, x, y, partial(plate_lines, places=places), "thin plate")
    lines, note = stretching_lines(scene, options.tolerance)
    return _field(scene, x, y, lambda _: lines(places), note)


def stretching_lines(scene: Scene, tolerance: float) -> tuple[LinesAt, str]:
    """Return the function that computes lines of a sheet at large deflection, and what they are.

    Without a steady vibration within the Tacton, they are those of its whole motion from rest.
    """
    times, z, shapes = sheet_motion(scene, tolerance)
    coordinates = Response(model="", times=times, probes=np.zeros((z.shape[1], 2)), values=z)
    found, note = fitted_lines(coordinates, scene.pressure), "stretching plate"
    if found is None:
        a = 2 * np.fft.rfft(z, axis=0)[1:] / len(z)
        size = np.linalg.norm(a, axis=1)
        shown = size > MAP.weakest_line * size.max(initial=0.0)
        found = (1 + np.flatnonzero(shown)) / (len(z) * times[1]), a[shown]
        note += " from rest, with free vibration"
    f, amplitudes = found
    return lambda places: (f, amplitudes @ shapes(places).T), note


def quantity_map(
    scene: Scene, options: SolveOptions = DEFAULT, *, reach: float, step: float
) -> SurfaceField:
    """Return the map of the probes' quantity, at the depth of the first probe.

    Parameters
    ----------
    scene : Scene
    options : SolveOptions
    reach, step : float, m, half side of the map (at most to the edges), and spacing of places

    Raises
    ------
    ValueError
        If there is no body, there are too many places, or the quantity cannot be read at this
        depth.
    """
    if not scene.body.of_kind.discretise:
        raise ValueError("a map needs a body, and the scene has none. Give one under [body]")
    if not (0 < step <= reach and (2 * reach / step + 1) ** 2 <= 40_000):
        raise ValueError(
            f"a map with reach {1e3 * reach:g} mm and step {1e3 * step:g} mm has no place, or more "
            "than 40,000. Choose another step"
        )
    x, y = grid(scene, reach, step)
    if has_wavenumber_integral(scene):
        field = partial(field_lines, field_read(scene, scene.depths[0]))
        return _field(
            scene, x, y,
            lambda each: field(each.pressure, _places(x, y), threshold=MAP.weakest_line),
            "wavenumber integral of the laterally infinite body",
        )  # fmt: skip
    if options.h is None and scene.reading.is_plain and takes(FROM_REST, scene):
        error = Statement(parts=own_parts(FROM_REST, scene)).error
        return replace(_plate_map(scene, x, y, options), error=error)
    if scene.load.support_motion or (scene.load.gravity and scene.reading.record.invariant):
        raise ValueError(
            "a map shows motion about the rest without gravity, on a support at rest. Remove "
            "gravity and support_motion from the scene"
        )
    size = options.h or default_size(scene.body)
    solving = replace(options, tolerance=REDUCTION_TOLERANCE)
    # Element size of the second map over that of the first, and order of convergence, for
    # Richardson extrapolation.
    second_size, order = 1.5, 2
    fine, coarse = (
        element_map(scene, reduced_motion(scene, replace(solving, h=h)), x, y)
        for h in (size, second_size * size)
    )
    difference = np.nanmax(np.abs(coarse.rms - fine.rms)) / (second_size**order - 1)
    note = f"finite elements of {1e3 * size:.2g} mm"
    return replace(fine, note=note, error=float(difference / np.nanmax(fine.rms)))


def element_map(scene: Scene, moved: BodyMotion, x: Floats, y: Floats) -> SurfaceField:
    """Return the map of the probes' quantity from the motion of a meshed body."""
    quantity, depth, mesh = scene.reading.record, scene.depths[0], moved.build.mesh
    places = _places(x, y)
    on_body, height = on_surface(mesh, places), np.full(len(places), np.nan)
    patch = scene.body.of_kind.normal_patch
    points, normals = surface_frame(mesh, places[on_body], patch=patch)
    height[on_body] = points[:, 2]
    if depth:  # only where the body is that deep along its normal
        on_body[on_body] = fem.is_inside(mesh, points - depth * normals)
    there = Reading(quantity=quantity.name, depths=(depth,) * int(on_body.sum()) if depth else ())
    rows, solids = probe_rows(scene.body, moved.build, places[on_body], there)
    outputs = rows @ moved.basis

    def lines_of(which: Scene) -> Lines:
        motion = read_at(moved.motion if which is scene else moved.in_pulses, outputs)
        factor = line_factor(quantity, 2j * np.pi * motion.frequencies, solids, rows.shape[0])
        return motion.frequencies, motion.lines * factor

    note = f"elements of {1e3 * moved.effort.h:.2g} mm"
    field = _field(scene, x, y, lines_of, note, on_body)
    flatness = 1e-6  # m: a surface whose heights differ by less is flat
    is_flat = not len(points) or np.ptp(points[:, 2]) <= flatness
    return field if is_flat else replace(field, height=height.reshape(field.rms.shape))


def save(path: Path, field: SurfaceField) -> None:
    """Write a map to an npz file."""
    arrays = {"x": field.x, "y": field.y, "rms": field.rms, "depth": np.array(field.depth),
              "note": np.array(field.note)}  # fmt: skip
    arrays |= {name: own for name in OPTIONAL if (own := getattr(field, name)) is not None}
    np.savez(path, **arrays)  # type: ignore[arg-type]


def load(path: Path, scene: Scene) -> SurfaceField:
    """Read a map of the probes' quantity from an npz file; raises a ValueError if it is none."""
    try:
        arrays = reading.load_arrays(path)
        names = [name for name in ("x", "y", "rms", *OPTIONAL) if name in arrays]
        values: dict[str, Any] = {n: np.asarray(arrays[n], np.float64) for n in names}
        x, y, rms = (values[name] for name in ("x", "y", "rms"))
        shapes = {values.get(name, rms).shape for name in ("rms", *OPTIONAL)}
        if x.ndim != 1 or shapes != {(*y.shape, *x.shape)} or not np.isfinite(rms).any():
            raise ValueError(f"'rms' has the shape {rms.shape}, or none of its values is finite")
        depth, note = float(arrays["depth"]), str(arrays["note"])
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(
            f"{path} is not a map written by skinwave ({error}). Compute it again from its scene"
        ) from None
    return SurfaceField(**values, depth=depth, note=note, quantity=scene.reading.record)


def _places(x: Floats, y: Floats) -> Floats:
    """Return the places (ny nx, 2) of a grid."""
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _field(
    scene: Scene, x: Floats, y: Floats, lines_of: Callable[[Scene], Lines], note: str,
    on_body: np.ndarray | None = None,
) -> SurfaceField:  # fmt: skip
    """Return the map from lines (f,), (f, p c) of a scene at all places, or at those `on_body` (ny
    nx,), with levels of the lines while a pulse is on.
    """
    lines = lines_of(scene)
    quantity = scene.reading.record
    where = np.ones(len(x) * len(y), bool) if on_body is None else on_body
    count, has_level = int(where.sum()), scene.reading.is_plain and scene.body.is_skin
    values = np.full((2, len(where)), np.nan)
    values[0, where] = _rms(quantity, lines, count)
    if has_level:
        steady = scene.during_pulses
        f, felt = lines if steady is scene else lines_of(steady)
        moving = f > 0
        amplitudes = np.abs(felt[moving]).reshape(int(moving.sum()), count)
        levels = sensation_level(amplitudes, f[moving, None])
        values[1, where] = np.maximum(levels.max(axis=0, initial=-np.inf), MAP.lowest_level)
    rms, level = values.reshape(2, len(y), len(x))
    return SurfaceField(
        x=x, y=y, rms=rms, level=level if has_level else None, quantity=quantity,
        depth=scene.depths[0], note=note,
    )  # fmt: skip


def _interpolate(pressure: MovingPressure, lines_at: LinesAt, x: Floats, y: Floats) -> Lines:
    """Return the lines on a grid. For an axisymmetric load they are interpolated along a radius;
    only their amplitudes are then valid.
    """
    places = _places(x, y)
    if not _is_axisymmetric(pressure):
        return lines_at(places)
    from scipy.interpolate import CubicSpline  # slow to import

    radius = np.hypot(*places.T)
    radial_step = 0.5e-3  # m between the radii from which an axisymmetric map is interpolated
    radii = np.arange(0, radius.max() + 2 * radial_step, radial_step)
    frequencies, along = lines_at(np.column_stack([radii, 0 * radii]))
    return frequencies, CubicSpline(radii, np.abs(along), axis=1)(radius)


def _is_axisymmetric(pressure: MovingPressure) -> bool:
    """Whether each line is axisymmetric: one harmonic of a circle, or a focus at the origin."""
    path = pressure.tacton.trajectory
    if path.shape not in ("point", "circle") or any(path.centre):
        return False
    lines = load_lines(pressure, MAP.weakest_line)
    pairs = {(round(f, 6), n) for f, n in zip(lines.frequencies, lines.harmonics, strict=True)}
    return len(pairs) == len({f for f, _ in pairs})


def _rms(quantity: Quantity, lines: Lines, places: int) -> Floats:
    """Return the RMS (p,) about the mean from lines (f,), (f, p c) of a quantity's components."""
    f, components = lines[0], int(np.prod(lines[1].shape[1:])) // max(places, 1)
    a = lines[1].reshape(len(f), places, components)
    if quantity.invariant is None:
        return np.asarray(np.sqrt((np.abs(a[f > 0, :, 0]) ** 2).sum(axis=0) / 2))
    return np.concatenate([*_invariant_rms(quantity, f, a)])


def _invariant_rms(quantity: Quantity, f: Floats, a: fem.Complex) -> Iterator[Floats]:
    """Yield the RMS (q,) of an invariant of components (f, p, c), a few places at a time."""
    # Times at which an invariant is evaluated: their step in s is not a multiple of any period. A
    # smooth window over them gives the mean over all phases of several frequencies: Das, Saiki,
    # Sander and Yorke, Nonlinearity 30:4111 (2017).
    many_times, time_step = 1024, 0.01 * (1 + 5**0.5) / 2
    times = time_step * np.arange(1.0, many_times)
    window = np.sin(np.pi * np.arange(1, many_times) / many_times) ** 4
    window /= window.sum()
    most_at_once = 2_000_000  # values in time that are held in memory
    many = max(1, most_at_once // (len(times) * a.shape[2]))
    for start in range(0, a.shape[1], many):
        part = a[:, start : start + many]
        values = quantity.waveforms(synthesise(f, part.reshape(len(f), -1), times), part.shape[1])
        yield np.sqrt(window @ (values - window @ values) ** 2)
