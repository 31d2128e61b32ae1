"""Linear viscoelastic materials and the presets that scenes name.

The complex shear modulus (time exp(+i w t)) is

    mu(w) = mu (1 + i loss_factor) + i w viscosity + relaxing_modulus i w tau / (1 + i w tau)

With viscosity alone that is the Kelvin-Voigt model, with a relaxing modulus alone the standard
linear solid, one Maxwell branch (Prony term) in parallel with a spring (C. Zener, Elasticity and
Anelasticity of Metals, 1948): mu in slow and mu + relaxing_modulus in fast motion. Poisson's ratio
is constant, so that the whole stiffness scales with mu.
"""

from dataclasses import dataclass
from math import isfinite, pi, sqrt

import numpy as np
from scipy.optimize import brentq


@dataclass(frozen=True, kw_only=True)
class Material:
    """An isotropic solid; give `shear_modulus` or build it with `from_young`.

    Parameters
    ----------
    density : float, kg/m3
    shear_modulus : float, Pa, at equilibrium: fully relaxed
    poisson : float, -1 < poisson < 0.5
    viscosity : float, Pa s, Kelvin-Voigt: shear stress per shear rate
    loss_factor : float, hysteretic loss, the same at every frequency
    relaxing_modulus : float, Pa, of the Maxwell branch of a standard linear solid: fast motion
        meets it in addition to the shear modulus
    relaxation_time : float, s, tau, in which the branch's stress falls to 1/e

    Raises
    ------
    ValueError
        If a value is not finite or outside these limits, or a relaxing modulus has no time.
    """

    density: float
    shear_modulus: float
    poisson: float
    viscosity: float = 0.0
    loss_factor: float = 0.0
    relaxing_modulus: float = 0.0
    relaxation_time: float = 0.0

    def __post_init__(self) -> None:
        for name in ("density", "shear_modulus"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} = {value} must be a finite number above 0")
        for name in ("viscosity", "loss_factor", "relaxing_modulus", "relaxation_time"):
            value = getattr(self, name)
            if not (isfinite(value) and value >= 0):
                raise ValueError(f"{name} = {value} must be a finite number, 0 or above")
        if self.relaxing_modulus > 0 and self.relaxation_time == 0:
            raise ValueError(
                f"relaxing_modulus = {self.relaxing_modulus:g} Pa has relaxation_time = 0 s, which "
                "must be above 0; give the time, or leave out the relaxing modulus"
            )
        if not -1 < self.poisson < 0.5:
            raise ValueError(
                f"poisson = {self.poisson} is outside -1 < poisson < 0.5; "
                "for an incompressible solid use 0.4999"
            )

    @property
    def has_loss(self) -> bool:
        """Whether the material dissipates energy."""
        return self.viscosity + self.loss_factor + self.relaxing_modulus > 0

    @property
    def young(self) -> float:
        """Young's modulus, Pa."""
        return 2 * self.shear_modulus * (1 + self.poisson)

    @property
    def first_lame(self) -> float:
        """Lame's first parameter, Pa."""
        return 2 * self.shear_modulus * self.poisson / (1 - 2 * self.poisson)

    def complex_modulus(self, w: float) -> complex:
        """Complex shear modulus in Pa of steady motion exp(+i w t), w in rad/s."""
        lasting = self.shear_modulus * (1 + 1j * self.loss_factor) + 1j * w * self.viscosity
        turned = 1j * w * self.relaxation_time
        return lasting + self.relaxing_modulus * turned / (1 + turned)

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


def from_young(*, young: float, poisson: float, **rest: float) -> Material:
    """Material by its Young's modulus in Pa; the rest as in `Material`."""
    return Material(shear_modulus=young / (2 * (1 + poisson)), poisson=poisson, **rest)


def _tissue(young: float) -> Material:
    """Soft tissue with the viscosity-to-modulus ratio of the palm."""
    shear = young / (2 * (1 + 0.4999))
    return Material(density=1000, shear_modulus=shear, poisson=0.4999, viscosity=2e-4 * shear)


def rayleigh_damping(loss_factor: float, band: tuple[float, float]) -> tuple[float, float]:
    """Coefficients (a, b) of the damping a M + b K that stand in for a constant loss factor.

    Viscous damping a M + b K has the loss factor a/w + b w; over the band (Hz) its largest and
    smallest values lie equally far above and below the given one (least maximum deviation).
    """
    low, high = 2 * pi * np.array(band)
    middle, spread = sqrt(low * high), sqrt(high / low)
    # a/w + b w is least, 2 b middle, at the middle, and largest, b middle (r + 1/r), at both ends.
    b = 2 * loss_factor / middle / (2 + spread + 1 / spread)
    return b * middle**2, b


PRESETS = {
    # Effective homogeneous soft tissue: Zhang et al., Med Eng Phys 33:31 (2011), forearm; the
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
        relaxing_modulus=10e3,
        relaxation_time=0.5e-3,
    ),
    # Layers of a hand. Moduli are those of fingertip models (Maeno, Kobayashi and Yamazaki 1998:
    # Young's modulus 136, 80 and 34 kPa) and, for muscle, the middle of 5 to 30 kPa; published
    # values spread over a factor of ten and more with method and strain. Losses as in the palm.
    "epidermis": _tissue(young=136e3),
    "dermis": _tissue(young=80e3),
    "fat": _tissue(young=34e3),
    "muscle": _tissue(young=15e3),
    # 80 g/m2 office paper of 0.1 mm, geometric mean of the two in-plane directions.
    "paper": from_young(density=800, young=4e9, poisson=0.3, loss_factor=0.03),
}
