"""Spectral lines of a measurement: complex amplitudes of each repetition, their mean and noise."""

from dataclasses import dataclass, replace

import numpy as np

from meshes.tetmesh import Floats
from simple_model import Response
from simple_model.response import SETTLE, fit_lines
from skinwave.measurements.measurement import Measurement
from skinwave.measurements.repetitions import in_step

Complex = np.ndarray

# Bins beside a line at which its noise is looked for: clear of the line, and of each other.
BESIDE = np.array([3.0, 5.5, 8.0, 10.5, 13.0, 15.5])
CLEAR = 2.5  # bins from any line, within which there is no noise alone
FEWEST_BESIDE = 4  # bins, of which a noise is told
MEDIAN_LOSS = 2.08  # 1 / ln(2)^2, variance of an exponential's median over that of its mean
OCTAVE = 2.0  # in frequency, within which a line without a noise of its own takes a neighbour's
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
    freedom : float, degrees of freedom of the variance, of real numbers
    shifts : (r,) float, s, by which repetitions came later than their mean and were shifted; zeros
        where they are in step within their noise
    borrowed : int, how many lines have the variance of their neighbours, for want of bins beside
    """

    frequencies: Floats
    each: Complex
    variance: Floats
    freedom: float
    shifts: Floats
    borrowed: int = 0

    @property
    def mean(self) -> Complex:
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
            return np.minimum(np.sqrt(self.variance / 2) / np.abs(self.mean), np.pi)

    @property
    def shift_error(self) -> float:
        """Standard error in s of the mean of the repetitions' delays."""
        r = len(self.shifts)
        return float(self.shifts.std(ddof=1) / np.sqrt(r)) if r > 1 else 0.0

    def taken(self, chosen: np.ndarray) -> "MeasuredLines":
        """The lines of a mask or of indices."""
        return replace(
            self, frequencies=self.frequencies[chosen], each=self.each[:, chosen],
            variance=self.variance[chosen],
        )  # fmt: skip


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
    """Lines of a measurement by weighted least squares, as `simple_model.response.fit_lines`.

    Repetitions give the noise: the variance of their mean. Of a single one it is that in the bins
    beside each line, by their median, and where lines leave too few of these the larger of that of
    the next lines on both sides, at the same place. Repetitions that are out of step (F test at
    0.1 %, as of a trigger that jitters) are shifted by the delay that fits each best.

    Parameters
    ----------
    measurement : Measurement
    frequencies : (f,) float, Hz, lines that the measurement resolves; see `measurable`
    settle : fraction of waveforms that is left out at their start

    Returns
    -------
    MeasuredLines

    Raises
    ------
    ValueError
        If a frequency is beyond a waveform's sampling, or not in a spectrum.
    """
    frequencies = np.asarray(frequencies, np.float64)
    if not measurable(measurement, frequencies).all():
        lost = frequencies[~measurable(measurement, frequencies)][0]
        reach = f"{measurement.axis[-1]:g} Hz" if measurement.is_spectrum else (
            f"{measurement.rate / 2:g} Hz, half its sampling rate")  # fmt: skip
        raise ValueError(
            f"the measurement has no line at {lost:g} Hz: it reaches {reach}; leave that line out"
        )
    if measurement.is_spectrum:
        each, beside = _of_spectra(measurement, frequencies)
    else:
        each, beside = _of_waveforms(measurement, frequencies, settle)
    borrowed = 0
    if len(each) > 1:
        each, shifts = in_step(each, frequencies)
        variance = each.var(axis=0, ddof=1) / len(each)
        freedom = 2.0 * (len(each) - 1)
    else:
        shifts = np.zeros(1)
        own, freedom = _noise_beside(beside)
        variance = _borrowed(frequencies, own)
        borrowed = int((np.isnan(own) & np.isfinite(variance)).any(axis=1).sum())
    return MeasuredLines(
        frequencies=frequencies, each=each, variance=np.asarray(variance), freedom=freedom,
        shifts=shifts, borrowed=borrowed,
    )  # fmt: skip


def evenly(measurement: Measurement) -> Floats:
    """Times (t,) in s of waveforms in exactly equal steps, as text files round them away."""
    return np.linspace(measurement.times[0], measurement.times[-1], len(measurement.times))


def as_response(measurement: Measurement, values: Floats) -> Response:
    """Waveforms (t, n) at a measurement's times as a response."""
    return Response(
        model="measured", times=evenly(measurement), probes=np.zeros((values.shape[1], 2)),
        values=values, quantity=measurement.quantity,
    )  # fmt: skip


def _of_waveforms(
    measurement: Measurement, frequencies: Floats, settle: float
) -> tuple[Complex, Complex]:
    """Amplitudes (r, f, p), and those (k, f, p) beside lines of the first repetition."""
    r, t, p = measurement.values.shape
    together = measurement.values.transpose(1, 0, 2).reshape(t, r * p)
    found, rest = fit_lines(as_response(measurement, together), frequencies, settle=settle)
    each = found.reshape(len(frequencies), r, p).transpose(1, 0, 2)
    if r > 1 or not len(frequencies):
        return each, np.empty((0, len(frequencies), p))
    remainder, bin_width = as_response(measurement, rest), 1 / (
        (1 - settle) * np.ptp(measurement.times))  # fmt: skip
    beside = []
    for shift in (*BESIDE, *-BESIDE):
        at = frequencies + shift * bin_width
        clear = (at > CLEAR * bin_width) & (at < 0.5 * measurement.rate)
        clear &= (np.abs(at[:, None] - frequencies) > CLEAR * bin_width).all(axis=1)
        noise = np.full((len(at), p), np.nan + 0j)
        # All are fitted at once, as the lines are: what close lines do to noise is in it, too.
        inside = np.where((at > 0) & (at < 0.5 * measurement.rate), at, frequencies)
        noise[clear] = fit_lines(remainder, inside, settle=settle)[0][clear]
        beside.append(noise)
    return each, np.array(beside)


def _of_spectra(measurement: Measurement, frequencies: Floats) -> tuple[Complex, Complex]:
    """Amplitudes (r, f, p) in the nearest bins, and those (k, f, p) of the first repetition beside
    lines where bins are equally spaced.
    """
    axis, values = measurement.frequencies, measurement.values
    nearest = np.abs(frequencies[:, None] - axis).argmin(axis=1)
    away = np.unique(np.round((*BESIDE, *-BESIDE)).astype(int))
    beside = np.full((len(away), len(nearest), values.shape[2]), np.nan + 0j)
    for k, shift in enumerate(away if bin_width(measurement) else ()):
        at = nearest + shift
        clear = (at > 0) & (at < len(axis)) & (np.abs(at[:, None] - nearest) > CLEAR).all(axis=1)
        beside[k, clear] = values[0, at[clear]]
    return values[:, nearest], beside


def _noise_beside(beside: Complex) -> tuple[Floats, float]:
    """Variance (f, p) of amplitudes by the median power of those (k, f, p) beside, which a hum
    there does not move, and its degrees of freedom; nan where there are too few.
    """
    power = np.abs(beside) ** 2
    counts = np.isfinite(power).sum(axis=0)
    enough = counts >= FEWEST_BESIDE
    variance = np.full(power.shape[1:], np.nan)
    if enough.any():
        variance[enough] = np.nanmedian(power[:, enough], axis=0) / np.log(2)
    fewest = int(counts[enough].min(initial=len(power)))
    return variance, 2 * fewest / MEDIAN_LOSS


def _borrowed(frequencies: Floats, variance: Floats) -> Floats:
    """Variance (f, p) with that of the nearest lines that have one, within an octave on either
    side, the larger of both, where there is none.
    """
    known = np.isfinite(variance).all(axis=1)
    found, f = variance.copy(), frequencies
    for k in np.flatnonzero(~known):
        near = known & (f < OCTAVE * f[k]) & (f > f[k] / OCTAVE)
        sides = [np.flatnonzero(near & beyond) for beyond in (f < f[k], f > f[k])]
        beside = [side[np.argmin(np.abs(f[side] - f[k]))] for side in sides if len(side)]
        if beside:
            found[k] = variance[beside].max(axis=0)
    return found
