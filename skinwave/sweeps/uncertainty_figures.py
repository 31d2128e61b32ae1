"""Figures of an ensemble (matplotlib): bands of waveforms and lines, maps, tornado charts."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simple_model import threshold
from simple_model.load.line_names import line_frequency
from skinwave.report.figures import REPORT, line_symbol, with_style
from skinwave.report.palette import SEQUENTIAL, SERIES
from skinwave.report.spectra import HIGHEST_SHOWN
from skinwave.results.views import path_points
from skinwave.sweeps.ensemble import Ensemble, waveform_times
from skinwave.sweeps.sampling import ENDS, PERCENTILES, percentiles
from skinwave.typing import Floats

BAND, CENTRE = SERIES[:2]


@with_style
def bands_figure(found: Ensemble, centre: Floats) -> Figure:
    """Draw waveforms and lines at each probe: median, bands of 50 and 90 % of the samples, and the
    waveform `centre` (t, p) of the central values.
    """
    quantity, probes = found.scene.reading.record, found.scene.probes
    times = 1e3 * waveform_times(found.scene)
    waveforms, lines = (quantity.per_unit * percentiles(x) for x in (found.waveform, found.lines))
    figure = Figure(figsize=REPORT.size(10.5, 1.7 * len(probes) + 1.3), layout="constrained")
    axes = figure.subplots(len(probes), 2, sharex="col", sharey="col", squeeze=False)
    for p, ((x, y), (left, right)) in enumerate(zip(probes, axes, strict=True)):
        low, lower, median, upper, high = waveforms[..., p]
        left.fill_between(times, low, high, color=BAND, alpha=0.22, lw=0, label="90 %")
        left.fill_between(times, lower, upper, color=BAND, alpha=0.4, lw=0, label="50 % of samples")
        left.plot(times, median, color=BAND, lw=1.2, label="median")
        central = quantity.per_unit * centre[:, p]
        left.plot(times, central, color=CENTRE, lw=1, label="central values")
        left.margins(x=0)
        left.grid(alpha=0.25)
        left.set_ylabel(f"({1e3 * x:g}, {1e3 * y:g}) mm", fontweight="bold")
        _lines(right, found, lines[..., p], named=p == found.strongest)
    axes[0, 0].set_title(f"{quantity.words} about its mean, {quantity.shown}", fontsize="medium")
    axes[0, 1].set_title(f"lines, {quantity.shown} peak", fontsize="medium")
    axes[-1, 0].set_xlabel("time, ms")
    axes[-1, 1].set_xlabel("frequency, Hz")
    handles = [h for ax in axes[0] for h in ax.get_legend_handles_labels()[0]]
    figure.legend(handles=handles, loc="outside upper center", ncols=5, frameon=False)
    return figure


def _lines(ax: Axes, found: Ensemble, bands: Floats, *, named: bool) -> None:
    """Draw bars (5, f) of lines over their central frequency."""
    tacton, names = found.scene.tacton, found.method.lines
    f = np.array([line_frequency(tacton, name) or np.nan for name in names])
    low, lower, median, upper, high = np.maximum(bands, 1e-12)
    ax.vlines(f, low, high, color=BAND, alpha=0.6, lw=1.2)
    ax.vlines(f, lower, upper, color=BAND, lw=3.5)
    ax.plot(f, median, "o", color="white", mec=BAND, ms=4)
    ax.set_yscale("log")
    top = float(median.max(initial=1e-9))
    ax.set_ylim(1e-3 * top, 30 * top)
    ax.set_xlim(0, HIGHEST_SHOWN)
    if found.is_skin:
        grid = np.geomspace(max(10.0, np.nanmin(f) / 1.2), min(1000.0, np.nanmax(f) * 1.2), 200)
        ax.plot(grid, 1e6 * threshold(grid), color="0.45", lw=1.2, zorder=0,
                label="detection threshold")  # fmt: skip
    ax.grid(alpha=0.25)
    if named:
        most_named, order = 8, [k for k in np.argsort(-median) if f[k] < HIGHEST_SHOWN]
        for k in order[:most_named]:
            ax.annotate(line_symbol(names[k]), (f[k], high[k]), xytext=(0, 3), ha="center",
                        rotation=90, textcoords="offset points", va="bottom",
                        fontsize="x-small")  # fmt: skip


@with_style
def maps_figure(found: Ensemble) -> Figure:
    """Draw maps of the RMS motion, percentiles 5, 50 and 95 on one colour scale, and on skin a map
    of the share of samples above the detection threshold.
    """
    bands, deepest = percentiles(found.map_rms), -30.0  # dB, below the largest median
    top = max(float(bands[2].max()), 1e-300)
    x, y = (1e3 * axis for axis in found.method.map_axes(found.scene))
    half = 1e3 * found.method.step / 2
    extent: Any = (x[0] - half, x[-1] + half, y[0] - half, y[-1] + half)
    show = partial(Axes.imshow, origin="lower", extent=extent, cmap=SEQUENTIAL,
                   interpolation="bilinear")  # fmt: skip
    figure = Figure(figsize=REPORT.size(10.5, 3.2), layout="constrained")
    axes = figure.subplots(1, 3 + found.is_skin, sharey=True)
    for ax, k in zip(axes, (0, 2, 4), strict=False):
        level = 20 * np.log10(np.maximum(bands[k] / top, 1e-12))
        image = show(ax, level, vmin=deepest, vmax=-deepest / 2)
        title = "median" if k == 2 else f"{PERCENTILES[k]} % of samples are below"
        ax.set_title(title, fontsize="medium")
    figure.colorbar(image, ax=list(axes[:3]), shrink=0.8, label="RMS, dB re largest median")
    if found.is_skin:
        share = 100 * (found.map_level >= 0).mean(axis=0)
        image = show(axes[-1], share, vmin=0.0, vmax=100.0)
        axes[-1].contour(x, y, share, levels=[50.0], colors="white", linewidths=1)
        axes[-1].set_title("above threshold, % of samples", fontsize="medium")
        figure.colorbar(image, ax=axes[-1], shrink=0.8)
    for ax in axes:
        ax.plot(*1e3 * path_points(found.scene).T, color="white", lw=0.8, ls=":")
        ax.set_xlabel("x, mm")
    axes[0].set_ylabel("y, mm")
    return figure


@with_style
def tornado_figure(outputs: Mapping[str, Floats], keys: Sequence[str]) -> Figure:
    """Draw tornado charts of outputs (1 + 2 d,) at the `one_at_a_time` samples of d keys."""
    figure = Figure(figsize=REPORT.size(10.5, 1.2 + 0.35 * len(keys)), layout="constrained")
    axes = figure.subplots(1, len(outputs), squeeze=False)[0]
    for ax, (name, values) in zip(axes, outputs.items(), strict=True):
        centre, low, high = values[0], values[1::2], values[2::2]
        order = np.argsort(-np.abs(high - low), kind="stable")[::-1]  # the widest on top
        for share, ends, colour in zip(ENDS, (low, high), (BAND, CENTRE), strict=True):
            ax.barh(range(len(order)), ends[order] - centre, left=centre, height=0.7, color=colour,
                    label=f"at its {100 * share:g} % quantile")  # fmt: skip
        ax.axvline(centre, color="0.3", lw=1)
        ax.set_yticks(range(len(order)), [keys[k] for k in order], fontsize="small")
        ax.set_title(name, fontsize="small")
        ax.grid(alpha=0.25, axis="x")
    handles = axes[0].get_legend_handles_labels()[0]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
    return figure
