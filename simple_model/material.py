"""Linear viscoelastic materials, of every model, and the presets that scenes name.

The complex shear modulus (time exp(+i w t)) is

    mu(w) = mu (1 + i loss_factor) + i w viscosity + sum_j mu_j i w tau_j / (1 + i w tau_j)

With viscosity alone that is the Kelvin-Voigt model, with Prony terms a generalised Maxwell solid
(Simo and Hughes, Computational Inelasticity (1998), chapter 10), with one of them the standard
linear solid (C. Zener, Elasticity and Anelasticity of Metals, 1948): mu in slow and mu + sum mu_j
in fast motion. A `law` replaces all of it, for models in the frequency domain. Poisson's ratio is
constant, so that the whole stiffness scales with mu.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import isfinite, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]
ModulusLaw = Callable[[Any], Any]  # complex shear modulus in Pa at angular frequencies in rad/s


@dataclass(frozen=True, kw_only=True)
class PronyTerm:
    """Prony term, a Maxwell branch in parallel with the rest: fast motion meets its modulus.

    Parameters
    ----------
    modulus : float, Pa, 0 or above
    time : float, s, above 0, in which its stress falls to 1/e

    Raises
    ------
    ValueError
        If a value is not finite or outside these limits.
    """

    modulus: float
    time: float

    def __post_init__(self) -> None:
        if not (isfinite(self.modulus) and self.modulus >= 0):
            raise ValueError(
                f"modulus of a Prony term = {self.modulus} Pa must be a finite number, 0 or above"
            )
        if not (isfinite(self.time) and self.time > 0):
            raise ValueError(
                f"relaxation time of a Prony term = {self.time} s must be a finite number above 0; "
                "give the time, or leave out the term"
            )

    def __call__(self, omega: ArrayLike) -> Any:
        """Complex modulus (...) in Pa at angular frequencies (...) in rad/s."""
        turned = 1j * np.asarray(omega) * self.time
        return self.modulus * turned / (1 + turned)


@dataclass(frozen=True, kw_only=True)
class Material:
    """An isotropic solid; give `shear_modulus`, or build it with `from_young` or `tabulated`.

    Parameters
    ----------
    density : float, kg/m3
    shear_modulus : float, Pa, at equilibrium: fully relaxed
    poisson : float, -1 < poisson < 0.5
    viscosity : float, Pa s, Kelvin-Voigt: shear stress per shear rate
    loss_factor : float, hysteretic loss, the same at every frequency
    prony : Prony terms, each with the modulus that it adds in fast motion, and its time
    law : angular frequencies (...) in rad/s -> complex shear moduli (...) in Pa, in place of all
        other terms, or None. For models in the frequency domain only, as it has no internal
        variables; `shear_modulus` is its value at rest

    Raises
    ------
    ValueError
        If a value is not finite or outside these limits, or a law is given beside other losses.
    """

    density: float
    shear_modulus: float
    poisson: float
    viscosity: float = 0.0
    loss_factor: float = 0.0
    prony: tuple[PronyTerm, ...] = ()
    law: ModulusLaw | None = None

    def __post_init__(self) -> None:
        for name in ("density", "shear_modulus"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} = {value} must be a finite number above 0")
        for name in ("viscosity", "loss_factor"):
            value = getattr(self, name)
            if not (isfinite(value) and value >= 0):
                raise ValueError(f"{name} = {value} must be a finite number, 0 or above")
        if not -1 < self.poisson < 0.5:
            raise ValueError(
                f"poisson = {self.poisson} is outside -1 < poisson < 0.5; "
                "for an incompressible solid use 0.4999"
            )
        if self.law is not None and (self.viscosity or self.loss_factor or self.prony):
            raise ValueError(
                "a material with a modulus law of its own has all losses in it; leave out "
                "viscosity, loss_factor and prony"
            )

    @property
    def has_loss(self) -> bool:
        """Whether the material dissipates energy; a law of its own is taken to."""
        return self.law is not None or self.viscosity + self.loss_factor + self.fast_modulus > 0

    @property
    def fast_modulus(self) -> float:
        """Sum of the moduli of all Prony terms, Pa: what fast motion meets beside the modulus."""
        return sum((term.modulus for term in self.prony), 0.0)

    @property
    def young(self) -> float:
        """Young's modulus, Pa."""
        return 2 * self.shear_modulus * (1 + self.poisson)

    @property
    def first_lame(self) -> float:
        """Lame's first parameter, Pa."""
        return 2 * self.shear_modulus * self.poisson / (1 - 2 * self.poisson)

    def complex_modulus(self, omega: ArrayLike) -> Any:
        """Complex shear modulus (...) in Pa of motion exp(+i w t), at w (...) in rad/s, which may
        be complex but for a table's; not below 0 with a loss factor, whose loss has one sign.
        """
        omega = np.asarray(omega)
        if self.law is not None:
            return self.law(omega)
        lasting = self.shear_modulus * (1 + 1j * self.loss_factor) + 1j * omega * self.viscosity
        return lasting + self.relaxing_modulus(omega)

    def relaxing_modulus(self, omega: ArrayLike) -> Any:
        """The part (...) in Pa of the complex modulus that Prony terms add."""
        return sum((term(omega) for term in self.prony), np.zeros((), np.complex128))

    def scaled(self, *, modulus: float = 1.0, loss: float = 1.0) -> "Material":
        """The same law with all its moduli, or all its losses, multiplied by a factor."""
        both = modulus * loss
        return replace(
            self,
            shear_modulus=modulus * self.shear_modulus,
            viscosity=both * self.viscosity,
            loss_factor=loss * self.loss_factor,
            prony=tuple(replace(term, modulus=both * term.modulus) for term in self.prony),
            law=self.law and _ScaledLaw(law=self.law, modulus=modulus, loss=loss),
        )

    @property
    def shear_speed(self) -> float:
        """Speed of shear waves without loss, m/s."""
        return sqrt(self.shear_modulus / self.density)

    @property
    def pressure_speed(self) -> float:
        """Speed of pressure waves without loss, m/s."""
        return sqrt((self.first_lame + 2 * self.shear_modulus) / self.density)

    @property
    def rayleigh_speed(self) -> float:
        """Speed of surface waves without loss, m/s, the root of Rayleigh's equation."""
        ratio = self.shear_modulus / (self.first_lame + 2 * self.shear_modulus)

        def rayleigh(x: float) -> float:
            return (2 - x * x) ** 2 - 4 * sqrt(1 - x * x) * sqrt(1 - x * x * ratio)

        return self.shear_speed * brentq(rayleigh, 0.5, 1 - 1e-12, xtol=1e-14)


@dataclass(frozen=True, kw_only=True)
class ModulusTable:
    """Measured complex shear moduli, straight between their frequencies; a modulus law.

    Below the first frequency the storage modulus is that of the first, and the loss modulus goes
    with the frequency.

    Parameters
    ----------
    frequencies : (k,) Hz, above 0 and ascending
    moduli : (k,) complex, Pa, with real parts above 0 and imaginary parts of 0 or above

    Raises
    ------
    ValueError
        If these are none, or asked for above the last frequency or at a complex one.
    """

    frequencies: tuple[float, ...]
    moduli: tuple[complex, ...]

    def __post_init__(self) -> None:
        f, mu = np.array(self.frequencies), np.array(self.moduli, np.complex128)
        rising = len(f) and np.isfinite(f).all() and (np.diff(f, prepend=0.0) > 0).all()
        if f.shape != mu.shape or f.ndim != 1 or not rising:
            raise ValueError(
                f"a table of complex moduli has {len(f)} frequencies and {len(mu)} moduli; give as "
                "many of each, one or more, with frequencies in Hz above 0 that rise"
            )
        if not (np.isfinite(mu).all() and (mu.real > 0).all() and (mu.imag >= 0).all()):
            raise ValueError(
                "a table of complex moduli has one that is not finite, or below 0 in its real or "
                "imaginary part; give storage and loss moduli in Pa"
            )

    def __call__(self, omega: ArrayLike) -> Complex:
        """Complex modulus (...) in Pa at angular frequencies (...) in rad/s."""
        if np.imag(omega).any():
            raise ValueError(
                "a table of complex moduli has none at the complex frequencies by which motion "
                "from rest is computed; use --model flat-body-harmonic or fem-harmonic"
            )
        hertz = np.abs(np.real(omega)) / (2 * np.pi)
        if (highest := hertz.max(initial=0.0)) > self.frequencies[-1] * (1 + 1e-9):
            raise ValueError(
                f"a table of complex moduli ends at {self.frequencies[-1]:g} Hz, and the load has "
                f"lines up to {highest:g} Hz; extend the table, or take a slower load"
            )
        f, mu = np.array([0.0, *self.frequencies]), np.array([self.moduli[0].real, *self.moduli])
        loss = np.interp(hertz, f, mu.imag) * np.sign(np.real(omega))
        return np.asarray(np.interp(hertz, f, mu.real) + 1j * loss)


@dataclass(frozen=True, kw_only=True)
class _ScaledLaw:
    """A modulus law with its storage and loss moduli multiplied by factors."""

    law: ModulusLaw
    modulus: float
    loss: float

    def __call__(self, omega: ArrayLike) -> Any:
        mu = self.modulus * self.law(omega)
        return mu if self.loss == 1 else mu.real + 1j * self.loss * mu.imag


def from_young(*, young: float, poisson: float, **rest: Any) -> Material:
    """Material by its Young's modulus in Pa; the rest as in `Material`."""
    return Material(shear_modulus=young / (2 * (1 + poisson)), poisson=poisson, **rest)


def tabulated(
    *, density: float, poisson: float, frequencies: ArrayLike, moduli: ArrayLike
) -> Material:
    """Material by measured complex shear moduli.

    Parameters
    ----------
    density : float, kg/m3
    poisson : float
    frequencies : (k,) float, Hz, ascending
    moduli : (k,) complex, Pa, at each frequency

    Returns
    -------
    Material
        Whose modulus at rest is the real part of the first.

    Raises
    ------
    ValueError
        As `ModulusTable` does.
    """
    f, mu = np.asarray(frequencies, np.float64), np.asarray(moduli, np.complex128)
    table = ModulusTable(frequencies=tuple(f.tolist()), moduli=tuple(mu.tolist()))
    return Material(density=density, shear_modulus=table.moduli[0].real, poisson=poisson, law=table)


def _tissue(young: float) -> Material:
    """Soft tissue with the viscosity-to-modulus ratio of the palm."""
    shear = young / (2 * (1 + 0.4999))
    return Material(density=1000, shear_modulus=shear, poisson=0.4999, viscosity=2e-4 * shear)


PRESETS: Mapping[str, Material] = {
    # Effective homogeneous half-spaces: Zhang et al., Med Eng Phys 33:31 (2011), forearm; the
    # palms bracket the 5-8 m/s at which a moving focus is perceived as strongest.
    "forearm": Material(density=1000, shear_modulus=7.86e3, poisson=0.4999, viscosity=5.03),
    "palm": Material(density=1000, shear_modulus=25e3, poisson=0.4999, viscosity=5.0),
    "palm-stiff": Material(density=1000, shear_modulus=50e3, poisson=0.4999, viscosity=10.0),
    # The palm as a standard linear solid, the law that fits forearms best (Kearney et al., Phys Med
    # Biol 60:6975 (2015)). No constants of a palm are published: these give it the modulus of
    # "palm" at rest, and loss factors of 0.06, 0.14 and 0.16 at 50, 140 and 200 Hz, where "palm"
    # has 0.06, 0.18 and 0.25.
    "palm-zener": Material(
        density=1000,
        shear_modulus=25e3,
        poisson=0.4999,
        prony=(PronyTerm(modulus=10e3, time=0.5e-3),),
    ),
    # Layers of a hand. Moduli are those of fingertip models (Maeno, Kobayashi and Yamazaki 1998:
    # Young's modulus 136, 80 and 34 kPa) and, for muscle, the middle of 5 to 30 kPa; published
    # values spread over a factor of ten and more with method and strain. Losses as in the palm.
    "epidermis": _tissue(young=136e3),
    "dermis": _tissue(young=80e3),
    "fat": _tissue(young=34e3),
    "muscle": _tissue(young=15e3),
    # Layers of a forearm, Young's modulus in waves of 4 to 10 kHz (epidermis with stratum corneum)
    # and of 0.2 to 1 kHz: Feng et al., Acta Biomater 146:295 (2022). Indentation finds epidermis of
    # 0.1 to 1 MPa, and dermis up to 6 MPa at large strain. Losses as in the palm.
    "forearm-epidermis": _tissue(young=4e6),
    "forearm-dermis": _tissue(young=40e3),
    "forearm-hypodermis": _tissue(young=15e3),
    # 80 g/m2 office paper of 0.1 mm, geometric mean of the two in-plane directions.
    "paper": from_young(density=800, young=4e9, poisson=0.3, loss_factor=0.03),
}
