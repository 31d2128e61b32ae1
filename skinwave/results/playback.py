"""The part of a periodic pattern that an animation plays, and in how many frames."""

from dataclasses import replace
from math import ceil

import numpy as np

from simple_model import MovingPressure, Tacton, pattern_period
from simple_model.load.tacton import repetition_frequencies

FEWEST_FRAMES, MOST_FRAMES = 40, 256
FRAMES_PER_PERIOD = 8  # of the fastest strong line
SAME_PHASE = 1e-6  # of a turn for each turn: a smaller phase jump is round-off


def phase_jump(tacton: Tacton, span: float) -> float:
    """Return the largest phase jump in turns (0 to 0.5) of a Tacton repeated after `span` s."""
    turns = span * np.array(list(repetition_frequencies(tacton).values()))
    return float(np.abs(turns - np.round(turns)).max(initial=0.0))


def whole_period(pressure: MovingPressure) -> float | None:
    """Return the period in s of the whole pattern, or None if it exceeds the duration."""
    whole = pattern_period(pressure.tacton)
    turns = whole * max(repetition_frequencies(pressure.tacton).values(), default=0.0)
    return whole if turns and phase_jump(pressure.tacton, whole) <= SAME_PHASE * turns else None


def played_part(
    pressure: MovingPressure, fastest: float, frames: int | None = None, most: int = MOST_FRAMES
) -> tuple[float, int]:
    """Return the duration in s and the number of frames of an animation.

    The duration is the period of the whole pattern, or the time after which it nearly repeats. The
    number of frames follows from the `fastest` strong line in Hz, unless given. If this exceeds
    `most`, only a part is played: that with the smallest phase jump.
    """
    span, tacton = pattern_period(pressure.tacton), pressure.tacton
    needed = ceil(FRAMES_PER_PERIOD * fastest * span * (1 - SAME_PHASE))
    if needed > (most := max(most, frames or 0)):
        longest = min(tacton.duration, most / FRAMES_PER_PERIOD / fastest)
        span, needed = pattern_period(replace(tacton, duration=longest)), most
    return span, frames or max(needed, FEWEST_FRAMES)
