"""Inspection of a measurement: lines, noise floor, mains hum, clipping, and what is missing."""

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace

import numpy as np

from simple_model import MovingPressure
from simple_model.load.line_names import line_names
from simple_model.numbers import significant
from simple_model.response import SETTLE
from skinwave.measure.lines import bin_width, departures, holm
from skinwave.measure.measurement import Measurement
from skinwave.measure.noise_floor import floor_of
from skinwave.measure.spectral_lines import (
    ALARM,
    FEWEST,
    LOWEST,
    LineSpectrum,
    SpectralLine,
    peaks,
    spectral_lines,
)
from skinwave.typing import Floats

MOST_VALUES = 2_000_000  # that lines are looked for in
MOST_SAMPLES = 100_000  # of a waveform
FEWEST_BINS = 64  # equally spaced frequencies of a spectrum that has a noise floor
CHANCE = 0.01  # of a note that a steady motion is not steady
TURNS = 2.0  # standard errors of a frequency, whose turn of phase is ignored
SAME = 4.0  # standard errors between two lines that may be one

MAINS = (50.0, 60.0)  # Hz
WANDER = 0.004  # of its frequency: how far the mains of any grid are from it
HIGHEST, FALSIFYING = 20, 7  # multiple of the mains frequency: of hum, and of a line of the load
STRONG = 1e-2  # of the strongest line of the load: what hum may be mistaken for

RUN, RUNS = 3, 2  # clipped are so many samples in a row at an extreme, so many times,
LONG = 20  # or one run as long
BELOW = 0.005  # of the half range: the band next to the extreme that is compared with it
EXCESS = 6.0  # times the samples in the band; a sinusoid that is rounded has 2.4 at most


@dataclass(frozen=True, kw_only=True, eq=False)
class Inspection:
    """Content of a measurement, and what it lacks.

    Parameters
    ----------
    measured : Measurement
    spectrum : LineSpectrum of the `kept` places and samples; None where there are too few
    origins : of its lines: "mains 50 Hz", "drive" or ""
    kept : numbers of the places whose lines were looked for
    clipped : (r, p) int, samples that are cut off
    constant : numbers of the places where nothing varies
    missing : sentences
    """

    measured: Measurement
    spectrum: LineSpectrum | None
    origins: tuple[str, ...]
    kept: np.ndarray
    clipped: np.ndarray
    constant: np.ndarray
    missing: tuple[str, ...]

    @property
    def lines(self) -> tuple[SpectralLine, ...]:
        """The lines found, by frequency."""
        return self.spectrum.lines if self.spectrum else ()

    @property
    def noise(self) -> Floats:
        """Noise floor (p,) of the kept places, the median over frequency, unit/sqrt(Hz); of
        spectra, the unit; nan if it is unknown.
        """
        if self.spectrum is None:
            return np.full(len(self.kept), np.nan)
        return np.sqrt(np.median(self.spectrum.floor[LOWEST:-1], axis=0))


def inspect(measured: Measurement, *, alarm: float = ALARM) -> Inspection:
    """Inspection of a measurement, with lines of which noise alone has any with the probability
    `alarm`; raises a ValueError if that is not between 0 and 1.
    """
    if not 0 < alarm < 1:
        raise ValueError(f"the probability {alarm:g} of a false alarm must be between 0 and 1")
    missing = list(measured.remarks)
    if np.isnan(measured.places).any() and not any("place" in said for said in missing):
        missing.append("places are not known; give --places")
    if not len(measured.drive):
        missing.append("no drive is recorded: delays against it are unknown")
    if len(measured.values) == 1:
        missing.append("one repetition: how far it repeats is unknown")
    constant = np.flatnonzero(np.ptp(measured.values, axis=1).max(axis=0) == 0)
    varying = np.setdiff1d(np.arange(len(measured.places)), constant)
    part = _looked_at(measured)
    most = max(1, MOST_VALUES // ((part.stop - part.start) * len(measured.values)))
    kept = varying
    if len(varying) > most:
        kept = varying[np.linspace(0, len(varying) - 1, most).astype(int)]
        missing.append(f"lines were looked for at {len(kept)} of {len(varying)} places")
    if not measured.is_spectrum and part.stop < len(measured.times):
        missing.append(f"lines were looked for in the first {part.stop / measured.rate:g} s")
    spectrum = _spectrum(measured, kept, part, alarm)
    if not measured.is_spectrum and spectrum and spectrum.lines:
        looked_at = replace(
            measured, times=measured.times[: part.stop], drive=np.empty(0),
            values=measured.values[:, : part.stop, kept], places=measured.places[kept],
        )  # fmt: skip
        missing += _unsteady(looked_at, spectrum.lines)
    return Inspection(
        measured=measured, spectrum=spectrum, origins=_origins(measured, spectrum, part), kept=kept,
        clipped=_clipped_samples(measured), constant=constant, missing=tuple(missing),
    )  # fmt: skip


def _looked_at(measured: Measurement) -> slice:
    """Samples that lines are looked for in: as in a comparison without the first quarter, where a
    motion may begin; all of spectra.
    """
    count = min(len(measured.axis), MOST_SAMPLES)
    return slice(0 if measured.is_spectrum else int(SETTLE * count), count)


def _spectrum(
    measured: Measurement, kept: np.ndarray, part: slice, alarm: float
) -> LineSpectrum | None:
    if not len(kept):
        return None
    if measured.is_spectrum:
        return _of_amplitudes(measured, kept, alarm)
    if part.stop - part.start < FEWEST:
        return None
    return spectral_lines(measured.values[:, part, kept], measured.rate, alarm=alarm)


def _unsteady(measured: Measurement, lines: Sequence[SpectralLine]) -> list[str]:
    """A sentence if a line differs between the halves of a record by more than its errors: beyond
    the noise, and by more than its phase turns if its frequency is `TURNS` errors away.
    """
    first, second = departures(measured, np.array([line.frequency for line in lines]))
    change = second.mean - first.mean
    both = replace(first, variance=first.variance + second.variance)
    size = np.array([np.sqrt((line.amplitudes**2).sum()) for line in lines])
    share = np.sqrt((np.abs(change) ** 2).sum(axis=1)) / size
    half = (1 - SETTLE) / 2 * len(measured.times) / measured.rate
    turn = 2 * np.pi * half * np.array([line.error for line in lines])
    sure = (holm(both.significances(change)) < CHANCE).any(axis=1)
    beyond = np.flatnonzero(sure & (share > TURNS * turn))
    if not len(beyond):
        return []
    k = beyond[(share * size)[beyond].argmax()]
    return [
        f"the line at {lines[k].frequency:.4g} Hz changes by {significant(100 * share[k])} % "
        "between the halves of the record, so the errors of frequencies do not hold: the motion "
        "is not steady, or lines are too close; cut off what is not steady, or record longer"
    ]


def _of_amplitudes(measured: Measurement, kept: np.ndarray, alarm: float) -> LineSpectrum | None:
    """Lines of complex amplitudes at equally spaced frequencies: local maxima above their median.

    The frequency of one is within half a step, whose uniform distribution has the standard error.
    """
    width, runs = bin_width(measured), len(measured.values)
    if not width or len(measured.frequencies) < FEWEST_BINS:
        return None
    density = np.mean(np.abs(measured.values[:, :, kept]) ** 2, axis=0)
    floor = floor_of(density, runs)
    found, chance = peaks(density, floor, runs, alarm, np.empty(0))
    bins = np.round(found).astype(int)
    lines = tuple(
        SpectralLine(frequency=float(measured.frequencies[bins[k]]), error=width / np.sqrt(12),
                     amplitudes=np.sqrt(density[bins[k]]), false_alarm=float(chance[k]))
        for k in np.argsort(bins)
    )  # fmt: skip
    return LineSpectrum(lines=lines, frequencies=measured.frequencies, density=density, floor=floor)


def _origins(measured: Measurement, spectrum: LineSpectrum | None, part: slice) -> tuple[str, ...]:
    """Origins of the lines: the drive, or else mains hum."""
    if spectrum is None:
        return ()
    duration, driven = np.inf, set()
    if not measured.is_spectrum:
        duration = (part.stop - part.start) / measured.rate
        if len(measured.drive) and np.ptp(measured.drive) > 0:
            of_drive = spectral_lines(measured.drive[None, part, None], measured.rate).lines
            driven = {
                k for k, line in enumerate(spectrum.lines)
                if any(_may_be_one(line, other, 1, duration) for other in of_drive)
            }  # fmt: skip
    hum = hum_of(spectrum.lines, duration, driven)
    return tuple("drive" if k in driven else hum.get(k, "") for k in range(len(spectrum.lines)))


def _may_be_one(line: SpectralLine, other: SpectralLine, n: int, duration: float) -> bool:
    """Whether a line is the n-th multiple of another within their errors."""
    within = SAME * float(np.hypot(line.error, n * other.error)) + 0.05 / duration
    return abs(line.frequency - n * other.frequency) <= within


def hum_of(
    lines: Sequence[SpectralLine], duration: float, driven: Container[int] = ()
) -> dict[int, str]:
    """Names of lines that may be mains hum by their number in `lines`, such as "mains 3 x 50 Hz".

    It takes a line at the mains frequency: 200, 400 and 600 Hz may be a load's own. A multiple is
    one of the mains frequency as found, not of 50 Hz. Lines whose numbers are `driven` are in the
    drive of the record, and their multiples are no hum; the duration is in s.
    """
    found: dict[int, str] = {}
    for mains, base in _mains(lines, driven):
        for k, line in enumerate(lines):
            n = round(line.frequency / base.frequency)
            if 1 <= n <= HIGHEST and _may_be_one(line, base, n, duration):
                found.setdefault(k, f"mains {f'{n} x ' * (n > 1)}{mains:g} Hz")
    return found


def _mains(
    lines: Sequence[SpectralLine], driven: Container[int]
) -> list[tuple[float, SpectralLine]]:
    """Mains frequencies that lines have, and the line nearest to each."""
    found = []
    for mains in MAINS:
        near = [line for k, line in enumerate(lines)
                if k not in driven and abs(line.frequency - mains) <= WANDER * mains]  # fmt: skip
        found += [(mains, min(near, key=lambda line: abs(line.frequency - mains)))] if near else []
    return found


def clipped(waveform: Floats) -> int:
    """How many samples of a waveform (t,) are cut off at its largest or its smallest value.

    A peak that rounding makes flat has as many samples in the next step below it; one that is cut
    off has not.
    """
    return _cut_off(waveform) + _cut_off(-waveform) if np.ptp(waveform) > 0 else 0


def _clipped_samples(measured: Measurement) -> np.ndarray:
    """Samples (r, p) that are cut off, by repetition and place; none of spectra."""
    if measured.is_spectrum:
        return np.zeros((len(measured.values), len(measured.places)), int)
    return np.array([[clipped(waveform) for waveform in run.T] for run in measured.values])


def _cut_off(x: Floats) -> int:
    top = x.max()
    at_top = x == top
    edges = np.diff(np.r_[False, at_top, False].astype(int))
    lengths = np.flatnonzero(edges < 0) - np.flatnonzero(edges > 0)
    if (lengths >= RUN).sum() < RUNS and lengths.max() < LONG:
        return 0
    band = min(top - BELOW * np.ptp(x) / 2, x[x < top].max())
    count, below = int(at_top.sum()), int(((x < top) & (x >= band)).sum())
    return count if count > EXCESS * below else 0


def flaws(measured: Measurement, pressure: MovingPressure) -> list[str]:
    """Sentences, without a full stop, on what falsifies the lines of a load in waveforms: clipping,
    and mains hum on one of them. There are none of spectra, in which neither can be seen.
    """
    if measured.is_spectrum:
        return []
    said, cut = [], _clipped_samples(measured)
    if cut.any():
        where = measured.place_names(np.flatnonzero(cut.sum(axis=0)))
        said.append(
            f"the record is clipped: {int(cut.sum()):,} samples in runs at the same extreme, at "
            f"{where}, which makes lines weaker and adds others; measure with a larger range"
        )
    return said + _hum(measured, pressure)


def _hum(measured: Measurement, pressure: MovingPressure) -> list[str]:
    """Sentences on lines of the load that the record does not resolve from a multiple of a mains
    frequency, of which there is hum.
    """
    load = line_names(pressure)
    strong = load.strengths >= STRONG * load.strengths.max(initial=0.0)
    f, names = load.frequencies[strong], np.array(load.names)[strong]
    apart = 1 / float(np.ptp(measured.times))

    def on(mains: float, within: float) -> np.ndarray:
        n = np.clip(np.round(f / mains), 1, FALSIFYING)
        return np.asarray(np.abs(f - n * mains) <= apart + within * n * mains)

    if not any(on(mains, WANDER).any() for mains in MAINS):
        return []  # and no search for lines, which takes long
    lines = inspect(measured).lines
    driven = [k for k, x in enumerate(lines) if (np.abs(f - x.frequency) <= apart).any()]
    said = []
    for _, line in _mains(lines, driven):
        if (near := on(line.frequency, 0.0)).any():
            said.append(
                f"there is mains hum of {line.frequency:.4g} Hz, and {', '.join(names[near])} of "
                "the load cannot be resolved from a multiple of it: what is measured there may be "
                "hum"
            )
    return said
