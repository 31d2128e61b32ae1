"""Range of bodies on one moved mesh, and the geometries between which their matrices are
interpolated.

Where nodes move in proportion to the thickness d_k of their layer, each matrix of a body is a sum

    A(d) = A_0 + sum_k (d_k B_k + C_k / d_k)

of as many terms as there are independent functions 1, d_k and 1/d_k. It is known for all d from as
many geometries, to round-off: an error as small as 1e-4 would already act against lam, 5,000 times
mu in soft tissue.
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

CANDIDATES = (1 - np.cos(np.pi * np.arange(5) / 4)) / 2  # along each thickness, shares of its range
INDEPENDENT = 1e-9  # of the largest pivot: functions whose rest is less are sums of others


@dataclass(frozen=True, kw_only=True, eq=False)
class Range:
    """Bodies of a range: `body` at shares (k,) of it, 0 to 1, meshed at the shares `meshed` (k,)
    with elements of `h` in metre; matrices are known at those of the `geometries` (g, k), where the
    functions of the thicknesses that `chosen` names are `known` (g, g).
    """

    body: Callable[[Sequence[float]], Body]
    meshed: tuple[float, ...]
    h: float | None
    geometries: tuple[tuple[float, ...], ...]
    chosen: tuple[int, ...]
    known: Floats


def range_of(
    body: Callable[[Sequence[float]], Body],
    meshed: tuple[float, ...],
    thicknesses: Sequence[bool],
    h: float | None,
) -> Range:
    """Range of bodies, with the geometries that its matrices are interpolated between.

    Parameters
    ----------
    body : body at shares (k,) of the range
    meshed : (k,) shares of the body that the mesh is of
    thicknesses : (k,) whether each share is that of a thickness
    h : metre, element size; the default of the body that is meshed if not given

    Returns
    -------
    Range
    """
    each = [CANDIDATES.tolist() if is_one else [at] for is_one, at in zip(thicknesses, meshed)]  # noqa: B905
    candidates = list(product(*each))
    functions = np.array([_functions(body(at)) for at in candidates])
    scaled = functions / np.abs(functions).max(axis=0)
    _, R, order = qr(scaled, mode="economic", pivoting=True)
    rank = int((np.abs(np.diag(R)) > INDEPENDENT * abs(R[0, 0])).sum())
    chosen = np.sort(order[:rank])
    rows = np.sort(qr(scaled[:, chosen].T, mode="economic", pivoting=True)[2][:rank])
    return Range(
        body=body, meshed=meshed, h=h, geometries=tuple(candidates[k] for k in rows),
        chosen=tuple(chosen.tolist()), known=functions[np.ix_(rows, chosen)],
    )  # fmt: skip


def geometry_shares(bodies: Range, body: Body) -> Floats:
    """Shares (g,) of the known geometries in the matrices of a body of the range."""
    if len(bodies.geometries) == 1:
        return np.ones(1)
    values = _functions(body)[list(bodies.chosen)]
    return np.asarray(np.linalg.solve(bodies.known.T, values))


def nearest_geometry(bodies: Range, at: Sequence[float]) -> tuple[float, ...]:
    """Shares (k,) of a body of the same materials whose geometry is one of those known."""
    geometries = np.array(bodies.geometries)
    moved = np.ptp(geometries, axis=0) > 0
    k = int(np.argmin(np.linalg.norm((geometries - at)[:, moved], axis=1)))
    return tuple(np.where(moved, geometries[k], at).tolist())


def build_at(bodies: Range, at: Sequence[float], symmetry: str = "") -> Build:
    """Mesh that all have, moved to the thicknesses of a body; of the materials that it was
    meshed with.

    Parameters
    ----------
    bodies : Range
    at : (k,) shares of the range
    symmetry : as of `bodies.build.build`

    Returns
    -------
    Build
    """
    reference = bodies.body(bodies.meshed)
    if len(bodies.geometries) == 1:
        return build(reference, bodies.h, symmetry)
    moved = np.ptp(np.array(bodies.geometries), axis=0) > 0
    body = bodies.body(np.where(moved, at, bodies.meshed).tolist())
    h = bodies.h or body.of_kind.default_size(reference)
    assert body.of_kind.morph  # else refused
    return build(body, h, symmetry, partial(body.of_kind.morph, reference=reference))


def _functions(body: Body) -> Floats:
    """1, and d and 1/d of each stratum's thickness d in metre."""
    d = np.diff([*(start for start, _ in body.strata), body.depth])
    return np.concatenate([[1.0], d, 1 / d])
