"""Maps of RMS vibration, the point kernel's and bodies' under the same load, side by side."""

from collections.abc import Mapping

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from skinwave.pictures.figures import REPORT, label
from skinwave.pictures.maps import draw_path
from skinwave.pictures.styles import Style
from skinwave.propagation import NEAR, OUTSIDE
from skinwave.scene import Scene
from skinwave.surface import SurfaceMap

COLOURS = "cividis"  # distinct for every kind of colour vision
SIDE = 3.1  # inch of a map


def surfaces_figure(
    scene: Scene, surfaces: Mapping[str, SurfaceMap], style: Style = REPORT
) -> Figure:
    """RMS of each column's vibration with its unit, the border of the kernel's region, and the
    path; the first of the columns is the kernel.
    """
    with mpl.rc_context(style.rc):
        return _surfaces_figure(scene, surfaces, style)


def _surfaces_figure(scene: Scene, surfaces: Mapping[str, SurfaceMap], style: Style) -> Figure:
    kernel, count, narrow = next(iter(surfaces.values())), len(surfaces), style.is_narrow
    size = style.size((SIDE + 0.75) * count, SIDE + 0.75)
    size = (size[0], 0.85 * size[0] * count + 0.5) if narrow else size
    figure = Figure(figsize=size, layout="constrained")
    grid = (count, 1) if narrow else (1, count)
    axes = figure.subplots(*grid, sharex=True, sharey=True, squeeze=False).ravel()
    for ax, (column, surface) in zip(axes, surfaces.items(), strict=True):
        x, y = 1e3 * surface.x, 1e3 * surface.y
        scale, unit = (1e6, "µm") if surface.unit == "m" else (1.0, "Pa")
        extent = (x[0], x[-1], y[0], y[-1])
        image = ax.imshow(scale * surface.rms, cmap=COLOURS, vmin=0, origin="lower", extent=extent)
        for field, drop, colour, dashes in (
            (kernel.rms, OUTSIDE, "#ff9e4a", "dashed"),
            (surface.rms, NEAR, "white", "solid"),
        ):
            level = np.nanmax(field) * 10 ** (drop / 20)
            if np.nanmin(field) < level:
                ax.contour(x, y, field, [level], colors=colour, linewidths=1.3, linestyles=dashes)
        draw_path(ax, scene, "white")
        ax.set_title(label(column) + f" ({surface.note})" * bool(surface.note), fontsize="medium")
        ax.set_xlabel("x, mm")
        figure.colorbar(image, ax=ax, label=f"RMS about the mean, {unit}", shrink=0.85)
    for ax in axes if narrow else axes[:1]:
        ax.set_ylabel("y, mm")
    inks = (("#ff9e4a", "dashed"), ("0.6", "solid"), ("0.6", "dotted"))
    handles = [Line2D([], [], color=ink, ls=dashes) for ink, dashes in inks]
    labels = [f"kernel's {OUTSIDE:g} dB", f"{NEAR:g} dB", "path of the focus"]
    figure.legend(
        handles, labels, loc="outside lower center", ncols=1 if narrow else 3, frameon=False
    )
    return figure


SURFACES = (
    "RMS of the steady vibration about its mean. Beyond the dashed line the point kernel predicts "
    "less than a tenth of its largest; motion of the body there is due to propagation, with the "
    "waves that its edges reflect."
)
