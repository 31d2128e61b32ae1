"""Labels of columns of tables, and their units."""

import re

UNITS = {  # by the end of a column's name
    "_m_per_s": "m/s", "_um": "µm", "_mm": "mm", "_db": "dB", "_hz": "Hz",
    "_pa": "Pa", "_ms": "ms", "_s": "s", "_percent": "%", "_deg": "°", "_gib": "GiB", "_cm2": "cm²",
    "_kg_m3": "kg/m³", "_pa_s": "Pa s", "seconds": "s", "_ratio": "µm/Pa, scaled",
}  # fmt: skip


def axis_label(column: str) -> str:
    """Return the label of an axis: the quantity of a column and its unit."""
    name, probe = at_probe(column)
    names = {
        "peak_um": "largest displacement", "rms_um": "RMS displacement about its mean",
        "level_db": "sensation level", "tacton.speed_m_per_s": "drawing speed",
        "tacton.am_frequency_hz": "AM frequency", "tacton.size_mm": "size of the path",
        "body.thickness_mm": "depth of the body", "spread_6db_mm": "spread to -6 dB",
        "spread_20db_mm": "spread to -20 dB", "kernel_misfit": "misfit to the point kernel",
        "kernel_delay_ms": "delay behind the point kernel",
        "expected_error": "expected error", "above_threshold_cm2": "area above threshold",
    }  # fmt: skip
    words = names.get(name)
    if words is None:
        words = name.split(".", 1)[-1] if re.match(r"[a-z]+\.[a-z]", name) else name
        words = words.removesuffix(_unit_end(name)).strip("_") or words
        words = words.replace("_kernel", " of the point kernel")
        words = re.sub(r"(?<![a-z])(\d*f)_(AM2?|[de])(?![A-Za-z])", r"$\1_{\2}$", words)
        words = re.sub(r"_(?!\{)", " ", words)
    where = "" if probe is None else f" at probe {probe}"
    return ", ".join(filter(None, (f"{words}{where}", column_unit(name))))


def column_unit(name: str) -> str:
    """Return the unit of a column, by the end of its name, or ""."""
    return UNITS.get(_unit_end(name), "")


def _unit_end(name: str) -> str:
    return max((end for end in UNITS if name.endswith(end)), key=len, default="")


def at_probe(column: str) -> tuple[str, int | None]:
    """Split a column such as "peak_um[2]" into its name and the index of the probe, or None."""
    match = re.fullmatch(r"(.+)\[(\d+)\]", column)
    return (match[1], int(match[2])) if match else (column, None)
