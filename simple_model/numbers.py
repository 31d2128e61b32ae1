"""Numbers in pages, tables, captions and records: the only formatter of the project.

`significant` formats a number, `with_error` one with a standard error, `interval` a range;
`decibel`, `percent`, and `stated_error` for an expected relative error.
"""

from collections.abc import Sequence
from math import floor, isfinite, log10

EN_DASH = "\u2013"
FAINTEST = -120.0  # dB: a level below it is round-off


def significant(value: float, digits: int = 3) -> str:
    """Format a number to `digits` significant digits; "-" if it is not finite.

    >>> significant(1234.5), significant(0.012345, 2), significant(float("nan"))
    ('1,230', '0.012', '-')
    """
    if not isfinite(value):
        return "-"
    if not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{digits}g}"
    value = float(f"{value:.{digits - 1}e}")
    return f"{value:,.{max(digits - 1 - floor(log10(abs(value))), 0)}f}"


def as_sentence(text: str) -> str:
    """Add a capital and a full stop to a clause."""
    return f"{text[0].upper()}{text[1:]}."


def with_error(value: float, error: float) -> str:
    """Format a number with its standard error: the error to two digits, the number to the same
    decimal place.

    If the error is not known (not finite, or 0), the number has three significant digits.

    >>> with_error(12.3456, 0.123)
    '12.35 ± 0.12'
    """
    if not (isfinite(value) and isfinite(error) and error > 0):
        return significant(value)
    places = max(1 - floor(log10(error)), 0)
    return f"{value:,.{places}f} ± {error:,.{places}f}"


def interval(low: float, high: float, digits: int = 2) -> str:
    """Format a range with an en dash, or as "-5 to 25" if a number is negative. Ends that are equal
    to these digits become one number.
    """
    between = EN_DASH if min(low, high) >= 0 else " to "
    return between.join(dict.fromkeys(significant(end, digits) for end in (low, high)))


def decibel(value: float, *, signed: bool = False) -> str:
    """Format a level in dB to 0.1, without unit: "< -120" below `FAINTEST`, "-" if not finite."""
    if value < FAINTEST:
        return f"< {FAINTEST:g}"
    if not isfinite(value):
        return "-"
    rounded = round(value, 1) + 0.0  # no -0.0
    return f"{rounded:+.1f}" if signed else f"{rounded:.1f}"


def percent(share: float) -> str:
    """Format a share in percent to two significant digits."""
    return f"{significant(100 * share, 2)} %"


def share_of(ratio: float, whole: str) -> str:
    """Format a ratio to a whole in percent, or as a factor if it is above 100 %.

    >>> share_of(0.314, "the motion"), share_of(2.05, "the motion")
    ('31 % of the motion', '2.0 times the motion')
    """
    return f"{significant(ratio, 2)} times {whole}" if ratio > 1 else f"{percent(ratio)} of {whole}"


def change_text(change: float) -> str:
    """Format a relative change of a waveform in percent, or as a factor if it is above 100 %."""
    return percent(change) if change <= 1 else f"{significant(change, 2)} times the waveform"


def plural(number: int, thing: str) -> str:
    """Format a number of things.

    >>> plural(1, "warning"), plural(1200, "warning")
    ('1 warning', '1,200 warnings')
    """
    return f"{number:,} {thing}{'s' * (number != 1)}"


def if_finite(value: float) -> float | None:
    """Return a number for JSON: None if it is not finite."""
    return float(value) if isfinite(value) else None


def first_few(names: Sequence[str], most: int = 3) -> str:
    """Format the first names of a list, and the number of the others.

    >>> first_few(["a", "b", "c"], 2)
    'a, b and 1 more'
    """
    more = len(names) - most
    return ", ".join(names[:most]) + f" and {more} more" * (more > 0)


def stated_error(error: float, least: float = 0.005) -> str:
    """Format an expected relative error. Those below `least` are given as a bound, because
    wavenumber integrals and elements agree to 0.002.
    """
    if not isfinite(error):
        return "not known"
    return f"below {percent(least)}" if error < least else percent(error)
