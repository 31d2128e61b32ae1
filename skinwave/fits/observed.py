"""Data of a fit: waveforms, complex amplitudes of lines, or their moduli, with standard errors.

Errors are those of the mean over repetitions. Where there is one repetition, those of lines are the
remainder's amplitudes beside them, by the same estimator, and those of waveforms the remainder
itself; the residuals of the fit then set their common scale.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from meshes.tetmesh import Floats
from simple_model import Response
from simple_model.line_names import line_names
from simple_model.line_table import resolved_lines
from simple_model.material import Complex
from simple_model.pressure import MovingPressure
from simple_model.response import SETTLE, fit_lines, resolution
from skinwave.fits.predicted import SAME, Predict, Target, predicted_lines, predicted_waveforms
from skinwave.measurements import Measurement

BESIDE = (-6.0, -4.0, 4.0, 6.0)  # resolutions beside a line where its noise is looked for
POOLED = 10  # degrees of freedom that a probe's mean noise counts as, beside a line's own
STEADY = 1.5  # times the remainder of the rest: that of the start of a steady record, at most
FAINT = 1e-3  # of the largest motion: a transient below it is none
MOST = 20_000_000  # values of waveforms
WEAK = 0.05  # of the load's strongest line: unresolved ones below it are left out
NAMED = 3  # of unresolved lines in a sentence
FOURTH = 70.0  # sum of squares of the coefficients of a fourth difference


@dataclass(frozen=True, kw_only=True, eq=False)
class Data:
    """Data of a fit.

    Parameters
    ----------
    kind, words : str, its name; what is fitted, with how the errors are known
    axis, unit : (n,) float of time in s or frequency in Hz, and which
    labels : names (s,) of the series
    values : (n, s) float, SI, what was measured; complex ones as real and imaginary parts
    error : (n, s) float, their standard errors
    is_known : bool, whether the errors are known; else up to a common factor
    predict : values of the parameters -> (n, s)
    lines : names (f,) of the lines that are fitted, if it is to lines
    rough : data of the same record that cost less, for the search; None if there are none
    """

    kind: str
    words: str
    axis: Floats
    unit: str
    labels: tuple[str, ...]
    values: Floats
    error: Floats
    is_known: bool
    predict: Callable[[Mapping[str, float]], Floats]
    lines: tuple[str, ...] = ()
    rough: "Data | None" = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Lines:
    """Measured lines: names (f,), frequencies (f,) in Hz, mean complex amplitudes (f, p), and the
    standard error (f, p) of each real or imaginary part; whether these are known, and how. `lost`
    are strong lines of the load that the record is too short to resolve, which leak into others.
    """

    names: tuple[str, ...]
    frequencies: Floats
    amplitudes: Complex
    error: Floats
    is_known: bool
    noise: str
    lost: tuple[str, ...] = ()


def data_of(kind: str, measured: Measurement, aim: Target) -> Data:
    """Data of a kind, "waveforms", "lines" or "amplitudes", from a measurement.

    Parameters
    ----------
    kind : str, one of `KINDS`
    measured : Measurement
    aim : Target, whose model predicts them

    Returns
    -------
    Data

    Raises
    ------
    ValueError
        If the measurement has no such data, or the load no line that it resolves.
    """
    return KINDS[kind](measured, aim)


def measured_lines(measured: Measurement, aim: Target) -> Lines:
    """Lines of a load in a measurement, as far as they are predicted.

    Raises
    ------
    ValueError
        If there is none.
    """
    read = _of_spectra if measured.is_spectrum else _of_waveforms
    found = _selected(read(measured, aim.scene.pressure), aim)
    if found.lost:
        duration = float(np.ptp(measured.times))
        raise ValueError(
            f"the record of {1e3 * duration:.4g} ms is too short to resolve {_some(found.lost)} "
            "from other lines of the load; fit waveforms from rest, or a longer record"
        )
    if not len(found.frequencies):
        raise ValueError(
            "the measurement resolves no line of the scene's load; give the scene's Tacton the "
            "frequencies and the path that were measured, or fit waveforms"
        )
    return found


def _selected(found: Lines, aim: Target) -> Lines:
    kept = aim.predicts(found.frequencies)
    return replace(
        found, names=tuple(np.array(found.names)[kept].tolist()),
        frequencies=found.frequencies[kept], amplitudes=found.amplitudes[kept],
        error=found.error[kept],
    )  # fmt: skip


def _of_spectra(measured: Measurement, pressure: MovingPressure) -> Lines:
    f, load = measured.frequencies, line_names(pressure)
    at = np.abs(f[:, None] - load.frequencies).argmin(axis=0)
    near = np.abs(f[at] - load.frequencies) <= SAME * load.frequencies
    names = tuple(name for name, is_near in zip(load.names, near, strict=True) if is_near)
    a = measured.values[:, at[near]]
    if len(a) > 1 and near.any():
        error, noise = _of_repetitions(a)
        return Lines(names=names, frequencies=load.frequencies[near], amplitudes=a.mean(axis=0),
                     error=error, is_known=True, noise=noise)  # fmt: skip
    each = np.full(a.shape[1:], np.sqrt((np.abs(a) ** 2).mean()) if a.size else 1.0)
    return Lines(names=names, frequencies=load.frequencies[near], amplitudes=a[0], error=each,
                 is_known=False, noise="errors the same for all, as there is one repetition",
                 )  # fmt: skip


def _of_waveforms(measured: Measurement, pressure: MovingPressure) -> Lines:
    each = [_response(measured, values) for values in measured.values]
    named, lost = resolved_lines(pressure, each[0])
    f = np.array(list(named.values()))
    fitted = [fit_lines(response, f) for response in each]
    a = np.array([amplitudes for amplitudes, _ in fitted])
    if len(a) > 1:
        error, noise = _of_repetitions(a)
        return Lines(names=tuple(named), frequencies=f, amplitudes=a.mean(axis=0), error=error,
                     is_known=True, noise=noise, lost=_strong(pressure, lost))  # fmt: skip
    remainder = _response(measured, fitted[0][1])
    return Lines(names=tuple(named), frequencies=f, amplitudes=a[0], error=_beside(remainder, f),
                 is_known=False, noise="errors in proportion to what is beside each line",
                 lost=_strong(pressure, lost))  # fmt: skip


def _strong(pressure: MovingPressure, lost: Mapping[str, float]) -> tuple[str, ...]:
    """Those of unresolved lines that are not weak beside the load's strongest."""
    load = line_names(pressure)
    strengths = dict(zip(load.names, load.strengths.tolist(), strict=True))
    least = WEAK * float(load.strengths.max(initial=0.0))
    return tuple(name for name in lost if strengths.get(name, 0.0) > least)


def _response(measured: Measurement, values: Floats) -> Response:
    """One repetition as a response, in evenly spaced times."""
    t = np.linspace(measured.times[0], measured.times[-1], len(measured.times))
    return Response(
        model="measured", times=t, probes=measured.places, values=values,
        quantity=measured.quantity,
    )  # fmt: skip


def _of_repetitions(a: Complex) -> tuple[Floats, str]:
    """Standard error (f, p) of each part of the mean over repetitions a (r, f, p)."""
    r = len(a)
    dof = 2 * (r - 1)
    variance = (np.abs(a - a.mean(axis=0)) ** 2).sum(axis=0) / dof
    pooled = variance.mean(axis=0)
    error = np.sqrt((POOLED * pooled + dof * variance) / (POOLED + dof) / r)
    return _above_none(error, a), f"errors from {r} repetitions"


def _beside(remainder: Response, f: Floats) -> Floats:
    """Standard error (f, p) of each part of lines, from the same estimator beside them."""
    if not len(f):
        return np.empty((0, remainder.values.shape[1]))
    beside = resolution(remainder) * np.array(BESIDE)
    nyquist = 0.5 * (len(remainder.times) - 1) / float(np.ptp(remainder.times))
    power = []
    for away in beside:
        at = np.clip(f + away, 2 * resolution(remainder), 0.999 * nyquist)
        power.append([np.abs(fit_lines(remainder, x)[0][0]) ** 2 / 2 for x in at])
    variance = np.mean(power, axis=0)
    dof = 2 * len(BESIDE)
    error = np.sqrt((POOLED * variance.mean(axis=0) + dof * variance) / (POOLED + dof))
    return _above_none(error, remainder.values)


def _above_none(error: Floats, values: np.ndarray) -> Floats:
    """Errors that are not 0, as those of repetitions without noise would be."""
    least = 1e-9 * float(np.abs(values).max(initial=0.0)) or 1e-300
    return np.asarray(np.maximum(error, least))


def _lines(measured: Measurement, aim: Target) -> Data:
    found = measured_lines(measured, aim)
    predict = predicted_lines(aim, found.frequencies)
    places = place_names(measured.places)
    return Data(
        kind="lines", words=f"complex amplitudes of {_counted(found)}, {found.noise}",
        axis=found.frequencies, unit="Hz",
        labels=tuple(f"{name}, {part}" for part in ("real", "imaginary") for name in places),
        values=_parts(found.amplitudes), error=np.hstack([found.error, found.error]),
        is_known=found.is_known, predict=lambda values: _parts(predict(values)),
        lines=found.names,
    )  # fmt: skip


def _amplitudes(measured: Measurement, aim: Target) -> Data:
    """Moduli, with that of noise: the mean of Rice's distribution for weak noise."""
    found = measured_lines(measured, aim)
    predict = predicted_lines(aim, found.frequencies)
    noise = found.error**2 if found.is_known else 0.0
    return Data(
        kind="amplitudes", words=f"amplitudes of {_counted(found)}, {found.noise}",
        axis=found.frequencies, unit="Hz", labels=place_names(measured.places),
        values=np.abs(found.amplitudes), error=found.error, is_known=found.is_known,
        predict=lambda values: np.sqrt(np.abs(predict(values)) ** 2 + noise), lines=found.names,
    )  # fmt: skip


def _waveforms(measured: Measurement, aim: Target) -> Data:
    if measured.is_spectrum:
        raise ValueError("the measurement is of spectra; fit lines or amplitudes")
    if measured.times.size * len(measured.places) > MOST:
        raise ValueError(
            f"the waveforms are {measured.times.size * len(measured.places):,} values, the limit "
            f"is {MOST:,}; select places or times, or fit lines"
        )
    lines = _selected(_of_waveforms(measured, aim.scene.pressure), aim)
    if len(lines.frequencies) and not lines.lost and is_steady(measured, lines.frequencies):
        return _steady(measured, aim, lines)
    return _from_rest(measured, aim, lines)


def is_steady(measured: Measurement, frequencies: Floats) -> bool:
    """Whether lines, fitted to the later part of waveforms, are all of their start, too."""
    rest = fit_lines(_response(measured, measured.mean), frequencies)[1]
    n = int(SETTLE * len(rest))
    start, later = (np.sqrt((part**2).mean()) for part in (rest[:n], rest[n:]))
    return bool(start <= max(STEADY * later, FAINT * np.abs(measured.mean).max()))


def _steady(measured: Measurement, aim: Target, lines: Lines) -> Data:
    """Waveforms about their mean as the sum of lines."""
    predict = predicted_lines(aim, lines.frequencies)
    waves = np.exp(2j * pi * measured.times[:, None] * lines.frequencies)

    def synthesised(values: Mapping[str, float]) -> Floats:
        x = (waves @ predict(values)).real
        return np.asarray(x - x.mean(axis=0))

    rest = fit_lines(_response(measured, measured.mean), lines.frequencies)[1]
    error, noise = _noise(measured, rest.std(axis=0))
    return replace(
        _of_time(measured, synthesised, error),
        words=f"steady waveforms about their mean, as {_counted(lines)}, {noise}",
        values=measured.mean - measured.mean.mean(axis=0), lines=lines.names,
        rough=_lines(measured, aim),
    )  # fmt: skip


def _from_rest(measured: Measurement, aim: Target, lines: Lines) -> Data:
    if aim.record.is_steady:
        why = f"are too short to resolve {_some(lines.lost)}" if lines.lost else "have a transient"
        raise ValueError(
            f"the waveforms {why}, and {aim.model} has the steady state alone; take another model"
            + " or a longer record" * bool(lines.lost)
            + ", or fit lines" * (not lines.lost)
        )
    predict = predicted_waveforms(aim, measured.times)
    differences = np.diff(measured.mean, 4, axis=0)  # which leave little of smooth motion
    error, noise = _noise(measured, np.sqrt((differences**2).mean(axis=0) / FOURTH))
    return replace(
        _of_time(measured, predict, error),
        words=f"waveforms from rest at t = 0, {noise}",
        rough=_lines(measured, aim) if len(lines.frequencies) and not lines.lost else None,
    )


def _some(names: tuple[str, ...]) -> str:
    """The first of some names."""
    return ", ".join(names[:NAMED]) + f" and {len(names) - NAMED} more" * (len(names) > NAMED)


def _noise(measured: Measurement, alone: Floats) -> tuple[Floats, str]:
    """Standard error (p,) of the mean over repetitions, `alone` if there is one; how it is known.

    Parameters
    ----------
    measured : Measurement
    alone : (p,) float

    Returns
    -------
    (p,) float, and a clause
    """
    r = len(measured.values)
    if r == 1:
        return alone, "errors in proportion to the noise at each place"
    variance = measured.values.var(axis=0, ddof=1).mean(axis=0)
    return np.sqrt(variance / r), f"errors from {r} repetitions"


def _of_time(measured: Measurement, predict: Predict, error: Floats) -> Data:
    each = np.broadcast_to(_above_none(error, measured.values), measured.mean.shape)
    return Data(
        kind="waveforms", words="", axis=measured.times, unit="s",
        labels=place_names(measured.places), values=measured.mean, error=each,
        is_known=len(measured.values) > 1, predict=predict,
    )  # fmt: skip


def _parts(a: Complex) -> Floats:
    return np.hstack([a.real, a.imag])


def _counted(lines: Lines) -> str:
    n, p = lines.amplitudes.shape
    return f"{n} line{'s' * (n > 1)} at {p} place{'s' * (p > 1)}"


def place_names(places: Floats) -> tuple[str, ...]:
    """Names of places, in mm."""
    return tuple(f"({1e3 * x:g}, {1e3 * y:g}) mm" for x, y in places)


KINDS: dict[str, Callable[[Measurement, Target], Data]] = {
    "waveforms": _waveforms,
    "lines": _lines,
    "amplitudes": _amplitudes,
}
