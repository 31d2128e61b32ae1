"""Names of the spectral lines of a load, derived from its own spectrum.

Every line of a load lies at |n f_d + p f_AM + q f_AM2 + r f_e + u f_s + v f_r|: whole multiples of
the drawing frequency, the three sinusoids, and one over the periods of a signal and a rhythm.
Strengths are products of Fourier coefficients, with the drive law as a polynomial of the modulation
and a factor of the level.

A name is the sum without the bars, such as "2f_AM" or "f_d+f_AM-f_e". f_d comes first and is
positive: "2f_d-f_AM" is |2 f_d - f_AM|. Without f_d the whole sum is positive: "f_AM2-f_AM". Lines
that coincide take the name with the least sum of orders, sinusoids before the path.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simple_model.load.path_cells import is_cut_short, without_sampled_parts
from simple_model.load.pressure import MovingPressure
from simple_model.load.spectrum import (
    ALIASED,
    foci_harmonics,
    gain_orders,
    path_strengths,
    unbounded_harmonics_error,
)
from simple_model.load.tacton import Tacton, repetition_frequencies
from simple_model.typing import Complex, Floats, Ints

SYMBOLS = ("f_d", "f_AM", "f_AM2", "f_e", "f_s", "f_r")
WEAKEST = 1e-3  # of the strongest line: -60 dB
MOST = 200  # lines
SAME_LINE = 1e-3  # over the duration: closer lines in Hz coincide
FEWEST_CYCLES = 4 / 3  # of a rhythm or signal: one remains after a quarter of the Tacton


@dataclass(frozen=True, kw_only=True, eq=False)
class LineNames:
    """Names (f,), distinct ascending frequencies (f,) in Hz > 0, and strengths (f,) in Pa of lines.

    Strengths are the largest amplitudes on the path; 0 for candidates that are not in the load.
    """

    names: tuple[str, ...]
    frequencies: Floats
    strengths: Floats

    def some(self, chosen: ArrayLike) -> "LineNames":
        """The lines of a mask or of indices."""
        which = np.arange(len(self.names))[np.asarray(chosen)]
        return LineNames(
            names=tuple(self.names[k] for k in which), frequencies=self.frequencies[which],
            strengths=self.strengths[which],
        )  # fmt: skip

    def with_more(self, more: "LineNames") -> "LineNames":
        """These lines and others, in ascending order."""
        f = np.concatenate([self.frequencies, more.frequencies])
        strengths = np.concatenate([self.strengths, more.strengths])
        both = LineNames(names=(*self.names, *more.names), frequencies=f, strengths=strengths)
        return both.some(np.argsort(f, kind="stable"))


def named_lines(
    pressure: MovingPressure,
    threshold: float = WEAKEST,
    *,
    most: int = MOST,
    candidates: Iterable[str] = (),
) -> dict[str, float]:
    """Return the frequencies in Hz of the lines of a load, by name.

    They are at most `most` lines, the strongest, above a fraction `threshold` of the strongest one,
    and the `candidates`; see `line_names`.

    >>> from simple_model import Tacton, Trajectory
    >>> circle = Trajectory(shape="circle", size=0.02, speed=12.0)
    >>> load = MovingPressure(tacton=Tacton(am_frequency=140.0, trajectory=circle), drive="linear")
    >>> {name: round(f, 1) for name, f in named_lines(load, 0.5).items()}
    {'f_d-f_AM': 51.0, 'f_AM': 140.0, '2f_d-f_AM': 242.0, 'f_d+f_AM': 331.0, '2f_d+f_AM': 522.0}
    """
    lines = line_names(pressure, threshold, most=most, candidates=candidates)
    return dict(zip(lines.names, lines.frequencies.tolist(), strict=True))


def line_names(
    pressure: MovingPressure,
    threshold: float = WEAKEST,
    *,
    most: int = MOST,
    candidates: Iterable[str] = (),
) -> LineNames:
    """Return the lines above a fraction of the strongest one on the path, without the mean.

    Candidates are added if the Tacton has their tones and they do not coincide with a listed line.
    A recording that runs only once has no f_d, and a rhythm or signal that does not repeat has no
    f_r or f_s: their lines have no names.
    """
    orders, strengths = _load_orders(pressure, threshold)
    of_tacton = symbols(pressure.tacton)
    more = [_orders(name) for name in candidates]
    more = [each for each in more if not (each[of_tacton == 0]).any()]
    both = np.vstack([orders, np.array(more, int).reshape(-1, len(SYMBOLS))])
    strengths = np.concatenate([strengths, np.zeros(len(more))])
    return _distinct(
        both, of_tacton, strengths, SAME_LINE / pressure.tacton.duration, threshold, most
    )


def during_pulses(pressure: MovingPressure) -> MovingPressure:
    """Return the load while a pulse is on: without its rhythm.

    If nothing else makes lines, return the load itself, because the rhythm is then its modulation.
    """
    if pressure.tacton.rhythm is None:
        return pressure
    steady = replace(pressure, tacton=replace(pressure.tacton, rhythm=None))
    return steady if line_names(steady).names else pressure


def line_frequency(tacton: Tacton, name: str) -> float | None:
    """Return the frequency in Hz of a line by its name; None if the Tacton does not have all its
    tones.

    >>> line_frequency(Tacton(am_frequency=140.0, envelope_frequency=5.0), "2f_AM-f_e")
    275.0
    """
    orders, of_tacton = _orders(name), symbols(tacton)
    return None if orders[of_tacton == 0].any() else abs(float(orders @ of_tacton))


def symbols(tacton: Tacton) -> Floats:
    """Frequencies (6,) in Hz of `SYMBOLS`; 0 for those that a Tacton does not have or repeat."""
    f_d, known = tacton.drawing_frequency, repetition_frequencies(tacton)
    # A line of its own takes 1.5 periods of a recording.
    once = tacton.trajectory.shape == "recorded" and f_d * tacton.duration < 1.5
    known["f_d"] = 0.0 if once else f_d
    for name in ("f_s", "f_r"):
        if known.get(name, 0.0) * tacton.duration < FEWEST_CYCLES * (1 - SAME_LINE):
            known[name] = 0.0
    return np.array([known.get(name, 0.0) for name in SYMBOLS])


def line_name(orders: Sequence[int], of_tacton: Floats) -> str:
    """Return the name of a line by its orders (6,) of `SYMBOLS`, whose frequencies (6,) are in Hz.

    >>> tacton = Tacton(am_frequency=140.0, envelope_frequency=5.0)
    >>> line_name((0, -2, 0, 1, 0, 0), symbols(tacton))
    '2f_AM-f_e'
    """
    terms = [(int(k), symbol) for k, symbol in zip(orders, SYMBOLS, strict=True) if k]
    positive = orders[0] > 0 or (orders[0] == 0 and np.dot(orders, of_tacton) > 0)
    terms = terms if positive else [(-k, symbol) for k, symbol in terms]
    if not orders[0]:
        terms.sort(key=lambda term: term[0] < 0)
    name = "".join(f"{'-' if k < 0 else '+'}{abs(k) if abs(k) > 1 else ''}{s}" for k, s in terms)
    return name.removeprefix("+")


def _orders(name: str) -> Ints:
    """Orders (6,) of `SYMBOLS` in a name; raises a ValueError for other names."""
    orders = np.zeros(len(SYMBOLS), int)
    terms = re.findall(r"([+-]?)(\d*)(f_[A-Za-z0-9]+)", name)
    if "".join(map("".join, terms)) != name or any(term[2] not in SYMBOLS for term in terms):
        raise ValueError(
            f"line name {name!r} is unknown; give a sum of multiples of {', '.join(SYMBOLS)}"
        )
    for sign, times, symbol in terms:
        orders[SYMBOLS.index(symbol)] += int(sign + (times or "1"))
    return orders


@lru_cache(maxsize=16)  # several models share a load; a rhythm takes some MB
def _load_orders(pressure: MovingPressure, threshold: float) -> tuple[Ints, Floats]:
    """Orders (f, 6) of the lines, and their amplitudes (f,) in Pa on the path."""
    tacton = pressure.tacton
    path = without_sampled_parts(pressure)
    if once := is_cut_short(path):  # its cells cover the whole load
        still = replace(
            tacton, am_frequency=0.0, second_am_frequency=0.0, envelope_frequency=0.0,
            rhythm=None, signal=None,
        )  # fmt: skip
        path = replace(path, tacton=still)
    n, share = path_strengths(path, 1e-10)
    share = share * np.abs(foci_harmonics(path, n))
    if once:
        share /= max(float(np.abs(path.gain(0.0))), 1e-300)
    gain, c = _gain_products(pressure, 1e-3 * threshold)
    of_tacton = symbols(tacton)
    if of_tacton[0] and not once:
        whole = n % tacton.n_paths == 0  # other harmonics of separate paths cancel
        n, share = n[whole] // tacton.n_paths, share[whole]
    else:
        n, share = n[n == 0], share[n == 0]
    strongest = np.argsort(-share, kind="stable")[:400]
    n, share = n[strongest], share[strongest]
    orders = np.column_stack([np.repeat(n, len(gain)), np.tile(gain, (len(n), 1))])
    strengths = 2 * (share[:, None] * c).ravel()
    f = orders @ of_tacton
    strong = (f > SAME_LINE / tacton.duration) & (strengths > 0)
    strong &= strengths > 1e-2 * threshold * strengths[strong].max(initial=0.0)
    return orders[strong], strengths[strong]


def _gain_products(
    pressure: MovingPressure, threshold: float, samples: int = 2**14
) -> tuple[Ints, Floats]:
    """Orders (m, 5) of f_AM, f_AM2, f_e, f_s and f_r in the gain, and amplitudes (m,) in Pa, by a
    number of `samples` of the period of a rhythm or signal.
    """
    tacton, of_tacton = pressure.tacton, symbols(pressure.tacton)
    factor, depth = pressure.law.level_factor, pressure.depth_of_modulation
    of_signal, powers = np.ones((1, 1), np.complex128), np.ones(1, np.complex128)
    orders, coefficients = gain_orders(without_sampled_parts(pressure))
    signal, rhythm = tacton.signal, tacton.rhythm
    if signal is not None and of_tacton[4]:
        values = signal.at(_middles(max(samples, 2 * len(signal.samples))) / of_tacton[4])
        if signal.role == "envelope":
            of_signal = _fourier(factor(values, depth))[None]
        else:
            orders, coefficients = _in_powers(pressure)
            of_signal = np.stack([_fourier(values**j) for j in range(len(coefficients))])
    if rhythm is not None and of_tacton[5]:
        powers = _fourier(factor(rhythm.level(_middles(samples) * rhythm.period), depth))
    c = np.abs(np.einsum("jm,ju->mu", coefficients, of_signal))
    (m, u), c = _strongest(c, threshold)
    (k, v), c = _strongest(c[:, None] * np.abs(powers), threshold)
    n, p = of_signal.shape[1], len(powers)
    signed = np.where(u > n // 2, u - n, u)[k], np.where(v > p // 2, v - p, v)
    return np.column_stack([orders[m[k]], *signed]), c


def _in_powers(pressure: MovingPressure) -> tuple[Ints, NDArray]:
    """Orders (m, 3) and coefficients (k, m) of the gain by powers 0 to k - 1 of a factor of the
    modulation.

    They interpolate at Chebyshev points and are checked between them.
    """
    law, plain = pressure.law, without_sampled_parts(pressure)
    for degree in (4, 8, 16, 32) if law.degree is None else (max(1, law.degree),):
        factors = np.cos(np.pi * np.arange(2 * degree + 1) / (2 * degree))
        powers = np.vander(factors, degree + 1, increasing=True)
        orders, at = gain_orders(plain, factors.tolist())
        coefficients = np.linalg.solve(powers[::2], at[::2])
        if np.abs(powers @ coefficients - at).max() <= ALIASED * np.abs(at).max():
            return orders, coefficients
    raise unbounded_harmonics_error(law)


def _middles(count: int) -> Floats:
    return np.asarray((np.arange(count) + 0.5) / count)


def _fourier(values: Floats) -> Complex:
    return np.asarray(np.fft.fft(values) / len(values))


def _strongest(c: Floats, threshold: float, most: int = 4000) -> tuple[tuple[Ints, Ints], Floats]:
    """Indices and values (k,) of the entries above a fraction of the largest, about `most`."""
    least = threshold * c.max(initial=0.0)
    if c.size > most:
        least = max(least, np.partition(c.ravel(), -most)[-most])
    rows, columns = np.nonzero((c >= least) & (c > 0))
    return (rows, columns), c[rows, columns]


def _distinct(
    orders: Ints, of_tacton: Floats, strengths: Floats, same: float, threshold: float, most: int
) -> LineNames:
    """Merge lines that coincide within `same` Hz, with the simplest name."""
    f = np.abs(orders @ of_tacton)
    order = np.argsort(f, kind="stable")
    order = order[f[order] > same]
    f, orders, strengths = f[order], orders[order], strengths[order]
    first = np.flatnonzero(np.diff(f, prepend=-np.inf) > same)
    group = np.cumsum(np.diff(f, prepend=-np.inf) > same) - 1
    # Sinusoids before the path, where sums of orders are the same.
    effort = np.abs(orders).sum(axis=1) + 0.1 * (orders[:, 0] != 0) + 0.01 * np.count_nonzero(
        orders, axis=1)  # fmt: skip
    simplest = np.lexsort((-strengths, effort, group))[first]
    power = np.bincount(group, strengths**2).astype(np.float64)
    listed = np.bincount(group, strengths == 0) > 0  # candidates
    strongest = np.argsort(-power, kind="stable")[:most]
    listed[strongest] |= power[strongest] > threshold**2 * power.max(initial=0.0)
    names = tuple(line_name(orders[k].tolist(), of_tacton) for k in simplest[listed])
    return LineNames(names=names, frequencies=f[simplest[listed]], strengths=np.sqrt(power[listed]))
