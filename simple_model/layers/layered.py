"""Wavenumber solution of any stack of isotropic layers: motion and stress at every depth.

At a wavenumber k the axisymmetric field is u_r = U J1(kr), u_z = W J0(kr), sigma_zz = N J0(kr),
sigma_rz = T J1(kr), with z and W downwards and time exp(+i w t). The forces per area on the faces
of a layer are its stiffness matrix times their displacements (Kausel and Roesset, Bull Seism Soc Am
71:1743 (1981)). With p^2 = k^2 - k_p^2, s^2 = k^2 - k_s^2, kappa = k_p^2 / k_s^2, a thickness H,
and C = cosh p H or cosh s H, S = sinh p H / p or sinh s H / s, all its entries have the denominator

    D = 2 (1 - C_p C_s) + (k^2 + p^2 s^2 / k^2) S_p S_s
      = (k^2 - p s)^2 / k^2 S_p S_s - 4 sinh^2 (p - s) H / 2

Towards rest D falls as k_s^4, and the first line loses all digits. The second line loses none,
because (k^2 - p s) / k_s^2 = (k^2 (1 + kappa) - k_p^2) / (k^2 + p s) and (p - s) / k_s^2 = (1 -
kappa) / (p + s) are not differences of nearly equal terms. k_s^4 is divided out here, and likewise
from the numerators. All terms are multiplied by exp(-(p + s) H), so every exponential decays; in a
half-space they are 0.

Below an interface the stack resists a displacement u of the interface with forces Z u. From the
bottom up Z = K11 - K12 (K22 + Z)^-1 K21, and from the surface down u <- -(K22 + Z)^-1 K21 u.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf, isfinite
from typing import Any, NamedTuple

import numpy as np

from simple_model.layers.material import Material
from simple_model.layers.stack import Stack
from simple_model.typing import Complex, Floats

Transfer = Callable[[Complex, Complex], Complex]
Pair = tuple[Any, Any]  # horizontal and vertical
Symmetric = tuple[Any, Any, Any]  # of complex arrays, a, b, c of [[a, b], [b, c]]


class Layer(NamedTuple):
    """Stiffness of a layer in Pa/m: `top` K11 = [[a, b], [b, c]], forces on its top per motion
    there; `across` K21 = [[d, -e], [e, g]], forces on its bottom per motion of the top. K22 is [[a,
    -b], [-b, c]].
    """

    top: Symmetric
    across: tuple[Complex, Complex, Complex]


class Impedances(NamedTuple):
    """Impedance Z in Pa/m at the `surface` of a stack, its `layers` from the top, and the impedance
    `below` each: None below a half-space and on a rigid base.
    """

    surface: Symmetric
    layers: list[Layer]
    below: list[Symmetric | None]


def surface_compliance(stack: Stack, k: Complex, w: Complex) -> Complex:
    """Displacement (f, k) of the surface into the stack per pressure, in m/Pa, at wavenumbers k
    (k,) in 1/m with Re k > 0 and frequencies w (f, 1) in rad/s with Im w <= 0; 0 at w = 0 for a
    free stack.
    """
    a, b, c = _impedances(stack, k, w).surface
    return _about_mean(stack, w, a / (a * c - b * b))


def transfer(stack: Stack, depths: Sequence[float]) -> Transfer:
    """Motion and stress at depths (d,) in m for a unit surface pressure.

    Returns a function of k (k,) in 1/m and w (f, 1) in rad/s to (4, d, f, k): U and W in m/Pa, N
    and T in Pa/Pa. Raises a ValueError if a depth is outside the stack.
    """
    for depth in depths:
        if not (0 <= depth <= stack.thickness and isfinite(depth)):
            raise ValueError(
                f"depth = {1e3 * depth:g} mm is outside a stack of {1e3 * stack.thickness:g} mm; "
                "give a depth between 0, the surface, and the base"
            )
    fine, planes = _cut(stack, depths)

    def answer(k: Complex, w: Complex) -> Complex:
        each = _downwards(_impedances(fine, k, w))
        u, f = ([each[plane][part] for plane in planes] for part in (0, 1))
        parts = [*zip(*u, strict=True), [-v for _, v in f], [-h for h, _ in f]]
        shape = np.broadcast_shapes(k.shape, w.shape)
        values = np.array([[np.broadcast_to(x, shape) for x in part] for part in parts])
        return _about_mean(stack, w, values)

    return answer


def clearance(stack: Stack, w: Complex) -> float:
    """Height in 1/m above the real axis of k below which there is no pole, at frequencies w (f,).

    Backward waves occur from slightly below the second resonance and decay at least as fast as the
    shear wave with the least decay (Tolstoy and Usdin, J Acoust Soc Am 29:37 (1957)). Evanescent
    waves have their poles above 1 / thickness, except for the bending of a free stack, where the
    two poles k^4 = m w^2 / D go to 0 with w. For several layers these are estimates; they were
    compared with integrals along the real axis of 370 random stacks, and of 240 on an elastic base.

    The sum of all 1 / w_n^2 is the compliance down to the base of each part times its mass; for one
    layer it is H^2 / 2 c^2, of which the first resonance contributes (2 H / pi c)^2.
    """
    finite = [pair for pair in zip(stack.materials, stack.thicknesses, strict=True)
              if isfinite(pair[1])]  # fmt: skip
    if not finite:
        return inf
    total = sum(thickness for _, thickness in finite)
    compression = _resonance(finite, w, lambda nu: (2 - 2 * nu) / (1 - 2 * nu))  # lam + 2 mu
    turns = np.maximum(_resonance(finite, w, lambda nu: 1.0) / 9, compression)
    backward = 0.5  # of the second resonance of a stack: above it some modes are backward waves
    decay = _decay(stack, w)[turns > (backward * np.pi / 2) ** 2 / 2]
    lowest = 1 / total if stack.is_rigid else min(1 / total, _bending(stack, w))
    lowest *= 0.5 if stack.base_stiffness else 1.0
    return float(decay.min(initial=lowest))


def _about_mean(stack: Stack, w: Complex, values: Complex) -> Complex:
    return np.asarray(values if stack.is_fixed else np.where(w == 0, 0, values))


def _bending(stack: Stack, w: Complex) -> float:
    """Height in 1/m of the lowest pole of bending that only decays, B k^4 = m w^2 - c.

    The stack is free or on an elastic base of stiffness c. B follows from classical lamination
    theory about the neutral plane (Jones, Mechanics of Composite Materials (1999), chapter 4).
    """
    h = np.array(stack.thicknesses)
    stiff = np.array([2 * m.complex_modulus(w) / (1 - m.poisson) for m in stack.materials])
    stiff = stiff * h[:, None]
    z = (np.cumsum(h) - h / 2)[:, None]
    z = z - (stiff * z).sum(axis=0) / stiff.sum(axis=0)
    bending = (stiff * (z**2 + h[:, None] ** 2 / 12)).sum(axis=0)
    mass = sum(m.density * t for m, t in zip(stack.materials, stack.thicknesses, strict=True))
    moving = np.ones(w.shape, bool) if stack.is_fixed else w != 0
    w, bending = (np.broadcast_to(x, w.shape)[moving] for x in (w, bending))
    quarter = ((mass * w**2 - stack.base_stiffness) / bending + 0j) ** 0.25
    k = quarter * np.array([1, 1j, -1, -1j])[:, None]
    return float(k.imag[(k.real > 0) & (k.imag > 0.1 * np.abs(k))].min(initial=inf))


def _resonance(
    layers: list[tuple[Material, float]], w: Complex, stiffer: Callable[[float], float]
) -> Floats:
    """w^2 sum_n 1 / w_n^2 over the resonances w_n across layers on a rigid base; a function of
    Poisson's ratio gives their modulus over that of shear.
    """
    above, total = 0.0, np.zeros(len(w))
    for material, thickness in layers:
        mass, modulus = material.density * thickness, material.complex_modulus(w)
        softness = np.abs(w**2 / (modulus * stiffer(material.poisson)))
        total += softness * thickness * (above + mass / 2)
        above += mass
    return total


def _decay(stack: Stack, w: Complex, weakest: float = 0.1) -> Floats:
    """Smallest decay (f,) in 1/m of shear waves; `weakest` of the mean if a layer is lossless."""
    waves = [np.sqrt(m.density * w**2 / m.complex_modulus(w)) for m in stack.materials]
    decay = np.abs(np.imag(waves))
    finite = [thickness for thickness in stack.thicknesses if isfinite(thickness)]
    share = np.minimum(stack.thicknesses, sum(finite))  # a half-space counts as all above it
    share = share / share.sum()
    return np.where((decay > 0).all(axis=0), decay.min(axis=0), weakest * (share @ decay))


def _cut(stack: Stack, depths: Sequence[float]) -> tuple[Stack, list[int]]:
    """The stack with an interface at each depth, and the index of the interface at each depth."""
    edges = np.concatenate([[0.0], np.cumsum(stack.thicknesses)])
    new = [depth for depth in depths if np.abs(edges - depth).min() > 1e-9 * (1 + depth)]
    planes = np.unique(np.concatenate([edges, new]))
    which = np.searchsorted(edges, planes[:-1], side="right") - 1
    materials = tuple(stack.materials[i] for i in which)
    fine = replace(stack, materials=materials, thicknesses=tuple(np.diff(planes).tolist()))
    return fine, [int(np.abs(planes - depth).argmin()) for depth in depths]


def _impedances(stack: Stack, k: Complex, w: Complex) -> Impedances:
    layers = [
        layer_stiffness(material, thickness, k, w)
        for material, thickness in zip(stack.materials, stack.thicknesses, strict=True)
    ]
    spring, zero = np.full(1, stack.base_stiffness, np.complex128), np.zeros(1, np.complex128)
    below: list[Symmetric | None] = [None if stack.is_rigid else (spring, zero, spring)]
    for layer in layers[:0:-1]:
        below.append(_condense(layer, below[-1]))
    return Impedances(_condense(layers[0], below[-1]), layers, below[::-1])


def _condense(layer: Layer, below: Symmetric | None) -> Symmetric:
    """Z = K11 - K12 (K22 + Z)^-1 K21."""
    a, b, c = layer.top
    if below is None:
        return layer.top
    d, e, g = layer.across
    x, y = _solve_below(layer, below, (d, e)), _solve_below(layer, below, (-e, g))
    return a - d * x[0] - e * x[1], b + e * x[0] - g * x[1], c + e * y[0] - g * y[1]


def _solve_below(layer: Layer, below: Symmetric, force: Pair) -> Pair:
    """(K22 + Z)^-1 force."""
    (a, b, c), (za, zb, zc) = layer.top, below
    a, b, c = a + za, zb - b, c + zc
    over = 1 / (a * c - b * b)
    return (c * force[0] - b * force[1]) * over, (a * force[1] - b * force[0]) * over


def _downwards(known: Impedances) -> list[tuple[Pair, Pair]]:
    """Displacement in m/Pa of each interface, and forces in Pa/Pa on the part below it."""
    a, b, c = known.surface
    over = 1 / (a * c - b * b)
    u, f = (-b * over, a * over), (0 * over, 1 + 0 * over)
    interfaces = [(u, f)]
    for layer, below in zip(known.layers, known.below, strict=True):
        d, e, g = layer.across
        f = (e * u[1] - d * u[0], -e * u[0] - g * u[1])
        if below is None:
            u = (0 * f[0], 0 * f[1])
        else:
            u, (a, b, c) = _solve_below(layer, below, f), below
            f = (a * u[0] + b * u[1], b * u[0] + c * u[1])
        interfaces.append((u, f))
    return interfaces


def layer_stiffness(material: Material, thickness: float, k: Complex, w: Complex) -> Layer:
    """Stiffness (f, k) of a layer of a thickness in m, inf for a half-space."""
    mu, kappa = material.complex_modulus(w), (0.5 - material.poisson) / (1 - material.poisson)
    k2, ks2, over_k = k * k, material.density * w**2 / mu, 1 / k
    p, s = np.sqrt(k2 - kappa * ks2), np.sqrt(k2 - ks2)
    over_p, over_s, over_sum = 1 / p, 1 / s, 1 / (p + s)
    # 1 - exp(-p H) and 1 - exp(-s H), which are tiny in a thin layer.
    lp, ls = _one_minus_exp(p, thickness), _one_minus_exp(s, thickness)
    ep, es = 1 - lp, 1 - ls
    lp2, ls2, lacking = lp * (1 + ep), ls * (1 + es), lp + ls * ep
    mean, slope = (ep + es) / 2, (1 - kappa) * over_sum  # slope = (p - s) / k_s^2
    apart = _difference_quotient(ep, es, mean, slope * ks2, thickness)
    # Each times exp(-(p + s) H): S_p S_s, D / k_s^4, (C_p S_s - C_s S_p) / k_s^2, (S_p - S_s) /
    # k_s^2 and (C_p - C_s) / k_s^2; S_p and S_s times k^-2.
    sp, ss = lp2 * over_p / 2, ls2 * over_s / 2
    spss, turn, half = sp * ss, slope * apart, (1 - kappa) / 2 * over_p * over_s
    q = 1 + kappa - (kappa * ks2) * over_k**2
    d = (q * k / (k2 + p * s)) ** 2 * spss - turn * turn
    over = mu / d
    cross = half * ((lp2 + ls2 * (1 - lp2)) * over_sum / 2 - apart * mean)
    sines = half * ((1 - lacking / 2) * apart - lacking * mean * over_sum)
    sp, ss = sp * over_k**2, ss * over_k**2
    top = (
        over * (cross + kappa * (1 - ls2 / 2) * sp),
        2 * mu * k - mu * ks2 * over_k / 2 - over * q * spss * (over_k / 2),
        over * ((1 - lp2 / 2) * ss - cross),
    )
    across = (
        over * (sines - kappa * sp * es),
        over * lacking * turn * (over_k / 2),
        -over * (sines + ss * ep),
    )
    return Layer(top, across)


def _one_minus_exp(p: Complex, thickness: float) -> Complex:
    """1 - exp(-p H)."""
    if not isfinite(thickness):
        return np.ones_like(p)
    x = -thickness * p
    lacking = 1 - np.exp(x)
    thin_below = 0.3  # thickness times wavenumber: differences of exponentials lose digits
    thin = np.abs(x.real) + np.abs(x.imag) < thin_below
    lacking[thin] = -np.expm1(x[thin])  # slower than exp
    return np.asarray(lacking)


def _difference_quotient(
    ep: Complex, es: Complex, mean: Complex, apart: Complex, thickness: float
) -> Complex:
    """(exp(-s H) - exp(-p H)) / (p - s), also for p = s: mean H tanh(x) / x, x = (p - s) H / 2."""
    if not isfinite(thickness):
        return np.zeros_like(mean)
    x2 = (apart * (thickness / 2)) ** 2
    series_limit = 0.05  # x below which a series gives tanh x / x, exact to 1e-15
    nearly = np.abs(x2.real) + np.abs(x2.imag) < series_limit**2
    if not nearly.any():
        return np.asarray((es - ep) / apart)
    series = 1 - x2 * (1 / 3 - x2 * (2 / 15 - x2 * (17 / 315 - x2 * (62 / 2835))))
    quotient = thickness * mean * series
    np.divide(es - ep, apart, out=quotient, where=~nearly)
    return np.asarray(quotient)
