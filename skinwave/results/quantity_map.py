"""Map of any quantity at any depth: RMS about the mean of its steady state, on a grid of places.

By wavenumber integrals where they stand for the body, else by finite elements.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import fem
from fem.load_and_probe import surface_frame
from meshes import reading
from meshes.tetmesh import Floats
from simple_model.layers.flat_body import field_lines
from simple_model.load.spectrum import synthesise
from simple_model.quantities import Quantity
from skinwave.bodies.sizes import default_size
from skinwave.models.advice import takes
from skinwave.models.flat_body import field_read
from skinwave.models.loads import line_factor, probe_rows
from skinwave.models.plate_modes import ERROR as PLATE_ERROR
from skinwave.models.plate_modes import FROM_REST
from skinwave.models.reduction import read_at
from skinwave.results.motion import TOLERANCE, DrivenBody, driven
from skinwave.results.surface import FAINT, Lines, body_map, grid, has_wavenumber_integral
from skinwave.scene.scene import Reading, Scene
from skinwave.system.effort import Progress

COARSER, ORDER = 1.5, 2  # element size of a second map, and its order: Richardson extrapolation
# Times at which an invariant is looked at, in steps of s that are no multiple of any period. Its
# mean over all phases of a load of several frequencies is that of a smooth window over them: Das,
# Saiki, Sander and Yorke, Nonlinearity 30:4111 (2017).
MANY, BETWEEN = 1024, 0.01 * (1 + 5**0.5) / 2
STILL = 1e-9  # Hz: a line below it is the mean
AT_ONCE = 2_000_000  # values in time of places that are looked at together
MOST_PLACES = 40_000


@dataclass(frozen=True, kw_only=True, eq=False)
class QuantityMap:
    """RMS (ny, nx) of a quantity about its mean at a depth in metre, in its SI unit, at x (nx,) and
    y (ny,) in metre; not a number off the body. `note` is how it was computed, `error` what is
    expected of it over the largest, not a number where it is not estimated.
    """

    x: Floats
    y: Floats
    rms: Floats
    asked: Quantity
    depth: float
    note: str
    error: float = np.nan


def quantity_map(
    scene: Scene,
    progress: Progress | None = None,
    *,
    reach: float,
    step: float,
    h: float | None = None,
    solver: str = "auto",
) -> QuantityMap:
    """Map of the quantity that a scene's probes read, at the depth of the first of them.

    Parameters
    ----------
    scene : Scene
    progress, h, solver : as for `simulate`
    reach : metre either way from the middle, at most to the edges of the body
    step : metre between places

    Returns
    -------
    QuantityMap

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
    depth, (x, y) = scene.depths[0], grid(scene, reach, step)
    asked, places = scene.reading.asked, np.stack(np.meshgrid(x, y), axis=-1)
    if has_wavenumber_integral(scene):
        return QuantityMap(
            x=x, y=y, rms=_flat_rms(scene, depth, places), asked=asked, depth=depth,
            note="wavenumber integral of the laterally infinite body",
        )  # fmt: skip
    if h is None and scene.reading.is_plain and takes(FROM_REST, scene):
        found = body_map(scene, x, y)
        return QuantityMap(
            x=x, y=y, rms=found.rms, asked=asked, depth=depth, note=found.note, error=PLATE_ERROR
        )
    if scene.load.support_motion or (scene.load.gravity and asked.invariant):
        raise ValueError(
            "a map is of motion about the rest without gravity, on a support at rest; leave "
            "gravity and support_motion out"
        )
    size = h or default_size(scene.body)
    rms, coarse = (
        _element_rms(
            scene, driven(scene, TOLERANCE, progress, h=each, solver=solver), depth, places
        )
        for each in (size, COARSER * size)
    )
    error = np.nanmax(np.abs(coarse - rms)) / (COARSER**ORDER - 1) / np.nanmax(rms)
    note = f"finite elements of {1e3 * size:.2g} mm"
    return QuantityMap(x=x, y=y, rms=rms, asked=asked, depth=depth, note=note, error=float(error))


def map_of_motion(scene: Scene, moved: DrivenBody) -> QuantityMap:
    """Map of the quantity of a meshed body whose motion is known, without an estimated error."""
    x, y = grid(scene)
    places = np.stack(np.meshgrid(x, y), axis=-1)
    return QuantityMap(
        x=x, y=y, rms=_element_rms(scene, moved, scene.depths[0], places),
        asked=scene.reading.asked, depth=scene.depths[0], note="finite elements",
    )  # fmt: skip


def save(path: Path, found: QuantityMap) -> None:
    """A map as one npz file."""
    np.savez(path, x=found.x, y=found.y, rms=found.rms, depth=found.depth)


def load(path: Path, scene: Scene) -> QuantityMap:
    """A map of the quantity that a scene's probes read from its file.

    Raises
    ------
    ValueError
        If the file is none of these.
    """
    try:
        arrays = reading.arrays(path)
        x, y, rms = (np.asarray(arrays[name], np.float64) for name in ("x", "y", "rms"))
        depth = float(arrays["depth"])
        if x.ndim != 1 or rms.shape != (*y.shape, *x.shape) or not np.isfinite(rms).any():
            raise ValueError(f"'rms' is of shape {rms.shape}, or nowhere a number")
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is no map ({error}); make it anew from its scene") from None
    note = "finite elements"
    return QuantityMap(x=x, y=y, rms=rms, asked=scene.reading.asked, depth=depth, note=note)


def _flat_rms(scene: Scene, depth: float, places: Floats) -> Floats:
    """RMS (ny, nx) at places (ny, nx, 2) of a laterally infinite body."""
    asked, field = scene.reading.asked, field_read(scene, depth)
    f, found = field_lines(field, scene.pressure, places.reshape(-1, 2), threshold=FAINT)
    rms = _rms(asked, (f, found.reshape(len(f), -1)), found.shape[1])
    return rms.reshape(places.shape[:2])


def _element_rms(scene: Scene, moved: DrivenBody, depth: float, places: Floats) -> Floats:
    """RMS (ny, nx) at places (ny, nx, 2) of a meshed body; not a number off it."""
    asked, flat = scene.reading.asked, places.reshape(-1, 2)
    seen = fem.on_surface(moved.build.mesh, flat)
    seen[seen] = _is_above(scene, moved, flat[seen], depth)
    reading = Reading(quantity=asked.name, depths=(depth,) * int(seen.sum()) if depth else ())
    rows, solids = probe_rows(scene.body, moved.build, flat[seen], reading)
    motion = read_at(moved.motion, rows @ moved.basis)
    s = 2j * np.pi * motion.frequencies
    lines = motion.lines * line_factor(asked, s, solids, rows.shape[0])
    rms = np.full(len(flat), np.nan)
    rms[seen] = _rms(asked, (motion.frequencies, lines), int(seen.sum()))
    return rms.reshape(places.shape[:2])


def _is_above(scene: Scene, moved: DrivenBody, places: Floats, depth: float) -> NDArray[np.bool_]:
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
