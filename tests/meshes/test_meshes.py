"""Structured bodies and palms: volume, conformity, symmetry, grading, curved elements."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.integrate import quad

import fem
import meshes
from meshes import MeshError, Palm, TetMesh, corner_volumes, mapped_palm
from meshes.shapes import palm as shape
from meshes.volume.mapped_palm import kuhn_tets
from skinwave.bodies import palm as body_palm
from skinwave.bodies.body import Body
from skinwave.scene.scene import BODIES, Relief

FLAT = Palm(
    cup_depth=0, thenar_height=0, hypothenar_height=0, pad_height=0, thickness=0.015,
    edge_radius=0.007,
)  # fmt: skip


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
        u = fem.static(ops, fem.pressure_operator(part) @ spot)
        answers.append(fem.probe_operator(part, [[0, 0], [0.01, 0], [0.013, 0.017]]) @ u)
    np.testing.assert_allclose(answers[1], answers[0], rtol=1e-6)


def test_the_gradient_is_the_slope_of_the_level_set():
    low, high, value = (-0.05, -0.055, -0.03), (0.05, 0.055, 0.01), partial(shape.level_set, Palm())
    points = np.random.default_rng(1).uniform(low, high, (5000, 3))
    slopes = [(value(points + s) - value(points - s)) / 2e-7 for s in 1e-7 * np.eye(3)]
    found = shape.gradient(Palm(), points)
    np.testing.assert_allclose(found, np.transpose(slopes), atol=1e-6, rtol=0)


def test_without_relief_the_top_is_a_plane():
    x, y = np.meshgrid(np.linspace(-0.025, 0.025, 11), np.linspace(-0.03, 0.03, 11))
    top = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    np.testing.assert_allclose(shape.level_set(FLAT, top), 0, atol=1e-16)
    np.testing.assert_allclose(shape.gradient(FLAT, top), [[0, 0, 1]] * x.size, atol=1e-15)
    low = replace(FLAT, cup_depth=1e-9, thenar_height=1e-9, hypothenar_height=1e-9, pad_height=1e-9)
    assert np.abs(shape.level_set(low, top)).max() < 4e-9


def test_invalid_palms_are_refused():
    for fields, said in [
        ({"thickness": 0.0}, "thickness = 0 mm"),
        ({"length": float("nan")}, "length = nan"),
        ({"breadth": 85.0}, "below 1 m"),
        ({"cup_depth": -0.001}, "0 or above"),
        ({"thenar_height": 0.05}, "thenar_height = 50 mm"),
        ({"edge_radius": 0.02}, "half the thickness, 11 mm"),
        ({"corner_radius": 0.05}, "half the shorter side, 42.5 mm"),
    ]:
        with pytest.raises(MeshError, match=said):
            Palm(**fields)


def test_no_tetrahedron_of_a_grid_has_two_facets_on_its_boundary():
    cells = (2, 4, 3)
    tets = kuhn_tets(cells)
    lines = [np.linspace(0, n, n + 1) for n in cells]
    points = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(meshes.corner_volumes(points, tets), 1 / 6)
    beyond = meshes.tetmesh.neighbours(tets)
    assert (beyond < 0).sum(axis=1).max() == 1
    assert (beyond < 0).sum() == 2 * 2 * (2 * 4 + 4 * 3 + 2 * 3)  # or it would not conform
    with pytest.raises(MeshError, match="larger elements"):
        kuhn_tets((200, 200, 200))


def test_volume_and_area_converge_to_those_of_the_geometry():
    exact = np.array(rounded_slab(FLAT))
    found = [measures(meshes.mapped_palm(FLAT, *grid(FLAT, cell))) for cell in (5e-3, 2.5e-3)]
    errors = np.abs(np.array(found) / exact - 1)
    assert errors[0].max() < 5e-4
    assert errors[1].max() < 5e-5
    assert 3.5 < np.log2(errors[0] / errors[1])[1] < 4.5  # of curved facets


def test_elements_of_the_palm_are_good_and_the_same_in_every_run():
    h = 5e-3
    body = BODIES["palm"]
    mesh = body_palm.discretise(body, h).mesh
    assert meshes.dihedral_angles(mesh).min() > 15
    assert meshes.dihedral_angles(mesh).max() < 140
    assert meshes.jacobian_ratios(mesh.points, mesh.tets).min() > 0.5
    nodes = np.unique(meshes.boundary_facets(mesh.tets))
    assert np.abs(shape.level_set(body.palm, mesh.points[nodes])).max() < 1e-8
    top = mesh.points[np.unique(mesh.facets["top"])]
    fine = mesh.points[mesh.facets["top"][:, :2]]
    fine = fine[np.linalg.norm(fine[..., :2], axis=2).max(axis=1) < 20e-3]
    assert np.linalg.norm(fine[:, 1] - fine[:, 0], axis=1).mean() < h
    assert len(top)
    again = body_palm.discretise(body, h).mesh
    np.testing.assert_array_equal(again.points, mesh.points)
    np.testing.assert_array_equal(again.tets, mesh.tets)


def test_a_relief_that_a_grid_cannot_follow_is_refused():
    relief = Relief(thenar_height=0.022, hypothenar_height=0.022, edge_radius=0.001)
    body = Body(kind="palm", width=0.085, depth=0.022, relief=relief)
    with pytest.raises(MeshError, match="angle between faces"):
        mapped_palm(body.palm, *grid(body.palm, 5e-3))
    with pytest.raises(MeshError, match="reduce thenar_height_mm"):
        body_palm.discretise(body, 5e-3)


def test_the_default_relief_fits_small_palms():
    width, height, depth = 0.03, 0.12, 0.008
    body = Body(kind="palm", width=width, height=height, depth=depth)
    mesh = mapped_palm(body.palm, *body_palm.grid_lines(body, min(depth / 2, 8e-3)))
    box = width * height * depth
    filled = corner_volumes(mesh.points, mesh.tets).sum()
    assert 0.5 * box < filled < box * (1 + body.palm.thenar_height / depth)


def test_edges_that_would_fold_an_element_stay_straight():
    mesh = mapped_palm(FLAT, *grid(FLAT, 5e-3))

    def rough(points):
        return shape.level_set(FLAT, points) + 0.8e-3 * np.sin(points[:, 0] / 0.4e-3)

    def slope(points):
        change = shape.gradient(FLAT, points)
        change[:, 0] += 2 * np.cos(points[:, 0] / 0.4e-3)
        return change

    found = meshes.curve_boundary(mesh, rough, slope)
    assert meshes.jacobian_ratios(found.points, found.tets).min() >= 0.3
    assert meshes.corner_volumes(found.points, found.tets).min() > 0
    middles = np.unique(mesh.facets["surface"][:, 3:])
    on_it = np.abs(rough(found.points[middles])) < 1e-6
    assert 0.05 < on_it.mean() < 0.97


def test_facets_hidden_from_above_are_not_the_top():
    lines = np.linspace(0, 0.02, 3), np.linspace(0, 0.01, 2), np.linspace(0, 0.03, 4)
    block = meshes.extrude(*lines, order=1)
    x, _, z = block.points[block.tets].mean(axis=1).T
    hook = TetMesh(points=block.points, tets=block.tets[~((x > 0.01) & (abs(z - 0.015) < 0.005))])
    mesh = meshes.tag_boundary(hook, rest="below", top=meshes.visible_from_above(hook))
    assert set(mesh.points[mesh.facets["top"]][..., 2].ravel()) == {0.03}
    assert len(mesh.facets["top"]) == 4
    assert len(mesh.facets["below"]) == len(mesh.facets["surface"]) - 4


def grid(palm, cell):
    across = (np.linspace(-side / 2, side / 2, 2 * round(side / 2 / cell) + 1)
              for side in (palm.breadth, palm.length))  # fmt: skip
    return *across, np.linspace(-palm.thickness, 0, round(palm.thickness / cell) + 1)


def measures(mesh):
    """Volume and area within curved boundary facets; the volume is exact for ten-node elements."""
    facets = meshes.boundary_facets(mesh.tets)
    _, normals = fem.load_and_probe.facet_geometry(mesh.points[facets])
    at = fem.facet_points(mesh, facets).reshape(normals.shape)
    return np.einsum("eqi,eqi->", at, normals) / 3, np.linalg.norm(normals, axis=2).sum()


def rounded_slab(palm):
    """Volume and area of a palm without relief, by the insets of its outline."""
    half, r, e = np.array([palm.breadth, palm.length]) / 2, palm.corner_radius, palm.edge_radius

    def inset(d):
        return 4 * np.prod(half - d) - (4 - np.pi) * (r - d) ** 2

    def around(d):
        return 4 * (half - d).sum() - (8 - 2 * np.pi) * (r - d)

    wall = palm.thickness - 2 * e
    rim = quad(lambda a: inset(e * (1 - np.cos(a))) * e * np.cos(a), 0, np.pi / 2)[0]
    curved = quad(lambda a: around(e * (1 - np.cos(a))) * e, 0, np.pi / 2)[0]
    return inset(0) * wall + 2 * rim, around(0) * wall + 2 * (curved + inset(e))
