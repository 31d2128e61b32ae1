"""Spectral lines in measured waveforms: which frequencies rise above the noise, and how surely.

A line is a peak of the periodogram, with a Hann window and averaged over repetitions, above the
noise floor, a running median. A start from which the lines differ by more than the noise, as of a
motion from rest, is left out. In Gaussian noise their ratio has the F distribution with 2 R and nu
degrees of freedom: R repetitions, and nu by the variance of the median (Welch 1967; the median of a
gamma distribution). The probability of a false alarm is of any in the whole file: that of one bin
times bins and places (Bonferroni). Lines are found strongest first and fitted together, so that the
side lobes of one are not taken for others.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import detrend
from scipy.signal.windows import hann
from scipy.special import chdtrc

from simple_model.typing import Floats
from skinwave.measure.line_fit import LineFit, fitted
from skinwave.measure.noise_floor import floor_of, tail

ALARM = 0.01  # probability that a file of noise has any line
RESOLVED = 1.5  # 1/T: lines nearer to each other are one
LOWEST = 4  # bins: what is slower is drift, and as near to half the rate not determined
FEWEST = 32  # samples
MOST = 60  # lines
PASSES = 12
NEAR = 4.0  # bins: what is as near to a line may be left by others that are not yet known
LEAK = 4.0  # times the bound of the Hann window's side lobes
ROUND_OFF = 1e-9  # of the largest value: a line as weak as that is none
STARTS = (0.0, 0.25, 0.5)  # of a record, which are left out until the rest is steady
HALF = 0.5  # of a line
CHANGES = 1e-3  # chance below which what a fit leaves at the start is no noise


NONE = LineFit(
    frequencies=np.empty(0), errors=np.empty(0), amplitudes=np.empty((0, 1)), rest=np.empty((0, 1))
)


@dataclass(frozen=True, kw_only=True, eq=False)
class SpectralLine:
    """A line: `frequency` and its standard `error` in Hz, `amplitudes` (p,) in SI, root mean square
    over repetitions, and `false_alarm`, the probability of any such in noise alone.
    """

    frequency: float
    error: float
    amplitudes: Floats
    false_alarm: float


@dataclass(frozen=True, kw_only=True, eq=False)
class LineSpectrum:
    """Lines by frequency, and the one-sided densities (f, p), unit^2/Hz, at `frequencies` (f,) of
    the whole and of the noise `floor` without the lines; of what is after `begun` in s, before
    which the motion is not steady.
    """

    lines: tuple[SpectralLine, ...]
    frequencies: Floats
    density: Floats
    floor: Floats
    begun: float = 0.0


def spectral_lines(values: Floats, rate: float, *, alarm: float = ALARM) -> LineSpectrum:
    """Lines and noise floor of waveforms.

    Parameters
    ----------
    values : (r, t, p) float, repetitions of waveforms at places
    rate : Hz
    alarm : probability that noise alone has any line

    Returns
    -------
    LineSpectrum

    Raises
    ------
    ValueError
        If there are fewer than 32 samples.
    """
    count = values.shape[1]
    if count < FEWEST:
        raise ValueError(f"{count} samples are too few for a spectrum; measure {FEWEST} or more")
    found: LineSpectrum | None = None
    for start in STARTS:
        first = int(start * count)
        if count - first < FEWEST:
            break
        before = found
        found, is_steady = _found(values[:, first:], rate, alarm)
        found = replace(found, begun=first / rate)
        if is_steady:
            return found
    assert found is not None
    return _moving(found, before) if before else found


def _moving(found: LineSpectrum, before: LineSpectrum) -> LineSpectrum:
    """Lines of a record that is not steady, with how far they have moved since an earlier start in
    their errors; those that have moved by a bin or changed by half since are none.
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
    density = densities(detrend(x, axis=0), runs, rate)
    floor, bin_ = np.maximum(floor_of(density, runs), least), rate / count
    fit, chance = NONE, np.empty(0)
    for _ in range(PASSES):
        left = densities(fit.rest, runs, rate) if len(chance) else density
        floor = np.maximum(floor_of(left, runs), least)
        new, surely = peaks(left, floor, runs, alarm, fit.frequencies / bin_)
        if not len(new):
            break
        away = np.abs(new[:, None] - fit.frequencies / bin_).min(axis=1, initial=np.inf)
        chosen = away >= min(NEAR, away.max())
        new, surely = new[chosen], surely[chosen]
        start, chance = np.append(fit.frequencies, new * bin_), np.append(chance, surely)
        fit = fitted(x, start, rate, _at(floor, start / bin_, runs), len(new))
        fit, chance = _pruned(x, fit, chance, rate, floor, runs, alarm)
        if len(chance) >= MOST:
            break
    spectrum = LineSpectrum(
        lines=_lines(fit, _errors(fit, rate, floor, runs), chance, runs),
        frequencies=np.arange(len(density)) * bin_,
        density=density,
        floor=floor,
    )
    return spectrum, _is_steady(fit, floor, rate, runs)


def _is_steady(fit: LineFit, floor: Floats, rate: float, runs: int) -> bool:
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


def densities(x: Floats, runs: int, rate: float, window: Floats | None = None) -> Floats:
    """One-sided densities (f, p) of waveforms (t, r p), the mean of repetitions, with a window
    (t, 1), that of Hann if none is given.
    """
    window = hann(len(x), sym=False)[:, None] if window is None else window
    spectra = np.abs(np.fft.rfft(x * window, axis=0)) ** 2
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
    surest = chance.argmin(axis=1)
    each = np.arange(len(density))
    least, height = chance[each, surest], (density / floor).max(axis=1)
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
    x: Floats, fit: LineFit, chance: Floats, rate: float, floor: Floats, runs: int, alarm: float
) -> tuple[LineFit, Floats]:
    """The lines that still rise above the noise beside all others, fitted without the rest.

    What a fit of one line leaves before its neighbour is known may look like a line.
    """
    if not len(chance):
        return fit, chance
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
        return NONE, np.empty(0)
    start = fit.frequencies[sure]
    return fitted(x, start, rate, _at(floor, start * count / rate, runs)), chance[sure]


def _at(floor: Floats, positions: Floats, runs: int) -> Floats:
    """Noise (l, r p) at bins, the same for all repetitions of a place."""
    bins = np.clip(np.round(positions), 1, len(floor) - 1).astype(int)
    return np.tile(floor[bins], (1, runs))


def _errors(fit: LineFit, rate: float, floor: Floats, runs: int) -> Floats:
    """Standard errors in Hz in the noise that least squares meet: what is left without a window,
    where transients and drifting lines leave more than with one.
    """
    if not len(fit.frequencies):
        return fit.errors
    bins = fit.frequencies * len(fit.rest) / rate
    bare = floor_of(densities(fit.rest, runs, rate, np.ones((len(fit.rest), 1))), runs)
    noise = _at(floor, bins, runs)
    weight = np.abs(fit.amplitudes) ** 2 / noise
    excess = np.sum(weight * _at(bare, bins, runs) / noise, axis=1) / np.sum(weight, axis=1)
    return fit.errors * np.sqrt(np.maximum(excess, 1.0))


def _lines(fit: LineFit, errors: Floats, chance: Floats, runs: int) -> tuple[SpectralLine, ...]:
    """Lines by frequency."""
    if not len(chance):
        return ()
    squared = np.abs(fit.amplitudes.reshape(len(fit.frequencies), runs, -1)) ** 2
    return tuple(
        SpectralLine(
            frequency=float(fit.frequencies[k]),
            error=float(errors[k]),
            amplitudes=np.sqrt(squared[k].mean(axis=0)),
            false_alarm=float(chance[k]),
        )
        for k in np.argsort(fit.frequencies)
    )
