"""A process that is killed and a disk that is full leave nothing that looks finished and is not."""

import csv
import errno
import json
import os
import random
import shutil
import subprocess
import sys
from itertools import count, cycle
from pathlib import Path
from pkgutil import resolve_name

import corpus
import numpy as np
import pyarrow.parquet as pq
import pytest

from meshes import cache
from skinwave import read
from skinwave.commands.cli import main
from skinwave.planning.records import Plan
from skinwave.results import record
from skinwave.results.outputs import output_folder
from skinwave.scene.scene import BODIES

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="no fork, other limits"),
]
HERE = (Path(__file__).parents[1], Path(__file__).parents[2])
PLANNED = Plan(model="flat-body", body=BODIES["skin-slab"])
COMPARE = [sys.executable, "-m", "skinwave", "compare", "good.toml", "--h", "6", "--out", "out"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "good.toml").write_text(corpus.GOOD)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def opens(folder):
    """Whether there is anything in a folder; all of it must be whole."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    for path in files:
        if path.suffix == ".npz":
            with np.load(path) as arrays:
                assert all(np.isfinite(arrays[name]).all() for name in arrays.files)
        elif path.suffix == ".json":
            json.loads(path.read_text())
        elif path.suffix == ".csv":
            rows = list(csv.reader(path.read_text().splitlines()))
            assert len(rows) > 1
            assert {len(row) for row in rows if row[0][:1] != "#"} == {len(rows[-1])}
        elif path.suffix == ".html":
            assert path.read_text().rstrip().endswith("</html>")
        elif path.suffix == ".toml":
            read(path)
        elif path.suffix == ".parquet":
            assert pq.read_table(path).num_rows == 1
        else:
            assert path.read_bytes().endswith(b"IEND\xaeB`\x82"), path
    return bool(files)


KERNEL = ["--model", "point-kernel", "--quiet"]
RUN = ["run", "good.toml", *KERNEL, "--tolerance", "0.9"]
SWEEP = ["sweep", "good.toml", *KERNEL, "--vary", "tacton.am_frequency_hz=100,150,200",
         "--scheduler", "threads", "--out", "out"]  # fmt: skip
# Commands, and at which call of what their process dies, by the folder in which it does.
DEATHS = {
    "half a file": ([*RUN, "--out", "out"], "pathlib.Path.write_text", 1),
    "between renames": ([*RUN, "--out", "over", "--overwrite"], "pathlib.Path.rename", 2),
    "after three runs": ([*COMPARE[3:], "--quiet"], "csv.writer", 4),
    "a row": (SWEEP, "os.link", 2),
}
# Each in a process of its own, which has loaded what all of them need.
DIE = """
import json, os, sys
from pkgutil import resolve_name
import skinwave.studies.study as study
from conftest import Here
from contextlib import nullcontext
from skinwave.commands.cli import main

def die(inner, last, calls=[]):
    def called(*given, **options):
        calls.append(given)
        if len(calls) < last:
            return inner(*given, **options)
        if inner.__name__ == "write_text":
            inner(given[0], given[1][: len(given[1]) // 2])
        os._exit(9)
    return called

study.helper = lambda: nullcontext(Here())
for folder, (words, what, last) in json.loads(sys.argv[1]).items():
    if not (child := os.fork()):
        os.chdir(folder)
        owner, _, name = what.rpartition(".")
        setattr(resolve_name(owner), name, die(resolve_name(what), last))
        main(words)
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9, folder
"""


@pytest.mark.usefixtures("in_one_process")
def test_a_process_that_dies_leaves_whole_parts_and_runs_again(folder, monkeypatch):
    for name in DEATHS:
        (folder / name).mkdir()
        (folder / name / "good.toml").write_text(corpus.GOOD)
        marked(folder / name / "over")
    earlier = corpus.contents(folder / "a row/over")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([*map(str, HERE), *sys.path])}
    words = [sys.executable, "-c", DIE, json.dumps(DEATHS)]
    subprocess.run(words, check=True, env=environment)
    for name, (command, _, _) in DEATHS.items():
        monkeypatch.chdir(folder / name)
        place = folder / name
        if name == "between renames":
            (kept,) = place.glob("over.replaced-*/over")
            kept.rename(place / "over")
        assert {p.relative_to(place) for p in (place / "over").rglob("*")} == {
            p.relative_to(folder / "a row") for p in earlier
        }
        assert opens(place / "over")
        # Of a command that writes at its end nothing has its name; a sweep has its finished rows.
        assert (place / "out").exists() == (name == "a row")
        runs = [
            left
            for left in place.glob("out.partial-*/*/*")
            if left.is_dir() and ".partial-" not in left.name
        ]
        assert len(runs) == (3 if name == "after three runs" else 0)
        assert all(map(opens, runs))
        assert main(command) == 0
        assert opens(place / command[command.index("--out") + 1])
    assert len(list((folder / "a row/out/rows").glob("part-*.parquet"))) == 3


ENDED = {
    "run": [*RUN, "--out", "out"],
    "run over": [*RUN, "--out", "over", "--overwrite"],
    "convert": ["convert", "good.toml", "out.csv", "--quiet"],
    "sweep": [*SWEEP, "--csv"],
}
WRITES = ("numpy.savez", "os.replace", "os.link", "pathlib.Path.rename", "pathlib.Path.mkdir",
          "pathlib.Path.write_text", "csv.writer")  # fmt: skip


@pytest.mark.parametrize("name", ENDED)
def test_what_ends_a_command_as_it_writes_leaves_its_result_whole_or_absent(
    folder, monkeypatch, name
):
    """Ctrl-C or SIGTERM at the first, second, ... call of each function that writes."""
    (folder / "notes.partial").mkdir()
    (folder / "notes.partial/note.txt").write_text("mine")
    ends = cycle([(KeyboardInterrupt, 1), (SystemExit, None)])
    for what in WRITES:
        inner = resolve_name(what)
        for last in count(1):
            shutil.rmtree(folder / "over", ignore_errors=True)
            marked(folder / "over")
            before, calls, (raised, code) = corpus.contents(folder), [], next(ends)

            def ended(*given, inner=inner, calls=calls, last=last, raised=raised, **options):
                calls.append(given)
                if len(calls) == last:
                    raise raised
                return inner(*given, **options)

            with monkeypatch.context() as patch:
                patch.setattr(what, ended)
                try:
                    found = main(ENDED[name])
                except SystemExit as error:
                    found = error.code
            if len(calls) < last:
                assert found == 0
            else:
                assert found == code
            now = corpus.contents(folder)
            kept = {path: now.get(path) for path in before}
            if kept != before:  # the new result is there, and whole
                assert name == "run over"
                assert (folder / "over/responses.npz").exists()
            assert opens(folder / "over")
            for path in {path for path in folder.iterdir() if path not in before}:
                assert raised is KeyboardInterrupt or path.name in ("out", "out.csv")
                if path.is_dir():
                    opens(path)
                    shutil.rmtree(path)
                else:
                    assert path.stat().st_size
                    path.unlink()
            if len(calls) < last:
                break


def test_a_killed_run_leaves_nothing_that_stops_the_next(folder, capsys):
    arguments = ["run", "good.toml", "--model", "point-kernel", "--tolerance", "0.9", "--quiet"]
    for left in ("out.partial", "out.partial-01234567", "out.partial/small"):
        (folder / left).mkdir(parents=True)
        (folder / left / "responses.npz").write_bytes(b"half")
    before = corpus.contents(folder)
    assert main([*arguments, "--out", "out"]) == 0
    assert opens(folder / "out")
    shutil.rmtree(folder / "out")
    assert corpus.contents(folder) == before  # also that of another run, or of the user's


def test_what_a_killed_process_leaves_in_the_cache_is_rebuilt(tmp_path, monkeypatch):
    monkeypatch.setenv("SKINWAVE_CACHE", str(tmp_path))
    cache.store("entry", {"a": 1}, x=np.arange(30.0), y=np.arange(4.0))
    (path,) = tmp_path.glob("*.npz")
    whole, rng = path.read_bytes(), random.Random(corpus.SEED)
    for _ in range(1000):
        spoilt = bytearray(whole[: rng.randrange(len(whole) + 1)] if rng.random() < 0.3 else whole)
        for _ in range(min(len(spoilt), rng.choice((1, 1, 2, 5)))):
            spoilt[rng.randrange(len(spoilt))] = rng.randrange(256)
        path.write_bytes(spoilt)
        entry = cache.load("entry")
        if entry is not None:
            np.testing.assert_array_equal(entry["x"], np.arange(30.0))


def refused(capsys, folder, arguments):
    before = corpus.contents(folder)
    assert main(arguments) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert said[0].startswith("skinwave: ")
    assert corpus.contents(folder) == before
    return said[0]


def marked(out):
    """A folder that this program may replace, with a page of an earlier result."""
    with output_folder(out) as folder:
        (folder / "index.html").write_text("<html>earlier</html>")
        record.write(folder, {"typed": "", "name": "run", "options": {}})


FAILING = ["numpy.savez", "pathlib.Path.write_text", "pathlib.Path.write_bytes", "os.replace",
           "pathlib.Path.rename", "csv.writer", "pathlib.Path.mkdir"]  # fmt: skip


CODES = [errno.ENOSPC, errno.EROFS, errno.EACCES]


@pytest.mark.usefixtures("in_one_process")
@pytest.mark.parametrize(
    ("what", "code", "existing"),
    [(w, code, (i + k) % 2 == 0) for i, w in enumerate(FAILING) for k, code in enumerate(CODES)],
)  # fmt: skip
def test_a_full_or_read_only_disk_is_said_and_nothing_is_left(
    folder, capsys, monkeypatch, what, code, existing
):
    if existing:
        marked(folder / "above/out")

    def fails(*arguments, **options):
        raise OSError(code, os.strerror(code))

    commands = {"compare": ["--h", "6"], "run": ["--model", "flat-body"]}
    if what in ("pathlib.Path.write_bytes", "os.replace"):
        del commands["run"]  # writes no pictures beside the page, and in one step
    for command, model_options in commands.items():
        arguments = [
            command,
            "good.toml",
            *model_options,
            "--quiet",
            "--overwrite",
            "--out",
            "above/out",
        ]
        with monkeypatch.context() as patch:
            patch.setenv("SKINWAVE_CACHE", "")
            patch.setattr("skinwave.commands.run.required_plan", lambda *asked: PLANNED)
            patch.setattr(what, fails)
            said = refused(capsys, folder, arguments)
        assert f"cannot be written ({os.strerror(code)})" in said


def limited(size):
    """Files of a process can grow to so many bytes."""
    import resource

    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


@pytest.mark.parametrize("size", [0, 20_000])
def test_a_file_that_cannot_grow_is_said_and_nothing_is_left(folder, size):
    before = corpus.contents(folder)
    ended = subprocess.run(
        [*COMPARE, "--quiet"], capture_output=True, text=True, preexec_fn=limited(size),
        env=os.environ | {"SKINWAVE_CACHE": ""},
    )  # fmt: skip
    assert ended.returncode == 2
    assert "cannot be written (File too large)" in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert corpus.contents(folder) == before


@pytest.fixture
def disk(folder):
    """A disk of 64 KiB, with a result of the user's on it."""
    place = folder / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(place)]
    if sys.platform != "linux" or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("no disk can be mounted here")
    marked(place / "out")
    yield place
    subprocess.run(["umount", str(place)], check=True)


@pytest.mark.parametrize("state", ["full", "read-only"])
def test_a_real_disk_that_is_full_or_read_only_keeps_what_was_on_it(disk, capsys, state):
    if state == "read-only":
        subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
    for out in ("disk/out", "disk/new/out"):
        command = ["compare", "good.toml", "--h", "6", "--quiet", "--overwrite", "--out", out]
        said = refused(capsys, disk.parent, command)
        assert "cannot be written (" in said
        assert ("No space left" if state == "full" else "Read-only") in said
