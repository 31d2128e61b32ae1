"""Sweeps of a scene in Python: the table of the command line as an object."""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simple_model import drawing
from simple_model.choices import choose
from simple_model.numbers import plural
from simple_model.response import library
from skinwave.models.options import SolveOptions
from skinwave.report.column_labels import axis_label
from skinwave.scene.file import dumps
from skinwave.scene.scene import Scene
from skinwave.scene.variation import Choice, Variation, cases_of, combinations, parse
from skinwave.sweeps import best, dataset
from skinwave.sweeps.sweep import Sweep
from skinwave.sweeps.table_figures import curves, finished_rows, value, varied_keys
from skinwave.system.effort import Progress
from skinwave.system.progress_bar import progress_callback
from skinwave.system.table import cell_text

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Values = Sequence[float | str] | str


@dataclass(frozen=True, kw_only=True, eq=False)
class SweepTable:
    """Table of a sweep.

    Parameters
    ----------
    rows : mapping by column, for each run, in the order of the design; a cell with a value for each
        probe is a list
    varied : keys that were varied

    >>> rows = [{"tacton.size_mm": d, "status": "done", "peak_um": [d / 2]} for d in (8, 10)]
    >>> table = SweepTable(rows=tuple(rows), varied=("tacton.size_mm",))
    >>> table
    <SweepTable: 2 runs over tacton.size_mm; 3 columns>
    >>> table["peak_um"]
    [[4.0], [5.0]]
    """

    rows: tuple[Mapping[str, Any], ...]
    varied: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns."""
        return tuple(dict.fromkeys(name for row in self.rows for name in row))

    @property
    def failed(self) -> tuple[str, ...]:
        """Error messages, one for each failed run."""
        return tuple(row["error"] for row in self.rows if row["status"] != "done")

    def __getitem__(self, column: str) -> list[Any]:
        """Return the cell of each run in a column; raise a ValueError for an unknown column."""
        choose("column", column, self.columns)
        return [row.get(column) for row in self.rows]

    def to_dataframe(self) -> pd.DataFrame:
        """Return a data frame of pandas with a row for each run; column names end in their unit."""
        return library("pandas").DataFrame([dict(row) for row in self.rows])

    def plot(
        self, column: str = "peak_um", x: str = "", by: str = "", *, ax: Axes | None = None
    ) -> Axes:
        """Draw a column over key `x`, with a curve for each value of key `by`.

        By default the keys are the varied ones. The column is that of the largest value over the
        probes or, as in "peak_um[2]", that of one probe.
        """
        choose("column", column.partition("[")[0], self.columns)
        x = x or self.varied[0]
        others = [key for key in self.varied if key != x]
        ax = drawing.new_axes(ax)
        curves(ax, finished_rows(self.rows), column, x, by or (others[0] if others else None))
        ax.set(xlabel=axis_label(x), ylabel=axis_label(column))
        return ax

    def __repr__(self) -> str:
        failed = f", {len(self.failed)} failed" * bool(self.failed)
        runs = f"{plural(len(self), 'run')} over {', '.join(self.varied)}"
        return f"<SweepTable: {runs}; {len(self.columns)} columns{failed}>"

    def _repr_html_(self) -> str:
        most_rows, results = 20, ("peak_um", "rms_um", "level_db", "expected_error")
        known = [name for name in results if name in self.columns]
        rows = [
            [*(cell_text(row.get(key)) for key in self.varied),
             *(cell_text(value(row, name)) for name in known)]
            for row in self.rows[:most_rows]
        ]  # fmt: skip
        image = b""
        if len(self.failed) < len(self):
            image = drawing.picture(lambda figure: self.plot(ax=figure.subplots()), 4.5, 3.0)
        table = drawing.table(rows, [*self.varied, *known])
        errors = tuple(dict.fromkeys(self.failed))
        return drawing.page(f"Sweep of {len(self)} runs", image, [table], errors)


def sweep(
    scene: Scene,
    vary: Mapping[str, Values],
    *,
    design: str = "factorial",
    samples: int | None = None,
    seed: int = 0,
    **options: Any,
) -> SweepTable:
    """Simulate a scene with various values of keys of its file; each body is reduced once.

    A run that fails is a row with its error.

    Parameters
    ----------
    scene : Scene
    vary : values by key, such as "tacton.speed_m_per_s"; or texts as for the option `--vary`,
        "1:12:12" or "normal(25e3,0.3)"
    design : "factorial", every value with every other; "zip", first with first; "lhs" or "sobol"
    samples : int, runs of "lhs", or rows of each matrix of "sobol"
    seed : int, of the samples
    **options
        model, tolerance, h and solver of every run, as in `skinwave.simulate`; `folder`, which
        stores the rows, so that an interrupted sweep resumes; `scheduler`, "threads", "processes"
        (a script needs a main guard), or the address of a Dask scheduler; `workers`, the number of
        runs at a time on this machine; `waveforms`, True to write these, too; `progress`, True for
        a bar, or a function of the name of the phase and the fraction done.

    Returns
    -------
    SweepTable

    Raises
    ------
    ValueError
        If a key or a value is not valid for a scene, or the extra "sweep" is not installed.

    Examples
    --------
    >>> import skinwave
    >>> scene = skinwave.loads("[body]\\nkind = 'none'\\n[tacton]\\nduration_s = 0.05")
    >>> table = skinwave.sweep(scene, {"focus.peak_pressure_pa": [20, 50]})
    >>> [round(p[0], 1) for p in table["kernel_peak_pa"]]
    [20.0, 50.0]
    """
    variations = [_variation(key, values) for key, values in vary.items()]
    combined = combinations(variations, design, samples, seed)
    with _sweep_of(scene, **options) as made:
        points = made.points(combined)
        if made.run(points).interrupted:
            raise KeyboardInterrupt
        rows = tuple(made.rows(points))
    return SweepTable(rows=rows, varied=tuple(v.key for v in variations))


def read_sweep(folder: str | Path) -> SweepTable:
    """Read the table of a sweep's folder, with the columns that its files have in their metadata.

    Raises a ValueError if the folder contains no rows of a sweep.
    """
    rows = tuple(dataset.read(Path(folder)))
    return SweepTable(rows=rows, varied=tuple(varied_keys(rows)))


def best_value(
    scene: Scene,
    vary: Mapping[str, Values],
    column: str,
    *,
    samples: int | None = None,
    seed: int = 0,
    **options: Any,
) -> best.Best:
    """Find the value of a key (`best_values`: of two) at which a column of the table is largest.

    Parameters
    ----------
    scene : Scene
    vary : one key and three or more of its numbers, as in `sweep`
    column : of the table, such as "level_db[0]"; without an index, the largest over the probes
    samples : int, samples of the spreads of the scene for the interval; 199 by default
    seed : int, of the samples
    **options
        As in `sweep`.

    Returns
    -------
    Best, whose `interval` contains the best values of 95 % of the samples

    Raises
    ------
    ValueError
        If several keys vary, if values or the column are not numbers, and as in `sweep`.

    Examples
    --------
    >>> import skinwave
    >>> scene = skinwave.loads("[body]\\nkind = 'none'\\n[tacton]\\nduration_s = 0.05")
    >>> vary = {"focus.peak_pressure_pa": [20, 35, 50]}
    >>> best = skinwave.best_value(scene, vary, "kernel_peak_pa")
    >>> best.value, best.is_at_end
    (50.0, True)
    """
    if len(vary) != 1:
        raise ValueError(f"best_value takes one key, not {len(vary)}; for two, use best_values")
    return best_values(scene, vary, column, samples=samples, seed=seed, **options)[0]


def best_values(
    scene: Scene,
    vary: Mapping[str, Values],
    column: str,
    *,
    samples: int | None = None,
    seed: int = 0,
    **options: Any,
) -> tuple[best.Best, ...]:
    """Return the Best of one or of two keys together; see `best_value`."""
    grids = best.check([_variation(key, values) for key, values in vary.items()], samples)
    with _sweep_of(scene, **options) as made:
        return best.find_best(made, grids, column, samples, seed)


@contextmanager
def _sweep_of(
    scene: Scene,
    *,
    model: str = "auto",
    tolerance: float = 0.05,
    h: float | None = None,
    solver: str = "auto",
    folder: str | Path | None = None,
    scheduler: str = "threads",
    workers: int | None = None,
    waveforms: bool = False,
    progress: Progress | bool | None = None,
) -> Iterator[Sweep]:
    """Yield the sweep of some options; without a folder, a temporary one."""
    table = tomllib.loads(dumps(scene))
    options = SolveOptions(model=model, tolerance=tolerance, h=h, solver=solver)
    with progress_callback(progress) as report, tempfile.TemporaryDirectory() as temporary:
        yield Sweep(
            folder=Path(temporary) / "sweep" if folder is None else Path(folder),
            points=partial(cases_of, table, table), options=options, progress=report,
            scheduler=scheduler, workers=workers, waveforms=waveforms,
        )  # fmt: skip


def _variation(key: str, values: Values) -> Variation:
    if isinstance(values, str):
        return parse(f"{key}={values}")
    checked = parse(f"{key}=0")  # raises for an unknown key
    # Convert numbers of numpy to those of a file.
    plain = (value.item() if hasattr(value, "item") else value for value in values)
    return Choice(key=checked.key, values=tuple(plain))
