"""Dispersion curves of laterally infinite bodies: wavenumbers of their modes at each frequency.

A mode varies as exp(i (w t - k x)), with Im k <= 0: it decays away from its source, at x < 0. Phase
speed is w / Re k, group speed 1 / Re(dk/dw), 1/e length 1 / |Im k|. Near a pole the compliance of
the surface is G = R / (k^2 - k_m^2). A pressure of transform S(k) on a spot therefore moves the
surface at a distance r by -(i/4) R S(k_m) H_0^(2)(k_m r) in this mode.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import hankel2e

from simple_model.layers.compliance import AIR_DENSITY
from simple_model.layers.half_space_below import modes_above_half_space, rayleigh_mode
from simple_model.layers.material import Material
from simple_model.layers.mode_tracking import Roots, frequencies_between, track_modes
from simple_model.layers.stack import Stack
from simple_model.layers.thin_layers import eigenpairs, outgoing, pencil
from simple_model.typing import Bools, Complex, Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class Mode:
    """A mode along frequency, NaN where it has no root.

    Parameters
    ----------
    name : str
    frequencies : (f,) float, Hz
    wavenumbers : (f,) complex, 1/m, k of exp(i (w t - k x)), Im k <= 0; Re k < 0 for a backward
        wave
    slowness : (f,) complex, s/m, dk/dw
    residues : (f,) complex, 1/Pa/m, of the surface compliance in k^2
    kinds : (f,) str, "propagating", "backward", "leaky", "evanescent", or "" without a root
    shapes : (f, d, 2) complex, displacement along x over i, and downwards, at the depths of the
        curves, over the largest magnitude
    """

    name: str
    frequencies: Floats
    wavenumbers: Complex
    slowness: Complex
    residues: Complex
    kinds: NDArray[np.str_]
    shapes: Complex

    @property
    def phase_speed(self) -> Floats:
        """Phase speed (f,) in m/s, positive also for a backward wave."""
        return 2 * np.pi * self.frequencies / np.abs(self.wavenumbers.real)

    @property
    def group_speed(self) -> Floats:
        """Group speed 1 / Re dk/dw (f,) in m/s; NaN where dk/dw is mostly imaginary."""
        real, imaginary = self.slowness.real, self.slowness.imag
        return np.where(np.abs(imaginary) > np.abs(real), np.nan, 1 / real)

    @property
    def decay_length(self) -> Floats:
        """1/e length (f,) of the amplitude of a plane wave, m; inf without loss."""
        with np.errstate(divide="ignore"):
            return np.asarray(1 / np.abs(self.wavenumbers.imag))

    @property
    def is_wave(self) -> Bools:
        """Whether the mode carries energy at each frequency (f,)."""
        return np.asarray((self.kinds != "evanescent") & (self.kinds != ""))

    @cached_property
    def cut_on(self) -> float:
        """Lowest frequency in Hz at which the mode carries energy, where k^2 crosses the imaginary
        axis; inf if there is none.
        """
        if not self.is_wave.any():
            return np.inf
        first = int(np.argmax(self.is_wave))
        f = self.frequencies
        if first == 0 or not np.isfinite(self.wavenumbers[first - 1]):
            return float(f[first])
        fine = np.linspace(f[first - 1], f[first], 200)
        squared = self.squared_at(fine).real
        crossing = np.flatnonzero((squared[:-1] < 0) & (squared[1:] >= 0))
        if not len(crossing):
            return float(f[first])
        k = crossing[-1]
        return float(np.interp(0.0, squared[k : k + 2], fine[k : k + 2]))

    def squared_at(self, frequencies: ArrayLike) -> Complex:
        """Squared wavenumber (g,) in 1/m2 at frequencies in Hz, by cubic Hermite interpolation:
        unlike k it is smooth at a cut-off.
        """
        f = np.asarray(frequencies, np.float64)
        known = np.isfinite(self.wavenumbers)
        if known.sum() < 2:
            return np.full(f.shape, np.nan + 0j)
        from scipy.interpolate import CubicHermiteSpline  # slow to import

        x, k = self.frequencies[known], self.wavenumbers[known]
        slope = 4 * np.pi * k * self.slowness[known]
        return np.asarray(CubicHermiteSpline(x, k**2, slope, extrapolate=False)(f))

    def amplitude(self, width: float, distance: float) -> Complex:
        """Motion (f,) of the surface in m/Pa in this mode, at a distance in m from the middle of a
        Gaussian spot with standard deviation `width` in m.
        """
        # The energy of a backward wave travels outwards, so its k takes the same Hankel function.
        k = self.wavenumbers
        spot = 2 * np.pi * width**2 * np.exp(-((k * width) ** 2) / 2)
        wave = hankel2e(0, k * distance) * np.exp(-1j * k * distance)
        return np.asarray(-0.25j * self.residues * spot * wave)


@dataclass(frozen=True, kw_only=True, eq=False)
class DispersionCurves:
    """Modes of a body at frequencies (f,) in Hz; their shapes are at `depths` (d,) in m."""

    frequencies: Floats
    depths: Floats
    modes: tuple[Mode, ...]


def dispersion_curves(stack: Stack, frequencies: ArrayLike, *, most: int = 6) -> DispersionCurves:
    """Compute at least one and at most `most` dispersion curves of a stack of layers, those of the
    least evanescent modes.

    Finite stacks use the thin-layer method. Layers on a half-space use the same with a perfectly
    matched layer, and refine its roots with the exact stiffness of the half-space. A half-space
    alone has the Rayleigh wave. Raises a ValueError unless frequencies (f,) in Hz are above 0 and
    ascending, or if layers are too many wavelengths thick.

    >>> from simple_model.layers.material import PRESETS
    >>> slab = Stack(materials=(PRESETS["palm"],), thicknesses=(0.015,))
    >>> modes = dispersion_curves(slab, [140.0]).modes
    >>> [round(float(mode.phase_speed[0]), 2) for mode in modes[:2]]  # m/s
    [11.43, 7.39]
    """
    f = check_frequencies(frequencies)
    omega = 2 * np.pi * f
    if stack.is_half_space and len(stack.materials) == 1:
        roots, depths = rayleigh_mode(stack.materials[0], omega)
        return curves(f, depths, roots, ("Rayleigh wave",))
    most_roots = 3 * most
    fine, (roots, depths) = omega, _roots(stack, omega, most_roots)
    for _ in range(4):  # add frequencies between the given ones
        is_bound = np.abs(roots.wavenumbers.real) > _leaking(stack, fine)[:, None]
        is_wave = is_bound & ~_is_evanescent(roots.wavenumbers)
        further = frequencies_between(roots, fine, is_wave, most)
        if not len(further):
            break
        # The ends of the band determine elements and depths.
        other, _ = _roots(stack, np.concatenate([omega[:1], further, omega[-1:]]), most_roots)
        both = roots.apply(lambda own, new: np.concatenate([own, new[1:-1]]), other)
        order = np.argsort(fine := np.concatenate([fine, further]))
        roots, fine = both.apply(lambda values, order=order: values[order]), fine[order]
    roots = track_modes(roots, fine, most, np.searchsorted(fine, omega))
    return curves(f, depths, roots, (), _leaking(stack, omega) if stack.is_half_space else None)


def _leaking(stack: Stack, omega: Floats) -> Floats:
    """Wavenumber (f,) in 1/m below which waves leak into a half-space below; 0 without one."""
    if not stack.is_half_space:
        return np.zeros(len(omega))
    below = stack.materials[-1]
    return np.asarray((omega * np.sqrt(below.density / below.complex_modulus(omega))).real)


def _roots(stack: Stack, omega: Floats, most: int) -> tuple[Roots, Floats]:
    """Roots of a stack at (f,) rad/s, at most `most` at each, and the depths of their shapes."""
    moduli, slopes = modulus_and_slope(stack, omega)
    solve = modes_above_half_space if stack.is_half_space else _finite
    return solve(stack, omega, moduli, slopes, most)


def _is_evanescent(wavenumbers: Complex) -> Bools:
    fastest_decay = 2 / np.pi  # a wave that falls to 1/e in a quarter of its length
    return np.asarray(np.abs(wavenumbers.imag) > fastest_decay * np.abs(wavenumbers.real))


def check_frequencies(frequencies: ArrayLike) -> Floats:
    """Return frequencies (f,) in Hz; raise a ValueError unless finite, above 0 and ascending."""
    f = np.atleast_1d(np.asarray(frequencies, np.float64))
    rises = np.isfinite(f).all() and f.ndim == 1 and (np.diff(f, prepend=0) > 0).all()
    if not (len(f) and rises):
        raise ValueError(
            "frequencies of dispersion curves must be finite, above 0 Hz and ascending; "
            "give one or more"
        )
    return f


def modulus_and_slope(stack: Stack, omega: Floats) -> tuple[Complex, Complex]:
    """Shear moduli (f, l) of the layers in Pa, and their derivatives in Pa s, at (f,) rad/s."""
    difference = 1e-4  # of a frequency, step of the derivative of a modulus
    at = omega[:, None] * np.array([1.0, 1 - difference, 1 + difference])
    mu = [np.broadcast_to(m.complex_modulus(at), at.shape) for m in stack.materials]
    values = np.stack(mu, axis=1).astype(np.complex128)
    step = 2 * difference * omega[:, None]
    return values[..., 0], (values[..., 2] - values[..., 1]) / step


def _finite(
    stack: Stack, omega: Floats, moduli: Complex, slopes: Complex, most: int
) -> tuple[Roots, Floats]:
    """The least evanescent roots of a finite stack, and the depths of their shapes."""
    springless = replace(stack, base="free", base_stiffness=0.0) if stack.base_stiffness else stack
    own, change = pencil(stack, omega, moduli), pencil(springless, omega, slopes)
    squared, V, W = eigenpairs(own, omega)
    order = np.argsort(np.abs(np.sqrt(squared).imag), axis=1)[:, :most]
    squared = np.take_along_axis(squared, order, axis=1)
    V, W = (np.take_along_axis(x, order[:, None], axis=2) for x in (V, W))

    def form(left: Complex, matrix: Complex, right: Complex) -> Complex:
        return np.asarray(np.einsum("fam,fab,fbm->fm", left, matrix, right, optimize=True))

    def diagonal(left: Complex, matrix: Complex, right: Complex) -> Complex:
        return np.asarray(np.einsum("fam,fa,fam->fm", left, matrix, right))

    # Left eigenvectors are (V, k^2 W); derivative of the linear pencil in k^2, then in w.
    norm = form(V, own.Auu, V) + form(V, own.Buw, W) + squared * diagonal(W, own.Aww, W)
    by_frequency = squared * (
        form(V, change.Auu, V) + 2 * form(V, change.Buw, W) + form(W, change.Gww, W)
        + squared * diagonal(W, change.Aww, W)
    ) + form(V, change.Guu, V) - 2 * omega[:, None] * (
        diagonal(V, own.M, V) + squared * diagonal(W, own.M, W)
    )  # fmt: skip
    slope = -by_frequency / norm
    k = outgoing(squared, slope)
    U = V / k[:, None]
    flux = form(U.conj(), own.traction, W) + form(
        W.conj(), (own.Buw - own.traction).swapaxes(1, 2), U)  # fmt: skip
    flux += k * (form(U.conj(), own.Auu, U) + diagonal(W.conj(), own.Aww, W))
    stored = omega[:, None] * sum(diagonal(x.conj(), own.M, x) for x in (U, W))
    shapes = np.zeros((*k.shape, len(own.depths), 2), np.complex128)
    for axis, x in enumerate((U, W)):
        shapes[:, :, : x.shape[1], axis] = x.swapaxes(1, 2)
    roots = Roots(
        squared=squared, slope=slope, wavenumbers=k, residues=squared * W[:, 0] ** 2 / norm,
        energy_speed=np.abs(flux.real / stored.real), shapes=shapes,
    )  # fmt: skip
    return roots, own.depths


def curves(
    frequencies: Floats,
    depths: Floats,
    roots: Roots,
    names: tuple[str, ...] = (),
    bound: Floats | None = None,
) -> DispersionCurves:
    """Curves of tracked modes at frequencies (f,) in Hz, with shapes at depths (d,) in m.

    Modes without names are numbered by cut-on. `bound` (f,) in 1/m is the wavenumber of the shear
    wave of a half-space below: waves of smaller wavenumbers leak into it.
    """
    k = roots.wavenumbers
    known = np.isfinite(k)
    slowest_flux = 0.05  # of the phase speed: energy that moves slower does not leave
    with np.errstate(invalid="ignore", divide="ignore"):
        omega = 2 * np.pi * frequencies[:, None]
        decays = _is_evanescent(k)
        stays = roots.energy_speed < slowest_flux * omega / np.abs(k.real)
        leaks = np.zeros(k.shape, bool) if bound is None else np.abs(k.real) < bound[:, None]
        kinds = np.select(
            [~known, decays | stays, leaks, k.real < 0],
            ["", "evanescent", "leaky", "backward"], "propagating",
        )  # fmt: skip
        largest = np.abs(roots.shapes).max(axis=(2, 3), keepdims=True)
        shapes = roots.shapes / np.where(largest > 0, largest, 1.0)
        slowness = roots.slope / (2 * k)
    modes = [
        Mode(
            name=names[m] if names else "", frequencies=frequencies, wavenumbers=k[:, m],
            slowness=slowness[:, m], residues=roots.residues[:, m], kinds=kinds[:, m],
            shapes=shapes[:, m],
        )
        for m in range(k.shape[1])
    ]  # fmt: skip
    if not names:
        modes.sort(key=lambda mode: (mode.cut_on, -np.nanmax(mode.wavenumbers.imag)))
        modes = [replace(mode, name=f"mode {n}") for n, mode in enumerate(modes, start=1)]
    return DispersionCurves(frequencies=frequencies, depths=depths, modes=tuple(modes))


def sheet_curves(
    material: Material,
    thickness: float,
    frequencies: ArrayLike,
    *,
    air_density: float = AIR_DENSITY,
    tension: float = 0.0,
) -> DispersionCurves:
    """Compute the dispersion curves of an infinite thin sheet: its bending wave and its near field.

    They are the poles of `compliance.thin_sheet`, D k^5 + T k^3 - m w^2 k - 2 rho_air w^2 = 0 with
    Re k >= 0. Frequencies (f,) in Hz must be above 0 and ascending (ValueError). Tension in N/m is
    the same in all directions. An air density of 0 kg/m3 is vacuum. Shapes are given at both faces;
    along x they follow from the rotation of the section, U = k W z from the middle.
    """
    f = check_frequencies(frequencies)
    omega = 2 * np.pi * f
    sheet = Stack(materials=(material,), thicknesses=(thickness,), base="free")
    mu, slope = (x[:, 0] for x in modulus_and_slope(sheet, omega))
    bending = thickness**3 / (6 * (1 - material.poisson)) * mu
    mass, air = material.density * thickness, 2 * air_density
    k = bending_wavenumbers(bending, tension, mass * omega**2, air * omega**2)
    D, w = bending[:, None], omega[:, None]
    by_k = 5 * D * k**4 + 3 * tension * k**2 - mass * w**2
    by_frequency = (slope / mu)[:, None] * D * k**5 - 2 * w * (mass * k + air)
    tilt = k * thickness / 2  # of the upper face, z downwards
    upper, lower = (np.stack([sign * tilt, np.ones_like(k)], axis=-1) for sign in (-1, 1))
    roots = Roots(
        squared=k**2, slope=-2 * k * by_frequency / by_k, wavenumbers=k,
        residues=2 * k**2 / by_k, energy_speed=np.full(k.shape, np.inf),
        shapes=np.stack([upper, lower], axis=2),
    )  # fmt: skip
    return curves(f, np.array([0.0, thickness]), roots, ("bending wave", "bending near field"))


def bending_wavenumbers(bending: Complex, tension: float, inertia: Floats, air: Floats) -> Complex:
    """Return the propagating and evanescent roots (f, 2) of D k^5 + T k^3 - a k - b, by Newton's
    method, for stiffnesses D and inertias of the sheet a and of the air b, each (f,).
    """
    D, a, b = bending[:, None], inertia[:, None], air[:, None]
    half = tension / 2 / D
    mean = np.sqrt(half**2 + a / D + 0j)
    k = np.sqrt(np.hstack([mean - half, mean + half])) * np.array([1, -1j])
    for _ in range(50):
        k = k - (D * k**5 + tension * k**3 - a * k - b) / (5 * D * k**4 + 3 * tension * k**2 - a)
    return np.asarray(k)
