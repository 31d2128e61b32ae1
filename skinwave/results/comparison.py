"""Comparison of two responses: waveforms, lines, phase delay and spread."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from simple_model import Response, phasors
from simple_model.load.sampling import step
from simple_model.response import SETTLE
from skinwave.system.drawn import drawn
from skinwave.typing import Floats

ROUND_OFF = 1e-6  # of the largest RMS motion: weaker lines are round-off
AUDIBLE = -20.0  # dB re a line's largest probe: below it a phase says nothing


@dataclass(frozen=True, kw_only=True, eq=False)
class Agreement:
    """A candidate against a reference.

    Parameters
    ----------
    relative_l2 : (p,) float, misfit of the waveform at each probe, relative to the reference
    scale : float, what the candidate was multiplied by first: 1 if both are of one quantity,
        else the factor that fits best over all probes
    shape_misfit : (p,) float, misfit of the steady waveform about its mean, relative to the
        reference, after the gain and the delay that fit best at each probe
    delay : (p,) float, s, by which the candidate comes later there, within half a period of the
        reference's strongest frequency either way
    line_ratios : (f, p) float, candidate over reference at the frequencies asked for, scaled
    phase_delay : (f, p) float, s, by which each of these lines comes later in the candidate: a
        quarter of a period before to three quarters after at the probe where it is strongest, and
        unwrapped outwards from there; not a number where either is 20 dB below its largest
    spread_reference, spread_candidate : {-6: metre, -20: metre}, distance of the outermost
        probe whose RMS motion is within so many dB of the strongest probe's, from that probe
    frequencies : (f,) float, Hz, of the lines; probes : (p, 2) float, metre
    """

    relative_l2: Floats
    scale: float
    shape_misfit: Floats
    delay: Floats
    line_ratios: Floats
    phase_delay: Floats
    spread_reference: dict[int, float]
    spread_candidate: dict[int, float]
    frequencies: Floats
    probes: Floats

    def __repr__(self) -> str:
        return drawn("notebook", "agreement_line", self)

    def _repr_html_(self) -> str:
        return drawn("notebook", "agreement_page", self)


def compare(
    reference: Response, candidate: Response, frequencies: tuple[float, ...] = ()
) -> Agreement:
    """Compare two responses at the same probes and times.

    Parameters
    ----------
    reference, candidate : Response
    frequencies : Hz, lines whose amplitudes and phases are compared

    Returns
    -------
    Agreement, of the candidate with the reference

    Raises
    ------
    ValueError
        If probes or times differ.
    """
    if reference.probes.shape != candidate.probes.shape or not np.allclose(
        reference.probes, candidate.probes
    ):
        raise ValueError("the responses have different probes; compare them at the same ones")
    if reference.times.shape != candidate.times.shape:
        raise ValueError("the responses have different times; compare them at the same ones")
    x, y = reference.values, candidate.values
    fits = reference.quantity == candidate.quantity
    scale = 1.0 if fits else float((x * y).sum() / max((y * y).sum(), np.finfo(float).tiny))
    norm = np.linalg.norm(x, axis=0)
    delay, shape_misfit = _aligned(reference, candidate)
    a, b = (heard_phasors(response, frequencies) for response in (reference, candidate))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = abs(scale) * np.abs(b) / np.abs(a)
    return Agreement(
        relative_l2=np.linalg.norm(scale * y - x, axis=0) / np.where(norm > 0, norm, 1),
        scale=scale, shape_misfit=shape_misfit, delay=delay, line_ratios=ratios,
        phase_delay=phase_delays(a, b, np.array(frequencies), reference.probes),
        spread_reference=spread(reference), spread_candidate=spread(candidate),
        frequencies=np.array(frequencies, np.float64), probes=reference.probes,
    )  # fmt: skip


def phase_delays(
    reference: np.ndarray, candidate: np.ndarray, frequencies: Floats, probes: Floats
) -> Floats:
    """Delays (f, p) in s of lines, as of `Agreement.phase_delay`, from their complex amplitudes
    (f, p), each of its own unit, at frequencies (f,) in Hz and probes (p, 2) in metre.
    """
    found = np.full(reference.shape, np.nan)
    for k, (a, b, f) in enumerate(zip(reference, candidate, frequencies, strict=True)):
        heard = _heard(a) & _heard(b)
        if not (f > 0 and heard.any()):
            continue
        start = int(np.argmax(np.where(heard, np.abs(a), 0)))
        outwards = np.argsort(np.linalg.norm(probes - probes[start], axis=1), kind="stable")
        outwards = outwards[heard[outwards]]
        turns = np.unwrap(-np.angle(b[outwards] / a[outwards]) / (2 * np.pi), period=1.0)
        found[k, outwards] = (turns - np.floor(turns[0] + 0.25)) / f
    return found


def heard_phasors(response: Response, frequencies: tuple[float, ...]) -> np.ndarray:
    """Complex amplitudes (f, p) of lines, 0 of what is round-off in the response."""
    if not frequencies:
        return np.zeros((0, len(response.probes)), np.complex128)
    found = phasors(response, frequencies)
    return np.where(np.abs(found) > ROUND_OFF * moving_rms(response).max(), found, 0)


def _heard(line: np.ndarray) -> np.ndarray:
    size = np.abs(line)
    return (size > 0) & (size >= 10 ** (AUDIBLE / 20) * size.max(initial=0.0))


def _aligned(reference: Response, candidate: Response) -> tuple[Floats, Floats]:
    """Delay (p,) in s that fits a candidate best at each probe, and the misfit (p,) left then.

    A periodic signal correlates with itself at any number of periods; hence the delay is sought
    within half a period of what is strongest.
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
    """Sum of squares (l, p) of the part of x (t, p) that meets a signal shifted by lags (l,)."""
    summed = np.vstack([0 * x[:1], np.cumsum(x**2, axis=0)])
    away = np.abs(lags)
    early, late = summed[len(x) - away], summed[-1] - summed[away]
    return np.where((lags >= 0)[:, None], early, late)


def _vertex(y: Floats) -> tuple[float, float]:
    """Vertex, in samples, and height of the parabola about the largest sample."""
    k = int(np.clip(np.argmax(y), 1, len(y) - 2))
    slope, bend = (y[k + 1] - y[k - 1]) / 2, y[k + 1] - 2 * y[k] + y[k - 1]
    ahead = float(np.clip(-slope / bend, -1, 1)) if bend < 0 else 0.0
    return k + ahead, float(y[k] + slope * ahead + bend * ahead**2 / 2)


def _moving(response: Response) -> Floats:
    """The response (t, p) about its mean, after the transient in its first part."""
    kept = response.values[int(SETTLE * len(response.times)) :]
    return np.asarray(kept - kept.mean(axis=0))


def spread(response: Response) -> dict[int, float]:
    """Distance in metre from the strongest probe to the outermost within 6 and within 20 dB."""
    level = moving_rms(response)
    strongest = int(np.argmax(level))
    distance = np.linalg.norm(response.probes - response.probes[strongest], axis=1)
    within = {drop: level >= level[strongest] * 10 ** (drop / 20) for drop in (-6, -20)}
    return {drop: float(distance[mask].max()) for drop, mask in within.items()}


def moving_rms(response: Response) -> Floats:
    """RMS (p,) about the mean after the first part of the response, in its unit."""
    return np.asarray(_moving(response).std(axis=0))
