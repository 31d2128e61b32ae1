"""Figures of dispersion curves: speeds and 1/e lengths over frequency, mode shapes over depth."""

from collections.abc import Mapping

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from meshes.tetmesh import Floats
from simple_model.dispersion import DispersionCurves, Mode
from skinwave.pictures.figures import REPORT, SPARE
from skinwave.pictures.levels import written
from skinwave.pictures.styles import Style

COLOURS = ("#0072B2", "#D55E00", *SPARE)
FINE = 600  # frequencies of a drawn curve
PALE = 0.35  # opacity of a curve where its mode is evanescent
ROWS = 3  # of the names of lines above the panels
APART = 0.085  # of the axis: names nearer than this are in rows of their own
MOST_SHAPES = 4


def colour(number: int) -> str:
    """Colour of a mode by its number in the curves, from 0."""
    return COLOURS[number % len(COLOURS)]


def dispersion_figure(
    curves: DispersionCurves,
    lines: Mapping[str, float],
    focus_speed: float,
    at: float,
    style: Style = REPORT,
) -> Figure:
    """Phase speed, 1/e length and group speed over frequency, and mode shapes at one frequency.

    Parameters
    ----------
    curves : DispersionCurves
    lines : names and frequencies in Hz of the lines of a load, the strongest first
    focus_speed : m/s, 0 of a focus at rest
    at : Hz, where the shapes are
    style : Style

    Returns
    -------
    Figure
    """
    thick = len(curves.depths) > 2
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(11.5 if thick else 8.5, 8.4), layout="constrained")
        left, *right = figure.subfigures(1, 2 if thick else 1, squeeze=False,
                                         width_ratios=(2.1, 1)[: 1 + thick])[0]  # fmt: skip
        axes = left.subplots(3, 1, sharex=True, height_ratios=(1.25, 1, 1))
        _speeds(axes[0], curves, focus_speed)
        _decay(axes[1], curves)
        _group(axes[2], curves)
        for ax in axes:
            ax.set_xlim(0, curves.frequencies[-1])
            _marks(ax, lines, named=ax is axes[0])
            ax.grid(alpha=0.25)
        axes[-1].set_xlabel("frequency, Hz")
        _legend(left, curves, focus_speed)
        for part in right:
            _shapes(part.subplots(2, 1, sharex=True), curves, at)
    return figure


def wavenumber_figure(
    curves: DispersionCurves,
    spectrum: tuple[Floats, Floats, Floats],
    fitted: tuple[Floats, Floats],
    title: str,
    style: Style = REPORT,
) -> Figure:
    """Magnitude over frequency and wavenumber of the motion of a line of probes, over the curves.

    Parameters
    ----------
    curves : DispersionCurves
    spectrum : frequencies (f,) in Hz, wavenumbers (k,) in 1/m, and magnitudes (f, k), 0..1 at each
        frequency
    fitted : frequencies (g,) in Hz and fitted wavenumbers (g,) in 1/m
    title : str
    style : Style

    Returns
    -------
    Figure
    """
    f, k, magnitude = spectrum
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=style.size(8.5, 5.6), layout="constrained")
        ax = figure.add_subplot()
        mesh = ax.pcolormesh(f, k, magnitude.T, cmap="Greys", vmin=0, vmax=1, shading="nearest")
        for n, mode in enumerate(curves.modes):
            fine, squared, wave = _fine(mode)
            real = np.abs(np.sqrt(squared).real)
            if wave[fine <= f[-1]].any():
                ax.plot(fine, np.where(wave, real, np.nan), color=colour(n), lw=2, label=mode.name)
        ax.plot(
            *fitted,
            "o",
            mfc="none",
            color="#A33C00",
            ms=7,
            mew=1.4,
            label="fitted, where one mode leads and is resolved",
        )
        ax.set(xlim=(f[0], f[-1]), ylim=(0, k[-1]), xlabel="frequency, Hz",
               ylabel="wavenumber Re k, rad/m")  # fmt: skip
        ax.set_title(title, fontsize="medium", parse_math=False)
        ax.legend(loc="upper left", fontsize="small")
        bar = figure.colorbar(mesh, ax=ax)
        bar.set_label("magnitude over the largest at each frequency")
    return figure


def _fine(mode: Mode) -> tuple[Floats, np.ndarray, np.ndarray]:
    """Frequencies (g,) in Hz, squared wavenumbers (g,) and whether the mode is a wave there."""
    fine = np.linspace(mode.frequencies[0], mode.frequencies[-1], FINE)
    nearest = np.abs(fine[:, None] - mode.frequencies).argmin(axis=1)
    return fine, mode.squared_at(fine), mode.is_wave[nearest] & (fine >= mode.cut_on)


def _drawn(ax: Axes, n: int, x: Floats, y: Floats, wave: np.ndarray) -> None:
    """A mode's curve, pale where it is evanescent."""
    ax.plot(x, y, color=colour(n), lw=1, alpha=PALE)
    ax.plot(x, np.where(wave, y, np.nan), color=colour(n), lw=2.2)


def _speeds(ax: Axes, curves: DispersionCurves, focus_speed: float) -> None:
    typical = [focus_speed]
    for n, mode in enumerate(curves.modes):
        fine, squared, wave = _fine(mode)
        with np.errstate(divide="ignore"):
            speed = 2 * np.pi * fine / np.abs(np.sqrt(squared).real)
        _drawn(ax, n, fine, speed, wave)
        typical += [float(np.median(speed[wave]))] if wave.any() else []
    if focus_speed:
        ax.axhline(focus_speed, color=mpl.rcParams["text.color"], lw=1.2, ls="--")
    ax.set_ylim(0, 1.8 * max(typical) or 1.0)
    ax.set_ylabel("phase speed ω / |Re k|, m/s")


def _decay(ax: Axes, curves: DispersionCurves) -> None:
    largest = 10.0
    for n, mode in enumerate(curves.modes):
        fine, squared, wave = _fine(mode)
        with np.errstate(divide="ignore"):
            length = 1e3 / np.abs(np.sqrt(squared).imag)
        _drawn(ax, n, fine, length, wave)
        largest = max(largest, float(np.nanmax(np.where(wave, length, 0.0))))
    ax.set(yscale="log", ylim=(1, min(2 * largest, 3e3)), ylabel="1/e length 1 / |Im k|, mm")
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, place: f"{value:g}"))


def _group(ax: Axes, curves: DispersionCurves) -> None:
    drawn, typical = [], [1.0]
    for mode in curves.modes:
        fine, squared, wave = _fine(mode)
        slowness = np.gradient(np.sqrt(squared).real, 2 * np.pi * fine)
        with np.errstate(divide="ignore", invalid="ignore"):
            drawn.append(np.where(wave, np.abs(1 / slowness), np.nan))
        typical += [float(np.nanmedian(drawn[-1]))] if wave.any() else []
    top = 1.8 * max(typical)
    for n, speed in enumerate(drawn):
        ax.plot(fine, np.where(speed < top, speed, np.nan), color=colour(n), lw=2.2)
    ax.set(ylim=(0, top), ylabel="group speed dω / d Re k, m/s")


def _marks(ax: Axes, lines: Mapping[str, float], *, named: bool) -> None:
    """Vertical marks of lines, the names of the first panel in rows where they are close."""
    width, ends = ax.get_xlim()[1], [-np.inf] * ROWS
    for name, frequency in sorted(lines.items(), key=lambda item: item[1]):
        ax.axvline(frequency, color="0.55", lw=0.9, ls=":", zorder=0)
        free = [r for r in range(ROWS) if frequency / width - ends[r] > APART]
        row = free[0] if free else int(np.argmin(ends))
        ends[row] = frequency / width
        if named:
            ax.annotate(
                written(name), (frequency, 1.0), (0, 2 + 12 * row),
                xycoords=("data", "axes fraction"), textcoords="offset points", ha="center",
                va="bottom", fontsize="small",
            )  # fmt: skip


def _legend(figure: SubFigure, curves: DispersionCurves, focus_speed: float) -> None:
    ink = mpl.rcParams["text.color"]
    handles = [Line2D([], [], color=colour(n), lw=2.2) for n in range(len(curves.modes))]
    labels = [mode.name for mode in curves.modes]
    handles.append(Line2D([], [], color=ink, lw=1, alpha=PALE))
    labels.append("evanescent")
    handles.append(Line2D([], [], color="0.55", lw=0.9, ls=":"))
    labels.append("lines of the load")
    if focus_speed:
        handles.append(Line2D([], [], color=ink, lw=1.2, ls="--"))
        labels.append(f"focus, {focus_speed:g} m/s")
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 5),
                  fontsize="small")  # fmt: skip


def _shapes(axes: np.ndarray, curves: DispersionCurves, at: float) -> None:
    """Displacement over depth of the least evanescent modes, in phase with the surface."""
    number = int(np.argmin(np.abs(curves.frequencies - at)))
    known = [n for n, mode in enumerate(curves.modes) if mode.kinds[number]]
    known.sort(key=lambda n: abs(curves.modes[n].wavenumbers[number].imag))
    for n in sorted(known[:MOST_SHAPES]):
        shape = curves.modes[n].shapes[number]
        turned = shape * np.exp(-1j * np.angle(shape[0, 1])) / np.abs(shape).max()
        pale = 1.0 if curves.modes[n].is_wave[number] else PALE
        for axis, part in ((0, turned[:, 1].real), (1, turned[:, 0].real)):
            axes[axis].plot(part, 1e3 * curves.depths, color=colour(n), lw=2, alpha=pale)
    titles = (f"shapes at {curves.frequencies[number]:.0f} Hz: into the body", "along the surface")
    for ax, title in zip(axes, titles, strict=True):
        ax.invert_yaxis()
        ax.set_title(title, fontsize="medium")
        ax.axvline(0, color="0.6", lw=0.8, zorder=0)
        ax.set(xlim=(-1.05, 1.05), ylabel="depth, mm")
        ax.grid(alpha=0.25)
    axes[-1].set_xlabel("displacement over the largest of the mode")
