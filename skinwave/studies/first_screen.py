"""Effect of propagation on the Tactons of a page, with maps of the Tacton on its first screen."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING

from skinwave.models import named
from skinwave.models.limits import takes
from skinwave.models.options import SolveOptions
from skinwave.models.plate_modes import FROM_REST
from skinwave.models.point_kernel import PUBLISHED, SAME_LOAD
from skinwave.planning.budget import ErrorBudget, error_budget
from skinwave.planning.simulate import compute
from skinwave.results import surface
from skinwave.results.propagation import Propagation, added_lines, propagation, share_outside
from skinwave.results.run import Run
from skinwave.results.surface import SurfaceField, has_wavenumber_integral, kernel_map
from skinwave.results.views import View
from skinwave.scene import paper15
from skinwave.scene.keys import SCALES
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import spreads_of
from skinwave.scene.variation import with_values

if TYPE_CHECKING:
    from skinwave.report.maps import MeasuredPlaces

Maps = tuple[SurfaceField, SurfaceField] | tuple[()]  # of a body and of the kernel


@dataclass(frozen=True, kw_only=True, eq=False)
class FirstScreen:
    """Results on the first screen of a page.

    Runs, maps by column and views are those of one Tacton. `kernel` has the load of the bodies.

    Parameters
    ----------
    effects : effects of propagation by Tacton and column
    added : by column, lines that a stretching sheet adds to those of its load in any Tacton
    checks : by column, runs of the flat slab that is as deep as a body under the focus
    shares : smallest and largest share outside over the range of materials, if known
    budget : error budget of `body`, if known
    measured : measured places, if any
    """

    kernel: Run
    published: Run
    bodies: Sequence[Run]
    effects: Mapping[str, Mapping[str, Propagation]]
    maps: Mapping[str, SurfaceField] = field(default_factory=dict)
    views: Sequence[View] = ()
    added: Mapping[str, Sequence[str]] = field(default_factory=dict)
    checks: Mapping[str, Run] = field(default_factory=dict)
    shares: tuple[float, float] | None = None
    budget: ErrorBudget | None = None
    measured: "MeasuredPlaces | None" = None

    @property
    def body(self) -> Run:
        """The body of the verdict: skin, if present."""
        skin = [run for run in self.bodies if run.scene.body.is_skin]
        return (skin or list(self.bodies))[-1]

    @property
    def own(self) -> Mapping[str, Propagation]:
        """Effects of propagation on the Tacton of the runs, by column."""
        return self.effects[self.kernel.tacton]


def effects_of(
    groups: Mapping[str, Sequence[Run]], maps_of: Callable[[Run], Maps]
) -> dict[str, dict[str, Propagation]]:
    """Return the effect of propagation by Tacton and column, from maps if they are known."""
    effects: dict[str, dict[str, Propagation]] = {}
    for name, group in groups.items():
        if kernel := _run_of(group, SAME_LOAD.name):
            for run in filter(lambda each: each.is_motion, group):
                own = propagation(run, kernel, *maps_of(run))
                effects.setdefault(name, {})[run.column] = own
    return effects


def first_screen(
    groups: Mapping[str, Sequence[Run]],
    maps_of: Callable[[Run], Maps],
    views: Sequence[View] = (),
    checks: Mapping[str, Run] | None = None,
) -> FirstScreen | None:
    """Return the first screen, or None unless a body and both kernels were run."""
    group = groups.get(first_tacton(groups), [])
    kernel, published = _run_of(group, SAME_LOAD.name), _run_of(group, PUBLISHED.name)
    bodies = [run for run in group if run.is_motion]
    if kernel is None or published is None or not bodies:
        return None
    maps: dict[str, SurfaceField] = {}
    for run in bodies:
        if own := maps_of(run):
            maps |= {kernel.column: own[1], run.column: own[0]}
    first = FirstScreen(
        kernel=kernel, published=published, bodies=bodies, effects=effects_of(groups, maps_of),
        maps=maps, views=views, added=_added(groups), checks=checks or {},
    )  # fmt: skip
    if first.own[first.body.column].strongest is None:
        return first
    scene, error = first.body.scene, first.body.response.expected_error
    return replace(first, shares=_shares(scene), budget=error_budget(scene, error))


def _added(groups: Mapping[str, Sequence[Run]]) -> dict[str, list[str]]:
    """Return the lines that nonlinear bodies add to those of their load, by column."""
    added: dict[str, list[str]] = {}
    for group in groups.values():
        if kernel := _run_of(group, SAME_LOAD.name):
            for run in group:
                if run.is_motion and named(run.model).is_nonlinear:
                    lines = added.setdefault(run.column, [])
                    lines += [name for name in added_lines(run, kernel) if name not in lines]
    return added


def with_kernels(run: Run) -> list[Run]:
    """Return the runs of both point kernels for a body's scene, and the body's run."""
    kernels = [
        Run(tacton=run.tacton, body="none", scene=scene, response=compute(scene, model))
        for model, scene in paper15.beside_kernels(run.scene).items()
    ]
    return [*kernels, run]


def has_quick_map(scene: Scene) -> bool:
    """Whether the map of a body's surface needs no mesh."""
    return scene.reading.is_plain and (has_wavenumber_integral(scene) or takes(FROM_REST, scene))


def quick_maps(run: Run) -> Maps:
    """Return the maps of a body and of the kernel if they need no mesh."""
    if not has_quick_map(run.scene):
        return ()
    return beside_kernel(run.scene, _meshless_map(run.scene, run.model))


def beside_kernel(scene: Scene, own: SurfaceField) -> tuple[SurfaceField, SurfaceField]:
    """Return the map of a body and that of the kernel under its load, at the same places."""
    return own, kernel_map(scene.pressure, own.x, own.y)


def first_tacton(names: Iterable[str]) -> str:
    """Return the name of the Tacton on the first screen."""
    names = list(names)
    preferred = "am140-stm20"  # the paper's Tacton with both modulations in the middle
    return preferred if preferred in names else (names or [""])[0]


@lru_cache(maxsize=16)  # several parts of a page show the same scenes
def _meshless_map(scene: Scene, model: str = "auto") -> SurfaceField:
    return surface.body_map(scene, *surface.grid(scene), SolveOptions(model=model))


def _run_of(group: Sequence[Run], model: str) -> Run | None:
    return next((run for run in group if run.model == model), None)


def _shares(scene: Scene) -> tuple[float, float] | None:
    """Return the smallest and largest share outside the kernel's region over the 90 % intervals of
    moduli and losses of all materials, or None if none is uncertain.
    """
    ends = (0.05, 0.95)
    spreads = [each for each in spreads_of(scene) if each.part == "material"]
    if not spreads or not has_wavenumber_integral(scene):
        return None
    scenes = [scene]
    for scale, end in product(SCALES, ends):
        values = {
            each.key: float(each.distribution.quantile(each.value, end))
            for each in spreads
            if each.key.endswith(scale)
        }
        scenes += [with_values(scene, values)] * bool(values)
    kernel = kernel_map(scene.pressure, *surface.grid(scene)).rms
    shares = [share_outside(kernel, _meshless_map(each).rms) for each in scenes]
    return min(shares), max(shares)
