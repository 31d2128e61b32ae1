"""Page and tables of models beside a measurement."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from simple_model.numbers import stated_error
from skinwave.measure.alignment import opposite_sign
from skinwave.measure.flaws import flaws
from skinwave.measure.measured_runs import drawn_places
from skinwave.measure.measured_study import (
    LEVEL,
    Column,
    MeasuredComparison,
    body_columns,
    main_column,
    overlap,
)
from skinwave.measure.measured_tables import (
    claims_table,
    coherence_parts,
    columns_table,
    differences_table,
)
from skinwave.measure.significance import radius
from skinwave.report.measured import MOST_LINES, lines_figure
from skinwave.report.palette import label
from skinwave.system import document
from skinwave.system.document import Markup, paragraph
from skinwave.system.numbers import significant

SURELY = 0.85  # of the record, or of the Tacton, that is within the other at the true delay
FEW = 4  # repetitions: of fewer the noise is poorly known
STEADY, CLEARLY = 0.8, 6.0  # least over largest amplitude; standard errors between them
MOST_NAMED = 3  # lines that a sentence names
CAPTION = (
    f"At most {MOST_LINES} lines, the strongest. Models are drawn with the delay and the gain "
    "that fit each best, or that were given. Filled where the difference, amplitude and phase "
    "together, is beyond the noise."
)
METHOD = (
    "Lines are fitted to each repetition by least squares; gain and delay of each model follow "
    "from all lines and places, weighed by their noise, and their errors are those of the noise "
    "alone. A difference is beyond the noise where the chance of one so large, if there were only "
    f"noise, is below {100 * LEVEL:g} % for all lines and places together (Holm's correction); the "
    "noise is taken as circular (Victor & Mast 1991). The point kernels are pressures, and their "
    "gain has that unit."
)


def page_parts(found: MeasuredComparison, picture: Callable[[str, Figure, str], str]) -> list[str]:
    """Parts of a page: the conclusion, a figure and tables.

    Parameters
    ----------
    found : MeasuredComparison
    picture : makes a part of the page of a name, a figure and its caption
    """
    main, at = main_column(found), drawn_places(found)
    columns = {c.run.column: c for c in found.columns}
    figure = lines_figure(
        {n: float(f) for n, f in zip(found.names, found.lines.frequencies, strict=True)},
        found.scene.probe_points[at], found.lines.mean[:, at], found.lines.amplitude_error[:, at],
        {name: c.model[:, at] for name, c in columns.items()},
        {name: c.differs[:, at] for name, c in columns.items()}, found.measurement.record,
    )  # fmt: skip
    return [document.section(
        "Beside the measurement",
        *(paragraph(conclusion(found, column)) for column in body_columns(found)),
        *map(paragraph, remarks(found)),
        picture("measured", figure, CAPTION),
        columns_table(found),
        paragraph(METHOD),
        _folded(f"Largest differences of the {label(main.run.column)}, line by line",
                differences_table(found, main)),
        _folded("Coherence of the lines", *coherence_parts(found)),
        document.section("Which of the paper's claims the measurement itself shows",
                         claims_table(found)),
        document.section("The models by themselves"),
    )]  # fmt: skip


def _folded(heading: str, *parts: str) -> Markup:
    return Markup("<details><summary>{}</summary>{}</details>").format(
        heading, Markup("\n").join(parts)
    )


def conclusion(found: MeasuredComparison, column: Column) -> str:
    """Whether a model agrees with the data, and where not."""
    name, differs = label(column.run.column), column.differs
    known = np.isfinite(column.significance)
    left = f"its misfit is {significant(100 * column.misfit, 2)} % of the measured lines"
    if not known.any():
        return (
            f"Whether the {name} agrees with the data cannot be said, since the noise of the data "
            f"is unknown; {left}."
        )
    left += f", where noise alone leaves {significant(100 * found.noise, 2)} %"
    least = significant(100 * _detectable(found), 2)
    if not differs.any():
        return (
            f"The {name} agrees with the data within the noise: of {known.sum()} differences of "
            f"lines at places none is beyond it; {left}. Differences below {least} % of the "
            "strongest line would not be seen."
        )
    if found.is_numerical(column)[differs].all():
        return (
            f"The {name} agrees with the data within the noise and its own numerical error: of "
            f"{known.sum()} differences of lines at places {differs.sum()} are beyond the "
            f"noise{_numerical(found, column)}; {left}."
        )
    return (
        f"The {name} does not agree with the data everywhere: {differs.sum()} of {known.sum()} "
        f"differences of lines at places are beyond the noise{_numerical(found, column)}: "
        f"{_where(found, column)}. {left[0].upper()}{left[1:]}."
    )


def _numerical(found: MeasuredComparison, column: Column) -> str:
    """How many of the differences may be numerical."""
    few = int((column.differs & found.is_numerical(column)).sum())
    error = stated_error(column.run.response.expected_error)
    return f" ({few} of them within the model's numerical error of {error})" if few else ""


def _detectable(found: MeasuredComparison) -> float:
    """Median radius of the confidence circles, over the strongest line."""
    around = radius(found.lines, 1 - LEVEL / found.lines.variance.size)
    return float(np.nanmedian(around) / np.abs(found.lines.mean).max())


def _where(found: MeasuredComparison, column: Column) -> str:
    """The lines and places where differences are beyond the noise, the largest first."""
    real = column.differs & ~found.is_numerical(column)
    shown = real if real.any() else column.differs
    away = np.where(shown, np.abs(found.lines.mean - column.model), 0)
    order = np.argsort(-away.max(axis=1), kind="stable")
    lines = [k for k in order if shown[k].any()]
    names, asked = list(found.names), found.measurement.record
    said = []
    for k in lines[:MOST_NAMED]:
        p = int(np.argmax(away[k]))
        x, y = 1e3 * found.scene.probe_points[p]
        has, shows = (asked.text(float(np.abs(z[k, p])))
                      for z in (column.model, found.lines.mean))  # fmt: skip
        said.append(
            f"{names[k]} at {shown[k].sum()} of {away.shape[1]} places (most at "
            f"{x:.3g}, {y:.3g} mm: measured {shows}, model {has}{_turned(found, column, k, p)})"
        )
    more = len(lines) - len(said)
    return ", ".join(said) + (f" and {more} more line{'s' * (more > 1)}" if more else "")


def _turned(found: MeasuredComparison, column: Column, k: int, p: int) -> str:
    """How far a model's phase is from the measured one, where both have one."""
    a, b = found.lines.mean[k, p], column.model[k, p]
    turn = np.degrees(np.angle(b * np.conj(a)))
    return f", {turn:+.0f} degrees off" if abs(b) > 0.1 * abs(a) and abs(turn) >= 1 else ""


def remarks(found: MeasuredComparison) -> list[str]:
    """Sentences on the record: repetitions, what is unresolved, and what was assumed."""
    measurement, shifts = found.measurement, found.lines.shifts
    r = len(measurement.values)
    said = f"{measurement.name or 'The measurement'}: {measurement.record.words} at "
    said += f"{len(measurement.places)} place{'s' * (len(measurement.places) > 1)}, "
    if r == 1:
        said += f"one repetition, whose noise {_noise_of_one(found)}."
    else:
        said += f"{r} repetitions, whose spread is the noise"
        step = f"; they are out of step by up to {1e3 * np.ptp(shifts):.3g} ms, and were shifted"
        said += (step if shifts.any() else ", in step within it") + "."
        said += " More of them would tell smaller differences." if r < FEW else ""
    lost, main = ", ".join(found.unresolved), main_column(found)
    return [
        said,
        *_opposite(main),
        *_outside(found, main),
        *([f"Not compared, since record or model cannot resolve them: {lost}."] if lost else []),
        *_changes(found),
        *(f"{said[0].upper()}{said[1:]}." for said in flaws(measurement, found.scene.pressure)),
        *measurement.remarks,
    ]


def _noise_of_one(found: MeasuredComparison) -> str:
    """Where the noise of a single repetition is from."""
    lines = found.lines
    unknown = int(np.isnan(lines.variance).any(axis=1).sum())
    if unknown == len(lines.frequencies):
        return "is unknown"
    others = f", and unknown for {unknown} line{'s' * (unknown > 1)}" * (unknown > 0)
    return f"is that of the noise floor under each line{others}"


def _opposite(column: Column) -> list[str]:
    """A sentence where the other sign of the measurement fits as well."""
    said = opposite_sign(f"the {label(column.run.column)}", has_delay=True)
    return [f"{said[0].upper()}{said[1:]}."] * column.may_be_turned


def _outside(found: MeasuredComparison, column: Column) -> list[str]:
    """A sentence where much of the record lies outside the Tacton at its delay."""
    times, delay = found.measurement.times, column.alignment.delay
    if found.measurement.is_spectrum:
        return []
    inside, most = overlap(found.measurement, column.run, delay), float(np.ptp(times))
    if inside > SURELY * min(most, float(np.ptp(column.run.response.times))):
        return []
    return [
        f"At its delay of {1e3 * delay:.3g} ms only {1e3 * max(inside, 0.0):.3g} of the "
        f"{1e3 * most:.3g} ms of the record lie within the Tacton, and another delay may be the "
        "true one: give --delay, or cut off what lies before and after."
    ]


def _changes(found: MeasuredComparison) -> list[str]:
    """A sentence on a strongest line that is not steady, as of a record that begins too early."""
    size = np.abs(found.lines.mean)
    k, p = np.unravel_index(int(np.argmax(size)), size.shape)
    low, high = found.coherence.extremes[:, k, p]
    count = found.coherence.segments / found.coherence.repetitions
    noise = np.sqrt(np.nan_to_num(found.lines.variance[k, p]) * count / 2)
    if low > STEADY * high or high - low < CLEARLY * noise:
        return []
    asked, name = found.measurement.record, list(found.names)[k]
    return [
        f"The motion is not steady: over the record {name} changes from {asked.text(low)} to "
        f"{asked.text(high)} at one place; cut off what lies before and after the Tacton."
    ]
