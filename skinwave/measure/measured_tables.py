"""Tables of models beside a measurement, on its page and as files."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from skinwave.measure.coherence import floor, over_places
from skinwave.measure.measured_claims import FAILS, HOLDS
from skinwave.measure.measured_study import UNKNOWN, Column, MeasuredComparison, main_column
from skinwave.measure.significance import ellipses
from skinwave.report.palette import label
from skinwave.results.claims import TEXTS
from skinwave.system.document import Markup, paragraph, table
from skinwave.system.numbers import significant
from skinwave.system.plain_text import csv_table

MOST_ROWS = 30  # of differences on the page; all are in measured.csv
MOST_COHERENT = 12  # lines, the strongest


def columns_table(found: MeasuredComparison) -> Markup:
    """Misfit, gain and delay of each model."""
    rows = []
    for column in found.columns:
        a, known = column.alignment, np.isfinite(column.significance)
        beyond = f"{column.differs.sum()} of {known.sum()}" if known.any() else UNKNOWN
        rows.append([
            label(column.run.column), significant(100 * column.misfit, 3),
            significant(100 * found.noise, 2), beyond, _gain(found, column),
            _with_error(1e3 * a.delay, 1e3 * a.delay_error),
            "-" if not np.isfinite(a.repeats) else significant(1e3 * a.repeats, 3),
        ])  # fmt: skip
    header = ["model", "misfit, %", "of noise alone, %", "differences beyond the noise"]
    header += ["gain", "delay of the record, ms", "delays so far off fit as well, ms"]
    return table(header, rows)


def _gain(found: MeasuredComparison, column: Column) -> str:
    a, asked, own = column.alignment, found.measurement.record, column.run.response.record
    if own == asked:
        return _with_error(a.gain, a.gain_error)
    said = _with_error(asked.per_unit * a.gain, asked.per_unit * a.gain_error)
    return f"{said} {asked.shown} per {own.shown}"


def _with_error(value: float, error: float) -> str:
    """A value and its standard error to two digits, and the value to as many places."""
    if not error:
        return f"{significant(value, 4)} (given)"
    if not np.isfinite(error):
        return f"{significant(value, 3)} (error unknown)"
    places = max(1 - int(np.floor(np.log10(error))), 0)
    return f"{value:.{places}f} ± {error:.{places}f}"


def differences_table(found: MeasuredComparison, column: Column) -> Markup:
    """The largest differences of a model, of amplitude and phase together."""
    away = np.abs(found.lines.mean - column.model)
    names, asked, findings = list(found.names), found.measurement.record, found.findings(column)
    rows: list[list[str]] = []
    for index in np.argsort(-away, axis=None, kind="stable")[:MOST_ROWS]:
        k, p = (int(i) for i in np.unravel_index(int(index), away.shape))
        z, m = complex(found.lines.mean[k, p]), complex(column.model[k, p])
        x, y = 1e3 * found.scene.probe_points[p]
        turn, error = np.degrees([np.angle(m * z.conjugate()), found.lines.phase_error[k, p]])
        spread = float(found.lines.amplitude_error[k, p]) or np.inf
        rows.append([
            names[k], f"{found.lines.frequencies[k]:.1f}", f"{x:.3g}, {y:.3g}",
            _with_error(asked.per_unit * abs(z), asked.per_unit * spread),
            significant(asked.per_unit * abs(m)),
            significant(asked.per_unit * float(away[k, p])), f"{turn:+.0f} ± {error:.2g}",
            _chance(float(column.significance[k, p])), str(findings[k, p]),
        ])  # fmt: skip
    unit = asked.shown
    header = ["line", "frequency, Hz", "place, mm", f"measured, {unit}", f"model, {unit}"]
    header += [f"complex difference, {unit}", "model's phase off by, degrees", "p, adjusted"]
    return table([*header, "difference is"], rows)


def _chance(p: float) -> str:
    return "-" if not np.isfinite(p) else f"{p:.1g}" if p >= 1e-6 else "< 1e-6"


def claims_table(found: MeasuredComparison) -> Markup:
    """Claims that are about such a Tacton, and what the measurement says of them."""
    if not found.claims:
        return paragraph(
            "The claims are about one focus that is modulated by one tone at most, moves along a "
            "closed path or both; this Tacton is another."
        )
    classes = {HOLDS: "yes", FAILS: "no"}
    rows = [
        [f"{one.claim}: {TEXTS[one.claim]}",
         Markup('<span class="{}">{}</span>').format(classes.get(one.finding, ""), one.finding),
         one.sentence]
        for one in found.claims
    ]  # fmt: skip
    said = (
        "From the data alone. A claim holds, or fails, where every set of amplitudes within the "
        "noise says so (95 % for all together)."
    )
    return paragraph(said) + table(["claim", "in the data it", "by"], rows)


def coherence_parts(found: MeasuredComparison) -> list[str]:
    """Coherence of each line over time, repetitions and places, and what chance would leave."""
    c, main = found.coherence, main_column(found)
    places = over_places(found.lines.mean, main.model)
    strongest = np.argsort(-np.abs(found.lines.mean).max(axis=1), kind="stable")[:MOST_COHERENT]
    names = list(found.names)
    rows = [
        [names[k], f"{found.lines.frequencies[k]:.1f}", _median(c.over_time[k]),
         _median(c.over_repetitions[k]), significant(float(places[k]), 3)]
        for k in np.sort(strongest)
    ]  # fmt: skip
    header = ["line", "frequency, Hz", "data and model over time, median of the places"]
    header += ["between repetitions, median"]
    header += [f"pattern over the places, data and {label(main.run.column)}"]
    said = []
    for what, k in (("time", c.segments), ("repetitions", c.repetitions)):
        if k > 1:
            said.append(
                f"over {what}, of {k} values, no coherence at all leaves {significant(1 / k, 2)} "
                f"on average and 95 % of the time less than {significant(floor(k), 2)}"
            )
    about = "Magnitude squared; the first two ask only whether a line keeps its phase"
    return [paragraph("; ".join([about, *said]) + "."), table(header, rows)]


def _median(values: np.ndarray) -> str:
    known = values[np.isfinite(values)]
    return significant(float(np.median(known)), 3) if len(known) else "-"


def write_tables(folder: Path, found: MeasuredComparison) -> None:
    """measured.csv, a row for each line, place and model, and measured-claims.csv."""
    asked = found.measurement.record.column
    header = [
        "line", "frequency_hz", "place", "x_mm", "y_mm", f"measured_{asked}",
        f"measured_{asked}_error", "measured_phase_rad", "measured_phase_rad_error",
        f"ellipse_major_{asked}", f"ellipse_minor_{asked}", "ellipse_angle_rad",
        "coherence_over_time", "coherence_over_repetitions", "model", f"model_{asked}",
        "model_phase_rad", f"difference_{asked}", "p_adjusted", "finding",
    ]  # fmt: skip
    (folder / "measured.csv").write_bytes(csv_table(header, _rows(found)))
    claims = ([c.claim, c.finding, c.sentence] for c in found.claims)
    header = ["claim", "finding", "sentence"]
    (folder / "measured-claims.csv").write_bytes(csv_table(header, claims))


def _rows(found: MeasuredComparison) -> Iterator[list[object]]:
    lines, unit = found.lines, found.measurement.record.per_unit
    major, minor, angle = ellipses(lines)
    every = [(c, found.findings(c)) for c in found.columns]
    for k, name in enumerate(found.names):
        for p, (x, y) in enumerate(found.scene.probe_points):
            z = lines.mean[k, p]
            of_data = (
                unit * abs(z), unit * lines.amplitude_error[k, p], np.angle(z),
                lines.phase_error[k, p], unit * major[k, p], unit * minor[k, p], angle[k, p],
                found.coherence.over_time[k, p], found.coherence.over_repetitions[k, p],
            )  # fmt: skip
            for column, findings in every:
                m = column.model[k, p]
                of_model = unit * abs(m), np.angle(m), unit * abs(z - m), column.significance[k, p]
                yield [
                    name, _short(lines.frequencies[k]), p + 1, _short(1e3 * x), _short(1e3 * y),
                    *map(_short, of_data), column.run.column, *map(_short, of_model),
                    findings[k, p],
                ]  # fmt: skip


def _short(value: float) -> str:
    return f"{value:.6g}" if np.isfinite(value) else ""
