"""Quantities at the probes of a thin sheet, from the middle plane of its mesh.

Strain is Green-Lagrange strain, and stress is second Piola-Kirchhoff stress, along axes that rotate
with the sheet. At the small strains of paper it equals Cauchy's stress along these axes.
"""

from collections.abc import Callable

import numpy as np
from scipy import sparse

import fem
from fem import sheet_reading as sheet
from fem.reduced_nonlinear import StretchingModes, in_plane_matrices
from meshes import middle_plane
from simple_model import Material
from simple_model.quantities import STRAIN
from skinwave.bodies.body import Body
from skinwave.bodies.build import Build
from skinwave.scene.scene import Reading
from skinwave.typing import Floats

Reader = Callable[[Floats], Floats]  # displacement or coordinates -> components (p c,)


def sheet_rows(
    body: Body, build: Build, probes: Floats, reading: Reading
) -> tuple[sparse.csr_array, tuple[Material, ...]]:
    """Return the rows (p c, 3 n) of quantities of a sheet other than its normal motion."""
    points, quantity = _points(body, build, probes), reading.record
    below = np.broadcast_to(reading.depths or 0.0, len(probes))
    heights, solid = body.depth / 2 - below, body.solid.without_loss_factor()
    linear = sheet.displacement_rows(points, heights)
    if quantity.field == STRAIN:
        linear = sheet.strain_rows(points, heights, solid.poisson)
    rows = sparse.kron(sparse.eye_array(len(probes)), quantity.rows(solid), format="csr")
    return (rows @ linear).tocsr(), (solid,) * len(probes)


def full_reader(body: Body, build: Build, probes: Floats, reading: Reading) -> Reader:
    """Return a function from the displacement (3 n,) of a sheet to components (p c,)."""
    if reading.record.is_normal:
        normal = fem.probe_operator(build.mesh, probes)
        return lambda u: normal @ u
    (rows, _), points = sheet_rows(body, build, probes, reading), _points(body, build, probes)
    displacement, strain = sheet.in_plane_rows(points)
    own = reading.record.rows(body.solid)
    if reading.record.field != STRAIN:
        return lambda u: rows @ u + ((displacement @ u).reshape(-1, 2) @ own[:, :2].T).ravel()
    plane = own @ sheet.from_plane(body.solid.poisson)

    def read(u: Floats) -> Floats:
        stretched = (strain @ u).reshape(-1, 3) + sheet.quadratic_strain_at(points, u)
        return np.asarray(rows @ u + (stretched @ plane.T).ravel())

    return read


def modal_reader(
    body: Body, build: Build, modes: StretchingModes, operators: fem.Operators, probes: Floats,
    reading: Reading, solver: str,
) -> Reader:  # fmt: skip
    """Return a function from modal coordinates (r,) to the c components at p probes (p c,)."""
    quantity = reading.record
    if quantity.is_normal:
        normal = fem.probe_operator(build.mesh, probes) @ modes.basis
        return lambda z: normal @ z
    (rows, _), points = sheet_rows(body, build, probes, reading), _points(body, build, probes)
    displacement, strain = sheet.in_plane_rows(points)
    by_strain = quantity.field == STRAIN
    Q = in_plane_matrices(
        points, modes.basis, strain if by_strain else displacement, operators, solver=solver
    ).reshape(len(probes), 3 if by_strain else 2, *(2 * modes.basis.shape[1:]))
    own = quantity.rows(body.solid)[:, :2]
    if by_strain:
        Q = Q + sheet.modal_quadratic_strain(points, modes.basis)
        own = quantity.rows(body.solid) @ sheet.from_plane(body.solid.poisson)
    linear = rows @ modes.basis
    Q = np.einsum("ca,pamn->pcmn", own, Q).reshape(-1, *Q.shape[2:])
    return lambda z: linear @ z + (Q @ z) @ z / 2


def _points(body: Body, build: Build, probes: Floats) -> sheet.SheetReading:
    membrane = fem.Membrane(
        triangles=middle_plane(build.mesh), thickness=body.depth, material=body.solid
    )
    return sheet.sheet_reading(build.mesh, membrane, probes)
