"""Data of a fit: waveforms, complex amplitudes of lines, or their moduli, with standard errors.

Errors are those of the mean over repetitions. Where there is one repetition, those of lines are as
`lines` has them, and those of waveforms the remainder itself, whose common scale the residuals of
the fit then set.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from simple_model import resolved_lines
from simple_model.load.line_names import line_names
from simple_model.numbers import plural
from simple_model.response import SETTLE, fit_lines
from skinwave.measure.lines import MeasuredLines, as_response, holm, lines_of, measurable
from skinwave.measure.measurement import Measurement
from skinwave.measure.predicted import SAME, Target, predicted_lines, predicted_waveforms
from skinwave.typing import Complex, Floats

KINDS = ("waveforms", "lines", "amplitudes")
STEADY = 1.5  # times the remainder of the rest: that of the start of a steady record, at most
FAINT = 1e-3  # of the largest motion: weaker transients are ignored
SINGULAR = 1e-3  # of the largest variance: the least that a combination of lines is given
MOST = 20_000_000  # values of waveforms
FOURTH = 70.0  # sum of squares of the coefficients of a fourth difference
WEAK = 0.05  # of the load's strongest line: unresolved ones below it are left out
NAMED = 3  # of lines in a sentence
SURE = 0.01  # probability of as strong a line in noise alone, below which it is more than noise


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """Line of the load that is not fitted, since a reduced body leaves it out, or since it is weak
    and not resolved: its name, its frequency in Hz, and its `share` of the measured power of all
    lines less that of noise; nan if it is not resolved, and 0 if it is no stronger than noise.
    """

    name: str
    frequency: float
    share: float


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadLines:
    """Lines of a load in a measurement that a model predicts: their `names` (f,) and what was
    `found` of them; `lost` are strong lines of the load that the record is too short to resolve,
    which leak into others; other lines of the load are `left_out`.
    """

    names: tuple[str, ...]
    found: MeasuredLines
    lost: tuple[str, ...] = ()
    left_out: tuple[LeftOut, ...] = ()

    @property
    def is_known(self) -> bool:
        """Whether errors are known."""
        return bool(np.isfinite(self.found.variance).all())

    @property
    def error(self) -> Floats:
        """Standard error (f, p) of each real or imaginary part; the same for all if unknown."""
        a = self.found.mean
        if self.is_known:
            return _above_none(self.found.amplitude_error, a)
        return np.full(a.shape, np.sqrt((np.abs(a) ** 2).mean()) if a.size else 1.0)

    @property
    def words(self) -> str:
        """How many there are at how many places."""
        n, p = self.found.mean.shape
        return f"{plural(n, 'line')} at {plural(p, 'place')}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Data:
    """Data of a fit.

    Parameters
    ----------
    kind, words : str, one of `KINDS`; what is fitted, with how the errors are known
    axis : (n,) float, time in s or frequency in Hz
    values : (n, s) float, SI, what was measured; complex ones as real and imaginary parts
    error : (n, s) float, their standard errors
    is_known : bool, whether the errors are known; else up to a common factor
    predict : values of the parameters -> (n, s)
    whitening : (1 or p, m, m) float, by which the values of a place over their errors, of m = n s/p
        and the s/p series of it one after the other, become independent; None if they are
    lines : names (f,) of the lines that are fitted, if it is to lines
    left_out : lines of the load that are not, if it is to lines
    rough : data of the same record that cost less, for the search; None if there are none
    """

    kind: str
    words: str
    axis: Floats
    values: Floats
    error: Floats
    is_known: bool
    predict: Callable[[Mapping[str, float]], Floats]
    whitening: Floats | None = None
    lines: tuple[str, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    rough: "Data | None" = None

    @property
    def is_in_time(self) -> bool:
        """Whether it is of waveforms."""
        return self.kind == "waveforms"

    @property
    def has_sign(self) -> bool:
        """Whether a measurement with its sign turned has other values."""
        return self.kind != "amplitudes"

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
    """Data of a kind of `KINDS` from a measurement, which the model of a target predicts; raises a
    ValueError if there are none.
    """
    return _waveforms(measured, aim) if kind == "waveforms" else _of_lines(kind, measured, aim)


def load_lines(measured: Measurement, aim: Target) -> LoadLines:
    """Lines of a load in a measurement, as far as they are predicted; none if there are none."""
    load = line_names(aim.scene.pressure)
    if measured.is_spectrum:
        away = np.abs(measured.frequencies[:, None] - load.frequencies).min(axis=0)
        near = (away <= SAME * load.frequencies) & measurable(measured, load.frequencies)
        kept = {load.names[k]: float(load.frequencies[k]) for k in np.flatnonzero(near)}
        lost: Mapping[str, float] = {}
    else:
        kept, lost = resolved_lines(aim.scene.pressure, as_response(measured))
    found, names = lines_of(measured, np.array(list(kept.values()))), np.array(list(kept))
    predicted = aim.predicts(found.frequencies)
    strengths = dict(zip(load.names, load.strengths.tolist(), strict=True))
    least = WEAK * float(load.strengths.max(initial=0.0))
    strong = tuple(name for name in lost if strengths.get(name, 0.0) > least)
    close = (LeftOut(name=name, frequency=f, share=np.nan)
             for name, f in lost.items() if name not in strong)  # fmt: skip
    return LoadLines(
        names=tuple(names[predicted].tolist()), found=found.taken(predicted), lost=strong,
        left_out=(*_not_predicted(names, found, ~predicted), *close),
    )  # fmt: skip


def _not_predicted(names: np.ndarray, found: MeasuredLines, faint: np.ndarray) -> list[LeftOut]:
    """Those of measured lines that a reduced body does not predict, the strongest first."""
    more = np.abs(found.mean) ** 2 - np.nan_to_num(found.variance)
    whole = max(float(np.maximum(more, 0.0).sum()), 1e-300)
    chance = found.significances(found.mean)
    each = []
    for k in np.flatnonzero(faint).tolist():
        is_noise = holm(chance[k]).min(initial=1.0) >= SURE  # of unknown noise nan
        share = 0.0 if is_noise else max(float(more[k].sum()), 0.0) / whole
        each.append(LeftOut(name=str(names[k]), frequency=float(found.frequencies[k]), share=share))
    return sorted(each, key=lambda line: -line.share)


def some(names: tuple[str, ...]) -> str:
    """The first of some names."""
    return ", ".join(names[:NAMED]) + f" and {len(names) - NAMED} more" * (len(names) > NAMED)


def _of_lines(kind: str, measured: Measurement, aim: Target) -> Data:
    """Complex amplitudes as real and imaginary parts, or moduli with that of noise: the mean of
    Rice's distribution for weak noise.
    """
    lines = load_lines(measured, aim)
    if lines.lost:
        raise ValueError(
            f"the record of {1e3 * float(np.ptp(measured.times)):.4g} ms is too short to resolve "
            f"{some(lines.lost)} from other lines of the load; fit waveforms from rest, or a "
            "longer record"
        )
    if not lines.names:
        raise ValueError(
            "the measurement resolves no line of the scene's load; give the measured Tacton"
        )
    a, f, both = lines.found.mean, lines.found.frequencies, lines.found.correlation
    predict, runs = predicted_lines(aim, f), len(lines.found.each)
    noise = f"errors from {runs} repetitions" if runs > 1 else "errors from the noise floor"
    if not lines.is_known:
        noise = "errors the same for all, as there is one repetition"
    data = Data(
        kind=kind, words=f"complex amplitudes of {lines.words}, {noise}", axis=f,
        values=_parts(a), error=np.tile(lines.error, 2), is_known=lines.is_known,
        predict=lambda values: _parts(predict(values)), lines=lines.names, left_out=lines.left_out,
        whitening=None if both is None else _whitening(both[None]),
    )  # fmt: skip
    if kind == "lines":
        return data
    floor = lines.error**2 if lines.is_known else 0.0
    return replace(
        data, words=f"amplitudes of {lines.words}, {noise}", values=np.abs(a), error=lines.error,
        predict=lambda values: np.sqrt(np.abs(predict(values)) ** 2 + floor),
        whitening=None if both is None else _whitening(_along(both, a)),
    )  # fmt: skip


def _along(correlation: Floats, a: Complex) -> Floats:
    """Correlations (p, f, f) of moduli, whose errors are the parts along the amplitudes (f, p)."""
    turn = np.exp(1j * np.angle(a.T))
    along = np.concatenate([turn.real, turn.imag], axis=1)
    shared = along[:, :, None] * correlation * along[:, None, :]
    return np.asarray(shared.reshape(-1, 2, len(a), 2, len(a)).sum(axis=(1, 3)))


def _whitening(correlation: Floats) -> Floats:
    """Matrices (p, m, m) that make errors of such correlations (p, m, m) independent."""
    values, vectors = np.linalg.eigh(correlation)
    least = SINGULAR * values.max(axis=-1, keepdims=True, initial=0.0)
    return np.asarray(vectors.swapaxes(-1, -2) / np.sqrt(np.maximum(values, least))[..., None])


def _waveforms(measured: Measurement, aim: Target) -> Data:
    """Steady waveforms about their mean as the sum of lines, or waveforms from rest."""
    if measured.is_spectrum:
        raise ValueError("the measurement is of spectra; fit lines or amplitudes")
    count = measured.times.size * len(measured.places)
    if count > MOST:
        raise ValueError(
            f"the waveforms are {count:,} values, the limit is {MOST:,}; fit lines, or less of them"
        )
    lines, mean = load_lines(measured, aim), measured.mean
    rough = _of_lines("lines", measured, aim) if lines.names and not lines.lost else None
    if rough and is_steady(measured, lines.found.frequencies):
        rest = fit_lines(as_response(measured), lines.found.frequencies)[1]
        data = _of_time(
            measured, mean - mean.mean(axis=0), _synthesised(measured, aim, lines),
            rest.std(axis=0), f"steady waveforms about their mean, as {lines.words}", rough,
        )  # fmt: skip
        return replace(data, lines=lines.names, left_out=lines.left_out)
    if aim.record.is_steady:
        why = f"are too short to resolve {some(lines.lost)}" if lines.lost else "have a transient"
        cure = " or a longer record" if lines.lost else ", or fit lines"
        raise ValueError(
            f"the waveforms {why}, and {aim.model} has the steady state alone; take another model"
            + cure
        )
    differences = np.diff(mean, 4, axis=0)  # which leave little of smooth motion
    return _of_time(
        measured, mean, predicted_waveforms(aim, measured.times),
        np.sqrt((differences**2).mean(axis=0) / FOURTH), "waveforms from rest at t = 0", rough,
    )  # fmt: skip


def is_steady(measured: Measurement, frequencies: Floats) -> bool:
    """Whether lines, fitted to the later part of waveforms, are all of their start, too."""
    rest = fit_lines(as_response(measured), frequencies)[1]
    n = int(SETTLE * len(rest))
    start, later = (np.sqrt((part**2).mean()) for part in (rest[:n], rest[n:]))
    return bool(start <= max(STEADY * later, FAINT * np.abs(measured.mean).max()))


def _synthesised(
    measured: Measurement, aim: Target, lines: LoadLines
) -> Callable[[Mapping[str, float]], Floats]:
    """Prediction of steady waveforms (t, p) about their mean."""
    predict = predicted_lines(aim, lines.found.frequencies)
    waves = np.exp(2j * pi * measured.times[:, None] * lines.found.frequencies)

    def synthesised(values: Mapping[str, float]) -> Floats:
        x = (waves @ predict(values)).real
        return np.asarray(x - x.mean(axis=0))

    return synthesised


def _of_time(
    measured: Measurement,
    values: Floats,
    predict: Callable[[Mapping[str, float]], Floats],
    alone: Floats,
    words: str,
    rough: Data | None,
) -> Data:
    """Data of waveforms (t, p), with the standard error of the mean over repetitions or, of one
    repetition, a common multiple of that (p,) of each place `alone`.
    """
    r = len(measured.values)
    error, noise = alone, "errors in proportion to the noise at each place"
    if r > 1:
        error = np.sqrt(measured.values.var(axis=0, ddof=1).mean(axis=0) / r)
        noise = f"errors from {r} repetitions"
    each = np.broadcast_to(_above_none(error, measured.values), values.shape)
    return Data(
        kind="waveforms", words=f"{words}, {noise}", axis=measured.times, values=values,
        error=each, is_known=r > 1, predict=predict, rough=rough,
    )  # fmt: skip


def _above_none(error: Floats, values: np.ndarray) -> Floats:
    """Errors that are not 0, as those of repetitions without noise would be."""
    least = 1e-9 * float(np.abs(values).max(initial=0.0)) or 1e-300
    return np.asarray(np.maximum(error, least))


def _parts(a: Complex) -> Floats:
    return np.hstack([a.real, a.imag])
