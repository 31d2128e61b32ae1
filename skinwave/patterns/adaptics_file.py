"""Reader of .adaptics files of the AdapTics designer and engine (CHI '24): keyframes, numbers with
parameters, brushes. Units are ms, mm and Hz.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from math import cos, radians, sin
from operator import add, ge, gt, le, lt, mul, sub, truediv
from typing import Any

from meshes import reading
from simple_model.choices import choose
from skinwave.system.json_kinds import is_finite_number

FORMAT = "MidAirHapticsAnimationFileFormat"
REVISIONS = ("0.0.10-alpha.1", "0.1.0-alpha.2", "0.1.0-alpha.3")
DRAWING_FREQUENCY = 100.0  # Hz, of a brush without one
BRUSHES = {
    "circle": ("radius",),
    "line": ("length", "rotation"),
    "lissajous": ("x_scale", "y_scale", "a", "b", "d", "rotation"),
}
Table = Mapping[str, Any]  # a JSON object
Entry = tuple[float, Any, bool]  # of a track: time in s, value, whether it stays until the next


@dataclass(frozen=True, kw_only=True)
class Brush:
    """Figure about a place: its name, numbers in the order of `BRUSHES`, and frequencies in Hz."""

    name: str
    numbers: tuple[float, ...]
    am_frequency: float
    drawing_frequency: float


@dataclass(frozen=True, kw_only=True)
class Track:
    """Keyframes of one quantity: times in s, values, and whether each is held until the next."""

    times: tuple[float, ...]
    values: tuple[Any, ...]
    steps: tuple[bool, ...]


@dataclass(frozen=True, kw_only=True)
class Animation:
    """Contents of a file for given values of its parameters.

    The tracks have places (x, y, z) in mm above the array, brushes, and intensities, which a
    `factor` multiplies. `runs` are intervals (start, end) in s in the order of playback. After the
    last run, those from index `loop` repeat endlessly, unless it is None.
    """

    name: str
    places: Track
    brushes: Track
    intensities: Track
    factor: float
    runs: tuple[tuple[float, float], ...]
    loop: int | None
    notes: tuple[str, ...]


def parse(content: bytes, parameters: Mapping[str, float]) -> Animation:
    """Parse a file; `parameters` replace the default values of its parameters."""
    try:
        table = json.loads(reading.decode(content))
    except (ValueError, RecursionError) as error:
        place = f" at line {error.lineno}" if isinstance(error, json.JSONDecodeError) else ""
        raise ValueError(f"the file is not valid JSON{place}; save it with AdapTics") from None
    if not isinstance(table, dict) or table.get("$DATA_FORMAT") != FORMAT:
        raise ValueError(f"the file is not an AdapTics pattern: $DATA_FORMAT must be '{FORMAT}'")
    if (revision := table.get("$REVISION")) not in REVISIONS:
        raise ValueError(
            f"revision {str(revision)[:40]!r} is unknown; save it as one of {', '.join(REVISIONS)}"
        )
    definitions = _child(table, "user_parameter_definitions", dict, {})
    return _animation(table, _Numbers(definitions, parameters))


class _Numbers:
    """Numbers of a file for given values of its parameters, with a note for each parameter used."""

    def __init__(self, definitions: Table, given: Mapping[str, float]) -> None:
        self._definitions, self._given = definitions, given
        self.notes: dict[str, str] = {}

    def __call__(self, value: Any, name: str) -> float:
        """Return the number of a value: plain, from a parameter, or from a formula."""
        if not isinstance(value, dict) or "value" not in value:
            return _finite(value, name)
        kind, inner = str(value.get("type")).lower(), value["value"]
        if kind in ("f64", "constant"):
            return _finite(inner, name)
        if kind in ("param", "dynamic", "parameter"):
            return self._parameter(inner)
        if kind == "formula":
            return _finite(self(inner, name), name)
        if kind == "negate":
            return -self(inner, name)
        arithmetic = {"add": add, "subtract": sub, "multiply": mul, "divide": truediv}
        if kind not in arithmetic or not isinstance(inner, list) or len(inner) != 2:
            raise ValueError(f"{name} has the type '{kind[:40]}'; use f64, param or formula")
        try:
            return float(arithmetic[kind](*(self(part, name) for part in inner)))
        except ZeroDivisionError:
            raise ValueError(f"{name} divides by 0; change the value of the parameter") from None

    def is_met(self, condition: Table) -> bool:
        """Whether the condition of a jump is met; never for a parameter without a value."""
        operator, parameter = condition.get("operator"), condition.get("parameter")
        word = operator.get("name") if isinstance(operator, dict) else operator
        operators = {"lt": lt, "lt_eq": le, "gt": gt, "gt_eq": ge}
        compare = operators[choose("operator of a jump", str(word)[:40], operators)]
        limit = _finite(condition.get("value"), "value of a jump's condition")
        if not isinstance(parameter, str) or parameter not in {**self._definitions, **self._given}:
            return False
        return bool(compare(self._parameter(parameter), limit))

    def check_parameters(self) -> None:
        """Raise a ValueError if a value was given for a parameter that the file does not have."""
        known = list({**self._definitions, **self.notes})
        if self._given and not known:
            raise ValueError("the file has no parameters; remove --parameter")
        for name in self._given:
            choose("parameter", name, known)

    def _parameter(self, name: Any) -> float:
        definition = self._definitions.get(name, {}) if isinstance(name, str) else {}
        is_given = name in self._given
        if not definition and not is_given:
            raise ValueError(f"parameter {str(name)[:40]!r} has no definition; define its default")
        title = f"parameter '{name[:40]}'"
        default = _check(definition, title).get("default")
        given = value = _finite(self._given.get(name, default), f"default of {title}")
        for key, bound in (("min", max), ("max", min)):
            if definition.get(key) is not None:
                value = bound(value, _finite(definition[key], f"{key} of {title}"))
        source = " =" if is_given else " at its default,"
        limit = ", the nearest value in its range" if value != given and is_given else ""
        self.notes[name] = f"{title}{source} {value:g}{limit}"
        return value


def _animation(table: Table, number: _Numbers) -> Animation:
    transform = _child(table, "pattern_transform", dict, {})
    speed = number(transform.get("playback_speed", 1.0), "playback_speed")
    if speed <= 0:
        raise ValueError(f"playback_speed is {speed:g}; give a number above 0")
    tracks: dict[str, list[Entry]] = {key: [] for key in SETTINGS}
    jumps: list[tuple[float, float]] = []  # time of a jump, and its target
    kinds: dict[float, str] = {}  # of the last keyframe at a time
    for time, frame in _keyframes(table, speed):
        kind = choose(
            "type of a keyframe", str(frame.get("type"))[:40], ("standard", "pause", "stop")
        )
        kinds[time] = kind
        for key, track in tracks.items():
            is_set = kind != "stop" and frame.get(key) is not None
            if key == "coords":
                is_set = kind == "standard"
            if is_set:
                track.append((time, *_setting(frame, key, number)))
            elif track and (key == "coords" or kind == "stop"):
                track.append((time, *track[-1][1:]))
        if kind != "stop" and (target := _jump(frame, number)) is not None:
            jumps.append((time, target / speed))
    runs, loop = _runs(kinds, jumps)
    places = _track(tracks["coords"], (0.0, 0.0, 0.0))
    geometry = _child(transform, "geometric_transforms", dict, {})
    factor = number(transform.get("intensity_factor", 1.0), "intensity_factor")
    number.check_parameters()
    point = Brush(name="circle", numbers=(0.0,), am_frequency=0.0, drawing_frequency=0.0)
    notes = list(number.notes.values())
    if speed != 1:
        notes.append(f"playback at {speed:g} times the speed; drawing frequencies do not change")
    return Animation(
        name=str(table.get("name", ""))[:80], brushes=_track(tracks["brush"], point),
        places=replace(places, values=_transform(places.values, geometry, number)),
        intensities=_track(tracks["intensity"], 0.0), factor=factor, runs=runs, loop=loop,
        notes=tuple(notes),
    )  # fmt: skip


def _keyframes(table: Table, speed: float) -> list[tuple[float, Table]]:
    """Return times in s and keyframes in the order of time."""
    keyframes = _child(table, "keyframes", list)
    if not keyframes:
        raise ValueError("the file has no keyframes; add at least one")
    times = [_finite(_check(each, "a keyframe").get("time"), "time of a keyframe")
             for each in keyframes]  # fmt: skip
    found = [(time / 1e3 / speed, each) for time, each in zip(times, keyframes, strict=True)]
    found.sort(key=lambda pair: pair[0])
    if found[0][0] < 0:
        raise ValueError(f"a keyframe is at {1e3 * found[0][0]:g} ms; move it to 0 ms or later")
    return found


def _track(entries: list[Entry], first: Any) -> Track:
    """Return a track; as in the engine, it has the value `first` until its first keyframe."""
    if not entries or entries[0][0] > 0:
        entries = [(0.0, first, True), *entries]
    times, values, steps = zip(*entries, strict=True)
    return Track(times=times, values=values, steps=steps)


def _jump(frame: Table, number: _Numbers) -> float | None:
    """Return the target in s, at speed 1, of the first jump whose condition is met."""
    for each in _child(frame, "cjumps", list, []) or []:
        jump = _check(each, "a conditional jump")
        if number.is_met(_child(jump, "condition", dict, {})):
            return _finite(jump.get("jump_to"), "jump_to of a jump") / 1e3
    return None


def _runs(
    kinds: dict[float, str], jumps: list[tuple[float, float]]
) -> tuple[tuple[tuple[float, float], ...], int | None]:
    """Return runs and loop of an `Animation`, given the kind of keyframe at each time and jumps.

    Playback jumps or stops when it passes the time of a keyframe, not if it begins there. A jump
    precedes a stop at the same time. The pattern ends after a jump into a stopped part.
    """
    runs: list[tuple[float, float]] = []
    entered: dict[float, int] = {}
    stops = [time for time, kind in kinds.items() if kind == "stop"]
    start: float | None = 0.0
    while start is not None and start not in entered:
        entered[start] = len(runs)
        if runs and max((time for time in kinds if time <= start), default=None) in stops:
            return tuple(runs), None
        stop = min((time for time in stops if time > start), default=max(start, *kinds))
        end, target = next(((t, to) for t, to in jumps if start < t <= stop), (stop, None))
        runs.append((start, end))
        start = target
    return tuple(runs), None if start is None else entered[start]


def _setting(frame: Table, key: str, number: _Numbers) -> tuple[Any, bool]:
    """Return the value that a keyframe sets, and whether it is held until the next one."""
    outer = _child(frame, key, dict)
    transition = _child(outer, "transition", dict, {"name": "linear"}).get("name")
    step = choose(f"transition of {key}", str(transition)[:40], ("linear", "step")) == "step"
    return SETTINGS[key](_child(outer, key, dict), number), step


def _place(place: Table, number: _Numbers) -> tuple[float, ...]:
    return tuple(_finite(place.get(axis), f"coords {axis}") for axis in "xyz")


def _brush(brush: Table, number: _Numbers) -> Brush:
    name = choose("brush", str(brush.get("name"))[:40], BRUSHES)
    params = _child(brush, "params", dict)
    am, drawing = params.get("am_freq", 0.0), params.get("stm_freq", DRAWING_FREQUENCY)
    return Brush(
        name=name,
        numbers=tuple(number(params.get(key), f"{key} of a {name}") for key in BRUSHES[name]),
        am_frequency=number(am, f"am_freq of a {name}"),
        drawing_frequency=number(drawing, f"stm_freq of a {name}"),
    )


def _intensity(intensity: Table, number: _Numbers) -> float:
    if (name := intensity.get("name")) != "constant":
        cause = "different at each playback" if name == "random" else "unknown"
        raise ValueError(f"intensity {str(name)[:40]!r} is {cause}; make it constant")
    return number(_child(intensity, "params", dict).get("value"), "value of an intensity")


SETTINGS: dict[str, Callable[[Table, _Numbers], Any]] = {
    "coords": _place, "brush": _brush, "intensity": _intensity,
}  # fmt: skip


def _transform(
    places: Iterable[tuple[float, ...]], transform: Table, number: _Numbers
) -> tuple[tuple[float, ...], ...]:
    """Scale, rotate and move places, in this order; brushes stay the same."""
    scale, move = (_child(transform, key, dict, {}) for key in ("scale", "translate"))
    sx, sy, sz = (number(scale.get(a, 1.0), f"scale {a}") for a in "xyz")
    dx, dy, dz = (number(move.get(a, 200.0 * (a == "z")), f"translate {a}") for a in "xyz")
    angle = radians(number(transform.get("rotation", 0.0), "rotation"))
    c, s = cos(angle), sin(angle)
    return tuple(
        (c * sx * x - s * sy * y + dx, s * sx * x + c * sy * y + dy, sz * z + dz)
        for x, y, z in places
    )


def _child(table: Table, key: str, kind: type, default: Any = None) -> Any:
    return _check(table.get(key, default), key, kind)


def _check(value: Any, name: str, kind: type = dict) -> Any:
    if not isinstance(value, kind):
        word = "an object" if kind is dict else "a list"
        raise ValueError(f"{name} is {json.dumps(value)[:40]}; it must be {word}")
    return value


def _finite(value: Any, name: str) -> float:
    if not is_finite_number(value):
        raise ValueError(f"{name} is {json.dumps(value)[:40]}; it must be a finite number")
    return float(value)
