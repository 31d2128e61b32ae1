"""The command line as its users meet it: results, refusals, interruption."""

import json
import os
import re
import sys
from argparse import Namespace
from unittest.mock import Mock

import numpy as np
import pytest
import read_results
from corpus import GOOD, SMALL

from skinwave import BODIES
from skinwave.bodies.sizes import check_mesh
from skinwave.commands import kept
from skinwave.commands.cli import main
from skinwave.commands.common import progress_of
from skinwave.planning import refinement
from skinwave.scene import paper15
from skinwave.studies import study

CLAMPED = SMALL.replace("[body]", '[body]\nthickness_mm = 8\nsides = "clamped"')


def test_run_leaves_a_folder_that_reproduces_it(scene, capsys):
    fem = ["--model", "fem", "--element-size", "6"]
    assert main(["run", str(scene), "--out", "first", *fem, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["model"] == "fem"
    assert main(["run", "first/scene.toml", "--out", "second", *fem, "--quiet"]) == 0
    first, second = (read_results.arrays(f"{name}/responses.npz") for name in ("first", "second"))
    assert first["displacement"].shape == (500, 2)
    np.testing.assert_array_equal(first["fem"], first["displacement"])
    np.testing.assert_allclose(first["displacement"], second["displacement"], rtol=1e-9)
    page = (scene.parent / "first/index.html").read_text()
    assert "data:image/" in page
    assert "http:" not in page.replace("https:", "http:").split("<body>")[0]
    assert json.loads((scene.parent / "first/effort.json").read_text())["dofs"] > 1000


@pytest.mark.parametrize("model", ["point-kernel", "flat-body", "fem-harmonic", "fem-transient"])
def test_run_with_each_model(scene, model):
    scene.write_text(CLAMPED)
    words = f"run {scene} --model {model} --element-size 15 --dt 1e-4 --quiet"
    assert main(words.split()) == 0
    rows = read_results.rows(scene.parent / "short-out/lines.csv")
    assert {row["model"] for row in rows} == {model}
    empty, filled = ("displacement_um", "pressure_pa")[:: 1 if model == "point-kernel" else -1]
    assert all(row[empty] == "" and float(row[filled]) >= 0 for row in rows)


@pytest.mark.usefixtures("in_one_process")
def test_compare_a_scene_of_ones_own(scene):
    scene.write_text(CLAMPED.replace("0.05", "0.3"))  # to tell lines apart
    assert main(["compare", str(scene), "--element-size", "6", "--out", "both"]) == 0
    folder = scene.parent / "both"
    rows = read_results.rows(folder / "lines.csv")
    assert ",".join(rows[0]) == (
        "tacton,body,model,probe_x_mm,probe_y_mm,line,frequency_hz,"
        "displacement_um,velocity_mm_s,pressure_pa"
    )
    assert {(row["body"], row["model"]) for row in rows} == {
        ("none", "point-kernel-published"), ("none", "point-kernel"), ("slab", "fem"),
    }  # fmt: skip
    row = next(r for r in rows if r["body"] == "slab" and r["line"] == "f_AM")
    velocity = 2 * np.pi * 200 * float(row["displacement_um"]) / 1e3
    assert float(row["velocity_mm_s"]) == pytest.approx(velocity, rel=1e-4)
    claims = read_results.rows(folder / "claims.csv")
    assert list(claims[0]) == ["claim", "body", "model", "holds", "value", "bar", "sentence"]
    assert (folder / "short/slab/scene.toml").exists()
    assert (folder / "short/point-kernel/responses.npz").exists()
    assert (folder / "pictures/short.png").stat().st_size > 10_000


@pytest.mark.usefixtures("in_one_process")
def test_a_run_that_fails_is_named_first_and_the_others_are_compared(scene, monkeypatch, capsys):
    solve = study._response

    def fails_on_paper(name, column, scene, *given):
        if scene.body.of_kind.is_plate:
            raise ArithmeticError("no solution")
        return solve(name, column, scene, *given)

    monkeypatch.setattr(paper15, "MEASURED_ON", ("paper-sheet", "skin-slab"))  # a palm is slow
    monkeypatch.setattr(study, "_response", fails_on_paper)
    monkeypatch.setattr("skinwave.live.html_file.pack_of", Mock(side_effect=ValueError("no pack")))
    scene.write_text(SMALL.partition("[body]")[0] + '[body]\nkind = "none"\n')
    assert main(["compare", str(scene), "--out", "both", "--json"]) == 1
    first, *_ = (said := json.loads(capsys.readouterr().out))["sentences"]
    assert first.startswith("2 parts of this result failed: ")
    assert said["failures"]["short on paper-sheet"] == "no solution"
    assert said["failures"]["live page"] == "no pack"
    page = read_results.page(scene.parent / "both/index.html")
    assert page.index(first) < page.index("rive law and focus")
    # Nothing is written of a comparison without a body.
    monkeypatch.setattr(study, "_response", Mock(side_effect=ArithmeticError("none")))
    assert main(["compare", str(scene), "--out", "none"]) == 2
    assert not (scene.parent / "none").exists()


def test_plan_gives_a_reason_for_every_row(scene, capsys):
    scene.write_text(GOOD)  # its sides are clamped
    assert main(["plan", str(scene), "--json"]) == 0
    required = json.loads(capsys.readouterr().out)
    assert required["model"] == "fem"
    assert 0.001 < required["h"] < 0.008
    assert all(row["reason"] for row in required["rows"])


def test_a_run_without_the_cache_leaves_nothing_in_it(scene, monkeypatch, tmp_path):
    monkeypatch.setenv("SKINWAVE_CACHE", str(tmp_path / "cache"))
    scene.write_text(GOOD)  # soon reduced
    run = ["run", str(scene), "--model", "fem", "--element-size", "10", "--quiet", "--overwrite"]
    assert main([*run, "--no-cache"]) == 0
    assert not (tmp_path / "cache").exists()
    assert os.environ["SKINWAVE_CACHE"] == str(tmp_path / "cache")  # as before
    assert main(run) == 0
    kept = {path: path.stat().st_mtime_ns for path in (tmp_path / "cache").iterdir()}
    assert kept
    assert main([*run, "--no-cache"]) == 0
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "cache").iterdir()} == kept


@pytest.mark.parametrize("terminal", [False, True])
def test_progress_shows_the_step_and_the_time(capsys, monkeypatch, terminal):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    monkeypatch.setenv("COLUMNS", "100")
    with progress_of(Namespace(quiet=False, json=False)) as progress:
        for phase in ("mesh", "assemble", "factorise"):
            progress(phase, 0.0)
        progress("reduce", 0.5)
        progress("reduce", 0.9)
    said = capsys.readouterr().err
    if terminal:
        assert re.search(r"reduce \(step 4 of 4\) +.*0:00:0", said)
    else:
        assert said.splitlines() == [
            "mesh (step 1 of 4)", "assemble (step 2 of 4)", "factorise (step 3 of 4)",
            "reduce (step 4 of 4)",
        ]  # fmt: skip


@pytest.mark.usefixtures("in_one_process")
def test_an_interrupt_keeps_finished_runs(scene, monkeypatch, capsys):
    scene.write_text(CLAMPED)
    interrupted = Mock(side_effect=KeyboardInterrupt)
    monkeypatch.setattr("skinwave.studies.study.plan", interrupted)
    assert main(["compare", str(scene), "--element-size", "8", "--out", "cut", "--quiet"]) == 1
    page = (scene.parent / "cut/index.html").read_text()
    assert "Interrupted" in page
    found = sorted((scene.parent / "cut").glob("*/*/responses.npz"))
    assert [path.parent.name for path in found] == ["point-kernel", "point-kernel-published"]
    assert sorted(path.name for path in scene.parent.iterdir()) == ["cut", "short.toml"]


def test_an_error_above_the_tolerance_is_a_warning(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(refinement, "SIZES", refinement.Sizes(finest=2.0))
    (tmp_path / "scene.toml").write_text(
        '[tacton]\nam_frequency_hz = 140\nshape = "point"\nduration_s = 0.05\n'
        '[body]\nkind = "sheet"\nmaterial = "paper"\nsize_x_mm = 40\nsize_y_mm = 40\n'
        'thickness_mm = 0.1\nbase = "free"\nsides = "clamped"\n[probes]\npoints_mm = [[0, 0]]\n'
    )
    assert main(["run", "scene.toml", "--model", "fem", "--tolerance", "0.001", "--quiet"]) == 0
    assert "warning: elements of" in capsys.readouterr().err
    assert "Take care: elements of" in read_results.page(tmp_path / "scene-out/index.html")


def test_options_are_not_abbreviated_but_hinted(capsys):
    for typed, hint in (
        (["run", "x.toml", "--h", "3"], "unrecognized option --h; use --element-size"),
        (["sweep", "x.toml", "--elem=3"], "unrecognized option --elem; use --element-size"),
        (["plan", "x.toml", "--modle", "fem"], "did you mean '--model'?"),
    ):
        with pytest.raises(SystemExit, match="2"):
            main(typed)
        printed = capsys.readouterr()
        assert hint in printed.err
        assert not printed.out


def test_a_size_too_fine_for_a_palm_names_one_that_works(scene, capsys):
    scene.write_text("[body]\nkind = 'palm'\n")
    assert main(["plan", str(scene), "--element-size", "0.2"]) == 2
    size = re.search(r"0.2 mm are too many.*use elements of ([\d.]+) mm", capsys.readouterr().err)[
        1
    ]
    check_mesh(BODIES["palm"], float(size) / 1e3)


def test_an_unchanged_command_copies_its_result(scene, capsys, monkeypatch):
    monkeypatch.setattr(kept, "COMMANDS", ("run",))
    again = ["run", str(scene), "--model", "fem", "--element-size", "6"]
    assert main([*again, "-o", "first"]) == 0
    first = capsys.readouterr()
    with monkeypatch.context() as without:
        without.setattr("skinwave.commands.run.run", None)  # nothing may be computed
        assert main([*again, "-o", "second"]) == 0
    second = capsys.readouterr()
    assert second.out == first.out.replace("first", "second")
    assert "nothing has changed" in second.err
    assert "--no-cache" in second.err
    home = scene.parent
    files = {p.relative_to(home / "first") for p in (home / "first").rglob("*") if p.is_file()}
    assert len(files) > 5
    for name in files:
        old, new = ((home / each / name).read_bytes() for each in ("first", "second"))
        if name.name == "record.json":
            typed = json.loads(new)["command"]["typed"]
            assert typed.endswith("-o second")
        else:
            assert new == old.replace(b"-o first", b"-o second")
    assert main([*again, "-o", "second", "--overwrite"]) == 0  # every file is skinwave's own
    scene.write_text(scene.read_text().replace("0.05", "0.06"))
    with monkeypatch.context() as without:
        without.setattr("skinwave.commands.run.run", Mock(return_value=3))
        assert main([*again, "-o", "third"]) == 3  # another scene is computed


def test_a_failed_command_is_not_kept(scene, monkeypatch):
    monkeypatch.setattr(kept, "COMMANDS", ("run",))
    again = ["run", str(scene), "--model", "point-kernel", "--quiet", "--overwrite"]
    with monkeypatch.context() as failing:
        failing.setattr("skinwave.studies.pages.fill", Mock(side_effect=ValueError("full")))
        assert main(again) == 2
    assert main(again) == 0
    assert (scene.parent / "short-out/index.html").is_file()
