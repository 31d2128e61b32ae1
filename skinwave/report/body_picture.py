"""Picture of a meshed body at rest: its boundary conditions, its regions, the focus and the probes.

Bodies of several materials are cut open at x > 0, y < 0. Lengths are in mm, and the camera has no
perspective.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from meshes.tetmesh import boundary_facets
from skinwave.bodies.body import Body, body_name
from skinwave.bodies.build import Build
from skinwave.bodies.sizes import coarsest_size, default_size, layer_name, meshed_strata
from skinwave.bodies.tissue import supported_share
from skinwave.models.meshed import mesh_body
from skinwave.report.figures import REPORT, legend
from skinwave.report.maps import on_triangles
from skinwave.report.palette import ORANGE, label
from skinwave.report.render import (
    FOCUS,
    LIFT,
    PATH,
    PROBE,
    SHARP,
    Image,
    Projection,
    bar_length,
    pixels,
    raster,
    silence_vtk,
)
from skinwave.report.styles import Style
from skinwave.results.views import path_points, split
from skinwave.scene.scene import Scene
from skinwave.system.effort import Clock, silent
from skinwave.typing import Bools, Floats, Ints

COARSER = 1.5  # element size of the picture over the default one
WIDTH, HEIGHT, ROW = 7.0, 3.6, 0.24  # inch: of the picture, and of a row of its legend
MOST_COLUMNS, NARROW_COLUMNS = 4, 2  # of the legend
FREE, CLAMPED, SIMPLE, SPRINGS, ABSORBING = (
    "free", "clamped", "simply supported", "on springs", "absorbing"
)  # fmt: skip
BOUNDARY = {
    FREE: "#e3e6e8", CLAMPED: "#4a4f55", SIMPLE: "#8c6bb1", SPRINGS: "#5fae8f",
    ABSORBING: "#7db8dc",
}  # fmt: skip
REGIONS = ("#e8a48c", "#f3d7a2", "#c9705f", "#f6f1e0", "#b88fa8", "#a9a05f", "#d9c2d0")
CAMERA = (0.55, -1.0, 0.7)  # direction to the camera
# Lengths over the largest side of the body: the arrow to the device and the gap below it, the
# distance of the scale bar, and the thickness of the support that is drawn below the body.
ARROW, GAP, AWAY, PLATE = 0.16, 0.05, 0.1, 0.02
LABEL = 0.06  # the same, of the label of the scale bar
LEAST_SHARE = 0.1  # of a support: where it is weaker, the surface is drawn as free
EDGE = "#5a5f66"  # colour of the edges of elements
STEEP = -0.7  # vertical component of the normal of a base, at most
FRONT, SECTION = 0.05, 241  # mm, of thin layers before a section; points along it
EDGES = np.array([[0, 3], [3, 1], [1, 4], [4, 2], [2, 5], [5, 0]])  # of a six-node facet


LIT: dict[str, Any] = {"ambient": 0.5, "diffuse": 0.6}


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshedBody:
    """What is drawn of a meshed body: its points (n, 3) in mm, the tetrahedra (m, 10) outside the
    absorbing layer with their regions (m,), the facets (k, 6) on their boundary with the name of
    the condition of each, shares (n,) of supports at the points, the upper facets (j, 6), names of
    regions, and names and thicknesses in mm of the layers of the coat.
    """

    points: Floats
    tets: Ints
    region: Ints
    facets: Ints
    conditions: Any
    shares: Mapping[str, Floats]
    top: Ints
    names: Mapping[int, str]
    coat: Sequence[tuple[str, float]] = ()

    @property
    def is_cut(self) -> bool:
        """Whether it is cut open to show its materials."""
        return len(np.unique(self.region)) > 1 or len(self.coat) > 0


def drawn_size(body: Body) -> float:
    """Return the element size in m of the picture of a body."""
    usual = default_size(body)
    if body.file:  # filling a surface takes long, and meshes of the default size are cached
        return usual
    return min(COARSER * usual, max(coarsest_size(body), usual))


def meshed_body(body: Body) -> MeshedBody:
    """Mesh a body for its picture; raises the errors of `bodies.build.build`."""
    h = drawn_size(body)
    build = mesh_body(body, h, Clock(), silent)
    mesh, drag = build.mesh, build.drag
    inside = np.ones(len(mesh.tets), bool) if drag is None else drag == 0
    facets = boundary_facets(mesh.tets[inside])
    shares = _shares(build)
    names = [_name(body, solid) for _, solid in meshed_strata(body, h)]
    coat = build.coat
    layers = zip(coat.materials, coat.thicknesses, strict=True) if coat else ()
    return MeshedBody(
        points=1e3 * mesh.points, tets=mesh.tets[inside], region=mesh.region[inside],
        facets=facets, conditions=_conditions(body, build, facets, shares), shares=shares,
        top=facets[_among(facets, mesh.facets["top"])],
        names=dict(enumerate([*names, *(name for name, _ in body.regions)])),
        coat=[(layer_name(body, solid), 1e3 * thickness) for solid, thickness in layers],
    )  # fmt: skip


def _name(body: Body, solid: Any) -> str:
    """Return the name of the material of a stratum."""
    own = body.material if isinstance(body.material, str) else "material"
    return own if solid == body.solid else layer_name(body, solid)


def _keys(facets: Ints) -> Any:
    """Return one value (k,) for the corners of each facet, in any order."""
    corners = np.ascontiguousarray(np.sort(facets[:, :3], axis=1))
    return corners.view([("", corners.dtype)] * 3).ravel()


def _among(facets: Ints, others: Ints) -> Bools:
    """Return which facets (k,) are among others."""
    return np.isin(_keys(facets), _keys(others))


def _shares(build: Build) -> dict[str, Floats]:
    """Return the shares (n,) of an elastic and of an absorbing support at the nodes by name."""
    if (support := build.support) is None:
        return {}
    facets, count = support.facets, len(build.mesh.points)
    springs, dashpots = (
        each.reshape(len(facets), -1).mean(axis=1) for each in (support.stiffness, support.absorbed)
    )
    springs = (springs > 0) * supported_share(-_normals(build.mesh.points, facets)[:, 2])
    uses = np.bincount(facets.ravel(), minlength=count)
    return {
        name: np.bincount(facets.ravel(), np.repeat(each, facets.shape[1]), count)
        / np.maximum(uses, 1)
        for name, each in ((SPRINGS, springs), (ABSORBING, dashpots)) if each.any()
    }  # fmt: skip


def _normals(points: Floats, facets: Ints) -> Floats:
    """Return the outward unit normal (k, 3) of each facet."""
    a, b, c = (points[facets[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _conditions(body: Body, build: Build, facets: Ints, shares: Mapping[str, Floats]) -> Any:
    """Return the name (k,) of the condition of each facet."""
    mesh = build.mesh
    found = np.full(len(facets), FREE, dtype=object)
    if build.drag is not None:
        found[~_among(facets, boundary_facets(mesh.tets))] = ABSORBING
    if build.absorbing is not None:
        found[_among(facets, build.absorbing)] = ABSORBING
    most = np.full(len(facets), LEAST_SHARE)
    for name, share in shares.items():
        own = share[facets[:, :3]].mean(axis=1)
        found[own > most] = name
        most = np.maximum(own, most)
    for name, components in build.fixed.items():
        if components == "xyz":
            found[_among(facets, mesh.facets[name])] = CLAMPED
    if build.held is not None:
        held = np.asarray(build.held.any(axis=1))
        found[held[facets[:, :3]].all(axis=1)] = (
            SIMPLE if body.mounting.support == "simply" else CLAMPED
        )
    return found


def body_picture(scene: Scene, style: Style = REPORT) -> Image:
    """Return a picture (height, width, 3) of the meshed body of a scene at rest, with the path and
    start of its focus, its probes, a scale bar, and a legend.

    Raises the errors of `bodies.build.build`, or a ValueError if the body cannot be meshed.
    """
    drawn = meshed_body(scene.body)
    inch = style.size(WIDTH, HEIGHT)[0] if style.columns else WIDTH
    with mpl.rc_context({**style.rc, "font.size": 8.0}):
        columns = MOST_COLUMNS if inch > WIDTH / 2 + 1 else NARROW_COLUMNS
        entries = _entries(drawn, scene)
        rows = -(-len(entries) // columns)
        height = HEIGHT * inch / WIDTH
        figure = Figure(figsize=(inch, height + ROW * (rows + 1)))
        dpi = pixels(style, inch) / inch
        view = _projection(drawn, inch / height)
        image = _render(drawn, scene, style, view, (round(inch * dpi), round(height * dpi)))
        ax = figure.add_axes((0, ROW * (rows + 0.5) / figure.get_figheight(), 1,
                              height / figure.get_figheight()))  # fmt: skip
        low, high = view.middle - view.half, view.middle + view.half
        ax.imshow(image, extent=(low[0], high[0], low[1], high[1]), aspect="auto")
        ax.autoscale(False)
        ax.axis("off")
        _label(ax, drawn, scene.body, view)
        legend(figure, entries, columns, loc="lower center", fontsize=None, frameon=False)
        return raster(figure, dpi)


def _projection(drawn: MeshedBody, aspect: float) -> Projection:
    """Return the projection that shows a body, its arrow, and its scale bar with its label."""
    side, bar = _side(drawn), _bar(drawn)
    shown = [
        drawn.points[np.unique(drawn.facets)],
        _arrow(drawn),
        bar,
        bar[:1] - [LABEL * side, 0, 0],
    ]
    return Projection.of(CAMERA, np.vstack(shown), aspect)


def _side(drawn: MeshedBody) -> float:
    return float(np.ptp(drawn.points[np.unique(drawn.facets)], axis=0).max())


def _bar(drawn: MeshedBody) -> Floats:
    """Return the ends (2, 3) of a scale bar along x in front of the body."""
    points = drawn.points[np.unique(drawn.facets)]
    left, front, bottom = points.min(axis=0)
    length = bar_length(_side(drawn))
    front -= AWAY * _side(drawn)
    return np.array([[left, front, bottom], [left + length, front, bottom]])


def _arrow(drawn: MeshedBody) -> Floats:
    """Return the ends (2, 3) of the arrow to the device, above the middle of the body."""
    side, middle = _side(drawn), np.zeros((1, 2))
    height = on_triangles(drawn.points, split(drawn.top), middle)(drawn.points[:, 2])
    low = GAP * side + (height[0] if np.isfinite(height[0]) else drawn.points[:, 2].max())
    return np.array([[0.0, 0.0, low], [0.0, 0.0, low + ARROW * side]])


def _label(ax: Any, drawn: MeshedBody, body: Body, view: Projection) -> None:
    """Draw the scale bar, and write its length, the name of the arrow and that of the body."""
    ends = _bar(drawn)
    ax.plot(*np.array([view.at(end) for end in ends]).T, color=mpl.rcParams["text.color"], lw=2.5)
    below: dict[str, Any] = {"textcoords": "offset points", "va": "top"}
    ax.annotate(f"{np.ptp(ends[:, 0]):g} mm", view.at(ends.mean(axis=0)), (-4, -4), **below,
                ha="right")  # fmt: skip
    ax.annotate("to the device, +z", view.at(_arrow(drawn)[1]), (7, 0), **below, ha="left")
    name, words = label(body_name(body)), body.of_kind.words(body).replace(" x ", " \u00d7 ")
    words = re.sub(r"(?<!\S)-(?=\w)", "\u2212", words)
    title = words if words.startswith(name) else f"{name}\n{words}"
    ax.text(0.01, 0.99, title, transform=ax.transAxes, va="top", linespacing=1.4)


def _entries(drawn: MeshedBody, scene: Scene) -> dict[str, dict[str, Any]]:
    """Return the entries of the legend: boundary conditions, materials, path, focus and probes."""
    patch = {"ls": "", "marker": "s", "ms": 8, "mec": "0.4", "mew": 0.5}
    present = [name for name in BOUNDARY if (drawn.conditions == name).any()]
    entries: dict[str, dict[str, Any]] = {
        name: {**patch, "mfc": BOUNDARY[name]} for name in present
    }
    if drawn.is_cut:
        entries |= {name: {**patch, "mfc": colour} for name, colour in _colours(drawn).items()}
    if not scene.tacton.trajectory.is_static:
        entries["path of the focus"] = {"color": PATH, "lw": 1.5}
    ball = {"ls": "", "marker": "o", "mec": "none"}
    entries["focus at the start"] = {**ball, "mfc": FOCUS, "ms": 8}
    entries["probes"] = {**ball, "mfc": PROBE, "ms": 6, "mec": "0.3", "mew": 0.5}
    return entries


def _colours(drawn: MeshedBody) -> dict[str, str]:
    """Return the colour of each material that the section shows, from the surface downwards."""
    names = [
        *(name for name, _ in drawn.coat),
        *(drawn.names[k] for k in np.unique(drawn.region).tolist()),
    ]
    return {name: REGIONS[k % len(REGIONS)] for k, name in enumerate(dict.fromkeys(names))}


def _render(
    drawn: MeshedBody, scene: Scene, style: Style, view: Projection, size: tuple[int, int]
) -> Image:
    """Return the picture without its text."""
    import pyvista as pv

    silence_vtk()
    plotter = pv.Plotter(off_screen=True, lighting="none", window_size=size)
    pixel = size[0] / 1600
    try:
        plotter.set_background(style.paper)
        plotter.enable_anti_aliasing("ssaa")
        merged = [FREE, *drawn.shares]  # supports that begin smoothly
        for names in (merged, *([name] for name in BOUNDARY if name not in merged)):
            facets = drawn.facets[np.isin(drawn.conditions.astype(str), names)]
            if len(facets):
                _add_skin(plotter, drawn, facets, names)
        for name in BOUNDARY:
            facets = drawn.facets[drawn.conditions == name]
            below = facets[_normals(drawn.points, facets)[:, 2] < STEEP]
            if name != FREE and len(below) and not scene.body.of_kind.is_plate:
                plate = pv.PolyData.from_regular_faces(drawn.points, split(below)).clean()
                plate = plate.extrude((0, 0, -PLATE * _side(drawn)), capping=True)
                _add(plotter, _opened(plate, drawn), color=BOUNDARY[name], **LIT)
        lines = np.unique(np.sort(drawn.facets[:, EDGES].reshape(-1, 2), axis=1), axis=0)
        mesh = pv.PolyData(drawn.points, lines=np.insert(lines, 0, 2, axis=1).ravel())
        _add(plotter, _opened(mesh, drawn), color=EDGE, line_width=2 * pixel, opacity=0.35)
        if scene.body.of_kind.is_plate:  # its edges are too thin to see
            thin = drawn.facets[drawn.conditions != FREE][:, EDGES].reshape(-1, 2)
            edges = pv.PolyData(drawn.points, lines=np.insert(thin, 0, 2, axis=1).ravel())
            _add(plotter, edges, color=BOUNDARY[drawn.conditions[drawn.conditions != FREE][0]],
                 line_width=9 * pixel)  # fmt: skip
        if drawn.is_cut:
            _add_sections(plotter, drawn, pixel)
        _add_marks(plotter, drawn, scene, pixel)
        foot, tip = _arrow(drawn)
        arrow = pv.Arrow(
            start=foot, direction=tip - foot, scale="auto", shaft_radius=0.03, tip_radius=0.09
        )
        _add(plotter, arrow, color=ORANGE, **LIT)
        view.apply(plotter)
        return np.asarray(plotter.screenshot(None, return_img=True))
    finally:
        plotter.close()


def _add_skin(plotter: Any, drawn: MeshedBody, facets: Ints, names: Sequence[str]) -> None:
    """Draw facets in the colour of their condition, which supports may fade into."""
    import pyvista as pv

    skin = pv.PolyData.from_regular_faces(drawn.points, split(facets))
    first, *others = (np.array(to_rgb(BOUNDARY[name])) for name in names)
    shades = np.tile(first, (len(drawn.points), 1))
    for name, shade in zip(names[1:], others, strict=True):
        shades += drawn.shares[name][:, None] * (shade - first)
    skin["shade"] = (255 * np.clip(shades, 0, 1)).astype(np.uint8)
    skin = skin.clean().compute_normals(feature_angle=SHARP, split_vertices=True)
    _add(plotter, _opened(skin, drawn), scalars="shade", rgb=True, smooth_shading=True, **LIT)


def _add(plotter: Any, mesh: Any, **options: Any) -> None:
    """Draw a mesh, unless it is empty."""
    if mesh.n_points:
        plotter.add_mesh(mesh, show_scalar_bar=False, **options)


def _opened(mesh: Any, drawn: MeshedBody) -> Any:
    """Return a mesh without its part at x > 0, y < 0 if the body is cut open."""
    if not drawn.is_cut:
        return mesh
    far = 1e4
    return mesh.clip_box([0.0, far, -far, 0.0, -far, far], invert=True)


def _add_sections(plotter: Any, drawn: MeshedBody, pixel: float) -> None:
    """Draw the materials on both sections, with the thin layers below the surface."""
    import pyvista as pv

    colours, far = _colours(drawn), 1e4
    body = pv.UnstructuredGrid({pv.CellType.QUADRATIC_TETRA: drawn.tets}, drawn.points)
    body["region"] = drawn.region
    top, low, high = split(drawn.top), drawn.points.min(axis=0), drawn.points.max(axis=0)
    # Normal of each section, the box it lies in, the place where it ends, and its front.
    for normal, box, end, front in (
        ("y", [0, far, -far, far, -far, far], (high[0], 0.0), (0.0, -FRONT)),
        ("x", [-far, far, -far, 0, -far, far], (0.0, low[1]), (FRONT, 0.0)),
    ):
        section = body.slice(normal=normal, origin=(0, 0, 0))
        if not section.n_cells:  # a body beside the origin
            continue
        section = section.clip_box(box, invert=False)
        for k in np.unique(section["region"]).tolist():
            part = section.extract_cells(section["region"] == k)
            _add(plotter, part, color=colours[drawn.names[int(k)]], lighting=False)
        _add(plotter, section.extract_all_edges(), color=EDGE, line_width=pixel, opacity=0.25)
        places = np.linspace(0.0, 0.9999, SECTION)[:, None] * end
        height = on_triangles(drawn.points, top, places)(drawn.points[:, 2])
        places, height = places[np.isfinite(height)] + front, height[np.isfinite(height)]
        for name, thickness in drawn.coat:
            rows = [np.column_stack([places, height - part]) for part in (0.0, thickness)]
            ribbon = pv.StructuredGrid(*np.moveaxis(np.stack(rows, axis=1)[..., None], 2, 0))
            _add(plotter, ribbon, color=colours[name], lighting=False)
            height = height - thickness


def _add_marks(plotter: Any, drawn: MeshedBody, scene: Scene, pixel: float) -> None:
    """Draw path, focus and probes on the surface."""
    import pyvista as pv

    top, lift = split(drawn.top), LIFT * _side(drawn)

    def placed(places: Floats) -> Floats:
        height = on_triangles(drawn.points, top, 0.9999 * places)(drawn.points[:, 2])
        found = np.column_stack([places, height + lift])
        return found[np.isfinite(height)]

    path, probes = 1e3 * path_points(scene), 1e3 * scene.probe_points
    balls = {"render_points_as_spheres": True}
    if len(path) > 1 and len(line := placed(path)) > 1:
        _add(plotter, pv.lines_from_points(line), color=PATH, line_width=7 * pixel)
    if len(probes := placed(probes)):
        _add(plotter, pv.PolyData(probes), color=PROBE, point_size=34 * pixel, **balls)
    start = 1e3 * scene.tacton.trajectory.position(np.zeros(1))
    if len(start := placed(start)):
        start[:, 2] += lift
        _add(plotter, pv.PolyData(start), color=FOCUS, point_size=48 * pixel, **balls)
