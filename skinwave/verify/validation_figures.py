"""Figures of published values beside ours."""

from collections.abc import Callable, Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from simple_model.typing import Floats
from skinwave.report.figures import REPORT
from skinwave.verify import zigzag
from skinwave.verify.compared import Compared, tallies
from skinwave.verify.finger import Decay
from skinwave.verify.focus_speed import Sweep
from skinwave.verify.published import LENGTH, OPTIMUM, SPEED, Published, Quantity, wave_sets
from skinwave.verify.published_waves import Curves
from skinwave.verify.zigzag import Profile

COLOURS = {
    "forearm": "#D55E00", "palm": "#0072B2", "palm-stiff": "#56B4E9", "skin-slab": "#009E73",
    "palm-layers": "#CC79A7", "forearm-layers": "#E69F00",
}  # fmt: skip
STYLES = dict.fromkeys(("forearm", "palm", "palm-stiff"), "-")  # half-spaces; layers dashed
MARKERS = "osv^DPX"
BAND = "#dddddd"
FURTHEST = 10.0  # factors beyond it are drawn at it
SHORTEST, LONGEST = 1.0, 300.0  # mm shown


def _figure(draw: Callable[[Figure], None], width: float, height: float) -> Figure:
    with mpl.rc_context(REPORT.rc):
        figure = Figure(figsize=REPORT.size(width, height), layout="constrained")
        draw(figure)
    return figure


def factors_figure(rows: Sequence[Compared]) -> Figure:
    """Ours over the nearest published value, a line of points for each set."""
    names = list(dict.fromkeys(t.rows[0].published.name for t in tallies(rows)))

    def draw(figure: Figure) -> None:
        ax = figure.subplots()
        ax.axvspan(0.95, 1.05, color=BAND, lw=0)
        for row in rows:
            if row.factor != row.factor:
                continue
            at = np.clip(row.factor, 1 / FURTHEST, FURTHEST)
            offset = (list(COLOURS).index(row.body) - 2.5) / 9 if row.body in COLOURS else 0.4
            ax.plot(
                at, names.index(row.published.name) + offset, "o", ms=4, mew=1,
                color=COLOURS.get(row.body, "k"), mfc="none" if row.is_built else None,
            )  # fmt: skip
        ax.set(xscale="log", xlim=(0.9 / FURTHEST, FURTHEST / 0.9), ylim=(len(names) - 0.5, -0.5),
               xlabel="ours over the nearest published value")  # fmt: skip
        ticks = [0.1, 0.2, 0.5, 1, 2, 5, 10]
        ax.set_xticks(ticks, [f"{x:g}" for x in ticks])
        ax.minorticks_off()
        ax.set_yticks(range(len(names)), names)
        ax.grid(alpha=0.25)
        marks = [Line2D([], [], color=c, marker="o", ls="", ms=4, label=n)
                 for n, c in COLOURS.items()]  # fmt: skip
        if any(row.body not in COLOURS for row in rows):
            marks.append(Line2D([], [], color="k", marker="o", ls="", ms=4, label="hand"))
        figure.legend(handles=marks, loc="outside upper right", ncols=7, fontsize=8, frameon=False)

    return _figure(draw, 10.5, 0.3 * len(names) + 1.6)


def waves_figure(curves: Mapping[str, Curves], band: Sequence[Published]) -> Figure:
    """Phase speed and 1/e length by frequency: sources as points, presets as lines."""

    def draw(figure: Figure) -> None:
        for ax, quantity, whole in zip(figure.subplots(1, 2), (SPEED, LENGTH), band, strict=True):
            _waves(ax, quantity, curves, whole)
        handles = [Line2D([], [], color=c, ls=STYLES.get(n, "--"), label=n)
                   for n, c in COLOURS.items()]  # fmt: skip
        figure.legend(handles=handles, loc="outside upper center", ncols=6, fontsize=8,
                      frameon=False)  # fmt: skip

    return _figure(draw, 11.5, 5.6)


def _waves(ax: Axes, quantity: Quantity, curves: Mapping[str, Curves], whole: Published) -> None:
    size = quantity.size
    ax.fill_between(
        whole.frequencies, np.array(whole.lows) / size, np.array(whole.highs) / size, color=BAND,
        lw=0, zorder=0,
    )  # fmt: skip
    for name, c in curves.items():
        shown = c.frequencies >= 10
        values = (c.speed if quantity is SPEED else c.length) / size
        ends = 1 + np.flatnonzero(np.diff(c.mode[shown]))  # where another mode leads
        f, y = (np.split(x[shown], ends) for x in (c.frequencies, values))
        for part in zip(f, y, strict=True):
            ax.plot(*part, color=COLOURS[name], lw=1.3, ls=STYLES.get(name, "--"))
    sets = [each for each in wave_sets() if each.quantity is quantity]
    for marker, each in zip(MARKERS, sets, strict=False):
        _points(ax, each, marker)
    ax.set(xlim=(-15, 720), xlabel="frequency, Hz", ylabel=f"{quantity.name}, {quantity.unit}")
    if quantity is LENGTH:
        ax.set(yscale="log", ylim=(SHORTEST, LONGEST))
    else:
        ax.set_ylim(0, 20)
    ax.grid(alpha=0.25)
    ax.legend(fontsize=7, frameon=False, loc="upper right")


def _points(ax: Axes, each: Published, marker: str) -> None:
    """Values with the spread that is published, or its range alone."""
    size, f = each.quantity.size, np.array(each.frequencies)
    middle = np.array(each.values) / size
    errors = None
    if each.has_spread:
        low, high = np.array(each.lows) / size, np.array(each.highs) / size
        middle = np.where(np.isnan(middle), (low + high) / 2, middle)
        errors = np.stack([middle - low, high - middle])
    ax.errorbar(f, middle, errors, fmt=marker, ms=5, color="k", mfc="w", lw=1, capsize=2,
                label=f"{each.name}, {each.site}", zorder=3)  # fmt: skip


def speed_figure(sweeps: Mapping[str, tuple[Sweep, ...]]) -> Figure:
    """Largest deflection on the path over the speed of the focus, a panel for each perimeter."""
    count = len(next(iter(sweeps.values())))

    def draw(figure: Figure) -> None:
        axes = figure.subplots(1, count, sharey=True)
        for k, ax in enumerate(np.atleast_1d(axes)):
            ax.axvspan(OPTIMUM.lows[0], OPTIMUM.highs[0], color=BAND, lw=0)
            for name, of_body in sweeps.items():
                each = of_body[k]
                ax.plot(each.speeds, each.largest / each.largest.max(), color=COLOURS[name],
                        ls=STYLES.get(name, "--"), label=name)  # fmt: skip
                ax.plot(each.optimum, 1, "v", color=COLOURS[name], ms=6)
            ax.set(title=f"circle of {1e3 * each.perimeter:g} mm around", ylim=(0, 1.08),
                   xlabel="speed of the focus, m/s")  # fmt: skip
            ax.grid(alpha=0.25)
        np.atleast_1d(axes)[0].set_ylabel("largest deflection over its maximum")
        np.atleast_1d(axes)[-1].legend(fontsize=8, frameon=False)

    return _figure(draw, 10.5, 3.8)


def zigzag_figure(predicted: Sequence[Profile], measured: Sequence[Profile]) -> Figure:
    """RMS velocity along the hand, a panel for each longitudinal speed."""
    speeds = sorted({each.speed for each in (*predicted, *measured)})

    def draw(figure: Figure) -> None:
        axes = figure.subplots(1, len(speeds), sharey=True)
        for ax, speed in zip(axes, speeds, strict=True):
            for each in predicted:
                if each.speed == speed:
                    ax.plot(1e3 * each.places, 1e3 * each.rms, color=COLOURS[each.name],
                            ls=STYLES.get(each.name, "--"), label=each.name)  # fmt: skip
            for each in measured:
                if each.speed == speed:
                    ax.plot(1e3 * zigzag.PLACES, 1e3 * zigzag.binned(each), "k.-", lw=1,
                            label="measured")  # fmt: skip
            ax.set(title=f"{speed:g} m/s", xlabel="along, mm")
            ax.grid(alpha=0.25)
        axes[0].set_ylim(bottom=0)
        axes[0].set_ylabel("RMS velocity, mm/s")
        handles = {h.get_label(): h for ax in axes for h in ax.get_lines()}
        figure.legend(handles=list(handles.values()), loc="outside upper center", ncols=4,
                      fontsize=8, frameon=False)  # fmt: skip

    return _figure(draw, 11.5, 3.6)


def finger_figure(decays: Sequence[Decay], frequencies: Floats) -> Figure:
    """Amplitude from the tip of the finger on, a panel for each frequency."""

    def draw(figure: Figure) -> None:
        axes = np.atleast_1d(figure.subplots(1, len(frequencies), sharey=True))
        for ax, f in zip(axes, frequencies, strict=True):
            for k, each in enumerate(decays):
                at = np.flatnonzero(np.isclose(each.frequencies, f))
                if len(at):
                    own = "#0072B2" if each.dofs else "k"
                    away = 1e3 * (each.distances - each.distances[0])
                    ax.semilogy(away, each.amplitudes[at[0]], color=own,
                                marker=MARKERS[k % len(MARKERS)], ms=4, lw=1,
                                label=each.name)  # fmt: skip
            ax.set(title=f"{f:g} Hz", xlabel="from the first place, mm")
            ax.grid(alpha=0.25)
        axes[0].set_ylabel("amplitude over the largest")
        handles = {h.get_label(): h for ax in axes for h in ax.get_lines()}
        figure.legend(handles=list(handles.values()), loc="outside upper center", ncols=3,
                      fontsize=8, frameon=False)  # fmt: skip

    return _figure(draw, 3.4 * len(frequencies) + 1, 3.8)
