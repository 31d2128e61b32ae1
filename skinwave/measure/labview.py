"""LabVIEW measurement files (.lvm) by lvm-read, and TDMS files by npTDMS."""

import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from meshes import reading
from skinwave.measure.recording import Given, Recording, factors_in
from skinwave.measure.table import choose_columns, recording_of
from skinwave.system.formats import MEASUREMENTS, register
from skinwave.system.headings import Column, parse_heading
from skinwave.system.text_table import Table


def read_lvm(text: str, given: Given) -> Recording:
    """Return the recording in the text of a LabVIEW measurement file with one segment."""
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
    axis = (segment.get("X_Dimension") or ["Time"])[0].strip() or "Time"
    at = {"No": (), "Multi": range(0, len(names) - 1, 2)}.get(x_columns, (0,))  # columns of times
    units = [*units[::2], ""] if x_columns == "Multi" else [*units, *[""] * len(names)]
    of_motion = iter(units)
    axis_units = {"Time": "s", "Frequency": "Hz"}
    headings = [f"{axis} [{axis_units.get(axis, axis)}]" if k in at
                else f"{name} [{next(of_motion, '')}]" for k, name in enumerate(names)]  # fmt: skip
    columns = tuple(parse_heading(heading.removesuffix(" []")) for heading in headings)
    if x_columns != "No":
        return recording_of(Table(columns=columns, numbers=numbers), given)
    clocks = map(_clock, segment["Delta_X"], segment["X0"])
    return _simultaneous([*zip(columns, numbers.T, clocks, [{}] * len(names), strict=False)], given)


Channel = tuple[Column, np.ndarray, tuple[str, ...], Mapping[str, Any]]


def _clock(step: float, start: float, begun: object = "") -> tuple[str, ...]:
    """Return step and start in s, and a date, without round-off; nothing without a step."""
    return (f"{step:.12g}", f"{start:.12g}", str(begun)) if step else ()


def _simultaneous(channels: list[Channel], given: Given) -> Recording:
    """Return the recording in channels: column, numbers, clock, and properties.

    Channels whose step, start or length differ from those of the chosen ones are left out.
    """
    chosen = choose_columns([column for column, *_ in channels], given.columns)
    clocks = [clock for _, _, clock, _ in channels]
    of_motion = chosen or range(len(channels))
    lengths = {len(channels[k][1]) for k in of_motion}
    wanted = {clocks[k] for k in of_motion} - {()}
    if len(lengths) > 1 or len(wanted) > 1:
        each = ", ".join(f"{column.text[:20]} {len(x):,}" for column, x, *_ in channels)
        problem = f"channels differ in length, step or start ({each[:120]})"
        raise ValueError(f"{problem}; choose simultaneous ones with --columns")
    kept = [k for k, clock in enumerate(clocks) if len(channels[k][1]) in lengths
            and (not clock or not wanted or clock in wanted)]  # fmt: skip
    columns, series, *_ = zip(*(channels[k] for k in kept), strict=True)
    clock = next(iter(wanted or {clocks[k] for k in kept}), ())
    notes = [*zip(("dt", "x0"), clock, strict=False)]
    notes += [(f"{name} of {channels[k][0].text}", repr(value)) for k in of_motion
              for name, value in factors_in(channels[k][3]).items()]  # fmt: skip
    numbers = np.column_stack(series).astype(float)
    table = Table(columns=columns, numbers=numbers, notes=tuple(notes))
    numbers_of = tuple(str(1 + kept.index(k)) for k in chosen)
    return recording_of(table, replace(given, columns=numbers_of))


def read_tdms(path: Path, given: Given) -> Recording:
    """Return the recording in a TDMS file, of channels with the same start, step and length."""
    try:
        from nptdms import TdmsFile
    except ImportError:
        cure = 'pip install "skinwave[measure]", or export .lvm or .csv'
        raise ValueError(f"TDMS files need npTDMS; {cure}") from None
    largest = 1_000_000_000  # bytes
    with reading.open_regular(path, largest):
        pass
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            file = TdmsFile.read(path)
            channels = [one for group in file.groups() for one in group.channels()]
            data = [np.asarray(channel[:]) for channel in channels]
    except Exception:  # whatever the library raises for damaged bytes
        raise ValueError("the file is damaged or not a TDMS file; export it again") from None
    names = [channel.name for channel in channels]
    signals: list[Channel] = []
    for channel, values in zip(channels, data, strict=True):
        if values.dtype.kind not in "fiuM" or values.size < 2:
            continue
        own, name = channel.properties, channel.name
        unit = str(own.get("unit_string", "")).strip()
        if values.dtype.kind == "M":
            values, unit = (values - values[0]) / np.timedelta64(1, "s"), "s"
        name = f"{channel.group_name}/{name}" if names.count(name) > 1 else name
        column = parse_heading(f"{name} [{unit}]" if unit else name)
        clock = _clock(own.get("wf_increment", 0), own.get("wf_start_offset", 0),
                       own.get("wf_start_time", ""))  # fmt: skip
        above = {**file.properties, **file[channel.group_name].properties, **own}
        given_by = {key: x for key, x in above.items() if not key.startswith("NI_")}
        signals.append((column, values, clock, given_by))
    if not signals:
        raise ValueError("no channel of the TDMS file has numbers; save the signals as numbers")
    return _simultaneous(signals, given)


register(MEASUREMENTS, ".tdms", function=read_tdms, name="TDMS", choices=("columns",))
