"""How waves run over a surface: snapshots side by side."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from meshes.tetmesh import Floats
from skinwave.models.speeds import mach_angle
from skinwave.report.figures import legend
from skinwave.report.palette import SIGNED, inked, label
from skinwave.report.styles import Style
from skinwave.report.surfaces import draw_path
from skinwave.results.views import View

PIXELS = 201  # of a map's side
MAP = 2.7  # inch, side of a snapshot


@dataclass(frozen=True, kw_only=True, eq=False)
class Raster:
    """A regular grid of places over the part of the surface that all models have; in metre."""

    x: Floats
    y: Floats

    @property
    def frame(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top in mm, as images want it."""
        x, y = 1e3 * self.x, 1e3 * self.y
        return float(x[0]), float(x[-1]), float(y[0]), float(y[-1])


def common_raster(views: Sequence[View]) -> Raster:
    """A grid over what the surfaces of several views have in common."""
    reach = np.min([np.abs(view.places).max(axis=0) for view in views], axis=0)
    return Raster(x=np.linspace(-reach[0], reach[0], PIXELS),
                  y=np.linspace(-reach[1], reach[1], PIXELS))  # fmt: skip


def sampler(view: View, raster: Raster) -> Callable[[Floats], Floats]:
    """Linear interpolation of values (s,) of a view's surface onto a grid (y, x)."""
    X, Y = np.meshgrid(raster.x, raster.y)
    return carrier(view, np.stack([X, Y], axis=-1))


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


def snapshots_figure(views: Sequence[View], style: Style, count: int = 4) -> Figure:
    """The surface of each model, over its own largest motion, when the last of them moves most and
    after equal parts of a turn of the focus or, if it rests, of a period of the strongest tone.
    """
    count = min(count, 2) if style.is_narrow else count
    raster, frames = common_raster(views), _shown_frames(views[-1], count)
    with mpl.rc_context(style.rc):
        size = style.size(MAP * count + 2.0, MAP * len(views) + 1.0)
        if style.is_narrow:
            size = size[0], 0.4 * size[0] * len(views) + 0.9
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots(len(views), count, sharex=True, sharey=True, squeeze=False)
        for row, view in zip(axes, views, strict=True):
            sampled = sampler(view, raster)
            for frame, ax in zip(frames, row, strict=True):
                image = ax.imshow(
                    sampled(view.pushed[frame] / view.peak), cmap=SIGNED, vmin=-1,
                    vmax=1, extent=raster.frame, origin="lower",
                )  # fmt: skip
                draw_path(ax, view.scene, "black")
                _draw_focus(ax, view, float(view.times[frame]))
            largest = view.quantity.text(view.peak)
            name = f"{label(view.column)}\n±1 = {largest}\ny, mm"
            row[0].set_ylabel(name, color=inked(view.column))
        for frame, ax in zip(frames, axes[0], strict=True):
            ax.set_title(f"{1e3 * views[0].times[frame]:.2f} ms")
        for ax in axes[-1]:
            ax.set_xlabel("x, mm")
        figure.colorbar(image, ax=axes, label="motion into the body about its mean\n"
                        "over the model's largest", shrink=0.6)  # fmt: skip
        legend(figure, _focus_legend(views, style))
    return figure


def _shown_frames(view: View, count: int) -> list[int]:
    frequency = view.scene.tacton.trajectory.drawing_frequency or view.tone
    turn = min(1 / frequency, view.period) if frequency else view.period
    frames = len(view.times)
    first, step = int(np.abs(view.pushed).max(axis=1).argmax()), frames * turn / view.period / count
    return [(first + round(k * step)) % frames for k in range(count)]


def _focus_legend(views: Sequence[View], style: Style) -> dict[str, dict[str, Any]]:
    entries: dict[str, dict[str, Any]] = {
        "path": {"color": style.ink, "ls": "dotted"},
        "focus": {"color": style.ink, "marker": "o", "mfc": "none", "ls": "none"},
    }
    angles = []
    for view in views:
        angle = view.speed and mach_angle(view.speed, view.scene.tacton.trajectory.speed)
        if angle and not view.scene.tacton.trajectory.is_static:
            angles.append(f"{label(view.column)} {np.rad2deg(angle):.0f}°")
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
    if path.is_static or view.speed is None:
        return
    if (angle := mach_angle(view.speed, path.speed)) is None:
        return
    ahead = path.position(time + 1e-5) - path.position(time)
    heading = np.arctan2(ahead[1], ahead[0])
    for side in (-1, 1):
        back = heading + np.pi + side * angle
        ax.plot([x, x + 25 * np.cos(back)], [y, y + 25 * np.sin(back)], color="black", lw=1.2)
