"""Coat of a body: top layers that its elements do not resolve, and the materials below them.

Layers that are thinner than half an element become a coat, `fem.Coat`, from the surface down to the
last of them, if they are at most a tenth of the shortest shear wavelength, in themselves and in
what is below, at 400 Hz: Kirchhoff's kinematics hold that far (docs/method.md has the errors).
"""

from math import inf

import numpy as np

from fem.coat import Coat
from simple_model.layers.material import Material
from skinwave.bodies.body import Body
from skinwave.bodies.discretised import THINNEST, Strata
from skinwave.bodies.parts import solid_of

THICKEST, AT = 0.1, 400.0  # of a shear wavelength; Hz, of the highest lines that Tactons make


def thicknesses(strata: Strata) -> list[float]:
    """Thickness in metre of each stratum; that of the last is inf."""
    starts = [start for start, _ in strata]
    return np.diff([*starts, inf]).tolist()


def thickest_coat(strata: Strata, count: int) -> float:
    """Largest thickness in metre of a coat of so many strata on the next."""
    return THICKEST * min(solid.shear_speed for _, solid in strata[: count + 1]) / AT


def largest_coat(body: Body) -> int:
    """Largest number of a body's strata that may be its coat."""
    strata = body.strata
    counts = range(1, len(strata) if body.of_kind.may_be_coated else 1)
    return max((k for k in counts if strata[k][0] <= thickest_coat(strata, k)), default=0)


def without_coat(strata: Strata, count: int) -> Strata:
    """Strata of the mesh: that below a coat of so many reaches up to the surface."""
    return [(0.0, strata[count][1]), *strata[count + 1 :]]


def resolving_size(strata: Strata) -> float:
    """Coarsest size in metre of elements that resolve layers which they do not follow."""
    return min(thicknesses(strata)) / THINNEST


def coarsest_size(body: Body) -> float:
    """Coarsest element size in metre that resolves a body's layers below its largest coat; those of
    a conforming mesh follow all layers.
    """
    if body.of_kind.conforming:
        return inf
    return resolving_size(without_coat(body.strata, largest_coat(body)))


def coat_count(body: Body, h: float) -> int:
    """Number of strata in the coat of a body meshed with elements of h in metre: as few as leave
    layers that these resolve.
    """
    most = largest_coat(body)
    fits = (k for k in range(most) if resolving_size(without_coat(body.strata, k)) >= h)
    return next(fits, most)


def coat(body: Body, h: float) -> Coat | None:
    """Coat of a body meshed with elements of h in metre; None if these resolve all layers."""
    count = coat_count(body, h)
    if not count:
        return None
    return Coat(
        materials=tuple(solid for _, solid in body.strata[:count]),
        thicknesses=tuple(thicknesses(body.strata)[:count]),
    )


def meshed_strata(body: Body, h: float) -> Strata:
    """Strata that a mesh of a body with elements of h in metre has."""
    return without_coat(body.strata, coat_count(body, h))


def layer_name(body: Body, solid: Material) -> str:
    """The preset that a layer of a material is, or "a layer"."""
    named = (layer.material for layer in body.layers if isinstance(layer.material, str))
    return next((name for name in named if solid_of(name) == solid), "a layer")
