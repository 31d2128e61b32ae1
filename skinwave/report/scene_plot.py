"""A scene before anything is solved: body, path, foci and probes from above, and a page of it."""

from typing import TYPE_CHECKING

import numpy as np

from meshes.tetmesh import Floats
from simple_model import drawing
from simple_model.load.focus import spot_width
from simple_model.numbers import counted
from skinwave.report.description import asked_rows

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skinwave.bodies import Body
    from skinwave.scene.scene import Scene

BODY, PATH, FOCUS, PROBE = "#e8d5c4", "#222222", "#D55E00", "#0072B2"
REACH = 4.0  # widths of a focal spot that its contour is looked for in
HALF = 0.5  # of the pressure at a focus: its contour
NARROW = 0.5  # inch for each point of its letters, below which a legend has one column
MOST_NUMBERED = 20  # probes
MARGIN = 5e-3  # metre beside what there is to see


def draw(scene: "Scene", ax: "Axes | None") -> "Axes":
    """Draw a scene from above, in mm, the foci as they are at the start."""
    ax = drawing.new_axes(ax)
    draw_body(ax, scene.body)
    path = scene.tacton.trajectory
    if not path.is_static:
        ax.plot(*(1e3 * path.at_phase(np.linspace(0, 1, 721)).T), color=PATH, lw=1.2, ls="dotted",
                label="path")  # fmt: skip
    _draw_foci(ax, scene)
    _draw_probes(ax, scene.probe_points)
    ax.set_aspect("equal")
    ax.set_xlabel("x, mm")
    ax.set_ylabel("y, mm")
    narrow = ax.figure.get_figwidth() < NARROW * drawing.small()  # type: ignore[union-attr]
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=1 if narrow else 2, frameon=False,
              fontsize=drawing.small(), borderaxespad=0.2, handlelength=1.5,
              columnspacing=1.0)  # fmt: skip
    return ax


def draw_body(ax: "Axes", body: "Body", symmetry: str = "") -> None:
    """Draw the outline of a body from above; of one that is halved, shade the half that is
    modelled. The surface of a file or of none is not known here.

    Parameters
    ----------
    ax : Axes
    body : Body
    symmetry : axes, of "xy", whose positive side is modelled
    """
    from matplotlib.patches import FancyBboxPatch, Rectangle

    if not (body.of_kind.is_bounded and body.of_kind.discretise):
        return
    width, height = 1e3 * body.width, 1e3 * body.height
    rounded = "relief" in body.of_kind.keys
    radius = 1e3 * body.palm.corner_radius if rounded else 0.0
    shape = f"round,pad=0,rounding_size={radius}" if rounded else "square,pad=0"
    outline = FancyBboxPatch(
        (-width / 2, -height / 2), width, height, shape, facecolor=BODY if not symmetry else "none",
        edgecolor="0.4", label=body.of_kind.words(body),
    )  # fmt: skip
    ax.add_patch(outline)
    if symmetry:
        left, bottom = (0.0 if a in symmetry else -size / 2
                        for a, size in (("x", width), ("y", height)))  # fmt: skip
        part = Rectangle((left, bottom), width / 2 - left, height / 2 - bottom, facecolor=BODY)
        part.set_label("part that is modelled")
        ax.add_patch(part)
        part.set_clip_path(outline)
    ax.update_datalim([(-width / 2 - 2, -height / 2 - 2), (width / 2 + 2, height / 2 + 2)])
    ax.autoscale_view()


def line(scene: "Scene") -> str:
    """Name, Tacton, body and probes in a line."""
    tacton, body = scene.tacton, scene.body
    path = tacton.trajectory
    moved = f"{path.shape} of {1e3 * path.size:.4g} mm at {path.speed:g} m/s"
    driven = [f"AM {_tones(scene)}"] if _tones(scene) else []
    driven += ["focus at rest" if path.is_static else moved, f"{tacton.duration:g} s"]
    if not scene.load.is_plain:
        driven.append(scene.load.words)
    said = [", ".join(driven), body.of_kind.words(body)]
    if body.of_kind.discretise:
        said[-1] += f", {_material(scene)}"
    said.append(f"{counted(len(scene.probes), 'probe')}, {scene.reading.words}")
    return f"<Scene {scene.name!r}: {'; '.join(said)}>"


def page(scene: "Scene") -> str:
    """Small page of a scene for notebooks."""

    def show(figure: "Figure") -> None:
        draw(scene, figure.subplots())

    uncertain = [f"{key} is uncertain; its central value is taken" for key, _ in scene.spreads]
    image = drawing.picture(show, 4.2, 3.8)
    return drawing.page(f"Scene {scene.name}", image, [drawing.table(asked_rows(scene))], uncertain)


def _tones(scene: "Scene") -> str:
    both = scene.tacton.am_frequency, scene.tacton.second_am_frequency
    return ", ".join(f"{f:g} Hz" for f in both if f)


def _material(scene: "Scene") -> str:
    body = scene.body
    layers = [f"{1e3 * layer.thickness:g} mm of {_named(layer.material)}" for layer in body.layers]
    return "; below it ".join([*layers, _named(body.material)])


def _named(material: object) -> str:
    if isinstance(material, str):
        return material
    young, density = getattr(material, "young", np.nan), getattr(material, "density", np.nan)
    return f"a material of {young:.4g} Pa and {density:g} kg/m3"


def _draw_foci(ax: "Axes", scene: "Scene") -> None:
    """Contour of half the pressure at every focus at the start."""
    tacton, width = scene.tacton, spot_width(scene.pressure.height)
    phases = np.mod(tacton.trajectory.phase(0.0) + np.array(tacton.foci), 1.0)
    across = REACH * width * np.linspace(-1, 1, 81)
    grid = np.stack(np.meshgrid(across, across), axis=-1).reshape(-1, 2)
    shape = len(across), len(across)
    for centre in tacton.trajectory.at_phase(phases):
        places = grid + centre
        spot = scene.pressure.spot(places, centre).reshape(shape)
        x, y = 1e3 * places.reshape(*shape, 2).transpose(2, 0, 1)
        ax.contour(x, y, spot, [HALF * spot.max()], colors=FOCUS, linewidths=1.5)
    several = f"{len(tacton.foci)} foci" if len(tacton.foci) > 1 else "focus"
    ax.plot([], [], color=FOCUS, lw=1.5, label=f"{several}, half pressure")


def _draw_probes(ax: "Axes", probes: Floats) -> None:
    x, y = 1e3 * probes.T
    ax.plot(x, y, ls="none", marker="o", ms=4, color=PROBE, label="probes")
    for k in range(min(len(probes), MOST_NUMBERED)):
        ax.annotate(str(k), (x[k], y[k]), xytext=(3, 3), textcoords="offset points", color=PROBE,
                    fontsize=drawing.small())  # fmt: skip
