"""Numbers as pages, tables, captions and records print them: the one formatter of the project.

`significant` for a number alone, `with_error` for one whose standard error is known, `interval` for
a range, `decibel`, `percent`, and `stated_error` for an expected relative error.
"""

from math import floor, isfinite, log10

LARGEST, SMALLEST = 1e6, 1e-4  # written without an exponent between these
LEAST = 0.005  # error that is stated: wavenumber integrals and elements agree to 0.002
EN_DASH = "\u2013"
FAINTEST = -120.0  # dB: a level below it is round-off


def significant(value: float, digits: int = 3) -> str:
    """A number to so many significant digits; "-" if it is not finite."""
    if not isfinite(value):
        return "-"
    if not SMALLEST <= abs(value) < LARGEST:
        return f"{value:.{digits}g}"
    value = float(f"{value:.{digits - 1}e}")
    return f"{value:,.{max(digits - 1 - floor(log10(abs(value))), 0)}f}"


def as_sentence(text: str) -> str:
    """A clause with a capital and a full stop."""
    return f"{text[0].upper()}{text[1:]}."


def with_error(value: float, error: float, digits: int = 3) -> str:
    """A number and its standard error: the error to two digits, the number to as many places.

    Without a known error (not finite, or 0) the number has `digits` significant digits.
    """
    if not (isfinite(value) and isfinite(error) and error > 0):
        return significant(value, digits)
    places = max(1 - floor(log10(error)), 0)
    return f"{value:,.{places}f} ± {error:,.{places}f}"


def interval(low: float, high: float, digits: int = 2) -> str:
    """A range of numbers with an en dash, or "-5 to 25" if one is negative."""
    between = EN_DASH if min(low, high) >= 0 else " to "
    return between.join(significant(end, digits) for end in (low, high))


def decibel(value: float, *, signed: bool = False) -> str:
    """A level or ratio in dB, without the unit, to 0.1 dB; "< -120" below `FAINTEST`, "-" if it is
    not finite.
    """
    if value < FAINTEST:
        return f"< {FAINTEST:g}"
    if not isfinite(value):
        return "-"
    rounded = round(value, 1) + 0.0  # no -0.0
    return f"{rounded:+.1f}" if signed else f"{rounded:.1f}"


def percent(share: float) -> str:
    """A share in percent to two digits."""
    return f"{significant(100 * share, 2)} %"


def plural(number: int, thing: str) -> str:
    """A number of things, in the plural unless it is one."""
    return f"{number:,} {thing}{'s' * (number != 1)}"


def stated_error(error: float) -> str:
    """An expected relative error in words; none below `LEAST` is stated."""
    if not isfinite(error):
        return "not known"
    return f"below {percent(LEAST)}" if error < LEAST else percent(error)
