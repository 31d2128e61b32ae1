"""Large displacement beyond the cases of the verification suite."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

import fem
import meshes
from fem import nonlinear
from simple_model import MovingPressure, Tacton, Trajectory, from_young
from simple_model.load.focus import along_axis
from skinwave.bodies.supports import Mounting
from skinwave.models.stretching import membrane, meshed_sheet, stretching_body
from skinwave.planning.simulate import compute
from skinwave.scene.scene import BODIES, Body, Placement, Scene
from skinwave.verify.references import elastica

PAPER = replace(BODIES["paper-sheet-loose"], width=0.06, height=0.06)
CIRCLE = Trajectory(shape="circle", size=0.02, speed=12)
LOAD = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.02, trajectory=CIRCLE))
SCENE = Scene(pressure=LOAD, body=PAPER, probes=((0.0, 0.0), (0.01, 0.005)))


@pytest.fixture(scope="module")
def sheet():
    made = meshed_sheet(PAPER, 0.01)
    return made, stretching_body(PAPER, made)


def test_membrane_adds_the_missing_stretching_stiffness(sheet):
    made, _ = sheet
    x = made.mesh.points
    stretched = np.zeros_like(x)
    stretched[:, :2] = 1e-4 * x[:, :2]
    stretched[:, 2] = -2 * 0.3 / 0.7 * 1e-4 * (x[:, 2] - x[:, 2].mean())
    given = {"fixed": np.zeros(x.shape, bool), "membrane": membrane(PAPER, made)}
    free = fem.finite_strain(made.mesh, made.material, **given)
    solid = PAPER.solid
    relaxed = (solid.complex_modulus(0.0) / solid.shear_modulus).real
    area = PAPER.width * PAPER.height
    exact = relaxed * solid.young / (1 - 0.3) * (1e-4) ** 2 * PAPER.depth * area
    assert free.energy(stretched.ravel()) == pytest.approx(exact, rel=1e-3)


def test_motion_starts_from_rest():
    response = compute(SCENE, "fem-nonlinear", h=0.01)
    assert np.abs(response.displacement[0]).max() < 1e-12 * np.abs(response.displacement).max()
    assert response.model == "fem-nonlinear"
    assert response.effort.reduced_dofs == 40
    assert response.effort.steps == 398
    assert 0 < response.effort.energy_imbalance < 0.01


def test_small_deflection_matches_a_linear_plate():
    lossy = from_young(density=800, young=8e8, poisson=0.3, viscosity=1.2e4)
    mounting = Mounting(edges=("front",))
    body = replace(PAPER, width=0.03, height=0.03, depth=2.5e-4, material=lossy, mounting=mounting)
    weak = MovingPressure(tacton=Tacton(am_frequency=60, duration=0.02), peak_pressure=1e-3)
    scene = Scene(pressure=weak, body=body, probes=((0.0, 0.0), (5e-3, 5e-3)))
    for quantity, bound in (("displacement", 0.03), ("acceleration", 0.04)):
        with_quantity = replace(scene, quantity=quantity)
        linear = compute(with_quantity, "plate-modes-transient").values
        found = compute(with_quantity, "fem-nonlinear", h=2e-3, dt=1e-4)
        difference = np.linalg.norm(found.values - linear, axis=0)
        error = (difference / np.linalg.norm(linear, axis=0)).max()
        assert error < bound
        assert error < 1.1 * found.expected_error


def test_step_that_does_not_converge_is_halved(sheet):
    made, body = sheet
    P = fem.pressure_operator(made.mesh)
    push, times = P @ np.full(P.shape[1], 20.0), set()

    def force(t):
        times.add(round(t, 9))
        return push

    states = list(islice(nonlinear.dynamic(body, force, 2e-3, most_iterations=4), 2))
    assert [s.time for s in states] == [0, 2e-3]
    assert {1e-3, 2e-3} < times
    assert np.isfinite(states[1].displacement).all()


def test_states_before_a_failure_are_yielded(sheet):
    made, body = sheet
    P = fem.pressure_operator(made.mesh)
    push = P @ np.ones(P.shape[1])
    states = nonlinear.dynamic(body, lambda t: push * (np.nan if t > 2.5e-4 else 1), 1e-4)
    first = [next(states) for _ in range(3)]
    with pytest.raises(fem.Diverged, match="step 3"):
        next(states)
    assert [s.time for s in first] == pytest.approx([0, 1e-4, 2e-4])


def thin_strip(cells):
    """A strip of 1 : 100, a downward force of 1 N on its free end, and its stiffness E I."""
    mesh = meshes.extrude(np.linspace(0, 1, cells + 1), [0, 0.05], [-0.01, 0])
    material = fem.from_young(density=1, young=1e9, poisson=0.0)
    end = np.isin(np.arange(len(mesh.points)), mesh.facets["right"][:, 3:])
    share = np.zeros_like(mesh.points)
    share[end, 2] = [-1 / end.sum()] * end.sum()
    return fem.finite_strain(mesh, material, fixed={"left": "xyz"}), share, 1e9 * 0.05 * 1e-6 / 12


@pytest.mark.parametrize("load", [10.0, 0.02])
def test_thin_strip_bends_like_the_elastica(load):
    body, share, stiffness = thin_strip(40)
    u = nonlinear.static(body, load * stiffness * share.ravel()).reshape(-1, 3)
    tip = u[share[:, 2] != 0].mean(axis=0)
    deflection, shortening = elastica(load)
    assert -tip[2] == pytest.approx(deflection, rel=1e-3)
    assert -tip[0] == pytest.approx(shortening, rel=1e-3 if load > 1 else 0.01)


def test_static_solution_that_does_not_converge_is_refused():
    body, share, stiffness = thin_strip(4)
    with pytest.raises(fem.Diverged, match="no equilibrium"):
        nonlinear.static(body, 100 * stiffness * share.ravel(), most_iterations=3)


def test_invalid_bodies_are_refused():
    mesh = meshes.block((0.02, 0.02, 0.01), 0.01)
    with pytest.raises(ValueError, match="poisson"):
        fem.finite_strain(mesh, fem.Material(density=1, shear_modulus=1, poisson=0.49))
    with pytest.raises(meshes.MeshError, match="order 2"):
        meshes.middle_plane(meshes.block((0.02, 0.02, 0.01), 0.01, order=1))
    paper = fem.PRESETS["paper"]
    layer = fem.Membrane(triangles=mesh.facets["left"], thickness=1e-3, material=paper)
    with pytest.raises(meshes.MeshError, match="one horizontal plane"):
        fem.finite_strain(mesh, paper, membrane=layer)


def test_nonlinear_models_need_a_clamped_level_sheet():
    tilted = replace(PAPER, placement=Placement(tilt_x=0.1))
    for body in (Body(), replace(PAPER, sides="absorbing"), tilted):
        with pytest.raises(ValueError, match=r"sheet"):
            compute(replace(SCENE, body=body), "fem-nonlinear", h=0.0125)


def test_lifted_sheet_gets_the_axial_pressure_of_the_focus():
    still = Tacton(am_frequency=140, duration=0.02)
    scene = replace(SCENE, pressure=MovingPressure(tacton=still, peak_pressure=1e-3))
    lifted = replace(scene, body=replace(scene.body, placement=Placement(lift=0.02)))
    moved, level = (
        np.ptp(compute(one, "fem-nonlinear", h=0.0125, dt=1e-4).displacement)
        for one in (lifted, scene)
    )
    assert moved / level == pytest.approx(float(along_axis(0.02)), rel=1e-3)
