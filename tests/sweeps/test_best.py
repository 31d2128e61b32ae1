"""Best values of a varied key, and their intervals."""

import os
from pathlib import Path

import numpy as np
import pytest

import skinwave
from simple_model import Response
from skinwave import models
from skinwave.commands.cli import main
from skinwave.models import Model, register
from skinwave.scene.spreads import spreads_of
from skinwave.sweeps import best, dataset
from skinwave.sweeps.sampling import samples
from skinwave.system import extensions


@pytest.fixture
def parabola():

    def solve(scene, times, options):
        c = (scene.body.solid.shear_modulus / scene.body.solid.density) ** 0.5
        speed, pressure = scene.tacton.trajectory.speed, scene.pressure.peak_pressure
        size = 1e-8 * pressure * (30 - (speed / c - 1.5) ** 2)
        waves = size * np.sin(2 * np.pi * 100 * times)
        values = np.outer(waves, np.ones(len(scene.probes)))
        return Response(model="parabola", times=times, probes=scene.probe_points, values=values)

    words = {"name": "parabola", "method": "", "words": ""}
    yield register(Model(**words, solve=solve, is_infinite=True))
    del models.MODELS.records["parabola"]
    os.environ.pop(extensions.VARIABLE)  # which processes of other tests would read


def test_a_best_value_is_refined_and_has_the_interval_of_its_samples(parabola):
    base = skinwave.loads(
        'tacton = { shape = "circle", duration_s = 0.02 }\nbody = { material = "palm" }\n'
        "probes = { points_mm = [[0, 0], [5, 0]] }"
    )
    asked = {"column": "peak_um[1]", "samples": 39, "model": "parabola"}
    found = skinwave.best_value(base, {"tacton.speed_m_per_s": "5:15:3"}, **asked)
    solid = base.body.solid
    assert found.value == pytest.approx(1.5 * (solid.shear_modulus / solid.density) ** 0.5)
    spreads = [each for each in spreads_of(base) if each.part == "material"]
    assert found.uncertain == tuple(each.key for each in spreads)
    speeds = np.clip(found.value * samples(spreads, 39)[:, 0] ** 0.5, 5, 15)
    assert found.interval == pytest.approx((5, speeds.max() + 0.1 * 5))
    assert found.interval[0] == found.limits[0]


def test_a_best_value_at_an_end_of_the_range_is_marked(scene, capsys):
    text = scene.read_text().replace("[body]", "[body]\nmaterial = 'ecoflex'")
    scene.write_text(text + "[focus]\npeak_pressure_pa = { value = 50, spread = 0 }\n")
    vary = ["--vary", "tacton.speed_m_per_s=4:8:3", "--model", "point-kernel"]
    column = "drawing_frequency_hz"  # which goes with the speed
    assert main(["sweep", str(scene), *vary, "--best", column, "--scheduler", "threads"]) == 0
    assert "8.00, an end of the range," in capsys.readouterr().out
    assert len(dataset.read(Path("short-sweep"))) == 3


def test_values_without_a_number_are_skipped():
    def column(runs):
        return np.array([-((r["x"] - r["c"]) ** 2) if r["x"] > 1 else np.nan for r in runs])

    values, _ = best.optima(column, "x", [0, 1, 2, 3, 4], [{"c": c} for c in (2.3, 0.5, 9.0)])
    np.testing.assert_allclose(values, [2.3, 2.0, 4.0])
    _, none = best.optima(lambda runs: np.full(len(runs), np.nan), "x", [1, 2, 3], [{}])
    assert np.isneginf(none)


def test_designs_without_a_best_value_are_refused_before_any_run(scene):
    for words in (
        "tacton.speed_m_per_s=4:8:3 tacton.size_mm=5:9:3", "body.material=palm,forearm,bone",
        "tacton.size_mm=5,9", "tacton.size_mm=5:9:3 --samples 9",
        "tacton.size_mm=5:9 --design lhs --samples 99",
    ):  # fmt: skip
        assert main(["sweep", str(scene), "--best", "level_db[0]", "--vary", *words.split()]) == 2
    assert not Path("short-sweep").exists()
    asked = ["sweep", str(scene), "--model", "point-kernel", "--vary", "tacton.size_mm=5:9:3"]
    for column in ("kernel_peak", "model", "kernel_peak_pa[9]"):
        assert main([*asked, "--best", column, "--scheduler", "threads", "--quiet"]) == 2
    assert len(dataset.read(Path("short-sweep"))) == 3
