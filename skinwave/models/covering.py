"""Bodies that share one reduction: one decision for sweeps, samples and fits.

A parametric reduced-order model (`parametric`) serves all bodies of a scene whose materials and
thicknesses lie within ranges. It costs some factorisations and many vectors, so that it is
worthwhile only for many bodies.
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

# Fewest bodies for each free key: a material, or a thickness that moves the mesh.
FEWEST = {"material": 6, "thickness": 15}


@dataclass(frozen=True, kw_only=True)
class Covering:
    """Bodies that share a reduced-order model: `members` of them, those of a `scene` with free keys
    within `ranges` (key, lowest, highest value). The `hardest` has the shortest waves.
    """

    scene: Scene
    ranges: tuple[tuple[str, float, float], ...]
    members: int
    hardest: Body

    def has(self, values: Mapping[str, float]) -> bool:
        """Whether the ranges include the body with these values by key."""
        return all(low <= values[key] <= high for key, low, high in self.ranges)


def covering(
    scene: Scene, free: Mapping[str, tuple[float, float]], members: int, tolerance: float = 0.05,
    hardest: Body | None = None,
) -> Covering | None:  # fmt: skip
    """Return the bodies of a scene that share a reduction; None if separate reductions of `members`
    bodies cost less, or if the keys cannot be free.

    `free` has the lowest and highest value of each key, in the unit of the file. The `hardest`
    body, with the shortest waves, is that of the scene by default.
    """
    plain = replace(scene, spreads=())
    try:
        keys = free_keys(plain.body, free)
        check_scene(plain, keys, tolerance)
    except ValueError:
        return None
    if members < sum(FEWEST["thickness" if key.moves else "material"] for key in keys):
        return None
    ranges = tuple((key, *ends) for key, ends in free.items())
    return Covering(scene=plain, ranges=ranges, members=members, hardest=hardest or plain.body)


def shared_body(bodies: Covering, options: SolveOptions) -> ParametricBody:
    """Return the reduced-order model of all bodies, or raise if their ranges are too wide."""
    free = {key: (low, high) for key, low, high in bodies.ranges}
    within = min(0.01, options.tolerance / 5)
    return parametric.prepare(
        bodies.scene, free, within, options.progress, h=options.h, solver=options.solver
    )


@lru_cache(maxsize=4)
def cached_shared_body(bodies: Covering, h: float, tolerance: float, solver: str) -> ParametricBody:
    """Return the same; each process keeps the last few."""
    return shared_body(bodies, SolveOptions(h=h, tolerance=tolerance, solver=solver))


def try_shared_body(bodies: Covering | None, options: SolveOptions) -> ParametricBody | None:
    """Return the same; None if there are no bodies or their ranges are too wide."""
    try:
        return shared_body(bodies, options) if bodies else None
    except (ValueError, fem.Diverged):
        return None
