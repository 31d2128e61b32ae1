"""Modes of a half-space, and of layers on one.

In a half-space a P wave of amplitude a and an SV wave of amplitude b move at a depth z by

    (U, W) = a (-k, -p) e^{-p z} + b (s, k) e^{-s z},  p^2 = k^2 - k_p^2,  s^2 = k^2 - k_s^2

They resist motion of the surface with the dynamic stiffness K(k) = -T D^-1, where D is their motion
and T their stress at the surface (E. Kausel and J. M. Roesset, Bull Seismol Soc Am 71:1743 (1981)).
The signs of p and s are those of waves that decay in the matched layer: bound waves decay with
depth, leaky waves grow.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from simple_model.layers.material import Material
from simple_model.layers.mode_tracking import Roots
from simple_model.layers.stack import Stack
from simple_model.layers.thin_layers import MATCHED, Pencil, eigenpairs, outgoing, pencil
from simple_model.typing import Complex, Floats

EPS = 1e-5  # relative step of derivatives of the stiffness of the half-space
DEPTHS = 40  # of a shape in a half-space


def rayleigh_mode(material: Material, omega: Floats) -> tuple[Roots, Floats]:
    """The Rayleigh wave of a half-space at (f,) rad/s, and depths of its shape, down to a shear
    wavelength at the middle of the band.
    """
    rest = material.shear_speed / material.rayleigh_speed
    at = omega[:, None] * (1 + np.array([0, -EPS, EPS]))
    slowness = rest * np.sqrt(material.density / (material.complex_modulus(at) + 0j))
    k = (at * slowness)[:, :1]
    slope = np.diff((at * slowness)[:, 1:] ** 2) / (2 * EPS * omega[:, None])
    mu = material.complex_modulus(omega)[:, None] + 0j
    ks2 = (k / rest) ** 2
    p, s = _decay(k, ks2, material.poisson, 1.0)
    by_square = 4 * (2 * k**2 - ks2) - 4 * p * s - 2 * k**2 * (s / p + p / s)
    depths = np.linspace(0, 2 * np.pi / np.median(np.abs(k)), DEPTHS)
    ratio = 2 * k * p / (s**2 + k**2)  # of the SV wave, for no shear stress at the surface
    waves = np.stack([np.ones_like(ratio), ratio], axis=-1)
    roots = Roots(
        squared=k**2, slope=slope, wavenumbers=k, residues=-p * ks2 / (mu * by_square),
        energy_speed=np.full(k.shape, np.inf), shapes=_shape(k, p, s, waves, depths),
    )  # fmt: skip
    return roots, depths


def modes_above_half_space(
    stack: Stack, omega: Floats, moduli: Complex, slopes: Complex, most: int
) -> tuple[Roots, Floats]:
    """Roots of layers on a half-space, the last layer of the stack, and depths (d,) in m of their
    shapes.

    `moduli` and `slopes` (f, l) are shear moduli and their derivatives by omega. At each frequency
    it returns the `most` roots with the most motion in the layers, NaN if there are fewer.
    """
    layers = Stack(materials=stack.materials[:-1], thicknesses=stack.thicknesses[:-1], base="free")
    terms, change = (pencil(layers, omega, x[:, :-1]) for x in (moduli, slopes))
    w, mu, dmu = omega[:, None], moduli[:, -1:], slopes[:, -1:]
    below = stack.materials[-1]

    def impedance(k: Complex, by: float = 0.0) -> Complex:
        modulus, at = mu + by * w * dmu, (1 + by) * w
        return _stiffness(k, below.density * at**2 / modulus, modulus, below.poisson)

    ks = np.asarray(w * np.sqrt(below.density / mu), np.complex128)
    start, x = _candidates(pencil(stack, omega, moduli), terms, omega, ks, most)
    # Thin layers hardly move in a long wave, which is that of the half-space alone.
    rayleigh = ks * below.shear_speed / below.rayleigh_speed
    start = np.concatenate([rayleigh, start], axis=1)
    x = np.concatenate([np.ones_like(x[:, :1]), x], axis=1)
    k, x, last = _refine(terms, omega, start, x, impedance)
    converged = 1e-6  # last relative change of a root; round-off near nu = 0.5 is 1e-7
    farthest_move = 0.05  # of the shear wavenumber below: a root that moves further is no mode
    genuine = (np.abs(k - start) < farthest_move * np.abs(ks)) & (last < converged)
    away = np.abs((k**2)[:, :, None] - (k**2)[:, None])
    is_same = away < 1e-6 * np.abs(ks[..., None]) ** 2
    earlier = np.tri(k.shape[1], k=-1, dtype=bool)
    genuine = genuine & ~(is_same & earlier & genuine[:, None]).any(axis=2)
    ends, up, down = _ends(terms), 1 + EPS, 1 - EPS
    by_k = (impedance(up * k) - impedance(down * k)) / (2 * EPS * k)[..., None, None]
    by_w = (impedance(k, EPS) - impedance(k, -EPS)) / (2 * EPS * w)[..., None, None]
    norm = _form(x, _by_wavenumber(terms, k)) + _form(x[..., ends], by_k)
    inertia = (np.concatenate([terms.M, terms.M], axis=1)[:, None] * x**2).sum(axis=-1)
    by_frequency = _form(x, _matrix(change, k)) - 2 * w * inertia + _form(x[..., ends], by_w)
    slope = -2 * k * by_frequency / norm
    turned = outgoing(k**2, slope) / k  # 1, or -1: then U changes its sign, too
    x = x * np.repeat(np.stack([turned, np.ones_like(k)], axis=-1), len(terms.depths), axis=-1)
    k, norm = turned * k, turned * norm
    ks2 = np.asarray(ks**2, np.complex128)
    longest = 4 * np.pi / float(ks.real[0, 0] + ks.real[-1, 0])  # in the middle of the band
    reach = np.linspace(0, max(layers.thickness, longest), DEPTHS)
    roots = Roots(
        squared=k**2, slope=slope, wavenumbers=k,
        residues=2 * k * x[..., len(terms.depths)] ** 2 / norm,
        energy_speed=np.full(k.shape, np.inf),
        shapes=_continue_below(x, ends, k, *_decay(k, ks2, below.poisson, MATCHED[0]), reach),
    )  # fmt: skip

    def without_false(values: Any) -> Any:
        mask = genuine.reshape(genuine.shape + (1,) * (values.ndim - 2))
        return np.where(mask, values, np.nan)

    return roots.apply(without_false), np.concatenate([terms.depths, layers.thickness + reach[1:]])


def _candidates(
    whole: Pencil, terms: Pencil, omega: Floats, ks: Complex, most: int
) -> tuple[Complex, Complex]:
    """Roots (f, m) of layers on a matched layer, and their motion (f, m, 2 n) in the layers: those
    slower than the shear wave (f, 1) below, and those with the most motion in the layers.
    """
    squared, V, W = eigenpairs(whole, omega)
    k = np.sqrt(squared)
    k = np.where(k.imag > 1e-9 * np.abs(k), -k, k)
    n = terms.M.shape[1]
    x = np.concatenate([V / k[:, None], W], axis=1)
    weights = np.concatenate([whole.M, whole.M], axis=1)
    moving = np.abs(weights)[..., None] * np.abs(x) ** 2
    inside = np.concatenate([moving[:, :n], moving[:, len(V[0]) : len(V[0]) + n]], axis=1)
    share = inside.sum(axis=1) / moving.sum(axis=1)
    shortest = 2 * np.pi / terms.depths[-1] + np.abs(k).min(axis=1, keepdims=True)
    share = np.where(np.abs(k.imag) < shortest, share, 0.0)
    slowest = omega * np.sqrt(np.abs(terms.M / terms.Aww).max(axis=1))
    least_bound = 0.99  # of the shear wavenumber below: larger wavenumbers are bound
    is_bound = (np.abs(k.imag) < k.real / 2) & (k.real > least_bound * ks.real)
    largest_bound = 1.5  # of the largest shear wavenumber: no guided wave is slower
    is_bound &= k.real < largest_bound * np.maximum(slowest[:, None], np.abs(ks))
    share = share + is_bound
    order = np.argsort(-share, axis=1, kind="stable")[:, :most]
    x = np.concatenate([x[:, :n], x[:, len(V[0]) : len(V[0]) + n]], axis=1)
    picked = np.take_along_axis(x, order[:, None], axis=2).swapaxes(1, 2)
    return np.take_along_axis(k, order, axis=1), picked


def _refine(
    terms: Pencil,
    omega: Floats,
    start: Complex,
    x: Complex,
    impedance: Callable[[Complex], Complex],
) -> tuple[Complex, Complex, Floats]:
    """Refine roots (f, m) with the exact half-space by inverse iteration. Return them, their motion
    (f, m, 2 n) and the relative change in the last step.
    """
    ends = np.ix_(_ends(terms), _ends(terms))
    k, last = start, np.ones(start.shape)
    for _ in range(10):
        at = (1 + 1e-9 * (1 + 1j)) * k  # where the matrix is not singular
        matrix, slope = _matrix(terms, at, omega), _by_wavenumber(terms, at)
        matrix[..., ends[0], ends[1]] += impedance(at)
        change = (impedance((1 + EPS) * at) - impedance((1 - EPS) * at)) / (2 * EPS)
        slope[..., ends[0], ends[1]] += change / at[..., None, None]
        x = x / np.linalg.norm(x, axis=-1, keepdims=True)
        y = np.linalg.solve(matrix, slope @ x[..., None])[..., 0]
        step = 1 / (x.conj() * y).sum(axis=-1)
        step = step * np.minimum(1, 0.2 * np.abs(at / step))  # by at most a fifth
        new = at - step
        lost = ~(np.abs(new - start) < np.abs(start) / 2)
        x = np.where(lost[..., None], x, y)
        last = np.where(lost, 1.0, np.abs(new / k - 1))
        k = np.asarray(np.where(lost, k, new), np.complex128)
        if (last[~lost] < 1e-11).all():
            break
    return k, x / np.linalg.norm(x, axis=-1, keepdims=True), last


def _stiffness(k: Complex, ks2: Complex, mu: Complex, poisson: float) -> Complex:
    """Dynamic stiffness (..., 2, 2) in Pa/m of a half-space on (U, W) of its surface."""
    p, s = _decay(k, ks2, poisson, MATCHED[0])
    rows = [[2 * k * p, -(s**2 + k**2)], [2 * k**2 - ks2, -2 * k * s]]
    stress = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    adjoint = [[k, -s], [p, -k]]
    inverse = np.stack([np.stack(row, axis=-1) for row in adjoint], axis=-2)
    return np.asarray(-(mu / (p * s - k**2))[..., None, None] * (stress @ inverse))


def _decay(k: Complex, ks2: Complex, poisson: float, along: complex) -> tuple[Complex, Complex]:
    """p and s of waves that decay along a complex direction in depth."""
    kp2 = ks2 * (1 - 2 * poisson) / (2 - 2 * poisson)
    p, s = np.sqrt(k**2 - kp2 + 0j), np.sqrt(k**2 - ks2 + 0j)
    return tuple(np.where((x * along).real < 0, -x, x) for x in (p, s))  # type: ignore[return-value]


def _shape(k: Complex, p: Complex, s: Complex, waves: Complex, depths: Floats) -> Complex:
    """(U, W) (f, m, d, 2) in a half-space for amplitudes (f, m, 2) of its P and SV waves."""
    z = depths[:, None]
    k, p, s = (x[..., None, None] for x in (k, p, s))
    a, b = (waves[..., None, None, axis] for axis in (0, 1))
    most_growth = 50.0  # exponent of a wave that grows with depth
    # A false or leaky root grows with depth; the limit avoids overflow.
    pressure, shear = (
        wave * np.exp(np.minimum(-(rate * z).real, most_growth) - 1j * (rate * z).imag)
        for wave, rate in ((a, p), (b, s))
    )
    return np.concatenate([-k * pressure + s * shear, -p * pressure + k * shear], axis=-1)


def _continue_below(
    x: Complex, ends: list[int], k: Complex, p: Complex, s: Complex, depths: Floats
) -> Complex:
    """Shapes (f, m, d, 2) of the motion x (f, m, 2 n) of layers, continued in the half-space."""
    U, W = (x[..., end] for end in ends)
    determinant = p * s - k**2
    waves = np.stack([k * U - s * W, p * U - k * W], axis=-1) / determinant[..., None]
    inside = np.stack(np.split(x, 2, axis=-1), axis=-1)
    return np.concatenate([inside, _shape(k, p, s, waves, depths[1:])], axis=2)


def _matrix(terms: Pencil, k: Complex, omega: Floats | None = None) -> Complex:
    """A k^2 + B k + G (f, m, 2 n, 2 n), minus w^2 M if frequencies (f,) are given."""
    n = terms.M.shape[1]
    matrix = k[..., None, None] * _by_wavenumber(terms, k)
    matrix[..., :n, :n] -= k[..., None, None] ** 2 * terms.Auu[:, None]
    matrix[..., n:, n:] -= k[..., None, None] ** 2 * (terms.Aww[..., None] * np.eye(n))[:, None]
    matrix[..., :n, :n] += terms.Guu[:, None]
    matrix[..., n:, n:] += terms.Gww[:, None]
    if omega is not None:
        inertia = omega[:, None] ** 2 * np.concatenate([terms.M, terms.M], axis=1)
        matrix -= (inertia[..., None] * np.eye(2 * n))[:, None]
    return matrix


def _by_wavenumber(terms: Pencil, k: Complex) -> Complex:
    """2 A k + B (f, m, 2 n, 2 n)."""
    n = terms.M.shape[1]
    derivative = np.zeros((*k.shape, 2 * n, 2 * n), np.complex128)
    derivative[..., :n, :n] = 2 * k[..., None, None] * terms.Auu[:, None]
    derivative[..., n:, n:] = 2 * k[..., None, None] * (terms.Aww[..., None] * np.eye(n))[:, None]
    derivative[..., :n, n:] = terms.Buw[:, None]
    derivative[..., n:, :n] = terms.Buw.swapaxes(1, 2)[:, None]
    return derivative


def _ends(terms: Pencil) -> list[int]:
    """Indices of U and W of the lowest node."""
    n = terms.M.shape[1]
    return [n - 1, 2 * n - 1]


def _form(x: Complex, matrix: Complex) -> Complex:
    """x^T matrix x (f, m) of vectors (f, m, n) and matrices (f, m, n, n)."""
    return np.asarray((x * (matrix @ x[..., None])[..., 0]).sum(axis=-1))
