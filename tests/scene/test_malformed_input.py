"""Malformed input is refused in one line that says what is wrong, and leaves nothing behind."""

import os
import subprocess
import sys

import corpus
import numpy as np
import pytest

from skinwave import loads
from skinwave.commands.cli import main
from skinwave.models.options import SolveOptions
from skinwave.planning.plan import plan
from skinwave.planning.simulate import compute

SCENES, COMMANDS, MESHES = corpus.scenes(), corpus.command_lines(), corpus.broken_meshes()
MORE_COMMANDS = [
    ["run", "good.toml", "--model", "fem", "--h", "nan", "--out", "new/below"],
    ["verify", "--tradeoff", "none.toml"],
]
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="paths differ")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with two good scenes, a folder of the user's, and a link to itself."""
    (tmp_path / "good.toml").write_text(corpus.GOOD)
    (tmp_path / "none.toml").write_text(corpus.SILENT_GROUND)
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept/note").write_text("mine")
    (tmp_path / "loop").symlink_to("loop")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def said(capsys, folder, arguments, codes=(2,)):
    """Error message of a refused command, in its one line; "" if it was not refused."""
    before = corpus.contents(folder)
    code = main(arguments)
    printed = capsys.readouterr().err
    assert code in codes, printed
    if code == 2:
        assert printed.count("\n") == 1, printed
        assert printed.startswith("skinwave: "), printed
        assert len(printed) > len("skinwave: \n")
        assert corpus.contents(folder) == before
    return printed


def test_the_corpus_is_large_and_the_same_every_time():
    assert len(SCENES) + len(COMMANDS) + len(MESHES) > 500
    assert corpus.scenes() == SCENES
    assert corpus.damaged_scenes() == corpus.damaged_scenes()


@pytest.mark.parametrize("name", SCENES)
def test_no_scene_is_refused_in_one_line(folder, capsys, name):
    (folder / "wrong.toml").write_bytes(SCENES[name])
    command = ("run", "compare", "plan")[len(name) % 3]
    assert "wrong.toml: " in said(capsys, folder, [command, "wrong.toml"])


@pytest.mark.parametrize("content", corpus.damaged_scenes(), ids=range(90))
def test_a_damaged_scene_is_planned_or_refused(folder, capsys, content):
    (folder / "wrong.toml").write_bytes(content)
    assert "Traceback" not in said(capsys, folder, ["plan", "wrong.toml"], codes=(0, 2))


@pytest.mark.parametrize("arguments", [*COMMANDS, *MORE_COMMANDS], ids=lambda a: " ".join(a)[:60])
def test_no_command_is_refused_in_one_line(folder, capsys, arguments):
    said(capsys, folder, arguments)


@pytest.mark.parametrize("arguments", corpus.wrong_usage(), ids=" ".join)
def test_wrong_usage_ends_with_two(folder, capsys, arguments):
    before = corpus.contents(folder)
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    printed = capsys.readouterr().err
    assert printed.startswith("skinwave: ")
    assert printed.endswith("--help\n")
    assert printed.count("\n") == 1
    assert corpus.contents(folder) == before


@pytest.mark.parametrize("name", corpus.ABSURD)
@pytest.mark.parametrize("command", ["plan", "run", "compare"])
def test_what_no_machine_can_solve_is_refused_with_number_limit_and_cure(
    folder, capsys, command, name
):
    body, size, *model_options = corpus.ABSURD[name]
    scene = corpus.GOOD.replace("[body]", f"[body]\n{body}")
    for line in size.splitlines():
        key = line.split(" =")[0]
        scene = "\n".join(line if old.startswith(key) else old for old in scene.splitlines())
    (folder / "huge.toml").write_text(scene)
    model = [] if command == "compare" else ["--model", "fem"]
    sentence = said(capsys, folder, [command, "huge.toml", *model, *model_options])
    assert "degrees of freedom or more, the limit is 3,000,000; " in sentence


@pytest.mark.parametrize("name", MESHES)
def test_no_mesh_is_refused_in_one_line(name):
    with pytest.raises(ValueError) as error:  # noqa: PT011 - any sentence will do, but one
        MESHES[name]()
    assert str(error.value)
    assert "\n" not in str(error.value)


REAL = [
    ["run", "wrong.toml"],
    ["compare", "good.toml", "--h", "1e-9"],
]


@pytest.mark.parametrize("arguments", REAL, ids=" ".join)
def test_a_process_of_its_own_says_the_same(folder, arguments):
    (folder / "wrong.toml").write_bytes(SCENES["brackets without end"])
    before = corpus.contents(folder)
    command = [sys.executable, "-m", "skinwave", *arguments]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=600, env=os.environ)
    assert ended.returncode == 2
    assert ended.stdout == ""
    assert ended.stderr.startswith("skinwave: ")
    assert ended.stderr.count("\n") == 1
    assert corpus.contents(folder) == before


NAMES = ["..", "../../beside", "figures", "$\\\\frac{$", "zero \\u0000 byte", "n" * 300]
MORE = ["", "/tmp/absolute", "overview", "lines.csv", "掌", "two\\nlines"]


@pytest.mark.usefixtures("in_one_process")
@pytest.mark.parametrize("name", NAMES)
def test_a_scene_of_any_name_is_compared_within_its_folder(folder, name):
    text = corpus.GOOD.replace('"small"', f'"{name}"').replace("0.02", "0.005")
    (folder / "named.toml").write_text(text, encoding="utf-8")
    before = corpus.contents(folder)
    assert main(["compare", "named.toml", "--h", "6", "--out", "out", "--quiet"]) == 0
    assert {p: c for p, c in corpus.contents(folder).items() if "out" not in p.parts} == before
    assert len(list((folder / "out").glob("*/*/responses.npz"))) == 3
    assert len(list((folder / "out/figures").glob("*.png"))) == 2
    command = ["run", "out", "--model", "point-kernel", "--out", "single", "--quiet"]
    (command[1],) = map(str, (folder / "out").glob("*/point-kernel/scene.toml"))
    assert main(command) == 0


@pytest.mark.parametrize("name", MORE)
def test_a_scene_of_any_name_is_answered_within_its_folder(folder, name):
    text = corpus.GOOD.replace('"small"', f'"{name}"').replace("0.02", "0.005")
    (folder / "named.toml").write_text(text, encoding="utf-8")
    before = corpus.contents(folder)
    ask = ["run", "named.toml", "--model", "point-kernel", "--out", "out", "--quiet"]
    assert main(ask) == 0
    assert {p: c for p, c in corpus.contents(folder).items() if "out" not in p.parts} == before
    assert (folder / "out/responses.npz").exists()


def test_overwriting_keeps_the_neighbours_and_a_link(folder):
    (folder / "out.old").mkdir()
    (folder / "out.old/note").write_text("mine")
    (folder / "link").symlink_to("elsewhere")
    assert main(["run", "none.toml", "--out", "elsewhere", "--quiet"]) == 0
    for out in ("out", "link"):
        assert main(["run", "none.toml", "--out", out, "--overwrite", "--quiet"]) == 0
    assert (folder / "out.old/note").read_text() == "mine"
    assert (folder / "link").is_symlink()
    assert (folder / "elsewhere/index.html").exists()
    expected = {"good.toml", "none.toml", "kept", "loop", "out.old", "out", "elsewhere", "link"}
    assert {path.name for path in folder.iterdir()} == expected


def test_a_probe_on_a_clamped_edge_stays_and_spoils_no_other():
    rim = corpus.GOOD.replace("[5, 0]", "[15, 0]")
    scene, alone = loads(rim), loads(rim.replace("[0, 0], ", ""))
    motion = compute(scene, "fem", tolerance=0.3, h=0.006).displacement
    assert np.abs(motion[:, 0]).max() > 0
    assert np.abs(motion[:, 1]).max() < 1e-12 * np.abs(motion[:, 0]).max()
    with pytest.raises(ValueError, match="no probe can move"):
        compute(alone, "fem", tolerance=0.3, h=0.006)


@pytest.mark.parametrize("model", ["point-kernel", "flat-body", "fem", "fem-harmonic"])
def test_a_silent_tacton_moves_nothing(model):
    silent = loads(corpus.GOOD.replace("[tacton]", "[tacton]\namplitude_percent = 0"))
    assert not compute(silent, model, tolerance=0.3, h=0.006).displacement.any()


def test_a_silent_tacton_is_planned():
    sheet = corpus.GOOD.replace("[tacton]", "[tacton]\namplitude_percent = 0")
    assert plan(loads(sheet), SolveOptions(tolerance=0.3, model="fem", h=0.006)).error < 1e-3
