"""The part of a periodic pattern that an animation plays, and in how many frames."""

from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from simple_model import MovingPressure, Tacton, pattern_period
from simple_model.load.tacton import repetition_frequencies


@dataclass(frozen=True, kw_only=True)
class Frames:
    """Numbers of frames of an animation: fewest, most, and those in a period of the fastest strong
    line. Up to `same_phase` of a turn for each turn, a phase jump is round-off.
    """

    fewest: int = 40
    most: int = 256
    per_period: int = 8
    same_phase: float = 1e-6


FRAMES = Frames()


def phase_jump(tacton: Tacton, span: float) -> float:
    """Return the largest phase jump in turns (0 to 0.5) of a Tacton repeated after `span` s."""
    turns = span * np.array(list(repetition_frequencies(tacton).values()))
    return float(np.abs(turns - np.round(turns)).max(initial=0.0))


def whole_period(pressure: MovingPressure) -> float | None:
    """Return the period in s of the whole pattern, or None if it exceeds the duration."""
    whole = pattern_period(pressure.tacton)
    turns = whole * max(repetition_frequencies(pressure.tacton).values(), default=0.0)
    is_closed = phase_jump(pressure.tacton, whole) <= FRAMES.same_phase * turns
    return whole if turns and is_closed else None


def played_part(
    pressure: MovingPressure, fastest: float | None = None, frames: int | None = None
) -> tuple[float, int]:
    """Return the duration in s and the number of frames of an animation.

    The duration is the period of the whole pattern, or the time after which it nearly repeats. The
    number of frames, unless given, follows from the `fastest` strong line in Hz, by default the
    fastest repetition. If it exceeds the limit, only the part with the smallest phase jump is
    played.
    """
    span, tacton = pattern_period(pressure.tacton), pressure.tacton
    if fastest is None:
        fastest = max(repetition_frequencies(tacton).values(), default=0.0)
    needed = ceil(FRAMES.per_period * fastest * span * (1 - FRAMES.same_phase))
    if needed > (most := max(FRAMES.most, frames or 0)):
        longest = min(tacton.duration, most / FRAMES.per_period / fastest)
        span, needed = pattern_period(replace(tacton, duration=longest)), most
    return span, frames or max(needed, FRAMES.fewest)
