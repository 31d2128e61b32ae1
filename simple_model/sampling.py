"""Sampling of a load without aliasing: nothing of it may fold back to low frequencies.

Samples dt apart show a line at f > 1/(2 dt) at |f - k/dt| instead. A Gaussian focal spot of
standard deviation s that passes at speed v has the spectrum exp(-(2 pi f s / v)^2 / 2), and so a
focus that moves further than about s/2 in a sample makes lines above half the sampling rate.
"""

from collections.abc import Callable
from functools import lru_cache
from math import ceil

import numpy as np
from numpy.typing import NDArray

from simple_model.focus import spot_detail
from simple_model.load_spectrum import ALIASED, gain_orders
from simple_model.pressure import MovingPressure
from simple_model.response import step
from simple_model.tacton import Tacton, tones
from simple_model.trajectory import Floats

PASSED = 5.7 / (2 * np.pi)  # f s / v, at which a passing focal spot's spectrum is 1e-7
PER_PERIOD = 8  # samples of the highest frequency, so that its start is accurate, too
BRIEF = 0.01  # of a recording's time, for which it may move faster: a jump has no highest line
REACH = 128  # samples on either side that a low pass weighs: it ends within 2 % of half the rate
STOP_BAND = ("kaiser", 10.0)  # 100 dB down

Complex = NDArray[np.complex128]


def highest(pressure: MovingPressure, passing: float) -> float:
    """Highest line in Hz of a load whose focus, by moving, makes lines up to `passing` Hz.

    Pulses have no highest line; they are averaged over a sample. A signal has half its own rate.
    """
    tacton = pressure.tacton
    first, second, envelope = tones(tacton)
    weights = np.array(tacton.superposition) > 0
    tone = max(first * weights[0], second * weights[1]) + envelope
    made = passing + _highest_order(pressure) * tone
    return max(made, tacton.signal.rate / 2 if tacton.signal else 0.0)


@lru_cache(maxsize=32)
def _highest_order(pressure: MovingPressure) -> int:
    """Highest order of a sinusoid in the gain: the degree of the drive law, or as its harmonics
    fall off.
    """
    if pressure.law.degree is not None:
        return pressure.law.degree
    orders, (c,) = gain_orders(pressure)
    return int(np.abs(orders[np.abs(c) > ALIASED * np.abs(c).max()]).max())


def highest_passing(pressure: MovingPressure) -> float:
    """Highest line in Hz, above 1e-7 of all, that the moving focus makes at a place."""
    return PASSED * _speed(pressure.tacton) / spot_detail(pressure.height, pressure.profile)


def reached(pressure: MovingPressure) -> float:
    """Highest line in Hz of a load at any place; 0, for unknown, if it is no `MovingPressure`."""
    known = isinstance(pressure, MovingPressure)
    return highest(pressure, highest_passing(pressure)) if known else 0.0


def finer(highest: float, dt: float) -> int:
    """Samples within dt in s of a load up to `highest` Hz: one if nothing aliases."""
    return 1 if highest < 0.5 / dt else ceil(PER_PERIOD * highest * dt)


def shown(pressure: MovingPressure, frequencies: Floats, times: Floats) -> NDArray[np.bool_]:
    """Mask of the lines of a response that its times sample.

    Those below half the rate; but all of a load that does not alias. What edges and corners then
    leave above half the rate is next to nothing, and exact at each sample.

    Parameters
    ----------
    pressure : MovingPressure, the load
    frequencies : (f,) float, Hz
    times : (t,) float, s, equally spaced

    Returns
    -------
    (f,) bool
    """
    below = frequencies < 0.5 / step(times)
    return np.asarray(below | (fold_parts(pressure, times) == 1))


def fold_parts(pressure: MovingPressure, times: Floats) -> int:
    """Oversampling factor of a load at times (t,) in s, so that nothing aliases.

    One at fewer times than the low-pass filter has taps: they show the load at an instant, and no
    line.
    """
    if len(times) <= 2 * REACH:
        return 1
    return finer(reached(pressure), step(times))


def low_passed(load: Callable[[Floats], Floats], times: Floats, parts: int) -> Floats:
    """Low-pass-filtered load without aliasing, by a windowed sinc.

    Parameters
    ----------
    load : function of times (n,) in s, also before and after those given, to values (n, ...)
    times : (t,) float, s, equally spaced
    parts : how many times as finely the load is sampled; 1 for as it is

    Returns
    -------
    (t, ...) float, in the unit of the load
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
    hz = reached(pressure)
    return longest if hz < 0.5 / longest else 0.5 / hz


def transform(
    load: Callable[[float], Floats | Complex], w: Complex, dt: float, parts: int
) -> Complex:
    """Fourier transform of a load that is sampled more finely than its FFT.

    Parameters
    ----------
    load : function of a time in 0..dt, to every parts-th sample (n, ...) from there on
    w : (f,) complex, rad/s, frequencies of the FFT
    dt : s, between samples of the FFT
    parts : samples within each dt

    Returns
    -------
    (f, ...) complex, in the unit of the load
    """
    found = 0.0
    for late in np.arange(parts) * dt / parts:
        x = load(late)
        transformed = np.fft.fft if np.iscomplexobj(x) else np.fft.rfft
        turned = np.exp(-1j * w * late).reshape(-1, *(1,) * (x.ndim - 1)) / parts
        found = found + turned * transformed(x, axis=0)[: len(w)]
    return np.asarray(found)


def _speed(tacton: Tacton) -> float:
    """The greatest speed of a focus in m/s; of a recording but for `BRIEF` moves."""
    path = tacton.trajectory
    if path.shape != "recorded":
        return path.drawing_frequency * path.length * (np.pi / 2 if path.is_eased else 1.0)
    steps = np.diff(path.times)
    moves = steps > 0
    lengths = np.linalg.norm(np.diff(path.outline, axis=0), axis=1)
    speeds, lasting = lengths[moves] / steps[moves], steps[moves]
    order = np.argsort(speeds)
    passed = np.cumsum(lasting[order])
    at = np.searchsorted(passed, (1 - BRIEF) * passed[-1])
    return float(speeds[order[min(at, len(order) - 1)]])
