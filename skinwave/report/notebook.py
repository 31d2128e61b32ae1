"""Plans and comparisons in a line, and as small pages for notebooks."""

from typing import TYPE_CHECKING

import numpy as np

from simple_model import drawing
from simple_model.numbers import counted, percent, stated_error
from skinwave.report.scene_plot import draw_body

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from meshes.tetmesh import Floats
    from skinwave.planning.records import Plan
    from skinwave.results.comparison import Agreement

MOST_ROWS = 12  # probes in a table


def plan_line(plan: "Plan") -> str:
    """Model, body, expected error, cost and number of warnings."""
    size = f"elements of {1e3 * plan.h:.3g} mm" if plan.h else "no mesh"
    body = plan.body.of_kind.words(plan.body)
    body += f" halved across {' and '.join(plan.symmetry)}" if plan.symmetry else ""
    said = [
        f"{size}, {body}",
        f"expected error {stated_error(plan.error)}",
        f"{plan.seconds:.2g} s, {plan.memory / 2**30:.2g} GiB",
        counted(len(plan.warnings), "warning"),
    ]
    return f"<Plan of {plan.model}: {'; '.join(said)}>"


def agreement_line(found: "Agreement") -> str:
    """Misfits, delays and number of lines."""
    said = [
        f"relative L2 misfit {_range(found.relative_l2)}",
        f"of the shape {_range(found.shape_misfit)}",
        f"scale {found.scale:.4g}",
        f"{counted(len(found.probes), 'probe')}, {counted(len(found.frequencies), 'line')}",
    ]
    return f"<Agreement: {'; '.join(said)}>"


def _range(misfit: "Floats") -> str:
    low, high = (percent(float(end)) for end in (misfit.min(), misfit.max()))
    return low if low == high else f"{low.removesuffix(' %')} to {high}"


def plan_page(plan: "Plan") -> str:
    """A plan: the body that is modelled, and every choice with its reason."""

    def draw(figure: "Figure") -> None:
        ax = figure.subplots()
        draw_body(ax, plan.body, plan.symmetry)
        ax.set_aspect("equal")
        ax.set_xlabel("x, mm")
        ax.set_ylabel("y, mm")
        ax.legend(loc="lower left", bbox_to_anchor=(0, 1), frameon=False, fontsize=drawing.small())

    kind = plan.body.of_kind
    image = drawing.picture(draw, 3.2, 3.0) if kind.discretise and kind.is_bounded else b""
    cost = f"{plan.seconds:.2g} s, {plan.memory / 2**30:.2g} GiB"
    facts = [["expected error", stated_error(plan.error)], ["cost", cost]]
    rows = [[row.what, row.value, row.reason] for row in plan.rows]
    tables = [drawing.table(facts), drawing.table(rows, ["", "", "reason"])]
    return drawing.page(f"Plan: {plan.model}", image, tables, plan.warnings)


def agreement_page(found: "Agreement") -> str:
    """A comparison: misfit and delay at every probe, and lines in dB."""

    def draw(figure: "Figure") -> None:
        left, right = figure.subplots(1, 2)
        _draw_misfits(left, found)
        _draw_lines(right, found)

    rows = [
        [drawing.place_name(place), *(f"{100 * x:.3g}" for x in misfits), f"{1e3 * delay:.3g}"]
        for place, delay, *misfits in zip(
            found.probes, found.delay, found.relative_l2, found.shape_misfit, strict=True
        )
    ]  # fmt: skip
    header = ["probe, mm", "relative L2 misfit, %", "misfit of the shape, %", "delay, ms"]
    facts = [["scale", f"{found.scale:.4g}"]] + [
        [f"spread to {drop} dB", f"{1e3 * reference:.3g} mm of the reference, "
         f"{1e3 * found.spread_candidate[drop]:.3g} mm of the candidate"]
        for drop, reference in found.spread_reference.items()
    ]  # fmt: skip
    tables = [drawing.table(facts), drawing.table(rows[:MOST_ROWS], header)]
    return drawing.page("Candidate against reference", drawing.picture(draw, 8, 2.6), tables)


def _draw_misfits(ax: "Axes", found: "Agreement") -> None:
    probes = np.arange(len(found.probes))
    ax.bar(probes - 0.2, 100 * found.relative_l2, 0.4, label="relative L2", color="#0072B2")
    ax.bar(probes + 0.2, 100 * found.shape_misfit, 0.4, label="shape", color="#E69F00")
    ax.set_xlabel("probe")
    ax.set_ylabel("misfit, %")
    ax.legend(frameon=False, fontsize=drawing.small())


def _draw_lines(ax: "Axes", found: "Agreement") -> None:
    """Ratio of every line, over the probes."""
    with np.errstate(divide="ignore", invalid="ignore"):
        levels = 20 * np.log10(found.line_ratios)
    for frequency, level in zip(found.frequencies, levels, strict=True):
        ax.plot(np.where(np.isfinite(level), level, np.nan), marker="o", ms=4,
                label=f"{frequency:g} Hz")  # fmt: skip
    ax.axhline(0, color="0.6", lw=0.8)
    ax.set_xlabel("probe")
    ax.set_xticks(range(len(found.probes)))
    ax.set_ylabel("line, dB re reference")
    if len(found.frequencies):
        ax.legend(frameon=False, fontsize=drawing.small())
    else:
        ax.text(0.5, 0.6, "no line was asked for", transform=ax.transAxes, ha="center")
