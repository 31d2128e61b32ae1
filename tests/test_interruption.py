"""A process that is killed and a disk that is full leave nothing that looks finished and is not."""

import csv
import errno
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time

import corpus
import numpy as np
import pytest

from meshes import cache
from skinwave import read, record
from skinwave.cli import main
from skinwave.outputs import output_folder
from skinwave.planning.plan import Plan
from skinwave.scene import BODIES

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="signals and limits differ"),
]
BEGUN = ("*/*/responses.npz", "figures")  # what is there when a comparison is killed
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
            assert {len(row) for row in rows} == {len(rows[0])}
        elif path.suffix == ".html":
            assert path.read_text().rstrip().endswith("</html>")
        elif path.suffix == ".toml":
            read(path)
        else:
            assert path.read_bytes().endswith(b"IEND\xaeB`\x82"), path
    return bool(files)


def finished(partial):
    """Folders of the runs that were finished before a kill."""
    return [p for p in partial.glob("*/*") if p.is_dir() and ".partial-" not in p.name]


def started(**where):
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([*COMPARE, "--overwrite"], **quiet, **where)


@pytest.mark.usefixtures("in_one_process")
def test_a_killed_comparison_leaves_whole_parts_and_runs_again(folder, monkeypatch):
    rng = random.Random(corpus.SEED)
    monkeypatch.setenv("SKINWAVE_CACHE", str(folder / "cache"))
    marked(folder / "out")
    for sign in BEGUN:
        shutil.rmtree(folder / "cache", ignore_errors=True)
        if sign == BEGUN[-1]:  # nothing there before
            shutil.rmtree(folder / "out", ignore_errors=True)
        before = (folder / "out").exists()
        with started() as process:
            while process.poll() is None and not [*folder.glob(f"out.partial-*/{sign}")]:
                time.sleep(0.01)
            time.sleep(rng.uniform(0.0, 0.2))
            process.send_signal(signal.SIGKILL)
        if (folder / "out").exists():
            assert opens(folder / "out")
            assert (folder / "out/index.html").exists()
        elif before:  # between two renames, and whole
            (kept,) = folder.glob("out.replaced-*/out")
            assert opens(kept)
            kept.rename(folder / "out")
        for left in folder.glob("out.partial-*"):
            assert all(map(opens, finished(left)))
            shutil.rmtree(left)
    assert main([*COMPARE[3:], "--overwrite", "--quiet"]) == 0
    assert opens(folder / "out")
    assert not [*folder.glob("out.partial-*")]


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
