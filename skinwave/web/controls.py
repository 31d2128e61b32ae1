"""Controls of the page: ranges, units and steps, and the same as text for an address or undo.

Values are in the units that a page shows. Ranges are those of Lim, Seifi and Park, CHI EA '24,
section 2.2, where they give one: amplitude, ratio, duration, shape and size.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any
from urllib.parse import parse_qsl, urlencode

from simple_model import MovingPressure
from simple_model.choices import choose
from simple_model.drive import DRIVES
from simple_model.quantities import DISPLACEMENT, QUANTITIES
from simple_model.tacton import SHARINGS, SUPERPOSITIONS
from simple_model.trajectory import SHAPES
from skinwave.scene import BODIES
from skinwave.studies.paper15 import tactons
from skinwave.web.layer_values import layers_of
from skinwave.web.paths import fitted, paths_of

Values = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Number:
    """A number with a slider: `low` to `high` in steps of `step`, in `unit`; `least` is the
    smallest value that a field takes, `low` if not given.
    """

    label: str
    unit: str
    low: float
    high: float
    step: float
    start: float
    least: float | None = None


NUMBERS = {
    "amplitude": Number(label="Amplitude", unit="%", low=0, high=100, step=1, start=100),
    "am": Number(label="AM frequency", unit="Hz", low=0, high=500, step=1, start=140),
    "am2": Number(label="Second AM frequency", unit="Hz", low=0, high=500, step=1, start=0),
    "envelope": Number(label="Envelope frequency", unit="Hz", low=0, high=100, step=0.5, start=0),
    "duration": Number(label="Duration", unit="s", low=0.1, high=10, step=0.1, start=1, least=0.01),
    "size": Number(label="Size", unit="mm", low=0, high=60, step=0.5, start=20),
    "speed": Number(label="Drawing speed", unit="m/s", low=0, high=40, step=0.1, start=12),
    "drawn": Number(label="Drawing frequency", unit="Hz", low=1, high=500, step=1, start=100),
    "height": Number(label="Height of the focus", unit="mm", low=20, high=600, step=5, start=200),
    "foci": Number(label="Focal points", unit="", low=1, high=8, step=1, start=1),
    "ramp": Number(label="Ramp", unit="ms", low=0, high=100, step=1, start=0),
    "x": Number(label="Point x", unit="mm", low=-50, high=50, step=0.1, start=10),
    "y": Number(label="Point y", unit="mm", low=-50, high=50, step=0.1, start=0),
    "depth": Number(label="Depth of the point", unit="mm", low=0, high=10, step=0.1, start=0),
}
RATIOS = {f"{w1:g}:{w2:g}": (w1, w2) for w1, w2 in SUPERPOSITIONS}
OWN_BODY = "from the scene"
CHOICES: dict[str, tuple[str, ...]] = {
    "ratio": tuple(RATIOS),
    "shape": SHAPES,
    "drive": tuple(DRIVES),
    "profile": ("gaussian", "main_lobe"),
    "body": (*BODIES, OWN_BODY),
    "sharing": SHARINGS,
    "quantity": tuple(name for name, asked in QUANTITIES.items() if asked.of_body),
}
STARTS = {
    **{key: number.start for key, number in NUMBERS.items()},
    "ratio": "1:0",
    "shape": "circle",
    "drive": MovingPressure.drive,
    "profile": MovingPressure.profile,
    "body": "skin-slab",
    "sharing": "simultaneous",
    "quantity": DISPLACEMENT.name,
    "pulses": "",
    "phases": "",
    "paths": "",
    "layers": "",
}
KEYS = tuple(STARTS)
NAMES = {key: number.label for key, number in NUMBERS.items()} | {
    "ratio": "Superposition ratio",
    "shape": "Shape of the path",
    "drive": "Drive law",
    "profile": "Focus profile",
    "body": "Body",
    "sharing": "Several foci",
    "quantity": "Quantity at the point",
    "pulses": "Rhythm, ms",
    "phases": "Phases, %",
    "paths": "Paths",
    "layers": "Layers, mm/kPa",
}
MOST_PULSES = 64


def checked(key: str, given: Any) -> Any:
    """The value of a control.

    Raises
    ------
    ValueError
        If it is none, unknown, not finite or out of range.
    """
    if key in CHOICES:
        return choose(key, str(given), CHOICES[key])
    if key in TEXTS:
        TEXTS[key](str(given))
        return str(given).strip()
    number = NUMBERS[key]
    unit = f" {number.unit}" if number.unit else ""
    try:
        value = float(str(given).replace(",", "."))
    except ValueError:
        raise ValueError(f"'{given}' is no number; give one in {number.unit or 'whole'}") from None
    low = number.low if number.least is None else number.least
    if not (isfinite(value) and low <= value <= number.high):
        raise ValueError(f"{value:g}{unit} is outside {low:g} to {number.high:g}{unit}")
    if key == "foci" and value != int(value):
        raise ValueError(f"{value:g} focal points; give a whole number")
    return int(value) if key == "foci" else value


def pulses_of(text: str) -> tuple[tuple[float, float], ...]:
    """Pulses and gaps (n, 2) in s of a text such as "100/50, 40/110" in ms; none if it is empty.

    Raises
    ------
    ValueError
        If it is no such text, a pulse does not last or a gap is below 0.
    """
    found = []
    for part in filter(None, (part.strip() for part in text.split(","))):
        try:
            on, gap = (float(number) for number in part.split("/"))
        except ValueError:
            raise ValueError(f"'{part}' is no pulse; give on/off in ms, such as 100/50") from None
        if not (isfinite(on) and isfinite(gap) and on > 0 and gap >= 0):
            raise ValueError(f"'{part}': a pulse lasts longer than 0 ms, its gap 0 ms or longer")
        found.append((on / 1e3, gap / 1e3))
    if len(found) > MOST_PULSES:
        raise ValueError(f"{len(found)} pulses exceed {MOST_PULSES}; repeat a shorter pattern")
    return tuple(found)


def phases_of(text: str) -> tuple[float, ...]:
    """Phases 0..1 of a text such as "0, 25, 60" in per cent of a drawing period; none if empty.

    Raises
    ------
    ValueError
        If it is no such text, or a phase is out of range.
    """
    found = []
    for part in filter(None, (part.strip() for part in text.split(","))):
        try:
            phase = float(part)
        except ValueError:
            raise ValueError(f"'{part}' is no phase; give per cent, such as 0, 25, 60") from None
        if not 0 <= phase < 100:
            raise ValueError(f"{phase:g} % is outside 0 to below 100 % of a drawing period")
        found.append(phase / 100)
    return tuple(found)


def with_its_paths(values: Values, moved: str) -> Values:
    """Values with as many paths as foci, if foci have paths of their own; `moved` is "foci" or
    "paths", whichever is right.
    """
    text = values["paths"]
    if not text:
        return values
    if moved == "paths":
        return values | {"foci": len(paths_of(text))}
    return values | {"paths": fitted(text, values["foci"])}


TEXTS = {"pulses": pulses_of, "phases": phases_of, "paths": paths_of, "layers": layers_of}


def to_query(values: Mapping[str, Any]) -> str:
    """The part of an address that `from_query` reads; only what differs from `STARTS`."""
    changed = {
        key: f"{values[key]:.10g}" if key in NUMBERS else values[key]
        for key in KEYS
        if values[key] != STARTS[key]
    }
    return urlencode(changed, safe="/:,")


def from_query(query: str, own: bool = False) -> tuple[Values, tuple[str, ...]]:
    """Values of an address, and a sentence for everything in it that was left out; such as a
    scene's body where there is not one of its `own`.
    """
    return _in_range(parse_qsl(query), "address", own)


def values_in(query: str) -> Values:
    """The values that `to_query` wrote, of a page that has them still."""
    return from_query(query, own=True)[0]


def said(key: str, value: Any) -> str:
    """A value as it is read, with its unit."""
    if key not in NUMBERS:
        return str(value).replace("_", " ") or "none"
    return f"{value:g} {NUMBERS[key].unit}".strip()


def in_range(values: Mapping[str, Any]) -> tuple[Values, tuple[str, ...]]:
    """A scene's values, each out of its control's range as it is in `STARTS`; a sentence for each
    of those.
    """
    return _in_range(values.items(), "scene", own=True)


def _in_range(
    pairs: Iterable[tuple[str, Any]], place: str, own: bool
) -> tuple[Values, tuple[str, ...]]:
    values, refused = dict(STARTS), []
    for key, given in pairs:
        try:
            if key not in KEYS:
                raise ValueError("is not known here")
            if given == OWN_BODY and not own:
                raise ValueError("the scene that it came from is not open; open it again")
            values[key] = checked(key, given)
        except ValueError as error:
            refused.append(f"left out of the {place}: {key}: {error}")
    return values, tuple(refused)


def presets() -> dict[str, Values]:
    """The paper's 15 Tactons by name: what each changes."""
    unused = ("am2", "ratio", "envelope", "foci", "pulses", "phases", "paths", "ramp")
    return {
        name: {key: STARTS[key] for key in unused}
        | {
            "amplitude": 100.0 * tacton.amplitude,
            "am": tacton.am_frequency,
            "duration": tacton.duration,
            "shape": "circle" if tacton.trajectory.size else "point",
            "size": 1e3 * tacton.trajectory.size,
            "speed": tacton.trajectory.speed,
        }
        for name, tacton in tactons()
    }
