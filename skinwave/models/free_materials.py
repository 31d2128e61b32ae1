"""Materials of a meshed body whose keys are free, by the part of the body that each is of."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem.affine import AffineOperators, Solids, assemble_affine
from meshes.tetmesh import Floats
from simple_model.layers.material import Material
from skinwave.bodies import Body
from skinwave.bodies.absorbing_layer import has_layer, layer_of
from skinwave.bodies.build import Build
from skinwave.bodies.sheet import air, bending_equivalent
from skinwave.models.free_keys import FreeKey, Part, solid_at

AGREES = 1e-9  # of a modulus: materials that differ by less are one


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """A body as it was meshed, the part (r,) of it that each of its materials is of, and the
    factors (r, 2) of modulus and density of a mesh that stands for a thinner body; and whether it
    rests on springs that go with its modulus.
    """

    body: Body
    parts: tuple[Part, ...]
    factors: Floats
    is_sprung: bool


def reference_of(body: Body, build: Build, keys: Sequence[FreeKey]) -> Reference:
    """Parts and factors of the materials of a body as it was meshed, with its free keys.

    Raises
    ------
    ValueError
        If a free layer is of one material with the next, the kind of body has other materials, or
        it rests on springs of both kinds.
    """
    tops = np.cumsum([0.0, *(layer.thickness for layer in body.layers)])
    starts = [start for start, _ in body.strata]
    first = [int(np.argmin(np.abs(tops - start))) for start in starts]
    layers = tuple(k if k < len(body.layers) else None for k in first)
    parts = (*layers, *dict(body.regions))
    if merged := [key.key for key in keys if key.part not in parts]:
        raise ValueError(
            f"{merged[0]} is of a layer that is one with its neighbour; change its range slightly"
        )
    factors = [_factors(m, s) for m, s in zip(meshed_materials(build), body.solids, strict=True)]
    return Reference(
        body=body, parts=parts, factors=np.array(factors), is_sprung=_is_sprung(body, build)
    )


def _is_sprung(body: Body, build: Build) -> bool:
    """Whether a body rests on springs that stand for its own tissue.

    Raises
    ------
    ValueError
        If its base has a stiffness of its own beside them.
    """
    sprung = build.support is not None and bool(build.support.stiffness.any())
    if not body.base_stiffness:
        return sprung
    if "clamped" in body.conditions and "xyz" not in build.fixed.values():
        raise ValueError(
            "a hand with free materials has one kind of springs, and this one has an elastic base "
            "beside clamped ends, which go with its modulus; reduce it for each material"
        )
    return False


def meshed_materials(build: Build) -> tuple[Material, ...]:
    """Materials of a mesh, those of its coat first."""
    coat = build.coat.materials if build.coat else ()
    return (*coat, *(build.material[region] for region in sorted(build.material)))


def affine_operators(body: Body, build: Build) -> AffineOperators:
    """Matrices of a meshed body, of each of its materials, and the added mass of the air around it.

    Raises
    ------
    ValueError
        If a sheet has air around a free edge.
    """
    affine = assemble_affine(
        build.mesh, meshed_materials(build), fixed=build.constraints, absorbing=build.absorbing,
        drag=build.drag, support=build.support, coat=build.coat,
    )  # fmt: skip
    around = air(body, build, affine.free)
    return affine if around is None else affine.with_fluid(around)


def solids_of(reference: Reference, body: Body) -> Solids:
    """Materials of a body that differs from the one that was meshed by its materials alone, or by
    a thickness that they stand for.
    """
    own = [solid_at(body, part) for part in reference.parts]
    bodies = (reference.body, body)
    springs = [_spring_modulus(each) for each in bodies] if reference.is_sprung else [1.0, 1.0]
    drag = [layer_of(each).drag if has_layer(each) else 1.0 for each in bodies]
    meshed = [_times(m, *f) for m, f in zip(own, reference.factors, strict=True)]
    if body.of_kind.equivalent:
        thinner = body.depth / reference.body.depth
        meshed = [bending_equivalent(m, thinner) for m in meshed]
    return Solids(
        materials=tuple(meshed),
        springs=springs[1] / springs[0],
        drag=drag[1] / drag[0],
    )


def _spring_modulus(body: Body) -> float:
    """Modulus in Pa that the springs below a body go with: at rest those of a half-space."""
    if body.is_on_half_space:
        return body.solid.shear_modulus
    # A modulus law has its own in a Prony series, which takes time to fit.
    return body.softest.shear_modulus + body.softest.fast_modulus


def _factors(meshed: Material, solid: Material) -> tuple[float, float]:
    """Modulus and density of a mesh's material over those of the body's."""
    modulus = meshed.shear_modulus / solid.shear_modulus
    density = meshed.density / solid.density
    expected, one = _times(solid, modulus, density), complex(meshed.complex_modulus(1e3))
    if abs(one - complex(expected.complex_modulus(1e3))) > AGREES * abs(one):
        raise ValueError(
            "the mesh of this kind of body has other materials than its scene; reduce it for each "
            "material"
        )
    return modulus, density


def _times(solid: Material, modulus: float, density: float) -> Material:
    """A material with all moduli, and the density, times a factor."""
    if modulus == density == 1:
        return solid
    return replace(solid.scaled(modulus=modulus), density=density * solid.density)
