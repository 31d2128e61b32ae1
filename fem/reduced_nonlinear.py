"""Nonlinear reduced-order model of a flat sheet: large deflection in its bending modes z.

    w = shapes z,  M = 1,  energy = z^T K z / 2 + sum_k y_k^2 / 2,  y_k = z^T H_k z / 2

The in-plane motion follows the stretching of bending, e(w, w) = grad w grad w^T / 2, quasi-
statically. The remaining strain is expanded in self-equilibrated states of stress s_k that are
orthonormal in energy; H_k is the geometric stiffness that s_k adds to bending. The in-plane problem
is solved for pairs of modes, and the incompatible strains are decomposed, with the most energetic
states first (implicit condensation: Hollkamp and Gordon, J Sound Vib 318:1139 (2008); von Karman's
equations with Airy's function, Thomas and Bilbao, J Sound Vib 315:569 (2008)).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy import linalg, sparse

from fem.air import Air, damping
from fem.assembly import Operators
from fem.energy import Elastic, Relaxing
from fem.finite_strain import Membrane, Part, losses, membrane_part, spread_stress, stress, tangent
from fem.linear_solver import factorise
from fem.maxwell import maxwell_only
from fem.sheet_reading import SheetReading, modal_slopes
from fem.sparsity import dofs_of, restrict
from fem.static import modes
from meshes import TetMesh
from simple_model.layers.material import Material
from simple_model.typing import Floats, Ints


@dataclass(frozen=True, kw_only=True, eq=False)
class StretchingModes:
    """Modal model of a sheet in coordinates z (r,) in kg^1/2 m: `basis` (3 n, r) in kg^-1/2,
    natural frequencies `hz` (r,), `H` (k, r, r), the truncated share `left_out` of the states of
    stress, and `elastic` for `nonlinear.static` and `nonlinear.dynamic`.
    """

    basis: Floats
    hz: Floats
    H: Floats
    left_out: float
    elastic: Elastic


def stretching_modes(
    mesh: TetMesh,
    operators: Operators,
    membrane: Membrane,
    n: int,
    *,
    air: Air | None = None,
    solver: str = "auto",
    progress: Callable[[float], None] | None = None,
) -> StretchingModes:
    """Reduce a sheet, given by linear operators and its whole membrane, to its n lowest bending
    modes, or in air to combinations of them. Raises Diverged if the modes do not converge.
    """
    hz, shapes = modes(operators, n, solver=solver)
    of_air = np.zeros((n, n))
    if air is not None:  # by the Rayleigh-Ritz method
        mass = np.eye(n) + _project(air.mass, shapes[operators.free])
        squares, turn = linalg.eigh(np.diag((2 * np.pi * hz) ** 2), mass)
        hz, shapes = np.sqrt(squares) / (2 * np.pi), shapes @ turn
        each = {name: _project(R, shapes[operators.free]) for name, R in air.resistances.items()}
        of_air = damping(np.diag((2 * np.pi * hz) ** 2), np.eye(n), each)
    part = membrane_part(mesh, membrane)
    slopes = modal_slopes(part, shapes)
    states, left_out = _states_of_stress(part, operators.free, slopes, hz, solver)
    H = np.empty((len(states), n, n))
    for k, s in enumerate(states):
        H[k] = _geometric_stiffness(part, slopes, s)
        if progress:
            progress(k / len(states))
    modal = Operators(
        K=sparse.diags_array((2 * np.pi * hz) ** 2).tocsr(),
        C=sparse.csr_array(_project(operators.C, shapes[operators.free]) + of_air),
        M=sparse.eye_array(n).tocsr(), R=sparse.csr_array((n, n)), free=np.arange(n), n_dofs=n,
        branches=tuple(
            replace(branch, K=sparse.csr_array(_project(branch.K, shapes[operators.free])))
            for branch in operators.branches
        ),
    )  # fmt: skip
    return StretchingModes(
        basis=shapes, hz=hz, H=H, left_out=left_out,
        elastic=modal_elastic(modal, H, membrane.material),
    )  # fmt: skip


def _project(A: Any, shapes: Floats) -> Floats:
    return np.asarray(shapes.T @ (A @ shapes))


def _geometric_stiffness(part: Part, slopes: Floats, strain: Floats) -> Floats:
    """Return the stiffness (m, m) that the stress of a strain (e, q, k, l) adds to bending modes
    with slopes (e, q, k, m).
    """
    S, m = part.volume[..., None, None] * stress(part, strain), slopes.shape[3]
    return slopes.reshape(-1, m).T @ (S @ slopes).reshape(-1, m)


def modal_elastic(modal: Operators, H: Floats, material: Material) -> Elastic:
    """Return the forces and energy of a sheet in modal coordinates z (r,).

    `modal` has a diagonal K in 1/s2, H (k, r, r) is the geometric stiffness of each state of
    stress, and `material` defines the losses in stretching.
    """
    squares, n = modal.K.diagonal(), len(modal.free)
    stacked, (lag, times, shares) = H.reshape(-1, n), losses(material)
    branches = maxwell_only(modal.branches)

    @lru_cache(maxsize=2)
    def product(z: bytes) -> Floats:
        return (stacked @ np.frombuffer(z)).reshape(-1, n)

    def internal(z: Floats) -> Floats:
        Hz = product(z.tobytes())
        return squares * z + (Hz @ z / 2) @ Hz

    def stiffness(z: Floats) -> sparse.csr_array:
        Hz = product(z.tobytes())
        return sparse.csr_array(np.diag(squares) + np.tensordot(Hz @ z / 2, H, axes=1) + Hz.T @ Hz)

    def viscous(z: Floats, rate: Floats) -> Floats:
        Hz = product(z.tobytes())
        return modal.C @ rate + lag * (Hz @ rate) @ Hz

    def energy(z: Floats) -> float:
        y = product(z.tobytes()) @ z / 2
        return float(squares @ z**2 + y @ y) / 2

    stretched = Relaxing(
        times=times,
        strain=lambda z: product(z.tobytes()) @ z / 2,
        force=lambda z, d: shares @ d @ product(z.tobytes()),
        tangent=lambda z, x: shares @ x * sparse.csr_array(stiffness(z) - modal.K),
        energy=lambda d: shares * (d**2).sum(axis=1) / 2,
    )
    relaxing = ((branches, Relaxing.linear(branches)), (shares.tolist(), stretched))
    return Elastic(
        operators=modal, internal=internal, tangent=stiffness, viscous=viscous, energy=energy,
        relaxing=tuple(part for some, part in relaxing if some),
    )  # fmt: skip


def in_plane_matrices(
    reading: SheetReading,
    basis: Floats,
    rows: sparse.csr_array,
    operators: Operators,
    *,
    solver: str = "auto",
) -> Floats:
    """Return symmetric Q (c, m, m): outputs z^T Q z / 2 of the in-plane motion that follows bending
    modes z of a basis (3 n, m), for `rows` (c, 3 n) that read the middle plane.

    A linear output s v of the in-plane displacement v is -g f(z), with g = K^-1 s and the forces
    f(z) of the stretching e(w, w). It equals -z^T H z / 2, with H for the states of stress of g.
    """
    part = reading.part
    plane, slopes = _Plane.of(part, operators.free, solver), modal_slopes(part, basis)
    matrices = np.empty((rows.shape[0], *(2 * basis.shape[1:])))
    for k, row in enumerate(rows.toarray()):
        matrices[k] = -_geometric_stiffness(part, slopes, plane.strain_under(row))
    return matrices


def _states_of_stress(
    part: Part, free: Ints, slopes: Floats, hz: Floats, solver: str
) -> tuple[Floats, float]:
    """Return strains of energy-orthonormal states of stress, and the truncated share."""
    resonant = 2 * np.pi * 200.0  # rad/s: modes below are weighted equally
    reach = 1 / np.maximum(2 * np.pi * hz, resonant) ** 2
    i, j = np.triu_indices(len(reach))
    pairs = 200  # of modes, for which the in-plane problem is solved
    strongest = np.argsort(-reach[i] * reach[j], kind="stable")[:pairs]
    i, j = i[strongest], j[strongest]
    weight = reach[i] * reach[j] * np.where(i == j, 1, 2)
    incompatible = []
    plane = _Plane.of(part, free, solver)
    for first, second, scale in zip(i, j, weight, strict=True):
        e = slopes[..., :, None, first] * slopes[..., None, :, second] * scale / 2
        incompatible.append(plane.incompatible((e + e.swapaxes(2, 3)) / 2))
    strains = np.array(incompatible)
    stresses = np.array([stress(part, s) * part.volume[..., None, None] for s in strains])
    gram = strains.reshape(len(i), -1) @ stresses.reshape(len(i), -1).T
    squares, vectors = np.linalg.eigh((gram + gram.T) / 2)
    smallest_state = 1e-2  # of the energy norm of the largest
    large = squares > smallest_state**2 * squares.max()
    states = np.tensordot((vectors[:, large] / np.sqrt(squares[large])).T[::-1], strains, axes=1)
    return states, float(np.sqrt(squares[~large].clip(0).sum() / squares.sum()))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Plane:
    """In-plane elastostatics of a membrane."""

    part: Part
    moving: Ints  # of the 3 n components
    solve: Callable[[Floats], Floats]

    @staticmethod
    def of(part: Part, free: Ints, solver: str) -> _Plane:
        n = part.D.shape[1]
        moving = np.intersect1d(dofs_of(np.unique(part.nodes))[:, :2], free)
        K = restrict(tangent(part, np.zeros((n, 3))), moving)
        return _Plane(part=part, moving=moving, solve=factorise(K, backend=solver).solve)

    def strain_under(self, force: Floats) -> Floats:
        """Return the in-plane strain (e, q, k, l) under nodal forces (3 n,) in N."""
        v = np.zeros(force.size)
        v[self.moving] = self.solve(force[self.moving])
        slope = (self.part.D @ v.reshape(-1, 3)[:, :2]).reshape(*self.part.G.shape[:3], 2)
        return (slope + slope.swapaxes(2, 3)) / 2

    def incompatible(self, e: Floats) -> Floats:
        """Return a strain (e, q, k, l) minus that of the in-plane displacement that relieves it."""
        f = np.zeros((self.part.D.shape[1], 3))
        f[:, :2] = spread_stress(self.part, stress(self.part, e))
        return e - self.strain_under(f.ravel())
