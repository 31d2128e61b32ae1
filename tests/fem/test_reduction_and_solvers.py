"""Solvers agree with each other, and the reduced-order model with the full one."""

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
from scipy.sparse.linalg import eigsh

import fem
import meshes
import skinwave
from fem import linear_solver, memory, pardiso
from fem.boundary import Support
from fem.energy import mean_power
from fem.harmonic import dynamic_stiffness
from fem.load_and_probe import facet_points
from fem.reduced import exponential_sum, line_response
from simple_model import MovingPressure, Tacton, Trajectory
from skinwave.models.meshed import energy_balance
from skinwave.planning.simulate import compute

PROBES = np.column_stack([[0, 5, 10, 15, 20], np.zeros(5)]) * 1e-3
needs_pardiso = pytest.mark.skipif("pardiso" not in fem.available(), reason="MKL is not installed")
BACKENDS = [pytest.param("pardiso", marks=needs_pardiso), "superlu"]
PALM = fem.PRESETS["palm"]
LOSSY = replace(PALM, loss_factor=0.2)


def solves(x, A, b):
    return np.abs(A @ x - b).max() < 1e-9 * np.abs(b).max()


@pytest.fixture(scope="module")
def stiff():
    mesh = meshes.block((0.025, 0.025, 0.01), 0.005)
    ops = fem.assemble(mesh, fem.PRESETS["palm"], absorbing="sides")
    A = ops.K + 1e3 * ops.C + 1e6 * ops.M
    return ops, A, np.random.default_rng(0).standard_normal((A.shape[0], 3))


@pytest.mark.parametrize("backend", BACKENDS)
def test_every_solver_solves_real_and_complex_matrices(stiff, backend):
    ops, A, b = stiff
    factor = fem.factorise(A, backend=backend)
    assert factor.backend == backend
    x = factor.solve(b)
    assert solves(x, A, b)
    np.testing.assert_allclose(factor.solve(b[:, 0]), x[:, 0], rtol=1e-9)
    complex_b = b[:, 0] * (1 + 2j)
    np.testing.assert_allclose(factor.solve(complex_b), (1 + 2j) * x[:, 0], rtol=1e-9)
    A = ops.K + 1j * 900 * ops.C - 900**2 * ops.M
    assert solves(fem.factorise(A, backend=backend).solve(b.astype(complex)), A, b)


@needs_pardiso
def test_factor_larger_than_memory_is_kept_in_files(stiff, monkeypatch, tmp_path, caplog):
    _, A, b = stiff
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("MKL_PARDISO_OOC_PATH", "the user's own")
    with monkeypatch.context() as scarce:
        scarce.setattr(pardiso, "free_memory", lambda: 1e5)
        factor = fem.factorise(A)
    assert f"{A.shape[0]:,} dofs" in caplog.text
    assert list(tmp_path.glob("skinwave-factor-*/*"))
    x = factor.solve(b)
    assert solves(x, A, b)
    np.testing.assert_allclose(x, fem.factorise(A).solve(b), rtol=0, atol=1e-9 * np.abs(x).max())
    del factor
    gc.collect()
    assert not list(tmp_path.iterdir())
    assert os.environ["MKL_PARDISO_OOC_PATH"] == "the user's own"


@needs_pardiso
def test_factor_larger_than_memory_and_disk_is_refused(stiff, monkeypatch):
    usage = shutil._ntuple_diskusage(1, 1, 1000)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: usage)
    monkeypatch.setattr(pardiso, "free_memory", lambda: 1e5)
    with pytest.raises(MemoryError, match="TMPDIR"):
        fem.factorise(stiff[1])


def test_body_larger_than_memory_is_refused(monkeypatch):
    monkeypatch.setattr(memory, "free_memory", lambda: 1e7)
    mesh = meshes.block((0.025, 0.025, 0.01), 0.005)
    with pytest.raises(MemoryError, match="larger elements"):
        fem.assemble(mesh, fem.PRESETS["palm"])


@pytest.mark.parametrize("backend", BACKENDS)
def test_line_solver_solves_successive_frequencies(stiff, backend):
    b = stiff[2]
    terms = (fem.PronyTerm(modulus=5e3, time=1e-3), fem.PronyTerm(modulus=9e3, time=1e-4))
    mesh = meshes.block((0.025, 0.025, 0.01), 0.005)
    ops = fem.assemble(mesh, replace(fem.PRESETS["palm"], prony=terms), absorbing="sides")
    solve = fem.LineSolver(ops if backend == "pardiso" else replace(ops, laws=None), backend)
    for hertz in (0.0, 50.0, 700.0):
        A = dynamic_stiffness(ops.K, ops.C, ops.M, ops.branches, 2j * np.pi * hertz)
        assert solves(solve(hertz, ops.expand(b))[ops.free], A, b)
        solve = pickle.loads(pickle.dumps(solve))


@needs_pardiso
@pytest.mark.parametrize("slowest", [0.2, 0.0])
def test_single_precision_factor_is_refined_or_replaced(stiff, slowest):
    ops, _, b = stiff
    columns = b[:, 0], b.astype(complex)
    A = [(ops.K + 1j * w * ops.C - w**2 * ops.M).tocsr() for w in (300.0, 2000.0)]
    factorise = linear_solver.SumFactoriser([ops.K, ops.C, ops.M], slowest=slowest)
    for w, each in zip((300.0, 2000.0), A, strict=True):
        factor = factorise(np.array([1, 1j * w, -(w**2)]))
        for right in columns:
            assert solves(factor.solve(right.astype(complex)), each, right)
    assert factorise._is_single == (slowest > 0)


def test_lines_of_a_thin_sheet_match_double_precision():
    mesh = meshes.sheet(0.1, 0.1, 1e-4, 0.005)
    ops = fem.assemble(mesh, fem.PRESETS["paper"], fixed="sides")
    force = fem.pressure_operator(mesh) @ np.ones(len(fem.facet_points(mesh)))
    S = fem.probe_operator(mesh, PROBES)
    for hertz in (80.0, 140.0):
        s = 2j * np.pi * hertz
        A = dynamic_stiffness(ops.K, ops.C, ops.M, ops.branches, s)
        exact = S[:, ops.free] @ fem.factorise(A).solve(force[ops.free].astype(complex))
        np.testing.assert_allclose(S @ fem.harmonic(ops, force, hertz)[0], exact, rtol=1e-3)


def test_superlu_works_without_mkl_and_metis(stiff, monkeypatch):
    _, A, b = stiff
    monkeypatch.setitem(sys.modules, "pymetis", None)
    monkeypatch.setattr(linear_solver, "mkl", lambda: None)
    factor = fem.factorise(A)
    assert factor.backend == "superlu"
    assert solves(factor.solve(b), A, b)


def test_free_body_and_unknown_solver_are_refused():
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
    light = fem.from_young(density=80, young=4e6, poisson=0.3, loss_factor=0.03)
    return mesh, fem.assemble(mesh, light)


def misfit(candidate, reference):
    return (np.linalg.norm(candidate - reference, axis=0) / np.linalg.norm(reference, axis=0)).max()


@pytest.mark.parametrize(("kind", "h"), [("skin", 0.01), ("sheet", 0.0125)])
def test_error_estimate_is_near_the_true_error(kind, h):
    mesh, ops = body(kind, h)
    P, points = fem.pressure_operator(mesh), fem.facet_points(mesh)[:, :2]
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


def test_basis_of_all_dofs_gives_the_full_model():
    mesh = meshes.block((0.06, 0.06, 0.015), 0.06)
    ops = fem.assemble(mesh, replace(fem.PRESETS["palm"], viscosity=0.0))
    S = fem.probe_operator(mesh, np.column_stack([np.linspace(0, 0.02, 40)] * 2))
    F = fem.pressure_operator(mesh).toarray()
    for probes, tolerance in ((S, 0.5), (S, 1e-3), (S[:6], 1e-3)):
        model = fem.reduce(ops, probes, 1000.0, tolerance, loads=F)
        assert len(model.operators.K) <= len(ops.free)
        basis = model.basis[ops.free]
        mass = basis.T @ (ops.M @ basis)
        np.testing.assert_allclose(mass, np.eye(len(mass)), atol=1e-9)
        found = fem.transfer(model, model.basis.T @ F, [100.0, 700.0])
        exact = np.array([probes @ fem.harmonic(ops, F, f)[0] for f in (100.0, 700.0)])
        assert np.linalg.norm(found - exact) < max(1e-9, 4 * model.estimate) * np.linalg.norm(exact)


def test_dependent_probes_in_one_element():
    mesh = meshes.block((0.03, 0.03, 0.01), 0.008)
    ops = fem.assemble(mesh, fem.PRESETS["palm"], absorbing="sides")
    places = np.column_stack([np.linspace(0, 0.01, 41), np.zeros(41)])
    places[1] = places[0]
    F = (fem.pressure_operator(mesh) @ np.ones(len(fem.facet_points(mesh))))[:, None]
    S = fem.probe_operator(mesh, places)
    model = fem.reduce(ops, S, 300.0, 1e-3, loads=F)
    found = fem.transfer(model, model.basis.T @ F, [140.0])[0]
    exact = S @ fem.harmonic(ops, F, 140.0)[0]
    assert np.linalg.norm(found - exact) < 2e-3 * np.linalg.norm(exact)
    np.testing.assert_array_equal(found[0], found[1])


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


def test_lines_from_rest_match_an_exponential_integrator():
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
    # The number of times need not be a multiple of the chunks.
    short = exponential_sum(rates, np.vstack([lines, start]), t[:300])
    np.testing.assert_allclose(short, summed[:300], atol=1e-15)


def test_unreachable_tolerance_is_refused():
    mesh, ops = body("sheet", 0.0125)
    S = fem.probe_operator(mesh, PROBES[:1])
    with pytest.raises(ValueError, match=r"8 moments.*raise the tolerance"):
        fem.reduce(ops, S, 1000.0, 1e-9, most_moments=8)


@pytest.mark.parametrize("model", ["fem", "fem-transient"])
def test_element_models_balance_energy(model):
    path = Trajectory(shape="circle", size=0.01, speed=6.0)
    scene = skinwave.Scene(
        pressure=MovingPressure(tacton=Tacton(am_frequency=140, duration=0.01, trajectory=path)),
        body=skinwave.Body(width=0.04, height=0.04, depth=0.01),
        probes=((0.0, 0.0),),
    )
    found = compute(scene, model, h=0.008)
    assert 0 < found.effort.energy_imbalance < 1e-9
    assert 0 < found.effort.radiated < 0.1  # through the sides; the rest in the skin
    if model == "fem-transient":  # the other cannot reduce a body without loss
        lossless = replace(scene.body, material=replace(fem.PRESETS["palm"], viscosity=1e-6))
        free = compute(replace(scene, body=lossless), model, h=0.008)
        assert free.effort.radiated == pytest.approx(1, abs=1e-3)
    closed = replace(scene, body=replace(scene.body, sides="clamped"))
    assert compute(closed, model, h=0.008).effort.radiated == 0


def test_mean_powers_of_an_oscillator_are_those_of_its_dashpots():
    f, amplitude, (lost, radiated) = 20.0, 2e-3, (3.0, 4.0)  # Hz, m, N s/m
    motion, w = np.array([[amplitude * np.exp(0.3j)]]), 2 * np.pi * f
    dampings = np.array([[lost + radiated]]), np.array([[radiated]])
    force = (5e3 + 1j * w * dampings[0]) * motion  # on a spring
    found = mean_power(*dampings, force, motion, np.array([f]))
    speed = w**2 * amplitude**2 / 2
    powers = found.work, found.dissipated, found.radiated
    np.testing.assert_allclose(powers, np.array([lost + radiated, lost, radiated]) * speed)


def test_energy_imbalance_is_refused():
    mesh = meshes.block((0.03, 0.03, 0.01), 0.006)
    ops = fem.assemble(mesh, fem.PRESETS["palm"])
    push = fem.pressure_operator(mesh) @ np.ones(fem.pressure_operator(mesh).shape[1])
    states = list(islice(fem.transient(ops, lambda t: push, 1e-4), 50))
    *_, (state, spent) = fem.with_energy_balance(ops, iter(states), lambda t: push)
    stored = fem.mechanical_energy(ops, state)
    assert fem.imbalance(spent, stored) < 1e-9
    *_, (state, spent) = fem.with_energy_balance(ops, iter(states), lambda t: 1.1 * push)
    stored = fem.mechanical_energy(ops, state)
    assert 0.05 < fem.imbalance(spent, stored) < 0.15
    with pytest.raises(fem.Diverged, match="energy balance"):
        energy_balance(spent, stored)


def sheet(thickness, fixed, h=21e-3):
    mesh = meshes.sheet(0.148, 0.210, thickness, h)
    fixed = dict.fromkeys(fixed, "xyz") or np.zeros(mesh.points.shape, bool)
    return fem.assemble(mesh, fem.PRESETS["paper"], fixed=fixed)


def test_modes_of_paper_clamped_at_two_edges():
    operators = sheet(1e-4, ("left", "right"))
    found, shapes = fem.modes(operators, 6)
    expected = np.sqrt(eigsh(operators.K, 6, M=operators.M, sigma=0)[0]) / (2 * np.pi)
    np.testing.assert_allclose(found, expected, rtol=1e-3)
    kept = shapes[operators.free]
    np.testing.assert_allclose(kept.T @ (operators.M @ kept), np.eye(6), atol=1e-6)


@pytest.mark.slow
def test_bending_frequencies_of_free_paper_scale_with_thickness():
    thin, thick = (fem.modes(sheet(thickness, ()), 10)[0] for thickness in (1e-4, 1e-3))
    assert (thin[:6] < 0.2).all()
    np.testing.assert_allclose(thin[6:], thick[6:] / 10, rtol=0.01)


def test_modes_that_do_not_converge_are_refused():
    with pytest.raises(fem.Diverged, match="constrain it"):
        fem.modes(sheet(1e-4, ()), 8, most_restarts=1)


def block(material):
    mesh = meshes.block((0.02, 0.02, 0.01), 0.01)
    below = np.linspace(0, 2e7, len(facet_points(mesh, "bottom")))
    rest = Support(facets=mesh.facets["bottom"], stiffness=below, absorbed=0 * below)
    given = {"fixed": {}, "absorbing": "sides", "support": rest}
    halves = replace(mesh, region=np.arange(len(mesh.tets)) % 2)
    alike = fem.assemble(halves, {0: material, 1: material}, **given)
    return mesh, fem.assemble(mesh, material, **given), alike


def same(one, other):
    return abs(one - other).max() < 1e-10 * abs(other).max()


@pytest.mark.parametrize("material", [LOSSY, fem.PRESETS["palm-zener"]])
def test_combinations_equal_matrices_assembled_part_by_part(material):
    material = replace(material, poisson=0.45)
    _, one, parts = block(material)
    assert one.laws
    assert one.laws.damping.rest.nnz
    for name in "KCMR":
        assert same(getattr(one, name), getattr(parts, name))
    assert [b.time for b in one.branches] == [b.time for b in parts.branches]
    assert all(same(a.K, b.K) for a, b in zip(one.branches, parts.branches, strict=True))


@pytest.mark.parametrize("material", [PALM, LOSSY])
def test_moments_by_combinations_equal_those_by_products(material):
    mesh, ops, _ = block(material)
    S = fem.probe_operator(mesh, [[0.0, 0.0], [0.004, 0.001]])
    F = fem.pressure_operator(mesh) @ np.random.default_rng(0).random((len(facet_points(mesh)), 3))
    both = ops, replace(ops, laws=None)
    found, plain = (fem.reduce(each, S, 500.0, 1e-3, loads=F) for each in both)
    assert found.moments == plain.moments
    one, other = (
        fem.transfer(model, model.basis.T @ F, [10.0, 250.0, 500.0]) for model in (found, plain)
    )
    np.testing.assert_allclose(one, other, atol=1e-8 * np.abs(other).max())
    assert not np.delete(found.basis, ops.free, axis=0).any()
    basis, projected = found.basis[ops.free], found.operators
    pairs = [(getattr(ops, name), getattr(projected, name)) for name in "KCMR"]
    pairs += [(a.K, b.K) for a, b in zip(ops.branches, projected.branches, strict=True)]
    for full, small in pairs:
        np.testing.assert_allclose(basis.T @ (full @ basis), small, atol=1e-9 * np.abs(small).max())
