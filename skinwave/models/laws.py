"""Materials with a modulus law: checks, and Prony series for models with internal variables."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from simple_model import ModulusTable, MovingPressure
from simple_model.layers.material import Material
from simple_model.layers.prony import FIT_TOLERANCE
from simple_model.load.spectrum import load_lines
from skinwave.bodies import Body
from skinwave.bodies.parts import solid_of

STRONG = 1e-2  # of the strongest line of a load: lines that a table must cover


def own_laws(body: Body) -> tuple[Material, ...]:
    """Return the materials of a body that have a modulus law."""
    return tuple(solid for solid in body.solids if solid.law is not None)


def has_own_law(body: Body) -> bool:
    """Whether a material of a body has a modulus law."""
    return bool(own_laws(body))


def has_table(body: Body) -> bool:
    """Whether a material has a table of moduli, which is unknown at complex frequencies."""
    return any(isinstance(solid.law, ModulusTable) for solid in own_laws(body))


def check_laws(body: Body, pressure: MovingPressure) -> None:
    """Raise a ValueError if a modulus law is not passive or not causal, or if a table does not
    cover the strong lines of the load: from an octave below its first frequency up to its last one.
    """
    for solid in own_laws(body):
        solid.series()
        if isinstance(solid.law, ModulusTable):
            first, last = solid.law.frequencies[0], solid.law.frequencies[-1]
            lowest, highest = slowest_and_fastest(pressure)
            # The series of a table extends it by an octave below its first frequency.
            if lowest < first / 2 or highest > last * (1 + 1e-9):
                raise ValueError(
                    f"the table of complex moduli covers {first:g} to {last:g} Hz, but strong "
                    f"lines of the load (above {100 * STRONG:g} % of the strongest) lie at "
                    f"{lowest:g} to {highest:g} Hz; extend the table, or use another load"
                )


@lru_cache(maxsize=8)
def slowest_and_fastest(pressure: MovingPressure) -> tuple[float, float]:
    """Return the frequencies in Hz of the slowest and the fastest strong line, without the mean."""
    f = load_lines(pressure, STRONG).frequencies
    return float(f[f > 0].min(initial=np.inf)), float(f.max(initial=0.0))


def series_tolerance(tolerance: float) -> float:
    """Return the relative error of a Prony series that a waveform's `tolerance` permits."""
    return min(FIT_TOLERANCE, 0.1 * tolerance)


def relaxing(body: Body, tolerance: float) -> Body:
    """Return the body with Prony series in place of modulus laws, within a relative error."""
    if not has_own_law(body):
        return body

    def series(material: str | Material) -> str | Material:
        solid = solid_of(material)
        return material if solid.law is None else solid.relaxing(tolerance)

    layers = tuple(replace(layer, material=series(layer.material)) for layer in body.layers)
    regions = tuple((name, series(material)) for name, material in body.regions)
    return replace(body, material=series(body.material), layers=layers, regions=regions)
