"""Figures of an ensemble (matplotlib): bands of waveforms and lines, maps, and tornado charts."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from meshes.tetmesh import Floats
from simple_model import threshold
from simple_model.load.line_names import line_frequency
from skinwave.report.figures import HIGHEST, written
from skinwave.report.palette import SEQUENTIAL, SERIES
from skinwave.report.styles import STYLES, Style
from skinwave.results.views import path_points
from skinwave.sweeps.ensemble import Ensemble, map_axes, shown_times
from skinwave.sweeps.sampling import PERCENTILES, SobolIndices, Tornado, percentiles

REPORT = STYLES["report"]
BAND, CENTRE, ONE = SERIES[:3]
WIDE, NARROW = 0.22, 0.4  # opacity of the bands of 90 and 50 %
DEEPEST = -30.0  # dB of a map, below the largest median
SHARED = 3  # maps of one colour bar, before the last
NAMED_LINES = 8


def bands_figure(found: Ensemble, centre: Floats, style: Style = REPORT) -> Figure:
    """Waveforms and lines at each probe: median, bands of 50 and 90 % of the samples, and the
    waveform (t, p) of the central values.
    """
    per, probes = found.scene.reading.asked.per_unit, found.scene.probes
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(10.5, 1.7 * len(probes) + 1.3), layout="constrained")
        axes = figure.subplots(len(probes), 2, sharex="col", sharey="col", squeeze=False)
        waveforms = per * percentiles(found.waveform)
        lines = per * percentiles(found.lines)
        most = int(np.argmax(np.median(found.rms, axis=0)))
        for p, (x, y) in enumerate(probes):
            _waveform(axes[p, 0], 1e3 * shown_times(found.scene), waveforms[..., p])
            axes[p, 0].plot(1e3 * shown_times(found.scene), per * centre[:, p], color=CENTRE, lw=1)
            _lines(axes[p, 1], found, lines[..., p], named=p == most)
            axes[p, 0].set_ylabel(f"({1e3 * x:g}, {1e3 * y:g}) mm", fontweight="bold")
        asked = found.scene.reading.asked
        axes[0, 0].set_title(f"{asked.words} about its mean, {asked.shown}", fontsize="medium")
        axes[0, 1].set_title(f"lines, {asked.shown} peak", fontsize="medium")
        axes[-1, 0].set_xlabel("time, ms")
        axes[-1, 1].set_xlabel("frequency, Hz")
        handles = [
            axes[0, 0].fill_between([], [], color=BAND, alpha=WIDE, lw=0, label="90 % of samples"),
            axes[0, 0].fill_between([], [], color=BAND, alpha=0.6, lw=0, label="50 %"),
            axes[0, 0].plot([], [], color=BAND, label="median")[0],
            axes[0, 0].plot([], [], color=CENTRE, label="central values")[0],
        ]
        if found.is_skin:
            handles.append(axes[0, 0].plot([], [], color="0.45", label="detection threshold")[0])
        figure.legend(handles=handles, loc="outside upper center", ncols=5, frameon=False)
    return figure


def _waveform(ax: Axes, times: Floats, bands: Floats) -> None:
    """Bands (5, t) of a waveform."""
    low, lower, median, upper, high = bands
    ax.fill_between(times, low, high, color=BAND, alpha=WIDE, lw=0)
    ax.fill_between(times, lower, upper, color=BAND, alpha=NARROW, lw=0)
    ax.plot(times, median, color=BAND, lw=1.2)
    ax.margins(x=0)
    ax.grid(alpha=0.25)


def _lines(ax: Axes, found: Ensemble, bands: Floats, *, named: bool) -> None:
    """Bars (5, f) of lines over their central frequency."""
    tacton, names = found.scene.tacton, found.method.lines
    f = np.array([line_frequency(tacton, name) or np.nan for name in names])
    low, lower, median, upper, high = np.maximum(bands, 1e-12)
    ax.vlines(f, low, high, color=BAND, alpha=0.6, lw=1.2)
    ax.vlines(f, lower, upper, color=BAND, lw=3.5)
    ax.plot(f, median, "o", color="white", mec=BAND, ms=4)
    ax.set_yscale("log")
    top = float(median.max(initial=1e-9))
    ax.set_ylim(1e-3 * top, 30 * top)
    ax.set_xlim(0, HIGHEST)
    if found.is_skin:
        grid = np.geomspace(max(10.0, np.nanmin(f) / 1.2), min(1000.0, np.nanmax(f) * 1.2), 200)
        ax.plot(grid, 1e6 * threshold(grid), color="0.45", lw=1.2, zorder=0)
    ax.grid(alpha=0.25)
    if named:
        shown = [k for k in np.argsort(-median) if f[k] < HIGHEST]
        for k in shown[:NAMED_LINES]:
            ax.annotate(written(names[k]), (f[k], high[k]), xytext=(0, 3), ha="center", rotation=90,
                        textcoords="offset points", va="bottom", fontsize="x-small")  # fmt: skip


def maps_figure(found: Ensemble, style: Style = REPORT) -> Figure:
    """RMS motion on the map, percentiles 5, 50 and 95 of the samples at each place, on one colour
    scale; and the share of samples in which a place is above the threshold of detection.
    """
    bands = percentiles(found.map_rms)
    top = max(float(bands[2].max()), 1e-300)
    x, y = (1e3 * axis for axis in map_axes(found.scene))
    step = x[1] - x[0]
    frame = (x[0] - step / 2, x[-1] + step / 2, y[0] - step / 2, y[-1] + step / 2)
    share = 100 * (found.map_level >= 0).mean(axis=0)
    skin = found.is_skin
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(10.5, 3.2), layout="constrained")
        axes = figure.subplots(1, SHARED + skin, sharey=True)
        for ax, k in zip(axes, (0, 2, 4), strict=False):
            level = 20 * np.log10(np.maximum(bands[k] / top, 1e-12))
            image = _image(ax, level, frame, vmin=DEEPEST, vmax=-DEEPEST / 2)
            ax.set_title("median" if k == 2 else f"{PERCENTILES[k]} % are below", fontsize="medium")
        figure.colorbar(image, ax=list(axes[:SHARED]), shrink=0.8,
                        label="RMS, dB re largest median")  # fmt: skip
        if skin:
            image = _image(axes[-1], share, frame, vmin=0.0, vmax=100.0)
            axes[-1].contour(x, y, share, levels=[50.0], colors="white", linewidths=1)
            axes[-1].set_title("above threshold, % of samples", fontsize="medium")
            figure.colorbar(image, ax=axes[-1], shrink=0.8)
        outline = 1e3 * path_points(found.scene)
        for ax in axes:
            ax.plot(*outline.T, color="white", lw=0.8, ls=":")
            ax.set_xlabel("x, mm")
        axes[0].set_ylabel("y, mm")
    return figure


def _image(ax: Axes, values: Floats, frame: tuple[float, ...], **limits: Any) -> Any:
    extent: Any = frame
    return ax.imshow(values, origin="lower", extent=extent, cmap=SEQUENTIAL,
                     interpolation="bilinear", **limits)  # fmt: skip


def distances_figure(radii: Floats, bands: Mapping[str, Floats], style: Style = REPORT) -> Figure:
    """Percentiles (5, p) of quantities by label at the probes, over their distances (p,) in mm."""
    order = np.argsort(radii, kind="stable")
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(10.5, 3.2), layout="constrained")
        axes = figure.subplots(1, len(bands), squeeze=False)[0]
        for ax, (name, each) in zip(axes, bands.items(), strict=True):
            _waveform(ax, radii[order], each[:, order])
            ax.plot(radii[order], each[2, order], "o", color=BAND, ms=4)
            ax.set(xlabel="distance of the probe from the middle, mm", ylabel=name)
    return figure


ENDS = tuple(f"number at its {share} % quantile" for share in (PERCENTILES[0], PERCENTILES[-1]))


def tornado_figure(
    charts: Mapping[str, Tornado],
    keys: Sequence[str],
    ends: Sequence[str] = ENDS,
    style: Style = REPORT,
) -> Figure:
    """Tornado charts by name of the output, of numbers (d,) by their keys; `ends` are what a legend
    calls the low and the high end.
    """
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(10.5, 1.2 + 0.35 * len(keys)), layout="constrained")
        axes = figure.subplots(1, len(charts), squeeze=False)[0]
        for ax, (name, chart) in zip(axes, charts.items(), strict=True):
            order = chart.order[::-1]
            for row, k in enumerate(order):
                for end, colour in ((chart.low[k], BAND), (chart.high[k], CENTRE)):
                    ax.barh(row, end - chart.centre, left=chart.centre, color=colour, height=0.7)
            ax.axvline(chart.centre, color="0.3", lw=1)
            ax.set_yticks(range(len(order)), [keys[k] for k in order], fontsize="small")
            ax.set_title(name, fontsize="small")
            ax.grid(alpha=0.25, axis="x")
        handles = [
            Patch(color=colour, label=end) for colour, end in zip((BAND, CENTRE), ends, strict=True)
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
    return figure


def indices_figure(
    found: Mapping[str, SobolIndices], keys: Sequence[str], style: Style = REPORT
) -> Figure:
    """Sobol' indices by name of the output, of numbers (d,) by their keys, with 95 % intervals."""
    rows = np.arange(len(keys))
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(10.5, 1.4 + 0.5 * len(keys)), layout="constrained")
        axes = figure.subplots(1, len(found), sharex=True, sharey=True, squeeze=False)[0]
        for ax, (name, one) in zip(axes, found.items(), strict=True):
            for values, error, at, colour, label in (
                (one.first, one.first_error, -0.19, BAND, "first order"),
                (one.total, one.total_error, 0.19, ONE, "total"),
            ):
                ax.barh(rows + at, values, 0.36, xerr=error, color=colour, label=label,
                        error_kw={"lw": 1, "ecolor": "0.3"})  # fmt: skip
            ax.set_title(name, fontsize="small")
            ax.grid(alpha=0.25, axis="x")
        axes[0].set_yticks(rows, list(keys), fontsize="small")
        axes[0].invert_yaxis()
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
    return figure
