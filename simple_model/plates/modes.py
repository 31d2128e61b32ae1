"""Modes of a rectangular, orthotropic, stretched thin plate with any edges and clips, and its air.

Ritz's method: w(x, y) = sum c_ij X_i(x) Y_j(y) makes the energies stationary (Leissa, Vibration of
Plates (1969), eqs. 9.4 and 10.1; orthotropic: Timoshenko and Woinowsky-Krieger, section 85)

    2 U = iint D11 w_xx^2 + 2 D12 w_xx w_yy + D22 w_yy^2 + 4 D66 w_xy^2 + Tx w_x^2 + Ty w_y^2 dA
    2 T = w^2 iint m w^2 dA + the energy of the air on both sides, see `air`

X_i and Y_j are combinations of Legendre polynomials that meet the supports of the edges; the
conditions at a free edge follow from the energies. A clip holds a square: the polynomials between
its sides are separate, and products that would move it are left out. If a plate is symmetric about
its middle, even and odd modes separate.

Tension has no loss, so the complex modulus of bending couples the modes of a stretched plate, close
modes most. So does the sound that they radiate. Lossy edges take from each mode a share of the
energy of its tension and bending: a support with a complex compliance does, the same share of all
modes that are much shorter than the plate.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg, sparse
from scipy.linalg.lapack import zgetrf, zgetrs

from simple_model.choices import check_numbers, choose
from simple_model.layers.compliance import AIR_DENSITY
from simple_model.layers.material import ModulusLaw
from simple_model.plates.air import AirLoss, air_of
from simple_model.plates.polynomials import FIXED, LineBasis, piecewise_basis
from simple_model.typing import Bools, Complex, Floats


@dataclass(frozen=True, kw_only=True)
class Plate:
    """Rectangular thin plate, its middle at (0, 0), its sides along x and y.

    Parameters
    ----------
    size_x, size_y : m
    d11, d22, d12, d66 : N m, bending stiffnesses; of an isotropic plate D, D, nu D, (1 - nu) D / 2
    mass_per_area : kg/m2
    tension_x, tension_y : N/m, uniform
    left, right, front, back : "clamped", "simply" or "free", edges at smallest and largest x, then
        y
    clips : ((x, y), ...) m, where the plate is fixed
    clip_radius : m, half a side of the fixed square; 0 fixes the deflection of a point only
    air_density : kg/m3, 0 in vacuum
    frame_width : m, of a rigid frame around the plate that separates the air on both sides; inf for
        a baffle
    edge_loss : share of the energy of a mode that the edges take in a cycle, over 2 pi

    Raises a ValueError if a value is out of range or a clip is off the plate.
    """

    size_x: float
    size_y: float
    d11: float
    d22: float
    d12: float
    d66: float
    mass_per_area: float
    tension_x: float = 0.0
    tension_y: float = 0.0
    left: str = "clamped"
    right: str = "clamped"
    front: str = "clamped"
    back: str = "clamped"
    clips: tuple[tuple[float, float], ...] = ()
    clip_radius: float = 0.0
    air_density: float = AIR_DENSITY
    frame_width: float = np.inf
    edge_loss: float = 0.0

    def __post_init__(self) -> None:
        check_numbers("a plate", self, "size_x", "size_y", "d11", "d22", "d66", "mass_per_area")
        more = ("tension_x", "tension_y", "clip_radius", "air_density", "edge_loss")
        check_numbers("a plate", self, *more, least="0 or above")
        if not self.frame_width >= 0:  # inf is allowed
            raise ValueError(f"frame_width = {self.frame_width} m of a plate must be 0 or above")
        if not self.d12**2 < self.d11 * self.d22:
            raise ValueError(
                f"d12 = {self.d12} of a plate is not below sqrt(d11 d22) = "
                f"{(self.d11 * self.d22) ** 0.5:.4g}, so the plate would be unstable; lower d12"
            )
        for name in ("left", "right", "front", "back"):
            choose(name, getattr(self, name), FIXED)
        for x, y in self.clips:
            if not (abs(x) <= self.size_x / 2 and abs(y) <= self.size_y / 2):
                raise ValueError(
                    f"clip ({1e3 * x:g}, {1e3 * y:g}) mm is off the plate of "
                    f"{1e3 * self.size_x:g} by {1e3 * self.size_y:g} mm; move it inside"
                )


@dataclass(frozen=True, kw_only=True, eq=False)
class Family:
    """Modes of one symmetry: `squared` (m,) angular frequencies in rad2/s2, ascending; stiffness of
    `bending` (m, m) between them, None without tension; coefficients `shapes` (i, j, m) on `x` and
    `y`; and what the `air` takes from them, None in vacuum.
    """

    x: LineBasis
    y: LineBasis
    squared: Floats
    bending: Floats | None
    shapes: Floats
    air: AirLoss | None

    @property
    def elastic(self) -> Floats:
        """Shares (m,) of bending in the stiffness."""
        if self.bending is None:
            return np.ones(len(self.squared))
        largest = np.maximum(self.squared, np.finfo(float).tiny)
        return np.asarray(np.clip(np.diagonal(self.bending) / largest, 0.0, 1.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class PlateModes:
    """Modes of a plate of unit modal mass, in families of one symmetry each."""

    plate: Plate
    families: tuple[Family, ...]

    @property
    def parts(self) -> Iterator[tuple[Family, slice]]:
        """Families, and the place of each in arrays of all modes."""
        first = 0
        for family in self.families:
            yield family, slice(first, first := first + len(family.squared))

    @property
    def squared(self) -> Floats:
        """Squared angular frequencies (m,) in rad2/s2, family by family."""
        return np.concatenate([family.squared for family in self.families])

    @property
    def damping(self) -> Floats:
        """Viscous damping (m,) in 1/s by air and edges, of each mode at its own frequency."""
        omega = np.sqrt(np.maximum(self.squared, 0.0))
        damping = self.plate.edge_loss * omega
        for family, part in self.parts:
            if family.air is not None:
                damping[part] += family.air.at_own(omega[part])
        return np.asarray(damping)

    @property
    def elastic(self) -> Floats:
        """Shares (m,) of bending in the stiffness; its loss damps a mode."""
        return np.concatenate([family.elastic for family in self.families])

    @property
    def frequencies(self) -> Floats:
        """Natural frequencies (m,) in Hz, ascending."""
        return np.sort(np.sqrt(np.maximum(self.squared, 0.0))) / (2 * np.pi)

    def at(self, points: ArrayLike) -> Floats:
        """Shapes (p, m) in kg^-1/2 at points (p, 2) in m."""
        x, y = np.asarray(points, np.float64).T
        return np.hstack([
            np.einsum("pi,ijm,pj->pm", f.x(x), f.shapes, f.y(y), optimize=True)
            for f in self.families
        ])  # fmt: skip

    def on_grid(self, x: Floats, y: Floats) -> Floats:
        """Shapes (x y, m) in kg^-1/2 at each x (x,) with each y (y,) in m, y faster."""
        each = [
            np.einsum("pi,ijm,qj->pqm", f.x(x), f.shapes, f.y(y), optimize=True)
            for f in self.families
        ]
        return np.concatenate(each, axis=2).reshape(len(x) * len(y), -1)


def plate_modes(
    plate: Plate, finest: float | Sequence[float] = 350.0, most_dofs: int = 6000
) -> PlateModes:
    """Compute all modes of a plate that polynomials up to the wavenumber `finest` in rad/m
    represent.

    `finest` may differ along x and y; beyond its default, a focal spot of 4.35 mm has a third of
    its force. The lowest modes are accurate; the highest only complete the static deflection.
    Raises a ValueError for more than `most_dofs` degrees of freedom of one symmetry.

    >>> stiffness = {"d11": 4e-4, "d22": 4e-4, "d12": 1.2e-4, "d66": 1.4e-4}
    >>> plate = Plate(size_x=0.1, size_y=0.1, mass_per_area=0.08, **stiffness)
    >>> plate_modes(plate, finest=150.0).frequencies[:3].round(1)  # Hz
    array([28.2, 67.7, 67.7])
    """
    resolved, mirrored = np.broadcast_to(finest, 2), _symmetries(plate)
    bases = [_line_bases(plate, axis, resolved[axis], mirrored[axis]) for axis in (0, 1)]
    if (dofs := max(x.size * y.size for x, y in product(*bases))) > most_dofs:
        raise ValueError(
            f"a plate of {1e3 * plate.size_x:g} by {1e3 * plate.size_y:g} mm needs {dofs:,} "
            f"degrees of freedom, more than {most_dofs:,}; give a finest below "
            f"{max(resolved):g} rad/m"
        )
    return PlateModes(plate=plate, families=tuple(_family(plate, x, y) for x, y in product(*bases)))


def scaled_modes(modes: PlateModes, *, bending: Floats, mass: Floats) -> PlateModes:
    """Return modes whose stiffness of bending is multiplied by `bending` (m,) and whose modal mass
    by `mass` (m,), again of unit modal mass.
    """
    families = []
    for family, part in modes.parts:
        softer, heavier, share = bending[part], mass[part], family.elastic
        root = np.sqrt(softer / heavier)
        families.append(replace(
            family, squared=family.squared * (1 - share + share * softer) / heavier,
            bending=None if family.bending is None else root[:, None] * family.bending * root,
            shapes=family.shapes / np.sqrt(heavier),
            air=family.air and family.air.scaled(1 / np.sqrt(heavier)),
        ))  # fmt: skip
    return replace(modes, families=tuple(families))


def modal_motion(
    modes: PlateModes, frequencies: Floats, forces: Complex, modulus: ModulusLaw
) -> Complex:
    """Steady modal coordinates q (f, m) in m kg^1/2 under modal forces (f, m) in N kg^-1/2 at
    frequencies (f,) in Hz.

    They solve (diag(w_m^2) + (h - 1) B + i w R - w^2) q = force, with the stiffness B of bending
    between the modes, its relative modulus h, and the resistance R of air and edges: `modulus` maps
    angular frequencies (...) in rad/s to the complex modulus (...) over that of the modes.
    """
    w = 2 * np.pi * np.asarray(frequencies, np.float64)
    added = np.broadcast_to(modulus(w) - 1, w.shape)
    coordinates = np.empty(forces.shape, np.complex128)
    for family, part in modes.parts:
        own = _own_stiffness(family, modes.plate.edge_loss, w, added)
        couples = (family.bending is not None) & (added != 0) | (family.air is not None) & (w > 0)
        coordinates[:, part] = forces[:, part] / own
        lines = np.flatnonzero(couples)
        for some in np.array_split(lines, -(-len(lines) // 64)) if len(lines) else []:
            of_lines = w[some], added[some], own[some], forces[some, part]
            coordinates[some, part] = _solve_coupled(family, *of_lines)
    return coordinates


def modal_motion_apart(
    modes: PlateModes, frequencies: Floats, forces: Complex, modulus: ModulusLaw
) -> Complex:
    """Modal coordinates (f, m) as in `modal_motion`, without coupling between modes."""
    w = 2 * np.pi * np.asarray(frequencies, np.float64)
    added, edge = np.broadcast_to(modulus(w) - 1, w.shape), modes.plate.edge_loss
    own = [_own_stiffness(family, edge, w, added) for family in modes.families]
    return np.asarray(forces / np.hstack(own), np.complex128)


def _own_stiffness(family: Family, edge_loss: float, w: Floats, added: Complex) -> Complex:
    """Dynamic stiffness (f, m) of each mode alone, in 1/s2."""
    own = family.squared * (1 + np.multiply.outer(added, family.elastic)) - w[:, None] ** 2
    if edge_loss:
        omega = np.sqrt(np.maximum(family.squared, 0.0))
        own = own + 1j * edge_loss * np.multiply.outer(w, omega)
    if family.air is not None:
        own = own + 1j * w[:, None] * family.air.of_each(w)
    return np.asarray(own, np.complex128)


def _solve_coupled(
    family: Family, w: Floats, added: Complex, own: Complex, forces: Complex,
    *, most_steps: int = 30, residual: float = 1e-10, coupled: float = 1.3,
) -> Complex:  # fmt: skip
    """Coordinates (f, m) of coupled modes under forces (f, m) at angular frequencies w (f,).

    `own` (f, m) are the dynamic stiffnesses of each mode alone. Modes are coupled by `added` (f,)
    times the stiffness of bending, and by sound. Conjugate gradients for complex symmetric matrices
    (van der Vorst and Melissen, IEEE Trans Magn 26:706 (1990)) end at a `residual` of the largest
    force. The preconditioner solves modes within a factor `coupled` of a line's frequency together
    and all others alone. Lines that need more than `most_steps` are solved directly.
    """
    m = len(family.squared)
    bending = np.zeros((m, m)) if family.bending is None else family.bending.copy()
    np.fill_diagonal(bending, 0.0)
    patterns, sound = np.zeros((0, m)), np.zeros((len(w), 0, 0))
    if family.air is not None:
        patterns, sound = family.air.patterns, family.air.radiation(w)
    sound = np.asarray(1j * w[:, None, None] * sound, np.complex128)
    alone = ((sound @ patterns) * patterns).sum(axis=1)  # part of `own`

    def image_of(q: Complex) -> Complex:
        bent = q.real @ bending + 1j * (q.imag @ bending)  # real, which is faster
        radiated = (sound @ (q @ patterns.T)[..., None])[..., 0] @ patterns
        return np.asarray(own * q + (added[:, None] * bent + radiated - alone * q))

    def block(k: int, modes: slice) -> Complex:
        """Dynamic stiffness (n, n) of some modes at a line."""
        near = patterns[:, modes]
        stiffness = added[k] * bending[modes, modes] + near.T @ sound[k] @ near
        stiffness[np.diag_indices(len(stiffness))] += (own - alone)[k, modes]
        return np.asarray(stiffness)

    low, high = (
        np.searchsorted(family.squared, (w * factor) ** 2) for factor in (1 / coupled, coupled)
    )
    near = [slice(*each) for each in zip(low.tolist(), high.tolist(), strict=True)]
    factors = [
        zgetrf(block(k, modes))[:2] if modes.stop > modes.start else None
        for k, modes in enumerate(near)
    ]

    def precondition(left: Complex) -> Complex:
        q = left / own
        for k, (modes, factor) in enumerate(zip(near, factors, strict=True)):
            if factor is not None:
                q[k, modes] = zgetrs(*factor, left[k, modes])[0]
        return np.asarray(q)

    allowed = residual * np.abs(forces).max(axis=1)
    q, left = np.zeros_like(own), forces.astype(np.complex128)
    toward = along = precondition(left)
    size = (left * toward).sum(axis=1)
    for _ in range(most_steps):
        image = image_of(along)
        with np.errstate(divide="ignore", invalid="ignore"):  # of lines that are solved
            step = np.nan_to_num(size / (along * image).sum(axis=1), posinf=0.0)[:, None]
        q, left = q + step * along, left - step * image
        open_lines = ~(np.abs(left).max(axis=1) <= allowed)
        if not open_lines.any():
            return q
        toward, before = precondition(left), size
        size = (left * toward).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            along = toward + np.nan_to_num(size / before, posinf=0.0)[:, None] * along
    for k in np.flatnonzero(open_lines).tolist():
        q[k] = np.linalg.solve(block(k, slice(None)), forces[k])
    return q


def _symmetries(plate: Plate) -> tuple[bool, bool]:
    """Whether a plate is symmetric about its middle, along x and along y."""
    clips = np.array(plate.clips).reshape(-1, 2)

    def same(mirror: tuple[int, int]) -> bool:
        images = clips * mirror
        return all(np.abs(clips - image).max(axis=1).min() < 1e-9 for image in images)

    return (
        plate.left == plate.right and same((-1, 1)),
        plate.front == plate.back and same((1, -1)),
    )


def _line_bases(plate: Plate, axis: int, finest: float, mirrored: bool) -> tuple[LineBasis, ...]:
    """Functions along x or y up to a wavenumber in rad/m, on pieces between sides of clips."""
    size = (plate.size_x, plate.size_y)[axis]
    ends = ((plate.left, plate.right), (plate.front, plate.back))[axis]
    breaks = np.array([-size / 2, *_breaks(plate, axis, size), size / 2])
    margin = 8 if len(breaks) == 2 else 3  # more than required; fewer between the sides of clips
    degrees = [int(np.ceil(finest * piece / 2)) + margin for piece in np.diff(breaks)]
    return piecewise_basis(breaks, ends, degrees, mirrored)


def _breaks(plate: Plate, axis: int, size: float) -> list[float]:
    """Sides of the clips along an axis within the plate, in m, and lines next to them: at the
    corners of a clip the curvature is unbounded.
    """
    reach = plate.clip_radius
    sides = [clip[axis] + turn * reach for clip in plate.clips for turn in (-1, 1) if reach]
    inside = _apart([], sides, size / 2, 0.01 * reach)  # closer sides and edges coincide
    layer = 0.1 * reach  # width of a piece along the sides of a clip
    lines = [at + turn * layer for at in inside for turn in (-1, 1)]
    return sorted(_apart(inside, lines, size / 2, layer / 2))


def _apart(first: Sequence[float], others: Sequence[float], end: float, gap: float) -> list[float]:
    """Places, and those of the others that are more than a gap away from these and both ends."""
    places = [-end, *first, end]
    for place in sorted(others, key=abs):
        if abs(place) < end and all(abs(place - each) > gap for each in places):
            places.append(place)
    return [place for place in places if abs(place) < end]


def _family(plate: Plate, x: LineBasis, y: LineBasis) -> Family:
    bending, stretching = _stiffness(plate, x, y)
    area = np.kron(x.mass, y.mass)
    mass = np.asarray(plate.mass_per_area * area, np.float64)
    if plate.air_density:
        added, patterns, orders = air_of(x, y, plate.air_density, plate.frame_width)
        mass += added
        for radiating in patterns[:1]:
            unit = radiating / np.linalg.norm(radiating)
            # 1e-9 of the mass, so that of equal frequencies one mode radiates.
            mass += 1e-9 * plate.mass_per_area * np.outer(unit, unit)
    K = bending if stretching is None else bending + stretching
    free = _free_of_clips(plate, x, y) if plate.clips else None
    if free is not None:
        K, mass = (np.asarray(free.T @ each @ free, np.float64) for each in (K, mass))
    squared, shapes = _modes(K, mass)
    shapes = shapes if free is None else free @ shapes
    between = None if stretching is None else np.asarray(shapes.T @ (bending @ shapes))
    air = None
    if plate.air_density:
        air = AirLoss(
            patterns=patterns @ shapes, orders=orders,
            areas=(shapes * (area @ shapes)).sum(axis=0), density=plate.air_density,
            reach=float(np.hypot(plate.size_x, plate.size_y)) / 2,
        )  # fmt: skip
    return Family(
        x=x, y=y, squared=squared, bending=between, air=air,
        shapes=shapes.reshape(x.size, y.size, -1),
    )  # fmt: skip


def _modes(K: Floats, M: Floats) -> tuple[Floats, Floats]:
    """Squared angular frequencies (m,) in rad2/s2 and shapes (n, m) of unit modal mass, ascending.
    Solves M x = K x / w^2, because the error scales with the largest eigenvalue; a shift permits
    rigid motion.
    """
    shift = 1e-12 * np.trace(K) / np.trace(M)
    inverse, shapes = linalg.eigh(M, K + shift * M, check_finite=False, overwrite_b=True)
    inverse = np.maximum(inverse[::-1], np.finfo(float).eps * inverse[-1])
    return 1 / inverse - shift, shapes[:, ::-1] / np.sqrt(inverse)


def _stiffness(plate: Plate, x: LineBasis, y: LineBasis) -> tuple[Floats, Floats | None]:
    """Stiffness (n, n) in N/m per kg/m2 of bending, and of tension if there is any."""
    cross = np.kron(x.mixed, y.mixed.T)
    bending = (
        np.kron(plate.d11 * x.curvature, y.mass)
        + np.kron(x.mass, plate.d22 * y.curvature)
        + plate.d12 * (cross + cross.T)
        + np.kron(4 * plate.d66 * x.slope, y.slope)
    )
    if not (plate.tension_x or plate.tension_y):
        return bending, None
    along, across = plate.tension_x * x.slope, plate.tension_y * y.slope
    return bending, np.kron(along, y.mass) + np.kron(x.mass, across)


def _free_of_clips(plate: Plate, x: LineBasis, y: LineBasis) -> sparse.csr_array | Floats:
    """Basis (n, r) of motion with the clips at rest."""
    if plate.clip_radius:
        return sparse.csr_array(np.eye(x.size * y.size)[:, outside_clips(plate, x, y)])
    xs, ys = np.array(plate.clips).T
    rows = np.einsum("pi,pj->pij", x(xs), y(ys)).reshape(len(xs), -1)
    _, strength, known = linalg.svd(rows, full_matrices=False)
    independent = known[strength > 1e-7 * max(strength[0], np.finfo(float).tiny)]
    everything, _ = linalg.qr(independent.T, mode="full")
    return np.asarray(everything[:, len(independent) :])


def outside_clips(plate: Plate, x: LineBasis, y: LineBasis) -> Bools:
    """Whether products (x y,) of functions, y faster, are zero on all clips."""
    outside, reach = np.ones((x.size, y.size), bool), plate.clip_radius
    for along, across in plate.clips:
        moved = (
            line.nonzero_within(at - reach, at + reach) for line, at in ((x, along), (y, across))
        )
        outside &= ~np.outer(*moved)
    return outside.ravel()
