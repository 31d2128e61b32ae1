"""How far two answers agree: waveform, lines, delay and spread."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import correlate

from meshes.tetmesh import Floats
from simple_model import Response, lines


@dataclass(frozen=True, kw_only=True, eq=False)
class Agreement:
    """A candidate against a reference.

    Parameters
    ----------
    relative_l2 : (p,) float, misfit of the waveform at each probe, relative to the reference
    scale : float, what the candidate was multiplied by first: 1 if both have the same unit,
        else the factor that fits best over all probes
    line_ratios : (f, p) float, candidate over reference at the frequencies asked for, scaled
    lag : (p,) float, s, by which the candidate comes later
    spread_reference, spread_candidate : {-6: metre, -20: metre}, distance of the outermost
        probe whose RMS motion is within so many dB of the strongest probe's, from that probe
    """

    relative_l2: Floats
    scale: float
    line_ratios: Floats
    lag: Floats
    spread_reference: dict[int, float]
    spread_candidate: dict[int, float]


def compare(
    reference: Response, candidate: Response, frequencies: tuple[float, ...] = ()
) -> Agreement:
    """Compare two responses at the same probes and times.

    Parameters
    ----------
    frequencies : Hz, lines whose amplitudes are compared

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
    x, y = reference.displacement, candidate.displacement
    fits = reference.unit == candidate.unit
    scale = 1.0 if fits else float((x * y).sum() / max((y * y).sum(), np.finfo(float).tiny))
    norm = np.linalg.norm(x, axis=0)
    ratios = np.zeros((0, x.shape[1]))
    if frequencies:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = abs(scale) * lines(candidate, frequencies) / lines(reference, frequencies)
    return Agreement(
        relative_l2=np.linalg.norm(scale * y - x, axis=0) / np.where(norm > 0, norm, 1),
        scale=scale,
        line_ratios=ratios,
        lag=np.array([_lag(a, b) for a, b in zip(x.T, y.T, strict=True)]) * reference.times[1],
        spread_reference=spread(reference),
        spread_candidate=spread(candidate),
    )


def spread(response: Response) -> dict[int, float]:
    """Distance in metre from the strongest probe to the outermost within 6 and within 20 dB."""
    level = moving_rms(response)
    strongest = int(np.argmax(level))
    distance = np.linalg.norm(response.probes - response.probes[strongest], axis=1)
    within = {drop: level >= level[strongest] * 10 ** (drop / 20) for drop in (-6, -20)}
    return {drop: float(distance[mask].max()) for drop, mask in within.items()}


def moving_rms(response: Response, settle: float = 0.25) -> Floats:
    """RMS (p,) about the mean after the first part of the response, in its unit."""
    kept = response.displacement[int(settle * len(response.times)) :]
    return (kept - kept.mean(axis=0)).std(axis=0)


def _lag(x: Floats, y: Floats) -> int:
    """Samples by which y comes after x, where their correlation is greatest."""
    correlation = correlate(y - y.mean(), x - x.mean(), method="fft")
    return int(np.argmax(correlation)) - (len(x) - 1)
