"""Inspection of a measurement in words, in a table and as JSON."""

from typing import Any

import numpy as np

from skinwave.measure.inspection import Inspection
from skinwave.measure.measurement import Measurement
from skinwave.system.numbers import significant

SUREST = 1e-12  # a probability below it is not told from 0
HEADER = ("line, Hz", "standard error, Hz", "largest amplitude", "at x, y (mm)", "false alarm",
          "what")  # fmt: skip
COLUMNS = ("frequency_hz", "frequency_error_hz", "place", "x_mm", "y_mm", "amplitude", "unit",
           "false_alarm", "what")  # fmt: skip
MOST_NAMED = 5


def sentences(found: Inspection) -> list[str]:
    """Sentences on what was measured, on noise and clipping."""
    return [_what(found.measured), *_noise(found), _clipping(found), *_constant(found)]


def _what(measured: Measurement) -> str:
    count, runs = len(measured.places), len(measured.values)
    said = f"{measured.record.name.capitalize()} at {count} place{'s' * (count > 1)}"
    said += f", {runs} repetition{'s' * (runs > 1)}"
    axis = measured.axis
    if measured.is_spectrum:
        step = np.diff(axis)
        even = len(step) and np.ptp(step) < 1e-3 * step.mean()
        apart = f" in steps of {significant(step.mean())} Hz" if even else ""
        return f"{said}: {len(axis)} complex amplitudes, {axis[0]:g} to {axis[-1]:g} Hz{apart}."
    lasts = len(axis) / measured.rate if len(axis) > 1 else 0.0
    return (
        f"{said}: {len(axis):,} samples at {measured.rate:,.6g} Hz, "
        f"{significant(lasts)} s, so that lines {significant(1 / lasts) if lasts else '-'} Hz "
        "apart are resolved."
    )


def _noise(found: Inspection) -> list[str]:
    noise = found.noise[np.isfinite(found.noise)]
    if not len(noise):
        return ["Too short or too sparse for a noise floor and for lines."]
    per = found.measured.record.per_unit
    low, high = (significant(per * x) for x in (noise.min(), noise.max()))
    unit = found.measured.record.shown + ("" if found.measured.is_spectrum else "/√Hz")
    said = f"Noise floor {low} {unit}" if low == high else f"Noise floor {low} to {high} {unit}"
    return [f"{said}, the median over frequency without the lines."]


def _clipping(found: Inspection) -> str:
    where = np.flatnonzero(found.clipped.sum(axis=0))
    if found.measured.is_spectrum:
        return "Clipping cannot be seen in spectra."
    if not len(where):
        return "No clipping: no runs of samples at the same extreme."
    count, places = int(found.clipped.sum()), places_words(found.measured, where)
    return f"Clipped: {count:,} samples in runs at the same extreme, at {places}."


def _constant(found: Inspection) -> list[str]:
    if not len(found.constant) or len(found.measured.axis) == 1:
        return []
    names = ", ".join(place_words(found.measured, int(p)) for p in found.constant[:MOST_NAMED])
    return [f"Nothing varies at {len(found.constant)} of the places: {names}."]


def places_words(measured: Measurement, places: np.ndarray) -> str:
    """The first of some places, by their numbers."""
    names = ", ".join(place_words(measured, int(p)) for p in places[:MOST_NAMED])
    return names + f" and {len(places) - MOST_NAMED} more" * (len(places) > MOST_NAMED)


def place_words(measured: Measurement, place: int) -> str:
    """A place: (5, 0) mm, or its number, from 1, where it is not known."""
    x, y = 1e3 * measured.places[place]
    known = np.isfinite([x, y]).all()
    return f"({x:.4g}, {y:.4g}) mm" if known else f"place {place + 1}"


def line_table(found: Inspection) -> list[list[str]]:
    """Rows below `HEADER`, a line each."""
    record = found.measured.record
    rows = []
    for line, origin in zip(found.lines, found.origins, strict=True):
        k = int(line.amplitudes.argmax())
        digits = max(0, int(np.ceil(-np.log10(max(line.error, 1e-9)))) + 1)
        rows.append([
            f"{line.frequency:.{min(digits, 6)}f}", significant(line.error, 2),
            f"{significant(record.per_unit * line.amplitudes[k])} {record.shown}",
            place_words(found.measured, int(found.kept[k])).removesuffix(" mm"),
            chance(line.false_alarm), origin,
        ])  # fmt: skip
    return rows


def chance(probability: float) -> str:
    """A probability of a false alarm."""
    return f"< {SUREST:g}" if probability < SUREST else f"{probability:.1g}"


def line_rows(found: Inspection) -> list[list[object]]:
    """Rows below `COLUMNS`, a line and place each."""
    record, places = found.measured.record, found.measured.places
    return [
        [
            f"{line.frequency:.9g}", f"{line.error:.3g}", int(p) + 1,
            *("" if np.isnan(v) else f"{1e3 * v:.6g}" for v in places[p]),
            f"{record.per_unit * line.amplitudes[k]:.6g}", record.shown,
            f"{line.false_alarm:.2g}", origin,
        ]
        for line, origin in zip(found.lines, found.origins, strict=True)
        for k, p in enumerate(found.kept)
    ]  # fmt: skip


def text(found: Inspection) -> str:
    """All of it, for a terminal."""
    said = [f"{found.measured.source}: {_what(found.measured)}", *sentences(found)[1:]]
    if rows := line_table(found):
        table = [list(HEADER), *rows]
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        padded = [map(str.ljust, row, widths) for row in table]
        said += ["", *("  ".join(row).rstrip() for row in padded), ""]
    elif found.spectrum is not None:
        said.append("No line rises above the noise floor.")
    return "\n".join([*said, *(f"note: {sentence}" for sentence in found.missing)])


def summary(found: Inspection) -> dict[str, Any]:
    """All of it in SI, for JSON."""
    measured = found.measured
    finite = [None if np.isnan(x) else float(x) for x in found.noise]
    return {
        "name": measured.name, "source": measured.source, "quantity": measured.quantity,
        "unit": measured.record.unit, "repetitions": len(measured.values),
        "places_m": [[None if np.isnan(v) else float(v) for v in xy] for xy in measured.places],
        "samples": len(measured.axis), "is_spectrum": measured.is_spectrum,
        "rate_hz": None if np.isnan(measured.rate) else measured.rate,
        "has_drive": len(measured.drive) > 0,
        "lines": [
            {
                "frequency_hz": line.frequency, "frequency_error_hz": line.error,
                "false_alarm": line.false_alarm, "what": origin,
                "amplitudes": line.amplitudes.tolist(),
            }
            for line, origin in zip(found.lines, found.origins, strict=True)
        ],
        "looked_at": [int(p) + 1 for p in found.kept], "noise_floor": finite,
        "clipped_samples": found.clipped.tolist(),
        "constant_places": [int(p) + 1 for p in found.constant],
        "missing": list(found.missing),
    }  # fmt: skip
