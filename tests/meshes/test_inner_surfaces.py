"""Closed surfaces inside that of a body, such as those of bones, which become its regions."""

import json

import meshio
import numpy as np
import pytest

import fem
import meshes
from meshes import Surface
from meshes.surface.alignment import cut_to
from meshes.surface.repair import repaired
from meshes.surface.triangulation import volume
from meshes.surface.winding import check_inside, winding_number
from meshes.tetmesh import interface_facets
from skinwave.bodies import Body
from skinwave.bodies.build import build
from skinwave.commands.cli import main


def box(sides, at=(0.0, 0.0, 0.0), h=np.inf):
    """Triangles of a box in metre about a point of its top."""
    made = meshes.block(sides, min(h, *sides), order=1)
    surface, _ = repaired(made.points, meshes.boundary_facets(made.tets))
    return Surface(points=surface.points + at, triangles=surface.triangles)


OUTER = box((0.020, 0.016, 0.012))
BONE = box((0.008, 0.006, 0.005), (0.0, 0.0, -0.004))


def save(path, surface):
    meshio.write(path, meshio.Mesh(1e3 * surface.points, [("triangle", surface.triangles)]))


def test_a_winding_number_is_1_inside_and_0_outside():
    rng = np.random.default_rng(1)
    points = rng.uniform(-0.012, 0.012, (500, 3)) - [0, 0, 0.006]
    low, high = OUTER.points.min(axis=0), OUTER.points.max(axis=0)
    inside = ((points > low) & (points < high)).all(axis=1)
    np.testing.assert_allclose(winding_number(OUTER, points), inside, atol=1e-12)
    assert 50 < inside.sum() < 450


@pytest.mark.parametrize(
    ("inner", "message"),
    [
        ({"a": box((0.008,) * 3, (0.009, 0, -2e-3))}, "of the body and a cross at"),
        ({"a": box((0.008,) * 3, (0.05, 0, -2e-3))}, r"a is not inside the body: .*\(50, 0, -6\)"),
        ({"a": box((0.04, 0.04, 0.04), (0, 0, 0.01))}, "a is not inside the body"),
        ({"a": BONE, "b": box((0.009, 0.003, 0.003), (0, 0, -5e-3))}, "of a and b cross at"),
        (
            {"a": Surface(points=BONE.points, triangles=BONE.triangles[1:])},
            "a: the surface is open along 3",
        ),
    ],
)
def test_surfaces_that_are_not_inside_are_refused(inner, message):
    with pytest.raises(meshes.MeshError, match=message):
        check_inside(OUTER, inner)
    check_inside(OUTER, {"a": BONE, "marrow": box((2e-3,) * 3, (0, 0, -5e-3))})


def test_a_bone_is_cut_with_the_body_that_it_is_in():
    whole, cuts = cut_to(BONE, (-1, 1, -1, 1))
    assert whole is BONE
    assert not cuts
    part, cuts = cut_to(BONE, (-0.002, 1, -1, 1))
    assert cuts == 1
    assert volume(part) == pytest.approx(0.006 * 0.006 * 0.005, rel=1e-6)
    assert cut_to(BONE, (0.005, 1, -1, 1))[0] is None


def test_a_body_is_meshed_with_its_bone_as_a_region_that_scenes_read(tmp_path, capsys):
    save(tmp_path / "hand.stl", OUTER)
    save(tmp_path / "bone.stl", BONE)
    hand, bone, out = (str(tmp_path / name) for name in ("hand.stl", "bone.stl", "out.vtu"))
    command = ["mesh", hand, "--inner", bone, "--unit", "mm", "--h", "6", "-o", out]
    assert main([*command, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert set(summary["regions"]) == {"tissue", "bone"}
    mesh = meshes.read(out)
    assert mesh.region_names == {0: "tissue", 1: "bone"}
    volumes = meshes.corner_volumes(mesh.points, mesh.tets)
    assert volumes[mesh.region == 1].sum() == pytest.approx(volume(BONE), rel=0.02)
    assert volumes.sum() == pytest.approx(volume(OUTER), rel=0.02)
    between = mesh.points[np.unique(interface_facets(mesh))] - BONE.points.mean(axis=0)
    half = np.ptp(BONE.points, axis=0) / 2
    off = np.abs(np.abs(between) / half - 1).min(axis=1)
    assert off.max() * half.max() < 1e-4  # the envelope
    made = build(Body(kind="mesh", file=out, regions=(("bone", "bone"),)), 6e-3)
    stiff = [made.material[r] is fem.PRESETS["bone"] for r in made.mesh.region.tolist()]
    assert stiff == (mesh.region == 1).tolist()
    assert main([*command, "--inner", bone, "--overwrite"]) == 2
    assert "a second region 'bone'" in capsys.readouterr().err
    assert main(["mesh", out, "--inner", bone, "-o", str(tmp_path / "b.vtu")]) == 2
    assert "is a mesh already" in capsys.readouterr().err


def test_a_bone_that_ends_in_the_cut_of_a_body_is_meshed_up_to_it():
    bone = box((0.010, 0.006, 0.005), (0.005, 0.0, -0.004))  # up to the side at x = 10 mm
    mesh = meshes.tetrahedralise(OUTER, 6e-3, inner={"bone": bone})
    volumes = meshes.corner_volumes(mesh.points, mesh.tets)
    assert volumes[mesh.region == 1].sum() == pytest.approx(volume(bone), rel=0.02)
    inside = np.unique(mesh.tets[mesh.region == 1])
    assert mesh.points[inside, 0].max() == pytest.approx(0.010, abs=1e-4)
