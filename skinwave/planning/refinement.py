"""Mesh refinement with Richardson error estimates: no a-priori error law holds for every scene.

Near a resonance a mesh that is a little too stiff changes the waveform by many times as much as
elsewhere, and soft or thin bodies need more elements than stiff ones. The error of each mesh in a
sequence is extrapolated from its change to the one before, at the order of convergence of all of
them. All axes are refined alike: a slab has few layers of cells, and one more changes as much as
all that is between.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import fem
from meshes.tetmesh import Floats
from simple_model import Response
from skinwave.effort import Progress
from skinwave.models import hands
from skinwave.models.bodies import (
    COMPARED,
    FINE_PALM,
    cell_layers,
    check_mesh,
    coarsest_size,
    default_size,
)
from skinwave.models.prepared import Prepared, answer, prepare, reduced_lines, reduction_tolerance
from skinwave.scene import Body, Scene

FIRST, RATIO = 2.6, 1.3  # of the default element size; of two successive sizes
FIRST_HAND = 1.6  # of the default element size, for hands
ORDER = 2.25  # of convergence of a waveform in the element size; measured 1.9 to 3.5
SAFETY = 0.6  # of the tolerance: safety factor, so that one more mesh is enough
LARGEST_FACTOR = 1.6  # between two sizes at most: coarse meshes overestimate their errors
FINEST = 0.4  # of the default element size: the finest that is tried


@dataclass(frozen=True, kw_only=True, eq=False)
class Refined:
    """Refined mesh: element size `h` in metre, the expected relative `error` with it, the size in
    metre that it was `compared` with, and the reduced body, `prepared` with it.
    """

    h: float
    error: float
    compared: float
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
    """Coarsest mesh of a sequence that is accurate to a tolerance, or that of a given h, with its
    expected error.

    If the finest of the sequence is not, that one is returned, with its error.

    Raises
    ------
    ValueError
        If the body has no mesh of that size.
    """

    def answered(size: float) -> tuple[Prepared, NDArray[Any]]:
        prepared = prepare(
            body, scene.probe_points, progress, h=size,
            tolerance=reduction_tolerance(tolerance), symmetry=symmetry, solver=solver,
        )  # fmt: skip
        return prepared, quantity_of_interest(prepared, scene, answer(prepared, scene))

    check_mesh(body, h or default_size(body))
    sizes = element_sizes(body)
    before = compared_with(body, h) if h else sizes[0]
    size = h or _finer(sizes, before)[0]
    coarse, other = answered(before)
    while True:
        prepared, found = answered(size)
        if coarse.effort.dofs == prepared.effort.dofs:  # two sizes beyond the body's own: one mesh
            error = 1.0 if scene.body.kind != "mesh" else np.nan  # or one in the file
        else:
            error = richardson_error(other, found, coarser_by(body, before, size))
        if h or not error > tolerance or size == sizes[-1]:  # no number if a file has one mesh
            return Refined(h=size, error=error, compared=before, prepared=prepared)
        wanted = size * (SAFETY * tolerance / error) ** (1 / ORDER)
        before, coarse, other = size, prepared, found
        finer = _finer(sizes, size)
        size = finer[abs(np.log(finer / max(wanted, size / LARGEST_FACTOR))).argmin()]


def element_sizes(body: Body) -> Floats:
    """Sequence of element sizes (k,) in metre that a body may be meshed with, descending."""
    coarsest, finest = FIRST * default_size(body), FINEST * default_size(body)
    if body.kind in hands.KINDS:  # whose coarser meshes cut the rim off, and layers
        coarsest = min(FIRST_HAND * default_size(body), COMPARED * coarsest_size(body))
        finest = max(finest, min(default_size(body), FINE_PALM))
    if not _has_cell_layers(body):
        return np.geomspace(coarsest, finest, 64)
    found, layers = [body.depth], 1
    while found[-1] > finest:
        layers = max(layers + 1, round(RATIO * layers))
        size = _layered(body, layers, body.depth / layers)
        found += [size] if size < found[-1] else []
    sizes = np.array(found)
    return sizes[max(0, np.count_nonzero(sizes >= coarsest) - 1) :]


def _finer(sizes: Floats, size: float) -> Floats:
    """Sizes that are finer by `RATIO` or more; the last if none is."""
    coarser = np.count_nonzero(sizes > size / RATIO * (1 + 1e-9))
    return sizes[min(coarser, len(sizes) - 1) :]


def compared_with(body: Body, h: float) -> float:
    """Size that a given one can be compared with: coarser, or finer than a single layer."""
    if not _has_cell_layers(body):
        return min(RATIO * h, max(body.width, body.height))
    layers = cell_layers(body, h)
    other = min(layers - 1, round(layers / RATIO)) or 2
    return _layered(body, other, min(h, body.depth) * layers / other)


def _has_cell_layers(body: Body) -> bool:
    """Whether the size alone sets the number of cells through the depth, not the body's layers."""
    return body.kind == "slab" and len(body.strata) == 1


def _layered(body: Body, layers: int, near: float) -> float:
    """Size in metre near another with which a slab has so many layers of cells, or nearly."""
    sizes = (near * 2 ** np.linspace(-1, 1, 101)).tolist()
    return min(sizes, key=lambda h: (abs(cell_layers(body, h) - layers), abs(np.log(h / near))))


def coarser_by(body: Body, other: float, h: float) -> float:
    """Refinement ratio of two meshes, coarser over finer, along the axis where they differ less."""
    if not _has_cell_layers(body):
        return other / h
    down = cell_layers(body, h) / cell_layers(body, other)
    return min(other / h, down, key=lambda ratio: abs(np.log(ratio)))


def quantity_of_interest(prepared: Prepared, scene: Scene, found: Response) -> NDArray[Any]:
    """Quantity of interest of a response: waveforms (t, p); of an unconstrained body the lines
    (f, p) without the mean, because rigid-body drift would hide the rest.
    """
    if scene.body.is_held:
        return found.displacement
    frequencies, forces = reduced_lines(scene.pressure, prepared.points, prepared.load)
    lines, _ = fem.line_response(prepared.poles, forces, frequencies)
    return lines[frequencies > 0] @ prepared.read.T


def richardson_error(other: NDArray[Any], found: NDArray[Any], ratio: float) -> float:
    """Richardson estimate of the relative error of a quantity of interest (k, p) by that of another
    mesh with elements `ratio` times as large.
    """
    size = np.maximum(np.linalg.norm(found, axis=0), 1e-300)
    change = np.linalg.norm(found - other, axis=0)
    return float((change / size).max() / abs(ratio**ORDER - 1))


def enough(body: Body, h: float, error: float, tolerance: float) -> float:
    """Element size in metre that meets a tolerance, by the error with h; a slab's cells are at most
    as high as its depth.
    """
    aim, size = SAFETY * tolerance, min(h, body.depth if body.kind == "slab" else h)
    return size * (aim / max(aim, error)) ** (1 / ORDER)
