"""No half-written result has its name, and nothing of the user's is removed or replaced."""

import csv
import errno
import json
import os
import shlex
import subprocess
import sys
from unittest.mock import Mock

import corpus
import numpy as np
import pytest

from simple_model import Response
from skinwave.commands.cli import READER_GONE, main
from skinwave.results import files, outputs, record
from skinwave.results.outputs import foreign_file, output_file, output_path
from skinwave.results.run import Run
from skinwave.scene.file import loads
from skinwave.studies.album import open_album

RUN = ["run", "none.toml", "--quiet"]
posix = pytest.mark.skipif(sys.platform == "win32", reason="links and pipes differ")
NAMES = (
    "CON", "Nul", "COM1", " CON ", "trailing.", "a/b", "..", "", "a:b*?<>|", "Pictures", "𠀀" * 80,
    "n" * 300, "\x1b[31m", "name\u202e",
)  # fmt: skip


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "none.toml").write_text(corpus.SILENT_GROUND)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def make(out, text="one", meanwhile=lambda: None, **options):
    with outputs.output_folder(out, **options) as place:
        meanwhile()
        (place / "index.html").write_text(text)
        record.write(place, {"typed": "", "name": "run", "options": {}})
    return out


def a_run(name="small"):
    scene = loads(corpus.SILENT_GROUND.replace('"small"', f'"{name}"'))
    response = Response(
        model="point-kernel", times=np.arange(4) / 100, probes=scene.probe_points,
        quantity="pressure", values=np.zeros((4, len(scene.probes))),
    )  # fmt: skip
    return Run(tacton=name, body="none", scene=scene, response=response)


def test_a_result_is_replaced_with_overwrite_only(folder, refused):
    assert main([*RUN, "--out", "out"]) == 0
    assert "--overwrite" in refused(*RUN, "--out", "out")
    assert main([*RUN, "--out", "out", "--overwrite"]) == 0
    assert {p.name for p in folder.iterdir()} == {"none.toml", "out"}


def test_what_skinwave_did_not_write_is_never_replaced(folder, refused):
    again = [*RUN, "--out", "out", "--overwrite"]
    (folder / "out").mkdir()
    (folder / "out/thesis.tex").write_text("mine")
    for fake in (None, "", "{}", '{"files": {"thesis.tex": 4}}'):
        if fake is not None:
            (folder / "out/record.json").write_text(fake)
        assert "not written by skinwave" in refused(*again)


@posix
def test_a_file_that_the_user_added_or_changed_is_kept(folder):
    out = make(folder / "out")
    make(out / "report")
    (out / ".DS_Store").write_text("of the system")
    assert foreign_file(out) is None
    for name in ("deeper/notes.txt", "index.html", "mine/record.json", "report/index.html"):
        path = out / name
        kept = path.read_text() if path.exists() else None
        path.parent.mkdir(exist_ok=True)
        path.write_text("mine")
        assert foreign_file(out) == path
        with pytest.raises(ValueError, match=name):
            make(out, overwrite=True)
        path.unlink() if kept is None else path.write_text(kept)
    (out / "index.html").rename("elsewhere")
    (out / "index.html").symlink_to("../elsewhere")
    assert foreign_file(out) == out / "index.html"


def test_inputs_are_never_replaced(folder, refused, monkeypatch):
    out = make(folder / "out")
    (out / "none.toml").write_text(corpus.SILENT_GROUND)
    outputs.seal(out)
    asked = ["run", "out/none.toml", "--out", "out", "--overwrite", "--quiet"]
    assert "in use" in refused(*asked)
    refused("convert", "none.toml", "none.toml", "--overwrite", "--quiet")
    monkeypatch.chdir(out)
    assert "in use" in refused(*RUN, "--out", "..", "--overwrite")


def test_results_of_concurrent_commands_are_kept(folder):
    with pytest.raises(ValueError, match="partial-") as error:
        make(folder / "out", "later", meanwhile=lambda: make(folder / "out", "first"))
    (later,) = folder.glob("out.partial-*")
    assert str(later) in str(error.value)
    assert (later / "index.html").read_text() == "later"
    assert (folder / "out/index.html").read_text() == "first"
    notes = folder / "out/notes.txt"
    with pytest.raises(ValueError, match=r"notes\.txt"):
        make(folder / "out", "new", overwrite=True, meanwhile=lambda: notes.write_text("mine"))
    assert notes.read_text() == "mine"
    assert (folder / "out/index.html").read_text() == "first"


def test_an_error_keeps_the_earlier_result(folder):
    interrupted = Mock(side_effect=KeyboardInterrupt)
    make(folder / "out", "old")
    before = corpus.contents(folder)
    with pytest.raises(KeyboardInterrupt):  # without a finished run
        make(folder / "out", overwrite=True, meanwhile=interrupted)
    with pytest.raises(ZeroDivisionError):
        make(folder / "out", overwrite=True, meanwhile=lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError), output_file(folder / "file.csv") as file:
        file.write(b"%d" % (1 / 0))
    assert corpus.contents(folder) == before


@posix
def test_a_killed_process_leaves_the_earlier_result(folder):
    make(folder / "out", "old")
    code = (
        "import os, sys, skinwave.results.record as record\n"
        "record.write = lambda *given, **options: os._exit(9)\n"
        "from skinwave.commands.cli import main\n"
        "main(sys.argv[1:])"
    )
    words = [sys.executable, "-c", code, *RUN, "--overwrite", "--out", "out"]
    assert subprocess.run(words, check=False).returncode == 9
    assert (folder / "out/index.html").read_text() == "old"


def test_an_interrupted_report_keeps_finished_runs(folder, capsys, monkeypatch):
    def interrupted(results, out, *given, **options):
        files.write_run(out / "point-kernel", a_run())
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("skinwave.studies.album.write_album", lambda *given, **options: ([], []))
        patch.setattr("skinwave.studies.report.write_report", interrupted)
        asked = ["report", "none.toml", "--style", "talk", "--quiet", "--out", "a report"]
        assert main(asked) == 1
    said = capsys.readouterr().err
    (left,) = folder.glob("a report.partial-*")
    assert str(left) in said
    command = said.split("; ")[-1].removesuffix(" makes a page of them\n")
    words = shlex.split(command)
    assert words[0] == "skinwave"
    assert main([*words[1:], "--quiet"]) == 0
    assert (left / "report/index.html").read_text().rstrip().endswith("</html>")


def test_an_incomplete_run_is_removed(folder, monkeypatch):
    full = Mock(side_effect=OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    files.write_run(folder / "out/one", a_run())
    monkeypatch.setattr("skinwave.results.files.write_lines", full)
    with pytest.raises(OSError, match="space"):
        files.write_run(folder / "out/two", a_run())
    assert [run.tacton for run in open_album(folder / "out").runs] == ["small"]


def test_a_full_disk_is_reported_in_one_sentence(folder, refused, monkeypatch):
    def full(path, *given, **options):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    with monkeypatch.context() as patched:  # `undo` would leave the folder of this test, too
        patched.setattr("pathlib.Path.write_text", full)
        assert "space" in refused(*RUN, "--out", "out")
    assert "nnn" in refused(*RUN, "--out", "n" * 300)


def test_a_file_is_written_completely_or_not_at_all(folder):
    with output_path(folder / "o.csv") as aside:
        aside.write_text("later")
        assert not (folder / "o.csv").exists()
    with pytest.raises(ValueError, match="--overwrite"), output_path(folder / "o.csv"):
        pass
    with output_file(folder / "o.csv", overwrite=True) as file:
        file.write(b"new")
    assert (folder / "o.csv").read_text() == "new"
    assert len([*folder.iterdir()]) == 2


@posix
def test_a_closed_pipe_ends_a_command_quietly(folder):
    read_end, write_end = os.pipe()
    os.close(read_end)
    words = [sys.executable, "-m", "skinwave", "plan", "none.toml"]
    ended = subprocess.run(words, stdout=write_end, stderr=subprocess.PIPE, check=False)
    os.close(write_end)
    assert ended.returncode in (0, READER_GONE)
    assert ended.stderr == b""


def test_a_record_names_command_scene_model_and_files(folder):
    assert main([*RUN, "--out", "out"]) == 0
    found = record.read(folder / "out")
    assert found["command"]["name"] == "run"
    assert found["command"]["typed"].startswith("skinwave run none.toml")
    assert loads(found["scene"]).tacton == loads(corpus.SILENT_GROUND).tacton
    assert found["model"] == "point-kernel"
    assert set(outputs.listed_files(folder / "out")) >= {"responses.npz", "lines.csv", "index.html"}
    rows = [*csv.DictReader((folder / "out/lines.csv").read_text().splitlines())]
    assert {row["model"] for row in rows} == {"point-kernel"}
    (folder / "out/record.json").write_text(json.dumps([1]))
    with pytest.raises(ValueError, match=r"record\.json"):
        record.read(folder / "out")


def test_folder_names_are_valid_on_any_system():
    for name in NAMES:
        plain = files.folder_name(name)
        assert plain == plain.strip()
        assert plain.isprintable()
        assert 0 < len(plain.encode()) <= 210
        assert not {*plain} & {*'<>:"/\\|?*.'}
        assert plain.casefold() not in ("con", "nul", "com1", "pictures")
    found = files.distinct_names(["Tap", "tap", "TAP_2", "a/b", "a:b", "tap"])
    assert len({name.casefold() for name in found}) == 6
