"""Maps: how waves run over a surface, in snapshots, and RMS vibration of kernel and bodies."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from simple_model.quantities import DISPLACEMENT, PRESSURE
from skinwave.report.figures import REPORT, legend, panels, styled
from skinwave.report.palette import COLOURS, SEQUENTIAL, SIGNED, inked, label
from skinwave.report.styles import Style
from skinwave.results.propagation import NEAR, OUTSIDE
from skinwave.results.speeds import mach_angle
from skinwave.results.surface import SurfaceField
from skinwave.results.views import View, path_points
from skinwave.scene.scene import Scene
from skinwave.typing import Floats

PIXELS = 201  # of a snapshot's side
SNAPSHOT, SIDE, ALONE = 2.7, 3.85, 5.0  # inch: of a snapshot, a map with its bar, and one alone
KERNEL, THRESHOLD = "#ff9e4a", "#ff2fd0"  # borders: the kernel's -20 dB, the detection threshold
MEASURED_EDGE = COLOURS["measured"]
SURFACES = (
    "RMS of the steady vibration about its mean. Beyond the dashed line the point kernel predicts "
    "less than a tenth of its largest value: the body moves there because waves propagate. Within "
    "the pink line the strongest component is above the detection threshold of skin."
)
BESIDE = (
    "Squares: where was measured, in the colours of the map, by the RMS of the measured lines of "
    "the load as displacement, without gain; an arrow at the end of a colour bar says that a place "
    "has more. The kernel's map is a pressure, on which squares are places alone."
)


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredPlaces:
    """Measured `places` (p, 2) in metre, and the `rms` (p,) in metre of the displacement there."""

    places: Floats
    rms: Floats


@styled
def surfaces_figure(
    scene: Scene,
    surfaces: Mapping[str, SurfaceField],
    style: Style = REPORT,
    *,
    measured: MeasuredPlaces | None = None,
) -> Figure:
    """RMS of each column's vibration with its unit, and the path of the focus.

    Parameters
    ----------
    scene : Scene
    surfaces : by column, or by title of a map alone; the border of the region of the point kernel
        is drawn on all if it is among them
    style : Style
    measured : drawn over maps of displacement on their own scale, and over others as mere places
    """
    kernel = next((each for each in surfaces.values() if each.quantity is PRESSURE), None)
    alone = len(surfaces) == 1
    figure, axes = panels(len(surfaces), style, ALONE if alone else SIDE)
    entries: dict[str, Any] = {"path of the focus": {"color": "0.6", "ls": "dotted"}}
    for ax, (column, found) in zip(axes, surfaces.items(), strict=True):
        extent = tuple(1e3 * np.array([*found.x[[0, -1]], *found.y[[0, -1]]]))
        image = ax.imshow(found.shown, cmap=SEQUENTIAL, vmin=0, origin="lower", extent=extent)
        borders = [(found.rms, NEAR, "white", "solid", f"{NEAR:g} dB")]
        if kernel is not None:
            borders.insert(0, (kernel.rms, OUTSIDE, KERNEL, "dashed", f"kernel's {OUTSIDE:g} dB"))
        for field, drop, colour, dashes, name in borders:
            level = np.nanmax(field) * 10 ** (drop / 20)
            if _border(ax, found, field, level, colour, dashes):
                entries[name] = {"color": colour.replace("white", "0.6"), "ls": dashes}
        if found.level is not None and _border(ax, found, found.level, 0.0, THRESHOLD, "solid"):
            entries["threshold of detection"] = {"color": THRESHOLD, "ls": "solid"}
        draw_path(ax, scene, "white")
        beyond = _draw_measured(ax, found, image, measured) if measured else "neither"
        note = f" ({found.note})" * bool(found.note and not alone)
        ax.set_title(label(column) + note, fontsize="medium")
        asked = found.quantity
        symbol = "" if asked in (DISPLACEMENT, PRESSURE) else f" ${asked.symbol}$,"
        title = f"RMS about the mean,{symbol} {asked.shown}"
        bar = figure.colorbar(image, ax=ax, label=title, extend=beyond)
        bar.ax.ticklabel_format(axis="y", scilimits=(-3, 4))  # labels of a few letters
    if measured:
        entries["measured, in the map's colours"] = {
            "ls": "", "marker": "s", "mfc": "0.8", "mec": MEASURED_EDGE, "ms": 8
        }  # fmt: skip
    legend(figure, entries)
    return figure


def draw_path(ax: Axes, scene: Scene, ink: str) -> None:
    """The path of the focus, or the place where it rests."""
    path = 1e3 * path_points(scene)
    drawn = {"ls": "dotted", "lw": 1.2} if len(path) > 1 else {"ls": "none", "marker": "+"}
    ax.plot(*path.T, color=ink, **drawn)


def _border(
    ax: Axes, found: SurfaceField, field: Floats, level: float, colour: str, dashes: str
) -> bool:
    """Draw where a field (ny, nx) has a level; whether it is anywhere."""
    if not np.nanmin(field) < level < np.nanmax(field):
        return False
    x, y = 1e3 * found.x, 1e3 * found.y
    ax.contour(x, y, field, [level], colors=colour, linewidths=1.3, linestyles=dashes)
    return True


def _draw_measured(
    ax: Axes, surface: SurfaceField, image: AxesImage, measured: MeasuredPlaces
) -> Literal["neither", "max"]:
    """Measured places on a map; whether any has more than the largest of its colours."""
    low, high = ((surface.x[end], surface.y[end]) for end in (0, -1))
    within = ((measured.places >= low) & (measured.places <= high)).all(axis=1)
    x, y = 1e3 * measured.places[within].T
    style: dict[str, Any] = {"marker": "s", "s": 62, "linewidths": 1.4, "zorder": 5}
    style["edgecolors"] = MEASURED_EDGE
    if surface.quantity is not DISPLACEMENT:
        ax.scatter(x, y, **style, facecolors="none")
        return "neither"
    rms = DISPLACEMENT.per_unit * measured.rms[within]
    least, most = image.get_clim()
    ax.scatter(x, y, **style, c=rms, cmap=image.cmap, vmin=least, vmax=most)
    return "max" if rms.max(initial=0.0) > most else "neither"


def carrier(view: View, places: Floats) -> Callable[[Floats], Floats]:
    """Linear interpolation of values (s,) of a view's surface to places (..., 2)."""
    owner = view.finder(places[..., 0], places[..., 1])
    on = owner >= 0
    found = view.triangles[owner[on]]
    corners = view.places[found]  # (q, 3, 2)
    edges = corners[:, 1:] - corners[:, :1]
    inside = (places[on] - corners[:, 0])[..., None]
    second_third = np.linalg.solve(edges.swapaxes(-1, -2), inside)[..., 0]
    weights = np.column_stack([1 - second_third.sum(axis=-1), second_third])

    def carried(values: Floats) -> Floats:
        at = np.full(on.shape, np.nan)
        at[on] = (values[found] * weights).sum(axis=-1)
        return at

    return carried


@styled
def snapshots_figure(views: Sequence[View], style: Style, count: int = 4) -> Figure:
    """The surface of each model, over its own largest motion, when the last of them moves most and
    after equal parts of a turn of the focus or, if it rests, of a period of the strongest tone.
    """
    count = min(count, 2) if style.is_narrow else count
    frames = _shown_frames(views[-1], count)
    reach = np.min([np.abs(view.places).max(axis=0) for view in views], axis=0)  # of all surfaces
    raster = np.stack(np.meshgrid(*(np.linspace(-r, r, PIXELS) for r in reach)), axis=-1)
    extent = tuple(1e3 * np.outer(reach, (-1, 1)).ravel())
    size = style.size(SNAPSHOT * count + 2.0, SNAPSHOT * len(views) + 1.0)
    if style.is_narrow:
        size = size[0], 0.4 * size[0] * len(views) + 0.9
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(len(views), count, sharex=True, sharey=True, squeeze=False)
    for row, view in zip(axes, views, strict=True):
        sampled = carrier(view, raster)
        for frame, ax in zip(frames, row, strict=True):
            image = ax.imshow(
                sampled(view.pushed[frame] / view.peak), cmap=SIGNED, vmin=-1, vmax=1,
                extent=extent, origin="lower",
            )  # fmt: skip
            draw_path(ax, view.scene, "black")
            _draw_focus(ax, view, float(view.times[frame]))
        name = f"{label(view.column)}\n±1 = {view.quantity.text(view.peak)}\ny, mm"
        row[0].set_ylabel(name, color=inked(view.column))
    for frame, ax in zip(frames, axes[0], strict=True):
        ax.set_title(f"{1e3 * views[0].times[frame]:.2f} ms")
    for ax in axes[-1]:
        ax.set_xlabel("x, mm")
    what = "motion into the body about its mean\nover the model's largest"
    figure.colorbar(image, ax=axes, label=what, shrink=0.6)
    legend(figure, _focus_legend(views, style))
    return figure


def _shown_frames(view: View, count: int) -> list[int]:
    frequency = view.scene.tacton.trajectory.drawing_frequency or view.tone
    turn = min(1 / frequency, view.period) if frequency else view.period
    frames = len(view.times)
    first, step = int(np.abs(view.pushed).max(axis=1).argmax()), frames * turn / view.period / count
    return [(first + round(k * step)) % frames for k in range(count)]


def _outrun(view: View) -> float | None:
    """Mach angle of a view whose focus moves faster than its surface wave."""
    path = view.scene.tacton.trajectory
    return None if path.is_static or not view.speed else mach_angle(view.speed, path.speed)


def _focus_legend(views: Sequence[View], style: Style) -> dict[str, dict[str, Any]]:
    entries: dict[str, dict[str, Any]] = {
        "path": {"color": style.ink, "ls": "dotted"},
        "focus": {"color": style.ink, "marker": "o", "mfc": "none", "ls": "none"},
    }
    angles = [f"{label(view.column)} {np.rad2deg(angle):.0f}°"
              for view in views if (angle := _outrun(view))]  # fmt: skip
    if angles:
        between = "\n" if style.is_narrow else " "
        said = f"Mach angle of a straight path:{between}{', '.join(angles)}"
        entries[said] = {"color": style.ink}
    return entries


def _draw_focus(ax: Axes, view: View, time: float) -> None:
    """The focus, and behind it the Mach angle if it outruns the surface wave."""
    path = view.scene.tacton.trajectory
    x, y = 1e3 * path.position(time)
    ax.plot(x, y, marker="o", mfc="none", mec="black", ms=6, mew=1.2)
    if (angle := _outrun(view)) is None:
        return
    ahead = path.position(time + 1e-5) - path.position(time)
    heading = np.arctan2(ahead[1], ahead[0])
    for side in (-1, 1):
        back = heading + np.pi + side * angle
        ax.plot([x, x + 25 * np.cos(back)], [y, y + 25 * np.sin(back)], color="black", lw=1.2)
