"""Choosing a model and measuring what accuracy costs."""

import json
from itertools import pairwise

import numpy as np
import pytest

from skinwave import cache, loads, simulate
from skinwave.paper15 import scenes, tactons
from skinwave.plan import plan
from skinwave.simulation import answer, prepare
from skinwave.tradeoff import Candidate, sentences, study, write

SHORT = """
name = "short"
[tacton]
am_frequency_hz = 140
duration_s = 0.05
[body]
width_mm = 60
height_mm = 60
[probes]
points_mm = [[0, 0], [5, 0]]
"""


def test_the_plan_takes_exact_waves_where_there_are_any():
    assert plan(loads(SHORT)).model == "flat-body"
    assert plan(loads("[body]\nkind = 'none'")).model == "point-kernel"
    assert plan(loads("[body]\ndepth_mm = inf")).model == "flat-body"


@pytest.mark.parametrize(
    "text",
    ["[body]\nkind = 'sheet'", "[body]\nsides = 'free'", "[focus]\nprofile = 'array'\n[body]"],
)
def test_the_plan_takes_elements_where_sides_reflect_or_the_focus_has_lobes(text):
    loose, tight = plan(loads(text), 0.1), plan(loads(text), 0.01)
    assert loose.model == tight.model == "fem"
    assert loose.h is not None
    assert tight.h is not None
    assert tight.h < loose.h
    assert tight.seconds > loose.seconds
    assert tight.highest >= loose.highest


def test_a_sheets_plan_says_what_it_leaves_out():
    rows = {row.what: row for row in plan(loads("[body]\nkind = 'sheet'")).rows}
    assert "%" in rows["left out: air"].value
    assert "stiffens" in rows["left out: stretching"].reason


@pytest.mark.slow
def test_the_planned_sheet_is_within_the_tolerance():
    """Off resonance, against a mesh of twice the cells a side in each direction."""
    scene = scenes("am80", dict(tactons())["am80"])["paper-sheet"]
    found = simulate(scene, "auto", 0.05)
    finer = simulate(scene, "fem", h=0.1 / 76)
    misfit = np.linalg.norm(found.displacement - finer.displacement, axis=0)
    assert (misfit / np.linalg.norm(finer.displacement, axis=0)).max() < 0.05


def test_a_prepared_body_comes_from_the_cache_unchanged(tmp_path, monkeypatch):
    monkeypatch.setenv("SKINWAVE_CACHE", str(tmp_path))
    scene = loads(SHORT)
    phases = []
    arguments = (scene.body, scene.probe_points, lambda phase, _: phases.append(phase))
    first = answer(prepare(*arguments, h=0.008), scene)
    assert "reduce" in phases
    phases.clear()
    again = answer(prepare(*arguments, h=0.008), scene)
    assert phases == []
    np.testing.assert_array_equal(first.displacement, again.displacement)
    prepare(*arguments, h=0.005)
    assert "reduce" in phases  # another mesh is another entry


def test_a_spoilt_cache_entry_is_rebuilt(tmp_path, monkeypatch):
    monkeypatch.setenv("SKINWAVE_CACHE", str(tmp_path))
    scene = loads(SHORT)
    first = answer(prepare(scene.body, scene.probe_points, h=0.008), scene)
    (entry,) = tmp_path.glob("*.npz")
    for spoilt in (b"", b"not a zip", entry.read_bytes()[: entry.stat().st_size // 2]):
        entry.write_bytes(spoilt)
        again = answer(prepare(scene.body, scene.probe_points, h=0.008), scene)
        np.testing.assert_allclose(again.displacement, first.displacement, rtol=1e-9)


def test_no_cache_is_no_error(monkeypatch, tmp_path):
    for place in ("", str(tmp_path / "file" / "below")):
        monkeypatch.setenv("SKINWAVE_CACHE", place)
        (tmp_path / "file").write_text("")
        cache.store("name", {}, x=np.zeros(1))
        assert cache.load("name") is None


@pytest.mark.slow
def test_a_study_ranks_candidates_by_measured_cost_and_error(tmp_path):
    scene = loads(SHORT)
    chosen = [
        Candidate(model="point-kernel"),
        Candidate(model="fem", h=0.012),
        Candidate(model="fem", h=0.006),
        Candidate(model="fem-transient", h=0.012, dt=1e-3),
    ]
    phases = []
    found = study(scene, lambda phase, fraction: phases.append(phase), chosen)
    error = {m.candidate.name: m.error for m in found.measured}
    assert error["fem, h = 6.00 mm"] < error["fem, h = 12.00 mm"] < error["point-kernel"]
    assert error["fem-transient, h = 12.00 mm, dt = 1 ms"] > error["fem, h = 12.00 mm"]
    front = found.front()
    assert all(a.error > b.error and a.cold <= b.cold for a, b in pairwise(front))
    assert found.cheapest(1e-12) is None
    assert len(phases) == len(chosen) + 2
    write(tmp_path, scene, found)
    assert len(json.loads((tmp_path / "tradeoff.json").read_text())["measured"]) == 4
    page = (tmp_path / "index.html").read_text()
    assert all(sentence.split(":")[0] in page for sentence in sentences(found))


def test_a_scene_without_a_body_has_nothing_to_trade():
    with pytest.raises(ValueError, match="give it a sheet or a slab"):
        study(loads("[body]\nkind = 'none'"), lambda phase, fraction: None)
