"""Modes of a stack of layers at given frequencies, by the thin-layer method.

A wave with displacements i U(z) along x and W(z) downwards, times e^{i (w t - k x)}, has strains k
U, W' and i (U' - k W). Its weak form over the depth z is the symmetric quadratic pencil

    (A k^2 + B k + G - w^2 M) (U, W) = 0

with A, G, M block diagonal in (U, W) and B off-diagonal (E. Kausel, Int J Numer Meth Eng 37:927
(1994)). With V = k U it is linear in k^2, and half as large as its companion form. The elements in
depth are of order `ORDER` with Gauss-Lobatto nodes, which make M and the shear-modulus terms of A
diagonal. The terms of the first Lame parameter use one Gauss point fewer than there are nodes: with
equal numbers, each element would have a spurious pressure wave near nu = 0.5.

A half-space below is a perfectly matched layer: elements of complex length, in which outgoing waves
decay.
"""

from dataclasses import dataclass
from functools import cache
from math import ceil

import numpy as np
from numpy.polynomial import legendre

from simple_model.layers.stack import Stack
from simple_model.typing import Complex, Floats

ORDER = 8
MATCHED = np.exp(-0.6j) * np.array([0.75, 1.5, 3.0, 6.0, 12.0])  # element lengths over 1/|k_s|


@dataclass(frozen=True, kw_only=True, eq=False)
class Pencil:
    """Matrices of the pencil at frequencies (f,): (f, n, n), or (f, n) if diagonal; U and W share
    M. `traction` is the part of Buw by which U does work on the normal stress of a section x =
    const. `depths` (d,) in m are those of the nodes outside a matched layer.
    """

    Auu: Complex
    Aww: Complex
    Guu: Complex
    Gww: Complex
    Buw: Complex
    M: Complex
    traction: Complex
    depths: Floats


@cache
def lobatto() -> tuple[Floats, Floats, Floats]:
    """Gauss-Lobatto nodes (9,), weights (9,) on 0 to 1, and shape function derivatives (q, a)."""
    top = legendre.Legendre.basis(ORDER)
    x = np.concatenate([[-1.0], np.sort(top.deriv().roots().real), [1.0]])
    weights = np.array(2 / (ORDER * (ORDER + 1) * top(x) ** 2), np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        D = top(x)[:, None] / top(x) / (x[:, None] - x)
    D[np.diag_indices(ORDER + 1)] = 0.0
    D[np.diag_indices(ORDER + 1)] = -D.sum(axis=1)
    return np.asarray((1 + x) / 2), np.asarray(weights / 2), np.asarray(2 * D)


@cache
def gauss() -> tuple[Floats, Floats, Floats]:
    """Gauss weights (8,) on 0 to 1, shape functions (q, a) and their derivatives (q, a)."""
    nodes, _, D = lobatto()
    x, weights = legendre.leggauss(ORDER)
    basis = [legendre.legvander(at, ORDER) for at in (x, 2 * nodes - 1)]
    N: Floats = np.asarray(np.linalg.solve(basis[1].T, basis[0].T).T, np.float64)
    return np.asarray(weights / 2), N, N @ D


def elements(stack: Stack, omega: Floats) -> tuple[list[int], Complex]:
    """Return the layer of each element, and lengths (f, e) in m; raise a ValueError if too many."""
    layers, lengths = [], []
    finite = sum(thickness for thickness in stack.thicknesses if np.isfinite(thickness))
    per_element = 5.0  # shear wavenumber times length, of the longest element
    fewest = 2  # elements of all layers, in proportion to their thickness
    for k, (material, thickness) in enumerate(zip(stack.materials, stack.thicknesses, strict=True)):
        shear = np.abs(np.sqrt(material.density / material.complex_modulus(omega)) * omega)
        if np.isinf(thickness):
            layers += [k] * len(MATCHED)
            lengths += [length / shear for length in MATCHED]
        else:
            waves = float(shear.max()) * thickness / per_element
            count = ceil(max(waves, fewest * thickness / finite - 1e-9))
            layers += [k] * count
            lengths += [np.full(len(omega), thickness / count)] * count
    most = 20  # elements with dense matrices: some seconds for fifty frequencies
    if len(layers) > most:
        raise ValueError(
            f"dispersion curves up to {omega.max() / 2 / np.pi:g} Hz of layers of {1e3 * finite:g} "
            f"mm need {len(layers)} elements in depth, more than {most}; use a half-space, "
            "thinner or fewer layers, or lower frequencies"
        )
    return layers, np.array(lengths, np.complex128).T


def pencil(stack: Stack, omega: Floats, moduli: Complex) -> Pencil:
    """Pencil of a stack whose layers have shear moduli (f, l) in Pa at omega (f,) in rad/s."""
    layers, length = elements(stack, omega)
    nodes, w, D = lobatto()
    g, N, dN = gauss()
    NN, Nd, dd = (np.einsum("q,qa,qb->ab", g, a, b) for a, b in ((N, N), (N, dN), (dN, dN)))
    DD, wD = np.einsum("q,qa,qb->ab", w, D, D), w[:, None] * D
    count = ORDER * len(layers) + 1
    Aww, M = np.zeros((2, len(omega), count), np.complex128)
    Auu, Guu, Gww, Buw, traction = np.zeros((5, len(omega), count, count), np.complex128)
    depths = [np.zeros(1)]
    for e, layer in enumerate(layers):
        at, h = slice(ORDER * e, ORDER * e + ORDER + 1), length[:, e, None]
        material, mu = stack.materials[layer], moduli[:, layer, None]
        lam = 2 * material.poisson / (1 - 2 * material.poisson) * mu
        Aww[:, at] += mu * h * w
        M[:, at] += material.density * h * w
        mu, lam, h = mu[..., None], lam[..., None], h[..., None]
        Auu[:, at, at] += 2 * mu * h * np.diag(w) + lam * h * NN
        Guu[:, at, at] += mu / h * DD
        Gww[:, at, at] += (2 * mu * DD + lam * dd) / h
        Buw[:, at, at] += lam * Nd - mu * wD.T
        traction[:, at, at] += lam * Nd
        if np.isfinite(stack.thicknesses[layer]):
            depths.append(depths[-1][-1] + nodes[1:] * length[0, e].real)
    if not stack.is_rigid:  # springs on the last node, none below a free stack
        Guu[:, -1, -1] += stack.base_stiffness
        Gww[:, -1, -1] += stack.base_stiffness
    free = slice(0, count - stack.is_rigid)
    square = (slice(None), free, free)
    return Pencil(
        Auu=Auu[square], Aww=Aww[:, free], Guu=Guu[square], Gww=Gww[square], Buw=Buw[square],
        M=M[:, free], traction=traction[square], depths=np.concatenate(depths),
    )  # fmt: skip


def eigenpairs(terms: Pencil, omega: Floats) -> tuple[Complex, Complex, Complex]:
    """Squared wavenumbers (f, m) in 1/m2, and V = k U and W (f, n, m), of all modes of the pencil
    [[Auu, Buw], [0, Aww]] k^2 + [[Suu, 0], [Bwu, Sww]] on (V, W), S = G - w^2 M.
    """
    n = terms.Auu.shape[1]
    inertia = (omega[:, None] ** 2 * terms.M)[..., None] * np.eye(n)
    first, second = np.zeros((2, len(omega), 2 * n, 2 * n), np.complex128)
    first[:, :n, :n], first[:, :n, n:] = terms.Auu, terms.Buw
    first[:, n:, n:] = terms.Aww[..., None] * np.eye(n)
    second[:, :n, :n], second[:, n:, :n] = terms.Guu - inertia, terms.Buw.swapaxes(1, 2)
    second[:, n:, n:] = terms.Gww - inertia
    relative_shift = 0.1 + 1.0j  # of the largest squared shear wavenumber
    # The shift makes roots of slow modes accurate for any Poisson's ratio.
    shift = relative_shift * (omega**2 * np.abs(terms.M / terms.Aww).max(axis=1))[:, None, None]
    inverse, vectors = np.linalg.eig(np.linalg.solve(second + shift * first, first))
    return shift[..., 0] - 1 / inverse, vectors[:, :n], vectors[:, n:]


def outgoing(squared: Complex, slope: Complex) -> Complex:
    """Wavenumbers of squares, with the sign that decays or, without loss, carries energy outwards;
    `slope` is the derivative of the squares by omega.
    """
    k = np.sqrt(squared)
    k = np.where(k == 0, 1e-300, k)
    decays = np.abs(k.imag) > 1e-9 * np.abs(k)
    turned = np.where(decays, k.imag > 0, (slope / k).real < 0)
    return np.asarray(np.where(turned, -k, k))
