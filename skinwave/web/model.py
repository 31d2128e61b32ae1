"""From a scene to everything that a page shows of the point kernel's answer, and of any other."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from meshes.tetmesh import Floats
from simple_model import (
    MovingPressure,
    Response,
    Tacton,
    Trajectory,
    evenly,
    lines,
    modulation,
    published,
    sensation_level,
    spectrum,
    tacton_lines,
    told_apart,
)
from simple_model.drive import DRIVES
from simple_model.focus import lobe_width, moved_spot
from simple_model.joined import parted
from simple_model.steady import along_path, load_lines, path_knots
from simple_model.tacton import CARRIER, level, tones
from simple_model.threshold import PRESSURE
from skinwave.scene import Scene
from skinwave.simulation import simulate
from skinwave.web.moving import Moving
from skinwave.web.paths import REACH

SIDE = 41  # places along a side of a map
FELT_SIDE = 81  # of the borderline of what is felt of a pressure
FINE_SIDE = 101  # of the borderline's grid
GAIN_RATE = 4000.0  # Hz at which the pressure at the foci is looked at
PHASES = 120  # of a path
MOST_SHOWN = 1500  # points of a curve
MOST_ENVELOPE = 600  # of the commanded Tacton without its carrier
HIGHEST = 1000.0  # Hz of spectra
FAINTEST = 1e-3  # of the strongest line: weaker ones are not named
UNTRUSTED = 0.5  # of a response: lines that what is left cannot tell apart are not named
RESOLVED = 10  # samples of a period of the carrier
SMOOTH = 16  # and of the fastest modulation, whose peaks are then within 2 %


@dataclass(frozen=True, kw_only=True, eq=False)
class Map:
    """A quantity over the area: `rms` (y, x) of it about its mean, in its unit, not a number beside
    the body, and the borderline `felt` of what is felt, closed lines (k, 2) in metre.
    """

    rms: Floats
    felt: tuple[Floats, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """A line at a point: `amplitude` in the unit of the model, and `sensation` in dB above the
    threshold of detection, None of a pressure.
    """

    name: str
    frequency: float
    amplitude: float
    sensation: float | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """A model's answer: the `response` at the one point that is selected, its `frequencies` (f,)
    in Hz with the amplitudes `spectrum` (f,), its named `lines`, the strongest first, the map
    and, if it was asked for, the motion of the whole body.
    """

    response: Response
    frequencies: Floats
    spectrum: Floats
    lines: tuple[Line, ...]
    map: Map
    moving: Moving | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Commanded:
    """A commanded signal at `times` (t,) in s, as a share of full drive: with its `carrier` or the
    `largest` amplitude (t,) about each time and, if it changes in between, the `least` (t,).
    """

    times: Floats
    largest: Floats
    least: Floats | None = None
    carrier: bool = False


def kernel(scene: Scene) -> Answer:
    """The point kernel's answer to a scene of one probe, under the load that a body receives."""
    return answer_of(scene, simulate(scene, "point-kernel"), kernel_map(scene.pressure))


def as_published(scene: Scene) -> Answer:
    """The point kernel's answer under the published load, whatever load the scene has."""
    return answer_of(
        scene, simulate(scene, "point-kernel-published"), kernel_map(published(scene.pressure))
    )


def answer_of(scene: Scene, response: Response, found: Map, moving: Moving | None = None) -> Answer:
    """What is shown of a response at one point."""
    f, amplitude = spectrum(response)
    shown = f <= HIGHEST
    return Answer(
        response=response, frequencies=f[shown], spectrum=amplitude[shown, 0],
        lines=named_lines(scene, response), map=found, moving=moving,
    )  # fmt: skip


def named_lines(scene: Scene, response: Response) -> tuple[Line, ...]:
    """The lines of a Tacton in its answer, the strongest first; one name for each frequency."""
    possible, untold = possible_lines(scene, response), untold_lines(scene, response)
    known: dict[str, float] = {}
    for name, f in possible.items():
        told = f > 0 and name not in untold
        if told and all(abs(f - other) > 1 / response.times[-1] for other in known.values()):
            known[name] = f
    if not known:
        return ()
    bins, rough = spectrum(response)  # to fit what is there: a fit of all takes ten times as long
    near = np.array([rough[np.abs(bins - each) < 2.5 * bins[1]].max(initial=0.0) for each in
                     known.values()])  # fmt: skip
    known = {name: known[name] for name, a in zip(known, near, strict=True)
             if a > 0.5 * FAINTEST * near.max(initial=0.0)}  # fmt: skip
    if not known:
        return ()
    amplitudes = lines(response, list(known.values()))[:, 0]
    felt = response.unit == "m"
    found = [
        Line(
            name=name, frequency=f, amplitude=float(a),
            sensation=float(sensation_level(a, f)) if felt else None,
        )
        for (name, f), a in zip(known.items(), amplitudes, strict=True)
    ]  # fmt: skip
    found.sort(key=lambda line: -line.amplitude)
    return tuple(x for x in found if x.amplitude > FAINTEST * max(found[0].amplitude, 1e-300))


def possible_lines(scene: Scene, response: Response) -> dict[str, float]:
    """Names and frequencies in Hz of what is looked for, the shortest names first."""
    highest = min(HIGHEST, 0.99 * 0.5 / (response.times[1] - response.times[0]))
    found = {n: f for n, f in tacton_lines(scene.tacton).items() if f <= highest}
    return dict(sorted(found.items(), key=lambda item: len(item[0])))


def untold_lines(scene: Scene, response: Response) -> tuple[str, ...]:
    """Names of lines that the response is too short to tell from 0 Hz or from each other."""
    possible = possible_lines(scene, response)
    told = told_apart(response, list(possible.values()), settle=UNTRUSTED)
    return tuple(name for name, is_told in zip(possible, told, strict=True) if not is_told)


def places(side: int = SIDE) -> Floats:
    """Places (side * side, 2) in metre of a map, row after row."""
    line = np.linspace(-REACH, REACH, side)
    x, y = np.meshgrid(line, line)
    return np.column_stack([x.ravel(), y.ravel()])


def kernel_map(pressure: MovingPressure) -> Map:
    """Where the pressure changes, by its lines, and where it can rise above what is just felt: at
    its largest at the foci, with these wherever on their path. Of a rhythm, while a pulse is on.

    The root of a spot is all but straight where it ends, as lines between places want it.
    """
    tacton = replace(pressure.tacton, rhythm=None)
    path, duration = tacton.trajectory, tacton.duration
    found = load_lines(replace(pressure, tacton=tacton), 1e-3)
    # Of paths of their own only every n-th harmonic is left, of which `harmonics_of` knows.
    n, at_all = tacton.n_paths, at_any_speed(path)
    found = replace(found, harmonics=found.harmonics // n)
    f, amplitudes = found.gather(harmonics_of(at_all, n, pressure.height, pressure.focus))
    rms = np.sqrt((np.abs(amplitudes[f > 1e-6]) ** 2).sum(axis=0) / 2).reshape(SIDE, SIDE)
    gain = np.abs(pressure.gain(np.linspace(0, duration, round(duration * GAIN_RATE) + 2))).max()
    swept = nearest_foci(at_all, n, tacton.foci, pressure.height, pressure.focus)
    return Map(rms=rms, felt=borderline(np.sqrt(gain * swept), PRESSURE**0.5))


def at_any_speed(path: Trajectory) -> Trajectory:
    """The same places whatever the speed, a key of what depends on them alone."""
    if path.shape == "recorded":
        times = tuple(np.round(np.array(path.times) / path.times[-1], 12).tolist())
        return replace(path, times=times)
    return path if path.is_static else replace(path, speed=1.0)


def drawn_paths(tacton: Tacton) -> tuple[Floats, ...]:
    """The paths as lines (k, 2) in metre; none of foci that rest."""
    path = tacton.trajectory
    if path.is_static:
        return ()
    lines = parted(path, tacton.n_paths) if path.shape == "recorded" else (path.outline,)
    return tuple(line for line in lines if np.ptp(line, axis=0).any())


@lru_cache(maxsize=2)  # up to 13 MB each
def harmonics_of(
    path: Trajectory, n_paths: int, height: float, focus: str
) -> NDArray[np.complex128]:
    """Harmonics (n, SIDE^2) of a focus of unit pressure on a path, at a map's places; of several
    paths that are joined every n_paths-th, which is the mean of all.
    """
    tacton = Tacton(trajectory=path, foci=evenly(n_paths))
    pressure = MovingPressure(tacton=tacton, height=height, focus=focus)
    spots = pressure.spot(places(), path_knots(pressure))
    mean = spots.reshape(n_paths, -1, SIDE**2).mean(axis=0)
    return along_path(mean.T).T


@lru_cache(maxsize=32)
def nearest_foci(
    path: Trajectory, n_paths: int, foci: tuple[float, ...], height: float, focus: str
) -> Floats:
    """The largest relative pressure (y, x) of all foci together, wherever on their path."""
    phases = np.zeros(1) if path.is_static else np.arange(PHASES) / PHASES / n_paths
    at = places(FELT_SIDE)
    spots = sum(moved_spot(at, path.at_phase((phases + a) % 1), height, focus) for a in foci)
    return np.asarray(spots).max(axis=0).reshape(FELT_SIDE, FELT_SIDE)


def borderline(values: Floats, at: float) -> tuple[Floats, ...]:
    """Lines (k, 2) in metre along which values (side, side) of the area are `at`."""
    from contourpy import contour_generator

    line = np.linspace(-REACH, REACH, len(values))
    masked = np.ma.masked_invalid(values)
    return tuple(np.asarray(x) for x in contour_generator(line, line, masked).lines(at))


def influenced(tacton: Tacton, height: float) -> tuple[Floats, ...]:
    """The borderline of the influenced area: as far from a path as the main lobe reaches."""
    return _influenced(at_any_speed(tacton.trajectory), tacton.n_paths, height)


@lru_cache(maxsize=32)
def _influenced(path: Trajectory, n_paths: int, height: float) -> tuple[Floats, ...]:
    outline = path.at_phase(np.zeros(1) if path.is_static else np.linspace(0, 1, 180 * n_paths + 1))
    away = cKDTree(outline).query(places(FINE_SIDE))[0]
    return borderline(away.reshape(FINE_SIDE, FINE_SIDE), lobe_width(height))


def commanded_curve(pressure: MovingPressure, start: float, end: float) -> Commanded:
    """The commanded signal between two times in s, as the drive law makes it.

    With the carrier, if `MOST_SHOWN` points resolve it; else its amplitude, if they resolve its
    modulation; else the largest and the least amplitude of each of `MOST_ENVELOPE` parts.
    """
    tacton = pressure.tacton
    start, end = max(0.0, start), min(end, tacton.duration)
    if (needed := (end - start) * CARRIER * RESOLVED) <= MOST_SHOWN:
        t = np.linspace(start, end, max(2, int(needed) + 1))
        wave = sound_amplitude(pressure, t) * np.sin(2 * np.pi * CARRIER * t)
        return Commanded(times=t, largest=wave, carrier=True)
    needed = (end - start) * SMOOTH * sum(tones(tacton))  # no line of a product is above the sum
    if needed <= MOST_SHOWN:
        t = np.linspace(start, end, max(MOST_ENVELOPE, int(needed)))
        return Commanded(times=t, largest=np.abs(sound_amplitude(pressure, t)))
    width = (end - start) / MOST_ENVELOPE
    middles = np.asarray(start + (np.arange(MOST_ENVELOPE) + 0.5) * width, np.float64)
    within = np.linspace(-0.5, 0.5, int(np.ceil(needed / MOST_ENVELOPE)) + 1) * width
    amplitude = np.abs(sound_amplitude(pressure, middles[:, None] + within))
    return Commanded(times=middles, largest=amplitude.max(axis=1), least=amplitude.min(axis=1))


def sound_amplitude(pressure: MovingPressure, t: Floats) -> Floats:
    """Amplitude (...) of the sound at a focus at times (...) in s, as a share of full drive.

    Its square is what pushes, so that it is the root of what the drive law makes; but for the
    linear law, by which, as published, the skin feels the signal itself, with its sign.
    """
    tacton = pressure.tacton
    shown, envelope = modulation(tacton, t), tacton.amplitude * level(tacton, t)
    driven = DRIVES[pressure.drive](envelope, shown, pressure.depth_of_modulation)
    return np.asarray(driven if pressure.drive == "linear" else np.sqrt(driven))


def thinned(x: Floats, y: Floats, most: int = MOST_SHOWN) -> tuple[Floats, Floats]:
    """At most about `most` points of a curve (n,), with every peak: the least and the largest of
    each part.
    """
    if len(x) <= most:
        return x, y
    width = int(np.ceil(2 * len(x) / most))
    count = len(x) // width * width
    parts = y[:count].reshape(-1, width)
    both = np.sort([parts.argmin(axis=1), parts.argmax(axis=1)], axis=0).T
    kept = np.unique((both + np.arange(0, count, width)[:, None]).ravel())
    kept = np.append(kept, np.arange(count, len(x)))
    return x[kept], y[kept]
