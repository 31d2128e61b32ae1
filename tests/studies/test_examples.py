"""Every shipped example through every command that takes a scene; they give the same numbers."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from simple_model import Response, phasors
from skinwave.commands.cli import main
from skinwave.report.renderer import Renderer
from skinwave.results.motion import waves
from skinwave.scene.file import read

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.toml"))
MESHED = {"layered-skin", "palm"}  # for which no wavenumber integral stands
DRAWN = {"palm", "speed-on-forearm"}  # with all pictures of a report, but for films
SIZE = {
    path.stem: ["--element-size", "12"] for path in EXAMPLES
}  # numbers of one mesh agree, coarse or not
SIZE["square-on-silicone"] = ["--element-size", "20"]  # whose path is long
SIZE["speed-on-forearm"] = []  # a half-space, which has no mesh
SIZE["paper-sheet"] = []  # by the modes of a plate
REDUCED = 0.05  # relative error of the reduced-order model of a whole body


@pytest.mark.parametrize("path", EXAMPLES, ids=[path.stem for path in EXAMPLES])
def test_every_command_takes_an_example_and_they_agree(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    none = Renderer(found=False, said="not asked")
    monkeypatch.setattr("skinwave.studies.gallery.renderer", lambda: none)
    monkeypatch.setattr("skinwave.studies.album._plan", lambda *given: None)
    monkeypatch.setattr("skinwave.studies.album.waves", partial(waves, tolerance=REDUCED))
    left_out = ["run_figures", "_guided", "_write_data", *["pictures"] * (path.stem not in DRAWN)]
    for part in left_out:  # of a report, what shows no surface
        monkeypatch.setattr(f"skinwave.studies.scene_report.{part}", lambda *given: [])
    scene, size = read(path), SIZE[path.stem]
    options = {"run": ["--model", "fem", *size] if path.stem in MESHED else [],
               "compare": size, "report": size, "map": ["--map", *size, "--step", "5"]}  # fmt: skip
    for out, own in options.items():
        command = "report" if out == "map" else out
        assert main([command, str(path), *own, "--quiet", "--out", out]) == 0

    run, compared, reported = (body_response(name) for name in ("run", "compare", "report"))
    if run.model == compared.model:
        np.testing.assert_allclose(*(tones(each, scene) for each in (run, compared)), rtol=1e-6)
    if compared.model == "fem":  # of the report another reduced-order model, of the whole body
        a, b = (tones(each, scene) for each in (compared, reported))
        np.testing.assert_allclose(b, a, atol=REDUCED * a.max())
    check_map(Path("map"), run)
    check_map(next(Path("report").glob("*/map.npz")).parent, reported)


def body_response(folder):
    """The response of a body in a folder of results."""
    files = (file for file in Path(folder).rglob("responses.npz") if "kernel" not in str(file))
    for file in files:
        with np.load(file) as arrays:
            if {*arrays} - {"t", "probes", "displacement"} and "probes" in arrays:
                model = next(n for n in arrays if n not in ("t", "probes", "displacement"))
                return Response(model=model, times=arrays["t"], probes=arrays["probes"],
                                values=arrays[model])  # fmt: skip
    raise AssertionError(f"no response in {folder}")


def tones(response, scene):
    """Amplitudes (f, p) at the tones of a load, their sum and their difference."""
    am, drawn = scene.tacton.am_frequency, scene.tacton.trajectory.drawing_frequency
    frequencies = {am, drawn, abs(drawn - am), drawn + am} - {0.0}
    return np.abs(phasors(response, tuple(sorted(frequencies))))


def check_map(folder, response):
    """The RMS of a map is that of the waveform at each probe that is one of its places."""
    with np.load(folder / "map.npz") as arrays:
        x, y, rms = arrays["x"], arrays["y"], arrays["rms"]
    column, row = (
        np.abs(axis[:, None] - response.probes[:, k]).argmin(axis=0)
        for k, axis in enumerate((x, y))
    )
    away = np.hypot(x[column] - response.probes[:, 0], y[row] - response.probes[:, 1])
    there = away < 1e-9
    steady = response.values[len(response.times) // 2 :].std(axis=0)
    assert there.any()
    np.testing.assert_allclose(
        rms[row[there], column[there]], steady[there], atol=0.02 * steady.max()
    )
