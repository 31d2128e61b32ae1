"""Wavenumber integral of a body: which bodies have one, its compliance, and its stack of layers."""

from math import inf

from simple_model.compliance import Compliance
from simple_model.layers import BASES, Stack
from skinwave.bodies.body import Body
from skinwave.bodies.parts import FLAT


def has_exact_waves(body: Body) -> bool:
    """Whether the wavenumber integral of infinite layers is the solution for a body, but for
    reflections from its sides.

    Without any loss resonances of layers are unbounded.
    """
    return is_flat_layer(body) and any(solid.has_loss for _, solid in body.strata)


def is_flat_layer(body: Body) -> bool:
    """Whether a body is a half-space or a slab, layered or not, that lies flat across the beam:
    without loss it has a wavenumber integral from rest, but no steady state.
    """
    return body.of_kind.is_layer and body.placement == FLAT


def exact_waves(body: Body, model: str) -> Compliance:
    """Compliance of a body for a wavenumber-integral model.

    Raises
    ------
    ValueError
        If there is no body, or it has no wavenumber integral.
    """
    if body.placement != FLAT:
        raise ValueError(f"{model} takes a body that lies flat across the beam; use fem")
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
            f"flat-body is for a sheet or a slab, not a body of kind '{body.kind}'; use fem"
        )
    return body.of_kind.compliance(body)


def stack(body: Body) -> Stack:
    """Layers of a slab as infinite ones. An absorbing base radiates as a half-space of the
    lowest material does, which is there instead.

    Raises
    ------
    ValueError
        If the body is no slab.
    """
    if not body.of_kind.is_layer:
        raise ValueError(f"a body of kind '{body.kind}' is no stack of flat layers; take a slab")
    starts, materials = zip(*body.strata, strict=True)
    end = inf if body.base == "absorbing" else body.depth
    thicknesses = [below - top for top, below in zip(starts, (*starts[1:], end), strict=True)]
    return Stack(
        materials=materials,
        thicknesses=tuple(thicknesses),
        base=body.base if body.base in BASES else BASES[0],
    )
