"""Linear viscoelastic materials, for every model, and the presets that scenes name.

The complex shear modulus (time exp(+i w t)) is

    mu(w) = mu h(w) + i w viscosity + sum_j mu_j i w tau_j / (1 + i w tau_j)

where h is 1, or with a loss factor that of `constant_loss`. Viscosity alone makes the Kelvin-Voigt
model, Prony terms a generalised Maxwell solid (Simo and Hughes, Computational Inelasticity (1998),
chapter 10), and one Prony term the standard linear solid (C. Zener, Elasticity and Anelasticity of
Metals, 1948): mu in slow and mu + sum mu_j in fast motion. A `law` replaces all of it; models that
need internal variables use its Prony series. Poisson's ratio is constant, so the whole stiffness
scales with mu, in an orthotropic sheet with that of its isotropic mean.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from simple_model.choices import check_numbers
from simple_model.layers.modulus_laws import FractionalKelvinVoigt, ModulusTable, ScaledLaw
from simple_model.layers.prony import (
    FIT_TOLERANCE,
    ModulusLaw,
    PronySeries,
    PronyTerm,
    constant_loss,
    fit_prony,
)
from simple_model.typing import Floats


@dataclass(frozen=True, kw_only=True)
class Orthotropy:
    """Moduli of a sheet along its sides x and y: paper is twice as stiff along its grain as across.

    Q11 = E_x / (1 - nu_xy nu_yx), Q22 = E_y / (1 - nu_xy nu_yx), Q12 = nu_yx Q11, Q66 = G_xy, nu_yx
    = nu_xy E_y / E_x (Reddy, Mechanics of Laminated Composite Plates and Shells (2004), chapter 1).
    The isotropic mean has E = sqrt(E_x E_y) and nu = sqrt(nu_xy nu_yx).

    Parameters
    ----------
    young_x, young_y : float, Pa, Young's moduli
    poisson_xy : float, contraction along y under a stress along x, 0 or above
    shear_xy : float, Pa, or None for sqrt(E_x E_y) / (2 (1 + sqrt(nu_xy nu_yx)))

    Raises a ValueError if a value is out of range.
    """

    young_x: float
    young_y: float
    poisson_xy: float
    shear_xy: float | None = None

    def __post_init__(self) -> None:
        check_numbers("a sheet", self, "young_x", "young_y", "shear_xy")
        if not (self.poisson_xy >= 0 and self.poisson < 0.5):
            raise ValueError(
                f"poisson_xy = {self.poisson_xy} is outside 0 <= poisson_xy < "
                f"{0.5 * sqrt(self.young_x / self.young_y):.3g}, where the geometric mean of "
                "both directions is 0.5; for paper it is usually 0.2 to 0.4"
            )

    @property
    def young(self) -> float:
        """Young's modulus of the isotropic mean, Pa."""
        return sqrt(self.young_x * self.young_y)

    @property
    def poisson(self) -> float:
        """Poisson's ratio of the isotropic mean."""
        return self.poisson_xy * sqrt(self.young_y / self.young_x)

    @property
    def shear(self) -> float:
        """Shear modulus of the isotropic mean, Pa."""
        return self.young / (2 * (1 + self.poisson))

    @property
    def plane_stress(self) -> Floats:
        """Stiffness Q (3, 3) in Pa of plane stress, for the strains xx, yy and 2 xy."""
        inner = 1 - self.poisson**2
        across = self.poisson_xy * self.young_y / inner
        shear = self.shear if self.shear_xy is None else self.shear_xy
        return np.array(
            [[self.young_x / inner, across, 0], [across, self.young_y / inner, 0], [0, 0, shear]]
        )

    def scaled(self, factor: float) -> Orthotropy:
        """Return the orthotropy with all moduli multiplied by a factor."""
        shear = None if self.shear_xy is None else factor * self.shear_xy
        young_x, young_y = factor * self.young_x, factor * self.young_y
        return replace(self, young_x=young_x, young_y=young_y, shear_xy=shear)


@dataclass(frozen=True, kw_only=True)
class Material:
    """An isotropic solid. Give `shear_modulus`, or use `from_young`, `of_law`, `tabulated` or
    `orthotropic`.

    Parameters
    ----------
    density : float, kg/m3
    shear_modulus : float, Pa, fully relaxed; with a loss factor, the storage modulus at 150 Hz
        without viscosity and Prony terms
    poisson : float, -1 < poisson < 0.5
    viscosity : float, Pa s, Kelvin-Voigt
    loss_factor : float, loss over storage modulus, nearly constant from 10 Hz to 2 kHz
        (`constant_loss`)
    prony : Prony terms
    law : angular frequencies (...) in rad/s -> complex shear moduli (...) in Pa, in place of all
        other terms: a record of `modulus_laws`, or any function that is analytic at frequencies
        with imaginary part <= 0; `shear_modulus` is its value at rest
    orthotropy : in-plane moduli of a sheet, whose isotropic mean has `shear_modulus` and `poisson`

    Raises a ValueError if a value is out of range, or if a law is combined with other losses or an
    orthotropy.

    >>> palm = Material(density=1000.0, shear_modulus=25e3, poisson=0.4999, viscosity=5.0)
    >>> palm.shear_speed  # m/s
    5.0
    >>> round(abs(palm.complex_modulus(2 * np.pi * 140.0)))  # Pa
    25384
    """

    density: float
    shear_modulus: float
    poisson: float
    viscosity: float = 0.0
    loss_factor: float = 0.0
    prony: tuple[PronyTerm, ...] = ()
    law: ModulusLaw | None = None
    orthotropy: Orthotropy | None = None

    def __post_init__(self) -> None:
        check_numbers("a material", self, "density", "shear_modulus")
        check_numbers("a material", self, "viscosity", "loss_factor", least="0 or above")
        largest_loss_factor = 10.0
        if self.loss_factor > largest_loss_factor:
            raise ValueError(
                f"loss_factor = {self.loss_factor:g} is above {largest_loss_factor:g}, more liquid "
                "than solid; give a viscosity instead"
            )
        if not -1 < self.poisson < 0.5:
            raise ValueError(
                f"poisson = {self.poisson} is outside -1 < poisson < 0.5; "
                "for an incompressible solid use 0.4999"
            )
        if self.law is not None and (self.viscosity or self.loss_factor or self.prony):
            raise ValueError(
                "the modulus law of a material includes all its losses; leave out viscosity, "
                "loss_factor and prony"
            )
        if self.law is not None and self.orthotropy is not None:
            raise ValueError(
                "an orthotropic material takes no modulus law; give it a viscosity, a loss_factor "
                "or Prony terms"
            )

    @property
    def has_loss(self) -> bool:
        """Whether the material dissipates energy; assumed for a law of its own."""
        return self.law is not None or self.viscosity + self.loss_factor + self.fast_modulus > 0

    @property
    def fast_modulus(self) -> float:
        """Sum of the moduli of all Prony terms in Pa, including those of the series of a law."""
        terms = self.prony if self.law is None else self.series().terms
        return sum((term.modulus for term in terms), 0.0)

    @property
    def young(self) -> float:
        """Young's modulus, Pa."""
        return 2 * self.shear_modulus * (1 + self.poisson)

    @property
    def first_lame(self) -> float:
        """Lame's first parameter, Pa."""
        return 2 * self.shear_modulus * self.poisson / (1 - 2 * self.poisson)

    def complex_modulus(self, omega: ArrayLike) -> Any:
        """Complex shear modulus (...) in Pa at real or complex w (...) in rad/s."""
        omega = np.asarray(omega)
        if self.law is not None:
            return self.law(omega)
        solid = self.without_loss_factor()
        lasting = solid.shear_modulus + 1j * omega * solid.viscosity
        return lasting + solid.relaxing_modulus(omega)

    def relaxing_modulus(self, omega: ArrayLike) -> Any:
        """Part (...) in Pa of the complex modulus that the given Prony terms add."""
        return sum((term(omega) for term in self.prony), np.zeros((), np.complex128))

    def series(self, tolerance: float = FIT_TOLERANCE) -> PronySeries:
        """Prony series of its law; raises a ValueError if the law is not passive or not causal."""
        assert self.law is not None
        if isinstance(self.law, ModulusTable):
            return self.law.series
        return fit_prony(self.law, rest=self.shear_modulus, tolerance=tolerance)

    def relaxing(self, tolerance: float = FIT_TOLERANCE) -> Material:
        """Return the material with a Prony series in place of its law or its loss factor."""
        if self.law is None:
            return self.without_loss_factor()
        series = self.series(tolerance)
        return replace(
            self, shear_modulus=series.shear_modulus, viscosity=series.viscosity,
            prony=series.terms, law=None,
        )  # fmt: skip

    def without_loss_factor(self) -> Material:
        """Return the same material with its loss factor as Prony terms."""
        if not self.loss_factor:
            return self
        factor = constant_loss(self.loss_factor)
        series = factor.scaled(self.shear_modulus)
        return replace(
            self, shear_modulus=series.shear_modulus, viscosity=self.viscosity + series.viscosity,
            loss_factor=0.0, prony=(*self.prony, *series.terms),
            orthotropy=self.orthotropy and self.orthotropy.scaled(factor.shear_modulus),
        )  # fmt: skip

    def scaled(self, *, modulus: float = 1.0, loss: float = 1.0) -> Material:
        """Return the same law with all moduli, or all losses, multiplied by a factor."""
        both, law = modulus * loss, self.law
        if law is not None and hasattr(law, "scaled"):
            law = law.scaled(modulus=modulus, loss=loss)
        elif law is not None:
            law = ScaledLaw(law=law, modulus=modulus, loss=loss)
        return replace(
            self, shear_modulus=getattr(law, "shear_modulus", modulus * self.shear_modulus),
            viscosity=both * self.viscosity, loss_factor=loss * self.loss_factor, law=law,
            prony=tuple(replace(term, modulus=both * term.modulus) for term in self.prony),
            orthotropy=self.orthotropy and self.orthotropy.scaled(modulus),
        )  # fmt: skip

    @property
    def plane_stress(self) -> Floats:
        """Relaxed stiffness Q (3, 3) in Pa of plane stress, for the strains xx, yy and 2 xy."""
        if self.orthotropy is not None:
            return self.orthotropy.plane_stress
        inner = self.young / (1 - self.poisson**2)
        across = self.poisson * inner
        return np.array([[inner, across, 0], [across, inner, 0], [0, 0, self.shear_modulus]])

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
        """Speed of surface waves without loss, m/s: the root below 1 of s^3 - 8 s^2 + (24 - 16 r) s
        - 16 (1 - r) = 0, with s the squared speed over that of shear waves.
        """
        ratio = self.shear_modulus / (self.first_lame + 2 * self.shear_modulus)
        roots = np.roots([1.0, -8.0, 24 - 16 * ratio, 16 * (ratio - 1)])
        (below_one,) = roots[(roots.imag == 0) & (roots.real < 1)].real
        return self.shear_speed * sqrt(below_one)


def from_young(*, young: float, poisson: float, **rest: Any) -> Material:
    """Return a material from its Young's modulus in Pa; the other values are those of `Material`.

    >>> round(from_young(density=800, young=4e9, poisson=0.3).shear_modulus)
    1538461538
    """
    return Material(shear_modulus=young / (2 * (1 + poisson)), poisson=poisson, **rest)


def orthotropic(
    *, density: float, young_x: float, young_y: float, poisson_xy: float,
    shear_xy: float | None = None, **losses: Any,
) -> Material:  # fmt: skip
    """Return the material of a sheet from its density in kg/m3 and its moduli along x and y, as in
    `Orthotropy`. Its `viscosity`, `loss_factor` and `prony` terms are isotropic, as in `Material`.
    """
    along = Orthotropy(young_x=young_x, young_y=young_y, poisson_xy=poisson_xy, shear_xy=shear_xy)
    return Material(
        density=density, shear_modulus=along.shear, poisson=along.poisson, orthotropy=along,
        **losses,
    )  # fmt: skip


def of_law(*, density: float, poisson: float, law: Any) -> Material:
    """Return a material from its density in kg/m3, Poisson's ratio and modulus law.

    The law is a `FractionalKelvinVoigt`, `FractionalZener` or `ModulusTable`, whose modulus at rest
    becomes that of the material.
    """
    return Material(density=density, shear_modulus=law.shear_modulus, poisson=poisson, law=law)


def tabulated(
    *, density: float, poisson: float, frequencies: ArrayLike, moduli: ArrayLike
) -> Material:
    """Return a material from its density in kg/m3, Poisson's ratio and measured complex shear
    moduli (k,) in Pa at ascending frequencies (k,) in Hz. The first may be 0.

    Its modulus at rest is that at 0 Hz or that of the Prony series of the table. Raises a
    ValueError as `ModulusTable` does.

    >>> moduli = [25e3, 27e3 + 5e3j, 29e3 + 8e3j]
    >>> solid = tabulated(density=1000, poisson=0.4999, frequencies=[0, 100, 200], moduli=moduli)
    >>> solid.shear_modulus
    25000.0
    """
    f, mu = np.asarray(frequencies, np.float64), np.asarray(moduli, np.complex128)
    table = ModulusTable(frequencies=tuple(f.tolist()), moduli=tuple(mu.tolist()))
    return of_law(density=density, poisson=poisson, law=table)


def _tissue(shear: float, loss: float = 2e-4) -> Material:
    """Soft tissue with a shear modulus in Pa; `loss` in s is its viscosity over that modulus."""
    return Material(density=1000, shear_modulus=shear, poisson=0.4999, viscosity=loss * shear)


FOREARM_LOSS = 5e-4  # s

PRESETS: Mapping[str, Material] = {
    # Effective homogeneous half-spaces. The forearm is that of Zhang et al., Med Eng Phys 33:31
    # (2011); the palms bracket the 5-8 m/s at which a moving focus feels strongest.
    "forearm": Material(density=1000, shear_modulus=7.86e3, poisson=0.4999, viscosity=5.03),
    "palm": Material(density=1000, shear_modulus=25e3, poisson=0.4999, viscosity=5.0),
    "palm-stiff": Material(density=1000, shear_modulus=50e3, poisson=0.4999, viscosity=10.0),
    # The palm as a standard linear solid, the law that fits forearms best (Kearney et al., Phys Med
    # Biol 60:6975 (2015)). No constants of a palm are published: these give it the modulus of
    # "palm" at rest, and loss factors of 0.06, 0.14 and 0.16 at 50, 140 and 200 Hz, where "palm"
    # has 0.06, 0.18 and 0.25.
    "palm-zener": Material(
        density=1000, shear_modulus=25e3, poisson=0.4999,
        prony=(PronyTerm(modulus=10e3, time=0.5e-3),),
    ),
    # Silicone of skin replicas, Ecoflex 00-30: density by its maker's data sheet, the law that of
    # Lanoy et al., PNAS 117 (2020), doi 10.1073/pnas.2010812117. The constants are second-hand and
    # were not checked against that paper: a plausible silicone, not a measured one.
    "ecoflex": of_law(
        density=1070, poisson=0.4999,
        law=FractionalKelvinVoigt(shear_modulus=25e3, exponent=0.33, time=0.3e-3),
    ),
    # Layers of a palm, fitted to published waves within published ranges (bench/layered_skin.py has
    # both). The epidermis is not fitted: 1 to 2 MPa (Young's modulus) in vitro, with and without
    # stratum corneum (Geerligs et al., J Biomech 44:1176 (2011)).
    "epidermis": _tissue(shear=500e3),
    "dermis": _tissue(shear=70e3),
    "fat": _tissue(shear=15e3),
    "muscle": _tissue(shear=25e3),
    # Layers of a forearm. Three have Young's moduli of waves of 4 to 10 kHz (epidermis with stratum
    # corneum, 4 MPa) and of 0.2 to 1 kHz (40 and 15 kPa): Feng et al., Acta Biomater 146:295
    # (2022). The muscle and all losses are fitted to the waves of Zhang et al. (2011).
    "forearm-epidermis": _tissue(shear=1.33e6, loss=FOREARM_LOSS),
    "forearm-dermis": _tissue(shear=13.3e3, loss=FOREARM_LOSS),
    "forearm-hypodermis": _tissue(shear=5e3, loss=FOREARM_LOSS),
    "forearm-muscle": _tissue(shear=10e3, loss=FOREARM_LOSS),
    # Compact bone, isotropic: human femora have shear moduli of 3.3 and Young's moduli of 17 GPa
    # along and 11.5 GPa across (Reilly and Burstein, J Biomech 8:393 (1975), doi
    # 10.1016/0021-9290(75)90075-5); ten times the modulus moves a fingertip by 2 %
    # less or more, and the loss of so stiff a part does not show.
    "bone": Material(density=1900, shear_modulus=4e9, poisson=0.3),
    # 80 g/m2 office paper of 0.1 mm, geometric mean of the two in-plane directions.
    "paper": from_young(density=800, young=4e9, poisson=0.3, loss_factor=0.03),
    # The same with its grain along x; values of handbooks, 5-8 and 2-4 GPa, whose mean is that of
    # "paper". No sheet was measured.
    "paper-grain": orthotropic(
        density=800, young_x=5.5e9, young_y=2.5e9, poisson_xy=0.35, loss_factor=0.03
    ),
}  # fmt: skip
# Detection thresholds do not apply to these materials.
NOT_SKIN = ("ecoflex", "bone", "paper", "paper-grain")
