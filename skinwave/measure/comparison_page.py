"""Page section and tables of models compared with a measurement."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from simple_model.numbers import (
    as_sentence,
    first_few,
    percent,
    plural,
    share_of,
    significant,
    stated_error,
    with_error,
)
from skinwave.measure.alignment import opposite_sign
from skinwave.measure.claims import FAILS, HOLDS
from skinwave.measure.comparison import UNKNOWN, MeasuredComparison, ModelColumn, overlap
from skinwave.measure.inspection import flaws, unsteady
from skinwave.measure.misfit import LARGEST_MISFIT, NOT_DESCRIBED
from skinwave.report.palette import label
from skinwave.report.spectra import MOST_LINES, lines_figure
from skinwave.results.claims import CLAIMS
from skinwave.system.document import Details, Part, Picture, Section
from skinwave.system.table import Column, Table


def page_section(
    comparison: MeasuredComparison, picture: Callable[[str, Figure, str], Picture]
) -> Section:
    """Return the section; `picture(name, figure, caption)` returns a part of a page."""
    lines, main, at = comparison.lines, comparison.main, comparison.figure_places
    columns = {c.run.column: c for c in comparison.columns}
    figure = lines_figure(
        dict(zip(comparison.names, lines.frequencies.tolist(), strict=True)),
        comparison.scene.probe_points[at], lines.mean[:, at], lines.amplitude_error[:, at],
        {name: c.model[:, at] for name, c in columns.items()},
        {name: c.differs[:, at] for name, c in columns.items()}, comparison.measurement.record,
    )  # fmt: skip
    largest = np.argsort(-np.abs(lines.mean - main.model), axis=None, kind="stable")
    rows, unit = list(_rows(comparison, main)), comparison.measurement.record.column
    differences = Table(_columns(comparison), [rows[k] for k in largest]).only(
        "line", "frequency_hz", "x_mm", "y_mm", f"measured_{unit}", f"measured_{unit}_error",
        f"model_{unit}", f"difference_{unit}", "phase_off_deg", "p_adjusted", "finding",
        most=30,
    )  # fmt: skip
    no_claims = (
        "The claims concern a single focus that is modulated by at most one tone, moves along a "
        "closed path, or both. This Tacton is different."
    )
    about_claims = (
        "From the data alone. A claim holds, or fails, if every set of amplitudes within the noise "
        "says so (95 % for all together)."
    )
    claims: list[Part] = (
        [about_claims, claims_table(comparison)] if comparison.claims else [no_claims]
    )
    caption = (
        f"The {MOST_LINES} strongest lines. Models have the fitted, or given, delay and gain. "
        "Filled markers: the difference in amplitude and phase is beyond the noise."
    )
    method = (
        "Lines are fitted to each repetition by least squares. Gain and delay of each model "
        "follow from all lines and places, weighted by noise. Their standard errors contain "
        f"noise and a misfit beyond it; with a misfit above {percent(LARGEST_MISFIT)} there are "
        "none. A difference is beyond the noise if its p-value, adjusted for the number of lines "
        f"and places (Holm), is below {100 * main.significance:g} % (Victor & Mast 1991). The "
        "point kernels are pressures, and their gain has that unit."
    )
    return Section("Comparison with the measurement", [
        *(conclusion(comparison, column) for column in comparison.bodies),
        *remarks(comparison),
        picture("measured", figure, caption),
        columns_table(comparison),
        method,
        Details(f"Largest differences of the {label(main.run.column)}, line by line",
                [differences]),
        Section("Claims of the paper, assessed on the measurement", claims, 3),
    ])  # fmt: skip


def write_tables(folder: Path, comparison: MeasuredComparison) -> None:
    """Write measured.csv, with a row per line, place and model, and measured-claims.csv."""
    rows = (row for column in comparison.columns for row in _rows(comparison, column))
    (folder / "measured.csv").write_bytes(Table(_columns(comparison), rows).to_csv())
    claims = ((c.claim, c.finding, c.sentence) for c in comparison.claims)
    table = Table(("claim", "finding", "sentence"), claims)
    (folder / "measured-claims.csv").write_bytes(table.to_csv())


def columns_table(comparison: MeasuredComparison) -> Table:
    """Return misfit, gain and delay of each model."""
    rows, measured = [], comparison.measurement.record
    for column in comparison.columns:
        a, own = column.alignment, column.run.response.record
        known = np.isfinite(column.p_values).sum()
        per = 1.0 if own == measured else measured.per_unit
        unit = "" if own == measured else f" {measured.shown} per {own.shown}"
        rows.append((
            label(column.run.column), 100 * a.misfit, 100 * comparison.noise,
            f"{column.differs.sum()} of {known}" if known else UNKNOWN,
            _fit_parts(per * a.gain, per * a.gain_error) + unit,
            _fit_parts(1e3 * a.delay, 1e3 * a.delay_error), 1e3 * a.repeats,
        ))  # fmt: skip
    return Table((
        "model", Column("misfit", unit="%"), Column("misfit of noise alone", unit="%", digits=2),
        "differences beyond the noise", "gain", Column("delay of the record", unit="ms"),
        Column("delay repeats every", unit="ms"),
    ), rows)  # fmt: skip


def _fit_parts(value: float, error: float) -> str:
    return with_error(value, error) if error else f"{significant(value, 4)} (given)"


def _columns(comparison: MeasuredComparison) -> list[Column]:
    """Return the columns of measured.csv."""
    unit, name = comparison.measurement.record.shown, comparison.measurement.record.column
    return [
        Column("line"), Column("frequency_hz", "frequency", "Hz", 4), Column("place"),
        Column("x_mm", "x", "mm"), Column("y_mm", "y", "mm"),
        Column(f"measured_{name}", "measured", unit),
        Column(f"measured_{name}_error", "standard error", unit, 2),
        Column("measured_phase_rad"), Column("measured_phase_rad_error"),
        Column("model"),
        Column(f"model_{name}", "model", unit), Column("model_phase_rad"),
        Column("phase_off_deg", "phase of the model minus measured", "°", 2),
        Column(f"difference_{name}", "complex difference", unit),
        Column("p_adjusted", "p, adjusted", digits=1), Column("finding", "difference is"),
    ]  # fmt: skip


def _rows(comparison: MeasuredComparison, column: ModelColumn) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of a model, one per line and place."""
    lines, unit = comparison.lines, comparison.measurement.record.per_unit
    findings = comparison.findings(column)
    for k, name in enumerate(comparison.names):
        for p, (x, y) in enumerate(comparison.scene.probe_points):
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
                float(column.p_values[k, p]), str(findings[k, p]),
            )  # fmt: skip


def claims_table(comparison: MeasuredComparison) -> Table:
    """Return the claims that concern the Tacton, with their findings in the measurement."""
    classes = {HOLDS: "yes", FAILS: "no"}
    rows = [
        (f"{one.claim}: {CLAIMS[one.claim].text}",
         Markup('<span class="{}">{}</span>').format(classes.get(one.finding, ""), one.finding),
         one.sentence)
        for one in comparison.claims
    ]  # fmt: skip
    return Table(("claim", "in the data", "reason"), rows)


def conclusion(comparison: MeasuredComparison, column: ModelColumn) -> str:
    """Return whether a model agrees with the data, and whether gain and delay have errors."""
    if not column.alignment.is_described:
        errors = f" {as_sentence(NOT_DESCRIBED)[:-1]}, so gain and delay have no errors."
    elif column.alignment.unexplained:
        errors = " The errors of gain and delay include the misfit."
    else:
        errors = ""
    return _agreement(comparison, column) + errors


def _agreement(comparison: MeasuredComparison, column: ModelColumn) -> str:
    name, differs, lines = label(column.run.column), column.differs, comparison.lines
    known = int(np.isfinite(column.p_values).sum())
    misfit = f"The misfit is {share_of(column.alignment.misfit, 'the measured lines')}"
    if not known:
        return (
            f"The noise of the data is unknown, so the agreement of the {name} cannot be tested. "
            f"{misfit}."
        )
    misfit += f"; noise alone leaves {percent(comparison.noise)}."
    if not differs.any():
        around = lines.radius(1 - column.significance / lines.variance.size)
        least = float(np.nanmedian(around) / np.abs(lines.mean).max())
        return (
            f"The {name} agrees with the data within the noise, for all {known} pairs of line and "
            f"place. {misfit} Differences below {percent(least)} of the strongest line cannot be "
            "detected."
        )
    few, many = int((differs & comparison.is_numerical(column)).sum()), int(differs.sum())
    error = stated_error(column.run.response.expected_error)
    numerical = f", {few} of them within the model's numerical error of {error}" if few else ""
    beyond = f"{many} of {known} differences are beyond the noise{numerical}"
    if few == many:
        return f"The {name} agrees with the data within its numerical error: {beyond}. {misfit}"
    return f"The {name} disagrees with the data: {beyond} ({_where(comparison, column)}). {misfit}"


def _where(comparison: MeasuredComparison, column: ModelColumn) -> str:
    """Return the lines whose differences are beyond the noise, the largest first."""
    beyond = column.differs & ~comparison.is_numerical(column)
    away = np.where(beyond, np.abs(comparison.lines.mean - column.model), 0).max(axis=1)
    lines = [k for k in np.argsort(-away, kind="stable") if beyond[k].any()]
    names, places = list(comparison.names), beyond.shape[1]
    return first_few([f"{names[k]} at {beyond[k].sum()} of {places} places" for k in lines])


def remarks(comparison: MeasuredComparison) -> list[str]:
    """Return sentences on the record: repetitions, unresolved lines, flaws and assumptions."""
    measurement, main, lines = comparison.measurement, comparison.main, comparison.lines
    sentences = [
        f"{measurement.name or 'The measurement'}: {measurement.record.words} at "
        f"{plural(len(measurement.places), 'place')}, {_repetitions(comparison)}"
    ]
    if main.may_be_flipped:
        name = label(main.run.column)
        sentences.append(as_sentence(opposite_sign(f"the {name}", has_delay=True)))
    sentences += _outside(comparison, main)
    if comparison.unresolved:
        unresolved = ", ".join(comparison.unresolved)
        sentences.append(f"Not compared, because record or model is too short: {unresolved}.")
    errors = np.zeros(len(lines.frequencies))
    least_change = 0.2  # of a line between the halves of the record, that is reported
    changes = unsteady(measurement, list(comparison.names), lines.frequencies, errors, least_change)
    more = (*changes, *flaws(measurement, comparison.scene.pressure), *measurement.remarks)
    return sentences + [as_sentence(sentence) for sentence in more]


def _repetitions(comparison: MeasuredComparison) -> str:
    """Return the number of repetitions, and the source of the noise estimate."""
    shifts = comparison.lines.shifts
    if len(shifts) > 1:
        aligned = f", aligned by up to {1e3 * np.ptp(shifts):.3g} ms" * bool(shifts.any())
        return f"{len(shifts)} repetitions{aligned}. Their spread is part of the noise."
    if np.isnan(comparison.lines.variance).all():
        return "one repetition. The noise is unknown."
    return "one repetition. The noise is the noise floor at each line."


def _outside(comparison: MeasuredComparison, column: ModelColumn) -> list[str]:
    """Return a sentence if much of the delayed record lies outside the Tacton."""
    if comparison.measurement.is_spectrum:
        return []
    delay, duration = column.alignment.delay, float(np.ptp(comparison.measurement.times))
    inside = overlap(comparison.measurement, column.run, delay)
    safe_overlap = 0.85  # of the shorter one of record and Tacton
    if inside > safe_overlap * min(duration, float(np.ptp(column.run.response.times))):
        return []
    return [
        f"At a delay of {1e3 * delay:.3g} ms, only {1e3 * max(inside, 0.0):.3g} of the "
        f"{1e3 * duration:.3g} ms of the record lie within the Tacton. The true delay may be "
        "another one: give --delay, or cut off what lies before and after."
    ]
