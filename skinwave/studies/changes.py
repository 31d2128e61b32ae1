"""Effect of propagation on the Tactons of a page, with maps of the one that is shown first."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING

from skinwave.models.point_kernel import PUBLISHED, SAME_LOAD
from skinwave.planning.budget import ErrorBudget, error_budget
from skinwave.planning.simulate import compute
from skinwave.results.propagation import Propagation, propagation, share_outside
from skinwave.results.run import Run
from skinwave.results.surface import (
    SurfaceField,
    body_map,
    grid,
    has_wavenumber_integral,
    kernel_map,
)
from skinwave.scene import paper15
from skinwave.scene.keys import SCALES
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import spreads_of
from skinwave.scene.variation import with_values

if TYPE_CHECKING:
    from skinwave.report.maps import MeasuredPlaces

OF_MATERIAL, ENDS = "material", (0.05, 0.95)  # part of an uncertainty; its 90 % interval
Drawn = tuple[SurfaceField, SurfaceField] | tuple[()]  # a body's map and the kernel's
FIRST = "am140-stm20"  # of the paper's Tactons, the one with both modulations in the middle


@dataclass(frozen=True, kw_only=True, eq=False)
class Shown:
    """The Tacton of a page's first screen: the kernel as `published` and under the same load, what
    propagation changes and the maps by column, the error budget, the share outside over the range
    of materials, where known, and where was measured, if it was.
    """

    kernel: Run
    published: Run
    bodies: Sequence[Run]
    changes: Mapping[str, Propagation]
    surfaces: Mapping[str, SurfaceField] = field(default_factory=dict)
    shares: tuple[float, float] | None = None
    budget: ErrorBudget | None = None
    measured: "MeasuredPlaces | None" = None

    @property
    def body(self) -> Run:
        """The body that the verdict describes: skin, if there is any."""
        skin = [run for run in self.bodies if run.scene.body.is_skin]
        return (skin or list(self.bodies))[-1]


def changes(groups: Mapping[str, Sequence[Run]]) -> dict[str, dict[str, Propagation]]:
    """Tacton -> body -> effect of propagation, with maps where they cost next to nothing."""
    found: dict[str, dict[str, Propagation]] = {}
    for name, group in groups.items():
        kernel = _by(group, SAME_LOAD.name)
        for run in group if kernel else ():
            if kernel and run.is_motion:
                found.setdefault(name, {})[run.column] = propagation(run, kernel, *quick_maps(run))
    return found


def shown(groups: Mapping[str, Sequence[Run]], maps: Callable[[Run], Drawn]) -> Shown | None:
    """The Tacton of the first screen; None where no body was run beside both kernels."""
    group = groups.get(first_of(groups), [])
    kernel, published = _by(group, SAME_LOAD.name), _by(group, PUBLISHED.name)
    bodies = [run for run in group if run.is_motion]
    if kernel is None or published is None or not bodies:
        return None
    surfaces: dict[str, SurfaceField] = {}
    found: dict[str, Propagation] = {}
    for run in bodies:
        drawn = maps(run)
        if drawn:
            surfaces |= {kernel.column: drawn[1], run.column: drawn[0]}
        found[run.column] = propagation(run, kernel, *drawn)
    first = Shown(
        kernel=kernel, published=published, bodies=bodies, changes=found, surfaces=surfaces
    )
    if found[first.body.column].strongest is None:
        return first
    scene, error = first.body.scene, first.body.response.expected_error
    return replace(first, shares=_shares(scene), budget=error_budget(scene, error))


def beside_kernels(run: Run) -> list[Run]:
    """A body's run after those of both point kernels for the same scene."""
    bare = {"tacton": run.tacton, "body": "none"}
    kernels = [
        Run(**bare, scene=scene, response=compute(scene, model))
        for model, scene in paper15.beside_kernels(run.scene).items()
    ]
    return [*kernels, run]


def quick_maps(run: Run) -> Drawn:
    """A body's map and the kernel's, where the body's costs next to nothing."""
    if not has_wavenumber_integral(run.scene):
        return ()
    surface = _layer_map(run.scene)
    return surface, kernel_map(run.scene.pressure, surface.x, surface.y)


def slow_maps(scene: Scene, h: float | None, solver: str) -> Drawn:
    """A body's map by the modes of a plate or by elements, and the kernel's."""
    x, y = grid(scene)
    return body_map(scene, x, y, h=h, solver=solver), kernel_map(scene.pressure, x, y)


def first_of(names: Iterable[str]) -> str:
    """The Tacton of the first screen, of some by name."""
    names = list(names)
    return FIRST if FIRST in names else (names or [""])[0]


@lru_cache(maxsize=16)  # of a scene and others of its materials, which several parts of a page show
def _layer_map(scene: Scene) -> SurfaceField:
    """Map of a laterally infinite body."""
    return body_map(scene, *grid(scene))


def _by(group: Sequence[Run], model: str) -> Run | None:
    return next((run for run in group if run.model == model), None)


def _shares(scene: Scene) -> tuple[float, float] | None:
    """Least and largest share outside the kernel's region where the moduli of all materials, and
    then their losses, are at both ends of what is known of them; None if none is uncertain.
    """
    spreads = [each for each in spreads_of(scene) if each.part == OF_MATERIAL]
    if not spreads or not has_wavenumber_integral(scene):
        return None
    varied = [scene]
    for scale, end in product(SCALES, ENDS):
        values = {
            each.key: float(each.distribution.quantile(each.value, end))
            for each in spreads
            if each.key.endswith(scale)
        }
        varied += [with_values(scene, values)] * bool(values)
    kernel = kernel_map(scene.pressure, *grid(scene)).rms
    found = [share_outside(kernel, _layer_map(each).rms) for each in varied]
    return min(found), max(found)
