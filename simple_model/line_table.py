"""Line table of a response: the lines of its load by name, and all other peaks of its spectrum."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from simple_model.load.line_names import SAME_LINE, WEAKEST, LineNames, line_names
from simple_model.load.pressure import MovingPressure
from simple_model.load.sampling import step
from simple_model.response import (
    ALIKE,
    SETTLE,
    Response,
    are_resolved,
    fit_lines,
    hidden,
    resolution,
    unmixed,
)
from simple_model.typing import Bools, Floats
from simple_model.windows import cosines

FITTED = 1e-4  # of the strongest line of the load: weaker ones are not fitted
FAINTEST = 1e-6  # of it: what a line of the load must have to be found in a response
SEEN = 1e-2  # of the strongest line at a probe, -40 dB: from there on peaks are listed
QUIET = 1e-3  # of the strongest probe: where all lines are weaker, peaks are not looked for
ROUND_OFF = 1e-9  # of the largest motion
MOST_SEEN = 50  # peaks
WINDOW, LOBE = "blackmanharris", 4  # bins to the first zero
DECAYED = 0.9  # second half over first: a peak below it is a free vibration
FREE, UNRESOLVED, UNNAMED = "free vibration", "unresolved", "unnamed"


@dataclass(frozen=True, kw_only=True, eq=False)
class Unnamed:
    """A peak that is no single line of the load: `frequency` in Hz, `amplitudes` (p,), and `kind`:

    "free vibration"  of a body after its start: it decays, and is no line of the load
    "unresolved"      lines of the load too close to each other for so short a response
    "unnamed"         anything else, such as a harmonic that a nonlinear body makes
    """

    frequency: float
    amplitudes: Floats
    kind: str


@dataclass(frozen=True, kw_only=True, eq=False)
class LineTable:
    """All lines of a response.

    Parameters
    ----------
    frequencies, amplitudes : by name, in Hz and (p,) in the unit of the response, the lines of the
        load that are resolved, each once, in ascending order
    unresolved : names and frequencies in Hz of those that the response is too short to resolve from
        0 Hz or from each other
    unnamed : all other peaks above -40 dB of the strongest line at any probe, the strongest first
    """

    frequencies: dict[str, float]
    amplitudes: dict[str, Floats]
    unresolved: dict[str, float]
    unnamed: tuple[Unnamed, ...]


def line_table(
    pressure: MovingPressure,
    response: Response,
    *,
    candidates: Iterable[str] = (),
    beside: Mapping[str, float] | None = None,
) -> LineTable:
    """Lines of a response to a load.

    Listed by name are the lines of the load above -60 dB of its strongest, those weaker ones that
    are above -60 dB of the strongest in the response, and the candidates.

    Parameters
    ----------
    pressure : MovingPressure, the load
    response : Response
    candidates : names of lines that are listed whether or not the load has them
    beside : names and frequencies in Hz of what moves the body beside the pressure; those that
        coincide with a line of the pressure are listed as this

    Returns
    -------
    LineTable, Hz and the unit of the response
    """
    nyquist = 0.5 / step(response.times)
    found = line_names(pressure, FITTED, candidates=candidates)
    same = SAME_LINE / pressure.tacton.duration
    found = found.with_more(_apart(beside or {}, found, same))
    found = found.some(found.frequencies < nyquist)
    fit = _fit(found, response)
    peaks = _peaks(response, fit)
    steady = [peak.frequency for peak in peaks if peak.kind != FREE]
    if steady:  # lines that are weak in the load may be strong in a response
        weak = line_names(pressure, FAINTEST, most=10**6)
        weak = weak.some(weak.frequencies < nyquist)
        found = _with_weak(found, weak, steady, resolution(response))
        fit = _fit(found, response)
        peaks = _peaks(response, fit)
    return _table(found, fit, peaks, response)


def resolved_lines(
    pressure: MovingPressure,
    response: Response,
    *,
    candidates: Iterable[str] = (),
    highest: float = np.inf,
    settle: float = SETTLE,
) -> tuple[dict[str, float], dict[str, float]]:
    """Resolved and unresolved lines of a load.

    Parameters
    ----------
    pressure : MovingPressure, whose lines above -60 dB are taken
    response : Response, which is long enough to resolve a line or not
    candidates, highest, settle : as for `line_table`

    Returns
    -------
    frequencies in Hz by name, of the resolved lines and of the unresolved ones
    """
    highest = min(highest, 0.5 / step(response.times))
    found = line_names(pressure, candidates=candidates)
    found = found.some(found.frequencies < highest)
    f, least = found.frequencies, resolution(response, settle=settle)
    known = are_resolved(response, f, settle=settle, strengths=_floored(found))
    lost = ~known & ~_near(f, f[known], least)
    return _named(found, known), _named(found, lost)


def _named(found: LineNames, kept: Bools) -> dict[str, float]:
    return {found.names[k]: float(found.frequencies[k]) for k in np.flatnonzero(kept)}


def _floored(found: LineNames) -> Floats:
    """Strengths (f,) in Pa, of candidates too."""
    return np.maximum(found.strengths, FITTED * found.strengths.max(initial=1e-300))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fit:
    """Fit of lines (f,): masks of those resolved and of those fitted, if only as the strongest of
    the unresolved; their amplitudes (f, p), and the rest (t, p) of the response.
    """

    resolved: Bools
    fitted: Bools
    amplitudes: Floats
    rest: Floats


def _fit(found: LineNames, response: Response) -> _Fit:
    f, least = found.frequencies, resolution(response)
    strengths = _floored(found)
    fitted = np.zeros(len(f), bool)
    for k in np.argsort(-strengths, kind="stable"):
        fitted[k] = f[k] >= least and not _near(f[k : k + 1], f[fitted], least)[0]
    amplitudes = np.zeros((len(f), response.values.shape[1]))
    complex_amplitudes, rest = fit_lines(response, f[fitted])
    amplitudes[fitted] = np.abs(complex_amplitudes)
    resolved = fitted & unmixed(f, strengths, least)
    left = np.where(_near(f, f[fitted], ALIKE * least), 0.0, strengths)
    resolved &= ~hidden(response, f, strengths, left, fitted)
    return _Fit(resolved=resolved, fitted=fitted, amplitudes=amplitudes, rest=rest)


def _peaks(response: Response, fit: _Fit) -> list[Unnamed]:
    """Peaks in the spectrum of the whole response less the fitted lines."""
    dt, begun = step(response.times), round(SETTLE * len(fit.rest))
    amplitude = _windowed(fit.rest)
    round_off = ROUND_OFF * float(np.abs(response.values).max(initial=0.0))
    loudest = _loudest(np.vstack([amplitude[LOBE:], fit.amplitudes]))
    level = amplitude / np.maximum(loudest, round_off / SEEN)
    of_any = level.max(axis=1)[: len(fit.rest) // 2 + 1]
    inner = of_any[1:-1]
    tops = 1 + np.flatnonzero((inner > SEEN) & (inner >= of_any[:-2]) & (inner > of_any[2:]))
    chosen: list[int] = []
    for k in tops[np.argsort(-of_any[tops], kind="stable")].tolist():
        if k >= LOBE and all(abs(k - other) > LOBE for other in chosen):
            chosen.append(k)
    found = []
    for k in chosen[:MOST_SEEN]:
        bins = k + _offset(amplitude[k - 1 : k + 2, int(np.argmax(level[k]))])
        turns = bins / len(fit.rest)
        free = response.record.of_body and _decays(fit.rest[begun:], turns)
        kind = FREE if free else UNNAMED
        found.append(Unnamed(frequency=turns / dt, amplitudes=amplitude[k], kind=kind))
    return found


def _loudest(amplitudes: Floats) -> Floats:
    """The strongest (p,) of amplitudes (f, p), no less than `QUIET` of the strongest of all."""
    loudest = amplitudes.max(axis=0, initial=0.0)
    return np.maximum(loudest, max(QUIET * loudest.max(initial=0.0), 1e-300))


def _windowed(x: Floats) -> Floats:
    """Amplitudes (f, p) of the spectrum of signals (t, p)."""
    weights = cosines(WINDOW, len(x))[:, None]
    return np.asarray(2 * np.abs(np.fft.rfft(x * weights, axis=0)) / weights.sum())


def _offset(three: Floats) -> float:
    """Where a parabola through the logarithms of three amplitudes has its top, in bins."""
    left, centre, right = np.log(np.maximum(three, 1e-300))
    bend = left - 2 * centre + right
    return float(np.clip((left - right) / bend / 2, -0.5, 0.5)) if bend < 0 else 0.0


def _decays(x: Floats, turns: float) -> bool:
    """Whether signals (t, p) are weaker in their second half, at so many turns a sample."""
    half = len(x) // 2
    wave = cosines("hann", half) * np.exp(-2j * np.pi * turns * np.arange(half))
    first, second = (np.linalg.norm(wave @ part) for part in (x[:half], x[-half:]))
    return bool(second < DECAYED * first)


def _with_weak(
    found: LineNames, weak: LineNames, steady: Sequence[float], least: float
) -> LineNames:
    """Lines and, of weaker ones, the strongest near each of the frequencies (k,) in Hz."""
    more = []
    for f in steady:
        near = np.flatnonzero(np.abs(weak.frequencies - f) < least)
        more += [near[np.argmax(weak.strengths[near])]] if len(near) else []
    more = [k for k in dict.fromkeys(more) if weak.names[k] not in found.names]
    return found.with_more(weak.some(np.array(more, int)))


def _apart(beside: Mapping[str, float], found: LineNames, same: float) -> LineNames:
    """Lines by name that coincide with none of a load's, as strong as the strongest of these."""
    f = np.array(list(beside.values()), np.float64)
    strongest = found.strengths.max(initial=0.0) or 1.0
    strengths = np.full(len(f), strongest)
    lines = LineNames(names=tuple(beside), frequencies=f, strengths=strengths)
    return lines.some(~_near(f, found.frequencies, same))


def _table(found: LineNames, fit: _Fit, peaks: list[Unnamed], response: Response) -> LineTable:
    f, loudest = found.frequencies, _loudest(fit.amplitudes)
    least = resolution(response)
    relative = (fit.amplitudes / loudest).max(axis=1, initial=0.0)
    wanted = (found.strengths >= WEAKEST * found.strengths.max(initial=0.0)) | (relative > WEAKEST)
    wanted |= found.strengths == 0
    listed = fit.resolved & wanted
    lost = wanted & ~fit.resolved & ~_near(f, f[fit.resolved], least)
    bin_width = 1 / (step(response.times) * len(response.times))
    mixed = fit.fitted & ~fit.resolved & (found.strengths > 0) & (relative > SEEN)
    mixed &= f >= LOBE * bin_width
    alone = [x for x in peaks
             if not _near(np.array([x.frequency]), f[lost], LOBE * bin_width)[0]]  # fmt: skip
    unnamed = [*_mixed(response, f[mixed]), *alone]
    unnamed.sort(key=lambda peak: -float((peak.amplitudes / loudest).max()))
    return LineTable(
        frequencies=_named(found, listed),
        amplitudes={found.names[k]: fit.amplitudes[k] for k in np.flatnonzero(listed)},
        unresolved=_named(found, lost),
        unnamed=tuple(unnamed[:MOST_SEEN]),
    )


def _mixed(response: Response, frequencies: Floats) -> list[Unnamed]:
    """Lines that are not resolved, as the spectrum of the response shows them together."""
    if not len(frequencies):
        return []
    amplitude = _windowed(response.values - response.values.mean(axis=0))
    bins = frequencies * step(response.times) * len(response.times)
    return [
        Unnamed(frequency=float(f), kind=UNRESOLVED,
                amplitudes=amplitude[max(int(at) - 1, 0) : int(at) + 3].max(axis=0))
        for f, at in zip(frequencies, bins, strict=True)
    ]  # fmt: skip


def _near(f: Floats, others: Floats, least: float) -> Bools:
    """Whether each of the frequencies (f,) is within a resolution of any of the others (k,)."""
    return np.asarray((np.abs(f[:, None] - others) < least).any(axis=1))
