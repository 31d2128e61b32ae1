"""Effect of propagation: a body's motion compared with the point kernel under the same load.

- Share outside: integral of squared RMS motion where the kernel's RMS is below -20 dB of its
  largest, over the integral everywhere, both within 44 mm of the origin along x and y.
- Half: distance from the path within which that integral has half its value.
- Spread: largest distance from the path at which the RMS is within 6 dB of the largest.
- Level: largest ratio of amplitude to detection threshold of a component, while a pulse is on.
- Reach: largest distance from the path at which a component is above its threshold, while a
  pulse is on.
- Phase delay: phase difference of motion and kernel pressure at one probe, over 2 pi f.

All are of the steady vibration about its mean, without free vibration after the start. On a curved
surface areas and distances are those along the surface, seen from above.
"""

from dataclasses import dataclass, replace
from math import asin

import numpy as np
from scipy.spatial import cKDTree

from simple_model import sensation_level
from skinwave.results.comparison import line_phasors, phase_delays
from skinwave.results.run import Run
from skinwave.results.surface import SurfaceField
from skinwave.results.views import path_points
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

OUTSIDE, NEAR = -20.0, -6.0  # dB re the largest RMS: the kernel's region, and the spread


@dataclass(frozen=True, kw_only=True)
class Component:
    """A spectral line at the probe where it is strongest: frequency in Hz, amplitude in the unit of
    the response, and sensation level in dB. The level is None if the body is not skin, or for side
    lines of a rhythm.
    """

    name: str
    frequency: float
    amplitude: float
    probe: int
    level: float | None = None


@dataclass(frozen=True, kw_only=True)
class Reach:
    """A distance in m from the path; `beyond` if it extends past the map."""

    metre: float
    beyond: bool = False


@dataclass(frozen=True, kw_only=True)
class Propagation:
    """Effect of propagation on one Tacton and one body.

    Parameters
    ----------
    column : str, the body, as `Run.column`
    strongest, kernel_strongest : components of largest amplitude
    highest_sensation : component of highest sensation level, None unless the body is skin
    delay : float, s, of the kernel's strongest component in the body relative to the kernel, at the
        probe closest to the path at which both move, or None
    share, half, kernel_half, spread, kernel_spread : from the maps, or None without maps
    above_threshold : reach with half, once and twice the pressure, each None if nothing exceeds the
        threshold; empty unless the body is skin and has a map
    """

    column: str
    strongest: Component | None
    kernel_strongest: Component | None
    highest_sensation: Component | None
    delay: float | None
    share: float | None = None
    half: float | None = None
    kernel_half: float | None = None
    spread: Reach | None = None
    kernel_spread: Reach | None = None
    above_threshold: tuple[Reach | None, ...] = ()


def propagation(
    run: Run,
    kernel: Run,
    surface: SurfaceField | None = None,
    kernel_surface: SurfaceField | None = None,
) -> Propagation:
    """Return the effect of propagation from responses of a body and of the point kernel at the same
    probes, and from their maps on one grid. Raises a ValueError if their loads differ.
    """
    if run.scene.pressure != kernel.scene.pressure:
        raise ValueError(
            f"{run.column} and {kernel.column} have different loads; compare responses to one load"
        )
    strongest, of_kernel = strongest_component(run), strongest_component(kernel)
    effect = Propagation(
        column=run.column, strongest=strongest, kernel_strongest=of_kernel,
        highest_sensation=strongest_component(run, by_sensation=True) if run.is_skin else None,
        delay=_delay(run, kernel, of_kernel.frequency) if strongest and of_kernel else None,
    )  # fmt: skip
    if surface is None or kernel_surface is None or not np.nan_to_num(surface.rms).any():
        return effect
    distance, area = distance_along(run.scene, surface), area_of(surface)
    rms, kernel_rms = surface.rms, kernel_surface.rms
    return replace(
        effect, share=share_outside(kernel_rms, rms, area), half=half_within(rms, area, distance),
        kernel_half=half_within(kernel_rms, area, distance),
        spread=reach_of(rms >= _level(rms, NEAR), distance),
        kernel_spread=reach_of(kernel_rms >= _level(kernel_rms, NEAR), distance),
        above_threshold=_above_threshold(surface, distance) if run.scene.body.is_skin else (),
    )  # fmt: skip


def share_outside(kernel: Floats, rms: Floats, area: Floats | float = 1.0) -> float:
    """Return the share (0 to 1) of squared motion (ny, nx) where the kernel (ny, nx) is 20 dB below
    its largest value. Places off the body are nan; `area` (ny, nx) is that of each place.
    """
    outside, power = kernel < _level(kernel, OUTSIDE), area * rms**2
    return float(np.nansum(power[outside]) / np.nansum(power))


def half_within(rms: Floats, area: Floats, distance: Floats) -> float:
    """Return the distance in m within which squared motion (ny, nx) has half of its integral, from
    the area and the `distance` in m of each place.
    """
    order = np.argsort(distance, axis=None)
    power = np.cumsum(np.nan_to_num(area * rms**2).ravel()[order])
    return float(np.interp(power[-1] / 2, power, distance.ravel()[order]))


def area_of(surface: SurfaceField) -> Floats:
    """Return the area (ny, nx) of the surface at each place, relative to that seen from above."""
    if surface.height is None or min(surface.height.shape) < 2:
        return np.ones(surface.rms.shape)
    slopes = np.gradient(surface.height, surface.y, surface.x)
    # Beside the rim the slope is unknown.
    return np.asarray(np.sqrt(1 + sum(np.nan_to_num(slope) ** 2 for slope in slopes)))


def distance_along(scene: Scene, surface: SurfaceField, points: int = 24) -> Floats:
    """Return the distance (ny, nx) in m of the places of a map from the path of the focus, along
    the surface above `points` of the straight line to the nearest place of the path.
    """
    flat, nearest = _nearest(scene, surface.places)
    if surface.height is None:
        return flat
    from scipy.interpolate import RegularGridInterpolator  # slow to import

    height = RegularGridInterpolator(
        (surface.x, surface.y), np.nan_to_num(surface.height.T), bounds_error=False, fill_value=None
    )
    shares = np.linspace(0, 1, points)[:, None, None, None]
    levels = height(surface.places + shares * (nearest - surface.places))
    return np.asarray(np.hypot(flat / (points - 1), np.diff(levels, axis=0)).sum(axis=0))


def reach_of(inside: np.ndarray, distance: Floats) -> Reach:
    """Return the largest `distance` (ny, nx) in m among the places `inside` (ny, nx)."""
    edge = np.ones_like(inside)
    edge[1:-1, 1:-1] = False
    return Reach(metre=float(distance[inside].max()), beyond=bool((inside & edge).any()))


def distance_from_path(scene: Scene, places: Floats) -> Floats:
    """Return the distance (...) in m of places (..., 2) from the path of the focus."""
    return _nearest(scene, places)[0]


def _nearest(scene: Scene, places: Floats) -> tuple[Floats, Floats]:
    """Return the distances (...) in m of places (..., 2) from the path, and its nearest places."""
    path = path_points(scene, 1441)
    distance, index = cKDTree(path).query(places)
    return np.asarray(distance), path[index]


def mach_angle(wave_speed: float, speed: float) -> float | None:
    """Return the Mach angle asin(c/v) in rad of a focus on a straight path; None if the focus is
    slower than the wave. On a circle smaller than a wavelength there is no clear cone.
    """
    return asin(wave_speed / speed) if speed > wave_speed else None


def strongest_component(run: Run, *, by_sensation: bool = False) -> Component | None:
    """Return the line of largest amplitude or, with `by_sensation`, of highest sensation level, at
    any probe; None if nothing vibrates.
    """
    table = run.in_pulses if by_sensation else run.table
    names, frequencies = list(table.frequencies), np.array([*table.frequencies.values()])
    amplitudes = np.array([table.amplitudes[name] for name in names])
    if not amplitudes.any():
        return None
    ranked = sensation_level(amplitudes, frequencies[:, None]) if by_sensation else amplitudes
    line, probe = np.unravel_index(int(np.argmax(ranked)), ranked.shape)
    level = float(run.levels[names[line]][probe]) if names[line] in run.levels else None
    return Component(
        name=names[line], frequency=float(frequencies[line]), probe=int(probe), level=level,
        amplitude=float(amplitudes[line, probe]),
    )  # fmt: skip


def added_lines(
    kernel: Run, published: Run, present: float = -40.0, absent: float = -100.0
) -> list[str]:
    """Return the lines that drive law and focus add to the published load, the strongest first:
    they are `present` and were `absent`, in dB re the strongest line of the same response.
    """
    levels, published_levels = _levels(kernel), _levels(published)
    added = (
        name for name, level in levels.items()
        if level > present and published_levels.get(name, -np.inf) < absent
    )  # fmt: skip
    return sorted(added, key=lambda name: -levels[name])


def _levels(run: Run) -> dict[str, float]:
    """Return the largest amplitude of each line at any probe, in dB re the strongest line."""
    peak = {n: float(run.lines[n].max()) for n, f in run.frequencies.items() if f > 0}
    top = max(peak.values(), default=0.0)
    return {n: 20 * np.log10(max(x, 1e-300) / top) for n, x in peak.items()} if top else {}


def _delay(run: Run, kernel: Run, frequency: float) -> float | None:
    probes = run.response.probes[:, :2]
    a, b = (line_phasors(each.response, (frequency,)) for each in (kernel, run))
    delays = phase_delays(a, b, np.array([frequency]), probes)[0]
    distance = cKDTree(path_points(run.scene)).query(probes)[0]
    distance[np.isnan(delays)] = np.inf
    nearest = int(np.argmin(distance))
    return float(delays[nearest]) if np.isfinite(distance[nearest]) else None


def _above_threshold(surface: SurfaceField, distance: Floats) -> tuple[Reach | None, ...]:
    if surface.level is None:
        return ()
    factor_of_two = 20 * np.log10(2.0)  # dB: the uncertainty of a device's pressure
    insides = [surface.level >= -more for more in (-factor_of_two, 0.0, factor_of_two)]
    return tuple(reach_of(inside, distance) if inside.any() else None for inside in insides)


def _level(rms: Floats, decibel: float) -> float:
    return float(np.nanmax(rms)) * 10 ** (decibel / 20)
