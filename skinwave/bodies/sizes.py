"""Element sizes of a body: default, coarsest and valid ones; and its coat.

Layers thinner than half an element become a coat, `fem.Coat`, which extends from the surface to the
last such layer. Kirchhoff's kinematics limit its thickness to a tenth of the shortest shear
wavelength in it and below it at 400 Hz (docs/method.md states the errors).
"""

from math import inf, isfinite

import numpy as np

from fem.coat import Coat
from simple_model.layers.material import Material
from skinwave.bodies.analytic import has_exact_waves
from skinwave.bodies.body import Body
from skinwave.bodies.discretised import Strata
from skinwave.bodies.parts import solid_of

COAT_FREQUENCY = 400.0  # Hz, the highest lines of Tactons


def check_mesh(body: Body, h: float) -> None:
    """Refuse elements of h in m that are larger than the body or too many; say which size works."""
    check_element_size(body, h)
    try:
        body.of_kind.check_size(body, h)
    except ValueError as error:
        reason = str(error).partition(";")[0]
        larger = (float(f"{h * 10 ** (k / 20):.2g}") for k in range(1, 200))
        size = next((each for each in larger if _has_mesh(body, each)), None)
        cure = f"use elements of {1e3 * size:g} mm, or " if size else "use "
        raise ValueError(
            f"elements of {1e3 * h:.3g} mm are too many: {reason}; {cure}a smaller body"
        ) from None


def _has_mesh(body: Body, h: float) -> bool:
    """Whether a body can be meshed with elements of h in m."""
    try:
        body.of_kind.check_size(body, check_element_size(body, h))
    except ValueError:
        return False
    return True


def check_element_size(body: Body, h: float, slack: float = 1.0) -> float:
    """Return the element size h in m if a body can be meshed with it, or raise a ValueError.

    Elements in a layer may be `slack` times as coarse as the coarsest size that resolves it.
    """
    if body.of_kind.discretise is None:
        raise ValueError("body kind 'none' cannot be meshed; choose a sheet or a slab")
    _check_layers(body, h, slack)
    if not body.of_kind.is_bounded:
        return h
    if not isfinite(body.depth):
        exact = "use the model flat-body, or " if has_exact_waves(body) else ""
        raise ValueError(f"thickness_mm = inf cannot be meshed; {exact}give a finite thickness")
    longest = max(body.width, body.height, body.depth)
    if h > longest:
        raise ValueError(
            f"elements of {1e3 * h:g} mm are larger than the body of {1e3 * longest:g} mm; use "
            "smaller ones"
        )
    return h


def _check_layers(body: Body, h: float, slack: float) -> None:
    """Refuse layers that elements cannot resolve and that cannot be a coat."""
    coarsest = coarsest_size(body)
    finest_hand = 1e-3  # m: finer elements of a hand exceed the limits of its mesher
    is_hopeless = coarsest < finest_hand * (1 - 1e-9)
    if not is_hopeless and h <= slack * coarsest * (1 + 1e-9):
        return
    size = finest_hand if is_hopeless else h
    too_thick = " and too thick for a coat" if body.of_kind.may_be_coated else ""
    smaller = "" if is_hopeless else f"elements of {1e3 * coarsest:g} mm, "
    raise ValueError(
        f"a layer of {1e3 * coarsest / 2:g} mm of a {body.kind} is thinner than half an "
        f"element of {1e3 * size:g} mm{too_thick}; use {smaller}thicker layers, or a slab, whose "
        "elements follow its layers"
    )


def default_size(body: Body) -> float:
    """Return the default element size of a body, m."""
    return body.of_kind.default_size(body)


def map_size(body: Body, coarser: float = 2.0) -> float:
    """Return the element size of a map, m: it needs less accuracy than probes."""
    return coarser * default_size(body)


def stratum_thicknesses(strata: Strata) -> list[float]:
    """Return the thickness in m of each stratum; that of the last is inf."""
    starts = [start for start, _ in strata]
    return np.diff([*starts, inf]).tolist()


def largest_coat(body: Body, thickest: float = 0.1) -> int:
    """Return the largest number of strata that may be the coat of a body, up to `thickest` shear
    wavelengths.
    """
    strata = body.strata
    slowest = np.minimum.accumulate([solid.shear_speed for _, solid in strata])
    counts = range(1, len(strata) if body.of_kind.may_be_coated else 1)
    limits = thickest * slowest / COAT_FREQUENCY
    return max((k for k in counts if strata[k][0] <= limits[k]), default=0)


def without_coat(strata: Strata, count: int) -> Strata:
    """Return the strata of the mesh; the one below a coat extends to the surface."""
    return [(0.0, strata[count][1]), *strata[count + 1 :]]


def resolving_size(strata: Strata) -> float:
    """Return the coarsest size in m of elements that resolve layers without conforming to them: an
    element resolves layers of at least half its size.
    """
    return 2 * min(stratum_thicknesses(strata))


def coarsest_size(body: Body) -> float:
    """Return the coarsest element size in m that resolves the layers below the coat."""
    if body.of_kind.conforming:
        return inf
    return resolving_size(without_coat(body.strata, largest_coat(body)))


def coat_count(body: Body, h: float) -> int:
    """Return the smallest number of strata in a coat so that elements of h resolve the rest."""
    most = largest_coat(body)
    fits = (k for k in range(most) if resolving_size(without_coat(body.strata, k)) >= h)
    return next(fits, most)


def coat(body: Body, h: float) -> Coat | None:
    """Return the coat of a body meshed with elements of h in m, or None."""
    count = coat_count(body, h)
    if not count:
        return None
    return Coat(
        materials=tuple(solid for _, solid in body.strata[:count]),
        thicknesses=tuple(stratum_thicknesses(body.strata)[:count]),
    )


def meshed_strata(body: Body, h: float) -> Strata:
    """Return the strata in the mesh of a body with elements of h in m."""
    return without_coat(body.strata, coat_count(body, h))


def layer_name(body: Body, solid: Material) -> str:
    """Return the name of the preset in a layer with this material, or "a layer"."""
    named = (layer.material for layer in body.layers if isinstance(layer.material, str))
    return next((name for name in named if solid_of(name) == solid), "a layer")
