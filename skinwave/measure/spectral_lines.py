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

from dataclasses import dataclass

import numpy as np

from simple_model.spectra import cosines
from skinwave.measure.noise_floor import floor_of, tail
from skinwave.typing import Floats

ALARM = 0.01  # probability that a file of noise has any line
RESOLVED = 1.5  # bins: lines nearer to each other are one
LOWEST = 4  # bins: slower motion is drift; as near to half the rate lines are not determined
FEWEST = 32  # samples
MOST = 40  # lines
PASSES = 12
RANGE = 1e-2  # of the power of the strongest: weaker lines are found once it is fitted
NEAR = 4.0  # bins from a known line: what the fit leaves there may be of unknown lines
LEAK = 4.0  # times the bound of the Hann window's side lobes
ROUND_OFF = 1e-9  # of the largest value: weaker lines are round-off
STEPS = 12  # of Gauss and Newton, at most
SMALL = 0.01  # of a standard error, or of the farthest step: the last step
FARTHEST = 0.5  # bins, of a step


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
    the whole and of the noise `floor` without the lines.
    """

    lines: tuple[SpectralLine, ...]
    frequencies: Floats
    density: Floats
    floor: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fit:
    """Lines fitted to waveforms: frequencies (l,) with errors (l,) in Hz, amplitudes (l, r, p) of
    Re a exp(2 pi i f t), and the rest (t, r p) without lines and trend.
    """

    frequencies: Floats
    errors: Floats
    amplitudes: np.ndarray
    rest: Floats

    @property
    def power(self) -> Floats:
        """Squared amplitudes (l, p), means over repetitions."""
        return np.asarray((np.abs(self.amplitudes) ** 2).mean(axis=1))


def spectral_lines(values: Floats, rate: float, *, alarm: float = ALARM) -> LineSpectrum:
    """Lines and noise floor of repetitions of waveforms (r, t, p) at a rate in Hz; noise alone has
    any line with the probability `alarm`. Raises a ValueError of fewer than 32 samples.
    """
    runs, count, places = values.shape
    if count < FEWEST:
        raise ValueError(f"{count} samples are too few for a spectrum; measure {FEWEST} or more")
    x = np.moveaxis(values, 0, 1).reshape(count, runs * places)
    least = 2 / rate * (ROUND_OFF * np.abs(values).max()) ** 2
    fit, chance, bin_ = (
        _fitted(x, np.empty(0), rate, np.ones((2, places)), runs),
        np.empty(0),
        rate / count,
    )
    density = left = _densities(fit.rest, runs, rate)
    floor = np.maximum(floor_of(density, runs), least)
    for _ in range(PASSES):
        new, surely = peaks(left, floor, runs, alarm, fit.frequencies / bin_)
        if not len(new):
            break
        away = np.abs(new[:, None] - fit.frequencies / bin_).min(axis=1, initial=np.inf)
        chosen = away >= min(NEAR, away.max())
        start, chance = (
            np.append(fit.frequencies, new[chosen] * bin_),
            np.append(chance, surely[chosen]),
        )
        fit = _fitted(x, start, rate, floor, runs)
        # What a fit leaves before the neighbour of a line is known may look like a line.
        kept = _rises(fit, floor, rate, alarm)
        if not kept.all():
            fit, chance = _fitted(x, fit.frequencies[kept], rate, floor, runs), chance[kept]
        left = _densities(fit.rest, runs, rate)
        floor = np.maximum(floor_of(left, runs), least)
        if len(chance) >= MOST:
            break
    errors, size = _errors(fit, rate, floor, runs), np.sqrt(fit.power)
    return LineSpectrum(
        lines=tuple(
            SpectralLine(frequency=float(fit.frequencies[k]), error=float(errors[k]),
                         amplitudes=size[k], false_alarm=float(chance[k]))
            for k in np.argsort(fit.frequencies)
        ),
        frequencies=np.arange(len(density)) * bin_, density=density, floor=floor,
    )  # fmt: skip


def _densities(x: Floats, runs: int, rate: float, *, bare: bool = False) -> Floats:
    """One-sided densities (f, p) of waveforms (t, r p), the mean of repetitions, with a Hann window
    or a bare one.
    """
    window = np.ones(len(x)) if bare else cosines("hann", len(x))
    spectra = np.abs(np.fft.rfft(x * window[:, None], axis=0)) ** 2
    density = 2 * spectra / (rate * np.sum(window**2))
    return density.reshape(len(density), runs, -1).mean(axis=1)


def peaks(
    density: Floats, floor: Floats, runs: int, alarm: float, known: Floats
) -> tuple[Floats, Floats]:
    """Positions (n,) in bins of new lines beside known ones (l,), strongest first, and their
    probabilities (n,) of a false alarm, of densities and floors (f, p) that are means of so many
    repetitions.
    """
    tests = density[LOWEST:-1].size
    chance = np.minimum(1.0, tests * tail(density / floor, runs, len(density)))
    least, height = chance.min(axis=1), (density / floor).max(axis=1)
    inner = height[1:-1]
    top = np.r_[False, (inner >= height[:-2]) & (inner > height[2:]), False]
    top[:LOWEST] = top[-LOWEST:] = False
    bins = np.flatnonzero(top & (least < alarm))
    size = density.max(axis=1)
    bins = bins[size[bins] >= RANGE * size[bins].max(initial=0.0)]
    taken: list[int] = []
    for k in sorted(bins.tolist(), key=lambda k: -height[k]):
        if np.abs(np.append(known, taken) - k).min(initial=np.inf) < RESOLVED:
            continue
        leaks = [density[j] * _side_lobe(abs(k - j)) for j in taken]
        if not taken or (density[k] > np.sum(leaks, axis=0))[chance[k] < alarm].any():
            taken.append(k)
    at = np.array(taken[: MOST - len(known)], int)
    left, middle, right = (np.log(height[at + shift]) for shift in (-1, 0, 1))
    return at + (left - right) / (left - 2 * middle + right) / 2, least[at]


def _side_lobe(bins: int) -> float:
    """Bound of the Hann window's power at so many bins from a line, over that at the line."""
    return 1.0 if bins < 2 else LEAK / (np.pi * bins * (bins**2 - 1)) ** 2


def _rises(fit: _Fit, floor: Floats, rate: float, alarm: float) -> np.ndarray:
    """Mask (l,) of lines that rise above the noise beside all others."""
    ratio = np.ones(floor.shape)
    bins, runs = _bins(fit, floor, rate), fit.amplitudes.shape[1]
    ratio[bins] = fit.power * len(fit.rest) / (2 * rate) / floor[bins]
    tests = floor[LOWEST:-1].size
    return np.asarray(tests * tail(ratio, runs, len(floor))[bins].min(axis=1) < alarm)


def _bins(fit: _Fit, floor: Floats, rate: float) -> np.ndarray:
    return np.clip(np.round(fit.frequencies * len(fit.rest) / rate), 1, len(floor) - 1).astype(int)


def _errors(fit: _Fit, rate: float, floor: Floats, runs: int) -> Floats:
    """Standard errors in Hz in the noise that least squares meet: what is left without a window,
    where transients and drifting lines leave more than with one.
    """
    bins = _bins(fit, floor, rate)
    bare = floor_of(_densities(fit.rest, runs, rate, bare=True), runs)[bins]
    weight = fit.power / floor[bins]
    excess = np.sum(weight * bare / floor[bins], axis=1) / np.sum(weight, axis=1)
    return fit.errors * np.sqrt(np.maximum(excess, 1.0))


def _fitted(x: Floats, start: Floats, rate: float, floor: Floats, runs: int) -> _Fit:
    """Lines fitted together to waveforms (t, r p) from frequencies (l,) in Hz that are known to a
    fraction of a bin, weighted by the noise floor (f, p).
    """
    found, limit = start.copy(), FARTHEST * rate / len(x)
    bins = np.clip(np.round(start * len(x) / rate), 1, len(floor) - 1).astype(int)
    noise = np.tile(floor[bins], (1, runs))
    for _ in range(STEPS):
        step, errors, linear, rest = _step(x, found, rate, noise)
        if (np.abs(step) < SMALL * np.minimum(errors, limit)).all():
            break
        found = np.clip(found + np.clip(step, -limit, limit), limit, rate / 2 - limit)
    cosine, sine = np.split(linear[:-2], 2)
    amplitudes = (cosine - 1j * sine).reshape(len(found), runs, x.shape[1] // runs)
    return _Fit(frequencies=found, errors=errors, amplitudes=amplitudes, rest=rest)


def _step(
    x: Floats, frequencies: Floats, rate: float, noise: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """A Gauss-Newton step of the frequencies, their standard errors, the coefficients (2 l + 2, q)
    of cosines, sines, constant and trend, and what these leave of the waveforms (t, q).
    """
    count, half = len(frequencies), 2 * len(frequencies) + 2
    time = (np.arange(len(x)) - len(x) / 2)[:, None] / rate
    angle = 2 * np.pi * time * frequencies
    trend = 2 * rate / len(x) * time
    basis = np.hstack([np.cos(angle), np.sin(angle), np.ones_like(trend), trend])
    both = np.hstack([basis, time * basis[:, :-2]])
    gram, right = both.T @ both, both.T @ x
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
    gradient = np.einsum("alq,alq->l", change, slope.reshape(2, *deviation.shape) / deviation)
    inverse = np.linalg.pinv(fisher, hermitian=True)
    errors = np.sqrt(np.maximum(np.diag(inverse), 0.0))
    return inverse @ gradient, errors, linear, x - basis @ linear
