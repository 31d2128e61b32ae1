"""Writer of AdapTics patterns: circles and cosine lines as brushes, other paths as keyframes."""

import json
from math import atan2, degrees, hypot
from typing import Any

import numpy as np

from simple_model import Tacton
from skinwave.patterns.adaptics_file import DRAWING_FREQUENCY, FORMAT, REVISIONS
from skinwave.patterns.pattern import ENGINE_RATE, STRAIGHT, Options, loudness, thin
from skinwave.scene.scene import Scene
from skinwave.system.formats import PATTERN_WRITERS, register
from skinwave.typing import Floats


def write(scene: Scene, options: Options) -> tuple[bytes, tuple[str, ...]]:
    """Return the .adaptics file of a scene's Tacton, in the newest revision, and notes."""
    tacton, notes = scene.tacton, []
    _check(scene)
    amplitude = tacton.amplitude
    if tacton.am_frequency:
        notes.append("AM starts at its maximum in AdapTics, and at its mean here")
    else:
        amplitude = float(loudness(scene.pressure, np.zeros(1))[0])
    brush, place = _brush(tacton)
    if brush is None:
        brush = _figure("circle", {"radius": 0.0}, tacton, 0.0)
        times, places, levels = _path(scene)
        notes.append(f"{len(times)} keyframes, within {1e3 * STRAIGHT[0]:g} mm of the path")
    else:
        times, places = np.array([0.0, tacton.duration]), np.array([place, place])
        levels = np.ones(2)
    keyframes = [
        _keyframe(t, xy, amplitude * level, brush)
        for t, xy, level in zip(times, places, levels, strict=True)
    ]
    keyframes.append({"type": "stop", "time": 1e3 * tacton.duration})
    transforms = {
        "translate": {"x": _f64(0), "y": _f64(0), "z": _f64(1e3 * scene.pressure.height)},
        "rotation": _f64(0), "scale": dict.fromkeys("xyz", _f64(1)),
    }  # fmt: skip
    table = {
        "$DATA_FORMAT": FORMAT, "$REVISION": REVISIONS[-1], "name": scene.name,
        "keyframes": keyframes, "user_parameter_definitions": {},
        "pattern_transform": {
            "geometric_transforms": transforms, "intensity_factor": _f64(1),
            "playback_speed": _f64(1),
        },
    }  # fmt: skip
    return json.dumps(table, indent=1).encode(), tuple(notes)


def _check(scene: Scene) -> None:
    """Raise a ValueError for a scene that the format cannot express."""
    tacton, pressure = scene.tacton, scene.pressure
    unsupported = {
        "several foci": len(tacton.foci) > 1,
        "a second AM frequency": tacton.superposition[1] > 0 and tacton.second_am_frequency > 0,
        "a superposition of AM": tacton.superposition[1] > 0 and tacton.am_frequency > 0,
        "an envelope frequency": tacton.envelope_frequency > 0,
        "a rhythm": tacton.rhythm is not None,
        "a sampled signal": tacton.signal is not None,
    }
    for part, is_there in unsupported.items():
        if is_there:
            raise ValueError(f".adaptics cannot express {part}; write .csv, or remove it")
    if tacton.am_frequency:
        M = np.linspace(-1, 1, 9)  # the engine's sound pressure is (1 + M) / 2
        load = pressure.law(1.0, M, pressure.depth_of_modulation)
        if not np.allclose(load, ((1 + M) / 2) ** 2):
            raise ValueError(
                f"AdapTics modulates the sound pressure fully, but the drive '{pressure.drive}' "
                f"with depth {pressure.depth_of_modulation:g} does not; use 'pressure_squared' "
                "with depth 1"
            )


def _path(scene: Scene, most_keyframes: int = 20_000) -> tuple[Floats, Floats, Floats]:
    """Return times (k,) in s, places (k, 2) in m and levels (k,) of the keyframes of a path."""
    path, end = scene.tacton.trajectory, scene.tacton.duration
    f_d, ahead = path.drawing_frequency, scene.tacton.foci[0]
    corners = np.add.outer(np.arange(int(end * f_d) + 3) - 1, path.parts[0]).ravel() - ahead
    aside = 1e-9  # of a period: keyframes on both sides of a corner keep jumps sharp
    sides = np.concatenate([corners - aside, corners + aside]) / f_d
    times = np.union1d(np.linspace(0.0, end, round(end * ENGINE_RATE) + 1), sides)
    times = times[(times >= 0) & (times <= end)]
    phases = np.mod(f_d * times + ahead, 1.0)
    places, levels = path.at_phase(phases), np.sqrt(scene.pressure.weight(phases))
    kept = thin(times, places, levels)
    if len(kept) > most_keyframes:
        raise ValueError(
            f"the path of {end:g} s needs {len(kept):,} keyframes, more than {most_keyframes:,}; "
            "shorten the Tacton, or write .csv"
        )
    return times[kept], places[kept], levels[kept]


def _brush(tacton: Tacton) -> tuple[dict[str, Any] | None, tuple[float, float]]:
    """Return the brush that draws a path, or None, and its place in m."""
    path = tacton.trajectory
    if path.shape == "circle" and tacton.foci[0] == 0:
        radius = {"radius": 1e3 * path.size / 2}
        return _figure("circle", radius, tacton, path.drawing_frequency), path.centre
    if path.shape == "point" or (path.is_static and path.shape != "recorded"):
        x, y = path.position(0.0).tolist()
        return _figure("circle", {"radius": 0.0}, tacton, DRAWING_FREQUENCY), (x, y)
    straight = path.shape == "line" or (path.shape == "polyline" and len(path.outline) == 2)
    if not straight or path.sweep != "sinusoidal" or tacton.foci[0] != 0:
        return None, path.centre
    first, last = path.at_phase([0.0, 0.5])
    (x, y), (dx, dy) = (first + last) / 2, (first - last) / 2
    numbers = {"length": 1e3 * hypot(dx, dy), "thickness": 1.0, "rotation": degrees(atan2(dy, dx))}
    return _figure("line", numbers, tacton, path.drawing_frequency), (float(x), float(y))


def _keyframe(t: float, place: Any, level: float, brush: dict[str, Any]) -> dict[str, Any]:
    x, y = (1e3 * float(each) for each in place)
    settings = {
        "brush": brush, "coords": {"x": x, "y": y, "z": 0.0},
        "intensity": {"name": "constant", "params": {"value": _f64(level)}},
    }  # fmt: skip
    linear = {"name": "linear", "params": {}}
    return {"type": "standard", "time": 1e3 * float(t), "cjumps": []} | {
        key: {key: value, "transition": linear} for key, value in settings.items()
    }


def _figure(name: str, numbers: dict[str, float], tacton: Tacton, f_d: float) -> dict[str, Any]:
    numbers = {**numbers, "am_freq": tacton.am_frequency, "stm_freq": f_d}
    return {"name": name, "params": {key: _f64(value) for key, value in numbers.items()}}


def _f64(value: float) -> dict[str, Any]:
    return {"type": "f64", "value": float(value)}


register(PATTERN_WRITERS, ".adaptics", function=write)
