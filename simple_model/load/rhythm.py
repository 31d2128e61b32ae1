"""Rhythms (pulses) and sampled signals, which modulate the amplitude of a Tacton in time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from simple_model.choices import check_numbers, check_range, choose
from simple_model.typing import Floats, Ints

ROLES = ("modulation", "envelope")


def between(knots: Floats, t: Floats, after: Floats) -> tuple[Ints, Floats]:
    """Index (...) of the last of rising knots (k,) that is not later than times `after` (...), and
    the fraction (...) of the way from it to the next knot at times t (...).
    """
    before = np.minimum(np.searchsorted(knots, after, side="right") - 1, len(knots) - 2)
    step = np.maximum(knots[before + 1] - knots[before], 1e-300)
    return before, np.clip((t - knots[before]) / step, 0.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class Rhythm:
    """Pulses and gaps, repeated from the start of the Tacton to its end.

    Parameters
    ----------
    pulses : (n, 2), s: duration of each pulse, above 0, and the gap after it, 0 or above
    ramp : float, s, linear rise at the start and fall at the end of each pulse, within the pulse

    Raises a ValueError if there is no pulse or a value is not finite or out of range.

    >>> rhythm = Rhythm(pulses=((0.05, 0.03),))  # 50 ms on, 30 ms off
    >>> rhythm.level([0.0, 0.06, 0.09])
    array([1., 0., 1.])
    """

    pulses: tuple[tuple[float, float], ...]
    ramp: float = 0.0

    def __post_init__(self) -> None:
        if not self.pulses:
            raise ValueError("a rhythm needs at least one pulse; add one or leave the rhythm out")
        for on, gap in self.pulses:
            if not (isfinite(on) and isfinite(gap) and on > 0 and gap >= 0):
                raise ValueError(
                    f"a pulse of {1e3 * on:g} ms with a gap of {1e3 * gap:g} ms is not allowed; "
                    "give a pulse above 0 ms and a gap of 0 ms or more"
                )
        longest = 1e3 * min(on for on, _ in self.pulses) / 2
        check_range("ramp", 1e3 * self.ramp, 0, longest, " ms", ", half the shortest pulse")

    @property
    def period(self) -> float:
        """Seconds after which the pulses repeat."""
        return float(np.sum(self.pulses))

    @cached_property
    def edges(self) -> Floats:
        """Times (k,) in s within a period at which the level jumps."""
        if self.ramp:
            return np.empty(0)
        lengths = np.array(self.pulses)
        starts = np.cumsum(lengths.sum(axis=1)) - lengths.sum(axis=1)
        gaps = lengths[:, 1] > 0
        return np.concatenate([starts[np.roll(gaps, 1)], (starts + lengths[:, 0])[gaps]])

    def level(self, t: ArrayLike) -> Floats:
        """Level (...), 0 to 1, at times (...) in s from the start of the Tacton."""
        knots, levels = self._knots
        t = np.asarray(t, np.float64)
        # The first sample of a pulse belongs to it, whatever the rounding of its time.
        into = np.mod(t / self.period + 1e-12, 1.0) * self.period
        before, part = between(knots, into, into)
        return np.asarray(levels[before] + part * (levels[before + 1] - levels[before]))

    @cached_property
    def _knots(self) -> tuple[Floats, Floats]:
        """Times (k,) in s and levels (k,) between which the level is linear."""
        starts = np.concatenate([[0.0], np.cumsum(np.sum(self.pulses, axis=1))])
        knots = [
            (start, start + self.ramp, start + on - self.ramp, start + on, end)
            for start, end, (on, _) in zip(starts, starts[1:], self.pulses, strict=False)
        ]
        return np.ravel(knots), np.tile([0.0, 1.0, 1.0, 0.0, 0.0], len(knots))


@dataclass(frozen=True, kw_only=True)
class Signal:
    """A sampled waveform, linear between samples and repeated to the end of the Tacton.

    Parameters
    ----------
    rate : float, Hz, samples per second
    samples : (k,) float, -1 to 1 for a modulation, 0 to 1 for an envelope
    role : "modulation" multiplies the AM sinusoids; "envelope" multiplies the amplitude, as a
        rhythm does

    Raises a ValueError if a value is unknown, not finite or out of range.
    """

    rate: float
    samples: tuple[float, ...]
    role: str = "modulation"

    def __post_init__(self) -> None:
        choose("signal role", self.role, ROLES)
        check_numbers("a signal", self, "rate")
        check_range("number of samples", len(self.samples), 2, 2_000_000, "", " of a signal")
        low = -1 if self.role == "modulation" else 0
        if not ((self._round >= low) & (self._round <= 1)).all():
            raise ValueError(
                f"samples of a signal must be between {low} and 1; scale them to full drive"
            )

    def at(self, t: ArrayLike) -> Floats:
        """Value (...) at times (...) in s."""
        at = np.mod(np.asarray(t, np.float64) * self.rate, len(self.samples))
        return np.asarray(np.interp(at, np.arange(len(self._round)), self._round))

    @cached_property
    def _round(self) -> Floats:
        """The samples, followed by the first one."""
        return np.array([*self.samples, self.samples[0]], np.float64)
