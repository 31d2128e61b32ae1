"""Large deflection of a thin plate in its bending modes: von Karman's plate, reduced.

    w = shapes z,  energy = z^T K z / 2 + sum_k y_k^2 / 2,  y_k = z^T H_k z / 2

A plate that deflects by about its thickness stretches. In-plane waves are some hundred times faster
than bending waves, so the in-plane displacement (u, v) follows the deflection quasi-statically:

    E = e(w, w) + sym grad (u, v),  e(w_i, w_j) = sym (grad w_i grad w_j^T) / 2
    iint A E : sym grad (du, dv) dA = 0

(von Karman 1910; Chia, Nonlinear Analysis of Plates (1980), chapter 1). `in_plane` solves this for
the stretching e of pairs of modes. The remaining strain is expanded in states of stress that are
orthonormal in energy, the most energetic first. H_k is the stiffness that state k adds to bending.
The energy of stretching, of fourth order in z, is thereby a sum of squares (the same with Airy's
function: Thomas and Bilbao, J Sound Vib 315:569 (2008); Ducceschi and Touze, J Sound Vib 344:313
(2015)).

Only the lowest modes stretch the plate. The others keep their stiffness at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from simple_model.choices import choose
from simple_model.plates.in_plane import IN_PLANE, Grid, exact_grid, in_plane_relief
from simple_model.plates.modes import Family, Plate, PlateModes
from simple_model.typing import Floats, Ints

MOST_PAIRS = 500  # of modes, of one symmetry, from which states of stress are made


@dataclass(frozen=True, kw_only=True, eq=False)
class KarmanPlate:
    """Stiffness of a plate at large deflection, in r of its modes.

    Parameters
    ----------
    modes : PlateModes, all modes of the plate
    chosen : (r,) int, indices of the modes that stretch it
    squared : (r,) rad2/s2, their squared angular frequencies
    bending : (r, r) rad2/s2, stiffness of bending between them
    damping : (r,) 1/s, by air and edges
    H : (k, r, r) J^-1/2 s^-2, stiffness that each state of stress adds, in coordinates in kg^1/2 m
    symmetries : (r,) and (k,) int, ascending: bits 2 and 1 mark modes, or states, that are odd
        along x and y. A state acts between modes of which exactly one has each of its bits.
    left_out : share of the energy norm of stretching in the states that are left out
    """

    modes: PlateModes
    chosen: Ints
    squared: Floats
    bending: Floats
    damping: Floats
    H: Floats
    symmetries: tuple[Ints, Ints]
    left_out: float

    @cached_property
    def _parts(self) -> tuple[list[tuple[slice, Floats]], Ints]:
        """For the modes of each symmetry: their slice, and the nonzero columns of H as a matrix (p,
        columns); and where each derivative (k, r) is among all products (p,), followed by a zero.
        """
        of_modes, of_states = self.symmetries
        parts, places, first = [], np.full(self.H.shape[:2], -1), 0
        for bits in np.unique(of_modes):
            columns = slice(*np.searchsorted(of_modes, (bits, bits + 1)))
            states, rows = np.nonzero((of_states ^ bits)[:, None] == of_modes)
            places[states, rows] = first + np.arange(len(states))
            first += len(states)
            parts.append((columns, self.H[states, rows, columns]))
        return parts, np.where(places < 0, first, places)

    def shapes(self, points: ArrayLike) -> Floats:
        """Shapes (p, r) in kg^-1/2 of the chosen modes at points (p, 2) in m."""
        return np.asarray(self.modes.at(points)[:, self.chosen])

    def gradients(self, z: Floats) -> Floats:
        """Derivatives H z (k, r) of the states of stress y at coordinates z (r,)."""
        parts, places = self._parts
        products = [part @ z[columns] for columns, part in parts]
        return np.concatenate([*products, np.zeros(1)]).take(places)


def karman_plate(
    modes: PlateModes, thickness: float, count: int = 60, *, in_plane: str = "held"
) -> KarmanPlate:
    """Compute the stiffness of a homogeneous plate of a thickness in m at large deflection, for any
    load.

    The lowest modes, `count`, stretch the plate. For a square plate under a uniform pressure, 60
    modes give the deflection within 0.1 % up to 4 times its thickness. Motion needs the modes up to
    about twice the highest frequency of the load. Supported edges fix the in-plane displacement
    ("held"), only its component across the edge ("sliding"), or leave it free ("movable"). Clips
    with a radius always fix it. Raises a ValueError if a value is out of range or unknown.
    """
    choose("in_plane", in_plane, IN_PLANE)
    if not (np.isfinite(thickness) and thickness > 0):
        raise ValueError(f"thickness = {thickness} m must be finite and above 0")
    if not 1 <= count <= len(modes.squared):
        raise ValueError(
            f"count = {count} of stretching modes must be from 1 to {len(modes.squared)}"
        )
    chosen = np.sort(np.argsort(modes.squared, kind="stable")[:count])
    squared, slopes = modes.squared[chosen], _Slopes.of(modes, chosen)
    equal_below = 2 * np.pi * 200.0  # rad/s: modes below it count as equally strong
    reach = 1 / np.maximum(squared, equal_below**2)
    A, found = membrane_stiffness(modes.plate, thickness), []
    for odd in product(*((0, 1) if split else (0,) for split in slopes.grid.split)):
        relieve = in_plane_relief(modes.plate, A, slopes.grid, odd, in_plane)
        turn = 2 * odd[0] + odd[1]
        found.append((turn, *_states_of_stress(A, relieve, slopes, reach, turn)))
    energy = np.concatenate([each for _, each, _ in found])
    smallest_state = 0.06  # of the largest energy norm of a state of stress
    least = smallest_state**2 * energy.max()
    strong = [(turn, states[..., each > least]) for turn, each, states in found]
    return KarmanPlate(
        modes=modes, chosen=chosen, squared=squared, bending=_bending(modes, chosen),
        damping=modes.damping[chosen],
        H=np.concatenate([slopes.stiffness(turn, states) for turn, states in strong]),
        symmetries=(
            slopes.symmetries,
            np.concatenate([np.full(states.shape[-1], turn) for turn, states in strong]),
        ),
        left_out=float(np.sqrt(energy[energy <= least].sum() / energy.sum())),
    )  # fmt: skip


def membrane_stiffness(plate: Plate, thickness: float) -> Floats:
    """Stiffness (3, 3) in N/m of stress resultants xx, yy, xy to strains xx, yy and 2 xy."""
    bending = np.diag([plate.d11, plate.d22, plate.d66])
    bending[0, 1] = bending[1, 0] = plate.d12
    return np.asarray(12 / thickness**2 * bending)


def _bending(modes: PlateModes, chosen: Ints) -> Floats:
    blocks = [np.diag(f.squared) if f.bending is None else f.bending for f in modes.families]
    return np.asarray(linalg.block_diag(*blocks)[np.ix_(chosen, chosen)])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Slopes:
    """Slopes of the chosen modes on a grid: derivatives `along` x and `across`, along y, (r, x, y)
    in kg^-1/2 m^-1, and their `symmetries` (r,), see `KarmanPlate`.
    """

    grid: Grid
    along: Floats
    across: Floats
    symmetries: Ints

    @staticmethod
    def of(modes: PlateModes, chosen: Ints) -> _Slopes:
        is_chosen = np.isin(np.arange(len(modes.squared)), chosen)
        families = [(f, f.shapes[..., is_chosen[part]]) for f, part in modes.parts]
        lines = [list(dict.fromkeys(getattr(f, name) for f in modes.families)) for name in "xy"]
        breaks = [each[0].breaks for each in lines]
        grid = exact_grid(breaks, [len(each) == 2 for each in lines], _degrees(families, breaks))
        x, y = grid.points
        along, across = (
            np.concatenate([
                np.einsum("pi,ijm,qj->mpq", *factors, optimize=True) for factors in each
            ])
            for each in (
                [(f.x.slopes(x), shapes, f.y(y)) for f, shapes in families],
                [(f.x(x), shapes, f.y.slopes(y)) for f, shapes in families],
            )
        )  # fmt: skip
        symmetries = [
            2 * lines[0].index(f.x) + lines[1].index(f.y)
            for f, shapes in families for _ in range(shapes.shape[2])
        ]  # fmt: skip
        return _Slopes(grid=grid, along=along, across=across, symmetries=np.array(symmetries))

    def pairs(self, turn: int) -> tuple[Ints, Ints]:
        """Pairs of modes i <= j whose products have a symmetry."""
        i, j = np.nonzero(np.triu(self.symmetries[:, None] ^ self.symmetries == turn))
        return i, j

    def stretching(self, i: Ints, j: Ints) -> Floats:
        """Strains e (3, p, x, y) in 1/kg of pairs of modes (p,): xx, yy and 2 xy."""
        a, b = self.along, self.across
        return np.stack([a[i] * a[j] / 2, b[i] * b[j] / 2, (a[i] * b[j] + b[i] * a[j]) / 2])

    def stiffness(self, turn: int, states: Floats) -> Floats:
        """Stiffness (k, r, r) that states of stress of a symmetry add to bending, from their stress
        resultants times areas (3, x, y, k).
        """
        i, j = self.pairs(turn)
        added = np.zeros((states.shape[3], *(2 * self.symmetries.shape)))
        for part in np.array_split(np.arange(len(i)), len(i) // MOST_PAIRS + 1):
            a, b = i[part], j[part]
            work = np.tensordot(states, self.stretching(a, b), axes=([0, 1, 2], [0, 2, 3]))
            added[:, a, b] = added[:, b, a] = 2 * work
        return added


def _degrees(
    families: Sequence[tuple[Family, Floats]], breaks: Sequence[Floats]
) -> list[list[int]]:
    """Degrees of polynomials on each piece along x and y that resolve products of two modes."""
    largest = np.zeros(2)
    for f, shapes in families:
        forms = (f.x.mass, f.y.mass), (f.x.slope, f.y.mass), (f.x.mass, f.y.slope)
        moved, *slopes = (
            np.einsum("ijm,ik,jl,klm->m", shapes, *form, shapes, optimize=True) for form in forms
        )
        for axis, slope in enumerate(slopes):
            largest[axis] = max(largest[axis], np.sqrt((slope / moved).max(initial=0.0)))
    margins = [8 if len(each) == 2 else 4 for each in breaks]  # fewer between the sides of clips
    return [
        [int(np.ceil(k * piece)) + margin for piece in np.diff(each)]
        for k, margin, each in zip(largest, margins, breaks, strict=True)
    ]


def _states_of_stress(
    A: Floats, relieve: Callable[[Floats], Floats], slopes: _Slopes, reach: Floats, turn: int
) -> tuple[Floats, Floats]:
    """States of stress of one symmetry, orthonormal in energy, from the strongest pairs of modes:
    relative energy (k,) of stretching in each, and its stress resultants times areas (3, x, y, k).
    """
    i, j = slopes.pairs(turn)
    order = np.argsort(-reach[i] * reach[j], kind="stable")[:MOST_PAIRS]
    i, j = i[order], j[order]
    if not len(i):
        return np.zeros(0), np.zeros((3, *slopes.grid.areas.shape, 0))
    weight = reach[i] * reach[j] * np.where(i == j, 1, 2) / reach.max() ** 2
    strains = relieve(slopes.stretching(i, j) * weight[:, None, None])
    weighted = np.tensordot(A, strains, axes=1) * slopes.grid.areas
    gram = np.tensordot(strains, weighted, axes=([0, 2, 3], [0, 2, 3]))
    energy, vectors = np.linalg.eigh((gram + gram.T) / 2)
    round_off = 1e-10  # of the largest energy of a state of stress
    strong = energy > round_off * energy[-1]
    scaled = vectors[:, strong] / np.sqrt(energy[strong])
    return energy[strong], np.tensordot(weighted, scaled, axes=([1], [0]))
