"""Orthotropic sheets: paper is about twice as stiff along its grain as across it.

Q11 = E_x / (1 - nu_xy nu_yx),  Q22 = E_y / (1 - nu_xy nu_yx),  Q12 = nu_yx Q11,  Q66 = G_xy,
nu_yx = nu_xy E_y / E_x, and the bending stiffnesses of a thickness h are Q h^3 / 12 (Lekhnitskii,
Anisotropic Plates (1968), chapter 9; Reddy, Mechanics of Laminated Composite Plates and Shells
(2004), chapter 1). The isotropic mean has E = sqrt(E_x E_y) and nu = sqrt(nu_xy nu_yx), and its
shear modulus is the estimate of G_xy where none was measured.
"""

from dataclasses import dataclass, replace
from math import isfinite, sqrt

import numpy as np

from simple_model.typing import Floats


@dataclass(frozen=True, kw_only=True)
class Orthotropy:
    """Moduli of a sheet along its sides x and y.

    Parameters
    ----------
    young_x, young_y : float, Pa, Young's moduli
    poisson_xy : float, contraction along y under a stress along x, 0 or above
    shear_xy : float, Pa, or None for sqrt(E_x E_y) / 2 (1 + sqrt(nu_xy nu_yx))

    Raises
    ------
    ValueError
        If a modulus is not finite and above 0, or the contraction is out of range.
    """

    young_x: float
    young_y: float
    poisson_xy: float
    shear_xy: float | None = None

    def __post_init__(self) -> None:
        for name in ("young_x", "young_y", "shear_xy"):
            value = getattr(self, name)
            if value is not None and not (isfinite(value) and value > 0):
                raise ValueError(f"{name} = {value} Pa must be a finite number above 0")
        if not (self.poisson_xy >= 0 and self.poisson < 0.5):
            raise ValueError(
                f"poisson_xy = {self.poisson_xy} is outside 0 <= poisson_xy < "
                f"{0.5 * sqrt(self.young_x / self.young_y):.3g}, where the mean of both directions "
                "is 0.5; paper has 0.2 to 0.4"
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

    def scaled(self, factor: float) -> "Orthotropy":
        """The same ratios with all moduli multiplied by a factor."""
        return replace(
            self,
            young_x=factor * self.young_x,
            young_y=factor * self.young_y,
            shear_xy=None if self.shear_xy is None else factor * self.shear_xy,
        )
