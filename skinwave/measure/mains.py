"""Mains hum: lines at multiples of one frequency near 50 or 60 Hz."""

from collections.abc import Container, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from skinwave.measure.spectral_lines import SpectralLine

MAINS = (50.0, 60.0)
WANDER = 0.004  # of its frequency: how far the mains of any grid are from it
SURE = 4.0  # standard errors
HIGHEST = 20  # multiple


def hum_of(
    lines: Sequence["SpectralLine"], duration: float, driven: Container[int] = ()
) -> dict[int, str]:
    """Names of lines that may be mains hum by their number in `lines`, such as "mains 3 x 50 Hz".

    A multiple that is stronger than the mains frequency itself may be a load's own as well, and
    is "3 x 50 Hz, mains or load". It takes a line at the mains frequency, or at twice and three
    times it: 200, 400 and 600 Hz are multiples of 50 Hz as well, and a load's own. A multiple goes
    with it if it is one of the found mains frequency, not of 50 Hz, within its standard error and a
    twentieth of 1/duration.

    Parameters
    ----------
    lines : of a record
    duration : of it, s
    driven : numbers of lines that are in the recorded drive, whose multiples are none of the mains

    Returns
    -------
    names by number
    """
    found: dict[int, str] = {}
    for mains, line, first in _bases(lines, driven):
        base, spread = line.frequency / first, line.error / first
        for k, other in enumerate(lines):
            n = round(other.frequency / base)
            apart = abs(other.frequency - n * base)
            limit = SURE * float(np.hypot(other.error, n * spread)) + 0.05 / duration
            if 1 <= n <= HIGHEST and apart <= limit:
                loud = (other.amplitudes > line.amplitudes).any()
                multiple = (
                    f"{n} x {mains:g} Hz, mains or load" if loud else f"mains {n} x {mains:g} Hz"
                )
                found.setdefault(k, multiple if n > 1 else f"mains {mains:g} Hz")
    return found


def mains_in(lines: Sequence["SpectralLine"], driven: Container[int] = ()) -> list[float]:
    """Mains frequencies in Hz, as found, of the hum among lines; arguments as of `hum_of`."""
    return [line.frequency / first for _, line, first in _bases(lines, driven)]


def _bases(
    lines: Sequence["SpectralLine"], driven: Container[int]
) -> Iterator[tuple[float, "SpectralLine", int]]:
    """Mains frequencies that lines have, the line that tells of each, and which multiple it is."""
    for mains in MAINS:
        at = {n: _nearest(lines, n * mains, n * mains * WANDER) for n in (1, 2, 3)}
        first = next((n for n in (1, 2) if at[n] is not None), 0)
        if at[1] is None and (at[2] is None or at[3] is None):
            continue
        k = at[first]
        if k is not None and k not in driven:
            yield mains, lines[k], first


def _nearest(lines: Sequence["SpectralLine"], frequency: float, within: float) -> int | None:
    """Number of the line nearest to a frequency, if it is within so many Hz."""
    if not lines:
        return None
    apart = [abs(line.frequency - frequency) for line in lines]
    k = int(np.argmin(apart))
    return k if apart[k] <= within else None
