"""How fast waves run along the surface of a body, and what a faster focus leaves behind it."""

from math import asin, pi

import numpy as np

from fem.materials import Material
from meshes.tetmesh import Floats
from simple_model import MovingPressure
from simple_model.compliance import AIR_DENSITY
from skinwave.scene import Body

LONGEST_PERIOD = 0.05  # s that two tones may take to meet again, and that pictures follow
AIR_TURNS = 30  # each leaves a quarter of the error, or less
SAME = 1e-6  # of a tone: further from a multiple of the common frequency it is none


def surface_speed(body: Body, frequency: float) -> float:
    """Phase speed in m/s of the surface wave of an endless body at a frequency in Hz.

    A slab's is that of the Rayleigh wave of its material, as if it were deep: in a layer that is
    thin beside the wavelength waves run faster. w / Re k with k = w / (c_R/c_s sqrt(mu*/rho)) and
    mu* = `Material.complex_modulus`. A sheet's is that of bending, with its air.

    Raises
    ------
    ValueError
        If there is no body.
    """
    if body.kind == "none":
        raise ValueError("body kind 'none' carries no wave; choose a sheet or a slab")
    solid, w = body.solid, 2 * pi * frequency
    if body.kind == "sheet":
        return w / bending_wavenumber(body, frequency)
    return _viscous(solid, w) * solid.rayleigh_speed / solid.shear_speed


def bending_wavenumber(body: Body, frequency: float) -> float:
    """k of an endless sheet, rad/m, at a frequency in Hz: D k^4 = (m + 2 rho / k) w^2."""
    w = 2 * pi * frequency
    k = (body.mass_per_area * w**2 / body.bending_stiffness) ** 0.25
    for _ in range(AIR_TURNS if body.air and w else 0):
        k = ((body.mass_per_area + 2 * AIR_DENSITY / k) * w**2 / body.bending_stiffness) ** 0.25
    return float(k)


def air_mass(body: Body, frequency: float) -> float:
    """2 rho / k, kg/m2: the air that moves with both sides of a sheet in waves of a frequency, Hz.

    Junger and Feit, Sound, Structures, and Their Interaction (1986), section 5.11.
    """
    return 2 * AIR_DENSITY / bending_wavenumber(body, frequency)


def _viscous(solid: Material, w: float) -> float:
    """Phase speed of shear waves with loss, m/s."""
    return float(1 / np.real(1 / np.sqrt(solid.complex_modulus(w) / solid.density)))


def mach_angle(wave_speed: float, speed: float) -> float | None:
    """Angle in rad between the path and the front behind a focus, asin(c/v); None if it is slower.

    Of a straight path: on a circle smaller than a wavelength no clean cone forms.
    """
    return asin(wave_speed / speed) if speed > wave_speed else None


def apparent_speed(distances: Floats, times: Floats, motion: Floats, frequency: float) -> float:
    """Speed in m/s at which a line of motion (t, p) runs along distances (p,) in metre.

    The phase of its part at `frequency` Hz is fitted by a straight line, weighted by amplitude;
    the times (t,) in s should span whole periods. Negative where waves come in.
    """
    wave = motion.T @ np.exp(-2j * pi * frequency * times)
    phase = np.unwrap(np.angle(wave))
    slope = np.polyfit(distances, phase, 1, w=np.abs(wave))[0]
    return float(-2 * pi * frequency / slope)


def tones(pressure: MovingPressure) -> tuple[float, ...]:
    """The frequencies in Hz that a load is made of, ascending."""
    tacton = pressure.tacton
    w1, w2 = tacton.superposition
    found = {
        tacton.am_frequency * (w1 > 0),
        tacton.second_am_frequency * (w2 > 0),
        tacton.envelope_frequency,
        tacton.drawing_frequency,
    }
    return tuple(sorted(f for f in found if f > 0))


def period(pressure: MovingPressure) -> float | None:
    """The period in s after which a load is the same again; None if that is not soon."""
    found = tones(pressure)
    if not found:
        return None
    for turns in range(1, int(LONGEST_PERIOD * found[0]) + 2):
        common = found[0] / turns
        whole = [f / common for f in found]
        if all(abs(n - round(n)) <= SAME * n for n in whole):
            return 1 / common
    return None


def shown_period(pressure: MovingPressure) -> float:
    """The period in s that films and snapshots show: the load's own or, if it has none, that of
    its slowest tone that is no slower than `LONGEST_PERIOD`.
    """
    if (own := period(pressure)) is not None:
        return own
    found = tones(pressure) or (1 / LONGEST_PERIOD,)
    return 1 / min((f for f in found if f * LONGEST_PERIOD >= 1), default=found[-1])


def strongest_tone(frequencies: Floats, amplitudes: Floats) -> float:
    """The frequency in Hz of the line (f,) that moves a set of points (f, p) most; 0 of none."""
    if not len(frequencies):
        return 0.0
    return float(frequencies[np.argmax((amplitudes**2).sum(axis=1))])
