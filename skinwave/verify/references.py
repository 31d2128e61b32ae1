"""Closed forms and series from the literature. Time is exp(+i w t); SI units throughout."""

from collections.abc import Callable

import numpy as np
from scipy.integrate import simpson, solve_bvp
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc, ive, jv

from skinwave.typing import Array


def gaussian_at_rest(r: Array, *, width: float, shear_modulus: float, poisson: float) -> Array:
    """Return the deflection under exp(-r^2 / 2 s^2) Pa, with kernel (1 - nu) / (mu k)."""
    x = (r / width) ** 2 / 4
    return (1 - poisson) * width * np.sqrt(np.pi / 2) / shear_modulus * ive(0, x)


def gaussian_on_bonded_layer(
    r: Array, *, width: float, shear_modulus: float, poisson: float, depth: float
) -> Array:
    """Return the deflection of a layer on a rigid base under the same pressure.

    Its kernel is that of the half-space times (2 c sinh 2u - 4u) / (2 c cosh 2u + 4 u^2 + 1 + c^2)
    with u = k depth and c = 3 - 4 nu.
    """
    k = np.linspace(1e-9, 8, 4001) / width
    u, c = k * depth, 3 - 4 * poisson
    e = np.exp(-2 * u)
    layer = (c * (1 - e**2) - 4 * u * e) / (c * (1 + e**2) + (4 * u**2 + 1 + c**2) * e)
    spot = width**2 * np.exp(-((k * width) ** 2) / 2) * (1 - poisson) / shear_modulus * layer
    return simpson(spot * jv(0, r[:, None] * k), x=k, axis=1)


def half_space_kernel(k: Array, w: float, *, density: float, mu: complex, poisson: float) -> Array:
    """Return the deflection per pressure of wavenumber k, with a complex modulus mu.

    It is -b_p k_s^2 / (mu R) with R = (2 k^2 - k_s^2)^2 - 4 k^2 b_p b_s.
    """
    ks2 = density * w**2 / mu
    bp, bs = np.sqrt(k**2 - ks2 * (1 - 2 * poisson) / (2 - 2 * poisson)), np.sqrt(k**2 - ks2 + 0j)
    return -bp * ks2 / mu / ((2 * k**2 - ks2) ** 2 - 4 * k**2 * bp * bs)


def plate_kernel(k: Array, w: float, *, stiffness: complex, mass: float, air: float) -> Array:
    """Return 1 / [D k^4 - (m + 2 air / sqrt(k^2 - k0^2)) w^2 + i w R] with k0 = w / 343 m/s and the
    resistance R = 2 sqrt(i w eta air) of viscous air.
    """
    fluid = 2 * air / np.sqrt(k**2 - (w / 343.0) ** 2 + 0j)
    resistance = 2 * np.sqrt(1j * w * 1.82e-5 * air)
    return 1 / (stiffness * k**4 - (mass + fluid) * w**2 + 1j * w * resistance)


def gaussian_response(
    kernel: Callable[[Array], Array], r: Array, *, width: float, circle: float = 0.0,
    harmonic: int = 0,
) -> Array:  # fmt: skip
    """Return Hankel's integral of a kernel G for a Gaussian pressure of 1 Pa.

    For a push on a circle of radius R, harmonic n at radius r is
    int s^2 exp(-k^2 s^2 / 2) G(k) J_n(k R) J_n(k r) k dk.
    """
    k = np.geomspace(1e-6, 8, 25_001) / width  # equal to 200_001 points to 1e-14
    common = width**2 * np.exp(-((k * width) ** 2) / 2) * kernel(k) * jv(harmonic, k * circle) * k
    return np.array([simpson(common * jv(harmonic, k * x) * k, x=np.log(k)) for x in r])


def strip_under_sine(k: float, *, thickness: float, shear_modulus: float, poisson: float) -> float:
    """Return the deflection of the loaded face of a free strip, plane strain, under 1 Pa times
    sin(k x): Timoshenko and Goodier, Theory of Elasticity (1970), chapter 3.
    """
    x = k * thickness
    bending = (np.cosh(x) + 1) / (np.sinh(x) - x) if x > 1e-2 else 12 / x**3 * (1 + x**2 / 5)
    squeezing = (np.cosh(x) - 1) / (np.sinh(x) + x)
    return float((1 - poisson) / (2 * shear_modulus * k) * (bending + squeezing))


def rayleigh_ratio(poisson: float) -> float:
    """Return c_R / c_s: x^6 - 8 x^4 + (24 - 16 g) x^2 - 16 (1 - g) = 0, g = (c_s / c_p)^2."""
    g = (1 - 2 * poisson) / (2 - 2 * poisson)
    roots = np.roots([1, -8, 24 - 16 * g, -16 * (1 - g)])
    squares = roots[np.abs(roots.imag) < 1e-9].real
    return float(np.sqrt(squares[(squares > 0) & (squares < 1)].min()))


def rayleigh_lamb(k: float, *, thickness: float, poisson: float, symmetric: bool = False) -> float:
    """Return w / c_s in 1/m of the lowest wave of a free plate, A0 or S0 (symmetric)."""
    half, g = thickness / 2, (1 - 2 * poisson) / (2 - 2 * poisson)

    def balance(w: float) -> float:
        a, b = np.sqrt(k**2 - g * w**2 + 0j), np.sqrt(k**2 - w**2 + 0j)
        a, b = (a, b) if symmetric else (b, a)
        one = (2 * k**2 - w**2) ** 2 * np.cosh(a * half) * np.sinh(b * half) / b
        return float((one - 4 * k**2 * a * np.sinh(a * half) * np.cosh(b * half)).real)

    thin = k * thickness / np.sqrt(6 * (1 - poisson))
    band = (0.85, 1.001 * np.sqrt(2 / (1 - poisson))) if symmetric else (0.3 * min(thin, 1), 0.9999)
    w = k * np.linspace(band[0], band[1], 2000)
    values = np.array([balance(x) for x in w])
    first = int(np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1]))[0])
    return brentq(balance, w[first], w[first + 1], xtol=1e-13 * k)


def clamped_plate() -> tuple[Array, float]:
    """Return w a^2 sqrt(m / D), ascending, and the central deflection D w / q a^4 of a clamped
    square plate, by the polynomials (1 - x^2)^2 P_n. Young gives 35.99 and 73.41, Timoshenko
    0.00126.
    """
    x, weight = np.polynomial.legendre.leggauss(40)
    shapes = [np.polynomial.Legendre.basis(n) for n in range(14)]
    clamp = np.polynomial.Polynomial([1, 0, -2, 0, 1])
    basis = [clamp * s.convert(kind=np.polynomial.Polynomial) for s in shapes]
    f, second = (np.array([b.deriv(d)(x) if d else b(x) for b in basis]) for d in (0, 2))
    mass, bend, cross = ((p * weight) @ q.T for p, q in ((f, f), (second, second), (second, f)))
    K = np.kron(bend, mass) + np.kron(cross, cross.T)
    K = K + np.kron(mass, bend) + np.kron(cross.T, cross)
    parameters = 4 * np.sqrt(eigh(K, np.kron(mass, mass), eigvals_only=True)[:3])
    centre = np.array([b(0.0) for b in basis])
    load = f @ weight
    return parameters, float(np.kron(centre, centre) @ np.linalg.solve(K, np.kron(load, load)) / 16)


def moving_force_on_beam(t: Array, *, speed: float, critical: float, period: float) -> Array:
    """Return the mid-span deflection over F L^3 / 48 E I while a force crosses a simply supported
    beam, by a sum over modes n; `period` is that of the first mode.
    """
    w1, alpha, total = 2 * np.pi / period, speed / critical, np.zeros_like(t)
    for n in range(1, 60, 2):
        wn, drive = n**2 * w1, n * alpha * w1
        wave = np.sin(drive * t) - drive / wn * np.sin(wn * t)
        total += np.sin(n * np.pi / 2) * wave * w1**2 / (wn**2 - drive**2)
    return total * 96 / np.pi**4


def layered_column(
    w: Array, lengths: list[float], densities: list[float], moduli: list[Array]
) -> Array:
    """Return the displacement per stress at the top of a column of layers on a fixed base.

    It is tan(k L) / (k M) for one layer with a real or complex modulus M. The addition theorem of
    the tangent joins layers.
    """
    below = np.zeros_like(w, np.complex128)
    for length, density, modulus in zip(lengths, densities, moduli, strict=True):
        k = w * np.sqrt(density / modulus)
        turn, stiffness = np.tan(k * length), k * modulus
        below = (below + turn / stiffness) / (1 - below * stiffness * turn)
    return below


def lamb_pulse(
    t: Array, r: float, *, mu: float, shear_speed: float, delay: float, width: float
) -> Array:
    """Return the vertical motion of a surface at r under a point force, for nu = 1/4.

    Mooney's step response is convolved with the derivative of exp(-(t - delay)^2 / 2 width^2) N.
    """
    s, g = np.sqrt(3), np.sqrt(3 + np.sqrt(3)) / 2
    x, weight = np.polynomial.legendre.leggauss(400)
    # After the P wave, then after the S wave; at last 3 / 8 after the Rayleigh wave at tau = g.
    motion = 3 / 8 * np.exp(-(((t - delay - g * r / shear_speed) / width) ** 2) / 2)
    for low, high in ((1 / s, 1.0), (1.0, g)):
        start, end = np.arcsin(low / g), np.arcsin(high / g)
        angle = (start + end) / 2 + (end - start) / 2 * x
        # tau = g sin(angle) removes the root at the Rayleigh arrival.
        tau, d_tau = g * np.sin(angle), g * np.cos(angle) * weight * (end - start) / 2
        step = (6 - np.sqrt(3 * s + 5) / np.sqrt(g**2 - tau**2)) / 16
        if high == 1.0:
            rest = np.sqrt(3 * s - 5) / np.sqrt(tau**2 - (3 - s) / 4) - s / np.sqrt(tau**2 - 0.25)
            step = (step + rest / 16) / 2
        since = (t[:, None] - delay - tau * r / shear_speed) / width
        slope = -since / width * np.exp(-(since**2) / 2)
        motion = motion + slope @ (step * d_tau) * r / shear_speed
    return motion / (np.pi * mu * r)


def in_plane_reflection(k: float, ks: float, *, poisson: float) -> tuple[Array, Array]:
    """Return the reflected displacement amplitudes of a viscous boundary, and the plane waves.

    Amplitudes have rows for P and SV in, and columns for P and SV out. The waves have a wavenumber
    k along the boundary and a shear wavenumber ks. Their rows are P in, SV in, P out and SV out,
    their columns motion along and towards the boundary, and wavenumber towards it.
    """
    ratio = np.sqrt((1 - 2 * poisson) / (2 - 2 * poisson))
    kp = ks * ratio
    p, q = (np.sqrt(x**2 - k**2 + 0j).conj() for x in (kp, ks))
    waves = np.array(
        [[k / kp, p / kp, p], [q / ks, -k / ks, q], [k / kp, -p / kp, -p], [q / ks, k / ks, -q]]
    )
    along, into, kz = waves.T
    lam = 1 / ratio**2 - 2
    normal = lam * (k * along + kz * into) + 2 * kz * into - ks / ratio * into
    shear = kz * along + k * into - ks * along
    boundary = np.array([normal, shear])
    return -np.linalg.solve(boundary[:, 2:], boundary[:, :2]).T, waves


def driven_oscillator(
    t: float, *, drive: float, damping: float = 0.0, modulus: float = 0.0, time: float = 1.0
) -> float:
    """Return the solution of u'' + damping u' + u + modulus d = sin(drive t) from rest,
    d' = u' - d / time, by partial fractions of the transform.
    """
    lagging = [time, 1.0]
    cubic = np.polyadd(np.polymul([1.0, damping, 1.0], lagging), [modulus * time, 0.0])
    bottom = np.polymul(cubic, [1.0, 0.0, drive**2])
    s = np.append(np.roots(cubic), [1j * drive, -1j * drive])
    residues = drive * np.polyval(lagging, s) / np.polyval(np.polyder(bottom), s)
    return float((residues * np.exp(s * t)).sum().real)


def elastica(load: float) -> tuple[float, float]:
    """Return the tip deflection and shortening of a cantilever over its length.

    The load is P L^2 / E I: elliptic integrals of parameter m, amplitude arcsin 1 / sqrt(2 m) and
    K(m) - F = sqrt(load). Mattiasson gives 0.30172 and 0.05643 at 1.
    """

    def amplitude(m: float) -> float:
        return float(np.arcsin(1 / np.sqrt(2 * m)))

    root = np.sqrt(load)
    m = brentq(lambda m: ellipk(m) - ellipkinc(amplitude(m), m) - root, 0.5, 1 - 1e-12, xtol=1e-15)
    deflection = 1 - 2 * (ellipe(m) - ellipeinc(amplitude(m), m)) / root
    return float(deflection), float(1 - 2 * np.sqrt(m) * np.cos(amplitude(m)) / root)


def karman_disc(load: float, poisson: float) -> float:
    """Return w / h at the centre of a clamped disc with an immovable edge, at q a^4 / 64 D h =
    load.

    With slope r g, force N a^2 / D and radius r / a: g'' + 3 g' / r = N g + 32 load,
    N'' + 3 N' / r = -6 (1 - nu^2) g^2.
    """

    def slopes(r: Array, y: Array) -> Array:
        g, dg, N, dN, _ = y
        return np.vstack([dg, N * g + 32 * load, dN, -6 * (1 - poisson**2) * g**2, r * g])

    def ends(a: Array, b: Array) -> Array:
        return np.array([a[1], a[3], b[0], b[3] + (1 - poisson) * b[2], b[4]])

    r = np.linspace(0, 1, 101)
    start = np.zeros((5, len(r)))
    start[0], start[4] = -4 * (1 - r**2), (1 - r**2) ** 2
    singular = np.diag([0.0, -3, 0, -3, 0])
    solution = solve_bvp(slopes, ends, r, start, S=singular, tol=1e-6, max_nodes=20_000)
    if solution.status:
        raise ArithmeticError(f"von Karman's equations were not solved: {solution.message}")
    return float(solution.y[4, 0])
