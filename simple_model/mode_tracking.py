"""Modes followed along frequency: which root at a frequency continues which one at the last."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from simple_model.material import Complex, Floats

LONGEST_GAP = 3  # frequencies at which a mode is not found: about where it begins to leak
UNLIKE = 0.3  # misfit of two roots that are not of one mode
SHAPE_WEIGHT = 0.1  # of unlike shapes in the misfit
Ints = NDArray[np.int_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """Roots of a body at frequencies (f,), m of each.

    Parameters
    ----------
    squared : (f, m) complex, 1/m2, of the wavenumbers
    slope : (f, m) complex, s/m2, their derivative by the angular frequency
    wavenumbers : (f, m) complex, 1/m, with Im k <= 0
    residues : (f, m) complex, 1/Pa/m, of the surface's compliance in k^2
    energy_speed : (f, m) float, m/s, of the energy of a mode, inf where not known
    shapes : (f, m, d, 2) complex
    """

    squared: Complex
    slope: Complex
    wavenumbers: Complex
    residues: Complex
    energy_speed: Floats
    shapes: Complex


def tracked(found: Found, omega: Floats, most: int) -> Found:
    """Roots with one mode in each column, NaN where it is not found.

    The square of a wavenumber is smooth in frequency, at a cut-off too, and its derivative is
    known: a root continues another if the trapezoidal rule leads from it to the other, and if their
    shapes are alike.

    Parameters
    ----------
    found : Found, in any order at each frequency
    omega : (f,) float, rad/s
    most : how many modes are kept, the least evanescent anywhere

    Returns
    -------
    Found, of at most so many
    """
    from scipy.optimize import linear_sum_assignment  # which takes long to import

    count = len(omega)
    index = np.full((count, 0), -1)
    for f in range(count):
        known = np.flatnonzero(np.isfinite(found.squared[f]))
        seen = np.where(index >= 0, np.arange(count)[:, None], -1).max(axis=0, initial=-1)
        alive = np.flatnonzero(f - seen <= 1 + LONGEST_GAP)
        roots = index[seen[alive], alive]
        costs = _misfit(found, omega, (seen[alive], roots), (f, known))
        pairs = [(alive[i], known[j]) for i, j in zip(*linear_sum_assignment(costs), strict=True)
                 if costs[i, j] < UNLIKE]  # fmt: skip
        for column, root in pairs:
            index[f, column] = root
        new = np.setdiff1d(known, [root for _, root in pairs])
        begun = np.full((count, len(new)), -1)
        begun[f] = new
        index = np.hstack([index, begun])
    imaginary = np.where(index >= 0, _at(np.abs(found.wavenumbers.imag), index), np.inf)
    least = np.argsort(imaginary.min(axis=0), kind="stable")[:most]
    index = index[:, least]
    picked = {}
    for field in fields(found):
        values = _at(getattr(found, field.name), index)
        missing = (index < 0).reshape(index.shape + (1,) * (values.ndim - 2))
        none = complex(np.nan, np.nan) if np.iscomplexobj(values) else np.nan
        picked[field.name] = np.where(missing, none, values)
    return Found(**picked)


def _at(values: Complex | Floats, index: np.ndarray) -> np.ndarray:
    """Values (f, n, ...) of the roots (f, m, ...) of these indices (f, n)."""
    return np.asarray(values[np.arange(len(index))[:, None], index])


def _misfit(
    found: Found, omega: Floats, before: tuple[Ints, Ints], after: tuple[int, Ints]
) -> Floats:
    """Misfit (n, m) of the roots at n places (f, m) before with m roots at a later frequency."""
    (f, m), (g, roots) = before, after
    step = (omega[g] - omega[f])[:, None]
    start, end = found.squared[f, m][:, None], found.squared[g, roots]
    led = start + step * (found.slope[f, m][:, None] + found.slope[g, roots]) / 2
    size = np.abs(start) + np.abs(end) + 0.01 * np.abs(end).max(initial=0.0)
    a, b = (x.reshape(len(x), found.shapes[0, 0].size)
            for x in (found.shapes[f, m], found.shapes[g, roots]))  # fmt: skip
    a, b = (x / np.maximum(np.linalg.norm(x, axis=1), 1e-300)[:, None] for x in (a, b))
    return np.asarray(np.abs(led - end) / size + SHAPE_WEIGHT * (1 - np.abs(a.conj() @ b.T)))
