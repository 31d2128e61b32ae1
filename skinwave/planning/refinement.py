"""Mesh refinement with Richardson error estimates: no a-priori error law holds for every scene.

Near a resonance a mesh that is a little too stiff changes the waveform by many times as much as
elsewhere, and soft or thin bodies need more elements than stiff ones. The error of each mesh in a
sequence is extrapolated from its change to the one before, and a controller chooses the next size.
All axes are refined alike: a slab has few layers of cells, and one more changes as much as all that
is between.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from scipy import fft

from simple_model import Response
from skinwave.bodies.build import COMPARED
from skinwave.bodies.sizes import check_mesh, coarsest_size, default_size
from skinwave.bodies.slab import cell_layers
from skinwave.bodies.tissue import FINE_PALM
from skinwave.models.options import DEFAULT, SolveOptions
from skinwave.models.reduced import (
    BAND,
    ReducedBody,
    answer,
    components,
    oscillating,
    prepare,
    reduction_tolerance,
)
from skinwave.scene.scene import Body, Scene
from skinwave.typing import Array, Floats

FIRST, RATIO = 2.6, 1.3  # of the default element size; of two successive sizes
FIRST_HAND = 1.6  # of the default element size, for hands
FINEST = 0.4  # of the default element size: the finest that is tried


@dataclass(frozen=True, kw_only=True)
class SizeController:
    """Controller of the element size h by Richardson extrapolation of an error ~ h^order.

    The error of a mesh is its relative change from one with elements r times as large, over
    r^order - 1, and that times `margin`; the next size is h (safety tolerance / error)^(1/order).
    Roache, Annu Rev Fluid Mech 29:123 (1997); ASME V&V 20 (2009), section 2.

    `order` of convergence of a waveform, measured 1.9 to 3.5; `margin`, because clamped edges,
    jumps of material and coarse meshes lower it: true errors were up to 1.4 times as large;
    `safety` factor on the tolerance, so that one more mesh is enough; `largest_factor` between two
    sizes, because coarse meshes overestimate their errors.
    """

    order: float = 2.25
    margin: float = 1.4
    safety: float = 0.6
    largest_factor: float = 1.6

    def error(self, other: Array, found: Array, ratio: float) -> float:
        """Relative error of a quantity of interest (k, p) by that of another mesh with elements
        `ratio` times as large.
        """
        return self.margin * relative_change(other, found) / abs(ratio**self.order - 1)

    def size(self, h: float, error: float, tolerance: float) -> float:
        """Element size in metre that meets a tolerance, by the error with h."""
        return h * (self.safety * tolerance / error) ** (1 / self.order)

    def nearest(self, sizes: Floats, h: float, error: float, tolerance: float) -> float:
        """Next of a sequence of sizes in metre after h."""
        wanted = max(self.size(h, error, tolerance), h / self.largest_factor)
        return float(sizes[np.abs(np.log(sizes / wanted)).argmin()])


CONTROLLER = SizeController()
NO_MOTION = 1e-9  # of the probe that moves most: what a weaker one reads is round-off


def relative_change(other: Array, found: Array) -> float:
    """Change of a quantity of interest (k, p) from another mesh's, relative, of the worst probe."""
    size = np.linalg.norm(found, axis=0)
    size = np.maximum(size, max(NO_MOTION * size.max(), 1e-300))
    return float((np.linalg.norm(found - other, axis=0) / size).max())


class Convergence(Enum):
    """Outcome of the comparison of two element sizes."""

    REACHED = "the error is within the tolerance"
    NOT_REACHED = "the error is above the tolerance"
    SAME_MESH = "both sizes are beyond the body's own, and make one mesh"
    SINGLE_MESH = "a file has one mesh, which both sizes take"


# Relative errors where there is none to extrapolate.
UNESTIMATED = {Convergence.SAME_MESH: 1.0, Convergence.SINGLE_MESH: np.nan}


@dataclass(frozen=True, kw_only=True, eq=False)
class Refined:
    """Refined mesh: element size `h` in metre, the `convergence` and the expected relative `error`
    with it, the size in metre that it was `compared` with, and the reduced body, `prepared` with
    it.
    """

    h: float
    convergence: Convergence
    error: float
    compared: float
    prepared: ReducedBody


def refined(
    scene: Scene,
    body: Body,
    options: SolveOptions = DEFAULT,
    *,
    symmetry: str = "",
) -> Refined:
    """Coarsest mesh of a sequence for a scene's `body`, or a part of it, that is accurate to a
    tolerance, or that of a given h, with its expected error; the finest of the sequence if that is
    not accurate either. Raises a ValueError if the body has no mesh of that size.
    """
    h, tolerance = options.h, options.tolerance

    def answered(size: float) -> tuple[ReducedBody, Array]:
        prepared = prepare(
            body, scene.probe_points, options.progress, h=size,
            tolerance=reduction_tolerance(tolerance), symmetry=symmetry, solver=options.solver,
            reading=scene.reading, load=scene.load,
        )  # fmt: skip
        return prepared, quantity_of_interest(prepared, scene, answer(prepared, scene))

    check_mesh(body, h or default_size(body))
    sizes = element_sizes(body)
    before = compared_with(body, h) if h else sizes[0]
    size = h or finer_sizes(sizes, before)[0]
    coarse, other = answered(before)
    while True:
        prepared, found = answered(size)
        same = coarse.effort.dofs == prepared.effort.dofs
        outcome, error = convergence(body, (before, size), (other, found), tolerance, same=same)
        refinable = outcome in (Convergence.NOT_REACHED, Convergence.SAME_MESH)
        if h or not refinable or size == sizes[-1]:
            return Refined(
                h=size, convergence=outcome, error=error, compared=before, prepared=prepared
            )
        before, coarse, other = size, prepared, found
        size = CONTROLLER.nearest(finer_sizes(sizes, size), size, error, tolerance)


def element_sizes(body: Body) -> Floats:
    """Sequence of element sizes (k,) in metre that a body may be meshed with, descending."""
    coarsest, finest = FIRST * default_size(body), FINEST * default_size(body)
    if not body.of_kind.conforming:  # whose coarser meshes cut the rim off, and layers
        coarsest = min(FIRST_HAND * default_size(body), COMPARED * coarsest_size(body))
        finest = max(finest, min(default_size(body), FINE_PALM))
    if not _has_cell_layers(body):
        sizes = np.geomspace(coarsest, finest, 64)
        if actual := body.of_kind.actual_size:  # one of those with the same mesh
            sizes = sizes[
                np.unique([-actual(body, h) for h in sizes.tolist()], return_index=True)[1]
            ]
        return sizes
    found, layers = [body.depth], 1
    while found[-1] > finest:
        layers = max(layers + 1, round(RATIO * layers))
        size = _layered(body, layers, body.depth / layers)
        found += [size] if size < found[-1] else []
    sizes = np.array(found)
    return sizes[max(0, np.count_nonzero(sizes >= coarsest) - 1) :]


def finer_sizes(sizes: Floats, size: float) -> Floats:
    """Sizes of a sequence finer than one by `RATIO` or more; or the last."""
    coarser = np.count_nonzero(sizes > size / RATIO * (1 + 1e-9))
    return sizes[min(coarser, len(sizes) - 1) :]


def compared_with(body: Body, h: float) -> float:
    """Size that a given one can be compared with: coarser, or finer than a single layer."""
    if actual := body.of_kind.actual_size:
        sizes = (h * np.geomspace(1, 4, 80)).tolist() + (h / np.geomspace(1, 4, 80)).tolist()
        far = (s for s in sizes if abs(np.log(actual(body, s) / actual(body, h))) > np.log(RATIO))
        return next(far, RATIO * h)
    if not _has_cell_layers(body):
        return min(RATIO * h, max(body.width, body.height))
    layers = cell_layers(body, h)
    other = min(layers - 1, round(layers / RATIO)) or 2
    return _layered(body, other, min(h, body.depth) * layers / other)


def _has_cell_layers(body: Body) -> bool:
    """Whether the size alone sets the number of cells through the depth, not the body's layers."""
    return body.of_kind.is_layer and len(body.strata) == 1


def _layered(body: Body, layers: int, near: float) -> float:
    """Size in metre near another with which a slab has so many layers of cells, or nearly."""
    sizes = (near * 2 ** np.linspace(-1, 1, 101)).tolist()
    return min(sizes, key=lambda h: (abs(cell_layers(body, h) - layers), abs(np.log(h / near))))


def coarser_by(body: Body, other: float, h: float) -> float:
    """Refinement ratio of two meshes, coarser over finer: that of their sizes in metre, or of their
    cells on average of all axes, where these differ less, because short sides have few cells.
    """
    if actual := body.of_kind.actual_size:
        return actual(body, other) / actual(body, h)
    lines = body.of_kind.grid_lines
    if lines is None:
        return other / h
    coarse, fine = (np.prod([len(line) - 1 for line in lines(body, size)]) for size in (other, h))
    mean = float((fine / coarse) ** (1 / 3))
    return min(other / h, mean, key=lambda ratio: abs(np.log(ratio)))


def about_its_rest(scene: Scene, waveforms: Array) -> Array:
    """Waveforms (t, p) without the mean under gravity, which would hide errors."""
    return waveforms - waveforms.mean(axis=0) if scene.load.gravity else waveforms


def quantity_of_interest(prepared: ReducedBody, scene: Scene, found: Response) -> Array:
    """Quantity of interest of the response of a reduced body: its waveforms (t, p); of an
    unconstrained body the lines (f, p c) of its components without the mean, because rigid-body
    drift would hide the rest.
    """
    if scene.body.is_held:
        return about_its_rest(scene, found.values)
    return oscillating(components(prepared, *scene.loads)).lines


def above_band(waveforms: Floats, step: float) -> float:
    """Error of waveforms by what moves above `BAND`, up to which a reduced body is held to its
    tolerance.

    Velocity and acceleration have such a part where a load begins, or jumps, at once. The reduced
    body's own is as large as the true one and has no relation to it. A series of cosines continues
    the record without a jump at its ends.

    Of waveforms (t, p) with a step in s between samples, relative, of the worst probe: the root of
    twice the share of the energy.
    """
    energy = fft.dct(waveforms, axis=0, norm="ortho") ** 2
    frequencies = np.arange(len(energy)) / (2 * step * len(energy))
    above, whole = energy[frequencies > BAND].sum(axis=0), energy.sum(axis=0)
    whole = np.maximum(whole, max(NO_MOTION**2 * whole.max(), 1e-300))
    return float(np.sqrt(2 * (above / whole).max()))


def convergence(
    body: Body,
    sizes: tuple[float, float],
    found: tuple[Array, Array],
    tolerance: float,
    *,
    same: bool,
) -> tuple[Convergence, float]:
    """Outcome and relative error of the second of two element sizes in metre, by the quantities of
    interest (k, p) that were found with them; whether both make the `same` mesh. The error is as of
    `UNESTIMATED` where there is none to extrapolate.
    """
    if same:
        outcome = Convergence.SINGLE_MESH if body.file else Convergence.SAME_MESH
        return outcome, UNESTIMATED[outcome]
    error = CONTROLLER.error(*found, coarser_by(body, *sizes))
    return Convergence.NOT_REACHED if error > tolerance else Convergence.REACHED, error


def enough(body: Body, h: float, error: float, tolerance: float) -> float:
    """Element size in metre that meets a tolerance, by the relative error with another, h."""
    size = min(h, body.depth if body.of_kind.is_layer else h)
    return CONTROLLER.size(size, max(CONTROLLER.safety * tolerance, error), tolerance)
