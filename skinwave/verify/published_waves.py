"""Speed, 1/e length and decay exponent of waves by frequency, of presets that stand for skin."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simple_model.layers.dispersion import Mode
from simple_model.layers.wavenumber_integral import point_response
from simple_model.load.focus import NOMINAL_HEIGHT, lobe_width, spot_width
from simple_model.typing import Floats
from skinwave.bodies import BODIES as PRESETS
from skinwave.bodies import Body
from skinwave.bodies.analytic import compliance, dispersion
from skinwave.verify.compared import Compared, compared
from skinwave.verify.published import (
    EXPONENT,
    LENGTH,
    SPEED,
    Published,
    Quantity,
    all_sources,
    wave_sets,
)

# Half-spaces of one material, and slabs on bone; skin-slab is the default scene's, of 15 mm.
BODIES: Mapping[str, Body] = {
    **{name: Body(kind="slab", material=name, depth=inf)
       for name in ("forearm", "palm", "palm-stiff")},
    **{name: PRESETS[name] for name in ("skin-slab", "palm-layers", "forearm-layers")},
}  # fmt: skip
WORDS: Mapping[str, str] = {
    "forearm": "half-space, Kelvin-Voigt, from Zhang's constants",
    "palm": "half-space, Kelvin-Voigt, chosen for an optimum speed of the focus of 5 m/s",
    "palm-stiff": "half-space, Kelvin-Voigt, chosen for an optimum speed of 7 m/s",
    "skin-slab": "15 mm of palm on rigid bone",
    "palm-layers": "epidermis, dermis, fat and muscle on rigid bone, 25 mm, fitted within "
    "published ranges",
    "forearm-layers": "epidermis, dermis, hypodermis and muscle on rigid bone, 20 mm; upper layers "
    "of Feng's moduli, the rest fitted within published ranges",
}
GRID = np.arange(10.0, 701.0, 10.0)  # Hz: fine enough for modes to be tracked
AT_REST = 1e-3  # Hz, in place of 0, where a half-space without loss has its static speed
FITTED = (0.010, 0.040)  # m, between which an exponent is fitted


@dataclass(frozen=True, kw_only=True, eq=False)
class Curves:
    """Leading wave of a body at frequencies (f,) in Hz: number of its mode, phase speed in m/s and
    1/e length in m, nan where no wave propagates.
    """

    frequencies: Floats
    mode: NDArray[np.int_]
    speed: Floats
    length: Floats

    def at(self, quantity: Quantity, frequencies: Floats) -> Floats:
        """Values (n,) of speed or 1/e length; nan beyond the frequencies and without a wave."""
        values = self.speed if quantity is SPEED else self.length
        return np.interp(frequencies, self.frequencies, values, left=np.nan, right=np.nan)


def leading_wave(body: Body, grid: ArrayLike | None = None) -> Curves:
    """Wave that moves the surface most at the edge of the focal spot's main lobe.

    Parameters
    ----------
    body : Body, a slab or half-space
    grid : (f,) float, Hz, frequencies above 0 and ascending; `GRID` if None

    Returns
    -------
    Curves, from rest if it is a half-space: a layer on bone has no wave there
    """
    at_rest = [AT_REST] if body.depth == inf else []
    f = np.array([*at_rest, *np.asarray(GRID if grid is None else grid)])
    modes = dispersion(body, f, 6).modes
    led = np.array([_amplitude(mode) for mode in modes])
    if len(modes) == 1:  # Rayleigh's wave is one however strongly it decays
        led[:] = 1.0
    first = np.argmax(led, axis=0)
    some = led.max(axis=0) > 0
    speed, length = (
        np.where(some, np.array(values)[first, np.arange(len(f))], np.nan)
        for values in ([m.phase_speed for m in modes], [m.decay_length for m in modes])
    )
    f = np.where(f == AT_REST, 0.0, f)
    return Curves(frequencies=f, mode=first, speed=speed, length=length)


def _amplitude(mode: Mode) -> Floats:
    """Motion (f,) by a mode, 0 where it is no wave."""
    edge, width = lobe_width(NOMINAL_HEIGHT), spot_width(NOMINAL_HEIGHT)
    with np.errstate(invalid="ignore"):
        moved = np.abs(mode.amplitude(width, edge))
    return np.where(mode.is_wave & np.isfinite(moved), moved, 0.0)


def decay_exponents(body: Body, frequencies: Floats) -> Floats:
    """Exponents n (f,) of the power law distance^-n fitted to the motion about a focus at rest."""
    r = np.geomspace(*FITTED, 12)
    moved = point_response(
        compliance(body), r, 2 * np.pi * np.asarray(frequencies), spot_width(NOMINAL_HEIGHT)
    )
    return -np.polyfit(np.log(r), np.log(np.abs(moved)).T, 1)[0]


def compare_waves(curves: Mapping[str, Curves]) -> list[Compared]:
    """Rows of all published sets of waves.

    Parameters
    ----------
    curves : by the names of `BODIES`

    Returns
    -------
    Rows, by set and body
    """
    sets = (*wave_sets(), all_sources(SPEED), all_sources(LENGTH))
    return [row for each in sets for name in each.bodies
            for row in compared(each, name, ours_of(each, name, curves[name]))]  # fmt: skip


def ours_of(published: Published, name: str, curves: Curves) -> Floats:
    """Our values (n,), SI, at the frequencies of a set."""
    f = np.array(published.frequencies)
    if published.quantity is EXPONENT:
        return decay_exponents(BODIES[name], f)
    if published.quantity not in (SPEED, LENGTH):
        raise ValueError(f"{published.name} is not a set of waves; compare it where it belongs")
    found = curves.at(published.quantity, f)
    # Kelvin-Voigt's law has no loss at rest.
    return np.where((f == 0) & (published.quantity is LENGTH) & np.isfinite(found), inf, found)
