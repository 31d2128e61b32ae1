"""Packs of laterally infinite bodies: the compliance G on a grid of wavenumbers k. The motion at a
distance r from a focal spot is

    g(r, w) = 1/(2 pi) int_0^inf S(k) G(k, w) J0(k r) k dk

Only the transform S of the pressure profile depends on the height of the focus. The grid is fine
and wide enough for the narrowest profile. The path of integration runs above the real axis, away
from the poles of waves, as in `simple_model.layers.wavenumber_integral`.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from simple_model.layers.wavenumber_integral import AT_ONCE, integration_path, normal_field
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


def radial_pack(
    body: Body, progress: Progress = silent, grid: RadialGrid = RadialGrid()
) -> dict[str, Any]:
    """Return the pack of a laterally infinite body as a dict for JSON.

    It has the `frequencies` (f,) in Hz, the complex wavenumbers `k` (k,) in 1/m on the path of
    integration, their `weights` (k,), and the compliance `G` (f, k) in m/Pa. Raises ArithmeticError
    if no grid of wavenumbers is fine enough.
    """
    progress("wavenumber integral", 0.0)
    response, frequencies, width = (
        compliance(body),
        _frequencies(body, grid),
        spot_width(grid.lowest),
    )
    distances = np.linspace(0, grid.furthest, int(np.ceil(grid.per_width * grid.furthest / width)))
    w = 2 * np.pi * frequencies
    k, weights = integration_path(normal_field(response), distances, w, width)
    parts = np.array_split(w[:, None].astype(np.complex128), max(1, len(w) * len(k) // AT_ONCE))
    return {
        "kind": "radial", "error": grid.error, "lowest_height_mm": 1e3 * grid.lowest,
        "frequencies": frequencies.tolist(), "furthest": grid.furthest,
        "n_distances": len(distances), "k": pack(k[None]), "weights": pack(weights[None]),
        "G": quantise(np.concatenate([response(k, some) for some in parts])),
    }  # fmt: skip


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
