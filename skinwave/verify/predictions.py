"""Predictions of published quantities by presets for skin."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from math import inf
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

import fem
from simple_model import MovingPressure, Tacton, Trajectory, threshold
from simple_model.layers.flat_body import steady_state
from simple_model.layers.wavenumber_integral import point_response
from simple_model.load.focus import NOMINAL_HEIGHT, lobe_width, spot_width
from skinwave.bodies import BODIES as PRESETS
from skinwave.bodies import Body
from skinwave.bodies.analytic import compliance, dispersion
from skinwave.bodies.build import build, operators
from skinwave.models.meshed import surface_load, surface_motion
from skinwave.system.effort import Progress
from skinwave.typing import Array, Complex, Floats, Ints
from skinwave.verify.published import SPEED, Observable

# Half-spaces of one material, and layers on bone.
BODIES: Mapping[str, Body] = {
    **{name: Body(kind="slab", material=name, depth=inf)
       for name in ("forearm", "palm", "palm-stiff")},
    **{name: PRESETS[name] for name in ("skin-slab", "palm-layers", "forearm-layers")},
}  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Frequencies in Hz, fine enough to track modes, and speeds in m/s of a focus on circles.

    The circles have two perimeters in m, to separate effects of speed and of frequency.
    """

    frequencies: Floats = field(default_factory=lambda: np.arange(10.0, 701.0, 10.0))
    speeds: Floats = field(default_factory=lambda: np.arange(1.0, 16.1, 0.5))
    perimeters: tuple[float, ...] = (0.100, 0.060)


USUAL = Samples()


@dataclass(frozen=True, kw_only=True, eq=False)
class Curves:
    """Mode, phase speed in m/s and 1/e length in m over frequency in Hz; nan without a wave."""

    frequencies: Floats
    mode: Ints
    speed: Floats
    length: Floats

    def at(self, quantity: Observable, frequencies: ArrayLike) -> Floats:
        """Interpolate speeds or 1/e lengths (n,); nan out of range and without a wave."""
        f = np.asarray(frequencies)
        values = self.speed if quantity is SPEED else self.length
        values = np.interp(f, self.frequencies, values, left=np.nan, right=np.nan)
        # The Kelvin-Voigt law has no loss at rest.
        return np.where((f == 0) & (quantity is not SPEED) & np.isfinite(values), inf, values)


def leading_wave(body: Body, frequencies: Floats = USUAL.frequencies) -> Curves:
    """Return the wave that moves the surface of a body most at the edge of the main lobe.

    It is at ascending frequencies (f,) in Hz, and at rest if the body is a half-space.
    """
    slowest = 1e-3  # Hz, in place of 0, for the static speed of a half-space
    f = np.array([*[slowest] * (body.depth == inf), *frequencies])
    modes = dispersion(body, f, 6).modes
    edge, width = lobe_width(NOMINAL_HEIGHT), spot_width(NOMINAL_HEIGHT)
    with np.errstate(invalid="ignore"):
        amplitudes = np.abs([mode.amplitude(width, edge) for mode in modes])
    amplitudes[~np.array([mode.is_wave for mode in modes]) | ~np.isfinite(amplitudes)] = 0.0
    if len(modes) == 1:  # the Rayleigh wave leads however strongly it decays
        amplitudes[:] = 1.0
    first, propagates = np.argmax(amplitudes, axis=0), amplitudes.max(axis=0) > 0
    speed, length = (
        np.where(propagates, np.array(values)[first, np.arange(len(f))], np.nan)
        for values in ([m.phase_speed for m in modes], [m.decay_length for m in modes])
    )
    f = np.where(f == slowest, 0.0, f)
    return Curves(frequencies=f, mode=first, speed=speed, length=length)


def decay_exponents(body: Body, frequencies: ArrayLike) -> Floats:
    """Return exponents n (f,) of distance^-n fitted to the motion 10 to 40 mm from a focus."""
    r, w = np.geomspace(0.010, 0.040, 12), 2 * np.pi * np.asarray(frequencies)
    motion = point_response(compliance(body), r, w, spot_width(NOMINAL_HEIGHT))
    return -np.polyfit(np.log(r), np.log(np.abs(motion)).T, 1)[0]


def disc_compliance(body: Body, area: float, frequencies: ArrayLike, blur: float = 0.1) -> Complex:
    """Return the mean displacement per force (f,) in m/N of a disc that presses uniformly.

    The area is in m2, frequencies (f,) are in Hz. The edge of the disc is `blur` times its radius
    wide, which lowers the mean by 1.3 %.

    It is the mean of the response at a distance s over all pairs of points of the disc. With
    x = s / 2a, s has the density (8 x / pi a) (arccos x - x sqrt(1 - x^2)).
    """
    radius = np.sqrt(area / np.pi)
    nodes, weights = np.polynomial.legendre.leggauss(32)
    x = (nodes + 1) / 2
    density = 8 * x / np.pi * (np.arccos(x) - x * np.sqrt(1 - x**2))  # of s/a
    w, width = 2 * np.pi * np.asarray(frequencies), blur * radius
    response = point_response(compliance(body), 2 * radius * x, w, width)
    return response @ (weights * density) / (2 * np.pi * width**2)


def threshold_force(
    body: Body, area: float, frequencies: ArrayLike, contactor: float = 2.9e-4
) -> Floats:
    """Return the force (f,) in N, on and off as a square wave, that is just felt through a disc.

    The threshold is known for a `contactor` in m2, and rises by 3 dB for each halving of the area.
    """
    f = np.asarray(frequencies)
    felt = threshold(f, "large_contactor") * np.sqrt(contactor / area)
    return np.pi / 2 * felt / np.abs(disc_compliance(body, area, f))


@cache
def least_impedance(body: Body, area: float, samples: Samples = USUAL) -> float:
    """Return the frequency in Hz at which a force on a disc moves the surface fastest."""
    f = samples.frequencies[1::2]
    return peak(f, f * np.abs(disc_compliance(body, area, f)))


def deflections(
    body: Body, perimeter: float, speeds: Floats = USUAL.speeds, samples: int = 256
) -> tuple[Floats, Floats]:
    """Return steady deflections (v,) in m/Pa on a circle with a perimeter in m.

    Return for each speed of the focus the largest deflection and the deflection from peak to peak,
    which a vibrometer measures. Both are of so many samples in a turn.
    """
    waves, probe = compliance(body), [[perimeter / (2 * np.pi), 0.0]]
    courses = []
    for speed in speeds:
        circle = Trajectory(shape="circle", size=perimeter / np.pi, speed=speed)
        pressure = MovingPressure(tacton=Tacton(trajectory=circle), peak_pressure=1.0)
        times = np.arange(samples) / circle.drawing_frequency / samples
        courses.append(steady_state(waves, pressure, probe, times).values[:, 0])
    return np.max(courses, axis=1), np.ptp(courses, axis=1)


def peak(x: Array, y: Array) -> float:
    """Return the peak of a parabola through the highest point; nan at an end."""
    k = int(np.argmax(y))
    if not 0 < k < len(x) - 1:
        return float("nan")
    before, here, after = y[k - 1 : k + 2]
    step = (x[k + 1] - x[k - 1]) / 2
    return float(x[k] + step * (before - after) / (before - 2 * here + after) / 2)


def along_finger(
    file: Path, progress: Progress, frequencies: Sequence[float], up: str = "-x", h: float = 6.5e-3
) -> Floats:
    """Return 1/e lengths (f,) in m on the palmar side of the longest finger, at (f,) Hz.

    They are computed with finite elements of size `h` in m. Sizes of 5 and 8 mm change them by up
    to 8 %. The palm in
    the `file` faces `up`. Raises a ValueError if the file is missing or contains no body.
    """
    if not file.is_file():
        raise ValueError(f"--hand {file} does not exist; give the mesh file of a hand")
    progress("mesh the hand", 0.0)
    body = Body(kind="mesh", file=str(file), up=up)
    made = build(body, h)
    # The tip is the point farthest from the middle; the wrist is on the side with most points.
    top = made.mesh.points[np.unique(made.mesh.facets["top"])][:, :2]
    along = top @ np.linalg.svd(top - top.mean(axis=0), full_matrices=False)[2][0]
    tip = top[np.argmax(along if along.max() > -along.min() else -along)]
    inwards = -tip / np.linalg.norm(tip)
    places = np.arange(0.020, 0.171, 0.010)  # m from the tip
    distances = places[np.linalg.norm(tip) + 0.04 > places]
    progress("assemble", 0.1)
    matrices, (P, points) = operators(made), surface_load(made)
    focus_distance = 0.010  # m from the tip
    place = points - [*(tip + focus_distance * inwards), 0.0]
    load = P @ MovingPressure(tacton=Tacton(), peak_pressure=1.0)(place, 0.0)
    S = surface_motion(body, made, tip + distances[:, None] * inwards)
    amplitudes = []
    for k, f in enumerate(frequencies):
        progress(f"solve {f:g} Hz", 0.2 + 0.8 * k / len(frequencies))
        amplitudes.append(np.abs(S @ fem.harmonic(matrices, load, [f])[0]))
    slopes = np.polyfit(distances, np.log(amplitudes).T, 1)[0]
    return -1 / slopes
