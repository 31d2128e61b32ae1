"""Data of a fit: waveforms, complex amplitudes of lines, or their moduli, with standard errors.

Errors are those of the mean over repetitions. Where there is one repetition, those of lines are as
`lines` has them, and those of waveforms the remainder itself, whose common scale the residuals of
the fit then set.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from simple_model import MovingPressure, resolved_lines
from simple_model.load.line_names import line_names
from simple_model.numbers import counted
from simple_model.response import SETTLE, fit_lines
from simple_model.typing import Complex, Floats
from skinwave.measure.lines import MeasuredLines, as_response, holm, lines_of, measurable
from skinwave.measure.measurement import Measurement
from skinwave.measure.predicted import SAME, Target, predicted_lines, predicted_waveforms
from skinwave.models.parametric import FAINTEST

STEADY = 1.5  # times the remainder of the rest: that of the start of a steady record, at most
FAINT = 1e-3  # of the largest motion: weaker transients are ignored
SINGULAR = 1e-3  # of the largest variance: the least that a combination of lines is given
MOST = 20_000_000  # values of waveforms
FOURTH = 70.0  # sum of squares of the coefficients of a fourth difference
WEAK = 0.05  # of the load's strongest line: unresolved ones below it are left out
NAMED = 3  # of lines in a sentence
SURE = 0.01  # probability of as strong a line in noise alone, below which it is more than noise
NOT_PREDICTED = (
    f"in the reduced body weaker than {FAINTEST:g} of the strongest line, for every material of "
    "the ranges"
)
TOO_CLOSE = "weak in the load, and the record is too short to resolve it from other lines"


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """Line of the load that is not fitted: its name, frequency in Hz, and why. Its `share` is that
    of the measured power of all lines, less what noise has; nan if the record does not resolve it,
    and 0 if it is no stronger than noise.
    """

    name: str
    frequency: float
    why: str
    share: float


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadLines:
    """Measured lines of a load that a model predicts: their `names` (f,) and what was `found` of
    them; `lost` are strong lines of the load that the record is too short to resolve, which leak
    into others; other lines of the load are `left_out`.
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
        return f"{counted(n, 'line')} at {counted(p, 'place')}"

    @property
    def noise(self) -> str:
        """How errors are known."""
        if not self.is_known:
            return "errors the same for all, as there is one repetition"
        runs = len(self.found.each)
        return f"errors from {runs} repetitions" if runs > 1 else "errors from the noise floor"


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
    """Data of a kind of `KINDS`, "waveforms", "lines" or "amplitudes", from a measurement, which
    the model of a target predicts.

    Raises
    ------
    ValueError
        If the measurement has no such data, or the load no line that it resolves.
    """
    return KINDS[kind](measured, aim)


def load_lines(measured: Measurement, aim: Target) -> LoadLines:
    """Lines of a load in a measurement, as far as they are predicted; none if there are none."""
    pressure = aim.scene.pressure
    kept, lost = _resolved(measured, pressure)
    found = lines_of(measured, np.array(list(kept.values())))
    predicted = aim.predicts(found.frequencies)
    load = line_names(pressure)
    strengths = dict(zip(load.names, load.strengths.tolist(), strict=True))
    least = WEAK * float(load.strengths.max(initial=0.0))
    strong = tuple(name for name in lost if strengths.get(name, 0.0) > least)
    close = (LeftOut(name=name, frequency=f, why=TOO_CLOSE, share=np.nan)
             for name, f in lost.items() if name not in strong)  # fmt: skip
    return LoadLines(
        names=tuple(np.array(list(kept))[predicted].tolist()), found=found.taken(predicted),
        lost=strong, left_out=(*_not_predicted(list(kept), found, ~predicted), *close),
    )  # fmt: skip


def _resolved(
    measured: Measurement, pressure: MovingPressure
) -> tuple[Mapping[str, float], Mapping[str, float]]:
    """Names and frequencies in Hz of the lines of a load that a record resolves, and the others."""
    if not measured.is_spectrum:
        return resolved_lines(pressure, as_response(measured))
    load = line_names(pressure)
    away = np.abs(measured.frequencies[:, None] - load.frequencies).min(axis=0)
    near = (away <= SAME * load.frequencies) & measurable(measured, load.frequencies)
    return {load.names[k]: float(load.frequencies[k]) for k in np.flatnonzero(near)}, {}


def _not_predicted(names: list[str], found: MeasuredLines, faint: np.ndarray) -> list[LeftOut]:
    """Those of measured lines that a reduced body does not predict, the strongest first."""
    more = np.abs(found.mean) ** 2 - np.nan_to_num(found.variance)
    whole = max(float(np.maximum(more, 0.0).sum()), 1e-300)
    chance = found.significances(found.mean)
    each = []
    for k in np.flatnonzero(faint).tolist():
        is_noise = holm(chance[k]).min(initial=1.0) >= SURE  # of unknown noise nan
        share = 0.0 if is_noise else max(float(more[k].sum()), 0.0) / whole
        each.append(LeftOut(name=names[k], frequency=float(found.frequencies[k]),
                            why=NOT_PREDICTED, share=share))  # fmt: skip
    return sorted(each, key=lambda line: -line.share)


def some(names: tuple[str, ...]) -> str:
    """The first of some names."""
    return ", ".join(names[:NAMED]) + f" and {len(names) - NAMED} more" * (len(names) > NAMED)


def _of_lines(kind: str, measured: Measurement, aim: Target) -> Data:
    """Complex amplitudes as real and imaginary parts, or moduli with that of noise: the mean of
    Rice's distribution for weak noise.
    """
    found = load_lines(measured, aim)
    if found.lost:
        raise ValueError(
            f"the record of {1e3 * float(np.ptp(measured.times)):.4g} ms is too short to resolve "
            f"{some(found.lost)} from other lines of the load; fit waveforms from rest, or a "
            "longer record"
        )
    if not found.names:
        raise ValueError(
            "the measurement resolves no line of the scene's load; give the scene's Tacton the "
            "frequencies and the path that were measured, or fit waveforms"
        )
    a, places = found.found.mean, _place_names(measured)
    predict, both = predicted_lines(aim, found.found.frequencies), found.found.correlation
    if kind == "lines":
        data = Data(
            kind=kind, words=f"complex amplitudes of {found.words}, {found.noise}", unit="Hz",
            axis=found.found.frequencies, values=_parts(a), error=np.tile(found.error, 2),
            labels=tuple(f"{name}, {part}" for part in ("real", "imaginary") for name in places),
            is_known=found.is_known, predict=lambda values: _parts(predict(values)),
            whitening=None if both is None else _whitening(both[None]),
        )  # fmt: skip
    else:
        noise = found.error**2 if found.is_known else 0.0
        data = Data(
            kind=kind, words=f"amplitudes of {found.words}, {found.noise}", unit="Hz",
            axis=found.found.frequencies, values=np.abs(a), error=found.error, labels=places,
            is_known=found.is_known, has_sign=False,
            predict=lambda values: np.sqrt(np.abs(predict(values)) ** 2 + noise),
            whitening=None if both is None else _whitening(_along(both, a)),
        )  # fmt: skip
    return replace(data, lines=found.names, left_out=found.left_out)


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
    if measured.is_spectrum:
        raise ValueError("the measurement is of spectra; fit lines or amplitudes")
    count = measured.times.size * len(measured.places)
    if count > MOST:
        raise ValueError(
            f"the waveforms are {count:,} values, the limit is {MOST:,}; select places or times, "
            "or fit lines"
        )
    lines = load_lines(measured, aim)
    rough = _of_lines("lines", measured, aim) if lines.names and not lines.lost else None
    if rough and is_steady(measured, lines.found.frequencies):
        return _steady(measured, aim, lines, rough)
    if aim.record.is_steady:
        why = f"are too short to resolve {some(lines.lost)}" if lines.lost else "have a transient"
        cure = " or a longer record" if lines.lost else ", or fit lines"
        raise ValueError(
            f"the waveforms {why}, and {aim.model} has the steady state alone; take another model"
            + cure
        )
    differences = np.diff(measured.mean, 4, axis=0)  # which leave little of smooth motion
    return _of_time(
        measured, measured.mean, predicted_waveforms(aim, measured.times),
        np.sqrt((differences**2).mean(axis=0) / FOURTH), "waveforms from rest at t = 0", rough,
    )  # fmt: skip


def is_steady(measured: Measurement, frequencies: Floats) -> bool:
    """Whether lines, fitted to the later part of waveforms, are all of their start, too."""
    rest = fit_lines(as_response(measured), frequencies)[1]
    n = int(SETTLE * len(rest))
    start, later = (np.sqrt((part**2).mean()) for part in (rest[:n], rest[n:]))
    return bool(start <= max(STEADY * later, FAINT * np.abs(measured.mean).max()))


def _steady(measured: Measurement, aim: Target, lines: LoadLines, rough: Data) -> Data:
    """Waveforms about their mean as the sum of lines."""
    predict = predicted_lines(aim, lines.found.frequencies)
    waves = np.exp(2j * pi * measured.times[:, None] * lines.found.frequencies)

    def synthesised(values: Mapping[str, float]) -> Floats:
        x = (waves @ predict(values)).real
        return np.asarray(x - x.mean(axis=0))

    rest = fit_lines(as_response(measured), lines.found.frequencies)[1]
    data = _of_time(
        measured, measured.mean - measured.mean.mean(axis=0), synthesised, rest.std(axis=0),
        f"steady waveforms about their mean, as {lines.words}", rough,
    )  # fmt: skip
    return replace(data, lines=lines.names, left_out=lines.left_out)


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
        kind="waveforms", words=f"{words}, {noise}", axis=measured.times, unit="s",
        labels=_place_names(measured), values=values, error=each, is_known=r > 1,
        predict=predict, rough=rough,
    )  # fmt: skip


def _above_none(error: Floats, values: np.ndarray) -> Floats:
    """Errors that are not 0, as those of repetitions without noise would be."""
    least = 1e-9 * float(np.abs(values).max(initial=0.0)) or 1e-300
    return np.asarray(np.maximum(error, least))


def _parts(a: Complex) -> Floats:
    return np.hstack([a.real, a.imag])


def _place_names(measured: Measurement) -> tuple[str, ...]:
    return tuple(map(measured.place_name, range(len(measured.places))))


KINDS: dict[str, Callable[[Measurement, Target], Data]] = {
    "waveforms": _waveforms,
    "lines": lambda measured, aim: _of_lines("lines", measured, aim),
    "amplitudes": lambda measured, aim: _of_lines("amplitudes", measured, aim),
}
