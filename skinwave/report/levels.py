"""Spectral lines of a motion and the detection threshold (matplotlib)."""

import re
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from simple_model import sensation_level, threshold
from simple_model.drawing import small
from simple_model.quantities import DISPLACEMENT
from simple_model.threshold import BAND, HIGHEST, LOWEST
from skinwave.report.figures import answered
from skinwave.report.palette import colour, marker
from skinwave.report.styles import NARROW, Style
from skinwave.results.run import Run

LOWEST_LEVEL = -30.0  # dB re threshold, below which lines are left out
MOST_NAMED = 9  # lines of a panel
HEIGHT = 1.8  # of a name, which stands, over the size of its letters


def levels_figure(runs: Sequence[Run], probe: int, style: Style) -> Figure:
    """Amplitudes of the lines at one probe, named, over the threshold of detection by frequency;
    a panel for each run that moves a body; without the threshold where that is no skin.
    """
    runs = [run for run in runs if run.response.record.of_body]
    with mpl.rc_context(style.rc):
        count, narrow = max(len(runs), 1), style.is_narrow
        size = style.size(5.2 * count, 4.6)
        size = (size[0], 3.0 * count + 0.5) if narrow else size
        figure = Figure(figsize=size, layout="constrained")
        grid = (count, 1) if narrow else (1, count)
        axes = figure.subplots(*grid, sharex=True, sharey=True, squeeze=False).ravel()
        panel = 72 * size[0] / (1 if narrow else count) - 8 * style.font  # points
        for ax, run in zip(axes, runs, strict=False):
            _draw(ax, run, probe, HEIGHT * small() / panel * np.log(HIGHEST / LOWEST))
        _legend(figure, list(axes), runs)
        x, y = 1e3 * runs[0].response.probes[probe] if runs else (0.0, 0.0)
        asked = runs[0].response.record if runs else DISPLACEMENT
        between = "\n" if style.columns else " "  # letters of print are large beside its figures
        for ax in axes if narrow else axes[:1]:
            ax.set_ylabel(f"{asked.words}{between}at ({x:g}, {y:g}) mm, {asked.shown} peak")
    return figure


def strongest_probe(runs: Sequence[Run]) -> int:
    """The probe that moves most, over the largest of each run."""
    level = [np.ptp(run.response.values, axis=0) for run in runs]
    return int(np.argmax(sum(x / max(float(x.max()), 1e-300) for x in level)))


def sensation_levels(run: Run, probe: int) -> dict[str, float]:
    """Names of lines and their levels in dB above threshold at a probe, the highest first; none
    of what is no skin.
    """
    if not run.is_skin:
        return {}
    levels = {
        name: float(sensation_level(run.table.amplitudes[name][probe], frequency))
        for name, frequency in run.listed.items()
    }
    return dict(sorted(levels.items(), key=lambda item: -item[1]))


def _draw(ax: Axes, run: Run, probe: int, apart: float) -> None:
    if run.is_skin:
        _draw_threshold(ax)
    per = run.response.record.per_unit
    shown = _shown(run, probe)
    style: dict[str, Any] = {"color": colour(run.column), "marker": marker(run.column)}
    frequencies = np.array([run.listed[n] for n in shown])
    heights = np.array([per * run.table.amplitudes[n][probe] for n in shown])
    ax.vlines(frequencies, 1e-4, heights, color=colour(run.column), lw=1.2)
    ax.plot(frequencies, heights, ls="none", **style)
    for kind in dict.fromkeys(peak.kind for peak in run.unnamed):
        peaks = [(x.frequency, per * x.amplitudes[probe]) for x in run.unnamed if x.kind == kind]
        ax.plot(*np.transpose(peaks), ls="none", mfc="none", **style)
    for name in _named(run, shown, apart):
        ax.annotate(
            written(name), (run.listed[name], per * run.table.amplitudes[name][probe]), rotation=90,
            xytext=(0, 7), textcoords="offset points", ha="center", va="bottom", fontsize=small(),
        )  # fmt: skip
    ax.set(xscale="log", yscale="log", xlim=(LOWEST, HIGHEST), xlabel="frequency, Hz")
    if run.response.record is DISPLACEMENT:
        ax.set_ylim(2e-3, 3e3)
    ax.set_xticks([10, 30, 100, 300, 1000], ["10", "30", "100", "300", "1000"])
    ax.set_title(answered(run))
    ax.grid(alpha=0.25)


def _legend(figure: Figure, axes: Sequence[Axes], runs: Sequence[Run]) -> None:
    """The threshold and the kinds of unnamed peaks of all panels, below them."""
    entries = {label: handle for ax in axes
               for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}  # fmt: skip
    for kind in dict.fromkeys(peak.kind for run in runs for peak in run.unnamed):
        entries[f"open: {kind}"] = Line2D([], [], color="0.3", marker="o", mfc="none", ls="")
    if entries:
        narrow = figure.get_figwidth() < NARROW
        figure.legend(entries.values(), entries, loc="outside lower center", fontsize=small(),
                      ncols=1 if narrow else len(entries), frameon=False)  # fmt: skip


def _draw_threshold(ax: Axes) -> None:
    f = np.geomspace(LOWEST, HIGHEST, 300)
    curve = 1e6 * threshold(f)
    ax.plot(f, curve, color="0.45", lw=1.5, label="threshold for a focal spot")
    factor = 10 ** (BAND / 20)
    ax.fill_between(f, curve / factor, curve * factor, color="0.5", alpha=0.25, lw=0,
                    label=f"±{BAND:g} dB between people")  # fmt: skip


def _shown(run: Run, probe: int) -> list[str]:
    """Lines that are drawn, by sensation level or, on a sheet, by amplitude, the highest first."""
    if run.is_skin:
        return [n for n, level in sensation_levels(run, probe).items() if level > LOWEST_LEVEL]
    return sorted(run.listed, key=lambda name: -run.table.amplitudes[name][probe])


def _named(run: Run, shown: Sequence[str], apart: float) -> list[str]:
    """The highest lines within the axis whose names have room."""
    chosen: list[str] = []
    for name in shown:
        if not LOWEST <= run.listed[name] <= HIGHEST:
            continue
        near = (abs(np.log(run.listed[name] / run.listed[other])) for other in chosen)
        if len(chosen) < MOST_NAMED and all(distance > apart for distance in near):
            chosen.append(name)
    return chosen


def written(name: str) -> str:
    """A line's name as it is written in formulas."""
    name = re.sub(r"f_([A-Za-z0-9]+)", r"f_{\1}", name)
    return f"${name}$"
