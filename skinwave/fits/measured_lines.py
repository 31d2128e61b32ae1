"""Lines of a load in a measurement, with their standard errors, and those that are left out.

Errors are those of the mean over repetitions; of one repetition, the remainder's amplitudes beside
each line, by the same estimator.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import gamma

from meshes.tetmesh import Floats
from simple_model import Response
from simple_model.line_names import line_names
from simple_model.line_table import resolved_lines
from simple_model.material import Complex
from simple_model.pressure import MovingPressure
from simple_model.response import fit_lines, resolution
from skinwave.fits.predicted import SAME, Target
from skinwave.measurements import Measurement
from skinwave.parametric import FAINTEST

BESIDE = (-6.0, -4.0, 4.0, 6.0)  # resolutions beside a line where its noise is looked for
POOLED = 10  # degrees of freedom that a probe's mean noise counts as, beside a line's own
WEAK = 0.05  # of the load's strongest line: unresolved ones below it are left out
NAMED = 3  # of lines in a sentence
SURE = 0.01  # probability of as strong a line in noise alone, below which it is more than noise
FAINT = (
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
class Lines:
    """Measured lines: names (f,), frequencies (f,) in Hz, mean complex amplitudes (f, p), and the
    standard error (f, p) of each real or imaginary part; whether these are known, and how. The mean
    of |amplitude|^2 in noise alone is `floor` (f, p). `lost` are strong lines of the load that the
    record is too short to resolve, which leak into others; others that are not fitted are
    `left_out`.
    """

    names: tuple[str, ...]
    frequencies: Floats
    amplitudes: Complex
    error: Floats
    is_known: bool
    noise: str
    floor: Floats
    lost: tuple[str, ...] = ()
    left_out: tuple[LeftOut, ...] = ()


def measured_lines(measured: Measurement, aim: Target) -> Lines:
    """Lines of a load in a measurement, as far as they are predicted.

    Raises
    ------
    ValueError
        If there is none.
    """
    found = predicted_part(measured, aim)
    if found.lost:
        duration = float(np.ptp(measured.times))
        raise ValueError(
            f"the record of {1e3 * duration:.4g} ms is too short to resolve {some(found.lost)} "
            "from other lines of the load; fit waveforms from rest, or a longer record"
        )
    if not len(found.frequencies):
        raise ValueError(
            "the measurement resolves no line of the scene's load; give the scene's Tacton the "
            "frequencies and the path that were measured, or fit waveforms"
        )
    return found


def predicted_part(measured: Measurement, aim: Target) -> Lines:
    """Lines of a load in a measurement, as far as they are predicted, none if there are none."""
    read = _of_spectra if measured.is_spectrum else _of_waveforms
    found = read(measured, aim.scene.pressure)
    kept = aim.predicts(found.frequencies)
    return replace(
        found, names=tuple(np.array(found.names)[kept].tolist()),
        frequencies=found.frequencies[kept], amplitudes=found.amplitudes[kept],
        error=found.error[kept], floor=found.floor[kept],
        left_out=(*_faint(found, ~kept), *found.left_out),
    )  # fmt: skip


def _faint(found: Lines, faint: np.ndarray) -> list[LeftOut]:
    """Those of measured lines that no reduced body predicts, the strongest first."""
    power = np.abs(found.amplitudes) ** 2
    whole = max(float(np.maximum(power - found.floor, 0.0).sum()), 1e-300)
    each = []
    for k in np.flatnonzero(faint).tolist():
        more = max(float((power[k] - found.floor[k]).sum()), 0.0)
        share = more / whole if _is_above_noise(power[k], found.floor[k]) else 0.0
        each.append(LeftOut(name=found.names[k], frequency=float(found.frequencies[k]),
                            why=FAINT, share=share))  # fmt: skip
    return sorted(each, key=lambda line: -line.share)


def _is_above_noise(power: Floats, floor: Floats) -> bool:
    """Whether powers (p,) are more than noise of mean powers (p,), each exponential, would have."""
    known = floor > 0
    if not known.any():
        return True
    return bool(gamma.sf((power[known] / floor[known]).sum(), known.sum()) < SURE)


def _of_spectra(measured: Measurement, pressure: MovingPressure) -> Lines:
    f, load = measured.frequencies, line_names(pressure)
    at = np.abs(f[:, None] - load.frequencies).argmin(axis=0)
    near = np.abs(f[at] - load.frequencies) <= SAME * load.frequencies
    names = tuple(name for name, is_near in zip(load.names, near, strict=True) if is_near)
    a = measured.values[:, at[near]]
    if len(a) > 1 and near.any():
        error, noise = _of_repetitions(a)
        return Lines(names=names, frequencies=load.frequencies[near], amplitudes=a.mean(axis=0),
                     error=error, is_known=True, noise=noise, floor=2 * error**2)  # fmt: skip
    each = np.full(a.shape[1:], np.sqrt((np.abs(a) ** 2).mean()) if a.size else 1.0)
    return Lines(names=names, frequencies=load.frequencies[near], amplitudes=a[0], error=each,
                 is_known=False, noise="errors the same for all, as there is one repetition",
                 floor=np.zeros(each.shape))  # fmt: skip


def _of_waveforms(measured: Measurement, pressure: MovingPressure) -> Lines:
    each = [response_of(measured, values) for values in measured.values]
    named, lost = resolved_lines(pressure, each[0])
    f = np.array(list(named.values()))
    fitted = [fit_lines(response, f) for response in each]
    a = np.array([amplitudes for amplitudes, _ in fitted])
    if len(a) > 1:
        error, noise = _of_repetitions(a)
    else:
        error = _beside(response_of(measured, fitted[0][1]), f)
        noise = "errors in proportion to what is beside each line"
    strong = _strong(pressure, lost)
    return Lines(
        names=tuple(named), frequencies=f, amplitudes=a.mean(axis=0), error=error,
        is_known=len(a) > 1, noise=noise, floor=2 * error**2, lost=strong,
        left_out=tuple(LeftOut(name=name, frequency=at, why=TOO_CLOSE, share=np.nan)
                       for name, at in lost.items() if name not in strong),
    )  # fmt: skip


def _strong(pressure: MovingPressure, lost: Mapping[str, float]) -> tuple[str, ...]:
    """Those of unresolved lines that are not weak beside the load's strongest."""
    load = line_names(pressure)
    strengths = dict(zip(load.names, load.strengths.tolist(), strict=True))
    least = WEAK * float(load.strengths.max(initial=0.0))
    return tuple(name for name in lost if strengths.get(name, 0.0) > least)


def response_of(measured: Measurement, values: Floats) -> Response:
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
    return above_none(error, a), f"errors from {r} repetitions"


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
    return above_none(error, remainder.values)


def above_none(error: Floats, values: np.ndarray) -> Floats:
    """Errors that are not 0, as those of repetitions without noise would be."""
    least = 1e-9 * float(np.abs(values).max(initial=0.0)) or 1e-300
    return np.asarray(np.maximum(error, least))


def some(names: tuple[str, ...]) -> str:
    """The first of some names."""
    return ", ".join(names[:NAMED]) + f" and {len(names) - NAMED} more" * (len(names) > NAMED)
