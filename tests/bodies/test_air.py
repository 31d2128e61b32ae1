"""Air around a sheet, in every model that has it; the others refuse."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import fem
from simple_model import MovingPressure, Tacton, Trajectory
from simple_model.layers.compliance import thin_sheet
from simple_model.layers.wavenumber_integral import point_response
from simple_model.plates.free_modes import free_modes
from skinwave.bodies.build import build, operators
from skinwave.bodies.sheet import air, air_mass, bending_wavenumber
from skinwave.models.meshed import surface_load
from skinwave.models.options import SolveOptions
from skinwave.models.plate_modes import modes_of, plate_of
from skinwave.models.reduced import answer, reduce_scene, typical_spots
from skinwave.models.stretching import reduced_answer
from skinwave.planning.simulate import compute
from skinwave.scene.scene import BODIES, Mounting, Placement, Scene
from skinwave.verify import references
from skinwave.verify.setups import PAPER

SHEET = replace(BODIES["paper-sheet-loose"], width=0.06, height=0.05, air=True)
PATH = Trajectory(shape="circle", size=0.01, speed=4.0)
LOAD = MovingPressure(tacton=Tacton(am_frequency=140, duration=0.1, trajectory=PATH))
SCENE = Scene(pressure=LOAD, body=SHEET, probes=((0.01, 0.0), (0.0, 0.012)))
H = 5e-3


@pytest.mark.parametrize("model", ["fem-transient", "fem-nonlinear-transient"])
def test_models_without_modes_refuse_air(model):
    with pytest.raises(ValueError, match=f"{model} .*air"):
        compute(SCENE, model, h=H)


@pytest.mark.parametrize("around", ["free", "baffle"])
def test_added_mass_is_symmetric_positive_and_independent_of_position(around):
    tilted = replace(SHEET, air=around, placement=Placement(tilt_x=0.5, tilt_y=-0.3, lift=0.01))
    turned = build(tilted, H)
    made = replace(build(SHEET, H), held=turned.held)
    ops = operators(made)
    M = air(replace(SHEET, air=around), made, ops.free).mass
    rng = np.random.default_rng(3)
    x, y = rng.standard_normal((2, len(ops.free)))
    assert x @ (M @ y) == pytest.approx(y @ (M @ x), rel=1e-9)
    assert x @ (M @ x) > 0
    A = air(tilted, turned, operators(turned).free).mass

    def placed(u):
        full = ops.expand(u).reshape(-1, 3) @ tilted.placement.rotation.T
        return full.ravel()[ops.free]

    assert placed(x) @ (A @ placed(y)) == pytest.approx(x @ (M @ y), rel=1e-9)


def test_static_moments_suffice_within_their_error_estimate():
    made = build(SHEET, H)
    ops = operators(made)
    P, points = surface_load(made)
    loads_ = P @ typical_spots(SHEET, points)
    S = fem.probe_operator(made.mesh, SCENE.probe_points)
    reduced = partial(fem.reduce, ops, S, 1000.0, loads=loads_, air=air(SHEET, made, ops.free))
    few, many = reduced(1e-3), reduced(1e-6)
    assert few.basis.shape[1] < many.basis.shape[1]
    hz = np.linspace(5, 1000, 100)
    a, b = (fem.transfer(model, model.basis.T @ loads_, hz) for model in (few, many))
    error = np.linalg.norm(a - b, axis=(1, 2)) / np.linalg.norm(b, axis=(1, 2))
    assert error.max() < 1e-3
    assert few.estimate / 4 < error.max() < few.estimate * 4
    basis = few.basis[ops.free]
    mass = basis.T @ (ops.M @ basis + air(SHEET, made, ops.free).mass @ basis)
    np.testing.assert_allclose(mass, np.eye(len(mass)), atol=1e-9)


@pytest.mark.parametrize("around", ["free", "baffle"])
def test_a_quarter_in_air_moves_like_the_whole(around):
    still = replace(LOAD, tacton=replace(LOAD.tacton, trajectory=Trajectory()))
    scene = replace(SCENE, pressure=still, body=replace(SHEET, air=around))
    whole, part = (
        answer(reduce_scene(scene, SolveOptions(h=H), symmetry=axes), scene).displacement
        for axes in ("", "xy")
    )
    assert np.linalg.norm(part - whole) < 2e-3 * np.linalg.norm(whole)


@pytest.mark.parametrize("around", ["free", "baffle"])
def test_elements_and_modes_ring_alike_in_air(around):
    """Lowest natural frequencies and decays of a stretched sheet, of modes that probes can read."""
    held = Mounting(tension_x=30.0, tension_y=10.0)
    sheet = replace(BODIES["a6-sheet"], width=0.06, height=0.05, air=around, mounting=held)
    reduced = reduce_scene(replace(SCENE, body=sheet), SolveOptions(h=2e-3))
    found = reduced.poles.values
    found = found[found.imag > 1.0]
    found = found[np.argsort(found.imag)][:3]
    free = free_modes(modes_of(plate_of(sheet)), sheet.solid)
    exact = free.poles[free.residues.imag != 0]
    exact = exact[exact.imag > 1.0]
    exact = exact[np.argsort(exact.imag)][:3]
    np.testing.assert_allclose(found.imag, exact.imag, rtol=5e-3)
    np.testing.assert_allclose(found.real, exact.real, rtol=0.03)


@pytest.mark.slow
def test_small_motion_of_a_stretching_sheet_is_linear():
    tacton = replace(LOAD.tacton, duration=0.4, am_frequency=60.0)
    scene = replace(SCENE, pressure=replace(LOAD, peak_pressure=1e-3, tacton=tacton))
    times = np.arange(4000) / 1e4
    linear = answer(reduce_scene(scene, SolveOptions(h=2e-3)), scene).displacement
    modes = reduced_answer(scene, times, SolveOptions(h=2e-3)).displacement
    settled = slice(3000, None)
    a, b = (u[settled] - u[settled].mean(axis=0) for u in (linear, modes))
    assert np.linalg.norm(a - b) < 0.08 * np.linalg.norm(a)


def test_air_at_complex_frequencies_follows_the_exact_kernel():
    """The lowest frequencies of a transform with damping, as `flat_body` takes them."""
    radii, paper = np.array([0.0, 0.01, 0.03]), fem.PRESETS["paper"]

    def modulus(w):
        return complex(paper.complex_modulus(w) / paper.shear_modulus)

    for air_density in (0.0, 1.2):
        sheet = thin_sheet(fem.PRESETS["paper"], 1e-4, air_density=air_density)
        for w in (-5.8j, 3.1 - 5.8j, -58j):
            kernel = partial(
                references.plate_kernel, w=w, mass=PAPER["mass_per_area"], air=air_density,
                stiffness=PAPER["bending_stiffness"] * modulus(w),
            )  # fmt: skip
            exact = references.gaussian_response(kernel, radii, width=4.35e-3)
            found = point_response(sheet, radii, [w], 4.35e-3)[0]
            np.testing.assert_allclose(found, exact, rtol=1e-3)


def test_waves_of_a_sheet_are_slower_in_air():
    vacuum = replace(SHEET, air=False)
    k = bending_wavenumber(SHEET, 191.0)
    w = 2 * np.pi * 191.0
    inertia = SHEET.mass_per_area + air_mass(SHEET, 191.0)
    assert SHEET.bending_stiffness * k**4 == pytest.approx(inertia * w**2, rel=1e-9)
    assert 1.04 < k / bending_wavenumber(vacuum, 191.0) < 1.08
