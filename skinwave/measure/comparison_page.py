"""Page parts and tables of models beside a measurement."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from simple_model.numbers import (
    as_sentence,
    percent,
    plural,
    significant,
    stated_error,
    with_error,
)
from skinwave.measure.alignment import opposite_sign
from skinwave.measure.claims import FAILS, HOLDS
from skinwave.measure.comparison import LEVEL, UNKNOWN, MeasuredComparison, ModelColumn, overlap
from skinwave.measure.inspection import flaws
from skinwave.report.palette import label
from skinwave.report.spectra import MOST_LINES, lines_figure
from skinwave.results.claims import TEXTS
from skinwave.system.document import Details, Picture, Section
from skinwave.system.table import Column, Table

SURELY = 0.85  # of the record, or of the Tacton, that is within the other at the true delay
FEW = 4  # repetitions: of fewer the noise is poorly known
STEADY, CLEARLY = 0.8, 6.0  # least over largest amplitude; standard errors between them
MOST_NAMED = 3  # lines that a sentence names
MOST_ROWS = 30  # of differences on the page; all are in measured.csv
CAPTION = (
    f"The strongest lines, at most {MOST_LINES}. Models are drawn with the delay and the gain that "
    "fit each best, or that were given. Filled where the difference, amplitude and phase together, "
    "is beyond the noise."
)
METHOD = (
    "Lines are fitted to each repetition by least squares. Gain and delay of each model follow "
    "from all lines and places, weighted by their noise; their errors are those of the noise "
    "alone. A difference is beyond the noise where the chance of one so large by noise alone is "
    f"below {100 * LEVEL:g} % for all lines and places together (Holm's correction; Victor & Mast "
    "1991). The point kernels are pressures, and their gain has that unit."
)
NO_CLAIMS = (
    "The claims are about one focus that is modulated by one tone at most, moves along a closed "
    "path or both; this Tacton is another."
)
OF_CLAIMS = (
    "From the data alone. A claim holds, or fails, where every set of amplitudes within the noise "
    "says so (95 % for all together)."
)


def page_part(found: MeasuredComparison, picture: Callable[[str, Figure, str], Picture]) -> Section:
    """A part of a page: the conclusion, a figure and tables; `picture` makes a part of a name, a
    figure and its caption.
    """
    main, at = found.main, found.drawn_places
    columns = {c.run.column: c for c in found.columns}
    figure = lines_figure(
        {n: float(f) for n, f in zip(found.names, found.lines.frequencies, strict=True)},
        found.scene.probe_points[at], found.lines.mean[:, at], found.lines.amplitude_error[:, at],
        {name: c.model[:, at] for name, c in columns.items()},
        {name: c.differs[:, at] for name, c in columns.items()}, found.measurement.record,
    )  # fmt: skip
    largest = np.argsort(-np.abs(found.lines.mean - main.model), axis=None, kind="stable")
    rows, unit = list(_rows(found, main)), found.measurement.record.column
    differences = Table(_columns(found), [rows[k] for k in largest]).only(
        "line", "frequency_hz", "x_mm", "y_mm", f"measured_{unit}", f"measured_{unit}_error",
        f"model_{unit}", f"difference_{unit}", "phase_off_deg", "p_adjusted", "finding",
        most=MOST_ROWS,
    )  # fmt: skip
    return Section("Beside the measurement", [
        *(conclusion(found, column) for column in found.bodies),
        *remarks(found),
        picture("measured", figure, CAPTION),
        columns_table(found),
        METHOD,
        Details(f"Largest differences of the {label(main.run.column)}, line by line",
                [differences]),
        Section("Which of the paper's claims the measurement itself shows",
                [OF_CLAIMS, claims_table(found)] if found.claims else [NO_CLAIMS], 3),
    ])  # fmt: skip


def write_tables(folder: Path, found: MeasuredComparison) -> None:
    """Write measured.csv, a row for each line, place and model, and measured-claims.csv."""
    table = Table(_columns(found), (row for c in found.columns for row in _rows(found, c)))
    (folder / "measured.csv").write_bytes(table.to_csv())
    claims = ((c.claim, c.finding, c.sentence) for c in found.claims)
    claims_csv = Table(("claim", "finding", "sentence"), claims).to_csv()
    (folder / "measured-claims.csv").write_bytes(claims_csv)


def columns_table(found: MeasuredComparison) -> Table:
    """Misfit, gain and delay of each model."""
    rows, asked = [], found.measurement.record
    for column in found.columns:
        a, known, own = (
            column.alignment,
            np.isfinite(column.significance),
            column.run.response.record,
        )
        per = 1.0 if own == asked else asked.per_unit
        unit = "" if own == asked else f" {asked.shown} per {own.shown}"
        rows.append((
            label(column.run.column), 100 * column.misfit, 100 * found.noise,
            f"{column.differs.sum()} of {known.sum()}" if known.any() else UNKNOWN,
            _fitted(per * a.gain, per * a.gain_error) + unit,
            _fitted(1e3 * a.delay, 1e3 * a.delay_error), 1e3 * a.repeats,
        ))  # fmt: skip
    return Table((
        "model", Column("misfit", unit="%"), Column("misfit of noise alone", unit="%", digits=2),
        "differences beyond the noise", "gain", Column("delay of the record", unit="ms"),
        Column("delay is known up to multiples of", unit="ms"),
    ), rows)  # fmt: skip


def _fitted(value: float, error: float) -> str:
    return with_error(value, error) if error else f"{significant(value, 4)} (given)"


def _columns(found: MeasuredComparison) -> list[Column]:
    """Columns of measured.csv."""
    unit, name = found.measurement.record.shown, found.measurement.record.column
    return [
        Column("line"), Column("frequency_hz", "frequency", "Hz", 4), Column("place"),
        Column("x_mm", "x", "mm"), Column("y_mm", "y", "mm"),
        Column(f"measured_{name}", "measured", unit),
        Column(f"measured_{name}_error", "its error", unit, 2),
        Column("measured_phase_rad"), Column("measured_phase_rad_error"),
        Column("model"),
        Column(f"model_{name}", "model", unit), Column("model_phase_rad"),
        Column("phase_off_deg", "model's phase off by", "degrees", 2),
        Column(f"difference_{name}", "complex difference", unit),
        Column("p_adjusted", "p, adjusted", digits=1), Column("finding", "difference is"),
    ]  # fmt: skip


def _rows(found: MeasuredComparison, column: ModelColumn) -> Iterator[tuple[Any, ...]]:
    """Rows of a model, a line and place each."""
    lines, unit, findings = found.lines, found.measurement.record.per_unit, found.findings(column)
    for k, name in enumerate(found.names):
        for p, (x, y) in enumerate(found.scene.probe_points):
            z, m = lines.mean[k, p], column.model[k, p]
            measured = (
                unit * abs(z), unit * lines.amplitude_error[k, p], np.angle(z),
                lines.phase_error[k, p],
            )  # fmt: skip
            turn = np.degrees(np.angle(m * z.conj()))
            yield (
                name, float(lines.frequencies[k]), p + 1, float(1e3 * x), float(1e3 * y),
                *map(float, measured), column.run.column,
                *map(float, (unit * abs(m), np.angle(m), turn, unit * abs(z - m))),
                float(column.significance[k, p]), str(findings[k, p]),
            )  # fmt: skip


def claims_table(found: MeasuredComparison) -> Table:
    """Claims that are about such a Tacton, and what the measurement says of them."""
    classes = {HOLDS: "yes", FAILS: "no"}
    rows = [
        (f"{one.claim}: {TEXTS[one.claim]}",
         Markup('<span class="{}">{}</span>').format(classes.get(one.finding, ""), one.finding),
         one.sentence)
        for one in found.claims
    ]  # fmt: skip
    return Table(("claim", "in the data", "reason"), rows)


def conclusion(found: MeasuredComparison, column: ModelColumn) -> str:
    """Whether a model agrees with the data, and where not."""
    name, differs = label(column.run.column), column.differs
    known = int(np.isfinite(column.significance).sum())
    left = f"its misfit is {percent(column.misfit)} of the measured lines"
    if not known:
        return (
            f"Whether the {name} agrees with the data cannot be said, since the noise of the data "
            f"is unknown; {left}."
        )
    left += f", where noise alone leaves {percent(found.noise)}"
    if not differs.any():
        around = found.lines.radius(1 - LEVEL / found.lines.variance.size)
        least = float(np.nanmedian(around) / np.abs(found.lines.mean).max())
        return (
            f"The {name} agrees with the data within the noise in all {known} lines at places; "
            f"{left}. Differences below {percent(least)} of the strongest line would not be seen."
        )
    few, many = int((differs & found.is_numerical(column)).sum()), int(differs.sum())
    error = stated_error(column.run.response.expected_error)
    numerical = f" ({few} of them within the model's numerical error of {error})" if few else ""
    beyond = f"{many} of {known} differences of lines at places are beyond the noise{numerical}"
    if few == many:
        said = f"The {name} agrees with the data within the noise and its own numerical error"
        return f"{said}: {beyond}; {left}."
    said = f"The {name} does not agree with the data everywhere"
    return f"{said}: {beyond}: {_where(found, column)}. {as_sentence(left)}"


def _where(found: MeasuredComparison, column: ModelColumn) -> str:
    """The lines whose differences are beyond the noise, the largest first."""
    shown = column.differs & ~found.is_numerical(column)
    away = np.where(shown, np.abs(found.lines.mean - column.model), 0).max(axis=1)
    lines = [k for k in np.argsort(-away, kind="stable") if shown[k].any()]
    names, places = list(found.names), shown.shape[1]
    said = [f"{names[k]} at {shown[k].sum()} of {places} places" for k in lines[:MOST_NAMED]]
    more = len(lines) - len(said)
    return ", ".join(said) + (f" and {plural(more, 'more line')}" if more else "")


def remarks(found: MeasuredComparison) -> list[str]:
    """Sentences on the record: repetitions, what is unresolved, and what was assumed."""
    measurement, main = found.measurement, found.main
    said = f"{measurement.name or 'The measurement'}: {measurement.record.words} at "
    said += f"{plural(len(measurement.places), 'place')}, {_repetitions(found)}"
    turned = opposite_sign(f"the {label(main.run.column)}", has_delay=True)
    return [
        said,
        *[as_sentence(turned)] * main.may_be_turned,
        *_outside(found, main),
        *["Not compared, since record or model cannot resolve them: "
          f"{', '.join(found.unresolved)}."] * bool(found.unresolved),
        *_changes(found),
        *map(as_sentence, flaws(measurement, found.scene.pressure)),
        *map(as_sentence, measurement.remarks),
    ]  # fmt: skip


def _repetitions(found: MeasuredComparison) -> str:
    """How often the motion was measured, and where the noise is from."""
    shifts, lines = found.lines.shifts, found.lines
    if (r := len(shifts)) > 1:
        step = f"; they are out of step by up to {1e3 * np.ptp(shifts):.3g} ms, and were shifted"
        said = f"{r} repetitions, whose spread is in the noise{step if shifts.any() else ''}."
        return said + " More of them would show smaller differences." * (r < FEW)
    unknown = int(np.isnan(lines.variance).any(axis=1).sum())
    if unknown == len(lines.frequencies):
        return "one repetition, whose noise is unknown."
    others = f", and unknown for {plural(unknown, 'line')}" * (unknown > 0)
    return f"one repetition, whose noise is that of the noise floor under each line{others}."


def _outside(found: MeasuredComparison, column: ModelColumn) -> list[str]:
    """A sentence where much of the record lies outside the Tacton at its delay."""
    if found.measurement.is_spectrum:
        return []
    delay, most = column.alignment.delay, float(np.ptp(found.measurement.times))
    inside = overlap(found.measurement, column.run, delay)
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
    low, high = np.sort(found.halves[:, k, p])
    noise = np.sqrt(np.nan_to_num(found.lines.variance[k, p]))  # of half a record
    if low > STEADY * high or high - low < CLEARLY * noise:
        return []
    asked, name = found.measurement.record, list(found.names)[k]
    return [
        f"The motion is not steady: {name} is {asked.text(low)} in one half of the record and "
        f"{asked.text(high)} in the other at one place; cut off what lies before and after the "
        "Tacton."
    ]
