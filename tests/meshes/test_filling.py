"""Filling of surfaces by the mesher: sizes, regions, and a mesher that is not trusted."""

import json

import meshio
import numpy as np
import pytest
from test_surfaces import BONE, OUTER, SPHERE, cube

import fem
import meshes
from meshes import MeshError, Surface, TetMesh
from meshes.surface.triangulation import volume
from meshes.tetmesh import interface_facets
from meshes.volume import tetrahedralise as tetra
from skinwave.bodies import Body
from skinwave.bodies.build import build
from skinwave.commands.cli import main


def test_a_cube_is_filled_once_per_machine(tmp_path, monkeypatch):
    monkeypatch.setenv("SKINWAVE_CACHE", str(tmp_path / "cache"))
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    mesh = meshes.tetrahedralise(cube(at=(0, 0, 1.0)), 4e-3)
    assert meshes.dihedral_angles(mesh).min() > 10
    assert meshes.corner_volumes(mesh.points, mesh.tets).sum() == pytest.approx(8e-6, rel=5e-3)
    assert 0.7 < np.median(meshes.edge_lengths(mesh)) / 4e-3 < 1.15
    monkeypatch.setattr(tetra, "_run", None)
    again = meshes.tetrahedralise(cube(at=(0, 0, 1.0)), 4e-3)
    np.testing.assert_array_equal(again.points, mesh.points)
    np.testing.assert_array_equal(again.tets, mesh.tets)
    with pytest.raises(TypeError):
        meshes.tetrahedralise(cube(), 4.1e-3)
    assert not list((tmp_path / "here").iterdir())


def inputs(surface, **changed):
    grid = tetra._size_grid(surface, 4e-3, None)
    plain = {
        "points": surface.points, "triangles": surface.triangles,
        "h": np.array(4e-3), "epsilon": np.array(1e-3),
    }  # fmt: skip
    return plain | grid | changed


def test_a_crash_of_the_mesher_is_an_error(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    points = np.array(SPHERE.points)
    points[7, 1] = np.inf
    with pytest.raises(MeshError, match="the mesher failed"):
        tetra._run(inputs(SPHERE, points=points), 600.0)
    assert not list(tmp_path.iterdir())


def test_the_mesher_is_stopped_after_its_timeout(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plain = inputs(SPHERE)
    infinite = {"h": np.array(1e-4), "grid_sizes": np.full_like(plain["grid_sizes"], 1e-4)}
    with pytest.raises(MeshError, match="stopped after 3 s"):
        tetra._run(plain | infinite, 3.0)
    assert not list(tmp_path.iterdir())


def test_results_of_the_mesher_are_checked():
    def accepted(mesh, surface):
        return tetra._checked_result(surface, 1e-6, mesh.points, mesh.tets)

    box, whole = meshes.block((0.02, 0.02, 0.02), 5e-3, order=1), cube()
    accepted(box, whole)
    none = np.zeros((0, 4), int)
    with pytest.raises(MeshError, match="returned no tetrahedra"):
        tetra._checked_result(whole, 1e-6, box.points, none)
    with pytest.raises(MeshError, match="12.50 %"):
        accepted(box, cube(0.04))
    flat = TetMesh(points=box.points * [1, 1, 0.01], tets=box.tets)
    thin = Surface(points=whole.points * [1, 1, 0.01], triangles=whole.triangles)
    with pytest.raises(MeshError, match="dihedral angles"):
        accepted(flat, thin)
    x = np.abs(box.points[box.tets].mean(axis=1)[:, 0])
    with pytest.raises(MeshError, match="2 pieces"):
        accepted(TetMesh(points=box.points, tets=box.tets[x > 0.005]), whole)


def test_a_missing_mesher_is_an_error(monkeypatch):
    monkeypatch.setattr(tetra, "find_spec", lambda name: None)
    with pytest.raises(MeshError, match="pytetwild"):
        tetra._run(inputs(SPHERE), 10.0)


def test_elements_follow_the_target_sizes():
    slab = Surface(points=cube().points * [3, 3, 0.5], triangles=cube().triangles)
    slab = Surface(points=slab.points - [0, 0, 0.005], triangles=slab.triangles)
    sizing = meshes.graded_sizing(2e-3, meshes.Grading(radius=0.01, growth=1.3, coarsest=6e-3))
    mesh = meshes.tetrahedralise(slab, 2e-3, sizing=sizing)
    asked = sizing(mesh.points[mesh.tets].mean(axis=1))
    ratio = meshes.edge_lengths(mesh).mean(axis=1) / asked
    assert (np.abs(ratio - 1) < 0.15).mean() > 0.6
    for low, high in ((2e-3, 2.5e-3), (2.5e-3, 4e-3), (4e-3, 6e-3)):
        band = (asked >= low) & (asked < high)
        assert np.median(ratio[band]) == pytest.approx(1, abs=0.2)
    assert meshes.dihedral_angles(mesh).min() > 10


def test_the_mesher_follows_a_surface_inside_another():
    mesh = meshes.tetrahedralise(OUTER, 6e-3, inner={"bone": BONE})
    assert mesh.region_names == {0: "tissue", 1: "bone"}
    volumes = meshes.corner_volumes(mesh.points, mesh.tets)
    assert volumes[mesh.region == 1].sum() == pytest.approx(volume(BONE), rel=0.02)
    assert volumes.sum() == pytest.approx(volume(OUTER), rel=0.02)
    middle, half = BONE.points.mean(axis=0), np.ptp(BONE.points, axis=0) / 2
    outside = (np.abs(mesh.points - middle) - half).max(axis=1)[mesh.tets]  # metre beyond a side
    envelope = 1e-4
    assert outside[mesh.region == 1].max() < envelope
    assert outside[mesh.region == 0].min() > -envelope


def save(path, surface):
    meshio.write(path, meshio.Mesh(1e3 * surface.points, [("triangle", surface.triangles)]))


@pytest.mark.usefixtures("read_here")
def test_a_bone_inside_a_body_is_a_region_of_scenes(tmp_path, monkeypatch, capsys):
    grid = meshes.block((0.020, 0.016, 0.012), 1e-3, order=1)
    monkeypatch.setattr(tetra, "_run", lambda inputs, timeout: (grid.points, grid.tets))
    monkeypatch.setenv("SKINWAVE_CACHE", "")
    save(tmp_path / "hand.stl", OUTER)
    save(tmp_path / "bone.stl", BONE)
    hand, bone, out = (str(tmp_path / name) for name in ("hand.stl", "bone.stl", "out.vtu"))
    command = ["mesh", hand, "--inner", bone, "--unit", "mm", "--element-size", "6", "-o", out]
    assert main([*command, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert set(summary["regions"]) == {"tissue", "bone"}
    mesh = meshes.read(out)
    assert mesh.region_names == {0: "tissue", 1: "bone"}
    volumes = meshes.corner_volumes(mesh.points, mesh.tets)
    assert volumes[mesh.region == 1].sum() == pytest.approx(volume(BONE), rel=1e-6)
    assert volumes.sum() == pytest.approx(volume(OUTER), rel=1e-6)
    between = mesh.points[np.unique(interface_facets(mesh))] - BONE.points.mean(axis=0)
    half = np.ptp(BONE.points, axis=0) / 2
    assert np.abs(np.abs(between) / half - 1).min(axis=1).max() < 1e-3
    made = build(Body(kind="mesh", file=out, regions=(("bone", "bone"),)), 6e-3)
    stiff = [made.material[r] is fem.PRESETS["bone"] for r in made.mesh.region.tolist()]
    assert stiff == (mesh.region == 1).tolist()
    assert main([*command, "--inner", bone, "--overwrite"]) == 2
    assert main(["mesh", out, "--inner", bone, "-o", str(tmp_path / "b.vtu")]) == 2
