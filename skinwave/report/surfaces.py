"""Maps of RMS vibration, the point kernel's and bodies' under the same load, side by side."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D

from meshes.tetmesh import Floats
from skinwave.report.figures import REPORT
from skinwave.report.maps import draw_path
from skinwave.report.palette import COLOURS, SEQUENTIAL, label
from skinwave.report.styles import Style
from skinwave.results.propagation import NEAR, OUTSIDE
from skinwave.results.surface import SurfaceMap
from skinwave.scene.scene import Scene

SIDE = 3.1  # inch of a map with its title and its axis
# Inch from the left and the bottom to a map, of the map, to its bar, of the bar, of what is beside.
LEFT, BOTTOM, MAP, GAP, BAR, BESIDE_BAR = 0.65, 0.97, 2.52, 0.08, 0.14, 0.76
MEASURED_EDGE = COLOURS["measured"]


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredPlaces:
    """Measured `places` (p, 2) in metre, and the `rms` (p,) in metre of the displacement there."""

    places: Floats
    rms: Floats


def surfaces_figure(
    scene: Scene,
    surfaces: Mapping[str, SurfaceMap],
    style: Style = REPORT,
    *,
    measured: MeasuredPlaces | None = None,
) -> Figure:
    """RMS of each column's vibration with its unit, the border of the kernel's region, and the
    path; the first of the columns is the kernel.

    Parameters
    ----------
    scene : Scene
    surfaces : by column
    style : Style
    measured : drawn over maps of displacement on their own scale, and over others as mere places

    Returns
    -------
    Figure
    """
    with mpl.rc_context(style.rc):
        return _surfaces_figure(scene, surfaces, style, measured)


def _surfaces_figure(
    scene: Scene,
    surfaces: Mapping[str, SurfaceMap],
    style: Style,
    measured: MeasuredPlaces | None,
) -> Figure:
    kernel, count, narrow = next(iter(surfaces.values())), len(surfaces), style.is_narrow
    size = style.size((SIDE + 0.75) * count, SIDE + 0.75)
    size = (size[0], 0.85 * size[0] * count + 0.5) if narrow else size
    fixed = style.columns is None  # margins: a computed layout takes as long as all the rest
    figure = Figure(figsize=size, layout=None if fixed else "constrained")
    grid = (count, 1) if narrow else (1, count)
    axes = figure.subplots(*grid, sharex=True, sharey=True, squeeze=False).ravel()
    for ax, (column, surface) in zip(axes, surfaces.items(), strict=True):
        x, y = 1e3 * surface.x, 1e3 * surface.y
        scale, unit = (1e6, "µm") if surface.unit == "m" else (1.0, "Pa")
        extent = (x[0], x[-1], y[0], y[-1])
        image = ax.imshow(
            scale * surface.rms, cmap=SEQUENTIAL, vmin=0, origin="lower", extent=extent
        )
        for field, drop, colour, dashes in (
            (kernel.rms, OUTSIDE, "#ff9e4a", "dashed"),
            (surface.rms, NEAR, "white", "solid"),
        ):
            level = np.nanmax(field) * 10 ** (drop / 20)
            if np.nanmin(field) < level:
                ax.contour(x, y, field, [level], colors=colour, linewidths=1.3, linestyles=dashes)
        draw_path(ax, scene, "white")
        beyond = _draw_measured(ax, surface, image, measured) if measured else "neither"
        ax.set_title(label(column) + f" ({surface.note})" * bool(surface.note), fontsize="medium")
        ax.set_xlabel("x, mm")
        where: dict[str, Any] = {"ax": ax, "shrink": 0.85}
        if fixed:
            where = {"cax": _placed(figure, ax, ax.get_subplotspec().colspan.start, count)}
        bar = figure.colorbar(image, **where, label=f"RMS about the mean, {unit}", extend=beyond)
        bar.ax.ticklabel_format(axis="y", scilimits=(-3, 4))  # labels of a few letters
    for ax in axes if narrow else axes[:1]:
        ax.set_ylabel("y, mm")
    inks = (("#ff9e4a", "dashed"), ("0.6", "solid"), ("0.6", "dotted"))
    handles = [Line2D([], [], color=ink, ls=dashes) for ink, dashes in inks]
    labels = [f"kernel's {OUTSIDE:g} dB", f"{NEAR:g} dB", "path of the focus"]
    if measured:
        handles.append(Line2D([], [], ls="", marker="s", mfc="0.8", mec=MEASURED_EDGE, ms=8))
        labels.append("measured, in the map's colours")
    where = {"loc": "lower center" if fixed else "outside lower center"}
    figure.legend(handles, labels, **where, ncols=1 if narrow else len(labels), frameon=False)
    return figure


def _placed(figure: Figure, ax: Axes, k: int, count: int) -> Axes:
    """Place the axes of a map, the k-th of some in a row, and those of its bar, which are new."""
    width, height = SIDE + 0.75, SIDE + 0.75  # of a map's part of the figure
    last = width * count - MAP - GAP - BAR - BESIDE_BAR
    left = LEFT + (last - LEFT) * k / max(count - 1, 1)
    across, up, y = width * count, height, BOTTOM / height
    ax.set_position((left / across, y, MAP / across, MAP / up))
    return figure.add_axes(((left + MAP + GAP) / across, y, BAR / across, MAP / up))


def _draw_measured(
    ax: Axes, surface: SurfaceMap, image: AxesImage, measured: MeasuredPlaces
) -> Literal["neither", "max"]:
    """Measured places on a map; whether any has more than the largest of its colours."""
    low, high = ((surface.x[end], surface.y[end]) for end in (0, -1))
    within = ((measured.places >= low) & (measured.places <= high)).all(axis=1)
    x, y = 1e3 * measured.places[within].T
    style: dict[str, Any] = {"marker": "s", "s": 62, "linewidths": 1.4, "zorder": 5}
    style["edgecolors"] = MEASURED_EDGE
    if surface.unit != "m":
        ax.scatter(x, y, **style, facecolors="none")
        return "neither"
    rms = 1e6 * measured.rms[within]
    least, most = image.get_clim()
    ax.scatter(x, y, **style, c=rms, cmap=image.cmap, vmin=least, vmax=most)
    return "max" if rms.max(initial=0.0) > most else "neither"


SURFACES = (
    "RMS of the steady vibration about its mean. Beyond the dashed line the point kernel predicts "
    "less than a tenth of its largest; motion of the body there is due to propagation, with the "
    "waves that its edges reflect."
)
BESIDE = (
    "Squares: where was measured, in the colours of the map, by the RMS of the measured lines of "
    "the load as displacement, without gain; an arrow at the end of a colour bar says that a place "
    "has more. The kernel's map is a pressure, on which squares are places alone."
)
