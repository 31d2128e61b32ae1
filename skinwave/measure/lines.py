"""Spectral lines of a measurement: complex amplitudes, their mean and its covariance.

Lines are linear combinations a = P x of the samples x, the weighted least squares of
`simple_model.response.fit_lines`. In stationary noise of the one-sided density S at a sampling rate
r their covariance is that of a sandwich,

    cov a = r/2 1/n sum over k of S(k) F P(k) F P(k)^*,     F the transform of n samples,

with all that a window, close lines and steep noise do (White, Econometrica 48:817 (1980)). S is the
floor under the residuals of the same fit, divided by the share of white noise that the fit has left
at each bin.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from simple_model import Response
from simple_model.response import SETTLE, fit_lines, line_rows
from simple_model.windows import cosines
from skinwave.measure.delays import in_step
from skinwave.measure.measurement import Measurement
from skinwave.measure.noise_floor import floor_of, freedom
from skinwave.typing import Floats

DISAGREES = 1e-3  # chance below which repetitions of a line vary by other than the noise floor
BESIDE = 2  # bins of a spectrum beside a line, which may have some of it
FEWEST_CLEAR = 4  # bins of a spectrum without lines, of which a noise is told
POOLED = 4.0  # degrees of freedom that the mean over places counts as where there is no floor
FEWEST_BINS = 16  # of a spectrum, fewer are single lines
NEAREST = 1.0  # Hz, within which a spectrum must have a line


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredLines:
    """Complex amplitudes a of Re a exp(2 pi i f t) in a measurement, with their noise.

    Parameters
    ----------
    frequencies : (f,) float, Hz
    each : (r, f, p) complex, of every repetition, in step, in the unit of the measurement
    variance : (f, p) float, of the mean: E |mean - true|^2, both its parts together; nan if unknown
    freedom : float or (f, 1), degrees of freedom of the variance, of real numbers
    shifts : (r,) float, s, by which repetitions came later than their mean and were shifted; zeros
        where they are in step within their noise
    correlation : (2 f, 2 f) float, covariance of the real parts and then the imaginary ones where
        every variance is 2; None of parts that are independent
    """

    frequencies: Floats
    each: np.ndarray
    variance: Floats
    freedom: float | Floats
    shifts: Floats
    correlation: Floats | None = None

    @property
    def mean(self) -> np.ndarray:
        """Mean (f, p) over the repetitions."""
        return np.asarray(self.each.mean(axis=0))

    @property
    def amplitude_error(self) -> Floats:
        """Standard errors (f, p) of amplitudes, of circular noise."""
        return np.sqrt(self.variance / 2)

    @property
    def phase_error(self) -> Floats:
        """Standard errors (f, p) of phases, rad; pi where the line is below the noise."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.minimum(self.amplitude_error / np.abs(self.mean), np.pi)

    @property
    def shift_error(self) -> float:
        """Standard error in s of the mean of the repetitions' delays."""
        r = len(self.shifts)
        return float(self.shifts.std(ddof=1) / np.sqrt(r)) if r > 1 else 0.0

    def variance_of(self, factors: np.ndarray) -> float:
        """Variance of the real part of the sum of the means times factors (f, p); lines of unknown
        noise count as if they had none.
        """
        parts = np.nan_to_num(self.amplitude_error) * factors.conj()
        parts = np.vstack([parts.real, parts.imag])
        shared = parts if self.correlation is None else self.correlation @ parts
        return float((parts * shared).sum())

    def taken(self, chosen: np.ndarray) -> "MeasuredLines":
        """The lines of a mask or of indices."""
        count = len(self.frequencies)
        at = np.arange(count)[chosen]
        both = np.append(at, at + count)
        return replace(
            self, frequencies=self.frequencies[at], each=self.each[:, at],
            variance=self.variance[at], freedom=np.broadcast_to(self.freedom, (count, 1))[at],
            correlation=None if self.correlation is None else self.correlation[np.ix_(both, both)],
        )  # fmt: skip

    def radius(self, level: float) -> Floats:
        """Radius (f, p) about the means within which the true amplitudes lie with a confidence."""
        half = self.freedom / 2
        return np.sqrt(self.variance * half * ((1 - level) ** (-1 / half) - 1))

    def significances(self, away: np.ndarray) -> Floats:
        """P-values (f, p) that deviations (f, p) from the means are noise, taken as circular: away
        squared over the variance is F distributed with 2 and `freedom` degrees of freedom (Victor
        and Mast 1991, doi 10.1016/0013-4694(91)90099-P); nan where the noise is unknown.
        """
        half = self.freedom / 2
        with np.errstate(divide="ignore", invalid="ignore"):
            found = (1 + np.abs(away) ** 2 / self.variance / half) ** -half
        return np.where(np.isnan(self.variance), np.nan, np.where(np.abs(away) == 0, 1.0, found))


def holm(p: Floats) -> Floats:
    """P-values adjusted for their number, so that with a threshold of a the chance of any false
    one among them is at most a (Holm 1979); nan stays.
    """
    known = np.flatnonzero(np.isfinite(p.ravel()))
    order = known[np.argsort(p.ravel()[known], kind="stable")]
    adjusted = np.full(p.size, np.nan)
    times = len(order) - np.arange(len(order))
    adjusted[order] = np.minimum(np.maximum.accumulate(times * p.ravel()[order]), 1.0)
    return adjusted.reshape(p.shape)


def measurable(measurement: Measurement, frequencies: Floats) -> np.ndarray:
    """Mask (f,) of frequencies in Hz that a measurement reaches or, a spectrum, has."""
    if not measurement.is_spectrum:
        return np.asarray((frequencies > 0) & (frequencies < 0.5 * measurement.rate))
    axis = measurement.frequencies
    half = 0.5 * np.diff(axis).min(initial=2 * NEAREST)
    away = np.abs(frequencies[:, None] - axis).min(axis=1)
    return np.asarray((frequencies > 0) & (away <= min(half * (1 + 1e-9), NEAREST)))


def bin_width(measurement: Measurement) -> float:
    """Width in Hz of the bins of a spectrum; 0 of single lines, and where bins are not equal."""
    steps = np.diff(measurement.frequencies)
    even = len(steps) >= FEWEST_BINS and np.ptp(steps) <= 1e-3 * steps.mean()
    return float(steps.mean()) if even else 0.0


def lines_of(
    measurement: Measurement, frequencies: Floats, *, settle: float = SETTLE
) -> MeasuredLines:
    """Lines of a measurement at frequencies (f,) in Hz by weighted least squares, as
    `simple_model.response.fit_lines`, without a fraction `settle` at the start of waveforms.

    Their noise is that of the floor under them. Where repetitions vary, it is drawn to the variance
    of their mean, by the degrees of freedom of both; of a line whose repetitions vary by other than
    the floor (F test at 0.1 %), as of a gain that changes, it is this variance alone. Repetitions
    that are out of step (F test at 0.1 %), as of a trigger that jitters, are shifted by the delay
    that fits each best. Raises a ValueError if a frequency is beyond a waveform's sampling, or not
    in a spectrum.
    """
    frequencies = np.asarray(frequencies, np.float64)
    lost = frequencies[~measurable(measurement, frequencies)]
    if len(lost):
        reach = f"{measurement.axis[-1]:g} Hz" if measurement.is_spectrum else (
            f"{measurement.rate / 2:g} Hz, half its sampling rate")  # fmt: skip
        raise ValueError(
            f"the measurement has no line at {lost[0]:g} Hz: it reaches {reach}; leave that out"
        )
    read = _of_spectra if measurement.is_spectrum else _of_waveforms
    each, floor, freedom, correlation = read(measurement, frequencies, settle)
    shifts = np.zeros(len(each))
    if len(each) > 1:
        each, shifts = in_step(each, frequencies)
        floor, freedom = _drawn(each, floor, freedom)
    return MeasuredLines(
        frequencies=frequencies, each=each, variance=floor, freedom=freedom[:, None],
        shifts=shifts, correlation=correlation,
    )  # fmt: skip


def _drawn(each: np.ndarray, floor: Floats, freedom: Floats) -> tuple[Floats, Floats]:
    """Variances (f, p) of the mean of amplitudes (r, f, p), and their degrees of freedom (f,), by a
    floor (f, p) of so many degrees (f,) and by the repetitions.
    """
    runs, lines, places = each.shape
    variance, own = each.var(axis=0, ddof=1) / runs, 2.0 * (runs - 1)
    if np.isnan(floor).all():
        mean = np.broadcast_to(variance.mean(axis=1, keepdims=True), variance.shape)
        drawn = np.full(lines, min(POOLED, own * (places - 1)))
    else:
        mean = floor
        agree = _agree(variance, floor, own, freedom)
        drawn = np.where(agree, freedom, 0.0)
        own = np.where(agree, own, own / 2)[:, None]  # a gain that changes has one part alone
    weight = drawn[:, None]
    return (weight * mean + own * variance) / (weight + own), (weight + own)[:, 0]


def _agree(variance: Floats, floor: Floats, own: float, freedom: Floats) -> np.ndarray:
    """Mask (f,) of lines whose variance over repetitions is that of the floor, at all places."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (variance / floor).mean(axis=1)
    chance = fdtrc(own * floor.shape[1], freedom * floor.shape[1], ratio)
    return np.asarray(np.minimum(chance, 1 - chance) > DISAGREES / 2)


def evenly(measurement: Measurement) -> Floats:
    """Times (t,) in s of waveforms in exactly equal steps, as text files round them away."""
    return np.linspace(measurement.times[0], measurement.times[-1], len(measurement.times))


def as_response(measurement: Measurement, values: Floats | None = None) -> Response:
    """The mean of the repetitions, or waveforms (t, n) at the same times, as a response."""
    values = measurement.mean if values is None else values
    return Response(
        model="measured", times=evenly(measurement), probes=np.zeros((values.shape[1], 2)),
        values=values, quantity=measurement.quantity,
    )  # fmt: skip


def departures(measurement: Measurement, frequencies: Floats) -> list[MeasuredLines]:
    """Departures of lines at frequencies (f,) in Hz from a steady motion: lines of each half of the
    residuals of `fit_lines`, of the mean of the repetitions. Lines that half the record does not
    resolve have one departure. The list is empty for spectra and for records of few samples.
    """
    count = len(measurement.times)
    half = int((1 - SETTLE) * count) // 2
    if half < 2:
        return []
    rest = fit_lines(as_response(measurement), frequencies)[1]
    parts = (slice(count - 2 * half, count - half), slice(count - half, count))
    each = (
        replace(measurement, times=measurement.times[part], values=rest[None, part],
                drive=np.empty(0))
        for part in parts
    )  # fmt: skip
    return [lines_of(m, frequencies, settle=0.0) for m in each]


def _of_waveforms(
    measurement: Measurement, frequencies: Floats, settle: float
) -> tuple[np.ndarray, Floats, Floats, Floats]:
    """Amplitudes (r, f, p), the variance (f, p) of their mean, its degrees of freedom (f,), and the
    correlation (2 f, 2 f).
    """
    runs = len(measurement.values)
    waves, rows, index = line_rows(evenly(measurement), frequencies, settle=settle)
    n = rows.shape[1]
    x = measurement.values[:, -n:]
    found = rows @ x
    cosine, sine = index
    window = cosines("hann", n)
    rest = window[:, None] * (x - waves.T @ found)
    density = (np.abs(np.fft.rfft(rest, axis=1)) ** 2).mean(axis=0) / (window**2).sum()
    kept = _kept(window, waves, rows)
    floor = floor_of(density, runs, kept)  # S r / 2, of white noise its variance
    spectra = np.fft.rfft(rows[np.append(cosine, sine)])
    sides = np.full(len(floor), 2.0)
    sides[0] = 1.0
    sides[-1] = 2.0 - (n % 2 == 0)
    power = (np.abs(spectra) ** 2).reshape(2, len(frequencies), len(floor)).sum(axis=0) * sides
    shape = floor.mean(axis=1)
    parts = ((spectra * (sides * shape)) @ spectra.conj().T).real
    sign, size = np.repeat([1.0, -1.0], len(frequencies)), np.tile(np.sqrt(power @ shape / 2), 2)
    nearest = np.round(frequencies * n / measurement.rate).astype(int)
    return (
        found[:, cosine] - 1j * found[:, sine], power @ floor / n / runs,
        freedom(runs, kept)[nearest], parts * np.outer(sign / size, sign / size),
    )  # fmt: skip


def _kept(window: Floats, waves: Floats, rows: Floats) -> Floats:
    """Share (k,) of white noise that is left at each bin, under a window, by a fit whose waves
    (m, n) have coefficients rows (m, n) @ x.
    """
    moved, made = np.fft.rfft(window * rows), np.fft.rfft(window * waves)
    taken = 2 * (made.conj() * moved).real.sum(axis=0)
    given = (made.conj() * ((rows @ rows.T) @ made)).real.sum(axis=0)
    return np.maximum(1 - (taken - given) / (window**2).sum(), 0.0)


def _of_spectra(
    measurement: Measurement, frequencies: Floats, settle: float
) -> tuple[np.ndarray, Floats, Floats, None]:
    """The same of the nearest bins of spectra, with a floor where they are equally spaced."""
    axis, values = measurement.frequencies, measurement.values
    nearest = np.abs(frequencies[:, None] - axis).argmin(axis=1)
    kept = np.ones(len(axis))
    kept[np.abs(np.arange(len(axis))[:, None] - nearest).min(axis=1, initial=9) <= BESIDE] = 0.0
    if not bin_width(measurement) or kept[1:].sum() < FEWEST_CLEAR:
        variance = np.full((len(frequencies), values.shape[2]), np.nan)
        return values[:, nearest], variance, np.ones(len(frequencies)), None
    floor = floor_of((np.abs(values) ** 2).mean(axis=0), len(values), kept)
    variance = floor[nearest] / len(values)
    return values[:, nearest], variance, freedom(len(values), kept)[nearest], None
