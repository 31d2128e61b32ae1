"""Search for spectral lines in waveforms that rise significantly above the noise.

A line is a peak of the periodogram (Hann window, mean of R repetitions) above the noise floor. In
Gaussian noise their ratio has an F distribution with 2 R and nu degrees of freedom, nu from the
variance of a running median (Welch 1967). The false-alarm probability of one bin is multiplied by
the numbers of bins and places (Bonferroni). Lines are searched for in order of strength and fitted
together with a linear trend. Frequencies follow from Gauss-Newton steps with the amplitudes
projected out (Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973). Standard errors are the Cramer-Rao
bound, for one sinusoid of amplitude A over a time T in noise of one-sided density S 3 S /
(pi^2 A^2 T^3) (Rife and Boorstyn, IEEE Trans. Inf. Theory 20, 1974, eq. 17).
"""

from dataclasses import dataclass

import numpy as np

from simple_model.spectra import cosines
from skinwave.measure.noise_floor import false_alarm, noise_floor
from skinwave.typing import Floats

ALARM = 0.01  # probability that a file of noise has any line
LOWEST = 4  # bins; slower motion is drift, and lines as close to half the rate are undetermined
FEWEST_SAMPLES = 32  # samples
MOST_LINES = 40


@dataclass(frozen=True, kw_only=True, eq=False)
class SpectralLine:
    """A line in waveforms or spectra."""

    frequency: float  # Hz
    error: float  # Hz, standard error of the frequency
    amplitudes: Floats  # (p,) SI, root mean square over repetitions
    false_alarm: float  # probability of any such line in noise alone


@dataclass(frozen=True, kw_only=True, eq=False)
class LineSpectrum:
    """Lines, and one-sided densities (f, p), unit^2/Hz, of waveforms and noise `floor`."""

    lines: tuple[SpectralLine, ...]
    frequencies: Floats
    density: Floats
    floor: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fit:
    """Lines fitted to waveforms."""

    frequencies: Floats  # (l,) Hz
    errors: Floats  # (l,) Hz
    amplitudes: np.ndarray  # (l, r, p) of Re a exp(2 pi i f t)
    rest: Floats  # (t, r p) without lines and trend

    @property
    def power(self) -> Floats:
        """Squared amplitudes (l, p), averaged over repetitions."""
        return np.asarray((np.abs(self.amplitudes) ** 2).mean(axis=1))


def find_lines(values: Floats, rate: float, *, alarm: float = ALARM) -> LineSpectrum:
    """Return lines and noise floor of repetitions of waveforms (r, t, p) at a rate in Hz.

    `alarm` is the probability of any line in noise alone. Raises a ValueError for fewer than 32
    samples.
    """
    runs, count, places = values.shape
    if count < FEWEST_SAMPLES:
        raise ValueError(
            f"{count} samples are too few for a spectrum; measure {FEWEST_SAMPLES} or more"
        )
    x = np.moveaxis(values, 0, 1).reshape(count, runs * places)
    round_off = 1e-9  # of the largest value; weaker lines are round-off
    least = 2 / rate * (round_off * np.abs(values).max()) ** 2
    width, chance = rate / count, np.empty(0)
    fit = _fit_lines(x, np.empty(0), rate, np.ones((2, places)), runs)
    density = rest = _densities(fit.rest, runs, rate)
    floor = np.maximum(noise_floor(density, runs), least)
    most_passes = 12
    close = 4.0  # bins from a known line, where its fit may leave unknown lines
    for _ in range(most_passes):
        peak, peak_chance = peaks(rest, floor, runs, alarm, fit.frequencies / width)
        if not len(peak):
            break
        away = np.abs(peak[:, None] - fit.frequencies / width).min(axis=1, initial=np.inf)
        chosen = away >= min(close, away.max())
        start = np.append(fit.frequencies, peak[chosen] * width)
        chance = np.append(chance, peak_chance[chosen])
        fit = _fit_lines(x, start, rate, floor, runs)
        # Before the neighbour of a line is known, the residual of the line may look like a line.
        kept = _are_significant(fit, floor, rate, alarm)
        if not kept.all():
            fit, chance = _fit_lines(x, fit.frequencies[kept], rate, floor, runs), chance[kept]
        rest = _densities(fit.rest, runs, rate)
        floor = np.maximum(noise_floor(rest, runs), least)
        if len(chance) >= MOST_LINES:
            break
    errors, size = _errors(fit, rate, floor, runs), np.sqrt(fit.power)
    lines = tuple(
        SpectralLine(frequency=float(fit.frequencies[k]), error=float(errors[k]),
                     amplitudes=size[k], false_alarm=float(chance[k]))
        for k in np.argsort(fit.frequencies)
    )  # fmt: skip
    frequencies = np.arange(len(density)) * width
    return LineSpectrum(lines=lines, frequencies=frequencies, density=density, floor=floor)


def _densities(x: Floats, runs: int, rate: float, window: str = "hann") -> Floats:
    """Return the one-sided densities (f, p) of waveforms (t, r p), averaged over repetitions."""
    weights = cosines(window, len(x))
    spectra = np.abs(np.fft.rfft(x * weights[:, None], axis=0)) ** 2
    density = 2 * spectra / (rate * np.sum(weights**2))
    return density.reshape(len(density), runs, -1).mean(axis=1)


def peaks(
    density: Floats, floor: Floats, runs: int, alarm: float, known: Floats
) -> tuple[Floats, Floats]:
    """Return positions (n,) in bins, and false-alarm probabilities (n,), of new lines.

    The strongest is first. Densities and floors are (f, p), positions of `known` lines (l,).
    """
    tests = density[LOWEST:-1].size
    chance = np.minimum(1.0, tests * false_alarm(density / floor, runs, len(density)))
    least, height = chance.min(axis=1), (density / floor).max(axis=1)
    inner = height[1:-1]
    top = np.r_[False, (inner >= height[:-2]) & (inner > height[2:]), False]
    top[:LOWEST] = top[-LOWEST:] = False
    bins = np.flatnonzero(top & (least < alarm))
    size = density.max(axis=1)
    dynamic_range = 1e-2  # in power; weaker lines are searched once stronger ones are fitted
    bins = bins[size[bins] >= dynamic_range * size[bins].max(initial=0.0)]
    lines: list[int] = []
    resolved = 1.5  # bins; closer lines are one
    for k in sorted(bins.tolist(), key=lambda k: -height[k]):
        if np.abs(np.append(known, lines) - k).min(initial=np.inf) < resolved:
            continue
        apart = [abs(k - j) for j in lines]
        # Four times the bound of the Hann window's side lobes, relative to the line.
        leaks = [density[j] * (1.0 if n < 2 else 4.0 / (np.pi * n * (n**2 - 1)) ** 2)
                 for j, n in zip(lines, apart, strict=True)]  # fmt: skip
        if not lines or (density[k] > np.sum(leaks, axis=0))[chance[k] < alarm].any():
            lines.append(k)
    at = np.array(lines[: MOST_LINES - len(known)], int)
    left, middle, right = (np.log(height[at + shift]) for shift in (-1, 0, 1))
    return at + (left - right) / (left - 2 * middle + right) / 2, least[at]


def _are_significant(fit: _Fit, floor: Floats, rate: float, alarm: float) -> np.ndarray:
    """Return a mask (l,) of lines that rise above the noise with all others fitted."""
    ratio = np.ones(floor.shape)
    bins, runs = _bins(fit.frequencies, fit.rest, floor, rate), fit.amplitudes.shape[1]
    ratio[bins] = fit.power * len(fit.rest) / (2 * rate) / floor[bins]
    tests = floor[LOWEST:-1].size
    return np.asarray(tests * false_alarm(ratio, runs, len(floor))[bins].min(axis=1) < alarm)


def _bins(frequencies: Floats, x: Floats, floor: Floats, rate: float) -> np.ndarray:
    return np.clip(np.round(frequencies * len(x) / rate), 1, len(floor) - 1).astype(int)


def _errors(fit: _Fit, rate: float, floor: Floats, runs: int) -> Floats:
    """Return standard errors in Hz from the residual without a window, including transients."""
    bins = _bins(fit.frequencies, fit.rest, floor, rate)
    bare = noise_floor(_densities(fit.rest, runs, rate, "boxcar"), runs)[bins]
    weight = fit.power / floor[bins]
    excess = np.sum(weight * bare / floor[bins], axis=1) / np.sum(weight, axis=1)
    return fit.errors * np.sqrt(np.maximum(excess, 1.0))


def _fit_lines(x: Floats, start: Floats, rate: float, floor: Floats, runs: int) -> _Fit:
    """Return lines fitted together to waveforms (t, r p), weighted by the noise floor (f, p).

    The search begins at frequencies (l,) in Hz, known to a fraction of a bin.
    """
    largest_step = 0.5  # bins
    frequencies, limit = start.copy(), largest_step * rate / len(x)
    noise = np.tile(floor[_bins(start, x, floor, rate)], (1, runs))
    most_steps, last_step = 12, 0.01  # of Gauss-Newton; of a standard error or of `largest_step`
    for _ in range(most_steps):
        step, errors, linear, rest = _step(x, frequencies, rate, noise)
        if (np.abs(step) < last_step * np.minimum(errors, limit)).all():
            break
        moved = frequencies + np.clip(step, -limit, limit)
        frequencies = np.clip(moved, limit, rate / 2 - limit)
    cosine, sine = np.split(linear[:-2], 2)
    amplitudes = (cosine - 1j * sine).reshape(len(frequencies), runs, x.shape[1] // runs)
    return _Fit(frequencies=frequencies, errors=errors, amplitudes=amplitudes, rest=rest)


def _step(
    x: Floats, frequencies: Floats, rate: float, noise: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return a Gauss-Newton step of the frequencies, their standard errors, the coefficients
    (2 l + 2, q) of cosines, sines, constant and trend, and the residual (t, q) of these.
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
