"""Units of what is measured, of times, frequencies and lengths, and what they are in SI.

A unit is a divisor: a value in mm/s over 1000 is in m/s, correctly rounded.
"""

import re
from decimal import Decimal, InvalidOperation

import numpy as np

from simple_model.choices import suggestion
from simple_model.quantities import ACCELERATION, DISPLACEMENT, QUANTITIES, VELOCITY

STANDARD_GRAVITY = 9.80665  # m/s2
LENGTHS = {"m": 1.0, "cm": 1e2, "mm": 1e3, "um": 1e6, "nm": 1e9, "pm": 1e12}
TIMES = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
FREQUENCIES = {"Hz": 1.0, "kHz": 1e-3}
# Per quantity, its units by what 1 in SI is in each.
MOTION = {
    DISPLACEMENT.name: LENGTHS,
    VELOCITY.name: {f"{length}/s": per for length, per in LENGTHS.items()},
    ACCELERATION.name: {
        **{f"{length}/s2": per for length, per in LENGTHS.items()},
        "g": 1 / STANDARD_GRAVITY, "mg": 1e3 / STANDARD_GRAVITY,
    },
}  # fmt: skip
ANGLES = {"deg": 1.0, "rad": 1.0}
_SAME = str.maketrans({"µ": "u", "μ": "u", "²": "2", "¹": "1", "⁻": "-", "°": "deg", "º": "deg"})
# Words of programs and languages, in lower case.
_WORDS = {
    word: unit
    for unit, words in {
        "s": "s sec secs second seconds sekunde sekunden seconde secondes 秒",
        "ms": "msec millisecond milliseconds", "us": "usec microsecond microseconds",
        "ns": "nsec nanosecond nanoseconds", "Hz": "hz hertz", "kHz": "khz kilohertz",
        "deg": "deg degree degrees grad degdeg", "rad": "rad radian radians",
        "um": "micron microns micrometer micrometre", "V": "v volt volts", "N": "newton newtons",
        "g": "gn",
    }.items()
    for word in words.split()
}  # fmt: skip
_FACTOR = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)\s*(.*)", re.IGNORECASE)
_LEVELS = re.compile(r"dB\w*(/.*)?", re.IGNORECASE)


def plain(unit: str) -> str:
    """A unit as it is looked up: "µm·s^-1" is "um/s", "m/s^2" and "m/s/s" are "m/s2"."""
    text = unit.strip().strip("[]()").translate(_SAME).replace("**", "^").replace("^", "")
    text = re.sub(r"[\s·*.]*s-1$", "/s", text)
    text = re.sub(r"[\s·*.]*s-2$|/s/s$|/s\^?2$|/\(s2\)$", "/s2", text).replace(" ", "")
    above, slash, below = text.partition("/")
    words = _WORDS.get(above.lower(), above), re.sub(r"^sec(ond)?s?(?=2?$)", "s", below)
    return slash.join(words) if slash else words[0]


def per_reference(unit: str) -> tuple[str, bool]:
    """Unit of motion without that of a reference below it, as "m/s" of "(m/s)/N", and whether it
    has one.
    """
    unit = re.sub(r"\(1/(\w+)\)\*(\(.*\))", r"\2/\1", unit)
    above, _, below = unit.strip("[] ").rpartition("/")
    has = plain(below) in ("N", "V", "Pa") and bool(quantity_of(above))
    return (above.strip("() "), True) if has else (unit, False)


def quantity_of(unit: str) -> str:
    """The quantity that a unit of motion is of; "" if it is of none."""
    _, name = _split(unit)
    return next((kind for kind, units in MOTION.items() if name in units), "")


def per_unit(unit: str, kind: str) -> float:
    """Divisor of a unit of a quantity: values over it are in SI; of "20 mm/s" it is 50. Raises a
    ValueError if the unit is unknown, a level in dB, or one of another quantity.
    """
    factor, name = _split(unit)
    if _LEVELS.fullmatch(name):
        raise ValueError(f"'{unit}' is a level, not a unit; export linear values")
    units = MOTION.get(kind, {plain(QUANTITIES[kind].unit): 1.0})
    if name not in units:
        other = quantity_of(unit)
        why = f"is one of {other}, not of {kind}" if other else f"is no unit of {kind}"
        raise ValueError(
            f"'{unit[:40]}' {why}; give --unit as one of {', '.join(units)}"
            f"{suggestion(name, units)}"
        )
    if factor <= 0:
        raise ValueError(f"'{unit[:40]}' must be above 0; use --positive to turn the sign")
    return units[name] / factor


def in_si(values: np.ndarray, per: float) -> np.ndarray:
    """Values in SI of some in a unit that 1 in SI is `per` of, rounded once."""
    return values / per if per >= 1 else values * (1 / per)


def scale(unit: str, units: dict[str, float], what: str) -> float:
    """Divisor of a unit of times, frequencies or lengths; raises a ValueError if it is none."""
    if (name := plain(unit)) not in units:
        raise ValueError(
            f"'{unit[:40]}' is no unit of {what}; use one of {', '.join(units)} in the header"
        )
    return units[name]


def length(text: str, unit: str) -> float:
    """Metre of a number in a unit of length, exact as decimal numbers are; raises a ValueError if
    it is none.
    """
    try:
        return float(Decimal(text.strip()) / Decimal(scale(unit, LENGTHS, "length")))
    except InvalidOperation:
        raise ValueError(f"'{text.strip()[:40]}' is no number of {unit}; mend it") from None


def _split(unit: str) -> tuple[float, str]:
    """Factor and name of a unit such as "20 mm/s"; the factor is 1 if there is none."""
    found = _FACTOR.fullmatch(unit.strip().strip("[]()"))
    return (float(found[1]), plain(found[2])) if found and found[2] else (1.0, plain(unit))
