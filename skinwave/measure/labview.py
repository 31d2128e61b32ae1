"""LabVIEW measurement files (.lvm) by lvm-read, and TDMS files by npTDMS."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from meshes import reading
from skinwave.measure.headers import parse_heading
from skinwave.measure.recording import Given, Recording
from skinwave.measure.table import Table, recording_of
from skinwave.measure.units import canonical

LARGEST = 1_000_000_000  # bytes
AXIS_UNITS = {"Time": "s", "Frequency": "Hz"}


def lvm_table(text: str) -> Table:
    """Return the table in the text of a LabVIEW measurement file with one segment."""
    import lvm_read

    try:
        content = lvm_read.read_str(text.replace("\r\n", "\n"))
    except Exception:  # whatever the library raises for damaged text
        raise ValueError("the LabVIEW measurement file is damaged; export it again") from None
    if content["Segments"] > 1:
        raise ValueError(f"the file has {content['Segments']} segments; export one of them")
    segment, x_columns = content[0], content.get("X_Columns", "One")
    names, numbers = list(segment["Channel names"]), np.asarray(segment["data"], float)
    if names and names[-1] == "Comment":
        names, numbers = names[:-1], numbers[:, : len(names) - 1]
    units = [unit.strip() for unit in segment.get("Y_Unit_Label", [])]
    if x_columns == "Multi":
        pairs = range(0, len(names) - 1, 2)
        if any(not np.array_equal(numbers[:, k], numbers[:, 0]) for k in pairs):
            raise ValueError("channels differ in their times; export them with one X column")
        kept = [0, *(k + 1 for k in pairs)]
        names, numbers, units = [names[k] for k in kept], numbers[:, kept], units[::2]
    notes: tuple[tuple[str, str], ...] = ()
    headings = []
    if x_columns == "No":
        step, start = (_common(segment, key) for key in ("Delta_X", "X0"))
        notes = (("delta_x", repr(step)), ("x0", repr(start)))
    else:
        axis = (segment.get("X_Dimension") or ["Time"])[0].strip() or "Time"
        headings, names = [f"{axis} [{AXIS_UNITS.get(axis, axis)}]"], names[1:]
    for name, unit in zip(names, [*units, *[""] * len(names)], strict=False):
        headings.append(f"{name} [{unit}]" if unit else name)
    return Table(columns=tuple(map(parse_heading, headings)), numbers=numbers, notes=notes)


def _common(segment: dict[str, Any], key: str) -> float:
    """Return the number that all channels of a segment share."""
    values = np.asarray(segment[key], float)
    if not np.allclose(values[np.isfinite(values)], values[0], rtol=1e-9, atol=0):
        raise ValueError(f"channels differ in {key}; export one of them")
    return float(values[0])


def read_tdms(path: Path, given: Given) -> Recording:
    """Return the recording in a TDMS file whose channels share start, step and length."""
    try:
        from nptdms import TdmsFile
    except ImportError:
        raise ValueError(
            'TDMS files need npTDMS; pip install "skinwave[measure]", or export .lvm or .csv'
        ) from None
    with reading.open_regular(path, LARGEST):
        pass
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            channels = [one for group in TdmsFile.read(path).groups() for one in group.channels()]
            data = [np.asarray(channel[:]) for channel in channels]
    except Exception:  # whatever the library raises for damaged bytes
        raise ValueError("the file is damaged or not a TDMS file; export it again") from None
    signals = [
        (channel.name, channel.properties, values)
        for channel, values in zip(channels, data, strict=True)
        if values.dtype.kind in "fiuM" and values.size > 1
    ]
    if not signals:
        raise ValueError("no channel of the TDMS file has numbers; save the signals as numbers")
    if len({len(values) for _, _, values in signals}) > 1:
        counts = ", ".join(f"{name[:20]} {len(values):,}" for name, _, values in signals)
        raise ValueError(f"channels differ in length ({counts[:120]}); export those of one rate")
    columns, series, clocks = [], [], set()
    for name, properties, values in signals:
        unit = canonical(str(properties.get("unit_string", "")))
        if values.dtype.kind == "M":
            values, unit = (values - values[0]) / np.timedelta64(1, "s"), "s"
        columns.append(parse_heading(f"{name} [{unit}]" if unit else name))
        series.append(values)
        if step := float(properties.get("wf_increment", 0)):
            start = float(properties.get("wf_start_offset", 0))
            clocks.add((step, start, properties.get("wf_start_time")))
    if len(clocks) > 1:
        raise ValueError("channels differ in step or start; export simultaneous ones")
    notes = [(("dt", repr(step)), ("x0", repr(start))) for step, start, _ in clocks]
    numbers = np.column_stack(series).astype(float)
    table = Table(columns=tuple(columns), numbers=numbers, notes=notes[0] if notes else ())
    return recording_of(table, given)
