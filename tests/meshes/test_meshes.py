"""Structured bodies: volume, conformity, symmetry, grading; and meshes that are refused."""

import numpy as np
import pytest

import fem
import meshes
from meshes import TetMesh


def test_a_sheet_is_exact_and_conforming():
    mesh = meshes.sheet(0.1, 0.08, 0.001, 0.005)
    assert meshes.corner_volumes(mesh.points, mesh.tets).sum() == pytest.approx(8e-6, rel=1e-12)
    outside = meshes.boundary_facets(mesh.tets)
    named = sum(len(mesh.facets[name]) for name in ("top", "bottom", "sides"))
    assert len(outside) == named == 2 * (2 * 20 * 16) + 2 * (2 * 20 + 2 * 16)
    assert mesh.facets["clamped"] is not None
    np.testing.assert_array_equal(mesh.facets["clamped"], mesh.facets["sides"])


def test_facets_face_outwards():
    mesh = meshes.block((0.02, 0.03, 0.01), 0.005)
    for name, normal in {"top": (0, 0, 1), "left": (-1, 0, 0), "back": (0, 1, 0)}.items():
        a, b, c = (mesh.points[mesh.facets[name][:, i]] for i in range(3))
        cross = np.cross(b - a, c - a)
        cross /= np.linalg.norm(cross, axis=1)[:, None]
        np.testing.assert_allclose(cross, [normal] * len(cross), atol=1e-12)


def test_a_centred_mesh_is_its_own_mirror_image():
    mesh = meshes.block((0.02, 0.02, 0.01), 0.005)
    for axis in (0, 1):
        mirrored = mesh.points * np.where(np.arange(3) == axis, -1, 1)
        _, twin = np.nonzero((np.abs(mirrored[:, None] - mesh.points) < 1e-12).all(axis=2))
        there = {tuple(sorted(tet)) for tet in mesh.tets[:, :4]}
        assert {tuple(sorted(tet)) for tet in twin[mesh.tets[:, :4]]} == there


def test_grading_is_fine_inside_and_ends_on_the_side():
    grading = meshes.Grading(radius=0.02, growth=1.3, coarsest=0.01)
    axis = meshes.graded_axis(0.05, 0.0025, grading)
    cells = np.diff(axis)
    assert axis[-1] == pytest.approx(0.05)
    np.testing.assert_allclose(cells[:8], 0.0025)
    assert (cells[1:] / cells[:-1] <= 1.3 * 1.3).all()
    assert cells.max() < 0.0125


def test_inverted_tetrahedra_are_reordered():
    mesh = meshes.block((0.02, 0.02, 0.01), 0.01)
    swapped = mesh.tets[:, [0, 1, 3, 2, 4, 8, 7, 6, 5, 9]]
    again = TetMesh(points=mesh.points, tets=swapped)
    np.testing.assert_array_equal(again.tets, mesh.tets)


@pytest.mark.parametrize("kind", ["sheet", "block"])
def test_a_quarter_moves_like_the_whole_under_a_symmetric_load(kind):
    if kind == "sheet":
        mesh, ends = meshes.sheet(0.1, 0.08, 1e-3, 0.01), {"sides": "xyz"}
    else:
        mesh, ends = meshes.block((0.06, 0.06, 0.01), 0.005), {"bottom": "xyz"}
    quarter = meshes.half(meshes.half(mesh, "x"), "y")
    assert len(quarter.tets) == len(mesh.tets) // 4
    answers = []
    sliding = {"mirror_x": "x", "mirror_y": "y"}
    for part, fixed in ((mesh, ends), (quarter, ends | sliding)):
        ops = fem.assemble(part, fem.PRESETS["palm"], fixed=fixed)
        points = fem.facet_points(part)
        spot = np.exp(-(points[:, :2] ** 2).sum(axis=1) / 2 / 4.35e-3**2)
        u = fem.static(ops, fem.load_operator(part) @ spot)
        answers.append(fem.probe_operator(part, [[0, 0], [0.01, 0], [0.013, 0.017]]) @ u)
    np.testing.assert_allclose(answers[1], answers[0], rtol=1e-6)
