"""Units of motion, time, frequency and length.

A unit is stored as a divisor: a value in mm/s divided by 1000 is in m/s, correctly rounded.
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
MOTION = {
    DISPLACEMENT.name: LENGTHS,
    VELOCITY.name: {f"{length}/s": divisor for length, divisor in LENGTHS.items()},
    ACCELERATION.name: {
        **{f"{length}/s2": divisor for length, divisor in LENGTHS.items()},
        "g": 1 / STANDARD_GRAVITY, "mg": 1e3 / STANDARD_GRAVITY,
    },
}  # fmt: skip
ANGLES = {"deg": 1.0, "rad": 1.0}
_LETTERS = str.maketrans({"µ": "u", "μ": "u", "²": "2", "¹": "1", "⁻": "-", "°": "deg", "º": "deg"})
# Spelled-out units of programs and languages, in lower case.
_SPELLINGS = {
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
_LEVEL = re.compile(r"dB\w*(/.*)?", re.IGNORECASE)


def canonical(unit: str) -> str:
    """Return the canonical spelling of a unit: "um/s" for "µm·s^-1", "m/s2" for "m/s/s"."""
    text = unit.strip().strip("[]()").translate(_LETTERS).replace("**", "^").replace("^", "")
    text = re.sub(r"[\s·*.]*s-1$", "/s", text)
    text = re.sub(r"[\s·*.]*s-2$|/s/s$|/s\^?2$|/\(s2\)$", "/s2", text).replace(" ", "")
    above, slash, below = text.partition("/")
    below = re.sub(r"^sec(ond)?s?(?=2?$)", "s", below)
    return _SPELLINGS.get(above.lower(), above) + slash + below


def per_reference(unit: str) -> tuple[str, bool]:
    """Return the unit of motion in a unit such as "(m/s)/N", and whether there is a reference."""
    unit = re.sub(r"\(1/(\w+)\)\*(\(.*\))", r"\2/\1", unit)
    above, _, below = unit.strip("[] ").rpartition("/")
    if canonical(below) in ("N", "V", "Pa") and quantity_of(above):
        return above.strip("() "), True
    return unit, False


def quantity_of(unit: str) -> str:
    """Return the quantity of motion that a unit measures; "" if it is no unit of motion."""
    _, name = _factor_and_name(unit)
    return next((quantity for quantity, units in MOTION.items() if name in units), "")


def motion_divisor(unit: str, quantity: str) -> float:
    """Return the divisor that converts a unit of a quantity to SI: 50 for "20 mm/s".

    Raises a ValueError if the unit is unknown, a level in dB, or a unit of another quantity.
    """
    factor, name = _factor_and_name(unit)
    if _LEVEL.fullmatch(name):
        raise ValueError(f"'{unit}' is a level, not a unit; export linear values")
    units = MOTION.get(quantity, {canonical(QUANTITIES[quantity].unit): 1.0})
    if name not in units:
        other = quantity_of(unit)
        problem = f"is a unit of {other}, not of {quantity}" if other else (
            f"is not a unit of {quantity}")  # fmt: skip
        known = ", ".join(units) + suggestion(name, units)
        raise ValueError(f"'{unit[:40]}' {problem}; give --unit as one of {known}")
    if factor <= 0:
        raise ValueError(f"'{unit[:40]}' must be above 0; use --positive to flip the sign")
    return units[name] / factor


def in_si(values: np.ndarray, divisor: float) -> np.ndarray:
    """Return values divided by a divisor, with one rounding."""
    return values / divisor if divisor >= 1 else values * (1 / divisor)


def divisor(unit: str, units: dict[str, float], dimension: str) -> float:
    """Return the divisor of a unit of time, frequency or length."""
    if (name := canonical(unit)) not in units:
        raise ValueError(f"'{unit[:40]}' is not a unit of {dimension}; use {', '.join(units)}")
    return units[name]


def metres(text: str, unit: str) -> float:
    """Return a decimal number in a unit of length in m, exactly rounded."""
    try:
        return float(Decimal(text.strip()) / Decimal(divisor(unit, LENGTHS, "length")))
    except InvalidOperation:
        raise ValueError(f"'{text.strip()[:40]}' is not a number of {unit}") from None


def _factor_and_name(unit: str) -> tuple[float, str]:
    match = _FACTOR.fullmatch(unit.strip().strip("[]()"))
    if match and match[2]:
        return float(match[1]), canonical(match[2])
    return 1.0, canonical(unit)
