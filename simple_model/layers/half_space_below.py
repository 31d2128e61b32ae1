"""Modes of a half-space, and of layers on one.

In a half-space a P wave of amplitude a and an SV wave of amplitude b move at a depth z by

    (U, W) = a (-k, -p) e^{-p z} + b (s, k) e^{-s z},  p^2 = k^2 - k_p^2,  s^2 = k^2 - k_s^2

and so resist motion of its surface by the dynamic stiffness K(k) = -T D^-1, D of their motion and T
of their stress there (E. Kausel and J. M. Roesset, Bull Seismol Soc Am 71:1743 (1981)). Of either
sign of p and s that one is taken whose wave decays in the matched layer: of bound waves the one
that decays with depth, of leaky waves the one that grows.
"""

from collections.abc import Callable

import numpy as np

from simple_model.layers.material import Material
from simple_model.layers.mode_tracking import Found
from simple_model.layers.stack import Stack
from simple_model.layers.thin_layers import MATCHED, Pencil, eigenpairs, outgoing, pencil
from simple_model.typing import Complex, Floats

STEPS, CLOSE = 10, 1e-11  # of inverse iteration; relative change at which it ends
BESIDE = 1 + 1e-9 * (1 + 1j)  # of a root, where the matrix is not singular
CONVERGED = 1e-6  # last relative change of a root; thin layers near nu = 0.5 round off to 1e-7
MOVED = 0.05  # of the half-space's shear wavenumber: a root that moves further is none of a mode
SAME = 1e-6  # of it: roots so near to each other are one
NEARLY = 1e-5  # relative step of derivatives of the half-space's stiffness
SLOWER = 0.99  # of its shear wavenumber: from there on waves are bound
SLOWEST = 1.5  # of the largest shear wavenumber: no guided wave is slower
MOST_GROWTH = 50.0  # exponent of a wave that grows with depth
SHOWN = 40  # depths in a half-space


def rayleigh_mode(material: Material, omega: Floats) -> tuple[Found, Floats]:
    """The Rayleigh wave of a half-space at (f,) rad/s, and depths of its shape, down to a shear
    wavelength in the middle of the band.
    """
    rest = material.shear_speed / material.rayleigh_speed
    at = omega[:, None] * (1 + np.array([0, -NEARLY, NEARLY]))
    slowness = rest * np.sqrt(material.density / (material.complex_modulus(at) + 0j))
    k = (at * slowness)[:, :1]
    slope = np.diff((at * slowness)[:, 1:] ** 2) / (2 * NEARLY * omega[:, None])
    mu = material.complex_modulus(omega)[:, None] + 0j
    ks2 = (k / rest) ** 2
    p, s = _decay(k, ks2, material.poisson, 1.0)
    by_square = 4 * (2 * k**2 - ks2) - 4 * p * s - 2 * k**2 * (s / p + p / s)
    depths = np.linspace(0, 2 * np.pi / np.median(np.abs(k)), SHOWN)
    ratio = 2 * k * p / (s**2 + k**2)  # of the SV wave, for no shear stress at the surface
    waves = np.stack([np.ones_like(ratio), ratio], axis=-1)
    found = Found(
        squared=k**2, slope=slope, wavenumbers=k, residues=-p * ks2 / (mu * by_square),
        energy_speed=np.full(k.shape, np.inf), shapes=_shape(k, p, s, waves, depths),
    )  # fmt: skip
    return found, depths


def modes_above_half_space(
    stack: Stack, omega: Floats, moduli: Complex, slopes: Complex, most: int
) -> tuple[Found, Floats]:
    """Roots of layers on a half-space, the last layer of the stack, NaN where there are fewer, and
    the depths (d,) in metre of their shapes. `moduli` and `slopes` (f, l) are shear moduli and
    their derivatives by omega; `most` roots of each frequency have most motion in the layers.
    """
    layers = Stack(materials=stack.materials[:-1], thicknesses=stack.thicknesses[:-1], base="free")
    of, change = (pencil(layers, omega, x[:, :-1]) for x in (moduli, slopes))
    w, mu, dmu = omega[:, None], moduli[:, -1:], slopes[:, -1:]
    below = stack.materials[-1]

    def resisting(k: Complex, by: float = 0.0) -> Complex:
        modulus, at = mu + by * w * dmu, (1 + by) * w
        return _stiffness(k, below.density * at**2 / modulus, modulus, below.poisson)

    ks = np.asarray(w * np.sqrt(below.density / mu), np.complex128)
    start, x = _candidates(pencil(stack, omega, moduli), of, omega, ks, most)
    # Thin layers have next to none of the motion of a long wave, which is the half-space's own.
    rayleigh = ks * below.shear_speed / below.rayleigh_speed
    start = np.concatenate([rayleigh, start], axis=1)
    x = np.concatenate([np.ones_like(x[:, :1]), x], axis=1)
    k, x, last = _refined(of, omega, start, x, resisting)
    genuine = (np.abs(k - start) < MOVED * np.abs(ks)) & (last < CONVERGED)
    genuine &= ~_repeated(k**2, genuine, SAME * np.abs(ks) ** 2)
    ends, up, down = _ends(of), 1 + NEARLY, 1 - NEARLY
    by_k = (resisting(up * k) - resisting(down * k)) / (2 * NEARLY * k)[..., None, None]
    by_w = (resisting(k, NEARLY) - resisting(k, -NEARLY)) / (2 * NEARLY * w)[..., None, None]
    norm = _form(x, _by_wavenumber(of, k)) + _form(x[..., ends], by_k)
    inertia = (np.concatenate([of.M, of.M], axis=1)[:, None] * x**2).sum(axis=-1)
    by_frequency = _form(x, _matrix(change, k)) - 2 * w * inertia + _form(x[..., ends], by_w)
    slope = -2 * k * by_frequency / norm
    turned = outgoing(k**2, slope) / k  # 1, or -1: then U changes its sign, too
    x = x * np.repeat(np.stack([turned, np.ones_like(k)], axis=-1), len(of.depths), axis=-1)
    k, norm = turned * k, turned * norm
    ks2 = np.asarray(ks**2, np.complex128)
    longest = 4 * np.pi / float(ks.real[0, 0] + ks.real[-1, 0])  # in the middle of the band
    reach = np.linspace(0, max(layers.thickness, longest), SHOWN)
    found = Found(
        squared=k**2, slope=slope, wavenumbers=k,
        residues=2 * k * x[..., len(of.depths)] ** 2 / norm,
        energy_speed=np.full(k.shape, np.inf),
        shapes=_continued(x, ends, k, *_decay(k, ks2, below.poisson, MATCHED[0]), reach),
    )  # fmt: skip
    kept = {
        name: np.where(genuine.reshape(genuine.shape + (1,) * (v.ndim - 2)), v, np.nan)
        for name, v in vars(found).items()
    }
    return Found(**kept), np.concatenate([of.depths, layers.thickness + reach[1:]])


def _candidates(
    whole: Pencil, of: Pencil, omega: Floats, ks: Complex, most: int
) -> tuple[Complex, Complex]:
    """Roots (f, m) of layers on a matched layer, and their motion (f, m, 2 n) in the layers: those
    slower than the shear wave (f, 1) below, and those of most motion in the layers.
    """
    squared, V, W = eigenpairs(whole, omega)
    k = np.sqrt(squared)
    k = np.where(k.imag > 1e-9 * np.abs(k), -k, k)
    n = of.M.shape[1]
    x = np.concatenate([V / k[:, None], W], axis=1)
    weights = np.concatenate([whole.M, whole.M], axis=1)
    moving = np.abs(weights)[..., None] * np.abs(x) ** 2
    inside = np.concatenate([moving[:, :n], moving[:, len(V[0]) : len(V[0]) + n]], axis=1)
    share = inside.sum(axis=1) / moving.sum(axis=1)
    shortest = 2 * np.pi / of.depths[-1] + np.abs(k).min(axis=1, keepdims=True)
    share = np.where(np.abs(k.imag) < shortest, share, 0.0)
    slowest = omega * np.sqrt(np.abs(of.M / of.Aww).max(axis=1))
    is_bound = (np.abs(k.imag) < k.real / 2) & (k.real > SLOWER * ks.real)
    is_bound &= k.real < SLOWEST * np.maximum(slowest[:, None], np.abs(ks))
    share = share + is_bound
    order = np.argsort(-share, axis=1, kind="stable")[:, :most]
    x = np.concatenate([x[:, :n], x[:, len(V[0]) : len(V[0]) + n]], axis=1)
    picked = np.take_along_axis(x, order[:, None], axis=2).swapaxes(1, 2)
    return np.take_along_axis(k, order, axis=1), picked


def _refined(
    of: Pencil, omega: Floats, start: Complex, x: Complex, resisting: Callable[[Complex], Complex]
) -> tuple[Complex, Complex, Floats]:
    """Roots (f, m) of the layers on the half-space itself, by inverse iteration, their motion (f,
    m, 2 n), and the relative change in the last step.
    """
    ends = np.ix_(_ends(of), _ends(of))
    k, last = start, np.ones(start.shape)
    for _ in range(STEPS):
        at = BESIDE * k  # where the matrix is not singular
        matrix, slope = _matrix(of, at, omega), _by_wavenumber(of, at)
        matrix[..., ends[0], ends[1]] += resisting(at)
        change = (resisting((1 + NEARLY) * at) - resisting((1 - NEARLY) * at)) / (2 * NEARLY)
        slope[..., ends[0], ends[1]] += change / at[..., None, None]
        x = x / np.linalg.norm(x, axis=-1, keepdims=True)
        y = np.linalg.solve(matrix, slope @ x[..., None])[..., 0]
        step = 1 / (x.conj() * y).sum(axis=-1)
        step = step * np.minimum(1, 0.2 * np.abs(at / step))  # no further than a fifth at once
        new = at - step
        lost = ~(np.abs(new - start) < np.abs(start) / 2)
        x = np.where(lost[..., None], x, y)
        last = np.where(lost, 1.0, np.abs(new / k - 1))
        k = np.asarray(np.where(lost, k, new), np.complex128)
        if (last[~lost] < CLOSE).all():
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
    """(U, W) (f, m, d, 2) in a half-space of the amplitudes (f, m, 2) of its P and SV wave."""
    z = depths[:, None]
    k, p, s = (x[..., None, None] for x in (k, p, s))
    a, b = (waves[..., None, None, axis] for axis in (0, 1))
    # A root that is none, or leaks much, grows with depth: no further than a number holds.
    pressure, shear = (
        wave * np.exp(np.minimum(-(rate * z).real, MOST_GROWTH) - 1j * (rate * z).imag)
        for wave, rate in ((a, p), (b, s))
    )
    return np.concatenate([-k * pressure + s * shear, -p * pressure + k * shear], axis=-1)


def _continued(
    x: Complex, ends: list[int], k: Complex, p: Complex, s: Complex, depths: Floats
) -> Complex:
    """Shapes (f, m, d, 2) of the motion x (f, m, 2 n) of layers, continued in the half-space."""
    U, W = (x[..., end] for end in ends)
    determinant = p * s - k**2
    waves = np.stack([k * U - s * W, p * U - k * W], axis=-1) / determinant[..., None]
    inside = np.stack(np.split(x, 2, axis=-1), axis=-1)
    return np.concatenate([inside, _shape(k, p, s, waves, depths[1:])], axis=2)


def _matrix(of: Pencil, k: Complex, omega: Floats | None = None) -> Complex:
    """A k^2 + B k + G (f, m, 2 n, 2 n), less w^2 M at frequencies (f,) if they are given."""
    n = of.M.shape[1]
    found = k[..., None, None] * _by_wavenumber(of, k)
    found[..., :n, :n] -= k[..., None, None] ** 2 * of.Auu[:, None]
    found[..., n:, n:] -= k[..., None, None] ** 2 * (of.Aww[..., None] * np.eye(n))[:, None]
    found[..., :n, :n] += of.Guu[:, None]
    found[..., n:, n:] += of.Gww[:, None]
    if omega is not None:
        inertia = omega[:, None] ** 2 * np.concatenate([of.M, of.M], axis=1)
        found -= (inertia[..., None] * np.eye(2 * n))[:, None]
    return found


def _by_wavenumber(of: Pencil, k: Complex) -> Complex:
    """2 A k + B (f, m, 2 n, 2 n)."""
    n = of.M.shape[1]
    found = np.zeros((*k.shape, 2 * n, 2 * n), np.complex128)
    found[..., :n, :n] = 2 * k[..., None, None] * of.Auu[:, None]
    found[..., n:, n:] = 2 * k[..., None, None] * (of.Aww[..., None] * np.eye(n))[:, None]
    found[..., :n, n:] = of.Buw[:, None]
    found[..., n:, :n] = of.Buw.swapaxes(1, 2)[:, None]
    return found


def _ends(of: Pencil) -> list[int]:
    """Places of U and W of the lowest node."""
    n = of.M.shape[1]
    return [n - 1, 2 * n - 1]


def _form(x: Complex, matrix: Complex) -> Complex:
    """x^T matrix x (f, m) of vectors (f, m, n) and matrices (f, m, n, n)."""
    return np.asarray((x * (matrix @ x[..., None])[..., 0]).sum(axis=-1))


def _repeated(k: Complex, genuine: np.ndarray, least: Floats) -> np.ndarray:
    """Whether a root (f, m) is within `least` (f, 1) of an earlier one that is genuine."""
    near = np.abs(k[:, :, None] - k[:, None]) < least[..., None]
    earlier = np.tri(k.shape[1], k=-1, dtype=bool)
    return np.asarray((near & earlier & genuine[:, None]).any(axis=2))
