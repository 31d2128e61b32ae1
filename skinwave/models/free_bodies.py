"""Bodies of a range: their materials by part, and the geometries of one moved mesh between which
matrices are interpolated.

If nodes move in proportion to the thickness d_k of their layer, each matrix of a body is a sum

    A(d) = A_0 + sum_k (d_k B_k + C_k / d_k)

with as many terms as there are independent functions 1, d_k and 1/d_k. The same number of
geometries determines it for all d to round-off. An error of 1e-4 would be too large, because lam is
5,000 times mu in soft tissue.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.linalg import qr

from fem.affine import AffineOperators, Solids, assemble_affine
from simple_model.layers.material import Material
from skinwave.bodies import Body
from skinwave.bodies.absorbing_layer import has_layer, layer_of
from skinwave.bodies.build import Build, build
from skinwave.bodies.discretised import Discretise
from skinwave.bodies.sheet import air, bending_equivalent
from skinwave.bodies.sizes import default_size
from skinwave.models.free_keys import FreeKey, Part, solid_at
from skinwave.typing import Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Range:
    """Bodies of a range: a function `body` of shares (k,), 0 to 1. The body at shares `meshed` (k,)
    is meshed with elements of `h` in m, or its default size; `moved` moves its nodes to other
    thicknesses.

    Matrices are sums over `_terms` of the thicknesses. They are assembled at shares `geometries`
    (g, k), where the independent terms, with indices `chosen` (g,), have the values `known` (g, g).
    """

    body: Callable[[Sequence[float]], Body]
    meshed: tuple[float, ...]
    h: float | None
    moved: Discretise | None
    geometries: tuple[tuple[float, ...], ...]
    chosen: tuple[int, ...]
    known: Floats


def range_of(
    body: Callable[[Sequence[float]], Body], meshed: tuple[float, ...],
    thicknesses: Sequence[bool], h: float | None,
) -> Range:  # fmt: skip
    """Return the range of a function `body` of shares (k,), with the geometries between which
    matrices are interpolated; `thicknesses` (k,) marks shares of thicknesses. Raises a ValueError
    if no mesh can be moved over the range.
    """
    reference, free = body(meshed), np.array(thicknesses)
    kind, moved = reference.of_kind, None
    if free.any() and kind.morph:
        thinnest = body(np.where(free, 0.0, meshed).tolist())
        moved = kind.morph(thinnest, reference, h or default_size(reference))
    along = ((1 - np.cos(np.pi * np.linspace(0, 1, 5))) / 2).tolist()  # enough for d and 1/d
    each = [along if is_free else [at] for is_free, at in zip(thicknesses, meshed, strict=True)]
    candidates = list(product(*each))
    values = np.array([_terms(body(at)) for at in candidates])
    scaled = values / np.abs(values).max(axis=0)
    _, R, order = qr(scaled, mode="economic", pivoting=True)
    # Functions with smaller pivots are sums of others.
    rank = int((np.abs(np.diag(R)) > 1e-9 * abs(R[0, 0])).sum())
    chosen = np.sort(order[:rank])
    rows = np.sort(qr(scaled[:, chosen].T, mode="economic", pivoting=True)[2][:rank])
    return Range(
        body=body, meshed=meshed, h=h, moved=moved,
        geometries=tuple(candidates[k] for k in rows), chosen=tuple(chosen.tolist()),
        known=values[np.ix_(rows, chosen)],
    )  # fmt: skip


def geometry_shares(bodies: Range, body: Body) -> Floats:
    """Return the weights (g,) of the geometries in the matrices of a body of the range."""
    if len(bodies.geometries) == 1:
        return np.ones(1)
    values = _terms(body)[list(bodies.chosen)]
    return np.asarray(np.linalg.solve(bodies.known.T, values))


def nearest_geometry(bodies: Range, at: Sequence[float]) -> tuple[float, ...]:
    """Return the shares (k,) with the same materials at the nearest assembled geometry."""
    geometries = np.array(bodies.geometries)
    moved = np.ptp(geometries, axis=0) > 0
    k = int(np.argmin(np.linalg.norm((geometries - at)[:, moved], axis=1)))
    return tuple(np.where(moved, geometries[k], at).tolist())


def build_at(bodies: Range, at: Sequence[float], symmetry: str = "") -> Build:
    """Return the mesh of the range, moved to the thicknesses at shares (k,)."""
    reference = bodies.body(bodies.meshed)
    free = np.ptp(np.array(bodies.geometries), axis=0) > 0
    body = bodies.body(np.where(free, at, bodies.meshed).tolist())
    return build(body, bodies.h or default_size(reference), symmetry, bodies.moved)


def _terms(body: Body) -> Floats:
    """Return 1, and d and 1/d for the thickness d in m of each stratum."""
    d = np.diff(body.interfaces)
    return np.concatenate([[1.0], d, 1 / d])


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """Meshed body, with the `parts` (r,) of its materials and factors (r, 2) on modulus and density
    if its mesh represents a thinner body. `is_sprung` if its springs scale with its modulus.
    """

    body: Body
    parts: tuple[Part, ...]
    factors: Floats
    is_sprung: bool


def reference_of(body: Body, build: Build, keys: Sequence[FreeKey]) -> Reference:
    """Return the reference of a meshed body with free keys. Raises a ValueError if a free layer is
    merged with the next, or if the body rests on both kinds of springs.
    """
    tops = np.cumsum([0.0, *(layer.thickness for layer in body.layers)])
    starts = [start for start, _ in body.strata]
    first = [int(np.argmin(np.abs(tops - start))) for start in starts]
    layers = tuple(k if k < len(body.layers) else None for k in first)
    parts = (*layers, *dict(body.regions))
    if merged := [key.key for key in keys if key.part not in parts]:
        raise ValueError(
            f"{merged[0]} belongs to a layer with the material of its neighbour; change its range "
            "slightly"
        )
    factors = [_factors(m, s) for m, s in zip(meshed_materials(build), body.solids, strict=True)]
    return Reference(
        body=body, parts=parts, factors=np.array(factors), is_sprung=_is_sprung(body, build)
    )


def _is_sprung(body: Body, build: Build) -> bool:
    """Whether a body rests on springs that represent its own tissue."""
    sprung = build.support is not None and bool(build.support.stiffness.any())
    if not body.base_stiffness:
        return sprung
    if "clamped" in body.conditions and "xyz" not in build.fixed.values():
        raise ValueError(
            "a hand with free materials cannot have both an elastic base and clamped ends, because "
            "only the springs of the ends scale with the modulus; reduce the body for each material"
        )
    return False


def meshed_materials(build: Build) -> tuple[Material, ...]:
    """Return the materials of a mesh, those of its coat first."""
    coat = build.coat.materials if build.coat else ()
    return (*coat, *(build.material[region] for region in sorted(build.material)))


def affine_operators(body: Body, build: Build) -> AffineOperators:
    """Return the matrices of each material of a meshed body, and of the air around it."""
    affine = assemble_affine(
        build.mesh, meshed_materials(build), fixed=build.constraints, absorbing=build.absorbing,
        drag=build.drag, support=build.support, coat=build.coat,
    )  # fmt: skip
    around = air(body, build, affine.free)
    return affine if around is None else affine.with_air(around)


def solids_of(reference: Reference, body: Body) -> Solids:
    """Return the materials of another body of the range, for the mesh of the reference."""
    own = [solid_at(body, part) for part in reference.parts]
    bodies = (reference.body, body)
    springs = [_spring_modulus(each) for each in bodies] if reference.is_sprung else [1.0, 1.0]
    drag = [layer_of(each).drag if has_layer(each) else 1.0 for each in bodies]
    meshed = [_times(m, *f) for m, f in zip(own, reference.factors, strict=True)]
    if body.of_kind.equivalent:
        thinner = body.depth / reference.body.depth
        meshed = [bending_equivalent(m, thinner) for m in meshed]
    return Solids(materials=tuple(meshed), springs=springs[1] / springs[0], drag=drag[1] / drag[0])


def _spring_modulus(body: Body) -> float:
    """Return the modulus in Pa of the springs below a body; for a half-space that at rest."""
    if body.is_on_half_space:
        return body.solid.shear_modulus
    # Independent of the Prony series of a modulus law, which takes time to fit.
    return body.softest.shear_modulus + body.softest.fast_modulus


def _factors(meshed: Material, solid: Material) -> tuple[float, float]:
    """Return the ratios of modulus and density of a mesh's material to those of the body."""
    modulus = meshed.shear_modulus / solid.shear_modulus
    density = meshed.density / solid.density
    expected, one = _times(solid, modulus, density), complex(meshed.complex_modulus(1e3))
    if abs(one - complex(expected.complex_modulus(1e3))) > 1e-9 * abs(one):
        raise ValueError(
            "the mesh of this kind of body does not have the materials of its scene; reduce it for "
            "each material"
        )
    return modulus, density


def _times(solid: Material, modulus: float, density: float) -> Material:
    """Return a material with all moduli and the density multiplied by factors."""
    if modulus == density == 1:
        return solid
    return replace(solid.scaled(modulus=modulus), density=density * solid.density)
