"""LabVIEW's files: measurement files (.lvm) by lvm-read, and TDMS by npTDMS."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from meshes import reading
from meshes.reading import read_exported_text
from skinwave.measure.headers import column
from skinwave.measure.recording import Given, Recording
from skinwave.measure.table import Table, recording
from skinwave.measure.units import plain

LARGEST = 1_000_000_000  # bytes
MISSING = 'TDMS files need npTDMS; pip install "skinwave[measure]", or export .lvm or .csv'


def read_lvm(path: Path, given: Given) -> Recording:
    """The recording in a LabVIEW measurement file of one segment."""
    return recording(lvm_table(read_exported_text(path, LARGEST)), given)


def lvm_table(text: str) -> Table:
    """The table in the text of a LabVIEW measurement file; raises what `read_lvm` does."""
    import lvm_read

    try:
        found = lvm_read.read_str(text.replace("\r\n", "\n"))
    except Exception:  # whatever is made of spoilt text
        raise ValueError(
            "the file is damaged or no LabVIEW measurement file; export it anew"
        ) from None
    if found["Segments"] > 1:
        raise ValueError(f"the file has {found['Segments']} segments; export one of them")
    return _of_segment(found[0], found.get("X_Columns", "One"))


def _of_segment(one: dict[str, Any], x_columns: str) -> Table:
    """Times, of the file or of its start and step, and the channels of a segment."""
    names, numbers = list(one["Channel names"]), np.asarray(one["data"], float)
    if names and names[-1] == "Comment":
        names, numbers = names[:-1], numbers[:, : len(names) - 1]
    if x_columns == "Multi":
        pairs = range(0, len(names) - 1, 2)
        if any(not np.array_equal(numbers[:, k], numbers[:, 0]) for k in pairs):
            raise ValueError("channels have times of their own; export them with one X column")
        kept = [0, *(k + 1 for k in pairs)]
        names, numbers = [names[k] for k in kept], numbers[:, kept]
    axis = (one.get("X_Dimension") or ["Time"])[0].strip() or "Time"
    x_unit = {"Time": "s", "Frequency": "Hz"}.get(axis, axis)
    units = [unit.strip() for unit in one.get("Y_Unit_Label", [])]
    units = units[::2] if x_columns == "Multi" else units
    notes: tuple[tuple[str, str], ...] = ()
    if x_columns == "No":
        step, start = (np.asarray(one[key], float) for key in ("Delta_X", "X0"))
        for said, values in (("steps", step), ("starts", start)):
            if not np.allclose(values[np.isfinite(values)], values[0], rtol=1e-9, atol=0):
                raise ValueError(f"channels have {said} in time of their own; export one of them")
        notes = (("delta_x", repr(float(step[0]))), ("x0", repr(float(start[0]))))
        heads: list[str] = []
    else:
        heads, names = [f"{axis} [{x_unit}]"], names[1:]
    heads += [f"{name} [{unit}]" if unit else name
              for name, unit in zip(names, [*units, *[""] * len(names)], strict=False)]  # fmt: skip
    return Table(columns=tuple(map(column, heads)), numbers=numbers, notes=notes)


def read_tdms(path: Path, given: Given) -> Recording:
    """The recording in a TDMS file, whose waveforms tell their start and step; raises a ValueError
    if channels have other ones, or other lengths.
    """
    try:
        from nptdms import TdmsFile
    except ImportError:
        raise ValueError(MISSING) from None
    with reading.open_regular(path, LARGEST):
        pass
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            channels = [one for group in TdmsFile.read(path).groups() for one in group.channels()]
            data = [np.asarray(one[:]) for one in channels]
    except Exception:  # whatever is made of spoilt bytes
        raise ValueError("the file is damaged or no TDMS file; export it anew") from None
    of = [k for k, one in enumerate(data) if one.dtype.kind in "fiuM" and one.size > 1]
    if not of:
        raise ValueError("no channel of the TDMS file has numbers; save the signals as such")
    if len({len(data[k]) for k in of}) > 1:
        counts = ", ".join(f"{channels[k].name[:20]} {len(data[k]):,}" for k in of)
        raise ValueError(f"channels have other numbers of samples, {counts[:120]}; export one rate")
    heads, notes = [], set()
    for k in of:
        said = channels[k].properties
        if data[k].dtype.kind == "M":
            data[k] = (data[k] - data[k][0]) / np.timedelta64(1, "s")
            said = said | {"unit_string": "s"}
        unit = plain(str(said.get("unit_string", "")))
        heads.append(column(f"{channels[k].name} [{unit}]" if unit else channels[k].name))
        if step := float(said.get("wf_increment", 0)):
            notes.add((step, float(said.get("wf_start_offset", 0)), said.get("wf_start_time")))
    if len(notes) > 1:
        raise ValueError(
            "channels differ in step or start and are not simultaneous; export those of one task"
        )
    axis = [(("dt", repr(step)), ("x0", repr(start))) for step, start, _ in notes]
    return recording(
        Table(columns=tuple(heads), numbers=np.column_stack([data[k] for k in of]).astype(float),
              notes=axis[0] if axis else ()), given,
    )  # fmt: skip
