"""Mesh of a body before its boundary conditions, with the region of each element by its depth."""

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

Strata = Sequence[tuple[float, Material]]  # depth in m at which each begins, and its material


@dataclass(frozen=True, kw_only=True, eq=False)
class Discretised:
    """Mesh of a body in its own frame, with the facet sets `top`, `bottom` and `sides`.

    `materials` are those of the regions, `coat` has thin layers at the top, `tension` is that of a
    sheet. The functions take the mesh, halved by symmetry: `drag` returns the damping (m,) in 1/s
    of its elements, `support` its elastic and absorbing support, `held` the fixed components (n, 3)
    of its nodes in place of the sides, and `stiffener` a matrix (3 n, 3 n) in N/m for
    `fem.assemble`.
    """

    mesh: TetMesh
    materials: Sequence[Material]
    coat: Coat | None = None
    drag: Callable[[TetMesh], Floats] | None = None
    support: Callable[[TetMesh], Support] | None = None
    held: Callable[[TetMesh], Bools] | None = None
    tension: Tension | None = None
    stiffener: Callable[[TetMesh], sparse.csr_array] | None = None


Discretise = Callable[[Any, float], Discretised]  # of a body and an element size in m


def in_layers(mesh: TetMesh, strata: Strata, depths: Floats) -> tuple[TetMesh, list[Material]]:
    """Return the mesh with strata as regions, by depths (m,) of elements, and their materials."""
    starts, materials = zip(*strata, strict=True)
    region = np.searchsorted(starts[1:], depths, side="right")
    return replace(mesh, region=region), list(materials)
