"""Runs of a sweep: what their rows say, and which bodies share a reduction."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fem.affine
import fem.krylov
from simple_model import Effort, MovingPressure, Response, Tacton, sensation_level
from skinwave.commands.cli import main
from skinwave.models import covering
from skinwave.models.free_keys import free_keys, with_values
from skinwave.models.options import SolveOptions
from skinwave.scene.file import read, to_table
from skinwave.scene.scene import BODIES, Body, Layer, Scene, without_tacton
from skinwave.scene.variation import DesignPoint, cases_of, combinations, parse
from skinwave.sweeps import dataset, reductions
from skinwave.sweeps.measures import input_columns, result_columns

SMALL = ["body.size_x_mm=40", "body.size_y_mm=40", "body.sides=clamped"]
ON_SMALL = [*SMALL, "tacton.duration_s=0.3", "--model", "fem", "--element-size", 7, "--workers", 1]
MODULI = "body.material.shear_modulus_pa=20e3:50e3:8"
SCALED, LOSSES = "body.material.modulus_scale", "body.material.loss_scale"
FOREARM = Path(__file__).parents[2] / "examples/speed-on-forearm.toml"


def swept(*arguments, out="short-sweep", scene="short.toml"):
    asked = ["sweep", scene, "--scheduler", "threads", "--quiet", "--out", out]
    code, rows = main([*asked, "--vary", *map(str, arguments)]), dataset.read(Path(out))
    assert code == any(row["status"] == "failed" for row in rows)
    return rows


def test_rows_have_inputs_and_results(scene):
    rows = swept("tacton.speed_m_per_s=4,6", "body=skin-slab,none", "tacton.duration_s=0.3")
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
    Path("again.toml").write_text(waves["scene"])
    assert read("again.toml").tacton.trajectory.speed == waves["tacton.speed_m_per_s"]


def test_columns_of_a_known_motion():
    f, delay, amplitudes = 140.0, 1e-3, np.array([1.0, 0.2, 0.15])  # Hz, s, um
    probes = ((0.0, 0.0), (0.005, 0.0), (0.01, 0.0))
    load = MovingPressure(tacton=Tacton(am_frequency=f, duration=0.5))
    scene = Scene(pressure=load, body=Body(), probes=probes)
    times = np.arange(5000) / 1e4
    pressure = load(scene.probe_points, times)
    phase = 2 * np.pi * f * (times - delay)
    values = 1e-6 * (amplitudes * np.sin(phase)[:, None] - 0.3)
    values[:20] *= 10  # left out of the largest value
    response = Response(
        model="known", times=times, probes=np.array(probes), values=values,
        effort=Effort(peak_memory=3 * 2**30),
    )  # fmt: skip
    row = result_columns(scene, response)
    scale = (pressure * values).sum() / (values**2).sum()
    misfit = np.linalg.norm(scale * values - pressure, axis=0) / np.linalg.norm(pressure, axis=0)
    kernel = 50 / 2 * np.exp(-(scene.probe_points[:, 0] ** 2) / 2 / 0.00435**2)
    lines = {"f_AM_um": amplitudes, "f_AM_ratio": abs(scale) * 1e-6 * amplitudes / kernel,
             "level_db": sensation_level(1e-6 * amplitudes, f)}  # fmt: skip
    for name, expected in lines.items():
        np.testing.assert_allclose(row[name], expected, rtol=1e-3, err_msg=name)
    found = [row[f"{part}_{drop}db_mm"] for part in ("kernel_spread", "spread") for drop in (6, 20)]
    np.testing.assert_allclose(found, [5, 5, 0, 10])
    np.testing.assert_allclose(row["peak_um"], 0.3 + amplitudes, rtol=1e-3)
    np.testing.assert_allclose(row["rms_um"], amplitudes / np.sqrt(2), rtol=1e-3)
    np.testing.assert_allclose(row["kernel_delay_ms"], 1e3 * delay, atol=0.02)
    np.testing.assert_allclose(row["kernel_misfit"], misfit, rtol=1e-6)
    # The squared pressure has a line at 2 f, a quarter of that at f.
    np.testing.assert_allclose(row["kernel_shape_misfit"], np.sqrt(1 / 17), rtol=2e-3)
    assert (row["f_AM_hz"], row["sensation_line"], row["peak_memory_gib"]) == (f, "f_AM", 3)
    known = input_columns(DesignPoint(varied={}, text="", scene=scene))
    # Of an incompressible half-space it is 0.955 times the speed of shear waves.
    assert known["rayleigh_speed_m_per_s"] == pytest.approx(0.955 * 5, rel=2e-3)
    assert (known["probe_x_mm"], known["probe_y_mm"]) == ([0, 5, 10], [0, 0, 0])


def test_a_failing_combination_is_a_row_with_its_error(scene, capsys):
    rows = swept("body.size_x_mm=60,10", "tacton.size_mm=10,50,70", "body.thickness_mm=15,inf")
    failed = [row["error"] for row in rows if row["status"] == "failed"]
    assert (len(rows), len(failed)) == (12, 8)
    assert sum("60 mm" in error for error in failed) == 4  # the largest size of a path
    words = ["body.thickness_mm=inf", "tacton.size_mm=11", "--model", "fem", "--element-size", 15]
    assert swept(*words, out="another")[0]["status"] == "failed"
    # What is drawn of the table later leaves them out, too.
    capsys.readouterr()
    assert main(["sweep", "short-sweep", "--csv"]) == 1
    assert capsys.readouterr().out.startswith("8 parts of this result failed: run ")


def test_the_forearm_deflects_most_near_the_rayleigh_speed(tmp_path, monkeypatch):
    """Largest deflection on a circle of 100 mm around, in um/Pa, by Hankel transforms."""
    monkeypatch.chdir(tmp_path)
    peaks = {1: 0.362, 2: 0.402, 3: 0.409, 4: 0.366, 8: 0.194, 18: 0.120}
    speeds = ",".join(map(str, [*peaks, 2.5, 2.75]))
    rows = swept(f"tacton.speed_m_per_s={speeds}", scene=str(FOREARM))
    found = {row["tacton.speed_m_per_s"]: row["peak_um"][0] / 50 for row in rows}
    np.testing.assert_allclose([found[v] for v in peaks], list(peaks.values()), rtol=0.05)
    assert max(found, key=found.get) == pytest.approx(rows[0]["rayleigh_speed_m_per_s"], rel=0.15)


def test_bodies_are_prepared_once(scene, monkeypatch):
    prepared, inner = [], reductions.reduce_scene
    counting = lambda scene, how: prepared.append((scene, how.h)) or inner(scene, how)  # noqa: E731
    monkeypatch.setattr(reductions, "reduce_scene", counting)
    reductions.prepare_body.cache_clear()
    rows = swept("tacton.speed_m_per_s=2:8:3", "body.thickness_mm=12,13", *ON_SMALL)
    assert {row["status"] for row in rows} == {"done"}
    assert len(prepared) == len({*prepared}) == 4  # two meshes each
    assert all(row["dofs"] > 500 and row["energy_imbalance"] < 0.01 for row in rows)


def counted(monkeypatch, folder):
    monkeypatch.setenv("SKINWAVE_CACHE", str(folder))
    reductions.prepare_body.cache_clear()
    covering.cached_shared_body.cache_clear()
    made = []
    for module, name in ((fem.krylov, "factorise"), (fem.affine, "SumFactoriser")):
        inner = getattr(module, name)
        counting = lambda *a, inner=inner, **k: made.append(a) or inner(*a, **k)  # noqa: E731
        monkeypatch.setattr(module, name, counting)
    return made


def assert_lines_agree(rows, others, tolerance):
    for row, other in zip(rows, others, strict=True):
        lines = [name for name in row if name.endswith("_um") and row[name]]
        assert len(lines) > 3
        least = 0.01 * max(max(other[name]) for name in lines)
        for name in lines:
            np.testing.assert_allclose(row[name], other[name], tolerance, tolerance * least)


def together(rows):
    return {(row["status"], row["reduced_together"]) for row in rows}


def test_bodies_of_many_materials_are_reduced_together(scene, monkeypatch, tmp_path):
    made = counted(monkeypatch, tmp_path / "cold")
    rows = swept(MODULI, *ON_SMALL)
    assert 0 < len(made) < len(rows) == 8
    assert together(rows) == {("done", 8)}
    assert all(0 < row["reduction_error"] < row["expected_error"] for row in rows)
    made.clear()
    monkeypatch.setitem(covering.FEWEST, "material", 9)
    alone = swept(MODULI, *ON_SMALL, out="alone")
    assert len(made) == 16
    assert together(alone) == {("done", 1)}
    assert_lines_agree(rows, alone, 0.01)
    for row, other in zip(rows, alone, strict=True):
        assert row["expected_error"] == pytest.approx(other["expected_error"], rel=0.1)


@pytest.mark.parametrize(
    ("vary", "kept"),
    [(f"{SCALED}=0.8,1.3,2.0", slice(None)), ("body.thickness_mm=10,11,12", slice(2, None))],
)
def test_factors_and_thicknesses_share_a_reduction(scene, monkeypatch, vary, kept):
    with monkeypatch.context() as patch:
        for kind in covering.FEWEST:
            patch.setitem(covering.FEWEST, kind, 3)
        rows = swept(vary, *ON_SMALL)
    assert together(rows) == {("done", 3)}
    alone = swept(vary, *ON_SMALL, out="alone")
    assert together(alone) == {("done", 1)}
    assert_lines_agree(rows[kept], alone[kept], 0.01)


def families_of(body, *varied, design="factorial"):
    """How many bodies of a sweep share a model, each of which has its own materials."""
    table = to_table(Scene(pressure=MovingPressure(tacton=Tacton(am_frequency=140)), body=body))
    points = cases_of(table, table, combinations([parse(each) for each in varied], design))
    hardest = {without_tacton(point.scene): point for point in points}
    found = reductions.families(hardest, 0.05)
    for family, members in found:
        keys = free_keys(family.scene.body, {k: (a, b) for k, a, b in family.ranges})
        for scene, values in members.items():
            own = with_values(family.scene.body, keys, dict(values))
            assert own.solids == scene.body.solids
            assert own.depth == pytest.approx(scene.body.depth, rel=1e-9)
    assert not reductions.families(hardest, 0.05, workers=len(points))
    return sorted(len(members) for _, members in found)


def test_families_differ_only_in_free_keys_and_are_large():
    moduli = "body.material.shear_modulus_pa=20e3,22e3,24e3,26e3,28e3,30e3"
    small = Body(width=0.04, height=0.04, depth=0.01, sides="clamped")
    apart = "body.size_x_mm=40,40,40,40,40,40,50,50,50,50,50,50"
    factors = f"{SCALED}=1,1,1,1,1,1,2,2,2,2,2,2"
    twice = f"{moduli},{moduli.partition('=')[2]}"
    assert families_of(small, apart, factors, twice, design="zip") == [6]
    assert families_of(small, f"{SCALED}=0.7:1.6:6", f"{LOSSES}=0.5:2.1:7") == [42]
    others = ("body.material.poisson=0.45,0.49", "body.size_x_mm=40,45", "tacton.size_mm=8,9")
    assert families_of(small, MODULI, *others) == 4 * [8]
    for body in (BODIES["palm"], BODIES["skin-slab"]):
        assert families_of(body, MODULI, "body.thickness_mm=15,16") == [8, 8]
    layered = replace(BODIES["palm"], layers=(Layer(thickness=5e-3, material="fat"),))
    assert families_of(layered, MODULI, "body.thickness_mm=15,16,17") == [8, 8, 8]
    assert families_of(BODIES["skin-slab"], "body.thickness_mm=14:18:15") == [15]


def test_bodies_are_reduced_alone_if_a_family_fails(scene, monkeypatch):
    monkeypatch.setitem(covering.FEWEST, "material", 2)
    moduli = "body.material.shear_modulus_pa=20e3,30e3"

    def refusing(*given, **options):
        raise ValueError("the tolerance is out of reach")

    with monkeypatch.context() as patch:
        patch.setattr(covering.parametric, "prepare", refusing)
        assert together(swept(moduli, *ON_SMALL)) == {("done", 1)}
    inner = reductions.mesh_of_family
    coarse = lambda options, family: inner(SolveOptions(h=8e-3, tolerance=0.1), family)  # noqa: E731
    monkeypatch.setattr(reductions, "mesh_of_family", coarse)
    within = ["--model", "fem", "--tolerance", 0.1, "--workers", 1]
    rows = swept(moduli, *SMALL, "body.thickness_mm=8", *within, out="finer")
    assert together(rows) == {("done", 1)}
    assert all(row["h_mm"] < 8 and 0 < row["expected_error"] < 0.1 for row in rows)
