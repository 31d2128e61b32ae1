"""The air around a flat sheet of elements: its added mass, and what it takes by sound and friction.

For bending waves much slower than sound, the fluid is incompressible. In a baffle its added mass,
2 rho / k per wavenumber k with both sides together, is in space Rayleigh's integral without delay
(Junger and Feit, Sound, Structures, and Their Interaction (1986), sections 4.6 and 5.11),

    p(x) = rho/pi int w''(y) / |x - y| dA,   M_ab = rho/pi iint N_a(x) N_b(y) / |x - y| dA dA

M is dense, symmetric and positive. On a regular grid of nodes it is a convolution with int 1/r dA
over a cell, computed by a zero-padded FFT, so M is never formed. The relative error is
-(k s)^2 / 24 for node spacing s. In open air the pressure is a sum of the functions of
`simple_model.plates.air`, which also explains the losses: friction, and sound by the first terms of
its expansion in frequency, the monopole and dipole of a sheet in a baffle, the dipole of one in
open air. The next term is (k0 d / 6)^2 for a diagonal d, 3 % for A6 at 300 Hz.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import fft, linalg, sparse
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from fem.plane_stiffness import SIDES
from fem.sparsity import dofs_of, from_entries
from meshes import MeshError, TetMesh, facet_set
from simple_model.layers.compliance import AIR_VISCOSITY
from simple_model.load.focus import SPEED_OF_SOUND as C
from simple_model.plates.air import edge_functions, open_air
from simple_model.typing import Floats, Ints

RESISTANCES = {"friction": 0.5, "monopole": 2.0, "dipole": 4.0}  # powers of angular frequency


@dataclass(frozen=True, kw_only=True, eq=False)
class Air:
    """Added `mass` (n, n) in kg of the air around a sheet, and matrices (n, n) of `resistances`,
    each to be multiplied by its power of the angular frequency in `RESISTANCES`, in kg/s.
    """

    mass: LinearOperator
    resistances: Mapping[str, Any]


def air_around(
    mesh: TetMesh,
    free: Ints,
    density: float,
    *,
    frame: float = np.inf,
    axes: Floats = SIDES,
    mirrored: str = "",
    facets: str | Ints = "top",
) -> Air:
    """Return the air on both sides of a sheet.

    Parameters
    ----------
    mesh : TetMesh of a rectangle in equal cells
    free : (n,) int, free degrees of freedom
    density : density of the fluid, kg/m3
    frame : m, width of a rigid frame around the sheet, inf for a baffle
    axes : (2, 3) unit vectors along the sides of the rectangle
    mirrored : "x", "y" or "xy" if only the positive half along these axes is meshed. The other
        half moves as the mirror image; the result is that of the meshed part.
    facets : name of a facet set, or nodes (e, a), of the sheet

    Raises
    ------
    MeshError
        If the nodes of the facets do not form a regular grid.
    """
    nodes = np.unique(facet_set(mesh, facets))
    (columns, dx), (rows, dy) = (_grid_lines(mesh.points[nodes] @ axis) for axis in axes)
    shape = rows.max() + 1, columns.max() + 1
    if len(nodes) != shape[0] * shape[1]:
        raise MeshError("air around a sheet needs a rectangular sheet meshed in equal cells")
    # The trapezoidal rule: half of the cell around an edge node lies outside the sheet.
    of_y, of_x = (np.r_[0.5, np.ones(count - 2), 0.5] for count in shape)
    share, places = np.outer(of_y, of_x).ravel(), rows * shape[1] + columns
    normal = share[places, None] * np.cross(*axes)
    # Deflections (k,) at the nodes, each times the area of its cell. `pressure` maps such integrals
    # (k, m) of accelerations to the pressures at the nodes.
    read = from_entries(normal, places[:, None], dofs_of(nodes), (len(nodes), mesh.n_dofs))[:, free]
    read = dy * dx * read
    images = [axis in mirrored for axis in "xy"]
    x, y = (
        spacing * (np.arange(count) - (0 if image else (count - 1) / 2))
        for spacing, count, image in zip((dx, dy), shape[::-1], images, strict=True)
    )
    whole = 2.0 ** sum(images)  # times an integral over the meshed part
    finest = 350.0  # rad/m, of the pressure in open air
    spare = 6  # functions of this pressure on the sheet more than the wavenumber requires
    if frame == np.inf:
        field = near_field(shape, (dy, dx), images[::-1])

        def pressure(w: Floats) -> Floats:
            at_nodes = field(w.T.reshape(-1, *shape)).reshape(w.shape[1], -1).T
            return np.asarray(density / np.pi / (dy * dx) * at_nodes)

        along = [] if images[0] else [np.tile(x, (len(y), 1))]
        along += [] if images[1] else [np.tile(y[:, None], (1, len(x)))]
        moments = {"monopole": [np.ones((len(y), len(x)))], "dipole": along}
        rates = {"monopole": density / np.pi / C, "dipole": density / (3 * np.pi * C**3)}
    else:
        spans = [np.ptp(at) * (1 + image) for at, image in zip((x, y), images, strict=True)]
        sizes = [float(span) + 2 * frame for span in spans]
        orders = [
            np.arange(0, int(np.ceil(finest * size / 2 + spare * size / span)), 1 + image)
            for size, span, image in zip(sizes, spans, images, strict=True)
        ]
        names = tuple(tuple(each.tolist()) for each in orders)
        inverse, integrals = open_air(tuple(sizes), names, density)
        of_x, of_y = (
            edge_functions(n, size, at) for n, size, at in zip(orders, sizes, (x, y), strict=True)
        )
        functions = np.einsum("ia,jb->abji", of_x, of_y).reshape(len(inverse), -1)

        def pressure(w: Floats) -> Floats:
            return np.asarray(whole * functions.T @ (inverse @ (functions @ w)))

        moments = {"dipole": [(integrals @ inverse) @ functions]}
        rates = {"dipole": 1 / (12 * np.pi * density * C**3)}

    def apply(u: Floats) -> Floats:
        return np.asarray(read.T @ pressure(read @ u))

    n = len(free)
    mass = LinearOperator(
        (n, n), dtype=np.float64, matmat=apply, matvec=lambda u: apply(u.reshape(n, 1))
    )
    areas = sparse.diags_array(1 / (dy * dx * share))
    resistances: dict[str, Any] = {
        "friction": np.sqrt(2 * AIR_VISCOSITY * density) * (read.T @ areas @ read)
    }
    for name, each in moments.items():
        if each:
            pattern = np.sqrt(whole * rates[name]) * (
                read.T @ np.stack([m.ravel() for m in each], 1)
            )
            resistances[name] = aslinearoperator(pattern) @ aslinearoperator(pattern.T)
    return Air(mass=mass, resistances=resistances)


def damping(K: Floats, M: Floats, resistances: Mapping[str, Floats]) -> Floats:
    """Return the viscous damping (r, r) by projected resistances (r, r) that each mode of the
    stiffness K (r, r) and mass M (r, r) has at its own frequency.
    """
    squares, modes = linalg.eigh(K, M)
    dual, between = M @ modes, np.zeros(K.shape)
    for name, R in resistances.items():
        root = np.sqrt(growth(name, np.sqrt(np.maximum(squares, 0.0))))
        between += root[:, None] * (modes.T @ R @ modes) * root
    return np.asarray(dual @ between @ dual.T)


def growth(name: str, omega: Floats) -> Floats:
    """Return the factor (...) of a resistance at angular frequencies (...) in rad/s."""
    highest = 2 * np.pi * 1000.0  # rad/s: resistances of shorter waves grow no further
    return np.asarray(np.minimum(omega, highest) ** RESISTANCES[name])


def near_field(
    shape: tuple[int, int], spacing: tuple[float, float], mirrored: Sequence[bool] = (False, False)
) -> Callable[[Floats], Floats]:
    """Return a function that computes int w(y) / |x - y| dA of fields w (k, ny, nx) at the nodes of
    a grid with shape (ny, nx) and spacing (dy, dx) in m. `mirrored` adds the mirror images about
    the first line of nodes along y and x.
    """
    whole = [2 * n - 1 if image else n for n, image in zip(shape, mirrored, strict=True)]
    padded = [fft.next_fast_len(2 * n - 1, real=True) for n in whole]
    y, x = (np.fft.fftfreq(n, 1 / n) * step for n, step in zip(padded, spacing, strict=True))
    kernel = fft.rfft2(inverse_distance(x, y[:, None], spacing[::-1])).real

    def field(w: Floats) -> Floats:
        for axis, n in ((axis, shape[axis - 1]) for axis in (1, 2) if mirrored[axis - 1]):
            before = [(0, 0)] * 3
            before[axis] = (n - 1, 0)
            w = np.pad(w, before)
            w = w + np.flip(w, axis)
        p = fft.irfft2(kernel * fft.rfft2(w, padded), padded)
        ends = [slice(n - part, n) for n, part in zip(whole, shape, strict=True)]
        return np.asarray(p[:, *ends])

    return field


def inverse_distance(x: Floats, y: Floats, size: tuple[float, float]) -> Floats:
    """Return int 1/r dA (...), in m, over rectangles of one size (x, y) centred at x, y (...).

    It is x asinh(y/x) + y asinh(x/y) between the corners (Durand, Electrostatique, vol. 1 (1964)).
    """

    def corner(x: Floats, y: Floats) -> Floats:
        return x * np.arcsinh(y / np.abs(x)) + y * np.arcsinh(x / np.abs(y))

    (west, east), (south, north) = (
        (at - a / 2, at + a / 2) for at, a in zip((x, y), size, strict=True)
    )
    return corner(east, north) - corner(west, north) - corner(east, south) + corner(west, south)


def _grid_lines(x: Floats) -> tuple[Ints, float]:
    """Return the number (n,) of the grid line at each coordinate (n,), and the line spacing."""
    gaps = np.diff(np.sort(x))
    grid_tolerance = 1e-6  # of a spacing, between a node and its place on the grid
    step = gaps[gaps > grid_tolerance * np.ptp(x)].min()
    index = np.rint((x - x.min()) / step).astype(np.int64)
    step = float(np.ptp(x) / index.max())
    if np.abs(x - x.min() - step * index).max() > grid_tolerance * step:
        raise MeshError("air around a sheet needs nodes on a regular grid")
    return index, step
