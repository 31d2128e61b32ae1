"""Least-squares fit of sinusoids to waveforms: their amplitudes, frequencies and standard errors.

All waveforms have the same frequencies, amplitudes of their own, and each a linear trend.
Frequencies follow by Gauss-Newton steps with the amplitudes projected out (variable projection,
Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973); standard errors are of the inverse of the same
Fisher matrix, the Cramer-Rao bound. Of one sinusoid of amplitude A over a time T in noise of the
one-sided density S it is 3 S / (pi^2 A^2 T^3) (Rife and Boorstyn, IEEE Trans. Inf. Theory 20, 1974,
eq. 17).
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from simple_model.typing import Floats

STEPS = 12  # of Gauss and Newton, at most
SMALL = 0.01  # of a standard error, or of the farthest step: a step that is the last
FARTHEST = 0.5  # 1/T, of a step
BLOCKS = 64  # that a waveform is averaged in, turned back by a line's frequency
MOST = 32  # waveforms that a first frequency is read from
CHUNK = 2**15  # samples


@dataclass(frozen=True, kw_only=True, eq=False)
class LineFit:
    """Frequencies (l,) with standard errors (l,) in Hz, complex amplitudes (l, q) of Re a exp(2 pi
    i f t), and the `rest` (t, q) without the lines and a linear trend.
    """

    frequencies: Floats
    errors: Floats
    amplitudes: np.ndarray
    rest: Floats


def coefficients(x: Floats, frequencies: Floats, rate: float) -> Floats:
    """Coefficients (2 l + 2, q) of `_basis` in waveforms (t, q), by least squares."""
    size = 2 * len(frequencies) + 2
    normal, right = np.zeros((size, size)), np.zeros((size, x.shape[1]))
    for part in _parts(len(x)):
        basis = _basis(part, len(x), frequencies, rate)
        normal += basis.T @ basis
        right += basis.T @ x[part]
    return np.asarray(np.linalg.lstsq(normal, right, rcond=1e-13)[0], np.float64)


def without(x: Floats, frequencies: Floats, found: Floats, rate: float) -> Floats:
    """Waveforms (t, q) less lines and trend of such coefficients."""
    left = x.copy()
    for part in _parts(len(x)):
        left[part] -= _basis(part, len(x), frequencies, rate) @ found
    return left


def _complex(found: Floats) -> np.ndarray:
    """Complex amplitudes (l, q) of coefficients."""
    cosine, sine = np.split(found[:-2], 2)
    return np.asarray(cosine - 1j * sine)


def fitted(x: Floats, start: Floats, rate: float, noise: Floats, fresh: int = 0) -> LineFit:
    """Lines fitted together.

    Parameters
    ----------
    x : (t, q) waveforms
    start : (l,) Hz, no two nearer than 1/T
    rate : Hz
    noise : (l, q) one-sided densities at the lines
    fresh : how many lines, the last, are known to a bin only

    Returns
    -------
    LineFit
    """
    found, known = start.copy(), coefficients(x, start, rate)
    rest, own = without(x, found, known, rate), _complex(known)
    for k in range(len(found) - fresh, len(found)):
        found[k] = _nearest_peak(rest, own[k], found[k], rate, 1 / noise[k])
    for _ in range(STEPS):
        step, errors, _ = _step(x, found, rate, noise)
        limit = FARTHEST * rate / len(x)
        found = np.clip(found + np.clip(step, -limit, limit), limit, rate / 2 - limit)
        if (np.abs(step) < SMALL * np.minimum(errors, limit)).all():
            break
    _, errors, last = _step(x, found, rate, noise)
    rest = without(x, found, last, rate)
    return LineFit(frequencies=found, errors=errors, amplitudes=_complex(last), rest=rest)


def _step(
    x: Floats, frequencies: Floats, rate: float, noise: Floats
) -> tuple[Floats, Floats, Floats]:
    """A Gauss-Newton step of the frequencies, their standard errors, and the coefficients."""
    count = len(frequencies)
    half, size = 2 * count + 2, 4 * count + 2
    gram, right = np.zeros((size, size)), np.zeros((size, x.shape[1]))
    middle = len(x) / 2
    for part in _parts(len(x)):
        basis = _basis(part, len(x), frequencies, rate)
        time = (np.arange(part.start, part.stop) - middle)[:, None] / rate
        both = np.hstack([basis, time * basis[:, :-2]])
        gram += both.T @ both
        right += both.T @ x[part]
    lower = np.linalg.lstsq(gram[:half, :half], gram[:half, half:], rcond=1e-13)[0]
    linear = np.asarray(
        np.linalg.lstsq(gram[:half, :half], right[:half], rcond=1e-13)[0], np.float64
    )
    schur = gram[half:, half:] - gram[half:, :half] @ lower
    slope = right[half:] - gram[half:, :half] @ linear
    cosine, sine = np.split(linear[:-2], 2)
    # d/df of c cos + s sin is 2 pi t (s cos - c sin), weighted by the noise of a sample, S rate/2.
    weight = 2 * np.pi / np.sqrt(noise * rate / 2)
    change = np.stack([weight * sine, -weight * cosine])  # (2, l, q)
    blocks = schur.reshape(2, count, 2, count)
    fisher = np.einsum("alq,albm,bmq->lm", change, blocks, change, optimize=True)
    gradient = np.einsum(
        "alq,alq->l", change, slope.reshape(2, count, -1) / np.sqrt(noise * rate / 2)
    )
    inverse = np.linalg.pinv(fisher, hermitian=True)
    return inverse @ gradient, np.sqrt(np.maximum(np.diag(inverse), 0.0)), linear


def _parts(count: int) -> list[slice]:
    return [slice(k, min(k + CHUNK, count)) for k in range(0, count, CHUNK)]


def _basis(part: slice, count: int, frequencies: Floats, rate: float) -> Floats:
    """Columns (t, 2 l + 2): cosines, sines, a constant and a trend from -1 to 1."""
    k = np.arange(part.start, part.stop)[:, None]
    angle = 2 * np.pi * k / rate * frequencies
    trend = 2 * k / count - 1
    return np.hstack([np.cos(angle), np.sin(angle), np.ones_like(trend), trend])


def _nearest_peak(
    rest: Floats, own: np.ndarray, frequency: float, rate: float, weight: Floats
) -> float:
    """Frequency within 1/T where the weighted periodogram of a line and the rest is largest."""
    count = len(rest)
    best = np.argsort(-weight * np.abs(own) ** 2)[:MOST]  # waveforms, in which it is clearest
    k = np.arange(count)
    turned = rest[:, best] * np.exp(-2j * np.pi * frequency / rate * k)[:, None]
    edges = np.linspace(0, count, min(BLOCKS, count) + 1).astype(int)
    sizes, edges = np.diff(edges), edges[:-1]
    sums = np.add.reduceat(turned, edges, axis=0) + sizes[:, None] * own[best] / 2
    times = np.add.reduceat(k / rate, edges) / sizes

    def power(shift: float) -> float:
        return float(weight[best] @ np.abs(np.exp(-2j * np.pi * shift * times) @ sums) ** 2)

    grid = np.linspace(-1, 1, 33) * rate / count
    near = grid[int(np.argmax([power(shift) for shift in grid]))]
    step = grid[1] - grid[0]
    found = minimize_scalar(
        lambda shift: -power(shift), bounds=(near - step, near + step), method="bounded",
        options={"xatol": 1e-3 * step},
    )  # fmt: skip
    return float(np.clip(frequency + found.x, rate / count, rate / 2 - rate / count))
