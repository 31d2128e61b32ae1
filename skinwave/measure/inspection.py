"""Inspection of a measurement: duration, places, lines, noise floor, mains hum, clipping, and what
is missing.
"""

from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from simple_model import MovingPressure
from simple_model.load.line_names import line_names
from simple_model.typing import Floats
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

MOST_VALUES = 3_000_000  # that lines are looked for in
MOST_SAMPLES = 500_000  # of a waveform
FEWEST_BINS = 64  # equally spaced frequencies of a spectrum that has a noise floor
SAME = 4.0  # standard errors between two lines that may be one

MAINS = (50.0, 60.0)  # Hz
WANDER = 0.004  # of its frequency: how far the mains of any grid are from it
HIGHEST = 20  # multiple of the mains frequency
STRONG = 1e-2  # of the strongest line of the load: what hum may be mistaken for
MULTIPLES = 7  # of the mains frequency that may falsify a line of the load

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
    noise : (p,), of the kept places, unit/sqrt(Hz); of spectra, the unit
    clipped : (r, p) int, samples that are cut off
    constant : numbers of the places where nothing varies
    missing : sentences
    """

    measured: Measurement
    spectrum: LineSpectrum | None
    origins: tuple[str, ...]
    kept: np.ndarray
    noise: Floats
    clipped: np.ndarray
    constant: np.ndarray
    missing: tuple[str, ...]

    @property
    def lines(self) -> tuple[SpectralLine, ...]:
        """The lines found, by frequency."""
        return self.spectrum.lines if self.spectrum else ()


def inspect(measured: Measurement, *, alarm: float = ALARM) -> Inspection:
    """Inspection of a measurement, with lines of which noise alone has any with the probability
    `alarm`; raises a ValueError if that is not between 0 and 1.
    """
    if not 0 < alarm < 1:
        raise ValueError(f"the probability {alarm:g} of a false alarm must be between 0 and 1")
    kept, samples, said = _kept(measured)
    spectrum = _spectrum(measured, kept, samples, alarm)
    noise = np.full(len(kept), np.nan)
    if spectrum is not None:
        noise = np.sqrt(np.median(spectrum.floor[LOWEST:-1], axis=0))
        if spectrum.begun:
            said.append(
                f"the first {spectrum.begun:.3g} s are not steady and left out of the lines"
            )
    return Inspection(
        measured=measured, spectrum=spectrum, origins=_origins(measured, spectrum, samples),
        kept=kept, noise=noise, clipped=_clipped_samples(measured), constant=_constant(measured),
        missing=(*_missing(measured), *said),
    )  # fmt: skip


def _constant(measured: Measurement) -> np.ndarray:
    """Numbers of the places where nothing varies."""
    return np.flatnonzero(np.ptp(measured.values, axis=1).max(axis=0) == 0)


def _kept(measured: Measurement) -> tuple[np.ndarray, int, list[str]]:
    """Numbers of places and of samples that lines are looked for in, and why not in all."""
    varying = np.setdiff1d(np.arange(measured.values.shape[2]), _constant(measured))
    count, runs = len(measured.axis), len(measured.values)
    samples = count if measured.is_spectrum else min(count, MOST_SAMPLES)
    most = max(1, MOST_VALUES // (samples * runs))
    chosen = varying[np.unique(np.linspace(0, len(varying) - 1, most).astype(int))] if len(
        varying) > most else varying  # fmt: skip
    said = []
    if samples < count:
        said.append(f"lines were looked for in the first {samples / measured.rate:g} s")
    if len(chosen) < len(varying):
        said.append(f"lines were looked for at {len(chosen)} of {len(varying)} places")
    return chosen, samples, said


def _spectrum(
    measured: Measurement, kept: np.ndarray, samples: int, alarm: float
) -> LineSpectrum | None:
    if not len(kept):
        return None
    if measured.is_spectrum:
        return _of_amplitudes(measured, kept, alarm)
    if samples < FEWEST:
        return None
    return spectral_lines(measured.values[:, :samples, kept], measured.rate, alarm=alarm)


def _of_amplitudes(measured: Measurement, kept: np.ndarray, alarm: float) -> LineSpectrum | None:
    """Lines of complex amplitudes at equally spaced frequencies: local maxima above their median.

    The frequency of one is within half a step, whose uniform distribution has the standard error.
    """
    steps = np.diff(measured.frequencies)
    if len(steps) < FEWEST_BINS - 1 or np.ptp(steps) > 1e-3 * steps.mean():
        return None
    runs, error = len(measured.values), float(steps.mean()) / np.sqrt(12)
    density = np.mean(np.abs(measured.values[:, :, kept]) ** 2, axis=0)
    floor = floor_of(density, runs)
    bins, chance = peaks(density, floor, runs, alarm, np.empty(0))
    lines = tuple(
        SpectralLine(frequency=float(measured.frequencies[int(bins[k])]), error=error,
                     amplitudes=np.sqrt(density[int(bins[k])]), false_alarm=float(chance[k]))
        for k in np.argsort(bins)
    )  # fmt: skip
    return LineSpectrum(lines=lines, frequencies=measured.frequencies, density=density, floor=floor)


def _origins(measured: Measurement, spectrum: LineSpectrum | None, samples: int) -> tuple[str, ...]:
    """Origins of the lines: the drive, or else mains hum."""
    if spectrum is None:
        return ()
    driven: tuple[SpectralLine, ...] = ()
    duration = samples / measured.rate - spectrum.begun if not measured.is_spectrum else np.inf
    if len(measured.drive) >= samples and not measured.is_spectrum and np.ptp(measured.drive) > 0:
        driven = spectral_lines(measured.drive[None, :samples, None], measured.rate).lines
    of_drive = {
        k for k, line in enumerate(spectrum.lines) if any(
            abs(line.frequency - one.frequency) <= _tolerance(line.error, one.error, duration)
            for one in driven)
    }  # fmt: skip
    hum = hum_of(spectrum.lines, duration, of_drive)
    return tuple("drive" if k in of_drive else hum.get(k, "") for k in range(len(spectrum.lines)))


def _tolerance(error: float, other: float, duration: float) -> float:
    """How far in Hz two lines of such standard errors may be apart if they are one."""
    return SAME * float(np.hypot(error, other)) + 0.05 / duration


def _missing(measured: Measurement) -> list[str]:
    """Sentences on what a comparison with a model would need and the file has not."""
    found = list(measured.remarks)
    if np.isnan(measured.places).any() and not any("place" in said for said in found):
        found.append("places are not known; give --places")
    if not len(measured.drive):
        found.append("no drive is recorded: delays against it are unknown")
    if len(measured.values) == 1:
        found.append("one repetition: how far it repeats is unknown")
    return found


def hum_of(
    lines: Sequence[SpectralLine], duration: float, driven: Container[int] = ()
) -> dict[int, str]:
    """Names of lines that may be mains hum by their number in `lines`, such as "mains 3 x 50 Hz".

    It takes a line at the mains frequency, or at twice and three times it: 200, 400 and 600 Hz are
    multiples of 50 Hz as well, and may be a load's own. A multiple is one of the mains frequency as
    found, not of 50 Hz, within its standard error and a twentieth of 1/duration. One that is
    stronger than the mains frequency itself may be the load's: "3 x 50 Hz, mains or load". Lines
    whose numbers are `driven` are in the drive of the record, and their multiples are no hum; the
    duration is in s.
    """
    found: dict[int, str] = {}
    for mains, line, first in _bases(lines, driven):
        base, spread = line.frequency / first, line.error / first
        for k, other in enumerate(lines):
            n = round(other.frequency / base)
            apart = abs(other.frequency - n * base)
            if 1 <= n <= HIGHEST and apart <= _tolerance(other.error, n * spread, duration):
                name = f"{n} x {mains:g} Hz" if n > 1 else f"{mains:g} Hz"
                loud = n > 1 and (other.amplitudes > line.amplitudes).any()
                found.setdefault(k, f"{name}, mains or load" if loud else f"mains {name}")
    return found


def _bases(
    lines: Sequence[SpectralLine], driven: Container[int]
) -> Iterator[tuple[float, SpectralLine, int]]:
    """Mains frequencies that lines have, the line that tells of each, and which multiple it is."""
    for mains in MAINS:
        at = {n: _nearest(lines, n * mains, n * mains * WANDER) for n in (1, 2, 3)}
        if at[1] is None and (at[2] is None or at[3] is None):
            continue
        first = next(n for n in (1, 2) if at[n] is not None)
        k = at[first]
        if k is not None and k not in driven:
            yield mains, lines[k], first


def _nearest(lines: Sequence[SpectralLine], frequency: float, within: float) -> int | None:
    """Number of the line nearest to a frequency, if it is within so many Hz."""
    apart = np.array([abs(line.frequency - frequency) for line in lines])
    return int(apart.argmin()) if apart.min(initial=np.inf) <= within else None


def clipped(waveform: Floats) -> int:
    """How many samples of a waveform (t,) are cut off at its largest or its smallest value.

    A peak that rounding makes flat has as many samples in the next step below it; one that is cut
    off has not.
    """
    if np.ptp(waveform) == 0:
        return 0
    return _cut_off(waveform) + _cut_off(-waveform)


def _clipped_samples(measured: Measurement) -> np.ndarray:
    """Samples (r, p) that are cut off, by repetition and place; none of spectra."""
    if measured.is_spectrum:
        return np.zeros((len(measured.values), measured.values.shape[2]), int)
    return np.array([[clipped(waveform) for waveform in run.T] for run in measured.values])


def _cut_off(x: Floats) -> int:
    top = x.max()
    at_top = x == top
    edges = np.diff(np.r_[False, at_top, False].astype(int))
    lengths = np.flatnonzero(edges < 0) - np.flatnonzero(edges > 0)
    if (lengths >= RUN).sum() < RUNS and lengths.max() < LONG:
        return 0
    band = min(top - BELOW * np.ptp(x) / 2, x[x < top].max())
    below = int(((x < top) & (x >= band)).sum())
    count = int(at_top.sum())
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
    multiples = np.multiply.outer(np.arange(1, MULTIPLES + 1), MAINS).ravel()
    if not (np.abs(f[:, None] - multiples) <= apart + WANDER * multiples).any():
        return []
    kept, samples, _ = _kept(measured)
    spectrum = _spectrum(measured, kept, samples, ALARM)
    lines, said = spectrum.lines if spectrum else (), []
    driven = [k for k, x in enumerate(lines) if (np.abs(f - x.frequency) <= apart).any()]
    for _, line, first in _bases(lines, driven):
        base = line.frequency / first
        n = np.round(f / base)
        on = (n >= 1) & (n <= MULTIPLES) & (np.abs(f - n * base) <= apart)
        if on.any():
            said.append(
                f"there is mains hum of {base:.4g} Hz, and {', '.join(names[on])} of the load "
                f"{'is' if on.sum() == 1 else 'are'} no further from a multiple of it than the "
                "record resolves: what is measured there may be hum"
            )
    return said
