"""Files of users: regular, of limited size, whatever they claim; and the cache."""

import os
import sys
import time

import numpy as np
import pytest

import meshes
from meshes import MeshError, cache, reading, subprocess_call
from meshes.files.abaqus import read_abaqus

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="no such files")
NAMES = [f"{k:032x}" for k in range(9)]


@POSIX
def test_only_regular_files_are_opened(tmp_path):
    for name, make in (("pipe", os.mkfifo), ("folder", os.mkdir)):
        make(tmp_path / name)
        for read in (reading.read_text, reading.load_arrays):
            with pytest.raises(ValueError, match="cannot be read"):
                read(tmp_path / name)


def test_files_above_the_size_limit_are_refused(tmp_path):
    (tmp_path / "x").write_bytes(b"12345")
    assert reading.read_bytes(tmp_path / "x", 5) == b"12345"
    with pytest.raises(ValueError, match="limit"):
        reading.read_bytes(tmp_path / "x", 4)


def test_text_is_read_in_common_encodings(tmp_path):
    for encoding in ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"):
        (tmp_path / "x").write_bytes("t [s]; ° 1,5\n".encode(encoding))
        assert reading.read_exported_text(tmp_path / "x") == "t [s]; ° 1,5\n", encoding
    (tmp_path / "x").write_bytes(b"ab\x01\xffc")
    for read in (reading.read_text, reading.read_exported_text):
        with pytest.raises(ValueError, match="text"):
            read(tmp_path / "x")


def test_arrays_that_unpack_beyond_the_limit_are_refused(tmp_path):
    np.savez_compressed(tmp_path / "a.npz", x=np.zeros(100_000), y=np.array("text"))
    found = reading.load_arrays(tmp_path / "a.npz")
    assert found["x"].shape == (100_000,)
    assert str(found["y"]) == "text"
    with pytest.raises(ValueError, match="unpacks to 1 MB"):
        reading.load_arrays(tmp_path / "a.npz", 100_000)
    np.savez(tmp_path / "b.npz", x=np.random.default_rng(0).random(100_000))
    reading.load_arrays(tmp_path / "b.npz", 100_000)  # takes as much on the disk


def test_time_and_memory_of_a_reader_are_limited(tmp_path):
    node = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4\n1,1,2,3,4\n"
    path = tmp_path / "a.inp"
    path.write_text(node)
    assert len(meshes.read(path).tets) == 1
    path.write_text(f"{node}*ELSET,ELSET=a,GENERATE\n1,1000000000000,1\n")
    with pytest.raises(MeshError, match="a.inp cannot be read"):
        meshes.read(path)
    with pytest.raises(MeshError, match="longer than 0 s"):
        subprocess_call.call_reader(read_abaqus, path, least_seconds=0.0, seconds_per_mb=0.0)
    with pytest.raises(MeshError, match="limit"):
        subprocess_call.call_reader(read_abaqus, path, largest=10)


def test_a_separate_process_returns_results_and_errors():
    assert subprocess_call.call(os.getpid, timeout=600) != os.getpid()
    with pytest.raises(ZeroDivisionError):
        subprocess_call.call(divmod, 1, 0, timeout=600)
    with pytest.raises(subprocess_call.Crashed, match="code 7"):
        subprocess_call.call(os._exit, 7, timeout=600)
    with pytest.raises(TimeoutError):
        subprocess_call.call(time.sleep, 600, timeout=0.1)
    if sys.platform.startswith("linux"):
        with pytest.raises(MemoryError):
            subprocess_call.call(bytearray, 2_000_000_000, timeout=600, memory=500_000_000)


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("SKINWAVE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def stored(name, size=1000, limit=10**9):
    cache.store(name, {"version": 3}, {"x": np.arange(size // 8, dtype=np.float64)}, limit)


def test_a_damaged_entry_is_a_miss(home):
    stored(NAMES[0])
    path = home / f"{NAMES[0]}.npz"
    whole = path.read_bytes()
    altered = bytearray(whole)
    altered[len(whole) // 2] ^= 1
    for spoilt in (b"", whole[: len(whole) // 2], bytes(altered), b"PK\x05\x06" + bytes(18)):
        path.write_bytes(spoilt)
        assert cache.load(NAMES[0]) is None
        stored(NAMES[0])
        entry = cache.load(NAMES[0])
        np.testing.assert_array_equal(entry["x"], np.arange(125.0))
        assert entry["meta"] == {"version": 3}


def left(home):
    return [name for name in NAMES if (home / f"{name}.npz").exists()]


def test_the_least_recently_used_entries_are_removed_first(home):
    for k, name in enumerate(NAMES[:3]):
        stored(name, 10_000, 35_000)
        os.utime(home / f"{name}.npz", (k, k))
    assert cache.load(NAMES[0]) is not None  # now used last
    stored(NAMES[3], 10_000, 35_000)
    assert left(home) == [NAMES[0], NAMES[2], NAMES[3]]
    stored(NAMES[4], 40_000, 35_000)  # alone above the limit
    assert left(home) == [NAMES[4]]


def test_other_files_in_the_cache_folder_are_kept(home, tmp_path):
    home.mkdir()
    (tmp_path / "thesis.npz").write_text("mine")
    (home / f"{NAMES[5]}.npz").symlink_to(tmp_path / "thesis.npz")
    (home / f"{NAMES[6]}.npz").mkdir()
    for name in ("notes.txt", "results.npz", "a.part", f"x{NAMES[1]}.npz"):
        (home / name).write_text("mine")
        os.utime(home / name, (0, 0))
    before = sorted(home.iterdir())
    old, new = (home / f"{NAMES[7]}.{name}.part" for name in ("abcdefgh", "12345678"))
    for path in (old, new):
        path.write_text("half")
    os.utime(old, (0, 0))
    stored(NAMES[0], limit=0)
    assert sorted(home.iterdir()) == sorted([*before, new, home / f"{NAMES[0]}.npz"])


def test_an_interrupt_leaves_no_unfinished_entry(home, monkeypatch):
    def interrupted(file, **arrays):
        file.write(b"half")
        raise SystemExit(143)

    monkeypatch.setattr(np, "savez", interrupted)
    with pytest.raises(SystemExit):
        stored(NAMES[0])
    assert not list(home.iterdir())


@pytest.mark.skipif(sys.platform != "linux", reason="the folder of another platform")
def test_the_cache_is_in_the_folder_of_the_platform(tmp_path, monkeypatch):
    monkeypatch.delenv("SKINWAVE_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.folder() == tmp_path / "skinwave"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)  # as without a home
    assert cache.folder() is None
    assert cache.load("a") is None
    cache.store("a", {}, {"x": np.ones(1)})
