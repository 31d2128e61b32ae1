"""Analytic solutions of a body: its wavenumber integral, and the waves that it guides."""

from math import inf, isfinite

from meshes.tetmesh import Floats
from simple_model.compliance import Compliance
from simple_model.dispersion import DispersionCurves, dispersion_curves
from simple_model.layers import Stack
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


def dispersion(body: Body, frequencies: Floats, most: int) -> DispersionCurves:
    """Dispersion curves of a laterally infinite body of the same section.

    Parameters
    ----------
    body : Body
    frequencies : (f,) float, Hz, above 0 and ascending
    most : how many modes

    Returns
    -------
    DispersionCurves

    Raises
    ------
    ValueError
        If its kind has none, as there is no body or it has no uniform depth.
    """
    if body.of_kind.dispersion is None:
        raise ValueError(
            f"dispersion curves are of a sheet, a slab or a palm, not of a body of kind "
            f"'{body.kind}'; take a slab of its depth and layers"
        )
    return body.of_kind.dispersion(body, frequencies, most)


def stack_of(body: Body) -> Stack:
    """Layers of a body as a stack, an absorbing base as a half-space of the lowest material."""
    strata = body.strata
    starts, materials = zip(*strata, strict=True)
    ends = [*starts[1:], body.depth]
    thicknesses = [end - start for start, end in zip(starts, ends, strict=True)]
    if body.base == "absorbing":
        thicknesses[-1] = inf
    base = "free" if body.base == "free" else "clamped"
    return Stack(materials=materials, thicknesses=tuple(thicknesses), base=base)


def stack_dispersion(body: Body, frequencies: Floats, most: int) -> DispersionCurves:
    """Dispersion curves of a body's layers.

    Parameters
    ----------
    body, frequencies, most : as for `dispersion`

    Returns
    -------
    DispersionCurves
    """
    return dispersion_curves(stack_of(body), frequencies, most=most)
