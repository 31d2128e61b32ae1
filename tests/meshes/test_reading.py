"""Files of users come through one door: regular, of limited size, whatever they claim."""

import os
import re
import shutil
import sys

import hostile
import numpy as np
import pytest
import tomli_w

import meshes
from meshes import MeshError, cache, reading, subprocess_call
from skinwave.commands.cli import main
from skinwave.results.motion import check_values
from skinwave.scene.file import loads
from skinwave.system.json_kinds import PLAN, effort_of, fitting

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="no such files")


@POSIX
@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda p: os.symlink("/dev/zero", p)])
def test_only_regular_files_are_opened(tmp_path, make):
    make(tmp_path / "x")
    for read in (reading.text, reading.arrays, reading.parsed):
        with pytest.raises(ValueError, match="x: cannot be read .*; check the path$"):
            read(tmp_path / "x")


def test_a_file_is_as_large_as_the_limit_at_most(tmp_path):
    (tmp_path / "x").write_bytes(b"12345")
    assert reading.content(tmp_path / "x", 5) == b"12345"
    with pytest.raises(ValueError, match="larger"):
        reading.content(tmp_path / "x", 4)


def test_arrays_come_back_and_do_not_unpack_to_more_than_a_limit(tmp_path, monkeypatch):
    np.savez_compressed(tmp_path / "a.npz", x=np.zeros(100_000), y=np.array("text"))
    found = reading.arrays(tmp_path / "a.npz")
    assert found["x"].shape == (100_000,)
    assert str(found["y"]) == "text"
    monkeypatch.setattr(reading, "UNPACKED", 100_000)
    with pytest.raises(ValueError, match="unpacks to 1 MB, the limit is 0 MB"):
        reading.arrays(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", x=np.random.default_rng(0).random(100_000))
    reading.arrays(tmp_path / "b.npz")  # takes as much on the disk


def test_an_archive_has_a_limited_number_of_arrays(tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "MOST_ARRAYS", 3)
    np.savez(tmp_path / "a.npz", *np.eye(3))
    assert len(reading.arrays(tmp_path / "a.npz")) == 3
    np.savez(tmp_path / "a.npz", *np.eye(4))
    with pytest.raises(ValueError, match="holds 4 arrays, the limit is 3"):
        reading.arrays(tmp_path / "a.npz")


def test_an_array_that_is_shorter_than_its_header_tells_is_refused(tmp_path):
    hostile.bomb(tmp_path / "a.npz", 1)
    with pytest.raises(ValueError, match="'t.npy' is shorter than its header tells"):
        reading.arrays(tmp_path / "a.npz")


def test_a_reader_gets_time_and_memory_by_the_size_of_its_file(tmp_path, monkeypatch):
    """A few bytes that ask for a terabyte, and ones that are read for ever."""
    node = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4\n1,1,2,3,4\n"
    path = tmp_path / "a.inp"
    path.write_text(node)
    assert len(meshes.read(path).tets) == 1
    path.write_text(f"{node}*ELSET,ELSET=a,GENERATE\n1,1000000000000,1\n")
    with pytest.raises(MeshError, match="a.inp cannot be read"):
        meshes.read(path)
    for name in ("LEAST_SECONDS", "SECONDS"):
        monkeypatch.setattr(subprocess_call, name, 0.0)
    with pytest.raises(MeshError, match="reading it took longer than 0 s"):
        meshes.read(path)
    monkeypatch.setattr(subprocess_call, "LARGEST", 10)
    with pytest.raises(MeshError, match="larger .* than the limit"):
        meshes.read(path)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="no such limit")
def test_the_limit_of_memory_holds(tmp_path):
    (tmp_path / "hungry.py").write_text("x = bytearray(2_000_000_000)\n")
    with pytest.raises(MeshError, match="MemoryError"):
        subprocess_call.run(tmp_path / "hungry.py", folder=tmp_path, timeout=600, memory=500e6)
    subprocess_call.run(tmp_path / "hungry.py", folder=tmp_path, timeout=600, memory=4e9)


@pytest.mark.parametrize(
    ("value", "pattern", "said"),
    [
        (True, float, "x is no finite number"),
        (10**400, float, "x is no finite number"),
        ([1.0, "a"], [float], r"x\[1\] is no finite number"),
        ({"a": 1}, {str: str}, "x.a is no str"),
        ({"rows": []}, PLAN, "x lacks 'tolerance'"),
        (None, PLAN, "x is no dict"),
    ],
)
def test_what_a_file_holds_is_of_the_kinds_that_are_read(value, pattern, said):
    with pytest.raises(ValueError, match=said):
        fitting(value, pattern, "x")


def test_an_effort_has_known_keys_of_known_kinds():
    assert effort_of({"dofs": 3, "warnings": ["a"]}, "x").warnings == ("a",)
    for table in ({"new": 1}, {"dofs": "3"}, {"warnings": "abc"}, {"seconds": {"a": "b"}}):
        with pytest.raises(ValueError, match="make"):
            effort_of(table, "x")


def test_what_a_response_takes_in_memory_is_refused_first():
    table = hostile.QUICK | {"tacton": {"duration_s": 10.0}}
    probes = {"points_mm": [[0.0, 0.0]] * 501}
    sentence = (
        "501 probes for 10 s at 10000 Hz are 50,100,000 values, the limit is 50,000,000; give"
    )
    with pytest.raises(ValueError, match=re.escape(sentence)):
        loads(tomli_w.dumps(table | {"probes": probes}))
    probes["points_mm"].pop()
    assert len(loads(tomli_w.dumps(table | {"probes": probes})).probes) == 500


def test_what_the_motion_of_a_body_takes_in_memory_is_refused_first():
    check_values(256, 650_000)
    with pytest.raises(ValueError, match="1,000 times of 650,000 nodes are .*, the limit is"):
        check_values(1000, 650_000)


def test_no_home_is_no_cache(monkeypatch):
    for name in ("SKINWAVE_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)  # as without a home
    assert cache.folder() is None
    assert cache.load("a") is None
    cache.store("a", {}, x=np.ones(1))


@pytest.fixture
def result(tmp_path, monkeypatch):
    """A folder of a result of the point kernel."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(hostile.QUICK))
    asked = ["run", "scene.toml", "--model", "point-kernel", "--out", "result", "--quiet"]
    assert main(asked) == 0
    return tmp_path / "result"


@pytest.mark.slow
def test_names_in_a_result_are_no_paths(result, tmp_path):
    """A report writes tables by the names of its scenes."""
    (tmp_path / "several").mkdir()
    for k, name in enumerate(("../../../outside", "/tmp/readers-outside")):
        place = tmp_path / "several" / str(k)
        shutil.copytree(result, place)
        scene = tomli_w.dumps(hostile.QUICK | {"name": name})
        (place / "scene.toml").write_text(scene)
    assert main(["report", "several", "--out", "deep/down/report", "--quiet"]) == 0
    assert {p.name for p in tmp_path.iterdir()} == {"scene.toml", "result", "several", "deep"}
    written = {p.name for p in (tmp_path / "deep/down/report/data").iterdir()}
    assert len([name for name in written if name.endswith("_probes.csv")]) == 2
