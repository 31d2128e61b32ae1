"""Cache of reduced bodies on disk, for all processes of a machine."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar

import numpy as np
from scipy import sparse

from meshes import cache
from meshes.records import decode, encode
from simple_model import Effort, MovingPressure
from simple_model.load.path_cells import path_samples
from skinwave.bodies.build import Build
from skinwave.models.options import DEFAULT, solver_name
from skinwave.scene.load import PRESSURE, Load
from skinwave.scene.scene import Body
from skinwave.system.effort import Clock, one_thread, versions
from skinwave.typing import Floats

T = TypeVar("T")


def cached_record(name: str, clock: Clock, make: Callable[[], T]) -> T:
    """Return the record cached under a name, or make and cache it if all its numbers are finite."""
    record = None
    other_version = suppress(ImportError, KeyError, TypeError, ValueError)  # of skinwave
    with clock("read from cache"), other_version:
        record = decode(entry["meta"], entry) if (entry := cache.load(name)) else None
    if record is None:
        with one_thread():  # a second thread saves a tenth of the time, and rounds differently
            record = make()
        arrays: dict[str, np.ndarray] = {}
        cache.store(name, encode(record, arrays), arrays)
    return record


def cache_key(
    body: Body, build: Build, probes: Floats, solver: str, tolerance: float, *,
    outputs: sparse.csr_array | None, load: Load = PRESSURE, path: str = "",
    band: float = DEFAULT.band,
) -> str:  # fmt: skip
    """Return the cache key of everything that a reduced body depends on; `outputs` (p c, 3 n) are
    None for normal motion at the surface.
    """
    mesh = build.mesh
    # A file may name other facets of the same mesh as its top, or fix others.
    facets = [mesh.facets[name] for name in ("top", *build.fixed)]
    support = tuple(vars(build.support).values()) if build.support else ()
    # Of the support motion a reduced body depends on the direction alone.
    direction = load.support_motion.unit if load.support_motion else ()
    read = () if outputs is None else (outputs.data, outputs.indices, outputs.indptr)
    version = "reduced 13"  # of a cached body
    return cache.key(
        version, *Effort.__dataclass_fields__, body, mesh.points, mesh.tets, mesh.region, *facets,
        build.material, build.symmetry, build.fixed, build.absorbing, build.coat, build.drag,
        build.held, build.tension, *support, probes, band, tolerance, solver_name(solver),
        versions(), *read, replace(load, support_motion=None), direction, path,
    )  # fmt: skip


def path_key(pressure: MovingPressure) -> str:
    """Return what identifies the path of a focus and its spot."""
    return cache.digest(path_samples(pressure).round(9), pressure.profile, pressure.height)
