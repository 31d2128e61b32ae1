"""Sampling of a load without aliasing.

Samples dt apart show a line at f > 1/(2 dt) at |f - k/dt| instead. A Gaussian focal spot of
standard deviation s that passes at speed v has the spectrum exp(-(2 pi f s / v)^2 / 2). A focus
that moves by more than about s/2 in a sample therefore makes lines above half the sampling rate.
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


def step(times: Floats) -> float:
    """Sampling interval in s of equally spaced times (t,)."""
    return float((times[-1] - times[0]) / (len(times) - 1))


@lru_cache(maxsize=32)
def _highest_order(pressure: MovingPressure) -> int:
    """Highest order of a sinusoid in the gain: the degree of the law, or where harmonics vanish."""
    if pressure.law.degree is not None:
        return pressure.law.degree
    orders, (c,) = gain_orders(pressure)
    return int(np.abs(orders[np.abs(c) > ALIASED * np.abs(c).max()]).max())


def highest_line(pressure: MovingPressure) -> float:
    """Highest line in Hz of a load at any place; 0, unknown, for a load of another type.

    The edges of a rhythm do not count; a signal counts with half its rate.
    """
    if not isinstance(pressure, MovingPressure):
        return 0.0
    tacton = pressure.tacton
    first, second, envelope = tones(tacton)
    weights = np.array(tacton.superposition) > 0
    tone = max(first * weights[0], second * weights[1]) + envelope
    highest = highest_passing(pressure) + _highest_order(pressure) * tone
    return max(highest, tacton.signal.rate / 2 if tacton.signal else 0.0)


def oversampling(highest: float, dt: float) -> int:
    """Samples per interval dt in s for lines up to `highest` Hz; 1 if nothing aliases."""
    return 1 if highest < 0.5 / dt else ceil(8 * highest * dt)  # so that their start is accurate


def below_half_the_rate(frequencies: Floats, times: Floats) -> Bools:
    """Whether frequencies (f,) in Hz are below half the rate of equally spaced times (t,) in s."""
    return np.asarray(frequencies < 0.5 / step(times))


def is_folded(pressure: MovingPressure, times: Floats) -> bool:
    """Whether lines above half the rate of times (t,) in s may matter."""
    if not isinstance(pressure, MovingPressure):
        return False
    dt = step(times)
    if dt * 10_000.0 > 1 + 1e-6:  # samples at 10 kHz show all motion of a body
        return True
    return oversampling(highest_line(pressure), dt) > 1 and not (
        pressure.tacton.is_sampled or is_abrupt(pressure)
    )


def highest_driving(pressure: MovingPressure, times: Floats) -> float:
    """Highest frequency in Hz at which a load moves a body that is sampled at times (t,) in s."""
    return 0.5 / step(times) if is_folded(pressure, times) else np.inf


def low_pass(
    load: Callable[[Floats], Floats], times: Floats, parts: int, reach: int = 128
) -> Floats:
    """Load (t, ...) at equally spaced times (t,) in s without aliasing, by a windowed sinc.

    `load` is a function of times (n,), also outside the given ones, sampled `parts` times as
    finely. The filter ends within 2 % of half the rate, because it has a `reach` of many samples.
    """
    if parts == 1:
        return load(times)
    from scipy.signal import firwin, upfirdn  # slow to import

    dt = step(times)
    taps = firwin(2 * reach * parts + 1, 1 / parts, window=("kaiser", 10.0))  # 100 dB down
    around = np.arange(-reach * parts, (len(times) - 1 + reach) * parts + 1)
    filtered = upfirdn(taps, load(times[0] + around * (dt / parts)), down=parts, axis=0)
    return np.asarray(filtered[2 * reach :][: len(times)])


def resolving_step(pressure: MovingPressure, longest: float) -> float:
    """Largest time step in s, at most `longest`, at which no line of a load aliases."""
    hz = highest_line(pressure)
    return longest if hz < 0.5 / longest else 0.5 / hz
