"""Shipped examples through the commands that take a scene; they give the same numbers."""

from pathlib import Path

import numpy as np
import pytest

from simple_model import Response
from skinwave.commands.cli import main
from skinwave.report.renderer import Renderer

EXAMPLES = {path.stem: path for path in (Path(__file__).parents[2] / "examples").glob("*.toml")}
# Numbers of one mesh agree, coarse or not. A half-space has no mesh; a sheet has modes.
SIZE = {"speed-on-forearm": [], "paper-sheet": [], "square-on-silicone": ["--element-size", "20"]}
REPORTED = ("palm", "speed-on-forearm")  # one with a mesh, one without
REDUCED = 0.05  # relative error of the reduced-order model of a whole body


@pytest.fixture
def result(tmp_path_factory, monkeypatch):
    """Folder of a command on an example, without three-dimensional pictures, on coarse models."""
    none = Renderer(is_available=False, detail="not asked")
    monkeypatch.setattr("skinwave.studies.report.renderer", lambda: none)
    monkeypatch.setattr("skinwave.studies.album.REDUCTION_TOLERANCE", REDUCED)

    def called(command, name, *options):
        out = tmp_path_factory.mktemp(command) / "out"
        size = SIZE.get(name, ["--element-size", "12"])
        asked = [command, str(EXAMPLES[name]), *size, *options, "--quiet", "--out", str(out)]
        assert main(asked) == 0
        return out

    return called


@pytest.mark.parametrize("name", sorted(EXAMPLES))
def test_every_example_is_compared(name, result):
    compared = result("compare", name)
    response = body_response(compared)
    assert np.ptp(response.values, axis=0).max() > 0
    assert (compared / "pictures/propagation.png").stat().st_size > 10_000
    if name in REPORTED:
        reported = result("report", name)
        check_map(next(reported.glob("*/map.npz")).parent, response)
        assert (reported / "pictures/snapshots.png").exists()


def body_response(folder):
    files = (file for file in Path(folder).rglob("responses.npz") if "kernel" not in str(file))
    for file in files:
        with np.load(file) as arrays:
            if {*arrays} - {"t", "probes", "displacement"} and not any("/" in n for n in arrays):
                model = next(n for n in arrays if n not in ("t", "probes", "displacement"))
                return Response(model=model, times=arrays["t"], probes=arrays["probes"],
                                values=arrays[model])  # fmt: skip
    raise AssertionError(f"no response in {folder}")


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
    found = rms[row[there], column[there]]
    np.testing.assert_allclose(found, steady[there], atol=0.02 * steady.max())
