"""Materials with a modulus law of their own: checked, and by Prony series where a model integrates
internal variables.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from simple_model import ModulusTable, MovingPressure
from simple_model.layers.material import Material
from simple_model.layers.prony import FIT_TOLERANCE
from simple_model.load.spectrum import load_lines
from skinwave.bodies import Body
from skinwave.bodies.parts import solid_of

SERIES_SHARE = 0.1  # of a waveform's tolerance: relative error that a series may have
STRONG = 1e-2  # of the strongest line of a load: lines that a table must reach
OCTAVE = 2.0  # below its first frequency, as far as its Prony series continues it


def own_laws(body: Body) -> tuple[Material, ...]:
    """The materials of a body that have a modulus law of their own."""
    return tuple(solid for solid in body.solids if solid.law is not None)


def has_own_law(body: Body) -> bool:
    """Whether a material of a body has a modulus law of its own."""
    return bool(own_laws(body))


def has_table(body: Body) -> bool:
    """Whether a material of a body has a table of moduli, which has none at complex frequencies."""
    return any(isinstance(solid.law, ModulusTable) for solid in own_laws(body))


def check_laws(body: Body, pressure: MovingPressure) -> None:
    """Refuse a body with a modulus law that is not passive or not causal, or with a table that some
    strong line of the load is outside of by more than an octave below; its mean may be.
    """
    for solid in own_laws(body):
        solid.series()
        if isinstance(solid.law, ModulusTable):
            first, last = solid.law.frequencies[0], solid.law.frequencies[-1]
            lowest, highest = slowest_and_fastest(pressure)
            if lowest < first / OCTAVE or highest > last * (1 + 1e-9):
                raise ValueError(
                    f"a table of complex moduli is from {first:g} to {last:g} Hz, and the load has "
                    f"lines of {100 * STRONG:g} % of its strongest from {lowest:g} to {highest:g} "
                    "Hz; extend the table, or take another load"
                )


@lru_cache(maxsize=8)
def slowest_and_fastest(pressure: MovingPressure) -> tuple[float, float]:
    """Strong lines of a load, but for its mean, in Hz."""
    f = load_lines(pressure, STRONG).frequencies
    return float(f[f > 0].min(initial=np.inf)), float(f.max(initial=0.0))


def series_tolerance(tolerance: float) -> float:
    """Relative error of a Prony series: a share of that of a waveform."""
    return min(FIT_TOLERANCE, SERIES_SHARE * tolerance)


def relaxing(body: Body, tolerance: float) -> Body:
    """The body with Prony series for its modulus laws, within a relative error."""
    if not has_own_law(body):
        return body

    def made(material: str | Material) -> str | Material:
        solid = solid_of(material)
        return material if solid.law is None else solid.relaxing(tolerance)

    layers = tuple(replace(layer, material=made(layer.material)) for layer in body.layers)
    regions = tuple((name, made(material)) for name, material in body.regions)
    return replace(body, material=made(body.material), layers=layers, regions=regions)
