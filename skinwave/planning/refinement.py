"""Mesh refinement with Richardson error estimates, because no a-priori law holds for every scene.

Near a resonance, the small excess stiffness of a mesh changes the waveform much more than
elsewhere. Soft or thin bodies need more elements than stiff ones. The error of each mesh in a
sequence is extrapolated from the change since a coarser mesh, and a controller chooses the next
size. All axes are refined alike, because a slab has few layers of cells and one more layer changes
the result as much as the refinement along the surface.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import fft

from simple_model import Response
from skinwave.bodies.build import COMPARED
from skinwave.bodies.sizes import check_mesh, coarsest_size, default_size
from skinwave.bodies.slab import cell_layers
from skinwave.bodies.tissue import FINE_PALM
from skinwave.models import reduced
from skinwave.models.options import DEFAULT, SolveOptions
from skinwave.models.reduced import BAND, ReducedBody
from skinwave.models.relative_change import NO_MOTION, relative_changes
from skinwave.scene.scene import Body, Scene
from skinwave.typing import Array, Floats

FIRST, RATIO = 2.6, 1.3  # of the default element size; of two successive sizes
# The same for hands: two of their meshes with close sizes differ more by chance than by the sizes.
FIRST_HAND, RATIO_HAND = 2.4, 1.7
FINEST = 0.4  # of the default element size: the finest that is tried
STILL = 1e-6  # of the waveforms: weaker motion about their mean is round-off


@dataclass(frozen=True, kw_only=True)
class SizeController:
    """Controller of the element size h by Richardson extrapolation of an error ~ h^order.

    The error of a mesh is the relative change from a mesh with elements r times as large, divided
    by r^order - 1, times `margin`. The next size is h (safety tolerance / error)^(1/order). Roache,
    Annu Rev Fluid Mech 29:123 (1997); ASME V&V 20 (2009), section 2.

    The `order` of convergence of a waveform was measured at 1.9 to 3.5. The `margin` covers clamped
    edges, jumps of material and coarse meshes, where true errors were up to 1.4 times as large.
    With the `safety` factor on the tolerance, one more mesh is usually enough. `largest_factor`
    limits the ratio of two sizes, because coarse meshes overestimate their errors.
    """

    order: float = 2.25
    margin: float = 1.4
    safety: float = 0.6
    largest_factor: float = 1.6

    def error(self, other: Array, values: Array, ratio: float) -> float:
        """Return the error of values (k, p), given those of a mesh `ratio` times as coarse."""
        change = float(relative_changes(values - other, values).max())
        return self.margin * change / abs(ratio**self.order - 1)

    def size(self, h: float, error: float, tolerance: float) -> float:
        """Return the element size in m that meets a tolerance, given the error at h."""
        return h * (self.safety * tolerance / error) ** (1 / self.order)

    def nearest(self, sizes: Floats, h: float, error: float, tolerance: float) -> float:
        """Return the size in m that follows h in a sequence."""
        wanted = max(self.size(h, error, tolerance), h / self.largest_factor)
        return float(sizes[np.abs(np.log(sizes / wanted)).argmin()])


CONTROLLER = SizeController()


@dataclass(frozen=True, kw_only=True, eq=False)
class Refined:
    """Refined mesh: its element size `h` in m, its expected relative `error` from `mesh_error`, the
    size in m that it was `compared` with, and its reduced body.
    """

    h: float
    error: float
    compared: float
    prepared: ReducedBody


def refine(
    scene: Scene, body: Body, options: SolveOptions = DEFAULT, *, symmetry: str = ""
) -> Refined:
    """Return the coarsest mesh of a sequence that meets the tolerance, the finest mesh if none
    does, or the mesh of a given h. `body` is the scene's body or a part of it.

    Raises a ValueError if the body has no mesh of that size.
    """
    h, tolerance, meshed = options.h, options.tolerance, replace(scene, body=body)

    def solve(size: float) -> tuple[ReducedBody, Array]:
        prepared = reduced.prepare(meshed, replace(options, h=size), symmetry=symmetry)
        return prepared, quantity_of_interest(prepared, scene, reduced.answer(prepared, scene))

    check_mesh(body, h or default_size(body))
    sizes = element_sizes(body)
    apart = RATIO if body.of_kind.conforming else RATIO_HAND
    before = comparison_size(body, h) if h else sizes[0]
    size = h or finer_sizes(sizes, before, apart)[0]
    solved = {before: solve(before)}
    while True:
        prepared, values = solve(size)
        before = min(solved, key=lambda other: abs(np.log(other / size / apart)))
        coarse, other = solved[before]
        same = coarse.effort.dofs == prepared.effort.dofs
        if same:  # the cost of the first
            prepared = replace(
                prepared, effort=replace(prepared.effort, seconds=coarse.effort.seconds)
            )
        error = mesh_error(body, (before, size), (other, values), same=same)
        if h or not tolerance < error < np.inf or size == sizes[-1]:
            return Refined(h=size, error=error, compared=before, prepared=prepared)
        solved[size] = prepared, values
        size = CONTROLLER.nearest(finer_sizes(sizes, size), size, error, tolerance)


def element_sizes(body: Body) -> Floats:
    """Return the sequence of element sizes (k,) in m for a body, descending."""
    coarsest, finest = FIRST * default_size(body), FINEST * default_size(body)
    if not body.of_kind.conforming:  # coarser meshes would cut off the rim and layers
        coarsest = min(FIRST_HAND * default_size(body), COMPARED * coarsest_size(body))
        finest = max(finest, min(default_size(body), FINE_PALM))
    if not _has_cell_layers(body):
        sizes = np.geomspace(coarsest, finest, 64)
        if actual := body.of_kind.actual_size:  # one size for each mesh
            return sizes[
                np.unique([-actual(body, h) for h in sizes.tolist()], return_index=True)[1]
            ]
        return sizes
    layered, layers = [body.depth], 1
    while layered[-1] > finest:
        layers = max(layers + 1, round(RATIO * layers))
        size = _layered_size(body, layers, body.depth / layers)
        layered += [size] if size < layered[-1] else []
    sizes = np.array(layered)
    return sizes[max(0, np.count_nonzero(sizes >= coarsest) - 1) :]


def finer_sizes(sizes: Floats, size: float, ratio: float = RATIO) -> Floats:
    """Return the sizes that are finer than a size by a ratio or more, or the last size."""
    coarser = np.count_nonzero(sizes > size / ratio * (1 + 1e-9))
    return sizes[min(coarser, len(sizes) - 1) :]


def comparison_size(body: Body, h: float) -> float:
    """Return a size in m to compare h with: coarser, or finer if h gives a single layer."""
    if actual := body.of_kind.actual_size:
        sizes = (h * np.geomspace(1, 4, 80)).tolist() + (h / np.geomspace(1, 4, 80)).tolist()
        far = (s for s in sizes if abs(np.log(actual(body, s) / actual(body, h))) > np.log(RATIO))
        return next(far, RATIO * h)
    if not _has_cell_layers(body):
        return min(RATIO * h, max(body.width, body.height))
    layers = cell_layers(body, h)
    other = min(layers - 1, round(layers / RATIO)) or 2
    return _layered_size(body, other, min(h, body.depth) * layers / other)


def _has_cell_layers(body: Body) -> bool:
    """Whether the element size alone, not the body's layers, sets the number of cells in depth."""
    return body.of_kind.is_layer and len(body.strata) == 1


def _layered_size(body: Body, layers: int, near: float) -> float:
    """Return the size in m near a given one for a number of layers of cells in a slab."""
    sizes = (near * 2 ** np.linspace(-1, 1, 101)).tolist()
    return min(sizes, key=lambda h: (abs(cell_layers(body, h) - layers), abs(np.log(h / near))))


def refinement_ratio(body: Body, other: float, h: float) -> float:
    """Return the refinement ratio of two meshes: that of their sizes in m or, if closer to 1, the
    mean ratio of their cells along all axes, because short sides have few cells. Of a palm, whose
    cells grow towards the rim, it is the geometric mean of both: its errors decrease faster than
    the mean cell, and sometimes less than the size.
    """
    if actual := body.of_kind.actual_size:
        return actual(body, other) / actual(body, h)
    lines = body.of_kind.grid_lines
    if lines is None:
        return other / h
    coarse, fine = (np.prod([len(line) - 1 for line in lines(body, size)]) for size in (other, h))
    mean = float((fine / coarse) ** (1 / 3))
    if not body.of_kind.conforming:
        return float((mean * other / h) ** 0.5)
    return min(other / h, mean, key=lambda ratio: abs(np.log(ratio)))


def about_its_rest(scene: Scene, waveforms: Array) -> Array:
    """Return waveforms (t, p), under gravity without their mean, which would hide errors, unless
    nothing else moves the body.
    """
    if not scene.load.gravity:
        return waveforms
    moving = waveforms - waveforms.mean(axis=0)
    is_still = np.linalg.norm(moving) <= STILL * np.linalg.norm(waveforms)
    return waveforms if is_still else moving


def quantity_of_interest(prepared: ReducedBody, scene: Scene, response: Response) -> Array:
    """Return the quantity of interest of a reduced body: its waveforms (t, p) or, for an
    unconstrained body, the lines (f, p c) without the mean, because its drift would hide the rest.
    """
    if scene.body.is_held:
        return about_its_rest(scene, response.values)
    return reduced.oscillating(reduced.components(prepared, *scene.loads)).lines


def above_band(waveforms: Floats, step: float) -> float:
    """Return the error of waveforms (t, p), sampled at a step in s, due to motion above `BAND`.

    Velocity and acceleration have such a part where a load begins, or jumps, abruptly. In a reduced
    body this part is as large as the true one, but otherwise unrelated. The error is therefore the
    root of twice its share of the energy. A series of cosines continues the record without a jump
    at its ends.
    """
    energy = fft.dct(waveforms, axis=0, norm="ortho") ** 2
    frequencies = np.arange(len(energy)) / (2 * step * len(energy))
    above, whole = energy[frequencies > BAND].sum(axis=0), energy.sum(axis=0)
    whole = np.maximum(whole, max(NO_MOTION**2 * whole.max(), 1e-300))
    return float(np.sqrt(2 * (above / whole).max()))


def mesh_error(
    body: Body, sizes: tuple[float, float], quantities: tuple[Array, Array], *, same: bool
) -> float:
    """Return the error at the second of two element sizes in m, from their quantities of interest
    (k, p). If both give the `same` mesh, it is 1, or inf, unknown, for a mesh from a file.
    """
    if same:
        return np.inf if body.file else 1.0
    return CONTROLLER.error(*quantities, refinement_ratio(body, *sizes))


def enough(body: Body, h: float, error: float, tolerance: float) -> float:
    """Return the element size in m that meets a tolerance, given the error at h."""
    size = min(h, body.depth if body.of_kind.is_layer else h)
    return CONTROLLER.size(size, max(CONTROLLER.safety * tolerance, error), tolerance)
