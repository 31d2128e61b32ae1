"""Line spectrum of a periodic load, exact, before any body responds to it.

    q(x, t) = Q(t) sum_j S(x - X(f_d t + a_j))
    Q = sum_m c_m exp(2 pi i f_m t),  S = sum_n s_n(x) exp(2 pi i n f_d t)

so that a line at f = f_m + n f_d has the pattern c_m s_n(x) sum_j exp(2 pi i n a_j): n foci at even
phases leave only every n-th harmonic of the path.

A rhythm or a signal makes Q more than a few sinusoids. The lines are then those of the Tacton
repeated periodically, at multiples of one over its duration. From rest that is the same load within
that time, by causality.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import lcm

import numpy as np
from numpy.typing import NDArray
from scipy import fft, sparse

from simple_model.drive import DriveLaw
from simple_model.focus import spot_detail, spot_reach
from simple_model.pressure import MovingPressure, check_lines
from simple_model.tacton import Tacton, modulation_at_phases, tones
from simple_model.trajectory import Floats

Complex = NDArray[np.complex128]

FEWEST_KNOTS = 132  # positions along a closed path: all harmonics below 66 f_d
KNOTS_PER_WIDTH = 8  # of the focal spot, which makes corners accurate to 1e-4
PHASES = 8  # of each sinusoid at least; more than twice the degree of a drive law
MOST_PHASES = 2**10, 2**20  # of one sinusoid, and of all, for a drive law that is no polynomial
ALIASED = 1e-4  # of the strongest: a drive law's harmonics beyond those that are sampled
HIGHEST = 10_000.0  # Hz of the lines of pulses and recordings: the rest moves bodies by 0.1 %
SAMPLED = 40_000.0  # Hz at which a rhythm or signal is averaged
MOST_SAMPLED = 50_000_000  # lines of a rhythm or signal, some hundred megabytes


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadSpectrum:
    """Spectral lines of a load at `frequencies` (f,) in Hz >= 0, several of which may coincide.

    Re (`coefficients` (f,) in Pa times harmonic `harmonics` (f,) of the focal spot along the path
    times exp(2 pi i f t)) is the pressure of a line; `strengths` (f,) in Pa is its largest
    amplitude on the path.
    """

    frequencies: Floats
    harmonics: NDArray[np.int_]
    coefficients: Complex
    strengths: Floats

    def gather(self, of_path: Complex) -> tuple[Floats, Complex]:
        """Distinct frequencies (g,) in Hz and the sum (g, ...) of the lines at each, from the
        harmonics (n, ...) along the path.
        """
        distinct, which = np.unique(np.round(self.frequencies, 9), return_inverse=True)
        shape = (len(distinct), len(of_path))
        orders = self.harmonics % len(of_path)
        table = sparse.csr_array((self.coefficients, (which, orders)), shape=shape)
        return distinct, np.asarray(table @ of_path)


def load_lines(pressure: MovingPressure, threshold: float = 1e-6) -> LoadSpectrum:
    """Lines whose pressure, at the path, exceeds a fraction of the strongest line's; of a load
    that is zero, the mean alone.

    Raises
    ------
    ValueError
        As `pressure.check_lines` does.
    """
    check_lines(pressure)
    n, of_spot = path_strengths(pressure, threshold)
    f, c = (_sampled_lines if pressure.tacton.is_sampled else _sinusoid_lines)(pressure, n)
    f, order = np.round(f, 9), np.repeat(n, f.shape[1])  # f_AM - 2 f_d may be 0 but for round-off
    c = (c * foci_harmonics(pressure, n)[:, None]).ravel() * np.where((f := f.ravel()) > 0, 2, 1)
    strength = np.abs(c) * np.repeat(of_spot, f.size // len(n))
    kept = (f >= 0) & (strength > threshold * strength.max())
    if pressure.tacton.trajectory.shape == "recorded":
        kept &= f <= HIGHEST
    if not kept.any():
        kept = (order == 0) & (f == 0)
    return LoadSpectrum(
        frequencies=np.abs(f[kept]),
        harmonics=order[kept],
        coefficients=c[kept],
        strengths=strength[kept],
    )


def pressure_lines(
    pressure: MovingPressure, points: Floats, threshold: float = 1e-6
) -> tuple[Floats, Complex]:
    """Load spectrum at points of the surface.

    Parameters
    ----------
    pressure : MovingPressure
    points : (n, 2 or 3) float, metre
    threshold : as of `load_lines`

    Returns
    -------
    frequencies : (f,) float, Hz, of the distinct lines
    amplitudes : (f, n) complex, Pa
    """
    spots = pressure.spot(points, path_samples(pressure)) * path_weights(pressure)[:, None]
    return load_lines(pressure, threshold).gather(path_fourier(spots.T).T)


def reduced_lines(pressure: MovingPressure, points: Floats, load: Floats) -> tuple[Floats, Complex]:
    """Load spectrum in reduced coordinates.

    Parameters
    ----------
    pressure : MovingPressure
    points : (k, 2 or 3) float, metre, of the surface
    load : (k, r) float, reduced forces of unit pressure at each point

    Returns
    -------
    frequencies : (f,) float, Hz, of the distinct lines
    forces : (f, r) complex, reduced forces of the lines

    Raises
    ------
    ValueError
        As `pressure.check_lines` does.
    """
    return load_lines(pressure).gather(path_forces(pressure, points, load))


def path_forces(pressure: MovingPressure, points: Floats, load: Floats) -> Complex:
    """Reduced forces of unit pressure on the path, by harmonic of the path.

    Parameters
    ----------
    pressure, points, load : as for `reduced_lines`; the modulation does not matter

    Returns
    -------
    (n, r) complex, -n is harmonic -n
    """
    knots, reach = path_samples(pressure), spot_reach(pressure.height, pressure.profile)
    forces = []
    for part in np.array_split(knots, len(knots) // 64 + 1):
        low, high = part.min(axis=0) - reach, part.max(axis=0) + reach
        near = ((points[:, :2] > low) & (points[:, :2] < high)).all(axis=1)
        forces.append(pressure.spot(points[near], part) @ load[near])
    weighted = np.vstack(forces) * path_weights(pressure)[:, None]
    return path_fourier(weighted.T).T


def path_strengths(pressure: MovingPressure, threshold: float) -> tuple[NDArray[np.int_], Floats]:
    """Orders (n,) of the harmonics of one focus along the path that, with all foci, exceed a
    fraction of the strongest, and 0; and their largest amplitude (n,) at about eight points of it.
    """
    of_spot = _largest_harmonics(pressure)
    n = harmonics(len(of_spot))
    share = np.abs(foci_harmonics(pressure, n)) * of_spot[n]
    heard = (share > threshold * share.max()) | (n == 0)
    return n[heard], of_spot[n[heard]]


@lru_cache(maxsize=8)  # lines, their names and maps are of the same load
def _largest_harmonics(pressure: MovingPressure) -> Floats:
    found = np.abs(path_fourier(_swept(pressure))).max(axis=0)
    found.setflags(write=False)
    return found


def foci_harmonics(pressure: MovingPressure, n: NDArray[np.int_]) -> Complex:
    """Array factor (k,) of all foci on harmonics n (k,) of one: 1 for a single focus."""
    return np.asarray(np.exp(2j * np.pi * n[:, None] * pressure.tacton.foci).sum(axis=1))


def path_samples(pressure: MovingPressure) -> Floats:
    """Sample positions (k, 2) in metre along one period of the path; one if the focus is static.

    They are the middles of k equal parts, between which corners and jumps of the path fall.
    """
    path = pressure.tacton.trajectory
    return path.at_phase(_knot_phases(pressure))


def path_weights(pressure: MovingPressure) -> Floats:
    """Factors (k,) of a recording's levels on the pressure at `path_samples`; 1 without levels."""
    return pressure.weight(_knot_phases(pressure))


def harmonics(knots: int) -> NDArray[np.int_]:
    """Orders of the harmonics of `path_fourier` that so many knots resolve, ascending."""
    return np.arange(-((knots - 1) // 2), (knots + 1) // 2)


def path_fourier(values: Floats | Complex) -> Complex:
    """Fourier coefficients (..., n) of values (..., k) at `path_samples`; -n is harmonic -n."""
    k = values.shape[-1]
    shift = np.exp(-1j * np.pi * np.fft.fftfreq(k))
    return np.asarray(fft.fft(values, axis=-1) * (shift / k))


def synthesise(frequencies: Floats, amplitudes: Complex, times: Floats) -> Floats:
    """Fourier synthesis Re sum a exp(2 pi i f t).

    Parameters
    ----------
    frequencies : (f,) float, Hz
    amplitudes : (f, p) complex
    times : (t,) float, s

    Returns
    -------
    (t, p) float, in the unit of the amplitudes
    """
    turn = np.exp(2j * np.pi * np.outer(times, frequencies))
    return np.asarray(turn.real @ amplitudes.real - turn.imag @ amplitudes.imag)


def merge_lines(frequencies: Floats, amplitudes: Complex) -> tuple[Floats, Complex]:
    """Lines merged by frequency: distinct ones (g,) in Hz and the sums (g, ...) of amplitudes."""
    distinct, which = np.unique(np.round(frequencies, 9), return_inverse=True)
    total = np.zeros((len(distinct), *amplitudes.shape[1:]), np.complex128)
    np.add.at(total, which, amplitudes)
    return distinct, total


def _knot_phases(pressure: MovingPressure) -> Floats:
    """Fractions (k,) of the period, the middles of equal parts of it; 0 if the focus is static."""
    path = pressure.tacton.trajectory
    if path.is_static:
        return np.zeros(1)
    width = spot_detail(pressure.height, pressure.profile)
    if path.shape == "recorded":
        enough, whole = _recorded_knots(pressure.tacton, width)
    else:
        enough, whole = KNOTS_PER_WIDTH * path.length / width, 12
    if pressure.heading:  # which jumps at corners
        enough = max(enough, 2.5 * HIGHEST / path.drawing_frequency)
    k = whole * int(np.ceil(max(enough, FEWEST_KNOTS) / whole))
    return (np.arange(k) + 0.5) / k


def _recorded_knots(tacton: Tacton, width: float) -> tuple[float, int]:
    """Number of knots that a recording needs for a focal spot of a width in metre, and what they
    are a multiple of: enough for all lines up to `HIGHEST` or, if nothing about it is abrupt within
    a path, for its fastest part.
    """
    path, n = tacton.trajectory, tacton.n_paths
    clock, period = np.array(path.times), path.times[-1]
    steps = np.diff(clock)
    moves = steps > 0
    even = np.ptp(steps[moves]) < 1e-9 * period
    whole = lcm(int(moves.sum()), n) if even else 12 * n
    lines = 2.5 * HIGHEST * period
    jumps = clock[1:][~moves] * n / period
    if path.levels or path.hold or np.abs(jumps - np.round(jumps)).max(initial=0.0) > 1e-9:
        return max(KNOTS_PER_WIDTH * path.length / width, lines), whole
    lengths = np.linalg.norm(np.diff(path.outline, axis=0), axis=1)
    fastest = float((lengths[moves] / steps[moves]).max())
    return min(KNOTS_PER_WIDTH * fastest * period / width, lines), whole


def _swept(pressure: MovingPressure) -> Floats:
    """Focal spot (8, k) at about eight points of the path while the focus runs along it."""
    knots = path_samples(pressure)
    watched = knots[:: max(1, len(knots) // 8)][:9]
    return (pressure.spot(watched, knots) * path_weights(pressure)[:, None]).T


def _sampled_lines(pressure: MovingPressure, n: NDArray[np.int_]) -> tuple[Floats, Complex]:
    """Frequencies (n, k) in Hz and coefficients (n, k) in Pa of the gain as harmonics n see it.

    Sampled averages of the gain; averaging takes sin(x)/x off its lines, which is put back.

    Raises
    ------
    ValueError
        If there are more than `MOST_SAMPLED` of them.
    """
    tacton = pressure.tacton
    count = max(2, int(np.ceil(tacton.duration * SAMPLED)))
    dt = tacton.duration / count
    t = (np.arange(count) + 0.5) * dt
    gain = pressure.gain(t, over=dt)
    k = np.arange(min(count // 2, int(HIGHEST * tacton.duration) + 1))
    if len(n) * len(k) > MOST_SAMPLED:
        raise ValueError(
            f"a rhythm or signal on this path makes {len(n) * len(k):,} lines, the limit is "
            f"{MOST_SAMPLED:,}; shorten the Tacton or the path, or put the rhythm into its levels"
        )
    middle = np.exp(-1j * np.pi * k / count) / count
    f_d = tacton.trajectory.drawing_frequency
    c = np.empty((len(n), len(k)), np.complex128)
    for row, order in zip(c, n, strict=True):
        transform = np.fft.fft(gain * np.exp(2j * np.pi * f_d * order * t))[k]
        averaged = np.sinc(np.clip(k / count - order * f_d * dt, -0.5, 0.5))
        row[:] = transform * middle / averaged
    return np.tile(k / tacton.duration, (len(n), 1)), c


def _sinusoid_lines(pressure: MovingPressure, n: NDArray[np.int_]) -> tuple[Floats, Complex]:
    """Lines as of `_sampled_lines`, of a gain that is made of sinusoids, exactly."""
    f, c = _gain_lines(pressure)
    f_d = pressure.tacton.trajectory.drawing_frequency
    return n[:, None] * f_d + f, np.broadcast_to(c, (len(n), len(c)))


def _gain_lines(pressure: MovingPressure) -> tuple[Floats, Complex]:
    """Frequencies (m,) in Hz of either sign and coefficients (m,) in Pa of the gain."""
    orders, (c,) = gain_orders(pressure)
    kept = np.abs(c) >= 1e-12 * np.abs(c).max()
    return orders[kept] @ np.array(tones(pressure.tacton)), c[kept]


def gain_orders(
    pressure: MovingPressure, factors: Sequence[float] = (1.0,)
) -> tuple[NDArray[np.int_], Complex]:
    """Orders (m, 3) of f_AM, f_AM2 and f_e in the gain, of either sign, and its coefficients (k, m)
    in Pa where the modulation is multiplied by factors (k,). All of a polynomial drive law; of
    another the phases are doubled until harmonics in the upper half of the orders are below
    `ALIASED`.

    Raises
    ------
    ValueError
        If `MOST_PHASES` are not enough for that.
    """
    law, n_tones = pressure.law, np.count_nonzero(tones(pressure.tacton))
    count = PHASES if law.degree is None else max(PHASES, 2 * law.degree + 2)
    each, together = MOST_PHASES
    while law.degree is not None or (count <= each and count**n_tones <= together):
        orders, c = _at_phases(pressure, factors, count)
        beyond = (4 * np.abs(orders) >= count).any(axis=1)
        strongest = np.abs(c).max()
        if law.degree is not None or np.abs(c[:, beyond]).max(initial=0.0) <= ALIASED * strongest:
            return orders, c
        count *= 2
    raise harmonics_unbounded(law)


def harmonics_unbounded(law: DriveLaw) -> ValueError:
    """Error of a drive law whose harmonics do not fall off."""
    return ValueError(
        f"the harmonics that drive law '{law}' makes of the modulation do not fall to {ALIASED:g} "
        "of the strongest; make it smoother, or modulate by fewer tones"
    )


def _at_phases(
    pressure: MovingPressure, factors: Sequence[float], count: int
) -> tuple[NDArray[np.int_], Complex]:
    """Orders (m, 3) and coefficients (k, m) from so many phases of each sinusoid."""
    tacton = pressure.tacton
    counts = [count if f else 1 for f in tones(tacton)]
    grid = np.meshgrid(*(2 * np.pi * np.arange(n) / n for n in counts), indexing="ij")
    modulation = modulation_at_phases(tacton, *grid)
    of_each = np.meshgrid(*(np.fft.fftfreq(n, 1 / n) for n in counts), indexing="ij")
    orders = np.stack([np.round(each).astype(int).ravel() for each in of_each], axis=1)
    driven = (pressure.driven(factor * modulation) for factor in factors)
    return orders, np.stack([(np.fft.fftn(each) / each.size).ravel() for each in driven])
