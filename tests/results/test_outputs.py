"""Nothing of the user's is removed, replaced or truncated, whatever it is called."""

import errno
import hashlib
import json
import os
import shlex
import shutil
import subprocess
import sys
from argparse import Namespace
from pathlib import Path

import corpus
import numpy as np
import pytest

from simple_model import Response
from skinwave.commands.cli import main
from skinwave.results import exports, files, marks, record
from skinwave.results.outputs import output_file, output_folder, output_path
from skinwave.results.run import Run
from skinwave.scene.file import loads
from skinwave.studies.album import open_album
from skinwave.sweeps import dataset

posix = pytest.mark.skipif(sys.platform == "win32", reason="links, permissions and pipes differ")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a scene that takes no time to compute."""
    (tmp_path / "none.toml").write_text(corpus.SILENT_GROUND)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def made(out, text="one", meanwhile=lambda: None, **options):
    """A folder as a command writes it, and what happens until it is finished."""
    with output_folder(out, **options) as place:
        meanwhile()
        (place / "index.html").write_text(text)
        record.write(place, {"typed": "", "name": "run", "options": {}})
    return out


def a_run(name="small"):
    """A result, of a silent scene."""
    scene = loads(corpus.SILENT_GROUND.replace('"small"', f'"{name}"'))
    times = np.arange(4) / 100
    response = Response(
        model="point-kernel", times=times, probes=scene.probe_points, quantity="pressure",
        values=np.zeros((4, len(scene.probes))),
    )  # fmt: skip
    return Run(tacton=name, body="none", scene=scene, response=response)


def refused(capsys, *arguments):
    """The one sentence by which a command is refused; all that is there stays as it was."""
    before = corpus.contents(Path.cwd())
    assert main([*map(str, arguments)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1, said
    assert corpus.contents(Path.cwd()) == before
    return said


RUN = ["run", "none.toml", "--quiet"]


# Temporary names


def test_folders_and_files_of_the_user_beside_an_output_stay(folder, capsys):
    for name in ("out.partial", "out.partial-1", "out.replaced-1", "none-out.partial", "o.part"):
        (folder / name).mkdir()
        (folder / name / "note").write_text("mine")
    for name in ("o.csv.partial", "o.partial.csv", ".o.partial.csv", "none.partial.gif"):
        (folder / name).write_text("mine")
    before = corpus.contents(folder)
    assert main([*RUN, "--out", "out"]) == 0
    assert main([*RUN, "--out", "out", "--overwrite"]) == 0
    assert main(["convert", "none.toml", "o.csv", "--rate", "1000", "--quiet"]) == 0
    shutil.rmtree("out")
    (folder / "o.csv").unlink()
    assert corpus.contents(folder) == before


@posix
def test_nothing_is_written_through_a_link_at_a_temporary_name(folder, capsys, monkeypatch):
    (folder / "precious").write_text("mine")
    tokens = iter(["taken", "free"])
    monkeypatch.setattr("secrets.token_hex", lambda n: next(tokens))
    (folder / ".o.partial-taken.csv").symlink_to("precious")
    (folder / "o.csv.partial").symlink_to("precious")
    assert main(["convert", "none.toml", "o.csv", "--rate", "1000", "--quiet"]) == 0
    assert (folder / "precious").read_text() == "mine"
    assert (folder / ".o.partial-taken.csv").is_symlink()
    assert (folder / "o.csv").stat().st_size > 4


@pytest.mark.parametrize("refusal", ["wrong.toml o.csv", "none.toml o.csv", "none.toml kept.csv"])
def test_a_refused_conversion_touches_nothing(folder, capsys, refusal):
    (folder / "wrong.toml").write_text("[")
    for name in ("o.csv.partial", "kept.csv.partial", "kept.csv"):
        (folder / name).write_text("mine")
    rate = "1000" if "kept" in refusal else "-1"
    refused(capsys, "convert", *refusal.split(), "--rate", rate, "--quiet")


def test_what_is_read_is_never_replaced(folder, capsys):
    shutil.copy("none.toml", "base.toml")
    for target in ("none.toml", "base.toml"):
        asked = ["convert", "none.toml", target, "--scene", "base.toml", "--overwrite"]
        assert "is read by this command" in refused(capsys, *asked)
    (folder / "slab.vtu").write_text("a mesh")
    mesh = ["mesh", "slab.vtu", "--out", "slab.vtu", "--overwrite", "--quiet"]
    assert "is read by this command" in refused(capsys, *mesh)


@posix
def test_new_outputs_have_the_usual_permissions_and_replaced_ones_their_own(folder):
    before = os.umask(0o027)
    try:
        made(folder / "out")
        with output_file(folder / "file") as file:
            file.write(b"1")
    finally:
        os.umask(before)
    assert (folder / "out").stat().st_mode & 0o777 == 0o750
    assert (folder / "file").stat().st_mode & 0o777 == 0o640
    (folder / "out").chmod(0o700)
    (folder / "file").chmod(0o600)
    made(folder / "out", overwrite=True)
    with output_file(folder / "file", overwrite=True) as file:
        file.write(b"2")
    assert (folder / "out").stat().st_mode & 0o777 == 0o700
    assert (folder / "file").stat().st_mode & 0o777 == 0o600


@posix
def test_what_is_no_regular_file_is_not_replaced(folder):
    """As a device is none, which is not tried on one that the machine needs."""
    os.mkfifo("fifo")
    with (
        pytest.raises(ValueError, match="no regular file"),
        output_file(folder / "fifo", overwrite=True),
    ):
        pass
    assert (folder / "fifo").is_fifo()


def test_a_name_of_any_length_that_the_system_has_is_written(folder):
    made(folder / ("n" * 250))
    with output_file(folder / ("n" * 250 + ".csv")) as file:
        file.write(b"1")
    assert len([*folder.iterdir()]) == 3


# Two at once


def test_of_two_runs_into_one_folder_neither_is_lost(folder):
    """Another process writes the same folder and ends first; this one says where its result is."""
    command = [sys.executable, "-m", "skinwave", *RUN, "--out", "out"]
    with pytest.raises(ValueError, match="meanwhile and is kept") as error:
        made(folder / "out", "later", meanwhile=lambda: subprocess.run(command, check=True))
    assert marks.listed(folder / "out").keys() >= {"index.html", "responses.npz"}
    (later,) = folder.glob("out.partial-*")
    assert str(later) in str(error.value)
    assert (later / "index.html").read_text() == "later"
    assert marks.listed(later) == {"index.html": hashlib.sha256(b"later").hexdigest()}


def test_of_two_that_may_overwrite_neither_new_result_is_lost(folder):
    made(folder / "out", "old")

    def first():
        made(folder / "out", "first", overwrite=True)

    with pytest.raises(ValueError, match="meanwhile and is kept"):
        made(folder / "out", "later", meanwhile=first, overwrite=True)
    assert (folder / "out/index.html").read_text() == "first"
    assert (next(folder.glob("out.partial-*")) / "index.html").read_text() == "later"


def test_a_file_that_appears_meanwhile_is_kept(folder):
    def both():
        with output_path(folder / "o.csv") as aside:
            aside.write_text("later")
            (folder / "o.csv").write_text("first")

    with pytest.raises(ValueError, match="meanwhile and is kept") as error:
        both()
    assert (folder / "o.csv").read_text() == "first"
    (later,) = folder.glob(".o.partial-*.csv")
    assert str(later) in str(error.value)
    assert later.read_text() == "later"


def test_notes_that_are_added_during_a_run_are_kept(folder):
    made(folder / "out", "old")

    def noted():
        (folder / "out/notes.txt").write_text("mine")

    with pytest.raises(ValueError, match="meanwhile and is kept"):
        made(folder / "out", "new", meanwhile=noted, overwrite=True)
    assert (folder / "out/notes.txt").read_text() == "mine"
    assert (folder / "out/index.html").read_text() == "old"


def test_a_folder_that_the_user_removed_meanwhile_is_written_anew(folder):
    made(folder / "out", "old")
    made(folder / "out", "new", meanwhile=lambda: shutil.rmtree("out"), overwrite=True)
    assert (folder / "out/index.html").read_text() == "new"


# Marks


FAKES = ["", "{}", '{"format": 1, "command": {"options": {}}}', '{"files": {"note": 4}}', "\x00"]


@pytest.mark.parametrize("fake", FAKES)
def test_a_file_that_is_called_record_is_no_mark(folder, capsys, fake):
    (folder / "mine").mkdir()
    (folder / "mine/note").write_text("mine")
    (folder / "mine/record.json").write_text(fake)
    said = refused(capsys, *RUN, "--out", "mine", "--overwrite")
    assert "was not written by skinwave" in said


def test_an_empty_folder_may_be_replaced(folder):
    (folder / "out").mkdir()
    made(folder / "out", overwrite=True)
    assert (folder / "out/index.html").exists()


def test_what_the_user_added_or_changed_in_a_result_is_not_lost(folder, capsys):
    assert main([*RUN, "--out", "out"]) == 0
    again = [*RUN, "--out", "out", "--overwrite"]
    (folder / "out/.DS_Store").write_text("of the system")
    assert main(again) == 0
    for name, text in (("notes.txt", "mine"), ("deeper/notes.txt", "mine"), ("lines.csv", "mine")):
        path = folder / "out" / name
        path.parent.mkdir(exist_ok=True)
        before = path.read_bytes() if path.exists() else None
        path.write_text(text)
        assert f"holds {name}, which was added or changed" in refused(capsys, *again)
        path.unlink() if before is None else path.write_bytes(before)
    (folder / "out/index.html").unlink()  # what is gone is no loss
    assert main(again) == 0


def test_an_edit_that_keeps_the_size_is_not_lost(folder, capsys):
    made(folder / "out", "one")
    (folder / "out/index.html").write_text("two")
    assert "holds index.html" in refused(capsys, *RUN, "--out", "out", "--overwrite")


@pytest.mark.parametrize("text", ["two", "three"])
def test_a_list_of_sizes_is_still_read(folder, text):
    made(folder / "out", "one")
    kept = record.read(folder / "out") | {"files": {"index.html": 3}}
    (folder / "out/record.json").write_text(json.dumps(kept))
    (folder / "out/index.html").write_text(text)
    assert (marks.foreign(folder / "out") is None) == (len(text) == 3)


@pytest.mark.parametrize("place", ["out/mine", "out/report", "out/report/mine", "out/a/report"])
def test_a_result_within_another_is_not_lost(folder, capsys, drawn, place):
    assert main([*RUN, "--out", "out"]) == 0
    if place == "out/report/mine":
        assert main(["report", "out", "--quiet"]) == 0
    assert main([*RUN, "--out", place]) == 0
    assert "which was added or changed" in refused(capsys, *RUN, "--out", "out", "--overwrite")
    if place == "out/report/mine":
        assert "holds mine/" in refused(capsys, "report", "out", "--quiet")


def test_the_report_of_a_scene_within_a_result_is_not_lost(folder):
    out = made(folder / "out")
    made(out / "report")
    command = {"typed": "", "name": "report", "options": {}}
    record.write(out / "report", command)
    marks.seal(out / "report")
    assert marks.foreign(out) is None
    record.write(out / "report", command, scene=loads(corpus.SILENT_GROUND))
    marks.seal(out / "report")
    assert out / "report" in marks.foreign(out).parents


@posix
@pytest.mark.parametrize("note", [True, False])
def test_folders_of_any_depth_in_a_result_are_kept(folder, note):
    """Deeper than Python's recursion."""
    made(folder / "out")
    deep = "d/" * 1100
    os.makedirs(folder / "out/d")
    for k in range(100, 1101, 100):
        os.makedirs(folder / "out" / deep[: 2 * k], exist_ok=True)
    if note:
        (folder / "out" / deep / "note").write_text("mine")
    try:
        with pytest.raises(ValueError, match="which was added or changed"):
            made(folder / "out", overwrite=True)
        assert (folder / "out" / deep).is_dir()
    finally:  # which pytest cannot remove
        for place in folder.glob("out*"):
            subprocess.run(["rm", "-r", str(place)], check=True)


@posix
def test_a_link_in_a_result_is_the_users(folder, capsys):
    assert main([*RUN, "--out", "out"]) == 0
    shutil.move("out/lines.csv", "elsewhere.csv")
    (folder / "out/lines.csv").symlink_to("../elsewhere.csv")
    assert "holds lines.csv" in refused(capsys, *RUN, "--out", "out", "--overwrite")


def test_the_scene_of_a_command_is_not_replaced_by_its_result(folder, capsys):
    assert main([*RUN, "--out", "out"]) == 0
    said = refused(capsys, "run", "out/scene.toml", "--out", "out", "--overwrite", "--quiet")
    assert "which this command reads" in said
    assert "which this command reads" in refused(
        capsys, "report", "out", "--out", "out", "--overwrite", "--quiet"
    )
    assert "holds the result that is repeated" in refused(
        capsys, "rerun", "out", "--out", "out", "--overwrite", "--quiet"
    )


def test_the_mesh_of_a_scene_is_not_replaced_by_its_result(folder, capsys):
    out = made(folder / "out")
    (out / "hand.stl").write_text("solid")
    marks.seal(out)
    (folder / "hand.toml").write_text(
        "[tacton]\nduration_s = 0.02\n[body]\nkind = 'mesh'\nfile = 'out/hand.stl'\n"
    )
    for command in ("run", "compare", "tradeoff", "relax", "report"):
        said = refused(capsys, command, "hand.toml", "--out", "out", "--overwrite", "--quiet")
        assert "hand.stl, which this command reads" in said


def test_the_current_folder_and_those_above_are_not_replaced(folder, capsys, monkeypatch):
    made(folder / "out")
    (folder / "out/deeper").mkdir()
    monkeypatch.chdir(folder / "out/deeper")
    shutil.copy(folder / "none.toml", "none.toml")
    for out in (".", "..", str(folder / "out")):
        assert "holds the current folder" in refused(capsys, *RUN, "--out", out, "--overwrite")


@pytest.fixture
def drawn(monkeypatch):
    """A report that is a page without pictures."""

    def write(results, out, *given, **options):
        open_album(results)
        (out / "index.html").write_text("<html></html>")

    monkeypatch.setattr("skinwave.studies.scene_report.write_report", write)


def test_a_report_replaces_only_a_report(folder, capsys, drawn):
    assert main([*RUN, "--out", "out"]) == 0
    (folder / "out/report").mkdir()
    (folder / "out/report/thesis.tex").write_text("mine")
    assert "was not written by skinwave" in refused(capsys, "report", "out", "--quiet")
    shutil.rmtree("out/report")
    for _ in range(2):  # its own is made anew
        assert main(["report", "out", "--quiet"]) == 0
    (folder / "out/report/notes.txt").write_text("mine")
    assert "holds notes.txt" in refused(capsys, "report", "out", "--quiet")
    assert "holds report/notes.txt" in refused(capsys, *RUN, "--out", "out", "--overwrite")
    (folder / "out/report/notes.txt").unlink()
    assert main([*RUN, "--out", "out", "--overwrite"]) == 0  # with the report in it
    assert not (folder / "out/report").exists()


@posix
def test_a_report_is_not_written_through_a_link(folder, capsys, drawn):
    assert main([*RUN, "--out", "out"]) == 0
    (folder / "outside").mkdir()
    (folder / "out/report").symlink_to("../outside/new")
    assert "report is a link" in refused(capsys, "report", "out", "--quiet")
    assert not [*(folder / "outside").iterdir()]


def page(folder, *given):
    (folder / "index.html").write_text("<html></html>")


@pytest.mark.parametrize("command", ["run", "relax", "tradeoff", "verify", "report", "rerun",
                                     "relax paper-vs-skin",
                                     pytest.param("compare", marks=pytest.mark.slow)])  # fmt: skip
@pytest.mark.usefixtures("in_one_process")
def test_folders_of_every_command_are_marked_and_replaced(folder, monkeypatch, drawn, command):
    """Every command that writes a folder; what is slow is not computed here."""
    found = Namespace(effects=list, steps=[], every=[], accepted=[], failed=[])
    for name in ("relax.hierarchy_of", "tradeoff.study", "mechanisms.paper_vs_skin"):
        monkeypatch.setattr(f"skinwave.studies.{name}", lambda *given, **options: found)
    for name in ("relax_page.write", "tradeoff.write", "mechanisms.write"):
        monkeypatch.setattr(f"skinwave.studies.{name}", page)
    for name in ("tradeoff.sentences", "mechanisms.sentences"):
        monkeypatch.setattr(f"skinwave.studies.{name}", lambda found: [])
    monkeypatch.setattr("skinwave.verify.suite.run_suite", lambda e, folder, *p, **o: [])
    monkeypatch.setattr("skinwave.verify.page.summary_table", lambda results: "")
    monkeypatch.setattr(
        "skinwave.studies.album.make",
        lambda folder, scene, *p, **o: files.write_run(folder / "none", a_run()) or [],
    )
    name, *scene = [*command.split(), "none.toml"][:2]
    (folder / "slab.toml").write_text(corpus.GOOD)  # one small body, not those of the paper
    asked = {"verify": ["--quick"], "compare": ["slab.toml", "--h", "8"]}.get(name, scene)
    if name == "rerun":
        assert main([*RUN, "--out", "first"]) == 0
        asked = ["first"]
    for _ in range(2):
        code = main([name, *asked, "--out", "out", "--overwrite", "--quiet"])
        assert code == (1 if name == "verify" else 0)
        assert marks.listed(folder / "out") is not None
        assert marks.foreign(folder / "out") is None
    (folder / "out/notes.txt").write_text("mine")
    assert marks.foreign(folder / "out") == folder / "out/notes.txt"


# Sweeps

SWEEP = ["sweep", "none.toml", "--vary", "tacton.am_frequency_hz=100,200", "--scheduler", "threads",
         "--workers", "1", "--quiet"]  # fmt: skip


def test_a_sweep_goes_on_beside_notes_and_what_a_killed_one_left(folder):
    assert main([*SWEEP, "--csv"]) == 0
    assert record.read(folder / "none-sweep")["command"]["name"] == "sweep"
    (folder / "none-sweep/notes.txt").write_text("mine")
    (folder / "none-sweep/rows/.part-x.partial-1.parquet").write_bytes(b"half")
    assert main([*SWEEP, "--csv"]) == 0
    assert (folder / "none-sweep/notes.txt").read_text() == "mine"
    assert len([*(folder / "none-sweep/rows").glob("part-*.parquet")]) == 2


def test_a_sweep_of_a_release_without_records_goes_on(folder):
    assert main(SWEEP) == 0
    (folder / "none-sweep/record.json").unlink()
    assert main(SWEEP) == 0


def test_foreign_files_among_the_rows_of_a_sweep_are_refused(folder, capsys):
    import pyarrow as pa
    import pyarrow.parquet as pq

    (folder / "photos/rows").mkdir(parents=True)
    (folder / "photos/cat.jpg").write_text("mine")
    assert "holds no sweep" in refused(capsys, *SWEEP, "--out", "photos")
    assert main(SWEEP) == 0
    rows = folder / "none-sweep/rows"
    pq.write_table(pa.table({"price": [1.0]}), rows / "part-mine.parquet")
    assert "part-mine.parquet holds no rows of a sweep" in refused(capsys, *SWEEP)
    (rows / "part-mine.parquet").write_text("no Parquet")
    assert "part-mine.parquet holds no rows of a sweep" in refused(capsys, *SWEEP)
    (rows / "part-mine.parquet").rename(rows / "table.csv")
    assert "table.csv holds no rows of a sweep" in refused(capsys, *SWEEP)
    (rows / "table.csv").unlink()
    (folder / "none-sweep/rows.csv").write_text("mine,too\n1,2\n")
    assert "rows.csv holds no rows of a sweep" in refused(capsys, *SWEEP)


def test_two_sweeps_that_begin_with_the_same_row_only_add(folder):
    out = dataset.open_folder(folder / "out")
    for keys in (["a", "b", "c"], ["a", "d"]):
        rows = [{"key": key, "status": "done"} for key in keys]
        dataset.append(out, rows, {"key": "text", "status": "text"})
    assert {row["key"] for row in dataset.read(out)} == {*"abcd"}


def test_figures_elsewhere_are_kept(folder, capsys):
    assert main(SWEEP) == 0
    drawing = ["plot", "none-sweep", "--column", "kernel_peak_pa", "--quiet"]
    for _ in range(2):  # its own
        assert main(drawing) == 0
    assert main([*drawing, "--out", "elsewhere"]) == 0
    assert "exists and is kept" in refused(capsys, *drawing, "--out", "elsewhere")
    assert main([*drawing, "--out", "elsewhere", "--overwrite"]) == 0


DRAWING = ["plot", "none-sweep", "--column", "kernel_peak_pa", "--quiet"]


@pytest.fixture
def table(folder):
    """The folder of a sweep with its table and a figure; what is drawn and listed is its own."""
    assert main([*SWEEP, "--csv"]) == 0
    assert main(DRAWING) == 0
    assert main([*SWEEP, "--csv"]) == 0
    assert main(DRAWING) == 0
    return folder / "none-sweep"


def test_a_figure_or_table_of_the_users_in_a_sweep_is_kept(table, capsys):
    (figure,) = (table / "figures").iterdir()
    for path, command in ((figure, DRAWING), (table / "rows.csv", [*SWEEP, "--csv"])):
        text = path.read_bytes()
        path.write_bytes(text[:-1] + b"!")
        assert f"{path.name} was added or changed" in refused(capsys, *command)
        path.write_bytes(text)
        assert main(command) == 0
    assert "holds " in refused(capsys, *RUN, "--out", "none-sweep", "--overwrite")
    figure.write_text("mine")
    assert main([*DRAWING, "--overwrite"]) == 0
    assert main(DRAWING) == 0


@posix
def test_no_link_in_a_sweep_is_written_through(table, capsys):
    (figure,) = (table / "figures").iterdir()
    asked = [(figure, DRAWING), (table / "figures", DRAWING), (table / "record.json", DRAWING),
             (table / "rows.csv", [*SWEEP, "--csv"])]  # fmt: skip
    for path, command in asked:
        path.rename(table.parent / "elsewhere")
        path.symlink_to(table.parent / "elsewhere")
        assert f"{path.name} is a link" in refused(capsys, *command)
        path.unlink()
        (table.parent / "elsewhere").rename(path)
        assert main(command) == 0


def test_a_figure_of_a_sweep_without_record_is_drawn_again(table):
    (table / "record.json").unlink()
    shutil.rmtree(table / "figures")
    for _ in range(2):
        assert main(DRAWING) == 0


def test_names_of_columns_are_no_formulas(folder):
    out = dataset.open_folder(folder / "out")
    dataset.write_csv(out, [{"key": "a", "=1+1": "=1+1"}])
    assert (out / "rows.csv").read_text().splitlines() == ["key,'=1+1", "a,'=1+1"]


# Interrupts


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit])
def test_a_signal_does_not_stop_a_removal_halfway(folder, monkeypatch, error):
    removed, signals = shutil.rmtree, iter([error])

    def signalled(path, **options):
        if signal := next(signals, None):
            raise signal
        removed(path, **options)

    monkeypatch.setattr("shutil.rmtree", signalled)
    before = corpus.contents(folder)

    def fails():
        raise RuntimeError

    with pytest.raises(error):
        made(folder / "new/out", meanwhile=fails)
    assert corpus.contents(folder) == before


def test_an_interrupted_report_says_which_command_finishes_it(folder, capsys, monkeypatch):
    def make(place, scene, *given, **options):
        files.write_run(place / "point-kernel", a_run(), by="waves")
        return []

    def interrupted(results, out, *given, **options):
        (out / "pictures").mkdir()
        (out / "pictures/half.png").write_bytes(b"half")
        (out / "plan.json").write_text('{"half": ')
        (out / "trust.json").write_text("{}")
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("skinwave.studies.album.make", make)
        patch.setattr("skinwave.studies.scene_report.write_report", interrupted)
        asked = ["report", "none.toml", "--style", "talk", "--format", "svg", "--quiet"]
        assert main([*asked, "--out", "a report"]) == 1
    (said,) = capsys.readouterr().err.splitlines()
    (left,) = folder.glob("a report.partial-*")
    assert str(left) in said
    assert sorted(p.name for p in left.iterdir()) == ["point-kernel", "trust.json"]
    command = said.split("; ")[-1].removesuffix(" makes a page of them")
    assert command.endswith("--style talk --format svg")
    words = shlex.split(command)
    assert words[0] == "skinwave"
    assert main([*words[1:], "--quiet"]) == 0
    assert (left / "report/index.html").read_text().rstrip().endswith("</html>")
    assert [*(left / "report/pictures").glob("*.svg")]


def test_an_interrupt_without_a_finished_run_leaves_nothing(folder, capsys, monkeypatch):
    def interrupted(place, *given, **options):
        (place / "half").mkdir()
        (place / "half/responses.npz").write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr("skinwave.studies.album.make", interrupted)
    before = corpus.contents(folder)
    assert main(["report", "none.toml", "--out", "new/out", "--quiet"]) == 1
    assert "nothing was finished" in capsys.readouterr().err
    assert corpus.contents(folder) == before


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit, OSError])
def test_half_a_run_is_none(folder, monkeypatch, error):
    """Files left of a run that is written while another is there can be opened."""

    def fails(path, effort):
        raise error

    files.write_run(folder / "out/one", a_run())
    monkeypatch.setattr("skinwave.results.files.write_effort", fails)
    with pytest.raises(error):
        files.write_run(folder / "out/two", a_run())
    assert [p.name for p in (folder / "out").iterdir()] == ["one"]
    monkeypatch.setattr("shutil.rmtree", lambda *given, **options: None)  # as if it were killed
    with pytest.raises(error):
        files.write_run(folder / "out/two", a_run())
    assert len(open_album(folder / "out").runs) == 1


# Names


DEVICES = ["CON", "con", "Nul", "COM1", "lpt9", "PRN", "aux", "COM¹", " CON ", "nul."]
ODD = ["trailing.", "trailing ", "a/b", "..", ".", "", "a:b", "a*?<>|b", "Figures", "OVERVIEW",
       "𠀀" * 80, "n" * 300, "ends at the cut " * 6, "\x1b[31m", "name\u202e"]  # fmt: skip


@pytest.mark.parametrize("name", DEVICES + ODD)
def test_any_name_is_a_safe_one_on_any_system(name):
    plain = files.folder_name(name)
    assert plain == plain.strip()
    assert plain.isprintable()
    assert 0 < len(plain.encode()) <= 210
    assert not {*plain} & {*'<>:"/\\|?*.'}
    assert plain.casefold() not in ("con", "nul", "com1", "lpt9", "prn", "aux", "com¹", "figures",
                                    "overview", "propagation")  # fmt: skip


def test_names_that_differ_in_capitals_only_are_told_apart():
    found = files.distinct_names(["Tap", "tap", "TAP_2", "a/b", "a:b", "tap"])
    assert len({name.casefold() for name in found}) == 6
    assert found[:2] == ["Tap", "tap_2"]


def test_names_of_results_do_not_lead_out_of_a_report(folder):
    from skinwave.studies.scene_report import _write_data

    for k, name in enumerate(("../../up", "Twin", "twin", "v1.2")):
        files.write_run(folder / f"out/{k}", a_run(name))
    before = corpus.contents(folder)
    _write_data(folder / "data", open_album(folder / "out"))
    new = {*corpus.contents(folder)} - {*before} - {folder / "data"}
    assert {path.parent for path in new} == {folder / "data"}
    assert len({p.name.casefold() for p in new if p.name.endswith("_probes.csv")}) == 4


def test_the_column_of_a_view_does_not_lead_out_of_a_report(folder, monkeypatch):
    view = Namespace(column="../../up", times=np.arange(2), tets=(), tensors=None)
    monkeypatch.setattr(
        "skinwave.results.exports._grid",
        lambda *asked: Namespace(save=lambda p: p.write_text("grid")),
    )
    (folder / "data").mkdir()
    exports.write_field(folder / "data", view)
    assert {path.parent for path in folder.rglob("*up*")} == {folder / "data"}


# What the system says


@posix
@pytest.mark.parametrize(
    ("command", "unbuffered"), [("plan none.toml", ""), ("plan none.toml", "1"), ("--help", "")]
)
def test_a_reader_that_is_gone_ends_a_command_quietly(folder, command, unbuffered):
    read_end, write_end = os.pipe()
    os.close(read_end)
    words = [sys.executable, "-m", "skinwave", *command.split()]
    ended = subprocess.run(
        words, stdout=write_end, stderr=subprocess.PIPE, check=False,
        env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
    )  # fmt: skip
    os.close(write_end)
    assert ended.stderr == b""
    assert ended.returncode == 141


@posix
def test_a_pipe_to_a_helper_is_not_taken_for_standard_output(folder, capsys, monkeypatch):
    def broken(*given, **options):
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")

    monkeypatch.setattr("skinwave.commands.run.required_plan", broken)
    assert "Broken pipe" in refused(capsys, *RUN)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux only")
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_standard_output_on_a_full_disk_is_a_sentence(folder, unbuffered):
    with open("/dev/full", "wb") as full:
        words = [sys.executable, "-m", "skinwave", "plan", "none.toml"]
        ended = subprocess.run(
            words, stdout=full, stderr=subprocess.PIPE, check=False, text=True,
            env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
        )  # fmt: skip
    assert ended.returncode == 2
    assert ended.stderr.startswith("skinwave: standard output ")
    assert " written (No space left on device); make room " in ended.stderr
    assert ended.stderr.count("\n") == 1


@pytest.fixture
def disk(folder):
    """A disk of 16 KiB."""
    place = folder / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", str(place)]
    if sys.platform != "linux" or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("no disk can be mounted here")
    yield place
    subprocess.run(["umount", str(place)], check=True)


OUTPUTS = [
    [*RUN, "--out", "disk/new/out"],
    [*SWEEP, "--out", "disk/sweep"],
    ["convert", "none.toml", "disk/o.csv", "--rate", "40000", "--quiet"],
    ["compare", "none.toml", "--h", "8", "--quiet", "--out", "disk/out"],
]


@pytest.mark.parametrize("arguments", OUTPUTS, ids=lambda a: a[0])
@pytest.mark.parametrize("state", ["full", "read-only"])
def test_a_disk_that_cannot_be_written_is_said_with_folder_and_cure(disk, capsys, state, arguments):
    if state == "full":
        (disk / "filler").write_bytes(bytes(8000))
    else:
        subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
    before = corpus.contents(disk)
    assert main(arguments) == 2
    (said,) = capsys.readouterr().err.splitlines()
    system = "No space left on device" if state == "full" else "Read-only file system"
    assert f"cannot be written ({system}); " in said
    assert " disk/" in said or str(disk) in said
    assert ("make room there" in said) == (state == "full")
    assert "choose another" in said
    after = corpus.contents(disk)
    assert {p: c for p, c in after.items() if "sweep" not in p.parts} == before
    assert all(c is None or c for c in after.values())  # no file is begun
    assert not [p for p in after if "partial" in p.name]
