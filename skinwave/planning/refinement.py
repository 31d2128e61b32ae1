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

from simple_model import Effort, Response
from simple_model.quantities import STRAIN
from skinwave.bodies.build import COMPARED
from skinwave.bodies.sizes import check_mesh, coarsest_size, default_size, map_size
from skinwave.bodies.slab import cell_layers
from skinwave.bodies.tissue import FINE_PALM
from skinwave.models import reduced
from skinwave.models.options import DEFAULT, SolveOptions
from skinwave.models.reduced import ReducedBody
from skinwave.models.relative_change import NO_MOTION, relative_changes
from skinwave.scene.scene import Body, Scene
from skinwave.system.effort import Progress, silent
from skinwave.system.processes import beside
from skinwave.typing import Array, Floats


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """Sequence of element sizes, and the meshes that are compared.

    Sizes lie between `coarsest` and `finest` times the default size; `coarsest_hand` is that of
    bodies whose elements do not follow their layers, and coarser ones would cut off the rim.
    Successive sizes have the ratio `step` or more, except for the finest one, `last_step`.

    Meshes whose cells have a ratio that is `comparable` are compared in any case, otherwise those
    nearest to `cells_apart`. The size that is compared is larger by `apart`: the first above the
    default size, the second up to it, where cells far from the focus are as large in both meshes.
    Closer meshes differ more by chance.
    """

    coarsest: float = 4.5
    coarsest_hand: float = 2.8
    finest: float = 0.4
    step: float = 1.3
    last_step: float = 1.1
    comparable: tuple[float, float] = (1.25, 1.75)
    cells_apart: float = 1.45
    apart: tuple[float, float] = (1.6, 2.0)


SIZES = Sizes()


@dataclass(frozen=True, kw_only=True)
class SizeController:
    """Controller of the element size h by Richardson extrapolation of an error ~ h^order.

    The error of a mesh is the relative change from a mesh with elements r times as large, divided
    by r^order - 1, times `margin`. The next size is h (safety tolerance / error)^(1/order). Roache,
    Annu Rev Fluid Mech 29:123 (1997); ASME V&V 20 (2009), section 2.

    `order` and `margin` are such that true errors are at most 1.1 times as large in 19 of 20 random
    bodies; bench/README.md compares other estimates. With the `safety` factor on the tolerance, one
    more mesh is usually enough. `largest_factor` limits the ratio of two sizes, because coarse
    meshes overestimate their errors. `at_default` is the usual error of a mesh of the default size,
    within a factor of 3.
    """

    order: float = 2.5
    margin: float = 1.65
    safety: float = 0.8
    largest_factor: float = 1.6
    at_default: float = 0.017

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
        return nearest_size(sizes, wanted)


@dataclass(frozen=True, kw_only=True, eq=False)
class Refined:
    """Refined mesh: its size `h` in m, its expected relative `error` from `mesh_error`, the size in
    m that it was `compared` with, and its reduced body.
    """

    h: float
    error: float
    compared: float
    prepared: ReducedBody


def refine(
    scene: Scene, body: Body, options: SolveOptions = DEFAULT, *, symmetry: str = ""
) -> Refined:
    """Return the coarsest mesh of a sequence that meets the tolerance, the finest if none does, or
    the mesh of a given h. `body` is the scene's body or a part of it. Raises a ValueError if the
    body has no mesh of that size.
    """
    h, tolerance, meshed = options.h, options.tolerance, replace(scene, body=body)

    def solve(size: float, progress: Progress = options.progress) -> tuple[ReducedBody, Array]:
        sized = replace(options, h=size, progress=progress)
        prepared = reduced.reduce_scene(meshed, sized, symmetry=symmetry, own_path=True)
        return prepared, quantity_of_interest(prepared, scene, reduced.answer(prepared, scene))

    check_mesh(body, h or default_size(body))
    sizes = element_sizes(body)
    size = h or first_size(meshed, sizes, tolerance)
    coarse_sizes = sizes[: max(1, np.count_nonzero(sizes > size))]
    wanted = apart(body, size) * size
    before = comparison_size(body, h) if h else nearest_size(coarse_sizes, wanted)
    low, high = SIZES.comparable
    if body.file and not h and low < map_size(body) / size < high:
        before = map_size(body)  # a mesh less, if there is a map
    with beside() as begin:
        # Of a file both may be the same mesh, which is then read from the cache.
        coarser = begin(solve, before, silent) if begin and not body.file else None
        prepared, values = solve(size)
        solved = {before: coarser.result() if coarser else solve(before)}
    while True:
        ratios = {
            each: refinement_ratio(body, coarse.effort, prepared.effort)
            for each, (coarse, _) in solved.items()
        }
        nearest = min(ratios, key=lambda each: abs(np.log(ratios[each] / SIZES.cells_apart)))
        # The largest estimate, because a mesh may agree with another by chance.
        found = {
            each: mesh_error(meshed, ratio, (solved[each][1], values))
            for each, ratio in ratios.items()
            if low <= ratio <= high or each == nearest
        }
        before, error = max(found.items(), key=lambda each: each[1])
        if ratios[before] == 1:  # the cost of the first
            costs = solved[before][0].effort.seconds, prepared.effort.seconds
            seconds = max(costs, key=lambda each: sum(each.values()))
            prepared = replace(prepared, effort=replace(prepared.effort, seconds=seconds))
        if h or not tolerance < error < np.inf or sizes[-1] > size / SIZES.last_step:
            return Refined(h=size, error=error, compared=before, prepared=prepared)
        solved[size] = prepared, values
        coarser_ones = np.count_nonzero(sizes > size / SIZES.step * (1 + 1e-9))
        finer = sizes[min(coarser_ones, len(sizes) - 1) :]
        size = controller(meshed).nearest(finer, size, error, tolerance)
        prepared, values = solve(size)


def controller(scene: Scene) -> SizeController:
    """Return the controller of the element size in a scene."""
    if scene.body.file:
        # Meshes of files vary between runs, and one more takes longer than slightly finer elements.
        return SizeController(at_default=0.026)
    is_smooth = scene.body.of_kind.is_smooth and len(scene.body.strata) == 1
    if is_smooth and scene.reading.record.field != STRAIN:
        return SizeController(margin=1.1, at_default=0.012)
    # Clamped edges and jumps of material slow the convergence, and so does strain. A palm has no
    # such edges, because its supports begin smoothly.
    return SizeController()


def first_size(scene: Scene, sizes: Floats, tolerance: float) -> float:
    """Return the size in m, out of a sequence, that usually meets a tolerance, but not the first.
    The true errors of most random bodies were within a factor of 3 of those that this size
    suggests.
    """
    own = controller(scene)
    wanted = own.size(default_size(scene.body), own.at_default, tolerance)
    usable = sizes[sizes <= sizes[0] / SIZES.step * (1 + 1e-9)]
    return nearest_size(usable if len(usable) else sizes[-1:], wanted)


def apart(body: Body, h: float) -> float:
    """Return the ratio of the size of elements to compare with to h in m."""
    return SIZES.apart[h <= default_size(body) * (1 + 1e-9)]


def nearest_size(sizes: Floats, wanted: float) -> float:
    """Return the size that is nearest to another by their ratio."""
    return float(sizes[np.abs(np.log(sizes / wanted)).argmin()])


def element_sizes(body: Body, steps: int = 12) -> Floats:
    """Return the sequence of element sizes (k,) in m for a body, descending: those of whole numbers
    of cell layers, or `steps` within a factor of 2.
    """
    default = default_size(body)
    coarsest, finest = SIZES.coarsest * default, SIZES.finest * default
    if not body.of_kind.conforming:
        coarsest = min(SIZES.coarsest_hand * default, COMPARED * coarsest_size(body))
        finest = max(finest, min(default, FINE_PALM))
    if not _has_cell_layers(body):
        sizes = default * 2.0 ** (np.arange(-80, 80)[::-1] / steps)
        sizes = sizes[(sizes <= coarsest) & (sizes >= finest)]
        if actual := body.of_kind.actual_size:  # one size for each mesh
            return sizes[
                np.unique([-actual(body, h) for h in sizes.tolist()], return_index=True)[1]
            ]
        return sizes
    layered, layers = [body.depth], 1
    while layered[-1] > finest:
        layers = max(layers + 1, round(SIZES.step * layers))
        size = _layered_size(body, layers, body.depth / layers)
        layered += [size] if size < layered[-1] else []
    sizes = np.array(layered)
    return sizes[max(0, np.count_nonzero(sizes >= coarsest) - 1) :]


def comparison_size(body: Body, h: float) -> float:
    """Return a size in m to compare h with: coarser, or finer if h gives a single layer."""
    if actual := body.of_kind.actual_size:
        sizes = (h * np.geomspace(1, 4, 80)).tolist() + (h / np.geomspace(1, 4, 80)).tolist()
        ratios = ((s, abs(np.log(actual(body, s) / actual(body, h)))) for s in sizes)
        far = (s for s, ratio in ratios if ratio > np.log(SIZES.step))
        return next(far, SIZES.step * h)
    if not _has_cell_layers(body):
        largest = max(body.width, body.height) if body.of_kind.is_bounded else np.inf
        return min(apart(body, h) * h, COMPARED * max(coarsest_size(body), h), largest)
    layers = cell_layers(body, h)
    other = min(layers - 1, round(layers / apart(body, h))) or 2
    return _layered_size(body, other, min(h, body.depth) * layers / other)


def _has_cell_layers(body: Body) -> bool:
    """Whether the element size alone, not the body's layers, sets the number of cells in depth."""
    is_thin = default_size(body) > body.depth / 2  # and has two layers in any case
    return body.of_kind.is_layer and len(body.strata) == 1 and not is_thin


def _layered_size(body: Body, layers: int, near: float) -> float:
    """Return the size in m near a given one for a number of layers of cells in a slab."""
    sizes = (near * 2 ** np.linspace(-1, 1, 101)).tolist()
    return min(sizes, key=lambda h: (abs(cell_layers(body, h) - layers), abs(np.log(h / near))))


def refinement_ratio(body: Body, coarse: Effort, fine: Effort) -> float:
    """Return the refinement ratio of two meshes: that of their elements under the focus for a body
    from a file, whose other elements change little, or the mean ratio of cells along an axis.
    """
    cells = fine.cells / coarse.cells
    if body.file and cells != 1:
        return coarse.h / fine.h
    return float(cells ** (1 / (2 if body.of_kind.is_plate else 3)))


def about_its_rest(scene: Scene, waveforms: Array) -> Array:
    """Return waveforms (t, p), under gravity without their mean, which would hide errors, unless
    nothing else moves the body.
    """
    if not scene.load.gravity:
        return waveforms
    moving = waveforms - waveforms.mean(axis=0)
    still = 1e-6  # of the waveforms: weaker motion about their mean is round-off
    is_still = np.linalg.norm(moving) <= still * np.linalg.norm(waveforms)
    return waveforms if is_still else moving


def quantity_of_interest(prepared: ReducedBody, scene: Scene, response: Response) -> Array:
    """Return the quantity of interest of a reduced body: its waveforms (t, p) or, for an
    unconstrained body, the lines (f, p c) without the mean, because its drift would hide them.
    """
    if scene.body.is_held:
        return about_its_rest(scene, response.values)
    return reduced.oscillating(reduced.components(prepared, *scene.loads)).lines


def above_band(waveforms: Floats, step: float, band: float = DEFAULT.band) -> float:
    """Return the error of waveforms (t, p), sampled at a step in s, due to motion above a band in
    Hz.

    Velocity and acceleration have such a part where a load begins, or jumps, abruptly. In a reduced
    body this part is as large as the true one, but otherwise unrelated. The error is therefore the
    root of twice its share of the energy. A series of cosines continues the record without a jump
    at its ends.
    """
    energy = fft.dct(waveforms, axis=0, norm="ortho") ** 2
    frequencies = np.arange(len(energy)) / (2 * step * len(energy))
    above, whole = energy[frequencies > band].sum(axis=0), energy.sum(axis=0)
    whole = np.maximum(whole, max(NO_MOTION**2 * whole.max(), 1e-300))
    return float(np.sqrt(2 * (above / whole).max()))


def mesh_error(scene: Scene, ratio: float, quantities: tuple[Array, Array]) -> float:
    """Return the error of the second of two meshes with a refinement ratio, from their quantities
    of interest (k, p). If both are the same mesh, it is 1; inf, unknown, for a mesh from a file.
    """
    if ratio == 1:
        return np.inf if scene.body.file else 1.0
    return controller(scene).error(*quantities, ratio)


def enough(scene: Scene, h: float, error: float, tolerance: float) -> float:
    """Return the element size in m that meets a tolerance, given the error at h."""
    body, own = scene.body, controller(scene)
    size = min(h, body.depth if body.of_kind.is_layer else h)
    return own.size(size, max(own.safety * tolerance, error), tolerance)
