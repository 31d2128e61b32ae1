"""Ritz's method beside thin-plate elements of scikit-fem on candidates of the inference.

    python -m bench.thin_sheets [--sheets 0 1 ...] [--cells 48 72]

Solid elements bend like a thin plate only in the limit of a small thickness, and a lightly damped
sheet shows a part in a thousand of a frequency. Bogner, Fox and Schmit's rectangles have no
thickness: bicubic, with continuous slopes. Prints a row a sheet and a number of cells along it, as
`bench.sheets_against_fem` does, in vacuum; elements are smaller at the sides of clips.
"""

import argparse
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from scipy import sparse

from bench.sheets_against_fem import (
    CHOSEN,
    HIGHEST,
    Lines,
    backward_error,
    by_modes,
    candidates,
    line_error,
    modal_forces,
)
from fem.linear_solver import factorise
from simple_model.layers.constant_loss import constant_loss
from simple_model.load.spectrum import pressure_lines
from simple_model.plates.modes import Plate, plate_modes
from simple_model.typing import Floats
from skinwave.inference.assess import finest
from skinwave.inference.design import Candidate, middle, plate, pressure, probes, sizes
from skinwave.scene.paper15 import tactons

FINER = 0.05  # of a clip's radius: elements at its sides, on the coarsest mesh
GROWTH = 1.3  # of elements away from there


@dataclass(frozen=True, kw_only=True, eq=False)
class Elements:
    """Matrices of bending, tension and mass on the free dofs of a scikit-fem basis."""

    basis: Any
    free: np.ndarray
    bending: sparse.csr_array
    tension: sparse.csr_array
    mass: sparse.csr_array


def places(size: float, sides: list[float], cells: int, reach: float) -> Floats:
    """Grid lines along a sheet, closer at the sides of clips."""
    largest, ends = size / cells, [-size / 2, *sides, size / 2]
    least = min(largest, FINER * reach * 48 / cells) if sides else largest
    found = [np.array([-size / 2])]
    for low, high in pairwise(ends):
        fine = np.linspace(low, high, 20001)
        near = np.min([np.abs(fine - side) for side in sides] or [fine * 0 + size], axis=0)
        density = 1 / np.minimum(largest, least + (GROWTH - 1) * near)
        counted = np.concatenate([[0], np.cumsum((density[1:] + density[:-1]) / 2)])
        steps = max(2, int(np.ceil(counted[-1] * (fine[1] - fine[0]))))
        found.append(np.interp(np.linspace(0, 1, steps + 1)[1:], counted / counted[-1], fine))
    return np.concatenate(found)


def of_elements(own: Plate, cells: int) -> Elements:
    """Elements of a plate in vacuum."""
    from skfem import Basis, BilinearForm, ElementQuadBFS, MeshQuad
    from skfem.helpers import dd, grad

    lines = []
    for axis, size in enumerate((own.size_x, own.size_y)):
        sides = {round(c[axis] + s * own.clip_radius, 12) for c in own.clips for s in (-1, 1)}
        inner = sorted(at for at in sides if abs(at) < size / 2 - 1e-6)
        lines.append(places(size, inner, cells, own.clip_radius))
    basis = Basis(MeshQuad.init_tensor(*lines), ElementQuadBFS(), intorder=7)

    @BilinearForm
    def bending(u: Any, v: Any, _: Any) -> Any:
        a, b = dd(u), dd(v)
        along = own.d11 * a[0, 0] * b[0, 0] + own.d12 * a[0, 0] * b[1, 1]
        across = own.d12 * a[1, 1] * b[0, 0] + own.d22 * a[1, 1] * b[1, 1]
        return along + across + 4 * own.d66 * a[0, 1] * b[0, 1]

    @BilinearForm
    def tension(u: Any, v: Any, _: Any) -> Any:
        a, b = grad(u), grad(v)
        return own.tension_x * a[0] * b[0] + own.tension_y * a[1] * b[1]

    @BilinearForm
    def mass(u: Any, v: Any, _: Any) -> Any:
        return own.mass_per_area * u * v

    free = np.setdiff1d(np.arange(basis.N), fixed(own, basis))
    K, T, M = (
        sparse.csr_array(form.assemble(basis))[free][:, free] for form in (bending, tension, mass)
    )
    return Elements(basis=basis, free=free, bending=K, tension=T, mass=M)


def fixed(own: Plate, basis: Any) -> np.ndarray:
    """Dofs that edges and clips hold: deflection, slopes along x and y, and twist of a node."""
    x, y = basis.mesh.p
    deflection, along_x, along_y, twist = basis.nodal_dofs
    found = []
    for name, across, at, slope in (
        ("left", x, -own.size_x / 2, along_x), ("right", x, own.size_x / 2, along_x),
        ("front", y, -own.size_y / 2, along_y), ("back", y, own.size_y / 2, along_y),
    ):  # fmt: skip
        support, there = getattr(own, name), np.abs(across - at) < 1e-9
        if support != "free":
            found += [deflection[there], (along_y if slope is along_x else along_x)[there]]
        if support == "clamped":
            found += [slope[there], twist[there]]
    for clip in own.clips:
        there = np.maximum(np.abs(x - clip[0]), np.abs(y - clip[1])) < own.clip_radius + 1e-9
        found += [dofs[there] for dofs in basis.nodal_dofs]
    return np.unique(np.concatenate(found))


def by_elements(candidate: Candidate, made: Elements) -> Lines:
    """Frequencies and lines (f, p) of each Tacton up to 1 kHz."""
    from skfem import LinearForm

    @LinearForm
    def pushed(v: Any, w: Any) -> Any:
        return w.p * v

    basis, found, modulus = made.basis, {}, constant_loss(candidate["loss_factor"])
    at = middle(candidate)
    read = sparse.csr_array(basis.probes((probes(candidate) - at).T))[:, made.free]
    quadrature = basis.global_coordinates().value
    points = quadrature.reshape(2, -1).T + at
    for name, tacton in tactons():
        if name not in CHOSEN:
            continue
        load = pressure(candidate, tacton)
        f, pressures = pressure_lines(load, points)
        kept = (f > 0) & (f < 1000)
        lines = []
        for w, p in zip(2 * np.pi * f[kept], pressures[kept], strict=True):
            parts = (p.real, p.imag)
            force = [pushed.assemble(basis, p=q.reshape(quadrature.shape[1:])) for q in parts]
            dynamic = modulus(w) * made.bending + made.tension - w**2 * made.mass
            # Deflections, slopes and twists are of other units.
            scale = 1 / np.sqrt(made.bending.diagonal())
            A = sparse.csr_array(sparse.diags_array(scale) @ dynamic @ sparse.diags_array(scale))
            u = factorise(A).solve(scale * (force[0] + 1j * force[1])[made.free])
            lines.append(read @ (scale * u))
        found[name] = f[kept], np.array(lines)
    return found


def frequencies(made: Elements) -> Floats:
    """Natural frequencies in Hz below `HIGHEST`."""
    from scipy.sparse.linalg import LinearOperator, eigsh

    K, sigma = made.bending + made.tension, (2 * np.pi * 1.0) ** 2
    scale = sparse.diags_array(1 / np.sqrt(made.bending.diagonal()))
    K, M = sparse.csr_array(scale @ K @ scale), sparse.csr_array(scale @ made.mass @ scale)
    shifted = factorise(sparse.csr_array(K + sigma * M))
    inverse = LinearOperator(K.shape, matvec=shifted.solve, dtype=np.float64)
    squared = eigsh(K, 60, M, sigma=-sigma, OPinv=inverse, return_eigenvectors=False)
    f = np.sort(np.sqrt(squared)) / (2 * np.pi)
    return np.asarray(f[f < HIGHEST])


def main() -> None:
    """Print the errors of each sheet."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sheets", type=int, nargs="+", default=range(20))
    parser.add_argument("--cells", type=int, nargs="+", default=[48, 72])
    options = parser.parse_args()
    all_of = candidates(max(options.sheets) + 1)
    for k in options.sheets:
        candidate, (x, y) = all_of[k], sizes(all_of[k])
        own = replace(plate(candidate), air_density=0.0)
        modes = plate_modes(own, finest(candidate))
        of_part = partial(by_modes, candidate, modes, modal_forces(candidate, modes))
        before: Lines = {}
        for cells in options.cells:
            made = of_elements(own, cells)
            elements, f = by_elements(candidate, made), frequencies(made)
            apart = np.abs(modes.frequencies - f[:, None]).min(axis=1) / f
            lines, (least, off) = (
                line_error(elements, of_part(0.0)),
                backward_error(elements, of_part),
            )
            itself = 100 * line_error(elements, before) if before else np.nan
            before = elements
            print(f"{k:2d} {1e3 * x:4.0f} x {1e3 * y:3.0f} mm  {candidate['support']:10s} loss "
                  f"{candidate['loss_factor']:.3f}  {cells:3d} cells, {len(made.free):6,d} dofs  "
                  f"frequencies {100 * apart.max():6.3f} %  lines {100 * lines:6.2f} %, "
                  f"{100 * least:5.2f} % of a stiffness {100 * off:+.2f} % off; elements "
                  f"{itself:6.2f} %", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
