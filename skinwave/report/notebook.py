"""Plans and comparisons in a line, and as small pages for notebooks."""

from typing import TYPE_CHECKING

import numpy as np

from simple_model import drawing
from simple_model.numbers import counted, percent, stated_error
from skinwave.report.scene_plot import draw_body

if TYPE_CHECKING:
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
    with np.errstate(divide="ignore", invalid="ignore"):
        levels = 20 * np.log10(found.line_ratios).T
    columns = zip(
        found.probes, found.relative_l2, found.shape_misfit, found.delay, levels, strict=True
    )
    rows = [
        [drawing.place_name(place), f"{100 * l2:.3g}", f"{100 * shape:.3g}", f"{1e3 * delay:.3g}",
         *(f"{level:.2f}" for level in lines)]
        for place, l2, shape, delay, lines in columns
    ]  # fmt: skip
    header = ["probe, mm", "relative L2 misfit, %", "misfit of the shape, %", "delay, ms"]
    header += [f"{frequency:g} Hz, dB re reference" for frequency in found.frequencies]
    facts = [["scale", f"{found.scale:.4g}"]] + [
        [f"spread to {drop} dB", f"{1e3 * reference:.3g} mm of the reference, "
         f"{1e3 * found.spread_candidate[drop]:.3g} mm of the candidate"]
        for drop, reference in found.spread_reference.items()
    ]  # fmt: skip
    tables = [drawing.table(facts), drawing.table(rows[:MOST_ROWS], header)]
    return drawing.page("Candidate against reference", b"", tables)
