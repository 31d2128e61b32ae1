"""Packs of laterally infinite bodies: the compliance G on a grid of wavenumbers k. The motion at a
distance r from a focal spot is

    g(r, w) = 1/(2 pi) int_0^inf S(k) G(k, w) J0(k r) k dk

Only the transform S of the pressure profile depends on the height of the focus. The grid is fine
and wide enough for the narrowest profile. The path of integration runs above the real axis, away
from the poles of waves, as in `simple_model.layers.wavenumber_integral`.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.special import jv

import fem
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
from skinwave.system.arrays import pack, quantise
from skinwave.system.effort import Progress, silent
from skinwave.typing import Floats

LOWEST = 0.1  # m: lowest height of the focus
ERROR = 2e-3  # relative, of lines above -40 dB: twice the largest error of 200 Tactons
HIGHEST = 1200.0  # Hz: at higher frequencies skin moves by less than 0.1 % of its largest motion
SPACING = 2.5  # Hz between frequencies: resolves motion that lasts up to 0.2 s
MIDDLE, DAMPED = 300.0, 0.1  # Hz, and the loss factor with which motion there lasts 10 ms
FURTHEST = 0.145  # m: diagonal of the area
DISTANCES = np.linspace(0, FURTHEST, int(np.ceil(6 * FURTHEST / spot_width(LOWEST))))  # m
BROADEST = 6.5  # over the width of a spot: its transform is negligible at larger wavenumbers
ORDER = 16  # of Gauss and Legendre's rule on each panel
FEWEST_NODES = 256  # of the wavenumber grid
CHECKED = 16  # the grid is checked at every 16th frequency and distance


def radial_pack(body: Body, progress: Progress = silent) -> dict[str, Any]:
    """Return the pack of a laterally infinite body: `frequencies` (f,) in Hz, complex `k` (k,) in
    1/m and `weights` of the path of integration, and the compliance `G` (f, k) in m/Pa. Raises
    ArithmeticError if no grid of wavenumbers is fine enough.
    """
    progress("wavenumber integral", 0.0)
    response, frequencies = compliance(body), _frequencies(body)
    n, some = FEWEST_NODES, frequencies[::CHECKED]
    coarse = _tabulate(_path(response, some, n))
    while True:
        if n >= MOST_NODES:
            raise ArithmeticError(UNRESOLVED)
        fine = _tabulate(_path(response, some, 2 * n))
        if np.abs(fine - coarse).max() <= INTEGRATION_ERROR * np.abs(fine).max():
            break
        coarse, n = fine, 2 * n
    path = _path(response, frequencies, n)
    return {
        "kind": "radial", "error": ERROR, "lowest_height_mm": 1e3 * LOWEST,
        "frequencies": frequencies.tolist(), "furthest": FURTHEST, "n_distances": len(DISTANCES),
        "k": pack(path.k[None]), "weights": pack(path.weights[None]),
        "G": quantise(path.G),
    }  # fmt: skip


class _Path(NamedTuple):
    """Nodes k (k,) in 1/m of the path of integration, their weights, and G (f, k) in m/Pa there."""

    k: fem.Complex
    weights: fem.Complex
    G: fem.Complex


def _frequencies(body: Body) -> Floats:
    """Frequencies (f,) in Hz, half as dense above `MIDDLE` if loss damps the motion there."""
    w = 2 * np.pi * MIDDLE
    moduli = [solid.complex_modulus(w) for _, solid in body.strata]
    damped = min(modulus.imag / modulus.real for modulus in moduli) > DAMPED
    fine = np.arange(0.0, HIGHEST + SPACING, SPACING)
    return fine[(fine <= MIDDLE) | (fine % (2 * SPACING) == 0)] if damped else fine


def _tabulate(path: _Path) -> fem.Complex:
    """Response g (f, r) at some distances for the narrowest profile."""
    k, width = path.k, spot_width(LOWEST)
    shares = width**2 * np.exp(-((k * width) ** 2) / 2) * k * path.weights
    return np.asarray(path.G @ (shares[:, None] * jv(0, k[:, None] * DISTANCES[::CHECKED])))


def _path(response: Compliance, frequencies: Floats, n: int) -> _Path:
    w = 2 * np.pi * frequencies.astype(np.complex128)
    lift = min(1.5 / FURTHEST, response.clearance(w))  # J0 grows by e^1.5 at most
    if not lift > 0:
        raise ArithmeticError(UNRESOLVED)
    nodes, weights = np.polynomial.legendre.leggauss(ORDER)
    # Panels grow with k, because waves of low frequencies have their poles near k = 0.
    edges = BROADEST / spot_width(LOWEST) * np.linspace(0, 1, n // ORDER + 1) ** 2
    half, middle = np.diff(edges) / 2, (edges[1:] + edges[:-1]) / 2
    along = (middle[:, None] + half[:, None] * nodes).ravel()
    ramp = np.tanh(along / lift)
    k = along + 1j * lift * ramp
    parts = np.array_split(w[:, None], max(1, len(w) * n // AT_ONCE))
    return _Path(
        k, (half[:, None] * weights).ravel() * (1 + 1j * (1 - ramp**2)),
        np.concatenate([response(k, some) for some in parts]),
    )  # fmt: skip
