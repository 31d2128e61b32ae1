"""Modes that a scene drives: its lines on the dispersion curves of its body.

A line of the load moves the surface, beyond the focal spot, by the sum of all modes at its
frequency; the driven one is the largest of them at the edge of the spot's main lobe, for a focus at
rest, of those that carry energy if there are any. On a path each place of the focus is such a
source.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import asin, degrees, isfinite

import numpy as np

from meshes.tetmesh import Floats
from simple_model import MovingPressure
from simple_model.layers.dispersion import DispersionCurves, Mode
from simple_model.load.focus import lobe_width, spot_width
from simple_model.load.line_names import LineNames, line_names
from skinwave.bodies.analytic import dispersion
from skinwave.scene.scene import Scene

LOWEST, HIGHEST = 10.0, 650.0  # Hz
SPACING = 48  # frequencies between these, beside those of the lines
MODES = 6
WEAKEST, MOST_LINES = 1e-2, 12  # of the strongest line of the load; how many lines


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivenLine:
    """A line of a load and the mode that it drives most.

    Parameters
    ----------
    name : of the line
    frequency : Hz
    strength : Pa, its largest amplitude on the path
    mode : Mode, with the frequency as number `at` of its own
    at : int
    amplitude : metre, of its motion at the edge of the focal spot, of a focus at rest
    share : of that of all modes together
    focus_speed : m/s, of the focus
    """

    name: str
    frequency: float
    strength: float
    mode: Mode
    at: int
    amplitude: float
    share: float
    focus_speed: float

    @property
    def phase_speed(self) -> float:
        """Phase speed of the mode, m/s."""
        return float(self.mode.phase_speed[self.at])

    @property
    def group_speed(self) -> float:
        """Group speed of the mode, m/s."""
        return float(self.mode.group_speed[self.at])

    @property
    def wavelength(self) -> float:
        """Wavelength of the mode, metre."""
        return self.phase_speed / self.frequency

    @property
    def decay_length(self) -> float:
        """1/e length of the mode, metre."""
        return float(self.mode.decay_length[self.at])

    @property
    def kind(self) -> str:
        """Kind of the mode at this frequency, one of `simple_model.layers.dispersion.KINDS`."""
        return str(self.mode.kinds[self.at])

    @property
    def mach_angle(self) -> float | None:
        """Half angle in degrees of the cone that a focus on a straight path draws behind it, sin a
        = c / v; None of a slower focus or without a wave.
        """
        if not self.mode.is_wave[self.at] or self.focus_speed <= self.phase_speed:
            return None
        return degrees(asin(self.phase_speed / self.focus_speed))


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivenModes:
    """Dispersion curves of a scene's body, and the lines of its load, the strongest first."""

    scene: Scene
    curves: DispersionCurves
    lines: tuple[DrivenLine, ...]

    @property
    def cut_on(self) -> float:
        """Frequency in Hz below which no mode carries energy, as far as curves are computed."""
        return min(mode.cut_on for mode in self.curves.modes)


def driven_modes(
    scene: Scene, *, highest: float = HIGHEST, spacing: int = SPACING, most: int = MODES
) -> DrivenModes:
    """Dispersion curves of a scene's body with the lines of its load.

    Parameters
    ----------
    scene : Scene
    highest : Hz, up to which curves are computed
    spacing : how many frequencies, beside those of the lines
    most : how many modes

    Returns
    -------
    DrivenModes

    Raises
    ------
    ValueError
        If the body has no dispersion curves, or `highest` is not above 20 Hz and finite.
    """
    if not (isfinite(highest) and highest > 2 * LOWEST):
        raise ValueError(
            f"highest = {highest:g} Hz of dispersion curves must be above {2 * LOWEST:g} Hz and "
            f"finite; {HIGHEST:g} Hz covers what skin perceives"
        )
    found = line_names(scene.pressure, WEAKEST, most=MOST_LINES)
    within = (found.frequencies > LOWEST) & (found.frequencies < highest)
    f = _frequencies(found.frequencies[within], np.linspace(LOWEST, highest, spacing))
    curves = dispersion(scene.body, f, most)
    return DrivenModes(scene=scene, curves=curves, lines=_driven(scene, curves, found))


def _frequencies(lines: Floats, others: Floats) -> Floats:
    """All frequencies in Hz, but for those right beside a line, ascending."""
    near = np.abs(others[:, None] - lines).min(axis=1, initial=np.inf) < 0.2
    return np.unique(np.concatenate([lines, others[~near]]))


def _driven(scene: Scene, curves: DispersionCurves, lines: LineNames) -> tuple[DrivenLine, ...]:
    pressure = scene.pressure
    amplitudes = amplitudes_of(curves.modes, pressure)
    found = []
    for k in np.argsort(-lines.strengths, kind="stable").tolist():
        at = int(np.argmin(np.abs(curves.frequencies - lines.frequencies[k])))
        if curves.frequencies[at] != lines.frequencies[k]:
            continue  # beyond the band
        size = np.nan_to_num(np.abs(amplitudes[:, at]))
        waves = np.array([mode.is_wave[at] for mode in curves.modes])
        best = int(np.argmax(size + waves * size.sum()))  # a wave first, if there is any
        strength = float(lines.strengths[k])
        found.append(DrivenLine(
            name=lines.names[k], frequency=float(lines.frequencies[k]), strength=strength,
            mode=curves.modes[best], at=at, amplitude=strength * float(size[best]),
            share=float(size[best] / max(size.sum(), 1e-300)),
            focus_speed=pressure.tacton.trajectory.speed if is_moving(pressure) else 0.0,
        ))  # fmt: skip
    return tuple(found)


def amplitudes_of(modes: Sequence[Mode], pressure: MovingPressure) -> np.ndarray:
    """Motion (m, f) in m/Pa of each mode at the edge of the main lobe of a focus at rest; 0 of one
    that falls so fast that there the spot itself moves the surface more than what it radiates.
    """
    width, edge = spot_width(pressure.height), lobe_width(pressure.height)
    radiated = [np.abs(mode.wavenumbers.imag) * width**2 < edge for mode in modes]
    return np.where(radiated, [mode.amplitude(width, edge) for mode in modes], 0.0)


def is_moving(pressure: MovingPressure) -> bool:
    """Whether the focus runs along a path at a speed of its own."""
    path = pressure.tacton.trajectory
    return not path.is_static and path.speed > 0
