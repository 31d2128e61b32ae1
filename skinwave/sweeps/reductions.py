"""Reductions that runs of a sweep share: each body once, and families of bodies together.

Bodies that differ in materials and thicknesses alone are a family, which one reduced-order model
serves (`models.covering`). Each reduction is on two meshes, by which the error of a run is
estimated.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from simple_model import named_lines
from skinwave.models import parametric
from skinwave.models.covering import Covering, covering, kept_together
from skinwave.models.free_keys import FreeKey, free_keys, with_values
from skinwave.models.options import SolveOptions
from skinwave.models.reduced import ReducedBody, prepare, reduction_tolerance
from skinwave.planning.refinement import compared_with, refined
from skinwave.scene.scene import Body, Load, Reading, Scene
from skinwave.scene.variation import DesignPoint

PER_WORKER = 3  # bodies of a family: of fewer, workers that take one each are done sooner
KEPT = 4  # bodies that a worker caches in memory, on two meshes each
AUDIBLE = 1e-2  # of the strongest line of a load: weaker ones make no scene harder
ROUND_OFF = 1e-9  # of a length

# A body, its probes, what they read, and what pushes it.
Solid = tuple[Body, tuple[tuple[float, float], ...], Reading, Load]
Values = tuple[tuple[str, float], ...]  # of free keys
Families = list[tuple[Covering, dict[Solid, Values]]]  # each with the values of its bodies


@dataclass(frozen=True, kw_only=True)
class ModelOptions:
    """Model, tolerance, element size h in metre and solver of every run, and whether the error of
    runs without a mesh is estimated.
    """

    model: str = "auto"
    tolerance: float = 0.05
    h: float | None = None
    solver: str = "auto"
    is_assessed: bool = True

    def solving(self, model: str = "auto", h: float | None = None) -> SolveOptions:
        """Options of one solution; raises a ValueError if a number is out of range."""
        return SolveOptions(
            model=model, h=h or self.h, tolerance=self.tolerance, solver=self.solver
        )


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


def solid_of(scene: Scene) -> Solid:
    """What a reduction is of."""
    return scene.body, scene.probes, scene.reading, scene.load


def highest(scene: Scene) -> float:
    """The highest line in Hz of a load that is above -40 dB of its strongest."""
    return max(named_lines(scene.pressure, AUDIBLE).values(), default=0.0)


def mesh_of_body(options: ModelOptions, scene: Scene) -> Mesh:
    """The mesh that the hardest scene of a body requires; cached on disk for all workers."""
    if not options.h:
        found = refined(scene, scene.body, options.solving())
        return Mesh(h=found.h, coarser=found.compared)
    prepared(solid_of(scene), options.h, options, None, ())
    coarser = compared_with(scene.body, options.h)
    prepared(solid_of(scene), coarser, options, None, ())
    return Mesh(h=options.h, coarser=coarser)


def mesh_of_family(options: ModelOptions, family: Covering) -> Mesh:
    """Mesh of a family: of the size that is asked for, or that its hardest scene requires.

    Raises
    ------
    ValueError
        If its bodies cannot be reduced together.
    """
    size = options.h or refined(family.scene, family.hardest, options.solving()).h
    bodies = kept_together(family, size, options.tolerance, options.solver).bodies
    meshed = bodies.body(bodies.meshed)
    coarser = compared_with(meshed, size)
    kept_together(family, coarser, options.tolerance, options.solver)
    return Mesh(h=size, coarser=coarser, family=family, meshed=meshed)


@lru_cache(maxsize=2 * KEPT)  # a worker meets the same bodies again and again
def prepared(
    solid: Solid,
    h: float,
    options: ModelOptions,
    family: Covering | None,
    values: Values,
) -> ReducedBody:
    """Reduced body of runs, with elements of h in metre; of a family the one with these values."""
    if family:
        shared = kept_together(family, h, options.tolerance, options.solver)
        return parametric.at(shared, dict(values))
    body, probes, reading, load = solid
    return prepare(
        body, np.array(probes), h=h, solver=options.solver,
        tolerance=reduction_tolerance(options.tolerance), reading=reading, load=load,
    )  # fmt: skip


def families(hardest: Mapping[Solid, DesignPoint], tolerance: float, workers: int = 1) -> Families:
    """Families of the bodies of a sweep: of many thicknesses where these pay, else of one each.

    Parameters
    ----------
    hardest : of each body the run with the highest line
    tolerance : relative error of the runs
    workers : how many bodies are reduced at a time

    Returns
    -------
    each family with the values of its bodies
    """
    found = _families(hardest, tolerance, workers, moving=True)
    shared = {solid for _, members in found for solid in members}
    others = {solid: case for solid, case in hardest.items() if solid not in shared}
    return found + _families(others, tolerance, workers, moving=False)


def _families(
    hardest: Mapping[Solid, DesignPoint], tolerance: float, workers: int, *, moving: bool
) -> Families:
    """Families of bodies, of one thickness each unless their mesh may be `moving`."""
    limits = _limits(hardest.values())
    groups: dict[tuple[Any, ...], dict[Solid, DesignPoint]] = {}
    for solid, case in hardest.items():
        if case.before and (keys := _free(solid[0], case.before.body, case, limits, moving)):
            rest = with_values(case.before.body, keys, {key.key: key.low for key in keys})
            groups.setdefault((keys, rest, *solid[1:]), {})[solid] = case
    return [
        found
        for (keys, *_), members in groups.items()
        if len(members) >= PER_WORKER * workers and (found := _family(members, keys, tolerance))
    ]


def _limits(cases: Iterable[DesignPoint]) -> dict[str, tuple[float, float]]:
    """Least and largest values of numbers of a body that are varied."""
    found: dict[str, set[float]] = {}
    for case in cases:
        for key, value in case.varied.items():
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if key.startswith("body.") and is_number:
                found.setdefault(key, set()).add(float(value))
    return {key: (min(each), max(each)) for key, each in found.items() if len(each) > 1}


def _free(
    body: Body,
    before: Body,
    case: DesignPoint,
    limits: Mapping[str, tuple[float, float]],
    moving: bool,
) -> tuple[FreeKey, ...]:
    """Varied keys that can be free of what a body is before factors on its materials; none if it is
    not as they say.
    """
    ranges = {key: limits[key] for key in case.varied if key in limits}
    alone = {k: _accepted(before, {k: r}) for k, r in ranges.items()}
    keys = _accepted(
        before,
        {k: ranges[k] for k, own in alone.items() if any(moving or not key.moves for key in own)},
    )
    if not keys:
        return ()
    own = with_values(before, keys, dict(_values(case, keys)))
    alike = np.allclose(own.thicknesses, body.thicknesses, ROUND_OFF, 0)
    return keys if own.solids == body.solids and alike else ()


def _accepted(body: Body, free: Mapping[str, tuple[float, float]]) -> tuple[FreeKey, ...]:
    try:
        return free_keys(body, free)
    except ValueError:
        return ()


def _family(
    members: Mapping[Solid, DesignPoint], keys: Iterable[FreeKey], tolerance: float
) -> tuple[Covering, dict[Solid, Values]] | None:
    """Family of bodies that differ in keys; None if they cannot be reduced together."""
    limits = _limits(members.values())
    fixed = [key.key for key in keys if key.is_scale and key.key not in limits]
    keys = [key for key in keys if key.key in limits]
    scenes = [(each, each.scene) for each in members.values() if each.scene]
    case, hardest = max(scenes, key=lambda each: _per_length(each[1]))
    # A factor that all share is not free, and a scene before factors lacks it.
    scene = None if any(case.varied[key] != 1 for key in fixed) else case.before
    free = {key.key: limits[key.key] for key in keys}
    family = scene and covering(scene, free, len(members), tolerance, hardest.body)
    if not family:
        return None
    return family, {solid: _values(case, keys) for solid, case in members.items()}


def _per_length(scene: Scene) -> float:
    """Waves per metre of the highest line that counts, of the body as if it were infinite."""
    f = highest(scene)
    return f / scene.body.of_kind.wave_speed(scene.body, f) if f else 0.0


def _values(case: DesignPoint, keys: Iterable[FreeKey]) -> Values:
    return tuple((key.key, float(case.varied[key.key])) for key in keys)
