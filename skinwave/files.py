"""What a run leaves in its folder, written aside and then renamed."""

import csv
import json
import os
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, astuple, fields
from pathlib import Path
from typing import Any

import numpy as np

from simple_model import Effort
from skinwave.claims import Run, Verdict
from skinwave.scene_file import dumps

LINE_COLUMNS = (
    "tacton", "body", "model", "probe_x_mm", "probe_y_mm", "line",
    "frequency_hz", "displacement_um", "velocity_mm_s", "pressure_pa",
)  # fmt: skip


@contextmanager
def output_folder(out: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """A folder to write in, which becomes `out` when all is written.

    If writing ends early the folder stays beside `out` as `<out>.partial`, and what was there
    before is untouched.

    Raises
    ------
    ValueError
        If `out` exists and may not be overwritten, or cannot be written.
    """
    out = out.absolute()
    if out.exists() and not overwrite:
        raise ValueError(f"{out} exists and is kept; pass --overwrite or another --out")
    if out.exists() and not out.is_dir():
        raise ValueError(f"{out} is a file; choose a folder with --out")
    aside = out.with_name(out.name + ".partial")
    try:
        if aside.exists():
            shutil.rmtree(aside)
        aside.mkdir(parents=True)
    except OSError as error:
        raise ValueError(f"{out} cannot be written ({error.strerror}); choose --out") from None
    try:
        yield aside
    finally:
        if not any(aside.iterdir()):
            aside.rmdir()
    if out.exists():
        old = out.with_name(out.name + ".old")
        shutil.rmtree(old, ignore_errors=True)
        out.rename(old)
        aside.rename(out)
        shutil.rmtree(old)
    else:
        aside.rename(out)


def write_run(folder: Path, run: Run) -> None:
    """scene.toml, response.npz, lines.csv and effort.json of one run; all or nothing."""
    aside = folder.with_name(folder.name + ".part")
    aside.mkdir(parents=True)
    (aside / "scene.toml").write_text(dumps(run.scene), encoding="utf-8")
    write_responses(aside / "response.npz", {"displacement": run, run.model: run})
    write_lines(aside / "lines.csv", [run])
    write_effort(aside / "effort.json", run.response.effort)
    os.replace(aside, folder)


def write_responses(path: Path, runs: Mapping[str, Run]) -> None:
    """Times `t` in s, `probes` in m and, by name, displacement (t, p) in m or Pa."""
    first = next(iter(runs.values())).response
    arrays: dict[str, Any] = {"t": first.times, "probes": first.probes}
    arrays |= {name: run.response.displacement for name, run in runs.items()}
    with open(path, "wb") as file:
        np.savez(file, **arrays)


def write_lines(path: Path, runs: Iterable[Run]) -> None:
    """Every line's amplitude per Tacton, body, model and probe."""
    _write_csv(path, LINE_COLUMNS, (row for run in runs for row in line_rows(run)))


def line_rows(run: Run) -> Iterator[tuple[object, ...]]:
    """Rows of lines.csv; the point kernel has a pressure where bodies have a displacement."""
    for name, frequency in run.frequencies.items():
        for (x, y), amplitude in zip(run.response.probes, run.lines[name], strict=True):
            where = (run.tacton, run.body, run.model, _short(1e3 * x), _short(1e3 * y), name)
            if run.response.unit == "Pa":
                yield (*where, _short(frequency), "", "", _short(amplitude))
            else:
                velocity = 2 * np.pi * frequency * amplitude
                um, mm_s = _short(1e6 * amplitude), _short(1e3 * velocity)
                yield (*where, _short(frequency), um, mm_s, "")


def write_claims(path: Path, verdicts: Iterable[Verdict]) -> None:
    """Every statement's verdict per body and model."""
    rows = ((*astuple(v)[:4], _short(v.value), v.bar, v.sentence) for v in verdicts)
    _write_csv(path, [field.name for field in fields(Verdict)], rows)


def write_effort(path: Path, effort: Effort) -> None:
    """What an answer cost, as JSON."""
    path.write_text(json.dumps(asdict(effort), indent=1), encoding="utf-8")


def _write_csv(path: Path, columns: Iterable[str], rows: Iterable[tuple[object, ...]]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(rows)


def _short(value: float) -> str:
    return f"{value:.6g}"
