"""Stiffness of a sheet beyond that of an isotropic solid: orthotropy and in-plane tension.

    K_ab,ij += int (Q - Q_iso)_kl,mn N_a,l N_b,n dV       on the in-plane strains alone
    K_ab,ij += n_i n_j int (T_k / h) N_a,k N_b,k dV       k along the sides x and y of the sheet

Plane stress relaxes the stress across the sheet with D_zz and D_z,kl alone, which are those of the
isotropic mean, so Q is the plane stress stiffness of the sum. Tension acts on the slopes of the
normal displacement alone, because the thicker sheet of the mesh is too soft in its plane. (Reddy,
Mechanics of Laminated Composite Plates and Shells (2004), chapters 1 and 3.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from fem.geometry import gradient_integrals
from fem.sparsity import UPPER, SparsityPattern
from meshes import TetMesh
from simple_model.layers.material import Material
from simple_model.typing import Floats

SIDES = np.eye(3)[:2]  # unit vectors (2, 3) along the sides x and y of a sheet that lies flat


@dataclass(frozen=True, kw_only=True)
class Tension:
    """Uniform in-plane tension of a sheet, `x` and `y` in N/m along its sides, without loss."""

    x: float
    y: float


def directional_parts(materials: Sequence[Material]) -> dict[int, Floats]:
    """Return the orthotropic part (3, 3) in Pa of the plane stress stiffness by material index."""
    return {
        m: solid.plane_stress - replace(solid, orthotropy=None).plane_stress
        for m, solid in enumerate(materials)
        if solid.orthotropy is not None
    }


def orthotropic_stiffness(
    mesh: TetMesh, pattern: SparsityPattern, added: Floats, axes: Floats
) -> sparse.bsr_array:
    """Return the stiffness (3 n, 3 n) in N/m that `added` (3, 3) in Pa gives the strains xx, yy and
    2 xy along the axes (2, 3) of the sheet.
    """
    x, y = axes
    # 2 u_(x,y) = y . grad u . x + x . grad u . y
    strains = np.array([np.outer(x, x), np.outer(y, y), np.outer(x, y) + np.outer(y, x)])
    by_strain = strains.reshape(3, 9)
    tensor = (by_strain.T @ added @ by_strain).reshape(3, 3, 3, 3)  # (i, k, j, l)

    def coefficients(_: slice, G: Floats) -> Floats:
        return np.array([np.tensordot(tensor[i, :, j], G, 2) for i, j in UPPER])

    return pattern.blocks(gradient_integrals(mesh, coefficients))


def tension_stiffness(
    mesh: TetMesh, pattern: SparsityPattern, tension: Tension, axes: Floats
) -> sparse.bsr_array:
    """Return the geometric stiffness (3 n, 3 n) in N/m of a tension on the normal displacement of a
    sheet of uniform thickness, with axes (2, 3) along its sides.
    """
    normal = np.cross(*axes)
    stress = axes.T @ np.diag([tension.x, tension.y]) @ axes / np.ptp(mesh.points @ normal)
    outer = np.outer(normal, normal)

    def coefficients(_: slice, G: Floats) -> Floats:
        scalar = np.tensordot(stress, G, 2)
        return np.array([outer[i, j] * scalar for i, j in UPPER])

    return pattern.blocks(gradient_integrals(mesh, coefficients))
