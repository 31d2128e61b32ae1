"""Analytic solutions of a body: its stack of layers, wavenumber integral and modes."""

from functools import lru_cache
from math import inf, isfinite

import numpy as np

from simple_model import Stack
from simple_model.layers.compliance import Compliance
from simple_model.layers.dispersion import DispersionCurves, dispersion_curves
from simple_model.layers.stack import BASES
from skinwave.bodies.body import Body
from skinwave.bodies.parts import FLAT
from skinwave.typing import Floats


def has_exact_waves(body: Body) -> bool:
    """Whether a wavenumber integral solves a body, apart from reflections from its sides.

    It does not solve layers without loss, whose resonances are unbounded.
    """
    return is_flat_layer(body) and any(solid.has_loss for _, solid in body.strata)


def is_flat_layer(body: Body) -> bool:
    """Whether a body is a half-space or a slab that lies flat across the beam."""
    return body.of_kind.is_layer and body.placement == FLAT


def is_laterally_infinite(body: Body) -> bool:
    """Whether a body has no reflecting sides: they absorb, or it is a half-space."""
    return body.sides == "absorbing" or not isfinite(body.depth)


@lru_cache(maxsize=16)
def compliance(body: Body) -> Compliance:
    """Return the compliance of an infinite body of the same section, with mean moduli; the same
    record for the same body.
    """
    if body.of_kind.compliance is None:
        raise ValueError(
            "the wavenumber integral supports a sheet or a slab, not a body of kind "
            f"'{body.kind}'; use one of these"
        )
    return body.of_kind.compliance(body)


def stack(body: Body) -> Stack:
    """Return the layers of a slab; an absorbing base is a half-space of the lowest material."""
    if not body.of_kind.is_layer:
        raise ValueError(f"a body of kind '{body.kind}' is not a stack of flat layers; use a slab")
    return flat_layers(body)


def flat_layers(body: Body) -> Stack:
    """Return the layers of a body as if it were flat and everywhere as deep as in its middle."""
    starts, materials = zip(*body.strata, strict=True)
    end = inf if body.base == "absorbing" else body.depth
    return Stack(
        materials=materials, thicknesses=tuple(np.diff([*starts, end]).tolist()),
        base=body.base if body.base in BASES else BASES[0], base_stiffness=body.base_stiffness,
    )  # fmt: skip


def dispersion(body: Body, frequencies: Floats, most: int) -> DispersionCurves:
    """Return dispersion curves of an infinite body, `most` modes at frequencies (f,) in Hz."""
    if body.of_kind.dispersion is None:
        raise ValueError(
            "dispersion curves support a sheet, a slab or a palm, not a body of kind "
            f"'{body.kind}'; use a slab of its depth and layers"
        )
    return body.of_kind.dispersion(body, frequencies, most)


def stack_dispersion(body: Body, frequencies: Floats, most: int) -> DispersionCurves:
    """Return the dispersion curves of the flattened layers of a body."""
    return dispersion_curves(flat_layers(body), frequencies, most=most)
