"""Finite-element body that is reduced to a path for all stiffnesses and losses of a range.

Sliders of its materials then need no further reduction: its matrices are weighted sums of projected
ones (`fem.affine`). The basis of all materials is larger than that of one, and the poles of each
are those of a matrix of twice its size; proper orthogonal decomposition of the motion under the
path's load, over materials and frequencies, leaves the part of it that takes part.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy import sparse

import fem
from fem.affine import AffineOperators, Solids, interpolated, operators_of, weights
from fem.reduced_affine import AffineModel, Geometry, Variant, reduce_affine
from meshes.tetmesh import Floats
from simple_model import Effort
from simple_model.material import Material
from simple_model.prony import FIT_TOLERANCE
from skinwave.bodies.build import Build
from skinwave.effort import Progress
from skinwave.models.free_keys import training_shares
from skinwave.models.free_materials import Reference, affine_operators, reference_of, solids_of
from skinwave.models.laws import relaxing
from skinwave.models.reduction import BAND, ReducedBody, reduced_variant
from skinwave.scene import Body, Layer, solid_of
from skinwave.web.layer_values import loss_factor

MODULUS, LOSS = (0.4, 2.5), (0.5, 2.0)  # of a body's own modulus and loss factor: the range
TOLERANCE = 0.02  # of the reduction for each material
SLACK = 1e-6  # of a range: round-off of values as text
LEFT_OUT = 1e-2  # relative motion that the decomposition leaves out, in the root mean square
LOWEST, FREQUENCIES = 20.0, 12  # Hz, and how many up to `BAND` it is made at


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeBody:
    """Reduced body of every material of a range: projected operators `affine`, reduced forces
    `load` (k, m) of unit pressure at the surface `points` (k, 3) in metre, and the `basis`
    (3 n, m); the `reference` is what was meshed.
    """

    reference: Reference
    affine: AffineOperators
    load: Floats
    points: Floats
    basis: Floats
    effort: Effort


def covers(base: Body, body: Body) -> bool:
    """Whether a body differs from another by no more than moduli and losses within range."""
    own, now = _materials(base), _materials(body)
    if len(own) != len(now) or replace(body, layers=base.layers, material=base.material) != base:
        return False
    pairs = list(zip(own, now, strict=True))
    return all(
        low * (1 - SLACK) <= ratio <= high * (1 + SLACK)
        for (low, high), ratios in (
            (MODULUS, [b.shear_modulus / a.shear_modulus for a, b in pairs]),
            (LOSS, [(loss_factor(b) or 1.0) / (loss_factor(a) or 1.0) for a, b in pairs]),
        )
        for ratio in ratios
    )


def free_body(
    base: Body,
    made: Build,
    surface: tuple[sparse.csr_array, Floats],
    subspace: Floats,
    spots: Floats,
    report: Progress,
) -> FreeBody:
    """Reduce a body to the load of a path, for all materials of the range.

    Parameters
    ----------
    base : Body, of its own materials
    made : its mesh
    surface : load operator (3 n, k) and points (k, 3) in metre
    subspace : (3 n, s) float, of the nodal forces of the path
    spots : (3 n, j) float, nodal forces of unit pressure along the path
    report : called with the name of the phase and the fraction done

    Returns
    -------
    FreeBody
    """
    (P, points), reference = surface, reference_of(base, made, ())
    report("factorise", 0.0)
    affine = affine_operators(base, made)
    frequencies = np.geomspace(LOWEST, BAND, FREQUENCIES)
    forces = spots[affine.free].T
    some = np.linspace(0, len(forces), FREQUENCIES, endpoint=False).astype(int)
    probes = sparse.csr_array(subspace.T)
    full = Geometry(affine=affine, probes=probes, forces=forces[some], loads=None)
    training = [
        Variant(
            solids=solids_of(reference, relaxing(each, FIT_TOLERANCE)), geometry=lambda: full,
            shares=np.ones(1),
        )
        for each in _training(base)
    ]  # fmt: skip
    model = reduce_affine(
        [lambda: full], training, frequencies, band=BAND, tolerance=2 * TOLERANCE, solver="auto",
        progress=partial(report, "reduce"),
    )  # fmt: skip
    loads = model.basis.T @ forces.T
    kept = _motions(model, loads, [each.solids for each in training], frequencies)
    small = interpolated(model.affine, kept.T @ model.parts @ kept, np.ones(1))
    basis = np.zeros((affine.n_dofs, kept.shape[1]))
    basis[affine.free] = model.basis @ kept
    return FreeBody(
        reference=reference, affine=small, load=P.T @ basis, points=points, basis=basis,
        effort=Effort(
            dofs=len(affine.free), reduced_dofs=kept.shape[1], solver=fem.available()[0],
            factorisations=model.factorisations, estimate=model.error,
        ),
    )  # fmt: skip


def reduced_at(free: FreeBody, body: Body) -> ReducedBody:
    """Reduced body of materials within range."""
    solids = solids_of(free.reference, relaxing(body, FIT_TOLERANCE))
    return reduced_variant(operators_of(free.affine, solids), free.load, free.points, free.effort)


def _materials(body: Body) -> list[Material]:
    return [solid_of(part) for part in (*(each.material for each in body.layers), body.material)]


def _training(base: Body) -> list[Body]:
    """Bodies at corners and middle of the range."""
    count = len(_materials(base))
    ends = np.log([MODULUS] * count + [LOSS] * count)
    shares = training_shares(2 * count, 0)
    factors = np.exp(ends[:, 0] + shares * (ends[:, 1] - ends[:, 0]))
    return [_scaled(base, *np.split(each, 2)) for each in factors]


def _scaled(base: Body, moduli: Floats, losses: Floats) -> Body:
    """Body with the modulus and losses of each material times a factor."""
    *upper, below = (
        solid.scaled(modulus=float(a), loss=float(b))
        for solid, a, b in zip(_materials(base), moduli, losses, strict=True)
    )
    layers = [
        Layer(thickness=each.thickness, material=solid)
        for each, solid in zip(base.layers, upper, strict=True)
    ]
    return replace(base, layers=tuple(layers), material=below)


def _motions(
    model: AffineModel, loads: Floats, training: Sequence[Solids], frequencies: Floats
) -> Floats:
    """Orthonormal directions (r, m) of the steady motion under reduced loads (r, j), of all
    materials and frequencies, in coordinates of unit mass. The share of a frequency is as the root
    of its motion, so that faint lines are not left out.
    """
    products = np.zeros((len(loads), len(loads)))
    for solids in training:
        states = [
            np.linalg.solve(np.tensordot(of_line, model.parts[0], 1), loads)
            for of_line in weights(model.affine, solids, frequencies)
        ]
        sizes = np.array([np.linalg.norm(each) for each in states])
        for each, size in zip(states, sizes, strict=True):
            products += np.real(each @ each.conj().T) / (size * sizes.max())
    squares, directions = np.linalg.eigh(products)
    left_out = np.sqrt(np.cumsum(np.maximum(squares, 0)) / squares.sum())
    return np.asarray(directions[:, left_out > LEFT_OUT])
