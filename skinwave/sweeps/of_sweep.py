"""Percentiles, Sobol' indices and figures of a sweep whose numbers have distributions."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from meshes.tetmesh import Floats
from skinwave.report.figures import png
from skinwave.results.outputs import output_file
from skinwave.scene.variation import DesignPoint, Variation
from skinwave.sweeps import dataset
from skinwave.sweeps.dataset import Row
from skinwave.sweeps.ensemble_figures import distances_figure, indices_figure, tornado_figure
from skinwave.sweeps.indices import SobolIndices, Tornado, sobol_indices
from skinwave.sweeps.propagate import PERCENTILES, percentiles
from skinwave.sweeps.sweep_figures import axis_label, finished, value
from skinwave.system import document
from skinwave.system.numbers import significant
from skinwave.system.plain_text import csv_table

PERCENTILE_FILE, INDEX_FILE, PAGE = "percentiles.csv", "indices.csv", "uncertainty.html"
FILES = (PERCENTILE_FILE, INDEX_FILE, PAGE)
COLUMNS = ("column", "frequency_hz", "probe_x_mm", "probe_y_mm", *(f"p{k}" for k in PERCENTILES))
INDEX_COLUMNS = (
    "column", "key", "first_order", "first_order_95", "total", "total_95", "samples"
)  # fmt: skip
SCALARS = ("rms_um", "level_db", "spread_6db_mm", "peak_um", "kernel_misfit", "kernel_rms_pa")
SHOWN = 3  # outputs that have figures
OF_PROBES = ("rms_um", "level_db", "peak_um")
FIFTH = 0.2  # of the samples of a number, at each end, whose mean output is a tornado's
FEWEST = 20  # samples, of which a fifth has a mean
INDICES = (
    "Sobol' indices with 95 % intervals: of first order, the share of the variance that goes if a "
    "number becomes known; total, what is left if all others do. Bars longer than their sum "
    "allows are noise of too few samples."
)
TORNADO = (
    "Mean of each output over the fifth of the runs in which a number is least, and largest, all "
    "others varying."
)
DISTANCES = "Bands of half and nine of ten of the runs, at each probe."


@dataclass(frozen=True, kw_only=True)
class Sampled:
    """Rows of a sweep, in the order of its design; `variations` of their keys, and whether the
    design is that of Sobol' indices.
    """

    rows: Sequence[Row]
    variations: Sequence[Variation]
    has_indices: bool

    @property
    def keys(self) -> list[str]:
        """The keys that vary."""
        return [each.key for each in self.variations]


def in_order(
    rows: Sequence[Row], names: Mapping[str, DesignPoint], combined: Sequence[Mapping[str, Any]]
) -> list[Row]:
    """Row of each combination of values, in the order of its design; `names` of rows -> cases."""
    by_name = {row[dataset.KEY]: row for row in rows}
    by_values = {tuple(case.varied.items()): by_name[name] for name, case in names.items()}
    return [by_values[tuple(each.items())] for each in combined]


def refuse_changed(out: Path) -> None:
    """Refuse to replace files that are not as this program wrote them; raises a ValueError."""
    for name in FILES:
        dataset.refuse_changed(out, name)


def write(out: Path, found: Sampled) -> list[str]:
    """percentiles.csv, indices.csv and uncertainty.html in a sweep's folder; their names."""
    done = finished(found.rows)
    files = {PERCENTILE_FILE: csv_table(COLUMNS, _percentile_rows(done))}
    indices = indices_by_output(found) if found.has_indices else {}
    if indices:
        files[INDEX_FILE] = csv_table(INDEX_COLUMNS, _index_rows(indices, found.keys))
    files[PAGE] = document.page(f"Uncertainty of {out.name}", *_parts(found, indices)).encode()
    for name, content in files.items():
        dataset.refuse_changed(out, name)
        with output_file(out / name, overwrite=True) as file:
            file.write(content)
        dataset.enter(out, name)
    return list(files)


def indices_by_output(found: Sampled) -> dict[str, SobolIndices]:
    """Sobol' indices of the scalar columns that every run has; none if a run failed."""
    d = len(found.variations)
    if any(row.get("status") != "done" for row in found.rows):
        return {}
    outputs = {name: np.array([value(row, name) for row in found.rows]) for name in SCALARS}
    return {n: sobol_indices(y, d) for n, y in outputs.items() if np.isfinite(y).all()}


def tornadoes(found: Sampled) -> dict[str, Tornado]:
    """Means of scalar columns over the fifths of the runs in which each key is least and largest;
    of keys that are numbers.
    """
    done = finished(found.rows)
    numbers = np.array([[value(row, key) for key in found.keys] for row in done])
    if len(done) < FEWEST or not np.isfinite(numbers).all():
        return {}
    outputs = {name: np.array([value(row, name) for row in done]) for name in SCALARS}
    return {n: _tornado(numbers, y) for n, y in outputs.items() if np.isfinite(y).all()}


def _tornado(numbers: Floats, output: Floats) -> Tornado:
    part = max(1, round(FIFTH * len(output)))
    order = np.argsort(numbers, axis=0, kind="stable")
    return Tornado(
        centre=float(output.mean()),
        low=output[order[:part]].mean(axis=0),
        high=output[order[-part:]].mean(axis=0),
    )


def _parts(found: Sampled, indices: Mapping[str, SobolIndices]) -> Iterator[str]:
    done = finished(found.rows)
    failed = len(found.rows) - len(done)
    said = f"{len(done)} runs of {len(found.variations)} uncertain numbers."
    if failed:
        said += f" {failed} failed and are left out, of which percentiles know nothing."
    if found.has_indices and not indices:
        said += " Sobol' indices need every run of their design, so that there are none."
    yield document.paragraph(said)
    yield document.table(["key", "distribution"], ([v.key, _words(v)] for v in found.variations))
    columns = {name: _at_probes(done, name) for name in OF_PROBES}
    bands = {axis_label(n): percentiles(x) for n, x in columns.items() if x is not None}
    if bands:
        yield _picture("bands", distances_figure(_radii(done), bands), DISTANCES)
    if indices:
        shown = {axis_label(n): x for n, x in list(indices.items())[:SHOWN]}
        yield _picture("indices", indices_figure(shown, found.keys), INDICES)
    if charts := tornadoes(found):
        drawn = {axis_label(n): x for n, x in list(charts.items())[:SHOWN]}
        yield _picture("tornado", tornado_figure(drawn, found.keys, TORNADO_LEGEND), TORNADO)
    header = ["column", "frequency, Hz", "x, mm", "y, mm", *(f"{k} %" for k in PERCENTILES)]
    yield document.table(header, _percentile_rows(done))


TORNADO_LEGEND = ("fifth of the runs with the least", "fifth with the largest")


def _words(variation: Variation) -> str:
    if variation.distribution:
        return f"{significant(variation.centre)}: {variation.distribution.words}"
    if variation.bounds:
        low, high = variation.bounds
        return f"uniform, {low:g} to {high:g}"
    return f"any of {', '.join(map(str, variation.values))}"


def _picture(name: str, figure: Figure, caption: str) -> str:
    return document.picture(png(figure), caption, name)


def _at_probes(rows: Sequence[Row], column: str) -> Floats | None:
    """Values (n, p) of a column at probes that all rows have, if they do."""
    cells = [row.get(column) for row in rows]
    lengths = {len(cell) if isinstance(cell, list) else 0 for cell in cells}
    if len(lengths) != 1 or 0 in lengths:
        return None
    found = np.array(cells, np.float64)
    return found if np.isfinite(found).all() else None


def _radii(rows: Sequence[Row]) -> Floats:
    """Distances (p,) in mm of the probes from the origin."""
    return np.hypot(*(np.array(rows[0][f"probe_{axis}_mm"]) for axis in "xy"))


def _percentile_rows(rows: Sequence[Row]) -> Iterator[list[str]]:
    """Percentiles of what is known at all probes: motion, level, and each line."""
    lines = sorted(
        {n.removesuffix("_hz") for row in rows for n in row if n.endswith("_hz") and "." not in n}
    )
    lines = [name for name in lines if name != "drawing_frequency"]
    columns = [*OF_PROBES, *(f"{name}_{unit}" for name in lines for unit in ("um", "db"))]
    for column in columns:
        if (found := _at_probes(rows, column)) is None:
            continue
        name = column.rpartition("_")[0]
        at = f"{value(rows[0], f'{name}_hz'):.6g}" if name in lines else ""
        x, y = (rows[0][f"probe_{axis}_mm"] for axis in "xy")
        for p, band in enumerate(percentiles(found).T):
            yield [column, at, f"{x[p]:.6g}", f"{y[p]:.6g}", *(f"{v:.6g}" for v in band)]


def _index_rows(indices: Mapping[str, SobolIndices], keys: Sequence[str]) -> Iterator[list[str]]:
    for name, one in indices.items():
        columns = (one.first, one.first_error, one.total, one.total_error)
        for k, key in enumerate(keys):
            yield [name, key, *(f"{column[k]:.4g}" for column in columns), str(one.n)]
