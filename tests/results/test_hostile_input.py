"""Hostile files are refused in one sentence, in little memory, and leave nothing behind."""

import os
import re
import sys
from pathlib import Path

import hostile
import pytest

from skinwave.commands.cli import main

if not sys.platform.startswith("linux"):
    pytest.skip("memory is measured by what Linux tells", allow_module_level=True)
import resource

MOST = 1_000_000_000  # bytes
SCENES, PATTERNS = hostile.scenes(), hostile.patterns()
SPECIAL, MESHES, REQUESTS = hostile.special_files(), hostile.meshes(), hostile.requests()


def kilobytes(field):
    status = Path("/proc/self/status").read_text()
    return int(re.search(rf"{field}:\s*(\d+) kB", status).group(1))


def used_since(begun=None):
    """Bytes that this process took at most since the last call without an argument, beside what it
    had from other tests, or a child.
    """
    if begun is None:
        Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
        return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, kilobytes("VmRSS")
    before, had = begun
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    return 1024 * max(kilobytes("VmHWM") - had, children if children > before else 0)


def contents(folder):
    return {p: os.lstat(p).st_size for p in folder.rglob("*")}


def check(write, folder, monkeypatch, capsys):
    """Run the command; 0 or 1 with its output whole, or 2 with one line and nothing left."""
    monkeypatch.chdir(folder)
    arguments = write(folder)
    before = contents(folder)
    at_most = used_since()
    code = main(arguments)
    printed = capsys.readouterr()
    assert used_since(at_most) < MOST
    assert code in (0, 1, 2)
    assert all(c.isprintable() or c == "\n" for c in printed.err + printed.out)
    if code == 2:
        assert printed.err.startswith("skinwave: ")
        assert printed.err.count("\n") == 1
        assert 20 < len(printed.err) < 2000
        assert "Unable to allocate" not in printed.err
        assert contents(folder) == before
    else:
        assert not [p for p in folder.rglob("*") if p.suffix in (".partial", ".part")]
    return code


@pytest.fixture
def folder(tmp_path):
    place = tmp_path / "work"
    place.mkdir()
    return place


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return hostile._answered(tmp_path_factory.mktemp("made"))


def test_the_corpus_is_large_and_the_same_every_time():
    assert len(SCENES) + len(PATTERNS) + len(SPECIAL) + len(MESHES) + len(REQUESTS) > 80
    assert list(hostile.scenes()) == list(SCENES)


@pytest.mark.parametrize("name", SCENES)
def test_scenes(name, folder, monkeypatch, capsys):
    check(SCENES[name], folder, monkeypatch, capsys)


@pytest.mark.parametrize("name", PATTERNS)
def test_patterns(name, folder, monkeypatch, capsys):
    check(PATTERNS[name], folder, monkeypatch, capsys)


@pytest.mark.parametrize("name", SPECIAL)
def test_what_is_no_file(name, folder, monkeypatch, capsys):
    assert check(SPECIAL[name], folder, monkeypatch, capsys) == 2


@pytest.mark.parametrize("name", REQUESTS)
def test_requests(name, folder, monkeypatch, capsys):
    check(REQUESTS[name], folder, monkeypatch, capsys)


@pytest.mark.slow
@pytest.mark.parametrize("name", MESHES)
def test_meshes(name, folder, monkeypatch, capsys):
    assert check(MESHES[name], folder, monkeypatch, capsys) == 2


@pytest.mark.slow
def test_results(made, tmp_path, monkeypatch, capsys):
    check_all(hostile.results(made), tmp_path, monkeypatch, capsys)


@pytest.mark.slow
def test_tables(tmp_path, monkeypatch, capsys):
    pytest.importorskip("pyarrow")
    check_all(hostile.tables(), tmp_path, monkeypatch, capsys)


def check_all(found, tmp_path, monkeypatch, capsys):
    """Every one of some that are made when they are needed; all that fail are named."""
    failed = {}
    for k, (name, write) in enumerate(found.items()):
        folder = tmp_path / str(k)
        folder.mkdir()
        try:
            check(write, folder, monkeypatch, capsys)
        except Exception as error:
            failed[name] = f"{type(error).__name__}: {str(error)[:300]}"
    assert not failed, "\n".join(f"{name}: {said}" for name, said in failed.items())
