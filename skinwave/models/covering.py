"""Bodies that share one reduction: one decision for sweeps, samples and fits.

A parametric reduced-order model (`parametric`) serves all bodies of a scene that differ in
materials and thicknesses within ranges. It costs some factorisations and many vectors, and pays for
itself from a number of bodies on.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import fem
from skinwave.models import parametric
from skinwave.models.free_keys import check_scene, free_keys
from skinwave.models.options import SolveOptions
from skinwave.models.parametric import ParametricBody
from skinwave.scene.scene import Body, Scene

# Bodies for each key that is free, and for a thickness that moves the mesh: fewer cost less alone.
LEAST, THICKNESS = 6, 15
SHARE = 1 / 5  # of a tolerance: that of the reduced-order model


@dataclass(frozen=True, kw_only=True)
class Covering:
    """Bodies that one reduced-order model serves: of a `scene` whose body's keys are free within
    `ranges`, each a key, its least and its largest value; how many `members` there are, and the
    `hardest` body, that with the shortest waves.
    """

    scene: Scene
    ranges: tuple[tuple[str, float, float], ...]
    members: int
    hardest: Body

    def has(self, values: Mapping[str, float]) -> bool:
        """Whether the body of values by key is one of these."""
        return all(low <= values[key] <= high for key, low, high in self.ranges)


def covering(
    scene: Scene,
    free: Mapping[str, tuple[float, float]],
    members: int,
    tolerance: float = 0.05,
    hardest: Body | None = None,
) -> Covering | None:
    """Bodies of a scene for one reduction; None if there are too few `members` for it to cost less
    than one for each, or no affine sum gives them.

    `free` has the least and largest value of each key, in the file's unit; `tolerance` is the
    relative error that responses may have; `hardest` the body with the shortest waves, by default
    that of the scene.
    """
    plain = replace(scene, spreads=())
    try:
        keys = free_keys(plain.body, free)
        check_scene(plain, keys, tolerance)
    except ValueError:
        return None
    if members < sum(THICKNESS if key.moves else LEAST for key in keys):
        return None
    ranges = tuple((key, *ends) for key, ends in free.items())
    return Covering(scene=plain, ranges=ranges, members=members, hardest=hardest or plain.body)


def reduce_together(found: Covering, options: SolveOptions) -> ParametricBody:
    """Reduced-order model of all bodies; raises if the ranges are too wide for one."""
    free = {key: (low, high) for key, low, high in found.ranges}
    within = min(parametric.TOLERANCE, SHARE * options.tolerance)
    return parametric.prepare(
        found.scene, free, within, options.progress, h=options.h, solver=options.solver
    )


@lru_cache(maxsize=4)
def kept_together(found: Covering, h: float, tolerance: float, solver: str) -> ParametricBody:
    """The same, of which a process keeps the last few."""
    return reduce_together(found, SolveOptions(h=h, tolerance=tolerance, solver=solver))


def tried_together(found: Covering | None, options: SolveOptions) -> ParametricBody | None:
    """The same; None without a covering, or if its ranges are too wide for one model."""
    try:
        return reduce_together(found, options) if found else None
    except (ValueError, fem.Diverged):
        return None
