"""Drive laws: from a commanded amplitude to the radiation pressure on the surface.

A is the amplitude (0..1), which may vary in time, M the modulation (-1..1), m the depth of
modulation (0..1). Without modulation M = 1, and every law gives its full value.
"""

from collections.abc import Callable

from simple_model.trajectory import Floats


def linear(amplitude: Floats | float, modulation: Floats, depth: float) -> Floats:
    """A M: pressure is the commanded signal itself, with its sign (Lim et al.); depth unused."""
    return amplitude * modulation


def pressure_squared(amplitude: Floats | float, modulation: Floats, depth: float) -> Floats:
    """[A (1 + m M)/(1 + m)]^2: sound pressure is modulated; radiation pressure is its square.

    Traditional AM (US 11704983 B2); adds a line at twice the AM frequency.
    """
    return (amplitude * (1 + depth * modulation) / (1 + depth)) ** 2


def force_corrected(amplitude: Floats | float, modulation: Floats, depth: float) -> Floats:
    """A (1 + m M)/(1 + m): the device takes the square root first, so that pressure follows M."""
    return amplitude * (1 + depth * modulation) / (1 + depth)


DRIVES: dict[str, Callable[[Floats | float, Floats, float], Floats]] = {
    "linear": linear,
    "pressure_squared": pressure_squared,
    "force_corrected": force_corrected,
}
