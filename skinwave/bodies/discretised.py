"""Mesh of a body before its boundary conditions, and the region of each element by its depth."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse

from fem.boundary import Support
from fem.coat import Coat
from fem.plane_stiffness import Tension
from meshes import TetMesh
from simple_model.layers.material import Material
from skinwave.typing import Bools, Floats

THINNEST = 0.5  # of an element that does not follow layers: the thinnest of them that it resolves
Strata = Sequence[tuple[float, Material]]  # depth in metre where each begins, and its material


@dataclass(frozen=True, kw_only=True, eq=False)
class Discretised:
    """Mesh of a body in its own frame, of 10-node tetrahedra, with facets `top`, and `bottom` and
    `sides` where conditions of these names hold.

    `materials` by region; `coat`: thin layers at the top; `drag`: mass-proportional damping (m,) in
    1/s of the elements of a mesh; `support`: elastic and absorbing support of a mesh; `held`:
    components (n, 3) of its nodes that are held, in place of all of its sides: called with the part
    of the mesh that symmetry leaves. `tension` of a sheet; `stiffener` (3 n, 3 n) in N/m of a
    mesh, as `fem.assemble` takes it.
    """

    mesh: TetMesh
    materials: Sequence[Material]
    coat: Coat | None = None
    drag: Callable[[TetMesh], Floats] | None = None
    support: Callable[[TetMesh], Support] | None = None
    held: Callable[[TetMesh], Bools] | None = None
    tension: Tension | None = None
    stiffener: Callable[[TetMesh], sparse.csr_array] | None = None


Discretise = Callable[[Any, float], Discretised]  # of a body, with elements of a size in metre


def in_layers(mesh: TetMesh, strata: Strata, depths: Floats) -> tuple[TetMesh, list[Material]]:
    """Mesh whose regions are strata, by the depth (m,) of its elements, and the materials."""
    starts, materials = zip(*strata, strict=True)
    region = np.searchsorted(starts[1:], depths, side="right")
    return replace(mesh, region=region), list(materials)
