"""Reductions that runs of a sweep share: one for each body, or one for a family of bodies.

The bodies of a family differ only in materials and thicknesses, so that one reduced-order model
serves them (`models.covering`). Each reduction is made on two meshes, which give the error of a
run.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from simple_model import Response, named_lines
from skinwave.models import named, parametric
from skinwave.models.covering import Covering, cached_shared_body, covering
from skinwave.models.free_keys import FreeKey, free_keys, with_values
from skinwave.models.options import SolveOptions
from skinwave.models.point_kernel import SAME_LOAD
from skinwave.models.reduced import ReducedBody, answer, reduce_scene
from skinwave.planning.assessment import assess
from skinwave.planning.plan import model_from_rest
from skinwave.planning.refinement import comparison_size, refine
from skinwave.scene.scene import Body, Scene, without_tacton
from skinwave.scene.variation import DesignPoint
from skinwave.system.effort import Progress
from skinwave.system.failures import reason

Values = tuple[tuple[str, float], ...]  # of free keys
# Each with the values of its bodies. A body is a scene `without_tacton`.
Families = list[tuple[Covering, dict[Scene, Values]]]
Limits = Mapping[str, tuple[float, float]]  # least and largest value by key
Done = Callable[[Mapping[int, Any]], None]  # with results by index
Distribute = Callable[[Callable[[Any], Any], Sequence[Any], Done], None]


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """Element sizes in m of the two meshes of a reduction: `h` for its runs, and `coarser` for
    their error; or the `error` that prevented them.

    For a body of a `family`, also the `values` of its free keys.
    """

    h: float = 0.0
    coarser: float = 0.0
    error: str = ""
    family: Covering | None = None
    values: Values = ()


def model_of(scene: Scene, options: SolveOptions) -> str:
    """Return the model from rest of a scene, for "auto" that of its plan."""
    if options.model != "auto":
        return options.model
    moves = scene.body.of_kind.discretise
    return model_from_rest(scene, options)[0].name if moves else SAME_LOAD.name


def reduced_scene(point: DesignPoint, options: SolveOptions) -> Scene | None:
    """Return the scene of a run `without_tacton`, or None if its model reduces no body."""
    scene = point.scene
    if scene and named(model_of(scene, options)).is_reduced and scene.body.of_kind.discretise:
        return without_tacton(scene)
    return None


def shared_meshes(
    runs: Mapping[str, DesignPoint],
    options: SolveOptions,
    count: int,
    distribute: Distribute,
    progress: Progress,
) -> dict[str, Mesh | None]:
    """Reduce each body of the runs once, families of bodies together, and return their meshes.

    Runs on one body follow each other. A run has no mesh if its model reduces no body. `distribute`
    calls a function of items on `count` workers.
    """
    progress("reduce bodies", 0.0)
    subjects = {name: reduced_scene(point, options) for name, point in runs.items()}
    reduced = [(subject, runs[name]) for name, subject in subjects.items() if subject]
    hardest: dict[Scene, DesignPoint] = {}
    for subject, point in sorted(reduced, key=lambda run: _highest_line(run[1]), reverse=True):
        hardest.setdefault(subject, point)

    def meshes_of(work: Callable[..., Mesh], items: Sequence[Any]) -> list[Mesh]:
        made: dict[int, Mesh] = {}

        def done(meshes: Mapping[int, Mesh]) -> None:
            made.update(meshes)
            progress("reduce bodies", len(made) / len(items))

        distribute(partial(_mesh_or_error, work, options), items, done)
        cause = "each worker was killed; provide more memory, or use larger elements"
        return [made.get(k, Mesh(error=cause)) for k in range(len(items))]

    together = families(hardest, options.tolerance, count)
    family_meshes = meshes_of(mesh_of_family, [family for family, _ in together])
    meshes = {
        subject: replace(mesh, values=values)
        for (_, members), mesh in zip(together, family_meshes, strict=True)
        for subject, values in members.items()
        if not mesh.error
    }
    alone = {subject: point.scene for subject, point in hardest.items() if subject not in meshes}
    own_meshes = meshes_of(mesh_of_body, list(alone.values()))
    meshes |= dict(zip(alone, own_meshes, strict=True))
    groups: dict[Scene | None, list[str]] = {}
    for name, each in subjects.items():
        groups.setdefault(each, []).append(name)
    return {n: meshes[each] if each else None for each, names in groups.items() for n in names}


def _highest_line(point: DesignPoint) -> float:
    """Return the highest line of a load in Hz that needs a finer mesh."""
    assert point.scene
    weakest_ratio = 1e-2  # to the strongest line
    return max(named_lines(point.scene.pressure, weakest_ratio).values(), default=0.0)


def _mesh_or_error(
    work: Callable[[SolveOptions, Any], Mesh], options: SolveOptions, item: Any
) -> Mesh:
    """Return the mesh of a body or a family, or the error of every run on it."""
    try:
        return work(options, item)
    except Exception as error:
        return Mesh(error=reason(error))


def mesh_of_body(options: SolveOptions, scene: Scene) -> Mesh:
    """Reduce a body on the mesh for its most demanding scene, cached on disk for all workers."""
    if not options.h:
        pair = refine(scene, scene.body, options)
        return Mesh(h=pair.h, coarser=pair.compared)
    # Raises the error of the given size before that of the coarser mesh.
    _reduce_twice(scene, options, Mesh(h=options.h, coarser=options.h))
    mesh = Mesh(h=options.h, coarser=comparison_size(scene.body, options.h))
    _reduce_twice(scene, options, mesh)
    return mesh


def mesh_of_family(options: SolveOptions, family: Covering) -> Mesh:
    """Reduce a family on the mesh that its most demanding scene needs, unless the size is given;
    raise a ValueError if its bodies cannot be reduced together.
    """
    size = options.h or refine(family.scene, family.hardest, options).h
    bodies = cached_shared_body(family, size, options.tolerance, options.solver).bodies
    coarser = comparison_size(bodies.body(bodies.meshed), size)
    cached_shared_body(family, coarser, options.tolerance, options.solver)
    return Mesh(h=size, coarser=coarser, family=family)


def on_mesh(scene: Scene, options: SolveOptions, mesh: Mesh) -> tuple[Response, Mesh]:
    """Return the response of a reduced body with its expected error, and the mesh.

    A run for which the mesh of its family is too coarse gets a mesh of its own.
    """
    if mesh.error:
        raise ValueError(mesh.error)
    fine, coarse = _reduce_twice(scene, options, mesh)
    how = SolveOptions(tolerance=options.tolerance, h=mesh.h, solver=options.solver)
    response = assess(scene, answer(fine, scene), fine, how, compared=coarse)
    is_shared = mesh.family and not options.h
    if is_shared and response.expected_error > options.tolerance:
        return on_mesh(scene, options, _mesh_or_error(mesh_of_body, options, scene))
    return response, mesh


def _reduce_twice(scene: Scene, options: SolveOptions, mesh: Mesh) -> list[ReducedBody]:
    """Return the reduced body on both meshes."""
    subject = without_tacton(scene)
    return [
        prepare_body(subject, h, options.tolerance, options.solver, mesh.family, mesh.values)
        for h in (mesh.h, mesh.coarser)
    ]


@lru_cache(maxsize=8)  # four bodies on two meshes
def prepare_body(
    subject: Scene, h: float, tolerance: float, solver: str, family: Covering | None, values: Values
) -> ReducedBody:
    """Return a reduced body with elements of h in m; in a family, the one with these values."""
    if family:
        return parametric.at(cached_shared_body(family, h, tolerance, solver), dict(values))
    return reduce_scene(subject, SolveOptions(h=h, tolerance=tolerance, solver=solver))


def families(
    hardest: Mapping[Scene, DesignPoint], tolerance: float, workers: int = 1, *, per_worker: int = 3
) -> Families:
    """Group bodies into families, given the run with the highest line of each body.

    A family has many thicknesses if this saves time, otherwise one. Fewer bodies than `per_worker`
    for each worker are faster alone.
    """
    found: Families = []
    for moving in (True, False):
        shared = {subject for _, members in found for subject in members}
        remaining = {subject: point for subject, point in hardest.items() if subject not in shared}
        limits = _limits(remaining.values())
        groups: dict[tuple[Any, ...], dict[Scene, DesignPoint]] = {}
        for subject, point in remaining.items():
            if keys := _free_keys_of(subject.body, point, limits, moving=moving):
                assert point.before
                rest = with_values(point.before.body, keys, {key.key: key.low for key in keys})
                kind = keys, rest, subject.probes, subject.reading, subject.load
                groups.setdefault(kind, {})[subject] = point
        for (keys, *_), members in groups.items():
            if len(members) >= per_worker * workers:
                found += _family(members, keys, tolerance)
    return found


def _limits(points: Iterable[DesignPoint]) -> Limits:
    """Return the lowest and the highest value of each varied number of a body."""
    values: dict[str, set[float]] = {}
    for point in points:
        for key, value in point.varied.items():
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if key.startswith("body.") and is_number:
                values.setdefault(key, set()).add(float(value))
    return {key: (min(each), max(each)) for key, each in values.items() if len(each) > 1}


def _free_keys_of(
    body: Body, point: DesignPoint, limits: Limits, *, moving: bool
) -> tuple[FreeKey, ...]:
    """Return the varied keys that can be free in a family, with those that move a mesh if `moving`.

    Returns none unless these keys explain all differences between the bodies.
    """
    if not point.before:
        return ()
    before = point.before.body

    def accepted(free: Limits) -> tuple[FreeKey, ...]:
        try:
            return free_keys(before, free)
        except ValueError:
            return ()

    alone = [key for k in point.varied if k in limits for key in accepted({k: limits[k]})]
    keys = accepted({key.key: limits[key.key] for key in alone if moving or not key.moves})
    if not keys:
        return ()
    own = with_values(before, keys, dict(_values(point, keys)))
    alike = np.allclose(own.thicknesses, body.thicknesses, rtol=1e-9, atol=0)
    return keys if own.solids == body.solids and alike else ()


def _family(
    members: Mapping[Scene, DesignPoint], keys: Sequence[FreeKey], tolerance: float
) -> Families:
    """Return the family of bodies that differ in keys, if they can be reduced together."""
    limits = _limits(members.values())
    fixed = [key.key for key in keys if key.is_scale and key.key not in limits]
    keys = [key for key in keys if key.key in limits]
    hardest = max(members.values(), key=_waves_per_metre)
    # A factor that all bodies share is not free, and the scene before factors does not include it.
    if not (hardest.before and hardest.scene) or any(hardest.varied[key] != 1 for key in fixed):
        return []
    free = {key.key: limits[key.key] for key in keys}
    family = covering(hardest.before, free, len(members), tolerance, hardest.scene.body)
    values = {subject: _values(point, keys) for subject, point in members.items()}
    return [(family, values)] if family else []


def _waves_per_metre(point: DesignPoint) -> float:
    """Return the inverse wavelength of the highest line on the body, without its sides."""
    assert point.scene
    f, body = _highest_line(point), point.scene.body
    return f / body.of_kind.wave_speed(body, f) if f else 0.0


def _values(point: DesignPoint, keys: Iterable[FreeKey]) -> Values:
    return tuple((key.key, float(point.varied[key.key])) for key in keys)
