"""Coherence of a measurement with the lines of a model, over time, repetitions and places."""

from dataclasses import dataclass, replace

import numpy as np

from meshes.tetmesh import Floats
from simple_model.response import SETTLE, fit_lines
from skinwave.measure.lines import MeasuredLines, as_response, lines_of
from skinwave.measure.measurement import Measurement

MOST_SEGMENTS = 8  # of each repetition
RESOLVED = 2.5  # bins, which lines of a segment are apart at least


@dataclass(frozen=True, kw_only=True, eq=False)
class Coherence:
    """Magnitude-squared coherence of lines, 0..1.

    Parameters
    ----------
    over_time : (f, p) float, of data and model over all segments of all repetitions: the share of a
        line's power that keeps its phase to the model's; nan where there is but one segment
    segments : their number k
    over_repetitions : (f, p) float, the same over the repetitions alone, each as a whole
    repetitions : their number
    extremes : (2, f, p) float, least and largest amplitude in a segment, over the repetitions, in
        the unit of the measurement: the same if the motion is steady

    Of k independent values with no coherence at all, 1/k is left on average; see `floor`.
    """

    over_time: Floats
    segments: int
    over_repetitions: Floats
    repetitions: int
    extremes: Floats


def coherence(
    measurement: Measurement, frequencies: Floats, *, settle: float = SETTLE
) -> Coherence:
    """Coherence of the lines of a measurement with those of a steady model.

    A steady model has the same complex amplitude in every segment, once time runs on through all of
    them; its magnitude-squared coherence with the data is that of the data's amplitudes z with a
    constant, |sum z|^2 / (k sum |z|^2) (Dobie & Wilson 1989), whatever the model's own amplitude.

    Parameters
    ----------
    measurement : Measurement
    frequencies : (f,) float, Hz
    settle : fraction of waveforms that is left out at their start

    Returns
    -------
    Coherence
    """
    lines = lines_of(measurement, frequencies, settle=settle)
    segments = _segments(measurement, lines, settle)
    each = np.abs(segments.reshape(-1, *lines.each.shape).mean(axis=1))
    return Coherence(
        extremes=np.array([each.min(axis=0), each.max(axis=0)]),
        over_time=with_a_constant(segments), segments=len(segments),
        over_repetitions=with_a_constant(lines.each), repetitions=len(lines.each),
    )  # fmt: skip


def with_a_constant(each: np.ndarray) -> Floats:
    """Magnitude-squared coherence (f, p) of complex amplitudes (k, f, p) with a constant; nan for
    k = 1.
    """
    power = (np.abs(each) ** 2).sum(axis=0) * len(each)
    if len(each) < 2:
        return np.full(each.shape[1:], np.nan)
    return np.asarray(np.abs(each.sum(axis=0)) ** 2 / np.where(power > 0, power, 1))


def over_places(measured: np.ndarray, model: np.ndarray) -> Floats:
    """Coherence (f,) of the patterns of lines (f, p) over the places: the modal assurance criterion
    (Allemang & Brown 1982), 1 where gain and phase of a whole line alone differ; nan of one place.
    """
    if measured.shape[1] < 2:
        return np.full(len(measured), np.nan)
    common = np.abs((model.conj() * measured).sum(axis=1)) ** 2
    power = (np.abs(model) ** 2).sum(axis=1) * (np.abs(measured) ** 2).sum(axis=1)
    return np.asarray(common / np.where(power > 0, power, 1))


def unbiased(coherence: Floats, k: int) -> Floats:
    """Coherence of k values less what none at all would show, 1/k on average: (k c - 1) / (k - 1),
    not below 0.
    """
    return np.maximum((k * coherence - 1) / (k - 1), 0.0) if k > 1 else coherence


def floor(k: int, level: float = 0.95) -> float:
    """Coherence that k values without any stay below with a probability: 1 - (1 - level)^(1/(k-1))
    (Amos & Koopmans 1963); nan of one.
    """
    return float(1 - (1 - level) ** (1 / (k - 1))) if k > 1 else float("nan")


def _segments(measurement: Measurement, lines: MeasuredLines, settle: float) -> np.ndarray:
    """Amplitudes (k, f, p) in segments of each repetition, as many as resolve the lines, shifted as
    the repetitions were.
    """
    if measurement.is_spectrum or not len(lines.frequencies):
        return lines.each
    r, t, p = measurement.values.shape
    first = int(np.ceil(settle * t))
    apart = np.diff(np.concatenate([[0.0], np.sort(lines.frequencies)])).min()
    span = (t - first) / measurement.rate
    count = int(np.clip(span * apart / RESOLVED, 1, MOST_SEGMENTS))
    length = (t - first) // count
    whole = as_response(measurement, measurement.values.transpose(1, 0, 2).reshape(t, r * p))
    turned = np.exp(2j * np.pi * np.multiply.outer(lines.shifts, lines.frequencies))
    found = []
    for k in range(count):
        cut = slice(first + k * length, first + (k + 1) * length)
        part = replace(whole, times=whole.times[cut], values=whole.values[cut])
        z = fit_lines(part, lines.frequencies, settle=0.0)[0]
        each = z.reshape(len(lines.frequencies), r, p).transpose(1, 0, 2)
        found.append(each * turned[:, :, None])
    return np.concatenate(found)
