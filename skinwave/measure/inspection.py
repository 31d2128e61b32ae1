"""Inspection of a measurement: lines, noise floor, mains hum, clipping, and missing information."""

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import label

from simple_model import MovingPressure
from simple_model.load.line_names import line_names
from simple_model.numbers import percent
from simple_model.response import SETTLE, fit_lines
from skinwave.measure.line_search import (
    ALARM,
    FEWEST_SAMPLES,
    LOWEST,
    LineSpectrum,
    SpectralLine,
    find_lines,
    peaks,
)
from skinwave.measure.lines import as_response, bin_width, holm, lines_of
from skinwave.measure.measurement import Measurement
from skinwave.measure.noise_floor import noise_floor
from skinwave.typing import Floats

MAINS = {50.0: 0.2, 60.0: 0.24}  # Hz, and how far the frequency wanders


@dataclass(frozen=True, kw_only=True, eq=False)
class Inspection:
    """Content of a measurement, and what is missing."""

    measured: Measurement
    spectrum: LineSpectrum | None  # of the `kept` places; None for too few samples
    origins: tuple[str, ...]  # of its lines: "mains 50 Hz", "drive" or ""
    kept: np.ndarray  # indices of the places that were searched for lines
    clipped: np.ndarray  # (r, p) int, samples that are cut off
    constant: np.ndarray  # indices of the places where nothing varies
    missing: tuple[str, ...]  # sentences

    @property
    def lines(self) -> tuple[SpectralLine, ...]:
        """Lines by frequency."""
        return self.spectrum.lines if self.spectrum else ()

    @property
    def noise(self) -> Floats:
        """Median noise floor (p,) in unit/sqrt(Hz) or, for spectra, the unit; nan if unknown."""
        if self.spectrum is None:
            return np.full(len(self.kept), np.nan)
        return np.sqrt(np.median(self.spectrum.floor[LOWEST:-1], axis=0))


def inspect(measured: Measurement, *, alarm: float = ALARM) -> Inspection:
    """Inspect a measurement; `alarm` is the probability that noise alone yields any line."""
    if not 0 < alarm < 1:
        raise ValueError(f"the false-alarm probability {alarm:g} must be between 0 and 1")
    missing = list(measured.remarks)
    if np.isnan(measured.places).any() and not any("place" in remark for remark in missing):
        missing.append("places are not known; give --places")
    if not len(measured.drive):
        missing.append("no drive is recorded: delays against it are unknown")
    if len(measured.values) == 1:
        missing.append("one repetition: repeatability is unknown")
    constant = np.flatnonzero(np.ptp(measured.values, axis=1).max(axis=0) == 0)
    kept = varying = np.setdiff1d(np.arange(len(measured.places)), constant)
    most_samples = 100_000  # of a waveform
    # As in a comparison, the first quarter is not used: a motion may begin there.
    stop = min(len(measured.axis), most_samples)
    part = slice(0 if measured.is_spectrum else int(SETTLE * stop), stop)
    most_values = 2_000_000  # that are searched for lines
    most = max(1, most_values // ((stop - part.start) * len(measured.values)))
    if len(varying) > most:
        kept = varying[np.linspace(0, len(varying) - 1, most).astype(int)]
        missing.append(f"lines were searched at {len(kept)} of {len(varying)} places")
    if not measured.is_spectrum and stop < len(measured.times):
        missing.append(f"lines were searched in the first {stop / measured.rate:g} s")
    spectrum = None
    if len(kept) and measured.is_spectrum:
        spectrum = _of_amplitudes(measured, kept, alarm)
    elif len(kept) and part.stop - part.start >= FEWEST_SAMPLES:
        spectrum = find_lines(measured.values[:, part, kept], measured.rate, alarm=alarm)
    if not measured.is_spectrum and spectrum and spectrum.lines:
        searched = replace(
            measured, times=measured.times[:stop], values=measured.values[:, :stop, kept],
            places=measured.places[kept], drive=np.empty(0),
        )  # fmt: skip
        f, error = np.array([(line.frequency, line.error) for line in spectrum.lines]).T
        missing += unsteady(searched, [f"{x:.4g} Hz" for x in f], f, error)
    return Inspection(
        measured=measured, spectrum=spectrum, origins=_origins(measured, spectrum, part), kept=kept,
        clipped=_clipped_samples(measured), constant=constant, missing=tuple(missing),
    )  # fmt: skip


def unsteady(
    measured: Measurement,
    names: Sequence[str],
    frequencies: Floats,
    errors: Floats,
    least: float = 0.0,
    turn_errors: float = 2.0,
) -> list[str]:
    """Return a sentence, without a full stop, if a line of waveforms changes between both halves.

    The change must exceed the noise, the share `least`, and what a phase error explains:
    `turn_errors` times the errors (f,) in Hz of its frequency.
    """
    count = len(measured.times)
    half = int((1 - SETTLE) * count) // 2
    if half < 2:
        return []
    amplitudes, rest = fit_lines(as_response(measured), frequencies)
    bare = replace(measured, drive=np.empty(0))
    first, second = (
        lines_of(
            replace(bare, times=measured.times[part], values=rest[None, part]), frequencies,
            settle=0.0,
        )
        for part in (slice(count - 2 * half, count - half), slice(count - half, count))
    )  # fmt: skip
    change = second.mean - first.mean
    both = replace(first, variance=first.variance + second.variance)
    size = np.linalg.norm(amplitudes, axis=1)
    share = np.linalg.norm(change, axis=1) / size
    turn = np.pi * (1 - SETTLE) * count / measured.rate * errors
    unsteady_chance = 0.01  # that a steady motion is called unsteady
    is_sure = (holm(both.p_values(change)) < unsteady_chance).any(axis=1)
    beyond = np.flatnonzero(is_sure & (share > np.maximum(turn_errors * turn, least)))
    if not len(beyond):
        return []
    k = beyond[(share * size)[beyond].argmax()]
    return [
        f"the line at {names[k]} changes by {percent(share[k])} between the halves of the record: "
        "the motion is not steady, or lines are too close, and errors of lines and frequencies are "
        "not valid; cut off the unsteady part, or record longer"
    ]


def _of_amplitudes(measured: Measurement, kept: np.ndarray, alarm: float) -> LineSpectrum | None:
    """Return the lines of spectra with equally spaced frequencies: maxima above the floor."""
    width, runs = bin_width(measured), len(measured.values)
    fewest_bins = 64  # equally spaced frequencies of a spectrum with a noise floor
    if not width or len(measured.frequencies) < fewest_bins:
        return None
    density = np.mean(np.abs(measured.values[:, :, kept]) ** 2, axis=0)
    floor = noise_floor(density, runs)
    position, chance = peaks(density, floor, runs, alarm, np.empty(0))
    bins = np.round(position).astype(int)
    lines = tuple(
        SpectralLine(frequency=float(measured.frequencies[bins[k]]), error=width / np.sqrt(12),
                     amplitudes=np.sqrt(density[bins[k]]), false_alarm=float(chance[k]))
        for k in np.argsort(bins)
    )  # fmt: skip
    return LineSpectrum(lines=lines, frequencies=measured.frequencies, density=density, floor=floor)


def _origins(measured: Measurement, spectrum: LineSpectrum | None, part: slice) -> tuple[str, ...]:
    """Return the origin of each line: drive, mains hum or ""."""
    if spectrum is None:
        return ()
    duration, driven = np.inf, set()
    if not measured.is_spectrum:
        duration = (part.stop - part.start) / measured.rate
        if len(measured.drive) and np.ptp(measured.drive) > 0:
            of_drive = find_lines(measured.drive[None, part, None], measured.rate).lines
            driven = {
                k for k, line in enumerate(spectrum.lines)
                if any(_is_multiple(line, other, 1, duration) for other in of_drive)
            }  # fmt: skip
    hum = hum_of(spectrum.lines, duration, driven)
    return tuple("drive" if k in driven else hum.get(k, "") for k in range(len(spectrum.lines)))


def _is_multiple(line: SpectralLine, base: SpectralLine, n: int, duration: float) -> bool:
    """Whether a line can be the n-th multiple of another within four standard errors."""
    within = 4.0 * float(np.hypot(line.error, n * base.error)) + 0.05 / duration
    return abs(line.frequency - n * base.frequency) <= within


def hum_of(
    lines: Sequence[SpectralLine], duration: float, driven: Container[int] = ()
) -> dict[int, str]:
    """Return names, such as "mains 3 x 50 Hz", by index of the lines that may be mains hum.

    Hum needs a line at the mains frequency, because 200, 400 and 600 Hz may be lines of a load; its
    multiples are those of the measured mains frequency. Lines with the indices `driven` are in the
    recorded drive and do not count. The duration is in s.
    """
    hum: dict[int, str] = {}
    most_hum = 20  # times the mains frequency
    for mains, base in _mains(lines, driven):
        for k, line in enumerate(lines):
            n = round(line.frequency / base.frequency)
            if 1 <= n <= most_hum and _is_multiple(line, base, n, duration):
                hum.setdefault(k, f"mains {f'{n} x ' * (n > 1)}{mains:g} Hz")
    return hum


def _mains(
    lines: Sequence[SpectralLine], driven: Container[int]
) -> list[tuple[float, SpectralLine]]:
    """Return the mains frequencies that are present, with the nearest line."""
    present = []
    for mains, wander in MAINS.items():
        near = [line for k, line in enumerate(lines)
                if k not in driven and abs(line.frequency - mains) <= wander]  # fmt: skip
        if near:
            present.append((mains, min(near, key=lambda line: abs(line.frequency - mains))))
    return present


def clip_count(waveform: Floats) -> int:
    """Return the number of samples of a waveform (t,) that are cut off at its extreme values.

    A peak flattened by rounding has as many samples one step below; a clipped peak does not.
    """
    return _cut_off(waveform) + _cut_off(-waveform) if np.ptp(waveform) > 0 else 0


def _clipped_samples(measured: Measurement) -> np.ndarray:
    """Return numbers (r, p) of clipped samples."""
    if measured.is_spectrum:
        return np.zeros((len(measured.values), len(measured.places)), int)
    return np.array([[clip_count(waveform) for waveform in run.T] for run in measured.values])


def _cut_off(x: Floats) -> int:
    top = x.max()
    at_top = x == top
    lengths = np.bincount(label(at_top)[0])[1:]
    run, fewest_runs = 3, 2  # clipped samples in a row at an extreme, and how many such runs,
    long_run = 20  # or one run
    if (lengths >= run).sum() < fewest_runs and lengths.max() < long_run:
        return 0
    relative_band = 0.005  # of the half range, next to the extreme
    band = min(top - relative_band * np.ptp(x) / 2, x[x < top].max())
    count, below = int(at_top.sum()), int(((x < top) & (x >= band)).sum())
    excess = 6.0  # times the samples in the band; a rounded sinusoid has at most 2.4
    return count if count > excess * below else 0


def flaws(measured: Measurement, pressure: MovingPressure) -> list[str]:
    """Return warnings of clipping, and of mains hum on a line of the load."""
    if measured.is_spectrum:
        return []
    sentences, cut = [], _clipped_samples(measured)
    if cut.any():
        where = measured.place_names(np.flatnonzero(cut.sum(axis=0)))
        sentences.append(
            f"the record is clipped: {int(cut.sum()):,} samples in runs at the same extreme, at "
            f"{where}; this weakens lines and adds others; measure with a larger range"
        )
    return sentences + _hum(measured, pressure)


def _hum(measured: Measurement, pressure: MovingPressure) -> list[str]:
    """Return sentences on lines of the load that coincide with a multiple of mains hum."""
    load = line_names(pressure)
    strong_ratio = 1e-2  # of the strongest line of the load, for which hum may be mistaken
    strong = load.strengths >= strong_ratio * load.strengths.max(initial=0.0)
    f, names = load.frequencies[strong], np.array(load.names)[strong]
    apart = 1 / float(np.ptp(measured.times))

    def on(mains: float, within: float) -> np.ndarray:
        n = np.clip(np.round(f / mains), 1, 7)  # multiples that may be as strong as a line
        return np.asarray(np.abs(f - n * mains) <= apart + within * n * mains)

    if not any(on(mains, wander / mains).any() for mains, wander in MAINS.items()):
        return []  # without the slow search for lines
    lines = inspect(measured).lines
    driven = [k for k, x in enumerate(lines) if (np.abs(f - x.frequency) <= apart).any()]
    return [
        f"mains hum of {line.frequency:.4g} Hz is present, and {', '.join(names[near])} of the "
        "load cannot be resolved from a multiple of it: the measured line may be hum"
        for _, line in _mains(lines, driven)
        if (near := on(line.frequency, 0.0)).any()
    ]
