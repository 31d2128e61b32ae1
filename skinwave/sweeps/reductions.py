"""Reductions that runs of a sweep share: each body once, and families of bodies together.

Bodies that differ in materials and thicknesses alone are a family, which one reduced-order model
serves (`models.covering`). Each reduction is on two meshes, by which the error of a run is
estimated.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from simple_model import Response, named_lines
from skinwave.bodies.analytic import is_flat_layer, is_laterally_infinite
from skinwave.models import named, parametric
from skinwave.models.covering import Covering, covering, kept_together
from skinwave.models.flat_body import FLAT_BODY
from skinwave.models.free_keys import FreeKey, free_keys, with_values
from skinwave.models.limits import default_model, takes
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import ReducedBody, answer, prepare, reduction_tolerance
from skinwave.planning.assessment import assessed
from skinwave.planning.refinement import compared_with, refined
from skinwave.scene.scene import Body, Load, Reading, Scene
from skinwave.scene.variation import DesignPoint
from skinwave.system.effort import Progress

PER_WORKER = 3  # bodies of a family: of fewer, workers that take one each are done sooner
KEPT = 4  # bodies that a worker caches in memory, on two meshes each
AUDIBLE = 1e-2  # of the strongest line of a load: weaker ones make no scene harder
ROUND_OFF = 1e-9  # of a length

# A body, its probes, what they read, and what pushes it: what a reduction is of.
Solid = tuple[Body, tuple[tuple[float, float], ...], Reading, Load]
Values = tuple[tuple[str, float], ...]  # of free keys
Families = list[tuple[Covering, dict[Solid, Values]]]  # each with the values of its bodies
Spread = Callable[[Callable[[Any], Any], Sequence[Any], Callable[[int, Any], None]], None]


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """The element size in metre that runs share, that of the `coarser` mesh by which the error of
    each is estimated, or the `error` why there is none; and the `family`, if its bodies are reduced
    together, the body that is `meshed`, and the `values` of the one that runs are on.
    """

    h: float = 0.0
    coarser: float = 0.0
    error: str = ""
    family: Covering | None = None
    meshed: Body | None = None
    values: Values = ()


LOST = Mesh(error="its worker was killed each time; give it more memory or larger elements")


def model_of(scene: Scene, asked: str) -> str:
    """The model of a scene: as asked, or the cheapest that leaves nothing out.

    That is the point kernel without a body, the wavenumber integral for a flat body whose sides
    reflect nothing, and else finite elements.
    """
    if asked != "auto":
        return asked
    if not scene.body.of_kind.discretise:
        return "point-kernel"
    is_exact = is_flat_layer(scene.body) and is_laterally_infinite(scene.body)
    return FLAT_BODY.name if is_exact and takes(FLAT_BODY, scene) else default_model(scene)


def solid_of_run(point: DesignPoint, options: SolveOptions) -> Solid | None:
    """Body and probes by which a run shares a reduced body with others, if it does."""
    scene = point.scene
    if (
        scene is None
        or not named(model_of(scene, options.model)).is_reduced
        or not scene.body.of_kind.discretise
    ):
        return None
    return solid_of(scene)


def solid_of(scene: Scene) -> Solid:
    """What a reduction is of."""
    return scene.body, scene.probes, scene.reading, scene.load


def shared_meshes(
    runs: Iterable[DesignPoint],
    options: SolveOptions,
    count: int,
    spread: Spread,
    progress: Progress,
) -> dict[Solid, Mesh]:
    """Mesh of each body that runs share, reduced once; families of bodies together, where they can
    be. `spread` calls a function of items on `count` workers.
    """
    progress("reduce bodies", 0.0)
    hardest: dict[Solid, DesignPoint] = {}
    for point in sorted(runs, key=_highest, reverse=True):
        if solid := solid_of_run(point, options):
            hardest.setdefault(solid, point)

    def meshes(work: Callable[..., Mesh], items: Sequence[Any]) -> list[Mesh]:
        found: dict[int, Mesh] = {}

        def done(k: int, mesh: Mesh) -> None:
            found[k] = mesh
            progress("reduce bodies", len(found) / len(items))

        spread(partial(_tried, work, options), items, done)
        return [found.get(k, LOST) for k in range(len(items))]

    shared = families(hardest, options.tolerance, count)
    found = {
        solid: replace(mesh, values=values)
        for (_, members), mesh in zip(
            shared, meshes(mesh_of_family, [family for family, _ in shared]), strict=True
        )
        for solid, values in members.items()
        if not mesh.error
    }
    alone = {solid: point.scene for solid, point in hardest.items() if solid not in found}
    return found | dict(zip(alone, meshes(mesh_of_body, list(alone.values())), strict=True))


def _highest(point: DesignPoint) -> float:
    """The highest line in Hz of a load that is above -40 dB of its strongest."""
    assert point.scene
    return max(named_lines(point.scene.pressure, AUDIBLE).values(), default=0.0)


def _tried(work: Callable[[SolveOptions, Any], Mesh], options: SolveOptions, item: Any) -> Mesh:
    """Mesh of a body or a family, or the error why there is none, which is that of every run."""
    try:
        return work(options, item)
    except Exception as error:
        return Mesh(error=said(error))


def said(error: Exception) -> str:
    """An error as an entry of the table; its kind, too, where it is not a refusal."""
    text = " ".join(str(error).split())
    refusal = isinstance(error, ValueError | ArithmeticError) and text
    return text if refusal else f"{type(error).__name__}: {text}"


def mesh_of_body(options: SolveOptions, scene: Scene) -> Mesh:
    """The mesh that the hardest scene of a body requires; cached on disk for all workers."""
    if not options.h:
        found = refined(scene, scene.body, options)
        return Mesh(h=found.h, coarser=found.compared)
    _both(solid_of(scene), options, Mesh(h=options.h, coarser=options.h))  # refuses what has none
    mesh = Mesh(h=options.h, coarser=compared_with(scene.body, options.h))
    _both(solid_of(scene), options, mesh)
    return mesh


def mesh_of_family(options: SolveOptions, family: Covering) -> Mesh:
    """Mesh of a family: of the size that is asked for, or that its hardest scene requires; raises a
    ValueError if its bodies cannot be reduced together.
    """
    size = options.h or refined(family.scene, family.hardest, options).h
    bodies = kept_together(family, size, options.tolerance, options.solver).bodies
    meshed = bodies.body(bodies.meshed)
    coarser = compared_with(meshed, size)
    kept_together(family, coarser, options.tolerance, options.solver)
    return Mesh(h=size, coarser=coarser, family=family, meshed=meshed)


def on_mesh(scene: Scene, options: SolveOptions, mesh: Mesh) -> tuple[Response, Mesh]:
    """Response of a reduced body, with its expected relative error, and the mesh that it is on: the
    body's own where that of its family is too coarse.
    """
    if mesh.error:
        raise ValueError(mesh.error)
    fine, coarse = _both(solid_of(scene), options, mesh)
    how = SolveOptions(tolerance=options.tolerance, h=mesh.h, solver=options.solver)
    response = assessed(
        scene, answer(fine, scene), fine, how, compared=(mesh.coarser, coarse), meshed=mesh.meshed
    )
    is_shared = mesh.family and not options.h
    if is_shared and response.expected_error > options.tolerance:
        return on_mesh(scene, options, _tried(mesh_of_body, options, scene))
    return response, mesh


def _both(solid: Solid, options: SolveOptions, mesh: Mesh) -> list[ReducedBody]:
    """Reduced body of runs on both meshes."""
    return [
        prepared(solid, h, options.tolerance, options.solver, mesh.family, mesh.values)
        for h in (mesh.h, mesh.coarser)
    ]


@lru_cache(maxsize=2 * KEPT)  # a worker meets the same bodies again and again
def prepared(
    solid: Solid, h: float, tolerance: float, solver: str, family: Covering | None, values: Values
) -> ReducedBody:
    """Reduced body with elements of h in metre; of a family the one with these values."""
    if family:
        return parametric.at(kept_together(family, h, tolerance, solver), dict(values))
    body, probes, reading, load = solid
    return prepare(
        body, np.array(probes), h=h, solver=solver, tolerance=reduction_tolerance(tolerance),
        reading=reading, load=load,
    )  # fmt: skip


def families(hardest: Mapping[Solid, DesignPoint], tolerance: float, workers: int = 1) -> Families:
    """Families of bodies, each with the run of the highest line, and the values of their bodies: of
    many thicknesses where these pay, else of one each.
    """
    found: Families = []
    for moving in (True, False):
        shared = {solid for _, members in found for solid in members}
        groups: dict[tuple[Any, ...], dict[Solid, DesignPoint]] = {}
        left = {solid: point for solid, point in hardest.items() if solid not in shared}
        limits = _limits(left.values())
        for solid, point in left.items():
            if keys := _free(solid[0], point, limits, moving=moving):
                assert point.before
                rest = with_values(point.before.body, keys, {key.key: key.low for key in keys})
                groups.setdefault((keys, rest, *solid[1:]), {})[solid] = point
        for (keys, *_), members in groups.items():
            if len(members) >= PER_WORKER * workers:
                found += _family(members, keys, tolerance)
    return found


def _limits(points: Iterable[DesignPoint]) -> dict[str, tuple[float, float]]:
    """Least and largest values of numbers of a body that are varied."""
    found: dict[str, set[float]] = {}
    for point in points:
        for key, value in point.varied.items():
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if key.startswith("body.") and is_number:
                found.setdefault(key, set()).add(float(value))
    return {key: (min(each), max(each)) for key, each in found.items() if len(each) > 1}


def _free(
    body: Body, point: DesignPoint, limits: Mapping[str, tuple[float, float]], *, moving: bool
) -> tuple[FreeKey, ...]:
    """Varied keys that can be free of what a body is before factors on its materials, those that
    move a mesh only if they may; none if the body is not as they say.
    """
    if not point.before:
        return ()
    before = point.before.body

    def accepted(free: Mapping[str, tuple[float, float]]) -> tuple[FreeKey, ...]:
        try:
            return free_keys(before, free)
        except ValueError:
            return ()

    alone = [key for k in point.varied if k in limits for key in accepted({k: limits[k]})]
    keys = accepted({key.key: limits[key.key] for key in alone if moving or not key.moves})
    if not keys:
        return ()
    own = with_values(before, keys, dict(_values(point, keys)))
    alike = np.allclose(own.thicknesses, body.thicknesses, ROUND_OFF, 0)
    return keys if own.solids == body.solids and alike else ()


def _family(
    members: Mapping[Solid, DesignPoint], keys: Sequence[FreeKey], tolerance: float
) -> Families:
    """The family of bodies that differ in keys, if they can be reduced together."""
    limits = _limits(members.values())
    fixed = [key.key for key in keys if key.is_scale and key.key not in limits]
    keys = [key for key in keys if key.key in limits]
    hardest = max(members.values(), key=_waves_per_metre)
    # A factor that all share is not free, and a scene before factors lacks it.
    if not (hardest.before and hardest.scene) or any(hardest.varied[key] != 1 for key in fixed):
        return []
    free = {key.key: limits[key.key] for key in keys}
    family = covering(hardest.before, free, len(members), tolerance, hardest.scene.body)
    values = {solid: _values(point, keys) for solid, point in members.items()}
    return [(family, values)] if family else []


def _waves_per_metre(point: DesignPoint) -> float:
    """Of the highest line that counts, on the body as if it were infinite."""
    assert point.scene
    f, body = _highest(point), point.scene.body
    return f / body.of_kind.wave_speed(body, f) if f else 0.0


def _values(point: DesignPoint, keys: Iterable[FreeKey]) -> Values:
    return tuple((key.key, float(point.varied[key.key])) for key in keys)
