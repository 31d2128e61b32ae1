"""Membrane stiffness of a sheet that is a little curved at rest, as a shallow shell.

Of a middle surface that rises by z0(x, y) above its plane, with slopes well below 1, the membrane
strains are (Marguerre, Proc 5th Int Congr Appl Mech (1938))

    e_kl = (u_k,l + u_l,k + z0_,k w_,l + z0_,l w_,k) / 2

so that bending stretches it. The mesh stays flat: bending and mass are those of its elements, and
the strains are those of a membrane in its middle, of the sheet's own thickness, whose deformation
gradient at rest has the slopes of z0. The membrane stiffness of the elements themselves is taken
away: it is that of a flat sheet, which a curled one escapes from.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse

from fem.elements import triangle_rule
from fem.finite_strain import Membrane, membrane_part, tangent_blocks
from fem.sparsity import slabs
from fem.typing import Floats
from meshes import TetMesh


def shell_stiffness(
    mesh: TetMesh,
    membrane: Membrane,
    slopes: Callable[[Floats], Floats],
    *,
    meshed: float = 0.0,
) -> sparse.bsr_array:
    """Membrane stiffness of a shallow shell.

    Parameters
    ----------
    mesh : TetMesh, horizontal
    membrane : Membrane in its middle plane, of the whole membrane stiffness
    slopes : points (..., 2) in metre -> slopes (..., 2) of the middle surface along x and y
    meshed : the part of this stiffness that the elements have as a flat sheet

    Returns
    -------
    (3 n, 3 n) sparse, N/m
    """
    part = membrane_part(mesh, membrane)
    corners = mesh.points[membrane.triangles[:, :3], :2]
    at = np.einsum("qa,eai->eqi", triangle_rule(2)[0], corners)
    flat = np.broadcast_to(np.eye(3)[:2], (*at.shape[:2], 2, 3))
    curved, unstressed = flat.copy(), np.zeros((*at.shape[:2], 2, 2))
    curved[..., 2] = slopes(at)

    def blocks(slab: slice) -> Floats:
        found = (tangent_blocks(part, slab, F[slab], unstressed[slab]) for F in (curved, flat))
        return next(found) - meshed * next(found)

    return part.pattern.blocks((slab, blocks(slab)) for slab in slabs(len(part.nodes)))
