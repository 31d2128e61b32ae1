"""Palms as mapped structured meshes: their geometry, their elements, and what they fall back on."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

import fem
import meshes
from meshes import MeshError, Palm, corner_volumes, mapped_palm
from meshes.shapes import palm as shape
from meshes.shapes.kuhn import kuhn_tets
from meshes.surface.triangulation import area, volume
from skinwave.bodies import palm as body_palm
from skinwave.bodies.body import Body
from skinwave.scene.scene import BODIES, Relief

FLAT = Palm(
    cup_depth=0, thenar_height=0, hypothenar_height=0, pad_height=0, thickness=0.015,
    edge_radius=0.007,
)  # fmt: skip


def grid(palm, cell):
    """Equal cells, an even number along x and y."""
    return (
        np.linspace(-palm.breadth / 2, palm.breadth / 2, 2 * round(palm.breadth / 2 / cell) + 1),
        np.linspace(-palm.length / 2, palm.length / 2, 2 * round(palm.length / 2 / cell) + 1),
        np.linspace(-palm.thickness, 0, round(palm.thickness / cell) + 1),
    )


def measures(mesh):
    """Volume and area within curved boundary facets; the volume is exact for ten-node elements."""
    facets = meshes.boundary_facets(mesh.tets)
    _, normals = fem.load_and_probe.facet_geometry(mesh, facets)
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


def test_a_palm_with_relief_has_the_volume_and_the_area_of_its_level_set():
    palm = BODIES["palm"].palm
    contour = shape.surface(palm, 1.5e-3)
    found = measures(meshes.mapped_palm(palm, *grid(palm, 4e-3)))
    assert found == pytest.approx((volume(contour), area(contour)), rel=5e-3)


@pytest.mark.parametrize("h", [5e-3, 4e-3])
def test_elements_of_the_palm_are_good_and_the_same_in_every_run(h):
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


def test_a_sharp_rim_is_kept():
    """As in the palm that is compared with a slab."""
    sharp = replace(FLAT, corner_radius=0.002, edge_radius=0.001, thickness=0.010)
    found = measures(meshes.mapped_palm(sharp, *grid(sharp, 3.5e-3)))
    assert found == pytest.approx(rounded_slab(sharp), rel=1e-2)


def test_a_relief_that_a_grid_cannot_follow_is_left_to_the_mesher(monkeypatch):
    steep = replace(Palm(), thenar_height=0.022, hypothenar_height=0.022, edge_radius=0.001)
    with pytest.raises(MeshError, match="lower relief or `palm_mesh`"):
        meshes.mapped_palm(steep, *grid(steep, 5e-3))
    relief = Relief(thenar_height=0.022, hypothenar_height=0.022, edge_radius=0.001)
    asked = []

    def meshed(palm, h, sizing):
        asked.append((palm, h, sizing(np.zeros((1, 3)))))
        return meshes.builtin("palm")

    monkeypatch.setattr(body_palm, "palm_mesh", meshed)
    body_palm.discretise(Body(kind="palm", width=0.085, depth=0.022, relief=relief), 5e-3)
    assert asked == [(steep, 5e-3, pytest.approx(4e-3))]


@pytest.mark.parametrize(
    "size", [(0.044, 0.048, 0.0093), (0.05, 0.05, 0.006), (0.03, 0.12, 0.008), (0.06, 0.06, 0.012)]
)
def test_the_usual_relief_fits_every_palm(size):
    """Its volume is below that of the box and its mounds, and above half of the box."""
    width, height, depth = size
    body = Body(kind="palm", width=width, height=height, depth=depth)
    mesh = mapped_palm(body.palm, *body_palm.body_lines(body, min(depth / 2, 8e-3)))
    box = width * height * depth
    filled = corner_volumes(mesh.points, mesh.tets).sum()
    assert 0.5 * box < filled < box * (1 + body.palm.thenar_height / depth)


def test_the_usual_relief_of_a_palm_is_an_adults():
    body = Body(kind="palm", width=0.085)
    assert body.palm == replace(Palm(), thickness=0.015, edge_radius=0.007)


def test_a_palm_without_a_mesh_says_which_key_to_change(monkeypatch):
    """With the value that it names there is a mesh."""
    relief = Relief(thenar_height=0.022, edge_radius=0.001)
    body = Body(kind="palm", width=0.085, depth=0.022, relief=relief)

    def crosses(palm, h, sizing):
        raise MeshError("the surface crosses itself")

    monkeypatch.setattr(body_palm, "palm_mesh", crosses)
    with pytest.raises(MeshError, match="take thenar_height_mm = ") as refused:
        body_palm.discretise(body, 8e-3)
    height = float(str(refused.value).split("= ")[-1]) / 1e3
    lower = replace(body, relief=replace(relief, thenar_height=height))
    assert len(body_palm.discretise(lower, 8e-3).mesh.tets)
