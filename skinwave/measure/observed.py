"""Data of a fit: waveforms, complex amplitudes of lines, or their moduli, with standard errors.

Errors are those of the mean over repetitions. With one repetition, errors of lines are those of
`lines`, and errors of waveforms are proportional to the residual, with a scale from the fit.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from simple_model import resolved_lines
from simple_model.load.line_names import line_names
from simple_model.numbers import first_few, plural
from simple_model.response import SETTLE, fit_lines
from skinwave.measure.lines import MeasuredLines, as_response, holm, lines_of, measurable
from skinwave.measure.measurement import Measurement
from skinwave.measure.predicted import Predict, Target, line_predictor, waveform_predictor
from skinwave.typing import Complex, Floats

KINDS = ("waveforms", "lines", "amplitudes")


@dataclass(frozen=True, kw_only=True)
class LeftOutLine:
    """Line of the load that is left out: weak and unresolved, or absent in a reduced body."""

    name: str
    frequency: float  # Hz
    share: float  # of the measured power of all lines, noise subtracted; nan if unresolved


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadLines:
    """Lines of a load in a measurement that a model predicts."""

    names: tuple[str, ...]  # (f,)
    measured: MeasuredLines
    unresolved: tuple[str, ...] = ()  # strong lines, which leak into others
    left_out: tuple[LeftOutLine, ...] = ()

    @property
    def is_known(self) -> bool:
        """Whether errors are known."""
        return bool(np.isfinite(self.measured.variance).all())

    @property
    def error(self) -> Floats:
        """Standard error (f, p) of each real or imaginary part; the same for all if unknown."""
        a = self.measured.mean
        if self.is_known:
            return _positive(self.measured.amplitude_error, a)
        return np.full(a.shape, np.sqrt((np.abs(a) ** 2).mean()) if a.size else 1.0)

    @property
    def words(self) -> str:
        """Numbers of lines and places in words."""
        n, p = self.measured.mean.shape
        return f"{plural(n, 'line')} at {plural(p, 'place')}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Data:
    """Data of a fit, and the prediction of a model."""

    kind: str  # one of KINDS
    words: str  # what is fitted, and where the errors are from
    axis: Floats  # (n,), time in s or frequency in Hz
    values: Floats  # (n, s) SI, complex ones as real and imaginary parts
    error: Floats  # (n, s), standard errors
    is_known: bool  # whether errors are known, or only up to a common factor
    predict: Predict  # values of the parameters -> (n, s)
    # Matrices (1 or p, m, m) that make the m values of a place over their errors independent.
    whitening: Floats | None = None
    lines: tuple[str, ...] = ()  # fitted lines
    left_out: tuple[LeftOutLine, ...] = ()  # lines of the load that are not fitted
    # Degrees of freedom of the errors; 0 if noise and misfit cannot be told apart.
    freedom: float = np.inf
    rough: "Data | None" = None  # cheaper data of the same record, for the search

    @property
    def is_in_time(self) -> bool:
        """Whether the data are waveforms."""
        return self.kind == "waveforms"

    def whiten(self, values: Floats) -> Floats:
        """Scale values (n, s) by their errors and decorrelate them."""
        over = values / self.error
        if self.whitening is None:
            return np.asarray(over)
        parts = self.whitening.shape[1] // len(over)
        each = over.reshape(len(over), parts, -1).transpose(2, 1, 0)
        white = self.whitening @ each.reshape(len(each), -1, 1)
        return np.asarray(white.reshape(each.shape).transpose(2, 1, 0).reshape(over.shape))


def data_of(kind: str, measured: Measurement, target: Target) -> Data:
    """Return data of one of the `KINDS`. Raises a ValueError if the measurement has none."""
    if kind == "waveforms":
        return _waveforms(measured, target)
    return _of_lines(kind, measured, target)


def load_lines(measured: Measurement, target: Target) -> LoadLines:
    """Return the lines of the load that are in the measurement and that the model predicts."""
    load, lost = line_names(target.scene.pressure), dict[str, float]()
    if measured.is_spectrum:
        away = np.abs(measured.frequencies[:, None] - load.frequencies).min(axis=0)
        near = away <= target.same_line * load.frequencies
        near &= measurable(measured, load.frequencies)
        kept = {load.names[k]: float(load.frequencies[k]) for k in np.flatnonzero(near)}
    else:
        kept, lost = resolved_lines(target.scene.pressure, as_response(measured))
    lines, names = lines_of(measured, np.array(list(kept.values()))), np.array(list(kept))
    predicted = target.predicts(lines.frequencies)
    strengths = dict(zip(load.names, load.strengths.tolist(), strict=True))
    weak_ratio = 0.05  # of the load's strongest line; weaker unresolved lines are left out
    least = weak_ratio * float(load.strengths.max(initial=0.0))
    strong = tuple(name for name in lost if strengths.get(name, 0.0) > least)
    weak = (LeftOutLine(name=name, frequency=f, share=np.nan)
            for name, f in lost.items() if name not in strong)  # fmt: skip
    return LoadLines(
        names=tuple(names[predicted].tolist()), measured=lines.only(predicted), unresolved=strong,
        left_out=(*_not_predicted(names, lines, ~predicted), *weak),
    )  # fmt: skip


def _not_predicted(
    names: np.ndarray, lines: MeasuredLines, left_out: np.ndarray
) -> list[LeftOutLine]:  # fmt: skip
    """Return the measured lines that a reduced body does not predict, the strongest first."""
    power = np.abs(lines.mean) ** 2 - np.nan_to_num(lines.variance)
    whole = max(float(np.maximum(power, 0.0).sum()), 1e-300)
    chance = lines.p_values(lines.mean)
    each = []
    noise_chance = 0.01  # p-value of a line, below which it is more than noise
    for k in np.flatnonzero(left_out).tolist():
        is_noise = holm(chance[k]).min(initial=1.0) >= noise_chance  # nan if unknown
        share = 0.0 if is_noise else max(float(power[k].sum()), 0.0) / whole
        f = float(lines.frequencies[k])
        each.append(LeftOutLine(name=str(names[k]), frequency=f, share=share))
    return sorted(each, key=lambda line: -line.share)


def _of_lines(kind: str, measured: Measurement, target: Target) -> Data:
    """Return real and imaginary parts of amplitudes, or moduli with noise (Rice's distribution)."""
    lines = load_lines(measured, target)
    if lines.unresolved:
        names = first_few(lines.unresolved)
        raise ValueError(f"the record is too short to resolve {names}; use --to waveforms")
    if not lines.names:
        raise ValueError("the measurement resolves no line of the scene's load; check the Tacton")
    amplitudes = lines.measured
    a, f, correlation = amplitudes.mean, amplitudes.frequencies, amplitudes.correlation
    predict, runs = line_predictor(target, f), len(amplitudes.each)
    known = f"{runs} repetitions" if runs > 1 else "the noise floor"
    noise = f"with errors from {known}"
    if not lines.is_known:
        noise = "with equal errors, as there is one repetition"
    data = Data(
        kind=kind, words=f"complex amplitudes of {lines.words} {noise}", axis=f,
        values=_parts(a), error=np.tile(lines.error, 2), is_known=lines.is_known,
        predict=lambda values: _parts(predict(values)), lines=lines.names, left_out=lines.left_out,
        whitening=None if correlation is None else _whitening(correlation[None]),
        freedom=float(np.min(amplitudes.freedom)) if lines.is_known else 0.0,
    )  # fmt: skip
    if kind == "lines":
        return data
    floor = lines.error**2 if lines.is_known else 0.0
    return replace(
        data, words=f"amplitudes of {lines.words} {noise}", values=np.abs(a), error=lines.error,
        predict=lambda values: np.sqrt(np.abs(predict(values)) ** 2 + floor),
        whitening=None if correlation is None else _whitening(_of_moduli(correlation, a)),
    )  # fmt: skip


def _of_moduli(correlation: Floats, a: Complex) -> Floats:
    """Return the correlations (p, f, f) of the moduli of amplitudes (f, p)."""
    turn = np.exp(1j * np.angle(a.T))
    along = np.concatenate([turn.real, turn.imag], axis=1)
    shared = along[:, :, None] * correlation * along[:, None, :]
    return np.asarray(shared.reshape(-1, 2, len(a), 2, len(a)).sum(axis=(1, 3)))


def _whitening(correlation: Floats) -> Floats:
    """Return matrices (p, m, m) that make errors with correlations (p, m, m) independent."""
    values, vectors = np.linalg.eigh(correlation)
    least_variance = 1e-3  # of a combination of lines, relative to the largest
    least = least_variance * values.max(axis=-1, keepdims=True, initial=0.0)
    return np.asarray(vectors.swapaxes(-1, -2) / np.sqrt(np.maximum(values, least))[..., None])


def _waveforms(measured: Measurement, target: Target) -> Data:
    """Return data of waveforms: steady ones, predicted as a sum of lines, or from rest."""
    if measured.is_spectrum:
        raise ValueError("the measurement has spectra; fit lines or amplitudes")
    count = measured.times.size * len(measured.places)
    most_values = 20_000_000  # of waveforms
    if count > most_values:
        raise ValueError(f"{count:,} values of waveforms exceed {most_values:,}; fit lines")
    lines, mean = load_lines(measured, target), measured.mean
    frequencies = lines.measured.frequencies
    rough = _of_lines("lines", measured, target) if lines.names and not lines.unresolved else None
    if rough and is_steady(measured, frequencies):
        rest = fit_lines(as_response(measured), frequencies)[1]
        predict_lines = line_predictor(target, frequencies)
        waves = np.exp(2j * pi * measured.times[:, None] * frequencies)

        def predict_steady(values: Mapping[str, float]) -> Floats:
            x = (waves @ predict_lines(values)).real
            return np.asarray(x - x.mean(axis=0))

        data = _in_time(
            measured, mean - mean.mean(axis=0), predict_steady, rest.std(axis=0),
            f"steady waveforms about their mean, as {lines.words}", rough,
        )  # fmt: skip
        return replace(data, lines=lines.names, left_out=lines.left_out)
    if target.record.is_steady:
        names = first_few(lines.unresolved)
        problem = f"are too short to resolve {names}" if names else "have a transient"
        cure = "a longer record" if names else "fit lines"
        raise ValueError(f"the waveforms {problem}, but {target.model} computes only the steady "
                         f"state; take another model, or {cure}")  # fmt: skip
    differences = np.diff(mean, 4, axis=0)  # nearly free of smooth motion
    fourth_difference = 70.0  # sum of its squared coefficients
    noise = np.sqrt((differences**2).mean(axis=0) / fourth_difference)
    predict = waveform_predictor(target, measured.times)
    return _in_time(measured, mean, predict, noise, "waveforms from rest at t = 0", rough)


def is_steady(measured: Measurement, frequencies: Floats) -> bool:
    """Whether lines fitted to the later part of waveforms also describe their start."""
    rest = fit_lines(as_response(measured), frequencies)[1]
    n = int(SETTLE * len(rest))
    start, later = (np.sqrt((part**2).mean()) for part in (rest[:n], rest[n:]))
    largest = np.abs(measured.mean).max()
    steady = 1.5  # largest residual of the start of a steady record, relative to the rest
    negligible_transient = 1e-3  # of the largest motion
    return bool(start <= max(steady * later, negligible_transient * largest))


def _in_time(
    measured: Measurement,
    values: Floats,
    predict: Callable[[Mapping[str, float]], Floats],
    noise: Floats,
    words: str,
    rough: Data | None,
) -> Data:
    """Return data of waveforms (t, p), with the noise (p,) of each place for one repetition."""
    r = len(measured.values)
    error, source = noise, "with errors in proportion to the noise at each place"
    if r > 1:
        error = np.sqrt(measured.values.var(axis=0, ddof=1).mean(axis=0) / r)
        source = f"with errors from {r} repetitions"
    each = np.broadcast_to(_positive(error, measured.values), values.shape)
    return Data(
        kind="waveforms", words=f"{words} {source}", axis=measured.times, values=values,
        error=each, is_known=r > 1, predict=predict, rough=rough,
    )  # fmt: skip


def _positive(error: Floats, values: np.ndarray) -> Floats:
    """Return errors that are above 0 even if repetitions are equal."""
    least = 1e-9 * float(np.abs(values).max(initial=0.0)) or 1e-300
    return np.asarray(np.maximum(error, least))


def _parts(a: Complex) -> Floats:
    return np.hstack([a.real, a.imag])
