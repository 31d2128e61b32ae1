"""Sweeps: which runs, each once, in one table, whatever runs them and whatever ends."""

import csv
import json
import os
import subprocess
import sys
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import fem.affine
import fem.krylov
import skinwave
from simple_model import MovingPressure, Response, Tacton
from skinwave import models
from skinwave.commands.cli import main
from skinwave.models import Model, register
from skinwave.models.free_keys import free_keys, with_values
from skinwave.planning.simulate import compute
from skinwave.report.styles import style
from skinwave.scene.file import read, to_table
from skinwave.scene.scene import BODIES, Body, Layer, Scene
from skinwave.scene.spreads import spreads_of
from skinwave.scene.variation import cases, cases_of, combinations, parse
from skinwave.sweeps import best, dataset, engine, families, sweep_figures
from skinwave.sweeps import sweep as sweeping
from skinwave.sweeps.sampling import samples
from skinwave.system import extensions

THREADS = ["--scheduler", "threads", "--quiet"]
SMALL = ["body.size_x_mm=40", "body.size_y_mm=40", "body.sides=clamped"]
FOREARM = Path(__file__).parents[2] / "examples/speed-on-forearm.toml"


def varied(*texts):
    return [parse(text) for text in texts]


def swept(*arguments):
    assert main(["sweep", "short.toml", *map(str, arguments), *THREADS]) == 0
    return dataset.read(Path("short-sweep"))


def refused(capsys, *arguments):
    """The one sentence with which a call is refused."""
    assert main([str(argument) for argument in arguments]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "Traceback" not in said
    return said


def test_a_factorial_is_every_value_with_every_other():
    met = combinations(varied("tacton.speed_m_per_s=1:12:12", "body.thickness_mm=10,15"))
    assert len(met) == 24
    assert met[0] == {"tacton.speed_m_per_s": 1.0, "body.thickness_mm": 10}
    assert met[-1] == {"tacton.speed_m_per_s": 12.0, "body.thickness_mm": 15}


def test_zipped_values_meet_in_turn_and_must_be_as_many():
    met = combinations(varied("tacton.size_mm=5:15:3", "body.thickness_mm=9,10,11"), "zip")
    assert [tuple(each.values()) for each in met] == [(5, 9), (10, 10), (15, 11)]
    with pytest.raises(ValueError, match="lists of one length, not of 3, 2"):
        combinations(varied("tacton.size_mm=5:15:3", "body.thickness_mm=9,10"), "zip")


def test_a_latin_hypercube_meets_every_stratum_once_and_is_the_same_again():
    asked = varied("tacton.speed_m_per_s=2:12", "body.material=palm,forearm")
    met = combinations(asked, "lhs", 20)
    speeds = np.array([each["tacton.speed_m_per_s"] for each in met])
    np.testing.assert_array_equal(np.sort(((speeds - 2) / 0.5).astype(int)), np.arange(20))
    assert sorted(each["body.material"] for each in met) == 10 * ["forearm"] + 10 * ["palm"]
    assert met == combinations(asked, "lhs", 20)
    assert met != combinations(asked, "lhs", 20, seed=1)


def test_any_key_of_a_scene_can_be_varied(scene):
    texts = (
        "body.material.viscosity_pa_s=2,4",
        "probes.points_mm=[[0, 0]],[[1, 0], [2, 0]]",
        "tacton.sweep=one_way",
    )
    found = cases(scene, combinations(varied(*texts)))
    assert [case.scene.body.solid.viscosity for case in found] == [2, 2, 4, 4]
    assert found[0].scene.body.solid.shear_modulus == read(scene).body.solid.shear_modulus
    assert [len(case.scene.probes) for case in found] == [1, 2, 1, 2]
    bodies = cases(scene, combinations(varied("body=skin-slab,palm,none")))
    assert [case.scene.body.kind for case in bodies] == ["slab", "palm", "none"]
    assert len(cases(scene, combinations(varied("body.thickness_mm=10,10.0,15")))) == 2


def test_the_spreads_of_presets_can_be_varied(scene):
    """All moduli or all losses of a material times a factor, by the keys that samples have."""
    texts = ("body.material.modulus_scale=factor(1,3)", "body.material.loss_scale=0.5:2")
    met = combinations(varied(*texts), "sobol", 4)
    found = cases(scene, met)
    plain = read(scene).body.solid
    for case, each in zip(found, met, strict=True):
        modulus, loss = each.values()
        assert case.scene.body.solid == plain.scaled(modulus=modulus, loss=loss)
        assert case.keys["body.material.modulus_scale"] == modulus
    with pytest.raises(ValueError, match=r"no material for body.layers.3.material.loss_scale"):
        cases(scene, combinations(varied("body.layers.3.material.loss_scale=1,2")))
    with pytest.raises(ValueError, match="must be a number above 0"):
        cases(scene, combinations(varied("body.material.loss_scale=0,-1")))


def test_rows_say_what_was_commanded_and_what_came_out(scene):
    asked = ("tacton.speed_m_per_s=4,6", "body=skin-slab,none", "tacton.duration_s=0.3")
    rows = swept("--vary", *asked, "--csv")
    assert len(rows) == 4
    assert {(row["model"], row["body.kind"]) for row in rows} == {
        ("flat-body", "slab"), ("point-kernel", "none"),
    }  # fmt: skip
    waves = next(row for row in rows if row["body.kind"] == "slab")
    assert waves["f_AM_hz"] == 200
    assert len(waves["f_AM_um"]) == len(waves["level_db"]) == 2
    assert waves["peak_um"][0] > waves["f_AM_um"][0] > 0
    assert {waves["kernel_spread_6db_mm"], waves["spread_6db_mm"]} <= {0, 10}
    assert max(map(abs, waves["kernel_delay_ms"])) < 50
    assert waves["drawing_frequency_hz"] == pytest.approx(waves["tacton.speed_m_per_s"] / 0.0314159)
    (scene.parent / "again.toml").write_text(waves["scene"])
    assert read("again.toml").tacton.trajectory.speed == waves["tacton.speed_m_per_s"]
    header, *lines = (scene.parent / "short-sweep/rows.csv").read_text().splitlines()
    assert "f_AM_um[1]" in header
    assert sum("done" in line for line in lines) == 4


def test_a_failing_combination_is_a_row_with_its_error(scene):
    rows = swept(
        "--vary", "body.size_x_mm=60,10", "tacton.size_mm=10,50,70", "body.thickness_mm=15,inf"
    )
    failed = [row["error"] for row in rows if row["status"] == "failed"]
    assert len(rows) == 12
    assert len(failed) == 8
    assert sum("off the body" in error for error in failed) == 4
    assert sum("outside 0..60 mm" in error for error in failed) == 4
    rows = swept(
        "--vary", "body.thickness_mm=15,inf", "tacton.size_mm=11", "--model", "fem", "--h", 15
    )
    errors = {row["body.thickness_mm"]: row["error"] for row in rows if row["tacton.size_mm"] == 11}
    assert errors[15] == ""
    assert "inf has no mesh" in errors[np.inf]


def test_what_is_there_is_not_run_again(scene, monkeypatch, capsys):
    vary = ["--vary", "tacton.speed_m_per_s=4,6", "tacton.size_mm=10,80"]
    first = swept(*vary)
    monkeypatch.setattr(sweeping, "_row", None)  # any run would fail
    assert swept(*vary) == first
    monkeypatch.undo()
    os.chdir(scene.parent)
    assert main(["sweep", "short.toml", "--vary", "tacton.speed_m_per_s=4,6,8", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["there_before"], summary["done"]) == (2, 1)
    assert len(swept(*vary)) == len(first) + 1


def test_bodies_are_prepared_once(scene, monkeypatch):
    prepared, inner = [], sweeping.prepare
    counted = lambda *a, **k: prepared.append((a, k)) or inner(*a, **k)  # noqa: E731
    monkeypatch.setattr(sweeping, "prepare", counted)
    sweeping._prepared.cache_clear()
    rows = swept("--vary", "tacton.speed_m_per_s=2:8:6", "body.thickness_mm=12,13",
                 *SMALL, "--model", "fem", "--h", 7,
                 "--workers", 1)  # fmt: skip
    assert {row["status"] for row in rows} == {"done"}
    assert len(prepared) == len({(a[0], k["h"]) for a, k in prepared}) == 4  # two meshes each
    assert all(row["dofs"] > 500 and row["energy_imbalance"] < 0.01 for row in rows)


MODULI = "body.material.shear_modulus_pa=20e3:50e3:8"
ON_SMALL = [*SMALL, "tacton.duration_s=0.3", "--model", "fem", "--h", 7, "--workers", 1]


def counted(monkeypatch, folder):
    """Factorisations from here on, with a cache of their own."""
    monkeypatch.setenv("SKINWAVE_CACHE", str(folder))
    sweeping._prepared.cache_clear()
    families.reduced.cache_clear()
    made = []
    for module, name in ((fem.krylov, "factorise"), (fem.affine, "factoriser")):
        inner = getattr(module, name)
        counting = lambda *a, inner=inner, **k: made.append(a) or inner(*a, **k)  # noqa: E731
        monkeypatch.setattr(module, name, counting)
    return made


def assert_lines_agree(rows, others, tolerance):
    for row, other in zip(rows, others, strict=True):
        lines = [name for name in row if name.endswith("_um") and row[name]]
        assert len(lines) > 3
        largest = max(max(other[name]) for name in lines)
        for name in lines:
            least = 0.01 * largest
            np.testing.assert_allclose(row[name], other[name], tolerance, tolerance * least)


def test_bodies_of_many_materials_are_reduced_together(scene, monkeypatch, tmp_path):
    made = counted(monkeypatch, tmp_path / "cold")
    asked = ["--vary", MODULI, *ON_SMALL]
    rows = swept(*asked)
    assert 0 < len(made) < len(rows) == 8
    assert {(row["status"], row["reduced_together"]) for row in rows} == {("done", 8)}
    assert all(0 < row["reduction_error"] < row["expected_error"] for row in rows)
    made.clear()
    assert swept(*asked, "--out", "short-sweep") == rows
    assert not made, "rows that are there are not run again"
    Path("short-sweep").rename("together")
    monkeypatch.setattr(families, "LEAST", 9)
    alone = swept(*asked)
    assert len(made) == 16
    assert {row["reduced_together"] for row in alone} == {1}
    assert_lines_agree(rows, alone, 0.01)
    for row, other in zip(rows, alone, strict=True):
        assert row["expected_error"] == pytest.approx(other["expected_error"], rel=0.1)


def test_factors_on_all_moduli_share_a_reduction(scene, monkeypatch, tmp_path):
    counted(monkeypatch, tmp_path / "cold")
    asked = ["--vary", "body.material.modulus_scale=0.8:2.0:6", *ON_SMALL]
    rows = swept(*asked)
    assert {(row["status"], row["reduced_together"]) for row in rows} == {("done", 6)}
    Path("short-sweep").rename("together")
    monkeypatch.setattr(families, "LEAST", 9)
    alone = swept(*asked)
    assert {row["reduced_together"] for row in alone} == {1}
    assert_lines_agree(rows, alone, 0.01)


def families_of(body, *varied, design="factorial"):
    """How many bodies of a sweep share a model, each of which has its own materials."""
    table = to_table(Scene(pressure=MovingPressure(tacton=Tacton(am_frequency=140)), body=body))
    points = cases_of(table, table, combinations([parse(each) for each in varied], design))
    hardest = {sweeping._key(point.scene): point for point in points}
    found = families.families(hardest, 0.05)
    for family, members in found:
        keys = free_keys(family.scene.body, {k: (a, b) for k, a, b in family.ranges})
        for (body, *_), values in members.items():
            own = with_values(family.scene.body, keys, dict(values))
            assert own.solids == body.solids
            assert own.depth == pytest.approx(body.depth, rel=1e-9)
    return sorted(len(members) for _, members in found)


SCALED, LOSSES = "body.material.modulus_scale", "body.material.loss_scale"


def test_bodies_of_a_family_have_their_own_materials():
    moduli = "body.material.shear_modulus_pa=20e3,22e3,24e3,26e3,28e3,30e3"
    small = Body(width=0.04, height=0.04, depth=0.01, sides="clamped")
    apart = "body.size_x_mm=40,40,40,40,40,40,50,50,50,50,50,50"
    factors = f"{SCALED}=1,1,1,1,1,1,2,2,2,2,2,2"
    twice = f"{moduli},{moduli.partition('=')[2]}"
    assert families_of(small, apart, factors, twice, design="zip") == [6]
    assert families_of(small, f"{SCALED}=0.7:1.6:6", f"{LOSSES}=0.5:2.1:7") == [42]


def test_few_thicknesses_are_families_of_their_own():
    moduli = "body.material.shear_modulus_pa=20e3:30e3:7"
    for body in (BODIES["palm"], BODIES["skin-slab"]):
        assert families_of(body, moduli, "body.thickness_mm=15,16") == [7, 7]
    layered = replace(BODIES["palm"], layers=(Layer(thickness=5e-3, material="fat"),))
    few = "body.thickness_mm=15,16,17"
    assert families_of(layered, moduli, few) == [7, 7, 7]
    assert families_of(BODIES["palm"], "body.thickness_mm=14:18:21") == [21]


def test_thicknesses_share_a_reduction_where_there_are_many(scene, monkeypatch):
    monkeypatch.setattr(families, "THICKNESS", 3)
    asked = ["--vary", "body.thickness_mm=10,11,12", *ON_SMALL]
    rows = swept(*asked)
    assert {(row["status"], row["reduced_together"]) for row in rows} == {("done", 3)}
    monkeypatch.undo()
    os.chdir(scene.parent)
    Path("short-sweep").rename("together")
    assert_lines_agree(rows[2:], swept(*asked)[2:], 0.01)  # of one mesh: that of the thickest


def test_what_cannot_be_reduced_together_is_reduced_alone(scene, monkeypatch):
    monkeypatch.setattr(families, "LEAST", 2)

    def refusing(*given, **options):
        raise ValueError("the tolerance is out of reach")

    monkeypatch.setattr(families.parametric, "prepare", refusing)
    rows = swept("--vary", "body.material.shear_modulus_pa=20e3,30e3", *ON_SMALL)
    assert {(row["status"], row["reduced_together"]) for row in rows} == {("done", 1)}


def test_a_body_whose_family_has_a_coarse_mesh_has_its_own(scene, monkeypatch):
    monkeypatch.setattr(families, "LEAST", 2)
    inner = families.refined
    coarse = lambda *given, **options: replace(inner(*given, **options), h=8e-3)  # noqa: E731
    monkeypatch.setattr(families, "refined", coarse)
    tolerance = 0.1
    rows = swept(
        "--vary", "body.material.shear_modulus_pa=20e3,30e3", *SMALL, "body.thickness_mm=8",
        "--model", "fem", "--tolerance", tolerance, "--workers", 1,
    )  # fmt: skip
    assert {(row["status"], row["reduced_together"]) for row in rows} == {("done", 1)}
    assert all(row["h_mm"] < 8 and row["expected_error"] < tolerance for row in rows)


def test_families_differ_in_what_can_be_free_alone(scene):
    others = ("body.material.poisson=0.45,0.49", "body.size_x_mm=60,70", "tacton.size_mm=8,9")
    found = cases(scene, combinations(varied(MODULI, *others)))
    bodies = {(c.scene.body, c.scene.probes, c.scene.reading, c.scene.load): c for c in found}
    assert len(bodies) == 32
    shared = families.families(bodies, 0.05)
    assert [family.members for family, _ in shared] == 4 * [8]
    for family, members in shared:
        (limit,) = family.ranges
        assert limit == ("body.material.shear_modulus_pa", 20e3, 50e3)
        assert family.scene.body.solid.shear_modulus == 20e3  # the shortest waves
        for (body, *_), ((_, value),) in members.items():
            assert body.solid.shear_modulus == value
            assert body.solid.poisson == family.scene.body.solid.poisson
    assert not families.families(bodies, 0.05, workers=8)


def test_each_row_says_how_wrong_its_mesh_is(scene):
    smaller = [*SMALL, "body.thickness_mm=8"]
    rows = swept(
        "--vary", "tacton.am_frequency_hz=80,300", *smaller, "--model", "fem", "--tolerance", 0.3
    )
    errors = [row["expected_error"] for row in rows]
    assert all(0 < error < 0.3 for error in errors)
    assert rows[0]["h_mm"] == rows[1]["h_mm"]


def test_wrong_keys_and_values_are_one_sentence(scene, capsys):
    ask = lambda *texts: refused(capsys, "sweep", scene, "--vary", *texts)  # noqa: E731
    assert "did you mean 'tacton.speed_m_per_s'" in ask("tacton.speed_m_s=1,2")
    assert "zzzz' is no key of a scene; a key is of the form tacton.size_mm" in ask("zzzz=1")
    assert "lacks values" in ask("tacton.size_mm=")
    assert "did you mean 'square'" in ask("tacton.shape=circle,sqare")
    assert "must be a number" in ask("tacton.size_mm=wide,10")
    assert "is no file and none of" in ask("body=moon")
    assert "varied twice" in ask("tacton.size_mm=1", "tacton.size_mm=2")
    assert "whole number" in ask("tacton.size_mm=1:2:2.5")
    assert "add :n" in ask("tacton.size_mm=1:2")
    assert "no combination makes a scene" in ask("tacton.size_mm=70,80")
    assert "runs are outside" in ask("tacton.size_mm=1:2:1000", "body.thickness_mm=1:2:1000")
    assert "lhs needs it" in ask("tacton.size_mm=1:2", "--design", "lhs")
    assert "design 'latin' is unknown" in ask("tacton.size_mm=1,2", "--design", "latin")
    assert "below 1" in ask("tacton.size_mm=1,2", "--workers", "0")
    assert "is none of processes, threads" in ask("tacton.size_mm=1,2", "--scheduler", "cloud")
    assert "holds no sweep" in ask("tacton.size_mm=1,2", "--out", ".")
    assert "no rows" in refused(capsys, "plot", "nowhere")
    assert not (scene.parent / "short-sweep").exists()


def test_a_missing_extra_is_one_sentence_with_its_cure(scene, capsys, monkeypatch):
    monkeypatch.setattr(engine, "find_spec", lambda name: None)
    said = refused(capsys, "sweep", scene, "--vary", "tacton.size_mm=1,2")
    assert "pip install 'skinwave[sweep]'" in said
    said = refused(
        capsys, "sweep", scene, "--vary", "tacton.size_mm=1,2", "--scheduler", "tcp://a:1"
    )
    assert "pip install 'skinwave[cluster]'" in said


@pytest.mark.filterwarnings("ignore")  # of Dask's own event loop
def test_a_scheduler_that_is_not_there_is_one_sentence(scene, capsys, monkeypatch):
    monkeypatch.setattr(engine, "CONNECTED", 0.5)
    nowhere = ["--scheduler", "tcp://127.0.0.1:9"]
    said = refused(capsys, "sweep", scene, "--vary", "tacton.size_mm=1,2", *nowhere)
    assert "no scheduler responds at tcp://127.0.0.1:9" in said
    assert "no scheduler responds" in refused(capsys, "run", scene, "--quiet", *nowhere)
    assert sorted(path.name for path in scene.parent.iterdir()) == ["short.toml"]


def test_the_forearm_gives_way_most_near_the_rayleigh_speed(tmp_path, monkeypatch):
    """Largest deflection on a circle of 100 mm around, in um/Pa, by Hankel transforms."""
    monkeypatch.chdir(tmp_path)
    table = dict(zip(
        [1, 2, 3, 4, 6, 8, 10, 18],
        [0.362, 0.402, 0.409, 0.366, 0.260, 0.194, 0.162, 0.120],
        strict=True,
    ))  # fmt: skip
    speeds = [*table, 2.5, 2.75]
    vary = f"tacton.speed_m_per_s={','.join(map(str, speeds))}"
    assert main(["sweep", str(FOREARM), "--vary", vary, "--out", "out", *THREADS]) == 0
    rows = dataset.read(Path("out"))
    peaks = {row["tacton.speed_m_per_s"]: row["peak_um"][0] / 50 for row in rows}
    np.testing.assert_allclose([peaks[v] for v in table], list(table.values()), rtol=0.05)
    assert max(peaks, key=peaks.get) == pytest.approx(rows[0]["rayleigh_speed_m_per_s"], rel=0.15)
    figure = sweep_figures.speed_figure(rows, None, style("report"))
    assert [ax.get_ylabel() for ax in figure.axes] == ["largest displacement, µm",
                                                       "sensation level, dB"]  # fmt: skip
    assert figure.axes[1].get_xlabel() == "drawing speed, m/s"
    dashed = [line for line in figure.axes[0].lines if line.get_linestyle() == "--"]
    assert dashed[0].get_xdata()[0] == pytest.approx(2.68, abs=0.01)


@pytest.fixture
def parabola():
    """A model whose motion is a parabola over the speed, largest at 1.5 times the shear speed."""

    def solve(scene, times, options):
        c = (scene.body.solid.shear_modulus / scene.body.solid.density) ** 0.5
        speed, pressure = scene.tacton.trajectory.speed, scene.pressure.peak_pressure
        size = 1e-8 * pressure * (30 - (speed / c - 1.5) ** 2)
        waves = size * np.sin(2 * np.pi * 100 * times)
        return Response(
            model="parabola", times=times, probes=scene.probe_points,
            values=np.outer(waves, np.ones(len(scene.probes))),
        )  # fmt: skip

    yield register(
        Model(name="parabola", method="", words="", solve=solve, error=None, is_infinite=True)
    )
    del models._MODELS["parabola"]
    os.environ.pop(extensions.VARIABLE)  # which processes of other tests would read


def test_a_best_value_is_refined_and_has_the_interval_of_its_samples(parabola):
    """Speeds of shear waves go with the root of the modulus."""
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
    assert "The interval reaches an end of the range" in found.words


def test_a_best_value_at_the_end_of_the_range_is_called_so(scene, capsys):
    text = scene.read_text().replace("[body]", "[body]\nmaterial = 'ecoflex'")
    scene.write_text(text + "[focus]\npeak_pressure_pa = { value = 50, spread = 0 }\n")
    vary = ["--vary", "tacton.speed_m_per_s=4:8:3", "--model", "point-kernel"]
    column = "drawing_frequency_hz"  # which goes with the speed
    assert main(["sweep", str(scene), *vary, "--best", column, *THREADS[:2]]) == 0
    said = capsys.readouterr().out
    assert f"tacton.speed_m_per_s = 8.00, an end of the range, gives the largest {column}" in said
    assert "no interval, because no uncertain number of the scene moves it" in said
    assert len(dataset.read(Path("short-sweep"))) == 3


def test_values_without_a_number_are_no_best_value():
    found = best.optima(
        lambda runs: np.array([-((r["x"] - r["c"]) ** 2) if r["x"] > 1 else np.nan for r in runs]),
        "x", [0, 1, 2, 3, 4], [{"c": 2.3}, {"c": 0.5}, {"c": 9.0}],
    )  # fmt: skip
    np.testing.assert_allclose(found[0], [2.3, 2.0, 4.0])
    assert np.isneginf(
        best.optima(lambda runs: np.full(len(runs), np.nan), "x", [1, 2, 3], [{}])[1]
    )


@pytest.mark.parametrize(
    ("arguments", "cure"),
    [
        (["tacton.speed_m_per_s=4:8:3", "tacton.size_mm=5:9:3"], "2 are varied; vary one and"),
        (["body.material=palm,forearm,bone"], "all numbers; give body.material=start:stop:n"),
        (["tacton.size_mm=5,9"], "at least three values"),
        (["tacton.size_mm=5:9:3", "--best", "levl_db"], "did you mean 'level_db'"),
        (["tacton.size_mm=5:9:3", "--best", "model"], "holds words; choose one of numbers"),
        (["tacton.size_mm=5:9:3", "--best", "peak_um[9]"], "take one of peak_um[0] to peak_um"),
        (["tacton.size_mm=5:9:3", "--samples", "9"], "give 39 or more"),
        (["tacton.size_mm=5:9", "--design", "lhs", "--samples", "99"], "lhs; leave it out"),
    ],
)
def test_what_has_no_best_value_is_refused_before_any_run(scene, capsys, arguments, cure):
    assert cure in refused(capsys, "sweep", scene, "--best", "level_db[0]", "--vary", *arguments)
    assert not Path("short-sweep").exists()


def test_plots_are_drawn_with_units(scene):
    swept("--vary", "tacton.speed_m_per_s=4,6", "tacton.size_mm=8,10,70")
    for kind in ("png", "svg", "pdf"):
        check_plots(kind)


def test_a_plot_of_factors_groups_by_them_and_not_by_the_material_they_make(scene, capsys):
    kernel = ["--model", "point-kernel"]
    swept("--vary", "body.material.modulus_scale=0.5,1,2", "tacton.size_mm=8,9", *kernel)
    capsys.readouterr()
    assert main(["plot", "short-sweep", "--column", "kernel_peak_pa", "--json"]) == 0
    name = Path(json.loads(capsys.readouterr().out)["figures"][0]).stem
    assert name == "kernel_peak_pa-over-body_material_modulus_scale-and-tacton_size_mm"


def test_rows_keep_the_order_of_the_design(scene):
    kernel = ["--model", "point-kernel"]
    vary = ["--vary", "tacton.speed_m_per_s=8,4,70,6", "tacton.size_mm=9,8", *kernel]
    rows = swept(*vary)
    design = [(v, d) for v in (8, 4, 70, 6) for d in (9, 8)]
    at = lambda row: (row["tacton.speed_m_per_s"], row["tacton.size_mm"])  # noqa: E731
    assert [at(row) for row in rows] == design
    assert [row["index"] for row in rows] == list(range(8))
    for part in list(Path("short-sweep/rows").glob("*.parquet"))[::2]:
        part.unlink()
    assert [row["key"] for row in swept(*vary)] == [row["key"] for row in rows]  # gone on with
    more = swept("--vary", "tacton.speed_m_per_s=5,4", "tacton.size_mm=9", "--csv", *kernel)
    assert [at(row) for row in more] == [*design, (5, 9)]
    assert [row["index"] for row in more] == list(range(9))
    with open("short-sweep/rows.csv", newline="") as file:
        lines = list(csv.DictReader(file))
    assert [line["index"] for line in lines] == list(map(str, range(9)))


def test_rows_of_an_older_release_have_no_index(tmp_path):
    dataset.open_folder(tmp_path)
    for k in (2, 1):
        dataset.append(tmp_path, [{"key": f"row{k}"}], {"key": "text"})
    assert [row["key"] for row in dataset.read(tmp_path)] == ["row1", "row2"]
    assert dataset.names(tmp_path) == {"row1": None, "row2": None}
    assert dataset.numbered(["row3", "row1"], dataset.names(tmp_path)) == {"row3": 2}


def long_texts(folder, rows=20_000, length=4000):
    """Rows with one text in all of them: a file of a few kilobytes."""
    dataset.open_folder(folder)
    table = pa.table({
        "key": [f"row{k}" for k in range(rows)], "status": ["done"] * rows,
        "error": pa.array(["x" * length] * rows),
    })  # fmt: skip
    pq.write_table(table, folder / "rows/part-a.parquet")


def test_rows_that_unpack_to_more_than_a_limit_are_refused(tmp_path, monkeypatch):
    long_texts(tmp_path)
    monkeypatch.setattr(dataset, "UNPACKED", 10_000_000)
    with pytest.raises(ValueError, match="unpacks to more than 10 MB"):
        dataset.read(tmp_path)
    assert len(dataset.names(tmp_path)) == 20_000, "of other columns nothing is decoded"


def test_the_limit_is_for_all_parts_together(tmp_path, monkeypatch):
    long_texts(tmp_path, rows=1000)
    assert len(dataset.read(tmp_path)) == 1000
    part = tmp_path / "rows/part-a.parquet"
    for name in "bc":
        (tmp_path / f"rows/part-{name}.parquet").write_bytes(part.read_bytes())
    monkeypatch.setattr(dataset, "UNPACKED", 10_000_000)
    with pytest.raises(ValueError, match="unpacks to more than 10 MB"):
        dataset.read(tmp_path)


def test_lists_that_are_long_are_refused_before_they_are_decoded(tmp_path, monkeypatch):
    """Zeros take next to nothing in the file, and one batch of rows would be all of them."""
    dataset.open_folder(tmp_path)
    lists = pa.array([np.zeros(2_000_000)])
    table = pa.table({"key": ["row"], "status": ["done"], "tacton.a": lists})
    pq.write_table(table, tmp_path / "rows/part-a.parquet")
    assert len(dataset.read(tmp_path)[0]["tacton.a"]) == 2_000_000
    monkeypatch.setattr(dataset, "UNPACKED", 10_000_000)
    monkeypatch.setattr(pq.ParquetFile, "iter_batches", None)
    with pytest.raises(ValueError, match="unpacks to more than 10 MB"):
        dataset.read(tmp_path)


def hypercube(samples):
    """Rows whose column is the sum of two keys, which meet as in a Latin hypercube."""
    keys = ("tacton.speed_m_per_s=2:12", "tacton.size_mm=5:20")
    met = combinations(varied(*keys), "lhs", samples)
    return [each | {"status": "done", "peak_um": sum(each.values())} for each in met]


def test_a_latin_hypercube_is_drawn_as_points_with_the_other_key_as_colour():
    speed, size = "tacton.speed_m_per_s", "tacton.size_mm"
    rows = hypercube(20)
    figure = sweep_figures.line_figure(rows, "peak_um", speed, size, style("report"))
    ax, bar = figure.axes
    assert bar.get_ylabel() == "size of the path, mm"
    assert ax.get_legend() is None
    drawn = sorted((line.get_xdata()[0], line.get_ydata()[0]) for line in ax.lines)
    assert drawn == sorted((row[speed], row["peak_um"]) for row in rows)
    assert max(len(line.get_xdata()) for line in ax.lines) == 1  # nothing is joined
    rows = [row | {"level_db": 1.0, "rayleigh_speed_m_per_s": 5.0} for row in rows]
    legend = sweep_figures.speed_figure(rows, size, style("report")).axes[0].get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["Rayleigh speed $c_R$ without loss"]
    heat = sweep_figures.heat_figure(rows, "peak_um", speed, size, style("report"))
    points = heat.axes[0].collections[0]
    np.testing.assert_allclose(points.get_offsets()[:, 0], [row[speed] for row in rows])
    np.testing.assert_allclose(points.get_array(), [row["peak_um"] for row in rows])
    third = [row | {"body.thickness_mm": 10.0 + k} for k, row in enumerate(rows)]
    alone = sweep_figures.line_figure(third, "peak_um", speed, None, style("report"))
    assert [line.get_linestyle() for line in alone.axes[0].lines] == ["None"]


def test_curves_of_many_values_have_a_colour_bar():
    rows = [{"tacton.speed_m_per_s": float(v), "tacton.size_mm": float(d), "status": "done",
             "peak_um": float(v + d)} for v in range(3) for d in range(12)]  # fmt: skip
    keys = ("tacton.speed_m_per_s", "tacton.size_mm")
    figure = sweep_figures.line_figure(rows, "peak_um", *keys, style("print"))
    assert [len(line.get_xdata()) for line in figure.axes[0].lines] == 12 * [3]
    assert {line.get_linestyle() for line in figure.axes[0].lines} == {"-"}
    assert len(figure.axes) == 2
    assert figure.get_figwidth() == 3.5


def check_plots(kind):
    drawn = ["plot", "short-sweep", "--format", kind, "--quiet"]
    assert main([*drawn, "--column", "f_AM_um[1]"]) == 0
    assert main([*drawn, "--column", "spread_6db_mm", "--heat"]) == 0
    assert main([*drawn, "--preset", "speed"]) == 0
    files = list(Path("short-sweep/figures").glob(f"*.{kind}"))
    assert len(files) == 3
    assert all(file.stat().st_size > 5000 for file in files)
    if kind == "pdf":
        assert not any(b"/Type3" in file.read_bytes() for file in files)
    if kind == "svg":
        text = "".join(file.read_text() for file in files)
        assert text.count("<text") > 30
        assert "drawing speed, m/s" in text
        assert "size of the path, mm" in text


def test_a_plot_of_what_is_not_there_is_one_sentence(scene, capsys):
    swept("--vary", "tacton.speed_m_per_s=4,6")
    assert "column 'peak' is unknown" in refused(capsys, "plot", "short-sweep", "--column", "peak")
    assert "did you mean 'peak_um'" in refused(capsys, "plot", "short-sweep", "--column", "peak")
    assert "two varied keys" in refused(capsys, "plot", "short-sweep", "--heat")
    assert "no finite number" in refused(
        capsys, "plot", "short-sweep", "--column", "sensation_line"
    )


COSTS = ("seconds", "peak_memory_gib")  # which differ from run to run


def same(first, second):
    """Two tables, but for their order and what they cost."""
    assert len(first) == len(second)
    for row, other in zip(
        *(sorted(t, key=lambda r: r["key"]) for t in (first, second)), strict=True
    ):
        for name in row.keys() - set(COSTS):
            if isinstance(row[name], float | list) and row[name] != []:
                np.testing.assert_allclose(
                    np.array(row[name], float), np.array(other[name], float), rtol=1e-10, atol=1e-12
                )
            else:
                assert row[name] == other[name], name


@pytest.fixture
def address(monkeypatch):
    """The address of a Dask scheduler with two workers, each a process."""
    from distributed import LocalCluster

    path = os.pathsep.join([str(Path(__file__).parents[2]), *sys.path])
    monkeypatch.setenv("PYTHONPATH", path)  # workers find this checkout, whatever is installed
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        yield cluster.scheduler_address


VARY = ["--vary", "tacton.speed_m_per_s=4,6", "tacton.am_frequency_hz=0,100"]
FEM = [*SMALL, "--model", "fem", "--h", "10", "--quiet"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of Dask's own event loop
def test_processes_and_a_cluster_give_the_same_table(scene, address):
    sweep = ["sweep", "short.toml", *VARY, *FEM]
    assert main([*sweep, "--out", "here"]) == 0
    assert main([*sweep, "--out", "there", "--scheduler", address]) == 0
    same(dataset.read(Path("here")), dataset.read(Path("there")))
    short = replace(read(scene), body=Body(width=0.04, height=0.04, sides="clamped"))
    with engine.mapped_on(address) as mapped:
        spread = compute(short, "fem-harmonic", h=0.015, mapped=mapped).displacement
    here = compute(short, "fem-harmonic", h=0.015).displacement
    np.testing.assert_allclose(spread, here, rtol=1e-10, atol=1e-10 * abs(here).max())


def whole(rows, count):
    assert len(rows) == len({row["key"] for row in rows}) == count
    assert len({row["tacton.speed_m_per_s"] for row in rows}) == count
    assert {row["status"] for row in rows} == {"done"}
    parts = Path("short-sweep/rows").glob("part-*.parquet")
    assert sum(pq.read_metadata(part).num_rows for part in parts) == count


def test_an_interrupted_sweep_goes_on_without_a_row_lost_or_doubled(scene, monkeypatch, capsys):
    """Ctrl-C as the fourth row is written."""
    command = ["--vary", "tacton.speed_m_per_s=3:8:7", "--model", "point-kernel"]
    inner, written = dataset.append, []

    def interrupted(*given):
        if len(written) == 3:
            raise KeyboardInterrupt
        written.append(given)
        inner(*given)

    with monkeypatch.context() as patch:
        patch.setattr(dataset, "append", interrupted)
        assert main(["sweep", "short.toml", *command, *THREADS]) == 1
    assert "interrupted; 4 runs are missing" in capsys.readouterr().err
    whole(dataset.read(Path("short-sweep")), 3)
    whole(swept(*command), 7)


DYING = """
import os
def work(mark, item):  # the second item ends the process when it is first computed
    if item == 1 and not mark.exists():
        mark.touch()
        os._exit(9)
    return item
"""


def test_what_a_worker_was_at_when_it_died_is_done_again(tmp_path, monkeypatch):
    (tmp_path / "dying.py").write_text(DYING)
    monkeypatch.syspath_prepend(tmp_path)
    work = partial(import_module("dying").work, tmp_path / "died")
    found = {}
    engine.run_all(work, range(4), "processes", 1, found.__setitem__)
    assert found == {k: k for k in range(4)}


def test_keys_of_0_2_are_varied_by_todays_names():
    with pytest.warns(FutureWarning, match="depth_mm is now thickness_mm"):
        assert parse("body.depth_mm=10,15").key == "body.thickness_mm"


def test_one_sweep_at_a_time_writes_into_a_folder(scene, capsys):
    """Its rows would be doubled; the next one finds them, and a process that ends lets go."""
    folder = dataset.open_folder(Path("short-sweep"))
    arguments = ["sweep", "short.toml", "--vary", "body.thickness_mm=10,15", *THREADS]
    with dataset.locked(folder):
        assert "another sweep writes into short-sweep" in refused(capsys, *arguments)
    there = "import os, sys; from pathlib import Path; from skinwave.sweeps import dataset; "
    held = "held = dataset.locked(Path(sys.argv[1])); held.__enter__(); os._exit(0)"
    subprocess.run([sys.executable, "-c", there + held, str(folder)], check=True)
    with dataset.locked(folder):
        assert not dataset.names(folder)
