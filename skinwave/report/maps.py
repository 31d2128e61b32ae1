"""Figures of surfaces: maps of RMS vibration, and snapshots of waves."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patheffects import withStroke

from fem.load_and_probe import facets_below
from simple_model import MovingPressure
from simple_model.load.path_cells import path_cells
from simple_model.quantities import DISPLACEMENT, PRESSURE
from skinwave.report.figures import REPORT, legend, panels, with_style
from skinwave.report.palette import SEQUENTIAL, SIGNED, colour, ink_colour, label
from skinwave.report.styles import Style
from skinwave.results.propagation import NEAR, OUTSIDE, mach_angle
from skinwave.results.surface import SurfaceField
from skinwave.results.views import View, path_points
from skinwave.scene.scene import Scene
from skinwave.typing import Floats, Ints


def rms_text(pressure: MovingPressure) -> str:
    """Say what a map under a load shows."""
    if not path_cells(pressure).of_tacton:
        return "RMS of the steady vibration about its mean."
    return (
        "RMS about the mean over the whole Tacton, as if it were repeated without a pause, because "
        "the Tacton is too irregular for a steady vibration."
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredPlaces:
    """Measured places (p, 2) in m, and the RMS displacement (p,) in m there."""

    places: Floats
    rms: Floats


@with_style
def surfaces_figure(
    scene: Scene, surfaces: Mapping[str, SurfaceField], style: Style = REPORT, *,
    measured: MeasuredPlaces | None = None,
) -> Figure:  # fmt: skip
    """Draw maps of RMS vibration and the path of the focus.

    `surfaces` are maps by column, or one map by its title. If there is a point kernel, all maps
    outline its region. `measured` values have the colours of maps of displacement.
    """
    kernel = next((each for each in surfaces.values() if each.quantity is PRESSURE), None)
    alone = len(surfaces) == 1
    figure, axes = panels(len(surfaces), style, 5.0 if alone else 3.85)
    entries: dict[str, Any] = _path_entry(scene, "white")
    raised = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    orange, pink = "#ff9e4a", "#ff2fd0"  # the kernel's -20 dB, the detection threshold
    for ax, (column, surface) in zip(axes, surfaces.items(), strict=True):
        quantity = surface.quantity
        power = int(np.floor(np.log10(float(np.nanmax(surface.unit_rms)) or 1.0)))
        power = 0 if -3 <= power < 4 else power  # numbers of the colour bar are short without it
        shown = np.maximum(_finer(surface.unit_rms), 0.0) / 10.0**power
        (left, right), (low, high) = 1e3 * surface.x[[0, -1]], 1e3 * surface.y[[0, -1]]
        beyond = (right - left) / (shown.shape[1] - 1) / 2  # half a pixel
        image = ax.imshow(
            shown, cmap=SEQUENTIAL, vmin=0, origin="lower",
            extent=(left - beyond, right + beyond, low - beyond, high + beyond),
        )  # fmt: skip
        ax.set(xlim=(left, right), ylim=(low, high))
        borders = [(surface, NEAR, "white", "solid", f"{NEAR:g} dB")]
        if kernel is not None:
            borders.insert(0, (kernel, OUTSIDE, orange, "dashed", f"kernel's {OUTSIDE:g} dB"))
        for field, drop, ink, dashes, name in borders:
            level = np.nanmax(field.rms) * 10 ** (drop / 20)
            if _draw_border(ax, field, field.rms, level, ink, dashes):
                entries[name] = {**_outlined(ink), "ls": dashes}
        level_map = surface.level
        if level_map is not None and _draw_border(ax, surface, level_map, 0.0, pink, "solid"):
            entries["detection threshold"] = {"color": pink, "ls": "solid"}
        draw_path(ax, scene, "white")
        extend = _draw_measured(ax, surface, image, measured, power) if measured else "neither"
        note = f" ({surface.note})" * bool(surface.note and not alone)
        ax.set_title(label(column) + note, fontsize="medium")
        symbol = "" if quantity in (DISPLACEMENT, PRESSURE) else f" ${quantity.symbol}$,"
        factor = f"10{str(power).translate(raised)} " if power else ""
        title = f"RMS about the mean,{symbol} {factor}{quantity.shown}"
        figure.colorbar(image, ax=ax, label=title, extend=extend)
    if measured:
        entries["measured, in the map's colours"] = {
            "ls": "", "marker": "s", "mfc": "0.8", "mec": colour("measured"), "ms": 8
        }  # fmt: skip
    legend(figure, entries)
    return figure


def draw_path(ax: Axes, scene: Scene, ink: str) -> None:
    """Draw the path of the focus, or the place where it rests."""
    (style,) = _path_entry(scene, ink).values()
    ax.plot(*(1e3 * path_points(scene).T), **style)


def _path_entry(scene: Scene, ink: str) -> dict[str, dict[str, Any]]:
    """Return the properties of the path of a focus, or of a focus at rest, by its name."""
    if scene.tacton.trajectory.is_static:
        return {"focus, at rest": {**_outlined(ink), "ls": "none", "marker": "+"}}
    return {"path of the focus": {**_outlined(ink), "ls": "dotted", "lw": 1.4}}


def _outlined(ink: str) -> dict[str, Any]:
    """Return the properties of a line: white and black ones are visible on every background."""
    edges = {"white": "0.4", "black": "white"}
    effects = [withStroke(linewidth=2.3, foreground=edges[ink])] if ink in edges else []
    return {"color": ink, "path_effects": effects}


def _finer(field: Floats, fewest: int = 250) -> Floats:
    """Return a field (ny, nx) on a finer grid, for smooth maps; nan where it is nearer to nan.

    The longer side of the grid has at least `fewest` points.
    """
    from scipy.interpolate import RectBivariateSpline, RegularGridInterpolator
    from scipy.ndimage import distance_transform_edt, gaussian_filter

    rows, columns = (np.arange(n, dtype=np.float64) for n in field.shape)
    if min(field.shape) < 4:
        return field
    missing = np.isnan(field)
    nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
    times = -(-fewest // max(field.shape))
    fine = tuple(np.linspace(0, n - 1, times * (n - 1) + 1) for n in field.shape)
    values = RectBivariateSpline(rows, columns, field[tuple(nearest)])(*fine)
    off = RegularGridInterpolator((rows, columns), gaussian_filter(missing.astype(float), 1.0))
    values[off(tuple(np.meshgrid(*fine, indexing="ij"))) > 0.5] = np.nan
    return np.asarray(values)


def _draw_border(
    ax: Axes, surface: SurfaceField, field: Floats, level: float, colour: str, dashes: str
) -> bool:
    """Draw the contour of a field (ny, nx) at a level; return whether it exists."""
    if not np.nanmin(field) < level < np.nanmax(field):
        return False
    fine = _finer(field)
    x = 1e3 * np.linspace(surface.x[0], surface.x[-1], fine.shape[1])
    y = 1e3 * np.linspace(surface.y[0], surface.y[-1], fine.shape[0])
    lines = ax.contour(x, y, fine, [level], colors=colour, linewidths=1.4, linestyles=dashes)
    lines.set_path_effects(_outlined(colour)["path_effects"])
    return True


def _draw_measured(
    ax: Axes, surface: SurfaceField, image: AxesImage, measured: MeasuredPlaces, power: int
) -> Literal["neither", "max"]:
    """Draw measured places on a map; return the `extend` option of its colour bar."""
    low, high = ((surface.x[end], surface.y[end]) for end in (0, -1))
    within = ((measured.places >= low) & (measured.places <= high)).all(axis=1)
    x, y = 1e3 * measured.places[within].T
    style: dict[str, Any] = {
        "marker": "s", "s": 62, "linewidths": 1.4, "zorder": 5, "edgecolors": colour("measured")
    }  # fmt: skip
    if surface.quantity is not DISPLACEMENT:
        ax.scatter(x, y, **style, facecolors="none")
        return "neither"
    rms = DISPLACEMENT.per_unit * measured.rms[within] / 10.0**power
    least, most = image.get_clim()
    ax.scatter(x, y, **style, c=rms, cmap=image.cmap, vmin=least, vmax=most)
    return "max" if rms.max(initial=0.0) > most else "neither"


def interpolation(view: View, places: Floats) -> Callable[[Floats], Floats]:
    """Return the function of surface values (s,) that interpolates them at places (..., 2)."""
    return on_triangles(view.points[view.surface], view.triangles, places)


def on_triangles(points: Floats, triangles: Ints, places: Floats) -> Callable[[Floats], Floats]:
    """Return the function that interpolates values (s,) at points (s, 3) to places (..., 2).

    It interpolates on triangles (k, 3), and returns nan beside them.
    """
    owner, weights = facets_below(points[triangles], places.reshape(-1, 2))
    on = (owner >= 0).reshape(places.shape[:-1])
    nodes, weights = triangles[owner[owner >= 0]], weights[owner >= 0]

    def interpolate(values: Floats) -> Floats:
        at = np.full(on.shape, np.nan)
        at[on] = (values[nodes] * weights).sum(axis=-1)
        return at

    return interpolate


@with_style
def snapshots_figure(
    views: Sequence[View], style: Style, count: int = 4, pixels: int = 201
) -> Figure:
    """Draw the surface of each model relative to its largest motion, at a few times.

    At the first time the last model moves most. The others divide a turn of the focus or, if it
    rests, a period of the strongest tone into equal parts. Each side of a map has so many `pixels`.
    """
    count = min(count, 2) if style.is_narrow else count
    frames = _snapshot_frames(views[-1], count)
    reach = np.min([np.abs(view.places).max(axis=0) for view in views], axis=0)  # common to all
    raster = np.stack(np.meshgrid(*(np.linspace(-r, r, pixels) for r in reach)), axis=-1)
    extent = tuple(1e3 * np.outer(reach, (-1, 1)).ravel())
    size = style.size(2.7 * count + 2.0, 2.7 * len(views) + 1.0)
    if style.is_narrow:
        size = size[0], 0.4 * size[0] * len(views) + 0.9
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(len(views), count, sharex=True, sharey=True, squeeze=False)
    for row, view in zip(axes, views, strict=True):
        sampled = interpolation(view, raster)
        for frame, ax in zip(frames, row, strict=True):
            image = ax.imshow(
                sampled(view.inward[frame] / view.peak), cmap=SIGNED, vmin=-1, vmax=1,
                extent=extent, origin="lower",
            )  # fmt: skip
            ax.autoscale(False)
            if not view.scene.tacton.trajectory.is_static:
                draw_path(ax, view.scene, "black")
            _draw_focus(ax, view, float(view.times[frame]))
        name = f"{label(view.column)}\n±1 = {view.quantity.text(view.peak)}\ny, mm"
        row[0].set_ylabel(name, color=ink_colour(view.column))
    for frame, ax in zip(frames, axes[0], strict=True):
        ax.set_title(f"{1e3 * views[0].times[frame]:.2f} ms")
    for ax in axes[-1]:
        ax.set_xlabel("x, mm")
    title = "motion into the body about its mean\nover the model's largest"
    figure.colorbar(image, ax=axes, label=title, shrink=0.6)
    legend(figure, _focus_legend(views, style))
    return figure


def _snapshot_frames(view: View, count: int) -> list[int]:
    frequency = view.scene.tacton.trajectory.drawing_frequency or view.tone
    turn = min(1 / frequency, view.period) if frequency else view.period
    frames = len(view.times)
    first, step = view.peak_frame, frames * turn / view.period / count
    return [(first + round(k * step)) % frames for k in range(count)]


def _mach_angle(view: View) -> float | None:
    """Return the Mach angle in rad, or None if the focus is slower than the surface wave."""
    path = view.scene.tacton.trajectory
    return None if path.is_static or not view.speed else mach_angle(view.speed, path.speed)


def _focus_legend(views: Sequence[View], style: Style) -> dict[str, dict[str, Any]]:
    entries = {"focus": {**_outlined("black"), "marker": "o", "mfc": "none", "ls": "none"}}
    if not views[0].scene.tacton.trajectory.is_static:
        entries |= _path_entry(views[0].scene, "black")
    angles = [f"{label(view.column)} {np.rad2deg(angle):.0f}°"
              for view in views if (angle := _mach_angle(view))]  # fmt: skip
    if angles:
        between = "\n" if style.is_narrow else " "
        title = f"Mach angle on a straight path:{between}{', '.join(angles)}"
        entries[title] = _outlined("black")
    return entries


def _draw_focus(ax: Axes, view: View, time: float, length: float = 0.025) -> None:
    """Draw the focus and, if it is faster than the surface wave, lines at the Mach angle behind it.

    The lines have a `length` in m, or end where the body ends.
    """
    path = view.scene.tacton.trajectory
    focus = path.position(time)
    ax.plot(*(1e3 * focus), marker="o", mfc="none", ms=6, mew=1.2, **_outlined("black"))
    if (angle := _mach_angle(view)) is None:
        return
    ahead = path.position(time + 1e-5) - focus
    heading = np.arctan2(ahead[1], ahead[0])
    reach = np.linspace(0, length, 201)
    for side in (-1, 1):
        back = heading + np.pi + side * angle
        line = focus + reach[:, None] * [np.cos(back), np.sin(back)]
        on_body = np.isfinite(interpolation(view, line)(view.points[view.surface, 2]))
        end = len(line) if on_body.all() else int(on_body.argmin())
        ax.plot(*(1e3 * line[:end].T), lw=1.2, **_outlined("black"))
