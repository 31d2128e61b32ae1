"""AdapTics patterns as Tactons, and back.

The engine draws a brush about a place that moves from keyframe to keyframe: with u = 2 pi f_d t

    circle     x = r cos u,           y = r sin u
    line       x = L cos u,           y = 0, turned; L is half the span, the speed no constant
    lissajous  x = X sin(a u + d),    y = Y sin(b u), turned; u begins anew at 2 pi

and lets the sound pressure follow intensity (1 + cos(2 pi f_AM t))/2. A brush that stays the same
at one place becomes a circle, or a line that is swept as a cosine; anything else a path recorded
at the engine's 20 kHz.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import cos, pi, radians, sin
from typing import Any

import numpy as np

from meshes.tetmesh import Floats
from simple_model import Tacton, Trajectory
from simple_model.tacton import LONGEST
from skinwave.patterns.adaptics_file import Animation, Brush, Track, parse
from skinwave.patterns.focal_points import recorded
from skinwave.patterns.pattern import Options, Pattern, one_height

ENGINE_RATE = 20_000.0  # Hz
UNBOUNDED = 1.0  # s that stand for a pattern that nothing ends
NONE = Brush(name="circle", numbers=(0.0,), am_frequency=0.0, drawing_frequency=100.0)


def read(content: bytes, options: Options) -> Pattern:
    """The pattern in an .adaptics file.

    Raises
    ------
    ValueError
        If it is none, or has what depends on who plays it.
    """
    animation = parse(content)
    notes = list(animation.notes)
    duration = animation.duration
    if duration == 0:
        duration = UNBOUNDED
        notes.append(f"the pattern has no end: {UNBOUNDED:g} s of it")
    if duration > LONGEST:
        raise ValueError(f"the pattern lasts {duration:g} s, longer than {LONGEST:g} s; cut it")
    places = np.array(animation.places.values or ((0.0, 0.0, 200.0),))
    height = one_height(places[:, 2] / 1e3, options, notes)
    if "height" not in height and options.height is None:
        height = {"height": 0.0}  # on the array itself, which is refused with the limits
    steady = _steady(animation)
    if steady is None:
        tacton = _played(animation, duration, notes)
        pressure: dict[str, Any] = {"drive": "pressure_squared"}
    else:
        brush, place, intensity = steady
        tacton = _drawn(brush, place, notes)
        tacton = replace(tacton, amplitude=_within(intensity, notes), duration=duration)
        pressure = {"drive": "pressure_squared"}
        if brush.am_frequency:
            pressure["depth_of_modulation"] = 1.0
            notes.append("AM begins at its mean, a quarter of its period behind the engine's")
    return Pattern(
        tacton=tacton, pressure=pressure | height, name=animation.name, notes=tuple(notes)
    )


def _steady(animation: Animation) -> tuple[Brush, Sequence[float], float] | None:
    """Brush, place and intensity of a pattern in which they stay the same."""
    for track in (animation.places, animation.brushes, animation.intensities):
        if len(set(track.values)) > 1 or (track.times and track.times[0] > 0):
            return None
    brush = animation.brushes.values[0] if animation.brushes.values else NONE
    if brush.name == "lissajous":
        return None
    place = animation.places.values[0] if animation.places.values else (0.0, 0.0)
    intensity = animation.intensities.values[0] if animation.intensities.values else 1.0
    return brush, place, intensity * animation.factor


def _within(intensity: float, notes: list[str]) -> float:
    if not 0 <= intensity <= 1:
        notes.append(f"intensity {intensity:g} is cut to 0..1, what a device gives")
    return min(max(intensity, 0.0), 1.0)


def _drawn(brush: Brush, place: Sequence[float], notes: list[str]) -> Tacton:
    """The Tacton of a circle or line brush at a place in millimetre."""
    x, y, size = place[0] / 1e3, place[1] / 1e3, brush.numbers[0] / 1e3
    f_d = brush.drawing_frequency
    if f_d < 0:
        raise ValueError(f"stm_freq = {f_d:g} Hz must be 0 or above")
    if size == 0:
        path = Trajectory(centre=(x, y))
    elif brush.name == "circle":
        path = Trajectory(
            shape="circle", size=2 * abs(size), speed=2 * pi * abs(size) * f_d, centre=(x, y)
        )
        if size < 0:
            raise ValueError(f"radius = {brush.numbers[0]:g} mm must be 0 or above")
    else:
        turn = radians(brush.numbers[1])
        dx, dy = size * cos(turn), size * sin(turn)
        path = Trajectory(
            shape="polyline",
            sweep="sinusoidal",
            points=((x + dx, y + dy), (x - dx, y - dy)),
            speed=4 * abs(size) * f_d,
        )
        notes.append("the line is swept as a cosine, over twice what the file calls its length")
    return Tacton(am_frequency=brush.am_frequency, trajectory=path)


def _played(animation: Animation, duration: float, notes: list[str]) -> Tacton:
    """Samples that the engine would send to a device."""
    t = np.arange(max(2, round(duration * ENGINE_RATE))) / ENGINE_RATE
    brush, drawing = _brush_at(animation.brushes, t)
    place = _at(animation.places, np.array(animation.places.values or [(0.0, 0.0, 0.0)]), t)
    intensity = np.array(animation.intensities.values or [1.0])
    level = animation.factor * _at(animation.intensities, intensity[:, None], t)[:, 0]
    level = level * (1 + np.cos(2 * pi * drawing[:, 0] * t)) / 2
    if level.min() < 0 or level.max() > 1:
        notes.append(
            f"intensity from {level.min():.3g} to {level.max():.3g} is cut to 0..1, what a device "
            "gives"
        )
    if any(b.name == "lissajous" and b.numbers[5] for b in animation.brushes.values):
        notes.append("rotation of a lissajous is taken in radians, as the engine does")
    notes.append(f"recorded at {ENGINE_RATE:g} Hz, as the engine plays it")
    places = (place[:, :2] + brush) / 1e3
    return recorded(t, places[None], np.clip(level, 0, 1)[None])


def _at(track: Track, values: Floats, t: Floats) -> Floats:
    """Values (t, k) of a track that sets values (n, k)."""
    if len(values) < 2:
        return np.repeat(values, len(t), axis=0)
    before, part = _between(track, t)
    after = np.minimum(before + 1, len(values) - 1)
    return np.asarray(values[before] + part[:, None] * (values[after] - values[before]))


def _between(track: Track, t: Floats) -> tuple[np.ndarray, Floats]:
    """Index of the last keyframe, and the fraction of the way to the next."""
    times = np.array(track.times)
    before = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 1)
    after = np.minimum(before + 1, len(times) - 1)
    span = np.maximum(times[after] - times[before], 1e-12)
    part = np.clip((t - times[before]) / span, 0.0, 1.0)
    return before, np.where(np.array(track.steps)[before] | (after == before), 0.0, part)


def _brush_at(track: Track, t: Floats) -> tuple[Floats, Floats]:
    """Offsets (t, 2) in millimetre that the brush draws, and its frequencies (t, 2): AM, drawing.

    Brushes of one kind turn into each other; of two kinds the earlier one stays.
    """
    brushes = list(track.values) or [NONE]
    if len(brushes) == 1:
        before, part = np.zeros(len(t), int), np.zeros(len(t))
    else:
        before, part = _between(track, t)
    offset, frequencies = np.zeros((len(t), 2)), np.zeros((len(t), 2))
    for k, brush in enumerate(brushes):
        mine = before == k
        start = np.array([brush.am_frequency, brush.drawing_frequency, *brush.numbers])
        end = start
        if k + 1 < len(brushes) and (after := brushes[k + 1]).name == brush.name:
            end = np.array([after.am_frequency, after.drawing_frequency, *after.numbers])
        now = start[:, None] + part[mine] * (end - start)[:, None]
        frequencies[mine] = now[:2].T
        offset[mine] = _offset(brush.name, now[1], now[2:], t[mine])
    if track.times and track.times[0] > 0:  # no brush yet
        offset[t < track.times[0]], frequencies[t < track.times[0]] = 0.0, 0.0
    return offset, frequencies


def _offset(name: str, f_d: Floats, numbers: Floats, t: Floats) -> Floats:
    """Offsets (t, 2) in millimetre that a brush draws."""
    u = 2 * pi * np.mod(f_d * t, 1.0)
    if name == "circle":
        return numbers[0][:, None] * np.stack([np.cos(u), np.sin(u)], axis=-1)
    if name == "line":
        x, y, turn = numbers[0] * np.cos(u), np.zeros_like(u), np.radians(numbers[1])
    else:
        x_scale, y_scale, a, b, d, turn = numbers
        x, y = x_scale * np.sin(a * u + d), y_scale * np.sin(b * u)
    c, s = np.cos(turn), np.sin(turn)
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)
