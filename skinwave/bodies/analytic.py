"""Wavenumber integral of a body: which bodies have one, and its compliance."""

from math import isfinite

from simple_model.compliance import Compliance
from skinwave.bodies.body import Body


def has_exact_waves(body: Body) -> bool:
    """Whether the wavenumber integral of an infinite slab is the solution for a body, but for
    reflections from its sides.

    Without any loss a slab's resonances are unbounded.
    """
    return is_plain_layer(body) and body.solid.has_loss


def is_plain_layer(body: Body) -> bool:
    """Whether a body is a half-space or a slab on a rigid base, of one material, across the beam:
    without loss it has a wavenumber integral from rest, but no steady state.
    """
    layer = body.of_kind.is_layer and (body.base == "clamped" or not isfinite(body.depth))
    return layer and body.is_plain


def exact_waves(body: Body, model: str) -> Compliance:
    """Compliance of a body for a wavenumber-integral model.

    Raises
    ------
    ValueError
        If there is no body, or it has no wavenumber integral.
    """
    if not body.is_plain:
        raise ValueError(
            f"{model} takes one material that lies flat across the beam, not layers or a "
            "placement; use fem"
        )
    return compliance(body)


def compliance(body: Body) -> Compliance:
    """Compliance of an infinite body of the same section.

    Raises
    ------
    ValueError
        If there is no body, or it has no wavenumber integral.
    """
    if body.of_kind.compliance is None:
        raise ValueError(
            "flat-body is for a sheet, a slab on a clamped base, or thickness_mm = inf; use fem"
        )
    return body.of_kind.compliance(body)
