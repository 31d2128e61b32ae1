"""Files of a run."""

import json
import os
import re
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from simple_model import Response
from simple_model.quantities import DISPLACEMENT, VELOCITY
from skinwave.results import outputs, record
from skinwave.results.run import Run
from skinwave.scene.file import dumps
from skinwave.system.table import Table

DEPTH_COLUMN = "probe_depth_mm"  # only if a probe lies below the surface


def folder_name(name: str) -> str:
    """Return a scene's name as a folder or file name that is valid on all systems."""
    longest_name, most_bytes = 80, 200  # an ending then fits into 255 bytes
    plain = re.sub(r"[^\w +=,()-]", "_", name).strip()[:longest_name]
    plain = plain.encode()[:most_bytes].decode(errors="ignore").strip()
    reserved = ("pictures", "propagation", "sensation")  # names of files and folders of pages
    devices = r"con|prn|aux|nul|(com|lpt)[\d¹²³]"  # on Windows
    is_reserved = plain.casefold() in ("", *reserved) or re.fullmatch(devices, plain.casefold())
    return f"scene_{plain}" if is_reserved else plain


def distinct_names(names: Iterable[str]) -> list[str]:
    """Return the `folder_name` of each name, distinct even on systems that ignore case."""
    distinct: dict[str, str] = {}
    for name in map(folder_name, names):
        other, k = name, 1
        while other.casefold() in distinct:
            k += 1
            other = f"{name}_{k}"
        distinct[other.casefold()] = other
    return [*distinct.values()]


def write_run(folder: Path, run: Run, *, also: Callable[[Path], object] | None = None) -> None:
    """Write the folder of one run, or nothing if that fails; `also` writes more files into it."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    partial = outputs.temporary_path(folder, "partial")
    partial.mkdir()
    try:
        fill(partial, run)
        if also:
            also(partial)
        os.replace(partial, folder)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise


def fill(folder: Path, run: Run) -> None:
    """Write scene.toml, responses.npz, lines.csv, effort.json and record.json of one run."""
    name = run.response.quantity if run.response.record.of_body else DISPLACEMENT.name
    write_responses(folder / record.RESPONSES, dict.fromkeys((name, run.model), run.response))
    write_lines(folder / "lines.csv", [run])
    effort = asdict(run.response.effort)
    del effort["errors"]  # in record.json
    (folder / "effort.json").write_text(json.dumps(effort, indent=1), encoding="utf-8")
    (folder / "scene.toml").write_text(dumps(run.scene), encoding="utf-8")
    options = {"tacton": run.tacton, "body": run.body, "model": run.model}
    command = {"typed": "", "name": "simulate", "options": options}
    record.write(folder, command, scene=run.scene, response=run.response)


def write_responses(path: Path, responses: Mapping[str, Response]) -> None:
    """Write times `t` in s, `probes` in m and, by name, values (t, p) in SI units."""
    first = next(iter(responses.values()))
    arrays: dict[str, Any] = {"t": first.times, "probes": first.probes}
    arrays |= {name: response.values for name, response in responses.items()}
    with open(path, "wb") as file:
        np.savez(file, **arrays)


def write_lines(path: Path, runs: Iterable[Run]) -> None:
    """Write a CSV file with the amplitude of every line for each Tacton, body, model and probe."""
    runs = list(runs)
    depth = [DEPTH_COLUMN] * any(not run.scene.reading.is_on_surface for run in runs)
    quantities = dict.fromkeys(run.response.record.column for run in runs)
    # Columns of lines.csv; those of other quantities follow.
    place_columns = ("tacton", "body", "model", "probe_x_mm", "probe_y_mm")
    amplitude_columns = ("line", "frequency_hz", "displacement_um", "velocity_mm_s", "pressure_pa")
    columns = dict.fromkeys([*place_columns, *depth, *amplitude_columns, *quantities])
    rows = ([row.get(name) for name in columns] for run in runs for row in line_rows(run))
    path.write_bytes(Table(columns, rows).to_csv())


def line_rows(run: Run) -> Iterator[dict[str, Any]]:
    """Yield rows of lines.csv by column. A peak that is not a line of the load has the name of its
    kind, such as "free vibration".
    """
    quantity = run.response.record
    lines = [(name, f, run.table.amplitudes[name]) for name, f in run.line_hz.items()]
    lines += [(peak.kind, peak.frequency, peak.amplitudes) for peak in run.unnamed]
    # The point kernel's pressure is always on the surface.
    depths = run.scene.depths if quantity.of_body else [0.0] * len(run.scene.depths)
    for name, frequency, amplitudes in lines:
        for (x, y), z, amplitude in zip(run.response.probes, depths, amplitudes, strict=True):
            row = {
                "tacton": run.tacton, "body": run.body, "model": run.model, "line": name,
                "probe_x_mm": 1e3 * x, "probe_y_mm": 1e3 * y, DEPTH_COLUMN: 1e3 * z,
                "frequency_hz": frequency, quantity.column: quantity.per_unit * amplitude,
            }  # fmt: skip
            if quantity is DISPLACEMENT:
                rate = VELOCITY.per_unit * 2 * np.pi * frequency
                row[VELOCITY.column] = rate * amplitude
            yield row
