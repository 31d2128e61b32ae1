"""Mach angle of a focus that is faster than waves, and the period of a pattern."""

from dataclasses import replace
from math import asin, ceil

import numpy as np

from simple_model import MovingPressure, Tacton, pattern_period
from simple_model.load.tacton import repetition_frequencies
from skinwave.typing import Floats

FEWEST, MOST = 40, 256  # frames of an animation
EACH = 8  # frames to a period of the fastest line that counts
SAME = 1e-6  # of a tone: further from a multiple of the common frequency it is none


def mach_angle(wave_speed: float, speed: float) -> float | None:
    """Mach angle asin(c/v) in rad between a path and the wavefront of a focus; None if it is
    slower than the wave.

    For a straight path: on a circle smaller than a wavelength no clean cone forms.
    """
    return asin(wave_speed / speed) if speed > wave_speed else None


def seam(tacton: Tacton, span: float) -> float:
    """Phase jump in turns, 0..0.5, of the worst of a Tacton's periodic parts after a time in s:
    that of an animation which repeats this time.
    """
    turns = span * np.array(list(repetition_frequencies(tacton).values()))
    return float(np.abs(turns - np.round(turns)).max(initial=0.0))


def period(pressure: MovingPressure) -> float | None:
    """Period in s of a load's whole pattern; None if it has none within its duration."""
    whole = pattern_period(pressure.tacton)
    turns = whole * max(repetition_frequencies(pressure.tacton).values(), default=0.0)
    return whole if turns and seam(pressure.tacton, whole) <= SAME * turns else None


def shown_part(
    pressure: MovingPressure, fastest: float, frames: int | None = None, most: int = MOST
) -> tuple[float, int]:
    """Duration and number of frames of an animation: `EACH` frames to a period of its fastest line.

    It is the period of the whole pattern, or the time after which that nearly repeats. A pattern
    that takes more than `most` frames is shown in part, as long as these last, with the smallest
    jump where it repeats. Returns the duration in s and the number of frames, by the `fastest` line
    in Hz that counts; with `frames`, so many of the same time.
    """
    span, tacton = pattern_period(pressure.tacton), pressure.tacton
    needed = ceil(EACH * fastest * span * (1 - SAME))
    if needed > (most := max(most, frames or 0)):
        longest = min(tacton.duration, most / EACH / fastest)
        span, needed = pattern_period(replace(tacton, duration=longest)), most
    return span, frames or max(needed, FEWEST)


def strongest_tone(frequencies: Floats, amplitudes: Floats) -> float:
    """Frequency in Hz of the line (f,) with the largest motion of points (f, p); 0 of none."""
    if not len(frequencies):
        return 0.0
    return float(frequencies[np.argmax((amplitudes**2).sum(axis=1))])
