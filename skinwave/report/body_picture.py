"""Picture of a meshed body at rest: its boundary conditions, its regions, the focus and the probes.

Bodies of several materials are cut open at larger x and smaller y than the origin. Lengths are in
mm, and the camera has no perspective.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from fem.load_and_probe import facet_normals
from meshes.tetmesh import boundary_facets, facet_keys, part
from skinwave.bodies.body import Body, body_name
from skinwave.bodies.build import Build
from skinwave.bodies.sizes import coarsest_size, default_size, layer_name, meshed_strata
from skinwave.bodies.tissue import supported_share
from skinwave.models.meshed import mesh_body
from skinwave.report import render
from skinwave.report.figures import REPORT, legend
from skinwave.report.maps import on_triangles
from skinwave.report.palette import ORANGE, label
from skinwave.report.styles import Style
from skinwave.results.views import path_points, split
from skinwave.scene.scene import Scene
from skinwave.system.effort import Clock, silent
from skinwave.typing import Array, Floats, Ints

BOUNDARY = {  # colours of boundary conditions
    "free": "#e3e6e8", "clamped": "#4a4f55", "simply supported": "#8c6bb1",
    "on springs": "#5fae8f", "absorbing": "#7db8dc",
}  # fmt: skip
REGIONS = ("#e8a48c", "#f3d7a2", "#c9705f", "#f6f1e0", "#b88fa8", "#a9a05f", "#d9c2d0")
FAR = 1e4  # mm, outside all bodies


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshedBody:
    """What is drawn of a meshed body.

    Parameters
    ----------
    points : (n, 3) float, mm
    tets, region : (m, 10) and (m,) int, tetrahedra outside the absorbing layer, and their regions
    facets : (k, 6) int, on their boundary; conditions, shares : (k,), boundary condition of each
        facet, and its share there
    top : (j, 6) int, upper facets
    names : of regions
    coat : names and thicknesses in mm of the layers of the coat
    """

    points: Floats
    tets: Ints
    region: Ints
    facets: Ints
    conditions: Array
    shares: Floats
    top: Ints
    names: Mapping[int, str]
    coat: Sequence[tuple[str, float]] = ()

    @property
    def is_cut(self) -> bool:
        """Whether it is cut open to show its materials."""
        return len(np.unique(self.region)) > 1 or len(self.coat) > 0

    @property
    def corner(self) -> Floats:
        """Place (2,) where it is cut open: the origin or, if that is beside it, its middle."""
        ends = self.points[:, :2].min(axis=0), self.points[:, :2].max(axis=0)
        return np.zeros(2) if len(self.on_top(np.zeros((1, 2)))) else np.mean(ends, axis=0)

    @property
    def colours(self) -> dict[str, str]:
        """Colour of each material that the section shows, from the surface downwards."""
        within = [self.names[k] for k in np.unique(self.region).tolist()]
        names = dict.fromkeys([*(name for name, _ in self.coat), *within])
        return {name: REGIONS[k % len(REGIONS)] for k, name in enumerate(names)}

    def on_top(self, places: Floats) -> Floats:
        """Return points (q, 3) of the upper surface: places (p, 2) in mm beside it are left out."""
        top = on_triangles(self.points, split(self.top), 0.9999 * places)
        height = top(self.points[:, 2])
        return np.column_stack([places, height])[np.isfinite(height)]


def drawn_size(body: Body, coarser: float = 1.5) -> float:
    """Return the element size in m of the picture of a body: up to `coarser` times the default."""
    usual = default_size(body)
    if body.file:  # filling a surface takes long, and meshes of the default size are cached
        return usual
    return min(coarser * usual, max(coarsest_size(body), usual))


def meshed_body(body: Body) -> MeshedBody:
    """Mesh a body for its picture; raises the errors of `bodies.build.build`."""
    h = drawn_size(body)
    build = mesh_body(body, h, Clock(), silent)
    mesh, drag, coat = build.mesh, build.drag, build.coat
    own_mesh, nodes = part(mesh, np.ones(len(mesh.tets), bool) if drag is None else drag == 0)
    facets = boundary_facets(own_mesh.tets)
    conditions, shares = _conditions(body, build, nodes[facets])
    own = body.material if isinstance(body.material, str) else "material"
    names = [own if x == body.solid else layer_name(body, x) for _, x in meshed_strata(body, h)]
    layers = zip(coat.materials, coat.thicknesses, strict=True) if coat else ()
    return MeshedBody(
        points=1e3 * own_mesh.points, tets=own_mesh.tets, region=own_mesh.region,
        facets=facets, conditions=conditions, shares=shares, top=own_mesh.facets["top"],
        names=dict(enumerate([*names, *(name for name, _ in body.regions)])),
        coat=[(layer_name(body, solid), 1e3 * thickness) for solid, thickness in layers],
    )  # fmt: skip


def _conditions(body: Body, build: Build, facets: Ints) -> tuple[Array, Floats]:
    """Return the name (k,) of the condition of each facet, and its share (k,) there."""
    mesh, count = build.mesh, len(build.mesh.points)
    keys = facet_keys(facets, count)
    found, shares = np.full(len(facets), "free", dtype=object), np.ones(len(facets))

    def mark(name: str, others: Ints, share: Floats | float = 1.0) -> None:
        _, own, other = np.intersect1d(keys, facet_keys(others, count), return_indices=True)
        found[own], shares[own] = name, np.broadcast_to(share, len(others))[other]

    if build.drag is not None:
        found[:] = "absorbing"
        mark("free", boundary_facets(mesh.tets))
    if build.absorbing is not None:
        mark("absorbing", build.absorbing)
    if (support := build.support) is not None:
        held = supported_share(-facet_normals(mesh, support.facets)[:, 2]) * (support.stiffness > 0)
        springs, dashpots = (
            each.reshape(len(support.facets), -1).mean(axis=1) for each in (held, support.absorbed)
        )
        held_by = "on springs" if body.base == "elastic" else "clamped"  # by soft tissue over bone
        for name, share in ((held_by, springs), ("absorbing", dashpots)):
            acts = (share > 0) & (share == np.maximum(springs, dashpots))
            mark(name, support.facets[acts], share[acts])
    for name, components in build.fixed.items():
        if components == "xyz":
            mark("clamped", mesh.facets[name])
    if build.held is not None:
        at_rest = np.asarray(build.held.any(axis=1))[facets[:, :3]].all(axis=1)
        found[at_rest] = "simply supported" if body.mounting.support == "simply" else "clamped"
    return found, shares


def body_picture(scene: Scene, style: Style = REPORT) -> render.Image:
    """Return a picture (height, width, 3) of the meshed body of a scene at rest, with the path and
    start of its focus, its probes, a scale bar, and a legend.

    Raises the errors of `bodies.build.build`, or a ValueError if the body cannot be meshed.
    """
    drawn = meshed_body(scene.body)
    page, height, row = style.page, 3.6, 0.24  # inch: of the picture, and of a row of its legend
    inch = style.size(page, height)[0] if style.columns else page
    width = style.pixels(inch)
    image = _render(drawn, scene, style, (width, round(width * height / page)), inch)
    entries = _entries(drawn, scene)
    columns = 4 if inch > page / 2 + 1 else 2  # of the legend
    with mpl.rc_context({**style.rc, "font.size": style.solid_font}):
        figure = Figure(figsize=(inch, row * (-(-len(entries) // columns) + 1)))
        legend(figure, entries, columns, loc="center", fontsize=None, frameon=False)
        return np.vstack([image, render.raster(figure, width / inch)])


def _entries(drawn: MeshedBody, scene: Scene) -> dict[str, dict[str, Any]]:
    """Return the entries of the legend: boundary conditions, materials, path, focus and probes."""
    patches = {name: shade for name, shade in BOUNDARY.items() if name in drawn.conditions}
    patches |= drawn.colours if drawn.is_cut else {}
    edge = {"ls": "", "mec": "0.4", "mew": 0.5}
    entries: dict[str, dict[str, Any]] = {
        name: {**edge, "marker": "s", "ms": 8, "mfc": shade} for name, shade in patches.items()
    }
    if not scene.tacton.trajectory.is_static:
        entries["path of the focus"] = {"color": render.MARKS["path"], "lw": 1.5}
    ball = edge | {"marker": "o"}
    entries["focus at the start"] = {**ball, "mfc": render.MARKS["focus"], "ms": 8}
    entries["probes"] = {**ball, "mfc": render.MARKS["probes"], "ms": 6}
    return entries


def _render(
    drawn: MeshedBody, scene: Scene, style: Style, size: tuple[int, int], inch: float
) -> render.Image:
    """Return the picture of a size in pixels without its legend."""
    import pyvista as pv

    letter, side = style.letter(size[0], inch), float(np.ptp(drawn.points, axis=0).max())
    below = drawn.on_top(drawn.corner[None])
    top = (below if len(below) else drawn.points)[:, 2].max()
    # Over the largest side of the body: the gap below the arrow to the device, the length of that
    # arrow, and the thickness of the support that is drawn below the body.
    gap, arrow_size, plate = 0.05, 0.16, 0.02
    foot = np.array([*drawn.corner, top + gap * side])
    tip = foot + [0.0, 0.0, arrow_size * side]
    steep = -0.7  # vertical component of the normal of a base, at most
    lit: dict[str, Any] = {"ambient": 0.5, "diffuse": 0.6}
    with render.new_plotter(style, size) as plotter:
        plotter.enable_anti_aliasing("ssaa")
        skin = pv.PolyData.from_regular_faces(drawn.points, split(drawn.facets))
        shades = np.array([to_rgb(BOUNDARY[name]) for name in drawn.conditions])
        free = np.array(to_rgb(BOUNDARY["free"]))
        skin["shade"] = np.repeat(free + drawn.shares[:, None] * (shades - free), 4, axis=0)
        skin = _opened(skin, drawn).extract_surface(algorithm="dataset_surface")
        skin = render.with_normals(skin)
        skin = skin.cell_data_to_point_data()  # colours change abruptly at sharp edges only
        plotter.add_mesh(skin, scalars="shade", rgb=True, smooth_shading=True, **lit)
        edges = _opened(_edges(drawn, drawn.facets), drawn)
        plotter.add_mesh(edges, color="#5a5f66", opacity=0.2, line_width=letter / 12)
        for name in set(drawn.conditions) - {"free"}:
            held = drawn.conditions == name
            mark = pv.PolyData.from_regular_faces(drawn.points, split(drawn.facets[held]))
            base = mark.face_normals[:, 2] < steep
            if scene.body.of_kind.is_plate:  # its sides are too thin to see
                mark = _edges(drawn, drawn.facets[held])
            elif base.any():
                mark = mark.extract_cells(base).extract_surface(algorithm="dataset_surface")
                mark = _opened(mark.extrude((0.0, 0.0, -plate * side), capping=True), drawn)
            else:
                continue
            plotter.add_mesh(mark, color=BOUNDARY[name], line_width=letter / 3, **lit)
        if drawn.is_cut:
            _add_sections(plotter, drawn)
        lift = [0.0, 0.0, render.LIFT * side]
        path, probes = (
            drawn.on_top(1e3 * each) + lift for each in (path_points(scene), scene.probe_points)
        )
        marks = [pv.lines_from_points(path)] if len(path) > 1 else []
        marks += [pv.PolyData(probes)] if len(probes) else []
        # Anti-aliasing draws at twice the size, and lines and balls half as large.
        render.add_marks(plotter, marks, pv.PolyData(path[:1] + lift), 2 * letter)
        arrow = pv.Arrow(
            start=foot, direction=tip - foot, scale="auto", shaft_radius=0.03, tip_radius=0.09
        )
        plotter.add_mesh(arrow, color=ORANGE, **lit)
        render.add_label(plotter, "    to the device, +z", (foot + 3 * tip) / 4, letter, style.ink)
        render.add_scale_bar(plotter, drawn.points, style, letter)
        name, words = label(body_name(scene.body)), scene.body.of_kind.words(scene.body)
        words = re.sub(r"(?<!\S)-(?=\w)", "\u2212", words.replace(" x ", " \u00d7 "))
        title = words if words.startswith(name) else f"{name}\n{words}"
        height = 1.3 * (1 + title.count("\n")) * letter / size[1]
        render.write(plotter, title, (0.01, 0.98 - height), letter, style.ink)
        shown = np.vstack([drawn.points, [foot, tip], render.scale_bar(drawn.points)])
        render.set_camera(plotter, (0.55, -1.0, 0.7), shown, size[0] / size[1])
        return np.asarray(plotter.screenshot(None, return_img=True))


def _edges(drawn: MeshedBody, facets: Ints) -> Any:
    """Return the edges of facets (k, 6)."""
    import pyvista as pv

    edges = np.array([[0, 3], [3, 1], [1, 4], [4, 2], [2, 5], [5, 0]])  # of a six-node facet
    return pv.line_segments_from_points(drawn.points[facets[:, edges]].reshape(-1, 3))


def _opened(mesh: Any, drawn: MeshedBody) -> Any:
    """Return a mesh without its nearest corner if the body is cut open."""
    x, y = drawn.corner
    return mesh.clip_box([x, FAR, -FAR, y, -FAR, FAR], invert=True) if drawn.is_cut else mesh


def _add_sections(plotter: Any, drawn: MeshedBody) -> None:
    """Draw the materials on both sections, with the thin layers below the surface."""
    import pyvista as pv

    body = pv.UnstructuredGrid({pv.CellType.QUADRATIC_TETRA: drawn.tets}, drawn.points)
    regions, index = np.unique(drawn.region, return_inverse=True)
    shades = np.array([to_rgb(drawn.colours[drawn.names[k]]) for k in regions.tolist()])
    body["shade"] = (255 * shades[index]).astype(np.uint8)
    x, y = drawn.corner
    in_front, section_points = 0.05, 241  # mm, of thin layers before a section; points along it
    # Normal of each section, the box it lies in, the place where it ends, and its front.
    for normal, box, end, front in (
        ("y", (x, FAR, -FAR, FAR), (drawn.points[:, 0].max(), y), (0.0, -in_front, 0.0)),
        ("x", (-FAR, FAR, -FAR, y), (x, drawn.points[:, 1].min()), (in_front, 0.0, 0.0)),
    ):
        section = body.slice(normal=normal, origin=(x, y, 0.0))
        section = section.clip_box((*box, -FAR, FAR), invert=False)
        plotter.add_mesh(section, scalars="shade", rgb=True, lighting=False)
        along = drawn.on_top(np.linspace(drawn.corner, end, section_points)) + front
        for name, thickness in drawn.coat:
            layer = pv.lines_from_points(along).extrude((0.0, 0.0, -thickness), capping=False)
            plotter.add_mesh(layer, color=drawn.colours[name], lighting=False)
            along = along - [0.0, 0.0, thickness]
