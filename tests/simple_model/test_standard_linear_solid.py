"""The standard linear solid: what it is in its limits, and the same in every model."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from scipy import sparse
from scipy.integrate import solve_ivp

import fem
import meshes
import skinwave
from fem.reduced import exponential_sum, line_response
from fem.reduced_nonlinear import modal_elastic
from simple_model import MovingPressure, PronyTerm, Tacton, Trajectory
from simple_model.load.spectrum import reduced_lines
from skinwave.planning.simulate import compute
from skinwave.scene.scene import Body

ZENER = fem.PRESETS["palm-zener"]
CIRCLE = Trajectory(shape="circle", size=0.01, speed=6.0)
LOAD = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.01, trajectory=CIRCLE))
SCENE = skinwave.Scene(
    pressure=LOAD,
    body=Body(material="palm-zener", width=0.04, height=0.04, depth=0.01),
    probes=((0.0, 0.0), (0.005, 0.0)),
)


@pytest.fixture(scope="module")
def block():
    mesh = meshes.block((0.03, 0.03, 0.01), 0.005)
    points, P = fem.facet_points(mesh)[:, :2], fem.pressure_operator(mesh)
    force = P @ np.exp(-(points**2).sum(axis=1) / 2 / 0.00435**2)
    return mesh, force, fem.probe_operator(mesh, [[0.0, 0.0], [0.005, 0.0]])


def layered(mesh):
    depth = -mesh.points[mesh.tets[:, :4], 2].mean(axis=1)
    slower = replace(ZENER, prony=(PronyTerm(modulus=10e3, time=2e-3),), viscosity=1.0)
    layers = {0: slower, 1: ZENER, 2: fem.PRESETS["palm"]}
    return replace(mesh, region=np.searchsorted([0.003, 0.006], depth)), layers


def test_layers_relax_each_in_its_own_time():
    mesh, layers = layered(meshes.extrude(*2 * [np.linspace(-0.01, 0.01, 5)], [-0.009, -0.006,
                                          -0.003, 0.0]))  # fmt: skip
    ops = fem.assemble(mesh, layers, fixed="bottom")
    assert [branch.time for branch in ops.branches] == [0.5e-3, 2e-3]
    w = 2 * np.pi * 140
    frozen = {
        r: replace(m, prony=(), shear_modulus=(mu := m.complex_modulus(w)).real,
                   viscosity=mu.imag / w)
        for r, m in layers.items()
    }  # fmt: skip
    force = np.random.default_rng(0).standard_normal(mesh.n_dofs)
    found = fem.harmonic(ops, force, 140.0)
    expected = fem.harmonic(fem.assemble(mesh, frozen, fixed="bottom"), force, 140.0)
    assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()
    # Reduced, and in its own coordinates, where two thirds of the springs are missing.
    S = fem.probe_operator(mesh, [[0.0, 0.0], [0.005, 0.0]])
    model = fem.reduce(ops, S, 500.0, 1e-4)
    push = model.basis.T @ force
    u = S @ found[0]
    small = fem.transfer(model, push[:, None], 140.0)[0, :, 0]
    np.testing.assert_allclose(small, u, rtol=2e-4, atol=2e-4 * np.abs(u).max())
    poles = fem.poles(model.operators, model.outputs)
    assert len(poles.values) < 4 * len(model.operators.K)
    assert (poles.values.real < 0).all()
    lines, _ = line_response(poles, push[None], np.array([140.0]))
    np.testing.assert_allclose(lines[0], small, rtol=1e-8)


@pytest.mark.slow
def test_reduced_motion_from_rest_is_that_of_the_transient():
    mesh = meshes.block((0.03, 0.03, 0.01), 0.005)
    ops = fem.assemble(mesh, ZENER, absorbing="sides")
    P, points = fem.pressure_operator(mesh), fem.facet_points(mesh)[:, :2]
    S = fem.probe_operator(mesh, [[0.0, 0.0], [0.005, 0.0], [0.01, 0.0]])
    load = replace(LOAD, drive="linear")  # which begins at 0: a jump would ask for smaller steps
    path = load.tacton.trajectory
    typical = P @ load.spot(points, path.at_phase(np.linspace(0, 1, 12))).T
    model = fem.reduce(ops, S, 1000.0, 2e-4, loads=typical)
    dt = 1.25e-5
    states = islice(fem.transient(ops, lambda t: P @ load(points, t), dt), 500)
    full = np.array([S @ state.displacement for state in states])
    poles = fem.poles(model.operators, model.outputs)
    frequencies, forces = reduced_lines(load, points, P.T @ model.basis)
    lines, start = line_response(poles, forces, frequencies)
    rates = np.concatenate([2j * np.pi * frequencies, poles.values])
    reduced = exponential_sum(rates, np.vstack([lines, start]), np.arange(500) * dt)
    misfit = np.linalg.norm(reduced - full, axis=0) / np.linalg.norm(full, axis=0)
    assert misfit.max() <= 1e-3


def test_the_energy_balance_includes_losses_of_the_law():
    found = compute(SCENE, "fem-transient", h=0.012)
    assert found.effort.energy_imbalance < 1e-6
    assert 0 < found.effort.radiated < 0.9  # all that is not radiated is lost in the law


def test_small_motion_at_large_displacement_relaxes_as_linear_motion_does():
    solid = replace(ZENER, poisson=0.3, prony=(), loss_factor=0.3)
    mesh = meshes.sheet(0.02, 0.02, 0.002, 0.01)
    layer = fem.Membrane(triangles=meshes.middle_plane(mesh), thickness=1e-3, material=solid)
    body = fem.finite_strain(mesh, solid, fixed="sides", membrane=layer)
    shape, dt = np.zeros(mesh.n_dofs), 1e-4
    shape[2::3] = 1e-9

    def force(t):
        return np.sin(2 * np.pi * 200 * t) * shape

    linear = list(islice(fem.transient(body.operators, force, dt), 60))
    found = list(islice(fem.with_energy_balance(
        body, fem.nonlinear.dynamic(body, force, dt, tolerance=1e-9), force), 60,
    ))  # fmt: skip
    moved = np.array([[state.displacement, each.displacement]
                      for each, (state, _) in zip(linear, found, strict=True)])  # fmt: skip
    assert np.linalg.norm(moved[:, 0] - moved[:, 1]) < 1e-6 * np.linalg.norm(moved[:, 1])
    state, spent = found[-1]
    stored = fem.mechanical_energy(body, state)
    assert spent.dissipated > 0.05 * spent.work
    assert abs(spent.work - stored - spent.lost) < 1e-6 * spent.work


def test_modes_of_a_sheet_relax_as_the_sheet_does():
    solid = replace(ZENER, poisson=0.3)
    modal = fem.Operators(
        K=sparse.diags_array([4e4, 9e4]).tocsr(), C=sparse.csr_array((2, 2)),
        M=sparse.eye_array(2).tocsr(), R=sparse.csr_array((2, 2)), free=np.arange(2), n_dofs=2,
        branches=(fem.MaxwellBranch(K=sparse.diags_array([16e3, 36e3]).tocsr(), time=0.5e-3),),
    )  # fmt: skip
    H = np.array([[[3e5, 1e5], [1e5, 2e5]]])
    body = modal_elastic(modal, H, solid)
    force, dt = np.array([300.0, 100.0]), 1e-5
    states = islice(fem.with_energy_balance(
        body, fem.nonlinear.dynamic(body, lambda t: force, dt, tolerance=1e-9), lambda t: force,
    ), 400)  # fmt: skip
    # The same equations, by a solver of ordinary differential equations.
    share = 10e3 / 25e3

    def rate(t, x):
        z, v, d, q = x[:2], x[2:4], x[4:6], x[6]
        Hz = H[0] @ z
        pull = modal.K @ z + modal.branches[0].K @ d + (z @ Hz / 2 + share * q) * Hz
        return np.concatenate([v, force - pull, v - d / 0.5e-3, [v @ Hz - q / 0.5e-3]])

    exact = solve_ivp(rate, (0, 399 * dt), np.zeros(7), rtol=1e-9, atol=1e-12,
                      t_eval=np.arange(400) * dt).y[:2].T  # fmt: skip
    found = list(states)
    moved = np.array([state.displacement for state, _ in found])
    assert np.linalg.norm(moved - exact) < 2e-3 * np.linalg.norm(exact)
    state, spent = found[-1]
    stored = fem.mechanical_energy(body, state)
    assert abs(spent.work - stored - spent.lost) < 2e-3 * spent.work
