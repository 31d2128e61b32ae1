"""Waves in a scene's body, and the modes that the lines of its load drive.

Outside the focal spot, a line of the load moves the surface by the sum of all modes at its
frequency. The driven mode is the one that moves the surface most at the edge of the main lobe of a
focus at rest: by the residue of its pole times the transform of the spot at its wavenumber.
Propagating modes come first. On a path each place of the focus is such a source.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import degrees, isfinite
from pathlib import Path

import numpy as np

from simple_model import MovingPressure
from simple_model.layers.dispersion import DispersionCurves, Mode
from simple_model.load.focus import lobe_width
from simple_model.load.line_names import line_names
from simple_model.numbers import significant
from skinwave.bodies import FLAT
from skinwave.bodies.analytic import dispersion
from skinwave.report.dispersion import dispersion_figure
from skinwave.results.propagation import mach_angle
from skinwave.scene.file import dumps
from skinwave.scene.scene import Scene
from skinwave.studies.pages import Gallery
from skinwave.system.document import Details, Part, Report, preformat
from skinwave.system.table import Column, Table

LOWEST = 10.0  # Hz


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivenLine:
    """A line of a load, and the mode that it drives, at its frequency in Hz.

    `strength` is the largest amplitude in Pa on the path, `share` that of the mode in the motion.
    `kind` is one of `simple_model.layers.dispersion.KINDS`. Speeds are in m/s; `decay_length` is
    the 1/e length in m. The group speed is None if the mode carries no energy, the Mach angle in
    degrees also if the focus is slower than the wave.
    """

    name: str
    frequency: float
    strength: float
    mode: str
    kind: str
    share: float
    phase_speed: float
    group_speed: float | None
    decay_length: float
    focus_speed: float
    mach_angle: float | None

    @property
    def row(self) -> list[object]:
        """Cells of the table `driven-lines`."""
        return [
            self.name, self.frequency, self.strength, self.mode, self.kind, self.share,
            self.phase_speed, self.group_speed, 1e3 * self.phase_speed / self.frequency,
            1e3 * self.decay_length,
            self.focus_speed / self.phase_speed if self.focus_speed else None, self.mach_angle,
        ]  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivenModes:
    """Dispersion curves of a scene's body, and the lines of its load, the strongest first."""

    scene: Scene
    curves: DispersionCurves
    lines: tuple[DrivenLine, ...]


def driven_modes(
    scene: Scene, *, highest: float = 650.0, spacing: int = 48, most: int = 6
) -> DrivenModes:
    """Return curves of `most` modes of a scene's body up to the `highest` frequency in Hz.

    They have `spacing` frequencies and those of the lines of the load. Raises a ValueError if the
    body has no such curves, or `highest` is 20 Hz or less.
    """
    if not (isfinite(highest) and highest > 2 * LOWEST):
        raise ValueError(
            f"the highest frequency of dispersion curves is {highest:g} Hz; it must be above "
            f"{2 * LOWEST:g} Hz. 650 Hz covers what skin perceives"
        )
    weakest_ratio, most_lines = 1e-2, 12  # to the strongest line of the load
    load = line_names(scene.pressure, weakest_ratio, most=most_lines)
    within = (load.frequencies > LOWEST) & (load.frequencies < highest)
    own, others = load.frequencies[within], np.linspace(LOWEST, highest, spacing)
    same_frequency = 0.2  # Hz: no other frequency is computed this close to a line
    near = np.abs(others[:, None] - own).min(axis=1, initial=np.inf) < same_frequency
    curves = dispersion(scene.body, np.unique(np.concatenate([own, others[~near]])), most)
    amplitudes, path = _amplitudes(curves.modes, scene.pressure), scene.tacton.trajectory
    focus_speed, lines = 0.0 if path.is_static else path.speed, []
    for k in np.argsort(-load.strengths, kind="stable").tolist():
        if not within[k]:
            continue
        at = int(np.argmin(np.abs(curves.frequencies - load.frequencies[k])))
        size = np.nan_to_num(np.abs(amplitudes[:, at]))
        waves = np.array([mode.is_wave[at] for mode in curves.modes])
        best = int(np.argmax(size + waves * size.sum()))  # propagating modes first
        mode, phase_speed = curves.modes[best], float(curves.modes[best].phase_speed[at])
        angle = mach_angle(phase_speed, focus_speed) if waves[best] else None
        lines.append(DrivenLine(
            name=load.names[k], frequency=float(load.frequencies[k]),
            strength=float(load.strengths[k]), mode=mode.name, kind=str(mode.kinds[at]),
            share=float(size[best] / max(size.sum(), 1e-300)), phase_speed=phase_speed,
            group_speed=float(mode.group_speed[at]) if waves[best] else None,
            decay_length=float(mode.decay_length[at]), focus_speed=focus_speed,
            mach_angle=None if angle is None else degrees(angle),
        ))  # fmt: skip
    return DrivenModes(scene=scene, curves=curves, lines=tuple(lines))


def _amplitudes(modes: Sequence[Mode], pressure: MovingPressure) -> np.ndarray:
    """Return the motion (m, f) in m/Pa of each mode at the edge of the main lobe.

    It is 0 for a mode that decays so fast that the spot itself causes more motion there.
    """
    width, edge = pressure.spot_scale, lobe_width(pressure.height)
    radiated = [np.abs(mode.wavenumbers.imag) * width**2 < edge for mode in modes]
    return np.where(radiated, [mode.amplitude(width, edge) for mode in modes], 0.0)


def sentences(driven: DrivenModes) -> list[str]:
    """Return sentences on the driven mode, the cut-off, and what the curves leave out."""
    parts = ["A constant pressure on a focus at rest has no line and drives no wave."]
    if driven.lines:
        parts = [_line_sentence(driven.lines[0])]
    cut_on = min(mode.cut_on for mode in driven.curves.modes)
    if not isfinite(cut_on):
        parts.append(f"No wave propagates up to {driven.curves.frequencies[-1]:.0f} Hz.")
    elif cut_on <= LOWEST:
        parts.append(f"Waves propagate at all frequencies from {LOWEST:g} Hz.")
    else:
        parts.append(f"No wave propagates below {cut_on:.0f} Hz.")
    body = driven.scene.body
    if not (body.of_kind.is_layer or body.of_kind.is_plate):
        parts.append(
            "The curves are those of a flat, laterally infinite slab as deep as the middle of the "
            f"{body.kind}, {1e3 * body.depth:g} mm."
        )
    if body.base == "absorbing" and not body.of_kind.is_plate and isfinite(body.depth):
        parts.append("The absorbing base is replaced by a half-space of the lowest material.")
    if body.placement != FLAT:
        parts.append("The placement of the body under the device is left out.")
    return parts


def _line_sentence(line: DrivenLine) -> str:
    start = f"The strongest line, {line.name} at {line.frequency:.0f} Hz, drives "
    decay = f"decays to 1/e in {significant(1e3 * line.decay_length)} mm"
    if line.group_speed is None:
        return f"{start}no propagating wave; its evanescent motion ({line.mode}) {decay}."
    wave = f"the {line.mode}" if " " in line.mode.strip("0123456789 ") else line.mode
    text = (
        f"{start}mainly {wave} ({line.kind}). Its phase speed is {significant(line.phase_speed)} "
        f"m/s, its wavelength {significant(1e3 * line.phase_speed / line.frequency)} mm, and it "
        f"{decay}."
    )
    if not line.focus_speed:
        return text
    ratio = significant(line.focus_speed / line.phase_speed)
    text += f" The focus moves at {significant(line.focus_speed)} m/s, {ratio} times as fast as it"
    if line.mach_angle is None:
        return f"{text}."
    return f"{text}; the Mach angle on a straight path is {line.mach_angle:.0f}°."


def page_parts(driven: DrivenModes, gallery: Gallery) -> list[Part]:
    """Return sentences, figure and table of the lines as parts of a page."""
    lines, speed = {line.name: line.frequency for line in driven.lines}, 0.0
    at = float(np.median(driven.curves.frequencies))
    if driven.lines:
        speed, at = driven.lines[0].focus_speed, driven.lines[0].frequency
    figure = dispersion_figure(driven.curves, lines, speed, at, gallery.style)
    caption = (
        "Modes of the laterally infinite body. Strong lines: energy propagates. Pale lines: "
        "evanescent mode (1/e length below a quarter of its wavelength, or energy speed below a "
        "twentieth of its phase speed). Dotted: lines of the load; dashed: speed of the focus. "
        "The group speed is left out where loss distorts a wave packet (imaginary part of dk/dω "
        "above the real part)."
    )
    shown: list[Part] = [" ".join(sentences(driven)), gallery.figure("dispersion", figure, caption)]
    if not driven.lines:
        return shown
    columns = (
        "line", Column("frequency_hz", "frequency", "Hz", 4),
        Column("pressure_pa", "pressure", "Pa"), Column("mode", "driven mode"), "kind",
        Column("share", digits=2), Column("phase_speed_m_per_s", "phase speed", "m/s"),
        Column("group_speed_m_per_s", "group speed", "m/s"),
        Column("wavelength_mm", "wavelength", "mm"), Column("decay_length_mm", "1/e length", "mm"),
        Column("focus_over_phase_speed", "focus over phase speed"),
        Column("mach_angle_deg", "Mach angle", "degrees", 2),
    )  # fmt: skip
    explained = (
        "The driven mode of a line moves the surface most at the edge of the main lobe of the "
        "focal spot. Evanescent modes count only if none propagates. Its share is its magnitude "
        "over the sum of all magnitudes there. On a straight path, a focus that is faster than a "
        "wave leaves a wake at the Mach angle asin(c/v). On a path as small as a wavelength, no "
        "such wake forms."
    )
    table = Table(columns, (line.row for line in driven.lines), "driven-lines")
    return [*shown, table, explained]


def write(folder: Path, driven: DrivenModes) -> None:
    """Write index.html, dispersion.png, dispersion.csv, driven-lines.csv and dispersion.npz."""
    mode_columns = (
        "mode", "kind", "frequency_hz", "re_k_rad_per_m", "im_k_rad_per_m", "phase_speed_m_per_s",
        "group_speed_m_per_s", "decay_length_mm", "motion_beside_focus_um_per_pa",
    )  # fmt: skip
    (folder / "dispersion.csv").write_bytes(Table(mode_columns, _mode_rows(driven)).to_csv())
    modes = driven.curves.modes
    np.savez(
        folder / "dispersion.npz", frequency_hz=driven.curves.frequencies,
        depth_m=driven.curves.depths, mode=np.array([mode.name for mode in modes]),
        kind=np.array([mode.kinds for mode in modes]),
        wavenumber_per_m=np.array([mode.wavenumbers for mode in modes]),
        slowness_s_per_m=np.array([mode.slowness for mode in modes]),
        residue_per_pa_m=np.array([mode.residues for mode in modes]),
        shape=np.array([mode.shapes for mode in modes]),
    )  # fmt: skip
    verdict, *parts = page_parts(driven, Gallery())
    parts.append(Details("The scene", [preformat(dumps(driven.scene))]))
    Report(f"{driven.scene.name}: waves that its body guides", [str(verdict)], parts).write(folder)


def _mode_rows(driven: DrivenModes) -> Iterator[list[object]]:
    amplitudes = 1e6 * np.abs(_amplitudes(driven.curves.modes, driven.scene.pressure))
    for mode, motion in zip(driven.curves.modes, amplitudes, strict=True):
        for n in np.flatnonzero(mode.kinds != ""):
            k = mode.wavenumbers[n]
            yield [
                mode.name, str(mode.kinds[n]), mode.frequencies[n], k.real, k.imag,
                mode.phase_speed[n], mode.group_speed[n], 1e3 * mode.decay_length[n], motion[n],
            ]  # fmt: skip
