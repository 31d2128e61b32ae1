"""Surfaces of a page: maps of bodies and of the kernel, and views of all at the same times."""

from collections.abc import Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace

import numpy as np

from skinwave.models import named
from skinwave.models.flat_body import FLAT_BODY
from skinwave.models.limits import takes
from skinwave.models.options import SolveOptions
from skinwave.models.point_kernel import SAME_LOAD
from skinwave.planning.plan import plan
from skinwave.planning.simulate import solve_as_planned
from skinwave.results.playback import played_part
from skinwave.results.run import Run
from skinwave.results.surface import element_map, grid, map_motions
from skinwave.results.views import View, body_view, flat_view, kernel_view
from skinwave.scene.scene import Scene, body_name, with_body
from skinwave.studies import first_screen
from skinwave.studies.assumptions import infinite
from skinwave.studies.first_screen import Maps, first_tacton, has_quick_map
from skinwave.system.effort import silent
from skinwave.system.failures import or_failed

Playback = tuple[float, int]  # the duration in s and the number of frames that a view shows


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """Motion of a surface under one Tacton: maps of the body and of the kernel, and a view."""

    maps: Maps = ()
    view: View | None = None


Surfaces = dict[tuple[str, str], Surface]  # by Tacton and column
Found = tuple[Surfaces, dict[str, str]]  # and the reasons of failed parts


def quick_surface(run: Run, part: Playback | None) -> Found:
    """Return the map of a body whose surface needs no mesh, a view of the `part`, and failures."""
    failures: dict[str, str] = {}
    surface, body = Surface(), run.scene.body
    with or_failed(failures, f"map of {run.column}"):
        surface = Surface(maps=first_screen.quick_maps(run))
        if part and surface.maps:
            reach = np.array([body.width, body.height]) / 2
            surface = replace(surface, view=flat_view(run, reach, part))
    return {(run.tacton, run.column): surface}, failures


def element_surfaces(
    column: str, scenes: Mapping[str, Scene], options: SolveOptions, part: Playback
) -> Found:
    """Return the maps of one meshed body under all Tactons, a view of the first, and failures."""
    names, failures = {scene: name for name, scene in scenes.items()}, dict[str, str]()
    surfaces: Surfaces = {}
    with or_failed(failures, f"map of {column}"):
        for scene, motion in map_motions(list(scenes.values()), options):
            view, name = None, names[scene]
            if name == first_tacton(scenes):
                view = replace(body_view(scene, column, motion, part), moved=None)
            own = element_map(scene, motion, *grid(scene))
            maps = first_screen.beside_kernel(scene, own)
            surfaces[name, column] = Surface(maps=maps, view=view)
    return surfaces, failures


def begin_surface(scene: Scene, options: SolveOptions, workers: Executor) -> "Future[Found] | None":
    """Begin the surface of a body of elements in a process, beside its response.

    Returns None if the surface needs no mesh or cannot be drawn.
    """
    has_motion = options.model == "auto" or named(options.model).needs_body
    is_drawn = scene.body.of_kind.discretise and has_motion and scene.load.is_plain
    if not is_drawn or has_quick_map(scene):
        return None
    silently, part = replace(options, progress=silent), played_part(scene.pressure)
    own = {scene.name: scene}
    return workers.submit(element_surfaces, body_name(scene.body), own, silently, part)


def views_of(scenes: Mapping[str, Scene], surfaces: Surfaces) -> list[View]:
    """Return the views of the kernel and of bodies under one Tacton, with its scenes by column."""
    views = {view.column: view for each in surfaces.values() if (view := each.view)}
    own = [views[column] for column in scenes if column in views]
    if not own:
        return []
    reach = np.max([np.abs(view.places).max(axis=0) for view in own], axis=0)
    kernel = scenes[SAME_LOAD.name]
    return [kernel_view(kernel, reach, played_part(kernel.pressure)), *own]


def flat_run(name: str, scene: Scene, options: SolveOptions) -> Run | None:
    """Return the run of an infinite slab with the strata of a body under the focus, or None if the
    wavenumber integral cannot compute it.
    """
    flat = with_body(scene, infinite(scene, scene.body))
    if not takes(FLAT_BODY, flat):
        return None
    response = solve_as_planned(flat, plan(flat, replace(options, model=FLAT_BODY.name)))
    return Run(tacton=name, body="flat slab", scene=flat, response=response)
