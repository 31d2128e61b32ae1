"""Inspection of a measurement as text, JSON and page, with the data as files."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simple_model.numbers import as_sentence, if_finite, interval, plural, significant
from simple_model.response import SETTLE
from skinwave.measure import writing
from skinwave.measure.inspection import Inspection
from skinwave.measure.line_search import LOWEST
from skinwave.measure.measurement import strongest
from skinwave.report.figures import REPORT, png
from skinwave.report.palette import SERIES
from skinwave.system.document import Picture, Report, Section
from skinwave.system.table import Column, Table, cell_text

COLUMNS = (
    Column("frequency_hz", "line", "Hz", digits=7),
    Column("frequency_error_hz", "standard error", "Hz", digits=2), "place",
    Column("x_mm", "x", "mm"), Column("y_mm", "y", "mm"), Column("amplitude", "largest amplitude"),
    "unit", Column("false_alarm", "false alarm", digits=1), Column("what", "origin"),
)  # fmt: skip
NO_LINES = "No line rises above the noise floor."


def write(folder: Path, inspection: Inspection) -> None:
    """Write index.html, measured.png, found-lines.csv, measurement.npz and a CSV file if small."""
    measured = inspection.measured
    (folder / "measurement.npz").write_bytes(writing.to_npz(measured))
    most_cells = 2_000_000  # of a CSV file
    if measured.values.size <= most_cells:
        (folder / "measurement.csv").write_bytes(writing.to_csv(measured))
    (folder / "found-lines.csv").write_bytes(line_table(inspection).to_csv())
    missing = [as_sentence(sentence) for sentence in inspection.missing] or ["Nothing."]
    caption = (
        "The places with the largest motion. Spectra: one-sided amplitude density with a Hann "
        "window, or magnitudes; dashed: noise floor without the lines; triangles: lines, grey for "
        "mains hum. Map: root mean square about the mean."
    )
    method = (
        "The false alarm is the probability that noise alone has any line as high in the whole "
        "file. The standard error of a frequency is the Cramér-Rao bound in the surrounding "
        "noise, for a steady motion. The origin is mains for 50 or 60 Hz and their multiples, and "
        "drive if the recorded drive has the line."
    )
    Report(
        f"Inspection of {measured.name}", verdict=[" ".join(sentences(inspection))],
        parts=[
            Picture(png(figure(inspection)), caption, "measured"),
            Section("Lines", [largest(inspection), method] if inspection.lines else [NO_LINES]),
            Section("Missing or assumed", missing),
        ],
    ).write(folder)  # fmt: skip


def line_table(inspection: Inspection) -> Table:
    """Return the lines, a row for each line and place."""
    record, places = inspection.measured.record, inspection.measured.places
    rows = (
        (line.frequency, line.error, int(p) + 1, *(1e3 * places[p]).tolist(),
         float(record.per_unit * line.amplitudes[k]), record.shown, line.false_alarm, origin)
        for line, origin in zip(inspection.lines, inspection.origins, strict=True)
        for k, p in enumerate(inspection.kept)
    )  # fmt: skip
    return Table(COLUMNS, rows, stored=9)


def largest(inspection: Inspection) -> Table:
    """Return one row for each line, at the place where it is largest."""
    rows, count = line_table(inspection).rows, len(inspection.kept)
    best = [n * count + int(line.amplitudes.argmax()) for n, line in enumerate(inspection.lines)]
    return Table(COLUMNS, [rows[k] for k in best])


def sentences(inspection: Inspection) -> list[str]:
    """Return sentences on content, noise, clipping and constant places."""
    measured, where = inspection.measured, np.flatnonzero(inspection.clipped.sum(axis=0))
    record, noise = measured.record, inspection.noise[np.isfinite(inspection.noise)]
    lines = [
        _content(inspection),
        "The record is too short or too sparse for a noise floor and lines.",
    ]
    if len(noise):
        low, high = (record.per_unit * float(x) for x in (noise.min(), noise.max()))
        level = interval(low, high) if high > low else significant(low)
        unit = record.shown + "/√Hz" * (not measured.is_spectrum)
        lines[1] = f"The noise floor is {level} {unit} (median over frequency, without lines)."
    if len(where):
        count = int(inspection.clipped.sum())
        lines.append(f"Clipped: {count:,} samples at an extreme, at {measured.place_names(where)}.")
    if len(inspection.constant) and len(measured.axis) > 1:
        names = measured.place_names(inspection.constant)
        lines.append(f"Nothing varies at {plural(len(inspection.constant), 'place')}: {names}.")
    return lines


def _content(inspection: Inspection) -> str:
    measured, axis = inspection.measured, inspection.measured.axis
    content = f"{measured.record.name.capitalize()} at {plural(len(measured.places), 'place')}, "
    content += plural(len(measured.values), "repetition")
    if measured.is_spectrum:
        return f"{content}: {len(axis)} complex amplitudes, {axis[0]:g} to {axis[-1]:g} Hz."
    content += f": {plural(len(axis), 'sample')}"
    if len(axis) < 2:
        return f"{content}."
    duration = len(axis) / measured.rate
    return (
        f"{content} at {measured.rate:,.6g} Hz, {significant(duration)} s. Lines "
        f"at least {significant(1 / (1 - SETTLE) / duration)} Hz apart are resolved."
    )


def text(inspection: Inspection) -> str:
    """Return the inspection for a terminal."""
    lines = [f"{inspection.measured.source}: {_content(inspection)}", *sentences(inspection)[1:]]
    if inspection.lines:
        table = largest(inspection)
        cells = [[column.title for column in table.columns]]
        for row in table.rows:
            pairs = zip(row, table.columns, strict=True)
            cells.append([cell_text(value, column.digits) for value, column in pairs])
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        padded = ("  ".join(map(str.ljust, row, widths)).rstrip() for row in cells)
        lines += ["", *padded, ""]
    elif inspection.spectrum is not None:
        lines.append(NO_LINES)
    return "\n".join([*lines, *(f"note: {sentence}" for sentence in inspection.missing)])


def summary(inspection: Inspection) -> dict[str, Any]:
    """Return the inspection in SI, for JSON."""
    measured = inspection.measured
    return {
        "name": measured.name, "source": measured.source, "quantity": measured.quantity,
        "unit": measured.record.unit, "repetitions": len(measured.values),
        "places_m": [[*map(if_finite, place)] for place in measured.places],
        "samples": len(measured.axis), "is_spectrum": measured.is_spectrum,
        "rate_hz": if_finite(measured.rate), "has_drive": len(measured.drive) > 0,
        "lines": [
            {"frequency_hz": line.frequency, "frequency_error_hz": line.error,
             "false_alarm": line.false_alarm, "what": origin,
             "amplitudes": line.amplitudes.tolist()}
            for line, origin in zip(inspection.lines, inspection.origins, strict=True)
        ],
        "looked_at": (inspection.kept + 1).tolist(),
        "noise_floor": [*map(if_finite, inspection.noise)],
        "clipped_samples": inspection.clipped.tolist(),
        "constant_places": (inspection.constant + 1).tolist(), "missing": list(inspection.missing),
    }  # fmt: skip


@mpl.rc_context(REPORT.rc)
def figure(inspection: Inspection) -> Figure:
    """Return waveforms, a map of their RMS, and spectra with lines and noise floor."""
    measured = inspection.measured
    moving = measured.values
    if not measured.is_spectrum:
        moving = moving - moving.mean(axis=1, keepdims=True)
    rms = measured.record.per_unit * np.sqrt(np.mean(np.abs(moving) ** 2, axis=(0, 1)))
    fewest_on_map = 3  # places
    has_map = np.isfinite(measured.places).all() and len(measured.places) >= fewest_on_map
    panels = (not measured.is_spectrum) + has_map
    drawn = Figure(figsize=REPORT.size(11.0, 7.4 if panels else 4.2), layout="constrained")
    grid = drawn.add_gridspec(2 if panels else 1, 2 if panels == 2 else 1)
    most_drawn = 4  # places
    at = strongest(rms[inspection.kept], most_drawn)
    if not measured.is_spectrum:
        _waveforms(drawn.add_subplot(grid[0, 0]), inspection, at)
    if has_map:
        ax = drawn.add_subplot(grid[0, -1])
        x, y = 1e3 * measured.places.T
        dots = ax.scatter(x, y, c=rms, s=36, cmap="viridis",
                          edgecolors="#00000055", linewidths=0.4)  # fmt: skip
        name = f"RMS {measured.record.name}, {measured.record.shown}"
        drawn.colorbar(dots, ax=ax, label=name)
        ax.set_aspect("equal", adjustable="datalim")
        ax.set(xlabel="x, mm", ylabel="y, mm")
    _spectra(drawn.add_subplot(grid[-1, :]), inspection, at)
    return drawn


def _waveforms(ax: Axes, inspection: Inspection, at: np.ndarray) -> None:
    """Draw the mean waveforms at the places of largest motion, one above the other."""
    measured, places = inspection.measured, inspection.kept[at]
    record, mean = measured.record, measured.mean - measured.mean.mean(axis=0)
    size = np.abs(mean[:, places]).max(axis=1, initial=0.0)
    drawn_time = 0.1  # s
    count = int(np.searchsorted(measured.times - measured.times[0], drawn_time))
    begin = int(np.clip(int(np.argmax(size)) - count // 2, 0, max(len(size) - count, 0)))
    part = slice(begin, begin + count)
    step = 2.2 * float(size[part].max(initial=0.0)) * record.per_unit or 1.0
    for k, p in enumerate(places):
        offset = (len(places) - 1 - k) * step
        ax.plot(1e3 * measured.times[part], offset + record.per_unit * mean[part, p],
                color=SERIES[k], lw=0.9, label=measured.place_name(int(p)))  # fmt: skip
    apart = f", {step:.2g} apart" if len(places) > 1 else ""
    ax.set(xlabel="time, ms", ylabel=f"{record.words}, {record.shown}{apart}")
    ax.grid(alpha=0.25)


def _spectra(ax: Axes, inspection: Inspection, at: np.ndarray) -> None:
    measured, spectrum = inspection.measured, inspection.spectrum
    unit = measured.record.per_unit
    if spectrum is None and not (measured.is_spectrum and len(inspection.kept)):
        ax.text(0.5, 0.5, "too short for a spectrum", ha="center", transform=ax.transAxes)
        return
    if spectrum is None:
        f, marker = measured.frequencies, "o-"
        size = unit * np.abs(measured.values[:, :, inspection.kept[at]]).mean(axis=0)
    else:
        inner = slice(0 if measured.is_spectrum else LOWEST // 2, -1)
        f, marker = spectrum.frequencies[inner], "-"
        size = unit * np.sqrt(spectrum.density[inner][:, at])
        floor = unit * np.sqrt(np.median(spectrum.floor[inner][:, at], axis=1))
        ax.plot(f, floor, color=mpl.rcParams["text.color"], lw=1.4, ls="--", label="noise floor")
        highest = max([line.frequency for line in inspection.lines], default=float(f[-1]))
        ax.set_xlim(float(f[0]), min(2.0 * highest, float(f[-1])))
    for k, p in enumerate(inspection.kept[at]):
        ax.plot(f, size[:, k], marker, color=SERIES[k], lw=0.8, label=measured.place_name(int(p)))
    ax.set_yscale("log")
    _mark_lines(ax, inspection, f, size.max(axis=1))
    per_root = "/√Hz" * (not measured.is_spectrum)
    name = f"{measured.record.name}, {measured.record.shown}{per_root}"
    ax.set(xlabel="frequency, Hz", ylabel=name)
    ax.legend(fontsize="small", loc="upper right")
    ax.grid(alpha=0.25)


def _mark_lines(ax: Axes, inspection: Inspection, f: np.ndarray, level: np.ndarray) -> None:
    """Draw triangles above the lines, with the frequencies of the strongest."""
    at = [int(np.searchsorted(f, line.frequency)) for line in inspection.lines]
    tops = np.array([level[max(k - 2, 0) : k + 3].max(initial=0.0) for k in at])
    most_named = 12  # lines in the figure
    named = strongest(tops, most_named)
    for k, (line, origin) in enumerate(zip(inspection.lines, inspection.origins, strict=True)):
        colour = "#888888" if origin.startswith("mains") else mpl.rcParams["text.color"]
        ax.plot(line.frequency, 1.5 * tops[k], "v", ms=5, color=colour)
        if k in named:
            ax.annotate(
                f"{line.frequency:.1f}", (line.frequency, 1.5 * tops[k]), (0, 5),
                textcoords="offset points", ha="center", va="bottom", fontsize="x-small",
                color=colour, rotation=90,
            )  # fmt: skip
    low, high = ax.get_ylim()
    ax.set_ylim(low, max(high, 20 * tops.max(initial=0.0)))
