"""Waves that a scene's body guides, and the modes that the lines of its load drive.

A line of the load moves the surface, beyond the focal spot, by the sum of all modes at its
frequency. The driven mode is, of those that propagate if any does, the one that moves the surface
most at the edge of the focal spot's main lobe, for a focus at rest: by the residue of its pole
times the transform of the spot at its wavenumber. On a path each place of the focus is such a
source.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import asin, degrees, isfinite
from pathlib import Path

import numpy as np

from simple_model import MovingPressure
from simple_model.layers.dispersion import DispersionCurves, Mode
from simple_model.load.focus import lobe_width, spot_width
from simple_model.load.line_names import line_names
from simple_model.numbers import significant
from skinwave.bodies import FLAT
from skinwave.bodies.analytic import dispersion
from skinwave.report.dispersion import dispersion_figure
from skinwave.scene.file import dumps
from skinwave.scene.scene import Scene
from skinwave.studies.pages import Gallery
from skinwave.system.document import Details, Part, Report, preformatted
from skinwave.system.table import Column, Table

LOWEST, HIGHEST = 10.0, 650.0  # Hz
SPACING = 48  # frequencies between these, beside those of the lines
MODES = 6
WEAKEST, MOST_LINES = 1e-2, 12  # of the strongest line of the load; how many lines
BESIDE = 0.2  # Hz: nearer to a line than this no other frequency is computed
MODE_COLUMNS = (
    "mode", "kind", "frequency_hz", "re_k_rad_per_m", "im_k_rad_per_m", "phase_speed_m_per_s",
    "group_speed_m_per_s", "decay_length_mm", "motion_beside_focus_um_per_pa",
)  # fmt: skip
LINE_COLUMNS = (
    "line", Column("frequency_hz", "frequency", "Hz", 4), Column("pressure_pa", "pressure", "Pa"),
    Column("mode", "drives most"), "kind", Column("share", digits=2),
    Column("phase_speed_m_per_s", "phase speed", "m/s"),
    Column("group_speed_m_per_s", "group speed", "m/s"),
    Column("wavelength_mm", "wavelength", "mm"), Column("decay_length_mm", "1/e length", "mm"),
    Column("focus_over_phase_speed", "focus over phase speed"),
    Column("mach_angle_deg", "Mach angle", "degrees", 2),
)  # fmt: skip
CAPTION = (
    "Modes of the laterally infinite body: a strong line where energy propagates, a pale one where "
    "the mode is evanescent: it falls to 1/e within a quarter of its wavelength, or its energy "
    "moves at less than a twentieth of its phase speed. Dotted: the lines of the load; dashed: the "
    "speed of the focus. The group speed is left out where loss changes a packet's shape before it "
    "moves on (imaginary part of dk/dω above the real part)."
)
EXPLAINED = (
    "The driven mode is, of those that propagate if any does, the one that moves the surface most "
    "at the edge of the focal spot's main lobe. Its share is of the sum of all modes' magnitudes "
    "there. Where the focus is faster than a wave, waves pile up behind it at the Mach angle, "
    "sin a = c/v, on a straight path; on one as small as a wavelength no such cone forms."
)


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivenLine:
    """A line of a load, with its frequency in Hz and its `strength` in Pa, the largest amplitude on
    the path; the `mode` that it drives most, whose frequency it is as number `at`, and the `share`
    of that in the motion by all modes.
    """

    name: str
    frequency: float
    strength: float
    mode: Mode
    at: int
    share: float
    focus_speed: float

    @property
    def phase_speed(self) -> float:
        """Phase speed of the mode, m/s."""
        return float(self.mode.phase_speed[self.at])

    @property
    def decay_length(self) -> float:
        """1/e length of the mode, metre."""
        return float(self.mode.decay_length[self.at])

    @property
    def kind(self) -> str:
        """Kind of the mode at this frequency, one of `simple_model.layers.dispersion.KINDS`."""
        return str(self.mode.kinds[self.at])

    @property
    def is_wave(self) -> bool:
        """Whether the mode carries energy."""
        return bool(self.mode.is_wave[self.at])

    @property
    def mach_angle(self) -> float | None:
        """Half angle in degrees of the cone that a focus on a straight path draws behind it, sin a
        = c / v; None of a slower focus or without a wave.
        """
        if not self.is_wave or self.focus_speed <= self.phase_speed:
            return None
        return degrees(asin(self.phase_speed / self.focus_speed))

    @property
    def row(self) -> list[object]:
        """The cells of `LINE_COLUMNS`."""
        return [
            self.name, self.frequency, self.strength, self.mode.name,
            self.kind, self.share, self.phase_speed,
            float(self.mode.group_speed[self.at]) if self.is_wave else None,
            1e3 * self.phase_speed / self.frequency, 1e3 * self.decay_length,
            self.focus_speed / self.phase_speed if self.focus_speed else None, self.mach_angle,
        ]  # fmt: skip


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
    """Curves of so many modes of a scene's body up to the `highest` frequency in Hz, at so many
    frequencies beside those of the lines of its load. A ValueError if the body has no such curves,
    or `highest` is not above 20 Hz and finite.
    """
    if not (isfinite(highest) and highest > 2 * LOWEST):
        raise ValueError(
            f"highest = {highest:g} Hz of dispersion curves must be above {2 * LOWEST:g} Hz and "
            f"finite; {HIGHEST:g} Hz covers what skin perceives"
        )
    found = line_names(scene.pressure, WEAKEST, most=MOST_LINES)
    within = (found.frequencies > LOWEST) & (found.frequencies < highest)
    own, others = found.frequencies[within], np.linspace(LOWEST, highest, spacing)
    near = np.abs(others[:, None] - own).min(axis=1, initial=np.inf) < BESIDE
    curves = dispersion(scene.body, np.unique(np.concatenate([own, others[~near]])), most)
    amplitudes, path = _amplitudes(curves.modes, scene.pressure), scene.tacton.trajectory
    lines = []
    for k in np.argsort(-found.strengths, kind="stable").tolist():
        if not within[k]:
            continue
        at = int(np.argmin(np.abs(curves.frequencies - found.frequencies[k])))
        size = np.nan_to_num(np.abs(amplitudes[:, at]))
        waves = np.array([mode.is_wave[at] for mode in curves.modes])
        best = int(np.argmax(size + waves * size.sum()))  # a wave first, if there is any
        lines.append(DrivenLine(
            name=found.names[k], frequency=float(found.frequencies[k]),
            strength=float(found.strengths[k]), mode=curves.modes[best], at=at,
            share=float(size[best] / max(size.sum(), 1e-300)),
            focus_speed=0.0 if path.is_static else path.speed,
        ))  # fmt: skip
    return DrivenModes(scene=scene, curves=curves, lines=tuple(lines))


def _amplitudes(modes: Sequence[Mode], pressure: MovingPressure) -> np.ndarray:
    """Motion (m, f) in m/Pa of each mode at the edge of the main lobe of a focus at rest; 0 of one
    that falls so fast that there the spot itself moves the surface more than what it radiates.
    """
    width, edge = spot_width(pressure.height), lobe_width(pressure.height)
    radiated = [np.abs(mode.wavenumbers.imag) * width**2 < edge for mode in modes]
    return np.where(radiated, [mode.amplitude(width, edge) for mode in modes], 0.0)


def sentences(found: DrivenModes) -> list[str]:
    """The driven mode, the speed of the focus beside it, the cut-off, and what the curves leave out
    of the body.
    """
    said = [_driven(found.lines[0])] if found.lines else [
        "A constant pressure on a focus at rest has no line, and drives no wave."
    ]  # fmt: skip
    if not isfinite(found.cut_on):
        said.append(f"Up to {found.curves.frequencies[-1]:.0f} Hz no wave propagates.")
    elif found.cut_on <= LOWEST:
        said.append(f"Waves propagate at all frequencies from {LOWEST:g} Hz.")
    else:
        said.append(f"Below {found.cut_on:.0f} Hz no wave propagates.")
    body = found.scene.body
    if not (body.of_kind.is_layer or body.of_kind.is_plate):
        said.append(
            f"The curves are of a flat, laterally infinite slab as deep as the middle of the "
            f"{body.kind}, {1e3 * body.depth:g} mm."
        )
    if body.base == "absorbing" and not body.of_kind.is_plate and isfinite(body.depth):
        said.append("Its absorbing base is taken as a half-space of the lowest material.")
    if body.placement != FLAT:
        said.append("The curves are of the body itself, however it is placed under the device.")
    return said


def _driven(line: DrivenLine) -> str:
    start = f"The strongest line, {line.name} at {line.frequency:.0f} Hz, drives "
    away = f"falls to 1/e in {significant(1e3 * line.decay_length)} mm"
    if not line.is_wave:
        return f"{start}no propagating wave: evanescent motion, {line.mode.name}, {away}."
    wave = f"the {line.mode.name}" if " " in line.mode.name.strip("0123456789 ") else line.mode.name
    said = (
        f"{start}most of all {wave} ({line.kind}): its phase speed is "
        f"{significant(line.phase_speed)} m/s, its wavelength "
        f"{significant(1e3 * line.phase_speed / line.frequency)} mm, and it {away}."
    )
    if not line.focus_speed:
        return said
    ratio = significant(line.focus_speed / line.phase_speed)
    said += f" The focus, at {significant(line.focus_speed)} m/s, is {ratio} times as fast"
    if line.mach_angle is None:
        return f"{said}."
    return f"{said}: a Mach angle of {line.mach_angle:.0f}° on a straight path."


def page_parts(found: DrivenModes, gallery: Gallery) -> list[Part]:
    """Sentences, figure and table of the lines, for a page of their own or a part of another."""
    lines = {line.name: line.frequency for line in found.lines}
    speed = found.lines[0].focus_speed if found.lines else 0.0
    at = found.lines[0].frequency if found.lines else float(np.median(found.curves.frequencies))
    figure = dispersion_figure(found.curves, lines, speed, at, gallery.style)
    shown: list[Part] = [" ".join(sentences(found)), gallery.figure("dispersion", figure, CAPTION)]
    if not found.lines:
        return shown
    rows = [line.row for line in found.lines]
    return [*shown, Table(LINE_COLUMNS, rows, "driven-lines"), EXPLAINED]


def write(folder: Path, found: DrivenModes) -> None:
    """index.html, dispersion.png, dispersion.csv, driven-lines.csv and dispersion.npz."""
    (folder / "dispersion.csv").write_bytes(Table(MODE_COLUMNS, _mode_rows(found)).to_csv())
    modes = found.curves.modes
    np.savez(
        folder / "dispersion.npz", frequency_hz=found.curves.frequencies,
        depth_m=found.curves.depths, mode=np.array([mode.name for mode in modes]),
        kind=np.array([mode.kinds for mode in modes]),
        wavenumber_per_m=np.array([mode.wavenumbers for mode in modes]),
        slowness_s_per_m=np.array([mode.slowness for mode in modes]),
        residue_per_pa_m=np.array([mode.residues for mode in modes]),
        shape=np.array([mode.shapes for mode in modes]),
    )  # fmt: skip
    verdict, *parts = page_parts(found, Gallery())
    parts.append(Details("The scene", [preformatted(dumps(found.scene))]))
    Report(f"{found.scene.name}: waves that its body guides", [str(verdict)], parts).write(folder)


def _mode_rows(found: DrivenModes) -> Iterator[list[object]]:
    amplitudes = 1e6 * np.abs(_amplitudes(found.curves.modes, found.scene.pressure))
    for mode, motion in zip(found.curves.modes, amplitudes, strict=True):
        for n in np.flatnonzero(mode.kinds != ""):
            k = mode.wavenumbers[n]
            yield [
                mode.name, str(mode.kinds[n]), mode.frequencies[n], k.real, k.imag,
                mode.phase_speed[n], mode.group_speed[n], 1e3 * mode.decay_length[n], motion[n],
            ]  # fmt: skip
