"""Inspection of a measurement: duration, places, lines, noise floor, and what is missing."""

from dataclasses import dataclass

import numpy as np

from simple_model.typing import Floats
from skinwave.measure.clipping import clipped_samples
from skinwave.measure.mains import hum_of
from skinwave.measure.measurement import Measurement
from skinwave.measure.noise_floor import floor_of
from skinwave.measure.spectral_lines import (
    ALARM,
    LOWEST,
    LineSpectrum,
    SpectralLine,
    peaks,
    spectral_lines,
)

MOST_VALUES = 3_000_000  # that lines are looked for in
MOST_SAMPLES = 500_000  # of a waveform
FEWEST = 64  # equally spaced frequencies of a spectrum that has a noise floor
SAME = 4.0  # standard errors between a line and the drive's


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
    """Inspection of a measurement.

    Parameters
    ----------
    measured : Measurement
    alarm : probability that noise alone has any line, 0..1

    Returns
    -------
    Inspection

    Raises
    ------
    ValueError
        If the probability is outside 0..1.
    """
    if not 0 < alarm < 1:
        raise ValueError(f"the probability {alarm:g} of a false alarm must be between 0 and 1")
    values = measured.values
    constant = np.flatnonzero(np.ptp(values, axis=1).max(axis=0) == 0)
    kept, samples, said = _kept(measured, constant)
    spectrum = _spectrum(measured, kept, samples, alarm)
    noise = np.full(len(kept), np.nan)
    if spectrum is not None and spectrum.begun:
        said.append(f"the first {spectrum.begun:.3g} s are not steady and left out of the lines")
    if spectrum is not None:
        noise = np.sqrt(np.median(spectrum.floor[LOWEST:-1], axis=0))
    return Inspection(
        measured=measured, spectrum=spectrum, origins=_origins(measured, spectrum, samples),
        kept=kept, noise=noise, clipped=clipped_samples(measured), constant=constant,
        missing=(*_missing(measured), *said),
    )  # fmt: skip


def kept_lines(measured: Measurement) -> tuple[SpectralLine, ...]:
    """Lines above the noise in the samples and at the places that an inspection looks at."""
    constant = np.flatnonzero(np.ptp(measured.values, axis=1).max(axis=0) == 0)
    kept, samples, _ = _kept(measured, constant)
    spectrum = _spectrum(measured, kept, samples, ALARM)
    return spectrum.lines if spectrum else ()


def _kept(measured: Measurement, constant: np.ndarray) -> tuple[np.ndarray, int, list[str]]:
    """Numbers of places and of samples that lines are looked for in, and why not in all."""
    varying = np.setdiff1d(np.arange(measured.values.shape[2]), constant)
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
    if samples < 32:
        return None
    return spectral_lines(measured.values[:, :samples, kept], measured.rate, alarm=alarm)


def _of_amplitudes(measured: Measurement, kept: np.ndarray, alarm: float) -> LineSpectrum | None:
    """Lines of complex amplitudes at equally spaced frequencies: local maxima above their median.

    The frequency of one is within half a step, whose uniform distribution has the standard error.
    """
    steps = np.diff(measured.frequencies)
    if len(steps) < FEWEST - 1 or np.ptp(steps) > 1e-3 * steps.mean():
        return None
    runs, step = len(measured.values), float(steps.mean())
    density = np.mean(np.abs(measured.values[:, :, kept]) ** 2, axis=0)
    floor = floor_of(density, runs)
    bins, chance = peaks(density, floor, runs, alarm, np.empty(0))
    order = np.argsort(bins)
    lines = tuple(
        SpectralLine(
            frequency=float(measured.frequencies[int(bins[k])]),
            error=step / np.sqrt(12),
            amplitudes=np.sqrt(density[int(bins[k])]),
            false_alarm=float(chance[k]),
        )
        for k in order
    )
    return LineSpectrum(lines=lines, frequencies=measured.frequencies, density=density, floor=floor)


def _origins(measured: Measurement, spectrum: LineSpectrum | None, samples: int) -> tuple[str, ...]:
    """Origins of the lines: the drive, or else mains hum."""
    if spectrum is None:
        return ()
    driven: tuple[SpectralLine, ...] = ()
    duration = samples / measured.rate - spectrum.begun if not measured.is_spectrum else np.inf
    if len(measured.drive) >= samples and not measured.is_spectrum and np.ptp(measured.drive) > 0:
        driven = spectral_lines(
            measured.drive[None, :samples, None], measured.rate, alarm=ALARM
        ).lines
    of_drive = {k for k, line in enumerate(spectrum.lines) if _is_among(line, driven, duration)}
    hum = hum_of(spectrum.lines, duration, of_drive)
    return tuple("drive" if k in of_drive else hum.get(k, "") for k in range(len(spectrum.lines)))


def _is_among(line: SpectralLine, others: tuple[SpectralLine, ...], duration: float) -> bool:
    limits = (SAME * float(np.hypot(line.error, o.error)) + 0.05 / duration for o in others)
    pairs = zip(others, limits, strict=True)
    return any(abs(line.frequency - o.frequency) <= limit for o, limit in pairs)


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
