"""Size fields that spread an error evenly, and plans of bodies from files that follow them."""

from dataclasses import replace
from functools import lru_cache

import meshio
import numpy as np
import pytest

from meshes import MeshError, boundary_facets, cache, corner_volumes, extrude
from meshes.files import surface_files
from meshes.surface.repair import repaired
from meshes.volume.size_field import (
    REGULAR,
    ErrorDensity,
    SizeField,
    equidistributed_sizes,
    error_density,
    size_field,
)
from simple_model import MovingPressure, Tacton, Trajectory
from skinwave.bodies import Body
from skinwave.comparison import compare
from skinwave.models.prepared import answer, prepare
from skinwave.planning.goal_oriented import goal_refined, has_goal_oriented
from skinwave.planning.plan import plan
from skinwave.scene import Layer, Scene


def cube(n):
    line = np.linspace(0.0, 1.0, n + 1)
    return extrude(line, line, line, order=1)


def known(rate, order=3.0, n=10):
    """Density exp(-rate x) at the nodes of a unit cube."""
    mesh = cube(n)
    return ErrorDensity(
        points=mesh.points, density=np.exp(-rate * mesh.points[:, 0]), corners=mesh.tets,
        volumes=corner_volumes(mesh.points, mesh.tets), order=order,
    )  # fmt: skip


@pytest.mark.parametrize("order", [2.0, 3.0])
def test_sizes_leave_an_error_with_the_fewest_elements_that_can(order):
    density, rate = known(6.0, order), 6.0
    sizes = equidistributed_sizes(density, 1e-4, slope=10.0)
    assert density.error(sizes) == pytest.approx(1e-4, rel=1e-3)
    wanted = density.density ** (-1 / (order + 3))
    np.testing.assert_allclose(sizes / wanted, (sizes / wanted)[0], rtol=1e-9)
    # Hoelder: N E^(3/r) >= 6 sqrt(2) (int C^(3 / (r + 3)) dV)^(1 + 3/r), here in closed form.
    s = 3 * rate / (order + 3)
    least = REGULAR * ((1 - np.exp(-s)) / s) ** (1 + 3 / order) / 1e-4 ** (3 / order)
    assert density.elements(sizes) == pytest.approx(least, rel=0.04)
    even = np.full(len(sizes), (1e-4 / density.error(np.ones(len(sizes)))) ** (1 / order))
    assert density.elements(sizes) < 0.8 * density.elements(even)


def test_sizes_keep_to_limits_a_slope_and_a_number_of_elements():
    density = known(20.0)
    free = equidistributed_sizes(density, 1e-5, slope=10.0)
    limited = equidistributed_sizes(density, 1e-5, slope=10.0, coarsest=0.3)
    assert free.max() > 0.4
    assert limited.max() == 0.3
    assert density.error(limited) == pytest.approx(1e-5, rel=0.01)
    gentle = equidistributed_sizes(density, 1e-5, slope=0.1)
    assert np.ptp(gentle) <= 0.1 * (1 + 1e-9)
    few = equidistributed_sizes(density, 1e-9, slope=10.0, most=5000)
    assert density.elements(few) == pytest.approx(5000, rel=0.01)


def test_an_error_density_is_that_of_the_elements_whatever_their_sizes():
    line = np.linspace(0.0, 1.0, 13) ** 1.5
    mesh = extrude(line, line, line, order=1)
    volumes, x = corner_volumes(mesh.points, mesh.tets), mesh.points[mesh.tets].mean(axis=1)[:, 0]
    error = np.exp(-2 * x) * volumes * (REGULAR * volumes) ** (3 / 3)
    found = error_density(mesh, error)
    np.testing.assert_allclose(found.density, np.exp(-2 * found.points[:, 0]), rtol=0.25)


def test_a_size_field_is_linear_between_its_lines_and_grows_around_its_points():
    lines = tuple(np.sort(np.random.default_rng(0).uniform(-1, 1, n)) for n in (4, 5, 6))
    x, y, z = np.meshgrid(*lines, indexing="ij")
    field = SizeField(lines=lines, sizes=x - 2 * y + 3 * z)
    low, high = np.array([[line[0], line[-1]] for line in lines]).T
    points = np.random.default_rng(1).uniform(low, high, (50, 3))
    np.testing.assert_allclose(field(points), points @ [1, -2, 3])
    around = size_field(np.array([[0.0, 0, 0], [1, 1, 1]]), np.array([0.1, 0.5]), 0.2)
    assert around(np.zeros((1, 3)))[0] == pytest.approx(0.1, abs=0.2 / 48)
    assert around(np.array([[1.0, 1, 1]]))[0] == pytest.approx(0.1 + 0.2 * np.sqrt(3), rel=0.02)


CIRCLE = Tacton(
    am_frequency=140, duration=0.1, trajectory=Trajectory(shape="circle", size=0.014, speed=9)
)
HALF = np.array([19.0, 18.0, 8.0])  # mm


@pytest.fixture(scope="module")
def rounded(tmp_path_factory):
    """A rounded block in a file of its surface, in mm."""
    line = np.linspace(-1.0, 1.0, 7)
    made = extrude(line, line, line, order=1)
    surface, _ = repaired(made.points, boundary_facets(made.tets))
    points = HALF * surface.points / np.linalg.norm(surface.points, ord=4, axis=1)[:, None]
    file = tmp_path_factory.mktemp("rounded") / "rounded.stl"
    meshio.write(file, meshio.Mesh(points, [("triangle", surface.triangles)]))
    return Body(kind="mesh", file=str(file), unit="mm")


def scene_of(body):
    probes = ((0.0, 0.0), (0.007, 0.0))
    return Scene(pressure=MovingPressure(tacton=CIRCLE), body=body, probes=probes)


def test_a_plan_of_a_file_is_accurate_and_the_same_again(rounded, monkeypatch):
    monkeypatch.setattr("skinwave.planning.goal_oriented.EASY", 1.0)
    read_once = lru_cache(surface_files.read_surface)  # in a process of its own, a second each time
    monkeypatch.setattr(surface_files, "read_surface", read_once)
    scene = scene_of(rounded)
    found = plan(scene, 0.08)
    (row,) = (row for row in found.rows if row.what == "element size")
    assert row.reason.startswith("goal-oriented: ")
    assert f" mm, {found.prepared.effort.dofs:,} dofs" in row.value
    assert found.warnings == ()
    reference = answer(prepare(rounded, scene.probe_points, h=4.5e-3), scene)
    moved = answer(found.prepared, scene)
    true = compare(reference, moved).relative_l2.max()
    assert true < found.error < 0.08
    again = plan(scene, 0.08)
    assert again.error == found.error
    assert again.prepared.effort.mesh == found.prepared.effort.mesh
    assert cache.digest(answer(again.prepared, scene).values) == cache.digest(moved.values)


def test_surfaces_without_layers_have_goal_oriented_meshes(rounded):
    layered = replace(rounded, layers=(Layer(thickness=5e-3, material="dermis"),))
    volume = replace(rounded, file="block.vtu")
    for body, expected in ((rounded, True), (layered, False), (volume, False)):
        assert has_goal_oriented(scene_of(body), body) == expected


def test_easy_tolerances_keep_uniform_elements(rounded, monkeypatch):
    sizes = []

    def refined(scene, body, tolerance, progress, *, h=None, **others):
        sizes.append(h)
        raise MeshError

    monkeypatch.setattr("skinwave.planning.goal_oriented.refined", refined)
    with pytest.raises(MeshError):
        goal_refined(scene_of(rounded), rounded, 0.05)
    assert sizes == [pytest.approx(8e-3 / 1.3, rel=0.03)]
