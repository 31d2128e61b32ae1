"""Modes of a rectangular, orthotropic, stretched thin plate on any edges and clips, with its air.

Ritz's method: w(x, y) = sum c_ij X_i(x) Y_j(y) makes stationary the energies (Leissa, Vibration of
Plates (1969), eqs. 9.4 and 10.1; orthotropic: Timoshenko and Woinowsky-Krieger, section 85)

    2 U = iint D11 w_xx^2 + 2 D12 w_xx w_yy + D22 w_yy^2 + 4 D66 w_xy^2 + Tx w_x^2 + Ty w_y^2 dA
    2 T = w^2 iint m w^2 dA + w^2 rho/pi iint iint w(x) w(y) / |x - y| dA dA

X_i and Y_j are orthonormal combinations of Legendre polynomials that meet the supports of the
edges; what a free edge asks follows from the energies. Where a plate is the same on both sides of
its middle, even and odd modes are found apart. The second term of T is the air on both sides of a
plate in a baffle, 2 rho / k at each wavenumber k: see `plate_air`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from simple_model.compliance import AIR_DENSITY
from simple_model.material import Complex, Floats
from simple_model.plate_air import air_mass
from simple_model.polynomials import LineBasis, line_basis

SUPPORTS = ("clamped", "simply", "free")
FINEST = 350.0  # rad/m: beyond it a focal spot of 4.35 mm has a third of its force
MARGIN = 8  # polynomials beyond those that a wavenumber requires
# A clip is its middle and a ring of points without deflection, which may turn: as stiff as a disc
# that is clamped, to 1.5 % in frequency, if the ring is a little larger.
RING, WIDER = 8, 1.2
MOST_DOFS = 6000  # of one symmetry: some minutes


@dataclass(frozen=True, kw_only=True)
class Plate:
    """Rectangular thin plate, its middle at (0, 0), its sides along x and y.

    Parameters
    ----------
    size_x, size_y : metre
    d11, d22, d12, d66 : N m, bending stiffnesses; of an isotropic plate D, D, nu D, (1 - nu) D / 2
    mass_per_area : kg/m2
    tension_x, tension_y : N/m, uniform
    left, right, front, back : "clamped", "simply" or "free", the edges of least and greatest x, of
        least and greatest y
    clips : ((x, y), ...) metre, where the plate is fixed
    clip_radius : metre, within which it is, and its slope with it; 0 fixes the deflection alone
    air_density : kg/m3, 0 in vacuum

    Raises
    ------
    ValueError
        If a value is not finite or out of range, or a clip is off the plate.
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

    def __post_init__(self) -> None:
        for name in ("size_x", "size_y", "d11", "d22", "d66", "mass_per_area"):
            if not (np.isfinite(value := getattr(self, name)) and value > 0):
                raise ValueError(f"{name} = {value} of a plate must be finite and above 0")
        for name in ("tension_x", "tension_y", "clip_radius", "air_density"):
            if not (np.isfinite(value := getattr(self, name)) and value >= 0):
                raise ValueError(f"{name} = {value} of a plate must be finite, 0 or above")
        if not self.d12**2 < self.d11 * self.d22:
            raise ValueError(
                f"d12 = {self.d12} of a plate is not below sqrt(d11 d22) = "
                f"{(self.d11 * self.d22) ** 0.5:.4g}, so that it would bend by itself; lower it"
            )
        for name in ("left", "right", "front", "back"):
            if (said := getattr(self, name)) not in SUPPORTS:
                raise ValueError(f"{name} = '{said}' is none of {', '.join(SUPPORTS)}")
        for x, y in self.clips:
            if not (abs(x) <= self.size_x / 2 and abs(y) <= self.size_y / 2):
                raise ValueError(
                    f"clip ({1e3 * x:g}, {1e3 * y:g}) mm is off the plate of "
                    f"{1e3 * self.size_x:g} by {1e3 * self.size_y:g} mm; move it inside"
                )


@dataclass(frozen=True, kw_only=True, eq=False)
class Family:
    """Modes of one symmetry: `squared` (m,) angular frequencies in rad2/s2, the `elastic` share
    (m,) of their stiffness that is not tension, and coefficients `shapes` (i, j, m) on `x`, `y`.
    """

    x: LineBasis
    y: LineBasis
    squared: Floats
    elastic: Floats
    shapes: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class PlateModes:
    """Modes of a plate of unit modal mass, in families of one symmetry each."""

    plate: Plate
    families: tuple[Family, ...]

    @property
    def squared(self) -> Floats:
        """Squared angular frequencies (m,) in rad2/s2, family by family."""
        return np.concatenate([family.squared for family in self.families])

    @property
    def elastic(self) -> Floats:
        """Shares (m,) of the stiffness that are bending, whose loss damps a mode."""
        return np.concatenate([family.elastic for family in self.families])

    @property
    def frequencies(self) -> Floats:
        """Natural frequencies (m,) in Hz, ascending."""
        return np.sort(np.sqrt(np.maximum(self.squared, 0.0))) / (2 * np.pi)

    def at(self, points: ArrayLike) -> Floats:
        """Shapes (p, m) in kg^-1/2 at points (p, 2) in metre."""
        x, y = np.asarray(points, np.float64).T
        return np.hstack([
            np.einsum("pi,ijm,pj->pm", f.x(x), f.shapes, f.y(y), optimize=True)
            for f in self.families
        ])  # fmt: skip

    def on_grid(self, x: Floats, y: Floats) -> Floats:
        """Shapes (x y, m) in kg^-1/2 at each x (x,) with each y (y,) in metre, y the faster."""
        each = [
            np.einsum("pi,ijm,qj->pqm", f.x(x), f.shapes, f.y(y), optimize=True)
            for f in self.families
        ]
        return np.concatenate(each, axis=2).reshape(len(x) * len(y), -1)


def plate_modes(plate: Plate, finest: float | Sequence[float] = FINEST) -> PlateModes:
    """All modes of a plate that polynomials up to a wavenumber make.

    The lowest are accurate; those near `finest` only stand in for the static deflection that
    they share in.

    Parameters
    ----------
    plate : Plate
    finest : rad/m, the greatest wavenumber that is resolved; one, or that along x and along y

    Returns
    -------
    PlateModes

    Raises
    ------
    ValueError
        If that takes more than `MOST_DOFS` degrees of freedom.
    """
    resolved = np.broadcast_to(finest, 2)
    bases = [
        line_basis(size, ends, int(np.ceil(k * size / 2)) + MARGIN, split)
        for k, size, ends, split in zip(
            resolved, (plate.size_x, plate.size_y),
            ((plate.left, plate.right), (plate.front, plate.back)),
            _symmetries(plate), strict=True,
        )
    ]  # fmt: skip
    if (dofs := max(x.size * y.size for x, y in product(*bases))) > MOST_DOFS:
        raise ValueError(
            f"a plate of {1e3 * plate.size_x:g} by {1e3 * plate.size_y:g} mm takes {dofs:,} "
            f"degrees of freedom, the limit is {MOST_DOFS:,}; lower finest = {max(resolved):g}"
        )
    return PlateModes(plate=plate, families=tuple(_family(plate, x, y) for x, y in product(*bases)))


def steady_response(
    modes: PlateModes,
    frequencies: Floats,
    forces: Complex,
    outputs: Floats,
    loss_factor: float | Floats,
) -> Complex:
    """Steady displacement sum_m shape_m force_m / (w_m^2 (1 + i eta e_m) - w^2), e_m the elastic
    share of the mode's stiffness; the mean, at 0 Hz, without loss.

    Parameters
    ----------
    modes : PlateModes
    frequencies : (f,) Hz
    forces : (f, m) modal forces in N kg^-1/2
    outputs : (p, m) shapes where it is read, of `PlateModes.at`
    loss_factor : of bending; one, or one a frequency (f,)

    Returns
    -------
    (f, p) complex, metre
    """
    w = 2 * np.pi * np.asarray(frequencies)[:, None]
    loss = np.where(w > 0, np.reshape(loss_factor, (-1, 1)), 0.0)
    dynamic = modes.squared * (1 + 1j * loss * modes.elastic) - w**2
    return np.asarray((forces / dynamic) @ outputs.T)


def _symmetries(plate: Plate) -> tuple[bool, bool]:
    """Whether a plate is the same on both sides of its middle, along x and along y."""
    clips = np.array(plate.clips).reshape(-1, 2)

    def same(mirror: tuple[int, int]) -> bool:
        images = clips * mirror
        return all(np.abs(clips - image).max(axis=1).min() < 1e-9 for image in images)

    return (
        plate.left == plate.right and same((-1, 1)),
        plate.front == plate.back and same((1, -1)),
    )


def _family(plate: Plate, x: LineBasis, y: LineBasis) -> Family:
    bending, stretching = _stiffness(plate, x, y)
    mass = plate.mass_per_area * np.eye(x.size * y.size)
    if plate.air_density:
        mass += air_mass(x, y, plate.air_density)
    K = bending if stretching is None else bending + stretching
    free = _free_of_clips(plate, x, y)
    if free is None:
        squared, shapes = linalg.eigh(K, mass, check_finite=False, overwrite_b=True)
    else:
        squared, shapes = linalg.eigh(free.T @ K @ free, free.T @ mass @ free, check_finite=False)
        shapes = free @ shapes
    elastic = np.ones(len(squared))
    if stretching is not None:
        of_bending = np.einsum("nm,nm->m", shapes, bending @ shapes)
        elastic = np.clip(of_bending / np.maximum(squared, np.finfo(float).tiny), 0.0, 1.0)
    return Family(
        x=x, y=y, squared=squared, elastic=elastic, shapes=shapes.reshape(x.size, y.size, -1)
    )


def _stiffness(plate: Plate, x: LineBasis, y: LineBasis) -> tuple[Floats, Floats | None]:
    """Stiffness (n, n) in N/m per kg/m2 of bending, and of tension if there is any."""
    one_x, one_y = np.eye(x.size), np.eye(y.size)
    cross = np.kron(x.mixed, y.mixed.T)
    bending = (
        np.kron(plate.d11 * x.curvature, one_y)
        + np.kron(one_x, plate.d22 * y.curvature)
        + plate.d12 * (cross + cross.T)
        + np.kron(4 * plate.d66 * x.slope, y.slope)
    )
    if not (plate.tension_x or plate.tension_y):
        return bending, None
    along, across = plate.tension_x * x.slope, plate.tension_y * y.slope
    return bending, np.kron(along, one_y) + np.kron(one_x, across)


def _free_of_clips(plate: Plate, x: LineBasis, y: LineBasis) -> Floats | None:
    """Orthonormal basis (n, r) of what leaves the clips at rest; None without clips."""
    if not plate.clips:
        return None
    points = np.array(list(_fixed_points(plate)))
    rows = np.einsum("pi,pj->pij", x(points[:, 0]), y(points[:, 1])).reshape(len(points), -1)
    _, strength, known = linalg.svd(rows, full_matrices=False)
    independent = known[strength > 1e-7 * max(strength[0], np.finfo(float).tiny)]
    everything, _ = linalg.qr(independent.T, mode="full")
    return np.asarray(everything[:, len(independent) :])


def _fixed_points(plate: Plate) -> Iterator[Sequence[float]]:
    """Points (2,) in metre of the middle and the ring of each clip, on the plate or its edge."""
    half = np.array([plate.size_x, plate.size_y]) / 2
    turn = 2 * np.pi * np.arange(RING) / RING
    ring = WIDER * plate.clip_radius * np.column_stack([np.cos(turn), np.sin(turn)])
    for clip in plate.clips:
        yield clip
        if plate.clip_radius:
            yield from np.clip(clip + ring, -half, half)
