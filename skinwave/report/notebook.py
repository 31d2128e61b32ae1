"""Scenes, plans and comparisons as one line of text, and as small pages for notebooks."""

from typing import TYPE_CHECKING, Any

import numpy as np

from simple_model import drawing
from simple_model.numbers import interval, plural
from skinwave.report.description import scene_rows
from skinwave.report.palette import BLUE, ORANGE
from skinwave.typing import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from skinwave.bodies import Body
    from skinwave.planning.record import Plan
    from skinwave.results.comparison import Agreement
    from skinwave.scene.scene import Scene


def scene_line(scene: "Scene") -> str:
    """Describe name, Tacton, body and probes in one line."""
    tacton, body, path = scene.tacton, scene.body, scene.tacton.trajectory
    tones = [f"{f:g} Hz" for f in (tacton.am_frequency, tacton.second_am_frequency) if f]
    moving = f"{path.shape} of {1e3 * path.size:.4g} mm at {path.speed:g} m/s"
    load = [f"AM {', '.join(tones)}"] if tones else []
    load += ["focus at rest" if path.is_static else moving, f"{tacton.duration:g} s"]
    load += [scene.load.words] * (not scene.load.is_plain)
    size = body.of_kind.words(body)
    if body.of_kind.discretise:
        layers = [f"{1e3 * each.thickness:g} mm of {_label(each.material)}" for each in body.layers]
        size += f", {'; below it '.join([*layers, _label(body.material)])}"
    probes = f"{plural(len(scene.probes), 'probe')}, {scene.reading.words}"
    return f"<Scene {scene.name!r}: {', '.join(load)}; {size}; {probes}>"


def plan_line(plan: "Plan") -> str:
    """Describe model, body, expected error, cost and number of warnings in one line."""
    body = plan.body.of_kind.words(plan.body)
    body += f" halved across {' and '.join(plan.symmetry)}" if plan.symmetry else ""
    size = f"elements of {1e3 * plan.h:.3g} mm" if plan.h else "no mesh"
    return (
        f"<Plan of {plan.model}: {size}, {body}; expected error {plan.statement.words}; "
        f"{_cost(plan)}; {plural(len(plan.warnings), 'warning')}>"
    )


def agreement_line(agreement: "Agreement") -> str:
    """Describe misfits, scale, and numbers of probes and spectral lines."""
    return (
        f"<Agreement: relative L2 misfit {_range(agreement.relative_l2)}; misfit of the shape "
        f"{_range(agreement.shape_misfit)}; scale {agreement.scale:.4g}; "
        f"{plural(len(agreement.probes), 'probe')}, {plural(len(agreement.frequencies), 'line')}>"
    )


def _label(material: object) -> str:
    if isinstance(material, str):
        return material
    young, density = getattr(material, "young", np.nan), getattr(material, "density", np.nan)
    return f"a material of {young:.4g} Pa and {density:g} kg/m3"


def _cost(plan: "Plan") -> str:
    if plan.seconds is None or plan.memory is None:
        return "cost unknown"
    return f"{plan.seconds:.2g} s, {plan.memory / 2**30:.2g} GiB"


def _range(misfit: Floats) -> str:
    return f"{interval(100 * float(misfit.min()), 100 * float(misfit.max()))} %"


def scene_page(scene: "Scene") -> str:
    """Return a page with a scene from above and a table of its contents."""
    uncertain = [f"{key} is uncertain; its central value is used" for key, _ in scene.spreads]
    image = drawing.picture(lambda figure: draw_scene(scene, figure.subplots()), 4.2, 3.8)
    return drawing.page(f"Scene {scene.name}", image, [drawing.table(scene_rows(scene))], uncertain)


def plan_page(plan: "Plan") -> str:
    """Return a page with the modelled body, and every choice of a plan with its reason."""

    def draw(figure: "Figure") -> None:
        ax = figure.subplots()
        _draw_body(ax, plan.body, plan.symmetry)
        _finish(ax)

    kind = plan.body.of_kind
    image = drawing.picture(draw, 3.2, 3.0) if kind.discretise and kind.is_bounded else b""
    facts = [["expected error", plan.statement.words], ["cost", _cost(plan)]]
    rows = [[row.what, row.value, row.reason] for row in plan.rows]
    tables = [drawing.table(facts), drawing.table(rows, ["", "", "reason"])]
    return drawing.page(f"Plan: {plan.model}", image, tables, plan.warnings)


def agreement_page(agreement: "Agreement", most_probes: int = 12) -> str:
    """Return a page with misfit and delay at each of at most some probes, and lines in dB."""
    with np.errstate(divide="ignore", invalid="ignore"):
        levels = 20 * np.log10(agreement.line_ratios).T
    columns = zip(
        agreement.probes, agreement.relative_l2, agreement.shape_misfit, agreement.delay, levels,
        strict=True,
    )  # fmt: skip
    rows = [
        [drawing.place_name(place), f"{100 * l2:.3g}", f"{100 * shape:.3g}", f"{1e3 * delay:.3g}",
         *(f"{level:.2f}" for level in lines)]
        for place, l2, shape, delay, lines in columns
    ]  # fmt: skip
    header = ["probe, mm", "relative L2 misfit, %", "misfit of the shape, %", "delay, ms"]
    header += [f"{frequency:g} Hz, dB re reference" for frequency in agreement.frequencies]
    facts = [["scale", f"{agreement.scale:.4g}"]] + [
        [f"spread to {drop} dB", f"{1e3 * reference:.3g} mm (reference), "
         f"{1e3 * agreement.spread_candidate[drop]:.3g} mm (candidate)"]
        for drop, reference in agreement.spread_reference.items()
    ]  # fmt: skip
    tables = [drawing.table(facts), drawing.table(rows[:most_probes], header)]
    return drawing.page("Candidate against reference", b"", tables)


def draw_scene(scene: "Scene", ax: "Axes | None", most_numbered: int = 20) -> "Axes":
    """Draw body, path, foci at the start and probes from above, in mm; number the first probes."""
    ax, path = drawing.new_axes(ax), scene.tacton.trajectory
    _draw_body(ax, scene.body)
    if not path.is_static:
        x, y = 1e3 * path.at_phase(np.linspace(0, 1, 721)).T
        ax.plot(x, y, color="#222222", lw=1.2, ls="dotted", label="path")
    _draw_foci(ax, scene)
    x, y = 1e3 * scene.probe_points.T
    ax.plot(x, y, ls="none", marker="o", ms=4, color=BLUE, label="probes")
    for k in range(min(len(x), most_numbered)):
        ax.annotate(str(k), (x[k], y[k]), xytext=(3, 3), textcoords="offset points", color=BLUE,
                    fontsize=drawing.small())  # fmt: skip
    inch = ax.figure.get_figwidth()  # type: ignore[union-attr]
    columns = 1 if inch < 0.5 * drawing.small() else 2
    _finish(ax, ncols=columns, borderaxespad=0.2, handlelength=1.5, columnspacing=1.0)
    return ax


def _finish(ax: "Axes", **legend: Any) -> None:
    """Label axes in mm and add a legend above them."""
    ax.set(aspect="equal", xlabel="x, mm", ylabel="y, mm")
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), frameon=False, fontsize=drawing.small(),
              **legend)  # fmt: skip


def _draw_body(ax: "Axes", body: "Body", symmetry: str = "") -> None:
    """Draw the outline of a body from above; shade the modelled part if it is halved.

    Nothing is drawn for a body from a file, whose surface is not known here.
    """
    from matplotlib.patches import FancyBboxPatch, Rectangle

    if not (body.of_kind.is_bounded and body.of_kind.discretise):
        return
    width, height = 1e3 * body.width, 1e3 * body.height
    radius = 1e3 * body.palm.corner_radius if "relief" in body.of_kind.keys else 0.0
    skin = "#e8d5c4"
    outline = FancyBboxPatch(
        (-width / 2, -height / 2), width, height,
        f"round,pad=0,rounding_size={radius}" if radius else "square,pad=0",
        facecolor="none" if symmetry else skin, edgecolor="0.4", label=body.of_kind.words(body),
    )  # fmt: skip
    ax.add_patch(outline)
    if symmetry:
        left, bottom = (0.0 if a in symmetry else -size / 2
                        for a, size in (("x", width), ("y", height)))  # fmt: skip
        part = Rectangle((left, bottom), width / 2 - left, height / 2 - bottom, facecolor=skin)
        part.set_label("modelled part")
        ax.add_patch(part)
        part.set_clip_path(outline)
    ax.update_datalim([(-width / 2 - 2, -height / 2 - 2), (width / 2 + 2, height / 2 + 2)])
    ax.autoscale_view()


def _draw_foci(ax: "Axes", scene: "Scene", reach: float = 4.0) -> None:
    """Draw the contour of half the pressure around every focus at the start.

    It lies within `reach` times the width of a focal spot.
    """
    tacton = scene.tacton
    phases = np.mod(tacton.trajectory.phase(0.0) + np.array(tacton.foci), 1.0)
    across = reach * scene.pressure.spot_scale * np.linspace(-1, 1, 81)
    grid = np.stack(np.meshgrid(across, across), axis=-1)
    for centre in tacton.trajectory.at_phase(phases):
        spot = scene.pressure.spot((grid + centre).reshape(-1, 2), centre).reshape(grid.shape[:2])
        x, y = np.moveaxis(1e3 * (grid + centre), -1, 0)
        ax.contour(x, y, spot, [0.5 * spot.max()], colors=ORANGE, linewidths=1.5)
    several = f"{len(tacton.foci)} foci" if len(tacton.foci) > 1 else "focus"
    ax.plot([], [], color=ORANGE, lw=1.5, label=f"{several}, half pressure")
