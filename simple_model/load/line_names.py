"""Names of the spectral lines of a load, derived from its own spectrum.

Every line of a load lies at |n f_d + p f_AM + q f_AM2 + r f_e + u f_s + v f_r|, whole multiples of
the path's drawing frequency, of the three sinusoids, and of one over the periods of a signal and a
rhythm. Strengths follow from products of Fourier coefficients, with the drive law as a polynomial
of the modulation and a factor of the level.

Names are the sums without the bars, such as "2f_AM" or "f_d+f_AM-f_e". f_d comes first and is
positive: "2f_d-f_AM" is |2 f_d - f_AM|; without f_d the whole is positive: "f_AM2-f_AM". Lines that
coincide have the name of the least sum of orders, sinusoids before the path.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simple_model.load.path_cells import is_cut_short, unsampled
from simple_model.load.pressure import MovingPressure
from simple_model.load.spectrum import (
    ALIASED,
    foci_harmonics,
    gain_orders,
    harmonics_unbounded,
    path_strengths,
)
from simple_model.load.tacton import Tacton, tones
from simple_model.typing import Complex, Floats, Ints

SYMBOLS = ("f_d", "f_AM", "f_AM2", "f_e", "f_s", "f_r")
WEAKEST = 1e-3  # of the strongest line: -60 dB
MOST = 200  # lines
SAME = 1e-3  # over the duration: lines as near to each other in Hz coincide
TWICE = 1.5  # periods: what is repeated less often makes no line of its own
PULSED = 2**14  # samples of a period of a rhythm or signal
ROUND_OFF = 1e-10  # of the strongest harmonic of the path, its mean
MOST_HARMONICS = 400  # of a path that are combined with the others
MOST_PRODUCTS = 4000  # orders of the gain that are combined with the path's
DEGREES = (4, 8, 16, 32)  # of polynomials that are fitted to a drive law that is none


@dataclass(frozen=True, kw_only=True, eq=False)
class LineNames:
    """Names (f,), distinct ascending frequencies (f,) in Hz > 0, and largest amplitudes on the path
    (f,) in Pa, 0 of candidates that are not in the load.
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
        """These lines and more, in ascending order."""
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
    """Names and frequencies of the lines of a load, as `line_names`.

    Parameters
    ----------
    pressure : MovingPressure
    threshold : of the strongest line, 0..1
    most : how many of them are listed, the strongest
    candidates : names of lines that are listed in any case

    Returns
    -------
    frequencies in Hz by name
    """
    found = line_names(pressure, threshold, most=most, candidates=candidates)
    return dict(zip(found.names, found.frequencies.tolist(), strict=True))


def line_names(
    pressure: MovingPressure,
    threshold: float = WEAKEST,
    *,
    most: int = MOST,
    candidates: Iterable[str] = (),
) -> LineNames:
    """Lines above a fraction of the strongest on the path, the mean left out, and candidates, as
    far as the Tacton has their tones and they do not coincide with one that is listed.

    A path that is recorded and run through once has no f_d, and a rhythm or signal that is not
    repeated no f_r or f_s: their lines have no names.
    """
    orders, strengths = _load_orders(pressure, threshold)
    of_tacton = symbols(pressure.tacton)
    asked = [_orders(name) for name in candidates]
    asked = [each for each in asked if not (each[of_tacton == 0]).any()]
    both = np.vstack([orders, np.array(asked, int).reshape(-1, len(SYMBOLS))])
    strengths = np.concatenate([strengths, np.zeros(len(asked))])
    return _distinct(both, of_tacton, strengths, SAME / pressure.tacton.duration, threshold, most)


def line_frequency(tacton: Tacton, name: str) -> float | None:
    """Frequency in Hz of a line by its name; None if the Tacton has not all of its tones."""
    orders, of_tacton = _orders(name), symbols(tacton)
    return None if orders[of_tacton == 0].any() else abs(float(orders @ of_tacton))


def symbols(tacton: Tacton) -> Floats:
    """Frequencies (6,) in Hz of `SYMBOLS`, 0 of those that a Tacton does not repeat."""
    w1, w2 = tacton.superposition
    f_1, f_2, f_e = tones(tacton)
    signal, rhythm = tacton.signal, tacton.rhythm
    f_d = tacton.drawing_frequency
    once = tacton.trajectory.shape == "recorded" and f_d * tacton.duration < TWICE
    slow = (
        signal.rate / len(signal.samples) if signal else 0.0,
        1 / rhythm.period if rhythm else 0.0,
    )
    repeated = [f if f * tacton.duration >= TWICE else 0.0 for f in slow]
    return np.array([0.0 if once else f_d, f_1 * (w1 > 0), f_2 * (w2 > 0), f_e, *repeated])


def line_name(orders: Sequence[int], of_tacton: Floats) -> str:
    """The name of the line of orders (6,) of `SYMBOLS`, whose frequencies (6,) are in Hz."""
    terms = [(int(k), symbol) for k, symbol in zip(orders, SYMBOLS, strict=True) if k]
    positive = orders[0] > 0 or (orders[0] == 0 and np.dot(orders, of_tacton) > 0)
    terms = terms if positive else [(-k, symbol) for k, symbol in terms]
    if not orders[0]:
        terms.sort(key=lambda term: term[0] < 0)
    said = "".join(f"{'-' if k < 0 else '+'}{abs(k) if abs(k) > 1 else ''}{s}" for k, s in terms)
    return said.removeprefix("+")


def _orders(name: str) -> Ints:
    """Ints (6,) of `SYMBOLS` in a name; raises a ValueError if it is no sum of them."""
    found = np.zeros(len(SYMBOLS), int)
    terms = re.findall(r"([+-]?)(\d*)(f_[A-Za-z0-9]+)", name)
    if "".join(map("".join, terms)) != name or any(term[2] not in SYMBOLS for term in terms):
        raise ValueError(f"{name!r} is no line; add multiples of {', '.join(SYMBOLS)}")
    for sign, times, symbol in terms:
        found[SYMBOLS.index(symbol)] += int(sign + (times or "1"))
    return found


@lru_cache(maxsize=16)  # several models take each load; of one with a rhythm up to some MB
def _load_orders(pressure: MovingPressure, threshold: float) -> tuple[Ints, Floats]:
    """Ints (f, 6) of the lines and their amplitudes on the path (f,) in Pa."""
    tacton = pressure.tacton
    path = unsampled(pressure)
    if once := is_cut_short(path):  # whose cells are of all of the load
        still = replace(
            tacton, am_frequency=0.0, second_am_frequency=0.0, envelope_frequency=0.0,
            rhythm=None, signal=None,
        )  # fmt: skip
        path = replace(path, tacton=still)
    n, share = path_strengths(path, ROUND_OFF)
    share = share * np.abs(foci_harmonics(path, n))
    if once:
        share /= max(float(np.abs(path.gain(0.0))), 1e-300)
    gain, c = _gain_products(pressure, 1e-3 * threshold)
    of_tacton = symbols(tacton)
    if of_tacton[0] and not once:
        whole = n % tacton.n_paths == 0  # of paths of their own nothing else is left
        n, share = n[whole] // tacton.n_paths, share[whole]
    else:
        n, share = n[n == 0], share[n == 0]
    strongest = np.argsort(-share, kind="stable")[:MOST_HARMONICS]
    n, share = n[strongest], share[strongest]
    orders = np.column_stack([np.repeat(n, len(gain)), np.tile(gain, (len(n), 1))])
    strengths = 2 * (share[:, None] * c).ravel()
    f = orders @ of_tacton
    kept = (f > SAME / tacton.duration) & (strengths > 0)
    kept &= strengths > 1e-2 * threshold * strengths[kept].max(initial=0.0)
    return orders[kept], strengths[kept]


def _gain_products(pressure: MovingPressure, threshold: float) -> tuple[Ints, Floats]:
    """Ints (m, 5) of f_AM, f_AM2, f_e, f_s and f_r in the gain, and amplitudes (m,) in Pa."""
    tacton, of_tacton = pressure.tacton, symbols(pressure.tacton)
    factor = pressure.law.level_factor
    of_signal, powers = np.ones((1, 1), np.complex128), np.ones(1, np.complex128)
    coefficients, signal = None, tacton.signal
    if signal is not None and of_tacton[4]:
        samples = max(PULSED, 2 * len(signal.samples))
        values = signal.at((np.arange(samples) + 0.5) / samples * len(signal.samples) / signal.rate)
        if signal.role == "envelope":
            of_signal = _fourier(factor(values, pressure.depth_of_modulation))[None]
        else:
            orders, coefficients = _in_powers(pressure)
            of_signal = np.stack([_fourier(values**j) for j in range(len(coefficients))])
    if coefficients is None:
        orders, coefficients = gain_orders(unsampled(pressure))
    if tacton.rhythm is not None and of_tacton[5]:
        level = tacton.rhythm.level((np.arange(PULSED) + 0.5) / PULSED * tacton.rhythm.period)
        powers = _fourier(factor(level, pressure.depth_of_modulation))
    c = np.abs(np.einsum("jm,ju->mu", coefficients, of_signal))
    (m, u), c = _strongest(c, threshold)
    (k, v), c = _strongest(c[:, None] * np.abs(powers), threshold)
    n, p = of_signal.shape[1], len(powers)
    signed = np.where(u > n // 2, u - n, u)[k], np.where(v > p // 2, v - p, v)
    return np.column_stack([orders[m[k]], *signed]), c


def _in_powers(pressure: MovingPressure) -> tuple[Ints, NDArray]:
    """Ints (m, 3) and coefficients (k, m) of the gain with powers 0 to k - 1 of a factor of the
    modulation, through Chebyshev's points and checked between them.
    """
    law, plain = pressure.law, unsampled(pressure)
    for degree in DEGREES if law.degree is None else (max(1, law.degree),):
        factors = np.cos(np.pi * np.arange(2 * degree + 1) / (2 * degree))
        powers = np.vander(factors, degree + 1, increasing=True)
        orders, at = gain_orders(plain, factors.tolist())
        found = np.linalg.solve(powers[::2], at[::2])
        if np.abs(powers @ found - at).max() <= ALIASED * np.abs(at).max():
            return orders, found
    raise harmonics_unbounded(law)


def _fourier(values: Floats) -> Complex:
    return np.asarray(np.fft.fft(values) / len(values))


def _strongest(c: Floats, threshold: float) -> tuple[tuple[Ints, Ints], Floats]:
    """Places of, and values (k,) of a table above a fraction of its largest, not too many."""
    least = threshold * c.max(initial=0.0)
    if c.size > MOST_PRODUCTS:
        least = max(least, np.partition(c.ravel(), -MOST_PRODUCTS)[-MOST_PRODUCTS])
    rows, columns = np.nonzero((c >= least) & (c > 0))
    return (rows, columns), c[rows, columns]


def _distinct(
    orders: Ints, of_tacton: Floats, strengths: Floats, same: float, threshold: float, most: int
) -> LineNames:
    """One line for all that coincide within `same` Hz, by its simplest name."""
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
    kept = np.bincount(group, strengths == 0) > 0  # candidates
    strongest = np.argsort(-power, kind="stable")[:most]
    kept[strongest] |= power[strongest] > threshold**2 * power.max(initial=0.0)
    names = tuple(line_name(orders[k].tolist(), of_tacton) for k in simplest[kept])
    return LineNames(names=names, frequencies=f[simplest[kept]], strengths=np.sqrt(power[kept]))
