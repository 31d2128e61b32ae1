"""SIGTERM, Ctrl-C and kill -9 at random moments of every command that writes.

`python tests/test_ended_anywhere.py 40` makes so many draws, and says how each ended.
"""

import contextlib
import csv
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from dataclasses import dataclass
from pathlib import Path

import corpus
import numpy as np
import pytest

import meshes
from meshes.shapes import palm
from skinwave import read
from skinwave.cli import main as skinwave

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="looks processes up"),
]
SMALL = ["good.toml", "--h", "8", "--quiet"]
LONGEST = 12.0  # s until the last moment that is drawn; longer commands are ended before their end
COMMANDS = {
    "run": [*SMALL, "--out", "new"],
    "compare": [*SMALL, "--out", "new"],
    "sweep": [*SMALL, "--vary", "tacton.am_frequency_hz=100,150,200", "--model", "fem", "--csv",
              "--workers", "2", "--out", "new"],
    "mesh": ["hand.stl", "--h", "6", "--out", "new.vtu", "--quiet"],
    "convert": ["good.toml", "new.csv", "--quiet"],
    "rerun": ["old", "--out", "new", "--quiet"],
    "report": [*SMALL, "--out", "new"],
    "film": [*SMALL, "--frames", "4", "--out", "new.gif"],
    "relax": [*SMALL, "--out", "new"],
    "tradeoff": ["good.toml", "--quiet", "--out", "new"],
    "verify": ["--quick", "--quiet", "--out", "new"],
}  # fmt: skip
SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGKILL)
CODES = {signal.SIGTERM: (143, -15), signal.SIGINT: (1, -2), signal.SIGKILL: (-9,)}
QUIET = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}


@dataclass(frozen=True, kw_only=True)
class Ended:
    """How a command ended, and what was there afterwards."""

    name: str
    number: int
    after: float
    code: int
    said: str
    wrote: bool


def words(name):
    return [sys.executable, "-m", "skinwave", name, *COMMANDS[name]]


def prepared(folder):
    """Files of the user: a scene, a surface, notes, and the folder of a run."""
    (folder / "good.toml").write_text(corpus.GOOD)
    (folder / "notes.partial").mkdir()
    (folder / "notes.partial/note.txt").write_text("mine")
    hand(folder / "hand.stl")
    run = ["run", str(folder / "good.toml"), *SMALL[1:], "--out", str(folder / "old")]
    assert skinwave(run) == 0


def hand(path, h=2e-3):
    """Write the surface of a palm, m, of triangles of this size."""
    import pyvista

    found = palm.surface(meshes.Palm(), h)
    corners = np.insert(found.triangles, 0, 3, axis=1)
    pyvista.PolyData(found.points, corners.ravel()).save(path)


def drawn(template, name, number, after):
    """End a command in a copy of a folder; raises AssertionError if it leaves what it must not."""
    with tempfile.TemporaryDirectory() as place:
        folder, temporary = Path(place, "here"), Path(place, "temporary")
        shutil.copytree(template, folder)
        temporary.mkdir()
        before, token = corpus.contents(folder), uuid.uuid4().hex
        env = os.environ | {"TMPDIR": str(temporary), "SKINWAVE_CACHE": str(Path(place, "cache"))}
        signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in a background job
        with subprocess.Popen(words(name), cwd=folder, env=env | {"TOKEN": token}, **QUIET) as one:
            time.sleep(after)
            one.send_signal(number)
            _, said = one.communicate(timeout=120)
        assert one.returncode in (0, *CODES[number]), (one.returncode, said)
        now = corpus.contents(folder)
        assert {path: now.get(path) for path in before} == before
        new = {path for path in folder.iterdir() if path not in before}
        result = folder / COMMANDS[name][1 + COMMANDS[name].index("--out")] \
            if "--out" in COMMANDS[name] else folder / "new.csv"  # fmt: skip
        if result in new:
            assert_whole(result)
        left = running(token, patience=0.0 if number == signal.SIGKILL else 10.0)
        if number == signal.SIGKILL:
            end_now(token)
        else:
            assert not left, left
            assert not list(temporary.iterdir())
            assert not [p for p in Path(place, "cache").rglob("*") if p.suffix != ".npz"]
        if number == signal.SIGTERM:
            assert new <= {result}, new
        for path in new - {result}:  # an interrupt may leave what was finished
            assert number == signal.SIGKILL or finished(path), path
        return Ended(name=name, number=number, after=after, code=one.returncode, said=said,
                     wrote=result in new)  # fmt: skip


def finished(folder):
    """Whether a folder has something in it, all of which can be read."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    for path in files:
        assert_whole_file(path)
    return bool(files)


def assert_whole(result):
    """A sweep's folder may have no rows yet: the same command goes on with it."""
    if not result.is_dir():
        assert_whole_file(result)
    elif finished(result) and not (result / "rows").is_dir():
        assert (result / "index.html").exists()


def assert_whole_file(path):
    """Read a file by what its name says it is."""
    kind, content = path.suffix, path.read_bytes()
    if kind == ".npz":
        with np.load(path) as arrays:
            assert all(arrays[name] is not None for name in arrays.files)
    elif kind == ".json":
        json.loads(content)
    elif kind == ".csv":
        rows = list(csv.reader(path.read_text().splitlines()))
        assert len({len(row) for row in rows if row and row[0][:1] != "#"}) == 1, path
    elif kind == ".html":
        assert content.rstrip().endswith(b"</html>"), path
    elif kind == ".toml":
        read(path)
    elif kind == ".parquet":
        import pyarrow.parquet

        pyarrow.parquet.read_table(path)
    elif kind in (".png", ".gif"):
        assert content.endswith(b"IEND\xaeB`\x82" if kind == ".png" else b";"), path
    elif kind == ".vtu" and path.name == "new.vtu":
        meshes.read(path)
    else:
        assert content, path


def marked(token):
    """Numbers of all processes that were begun with a word in their environment."""
    for place in Path("/proc").iterdir():
        try:
            if token.encode() in (place / "environ").read_bytes():
                yield int(place.name)
        except OSError:
            pass


def running(token, patience):
    last = time.monotonic() + patience
    while (left := list(marked(token))) and time.monotonic() < last:
        time.sleep(0.1)
    return left


def end_now(token):
    """End processes that a killed command left, unless they end by themselves, before the next."""
    for number in running(token, 5.0):
        with contextlib.suppress(ProcessLookupError):
            os.kill(number, signal.SIGKILL)


def draws(count, names, seed=corpus.SEED):
    """Commands in turn, each with every signal in turn, at moments from a seed."""
    rng = random.Random(seed)
    for k in range(count):
        name = names[k % len(names)]
        number = SIGNALS[(k % len(names) + k // len(names)) % 3]
        after = LONGEST * rng.random() ** 2 + 0.2  # soon, for short ones
        yield name, number, after


@pytest.fixture(scope="module")
def template(tmp_path_factory):
    folder = tmp_path_factory.mktemp("template")
    prepared(folder)
    return folder


@pytest.mark.parametrize(("name", "number", "after"), [*draws(9, ("run", "sweep", "mesh"))])
def test_a_command_that_is_ended_leaves_what_it_may(template, name, number, after):
    drawn(template, name, number, min(after, 4.0))


def main(count):
    """Make so many draws of all commands; how many of them failed."""
    failed = 0
    with tempfile.TemporaryDirectory() as place:
        prepared(Path(place))
        for name, number, after in draws(count, tuple(COMMANDS)):
            begun = f"{name:9} {signal.Signals(number).name:8} after {after:5.2f} s: "
            try:
                ended = drawn(Path(place), name, number, after)
                print(f"{begun}code {ended.code}, {'whole' if ended.wrote else 'absent'}",
                      flush=True)  # fmt: skip
            except (AssertionError, subprocess.TimeoutExpired) as error:
                failed += 1
                print(f"{begun}FAILED {error}", flush=True)
    print(f"{failed} of {count} failed")
    return failed


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])))
