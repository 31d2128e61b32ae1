"""Tables and page parts of uncertainty: of an ensemble, and of a sweep by distributions."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from simple_model.numbers import interval, percent, plural, significant
from skinwave.report.column_labels import axis_label
from skinwave.report.figures import png
from skinwave.scene.distributions import Spread
from skinwave.scene.scene import Scene
from skinwave.sweeps import dataset
from skinwave.sweeps.dataset import Row
from skinwave.sweeps.ensemble import Ensemble, ensemble, propagate, rows_of
from skinwave.sweeps.sampling import PERCENTILES, one_at_a_time, percentiles, sobol_indices
from skinwave.sweeps.table_figures import finished_rows, value
from skinwave.sweeps.uncertainty_figures import bands_figure, maps_figure, tornado_figure
from skinwave.system.document import Choice, Details, Part, Picture, Report, Section
from skinwave.system.table import Column, Table

MEDIAN = 6  # place of the median in a row of percentiles
SAMPLED_FILES = PERCENTILE_FILE, INDEX_FILE, PAGE = (
    "percentiles.csv", "indices.csv", "uncertainty.html",
)  # fmt: skip


def write_ensemble(folder: Path, scene: Scene, n: int, **options: Any) -> list[Part]:
    """Write percentiles.csv and samples.csv of an ensemble, and return the parts of its page.

    The options are those of `propagate`.
    """
    found = propagate(scene, n, **options)
    rows = rows_of(found)
    (folder / PERCENTILE_FILE).write_bytes(row_percentiles(rows).to_csv())
    (folder / "samples.csv").write_bytes(dataset.csv_of(rows))
    return [Section("Uncertainty", list(_ensemble_parts(found, rows)))]


def _ensemble_parts(found: Ensemble, rows: Sequence[Row], most_lines: int = 12) -> Iterator[Part]:
    keys, p = [s.key for s in found.spreads], found.strongest
    about_bands = (
        "Bands of the samples at each time, and bars of each line. The dark part contains half of "
        "the samples, light and dark together nine of ten. Each time and each line has its own "
        "band, so no single sample follows an edge."
    )
    about_maps = (
        "Percentiles of the RMS motion at each place, and the share of samples in which a place is "
        "above the detection threshold. Dotted: path of the focus."
    )
    about_tornado = (
        "One number at a time at its 5 % and 95 % quantiles, all others at their central values. "
        "The widest bar shows which number to measure first."
    )
    yield " ".join(sentences(found))
    yield Table(
        ["uncertain number", "central value", "distribution", "part", "source"],
        [(s.key, s.value, s.distribution.words, s.part, "preset" if s.implied else "scene")
         for s in found.spreads],
    )  # fmt: skip
    varied = ensemble(found.scene, found.spreads, one_at_a_time(found.spreads), found.method)
    bands = png(bands_figure(found, varied.waveform[0]))
    pictures = {"bands": Picture(bands, about_bands, "bands")}
    if found.has_map:
        pictures["maps"] = Picture(png(maps_figure(found)), about_maps, "bands-map")
    (rms, *_), ends = (name for name in rows[0] if name.startswith("rms_")), rows_of(varied)
    others = [name for name in ("level_db", "above_threshold_cm2") if name in rows[0]]
    outputs = [f"{rms}[{p}]", *others]
    charts = {axis_label(name): np.array([value(row, name) for row in ends]) for name in outputs}
    tornado = png(tornado_figure(charts, keys))
    pictures["one number at a time"] = Picture(tornado, about_tornado, "tornado")
    yield Choice("uncertainty", pictures)
    table, (x, y) = row_percentiles(rows), found.scene.probes[p]
    lines = [row for row in table.rows if row[1] is not None and row[2:4] == (1e3 * x, 1e3 * y)]
    lines = sorted(lines, key=lambda row: -row[MEDIAN])[:most_lines]
    yield Details("Percentiles of lines", [_with_labels(Table(table.columns, lines))])


def _with_labels(table: Table) -> Table:
    """Replace the names of quantities in the first column of a table by their labels."""
    rows = [(re.sub(r"[${}]", "", axis_label(name)), *row) for name, *row in table.rows]
    return Table([Column("quantity"), *table.columns[1:]], rows)


def sentences(found: Ensemble) -> list[str]:
    """State the method, the number of samples, and 90 % intervals of motion and level."""
    n, d = found.values.shape
    p, quantity = found.strongest, found.scene.reading.record
    x, y = (1e3 * z for z in found.scene.probes[p])
    low, _, median, _, high = quantity.per_unit * percentiles(found.rms)[:, p]
    text = [
        f"{n} samples of {plural(d, 'uncertain number')}, {found.method.words}.",
        f"RMS at ({x:g}, {y:g}) mm: median {significant(median)} {quantity.shown}, in nine of ten "
        f"samples {interval(low, high, 3)} {quantity.shown}.",
    ]
    if found.is_skin:
        levels = found.level.max(axis=1)
        low, _, median, _, high = percentiles(levels)
        text.append(
            f"Highest sensation level at a probe: median {round(median):+d} dB, in nine of ten "
            f"samples {round(low):+d} to {round(high):+d} dB; above threshold in "
            f"{percent((levels >= 0).mean())} of the samples."
        )
    return text


def write_uncertainty(
    out: Path, rows: Sequence[Row], spreads: Sequence[Spread], *, has_indices: bool
) -> list[str]:
    """Write the files of a sweep by distributions, and return their names.

    `rows` are in the order of the design. Sobol' indices need every run.
    """
    done = finished_rows(rows)
    failures = dataset.failures_of(rows)
    text = f"{len(done)} runs of {plural(len(spreads), 'uncertain number')}."
    numbers = [(s.key, f"{significant(s.value)}: {s.distribution.words}") for s in spreads]
    parts: list[Part] = [Table(["key", "distribution"], numbers)]
    table = row_percentiles(done)
    motion = [row for row in table.rows if row[0].startswith("rms_")]
    verdict = [text]
    if motion:
        name, _, x, y, low, _, median, _, high = max(motion, key=lambda row: row[MEDIAN])
        verdict.append(
            f"{axis_label(name)}, at ({x:g}, {y:g}) mm: median {significant(median)}, in nine of "
            f"ten runs {interval(low, high, 3)}."
        )
    files = {PERCENTILE_FILE: table.to_csv()}
    if has_indices and not failures:
        indices = index_table(rows, [s.key for s in spreads])
        files[INDEX_FILE] = indices.to_csv()
        about = (
            "Sobol' indices with half widths of 95 % intervals. First order: the share of the "
            "variance that vanishes if this number is known. Total: the share that remains if all "
            "others are known. If the first orders sum to more than 1 beyond their intervals, "
            "there are too few samples."
        )
        parts += [about, _with_labels(indices)]
    parts.append(Details("Percentiles at every probe", [_with_labels(table)]))
    page = Report(f"Uncertainty of {out.name}", verdict, parts, failures=failures)
    files[PAGE] = page.html().encode()
    dataset.write_beside(out, files)
    return list(files)


def index_table(rows: Sequence[Row], keys: Sequence[str]) -> Table:
    """Return Sobol' indices, with half widths of intervals, of scalar columns for each key."""
    found: list[tuple[object, ...]] = []
    names = ("rms_um", "level_db", "spread_6db_mm", "peak_um", "kernel_misfit", "kernel_rms_pa")
    for name in names:
        values = np.array([value(row, name) for row in rows])
        if np.isfinite(values).all():
            one = sobol_indices(values, len(keys))
            columns = (one.first, one.first_error, one.total, one.total_error)
            found += [(name, key, *each, one.n) for key, *each in zip(keys, *columns, strict=True)]
    shares = [
        Column(name, name.replace("_", " ").replace("95", "±"), digits=2)
        for name in ("first_order", "first_order_95", "total", "total_95")
    ]
    return Table(["column", "key", *shares, "samples"], found, stored=4)


def row_percentiles(rows: Sequence[Row]) -> Table:
    """Return percentiles at each probe of the columns that all rows have: motion, level, lines."""
    columns: list[Column | str] = [
        "column", Column("frequency_hz", "frequency", "Hz"), Column("probe_x_mm", "x", "mm"),
        Column("probe_y_mm", "y", "mm"), *(Column(f"p{k}", f"{k} %") for k in PERCENTILES),
    ]  # fmt: skip
    found: list[tuple[object, ...]] = []
    x, y = (rows[0][f"probe_{axis}_mm"] for axis in "xy")
    for column in dict.fromkeys(name for row in rows for name in row):
        cells = [row.get(column) for row in rows]
        is_left_out = "kernel" in column or column.startswith("probe_") or column.endswith("_ratio")
        if is_left_out or any(not isinstance(cell, list) or len(cell) != len(x) for cell in cells):
            continue
        values = np.array(cells, np.float64)
        if np.isfinite(values).all():
            lines = [n for n in rows[0] if n.endswith("_hz") and column.startswith(n[:-2])]
            frequency = rows[0][lines[0]] if lines else None
            for p, band in enumerate(percentiles(values).T.tolist()):
                found.append((column, frequency, x[p], y[p], *band))
    return Table(columns, found)
