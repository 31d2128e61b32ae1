"""What a run leaves in its folder, written aside and then renamed."""

import contextlib
import csv
import json
import os
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, astuple, fields
from pathlib import Path
from typing import IO, Any

import numpy as np

from simple_model import Effort
from skinwave import record
from skinwave.plain_text import cell
from skinwave.run import Run
from skinwave.scene_file import dumps
from skinwave.studies.claims import Verdict

LINE_COLUMNS = (
    "tacton", "body", "model", "probe_x_mm", "probe_y_mm", "line",
    "frequency_hz", "displacement_um", "velocity_mm_s", "pressure_pa",
)  # fmt: skip
RESERVED = ("figures", "overview", "propagation")  # what a study names itself


@contextmanager
def output_folder(out: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """A folder to write in, which becomes `out` when all is written.

    Until then it is `<out>.partial`. An error removes it, with the folders above that were made
    for it, and leaves what was there before untouched; only an interrupt or a killed process
    leaves it behind, and the next one begins anew.

    Raises
    ------
    ValueError
        If `out` exists and may not be overwritten, or cannot be written.
    """
    out = Path(os.path.realpath(out))  # a link stays one, and points to what is written
    _refuse_existing(out, overwrite)
    aside = out.with_name(out.name + ".partial")
    above = [folder for folder in aside.parents if not os.path.exists(folder)]
    try:
        if aside.exists():
            shutil.rmtree(aside)
        aside.mkdir(parents=True)
        yield aside
        _put_in_place(aside, out)
    except Exception as error:
        _remove(aside, above)
        if isinstance(error, OSError) and error.strerror:
            raise ValueError(
                f"{out} cannot be written ({error.strerror}); make room there or choose --out"
            ) from error
        raise
    except KeyboardInterrupt:
        if not any(aside.iterdir()):
            _remove(aside, above)
        raise


@contextmanager
def output_file(out: Path, *, overwrite: bool = False) -> Iterator[IO[bytes]]:
    """A file to write to, which becomes `out` when all is written; an error leaves no trace.

    Raises
    ------
    ValueError
        If `out` exists and may not be overwritten, or cannot be written.
    """
    out = Path(os.path.realpath(out))
    if os.path.lexists(out) and (out.is_dir() or not overwrite):
        cure = (
            "is a folder; name a file" if out.is_dir() else "exists and is kept; pass --overwrite"
        )
        raise ValueError(f"{out} {cure} or choose another")
    aside = out.with_name(out.name + ".partial")
    try:
        with open(aside, "wb") as file:
            yield file
        os.replace(aside, out)
    except BaseException as error:
        with contextlib.suppress(OSError):
            aside.unlink()
        if isinstance(error, OSError) and error.strerror:
            raise ValueError(
                f"{out} cannot be written ({error.strerror}); make room there or choose another"
            ) from error
        raise


def _refuse_existing(out: Path, overwrite: bool) -> None:
    if Path.cwd().is_relative_to(out):
        raise ValueError(f"{out} holds the current folder; choose another --out")
    if os.path.lexists(out) and not overwrite:
        raise ValueError(f"{out} exists and is kept; pass --overwrite or another --out")
    if os.path.lexists(out) and not out.is_dir():
        raise ValueError(f"{out} is a file; choose a folder with --out")


def _put_in_place(aside: Path, out: Path) -> None:
    """Rename what is written; what it replaces is put back if that fails."""
    if not out.exists():
        aside.rename(out)
        return
    kept = Path(tempfile.mkdtemp(prefix=f"{out.name}.replaced-", dir=out.parent), out.name)
    try:
        out.rename(kept)
        aside.rename(out)
    except OSError:
        if kept.exists():
            kept.rename(out)
        kept.parent.rmdir()
        raise
    shutil.rmtree(kept.parent, ignore_errors=True)


def _remove(aside: Path, above: Iterable[Path]) -> None:
    """A folder, and those above it that are empty then."""
    shutil.rmtree(aside, ignore_errors=True)
    with contextlib.suppress(OSError):
        for folder in above:
            folder.rmdir()


def folder_name(name: str) -> str:
    """A scene's name as that of a folder: within the one above it, and none that a study has."""
    plain = re.sub(r"[^\w +=,()-]", "_", name).strip()[:80]
    return plain if plain not in ("", *RESERVED) else f"scene_{plain}"


def write_run(folder: Path, run: Run) -> None:
    """The folder of one run; all or nothing."""
    aside = folder.with_name(folder.name + ".part")
    aside.mkdir(parents=True)
    fill(aside, run)
    os.replace(aside, folder)


def fill(folder: Path, run: Run, *, by: str = "compute") -> None:
    """scene.toml, responses.npz, lines.csv, effort.json and record.json of one run, into an empty
    folder; `by` is how its model was computed, as in `record.of_model`.
    """
    (folder / "scene.toml").write_text(dumps(run.scene), encoding="utf-8")
    write_responses(folder / record.RESPONSES[0], {"displacement": run, run.model: run})
    write_lines(folder / "lines.csv", [run])
    write_effort(folder / "effort.json", run.response.effort)
    command = record.of_model(run, by)
    record.write(folder, command, scene=run.scene, response=run.response)


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
    """Rows of lines.csv; the point kernel has a pressure where bodies have a displacement. Peaks
    that are no single line of the load have their kind for a name, such as "free vibration".
    """
    found = [(name, f, run.table.amplitudes[name]) for name, f in run.listed.items()]
    found += [(peak.kind, peak.frequency, peak.amplitudes) for peak in run.unnamed]
    for name, frequency, amplitudes in found:
        for (x, y), amplitude in zip(run.response.probes, amplitudes, strict=True):
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
        writer.writerows(map(cell, row) for row in rows)


def _short(value: float) -> str:
    return f"{value:.6g}"
