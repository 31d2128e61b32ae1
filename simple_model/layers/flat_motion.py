"""Motion of a stack of layers along x, y and z at any depth, under a moving focus."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from simple_model.layers.flat_body import field_history, field_lines
from simple_model.layers.layered import clearance, transfer
from simple_model.layers.stack import Stack
from simple_model.layers.wavenumber_integral import Field, point_integrals
from simple_model.load.pressure import MovingPressure
from simple_model.typing import Complex, Floats


def motion_field(stack: Stack, depth: float = 0.0) -> Field:
    """Displacement along x, y and, downwards, z at a depth in metre."""
    moved = transfer(stack, [depth])

    def answer(k: Complex, w: Complex) -> Complex:
        return moved(k, w)[:2, 0]

    def weights(away: Floats) -> Floats:
        x, y = np.moveaxis(away, -1, 0)
        none, one = np.zeros_like(x), np.ones_like(x)
        return np.array([[x, none], [y, none], [none, one]])

    return Field(
        answer=answer, orders=(1, 0), clearance=lambda w: clearance(stack, w), weights=weights
    )


def point_motion(
    stack: Stack,
    distances: ArrayLike,
    frequencies: ArrayLike,
    width: float,
    *,
    depth: float = 0.0,
) -> Complex:
    """Displacement away from the axis and downwards about a Gaussian focal spot of 1 Pa.

    Parameters
    ----------
    stack : Stack
    distances : (r,) float, metre, from the axis of the spot
    frequencies : (f,) float or complex, rad/s, with imaginary part <= 0
    width : metre, standard deviation of the spot
    depth : metre below the surface

    Returns
    -------
    (2, f, r) complex, m/Pa

    Raises
    ------
    ValueError
        If the depth is outside the stack.
    """
    found = point_integrals(motion_field(stack, depth), distances, frequencies, width)
    found[0] *= np.atleast_1d(distances)
    return found


def flat_motion(
    stack: Stack, pressure: MovingPressure, probes: ArrayLike, times: Floats, *, depth: float = 0.0
) -> Floats:
    """Motion from rest along x, y and, downwards, z: `flat_body` with all components, at a depth.

    Parameters
    ----------
    stack : Stack
    pressure : MovingPressure, with a Gaussian focus
    probes : (p, 2) float, metre
    times : (t,) float, s, equally spaced
    depth : metre below the surface

    Returns
    -------
    (t, p, 3) float, metre

    Raises
    ------
    ValueError
        If the depth is outside the stack, or as `flat_body` does.
    """
    return field_history(motion_field(stack, depth), pressure, probes, times)


def steady_motion(
    stack: Stack,
    pressure: MovingPressure,
    probes: ArrayLike,
    *,
    depth: float = 0.0,
    threshold: float = 1e-6,
) -> tuple[Floats, Complex]:
    """Steady-state lines of motion along x, y and, downwards, z.

    Parameters
    ----------
    stack : Stack
    pressure : MovingPressure, with a Gaussian focus
    probes : (p, 2) float, metre
    depth : metre below the surface
    threshold : of the strongest line of the load; only its lines above this are computed

    Returns
    -------
    frequencies (f,) in Hz >= 0 and complex amplitudes a (f, p, 3) in metre of Re a exp(2 pi i f t)

    Raises
    ------
    ValueError
        If the depth is outside the stack, or as `steady_lines` does.
    """
    return field_lines(motion_field(stack, depth), pressure, probes, threshold=threshold)
