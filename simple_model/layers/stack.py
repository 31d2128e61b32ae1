"""Stack of flat isotropic layers, for wavenumber integrals and dispersion curves."""

from dataclasses import dataclass
from math import inf

from simple_model.choices import choose
from simple_model.layers.material import Material

BASES = ("clamped", "free", "elastic")


@dataclass(frozen=True, kw_only=True)
class Stack:
    """Laterally infinite layers from the surface downwards, each bonded to the next.

    Parameters
    ----------
    materials : one for each layer
    thicknesses : m, one for each layer, above 0; the last may be inf, a half-space
    base : below the last layer if it is finite: "clamped", "free" or "elastic" (Winkler foundation)
    base_stiffness : N/m3, traction per displacement of an elastic base, in every direction

    Raises a ValueError if there is no layer or a value is out of range.

    >>> from simple_model.layers.material import PRESETS
    >>> skin = Stack(materials=(PRESETS["dermis"], PRESETS["fat"]), thicknesses=(0.002, inf))
    >>> skin.is_half_space
    True
    """

    materials: tuple[Material, ...]
    thicknesses: tuple[float, ...]
    base: str = "clamped"
    base_stiffness: float = 0.0

    def __post_init__(self) -> None:
        if not self.materials or len(self.materials) != len(self.thicknesses):
            raise ValueError(
                f"a stack has {len(self.materials)} materials and {len(self.thicknesses)} "
                "thicknesses; give one of each for every layer, from the surface downwards"
            )
        if not all(0 < thickness < inf for thickness in self.thicknesses[:-1]):
            raise ValueError("layers above the last must have a finite thickness above 0")
        if not self.thicknesses[-1] > 0:
            raise ValueError(f"thickness = {self.thicknesses[-1]} m of a layer must be above 0")
        choose("base", self.base, BASES)
        if (self.base == "elastic") != (0 < self.base_stiffness < inf):
            raise ValueError(
                f"base_stiffness = {self.base_stiffness} N/m3 does not fit base = "
                f"'{self.base}'; give a finite stiffness above 0 for an elastic base, else 0"
            )

    @property
    def thickness(self) -> float:
        """Thickness of all layers, m; inf with a half-space below."""
        return sum(self.thicknesses)

    @property
    def is_half_space(self) -> bool:
        """Whether the last layer is a half-space."""
        return self.thicknesses[-1] == inf

    @property
    def is_rigid(self) -> bool:
        """Whether it ends in a rigid base or a half-space."""
        return self.base == "clamped" or self.is_half_space

    @property
    def is_fixed(self) -> bool:
        """Whether it is constrained and does not drift."""
        return self.is_rigid or self.base == "elastic"
