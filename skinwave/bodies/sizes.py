"""Element sizes of a body: its default, the coarsest that resolves it, and what is refused."""

from math import isfinite

import numpy as np

from skinwave.bodies.analytic import has_exact_waves
from skinwave.bodies.body import Body
from skinwave.bodies.coat import (
    AT,
    coarsest_size,
    largest_coat,
    thickest_coat,
    thicknesses,
    without_coat,
)
from skinwave.bodies.discretised import THINNEST

FINEST_HAND = 1e-3  # m: finer elements of a hand exceed the limits of its mesher


def check_mesh(body: Body, h: float) -> None:
    """Refuse, by a ValueError, what cannot be meshed with elements of h in metre: larger than the
    body, or more than can be solved for.
    """
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
    coarsest, slab = coarsest_size(body), "or a slab, whose elements follow its layers"
    if coarsest < FINEST_HAND * (1 - 1e-9):
        thin, why = _unresolved(body)
        raise ValueError(
            f"a layer of {thin:g} mm of a {body.kind} is thinner than half of its finest elements, "
            f"{1e3 * THINNEST * FINEST_HAND:g} mm{why}; take thicker layers, {slab}"
        )
    if h > slack * coarsest * (1 + 1e-9):
        thin, why = _unresolved(body)
        raise ValueError(
            f"a layer of {thin:g} mm is thinner than half an element of {1e3 * h:g} mm{why}; "
            f"take elements of {1e3 * coarsest:g} mm, thicker layers, {slab}"
        )


def _unresolved(body: Body) -> tuple[float, str]:
    """Thickness in mm of the layer that needs the finest elements, and why it is no coat."""
    count = largest_coat(body)
    which = count + int(np.argmin(thicknesses(without_coat(body.strata, count))))
    thin = 1e3 * thicknesses(body.strata)[which]
    if not body.of_kind.may_be_coated:
        return thin, ""
    return thin, (
        f", and with all above it, {1e3 * body.strata[which + 1][0]:g} mm, too thick for a coat, "
        f"at most {1e3 * thickest_coat(body.strata, which + 1):.2g} mm, a tenth of a shear "
        f"wavelength at {AT:g} Hz"
    )


def default_size(body: Body) -> float:
    """Default element size of a body, metre."""
    return body.of_kind.default_size(body)
