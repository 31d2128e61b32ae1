"""Inspection of a measurement as text, JSON, a page, a figure, tables, and the data themselves."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simple_model.numbers import as_sentence, plural, significant
from simple_model.response import SETTLE
from skinwave.measure import writing
from skinwave.measure.inspection import Inspection
from skinwave.measure.spectral_lines import LOWEST
from skinwave.report.figures import REPORT, png
from skinwave.report.palette import SERIES
from skinwave.report.styles import Style
from skinwave.system.document import Picture, Report, Section
from skinwave.system.table import Column, Table, shown

SHOWN = 4  # places
WINDOW = 0.1  # s
MOST_CELLS = 2_000_000  # of a CSV file
MAP = 3  # known places, at least, of a map
MOST_NAMED = 12  # lines in the figure
COLUMNS = (
    Column("frequency_hz", "line", "Hz", digits=7),
    Column("frequency_error_hz", "standard error", "Hz", digits=2), "place",
    Column("x_mm", "x", "mm"), Column("y_mm", "y", "mm"), Column("amplitude", "largest amplitude"),
    "unit", Column("false_alarm", "false alarm", digits=1), Column("what", "origin"),
)  # fmt: skip
CAPTION = (
    "The places where the motion is largest. Spectra: one-sided density of amplitude with a Hann "
    "window, or magnitudes; dashed: the noise floor without the lines; triangles: lines found, "
    "grey ones mains hum. Map: root mean square about the mean."
)
NONE = "No line rises above the noise floor."
EXPLAINED = (
    "The false alarm is the probability that noise alone has any line as high in the whole file. "
    "The standard error of a frequency is the Cramér-Rao bound in the noise beside it, for a "
    "steady motion. The origin of a line is mains at 50 or 60 Hz and their multiples, and drive if "
    "the recorded drive has it."
)


def write(folder: Path, found: Inspection) -> None:
    """Write index.html, measured.png, found-lines.csv, measurement.npz and, unless large, .csv."""
    measured = found.measured
    (folder / "measurement.npz").write_bytes(writing.npz(measured))
    if measured.values.size <= MOST_CELLS:
        (folder / "measurement.csv").write_bytes(writing.table(measured))
    (folder / "found-lines.csv").write_bytes(line_table(found).to_csv())
    Report(
        f"{measured.name}: what was measured", verdict=[" ".join(sentences(found))],
        parts=[
            Picture(png(figure(found)), CAPTION, "measured"),
            Section("Lines", [strongest(found), EXPLAINED] if found.lines else [NONE]),
            Section("Missing or assumed", [*map(as_sentence, found.missing)] or ["Nothing."]),
        ],
    ).write(folder)  # fmt: skip


def line_table(found: Inspection) -> Table:
    """Lines, a row for each line and place."""
    record, places = found.measured.record, found.measured.places
    rows = (
        (line.frequency, line.error, int(p) + 1, *(1e3 * places[p]).tolist(),
         float(record.per_unit * line.amplitudes[k]), record.shown, line.false_alarm, origin)
        for line, origin in zip(found.lines, found.origins, strict=True)
        for k, p in enumerate(found.kept)
    )  # fmt: skip
    return Table(COLUMNS, rows, stored=9)


def strongest(found: Inspection) -> Table:
    """The row of each line at the place where it is largest."""
    rows, count = line_table(found).rows, len(found.kept)
    return Table(COLUMNS, (rows[n * count + int(line.amplitudes.argmax())]
                           for n, line in enumerate(found.lines)))  # fmt: skip


def sentences(found: Inspection) -> list[str]:
    """Sentences on what was measured, on noise, clipping and places where nothing varies."""
    measured, where = found.measured, np.flatnonzero(found.clipped.sum(axis=0))
    record, noise = measured.record, found.noise[np.isfinite(found.noise)]
    said = [_content(found), "Too short or too sparse for a noise floor and for lines."]
    if len(noise):
        low, high = (significant(record.per_unit * x) for x in (noise.min(), noise.max()))
        unit = record.shown + "/√Hz" * (not measured.is_spectrum)
        level = low if low == high else f"{low} to {high}"
        said[1] = f"Noise floor {level} {unit}, the median over frequency without the lines."
    if len(where):
        said.append(f"Clipped: {int(found.clipped.sum()):,} samples in runs at the same extreme, "
                    f"at {measured.place_names(where)}.")  # fmt: skip
    if len(found.constant) and len(measured.axis) > 1:
        said.append(f"Nothing varies at {len(found.constant)} of the places: "
                    f"{measured.place_names(found.constant)}.")  # fmt: skip
    return said


def _content(found: Inspection) -> str:
    measured, axis = found.measured, found.measured.axis
    said = f"{measured.record.name.capitalize()} at {plural(len(measured.places), 'place')}, "
    said += plural(len(measured.values), "repetition")
    if measured.is_spectrum:
        return f"{said}: {len(axis)} complex amplitudes, {axis[0]:g} to {axis[-1]:g} Hz."
    lasts = len(axis) / measured.rate if len(axis) > 1 else 0.0
    resolved = significant(1 / (1 - SETTLE) / lasts) if lasts else "-"
    return (
        f"{said}: {len(axis):,} samples at {measured.rate:,.6g} Hz, {significant(lasts)} s, so "
        f"that lines {resolved} Hz apart are resolved."
    )


def text(found: Inspection) -> str:
    """All of it, for a terminal."""
    said = [f"{found.measured.source}: {_content(found)}", *sentences(found)[1:]]
    if found.lines:
        table = strongest(found)
        cells = [[column.title for column in table.columns]]
        cells += [[shown(value, column.digits) for value, column in zip(row, table.columns,
                   strict=True)] for row in table.rows]  # fmt: skip
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        padded = ("  ".join(map(str.ljust, row, widths)).rstrip() for row in cells)
        said += ["", *padded, ""]
    elif found.spectrum is not None:
        said.append(NONE)
    return "\n".join([*said, *(f"note: {sentence}" for sentence in found.missing)])


def summary(found: Inspection) -> dict[str, Any]:
    """All of it in SI, for JSON."""
    measured = found.measured
    return {
        "name": measured.name, "source": measured.source, "quantity": measured.quantity,
        "unit": measured.record.unit, "repetitions": len(measured.values),
        "places_m": [_known(place) for place in measured.places],
        "samples": len(measured.axis), "is_spectrum": measured.is_spectrum,
        "rate_hz": _known([measured.rate])[0], "has_drive": len(measured.drive) > 0,
        "lines": [
            {"frequency_hz": line.frequency, "frequency_error_hz": line.error,
             "false_alarm": line.false_alarm, "what": origin,
             "amplitudes": line.amplitudes.tolist()}
            for line, origin in zip(found.lines, found.origins, strict=True)
        ],
        "looked_at": (found.kept + 1).tolist(), "noise_floor": _known(found.noise),
        "clipped_samples": found.clipped.tolist(),
        "constant_places": (found.constant + 1).tolist(), "missing": list(found.missing),
    }  # fmt: skip


def _known(values: Any) -> list[float | None]:
    """Numbers, None in place of nan."""
    return [None if np.isnan(x) else float(x) for x in values]


def figure(found: Inspection, style: Style = REPORT) -> Figure:
    """Waveforms, spectra with the lines and the noise floor, and a map of where it moves."""
    measured = found.measured
    moving = measured.values - (
        0 if measured.is_spectrum else measured.values.mean(axis=1)[:, None]
    )
    rms = measured.record.per_unit * np.sqrt(np.mean(np.abs(moving) ** 2, axis=(0, 1)))
    known = np.isfinite(measured.places).all() and len(measured.places) >= MAP
    in_time = not measured.is_spectrum
    panels = in_time + known
    with mpl.rc_context(style.rc):
        drawn = Figure(figsize=style.size(11.0, 7.4 if panels else 4.2), layout="constrained")
        grid = drawn.add_gridspec(2 if panels else 1, 2 if panels == 2 else 1)
        at = np.argsort(-rms[found.kept])[:SHOWN]  # of `kept`
        if in_time:
            _waveforms(drawn.add_subplot(grid[0, 0]), found, at)
        if known:
            ax = drawn.add_subplot(grid[0, -1])
            x, y = 1e3 * measured.places.T
            dots = ax.scatter(x, y, c=rms, s=36, cmap="viridis", edgecolors="#00000055",
                              linewidths=0.4)  # fmt: skip
            name = f"RMS {measured.record.name}, {measured.record.shown}"
            drawn.colorbar(dots, ax=ax, label=name)
            ax.set_aspect("equal", adjustable="datalim")
            ax.set_xlabel("x, mm")
            ax.set_ylabel("y, mm")
        _spectra(drawn.add_subplot(grid[-1, :]), found, at)
    return drawn


def _waveforms(ax: Axes, found: Inspection, at: np.ndarray) -> None:
    """Waveforms where they are largest, each above the last, mean of the repetitions."""
    measured, places = found.measured, found.kept[at]
    record, mean = measured.record, measured.mean - measured.mean.mean(axis=0)
    size = np.abs(mean[:, places]).max(axis=1, initial=0.0)
    wide = int(np.searchsorted(measured.times - measured.times[0], WINDOW))
    begin = int(np.clip(int(np.argmax(size)) - wide // 2, 0, max(len(size) - wide, 0)))
    part = slice(begin, begin + wide)
    step = 2.2 * float(size[part].max(initial=0.0)) * record.per_unit or 1.0
    for k, p in enumerate(places):
        offset = (len(places) - 1 - k) * step
        ax.plot(1e3 * measured.times[part], offset + record.per_unit * mean[part, p],
                color=SERIES[k], lw=0.9, label=measured.place_name(int(p)))  # fmt: skip
    ax.set_xlabel("time, ms")
    apart = f", {step:.2g} apart" if len(places) > 1 else ""
    ax.set_ylabel(f"{record.words}, {record.shown}{apart}")
    ax.grid(alpha=0.25)


def _spectra(ax: Axes, found: Inspection, at: np.ndarray) -> None:
    measured, spectrum = found.measured, found.spectrum
    record = measured.record
    if spectrum is None and not (measured.is_spectrum and len(found.kept)):
        ax.text(0.5, 0.5, "too short for a spectrum", ha="center", transform=ax.transAxes)
        return
    if spectrum is None:
        f, style = measured.frequencies, "o-"
        size = record.per_unit * np.abs(measured.values[:, :, found.kept[at]]).mean(axis=0)
    else:
        inner = slice(0 if measured.is_spectrum else LOWEST // 2, -1)
        f, style = spectrum.frequencies[inner], "-"
        size = record.per_unit * np.sqrt(spectrum.density[inner][:, at])
        floor = record.per_unit * np.sqrt(np.median(spectrum.floor[inner][:, at], axis=1))
        ax.plot(f, floor, color=mpl.rcParams["text.color"], lw=1.4, ls="--", label="noise floor")
        highest = max([line.frequency for line in found.lines], default=float(f[-1]))
        ax.set_xlim(float(f[0]), min(2.0 * highest, float(f[-1])))
    for k, p in enumerate(found.kept[at]):
        ax.plot(f, size[:, k], style, color=SERIES[k], lw=0.8, label=measured.place_name(int(p)))
    ax.set_yscale("log")
    _mark(ax, found, f, size.max(axis=1))
    ax.set_xlabel("frequency, Hz")
    ax.set_ylabel(f"{record.name}, {record.shown}" + "/√Hz" * (not measured.is_spectrum))
    ax.legend(fontsize="small", loc="upper right")
    ax.grid(alpha=0.25)


def _mark(ax: Axes, found: Inspection, f: np.ndarray, level: np.ndarray) -> None:
    """Triangles above the lines, with the frequencies of the strongest."""
    at = [int(np.searchsorted(f, line.frequency)) for line in found.lines]
    tops = np.array([level[max(k - 2, 0) : k + 3].max(initial=0.0) for k in at])
    named = np.argsort(-tops)[:MOST_NAMED]
    for k, (line, origin) in enumerate(zip(found.lines, found.origins, strict=True)):
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
