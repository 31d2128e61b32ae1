"""Comparison of two responses: waveforms, lines, phase delay and spread."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from simple_model import MovingPressure, Response, phasors
from simple_model.load.line_names import line_frequency
from simple_model.load.path_cells import path_cells
from simple_model.load.sampling import step
from simple_model.load.spectrum import load_lines
from simple_model.response import SETTLE, is_separate, resolution
from skinwave.results.run import ASSESSED
from skinwave.system.drawing import call_report
from skinwave.typing import Complex, Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Agreement:
    """Comparison of a candidate response with a reference.

    Parameters
    ----------
    relative_l2 : (p,) float, relative L2 misfit of the waveform at each probe
    scale : float, factor applied to the candidate before comparison: 1 if both have the same
        quantity, otherwise the best fit over all probes
    shape_misfit : (p,) float, relative L2 misfit of the steady waveform about its mean, after the
        best gain and delay at each probe
    delay : (p,) float, s, this delay, positive if the candidate is later; within half a period of
        the reference's strongest frequency
    line_ratios : (f, p) float, scaled candidate over reference at `frequencies`
    phase_delay : (f, p) float, s, positive if the line is later in the candidate; at the probe
        where the line is strongest between -1/4 and 3/4 of a period, unwrapped outwards from there,
        and nan where either line is 20 dB below its largest
    rms_reference, rms_candidate : (p,) float, `steady_rms`, in the unit of each response
    spread_reference, spread_candidate : {-6: float, -20: float}, m, distance from the strongest
        probe to the outermost one whose steady RMS motion is within 6 or 20 dB
    frequencies : (f,) float, Hz
    probes : (p, 2) float, m

    Examples
    --------
    >>> import numpy as np
    >>> from simple_model import Response
    >>> t = np.arange(1000) / 1e4
    >>> wave, later = (np.sin(2 * np.pi * 100 * (t - d))[:, None] for d in (0, 1e-3))
    >>> a, b = (Response(model="mine", times=t, probes=np.zeros((1, 2)), values=1e-6 * each)
    ...         for each in (wave, later))
    >>> compare(a, b, frequencies=(100.0,))
    <Agreement: relative L2 misfit 62 %; misfit of the shape 1.3 %; scale 1; 1 probe, 1 line>
    """

    relative_l2: Floats
    scale: float
    shape_misfit: Floats
    delay: Floats
    line_ratios: Floats
    phase_delay: Floats
    rms_reference: Floats
    rms_candidate: Floats
    spread_reference: dict[int, float]
    spread_candidate: dict[int, float]
    frequencies: Floats
    probes: Floats

    def __repr__(self) -> str:
        return call_report("notebook", "agreement_line", self)

    def _repr_html_(self) -> str:
        return call_report("notebook", "agreement_page", self)


def compare(
    reference: Response, candidate: Response, frequencies: tuple[float, ...] = ()
) -> Agreement:
    """Compare two responses at the same probes and times.

    Parameters
    ----------
    reference, candidate : Response
    frequencies : tuple of float, Hz, lines whose amplitudes and phases are compared

    Returns
    -------
    Agreement

    Raises
    ------
    ValueError
        If probes or times differ.

    Examples
    --------
    >>> import skinwave
    >>> scene = skinwave.loads(
    ...     "[tacton]\\nam_frequency_hz = 140\\nduration_s = 0.1\\n[body]\\nkind = 'none'"
    ... )
    >>> published, kernel = (
    ...     skinwave.simulate(scene, name) for name in ("point-kernel-published", "point-kernel")
    ... )
    >>> skinwave.compare(published, kernel).relative_l2.round(2)
    array([0.74, 0.74, 1.68, 0.97, 1.  ])
    """
    if reference.probes.shape != candidate.probes.shape or not np.allclose(
        reference.probes, candidate.probes
    ):
        raise ValueError("the responses have different probes. Compute both at the same probes")
    if reference.times.shape != candidate.times.shape:
        raise ValueError("the responses have different times. Compute both at the same times")
    x, y = reference.values, candidate.values
    fits = reference.quantity == candidate.quantity
    scale = 1.0 if fits else float((x * y).sum() / max((y * y).sum(), np.finfo(float).tiny))
    norm = np.linalg.norm(x, axis=0)
    delay, shape_misfit = _align(reference, candidate)
    a, b = (line_phasors(response, frequencies) for response in (reference, candidate))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = abs(scale) * np.abs(b) / np.abs(a)
    own = [steady_rms(response) for response in (reference, candidate)]
    return Agreement(
        relative_l2=np.linalg.norm(scale * y - x, axis=0) / np.where(norm > 0, norm, 1),
        scale=scale, shape_misfit=shape_misfit, delay=delay, line_ratios=ratios,
        phase_delay=phase_delays(a, b, np.array(frequencies), reference.probes),
        rms_reference=own[0], rms_candidate=own[1],
        spread_reference=spread(reference.probes, own[0]),
        spread_candidate=spread(reference.probes, own[1]),
        frequencies=np.array(frequencies, np.float64), probes=reference.probes,
    )  # fmt: skip


def phase_delays(
    reference: np.ndarray, candidate: np.ndarray, frequencies: Floats, probes: Floats
) -> Floats:
    """Return the delays (f, p) in s as `Agreement.phase_delay` defines them, from complex
    amplitudes (f, p) at frequencies (f,) in Hz and probes (p, 2) in m.
    """
    delays = np.full(reference.shape, np.nan)
    for k, (a, b, f) in enumerate(zip(reference, candidate, frequencies, strict=True)):
        strong = _is_strong(a) & _is_strong(b)
        if not (f > 0 and strong.any()):
            continue
        start = int(np.argmax(np.where(strong, np.abs(a), 0)))
        outwards = np.argsort(np.linalg.norm(probes - probes[start], axis=1), kind="stable")
        outwards = outwards[strong[outwards]]
        turns = np.unwrap(-np.angle(b[outwards] / a[outwards]) / (2 * np.pi), period=1.0)
        delays[k, outwards] = (turns - np.floor(turns[0] + 0.25)) / f
    return delays


def line_phasors(response: Response, frequencies: tuple[float, ...]) -> np.ndarray:
    """Return the complex amplitudes (f, p) of lines; 0 for round-off."""
    if not frequencies:
        return np.zeros((0, len(response.probes)), np.complex128)
    amplitudes = phasors(response, frequencies)
    return np.where(np.abs(amplitudes) > 1e-6 * moving_rms(response).max(), amplitudes, 0)


def _is_strong(line: np.ndarray) -> np.ndarray:
    size = np.abs(line)  # 20 dB below the largest a phase means little
    return (size > 0) & (size >= 0.1 * size.max(initial=0.0))


def _align(reference: Response, candidate: Response) -> tuple[Floats, Floats]:
    """Return the best delay (p,) in s at each probe, and the misfit (p,) after it.

    A periodic signal correlates with itself after every period. The delay is therefore searched
    within half a period of the strongest frequency.
    """
    x, y = (_moving(response) for response in (reference, candidate))
    n, dt = len(x), step(reference.times)
    size = next_fast_len(2 * n, real=True)
    X, Y = rfft(x, size, axis=0), rfft(y, size, axis=0)
    strongest = int(np.argmax((np.abs(X[1:]) ** 2).sum(axis=1))) + 1
    reach = min(n // 2, max(1, size // (2 * strongest)))
    lags = np.arange(-reach, reach + 1)
    common = np.sqrt(_overlapping(x, lags) * _overlapping(y, -lags))
    correlation = irfft(X.conj() * Y, size, axis=0)[lags] / np.where(common > 0, common, 1)
    best, alike = zip(*map(_vertex, correlation.T), strict=True)
    return (np.array(best) - reach) * dt, np.sqrt(1 - np.clip(alike, 0, 1) ** 2)


def _overlapping(x: Floats, lags: np.ndarray) -> Floats:
    """Return the sum of squares (l, p) of x (t, p) where it overlaps a signal shifted by lags."""
    summed = np.vstack([0 * x[:1], np.cumsum(x**2, axis=0)])
    shift = np.abs(lags)
    early, late = summed[len(x) - shift], summed[-1] - summed[shift]
    return np.where((lags >= 0)[:, None], early, late)


def _vertex(y: Floats) -> tuple[float, float]:
    """Return the vertex, in samples, and height of the parabola through the largest samples."""
    k = int(np.clip(np.argmax(y), 1, len(y) - 2))
    slope, bend = (y[k + 1] - y[k - 1]) / 2, y[k + 1] - 2 * y[k] + y[k - 1]
    ahead = float(np.clip(-slope / bend, -1, 1)) if bend < 0 else 0.0
    return k + ahead, float(y[k] + slope * ahead + bend * ahead**2 / 2)


def _moving(response: Response) -> Floats:
    """Return the response (t, p) about its mean, without the transient at its start."""
    steady = response.values[int(SETTLE * len(response.times)) :]
    return np.asarray(steady - steady.mean(axis=0))


def spread(probes: Floats, level: Floats) -> dict[int, float]:
    """Return the distance in m from the strongest of probes (p, 2) to the outermost within 6 and
    20 dB of its `level` (p,), such as `steady_rms`.
    """
    strongest = int(np.argmax(level))
    distance = np.linalg.norm(probes - probes[strongest], axis=1)
    within = {drop: level >= level[strongest] * 10 ** (drop / 20) for drop in (-6, -20)}
    return {drop: float(distance[mask].max()) for drop, mask in within.items()}


def moving_rms(response: Response) -> Floats:
    """Return the RMS (p,) about the mean, without the transient, in the unit of the response."""
    return np.asarray(_moving(response).std(axis=0))


def steady_rms(response: Response, other_lines: Sequence[float] = ()) -> Floats:
    """Return the RMS (p,) of `steady_lines` of the load and of `other_lines` in Hz; the
    `moving_rms` if the load is unknown or has none within the response.
    """
    found = response.load and steady_lines(response, response.load, other_lines)
    if not found or not len(found[0]):
        return moving_rms(response)
    return np.asarray(np.linalg.norm(found[1], axis=0) / np.sqrt(2))


def steady_lines(
    response: Response,
    pressure: MovingPressure,
    other_lines: Sequence[float] = (),
    *,
    weakest: float = 1e-3,
    strong: float = 1e-2,
) -> tuple[Floats, Complex] | None:
    """Return frequencies (f,) in Hz and phasors (f, p) of the steady vibration under a pressure,
    without the mean and without free vibration after the start.

    They are lines of the load above a `weakest` fraction of its strongest line, lines that a
    nonlinear body may add, and `other_lines` in Hz. Of lines too close to each other the strongest
    is fitted. Returns None if the load has a rhythm or a signal, or if the response is too short to
    resolve its `strong` lines: then there is no steady vibration within the response.
    """
    if path_cells(pressure).of_tacton:
        return None
    load = load_lines(pressure, weakest)
    f, which = np.unique(np.round(load.frequencies, 9), return_inverse=True)
    strengths = np.bincount(which, load.strengths) * (f > 0)
    main, least = strengths > strong * strengths.max(), resolution(response, settle=0.0)
    if not is_separate(f[main], strengths[main], least).all():
        return None
    added = [line_frequency(pressure.tacton, name) or 0.0 for name in ASSESSED]
    chosen: list[float] = []
    for each in (*other_lines, *f[np.argsort(-strengths, kind="stable")], *added):
        is_apart = all(abs(each - other) >= least for other in chosen)
        if is_apart and least <= each < 0.5 / step(response.times):
            chosen.append(float(each))
    # The window suppresses the start, where free vibration is strongest.
    return np.array(chosen), phasors(response, chosen, settle=0.0)
