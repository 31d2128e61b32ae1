"""Spectral lines of a motion and the detection threshold (matplotlib)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simple_model import sensation_level, threshold
from simple_model.drawing import small
from simple_model.quantities import DISPLACEMENT
from simple_model.threshold import BAND, HIGHEST, LOWEST
from skinwave.report.figures import answered, legend, styled, written
from skinwave.report.palette import drawn_as
from skinwave.report.styles import Style
from skinwave.results.run import Run

LOWEST_LEVEL = -30.0  # dB re threshold, below which lines are left out
MOST_NAMED = 9  # lines of a panel
HEIGHT = 1.8  # of a name, which stands, over the size of its letters
CURVE: dict[str, Any] = {"color": "0.45", "lw": 1.5}
AROUND: dict[str, Any] = {"color": "0.5", "alpha": 0.25}


@styled
def levels_figure(runs: Sequence[Run], probe: int, style: Style) -> Figure:
    """Amplitudes of the lines at one probe, named, over the threshold of detection by frequency;
    a panel for each run that moves a body; without the threshold where that is no skin.
    """
    runs = [run for run in runs if run.response.record.of_body]
    count, narrow = max(len(runs), 1), style.is_narrow
    size = style.size(5.2 * count, 4.6)
    size = (size[0], 3.0 * count + 0.5) if narrow else size
    figure = Figure(figsize=size, layout="constrained")
    grid = (count, 1) if narrow else (1, count)
    axes = figure.subplots(*grid, sharex=True, sharey=True, squeeze=False).ravel()
    panel = 72 * size[0] / grid[1] - 8 * style.font  # points
    for ax, run in zip(axes, runs, strict=False):
        _draw(ax, run, probe, HEIGHT * small() / panel * np.log(HIGHEST / LOWEST))
    entries: dict[str, dict[str, Any]] = {}
    if any(run.is_skin for run in runs):
        entries["threshold for a focal spot"] = CURVE
        entries[f"±{BAND:g} dB between people"] = {**AROUND, "lw": 6}
    for kind in dict.fromkeys(peak.kind for run in runs for peak in run.unnamed):
        entries[f"open: {kind}"] = {"color": "0.3", "marker": "o", "mfc": "none", "ls": ""}
    if entries:
        legend(figure, entries)
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
    """Lines by sensation level or, on a sheet, by amplitude, and names that have room `apart`."""
    amplitudes = {name: float(values[probe]) for name, values in run.table.amplitudes.items()}
    shown = sorted(run.listed, key=lambda name: -amplitudes[name])
    if run.is_skin:
        levels = sensation_levels(run, probe)
        shown = [name for name, level in levels.items() if level > LOWEST_LEVEL]
        f = np.geomspace(LOWEST, HIGHEST, 300)
        curve, factor = 1e6 * threshold(f), 10 ** (BAND / 20)
        ax.plot(f, curve, **CURVE)
        ax.fill_between(f, curve / factor, curve * factor, lw=0, **AROUND)
    per, style = run.response.record.per_unit, drawn_as(run.column)
    frequencies = np.array([run.listed[name] for name in shown])
    heights = per * np.array([amplitudes[name] for name in shown])
    ax.vlines(frequencies, 1e-4, heights, color=style["color"], lw=1.2)
    ax.plot(frequencies, heights, ls="none", **style)
    for peak in run.unnamed:
        ax.plot(peak.frequency, per * peak.amplitudes[probe], ls="none", mfc="none", **style)
    named = list[float]()
    for name, frequency, height in zip(shown, frequencies, heights, strict=True):
        near = any(abs(np.log(frequency / other)) <= apart for other in named)
        if LOWEST <= frequency <= HIGHEST and len(named) < MOST_NAMED and not near:
            named.append(frequency)
            ax.annotate(
                written(name), (frequency, height), rotation=90, xytext=(0, 7),
                textcoords="offset points", ha="center", va="bottom", fontsize=small(),
            )  # fmt: skip
    ax.set(xscale="log", yscale="log", xlim=(LOWEST, HIGHEST), xlabel="frequency, Hz")
    if run.response.record is DISPLACEMENT:
        ax.set_ylim(2e-3, 3e3)
    ax.set_xticks([10, 30, 100, 300, 1000], ["10", "30", "100", "300", "1000"])
    ax.set_title(answered(run))
    ax.grid(alpha=0.25)
