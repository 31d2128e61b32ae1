"""Figures of a sweep: a column over one or two varied keys (matplotlib)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from simple_model.choices import choose
from simple_model.drawing import small
from simple_model.threshold import BAND
from skinwave.report.column_labels import at_probe, axis_label, column_unit
from skinwave.report.figures import with_style
from skinwave.report.styles import Style
from skinwave.sweeps.dataset import Row


def varied_keys(rows: Sequence[Row]) -> list[str]:
    """Return the keys that differ between rows, those with the most values first."""
    keys = [key for key in dict.fromkeys(k for row in rows for k in row) if "." in key]
    counts = {key: len({row.get(key) for row in rows}) for key in keys}
    several = [key for key in keys if counts[key] > 1]
    own = [key for key in several if not any(other.startswith(f"{key}.") for other in several)]
    return sorted(own, key=lambda key: -counts[key])


def finished_rows(rows: Sequence[Row]) -> list[Row]:
    """Return the rows with a response; raise a ValueError if all runs failed."""
    done = [row for row in rows if row.get("status") == "done"]
    if not done:
        raise ValueError(f"all {len(rows)} runs failed; the first one: {rows[0].get('error')}")
    return done


def value(row: Row, column: str) -> float:
    """Return a cell as a number: the largest over the probes or, as in `name[2]`, of one."""
    name, probe = at_probe(column)
    cells = row.get(name)
    if not isinstance(cells, list):
        cells = [cells]
    elif probe is not None:
        cells = cells[probe : probe + 1]
    numbers = [float(x) if isinstance(x, int | float) else np.nan for x in cells]
    return float(np.max(numbers)) if numbers else np.nan


@with_style
def line_figure(rows: Sequence[Row], column: str, x: str, by: str | None, style: Style) -> Figure:
    """Draw a column over key x, with a curve for each value of key `by`, as `curves`.

    Figures of levels show the detection threshold, those over drawing speed the speed of surface
    waves. Raises a ValueError if the column has no numbers.
    """
    _check(rows, (column, x, *([by] if by else [])))
    figure = Figure(figsize=style.size(6.4, 4.4), layout="constrained")
    ax = figure.subplots()
    if at_probe(column)[0].endswith("_db"):
        ax.axhspan(-BAND, BAND, color="0.5", alpha=0.25, lw=0,
                   label=f"threshold, ±{BAND:g} dB between people")  # fmt: skip
    waves = {value(row, "rayleigh_speed_m_per_s") for row in rows}
    waves = waves if x == "tacton.speed_m_per_s" else set()
    for k, wave in enumerate(sorted(filter(np.isfinite, waves))):
        label = "_" if k else "Rayleigh speed $c_R$ without loss"
        ax.axvline(wave, color="0.4", ls="--", lw=1.2, label=label)
    curves(ax, rows, column, x, by)
    ax.set(xlabel=axis_label(x), ylabel=axis_label(column))
    return figure


@with_style
def heat_figure(
    rows: Sequence[Row], column: str, x: str, y: str, style: Style, least_filled: float = 0.5
) -> Figure:
    """Draw a map of a column over two keys: cells are means of runs, or empty.

    Raises a ValueError if the column has no numbers, or if less than the share `least_filled` of
    the cells has a run.
    """
    _check(rows, (column, x, y))
    across, up = _levels(rows, x), _levels(rows, y)
    cells: dict[tuple[int, int], list[float]] = {}
    for row in rows:
        where = up.index(_plain(row.get(y))), across.index(_plain(row.get(x)))
        cells.setdefault(where, []).append(value(row, column))
    if len(cells) < least_filled * len(across) * len(up):
        raise ValueError(f"the runs do not lie on a grid of {x} and {y}; remove --heat")
    table = np.full((len(up), len(across)), np.nan)
    for where, values in cells.items():
        table[where] = np.mean(values)
    figure = Figure(figsize=style.size(6.4, 4.8), layout="constrained")
    ax = figure.subplots()
    drawn = np.where(np.isfinite(table), table, np.nan)
    image = ax.pcolormesh(drawn, cmap="viridis", edgecolors="face", linewidth=0.3)
    most_ticks = 12
    for axis, levels in ((ax.xaxis, across), (ax.yaxis, up)):
        step = -(-len(levels) // most_ticks)  # names in the middle of cells
        names = [f"{x:g}" if isinstance(x, float) else str(x) for x in levels[::step]]
        axis.set_ticks(np.arange(0, len(levels), step) + 0.5, names)
    ax.set(xlabel=axis_label(x), ylabel=axis_label(y))
    figure.colorbar(image, ax=ax, label=axis_label(column))
    return figure


@with_style
def best_figure(rows: Sequence[Row], bests: Sequence[Any], style: Style) -> Figure:
    """Draw the column of a search over its one or two keys, with each `Best`, their intervals and,
    over two keys, the best values of the samples as dots.
    """
    column, keys = bests[0].column, [best.key for best in bests]
    names, at = [*keys, column][:2], [*(best.value for best in bests), bests[0].result][:2]
    figure = Figure(figsize=style.size(6.4, 4.6), layout="constrained")
    ax = figure.subplots()
    if len(keys) == 1:
        curves(ax, rows, column, keys[0], None)
    else:
        cells = np.array([[value(row, name) for name in (*keys, column)] for row in rows])
        x, y, z = cells[np.isfinite(cells).all(axis=1)].T
        levels = ax.tricontourf(x, y, z, levels=20, cmap="viridis")
        figure.colorbar(levels, ax=ax, label=axis_label(column))
        ax.plot(*(best.drawn for best in bests), "w.", ms=3, alpha=0.6)
    for k, best in enumerate(bests):
        ends = np.array([at, at])
        ends[:, k] = best.interval or best.value
        ax.plot(*ends.T, "r.-", lw=1)
    ax.plot(*at, "r*", ms=9, label="best" + ", 95 % interval" * bool(bests[0].interval))
    ax.legend(fontsize=small())
    ax.set(xlabel=axis_label(names[0]), ylabel=axis_label(names[1]))
    return figure


def curves(ax: Axes, rows: Sequence[Row], column: str, x: str, by: str | None) -> None:
    """Draw a curve for each value of key `by`: mean and range of the runs at a value of key x.

    Draw points if other keys vary and each pair of values occurs once, as in a Latin hypercube.
    """
    groups = _levels(rows, by) if by else [None]
    words = not isinstance(_levels(rows, x)[0], float)
    markers = "osD^vP*X"  # more curves of numbers have a colour bar in place of a legend
    many = len(groups) > len(markers) and all(isinstance(group, float) for group in groups)
    scale = ScalarMappable(Normalize(groups[0], groups[-1]) if many else None, "viridis")
    colours = (
        scale.to_rgba(np.array(groups)) if many else scale.cmap(np.linspace(0, 0.88, len(groups)))
    )
    # Neighbours along a curve are joined if they differ by nothing else, or by its mean.
    pairs = {(_plain(row.get(x)), _plain(row.get(by)) if by else None) for row in rows}
    joined = len(pairs) < len(rows) or not set(varied_keys(rows)) - {x, by}
    for k, group in enumerate(groups):
        mine = [row for row in rows if by is None or _plain(row.get(by)) == group]
        at = _levels(mine, x)
        groups_at = [[value(r, column) for r in mine if _plain(r.get(x)) == level] for level in at]
        places = np.arange(len(at)) if words else np.array(at)
        mean, low, high = (np.array([f(v) for v in groups_at]) for f in (np.mean, np.min, np.max))
        label = None if by is None or many else _with_unit(by, group)
        ax.plot(places, np.where(np.isfinite(mean), mean, np.nan), color=colours[k],
                marker="o" if many else markers[k % len(markers)], ms=4, lw=1.5,
                ls="solid" if joined else "none", label=label)  # fmt: skip
        if max(map(len, groups_at)) > 1:
            ax.fill_between(places, low, high, color=colours[k], alpha=0.15, lw=0)
    if words:
        ax.set_xticks(range(len(at)), [str(level) for level in at])
    if by is not None and many:
        ax.figure.colorbar(scale, ax=ax, label=axis_label(by))
    if ax.get_legend_handles_labels()[1]:
        ax.legend(fontsize=small(), frameon=False)
    ax.grid(alpha=0.25)


def _with_unit(key: str, level: Any) -> str:
    name = axis_label(key).rpartition(", ")[0] or axis_label(key)
    text = f"{level:g}" if isinstance(level, float) else str(level)
    return f"{name} {text} {column_unit(key)}".strip()


def _check(rows: Sequence[Row], columns: Sequence[str]) -> None:
    for column in columns:
        choose("column", at_probe(column)[0], dict.fromkeys(name for row in rows for name in row))
    if not any(np.isfinite(value(row, columns[0])) for row in rows):
        raise ValueError(f"column '{columns[0]}' has no finite number to draw; choose another")


def _levels(rows: Sequence[Row], key: str | None) -> list[Any]:
    levels = {_plain(row.get(key)) for row in rows} if key else set()
    return sorted(levels, key=lambda level: (not isinstance(level, float), level))


def _plain(cell: Any) -> Any:
    return "none" if cell is None else cell
