"""Packs of laterally infinite bodies: the compliance G on a grid of wavenumbers k. The motion at a
distance r from a focal spot is

    g(r, w) = 1/(2 pi) int_0^inf S(k) G(k, w) J0(k r) k dk

Only the transform S of the pressure profile depends on the height of the focus. The grid is fine
and wide enough for the narrowest profile. The path of integration runs above the real axis, away
from the poles of waves, as in `simple_model.layers.wavenumber_integral`.
"""

from dataclasses import dataclass
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


@dataclass(frozen=True, kw_only=True)
class RadialGrid:
    """Limits and resolution of the pack of a laterally infinite body."""

    lowest: float = 0.1  # m: lowest height of the focus
    error: float = 2e-3  # relative, of lines above -40 dB: twice the largest of 200 Tactons
    highest: float = 1200.0  # Hz: above, skin moves by less than 0.1 % of its largest motion
    spacing: float = 2.5  # Hz between frequencies: resolves motion that lasts up to 0.2 s
    furthest: float = 0.145  # m: diagonal of the area
    per_width: int = 6  # distances in each width of the narrowest spot
    fewest_nodes: int = 256  # of the wavenumber grid
    checked: int = 16  # the wavenumber grid is checked at every 16th frequency and distance

    @property
    def width(self) -> float:
        """Width in m of the narrowest spot."""
        return float(spot_width(self.lowest))

    @property
    def distances(self) -> Floats:
        """Distances (r,) in m from the middle of a spot."""
        count = int(np.ceil(self.per_width * self.furthest / self.width))
        return np.linspace(0, self.furthest, count)


def radial_pack(
    body: Body, progress: Progress = silent, grid: RadialGrid = RadialGrid()
) -> dict[str, Any]:
    """Return the pack of a laterally infinite body as a dict for JSON.

    It has the `frequencies` (f,) in Hz, the complex wavenumbers `k` (k,) in 1/m on the path of
    integration, their `weights` (k,), and the compliance `G` (f, k) in m/Pa. Raises ArithmeticError
    if no grid of wavenumbers is fine enough.
    """
    progress("wavenumber integral", 0.0)
    response, frequencies = compliance(body), _frequencies(body, grid)
    n, some = grid.fewest_nodes, frequencies[:: grid.checked]
    coarse = _tabulate(_path(response, some, n, grid), grid)
    while True:
        if n >= MOST_NODES:
            raise ArithmeticError(UNRESOLVED)
        fine = _tabulate(_path(response, some, 2 * n, grid), grid)
        if np.abs(fine - coarse).max() <= INTEGRATION_ERROR * np.abs(fine).max():
            break
        coarse, n = fine, 2 * n
    path = _path(response, frequencies, n, grid)
    return {
        "kind": "radial", "error": grid.error, "lowest_height_mm": 1e3 * grid.lowest,
        "frequencies": frequencies.tolist(), "furthest": grid.furthest,
        "n_distances": len(grid.distances),
        "k": pack(path.k[None]), "weights": pack(path.weights[None]),
        "G": quantise(path.G),
    }  # fmt: skip


class _Path(NamedTuple):
    """Nodes k (k,) in 1/m of the path of integration, their weights, and G (f, k) in m/Pa there."""

    k: fem.Complex
    weights: fem.Complex
    G: fem.Complex


def _frequencies(
    body: Body, grid: RadialGrid, *, middle: float = 300.0, damped: float = 0.1
) -> Floats:
    """Frequencies (f,) in Hz. Above `middle` in Hz they are half as dense if the loss factor there
    is above `damped`, because motion then lasts less than 10 ms.
    """
    moduli = [solid.complex_modulus(2 * np.pi * middle) for _, solid in body.strata]
    is_damped = min(modulus.imag / modulus.real for modulus in moduli) > damped
    fine = np.arange(0.0, grid.highest + grid.spacing, grid.spacing)
    return fine[(fine <= middle) | (fine % (2 * grid.spacing) == 0)] if is_damped else fine


def _tabulate(path: _Path, grid: RadialGrid) -> fem.Complex:
    """Response g (f, r) at some distances for the narrowest profile."""
    k, width, some = path.k, grid.width, grid.distances[:: grid.checked]
    shares = width**2 * np.exp(-((k * width) ** 2) / 2) * k * path.weights
    return np.asarray(path.G @ (shares[:, None] * jv(0, k[:, None] * some)))


def _path(
    response: Compliance, frequencies: Floats, n: int, grid: RadialGrid, *, order: int = 16
) -> _Path:
    """Return n nodes, in panels with Gauss and Legendre's rule of an order."""
    w = 2 * np.pi * frequencies.astype(np.complex128)
    lift = min(1.5 / grid.furthest, response.clearance(w))  # J0 grows by e^1.5 at most
    if not lift > 0:
        raise ArithmeticError(UNRESOLVED)
    nodes, weights = np.polynomial.legendre.leggauss(order)
    # The transform of a spot is negligible above 6.5 / width. Panels grow with k, because waves of
    # low frequencies have their poles near k = 0.
    edges = 6.5 / grid.width * np.linspace(0, 1, n // order + 1) ** 2
    half, middle = np.diff(edges) / 2, (edges[1:] + edges[:-1]) / 2
    along = (middle[:, None] + half[:, None] * nodes).ravel()
    ramp = np.tanh(along / lift)
    k = along + 1j * lift * ramp
    parts = np.array_split(w[:, None], max(1, len(w) * n // AT_ONCE))
    return _Path(
        k, (half[:, None] * weights).ravel() * (1 + 1j * (1 - ramp**2)),
        np.concatenate([response(k, some) for some in parts]),
    )  # fmt: skip
