"""Exact line spectrum of a periodic load.

    q(x, t) = Q(t) sum_j S(x - X(f_d t + a_j))
    Q = sum_m c_m exp(2 pi i f_m t),  S = sum_n s_n(x) exp(2 pi i n f_d t)

A line at f = f_m + n f_d has the pattern c_m s_n(x) sum_j exp(2 pi i n a_j). With n foci at even
phases, only every n-th harmonic of the path remains.

With a rhythm or a signal, Q is more than a few sinusoids, and a path that jumps may be longer than
the Tacton. The lines are then those of the Tacton repeated periodically, at multiples of one over
its duration, like a path of that period with Q along it. By causality the motion from rest is the
same within that time.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy import sparse

from simple_model.load.drive import DriveLaw
from simple_model.load.focus import spot_reach
from simple_model.load.path_cells import (
    HIGHEST,
    harmonics,
    is_abrupt,
    path_cells,
    path_fourier,
    path_samples,
)
from simple_model.load.pressure import MovingPressure, check_lines
from simple_model.load.tacton import modulation_at_phases, tones
from simple_model.typing import Complex, Floats, Ints

ALIASED = 1e-4  # of the strongest: largest harmonic of a drive law beyond those sampled


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadSpectrum:
    """Spectral lines (f,) of a load at `frequencies` in Hz >= 0; several may coincide.

    The pressure of a line is Re(`coefficients` in Pa times harmonic `harmonics` of the focal spot
    along the path times exp(2 pi i f t)); `strengths` in Pa are their largest amplitudes.
    """

    frequencies: Floats
    harmonics: Ints
    coefficients: Complex
    strengths: Floats

    def gather(self, of_path: Complex) -> tuple[Floats, Complex]:
        """Distinct frequencies (g,) in Hz, and the sum (g, ...) of the lines at each, from the
        harmonics (n, ...) along the path.
        """
        distinct, which = np.unique(np.round(self.frequencies, 9), return_inverse=True)
        shape = (len(distinct), len(of_path))
        orders = self.harmonics % len(of_path)
        table = sparse.csr_array((self.coefficients, (which, orders)), shape=shape)
        return distinct, np.asarray(table @ of_path)


def load_lines(pressure: MovingPressure, threshold: float = 1e-6) -> LoadSpectrum:
    """Return the lines that exceed a fraction of the strongest line on the path; for a zero load,
    the mean.

    >>> from simple_model import Tacton
    >>> load = MovingPressure(tacton=Tacton(am_frequency=140.0), drive="pressure_squared")
    >>> lines = load_lines(load)
    >>> lines.frequencies, lines.strengths.round(2)  # Hz, Pa
    (array([  0., 140., 280.]), array([18.75, 25.  ,  6.25]))
    """
    check_lines(pressure)
    tacton, (n, of_spot) = pressure.tacton, path_strengths(pressure, threshold)
    whole, frequency = path_cells(pressure).of_tacton, path_cells(pressure).frequency
    tone, gain = np.zeros(1), np.ones(1, np.complex128)
    if not whole:
        gains, (gain,) = gain_orders(pressure)
        audible = np.abs(gain) >= 1e-12 * np.abs(gain).max()
        tone, gain = gains[audible] @ np.array(tones(tacton)), gain[audible]
    f = (n[:, None] * frequency + tone).ravel()
    f, order = np.round(f, 9), np.repeat(n, len(tone))  # f_AM - 2 f_d may be 0 but for round-off
    c = (foci_harmonics(pressure, n)[:, None] * gain).ravel() * np.where(f > 0, 2, 1)
    strength = np.abs(c) * np.repeat(of_spot, len(tone))
    strong = (f >= 0) & (strength > threshold * strength.max())
    if whole or tacton.trajectory.shape == "recorded" or is_abrupt(pressure):
        strong &= f <= HIGHEST
    if not strong.any():
        strong = (order == 0) & (f == 0)
    return LoadSpectrum(
        frequencies=np.abs(f[strong]), harmonics=order[strong], coefficients=c[strong],
        strengths=strength[strong],
    )  # fmt: skip


def lines_from_rest(pressure: MovingPressure, fewest: int = 20, n: int = 8) -> LoadSpectrum:
    """`load_lines`, adjusted to give a body the impulse of the load after its start.

    The lines of a jump d that end at a frequency F lack an impulse of d / (2 pi^2 F). Factors of 1
    + (n - 1) (f / F)^n, whose integral over 1/f^2 equals that of the lines beyond F, restore it.
    Fewer lines than `fewest` are left as they are.
    """
    lines, whole = load_lines(pressure), path_cells(pressure)
    few = whole.frequency * fewest > HIGHEST
    if few or not (whole.of_tacton or is_abrupt(pressure)):
        return lines
    raised = 1 + (n - 1) * (lines.frequencies / HIGHEST) ** n
    return replace(lines, coefficients=lines.coefficients * raised)


def pressure_lines(
    pressure: MovingPressure, points: Floats, threshold: float = 1e-6
) -> tuple[Floats, Complex]:
    """Frequencies (f,) in Hz of the distinct `load_lines`, and their complex amplitudes (f, n) in
    Pa at points (n, 2 or 3) in m of the surface.
    """
    lines, knots = load_lines(pressure, threshold), path_samples(pressure)
    points = np.asarray(points, np.float64)
    cells = path_cells(pressure).cells.shape[0]
    count = max(1, len(points) * cells // 2**24)  # some hundred megabytes at a time
    parts = [
        lines.gather(path_fourier(pressure, pressure.spot(some, knots).T).T)
        for some in np.array_split(points, count)
    ]
    return parts[0][0], np.hstack([amplitudes for _, amplitudes in parts])


def reduced_lines(pressure: MovingPressure, points: Floats, load: Floats) -> tuple[Floats, Complex]:
    """Frequencies (f,) in Hz of the distinct `lines_from_rest`, and their complex forces (f, r) in
    reduced coordinates.

    `load` (k, r) are the forces of unit pressure at points (k, 2 or 3).
    """
    return lines_from_rest(pressure).gather(path_forces(pressure, points, load))


def path_forces(pressure: MovingPressure, points: Floats, load: Floats) -> Complex:
    """Reduced forces (n, r) of unit pressure on the path, by harmonic of the path."""
    knots, reach = path_samples(pressure), spot_reach(pressure.height, pressure.profile)
    forces = []
    for part in np.array_split(knots, len(knots) // 64 + 1):
        low, high = part.min(axis=0) - reach, part.max(axis=0) + reach
        near = ((points[:, :2] > low) & (points[:, :2] < high)).all(axis=1)
        forces.append(pressure.spot(points[near], part) @ load[near])
    return path_fourier(pressure, np.vstack(forces).T).T


def path_strengths(pressure: MovingPressure, threshold: float) -> tuple[Ints, Floats]:
    """Orders (n,) of the harmonics of `path_cells` that matter, and their amplitudes (n,) on the
    path.

    These are order 0 and all that exceed a fraction of the strongest, with all foci. Amplitudes are
    the largest at about eight points of the path.
    """
    of_spot, n = _largest_harmonics(pressure), harmonics(pressure)
    share = np.abs(foci_harmonics(pressure, n)) * of_spot[n]
    chosen = (share > threshold * share.max()) | (n == 0)
    return n[chosen], of_spot[n[chosen]]


@lru_cache(maxsize=8)  # lines, their names and maps share a load
def _largest_harmonics(pressure: MovingPressure) -> Floats:
    knots = path_samples(pressure)
    spots = pressure.spot(knots[:: max(1, len(knots) // 8)][:9], knots).T
    largest = np.abs(path_fourier(pressure, spots)).max(axis=0)
    largest.setflags(write=False)
    return largest


def foci_harmonics(pressure: MovingPressure, n: Ints) -> Complex:
    """Array factor (k,) of all foci for harmonics n (k,) of one; 1 for cells of the Tacton."""
    if path_cells(pressure).of_tacton:
        return np.ones(len(n), np.complex128)
    return np.asarray(np.exp(2j * np.pi * n[:, None] * pressure.tacton.foci).sum(axis=1))


def synthesise(
    frequencies: Floats, amplitudes: Complex, times: Floats, products: int = 2**22
) -> Floats:
    """Waveforms (t, p) = Re sum a exp(2 pi i f t) of amplitudes a (f, p) at frequencies (f,) in Hz
    and times (t,) in s, with a number of `products` of amplitudes and exponentials at a time.

    >>> synthesise(np.array([0.0, 50.0]), np.array([[1.0 + 0j], [2j]]), np.array([0.0, 0.005]))
    array([[ 1.],
           [-1.]])
    """
    apart = np.diff(times)
    equal = len(times) > 1 and np.ptp(apart) <= 1e-9 * abs(apart[0])
    block = int(np.ceil(np.sqrt(len(times)))) if equal else max(1, len(times))
    # Exponentials are products of those within the first block of times and at the start of each.
    within = np.exp(2j * np.pi * np.outer(times[:block] - times[:1], frequencies))
    starts = np.exp(2j * np.pi * np.outer(frequencies, times[::block]))
    real, imag, p = within.real.copy(), within.imag.copy(), amplitudes.shape[1]
    values, some = [], max(1, products // max(1, amplitudes.size))
    for first in range(0, max(1, starts.shape[1]), some):
        turned = starts[:, first : first + some, None] * amplitudes[:, None]
        together = turned.reshape(len(frequencies), turned.shape[1] * p)
        summed = real @ together.real - imag @ together.imag
        shape = len(within), turned.shape[1], p
        values.append(summed.reshape(shape).swapaxes(0, 1).reshape(shape[0] * shape[1], p))
    return np.concatenate(values)[: len(times)]


def merge_lines(frequencies: Floats, amplitudes: Complex) -> tuple[Floats, Complex]:
    """Distinct frequencies (g,) in Hz, and the sums (g, ...) of the amplitudes at each."""
    distinct, which = np.unique(np.round(frequencies, 9), return_inverse=True)
    total = np.zeros((len(distinct), *amplitudes.shape[1:]), np.complex128)
    np.add.at(total, which, amplitudes)
    return distinct, total


def gain_orders(
    pressure: MovingPressure, factors: Sequence[float] = (1.0,)
) -> tuple[Ints, Complex]:
    """Fourier orders (m, 3) of f_AM, f_AM2 and f_e in the gain, and coefficients (k, m) in Pa.

    The modulation is multiplied by each of `factors` (k,). For a drive law that is not a
    polynomial, the number of phases is doubled until its harmonics fall below `ALIASED`. Raises a
    ValueError if 1024 phases of one sinusoid, or 2^20 of all, are not enough.
    """
    law, n_tones, count = pressure.law, np.count_nonzero(tones(pressure.tacton)), 8
    if law.degree is not None:
        return _at_phases(pressure, factors, max(count, 2 * law.degree + 2))
    while count <= 2**10 and count**n_tones <= 2**20:
        orders, c = _at_phases(pressure, factors, count)
        beyond = (4 * np.abs(orders) >= count).any(axis=1)
        if np.abs(c[:, beyond]).max(initial=0.0) <= ALIASED * np.abs(c).max():
            return orders, c
        count *= 2
    raise unbounded_harmonics_error(law)


def unbounded_harmonics_error(law: DriveLaw) -> ValueError:
    """Error for a drive law whose harmonics do not decay."""
    return ValueError(
        f"the harmonics of drive law '{law}' do not fall to {ALIASED:g} of the strongest; use a "
        "smoother law, or fewer tones"
    )


def _at_phases(
    pressure: MovingPressure, factors: Sequence[float], count: int
) -> tuple[Ints, Complex]:
    """Orders (m, 3) and coefficients (k, m) from `count` phases of each sinusoid."""
    tacton = pressure.tacton
    counts = [count if f else 1 for f in tones(tacton)]
    grid = np.meshgrid(*(2 * np.pi * np.arange(n) / n for n in counts), indexing="ij")
    modulation = modulation_at_phases(tacton, *grid)
    of_each = np.meshgrid(*(np.fft.fftfreq(n, 1 / n) for n in counts), indexing="ij")
    orders = np.stack([np.round(each).astype(int).ravel() for each in of_each], axis=1)
    gain_at = (pressure.gain_at(factor * modulation) for factor in factors)
    return orders, np.stack([(np.fft.fftn(each) / each.size).ravel() for each in gain_at])
