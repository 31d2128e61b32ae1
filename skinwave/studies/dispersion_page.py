"""Dispersion curves of a scene's body, as a page, figures and tables."""

from collections.abc import Callable, Iterator
from math import isfinite
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from simple_model.numbers import significant
from skinwave.bodies import FLAT
from skinwave.report.dispersion import dispersion_figure
from skinwave.report.figures import REPORT, png
from skinwave.report.styles import Style
from skinwave.scene.file import dumps
from skinwave.scene.scene import Scene
from skinwave.studies.driven_modes import LOWEST, DrivenLine, DrivenModes, amplitudes_of
from skinwave.system.document import Part, Picture, Report, Section, preformatted
from skinwave.system.table import Column, Table

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
    "at the edge of the focal spot's main lobe, for a focus at rest: by the residue of its pole "
    "times the transform of the spot at its wavenumber. Its share is of the sum of all modes' "
    "magnitudes there. Where the focus is faster than a wave, waves pile up behind it at the Mach "
    "angle, sin a = c/v, on a straight path; on one as small as a wavelength no such cone forms."
)


def sentences(found: DrivenModes) -> list[str]:
    """Sentences on the driven mode, the speed of the focus beside it, and the cut-off."""
    said = [_driven(found.lines[0]), *_focus(found.lines[0])] if found.lines else [
        "A constant pressure on a focus at rest has no line, and drives no wave."
    ]  # fmt: skip
    return [*said, _cut_on(found)]


def _driven(line: DrivenLine) -> str:
    start = f"The strongest line, {line.name} at {line.frequency:.0f} Hz, drives "
    away = f"falls to 1/e in {significant(1e3 * line.decay_length)} mm"
    if not line.mode.is_wave[line.at]:
        return f"{start}no propagating wave: evanescent motion, {line.mode.name}, {away}."
    wave = f"the {line.mode.name}" if " " in line.mode.name.strip("0123456789 ") else line.mode.name
    return (
        f"{start}most of all {wave} ({line.kind}): its phase speed is "
        f"{significant(line.phase_speed)} m/s, its wavelength "
        f"{significant(1e3 * line.wavelength)} mm, and it {away}."
    )


def _focus(line: DrivenLine) -> list[str]:
    if not line.focus_speed or not line.mode.is_wave[line.at]:
        return []
    ratio = line.focus_speed / line.phase_speed
    said = f"The focus, at {significant(line.focus_speed)} m/s, is "
    if line.mach_angle is None:
        return [f"{said}slower than it, by a factor of {significant(ratio)}."]
    angle = f"a Mach angle of {line.mach_angle:.0f} degrees on a straight path"
    return [f"{said}{significant(ratio)} times as fast: {angle}."]


def _cut_on(found: DrivenModes) -> str:
    if not isfinite(found.cut_on):
        return f"Up to {found.curves.frequencies[-1]:.0f} Hz no wave propagates."
    if found.cut_on <= LOWEST:
        return f"Waves propagate at all frequencies from {LOWEST:g} Hz."
    return f"Below {found.cut_on:.0f} Hz no wave propagates."


def taken_as(scene: Scene) -> list[str]:
    """Sentences on what the curves leave out of the scene's body."""
    body, said = scene.body, []
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


def write(folder: Path, found: DrivenModes) -> None:
    """index.html, dispersion.png, dispersion.csv, driven-lines.csv and dispersion.npz."""
    table = Table(MODE_COLUMNS, _mode_rows(found))
    (folder / "dispersion.csv").write_bytes(table.to_csv())
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
    parts = [*page_parts(found), Section("The scene", [preformatted(dumps(found.scene))])]
    title = f"{found.scene.name}: waves that its body guides"
    Report(title, [" ".join(sentences(found)), *taken_as(found.scene)], parts).write(folder)


def _picture(name: str, figure: Figure, caption: str) -> Picture:
    return Picture(png(figure), caption, name)


def page_parts(
    found: DrivenModes,
    picture: Callable[[str, Figure, str], Picture] = _picture,
    style: Style = REPORT,
) -> list[Part]:
    """Figure and table of the lines, for a page of their own or a part of another."""
    lines = {line.name: line.frequency for line in found.lines}
    speed = found.lines[0].focus_speed if found.lines else 0.0
    at = found.lines[0].frequency if found.lines else float(np.median(found.curves.frequencies))
    figure = dispersion_figure(found.curves, lines, speed, at, style)
    shown = picture("dispersion", figure, CAPTION)
    if not found.lines:
        return [shown]
    return [shown, Table(LINE_COLUMNS, map(_line_row, found.lines), "driven-lines"), EXPLAINED]


def _mode_rows(found: DrivenModes) -> Iterator[list[object]]:
    amplitudes = 1e6 * np.abs(amplitudes_of(found.curves.modes, found.scene.pressure))
    for mode, motion in zip(found.curves.modes, amplitudes, strict=True):
        for n in np.flatnonzero(mode.kinds != ""):
            k = mode.wavenumbers[n]
            yield [
                mode.name, str(mode.kinds[n]), mode.frequencies[n], k.real, k.imag,
                mode.phase_speed[n], mode.group_speed[n], 1e3 * mode.decay_length[n], motion[n],
            ]  # fmt: skip


def _line_row(line: DrivenLine) -> list[object]:
    return [
        line.name, line.frequency, line.strength, line.mode.name, line.kind, line.share,
        line.phase_speed, line.group_speed if line.mode.is_wave[line.at] else None,
        1e3 * line.wavelength, 1e3 * line.decay_length,
        line.focus_speed / line.phase_speed if line.focus_speed else None, line.mach_angle,
    ]  # fmt: skip
