"""Malformed input is refused in one line that says what is wrong, and leaves nothing behind."""

import os
import re
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

SCENES = corpus.scenes()
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="paths differ")


@pytest.fixture
def folder(tmp_path, monkeypatch):
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
    assert code in codes, (arguments, printed)
    if code == 2:
        assert printed.count("\n") == 1, printed
        assert printed.startswith("skinwave: "), printed
        assert len(printed) > len("skinwave: \n")
        assert corpus.contents(folder) == before
    return printed


@pytest.mark.parametrize("kind", SCENES)
def test_invalid_scenes_are_refused_in_one_line(folder, capsys, kind):
    for content in SCENES[kind].values():
        (folder / "wrong.toml").write_bytes(content)
        assert "wrong.toml: " in said(capsys, folder, ["plan", "wrong.toml"]), content[:200]


def test_a_damaged_scene_is_planned_or_refused(folder, capsys):
    for content in corpus.damaged_scenes():
        (folder / "wrong.toml").write_bytes(content)
        assert "Traceback" not in said(capsys, folder, ["plan", "wrong.toml"], codes=(0, 2))


@pytest.mark.parametrize("command", ["run", "compare", "plan"])
def test_invalid_commands_are_refused_in_one_line(folder, capsys, command):
    for arguments in corpus.command_lines():
        if arguments[0] == command:
            said(capsys, folder, arguments)


def test_wrong_usage_ends_with_two(folder, capsys):
    before = corpus.contents(folder)
    for arguments in corpus.wrong_usage():
        with pytest.raises(SystemExit) as stop:
            main(arguments)
        assert stop.value.code == 2
        printed = capsys.readouterr().err
        assert printed.startswith("skinwave: ")
        assert printed.count("\n") == 1
    assert corpus.contents(folder) == before


@pytest.mark.parametrize("name", corpus.ABSURD)
def test_problems_too_large_for_any_machine_are_refused(folder, capsys, name):
    body, size, *options = corpus.ABSURD[name]
    scene = corpus.GOOD.replace("[body]", f"[body]\n{body}")
    for line in size.splitlines():
        key = line.split(" =")[0]
        scene = "\n".join(line if old.startswith(key) else old for old in scene.splitlines())
    (folder / "huge.toml").write_text(scene)
    for command in (["plan", "--model", "fem"], ["compare"]):
        arguments = [command[0], "huge.toml", *command[1:], *options]
        assert "3,000,000" in said(capsys, folder, arguments)


def test_invalid_meshes_are_refused_in_one_line():
    for name, make in corpus.broken_meshes().items():
        with pytest.raises(ValueError) as error:  # noqa: PT011 - any sentence will do, but one
            make()
        assert str(error.value), name
        assert "\n" not in str(error.value), name


def test_a_separate_process_reports_the_same_error(folder):
    (folder / "wrong.toml").write_bytes(SCENES["whole files"]["brackets without end"])
    before = corpus.contents(folder)
    command = [sys.executable, "-m", "skinwave", "run", "wrong.toml"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=600, env=os.environ)
    assert ended.returncode == 2
    assert ended.stdout == ""
    assert ended.stderr.startswith("skinwave: ")
    assert ended.stderr.count("\n") == 1
    assert corpus.contents(folder) == before


@pytest.mark.parametrize("name", ["..", "zero \\u0000 byte", "n" * 300])
def test_scenes_of_any_name_write_only_in_their_folder(folder, name):
    text = corpus.GOOD.replace('"small"', f'"{name}"').replace("0.02", "0.005")
    (folder / "named.toml").write_text(text, encoding="utf-8")
    before = corpus.contents(folder)
    ask = ["run", "named.toml", "--model", "point-kernel", "--out", "out", "--quiet"]
    assert main(ask) == 0
    assert {p: c for p, c in corpus.contents(folder).items() if "out" not in p.parts} == before
    assert (folder / "out/responses.npz").exists()


def test_a_probe_on_a_clamped_edge_does_not_move():
    rim = corpus.GOOD.replace("[5, 0]", "[15, 0]")
    scene, alone = loads(rim), loads(rim.replace("[0, 0], ", ""))
    motion = compute(scene, "fem", tolerance=0.3, h=0.006).displacement
    assert np.abs(motion[:, 0]).max() > 0
    assert np.abs(motion[:, 1]).max() < 1e-12 * np.abs(motion[:, 0]).max()
    with pytest.raises(ValueError, match="all probes"):
        compute(alone, "fem", tolerance=0.3, h=0.006)


def test_a_silent_tacton_causes_no_motion():
    silent = loads(corpus.GOOD.replace("[tacton]", "[tacton]\namplitude_percent = 0"))
    for model in ("point-kernel", "flat-body", "fem"):
        assert not compute(silent, model, tolerance=0.3, h=0.006).displacement.any()
    assert plan(silent, SolveOptions(tolerance=0.015, model="fem", h=0.006)).error < 1e-3


@pytest.mark.parametrize(
    ("content", "kind"),
    [(b"\x89PNG\r\n\x1a\n\0\0", "a PNG picture"), (bytes(range(256)), "a binary file")],
)
def test_a_file_that_is_not_a_scene_is_called_by_its_kind(folder, capsys, content, kind):
    (folder / "x.png").write_bytes(content)
    printed = said(capsys, folder, ["run", "x.png"])
    assert f"the file is {kind}, not a scene" in printed
    assert "UTF-8" not in printed


@pytest.mark.parametrize("name", ["a." * 3000 + "a", "body.material." + "a." * 3000 + "a"])
def test_varied_keys_of_many_parts_are_refused(folder, capsys, name):
    assert len(said(capsys, folder, ["sweep", "good.toml", "--vary", f"{name}=1,2"])) < 200


@pytest.mark.parametrize(
    ("key", "hint"),
    [
        ("quality_factor = 20", "write loss_factor = 1 / Q = 0.05"),
        ("damping_ratio = 0.025", "write loss_factor = 2 zeta = 0.05"),
        ("tan_delta = 0.3", "write loss_factor = tan(delta) = 0.3"),
        ("rayleigh_alpha = 30", "write loss_factor = alpha / (2 pi f) at the frequency f"),
        ("rayleigh_beta = 1e-4", "write loss_factor = 2 pi f beta at the frequency f"),
        ("rayleigh = [30, 1e-4]", "write loss_factor = alpha / (2 pi f) + 2 pi f beta"),
        ("density_kg_m3 = 998\nshear_modulus_pa = 0\npoisson = 0.49", "fluids are not modelled"),
        ("shear_modulus_kpa = 25", "write shear_modulus_pa = 1000 x shear_modulus_kpa = 25000"),
        ("density_g_cm3 = 1.1", "write density_kg_m3 = 1000 x density_g_cm3 = 1100"),
        ("poisson_ratio = 0.4", "did you mean 'poisson'?"),
    ],
)
def test_keys_of_another_value_are_refused_with_the_conversion(key, hint):
    with pytest.raises(ValueError, match=re.escape(hint)):
        loads(f"[body.material]\n{key}")


@pytest.mark.parametrize(
    ("key", "hint"),
    [
        ("radius_mm = 10", "write size_mm = 2 radius = 20"),
        ("speed_mm_per_s = 1000", "write speed_m_per_s = 0.001 x speed_mm_per_s = 1"),
        ("duration_ms = 300", "write duration_s = 0.001 x duration_ms = 0.3"),
    ],
)
def test_keys_in_another_unit_are_refused_with_the_number(key, hint):
    with pytest.raises(ValueError, match=re.escape(hint)):
        loads(f"[tacton]\n{key}")
