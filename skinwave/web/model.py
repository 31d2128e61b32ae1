"""Arrays of a page: a scene's response under the point kernel or another model, lines and maps."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.spatial import cKDTree

from meshes.tetmesh import Floats, Ints
from simple_model import (
    MovingPressure,
    Response,
    Tacton,
    Trajectory,
    line_table,
    modulation,
    published,
    resolved_lines,
    sensation_level,
    spectrum,
)
from simple_model.focus import lobe_width
from simple_model.joined import parted
from simple_model.load_spectrum import pressure_lines
from simple_model.tacton import CARRIER, level, tones
from skinwave.run import ASSESSED, lines_beside
from skinwave.scene import Scene
from skinwave.simulation import compute
from skinwave.surface import grid
from skinwave.web.moving import Moving
from skinwave.web.paths import REACH

SIDE = 41  # places along a side of a map
FINE_SIDE = 101  # of the borderline's grid
LEVELS = 4096  # instants of a rhythm
FAINTEST_LEVEL = -200.0  # dB
MOST_LINES, MOST_PEAKS = 40, 3
MOST_SHOWN = 1500  # points of a curve
MOST_ENVELOPE = 600  # of the commanded Tacton without its carrier
HIGHEST = 1000.0  # Hz of spectra
FAINTEST = 1e-3  # of the strongest line: weaker ones are not named
UNTRUSTED = 0.5  # share of a response left to settle: lines unresolved in the rest are not named
RESOLVED = 10  # samples of a period of the carrier
SMOOTH = 16  # and of the fastest modulation, whose peaks are then within 2 %


@dataclass(frozen=True, kw_only=True, eq=False)
class AreaMap:
    """A quantity over the area: `rms` (y, x) of it about its mean, in its unit, NaN outside the
    body, the highest sensation `level` (y, x) in dB of its lines, and the detection contour, where
    that is 0, closed lines (k, 2) in metre.
    """

    rms: Floats
    level: Floats
    threshold: tuple[Floats, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class LineAtPoint:
    """A line at a point: `amplitude` in the unit of the model, and `sensation` in dB above the
    threshold of detection, None of a pressure.
    """

    name: str
    frequency: float
    amplitude: float
    sensation: float | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """Response of a model: the `response` at the one point that is selected, its `frequencies` (f,)
    in Hz with the amplitudes `spectrum` (f,), its named `lines`, the strongest first, the map
    and, if it was asked for, the motion of the whole body.
    """

    response: Response
    frequencies: Floats
    spectrum: Floats
    lines: tuple[LineAtPoint, ...]
    map: AreaMap
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
    """The point kernel's response in a scene of one probe, under the load that a body receives."""
    return answer_of(scene, compute(scene, "point-kernel"), kernel_map(scene.pressure))


def as_published(scene: Scene) -> Answer:
    """The point kernel's response under the published load, whatever load the scene has."""
    return answer_of(
        scene, compute(scene, "point-kernel-published"), kernel_map(published(scene.pressure))
    )


def answer_of(
    scene: Scene, response: Response, found: AreaMap, moving: Moving | None = None
) -> Answer:
    """Spectrum, named lines and map of a response at one point, as a page shows them."""
    f, amplitude = spectrum(response)
    shown = f <= HIGHEST
    return Answer(
        response=response, frequencies=f[shown], spectrum=amplitude[shown, 0],
        lines=named_lines(scene, response), map=found, moving=moving,
    )  # fmt: skip


def named_lines(scene: Scene, response: Response) -> tuple[LineAtPoint, ...]:
    """The lines of a load in a response, the strongest first; and by their kind peaks that are no
    single one of them, such as a free vibration.
    """
    table = line_table(
        scene.pressure, response, candidates=ASSESSED, beside=lines_beside(scene, response),
        most=MOST_LINES, highest=HIGHEST, settle=UNTRUSTED,
    )  # fmt: skip
    surface = scene.reading.is_plain and response.record.of_body
    is_skin = surface and scene.body.is_skin
    peaks = table.unnamed[:MOST_PEAKS]
    amplitudes = [(n, f, float(table.amplitudes[n][0])) for n, f in table.frequencies.items()]
    amplitudes += [(f"{x.kind}, {x.frequency:.0f} Hz", x.frequency, float(x.amplitudes[0]))
                   for x in peaks]  # fmt: skip
    found = [
        LineAtPoint(name=name, frequency=f, amplitude=a,
             sensation=float(sensation_level(a, f)) if is_skin else None)
        for name, f, a in amplitudes
    ]  # fmt: skip
    found.sort(key=lambda line: -line.amplitude)
    return tuple(x for x in found if x.amplitude > FAINTEST * max(found[0].amplitude, 1e-300))


def unresolved_lines(scene: Scene, response: Response) -> tuple[str, ...]:
    """Names of lines that the response is too short to tell from 0 Hz or from each other."""
    return tuple(resolved_lines(scene.pressure, response, candidates=ASSESSED, highest=HIGHEST,
                                settle=UNTRUSTED)[1])  # fmt: skip


def map_line(side: int = SIDE) -> Floats:
    """Coordinates (side,) in metre of the places of a map along x, and along y."""
    return np.linspace(-REACH, REACH, side)


def on_grid(values: Floats, scene: Scene) -> Floats:
    """Values (side, side) of a map on the `surface.grid` of a report (ny, nx), interpolated."""
    from scipy.interpolate import RegularGridInterpolator  # which takes long to import

    x, y = grid(scene)
    line = map_line(len(values))
    places = np.stack(np.meshgrid(y, x, indexing="ij"), axis=-1)
    return np.asarray(RegularGridInterpolator((line, line), values)(places))


def places(side: int = SIDE) -> Floats:
    """Places (side * side, 2) in metre of a map, row after row."""
    line = map_line(side)
    x, y = np.meshgrid(line, line)
    return np.column_stack([x.ravel(), y.ravel()])


def kernel_map(pressure: MovingPressure) -> AreaMap:
    """RMS pressure about its mean, of a rhythm while a pulse is on; and the contour where the line
    with the highest sensation level, of a rhythm with its pauses, is at the threshold of skin.
    """
    tacton = replace(pressure.tacton, rhythm=None)
    f, amplitudes = pressure_lines(replace(pressure, tacton=tacton), places(), 1e-3)
    f, amplitudes = f[f > 1e-6], np.abs(amplitudes[f > 1e-6])
    rms = np.sqrt((amplitudes**2).sum(axis=0) / 2).reshape(SIDE, SIDE)
    level = sensation_level(mean_level(pressure) * amplitudes, f[:, None], unit="Pa")
    highest = level.max(axis=0, initial=FAINTEST_LEVEL).reshape(SIDE, SIDE)
    return AreaMap(rms=rms, level=highest, threshold=borderline(highest, 0.0))


def mean_level(pressure: MovingPressure) -> float:
    """Amplitude of lines with the pauses of a rhythm over that while a pulse is on; 1 without."""
    rhythm = pressure.tacton.rhythm
    if rhythm is None:
        return 1.0
    level = rhythm.level((np.arange(LEVELS) + 0.5) / LEVELS * rhythm.period)
    return float(pressure.law.level_factor(level, pressure.depth_of_modulation).mean())


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


def borderline(values: Floats, at: float) -> tuple[Floats, ...]:
    """Lines (k, 2) in metre along which values (side, side) of the area are `at`."""
    from contourpy import contour_generator

    line = map_line(len(values))
    masked = np.ma.masked_invalid(values)
    return tuple(np.asarray(x) for x in contour_generator(line, line, masked).lines(at))


def influenced(tacton: Tacton, height: float) -> tuple[Floats, ...]:
    """Contour of the influenced area: as far from a path as the main lobe reaches."""
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

    Its square is what pushes, so that it is the root of what the drive law makes; but for a
    law with a sign, by which, as published, the skin feels the signal itself, with its sign.
    """
    tacton = pressure.tacton
    shown, envelope = modulation(tacton, t), tacton.amplitude * level(tacton, t)
    driven = pressure.law(envelope, shown, pressure.depth_of_modulation)
    return driven if pressure.law.is_signed else np.sqrt(driven)


def thinned(x: Floats, y: Floats, most: int = MOST_SHOWN) -> tuple[Floats, Floats]:
    """At most about `most` points of a curve (n,), with every peak: the least and the largest of
    each part.
    """
    kept = peaks(y, most)
    return x[kept], y[kept]


def peaks(y: Floats, most: int = MOST_SHOWN) -> Ints:
    """Indices of at most about `most` values (n,), the least and the largest of each part."""
    if len(y) <= most:
        return np.arange(len(y))
    width = int(np.ceil(2 * len(y) / most))
    count = len(y) // width * width
    parts = y[:count].reshape(-1, width)
    both = np.sort([parts.argmin(axis=1), parts.argmax(axis=1)], axis=0).T
    kept = np.unique((both + np.arange(0, count, width)[:, None]).ravel())
    return np.append(kept, np.arange(count, len(y)))
