"""Units of motion, time, frequency and length.

A unit is stored as a divisor: a value in mm/s divided by 1000 is in m/s, correctly rounded.
"""

import re
from decimal import Decimal, InvalidOperation

import numpy as np

from simple_model.choices import suggestion
from simple_model.quantities import ACCELERATION, DISPLACEMENT, QUANTITIES, VELOCITY

STANDARD_GRAVITY = 9.80665  # m/s2
LENGTHS = {
    "m": 1.0, "cm": 1e2, "mm": 1e3, "um": 1e6, "nm": 1e9, "pm": 1e12,
    "in": 1e4 / 254, "uin": 1e10 / 254, "ft": 1e4 / 3048, "mil": 1e7 / 254,
}  # fmt: skip
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
REFERENCES = ("N", "mN", "kN", "V", "mV", "Pa", "kPa", "A", "mA", "lbf")
ANGLES = {"deg": 1.0, "rad": 1.0}
# Spelled-out units of programs and languages, in lower case.
_SPELLINGS = {
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
_FACTOR = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)\s*(.*)", re.IGNORECASE)
_DECIBEL = re.compile(r"\s*dB", re.IGNORECASE)
_POWER_WORD = re.compile(
    r"\b[paec]sd\b|power|density|leistung|dichte|autospe|(?<!root )mean square", re.IGNORECASE
)
_POWER_UNIT = re.compile(r"hz|m\^?[24]/s|[mg)]\^?[24]$", re.IGNORECASE)
RMS, PEAK_TO_PEAK, PEAK = "RMS", "peak-to-peak", "peak"
AMPLITUDES = {RMS: 2**0.5, PEAK_TO_PEAK: 0.5, PEAK: 1.0, "": 1.0}  # of a sinusoid of level 1
_TOP = r"(?:p(?:ea)?k?|spitzen?|cr[êe]te)"
_WORDS = {
    PEAK_TO_PEAK: rf"{_TOP}[ _-]*(?:to|zu|bis|à|2)?[ _-]*{_TOP}|spitze[ -]*tal|double amplitude|"
    r"(?<=[ _(\[])s-?s|"
    "doppelamplitude|schwing(?:breite|weite)",
    RMS: r"r\.?m\.?s\.?|root[ -]mean[ -]squared?|eff(?:ektiv|icace)?",
    PEAK: r"(?:0|zero|null)[ _-]*(?:to[ _-]*)?p(?:ea)?k?|p(?:ea)?k|scheitel|spitzen?",
}
_LEVELS = re.compile(
    rf"[ _,]*([(\[])?(?<![a-z]{{2}})(?:{'|'.join(f'({words})' for words in _WORDS.values())})"
    r"(?:wert|[ _-]value|[ _-]amplitude)?(?![a-z])\.?(?(1)[)\]])", re.IGNORECASE,
)  # fmt: skip


def split_level(text: str) -> tuple[str, str]:
    """Return a unit or heading without a level in it, and the level: one of `AMPLITUDES`.

    >>> split_level("um pk-pk"), split_level("v_rms [mm/s]"), split_level("mm/s")
    (('um', 'peak-to-peak'), ('v [mm/s]', 'RMS'), ('mm/s', ''))
    """
    if not (found := _LEVELS.search(text)):
        return text, ""
    level = tuple(_WORDS)[(found.lastindex or 2) - 2]
    return f"{text[: found.start()]}{text[found.end() :]}".strip(" _-"), level


def check_linear(unit: str, text: str = "") -> None:
    """Raise a ValueError for a unit or heading of a level in dB, or of a power density."""
    if _DECIBEL.match(unit):
        raise ValueError(f"'{unit[:40]}' is a level in dB, not a unit; export linear values")
    if _POWER_UNIT.search(canonical(unit)) or _POWER_WORD.search(text):
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
    return _SPELLINGS.get(above.lower(), above) + slash + below


def per_reference(unit: str) -> tuple[str, bool]:
    """Return the unit of motion in a unit such as "(m/s)/N", and whether there is a reference."""
    unit = re.sub(r"\(1/(\w+)\)\*(\(.*\))", r"\2/\1", unit)
    above, _, below = unit.strip("[] ").rpartition("/")
    (above, level), (below, other) = split_level(above), split_level(below)
    if canonical(below) in REFERENCES and quantity_of(above):
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
    unit = split_level(unit)[0].strip().strip("[]()")
    match = _FACTOR.fullmatch(unit)
    if match and match[2]:
        return float(match[1]), canonical(match[2])
    return 1.0, canonical(unit)
