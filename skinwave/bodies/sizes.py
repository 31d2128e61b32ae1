"""Element sizes of a body: its default, the coarsest that resolves it, what is refused; and its
coat.

Layers that are thinner than half an element become a coat, `fem.Coat`, from the surface down to the
last of them, if they are at most a tenth of the shortest shear wavelength, in themselves and in
what is below, at 400 Hz: Kirchhoff's kinematics hold that far (docs/method.md has the errors).
"""

from math import inf, isfinite

import numpy as np

from fem.coat import Coat
from simple_model.layers.material import Material
from skinwave.bodies.analytic import has_exact_waves
from skinwave.bodies.body import Body
from skinwave.bodies.discretised import THINNEST, Strata
from skinwave.bodies.parts import solid_of

FINEST_HAND = 1e-3  # m: finer elements of a hand exceed the limits of its mesher
THICKEST, AT = 0.1, 400.0  # of a shear wavelength; Hz, of the highest lines that Tactons make


def check_mesh(body: Body, h: float) -> None:
    """Refuse elements of h in metre that are larger than the body, or too many."""
    body.of_kind.check_size(body, checked(body, h))


def checked(body: Body, h: float, slack: float = 1.0) -> float:
    """Element size h in metre, if a body can be meshed with it; elements in a layer may be `slack`
    times as coarse as allowed. Raises a ValueError if there is nothing to mesh, or elements are
    larger than the body or its layers allow.
    """
    if body.of_kind.discretise is None:
        raise ValueError("body kind 'none' has nothing to mesh; choose a sheet or a slab")
    _check_layers(body, h, slack)
    if not body.of_kind.is_bounded:
        return h
    if not isfinite(body.depth):
        exact = "take the model flat-body, or " if has_exact_waves(body) else ""
        raise ValueError(f"thickness_mm = inf has no mesh; {exact}give a finite depth")
    longest = max(body.width, body.height, body.depth)
    if h > longest:
        raise ValueError(
            f"elements of {1e3 * h:g} mm are larger than the body, whose longest side is "
            f"{1e3 * longest:g} mm; take smaller ones"
        )
    return h


def _check_layers(body: Body, h: float, slack: float) -> None:
    """Refuse layers that elements which do not follow them cannot resolve, and that are no coat."""
    coarsest = coarsest_size(body)
    is_hopeless = coarsest < FINEST_HAND * (1 - 1e-9)
    if not is_hopeless and h <= slack * coarsest * (1 + 1e-9):
        return
    size = FINEST_HAND if is_hopeless else h
    why = ", and too thick for a coat" if body.of_kind.may_be_coated else ""
    smaller = "" if is_hopeless else f"elements of {1e3 * coarsest:g} mm, "
    raise ValueError(
        f"a layer of {1e3 * THINNEST * coarsest:g} mm of a {body.kind} is thinner than half an "
        f"element of {1e3 * size:g} mm{why}; take {smaller}thicker layers, or a slab, whose "
        "elements follow its layers"
    )


def default_size(body: Body) -> float:
    """Default element size of a body, metre."""
    return body.of_kind.default_size(body)


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
    """Coarsest element size in metre that resolves a body's layers below its coat."""
    if body.of_kind.conforming:
        return inf
    return resolving_size(without_coat(body.strata, largest_coat(body)))


def coat_count(body: Body, h: float) -> int:
    """Number of strata in the coat: as few as leave layers that elements of h resolve."""
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
