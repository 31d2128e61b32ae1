"""Packs of laterally infinite bodies: their compliance over wavenumber and frequency."""

from typing import Any

from skinwave.live.wavenumbers import FURTHEST, wavenumbers
from skinwave.scene.scene import Body
from skinwave.system.arrays import packed, quantised
from skinwave.system.effort import Progress, silent

LOWEST = 0.1  # m: height of the focus from which a pack serves every height
ERROR = 2e-3  # relative, of lines above -40 dB: twice the largest of 200 Tactons


def radial_pack(body: Body, progress: Progress = silent) -> dict[str, Any]:
    """Pack of a laterally infinite body.

    Parameters
    ----------
    body : Body
    progress : is told of the phase

    Returns
    -------
    dict for JSON: `frequencies` (f,) in Hz, complex `k` (k,) in 1/m and `weights` of the path of
    integration, and the compliance `G` (f, k) in m/Pa, of 16 bits relative to the largest of a
    frequency
    """
    known = wavenumbers(body, LOWEST, progress)
    return {
        "kind": "radial",
        "error": ERROR,
        "lowest_height_mm": 1e3 * LOWEST,
        "frequencies": known.frequencies.tolist(),
        "furthest": FURTHEST,
        "n_distances": len(known.distances),
        "k": packed(known.k[None]),
        "weights": packed(known.weights[None]),
        "G": quantised(known.G),
    }
