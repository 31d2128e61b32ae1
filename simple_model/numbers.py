"""Numbers and expected errors as pages, tables and records print them."""

from math import floor, isfinite, log10

LARGEST, SMALLEST = 1e6, 1e-4  # written without an exponent between these
LEAST = 0.005  # error that is stated: wavenumber integrals and elements agree to 0.002


def significant(value: float, digits: int = 3) -> str:
    """A number to so many significant digits; "-" if it is none."""
    if not isfinite(value):
        return "-"
    if not SMALLEST <= abs(value) < LARGEST:
        return f"{value:.{digits}g}"
    value = float(f"{value:.{digits - 1}e}")
    return f"{value:,.{max(digits - 1 - floor(log10(abs(value))), 0)}f}"


def percent(share: float) -> str:
    """A share in percent to two digits."""
    return f"{significant(100 * share, 2)} %"


def counted(number: int, thing: str) -> str:
    """A number of things, in the plural unless it is one."""
    return f"{number:,} {thing}{'s' * (number != 1)}"


def stated_error(error: float) -> str:
    """An expected relative error in words; wavenumber integrals state none below `LEAST`."""
    if not isfinite(error):
        return "not known"
    return f"below {percent(LEAST)}" if error < LEAST else percent(error)
