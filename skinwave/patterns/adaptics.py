"""AdapTics patterns as Tactons.

The engine draws a brush about a place that moves from keyframe to keyframe: with u = 2 pi f_d t

    circle     x = r cos u,           y = r sin u
    line       x = L cos u,           y = 0, rotated; L is half the span
    lissajous  x = X sin(a u + d),    y = Y sin(b u), rotated; u restarts at 2 pi

and the sound pressure follows intensity (1 + cos(2 pi f_AM t))/2. A constant brush at one place
becomes a circle, or a line with a sinusoidal sweep. Anything else becomes a path recorded at the
engine's 20 kHz.
"""

from dataclasses import replace
from math import cos, pi, radians, sin
from typing import Any

import numpy as np

from simple_model import Tacton, Trajectory
from simple_model.load.tacton import COMMENSURATE, LONGEST, RETURN_TOLERANCE
from simple_model.load.trajectory import LARGEST_SIZE
from skinwave.patterns.adaptics_file import Brush, Track, parse
from skinwave.patterns.pattern import ENGINE_RATE, STRAIGHT, Options, Pattern, one_height, thin
from skinwave.scene.scene import Scene
from skinwave.system.formats import PATTERN_READERS, register
from skinwave.typing import Floats


def read(content: bytes, options: Options, base: Scene) -> Pattern:
    """Read the pattern of an .adaptics file; if it jumps back endlessly, only its loop."""
    animation = parse(content, options.parameters)
    notes = list(animation.notes)
    runs = np.array(animation.runs[animation.loop or 0 :])
    before = float(np.diff(animation.runs[: animation.loop or 0]).sum())  # s until the loop
    duration = float(np.diff(runs).sum())
    if duration == 0:
        duration = 1.0
        runs = runs[-1:] + [[0.0, duration]]
        notes.append(f"the pattern has no end; it is cut at {duration:g} s")
    if not 2 / ENGINE_RATE <= duration <= LONGEST:
        raise ValueError(
            f"the pattern lasts {duration:g} s; move its keyframes or its jump so that it lasts "
            f"{2 / ENGINE_RATE:g} to {LONGEST:g} s"
        )
    if animation.loop is not None:
        jumps = ", ".join(f"{1e3 * end:g}" for _, end in runs)
        notes.append(
            f"the pattern jumps back at {jumps} ms for ever, in a loop of {1e3 * duration:g} ms"
            + (f"; the first {1e3 * before:g} ms are left out" if before else "")
        )
    t, p = _playhead(runs, 1)
    before_p, part = _keyframe_before(animation.brushes, p)
    visited = np.union1d(before_p, before_p[part > 0] + 1)
    brushes = list(dict.fromkeys(animation.brushes.values[k] for k in visited))
    if animation.loop is not None and (count := _loops(brushes, duration, notes)) > 1:
        t, p = _playhead(runs, count)
    place = _at(animation.places, p)
    level = animation.factor * _at(animation.intensities, p)[:, 0]
    if not level.any():
        notes.append("the intensity is always 0; it may depend on parameters")
    height = one_height(place[:, 2] / 1e3, options, notes)
    if "height" not in height and options.height is None:
        height = {"height": 0.0}  # on the array, which the scene refuses
    pressure: dict[str, Any] = {"drive": "pressure_squared", **height}
    steady = np.ptp(place[:, :2], axis=0).max() == np.ptp(level) == 0 and len(brushes) == 1
    if steady and _is_simple(brushes[0]):
        tacton = _constant(brushes[0], place[0], notes)
        tacton = replace(tacton, amplitude=_within(level[:1], notes)[0], duration=duration)
        if brushes[0].am_frequency:
            pressure["depth_of_modulation"] = 1.0
            notes.append("AM starts at its mean, a quarter of a period later than in the engine")
    else:
        offset, am_cycles = _brush_at(animation.brushes, p, before + t)
        level = _within(level * (1 + np.cos(2 * pi * am_cycles)) / 2, notes)
        if any(b.name == "lissajous" and b.numbers[5] for b in brushes):
            notes.append("the rotation of a lissajous is in radians, as in the engine")
        notes.append(
            f"sampled at {ENGINE_RATE:g} Hz like the engine, and reduced to straight lines within "
            f"{1e3 * STRAIGHT[0]:g} mm"
        )
        tacton = _record(t, (place[:, :2] + offset) / 1e3, level)
    return Pattern(tacton=tacton, pressure=pressure, name=animation.name, notes=tuple(notes))


def _loops(brushes: list[Brush], period: float, notes: list[str]) -> int:
    """Return the number of loops of a period in s until the phases of brushes and AM repeat."""
    cycles = period * np.array(
        [f for b in brushes for f in (b.am_frequency, b.drawing_frequency * any(b.numbers[:2]))]
    )
    many = np.outer(np.arange(1, int(LONGEST / period) + 1), cycles)
    jump = np.abs(many - np.round(many)).max(axis=1)
    returns = jump <= RETURN_TOLERANCE
    count = int(np.argmax(returns) if returns.any() else np.argmin(jump))
    if jump[count] > COMMENSURATE:
        notes.append(
            f"the path repeats after {count + 1} loops, where the brush jumps by "
            f"{100 * jump[count]:.2g} % of its cycle"
        )
    return count + 1


def _playhead(runs: Floats, count: int) -> tuple[Floats, Floats]:
    """Return times (t,) in s at the engine's rate, with both ends, and those (t,) in the tracks.

    The runs (k, 2) are played `count` times.
    """
    ends = np.cumsum(np.diff(runs))
    t = np.linspace(0.0, count * ends[-1], round(count * ends[-1] * ENGINE_RATE) + 1)
    again = np.mod(t, ends[-1])
    again[-1] = ends[-1]  # the end itself, not the start of the next loop
    run = np.minimum(np.searchsorted(ends, again, side="right"), len(ends) - 1)
    return t, np.asarray(runs[run, 1] - (ends[run] - again))


def _record(t: Floats, places: Floats, levels: Floats) -> Tacton:
    """Return a Tacton of a focus at places (t, 2) in m with levels (t,)."""
    kept = thin(t, places, levels)
    path = Trajectory(
        shape="recorded", times=tuple(np.round(t[kept], 9).tolist()),
        points=tuple(map(tuple, np.round(places[kept], 9).tolist())),
        levels=tuple(np.round(levels[kept], 6).tolist()),
    )  # fmt: skip
    return Tacton(duration=min(path.times[-1], LONGEST), trajectory=path)


def _within(level: Floats, notes: list[str]) -> Floats:
    if level.min() < 0 or level.max() > 1:
        notes.append(
            f"the intensity of {level.min():.3g} to {level.max():.3g} is limited to the range of "
            "devices, 0 to 1"
        )
    return np.clip(level, 0.0, 1.0)


def _is_simple(brush: Brush) -> bool:
    """Whether a brush at one place draws a point, a circle or a line of a Tacton."""
    size, f_d = 2e-3 * brush.numbers[0], brush.drawing_frequency
    return brush.name != "lissajous" and 0 <= size <= LARGEST_SIZE and f_d >= 0


def _constant(brush: Brush, place: Floats, notes: list[str]) -> Tacton:
    """Return the Tacton of a simple brush at a place in mm."""
    (x, y), size, f_d = place[:2] / 1e3, brush.numbers[0] / 1e3, brush.drawing_frequency
    path = Trajectory(centre=(x, y))
    if size and brush.name == "circle":
        path = Trajectory(shape="circle", size=2 * size, speed=2 * pi * size * f_d, centre=(x, y))
    elif size:
        angle = radians(brush.numbers[1])
        dx, dy = size * cos(angle), size * sin(angle)
        ends = ((x + dx, y + dy), (x - dx, y - dy))
        path = Trajectory(shape="polyline", sweep="sinusoidal", points=ends, speed=4 * size * f_d)
        notes.append("the line has a sinusoidal sweep over twice the length in the file")
    return Tacton(am_frequency=brush.am_frequency, trajectory=path)


def _at(track: Track, t: Floats) -> Floats:
    """Return values (t, k) of a track of numbers, or of k numbers each."""
    values = np.array(track.values).reshape(len(track.values), -1)
    before, part = _keyframe_before(track, t)
    after = np.minimum(before + 1, len(values) - 1)
    return np.asarray(values[before] + part[:, None] * (values[after] - values[before]))


def _keyframe_before(track: Track, t: Floats) -> tuple[np.ndarray, Floats]:
    """Return the index of the last keyframe, and the fraction of the way to the next."""
    times = np.array(track.times)
    before = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 1)
    after = np.minimum(before + 1, len(times) - 1)
    span = np.maximum(times[after] - times[before], 1e-12)
    part = np.clip((t - times[before]) / span, 0.0, 1.0)
    return before, np.where(np.array(track.steps)[before] | (after == before), 0.0, part)


def _brush_at(track: Track, p: Floats, t: Floats) -> tuple[Floats, Floats]:
    """Return offsets (t, 2) in mm of the focus, and cycles (t,) of the AM, at times p (t,) of the
    track and t (t,) of the clock in s.

    Between brushes of one kind all numbers are interpolated, for a lissajous only the rotation.
    Before a brush of another kind, a brush stays constant.
    """
    before, part = _keyframe_before(track, p)
    offset, cycles = np.zeros((len(t), 2)), np.zeros(len(t))
    for k in np.unique(before):
        mine, brush = before == k, track.values[k]
        start = np.array([brush.am_frequency, *brush.numbers])
        end = start.copy()
        if k + 1 < len(track.values) and (after := track.values[k + 1]).name == brush.name:
            part_of = slice(-1, None) if brush.name == "lissajous" else slice(None)
            end[0], end[1:][part_of] = after.am_frequency, after.numbers[part_of]
        am, *numbers = start[:, None] + part[mine] * (end - start)[:, None]
        cycles[mine] = am * t[mine]
        offset[mine] = _offset(brush.name, brush.drawing_frequency * t[mine], numbers)
    return offset, cycles


def _offset(name: str, cycles: Floats, numbers: list[Floats]) -> Floats:
    """Return the offsets (t, 2) in mm of a brush after cycles (t,)."""
    u = 2 * pi * np.mod(cycles, 1.0)
    if name == "circle":
        return numbers[0][:, None] * np.stack([np.cos(u), np.sin(u)], axis=-1)
    if name == "line":
        x, y, angle = numbers[0] * np.cos(u), np.zeros_like(u), np.radians(numbers[1])
    else:
        x_scale, y_scale, a, b, d, angle = numbers
        x, y = x_scale * np.sin(a * u + d), y_scale * np.sin(b * u)
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


register(PATTERN_READERS, ".adaptics", function=read)
