"""Repetitions of a measurement brought into step."""

import numpy as np
from scipy.special import fdtrc

from meshes.tetmesh import Floats
from skinwave.measure.delays import best_delay

JITTER = 1e-3  # significance from which repetitions are taken to be out of step


def in_step(each: np.ndarray, frequencies: Floats) -> tuple[np.ndarray, Floats]:
    """Repetitions (r, f, p) shifted onto their mean where they are out of step, and by how much.

    Delays are those of least squares over all lines and places, within a period of the lowest line;
    they are taken where an F test of what they leave against what there was is significant for as
    many independent delays as there were to choose from.

    Parameters
    ----------
    each : (r, f, p) complex, at least two repetitions
    frequencies : (f,) float, Hz

    Returns
    -------
    (r, f, p) complex, and the shifts (r,) in s, of mean zero
    """
    r = len(each)
    spread = _squares(each).mean(axis=1, keepdims=True)  # of lines, over places
    weights = 1 / np.where(spread > 0, spread, 1)
    reference, shifts = each[0], np.zeros(r)
    for _ in range(3):
        products = (weights * reference.conj() * each).sum(axis=2)
        shifts = np.array([best_delay(frequencies, s, _period(frequencies)) for s in products])
        shifted = each * _turned(frequencies, shifts)
        reference = shifted.mean(axis=0)
        left = _squares(shifted).mean(axis=1, keepdims=True)
        weights = 1 / np.where(left > 0, left, 1)
    shifts = shifts - shifts.mean()
    shifted = each * _turned(frequencies, shifts)
    before, after = ((weights * _squares(x)).sum() for x in (each, shifted))
    freedom = 2 * each[0].size * (r - 1) - (r - 1)
    if not after > 0 or not frequencies.size:
        return each, np.zeros(r)
    gained = (before - after) / (r - 1) / (after / max(freedom, 1))
    chance = fdtrc(r - 1, max(freedom, 1), max(gained, 0.0))
    choices = 2 * _period(frequencies) * float(frequencies.max())
    power = float((weights * np.abs(shifted) ** 2).sum())
    in_common = 1 - float(after) / power if power > 0 else 0.0
    # Of noise alone delays can be found that bring it into step in part.
    if chance * choices ** (r - 1) < JITTER and in_common > (1 + 1 / r) / 2:
        return shifted, shifts
    return each, np.zeros(r)


def _period(frequencies: Floats) -> float:
    """Period in s of the lowest line, within which repetitions are sought."""
    return 1 / float(frequencies.min()) if len(frequencies) else 0.0


def _turned(frequencies: Floats, shifts: Floats) -> np.ndarray:
    return np.exp(2j * np.pi * np.multiply.outer(shifts, frequencies))[:, :, None]


def _squares(each: np.ndarray) -> Floats:
    """Sum (f, p) of squared deviations from the mean."""
    return np.asarray((np.abs(each - each.mean(axis=0)) ** 2).sum(axis=0))
