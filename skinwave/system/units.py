"""Units in headings, files and options.

A unit is stored as a divisor: a value in mm/s divided by 1000 is in m/s, correctly rounded.
"""

import re
from decimal import Decimal, InvalidOperation
from math import pi

import numpy as np

from simple_model.choices import suggestion
from simple_model.quantities import ACCELERATION, DISPLACEMENT, QUANTITIES, VELOCITY

LENGTHS = {
    "m": 1.0, "cm": 1e2, "mm": 1e3, "um": 1e6, "nm": 1e9, "pm": 1e12,
    "in": 1e4 / 254, "uin": 1e10 / 254, "ft": 1e4 / 3048, "mil": 1e7 / 254,
}  # fmt: skip
UNITS = {  # by dimension
    "length": LENGTHS,
    "velocity": {f"{length}/s": divisor for length, divisor in LENGTHS.items()},
    "acceleration": {
        **{f"{length}/s2": divisor for length, divisor in LENGTHS.items()},
        "g": 1 / 9.80665, "mg": 1e3 / 9.80665,
    },
    "time": {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9},
    "frequency": {"Hz": 1.0, "kHz": 1e-3},
    "angle": {"deg": 180 / pi, "rad": 1.0},
    "force": {"N": 1.0, "mN": 1e3, "kN": 1e-3, "lbf": 1 / 4.4482216152605},
    "pressure": {
        "Pa": 1.0, "hPa": 1e-2, "kPa": 1e-3, "MPa": 1e-6, "mPa": 1e3, "N/m2": 1.0, "bar": 1e-5,
    },
    "intensity": {"W/m2": 1.0, "mW/m2": 1e3, "W/cm2": 1e-4, "mW/cm2": 0.1},
    "voltage": {"V": 1.0, "mV": 1e3, "uV": 1e6},
    "current": {"A": 1.0, "mA": 1e3},
    "level": {"dB": 1.0},
    "count": {"Sequence": 1.0},  # of Rigol
    "number": {"": 1.0, "%": 100.0, "EU": 1.0, "a.u.": 1.0},
}  # fmt: skip
MOTION = {
    DISPLACEMENT.name: LENGTHS, VELOCITY.name: UNITS["velocity"],
    ACCELERATION.name: UNITS["acceleration"],
}  # fmt: skip
# Spelled-out units of programs and languages, in lower case.
SPELLINGS = {
    word: unit
    for unit, words in {
        "s": "s sec secs second seconds sekunde sekunden seconde secondes 秒",
        "ms": "msec millisecond milliseconds", "us": "usec microsecond microseconds",
        "ns": "nsec nanosecond nanoseconds", "Hz": "hz hertz", "kHz": "khz kilohertz",
        "deg": "deg degree degrees grad degdeg", "rad": "rad radian radians",
        "um": "micron microns micrometer micrometre", "V": "v volt volts", "N": "newton newtons",
        "g": "g gn g's", "in": "inch inches zoll", "ft": "foot feet", "mil": "mils thou",
        "in/s": "ips",
    }.items()
    for word in words.split()
}  # fmt: skip
_TOP = r"(?:p(?:ea)?k?|spitzen?|cr[êe]te)"
LEVELS = {  # of a sinusoid: its amplitude over the level, and words in units and headings
    "peak-to-peak": (
        0.5,
        rf"{_TOP}[ _-]*(?:to|zu|bis|à|2)?[ _-]*{_TOP}|spitze[ -]*tal|double amplitude|"
        r"(?<=[ _(\[])s-?s|doppelamplitude|schwing(?:breite|weite)",
    ),
    "RMS": (2**0.5, r"r\.?m\.?s\.?|root[ -]mean[ -]squared?|eff(?:ektiv|icace)?"),
    "peak": (
        1.0, r"(?:0|zero|null)[ _-]*(?:to[ _-]*)?p(?:ea)?k?|p(?:ea)?k|scheitel|spitzen?",
    ),
}  # fmt: skip
_LEVEL = re.compile(
    rf"[ _,]*([(\[])?(?<![a-z]{{2}})(?:{'|'.join(f'({words})' for _, words in LEVELS.values())})"
    r"(?:wert|[ _-]value|[ _-]amplitude)?(?![a-z])\.?(?(1)[)\]])", re.IGNORECASE,
)  # fmt: skip


def split_level(text: str) -> tuple[str, str]:
    """Return a unit or heading without a level in it, and the level: one of `LEVELS`, or "".

    >>> split_level("um pk-pk"), split_level("v_rms [mm/s]"), split_level("mm/s")
    (('um', 'peak-to-peak'), ('v [mm/s]', 'RMS'), ('mm/s', ''))
    """
    if not (found := _LEVEL.search(text)):
        return text, ""
    level = tuple(LEVELS)[(found.lastindex or 2) - 2]
    return f"{text[: found.start()]}{text[found.end() :]}".strip(" _-"), level


def amplitude(level: str) -> float:
    """Return the amplitude of a sinusoid whose level is 1."""
    return LEVELS[level][0] if level else 1.0


def check_linear(unit: str, text: str = "") -> None:
    """Raise a ValueError for a unit or heading of a level in dB, or of a power density."""
    if unit.strip().lower().startswith("db"):
        raise ValueError(f"'{unit[:40]}' is a level in dB, not a unit; export linear values")
    is_power = re.search(r"hz|m\^?[24]/s|[mg)]\^?[24]$", canonical(unit), re.IGNORECASE)
    words = r"\b[paec]sd\b|power|density|leistung|dichte|autospe|(?<!root )mean square"
    if is_power or re.search(words, text, re.IGNORECASE):
        cure = "export waveforms or complex amplitudes"
        raise ValueError(f"'{(text or unit)[:40]}' is a density or power without phase; {cure}")


def canonical(unit: str) -> str:
    """Return the canonical spelling of a unit: "um/s" for "µm·s^-1", "m/s2" for "m/s/s"."""
    letters = str.maketrans(
        {"µ": "u", "μ": "u", "²": "2", "¹": "1", "⁻": "-", "°": "deg", "º": "deg"}
    )
    text = unit.strip().strip("[]()").translate(letters).replace("**", "^").replace("^", "")
    text = re.sub(r"[\s·*.]*s-1$", "/s", text)
    text = re.sub(r"[\s·*.]*s-2$|/s(ec)?/s(ec)?$|/s\^?2$|/\(s2\)$", "/s2", text).replace(" ", "")
    above, slash, below = text.partition("/")
    below = re.sub(r"^sec(ond)?s?(?=2?$)", "s", below)
    return SPELLINGS.get(above.lower(), above) + slash + below


def dimension_of(unit: str) -> str:
    """Return the dimension of a unit, a key of `UNITS`; "" if the unit is unknown."""
    name = canonical(unit)
    return next((dimension for dimension, units in UNITS.items() if name in units), "")


def is_of_reference(unit: str) -> bool:
    """Whether a unit may be that of an excitation or a voltage."""
    return dimension_of(unit) in ("force", "pressure", "voltage", "current")


def per_reference(unit: str) -> tuple[str, bool]:
    """Return the unit of motion in a unit such as "(m/s)/N", and whether there is a reference."""
    unit = re.sub(r"\(1/(\w+)\)\*(\(.*\))", r"\2/\1", unit)
    above, _, below = unit.strip("[] ").rpartition("/")
    (above, level), (below, other) = split_level(above), split_level(below)
    if is_of_reference(below) and quantity_of(above):
        return f"{above.strip('() ')} {level if level != other else ''}".strip(), True
    return unit, False


def quantity_of(unit: str) -> str:
    """Return the quantity of motion that a unit measures; "" if it is no unit of motion."""
    _, name = _factor_and_name(unit)
    return next((quantity for quantity, units in MOTION.items() if name in units), "")


def motion_divisor(unit: str, quantity: str) -> float:
    """Return the divisor that converts a unit of a quantity to SI: 50 for "20 mm/s".

    Raises a ValueError if the unit is unknown, a level in dB, or a unit of another quantity.
    """
    check_linear(unit)
    factor, name = _factor_and_name(unit)
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


def divisor(unit: str, dimension: str) -> float:
    """Return the divisor of a unit; raise a ValueError if it is not one of a dimension."""
    if (name := canonical(unit)) not in (units := UNITS[dimension]):
        raise ValueError(f"'{unit[:40]}' is not a unit of {dimension}; use {', '.join(units)}")
    return units[name]


def metres(text: str, unit: str) -> float:
    """Return a decimal number in a unit of length in m, exactly rounded."""
    try:
        return float(Decimal(text.strip()) / Decimal(divisor(unit, "length")))
    except InvalidOperation:
        raise ValueError(f"'{text.strip()[:40]}' is not a number of {unit}") from None


def _factor_and_name(unit: str) -> tuple[float, str]:
    unit = split_level(unit)[0].strip().strip("[]()")
    match = re.fullmatch(
        r"([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)\s*(.+)", unit, re.IGNORECASE
    )  # fmt: skip
    return (float(match[1]), canonical(match[2])) if match else (1.0, canonical(unit))
