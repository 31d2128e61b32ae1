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
        across = (scene.tacton.trajectory.size - 0.01) / 0.01
        size = 1e-8 * pressure * (30 - (speed / c - 1.5) ** 2 - across**2)
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

    grid = {"x": [0, 1, 2, 3, 4]}
    values, _ = best.optima(column, grid, [{"c": c} for c in (2.3, 0.5, 9.0)])
    np.testing.assert_allclose(values[:, 0], [2.3, 2.0, 4.0])
    _, none = best.optima(lambda runs: np.full(len(runs), np.nan), {"x": [1, 2, 3]}, [{}])
    assert np.isneginf(none)


def test_best_values_of_two_keys_are_those_of_a_surface():
    """On a quadratic function that turns the axes, of values in different units."""

    def level(runs):
        z = np.array([[r["x"] - r["c"], (r["y"] - 100 * r["c"]) / 100] for r in runs])
        return 5 - z[:, 0] ** 2 - z[:, 1] ** 2 - 1.2 * z[:, 0] * z[:, 1]

    grids = {"x": [0, 1, 2, 3, 4], "y": [0, 150, 200, 300, 400]}
    values, largest = best.optima(level, grids, [{"c": c} for c in (2.3, 0.6, 4.5)])
    np.testing.assert_allclose(values[:2], [[2.3, 230], [0.6, 60]], rtol=1e-6)
    np.testing.assert_allclose(largest[:2], 5)
    np.testing.assert_allclose(values[2], [4, 400], rtol=1e-6)


def test_best_values_of_two_keys_are_within_a_tenth_of_a_step_of_resonances():
    random, settings = np.random.default_rng(3), []
    for _ in range(60):
        angle = random.uniform(0, np.pi)
        settings.append({"c": random.uniform(1, 5, 2), "width": random.uniform(1, 2, 2),
                         "turn": [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]],
                         "skew": random.uniform(-0.3, 0.3, 2)})  # fmt: skip

    def level(runs):
        found = []
        for r in runs:
            z = (np.array([r["x"], r["y"]]) - r["c"]) @ r["turn"] / r["width"]
            found.append(-10 * np.log10(1 + (z**2 * (1 + r["skew"] * z / (1 + abs(z)))).sum()))
        return np.array(found)

    values, _ = best.optima(level, {"x": range(7), "y": range(7)}, settings)
    errors = np.abs(values - [each["c"] for each in settings]).max(axis=1)
    assert np.mean(errors <= best.ACCURACY) > 0.95


def test_the_speed_and_the_size_that_a_command_finds_together(parabola, scene, capsys):
    text = scene.read_text().replace("[body]", "[body]\nmaterial = 'ecoflex'")
    scene.write_text(text + "[focus]\npeak_pressure_pa = { value = 50, spread = 0 }\n")
    solid = skinwave.read(scene).body.solid
    best_speed = 1.5 * (solid.shear_modulus / solid.density) ** 0.5
    varied = [f"tacton.speed_m_per_s={best_speed - 2}:{best_speed + 3}:3", "tacton.size_mm=5:15:3"]
    words = ["--model", "parabola", "--best", "peak_um", "--plot", "--scheduler", "threads"]
    assert main(["sweep", str(scene), "--vary", *varied, *words]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert f"tacton.speed_m_per_s = {best_speed:.2f} and tacton.size_mm = 10.0 give" in said
    assert Path("short-sweep/figures/best-peak_um.png").stat().st_size > 5000


def test_designs_without_a_best_value_are_refused_before_any_run(scene):
    for words in (
        "tacton.speed_m_per_s=4:8:3 tacton.size_mm=5:9:3 body.thickness_mm=9:12:3",
        "tacton.speed_m_per_s=4:8:3 tacton.size_mm=5,9", "body.material=palm,forearm,bone",
        "tacton.size_mm=5,9", "tacton.size_mm=5:9:3 --samples 9",
        "tacton.size_mm=5:9 --design lhs --samples 99",
    ):  # fmt: skip
        assert main(["sweep", str(scene), "--best", "level_db[0]", "--vary", *words.split()]) == 2
    assert not Path("short-sweep").exists()
    asked = ["sweep", str(scene), "--model", "point-kernel", "--vary", "tacton.size_mm=5:9:3"]
    for column in ("kernel_peak", "model", "kernel_peak_pa[9]"):
        assert main([*asked, "--best", column, "--scheduler", "threads", "--quiet"]) == 2
    assert len(dataset.read(Path("short-sweep"))) == 3
