"""An .adaptics file of the AdapTics designer and engine (CHI '24): keyframes, numbers with their
parameters, brushes. Millisecond, millimetre, Hz.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from math import cos, radians, sin
from operator import add, ge, gt, le, lt, mul, sub, truediv
from typing import Any

from simple_model.choices import choose
from skinwave.system.json_kinds import is_finite_number
from skinwave.system.plain_text import as_utf_8

FORMAT = "MidAirHapticsAnimationFileFormat"
REVISIONS = ("0.0.10-alpha.1", "0.1.0-alpha.2", "0.1.0-alpha.3")
DRAWN = 100.0  # Hz of a brush that does not say
KEYFRAMES = ("standard", "pause", "stop")
BRUSHES = {
    "circle": ("radius",),
    "line": ("length", "rotation"),
    "lissajous": ("x_scale", "y_scale", "a", "b", "d", "rotation"),
}
SUMS = {"add": add, "subtract": sub, "multiply": mul, "divide": truediv}
OPERATORS = {"lt": lt, "lt_eq": le, "gt": gt, "gt_eq": ge}


@dataclass(frozen=True, kw_only=True)
class Brush:
    """Figure drawn about a place: its name, numbers as `BRUSHES` names them, frequencies in Hz."""

    name: str
    numbers: tuple[float, ...]
    am_frequency: float
    drawing_frequency: float


NONE = Brush(name="circle", numbers=(0.0,), am_frequency=0.0, drawing_frequency=0.0)


@dataclass(frozen=True, kw_only=True)
class Track:
    """What keyframes set: times in s, values, and whether each stays until the next (`steps`)."""

    times: tuple[float, ...]
    values: tuple[Any, ...]
    steps: tuple[bool, ...]


@dataclass(frozen=True, kw_only=True)
class Animation:
    """A file at some values of its parameters.

    Tracks are of (x, y, z) in millimetre above the array, of brushes, and of intensities, which a
    `factor` multiplies. `runs` are parts (start, end) of them in s in the order in which they are
    played, `loop` is the index of the run that follows the last one for ever, None if none does.
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
    """The animation in a file at values of its parameters, by default its own."""
    try:
        table = json.loads(as_utf_8(content))
    except (ValueError, RecursionError) as error:
        at = f" at line {error.lineno}" if isinstance(error, json.JSONDecodeError) else ""
        raise ValueError(f"not valid JSON{at}; save it with AdapTics") from None
    if not isinstance(table, dict) or table.get("$DATA_FORMAT") != FORMAT:
        raise ValueError(f"not an .adaptics file: $DATA_FORMAT is not '{FORMAT}'")
    if (revision := table.get("$REVISION")) not in REVISIONS:
        raise ValueError(
            f"revision {str(revision)[:40]!r} is unknown; save it as one of {', '.join(REVISIONS)}"
        )
    definitions = _get(table, "user_parameter_definitions", dict, {})
    return _animation(table, _Numbers(definitions, parameters))


class _Numbers:
    """Numbers of a file at the values of its user parameters, with a note for each one used."""

    def __init__(self, definitions: Mapping[str, Any], given: Mapping[str, float]) -> None:
        self._definitions, self._given = definitions, given
        self.notes: dict[str, str] = {}

    def __call__(self, value: Any, what: str) -> float:
        if not isinstance(value, dict) or "value" not in value:
            return _finite(value, what)
        kind = value.get("type")
        if kind == "formula":
            return _finite(self._formula(value["value"], what), what)
        if kind in ("param", "dynamic"):
            return self._parameter(value["value"])
        if kind == "f64":
            return _finite(value["value"], what)
        raise ValueError(f"{what} has the type {str(kind)[:40]!r}; use f64, param or formula")

    def holds(self, condition: Mapping[str, Any]) -> bool:
        """Whether the condition of a jump is met; never by a parameter without a value."""
        operator, name = condition.get("operator"), condition.get("parameter")
        word = operator.get("name") if isinstance(operator, dict) else operator
        meets = OPERATORS[choose("operator of a jump", str(word)[:40], OPERATORS)]
        limit = _finite(condition.get("value"), "value of a jump's condition")
        if not isinstance(name, str) or name not in {**self._definitions, **self._given}:
            return False
        return bool(meets(self._parameter(name), limit))

    def check_used(self) -> None:
        """Refuse values of parameters that the file does not have."""
        known = list({**self._definitions, **self.notes})
        if self._given and not known:
            raise ValueError("the file has no parameters; leave out --parameter")
        for name in self._given:
            choose("parameter", name, known)

    def _parameter(self, name: Any) -> float:
        definition = self._definitions.get(name, {}) if isinstance(name, str) else {}
        if not definition and name not in self._given:
            raise ValueError(f"parameter {str(name)[:40]!r} is not defined; define its default")
        what = f"parameter '{name[:40]}'"
        default = _of(definition, what).get("default")
        given = value = _finite(self._given.get(name, default), f"default of {what}")
        for key, bound in (("min", max), ("max", min)):
            if definition.get(key) is not None:
                value = bound(value, _finite(definition[key], f"{key} of {what}"))
        said = " =" if name in self._given else " at its default,"
        cut = ", the nearest that the file allows" if value != given and name in self._given else ""
        self.notes[name] = f"{what}{said} {value:g}{cut}"
        return value

    def _formula(self, formula: Any, what: str) -> float:
        if not isinstance(formula, dict) or "value" not in formula:
            raise ValueError(f"{what} has a formula without type and value")
        kind, value = str(formula.get("type")).lower(), formula["value"]
        if kind == "constant":
            return _finite(value, what)
        if kind == "parameter":
            return self._parameter(value)
        if kind == "negate":
            return -self._formula(value, what)
        if kind not in SUMS or not isinstance(value, list) or len(value) != 2:
            raise ValueError(f"{what} has a formula of type '{kind[:40]}', which is unknown")
        try:
            return float(SUMS[kind](*(self._formula(part, what) for part in value)))
        except ZeroDivisionError:
            raise ValueError(f"{what} divides by 0; give the parameter another default") from None


def _animation(table: Mapping[str, Any], number: _Numbers) -> Animation:
    keyframes = _get(table, "keyframes", list)
    if not keyframes:
        raise ValueError("the file has no keyframes; give at least one")
    transform = _get(table, "pattern_transform", dict, {})
    speed = number(transform.get("playback_speed", 1.0), "playback_speed")
    if speed <= 0:
        raise ValueError(f"playback_speed = {speed:g} must be above 0")
    frames = sorted(
        (_finite(_of(f, "a keyframe").get("time"), "time of a keyframe") / 1e3 / speed, k, f)
        for k, f in enumerate(keyframes)
    )
    if frames[0][0] < 0:
        raise ValueError(f"a keyframe is at {1e3 * frames[0][0]:g} ms, before the start; move it")
    # Of each track: time, value, whether it is a step.
    tracks: dict[str, list[tuple[float, Any, bool]]] = {key: [] for key in SETTINGS}
    jumps: list[tuple[float, float]] = []  # when, and where to
    kinds: dict[float, str] = {}  # of the last keyframe at a time
    for time, _, frame in frames:
        kind = choose("type of a keyframe", str(frame.get("type"))[:40], KEYFRAMES)
        kinds[time] = kind
        for key, track in tracks.items():
            stays = kind == "stop" or frame.get(key) is None
            if key == "coords":
                stays = kind != "standard"
            if not stays:
                track.append((time, *_setting(frame, key, number)))
            elif track and (key == "coords" or kind == "stop"):
                track.append((time, *track[-1][1:]))
        if kind != "stop":
            jumps += [(time, to / speed) for to in _jump(frame, number)]
    runs, loop = _runs(kinds, jumps)
    path = _track(tracks["coords"], (0.0, 0.0, 0.0))
    moved = _get(transform, "geometric_transforms", dict, {})
    factor = number(transform.get("intensity_factor", 1.0), "intensity_factor")
    number.check_used()
    notes = list(number.notes.values())
    if speed != 1:
        notes.append(f"played at {speed:g} times the speed, brushes drawn at their own")
    return Animation(
        name=str(table.get("name", ""))[:80], brushes=_track(tracks["brush"], NONE),
        places=replace(path, values=_transformed(path.values, moved, number)),
        intensities=_track(tracks["intensity"], 0.0), factor=factor, runs=runs, loop=loop,
        notes=tuple(notes),
    )  # fmt: skip


def _track(entries: list[tuple[float, Any, bool]], none: Any) -> Track:
    """A track; until its first keyframe it has the value `none`, as the engine plays it."""
    if not entries or entries[0][0] > 0:
        entries = [(0.0, none, True), *entries]
    times, values, steps = zip(*entries, strict=True)
    return Track(times=times, values=values, steps=steps)


def _jump(frame: Mapping[str, Any], number: _Numbers) -> list[float]:
    """Time in s, at speed 1, that the first jump of a keyframe goes to whose condition is met."""
    jumps = (_of(each, "a conditional jump") for each in _get(frame, "cjumps", list, []) or [])
    met = (each for each in jumps if number.holds(_get(each, "condition", dict, {})))
    return [_finite(each.get("jump_to"), "jump_to of a jump") / 1e3 for each in islice(met, 1)]


def _runs(
    kinds: dict[float, str], jumps: list[tuple[float, float]]
) -> tuple[tuple[tuple[float, float], ...], int | None]:
    """Runs and loop of an `Animation` by the kind of keyframe at a time, and jumps: when, whereto.

    A jump or a stop is met when the time passes its keyframe, a jump first; where playback begins
    neither is. After a jump to where a stop is in force the pattern ends.
    """
    runs: list[tuple[float, float]] = []
    entered: dict[float, int] = {}
    stops = [time for time, kind in kinds.items() if kind == "stop"]
    at: float | None = 0.0
    while at is not None and at not in entered:
        entered[at] = len(runs)
        if runs and max((time for time in kinds if time <= at), default=None) in stops:
            return tuple(runs), None
        stop = min((time for time in stops if time > at), default=max(at, *kinds))
        end, to = next(((t, to) for t, to in jumps if at < t <= stop), (stop, None))
        runs.append((at, end))
        at = to
    return tuple(runs), None if at is None else entered[at]


def _setting(frame: Mapping[str, Any], key: str, number: _Numbers) -> tuple[Any, bool]:
    """Value that a keyframe sets, and whether it stays until the next one sets it anew."""
    outer = _get(frame, key, dict)
    transition = _get(outer, "transition", dict, {"name": "linear"}).get("name")
    step = choose(f"transition of {key}", str(transition)[:40], ("linear", "step")) == "step"
    return SETTINGS[key](_get(outer, key, dict), number), step


def _place(place: Mapping[str, Any], number: _Numbers) -> tuple[float, ...]:
    return tuple(_finite(place.get(axis), f"coords {axis}") for axis in "xyz")


def _brush(brush: Mapping[str, Any], number: _Numbers) -> Brush:
    name = choose("brush", str(brush.get("name"))[:40], BRUSHES)
    params = _get(brush, "params", dict)
    return Brush(
        name=name,
        numbers=tuple(number(params.get(key), f"{key} of a {name}") for key in BRUSHES[name]),
        am_frequency=number(params.get("am_freq", 0.0), f"am_freq of a {name}"),
        drawing_frequency=number(params.get("stm_freq", DRAWN), f"stm_freq of a {name}"),
    )


def _intensity(intensity: Mapping[str, Any], number: _Numbers) -> float:
    if (name := intensity.get("name")) != "constant":
        why = "another one each time" if name == "random" else "unknown"
        raise ValueError(f"intensity {str(name)[:40]!r} is {why}; make it constant")
    return number(_get(intensity, "params", dict).get("value"), "value of an intensity")


SETTINGS: dict[str, Callable[[Mapping[str, Any], _Numbers], Any]] = {
    "coords": _place, "brush": _brush, "intensity": _intensity,
}  # fmt: skip


def _transformed(
    values: Iterable[tuple[float, ...]], transform: Mapping[str, Any], number: _Numbers
) -> tuple[tuple[float, ...], ...]:
    """Places scaled, turned and moved, in that order; brushes are not."""
    scale, move = (_get(transform, key, dict, {}) for key in ("scale", "translate"))
    sx, sy, sz = (number(scale.get(a, 1.0), f"scale {a}") for a in "xyz")
    dx, dy, dz = (number(move.get(a, 200.0 * (a == "z")), f"translate {a}") for a in "xyz")
    turn = radians(number(transform.get("rotation", 0.0), "rotation"))
    c, s = cos(turn), sin(turn)
    return tuple(
        (c * sx * x - s * sy * y + dx, s * sx * x + c * sy * y + dy, sz * z + dz)
        for x, y, z in values
    )


def _get(table: Mapping[str, Any], key: str, kind: type, default: Any = None) -> Any:
    return _of(table.get(key, default), key, kind)


def _of(value: Any, what: str, kind: type = dict) -> Any:
    if not isinstance(value, kind):
        word = "an object" if kind is dict else "a list"
        raise ValueError(f"{what} = {json.dumps(value)[:40]} must be {word}")
    return value


def _finite(value: Any, what: str) -> float:
    if not is_finite_number(value):
        raise ValueError(f"{what} = {json.dumps(value)[:40]} must be a finite number")
    return float(value)
