"""Modes followed along frequency: matching of roots at neighbouring frequencies."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from simple_model.typing import Bools, Complex, Floats, Ints

UNLIKE = 0.3  # misfit of two roots of different modes


@dataclass(frozen=True, kw_only=True, eq=False)
class Roots:
    """Roots of a body, m at each of the frequencies (f,).

    Parameters
    ----------
    squared : (f, m) complex, 1/m2, squared wavenumbers
    slope : (f, m) complex, s/m2, their derivative by the angular frequency
    wavenumbers : (f, m) complex, 1/m, with Im k <= 0
    residues : (f, m) complex, 1/Pa/m, of the surface compliance in k^2
    energy_speed : (f, m) float, m/s, of the energy of a mode, inf if unknown
    shapes : (f, m, d, 2) complex
    """

    squared: Complex
    slope: Complex
    wavenumbers: Complex
    residues: Complex
    energy_speed: Floats
    shapes: Complex

    def apply(self, change: Callable[..., Any], *others: "Roots") -> "Roots":
        """Change every field, given with those of other roots."""
        each = {name: [vars(roots)[name] for roots in (self, *others)] for name in vars(self)}
        return Roots(**{name: change(*values) for name, values in each.items()})


def track_modes(roots: Roots, omega: Floats, most: int, returned: Ints) -> Roots:
    """Sort roots at (f,) rad/s into modes, one in each column, NaN where a mode has no root.

    Two roots at successive frequencies belong to one mode if their k^2 agree with their
    derivatives (trapezoidal rule) and their shapes are alike. The result has only the frequencies
    with indices `returned` (g,), and at most `most` modes: those that decay least, and among
    equals the slowest.
    """
    count = len(omega)
    index = np.full((count, 0), -1)
    for f in range(count):
        known = np.flatnonzero(np.isfinite(roots.squared[f]))
        latest = np.where(index >= 0, np.arange(count)[:, None], -1).max(axis=0, initial=-1)
        # Near the frequency at which a mode begins to leak, up to three frequencies have no root.
        alive = np.flatnonzero(f - latest <= 4)
        last = index[latest[alive], alive]
        costs, matches = _matches(roots, omega, (latest[alive], last), (f, known))
        pairs = [
            (alive[i], known[j]) for i, j in zip(*matches, strict=True) if costs[i, j] < UNLIKE
        ]
        for column, root in pairs:
            index[f, column] = root
        new = np.setdiff1d(known, [root for _, root in pairs])
        begun = np.full((count, len(new)), -1)
        begun[f] = new
        index = np.hstack([index, begun])
    index = index[returned]
    index = index[:, (index >= 0).any(axis=0)]
    roots = roots.apply(lambda values: values[returned])
    decay = np.abs(roots.wavenumbers.imag)
    decay = np.where(decay > 1e-9 * np.abs(roots.wavenumbers), decay, 0.0)
    least = np.where(index >= 0, _at(decay, index), np.inf).min(axis=0)
    slowness = np.where(decay == 0, np.abs(roots.wavenumbers.real) / omega[returned, None], 0.0)
    slowest = np.where(index >= 0, _at(slowness, index), 0.0).max(axis=0)
    least = np.lexsort([-slowest, least])[:most]
    index = index[:, least]

    def pick(values: Any) -> Any:
        values = _at(values, index)
        missing = (index < 0).reshape(index.shape + (1,) * (values.ndim - 2))
        none = complex(np.nan, np.nan) if np.iscomplexobj(values) else np.nan
        return np.where(missing, none, values)

    return roots.apply(pick)


def frequencies_between(roots: Roots, omega: Floats, waves: Bools, most: int) -> Floats:
    """Frequencies (g,) in rad/s in the middle of gaps across which modes cannot be followed safely;
    `waves` (f, m) marks roots that are waves.
    """
    further = []
    sure, rival = 0.06, 0.15  # largest misfit of a safe match; least misfit of its rivals
    for f in np.flatnonzero(omega[1:] > 1.05 * omega[:-1]).tolist():  # others lose no mode
        here, there = (np.flatnonzero(np.isfinite(roots.squared[g])) for g in (f, f + 1))
        costs, pairs = _matches(roots, omega, (np.full(len(here), f), here), (f + 1, there))
        is_sure = np.zeros(costs.shape, bool)
        is_sure[pairs] = costs[pairs] <= sure
        rivals = costs < rival
        is_sure &= (rivals.sum(axis=1, keepdims=True) == 1) & (rivals.sum(axis=0) == 1)
        for g, chosen, axis in ((f, here, 1), (f + 1, there, 0)):
            slowness = np.where(waves[g, chosen], np.abs(roots.wavenumbers[g, chosen].real), 0.0)
            slowest = np.argsort(-slowness)[:most]
            slowest = slowest[slowness[slowest] > 0]
            if not np.any(is_sure, axis=axis, keepdims=True).ravel()[slowest].all():
                further.append(np.sqrt(omega[f] * omega[f + 1]))
                break
    return np.array(further)


def _at(values: Complex | Floats, index: np.ndarray) -> np.ndarray:
    """Values (f, n, ...) of the roots (f, m, ...) at indices (f, n)."""
    return np.asarray(values[np.arange(len(index))[:, None], index])


def _matches(
    roots: Roots, omega: Floats, before: tuple[Ints, Ints], after: tuple[int, Ints]
) -> tuple[Floats, tuple[Ints, Ints]]:
    """Misfits (n, m), at most `UNLIKE`, and the best pairs; equal costs spare good pairs."""
    from scipy.optimize import linear_sum_assignment  # slow to import

    costs = np.minimum(_misfit(roots, omega, before, after), UNLIKE)
    return costs, linear_sum_assignment(costs)


def _misfit(
    roots: Roots, omega: Floats, before: tuple[Ints, Ints], after: tuple[int, Ints]
) -> Floats:
    """Misfit (n, m) of the roots at n places (f, m) with m roots at a later frequency."""
    (f, m), (g, n) = before, after
    start, end = roots.squared[f, m][:, None], roots.squared[g, n]
    rise, later = roots.slope[f, m][:, None], roots.slope[g, n]
    led = start + (omega[g] - omega[f])[:, None] * (rise + later) / 2
    size = np.abs(start) + np.abs(end) + 0.01 * np.abs(end).max(initial=0.0)
    missed = np.abs(led - end) / size
    # In logarithms it leads further, but not through a cut-off.
    w, v = omega[f][:, None], omega[g]
    power = (w * rise / start + v * later / end) / 2
    missed = np.minimum(missed, np.abs(np.log(end / start) - power * np.log(v / w)) / 2)
    a, b = (x.reshape(len(x), roots.shapes[0, 0].size)
            for x in (roots.shapes[f, m], roots.shapes[g, n]))  # fmt: skip
    a, b = (x / np.maximum(np.linalg.norm(x, axis=1), 1e-300)[:, None] for x in (a, b))
    return np.asarray(missed + 0.1 * (1 - np.abs(a.conj() @ b.T)))
