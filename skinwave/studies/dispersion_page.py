"""Dispersion curves of a scene's body, as a page, figures and tables."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from simple_model.load.focus import spot_width
from skinwave.bodies import FLAT
from skinwave.bodies.analytic import dispersion
from skinwave.planning.simulate import compute
from skinwave.report.dispersion import dispersion_figure, wavenumber_figure
from skinwave.report.figures import REPORT, png
from skinwave.report.styles import Style
from skinwave.scene.file import dumps
from skinwave.scene.scene import Scene
from skinwave.studies.driven_modes import LOWEST, DrivenLine, DrivenModes, amplitudes_of
from skinwave.studies.wavenumbers import (
    FittedWaves,
    LineOfProbes,
    Matched,
    fitted_waves,
    matched_modes,
    pulse_scene,
    transfer_functions,
    wavenumber_spectrum,
)
from skinwave.system import document
from skinwave.system.effort import Progress
from skinwave.system.numbers import significant
from skinwave.system.plain_text import csv_table

COLUMNS = (
    "mode", "kind", "frequency_hz", "re_k_rad_per_m", "im_k_rad_per_m", "phase_speed_m_per_s",
    "group_speed_m_per_s", "decay_length_mm", "motion_beside_focus_um_per_pa",
)  # fmt: skip
LINE_COLUMNS = (
    "line", "frequency_hz", "pressure_pa", "mode", "kind", "share", "phase_speed_m_per_s",
    "group_speed_m_per_s", "wavelength_mm", "decay_length_mm", "focus_over_phase_speed",
    "mach_angle_deg",
)  # fmt: skip
HIGHEST_OBSERVED = 400.0  # Hz: faster waves do not reach beyond the focal spot
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Observed:
    """Motion of a line of probes by a `model`, the waves fitted to it, and the modes beside it."""

    model: str
    line: LineOfProbes
    fitted: FittedWaves
    matched: Matched


def observe(
    found: DrivenModes,
    model: str,
    progress: Progress,
    *,
    h: float | None = None,
    solver: str = "auto",
) -> Observed:
    """Motion of a line of probes under a pulse, and the waves in it beside the body's modes.

    Parameters
    ----------
    found : DrivenModes, whose scene and frequencies are taken
    model : "fem", "flat-body"
    progress : called with the name of the phase and the fraction done
    h : metre, element size
    solver : a backend of `fem.linear_solver`

    Returns
    -------
    Observed

    Raises
    ------
    ValueError
        If the model refuses the body, or that ends too near to the focus.
    """
    scene = pulse_scene(found.scene)
    response = compute(scene, model, progress=progress, h=h, solver=solver)
    highest = min(float(found.curves.frequencies[-1]), HIGHEST_OBSERVED)
    line = transfer_functions(scene, response, highest)
    height = scene.pressure.height
    fitted = fitted_waves(line, height)
    curves = dispersion(scene.body, line.frequencies, len(found.curves.modes))
    matched = matched_modes(curves, fitted, height, spot_width(height))
    return Observed(model=model, line=line, fitted=fitted, matched=matched)


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


def write(folder: Path, found: DrivenModes, observed: Observed | None) -> None:
    """index.html, dispersion.png, dispersion.csv, driven-lines.csv and dispersion.npz."""
    (folder / "dispersion.csv").write_bytes(csv_table(COLUMNS, _mode_rows(found)))
    (folder / "driven-lines.csv").write_bytes(csv_table(LINE_COLUMNS, map(_line_row, found.lines)))
    np.savez(folder / "dispersion.npz", **_arrays(found, observed))  # type: ignore[arg-type]

    def picture(name: str, figure: Figure, caption: str) -> str:
        drawn = png(figure)
        (folder / f"{name}.png").write_bytes(drawn)
        return document.picture(drawn, caption, name)

    parts = page_parts(found, picture)
    if observed is not None:
        parts.append(document.section(
            f"Wavenumbers in the motion computed by {observed.model}",
            document.paragraph(observed_sentence(observed)),
            picture("wavenumbers", _observed_figure(found, observed), OBSERVED_CAPTION),
        ))  # fmt: skip
    parts.append(document.section("The scene", document.preformatted(dumps(found.scene))))
    title = f"{found.scene.name}: waves that its body guides"
    (folder / "index.html").write_text(document.page(title, *parts), encoding="utf-8")


def page_parts(
    found: DrivenModes, picture: Callable[[str, Figure, str], str], style: Style = REPORT
) -> list[str]:
    """Sentences, figure and table, for a page of their own or a part of another.

    Parameters
    ----------
    found : DrivenModes
    picture : makes a part of a page of a figure, with its name and caption
    style : Style

    Returns
    -------
    Parts of a page
    """
    lines = {line.name: line.frequency for line in found.lines}
    speed = found.lines[0].focus_speed if found.lines else 0.0
    at = found.lines[0].frequency if found.lines else float(np.median(found.curves.frequencies))
    figure = dispersion_figure(found.curves, lines, speed, at, style)
    parts: list[str] = [
        document.paragraph(" ".join(sentences(found))),
        *map(document.paragraph, taken_as(found.scene)),
        picture("dispersion", figure, CAPTION),
    ]
    if found.lines:
        parts += [document.table(*line_table(found)), document.paragraph(EXPLAINED)]
    return parts


def line_table(found: DrivenModes) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the lines and the modes that they drive, the strongest first."""
    header = ["line", "frequency, Hz", "pressure, Pa", "drives most", "kind", "share, %",
              "phase speed, m/s", "group speed, m/s", "wavelength, mm", "1/e length, mm",
              "focus over phase speed", "Mach angle, degrees"]  # fmt: skip
    rows = [
        [
            line.name, f"{line.frequency:.1f}", significant(line.strength), line.mode.name,
            line.kind, f"{100 * line.share:.0f}", significant(line.phase_speed),
            significant(line.group_speed) if line.mode.is_wave[line.at] else "-",
            significant(1e3 * line.wavelength), significant(1e3 * line.decay_length),
            significant(line.focus_speed / line.phase_speed) if line.focus_speed else "-",
            "-" if line.mach_angle is None else f"{line.mach_angle:.0f}",
        ]
        for line in found.lines
    ]  # fmt: skip
    return header, rows


OBSERVED_CAPTION = (
    "Grey: motion along x, transformed over time and place with a Hann window, as broad as the "
    "body is few wavelengths wide. Circles: of the Hankel functions fitted beyond the focal spot "
    "the one nearest to the leading mode, where the line resolves it: with a standard error of at "
    "most 3 %, and before it fades to a twentieth. Lines: the modes that propagate."
)


def observed_sentence(observed: Observed) -> str:
    """How far the fitted wavenumbers agree with the modes."""
    apart = 100 * observed.matched.apart
    if not len(apart):
        return "At no frequency does one propagating mode lead that the line of probes resolves."
    low, high = observed.matched.frequencies[[0, -1]]
    return (
        f"The wavenumber fitted to the motion agrees with that of the leading mode to "
        f"{significant(float(np.median(apart)), 2)} % (median) and "
        f"{significant(float(apart.max()), 2)} % (largest) from {low:.0f} to {high:.0f} Hz, where "
        "one propagating mode leads and the fit leaves less than 2 % of the motion: at "
        f"{len(apart)} frequencies, and at {observed.matched.unresolved} more the line of probes "
        "does not resolve it."
    )


def _observed_figure(found: DrivenModes, observed: Observed) -> Figure:
    largest = max(float(np.nanmax(np.abs(m.wavenumbers.real[m.is_wave]), initial=100.0))
                  for m in found.curves.modes)  # fmt: skip
    k, magnitude = wavenumber_spectrum(observed.line, 1.2 * largest)
    f, matched = observed.line.frequencies, observed.matched
    return wavenumber_figure(
        found.curves, (f, k, magnitude),
        (matched.frequencies, matched.fitted.real), f"motion along x by {observed.model}",
    )  # fmt: skip


def _mode_rows(found: DrivenModes) -> Iterator[list[object]]:
    amplitudes = 1e6 * np.abs(amplitudes_of(found.curves.modes, found.scene.pressure))
    for mode, motion in zip(found.curves.modes, amplitudes, strict=True):
        for n, f in enumerate(mode.frequencies):
            if not mode.kinds[n]:
                continue
            k = mode.wavenumbers[n]
            values = (f, k.real, k.imag, mode.phase_speed[n], mode.group_speed[n],
                      1e3 * mode.decay_length[n], motion[n])  # fmt: skip
            yield [mode.name, str(mode.kinds[n]), *(f"{x:.6g}" for x in values)]


def _line_row(line: DrivenLine) -> list[object]:
    ratio = line.focus_speed / line.phase_speed
    angle = "" if line.mach_angle is None else f"{line.mach_angle:.4g}"
    values = (line.phase_speed, line.group_speed, 1e3 * line.wavelength, 1e3 * line.decay_length)
    return [
        line.name, f"{line.frequency:.6g}", f"{line.strength:.6g}", line.mode.name, line.kind,
        f"{line.share:.4g}", *(f"{x:.6g}" for x in values), f"{ratio:.4g}", angle,
    ]  # fmt: skip


def _arrays(found: DrivenModes, observed: Observed | None) -> dict[str, np.ndarray]:
    """Arrays (m, f) of the modes, and those of a line of probes if there is one."""
    modes = found.curves.modes
    arrays = {
        "frequency_hz": found.curves.frequencies, "depth_m": found.curves.depths,
        "mode": np.array([mode.name for mode in modes]),
        "kind": np.array([mode.kinds for mode in modes]),
        "wavenumber_per_m": np.array([mode.wavenumbers for mode in modes]),
        "slowness_s_per_m": np.array([mode.slowness for mode in modes]),
        "residue_per_pa_m": np.array([mode.residues for mode in modes]),
        "shape": np.array([mode.shapes for mode in modes]),
    }  # fmt: skip
    if observed is not None:
        arrays |= {
            "observed_frequency_hz": observed.line.frequencies,
            "observed_distance_m": observed.line.distances,
            "observed_transfer_m_per_pa": observed.line.transfer,
            "fitted_wavenumber_per_m": observed.fitted.wavenumbers,
            "fitted_relative_error": observed.fitted.errors,
            "fitted_is_resolved": observed.fitted.is_resolved,
            "fitted_misfit": observed.fitted.misfit,
        }
    return arrays
