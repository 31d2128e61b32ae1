"""Sampling of a load without aliasing: nothing of it may fold back to low frequencies.

Samples dt apart show a line at f > 1/(2 dt) at |f - k/dt| instead. A Gaussian focal spot of
standard deviation s that passes at speed v has the spectrum exp(-(2 pi f s / v)^2 / 2), and so a
focus that moves further than about s/2 in a sample makes lines above half the sampling rate.
"""

from collections.abc import Callable
from functools import lru_cache
from math import ceil

import numpy as np

from simple_model.load.path_cells import highest_passing, is_abrupt
from simple_model.load.pressure import MovingPressure
from simple_model.load.spectrum import ALIASED, gain_orders
from simple_model.load.tacton import tones
from simple_model.typing import Bools, Floats

SLOWEST = 10_000.0  # Hz of samples that show all of a body's motion
PER_PERIOD = 8  # samples of the highest frequency, so that its start is accurate, too
REACH = 128  # samples on either side that a low pass weighs: it ends within 2 % of half the rate
STOP_BAND = ("kaiser", 10.0)  # 100 dB down


def step(times: Floats) -> float:
    """Sampling interval in s of equally spaced times (t,)."""
    return float((times[-1] - times[0]) / (len(times) - 1))


def highest(pressure: MovingPressure, passing: float) -> float:
    """Highest line in Hz of a load whose moving focus makes lines up to `passing` Hz. Pulses,
    averaged over a sample, have none; a signal has half its own rate.
    """
    tacton = pressure.tacton
    first, second, envelope = tones(tacton)
    weights = np.array(tacton.superposition) > 0
    tone = max(first * weights[0], second * weights[1]) + envelope
    made = passing + _highest_order(pressure) * tone
    return max(made, tacton.signal.rate / 2 if tacton.signal else 0.0)


@lru_cache(maxsize=32)
def _highest_order(pressure: MovingPressure) -> int:
    """Highest order of a sinusoid in the gain: the degree of the law, or as its harmonics fall."""
    if pressure.law.degree is not None:
        return pressure.law.degree
    orders, (c,) = gain_orders(pressure)
    return int(np.abs(orders[np.abs(c) > ALIASED * np.abs(c).max()]).max())


def highest_line(pressure: MovingPressure) -> float:
    """Highest line in Hz of a load at any place; 0, for unknown, if it is no `MovingPressure`."""
    known = isinstance(pressure, MovingPressure)
    return highest(pressure, highest_passing(pressure)) if known else 0.0


def oversampling(highest: float, dt: float) -> int:
    """Samples within dt in s of a load up to `highest` Hz: one if nothing aliases."""
    return 1 if highest < 0.5 / dt else ceil(PER_PERIOD * highest * dt)


def below_half_the_rate(frequencies: Floats, times: Floats) -> Bools:
    """Bools (f,) of frequencies (f,) in Hz that equally spaced times (t,) in s show as they are."""
    return np.asarray(frequencies < 0.5 / step(times))


def is_folded(pressure: MovingPressure, times: Floats) -> bool:
    """Whether a load may have lines above half the rate of times (t,) in s that count."""
    if not isinstance(pressure, MovingPressure):
        return False
    dt = step(times)
    if dt * SLOWEST > 1 + 1e-6:
        return True
    return oversampling(highest_line(pressure), dt) > 1 and not (
        pressure.tacton.is_sampled or is_abrupt(pressure)
    )


def highest_driving(pressure: MovingPressure, times: Floats) -> float:
    """Frequency in Hz below which lines of a load move a body at all, at times (t,) in s."""
    return 0.5 / step(times) if is_folded(pressure, times) else np.inf


def low_pass(load: Callable[[Floats], Floats], times: Floats, parts: int) -> Floats:
    """Load (t, ...) at equally spaced times (t,) in s without aliasing, by a windowed sinc: `load`
    is a function of times (n,), also before and after those given, sampled `parts` times as finely.
    """
    if parts == 1:
        return load(times)
    from scipy.signal import firwin, upfirdn  # half a second that few commands need

    dt = step(times)
    taps = firwin(2 * REACH * parts + 1, 1 / parts, window=STOP_BAND)
    around = np.arange(-REACH * parts, (len(times) - 1 + REACH) * parts + 1)
    filtered = upfirdn(taps, load(times[0] + around * (dt / parts)), down=parts, axis=0)
    return np.asarray(filtered[2 * REACH :][: len(times)])


def resolving_step(pressure: MovingPressure, longest: float) -> float:
    """Time step in s, at most `longest`, at which nothing of a load aliases."""
    hz = highest_line(pressure)
    return longest if hz < 0.5 / longest else 0.5 / hz
