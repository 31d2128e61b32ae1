"""Every solver has the same solution, and the reduced-order model that of the full one."""

import gc
import os
import pickle
import shutil
import sys
import tempfile
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from scipy import sparse
from scipy.signal import lfilter

import fem
import meshes
import skinwave
from fem import linear_solver, memory, pardiso
from fem.harmonic import dynamic_stiffness
from fem.krylov import load_subspace
from fem.reduced import exponential_sum, line_response
from fem.sparsity import on_one_pattern
from simple_model import MovingPressure, Tacton, Trajectory
from skinwave.models.meshed import energy_balance
from skinwave.planning.simulate import compute

PROBES = np.column_stack([[0, 5, 10, 15, 20], np.zeros(5)]) * 1e-3


@pytest.fixture(scope="module")
def stiff():
    """A small dynamic stiffness and a right-hand side."""
    mesh = meshes.block((0.025, 0.025, 0.01), 0.005)
    ops = fem.assemble(mesh, fem.PRESETS["palm"], absorbing="sides")
    A = ops.K + 1e3 * ops.C + 1e6 * ops.M
    return ops, A, np.random.default_rng(0).standard_normal((A.shape[0], 3))


@pytest.mark.parametrize("backend", linear_solver.BACKENDS)
def test_every_solver_solves_real_and_complex_matrices(stiff, backend):
    if backend not in fem.available():
        pytest.skip(f"{backend} is not installed")
    ops, A, b = stiff
    factor = fem.factorise(A, backend=backend)
    assert factor.backend == backend
    x = factor.solve(b)
    assert np.abs(A @ x - b).max() < 1e-9 * np.abs(b).max()
    np.testing.assert_allclose(factor.solve(b[:, 0]), x[:, 0], rtol=1e-9)
    complex_b = b[:, 0] * (1 + 2j)
    np.testing.assert_allclose(factor.solve(complex_b), (1 + 2j) * x[:, 0], rtol=1e-9)
    A = ops.K + 1j * 900 * ops.C - 900**2 * ops.M
    x = fem.factorise(A, backend=backend).solve(b.astype(complex))
    assert np.abs(A @ x - b).max() < 1e-9 * np.abs(b).max()


def test_a_factor_larger_than_the_memory_is_kept_in_files(stiff, monkeypatch, tmp_path, caplog):
    if "pardiso" not in fem.available():
        pytest.skip("pardiso is not installed")
    _, A, b = stiff
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("MKL_PARDISO_OOC_PATH", "the user's own")
    with monkeypatch.context() as scarce:
        scarce.setattr(pardiso, "free_memory", lambda: 1e5)
        factor = fem.factorise(A)
    assert f"{A.shape[0]:,} dofs" in caplog.text
    assert list(tmp_path.glob("skinwave-factor-*/*")), "no file"
    x = factor.solve(b)
    assert np.abs(A @ x - b).max() < 1e-9 * np.abs(b).max()
    np.testing.assert_allclose(x, fem.factorise(A).solve(b), rtol=0, atol=1e-9 * np.abs(x).max())
    del factor
    gc.collect()
    assert not list(tmp_path.iterdir())
    assert os.environ["MKL_PARDISO_OOC_PATH"] == "the user's own"


def test_a_factor_larger_than_memory_and_disk_is_refused(stiff, monkeypatch):
    if "pardiso" not in fem.available():
        pytest.skip("pardiso is not installed")
    usage = shutil._ntuple_diskusage(1, 1, 1000)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: usage)
    monkeypatch.setattr(pardiso, "free_memory", lambda: 1e5)
    with pytest.raises(MemoryError, match="TMPDIR"):
        fem.factorise(stiff[1])


def test_a_body_larger_than_the_memory_is_refused_before_it_is_assembled(monkeypatch):
    monkeypatch.setattr(memory, "free_memory", lambda: 1e7)
    mesh = meshes.block((0.025, 0.025, 0.01), 0.005)
    with pytest.raises(MemoryError, match="larger elements"):
        fem.assemble(mesh, fem.PRESETS["palm"])


@pytest.mark.parametrize(("backend", "known"), [("pardiso", True), ("superlu", False)])
def test_lines_are_solved_one_after_the_other(stiff, backend, known):
    """Also by a solver that another process is sent between two of them."""
    if backend not in fem.available():
        pytest.skip(f"{backend} is not installed")
    b = stiff[2]
    terms = (fem.PronyTerm(modulus=5e3, time=1e-3), fem.PronyTerm(modulus=9e3, time=1e-4))
    mesh = meshes.block((0.025, 0.025, 0.01), 0.005)
    ops = fem.assemble(mesh, replace(fem.PRESETS["palm"], prony=terms), absorbing="sides")
    solve = fem.LineSolver(ops if known else replace(ops, laws=None), backend)
    for hertz in (0.0, 50.0, 700.0):
        A = dynamic_stiffness(ops.K, ops.C, ops.M, ops.branches, 2j * np.pi * hertz)
        x = solve(hertz, ops.expand(b))[ops.free]
        assert np.abs(A @ x - b).max() < 1e-9 * np.abs(b).max()
        solve = pickle.loads(pickle.dumps(solve))


@pytest.mark.parametrize("slowest", [0.2, 0.0])
def test_a_factor_in_single_precision_is_refined_or_made_in_double(stiff, monkeypatch, slowest):
    if "pardiso" not in fem.available():
        pytest.skip("mkl is not installed")
    monkeypatch.setattr(linear_solver, "SLOWEST", slowest)
    ops, _, b = stiff
    columns = b[:, 0], b.astype(complex)
    A = [(ops.K + 1j * w * ops.C - w**2 * ops.M).tocsr() for w in (300.0, 2000.0)]
    factorise = linear_solver.SumFactoriser([ops.K, ops.C, ops.M])
    for w, each in zip((300.0, 2000.0), A, strict=True):
        factor = factorise(np.array([1, 1j * w, -(w**2)]))
        for right in columns:
            x = factor.solve(right.astype(complex))
            assert np.abs(each @ x - right).max() < 1e-9 * np.abs(right).max()
    assert factorise._is_single == (slowest > 0)


def test_lines_of_a_thin_sheet_are_solved_as_well_as_its_matrix_allows():
    """In single precision nothing is left of its stiffness against bending."""
    mesh = meshes.sheet(0.1, 0.1, 1e-4, 0.005)
    ops = fem.assemble(mesh, fem.PRESETS["paper"], fixed="sides")
    force = fem.load_operator(mesh) @ np.ones(len(fem.facet_points(mesh)))
    S = fem.probe_operator(mesh, PROBES)
    for hertz in (80.0, 140.0):
        s = 2j * np.pi * hertz
        A = dynamic_stiffness(ops.K, ops.C, ops.M, ops.branches, s)
        exact = S[:, ops.free] @ fem.factorise(A).solve(force[ops.free].astype(complex))
        np.testing.assert_allclose(S @ fem.harmonic(ops, force, hertz)[0], exact, rtol=1e-3)


def test_patterns_that_differ_are_united():
    rng = np.random.default_rng(3)
    full = [sparse.random_array((9, 9), density=0.2, rng=rng, format="csr") for _ in range(3)]
    matrices = [(A + A.T).tocsr() for A in full]
    values, columns, starts = on_one_pattern(matrices)
    for A, each in zip(matrices, values, strict=True):
        found = sparse.csr_array((each, columns, starts), shape=A.shape)
        np.testing.assert_array_equal(found.toarray(), np.triu(A.toarray()))


def test_without_mkl_and_metis_superlu_carries_it(stiff, monkeypatch):
    _, A, b = stiff
    monkeypatch.setitem(sys.modules, "pymetis", None)
    monkeypatch.setattr(linear_solver, "mkl", lambda: None)
    factor = fem.factorise(A)
    assert factor.backend == "superlu"
    assert np.abs(A @ factor.solve(b) - b).max() < 1e-9 * np.abs(b).max()


def test_a_floating_body_and_an_unknown_solver_are_refused():
    singular = sparse.csr_array(np.array([[1.0, -1.0], [-1.0, 1.0]]))
    for backend in fem.available():
        with pytest.raises(ValueError, match="constrained"):
            fem.factorise(singular, backend=backend)
    with pytest.raises(ValueError, match="umfpack"):
        fem.factorise(sparse.eye_array(3).tocsr(), backend="umfpack")


def body(kind, h=0.1 / 24):
    if kind == "skin":
        mesh = meshes.block((0.06, 0.06, 0.015), h, grading=meshes.Grading(radius=0.02, growth=1.2))
        return mesh, fem.assemble(mesh, fem.PRESETS["palm"], absorbing="sides")
    mesh = meshes.sheet(0.1, 0.1, 1e-3, h)
    return mesh, fem.assemble(
        mesh, fem.from_young(density=80, young=4e6, poisson=0.3, loss_factor=0.03)
    )


def misfit(candidate, reference):
    return (np.linalg.norm(candidate - reference, axis=0) / np.linalg.norm(reference, axis=0)).max()


@pytest.mark.parametrize(("kind", "h"), [("skin", 0.01), ("sheet", 0.0125)])
def test_the_estimate_is_near_the_true_error(kind, h):
    """Also where moments converge ever faster, as those of sheets with little loss do."""
    mesh, ops = body(kind, h)
    P, points = fem.load_operator(mesh), fem.facet_points(mesh)[:, :2]
    S = fem.probe_operator(mesh, PROBES)
    centres = np.random.default_rng(2).uniform(-0.02, 0.02, (12, 2))
    F = P @ MovingPressure(tacton=Tacton()).spot(points, centres).T
    frequencies = [0.0, 250.0, 700.0, 1000.0]
    exact = np.array([S @ fem.harmonic(ops, F, f)[0] for f in frequencies])
    for tolerance in (5e-3, 1e-4):
        model = fem.reduce(ops, S, 1000.0, tolerance, loads=F)
        found = fem.transfer(model, model.basis.T @ F, frequencies)
        error = np.linalg.norm(found - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))
        assert model.estimate <= tolerance
        assert model.estimate / 4 < error.max() < model.estimate * 4


def test_a_space_that_holds_all_of_a_body_is_the_body():
    """More moments bring nothing but round-off, which is no direction."""
    mesh = meshes.block((0.06, 0.06, 0.015), 0.06)
    ops = fem.assemble(mesh, replace(fem.PRESETS["palm"], viscosity=0.0))
    S = fem.probe_operator(mesh, np.column_stack([np.linspace(0, 0.02, 40)] * 2))
    F = fem.load_operator(mesh).toarray()
    for probes, tolerance in ((S, 0.5), (S, 1e-3), (S[:6], 1e-3)):
        model = fem.reduce(ops, probes, 1000.0, tolerance, loads=F)
        assert len(model.operators.K) <= len(ops.free)
        basis = model.basis[ops.free]
        np.testing.assert_allclose(
            basis.T @ (ops.M @ basis), np.eye(len(model.operators.K)), atol=1e-9
        )
        found = fem.transfer(model, model.basis.T @ F, [100.0, 700.0])
        exact = np.array([probes @ fem.harmonic(ops, F, f)[0] for f in (100.0, 700.0)])
        assert np.linalg.norm(found - exact) < max(1e-9, 4 * model.estimate) * np.linalg.norm(exact)


def test_probes_in_one_element_are_no_more_than_what_moves_it():
    """Their seeds depend on each other: forty-one probes, two of them in one place."""
    mesh = meshes.block((0.03, 0.03, 0.01), 0.008)
    ops = fem.assemble(mesh, fem.PRESETS["palm"], absorbing="sides")
    places = np.column_stack([np.linspace(0, 0.01, 41), np.zeros(41)])
    places[1] = places[0]
    F = (fem.load_operator(mesh) @ np.ones(len(fem.facet_points(mesh))))[:, None]
    S = fem.probe_operator(mesh, places)
    model = fem.reduce(ops, S, 300.0, 1e-3, loads=F)
    found = fem.transfer(model, model.basis.T @ F, [140.0])[0]
    exact = S @ fem.harmonic(ops, F, 140.0)[0]
    assert np.linalg.norm(found - exact) < 2e-3 * np.linalg.norm(exact)
    np.testing.assert_array_equal(found[0], found[1])


def test_poles_answer_like_the_model(stiff):
    ops, _, _ = stiff
    mesh = meshes.block((0.025, 0.025, 0.01), 0.005)
    S = fem.probe_operator(mesh, [[0.0, 0.0], [0.004, 0.001]])
    model = fem.reduce(ops, S, 500.0, 1e-2)
    assert (np.linalg.eigvalsh(model.operators.K) > 0).all()
    poles = fem.poles(model.operators, model.outputs)
    assert (poles.values.real < 0).all()
    force = np.random.default_rng(0).standard_normal(len(model.operators.K))
    s = 2j * np.pi * 140.0
    half = poles.outputs @ (poles.inputs @ force / (s - poles.values))
    mirrored = poles.outputs.conj() @ (poles.inputs.conj() @ force / (s - poles.values.conj()))
    np.testing.assert_allclose(
        half + mirrored, fem.transfer(model, force[:, None], 140.0)[0, :, 0], rtol=1e-8
    )


def integrated(poles, load, dt):
    """Displacement from rest by an exponential integrator, exact for a load linear within steps."""
    found = np.zeros((len(poles.outputs), len(load)))
    for value, modal, output in zip(poles.values, poles.inputs, poles.outputs.T, strict=True):
        x, drive = value * dt, modal[0] * load
        end = (np.exp(x) - 1 - x) / x**2
        start = (np.exp(x) - 1) / x - end
        z, _ = lfilter([dt * end, dt * start], [1, -np.exp(x)], drive, zi=[-dt * end * drive[0]])
        found += 2 * (output[:, None] * z).real
    return found.T


def test_lines_from_rest_are_the_recurrence_at_a_fine_step():
    poles = fem.Poles(
        values=np.array([-30.0 + 400j, -900.0 + 0j]),
        inputs=np.array([[1.0 + 0.5j], [2.0 + 0j]]),
        outputs=np.array([[-0.5j, 0.1], [0.2, 0.3]]),
    )
    t = np.arange(5000) * 2e-5
    load = 2.0 + np.real((1 - 0.5j) * np.exp(2j * np.pi * 90 * t))
    recurrence = integrated(poles, load, 2e-5)
    frequencies, forces = np.array([0.0, 90.0]), np.array([[2.0 + 0j], [1 - 0.5j]])
    lines, start = line_response(poles, forces, frequencies)
    rates = np.concatenate([2j * np.pi * frequencies, poles.values])
    summed = exponential_sum(rates, np.vstack([lines, start]), t)
    assert misfit(summed, recurrence) < 1e-5
    # Chunks of times end nowhere in particular.
    short = exponential_sum(rates, np.vstack([lines, start]), t[:300])
    np.testing.assert_allclose(short, summed[:300], atol=1e-15)


def test_a_load_subspace_spans_the_load():
    centres = np.linspace(-0.01, 0.01, 40)
    x = np.linspace(-0.03, 0.03, 500)
    loads = np.exp(-((x[:, None] - centres) ** 2) / 2 / 0.004**2)
    columns = load_subspace(loads, 1e-3)
    assert columns.shape[1] < 12
    np.testing.assert_allclose(columns.T @ columns, np.eye(columns.shape[1]), atol=1e-8)
    left = loads - columns @ (columns.T @ loads)
    assert np.linalg.norm(left) < 1e-3 * np.linalg.norm(loads)


def test_an_unreachable_tolerance_is_said(monkeypatch):
    monkeypatch.setattr("fem.krylov.MOST_MOMENTS", 20)
    mesh, ops = body("sheet", 0.0125)
    S = fem.probe_operator(mesh, PROBES[:1])
    with pytest.raises(ValueError, match="raise the tolerance"):
        fem.reduce(ops, S, 1000.0, 1e-9)


@pytest.mark.parametrize("model", ["fem", "fem-transient"])
def test_every_element_answer_accounts_for_its_energy(model):
    path = Trajectory(shape="circle", size=0.01, speed=6.0)
    scene = skinwave.Scene(
        pressure=MovingPressure(tacton=Tacton(am_frequency=140, duration=0.01, trajectory=path)),
        body=skinwave.Body(width=0.04, height=0.04, depth=0.01),
        probes=((0.0, 0.0),),
    )
    found = compute(scene, model, h=0.008)
    assert 0 < found.effort.energy_imbalance < 1e-9
    assert 0.003 < found.effort.radiated < 0.5  # through the sides; the rest in the skin
    closed = replace(scene, body=replace(scene.body, sides="clamped"))
    assert compute(closed, model, h=0.008).effort.radiated == 0


def test_an_answer_that_makes_energy_is_refused():
    mesh = meshes.block((0.03, 0.03, 0.01), 0.006)
    ops = fem.assemble(mesh, fem.PRESETS["palm"])
    push = fem.load_operator(mesh) @ np.ones(fem.load_operator(mesh).shape[1])
    states = list(islice(fem.transient(ops, lambda t: push, 1e-4), 50))
    *_, (state, spent) = fem.with_energy_balance(ops, iter(states), lambda t: push)
    stored = fem.mechanical_energy(ops, state)
    assert fem.imbalance(spent, stored) < 1e-9
    *_, (state, spent) = fem.with_energy_balance(ops, iter(states), lambda t: 1.1 * push)
    stored = fem.mechanical_energy(ops, state)
    assert 0.05 < fem.imbalance(spent, stored) < 0.15
    with pytest.raises(fem.Diverged, match="energy balance"):
        energy_balance(spent, stored)
