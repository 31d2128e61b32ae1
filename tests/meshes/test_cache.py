"""The cache: what is used of it, how large it grows, and what is removed."""

import json
import multiprocessing
import os
import subprocess
import sys

import hostile
import numpy as np
import pytest

from meshes import cache
from skinwave.commands.cli import main

NAMES = [f"{k:032x}" for k in range(9)]


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("SKINWAVE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def stored(name, size=1000):
    """Keep an entry of so many bytes, and a little more."""
    cache.store(name, {"version": 3}, x=np.arange(size // 8, dtype=np.float64))


def changed(home, **arrays):
    """Write a sound file in an entry's place, with other arrays in it."""
    with np.load(home / f"{NAMES[0]}.npz") as file:
        kept = {name: file[name] for name in file.files}
    np.savez(home / f"{NAMES[0]}.npz", **kept | arrays)


X = np.arange(125.0)
ALTERED = {
    "larger": {"x": 1000 * X},
    "unknown": {"x": np.where(X == 7, np.nan, X)},
    "of another type": {"x": X.astype(np.float32)},
    "of another shape": {"x": X.reshape(5, 25)},
    "shorter": {"x": X[:-1]},
    "more": {"y": X},
    "without a digest": {"meta": np.array(json.dumps({"meta": {"version": 3}}))},
    "of another version": {"meta": np.array(json.dumps({"digest": "0" * 64, "meta": {}}))},
    "objects": {"meta": np.array([{"a": 1}], dtype=object)},
}


@pytest.mark.parametrize("what", ALTERED)
def test_an_altered_entry_is_a_miss_and_replaced(home, what):
    stored(NAMES[0])
    changed(home, **ALTERED[what])
    assert cache.load(NAMES[0]) is None
    stored(NAMES[0])
    np.testing.assert_array_equal(cache.load(NAMES[0])["x"], X)


def test_a_truncated_or_foreign_entry_is_a_miss(home):
    stored(NAMES[0])
    path = home / f"{NAMES[0]}.npz"
    whole = path.read_bytes()
    for spoilt in (b"", whole[: len(whole) // 2], whole[:-1], b"mine", b"PK\x05\x06" + bytes(18)):
        path.write_bytes(spoilt)
        assert cache.load(NAMES[0]) is None
    path.unlink()
    path.mkdir()
    assert cache.load(NAMES[0]) is None
    stored(NAMES[0])  # which cannot replace a folder, and is no error
    assert path.is_dir()
    assert len(list(home.iterdir())) == 1


def test_an_entry_that_unpacks_to_more_than_its_size_is_a_miss_and_not_read(home, monkeypatch):
    stored(NAMES[0], 100_000)
    assert cache.load(NAMES[0]) is not None
    with np.load(home / f"{NAMES[0]}.npz") as file:
        kept = {name: file[name] for name in file.files}
    np.savez_compressed(home / f"{NAMES[0]}.npz", **kept)
    loaded = []
    monkeypatch.setattr(np, "load", loaded.append)
    assert cache.load(NAMES[0]) is None
    assert loaded == []


def test_an_entry_with_a_header_that_tells_of_more_is_a_miss_and_not_read(home, monkeypatch):
    home.mkdir()
    hostile.bomb(home / f"{NAMES[0]}.npz", 1)
    loaded = []
    monkeypatch.setattr(np, "load", loaded.append)
    assert cache.load(NAMES[0]) is None
    assert loaded == []


@pytest.mark.skipif(sys.platform == "win32", reason="no such files")
def test_a_pipe_in_the_place_of_an_entry_is_a_miss(home):
    """Opened for reading, it would be waited for: in a process that can be ended."""
    home.mkdir()
    os.mkfifo(home / f"{NAMES[0]}.npz")
    said = f"from meshes import cache; assert cache.load({NAMES[0]!r}) is None"
    subprocess.run([sys.executable, "-c", said], check=True, timeout=600)


def left(home):
    return [name for name in NAMES if (home / f"{name}.npz").exists()]


def test_what_was_used_longest_ago_leaves_first(home, monkeypatch):
    monkeypatch.setattr(cache, "LIMIT", 35_000)
    for k, name in enumerate(NAMES[:3]):
        stored(name, 10_000)
        os.utime(home / f"{name}.npz", (k, k))
    assert cache.load(NAMES[0]) is not None  # now used last
    stored(NAMES[3], 10_000)
    assert left(home) == [NAMES[0], NAMES[2], NAMES[3]]
    stored(NAMES[4], 40_000)  # alone above the limit
    assert left(home) == [NAMES[4]]


def test_only_what_is_ours_is_removed(home, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(cache, "LIMIT", 0)
    home.mkdir()
    (tmp_path / "thesis.npz").write_text("mine")
    (home / f"{NAMES[5]}.npz").symlink_to(tmp_path / "thesis.npz")
    (home / f"{NAMES[6]}.npz").mkdir()
    theirs = [home / name for name in ("notes.txt", "results.npz", "a.part", f"{NAMES[1]}.npz.txt",
                                       f"x{NAMES[1]}.npz")]  # fmt: skip
    for path in theirs:
        path.write_text("mine")
        os.utime(path, (0, 0))
    before = sorted(home.iterdir())
    old, new = (home / f"{NAMES[7]}.{name}.part" for name in ("abcdefgh", "12345678"))
    for path in (old, new):
        path.write_text("half")
    os.utime(old, (0, 0))
    stored(NAMES[0])
    assert sorted(home.iterdir()) == sorted([*before, new, home / f"{NAMES[0]}.npz"])
    assert main(["cache", "--clear"]) == 0
    assert sorted(home.iterdir()) == before
    assert (tmp_path / "thesis.npz").read_text() == "mine"


def test_an_interrupt_leaves_nothing_half_written(home, monkeypatch):
    def interrupted(file, **arrays):
        file.write(b"half")
        raise SystemExit(143)

    monkeypatch.setattr(np, "savez", interrupted)
    with pytest.raises(SystemExit):
        stored(NAMES[0])
    assert not list(home.iterdir())


def fill(seed):
    """Store and load at random within a small limit; how many loads were neither right nor none."""
    rng, wrong = np.random.default_rng(seed), 0
    cache.LIMIT = 30_000
    for _ in range(300):
        name = NAMES[rng.integers(len(NAMES))]
        if (entry := cache.load(name)) is None:
            stored(name, 8000)
        else:
            wrong += not np.array_equal(entry["x"], np.arange(1000.0))
    return wrong


def test_several_processes_share_it(home):
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        assert pool.map(fill, range(2)) == [0, 0]
    assert all(path.suffix == ".npz" for path in home.iterdir())
    cache.store(NAMES[0], {}, x=np.arange(1000.0))
    assert cache.contents().size <= 60_000  # two that were stored at once may both be kept


def asked(capsys, *arguments):
    assert main(["cache", "--json", *arguments]) == 0
    return json.loads(capsys.readouterr().out)


def test_the_command_says_where_and_how_large_and_clears(home, capsys, monkeypatch):
    empty = {"folder": str(home), "entries": 0, "bytes": 0, "limit_bytes": cache.LIMIT}
    assert asked(capsys) == empty
    stored(NAMES[0])
    stored(NAMES[1])
    size = sum(path.stat().st_size for path in home.iterdir())
    assert asked(capsys) == {**empty, "entries": 2, "bytes": size}
    assert main(["cache"]) == 0
    assert capsys.readouterr().out == f"{home}\n2 entries, 0.00 GiB of 5 GiB at most\n"
    removed = asked(capsys, "--clear")
    assert (removed["removed"], removed["bytes"]) == (2, size)
    assert asked(capsys) == empty
    monkeypatch.setenv("SKINWAVE_CACHE", "")
    assert asked(capsys) == {"folder": None}


@pytest.mark.skipif(sys.platform != "linux", reason="the folder of another platform")
def test_it_is_in_the_folder_of_caches_where_version_0_2_had_it(tmp_path, monkeypatch):
    monkeypatch.delenv("SKINWAVE_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("LOCALAPPDATA", "C:/")  # of no meaning here
    assert cache.folder() == tmp_path / "skinwave"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache.folder() == tmp_path / ".cache" / "skinwave"


def test_a_folder_that_cannot_be_read_is_said(home, capsys):
    home.write_text("a file")
    for more in ([], ["--clear"]):
        assert main(["cache", *more]) == 2
        said = capsys.readouterr().err
        assert said.startswith(f"skinwave: the cache {home} cannot be read (Not a directory); ")
        assert said.count("\n") == 1


def test_the_limit_that_help_says_is_the_limit(capsys):
    for words in (["--help"], ["cache", "--help"]):
        with pytest.raises(SystemExit):
            main(words)
        assert f"{cache.LIMIT / 2**30:g} GiB" in " ".join(capsys.readouterr().out.split())
