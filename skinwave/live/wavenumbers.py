"""The compliance of a laterally infinite body on a grid of wavenumbers for its integral

    g(r, w) = 1/(2 pi) int_0^inf S(k) G(k, w) J0(k r) k dk

in which only the transform S of the focal pressure profile depends on the height of the focus: the
grid is fine and wide enough for the narrowest profile. The path of integration runs above the real
axis, away from the poles of waves, as in `simple_model.layers.wavenumber_integral`.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import jv

import fem
from meshes.tetmesh import Floats
from simple_model.layers.compliance import Compliance
from simple_model.layers.wavenumber_integral import (
    AT_ONCE,
    INTEGRATION_ERROR,
    MOST_NODES,
    UNRESOLVED,
)
from simple_model.load.focus import spot_width
from skinwave.bodies.analytic import compliance
from skinwave.scene.scene import Body
from skinwave.system.effort import Progress

HIGHEST = 1200.0  # Hz: skin moves by less than a thousandth of its most above
SPACING = 2.5  # Hz between frequencies of a table: motion that lasts up to 0.2 s
MIDDLE, DAMPED = 300.0, 0.1  # Hz, and the loss factor above which motion there lasts 10 ms
FURTHEST = 0.145  # m: from a path in one corner of the area to the other
ORDER = 16  # of Gauss and Legendre's rule on each panel
FEWEST_NODES = 256  # of the wavenumber grid
LOOKED = 16  # every so many frequencies and distances the grid is checked at
PHASE = "wavenumber integral"


@dataclass(frozen=True, kw_only=True, eq=False)
class Wavenumbers:
    """A body's compliance G (f, k) in m/Pa at `frequencies` (f,) in Hz on the path of integration
    `k` (k,) in 1/m with the `weights` (k,) of its nodes, whose real parts are `along` (k,), and
    `bessel` J0(k r) (k, r) at the `distances` (r,) in metre of the narrowest profile.
    """

    frequencies: Floats
    distances: Floats
    along: Floats
    k: fem.Complex
    weights: fem.Complex
    bessel: fem.Complex
    G: fem.Complex


def wavenumbers(body: Body, low: float, progress: Progress) -> Wavenumbers:
    """Return the compliance of a flat body on a grid that serves every height from `low` on.

    Parameters
    ----------
    body : Body
    low : metre, the lowest height of the focus
    progress : told of the phase

    Returns
    -------
    Wavenumbers

    Raises
    ------
    ArithmeticError
        If no grid is fine enough.
    """
    progress(PHASE, 0.0)
    answer, frequencies = compliance(body), _frequencies(body)
    n, some, at = FEWEST_NODES, frequencies[::LOOKED], _distances(low)
    coarse = _tabulated(_on_grid(answer, some, at[::LOOKED], low, n), low)
    while n < MOST_NODES:
        fine = _tabulated(_on_grid(answer, some, at[::LOOKED], low, 2 * n), low)
        if np.abs(fine - coarse).max() <= INTEGRATION_ERROR * np.abs(fine).max():
            return _on_grid(answer, frequencies, at, low, n)
        coarse, n = fine, 2 * n
    raise ArithmeticError(UNRESOLVED)


def _frequencies(body: Body) -> Floats:
    """Frequencies in Hz of a table: with half as many above `MIDDLE` where loss lets motion last
    a tenth of the time.
    """
    w = 2 * np.pi * MIDDLE
    moduli = [solid.complex_modulus(w) for _, solid in body.strata]
    damped = min(modulus.imag / modulus.real for modulus in moduli) > DAMPED
    fine = np.arange(0.0, HIGHEST + SPACING, SPACING)
    return fine[(fine <= MIDDLE) | (fine % (2 * SPACING) == 0)] if damped else fine


def _distances(height: float) -> Floats:
    return np.linspace(0, FURTHEST, int(np.ceil(6 * FURTHEST / spot_width(height))))


def _tabulated(known: Wavenumbers, height: float) -> fem.Complex:
    """g (f, r) at the distances (r,) in metre."""
    width = spot_width(height)
    # Ascending; beyond, the transform of the profile is negligible.
    n = int(np.searchsorted(known.along, 6.5 / width, side="right"))
    k = known.k[:n]
    spot = width**2 * np.exp(-((k * width) ** 2) / 2)
    return np.asarray(known.G[:, :n] @ ((spot * k * known.weights[:n])[:, None] * known.bessel[:n]))


def _on_grid(
    answer: Compliance, frequencies: Floats, distances: Floats, low: float, n: int
) -> Wavenumbers:
    w = 2 * np.pi * frequencies.astype(np.complex128)
    lift = min(1.5 / FURTHEST, answer.clearance(w))  # J0 grows by e^1.5 at most
    if not lift > 0:
        raise ArithmeticError(UNRESOLVED)
    nodes, weights = np.polynomial.legendre.leggauss(ORDER)
    # Panels grow away from k = 0, near which the waves of low frequencies have their poles.
    edges = 6.5 / spot_width(low) * np.linspace(0, 1, n // ORDER + 1) ** 2
    half, middle = np.diff(edges) / 2, (edges[1:] + edges[:-1]) / 2
    along = (middle[:, None] + half[:, None] * nodes).ravel()
    ramp = np.tanh(along / lift)
    k = along + 1j * lift * ramp
    parts = max(1, len(w) * n // AT_ONCE)
    return Wavenumbers(
        frequencies=frequencies, distances=distances, along=along, k=k,
        bessel=jv(0, k[:, None] * distances),
        G=np.concatenate([answer(k, some) for some in np.array_split(w[:, None], parts)]),
        weights=(half[:, None] * weights).ravel() * (1 + 1j * (1 - ramp**2)),
    )  # fmt: skip
