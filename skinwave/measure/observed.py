"""Data of a fit: waveforms, complex amplitudes of lines, or their moduli, with standard errors.

Errors are those of the mean over repetitions. Where there is one repetition, those of lines are as
`measured_lines` has them, and those of waveforms the remainder itself, whose common scale the
residuals of the fit then set.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from meshes.tetmesh import Floats
from simple_model.response import SETTLE, fit_lines
from simple_model.typing import Complex
from skinwave.measure import Measurement
from skinwave.measure.lines import as_response
from skinwave.measure.measured_lines import (
    LeftOut,
    Lines,
    above_none,
    measured_lines,
    predicted_part,
    some,
)
from skinwave.measure.predicted import Predict, Target, predicted_lines, predicted_waveforms

STEADY = 1.5  # times the remainder of the rest: that of the start of a steady record, at most
FAINT = 1e-3  # of the largest motion: a transient below it is none
SINGULAR = 1e-3  # of the largest variance: the least that a combination of lines is given
MOST = 20_000_000  # values of waveforms
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
    whitening : (1 or p, m, m) float, by which the values of a place over their errors, of m = n s/p
        and the s/p series of it one after the other, become independent; None if they are
    is_known : bool, whether the errors are known; else up to a common factor
    predict : values of the parameters -> (n, s)
    lines : names (f,) of the lines that are fitted, if it is to lines
    left_out : lines of the load that are not, if it is to lines
    has_sign : bool, whether a measurement with its sign turned has other values
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
    whitening: Floats | None = None
    lines: tuple[str, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    has_sign: bool = True
    rough: "Data | None" = None

    def weighted(self, values: Floats) -> Floats:
        """Values (n, s) in units of their errors, made independent."""
        over = values / self.error
        if self.whitening is None:
            return np.asarray(over)
        parts = self.whitening.shape[1] // len(over)
        each = over.reshape(len(over), parts, -1).transpose(2, 1, 0)
        white = self.whitening @ each.reshape(len(each), -1, 1)
        return np.asarray(white.reshape(each.shape).transpose(2, 1, 0).reshape(over.shape))


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


def _lines(measured: Measurement, aim: Target) -> Data:
    found = measured_lines(measured, aim)
    predict, both = predicted_lines(aim, found.frequencies), found.found.correlation
    places = place_names(measured.places)
    return Data(
        kind="lines", words=f"complex amplitudes of {_counted(found)}, {found.noise}",
        axis=found.frequencies, unit="Hz",
        labels=tuple(f"{name}, {part}" for part in ("real", "imaginary") for name in places),
        values=_parts(found.amplitudes), error=np.hstack([found.error, found.error]),
        is_known=found.is_known, predict=lambda values: _parts(predict(values)),
        whitening=None if both is None else _whitening(both[None]), lines=found.names,
        left_out=found.left_out,
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
        whitening=_of_moduli(found), left_out=found.left_out, has_sign=False,
    )  # fmt: skip


def _of_moduli(found: Lines) -> Floats | None:
    """Whitening of moduli, whose errors are the parts along the amplitudes."""
    both = found.found.correlation
    if both is None:
        return None
    f = len(found.frequencies)
    turn = np.exp(1j * np.angle(found.amplitudes.T))
    along = np.concatenate([turn.real, turn.imag], axis=1)
    shared = along[:, :, None] * both * along[:, None, :]
    return _whitening(shared.reshape(-1, 2, f, 2, f).sum(axis=(1, 3)))


def _whitening(correlation: Floats) -> Floats:
    """Matrices (p, m, m) that make errors of such correlations (p, m, m) independent."""
    values, vectors = np.linalg.eigh(correlation)
    least = SINGULAR * values.max(axis=-1, keepdims=True, initial=0.0)
    return np.asarray(vectors.swapaxes(-1, -2) / np.sqrt(np.maximum(values, least))[..., None])


def _waveforms(measured: Measurement, aim: Target) -> Data:
    if measured.is_spectrum:
        raise ValueError("the measurement is of spectra; fit lines or amplitudes")
    if measured.times.size * len(measured.places) > MOST:
        raise ValueError(
            f"the waveforms are {measured.times.size * len(measured.places):,} values, the limit "
            f"is {MOST:,}; select places or times, or fit lines"
        )
    lines = predicted_part(measured, aim)
    if len(lines.frequencies) and not lines.lost and is_steady(measured, lines.frequencies):
        return _steady(measured, aim, lines)
    return _from_rest(measured, aim, lines)


def is_steady(measured: Measurement, frequencies: Floats) -> bool:
    """Whether lines, fitted to the later part of waveforms, are all of their start, too."""
    rest = fit_lines(as_response(measured, measured.mean), frequencies)[1]
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

    rest = fit_lines(as_response(measured, measured.mean), lines.frequencies)[1]
    error, noise = _noise(measured, rest.std(axis=0))
    return replace(
        _of_time(measured, synthesised, error),
        words=f"steady waveforms about their mean, as {_counted(lines)}, {noise}",
        values=measured.mean - measured.mean.mean(axis=0), lines=lines.names,
        left_out=lines.left_out, rough=_lines(measured, aim),
    )  # fmt: skip


def _from_rest(measured: Measurement, aim: Target, lines: Lines) -> Data:
    if aim.record.is_steady:
        why = f"are too short to resolve {some(lines.lost)}" if lines.lost else "have a transient"
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
    each = np.broadcast_to(above_none(error, measured.values), measured.mean.shape)
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
