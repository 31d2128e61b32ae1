"""Tables and page parts of uncertainty: of an ensemble of one scene, and of a sweep by
distributions.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from meshes.tetmesh import Floats
from simple_model.load.line_names import line_frequency
from simple_model.numbers import counted, interval, percent, significant
from skinwave.report.figures import png
from skinwave.scene.scene import Scene
from skinwave.scene.variation import Variation
from skinwave.sweeps import dataset
from skinwave.sweeps.dataset import Row
from skinwave.sweeps.ensemble import (
    HIGHEST_LEVEL,
    Ensemble,
    ensemble,
    outputs,
    propagate,
    solve,
)
from skinwave.sweeps.sampling import (
    PERCENTILES,
    SobolIndices,
    Tornado,
    percentiles,
    sobol_indices,
    tornado,
    tornado_of_fifths,
)
from skinwave.sweeps.table_figures import axis_label, finished, value
from skinwave.sweeps.uncertainty_figures import (
    bands_figure,
    distances_figure,
    indices_figure,
    maps_figure,
    tornado_figure,
)
from skinwave.system.document import Part, Picture, Report, Section
from skinwave.system.effort import Progress
from skinwave.system.table import Column, Table

BANDS = (
    "Bands of the samples at each time, and bars of each line: half of the samples within the dark "
    "part, nine of ten within all of it. Bands are of one time or one line each: no single sample "
    "follows their edge."
)
MAPS = (
    "Percentiles of the RMS motion at each place, and how many samples have a place above the "
    "threshold of detection; dotted: the path of the focus."
)
ONE_AT_A_TIME = (
    "One number at a time at the ends of the 90 % about its median, all others at their central "
    "values: the widest bar is what is worth measuring first."
)
DISTANCES = "Bands of half and nine of ten of the runs, at each probe."
INDICES = (
    "Sobol' indices with 95 % intervals: of first order, the share of the variance that goes if a "
    "number becomes known; total, what is left if all others do. Bars longer than their sum "
    "allows are noise of too few samples."
)
FIFTHS = (
    "Mean of each output over the fifth of the runs in which a number is least, and largest, all "
    "others varying."
)
NAMED = 12  # lines of the table on a page
P_COLUMNS = [Column(f"p{k}", f"{k} %") for k in PERCENTILES]
PERCENTILE_FILE, INDEX_FILE, PAGE = "percentiles.csv", "indices.csv", "uncertainty.html"
SAMPLED_FILES = (PERCENTILE_FILE, INDEX_FILE, PAGE)
SCALARS = ("rms_um", "level_db", "spread_6db_mm", "peak_um", "kernel_misfit", "kernel_rms_pa")
OF_PROBES = ("rms_um", "level_db", "peak_um")
SHOWN = 3  # outputs that have figures
FEWEST = 20  # runs, of which a fifth has a mean


def write_ensemble(
    folder: Path,
    scene: Scene,
    n: int,
    model: str,
    progress: Progress,
    *,
    h: float | None = None,
    solver: str = "auto",
    seed: int = 0,
    workers: int = 1,
) -> list[Part]:
    """Write percentiles.csv and samples.csv of an ensemble; return the parts of its page.

    Parameters
    ----------
    folder : that exists
    scene, n, model, h, solver, seed, workers, progress : as for `propagate`

    Raises
    ------
    ValueError
        As `propagate` does.
    """
    found = propagate(
        scene, n, model=model, h=h, solver=solver, seed=seed, workers=workers, progress=progress
    )
    scalars = outputs(found)
    rows = np.column_stack([found.values, *scalars.values()]).tolist()
    samples = Table([*(s.key for s in found.spreads), *scalars], rows, stored=9)
    (folder / PERCENTILE_FILE).write_bytes(ensemble_percentiles(found).to_csv())
    (folder / "samples.csv").write_bytes(samples.to_csv())
    return [Section("Uncertainty", list(_ensemble_parts(found)))]


def _ensemble_parts(found: Ensemble) -> Iterator[Part]:
    keys = [s.key for s in found.spreads]
    yield " ".join(sentences(found))
    yield spread_table(found)
    centre = solve(found.scene, found.method).waveform
    yield Picture(png(bands_figure(found, centre)), BANDS, "bands")
    if found.has_map:
        yield Picture(png(maps_figure(found)), MAPS, "bands-map")

    def evaluate(values: Floats) -> Mapping[str, Floats]:
        return outputs(ensemble(found.scene, found.spreads, values, found.method))

    charts = list(tornado(evaluate, found.spreads).items())
    p, probes = strongest(found), len(found.scene.probes)
    shown = dict([charts[p], *charts[probes:]])  # of the probe that moves most, and of no probe
    yield Picture(png(tornado_figure(shown, keys)), ONE_AT_A_TIME, "tornado")
    yield line_table(found)


def sentences(found: Ensemble) -> list[str]:
    """Number of samples and method, and the 90 % of the motion and of its level."""
    n, d = found.values.shape
    p, asked = strongest(found), found.scene.reading.asked
    x, y = (1e3 * z for z in found.scene.probes[p])
    low, _, median, _, high = asked.per_unit * percentiles(found.rms)[:, p]
    said = [
        f"{n} samples of {counted(d, 'uncertain number')}, {found.method.words}.",
        f"RMS at ({x:g}, {y:g}) mm: {significant(median)} {asked.shown}, in nine of ten "
        f"{interval(low, high, 3)}.",
    ]
    levels = outputs(found).get(HIGHEST_LEVEL)
    if levels is not None:
        low, _, median, _, high = percentiles(levels)
        said.append(
            f"Highest sensation level at a probe: {median:+.0f} dB, in nine of ten {low:+.0f} to "
            f"{high:+.0f} dB; above threshold in {percent((levels >= 0).mean())} of the samples."
        )
    return said


def strongest(found: Ensemble) -> int:
    """The probe of largest median RMS."""
    return int(np.argmax(np.median(found.rms, axis=0)))


def spread_table(found: Ensemble) -> Table:
    """The uncertain numbers, each with its distribution and its source."""
    header = ["uncertain number", "central value", "distribution", "part", "given by"]
    rows = [
        (s.key, s.value, s.distribution.words, s.part,
         "the preset's sources" if s.implied else "the scene")
        for s in found.spreads
    ]  # fmt: skip
    return Table(header, rows)


def line_table(found: Ensemble) -> Table:
    """Percentiles of the lines at the probe that moves most, the strongest first."""
    p, asked = strongest(found), found.scene.reading.asked
    bands = asked.per_unit * percentiles(found.lines)[..., p]
    names, tacton = found.method.lines, found.scene.tacton
    x, y = (1e3 * z for z in found.scene.probes[p])
    rows = [
        (names[k], f"{line_frequency(tacton, names[k]) or 0.0:.1f}", *bands[:, k].tolist())
        for k in np.argsort(-bands[2])[:NAMED]
    ]
    shown = [Column(c.name, c.heading, asked.shown) for c in P_COLUMNS]
    return Table([f"line at ({x:g}, {y:g}) mm", "frequency, Hz", *shown], rows)


def ensemble_percentiles(found: Ensemble) -> Table:
    """Percentiles of each line, of the RMS and, of skin, of the sensation level at each probe."""
    asked, tacton = found.scene.reading.asked, found.scene.tacton
    rms, level = asked.per_unit * percentiles(found.rms), percentiles(found.level)
    lines = asked.per_unit * percentiles(found.lines)
    rows: list[tuple[object, ...]] = []
    for p, (x, y) in enumerate(found.scene.probes):
        where = 1e3 * x, 1e3 * y
        for k, name in enumerate(found.method.lines):
            f = line_frequency(tacton, name) or 0.0
            rows.append((name, f, asked.shown, *where, *lines[:, k, p].tolist()))
        rows.append(("rms", None, asked.shown, *where, *rms[:, p].tolist()))
        if found.is_skin:
            rows.append(("sensation level", None, "dB", *where, *level[:, p].tolist()))
    names = ("what", "frequency_hz", "unit", "probe_x_mm", "probe_y_mm")
    return Table([*map(Column, names), *P_COLUMNS], rows)


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


def write_sampled(out: Path, found: Sampled) -> list[str]:
    """percentiles.csv, indices.csv and uncertainty.html in a sweep's folder; their names."""
    done = finished(found.rows)
    indices = indices_by_output(found) if found.has_indices else {}
    files = {PERCENTILE_FILE: row_percentiles(done).to_csv()}
    if indices:
        files[INDEX_FILE] = index_table(indices, found.keys).to_csv()
    page = Report(f"Uncertainty of {out.name}", (), list(_sampled_parts(found, done, indices)))
    files[PAGE] = page.html().encode()
    dataset.write_beside(out, files)
    return list(files)


def indices_by_output(found: Sampled) -> dict[str, SobolIndices]:
    """Sobol' indices of the scalar columns that every run has; none if a run failed."""
    d = len(found.variations)
    if any(row.get("status") != "done" for row in found.rows):
        return {}
    return {name: sobol_indices(y, d) for name, y in _scalars(found.rows).items()}


def tornadoes(found: Sampled) -> dict[str, Tornado]:
    """Means of scalar columns over the fifths of the runs in which each key is least and largest;
    of keys that are numbers.
    """
    done = finished(found.rows)
    numbers = np.array([[value(row, key) for key in found.keys] for row in done])
    if len(done) < FEWEST or not np.isfinite(numbers).all():
        return {}
    return {name: tornado_of_fifths(numbers, y) for name, y in _scalars(done).items()}


def _scalars(rows: Sequence[Row]) -> dict[str, Floats]:
    """Scalar columns (n,) by name, of which every row has a number."""
    found = {name: np.array([value(row, name) for row in rows]) for name in SCALARS}
    return {name: y for name, y in found.items() if np.isfinite(y).all()}


def _sampled_parts(
    found: Sampled, done: Sequence[Row], indices: Mapping[str, SobolIndices]
) -> Iterator[Part]:
    said = f"{len(done)} runs of {counted(len(found.variations), 'uncertain number')}."
    if failed := len(found.rows) - len(done):
        said += f" {failed} failed and are left out of the percentiles."
    if found.has_indices and not indices:
        said += " Sobol' indices need every run of their design, so that there are none."
    yield said
    yield Table(["key", "distribution"], [(v.key, _words(v)) for v in found.variations])
    columns = {name: _at_probes(done, name) for name in OF_PROBES}
    bands = {axis_label(n): percentiles(x) for n, x in columns.items() if x is not None}
    if bands:
        radii = np.hypot(*(np.array(done[0][f"probe_{axis}_mm"]) for axis in "xy"))
        yield Picture(png(distances_figure(radii, bands)), DISTANCES, "bands")
    if indices:
        shown = {axis_label(n): x for n, x in list(indices.items())[:SHOWN]}
        yield Picture(png(indices_figure(shown, found.keys)), INDICES, "indices")
    if charts := tornadoes(found):
        drawn = {axis_label(n): x for n, x in list(charts.items())[:SHOWN]}
        ends = ("fifth of the runs with the least", "fifth with the largest")
        yield Picture(png(tornado_figure(drawn, found.keys, ends)), FIFTHS, "tornado")
    yield row_percentiles(done)


def _words(variation: Variation) -> str:
    if variation.distribution:
        return f"{significant(variation.centre)}: {variation.distribution.words}"
    if variation.bounds:
        low, high = variation.bounds
        return f"uniform, {low:g} to {high:g}"
    return f"any of {', '.join(map(str, variation.values))}"


def _at_probes(rows: Sequence[Row], column: str) -> Floats | None:
    """Values (n, p) of a column at probes that all rows have, if they do."""
    cells = [row.get(column) for row in rows]
    lengths = {len(cell) if isinstance(cell, list) else 0 for cell in cells}
    if len(lengths) != 1 or 0 in lengths:
        return None
    found = np.array(cells, np.float64)
    return found if np.isfinite(found).all() else None


def row_percentiles(rows: Sequence[Row]) -> Table:
    """Percentiles of what all rows have at all probes: motion, level, and each line."""
    lines = sorted(
        {n.removesuffix("_hz") for row in rows for n in row if n.endswith("_hz") and "." not in n}
        - {"drawing_frequency"}
    )
    found: list[tuple[object, ...]] = []
    for column in (*OF_PROBES, *(f"{name}_{unit}" for name in lines for unit in ("um", "db"))):
        if (values := _at_probes(rows, column)) is None:
            continue
        name = column.rpartition("_")[0]
        at = value(rows[0], f"{name}_hz") if name in lines else None
        x, y = (rows[0][f"probe_{axis}_mm"] for axis in "xy")
        for p, band in enumerate(percentiles(values).T.tolist()):
            found.append((column, at, x[p], y[p], *band))
    where = [Column("probe_x_mm", "x", "mm"), Column("probe_y_mm", "y", "mm")]
    return Table(["column", Column("frequency_hz", "frequency", "Hz"), *where, *P_COLUMNS], found)


def index_table(indices: Mapping[str, SobolIndices], keys: Sequence[str]) -> Table:
    """Sobol' indices of each output and key, with the half widths of their intervals."""
    rows = [
        (name, key, *(float(each[k]) for each in (i.first, i.first_error, i.total, i.total_error)),
         i.n)
        for name, i in indices.items()
        for k, key in enumerate(keys)
    ]  # fmt: skip
    header = ["column", "key", "first_order", "first_order_95", "total", "total_95", "samples"]
    return Table(header, rows, stored=4)
