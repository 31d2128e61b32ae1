"""Results with a record of their command, repeated by it, and compared with each other."""

import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from simple_model import Response
from skinwave.commands.cli import main
from skinwave.results.run import Run
from skinwave.results.same import differences
from skinwave.scene.file import loads
from skinwave.studies.album import open_album
from skinwave.system.effort import THREADS


@pytest.fixture
def scene(scene):
    """A smaller body, whose sides are reduced sooner than absorbing ones."""
    text = scene.read_text().replace("= 60", "= 40")
    scene.write_text(text.replace("[body]", '[body]\nthickness_mm = 8\nsides = "clamped"'))
    return scene


def record_of(folder):
    return json.loads((folder / "record.json").read_text())


def same(*arguments):
    return main(["same", *map(str, arguments), "--quiet"])


def altered(folder, name, change):
    """A result folder whose arrays were changed by hand."""
    path = folder / "responses.npz"
    with np.load(path) as file:
        arrays = {n: file[n] for n in file.files}
    change(arrays)
    np.savez(path, **arrays)
    return name


def test_a_record_has_what_a_result_depends_on(scene):
    assert main(["run", str(scene), "--model", "fem", "--h", "12", "--quiet"]) == 0
    found = record_of(scene.parent / "short-out")
    assert found["command"]["typed"] == f"skinwave run {scene} --model fem --h 12 --quiet"
    assert found["model"] == {"asked": "fem", "used": "fem"}
    assert found["solver"]["asked"] == "auto"
    assert found["solver"]["used"] in ("pardiso", "cholmod", "superlu")
    assert found["h_m"] == pytest.approx(0.012)
    assert found["tolerance"] == 0.05
    assert found["expected_error"] > 0
    assert {"python", "numpy", "scipy", "skinwave", "os"} <= set(found["versions"])
    assert len(found["hashes"]["mesh"]) == 64
    assert set(found["hashes"]["arrays"]) == {"t", "probes", "displacement", "fem"}
    arrays = found["hashes"]["arrays"]
    assert arrays["fem"] == arrays["displacement"] != arrays["t"]


def test_a_run_without_a_mesh_has_a_record_and_versions(scene):
    assert main(["run", str(scene), "--model", "flat-body", "--quiet"]) == 0
    folder = scene.parent / "short-out"
    assert record_of(folder)["h_m"] is None
    assert "mesh" not in record_of(folder)["hashes"]
    effort = json.loads((folder / "effort.json").read_text())
    assert effort["versions"]["numpy"] == np.__version__


EACH = """
import json, sys
from skinwave.commands.cli import main
sys.exit(any([main(command) for command in json.loads(sys.argv[1])]))
"""


def on_threads(count, *commands):
    """Commands in one process with so many threads, which keep nothing and find nothing."""
    # Threads that wait for each other, as they do where others compute, take no time then.
    limits = dict.fromkeys(THREADS, str(count)) | {"OMP_WAIT_POLICY": "PASSIVE"}
    words = [[*map(str, command), "--quiet", "--no-cache"] for command in commands]
    subprocess.run(
        [sys.executable, "-c", EACH, json.dumps(words)], check=True, env=os.environ | limits
    )


@pytest.mark.slow
def test_a_slab_is_the_same_on_one_and_on_two_threads(scene):
    models = {"fem": ["--h", "9"], "flat-body": [], "point-kernel": []}
    for count in (1, 2):
        runs = (
            ["run", scene, "--model", model, *more, "--out", f"{model}-{count}"]
            for model, more in models.items()
        )
        on_threads(count, *runs, *[["rerun", "fem-2", "--out", "again"]] * (count == 2))
    for model in models:
        assert same(f"{model}-1", f"{model}-2") == 0
        assert record_of(scene.parent / f"{model}-2")["threads"]["OMP_NUM_THREADS"] == "2"
    assert same("fem-2", "again") == 0


@pytest.mark.slow
def test_a_rerun_takes_the_threads_of_its_record(scene, monkeypatch):
    """A sheet of little loss, whose reduction amplifies how sums are rounded."""
    scene.write_text(
        '[tacton]\nam_frequency_hz = 140\nduration_s = 0.05\n[body]\nkind = "sheet"\n'
        'material = "paper"\n[probes]\npoints_mm = [[0, 0], [10, 3]]\n'
    )
    on_threads(2, ["run", scene, "--model", "fem", "--h", "5", "--out", "first"])
    for name in THREADS:
        monkeypatch.setenv(name, "1")
    assert main(["rerun", "first", "--out", "again", "--no-cache", "--quiet"]) == 0
    assert same("first", "again") == 0
    assert record_of(scene.parent / "again")["threads"] == dict.fromkeys(THREADS, "2")


@pytest.mark.usefixtures("in_one_process")
def test_a_comparison_and_its_runs_are_had_again(scene):
    assert main(["compare", str(scene), "--h", "12", "--out", "both", "--quiet"]) == 0
    scene.unlink()
    assert main(["rerun", "both", "--quiet"]) == 0
    assert same("both", "both-rerun") == 0
    folders = sorted(path.parent for path in scene.parent.glob("both/*/*/record.json"))
    assert len(folders) >= 2
    for k, folder in enumerate(folders):
        assert main(["rerun", str(folder), "--out", f"one-{k}", "--quiet"]) == 0
        assert same(folder, f"one-{k}") == 0
    meshes = {record_of(folder)["hashes"].get("mesh") for folder in folders}
    assert len(meshes) == 2  # that of the slab, and none


@pytest.mark.usefixtures("in_one_process")
def test_dispersion_curves_are_had_again(scene):
    assert main(["dispersion", str(scene), "--highest", "300", "--modes", "2", "--quiet"]) == 0
    scene.unlink()
    assert main(["rerun", "short-dispersion", "--quiet"]) == 0
    first, again = (
        np.genfromtxt(f"{folder}/dispersion.csv", delimiter=",", names=True)
        for folder in ("short-dispersion", "short-dispersion-rerun")
    )
    assert first.dtype.names == again.dtype.names
    for name in first.dtype.names:
        np.testing.assert_allclose(again[name], first[name], rtol=1e-9)


def page_alone(results, out, *given, **options):
    """A report without its pictures, which `same` does not look at."""
    open_album(results)
    (out / "index.html").write_text("<html></html>")


@pytest.mark.slow
def test_a_report_is_had_again(scene, monkeypatch):
    monkeypatch.setattr("skinwave.studies.album.shown_scenes", lambda scene, _: {"slab": scene})
    monkeypatch.setattr("skinwave.studies.scene_report.write_report", page_alone)
    assert main(["report", str(scene), "--h", "12", "--quiet"]) == 0
    scene.unlink()
    assert main(["rerun", "short-report", "--quiet"]) == 0
    assert same("short-report", "short-report-rerun") == 0
    assert main(["rerun", "short-report/slab", "--out", "slab", "--quiet"]) == 0
    assert same("short-report/slab", "slab") == 0


@pytest.fixture
def twice(scene):
    """Two folders of the same result."""
    assert main(["run", str(scene), "--model", "point-kernel", "--out", "first", "--quiet"]) == 0
    first = scene.parent / "first"
    return first, shutil.copytree(first, scene.parent / "second")


def test_a_record_that_lacks_a_number_of_threads_is_had_again_here(twice, monkeypatch):
    """Each process would start the next one for it."""

    def another(*given):
        raise AssertionError("another process is started")

    monkeypatch.setattr("skinwave.commands.rerun._with_threads", another)
    kept = record_of(twice[0])
    del kept["threads"][THREADS[0]]
    (twice[0] / "record.json").write_text(json.dumps(kept))
    assert main(["rerun", str(twice[0]), "--out", "again", "--quiet"]) == 0
    assert same(twice[0], "again") == 0


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (lambda a: a["displacement"].__setitem__((7, 1), 2 * np.abs(a["displacement"]).max()),
         "'displacement' at [7, 1] is "),
        (lambda a: a.update(t=a["t"][:-1]), "'t' has shape (499,) in one and (500,) in the other"),
        (lambda a: a.pop("point-kernel"), "'point-kernel' is in one of them only"),
    ],
)  # fmt: skip
def test_what_differs_is_said_in_a_sentence(change, part, twice, capsys):
    altered(twice[0], "first", change)
    assert main(["same", *map(str, twice)]) == 1
    said = capsys.readouterr().out
    assert said.startswith("different: ")
    assert part in said
    assert said.count("\n") == 1


def test_the_worst_difference_comes_first(twice):
    def change(arrays):
        largest = np.abs(arrays["displacement"]).max()
        arrays["displacement"][3, 0] += 1e-3 * largest
        arrays["point-kernel"][5, 1] += 1e-2 * largest

    altered(twice[0], "first", change)
    found = differences(*twice, 1e-9)
    assert ["[5, 1]" in found[0].words, "[3, 0]" in found[1].words] == [True, True]
    assert found[0].size == pytest.approx(1e-2, rel=0.05)
    assert same(*twice, "--rtol", "0.1") == 0
    assert same(*twice, "--rtol", "5e-3") == 1


def test_lines_are_compared_as_written(twice):
    path = twice[0] / "lines.csv"
    rows = path.read_text().splitlines()
    strongest = max(rows[1:], key=lambda row: float(row.split(",")[-1]))
    *before, pressure = strongest.split(",")

    def written(factor):
        cells = ",".join([*before, f"{factor * float(pressure):.6g}"])
        path.write_text("\n".join(cells if row == strongest else row for row in rows) + "\n")

    written(1 + 4e-6)
    assert same(*twice) == 0  # the last of six digits
    written(1.01)
    assert same(*twice) == 1
    path.unlink()
    (found,) = differences(*twice, 1e-9)
    assert found.words == f"{twice[0]} has no lines.csv"


def test_bad_input_exits_with_two(twice, capsys):
    first, second = twice
    assert same(first, second / "nowhere") == 2
    assert same(first, second, "--rtol", "-1") == 2
    assert same(first, second, "--rtol", "nan") == 2
    altered(first, "first", lambda a: a["displacement"].fill(np.nan))
    assert same(first, second) == 2
    (first / "responses.npz").write_bytes(b"spoilt")
    assert same(first, second) == 2
    for content in ("", "{}", '{"format": 99, "command": {"options": {}}}'):
        (second / "record.json").write_text(content)
        assert main(["rerun", str(second)]) == 2
    assert main(["rerun", str(second / "nowhere")]) == 2
    assert capsys.readouterr().err.count("skinwave: ") == 9


@pytest.mark.parametrize("row", ["a" * 200_000, "1,2,3,4,5,6,7,8,9,10,11,12,13,14", "1"])
def test_lines_that_are_no_table_are_one_sentence(twice, capsys, row):
    with open(twice[0] / "lines.csv", "a") as file:
        file.write(row + "\n")
    assert same(*twice) == 2
    said = capsys.readouterr().err
    assert "lines.csv" in said
    assert said.count("\n") == 1


def test_waveforms_under_their_old_name_are_read(twice):
    first, second = twice
    (first / "responses.npz").rename(first / "response.npz")
    (first / "record.json").unlink()
    assert same(first, second) == 0
    (run,) = open_album(first).runs
    assert run.model == "point-kernel"
    assert np.isnan(run.response.expected_error)


def test_an_opened_folder_keeps_the_expected_error(scene):
    assert main(["run", str(scene), "--model", "fem", "--h", "12", "--quiet"]) == 0
    folder = scene.parent / "short-out"
    (run,) = open_album(folder).runs
    assert isinstance(run, Run)
    assert isinstance(run.response, Response)
    assert run.response.expected_error == record_of(folder)["expected_error"] > 0
    assert loads(record_of(folder)["scene"]) == run.scene
