"""Plans with goal-oriented meshes: true errors, estimates, and what they save."""

from dataclasses import replace

import numpy as np
import pytest

from meshes import cache
from simple_model import MovingPressure, Tacton, Trajectory
from simple_model.rhythm import Rhythm
from skinwave.bodies import BODIES, Body
from skinwave.bodies.parts import Placement
from skinwave.bodies.supports import Sides
from skinwave.comparison import compare
from skinwave.models.prepared import answer, prepare
from skinwave.planning.goal_lines import widest_on_path
from skinwave.planning.goal_oriented import goal_refined, has_goal_oriented
from skinwave.planning.plan import plan
from skinwave.planning.refinement import refined
from skinwave.scene import Layer, Scene
from skinwave.simulation import compute, follow, required_plan

CIRCLE = Tacton(
    am_frequency=140, duration=0.1, trajectory=Trajectory(shape="circle", size=0.014, speed=9)
)
LAYERED = Body(
    width=0.046, height=0.046, depth=0.012, sides="clamped", material="muscle",
    layers=(Layer(thickness=1.3e-3, material="dermis"), Layer(thickness=4e-3, material="fat")),
)  # fmt: skip
PALM = replace(BODIES["palm"], width=0.055, height=0.055, depth=0.0145)
ON_X = ((0.0, 0.0), (0.007, 0.0), (0.014, 0.0))


def scene_of(body, probes=ON_X, tacton=CIRCLE):
    return Scene(pressure=MovingPressure(tacton=tacton), body=body, probes=probes)


def size_row(found):
    (row,) = (row for row in found.rows if row.what == "element size")
    return row


@pytest.mark.parametrize(("body", "tolerance", "fine"), [(LAYERED, 0.05, 2e-3), (PALM, 0.04, 5e-3)])
def test_a_planned_mesh_is_accurate_and_smaller_than_a_uniform_one(body, tolerance, fine):
    scene = scene_of(body)
    found = plan(scene, tolerance)
    reference = answer(prepare(body, scene.probe_points, h=fine), scene)
    true = compare(reference, answer(found.prepared, scene)).relative_l2.max()
    assert true < tolerance
    assert found.error < tolerance
    assert true < found.error < 3 * true
    uniform = refined(scene, body, tolerance).prepared.effort
    assert found.prepared.effort.dofs < 0.75 * uniform.dofs


def test_error_of_a_planned_mesh_is_that_from_the_analytic_solution(monkeypatch):
    """Of a slab whose sides absorb, whose absorbing layer keeps its own lines."""
    monkeypatch.setattr("skinwave.planning.goal_oriented.SMALL", 0)
    scene = scene_of(Body(width=0.06, height=0.06), ((0.0, 0.0), (0.005, 0.0)),
                     Tacton(am_frequency=140, duration=0.05))  # fmt: skip
    found = plan(scene, 0.05, model="fem")
    assert found.symmetry == "xy"
    exact = compute(scene, "flat-body")
    true = compare(exact, answer(found.prepared, scene)).relative_l2.max()
    assert true < 0.05
    assert 1 / 1.5 < found.error / true < 3
    assert "goal-oriented" in size_row(found).reason


def test_lines_follow_layers_symmetry_and_the_focal_spot():
    scene = scene_of(LAYERED)
    found = goal_refined(scene, LAYERED, 0.2).goal
    x, y, z = found.follows
    np.testing.assert_array_equal(y, -y[::-1])  # which all probes lie on the middle of
    assert y[len(y) // 2] == 0
    assert (x[0], x[-1], z[0], z[-1]) == (-0.023, 0.023, -0.012, 0)
    assert widest_on_path(scene, LAYERED, found.follows) == found.widest < 2 * 4.4e-3
    mesh_depths = prepare_depths(LAYERED, found.follows)
    for plane in (-1.3e-3, -5.3e-3):
        assert np.abs(mesh_depths - plane).min() < 1e-12


def prepare_depths(body, lines):
    mesh = body.of_kind.grid.discretise(body, lines).mesh
    return np.unique(mesh.points[:, 2])


def test_a_plan_says_in_words_what_its_mesh_is():
    found = plan(scene_of(LAYERED), 0.2)
    row = size_row(found)
    assert " mm along x, y and z, " in row.value
    assert f"{found.prepared.effort.dofs:,} dofs" in row.value
    assert "goal-oriented" in row.reason
    assert f"an error of {100 * found.error:.2g} % is left" in row.reason
    assert 2e-3 < found.h < 8e-3  # of equal elements that are as accurate
    assert found.warnings == ()
    assert found.prepared.effort.h == 0  # there is no one size


def test_a_plan_that_falls_short_says_so(monkeypatch):
    monkeypatch.setattr("skinwave.planning.goal_oriented.MESHES", 1)
    monkeypatch.setattr("skinwave.planning.goal_oriented.LEAST_ALIKE", 0.5)
    found = plan(scene_of(LAYERED), 0.01)
    (said,) = found.warnings
    assert said.startswith("the goal-oriented mesh of ")
    assert "more than the tolerance of 1 %; an element size of about" in said


@pytest.mark.parametrize("arguments", [{"h": 6e-3}, {"h": None}])
def test_what_asks_for_one_size_has_one(arguments):
    found = plan(scene_of(LAYERED), 0.5, model="fem-harmonic", **arguments)
    assert "goal-oriented" not in size_row(found).reason


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (LAYERED, True),
        (PALM, True),
        (replace(PALM, layers=LAYERED.layers[:1]), False),  # of which elements may be a coat
        (Body(kind="sheet", material="paper", base="free", sides="clamped", depth=1e-4), False),
    ],
)
def test_bodies_with_grid_lines_have_goal_oriented_meshes(body, expected):
    assert has_goal_oriented(scene_of(body), body) == expected
    rhythm = replace(CIRCLE, rhythm=Rhythm(pulses=((0.02, 0.03),)))
    assert not has_goal_oriented(scene_of(body, tacton=rhythm), body)


@pytest.mark.parametrize(
    "body",
    [
        replace(PALM, placement=Placement(tilt_x=0.2, offset=(4e-3, 0.0))),
        replace(LAYERED, layers=(), sides=Sides(left="clamped", right="free", front="absorbing",
                                                back="clamped")),
    ],
)  # fmt: skip
def test_bodies_that_are_no_mirror_image_are_planned(monkeypatch, body):
    monkeypatch.setattr("skinwave.planning.goal_oriented.SMALL", 0)
    found = plan(scene_of(body), 0.3)
    assert found.error < 0.3
    assert "goal-oriented" in size_row(found).reason


@pytest.mark.parametrize(("tolerance", "expected"), [(0.2, False), (0.03, True)])
def test_a_small_uniform_mesh_is_taken_where_it_is_accurate_enough(tolerance, expected):
    body = replace(LAYERED, layers=())
    row = size_row(plan(scene_of(body, ((0.0, 0.0),)), tolerance))
    assert ("goal-oriented" in row.reason) == expected
    assert ("refined until less than 20 % is left" in row.reason) != expected


def test_a_load_of_nothing_has_a_uniform_mesh():
    scene = scene_of(LAYERED)
    still = replace(scene, pressure=replace(scene.pressure, peak_pressure=0.0))
    assert goal_refined(still, LAYERED, 0.2).goal is None


def test_a_plan_is_the_same_again_with_and_without_a_cache(monkeypatch, tmp_path):
    scene, found = scene_of(PALM, ((0.0, 0.0),)), []
    for folder in ("one", "one", ""):
        monkeypatch.setenv("SKINWAVE_CACHE", str(tmp_path / folder) if folder else "")
        required = required_plan(scene, tolerance=0.2)
        found.append(follow(scene, required, 0.2))
    for other in found[1:]:
        assert cache.digest(other.values) == cache.digest(found[0].values)
        assert other.effort.mesh == found[0].effort.mesh
        assert other.expected_error == found[0].expected_error
