"""Spectral lines of a measurement: complex amplitudes of each repetition, their mean and noise."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from meshes.tetmesh import Floats
from simple_model import Response
from simple_model.response import SETTLE, fit_lines
from skinwave.measurements.delays import best_delay
from skinwave.measurements.measurement import Measurement

Complex = np.ndarray

# Bins beside a line at which its noise is looked for: clear of the line, and of each other.
BESIDE = np.array([3.0, 5.5, 8.0, 10.5, 13.0, 15.5])
CLEAR = 2.5  # bins from any line, within which there is no noise alone
FEWEST_BESIDE = 4  # bins, of which a noise is told
MEDIAN_LOSS = 2.08  # 1 / ln(2)^2, variance of an exponential's median over that of its mean
FEWEST_BINS = 16  # of a spectrum, fewer are single lines
NEAREST = 1.0  # Hz, within which a spectrum must have a line
JITTER = 1e-3  # significance from which repetitions are taken to be out of step


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
    """

    frequencies: Floats
    each: Complex
    variance: Floats
    freedom: float
    shifts: Floats

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
    beside each line, by their median. Repetitions that are out of step (F test at 0.1 %, as of a
    trigger that jitters) are shifted by the delay that fits each best.

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
    if len(each) > 1:
        each, shifts = in_step(each, frequencies)
        variance = each.var(axis=0, ddof=1) / len(each)
        freedom = 2.0 * (len(each) - 1)
    else:
        shifts = np.zeros(1)
        variance, freedom = _noise_beside(beside)
    return MeasuredLines(
        frequencies=frequencies, each=each, variance=np.asarray(variance), freedom=freedom,
        shifts=shifts,
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


def in_step(each: Complex, frequencies: Floats) -> tuple[Complex, Floats]:
    """Repetitions (r, f, p) shifted onto their mean where they are out of step, and by how much.

    Delays are those of least squares over all lines and places, within a period of the lowest line;
    they are taken where an F test of what they leave against what there was is significant for as
    many independent delays as there were to choose from.

    Parameters
    ----------
    each : (r, f, p) complex, at least two repetitions
    frequencies : (f,) float, Hz

    Returns
    -------
    (r, f, p) complex, and the shifts (r,) in s, of mean zero
    """
    r = len(each)
    spread = _squares(each).mean(axis=1, keepdims=True)  # of lines, over places
    weights = 1 / np.where(spread > 0, spread, 1)
    reference, shifts = each[0], np.zeros(r)
    for _ in range(3):
        products = (weights * reference.conj() * each).sum(axis=2)
        shifts = np.array([best_delay(frequencies, s, _period(frequencies)) for s in products])
        shifted = each * _turned(frequencies, shifts)
        reference = shifted.mean(axis=0)
        left = _squares(shifted).mean(axis=1, keepdims=True)
        weights = 1 / np.where(left > 0, left, 1)
    shifts = shifts - shifts.mean()
    shifted = each * _turned(frequencies, shifts)
    before, after = ((weights * _squares(x)).sum() for x in (each, shifted))
    freedom = 2 * each[0].size * (r - 1) - (r - 1)
    if not after > 0 or not frequencies.size:
        return each, np.zeros(r)
    gained = (before - after) / (r - 1) / (after / max(freedom, 1))
    chance = fdtrc(r - 1, max(freedom, 1), max(gained, 0.0))
    choices = 2 * _period(frequencies) * float(frequencies.max())
    power = float((weights * np.abs(shifted) ** 2).sum())
    in_common = 1 - float(after) / power if power > 0 else 0.0
    # Of noise alone delays can be found that bring it into step in part.
    if chance * choices ** (r - 1) < JITTER and in_common > (1 + 1 / r) / 2:
        return shifted, shifts
    return each, np.zeros(r)


def _period(frequencies: Floats) -> float:
    """Period in s of the lowest line, within which repetitions are sought."""
    return 1 / float(frequencies.min()) if len(frequencies) else 0.0


def _turned(frequencies: Floats, shifts: Floats) -> Complex:
    return np.exp(2j * np.pi * np.multiply.outer(shifts, frequencies))[:, :, None]


def _squares(each: Complex) -> Floats:
    """Sum (f, p) of squared deviations from the mean."""
    return np.asarray((np.abs(each - each.mean(axis=0)) ** 2).sum(axis=0))


def ellipses(lines: MeasuredLines, level: float = 0.95) -> tuple[Floats, Floats, Floats]:
    """Confidence ellipses of the means in the complex plane.

    From the covariance of real and imaginary parts over the repetitions, by Hotelling's T2; of less
    than four repetitions circles, by the circular statistic (Victor & Mast 1991,
    doi 10.1016/0013-4694(91)90099-P).

    Parameters
    ----------
    lines : MeasuredLines
    level : confidence, 0..1

    Returns
    -------
    semi-axes (f, p), the larger and the smaller, in the unit of the measurement, and the angle
    (f, p) in rad of the larger from the real axis
    """
    from scipy.stats import f as fisher

    r = len(lines.each)
    if r < 4:
        radius = np.sqrt(lines.variance * fisher.ppf(level, 2, lines.freedom))
        return radius, radius, np.zeros_like(radius)
    away = lines.each - lines.mean
    parts = np.stack([away.real, away.imag])
    covariance = np.einsum("irfp,jrfp->fpij", parts, parts) / (r - 1) / r
    values, vectors = np.linalg.eigh(covariance)
    reach = 2 * (r - 1) / (r - 2) * fisher.ppf(level, 2, r - 2)
    minor, major = np.moveaxis(np.sqrt(np.maximum(reach * values, 0)), -1, 0)
    return major, minor, np.arctan2(vectors[..., 1, 1], vectors[..., 0, 1])


def significances(away: Complex, lines: MeasuredLines) -> Floats:
    """P-values (f, p) that deviations (f, p) from the means are noise, which is taken as circular.

    |away|^2 over the variance of the mean is F distributed with 2 and 2 (r - 1) degrees of freedom
    (Victor & Mast 1991); nan where the noise is unknown.
    """
    half = lines.freedom / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(away) ** 2 / lines.variance
        found = (1 + ratio / half) ** -half
    return np.where(np.isnan(lines.variance), np.nan, np.where(np.abs(away) == 0, 1.0, found))


def radius(lines: MeasuredLines, level: float) -> Floats:
    """Radius (f, p) about the means within which the true amplitudes lie with a confidence."""
    half = lines.freedom / 2
    return np.sqrt(lines.variance * half * ((1 - level) ** (-1 / half) - 1))


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
