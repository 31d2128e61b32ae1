"""Spectral lines in waveforms: which frequencies rise above the noise, and how surely.

A line is a peak of the periodogram (Hann window, mean of R repetitions) above the noise floor, a
running median. In Gaussian noise their ratio has the F distribution with 2 R and nu degrees of
freedom, nu by the variance of the median (Welch 1967). The probability of a false alarm is that of
one bin times bins and places (Bonferroni).

Lines are found strongest first and fitted together beside a linear trend, so that side lobes of one
are not taken for others. Their frequencies follow by Gauss-Newton steps with the amplitudes
projected out (Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973); standard errors are the
Cramer-Rao bound, of one sinusoid of amplitude A over a time T in noise of the one-sided density S
3 S / (pi^2 A^2 T^3) (Rife and Boorstyn, IEEE Trans. Inf. Theory 20, 1974, eq. 17).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import detrend
from scipy.signal.windows import hann
from scipy.special import chdtrc

from simple_model.typing import Floats
from skinwave.measure.noise_floor import floor_of, tail

ALARM = 0.01  # probability that a file of noise has any line
RESOLVED = 1.5  # bins: lines nearer to each other are one
LOWEST = 4  # bins: slower motion is drift; as near to half the rate lines are not determined
FEWEST = 32  # samples
MOST = 60  # lines
PASSES = 12
NEAR = 4.0  # bins from a known line: what the fit leaves there may be of unknown lines
LEAK = 4.0  # times the bound of the Hann window's side lobes
ROUND_OFF = 1e-9  # of the largest value: weaker lines are round-off
STARTS = (0.0, 0.25, 0.5)  # shares of a record that are left out until the rest is steady
HALF = 0.5  # of a line
CHANGES = 1e-3  # chance below which the start of a record differs from its lines

STEPS = 12  # of Gauss and Newton, at most
SMALL = 0.01  # of a standard error, or of the farthest step: the last step
FARTHEST = 0.5  # bins, of a step
BLOCKS = 64  # that a waveform is averaged in, turned back by a line's frequency
MOST_READ = 32  # waveforms that a first frequency is read from
CHUNK = 2**15  # samples


@dataclass(frozen=True, kw_only=True, eq=False)
class SpectralLine:
    """A line: `frequency` and its standard `error` in Hz, `amplitudes` (p,) in SI, root mean square
    over repetitions, and `false_alarm`, the probability of any such line in noise alone.
    """

    frequency: float
    error: float
    amplitudes: Floats
    false_alarm: float


@dataclass(frozen=True, kw_only=True, eq=False)
class LineSpectrum:
    """Lines by frequency, and the one-sided densities (f, p), unit^2/Hz, at `frequencies` (f,) of
    the whole and of the noise `floor` without the lines. What is before `begun` in s is left out,
    where the motion is not steady.
    """

    lines: tuple[SpectralLine, ...]
    frequencies: Floats
    density: Floats
    floor: Floats
    begun: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fit:
    """Lines fitted to waveforms: frequencies (l,) with errors (l,) in Hz, amplitudes (l, q) of Re a
    exp(2 pi i f t), and the rest (t, q) without lines and trend.
    """

    frequencies: Floats
    errors: Floats
    amplitudes: np.ndarray
    rest: Floats


_NONE = _Fit(
    frequencies=np.empty(0), errors=np.empty(0), amplitudes=np.empty((0, 1)), rest=np.empty((0, 1))
)


def spectral_lines(values: Floats, rate: float, *, alarm: float = ALARM) -> LineSpectrum:
    """Lines and noise floor of waveforms.

    Parameters
    ----------
    values : (r, t, p) float, repetitions of waveforms at places
    rate : Hz
    alarm : probability that noise alone has any line

    Raises
    ------
    ValueError
        If there are fewer than 32 samples.
    """
    count = values.shape[1]
    if count < FEWEST:
        raise ValueError(f"{count} samples are too few for a spectrum; measure {FEWEST} or more")
    found: list[LineSpectrum] = []
    for first in (int(start * count) for start in STARTS):
        if count - first < FEWEST:
            break
        spectrum, is_steady = _found(values[:, first:], rate, alarm)
        found.append(replace(spectrum, begun=first / rate))
        if is_steady:
            return found[-1]
    return _moving(found[-1], found[-2]) if len(found) > 1 else found[-1]


def _moving(found: LineSpectrum, before: LineSpectrum) -> LineSpectrum:
    """Lines of an unsteady record: their errors have how far they moved since an earlier start, and
    lines that moved by a bin or changed by half are left out.
    """
    lines, old = [], np.array([line.frequency for line in before.lines])
    for line in found.lines if len(old) else ():
        near = before.lines[int(np.abs(old - line.frequency).argmin())]
        moved = abs(near.frequency - line.frequency)
        change = np.linalg.norm(line.amplitudes - near.amplitudes)
        if moved < found.frequencies[1] and change < HALF * np.linalg.norm(near.amplitudes):
            lines.append(replace(line, error=float(np.hypot(line.error, moved))))
    return replace(found, lines=tuple(lines))


def _found(values: Floats, rate: float, alarm: float) -> tuple[LineSpectrum, bool]:
    """Lines of waveforms (r, t, p), and whether the first quarter is as steady as the rest."""
    runs, count, places = values.shape
    x = np.moveaxis(values, 0, 1).reshape(count, runs * places)
    least = 2 / rate * (ROUND_OFF * np.abs(values).max()) ** 2
    density = _densities(detrend(x, axis=0), runs, rate)
    floor, bin_ = np.maximum(floor_of(density, runs), least), rate / count
    fit, chance = _NONE, np.empty(0)
    for _ in range(PASSES):
        left = _densities(fit.rest, runs, rate) if len(chance) else density
        floor = np.maximum(floor_of(left, runs), least)
        new, surely = peaks(left, floor, runs, alarm, fit.frequencies / bin_)
        if not len(new):
            break
        away = np.abs(new[:, None] - fit.frequencies / bin_).min(axis=1, initial=np.inf)
        chosen = away >= min(NEAR, away.max())
        new, surely = new[chosen], surely[chosen]
        start, chance = np.append(fit.frequencies, new * bin_), np.append(chance, surely)
        fit = _fitted(x, start, rate, _at(floor, start / bin_, runs), len(new))
        fit, chance = _pruned(x, fit, chance, rate, floor, runs, alarm)
        if len(chance) >= MOST:
            break
    spectrum = LineSpectrum(
        lines=_lines(fit, _errors(fit, rate, floor, runs), chance, runs),
        frequencies=np.arange(len(density)) * bin_, density=density, floor=floor,
    )  # fmt: skip
    return spectrum, _is_steady(fit, floor, rate, runs)


def _is_steady(fit: _Fit, floor: Floats, rate: float, runs: int) -> bool:
    """Whether what a fit leaves of the first quarter is noise at the frequencies of the lines."""
    if not len(fit.frequencies):
        return True
    quarter = len(fit.rest) // 4
    window = hann(quarter, sym=False)
    turns = np.exp(-2j * np.pi * np.multiply.outer(fit.frequencies / rate, np.arange(quarter)))
    power = 2 * np.abs((turns * window) @ fit.rest[:quarter]) ** 2 / (rate * np.sum(window**2))
    ratio = (power / _at(floor, fit.frequencies * len(fit.rest) / rate, runs)).mean(axis=1)
    chance = chdtrc(2.0 * power.shape[1], 2.0 * power.shape[1] * ratio)
    return bool(chance.min() * len(chance) > CHANGES)


def _densities(x: Floats, runs: int, rate: float, *, bare: bool = False) -> Floats:
    """One-sided densities (f, p) of waveforms (t, r p), the mean of repetitions, with a Hann window
    or a bare one.
    """
    window = np.ones(len(x)) if bare else hann(len(x), sym=False)
    spectra = np.abs(np.fft.rfft(x * window[:, None], axis=0)) ** 2
    density = 2 * spectra / (rate * np.sum(window**2))
    return density.reshape(len(density), runs, -1).mean(axis=1)


def peaks(
    density: Floats, floor: Floats, runs: int, alarm: float, known: Floats
) -> tuple[Floats, Floats]:
    """Bins of new lines, strongest first, and their probabilities of a false alarm.

    Parameters
    ----------
    density, floor : (f, p), of the same unit, means of repetitions
    runs : repetitions
    alarm : probability that noise alone has any line
    known : (l,) bins of lines that are known

    Returns
    -------
    bins (n,) and probabilities (n,)
    """
    tests = density[LOWEST:-1].size
    chance = np.minimum(1.0, tests * tail(density / floor, runs, len(density)))
    least, height = chance.min(axis=1), (density / floor).max(axis=1)
    inner = height[1:-1]
    top = np.r_[False, (inner >= height[:-2]) & (inner > height[2:]), False]
    top[:LOWEST] = top[-LOWEST:] = False
    bins = np.flatnonzero(top & (least < alarm))
    taken: list[int] = []
    for k in sorted(bins, key=lambda k: -height[k]):
        others = np.append(known, [float(j) for j in taken])
        if np.abs(others - k).min(initial=np.inf) < RESOLVED:
            continue
        leaks = [density[j] * _side_lobe(abs(int(k) - j)) for j in taken]
        if not taken or (density[k] > np.sum(leaks, axis=0))[chance[k] < alarm].any():
            taken.append(int(k))
    taken = taken[: MOST - len(known)]
    return np.array(taken, float), least[taken] if taken else np.empty(0)


def _side_lobe(bins: int) -> float:
    """Bound of the Hann window's power at so many bins from a line, over that at the line."""
    return 1.0 if bins < 2 else LEAK / (np.pi * bins * (bins**2 - 1)) ** 2


def _pruned(
    x: Floats, fit: _Fit, chance: Floats, rate: float, floor: Floats, runs: int, alarm: float
) -> tuple[_Fit, Floats]:
    """The lines that rise above the noise beside all others, fitted without the rest: what a fit
    leaves before the neighbour of a line is known may look like a line.
    """
    count, places = len(x), floor.shape[1]
    bins = np.clip(np.round(fit.frequencies * count / rate), 1, len(floor) - 1).astype(int)
    squared = np.abs(fit.amplitudes.reshape(len(chance), runs, places)) ** 2
    ratio = np.ones(floor.shape)
    ratio[bins] = squared.mean(axis=1) * count / (2 * rate) / floor[bins]
    tests = floor[LOWEST:-1].size
    sure = tests * tail(ratio, runs, len(floor))[bins].min(axis=1) < alarm
    if sure.all():
        return fit, chance
    if not sure.any():
        return _NONE, np.empty(0)
    start = fit.frequencies[sure]
    return _fitted(x, start, rate, _at(floor, start * count / rate, runs)), chance[sure]


def _at(floor: Floats, positions: Floats, runs: int) -> Floats:
    """Noise (l, r p) at bins, the same for all repetitions of a place."""
    bins = np.clip(np.round(positions), 1, len(floor) - 1).astype(int)
    return np.tile(floor[bins], (1, runs))


def _errors(fit: _Fit, rate: float, floor: Floats, runs: int) -> Floats:
    """Standard errors in Hz in the noise that least squares meet: what is left without a window,
    where transients and drifting lines leave more than with one.
    """
    if not len(fit.frequencies):
        return fit.errors
    bins = fit.frequencies * len(fit.rest) / rate
    bare = floor_of(_densities(fit.rest, runs, rate, bare=True), runs)
    noise = _at(floor, bins, runs)
    weight = np.abs(fit.amplitudes) ** 2 / noise
    excess = np.sum(weight * _at(bare, bins, runs) / noise, axis=1) / np.sum(weight, axis=1)
    return fit.errors * np.sqrt(np.maximum(excess, 1.0))


def _lines(fit: _Fit, errors: Floats, chance: Floats, runs: int) -> tuple[SpectralLine, ...]:
    """Lines by frequency."""
    squared = np.abs(fit.amplitudes.reshape(len(chance), runs, -1)) ** 2 if len(chance) else ()
    return tuple(
        SpectralLine(
            frequency=float(fit.frequencies[k]), error=float(errors[k]),
            amplitudes=np.sqrt(squared[k].mean(axis=0)), false_alarm=float(chance[k]),
        )
        for k in np.argsort(fit.frequencies)
    )  # fmt: skip


def _fitted(x: Floats, start: Floats, rate: float, noise: Floats, fresh: int = 0) -> _Fit:
    """Lines fitted together.

    Parameters
    ----------
    x : (t, q) waveforms
    start : (l,) Hz, no two nearer than a bin
    rate : Hz
    noise : (l, q) one-sided densities at the lines
    fresh : how many lines, the last, are known to a bin only
    """
    found = start.copy()
    if fresh:
        _, _, known = _step(x, start, rate, noise)
        rest, own = _without(x, start, known, rate), _complex(known)
        for k in range(len(found) - fresh, len(found)):
            found[k] = _nearest_peak(rest, own[k], found[k], rate, 1 / noise[k])
    limit = FARTHEST * rate / len(x)
    for _ in range(STEPS):
        step, errors, _ = _step(x, found, rate, noise)
        found = np.clip(found + np.clip(step, -limit, limit), limit, rate / 2 - limit)
        if (np.abs(step) < SMALL * np.minimum(errors, limit)).all():
            break
    _, errors, last = _step(x, found, rate, noise)
    rest = _without(x, found, last, rate)
    return _Fit(frequencies=found, errors=errors, amplitudes=_complex(last), rest=rest)


def _step(
    x: Floats, frequencies: Floats, rate: float, noise: Floats
) -> tuple[Floats, Floats, Floats]:
    """A Gauss-Newton step of the frequencies, their standard errors, and the coefficients (2 l + 2,
    q) of `_basis`.
    """
    count = len(frequencies)
    half, size = 2 * count + 2, 4 * count + 2
    gram, right = np.zeros((size, size)), np.zeros((size, x.shape[1]))
    for part in _parts(len(x)):
        basis = _basis(part, len(x), frequencies, rate)
        time = (np.arange(part.start, part.stop) - len(x) / 2)[:, None] / rate
        both = np.hstack([basis, time * basis[:, :-2]])
        gram += both.T @ both
        right += both.T @ x[part]
    inner = gram[:half, :half]
    lower = np.linalg.lstsq(inner, gram[:half, half:], rcond=1e-13)[0]
    linear = np.asarray(np.linalg.lstsq(inner, right[:half], rcond=1e-13)[0], np.float64)
    schur = gram[half:, half:] - gram[half:, :half] @ lower
    slope = right[half:] - gram[half:, :half] @ linear
    cosine, sine = np.split(linear[:-2], 2)
    # d/df of c cos + s sin is 2 pi t (s cos - c sin), weighted by the noise of a sample, S rate/2.
    deviation = np.sqrt(noise * rate / 2)
    change = 2 * np.pi / deviation * np.stack([sine, -cosine])  # (2, l, q)
    blocks = schur.reshape(2, count, 2, count)
    fisher = np.einsum("alq,albm,bmq->lm", change, blocks, change, optimize=True)
    gradient = np.einsum("alq,alq->l", change, slope.reshape(2, count, -1) / deviation)
    inverse = np.linalg.pinv(fisher, hermitian=True)
    return inverse @ gradient, np.sqrt(np.maximum(np.diag(inverse), 0.0)), linear


def _without(x: Floats, frequencies: Floats, found: Floats, rate: float) -> Floats:
    """Waveforms (t, q) less lines and trend of such coefficients."""
    left = x.copy()
    for part in _parts(len(x)):
        left[part] -= _basis(part, len(x), frequencies, rate) @ found
    return left


def _complex(found: Floats) -> np.ndarray:
    """Complex amplitudes (l, q) of coefficients."""
    cosine, sine = np.split(found[:-2], 2)
    return np.asarray(cosine - 1j * sine)


def _parts(count: int) -> list[slice]:
    return [slice(k, min(k + CHUNK, count)) for k in range(0, count, CHUNK)]


def _basis(part: slice, count: int, frequencies: Floats, rate: float) -> Floats:
    """Columns (t, 2 l + 2): cosines, sines, a constant and a trend from -1 to 1."""
    k = np.arange(part.start, part.stop)[:, None]
    angle = 2 * np.pi * k / rate * frequencies
    trend = 2 * k / count - 1
    return np.hstack([np.cos(angle), np.sin(angle), np.ones_like(trend), trend])


def _nearest_peak(
    rest: Floats, own: np.ndarray, frequency: float, rate: float, weight: Floats
) -> float:
    """Frequency within a bin where the weighted periodogram of a line and the rest is largest."""
    count = len(rest)
    best = np.argsort(-weight * np.abs(own) ** 2)[:MOST_READ]  # waveforms in which it is clearest
    k = np.arange(count)
    turned = rest[:, best] * np.exp(-2j * np.pi * frequency / rate * k)[:, None]
    edges = np.linspace(0, count, min(BLOCKS, count) + 1).astype(int)
    sizes, edges = np.diff(edges), edges[:-1]
    sums = np.add.reduceat(turned, edges, axis=0) + sizes[:, None] * own[best] / 2
    times = np.add.reduceat(k / rate, edges) / sizes

    def power(shift: float) -> float:
        return float(weight[best] @ np.abs(np.exp(-2j * np.pi * shift * times) @ sums) ** 2)

    grid = np.linspace(-1, 1, 33) * rate / count
    near = grid[int(np.argmax([power(shift) for shift in grid]))]
    step = grid[1] - grid[0]
    found = minimize_scalar(
        lambda shift: -power(shift), bounds=(near - step, near + step), method="bounded",
        options={"xatol": 1e-3 * step},
    )  # fmt: skip
    return float(np.clip(frequency + found.x, rate / count, rate / 2 - rate / count))
