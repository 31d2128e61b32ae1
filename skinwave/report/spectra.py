"""Figures of waveforms and spectral lines of models and measurements, with thresholds."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from simple_model import spectrum, threshold
from simple_model.quantities import Quantity
from simple_model.threshold import BAND, HIGHEST, LOWEST
from skinwave.report.figures import (
    REPORT,
    legend,
    line_symbol,
    name_lines,
    name_size,
    rows_height,
    run_label,
    with_style,
)
from skinwave.report.palette import colour, dashes, ink_colour, label, line_style, marker
from skinwave.report.styles import SHOWN, Style, is_narrow
from skinwave.results.run import Run
from skinwave.typing import Floats

HIGHEST_SHOWN = 650.0  # Hz
CURVE: dict[str, Any] = {"color": "0.45", "lw": 1.5}
THRESHOLD_BAND: dict[str, Any] = {"color": "0.5", "alpha": 0.25}
MOST_LINES = 6  # of a measurement


@with_style
def tacton_figure(title: str, runs: list[Run], style: Style = REPORT) -> Figure:
    """Draw waveform and spectrum at each probe, with all models in one panel."""
    probes, narrow = runs[0].response.probes, style.is_narrow
    size = style.size(10.5, 1.05 * len(probes) + 1.3)
    figure = Figure(figsize=(size[0], 0.75 * len(probes) + 1.6) if narrow else size)
    axes = figure.subplots(len(probes), 2, sharex="col", sharey="col", squeeze=False)
    rows = _legend(figure, runs, _draw_waveforms([*axes[:, 0]], runs))
    _draw_spectra([*axes[:, 1]], runs)
    # Fixed margins: a computed layout takes twice as long.
    inch = style.zoom / figure.get_figheight()
    left, right, between, top = (0.2, 0.97, 0.32, 0.75) if narrow else (0.08, 0.99, 0.14, 0.6)
    figure.subplots_adjust(
        left, 0.55 * inch, right, 1 - (top + 0.2 * rows) * inch, wspace=between, hspace=0.13
    )
    for ax, (x, y) in zip(axes[:, 0], probes, strict=True):
        ax.set_ylabel(f"({1e3 * x:g}, {1e3 * y:g}) mm", fontweight="bold")
    pad = None
    if narrow:
        titles = "waveform about its mean,\nover the largest", "spectrum, dB re\nlargest line"
        axes[0, 1].set_yticks(np.arange(axes[0, 1].get_ylim()[0], 1, 40))
    else:
        titles = (
            "waveform about its mean, over the model's largest",
            "spectrum, dB re the model's largest line",
        )
        pad, frequencies = 4 + rows_height(1), runs[0].frequencies
        marked = "f_AM", "2f_AM", "f_d", "2f_d", "3f_d"
        lines: dict[str, float] = {n: frequencies[n] for n in marked if n in frequencies}
        name_lines(axes[0, 1], lines, 72 * axes[0, 1].get_position().width * size[0])
    axes[0, 0].set_title(f"{title}\n{titles[0]}", fontsize="medium", parse_math=False)
    axes[0, 1].set_title(titles[1], fontsize="medium", pad=pad)
    axes[-1, 0].set_xlabel("time, ms")
    axes[-1, 1].set_xlabel("frequency, Hz")
    return figure


def _legend(figure: Figure, runs: list[Run], largest: list[float]) -> int:
    """Add an entry for each model above the figure, with its largest motion."""
    entries: dict[str, dict[str, Any]] = {}
    for run, most in zip(runs, largest, strict=True):
        style = line_style(run.column) | {"ls": dashes(run.column), "lw": 2}
        entries[f"{run_label(run)}, 1 = {run.response.record.text(most)}"] = style
    if kinds := dict.fromkeys(peak.kind for run in runs for peak in run.unnamed):
        mark = {"color": "0.3", "marker": "^", "mfc": "none", "ls": ""}
        entries[f"open: {', '.join(kinds)}"] = mark
    columns = len(entries) if len(entries) <= 3 else -(-len(entries) // 2)
    letter, handle = 0.07, 0.5  # inch: of a letter of a legend, and of a handle with its space
    room = int(figure.get_figwidth() / (letter * max(map(len, entries)) + handle))
    columns = 1 if is_narrow(figure.get_figwidth()) else max(1, min(columns, room))
    return legend(figure, entries, columns, loc="upper center", fontsize=None)


def _draw_waveforms(axes: Sequence[Axes], runs: list[Run], settle: float = 0.25) -> list[float]:
    """Draw the end that all runs have at each probe, and return the largest motion of each run.

    Records may begin at different times. The mean is that after a part of the record.
    """
    largest, end = [], min(float(run.response.times[-1]) for run in runs)
    for run in runs:
        times, motion = run.response.times, run.response.values
        step, last = times[1] - times[0], end if end - SHOWN >= times[0] else times[0] + SHOWN
        stop = int(np.searchsorted(times, max(last, end) + 0.5 * step))
        shown = slice(max(0, stop - 1 - round(SHOWN / step)), stop)
        centred = motion[shown] - motion[int(settle * len(motion)) :].mean(axis=0)
        largest.append(float(np.abs(centred).max()) or 1.0)
        for ax, values in zip(axes, centred.T / largest[-1], strict=True):
            ax.plot(1e3 * times[shown], values, ls=dashes(run.column), **_curve(run))
    for ax in axes:
        ax.margins(x=0)
        ax.xaxis.set_major_locator(MaxNLocator(4, prune="both"))
        ax.set_ylim(-1.1, 1.1)
        ax.grid(alpha=0.25)
    return largest


def _draw_spectra(axes: Sequence[Axes], runs: list[Run], floor: float = -80.0) -> None:
    """Draw spectra and lines at each probe, down to a level in dB."""
    lowest_shown = 8.0  # Hz: the mean and its leakage lie below
    for run in runs:
        f, amplitude = spectrum(run.response, "blackmanharris")
        f, amplitude = f[f > lowest_shown], amplitude[f > lowest_shown]
        top, style = max(float(amplitude.max()), np.finfo(float).tiny), _curve(run)
        for p, ax in enumerate(axes):
            level = 20 * np.log10(np.maximum(amplitude[:, p] / top, 1e-12))
            ax.plot(f, level, alpha=0.6, **(style | {"lw": style["lw"] - 0.3}))
            lines = [(hz, run.table.amplitudes[name][p]) for name, hz in run.line_hz.items()]
            peaks = [(peak.frequency, peak.amplitudes[p]) for peak in run.unnamed]
            for points, face in ((lines, colour(run.column)), (peaks, "none")):
                at, size = np.array(points).reshape(-1, 2).T  # may be empty
                height = 20 * np.log10(np.maximum(size / top, 1e-12))
                above, mark = height > floor, marker(run.column)
                ax.plot(at[above], height[above], ls="", marker=mark, ms=4, mfc=face, **style)
    for ax in axes:
        ax.set(xlim=(0, HIGHEST_SHOWN), ylim=(floor, 5), yticks=np.arange(floor, 1, 20))
        ax.grid(alpha=0.25)


def _curve(run: Run) -> dict[str, Any]:
    """Return the properties of a curve; point kernels are thin and in front."""
    width, order = (1.0, 4) if run.body == "none" else (1.4, 3)
    return {"color": ink_colour(run.column), "lw": width, "zorder": order}


@with_style
def levels_figure(runs: Sequence[Run], probe: int, style: Style) -> Figure:
    """Draw the lines at one probe and, for skin, the detection threshold over frequency.

    Each run of a body has its own panel; at least one run is needed.
    """
    runs = [run for run in runs if run.response.record.of_body]
    count, narrow = len(runs), style.is_narrow
    size = style.size(5.2 * count, 4.6)
    size = (size[0], 3.0 * count + 0.5) if narrow else size
    figure = Figure(figsize=size, layout="constrained")
    shape = (count, 1) if narrow else (1, count)
    axes = figure.subplots(*shape, sharex=True, sharey=True, squeeze=False).ravel()
    width = 72 * size[0] / shape[1] - 8 * style.font  # points
    for ax, run in zip(axes, runs, strict=True):
        _draw_levels(ax, run, probe, width)
    axes[0].set_ylim(*_level_limits([*axes]))
    if axes[0].get_ylim()[0] > 1e-4:  # written without an exponent
        axes[0].yaxis.set_major_formatter("{x:g}")
    entries: dict[str, dict[str, Any]] = {}
    if any(run.is_skin for run in runs):
        entries["threshold for a focal spot"] = CURVE
        entries[f"±{BAND:g} dB between people"] = {**THRESHOLD_BAND, "lw": 6}
    for kind in dict.fromkeys(peak.kind for run in runs for peak in run.unnamed):
        entries[f"open: {kind}"] = {"color": "0.3", "marker": "o", "mfc": "none", "ls": ""}
    if entries:
        legend(figure, entries)
    (x, y), quantity = 1e3 * runs[0].response.probes[probe], runs[0].response.record
    between = "\n" if style.columns else " "  # printed figures are small beside their letters
    for ax in axes if narrow else axes[:1]:
        ax.set_ylabel(f"{quantity.words}{between}at ({x:g}, {y:g}) mm, {quantity.shown} peak")
    return figure


def strongest_probe(runs: Sequence[Run]) -> int:
    """Return the index of the probe that moves most, relative to the largest motion of each run."""
    level = [np.ptp(run.response.values, axis=0) for run in runs]
    return int(np.argmax(sum(x / max(float(x.max()), 1e-300) for x in level)))


def sensation_levels(run: Run, probe: int) -> dict[str, float]:
    """Return the levels of lines at a probe in dB above threshold, the highest first.

    Return none unless the body is skin.
    """
    names = run.in_pulses.frequencies if run.levels else ()
    levels = {name: float(run.levels[name][probe]) for name in names}
    return dict(sorted(levels.items(), key=lambda item: -item[1]))


def _draw_levels(ax: Axes, run: Run, probe: int, width: float, lowest_level: float = -30.0) -> None:
    """Draw lines and their names: by sensation level or, if not skin, by amplitude.

    Lines of skin below a level in dB above threshold are left out.
    """
    table = run.in_pulses if run.is_skin else run.table
    amplitudes = {name: float(values[probe]) for name, values in table.amplitudes.items()}
    names = sorted(amplitudes, key=lambda name: -amplitudes[name])
    if run.is_skin:
        levels = sensation_levels(run, probe)
        names = [name for name, level in levels.items() if level > lowest_level]
        f = np.geomspace(LOWEST, HIGHEST, 300)
        curve, factor = 1e6 * threshold(f), 10 ** (BAND / 20)
        ax.plot(f, curve, **CURVE)
        ax.fill_between(f, curve / factor, curve * factor, lw=0, **THRESHOLD_BAND)
    per_unit, style = run.response.record.per_unit, line_style(run.column)
    frequencies = np.array([table.frequencies[name] for name in names])
    heights = per_unit * np.array([amplitudes[name] for name in names])
    ax.vlines(frequencies, 1e-4, heights, color=style["color"], lw=1.2)
    ax.plot(frequencies, heights, ls="none", **style)
    for peak in run.unnamed:
        ax.plot(peak.frequency, per_unit * peak.amplitudes[probe], ls="none", mfc="none", **style)
    ax.set(xscale="log", yscale="log", xlim=(LOWEST, HIGHEST), xlabel="frequency, Hz")
    ax.set_xticks([10, 30, 100, 300, 1000], ["10", "30", "100", "300", "1000"])
    ax.set_title(run_label(run), pad=4 + rows_height(3))
    ax.grid(alpha=0.25)
    name_lines(ax, {name: table.frequencies[name] for name in names[:12]}, width, rows=3)


def _level_limits(axes: Sequence[Axes]) -> tuple[float, float]:
    """Return the limits in decades of everything that panels of sensation levels show."""
    shown = np.concatenate([np.asarray(line.get_ydata(), float) for ax in axes for line in ax.lines
                            if line.get_transform() == ax.transData])  # fmt: skip
    shown = shown[shown > 0]
    low, high = (shown.min(), shown.max()) if len(shown) else (0.1, 1.0)
    low = max(low, high / 1e4)
    # The axis begins below the lowest decade, whose label then does not touch the other axis.
    return 0.6 * 10.0 ** np.floor(np.log10(low / 1.5)), 10.0 ** np.ceil(np.log10(high))


@with_style
def lines_figure(
    lines: Mapping[str, float], places: Floats, measured: np.ndarray, error: Floats,
    models: Mapping[str, np.ndarray], differs: Mapping[str, np.ndarray], quantity: Quantity,
) -> Figure:  # fmt: skip
    """Draw amplitudes and phases of the strongest measured lines at each place, with models.

    Parameters
    ----------
    lines : frequencies in Hz by name
    places : (p, 2) float, m
    measured : (f, p) complex, SI units
    error : (f, p) float, standard errors of amplitudes, SI units; nan if unknown
    models : (f, p) complex by `Run.column`, with gain and delay, SI units
    differs : (f, p) bool by `Run.column`, where the difference exceeds the noise
    """
    strongest = np.sort(np.argsort(-np.abs(measured).max(axis=1), kind="stable")[:MOST_LINES])
    figure = Figure(figsize=REPORT.size(10.5, 1.45 * len(strongest) + 1.7), layout="constrained")
    axes = figure.subplots(len(strongest), 2, sharex=True, squeeze=False)
    shift = 0.12  # of the distance between two places, by which models are drawn apart
    for (left, right), k in zip(axes, strongest, strict=True):
        noise = 1.96 * np.nan_to_num(error[k])  # of 95 %
        _draw_noise(left, right, quantity.per_unit * np.abs(measured[k]), quantity.per_unit * noise)
        for n, (column, model) in enumerate(models.items()):
            at = np.arange(len(places)) + shift * (n - (len(models) - 1) / 2)
            size = np.abs(model[k])
            has_phase = size > 0.02 * size.max(initial=0.0)
            phase = np.where(has_phase, np.degrees(np.angle(model[k] * measured[k].conj())), np.nan)
            markers, filled = _markers(column), differs[column][k]
            for mask, face in ((filled, markers["color"]), (~filled, "none")):
                left.plot(at[mask], quantity.per_unit * size[mask], mfc=face, **markers)
                right.plot(at[mask], phase[mask], mfc=face, **markers)
        left.set_ylim(bottom=0)
        name = list(lines)[k]
        left.set_ylabel(
            f"{line_symbol(name)}\n{lines[name]:.1f} Hz", fontweight="bold", fontsize=name_size()
        )
    axes[0, 0].set_title(f"amplitude, {quantity.shown}", fontsize="medium")
    axes[0, 1].set_title("phase of the model minus measured phase, degrees", fontsize="medium")
    for ax in axes[-1]:
        ax.set_xticks(range(len(places)), [f"{1e3 * x:.3g}\n{1e3 * y:.3g}" for x, y in places])
        ax.set(xlabel="place, x above y, mm", xlim=(-0.6, len(places) - 0.4))
    entries: dict[str, dict[str, Any]] = {
        "measured, bars of 95 %": {
            "color": mpl.rcParams["text.color"], "marker": "_", "ms": 14, "mew": 2, "ls": ""
        }
    }  # fmt: skip
    entries |= {label(column): _markers(column) for column in models}
    entries["open: within the noise"] = {"ls": "", "marker": "o", "mfc": "none", "color": "0.4"}
    legend(figure, entries, 5, loc="outside upper center", fontsize=None)
    return figure


def _draw_noise(left: Axes, right: Axes, size: Floats, noise: Floats) -> None:
    """Draw amplitudes (p,) with error bars, and the band of noise of the phase about 0."""
    at, ink = np.arange(len(size)), mpl.rcParams["text.color"]
    left.errorbar(at, size, noise, fmt="_", ms=14, mew=2, capsize=4, color=ink, zorder=3)
    with np.errstate(divide="ignore", invalid="ignore"):
        band = np.minimum(np.degrees(noise / size), 180)
    right.bar(at, 2 * band, bottom=-band, width=0.7, color="0.8", zorder=0)
    right.axhline(0, color=ink, lw=1)
    right.set(ylim=(-190, 190), yticks=[-180, -90, 0, 90, 180])
    for ax in (left, right):
        ax.grid(alpha=0.25)


def _markers(column: str) -> dict[str, Any]:
    """Return the marker of a column; crosses, which cannot be open, are replaced."""
    kind = marker(column).replace("x", "X")
    return {"color": ink_colour(column), "ls": "", "ms": 6, "marker": kind}
