"""Maps of RMS vibration: the point kernel's and bodies' under the same load, or of any quantity."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from meshes.tetmesh import Floats
from simple_model.quantities import DISPLACEMENT, PRESSURE
from skinwave.report.figures import REPORT, legend, panels
from skinwave.report.palette import COLOURS, SEQUENTIAL, label
from skinwave.report.styles import Style
from skinwave.results.propagation import NEAR, OUTSIDE
from skinwave.results.surface import SurfaceField
from skinwave.results.views import path_points
from skinwave.scene.scene import Scene

SIDE, ALONE = 3.85, 5.0  # inch of a map with its bar, beside others and alone
KERNEL, THRESHOLD = "#ff9e4a", "#ff2fd0"  # borders: the kernel's -20 dB, the detection threshold
MEASURED_EDGE = COLOURS["measured"]
SURFACES = (
    "RMS of the steady vibration about its mean. Beyond the dashed line the point kernel predicts "
    "less than a tenth of its largest; motion of the body there is due to propagation, with the "
    "waves that its edges reflect. Within the pink line the strongest component of skin is above "
    "the threshold of detection for a focal spot."
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

    Returns
    -------
    Figure
    """
    kernel = next((each for each in surfaces.values() if each.quantity is PRESSURE), None)
    with mpl.rc_context(style.rc):
        alone = len(surfaces) == 1
        figure, axes = panels(len(surfaces), style, ALONE if alone else SIDE)
        entries: dict[str, Any] = {"path of the focus": {"color": "0.6", "ls": "dotted"}}
        for ax, (column, found) in zip(axes, surfaces.items(), strict=True):
            extent = tuple(1e3 * np.array([*found.x[[0, -1]], *found.y[[0, -1]]]))
            image = ax.imshow(
                found.shown, cmap=SEQUENTIAL, vmin=0, origin="lower", extent=extent
            )  # fmt: skip
            if kernel is not None and _contour(ax, found, kernel.rms, OUTSIDE, KERNEL, "dashed"):
                entries[f"kernel's {OUTSIDE:g} dB"] = {"color": KERNEL, "ls": "dashed"}
            if _contour(ax, found, found.rms, NEAR, "white", "solid"):
                entries[f"{NEAR:g} dB"] = {"color": "0.6", "ls": "solid"}
            if found.level is not None and _line(ax, found, found.level, 0.0, THRESHOLD, "solid"):
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
    if len(path) > 1:
        ax.plot(*path.T, color=ink, ls="dotted", lw=1.2)
    else:
        ax.plot(*path.T, color=ink, marker="+", ls="none")


def _contour(
    ax: Axes, found: SurfaceField, field: Floats, drop: float, colour: str, dashes: str
) -> bool:
    """Draw where a field (ny, nx) is so many dB below its largest; whether it is anywhere."""
    level = np.nanmax(field) * 10 ** (drop / 20)
    return _line(ax, found, field, level, colour, dashes)


def _line(
    ax: Axes, found: SurfaceField, field: Floats, level: float, colour: str, dashes: str
) -> bool:
    if not np.nanmin(field) < level < np.nanmax(field):
        return False
    ax.contour(1e3 * found.x, 1e3 * found.y, field, [level], colors=colour, linewidths=1.3,
               linestyles=dashes)  # fmt: skip
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
