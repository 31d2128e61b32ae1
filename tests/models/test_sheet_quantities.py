"""Displacement, strain and stress at points of thin sheets, linear and at large deflection."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

import fem
from fem import nonlinear, sheet_reading
from fem.reduced_nonlinear import in_plane_matrices
from meshes import middle_plane, sheet
from simple_model import MovingPressure, Tacton, Trajectory
from simple_model.quantities import QUANTITIES
from skinwave.models import named, stretching
from skinwave.models.limits import check_takes
from skinwave.models.meshed import probe_rows, surface_load
from skinwave.models.sheet_probes import full_reader, modal_reader
from skinwave.planning.simulate import compute
from skinwave.results.motion import shade
from skinwave.scene.scene import BODIES, Reading, Scene

PAPER = BODIES["paper-sheet-loose"].solid
PEAK = 30.0  # Pa
CIRCLE = Trajectory(shape="circle", size=0.01, speed=4.0)
SCENE = Scene(
    pressure=MovingPressure(tacton=Tacton(trajectory=CIRCLE, duration=0.01)),
    body=replace(BODIES["paper-sheet-loose"], width=0.05, height=0.05),
    probes=((0.011, 0.004), (-0.007, 0.013)),
)


@pytest.fixture(scope="module")
def plane():
    mesh = sheet(0.05, 0.04, 0.002, 4e-3)
    whole = fem.Membrane(triangles=middle_plane(mesh), thickness=1e-4, material=PAPER)
    return mesh, whole


def test_a_quadratic_deflection_has_its_slopes_and_curvatures(plane):
    """u_x = -z w,x, E_xx = u_x,x + (u_i,x u_i,x) / 2 - z w,xx, which the elements have exactly."""
    mesh, whole = plane
    points = np.array([[0.003, 0.005], [-0.0113, 0.0071]])
    x, y, _ = mesh.points.T
    u = np.stack([0.01 * x + 0.02 * y, 0.03 * y, 3 * x**2 + 7 * x * y - 5 * y**2], axis=1).ravel()
    seen, z = sheet_reading.sheet_reading(mesh, whole, points), np.array([5e-5, -3e-5])
    X, Y = points.T
    w, w_x, w_y = 3 * X**2 + 7 * X * Y - 5 * Y**2, 6 * X + 7 * Y, 7 * X - 10 * Y
    moved = (sheet_reading.displacement_rows(seen, z) @ u).reshape(-1, 3)
    np.testing.assert_allclose(moved, np.stack([-z * w_x, -z * w_y, w], axis=1), rtol=1e-8)
    strain = (sheet_reading.strain_rows(seen, z, 0.3) @ u).reshape(-1, 6)
    bent = np.stack([-6 * z, 10 * z, -7 * z], axis=1)
    np.testing.assert_allclose(strain[:, [0, 1, 3]], bent, rtol=1e-8)
    np.testing.assert_allclose(strain[:, 2], -0.3 / 0.7 * (strain[:, 0] + strain[:, 1]))
    assert not strain[:, 4:].any()
    in_plane, stretched = (rows @ u for rows in sheet_reading.in_plane_rows(seen))
    np.testing.assert_allclose(in_plane, np.stack([0.01 * X + 0.02 * Y, 0.03 * Y], 1).ravel())
    np.testing.assert_allclose(stretched, [0.01, 0.03, 0.01] * 2)
    slopes = np.array([[[0.01, 0, w_x[p]], [0.02, 0.03, w_y[p]]] for p in range(2)])
    H = np.einsum("pai,pbi->pab", slopes, slopes) / 2
    expected = np.stack([H[:, 0, 0], H[:, 1, 1], H[:, 0, 1]], axis=1)
    np.testing.assert_allclose(sheet_reading.quadratic_strain_at(seen, u), expected, rtol=1e-8)


def test_a_strip_that_is_bent_to_a_cylinder_stretches_evenly():
    """E_xx = int w'^2 dx / 2 L, u_x = E_xx x - int w'^2 / 2, w of a beam clamped at both ends."""
    length, width = 0.05, 0.02
    solid = replace(PAPER, poisson=0.0)
    mesh = sheet(length, width, 0.0015, 2.5e-3)
    whole = fem.Membrane(triangles=middle_plane(mesh), thickness=1e-4, material=solid)
    held = np.zeros(mesh.points.shape, bool)
    held[np.abs(mesh.points[:, 0]) > length / 2 - 1e-9] = True
    held[:, 1] |= np.abs(mesh.points[:, 1]) > width / 2 - 1e-9  # nothing moves across
    operators = fem.assemble(mesh, solid, fixed=held)
    b = 4.730040744862704 / length  # cosh bL cos bL = 1
    ratio = (np.cosh(b * length) - np.cos(b * length)) / (np.sinh(b * length) - np.sin(b * length))

    def w(x):
        s = b * (x + length / 2)
        return np.cosh(s) - np.cos(s) - ratio * (np.sinh(s) - np.sin(s))

    def slope(x):
        s = b * (x + length / 2)
        return b * (np.sinh(s) + np.sin(s) - ratio * (np.cosh(s) - np.cos(s)))

    basis = np.zeros((mesh.n_dofs, 1))
    basis[2::3, 0] = w(mesh.points[:, 0])
    places = np.array([-0.012, 0.004])
    seen = sheet_reading.sheet_reading(mesh, whole, np.column_stack([places, 0 * places + 0.003]))
    moved, strained = sheet_reading.in_plane_rows(seen)
    displaced = in_plane_matrices(seen, basis, moved, operators).reshape(2, 2)
    strain = in_plane_matrices(seen, basis, strained, operators).reshape(2, 3)
    strain = strain + sheet_reading.modal_quadratic_strain(seen, basis)[..., 0, 0]
    squared = quad(lambda x: slope(x) ** 2, -length / 2, length / 2)[0]
    even = squared / length / 2
    np.testing.assert_allclose(strain[:, 0] / 2, even, rtol=5e-3)
    assert np.abs(strain[:, 1:]).max() < 5e-3 * even
    before = [quad(lambda t: slope(t) ** 2, -length / 2, x)[0] / 2 for x in places]
    exact = even * (places + length / 2) - before
    np.testing.assert_allclose(displaced[:, 0] / 2, exact, rtol=1e-2)


@pytest.mark.parametrize("quantity", ["displacement_x", "stress_yy"])
def test_modes_and_all_dofs_read_the_same_of_a_stretched_sheet(quantity, preloaded):
    body, made, u, modes, operators, z = preloaded
    probes, reading = SCENE.probe_points, Reading(quantity=quantity)
    whole = full_reader(body, made, probes, reading)(u)
    few = modal_reader(body, made, modes, operators, probes, reading, "auto")(z)
    size = np.abs(whole).max()
    assert np.abs(few - whole).max() < 0.03 * size
    flat = probe_rows(body, made, probes, reading)[0] @ u  # without the stretching
    assert np.abs(flat - whole).max() > (0.05 if quantity == "stress_yy" else 1e-6) * size


@pytest.fixture(scope="module")
def preloaded():
    body, h = SCENE.body, 2.5e-3
    made = stretching.meshed_sheet(body, h)
    elastic = stretching.stretching_body(body, made)
    P, points = surface_load(made)
    force = P @ SCENE.pressure.spot(points, np.array([[0.005, 0.0]]))[0]
    u = nonlinear.static(elastic, PEAK * force)
    kept = stretching._reduce(body, h, "auto")
    z = nonlinear.static(kept.modes.elastic, kept.modes.basis.T @ (PEAK * force))
    assert 0.3 < np.abs(u).max() / body.depth < 3
    return body, made, u, kept.modes, kept.operators, z


def test_a_scene_of_a_sheet_has_its_quantities_by_every_model_of_elements():
    top, low = (
        compute(replace(SCENE, quantity="displacement_x", depth=z), "fem", h=5e-3).values
        for z in (0.0, SCENE.body.depth)
    )
    np.testing.assert_allclose(top, -low, rtol=1e-9, atol=1e-15)
    bent = replace(SCENE, quantity="largest_shear_strain")
    modal = compute(bent, "fem-nonlinear", h=5e-3, dt=1e-4).values
    assert (modal[0] < 1e-12 * modal.max(axis=0)).all()  # from rest, but for round-off
    assert (modal[1:] > 0).all()
    for model in ("flat-body", "plate-modes"):
        with pytest.raises(ValueError, match=model):
            check_takes(named(model), bent)
    with pytest.raises(ValueError, match="sheet"):
        shade(bent, None, np.zeros(1), np.zeros(1, int))


def test_quantities_that_a_sheet_does_not_have_are_refused():
    strain = {"quantity": "strain_xx"}
    grained = replace(SCENE.body, material="paper-grain")
    curled = replace(SCENE.body, mounting=replace(SCENE.body.mounting, curl_x=1e-3))
    for change in ({"depth": 2e-4}, {"body": grained, **strain}, {"body": curled, **strain}):
        with pytest.raises(ValueError, match=r"depth_mm|orthotropic|flat"):
            replace(SCENE, **change)
    mesh = sheet(0.05, 0.04, 0.002, 8e-3)
    whole = fem.Membrane(triangles=middle_plane(mesh), thickness=1e-4, material=PAPER)
    with pytest.raises(ValueError, match=r"\(60, 0\) mm"):
        sheet_reading.sheet_reading(mesh, whole, [[0.06, 0.0]])
    assert QUANTITIES["strain_xx"].field == "strain"
