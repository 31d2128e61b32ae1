"""Quantities of a response: motion, strain and stress, at the surface or below it.

A quantity is a few linear components of a field of the body. Every model reads it by one operator
(rows of the field at each probe), a factor of frequency for rates and relaxing stress and, if it is
not linear, a function of the components at each time:

    q(t) = invariant(synthesis of s^rate mu(s)/mu rows(material) field(s))

Axes are those of the scene, z upwards, out of the body. Normal displacement is positive into the
body, as a pressure pushes.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from simple_model.choices import choose
from simple_model.layers.material import Material
from simple_model.layers.tensors import COMPONENTS, energy_root, hooke, largest_shear, von_mises
from simple_model.numbers import significant
from simple_model.typing import Floats

NORMAL, VECTOR, STRAIN = "normal displacement", "displacement", "strain"  # fields
Rows = Callable[[Material], Floats]


class NotApplicable(ValueError, AttributeError):
    """A response does not have this attribute, so that `hasattr` returns False."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Quantity:
    """Quantity of a response.

    Parameters
    ----------
    name, symbol, words : str, for scenes and files, for formulas (TeX), and for sentences
    unit : str, SI
    shown, per_unit : str, float, unit on axes and in tables, and how many make the SI unit
    field : NORMAL, VECTOR or STRAIN, the field of a body to read; "" for none
    rows : material -> components (c, k) of the field (k,) at rest
    rate : int, order of the time derivative
    relaxes : bool, whether it is proportional to the complex modulus
    invariant : components (..., c) -> values (...), for quantities that are not linear
    """

    name: str
    symbol: str
    words: str
    unit: str
    shown: str
    per_unit: float = 1.0
    field: str = NORMAL
    rows: Rows = lambda material: np.eye(1)
    rate: int = 0
    relaxes: bool = False
    invariant: Callable[[Floats], Floats] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by name, so that other processes use the registered quantity."""
        return quantity, (self.name,)

    @property
    def column(self) -> str:
        """Its column in tables: its name and, in ASCII letters, its unit."""
        unit = self.shown.translate(str.maketrans("µ²³/", "u23_"))
        return f"{self.name}_{unit.lower()}"

    @property
    def of_body(self) -> bool:
        """Whether it is a quantity of a body; the pressure of the point kernel is not."""
        return bool(self.field)

    @property
    def is_normal(self) -> bool:
        """Whether it depends only on the motion normal to the surface."""
        return self.field == NORMAL

    def factor(self, s: Any, modulus: Any = 1.0) -> Any:
        """Factor of its components at complex s in rad/s; `modulus` is relative to that at rest."""
        return np.asarray(s) ** self.rate * (modulus if self.relaxes else 1.0)

    def text(self, value: float, digits: int = 3) -> str:
        """Format an SI value in the unit of axes and tables."""
        return f"{significant(self.per_unit * value, digits)} {self.shown}"

    def waveforms(self, components: Floats, probes: int) -> Floats:
        """Values (t, p) of components (t, p c), with those of a probe next to each other."""
        each = components.reshape(len(components), probes, -1)
        return self.invariant(each) if self.invariant else each[..., 0]


QUANTITIES: dict[str, Quantity] = {}


def register(quantity: Quantity) -> Quantity:
    """Register a quantity for scenes; raises a ValueError if the name exists."""
    if quantity.name in QUANTITIES:
        raise ValueError(f"quantity '{quantity.name}' is already registered; choose another name")
    QUANTITIES[quantity.name] = quantity
    return quantity


def quantity(name: str) -> Quantity:
    """Return the quantity with a name; raises a ValueError for an unknown name."""
    return QUANTITIES[choose("quantity", name, QUANTITIES)]


def _choose(rows: Rows, component: int) -> Rows:
    return lambda material: rows(material)[[component]]


DISPLACEMENT, VELOCITY, ACCELERATION, PRESSURE = map(register, (
    Quantity(
        name="displacement", symbol="u_n", words="displacement into the body", unit="m",
        shown="µm", per_unit=1e6,
    ),
    Quantity(
        name="velocity", symbol="v_n", words="velocity into the body", unit="m/s", shown="mm/s",
        per_unit=1e3, rate=1,
    ),
    Quantity(
        name="acceleration", symbol="a_n", words="acceleration into the body", unit="m/s2",
        shown="m/s²", rate=2,
    ),
    Quantity(
        name="pressure", symbol="q", words="pressure of the point kernel", unit="Pa", shown="Pa",
        field="",
    ),
))  # fmt: skip
for _k, _axis in enumerate("xyz"):
    register(Quantity(
        name=f"displacement_{_axis}", symbol=f"u_{_axis}", words=f"displacement along {_axis}",
        unit="m", shown="µm", per_unit=1e6, field=VECTOR,
        rows=_choose(lambda material: np.eye(3), _k),
    ))  # fmt: skip
for _k, _pair in enumerate(COMPONENTS):
    register(Quantity(
        name=f"strain_{_pair}", symbol=rf"\varepsilon_{{{_pair}}}", words=f"strain {_pair}",
        unit="1", shown="µm/m", per_unit=1e6, field=STRAIN,
        rows=_choose(lambda material: np.eye(6), _k),
    ))  # fmt: skip
    register(Quantity(
        name=f"stress_{_pair}", symbol=rf"\sigma_{{{_pair}}}", words=f"stress {_pair}",
        unit="Pa", shown="Pa", field=STRAIN, rows=_choose(hooke, _k), relaxes=True,
    ))  # fmt: skip
register(Quantity(
    name="largest_shear_strain", symbol=r"\gamma_{max}", words="largest shear strain", unit="1",
    shown="µm/m", per_unit=1e6, field=STRAIN, rows=lambda material: np.eye(6),
    invariant=largest_shear,
))  # fmt: skip
register(Quantity(
    name="von_mises_stress", symbol=r"\sigma_{vM}", words="von Mises stress", unit="Pa",
    shown="Pa", field=STRAIN, rows=hooke, relaxes=True, invariant=von_mises,
))  # fmt: skip
register(Quantity(
    name="energy_density", symbol="W", words="elastic strain energy density at the moduli at rest",
    unit="J/m3", shown="mJ/m³", per_unit=1e3, field=STRAIN, rows=energy_root,
    invariant=lambda values: np.asarray((values**2).sum(axis=-1)),
))  # fmt: skip
