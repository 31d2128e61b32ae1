"""One reading of a surface: probes, maps and views, on curved bodies and up to their silhouette."""

from dataclasses import replace

import numpy as np
import pytest

import fem
import meshes
from fem.load_and_probe import node_operator, on_surface
from simple_model import MovingPressure, Tacton, Trajectory, phasors
from skinwave import Body, Scene
from skinwave.bodies import BODIES
from skinwave.bodies.build import build
from skinwave.models.options import SolveOptions
from skinwave.planning.simulate import compute
from skinwave.results.motion import whole_motion
from skinwave.results.surface import element_map
from skinwave.results.views import body_view

pytestmark = pytest.mark.usefixtures("read_here")
BENT = {"palm": 10e-3, "fingertip": 3e-3, "silicone-disc": 8e-3}  # and element sizes in metre
SIZE = 4e-3  # m, of the elements of a roof
STILL = Tacton(am_frequency=140.0, duration=0.2, trajectory=Trajectory(shape="point"))


@pytest.fixture(scope="module", params=BENT)
def mesh(request):
    return build(BODIES[request.param], BENT[request.param]).mesh


def test_a_surface_is_read_at_its_own_nodes(mesh):
    nodes, read = node_operator(mesh)
    np.testing.assert_array_equal(nodes, np.unique(mesh.facets["top"]))
    units = [np.tile(unit, len(mesh.points)) for unit in np.eye(3)]
    inwards = np.stack([read @ unit for unit in units], axis=1)
    np.testing.assert_allclose(np.linalg.norm(inwards, axis=1), 1, rtol=1e-12)
    # A displacement that is linear in the place is read exactly, at each node its own.
    gradient = np.random.default_rng(1).normal(size=(3, 3))
    expected = (inwards * (mesh.points[nodes] @ gradient.T)).sum(axis=1)
    np.testing.assert_allclose(read @ (mesh.points @ gradient.T).ravel(), expected, atol=1e-15)


def test_places_up_to_the_silhouette_are_read_exactly(mesh):
    corners = mesh.points[mesh.facets["top"][:, :3], :2]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    places = np.random.default_rng(0).uniform(1.05 * low, 1.05 * high, (2000, 2))
    on = on_surface(mesh, places)
    read = fem.probe_operator(mesh, places[on])
    weights = abs(read).sum(axis=1)  # of shape functions within [-1/8, 1], and a unit normal
    assert weights.max() < 3
    upwards = read @ np.tile([0.0, 0.0, 1.0], len(mesh.points))
    for axis in (0, 1):
        field = np.zeros_like(mesh.points)
        field[:, 2] = mesh.points[:, axis]  # which the elements carry exactly
        off = read @ field.ravel() - upwards * places[on, axis]
        np.testing.assert_allclose(off, 0, atol=1e-9 * np.ptp(corners))
    # What is seen is as large as all facets, seen from above.
    first, second = np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 0)
    area = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]).sum() / 2
    assert on.mean() * np.prod(1.05 * (high - low)) == pytest.approx(area, rel=0.05)
    with pytest.raises(ValueError, match="not on the surface"):
        fem.probe_operator(mesh, places[~on][:1])


@pytest.fixture(scope="module")
def roof(tmp_path_factory):
    flat = meshes.block((0.016, 0.016, 0.008), SIZE)
    share = 1 + flat.points[:, 2] / 0.008
    lower = np.outer(-0.3 * share * np.abs(flat.points[:, 0]), [0, 0, 1])
    file = tmp_path_factory.mktemp("roof") / "roof.vtu"
    meshes.write(file, replace(flat, points=flat.points + lower))
    body = Body(kind="mesh", file=str(file), sides="clamped")
    pressure = MovingPressure(tacton=STILL, drive="linear")
    probes = ((0.001, 0.0), (-0.002, 0.003), (0.006, 0.002), (0.0, 0.004))
    return Scene(pressure=pressure, body=body, probes=probes)


def test_maps_and_views_read_what_probes_read(roof):
    response = compute(roof, "fem", h=SIZE)
    expected = np.abs(phasors(response, (140.0,)))[0] / np.sqrt(2)
    x = y = 1e-3 * np.arange(-6, 7)
    moved = whole_motion(roof, SolveOptions(tolerance=2e-3, h=SIZE))
    found = element_map(roof, moved, x, y)
    at = np.rint(1e3 * roof.probe_points).astype(int) + 6
    np.testing.assert_allclose(found.rms[at[:, 1], at[:, 0]], expected, rtol=5e-3)
    view = body_view(roof, "roof", moved, (1 / 140, 8))
    (node,) = np.flatnonzero(np.linalg.norm(view.places - roof.probes[3], axis=1) < 1e-6)
    assert view.inward[:, node].std() == pytest.approx(expected[3], rel=5e-3)
