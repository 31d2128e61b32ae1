"""Predictions of published quantities, by presets that stand for skin: a function for each."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

import fem
from simple_model import MovingPressure, Tacton, Trajectory
from simple_model.layers.dispersion import Mode
from simple_model.layers.flat_body import steady_state
from simple_model.layers.wavenumber_integral import point_response
from simple_model.load.focus import NOMINAL_HEIGHT, lobe_width, spot_width
from skinwave.bodies import BODIES as PRESETS
from skinwave.bodies import Body
from skinwave.bodies.analytic import compliance, dispersion
from skinwave.bodies.build import build, operators
from skinwave.models.meshed import surface_load, surface_motion
from skinwave.system.effort import Progress
from skinwave.typing import Floats, Ints
from skinwave.verify.published import SPEED, Quantity

# Half-spaces of one material, and slabs on bone; skin-slab is the default scene's, of 15 mm.
BODIES: Mapping[str, Body] = {
    **{name: Body(kind="slab", material=name, depth=inf)
       for name in ("forearm", "palm", "palm-stiff")},
    **{name: PRESETS[name] for name in ("skin-slab", "palm-layers", "forearm-layers")},
}  # fmt: skip
GRID = np.arange(10.0, 701.0, 10.0)  # Hz: fine enough for modes to be tracked
AT_REST = 1e-3  # Hz, in place of 0, where a half-space without loss has its static speed
FITTED = (0.010, 0.040)  # m, between which an exponent is fitted


@dataclass(frozen=True, kw_only=True, eq=False)
class Curves:
    """Leading wave of a body at frequencies (f,) in Hz: number of its mode, phase speed in m/s and
    1/e length in m, nan where no wave propagates.
    """

    frequencies: Floats
    mode: Ints
    speed: Floats
    length: Floats

    def at(self, quantity: Quantity, frequencies: ArrayLike) -> Floats:
        """Values (n,) of speed or 1/e length; nan beyond the frequencies and without a wave."""
        f = np.asarray(frequencies)
        values = self.speed if quantity is SPEED else self.length
        found = np.interp(f, self.frequencies, values, left=np.nan, right=np.nan)
        # Kelvin-Voigt's law has no loss at rest.
        return np.where((f == 0) & (quantity is not SPEED) & np.isfinite(found), inf, found)


def leading_wave(body: Body, grid: ArrayLike | None = None) -> Curves:
    """Wave of a slab or half-space that moves the surface most at the edge of the focal spot's main
    lobe, at ascending frequencies (f,) in Hz, `GRID` if None, and at rest: a layer on bone has none
    there.
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


def decay_exponents(body: Body, frequencies: ArrayLike) -> Floats:
    """Exponents n (f,) of the power law distance^-n fitted to the motion about a focus at rest."""
    r, w = np.geomspace(*FITTED, 12), 2 * np.pi * np.asarray(frequencies)
    moved = point_response(compliance(body), r, w, spot_width(NOMINAL_HEIGHT))
    return -np.polyfit(np.log(r), np.log(np.abs(moved)).T, 1)[0]


SPEEDS = np.arange(1.0, 16.1, 0.5)  # m/s, of a focus on a circle
PERIMETERS = (0.100, 0.060)  # m: whether it is a speed or a frequency that matters
SAMPLES = 256  # of a turn


def focus_speeds(body: Body, perimeter: float) -> tuple[Floats, Floats]:
    """Steady deflection (v,) in m/Pa of a circle of a perimeter in m, at each of `SPEEDS` of the
    focus on it: the largest, and peak to peak, which is all that a vibrometer sees.
    """
    waves, probe = compliance(body), [[perimeter / (2 * np.pi), 0.0]]
    found = []
    for speed in SPEEDS:
        circle = Trajectory(shape="circle", size=perimeter / np.pi, speed=speed)
        pressure = MovingPressure(tacton=Tacton(trajectory=circle), peak_pressure=1.0)
        times = np.arange(SAMPLES) / circle.drawing_frequency / SAMPLES
        found.append(steady_state(waves, pressure, probe, times).values[:, 0])
    moved = np.array(found)
    return moved.max(axis=1), np.ptp(moved, axis=1)


def top(x: Floats, y: Floats) -> float:
    """Top of the parabola through the highest point and its neighbours; nan at an end."""
    k = int(np.argmax(y))
    if not 0 < k < len(x) - 1:
        return float("nan")
    before, here, after = y[k - 1 : k + 2]
    step = (x[k + 1] - x[k - 1]) / 2
    return float(x[k] + step * (before - after) / (before - 2 * here + after) / 2)


HAND_UP = "-x"  # of a hand's file, its palm
HAND_SIZE = 6.5e-3  # m, of elements: 5 and 8 mm change the 1/e lengths by up to 8 %
HAND_FREQUENCIES = (200.0, 300.0, 400.0)  # Hz
LOADED = 0.010  # m from the tip, where the focus is
PLACES = np.arange(0.020, 0.171, 0.010)  # m from the tip


@dataclass(frozen=True, kw_only=True, eq=False)
class Finger:
    """1/e lengths (f,) in m along a finger at frequencies (f,) in Hz, and the dofs of the hand."""

    frequencies: Floats
    lengths: Floats
    dofs: int


def along_finger(
    file: Path, report: Progress, frequencies: tuple[float, ...] = HAND_FREQUENCIES
) -> Finger:
    """Decay on the palmar side of the finger that reaches furthest, by finite elements of a hand in
    a `file`, its palm towards `HAND_UP`. A file that is not there or no body raises a ValueError.
    """
    if not file.is_file():
        raise ValueError(f"--hand {file}: there is no such file; name a file of a hand")
    report("mesh the hand", 0.0)
    body = Body(kind="mesh", file=str(file), up=HAND_UP)
    made = build(body, HAND_SIZE)
    # The tip is the point furthest from the middle; the wrist is on the side with most points.
    seen = made.mesh.points[np.unique(made.mesh.facets["top"])][:, :2]
    along = seen @ np.linalg.svd(seen - seen.mean(axis=0), full_matrices=False)[2][0]
    tip = seen[np.argmax(along if along.max() > -along.min() else -along)]
    inwards = -tip / np.linalg.norm(tip)
    distances = PLACES[np.linalg.norm(tip) + 0.04 > PLACES]
    report("assemble", 0.1)
    matrices, (P, points) = operators(made), surface_load(made)
    place = points - [*(tip + LOADED * inwards), 0.0]
    load = P @ MovingPressure(tacton=Tacton(), peak_pressure=1.0)(place, 0.0)
    S = surface_motion(body, made, tip + distances[:, None] * inwards)
    found = []
    for k, f in enumerate(frequencies):
        report(f"solve {f:g} Hz", 0.2 + 0.8 * k / len(frequencies))
        found.append(np.abs(S @ fem.harmonic(matrices, load, [f])[0]))
    slopes = np.polyfit(distances, np.log(found).T, 1)[0]
    return Finger(frequencies=np.array(frequencies), lengths=-1 / slopes, dofs=len(matrices.free))
