"""The focal spot against the array it comes from, the drive laws, and the load they make."""

import numpy as np
import pytest

import fem
import meshes
import skinwave
from simple_model import (
    MovingPressure,
    Tacton,
    Trajectory,
    array_field,
    focal_spot,
    relative_intensity,
)
from skinwave.planning.simulate import compute

D_MM = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16, 18, 20, 25])


def on_axis(mm):
    return np.column_stack([mm / 1e3, np.zeros(len(mm))])


def array_intensity(points, height):
    p = array_field(np.column_stack([points, np.full(len(points), height)]), (0, 0, height))
    return np.abs(p) ** 2


def test_the_main_lobe_is_the_arrays():
    from_array = array_intensity(on_axis(D_MM), 0.2)
    np.testing.assert_allclose(focal_spot(on_axis(D_MM)), from_array / from_array[0], atol=0.006)


def test_the_array_makes_the_published_table():
    # Amplitude along an array axis at 200 mm, 16 x 16 pistons of 4.5 mm radius, pitch 10.3 mm.
    table = [1, .988, .952, .893, .815, .720, .613, .498, .381, .265, .155, .034, .156, .209,
             .196, .135, .070]  # fmt: skip
    p = np.sqrt(array_intensity(on_axis(D_MM), 0.2))
    np.testing.assert_allclose(p / p[0], table, atol=0.001)


@pytest.mark.parametrize(
    ("height", "half_width"), [(0.1, 3.2), (0.15, 4.1), (0.2, 5.1), (0.25, 6.2), (0.3, 7.3)]
)
def test_every_spot_has_the_arrays_half_width(height, half_width):
    for focus in ("main_lobe", "gaussian", "array"):
        at_half = focal_spot(on_axis(np.array([half_width])), height, focus)
        assert at_half == pytest.approx(0.5, abs=0.03), focus


def test_the_gaussian_carries_the_force_of_the_array():
    x = np.linspace(-0.02, 0.02, 161)
    points = np.stack(np.meshgrid(x, x), axis=-1)
    inside = np.hypot(*points.T).T <= 0.02
    force = {f: (focal_spot(points, 0.2, f) * inside).sum() for f in ("array", "gaussian")}
    assert force["gaussian"] == pytest.approx(force["array"], rel=0.02)


def test_relative_intensity_is_the_force_of_the_array_on_a_disc():
    radius, angle = (np.arange(30) + 0.5) / 30 * 0.01, np.arange(48) / 48 * 2 * np.pi
    disc = np.stack([np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))], axis=-1)

    def force(height):
        intensity = array_intensity(disc.reshape(-1, 2), height).reshape(30, 48)
        return (intensity.mean(axis=1) * radius).sum()

    for height in (0.03, 0.06, 0.12, 0.17, 0.2, 0.27, 0.45, 0.6):
        assert relative_intensity(height) == pytest.approx(force(height) / force(0.2), abs=0.01)


def test_relative_intensity_follows_the_published_table():
    mm = [20, 40, 60, 80, 100, 120, 150, 180, 200, 220, 250, 300, 350, 400, 500, 600]
    table = [0.24, 0.41, 0.57, 0.70, 0.79, 0.85, 0.93, 0.99, 1, 1, 0.96, 0.87]
    table += [0.75, 0.64, 0.46, 0.34]
    np.testing.assert_allclose([relative_intensity(h / 1e3) for h in mm], table, rtol=0.03)
    assert relative_intensity(0.2) == 1.0


def test_height_outside_the_table_is_refused():
    with pytest.raises(ValueError, match=r"outside 20..600 mm"):
        relative_intensity(0.7)


def amplitudes(drive, amplitude=1.0):
    """Mean and amplitudes at f, 2f, 3f of the load at the focus, AM at f."""
    tacton = Tacton(amplitude=amplitude, am_frequency=100)
    load = MovingPressure(tacton=tacton, drive=drive, peak_pressure=1.0)
    bins = np.abs(np.fft.rfft(load.gain(np.arange(400) / 40000))) / 400
    return bins[:4] * [1, 2, 2, 2]


def test_drive_laws_have_the_lines_of_their_formulas():
    np.testing.assert_allclose(amplitudes("linear"), [0, 1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(amplitudes("force_corrected"), [0.5, 0.5, 0, 0], atol=1e-12)
    np.testing.assert_allclose(amplitudes("pressure_squared"), [0.375, 0.5, 0.125, 0], atol=1e-12)


def test_half_the_sound_pressure_pushes_a_quarter():
    assert amplitudes("pressure_squared", 0.5) == pytest.approx(
        amplitudes("pressure_squared") / 4, abs=1e-12
    )
    assert amplitudes("linear", 0.5) == pytest.approx(amplitudes("linear") / 2, abs=1e-12)


@pytest.mark.parametrize("drive", ["linear", "pressure_squared", "force_corrected"])
def test_without_modulation_the_load_is_the_full_pressure(drive):
    assert MovingPressure(tacton=Tacton(), drive=drive)([[0.0, 0.0]], 0.3) == pytest.approx(50)


def test_the_load_is_vectorised_over_time():
    path = Trajectory(shape="square", size=0.02, speed=5)
    load = MovingPressure(tacton=Tacton(am_frequency=80, trajectory=path))
    points, t = np.random.default_rng(0).uniform(-0.02, 0.02, (7, 2)), np.linspace(0, 0.1, 5)
    assert load(points, t).shape == (5, 7)
    one_by_one = [load(points, time) for time in t]
    np.testing.assert_allclose(load(points, t), one_by_one, rtol=1e-12)


@pytest.mark.parametrize("focus", ["gaussian", "main_lobe"])
def test_total_force_survives_the_quadrature_of_a_mesh(focus):
    mesh = meshes.block(
        (0.1, 0.1, 0.015), 0.003, grading=meshes.Grading(radius=0.03, growth=1.25, coarsest=0.006)
    )
    P, points = fem.load_operator(mesh), fem.facet_points(mesh)[:, :2]
    fine = np.linspace(-0.05, 0.05, 1001)
    grid = np.stack(np.meshgrid(fine, fine), axis=-1).reshape(-1, 2)
    load = MovingPressure(
        tacton=Tacton(trajectory=Trajectory(shape="circle", size=0.03, speed=18)), profile=focus
    )
    for t in (0.0, 0.0007, 0.0031):
        force = (P @ load(points, t)).reshape(-1, 3).sum(axis=0)
        exact = load(grid, t).sum() * 1e-8
        assert -force[2] == pytest.approx(exact, rel=0.01)
        np.testing.assert_allclose(force[:2], 0, atol=1e-12 * exact)


class Louder(MovingPressure):
    def __call__(self, points, t):
        return 2 * super().__call__(points, t)


class Wider(MovingPressure):
    def spot(self, points, centre):
        return np.sqrt(super().spot(points, centre))


class Fading(MovingPressure):
    def gain(self, t, over=0.0):
        return np.exp(-np.asarray(t)) * super().gain(t, over)


class Renamed(MovingPressure):
    """Changes nothing."""


class Foreign:
    """Pushes alike everywhere."""

    tacton = Tacton(am_frequency=140, duration=0.01)
    profile, height = "gaussian", 0.2

    def __call__(self, points, t):
        t = np.asarray(t)
        return np.sin(880 * t)[..., None] * np.ones(len(points))


SHORT = Tacton(am_frequency=140, duration=0.01)
SKIN = skinwave.Body(width=0.04, height=0.04, depth=0.01)
OF_LINES = ["auto", "flat-body", "flat-body-harmonic", "fem", "fem-harmonic"]


@pytest.mark.parametrize("model", OF_LINES)
@pytest.mark.parametrize("load", [Louder, Wider, Fading, Foreign])
def test_models_of_lines_refuse_a_load_with_formulas_of_its_own(load, model):
    pressure = load() if load is Foreign else load(tacton=SHORT)
    scene = skinwave.Scene(pressure=pressure, body=SKIN)
    said = f"the load {load.__name__} .* use point-kernel, or fem-transient"
    for h in (None, 0.01) if model == "fem" else (None,):
        with pytest.raises(ValueError, match=said):
            skinwave.simulate(scene, model, h=h)


@pytest.mark.parametrize("model", ["point-kernel", "fem-transient"])
def test_models_that_evaluate_the_load_honour_its_own_formulas(model):
    plain, louder = (
        compute(skinwave.Scene(pressure=load(tacton=SHORT), body=SKIN), model, h=0.01)
        for load in (MovingPressure, Louder)
    )
    np.testing.assert_allclose(louder.displacement, 2 * plain.displacement, rtol=1e-9, atol=1e-15)
    foreign = compute(skinwave.Scene(pressure=Foreign(), body=SKIN), model, h=0.01)
    assert np.abs(foreign.displacement).max() > 0


def test_a_subclass_that_changes_no_formula_is_answered():
    plain, renamed = (
        skinwave.simulate(skinwave.Scene(pressure=load(tacton=SHORT), body=SKIN), "flat-body")
        for load in (MovingPressure, Renamed)
    )
    np.testing.assert_array_equal(renamed.displacement, plain.displacement)
