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
KINDS = {
    "scenes": hostile.scenes, "patterns": hostile.patterns, "requests": hostile.requests,
    "special files": hostile.special_files, "meshes": hostile.meshes, "tables": hostile.tables,
}  # fmt: skip
ACCEPTED = (  # because they are unusual, but not wrong
    "scene, 15 MB of comments", "scene, mesh is the scene", "pattern, named '\\x1b[2J'",
    "pattern, named '../../x'", "pattern, named 'None'", "pattern, changed 2",
    "pattern, WAV, RIFF of 4 GB", "table, names that are obeyed, --plot",
    "result, effort.json, changed 0", "result, effort.json, changed 1",
)  # fmt: skip


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
    children, peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, kilobytes("VmHWM")
    # A child has the size of this process until it runs its own program.
    return 1024 * max(peak - had, children if children > max(before, peak) else 0)


def contents(folder):
    return {p: os.lstat(p).st_size for p in folder.rglob("*")}


def check(write, folder, capsys):
    """Run the command; 0 with its output whole, or 2 with one line and nothing left."""
    arguments = write(folder)
    before, at_most = contents(folder), used_since()
    code = main(arguments)
    printed = capsys.readouterr()
    assert used_since(at_most) < MOST
    assert code in (0, 2)
    assert all(c.isprintable() or c == "\n" for c in printed.err + printed.out)
    if code == 2:
        assert printed.err.startswith("skinwave: ")
        assert printed.err.count("\n") == 1
        assert 20 < len(printed.err) < 2000
        assert "Unable to allocate" not in printed.err
        assert contents(folder) == before
    else:
        assert not [p for p in folder.rglob("*") if ".partial" in p.name]
    return code


def check_all(found, tmp_path, monkeypatch, capsys):
    """All that fail are named."""
    failed = {}
    for k, (name, write) in enumerate(found.items()):
        folder = tmp_path / str(k)
        folder.mkdir()
        monkeypatch.chdir(folder)
        try:
            assert check(write, folder, capsys) == (0 if name in ACCEPTED else 2)
        except Exception as error:
            failed[name] = f"{type(error).__name__}: {str(error)[:300]}"
    assert not failed, "\n".join(f"{name}: {said}" for name, said in failed.items())


@pytest.mark.parametrize(
    "kind", [pytest.param(k, marks=[pytest.mark.slow] * (k in ("meshes", "tables"))) for k in KINDS]
)
def test_hostile_files_are_refused(kind, tmp_path, monkeypatch, capsys):
    if kind == "tables":
        pytest.importorskip("pyarrow")
    check_all(KINDS[kind](), tmp_path, monkeypatch, capsys)


@pytest.mark.slow
def test_damaged_result_folders_are_refused(tmp_path_factory, tmp_path, monkeypatch, capsys):
    made = hostile._answered(tmp_path_factory.mktemp("made"))
    check_all(hostile.results(made), tmp_path, monkeypatch, capsys)
