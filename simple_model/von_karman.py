"""Large deflection of a thin plate in its bending modes: von Karman's plate, reduced.

    w = shapes z,  energy = z^T K z / 2 + sum_k y_k^2 / 2,  y_k = z^T H_k z / 2

A plate that deflects by its thickness stretches. In-plane waves are some hundred times faster than
bending waves, so the in-plane displacement u, v follows the deflection quasi-statically:

    E = e(w, w) + sym grad (u, v),  e(w_i, w_j) = sym (grad w_i grad w_j^T) / 2
    iint N : grad (du, dv) dA = 0,  N = A E

(von Karman 1910; Chia, Nonlinear Analysis of Plates (1980), chapter 1). Ritz's method on continuous
Legendre polynomials solves it for the stretching e of pairs of modes. Where supports hold the plate
in its plane the polynomials are zero; at free edges the energy makes N n = 0. What remains of the
strain is expanded in states of stress that are orthonormal in energy, the most energetic first, and
H_k is the stiffness that the k-th state adds to bending. The energy of stretching, of fourth order
in z, is thereby a sum of squares (with Airy's function: Thomas and Bilbao, J Sound Vib 315:569
(2008); Ducceschi and Touze, J Sound Vib 344:313 (2015)).

Few modes stretch the plate; the others are as stiff as at rest. `karman_motion` computes deflection
and motion.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg

from simple_model.choices import choose
from simple_model.material import Floats
from simple_model.plate_modes import Plate, PlateModes, outside_clips
from simple_model.polynomials import LineBasis, continuous_basis

# Whether an edge that is supported holds the in-plane displacement normal to it, and along it.
IN_PLANE = {"held": (True, True), "sliding": (True, False), "movable": (False, False)}
MARGIN = 8  # polynomials beyond those that the products of two modes require
BESIDE = 4  # the same on a piece between the sides of clips
MOST_PAIRS = 500  # of modes, from which states of stress are made
EQUAL_BELOW = 2 * np.pi * 200.0  # rad/s: amplitudes of modes below are taken to be equal
SMALLEST_STATE = 1e-4  # of the energy norm of the largest
ROUND_OFF = 1e-10  # of the largest energy of states of stress
SHIFT = 1e-10  # of the mean in-plane stiffness: a plate that is held nowhere moves as a whole

Strain = NDArray[np.float64]  # (3, ...): xx, yy and 2 xy


@dataclass(frozen=True, kw_only=True, eq=False)
class KarmanPlate:
    """Stiffness of a plate at large deflection, in r of its modes.

    Parameters
    ----------
    modes : PlateModes, all modes of the plate
    chosen : (r,) int, which of them stretch it
    squared : (r,) rad2/s2, squared angular frequencies of the chosen modes
    bending : (r, r) rad2/s2, the stiffness of bending between them
    H : (k, r, r) J^-1/2 s^-2, stiffness of the states of stress, of modal coordinates in kg^1/2 m
    left_out : share of the energy norm of stretching, in the states that are left out
    """

    modes: PlateModes
    chosen: NDArray[np.int_]
    squared: Floats
    bending: Floats
    H: Floats
    left_out: float

    @cached_property
    def stacked(self) -> Floats:
        """H as (k r, r)."""
        return np.ascontiguousarray(self.H.reshape(-1, len(self.squared)))

    def shapes(self, points: ArrayLike) -> Floats:
        """Shapes (p, r) in kg^-1/2 of the chosen modes at points (p, 2) in metre."""
        return np.asarray(self.modes.at(points)[:, self.chosen])


def karman_plate(
    modes: PlateModes, thickness: float, count: int = 30, *, in_plane: str = "held"
) -> KarmanPlate:
    """Stiffness of a homogeneous plate at large deflection. It depends on no load: compute it once.

    Parameters
    ----------
    modes : PlateModes
    thickness : metre; the membrane stiffness is 12 / thickness^2 of the bending stiffness
    count : number of modes that stretch the plate, the lowest
    in_plane : what supported edges do to the in-plane displacement: "held" fixes it, "sliding"
        fixes it across the edge alone, "movable" leaves it free. Clips of a radius fix it.

    Returns
    -------
    KarmanPlate

    Raises
    ------
    ValueError
        If the thickness or the count is out of range, or `in_plane` unknown.
    """
    choose("in_plane", in_plane, IN_PLANE)
    if not (np.isfinite(thickness) and thickness > 0):
        raise ValueError(f"thickness = {thickness} m must be finite and above 0")
    if not 1 <= count <= len(modes.squared):
        raise ValueError(f"count = {count} must be from 1 to the {len(modes.squared)} modes")
    chosen = np.sort(np.argsort(modes.squared, kind="stable")[:count])
    squared = modes.squared[chosen]
    slopes = _ChosenModes.of(modes, chosen)
    reach = 1 / np.maximum(squared, EQUAL_BELOW**2)
    A = _membrane_stiffness(modes.plate, thickness)
    parts = [
        _states_of_stress(modes.plate, A, slopes, reach, turn, IN_PLANE[in_plane])
        for turn in _symmetries(slopes)
    ]
    energy, H = (np.concatenate(each) for each in zip(*parts, strict=True))
    order = np.argsort(-energy, kind="stable")
    kept = order[energy[order] > SMALLEST_STATE**2 * energy.max()]
    lost = max(float(energy.sum() - energy[kept].sum()), 0.0)
    return KarmanPlate(
        modes=modes, chosen=chosen, squared=squared, bending=_bending(modes, chosen), H=H[kept],
        left_out=float(np.sqrt(lost / energy.sum())),
    )  # fmt: skip


def area_forces(modes: PlateModes) -> Floats:
    """Modal forces (m,) in N kg^-1/2 of a uniform pressure of 1 Pa."""
    return np.concatenate([
        np.einsum("i,ijm,j->m", f.x.integrals(), f.shapes, f.y.integrals(), optimize=True)
        for f in modes.families
    ])  # fmt: skip


def _membrane_stiffness(plate: Plate, thickness: float) -> Floats:
    """Stiffness (3, 3) in N/m between strains and stress resultants."""
    bending = np.diag([plate.d11, plate.d22, plate.d66])
    bending[0, 1] = bending[1, 0] = plate.d12
    return np.asarray(12 / thickness**2 * bending)


def _bending(modes: PlateModes, chosen: NDArray[np.int_]) -> Floats:
    blocks = [np.diag(f.squared) if f.bending is None else f.bending for f in modes.families]
    return np.asarray(linalg.block_diag(*blocks)[np.ix_(chosen, chosen)])


@dataclass(frozen=True, kw_only=True, eq=False)
class _ChosenModes:
    """Slopes of the chosen modes on a Gauss grid.

    `x`, `y` coordinates in metre and their weights; `along`, `across` (r, x, y) in kg^-1/2 m^-1 the
    derivatives of shapes; `parity` (r, 2): 0 of an even, 1 of an odd function along x and y;
    `degrees` of polynomials, on each piece, that resolve products of two modes.
    """

    breaks: tuple[Floats, Floats]
    split: tuple[bool, bool]
    degrees: tuple[list[int], list[int]]
    x: tuple[Floats, Floats]
    y: tuple[Floats, Floats]
    along: Floats
    across: Floats
    parity: NDArray[np.int_]

    @staticmethod
    def of(modes: PlateModes, chosen: NDArray[np.int_]) -> "_ChosenModes":
        lines = [list(dict.fromkeys(getattr(f, name) for f in modes.families)) for name in "xy"]
        picked, first = [], 0
        for f in modes.families:
            last = first + len(f.squared)
            own = chosen[(chosen >= first) & (chosen < last)] - first
            picked.append((f, f.shapes[..., own]))
            first = last
        breaks = (lines[0][0].breaks, lines[1][0].breaks)
        degrees = tuple(
            [int(np.ceil(wavenumber * piece)) + (MARGIN if len(b) == 2 else BESIDE)
             for piece in np.diff(b)]
            for b, wavenumber in zip(breaks, _wavenumbers(picked), strict=True)
        )  # fmt: skip
        x, y = (_gauss(b, [n + 2 for n in d]) for b, d in zip(breaks, degrees, strict=True))
        slopes = [
            [np.einsum("pi,ijm,qj->mpq", a, shapes, b, optimize=True) for a, b in (
                (f.x.slopes(x[0]), f.y(y[0])), (f.x(x[0]), f.y.slopes(y[0])))]
            for f, shapes in picked
        ]  # fmt: skip
        along, across = (np.concatenate(each) for each in zip(*slopes, strict=True))
        parity = np.array([
            (lines[0].index(f.x), lines[1].index(f.y))
            for f, shapes in picked for _ in range(shapes.shape[2])
        ])  # fmt: skip
        return _ChosenModes(
            breaks=breaks, split=(len(lines[0]) == 2, len(lines[1]) == 2),
            degrees=(degrees[0], degrees[1]), x=x, y=y, along=along, across=across, parity=parity,
        )  # fmt: skip

    def stretching(self, i: NDArray[np.int_], j: NDArray[np.int_]) -> Strain:
        """Strains e (3, pairs, x, y) in 1/kg of pairs of modes."""
        a, b = self.along, self.across
        return np.stack([a[i] * a[j] / 2, b[i] * b[j] / 2, (a[i] * b[j] + b[i] * a[j]) / 2])

    def alike(self, turn: tuple[int, int]) -> NDArray[np.bool_]:
        """Pairs (r, r) of modes whose products have a symmetry."""
        both = self.parity[:, None] != self.parity
        return np.asarray((both == np.array(turn, bool)).all(axis=2))

    def stiffness(self, turn: tuple[int, int], states: Strain) -> Floats:
        """Stiffness (k, r, r) that states of stress (3, k, x, y) of a symmetry, times the areas of
        the points, add to bending.
        """
        i, j = np.nonzero(np.triu(self.alike(turn)))
        found = np.zeros((states.shape[1], *(2 * self.parity.shape[:1])))
        for part in np.array_split(np.arange(len(i)), len(i) // MOST_PAIRS + 1):
            a, b = i[part], j[part]
            work = np.tensordot(states, self.stretching(a, b), axes=([0, 2, 3], [0, 2, 3]))
            found[:, a, b] = found[:, b, a] = 2 * work
        return found


def _wavenumbers(picked: Sequence[tuple]) -> tuple[float, float]:
    """Largest root-mean-square wavenumbers in rad/m of modes along x and along y."""
    largest = [0.0, 0.0]
    for f, c in picked:
        if not c.shape[2]:
            continue
        square = [np.einsum("ijm,ik,jl,klm->m", c, a, b, c, optimize=True) for a, b in (
            (f.x.mass, f.y.mass), (f.x.slope, f.y.mass), (f.x.mass, f.y.slope))]  # fmt: skip
        for axis in (0, 1):
            found = float(np.sqrt((square[axis + 1] / square[0]).max()))
            largest[axis] = max(largest[axis], found)
    return largest[0], largest[1]


def _gauss(breaks: Floats, counts: Sequence[int]) -> tuple[Floats, Floats]:
    """Gauss points and weights in metre on the pieces of a line."""
    points, weights = [], []
    for low, high, count in zip(breaks[:-1], breaks[1:], counts, strict=True):
        nodes, each = np.polynomial.legendre.leggauss(count)
        points.append((low + high) / 2 + (high - low) / 2 * nodes)
        weights.append((high - low) / 2 * each)
    return np.concatenate(points), np.concatenate(weights)


def _symmetries(slopes: _ChosenModes) -> Iterator[tuple[int, int]]:
    x, y = ((0, 1) if split else (0,) for split in slopes.split)
    return product(x, y)


def _states_of_stress(
    plate: Plate, A: Floats, slopes: _ChosenModes, reach: Floats, turn: tuple[int, int],
    held: tuple[bool, bool],
) -> tuple[Floats, Floats]:  # fmt: skip
    """States of stress of one symmetry, orthonormal in energy, from the strongest pairs of modes:
    the energy (k,) of stretching in each, relative, and the stiffness H (k, r, r).
    """
    i, j = np.nonzero(np.triu(slopes.alike(turn)))
    order = np.argsort(-reach[i] * reach[j], kind="stable")[:MOST_PAIRS]
    i, j = i[order], j[order]
    if not len(i):
        return np.zeros(0), np.zeros((0, len(reach), len(reach)))
    weight = reach[i] * reach[j] * np.where(i == j, 1, 2) / reach.max() ** 2
    strain = slopes.stretching(i, j) * weight[:, None, None]
    strain = _Plane.of(plate, A, slopes, turn, held).incompatible(strain)
    area = np.outer(slopes.x[1], slopes.y[1])
    weighted = np.tensordot(A, strain, axes=1) * area
    gram = np.tensordot(strain, weighted, axes=([0, 2, 3], [0, 2, 3]))
    energy, vectors = np.linalg.eigh((gram + gram.T) / 2)
    kept = energy > ROUND_OFF * energy[-1]
    scaled = vectors[:, kept] / np.sqrt(energy[kept])
    states = np.tensordot(weighted, scaled, axes=([1], [0])).transpose(0, 3, 1, 2)
    return energy[kept], slopes.stiffness(turn, states)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Plane:
    """In-plane problem of one symmetry, in polynomials u = X_i(x) Y_j(y) and v alike.

    `values` and `slopes` (x, i) and (y, j) of both on the grid, and `weights` of its points;
    `free` (n,) products that no clip holds, and `factor` of their stiffness.
    """

    A: Floats
    values: tuple[tuple[Floats, Floats], ...]
    slopes: tuple[tuple[Floats, Floats], ...]
    weights: tuple[Floats, Floats]
    free: NDArray[np.int_]
    factor: tuple[Floats, bool]

    @staticmethod
    def of(
        plate: Plate, A: Floats, modes: _ChosenModes, turn: tuple[int, int],
        held: tuple[bool, bool],
    ) -> "_Plane":  # fmt: skip
        u, v = (_displacements(plate, modes, turn, held, component) for component in (0, 1))
        weights = modes.x[1], modes.y[1]
        at = modes.x[0], modes.y[0]
        values = tuple((lines[0](at[0]), lines[1](at[1])) for lines in (u, v))
        slopes = tuple((lines[0].slopes(at[0]), lines[1].slopes(at[1])) for lines in (u, v))
        x, y = ((values[1][k] * weights[k][:, None]).T @ slopes[0][k] for k in (0, 1))
        xt, yt = ((slopes[1][k] * weights[k][:, None]).T @ values[0][k] for k in (0, 1))
        K = [
            [A[0, 0] * np.kron(u[0].slope, u[1].mass) + A[2, 2] * np.kron(u[0].mass, u[1].slope)],
            [A[0, 1] * np.kron(x, yt) + A[2, 2] * np.kron(xt, y)],
            [A[1, 1] * np.kron(v[0].mass, v[1].slope) + A[2, 2] * np.kron(v[0].slope, v[1].mass)],
        ]
        stiffness = np.block([[K[0][0], K[1][0].T], [K[1][0], K[2][0]]])
        mass = linalg.block_diag(*(np.kron(lines[0].mass, lines[1].mass) for lines in (u, v)))
        free = np.flatnonzero(
            np.concatenate([_free_of_clips(plate, *u), _free_of_clips(plate, *v)])
        )
        stiffness, mass = stiffness[np.ix_(free, free)], mass[np.ix_(free, free)]
        if len(free):
            stiffness += SHIFT * np.trace(stiffness) / np.trace(mass) * mass
        factor = linalg.cho_factor(stiffness) if len(free) else (stiffness, False)
        return _Plane(A=A, values=values, slopes=slopes, weights=weights, free=free, factor=factor)

    def incompatible(self, strain: Strain) -> Strain:
        """Strains (3, p, x, y) less those of the in-plane displacements that relieve them."""
        if not len(self.free):
            return strain
        stress = np.tensordot(self.A, strain, axes=1)
        stress *= self.weights[0][:, None] * self.weights[1]
        sizes = [x.shape[1] * y.shape[1] for x, y in self.values]
        forces = np.zeros((sum(sizes), strain.shape[1]))
        (ux, uy), (vx, vy) = self.values
        (dux, duy), (dvx, dvy) = self.slopes
        both = "pxy,xi,yj->ijp"
        of_u = _sum(both, (stress[0], dux, uy), (stress[2], ux, duy))
        of_v = _sum(both, (stress[1], vx, dvy), (stress[2], dvx, vy))
        forces[: sizes[0]], forces[sizes[0] :] = (
            each.reshape(-1, strain.shape[1]) for each in (of_u, of_v)
        )
        moved = np.zeros_like(forces)
        moved[self.free] = -linalg.cho_solve(self.factor, forces[self.free])
        u = moved[: sizes[0]].reshape(ux.shape[1], uy.shape[1], -1)
        v = moved[sizes[0] :].reshape(vx.shape[1], vy.shape[1], -1)
        back = "ijp,xi,yj->pxy"
        return strain + np.stack([
            _sum(back, (u, dux, uy)), _sum(back, (v, vx, dvy)),
            _sum(back, (u, ux, duy), (v, dvx, vy)),
        ])  # fmt: skip


def _sum(subscripts: str, *operands: tuple[Floats, Floats, Floats]) -> Floats:
    return np.asarray(sum(np.einsum(subscripts, *each, optimize=True) for each in operands))


def _displacements(
    plate: Plate, modes: _ChosenModes, turn: tuple[int, int], held: tuple[bool, bool],
    component: int,
) -> tuple[LineBasis, LineBasis]:  # fmt: skip
    """Functions along x and y of a component of the in-plane displacement."""
    found = []
    for axis, names in enumerate((("left", "right"), ("front", "back"))):
        holds = held[0] if axis == component else held[1]
        ends = ["simply" if holds and getattr(plate, name) != "free" else "free" for name in names]
        lines = continuous_basis(modes.breaks[axis], ends, modes.degrees[axis], modes.split[axis])
        # A strain that is even along x has an odd u along x.
        odd = turn[axis] ^ (axis == component)
        found.append(lines[odd if len(lines) == 2 else 0])
    return found[0], found[1]


def _free_of_clips(plate: Plate, x: LineBasis, y: LineBasis) -> NDArray[np.bool_]:
    """Products (n,) that no clip holds; a clip without radius holds none."""
    if not (plate.clips and plate.clip_radius):
        return np.ones(x.size * y.size, bool)
    return outside_clips(plate, x, y)
