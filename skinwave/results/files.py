"""Files of a run in its folder."""

import json
import os
import re
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from simple_model.quantities import DISPLACEMENT, VELOCITY
from skinwave.results import outputs, record
from skinwave.results.run import Run
from skinwave.scene.file import dumps
from skinwave.system.table import Table

# Columns of lines.csv, beside which stand those of other quantities that are there.
WHERE = ("tacton", "body", "model", "probe_x_mm", "probe_y_mm")
DEPTH = "probe_depth_mm"  # of probes below the surface, if there are any
AMPLITUDES = ("line", "frequency_hz", "displacement_um", "velocity_mm_s", "pressure_pa")
RESERVED = ("pictures", "propagation", "sensation")  # what pages name themselves
DEVICES = re.compile(r"con|prn|aux|nul|(com|lpt)[\d¹²³]", re.IGNORECASE)  # of Windows
LONGEST, MOST_BYTES = 80, 200  # of a name, which gets an ending and is limited to 255 bytes


def folder_name(name: str) -> str:
    """A scene's name as that of a folder or file on any system: within the folder above it, no
    device of Windows, without dots, and none that a study has, in capitals or not.
    """
    plain = re.sub(r"[^\w +=,()-]", "_", name).strip()[:LONGEST]
    plain = plain.encode()[:MOST_BYTES].decode(errors="ignore").strip()
    taken = plain.casefold() in ("", *RESERVED) or DEVICES.fullmatch(plain)
    return f"scene_{plain}" if taken else plain


def distinct_names(names: Iterable[str]) -> list[str]:
    """The `folder_name` of each, no two alike on a system for which capitals are small letters."""
    found: dict[str, str] = {}
    for name in map(folder_name, names):
        other, k = name, 1
        while other.casefold() in found:
            k += 1
            other = f"{name}_{k}"
        found[other.casefold()] = other
    return [*found.values()]


def write_run(folder: Path, run: Run, *, also: Callable[[Path], object] | None = None) -> None:
    """Write the folder of one run, all or nothing; `also` writes more into it."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    aside = outputs.beside(folder, "partial")
    aside.mkdir()
    try:
        fill(aside, run)
        if also:
            also(aside)
        os.replace(aside, folder)
    except BaseException:
        shutil.rmtree(aside, ignore_errors=True)
        raise


def fill(folder: Path, run: Run) -> None:
    """Write scene.toml, responses.npz, lines.csv, effort.json and record.json of one run."""
    name = run.response.quantity if run.response.record.of_body else DISPLACEMENT.name
    write_responses(folder / record.RESPONSES, {name: run, run.model: run})
    write_lines(folder / "lines.csv", [run])
    effort = json.dumps(asdict(run.response.effort), indent=1)
    (folder / "effort.json").write_text(effort, encoding="utf-8")
    (folder / "scene.toml").write_text(dumps(run.scene), encoding="utf-8")
    options = {"tacton": run.tacton, "body": run.body, "model": run.model}
    command = {"typed": "", "name": "simulate", "options": options}
    record.write(folder, command, scene=run.scene, response=run.response)


def write_responses(path: Path, runs: Mapping[str, Run]) -> None:
    """Times `t` in s, `probes` in m and, by name, values (t, p) in the unit of their quantity."""
    first = next(iter(runs.values())).response
    arrays: dict[str, Any] = {"t": first.times, "probes": first.probes}
    arrays |= {name: run.response.values for name, run in runs.items()}
    with open(path, "wb") as file:
        np.savez(file, **arrays)


def write_lines(path: Path, runs: Iterable[Run]) -> None:
    """Every line's amplitude per Tacton, body, model and probe, as CSV."""
    runs = list(runs)
    deep = [DEPTH] * any(not run.scene.reading.is_on_surface for run in runs)
    more = dict.fromkeys(run.response.record.column for run in runs)
    columns = dict.fromkeys([*WHERE, *deep, *AMPLITUDES, *more])
    rows = ([row.get(name) for name in columns] for run in runs for row in line_rows(run))
    path.write_bytes(Table(columns, rows).to_csv())


def line_rows(run: Run) -> Iterator[dict[str, Any]]:
    """Rows of lines.csv by column; the point kernel has a pressure where bodies have a
    displacement. Peaks that are no single line of the load have their kind for a name, such as
    "free vibration".
    """
    asked = run.response.record
    found = [(name, f, run.table.amplitudes[name]) for name, f in run.listed.items()]
    found += [(peak.kind, peak.frequency, peak.amplitudes) for peak in run.unnamed]
    # The point kernel's pressure is that on the surface, whatever is asked of bodies.
    depths = run.scene.depths if asked.of_body else [0.0] * len(run.scene.depths)
    for name, frequency, amplitudes in found:
        for (x, y), z, amplitude in zip(run.response.probes, depths, amplitudes, strict=True):
            row = {
                "tacton": run.tacton, "body": run.body, "model": run.model, "line": name,
                "probe_x_mm": 1e3 * x, "probe_y_mm": 1e3 * y, DEPTH: 1e3 * z,
                "frequency_hz": frequency, asked.column: asked.per_unit * amplitude,
            }  # fmt: skip
            if asked is DISPLACEMENT:
                rate = VELOCITY.per_unit * 2 * np.pi * frequency
                row[VELOCITY.column] = rate * amplitude
            yield row
