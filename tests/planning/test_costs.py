"""Predicted costs: counted work, and the change that shortens a long response."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
from corpus import GOOD

from simple_model import Effort
from skinwave import loads, plan
from skinwave.bodies.build import build
from skinwave.models import BUILT_IN, named
from skinwave.models.costs import lines_below
from skinwave.models.options import SolveOptions, sample_times
from skinwave.models.stretching import meshed_sheet, sheet_dofs
from skinwave.planning.rows import cost_row
from skinwave.planning.simulate import compute
from skinwave.scene.scene import BODIES, Body

SKIN = loads(GOOD)
SHEET = replace(
    SKIN, body=replace(BODIES["paper-sheet"], width=0.04, height=0.04, air=False),
    probes=((0.0, 0.0), (0.005, 0.0)),
)  # fmt: skip
ON_SHEETS = [name for name in BUILT_IN if "plate" in name or "nonlinear" in name]
REDUCED = Effort(dofs=5000, reduced_dofs=60, seconds={"factorise and reduce": 1.0})


def lasting(scene, duration, probes=2):
    tacton = replace(scene.tacton, duration=duration)
    places = tuple((x, 0.0) for x in np.linspace(0, 0.005, probes).tolist())
    return replace(scene, pressure=replace(scene.pressure, tacton=tacton), probes=places)


@pytest.mark.parametrize("model", BUILT_IN)
def test_every_model_predicts_more_for_more_work(model):
    scene = SHEET if model in ON_SHEETS else SKIN
    short, long = (
        named(model).cost(each, SolveOptions(), REDUCED)
        for each in (lasting(scene, 0.1), lasting(scene, 2.0, 40))
    )
    assert 0 < short.seconds < long.seconds
    assert 1e8 < short.memory <= long.memory


@pytest.mark.parametrize(("model", "scene"), [("plate-modes", SHEET), ("flat-body-harmonic", SKIN)])
def test_the_counted_lines_are_those_that_are_solved(model, scene):
    assert lines_below(scene, sample_times(scene)) == compute(scene, model).effort.steps


@pytest.mark.parametrize("h", [4e-3, 2e-3])
def test_the_counted_degrees_of_freedom_of_a_sheet_are_those_of_its_mesh(h):
    made = meshed_sheet(SHEET.body, h)
    assert sheet_dofs(SHEET.body, h) == pytest.approx(int((~made.constraints).sum()), rel=0.2)


def test_a_long_response_names_what_shortens_it():
    costs = [
        named("flat-body").cost(each, SolveOptions(), Effort())
        for each in (lasting(SKIN, 5.0, 1000), lasting(SKIN, 5.0, 1000 // 20))
    ]
    assert costs[0].seconds > costs[0].long > costs[1].seconds
    rows = [cost_row(cost, None) for cost in costs]
    assert ["to shorten it, use fewer probes" in row.reason for row in rows] == [True, False]


def test_ten_times_as_many_steps_cost_ten_times_as_much():
    some, many = (
        plan(SKIN, SolveOptions(model="fem-transient", h=3e-3, dt=dt)) for dt in (1e-5, 1e-6)
    )
    assert many.seconds == pytest.approx(10 * some.seconds, rel=0.1)
    assert "--model fem" in next(row.reason for row in many.rows if row.what == "cost")


def test_the_cost_of_a_mesh_from_a_file_is_that_of_its_own_reduction(tmp_path, monkeypatch):
    monkeypatch.setenv("SKINWAVE_CACHE", str(tmp_path / "cache"))
    mesh = build(SKIN.body, 3e-3).mesh
    meshio.write(tmp_path / "body.vtu", meshio.Mesh(mesh.points, [("tetra10", mesh.tets)]))
    scene = replace(SKIN, body=Body(kind="mesh", file=str(tmp_path / "body.vtu")))
    first, again = (plan(scene, SolveOptions(h=6e-3)) for _ in range(2))
    cached = ["read from the cache" in " ".join(row.reason for row in each.rows)
              for each in (first, again)]  # fmt: skip
    assert cached == [False, True]
    assert first.seconds > again.seconds
