"""The lines that a periodic load contains, exactly, before any body has answered it.

    q(x, t) = Q(t) S(x - X(f_d t))
    Q = sum_m c_m exp(2 pi i f_m t),  S = sum_n s_n(x) exp(2 pi i n f_d t)

so that a line at f = f_m + n f_d has the pattern c_m s_n(x).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simple_model.focus import spot_width
from simple_model.pressure import MovingPressure
from simple_model.tacton import modulation_at_phases, tones
from simple_model.trajectory import Floats

Complex = NDArray[np.complex128]

FEWEST_KNOTS = 132  # positions along a closed path: all harmonics below 66 f_d
KNOTS_PER_WIDTH = 8  # of the spot, which makes corners right to 1e-4
PHASES = 8  # of each sinusoid: the drive laws are polynomials of second degree


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadLines:
    """Lines at `frequencies` (f,) in Hz >= 0, several of which may coincide.

    Re (`coefficients` (f,) in Pa times harmonic `harmonics` (f,) of the spot along the path
    times exp(2 pi i f t)) is the pressure of a line.
    """

    frequencies: Floats
    harmonics: NDArray[np.int_]
    coefficients: Complex


def load_lines(pressure: MovingPressure, threshold: float = 1e-6) -> LoadLines:
    """The lines whose pressure, at the path, exceeds a fraction of the strongest line's; of a load
    that is silent, the mean alone.
    """
    gain_f, gain_c = _gain_lines(pressure)
    f_d = pressure.tacton.trajectory.drawing_frequency
    of_spot = np.abs(along_path(_swept(pressure)))
    n = harmonics(of_spot.shape[-1])
    f = (n[:, None] * f_d + gain_f).ravel()
    c = np.broadcast_to(gain_c, (len(n), len(gain_c))).ravel() * np.where(f > 1e-9, 2, 1)
    order = np.repeat(n, len(gain_f))
    strength = np.abs(c) * of_spot.max(axis=0)[order]
    kept = (f > -1e-9) & (strength > threshold * strength.max())
    if not kept.any():
        kept = (order == 0) & (f == 0)
    return LoadLines(frequencies=np.abs(f[kept]), harmonics=order[kept], coefficients=c[kept])


def path_knots(pressure: MovingPressure) -> Floats:
    """Positions (k, 2) in metre along one period of the path; one if the focus rests.

    They are the middles of k equal parts, between which corners and jumps of the path fall.
    """
    path = pressure.tacton.trajectory
    if path.is_static:
        return path.at_phase(np.zeros(1))
    enough = max(FEWEST_KNOTS, KNOTS_PER_WIDTH * path.length / spot_width(pressure.height))
    k = 12 * int(np.ceil(enough / 12))
    return path.at_phase((np.arange(k) + 0.5) / k)


def harmonics(knots: int) -> NDArray[np.int_]:
    """Orders of the harmonics of `along_path` that so many knots tell apart, ascending."""
    return np.arange(-((knots - 1) // 2), (knots + 1) // 2)


def along_path(values: Floats | Complex) -> Complex:
    """Fourier coefficients (..., n) of values (..., k) at `path_knots`; -n is harmonic -n."""
    k = values.shape[-1]
    shift = np.exp(-1j * np.pi * np.fft.fftfreq(k))
    return np.asarray(np.fft.fft(values, axis=-1) / k * shift)


def summed(frequencies: Floats, amplitudes: Complex) -> tuple[Floats, Complex]:
    """Distinct frequencies (g,) in Hz and the sum (g, ...) of what falls on each."""
    distinct, which = np.unique(np.round(frequencies, 9), return_inverse=True)
    total = np.zeros((len(distinct), *amplitudes.shape[1:]), np.complex128)
    np.add.at(total, which, amplitudes)
    return distinct, total


def _swept(pressure: MovingPressure) -> Floats:
    """The spot (8, k) at about eight points of the path while the focus runs round."""
    knots = path_knots(pressure)
    return pressure.spot(knots[:: max(1, len(knots) // 8)], knots).T


def _gain_lines(pressure: MovingPressure) -> tuple[Floats, Complex]:
    """Frequencies (m,) in Hz of either sign and coefficients (m,) in Pa of the gain."""
    tacton = pressure.tacton
    angles = [
        2 * np.pi * np.arange(PHASES if f else 1) / (PHASES if f else 1) for f in tones(tacton)
    ]
    grid = np.meshgrid(*angles, indexing="ij")
    c = np.fft.fftn(pressure.driven(modulation_at_phases(tacton, *grid))) / grid[0].size
    orders = [np.fft.fftfreq(len(a), 1 / len(a)) for a in angles]
    f = sum(
        o * tone for o, tone in zip(np.meshgrid(*orders, indexing="ij"), tones(tacton), strict=True)
    )
    kept = np.abs(c) >= 1e-12 * np.abs(c).max()
    return np.asarray(f)[kept], c[kept]
