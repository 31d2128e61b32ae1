"""Amplitudes of spectral lines at known frequencies, with their covariance.

Lines are linear combinations a = P x of the samples x, the weighted least squares of
`simple_model.response.fit_lines`. In stationary noise of one-sided density S at a sampling rate r
their covariance is a sandwich (White, Econometrica 48:817 (1980)),

    cov a = r/2 1/n sum over k of S(k) F P(k) F P(k)^*,     F the transform of n samples.

S is the floor of the residual of the same fit, divided by the share of white noise that remains in
it.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from simple_model import Response
from simple_model.response import SETTLE, line_rows
from simple_model.spectra import cosines
from skinwave.measure.delays import in_step
from skinwave.measure.measurement import Measurement
from skinwave.measure.noise_floor import freedom, noise_floor
from skinwave.typing import Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredLines:
    """Complex amplitudes a of Re a exp(2 pi i f t) in a measurement, with their noise.

    Parameters
    ----------
    frequencies : (f,) float, Hz
    each : (r, f, p) complex, aligned repetitions, in the unit of the measurement
    variance : (f, p) float, of the mean: E |mean - true|^2; nan if unknown
    freedom : float or (f, 1), degrees of freedom (real numbers) of the variance
    shifts : (r,) float, s, delays of repetitions that were removed
    correlation : (2 f, 2 f) float, covariance of all real, then all imaginary parts, scaled to a
        `variance` of 2; None for independent parts
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
        """Standard errors (f, p) of amplitudes."""
        return np.sqrt(self.variance / 2)

    @property
    def phase_error(self) -> Floats:
        """Standard errors (f, p) of phases, rad, at most pi."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.minimum(self.amplitude_error / np.abs(self.mean), np.pi)

    @property
    def shift_error(self) -> float:
        """Standard error in s of the mean delay of the repetitions."""
        r = len(self.shifts)
        return float(self.shifts.std(ddof=1) / np.sqrt(r)) if r > 1 else 0.0

    def variance_of(self, factors: np.ndarray) -> float:
        """Return the variance of Re sum(factors (f, p) * mean), without unknown noise."""
        parts = np.nan_to_num(self.amplitude_error) * factors.conj()
        parts = np.vstack([parts.real, parts.imag])
        shared = parts if self.correlation is None else self.correlation @ parts
        return float((parts * shared).sum())

    def only(self, chosen: np.ndarray) -> "MeasuredLines":
        """Return the lines in a mask or at indices."""
        count = len(self.frequencies)
        at = np.arange(count)[chosen]
        both = np.append(at, at + count)
        return replace(
            self, frequencies=self.frequencies[at], each=self.each[:, at],
            variance=self.variance[at], freedom=np.broadcast_to(self.freedom, (count, 1))[at],
            correlation=None if self.correlation is None else self.correlation[np.ix_(both, both)],
        )  # fmt: skip

    def radius(self, level: float) -> Floats:
        """Return the radii (f, p) of confidence circles around the means, for a level."""
        half = self.freedom / 2
        return np.sqrt(self.variance * half * ((1 - level) ** (-1 / half) - 1))

    def p_values(self, away: np.ndarray) -> Floats:
        """Return p-values (f, p) of deviations (f, p) from the means; nan for unknown noise.

        |away|^2 over the variance has an F distribution with 2 and `freedom` degrees of freedom
        (Victor and Mast 1991, doi 10.1016/0013-4694(91)90099-P).
        """
        half = self.freedom / 2
        with np.errstate(divide="ignore", invalid="ignore"):
            p = (1 + np.abs(away) ** 2 / self.variance / half) ** -half
        return np.where(np.isnan(self.variance), np.nan, np.where(np.abs(away) == 0, 1.0, p))


def holm(p: Floats) -> Floats:
    """Return p-values adjusted for their number (Holm 1979); nan remains nan."""
    known = np.flatnonzero(np.isfinite(p.ravel()))
    order = known[np.argsort(p.ravel()[known], kind="stable")]
    adjusted = np.full(p.size, np.nan)
    factors = len(order) - np.arange(len(order))
    adjusted[order] = np.minimum(np.maximum.accumulate(factors * p.ravel()[order]), 1.0)
    return adjusted.reshape(p.shape)


def measurable(measurement: Measurement, frequencies: Floats) -> np.ndarray:
    """Return a mask (f,) of frequencies in Hz that a waveform samples or a spectrum contains."""
    if not measurement.is_spectrum:
        return np.asarray((frequencies > 0) & (frequencies < 0.5 * measurement.rate))
    axis = measurement.frequencies
    nearest = 1.0  # Hz, largest distance of a spectrum's bin from a line
    half = 0.5 * np.diff(axis).min(initial=2 * nearest)
    away = np.abs(frequencies[:, None] - axis).min(axis=1)
    return np.asarray((frequencies > 0) & (away <= min(half * (1 + 1e-9), nearest)))


def bin_width(measurement: Measurement) -> float:
    """Return the width in Hz of the bins of a spectrum; 0 for single lines and unequal bins."""
    steps = np.diff(measurement.frequencies)
    fewest_bins = 16  # of a spectrum; fewer are single lines
    even = len(steps) >= fewest_bins and np.ptp(steps) <= 1e-3 * steps.mean()
    return float(steps.mean()) if even else 0.0


def lines_of(
    measurement: Measurement, frequencies: Floats, *, settle: float = SETTLE
) -> MeasuredLines:
    """Return the lines of a measurement at frequencies (f,) in Hz, without the first fraction
    `settle` of waveforms.

    The noise is estimated from the floor below the lines and from the variance between repetitions,
    weighted by degrees of freedom; if both differ (F test at 0.1 %), from the latter alone.
    Repetitions with different delays (F test at 0.1 %) are aligned. Raises a ValueError if a
    frequency is above half the sampling rate, or not in a spectrum.
    """
    frequencies = np.asarray(frequencies, np.float64)
    missing = frequencies[~measurable(measurement, frequencies)]
    if len(missing):
        end = measurement.axis[-1] if measurement.is_spectrum else measurement.rate / 2
        raise ValueError(f"the measurement has no line at {missing[0]:g} Hz; it ends at {end:g} Hz")
    estimate = _of_spectra if measurement.is_spectrum else _of_waveforms
    each, variance, degrees, correlation = estimate(measurement, frequencies, settle)
    shifts = np.zeros(len(each))
    if len(each) > 1:
        each, shifts = in_step(each, frequencies)
        variance, degrees = _pool_variances(each, variance, degrees)
    return MeasuredLines(
        frequencies=frequencies, each=each, variance=variance, freedom=degrees[:, None],
        shifts=shifts, correlation=correlation,
    )  # fmt: skip


def _pool_variances(each: np.ndarray, floor: Floats, degrees: Floats) -> tuple[Floats, Floats]:
    """Return variances (f, p) of the mean, and degrees (f,), from floor and repetitions."""
    runs, lines, places = each.shape
    variance, own = each.var(axis=0, ddof=1) / runs, np.full((lines, 1), 2.0 * (runs - 1))
    disagreement = 1e-3  # p-value below which repetitions do not vary as the noise floor
    pooled = 4.0  # largest degrees of freedom of the mean over places, without a floor
    if np.isnan(floor).all():
        prior = np.broadcast_to(variance.mean(axis=1, keepdims=True), variance.shape)
        weight = np.minimum(pooled, own * (places - 1))
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = (variance / floor).mean(axis=1)
        chance = fdtrc(own[:, 0] * places, degrees * places, ratio)
        agree = (np.minimum(chance, 1 - chance) > disagreement / 2)[:, None]
        prior, weight = floor, np.where(agree, degrees[:, None], 0.0)
        own = np.where(agree, own, own / 2)  # a varying gain has only one real part
    return (weight * prior + own * variance) / (weight + own), (weight + own)[:, 0]


def evenly(measurement: Measurement) -> Floats:
    """Return times (t,) in s in exactly equal steps."""
    return np.linspace(measurement.times[0], measurement.times[-1], len(measurement.times))


def as_response(measurement: Measurement) -> Response:
    """Return the mean of the repetitions of waveforms as a response."""
    return Response(
        model="measured", times=evenly(measurement), probes=np.zeros((len(measurement.places), 2)),
        values=measurement.mean, quantity=measurement.quantity,
    )  # fmt: skip


Estimate = tuple[np.ndarray, Floats, Floats, Floats | None]


def _of_waveforms(measurement: Measurement, frequencies: Floats, settle: float) -> Estimate:
    """Return amplitudes (r, f, p), variance (f, p) of their mean, degrees (f,), correlation."""
    runs = len(measurement.values)
    waves, rows, index = line_rows(evenly(measurement), frequencies, settle=settle)
    n = rows.shape[1]
    x = measurement.values[:, -n:]
    fitted = rows @ x
    cosine, sine = index
    window = cosines("hann", n)
    rest = window[:, None] * (x - waves.T @ fitted)
    density = (np.abs(np.fft.rfft(rest, axis=1)) ** 2).mean(axis=0) / (window**2).sum()
    kept = _select(window, waves, rows)
    floor = noise_floor(density, runs, kept)  # S r / 2, for white noise its variance
    spectra = np.fft.rfft(rows[np.append(cosine, sine)])
    sides = np.full(len(floor), 2.0)
    sides[0] = 1.0
    sides[-1] = 2.0 - (n % 2 == 0)
    power = (np.abs(spectra) ** 2).reshape(2, len(frequencies), len(floor)).sum(axis=0) * sides
    shape = floor.mean(axis=1)
    products = ((spectra * (sides * shape)) @ spectra.conj().T).real
    sign, size = np.repeat([1.0, -1.0], len(frequencies)), np.tile(np.sqrt(power @ shape / 2), 2)
    nearest = np.round(frequencies * n / measurement.rate).astype(int)
    return (
        fitted[:, cosine] - 1j * fitted[:, sine], power @ floor / n / runs,
        freedom(runs, kept)[nearest], products * np.outer(sign / size, sign / size),
    )  # fmt: skip


def _select(window: Floats, waves: Floats, rows: Floats) -> Floats:
    """Return the share (k,) of windowed white noise that remains after a fit, at each bin."""
    moved, made = np.fft.rfft(window * rows), np.fft.rfft(window * waves)
    removed = 2 * (made.conj() * moved).real.sum(axis=0)
    added = (made.conj() * ((rows @ rows.T) @ made)).real.sum(axis=0)
    return np.maximum(1 - (removed - added) / (window**2).sum(), 0.0)


def _of_spectra(measurement: Measurement, frequencies: Floats, settle: float) -> Estimate:
    """Return an estimate from the nearest bins of spectra.

    The variance is known if the bins are equally spaced.
    """
    axis, values = measurement.frequencies, measurement.values
    nearest = np.abs(frequencies[:, None] - axis).argmin(axis=1)
    kept = np.ones(len(axis))
    distance = np.abs(np.arange(len(axis))[:, None] - nearest).min(axis=1, initial=9)
    line_width = 2  # bins of a spectrum on both sides of a line
    kept[distance <= line_width] = 0.0
    fewest_clear = 4  # bins of a spectrum without lines, for a noise floor
    if not bin_width(measurement) or kept[1:].sum() < fewest_clear:
        variance = np.full((len(frequencies), values.shape[2]), np.nan)
        return values[:, nearest], variance, np.ones(len(frequencies)), None
    floor = noise_floor((np.abs(values) ** 2).mean(axis=0), len(values), kept)
    variance = floor[nearest] / len(values)
    return values[:, nearest], variance, freedom(len(values), kept)[nearest], None
