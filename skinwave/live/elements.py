"""Packs of finite-element bodies: the poles of a reduced model for any path of the focus.

    u(x, w) = sum_p O_p(x) F_p / (i w - pole_p) + conj(O_p(x) F_p(-w) / (-i w - pole_p))

The reduced basis is the proper orthogonal decomposition of the steady motion under focal spots over
the whole area, at frequencies of the band. Stiffness, damping and mass are symmetric, so the load
acts through the same fields O_p that give the motion. Per area of the grid, the force of the load
is proportional to the cosine of the slope: its square (`skinwave.scene.load`), over a larger area.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy import sparse

import fem
from fem.harmonic import LineSolver
from fem.load_and_probe import on_surface
from simple_model.layers.prony import FIT_TOLERANCE
from skinwave.bodies.build import Build, build, operators
from skinwave.live.sheets import SIDE, STEP, grid_line
from skinwave.models.laws import relaxing
from skinwave.models.meshed import surface_load, surface_motion
from skinwave.scene.scene import STILL, Body
from skinwave.system.arrays import pack, quantise
from skinwave.system.effort import Progress, silent
from skinwave.typing import Floats


@dataclass(frozen=True, kw_only=True)
class Training:
    """Training loads of the reduced basis, its size, and the error of its pack."""

    lowest: float = 0.15  # m: lowest height of the focus whose spot the elements resolve
    reach: float = 0.031  # m: radius of the area of spots
    spacing: float = 0.0042  # m between spots. Wider spacing leaves out parts of the narrowest one
    frequencies: tuple[float, ...] = (20.0, 85.0, 155.0, 230.0, 315.0, 415.0, 540.0)  # Hz
    negligible: float = 1e-4  # relative RMS motion that the basis may miss
    most: int = 700  # dimensions of the basis
    error: float = 0.25  # relative, of components up to `band` and within 20 dB of the strongest
    band: float = 300.0  # Hz


def element_pack(
    body: Body, h: float, progress: Progress = silent, training: Training = Training()
) -> dict[str, Any]:
    """Return the pack of a finite-element body with elements of `h` in m, as a dict for JSON."""
    progress("mesh", 0.0)
    body = relaxing(body, FIT_TOLERANCE)
    made = build(body, h)
    progress("assemble", 0.0)
    ops = operators(made)
    P, points = surface_load(made)
    pressure = replace(STILL, height=training.lowest)
    forces = P @ pressure.spot(points, training_knots(body, training)).T
    basis = training_basis(ops, forces, training, partial(progress, "solve for focal spots"))
    progress("reduce", 0.0)
    poles, turn = reduced_poles(ops, basis)
    places, inside, cosines, heights = surface_grid(body, made)
    read = surface_reading(body, made, places[inside]) @ basis
    fields = (turn.T @ read.T).astype(np.complex64)
    return {
        "kind": "poles", "step": STEP, "side": SIDE,
        "lowest_height_mm": 1e3 * training.lowest, "reach_mm": 1e3 * training.reach,
        "poles": pack(poles), "fields": quantise(fields, bits=12),
        "cosines": quantise(cosines[None]),
        "inside": "".join("01"[int(each)] for each in inside),
        "heights": quantise(1e3 * heights[None]),
        "error": training.error, "band_hz": training.band,
        "warnings": [
            f"The error is {100 * training.error:g} % for components up to {training.band:g} Hz "
            "and within 20 dB of the strongest one. It may be larger at higher frequencies, marked "
            "\u2248, and for weaker ones."
        ],
    }  # fmt: skip


def training_knots(body: Body, training: Training) -> Floats:
    """Return places (j, 2) in m of focal spots over the whole area, on a triangular grid."""
    reach, height = training.reach, 0.75**0.5  # of a triangle of side 1
    most = int(2 * reach / (training.spacing * height)) + 1
    column, row = np.meshgrid(*2 * [np.arange(-most, most + 1)])
    knots = training.spacing * np.stack([column + row % 2 / 2, height * row], -1).reshape(-1, 2)
    half = np.array([body.width, body.height]) / 2 if body.of_kind.is_bounded else reach
    return knots[(np.hypot(*knots.T) <= reach) & (np.abs(knots) <= half).all(axis=1)]


def training_basis(
    ops: fem.Operators, forces: Floats, training: Training, report: Callable[[float], None]
) -> np.ndarray:
    """Return a basis (3 n, r) of the steady motion under loads (3 n, j) at all frequencies."""
    solve = LineSolver(ops, accuracy=1e-5)  # below what single precision keeps of the basis
    snapshots: list[np.ndarray] = []
    for k, frequency in enumerate(training.frequencies):
        report(k / len(training.frequencies))
        part = solve(frequency, forces)[ops.free]
        motion = np.hstack([part.real.astype(np.float32), part.imag.astype(np.float32)])
        snapshots.append(motion / float(np.linalg.norm(motion)))
    motions = np.hstack(snapshots)
    squares, turn = np.linalg.eigh((motions.T @ motions).astype(np.float64))
    squares, turn = squares[::-1], turn[:, ::-1]
    missed = np.sqrt(np.maximum(np.cumsum(squares[::-1])[::-1], 0.0) / squares.sum())
    size = min(training.most, int((missed > training.negligible).sum()))
    basis = np.zeros((len(forces), size), np.float32)
    basis[ops.free] = motions @ (turn[:, :size] / np.sqrt(squares[:size])).astype(np.float32)
    return basis


def reduced_poles(ops: fem.Operators, basis: np.ndarray) -> tuple[fem.Complex, fem.Complex]:
    """Return the poles (p,) in 1/s, with imaginary part >= 0, of the reduced body, and their
    combinations (r, p) of the basis.
    """
    V = basis[ops.free].astype(np.float64)
    projected = [V.T @ (A @ V) for A in (ops.M, ops.K, ops.C)]
    M, K, C = ((A + A.T) / 2 for A in projected)
    branches = tuple(
        fem.MaxwellBranch(K=V.T @ (each.K @ V), time=each.time)
        for each in ops.branches
        if isinstance(each, fem.MaxwellBranch)  # `relaxing` leaves no other
    )
    small = fem.Operators(
        K=K, C=C, M=M, R=np.zeros_like(K), free=np.arange(len(K)), n_dofs=len(K), branches=branches
    )
    poles = fem.poles(small)
    outputs, inputs = poles.outputs, poles.inputs.T
    # The operators are symmetric: inputs and outputs of a pole differ by a factor.
    factor = (outputs.conj() * inputs).sum(axis=0) / (np.abs(outputs) ** 2).sum(axis=0)
    return poles.values, outputs * np.sqrt(factor)


def surface_reading(
    body: Body, made: Build, places: Floats, *, width: float = 2e-3
) -> sparse.csr_array:
    """Return the operator (p, 3 n) of the motion around places (p, 2) in m of the grid.

    Slopes of a mesh jump at the edges of its elements, and sums over the grid, which replace
    integrals over the surface, would contain the jumps. The motion is therefore averaged over finer
    places. With x = (k width)^2 / 2 the transform of the averaging kernel is
    exp(-x) (1 + x + x^2 / 2), which changes waves longer than 10 mm by less than 5 %.
    """
    within = np.arange(-8, 9) * width / 2
    offsets = np.stack(np.meshgrid(within, within), -1).reshape(-1, 2)
    fine, index = np.unique(
        np.round((places[:, None] + offsets).reshape(-1, 2), 9), axis=0, return_inverse=True
    )
    q = (offsets**2).sum(axis=1) / width**2
    kernel = np.exp(-q / 2) * (1 - (q - 2) / 2 + (q**2 - 8 * q + 8) / 8)
    rows = np.repeat(np.arange(len(places)), len(offsets))
    values = np.tile(kernel, len(places))
    on = on_surface(made.mesh, fine)
    shares = sparse.csr_array((values, (rows, index.ravel())), shape=(len(places), len(fine)))
    shares = sparse.csr_array(shares[:, on])
    shares = sparse.diags_array(1 / shares.sum(axis=1)) @ shares
    return (shares @ surface_motion(body, made, fine[on])).tocsr()


def surface_grid(body: Body, made: Build) -> tuple[Floats, np.ndarray, Floats, Floats]:
    """Return the places (SIDE^2, 2) in m of the grid, whether they are on the body, and the cosine
    of the slope and the height in m of the surface there, (SIDE^2,) each.
    """
    from scipy.interpolate import LinearNDInterpolator  # slow to import

    x, y = np.meshgrid(grid_line(), grid_line())
    places = np.column_stack([x.ravel(), y.ravel()])
    inside = on_surface(made.mesh, places)
    points = made.mesh.points[np.unique(made.mesh.facets["top"])]
    known = LinearNDInterpolator(points[:, :2], points[:, 2])(places[inside])
    heights = np.zeros(len(places))
    heights[inside] = np.nan_to_num(known, nan=float(points[:, 2].max()))
    surface = np.where(inside, heights, np.nan).reshape(SIDE, SIDE)
    slope = np.nan_to_num(np.stack(np.gradient(surface, STEP)))
    return places, inside, (1 + (slope**2).sum(axis=0)).ravel() ** -0.5, heights
