"""Quantities of a stack of layers at any depth, by wavenumber integrals.

A surface pressure J0(kr) exp(i w t) makes u_r = U J1(kr), u_z = W J0(kr), sigma_zz = N J0(kr) and
sigma_rz = T J1(kr), z downwards (`layered.transfer`). The strains are

    (e_rr + e_tt)/2 = kU/2 J0,  (e_rr - e_tt)/2 = -kU/2 J2,  e_rz = T/(2 mu) J1,
    e_zz = (N/mu - l kU)/(l + 2) J0,  l = lam/mu = 2 nu/(1 - 2 nu)

The vertical strain follows from the traction. A difference of displacements would lose the
dilatation of a nearly incompressible solid, and with it the pressure. Components are along the axes
of scenes, with z upwards.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from simple_model.layers.compliance import Compliance
from simple_model.layers.layered import clearance, transfer
from simple_model.layers.material import Material
from simple_model.layers.stack import Stack
from simple_model.layers.wavenumber_integral import Field, normal_field
from simple_model.quantities import NORMAL, VECTOR, Quantity
from simple_model.typing import Complex, Floats


def motion_field(stack: Stack, depth: float = 0.0) -> Field:
    """Displacement along x, y and z, downwards, at a depth in m."""
    moved = transfer(stack, [depth])

    def answer(k: Complex, w: Complex) -> Complex:
        return moved(k, w)[:2, 0]

    def weights(away: Floats) -> Floats:
        x, y = np.moveaxis(away, -1, 0)
        zero, one = np.zeros_like(x), np.ones_like(x)
        return np.array([[x, zero], [y, zero], [zero, one]])

    return Field(
        answer=answer, orders=(1, 0), clearance=lambda w: clearance(stack, w), weights=weights
    )


def strain_field(stack: Stack, depth: float = 0.0) -> Field:
    """Strain xx, yy, zz, xy, xz, yz at a depth in m, z upwards."""
    moved, solid = transfer(stack, [depth]), material_at(stack, depth)
    ratio = solid.first_lame / solid.shear_modulus

    def answer(k: Complex, w: Complex) -> Complex:
        U, _, N, T = moved(k, w)[:, 0]
        mu = solid.complex_modulus(w)
        vertical = (N / mu - ratio * k * U) / (ratio + 2)
        return np.array([k * U / 2, vertical, -k * U / 2, T / (2 * mu)])

    def weights(away: Floats) -> Floats:
        x, y = np.moveaxis(away, -1, 0)
        zero, one, turned = np.zeros_like(x), np.ones_like(x), x**2 - y**2
        return np.array([
            [one, zero, turned, zero],
            [one, zero, -turned, zero],
            [zero, one, zero, zero],
            [zero, zero, 2 * x * y, zero],
            [zero, zero, zero, -x],
            [zero, zero, zero, -y],
        ])  # fmt: skip

    return Field(
        answer=answer, orders=(0, 0, 2, 1), clearance=lambda w: clearance(stack, w), weights=weights
    )


def material_at(stack: Stack, depth: float) -> Material:
    """Material at a depth in m; at an interface, the one below."""
    bottoms = np.cumsum(stack.thicknesses)[:-1]
    return stack.materials[int(np.searchsorted(bottoms, depth, side="right"))]


def quantity_field(quantity: Quantity, stack: Stack, depth: float = 0.0) -> Field:
    """Components of a quantity, before any `invariant`, at a depth in m of a stack."""
    solid = material_at(stack, depth)
    if quantity.field in (NORMAL, VECTOR):
        field = motion_field(stack, depth)
        rows = np.diag([1.0, 1.0, -1.0]) if quantity.field == VECTOR else np.eye(3)[[2]]
    else:
        field, rows = strain_field(stack, depth), np.eye(6)
    rows = quantity.rows(solid) @ rows
    own = replace(field, weights=lambda away: np.tensordot(rows, field.weights(away), axes=1))
    return _in_motion(quantity, own, solid)


def _in_motion(quantity: Quantity, field: Field, solid: Material | None = None) -> Field:
    """A field with the rates of a quantity and the relaxation of stress in a material."""

    def answer(k: Complex, w: Complex) -> Complex:
        modulus = solid.complex_modulus(w) / solid.shear_modulus if solid else 1.0
        values: Complex = field.answer(k, w) * quantity.factor(1j * w, modulus)
        return values

    return replace(field, answer=answer) if quantity.rate or quantity.relaxes else field


def surface_field(quantity: Quantity, compliance: Compliance) -> Field:
    """Return the field of a quantity of the normal motion of a surface with a compliance."""
    return _in_motion(quantity, normal_field(compliance))


def traction_field(quantity: Quantity, stack: Stack, direction: ArrayLike) -> Field:
    """Normal motion of the surface under a traction of the profile of the focal spot.

    By reciprocity the vertical motion at x under a force along x' at 0 is the motion along x' at 0
    under a vertical force at x, see `motion_field`. The direction (3,) of the traction is a unit
    vector, z upwards.
    """
    along = np.asarray(direction, np.float64)
    moved = motion_field(stack)

    def weights(away: Floats) -> Floats:
        horizontal = -(away @ along[:2])
        return np.stack([horizontal, np.full_like(horizontal, -along[2])])[None]

    return _in_motion(quantity, replace(moved, weights=weights))
