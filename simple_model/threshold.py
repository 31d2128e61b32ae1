"""Vibrotactile detection thresholds of the glabrous hand, and sensation levels above them.

Two channels, in dB re 1 um peak; the more sensitive one decides (Bolanowski et al., J Acoust Soc Am
84:1680, 1988, who have four; the other two need larger motions in this band):

    Pacinian      T = -20 + 12 log2(250 Hz / f)  below 250 Hz,  -20 + 9 log2(f / 250 Hz)  above
    non-Pacinian  T = +12

Reliability: the flat threshold up to 40 Hz and its fall by 12 dB per octave to a minimum near 250
Hz are Verrillo's (J Acoust Soc Am 35:1962, 1963; thenar, contactor of 2.9 cm2; only the abstract
was read). The levels -20 and +12 dB were not read in a source; they fit that slope to 0.3 dB. The
rise above 250 Hz is that of hairy skin. Above 500 Hz the line is extrapolated. People and
laboratories differ by ± `BAND`. A small contactor has a higher threshold in the Pacinian channel
(spatial summation), by 3 dB for each halving of its area: 7 dB from 2.9 cm2 to the 0.58 cm2 of a
focal spot.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from simple_model.choices import choose
from simple_model.typing import Floats

BAND = 5.0  # dB, between people and between laboratories
LOWEST, HIGHEST = 10.0, 1000.0  # Hz
AREAS = {"focal_spot": 7.0, "large_contactor": 0.0}  # dB, added in the Pacinian channel


def threshold(frequency: ArrayLike, area: str = "focal_spot") -> Floats:
    """Return the detection threshold (...) of displacement in m, peak, at frequencies (...) in Hz.

    The area is "focal_spot", 0.58 cm2, or "large_contactor", 2.9 cm2, as in the measurements;
    others raise a ValueError. The result is NaN below 10 and above 1000 Hz, where the curve does
    not apply.

    >>> 1e6 * threshold([40.0, 200.0]).round(8)  # micrometre
    array([3.98, 0.35])
    """
    choose("area", area, AREAS)
    f = np.asarray(frequency, np.float64)
    known = (f >= LOWEST) & (f <= HIGHEST)
    octaves = np.log2(np.where(known, f, 250.0) / 250.0)
    pacinian = -20 + AREAS[area] + np.where(octaves < 0, -12 * octaves, 9 * octaves)
    return np.where(known, 1e-6 * 10 ** (np.minimum(pacinian, 12.0) / 20), np.nan)


def pressure_threshold(frequency: ArrayLike) -> Floats:
    """Return the detection threshold (...) in Pa of a component of the pressure at a focus on skin.

    With AM at 200 Hz it is 4.4 Pa at the focus, the radiation pressure 2 p^2 / (rho c^2) of 556.9
    Pa of sound pressure (Howard et al., IEEE World Haptics 2019, as quoted by Lim, Park and Seifi,
    CHI 2024, arXiv 2405.02800; whether rms or peak is not stated). The component at 200 Hz is half
    of it. Other frequencies (...) in Hz follow the displacement threshold, as if compliance did not
    depend on frequency.
    """
    return np.asarray(4.4 / 2 * threshold(frequency) / threshold(200.0))


def sensation_level(
    amplitude: ArrayLike, frequency: ArrayLike, area: str = "focal_spot", *, unit: str = "m"
) -> Floats:
    """Return the sensation level (...) of lines in dB: their level above the detection threshold.

    It is that of a peak displacement (unit "m") or pressure ("Pa", see `pressure_threshold`) at
    frequencies (...) in Hz, and minus infinity if the amplitude is 0 or the threshold is unknown.
    The line with the highest level determines whether a signal is felt: channels do not add up.
    The area is that of `threshold`.

    >>> sensation_level([1e-6, 1e-5], 200.0).round(1)
    array([ 9.1, 29.1])
    """
    choose("unit", unit, ("m", "Pa"))
    least = threshold(frequency, area) if unit == "m" else pressure_threshold(frequency)
    with np.errstate(divide="ignore"):
        level = 20 * np.log10(np.abs(amplitude) / least)
    return np.nan_to_num(level, nan=-np.inf, neginf=-np.inf, posinf=np.inf)
