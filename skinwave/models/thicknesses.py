"""Range of bodies on one moved mesh, and the geometries between which their matrices are
interpolated.

Where nodes move in proportion to the thickness d_k of their layer, each matrix of a body is a sum

    A(d) = A_0 + sum_k (d_k B_k + C_k / d_k)

of as many terms as there are independent functions 1, d_k and 1/d_k. It is known for all d from as
many geometries, to round-off: an error as small as 1e-4 would already act against lam, 5,000 times
mu in soft tissue. Where nodes move otherwise, but smoothly, it is a series of Chebyshev polynomials
in log d. Those of stiffness and mass converge geometrically: the stiffness of a palm from 14 to
20 mm has errors of 4e-4 by 5 of them, 3e-5 by 7 and 4e-7 by 9 (of its largest entry). Its support
begins less smoothly on the rim, and has 2e-4.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from scipy.linalg import qr

from meshes.tetmesh import Floats
from skinwave.bodies.body import Body
from skinwave.bodies.build import Build, build
from skinwave.bodies.discretised import Discretise
from skinwave.bodies.sizes import default_size

CANDIDATES, SMOOTH = 5, 7  # geometries along each thickness: for sums of d and 1/d, and else
INDEPENDENT = 1e-9  # of the largest pivot: functions whose rest is less are sums of others


@dataclass(frozen=True, kw_only=True, eq=False)
class Range:
    """Bodies of a range: `body` at shares (k,) of it, 0 to 1, meshed at the shares `meshed` (k,)
    with elements of `h` in metre, or its default, whose nodes are `moved` to a body's thicknesses.

    Matrices are combinations of `functions` of a body's thicknesses. They are assembled at the
    shares `geometries` (g, k), where the independent functions, of numbers `chosen` (g,), have the
    values `known` (g, g).
    """

    body: Callable[[Sequence[float]], Body]
    meshed: tuple[float, ...]
    h: float | None
    moved: Discretise | None
    geometries: tuple[tuple[float, ...], ...]
    functions: Callable[[Body], Floats]
    chosen: tuple[int, ...]
    known: Floats


def range_of(
    body: Callable[[Sequence[float]], Body],
    meshed: tuple[float, ...],
    thicknesses: Sequence[bool],
    h: float | None,
) -> Range:
    """Range of bodies, with the geometries that its matrices are interpolated between: of a body at
    shares (k,) of which some are of `thicknesses` (k,), on a mesh of that at the shares `meshed`.
    Raises a ValueError if no mesh can be moved over the range.
    """
    reference, free = body(meshed), np.array(thicknesses)
    kind, moved, count, functions = reference.of_kind, None, CANDIDATES, _terms
    if free.any() and kind.morph:
        thinnest = body(np.where(free, 0.0, meshed).tolist())
        moved = kind.morph(thinnest, reference, h or default_size(reference))
        if not kind.moves_in_proportion:
            count, functions = SMOOTH, partial(_polynomials, thinnest, reference)
    along = ((1 - np.cos(np.pi * np.arange(count) / (count - 1))) / 2).tolist()
    each = [along if is_one else [at] for is_one, at in zip(thicknesses, meshed, strict=True)]
    candidates = list(product(*each))
    values = np.array([functions(body(at)) for at in candidates])
    scaled = values / np.abs(values).max(axis=0)
    _, R, order = qr(scaled, mode="economic", pivoting=True)
    rank = int((np.abs(np.diag(R)) > INDEPENDENT * abs(R[0, 0])).sum())
    chosen = np.sort(order[:rank])
    rows = np.sort(qr(scaled[:, chosen].T, mode="economic", pivoting=True)[2][:rank])
    return Range(
        body=body, meshed=meshed, h=h, moved=moved, functions=functions,
        geometries=tuple(candidates[k] for k in rows), chosen=tuple(chosen.tolist()),
        known=values[np.ix_(rows, chosen)],
    )  # fmt: skip


def geometry_shares(bodies: Range, body: Body) -> Floats:
    """Shares (g,) of the known geometries in the matrices of a body of the range."""
    if len(bodies.geometries) == 1:
        return np.ones(1)
    values = bodies.functions(body)[list(bodies.chosen)]
    return np.asarray(np.linalg.solve(bodies.known.T, values))


def nearest_geometry(bodies: Range, at: Sequence[float]) -> tuple[float, ...]:
    """Shares (k,) of a body of the same materials whose geometry is one of those known."""
    geometries = np.array(bodies.geometries)
    moved = np.ptp(geometries, axis=0) > 0
    k = int(np.argmin(np.linalg.norm((geometries - at)[:, moved], axis=1)))
    return tuple(np.where(moved, geometries[k], at).tolist())


def build_at(bodies: Range, at: Sequence[float], symmetry: str = "") -> Build:
    """Mesh that all have, moved to the thicknesses of the body at shares (k,) of the range; of the
    materials that it was meshed with.
    """
    reference = bodies.body(bodies.meshed)
    free = np.ptp(np.array(bodies.geometries), axis=0) > 0
    body = bodies.body(np.where(free, at, bodies.meshed).tolist())
    return build(body, bodies.h or default_size(reference), symmetry, bodies.moved)


def _terms(body: Body) -> Floats:
    """1, and d and 1/d of each stratum's thickness d in metre."""
    d = np.diff(body.interfaces)
    return np.concatenate([[1.0], d, 1 / d])


def _polynomials(thinnest: Body, thickest: Body, body: Body) -> Floats:
    """Chebyshev polynomials of the logarithm of the one thickness that differs."""
    ends = np.log([each.thicknesses for each in (thinnest, thickest)])
    free = int(np.argmax(ends[1] - ends[0]))
    (low, high), now = ends[:, free], np.log(body.thicknesses[free])
    angle = np.arccos(np.clip((2 * now - low - high) / (high - low), -1, 1))
    return np.asarray(np.cos(np.arange(SMOOTH) * angle))
