"""Three-dimensional pictures of views (pyvista, off screen): side by side, cut open, or from above.

Lengths are in mm. Cameras have no perspective, so that one scale bar is valid everywhere.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import floor, log10
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from meshes.tetmesh import boundary_facets
from simple_model.quantities import PRESSURE, quantity
from skinwave.report.maps import interpolation
from skinwave.report.palette import SEQUENTIAL, SIGNED, colour, label
from skinwave.report.styles import Style
from skinwave.results.views import View, path_points, split
from skinwave.typing import Floats, Ints

Image = NDArray[np.uint8]
Interpolation = Callable[[Floats], Floats]  # values (s,) of a surface -> values at some places
CAMERAS = {  # directions from the body to the camera
    "tilted": (-0.45, -1.0, 0.85), "front": (0.0, -1.0, 0.45), "top": (0.0, 0.0, 1.0),
}  # fmt: skip
LIFT = 0.004  # of the body's size: height of path, probes and focus above the surface
MARKS = {"path": "black", "focus": "black", "probes": "#ffd000"}  # their colours


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """Geometry of one view.

    Parameters
    ----------
    skin, nodes : triangles of its surface, and their nodes (n,)
    marks : meshes that move with the surface, each with the interpolation to its points
    focus, under_focus : the focus, and the interpolation to its place in every frame
    lift : mm, height of marks above the surface
    """

    view: View
    skin: Any
    nodes: Ints
    marks: list[tuple[Any, Interpolation]]
    focus: Any
    under_focus: Interpolation
    lift: float


def exaggeration(view: View, largest: float = 0.06) -> float:
    """Return the exaggeration of motion: 1, 2 or 5 times a power of ten; 0 for the point kernel.

    With it, the largest motion is at most `largest` times the width of the body.
    """
    if view.quantity is PRESSURE:
        return 0.0
    most = largest * float(np.ptp(view.places[:, 0])) / view.peak
    power = 10.0 ** floor(log10(most))
    return power * max(step for step in (1, 2, 5) if step * power <= most)


def scale_text(view: View) -> str:
    """Return the exaggeration as text and, unless it shows the motion, what the colour shows."""
    factor = exaggeration(view)
    if not factor:
        return "pressure, no motion"
    named = f"colour: {quantity(view.shade.quantity).words}; " if view.shade else ""
    return f"{named}exaggerated {factor:,.0f} times{', mean removed' * (not view.from_rest)}"


def picture(
    views: Sequence[View], style: Style, frame: int = 0, *, camera: str = "tilted",
    cut: bool = False,
) -> Image:  # fmt: skip
    """Return a picture (height, width, 3) of views side by side, from one of `CAMERAS`.

    With `cut`, the half of each body nearer to the camera is omitted. In print, one view has the
    width of a column, and several have that of a page.
    """
    width, height = style.panel
    page = style.page
    inch = style.size(page if len(views) > 1 else page / 2, page)[0] if style.columns else page
    larger = style.pixels(inch) / (len(views) * width + style.bar * height)
    panel = round(larger * width), round(larger * height)
    with stage(views, style, camera=camera, cut=cut, panel=panel, inch=inch) as show:
        return show(frame)


@contextmanager
def new_plotter(style: Style, size: tuple[int, int], panels: int = 1) -> Iterator[Any]:
    """Context manager of a plotter with panels side by side, each of a size in pixels."""
    import pyvista as pv
    from vtkmodules.vtkCommonCore import vtkLogger

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # no warnings, such as on displays
    plotter = pv.Plotter(
        off_screen=True, lighting="none", shape=(1, panels), border=False,
        window_size=(size[0] * panels, size[1]),
    )  # fmt: skip
    try:
        plotter.set_background(style.paper)
        plotter.theme.allow_empty_mesh = True  # of what lies beside a body, or was cut away
        yield plotter
    finally:
        plotter.close()


def raster(figure: Figure, dpi: float) -> Image:
    """Return the picture (height, width, 3) of a figure."""
    figure.dpi = dpi
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.array(canvas.buffer_rgba())[..., :3]


@contextmanager
def stage(
    views: Sequence[View], style: Style, *, camera: str = "tilted", cut: bool = False,
    panel: tuple[int, int] | None = None, inch: float | None = None,
) -> Iterator[Callable[[int], Image]]:  # fmt: skip
    """Context manager that builds a plotter once and yields a function from a frame to a picture.

    All views share a colour scale. Several views show motion into the body relative to the largest
    of each model, a single view in its unit. Other quantities are in their unit, from 0 if they
    have no sign. Letters are those of a picture that is `inch` wide, by default a page.
    """
    width, height = panel or style.panel
    column = round(style.bar * height)
    least_letter = 11.0  # pixels, in films
    letter = max(style.letter(width * len(views) + column, inch or style.page), least_letter)
    # Part of a panel that bodies fill, along its width and height, and the middle of that height.
    filled, middle = (0.92, 0.74), 0.44
    with new_plotter(style, (width, height), len(views)) as plotter:
        limits, bar = _colour_bar(views, style, letter, (column, height))
        panels = [make_panel(view, cut) for view in views]
        shown = [each for one in panels for each in (
            1e3 * one.view.points[one.nodes], scale_bar(1e3 * one.view.points)
        )]  # fmt: skip
        for k, view in enumerate(views):
            plotter.subplot(0, k)
            _draw_panel(plotter, panels[k], style, limits, letter, lit=camera != "top")
            if not (cut or len(view.tets)):  # the rim of the surface at rest
                low, high = view.places.min(axis=0), view.places.max(axis=0)
                rim = np.where([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]], high, low)
                plotter.add_mesh(_line(rim, 0.0), color="#9a9a9a", line_width=1)
            set_camera(plotter, CAMERAS[camera], np.vstack(shown), width / height, filled, middle)

        def show(frame: int) -> Image:
            set_frame(panels, frame, limits[1])
            plotter.subplot(0, 0)
            stamp = f"t = {1e3 * views[0].times[frame]:.2f} ms"
            write(plotter, stamp, (0.66, 0.03), letter, style.ink, name="time", render=False)
            plotter.render()  # otherwise the screenshot is the previous picture
            return np.hstack([plotter.screenshot(None, return_img=True), bar])

        yield show


def write(
    plotter: Any, text: str, place: tuple[float, float], letter: float, ink: str, **options: Any
) -> None:
    """Write text with letters of so many pixels at a place of the current panel."""
    plotter.add_text(
        text, position=place, viewport=True, font_size=letter / 2, color=ink,
        font_file=findfont("DejaVu Sans"), **options,
    )  # fmt: skip


def _colour_bar(
    views: Sequence[View], style: Style, letter: float, size: tuple[int, int]
) -> tuple[tuple[float, float], Image]:
    """Return the limits of the colour scale, and its picture of a size in pixels."""
    shades = [view.shade for view in views if view.shade]
    shown, most = views[0].quantity, views[0].quantity.per_unit * views[0].peak
    if shades:
        shown = quantity(shades[0].quantity)
        most = shown.per_unit * max(float(np.abs(shade.values).max()) for shade in shades) or 1.0
    is_relative = len(views) > 1 and not shades
    most, title = (1.0, "over the\nlargest") if is_relative else (most, shown.shown)
    limits = (0.0 if shades and shown.invariant is not None else -most, most)
    dpi = 72 * letter / style.font
    with mpl.rc_context(style.rc):
        figure = Figure(figsize=(size[0] / dpi, size[1] / dpi))
        ax = figure.add_axes((0.1, 0.12, 0.18, 0.66))
        scale = mpl.cm.ScalarMappable(Normalize(*limits), SIGNED if limits[0] else SEQUENTIAL)
        figure.colorbar(scale, cax=ax, ticks=MaxNLocator(6, steps=[1, 2, 5, 10]))
        figure.text(0.1, 0.8, title, va="bottom", ha="left")
        return limits, raster(figure, dpi)


def make_panel(view: View, cut: bool = False) -> Panel:
    """Return the geometry of a view; with `cut`, without the half of its body at y < 0."""
    import pyvista as pv

    nodes, triangles = outer_surface(view, cut)
    skin = pv.PolyData.from_regular_faces(1e3 * view.points[nodes], triangles)
    skin["node"] = nodes
    skin = with_normals(skin)
    nodes = np.asarray(skin["node"])
    skin["motion"] = np.zeros(len(nodes), np.float32)
    path, probes = path_points(view.scene), view.scene.probe_points
    reach = np.abs(view.places).max(axis=0)
    probes = probes[(np.abs(probes) <= reach).all(axis=1) & ~(cut & (probes[:, 1] < 0))]
    lift = LIFT * 1e3 * float(np.ptp(view.places, axis=0).max())
    riding = [(pv.PolyData(_lift(probes, lift)), probes)] if len(probes) else []
    riding += [(_line(path, lift, cut), path)] if len(path) > 1 else []
    if cut:  # the upper edge of the section
        edge = np.column_stack([np.linspace(-reach[0], reach[0], 121), np.zeros(121)])
        riding.append((_line(edge, lift, cut), edge))
    marks = [(mesh, interpolation(view, 0.9999 * places)) for mesh, places in riding]
    under = interpolation(view, 0.9999 * view.scene.tacton.trajectory.position(view.times))
    focus = pv.PolyData(_lift(path[:1], lift))
    return Panel(view=view, skin=skin, nodes=nodes, marks=marks, focus=focus, under_focus=under,
                 lift=lift)  # fmt: skip


def with_normals(skin: Any, sharp: float = 35.0) -> Any:
    """Return a surface with normals; edges above `sharp` degrees are not smoothed."""
    return skin.compute_normals(feature_angle=sharp, split_vertices=True)


def outer_surface(view: View, cut: bool = False) -> tuple[Ints, Ints]:
    """Return the points (n,) on the outer surface of a view, and its triangles (k, 3)."""
    if not len(view.tets):
        return view.surface, view.triangles
    tets = view.tets
    if cut:
        tets = tets[view.points[tets[:, :4], 1].mean(axis=1) > 0]
    nodes, triangles = np.unique(split(boundary_facets(tets)), return_inverse=True)
    return nodes, triangles.reshape(-1, 3)


def _line(path: Floats, lift: float, cut: bool = False) -> Any:
    """Return a line through places; with `cut`, only its part with y >= 0."""
    import pyvista as pv

    pairs = np.arange(len(path) - 1)[:, None] + np.arange(2)
    if cut:
        pairs = pairs[(path[pairs, 1] >= 0).all(axis=1)]
    cells = np.hstack([np.full((len(pairs), 1), 2), pairs]).ravel()
    return pv.PolyData(_lift(path, lift), lines=cells)


def _lift(places: Floats, lift: float) -> Floats:
    return np.column_stack([1e3 * places, np.full(len(places), lift)])


def _draw_panel(
    plotter: Any, panel: Panel, style: Style, limits: tuple[float, float], letter: float, *,
    lit: bool,
) -> None:  # fmt: skip
    """Draw surface, marks, names and scale bar of a panel."""
    view = panel.view
    plotter.add_mesh(
        panel.skin, scalars="motion", cmap=SIGNED if limits[0] else SEQUENTIAL, clim=limits,
        show_scalar_bar=False, smooth_shading=True,
        ambient=0.3 if lit else 0.0, diffuse=0.8 if lit else 1.0, lighting=lit,
    )  # fmt: skip
    add_marks(plotter, [mark for mark, _ in panel.marks], panel.focus, letter)
    own = colour(view.column)
    ink = style.ink if own == "#000000" else own
    write(plotter, label(view.column), (0.04, 0.92), 1.25 * letter, ink)
    text = scale_text(view).replace("; ", ";\n").replace("times, ", "times,\n")
    rows = (1.4 + 1.15 * text.count("\n")) * letter / plotter.window_size[1]
    write(plotter, text, (0.04, 0.92 - rows), letter, style.ink)
    add_scale_bar(plotter, 1e3 * view.points, style, letter)


def add_marks(plotter: Any, marks: Sequence[Any], focus: Any, letter: float) -> None:
    """Draw a path, probes and the focus beside letters of so many pixels."""
    balls, pixel = {"render_points_as_spheres": True}, letter / 16
    for mark in marks:
        if mark.n_lines:
            plotter.add_mesh(mark, color=MARKS["path"], line_width=2 * pixel)
        else:
            plotter.add_mesh(mark, color=MARKS["probes"], point_size=10 * pixel, **balls)
    plotter.add_mesh(focus, color=MARKS["focus"], point_size=15 * pixel, **balls)


def add_scale_bar(plotter: Any, points: Floats, style: Style, letter: float) -> None:
    """Draw the scale bar of a body with points (n, 3) in mm."""
    import pyvista as pv

    ends = scale_bar(points)
    length = float(np.ptp(ends[:, 0]))
    plotter.add_mesh(pv.Line(*ends), color=style.ink, line_width=letter / 4)
    add_label(plotter, f"{length:g} mm", ends[1] + [length / 4, 0.0, 0.0], letter, style.ink)


def add_label(plotter: Any, text: str, place: Floats, letter: float, ink: str) -> None:
    """Write text to the right of a place (3,) in mm, with letters of `letter` pixels."""
    plotter.add_point_labels(
        place[None], [text], font_size=round(letter), font_file=findfont("DejaVu Sans"),
        text_color=ink, shape=None, show_points=False, always_visible=True,
        justification_horizontal="left", justification_vertical="center",
    )  # fmt: skip


def scale_bar(points: Floats) -> Floats:
    """Return the ends (2, 3) in mm of a scale bar along x, in front of points (n, 3) in mm."""
    left, front, bottom = points.min(axis=0)
    side = float(np.ptp(points[:, :2], axis=0).max())
    bars = (10.0, 5.0, 2.0, 1.0)  # mm, lengths of scale bars
    length = next(length for length in bars if length <= side / 4 or length == bars[-1])
    front -= side / 10
    return np.array([[left, front, bottom], [left + length, front, bottom]])


def set_camera(
    plotter: Any, direction: Sequence[float], points: Floats, aspect: float,
    filled: tuple[float, float] = (0.92, 0.92), height: float = 0.5,
) -> None:  # fmt: skip
    """Set the lights of a panel and its camera, which has no perspective.

    Points (n, 3) in mm, seen from a direction, fill a part of width and height of a picture with
    this aspect ratio, about the middle of its width and a relative `height`.
    """
    import pyvista as pv

    towards = np.array(direction) / np.linalg.norm(direction)
    right = np.cross([0.0, 0.0, 1.0], towards) if towards[:2].any() else np.array([1.0, 0, 0])
    right = right / np.linalg.norm(right)
    axes = np.array([right, np.cross(towards, right)])
    low, high = (points @ axes.T).min(axis=0), (points @ axes.T).max(axis=0)
    across, up = (high - low) / filled / 2
    half = max(across / aspect, up)  # of the visible height
    aim, camera = ((low + high) / 2 + [0.0, half * (1 - 2 * height)]) @ axes, plotter.camera
    camera.focal_point = tuple(aim)
    camera.position = tuple(aim + 10 * half * max(aspect, 1.0) * towards)
    camera.up = tuple(axes[1])
    camera.parallel_projection = True
    camera.parallel_scale = half
    for light in (
        pv.Light(light_type="headlight", color="white", intensity=0.6),
        pv.Light(position=(-1, -1, 3), light_type="scene light", color="white", intensity=0.5),
    ):
        plotter.add_light(light, only_active=True)
    plotter.renderer.reset_camera_clipping_range()


def set_frame(panels: Sequence[Panel], frame: int, limit: float) -> None:
    """Show a frame in every panel, with a colour scale up to `limit`."""
    for panel in panels:
        view = panel.view
        motion = np.asarray(view.motion[frame], np.float64)
        drawn = 1e3 * view.points + 1e3 * exaggeration(view) * motion
        panel.skin.points[:] = drawn[panel.nodes]
        if view.shade is None:
            values = -np.float32(limit / view.peak) * view.motion[frame, panel.nodes, 2]
        else:
            values = view.shade.values[frame, np.searchsorted(view.shade.nodes, panel.nodes)]
            values = np.float32(quantity(view.shade.quantity).per_unit) * values
        panel.skin["motion"] = values
        panel.skin.compute_normals(
            cell_normals=False, split_vertices=False, consistent_normals=False, inplace=True
        )
        height = drawn[view.surface, 2]
        for mark, interpolate in panel.marks:
            raised = np.array(mark.points)
            raised[:, 2] = interpolate(height) + panel.lift
            mark.points = raised
        focus = _lift(
            view.scene.tacton.trajectory.position(view.times[frame : frame + 1]), panel.lift
        )
        panel.focus.points = focus + [0.0, 0.0, panel.under_focus(height)[frame]]
