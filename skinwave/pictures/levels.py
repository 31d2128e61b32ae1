"""Spectral lines of a motion and the detection threshold (matplotlib)."""

import re
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simple_model import sensation_level, threshold
from simple_model.quantities import DISPLACEMENT
from simple_model.threshold import BAND, HIGHEST, LOWEST
from skinwave.pictures.figures import answered, colour, marker
from skinwave.pictures.styles import NARROW, Style
from skinwave.run import Run

LOWEST_LEVEL = -30.0  # dB re threshold, below which lines are left out
MOST_NAMED = 9  # lines of a panel
APART = 0.13  # of the frequency, within which two names would be drawn over each other


def levels_figure(runs: Sequence[Run], probe: int, style: Style) -> Figure:
    """Amplitudes of the lines at one probe, named, over the threshold of detection by frequency;
    a panel for each run that moves a body; without the threshold where that is no skin.
    """
    runs = [run for run in runs if run.response.record.of_body]
    with mpl.rc_context(style.rc):
        count, narrow = max(len(runs), 1), style.is_narrow
        size = (style.size(1, 1)[0], 3.0 * count) if narrow else style.size(5.2 * count, 4.4)
        figure = Figure(figsize=size, layout="constrained")
        grid = (count, 1) if narrow else (1, count)
        axes = figure.subplots(*grid, sharex=True, sharey=True, squeeze=False).ravel()
        for ax, run in zip(axes, runs, strict=False):
            _draw(ax, run, probe)
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


def _draw(ax: Axes, run: Run, probe: int) -> None:
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
        ax.plot(*np.transpose(peaks), ls="none", mfc="none", label=kind, **style)
    apart = APART * (2 if ax.figure.get_figwidth() < NARROW else 1)  # type: ignore[union-attr]
    for name in _named(run, shown, apart):
        ax.annotate(
            written(name), (run.listed[name], per * run.table.amplitudes[name][probe]), rotation=90,
            xytext=(0, 7), textcoords="offset points", ha="center", va="bottom", fontsize="small",
        )  # fmt: skip
    ax.set(xscale="log", yscale="log", xlim=(LOWEST, HIGHEST), xlabel="frequency, Hz")
    if run.response.record is DISPLACEMENT:
        ax.set_ylim(2e-3, 3e3)
    ax.set_xticks([10, 30, 100, 300, 1000], ["10", "30", "100", "300", "1000"])
    ax.set_title(answered(run))
    ax.grid(alpha=0.25)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc="upper left", fontsize="small", frameon=False)


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
    """The highest lines whose names have room."""
    chosen: list[str] = []
    for name in shown:
        near = (abs(np.log(run.listed[name] / run.listed[other])) for other in chosen)
        if len(chosen) < MOST_NAMED and all(distance > apart for distance in near):
            chosen.append(name)
    return chosen


def written(name: str) -> str:
    """A line's name as it is written in formulas."""
    name = re.sub(r"f_([A-Za-z0-9]+)", r"f_{\1}", name)
    return f"${name}$"
