"""Effect of propagation: a body's motion beside the point kernel under the same load.

Share outside: integral of squared RMS motion over the surface where the kernel's RMS is 20 dB below
its largest, over the integral everywhere, both within 44 mm of the origin along x and y. Spread:
largest distance from the path of a place whose RMS is within 6 dB of the largest. Phase delay:
difference of phase between motion and the kernel's pressure at the same probe over 2 pi f. All of
the steady vibration, about the mean.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from simple_model import sensation_level
from skinwave.results.comparison import heard_phasors, phase_delays
from skinwave.results.run import Run
from skinwave.results.surface import SurfaceField
from skinwave.results.views import path_points
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

OUTSIDE, NEAR = -20.0, -6.0  # dB re the largest RMS: the kernel's region, and the spread
PRESENT, ABSENT = -40.0, -100.0  # dB re the strongest component of the same response
FACTOR_OF_TWO = 20 * np.log10(2.0)  # dB: how well the pressure of a device is known


@dataclass(frozen=True, kw_only=True)
class Component:
    """A spectral line where it is strongest: `name`, `frequency` in Hz, `amplitude` in the unit of
    the response, the `probe`, and the sensation `level` in dB, None of what is not skin.
    """

    name: str
    frequency: float
    amplitude: float
    probe: int
    level: float | None = None


@dataclass(frozen=True, kw_only=True)
class Reach:
    """A distance in metre from the path, or to the end of the map, which lies `beyond` it."""

    metre: float
    beyond: bool = False


@dataclass(frozen=True, kw_only=True)
class Propagation:
    """Effect of propagation on one Tacton and one body.

    Parameters
    ----------
    column : the body, as `Run.column`
    strongest, kernel_strongest : the component of largest amplitude
    highest_sensation : the component of highest sensation level, None of what is not skin
    delay : float, s, of the strongest component behind the kernel's at the probe next to the path
        where both move, or None
    share, spread, kernel_spread : of the maps, None where there is none
    above_threshold : its reach with half the pressure, as it is, and with twice; None each where
        nothing is, and no tuple for what is not skin or has no map
    """

    column: str
    strongest: Component | None
    kernel_strongest: Component | None
    highest_sensation: Component | None
    delay: float | None
    share: float | None = None
    spread: Reach | None = None
    kernel_spread: Reach | None = None
    above_threshold: tuple[Reach | None, ...] = ()


def propagation(
    run: Run,
    kernel: Run,
    surface: SurfaceField | None = None,
    kernel_surface: SurfaceField | None = None,
) -> Propagation:
    """Difference of a body's response from the point kernel's at the same probes and, if given, of
    their maps on one grid; a ValueError if their loads differ, and so more than propagation does.
    """
    if run.scene.pressure != kernel.scene.pressure:
        raise ValueError(
            f"{run.column} and {kernel.column} have different loads; compare responses to the same"
        )
    strongest = strongest_component(run)
    found = Propagation(
        column=run.column,
        strongest=strongest,
        kernel_strongest=strongest_component(kernel),
        highest_sensation=strongest_component(run, by_sensation=True) if run.is_skin else None,
        delay=None if strongest is None else _delay(run, kernel, strongest.frequency),
    )
    if surface is None or kernel_surface is None or not surface.rms.any():
        return found
    away = distance_from_path(run.scene, surface.places)
    own, of_kernel = surface.rms, kernel_surface.rms
    return replace(
        found, share=share_outside(of_kernel, own),
        spread=reach_of(own >= _level(own, NEAR), away),
        kernel_spread=reach_of(of_kernel >= _level(of_kernel, NEAR), away),
        above_threshold=_above_threshold(surface, away) if run.scene.body.is_skin else (),
    )  # fmt: skip


def share_outside(kernel: Floats, rms: Floats) -> float:
    """Share 0..1 of squared motion (ny, nx) where the kernel's (ny, nx) is 20 dB below its largest;
    places that are no number are off the body.
    """
    outside = kernel < _level(kernel, OUTSIDE)
    return float(np.nansum(rms[outside] ** 2) / np.nansum(rms**2))


def reach_of(inside: np.ndarray, away: Floats) -> Reach:
    """The furthest of the places (ny, nx) that are inside, at distances (ny, nx) in metre."""
    edge = np.ones_like(inside)
    edge[1:-1, 1:-1] = False
    return Reach(metre=float(away[inside].max()), beyond=bool((inside & edge).any()))


def distance_from_path(scene: Scene, places: Floats) -> Floats:
    """Distance (...) in metre of places (..., 2) from the path of the focus."""
    return np.asarray(cKDTree(path_points(scene, 1441)).query(places)[0])


def strongest_component(run: Run, *, by_sensation: bool = False) -> Component | None:
    """Line of largest amplitude at any probe or, `by_sensation`, of highest sensation level; None
    of none.
    """
    names = [name for name, f in run.frequencies.items() if f > 0]
    amplitudes = np.array([run.lines[name] for name in names])
    if not amplitudes.any():
        return None
    frequencies = np.array([run.frequencies[name] for name in names])
    levels = sensation_level(amplitudes, frequencies[:, None])
    heard = levels if by_sensation else amplitudes
    line, probe = np.unravel_index(int(np.argmax(heard)), heard.shape)
    return Component(
        name=names[line],
        frequency=float(frequencies[line]),
        amplitude=float(amplitudes[line, probe]),
        probe=int(probe),
        level=float(levels[line, probe]) if run.is_skin else None,
    )


def added_lines(kernel: Run, published: Run) -> list[str]:
    """Lines of the kernel under the scene's load that it lacks under the published one: what the
    drive law and the focus add, the strongest first.
    """
    there, before = _levels(kernel), _levels(published)
    found = [n for n in there if there[n] > PRESENT and before.get(n, -np.inf) < ABSENT]
    return sorted(found, key=lambda name: -there[name])


def _levels(run: Run) -> dict[str, float]:
    """Largest amplitude of each line at any probe, dB re that of the strongest."""
    peak = {n: float(run.lines[n].max()) for n, f in run.frequencies.items() if f > 0}
    top = max(peak.values(), default=0.0)
    return {n: 20 * np.log10(max(x, 1e-300) / top) for n, x in peak.items()} if top else {}


def _delay(run: Run, kernel: Run, frequency: float) -> float | None:
    probes = run.response.probes[:, :2]
    a, b = (heard_phasors(each.response, (frequency,)) for each in (kernel, run))
    delays = phase_delays(a, b, np.array([frequency]), probes)[0]
    away = cKDTree(path_points(run.scene)).query(probes)[0]
    away[np.isnan(delays)] = np.inf
    nearest = int(np.argmin(away))
    return float(delays[nearest]) if np.isfinite(away[nearest]) else None


def _above_threshold(surface: SurfaceField, away: Floats) -> tuple[Reach | None, ...]:
    if surface.level is None:
        return ()
    insides = [surface.level >= -more for more in (-FACTOR_OF_TWO, 0.0, FACTOR_OF_TWO)]
    return tuple(reach_of(inside, away) if inside.any() else None for inside in insides)


def _level(rms: Floats, decibel: float) -> float:
    return float(np.nanmax(rms)) * 10 ** (decibel / 20)
