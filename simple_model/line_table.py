"""Line table of a response: the lines of its load by name, and all other peaks of its spectrum."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from simple_model.load.line_names import SAME_LINE, WEAKEST, LineNames, during_pulses, line_names
from simple_model.load.pressure import MovingPressure
from simple_model.load.sampling import step
from simple_model.load.spectrum import load_lines
from simple_model.point_kernel import point_kernel
from simple_model.response import (
    ALIKE,
    SETTLE,
    Response,
    are_resolved,
    fit_lines,
    is_masked,
    is_separate,
    phasors,
    resolution,
    windowed_amplitude,
)
from simple_model.spectra import cosines
from simple_model.typing import Bools, Floats

FITTED = 1e-4  # of the strongest line of the load: weaker lines are not fitted
FAINTEST = 1e-6  # of the strongest line of the load: weaker lines name no peak
LEAST_PEAK = 1e-2  # of the strongest line at a probe, -40 dB
QUIET = 1e-3  # of the strongest probe: weaker probes have no peaks
ROUND_OFF = 1e-9  # of the largest motion
MOST_PEAKS = 50
WINDOW, LOBE = "blackmanharris", 4  # bins to the first zero
DECAYED = 0.9  # second half over first: below it a peak is a free vibration
FREE, UNRESOLVED, UNNAMED = "free vibration", "unresolved", "unnamed"
OF_LOAD = "of the load, unnamed"


@dataclass(frozen=True, kw_only=True, eq=False)
class Unnamed:
    """A peak that is not a single line of the load: `frequency` in Hz, `amplitudes` (p,), and
    `kind`.

    Kinds are "free vibration" of a body after its start, which decays and is not in the load;
    "unresolved" lines of the load, too close to each other for a short response; "of the load,
    unnamed" for lines without a name, such as those of a chirp; and "unnamed" for any other peak,
    such as a harmonic of a nonlinear body.
    """

    frequency: float
    amplitudes: Floats
    kind: str


@dataclass(frozen=True, kw_only=True, eq=False)
class LineTable:
    """All lines of a response.

    Parameters
    ----------
    frequencies, amplitudes : by name, in Hz and (p,) in the unit of the response: the resolved
        lines of the load, in ascending order
    unresolved : names and frequencies in Hz of lines too close to 0 Hz or to each other for the
        length of the response
    unnamed : all other peaks above -40 dB of the strongest line at any probe, strongest first
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
    other_lines: Mapping[str, float] | None = None,
) -> LineTable:
    """List the lines of a response to a load.

    Listed by name are lines of the load above -60 dB of its strongest, weaker ones above -60 dB of
    the strongest line of the response, and the `candidates`. `other_lines` are names and
    frequencies in Hz of other motion of the body; a line of the pressure at the same frequency
    takes precedence.

    >>> from simple_model import Tacton, point_kernel
    >>> load = MovingPressure(tacton=Tacton(am_frequency=140.0))
    >>> table = line_table(load, point_kernel(load, [[0.0, 0.0]], np.arange(5000) / 1e4))
    >>> {name: round(float(a[0]), 3) for name, a in table.amplitudes.items()}  # Pa
    {'f_AM': 25.0, '2f_AM': 6.25}
    """
    response = replace(response, load=pressure)
    nyquist = 0.5 / step(response.times)
    named = line_names(pressure, FITTED, candidates=candidates)
    same = SAME_LINE / pressure.tacton.duration
    named = named.with_more(_apart(other_lines or {}, named, same))
    named = named.some(named.frequencies < nyquist)
    fit = _fit(named, response)
    peaks = _peaks(pressure, response, named, fit)
    steady = [peak.frequency for peak in peaks if peak.kind != FREE]
    if steady:  # lines that are weak in the load may be strong in a response
        weak = line_names(pressure, FAINTEST, most=10**6)
        weak = weak.some(weak.frequencies < nyquist)
        named = _with_weak(named, weak, steady, resolution(response))
        fit = _fit(named, response)
        peaks = _peaks(pressure, response, named, fit)
    return _table(named, fit, peaks, response)


def lines_in_pulses(
    pressure: MovingPressure, response: Response, *, candidates: Iterable[str] = ()
) -> LineTable:
    """List the lines of a response while a pulse of the load's rhythm is on.

    They are the lines in the steady state under the same load without its rhythm, as in a pulse
    that lasts. Each amplitude is the transform of the response times the line of the steady load
    over the transform of the load. This is exact if the focus rests and the body settles within the
    response. Without a rhythm the result is `line_table`.
    """
    steady = during_pulses(pressure)
    if steady == pressure:
        return line_table(pressure, response, candidates=candidates)
    known, lost = resolved_lines(steady, response, candidates=candidates)
    tacton, f = pressure.tacton, np.array([*known.values()])
    on_path = tacton.trajectory.at_phase(np.mod([*tacton.foci, *np.arange(8) / 8], 1.0))
    pulsed, lasting = (point_kernel(x, on_path, response.times) for x in (pressure, steady))
    line = np.linalg.norm(phasors(lasting, f), axis=1)
    window = cosines("hann", len(response.times))
    wave = 2 / window.sum() * window * np.exp(-2j * np.pi * f[:, None] * response.times)
    transform = np.linalg.norm(wave @ pulsed.values, axis=1)
    factor = np.where(line > FAINTEST * line.max(initial=0.0), line / transform, 0.0)
    amplitudes = factor[:, None] * np.abs(wave @ response.values)
    return LineTable(
        frequencies=known, amplitudes=dict(zip(known, amplitudes, strict=True)), unresolved=lost,
        unnamed=(),
    )  # fmt: skip


def resolved_lines(
    pressure: MovingPressure,
    response: Response,
    *,
    candidates: Iterable[str] = (),
    highest: float = np.inf,
) -> tuple[dict[str, float], dict[str, float]]:
    """Return frequencies in Hz by name: of the resolved lines of a load, and of the unresolved.

    They are the lines above -60 dB and the `candidates`, below `highest` in Hz. The duration of the
    response decides which lines are resolved.
    """
    response = replace(response, load=pressure)
    highest = min(highest, 0.5 / step(response.times))
    named = line_names(pressure, candidates=candidates)
    named = named.some(named.frequencies < highest)
    f = named.frequencies
    known = are_resolved(response, f, strengths=_strengths_above_zero(named))
    lost = ~known & ~_near(f, f[known], resolution(response))
    return _name_lines(named, known), _name_lines(named, lost)


def _name_lines(named: LineNames, chosen: Bools) -> dict[str, float]:
    return {named.names[k]: float(named.frequencies[k]) for k in np.flatnonzero(chosen)}


def _strengths_above_zero(named: LineNames) -> Floats:
    """Strengths (f,) in Pa, above 0 even for candidates."""
    return np.maximum(named.strengths, FITTED * named.strengths.max(initial=1e-300))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fit:
    """Fit of lines (f,): masks `resolved` and `fitted` (including the strongest of unresolved
    lines), `amplitudes` (f, p), and the `rest` (t, p) of the response.
    """

    resolved: Bools
    fitted: Bools
    amplitudes: Floats
    rest: Floats


def _fit(named: LineNames, response: Response) -> _Fit:
    f, least = named.frequencies, resolution(response)
    strengths = _strengths_above_zero(named)
    fitted = np.zeros(len(f), bool)
    for k in np.argsort(-strengths, kind="stable"):
        fitted[k] = f[k] >= least and not _near(f[k], f[fitted], least)
    amplitudes = np.zeros((len(f), response.values.shape[1]))
    complex_amplitudes, rest = fit_lines(response, f[fitted])
    amplitudes[fitted] = np.abs(complex_amplitudes)
    resolved = fitted & is_separate(f, strengths, least)
    left = np.where(_near(f, f[fitted], ALIKE * least), 0.0, strengths)
    resolved &= ~is_masked(response, f, strengths, left, fitted)
    return _Fit(resolved=resolved, fitted=fitted, amplitudes=amplitudes, rest=rest)


def _peaks(
    pressure: MovingPressure, response: Response, named: LineNames, fit: _Fit
) -> list[Unnamed]:
    """Peaks in the spectrum of the whole response minus the fitted lines, away from these lines."""
    least, fitted = resolution(response), named.frequencies[fit.fitted]
    dt, begun = step(response.times), round(SETTLE * len(fit.rest))
    amplitude = windowed_amplitude(fit.rest, WINDOW)
    round_off = ROUND_OFF * float(np.abs(response.values).max(initial=0.0))
    loudest = _loudest(np.vstack([amplitude[LOBE:], fit.amplitudes]))
    level = amplitude / np.maximum(loudest, round_off / LEAST_PEAK)
    of_any = level.max(axis=1)[: len(fit.rest) // 2 + 1]
    inner = of_any[1:-1]
    tops = 1 + np.flatnonzero((inner > LEAST_PEAK) & (inner >= of_any[:-2]) & (inner > of_any[2:]))
    chosen: list[int] = []
    for k in tops[np.argsort(-of_any[tops], kind="stable")].tolist():
        if k >= LOBE and all(abs(k - other) > LOBE for other in chosen):
            chosen.append(k)
    known = chosen and type(pressure) is MovingPressure  # the lines of a subclass are unknown
    driven = load_lines(pressure).frequencies if known else np.empty(0)
    peaks = []
    for k in chosen[:MOST_PEAKS]:
        bins = k + _offset(amplitude[k - 1 : k + 2, int(np.argmax(level[k]))])
        turns = bins / len(fit.rest)
        if _near(turns / dt, fitted, least):  # the start of a line
            continue
        free = response.record.of_body and _decays(fit.rest[begun:], turns)
        kind = OF_LOAD if _near(turns / dt, driven, least) else FREE if free else UNNAMED
        peaks.append(Unnamed(frequency=turns / dt, amplitudes=amplitude[k], kind=kind))
    return peaks


def _loudest(amplitudes: Floats) -> Floats:
    """Strongest (p,) of amplitudes (f, p), at least `QUIET` of the strongest of all."""
    loudest = amplitudes.max(axis=0, initial=0.0)
    return np.maximum(loudest, max(QUIET * loudest.max(initial=0.0), 1e-300))


def _offset(three: Floats) -> float:
    """Top of a parabola through the logarithms of three amplitudes, in bins."""
    left, centre, right = np.log(np.maximum(three, 1e-300))
    bend = left - 2 * centre + right
    return float(np.clip((left - right) / bend / 2, -0.5, 0.5)) if bend < 0 else 0.0


def _decays(x: Floats, turns: float) -> bool:
    """Whether signals (t, p) are weaker in their second half, at a rate in turns per sample."""
    half = len(x) // 2
    wave = cosines("hann", half) * np.exp(-2j * np.pi * turns * np.arange(half))
    first, second = (np.linalg.norm(wave @ part) for part in (x[:half], x[-half:]))
    return bool(second < DECAYED * first)


def _with_weak(
    named: LineNames, weak: LineNames, steady: Sequence[float], least: float
) -> LineNames:
    """Add to the named lines the strongest weak one near each frequency (k,) in Hz."""
    more = []
    for f in steady:
        near = np.flatnonzero(np.abs(weak.frequencies - f) < least)
        more += [near[np.argmax(weak.strengths[near])]] if len(near) else []
    more = [k for k in dict.fromkeys(more) if weak.names[k] not in named.names]
    return named.with_more(weak.some(np.array(more, int)))


def _apart(other_lines: Mapping[str, float], named: LineNames, same: float) -> LineNames:
    """Other lines by name that coincide with no line of the load, as strong as its strongest."""
    f = np.array(list(other_lines.values()), np.float64)
    strongest = named.strengths.max(initial=0.0) or 1.0
    strengths = np.full(len(f), strongest)
    lines = LineNames(names=tuple(other_lines), frequencies=f, strengths=strengths)
    return lines.some(~_near(f, named.frequencies, same))


def _table(named: LineNames, fit: _Fit, peaks: list[Unnamed], response: Response) -> LineTable:
    f, loudest = named.frequencies, _loudest(fit.amplitudes)
    least = resolution(response)
    relative = (fit.amplitudes / loudest).max(axis=1, initial=0.0)
    wanted = (named.strengths >= WEAKEST * named.strengths.max(initial=0.0)) | (relative > WEAKEST)
    wanted |= named.strengths == 0
    listed = fit.resolved & wanted
    lost = wanted & ~fit.resolved & ~_near(f, f[fit.resolved], least)
    bin_width = 1 / (step(response.times) * len(response.times))
    mixed = fit.fitted & ~fit.resolved & (named.strengths > 0) & (relative > LEAST_PEAK)
    mixed &= f >= LOBE * bin_width
    alone = [x for x in peaks if not _near(x.frequency, f[lost], LOBE * bin_width)]
    unnamed = [*_unresolved(response, f[mixed]), *alone]
    unnamed.sort(key=lambda peak: -float((peak.amplitudes / loudest).max()))
    return LineTable(
        frequencies=_name_lines(named, listed),
        amplitudes={named.names[k]: fit.amplitudes[k] for k in np.flatnonzero(listed)},
        unresolved=_name_lines(named, lost),
        unnamed=tuple(unnamed[:MOST_PEAKS]),
    )


def _unresolved(response: Response, frequencies: Floats) -> list[Unnamed]:
    """Unresolved lines, as they appear together in the spectrum of the response."""
    if not len(frequencies):
        return []
    amplitude = windowed_amplitude(response.values - response.values.mean(axis=0), WINDOW)
    bins = frequencies * step(response.times) * len(response.times)
    return [
        Unnamed(frequency=float(f), kind=UNRESOLVED,
                amplitudes=amplitude[max(int(at) - 1, 0) : int(at) + 3].max(axis=0))
        for f, at in zip(frequencies, bins, strict=True)
    ]  # fmt: skip


def _near(f: ArrayLike, others: Floats, least: float) -> Bools:
    """Whether each of the frequencies (...) is within a resolution of any of the others (k,)."""
    return np.asarray((np.abs(np.subtract.outer(f, others)) < least).any(axis=-1))
