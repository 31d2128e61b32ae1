"""Inspection of a measurement as a page, a figure, tables and the measurement itself."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from skinwave.measure import summary, writing
from skinwave.measure.inspection import Inspection
from skinwave.measure.spectral_lines import LOWEST
from skinwave.report.figures import REPORT, png
from skinwave.report.palette import SERIES
from skinwave.report.styles import Style
from skinwave.system import document
from skinwave.system.plain_text import csv_table

SHOWN = 4  # places
WINDOW = 0.1  # s
MOST_CELLS = 2_000_000  # of a CSV file
MAP = 3  # known places, at least, of a map
CAPTION = (
    "Waveforms where they are largest, each above the last, mean of the repetitions. Spectra of "
    "these, in the same colours: one-sided density of amplitude with a Hann window; dashed: their "
    "noise floor without the lines; triangles: lines found, grey ones mains hum. Map: root mean "
    "square about the mean."
)
SPECTRA = (
    "Magnitudes at the places where they are largest; dashed: running median; triangles: lines "
    "found. Map: root mean square over frequency."
)
EXPLAINED = (
    "The false alarm is the probability that noise alone has any line as high in the whole file: "
    "that of the F distribution of a periodogram over its running median, times bins and places. "
    "The standard error of a frequency is the Cramér-Rao bound in the noise found beside it. Of "
    "several lines within 1.5 over the duration one is named. What is called mains is a multiple "
    "of one frequency near 50 or 60 Hz that is itself there; what is called drive is a line of the "
    "recorded drive."
)


def write(folder: Path, found: Inspection) -> None:
    """index.html, measured.png, found-lines.csv, measurement.npz and, unless large, .csv."""
    measured = found.measured
    drawn = png(figure(found))
    (folder / "measured.png").write_bytes(drawn)
    (folder / "measurement.npz").write_bytes(writing.npz(measured))
    if measured.values.size <= MOST_CELLS:
        (folder / "measurement.csv").write_bytes(writing.table(measured))
    rows = csv_table(summary.COLUMNS, summary.line_rows(found))
    (folder / "found-lines.csv").write_bytes(rows)
    caption = SPECTRA if measured.is_spectrum else CAPTION
    lines = [document.paragraph("No line rises above the noise floor.")]
    if table := summary.line_table(found):
        lines = [document.table(summary.HEADER, table), document.paragraph(EXPLAINED)]
    parts = [
        document.paragraph(" ".join(summary.sentences(found))),
        document.picture(drawn, caption, "measured"),
        document.section("Lines", *lines),
        document.section(
            "Missing or assumed", *map(document.paragraph, found.missing or ["Nothing."])
        ),
    ]
    title = f"{measured.name}: what was measured"
    (folder / "index.html").write_text(document.page(title, *parts), encoding="utf-8")


def figure(found: Inspection, style: Style = REPORT) -> Figure:
    """Waveforms, spectra with the lines and the noise floor, and a map of where it moves."""
    places = found.measured.places
    known = np.isfinite(places).all() and len(places) >= MAP
    in_time = not found.measured.is_spectrum
    panels = in_time + known
    with mpl.rc_context(style.rc):
        drawn = Figure(figsize=style.size(11.0, 7.4 if panels else 4.2), layout="constrained")
        grid = drawn.add_gridspec(2 if panels else 1, 2 if panels == 2 else 1)
        at = _largest(found)
        if in_time:
            _waveforms(drawn.add_subplot(grid[0, 0]), found, at)
        if known:
            _map(drawn, drawn.add_subplot(grid[0, -1]), found)
        _spectra(drawn.add_subplot(grid[-1, :]), found, at)
    return drawn


def _largest(found: Inspection) -> np.ndarray:
    """Positions in `kept` of the places where the motion is largest."""
    rms = _rms(found)[found.kept]
    return np.argsort(-rms)[:SHOWN]


def _rms(found: Inspection) -> np.ndarray:
    """Root mean square (p,) about the mean, over repetitions; of spectra of the magnitudes."""
    values = found.measured.values
    if found.measured.is_spectrum:
        return np.asarray(np.sqrt(np.mean(np.abs(values) ** 2, axis=(0, 1))))
    return np.asarray(np.sqrt(np.mean(np.var(values, axis=1), axis=0)))


def _waveforms(ax: Axes, found: Inspection, at: np.ndarray) -> None:
    measured = found.measured
    record, mean = measured.record, measured.mean - measured.mean.mean(axis=0)
    shown = found.kept[at]
    part = _part(np.abs(mean[:, shown]).max(axis=1) if len(shown) else mean[:, 0], measured.times)
    step = 2.2 * float(np.abs(mean[part][:, shown]).max(initial=0.0)) * record.per_unit or 1.0
    for k, p in enumerate(shown):
        offset = (len(shown) - 1 - k) * step
        name = summary.place_words(measured, int(p))
        ax.plot(1e3 * measured.times[part], offset + record.per_unit * mean[part, p],
                color=SERIES[k], lw=0.9, label=name)  # fmt: skip
    ax.set_xlabel("time, ms")
    apart = f", {step:.2g} apart" if len(shown) > 1 else ""
    ax.set_ylabel(f"{record.words}, {record.shown}{apart}")
    ax.set_title("waveforms about their mean", fontsize="medium")
    ax.grid(alpha=0.25)


def _part(size: np.ndarray, times: np.ndarray) -> slice:
    """The samples around the largest value, for `WINDOW`."""
    count = len(times)
    wide = int(np.searchsorted(times - times[0], WINDOW))
    if wide >= count:
        return slice(0, count)
    begin = int(np.clip(int(np.argmax(size)) - wide // 2, 0, count - wide))
    return slice(begin, begin + wide)


def _spectra(ax: Axes, found: Inspection, at: np.ndarray) -> None:
    measured, spectrum = found.measured, found.spectrum
    record = measured.record
    ax.set_xlabel("frequency, Hz")
    ax.set_yscale("log")
    ax.grid(alpha=0.25)
    if spectrum is None:
        _few(ax, found)
        return
    inner = slice(0 if measured.is_spectrum else LOWEST // 2, -1)
    f = spectrum.frequencies[inner]
    for k, p in enumerate(at):
        name = summary.place_words(measured, int(found.kept[p]))
        level = record.per_unit * np.sqrt(spectrum.density[inner, p])
        ax.plot(f, level, color=SERIES[k], lw=0.8, label=name)
    floor = record.per_unit * np.sqrt(np.median(spectrum.floor[inner][:, at], axis=1))
    ax.plot(f, floor, color=mpl.rcParams["text.color"], lw=1.4, ls="--", label="noise floor")
    _mark(ax, found, at)
    highest = max([line.frequency for line in found.lines], default=0.0)
    ax.set_xlim(float(f[0]), float(f[-1]) if not highest else min(2.0 * highest, float(f[-1])))
    unit = record.shown if measured.is_spectrum else f"{record.shown}/√Hz"
    ax.set_ylabel(f"{record.name}, {unit}")
    ax.legend(fontsize="small", loc="upper right")


def _mark(ax: Axes, found: Inspection, at: np.ndarray) -> None:
    """Triangles above the lines, with the names of the strongest."""
    spectrum = found.spectrum
    if spectrum is None or not found.lines:
        return
    per = found.measured.record.per_unit
    tops = [
        per * float(np.sqrt(spectrum.density[_around(spectrum.frequencies, line.frequency)][:, at]
                            .max()))
        for line in found.lines
    ]  # fmt: skip
    strongest = np.argsort(tops)[::-1][:12]
    for k, (line, origin) in enumerate(zip(found.lines, found.origins, strict=True)):
        grey = origin.startswith("mains")
        colour = "#888888" if grey else mpl.rcParams["text.color"]
        ax.plot(line.frequency, 1.5 * tops[k], "v", ms=5, color=colour)
        if k in strongest:
            ax.annotate(
                f"{line.frequency:.1f}", (line.frequency, 1.5 * tops[k]), (0, 5),
                textcoords="offset points", ha="center", va="bottom", fontsize="x-small",
                color=colour, rotation=90,
            )  # fmt: skip
    low, high = ax.get_ylim()
    ax.set_ylim(low, max(high, 20 * max(tops)))


def _around(frequencies: np.ndarray, line: float) -> slice:
    k = int(np.searchsorted(frequencies, line))
    return slice(max(k - 2, 0), k + 3)


def _few(ax: Axes, found: Inspection) -> None:
    """Magnitudes at few frequencies, or a note that there is no spectrum."""
    measured = found.measured
    if not measured.is_spectrum or not len(found.kept):
        ax.text(0.5, 0.5, "too short for a spectrum", ha="center", transform=ax.transAxes)
        return
    for k, p in enumerate(found.kept[_largest(found)]):
        level = measured.record.per_unit * np.abs(measured.values[:, :, p]).mean(axis=0)
        name = summary.place_words(measured, int(p))
        ax.plot(measured.frequencies, level, "o-", color=SERIES[k], lw=0.8, label=name)
    ax.set_ylabel(f"{measured.record.name}, {measured.record.shown}")
    ax.legend(fontsize="small")


def _map(drawn: Figure, ax: Axes, found: Inspection) -> None:
    measured = found.measured
    x, y = 1e3 * measured.places.T
    dots = ax.scatter(x, y, c=measured.record.per_unit * _rms(found), s=36, cmap="viridis",
                      edgecolors="#00000055", linewidths=0.4)  # fmt: skip
    drawn.colorbar(dots, ax=ax, label=f"RMS {measured.record.name}, {measured.record.shown}")
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel("x, mm")
    ax.set_ylabel("y, mm")
    ax.set_title(f"{len(x)} places", fontsize="medium")
