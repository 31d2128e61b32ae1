"""Pieces of a sweep: how work is handed out, and how rows become one table."""

import errno
import json
import os
import subprocess
import sys
import threading
from collections import Counter, deque
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from itertools import count
from pathlib import Path

import numpy as np
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest

import skinwave
from skinwave.commands.cli import main
from skinwave.results import outputs
from skinwave.sweeps import dataset, engine

OUT = Path("short-sweep")
SEVEN = ["--vary", "tacton.speed_m_per_s=3:8:7", "--model", "point-kernel"]
KILLING = """
import os
def work(item):
    if item == 3:
        os._exit(9)
    return item
"""
DYING = """
import os
from pathlib import Path
import numpy as np
from simple_model import Response
from skinwave.models import Model, register
def solve(scene, times, options):
    mark = Path(os.environ["MARK"])
    if scene.tacton.trajectory.speed > 5 and not mark.exists():
        mark.touch()
        os._exit(9)
    values = 1e-6 * np.outer(np.sin(880 * times), np.ones(len(scene.probes)))
    return Response(model="dying", times=times, probes=scene.probe_points, values=values)
register(Model(name="dying", method="", words="", solve=solve, is_infinite=True))
"""


def swept(*words):
    return main(["sweep", "short.toml", *words, "--scheduler", "threads", "--quiet"])


def stored():
    """Keys in the files of the table, as other programs read them."""
    return ds.dataset(OUT / "rows").to_table(["key"])["key"].to_pylist()


@pytest.mark.parametrize("seconds", [0.0, 1e9])
def test_each_item_is_computed_once_in_pieces_by_time(monkeypatch, seconds):
    lengths, running, most, found = [], [0], [0], {}
    inner, lock = engine._compute, threading.Lock()

    def counted(work, items, limit):
        lengths.append(len(items))
        results = inner(work, items, limit)
        with lock:
            running[0] -= 1
        return results

    class Counting(engine.ThreadPoolExecutor):
        def submit(self, *given):
            with lock:
                running[0] += 1
                most[0] = max(most[0], running[0])
            return super().submit(*given)

    def done(results):
        assert not found.keys() & results.keys()
        found.update(results)

    monkeypatch.setattr(engine, "_compute", counted)
    monkeypatch.setattr(engine, "ThreadPoolExecutor", Counting)
    engine.run_all(lambda x: x**2, range(300), "threads", 2, done, seconds=seconds)
    assert found == {k: k**2 for k in range(300)}
    assert most[0] <= 2 * engine.IN_FLIGHT
    assert (max(lengths) <= 4) if seconds == 0 else (len(lengths) < 60)


def test_a_piece_ends_with_its_time_and_pieces_shrink_at_the_end():
    assert engine._compute(str, [1, 2, 3], [0.0])[0] == ["1"]
    assert engine._compute(str, [1, 2, 3], [1e9])[0] == ["1", "2", "3"]
    waiting, lengths = deque(range(100)), []
    while waiting:
        lengths.append(len(engine._take(waiting, Counter(), 10, {}, 2)))
    assert lengths[:3] == [10, 10, 10]
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[-8:] == [1] * 8
    assert not engine._take(deque([7]), Counter(), 1, {k: [k] for k in range(4)}, 2)


def test_an_item_that_kills_each_worker_is_left_out_alone(tmp_path, monkeypatch):
    (tmp_path / "killing.py").write_text(KILLING)
    monkeypatch.syspath_prepend(tmp_path)
    found = {}
    engine.run_all(import_module("killing").work, range(12), "processes", 2, found.update)
    assert found == {k: k for k in range(12) if k != 3}


def test_rows_of_a_killed_worker_are_written_once(scene, tmp_path, monkeypatch):
    (tmp_path / "dying_model.py").write_text(DYING)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
    monkeypatch.setenv("SKINWAVE_EXTENSIONS", "dying_model")
    monkeypatch.setenv("MARK", str(tmp_path / "died"))
    words = ["sweep", "short.toml", *SEVEN[:2], "--model", "dying", "--workers", "2", "--quiet"]
    done = subprocess.run([sys.executable, "-m", "skinwave", *words], cwd=scene.parent)
    assert done.returncode == 0
    assert (tmp_path / "died").exists()
    assert len(stored()) == len({*stored()}) == 7


@pytest.mark.parametrize("where", [dataset.PIECES, dataset.ROWS])
def test_a_full_disk_loses_and_repeats_no_row(scene, monkeypatch, capsys, where):
    written = Counter()

    @contextmanager
    def full(path, **how):
        with outputs.output_file(path, **how) as file:
            kind = dataset.PIECES if path.name.startswith("piece") else dataset.ROWS
            written[kind] += 1
            if kind == where and written[kind] > 3 * (kind == dataset.PIECES):
                with open("/dev/full", "wb") as file:
                    yield file
                return
            yield file

    with monkeypatch.context() as patch:
        patch.setattr(dataset, "output_file", full)
        assert swept(*SEVEN) == 2
    assert os.strerror(errno.ENOSPC) in capsys.readouterr().err
    before = dataset.read(OUT)
    assert len(before) == (3 if where == dataset.PIECES else 7)
    assert swept(*SEVEN) == 0
    after = {row["key"]: row["seconds"] for row in dataset.read(OUT)}
    assert len(after) == len(stored()) == 7
    assert all(
        after[row["key"]] == row["seconds"] for row in before
    )  # which are not computed again
    assert [path.name for path in OUT.iterdir() if path.name not in ("rows", "record.json")] == []


def rows_of(numbers, **shared):
    return [
        {"index": n, "key": f"k{n}", "status": "done", "error": "", "size": n / 3,
         "levels": [n / 7, None], "places": [1, 2], "none": None, **shared} for n in numbers
    ]  # fmt: skip


class StopError(Exception):
    """What ends a process."""


def test_a_merge_that_ends_anywhere_loses_and_repeats_no_row(tmp_path, monkeypatch):
    first, more = rows_of(range(6), tolerance=0.1), rows_of(range(6, 12), tolerance=0.2, word="x")
    expected = [{"word": None} | row for row in first] + more
    for last in count():
        folder = dataset.open_folder(tmp_path / f"{last}")
        for k in range(0, 6, 2):
            dataset.append(folder, first[k : k + 2])
        dataset.merge(folder, most_bytes=4)
        parts = list((folder / "rows").glob("*.parquet"))
        assert len(parts) == 3
        for part in parts:
            schema = pq.read_schema(part)
            assert schema.names == ["index", "key", "status", "error", "size", "levels"]
            constants = json.loads(schema.metadata[b"constants"])
            assert constants == {"places": [1, 2], "none": None, "tolerance": 0.1}
        for k in range(0, 6, 3):
            dataset.append(folder, more[k : k + 3])
        steps = []

        def stopping(act, *given, steps=steps, last=last, **how):
            if len(steps) == last:
                raise StopError
            steps.append(given)
            return act(*given, **how)

        with monkeypatch.context() as patch:
            patch.setattr(os, "replace", partial(stopping, os.replace))
            unlink = Path.unlink
            patch.setattr(
                Path, "unlink",
                lambda path, missing_ok=False, act=unlink, stop=stopping: (
                    act(path, missing_ok) if "partial" in path.name else stop(act, path)
                ),
            )  # fmt: skip
            try:
                dataset.merge(folder)
                ended = False
            except StopError:
                ended = True
        assert dataset.read(folder) == expected
        files = (folder / "rows").glob("*.parquet")
        keys = [key for file in files for key in pq.read_table(file)["key"].to_pylist()]
        assert len({*keys}) == len(keys) >= 6
        dataset.merge(folder)
        assert dataset.read(folder) == expected
        found = ds.dataset(folder / "rows").to_table()["tolerance"].to_pylist()
        assert sorted(found) == 6 * [0.1] + 6 * [0.2]
        assert not (folder / "pieces").exists()
        if not ended:
            break
    assert last == 8  # three files written elsewhere, then renamed, and two pieces removed


def test_constant_columns_are_in_the_metadata_unless_asked_for(scene):
    assert swept(*SEVEN) == 0
    table, rows = ds.dataset(OUT / "rows").to_table(), dataset.read(OUT)
    same = json.loads(table.schema.metadata[b"constants"])
    assert same["tacton.size_mm"] == 10
    assert not same.keys() & {*table.column_names, "key", "index", "status", "error"}
    assert {*rows[0]} == same.keys() | {*table.column_names}
    assert table.num_columns < 0.6 * len(rows[0])
    found = skinwave.read_sweep(OUT)
    assert found.varied == ("tacton.speed_m_per_s",)
    assert found.to_dataframe()["tacton.size_mm"].tolist() == 7 * [10]
    for k, row in enumerate(rows):  # the scene of a row
        assert skinwave.loads(row["scene"]).tacton.trajectory.speed == pytest.approx(3 + k * 5 / 6)
    assert swept(*SEVEN, "--all-columns") == 0
    full = ds.dataset(OUT / "rows").to_table()
    assert full.num_columns == len(rows[0])
    assert dataset.read(OUT) == rows
    assert swept(*SEVEN) == 0
    assert ds.dataset(OUT / "rows").to_table().num_columns == table.num_columns


def test_waveforms_are_those_of_each_run_also_if_asked_for_later(scene):
    words = ["--vary", "tacton.size_mm=10,20,70", "--model", "point-kernel", "--out", str(OUT)]
    assert swept(*words) == 1  # 70 mm fails
    before = dataset.read(OUT)
    for _ in range(2):
        assert swept(*words, "--waveforms") == 1
        table = ds.dataset(OUT / "waveforms" / "rows").to_table()
        assert json.loads(table.schema.metadata[b"constants"]).keys() == set()
        waves = {row["key"]: row for row in table.to_pylist()}
        assert table.num_rows == len(waves) == 3
    assert [row["key"] for row in dataset.read(OUT)] == [row["key"] for row in before]
    for row in before[:2]:
        with pytest.warns(skinwave.SkinwaveWarning):
            response = skinwave.simulate(skinwave.loads(row["scene"]), model="point-kernel")
        wave, scale = waves[row["key"]], response.record.per_unit
        np.testing.assert_allclose(
            np.transpose(wave["waveform_pressure_pa"]),
            scale * response.values,
            rtol=1e-6,
            atol=1e-6,
        )
        times = wave["first_s"] + wave["step_s"] * np.arange(len(response.times))
        np.testing.assert_allclose(times, response.times, atol=1e-12)
    assert waves[before[2]["key"]]["waveform_pressure_pa"] is None


@pytest.mark.parametrize("step", ["listing", "reading"])
def test_rows_are_read_once_while_another_process_merges_them(tmp_path, monkeypatch, step):
    folder, merged = dataset.open_folder(tmp_path / "sweep"), []
    for k in range(0, 6, 2):
        dataset.append(folder, rows_of(range(k, k + 2)))
    where, name = (Path, "glob") if step == "listing" else (dataset, "_open")
    inner = getattr(where, name)

    def merging(*given):
        found = list(inner(*given)) if step == "listing" else inner(*given)
        if not merged:
            merged.append(given)
            dataset.merge(folder)
        return found

    monkeypatch.setattr(where, name, merging)
    assert dataset.read(folder) == rows_of(range(6))
    assert merged
