"""The first screen of a page: three sentences, one picture, one small table."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from simple_model.numbers import decibel, percent, significant, stated_error
from simple_model.quantities import DISPLACEMENT, PRESSURE, Quantity
from skinwave.report.figures import REPORT
from skinwave.report.maps import BESIDE, SURFACES, surfaces_figure
from skinwave.report.palette import label
from skinwave.report.styles import Style
from skinwave.results.propagation import (
    NEAR,
    OUTSIDE,
    Component,
    Propagation,
    Reach,
    added_lines,
)
from skinwave.results.run import Run
from skinwave.scene.keys import LOSSES, MODULI, SCALES
from skinwave.scene.scene import Scene
from skinwave.scene.spreads import spreads_of
from skinwave.studies.changes import Shown
from skinwave.system.document import Details, Part
from skinwave.system.table import Table

NOTHING = "Nothing vibrates: a constant pressure on a focus at rest leaves no wave."
ABOUT_MAPS = (
    "Share of squared displacement and spread are of maps of 44 mm either way. A slab's is that of "
    "a laterally infinite layer; of other bodies the first Tacton alone has a map. Strongest is "
    "the largest amplitude at any probe; a phase delay is known up to whole periods and includes "
    "the phase of a body that is driven off resonance."
)
SCALED = {MODULI: "moduli", LOSSES: "losses"}
NAMED = 3  # lines that a sentence names


def top(
    shown: Shown, picture: Callable[[Figure, str], Part], name: str = "", style: Style = REPORT
) -> list[Part]:
    """Parts of a page: what a reader of ten seconds reads of the Tacton that is shown first.

    Parameters
    ----------
    shown : Shown
    picture : makes a part of the page of a figure and its caption
    name : of the Tacton, on a page of several
    style : of the figure
    """
    parts: list[Part] = [*sentences(shown)]
    if name:
        parts[0] = f"{name}, one of the Tactons below: {parts[0]}"
    if shown.surfaces and shown.changes[shown.body.column].strongest:
        figure = surfaces_figure(shown.kernel.scene, shown.surfaces, style, measured=shown.measured)
        parts.append(picture(figure, f"{SURFACES} {BESIDE}" if shown.measured else SURFACES))
    bodies = small_table(list(shown.changes.values()), shown.kernel.tacton)
    return [*parts, bodies, beside_published(shown.kernel, shown.published)]


def sentences(shown: Shown) -> list[str]:
    """Effect of propagation, effect of the drive law, and reach above threshold with its error."""
    found = shown.changes[shown.body.column]
    driven = _driven(shown.kernel, shown.published)
    return [_propagated(found), driven, f"{_above_threshold(found)} {_sure(shown)}"]


def small_table(columns: Sequence[Propagation], name: str) -> Table:
    """Kernel and bodies under the same load, a column each."""
    first = columns[0]
    rows = [
        ["share of motion outside the kernel's -20 dB region"]
        + ["0 %" if first.share is not None else "-", *(_percent(c.share) for c in columns)],
        ["spread from the path at -6 dB, mm"]
        + [_reach(first.kernel_spread), *(_reach(c.spread) for c in columns)],
        ["phase delay of the strongest component at the path, ms"]
        + ["0", *(_delay(c) for c in columns)],
        ["strongest component"]
        + [_component(first.kernel_strongest, PRESSURE)]
        + [_component(c.strongest) for c in columns],
        ["component of highest sensation level"]
        + ["-", *(_highest_sensation(c.highest_sensation) for c in columns)],
    ]
    return Table([f"{name}: same load", "point kernel", *(label(c.column) for c in columns)], rows)


def beside_published(kernel: Run, published: Run) -> Details:
    """Effect of drive law and focus: the kernel as published beside the same load."""
    names = [n for n in kernel.frequencies if n in published.frequencies]
    levels = []
    for run in (published, kernel):
        top = max((float(x.max()) for x in run.lines.values()), default=0.0)
        peaks = [max(float(run.lines[n].max()), 1e-300) for n in names]
        levels.append([20 * np.log10(peak / top) if top else -np.inf for peak in peaks])
    shown = sorted(range(len(names)), key=lambda k: -max(levels[0][k], levels[1][k]))[:8]
    rows = [
        [names[k], f"{kernel.frequencies[names[k]]:.1f}", *(decibel(x[k]) for x in levels)]
        for k in shown
    ]
    columns = ["component", "frequency, Hz", "as published, dB re its strongest"]
    drives = " against ".join(
        f"{r.scene.pressure.drive}, {r.scene.pressure.profile_name}" for r in (kernel, published)
    )
    return Details(
        "Kernel as published beside the same load: what the drive law and the focus change",
        [f"{drives}; largest at any probe.",
         Table([*columns, "same load, dB re its strongest"], rows)],
    )  # fmt: skip


def _propagated(found: Propagation) -> str:
    if found.strongest is None:
        return NOTHING
    name, said = label(found.column), []
    if found.share is not None:
        said = [
            f"{_percent(found.share)} of the mean-square motion of the {name} lies outside the "
            f"kernel's {OUTSIDE:g} dB region.",
            f"It spreads up to {_reach(found.spread)} mm from the path ({NEAR:g} dB); kernel: "
            f"{_reach(found.kernel_spread)} mm.",
        ]
    if found.delay is not None:
        lag, f = significant(1e3 * found.delay, 2), found.strongest.frequency
        said.append(f"The {name} lags the kernel by {lag} ms at {f:.0f} Hz.")
    return " ".join(said) or f"The {name} moves at {found.strongest.frequency:.0f} Hz."


def _driven(kernel: Run, published: Run) -> str:
    names, pressure = added_lines(kernel, published), kernel.scene.pressure
    if pressure == published.scene.pressure:
        return "The load is the published one: only propagation differs from the paper's model."
    law = f"Drive law and focus ({pressure.drive}, {pressure.profile_name})"
    if not names:
        return f"{law} change strengths of components and add none."
    said = ", ".join(names[:NAMED]) + " and others" * (len(names) > NAMED)
    return f"{law} add {said}; propagation adds no component."


def _above_threshold(found: Propagation) -> str:
    if found.strongest is None:
        return ""
    if (peak := found.highest_sensation) is None or peak.level is None:
        peak = found.strongest
        return (
            f"The strongest component is {peak.name} at {peak.frequency:.0f} Hz; detection "
            "thresholds are of skin and say nothing of paper."
        )
    most = f"{peak.name} ({peak.frequency:.0f} Hz, {peak.level:+.0f} dB SL)"
    if not found.above_threshold:
        where = "Above" if peak.level >= 0 else "Below"
        return f"{where} threshold at the probes; strongest sensation: {most}."
    half, now, twice = found.above_threshold
    if now is None:
        return f"Below the threshold of detection everywhere; strongest sensation: {most}."
    less = "0" if half is None else _reach(half)
    return (
        f"Above threshold up to {_reach(now)} mm from the path; strongest sensation: {most}. The "
        f"pressure is known only to a factor of 2: {less} to {_reach(twice)} mm."
    )


def _sure(shown: Shown) -> str:
    error = "The numerical error is not known"
    if shown.budget is not None:
        error = shown.budget.words
    elif np.isfinite(shown.error):
        error = f"Numerical error {stated_error(shown.error)}"
    if shown.body.scene.body.of_kind.is_plate:
        text = "grammage, stiffness and support of the sheet that was measured are not published"
        return f"{error}; {text}."
    if not (known := known_of(shown.body.scene)):
        return f"{error}."
    text = f"material: {known}"
    if shown.shares is not None:
        least, most = (significant(100 * share, 2) for share in shown.shares)
        text += f"; with these, the share outside is {least} to {most} %"
    return f"{error}; {text}."


def known_of(scene: Scene) -> str:
    """What is known of the moduli and the losses of a scene's materials, in words."""
    found: dict[str, list[str]] = {name: [] for name in SCALES}
    for each in spreads_of(scene):
        if (name := each.key.rpartition(".")[2]) in found:
            found[name].append(each.distribution.words)
    return ", ".join(
        f"{SCALED[name]} {' or '.join(dict.fromkeys(words))}"
        for name, words in found.items()
        if words
    )


def _component(found: Component | None, quantity: Quantity = DISPLACEMENT) -> str:
    if found is None:
        return "none"
    return f"{found.name}, {found.frequency:.0f} Hz, {quantity.text(found.amplitude, 2)}"


def _delay(found: Propagation) -> str:
    return "-" if found.delay is None else significant(1e3 * found.delay, 2)


def _highest_sensation(found: Component | None) -> str:
    if found is None or found.level is None:
        return "-"
    return f"{found.name}, {found.frequency:.0f} Hz, {found.level:+.0f} dB SL"


def _percent(share: float | None) -> str:
    return "-" if share is None else percent(share)


def _reach(found: Reach | None) -> str:
    if found is None:
        return "-"
    return f"{'> ' * found.beyond}{1e3 * found.metre:.0f}"


def per_tacton(found: Mapping[str, Mapping[str, Propagation]]) -> list[Part]:
    """Tacton -> body -> what propagation changes, a row each."""
    rows = [
        [name, label(c.column), _percent(c.share), _reach(c.kernel_spread), _reach(c.spread),
         _delay(c), _component(c.kernel_strongest, PRESSURE), _component(c.strongest),
         _highest_sensation(c.highest_sensation)]
        for name, columns in found.items()
        for c in columns.values()
    ]  # fmt: skip
    columns = ["Tacton", "body", "share outside", "spread of kernel, mm", "of body, mm"]
    columns += ["phase delay of strongest in body, ms", "strongest in kernel", "in body"]
    return [ABOUT_MAPS, Table([*columns, "highest sensation level"], rows)]
