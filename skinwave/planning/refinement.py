"""How fine a mesh must be, found by refining it: no error law holds for every scene.

Near a resonance a mesh that is a little too stiff moves the waveform by many times as much as
elsewhere, and soft or thin bodies need more elements than stiff ones. Each mesh of a rising
ladder is judged by what the next one changes, with the order that all of them reach.
"""

from dataclasses import dataclass

import numpy as np

from simple_model import Response
from skinwave.effort import Progress
from skinwave.models import hands
from skinwave.models.bodies import default_size
from skinwave.models.prepared import Prepared, answer, prepare
from skinwave.scene import Body, Scene

FIRST, RATIO = 2.6, 1.3  # of the default element size; of two sizes next to each other
ORDER = 2.5  # of a waveform's error in the element size, at least; measured 2.4 to 3.5
AIM = 0.6  # of the tolerance, so that one more mesh is enough
STRIDE = 1.6  # between two sizes at most: coarse meshes make their errors out too large
FINEST = 0.4  # of the default element size, beyond which no more is promised


@dataclass(frozen=True, kw_only=True, eq=False)
class Refined:
    """Element size `h` in metre, the expected relative `error` with it, by how much the `coarser`
    mesh of size in metre differs, and the body `prepared` with it.
    """

    h: float
    error: float
    coarser: float
    prepared: Prepared


def refined(
    scene: Scene,
    body: Body,
    tolerance: float,
    progress: Progress | None = None,
    *,
    symmetry: str = "",
    solver: str = "auto",
    h: float | None = None,
) -> Refined:
    """The coarsest mesh of a ladder that is right to a tolerance, or how right h is.

    A mesh that is not good enough at the end of the ladder comes back with its error.
    """

    def answered(size: float) -> tuple[Prepared, Response]:
        prepared = prepare(
            body, scene.probe_points, progress, h=size,
            tolerance=min(1e-3, tolerance / 50), symmetry=symmetry, solver=solver,
        )  # fmt: skip
        return prepared, answer(prepared, scene)

    if scene.body.kind in hands.KINDS:
        h = h or default_size(scene.body)  # each mesh takes a minute: two tell how good the last is
    least = FINEST * default_size(scene.body)
    longest = max(body.width, body.height)
    before = min(h * RATIO if h else FIRST * default_size(scene.body), longest)
    size = h or before / RATIO
    coarse = answered(before)[1]
    while True:
        prepared, fine = answered(size)
        if coarse.effort.dofs == fine.effort.dofs:  # two sizes beyond the body's own: one mesh
            error = 1.0 if scene.body.kind != "mesh" else np.nan  # or one in the file
        else:
            error = error_left(coarse, fine, before / size)
        if h or error <= tolerance or size <= least:
            return Refined(h=size, error=error, coarser=before, prepared=prepared)
        wanted = size * (AIM * tolerance / error) ** (1 / ORDER)
        before, coarse = size, fine
        size = max(least, min(size / RATIO, max(wanted, size / STRIDE)))


def error_left(coarse: Response, fine: Response, ratio: float) -> float:
    """The expected relative error of the finer of two answers, whose sizes have this ratio."""
    return _change(coarse, fine) / (ratio**ORDER - 1)


def _change(coarse: Response, fine: Response) -> float:
    """Relative L2 change of the worst probe's waveform."""
    size = np.maximum(np.linalg.norm(fine.displacement, axis=0), 1e-300)
    change = np.linalg.norm(fine.displacement - coarse.displacement, axis=0)
    return float((change / size).max())
