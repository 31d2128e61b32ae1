"""Effect of propagation on every Tacton of a study, with maps of the one that is shown first."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshes import cache
from simple_model.response import SETTLE
from skinwave.models.point_kernel import PUBLISHED, SAME_LOAD
from skinwave.planning.budget import ErrorBudget, error_budget
from skinwave.planning.simulate import compute
from skinwave.results.outputs import digest
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
from skinwave.scene.scene import Body, Scene
from skinwave.scene.spreads import spreads_of, with_values
from skinwave.system.effort import versions

if TYPE_CHECKING:
    from skinwave.report.maps import MeasuredPlaces

OF_MATERIAL, ENDS = "material", (0.05, 0.95)  # part of an uncertainty; its 90 % interval
Drawn = tuple[SurfaceField, SurfaceField] | tuple[()]  # a body's map and the kernel's
Maps = Callable[[Run], Drawn]
FIRST = ("am140-stm20",)  # of the paper's Tactons, the one with both modulations in the middle


@dataclass(frozen=True, kw_only=True, eq=False)
class Shown:
    """The Tacton of a page's first screen: its kernel as `published` and under the same load, what
    propagation changes by body, the maps by column, the expected relative error and
    the shares of motion outside the kernel's region over the range of materials, where known; and
    where was measured, if it was.
    """

    kernel: Run
    published: Run
    bodies: Sequence[Run]
    changes: Mapping[str, Propagation]
    surfaces: Mapping[str, SurfaceField] = field(default_factory=dict)
    error: float = np.nan
    shares: tuple[float, float] | None = None
    budget: ErrorBudget | None = None
    measured: "MeasuredPlaces | None" = None

    @property
    def body(self) -> Run:
        """The body that the sentences describe: skin, if there is any."""
        skin = [run for run in self.bodies if run.scene.body.is_skin]
        return (skin or list(self.bodies))[-1]


def changes(groups: Mapping[str, Sequence[Run]]) -> dict[str, dict[str, Propagation]]:
    """Tacton -> body -> effect of propagation, with maps where they cost next to nothing."""
    found: dict[str, dict[str, Propagation]] = {}
    for name, group in groups.items():
        kernel, bodies = _kernel(group), [run for run in group if run.is_motion]
        for run in bodies:
            if kernel is not None:
                found.setdefault(name, {})[run.column] = propagation(run, kernel, *quick_maps(run))
    return found


def shown(groups: Mapping[str, Sequence[Run]], maps: Maps) -> Shown | None:
    """The Tacton of the first screen; None where no body was run beside both kernels."""
    group = groups.get(first_of(groups), [])
    kernel, bodies = _kernel(group), [run for run in group if run.is_motion]
    published = next((r for r in group if r.model == PUBLISHED.name), None)
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
    error, scene = _error(first.body), first.body.scene
    return replace(first, error=error, shares=_shares(scene), budget=error_budget(scene, error))


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


@lru_cache(maxsize=16)  # of a scene and others of its materials, which several parts of a page show
def _layer_map(scene: Scene) -> SurfaceField:
    """Map of a laterally infinite body."""
    return body_map(scene, *grid(scene))


def first_of(names: Iterable[str]) -> str:
    """The Tacton of the first screen, of some by name."""
    names = list(names)
    return next((name for name in (*FIRST, *names) if name in names), "")


def content_of(body: Body) -> str:
    """SHA-256 of the file of a body, or "" without one."""
    return digest(Path(body.file)) if body.file else ""


def slow_maps(scene: Scene, h: float | None, solver: str) -> Drawn:
    """A body's map by the modes of a plate or by elements, cached, and the kernel's."""
    x, y = grid(scene)
    below = kernel_map(scene.pressure, x, y)
    name = cache.key(
        "surface", scene.body, content_of(scene.body), scene.pressure, x, y, h, solver, versions()
    )
    names = ("x", "y", "rms", *(("level",) if scene.body.is_skin else ()))
    if (entry := cache.load(name)) is not None:
        arrays = {n: entry[n] for n in names}
        return SurfaceField(**arrays, note=entry["meta"]["note"]), below
    surface = body_map(scene, x, y, h=h, solver=solver)
    cache.store(name, {"note": surface.note}, **{n: getattr(surface, n) for n in names})
    return surface, below


def _kernel(group: Sequence[Run]) -> Run | None:
    return next((run for run in group if run.model == SAME_LOAD.name), None)


def _error(run: Run) -> float:
    """Relative error of the response: as estimated, or the difference of the steady waveform from
    the wavenumber integral's at the worst probe.
    """
    expected = run.response.expected_error
    if np.isfinite(expected) or not has_wavenumber_integral(run.scene):
        return expected
    first = int(SETTLE * len(run.response.times))
    exact = compute(run.scene, "flat-body-harmonic").displacement[first:]
    size = np.linalg.norm(exact - exact.mean(axis=0), axis=0)
    away = run.response.displacement[first:] - exact
    wrong = np.linalg.norm(away - away.mean(axis=0), axis=0) / np.where(size > 0, size, np.inf)
    return float(wrong.max())


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
    x, y = grid(scene)
    kernel = kernel_map(scene.pressure, x, y).rms
    found = [share_outside(kernel, _layer_map(each).rms) for each in varied]
    return min(found), max(found)
